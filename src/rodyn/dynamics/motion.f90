!> The motion of a scene as first-order equations: y = (q, p [, work of the loads, dissipated energy]). Behind the
!> coordinates of the article (and the bubbles), q ends with the rotations of relaxing hinges, if there are any (`rodyn_hinge_law`).
!>
!> The two integrals are there only with a ledger. Their error is controlled apart (`rodyn_ode`), so that a run with a ledger
!> makes the same steps as one without.
module rodyn_motion
   use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type, raise
   use rodyn_lanes, only: lanes
   use rodyn_ode, only: mechanical_system, n_quadratures, factorise_dense, solve_dense
   use rodyn_stiff_modes, only: stiff_modes
   use rodyn_scene_modes, only: modes_finder, new_modes_finder
   use rodyn_trigonometry, only: sine_cosine
   use rodyn_case_config, only: initial_config
   use rodyn_scene, only: scene_type
   use rodyn_switch_times, only: add_switches
   use rodyn_user_load, only: user_load
   use rodyn_hinge_events, only: event_set, new_event_set
   use rodyn_accelerations, only: dynamics_type, new_dynamics
   use rodyn_assembled, only: assembled_system, new_assembled_system, mass_matrix
   use rodyn_condensed, only: add_inertia_moments
   use rodyn_linearisation, only: balance_tangent
   use rodyn_newton, only: newton_type
   use rodyn_locks, only: has_slaves, reduce, expand, reduce_matrix
   use rodyn_kinematics, only: load_power, invariants_type, invariants
   use rodyn_hinge_law, only: hinge_moments, hinge_state, relaxation_rates, relaxation_tangent, initial_joints, hinge_tangent, &
      damper_power, relaxing_power
   use rodyn_lapack, only: dpotrf, dpotrs
   implicit none (type, external)
   private
   public :: motion_type, new_motion, initial_state, state_invariants, differentiate_balance, balance_derivatives, hinges_at

   !> A running scene.
   type, extends(mechanical_system) :: motion_type
      type(dynamics_type) :: dynamics
      type(modes_finder), allocatable :: modes !! allocated when first needed
      integer :: n_locks_of_modes = 0  !! `dynamics%n_locks` when the modes finder was made
      type(assembled_system) :: system !! mass matrix of the Jacobian; allocated when first needed
      type(newton_type) :: newton      !! linear systems of implicit methods
      integer :: n_q = 0               !! length of q
      logical :: free = .true.         !! the spacecraft moves
      logical :: ledger = .true.       !! y ends with work and dissipated energy
      real(wp), allocatable :: switches(:) !! of the scene and of a load of the user's, increasing [s]
      type(event_set) :: events        !! what hinges do, and did
      real(wp), allocatable, private :: acceleration(:), joint_rate(:) !! workspace of `quadratures` (n_dof), (n_q - n_dof)
   contains
      procedure :: rhs
      procedure :: jacobian
      procedure :: has_lanes
      procedure :: lane_accelerations
      procedure :: find_modes
      procedure :: forget_modes
      procedure :: quadratures
      procedure :: factorise_newton
      procedure :: solve_newton
      procedure :: event_functions
      procedure :: begin_regime
      procedure :: respond
      procedure :: set_user_load
   end type motion_type

contains

   !> Prepare a scene for integration. Loads act after `dynamics%set_regime`.
   subroutine new_motion(motion, scene, ledger, error)
      type(motion_type), intent(out) :: motion
      type(scene_type), intent(in) :: scene
      logical, intent(in) :: ledger
      type(error_type), allocatable, intent(out) :: error

      if (scene%n < 1) then
         call raise(error, 'new_motion: the scene is not compiled')
         return
      end if
      call new_dynamics(motion%dynamics, scene, error)
      if (allocated(error)) return
      motion%switches = scene%switches
      motion%n_q = scene%n_q
      motion%n_dof = scene%n_dof
      motion%free = scene%n_base > 0
      motion%n_ignorable = scene%n_base
      motion%ledger = ledger
      motion%n_controlled = scene%n_q + scene%n_dof
      motion%n_states = motion%n_controlled + merge(n_quadratures, 0, ledger)
      allocate (motion%acceleration(motion%n_dof), motion%joint_rate(motion%n_q - motion%n_dof))
      call new_event_set(motion%events, scene%hinges)
      motion%n_events = motion%events%n
   end subroutine new_motion

   !> y at t = 0. Arrays that are not allocated are zero; with one of another length than that of the scene, all of y is NaN,
   !> which no integrator takes.
   subroutine initial_state(motion, initial, y)
      type(motion_type), intent(in) :: motion
      type(initial_config), intent(in) :: initial
      real(wp), allocatable, intent(out) :: y(:) !! (n_states)

      allocate (y(motion%n_states), source=0.0_wp)
      associate (scene => motion%dynamics%scene, n_q => motion%n_q, n_dof => motion%n_dof)
         if (motion%free) then
            y(1:3) = [initial%displacement_x, initial%displacement_y, initial%rotation]
            y(n_q + 1:n_q + 3) = [initial%velocity_x, initial%velocity_y, initial%omega]
         end if
         call place(scene%phi_at(), initial%phi, initial%phi_rate)
         if (n_q > n_dof) call initial_joints(motion%dynamics%hinges, y(scene%phi_at() + 1:scene%phi_at() + scene%n), &
                                             spread(0.0_wp, 1, scene%n), y(n_dof + 1:n_q))
         if (.not. scene%dynamic_bending) return
         call place(scene%alpha_at(), initial%alpha, initial%alpha_rate)
         call place(scene%beta_at(), initial%beta, initial%beta_rate)
         if (scene%n_bend == 3) call place(scene%bend_at(3), initial%bubble, initial%bubble_rate)
      end associate

   contains

      subroutine place(before, values, rates)
         integer, intent(in) :: before
         real(wp), intent(in), optional :: values(:), rates(:) !! absent: not allocated
         call put(before, values)
         call put(motion%n_q + before, rates)
      end subroutine place

      subroutine put(before, x)
         integer, intent(in) :: before
         real(wp), intent(in), optional :: x(:)
         if (.not. present(x)) return
         if (size(x) == motion%dynamics%scene%n) then
            y(before + 1:before + size(x)) = x
         else if (size(x) > 0) then
            y = ieee_value(1.0_wp, ieee_quiet_nan)
         end if
      end subroutine put

   end subroutine initial_state

   !> y' = (q', p' [, powers]). The displacement of C is measured along the turning axes, docs/model.md sec. 1.
   subroutine rhs(self, t, y, ydot, ok)
      class(motion_type), intent(inout) :: self
      real(wp), intent(in) :: t
      real(wp), contiguous, intent(in) :: y(:)
      real(wp), contiguous, intent(out) :: ydot(:)
      logical, intent(out) :: ok

      associate (r => self%n_q, m => self%n_dof)
         call self%dynamics%accelerations(t, y(1:r), y(r + 1:r + m), ydot(r + 1:r + m), ok)
         ydot(1:m) = y(r + 1:r + m)
         if (self%free) then
            ydot(1) = ydot(1) + y(r + 3)*y(2)
            ydot(2) = ydot(2) - y(r + 3)*y(1)
         end if
         if (r > m) call relaxation_rates(self%dynamics%hinges, self%dynamics%work%moment, y(m + 1:r), ydot(m + 1:r))
         if (size(ydot) > r + m) &
            call powers(self, y(1:r), y(r + 1:r + m), ydot(r + 1:r + m), ydot(m + 1:r), ydot(r + m + 1:))
      end associate
   end subroutine rhs

   !> Power of the loads and dissipated power. The loads are those of the last evaluation.
   subroutine powers(self, q, p, a, joint_rate, power)
      class(motion_type), intent(inout) :: self
      real(wp), contiguous, intent(in) :: q(:), p(:)
      real(wp), contiguous, intent(in) :: a(:) !! p', used by driven kinks between condensed rods
      real(wp), intent(in) :: joint_rate(:) !! th' of the relaxing hinges [rad/s]
      real(wp), intent(out) :: power(2)     !! [W]

      power(1) = load_power(self%dynamics%scene, q, p, self%dynamics%forces%base, &
                            self%dynamics%regime%on_nodes, self%dynamics%forces%node)
      if (self%dynamics%driven) power(1) = power(1) + drive_power(self, q, p, a)
      associate (scene => self%dynamics%scene, hinges => self%dynamics%hinges)
         if (size(joint_rate) > 0) then
            power(2) = relaxing_power(hinges, joint_rate)
         else
            call damper_power(hinges, scene%n, scene%dynamic_bending, p(scene%n_base + 1:), self%dynamics%work%theta, power(2))
         end if
      end associate
   end subroutine powers

   !> Power of the drives of moving kinks [W]: -sum T gamma'. Overwrites the moments in the workspace with all of T.
   real(wp) function drive_power(self, q, p, a)
      class(motion_type), intent(inout) :: self
      real(wp), contiguous, intent(in) :: q(:), p(:), a(:)
      integer :: k

      call complete_moments(self, q, p, a)
      drive_power = 0.0_wp
      do k = 0, self%dynamics%scene%n - 1
         drive_power = drive_power - self%dynamics%work%moment(k)*self%dynamics%hinges%kink_rate(k)
      end do
   end function drive_power

   !> Moments in all hinges into the workspace, where the kernel has left those of locked ones.
   subroutine complete_moments(self, q, p, a)
      class(motion_type), intent(inout) :: self
      real(wp), contiguous, intent(in) :: q(:), p(:)
      real(wp), contiguous, intent(in) :: a(:) !! p'

      associate (scene => self%dynamics%scene, hinges => self%dynamics%hinges, work => self%dynamics%work, &
                 first => self%dynamics%scene%n_base + 1)
         if (has_slaves(hinges)) work%theta(0:) = work%moment(:scene%n - 1)
         call hinge_moments(hinges, scene%n, scene%dynamic_bending, q(first:), p(first:), work%theta, work%moment)
         if (has_slaves(hinges)) work%moment(:scene%n - 1) = merge(work%theta(0:), work%moment(:scene%n - 1), hinges%locked)
         if (scene%condensed) call add_inertia_moments(scene, hinges, q, p, a, work%moment)
      end associate
   end subroutine complete_moments

   !> Rotations of all hinges and moments in them, at a state.
   subroutine hinges_at(self, t, y, angle, moment, ok)
      class(motion_type), intent(inout) :: self
      real(wp), intent(in) :: t                        !! [s]
      real(wp), contiguous, intent(in) :: y(:)         !! (q, p, ...)
      real(wp), allocatable, intent(out) :: angle(:)   !! (n), hinges 0..n-1 [rad]
      real(wp), allocatable, intent(out) :: moment(:)  !! (n) [N m]
      logical, intent(out) :: ok
      real(wp) :: acceleration(self%n_dof)
      real(wp), dimension(0:self%dynamics%scene%n - 1) :: theta, rate
      real(wp), dimension(0:self%dynamics%scene%n) :: at_rest, moment_rate

      associate (r => self%n_q, m => self%n_dof, scene => self%dynamics%scene)
         call self%dynamics%accelerations(t, y(1:r), y(r + 1:r + m), acceleration, ok)
         call complete_moments(self, y(1:r), y(r + 1:r + m), acceleration)
         moment = self%dynamics%work%moment(:scene%n - 1)
         associate (first => scene%n_base + 1)
            call hinge_state(self%dynamics%hinges, scene%n, scene%dynamic_bending, y(first:r), y(r + first:r + m), theta, rate, &
                             at_rest, moment_rate)
         end associate
         angle = theta
      end associate
   end subroutine hinges_at

   !> True unless joints of their own stand behind the coordinates, or hinges may change their laws at times that are not known
   !> before. Prestressed hinges, and those that are held or latched, do not.
   logical function has_lanes(self)
      class(motion_type), intent(in) :: self
      integer :: i
      has_lanes = self%n_q == self%n_dof
      do i = 1, self%n_events
         associate (mechanism => self%dynamics%hinges%mechanisms(self%events%mechanism(i)))
            has_lanes = has_lanes .and. mechanism%is_constrained()
         end associate
      end do
   end function has_lanes

   !> p' at several times and states at once.
   subroutine lane_accelerations(self, t, q, p, acceleration, ok)
      class(motion_type), intent(inout) :: self
      real(wp), intent(in) :: t(lanes)
      real(wp), contiguous, intent(in) :: q(:, :), p(:, :)    !! (lanes, n_dof)
      real(wp), contiguous, intent(out) :: acceleration(:, :) !! (lanes, n_dof)
      logical, intent(out) :: ok
      call self%dynamics%lane_accelerations(t, q, p, acceleration, ok)
   end subroutine lane_accelerations

   !> Stiff modes at q; none if there are too many unknowns.
   subroutine find_modes(self, q, slowest, weight, modes, ok)
      class(motion_type), intent(inout) :: self
      real(wp), intent(in) :: q(:)
      real(wp), intent(in) :: slowest !! [rad/s]
      real(wp), intent(in) :: weight  !! [1/s]
      type(stiff_modes), intent(inout) :: modes
      logical, intent(out) :: ok

      if (allocated(self%modes) .and. self%n_locks_of_modes /= self%dynamics%n_locks) deallocate (self%modes)
      if (.not. allocated(self%modes)) then
         allocate (self%modes)
         call new_modes_finder(self%modes, self%dynamics%scene, self%dynamics%hinges)
         self%n_locks_of_modes = self%dynamics%n_locks
      end if
      ok = .true.
      modes%n = 0
      modes%coupled = .false.
      if (.not. self%modes%available) then
         call modes%reserve(0, self%n_dof, self%n_ignorable, 0)
         return
      end if
      associate (scene => self%dynamics%scene, work => self%dynamics%work)
         call sine_cosine(scene%n, q(scene%n_base + 1:scene%n_base + scene%n), work%sine(1:), work%cosine(1:))
         call self%modes%find(scene, self%dynamics%hinges, work%sine, work%cosine, q, slowest, weight, modes, ok)
      end associate
   end subroutine find_modes

   !> The next search begins from nothing, like the first.
   subroutine forget_modes(self)
      class(motion_type), intent(inout) :: self
      if (allocated(self%modes)) call self%modes%forget()
   end subroutine forget_modes

   !> Power of the loads and dissipated power. The rates of relaxing hinges and the moments in locked ones come from the kernel.
   subroutine quadratures(self, t, y, rate, ok)
      class(motion_type), intent(inout) :: self
      real(wp), intent(in) :: t
      real(wp), contiguous, intent(in) :: y(:)
      real(wp), intent(out) :: rate(n_quadratures)
      logical, intent(out) :: ok

      ok = .true.
      associate (dynamics => self%dynamics, r => self%n_q, m => self%n_dof, joint_rate => self%joint_rate)
         if (r > m .or. (dynamics%driven .and. (has_slaves(dynamics%hinges) .or. dynamics%scene%condensed))) then
            call dynamics%accelerations(t, y(1:r), y(r + 1:r + m), self%acceleration, ok)
            if (r > m) call relaxation_rates(dynamics%hinges, dynamics%work%moment, y(m + 1:r), joint_rate)
         else if (dynamics%varying) then
            call dynamics%refresh(t, y(1:r), y(r + 1:r + m))
         end if
         call powers(self, y(1:r), y(r + 1:r + m), self%acceleration, joint_rate, rate)
      end associate
   end subroutine quadratures

   !> Margins of the hinge laws.
   subroutine event_functions(self, t, y, values)
      class(motion_type), intent(inout) :: self
      real(wp), intent(in) :: t
      real(wp), contiguous, intent(in) :: y(:)
      real(wp), contiguous, intent(out) :: values(:)
      associate (r => self%n_q, m => self%n_dof)
         call self%events%margins(self%dynamics, t, y(1:r), y(r + 1:r + m), values)
      end associate
   end subroutine event_functions

   !> What happens at a time that is known: loads and kinks of the next regime begin to act, hinges are released.
   subroutine begin_regime(self, t, t_to, t_end, y, error)
      class(motion_type), intent(inout) :: self
      real(wp), intent(in) :: t, t_to !! the regime [s]
      real(wp), intent(in) :: t_end   !! end of the run [s]
      real(wp), contiguous, intent(inout) :: y(:)
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: lost, before

      associate (hinges => self%dynamics%hinges, r => self%n_q, m => self%n_dof)
         if (.not. (hinges%driven .or. self%events%watches)) then
            call self%dynamics%set_regime(t, t_to)
            if (self%ledger .and. .not. t > 0.0_wp) call begin_ledger(self, y)
            return
         end if
         if (t > 0.0_wp) then
            call self%dynamics%move_kinks(t)
            lost = 0.0_wp
            if (self%events%watches) call self%events%release_due(self%dynamics, t, y(1:r), y(r + 1:r + m), lost, error)
            call book(self, 0.0_wp, lost, y)
            ! A kink that jumps works on the springs, which may change their laws; what is lost meanwhile it has done as well.
            lost = 0.0_wp
            before = energy_of(self, y)
            call self%dynamics%set_regime(t, t_to)
            if (self%events%watches) call self%events%follow(self%dynamics, t, y(1:r), y(r + 1:r + m), lost, error)
            call book(self, merge((energy_of(self, y) - before) + lost, 0.0_wp, hinges%driven), lost, y)
         else
            call self%dynamics%set_regime(t, t_to)
            self%events%span = t_end
            if (self%events%watches) call self%events%begin(self%dynamics, y(1:r), y(r + 1:r + m), error)
            if (self%ledger) call begin_ledger(self, y)
         end if
      end associate
      call forget_hinges(self)
   end subroutine begin_regime

   !> The control of errors compares with the energy at the start and with that of the chain, all of whose rods turn at 1 rad/s.
   subroutine begin_ledger(self, y)
      class(motion_type), intent(inout) :: self
      real(wp), intent(in) :: y(:) !! (n_states)
      type(invariants_type) :: values
      real(wp) :: turning(size(y))

      turning(:self%n_q) = y(:self%n_q)
      turning(self%n_q + 1:) = 0.0_wp
      associate (scene => self%dynamics%scene, first => self%n_q + self%dynamics%scene%phi_at() + 1)
         turning(first:first + scene%n - 1) = 1.0_wp
      end associate
      values = state_invariants(self, turning)
      call self%begin_quadratures(energy_of(self, y), values%kinetic)
   end subroutine begin_ledger

   !> Kinetic and elastic energy [J].
   real(wp) function energy_of(self, y)
      type(motion_type), intent(in) :: self
      real(wp), intent(in) :: y(:)
      type(invariants_type) :: values
      values = state_invariants(self, y)
      energy_of = values%kinetic + values%elastic
   end function energy_of

   !> Put work that was done and energy that was lost in no time into the ledger.
   subroutine book(self, work, lost, y)
      type(motion_type), intent(in) :: self
      real(wp), intent(in) :: work, lost !! [J]
      real(wp), contiguous, intent(inout) :: y(:)
      associate (last => self%n_q + self%n_dof)
         if (self%ledger) y(last + 1:last + 2) = y(last + 1:last + 2) + [work, lost]
      end associate
   end subroutine book

   !> Change what an event changes: hinge laws, and rates where one becomes a constraint.
   subroutine respond(self, t, crossed, y, error)
      class(motion_type), intent(inout) :: self
      real(wp), intent(in) :: t          !! [s]
      logical, intent(in) :: crossed(:)  !! event functions that became negative
      real(wp), contiguous, intent(inout) :: y(:)
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: lost, worked

      call self%dynamics%move_kinks(t)
      worked = self%events%worked
      associate (r => self%n_q, m => self%n_dof)
         call self%events%respond(self%dynamics, t, y(1:r), y(r + 1:r + m), crossed, lost, error)
      end associate
      call book(self, self%events%worked - worked, lost, y)
      call forget_hinges(self)
   end subroutine respond

   !> Drop what was derived from the hinge laws.
   subroutine forget_hinges(self)
      type(motion_type), intent(inout) :: self
      type(newton_type) :: fresh
      self%newton = fresh
      if (allocated(self%modes)) deallocate (self%modes)
   end subroutine forget_hinges

   !> Let a load of the user's act. Before the run begins.
   subroutine set_user_load(self, load)
      class(motion_type), intent(inout) :: self
      class(user_load), target, intent(inout) :: load !! must outlive the run

      self%dynamics%user => load
      if (.not. allocated(load%switches)) return
      call add_switches(self%switches, pack(load%switches, load%switches > 0.0_wp))
   end subroutine set_user_load

   !> Energies and momenta of a state.
   pure function state_invariants(motion, y) result(values)
      type(motion_type), intent(in) :: motion
      real(wp), intent(in) :: y(:) !! (n_states)
      type(invariants_type) :: values
      associate (r => motion%n_q, m => motion%n_dof)
         values = invariants(motion%dynamics%scene, motion%dynamics%hinges, y(:r), y(r + 1:r + m))
      end associate
   end function state_invariants

   !> Derivatives of the balance R = M p' - rhs(q, p) by q and p at a state, p' held fixed, and of th' of relaxing hinges
   !> by q. The mass matrix is left in `self%system%m`.
   subroutine differentiate_balance(self, t, y, a, by_state, joints, ok)
      class(motion_type), intent(inout) :: self
      real(wp), intent(in) :: t
      real(wp), intent(in) :: y(:)                 !! (q, p, ...)
      real(wp), intent(out) :: a(self%n_dof)       !! p'
      real(wp), intent(out) :: by_state(self%n_dof, self%n_q + self%n_dof) !! columns dR/dq, dR/dp
      real(wp), intent(out) :: joints(self%n_q - self%n_dof, self%n_q)     !! dth'/dq
      logical, intent(out) :: ok                   !! false: no accelerations, or no memory
      type(error_type), allocatable :: error

      ok = .true.
      associate (r => self%n_q, m => self%n_dof, scene => self%dynamics%scene, work => self%dynamics%work)
         if (.not. allocated(self%system%m)) call new_assembled_system(self%system, scene, self%dynamics%hinges, error)
         if (.not. allocated(error)) call self%dynamics%accelerations(t, y(1:r), y(r + 1:r + m), a, ok)
         ok = ok .and. .not. allocated(error)
         if (.not. ok) return
         call balance_derivatives(self, y, a, by_state, joints)
         call mass_matrix(self%system, scene, self%dynamics%hinges, work%sine, work%cosine, y(1:r))
      end associate
   end subroutine differentiate_balance

   !> The same with any p', under the loads of the last evaluation: as many of the columns as there is room for.
   subroutine balance_derivatives(self, y, a, by_state, joints)
      class(motion_type), intent(in) :: self
      real(wp), intent(in) :: y(:)            !! (q, p, ...)
      real(wp), intent(in) :: a(:)            !! p', held fixed (n_dof)
      real(wp), intent(out) :: by_state(:, :) !! columns dR/dq and, behind them, dR/dp (n_dof, n_q or more)
      real(wp), intent(out) :: joints(:, :)   !! dth'/dq of relaxing hinges (n_q - n_dof, n_q)
      real(wp) :: direction(self%n_q + self%n_dof)
      integer :: j

      associate (r => self%n_q, m => self%n_dof)
         direction = 0.0_wp
         do j = 1, size(by_state, 2)
            direction(j) = 1.0_wp
            call balance_tangent(self%dynamics%scene, self%dynamics%hinges, y(1:r), y(r + 1:r + m), a, &
                                 self%dynamics%regime%on_nodes, self%dynamics%forces%node, direction(1:r), direction(r + 1:), &
                                 by_state(:, j))
            if (r > m .and. j <= r) call relaxation_column(self, direction(1:r), direction(r + 1:), joints(:, j))
            direction(j) = 0.0_wp
         end do
      end associate
   end subroutine balance_derivatives

   !> Exact Jacobian: the linearised balance solved with the mass matrix, from which what locked hinges make redundant is
   !> eliminated (`rodyn_locks`). It takes the coordinates as they stand, also where they break the constraints.
   subroutine jacobian(self, t, y, jac, ok)
      class(motion_type), intent(inout) :: self
      real(wp), intent(in) :: t
      real(wp), contiguous, intent(in) :: y(:)
      real(wp), contiguous, intent(out) :: jac(:, :)
      logical, intent(out) :: ok
      real(wp) :: a(self%n_dof), change(self%n_dof, self%n_controlled), joints(self%n_q - self%n_dof, self%n_q)
      real(wp) :: still(0:self%dynamics%scene%n - 1)
      integer :: j, info

      associate (r => self%n_q, m => self%n_dof, scene => self%dynamics%scene, hinges => self%dynamics%hinges)
         jac = 0.0_wp
         call differentiate_balance(self, t, y, a, change, joints, ok)
         if (.not. ok) return
         jac(m + 1:r, 1:r) = joints
         if (has_slaves(hinges)) then
            call reduce_matrix(scene, hinges%locked, 1.0_wp, self%system%m)
            do j = 1, r + m
               call reduce(scene, hinges%locked, change(:, j))
            end do
         end if
         call dpotrf('L', m, self%system%m, m, info)
         ok = info == 0
         if (.not. ok) return
         call dpotrs('L', m, r + m, self%system%m, m, change, m, info)
         if (has_slaves(hinges)) then
            still = 0.0_wp
            do j = 1, r + m
               call expand(scene, hinges%locked, still, change(:, j))
            end do
         end if
         jac(r + 1:r + m, 1:r + m) = -change
         do j = 1, m
            jac(j, r + j) = 1.0_wp
         end do
         if (self%free) then
            jac(1, 2) = y(r + 3)
            jac(2, 1) = -y(r + 3)
            jac(1, r + 3) = y(2)
            jac(2, r + 3) = -y(1)
         end if
      end associate
   end subroutine jacobian

   !> Factor 1 - gamma J in O(n). With locked hinges or bubbles by the dense
   !> Jacobian: O(n^3).
   subroutine factorise_newton(self, t, y, gamma, fresh, ok)
      class(motion_type), intent(inout) :: self
      real(wp), intent(in) :: t
      real(wp), contiguous, intent(in) :: y(:)
      real(wp), intent(in) :: gamma
      logical, intent(in) :: fresh
      logical, intent(out) :: ok
      real(wp) :: a(self%n_dof)

      if (is_dense(self)) then
         call factorise_dense(self, t, y, gamma, fresh, ok)
         return
      end if
      ok = .true.
      associate (r => self%n_q, m => self%n_dof, scene => self%dynamics%scene, work => self%dynamics%work)
         if (fresh) then
            call self%dynamics%accelerations(t, y(1:r), y(r + 1:r + m), a, ok)
            if (.not. ok) return
            call self%newton%linearise(scene, self%dynamics%hinges, work%sine, work%cosine, y(1:r), y(r + 1:r + m), a, &
                                       self%dynamics%regime%on_nodes, self%dynamics%forces%node)
         end if
         call self%newton%factorise(scene, self%dynamics%hinges, gamma, ok)
      end associate
   end subroutine factorise_newton

   !> The O(n) factorisation knows neither locked hinges, unless rods are condensed, nor a third bending shape.
   pure logical function is_dense(self)
      class(motion_type), intent(in) :: self
      associate (scene => self%dynamics%scene)
         is_dense = (self%dynamics%hinges%has_locks .and. .not. scene%condensed) .or. scene%n_bend == 3
      end associate
   end function is_dense

   !> x <- (1 - gamma J)^-1 x.
   subroutine solve_newton(self, x)
      class(motion_type), intent(inout) :: self
      real(wp), contiguous, intent(inout) :: x(:)
      if (is_dense(self)) then
         call solve_dense(self, x)
      else
         call self%newton%solve(self%dynamics%scene, self%dynamics%hinges, x)
      end if
   end subroutine solve_newton

   !> Change of th' of the relaxing hinges.
   subroutine relaxation_column(self, dq, dp, column)
      class(motion_type), intent(in) :: self
      real(wp), intent(in) :: dq(:), dp(:)
      real(wp), intent(out) :: column(:)
      real(wp) :: moment(0:self%dynamics%scene%n), work(0:self%dynamics%scene%n - 1)

      associate (scene => self%dynamics%scene, hinges => self%dynamics%hinges, first => self%dynamics%scene%n_base + 1)
         call hinge_tangent(hinges, scene%n, .false., dq(first:), dp(first:), work, moment)
         call relaxation_tangent(hinges, moment, dq(self%n_dof + 1:), column)
      end associate
   end subroutine relaxation_column

end module rodyn_motion
