!> Newton systems (1 - g J) x = r with a dense Jacobian, by LAPACK: for systems that know no better.
module rodyn_dense_newton
   use rodyn_kinds, only: wp
   use rodyn_lapack, only: dgetrf, dgetrs
   implicit none (type, external)
   private
   public :: dense_newton

   type :: dense_newton
      real(wp), allocatable :: jacobian(:, :) !! J at the last linearisation (n, n)
      real(wp), allocatable :: matrix(:, :)   !! LU factors of 1 - g J (n, n)
      integer, allocatable :: pivots(:)       !! (n)
   contains
      procedure :: reserve
      procedure :: factorise
      procedure :: solve
   end type dense_newton

contains

   !> Memory for n states; nothing happens the second time.
   subroutine reserve(self, n)
      class(dense_newton), intent(inout) :: self
      integer, intent(in) :: n
      if (allocated(self%jacobian)) return
      allocate (self%jacobian(n, n), self%matrix(n, n), self%pivots(n))
   end subroutine reserve

   !> LU factors of 1 - gamma J.
   subroutine factorise(self, gamma, ok)
      class(dense_newton), intent(inout) :: self
      real(wp), intent(in) :: gamma
      logical, intent(out) :: ok !! false: singular
      integer :: i, n, info

      n = size(self%pivots)
      self%matrix = -gamma*self%jacobian
      do i = 1, n
         self%matrix(i, i) = self%matrix(i, i) + 1.0_wp
      end do
      call dgetrf(n, n, self%matrix, n, self%pivots, info)
      ok = info == 0
   end subroutine factorise

   !> x <- (1 - gamma J)^-1 x. What is behind n elements is not touched.
   subroutine solve(self, x)
      class(dense_newton), intent(in) :: self
      real(wp), contiguous, intent(inout) :: x(:)
      integer :: info, n
      n = size(self%pivots)
      call dgetrs('N', n, 1, self%matrix, n, self%pivots, x, n, info)
   end subroutine solve

end module rodyn_dense_newton
