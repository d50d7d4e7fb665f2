!> ARKODE's ERKStep: explicit Runge-Kutta pairs of order 2 to 8, adaptive or with a fixed step.
!>
!> ARKODE interpolates to order 5 at most, which is too coarse for an order-8 step. An output inside a step is
!> therefore computed by one shorter step of the same method from the start of that step: as accurate as the
!> steps themselves, at one step's cost per output, and the steps never change.
!>
!> The tables are SUNDIALS' own: Heun-Euler 2(1), Bogacki-Shampine 3(2), Zonneveld 4(3), Cash-Karp 5(4), Verner 6(5),
!> Fehlberg 8(7); order 7 is Fehlberg's pair with its two solutions exchanged. Fehlberg's error estimate is blind to
!> pure quadratures, y' = f(t), such as a motion that loads alone drive; so order 6 is the default, the highest of those that see
!> everything. Quadratures behind the states have an estimate of their own. A right-hand side that cannot be evaluated ends an
!> ERKStep run at once, without trying a shorter step.
module rodyn_erk_integrator
   use, intrinsic :: iso_c_binding, only: c_ptr, c_int, c_long, c_double, c_null_ptr, c_associated, c_loc, c_funloc, c_f_pointer
   use rodyn_kinds, only: wp, i8
   use rodyn_errors, only: error_type, raise
   use rodyn_text, only: time_text
   use rodyn_ode, only: ode_system, n_quadratures
   use rodyn_integrator, only: integrator_type, solver_options, solver_statistics, stricter
   use rodyn_nvector, only: new_nvector, free_nvector, vector_content, content_of
   use rodyn_event_search, only: find_event
   use rodyn_quadrature_refinement, only: quadrature_refinement
   use rodyn_sundials_base, only: callback_data, rhs_shim, weights_shim, quiet_handler, all_finite, raise_return_code
   use fsundials_context_mod, only: FSUNContext_Create, FSUNContext_Free
   use fsundials_nvector_mod, only: N_Vector
   use farkode_mod, only: ARK_SUCCESS, ARK_TSTOP_RETURN, ARK_ONE_STEP, ARKODE_HEUN_EULER_2_1_2, &
      ARKODE_BOGACKI_SHAMPINE_4_2_3, ARKODE_ZONNEVELD_5_3_4, ARKODE_CASH_KARP_6_4_5, ARKODE_VERNER_8_5_6, &
      ARKODE_FEHLBERG_13_7_8, FARKodeButcherTable_LoadERK, FARKodeButcherTable_Free
   use farkode_erkstep_mod, only: FERKStepCreate, FERKStepReInit, FERKStepFree, FERKStepEvolve, FERKStepSetTable, &
      FERKStepSetUserData, FERKStepWFtolerances, FERKStepSetErrHandlerFn, FERKStepSetMaxStep, FERKStepSetStopTime, &
      FERKStepSetFixedStep, FERKStepSetInterpolantDegree, FERKStepGetNumErrTestFails, FERKStepGetLastStep, &
      FERKStepSetPostprocessStepFn
   implicit none (type, external)
   private
   public :: erk_integrator, new_erk_integrator, erk_tableau

   integer, parameter :: default_order = 6
   real(wp), parameter :: shorter = 0.56_wp !! steps than ARKODE would make with the user's tolerances

   !> struct ARKodeButcherTableMem of arkode_butcher.h
   type, bind(c) :: butcher_table
      integer(c_int) :: order, embedded_order, stages
      type(c_ptr) :: a !! rows of the matrix
      type(c_ptr) :: c
      type(c_ptr) :: b
      type(c_ptr) :: d
   end type butcher_table

   !> Owns every handle of ERKStep. Do not copy by assignment.
   type, extends(integrator_type) :: erk_integrator
      private
      integer :: order = 0
      real(wp), allocatable :: a(:, :)        !! (stages, stages): a(j, i) multiplies rate j in stage i
      real(wp), allocatable :: b(:), c(:)     !! (stages)
      real(wp), allocatable :: b_error(:)     !! less those of the embedded method (stages)
      real(wp), allocatable :: b_doubt(:)     !! of a second look at errors of quadratures, see `second_look` (stages)
      real(wp), allocatable :: rates(:, :)    !! of the stages of an output step (n_states, stages)
      real(wp) :: t_before = 0.0_wp           !! start of the last internal step [s]
      real(wp), allocatable :: y_before(:)    !! state there (n_states)
      real(wp), allocatable, dimension(:) :: f_before, f_now, y_event !! for events: rates at both ends of the step; workspace
      real(wp) :: rate(n_quadratures) = 0.0_wp !! rates of the quadratures at the end of the last internal step
      real(wp), allocatable :: power(:, :)    !! and in its stages (n_quadratures, stages)
      real(wp) :: quadrature_error(n_quadratures) = 0.0_wp !! of the last step, or output step
      type(quadrature_refinement) :: refinement
      real(wp) :: t_first = 0.0_wp            !! start of the interval, where the grid of fixed steps begins [s]
      integer(i8) :: n_grid = 0, i_grid = 0   !! fixed steps of the interval; steps done
      real(wp) :: stop_in_force = -huge(1.0_wp) !! the stop time ARKODE knows [s]
      type(c_ptr) :: context = c_null_ptr
      type(c_ptr) :: memory = c_null_ptr
      type(N_Vector), pointer :: state => null()
      type(callback_data), pointer :: data => null()
      type(solver_statistics) :: before_restart !! counts up to the last restart, which resets ARKODE's
   contains
      procedure :: start
      procedure :: advance
      procedure :: statistics
      procedure :: finalize
      procedure :: state_within
      final :: finalize_handles
   end type erk_integrator

   interface
      !> The caller frees the text.
      function flag_name(flag) result(text) bind(c, name='ERKStepGetReturnFlagName')
         import :: c_ptr, c_long
         implicit none (type, external)
         integer(c_long), intent(in), value :: flag
         type(c_ptr) :: text
      end function flag_name
   end interface

contains

   !> Create an integrator for `system`, which must outlive it.
   subroutine new_erk_integrator(self, system, options, error)
      type(erk_integrator), intent(out) :: self
      class(ode_system), target, intent(inout) :: system
      type(solver_options), intent(in) :: options
      type(error_type), allocatable, intent(out) :: error
      type(solver_options) :: inner

      self%order = options%order
      if (self%order == 0) self%order = default_order
      self%system => system
      self%options = options
      allocate (self%data)
      self%data%system => system
      inner = stricter(options, shorter, merge(8, self%order, self%order >= 7))
      self%data%rtol = inner%rtol
      self%data%atol = inner%atol
      call check(error, FSUNContext_Create(c_null_ptr, self%context), 'SUNContext_Create')
      if (allocated(error)) return
      self%state => new_nvector(system%n_states, system%n_controlled, self%context)
      if (.not. associated(self%state)) call raise(error, 'N_VNewEmpty: out of memory')
   end subroutine new_erk_integrator

   !> First start, or exact restart: the first step is chosen anew.
   subroutine start(self, t, y, error)
      class(erk_integrator), intent(inout) :: self
      real(wp), intent(in) :: t    !! [s]
      real(wp), intent(in) :: y(:) !! (n_states)
      type(error_type), allocatable, intent(out) :: error

      type(vector_content), pointer :: content
      logical :: ok

      call self%begin_interval(t, y, error)
      if (allocated(error)) return
      content => content_of(self%state)
      content%values(:) = y
      self%t_before = t
      self%y_before = y
      self%stop_in_force = -huge(1.0_wp)
      if (self%system%n_events > 0) call begin_events(self, error)
      if (allocated(error)) return
      if (self%system%has_quadratures()) then
         call self%system%quadratures(t, self%y_good(:self%system%n_controlled), self%rate, ok)
         if (.not. ok) call raise(error, 'start at t = '//time_text(t)//' s: work and dissipation cannot be evaluated')
         if (allocated(error)) return
      end if
      if (c_associated(self%memory)) then
         self%before_restart = self%statistics()
         call check(error, FERKStepReInit(self%memory, c_funloc(rhs_shim), t, self%state), 'ERKStepReInit', t)
      else
         call initialize(self, t, error)
      end if
   end subroutine start

   !> Hand everything over to ERKStep, once.
   subroutine initialize(self, t, error)
      class(erk_integrator), intent(inout) :: self
      real(wp), intent(in) :: t !! [s]
      type(error_type), allocatable, intent(out) :: error

      integer(c_int), parameter :: interpolant_degree = 3_c_int !! no right-hand sides of its own

      self%memory = FERKStepCreate(c_funloc(rhs_shim), t, self%state, self%context)
      if (.not. c_associated(self%memory)) then
         call raise(error, 'ERKStepCreate: out of memory')
         return
      end if
      call check(error, FERKStepSetErrHandlerFn(self%memory, c_funloc(quiet_handler), c_null_ptr), 'ERKStepSetErrHandlerFn')
      if (allocated(error)) return
      call check(error, FERKStepSetUserData(self%memory, c_loc(self%data)), 'ERKStepSetUserData')
      if (allocated(error)) return
      call check(error, FERKStepWFtolerances(self%memory, c_funloc(weights_shim)), 'ERKStepWFtolerances')
      if (allocated(error)) return
      call check(error, FERKStepSetInterpolantDegree(self%memory, interpolant_degree), 'ERKStepSetInterpolantDegree')
      if (allocated(error)) return
      call choose_table(self, error)
      if (allocated(error)) return
      if (.not. first_same_as_last(self)) then
         call check(error, FERKStepSetPostprocessStepFn(self%memory, c_funloc(nothing_to_do)), 'ERKStepSetPostprocessStepFn')
         if (allocated(error)) return
      end if
      if (.not. self%options%max_step > 0.0_wp) return
      call check(error, FERKStepSetMaxStep(self%memory, self%options%max_step), 'ERKStepSetMaxStep')
   end subroutine initialize

   !> Give ERKStep the table of the chosen order, and keep a copy for the outputs.
   subroutine choose_table(self, error)
      class(erk_integrator), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error

      type(c_ptr) :: address

      call load_table(self%order, address, error)
      if (allocated(error)) return
      call copy_table(address, self%a, self%b, self%c, self%b_error)
      self%b_error(:) = self%b - self%b_error
      self%b_doubt = second_look(self%c, self%b_error)
      allocate (self%rates(self%system%n_states, size(self%b)))
      if (self%system%has_quadratures()) allocate (self%power(n_quadratures, size(self%b)), &
                                                   self%data%recent(n_quadratures, size(self%b)), source=0.0_wp)
      call check(error, FERKStepSetTable(self%memory, address), 'ERKStepSetTable')
      call FARKodeButcherTable_Free(address)
   end subroutine choose_table

   !> Weights that, like given ones, are blind to polynomials up to some degree, but see others of higher degree: a divided
   !> difference, orthogonal to the given weights and of their length. An error that these miss by chance is seen by those.
   pure function second_look(c, weights) result(others)
      real(wp), intent(in) :: c(:)       !! times of the stages, as shares of the step
      real(wp), intent(in) :: weights(:)
      real(wp) :: others(size(c))        !! 0 if there are none
      logical :: distinct(size(c))
      integer :: i, degree

      degree = 0
      do while (degree < size(c) .and. abs(sum(weights*c**degree)) < 1.0e-10_wp) ! 0**0 = 1
         degree = degree + 1
      end do
      distinct = [(all(abs(c(:i - 1) - c(i)) > 1.0e-10_wp), i=1, size(c))]
      others = 0.0_wp
      if (count(distinct) < degree + 2) return
      do i = size(c), 1, -1 ! of the last ones
         if (count(distinct(i:)) > degree + 1) distinct(i) = .false.
      end do
      do i = 1, size(c)
         if (distinct(i)) others(i) = 1.0_wp/product(c(i) - c, mask=distinct .and. abs(c(i) - c) > 0.0_wp)
      end do
      others = others - weights*(sum(others*weights)/sum(weights**2))
      others = others*(norm2(weights)/norm2(others))
   end function second_look

   !> Coefficients of the table of an order.
   subroutine erk_tableau(order, a, b, c, error)
      integer, intent(in) :: order                 !! 2 to 8; 0: the default
      real(wp), allocatable, intent(out) :: a(:, :) !! (stages, stages): a(j, i) multiplies rate j in stage i
      real(wp), allocatable, intent(out) :: b(:), c(:) !! (stages)
      type(error_type), allocatable, intent(out) :: error

      type(c_ptr) :: address

      call load_table(merge(default_order, order, order == 0), address, error)
      if (allocated(error)) return
      call copy_table(address, a, b, c)
      call FARKodeButcherTable_Free(address)
   end subroutine erk_tableau

   !> SUNDIALS' table of an order, to be freed by the caller.
   subroutine load_table(order, address, error)
      integer, intent(in) :: order
      type(c_ptr), intent(out) :: address
      type(error_type), allocatable, intent(out) :: error

      type(c_ptr) :: swap
      type(butcher_table), pointer :: table

      select case (order)
      case (2); address = FARKodeButcherTable_LoadERK(ARKODE_HEUN_EULER_2_1_2)
      case (3); address = FARKodeButcherTable_LoadERK(ARKODE_BOGACKI_SHAMPINE_4_2_3)
      case (4); address = FARKodeButcherTable_LoadERK(ARKODE_ZONNEVELD_5_3_4)
      case (5); address = FARKodeButcherTable_LoadERK(ARKODE_CASH_KARP_6_4_5)
      case (6); address = FARKodeButcherTable_LoadERK(ARKODE_VERNER_8_5_6)
      case default; address = FARKodeButcherTable_LoadERK(ARKODE_FEHLBERG_13_7_8)
      end select
      if (.not. c_associated(address)) then
         call raise(error, 'ARKodeButcherTable_LoadERK: out of memory')
         return
      end if
      if (order /= 7) return
      call c_f_pointer(address, table)
      swap = table%b
      table%b = table%d
      table%d = swap
      table%order = 7_c_int
      table%embedded_order = 8_c_int
   end subroutine load_table

   !> True if the last stage is the new state, so that its rate may begin the next step.
   !>
   !> SUNDIALS before 6.7 takes this for granted as soon as c_s = 1. For Verner's and Fehlberg's tables that is wrong
   !> and costs the order: 3 is observed instead of 6. A postprocessing function, even one that does nothing,
   !> makes ERKStep evaluate the rate at the new state.
   pure function first_same_as_last(self) result(same)
      class(erk_integrator), intent(in) :: self
      logical :: same
      same = all(abs(self%a(:, size(self%b)) - self%b) <= epsilon(1.0_wp))
   end function first_same_as_last

   !> ARKPostProcessFn that leaves the state alone.
   function nothing_to_do(t, y, user_data) result(flag) bind(c)
      real(c_double), intent(in), value :: t
      type(N_Vector), intent(in) :: y
      type(c_ptr), intent(in), value :: user_data
      integer(c_int) :: flag
      associate (u1 => t, u2 => y, u3 => user_data); end associate
      flag = 0_c_int
   end function nothing_to_do

   !> The coefficients as arrays.
   subroutine copy_table(address, a, b, c, d)
      type(c_ptr), intent(in) :: address
      real(wp), allocatable, intent(out) :: a(:, :), b(:), c(:)
      real(wp), allocatable, intent(out), optional :: d(:) !! the embedded method's b

      type(butcher_table), pointer :: table
      type(c_ptr), pointer :: rows(:)
      real(c_double), pointer :: values(:)
      integer :: i, stages

      call c_f_pointer(address, table)
      stages = table%stages
      allocate (a(stages, stages))
      call c_f_pointer(table%a, rows, [stages])
      do i = 1, stages
         call c_f_pointer(rows(i), values, [stages])
         a(:, i) = values
      end do
      call c_f_pointer(table%b, values, [stages])
      b = values
      call c_f_pointer(table%c, values, [stages])
      c = values
      if (.not. present(d)) return
      call c_f_pointer(table%d, values, [stages])
      d = values
   end subroutine copy_table

   !> Step past t_out, but never past the stop time; an output inside the last step gets a step of its own.
   subroutine advance(self, t_out, y, t, error)
      class(erk_integrator), intent(inout) :: self
      real(wp), intent(in) :: t_out !! [s]
      real(wp), contiguous, intent(out) :: y(:) !! (n_states)
      real(wp), intent(out) :: t    !! [s]
      type(error_type), allocatable, intent(out) :: error

      call self%check_target(t_out, error)
      if (.not. allocated(error)) call heed_stop(self, error)
      do while (.not. allocated(error) .and. self%t_good < t_out .and. .not. self%pending)
         call self%permit_step(error)
         if (.not. allocated(error)) call one_step(self, error)
      end do
      self%at_event = self%pending .and. self%t_good <= t_out
      if (.not. allocated(error) .and. t_out < self%t_good) then
         call output_step(self, t_out, y, error)
         t = t_out
         if (.not. allocated(error)) return
      end if
      y(:) = self%y_good
      t = self%t_good
   end subroutine advance

   !> Tell ERKStep a new stop time; lay the grid of fixed steps: h = interval/ceiling(interval/fixed_step).
   subroutine heed_stop(self, error)
      class(erk_integrator), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error

      real(wp) :: n_steps

      if (.not. (self%stop_in_force < self%t_stop .or. self%stop_in_force > self%t_stop)) return
      if (.not. self%t_stop > self%t_good) return
      call check(error, FERKStepSetStopTime(self%memory, self%t_stop), 'ERKStepSetStopTime', self%t_good)
      if (allocated(error)) return
      self%stop_in_force = self%t_stop
      if (.not. self%options%fixed_step > 0.0_wp) return
      n_steps = (self%t_stop - self%t_good)/self%options%fixed_step
      if (n_steps > 1.0e15_wp) then
         call raise(error, 'fixed_step: more than 1e15 steps to t = '//time_text(self%t_stop)//' s')
         return
      end if
      self%t_first = self%t_good
      self%i_grid = 0
      self%n_grid = max(1_i8, ceiling(n_steps*(1.0_wp - 4.0_wp*epsilon(1.0_wp)), i8))
   end subroutine heed_stop

   !> One internal step of ERKStep.
   subroutine one_step(self, error)
      class(erk_integrator), intent(inout) :: self
      type(error_type), allocatable, intent(inout) :: error

      type(vector_content), pointer :: content
      real(c_double) :: t_reached(1)
      integer(c_int) :: flag

      if (self%n_grid > 0 .and. self%options%fixed_step > 0.0_wp) then
         call set_fixed_step(self, error)
         if (allocated(error)) return
      end if
      flag = FERKStepEvolve(self%memory, self%t_stop, self%state, t_reached, ARK_ONE_STEP)
      if (flag /= ARK_SUCCESS .and. flag /= ARK_TSTOP_RETURN) then
         self%n_steps = self%n_steps - 1
         call check(error, flag, 'ERKStepEvolve', self%t_good)
         call name_cause(self, error)
         return
      end if
      content => content_of(self%state)
      if (.not. all_finite(content%values)) then
         self%n_steps = self%n_steps - 1
         call raise(error, 'ERKStepEvolve at t = '//time_text(self%t_good)//' s: the state is not finite after the next step')
         return
      end if
      if (.not. t_reached(1) > self%t_good) then
         self%n_steps = self%n_steps - 1
         call raise(error, 'ERKStepEvolve at t = '//time_text(self%t_good)//' s: the step has become too small to advance')
         call name_cause(self, error)
         return
      end if
      self%t_before = self%t_good
      self%y_before(:) = self%y_good
      self%t_good = t_reached(1)
      self%y_good(:) = content%values
      if (self%system%has_quadratures()) call add_quadratures(self)
      if (self%system%n_events > 0) call look_for_event(self, error)
   end subroutine one_step

   !> Quadratures at the end of the last internal step, from the rates in its stages, which are those of the last calls.
   subroutine add_quadratures(self)
      class(erk_integrator), intent(inout) :: self
      integer :: i, j, n, back

      n = size(self%b)
      back = merge(0, 1, first_same_as_last(self)) ! else a call at the new state follows the stages
      self%power(:, 1) = self%rate
      do j = 2, n
         associate (call => modulo(self%data%latest - 1 - back - (n - j), n) + 1)
            do i = 1, n_quadratures
               self%power(i, j) = self%data%recent(i, call)
            end do
         end associate
      end do
      do i = 1, n_quadratures
         self%rate(i) = self%data%recent(i, self%data%latest)
      end do
      associate (first => self%system%n_controlled + 1)
         call integrate_quadratures(self, self%t_good, self%power, self%y_good(first:))
         call self%system%note_quadratures(self%y_good(first:), self%quadrature_error)
      end associate
   end subroutine add_quadratures

   !> Quadratures at the end of a step from the start of the last internal one, refined where the rates in its stages show that
   !> they have too large an error (not in fixed steps, in which the motion has no tolerance either).
   subroutine integrate_quadratures(self, t, power, values)
      class(erk_integrator), intent(inout) :: self
      real(wp), intent(in) :: t            !! [s]
      real(wp), intent(in) :: power(:, :)  !! (n_quadratures, stages)
      real(wp), intent(inout) :: values(n_quadratures)
      real(wp), dimension(n_quadratures) :: before, integral
      real(wp) :: tolerance
      integer :: n_steps
      logical :: ok

      associate (h => t - self%t_before, options => self%options)
         before = self%y_before(self%system%n_controlled + 1:)
         integral = h*weighted(power, self%b)
         self%quadrature_error = h*estimate(self, power)
         if (.not. options%fixed_step > 0.0_wp) then
            tolerance = self%system%quadrature_tolerance(options%rtol, options%atol, before + integral)
            if (maxval(self%quadrature_error) > tolerance) then
               call self%refinement%refine(self%system, self%t_before, self%y_before, t, options%rtol, options%atol, tolerance, &
                                           integral, self%quadrature_error, self%data%n_rhs, n_steps, ok)
               call self%count_as_steps(n_steps)
            end if
         end if
         values = before + integral
      end associate
   end subroutine integrate_quadratures

   !> Error of mean rates. Fehlberg's pairs cannot see it: on a quadrature both are the rule of Newton and Cotes with seven
   !> points. Its distance to Weddle's rule, of two degrees less, is taken.
   pure function estimate(self, power) result(error)
      class(erk_integrator), intent(in) :: self
      real(wp), intent(in) :: power(:, :) !! (n_quadratures, stages)
      real(wp) :: error(n_quadratures)
      integer, parameter :: even(7) = [1, 8, 10, 6, 9, 7, 11] !! Fehlberg's stages at 0, 1/6, ... 1
      real(wp), parameter :: sixth_difference(7) = [1.0_wp, -6.0_wp, 15.0_wp, -20.0_wp, 15.0_wp, -6.0_wp, 1.0_wp]
      integer :: j

      if (self%order < 7) then
         error = max(abs(weighted(power, self%b_error)), abs(weighted(power, self%b_doubt)))
      else
         error = 0.0_wp
         do j = 1, size(even)
            error = error + sixth_difference(j)*power(:, even(j))
         end do
         error = abs(error)/840.0_wp
      end if
   end function estimate

   !> Sums of rates with weights.
   pure function weighted(power, weight) result(total)
      real(wp), intent(in) :: power(:, :) !! (n_quadratures, stages)
      real(wp), intent(in) :: weight(:)   !! (stages)
      real(wp) :: total(n_quadratures)
      integer :: j
      total = 0.0_wp
      do j = 1, size(weight)
         total = total + weight(j)*power(:, j)
      end do
   end function weighted

   !> Rates at the start, for the first look into a step.
   subroutine begin_events(self, error)
      class(erk_integrator), intent(inout) :: self
      type(error_type), allocatable, intent(inout) :: error

      if (.not. allocated(self%f_now)) allocate (self%f_before(self%system%n_states), self%f_now(self%system%n_states), &
                                                 self%y_event(self%system%n_states), source=0.0_wp)
      call rates_now(self, error)
   end subroutine begin_events

   subroutine rates_now(self, error)
      class(erk_integrator), intent(inout) :: self
      type(error_type), allocatable, intent(inout) :: error
      logical :: ok
      call self%system%rhs(self%t_good, self%y_good, self%f_now, ok)
      self%data%n_rhs = self%data%n_rhs + 1
      if (.not. ok) call raise(error, 'erk at t = '//time_text(self%t_good)//' s: the right-hand side cannot be evaluated')
   end subroutine rates_now

   !> Did an event function become negative in the last step? Then the step ends there. ARKODE's own rootfinding works on
   !> its cubic interpolant, which is too coarse.
   subroutine look_for_event(self, error)
      class(erk_integrator), intent(inout) :: self
      type(error_type), allocatable, intent(inout) :: error
      real(wp) :: t

      self%f_before(:) = self%f_now
      call rates_now(self, error)
      if (allocated(error)) return
      call find_event(self, self%t_before, self%y_before, self%f_before, self%t_good, self%y_good, self%f_now, &
                      self%pending, t, self%y_event)
      if (.not. self%pending) return
      self%t_good = t
      self%y_good(:) = self%y_event
   end subroutine look_for_event

   !> For `rodyn_event_search`.
   subroutine state_within(self, t, y, ok)
      class(erk_integrator), intent(inout) :: self
      real(wp), intent(in) :: t
      real(wp), contiguous, intent(out) :: y(:)
      logical, intent(out) :: ok
      type(error_type), allocatable :: error
      call output_step(self, t, y, error)
      ok = .not. allocated(error)
   end subroutine state_within

   !> The next step ends on the next point of the grid, so that times are never summed up.
   subroutine set_fixed_step(self, error)
      class(erk_integrator), intent(inout) :: self
      type(error_type), allocatable, intent(inout) :: error

      real(wp) :: t_next

      self%i_grid = self%i_grid + 1
      t_next = self%t_stop
      if (self%i_grid < self%n_grid) t_next = self%t_first &
         + (self%t_stop - self%t_first)*(real(self%i_grid, wp)/real(self%n_grid, wp))
      call check(error, FERKStepSetFixedStep(self%memory, t_next - self%t_good), 'ERKStepSetFixedStep', self%t_good)
   end subroutine set_fixed_step

   !> y(t_out) by one step of the table from the start of the last internal step:
   !> k_i = f(t + c_i h, y + h sum_j a_ij k_j),  y(t + h) = y + h sum_i b_i k_i.
   subroutine output_step(self, t_out, y, error)
      class(erk_integrator), intent(inout) :: self
      real(wp), intent(in) :: t_out !! within the last internal step [s]
      real(wp), contiguous, intent(out) :: y(:) !! (n_states)
      type(error_type), allocatable, intent(out) :: error

      real(wp) :: h
      logical :: ok
      integer :: i, j

      h = t_out - self%t_before
      do i = 1, size(self%b)
         y(:) = self%y_before
         do j = 1, i - 1
            if (abs(self%a(j, i)) > 0.0_wp) y(:) = y + (h*self%a(j, i))*self%rates(:, j)
         end do
         self%data%n_rhs = self%data%n_rhs + 1
         call self%system%rhs(self%t_before + self%c(i)*h, y, self%rates(:, i), ok)
         if (.not. ok) then
            call raise(error, 'output at t = '//time_text(t_out)//' s: the right-hand side failed')
            return
         end if
      end do
      y(:) = self%y_before
      do i = 1, size(self%b)
         if (abs(self%b(i)) > 0.0_wp) y(:) = y + (h*self%b(i))*self%rates(:, i)
      end do
      associate (first => self%system%n_controlled + 1)
         if (self%system%has_quadratures()) call integrate_quadratures(self, t_out, self%rates(first:, :), y(first:))
      end associate
      if (.not. all_finite(y)) call raise(error, 'output at t = '//time_text(t_out)//' s: the state is not finite')
   end subroutine output_step

   !> Counts of the whole run.
   function statistics(self) result(stats)
      class(erk_integrator), intent(inout) :: self
      type(solver_statistics) :: stats

      integer(c_long) :: count(1)
      real(c_double) :: step(1)

      stats = self%before_restart
      stats%n_steps = self%n_steps
      stats%n_starts = self%n_starts
      stats%last_order = self%order
      if (.not. c_associated(self%memory)) return
      stats%n_rhs = self%data%n_rhs
      if (FERKStepGetNumErrTestFails(self%memory, count) == ARK_SUCCESS) then
         stats%n_error_test_failures = stats%n_error_test_failures + count(1)
      end if
      if (FERKStepGetLastStep(self%memory, step) == ARK_SUCCESS) then
         if (abs(step(1)) > 0.0_wp) stats%last_step = step(1)
      end if
   end function statistics

   !> Release every handle, in the reverse order of their creation.
   subroutine finalize(self)
      class(erk_integrator), intent(inout) :: self
      integer(c_int) :: flag

      if (c_associated(self%memory)) call FERKStepFree(self%memory)
      self%memory = c_null_ptr
      call free_nvector(self%state)
      if (c_associated(self%context)) flag = FSUNContext_Free(self%context)
      self%context = c_null_ptr
      if (associated(self%data)) deallocate (self%data)
      nullify (self%system, self%monitor)
   end subroutine finalize

   subroutine finalize_handles(self)
      type(erk_integrator), intent(inout) :: self
      call self%finalize()
   end subroutine finalize_handles

   !> Add what the right-hand side had to say.
   subroutine name_cause(self, error)
      class(erk_integrator), intent(in) :: self
      type(error_type), intent(inout) :: error
      if (self%data%not_finite) then
         error%message = error%message//'; the right-hand side was not finite at t = '//time_text(self%data%t_refused)//' s'
      else if (self%data%refused) then
         error%message = error%message//'; the right-hand side could not be evaluated at t = '// &
            time_text(self%data%t_refused)//' s'
      end if
   end subroutine name_cause

   !> A negative return code becomes a message that names the call, the time and the code.
   subroutine check(error, flag, call_name, t)
      type(error_type), allocatable, intent(inout) :: error
      integer(c_int), intent(in) :: flag
      character(len=*), intent(in) :: call_name
      real(wp), intent(in), optional :: t !! [s]

      if (flag < 0_c_int) call raise_return_code(error, flag, flag_name(int(flag, c_long)), call_name, t)
   end subroutine check

end module rodyn_erk_integrator
