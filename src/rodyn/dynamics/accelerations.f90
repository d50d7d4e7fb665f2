!> p' of a scene at a time and state: the kernel and the parts of it that the scene needs, chosen once.
module rodyn_accelerations
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type
   use rodyn_scene, only: scene_type
   use rodyn_workspace, only: workspace_type, new_workspace
   use rodyn_trigonometry, only: sine_cosine
   use rodyn_hinge_law, only: hinge_law, hinge_moments, hinge_state, openings
   use rodyn_loads, only: load_set, load_regime, load_forces, new_load_set, new_load_regime, evaluate_loads
   use rodyn_kink_program, only: kink_regime, new_kink_regime, evaluate_kinks
   use rodyn_user_load, only: user_load
   use rodyn_recursion_flexible, only: flexible_accelerations
   use rodyn_recursion_inextensible, only: inextensible_recursion, new_inextensible_recursion, &
                                             inextensible_accelerations
   use rodyn_recursion_rigid, only: rigid_accelerations
   use rodyn_recursion_lumped, only: lumped_accelerations
   use rodyn_recursion_condensed, only: condensed_recursion, new_condensed_recursion, condensed_accelerations
   use rodyn_recursion_joints, only: joint_recursion, new_joint_recursion, joint_accelerations
   use rodyn_locks, only: has_slaves, expand
   use rodyn_lanes, only: lanes
   use rodyn_lane_scene, only: lane_scene, new_lane_scene, suits_lanes
   use rodyn_lane_accelerations, only: lane_work, new_lane_work, group_accelerations
   use rodyn_assembled, only: assembled_system, new_assembled_system, assembled_accelerations
   implicit none (type, external)
   private
   public :: dynamics_type, new_dynamics

   integer, parameter :: path_flexible = 1, path_rigid = 2, path_lumped = 3, path_assembled = 4, path_joints = 5, &
      path_condensed = 6, path_inextensible = 7

   !> A scene with its memory and the loads that act now. One per thread.
   type :: dynamics_type
      type(scene_type) :: scene        !! never changes
      type(hinge_law) :: hinges        !! laws that they have now
      type(workspace_type) :: work
      type(assembled_system) :: system !! for the assembled kernel only
      type(condensed_recursion), allocatable :: condensed !! for rods with mass that bend by statics
      type(inextensible_recursion), allocatable :: arcs !! for rods whose arcs keep their length
      type(joint_recursion), allocatable :: joints !! for locked hinges and the bubble; allocated when first needed
      real(wp), allocatable :: opening_acceleration(:) !! of locked hinges, given (0:n-1) [rad/s^2]
      integer :: n_locks = 0           !! how often hinges were locked or freed: what was derived from the scene is then stale
      type(load_regime) :: regime      !! loads between the last switch and the next
      type(load_forces) :: forces      !! their values
      integer :: path = path_flexible  !! which kernel
      logical :: needs_moments = .true. !! the kernel does not form them itself
      logical :: varying = .false.     !! some load or kink changes within the regime, or tangents of hinge laws do
      type(kink_regime) :: kinks       !! programs of kinks that move between the last switch and the next
      logical :: driven = .false.      !! there are some
      real(wp), allocatable, dimension(:) :: kink, kink_rate, kink_acceleration !! (0:n-1); allocated if the scene has programs
      class(user_load), pointer :: user => null() !! not owned
      real(wp), allocatable :: zero(:) !! (n_q); allocated if the assembled kernel needs moments at rest
      type(lane_scene), allocatable :: group !! the scene in every lane; allocated when first needed
      type(lane_work) :: group_work
      logical :: group_is_current = .false.  !! its forces are those of the regime
      real(wp), allocatable, dimension(:) :: lane_q, lane_p, lane_rates !! of one lane (n_dof), where lanes have no kernel
   contains
      procedure :: set_regime
      procedure :: refresh
      procedure :: move_kinks
      procedure :: change_hinges
      procedure :: apply_impulse
      procedure :: set_locked
      procedure :: project_locked
      procedure :: hinge_rotations
      procedure :: velocity_jump
      procedure :: accelerations
      procedure :: lane_accelerations
   end type dynamics_type

contains

   !> Choose the kernel and allocate its memory. No loads act until `set_regime`. Hinges that are locked in the scene stay
   !> so, without motion of their own.
   subroutine new_dynamics(dynamics, scene, error, hinges)
      type(dynamics_type), intent(out) :: dynamics
      type(scene_type), intent(in) :: scene
      type(error_type), allocatable, intent(out) :: error
      type(hinge_law), intent(in), optional :: hinges !! as they are now, driven kinks at t = 0; absent: as when a run begins

      dynamics%scene = scene
      dynamics%hinges = scene%hinges
      if (present(hinges)) dynamics%hinges = hinges
      call new_workspace(dynamics%work, scene)
      allocate (dynamics%forces%node(2, 0), dynamics%regime%varying(0))
      dynamics%varying = dynamics%hinges%curved
      allocate (dynamics%opening_acceleration(0:scene%n - 1), source=0.0_wp)
      if (dynamics%hinges%driven) then
         allocate (dynamics%kink(0:scene%n - 1), dynamics%kink_rate(0:scene%n - 1), dynamics%kink_acceleration(0:scene%n - 1), &
                   source=0.0_wp)
         call new_kink_regime(dynamics%kinks, scene%kinks, 0.0_wp, 4.0_wp*tiny(1.0_wp)) ! as they are when the run begins
         call dynamics%move_kinks(0.0_wp)
      end if
      call choose_path(dynamics, error)
   end subroutine new_dynamics

   !> The kernel for the scene as it is locked now.
   subroutine choose_path(self, error)
      type(dynamics_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error

      self%needs_moments = .true.
      if (self%scene%assembled) then
         self%path = path_assembled
         call new_assembled_system(self%system, self%scene, self%hinges, error)
         self%needs_moments = size(self%hinges%relaxing) > 0 .or. self%system%moving .or. self%hinges%has_locks
         if (size(self%hinges%relaxing) == 0 .and. self%system%moving .and. .not. allocated(self%zero)) &
            allocate (self%zero(self%scene%n_q), source=0.0_wp)
      else if (has_slaves(self%hinges) .or. self%scene%n_bend == 3) then
         self%path = path_joints
         if (.not. allocated(self%joints)) allocate (self%joints)
         call new_joint_recursion(self%joints, self%scene)
      else if (self%scene%condensed) then
         self%path = path_condensed
         self%needs_moments = .false.
         if (.not. allocated(self%condensed)) allocate (self%condensed)
         call new_condensed_recursion(self%condensed, self%scene, self%hinges)
      else if (self%scene%lumped) then
         self%path = path_lumped
      else if (self%scene%inextensible) then
         self%path = path_inextensible
         if (.not. allocated(self%arcs)) allocate (self%arcs)
         call new_inextensible_recursion(self%arcs, self%scene)
      else if (self%scene%dynamic_bending) then
         self%path = path_flexible
         self%needs_moments = .false.
      else
         self%path = path_rigid
      end if
   end subroutine choose_path

   !> Make the loads between two neighbouring switch times act, and the kinks move as they do then.
   subroutine set_regime(self, t_from, t_to, loaded)
      class(dynamics_type), intent(inout) :: self
      real(wp), intent(in) :: t_from, t_to !! [s]
      logical, intent(in), optional :: loaded !! false: without the loads of the scene
      type(load_set) :: none
      logical :: unloaded

      unloaded = .false.
      if (present(loaded)) unloaded = .not. loaded
      if (unloaded) then
         call new_load_set(none)
         call new_load_regime(self%regime, none, t_from, t_to, self%scene%n)
      else
         call new_load_regime(self%regime, self%scene%loads, t_from, t_to, self%scene%n)
      end if
      if (associated(self%user)) call make_room_for_user(self)
      call evaluate_loads(self%forces, self%regime, t_from, fresh=.true.)
      self%group_is_current = .false.
      self%driven = .false.
      if (self%hinges%driven) then
         call new_kink_regime(self%kinks, self%scene%kinks, t_from, t_to)
         self%driven = size(self%kinks%moving) > 0
         call self%move_kinks(t_from)
      end if
      self%varying = size(self%regime%varying) > 0 .or. self%driven .or. associated(self%user) .or. self%hinges%curved
   end subroutine set_regime

   !> Forces on nodes for a load of the user's.
   subroutine make_room_for_user(self)
      type(dynamics_type), intent(inout) :: self
      if (.not. self%user%on_nodes .or. self%regime%on_nodes) return
      self%regime%on_nodes = .true.
      deallocate (self%regime%constant_node)
      allocate (self%regime%constant_node(2, self%scene%n), source=0.0_wp)
   end subroutine make_room_for_user

   !> All that changes with time, and the user's load and curved hinge laws with the state. Allocates nothing without these laws.
   subroutine refresh(self, t, q, p)
      class(dynamics_type), intent(inout) :: self
      real(wp), intent(in) :: t !! [s]
      real(wp), intent(in) :: q(self%scene%n_q), p(self%scene%n_dof)

      if (self%driven) call self%move_kinks(t)
      associate (first => self%scene%n_base + 1)
         if (self%hinges%curved) call self%hinges%follow(self%scene%dynamic_bending, q(first), p(first))
      end associate
      if (associated(self%user)) then
         self%forces%base(:) = self%regime%constant_base
         self%forces%node(:, :) = self%regime%constant_node
      end if
      call evaluate_loads(self%forces, self%regime, t, fresh=.false.)
      if (associated(self%user)) call self%user%add_forces(self%scene, t, q, p, self%forces%base, self%forces%node)
   end subroutine refresh

   !> What hinges that have just been locked do to the rates: `velocity_jump` of all locked hinges, each with the rate of its
   !> kink afterwards.
   subroutine apply_impulse(self, q, p, lost, worked, ok)
      class(dynamics_type), intent(inout) :: self
      real(wp), intent(in) :: q(:)
      real(wp), intent(inout) :: p(:)
      real(wp), intent(out) :: lost   !! energy [J]
      real(wp), intent(out) :: worked !! by the drives of locked hinges [J]
      logical, intent(out) :: ok      !! false: not finite, or M not positive definite
      real(wp) :: after(size(p)), impulse(0:self%scene%n - 1)

      call self%velocity_jump(q, p, self%hinges%locked, self%hinges%kink_rate, after, lost, impulse, ok)
      worked = sum(impulse*self%hinges%kink_rate)
      p = after
   end subroutine apply_impulse

   !> Put the kinks where they are at time t.
   subroutine move_kinks(self, t)
      class(dynamics_type), intent(inout) :: self
      real(wp), intent(in) :: t !! [s], within the regime

      if (.not. allocated(self%kink)) return
      call evaluate_kinks(self%kinks, t, self%kink, self%kink_rate, self%kink_acceleration)
      call self%hinges%set_kinks(self%kink, self%kink_rate)
      self%hinges%kink_acceleration(:) = self%kink_acceleration
      self%opening_acceleration(:) = self%kink_acceleration
   end subroutine move_kinks

   !> Make the present laws of the mechanisms act.
   subroutine change_hinges(self, error)
      class(dynamics_type), intent(inout) :: self
      type(error_type), allocatable, intent(out), optional :: error !! no memory for the assembled system
      type(error_type), allocatable :: failure
      logical :: locked(0:self%scene%n - 1)
      real(wp) :: held_at(0:self%scene%n - 1)

      call self%hinges%set_mechanisms()
      call self%hinges%find_locks(locked, held_at)
      call self%set_locked(locked, self%opening_acceleration, held_at, failure)
      if (allocated(self%group)) deallocate (self%group)
      self%group_is_current = .false.
      if (present(error)) call move_alloc(failure, error)
   end subroutine change_hinges

   !> Lock these hinges and free all others: from now on the accelerations keep (opening_k)'' as prescribed where a hinge
   !> is locked, and `work%moment(k)` is all of the moment that it passes. Cheap where the set stays the same; then
   !> `opening_acceleration` may as well be assigned directly. State and rates must fit: `project_locked`, `velocity_jump`.
   !> With quasistatic bending it is th that is locked, at `theta`, and `opening_acceleration` is not used.
   subroutine set_locked(self, locked, opening_acceleration, theta, error)
      class(dynamics_type), intent(inout) :: self
      logical, intent(in) :: locked(0:)                !! (0:n-1)
      real(wp), intent(in) :: opening_acceleration(0:) !! (0:n-1) [rad/s^2]; zero for a plain lock
      real(wp), intent(in), optional :: theta(0:)      !! quasistatic: th of locked hinges (0:n-1) [rad]; absent: as it was, or 0
      type(error_type), allocatable, intent(out), optional :: error !! the assembled kernel found no memory
      type(error_type), allocatable :: failure
      real(wp) :: held(0:self%scene%n - 1)

      held = opening_acceleration ! may be the component itself
      self%opening_acceleration(:) = held
      associate (law => self%hinges)
         if (all(locked .eqv. law%locked) .and. .not. present(theta)) return
         held = 0.0_wp
         held(law%held) = law%held_at
         if (present(theta)) held = theta
         call law%lock(locked, held)
      end associate
      self%n_locks = self%n_locks + 1
      call choose_path(self, failure)
      if (present(error)) call move_alloc(failure, error)
   end subroutine set_locked

   !> Put the redundant angle and rate of each locked hinge where the lock has them: phi of the rod beyond. The
   !> constraint is linear in q, so that integrators keep it to rounding. With quasistatic bending nothing is redundant.
   pure subroutine project_locked(self, opening, opening_rate, q, p)
      class(dynamics_type), intent(in) :: self
      real(wp), intent(in) :: opening(0:)      !! of locked hinges, kink included (0:n-1) [rad]
      real(wp), intent(in) :: opening_rate(0:) !! (0:n-1) [rad/s]
      real(wp), intent(inout) :: q(:), p(:)

      if (.not. has_slaves(self%hinges)) return
      call expand(self%scene, self%hinges%locked, opening, q(:self%scene%n_dof))
      call expand(self%scene, self%hinges%locked, opening_rate, p)
   end subroutine project_locked

   !> Joint rotations th of all hinges, where `set_locked` may hold them, and their rates.
   pure subroutine hinge_rotations(self, q, p, theta, theta_rate)
      class(dynamics_type), intent(in) :: self
      real(wp), intent(in) :: q(:), p(:)
      real(wp), intent(out) :: theta(0:)      !! th (0:n-1) [rad]
      real(wp), intent(out) :: theta_rate(0:) !! th' (0:n-1) [rad/s]
      real(wp), dimension(0:self%scene%n) :: moment, moment_rate

      associate (scene => self%scene, first => self%scene%n_base + 1)
         call hinge_state(self%hinges, scene%n, scene%dynamic_bending, q(first:), p(first:), theta, theta_rate, moment, &
                          moment_rate)
      end associate
   end subroutine hinge_rotations

   !> Rates after hinges have snapped shut (an impact without rebound): M (p+ - p) = sum_k impulse_k d(opening_k)/dq over all
   !> locked hinges, so that (opening_k)'+ is as given there. Momenta are kept. What is lost,
   !>     (p+ - p)^T M (p+ - p)/2 = T - T+ + sum_k impulse_k (opening_k)'+,
   !> is all of the difference in kinetic energy if the hinges come to rest. The scene need not be locked yet. With
   !> quasistatic bending massless joints stop without an impact: nothing happens to p. O(n).
   subroutine velocity_jump(self, q, p, locked, opening_rate, p_after, energy_lost, impulse, ok)
      class(dynamics_type), intent(inout) :: self
      real(wp), intent(in) :: q(:), p(:)        !! coordinates and rates before
      logical, intent(in) :: locked(0:)         !! hinges that are locked afterwards, new and old (0:n-1)
      real(wp), intent(in) :: opening_rate(0:)  !! (opening)' of locked hinges afterwards (0:n-1) [rad/s]; zero for plain locks
      real(wp), intent(out) :: p_after(:)       !! rates afterwards
      real(wp), intent(out) :: energy_lost      !! not negative [J]
      real(wp), intent(out) :: impulse(0:)      !! of the moment -T on each opening (0:n-1) [N m s]
      logical, intent(out) :: ok                !! false: not finite, or M not positive definite
      real(wp) :: jump(0:self%scene%n - 1), moment(0:self%scene%n), rest(self%scene%n_dof), change(self%scene%n_dof)
      real(wp), parameter :: none(3) = 0.0_wp, nowhere(2, 1) = 0.0_wp

      p_after = p
      energy_lost = 0.0_wp
      impulse = 0.0_wp
      ok = .true.
      associate (scene => self%scene, work => self%work, first => self%scene%n_base + 1)
         if (scene%quasistatic .or. .not. any(locked)) return
         if (.not. allocated(self%joints)) then
            allocate (self%joints)
            call new_joint_recursion(self%joints, scene)
         end if
         call openings(scene%n, scene%dynamic_bending, p(first:), jump)
         jump = merge(opening_rate - jump, 0.0_wp, locked)
         rest = 0.0_wp
         moment = 0.0_wp
         call sine_cosine(scene%n, q(first:first + scene%n - 1), work%sine(1:), work%cosine(1:))
         call joint_accelerations(self%joints, scene, work%sine, work%cosine, q, rest, .false., locked, jump, moment, none, &
                                  .false., nowhere, change, ok)
         if (.not. ok) return
         where (locked) impulse = -moment(:scene%n - 1)
         energy_lost = max(0.0_wp, 0.5_wp*sum(impulse*jump))
         p_after = p + change
         call expand(scene, locked, opening_rate, p_after)
      end associate
   end subroutine velocity_jump

   !> p' for given coordinates and rates. Allocates nothing.
   subroutine accelerations(self, t, q, p, acceleration, ok)
      class(dynamics_type), intent(inout) :: self
      real(wp), intent(in) :: t                !! [s], within the regime
      real(wp), intent(in) :: q(self%scene%n_q)               !! coordinates
      real(wp), intent(in) :: p(self%scene%n_dof)             !! rates
      real(wp), intent(out) :: acceleration(self%scene%n_dof) !! p'
      logical, intent(out) :: ok               !! false: not finite, or M not positive definite

      associate (scene => self%scene, hinges => self%hinges, work => self%work, first => self%scene%n_base + 1)
         if (self%varying) call self%refresh(t, q, p)
         if (self%needs_moments) then
            if (allocated(self%zero)) then
               call hinge_moments(hinges, scene%n, scene%dynamic_bending, self%zero, self%zero, work%theta, work%moment)
            else
               call hinge_moments(hinges, scene%n, scene%dynamic_bending, q(first), p(first), work%theta, work%moment)
            end if
         end if
         call sine_cosine(scene%n, q(first), work%sine(1:), work%cosine(1:))
         select case (self%path)
         case (path_flexible)
            call flexible_accelerations(scene%n, scene%n_base, scene%rods, scene%rod_of, scene%node_mass, scene%body, &
                                        work%sine, work%cosine, q, p, hinges, self%forces%base, &
                                        self%regime%on_nodes, self%forces%node, work%outward, acceleration, ok)
         case (path_inextensible)
            call inextensible_accelerations(self%arcs, scene, work%sine, work%cosine, q, p, work%moment, self%forces%base, &
                                            self%regime%on_nodes, self%forces%node, acceleration, ok)
         case (path_rigid)
            call rigid_accelerations(scene%n, scene%n_base, scene%rods, scene%rod_of, scene%node_mass, scene%body, &
                                     work%sine, work%cosine, p, work%moment, self%forces%base, &
                                     self%regime%on_nodes, self%forces%node, work%outward, acceleration, ok)
         case (path_lumped)
            call lumped_accelerations(scene%n, scene%n_base, scene%rods, scene%rod_of, scene%node_mass, scene%body, &
                                      work%sine, work%cosine, p, work%moment, self%forces%base, &
                                      self%regime%on_nodes, self%forces%node, work%outward, acceleration, ok)
         case (path_condensed)
            call condensed_accelerations(self%condensed, scene, hinges, work%sine, work%cosine, q, p, self%forces%base, &
                                         self%regime%on_nodes, self%forces%node, acceleration, ok)
         case (path_joints)
            call joint_accelerations(self%joints, scene, work%sine, work%cosine, q, p, .true., hinges%locked, &
                                     self%opening_acceleration, work%moment, self%forces%base, self%regime%on_nodes, &
                                     self%forces%node, acceleration, ok)
         case default
            call assembled_accelerations(self%system, scene, hinges, work%sine, work%cosine, q, p, work%moment, &
                                         self%opening_acceleration, self%forces%base, self%regime%on_nodes, &
                                         self%forces%node, acceleration, ok)
         end select
      end associate
   end subroutine accelerations

   !> The same at several times and states at once, which is faster where there is a kernel for it.
   subroutine lane_accelerations(self, t, q, p, acceleration, ok)
      class(dynamics_type), intent(inout) :: self
      real(wp), intent(in) :: t(lanes)                        !! [s], within the regime
      real(wp), contiguous, intent(in) :: q(:, :), p(:, :)    !! (lanes, n_dof)
      real(wp), contiguous, intent(out) :: acceleration(:, :) !! p' (lanes, n_dof)
      logical, intent(out) :: ok                              !! false: not in every lane
      logical :: lane_ok(lanes)

      if (.not. suits_lanes(self%scene, self%hinges) .or. associated(self%user)) then
         call one_by_one(self, t, q, p, acceleration, ok)
         return
      end if
      if (self%varying .or. .not. self%group_is_current) call load_lanes(self, t)
      call group_accelerations(self%group, self%group_work, q, p, acceleration, lane_ok)
      ok = all(lane_ok)
   end subroutine lane_accelerations

   !> Lane after lane, for the assembled kernel, for locked hinges, the bubble and what else has no lanes.
   subroutine one_by_one(self, t, q, p, acceleration, ok)
      class(dynamics_type), intent(inout) :: self
      real(wp), intent(in) :: t(lanes)
      real(wp), contiguous, intent(in) :: q(:, :), p(:, :)    !! (lanes, n_dof)
      real(wp), contiguous, intent(out) :: acceleration(:, :) !! (lanes, n_dof)
      logical, intent(out) :: ok
      integer :: i

      associate (m => self%scene%n_dof)
         if (.not. allocated(self%lane_q)) allocate (self%lane_q(m), self%lane_p(m), self%lane_rates(m))
      end associate
      do i = 1, lanes
         self%lane_q(:) = q(i, :)
         self%lane_p(:) = p(i, :)
         call self%accelerations(t(i), self%lane_q, self%lane_p, self%lane_rates, ok)
         if (.not. ok) return
         acceleration(i, :) = self%lane_rates
      end do
   end subroutine one_by_one

   !> Put the forces at the time of each lane into the group.
   subroutine load_lanes(self, t)
      type(dynamics_type), intent(inout) :: self
      real(wp), intent(in) :: t(lanes) !! [s]
      integer :: i, k

      if (.not. allocated(self%group)) then
         allocate (self%group)
         call new_lane_scene(self%group, self%scene, self%hinges, one_rod_each=.false.)
         call new_lane_work(self%group_work, self%group)
      end if
      self%group%loaded = self%regime%on_nodes
      do i = 1, lanes
         if (self%varying) call evaluate_loads(self%forces, self%regime, t(i), fresh=.false.)
         if (self%hinges%driven) then
            call self%move_kinks(t(i))
            do k = 0, self%scene%n - 1
               self%group%offset(i, k) = self%hinges%offset(k)
            end do
         end if
         self%group%base_force(i, :) = self%forces%base
         if (.not. self%regime%on_nodes) cycle
         do k = 1, self%scene%n ! an array assignment would make a copy first
            self%group%node_force(i, 1, k) = self%forces%node(1, k)
            self%group%node_force(i, 2, k) = self%forces%node(2, k)
         end do
      end do
      self%group_is_current = .true.
   end subroutine load_lanes

end module rodyn_accelerations
