!> The Gauss collocation method of order 16 in numbers: 8 nodes, one for each lane.
!>
!> Source: Hairer, Norsett & Wanner, Solving ODEs I, sec. II.7, and Hairer & Wanner, Solving ODEs II, sec. IV.5.
!> Polynomials over a step are kept by their values at the nodes c_i; in shifted Legendre polynomials,
!>     f(x) = sum_j l_j(x) f_j,   l_j(x) = b_j sum_k (2 k + 1) P_k(c_j) P_k(x),   0 <= k < 8.
module rodyn_gauss_collocation
   use rodyn_kinds, only: wp
   use rodyn_lanes, only: s => lanes
   use rodyn_quadrature, only: gauss_rule, new_gauss_rule
   use rodyn_lane_algebra, only: expand
   use rodyn_lapack, only: dgeev
   implicit none (type, external)
   private
   public :: gauss_collocation, new_gauss_collocation, n_pairs

   integer, parameter :: n_pairs = s/2 !! eigenvalues of A are complex: pairs

   type :: gauss_collocation
      real(wp) :: c(s) = 0.0_wp             !! nodes in (0, 1)
      real(wp) :: b(s) = 0.0_wp             !! weights
      real(wp) :: a(s, s) = 0.0_wp          !! a(i, j): integral of l_j from 0 to c_i
      real(wp) :: a2(s, s) = 0.0_wp         !! A^2: twice integrated
      real(wp) :: coefficients(s, s) = 0.0_wp !! (k+1, j): node values to coefficients of P_k
      complex(wp) :: lambda(n_pairs) = 0.0_wp !! eigenvalues of A in the upper half plane
      real(wp) :: to_pairs(s, s) = 0.0_wp   !! node values to their parts along the eigenvectors of those: real, then imaginary
      real(wp) :: from_pairs(s, s) = 0.0_wp !! and back
      real(wp) :: projectors(s, s, 2*n_pairs) = 0.0_wp !! twice the real parts of the spectral projectors W_j of A, then
                                                    !! minus twice the imaginary parts: f(A) = sum 2 Re(f(lambda_j) W_j)
   contains
      procedure :: interpolation
      procedure :: mode_reply
   end type gauss_collocation

contains

   subroutine new_gauss_collocation(rule)
      type(gauss_collocation), intent(out) :: rule
      type(gauss_rule) :: gauss
      real(wp) :: p(0:s, s)
      integer :: i, j, k

      call new_gauss_rule(gauss, s)
      rule%c = gauss%points
      rule%b = gauss%weights
      do i = 1, s
         call shifted_legendre(rule%c(i), p(:, i))
      end do
      do j = 1, s
         do k = 0, s - 1
            rule%coefficients(k + 1, j) = (2*k + 1)*p(k, j)*rule%b(j)
         end do
         do i = 1, s ! (2 k + 1) times the integral of P_k from 0 to x is (P_{k+1} - P_{k-1})(x)/2
            rule%a(i, j) = rule%b(j)*(rule%c(i) + 0.5_wp*sum([(p(k, j)*(p(k + 1, i) - p(k - 1, i)), k=1, s - 1)]))
         end do
      end do
      rule%a2 = matmul(rule%a, rule%a)
      call decompose(rule)
   end subroutine new_gauss_collocation

   !> P_0..P_s of 2 x - 1.
   pure subroutine shifted_legendre(x, p)
      real(wp), intent(in) :: x
      real(wp), intent(out) :: p(0:s)
      integer :: k
      p(0) = 1.0_wp
      p(1) = 2.0_wp*x - 1.0_wp
      do k = 2, s
         p(k) = ((2*k - 1)*p(1)*p(k - 1) - (k - 1)*p(k - 2))/k
      end do
   end subroutine shifted_legendre

   !> Eigenvalues and projectors of A. LAPACK's small matrices cannot fail here: A is constant.
   subroutine decompose(rule)
      type(gauss_collocation), intent(inout) :: rule
      real(wp) :: matrix(s, s), wr(s), wi(s), vl(s, s), vr(s, s), work(8*s)
      complex(wp) :: left(s), right(s)
      integer :: info, i, j, pair

      matrix = rule%a
      call dgeev('V', 'V', s, matrix, s, wr, wi, vl, s, vr, s, work, size(work), info)
      pair = 0
      do j = 1, s
         if (wi(j) <= 0.0_wp) cycle
         pair = pair + 1
         rule%lambda(pair) = cmplx(wr(j), wi(j), wp)
         right = cmplx(vr(:, j), vr(:, j + 1), wp)
         left = conjg(cmplx(vl(:, j), vl(:, j + 1), wp))
         left = left/sum(left*right)
         rule%to_pairs(pair, :) = real(left, wp)
         rule%to_pairs(n_pairs + pair, :) = aimag(left)
         rule%from_pairs(:, pair) = 2.0_wp*real(right, wp)
         rule%from_pairs(:, n_pairs + pair) = -2.0_wp*aimag(right)
         do i = 1, s
            rule%projectors(:, i, pair) = 2.0_wp*real(right*left(i), wp)
            rule%projectors(:, i, n_pairs + pair) = -2.0_wp*aimag(right*left(i))
         end do
      end do
   end subroutine decompose

   !> Matrix that takes node values of one step to values at x_i = start + length c_i, in units of that step, of the
   !> polynomial through them or of its part up to `degree`.
   pure function interpolation(self, start, length, degree) result(matrix)
      class(gauss_collocation), intent(in) :: self
      real(wp), intent(in) :: start, length
      integer, intent(in), optional :: degree !! < s; absent: s - 1
      real(wp) :: matrix(s, s)
      real(wp) :: p(s, 0:s - 1), x(s)
      integer :: k, l, last

      last = s - 1
      if (present(degree)) last = degree
      x = 2.0_wp*(start + length*self%c) - 1.0_wp
      p(:, 0) = 1.0_wp
      p(:, 1) = x
      do k = 2, last
         !$omp simd
         do l = 1, s
            p(l, k) = ((2*k - 1)*x(l)*p(l, k - 1) - (k - 1)*p(l, k - 2))*(1.0_wp/k)
         end do
      end do
      matrix = 0.0_wp
      call expand(s, last + 1, s, self%coefficients, p, matrix)
   end function interpolation

   !> The real matrix (1 + x A + y A^2)^-1 - 1, by its values at the eigenvalues of A.
   pure subroutine mode_reply(self, x, y, matrix)
      class(gauss_collocation), intent(in) :: self
      real(wp), intent(in) :: x, y
      real(wp), intent(out) :: matrix(s, s)
      real(wp), dimension(n_pairs) :: real_part, imaginary_part, inverse_square
      real(wp) :: weight(2*n_pairs), column(s)
      integer :: i, j, l

      associate (re => real(self%lambda, wp), im => aimag(self%lambda))
         real_part = 1.0_wp + re*x + (re**2 - im**2)*y
         imaginary_part = im*x + 2.0_wp*re*im*y
      end associate
      inverse_square = 1.0_wp/(real_part**2 + imaginary_part**2)
      weight(:n_pairs) = real_part*inverse_square - 1.0_wp
      weight(n_pairs + 1:) = -imaginary_part*inverse_square
      do i = 1, s
         column = 0.0_wp
         do j = 1, 2*n_pairs
            !$omp simd
            do l = 1, s
               column(l) = column(l) + weight(j)*self%projectors(l, i, j)
            end do
         end do
         matrix(:, i) = column
      end do
   end subroutine mode_reply

end module rodyn_gauss_collocation
