!> Exact derivatives of the equations of motion at a state.
!>
!> The balance of a scene,  R(q, p, a) = M(q) a - rhs(q, p) = 0,  is differentiated line by line in a direction
!> (dq, dp) with the accelerations a held fixed: one pass outward for the motion of the nodes, one inward for the
!> forces, O(n) a direction. Then dR/dq is the tangent stiffness, dR/dp the damping and gyroscopic matrix, and
!>     d a = -M^-1 (dR/dq dq + dR/dp dp).
!> The same equations elsewhere: docs/model.md sec. 7.
module rodyn_linearisation
   use rodyn_kinds, only: wp
   use rodyn_scene, only: scene_type
   use rodyn_bending_matrices, only: most_shapes
   use rodyn_foreshortening, only: shorten_tangent
   use rodyn_hinge_law, only: hinge_law, hinge_tangent
   use rodyn_condensed, only: whole_scene, whole_state, expand_slopes, reduce_slopes
   implicit none (type, external)
   private
   public :: balance_tangent, differentiate_rod

contains

   !> dR in the direction (dq, dp).
   pure subroutine balance_tangent(scene, hinges, q, p, a, loaded, node_force, dq, dp, dr)
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      real(wp), intent(in) :: q(:), p(:)   !! state (dof)
      real(wp), intent(in) :: a(:)         !! accelerations p' (dof), held fixed
      logical, intent(in) :: loaded        !! node_force is to be used
      real(wp), intent(in) :: node_force(:, :) !! X, Y at the nodes (2, n) [N]
      real(wp), intent(in) :: dq(:), dp(:) !! direction (as q and p)
      real(wp), intent(out) :: dr(:)       !! change of the balance (dof), rows as in p
      real(wp) :: inner(2, scene%n), d_inner(2, scene%n) ! acceleration of the inner node of rod k and its change
      real(wp) :: moment(0:scene%n), work(0:scene%n - 1)

      associate (first => scene%n_base + 1)
         call hinge_tangent(hinges, scene%n, scene%dynamic_bending, dq(first:), dp(first:), work, moment)
      end associate
      if (scene%condensed) then
         call condensed_tangent(scene, hinges, q, p, a, loaded, node_force, dq, dp, moment, dr)
         return
      end if
      call outward_pass(scene, q, p, a, dq, dp, inner, d_inner)
      call inward_pass(scene, q, p, a, loaded, node_force, dq, dp, inner, d_inner, moment, dr)
   end subroutine balance_tangent

   !> Condensed rods: the inertia of the whole chain, whose slopes follow (`rodyn_condensed`).
   pure subroutine condensed_tangent(scene, hinges, q, p, a, loaded, node_force, dq, dp, moment, dr)
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      real(wp), intent(in) :: q(:), p(:), a(:)
      logical, intent(in) :: loaded
      real(wp), intent(in) :: node_force(:, :), dq(:), dp(:)
      real(wp), intent(in) :: moment(0:) !! changes of the hinge moments (0:n)
      real(wp), intent(out) :: dr(:)
      real(wp) :: inner(2, scene%n), d_inner(2, scene%n), still(0:scene%n)
      real(wp), dimension(scene%n_base + 3*scene%n) :: angles, rates, whole_a, d_angles, d_rates, row
      type(scene_type) :: whole
      integer :: k

      whole = whole_scene(scene)
      still = 0.0_wp
      call whole_state(scene, hinges, q, p, angles, rates)
      call expand_slopes(scene, hinges, a, whole_a, hinges%kink_acceleration)
      call expand_slopes(scene, hinges, dq, d_angles)
      call expand_slopes(scene, hinges, dp, d_rates)
      call outward_pass(whole, angles, rates, whole_a, d_angles, d_rates, inner, d_inner)
      call inward_pass(whole, angles, rates, whole_a, loaded, node_force, d_angles, d_rates, inner, d_inner, still, row)
      call reduce_slopes(scene, hinges, row, dr)
      do k = 1, scene%n
         dr(scene%phi_at() + k) = dr(scene%phi_at() + k) - (moment(k) - moment(k - 1))
      end do
   end subroutine condensed_tangent

   !> Accelerations of the inner nodes: A_k = A_{k-1} + l n W' - l W^2 e.
   pure subroutine outward_pass(scene, q, p, a, dq, dp, inner, d_inner)
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: q(:), p(:), a(:), dq(:), dp(:)
      real(wp), intent(out) :: inner(:, :), d_inner(:, :)
      real(wp) :: node(2), d_node(2), e(2), n(2), w, dw, wr, length, omega, d_omega, omega_rate
      integer :: k, x

      node = 0.0_wp
      d_node = 0.0_wp
      omega = 0.0_wp
      d_omega = 0.0_wp
      omega_rate = 0.0_wp
      if (scene%n_base > 0) then
         omega = p(3)
         d_omega = dp(3)
         omega_rate = a(3)
         e = [scene%body%hinge_x, scene%body%hinge_y]
         node = [a(1) - omega*p(2), a(2) + omega*p(1)] + omega_rate*[-e(2), e(1)] - omega**2*e
         d_node = [-d_omega*p(2) - omega*dp(2), d_omega*p(1) + omega*dp(1)] - 2.0_wp*omega*d_omega*e
      end if
      do k = 1, scene%n
         inner(:, k) = node
         d_inner(:, k) = d_node
         x = scene%phi_at() + k
         length = scene%chord(k, q)
         e = [cos(q(x)), sin(q(x))]
         n = [-e(2), e(1)]
         w = omega + p(x)
         dw = d_omega + dp(x)
         wr = omega_rate + a(x)
         node = node + length*(wr*n - w**2*e)
         d_node = d_node + length*(-dq(x)*(wr*e + w**2*n) - 2.0_wp*w*dw*e)
         if (scene%inextensible) call draw_node(scene, k, q, p, a, dq, dp, e, n, w, dw, wr, node, d_node)
      end do
   end subroutine outward_pass

   !> What foreshortening adds to the acceleration of the outer node of rod k, l'' e + 2 l' W n, and to its change.
   pure subroutine draw_node(scene, k, q, p, a, dq, dp, e, n, w, dw, wr, node, d_node)
      type(scene_type), intent(in) :: scene
      integer, intent(in) :: k
      real(wp), intent(in) :: q(:), p(:), a(:), dq(:), dp(:), e(2), n(2), w, dw, wr
      real(wp), intent(inout) :: node(2), d_node(2)
      real(wp), dimension(most_shapes) :: u, dx, du, acc, slope, d_slope
      real(wp) :: along, across, d_along, d_across

      associate (shortening => scene%bending(scene%rod_of(k))%shortening, d_phi => dq(scene%phi_at() + k))
         u = scene%bends(k, p)
         acc = scene%bends(k, a)
         dx = scene%bends(k, dq)
         du = scene%bends(k, dp)
         slope = matmul(shortening, scene%bends(k, q))
         d_slope = matmul(shortening, dx)
         along = -dot_product(slope, acc) - dot_product(u, matmul(shortening, u))
         across = -2.0_wp*w*dot_product(slope, u)
         d_along = -dot_product(d_slope, acc) - 2.0_wp*dot_product(u, matmul(shortening, du))
         d_across = -2.0_wp*(dw*dot_product(slope, u) + w*(dot_product(d_slope, u) + dot_product(slope, du)))
         node = node + along*e + across*n
         d_node = d_node + d_along*e + d_across*n + d_phi*(along*n - across*e) - dot_product(slope, dx)*(wr*n - w**2*e)
      end associate
   end subroutine draw_node

   !> Inertia forces and rows of the balance, from the tip inward. A force with components (fe, fn) along and
   !> across rod k changes by d(fe), d(fn) and turns with the rod.
   pure subroutine inward_pass(scene, q, p, a, loaded, node_force, dq, dp, inner, d_inner, moment, dr)
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: q(:), p(:), a(:)
      logical, intent(in) :: loaded
      real(wp), intent(in) :: node_force(:, :), dq(:), dp(:), inner(:, :), d_inner(:, :), moment(0:)
      real(wp), intent(out) :: dr(:)
      real(wp) :: force(2), d_force(2), node(2), d_node(2), e(2), n(2), w, dw, wr, omega, d_omega, omega_rate
      real(wp) :: turn
      integer :: k, f

      omega = 0.0_wp
      d_omega = 0.0_wp
      omega_rate = 0.0_wp
      if (scene%n_base > 0) then
         omega = p(3)
         d_omega = dp(3)
         omega_rate = a(3)
      end if
      dr = 0.0_wp
      turn = 0.0_wp
      force = 0.0_wp ! that rod k puts on its outer node, and its change
      d_force = 0.0_wp
      do k = scene%n, 1, -1
         f = scene%phi_at() + k
         e = [cos(q(f)), sin(q(f))]
         n = [-e(2), e(1)]
         w = omega + p(f)
         dw = d_omega + dp(f)
         wr = omega_rate + a(f)
         associate (length => scene%chord(k, q))
            node = inner(:, k) + length*(wr*n - w**2*e)
            d_node = d_inner(:, k) + length*(-dq(f)*(wr*e + w**2*n) - 2.0_wp*w*dw*e)
            if (scene%inextensible) call draw_node(scene, k, q, p, a, dq, dp, e, n, w, dw, wr, node, d_node)
            force = force + scene%node_mass(k)*node
            d_force = d_force + scene%node_mass(k)*d_node
            if (loaded) force = force - node_force(:, k)
            dr(f) = length*(dot_product(n, d_force) - dq(f)*dot_product(e, force)) - (moment(k) - moment(k - 1))
         end associate
         if (scene%inextensible) call pull_slopes(scene, k, q, dq, e, n, force, d_force, dr)
         call add_rod(scene, k, q, p, a, dq, dp, e, n, w, dw, wr, inner(:, k), d_inner(:, k), moment, force, d_force, dr)
         turn = turn + dr(f)
      end do
      if (scene%n_base == 0) return
      node = inner(:, 1) ! hinge 0
      d_force = d_force + scene%node_mass(0)*d_inner(:, 1)
      associate (body => scene%body)
         dr(1) = d_force(1) - body%mass*(d_omega*p(2) + omega*dp(2))
         dr(2) = d_force(2) + body%mass*(d_omega*p(1) + omega*dp(1))
         ! The row of w: the spacecraft turns alone (T_0 acts on it), and every rod turns with it.
         dr(3) = turn + body%hinge_x*d_force(2) - body%hinge_y*d_force(1) - moment(0)
      end associate
   end subroutine inward_pass

   !> The force on the outer node of rod k in the rows of its chord's direction and of its bending coordinates, which move the node
   !> by dl = -slope.dx.
   pure subroutine pull_slopes(scene, k, q, dq, e, n, force, d_force, dr)
      type(scene_type), intent(in) :: scene
      integer, intent(in) :: k
      real(wp), intent(in) :: q(:), dq(:), e(2), n(2), force(2), d_force(2)
      real(wp), intent(inout) :: dr(:)
      real(wp), dimension(most_shapes) :: slope, dx, row
      integer :: f, j

      f = scene%phi_at() + k
      dx = scene%bends(k, dq)
      slope = matmul(scene%bending(scene%rod_of(k))%shortening, scene%bends(k, q))
      dr(f) = dr(f) - dot_product(slope, dx)*dot_product(n, force)
      row = -matmul(scene%bending(scene%rod_of(k))%shortening, dx)*dot_product(e, force) - &
            slope*(dot_product(e, d_force) + dq(f)*dot_product(n, force))
      do j = 1, scene%n_bend
         dr(scene%bend_at(j) + k) = row(j)
      end do
   end subroutine pull_slopes

   !> Rows of rod k, docs/model.md sec. 3, and its share of the force on the inner node.
   pure subroutine add_rod(scene, k, q, p, a, dq, dp, e, n, w, dw, wr, inner, d_inner, moment, force, d_force, dr)
      type(scene_type), intent(in) :: scene
      integer, intent(in) :: k
      real(wp), intent(in) :: q(:), p(:), a(:), dq(:), dp(:)
      real(wp), intent(in) :: e(2), n(2), w, dw, wr, inner(2), d_inner(2), moment(0:)
      real(wp), intent(inout) :: force(2), d_force(2), dr(:)
      real(wp) :: ae, an, own(2), change(3 + most_shapes)
      integer :: f, j

      f = scene%phi_at() + k
      ae = dot_product(inner, e)
      an = dot_product(inner, n)
      associate (d_phi => dq(f))
         call differentiate_rod(scene, k, scene%bends(k, q), scene%bends(k, p), scene%bends(k, a), w, wr, ae, an, &
                                scene%bends(k, dq), scene%bends(k, dp), dw, dot_product(d_inner, e) + d_phi*an, &
                                dot_product(d_inner, n) - d_phi*ae, own, change)
         dr(f) = dr(f) + change(3)
         if (scene%dynamic_bending) then
            change(4) = change(4) + moment(k - 1)
            change(5) = change(5) - moment(k)
         end if
         do j = 1, scene%n_bend
            dr(scene%bend_at(j) + k) = dr(scene%bend_at(j) + k) + change(3 + j)
         end do
         force = force + own(1)*e + own(2)*n
         d_force = d_force + (change(1) - d_phi*own(2))*e + (change(2) + d_phi*own(1))*n
      end associate
   end subroutine add_rod

   !> Force of rod k on its inner node and its change, and that of the rows of W and x, without hinges and chain: in the axes of the
   !> rod, with W' and x'' held fixed.
   pure subroutine differentiate_rod(scene, k, x, v, acc, w, wr, ae, an, dx, dv, dw, d_ae, d_an, own, change)
      type(scene_type), intent(in) :: scene
      integer, intent(in) :: k
      real(wp), dimension(most_shapes), intent(in) :: x, v, acc, dx, dv !! bending coordinates, rates, accelerations; changes
      real(wp), intent(in) :: w, wr, ae, an, dw, d_ae, d_an
      real(wp), intent(out) :: own(2), change(3 + most_shapes)
      real(wp) :: mv, d_mv, d_mv_rate, mv_rate, drawn(most_shapes), drawn_in, sx(most_shapes)

      associate (i => scene%rods(scene%rod_of(k))%inertia, bend => scene%bending(scene%rod_of(k)))
         own = [i%m0*ae - w**2*i%m1, i%m0*an + wr*i%m1]
         change = 0.0_wp
         change(1:3) = [i%m0*d_ae - 2.0_wp*w*dw*i%m1, i%m0*d_an, i%m1*d_an]
         if (.not. scene%dynamic_bending) return
         mv = dot_product(bend%first, x)
         mv_rate = dot_product(bend%first, v)
         d_mv = dot_product(bend%first, dx)
         d_mv_rate = dot_product(bend%first, dv)
         own = own + [-wr*mv - 2.0_wp*w*mv_rate, dot_product(bend%first, acc) - w**2*mv]
         sx = matmul(bend%second, x)
         change(1) = change(1) - wr*d_mv - 2.0_wp*(dw*mv_rate + w*d_mv_rate)
         change(2) = change(2) - 2.0_wp*w*dw*mv - w**2*d_mv
         change(3) = change(3) - d_mv*ae - mv*d_ae + 2.0_wp*wr*dot_product(sx, dx) + 2.0_wp*dw*dot_product(sx, v) + &
                     2.0_wp*w*(dot_product(matmul(bend%second, dx), v) + dot_product(sx, dv))
         change(4:) = bend%first*d_an - matmul(bend%centrifugal, 2.0_wp*w*dw*x + w**2*dx) + matmul(bend%stiffness, dx)
         if (.not. bend%inextensible) return
         drawn = matmul(bend%drawn, x)
         drawn_in = 0.5_wp*dot_product(x, drawn)
         own(1) = own(1) + w**2*drawn_in - dot_product(v, matmul(bend%drawn, v)) - dot_product(drawn, acc)
         own(2) = own(2) - wr*drawn_in - 2.0_wp*w*dot_product(drawn, v)
         call shorten_tangent(bend, x, v, acc, w, wr, ae, an, dx, dv, dw, d_ae, d_an, change)
      end associate
   end subroutine differentiate_rod

end module rodyn_linearisation
