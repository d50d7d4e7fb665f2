!> Foreshortening of a rod whose arc keeps its length (`inextensible`), docs/model.md sec. 3.
!>
!> A point at s stands at (s - d, v) from the inner node, along and across the chord, with v = N.x and d = x.D(s) x/2. All of its
!> inertia is in integrals over D(s) (`rodyn_rod_integrals`), contracted here with the bending coordinates x and their rates u.
module rodyn_foreshortening
   use rodyn_kinds, only: wp
   use rodyn_bending_matrices, only: bending_matrices, most_shapes
   implicit none (type, external)
   private
   public :: shorten, shorten_tangent, axial_inertia, crossed_inertia

   ! Where element (a, b) of a symmetric matrix stands.
   integer, parameter :: at(most_shapes, most_shapes) = reshape([1, 2, 4, 2, 3, 5, 4, 5, 6], [3, 3])

contains

   !> int m (D x)(D y)^T: for x = y what d' = x.D u adds to the inertia B of the bending coordinates [kg m^2].
   pure function axial_inertia(bending, x, y) result(q)
      type(bending_matrices), intent(in) :: bending
      real(wp), intent(in) :: x(most_shapes), y(most_shapes)
      real(wp) :: q(most_shapes, most_shapes)
      real(wp) :: half(6)
      integer :: i, j, k

      do k = 1, most_shapes
         do i = 1, 6 ! element by element: vector subscripts would take memory at each call
            half(i) = bending%products(i, at(1, k))*y(1) + bending%products(i, at(2, k))*y(2) + bending%products(i, at(3, k))*y(3)
         end do
         do j = 1, most_shapes
            q(j, k) = half(at(1, j))*x(1) + half(at(2, j))*x(2) + half(at(3, j))*x(3)
         end do
      end do
   end function axial_inertia

   !> Z = int m N (D x)^T. The angular momentum about the inner node has W m2 + (t + Z^T x - Z x/2).u [kg m^2].
   pure function crossed_inertia(bending, x) result(z)
      type(bending_matrices), intent(in) :: bending
      real(wp), intent(in) :: x(most_shapes)
      real(wp) :: z(most_shapes, most_shapes)
      integer :: j

      do j = 1, most_shapes
         z(:, j) = bending%across(:, at(1, j))*x(1) + bending%across(:, at(2, j))*x(2) + bending%across(:, at(3, j))*x(3)
      end do
   end function crossed_inertia

   !> What foreshortening adds to the inertia of a rod over (A, W', x''), upper triangle, and to its inertia forces at rest.
   pure subroutine shorten(bending, x, u, w, h, c)
      type(bending_matrices), intent(in) :: bending
      real(wp), intent(in) :: x(most_shapes), u(most_shapes) !! bending coordinates and their rates
      real(wp), intent(in) :: w                              !! W [rad/s]
      real(wp), intent(inout) :: h(3 + most_shapes, 3 + most_shapes), c(3 + most_shapes)
      real(wp) :: z(most_shapes, most_shapes), q(most_shapes, most_shapes), drawn(most_shapes), carried(most_shapes), moment

      drawn = times(bending%drawn, x)
      moment = 0.5_wp*dot_product(x, drawn)
      z = crossed_inertia(bending, x)
      q = axial_inertia(bending, x, x)
      carried = times(q, x)
      h(1, 4:) = h(1, 4:) - drawn
      h(2, 3) = h(2, 3) - moment
      h(3, 3) = h(3, 3) + 0.25_wp*dot_product(x, carried)
      h(3, 4:) = h(3, 4:) + row_times(x, z) - 0.5_wp*times(z, x)
      h(4:, 4:) = h(4:, 4:) + q
      c(1) = c(1) + w**2*moment - dot_product(u, times(bending%drawn, u))
      c(2) = c(2) - 2.0_wp*w*dot_product(u, drawn)
      c(3) = c(3) + w*dot_product(u, carried) + dot_product(x, times(crossed_inertia(bending, u), u))
      c(4:) = c(4:) - 0.5_wp*w**2*carried + 2.0_wp*w*(row_times(u, z) - times(z, u)) + times(axial_inertia(bending, x, u), u)
   end subroutine shorten

   !> What foreshortening adds to the change of a rod's own forces (f_e, f_n, row of W, rows of x), in the axes of the rod, in a
   !> direction (dA, dW, dx, du), with the accelerations A, W', x'' held fixed but for dA.
   pure subroutine shorten_tangent(bending, x, u, acceleration, w, w_rate, ae, an, dx, du, dw, d_ae, d_an, change)
      type(bending_matrices), intent(in) :: bending
      real(wp), dimension(most_shapes), intent(in) :: x, u, acceleration !! bending coordinates, rates, accelerations
      real(wp), intent(in) :: w, w_rate, ae, an                          !! W, W', A along and across
      real(wp), dimension(most_shapes), intent(in) :: dx, du
      real(wp), intent(in) :: dw, d_ae, d_an
      real(wp), intent(inout) :: change(3 + most_shapes)
      real(wp), dimension(most_shapes, most_shapes) :: z, dz, q, dq, xu, uz
      real(wp), dimension(most_shapes) :: drawn, d_drawn, d_turning
      real(wp) :: moment, d_moment

      drawn = times(bending%drawn, x)
      d_drawn = times(bending%drawn, dx)
      moment = 0.5_wp*dot_product(x, drawn)
      d_moment = dot_product(drawn, dx)
      z = crossed_inertia(bending, x)
      dz = crossed_inertia(bending, dx)
      uz = crossed_inertia(bending, u)
      q = axial_inertia(bending, x, x)
      dq = axial_inertia(bending, x, dx)
      dq = dq + transpose(dq)
      xu = axial_inertia(bending, x, u)
      d_turning = row_times(x, dz) + row_times(dx, z) - 0.5_wp*(times(dz, x) + times(z, dx))
      change(1) = change(1) - dot_product(d_drawn, acceleration) + 2.0_wp*w*dw*moment + w**2*d_moment - &
                  2.0_wp*dot_product(du, times(bending%drawn, u))
      change(2) = change(2) - w_rate*d_moment - 2.0_wp*(dw*dot_product(u, drawn) + w*(dot_product(du, drawn) + &
                                                                                    dot_product(u, d_drawn)))
      change(3) = change(3) - d_moment*an - moment*d_an + w_rate*dot_product(x, times(q, dx)) + &
                  dot_product(d_turning, acceleration) + dw*dot_product(x, times(q, u)) + &
                  w*(dot_product(times(q, dx) + times(dq, x), u) + dot_product(x, times(q, du))) + &
                  dot_product(dx, times(uz, u)) + 2.0_wp*dot_product(x, times(uz, du))
      change(4:) = change(4:) - d_drawn*ae - drawn*d_ae + w_rate*d_turning + times(dq, acceleration) - &
                   w*dw*times(q, x) - 0.5_wp*w**2*(times(dq, x) + times(q, dx)) + &
                   2.0_wp*dw*(row_times(u, z) - times(z, u)) + &
                   2.0_wp*w*(row_times(du, z) - times(z, du) + row_times(u, dz) - times(dz, u)) + &
                   times(axial_inertia(bending, dx, u), u) + 2.0_wp*times(xu, du)
   end subroutine shorten_tangent

   !> Matrix times vector. (Where products are arguments of others, the intrinsic takes memory at each call.)
   pure function times(matrix, vector) result(values)
      real(wp), intent(in) :: matrix(most_shapes, most_shapes), vector(most_shapes)
      real(wp) :: values(most_shapes)
      values = matrix(:, 1)*vector(1) + matrix(:, 2)*vector(2) + matrix(:, 3)*vector(3)
   end function times

   !> Vector times matrix.
   pure function row_times(vector, matrix) result(values)
      real(wp), intent(in) :: vector(most_shapes), matrix(most_shapes, most_shapes)
      real(wp) :: values(most_shapes)
      values = vector(1)*matrix(1, :) + vector(2)*matrix(2, :) + vector(3)*matrix(3, :)
   end function row_times

end module rodyn_foreshortening
