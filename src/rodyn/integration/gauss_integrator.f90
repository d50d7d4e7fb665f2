!> Gauss collocation of order 16 for mechanical systems: eight nodes of a step side by side in vector lanes.
!>
!> The accelerations at the nodes, F, solve F_i = f(t_i, Q_i, P_i) with
!>     P = p + h A F,   Q = q + c h p + h^2 A^2 F.
!> Fixed-point iteration would need steps far below the period of the fastest vibration. Those vibrations are nearly
!> linear, so each correction solves them implicitly: with the stiff modes (u, v) of `rodyn_stiff_modes`, in which K and D are
!> springs and dampers, the residual R = f - F is answered by
!>     dF = R - u G v.R,   G = 1 - (1 + h D A + h^2 K A^2)^-1   (`rodyn_modal_reply`),
!> and the first guess extrapolates only N = f + u (K v.Q + D v.P), which is smooth. Three or four iterations
!> are enough for steps of half a period. The modes are those of a configuration some steps ago; they are found anew
!> when the iterations they cost exceed what finding them does.
!>
!> The method is symmetric and symplectic, so that fixed steps keep the energy of an undamped scene for any length of
!> time. Outputs inside a step are computed by one shorter step from its start. Sums are compensated.
module rodyn_gauss_integrator
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use rodyn_kinds, only: wp, i8
   use rodyn_lanes, only: s => lanes
   use rodyn_errors, only: error_type, raise
   use rodyn_text, only: time_text
   use rodyn_ode, only: ode_system, mechanical_system, n_quadratures
   use rodyn_stiff_modes, only: stiff_modes
   use rodyn_integrator, only: integrator_type, solver_options, solver_statistics
   use rodyn_trigonometry, only: sine_cosine
   use rodyn_lane_algebra, only: apply, apply_one, multiply, project, expand, square_sums, straight_lines, &
      residual, add, accumulate, copy
   use rodyn_gauss_collocation, only: gauss_collocation, new_gauss_collocation
   use rodyn_modal_reply, only: modal_reply
   use rodyn_quadrature_refinement, only: quadrature_refinement
   implicit none (type, external)
   private
   public :: gauss_integrator, new_gauss_integrator

   integer, parameter :: most_iterations = 15
   real(wp), parameter :: iteration_error = 0.05_wp !! of the tolerance that the iteration may leave
   real(wp), parameter :: memory = 0.9_wp           !! of `late_rate`, from step to step
   real(wp), parameter :: error_constant = 0.5_wp   !! of the error estimate, see `form_increment`
   real(wp), parameter :: regular = 0.25_wp         !! see `neglected`
   real(wp), parameter :: wanted_estimate = 0.05_wp, largest_estimate = 0.7_wp !! of the error, in tolerances
   real(wp), parameter :: wanted_loss = 1.0_wp      !! of positions, in tolerances, see `lost_response`
   real(wp), parameter :: first_phase = 2.0_wp      !! fastest frequency times the first step
   real(wp), parameter :: typical_lambda = 0.14_wp  !! size of an eigenvalue of A
   real(wp), parameter :: smallest_phase = 0.4_wp  !! slower vibrations need no implicit treatment
   integer, parameter :: degrees(*) = [2, s - 1]   !! of the first guess
   integer, parameter :: degree_interval = 16      !! steps after which the degree is judged again
   real(wp), parameter :: search_cost = 1.0_wp      !! finding modes, in iterations per unknown
   integer, parameter :: most_inner_steps = 8       !! to an output
   character(len=*), parameter :: no_powers = 'work and dissipation cannot be evaluated'

   ! The numbers of the method, made once: a sweep has thousands of integrators.
   type(gauss_collocation) :: made_rule
   logical :: rule_is_made = .false.

   !> The matrices of one step length.
   type :: step_matrices
      real(wp) :: h = 0.0_wp                 !! step [s]
      real(wp) :: h_a(s, s) = 0.0_wp         !! h A
      real(wp) :: h2_a2(s, s) = 0.0_wp       !! h^2 A^2
      logical :: coupled = .false.           !! dampers couple the modes in such steps
      logical :: damped = .false.            !! dampers are fast in such steps
      type(modal_reply) :: modal             !! (1 + h A D + h^2 A^2 K)^-1 - 1 in modes
      real(wp) :: h_last = 0.0_wp            !! step that `ahead` extrapolates from [s]
      real(wp) :: ahead(s, s) = 0.0_wp       !! node values of that step to those of this one
   end type step_matrices

   !> What is kept of a step.
   type :: step_record
      real(wp), allocatable :: f(:, :)       !! F (s, n_dof)
      real(wp), allocatable :: a(:, :)       !! accelerations of the last evaluation (s, n_dof)
      real(wp), allocatable :: q(:, :), p(:, :) !! at the nodes (s, n_dof)
      real(wp), allocatable :: smooth(:, :)  !! accelerations without the stiff part (s, n_dof)
      real(wp) :: h = 0.0_wp                 !! step [s]
   end type step_record

   type, extends(integrator_type) :: gauss_integrator
      private
      class(mechanical_system), pointer :: mechanics => null() !! `system`, known to be mechanical
      type(gauss_collocation) :: rule
      type(stiff_modes) :: modes
      type(step_matrices), allocatable :: now, spare      !! for the step in hand; for steps to outputs
      type(step_record) :: last, trial       !! the last accepted step, the one being tried
      real(wp), allocatable :: modal(:, :), reply(:, :), stiff(:, :) !! workspace (s, modes)
      real(wp), allocatable :: rest(:), motion(:) !! v.q and v.p at the start of a step; workspace (modes)
      real(wp), allocatable :: guess(:, :)   !! workspace (s, n_dof)
      real(wp), allocatable :: node_state(:) !! workspace: (q, p) at one node
      real(wp) :: quadrature_error(n_quadratures) = 0.0_wp !! in the last step
      type(quadrature_refinement) :: refinement
      logical :: refines = .true.            !! quadratures whose errors are too large; if explicit steps once could not follow
                                             !! what is stiff, they are not tried again before the next start
      real(wp), allocatable :: weight(:)     !! 1/tolerance of the rates (n_dof)
      real(wp), allocatable :: y(:), lost(:) !! state at t, and what rounding took from it (n_states)
      real(wp), allocatable :: y_before(:)   !! state at t_before
      real(wp), allocatable :: increment(:)  !! of the step (n_states)
      real(wp) :: t = 0.0_wp, t_lost = 0.0_wp, t_before = 0.0_wp !! [s]
      real(wp) :: h = 0.0_wp                 !! next step [s]
      real(wp) :: t_first = 0.0_wp           !! start of the interval
      integer(i8) :: n_grid = 0, i_grid = 0  !! fixed steps of the interval; steps done
      real(wp) :: rate = 0.1_wp              !! contraction of the iteration
      real(wp) :: late_rate = 0.0_wp         !! likewise, from its second correction on; 0: not known
      integer :: iterations = 0, fewest = most_iterations !! of the last step; of any since the modes were found
      real(wp) :: estimate = 0.0_wp          !! of the error, mean of the last steps; 0: none
      real(wp) :: excess = 0.0_wp            !! iterations lost since then
      integer :: degree = s - 1              !! of the first guess
      logical :: has_history = .false.       !! `last` may be extrapolated
      logical :: refused = .false.           !! the last failure came from the equations
      type(solver_statistics) :: counts
   contains
      procedure :: start
      procedure :: advance
      procedure :: statistics
      procedure :: finalize
   end type gauss_integrator

contains

   !> Create an integrator for `system`, which must be mechanical and outlive it.
   subroutine new_gauss_integrator(self, system, options, error)
      type(gauss_integrator), intent(out) :: self
      class(ode_system), target, intent(inout) :: system
      type(solver_options), intent(in) :: options
      type(error_type), allocatable, intent(out) :: error

      select type (system)
      class is (mechanical_system)
         self%mechanics => system
      end select
      if (associated(self%mechanics)) then
         if (.not. self%mechanics%has_lanes()) nullify (self%mechanics)
      end if
      if (.not. associated(self%mechanics)) then
         call raise(error, "'gauss' cannot integrate this system (joint rotations that are states of their own: "// &
                    "dampers = 'exact'; stops, freeplay, friction and latches of hinges, which its long steps would not see)")
         return
      end if
      call self%mechanics%forget_modes() ! so that the result does not depend on what was integrated before
      self%system => system
      self%options = options
      if (.not. rule_is_made) call new_gauss_collocation(made_rule)
      rule_is_made = .true.
      self%rule = made_rule
      allocate (self%now, self%spare)
      associate (n => system%n_states, m => self%mechanics%n_dof)
         allocate (self%y(n), self%lost(n), self%y_before(n), self%increment(n), self%weight(m), self%guess(s, m), &
                   self%node_state(2*m), source=0.0_wp)
         call allocate_record(self%last, m)
         call allocate_record(self%trial, m)
      end associate
      self%counts%last_order = 16
   end subroutine new_gauss_integrator

   subroutine allocate_record(record, m)
      type(step_record), intent(inout) :: record
      integer, intent(in) :: m
      allocate (record%f(s, m), record%a(s, m), record%q(s, m), record%p(s, m), record%smooth(s, m), source=0.0_wp)
   end subroutine allocate_record

   !> First start, or exact restart. `set_stop` comes before.
   subroutine start(self, t, y, error)
      class(gauss_integrator), intent(inout) :: self
      real(wp), intent(in) :: t    !! [s]
      real(wp), intent(in) :: y(:) !! (n_states)
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: fastest

      call self%begin_interval(t, y, error)
      if (allocated(error)) return
      self%t = t
      self%t_before = t
      self%t_first = t
      self%t_lost = 0.0_wp
      if (self%n_starts == 1 .or. any(abs(self%y - y) > 0.0_wp)) then
         self%y(:) = y
         self%lost = 0.0_wp
      end if ! else the run goes on from its own last state, whose lost digits are still known
      self%has_history = .false.
      self%refines = .true.
      self%i_grid = 0
      self%n_grid = 0
      self%now%h = 0.0_wp
      associate (span => self%t_stop - t)
         if (self%options%fixed_step > 0.0_wp) then
            self%n_grid = max(1_i8, ceiling(span/self%options%fixed_step*(1.0_wp - 4.0_wp*epsilon(1.0_wp)), i8))
            self%h = span/real(self%n_grid, wp)
         else
            call search_modes(self, 0.0_wp, error)
            if (allocated(error)) return
            fastest = self%modes%fastest()
            self%h = span
            if (fastest*span > first_phase) self%h = first_phase/fastest
            if (self%modes%n == 0) self%h = 1.0e-3_wp*span
            if (self%options%max_step > 0.0_wp) self%h = min(self%h, self%options%max_step)
         end if
      end associate
      call search_modes(self, self%h, error)
   end subroutine start

   !> Integrate to exactly t_out.
   subroutine advance(self, t_out, y, t, error)
      class(gauss_integrator), intent(inout) :: self
      real(wp), intent(in) :: t_out !! not after the stop time [s]
      real(wp), contiguous, intent(out) :: y(:) !! (n_states)
      real(wp), intent(out) :: t    !! t_out, or the last good time [s]
      type(error_type), allocatable, intent(out) :: error

      call self%check_target(t_out, error)
      do while (.not. allocated(error) .and. self%t < t_out)
         call step(self, error)
      end do
      t = self%t
      y = self%y
      if (allocated(error) .or. t <= t_out) return
      call inner_state(self, t_out, y, error)
      if (allocated(error)) then
         y = self%y
      else
         t = t_out
      end if
   end subroutine advance

   !> State inside the last step, by one shorter step from its start whose first guess is that step's own polynomial. Should its
   !> iteration not converge, by several steps; and if nothing helps, by the polynomial itself, which is of lower order.
   subroutine inner_state(self, t_out, y, error)
      class(gauss_integrator), intent(inout) :: self
      real(wp), intent(in) :: t_out
      real(wp), contiguous, intent(out) :: y(:)
      type(error_type), allocatable, intent(inout) :: error !! powers that cannot be evaluated
      integer :: n
      logical :: ok

      call swap_matrices(self%now, self%spare)
      n = 1
      do
         call inner_steps(self, t_out - self%t_before, n, .true., y, ok)
         if (ok .or. n >= most_inner_steps) exit
         n = 2*n
      end do
      if (.not. ok) call inner_steps(self, t_out - self%t_before, 1, .false., y, ok)
      call swap_matrices(self%now, self%spare)
      if (.not. ok) call raise(error, 'gauss: output at t = '//time_text(t_out)//' s: '//no_powers)
   end subroutine inner_state

   !> From the start of the last step over a time h in n equal steps.
   subroutine inner_steps(self, h, n, iterated, y, ok)
      class(gauss_integrator), intent(inout) :: self
      real(wp), intent(in) :: h !! [s]
      integer, intent(in) :: n
      logical, intent(in) :: iterated !! else their first guess is left as it is
      real(wp), contiguous, intent(out) :: y(:)
      logical, intent(out) :: ok
      real(wp) :: rates(2), t
      integer :: i

      y = self%y_before
      rates = [self%rate, self%late_rate]
      self%late_rate = 0.0_wp ! this first guess is nearly right in all its parts
      call set_step(self, h/n)
      do i = 0, n - 1
         t = self%t_before + h*(real(i, wp)/n)
         call multiply(self%mechanics%n_dof, self%rule%interpolation((h*i)/(n*self%last%h), h/(n*self%last%h)), self%last%f, &
                       self%trial%f)
         ok = .true.
         if (iterated) then
            call set_weights(self, y)
            call iterate(self, t, y, ok)
            if (ok) ok = all(ieee_is_finite(self%trial%f))
            if (.not. ok) exit
         else
            call nodes_from(self, y)
         end if
         call form_increment(self, y)
         if (self%system%has_quadratures()) call add_quadratures(self, t, y, ok)
         if (.not. ok) exit
         y = y + self%increment
      end do
      self%rate = rates(1)
      self%late_rate = rates(2)
   end subroutine inner_steps

   subroutine swap_matrices(a, b)
      type(step_matrices), allocatable, intent(inout) :: a, b
      type(step_matrices), allocatable :: c
      call move_alloc(a, c)
      call move_alloc(b, a)
      call move_alloc(c, b)
   end subroutine swap_matrices

   !> One accepted step: try, and shorten, until iteration and error allow it.
   subroutine step(self, error)
      class(gauss_integrator), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: h, t_new, estimate
      logical :: ok, rejected

      rejected = .false.
      call set_weights(self, self%y)
      do
         call self%permit_step(error)
         if (allocated(error)) return
         if (self%excess > search_cost*self%mechanics%n_dof) call search_modes(self, self%h, error)
         if (allocated(error)) return
         call choose_end(self, h, t_new)
         if (h <= 4.0_wp*spacing(self%t)) then
            call raise(error, 'gauss at t = '//time_text(self%t)//' s: '//trouble(self))
            return
         end if
         call set_step(self, h)
         if (self%now%coupled .neqv. self%modes%coupled) then
            self%modes%coupled = self%now%coupled
            call renew_history(self)
         end if
         call predict(self, ok)
         if (ok) call iterate(self, self%t, self%y, ok)
         estimate = huge(1.0_wp)
         if (ok) then
            call form_increment(self, self%y, estimate)
            ok = all(ieee_is_finite(self%increment))
         end if
         if (ok .and. (estimate <= largest_estimate .or. self%n_grid > 0)) exit
         if (self%n_grid > 0 .and. rejected) then ! not even with new modes
            call raise(error, 'gauss at t = '//time_text(self%t)//' s: '//trouble(self))
            return
         end if
         self%counts%n_error_test_failures = self%counts%n_error_test_failures + 1
         self%n_steps = self%n_steps - 1
         rejected = .true.
         if (ok) then
            self%h = h*max(0.3_wp, 0.9_wp*(wanted_estimate/estimate)**(1.0_wp/17.0_wp))
         else
            self%counts%n_nonlinear_failures = self%counts%n_nonlinear_failures + 1
            self%excess = huge(1.0_wp) ! the modes may be to blame
            if (self%n_grid == 0) self%h = 0.4_wp*h
         end if
      end do
      if (modulo(self%n_steps, degree_interval) == 0) call choose_degree(self)
      if (self%system%has_quadratures()) call add_quadratures(self, self%t, self%y, ok)
      if (.not. ok) then
         call raise(error, 'gauss at t = '//time_text(self%t)//' s: '//no_powers)
         return
      end if
      call accept(self, h, t_new)
      if (self%system%has_quadratures()) &
         call self%system%note_quadratures(self%y(self%system%n_controlled + 1:), self%quadrature_error)
      self%excess = self%excess + real(self%iterations - self%fewest, wp)
      self%fewest = min(self%fewest, self%iterations)
      if (self%iterations < 3) self%late_rate = memory*self%late_rate
      if (self%n_grid == 0) call choose_next(self, h, t_new, estimate, rejected)
   end subroutine step

   !> Keep the step while it is nearly right: a new one costs new matrices.
   subroutine choose_next(self, h, t_new, estimate, rejected)
      class(gauss_integrator), intent(inout) :: self
      real(wp), intent(in) :: h, t_new, estimate
      logical, intent(in) :: rejected
      real(wp) :: factor

      ! The estimate depends on the phase of the vibrations: two steps' mean tells more.
      self%estimate = sqrt(max(estimate, 1.0e-30_wp)*merge(self%estimate, max(estimate, 1.0e-30_wp), self%estimate > 0.0_wp))
      factor = min(2.0_wp, (wanted_estimate/self%estimate)**(1.0_wp/17.0_wp))
      if (self%iterations > 8) factor = min(factor, 0.8_wp)
      if (rejected) factor = min(factor, 1.0_wp)
      if (factor > 0.93_wp .and. factor < 1.12_wp) factor = 1.0_wp
      if (factor < 1.0_wp .or. factor > 1.0_wp) self%estimate = 0.0_wp
      ! A step cut short by the stop time says little about the next one.
      if (t_new < self%t_stop .or. h*factor > self%h) self%h = h*factor
      if (self%options%max_step > 0.0_wp) self%h = min(self%h, self%options%max_step)
   end subroutine choose_next

   !> The step to try and the time it ends at: on the stop time if that is near, or on the grid of fixed steps.
   subroutine choose_end(self, h, t_new)
      class(gauss_integrator), intent(in) :: self
      real(wp), intent(out) :: h, t_new
      real(wp) :: left

      if (self%n_grid > 0) then
         t_new = self%t_first + (self%t_stop - self%t_first)*(real(self%i_grid + 1, wp)/real(self%n_grid, wp))
         if (self%i_grid + 1 == self%n_grid) t_new = self%t_stop
         h = (self%t_stop - self%t_first)/real(self%n_grid, wp)
         return
      end if
      h = self%h
      left = self%t_stop - self%t
      t_new = self%t_stop
      if (h >= left) then
         h = left
      else if (1.8_wp*h > left) then ! two even steps rather than one and a sliver
         h = 0.5_wp*left
         t_new = self%t + (h - self%t_lost)
      else
         t_new = self%t + (h - self%t_lost)
      end if
   end subroutine choose_end

   !> Find the stiff modes at the present configuration, and what follows from them.
   subroutine search_modes(self, h, error)
      class(gauss_integrator), intent(inout) :: self
      real(wp), intent(in) :: h !! expected step, 0: unknown [s]
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: slowest, weight
      logical :: ok

      slowest = 0.0_wp
      weight = 0.0_wp
      if (h > 0.0_wp .and. self%n_grid == 0) slowest = smallest_phase/h
      if (h > 0.0_wp) weight = 1.0_wp/(typical_lambda*h)
      call self%mechanics%find_modes(self%y(:self%mechanics%n_dof), slowest, weight, self%modes, ok)
      self%counts%n_jac = self%counts%n_jac + 1
      if (.not. ok) then
         call raise(error, 'gauss at t = '//time_text(self%t)//' s: mass matrix not positive definite')
         return
      end if
      self%excess = 0.0_wp
      self%fewest = most_iterations
      self%now%h = 0.0_wp
      self%spare%h = 0.0_wp
      associate (most => size(self%modes%square))
         if (allocated(self%modal)) then
            if (size(self%modal, 2) /= most) deallocate (self%modal, self%reply, self%stiff, self%rest, self%motion)
         end if
         if (.not. allocated(self%modal)) &
            allocate (self%modal(s, most), self%reply(s, most), self%stiff(s, most), self%rest(most), self%motion(most))
      end associate
      if (h > 0.0_wp) self%modes%coupled = self%modes%couples(1.0_wp/(typical_lambda*h))
      call renew_history(self)
   end subroutine search_modes

   !> What is smooth of the last step, with other modes.
   subroutine renew_history(self)
      class(gauss_integrator), intent(inout) :: self

      if (self%i_grid == 0) self%has_history = .false. ! no step has been accepted that could be restored
      if (.not. self%has_history) return
      call restore_nodes(self, self%last)
      call remove_stiff_part(self, self%last)
   end subroutine renew_history

   !> Matrices for a step of length h.
   subroutine set_step(self, h)
      class(gauss_integrator), intent(inout) :: self
      real(wp), intent(in) :: h

      if (h == self%now%h) return
      self%now%h = h
      self%now%h_last = 0.0_wp
      self%now%h_a = h*self%rule%a
      self%now%h2_a2 = h**2*self%rule%a2
      self%now%coupled = self%modes%couples(1.0_wp/(typical_lambda*h))
      self%now%damped = any(h*self%modes%damping(:self%modes%n) > 1.0_wp)
      call self%now%modal%prepare(self%rule, self%modes, h, self%now%coupled)
   end subroutine set_step

   subroutine set_weights(self, y)
      class(gauss_integrator), intent(inout) :: self
      real(wp), intent(in) :: y(:)
      associate (m => self%mechanics%n_dof)
         self%weight(:) = 1.0_wp/(self%options%atol + self%options%rtol*abs(y(m + 1:2*m)))
      end associate
   end subroutine set_weights

   !> First guess of F: extrapolate what is smooth, N, and solve the stiff modes with it. With Q = q + c h p, P = p the
   !> residual for F = 0 is R = N - sum u stiff, stiff = omega^2 v.Q + damping v.P, and F = R - sum u G R.v.
   subroutine predict(self, ok)
      class(gauss_integrator), intent(inout) :: self
      logical, intent(out) :: ok
      integer :: m, base

      m = self%mechanics%n_dof
      base = self%mechanics%n_ignorable
      ok = .true.
      if (.not. self%has_history) then
         call begin_history(self, ok)
         if (.not. ok) return
      end if
      if (self%now%h_last /= self%last%h) then
         self%now%h_last = self%last%h
         self%now%ahead = self%rule%interpolation(1.0_wp, self%now%h/self%last%h, self%degree)
      end if
      call multiply(m, self%now%ahead, self%last%smooth, self%trial%smooth)
      associate (modes => self%modes)
         call project(m - base, modes%n, modes%v, self%trial%smooth(:, base + 1:), self%modal)
         call modes%stiff_line(self%y(base + 1:m), self%y(m + base + 1:2*m), self%rest, self%motion)
         self%rest(:modes%n) = -self%rest(:modes%n)
         call straight_lines(modes%n, self%rest, self%motion, -self%now%h, self%rule%c, self%stiff)
         call accumulate(modes%n, self%stiff, self%modal)
         call self%now%modal%answer(self%rule, self%modes, self%modal, self%reply)
         call accumulate(modes%n, self%stiff, self%reply)
         call copy(m, self%trial%smooth, self%trial%f)
         call expand(m, modes%n, size(modes%u, 1), modes%u, self%reply, self%trial%f)
      end associate
   end subroutine predict

   !> Whether the smooth part is better extrapolated with low or full degree, seen from the step just done. What fast vibrations
   !> leave in it is large in all its coefficients, and polynomials of high degree enlarge that outside their step. The measure
   !> is what the error of the guess does to Q, A^2 dN.
   subroutine choose_degree(self)
      class(gauss_integrator), intent(inout) :: self
      real(wp) :: errors(size(degrees)), sums(s)
      real(wp), dimension(s, s) :: minus_a2, ahead
      integer :: i, m

      m = self%mechanics%n_dof
      minus_a2 = -self%rule%a2 ! an expression as an argument would allocate
      do i = 1, size(degrees)
         ahead = self%rule%interpolation(1.0_wp, self%now%h/self%last%h, degrees(i))
         ahead = matmul(self%rule%a2, ahead)
         call multiply(m, ahead, self%last%smooth, self%guess)
         call apply(m, minus_a2, self%trial%smooth, self%guess)
         sums = square_sums(m, self%guess, self%weight)
         errors(i) = sum(sums)
      end do
      i = minloc(errors, dim=1)
      if (degrees(i) /= self%degree) self%now%h_last = 0.0_wp
      self%degree = degrees(i)
   end subroutine choose_degree

   !> Before the first step: the smooth part is taken to be constant.
   subroutine begin_history(self, ok)
      class(gauss_integrator), intent(inout) :: self
      logical, intent(out) :: ok

      associate (m => self%mechanics%n_dof)
         self%last%q(:, :) = spread(self%y(:m), 1, s)
         self%last%p(:, :) = spread(self%y(m + 1:2*m), 1, s)
      end associate
      call self%mechanics%lane_accelerations(spread(self%t, 1, s), self%last%q, self%last%p, self%last%f, ok)
      self%refused = .not. ok
      self%counts%n_rhs = self%counts%n_rhs + 1
      if (.not. ok) return
      call remove_stiff_part(self, self%last)
      self%last%h = self%now%h
      self%has_history = .true.
   end subroutine begin_history

   !> smooth = F + u (K v.Q + D v.P).
   subroutine remove_stiff_part(self, record)
      class(gauss_integrator), intent(inout) :: self
      type(step_record), intent(inout) :: record
      associate (base => self%mechanics%n_ignorable)
         call self%modes%stiff_rates(record%q(:, base + 1:), record%p(:, base + 1:), self%modal, self%reply)
      end associate
      record%smooth(:, :) = record%f
      call expand(self%mechanics%n_dof, self%modes%n, size(self%modes%u, 1), self%modes%u, self%modal, record%smooth)
   end subroutine remove_stiff_part

   !> Q and P of the last step, whose last correction `iterate` may have left out.
   subroutine restore_nodes(self, record)
      class(gauss_integrator), intent(inout) :: self
      type(step_record), intent(inout) :: record

      associate (m => self%mechanics%n_dof, base => self%mechanics%n_ignorable, h => record%h)
         call straight_lines(m, self%y_before, self%y_before(m + 1:), h, self%rule%c, record%q)
         call straight_lines(m, self%y_before(m + 1:), self%y_before(m + 1:), 0.0_wp, self%rule%c, record%p)
         call apply(m - base, h*self%rule%a, record%f(:, base + 1:), record%p(:, base + 1:))
         call apply(m - base, h**2*self%rule%a2, record%f(:, base + 1:), record%q(:, base + 1:))
      end associate
   end subroutine restore_nodes

   !> Solve for F of `trial` from its first guess. Q and P follow, but for the last correction where nobody asks for it.
   !>
   !> What F has beside the stiff part, N = F + u (K v.Q + D v.P), follows from the residuals alone: the
   !> correction that answers R changes N by R, since (1 - G)(1 + h D A + h^2 K A^2) = 1.
   subroutine iterate(self, t, y, ok)
      class(gauss_integrator), intent(inout) :: self
      real(wp), contiguous, intent(in) :: y(:)
      real(wp), intent(in) :: t
      logical, intent(out) :: ok
      real(wp) :: change, before, times(s), sums(s)
      integer :: j, m, base
      logical :: done

      m = self%mechanics%n_dof
      base = self%mechanics%n_ignorable
      before = 0.0_wp
      times = t + self%now%h*self%rule%c
      call nodes_from(self, y)
      do j = 1, most_iterations
         self%iterations = j
         call self%mechanics%lane_accelerations(times, self%trial%q, self%trial%p, self%trial%a, ok)
         self%counts%n_rhs = self%counts%n_rhs + s
         if (self%now%coupled) self%counts%n_coupled = self%counts%n_coupled + s
         self%refused = .not. ok
         if (.not. ok) return
         call residual(m, self%trial%a, self%trial%f, self%guess, self%trial%smooth)
         call project(m - base, self%modes%n, self%modes%v, self%guess(:, base + 1:), self%modal)
         call self%now%modal%answer(self%rule, self%modes, self%modal, self%reply)
         call expand(m, self%modes%n, size(self%modes%u, 1), self%modes%u, self%reply, self%guess)
         call add(m, self%guess, self%weight, self%trial%f, sums)
         change = self%now%h*sqrt(sum(sums)/real(s*m, wp))
         call judge(done)
         if (done) exit
         call move_nodes(self, self%guess)
         before = change
      end do
      ok = ok .and. done
      if (.not. ok) return
      if (size(y) > 2*m) then ! the quadratures need all of Q and P
         call move_nodes(self, self%guess)
      else
         call apply(base, self%now%h_a, self%guess, self%trial%p)
      end if

   contains

      !> Whether this correction was the last one; not `ok`: there is no hope. The first contraction is that of what was most wrong
      !> with the guess, mostly in stiff modes, which contract fast; the rest, hidden below, may contract a hundred times slower,
      !> as later corrections show, if not of this step, of those before.
      subroutine judge(done)
         logical, intent(out) :: done
         done = .true.
         ok = ieee_is_finite(change)
         if (.not. ok) return
         if (j > 1) then
            if (change > 0.5_wp*before) then ! no progress: at the level of rounding, or hopeless
               ok = change <= max(0.1_wp, rounding(self, y))
               if (ok .or. (j > 4 .and. change > 2.0_wp*before)) return
               ok = .true.
            end if
            self%rate = min(1.0_wp, max(1.0e-4_wp, change/before))
            if (j > 2) self%late_rate = self%rate
         end if
         done = max(self%rate, self%late_rate)*change <= iteration_error
      end subroutine judge

   end subroutine iterate

   !> What rounding leaves of a correction, in tolerances: that of F, and that of Q, which F must balance.
   real(wp) function rounding(self, y)
      class(gauss_integrator), intent(in) :: self
      real(wp), intent(in) :: y(:)
      associate (m => self%mechanics%n_dof, h => self%now%h)
         rounding = 64.0_wp*epsilon(1.0_wp)*(h*weighted_norm(self%trial%f, self%weight) + &
                                             norm2(y(:m)*self%weight)/(h*sqrt(real(m, wp))))
      end associate
   end function rounding

   !> P = p + h A F,  Q = q + c h p + h^2 A^2 F.
   subroutine nodes_from(self, y)
      class(gauss_integrator), intent(inout) :: self
      real(wp), contiguous, intent(in) :: y(:)
      integer :: m

      m = self%mechanics%n_dof
      call straight_lines(m, y, y(m + 1:), self%now%h, self%rule%c, self%trial%q)
      call straight_lines(m, y(m + 1:), y(m + 1:), 0.0_wp, self%rule%c, self%trial%p)
      call move_nodes(self, self%trial%f)
   end subroutine nodes_from

   !> P = P + h A dF, Q = Q + h^2 A^2 dF; ignorable coordinates are not followed.
   subroutine move_nodes(self, df)
      class(gauss_integrator), intent(inout) :: self
      real(wp), contiguous, intent(in) :: df(:, :)
      associate (m => self%mechanics%n_dof, base => self%mechanics%n_ignorable)
         call apply(m, self%now%h_a, df, self%trial%p)
         call apply(m - base, self%now%h2_a2, df(:, base + 1:), self%trial%q(:, base + 1:))
      end associate
   end subroutine move_nodes

   !> Root mean square of weighted values over nodes and unknowns.
   pure real(wp) function weighted_norm(x, weight)
      real(wp), contiguous, intent(in) :: x(:, :) !! (s, n_dof)
      real(wp), intent(in) :: weight(:)
      weighted_norm = sqrt(sum(square_sums(size(weight), x, weight))/real(size(x), wp))
   end function weighted_norm

   !> Increment of q and p over the step; and an estimate of its error in units of the tolerance.
   !>
   !> F is a polynomial with Legendre coefficients C_0..C_7; the increments are h C_0 and h p + h^2 (C_0/2 - C_1/6).
   !> A vibration of frequency omega has C_k ~ (h omega)^k, and its error over the step is ~ (h omega)^17: about what the mean of F
   !> neglects.
   subroutine form_increment(self, y, estimate)
      class(gauss_integrator), intent(inout) :: self
      real(wp), contiguous, intent(in) :: y(:)
      real(wp), intent(out), optional :: estimate
      real(wp) :: sums(s)
      integer :: j, m

      m = self%mechanics%n_dof
      call legendre_coefficients(self, self%guess)
      sums = square_sums(m, self%guess, self%weight)
      associate (h => self%now%h)
         do j = 1, m
            self%increment(m + j) = h*self%guess(1, j)
            self%increment(j) = h*(y(m + j) + h*(0.5_wp*self%guess(1, j) - self%guess(2, j)/6.0_wp))
         end do
      end associate
      if (self%mechanics%n_ignorable == 3) call turn_displacement(self, y)
      if (.not. present(estimate)) return
      estimate = error_constant*self%now%h*neglected(sums)/sqrt(real(m, wp))
      if (self%now%damped) estimate = max(estimate, wanted_estimate*(loss(self, y)/wanted_loss)**(17.0_wp/s))
   end subroutine form_increment

   !> `lost_response` of the step: the estimate above knows nothing of it.
   real(wp) function loss(self, y)
      class(gauss_integrator), intent(inout) :: self
      real(wp), intent(in) :: y(:)
      integer :: i, j

      associate (m => self%mechanics%n_dof, base => self%mechanics%n_ignorable, modes => self%modes)
         call multiply(m, self%rule%coefficients, self%trial%smooth, self%guess)
         call project(m - base, modes%n, modes%v, self%guess(:, base + 1:), self%modal)
         self%rest(:modes%n) = 0.0_wp
         do j = 1, m
            do i = 1, modes%n
               self%rest(i) = self%rest(i) + (modes%u(i, j)/(self%options%atol + self%options%rtol*abs(y(j))))**2
            end do
         end do
         self%rest(:modes%n) = sqrt(self%rest(:modes%n)/m)
         loss = modes%lost_response(self%now%h, self%modal, self%rest)
      end associate
   end function loss

   !> Coefficients of F in shifted Legendre polynomials, one polynomial to a lane.
   subroutine legendre_coefficients(self, coefficient)
      class(gauss_integrator), intent(in) :: self
      real(wp), contiguous, intent(out) :: coefficient(:, :) !! (s, n_dof)
      call multiply(size(coefficient, 2), self%rule%coefficients, self%trial%f, coefficient)
   end subroutine legendre_coefficients

   !> Displacement of C along axes that turn. As a complex number u' = V - i w u, so with theta the turn since the start
   !> of the step, u exp(i theta) = u_0 + integral of V exp(i theta).
   subroutine turn_displacement(self, y)
      class(gauss_integrator), intent(inout) :: self
      real(wp), intent(in) :: y(:)
      real(wp), dimension(s + 1) :: theta, sine, cosine !! at the nodes; half the turn of the step
      real(wp) :: x, v, cos_end, sin_end

      associate (p => self%trial%p, h => self%now%h, b => self%rule%b)
         theta(:s) = 0.0_wp
         call apply_one(self%now%h_a, p(:, 3), theta(:s))
         theta(s + 1) = 0.5_wp*self%increment(3)
         call sine_cosine(s + 1, theta, sine, cosine)
         x = h*sum(b*(p(:, 1)*cosine(:s) - p(:, 2)*sine(:s)))
         v = h*sum(b*(p(:, 1)*sine(:s) + p(:, 2)*cosine(:s)))
         cos_end = -2.0_wp*sine(s + 1)**2 ! cos(theta) - 1 at the end
         sin_end = 2.0_wp*sine(s + 1)*cosine(s + 1)
         self%increment(1) = x + ((y(1) + x)*cos_end + (y(2) + v)*sin_end)
         self%increment(2) = v + ((y(2) + v)*cos_end - (y(1) + x)*sin_end)
      end associate
   end subroutine turn_displacement

   !> Integrals of the states behind (q, p), by the nodes of the step or, if these are too few for them, refined (not in fixed
   !> steps, in which the motion has no tolerance either).
   subroutine add_quadratures(self, t, y, ok)
      class(gauss_integrator), intent(inout) :: self
      real(wp), intent(in) :: t    !! at the start of the step [s]
      real(wp), intent(in) :: y(:) !! there
      logical, intent(out) :: ok   !! false: the rates cannot be evaluated at a node
      real(wp) :: power(s, n_quadratures) ! rates at the nodes
      real(wp), dimension(n_quadratures) :: rate, values
      real(wp) :: tolerance
      integer :: i, n_steps

      associate (m => self%mechanics%n_dof, h => self%now%h, error => self%quadrature_error)
         do i = 1, s
            self%node_state(:m) = self%trial%q(i, :)
            self%node_state(m + 1:) = self%trial%p(i, :)
            call self%system%quadratures(t + h*self%rule%c(i), self%node_state, rate, ok)
            if (.not. ok) return
            power(i, :) = rate
         end do
         do i = 1, n_quadratures
            self%increment(2*m + i) = h*sum(self%rule%b*power(:, i))
            error(i) = h*neglected(matmul(self%rule%coefficients, power(:, i))**2)
         end do
         if (self%n_grid > 0) return
         values = y(2*m + 1:) + self%increment(2*m + 1:)
         tolerance = self%system%quadrature_tolerance(self%options%rtol, self%options%atol, values)
         if (maxval(error) <= tolerance) return
         call compare_halves(self, t)
         if (maxval(error) <= tolerance .or. .not. self%refines) return
         call self%refinement%refine(self%system, t, y, t + h, self%options%rtol, self%options%atol, tolerance, &
                                     self%increment(2*m + 1:), error, self%counts%n_rhs, n_steps, self%refines)
         call self%count_as_steps(n_steps)
      end associate
   end subroutine add_quadratures

   !> A better estimate where the last coefficients do not fall off, as those of small fast vibrations: the distance to the
   !> same rule on both halves of the step, with its own polynomials. None, if that cannot be evaluated.
   subroutine compare_halves(self, t)
      class(gauss_integrator), intent(inout) :: self
      real(wp), intent(in) :: t !! at the start of the step [s]
      real(wp) :: matrix(s, s)
      real(wp), dimension(n_quadratures) :: both, rate
      logical :: ok
      integer :: half, i

      both = 0.0_wp
      associate (m => self%mechanics%n_dof, h => self%now%h)
         do half = 0, 1
            matrix = self%rule%interpolation(0.5_wp*half, 0.5_wp)
            call multiply(m, matrix, self%trial%q, self%guess)
            call multiply(m, matrix, self%trial%p, self%trial%a) ! which nobody needs any more
            do i = 1, s
               self%node_state(:m) = self%guess(i, :)
               self%node_state(m + 1:) = self%trial%a(i, :)
               call self%system%quadratures(t + h*(0.5_wp*half + 0.5_wp*self%rule%c(i)), self%node_state, rate, ok)
               if (.not. ok) return
               both = both + 0.5_wp*h*self%rule%b(i)*rate
            end do
         end do
         self%quadrature_error = min(self%quadrature_error, abs(both - self%increment(2*m + 1:)))
      end associate
   end subroutine compare_halves

   !> What the rule neglects of the mean of a function, the part of degree 16. The last Legendre coefficients are those of the
   !> fastest vibration that matters; how fast it is shows in how they fall off:
   !>     |C_16| ~ |C_7, C_6| (|C_7, C_6|/|C_5, C_4|)^4.5.
   !> Those of a vibration fall off faster and faster, |C_7, C_6|/|C_5, C_4| being 0.35 to 0.44 of |C_5, C_4|/|C_3, C_2|. If it is
   !> less than a quarter, they are small by chance, and a quarter is taken.
   pure real(wp) function neglected(square)
      real(wp), intent(in) :: square(s) !! of the coefficients of P_0..P_7
      real(wp) :: high, low, least, ratio ! of squares

      high = square(8) + square(7)
      low = square(6) + square(5)
      least = regular**2*fall_off(low, square(4) + square(3))
      ratio = max(fall_off(high, low), least)
      neglected = sqrt(max(high, least*low))*ratio**2*sqrt(sqrt(ratio))
   end function neglected

   pure real(wp) function fall_off(high, low)
      real(wp), intent(in) :: high, low
      fall_off = 1.0_wp
      if (high < low) fall_off = high/low
   end function fall_off

   !> Make the trial the last step, and keep the digits that rounding takes from the state.
   subroutine accept(self, h, t_new)
      class(gauss_integrator), intent(inout) :: self
      real(wp), intent(in) :: h, t_new
      real(wp) :: y_new
      integer :: i

      self%trial%h = h
      call swap_records(self%last, self%trial)
      do i = 1, size(self%y)
         self%y_before(i) = self%y(i)
         y_new = self%y(i) + (self%increment(i) - self%lost(i))
         self%lost(i) = (y_new - self%y(i)) - (self%increment(i) - self%lost(i))
         self%y(i) = y_new
      end do
      self%t_before = self%t
      self%t_lost = (t_new - self%t) - (h - self%t_lost)
      if (t_new >= self%t_stop .or. self%n_grid > 0) self%t_lost = 0.0_wp
      self%t = t_new
      self%t_good = t_new
      self%i_grid = self%i_grid + 1
      self%counts%last_step = h
   end subroutine accept

   subroutine swap_records(a, b)
      type(step_record), intent(inout) :: a, b
      real(wp) :: h
      call swap(a%f, b%f)
      call swap(a%a, b%a)
      call swap(a%q, b%q)
      call swap(a%p, b%p)
      call swap(a%smooth, b%smooth)
      h = a%h
      a%h = b%h
      b%h = h
   end subroutine swap_records

   subroutine swap(a, b)
      real(wp), allocatable, intent(inout) :: a(:, :), b(:, :)
      real(wp), allocatable :: c(:, :)
      call move_alloc(a, c)
      call move_alloc(b, a)
      call move_alloc(c, b)
   end subroutine swap

   !> What stands in the way of a step.
   function trouble(self) result(text)
      class(gauss_integrator), intent(in) :: self
      character(len=:), allocatable :: text
      if (self%refused) then
         text = 'the right-hand side could not be evaluated (mass matrix not positive definite, or not finite)'
      else
         text = 'the iteration for the stages does not converge, or no step is small enough'
      end if
   end function trouble

   !> Counts over the whole run.
   function statistics(self) result(stats)
      class(gauss_integrator), intent(inout) :: self
      type(solver_statistics) :: stats
      stats = self%counts
      stats%n_steps = self%n_steps
      stats%n_starts = self%n_starts
   end function statistics

   !> Nothing is held outside Fortran.
   subroutine finalize(self)
      class(gauss_integrator), intent(inout) :: self
      nullify (self%system, self%mechanics, self%monitor)
   end subroutine finalize

end module rodyn_gauss_integrator
