!> Where in a step of a one-step method an event function becomes negative.
!>
!> A step is looked at in a few inner points of its cubic interpolant; what seems to be an event there, or is one at the
!> end, is then found by regula falsi (Illinois) and bisection on states as accurate as the steps themselves, to the
!> resolution of time. A function that becomes negative and positive again between two of these points is not seen; a shorter
!> max_step sees more.
module rodyn_event_search
   use rodyn_kinds, only: wp
   use rodyn_integrator, only: integrator_type
   implicit none (type, external)
   private
   public :: find_event

   integer, parameter :: n_looks = 4         !! points at which a step is looked at, its end included
   integer, parameter :: most_trials = 100

contains

   !> Find the first event of a step from t0 to t1. `integrator%margin` holds the functions at t0, and, without an event, at
   !> t1 afterwards; with one, `crossed` says which. Memory: y of the caller's.
   subroutine find_event(integrator, t0, y0, f0, t1, y1, f1, found, t, y)
      class(integrator_type), intent(inout) :: integrator
      real(wp), intent(in) :: t0, t1                     !! [s]
      real(wp), contiguous, intent(in) :: y0(:), y1(:)   !! states
      real(wp), contiguous, intent(in) :: f0(:), f1(:)   !! and their rates
      logical, intent(out) :: found
      real(wp), intent(out) :: t                         !! of the event: the first time known to be behind it [s]
      real(wp), contiguous, intent(inout) :: y(:)        !! state there
      real(wp) :: high(size(integrator%margin))
      logical :: ok
      integer :: i

      found = .false.
      do i = 1, n_looks
         t = t0 + (t1 - t0)*(real(i, wp)/n_looks)
         if (i == n_looks) then
            t = t1
            y = y1
         else
            call interpolate(real(i, wp)/n_looks, t1 - t0, y0, f0, y1, f1, y)
         end if
         call integrator%system%event_functions(t, y, high)
         if (.not. any(crosses(integrator%margin, high))) cycle
         if (i < n_looks) then
            call integrator%state_within(t, y, ok)
            if (.not. ok) cycle
            call integrator%system%event_functions(t, y, high)
            if (.not. any(crosses(integrator%margin, high))) cycle
         end if
         call close_in(integrator, t0, integrator%margin, t, high, y)
         integrator%crossed = crosses(integrator%margin, high)
         found = .true.
         return
      end do
      integrator%margin(:) = high
   end subroutine find_event

   !> Did the functions become negative?
   elemental logical function crosses(before, after)
      real(wp), intent(in) :: before, after
      crosses = before > 0.0_wp .and. after <= 0.0_wp
   end function crosses

   !> Shrink the bracket (low, t] of the first crossing until time cannot tell its ends apart.
   subroutine close_in(integrator, t0, at_start, t, high, y)
      class(integrator_type), intent(inout) :: integrator
      real(wp), intent(in) :: t0, at_start(:)
      real(wp), intent(inout) :: t       !! upper end
      real(wp), intent(inout) :: high(:) !! functions there
      real(wp), contiguous, intent(inout) :: y(:) !! state there
      real(wp), dimension(size(high)) :: low, here
      real(wp) :: t_low, t_try, share, width, weight
      real(wp) :: y_try(size(y))
      logical :: ok
      integer :: i, last_side

      t_low = t0
      low = at_start
      weight = 1.0_wp
      last_side = 0
      do i = 1, most_trials
         width = t - t_low
         if (width <= 8.0_wp*spacing(max(abs(t), abs(t0)))) return
         share = step_share(at_start, low, high, weight)
         if (mod(i, 4) == 0) share = 0.5_wp ! never worse than bisection by more than a factor
         t_try = t_low + width*share
         t_try = min(max(t_try, t_low + 0.3_wp*spacing(t)), t)
         if (t_try <= t_low .or. t_try >= t) t_try = t_low + 0.5_wp*width
         if (t_try <= t_low .or. t_try >= t) return
         call integrator%state_within(t_try, y_try, ok)
         if (.not. ok) return
         call integrator%system%event_functions(t_try, y_try, here)
         if (any(crosses(at_start, here))) then
            t = t_try
            high(:) = here
            y(:) = y_try
            weight = merge(0.5_wp*weight, 1.0_wp, last_side == 1)
            last_side = 1
         else
            t_low = t_try
            low = here
            weight = merge(2.0_wp*weight, 1.0_wp, last_side == -1)
            last_side = -1
         end if
      end do
   end subroutine close_in

   !> Share of the bracket that regula falsi steps over, for the function that crosses first. Illinois: the end that stays
   !> has less weight each time.
   pure real(wp) function step_share(at_start, low, high, weight)
      real(wp), intent(in) :: at_start(:), low(:), high(:), weight
      real(wp) :: share
      integer :: i

      step_share = 1.0_wp
      do i = 1, size(low)
         if (.not. crosses(at_start(i), high(i))) cycle
         share = weight*abs(low(i))/(weight*abs(low(i)) + abs(high(i)) + tiny(1.0_wp))
         step_share = min(step_share, share)
      end do
      step_share = min(max(step_share, 0.01_wp), 0.99_wp)
   end function step_share

   !> Cubic of Hermite.
   pure subroutine interpolate(x, h, y0, f0, y1, f1, y)
      real(wp), intent(in) :: x !! share of the step
      real(wp), intent(in) :: h !! step [s]
      real(wp), intent(in) :: y0(:), f0(:), y1(:), f1(:)
      real(wp), intent(out) :: y(:)
      y = (1.0_wp - x)**2*((1.0_wp + 2.0_wp*x)*y0 + (x*h)*f0) + x**2*((3.0_wp - 2.0_wp*x)*y1 - ((1.0_wp - x)*h)*f1)
   end subroutine interpolate

end module rodyn_event_search
