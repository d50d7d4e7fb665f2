!> Gragg's extrapolation as an integrator of the program, compiled with another wp: steps chosen as `dop853` chooses its own,
!> but outputs and the stop time are stepped to. Events are not looked for.
module rodyn_bench_gragg_integrator
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type, raise
   use rodyn_text, only: time_text
   use rodyn_ode, only: ode_system
   use rodyn_integrator, only: integrator_type, solver_statistics
   use rodyn_bench_extrapolation, only: smooth_system, extrapolated_step, order, evaluations
   implicit none (type, external)
   private
   public :: gragg_integrator

   !> The system in hand, as the extrapolation asks for it. What cannot be evaluated becomes a step that is refused.
   type, extends(smooth_system) :: running_system
      class(ode_system), pointer :: equations => null()
   contains
      procedure :: rates
   end type running_system

   type, extends(integrator_type) :: gragg_integrator
      type(running_system) :: running
      real(wp) :: t = 0.0_wp          !! [s]
      real(wp) :: h = 0.0_wp          !! next step [s]
      real(wp), allocatable :: y(:)   !! state at t (n_states)
      type(solver_statistics) :: counts
   contains
      procedure :: start
      procedure :: advance
      procedure :: statistics
      procedure :: finalize
   end type gragg_integrator

contains

   subroutine rates(self, t, y, rate)
      class(running_system), intent(inout) :: self
      real(wp), intent(in) :: t
      real(wp), contiguous, intent(in) :: y(:)
      real(wp), contiguous, intent(out) :: rate(:)
      logical :: ok
      call self%equations%rhs(t, y, rate, ok)
      if (.not. ok) rate = huge(1.0_wp)
   end subroutine rates

   subroutine start(self, t, y, error)
      class(gragg_integrator), intent(inout) :: self
      real(wp), intent(in) :: t
      real(wp), intent(in) :: y(:)
      type(error_type), allocatable, intent(out) :: error

      call self%begin_interval(t, y, error)
      if (allocated(error)) return
      self%running%equations => self%system
      self%t = t
      self%y = y
      self%h = 1.0e-6_wp*(self%t_stop - t)
      self%counts%last_order = order
   end subroutine start

   subroutine advance(self, t_out, y, t, error)
      class(gragg_integrator), intent(inout) :: self
      real(wp), intent(in) :: t_out
      real(wp), contiguous, intent(out) :: y(:)
      real(wp), intent(out) :: t
      type(error_type), allocatable, intent(out) :: error

      call self%check_target(t_out, error)
      do while (self%t < t_out .and. .not. allocated(error))
         call step(self, t_out, error)
      end do
      y = self%y
      t = self%t
   end subroutine advance

   !> Try steps until the error is below the tolerance. The last ones before t_out are made equal.
   subroutine step(self, t_out, error)
      class(gragg_integrator), intent(inout) :: self
      real(wp), intent(in) :: t_out
      type(error_type), allocatable, intent(out) :: error
      real(wp), dimension(size(self%y)) :: y, change
      real(wp) :: h, norm
      logical :: last

      do
         call self%permit_step(error)
         if (allocated(error)) return
         h = t_out - self%t
         last = h <= self%h
         if (.not. last) h = min(self%h, 0.5_wp*h)
         y = self%y
         call extrapolated_step(self%running, self%t, h, y, change)
         self%counts%n_rhs = self%counts%n_rhs + evaluations
         associate (scale => self%options%atol + self%options%rtol*max(abs(y), abs(self%y)))
            norm = sqrt(sum((change/scale)**2)/size(y))
         end associate
         if (.not. ieee_is_finite(norm)) norm = huge(1.0_wp)
         if (norm <= 1.0_wp) exit
         self%counts%n_error_test_failures = self%counts%n_error_test_failures + 1
         self%h = h*factor(norm)
         if (self%h <= spacing(self%t)) then
            call raise(error, 'gragg at t = '//time_text(self%t)//' s: no step is small enough')
            return
         end if
      end do
      self%t = merge(t_out, self%t + h, last)
      self%t_good = self%t
      self%y(:) = y
      if (.not. last .or. factor(norm) < 1.0_wp) self%h = h*factor(norm)
      self%counts%last_step = h
   end subroutine step

   !> By which the step may change.
   pure real(wp) function factor(norm)
      real(wp), intent(in) :: norm !! error in units of the tolerance
      factor = min(4.0_wp, 0.9_wp*max(norm, tiny(norm))**(-1.0_wp/(order - 1)))
      factor = max(0.2_wp, factor)
   end function factor

   function statistics(self) result(stats)
      class(gragg_integrator), intent(inout) :: self
      type(solver_statistics) :: stats
      stats = self%counts
      stats%n_steps = self%n_steps
      stats%n_starts = self%n_starts
   end function statistics

   subroutine finalize(self)
      class(gragg_integrator), intent(inout) :: self
      nullify (self%system, self%monitor, self%running%equations)
   end subroutine finalize

end module rodyn_bench_gragg_integrator
