!> Integrals over a step by the rates at its ends, in its middle and in those of the steps before it.
!>
!> Newton's interpolation, nearest points first: each point adds a term to the integral. Where rates are smooth for the steps, terms
!> fall off, and the last ones say how much is missing; where they are not, the terms do not fall off. So a peak within one step
!> cannot go unseen beside a smooth past.
module rodyn_quadrature_history
   use rodyn_kinds, only: wp
   use rodyn_ode, only: n_quadratures
   implicit none (type, external)
   private
   public :: quadrature_history

   integer, parameter :: most = 13   !! points: six steps, and the start of the first
   integer, parameter :: fewest = 6  !! of them to judge by
   real(wp), parameter :: share = 1.0e-3_wp !! of the tolerance: there are thousands of steps, whose errors may add up

   !> Gauss's rule of eight points on [0, 1], which integrates all polynomials up to degree 15 (Abramowitz & Stegun 25.4.30).
   real(wp), parameter :: half_point(4) = 0.5_wp*[0.1834346424956498_wp, 0.5255324099163290_wp, 0.7966664774136267_wp, &
                                                  0.9602898564975363_wp]
   real(wp), parameter :: half_weight(4) = 0.5_wp*[0.3626837833783620_wp, 0.3137066458778873_wp, 0.2223810344533745_wp, &
                                                   0.1012285362903763_wp]
   real(wp), parameter :: point(8) = [0.5_wp - half_point, 0.5_wp + half_point], weight(8) = [half_weight, half_weight]

   !> What is known of the last steps, the newest point first.
   type :: quadrature_history
      private
      integer :: n = 0
      real(wp) :: t(most) = 0.0_wp                   !! [s]
      real(wp) :: rate(n_quadratures, most) = 0.0_wp
   contains
      procedure :: begin
      procedure :: add
      procedure :: integrate
   end type quadrature_history

contains

   !> Forget all; the first step begins here.
   pure subroutine begin(self, t, rate)
      class(quadrature_history), intent(inout) :: self
      real(wp), intent(in) :: t !! [s]
      real(wp), intent(in) :: rate(n_quadratures)
      self%n = 1
      self%t(1) = t
      self%rate(:, 1) = rate
   end subroutine begin

   !> A step more.
   pure subroutine add(self, t_middle, middle, t_end, last)
      class(quadrature_history), intent(inout) :: self
      real(wp), intent(in) :: t_middle, t_end !! [s]
      real(wp), dimension(n_quadratures), intent(in) :: middle, last !! rates there
      integer :: i

      self%n = min(self%n + 2, most)
      do i = self%n, 3, -1
         self%t(i) = self%t(i - 2)
         self%rate(:, i) = self%rate(:, i - 2)
      end do
      self%t(1:2) = [t_end, t_middle]
      self%rate(:, 1) = last
      self%rate(:, 2) = middle
   end subroutine add

   !> Integrals over the last step, with as many points as it takes.
   pure subroutine integrate(self, tolerance, value, off, ok)
      class(quadrature_history), intent(in) :: self
      real(wp), intent(in) :: tolerance
      real(wp), dimension(n_quadratures), intent(out) :: value, off !! and the estimated error
      logical, intent(out) :: ok !! false: too large for so few points or so much of a change
      real(wp) :: c(n_quadratures, most) ! divided differences
      real(wp) :: x(most), product(8), step
      real(wp), dimension(n_quadratures) :: term, before
      integer :: i, j

      step = self%t(1) - self%t(3)
      product = 1.0_wp
      value = 0.0_wp
      term = 0.0_wp
      ok = .false.
      do j = 1, self%n
         x(j) = (self%t(j) - self%t(3))/step
         c(:, j) = self%rate(:, j)
         do i = 1, j - 1
            c(:, j) = (c(:, j) - c(:, i))/(x(j) - x(i))
         end do
         before = abs(term)
         term = step*sum(weight*product)*c(:, j)
         value = value + term
         off = abs(term) + before ! the fourth term vanishes by symmetry: one says nothing
         ok = j >= fewest .and. maxval(off) <= max(share*tolerance, 8.0_wp*epsilon(1.0_wp)*step*maxval(abs(self%rate(:, 2))))
         if (ok) exit
         product = product*(point - x(j))
      end do
   end subroutine integrate

end module rodyn_quadrature_history
