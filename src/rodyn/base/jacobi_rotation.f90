!> Jacobi's rotations, which make elements of a symmetric matrix zero, or columns of any matrix orthogonal, one by one (Golub &
!> Van Loan, Matrix Computations, sec. 8.5).
module rodyn_jacobi_rotation
   use rodyn_kinds, only: wp
   implicit none (type, external)
   private
   public :: jacobi_rotation, rotate_columns, rotate_rows

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

end module rodyn_jacobi_rotation
