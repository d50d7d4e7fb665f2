!> Moments of the hinges between rods without bending unknowns, in all lanes at once: `rodyn_hinge_law` and
!> `rodyn_three_moments` in lanes. The same equations elsewhere: docs/model.md sec. 7.
module rodyn_lane_hinges
   use rodyn_kinds, only: wp
   use rodyn_lanes, only: lanes
   implicit none (type, external)
   private
   public :: lane_rigid_moments, lane_flexible_moments, lane_series_moments, lane_condensed_moments

contains

   !> T = C (opening - gamma) + D opening' between rigid rods.
   pure subroutine lane_rigid_moments(n, stiffness, damping, offset, phi, phi_rate, moment)
      integer, intent(in) :: n !! rods
      real(wp), dimension(lanes, 0:n - 1), intent(in) :: stiffness, damping, offset !! C, D, moment at rest
      real(wp), dimension(lanes, n), intent(in) :: phi, phi_rate !! [rad], [rad/s]
      real(wp), intent(out) :: moment(lanes, 0:n) !! T, T(n) = 0 [N m]
      integer :: k, i

      !$omp simd
      do i = 1, lanes
         moment(i, 0) = (stiffness(i, 0)*phi(i, 1) - offset(i, 0)) + damping(i, 0)*phi_rate(i, 1)
      end do
      do k = 1, n - 1
         !$omp simd
         do i = 1, lanes
            moment(i, k) = (stiffness(i, k)*(phi(i, k + 1) - phi(i, k)) - offset(i, k)) + &
                           damping(i, k)*(phi_rate(i, k + 1) - phi_rate(i, k))
         end do
      end do
      moment(:, n) = 0.0_wp
   end subroutine lane_rigid_moments

   !> The same between rods that bend.
   pure subroutine lane_flexible_moments(n, stiffness, damping, offset, phi, alpha, beta, phi_rate, alpha_rate, beta_rate, moment)
      integer, intent(in) :: n !! rods
      real(wp), dimension(lanes, 0:n - 1), intent(in) :: stiffness, damping, offset !! C, D, moment at rest
      real(wp), dimension(lanes, n), intent(in) :: phi, alpha, beta, phi_rate, alpha_rate, beta_rate
      real(wp), intent(out) :: moment(lanes, 0:n) !! T, T(n) = 0 [N m]
      integer :: k, i

      !$omp simd
      do i = 1, lanes
         moment(i, 0) = (stiffness(i, 0)*(phi(i, 1) + alpha(i, 1)) - offset(i, 0)) + &
                        damping(i, 0)*(phi_rate(i, 1) + alpha_rate(i, 1))
      end do
      do k = 1, n - 1
         !$omp simd
         do i = 1, lanes
            moment(i, k) = (stiffness(i, k)*((phi(i, k + 1) + alpha(i, k + 1)) - (phi(i, k) + beta(i, k))) - offset(i, k)) + &
                           damping(i, k)*((phi_rate(i, k + 1) + alpha_rate(i, k + 1)) - (phi_rate(i, k) + beta_rate(i, k)))
         end do
      end do
      moment(:, n) = 0.0_wp
   end subroutine lane_flexible_moments

   !> Quasistatic bending: T = C G (opening - gamma) + G^T D G opening', G = (I + F C)^-1 by its factors.
   pure subroutine lane_series_moments(n, damped, stiffness, damping, kink, lower, pivot, upper, phi, phi_rate, theta, moment)
      integer, intent(in) :: n !! rods
      logical, intent(in) :: damped !! some D > 0
      real(wp), dimension(lanes, 0:n - 1), intent(in) :: stiffness, damping, kink !! C, D, gamma
      real(wp), dimension(lanes, 0:n - 1), intent(in) :: lower, pivot, upper !! factors; first lower and last upper zero
      real(wp), dimension(lanes, n), intent(in) :: phi, phi_rate !! [rad], [rad/s]
      real(wp), intent(out) :: theta(lanes, 0:n - 1) !! workspace
      real(wp), intent(out) :: moment(lanes, 0:n)    !! T, T(n) = 0 [N m]
      integer :: k, i

      call openings(n, phi, theta)
      theta = theta - kink
      call solve(n, lower, pivot, upper, theta)
      do k = 0, n - 1
         !$omp simd
         do i = 1, lanes
            moment(i, k) = stiffness(i, k)*theta(i, k)
         end do
      end do
      moment(:, n) = 0.0_wp
      if (.not. damped) return
      call openings(n, phi_rate, theta)
      call solve(n, lower, pivot, upper, theta)
      theta = damping*theta
      call solve_transposed(n, lower, pivot, upper, theta)
      do k = 0, n - 1
         !$omp simd
         do i = 1, lanes
            moment(i, k) = moment(i, k) + theta(i, k)
         end do
      end do
   end subroutine lane_series_moments

   !> Condensed rods (`bend_chain` of `rodyn_recursion_condensed`): moments of the springs, their rates, and the forces on th_k.
   pure subroutine lane_condensed_moments(n, stiffness, damping, kink, lower, pivot, upper, phi, phi_rate, moment, moment_rate, &
                                          force)
      integer, intent(in) :: n !! rods
      real(wp), dimension(lanes, 0:n - 1), intent(in) :: stiffness, damping, kink !! C, D, gamma
      real(wp), dimension(lanes, 0:n - 1), intent(in) :: lower, pivot, upper !! as for `lane_series_moments`
      real(wp), dimension(lanes, n), intent(in) :: phi, phi_rate !! [rad], [rad/s]
      real(wp), dimension(lanes, 0:n), intent(out) :: moment, moment_rate, force !! zero at n
      integer :: k, i

      call openings(n, phi, moment)
      call openings(n, phi_rate, moment_rate)
      do k = 0, n - 1
         !$omp simd
         do i = 1, lanes
            moment(i, k) = moment(i, k) - kink(i, k)
            force(i, k) = stiffness(i, k)*moment(i, k)
         end do
      end do
      call solve(n, lower, pivot, upper, moment)
      call solve(n, lower, pivot, upper, moment_rate)
      do k = 0, n - 1
         !$omp simd
         do i = 1, lanes
            force(i, k) = force(i, k) + damping(i, k)*moment_rate(i, k)
            moment(i, k) = stiffness(i, k)*moment(i, k)
            moment_rate(i, k) = stiffness(i, k)*moment_rate(i, k)
         end do
      end do
      moment(:, n) = 0.0_wp
      moment_rate(:, n) = 0.0_wp
      force(:, n) = 0.0_wp
   end subroutine lane_condensed_moments

   !> Opening of each hinge, without its kink.
   pure subroutine openings(n, angle, opening)
      integer, intent(in) :: n
      real(wp), intent(in) :: angle(lanes, n)
      real(wp), intent(out) :: opening(lanes, 0:n - 1)
      integer :: k, i

      opening(:, 0) = angle(:, 1)
      do k = 1, n - 1
         !$omp simd
         do i = 1, lanes
            opening(i, k) = angle(i, k + 1) - angle(i, k)
         end do
      end do
   end subroutine openings

   !> x <- (I + F C)^-1 x.
   pure subroutine solve(n, lower, pivot, upper, x)
      integer, intent(in) :: n
      real(wp), dimension(lanes, 0:n - 1), intent(in) :: lower, pivot, upper
      real(wp), intent(inout) :: x(lanes, 0:n - 1)
      real(wp) :: last(lanes)
      integer :: k, i

      last = 0.0_wp
      do k = 0, n - 1
         !$omp simd
         do i = 1, lanes
            last(i) = x(i, k) - lower(i, k)*last(i)
            x(i, k) = last(i)
         end do
      end do
      last = 0.0_wp
      do k = n - 1, 0, -1
         !$omp simd
         do i = 1, lanes
            last(i) = (x(i, k) - upper(i, k)*last(i))*pivot(i, k)
            x(i, k) = last(i)
         end do
      end do
   end subroutine solve

   !> x <- (I + C F)^-1 x.
   pure subroutine solve_transposed(n, lower, pivot, upper, x)
      integer, intent(in) :: n
      real(wp), dimension(lanes, 0:n - 1), intent(in) :: lower, pivot, upper
      real(wp), intent(inout) :: x(lanes, 0:n - 1)
      real(wp) :: last(lanes)
      integer :: k, i

      !$omp simd
      do i = 1, lanes
         last(i) = x(i, 0)*pivot(i, 0)
         x(i, 0) = last(i)
      end do
      do k = 1, n - 1
         !$omp simd
         do i = 1, lanes
            last(i) = (x(i, k) - upper(i, k - 1)*last(i))*pivot(i, k)
            x(i, k) = last(i)
         end do
      end do
      do k = n - 2, 0, -1
         !$omp simd
         do i = 1, lanes
            last(i) = x(i, k) - lower(i, k + 1)*last(i)
            x(i, k) = last(i)
         end do
      end do
   end subroutine solve_transposed

end module rodyn_lane_hinges
