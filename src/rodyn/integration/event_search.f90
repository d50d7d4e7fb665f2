!> Where in a step of a one-step method an event function becomes negative.
!>
!> A step is looked at in a few inner points of its cubic interpolant; what seems to be an event there, or is one at the
!> end, is then found by regula falsi (Illinois) and bisection on states as accurate as the steps themselves, to the
!> resolution of time. A function that is low between its neighbours may be negative nearby and positive again at the next
!> point: its minimum is sought, on the interpolant first, and, where that cannot exclude a crossing, on accurate states.
!> Functions must have at most one minimum from one point to the next but one, as those of motions that the steps resolve have.
!> What is left unseen is less than a hundred-millionth of what the curvature of a function makes in a step.
module rodyn_event_search
   use rodyn_kinds, only: wp
   use rodyn_integrator, only: integrator_type
   implicit none (type, external)
   private
   public :: find_event

   integer, parameter :: n_looks = 4             !! points at which a step is looked at, its end included
   integer, parameter :: most_trials = 100
   real(wp), parameter :: probe = 1.0e-4_wp      !! share of a step from its ends at which a slope is looked for
   real(wp), parameter :: nearby = 0.25_wp       !! the interpolant is off by less than this part of what changes in a step
   real(wp), parameter :: safety = 8.0_wp        !! and by less than so many times what it is off at a minimum
   integer, parameter :: most_narrowings = 12    !! of the bracket of a minimum
   real(wp), parameter :: small = 1.0e-3_wp      !! part of a bracket that is not worth another point
   real(wp), parameter :: idle = 1.0e-3_wp       !! a minimum that would fall by less than this part of itself stays positive

   !> The step that is searched, and the last place in it that was looked at.
   type :: searched_step
      class(integrator_type), pointer :: integrator => null()
      real(wp) :: t = 0.0_wp, h = 0.0_wp !! start and length [s]
      real(wp), dimension(:), pointer, contiguous :: y0 => null(), f0 => null(), y1 => null(), f1 => null() !! ends: states, rates
      real(wp) :: share = 0.0_wp         !! of the step, up to the place
      real(wp), allocatable :: y(:)      !! state there
      real(wp), allocatable :: values(:) !! functions there
      logical :: ok = .true.             !! the state there could be computed
   end type searched_step

contains

   !> Find the first event of a step from t0 to t1. `integrator%margin` holds the functions at t0, and, without an event, at
   !> t1 afterwards; with one, `crossed` says which. Memory: y of the caller's.
   subroutine find_event(integrator, t0, y0, f0, t1, y1, f1, found, t, y)
      class(integrator_type), target, intent(inout) :: integrator
      real(wp), intent(in) :: t0, t1                           !! [s]
      real(wp), contiguous, target, intent(in) :: y0(:), y1(:) !! states
      real(wp), contiguous, target, intent(in) :: f0(:), f1(:) !! and their rates
      logical, intent(out) :: found
      real(wp), intent(out) :: t                         !! of the event: the first time known to be behind it [s]
      real(wp), contiguous, intent(inout) :: y(:)        !! state there
      real(wp) :: high(size(integrator%margin)), values(size(integrator%margin), 0:n_looks)
      type(searched_step) :: step
      logical :: ok
      integer :: i, last

      found = .false.
      last = n_looks
      values(:, 0) = integrator%margin
      do i = 1, n_looks
         t = t0 + (t1 - t0)*(real(i, wp)/n_looks)
         if (i == n_looks) then
            t = t1
            y = y1
         else
            call interpolate(real(i, wp)/n_looks, t1 - t0, y0, f0, y1, f1, y)
         end if
         call integrator%system%event_functions(t, y, high)
         values(:, i) = high
         if (.not. any(crosses(integrator%margin, high))) cycle
         if (i < n_looks) then
            call integrator%state_within(t, y, ok)
            if (.not. ok) cycle
            call integrator%system%event_functions(t, y, high)
            values(:, i) = high
            if (.not. any(crosses(integrator%margin, high))) cycle
         end if
         found = .true.
         last = i
         exit
      end do
      if (any(may_dip(values(:, :last)))) then
         step%integrator => integrator
         step%t = t0
         step%h = t1 - t0
         step%y0 => y0
         step%f0 => f0
         step%y1 => y1
         step%f1 => f1
         call find_dip(step, values(:, :last), found, t, high, y)
      end if
      if (found) then
         call close_in(integrator, t0, integrator%margin, t, high, y)
         integrator%crossed = crosses(integrator%margin, high)
      else
         integrator%margin(:) = high
      end if
   end subroutine find_event

   !> Which functions may have crossed zero and come back between points where they are positive? A minimum between three
   !> points is at most an eighth of their second difference below the middle one; there is room for four times that.
   pure function may_dip(values)
      real(wp), intent(in) :: values(:, 0:) !! functions at the points of a step
      logical :: may_dip(size(values, 1))
      may_dip = values(:, 0) > 0.0_wp .and. 2.0_wp*minval(values, dim=2) <= maxval(values, dim=2) .and. &
                minval(values, dim=2) < maxval(values, dim=2)
   end function may_dip

   !> Seek such a crossing before the last point. If there is one, it takes the place of what was found.
   subroutine find_dip(step, values, found, t, high, y)
      type(searched_step), intent(inout) :: step
      real(wp), intent(in) :: values(:, 0:)            !! functions at the points, the first one of an event last
      logical, intent(inout) :: found
      real(wp), intent(inout) :: t                     !! upper end of a bracket of the event [s]
      real(wp), intent(inout) :: high(:)               !! functions there
      real(wp), contiguous, intent(inout) :: y(:)      !! state there
      real(wp) :: x(0:n_looks + 2), v(size(values, 1), 0:n_looks + 2)
      logical :: candidate(size(values, 1))
      integer :: i, j, last

      allocate (step%y(size(y)), step%values(size(high)))
      last = ubound(values, 2)
      candidate = may_dip(values)
      x(:last) = [(real(i, wp)/n_looks, i=0, last)]
      v(:, :last) = values
      if (any(candidate .and. v(:, 0) <= v(:, 1))) call insert(step, 1, probe, x, v, last) ! does it fall first?
      if (.not. found .and. any(candidate .and. v(:, last) <= v(:, last - 1))) &
         call insert(step, last, 1.0_wp - probe, x, v, last)
      do i = 1, last - 1
         do j = 1, size(candidate)
            if (.not. candidate(j) .or. v(j, i) > min(v(j, i - 1), v(j, i + 1))) cycle
            if (.not. dips(step, j, x(i - 1:i + 1), v(j, i - 1:i + 1), maxval(values(j, :)) - minval(values(j, :)))) cycle
            found = .true.
            t = step%t + step%share*step%h
            high = step%values
            y = step%y
            return
         end do
      end do
   end subroutine find_dip

   !> One more point, on the interpolant.
   subroutine insert(step, place, new, x, v, last)
      type(searched_step), intent(inout) :: step
      integer, intent(in) :: place                  !! of the new point among the others
      real(wp), intent(in) :: new                   !! share of the step
      real(wp), intent(inout) :: x(0:), v(:, 0:)    !! points; functions there
      integer, intent(inout) :: last                !! index of the last point
      x(place + 1:last + 1) = x(place:last)
      v(:, place + 1:last + 1) = v(:, place:last)
      x(place) = new
      call look(step, new)
      v(:, place) = step%values
      last = last + 1
   end subroutine insert

   !> All functions on the interpolant.
   subroutine look(step, at)
      type(searched_step), intent(inout) :: step
      real(wp), intent(in) :: at !! share of the step
      call interpolate(at, step%h, step%y0, step%f0, step%y1, step%f1, step%y)
      call step%integrator%system%event_functions(step%t + at*step%h, step%y, step%values)
   end subroutine look

   !> One of them on a state as accurate as the steps.
   subroutine measure(step, which, at, value)
      type(searched_step), intent(inout) :: step
      integer, intent(in) :: which
      real(wp), intent(in) :: at     !! share of the step
      real(wp), intent(out) :: value !! huge, if there is no such state
      step%share = at
      call step%integrator%state_within(step%t + at*step%h, step%y, step%ok)
      if (step%ok) call step%integrator%system%event_functions(step%t + at*step%h, step%y, step%values)
      value = merge(step%values(which), huge(1.0_wp), step%ok)
   end subroutine measure

   !> Is this function negative near its minimum inside a bracket? Then the step has been looked at there.
   logical function dips(step, which, ends, at_ends, change)
      type(searched_step), intent(inout) :: step
      integer, intent(in) :: which
      real(wp), intent(in) :: ends(3), at_ends(3) !! bracket and its middle; functions there
      real(wp), intent(in) :: change              !! of the function in the step
      real(wp) :: a(3), f(3), off, curvature, reach
      integer :: k

      dips = .false.
      a = ends
      f = at_ends
      curvature = bend(a, f)
      if (.not. curvature > 0.0_wp) return
      call descend(step, which, a, f)
      if (f(2) > nearby*change) return
      off = f(2)
      call measure(step, which, a(2), f(2))
      dips = f(2) <= 0.0_wp
      off = abs(f(2) - off)
      if (dips .or. .not. step%ok .or. f(2) > safety*off) return
      ! The minimum is where the interpolant has risen by less than it may be off, here and there.
      reach = sqrt(4.0_wp*safety*off/curvature)
      a([1, 3]) = [max(ends(1), a(2) - reach), min(ends(3), a(2) + reach)]
      if (.not. (a(1) < a(2) .and. a(2) < a(3))) return
      do k = 1, 3, 2
         call measure(step, which, a(k), f(k))
         dips = f(k) <= 0.0_wp
         if (dips .or. .not. step%ok) return
      end do
      dips = falls_below_zero(step, which, a, f)
   end function dips

   !> Narrow a bracket down to the minimum of a function on the interpolant.
   subroutine descend(step, which, a, f)
      type(searched_step), intent(inout) :: step
      integer, intent(in) :: which
      real(wp), intent(inout) :: a(3), f(3) !! bracket and its middle; the function there
      real(wp) :: trial
      integer :: k
      do k = 1, most_narrowings
         trial = vertex(a, f)
         if (abs(trial - a(2)) <= small*(a(3) - a(1))) return
         call look(step, trial)
         call narrow(a, f, trial, step%values(which))
      end do
   end subroutine descend

   !> The same on accurate states, until the function is negative or its minimum is known to be positive.
   logical function falls_below_zero(step, which, ends, at_ends)
      type(searched_step), intent(inout) :: step
      integer, intent(in) :: which
      real(wp), intent(in) :: ends(3), at_ends(3) !! bracket and its middle; the function there
      real(wp) :: a(3), f(3), trial, value
      integer :: k

      falls_below_zero = .false.
      a = ends
      f = at_ends
      do k = 1, most_narrowings
         if (f(2) > min(f(1), f(3))) return ! its minimum is not in the bracket
         trial = vertex(a, f)
         if (abs(trial - a(2)) <= small*(a(3) - a(1))) return
         if (0.5_wp*bend(a, f)*(trial - a(2))**2 < idle*f(2)) return
         call measure(step, which, trial, value)
         falls_below_zero = value <= 0.0_wp
         if (falls_below_zero .or. .not. step%ok) return
         call narrow(a, f, trial, value)
      end do
   end function falls_below_zero

   !> Second derivative of the parabola through three points.
   pure real(wp) function bend(x, f)
      real(wp), intent(in) :: x(3), f(3)
      bend = 2.0_wp*((f(1) - f(2))/(x(2) - x(1)) + (f(3) - f(2))/(x(3) - x(2)))/(x(3) - x(1))
   end function bend

   !> Where it is lowest; the middle one is the lowest of the points.
   pure real(wp) function vertex(x, f)
      real(wp), intent(in) :: x(3), f(3)
      real(wp) :: curvature, slope ! at the middle point
      curvature = bend(x, f)
      slope = (f(3) - f(2))/(x(3) - x(2)) - 0.5_wp*curvature*(x(3) - x(2))
      vertex = x(2)
      if (curvature > 0.0_wp) vertex = min(max(x(2) - slope/curvature, x(1)), x(3))
   end function vertex

   !> Take a new point into a bracket.
   pure subroutine narrow(x, f, new, at_new)
      real(wp), intent(inout) :: x(3), f(3)
      real(wp), intent(in) :: new, at_new
      integer :: side

      side = merge(1, 3, new < x(2)) ! on which the new point is
      if (at_new <= f(2)) then
         x(4 - side) = x(2)
         f(4 - side) = f(2)
         x(2) = new
         f(2) = at_new
      else
         x(side) = new
         f(side) = at_new
      end if
   end subroutine narrow

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
