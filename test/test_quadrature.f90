!> Gauss rules, rod integrals, sine and cosine.
module test_quadrature
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type
   use rodyn_quadrature, only: gauss_rule, new_gauss_rule
   use rodyn_rod_integrals, only: rod_integrals, new_rod_integrals
   use rodyn_trigonometry, only: sine_cosine
   use test_random_scenes, only: seed_random, uniform
   use test_testing, only: unittest, new_test, check, check_close
   implicit none (type, external)
   private
   public :: collect_quadrature

contains

   subroutine collect_quadrature(suite)
      type(unittest), allocatable, intent(out) :: suite(:)
      suite = [new_test('gauss rule is exact to degree 2n-1 for n = 1..20', test_exactness), &
               new_test('gauss rule misses degree 2n', test_inexactness), &
               new_test('gauss rule of 1000 points is symmetric, ordered, positive and sums to 1', test_large_rule), &
               new_test('rod integrals equal their closed forms', test_closed_forms), &
               new_test('rod integrals of a tapered rod equal exact ones', test_tapered_rod), &
               new_test('sine and cosine are within an ulp of quadruple precision', test_sine_cosine), &
               new_test('sine and cosine of large and special angles equal the library', test_large_angles)]
   end subroutine collect_quadrature

   subroutine test_exactness(error)
      type(error_type), allocatable, intent(out) :: error
      type(gauss_rule) :: rule
      integer :: n, degree

      do n = 1, 20
         call new_gauss_rule(rule, n)
         do degree = 0, 2*n - 1
            call check_close(error, sum(rule%weights*rule%points**degree), 1.0_wp/(degree + 1), 8*epsilon(1.0_wp), &
                             'integral of a monomial')
            if (allocated(error)) return
         end do
      end do
   end subroutine test_exactness

   !> The error for x^(2n) on [0, 1] is (n!)^4/((2n + 1) ((2n)!)^2), known and not small: exactness above is no accident.
   subroutine test_inexactness(error)
      type(error_type), allocatable, intent(out) :: error
      type(gauss_rule) :: rule
      real(wp) :: missing
      integer :: n

      do n = 1, 8
         call new_gauss_rule(rule, n)
         missing = gamma(n + 1.0_wp)**4/((2*n + 1)*gamma(2*n + 1.0_wp)**2)
         call check_close(error, 1.0_wp/(2*n + 1) - sum(rule%weights*rule%points**(2*n)), missing, 8*epsilon(1.0_wp), &
                          'error for x^(2n)')
         if (allocated(error)) return
      end do
   end subroutine test_inexactness

   subroutine test_large_rule(error)
      type(error_type), allocatable, intent(out) :: error
      type(gauss_rule) :: rule
      integer, parameter :: n = 1000

      call new_gauss_rule(rule, n)
      call check_close(error, rule%points, 1.0_wp - rule%points(n:1:-1), 2*epsilon(1.0_wp), 'symmetry')
      if (allocated(error)) return
      call check(error, all(rule%points(2:) > rule%points(:n - 1)) .and. all(rule%weights > 0.0_wp), 'order and sign')
      if (allocated(error)) return
      call check_close(error, sum(rule%weights), 1.0_wp, 1.0e-13_wp, 'sum of weights')
   end subroutine test_large_rule

   !> docs/model.md sec. 3, uniform rod.
   subroutine test_closed_forms(error)
      type(error_type), allocatable, intent(out) :: error
      type(gauss_rule) :: rule
      type(rod_integrals) :: i
      real(wp), parameter :: m = 1.7_wp, l = 1.3_wp
      integer :: n

      do n = 4, 12
         call new_gauss_rule(rule, n)
         i = new_rod_integrals(l, [spread(m, 1, n)], rule)
         call check_close(error, [i%m0, i%m1, i%m2, i%a1, i%b1, i%sa, i%sb, i%aa, i%bb, i%ab], &
                          [m*l, m*l**2/2, m*l**3/3, m*l**2/12, -m*l**2/12, m*l**3/30, -m*l**3/20, m*l**3/105, &
                           m*l**3/105, -m*l**3/140], 8*epsilon(1.0_wp), 'integrals')
         if (allocated(error)) return
      end do
   end subroutine test_closed_forms

   !> m(s) = 1 + s on a rod of length 1: integrals of polynomials by hand.
   subroutine test_tapered_rod(error)
      type(error_type), allocatable, intent(out) :: error
      type(gauss_rule) :: rule
      type(rod_integrals) :: i

      call new_gauss_rule(rule, 5)
      i = new_rod_integrals(1.0_wp, 1.0_wp + rule%points, rule)
      call check_close(error, [i%m0, i%m1, i%m2, i%a1, i%b1, i%aa], &
                       [1.5_wp, 1.0_wp/2 + 1.0_wp/3, 1.0_wp/3 + 1.0_wp/4, 1.0_wp/12 + 1.0_wp/30, -1.0_wp/12 - 1.0_wp/20, &
                        1.0_wp/105 + 1.0_wp/280], 8*epsilon(1.0_wp), 'integrals')
   end subroutine test_tapered_rod

   subroutine test_sine_cosine(error)
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: qp = selected_real_kind(30), n = 4000
      real(wp) :: x(n), s(n), c(n), ulps
      real(wp), parameter :: pi = acos(-1.0_wp)
      integer :: i, k

      call seed_random(1)
      do k = 0, 8
         x = [(uniform(-1.0_wp, 1.0_wp), i=1, n)]*min(4.9e5_wp, 0.7_wp*6.0_wp**k)
         x(1:100) = [(0.5_wp*pi*(i - 50), i=1, 100)]
         call sine_cosine(n, x, s, c)
         do i = 1, n
            ulps = max(ulps_off(s(i), sin(real(x(i), qp))), ulps_off(c(i), cos(real(x(i), qp))))
            call check(error, ulps < 1.0_wp, 'more than one unit in the last place off')
            if (allocated(error)) return
         end do
      end do

   contains

      pure real(wp) function ulps_off(value, exact)
         real(wp), intent(in) :: value
         real(qp), intent(in) :: exact
         ulps_off = real(abs(real(value, qp) - exact), wp)/max(spacing(real(exact, wp)), tiny(1.0_wp))
      end function ulps_off

   end subroutine test_sine_cosine

   subroutine test_large_angles(error)
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: x(6) = [1.0e6_wp, -3.0e9_wp, 0.0_wp, -0.0_wp, 1.0e-300_wp, 7.0_wp]
      real(wp) :: s(6), c(6)

      call sine_cosine(6, x, s, c)
      call check_close(error, s, sin(x), epsilon(1.0_wp), 'sine')
      if (allocated(error)) return
      call check_close(error, c, cos(x), epsilon(1.0_wp), 'cosine')
   end subroutine test_large_angles

end module test_quadrature
