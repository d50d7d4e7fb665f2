!> Newton systems of a chain in O(n): elimination of the rods from the tip inward, exact.
!>
!> With changes dq = dq0 + g^2 x, dp = dp0 + g x of coordinates and rates (g: CVODE's gamma, x: change of p') the
!> balance of rod k is linear in the motion of its inner end and its own x. What rod k - 1 has to know of the chain
!> beyond it is
!>     (fe, fn, -T) = P (dAe, dAn, tau) + P_w w' + b:
!> force and moment at hinge k - 1 by the change of acceleration dA of the node, by the rotation g^2 tau of the end
!> tangent of rod k - 1, and by the spacecraft's w', which turns every rod. The unknowns of rod k are taken in the order
!> alpha, beta, and then the rotation t = phi + alpha of the inner end tangent, to which the hinge is attached by
!>     T_{k-1} = c (t - tau),   c = g^2 C + g D:
!> with stiff rods and hinges everything turns together and P becomes that of a rigid body as a sum of inertias.
!> Had phi been eliminated before, it would be the difference of two stiffnesses.
!>
!> Rigid rods have t = phi alone. Massless rods that bend are in `rodyn_newton_series`.
!> The same equations elsewhere: docs/model.md sec. 7.
module rodyn_newton_chain
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use rodyn_kinds, only: wp
   use rodyn_rod_constants, only: rod_constants
   use rodyn_newton_tangent, only: rod_tangent
   implicit none (type, external)
   private
   public :: rod_factor, factorise_chain, reduce_chain, expand_chain, eliminate_slopes, eliminate_turn, turn_axes

   !> What elimination of a rod leaves for the solutions. Columns: dAe, dAn, w', t.
   type :: rod_factor
      real(wp) :: outer(3, 2)       !! P of the chain beyond the outer node, mass there included, columns dAe, dAn
      real(wp) :: ae_w, ae_phi, an_phi !! change of acceleration of the outer node by w' and phi (by w' across: l)
      real(wp) :: bending(2, 2)     !! inverse of the block of alpha, beta
      real(wp) :: slope(2, 4)       !! (alpha, beta) = y - slope (dAe, dAn, w', t)
      real(wp) :: force(3, 2)       !! rows fe, fn, t: by alpha, beta
      real(wp) :: by_turn(2)        !! fe, fn by t
      real(wp) :: turn(3)           !! t = t0 + turn_hinge tau - turn (dAe, dAn, w')
      real(wp) :: turn_hinge
      real(wp) :: softness          !! t by a moment on the inner end
   end type rod_factor

contains

   !> Eliminate all rods. A fixed spacecraft ignores the answer.
   pure subroutine factorise_chain(n, gamma, bends, rods, rod_of, node_mass, hinge, tangent, factor, apparent, by_omega, ok)
      integer, intent(in) :: n
      real(wp), intent(in) :: gamma                !! [s]
      logical, intent(in) :: bends                 !! alpha and beta are unknowns
      type(rod_constants), intent(in) :: rods(:)
      integer, intent(in) :: rod_of(n)
      real(wp), intent(in) :: node_mass(0:n)       !! [kg]
      real(wp), intent(in) :: hinge(0:n - 1)       !! c = g^2 C + g D
      type(rod_tangent), intent(in) :: tangent(n)
      type(rod_factor), intent(inout) :: factor(n)
      real(wp), intent(out) :: apparent(3, 2)      !! P at hinge 0, moving axes, columns dAx, dAy
      real(wp), intent(out) :: by_omega(3)         !! P_w there
      logical, intent(out) :: ok                   !! false: singular
      real(wp) :: p(3, 3), pw(3), q(5, 6), r(3, 4)
      integer :: k

      p = 0.0_wp
      pw = 0.0_wp
      do k = n, 1, -1
         associate (rod => rods(rod_of(k)), t => tangent(k), f => factor(k))
            p(1, 1) = p(1, 1) + node_mass(k)
            p(2, 2) = p(2, 2) + node_mass(k)
            f%outer = p(:, 1:2)
            f%ae_w = -2.0_wp*gamma*rod%length*t%w
            f%ae_phi = f%ae_w - gamma**2*rod%length*t%wr
            f%an_phi = rod%length*(1.0_wp - (gamma*t%w)**2)
            call rod_equations(rod, t, gamma, bends, p, pw, f, q)
            if (bends) then
               call eliminate_slopes(q, f, r)
            else
               r = q(1:3, 1:4)
            end if
            call eliminate_turn(r, hinge(k - 1), f, p, pw)
            call turn_axes(t%cd, t%sd, p, pw)
         end associate
      end do
      apparent = p(:, 1:2)
      by_omega = pw
      ok = all(ieee_is_finite(p))
   end subroutine factorise_chain

   !> Rows fe, fn, t, alpha, beta of one rod with the chain beyond it; columns dAe, dAn, w', t, alpha, beta with
   !> phi = t - alpha. The hinges' moments are those of the outer hinge; T_{k-1} is left out.
   pure subroutine rod_equations(rod, t, gamma, bends, p, pw, f, q)
      type(rod_constants), intent(in) :: rod
      type(rod_tangent), intent(in) :: t
      real(wp), intent(in) :: gamma
      logical, intent(in) :: bends
      real(wp), intent(in) :: p(3, 3), pw(3) !! of the chain from the outer node, mass included, axes of this rod
      type(rod_factor), intent(in) :: f
      real(wp), intent(out) :: q(5, 6)
      real(wp) :: g2, by_w(3), by_phi(3)

      g2 = gamma**2
      associate (i => rod%inertia, length => rod%length)
         by_w = p(:, 1)*f%ae_w + p(:, 2)*length + pw
         by_phi = p(:, 1)*f%ae_phi + p(:, 2)*f%an_phi + p(:, 3)
         q(1:2, 1:2) = p(1:2, 1:2)
         q(1, 1) = q(1, 1) + i%m0
         q(2, 2) = q(2, 2) + i%m0
         q(3, 1) = length*p(2, 1) + p(3, 1) - t%mv
         q(3, 2) = length*p(2, 2) + p(3, 2) + i%m1
         ! By w', and by phi, which adds the column of W'.
         q(1, 3) = -t%mv + gamma*t%fe_w
         q(2, 3) = i%m1 + gamma*t%fn_w
         q(3, 3) = i%m2 + t%mvv + gamma*t%phi_w
         q(1, 4) = q(1, 3) + g2*t%fe_phi + by_phi(1)
         q(2, 4) = q(2, 3) + g2*t%fn_phi + by_phi(2)
         q(3, 4) = q(3, 3) + g2*t%phi_phi + length*by_phi(2) + by_phi(3)
         q(1, 3) = q(1, 3) + by_w(1)
         q(2, 3) = q(2, 3) + by_w(2)
         q(3, 3) = q(3, 3) + length*by_w(2) + by_w(3)
         if (.not. bends) return
         q(4, 1) = 0.0_wp
         q(5, 1) = p(3, 1)
         q(4, 2) = i%a1
         q(5, 2) = i%b1 + p(3, 2)
         q(4, 3) = i%sa + gamma*t%a_w
         q(5, 3) = i%sb + gamma*t%b_w
         q(4, 4) = q(4, 3) + g2*t%a_phi
         q(5, 4) = q(5, 3) + g2*t%b_phi + by_phi(3)
         q(5, 3) = q(5, 3) + by_w(3)
         q(1, 5) = gamma*t%fe_va + g2*t%fe_a
         q(2, 5) = i%a1 + g2*t%fn_a
         q(3, 5) = i%sa + gamma*t%phi_va + g2*t%phi_a
         q(4, 5) = i%aa + g2*t%a_a
         q(5, 5) = i%ab + g2*t%a_b
         q(1, 6) = gamma*t%fe_vb + g2*t%fe_b + p(1, 3)
         q(2, 6) = i%b1 + g2*t%fn_b + p(2, 3)
         q(3, 6) = i%sb + gamma*t%phi_vb + g2*t%phi_b + length*p(2, 3) + p(3, 3)
         q(4, 6) = i%ab + g2*t%a_b
         q(5, 6) = i%bb + g2*t%b_b + p(3, 3)
      end associate
      q(:, 5) = q(:, 5) - q(:, 4)
      q(4, :) = q(4, :) - q(3, :)
   end subroutine rod_equations

   !> Schur complement of the block of alpha and beta.
   pure subroutine eliminate_slopes(q, f, r)
      real(wp), intent(in) :: q(5, 6)
      type(rod_factor), intent(inout) :: f
      real(wp), intent(out) :: r(3, 4)
      real(wp) :: pivot, lower, upper, schur
      integer :: j

      ! Inverse by elimination, alpha first, so that a block stiff against its determinant loses nothing.
      pivot = 1.0_wp/q(4, 5)
      lower = q(5, 5)*pivot
      upper = q(4, 6)*pivot
      schur = 1.0_wp/(q(5, 6) - lower*q(4, 6))
      f%bending(2, 2) = schur
      f%bending(2, 1) = -schur*lower
      f%bending(1, 2) = -schur*upper
      f%bending(1, 1) = pivot + upper*schur*lower
      f%force = q(1:3, 5:6)
      do j = 1, 4
         f%slope(1, j) = f%bending(1, 1)*q(4, j) + f%bending(1, 2)*q(5, j)
         f%slope(2, j) = f%bending(2, 1)*q(4, j) + f%bending(2, 2)*q(5, j)
         r(:, j) = q(1:3, j) - f%force(:, 1)*f%slope(1, j) - f%force(:, 2)*f%slope(2, j)
      end do
   end subroutine eliminate_slopes

   !> The inner end on its hinge: (r33 + c) t = c tau - r (dAe, dAn, w').
   pure subroutine eliminate_turn(r, c, f, p, pw)
      real(wp), intent(in) :: r(3, 4), c
      type(rod_factor), intent(inout) :: f
      real(wp), intent(out) :: p(3, 3), pw(3)
      integer :: j

      f%softness = 1.0_wp/(r(3, 4) + c)
      f%turn = r(3, 1:3)*f%softness
      f%turn_hinge = c*f%softness
      f%by_turn = r(1:2, 4)
      do j = 1, 2
         p(1:2, j) = r(1:2, j) - f%by_turn*f%turn(j)
         p(3, j) = c*f%turn(j)
      end do
      p(1:2, 3) = f%by_turn*f%turn_hinge
      p(3, 3) = f%turn_hinge*r(3, 4)
      pw(1:2) = r(1:2, 3) - f%by_turn*f%turn(3)
      pw(3) = c*f%turn(3)
   end subroutine eliminate_turn

   !> From the axes of rod k to those of rod k - 1.
   pure subroutine turn_axes(cd, sd, p, pw)
      real(wp), intent(in) :: cd, sd
      real(wp), intent(inout) :: p(3, 3), pw(3)
      real(wp) :: x, y
      integer :: j

      do j = 1, 3
         x = p(1, j)
         y = p(2, j)
         p(1, j) = cd*x - sd*y
         p(2, j) = sd*x + cd*y
      end do
      do j = 1, 3
         x = p(j, 1)
         y = p(j, 2)
         p(j, 1) = cd*x - sd*y
         p(j, 2) = sd*x + cd*y
      end do
      x = pw(1)
      y = pw(2)
      pw(1) = cd*x - sd*y
      pw(2) = sd*x + cd*y
   end subroutine turn_axes

   !> Inward pass of a solution: known changes dq0, dp0, and known parts T0 of the hinges' moments, as forces on hinge 0.
   pure subroutine reduce_chain(n, bends, rods, rod_of, hinge, tangent, factor, d_omega, phi, alpha, beta, phi_rate, &
                                alpha_rate, beta_rate, moment, left, known)
      integer, intent(in) :: n
      logical, intent(in) :: bends         !! alpha and beta are unknowns
      type(rod_constants), intent(in) :: rods(:)
      integer, intent(in) :: rod_of(n)
      real(wp), intent(in) :: hinge(0:n - 1)
      type(rod_tangent), intent(in) :: tangent(n)
      type(rod_factor), intent(in) :: factor(n)
      real(wp), intent(in) :: d_omega                                !! dp0 of w
      real(wp), intent(in) :: phi(n), alpha(*), beta(*)                !! dq0
      real(wp), intent(in) :: phi_rate(n), alpha_rate(*), beta_rate(*) !! dp0
      real(wp), intent(in) :: moment(0:n)                            !! T0
      real(wp), intent(out) :: left(3, n)  !! for the outward pass: t, alpha, beta of a rod at rest
      real(wp), intent(out) :: known(3)    !! b at hinge 0, moving axes, T0 not included
      real(wp) :: be, bn, bt, dw, along, across, row_phi, row_a, row_b, x
      integer :: k

      be = 0.0_wp
      bn = 0.0_wp
      bt = 0.0_wp
      do k = n, 1, -1
         associate (t => tangent(k), f => factor(k), length => rods(rod_of(k))%length)
            dw = d_omega + phi_rate(k)
            along = -length*(2.0_wp*t%w*dw + t%wr*phi(k))
            across = -length*t%w**2*phi(k)
            be = be + f%outer(1, 1)*along + f%outer(1, 2)*across
            bn = bn + f%outer(2, 1)*along + f%outer(2, 2)*across
            bt = bt + f%outer(3, 1)*along + f%outer(3, 2)*across
            row_phi = t%phi_w*dw + t%phi_phi*phi(k) + length*bn + bt - (moment(k) - moment(k - 1))
            be = be + t%fe_w*dw + t%fe_phi*phi(k)
            bn = bn + t%fn_w*dw + t%fn_phi*phi(k)
            left(2:3, k) = 0.0_wp
            if (bends) then
               be = be + t%fe_va*alpha_rate(k) + t%fe_vb*beta_rate(k) + t%fe_a*alpha(k) + t%fe_b*beta(k)
               bn = bn + t%fn_a*alpha(k) + t%fn_b*beta(k)
               row_phi = row_phi + t%phi_va*alpha_rate(k) + t%phi_vb*beta_rate(k) + t%phi_a*alpha(k) + t%phi_b*beta(k)
               row_a = t%a_w*dw + t%a_phi*phi(k) + t%a_a*alpha(k) + t%a_b*beta(k) + moment(k - 1) - row_phi
               row_b = t%b_w*dw + t%b_phi*phi(k) + t%a_b*alpha(k) + t%b_b*beta(k) - moment(k) + bt
               left(2, k) = -f%bending(1, 1)*row_a - f%bending(1, 2)*row_b
               left(3, k) = -f%bending(2, 1)*row_a - f%bending(2, 2)*row_b
               be = be + f%force(1, 1)*left(2, k) + f%force(1, 2)*left(3, k)
               bn = bn + f%force(2, 1)*left(2, k) + f%force(2, 2)*left(3, k)
               row_phi = row_phi + f%force(3, 1)*left(2, k) + f%force(3, 2)*left(3, k)
            end if
            left(1, k) = -row_phi*f%softness
            be = be + f%by_turn(1)*left(1, k)
            bn = bn + f%by_turn(2)*left(1, k)
            bt = -hinge(k - 1)*left(1, k)
            x = t%cd*be - t%sd*bn
            bn = t%sd*be + t%cd*bn
            be = x
         end associate
      end do
      known = [be, bn, bt]
   end subroutine reduce_chain

   !> Outward pass: the unknowns of all rods from the motion of hinge 0.
   pure subroutine expand_chain(n, bends, rods, rod_of, tangent, factor, d_omega, phi, phi_rate, omega_rate, hinge_x, hinge_y, &
                                left)
      integer, intent(in) :: n
      logical, intent(in) :: bends
      type(rod_constants), intent(in) :: rods(:)
      integer, intent(in) :: rod_of(n)
      type(rod_tangent), intent(in) :: tangent(n)
      type(rod_factor), intent(in) :: factor(n)
      real(wp), intent(in) :: d_omega, phi(n), phi_rate(n) !! as for reduce_chain
      real(wp), intent(in) :: omega_rate       !! change of w'
      real(wp), intent(in) :: hinge_x, hinge_y !! dA of hinge 0, moving axes
      real(wp), intent(inout) :: left(3, n)    !! in: from reduce_chain; out: x of phi, alpha, beta
      real(wp) :: ae, an, tau, turn, x, dw
      integer :: k

      ae = hinge_x
      an = hinge_y
      tau = 0.0_wp
      do k = 1, n
         associate (t => tangent(k), f => factor(k), length => rods(rod_of(k))%length)
            x = t%cd*ae + t%sd*an
            an = t%cd*an - t%sd*ae
            ae = x
            turn = left(1, k) + f%turn_hinge*tau - (f%turn(1)*ae + f%turn(2)*an + f%turn(3)*omega_rate)
            left(1, k) = turn
            tau = turn
            if (bends) then
               left(2:3, k) = left(2:3, k) - (f%slope(:, 1)*ae + f%slope(:, 2)*an + f%slope(:, 3)*omega_rate + f%slope(:, 4)*turn)
               left(1, k) = turn - left(2, k)
               tau = left(1, k) + left(3, k)
            end if
            dw = d_omega + phi_rate(k)
            ae = ae - length*(2.0_wp*t%w*dw + t%wr*phi(k)) + f%ae_w*omega_rate + f%ae_phi*left(1, k)
            an = an - length*t%w**2*phi(k) + length*omega_rate + f%an_phi*left(1, k)
         end associate
      end do
   end subroutine expand_chain

end module rodyn_newton_chain
