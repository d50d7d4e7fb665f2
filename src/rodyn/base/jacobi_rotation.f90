!> Jacobi's rotations, which make elements of a symmetric matrix zero, or columns of any matrix orthogonal, one by one (Golub &
!> Van Loan, Matrix Computations, sec. 8.5 and 8.6.3).
module rodyn_jacobi_rotation
   use rodyn_kinds, only: wp
   implicit none (type, external)
   private
   public :: jacobi_rotation, rotate_columns, rotate_rows, orthogonalise_columns

contains

   !> Cosine and sine of the smaller rotation of rows and columns i and j of a symmetric matrix after which h_ij is zero.
   pure subroutine jacobi_rotation(h_ii, h_jj, h_ij, c, s)
      real(wp), intent(in) :: h_ii, h_jj, h_ij !! h_ij is not zero
      real(wp), intent(out) :: c, s
      real(wp) :: theta, large, t

      theta = 0.5_wp*(h_jj - h_ii)/h_ij
      large = min(abs(theta), 1.0e100_wp) ! its square is a number, and the angle beyond is none
      t = sign(1.0_wp, theta)/(large + sqrt(1.0_wp + large**2))
      c = 1.0_wp/sqrt(1.0_wp + t**2)
      s = t*c
   end subroutine jacobi_rotation

   !> Columns i and j become c x_i - s x_j and s x_i + c x_j.
   pure subroutine rotate_columns(x, i, j, c, s)
      real(wp), contiguous, intent(inout) :: x(:, :)
      integer, intent(in) :: i, j
      real(wp), intent(in) :: c, s
      real(wp) :: before
      integer :: k
      !$omp simd private(before)
      do k = 1, size(x, 1)
         before = x(k, i)
         x(k, i) = c*before - s*x(k, j)
         x(k, j) = s*before + c*x(k, j)
      end do
   end subroutine rotate_columns

   !> Rows likewise.
   pure subroutine rotate_rows(x, i, j, c, s)
      real(wp), contiguous, intent(inout) :: x(:, :)
      integer, intent(in) :: i, j
      real(wp), intent(in) :: c, s
      real(wp) :: before
      integer :: k
      do k = 1, size(x, 2)
         before = x(i, k)
         x(i, k) = c*before - s*x(j, k)
         x(j, k) = s*before + c*x(j, k)
      end do
   end subroutine rotate_rows

   !> Rotate columns of x until the parts b_i in its first m rows are (nearly) orthogonal, all other rows along with them.
   !>
   !> Pairs are taken as in a tournament in which each column plays each other: no rotation of a round waits for another one. What
   !> a sweep leaves is about the square of what it found, so that the last one need not be looked at (where squares are nearly
   !> equal it may be more: up to the root of `negligible`).
   pure subroutine orthogonalise_columns(x, m, smallest, negligible, squares)
      real(wp), contiguous, intent(inout) :: x(:, :)
      integer, intent(in) :: m
      real(wp), intent(in) :: smallest     !! columns with a smaller square need no precision
      real(wp), intent(in) :: negligible   !! b_i.b_j, of the smaller square
      real(wp), intent(out) :: squares(:)  !! |b_i|^2, followed through the rotations (columns)
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
   end subroutine orthogonalise_columns

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

end module rodyn_jacobi_rotation
