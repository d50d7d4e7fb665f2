!> ARKODE's ERKStep: explicit Runge-Kutta pairs of order 2 to 8, adaptive or with a fixed step.
!>
!> ARKODE interpolates to order 5 at most, which is too coarse for an order-8 step. An output inside a step is
!> therefore computed by one shorter step of the same method from the start of that step: as accurate as the
!> steps themselves, at one step's cost per output, and the steps never change.
!>
!> The tables are SUNDIALS' own (`rodyn_erk_tableau`). Fehlberg's error estimate is blind to pure quadratures, y' = f(t), such as a
!> motion that loads alone drive; so order 6 is the default, the highest of those that see everything. Quadratures behind the states
!> have an estimate of their own. A right-hand side that cannot be evaluated ends an ERKStep run at once, without trying a shorter
!> step.
module rodyn_erk_integrator
   use, intrinsic :: iso_c_binding, only: c_ptr, c_int, c_long, c_double, c_null_ptr, c_associated, c_f_pointer, c_loc, c_funloc
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type, raise
   use rodyn_text, only: time_text
   use rodyn_ode, only: ode_system, n_quadratures
   use rodyn_integrator, only: solver_options, solver_statistics, tightened
   use rodyn_quadrature_refinement, only: quadrature_refinement
   use rodyn_step_grid, only: step_grid
   use rodyn_erk_tableau, only: load_table, copy_with_errors, first_same_as_last, default_order
   use rodyn_sundials_base, only: callback_data, rhs_shim, weights_shim, all_finite, check
   use rodyn_sundials_integrator, only: sundials_integrator
   use rodyn_sundials_interface, only: N_Vector, silence_erkstep
   use farkode_mod, only: ARK_SUCCESS, ARK_ONE_STEP, FARKodeButcherTable_Free
   use farkode_erkstep_mod, only: FERKStepCreate, FERKStepReInit, FERKStepFree, FERKStepEvolve, FERKStepSetTable, &
      FERKStepSetUserData, FERKStepWFtolerances, FERKStepSetMaxStep, FERKStepSetStopTime, &
      FERKStepSetFixedStep, FERKStepSetInterpolantDegree, FERKStepGetNumErrTestFails, FERKStepGetLastStep, &
      FERKStepSetPostprocessStepFn
   implicit none (type, external)
   private
   public :: erk_integrator, new_erk_integrator

   real(wp), parameter :: shorter = 0.56_wp !! steps than ARKODE would make with the user's tolerances

   type, extends(sundials_integrator) :: erk_integrator
      private
      integer :: order = 0
      real(wp), allocatable :: a(:, :)        !! (stages, stages): a(j, i) multiplies rate j in stage i
      real(wp), allocatable :: b(:), c(:)     !! (stages)
      real(wp), allocatable :: b_error(:)     !! less those of the embedded method (stages)
      real(wp), allocatable :: b_doubt(:)     !! of a second look at errors of quadratures, see `second_look` (stages)
      real(wp), allocatable :: rates(:, :)    !! of the stages of an output step (n_states, stages)
      real(wp), allocatable :: power(:, :)    !! rates of the quadratures in the stages of the last step (n_quadratures, stages)
      real(wp) :: quadrature_error(n_quadratures) = 0.0_wp !! of the last step, or output step
      type(quadrature_refinement) :: refinement
      type(step_grid) :: grid                 !! fixed steps
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
   end type erk_integrator

contains

   !> Create an integrator for `system`, which must outlive it.
   subroutine new_erk_integrator(self, system, options, error)
      type(erk_integrator), intent(out) :: self
      class(ode_system), target, intent(inout) :: system
      type(solver_options), intent(in) :: options
      type(error_type), allocatable, intent(out) :: error

      self%order = options%order
      if (self%order == 0) self%order = default_order
      call self%create(system, options, tightened(options, shorter, merge(8, self%order, self%order >= 7)), system%n_states, &
                       'ERKStepEvolve', error)
   end subroutine new_erk_integrator

   subroutine begin(self, t, error)
      class(erk_integrator), intent(inout) :: self
      real(wp), intent(in) :: t !! [s]
      type(error_type), allocatable, intent(inout) :: error
      integer(c_int), parameter :: interpolant_degree = 3_c_int !! no evaluations of its own

      if (self%system%n_events > 0) call rates_now(self, error) ! for the first look into a step
      if (allocated(error)) return
      self%data%next_rate = self%rate
      self%data%next_awaited = .false.
      if (self%initialized) then ! the first step is chosen again
         call check(error, FERKStepReInit(self%memory, c_funloc(rhs_shim), t, self%state), 'ERKStepReInit', t)
         return
      end if
      self%memory = FERKStepCreate(c_funloc(rhs_shim), t, self%state, self%context)
      if (.not. c_associated(self%memory)) then
         call raise(error, 'ERKStepCreate: out of memory')
         return
      end if
      associate (memory => self%memory)
         call check(error, silence_erkstep(memory), 'ERKStepSetErrHandlerFn')
         call check(error, FERKStepSetUserData(memory, c_loc(self%data)), 'ERKStepSetUserData')
         call check(error, FERKStepWFtolerances(memory, c_funloc(weights_shim)), 'ERKStepWFtolerances')
         call check(error, FERKStepSetInterpolantDegree(memory, interpolant_degree), 'ERKStepSetInterpolantDegree')
         if (.not. allocated(error)) call choose_table(self, error)
         if (allocated(error)) return
         if (.not. first_same_as_last(self%a, self%b)) &
            call check(error, FERKStepSetPostprocessStepFn(memory, c_funloc(note_step)), 'ERKStepSetPostprocessStepFn')
         if (self%options%max_step > 0.0_wp) &
            call check(error, FERKStepSetMaxStep(memory, self%options%max_step), 'ERKStepSetMaxStep')
      end associate
   end subroutine begin

   !> Give ERKStep the table of the chosen order, and keep a copy for the outputs.
   subroutine choose_table(self, error)
      class(erk_integrator), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error

      type(c_ptr) :: address

      call load_table(self%order, address, error)
      if (allocated(error)) return
      call copy_with_errors(address, self%a, self%b, self%c, self%b_error, self%b_doubt)
      allocate (self%rates(self%system%n_states, size(self%b)))
      if (self%system%has_quadratures()) allocate (self%power(n_quadratures, size(self%b)), &
                                                   self%data%recent(n_quadratures, size(self%b)), source=0.0_wp)
      call check(error, FERKStepSetTable(self%memory, address), 'ERKStepSetTable')
      call FARKodeButcherTable_Free(address)
   end subroutine choose_table

   !> ARKPostProcessFn that leaves the state alone. The next call of the right-hand side is at this new state: at once, or, by
   !> newer versions of SUNDIALS, when the next step begins.
   function note_step(t, y, user_data) result(flag) bind(c)
      real(c_double), intent(in), value :: t
      type(N_Vector), intent(in) :: y
      type(c_ptr), intent(in), value :: user_data
      integer(c_int) :: flag
      type(callback_data), pointer :: data
      associate (u1 => t, u2 => y); end associate
      call c_f_pointer(user_data, data)
      data%last_stage = data%latest
      data%next_awaited = .true.
      flag = 0_c_int
   end function note_step

   subroutine set_library_stop(self, error)
      class(erk_integrator), intent(inout) :: self
      type(error_type), allocatable, intent(inout) :: error
      call check(error, FERKStepSetStopTime(self%memory, self%t_stop), 'ERKStepSetStopTime', self%t_good)
      if (.not. allocated(error)) call self%grid%lay(self%t_good, self%t_stop, self%options%fixed_step, error)
   end subroutine set_library_stop

   subroutine evolve(self, t_reached, error)
      class(erk_integrator), intent(inout) :: self
      real(wp), intent(out) :: t_reached !! [s]
      type(error_type), allocatable, intent(inout) :: error
      real(c_double) :: t(1)

      t = self%t_good
      if (self%grid%n > 0) call check(error, FERKStepSetFixedStep(self%memory, self%grid%next_end() - self%t_good), &
                                      'ERKStepSetFixedStep', self%t_good)
      t_reached = t(1)
      if (allocated(error)) return
      call check(error, FERKStepEvolve(self%memory, self%t_stop, self%state, t, ARK_ONE_STEP), 'ERKStepEvolve', self%t_good)
      t_reached = t(1)
   end subroutine evolve

   subroutine complete_step(self, error)
      class(erk_integrator), intent(inout) :: self
      type(error_type), allocatable, intent(inout) :: error
      self%grid%i = self%grid%i + 1
      if (self%system%has_quadratures()) call add_quadratures(self)
      if (self%system%n_events > 0) call self%look_for_event(error)
   end subroutine complete_step

   !> Quadratures at the end of the last internal step, from the rates in its stages.
   subroutine add_quadratures(self)
      class(erk_integrator), intent(inout) :: self
      integer :: i, j, n
      logical :: same

      n = size(self%b)
      same = first_same_as_last(self%a, self%b) ! then no step is noted: the last call is the last stage and at the new state
      if (same) self%data%last_stage = self%data%latest
      if (self%data%next_awaited) self%rate(:) = self%data%next_rate
      self%power(:, 1) = self%rate
      do j = 2, n
         associate (call => modulo(self%data%last_stage - 1 - (n - j), n) + 1)
            do i = 1, n_quadratures
               self%power(i, j) = self%data%recent(i, call)
            end do
         end associate
      end do
      if (same) then
         self%rate(:) = self%data%recent(:, self%data%latest)
      else if (.not. self%data%next_awaited) then
         self%rate(:) = self%data%next_rate
      end if
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

   subroutine rates_at_ends(self, error)
      class(erk_integrator), intent(inout) :: self
      type(error_type), allocatable, intent(inout) :: error
      self%f_before(:) = self%f_after
      call rates_now(self, error)
   end subroutine rates_at_ends

   subroutine rates_now(self, error)
      class(erk_integrator), intent(inout) :: self
      type(error_type), allocatable, intent(inout) :: error
      logical :: ok
      call self%system%rhs(self%t_good, self%y_good, self%f_after, ok)
      self%data%n_rhs = self%data%n_rhs + 1
      if (.not. ok) call raise(error, 'erk at t = '//time_text(self%t_good)//' s: the right-hand side cannot be evaluated')
   end subroutine rates_now

   !> For `rodyn_event_search`.
   subroutine state_within(self, t, y, ok)
      class(erk_integrator), intent(inout) :: self
      real(wp), intent(in) :: t
      real(wp), contiguous, intent(out) :: y(:)
      logical, intent(out) :: ok
      type(error_type), allocatable :: error
      call self%output(t, y, error)
      ok = .not. allocated(error)
   end subroutine state_within

   !> y(t) by one step of the table from the start of the last internal step:
   !> k_i = f(t + c_i h, y + h sum_j a_ij k_j),  y(t + h) = y + h sum_i b_i k_i.
   subroutine output(self, t, y, error)
      class(erk_integrator), intent(inout) :: self
      real(wp), intent(in) :: t !! [s]
      real(wp), contiguous, intent(out) :: y(:) !! (n_states)
      type(error_type), allocatable, intent(inout) :: error

      real(wp) :: h
      logical :: ok
      integer :: i, j

      h = t - self%t_before
      do i = 1, size(self%b)
         y(:) = self%y_before
         do j = 1, i - 1
            if (abs(self%a(j, i)) > 0.0_wp) y(:) = y + (h*self%a(j, i))*self%rates(:, j)
         end do
         self%data%n_rhs = self%data%n_rhs + 1
         call self%system%rhs(self%t_before + self%c(i)*h, y, self%rates(:, i), ok)
         if (.not. ok) then
            call raise(error, 'output at t = '//time_text(t)//' s: the right-hand side failed')
            return
         end if
      end do
      y(:) = self%y_before
      do i = 1, size(self%b)
         if (abs(self%b(i)) > 0.0_wp) y(:) = y + (h*self%b(i))*self%rates(:, i)
      end do
      associate (first => self%system%n_controlled + 1)
         if (self%system%has_quadratures()) call integrate_quadratures(self, t, self%rates(first:, :), y(first:))
      end associate
      if (.not. all_finite(y)) call raise(error, 'output at t = '//time_text(t)//' s: the state is not finite')
   end subroutine output

   !> Counts of the whole run.
   function statistics(self) result(stats)
      class(erk_integrator), intent(inout) :: self
      type(solver_statistics) :: stats

      integer(c_long) :: count(1)
      real(c_double) :: step(1)

      stats = self%counts_of_steps()
      stats%last_order = self%order
      if (.not. self%initialized) return
      if (FERKStepGetNumErrTestFails(self%memory, count) == ARK_SUCCESS) then
         stats%n_error_test_failures = stats%n_error_test_failures + count(1)
      end if
      if (FERKStepGetLastStep(self%memory, step) == ARK_SUCCESS) then
         if (abs(step(1)) > 0.0_wp) stats%last_step = step(1)
      end if
   end function statistics

   subroutine free_memory(self)
      class(erk_integrator), intent(inout) :: self
      if (c_associated(self%memory)) call FERKStepFree(self%memory)
      self%memory = c_null_ptr
   end subroutine free_memory

   subroutine finalize_handles(self)
      type(erk_integrator), intent(inout) :: self
      call self%finalize()
   end subroutine finalize_handles

end module rodyn_erk_integrator
