!> The recursion of `rodyn_recursion_flexible` in all lanes at once: same equations, names and order of steps, so that the two can
!> be read side by side.
!>
!> Each loop over lanes is one pass of vector instructions; what a lane computes never depends on another one. Lanes do not wait
!> for the rod before as one scene does, so W' is eliminated first and the axes are turned then, with fewer operations. All
!> steps are parts of one procedure: given their arrays as arguments, gfortran would take two rods, but one lane at a time (10 %).
!> The same equations elsewhere: docs/model.md sec. 7.
module rodyn_lane_recursion_flexible
   use rodyn_kinds, only: wp
   use rodyn_lanes, only: lanes
   use rodyn_lane_rods, only: lane_rod
   use rodyn_lane_spacecraft, only: lane_spacecraft_accelerations
   use rodyn_outboard_chain, only: lane_outboard_chain, lane_outward_size
   implicit none (type, external)
   private
   public :: lane_flexible_accelerations

   ! Places in `outward` (`rodyn_outboard_chain`).
   integer, parameter :: of_turn = 1, of_along = 2, of_cross = 3, of_alpha = 4, of_beta = 5, of_pull = 6, of_cosine = 7, &
                         of_sine = 8

contains

   !> p' in every lane.
   subroutine lane_flexible_accelerations(n, n_base, rods, rod_of, node_mass, stiffness, damping, offset, mass, inertia, &
                                          hinge_x, hinge_y, base_force, loaded, node_force, sine, cosine, phi, alpha, beta, p, &
                                          outward, acceleration, ok)
      integer, intent(in) :: n, n_base           !! rods; 3 or 0 unknowns of the spacecraft
      type(lane_rod), intent(in) :: rods(*)      !! distinct rods
      integer, intent(in) :: rod_of(n)           !! which of them is rod k
      real(wp), intent(in) :: node_mass(lanes, 0:n) !! mu [kg]
      real(wp), dimension(lanes, 0:n - 1), intent(in) :: stiffness, damping, offset !! C, D, moment at rest
      real(wp), dimension(lanes), intent(in) :: mass, inertia, hinge_x, hinge_y !! of the spacecraft
      real(wp), intent(in) :: base_force(lanes, 3) !! X_C, Y_C, M_C, moving axes
      logical, intent(in) :: loaded              !! node_force is to be used
      real(wp), intent(in) :: node_force(lanes, 2, n) !! X, Y at nodes, moving axes [N]
      real(wp), dimension(lanes, 0:n), intent(in) :: sine, cosine !! of phi; 0 and 1 at k = 0
      real(wp), dimension(lanes, n), intent(in) :: phi, alpha, beta !! [rad]
      real(wp), intent(in) :: p(lanes, n_base + 3*n)        !! rates
      real(wp), intent(inout) :: outward(lanes, lane_outward_size, n) !! workspace
      real(wp), intent(out) :: acceleration(lanes, n_base + 3*n) !! p'
      logical, intent(out) :: ok(lanes)          !! false: not finite, or M not positive definite
      type(lane_outboard_chain) :: chain
      integer :: i, k, ip, ia, ib
      real(wp), dimension(lanes) :: omega, omega_rate, ae, an, smallest

      ip = n_base
      ia = n_base + n
      ib = n_base + 2*n
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
         chain%moment = 0.0_wp
         chain%mass = node_mass(:, 0)
         smallest = huge(1.0_wp)
         do k = n, 1, -1
            if (loaded) call load_node()
            call add_rod(k > 1)
         end do
      end subroutine inward_pass

      !> Force on node k.
      subroutine load_node()
         do i = 1, lanes
            chain%be(i) = chain%be(i) - (node_force(i, 1, k)*cosine(i, k) + node_force(i, 2, k)*sine(i, k))
            chain%bn(i) = chain%bn(i) - (node_force(i, 2, k)*cosine(i, k) - node_force(i, 1, k)*sine(i, k))
         end do
      end subroutine load_node

      !> All of rod k: what is outboard of its inner node, in the axes of rod k - 1 (of the spacecraft for k = 1).
      subroutine add_rod(inner)
         logical, intent(in) :: inner !! there is a rod further in
         real(wp) :: pee, pen, pnn, det, be, bn, mu, moment_in, moment_out, opening, opening_rate, before, before_rate, w, w2, &
                     lw2, mv, mv_rate, mvv, mvv_rate, qa, qb, gq, hq, r0, d, arm, outer, central, inv, ce, cn, turn, ee, en, nn, &
                     cd, sd

         associate (rod => rods(rod_of(k)), j => merge(k - 1, k, inner), share => merge(1.0_wp, 0.0_wp, inner))
            !$omp simd
            do i = 1, lanes
               ! `add_node`.
               mu = node_mass(i, k)
               det = chain%det(i) + mu*(chain%pee(i) + chain%pnn(i) + mu)
               pee = chain%pee(i) + mu
               pnn = chain%pnn(i) + mu
               pen = chain%pen(i)

               ! `bend_hinge`.
               opening = phi(i, k) + alpha(i, k)
               opening_rate = p(i, ip + k) + p(i, ia + k)
               before = share*(phi(i, j) + beta(i, j))
               before_rate = share*(p(i, ip + j) + p(i, ib + j))
               moment_in = stiffness(i, k - 1)*(opening - before) + damping(i, k - 1)*(opening_rate - before_rate) - &
                           offset(i, k - 1)
               moment_out = chain%moment(i)
               chain%moment(i) = moment_in

               ! `bend_rod`. Deflection: int m v, its rate, int m v^2 and int m v v'.
               w = omega(i) + p(i, ip + k)
               w2 = w*w
               w = 2.0_wp*w
               lw2 = rod%length(i)*w2
               mv = rod%a1(i)*alpha(i, k) + rod%b1(i)*beta(i, k)
               mv_rate = rod%a1(i)*p(i, ia + k) + rod%b1(i)*p(i, ib + k)
               qa = rod%second(i, 1)*alpha(i, k) + rod%second(i, 2)*beta(i, k)
               qb = rod%second(i, 2)*alpha(i, k) + rod%second(i, 3)*beta(i, k)
               mvv = alpha(i, k)*qa + beta(i, k)*qb
               mvv_rate = p(i, ia + k)*qa + p(i, ib + k)*qb

               ! Moments on the slopes.
               qa = -moment_in - rod%stiffness(i, 1)*(alpha(i, k) + rod%carry_over(i, 1)*beta(i, k))
               qb = moment_out - rod%stiffness(i, 3)*(rod%carry_over(i, 2)*alpha(i, k) + beta(i, k))
               gq = rod%g(i, 1)*qa + rod%g(i, 2)*qb
               hq = rod%h(i, 1)*qa + rod%h(i, 2)*qb
               r0 = moment_out - moment_in - hq - w2*(rod%sa(i)*alpha(i, k) + rod%sb(i)*beta(i, k)) - w*mvv_rate
               outward(i, of_alpha, k) = w2*alpha(i, k) + rod%b_inverse(i, 1)*qa + rod%b_inverse(i, 2)*qb
               outward(i, of_beta, k) = w2*beta(i, k) + rod%b_inverse(i, 2)*qa + rod%b_inverse(i, 3)*qb

               ! `add_rod`. Row of W', and what follows from it for the outer node.
               cd = cosine(i, k)*cosine(i, k - 1) + sine(i, k)*sine(i, k - 1)
               sd = sine(i, k)*cosine(i, k - 1) - cosine(i, k)*sine(i, k - 1)
               d = rod%m2_reduced(i) + mvv
               arm = d - rod%length_m1(i)
               outer = rod%outer(i) + mvv
               central = rod%central(i) + rod%m0_reduced(i)*mvv
               inv = d + rod%length_2(i)*pnn
               smallest(i) = min(smallest(i), inv)
               inv = 1.0_wp/inv
               ce = rod%length(i)*pen - mv
               cn = rod%m1_reduced(i) + rod%length(i)*pnn
               be = chain%be(i) - pee*lw2
               bn = chain%bn(i) - pen*lw2
               turn = (r0 - rod%length(i)*bn)*inv
               outward(i, of_turn, k) = turn
               outward(i, of_along, k) = ce*inv
               outward(i, of_cross, k) = cn*inv
               outward(i, of_pull, k) = lw2
               outward(i, of_cosine, k) = cd
               outward(i, of_sine, k) = sd

               ! Without W'.
               be = be - w2*rod%m1(i) - w*mv_rate + ce*turn
               bn = (bn*arm + cn*r0)*inv + gq
               nn = central + pnn*outer
               ee = pee*d + rod%length_2(i)*det + mv*(2.0_wp*rod%length(i)*pen - mv)
               en = pen*arm + mv*cn
               chain%det(i) = (rod%m0(i)*nn + pee*central + det*outer + &
                               mv*(2.0_wp*pen*rod%offset(i) - (rod%m0_reduced(i) + pnn)*mv))*inv
               ee = rod%m0(i) + ee*inv
               en = en*inv
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

      !> phi'', alpha'', beta'' from the acceleration of hinge 0.
      subroutine outward_pass()
         real(wp) :: along, across, w_rate

         do k = 1, n
            associate (rod => rods(rod_of(k)))
               !$omp simd
               do i = 1, lanes
                  along = outward(i, of_cosine, k)*ae(i) + outward(i, of_sine, k)*an(i)
                  across = outward(i, of_cosine, k)*an(i) - outward(i, of_sine, k)*ae(i)
                  w_rate = outward(i, of_turn, k) - outward(i, of_along, k)*along - outward(i, of_cross, k)*across
                  acceleration(i, ip + k) = w_rate - omega_rate(i)
                  acceleration(i, ia + k) = outward(i, of_alpha, k) - rod%g(i, 1)*across - rod%h(i, 1)*w_rate
                  acceleration(i, ib + k) = outward(i, of_beta, k) - rod%g(i, 2)*across - rod%h(i, 2)*w_rate
                  an(i) = across + rod%length(i)*w_rate
                  ae(i) = along - outward(i, of_pull, k)
               end do
            end associate
         end do
      end subroutine outward_pass

   end subroutine lane_flexible_accelerations

end module rodyn_lane_recursion_flexible
