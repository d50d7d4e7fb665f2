!> The recursion of `rodyn_recursion_flexible` in all lanes at once: same equations, same names, same order.
!>
!> Each loop over lanes is one pass of vector instructions; what a lane computes never depends on another one.
module rodyn_lane_recursion_flexible
   use rodyn_kinds, only: wp
   use rodyn_lanes, only: lanes
   use rodyn_lane_scene, only: lane_rod
   use rodyn_lane_spacecraft, only: lane_spacecraft_accelerations
   implicit none (type, external)
   private
   public :: lane_flexible_recursion

contains

   !> p' in every lane.
   subroutine lane_flexible_recursion(n, n_base, rods, rod_of, node_mass, stiffness, damping, kink_moment, mass, inertia, &
                                      hinge_x, hinge_y, base_force, loaded, node_force, sine, cosine, phi, alpha, beta, p, &
                                      outward, acceleration, ok)
      integer, intent(in) :: n, n_base           !! rods; 3 or 0 unknowns of the spacecraft
      type(lane_rod), intent(in) :: rods(*)      !! distinct rods
      integer, intent(in) :: rod_of(n)           !! which of them is rod k
      real(wp), intent(in) :: node_mass(lanes, 0:n) !! mu [kg]
      real(wp), dimension(lanes, 0:n - 1), intent(in) :: stiffness, damping, kink_moment !! C, D, C gamma
      real(wp), dimension(lanes), intent(in) :: mass, inertia, hinge_x, hinge_y !! of the spacecraft
      real(wp), intent(in) :: base_force(lanes, 3) !! X_C, Y_C, M_C, moving axes
      logical, intent(in) :: loaded              !! node_force is to be used
      real(wp), intent(in) :: node_force(lanes, 2, n) !! X, Y at nodes, moving axes [N]
      real(wp), dimension(lanes, 0:n), intent(in) :: sine, cosine !! of phi; 0 and 1 at k = 0
      real(wp), dimension(lanes, n), intent(in) :: phi, alpha, beta !! [rad]
      real(wp), intent(in) :: p(lanes, n_base + 3*n)        !! rates
      real(wp), intent(inout) :: outward(lanes, 8, n)       !! workspace
      real(wp), intent(out) :: acceleration(lanes, n_base + 3*n) !! p'
      logical, intent(out) :: ok(lanes)          !! false: not finite, or M not positive definite

      real(wp), dimension(lanes) :: pee, pen, pnn, det, be, bn, omega, moment_out, smallest, ae, an, omega_rate
      integer :: k, i, ip, ia, ib

      ip = n_base
      ia = n_base + n
      ib = n_base + 2*n
      omega = 0.0_wp
      if (n_base > 0) omega = p(:, 3)
      pee = 0.0_wp
      pen = 0.0_wp
      pnn = 0.0_wp
      det = 0.0_wp
      be = 0.0_wp
      bn = 0.0_wp
      moment_out = 0.0_wp
      smallest = huge(1.0_wp)

      do k = n, 1, -1
         if (loaded) call add_node_force(node_force(:, :, k), sine(:, k), cosine(:, k), be, bn)
         call add_rod(k > 1)
      end do
      call lane_spacecraft_accelerations(n_base, mass, inertia, hinge_x, hinge_y, p, node_mass(:, 0), pee, pen, pnn, det, &
                                         be, bn, moment_out, base_force, acceleration, ae, an, omega_rate, smallest)
      do k = 1, n
         call accelerate_rod()
      end do
      ok = abs(an) <= huge(1.0_wp) .and. smallest > 0.0_wp ! finite; the intrinsic is not vectorised

   contains

      !> Rod k and its outer node join the chain outboard of them.
      subroutine add_rod(inner)
         logical, intent(in) :: inner !! there is a rod further in
         real(wp) :: mu, w, w2, lw2, mv, mv_rate, mvv, mvv_rate, qa, qb, gq, hq, r0, d, arm, outer, central, inv, ce, cn, r, &
                     ee, en, nn, cd, sd, det_k, pee_k, pnn_k, be_k, bn_k, inward, inward_rate, before, before_rate, moment_in
         associate (rod => rods(rod_of(k)), j => merge(k - 1, k, inner), share => merge(1.0_wp, 0.0_wp, inner))
            !$omp simd
            do i = 1, lanes
               mu = node_mass(i, k)
               det_k = det(i) + mu*(pee(i) + pnn(i) + mu)
               pee_k = pee(i) + mu
               pnn_k = pnn(i) + mu

               ! Moment of the inner hinge.
               inward = phi(i, k) + alpha(i, k)
               inward_rate = p(i, ip + k) + p(i, ia + k)
               before = share*(phi(i, j) + beta(i, j))
               before_rate = share*(p(i, ip + j) + p(i, ib + j))
               moment_in = stiffness(i, k - 1)*(inward - before) + damping(i, k - 1)*(inward_rate - before_rate) - &
                           kink_moment(i, k - 1)

               ! Deflection: int m v, its rate, int m v^2 and int m v v'.
               w = omega(i) + p(i, ip + k)
               w2 = w*w
               w = 2.0_wp*w
               lw2 = rod%length(i)*w2
               mv = rod%a1(i)*alpha(i, k) + rod%b1(i)*beta(i, k)
               mv_rate = rod%a1(i)*p(i, ia + k) + rod%b1(i)*p(i, ib + k)
               qa = rod%aa(i)*alpha(i, k) + rod%ab(i)*beta(i, k)
               qb = rod%ab(i)*alpha(i, k) + rod%bb(i)*beta(i, k)
               mvv = alpha(i, k)*qa + beta(i, k)*qb
               mvv_rate = p(i, ia + k)*qa + p(i, ib + k)*qb

               ! Moments on the slopes.
               qa = -moment_in - rod%k11(i)*(alpha(i, k) + rod%carry_out(i)*beta(i, k))
               qb = moment_out(i) - rod%k22(i)*(rod%carry_in(i)*alpha(i, k) + beta(i, k))
               gq = rod%g1(i)*qa + rod%g2(i)*qb
               hq = rod%h1(i)*qa + rod%h2(i)*qb
               r0 = moment_out(i) - moment_in - hq - w2*(rod%sa(i)*alpha(i, k) + rod%sb(i)*beta(i, k)) - w*mvv_rate
               moment_out(i) = moment_in
               outward(i, 4, k) = w2*alpha(i, k) + rod%b11(i)*qa + rod%b12(i)*qb
               outward(i, 5, k) = w2*beta(i, k) + rod%b12(i)*qa + rod%b22(i)*qb

               ! Row of W'.
               d = rod%m2_reduced(i) + mvv
               arm = d - rod%length_m1(i)
               outer = rod%outer(i) + mvv
               central = rod%central(i) + rod%m0_reduced(i)*mvv
               inv = d + rod%length_2(i)*pnn_k
               smallest(i) = min(smallest(i), inv)
               inv = 1.0_wp/inv
               ce = rod%length(i)*pen(i) - mv
               cn = rod%m1_reduced(i) + rod%length(i)*pnn_k
               be_k = be(i) - pee_k*lw2
               bn_k = bn(i) - pen(i)*lw2
               r = (r0 - rod%length(i)*bn_k)*inv
               outward(i, 1, k) = r
               outward(i, 2, k) = ce*inv
               outward(i, 3, k) = cn*inv
               outward(i, 6, k) = lw2

               ! The chain seen from the inner node, in the axes of rod k.
               be_k = be_k - w2*rod%m1(i) - w*mv_rate + ce*r
               bn_k = (bn_k*arm + cn*r0)*inv + gq
               nn = central + pnn_k*outer
               ee = pee_k*d + rod%length_2(i)*det_k + mv*(2.0_wp*rod%length(i)*pen(i) - mv)
               en = pen(i)*arm + mv*cn
               det(i) = (rod%m0(i)*nn + pee_k*central + det_k*outer + &
                         mv*(2.0_wp*pen(i)*rod%offset(i) - (rod%m0_reduced(i) + pnn_k)*mv))*inv
               ee = rod%m0(i) + ee*inv
               en = en*inv
               nn = nn*inv

               ! Turn to the axes of rod k - 1 (of the spacecraft for k = 1).
               cd = cosine(i, k)*cosine(i, k - 1) + sine(i, k)*sine(i, k - 1)
               sd = sine(i, k)*cosine(i, k - 1) - cosine(i, k)*sine(i, k - 1)
               outward(i, 7, k) = cd
               outward(i, 8, k) = sd
               pee(i) = cd*cd*ee + sd*(sd*nn - 2.0_wp*cd*en)
               pnn(i) = cd*cd*nn + sd*(sd*ee + 2.0_wp*cd*en)
               pen(i) = cd*sd*(ee - nn) + (cd - sd)*(cd + sd)*en
               be(i) = cd*be_k - sd*bn_k
               bn(i) = sd*be_k + cd*bn_k
            end do
         end associate
      end subroutine add_rod

      !> phi'', alpha'', beta'' of rod k, then the acceleration of its outer node.
      subroutine accelerate_rod()
         real(wp) :: r, across, w_rate
         associate (rod => rods(rod_of(k)))
            !$omp simd
            do i = 1, lanes
               r = outward(i, 7, k)*ae(i) + outward(i, 8, k)*an(i)
               across = outward(i, 7, k)*an(i) - outward(i, 8, k)*ae(i)
               w_rate = outward(i, 1, k) - outward(i, 2, k)*r - outward(i, 3, k)*across
               acceleration(i, ip + k) = w_rate - omega_rate(i)
               acceleration(i, ia + k) = outward(i, 4, k) - rod%g1(i)*across - rod%h1(i)*w_rate
               acceleration(i, ib + k) = outward(i, 5, k) - rod%g2(i)*across - rod%h2(i)*w_rate
               ae(i) = r - outward(i, 6, k)
               an(i) = across + rod%length(i)*w_rate
            end do
         end associate
      end subroutine accelerate_rod

   end subroutine lane_flexible_recursion

   !> Force on a node, as a bias of the chain outboard of it.
   subroutine add_node_force(force, sine, cosine, be, bn)
      real(wp), intent(in) :: force(lanes, 2), sine(lanes), cosine(lanes)
      real(wp), intent(inout) :: be(lanes), bn(lanes)
      integer :: i
      do i = 1, lanes
         be(i) = be(i) - (force(i, 1)*cosine(i) + force(i, 2)*sine(i))
         bn(i) = bn(i) - (force(i, 2)*cosine(i) - force(i, 1)*sine(i))
      end do
   end subroutine add_node_force

end module rodyn_lane_recursion_flexible
