!> Order of numbers, of columns of numbers, or of texts.
module rodyn_sorting
   use rodyn_kinds, only: wp
   implicit none (type, external)
   private
   public :: sorted_order

   !> Indices that sort, equal ones in the order in which they stand.
   interface sorted_order
      module procedure order_of_columns
      module procedure order_of_texts
   end interface sorted_order

contains

   !> Indices that sort the columns of `key`.
   pure function order_of_columns(key) result(order)
      real(wp), intent(in) :: key(:, :)
      integer, allocatable :: order(:)
      order = order_of(size(key, 2), key=key)
   end function order_of_columns

   !> Indices that sort texts.
   pure function order_of_texts(texts) result(order)
      character(len=*), intent(in) :: texts(:)
      integer, allocatable :: order(:)
      order = order_of(size(texts), texts=texts)
   end function order_of_texts

   !> Bottom-up merge sort, stable.
   pure function order_of(n, key, texts) result(order)
      integer, intent(in) :: n
      real(wp), intent(in), optional :: key(:, :)        !! what is sorted: columns
      character(len=*), intent(in), optional :: texts(:) !! or texts
      integer, allocatable :: order(:)
      integer :: other(n)
      integer :: width, low, middle, high, i, j, m

      order = [(i, i=1, n)]
      width = 1
      do while (width < n)
         do low = 1, n, 2*width
            middle = min(low + width, n + 1)
            high = min(low + 2*width, n + 1)
            i = low
            j = middle
            do m = low, high - 1
               if (takes_second()) then
                  other(m) = order(j)
                  j = j + 1
               else
                  other(m) = order(i)
                  i = i + 1
               end if
            end do
         end do
         order = other
         width = 2*width
      end do

   contains

      !> Does the next one come from the second half?
      pure logical function takes_second()
         takes_second = i >= middle
         if (i >= middle .or. j >= high) return
         if (present(texts)) then
            takes_second = texts(order(j)) < texts(order(i))
         else
            takes_second = precedes(key(:, order(j)), key(:, order(i)))
         end if
      end function takes_second

   end function order_of

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
