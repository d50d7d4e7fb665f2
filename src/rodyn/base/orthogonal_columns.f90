!> Rotations of the columns of a matrix after which they are (nearly) orthogonal: a singular value decomposition without its left
!> factor (Golub & Van Loan, Matrix Computations, sec. 8.6).
!>
!> Few columns are rotated in pairs, by Jacobi's one-sided method, which profits from columns that were orthogonal before the
!> matrix changed a little, and finds small columns as precisely as large ones. Of many, the eigenvectors of B^T B are faster;
!> where they are not precise enough, pairs have the last word.
module rodyn_orthogonal_columns
   use rodyn_kinds, only: wp
   use rodyn_lapack, only: dgemm, dsyevd
   use rodyn_jacobi_rotation, only: jacobi_rotation, rotate_columns
   implicit none (type, external)
   private
   public :: column_rotator

   integer, parameter :: many = 24 !! columns

   !> Memory.
   type :: column_rotator
      private
      real(wp), allocatable :: gram(:, :)    !! B^T B, then its eigenvectors (columns, columns)
      real(wp), allocatable :: rotated(:, :) !! (rows, columns)
      real(wp), allocatable :: work(:)
      integer, allocatable :: iwork(:)
   contains
      procedure :: orthogonalise
   end type column_rotator

contains

   !> Rotate columns of x until the parts b_i in its first m rows are orthogonal, all other rows along with them.
   subroutine orthogonalise(self, x, m, smallest, negligible, squares)
      class(column_rotator), intent(inout) :: self
      real(wp), contiguous, intent(inout) :: x(:, :)
      integer, intent(in) :: m
      real(wp), intent(in) :: smallest     !! columns with a smaller square need no precision
      real(wp), intent(in) :: negligible   !! b_i.b_j, of the smaller square
      real(wp), intent(out) :: squares(:)  !! |b_i|^2 (columns)
      real(wp) :: lost

      if (size(x, 2) >= many) then
         call rotate_together(self, x, m, squares, lost)
         if (lost <= negligible*max(smallest, minval(squares))) return
      end if
      call rotate_in_pairs(x, m, smallest, negligible, squares)
   end subroutine orthogonalise

   !> All columns at once.
   subroutine rotate_together(self, x, m, squares, lost)
      class(column_rotator), intent(inout) :: self
      real(wp), contiguous, intent(inout) :: x(:, :)
      integer, intent(in) :: m
      real(wp), intent(out) :: squares(:)
      real(wp), intent(out) :: lost !! products of columns that rounding may leave
      integer :: info

      lost = huge(1.0_wp)
      associate (n_rows => size(x, 1), n => size(x, 2))
         call reserve(self, n_rows, n)
         call dgemm('T', 'N', n, n, m, 1.0_wp, x, n_rows, x, n_rows, 0.0_wp, self%gram, n)
         call dsyevd('V', 'L', n, self%gram, n, squares, self%work, size(self%work), self%iwork, size(self%iwork), info)
         if (info /= 0) return
         call dgemm('N', 'N', n_rows, n, n, 1.0_wp, x, n_rows, self%gram, n, 0.0_wp, self%rotated, n_rows)
         x(:, :) = self%rotated
         lost = real(n, wp)*epsilon(1.0_wp)*squares(n)
      end associate
   end subroutine rotate_together

   subroutine reserve(self, n_rows, n)
      class(column_rotator), intent(inout) :: self
      integer, intent(in) :: n_rows, n

      if (allocated(self%rotated)) then
         if (all(shape(self%rotated) == [n_rows, n])) return
         deallocate (self%gram, self%rotated, self%work, self%iwork)
      end if
      allocate (self%gram(n, n), self%rotated(n_rows, n), self%work(1 + 6*n + 2*n**2), self%iwork(3 + 5*n))
   end subroutine reserve

   !> Pairs are taken as in a tournament in which each column plays each other: no rotation of a round waits for another one. What
   !> a sweep leaves is about the square of what it found, so that the last one need not be looked at (where squares are nearly
   !> equal it may be more: up to the root of `negligible`).
   pure subroutine rotate_in_pairs(x, m, smallest, negligible, squares)
      real(wp), contiguous, intent(inout) :: x(:, :)
      integer, intent(in) :: m
      real(wp), intent(in) :: smallest, negligible
      real(wp), intent(out) :: squares(:)  !! followed through the rotations
      integer, parameter :: most_sweeps = 12
      real(wp) :: product_ij, found, largest, c, s
      integer :: sweep, round, pair, n, others, i, j

      n = size(x, 2)
      others = n - 1 + modulo(n, 2) ! an odd column has nobody to play with, once
      do sweep = 1, most_sweeps
         do i = 1, n
            squares(i) = inner_product(m, x(:, i), x(:, i))
         end do
         largest = 0.0_wp
         do round = 0, others - 1
            do pair = 0, others/2
               i = 1 + modulo(round + pair, others)
               j = 1 + modulo(round - pair, others)
               if (pair == 0) j = others + 1
               if (j > n) cycle
               product_ij = inner_product(m, x(:, i), x(:, j))
               found = abs(product_ij)/max(smallest, min(squares(i), squares(j)), tiny(1.0_wp))
               if (found <= negligible) cycle
               largest = max(largest, found)
               call jacobi_rotation(squares(i), squares(j), product_ij, c, s)
               call rotate_columns(x, i, j, c, s)
               squares(i) = squares(i) - s/c*product_ij
               squares(j) = squares(j) + s/c*product_ij
            end do
         end do
         if (largest**2 <= negligible) return
      end do
   end subroutine rotate_in_pairs

   !> Sum of x_k y_k, in vectors.
   pure real(wp) function inner_product(m, x, y)
      integer, intent(in) :: m
      real(wp), intent(in) :: x(m), y(m)
      real(wp) :: total
      integer :: k
      total = 0.0_wp
      !$omp simd reduction(+:total)
      do k = 1, m
         total = total + x(k)*y(k)
      end do
      inner_product = total
   end function inner_product

end module rodyn_orthogonal_columns
