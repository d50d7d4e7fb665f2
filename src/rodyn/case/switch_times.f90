!> Times at which something begins, ends or bends: loads, driven kinks, releases of hinges. A run stops at each and restarts.
!>
!> Times that differ by rounding only are one: 0.1 + 0.2 and 0.3, or t_start + (t_end - t_start) and t_end. Between them
!> nothing can happen, nor could any method step.
module rodyn_switch_times
   use rodyn_kinds, only: wp
   use rodyn_sorting, only: sorted_order
   implicit none (type, external)
   private
   public :: same_time, add_switches, united_time, interval_ends, middle_of, last_before

   !> Of a time: more than any sum or product of a few numbers is off, and more than the few units in the last place below
   !> which methods refuse to step.
   real(wp), parameter :: rounding = 16.0_wp*epsilon(1.0_wp)

contains

   !> Do two times differ by rounding only?
   elemental logical function same_time(a, b)
      real(wp), intent(in) :: a, b !! [s]
      same_time = abs(a - b) <= rounding*max(abs(a), abs(b))
   end function same_time

   !> Merge further times into a list. What stands in it stays; of new times that are one, the first stands for all.
   subroutine add_switches(switches, times)
      real(wp), allocatable, intent(inout) :: switches(:) !! increasing [s]
      real(wp), intent(in) :: times(:)                    !! in any order [s]
      real(wp), allocatable :: merged(:)
      integer, allocatable :: order(:)
      integer :: i, j, n

      allocate (merged(size(switches) + size(times)))
      order = sorted_order(reshape(times, [1, size(times)]))
      n = 0
      i = 1
      do j = 1, size(times)
         associate (t => times(order(j)))
            do while (i <= size(switches))
               if (switches(i) > t) exit
               call take(switches(i))
               i = i + 1
            end do
            if (n > 0) then
               if (same_time(merged(n), t)) cycle
            end if
            if (i <= size(switches)) then
               if (same_time(switches(i), t)) cycle
            end if
            call take(t)
         end associate
      end do
      switches = [merged(:n), switches(i:)]

   contains

      subroutine take(t)
         real(wp), intent(in) :: t
         n = n + 1
         merged(n) = t
      end subroutine take

   end subroutine add_switches

   !> The switch that a time is one with; the time itself if there is none.
   pure real(wp) function united_time(t, switches)
      real(wp), intent(in) :: t, switches(:) !! [s]
      integer :: i
      i = findloc(same_time(switches, t), .true., 1)
      united_time = t
      if (i > 0) united_time = switches(i)
   end function united_time

   !> Ends of the intervals of a run: the switches before its end, and its end [s].
   pure function interval_ends(switches, t_end) result(ends)
      real(wp), intent(in) :: switches(:), t_end !! [s]
      real(wp), allocatable :: ends(:)
      ends = [pack(switches, switches < t_end .and. .not. same_time(switches, t_end)), t_end]
   end function interval_ends

   !> A time between two neighbouring switches. It decides what holds there, since the rounding of times does not matter for it.
   pure real(wp) function middle_of(t_from, t_to)
      real(wp), intent(in) :: t_from, t_to !! [s]
      middle_of = t_from + 0.5_wp*(t_to - t_from)
   end function middle_of

   !> The last of the times of a table that is not after t; 1 if none is.
   pure integer function last_before(times, t) result(low)
      real(wp), intent(in) :: times(:)
      real(wp), intent(in) :: t
      integer :: high, middle

      low = 1
      high = size(times) + 1
      do while (high - low > 1)
         middle = (low + high)/2
         if (times(middle) <= t) then
            low = middle
         else
            high = middle
         end if
      end do
   end function last_before

end module rodyn_switch_times
