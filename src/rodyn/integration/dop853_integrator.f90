!> Explicit Runge-Kutta of order 8 with a 5th- and a 3rd-order error estimate (Dormand & Prince, DOP853).
!>
!> The method is that of Hairer, Norsett & Wanner (Solving ODEs I, sec. II.5 and II.10). It stands here because the
!> right-hand side is so cheap that a general library's overhead costs more than it does, and for one thing no
!> library does: the state is summed with compensation. Outputs inside a step are computed by one shorter step from its start, as
!> accurate as the steps themselves.
module rodyn_dop853_integrator
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type, raise
   use rodyn_text, only: time_text
   use rodyn_ode, only: ode_system
   use rodyn_integrator, only: solver_options
   use rodyn_one_step_integrator, only: one_step_integrator
   use rodyn_event_search, only: find_event
   use rodyn_dop853_step, only: n_stages, inner_options, stages, add_increment, error_norm, quadrature_errors, safety, shrink, &
      grow, choose_end, trial_step, first_step_length, obstacle
   implicit none (type, external)
   private
   public :: dop853_integrator, new_dop853_integrator

   type, extends(one_step_integrator) :: dop853_integrator
      private
      real(wp), allocatable :: f(:), f_before(:)   !! rates at t and t_before (n_states)
      real(wp), allocatable :: k(:, :)             !! rates of the stages (n_states, 12)
      real(wp), allocatable :: stage(:), y_new(:)  !! workspace (n_states)
      real(wp), allocatable :: y_event(:)          !! workspace, if there are events
      logical :: refused = .false.                 !! the last bad try failed because the right-hand side said so
   contains
      procedure :: start
      procedure :: step
      procedure :: output
      procedure :: state_within
   end type dop853_integrator

contains

   !> Create an integrator for `system`, which must outlive it.
   subroutine new_dop853_integrator(self, system, options, error)
      type(dop853_integrator), intent(out) :: self
      class(ode_system), target, intent(inout) :: system
      type(solver_options), intent(in) :: options
      type(error_type), allocatable, intent(out) :: error

      associate (unused => error); end associate
      call self%create(system, options, inner_options(options), 'dop853', 8)
      associate (n => system%n_states)
         allocate (self%f(n), self%f_before(n), self%k(n, n_stages), self%stage(n), self%y_new(n), source=0.0_wp)
      end associate
   end subroutine new_dop853_integrator

   !> First start, or exact restart. `set_stop` comes before.
   subroutine start(self, t, y, error)
      class(dop853_integrator), intent(inout) :: self
      real(wp), intent(in) :: t    !! [s]
      real(wp), intent(in) :: y(:) !! (n_states)
      type(error_type), allocatable, intent(out) :: error
      logical :: ok

      call self%begin(t, y, error)
      if (allocated(error)) return
      call evaluate(self, t, self%y_good, self%f, ok)
      if (.not. ok) then
         call self%cannot_step(obstacle(self%refused), error)
      else if (self%grid%n == 0) then
         call first_step(self, error)
      end if
   end subroutine start

   !> The state inside the last step, by one shorter step from its start.
   subroutine output(self, t, y, error)
      class(dop853_integrator), intent(inout) :: self
      real(wp), intent(in) :: t !! [s]
      real(wp), contiguous, intent(out) :: y(:) !! (n_states)
      type(error_type), allocatable, intent(inout) :: error
      logical :: ok
      call self%state_within(t, y, ok)
      if (.not. ok) call raise(error, 'dop853: output at t = '//time_text(t)//' s: the right-hand side cannot be evaluated')
   end subroutine output

   !> For `rodyn_event_search`.
   subroutine state_within(self, t, y, ok)
      class(dop853_integrator), intent(inout) :: self
      real(wp), intent(in) :: t !! [s]
      real(wp), contiguous, intent(out) :: y(:)
      logical, intent(out) :: ok

      associate (h => t - self%t_before)
         call stages(self%system, size(y), self%t_before, h, self%y_before, self%f_before, self%k, self%stage, ok)
         self%counts%n_rhs = self%counts%n_rhs + n_stages - 1
         call add_increment(size(y), h, self%k, self%increment)
         if (self%system%has_quadratures()) call control_quadratures(self, self%t_before, h, self%y_before)
         y = self%y_before + self%increment
      end associate
   end subroutine state_within

   !> Estimate the errors of the quadratures in the step just made; if they are too large, refine them.
   subroutine control_quadratures(self, t, h, y)
      class(dop853_integrator), intent(inout) :: self
      real(wp), intent(in) :: t, h !! [s]
      real(wp), intent(in) :: y(:) !! at the start of the step
      real(wp) :: tolerance
      logical :: ok

      call quadrature_errors(self%system%n_controlled, h, self%k, self%quadrature_error)
      tolerance = self%quadrature_limit(y)
      if (maxval(self%quadrature_error) > tolerance) call self%refine_quadratures(t, h, y, tolerance, ok)
   end subroutine control_quadratures

   !> Did an event function become negative in the last step? Then the step ends there.
   subroutine look_for_event(self)
      class(dop853_integrator), intent(inout) :: self
      real(wp) :: t

      if (.not. allocated(self%y_event)) allocate (self%y_event(self%system%n_states), source=0.0_wp)
      call find_event(self, self%t_before, self%y_before, self%f_before, self%t, self%y_good, self%f, self%pending, t, self%y_event)
      if (.not. self%pending) return
      self%t = t
      self%t_lost = 0.0_wp
      self%y_good(:) = self%y_event
      self%lost = 0.0_wp
      self%t_good = t
   end subroutine look_for_event

   !> One accepted step: try, and shorten, until the error is below one.
   subroutine step(self, error)
      class(dop853_integrator), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: h, t_new, norm, factor
      logical :: rejected, too_short

      rejected = .false.
      do
         call self%permit_step(error)
         if (allocated(error)) return
         if (self%grid%n > 0) then
            t_new = self%grid%next_end()
            h = t_new - self%t
         else
            call choose_end(self%t, self%t_lost, self%t_stop, self%h, h, t_new)
         end if
         too_short = h <= 4.0_wp*spacing(self%t)
         norm = huge(1.0_wp)
         if (.not. too_short) call try(self, h, t_new, norm)
         if (norm <= 1.0_wp) exit
         if (too_short .or. self%grid%n > 0) then
            call self%cannot_step(obstacle(self%refused), error)
            return
         end if
         self%counts%n_error_test_failures = self%counts%n_error_test_failures + 1
         self%n_steps = self%n_steps - 1
         rejected = .true.
         self%h = h*max(shrink, safety*norm**(-0.125_wp))
      end do
      if (self%system%has_quadratures()) call add_quadratures(self, h)
      call accept(self, h, t_new)
      if (self%system%n_events > 0) call look_for_event(self)
      if (self%grid%n > 0) return
      factor = grow
      if (norm > 0.0_wp) factor = min(grow, max(shrink, safety*norm**(-0.125_wp)))
      if (rejected) factor = min(1.0_wp, factor)
      call self%change_step(h, factor, t_new)
   end subroutine step

   !> A step from t, and the norm of its error in tolerances: huge, if it cannot be evaluated; 0, if steps are fixed.
   subroutine try(self, h, t_new, norm)
      class(dop853_integrator), intent(inout) :: self
      real(wp), intent(in) :: h, t_new !! [s]
      real(wp), intent(out) :: norm
      logical :: ok

      norm = huge(1.0_wp)
      call stages(self%system, size(self%y_good), self%t, h, self%y_good, self%f, self%k, self%stage, ok)
      self%counts%n_rhs = self%counts%n_rhs + n_stages - 1
      self%refused = .not. ok
      if (.not. ok) return
      call add_increment(size(self%y_good), h, self%k, self%increment)
      self%y_new(:) = self%y_good + (self%increment - self%lost)
      if (.not. all(ieee_is_finite(self%y_new))) return
      norm = 0.0_wp
      if (self%grid%n == 0) norm = error_norm(self%system%n_controlled, h, self%k(:self%system%n_controlled, :), self%y_good, &
                                              self%y_new, self%inner%rtol, self%inner%atol)
      if (.not. ieee_is_finite(norm)) norm = huge(1.0_wp)
      if (norm > 1.0_wp) return
      call evaluate(self, t_new, self%y_new, self%stage, ok)
      if (.not. ok) norm = huge(1.0_wp)
   end subroutine try

   subroutine add_quadratures(self, h)
      class(dop853_integrator), intent(inout) :: self
      real(wp), intent(in) :: h !! step [s]
      call control_quadratures(self, self%t, h, self%y_good)
      associate (last => self%system%n_controlled + 1)
         self%y_new(last:) = self%y_good(last:) + (self%increment(last:) - self%lost(last:))
         call self%system%note_quadratures(self%y_new(last:), self%quadrature_error)
      end associate
   end subroutine add_quadratures

   !> Make the new state the current one, with the digits that rounding took from it.
   subroutine accept(self, h, t_new)
      class(dop853_integrator), intent(inout) :: self
      real(wp), intent(in) :: h, t_new

      self%lost = (self%y_new - self%y_good) - (self%increment - self%lost)
      call swap(self%y_before, self%y_good)
      call swap(self%y_good, self%y_new)
      call swap(self%f_before, self%f)
      call swap(self%f, self%stage)
      call self%move_time(h, t_new)
   end subroutine accept

   subroutine swap(a, b)
      real(wp), allocatable, intent(inout) :: a(:), b(:)
      real(wp), allocatable :: c(:)
      call move_alloc(a, c)
      call move_alloc(b, a)
      call move_alloc(c, b)
   end subroutine swap

   !> Rates at (t, y), counted and checked.
   subroutine evaluate(self, t, y, f, ok)
      class(dop853_integrator), intent(inout) :: self
      real(wp), intent(in) :: t
      real(wp), contiguous, intent(in) :: y(:)
      real(wp), contiguous, intent(out) :: f(:)
      logical, intent(out) :: ok
      call self%system%rhs(t, y, f, ok)
      self%counts%n_rhs = self%counts%n_rhs + 1
      self%refused = .not. ok
      if (ok) ok = all(ieee_is_finite(f))
   end subroutine evaluate

   !> Length of the first step (Hairer, Norsett & Wanner, sec. II.4).
   subroutine first_step(self, error)
      class(dop853_integrator), intent(inout) :: self
      type(error_type), allocatable, intent(inout) :: error
      real(wp) :: d0, d1, d2, h0
      logical :: ok

      associate (n => self%system%n_controlled, span => self%t_stop - self%t)
         if (span <= 0.0_wp) return
         self%stage(:) = self%inner%atol + self%inner%rtol*abs(self%y_good)
         d0 = norm2(self%y_good(:n)/self%stage(:n))/sqrt(real(n, wp))
         d1 = norm2(self%f(:n)/self%stage(:n))/sqrt(real(n, wp))
         h0 = trial_step(d0, d1, span)
         self%y_new(:) = self%y_good + h0*self%f
         call evaluate(self, self%t + h0, self%y_new, self%increment, ok)
         if (ok) then
            d2 = norm2((self%increment(:n) - self%f(:n))/self%stage(:n))/sqrt(real(n, wp))/h0
            self%h = first_step_length(h0, d1, d2, span)
         else
            self%h = 1.0e-3_wp*h0
         end if
         if (self%options%max_step > 0.0_wp) self%h = min(self%h, self%options%max_step)
         if (.not. self%h > 0.0_wp) call self%cannot_step('no first step found', error)
      end associate
   end subroutine first_step

end module rodyn_dop853_integrator
