!> How stiff modes answer residuals in a step of collocation: z = (1 + h A D + h^2 A^2 K)^-1 r - r at all nodes and modes at once.
!>
!> Modes that are not coupled answer each for itself, by a matrix over the nodes. Where dampers couple them, the equations are
!> solved for each eigenvalue lambda of A, the four pairs side by side in lanes. With K = square (1 - w G G^T) and
!> D = square G G^T (`rodyn_stiff_modes`, G the influences) that is
!>     Z = d + a square G G^T,   d = 1 + h^2 lambda^2 square,   a = h lambda - w h^2 lambda^2,
!> whose inverse needs that of a matrix over the dampers only (Sherman, Morrison & Woodbury):
!>     Z^-1 = d^-1 - d^-1 a square G S^-1 G^T d^-1,   S = 1 + G^T d^-1 a square G.
!> The first k rows and columns of S belong to a system in which springs of w times the strength stand for the other dampers. It
!> has a solution, so that elimination needs no search for pivots.
module rodyn_modal_reply
   use rodyn_kinds, only: wp
   use rodyn_lanes, only: s => lanes
   use rodyn_lane_algebra, only: combine, multiply, apply, expand
   use rodyn_gauss_collocation, only: gauss_collocation, n_pairs
   use rodyn_stiff_modes, only: stiff_modes
   implicit none (type, external)
   private
   public :: modal_reply

   !> In lanes of pairs the real parts are followed by the imaginary parts.
   type :: modal_reply
      private
      integer :: n = 0                           !! modes
      logical :: coupled = .false.               !! are they taken to be?
      real(wp), allocatable :: matrices(:, :, :) !! of each mode, not coupled (s, s, most)
      real(wp), allocatable :: inverse(:, :)     !! d^-1 (s, most)
      real(wp), allocatable :: factor(:, :)      !! a square d^-1 (s, most)
      real(wp), allocatable :: schur(:, :, :)    !! S^-1, (k, l) in its (l, k) (s, n_dampers, n_dampers)
      real(wp), allocatable :: parts(:, :), answers(:, :) !! workspace (s, most)
      real(wp), allocatable :: damper_rates(:, :), forces(:, :)  !! workspace (s, n_dampers)
   contains
      procedure :: prepare
      procedure :: answer
   end type modal_reply

contains

   !> For steps of length h, of modes that are coupled or not.
   subroutine prepare(self, rule, modes, h, coupled)
      class(modal_reply), intent(inout) :: self
      type(gauss_collocation), intent(in) :: rule
      type(stiff_modes), intent(in) :: modes
      real(wp), intent(in) :: h !! [s]
      logical, intent(in) :: coupled
      integer :: i

      self%n = modes%n
      self%coupled = coupled
      call reserve(self, size(modes%square), modes%n_dampers)
      if (self%coupled) then
         call couple(self, rule, modes, h)
      else
         do i = 1, modes%n
            call rule%mode_reply(h*modes%damping(i), h**2*modes%omega_2(i), self%matrices(:, :, i))
         end do
      end if
   end subroutine prepare

   !> Make room for so many modes and dampers, if that is not what there is.
   subroutine reserve(self, most, n_dampers)
      type(modal_reply), intent(inout) :: self
      integer, intent(in) :: most, n_dampers

      if (allocated(self%matrices)) then
         if (size(self%matrices, 3) == most .and. size(self%damper_rates, 2) == n_dampers) return
         deallocate (self%matrices, self%inverse, self%factor, self%schur, self%parts, self%answers, self%damper_rates, self%forces)
      end if
      allocate (self%matrices(s, s, most), self%inverse(s, most), self%factor(s, most), self%schur(s, n_dampers, n_dampers), &
                self%parts(s, most), self%answers(s, most), self%damper_rates(s, n_dampers), self%forces(s, n_dampers))
   end subroutine reserve

   !> d^-1, a square d^-1 and S^-1 at the four eigenvalues.
   subroutine couple(self, rule, modes, h)
      type(modal_reply), intent(inout) :: self
      type(gauss_collocation), intent(in) :: rule
      type(stiff_modes), intent(in) :: modes
      real(wp), intent(in) :: h
      complex(wp), dimension(n_pairs) :: a, inverse, factor
      integer :: i, k, l

      a = h*rule%lambda - modes%weight*(h*rule%lambda)**2
      do i = 1, modes%n
         inverse = 1.0_wp/(1.0_wp + modes%square(i)*(h*rule%lambda)**2)
         factor = a*modes%square(i)*inverse
         self%inverse(:, i) = [real(inverse, wp), aimag(inverse)]
         self%factor(:, i) = [real(factor, wp), aimag(factor)]
      end do
      do k = 1, modes%n_dampers
         do l = 1, k
            self%schur(:, l, k) = 0.0_wp
            do i = 1, modes%n
               self%schur(:, l, k) = self%schur(:, l, k) + (modes%influence(i, k)*modes%influence(i, l))*self%factor(:, i)
            end do
            self%schur(:, k, l) = self%schur(:, l, k)
         end do
         self%schur(:n_pairs, k, k) = self%schur(:n_pairs, k, k) + 1.0_wp
      end do
      call invert(modes%n_dampers, self%schur)
   end subroutine couple

   !> Inverses of complex matrices side by side, in place, by Gauss-Jordan elimination without a search for pivots.
   pure subroutine invert(n, z)
      integer, intent(in) :: n
      real(wp), intent(inout) :: z(n_pairs, 2, n, n) !! real and imaginary part, (j, i)
      real(wp), dimension(n_pairs) :: re, im, size_2, before
      integer :: i, j, k, l

      do k = 1, n
         size_2 = z(:, 1, k, k)**2 + z(:, 2, k, k)**2
         re = z(:, 1, k, k)/size_2
         im = -z(:, 2, k, k)/size_2
         z(:, 1, k, k) = 1.0_wp
         z(:, 2, k, k) = 0.0_wp
         do j = 1, n
            !$omp simd
            do l = 1, n_pairs
               before(l) = z(l, 1, j, k)
               z(l, 1, j, k) = re(l)*before(l) - im(l)*z(l, 2, j, k)
               z(l, 2, j, k) = re(l)*z(l, 2, j, k) + im(l)*before(l)
            end do
         end do
         do i = 1, n
            if (i == k) cycle
            re = z(:, 1, k, i)
            im = z(:, 2, k, i)
            z(:, :, k, i) = 0.0_wp
            do j = 1, n
               !$omp simd
               do l = 1, n_pairs
                  z(l, 1, j, i) = z(l, 1, j, i) - (re(l)*z(l, 1, j, k) - im(l)*z(l, 2, j, k))
                  z(l, 2, j, i) = z(l, 2, j, i) - (re(l)*z(l, 2, j, k) + im(l)*z(l, 1, j, k))
               end do
            end do
         end do
      end do
   end subroutine invert

   !> The answer of all modes to residuals at all nodes.
   subroutine answer(self, rule, modes, residuals, reply)
      class(modal_reply), intent(inout) :: self
      type(gauss_collocation), intent(in) :: rule
      type(stiff_modes), intent(in) :: modes              !! those of `prepare`
      real(wp), contiguous, intent(in) :: residuals(:, :) !! (s, most)
      real(wp), contiguous, intent(inout) :: reply(:, :)  !! (s, most)

      if (.not. self%coupled) then
         call combine(self%n, self%matrices, residuals, reply)
         return
      end if
      associate (n => self%n, r => modes%n_dampers)
         call multiply(n, rule%to_pairs, residuals, self%parts)
         call scale(n, self%inverse, self%parts)
         self%damper_rates = 0.0_wp
         call expand(r, n, size(modes%influence, 1), modes%influence, self%parts, self%damper_rates)
         call solve(r, self%schur, self%damper_rates, self%forces)
         self%answers(:, :n) = 0.0_wp
         call expand(n, r, r, modes%influence_t, self%forces, self%answers)
         call scale(n, self%factor, self%answers)
         self%parts(:, :n) = self%parts(:, :n) - self%answers(:, :n)
         reply(:, :n) = -residuals(:, :n)
         call apply(n, rule%from_pairs, self%parts, reply)
      end associate
   end subroutine answer

   !> x_i = a_i x_i, complex.
   pure subroutine scale(n, a, x)
      integer, intent(in) :: n
      real(wp), intent(in) :: a(n_pairs, 2, n)
      real(wp), intent(inout) :: x(n_pairs, 2, n)
      real(wp) :: before
      integer :: i, l
      do i = 1, n
         !$omp simd private(before)
         do l = 1, n_pairs
            before = x(l, 1, i)
            x(l, 1, i) = a(l, 1, i)*before - a(l, 2, i)*x(l, 2, i)
            x(l, 2, i) = a(l, 1, i)*x(l, 2, i) + a(l, 2, i)*before
         end do
      end do
   end subroutine scale

   !> y_i = sum_j z(j, i) x_j, complex.
   pure subroutine solve(n, z, x, y)
      integer, intent(in) :: n
      real(wp), intent(in) :: z(n_pairs, 2, n, n), x(n_pairs, 2, n)
      real(wp), intent(out) :: y(n_pairs, 2, n)
      real(wp), dimension(n_pairs) :: re_re, im_im, re_im, im_re ! four sums, none of which waits for another
      integer :: i, j, l

      do i = 1, n
         re_re = 0.0_wp
         im_im = 0.0_wp
         re_im = 0.0_wp
         im_re = 0.0_wp
         do j = 1, n
            !$omp simd
            do l = 1, n_pairs
               re_re(l) = re_re(l) + z(l, 1, j, i)*x(l, 1, j)
               im_im(l) = im_im(l) + z(l, 2, j, i)*x(l, 2, j)
               re_im(l) = re_im(l) + z(l, 1, j, i)*x(l, 2, j)
               im_re(l) = im_re(l) + z(l, 2, j, i)*x(l, 1, j)
            end do
         end do
         y(:, 1, i) = re_re - im_im
         y(:, 2, i) = re_im + im_re
      end do
   end subroutine solve

end module rodyn_modal_reply
