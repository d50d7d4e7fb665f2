!> Gauss-Legendre quadrature of any order.
module rodyn_quadrature
   use rodyn_kinds, only: wp
   implicit none (type, external)
   private
   public :: gauss_rule, new_gauss_rule, composite_rule

   !> Points and weights on [0, 1]; exact for polynomials up to degree 2 n - 1.
   type :: gauss_rule
      real(wp), allocatable :: points(:)  !! abscissae, increasing (n)
      real(wp), allocatable :: weights(:) !! positive, sum 1 (n)
   end type gauss_rule

   !> The roots crowd at the ends, where the weights lose digits like n^2: they are computed with more of them.
   integer, parameter :: ep = max(wp, selected_real_kind(precision(1.0_wp) + 3))
   real(ep), parameter :: pi = acos(-1.0_ep)

contains

   !> The rule of `n_points` >= 1 points: the roots of the Legendre polynomial P_n by Newton's method from
   !> Tricomi's estimate (Abramowitz & Stegun 22.16.6, 25.4.29), one half by symmetry.
   pure subroutine new_gauss_rule(rule, n_points)
      type(gauss_rule), intent(out) :: rule
      integer, intent(in) :: n_points !! >= 1
      real(ep) :: x, step, value, slope
      integer :: i, n

      n = n_points
      allocate (rule%points(n), rule%weights(n))
      do i = 1, (n + 1)/2
         x = cos(pi*(i - 0.25_ep)/(n + 0.5_ep))
         if (2*i == n + 1) x = 0.0_ep
         do ! quadratic convergence: the step after one below sqrt(epsilon) is at rounding level
            call legendre(n, x, value, slope)
            step = value/slope
            x = x - step
            if (abs(step) < sqrt(epsilon(x))) exit
         end do
         call legendre(n, x, value, slope)
         rule%points(i) = real(0.5_ep*(1.0_ep - x), wp)
         rule%points(n + 1 - i) = real(0.5_ep*(1.0_ep + x), wp)
         rule%weights(i) = real(1.0_ep/((1.0_ep - x*x)*slope**2), wp)
         rule%weights(n + 1 - i) = rule%weights(i)
      end do
   end subroutine new_gauss_rule

   !> The rule on every piece between neighbouring breaks: exact for what is a polynomial on each of them.
   pure function composite_rule(rule, breaks) result(whole)
      type(gauss_rule), intent(in) :: rule
      real(wp), intent(in) :: breaks(:) !! rising from 0 to 1
      type(gauss_rule) :: whole
      integer :: i, n

      n = size(rule%points)
      allocate (whole%points(n*(size(breaks) - 1)), whole%weights(n*(size(breaks) - 1)))
      do i = 1, size(breaks) - 1
         associate (from => breaks(i), width => breaks(i + 1) - breaks(i))
            whole%points((i - 1)*n + 1:i*n) = from + width*rule%points
            whole%weights((i - 1)*n + 1:i*n) = width*rule%weights
         end associate
      end do
   end function composite_rule

   !> P_n(x) and P_n'(x) by the three-term recurrence, |x| < 1.
   pure subroutine legendre(n, x, value, slope)
      integer, intent(in) :: n
      real(ep), intent(in) :: x
      real(ep), intent(out) :: value, slope
      real(ep) :: before, older
      integer :: j

      value = 1.0_ep
      before = 0.0_ep
      do j = 1, n
         older = before
         before = value
         value = ((2*j - 1)*x*before - (j - 1)*older)/j
      end do
      slope = n*(before - x*value)/(1.0_ep - x*x)
   end subroutine legendre

end module rodyn_quadrature
