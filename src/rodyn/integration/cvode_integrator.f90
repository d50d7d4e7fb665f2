!> CVODE: variable-order Adams (fixed-point iteration) and BDF (Newton with the exact Jacobian, whose systems the
!> system of equations solves itself).
!>
!> Steps are taken one at a time towards the stop time; outputs are interpolated by CVODE's own polynomial, so
!> neither their number nor their times change a step. Events are sought on the same polynomial (`rodyn_event_search`);
!> CVODE's own rootfinding compares the ends of steps alone.
!>
!> Tolerances are those of a step, and errors of these methods have the same sign from one period of a vibration to the next: they
!> add up, to hundreds and thousands of tolerances where one-step methods leave tens. So CVODE is given smaller ones (`stricter`).
module rodyn_cvode_integrator
   use, intrinsic :: iso_c_binding, only: c_ptr, c_int, c_long, c_double, c_null_ptr, c_associated, c_loc, c_funloc
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type, raise
   use rodyn_methods, only: method_named, method_type
   use rodyn_text, only: time_text
   use rodyn_ode, only: ode_system, n_quadratures
   use rodyn_integrator, only: integrator_type, solver_options, solver_statistics, stricter
   use rodyn_event_search, only: find_event
   use rodyn_quadrature_history, only: quadrature_history
   use rodyn_nvector, only: new_nvector, free_nvector, vector_content, content_of
   use rodyn_newton_solver, only: new_newton_matrix, new_newton_solver, linear_system_shim
   use rodyn_sundials_base, only: callback_data, rhs_shim, weights_shim, quiet_handler, all_finite, raise_return_code
   use fsundials_context_mod, only: FSUNContext_Create, FSUNContext_Free
   use fsundials_nvector_mod, only: N_Vector
   use fsundials_matrix_mod, only: SUNMatrix, FSUNMatDestroy
   use fsundials_linearsolver_mod, only: SUNLinearSolver, FSUNLinSolFree
   use fsundials_nonlinearsolver_mod, only: SUNNonlinearSolver, FSUNNonlinSolFree
   use fsunnonlinsol_fixedpoint_mod, only: FSUNNonlinSol_FixedPoint
   use fcvode_mod, only: CV_ADAMS, CV_BDF, CV_SUCCESS, CV_TSTOP_RETURN, CV_ONE_STEP, FCVodeCreate, FCVodeInit, FCVodeReInit, &
      FCVodeFree, FCVode, FCVodeGetDky, FCVodeSetUserData, FCVodeWFtolerances, FCVodeSetErrHandlerFn, FCVodeSetMaxOrd, &
      FCVodeSetMaxStep, FCVodeSetStopTime, FCVodeSetStabLimDet, FCVodeSetNonlinearSolver, FCVodeSetLinearSolver, &
      FCVodeSetLinSysFn, FCVodeGetNumErrTestFails, FCVodeGetNumNonlinSolvConvFails, FCVodeGetLastOrder, FCVodeGetLastStep, &
      FCVodeGetNumJacEvals
   implicit none (type, external)
   private
   public :: cvode_integrator, new_cvode_integrator

   !> Owns every handle of CVODE. Do not copy by assignment.
   type, extends(integrator_type) :: cvode_integrator
      private
      integer(c_int) :: multistep = CV_ADAMS
      logical :: initialized = .false.
      real(wp) :: stop_in_force = -huge(1.0_wp) !! the stop time CVODE knows [s]
      type(c_ptr) :: context = c_null_ptr
      type(c_ptr) :: memory = c_null_ptr
      type(N_Vector), pointer :: state => null()
      type(SUNMatrix), pointer :: matrix => null()
      type(SUNLinearSolver), pointer :: linear => null()
      type(SUNNonlinearSolver), pointer :: nonlinear => null()
      type(callback_data), pointer :: data => null()
      real(wp), allocatable, dimension(:) :: y_before, y_step, f_before, f_step, y_event !! for events: states and rates at both
                                                                                         !! ends of the step; workspace
      type(solver_statistics) :: before_restart !! counts up to the last restart, which resets CVODE's
      real(wp) :: t_before = 0.0_wp                       !! start of the last internal step [s]
      real(wp), dimension(n_quadratures) :: sums_before = 0.0_wp !! quadratures there
      real(wp), dimension(n_quadratures) :: rate_before = 0.0_wp, rate = 0.0_wp !! and their rates, there and at its end
      type(quadrature_history) :: history                 !! rates in the last steps
   contains
      procedure :: start
      procedure :: advance
      procedure :: state_within
      procedure :: statistics
      procedure :: finalize
      final :: finalize_handles
   end type cvode_integrator

   interface
      !> The caller frees the text; the Fortran interface of SUNDIALS would lose it.
      function flag_name(flag) result(text) bind(c, name='CVodeGetReturnFlagName')
         import :: c_ptr, c_long
         implicit none (type, external)
         integer(c_long), intent(in), value :: flag
         type(c_ptr) :: text
      end function flag_name
   end interface

contains

   !> Create an integrator for `system`, which must outlive it.
   subroutine new_cvode_integrator(self, system, method, options, error)
      type(cvode_integrator), intent(out) :: self
      class(ode_system), target, intent(inout) :: system
      character(len=*), intent(in) :: method !! 'adams' or 'bdf'
      type(solver_options), intent(in) :: options
      type(error_type), allocatable, intent(out) :: error
      type(solver_options) :: inner

      if (method /= 'adams' .and. method /= 'bdf') then
         call raise(error, 'method '''//method//''' is not one of CVODE''s: ''adams'' or ''bdf''')
         return
      end if

      self%system => system
      self%options = options
      self%multistep = merge(CV_ADAMS, CV_BDF, method == 'adams')
      allocate (self%data)
      self%data%system => system
      inner = inner_options(method, options)
      self%data%rtol = inner%rtol
      self%data%atol = inner%atol
      call check(error, FSUNContext_Create(c_null_ptr, self%context), 'SUNContext_Create')
      if (allocated(error)) return
      self%state => new_nvector(system%n_controlled, system%n_controlled, self%context)
      self%memory = FCVodeCreate(self%multistep, self%context)
      if (.not. (associated(self%state) .and. c_associated(self%memory))) call raise(error, 'CVodeCreate: out of memory')
   end subroutine new_cvode_integrator

   !> What CVODE is given. `bdf` of orders 1 and 2 is of use only where vibrations are calm, and needs less.
   pure type(solver_options) function inner_options(method, options)
      character(len=*), intent(in) :: method
      type(solver_options), intent(in) :: options
      type(method_type) :: row
      real(wp) :: shorter
      integer :: order

      order = options%order
      row = method_named(method)
      if (order == 0) order = row%highest_order
      if (method == 'adams') then
         shorter = 0.73_wp
      else
         shorter = merge(0.335_wp, 0.52_wp, order > 2)
      end if
      inner_options = stricter(options, shorter, order + 1)
   end function inner_options

   !> First start, or exact restart: order one, no history.
   subroutine start(self, t, y, error)
      class(cvode_integrator), intent(inout) :: self
      real(wp), intent(in) :: t    !! [s]
      real(wp), intent(in) :: y(:) !! (n_states)
      type(error_type), allocatable, intent(out) :: error

      type(vector_content), pointer :: content

      call self%begin_interval(t, y, error)
      if (allocated(error)) return
      content => content_of(self%state)
      content%values(:) = y(:self%system%n_controlled)
      if (self%system%has_quadratures()) then
         call rates_of_quadratures(self, t, content%values, self%rate, error)
         if (allocated(error)) return
         call self%history%begin(t, self%rate)
      end if
      if (self%initialized) then
         self%before_restart = self%statistics()
         call check(error, FCVodeReInit(self%memory, t, self%state), 'CVodeReInit', t)
      else
         call initialize(self, t, error)
         self%initialized = .not. allocated(error)
      end if
      self%stop_in_force = -huge(1.0_wp)
   end subroutine start

   !> Hand everything over to CVODE, once.
   subroutine initialize(self, t, error)
      class(cvode_integrator), intent(inout) :: self
      real(wp), intent(in) :: t !! [s]
      type(error_type), allocatable, intent(out) :: error

      call check(error, FCVodeSetErrHandlerFn(self%memory, c_funloc(quiet_handler), c_null_ptr), 'CVodeSetErrHandlerFn')
      if (allocated(error)) return
      call check(error, FCVodeInit(self%memory, c_funloc(rhs_shim), t, self%state), 'CVodeInit', t)
      if (allocated(error)) return
      call check(error, FCVodeSetUserData(self%memory, c_loc(self%data)), 'CVodeSetUserData')
      if (allocated(error)) return
      call check(error, FCVodeWFtolerances(self%memory, c_funloc(weights_shim)), 'CVodeWFtolerances')
      if (allocated(error)) return
      if (self%options%order > 0) then
         call check(error, FCVodeSetMaxOrd(self%memory, int(self%options%order, c_int)), 'CVodeSetMaxOrd')
         if (allocated(error)) return
      end if
      if (self%options%max_step > 0.0_wp) then
         call check(error, FCVodeSetMaxStep(self%memory, self%options%max_step), 'CVodeSetMaxStep')
         if (allocated(error)) return
      end if
      associate (n => merge(self%system%n_controlled, 0, self%system%n_events > 0))
         allocate (self%y_before(n), self%y_step(n), self%f_before(n), self%f_step(n), self%y_event(n))
      end associate
      if (self%multistep == CV_ADAMS) then
         call attach_fixed_point(self, error)
      else
         call attach_newton(self, error)
      end if
   end subroutine initialize

   !> Adams: functional iteration y <- g(y), no acceleration (m = 0): the iteration converges in one or two passes.
   subroutine attach_fixed_point(self, error)
      class(cvode_integrator), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error

      self%nonlinear => FSUNNonlinSol_FixedPoint(self%state, 0_c_int, self%context)
      if (.not. associated(self%nonlinear)) then
         call raise(error, 'SUNNonlinSol_FixedPoint: out of memory')
         return
      end if
      call check(error, FCVodeSetNonlinearSolver(self%memory, self%nonlinear), 'CVodeSetNonlinearSolver')
   end subroutine attach_fixed_point

   !> BDF: CVODE's own Newton iteration on the system's linear solver.
   subroutine attach_newton(self, error)
      class(cvode_integrator), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error

      self%matrix => new_newton_matrix(self%context)
      if (associated(self%matrix)) self%linear => new_newton_solver(self%data, self%context)
      if (.not. associated(self%linear)) then
         call raise(error, 'SUNLinSolNewEmpty: out of memory')
         return
      end if
      call check(error, FCVodeSetLinearSolver(self%memory, self%linear, self%matrix), 'CVodeSetLinearSolver')
      if (allocated(error)) return
      call check(error, FCVodeSetLinSysFn(self%memory, c_funloc(linear_system_shim)), 'CVodeSetLinSysFn')
      if (allocated(error)) return
      call check(error, FCVodeSetStabLimDet(self%memory, 1_c_int), 'CVodeSetStabLimDet')
   end subroutine attach_newton

   !> Step past t_out, but never past the stop time, then interpolate.
   subroutine advance(self, t_out, y, t, error)
      class(cvode_integrator), intent(inout) :: self
      real(wp), intent(in) :: t_out !! [s]
      real(wp), contiguous, intent(out) :: y(:) !! (n_states)
      real(wp), intent(out) :: t    !! [s]
      type(error_type), allocatable, intent(out) :: error

      type(vector_content), pointer :: content

      call self%check_target(t_out, error)
      do while (.not. allocated(error) .and. self%t_good < t_out .and. .not. self%pending)
         call self%permit_step(error)
         if (.not. allocated(error)) call one_step(self, error)
      end do
      self%at_event = self%pending .and. self%t_good <= t_out
      content => content_of(self%state)
      if (.not. allocated(error) .and. t_out < self%t_good) then
         call check(error, FCVodeGetDky(self%memory, t_out, 0_c_int, self%state), 'CVodeGetDky', t_out)
         if (.not. allocated(error)) then
            y(:self%system%n_controlled) = content%values
            t = t_out
            if (self%system%has_quadratures()) call quadratures_within(self, t_out, y, error)
            if (.not. allocated(error)) return
         end if
      end if
      y(:) = self%y_good
      t = self%t_good
   end subroutine advance

   !> One internal step of CVODE.
   subroutine one_step(self, error)
      class(cvode_integrator), intent(inout) :: self
      type(error_type), allocatable, intent(inout) :: error

      type(vector_content), pointer :: content
      real(c_double) :: t_reached(1)
      integer(c_int) :: flag

      if (self%stop_in_force < self%t_stop .or. self%stop_in_force > self%t_stop) then
         call check(error, FCVodeSetStopTime(self%memory, self%t_stop), 'CVodeSetStopTime', self%t_good)
         if (allocated(error)) return
         self%stop_in_force = self%t_stop
      end if
      flag = FCVode(self%memory, self%t_stop, self%state, t_reached, CV_ONE_STEP)
      if (flag /= CV_SUCCESS .and. flag /= CV_TSTOP_RETURN) then
         self%n_steps = self%n_steps - 1
         call check(error, flag, 'CVode', self%t_good)
         call name_cause(self, error)
         return
      end if
      content => content_of(self%state)
      if (.not. all_finite(content%values)) then
         self%n_steps = self%n_steps - 1
         call raise(error, 'CVode at t = '//time_text(self%t_good)//' s: the state is not finite after the next step')
         return
      end if
      if (.not. t_reached(1) > self%t_good) then
         self%n_steps = self%n_steps - 1
         call raise(error, 'CVode at t = '//time_text(self%t_good)//' s: the step has become too small to advance')
         call name_cause(self, error)
         return
      end if
      self%t_before = self%t_good
      if (self%system%n_events > 0) self%y_before(:) = self%y_good(:self%system%n_controlled)
      self%t_good = t_reached(1)
      self%y_good(:self%system%n_controlled) = content%values
      if (self%system%n_events > 0) call look_for_event(self, error)
      if (allocated(error)) return
      if (self%system%has_quadratures()) call add_quadratures(self, error)
   end subroutine one_step

   !> Quadratures at the end of the step that CVODE has made. They are no states of CVODE's: its iterations and its error test
   !> do not look at them. They are integrals over its polynomial: by the rates in the last steps where these are smooth, which
   !> takes two of them a step, else by as many as they need.
   subroutine add_quadratures(self, error)
      class(cvode_integrator), intent(inout) :: self
      type(error_type), allocatable, intent(inout) :: error
      real(wp), dimension(n_quadratures) :: middle, increment, off, values
      real(wp) :: t_middle, tolerance
      logical :: ok

      associate (n => self%system%n_controlled)
         self%sums_before = self%y_good(n + 1:)
         self%rate_before = self%rate
         t_middle = self%t_before + 0.5_wp*(self%t_good - self%t_before)
         call rates_of_quadratures(self, self%t_good, self%y_good(:n), self%rate, error)
         if (.not. allocated(error)) call rates_within(self, t_middle, middle, error)
         if (allocated(error)) return
         call self%history%add(t_middle, middle, self%t_good, self%rate)
         tolerance = self%system%quadrature_tolerance(self%options%rtol, self%options%atol, self%sums_before)
         call self%history%integrate(tolerance, increment, off, ok)
         if (.not. ok) call integrate_quadratures(self, self%t_good, self%rate, increment, off, error)
         if (allocated(error)) return
         values = self%sums_before + increment
         self%y_good(n + 1:) = values
         call self%system%note_quadratures(values, off)
      end associate
   end subroutine add_quadratures

   !> Rates of the quadratures on CVODE's polynomial of the last step.
   subroutine rates_within(self, t, rate, error)
      class(cvode_integrator), intent(inout) :: self
      real(wp), intent(in) :: t !! [s]
      real(wp), intent(out) :: rate(n_quadratures)
      type(error_type), allocatable, intent(inout) :: error
      type(vector_content), pointer :: content

      content => content_of(self%state)
      call check(error, FCVodeGetDky(self%memory, t, 0_c_int, self%state), 'CVodeGetDky', t)
      if (.not. allocated(error)) call rates_of_quadratures(self, t, content%values, rate, error)
   end subroutine rates_within

   !> Quadratures at an output inside the last step.
   subroutine quadratures_within(self, t, y, error)
      class(cvode_integrator), intent(inout) :: self
      real(wp), intent(in) :: t !! [s]
      real(wp), contiguous, intent(inout) :: y(:)
      type(error_type), allocatable, intent(inout) :: error
      real(wp), dimension(n_quadratures) :: rate, increment, off

      associate (n => self%system%n_controlled)
         call rates_of_quadratures(self, t, y(:n), rate, error)
         if (.not. allocated(error)) call integrate_quadratures(self, t, rate, increment, off, error)
         if (.not. allocated(error)) y(n + 1:) = self%sums_before + increment
      end associate
   end subroutine quadratures_within

   !> Integral of the rates of the quadratures from the start of the last step: a panel that is too long for them is halved, but
   !> not without end: rates of a chain at rest are rounding alone, which no panel is short enough for.
   subroutine integrate_quadratures(self, t_end, rate_end, total, total_off, error)
      class(cvode_integrator), intent(inout) :: self
      real(wp), intent(in) :: t_end       !! [s]
      real(wp), intent(in) :: rate_end(n_quadratures) !! there
      real(wp), dimension(n_quadratures), intent(out) :: total, total_off !! and the estimated error
      type(error_type), allocatable, intent(inout) :: error
      integer, parameter :: deepest = 20, most = 100 !! halvings; panels
      real(wp) :: ends(0:deepest), rates(n_quadratures, 0:deepest) ! of panels that wait
      real(wp), dimension(n_quadratures) :: first, middle, part, off
      real(wp) :: t, tolerance
      integer :: depth, panels

      depth = 0
      panels = 0
      t = self%t_before
      first = self%rate_before
      ends(0) = t_end
      rates(:, 0) = rate_end
      total = 0.0_wp
      total_off = 0.0_wp
      do while (depth >= 0)
         call integrate_panel(self, t, ends(depth), first, rates(:, depth), part, middle, off, error)
         if (allocated(error)) return
         panels = panels + 1
         associate (options => self%options)
            tolerance = max(self%system%quadrature_tolerance(options%rtol, options%atol, self%sums_before + total + part), &
                            8.0_wp*epsilon(1.0_wp)*(t_end - self%t_before)*maxval(abs(middle)))
         end associate
         if (maxval(off) <= tolerance .or. depth == deepest .or. panels >= most) then
            total = total + part
            total_off = total_off + off
            t = ends(depth)
            first = rates(:, depth)
            depth = depth - 1
         else
            ends(depth + 1) = t + 0.5_wp*(ends(depth) - t)
            rates(:, depth + 1) = middle
            depth = depth + 1
         end if
      end do
      call self%count_as_steps(panels)
   end subroutine integrate_quadratures

   !> Integral over a panel by the seven points of Kronrod's extension of Lobatto's rule of four (Gander & Gautschi, BIT 40,
   !> 2000), and what it is off: less than its distance to that rule, by as much as that is less than its distance to Simpson's.
   subroutine integrate_panel(self, t0, t1, first, last, value, middle, off, error)
      class(cvode_integrator), intent(inout) :: self
      real(wp), intent(in) :: t0, t1           !! [s]
      real(wp), dimension(n_quadratures), intent(in) :: first, last          !! rates there
      real(wp), dimension(n_quadratures), intent(out) :: value, middle, off !! integrals; rates in the middle; estimated errors
      type(error_type), allocatable, intent(inout) :: error
      real(wp), parameter :: outer = sqrt(2.0_wp/3.0_wp), inner = sqrt(0.2_wp)
      real(wp), parameter :: points(5) = [-outer, -inner, 0.0_wp, inner, outer]
      real(wp) :: rates(n_quadratures, 5), half
      real(wp), dimension(n_quadratures) :: lobatto, simpson
      integer :: i

      half = 0.5_wp*(t1 - t0)
      do i = 1, 5
         call rates_within(self, t0 + half*(1.0_wp + points(i)), rates(:, i), error)
         if (allocated(error)) return
      end do
      middle = rates(:, 3)
      value = (half/1470.0_wp)*(77.0_wp*(first + last) + 432.0_wp*(rates(:, 1) + rates(:, 5)) + &
                                625.0_wp*(rates(:, 2) + rates(:, 4)) + 672.0_wp*middle)
      lobatto = (half/6.0_wp)*(first + last + 5.0_wp*(rates(:, 2) + rates(:, 4)))
      simpson = (half/3.0_wp)*(first + last + 4.0_wp*middle)
      off = abs(value - lobatto)
      where (off > 0.0_wp) off = off*min(1.0_wp, off/max(abs(value - simpson), tiny(1.0_wp)))
   end subroutine integrate_panel

   subroutine rates_of_quadratures(self, t, y, rate, error)
      class(cvode_integrator), intent(inout) :: self
      real(wp), intent(in) :: t                !! [s]
      real(wp), contiguous, intent(in) :: y(:) !! (n_controlled)
      real(wp), intent(out) :: rate(n_quadratures)
      type(error_type), allocatable, intent(inout) :: error
      logical :: ok
      call self%system%quadratures(t, y, rate, ok)
      if (.not. ok) call raise(error, 'quadratures at t = '//time_text(t)//' s: the right-hand side could not be evaluated')
   end subroutine rates_of_quadratures

   !> Did an event function become negative in the last step? Then the step ends there.
   subroutine look_for_event(self, error)
      class(cvode_integrator), intent(inout) :: self
      type(error_type), allocatable, intent(inout) :: error
      real(wp) :: t

      call on_polynomial(self, self%t_before, 1, self%f_before, error)
      if (.not. allocated(error)) call on_polynomial(self, self%t_good, 1, self%f_step, error)
      if (allocated(error)) return
      self%y_step(:) = self%y_good(:self%system%n_controlled)
      call find_event(self, self%t_before, self%y_before, self%f_before, self%t_good, self%y_step, self%f_step, self%pending, t, &
                      self%y_event)
      if (.not. self%pending) return
      self%t_good = t
      self%y_good(:self%system%n_controlled) = self%y_event
   end subroutine look_for_event

   !> For `rodyn_event_search`; without quadratures.
   subroutine state_within(self, t, y, ok)
      class(cvode_integrator), intent(inout) :: self
      real(wp), intent(in) :: t
      real(wp), contiguous, intent(out) :: y(:)
      logical, intent(out) :: ok
      type(error_type), allocatable :: error
      call on_polynomial(self, t, 0, y, error)
      ok = .not. allocated(error)
   end subroutine state_within

   !> CVODE's polynomial of the last step, or a derivative of it.
   subroutine on_polynomial(self, t, derivative, y, error)
      class(cvode_integrator), intent(inout) :: self
      real(wp), intent(in) :: t !! [s]
      integer, intent(in) :: derivative
      real(wp), intent(out) :: y(:) !! (n_controlled)
      type(error_type), allocatable, intent(inout) :: error
      type(vector_content), pointer :: content

      content => content_of(self%state)
      call check(error, FCVodeGetDky(self%memory, t, int(derivative, c_int), self%state), 'CVodeGetDky', t)
      if (.not. allocated(error)) y = content%values
   end subroutine on_polynomial

   !> Add what the right-hand side had to say.
   subroutine name_cause(self, error)
      class(cvode_integrator), intent(in) :: self
      type(error_type), intent(inout) :: error
      if (self%data%not_finite) then
         error%message = error%message//'; the right-hand side was not finite at t = '//time_text(self%data%t_refused)//' s'
      else if (self%data%refused) then
         error%message = error%message//'; the right-hand side could not be evaluated at t = '// &
            time_text(self%data%t_refused)//' s'
      end if
   end subroutine name_cause

   !> Counts of the whole run.
   function statistics(self) result(stats)
      class(cvode_integrator), intent(inout) :: self
      type(solver_statistics) :: stats

      integer(c_long) :: count(1)
      integer(c_int) :: order(1)
      real(c_double) :: step(1)

      stats = self%before_restart
      stats%n_steps = self%n_steps
      stats%n_starts = self%n_starts
      if (.not. self%initialized) return
      stats%n_rhs = self%data%n_rhs
      if (FCVodeGetNumErrTestFails(self%memory, count) == CV_SUCCESS) then
         stats%n_error_test_failures = stats%n_error_test_failures + count(1)
      end if
      if (FCVodeGetNumNonlinSolvConvFails(self%memory, count) == CV_SUCCESS) then
         stats%n_nonlinear_failures = stats%n_nonlinear_failures + count(1)
      end if
      if (FCVodeGetLastOrder(self%memory, order) == CV_SUCCESS) then
         if (order(1) > 0) stats%last_order = order(1)
      end if
      if (FCVodeGetLastStep(self%memory, step) == CV_SUCCESS) then
         if (abs(step(1)) > 0.0_wp) stats%last_step = step(1)
      end if
      if (self%multistep == CV_ADAMS) return
      if (FCVodeGetNumJacEvals(self%memory, count) == CV_SUCCESS) stats%n_jac = stats%n_jac + count(1)
   end function statistics

   !> Release every handle, in the reverse order of their creation.
   subroutine finalize(self)
      class(cvode_integrator), intent(inout) :: self
      integer(c_int) :: flag

      if (c_associated(self%memory)) call FCVodeFree(self%memory)
      self%memory = c_null_ptr
      if (associated(self%nonlinear)) flag = FSUNNonlinSolFree(self%nonlinear)
      nullify (self%nonlinear)
      if (associated(self%linear)) flag = FSUNLinSolFree(self%linear)
      nullify (self%linear)
      if (associated(self%matrix)) call FSUNMatDestroy(self%matrix)
      nullify (self%matrix)
      call free_nvector(self%state)
      if (c_associated(self%context)) flag = FSUNContext_Free(self%context)
      self%context = c_null_ptr
      if (associated(self%data)) deallocate (self%data)
      self%initialized = .false.
      nullify (self%system, self%monitor)
   end subroutine finalize

   subroutine finalize_handles(self)
      type(cvode_integrator), intent(inout) :: self
      call self%finalize()
   end subroutine finalize_handles

   !> A negative return code becomes a message that names the call, the time and the code.
   subroutine check(error, flag, call_name, t)
      type(error_type), allocatable, intent(inout) :: error
      integer(c_int), intent(in) :: flag
      character(len=*), intent(in) :: call_name
      real(wp), intent(in), optional :: t !! [s]

      if (flag < 0_c_int) call raise_return_code(error, flag, flag_name(int(flag, c_long)), call_name, t)
   end subroutine check

end module rodyn_cvode_integrator
