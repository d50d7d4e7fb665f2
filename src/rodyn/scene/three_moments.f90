!> The three-moment equation of massless rods in series with hinges, docs/model.md sec. 5.
!>
!> A massless rod with end moments -T_{k-1}, +T_k bends by
!>     alpha_k = -(f11 T_{k-1} + f12 T_k),   beta_k = f12 T_{k-1} + f22 T_k,   T_n = 0
!> (f of `rodyn_rod_bending`; f11 = f22 = 2 f12 = l/3EI of a uniform rod), so the joint rotations th obey
!> th_k + beta_k - alpha_{k+1} = opening_k - gamma_k. With T = C th this is
!>     (I + F C) th = opening - gamma,   F tridiagonal, symmetric, positive definite:
!> constant, and factored once. A free hinge (C = 0) needs no exception. Where a damper makes the moment T_k the
!> unknown and th_k a given state, column k is that of T instead: F in place of I + F C.
module rodyn_three_moments
   use rodyn_kinds, only: wp
   implicit none (type, external)
   private
   public :: three_moments, new_three_moments, slopes_from_moments

   !> LU factors of I + F C. Scaling of its columns makes it symmetric and positive definite, so no pivoting is
   !> needed.
   type :: three_moments
      integer :: n = 0
      real(wp), allocatable :: lower(:) !! multipliers (1:n-1)
      real(wp), allocatable :: pivot(:) !! reciprocal pivots (0:n-1)
      real(wp), allocatable :: upper(:) !! superdiagonal (0:n-2)
      real(wp), allocatable :: flexibility(:, :) !! f11, f12, f22 of the rods (3, 1:n) [1/(N m)]
   contains
      procedure :: solve
      procedure :: solve_transposed
   end type three_moments

contains

   !> Build and factor.
   pure subroutine new_three_moments(series, stiffness, flexibility, given)
      type(three_moments), intent(out) :: series
      real(wp), intent(in) :: stiffness(0:) !! C (0:n-1) [N m/rad]
      real(wp), intent(in) :: flexibility(:, :) !! f11, f12, f22 of the rods (3, 1:n) [1/(N m)]
      logical, intent(in) :: given(0:)      !! th_k is given and T_k unknown (0:n-1)
      real(wp) :: diagonal, factor(0:size(flexibility, 2) - 1)
      integer :: k, n

      n = size(flexibility, 2)
      series%n = n
      series%flexibility = flexibility
      factor = merge(1.0_wp, stiffness, given)
      allocate (series%lower(n - 1), series%pivot(0:n - 1), series%upper(0:n - 2))
      do k = 0, n - 1
         diagonal = merge(0.0_wp, 1.0_wp, given(k)) + flexibility(1, k + 1)*factor(k)
         if (k > 0) diagonal = diagonal + flexibility(3, k)*factor(k)
         if (k > 0) then
            series%lower(k) = flexibility(2, k)*factor(k - 1)*series%pivot(k - 1)
            diagonal = diagonal - series%lower(k)*series%upper(k - 1)
         end if
         if (k < n - 1) series%upper(k) = flexibility(2, k + 1)*factor(k + 1)
         series%pivot(k) = 1.0_wp/diagonal
      end do
   end subroutine new_three_moments

   !> x <- (I + F C)^-1 x.
   pure subroutine solve(self, x)
      class(three_moments), intent(in) :: self
      real(wp), intent(inout) :: x(0:self%n - 1)
      integer :: k

      do k = 1, self%n - 1
         x(k) = x(k) - self%lower(k)*x(k - 1)
      end do
      x(self%n - 1) = x(self%n - 1)*self%pivot(self%n - 1)
      do k = self%n - 2, 0, -1
         x(k) = (x(k) - self%upper(k)*x(k + 1))*self%pivot(k)
      end do
   end subroutine solve

   !> x <- (I + C F)^-1 x.
   pure subroutine solve_transposed(self, x)
      class(three_moments), intent(in) :: self
      real(wp), intent(inout) :: x(0:self%n - 1)
      integer :: k

      x(0) = x(0)*self%pivot(0)
      do k = 1, self%n - 1
         x(k) = (x(k) - self%upper(k - 1)*x(k - 1))*self%pivot(k)
      end do
      do k = self%n - 2, 0, -1
         x(k) = x(k) - self%lower(k + 1)*x(k + 1)
      end do
   end subroutine solve_transposed

   !> Slopes at the ends of the rods under the moments T(0:n-1), T_n = 0.
   pure subroutine slopes_from_moments(self, moment, alpha, beta)
      class(three_moments), intent(in) :: self
      real(wp), intent(in) :: moment(0:)    !! T (0:n-1) [N m]
      real(wp), intent(out) :: alpha(:)     !! (n) [rad]
      real(wp), intent(out) :: beta(:)      !! (n) [rad]
      real(wp) :: outer
      integer :: k

      do k = 1, self%n
         outer = 0.0_wp
         if (k < self%n) outer = moment(k)
         associate (f => self%flexibility(:, k))
            alpha(k) = -f(1)*(moment(k - 1) + f(2)/f(1)*outer)
            beta(k) = f(3)*(f(2)/f(3)*moment(k - 1) + outer)
         end associate
      end do
   end subroutine slopes_from_moments

end module rodyn_three_moments
