!> Parent of our own one-step methods: steps that end on a grid or are chosen, sums of time and state with compensation (Kahan), so
!> that a million steps lose no more digits than one, quadratures that are refined where a step is too long for them, and outputs
!> inside a step, which are computed apart and never change the steps.
module rodyn_one_step_integrator
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type, raise
   use rodyn_text, only: time_text
   use rodyn_ode, only: ode_system, n_quadratures
   use rodyn_integrator, only: stepping_integrator, solver_options, solver_statistics
   use rodyn_quadrature_refinement, only: quadrature_refinement
   use rodyn_step_grid, only: step_grid
   implicit none (type, external)
   private
   public :: one_step_integrator

   type, abstract, extends(stepping_integrator) :: one_step_integrator
      character(len=6) :: name = ''      !! of the method, for messages
      type(solver_options) :: inner      !! tolerances of a step
      real(wp) :: t = 0.0_wp             !! end of the last step [s]
      real(wp) :: t_lost = 0.0_wp        !! what rounding took from t so far [s]
      real(wp) :: t_before = 0.0_wp      !! start of the last step [s]
      real(wp) :: h = 0.0_wp             !! next step [s]
      type(step_grid) :: grid            !! fixed steps
      real(wp), allocatable :: lost(:)   !! what rounding took from the state so far (n_states)
      real(wp), allocatable :: y_before(:)  !! state at t_before (n_states)
      real(wp), allocatable :: increment(:) !! of the state in a step (n_states)
      real(wp) :: quadrature_error(n_quadratures) = 0.0_wp !! in the last step
      type(quadrature_refinement) :: refinement
      type(solver_statistics) :: counts
   contains
      procedure :: create
      procedure :: begin
      procedure :: change_step
      procedure :: move_time
      procedure :: quadrature_limit
      procedure :: refine_quadratures
      procedure :: cannot_step
      procedure :: statistics
      procedure :: finalize
   end type one_step_integrator

contains

   !> For `new_...` of each method.
   subroutine create(self, system, options, inner, name, order)
      class(one_step_integrator), intent(inout) :: self
      class(ode_system), target, intent(inout) :: system !! must outlive the integrator
      type(solver_options), intent(in) :: options, inner !! the user's; with the tolerances of a step
      character(len=*), intent(in) :: name
      integer, intent(in) :: order

      self%system => system
      self%options = options
      self%inner = inner
      self%name = name
      self%counts%last_order = order
      associate (n => system%n_states)
         allocate (self%lost(n), self%y_before(n), self%increment(n), source=0.0_wp)
      end associate
   end subroutine create

   !> First start, or exact restart, for `start` of each method.
   subroutine begin(self, t, y, error)
      class(one_step_integrator), intent(inout) :: self
      real(wp), intent(in) :: t    !! [s]
      real(wp), intent(in) :: y(:) !! (n_states)
      type(error_type), allocatable, intent(out) :: error

      call self%begin_interval(t, y, error)
      if (allocated(error)) return
      self%t = t
      self%t_before = t
      self%t_lost = 0.0_wp
      if (.not. self%goes_on) self%lost = 0.0_wp
      call self%grid%lay(t, self%t_stop, self%options%fixed_step, error)
   end subroutine begin

   !> Choose the next step. A step cut short by the stop time says little about it.
   subroutine change_step(self, h, factor, t_new)
      class(one_step_integrator), intent(inout) :: self
      real(wp), intent(in) :: h      !! the last step [s]
      real(wp), intent(in) :: factor !! by which the error of the next one allows to change it
      real(wp), intent(in) :: t_new  !! end of the last step [s]
      if (t_new < self%t_stop .or. h*factor > self%h) self%h = h*factor
      if (self%options%max_step > 0.0_wp) self%h = min(self%h, self%options%max_step)
   end subroutine change_step

   !> Go to the end of an accepted step.
   subroutine move_time(self, h, t_new)
      class(one_step_integrator), intent(inout) :: self
      real(wp), intent(in) :: h, t_new !! [s]
      self%t_before = self%t
      self%t_lost = (t_new - self%t) - (h - self%t_lost)
      if (t_new >= self%t_stop .or. self%grid%n > 0) self%t_lost = 0.0_wp
      self%t = t_new
      self%t_good = t_new
      self%grid%i = self%grid%i + 1
      self%counts%last_step = h
   end subroutine move_time

   !> The error that the quadratures of a step from y may have; any in fixed steps, in which the motion has no tolerance either.
   real(wp) function quadrature_limit(self, y)
      class(one_step_integrator), intent(in) :: self
      real(wp), intent(in) :: y(:)
      real(wp) :: values(n_quadratures)

      quadrature_limit = huge(1.0_wp)
      if (self%grid%n > 0) return
      associate (m => self%system%n_controlled)
         values = y(m + 1:) + self%increment(m + 1:)
      end associate
      quadrature_limit = self%system%quadrature_tolerance(self%options%rtol, self%options%atol, values)
   end function quadrature_limit

   !> Integrate the quadratures of a step again, by shorter steps.
   subroutine refine_quadratures(self, t, h, y, tolerance, ok)
      class(one_step_integrator), intent(inout) :: self
      real(wp), intent(in) :: t, h      !! start and length of the step [s]
      real(wp), intent(in) :: y(:)      !! at its start
      real(wp), intent(in) :: tolerance !! of the quadratures
      logical, intent(out) :: ok        !! false: shorter steps cannot follow the motion; all is as it was
      integer :: n_steps
      associate (m => self%system%n_controlled)
         call self%refinement%refine(self%system, t, y, t + h, self%inner%rtol, self%inner%atol, tolerance, &
                                     self%increment(m + 1:), self%quadrature_error, self%counts%n_rhs, n_steps, ok)
      end associate
      call self%count_as_steps(n_steps)
   end subroutine refine_quadratures

   !> No way on from t.
   subroutine cannot_step(self, why, error)
      class(one_step_integrator), intent(in) :: self
      character(len=*), intent(in) :: why
      type(error_type), allocatable, intent(out) :: error
      call raise(error, trim(self%name)//' at t = '//time_text(self%t)//' s: '//why)
   end subroutine cannot_step

   !> Counts over the whole run.
   function statistics(self) result(stats)
      class(one_step_integrator), intent(inout) :: self
      type(solver_statistics) :: stats
      stats = self%counts
      stats%n_steps = self%n_steps
      stats%n_starts = self%n_starts
   end function statistics

   !> Nothing is held outside Fortran.
   subroutine finalize(self)
      class(one_step_integrator), intent(inout) :: self
      nullify (self%system, self%monitor)
   end subroutine finalize

end module rodyn_one_step_integrator
