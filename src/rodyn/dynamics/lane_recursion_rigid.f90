!> The recursion of `rodyn_recursion_rigid` in all lanes at once, for all rods without bending unknowns: same names, same order of
!> steps, W' eliminated as in `rodyn_lane_recursion_flexible`.
!>
!> Rods without inertia (lumped) need no kernel of their own here: with m0 = m1 = m2 = 0 it turns into that of
!> `rodyn_recursion_lumped`, P = a e e' with a = det/pnn. So that no digits are lost then, the centripetal part of the bias
!> force is written with the apparent mass after elimination of W', not as a difference of two large terms:
!>     pee - l^2 pen^2/(m2 + l^2 pnn) = (pee m2 + l^2 det)/(m2 + l^2 pnn).
!> What a lane computes never depends on another one. The same equations elsewhere: docs/model.md sec. 7.
module rodyn_lane_recursion_rigid
   use rodyn_kinds, only: wp
   use rodyn_lanes, only: lanes
   use rodyn_lane_rods, only: lane_rod
   use rodyn_lane_spacecraft, only: lane_spacecraft_accelerations
   use rodyn_outboard_chain, only: lane_outboard_chain, lane_outward_size
   implicit none (type, external)
   private
   public :: lane_rigid_accelerations

   ! Places in `outward` (`rodyn_outboard_chain`).
   integer, parameter :: of_turn = 1, of_along = 2, of_cross = 3, of_pull = 4, of_cosine = 5, of_sine = 6

contains

   !> p' = (Vx', Vy', w', phi'') in every lane for given hinge moments.
   subroutine lane_rigid_accelerations(n, n_base, rods, rod_of, node_mass, mass, inertia, hinge_x, hinge_y, base_force, loaded, &
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
      real(wp), intent(inout) :: outward(lanes, lane_outward_size, n) !! workspace
      real(wp), intent(out) :: acceleration(lanes, n_base + n) !! p'
      logical, intent(out) :: ok(lanes)          !! false: not finite, or M not positive definite
      type(lane_outboard_chain) :: chain
      integer :: i, k, ip
      real(wp), dimension(lanes) :: omega, omega_rate, ae, an, smallest

      ip = n_base
      omega = 0.0_wp
      if (n_base > 0) omega = p(:, 3)
      call inward_pass()
      call lane_spacecraft_accelerations(n_base, mass, inertia, hinge_x, hinge_y, p, chain, base_force, acceleration, ae, an, &
                                         omega_rate, smallest)
      call outward_pass()
      ok = abs(an) <= huge(1.0_wp) .and. smallest > 0.0_wp ! finite; the intrinsic is not vectorised

   contains

      !> The chain as hinge 0 feels it, moving axes, and what the outward pass needs of each rod.
      subroutine inward_pass()
         chain%pee = 0.0_wp
         chain%pen = 0.0_wp
         chain%pnn = 0.0_wp
         chain%det = 0.0_wp
         chain%be = 0.0_wp
         chain%bn = 0.0_wp
         chain%moment = moment(:, 0)
         chain%mass = node_mass(:, 0)
         smallest = huge(1.0_wp)
         do k = n, 1, -1
            if (loaded) call load_node()
            call add_rod()
         end do
      end subroutine inward_pass

      !> Force on node k.
      subroutine load_node()
         !$omp simd
         do i = 1, lanes
            chain%be(i) = chain%be(i) - (node_force(i, 1, k)*cosine(i, k) + node_force(i, 2, k)*sine(i, k))
            chain%bn(i) = chain%bn(i) - (node_force(i, 2, k)*cosine(i, k) - node_force(i, 1, k)*sine(i, k))
         end do
      end subroutine load_node

      !> All of rod k: what is outboard of its inner node, in the axes of rod k - 1 (of the spacecraft for k = 1).
      subroutine add_rod()
         real(wp) :: pee, pen, pnn, det, be, bn, mu, w2, lw2, r0, arm, inv, cn, turn, ee, en, nn, cd, sd

         associate (rod => rods(rod_of(k)))
            !$omp simd
            do i = 1, lanes
               ! `add_node`.
               mu = node_mass(i, k)
               det = chain%det(i) + mu*(chain%pee(i) + chain%pnn(i) + mu)
               pee = chain%pee(i) + mu
               pnn = chain%pnn(i) + mu
               pen = chain%pen(i)

               ! `add_rod`. Row of W', and what follows from it for the outer node.
               w2 = (omega(i) + p(i, ip + k))**2
               lw2 = rod%length(i)*w2
               r0 = moment(i, k) - moment(i, k - 1)
               cd = cosine(i, k)*cosine(i, k - 1) + sine(i, k)*sine(i, k - 1)
               sd = sine(i, k)*cosine(i, k - 1) - cosine(i, k)*sine(i, k - 1)
               arm = rod%m2_reduced(i) - rod%length_m1(i)
               inv = rod%m2_reduced(i) + rod%length_2(i)*pnn
               smallest(i) = min(smallest(i), inv)
               inv = 1.0_wp/inv
               cn = rod%m1(i) + rod%length(i)*pnn
               turn = (r0 - rod%length(i)*chain%bn(i))*inv
               outward(i, of_turn, k) = turn
               outward(i, of_along, k) = rod%length(i)*pen*inv
               outward(i, of_cross, k) = cn*inv
               outward(i, of_pull, k) = lw2
               outward(i, of_cosine, k) = cd
               outward(i, of_sine, k) = sd

               ! Without W'.
               ee = (pee*rod%m2_reduced(i) + rod%length_2(i)*det)*inv
               en = pen*arm*inv
               nn = rod%central(i) + pnn*rod%outer(i)
               be = chain%be(i) - ee*lw2 - w2*rod%m1(i) + rod%length(i)*pen*turn
               bn = (chain%bn(i)*arm + cn*r0)*inv - en*lw2
               chain%det(i) = (rod%m0(i)*nn + pee*rod%central(i) + det*rod%outer(i))*inv
               ee = rod%m0(i) + ee
               nn = nn*inv

               ! `turn_axes`, with b.
               chain%pee(i) = cd*cd*ee + sd*(sd*nn - 2.0_wp*cd*en)
               chain%pnn(i) = cd*cd*nn + sd*(sd*ee + 2.0_wp*cd*en)
               chain%pen(i) = cd*sd*(ee - nn) + (cd - sd)*(cd + sd)*en
               chain%be(i) = cd*be - sd*bn
               chain%bn(i) = sd*be + cd*bn
            end do
         end associate
      end subroutine add_rod

      !> phi'' from the acceleration of hinge 0. The bias in `of_turn` is that of an outer node which already falls by l W^2.
      subroutine outward_pass()
         real(wp) :: along, across, w_rate

         do k = 1, n
            associate (rod => rods(rod_of(k)))
               !$omp simd
               do i = 1, lanes
                  along = (outward(i, of_cosine, k)*ae(i) + outward(i, of_sine, k)*an(i)) - outward(i, of_pull, k)
                  across = outward(i, of_cosine, k)*an(i) - outward(i, of_sine, k)*ae(i)
                  w_rate = outward(i, of_turn, k) - outward(i, of_along, k)*along - outward(i, of_cross, k)*across
                  acceleration(i, ip + k) = w_rate - omega_rate(i)
                  an(i) = across + rod%length(i)*w_rate
                  ae(i) = along
               end do
            end associate
         end do
      end subroutine outward_pass

   end subroutine lane_rigid_accelerations

end module rodyn_lane_recursion_rigid
