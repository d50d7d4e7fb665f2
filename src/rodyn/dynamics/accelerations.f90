!> p' of a scene at a time and state: the kernel and the parts of it that the scene needs, chosen once.
module rodyn_accelerations
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type
   use rodyn_scene, only: scene_type
   use rodyn_workspace, only: workspace_type, new_workspace
   use rodyn_trigonometry, only: sine_cosine
   use rodyn_hinge_law, only: hinge_moments
   use rodyn_loads, only: load_regime, load_forces, new_load_regime, evaluate_loads
   use rodyn_recursion_flexible, only: flexible_accelerations
   use rodyn_recursion_rigid, only: rigid_accelerations
   use rodyn_recursion_lumped, only: lumped_accelerations
   use rodyn_lanes, only: lanes
   use rodyn_lane_scene, only: lane_scene, new_lane_scene, suits_lanes
   use rodyn_lane_accelerations, only: lane_work, new_lane_work, group_accelerations
   use rodyn_assembled, only: assembled_system, new_assembled_system, assembled_accelerations
   implicit none (type, external)
   private
   public :: dynamics_type, new_dynamics

   integer, parameter :: path_flexible = 1, path_rigid = 2, path_lumped = 3, path_assembled = 4

   !> A scene with its memory and the loads that act now. One per thread.
   type :: dynamics_type
      type(scene_type) :: scene
      type(workspace_type) :: work
      type(assembled_system) :: system !! for the assembled kernel only
      type(load_regime) :: regime      !! loads between the last switch and the next
      type(load_forces) :: forces      !! their values
      integer :: path = path_flexible  !! which kernel
      logical :: needs_moments = .true. !! the kernel does not form them itself
      logical :: varying = .false.     !! some load changes within the regime
      type(lane_scene), allocatable :: group !! the scene in every lane; allocated when first needed
      type(lane_work) :: group_work
      logical :: group_is_current = .false.  !! its forces are those of the regime
      real(wp), allocatable, dimension(:) :: lane_q, lane_p, lane_rates !! of one lane (n_dof), where lanes have no kernel
   contains
      procedure :: set_regime
      procedure :: accelerations
      procedure :: lane_accelerations
   end type dynamics_type

contains

   !> Choose the kernel and allocate its memory. No loads act until `set_regime`.
   subroutine new_dynamics(dynamics, scene, error)
      type(dynamics_type), intent(out) :: dynamics
      type(scene_type), intent(in) :: scene
      type(error_type), allocatable, intent(out) :: error

      dynamics%scene = scene
      call new_workspace(dynamics%work, scene)
      allocate (dynamics%forces%node(2, 0))
      if (scene%assembled) then
         dynamics%path = path_assembled
         dynamics%needs_moments = size(scene%hinges%relaxing) > 0
         call new_assembled_system(dynamics%system, scene, error)
      else if (scene%lumped) then
         dynamics%path = path_lumped
      else if (scene%dynamic_bending) then
         dynamics%path = path_flexible
         dynamics%needs_moments = .false.
      else
         dynamics%path = path_rigid
      end if
   end subroutine new_dynamics

   !> Make the loads between two neighbouring switch times act.
   subroutine set_regime(self, t_from, t_to)
      class(dynamics_type), intent(inout) :: self
      real(wp), intent(in) :: t_from, t_to !! [s]

      call new_load_regime(self%regime, self%scene%loads, t_from, t_to, self%scene%n)
      call evaluate_loads(self%forces, self%regime, t_from, fresh=.true.)
      self%varying = size(self%regime%varying) > 0
      self%group_is_current = .false.
   end subroutine set_regime

   !> p' for given coordinates and rates. Allocates nothing.
   subroutine accelerations(self, t, q, p, acceleration, ok)
      class(dynamics_type), intent(inout) :: self
      real(wp), intent(in) :: t                !! [s], within the regime
      real(wp), intent(in) :: q(self%scene%n_q)               !! coordinates
      real(wp), intent(in) :: p(self%scene%n_dof)             !! rates
      real(wp), intent(out) :: acceleration(self%scene%n_dof) !! p'
      logical, intent(out) :: ok               !! false: not finite, or M not positive definite

      associate (scene => self%scene, work => self%work, first => self%scene%n_base + 1)
         if (self%varying) call evaluate_loads(self%forces, self%regime, t, fresh=.false.)
         call sine_cosine(scene%n, q(first), work%sine(1:), work%cosine(1:))
         if (self%needs_moments) &
            call hinge_moments(scene%hinges, scene%n, scene%dynamic_bending, q(first), p(first), work%theta, work%moment)
         select case (self%path)
         case (path_flexible)
            call flexible_accelerations(scene%n, scene%n_base, scene%rods, scene%rod_of, scene%node_mass, scene%body, &
                                        work%sine, work%cosine, q, p, scene%hinges, self%forces%base, &
                                        self%regime%on_nodes, self%forces%node, work%outward, acceleration, ok)
         case (path_rigid)
            call rigid_accelerations(scene%n, scene%n_base, scene%rods, scene%rod_of, scene%node_mass, scene%body, &
                                     work%sine, work%cosine, p, work%moment, self%forces%base, &
                                     self%regime%on_nodes, self%forces%node, work%outward, acceleration, ok)
         case (path_lumped)
            call lumped_accelerations(scene%n, scene%n_base, scene%rods, scene%rod_of, scene%node_mass, scene%body, &
                                      work%sine, work%cosine, p, work%moment, self%forces%base, &
                                      self%regime%on_nodes, self%forces%node, work%outward, acceleration, ok)
         case default
            call assembled_accelerations(self%system, scene, work%sine, work%cosine, q, p, work%moment, self%forces%base, &
                                         self%regime%on_nodes, self%forces%node, acceleration, ok)
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

      if (.not. suits_lanes(self%scene)) then
         call one_by_one(self, t, q, p, acceleration, ok)
         return
      end if
      if (self%varying .or. .not. self%group_is_current) call load_lanes(self, t)
      call group_accelerations(self%group, self%group_work, q, p, acceleration, lane_ok)
      ok = all(lane_ok)
   end subroutine lane_accelerations

   !> Lane after lane, for the assembled kernel.
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
         call new_lane_scene(self%group, self%scene, one_rod_each=.false.)
         call new_lane_work(self%group_work, self%group)
      end if
      self%group%loaded = self%regime%on_nodes
      do i = 1, lanes
         if (self%varying) call evaluate_loads(self%forces, self%regime, t(i), fresh=.false.)
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
