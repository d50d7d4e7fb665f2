!> The recursion of `rodyn_recursion_inextensible` in all lanes at once: same equations, names and order of steps, so that the two
!> can be read side by side.
!>
!> What a lane computes never depends on another one. The same equations elsewhere: docs/model.md sec. 7.
module rodyn_lane_recursion_inextensible
   use rodyn_kinds, only: wp
   use rodyn_inextensible_rods, only: bent_rods, bend_rods, lane_outward, add_rods
   use rodyn_lanes, only: lanes
   use rodyn_lane_rods, only: lane_rod
   use rodyn_lane_spacecraft, only: lane_spacecraft_accelerations
   use rodyn_outboard_chain, only: lane_outboard_chain
   implicit none (type, external)
   private
   public :: lane_inextensible_accelerations

contains

   !> p' in every lane.
   subroutine lane_inextensible_accelerations(n, n_base, rods, rod_of, node_mass, mass, inertia, hinge_x, hinge_y, base_force, &
                                              loaded, node_force, sine, cosine, alpha, beta, p, moment, bent, outward, &
                                              acceleration, ok)
      integer, intent(in) :: n, n_base           !! rods; 3 or 0 unknowns of the spacecraft
      type(lane_rod), intent(in) :: rods(*)      !! distinct rods
      integer, intent(in) :: rod_of(n)           !! which of them is rod k
      real(wp), intent(in) :: node_mass(lanes, 0:n) !! mu [kg]
      real(wp), dimension(lanes), intent(in) :: mass, inertia, hinge_x, hinge_y !! of the spacecraft
      real(wp), intent(in) :: base_force(lanes, 3) !! X_C, Y_C, M_C, moving axes
      logical, intent(in) :: loaded              !! node_force is to be used
      real(wp), intent(in) :: node_force(lanes, 2, n) !! X, Y at nodes, moving axes [N]
      real(wp), dimension(lanes, 0:n), intent(in) :: sine, cosine !! of phi; 0 and 1 at k = 0
      real(wp), dimension(lanes, n), intent(in) :: alpha, beta !! [rad]
      real(wp), intent(in) :: p(lanes, n_base + 3*n)        !! rates
      real(wp), intent(in) :: moment(lanes, 0:n)            !! T of the hinges, T(n) = 0 [N m]
      type(bent_rods), intent(inout) :: bent(n)             !! workspace
      type(lane_outward), intent(inout) :: outward(n)       !! workspace
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
         chain%moment = moment(:, 0)
         chain%mass = node_mass(:, 0)
         smallest = huge(1.0_wp)
         do k = n, 1, -1
            if (loaded) call load_node()
            call bend_rods(lanes, rods(rod_of(k)), omega, p(:, ip + k), alpha(:, k), beta(:, k), p(:, ia + k), p(:, ib + k), &
                           moment(:, k - 1), moment(:, k), bent(k))
            call add_rods(bent(k), node_mass(:, k), sine(:, k), cosine(:, k), sine(:, k - 1), cosine(:, k - 1), chain, outward(k), &
                          smallest)
         end do
      end subroutine inward_pass

      !> Force on node k.
      subroutine load_node()
         do i = 1, lanes
            chain%be(i) = chain%be(i) - (node_force(i, 1, k)*cosine(i, k) + node_force(i, 2, k)*sine(i, k))
            chain%bn(i) = chain%bn(i) - (node_force(i, 2, k)*cosine(i, k) - node_force(i, 1, k)*sine(i, k))
         end do
      end subroutine load_node

      !> phi'', alpha'', beta'' from the acceleration of hinge 0.
      subroutine outward_pass()
         real(wp) :: along, across, outer, w_rate, f, beta_rate

         do k = 1, n
            associate (out => outward(k), rod => bent(k))
               !$omp simd
               do i = 1, lanes
                  along = out%cd(i)*ae(i) + out%sd(i)*an(i)
                  across = out%cd(i)*an(i) - out%sd(i)*ae(i)
                  outer = out%o_0(i) - out%o_e(i)*along - out%o_n(i)*across
                  ae(i) = out%along_0(i) + out%along_e(i)*along + out%along_n(i)*across
                  an(i) = outer
                  w_rate = rod%per_chord(i)*((outer + rod%fall(i)) - across)
                  f = out%pee(i)*ae(i) + out%pen(i)*outer + out%be(i)
                  beta_rate = rod%xb(i) + rod%yb(i)*f + rod%zb(i)*along - rod%gb(i)*across - rod%hb(i)*w_rate
                  acceleration(i, ip + k) = w_rate - omega_rate(i)
                  acceleration(i, ia + k) = rod%xa(i) + rod%ya(i)*f + rod%za(i)*along - rod%ga(i)*across - rod%ha(i)*w_rate - &
                                            rod%coupling(i)*beta_rate
                  acceleration(i, ib + k) = beta_rate
               end do
            end associate
         end do
      end subroutine outward_pass

   end subroutine lane_inextensible_accelerations

end module rodyn_lane_recursion_inextensible
