!> CVODE: variable-order Adams (fixed-point iteration) and BDF (Newton with the exact Jacobian, whose systems the
!> system of equations solves itself).
!>
!> Steps are taken one at a time towards the stop time; outputs are interpolated by CVODE's own polynomial, so
!> neither their number nor their times change a step. Events are sought on the same polynomial (`rodyn_event_search`);
!> CVODE's own rootfinding compares the ends of steps alone.
!>
!> Tolerances are those of a step, and errors of these methods have the same sign from one period of a vibration to the next: they
!> add up, to hundreds and thousands of tolerances where one-step methods leave tens. So CVODE is given smaller ones (`tightened`).
module rodyn_cvode_integrator
   use, intrinsic :: iso_c_binding, only: c_int, c_long, c_double, c_null_ptr, c_associated, c_loc, c_funloc
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type, raise
   use rodyn_methods, only: method_named, method_type
   use rodyn_ode, only: ode_system, n_quadratures
   use rodyn_integrator, only: solver_options, solver_statistics, tightened
   use rodyn_quadrature_history, only: quadrature_history
   use rodyn_nvector, only: vector_content, content_of
   use rodyn_newton_solver, only: new_newton_matrix, new_newton_solver, linear_system_shim
   use rodyn_sundials_base, only: rhs_shim, weights_shim, check
   use rodyn_sundials_integrator, only: sundials_integrator
   use rodyn_sundials_interface, only: silence_cvode, SUNMatrix, FSUNMatDestroy, SUNLinearSolver, FSUNLinSolFree, &
      SUNNonlinearSolver, FSUNNonlinSolFree
   use fsunnonlinsol_fixedpoint_mod, only: FSUNNonlinSol_FixedPoint
   use fcvode_mod, only: CV_ADAMS, CV_BDF, CV_SUCCESS, CV_ONE_STEP, FCVodeCreate, FCVodeInit, FCVodeReInit, FCVodeFree, &
      FCVode, FCVodeGetDky, FCVodeSetUserData, FCVodeWFtolerances, FCVodeSetMaxOrd, FCVodeSetMaxStep, &
      FCVodeSetStopTime, FCVodeSetStabLimDet, FCVodeSetNonlinearSolver, FCVodeSetLinearSolver, &
      FCVodeSetLinSysFn, FCVodeGetNumErrTestFails, FCVodeGetNumNonlinSolvConvFails, FCVodeGetLastOrder, FCVodeGetLastStep, &
      FCVodeGetNumJacEvals
   implicit none (type, external)
   private
   public :: cvode_integrator, new_cvode_integrator

   type, extends(sundials_integrator) :: cvode_integrator
      private
      integer(c_int) :: multistep = CV_ADAMS
      type(SUNMatrix), pointer :: matrix => null()
      type(SUNLinearSolver), pointer :: linear => null()
      type(SUNNonlinearSolver), pointer :: nonlinear => null()
      real(wp), dimension(n_quadratures) :: sums_before = 0.0_wp, rate_before = 0.0_wp !! quadratures, and their rates, at the start
                                                                                       !! of the last internal step
      type(quadrature_history) :: history !! rates in the last steps
   contains
      procedure :: begin
      procedure :: set_library_stop
      procedure :: evolve
      procedure :: complete_step
      procedure :: output
      procedure :: rates_at_ends
      procedure :: state_within
      procedure :: statistics
      procedure :: free_memory
      final :: finalize_handles
   end type cvode_integrator

contains

   !> Create an integrator for `system`, which must outlive it.
   subroutine new_cvode_integrator(self, system, method, options, error)
      type(cvode_integrator), intent(out) :: self
      class(ode_system), target, intent(inout) :: system
      character(len=*), intent(in) :: method !! 'adams' or 'bdf'
      type(solver_options), intent(in) :: options
      type(error_type), allocatable, intent(out) :: error

      if (method /= 'adams' .and. method /= 'bdf') then
         call raise(error, 'method '''//method//''' is not one of CVODE''s: ''adams'' or ''bdf''')
         return
      end if

      self%multistep = merge(CV_ADAMS, CV_BDF, method == 'adams')
      call self%create(system, options, inner_options(method, options), system%n_controlled, 'CVode', error)
      if (allocated(error)) return
      self%memory = FCVodeCreate(self%multistep, self%context)
      if (.not. c_associated(self%memory)) call raise(error, 'CVodeCreate: out of memory')
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
      inner_options = tightened(options, shorter, order + 1)
   end function inner_options

   subroutine begin(self, t, error)
      class(cvode_integrator), intent(inout) :: self
      real(wp), intent(in) :: t !! [s]
      type(error_type), allocatable, intent(inout) :: error

      if (self%system%has_quadratures()) call self%history%begin(t, self%rate)
      if (self%initialized) then ! at order one, without history
         call check(error, FCVodeReInit(self%memory, t, self%state), 'CVodeReInit', t)
         return
      end if
      associate (memory => self%memory)
         call check(error, silence_cvode(memory), 'CVodeSetErrHandlerFn')
         call check(error, FCVodeInit(memory, c_funloc(rhs_shim), t, self%state), 'CVodeInit', t)
         call check(error, FCVodeSetUserData(memory, c_loc(self%data)), 'CVodeSetUserData')
         call check(error, FCVodeWFtolerances(memory, c_funloc(weights_shim)), 'CVodeWFtolerances')
         if (self%options%order > 0) call check(error, FCVodeSetMaxOrd(memory, int(self%options%order, c_int)), 'CVodeSetMaxOrd')
         if (self%options%max_step > 0.0_wp) call check(error, FCVodeSetMaxStep(memory, self%options%max_step), 'CVodeSetMaxStep')
      end associate
      if (allocated(error)) return
      if (self%multistep == CV_ADAMS) then
         call attach_fixed_point(self, error)
      else
         call attach_newton(self, error)
      end if
   end subroutine begin

   !> Adams: functional iteration y <- g(y), no acceleration (m = 0): the iteration converges in one or two passes.
   subroutine attach_fixed_point(self, error)
      class(cvode_integrator), intent(inout) :: self
      type(error_type), allocatable, intent(inout) :: error

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
      type(error_type), allocatable, intent(inout) :: error

      self%matrix => new_newton_matrix(self%context)
      if (associated(self%matrix)) self%linear => new_newton_solver(self%data, self%context)
      if (.not. associated(self%linear)) then
         call raise(error, 'SUNLinSolNewEmpty: out of memory')
         return
      end if
      call check(error, FCVodeSetLinearSolver(self%memory, self%linear, self%matrix), 'CVodeSetLinearSolver')
      call check(error, FCVodeSetLinSysFn(self%memory, c_funloc(linear_system_shim)), 'CVodeSetLinSysFn')
      call check(error, FCVodeSetStabLimDet(self%memory, 1_c_int), 'CVodeSetStabLimDet')
   end subroutine attach_newton

   subroutine set_library_stop(self, error)
      class(cvode_integrator), intent(inout) :: self
      type(error_type), allocatable, intent(inout) :: error
      call check(error, FCVodeSetStopTime(self%memory, self%t_stop), 'CVodeSetStopTime', self%t_good)
   end subroutine set_library_stop

   subroutine evolve(self, t_reached, error)
      class(cvode_integrator), intent(inout) :: self
      real(wp), intent(out) :: t_reached !! [s]
      type(error_type), allocatable, intent(inout) :: error
      real(c_double) :: t(1)
      t = self%t_good
      call check(error, FCVode(self%memory, self%t_stop, self%state, t, CV_ONE_STEP), 'CVode', self%t_good)
      t_reached = t(1)
   end subroutine evolve

   subroutine complete_step(self, error)
      class(cvode_integrator), intent(inout) :: self
      type(error_type), allocatable, intent(inout) :: error
      if (self%system%n_events > 0) call self%look_for_event(error)
      if (allocated(error)) return
      if (self%system%has_quadratures()) call add_quadratures(self, error)
   end subroutine complete_step

   subroutine output(self, t, y, error)
      class(cvode_integrator), intent(inout) :: self
      real(wp), intent(in) :: t !! [s]
      real(wp), contiguous, intent(out) :: y(:) !! (n_states)
      type(error_type), allocatable, intent(inout) :: error
      call on_polynomial(self, t, 0, y(:self%system%n_controlled), error)
      if (allocated(error)) return
      if (self%system%has_quadratures()) call quadratures_within(self, t, y, error)
   end subroutine output

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
         call self%rates_of_quadratures(self%t_good, self%y_good(:n), self%rate, error)
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
      if (.not. allocated(error)) call self%rates_of_quadratures(t, content%values, rate, error)
   end subroutine rates_within

   !> Quadratures at an output inside the last step.
   subroutine quadratures_within(self, t, y, error)
      class(cvode_integrator), intent(inout) :: self
      real(wp), intent(in) :: t !! [s]
      real(wp), contiguous, intent(inout) :: y(:)
      type(error_type), allocatable, intent(inout) :: error
      real(wp), dimension(n_quadratures) :: rate, increment, off

      associate (n => self%system%n_controlled)
         call self%rates_of_quadratures(t, y(:n), rate, error)
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

   subroutine rates_at_ends(self, error)
      class(cvode_integrator), intent(inout) :: self
      type(error_type), allocatable, intent(inout) :: error
      call on_polynomial(self, self%t_before, 1, self%f_before, error)
      if (.not. allocated(error)) call on_polynomial(self, self%t_good, 1, self%f_after, error)
   end subroutine rates_at_ends

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

   !> Counts of the whole run.
   function statistics(self) result(stats)
      class(cvode_integrator), intent(inout) :: self
      type(solver_statistics) :: stats

      integer(c_long) :: count(1)
      integer(c_int) :: order(1)
      real(c_double) :: step(1)

      stats = self%counts_of_steps()
      if (.not. self%initialized) return
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

   subroutine free_memory(self)
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
   end subroutine free_memory

   subroutine finalize_handles(self)
      type(cvode_integrator), intent(inout) :: self
      call self%finalize()
   end subroutine finalize_handles

end module rodyn_cvode_integrator
