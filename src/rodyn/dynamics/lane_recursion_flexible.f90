!> The recursion of `rodyn_recursion_flexible` in all lanes at once: same equations, same names, same order.
!>
!> Each loop over lanes is one pass of vector instructions; what a lane computes never depends on another one.
module rodyn_lane_recursion_flexible
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use rodyn_kinds, only: wp
   use rodyn_lanes, only: lanes
   use rodyn_lane_scene, only: lane_scene, lane_rod
   use rodyn_trigonometry, only: sine_cosine
   implicit none (type, external)
   private
   public :: lane_work, new_lane_work, lane_flexible_accelerations

   !> Memory of the recursion.
   type :: lane_work
      real(wp), allocatable :: sine(:, :), cosine(:, :) !! of phi (lanes, 0:n); 0 and 1 at k = 0
      real(wp), allocatable :: outward(:, :, :)         !! what the inward pass leaves for the outward pass (lanes, 8, n)
   end type lane_work

contains

   subroutine new_lane_work(work, n)
      type(lane_work), intent(out) :: work
      integer, intent(in) :: n !! rods
      allocate (work%sine(lanes, 0:n), work%cosine(lanes, 0:n), work%outward(lanes, 8, n), source=0.0_wp)
      work%cosine(:, 0) = 1.0_wp
   end subroutine new_lane_work

   !> p' in every lane.
   subroutine lane_flexible_accelerations(group, work, phi, alpha, beta, p, acceleration, ok)
      type(lane_scene), intent(in) :: group
      type(lane_work), intent(inout) :: work
      real(wp), contiguous, intent(in) :: phi(:, :), alpha(:, :), beta(:, :) !! (lanes, n) [rad]
      real(wp), contiguous, intent(in) :: p(:, :)             !! rates (lanes, n_dof)
      real(wp), contiguous, intent(out) :: acceleration(:, :) !! p' (lanes, n_dof)
      logical, intent(out) :: ok(lanes) !! false: not finite, or M not positive definite

      call sine_cosine(lanes*group%n, phi, work%sine(:, 1:), work%cosine(:, 1:))
      call recursion(group%n, group%n_base, group%rods, group%rod_of, group%node_mass, group%stiffness, group%damping, &
                     group%kink_moment, group%mass, group%inertia, group%hinge_x, group%hinge_y, group%base_force, &
                     group%loaded, group%node_force, work%sine, work%cosine, phi, alpha, beta, p, work%outward, &
                     acceleration, ok)
   end subroutine lane_flexible_accelerations

   subroutine recursion(n, n_base, rods, rod_of, node_mass, stiffness, damping, kink_moment, mass, inertia, hinge_x, &
                        hinge_y, base_force, loaded, node_force, sine, cosine, phi, alpha, beta, p, outward, &
                        acceleration, ok)
      integer, intent(in) :: n, n_base
      type(lane_rod), intent(in) :: rods(*)
      integer, intent(in) :: rod_of(n)
      real(wp), intent(in) :: node_mass(lanes, 0:n)
      real(wp), dimension(lanes, 0:n - 1), intent(in) :: stiffness, damping, kink_moment
      real(wp), dimension(lanes), intent(in) :: mass, inertia, hinge_x, hinge_y
      real(wp), intent(in) :: base_force(lanes, 3)
      logical, intent(in) :: loaded
      real(wp), intent(in) :: node_force(lanes, 2, n)
      real(wp), dimension(lanes, 0:n), intent(in) :: sine, cosine
      real(wp), dimension(lanes, n), intent(in) :: phi, alpha, beta
      real(wp), intent(in) :: p(lanes, n_base + 3*n)
      real(wp), intent(inout) :: outward(lanes, 8, n)
      real(wp), intent(out) :: acceleration(lanes, n_base + 3*n)
      logical, intent(out) :: ok(lanes)

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
      call add_spacecraft()
      do k = 1, n
         call accelerate_rod()
      end do
      ok = ieee_is_finite(an) .and. smallest > 0.0_wp

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
               qa = -moment_in - rod%kappa(i)*(2.0_wp*alpha(i, k) + beta(i, k))
               qb = moment_out(i) - rod%kappa(i)*(alpha(i, k) + 2.0_wp*beta(i, k))
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

      !> The spacecraft, `spacecraft_accelerations` of `rodyn_spacecraft`; `moment_out` is T_0.
      subroutine add_spacecraft()
         real(wp) :: pxx, pyy, d, d2, d3, inverse, cx, cy, px, py, w, w2, m11, m22, gx, gy, fx, fy, w_rate, mu, x, y

         ae = 0.0_wp
         an = 0.0_wp
         omega_rate = 0.0_wp
         if (n_base == 0) return
         !$omp simd
         do i = 1, lanes
            w = p(i, 3)
            w2 = w*w
            mu = node_mass(i, 0)
            x = hinge_x(i)
            y = hinge_y(i)
            pxx = pee(i) + mu
            pyy = pnn(i) + mu
            d = det(i) + mu*(pee(i) + pnn(i) + mu)
            m11 = mass(i) + pxx
            m22 = mass(i) + pyy
            d2 = mass(i)*(mass(i) + (pxx + pyy)) + d
            inverse = 1.0_wp/d2
            cx = be(i) - w2*(pxx*x + pen(i)*y)
            cy = bn(i) - w2*(pen(i)*x + pyy*y)
            px = pen(i)*x - pxx*y
            py = pyy*x - pen(i)*y
            gx = mass(i)*((pxx*base_force(i, 1) + pen(i)*base_force(i, 2)) + (m22*cx - pen(i)*cy)) + d*base_force(i, 1)
            gy = mass(i)*((pen(i)*base_force(i, 1) + pyy*base_force(i, 2)) + (m11*cy - pen(i)*cx)) + d*base_force(i, 2)
            d3 = inertia(i)*d2 + mass(i)*(mass(i)*(x*py - y*px) + d*(x*x + y*y))
            smallest(i) = min(smallest(i), m11, d2, d3)
            w_rate = ((base_force(i, 3) + moment_out(i))*d2 - (x*gy - y*gx))/d3
            fx = (base_force(i, 1) - cx) - px*w_rate
            fy = (base_force(i, 2) - cy) - py*w_rate
            ae(i) = (m22*fx - pen(i)*fy)*inverse
            an(i) = (m11*fy - pen(i)*fx)*inverse
            acceleration(i, 1) = ae(i) + w*p(i, 2)
            acceleration(i, 2) = an(i) - w*p(i, 1)
            acceleration(i, 3) = w_rate
            omega_rate(i) = w_rate
            ae(i) = ae(i) - y*w_rate - w2*x
            an(i) = an(i) + x*w_rate - w2*y
         end do
      end subroutine add_spacecraft

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

   end subroutine recursion

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
