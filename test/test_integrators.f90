!> Tests of the integrators against systems with known solutions.
module test_integrators
   use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
   use rodyn_kinds, only: wp, i8
   use rodyn_errors, only: error_type, exit_stopped
   use rodyn_methods, only: method_words, table => methods
   use rodyn_text, only: time_text, word, word_count
   use rodyn_ode, only: ode_system
   use rodyn_integrator, only: integrator_type, solver_options, solver_statistics, monitor_type
   use rodyn_integrators, only: new_integrator, sundials_version
   use test_oscillators, only: oscillator, new_oscillator
   use test_testing, only: unittest, new_test, check, check_close
   implicit none (type, external)
   private
   public :: collect_integrators

   !> Robertson's kinetics: stiff, with a conserved sum.
   type, extends(ode_system) :: robertson
   contains
      procedure :: rhs => robertson_rhs
      procedure :: jacobian => robertson_jacobian
   end type robertson

   !> y' = y^2: infinite at t = 1/y(0).
   type, extends(ode_system) :: explosion
   contains
      procedure :: rhs => explosion_rhs
      procedure :: jacobian => explosion_jacobian
   end type explosion

   !> Asks to stop at the first look.
   type, extends(monitor_type) :: impatient
      integer :: n_reports = 0
      logical :: stop = .false.
   contains
      procedure :: report => count_report
      procedure :: stop_requested => wants_to_stop
   end type impatient

   real(wp), parameter :: pi = acos(-1.0_wp)
   character(len=6), parameter :: methods(4) = [character(len=6) :: 'adams', 'bdf', 'erk', 'dop853']

contains

   subroutine collect_integrators(suite)
      type(unittest), allocatable, intent(out) :: suite(:)
      suite = [ &
         new_test('every method follows a harmonic oscillator', harmonic), &
         new_test('errors of multistep methods stay below a tolerance a period', periods), &
         new_test('bdf solves robertson with few steps', stiff), &
         new_test('fixed steps show the order of every erk table and of dop853 to a tenth', observed_orders), &
         new_test('adaptive erk of every order meets its tolerance', adaptive_orders), &
         new_test('the number of outputs changes no bit of the final state', outputs_change_nothing), &
         new_test('outputs between steps are as accurate as steps', accurate_outputs), &
         new_test('quadrature states change no bit of a run', quadratures_change_nothing), &
         new_test('quadrature states are integrated', quadrature_value), &
         new_test('a switched force is followed with exact restarts', piecewise_force), &
         new_test('no right-hand side beyond a stop time', stop_never_crossed), &
         new_test('a restart repeats a run bit by bit', restart_exact), &
         new_test('statistics add up over restarts', statistics_add_up), &
         new_test('fixed steps land on every stop', fixed_steps_land), &
         new_test('max_steps ends a run over restarts', max_steps_reached), &
         new_test('max_step bounds the steps', max_step_bounds), &
         new_test('NaN from the right-hand side is an error', nan_rhs), &
         new_test('a refusing right-hand side is an error', refusing_rhs), &
         new_test('an explosion is an error with the last good time', exploding), &
         new_test('a monitor can stop a run', monitor_stops), &
         new_test('bad options are refused by name', bad_options), &
         new_test('each row of the table of methods has an integrator and keeps its word', table_of_methods), &
         new_test('an output beyond the stop time is refused', beyond_stop), &
         new_test('1000 lives leave no memory behind', no_heap_growth), &
         new_test('times in messages are short', short_times), &
         new_test('sundials tells its version', version_known)]
   end subroutine collect_integrators

   subroutine robertson_rhs(self, t, y, ydot, ok)
      class(robertson), intent(inout) :: self
      real(wp), intent(in) :: t
      real(wp), contiguous, intent(in) :: y(:)
      real(wp), contiguous, intent(out) :: ydot(:)
      logical, intent(out) :: ok
      ok = self%n_states == 3 .and. t < huge(t)
      ydot(1) = -0.04_wp*y(1) + 1.0e4_wp*y(2)*y(3)
      ydot(3) = 3.0e7_wp*y(2)**2
      ydot(2) = -ydot(1) - ydot(3)
   end subroutine robertson_rhs

   subroutine robertson_jacobian(self, t, y, jac, ok)
      class(robertson), intent(inout) :: self
      real(wp), intent(in) :: t
      real(wp), contiguous, intent(in) :: y(:)
      real(wp), contiguous, intent(out) :: jac(:, :)
      logical, intent(out) :: ok
      ok = self%n_states == 3 .and. t < huge(t)
      jac(1, :) = [-0.04_wp, 1.0e4_wp*y(3), 1.0e4_wp*y(2)]
      jac(3, :) = [0.0_wp, 6.0e7_wp*y(2), 0.0_wp]
      jac(2, :) = -jac(1, :) - jac(3, :)
   end subroutine robertson_jacobian

   subroutine explosion_rhs(self, t, y, ydot, ok)
      class(explosion), intent(inout) :: self
      real(wp), intent(in) :: t
      real(wp), contiguous, intent(in) :: y(:)
      real(wp), contiguous, intent(out) :: ydot(:)
      logical, intent(out) :: ok
      ok = self%n_states == 1 .and. t < huge(t) .and. abs(y(1)) < 1.0e100_wp
      ydot = 0.0_wp
      if (ok) ydot(1) = y(1)**2
   end subroutine explosion_rhs

   subroutine explosion_jacobian(self, t, y, jac, ok)
      class(explosion), intent(inout) :: self
      real(wp), intent(in) :: t
      real(wp), contiguous, intent(in) :: y(:)
      real(wp), contiguous, intent(out) :: jac(:, :)
      logical, intent(out) :: ok
      ok = self%n_states == 1 .and. t < huge(t) .and. abs(y(1)) < 1.0e100_wp
      jac = 2.0_wp*y(1)
   end subroutine explosion_jacobian

   subroutine count_report(self, t, n_steps)
      class(impatient), intent(inout) :: self
      real(wp), intent(in) :: t
      integer(i8), intent(in) :: n_steps
      if (t >= 0.0_wp .and. n_steps >= 0) self%n_reports = self%n_reports + 1
   end subroutine count_report

   function wants_to_stop(self) result(requested)
      class(impatient), intent(in) :: self
      logical :: requested
      requested = self%stop
   end function wants_to_stop

   !> A method at t = 0, on its way to the first stop.
   subroutine begin(integrator, system, method, options, t_stop, y, error)
      class(integrator_type), allocatable, intent(out) :: integrator
      class(ode_system), target, intent(inout) :: system
      character(len=*), intent(in) :: method
      type(solver_options), intent(in) :: options
      real(wp), intent(in) :: t_stop !! [s]
      real(wp), intent(in) :: y(:)   !! initial state
      type(error_type), allocatable, intent(out) :: error
      call new_integrator(integrator, system, method, options, error)
      if (allocated(error)) return
      call integrator%set_stop(t_stop)
      call integrator%start(0.0_wp, y, error)
   end subroutine begin

   !> Integrate from (0, y) to t_end with n_outputs equal intervals; y becomes the final state.
   subroutine run(system, method, options, t_end, n_outputs, y, stats, error)
      class(ode_system), target, intent(inout) :: system
      character(len=*), intent(in) :: method
      type(solver_options), intent(in) :: options
      real(wp), intent(in) :: t_end !! [s]
      integer, intent(in) :: n_outputs
      real(wp), contiguous, intent(inout) :: y(:)
      type(solver_statistics), intent(out) :: stats
      type(error_type), allocatable, intent(inout) :: error !! the first failure stays

      class(integrator_type), allocatable :: integrator
      real(wp) :: t_out, t
      integer :: i

      if (.not. allocated(error)) call begin(integrator, system, method, options, t_end, y, error)
      if (.not. allocated(integrator)) return
      do i = 1, n_outputs
         if (allocated(error)) exit
         t_out = t_end*(real(i, wp)/real(n_outputs, wp))
         if (i == n_outputs) t_out = t_end
         call integrator%advance(t_out, y, t, error)
      end do
      stats = integrator%statistics()
      call integrator%finalize()
   end subroutine run

   subroutine harmonic(error)
      type(error_type), allocatable, intent(out) :: error
      type(oscillator) :: system
      type(solver_options) :: options
      type(solver_statistics) :: stats
      real(wp) :: y(2)
      integer :: i

      options%rtol = 1.0e-10_wp
      options%atol = 1.0e-12_wp
      do i = 1, size(methods)
         system = new_oscillator(2.0_wp, .false.)
         y = [1.0_wp, 0.0_wp]
         call run(system, methods(i), options, 10.0_wp, 7, y, stats, error)
         call check_close(error, y, [cos(20.0_wp), -2.0_wp*sin(20.0_wp)], merge(1.0e-6_wp, 1.0e-7_wp, i == 2), methods(i))
         call check(error, stats%n_rhs == system%n_calls, methods(i)//': right-hand sides counted wrongly')
         call check(error, (stats%n_jac > 0) .eqv. (i == 2), methods(i)//': Jacobians counted wrongly')
         if (allocated(error)) return
      end do
   end subroutine harmonic

   !> 100 periods of an oscillator: each step meets its tolerance, and what it leaves adds up.
   subroutine periods(error)
      type(error_type), allocatable, intent(out) :: error
      type(oscillator) :: system
      type(solver_options) :: options
      type(solver_statistics) :: stats
      real(wp), parameter :: t_end = 200.0_wp*acos(-1.0_wp)
      real(wp) :: y(2)
      integer :: i, j

      do j = 5, 9, 2
         options%rtol = 10.0_wp**(-j)
         options%atol = 0.01_wp*options%rtol
         do i = 1, 2
            if (methods(i) == 'bdf' .and. j == 9) cycle ! it leaves 280
            system = new_oscillator(1.0_wp, .false.)
            y = [1.0_wp, 0.0_wp]
            call run(system, methods(i), options, t_end, 1, y, stats, error)
            call check_close(error, y, [1.0_wp, 0.0_wp], 100.0_wp*options%rtol, methods(i))
            if (allocated(error)) return
         end do
      end do
   end subroutine periods

   subroutine stiff(error)
      type(error_type), allocatable, intent(out) :: error
      type(robertson) :: system
      type(solver_options) :: options
      type(solver_statistics) :: stats
      real(wp) :: y(3)

      system%n_states = 3
      system%n_controlled = 3
      options%rtol = 1.0e-9_wp
      options%atol = 1.0e-14_wp
      y = [1.0_wp, 0.0_wp, 0.0_wp]
      call run(system, 'bdf', options, 40.0_wp, 1, y, stats, error)
      if (allocated(error)) return
      ! published reference at t = 40 (CVODE's Robertson example, and the literature)
      call check_close(error, y, [0.7158270687193_wp, 0.9185534764557e-5_wp, 0.2841637457458_wp], 1.0e-7_wp, 'robertson')
      call check(error, stats%n_steps < 2000, 'too many steps')
   end subroutine stiff

   !> Error of a fixed-step run of n steps over 3 s, which the step that is asked for does not divide.
   function fixed_step_error(method, order, n) result(deviation)
      character(len=*), intent(in) :: method
      integer, intent(in) :: order, n
      real(wp) :: deviation
      type(oscillator) :: system
      type(solver_options) :: options
      type(solver_statistics) :: stats
      type(error_type), allocatable :: error
      real(wp) :: y(2)
      real(wp), parameter :: t_end = 3.0_wp

      options%order = order
      options%fixed_step = t_end/(real(n, wp) - 0.4_wp)
      system = new_oscillator(1.0_wp, .false.)
      y = [1.0_wp, 0.0_wp]
      call run(system, method, options, t_end, 1, y, stats, error)
      deviation = norm2(y - [cos(t_end), -sin(t_end)])
      if (allocated(error) .or. stats%n_steps /= n) deviation = ieee_value(1.0_wp, ieee_quiet_nan)
   end function fixed_step_error

   !> Five halvings; from order 6 on, where they would end in rounding, five divisions by sqrt 2.
   subroutine observed_orders(error)
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: n_coarse(8) = [100, 60, 40, 12, 12, 8, 4, 4]
      integer, parameter :: orders(8) = [2, 3, 4, 5, 6, 7, 8, 8]
      integer, parameter :: points = 6
      real(wp) :: x(points), y(points), observed
      integer :: i, j, n
      character(len=80) :: text

      do i = 1, 8
         do j = 1, points
            n = nint(n_coarse(i)*merge(2.0_wp, sqrt(2.0_wp), orders(i) < 6)**(j - 1))
            x(j) = -log(real(n, wp))
            y(j) = log(fixed_step_error(trim(merge('dop853', 'erk   ', i == 8)), orders(i), n))
         end do
         x = x - sum(x)/points
         observed = sum(x*y)/sum(x**2)
         write (text, '("observed order of method ", i0, " of order ", i0)') i, orders(i)
         call check_close(error, observed, real(orders(i), wp), 0.1_wp, trim(text))
         if (allocated(error)) return
      end do
   end subroutine observed_orders

   subroutine adaptive_orders(error)
      type(error_type), allocatable, intent(out) :: error
      type(oscillator) :: system
      type(solver_options) :: options
      type(solver_statistics) :: stats
      real(wp) :: y(2)
      integer :: order

      options%rtol = 1.0e-8_wp
      options%atol = 1.0e-8_wp
      do order = 2, 8
         options%order = order
         system = new_oscillator(1.0_wp, .false.)
         y = [1.0_wp, 0.0_wp]
         call run(system, 'erk', options, 3.0_wp, 5, y, stats, error)
         call check_close(error, y, [cos(3.0_wp), -sin(3.0_wp)], 1.0e-5_wp, 'adaptive erk')
         call check(error, stats%last_order, order, 'order')
         if (allocated(error)) return
      end do
   end subroutine adaptive_orders

   subroutine outputs_change_nothing(error)
      type(error_type), allocatable, intent(out) :: error
      type(oscillator) :: system
      type(solver_options) :: options
      type(solver_statistics) :: few, many
      real(wp) :: y_few(2), y_many(2)
      integer :: i

      do i = 1, size(methods)
         system = new_oscillator(3.0_wp, .false.)
         y_few = [1.0_wp, 0.5_wp]
         call run(system, methods(i), options, 7.0_wp, 10, y_few, few, error)
         y_many = [1.0_wp, 0.5_wp]
         call run(system, methods(i), options, 7.0_wp, 1000, y_many, many, error)
         call check_close(error, y_many, y_few, 0.0_wp, methods(i))
         call check(error, few%n_steps == many%n_steps, methods(i)//': other steps')
         if (allocated(error)) return
      end do
   end subroutine outputs_change_nothing

   subroutine accurate_outputs(error)
      type(error_type), allocatable, intent(out) :: error
      type(oscillator), target :: system
      type(solver_options) :: options
      class(integrator_type), allocatable :: integrator
      real(wp) :: y(2), t, t_out
      integer :: i, k

      options%rtol = 1.0e-12_wp
      options%atol = 1.0e-13_wp
      do k = 1, 3, 2 ! adams and erk
         system = new_oscillator(1.0_wp, .false.)
         call begin(integrator, system, methods(k), options, 5.0_wp, [1.0_wp, 0.0_wp], error)
         do i = 1, 500
            if (allocated(error)) return
            t_out = 0.01_wp*real(i, wp)
            if (i == 500) t_out = 5.0_wp
            call integrator%advance(t_out, y, t, error)
            if (allocated(error)) return
            call check_close(error, y, [cos(t_out), -sin(t_out)], 2.0e-10_wp, methods(k)//' at t = '//time_text(t_out))
         end do
         if (allocated(error)) return
      end do
   end subroutine accurate_outputs

   subroutine quadratures_change_nothing(error)
      type(error_type), allocatable, intent(out) :: error
      type(oscillator) :: system
      type(solver_options) :: options
      type(solver_statistics) :: without, with
      real(wp) :: y_without(2), y_with(4)
      integer :: i

      do i = 1, size(methods)
         system = new_oscillator(3.0_wp, .false.)
         y_without = [1.0_wp, 0.5_wp]
         call run(system, methods(i), options, 7.0_wp, 3, y_without, without, error)
         system = new_oscillator(3.0_wp, .true.)
         y_with = [1.0_wp, 0.5_wp, 0.0_wp, 0.0_wp]
         call run(system, methods(i), options, 7.0_wp, 3, y_with, with, error)
         call check_close(error, y_with(:2), y_without, 0.0_wp, methods(i))
         call check(error, with%n_steps == without%n_steps, methods(i)//': other steps')
         if (allocated(error)) return
      end do
   end subroutine quadratures_change_nothing

   subroutine quadrature_value(error)
      type(error_type), allocatable, intent(out) :: error
      type(oscillator) :: system
      type(solver_options) :: options
      type(solver_statistics) :: stats
      real(wp) :: y(4)
      integer :: i

      options%rtol = 1.0e-10_wp
      options%atol = 1.0e-12_wp
      do i = 1, size(methods)
         system = new_oscillator(1.0_wp, .true.)
         y = [1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]
         call run(system, methods(i), options, pi, 3, y, stats, error)
         call check_close(error, y(3:), [0.5_wp*pi, -2.0_wp], 1.0e-7_wp, methods(i))
         if (allocated(error)) return
      end do
   end subroutine quadrature_value

   !> x'' = -x + 1 for t <= 1, then free: matched by its own solution.
   subroutine piecewise_force(error)
      type(error_type), allocatable, intent(out) :: error
      type(oscillator), target :: system
      type(solver_options) :: options
      class(integrator_type), allocatable :: integrator
      real(wp) :: y(2), t, x1, v1
      integer :: i

      options%rtol = 1.0e-11_wp
      options%atol = 1.0e-12_wp
      x1 = 1.0_wp - cos(1.0_wp)
      v1 = sin(1.0_wp)
      do i = 1, size(methods)
         system = new_oscillator(1.0_wp, .false.)
         system%force = 1.0_wp
         call begin(integrator, system, methods(i), options, 1.0_wp, [0.0_wp, 0.0_wp], error)
         if (allocated(error)) return
         call integrator%advance(1.0_wp, y, t, error)
         if (allocated(error)) return
         system%force = 0.0_wp
         call integrator%set_stop(3.0_wp)
         call integrator%start(1.0_wp, y, error)
         if (allocated(error)) return
         call integrator%advance(3.0_wp, y, t, error)
         if (allocated(error)) return
         call check_close(error, y, [x1*cos(2.0_wp) + v1*sin(2.0_wp), v1*cos(2.0_wp) - x1*sin(2.0_wp)], 2.0e-8_wp, methods(i))
         call check_close(error, t, 3.0_wp, 0.0_wp, 'time')
         if (allocated(error)) return
      end do
   end subroutine piecewise_force

   subroutine stop_never_crossed(error)
      type(error_type), allocatable, intent(out) :: error
      type(oscillator), target :: system
      type(solver_options) :: options
      class(integrator_type), allocatable :: integrator
      real(wp) :: y(2), t, t_stop
      integer :: i, k, step_kind

      do i = 1, size(methods)
         do step_kind = 1, merge(2, 1, i == 3)
            options%fixed_step = merge(0.037_wp, 0.0_wp, step_kind == 2)
            system = new_oscillator(1.0_wp, .false.)
            call new_integrator(integrator, system, methods(i), options, error)
            if (allocated(error)) return
            y = [1.0_wp, 0.0_wp]
            t = 0.0_wp
            do k = 1, 40
               t_stop = 0.1_wp*real(k, wp)
               call integrator%set_stop(t_stop)
               if (mod(k, 2) == 1) call integrator%start(t, y, error) ! every second stop is passed without a restart
               if (allocated(error)) return
               call integrator%advance(t_stop - 0.05_wp, y, t, error)
               if (allocated(error)) return
               call integrator%advance(t_stop, y, t, error)
               if (allocated(error)) return
               call check(error, system%t_largest <= t_stop, methods(i)//': called beyond t = '//time_text(t_stop))
               call check_close(error, t, t_stop, 0.0_wp, 'stop not hit')
               if (allocated(error)) return
            end do
            call check_close(error, y, [cos(t), -sin(t)], 1.0e-6_wp, methods(i))
            if (allocated(error)) return
         end do
      end do
   end subroutine stop_never_crossed

   subroutine restart_exact(error)
      type(error_type), allocatable, intent(out) :: error
      type(oscillator), target :: system
      type(solver_options) :: options
      class(integrator_type), allocatable :: integrator
      real(wp) :: first(2), second(2), t
      integer :: i

      do i = 1, size(methods)
         system = new_oscillator(2.0_wp, .false.)
         call begin(integrator, system, methods(i), options, 2.0_wp, [1.0_wp, 0.0_wp], error)
         if (allocated(error)) return
         call integrator%advance(2.0_wp, first, t, error)
         if (allocated(error)) return
         call integrator%start(0.0_wp, [1.0_wp, 0.0_wp], error)
         if (allocated(error)) return
         call integrator%advance(1.0_wp, second, t, error)
         if (allocated(error)) return
         call integrator%advance(2.0_wp, second, t, error)
         if (allocated(error)) return
         call check_close(error, second, first, 0.0_wp, methods(i))
         if (allocated(error)) return
      end do
   end subroutine restart_exact

   subroutine statistics_add_up(error)
      type(error_type), allocatable, intent(out) :: error
      type(oscillator), target :: system
      type(solver_options) :: options
      class(integrator_type), allocatable :: integrator
      type(solver_statistics) :: once, twice
      real(wp) :: y(2), t
      integer :: i

      do i = 1, size(methods)
         system = new_oscillator(2.0_wp, .false.)
         call begin(integrator, system, methods(i), options, 2.0_wp, [1.0_wp, 0.0_wp], error)
         if (allocated(error)) return
         call integrator%advance(2.0_wp, y, t, error)
         if (allocated(error)) return
         once = integrator%statistics()
         call integrator%start(0.0_wp, [1.0_wp, 0.0_wp], error)
         if (allocated(error)) return
         call integrator%advance(2.0_wp, y, t, error)
         if (allocated(error)) return
         twice = integrator%statistics()
         call check(error, twice%n_steps == 2*once%n_steps .and. twice%n_rhs == 2*once%n_rhs &
            .and. twice%n_jac == 2*once%n_jac .and. twice%n_error_test_failures == 2*once%n_error_test_failures &
            .and. twice%n_nonlinear_failures == 2*once%n_nonlinear_failures .and. twice%n_starts == 2, methods(i))
         call check(error, once%n_steps > 0 .and. once%last_step > 0.0_wp .and. once%last_order > 0, 'empty statistics')
         if (allocated(error)) return
      end do
   end subroutine statistics_add_up

   subroutine fixed_steps_land(error)
      type(error_type), allocatable, intent(out) :: error
      type(oscillator) :: system
      type(solver_options) :: options
      type(solver_statistics) :: stats
      real(wp) :: y(2)

      options%fixed_step = 1.0e-4_wp
      options%order = 4
      system = new_oscillator(1.0_wp, .false.)
      y = [1.0_wp, 0.0_wp]
      call run(system, 'erk', options, 10.0_wp, 3, y, stats, error)
      call check(error, stats%n_steps == 100000, 'steps')
      call check_close(error, y, [cos(10.0_wp), -sin(10.0_wp)], 1.0e-12_wp, 'state')
   end subroutine fixed_steps_land

   subroutine max_steps_reached(error)
      type(error_type), allocatable, intent(out) :: error
      type(oscillator), target :: system
      type(solver_options) :: options
      class(integrator_type), allocatable :: integrator
      type(error_type), allocatable :: failure
      real(wp) :: y(2), t, t_first
      integer :: i

      options%max_steps = 150
      options%rtol = 1.0e-12_wp
      options%atol = 1.0e-13_wp
      do i = 1, size(methods)
         system = new_oscillator(1.0_wp, .false.)
         call new_integrator(integrator, system, methods(i), options, error)
         if (allocated(error)) return
         t = 0.0_wp
         y = [1.0_wp, 0.0_wp]
         do ! many short intervals
            t_first = t
            call integrator%set_stop(t_first + 0.2_wp)
            call integrator%start(t_first, y, error)
            if (allocated(error)) return
            call integrator%advance(t_first + 0.2_wp, y, t, failure)
            if (allocated(failure)) exit
         end do
         call check(error, failure%message, 'max_steps = 150 reached at t = '//time_text(t)//' s', methods(i))
         call check_close(error, y, [cos(t), -sin(t)], 1.0e-7_wp, methods(i)//' last good state')
         call check(error, t >= t_first .and. t < t_first + 0.2_wp, 'last good time')
         if (allocated(error)) return
         deallocate (failure)
      end do
   end subroutine max_steps_reached

   subroutine max_step_bounds(error)
      type(error_type), allocatable, intent(out) :: error
      type(oscillator) :: system
      type(solver_options) :: options
      type(solver_statistics) :: stats
      real(wp) :: y(2)
      integer :: i

      options%max_step = 1.0e-3_wp
      do i = 1, size(methods)
         system = new_oscillator(1.0_wp, .false.)
         y = [1.0_wp, 0.0_wp]
         call run(system, methods(i), options, 1.0_wp, 1, y, stats, error)
         call check(error, stats%n_steps >= 1000, methods(i)//': fewer steps than max_step allows')
         if (allocated(error)) return
      end do
   end subroutine max_step_bounds

   !> Advance an oscillator that breaks at t = 1, and see what is left.
   subroutine break_at_one(t_refuse, t_nan, words, error)
      real(wp), intent(in) :: t_refuse, t_nan
      character(len=*), intent(in) :: words !! to be found in the message
      type(error_type), allocatable, intent(out) :: error

      type(oscillator), target :: system
      type(solver_options) :: options
      class(integrator_type), allocatable :: integrator
      type(error_type), allocatable :: failure
      character(len=5), parameter :: calls(4) = [character(len=5) :: 'CVode', 'CVode', 'ERKSt', 'dop85']
      real(wp) :: y(2), t
      integer :: i

      do i = 1, size(methods)
         system = new_oscillator(1.0_wp, .false.)
         system%t_refuse = t_refuse
         system%t_nan = t_nan
         call begin(integrator, system, methods(i), options, 2.0_wp, [1.0_wp, 0.0_wp], error)
         if (allocated(error)) return
         call integrator%advance(2.0_wp, y, t, failure)
         call check(error, allocated(failure), methods(i)//': no failure')
         if (allocated(error)) return
         call check(error, index(failure%message, trim(calls(i))) == 1 .and. index(failure%message, words) > 0, failure%message)
         call check(error, index(failure%message, 'at t = '//time_text(t)//' s') > 0, failure%message)
         call check(error, t < 1.0_wp .and. t > 0.2_wp, 'last good time '//time_text(t))
         call check_close(error, y, [cos(t), -sin(t)], 1.0e-6_wp, methods(i)//' last good state')
         if (allocated(error)) return
      end do
   end subroutine break_at_one

   subroutine nan_rhs(error)
      type(error_type), allocatable, intent(out) :: error
      call break_at_one(huge(1.0_wp), 1.0_wp, 'was not finite', error)
   end subroutine nan_rhs

   subroutine refusing_rhs(error)
      type(error_type), allocatable, intent(out) :: error
      call break_at_one(1.0_wp, huge(1.0_wp), 'could not be evaluated', error)
   end subroutine refusing_rhs

   subroutine exploding(error)
      type(error_type), allocatable, intent(out) :: error
      type(explosion), target :: system
      type(solver_options) :: options
      class(integrator_type), allocatable :: integrator
      type(error_type), allocatable :: failure
      real(wp) :: y(1), t
      integer :: i

      options%max_steps = 20000
      system%n_states = 1
      system%n_controlled = 1
      do i = 1, size(methods)
         call begin(integrator, system, methods(i), options, 2.0_wp, [1.0_wp], error)
         if (allocated(error)) return
         call integrator%advance(2.0_wp, y, t, failure)
         call check(error, allocated(failure), methods(i)//': no failure')
         if (allocated(error)) return
         call check(error, t < 1.001_wp .and. t > 0.99_wp .and. abs(y(1)) <= huge(1.0_wp), methods(i)//': '//failure%message)
         if (allocated(error)) return
      end do
   end subroutine exploding

   subroutine monitor_stops(error)
      type(error_type), allocatable, intent(out) :: error
      type(oscillator), target :: system
      type(impatient), target :: monitor
      type(solver_options) :: options
      class(integrator_type), allocatable :: integrator
      type(error_type), allocatable :: failure
      real(wp) :: y(2), t
      integer :: i

      do i = 1, size(methods)
         system = new_oscillator(1.0_wp, .false.)
         call new_integrator(integrator, system, methods(i), options, error)
         if (allocated(error)) return
         monitor%stop = .false.
         monitor%n_reports = 0
         call integrator%set_monitor(monitor)
         call integrator%set_stop(100.0_wp)
         call integrator%start(0.0_wp, [1.0_wp, 0.0_wp], error)
         if (allocated(error)) return
         call integrator%advance(1.0_wp, y, t, error)
         if (allocated(error)) return
         call check(error, monitor%n_reports > 0, methods(i)//': no report')
         if (allocated(error)) return
         monitor%stop = .true.
         call integrator%advance(100.0_wp, y, t, failure)
         call check(error, allocated(failure), methods(i)//': not stopped')
         if (allocated(error)) return
         call check(error, failure%exit_code, exit_stopped, 'exit code')
         call check_close(error, y, [cos(t), -sin(t)], 1.0e-5_wp, methods(i)//' last good state')
         if (allocated(error)) return
      end do
   end subroutine monitor_stops

   !> True if `new_integrator` refuses with a message that begins with `word`.
   function refused(method, options, word) result(yes)
      character(len=*), intent(in) :: method, word
      type(solver_options), intent(in) :: options
      logical :: yes
      type(oscillator), target :: system
      class(integrator_type), allocatable :: integrator
      type(error_type), allocatable :: failure

      system = new_oscillator(1.0_wp, .false.)
      call new_integrator(integrator, system, method, options, failure)
      yes = .false.
      if (allocated(failure)) yes = index(failure%message, word) == 1
      if (allocated(integrator)) call integrator%finalize()
   end function refused

   subroutine bad_options(error)
      type(error_type), allocatable, intent(out) :: error
      call check(error, refused('adams', solver_options(order=13), 'order'), 'adams of order 13')
      call check(error, refused('bdf', solver_options(order=6), 'order'), 'bdf of order 6')
      call check(error, refused('erk', solver_options(order=9), 'order'), 'erk of order 9')
      call check(error, refused('bdf', solver_options(fixed_step=0.1_wp), 'fixed_step'), 'bdf with a fixed step')
      call check(error, refused('adams', solver_options(rtol=0.0_wp), 'rtol'), 'no tolerance')
      call check(error, refused('euler', solver_options(), 'no integrator'), 'unknown method')
   end subroutine bad_options

   !> Each row of the table of methods has an integrator, takes its own orders and no others, and its name is a word of the key.
   subroutine table_of_methods(error)
      type(error_type), allocatable, intent(out) :: error
      integer :: i

      call check(error, word_count(method_words), size(table), 'words')
      do i = 1, size(table)
         associate (row => table(i))
            if (.not. allocated(error)) call check(error, word(method_words, i), trim(row%name), 'word')
            if (.not. allocated(error)) call check(error, .not. refused(row%name, solver_options(order=row%lowest_order), 'order') &
               .and. .not. refused(row%name, solver_options(order=row%highest_order), 'order') &
               .and. .not. refused(row%name, solver_options(), 'no integrator'), row%name//' is refused')
            if (.not. allocated(error)) call check(error, refused(row%name, solver_options(order=row%highest_order + 1), 'order') &
               .and. (row%lowest_order == 1 .or. refused(row%name, solver_options(order=row%lowest_order - 1), 'order')) &
               .and. (row%fixed_steps .neqv. refused(row%name, solver_options(fixed_step=0.1_wp), 'fixed_step')), &
               row%name//' takes what it cannot do')
         end associate
      end do
   end subroutine table_of_methods

   subroutine beyond_stop(error)
      type(error_type), allocatable, intent(out) :: error
      type(oscillator), target :: system
      class(integrator_type), allocatable :: integrator
      type(error_type), allocatable :: failure
      real(wp) :: y(2), t
      integer :: i

      do i = 1, size(methods)
         system = new_oscillator(1.0_wp, .false.)
         call begin(integrator, system, methods(i), solver_options(), 1.0_wp, [1.0_wp, 0.0_wp], error)
         if (allocated(error)) return
         call integrator%advance(1.5_wp, y, t, failure)
         call check(error, allocated(failure), methods(i)//': accepted')
         if (allocated(error)) return
      end do
   end subroutine beyond_stop

   !> Pages in memory now, from /proc; 0 where there is none.
   function resident_pages() result(pages)
      integer(i8) :: pages
      integer(i8) :: total
      integer :: unit, status
      pages = 0
      open (newunit=unit, file='/proc/self/statm', action='read', status='old', iostat=status)
      if (status /= 0) return
      read (unit, *, iostat=status) total, pages
      if (status /= 0) pages = 0
      close (unit)
   end function resident_pages

   subroutine no_heap_growth(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: failure
      type(oscillator) :: system
      type(solver_statistics) :: stats
      type(solver_options) :: options
      integer(i8) :: before
      real(wp) :: y(4)
      integer :: i, k
      integer(i8), parameter :: allowed_pages = 16

      options%max_steps = 20
      before = 0
      do k = 1, 1100
         if (k == 100) before = resident_pages()
         i = 1 + mod(k, size(methods))
         system = new_oscillator(1.0_wp, .true.)
         system%t_nan = 0.05_wp ! the failure path allocates a message
         y = [1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]
         call run(system, methods(i), options, 10.0_wp, 1, y, stats, failure)
         call check(error, allocated(failure), 'no failure')
         if (allocated(error)) return
         deallocate (failure)
      end do
      call check(error, resident_pages() - before < allowed_pages, 'the heap has grown')
   end subroutine no_heap_growth

   subroutine short_times(error)
      type(error_type), allocatable, intent(out) :: error
      call check(error, time_text(0.123_wp), '0.123', 'time')
      call check(error, time_text(-0.5_wp), '-0.5', 'time')
      call check(error, time_text(240.0_wp), '240', 'time')
      call check(error, time_text(0.0_wp), '0', 'time')
      call check(error, time_text(1.5e-9_wp), '1.5E-09', 'time')
   end subroutine short_times

   subroutine version_known(error)
      type(error_type), allocatable, intent(out) :: error
      call check(error, scan(sundials_version(), '0123456789') == 1, sundials_version())
   end subroutine version_known

end module test_integrators
