!> Order of numbers, or of rows of numbers.
module rodyn_sorting
   use rodyn_kinds, only: wp
   implicit none (type, external)
   private
   public :: sorted_order

contains

   !> Indices that sort the columns of `key` (bottom-up merge sort, stable).
   pure function sorted_order(key) result(order)
      real(wp), intent(in) :: key(:, :)
      integer, allocatable :: order(:)
      integer, allocatable :: other(:)
      integer :: n, width, low, middle, high, i, j, m

      n = size(key, 2)
      allocate (order(n), other(n))
      order = [(i, i=1, n)]
      width = 1
      do while (width < n)
         do low = 1, n, 2*width
            middle = min(low + width, n + 1)
            high = min(low + 2*width, n + 1)
            i = low
            j = middle
            do m = low, high - 1
               if (j >= high) then
                  other(m) = order(i)
                  i = i + 1
               else if (i >= middle) then
                  other(m) = order(j)
                  j = j + 1
               else if (precedes(key(:, order(j)), key(:, order(i)))) then
                  other(m) = order(j)
                  j = j + 1
               else
                  other(m) = order(i)
                  i = i + 1
               end if
            end do
         end do
         call swap(order, other)
         width = 2*width
      end do
   end function sorted_order

   pure subroutine swap(a, b)
      integer, allocatable, intent(inout) :: a(:), b(:)
      integer, allocatable :: c(:)
      call move_alloc(a, c)
      call move_alloc(b, a)
      call move_alloc(c, b)
   end subroutine swap

   !> Lexical order of two columns.
   pure logical function precedes(a, b)
      real(wp), intent(in) :: a(:), b(:)
      integer :: i
      precedes = .false.
      do i = 1, size(a)
         if (a(i) < b(i)) precedes = .true.
         if (a(i) /= b(i)) return
      end do
   end function precedes

end module rodyn_sorting
