!> Accelerations of a chain of flexible rods in O(n), docs/model.md sec. 3 and 4.2.
!>
!> Seen from its inner node, the chain from rod k outward is an apparent mass P (2x2, symmetric) and a bias
!> force b:  f = P A + b  with A the acceleration of the node. From the tip inward, rod k is added by
!> eliminating first alpha'', beta'' (constant block B, done at compile time: `reduced` inertias) and then W':
!>     D W' + Ce Ae + Cn An = R,  D = d + l^2 pnn,  Ce = l pen - int m v,  Cn = m1 + l pnn,
!> where Ae, An are the components of A along and across the rod and pee, pen, pnn those of P at its outer node.
!>
!> Written as Schur complements (pnn - Cn^2/D, ...) the new P loses as many digits as the outboard mass exceeds
!> the rod's. Here the products are multiplied out, so that the large terms cancel on paper; the determinant of
!> P, which does not depend on the axes, is carried along for the one difference (pee pnn - pen^2) that is left.
!>
!> What takes time is the chain of operations that must wait for each other, from rod to rod. So as much as can be is done
!> beside it: b, and outward A, go from one node and its axes to the next in one step,
!>     b' = T^T b + ...,  A_outer = T A_inner + ...,  T = ((cos, sin), (down, kept)),
!> with the angle from rod to rod in cos and sin, and W' eliminated in down and kept.
!>
!> The same equations elsewhere, in vector lanes for instance: docs/model.md sec. 7.
module rodyn_recursion_flexible
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use rodyn_kinds, only: wp
   use rodyn_outboard_chain, only: outboard_chain, outward_size
   use rodyn_rod_constants, only: rod_constants
   use rodyn_spacecraft, only: spacecraft_body
   use rodyn_spacecraft_accelerations, only: spacecraft_accelerations
   use rodyn_hinge_law, only: hinge_law
   implicit none (type, external)
   private
   public :: flexible_accelerations

   ! Places in `outward` (`rodyn_outboard_chain`).
   integer, parameter :: of_turn = 1, of_along = 3, of_cross = 5, of_alpha = 7, of_beta = 9, of_pull = 11, of_cosine = 13, &
                         of_sine = 15, of_down = 17, of_kept = 19

contains

   !> p' = (Vx', Vy', w', phi'', alpha'', beta'') for given q, p and loads. The hinge moments are formed on the way.
   subroutine flexible_accelerations(n, n_base, rods, rod_of, node_mass, body, sine, cosine, q, p, hinges, &
                                          base_force, loaded, node_force, outward, acceleration, ok)
      integer, intent(in) :: n, n_base              !! rods; 3 or 0 unknowns of the spacecraft
      type(rod_constants), intent(in) :: rods(*)    !! distinct rods
      integer, intent(in) :: rod_of(n)              !! which of them is rod k
      real(wp), intent(in) :: node_mass(0:n)        !! mu [kg]
      type(spacecraft_body), intent(in) :: body     !! mass, inertia, hinge 0
      real(wp), intent(in) :: sine(0:n), cosine(0:n) !! of phi; 0 and 1 at k = 0
      real(wp), intent(in) :: q(n_base + 3*n)       !! coordinates
      real(wp), intent(in) :: p(n_base + 3*n)       !! rates
      type(hinge_law), intent(in) :: hinges         !! springs, dampers and kinks
      real(wp), intent(in) :: base_force(3)         !! X_C, Y_C, M_C, moving axes
      logical, intent(in) :: loaded                 !! node_force is to be used
      real(wp), intent(in) :: node_force(2, *)      !! X, Y at nodes (n), moving axes [N]
      real(wp), intent(out) :: outward(outward_size, n) !! workspace
      real(wp), intent(out) :: acceleration(n_base + 3*n) !! p'
      logical, intent(out) :: ok                    !! false: not finite, or M not positive definite (large deflections in `paper`)
      type(outboard_chain) :: chain
      real(wp) :: omega, omega_rate, ae, an, smallest, base_smallest

      omega = 0.0_wp
      if (n_base > 0) omega = p(3)
      call inward_pass(n, rods, rod_of, node_mass, sine, cosine, q(n_base + 1), q(n_base + n + 1), q(n_base + 2*n + 1), &
                       p(n_base + 1), p(n_base + n + 1), p(n_base + 2*n + 1), omega, hinges, loaded, node_force, outward, chain, &
                       smallest)
      call spacecraft_accelerations(n_base, body, p, chain, base_force, acceleration, ae, an, base_smallest)
      omega_rate = 0.0_wp
      if (n_base > 0) omega_rate = acceleration(3)
      call outward_pass(n, rods, rod_of, outward, omega_rate, ae, an, acceleration(n_base + 1), &
                        acceleration(n_base + n + 1), acceleration(n_base + 2*n + 1))
      ok = ieee_is_finite(an) .and. smallest > 0.0_wp .and. base_smallest > 0.0_wp
   end subroutine flexible_accelerations

   !> The chain as hinge 0 feels it, moving axes, and what the outward pass needs of each rod.
   subroutine inward_pass(n, rods, rod_of, node_mass, sine, cosine, phi, alpha, beta, phi_rate, alpha_rate, beta_rate, &
                               omega, hinges, loaded, node_force, outward, chain, smallest)
      integer, intent(in) :: n
      type(rod_constants), intent(in) :: rods(*)
      integer, intent(in) :: rod_of(n)
      real(wp), intent(in) :: node_mass(0:n), sine(0:n), cosine(0:n)
      real(wp), dimension(n), intent(in) :: phi, alpha, beta, phi_rate, alpha_rate, beta_rate
      real(wp), intent(in) :: omega                   !! w [rad/s]
      type(hinge_law), intent(in) :: hinges
      logical, intent(in) :: loaded
      real(wp), intent(in) :: node_force(2, *)
      real(wp), intent(out) :: outward(outward_size, n)
      type(outboard_chain), intent(out) :: chain
      real(wp), intent(out) :: smallest               !! not positive: M is not positive definite
      integer :: k
      real(wp) :: pee, pen, pnn, det, trace, be, bn, moment_in, moment_out
      real(wp) :: w, w2, lw2, mv, mv_rate, mvv, gq, r0, cd, sd, ee, en, nn

      pee = 0.0_wp
      pen = 0.0_wp
      pnn = 0.0_wp
      det = 0.0_wp
      trace = 0.0_wp
      be = 0.0_wp
      bn = 0.0_wp
      moment_out = 0.0_wp
      smallest = huge(1.0_wp)
      do k = n, 1, -1
         call add_node()
         call bend_hinge()
         call bend_rod()
         moment_out = moment_in
         call add_rod()
         call turn_axes()
      end do
      chain = outboard_chain(pee, pen, pnn, det, be, bn, node_mass(0), moment_out)

   contains

      !> Node k, in the axes of rod k.
      subroutine add_node()
         real(wp) :: mu

         mu = node_mass(k)
         det = det + mu*(trace + mu)
         pee = pee + mu
         pnn = pnn + mu
         if (.not. loaded) return
         be = be - (node_force(1, k)*cosine(k) + node_force(2, k)*sine(k))
         bn = bn - (node_force(2, k)*cosine(k) - node_force(1, k)*sine(k))
      end subroutine add_node

      !> Moment of the inner hinge.
      subroutine bend_hinge()
         real(wp) :: opening, opening_rate

         opening = phi(k) + alpha(k)
         if (k > 1) opening = opening - (phi(k - 1) + beta(k - 1))
         moment_in = hinges%stiffness(k - 1)*opening
         if (hinges%has_damping) then
            opening_rate = phi_rate(k) + alpha_rate(k)
            if (k > 1) opening_rate = opening_rate - (phi_rate(k - 1) + beta_rate(k - 1))
            moment_in = moment_in + hinges%damping(k - 1)*opening_rate
         end if
         if (hinges%has_offsets) moment_in = moment_in - hinges%offset(k - 1)
      end subroutine bend_hinge

      !> Rod k alone: its deflection, and what is left of its forces without alpha'', beta''.
      subroutine bend_rod()
         real(wp) :: qa, qb, hq, mvv_rate

         associate (rod => rods(rod_of(k)), i => rods(rod_of(k))%inertia)
            w = omega + phi_rate(k)
            w2 = w*w
            w = 2.0_wp*w
            lw2 = rod%length*w2
            ! Deflection: int m v, its rate, int m v^2 and int m v v'.
            mv = i%a1*alpha(k) + i%b1*beta(k)
            mv_rate = i%a1*alpha_rate(k) + i%b1*beta_rate(k)
            qa = rod%second(1)*alpha(k) + rod%second(2)*beta(k)
            qb = rod%second(2)*alpha(k) + rod%second(3)*beta(k)
            mvv = alpha(k)*qa + beta(k)*qb
            mvv_rate = alpha_rate(k)*qa + beta_rate(k)*qb

            ! Moments on the slopes; the centrifugal part W^2 B (alpha, beta) leaves B^-1 as W^2 (alpha, beta).
            qa = -moment_in - rod%stiffness(1)*(alpha(k) + rod%carry_over(1)*beta(k))
            qb = moment_out - rod%stiffness(3)*(rod%carry_over(2)*alpha(k) + beta(k))
            gq = rod%g(1)*qa + rod%g(2)*qb
            hq = rod%h(1)*qa + rod%h(2)*qb
            r0 = moment_out - moment_in - hq - w2*(i%sa*alpha(k) + i%sb*beta(k)) - w*mvv_rate
            outward(of_alpha, k) = w2*alpha(k) + rod%b_inverse(1)*qa + rod%b_inverse(2)*qb
            outward(of_beta, k) = w2*beta(k) + rod%b_inverse(2)*qa + rod%b_inverse(3)*qb
         end associate
      end subroutine bend_rod

      !> Rod k with the chain beyond it, as its inner node feels them: P in the axes of rod k, b already in those of rod k - 1.
      subroutine add_rod()
         real(wp) :: d, arm, outer, central, inv, ce, cn, lever, down, kept, r

         associate (rod => rods(rod_of(k)), i => rods(rod_of(k))%inertia)
            ! Row of W', and what follows from it for the outer node.
            cd = cosine(k)*cosine(k - 1) + sine(k)*sine(k - 1)
            sd = sine(k)*cosine(k - 1) - cosine(k)*sine(k - 1)
            d = rod%m2_reduced + mvv
            arm = d - rod%length_m1
            outer = rod%outer + mvv
            central = rod%central + rod%m0_reduced*mvv
            inv = d + rod%length_2*pnn
            smallest = min(smallest, inv)
            inv = 1.0_wp/inv
            ce = rod%length*pen - mv
            cn = rod%m1_reduced + rod%length*pnn
            lever = rod%length*ce
            down = -(arm*sd + lever*cd)*inv
            kept = (arm*cd - lever*sd)*inv
            r0 = r0*inv
            be = be - pee*lw2
            bn = bn - pen*lw2
            outward(of_turn, k) = r0 - (rod%length*inv)*bn
            outward(of_along, k) = ce*inv
            outward(of_cross, k) = cn*inv
            outward(of_pull, k) = lw2
            outward(of_cosine, k) = cd
            outward(of_sine, k) = sd
            outward(of_down, k) = down
            outward(of_kept, k) = kept

            ! Without W'.
            be = be - (w2*i%m1 + w*mv_rate)
            r = (cd*be - sd*gq) + (cd*ce - sd*cn)*r0 + down*bn
            bn = (sd*be + cd*gq) + (sd*ce + cd*cn)*r0 + kept*bn
            be = r
            nn = central + pnn*outer
            ee = pee*d + rod%length_2*det + mv*(2.0_wp*rod%length*pen - mv)
            en = pen*arm + mv*cn
            det = (i%m0*nn + pee*central + det*outer + &
                   mv*(2.0_wp*pen*rod%offset - (rod%m0_reduced + pnn)*mv))*inv
            ee = i%m0 + ee*inv
            en = en*inv
            nn = nn*inv
         end associate
      end subroutine add_rod

      !> P in the axes of rod k - 1 (of the spacecraft for k = 1).
      subroutine turn_axes()
         trace = ee + nn
         pee = cd*cd*ee + sd*(sd*nn - 2.0_wp*cd*en)
         pnn = cd*cd*nn + sd*(sd*ee + 2.0_wp*cd*en)
         pen = cd*sd*(ee - nn) + (cd - sd)*(cd + sd)*en
      end subroutine turn_axes

   end subroutine inward_pass

   !> phi'', alpha'', beta'' from the acceleration of hinge 0.
   pure subroutine outward_pass(n, rods, rod_of, outward, omega_rate, ae, an, phi_acceleration, alpha_acceleration, &
                                beta_acceleration)
      integer, intent(in) :: n
      type(rod_constants), intent(in) :: rods(*)
      integer, intent(in) :: rod_of(n)
      real(wp), intent(in) :: outward(outward_size, n)
      real(wp), intent(in) :: omega_rate            !! w' [rad/s^2]
      real(wp), intent(inout) :: ae, an             !! in: of hinge 0, moving axes; out: of the tip, axes of rod n [m/s^2]
      real(wp), dimension(n), intent(out) :: phi_acceleration, alpha_acceleration, beta_acceleration
      integer :: k
      real(wp) :: along, across, w_rate

      do k = 1, n
         associate (g => rods(rod_of(k))%g, h => rods(rod_of(k))%h, length => rods(rod_of(k))%length)
            along = outward(of_cosine, k)*ae + outward(of_sine, k)*an
            across = outward(of_cosine, k)*an - outward(of_sine, k)*ae
            w_rate = outward(of_turn, k) - outward(of_along, k)*along - outward(of_cross, k)*across
            phi_acceleration(k) = w_rate - omega_rate
            alpha_acceleration(k) = outward(of_alpha, k) - g(1)*across - h(1)*w_rate
            beta_acceleration(k) = outward(of_beta, k) - g(2)*across - h(2)*w_rate
            an = outward(of_down, k)*ae + (outward(of_kept, k)*an + length*outward(of_turn, k))
            ae = along - outward(of_pull, k)
         end associate
      end do
   end subroutine outward_pass

end module rodyn_recursion_flexible
