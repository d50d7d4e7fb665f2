!> CVODE: variable-order Adams (fixed-point iteration) and BDF (Newton with the exact Jacobian, whose systems the
!> system of equations solves itself).
!>
!> Steps are taken one at a time towards the stop time; outputs are interpolated by CVODE's own polynomial, so
!> neither their number nor their times change a step. Events are found by CVODE's rootfinding on the same polynomial.
module rodyn_cvode_integrator
   use, intrinsic :: iso_c_binding, only: c_ptr, c_int, c_long, c_double, c_null_ptr, c_associated, c_loc, c_funloc
   use rodyn_kinds, only: wp, i8
   use rodyn_errors, only: error_type, raise
   use rodyn_ode, only: ode_system
   use rodyn_integrator, only: integrator_type, solver_options, solver_statistics, time_text
   use rodyn_nvector, only: new_nvector, free_nvector, vector_content, content_of
   use rodyn_newton_solver, only: new_newton_matrix, new_newton_solver, linear_system_shim
   use rodyn_sundials_base, only: callback_data, rhs_shim, root_shim, weights_shim, quiet_handler, all_finite, raise_return_code
   use fsundials_context_mod, only: FSUNContext_Create, FSUNContext_Free
   use fsundials_nvector_mod, only: N_Vector
   use fsundials_matrix_mod, only: SUNMatrix, FSUNMatDestroy
   use fsundials_linearsolver_mod, only: SUNLinearSolver, FSUNLinSolFree
   use fsundials_nonlinearsolver_mod, only: SUNNonlinearSolver, FSUNNonlinSolFree
   use fsunnonlinsol_fixedpoint_mod, only: FSUNNonlinSol_FixedPoint
   use fcvode_mod, only: CV_ADAMS, CV_BDF, CV_SUCCESS, CV_TSTOP_RETURN, CV_ROOT_RETURN, CV_ONE_STEP, FCVodeCreate, FCVodeInit, &
      FCVodeReInit, FCVodeRootInit, FCVodeSetRootDirection, FCVodeSetNoInactiveRootWarn, FCVodeGetRootInfo, &
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
      type(solver_statistics) :: before_restart !! counts up to the last restart, which resets CVODE's
   contains
      procedure :: start
      procedure :: advance
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

      integer, parameter :: highest_adams = 12, highest_bdf = 5

      if (method /= 'adams' .and. method /= 'bdf') then
         call raise(error, 'method '''//method//''' is not one of CVODE''s: ''adams'' or ''bdf''')
      else if (method == 'adams' .and. (options%order < 0 .or. options%order > highest_adams)) then
         call raise(error, 'order: ''adams'' takes 1 to 12, or 0 for its highest')
      else if (method == 'bdf' .and. (options%order < 0 .or. options%order > highest_bdf)) then
         call raise(error, 'order: ''bdf'' takes 1 to 5, or 0 for its highest')
      else if (options%fixed_step > 0.0_wp) then
         call raise(error, 'fixed_step: '''//method//''' chooses its own steps; use ''erk''')
      end if
      if (allocated(error)) return

      self%system => system
      self%options = options
      self%multistep = merge(CV_ADAMS, CV_BDF, method == 'adams')
      allocate (self%data)
      self%data%system => system
      self%data%rtol = options%rtol
      self%data%atol = options%atol
      call check(error, FSUNContext_Create(c_null_ptr, self%context), 'SUNContext_Create')
      if (allocated(error)) return
      self%state => new_nvector(system%n_states, system%n_controlled, self%context)
      self%memory = FCVodeCreate(self%multistep, self%context)
      if (.not. (associated(self%state) .and. c_associated(self%memory))) call raise(error, 'CVodeCreate: out of memory')
   end subroutine new_cvode_integrator

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
      content%values(:) = y
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
      if (self%system%n_events > 0) call watch_events(self, error)
      if (allocated(error)) return
      if (self%multistep == CV_ADAMS) then
         call attach_fixed_point(self, error)
      else
         call attach_newton(self, error)
      end if
   end subroutine initialize

   !> Let CVODE find where an event function becomes negative.
   subroutine watch_events(self, error)
      class(cvode_integrator), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      integer(c_int) :: direction(self%system%n_events)

      direction = -1_c_int
      call check(error, FCVodeRootInit(self%memory, int(self%system%n_events, c_int), c_funloc(root_shim)), 'CVodeRootInit')
      if (allocated(error)) return
      call check(error, FCVodeSetRootDirection(self%memory, direction), 'CVodeSetRootDirection')
      if (allocated(error)) return
      call check(error, FCVodeSetNoInactiveRootWarn(self%memory), 'CVodeSetNoInactiveRootWarn')
   end subroutine watch_events

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
      if (allocated(error) .or. .not. self%options%stability_limit_detection) return
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
            y(:) = content%values
            t = t_out
            return
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
      if (flag /= CV_SUCCESS .and. flag /= CV_TSTOP_RETURN .and. flag /= CV_ROOT_RETURN) then
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
      if (flag == CV_ROOT_RETURN) then
         call take_event(self, error)
         if (allocated(error)) return
      else if (.not. t_reached(1) > self%t_good) then
         self%n_steps = self%n_steps - 1
         call raise(error, 'CVode at t = '//time_text(self%t_good)//' s: the step has become too small to advance')
         call name_cause(self, error)
         return
      end if
      self%t_good = t_reached(1)
      self%y_good(:) = content%values
   end subroutine one_step

   !> Which functions made CVODE stop.
   subroutine take_event(self, error)
      class(cvode_integrator), intent(inout) :: self
      type(error_type), allocatable, intent(inout) :: error
      integer(c_int) :: found(self%system%n_events)

      call check(error, FCVodeGetRootInfo(self%memory, found), 'CVodeGetRootInfo', self%t_good)
      if (allocated(error)) return
      self%crossed = found /= 0_c_int
      self%pending = .true.
   end subroutine take_event

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
