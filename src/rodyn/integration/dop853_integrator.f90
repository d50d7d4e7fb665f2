!> Explicit Runge-Kutta of order 8 with a 5th- and a 3rd-order error estimate (Dormand & Prince, DOP853).
!>
!> The method is that of Hairer, Norsett & Wanner (Solving ODEs I, sec. II.5 and II.10). It stands here because the
!> right-hand side is so cheap that a general library's overhead costs more than it does, and for one thing no
!> library does: the state is summed with compensation (Kahan), so that a million steps lose no more digits
!> than one. Outputs inside a step are computed by one shorter step from its start, as accurate as the steps
!> themselves, so they never change the steps.
module rodyn_dop853_integrator
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use rodyn_kinds, only: wp, i8
   use rodyn_errors, only: error_type, raise
   use rodyn_text, only: time_text
   use rodyn_ode, only: ode_system, n_quadratures
   use rodyn_integrator, only: integrator_type, solver_options, solver_statistics
   use rodyn_event_search, only: find_event
   use rodyn_dop853_step, only: n_stages, inner_options, stages, add_increment, error_norm, quadrature_errors
   use rodyn_quadrature_refinement, only: quadrature_refinement
   implicit none (type, external)
   private
   public :: dop853_integrator, new_dop853_integrator

   type, extends(integrator_type) :: dop853_integrator
      private
      real(wp) :: t = 0.0_wp             !! end of the last step [s]
      real(wp) :: t_lost = 0.0_wp        !! what rounding took from t so far [s]
      real(wp) :: t_before = 0.0_wp      !! its start [s]
      real(wp) :: h = 0.0_wp             !! next step [s]
      type(solver_options) :: inner      !! tolerances of a step
      real(wp), allocatable :: y(:)      !! state at t (n_states)
      real(wp), allocatable :: lost(:)   !! what rounding took from y so far (n_states)
      real(wp), allocatable :: f(:)      !! rates at t
      real(wp), allocatable :: y_before(:), f_before(:) !! at t_before
      real(wp), allocatable :: k(:, :)   !! rates of the stages (n_states, 12)
      real(wp), allocatable :: stage(:), increment(:), y_new(:) !! workspace
      real(wp) :: quadrature_error(n_quadratures) = 0.0_wp !! in the last step
      type(quadrature_refinement) :: refinement
      real(wp) :: t_first = 0.0_wp       !! start of the interval, where the grid of fixed steps begins [s]
      integer(i8) :: n_grid = 0, i_grid = 0 !! fixed steps of the interval; steps done
      real(wp), allocatable :: y_event(:) !! workspace, if there are events
      logical :: refused = .false.       !! the last bad try failed because the right-hand side said so
      type(solver_statistics) :: counts
   contains
      procedure :: start
      procedure :: advance
      procedure :: statistics
      procedure :: finalize
      procedure :: state_within
   end type dop853_integrator

contains

   !> Create an integrator for `system`, which must outlive it.
   subroutine new_dop853_integrator(self, system, options, error)
      type(dop853_integrator), intent(out) :: self
      class(ode_system), target, intent(inout) :: system
      type(solver_options), intent(in) :: options
      type(error_type), allocatable, intent(out) :: error

      self%system => system
      self%options = options
      self%inner = inner_options(options)
      associate (n => system%n_states)
         allocate (self%y(n), self%lost(n), self%f(n), self%y_before(n), self%f_before(n), self%k(n, n_stages), &
                   self%stage(n), self%increment(n), self%y_new(n), source=0.0_wp)
      end associate
      self%counts%last_order = 8
   end subroutine new_dop853_integrator

   !> First start, or exact restart. `set_stop` comes before.
   subroutine start(self, t, y, error)
      class(dop853_integrator), intent(inout) :: self
      real(wp), intent(in) :: t    !! [s]
      real(wp), intent(in) :: y(:) !! (n_states)
      type(error_type), allocatable, intent(out) :: error
      logical :: ok

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
      self%i_grid = 0
      self%n_grid = 0
      call evaluate(self, t, self%y, self%f, ok)
      if (.not. ok) then
         call raise(error, 'dop853 at t = '//time_text(t)//' s: '//trouble(self))
         return
      end if
      if (self%options%fixed_step > 0.0_wp) then
         self%n_grid = max(1_i8, ceiling((self%t_stop - t)/self%options%fixed_step*(1.0_wp - 4.0_wp*epsilon(1.0_wp)), i8))
      else
         call first_step(self, error)
      end if
   end subroutine start

   !> Integrate to exactly t_out.
   subroutine advance(self, t_out, y, t, error)
      class(dop853_integrator), intent(inout) :: self
      real(wp), intent(in) :: t_out !! not after the stop time [s]
      real(wp), contiguous, intent(out) :: y(:) !! (n_states)
      real(wp), intent(out) :: t    !! t_out, or the last good time [s]
      type(error_type), allocatable, intent(out) :: error
      logical :: ok

      call self%check_target(t_out, error)
      do while (.not. allocated(error) .and. self%t < t_out .and. .not. self%pending)
         call step(self, error)
      end do
      self%at_event = self%pending .and. self%t <= t_out
      t = self%t
      y = self%y
      if (allocated(error) .or. t <= t_out) return
      call self%state_within(t_out, y, ok)
      if (.not. ok) then
         call raise(error, 'dop853: output at t = '//time_text(t_out)//' s: the right-hand side cannot be evaluated')
         return
      end if
      t = t_out
   end subroutine advance

   !> The state inside the last step, by one shorter step from its start.
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

   !> Estimate the errors of the quadratures in the step just made; if they are too large, refine them (not in fixed steps, in
   !> which the motion has no tolerance either).
   subroutine control_quadratures(self, t, h, y)
      class(dop853_integrator), intent(inout) :: self
      real(wp), intent(in) :: t, h !! [s]
      real(wp), intent(in) :: y(:) !! at the start of the step
      real(wp) :: values(n_quadratures), tolerance
      integer :: n_steps
      logical :: ok

      associate (m => self%system%n_controlled, options => self%options, error => self%quadrature_error)
         call quadrature_errors(m, h, self%k, error)
         if (self%n_grid > 0) return
         values = y(m + 1:) + self%increment(m + 1:)
         tolerance = self%system%quadrature_tolerance(options%rtol, options%atol, values)
         if (maxval(error) <= tolerance) return
         call self%refinement%refine(self%system, t, y, t + h, self%inner%rtol, self%inner%atol, tolerance, &
                                     self%increment(m + 1:), error, self%counts%n_rhs, n_steps, ok)
         call self%count_as_steps(n_steps)
      end associate
   end subroutine control_quadratures

   !> Did an event function become negative in the last step? Then the step ends there.
   subroutine look_for_event(self)
      class(dop853_integrator), intent(inout) :: self
      real(wp) :: t

      if (.not. allocated(self%y_event)) allocate (self%y_event(self%system%n_states), source=0.0_wp)
      call find_event(self, self%t_before, self%y_before, self%f_before, self%t, self%y, self%f, self%pending, t, self%y_event)
      if (.not. self%pending) return
      self%t = t
      self%t_lost = 0.0_wp
      self%y(:) = self%y_event
      self%lost = 0.0_wp
      self%t_good = t
   end subroutine look_for_event

   !> One accepted step: try, and shorten, until the error is below one.
   subroutine step(self, error)
      class(dop853_integrator), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: safety = 0.9_wp, shrink = 1.0_wp/3.0_wp, grow = 6.0_wp ! Hairer's
      real(wp) :: h, t_new, norm, factor
      logical :: ok, rejected

      rejected = .false.
      do
         call self%permit_step(error)
         if (allocated(error)) return
         call choose_end(self, h, t_new)
         if (h <= 4.0_wp*spacing(self%t)) then
            call raise(error, 'dop853 at t = '//time_text(self%t)//' s: '//trouble(self))
            return
         end if
         call stages(self%system, size(self%y), self%t, h, self%y, self%f, self%k, self%stage, ok)
         self%counts%n_rhs = self%counts%n_rhs + n_stages - 1
         self%refused = .not. ok
         if (ok) then
            call add_increment(size(self%y), h, self%k, self%increment)
            self%y_new(:) = self%y + (self%increment - self%lost)
            ok = all(ieee_is_finite(self%y_new))
            norm = 0.0_wp
            if (ok .and. self%n_grid == 0) norm = error_norm(self%system%n_controlled, h, self%k(:self%system%n_controlled, :), &
                                                    self%y, self%y_new, self%inner%rtol, self%inner%atol)
            if (ok .and. norm <= 1.0_wp) call evaluate(self, t_new, self%y_new, self%stage, ok)
         end if
         if (.not. ok) norm = huge(1.0_wp) ! not finite: shorten by the most
         if (.not. ieee_is_finite(norm)) norm = huge(1.0_wp)
         if (norm <= 1.0_wp) exit
         if (self%n_grid > 0) then
            call raise(error, 'dop853 at t = '//time_text(self%t)//' s: '//trouble(self))
            return
         end if
         self%counts%n_error_test_failures = self%counts%n_error_test_failures + 1
         self%n_steps = self%n_steps - 1
         rejected = .true.
         self%h = h*max(shrink, safety*norm**(-0.125_wp))
      end do
      if (self%system%has_quadratures()) then
         call control_quadratures(self, self%t, h, self%y)
         associate (last => self%system%n_controlled + 1)
            self%y_new(last:) = self%y(last:) + (self%increment(last:) - self%lost(last:))
            call self%system%note_quadratures(self%y_new(last:), self%quadrature_error)
         end associate
      end if
      call accept(self, h, t_new)
      if (self%system%n_events > 0) call look_for_event(self)
      if (self%n_grid > 0) return
      factor = grow
      if (norm > 0.0_wp) factor = min(grow, max(shrink, safety*norm**(-0.125_wp)))
      if (rejected) factor = min(1.0_wp, factor)
      ! A step cut short by the stop time says little about the next one.
      if (t_new < self%t_stop .or. h*factor > self%h) self%h = h*factor
      if (self%options%max_step > 0.0_wp) self%h = min(self%h, self%options%max_step)
   end subroutine step

   !> The step to try and the time it ends at: on the stop time if that is near, or on the grid of fixed steps.
   subroutine choose_end(self, h, t_new)
      class(dop853_integrator), intent(in) :: self
      real(wp), intent(out) :: h, t_new
      if (self%n_grid > 0) then
         t_new = self%t_first + (self%t_stop - self%t_first)*(real(self%i_grid + 1, wp)/real(self%n_grid, wp))
         if (self%i_grid + 1 == self%n_grid) t_new = self%t_stop
         h = t_new - self%t
         return
      end if
      h = self%h
      t_new = self%t + (h - self%t_lost)
      if (t_new < self%t_stop) then
         ! Two even steps rather than one and a sliver.
         if (self%t + 1.8_wp*h > self%t_stop) h = 0.5_wp*(self%t_stop - self%t)
         if (h < self%h) t_new = self%t + (h - self%t_lost)
      else
         t_new = self%t_stop
         h = self%t_stop - self%t
      end if
   end subroutine choose_end

   !> Make the new state the current one, with the digits that rounding took from it.
   subroutine accept(self, h, t_new)
      class(dop853_integrator), intent(inout) :: self
      real(wp), intent(in) :: h, t_new

      self%lost = (self%y_new - self%y) - (self%increment - self%lost)
      call swap(self%y_before, self%y)
      call swap(self%y, self%y_new)
      call swap(self%f_before, self%f)
      call swap(self%f, self%stage)
      self%t_before = self%t
      self%t_lost = (t_new - self%t) - (h - self%t_lost)
      if (t_new >= self%t_stop .or. self%n_grid > 0) self%t_lost = 0.0_wp
      self%t = t_new
      self%t_good = t_new
      self%i_grid = self%i_grid + 1
      self%counts%last_step = h
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

   !> What stands in the way of a step.
   function trouble(self) result(text)
      class(dop853_integrator), intent(in) :: self
      character(len=:), allocatable :: text
      if (self%refused) then
         text = 'the right-hand side could not be evaluated (mass matrix not positive definite, or not finite)'
      else
         text = 'the right-hand side was not finite, or no step is small enough'
      end if
   end function trouble

   !> Length of the first step (Hairer, Norsett & Wanner, sec. II.4).
   subroutine first_step(self, error)
      class(dop853_integrator), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: d0, d1, d2, h0, h1
      logical :: ok

      associate (n => self%system%n_controlled, span => self%t_stop - self%t)
         if (span <= 0.0_wp) return
         self%stage(:) = self%inner%atol + self%inner%rtol*abs(self%y)
         d0 = norm2(self%y(:n)/self%stage(:n))/sqrt(real(n, wp))
         d1 = norm2(self%f(:n)/self%stage(:n))/sqrt(real(n, wp))
         h0 = 1.0e-6_wp
         if (min(d0, d1) > 1.0e-5_wp) h0 = 0.01_wp*d0/d1
         h0 = min(h0, span)
         self%y_new(:) = self%y + h0*self%f
         call evaluate(self, self%t + h0, self%y_new, self%increment, ok)
         if (ok) then
            d2 = norm2((self%increment(:n) - self%f(:n))/self%stage(:n))/sqrt(real(n, wp))/h0
            if (max(d1, d2) <= 1.0e-15_wp) then
               h1 = max(1.0e-6_wp, 1.0e-3_wp*h0)
            else
               h1 = (0.01_wp/max(d1, d2))**0.125_wp
            end if
            self%h = min(100.0_wp*h0, h1, span)
         else
            self%h = 1.0e-3_wp*h0
         end if
         if (self%options%max_step > 0.0_wp) self%h = min(self%h, self%options%max_step)
         if (.not. self%h > 0.0_wp) call raise(error, 'dop853 at t = '//time_text(self%t)//' s: no first step found')
      end associate
   end subroutine first_step

   !> Counts over the whole run.
   function statistics(self) result(stats)
      class(dop853_integrator), intent(inout) :: self
      type(solver_statistics) :: stats
      stats = self%counts
      stats%n_steps = self%n_steps
      stats%n_starts = self%n_starts
   end function statistics

   !> Nothing is held outside Fortran.
   subroutine finalize(self)
      class(dop853_integrator), intent(inout) :: self
      nullify (self%system, self%monitor)
   end subroutine finalize

end module rodyn_dop853_integrator
