!> Small linear algebra on values at all lanes, x(lanes, n): each operation on a lane vector is one vector instruction.
!>
!> The lanes stand in explicit shapes, so that the compiler knows their number. Products of matrices (`expand`) keep four columns in
!> registers while the others go by, since gfortran would load a column again for each product.
module rodyn_lane_algebra
   use rodyn_kinds, only: wp
   use rodyn_lanes, only: s => lanes
   implicit none (type, external)
   private
   public :: apply, apply_one, multiply, project, project_pair, expand, combine, square_sums, straight_lines, &
      residual, add, accumulate, copy

contains

   !> y(:, j) = y(:, j) + A x(:, j).
   pure subroutine apply(n, a, x, y)
      integer, intent(in) :: n
      real(wp), intent(in) :: a(s, s), x(s, n)
      real(wp), intent(inout) :: y(s, n)
      call expand(n, s, s, x, a, y)
   end subroutine apply

   !> y(:, j) = A x(:, j).
   pure subroutine multiply(n, a, x, y)
      integer, intent(in) :: n
      real(wp), intent(in) :: a(s, s), x(s, n)
      real(wp), intent(out) :: y(s, n)
      y = 0.0_wp
      call apply(n, a, x, y)
   end subroutine multiply

   !> y = y + A x. Two sums, since each addition waits for the one before.
   pure subroutine apply_one(a, x, y)
      real(wp), intent(in) :: a(s, s), x(s)
      real(wp), intent(inout) :: y(s)
      real(wp) :: sum_1(s), sum_2(s)
      integer :: i
      sum_1 = y
      sum_2 = 0.0_wp
      do i = 1, s, 2
         sum_1 = sum_1 + a(:, i)*x(i)
         sum_2 = sum_2 + a(:, i + 1)*x(i + 1)
      end do
      y = sum_1 + sum_2
   end subroutine apply_one

   !> z(:, i) = sum_j v(j, i) x(:, j).
   pure subroutine project(n, m, v, x, z)
      integer, intent(in) :: n, m
      real(wp), intent(in) :: v(n, m), x(s, n)
      real(wp), intent(out) :: z(s, m)
      z = 0.0_wp
      call expand(m, n, n, v, x, z)
   end subroutine project

   !> f_i = sum_j v(j, i) x_j and g_i = sum_j v(j, i) y_j: no lanes, but eight sums at a time, none of which waits for another.
   pure subroutine project_pair(n, m, v, x, y, f, g)
      integer, intent(in) :: n, m
      real(wp), intent(in) :: v(n, m), x(n), y(n)
      real(wp), intent(out) :: f(m), g(m)
      real(wp), dimension(4) :: sum_x, sum_y
      integer :: i, j, l, single

      single = mod(m, 4)
      do i = 1, single
         f(i) = dot_product(v(:, i), x)
         g(i) = dot_product(v(:, i), y)
      end do
      do i = single + 1, m, 4
         sum_x = 0.0_wp
         sum_y = 0.0_wp
         do j = 1, n
            do l = 1, 4
               sum_x(l) = sum_x(l) + v(j, i + l - 1)*x(j)
               sum_y(l) = sum_y(l) + v(j, i + l - 1)*y(j)
            end do
         end do
         f(i:i + 3) = sum_x
         g(i:i + 3) = sum_y
      end do
   end subroutine project_pair

   !> x(:, j) = x(:, j) + sum_i u(i, j) z(:, i). Four columns of z stay in registers while x goes by.
   pure subroutine expand(n, m, n_rows, u, z, x)
      integer, intent(in) :: n, m, n_rows !! rows of u, of which m are used
      real(wp), intent(in) :: u(n_rows, n), z(s, m)
      real(wp), intent(inout) :: x(s, n)
      real(wp), dimension(s) :: z_1, z_2, z_3, z_4
      integer :: i, j, l

      do i = 1, m - 3, 4
         z_1 = z(:, i)
         z_2 = z(:, i + 1)
         z_3 = z(:, i + 2)
         z_4 = z(:, i + 3)
         do j = 1, n
            !$omp simd
            do l = 1, s
               x(l, j) = x(l, j) + u(i, j)*z_1(l) + u(i + 1, j)*z_2(l) + u(i + 2, j)*z_3(l) + u(i + 3, j)*z_4(l)
            end do
         end do
      end do
      do i = m - modulo(m, 4) + 1, m
         z_1 = z(:, i)
         do j = 1, n
            !$omp simd
            do l = 1, s
               x(l, j) = x(l, j) + u(i, j)*z_1(l)
            end do
         end do
      end do
   end subroutine expand

   !> y = sum_i matrices(:, :, i) z(:, i), each column by a matrix of its own.
   pure subroutine combine(m, matrices, z, y)
      integer, intent(in) :: m
      real(wp), intent(in) :: matrices(s, s, m), z(s, m)
      real(wp), intent(out) :: y(s, m)
      real(wp) :: y_1(s), y_2(s)
      integer :: i, j, l
      do i = 1, m - 1, 2
         y_1 = 0.0_wp
         y_2 = 0.0_wp
         do j = 1, s
            !$omp simd
            do l = 1, s
               y_1(l) = y_1(l) + matrices(l, j, i)*z(j, i)
               y_2(l) = y_2(l) + matrices(l, j, i + 1)*z(j, i + 1)
            end do
         end do
         y(:, i) = y_1
         y(:, i + 1) = y_2
      end do
      if (modulo(m, 2) == 0) return
      y(:, m) = 0.0_wp
      call apply_one(matrices(:, :, m), z(:, m), y(:, m))
   end subroutine combine

   !> Lane by lane, sum of (weight_j x(:, j))^2.
   pure function square_sums(n, x, weight) result(sums)
      integer, intent(in) :: n
      real(wp), intent(in) :: x(s, n), weight(n)
      real(wp) :: sums(s)
      integer :: j, l
      sums = 0.0_wp
      do j = 1, n
         !$omp simd
         do l = 1, s
            sums(l) = sums(l) + (x(l, j)*weight(j))**2
         end do
      end do
   end function square_sums

   !> Uniform motion from q at the rate p: x(:, j) = q_j + h p_j c.
   pure subroutine straight_lines(n, q, p, h, c, x)
      integer, intent(in) :: n
      real(wp), intent(in) :: q(n), p(n), h, c(s)
      real(wp), intent(out) :: x(s, n)
      integer :: j, l
      do j = 1, n
         !$omp simd
         do l = 1, s
            x(l, j) = q(j) + (h*p(j))*c(l)
         end do
      end do
   end subroutine straight_lines

   !> y = y + x; also returns the sum of (weight_j x(:, j))^2, lane by lane.
   pure subroutine add(n, x, weight, y, sums)
      integer, intent(in) :: n
      real(wp), intent(in) :: x(s, n), weight(n)
      real(wp), intent(inout) :: y(s, n)
      real(wp), intent(out) :: sums(s)
      integer :: j, l
      sums = 0.0_wp
      do j = 1, n
         !$omp simd
         do l = 1, s
            y(l, j) = y(l, j) + x(l, j)
            sums(l) = sums(l) + (weight(j)*x(l, j))**2
         end do
      end do
   end subroutine add

   !> y = y + x.
   pure subroutine accumulate(n, x, y)
      integer, intent(in) :: n
      real(wp), intent(in) :: x(s, n)
      real(wp), intent(inout) :: y(s, n)
      y = y + x
   end subroutine accumulate

   !> z = x - y; total = total + z.
   pure subroutine residual(n, x, y, z, total)
      integer, intent(in) :: n
      real(wp), intent(in) :: x(s, n), y(s, n)
      real(wp), intent(out) :: z(s, n)
      real(wp), intent(inout) :: total(s, n)
      integer :: j, l
      do j = 1, n
         !$omp simd
         do l = 1, s
            z(l, j) = x(l, j) - y(l, j)
            total(l, j) = total(l, j) + z(l, j)
         end do
      end do
   end subroutine residual

   !> y = x.
   pure subroutine copy(n, x, y)
      integer, intent(in) :: n
      real(wp), intent(in) :: x(s, n)
      real(wp), intent(out) :: y(s, n)
      y = x
   end subroutine copy

end module rodyn_lane_algebra
