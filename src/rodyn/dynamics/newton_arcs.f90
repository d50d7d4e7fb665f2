!> Newton systems in O(n) of chains whose rods keep their arcs: `rodyn_newton_chain` with rods that draw their outer nodes in.
!>
!> Unknowns, hinges and elimination are those of that module. A rod's rows (f_e, f_n, phi, alpha, beta) are
!>     m (dA, W', alpha'', beta'') + g (dW, dalpha', dbeta') + k (dphi, dalpha, dbeta) + J^T (change of force on the outer node),
!> and its outer node accelerates by dA + J (W', alpha'', beta'') + g_o (...) + k_o (...). All of these are small matrices, found by
!> derivatives of the rod in one direction after the other (`differentiate_rod`).
!> The same equations elsewhere: docs/model.md sec. 7.
module rodyn_newton_arcs
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use rodyn_kinds, only: wp
   use rodyn_bending_matrices, only: most_shapes
   use rodyn_foreshortening, only: shorten
   use rodyn_linearisation, only: differentiate_rod
   use rodyn_newton_chain, only: rod_factor, eliminate_slopes, eliminate_turn, turn_axes
   use rodyn_recursion_joints, only: rod_alone
   use rodyn_scene, only: scene_type
   implicit none (type, external)
   private
   public :: arc_tangent, linearise_arcs, factorise_arcs, reduce_arcs, expand_arcs

   integer, parameter :: most = 3 + most_shapes

   !> A rod at a state, in its axes. Rows f_e, f_n, phi, alpha, beta; columns (W', alpha'', beta'') and so on.
   type :: arc_tangent
      real(wp) :: cd = 1.0_wp, sd = 0.0_wp !! cosine and sine of the turn from the axes of rod k - 1
      real(wp) :: inner(2), outer(2)       !! acceleration of the inner and the outer node
      real(wp) :: mass(5, 5), gyration(5, 3), stiffness(5, 3) !! stiffness with that of the force on the outer node
      real(wp) :: outer_mass(2, 3), outer_gyration(2, 3), outer_stiffness(2, 3) !! by which the outer node is moved
   end type arc_tangent

contains

   !> Tangents of all rods.
   pure subroutine linearise_arcs(scene, sine, cosine, q, p, a, loaded, node_force, tangent)
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: sine(0:), cosine(0:) !! of phi (0:n); 0 and 1 at 0
      real(wp), intent(in) :: q(:), p(:)           !! state (dof)
      real(wp), intent(in) :: a(:)                 !! accelerations p' there (dof)
      logical, intent(in) :: loaded                !! node_force is to be used
      real(wp), intent(in) :: node_force(:, :)     !! X, Y at the nodes (2, n) [N]
      type(arc_tangent), intent(inout) :: tangent(:) !! (n)
      real(wp) :: force(2), own(2)
      integer :: k

      call accelerate_nodes(scene, sine, cosine, q, p, a, tangent)
      force = 0.0_wp
      do k = scene%n, 1, -1
         associate (t => tangent(k))
            force = force + scene%node_mass(k)*t%outer
            if (loaded) force = force - [node_force(1, k)*cosine(k) + node_force(2, k)*sine(k), &
                                         node_force(2, k)*cosine(k) - node_force(1, k)*sine(k)]
            call linearise_rod(scene, k, q, p, a, force, t, own)
            force = force + own
            force = [t%cd*force(1) - t%sd*force(2), t%sd*force(1) + t%cd*force(2)]
         end associate
      end do
   end subroutine linearise_arcs

   !> Accelerations of the inner and the outer node of each rod, in its axes.
   pure subroutine accelerate_nodes(scene, sine, cosine, q, p, a, tangent)
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: sine(0:), cosine(0:), q(:), p(:), a(:)
      type(arc_tangent), intent(inout) :: tangent(:)
      real(wp) :: node(2), w, wr, u(most_shapes)
      integer :: k

      node = 0.0_wp
      if (scene%n_base > 0) then
         associate (x => scene%body%hinge_x, y => scene%body%hinge_y)
            node = [a(1) - p(3)*p(2) - a(3)*y - p(3)**2*x, a(2) + p(3)*p(1) + a(3)*x - p(3)**2*y]
         end associate
      end if
      do k = 1, scene%n
         call turning(scene, k, p, a, w, wr)
         u = scene%bends(k, p)
         associate (t => tangent(k), shortening => scene%bending(scene%rod_of(k))%shortening)
            t%cd = cosine(k)*cosine(k - 1) + sine(k)*sine(k - 1)
            t%sd = sine(k)*cosine(k - 1) - cosine(k)*sine(k - 1)
            t%inner = [t%cd*node(1) + t%sd*node(2), t%cd*node(2) - t%sd*node(1)]
            t%outer = t%inner + scene%chord(k, q)*[-w**2, wr] + &
                          [-dot_product(matmul(shortening, scene%bends(k, q)), scene%bends(k, a)) - &
                           dot_product(u, matmul(shortening, u)), 2.0_wp*w*scene%chord_rate(k, q, p)]
            node = t%outer
         end associate
      end do
   end subroutine accelerate_nodes

   !> W and W' of rod k.
   pure subroutine turning(scene, k, p, a, w, wr)
      type(scene_type), intent(in) :: scene
      integer, intent(in) :: k
      real(wp), intent(in) :: p(:), a(:)
      real(wp), intent(out) :: w, wr

      w = p(scene%phi_at() + k)
      wr = a(scene%phi_at() + k)
      if (scene%n_base == 0) return
      w = w + p(3)
      wr = wr + a(3)
   end subroutine turning

   !> Matrices of one rod, and its own force on the inner node.
   pure subroutine linearise_rod(scene, k, q, p, a, force, t, own)
      type(scene_type), intent(in) :: scene
      integer, intent(in) :: k
      real(wp), intent(in) :: q(:), p(:), a(:)
      real(wp), intent(in) :: force(2)             !! on the outer node
      type(arc_tangent), intent(inout) :: t
      real(wp), intent(out) :: own(2)
      real(wp), dimension(most_shapes) :: x, u, acc, dx, du, slope, slope_rate, slope_acc
      real(wp) :: change(most), h(most, most), c(most), w, wr, inner(2), carried(2)
      integer :: j

      inner = t%inner
      carried = t%outer - t%inner
      x = scene%bends(k, q)
      u = scene%bends(k, p)
      acc = scene%bends(k, a)
      call turning(scene, k, p, a, w, wr)
      associate (bend => scene%bending(scene%rod_of(k)), chord => scene%chord(k, q))
         call rod_alone(scene%rods(scene%rod_of(k))%inertia, bend, x, u, w, .false., h, c)
         call shorten(bend, x, u, w, h, c)
         do j = 1, 5
            t%mass(:j, j) = h(:j, j)
            t%mass(j, :j) = h(:j, j)
         end do
         slope = matmul(bend%shortening, x)
         slope_rate = matmul(bend%shortening, u)
         slope_acc = matmul(bend%shortening, acc)
         t%outer_mass = reshape([0.0_wp, chord, -slope(1), 0.0_wp, -slope(2), 0.0_wp], [2, 3])
         t%outer_gyration(:, 1) = -2.0_wp*[w*chord, dot_product(slope, u)]
         t%outer_stiffness(:, 1) = [-carried(2), carried(1)]
         do j = 1, 2
            t%outer_gyration(:, 1 + j) = -2.0_wp*[slope_rate(j), w*slope(j)]
            t%outer_stiffness(:, 1 + j) = [slope(j)*w**2 - slope_acc(j), -slope(j)*wr - 2.0_wp*w*slope_rate(j)]
         end do
         dx = 0.0_wp
         du = 0.0_wp
         call differentiate_rod(scene, k, x, u, acc, w, wr, inner(1), inner(2), dx, du, 1.0_wp, 0.0_wp, 0.0_wp, own, change)
         t%gyration(:, 1) = change(:5)
         call differentiate_rod(scene, k, x, u, acc, w, wr, inner(1), inner(2), dx, du, 0.0_wp, inner(2), -inner(1), own, change)
         t%stiffness(:, 1) = change(:5) + [-own(2), own(1), -chord*force(1), -slope(1)*force(2), -slope(2)*force(2)]
         do j = 1, 2
            dx(j) = 1.0_wp
            call differentiate_rod(scene, k, x, u, acc, w, wr, inner(1), inner(2), dx, du, 0.0_wp, 0.0_wp, 0.0_wp, own, change)
            t%stiffness(:, 1 + j) = change(:5) - [0.0_wp, 0.0_wp, slope(j)*force(2), bend%shortening(1:2, j)*force(1)]
            call differentiate_rod(scene, k, x, u, acc, w, wr, inner(1), inner(2), du, dx, 0.0_wp, 0.0_wp, 0.0_wp, own, change)
            t%gyration(:, 1 + j) = change(:5)
            dx(j) = 0.0_wp
         end do
      end associate
   end subroutine linearise_rod

   !> Eliminate all rods. A fixed spacecraft ignores the answer.
   pure subroutine factorise_arcs(n, gamma, node_mass, hinge, tangent, factor, apparent, by_omega, ok)
      integer, intent(in) :: n
      real(wp), intent(in) :: gamma                !! [s]
      real(wp), intent(in) :: node_mass(0:n)       !! [kg]
      real(wp), intent(in) :: hinge(0:n - 1)       !! c = g^2 C + g D
      type(arc_tangent), intent(in) :: tangent(n)
      type(rod_factor), intent(inout) :: factor(n)
      real(wp), intent(out) :: apparent(3, 2)      !! P at hinge 0, moving axes, columns dAx, dAy
      real(wp), intent(out) :: by_omega(3)         !! P_w there
      logical, intent(out) :: ok                   !! false: singular
      real(wp) :: p(3, 3), pw(3), q(5, 6), r(3, 4)
      integer :: k

      p = 0.0_wp
      pw = 0.0_wp
      do k = n, 1, -1
         associate (t => tangent(k), f => factor(k))
            p(1, 1) = p(1, 1) + node_mass(k)
            p(2, 2) = p(2, 2) + node_mass(k)
            f%outer = p(:, 1:2)
            call rod_equations(t, gamma, p, pw, q)
            call eliminate_slopes(q, f, r)
            call eliminate_turn(r, hinge(k - 1), f, p, pw)
            call turn_axes(t%cd, t%sd, p, pw)
         end associate
      end do
      apparent = p(:, 1:2)
      by_omega = pw
      ok = all(ieee_is_finite(p))
   end subroutine factorise_arcs

   !> Change of the acceleration of the outer node by (w', phi, alpha, beta).
   pure function moved(t, gamma) result(by)
      type(arc_tangent), intent(in) :: t
      real(wp), intent(in) :: gamma
      real(wp) :: by(2, 4)
      by(:, 1) = t%outer_mass(:, 1) + gamma*t%outer_gyration(:, 1)
      by(:, 2:) = t%outer_mass + gamma*(t%outer_gyration + gamma*t%outer_stiffness)
   end function moved

   !> Rows fe, fn, t, alpha, beta of one rod with the chain beyond it; columns dAe, dAn, w', t, alpha, beta with phi = t - alpha.
   !> The hinges' moments are those of the outer hinge; T_{k-1} is left out.
   pure subroutine rod_equations(t, gamma, p, pw, q)
      type(arc_tangent), intent(in) :: t
      real(wp), intent(in) :: gamma
      real(wp), intent(in) :: p(3, 3), pw(3) !! of the chain from the outer node, mass included, axes of this rod
      real(wp), intent(out) :: q(5, 6)
      real(wp) :: answer(3, 6) ! of the chain beyond

      q(:, :3) = t%mass(:, :3)
      q(:, 3) = q(:, 3) + gamma*t%gyration(:, 1)
      q(:, 4:) = t%mass(:, 3:) + gamma*(t%gyration + gamma*t%stiffness)
      answer(:, 1:2) = p(:, 1:2)
      answer(:, 3:) = matmul(p(:, 1:2), moved(t, gamma))
      answer(:, 3) = answer(:, 3) + pw
      answer(:, 4) = answer(:, 4) + p(:, 3) ! the outer end tangent turns by phi + beta
      answer(:, 6) = answer(:, 6) + p(:, 3)
      q(1:2, :) = q(1:2, :) + answer(1:2, :)
      q(3:5, :) = q(3:5, :) + matmul(transpose(t%outer_mass), answer(1:2, :))
      q(3, :) = q(3, :) + answer(3, :)
      q(5, :) = q(5, :) + answer(3, :)
      q(:, 5) = q(:, 5) - q(:, 4)
      q(4, :) = q(4, :) - q(3, :)
   end subroutine rod_equations

   !> Inward pass of a solution: known changes dq0, dp0, and known parts T0 of the hinges' moments, as forces on hinge 0.
   pure subroutine reduce_arcs(n, hinge, tangent, factor, d_omega, phi, alpha, beta, phi_rate, alpha_rate, beta_rate, moment, &
                               left, known)
      integer, intent(in) :: n
      real(wp), intent(in) :: hinge(0:n - 1)
      type(arc_tangent), intent(in) :: tangent(n)
      type(rod_factor), intent(in) :: factor(n)
      real(wp), intent(in) :: d_omega                                        !! dp0 of w
      real(wp), dimension(n), intent(in) :: phi, alpha, beta                 !! dq0
      real(wp), dimension(n), intent(in) :: phi_rate, alpha_rate, beta_rate  !! dp0
      real(wp), intent(in) :: moment(0:n)                                    !! T0
      real(wp), intent(out) :: left(3, n)  !! for the outward pass: t, alpha, beta of a rod at rest
      real(wp), intent(out) :: known(3)    !! b at hinge 0, moving axes, T0 not included
      real(wp) :: b(3), row(5), dq(3), dp(3)
      integer :: k

      b = 0.0_wp
      do k = n, 1, -1
         associate (t => tangent(k), f => factor(k))
            dq = [phi(k), alpha(k), beta(k)]
            dp = [d_omega + phi_rate(k), alpha_rate(k), beta_rate(k)]
            b = b + matmul(f%outer, matmul(t%outer_gyration, dp) + matmul(t%outer_stiffness, dq))
            row = matmul(t%gyration, dp) + matmul(t%stiffness, dq)
            row(1:2) = row(1:2) + b(1:2)
            row(3:5) = row(3:5) + matmul(b(1:2), t%outer_mass)
            row(3) = row(3) + b(3) - (moment(k) - moment(k - 1))
            row(4) = row(4) + moment(k - 1) - row(3)
            row(5) = row(5) + b(3) - moment(k)
            left(2:3, k) = -matmul(f%bending, row(4:5))
            row(:3) = row(:3) + matmul(f%force, left(2:3, k))
            left(1, k) = -row(3)*f%softness
            row(1:2) = row(1:2) + f%by_turn*left(1, k)
            b = [t%cd*row(1) - t%sd*row(2), t%sd*row(1) + t%cd*row(2), -hinge(k - 1)*left(1, k)]
         end associate
      end do
      known = b
   end subroutine reduce_arcs

   !> Outward pass: the unknowns of all rods from the motion of hinge 0.
   pure subroutine expand_arcs(n, gamma, tangent, factor, d_omega, phi, alpha, beta, phi_rate, alpha_rate, beta_rate, omega_rate, &
                               hinge_acceleration, left)
      integer, intent(in) :: n
      real(wp), intent(in) :: gamma
      type(arc_tangent), intent(in) :: tangent(n)
      type(rod_factor), intent(in) :: factor(n)
      real(wp), intent(in) :: d_omega !! as for reduce_arcs
      real(wp), dimension(n), intent(in) :: phi, alpha, beta, phi_rate, alpha_rate, beta_rate
      real(wp), intent(in) :: omega_rate            !! change of w'
      real(wp), intent(in) :: hinge_acceleration(2) !! dA of hinge 0, moving axes
      real(wp), intent(inout) :: left(3, n)         !! in: from reduce_arcs; out: x of phi, alpha, beta
      real(wp) :: node(2), tau, moving(4), by(2, 4), dq(3), dp(3)
      integer :: k

      node = hinge_acceleration
      tau = 0.0_wp
      do k = 1, n
         associate (t => tangent(k), f => factor(k))
            node = [t%cd*node(1) + t%sd*node(2), t%cd*node(2) - t%sd*node(1)]
            left(1, k) = left(1, k) + f%turn_hinge*tau - dot_product(f%turn, [node, omega_rate])
            moving = [node, omega_rate, left(1, k)]
            left(2:3, k) = left(2:3, k) - matmul(f%slope, moving)
            left(1, k) = left(1, k) - left(2, k)
            tau = left(1, k) + left(3, k)
            moving = [omega_rate, left(:, k)]
            by = moved(t, gamma)
            dq = [phi(k), alpha(k), beta(k)]
            dp = [d_omega + phi_rate(k), alpha_rate(k), beta_rate(k)]
            node = node + matmul(t%outer_gyration, dp) + matmul(t%outer_stiffness, dq) + matmul(by, moving)
         end associate
      end do
   end subroutine expand_arcs

end module rodyn_newton_arcs
