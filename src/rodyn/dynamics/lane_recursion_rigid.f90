!> The recursion of `rodyn_recursion_rigid` in all lanes at once, for all rods without bending unknowns.
!>
!> Rods without inertia (lumped) need no kernel of their own here: with m0 = m1 = m2 = 0 it turns into that of
!> `rodyn_recursion_lumped`, P = a e e' with a = det/pnn. So that no digits are lost then, the centripetal part of the bias
!> force is written with the apparent mass after elimination of W', not as a difference of two large terms:
!>     pee - l^2 pen^2/(m2 + l^2 pnn) = (pee m2 + l^2 det)/(m2 + l^2 pnn).
!> What a lane computes never depends on another one.
module rodyn_lane_recursion_rigid
   use rodyn_kinds, only: wp
   use rodyn_lanes, only: lanes
   use rodyn_lane_scene, only: lane_rod
   use rodyn_lane_spacecraft, only: lane_spacecraft_accelerations
   implicit none (type, external)
   private
   public :: lane_rigid_recursion

contains

   !> p' = (Vx', Vy', w', phi'') in every lane for given hinge moments.
   subroutine lane_rigid_recursion(n, n_base, rods, rod_of, node_mass, mass, inertia, hinge_x, hinge_y, base_force, loaded, &
                                   node_force, sine, cosine, moment, p, outward, acceleration, ok)
      integer, intent(in) :: n, n_base           !! rods; 3 or 0 unknowns of the spacecraft
      type(lane_rod), intent(in) :: rods(*)      !! distinct rods
      integer, intent(in) :: rod_of(n)           !! which of them is rod k
      real(wp), intent(in) :: node_mass(lanes, 0:n) !! mu [kg]
      real(wp), dimension(lanes), intent(in) :: mass, inertia, hinge_x, hinge_y !! of the spacecraft
      real(wp), intent(in) :: base_force(lanes, 3) !! X_C, Y_C, M_C, moving axes
      logical, intent(in) :: loaded              !! node_force is to be used
      real(wp), intent(in) :: node_force(lanes, 2, n) !! X, Y at nodes, moving axes [N]
      real(wp), dimension(lanes, 0:n), intent(in) :: sine, cosine !! of phi; 0 and 1 at k = 0
      real(wp), intent(in) :: moment(lanes, 0:n) !! T, T(n) = 0 [N m]
      real(wp), intent(in) :: p(lanes, n_base + n)          !! rates
      real(wp), intent(inout) :: outward(lanes, 8, n)       !! workspace
      real(wp), intent(out) :: acceleration(lanes, n_base + n) !! p'
      logical, intent(out) :: ok(lanes)          !! false: not finite, or M not positive definite

      real(wp), dimension(lanes) :: pee, pen, pnn, det, be, bn, omega, smallest, ae, an, omega_rate
      integer :: k, i, ip

      ip = n_base
      omega = 0.0_wp
      if (n_base > 0) omega = p(:, 3)
      pee = 0.0_wp
      pen = 0.0_wp
      pnn = 0.0_wp
      det = 0.0_wp
      be = 0.0_wp
      bn = 0.0_wp
      smallest = huge(1.0_wp)
      do k = n, 1, -1
         if (loaded) call add_node_force()
         call add_rod()
      end do
      call lane_spacecraft_accelerations(n_base, mass, inertia, hinge_x, hinge_y, p, node_mass(:, 0), pee, pen, pnn, det, &
                                         be, bn, moment(:, 0), base_force, acceleration, ae, an, omega_rate, smallest)
      do k = 1, n
         call accelerate_rod()
      end do
      ok = abs(an) <= huge(1.0_wp) .and. smallest > 0.0_wp ! finite; the intrinsic is not vectorised

   contains

      !> Force on node k, as a bias of the chain outboard of it.
      subroutine add_node_force()
         !$omp simd
         do i = 1, lanes
            be(i) = be(i) - (node_force(i, 1, k)*cosine(i, k) + node_force(i, 2, k)*sine(i, k))
            bn(i) = bn(i) - (node_force(i, 2, k)*cosine(i, k) - node_force(i, 1, k)*sine(i, k))
         end do
      end subroutine add_node_force

      !> Rod k and its outer node join the chain outboard of them.
      subroutine add_rod()
         real(wp) :: mu, w2, lw2, r0, arm, inv, cn, r, ee, en, nn, cd, sd, det_k, pee_k, pnn_k, be_k, bn_k
         associate (rod => rods(rod_of(k)))
            !$omp simd
            do i = 1, lanes
               mu = node_mass(i, k)
               det_k = det(i) + mu*(pee(i) + pnn(i) + mu)
               pee_k = pee(i) + mu
               pnn_k = pnn(i) + mu

               ! Row of W'.
               w2 = (omega(i) + p(i, ip + k))**2
               lw2 = rod%length(i)*w2
               r0 = moment(i, k) - moment(i, k - 1)
               arm = rod%m2_reduced(i) - rod%length_m1(i)
               inv = rod%m2_reduced(i) + rod%length_2(i)*pnn_k
               smallest(i) = min(smallest(i), inv)
               inv = 1.0_wp/inv
               cn = rod%m1(i) + rod%length(i)*pnn_k
               r = (r0 - rod%length(i)*bn(i))*inv
               outward(i, 1, k) = r
               outward(i, 2, k) = rod%length(i)*pen(i)*inv
               outward(i, 3, k) = cn*inv
               outward(i, 4, k) = lw2

               ! The chain seen from the inner node, in the axes of rod k.
               ee = (pee_k*rod%m2_reduced(i) + rod%length_2(i)*det_k)*inv
               en = pen(i)*arm*inv
               nn = rod%central(i) + pnn_k*rod%outer(i)
               be_k = be(i) - ee*lw2 - w2*rod%m1(i) + rod%length(i)*pen(i)*r
               bn_k = (bn(i)*arm + cn*r0)*inv - en*lw2
               det(i) = (rod%m0(i)*nn + pee_k*rod%central(i) + det_k*rod%outer(i))*inv
               ee = rod%m0(i) + ee
               nn = nn*inv

               ! Turn to the axes of rod k - 1 (of the spacecraft for k = 1).
               cd = cosine(i, k)*cosine(i, k - 1) + sine(i, k)*sine(i, k - 1)
               sd = sine(i, k)*cosine(i, k - 1) - cosine(i, k)*sine(i, k - 1)
               outward(i, 5, k) = cd
               outward(i, 6, k) = sd
               pee(i) = cd*cd*ee + sd*(sd*nn - 2.0_wp*cd*en)
               pnn(i) = cd*cd*nn + sd*(sd*ee + 2.0_wp*cd*en)
               pen(i) = cd*sd*(ee - nn) + (cd - sd)*(cd + sd)*en
               be(i) = cd*be_k - sd*bn_k
               bn(i) = sd*be_k + cd*bn_k
            end do
         end associate
      end subroutine add_rod

      !> phi'' of rod k, then the acceleration of its outer node.
      subroutine accelerate_rod()
         real(wp) :: along, across, w_rate
         associate (rod => rods(rod_of(k)))
            !$omp simd
            do i = 1, lanes
               along = (outward(i, 5, k)*ae(i) + outward(i, 6, k)*an(i)) - outward(i, 4, k)
               across = outward(i, 5, k)*an(i) - outward(i, 6, k)*ae(i)
               w_rate = outward(i, 1, k) - outward(i, 2, k)*along - outward(i, 3, k)*across
               acceleration(i, ip + k) = w_rate - omega_rate(i)
               ae(i) = along
               an(i) = across + rod%length(i)*w_rate
            end do
         end associate
      end subroutine accelerate_rod

   end subroutine lane_rigid_recursion

end module rodyn_lane_recursion_rigid
