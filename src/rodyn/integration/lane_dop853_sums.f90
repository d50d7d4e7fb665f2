!> The sums of `rodyn_lane_dop853`: states of the stages, increments and errors of a step in all lanes at once. Apart from
!> it, because compilers that inline them there no longer see that the arrays do not overlap, and give up the vectors.
module rodyn_lane_dop853_sums
   use rodyn_kinds, only: wp
   use rodyn_lanes, only: lanes
   use rodyn_dop853_nystrom, only: n_stages, node, a, a2, b, b2, e5, e5_2, e3, e3_2
   implicit none (type, external)
   private
   public :: failed_norm, turning_rates, stage_states, turning_stage, end_of_step, check_rates, advance_states, advance_rates

   real(wp), parameter :: failed_norm = 1.0e300_wp !! error norm of a step that came to nothing

contains

   !> q(1:2)' of a free spacecraft.
   pure subroutine turning_rates(m, q, p, rate)
      integer, intent(in) :: m
      real(wp), intent(in) :: q(lanes, m), p(lanes, m)
      real(wp), intent(out) :: rate(lanes, 2)
      integer :: l
      !$omp simd
      do l = 1, lanes
         rate(l, 1) = p(l, 1) + p(l, 3)*q(l, 2)
         rate(l, 2) = p(l, 2) - p(l, 3)*q(l, 1)
      end do
   end subroutine turning_rates

   !> State of stage s.
   pure subroutine stage_states(s, m, h, q, p, f, q_stage, p_stage)
      integer, intent(in) :: s !! 2..12
      integer, intent(in) :: m
      real(wp), intent(in) :: h(lanes), q(lanes, m), p(lanes, m), f(lanes, m, n_stages)
      real(wp), intent(out) :: q_stage(lanes, m), p_stage(lanes, m)
      integer :: j, l

      select case (s)
      case (2)
         do j = 1, m
            !$omp simd
            do l = 1, lanes
               p_stage(l, j) = p(l, j) + h(l)*(a(1, 2)*f(l, j, 1))
               q_stage(l, j) = q(l, j) + h(l)*(node(2)*p(l, j))
            end do
         end do
      case (3)
         do j = 1, m
            !$omp simd
            do l = 1, lanes
               p_stage(l, j) = p(l, j) + h(l)*(a(1, 3)*f(l, j, 1) + a(2, 3)*f(l, j, 2))
               q_stage(l, j) = q(l, j) + h(l)*(node(3)*p(l, j) + h(l)*(a2(1, 3)*f(l, j, 1)))
            end do
         end do
      case (4)
         do j = 1, m
            !$omp simd
            do l = 1, lanes
               p_stage(l, j) = p(l, j) + h(l)*(a(1, 4)*f(l, j, 1) + a(3, 4)*f(l, j, 3))
               q_stage(l, j) = q(l, j) + h(l)*(node(4)*p(l, j) + h(l)*(a2(1, 4)*f(l, j, 1) + a2(2, 4)*f(l, j, 2)))
            end do
         end do
      case (5)
         do j = 1, m
            !$omp simd
            do l = 1, lanes
               p_stage(l, j) = p(l, j) + h(l)*(a(1, 5)*f(l, j, 1) + a(3, 5)*f(l, j, 3) + a(4, 5)*f(l, j, 4))
               q_stage(l, j) = q(l, j) + h(l)*(node(5)*p(l, j) + h(l)*(a2(1, 5)*f(l, j, 1) + a2(2, 5)*f(l, j, 2) + &
                                                                       a2(3, 5)*f(l, j, 3)))
            end do
         end do
      case (6)
         do j = 1, m
            !$omp simd
            do l = 1, lanes
               p_stage(l, j) = p(l, j) + h(l)*(a(1, 6)*f(l, j, 1) + a(4, 6)*f(l, j, 4) + a(5, 6)*f(l, j, 5))
               q_stage(l, j) = q(l, j) + h(l)*(node(6)*p(l, j) + h(l)*(a2(1, 6)*f(l, j, 1) + a2(3, 6)*f(l, j, 3) + &
                                                                       a2(4, 6)*f(l, j, 4)))
            end do
         end do
      case (7)
         do j = 1, m
            !$omp simd
            do l = 1, lanes
               p_stage(l, j) = p(l, j) + h(l)*(a(1, 7)*f(l, j, 1) + a(4, 7)*f(l, j, 4) + a(5, 7)*f(l, j, 5) + &
                                               a(6, 7)*f(l, j, 6))
               q_stage(l, j) = q(l, j) + h(l)*(node(7)*p(l, j) + h(l)*(a2(1, 7)*f(l, j, 1) + a2(3, 7)*f(l, j, 3) + &
                                                                       a2(4, 7)*f(l, j, 4) + a2(5, 7)*f(l, j, 5)))
            end do
         end do
      case (8)
         do j = 1, m
            !$omp simd
            do l = 1, lanes
               p_stage(l, j) = p(l, j) + h(l)*(a(1, 8)*f(l, j, 1) + a(4, 8)*f(l, j, 4) + a(5, 8)*f(l, j, 5) + &
                                               a(6, 8)*f(l, j, 6) + a(7, 8)*f(l, j, 7))
               q_stage(l, j) = q(l, j) + h(l)*(node(8)*p(l, j) + h(l)*(a2(1, 8)*f(l, j, 1) + a2(3, 8)*f(l, j, 3) + &
                                                                       a2(4, 8)*f(l, j, 4) + a2(5, 8)*f(l, j, 5) + &
                                                                       a2(6, 8)*f(l, j, 6)))
            end do
         end do
      case (9)
         do j = 1, m
            !$omp simd
            do l = 1, lanes
               p_stage(l, j) = p(l, j) + h(l)*(a(1, 9)*f(l, j, 1) + a(4, 9)*f(l, j, 4) + a(5, 9)*f(l, j, 5) + &
                                               a(6, 9)*f(l, j, 6) + a(7, 9)*f(l, j, 7) + a(8, 9)*f(l, j, 8))
               q_stage(l, j) = q(l, j) + h(l)*(node(9)*p(l, j) + h(l)*(a2(1, 9)*f(l, j, 1) + a2(3, 9)*f(l, j, 3) + &
                                                                       a2(4, 9)*f(l, j, 4) + a2(5, 9)*f(l, j, 5) + &
                                                                       a2(6, 9)*f(l, j, 6) + a2(7, 9)*f(l, j, 7)))
            end do
         end do
      case (10)
         do j = 1, m
            !$omp simd
            do l = 1, lanes
               p_stage(l, j) = p(l, j) + h(l)*(a(1, 10)*f(l, j, 1) + a(4, 10)*f(l, j, 4) + a(5, 10)*f(l, j, 5) + &
                                               a(6, 10)*f(l, j, 6) + a(7, 10)*f(l, j, 7) + a(8, 10)*f(l, j, 8) + &
                                               a(9, 10)*f(l, j, 9))
               q_stage(l, j) = q(l, j) + h(l)*(node(10)*p(l, j) + h(l)*(a2(1, 10)*f(l, j, 1) + a2(3, 10)*f(l, j, 3) + &
                                                                        a2(4, 10)*f(l, j, 4) + a2(5, 10)*f(l, j, 5) + &
                                                                        a2(6, 10)*f(l, j, 6) + a2(7, 10)*f(l, j, 7) + &
                                                                        a2(8, 10)*f(l, j, 8)))
            end do
         end do
      case (11)
         do j = 1, m
            !$omp simd
            do l = 1, lanes
               p_stage(l, j) = p(l, j) + h(l)*(a(1, 11)*f(l, j, 1) + a(4, 11)*f(l, j, 4) + a(5, 11)*f(l, j, 5) + &
                                               a(6, 11)*f(l, j, 6) + a(7, 11)*f(l, j, 7) + a(8, 11)*f(l, j, 8) + &
                                               a(9, 11)*f(l, j, 9) + a(10, 11)*f(l, j, 10))
               q_stage(l, j) = q(l, j) + h(l)*(node(11)*p(l, j) + h(l)*(a2(1, 11)*f(l, j, 1) + a2(3, 11)*f(l, j, 3) + &
                                                                        a2(4, 11)*f(l, j, 4) + a2(5, 11)*f(l, j, 5) + &
                                                                        a2(6, 11)*f(l, j, 6) + a2(7, 11)*f(l, j, 7) + &
                                                                        a2(8, 11)*f(l, j, 8) + a2(9, 11)*f(l, j, 9)))
            end do
         end do
      case default ! 12
         do j = 1, m
            !$omp simd
            do l = 1, lanes
               p_stage(l, j) = p(l, j) + h(l)*(a(1, 12)*f(l, j, 1) + a(4, 12)*f(l, j, 4) + a(5, 12)*f(l, j, 5) + &
                                               a(6, 12)*f(l, j, 6) + a(7, 12)*f(l, j, 7) + a(8, 12)*f(l, j, 8) + &
                                               a(9, 12)*f(l, j, 9) + a(10, 12)*f(l, j, 10) + a(11, 12)*f(l, j, 11))
               q_stage(l, j) = q(l, j) + h(l)*(node(12)*p(l, j) + h(l)*(a2(1, 12)*f(l, j, 1) + a2(3, 12)*f(l, j, 3) + &
                                                                        a2(4, 12)*f(l, j, 4) + a2(5, 12)*f(l, j, 5) + &
                                                                        a2(6, 12)*f(l, j, 6) + a2(7, 12)*f(l, j, 7) + &
                                                                        a2(8, 12)*f(l, j, 8) + a2(9, 12)*f(l, j, 9) + &
                                                                        a2(10, 12)*f(l, j, 10)))
            end do
         end do
      end select
   end subroutine stage_states

   !> The same of q(1:2), where they turn.
   pure subroutine turning_stage(s, m, h, q, turn, q_stage)
      integer, intent(in) :: s !! 2..12
      integer, intent(in) :: m
      real(wp), intent(in) :: h(lanes), q(lanes, m), turn(lanes, 2, n_stages)
      real(wp), intent(inout) :: q_stage(lanes, m)
      integer :: j, l

      select case (s)
      case (2)
         do j = 1, 2
            !$omp simd
            do l = 1, lanes
               q_stage(l, j) = q(l, j) + h(l)*(a(1, 2)*turn(l, j, 1))
            end do
         end do
      case (3)
         do j = 1, 2
            !$omp simd
            do l = 1, lanes
               q_stage(l, j) = q(l, j) + h(l)*(a(1, 3)*turn(l, j, 1) + a(2, 3)*turn(l, j, 2))
            end do
         end do
      case (4)
         do j = 1, 2
            !$omp simd
            do l = 1, lanes
               q_stage(l, j) = q(l, j) + h(l)*(a(1, 4)*turn(l, j, 1) + a(3, 4)*turn(l, j, 3))
            end do
         end do
      case (5)
         do j = 1, 2
            !$omp simd
            do l = 1, lanes
               q_stage(l, j) = q(l, j) + h(l)*(a(1, 5)*turn(l, j, 1) + a(3, 5)*turn(l, j, 3) + a(4, 5)*turn(l, j, 4))
            end do
         end do
      case (6)
         do j = 1, 2
            !$omp simd
            do l = 1, lanes
               q_stage(l, j) = q(l, j) + h(l)*(a(1, 6)*turn(l, j, 1) + a(4, 6)*turn(l, j, 4) + a(5, 6)*turn(l, j, 5))
            end do
         end do
      case (7)
         do j = 1, 2
            !$omp simd
            do l = 1, lanes
               q_stage(l, j) = q(l, j) + h(l)*(a(1, 7)*turn(l, j, 1) + a(4, 7)*turn(l, j, 4) + a(5, 7)*turn(l, j, 5) + &
                                               a(6, 7)*turn(l, j, 6))
            end do
         end do
      case (8)
         do j = 1, 2
            !$omp simd
            do l = 1, lanes
               q_stage(l, j) = q(l, j) + h(l)*(a(1, 8)*turn(l, j, 1) + a(4, 8)*turn(l, j, 4) + a(5, 8)*turn(l, j, 5) + &
                                               a(6, 8)*turn(l, j, 6) + a(7, 8)*turn(l, j, 7))
            end do
         end do
      case (9)
         do j = 1, 2
            !$omp simd
            do l = 1, lanes
               q_stage(l, j) = q(l, j) + h(l)*(a(1, 9)*turn(l, j, 1) + a(4, 9)*turn(l, j, 4) + a(5, 9)*turn(l, j, 5) + &
                                               a(6, 9)*turn(l, j, 6) + a(7, 9)*turn(l, j, 7) + a(8, 9)*turn(l, j, 8))
            end do
         end do
      case (10)
         do j = 1, 2
            !$omp simd
            do l = 1, lanes
               q_stage(l, j) = q(l, j) + h(l)*(a(1, 10)*turn(l, j, 1) + a(4, 10)*turn(l, j, 4) + a(5, 10)*turn(l, j, 5) + &
                                               a(6, 10)*turn(l, j, 6) + a(7, 10)*turn(l, j, 7) + a(8, 10)*turn(l, j, 8) + &
                                               a(9, 10)*turn(l, j, 9))
            end do
         end do
      case (11)
         do j = 1, 2
            !$omp simd
            do l = 1, lanes
               q_stage(l, j) = q(l, j) + h(l)*(a(1, 11)*turn(l, j, 1) + a(4, 11)*turn(l, j, 4) + a(5, 11)*turn(l, j, 5) + &
                                               a(6, 11)*turn(l, j, 6) + a(7, 11)*turn(l, j, 7) + a(8, 11)*turn(l, j, 8) + &
                                               a(9, 11)*turn(l, j, 9) + a(10, 11)*turn(l, j, 10))
            end do
         end do
      case default ! 12
         do j = 1, 2
            !$omp simd
            do l = 1, lanes
               q_stage(l, j) = q(l, j) + h(l)*(a(1, 12)*turn(l, j, 1) + a(4, 12)*turn(l, j, 4) + a(5, 12)*turn(l, j, 5) + &
                                               a(6, 12)*turn(l, j, 6) + a(7, 12)*turn(l, j, 7) + a(8, 12)*turn(l, j, 8) + &
                                               a(9, 12)*turn(l, j, 9) + a(10, 12)*turn(l, j, 10) + a(11, 12)*turn(l, j, 11))
            end do
         end do
      end select
   end subroutine turning_stage

   !> Increments, the new state, and the norm of its error: root mean square of error/tolerance, Hairer's mix of the two
   !> estimates. Anything that is not finite makes it `failed_norm`.
   pure subroutine end_of_step(m, n_turning, h, q, p, f, turn, q_lost, p_lost, rtol, atol, q_increment, p_increment, q_new, &
                               p_new, norm)
      integer, intent(in) :: m, n_turning
      real(wp), intent(in) :: h(lanes), f(lanes, m, n_stages), turn(lanes, 2, n_stages), rtol(lanes), atol(lanes)
      real(wp), dimension(lanes, m), intent(in) :: q, p, q_lost, p_lost
      real(wp), dimension(lanes, m), intent(out) :: q_increment, p_increment, q_new, p_new
      real(wp), intent(out) :: norm(lanes)
      real(wp), dimension(lanes) :: sum_5, sum_3, bad
      real(wp) :: rate, five, three, weight, both
      integer :: j, l

      sum_5 = 0.0_wp
      sum_3 = 0.0_wp
      bad = 0.0_wp
      do j = 1, m
         !$omp simd
         do l = 1, lanes
            rate = b(1)*f(l, j, 1) + b(6)*f(l, j, 6) + b(7)*f(l, j, 7) + b(8)*f(l, j, 8) + b(9)*f(l, j, 9) + &
                   b(10)*f(l, j, 10) + b(11)*f(l, j, 11) + b(12)*f(l, j, 12)
            five = e5(1)*f(l, j, 1) + e5(6)*f(l, j, 6) + e5(7)*f(l, j, 7) + e5(8)*f(l, j, 8) + e5(9)*f(l, j, 9) + &
                   e5(10)*f(l, j, 10) + e5(11)*f(l, j, 11) + e5(12)*f(l, j, 12)
            three = e3(1)*f(l, j, 1) + e3(6)*f(l, j, 6) + e3(7)*f(l, j, 7) + e3(8)*f(l, j, 8) + e3(9)*f(l, j, 9) + &
                    e3(10)*f(l, j, 10) + e3(11)*f(l, j, 11) + e3(12)*f(l, j, 12)
            p_increment(l, j) = h(l)*rate
            p_new(l, j) = p(l, j) + (p_increment(l, j) - p_lost(l, j))
            weight = 1.0_wp/(atol(l) + rtol(l)*max(abs(p(l, j)), abs(p_new(l, j))))
            sum_5(l) = sum_5(l) + (five*weight)**2
            sum_3(l) = sum_3(l) + (three*weight)**2
            bad(l) = merge(bad(l), 1.0_wp, abs(p_new(l, j)) <= huge(1.0_wp))
         end do
      end do
      do j = 1, n_turning
         !$omp simd
         do l = 1, lanes
            rate = b(1)*turn(l, j, 1) + b(6)*turn(l, j, 6) + b(7)*turn(l, j, 7) + b(8)*turn(l, j, 8) + b(9)*turn(l, j, 9) + &
                   b(10)*turn(l, j, 10) + b(11)*turn(l, j, 11) + b(12)*turn(l, j, 12)
            five = e5(1)*turn(l, j, 1) + e5(6)*turn(l, j, 6) + e5(7)*turn(l, j, 7) + e5(8)*turn(l, j, 8) + &
                   e5(9)*turn(l, j, 9) + e5(10)*turn(l, j, 10) + e5(11)*turn(l, j, 11) + e5(12)*turn(l, j, 12)
            three = e3(1)*turn(l, j, 1) + e3(6)*turn(l, j, 6) + e3(7)*turn(l, j, 7) + e3(8)*turn(l, j, 8) + &
                    e3(9)*turn(l, j, 9) + e3(10)*turn(l, j, 10) + e3(11)*turn(l, j, 11) + e3(12)*turn(l, j, 12)
            q_increment(l, j) = h(l)*rate
            q_new(l, j) = q(l, j) + (q_increment(l, j) - q_lost(l, j))
            weight = 1.0_wp/(atol(l) + rtol(l)*max(abs(q(l, j)), abs(q_new(l, j))))
            sum_5(l) = sum_5(l) + (five*weight)**2
            sum_3(l) = sum_3(l) + (three*weight)**2
            bad(l) = merge(bad(l), 1.0_wp, abs(q_new(l, j)) <= huge(1.0_wp))
         end do
      end do
      do j = n_turning + 1, m
         !$omp simd
         do l = 1, lanes
            rate = p(l, j) + h(l)*(b2(1)*f(l, j, 1) + b2(6)*f(l, j, 6) + b2(7)*f(l, j, 7) + b2(8)*f(l, j, 8) + &
                   b2(9)*f(l, j, 9) + b2(10)*f(l, j, 10) + b2(11)*f(l, j, 11))
            five = h(l)*(e5_2(1)*f(l, j, 1) + e5_2(4)*f(l, j, 4) + e5_2(5)*f(l, j, 5) + e5_2(6)*f(l, j, 6) + &
                   e5_2(7)*f(l, j, 7) + e5_2(8)*f(l, j, 8) + e5_2(9)*f(l, j, 9) + e5_2(10)*f(l, j, 10) + e5_2(11)*f(l, j, 11))
            three = h(l)*(e3_2(1)*f(l, j, 1) + e3_2(4)*f(l, j, 4) + e3_2(5)*f(l, j, 5) + e3_2(6)*f(l, j, 6) + &
                    e3_2(7)*f(l, j, 7) + e3_2(8)*f(l, j, 8) + e3_2(9)*f(l, j, 9) + e3_2(10)*f(l, j, 10) + e3_2(11)*f(l, j, 11))
            q_increment(l, j) = h(l)*rate
            q_new(l, j) = q(l, j) + (q_increment(l, j) - q_lost(l, j))
            weight = 1.0_wp/(atol(l) + rtol(l)*max(abs(q(l, j)), abs(q_new(l, j))))
            sum_5(l) = sum_5(l) + (five*weight)**2
            sum_3(l) = sum_3(l) + (three*weight)**2
            bad(l) = merge(bad(l), 1.0_wp, abs(q_new(l, j)) <= huge(1.0_wp))
         end do
      end do
      !$omp simd
      do l = 1, lanes
         both = 2*m*(sum_5(l) + 0.01_wp*sum_3(l))
         norm(l) = abs(h(l))*sum_5(l)/sqrt(max(both, tiny(1.0_wp)))
         norm(l) = merge(norm(l), failed_norm, both <= huge(1.0_wp) .and. norm(l) <= huge(1.0_wp) .and. bad(l) < 0.5_wp)
      end do
   end subroutine end_of_step

   !> Not ok where some rate is not finite.
   pure subroutine check_rates(m, f, ok)
      integer, intent(in) :: m
      real(wp), intent(in) :: f(lanes, m)
      logical, intent(inout) :: ok(lanes)
      real(wp) :: bad(lanes)
      integer :: j, l

      bad = 0.0_wp
      do j = 1, m
         !$omp simd
         do l = 1, lanes
            bad(l) = merge(bad(l), 1.0_wp, abs(f(l, j)) <= huge(1.0_wp))
         end do
      end do
      ok = ok .and. bad < 0.5_wp
   end subroutine check_rates

   !> Make the new states the current ones where steps were accepted, with the digits that rounding took from them.
   pure subroutine advance_states(m, commit, move, y_new, increment, lost, y)
      integer, intent(in) :: m
      real(wp), intent(in) :: commit(lanes), move(lanes)
      real(wp), dimension(lanes, m), intent(in) :: y_new, increment
      real(wp), dimension(lanes, m), intent(inout) :: lost, y
      real(wp) :: rest(lanes)
      integer :: j, l

      do j = 1, m
         rest = (y_new(:, j) - y(:, j)) - (increment(:, j) - lost(:, j)) ! in all lanes, lest there be branches
         !$omp simd
         do l = 1, lanes
            lost(l, j) = merge(rest(l), lost(l, j), commit(l) > 0.5_wp)
            y(l, j) = merge(y_new(l, j), y(l, j), move(l) > 0.5_wp)
         end do
      end do
   end subroutine advance_states

   pure subroutine advance_rates(m, move, f_new, f)
      integer, intent(in) :: m
      real(wp), intent(in) :: move(lanes), f_new(lanes, m)
      real(wp), intent(inout) :: f(lanes, m)
      integer :: j, l

      do j = 1, m
         !$omp simd
         do l = 1, lanes
            f(l, j) = merge(f_new(l, j), f(l, j), move(l) > 0.5_wp)
         end do
      end do
   end subroutine advance_rates

end module rodyn_lane_dop853_sums
