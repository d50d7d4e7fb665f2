!> Accelerations of a chain of rigid rods with distributed mass in O(n): docs/model.md sec. 4.2 without alpha, beta.
!>
!> The recursion of `rodyn_recursion_flexible` with v = 0; see there for the notation and for why the products
!> are multiplied out. The same equations elsewhere: docs/model.md sec. 7.
module rodyn_recursion_rigid
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use rodyn_kinds, only: wp
   use rodyn_outboard_chain, only: outboard_chain, outward_size
   use rodyn_rod_constants, only: rod_constants
   use rodyn_spacecraft, only: spacecraft_body
   use rodyn_spacecraft_accelerations, only: spacecraft_accelerations
   implicit none (type, external)
   private
   public :: rigid_accelerations

   ! Places in `outward` (`rodyn_outboard_chain`).
   integer, parameter :: of_turn = 1, of_along = 3, of_cross = 5, of_pull = 7, of_cosine = 9, of_sine = 11, &
                         of_down = 13, of_kept = 15

contains

   !> p' = (Vx', Vy', w', phi'') for given rates, hinge moments and loads.
   subroutine rigid_accelerations(n, n_base, rods, rod_of, node_mass, body, sine, cosine, p, moment, &
                                       base_force, loaded, node_force, outward, acceleration, ok)
      integer, intent(in) :: n, n_base              !! rods; 3 or 0 unknowns of the spacecraft
      type(rod_constants), intent(in) :: rods(*)    !! distinct rods
      integer, intent(in) :: rod_of(n)              !! which of them is rod k
      real(wp), intent(in) :: node_mass(0:n)        !! mu [kg]
      type(spacecraft_body), intent(in) :: body     !! mass, inertia, hinge 0
      real(wp), intent(in) :: sine(0:n), cosine(0:n) !! of phi; 0 and 1 at k = 0
      real(wp), intent(in) :: p(n_base + n)         !! rates
      real(wp), intent(in) :: moment(0:n)           !! hinge moments T, T(n) = 0 [N m]
      real(wp), intent(in) :: base_force(3)         !! X_C, Y_C, M_C, moving axes
      logical, intent(in) :: loaded                 !! node_force is to be used
      real(wp), intent(in) :: node_force(2, *)      !! X, Y at nodes (n), moving axes [N]
      real(wp), intent(out) :: outward(outward_size, n) !! workspace
      real(wp), intent(out) :: acceleration(n_base + n) !! p'
      logical, intent(out) :: ok                    !! false: not finite
      type(outboard_chain) :: chain
      real(wp) :: omega, omega_rate, ae, an, base_smallest

      omega = 0.0_wp
      if (n_base > 0) omega = p(3)
      call inward_pass(n, rods, rod_of, node_mass, sine, cosine, p(n_base + 1), omega, moment, loaded, node_force, outward, chain)
      call spacecraft_accelerations(n_base, body, p, chain, base_force, acceleration, ae, an, base_smallest)
      omega_rate = 0.0_wp
      if (n_base > 0) omega_rate = acceleration(3)
      call outward_pass(n, rods, rod_of, outward, omega_rate, ae, an, acceleration(n_base + 1))
      ok = ieee_is_finite(an)
   end subroutine rigid_accelerations

   !> The chain as hinge 0 feels it, moving axes, and what the outward pass needs of each rod.
   subroutine inward_pass(n, rods, rod_of, node_mass, sine, cosine, phi_rate, omega, moment, loaded, node_force, outward, chain)
      integer, intent(in) :: n
      type(rod_constants), intent(in) :: rods(*)
      integer, intent(in) :: rod_of(n)
      real(wp), intent(in) :: node_mass(0:n), sine(0:n), cosine(0:n)
      real(wp), intent(in) :: phi_rate(n)
      real(wp), intent(in) :: omega                  !! w [rad/s]
      real(wp), intent(in) :: moment(0:n)
      logical, intent(in) :: loaded
      real(wp), intent(in) :: node_force(2, *)
      real(wp), intent(out) :: outward(outward_size, n)
      type(outboard_chain), intent(out) :: chain
      integer :: k
      real(wp) :: pee, pen, pnn, det, trace, be, bn, cd, sd, ee, en, nn

      pee = 0.0_wp
      pen = 0.0_wp
      pnn = 0.0_wp
      det = 0.0_wp
      trace = 0.0_wp
      be = 0.0_wp
      bn = 0.0_wp
      do k = n, 1, -1
         call add_node()
         call add_rod()
         call turn_axes()
      end do
      chain = outboard_chain(pee, pen, pnn, det, be, bn, node_mass(0), moment(0))

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

      !> Rod k with the chain beyond it, as its inner node feels them: P in the axes of rod k, b already in those of rod k - 1.
      subroutine add_rod()
         real(wp) :: w2, lw2, r0, arm, inv, ce, cn, down, kept, r

         associate (i => rods(rod_of(k))%inertia, length => rods(rod_of(k))%length, &
                    central => rods(rod_of(k))%central, outer => rods(rod_of(k))%outer)
            ! Row of W', and what follows from it for the outer node.
            w2 = (omega + phi_rate(k))**2
            lw2 = length*w2
            r0 = moment(k) - moment(k - 1)
            cd = cosine(k)*cosine(k - 1) + sine(k)*sine(k - 1)
            sd = sine(k)*cosine(k - 1) - cosine(k)*sine(k - 1)
            arm = i%m2 - length*i%m1
            inv = 1.0_wp/(i%m2 + length**2*pnn)
            ce = length*pen
            cn = i%m1 + length*pnn
            down = -(arm*sd + length*ce*cd)*inv
            kept = (arm*cd - length*ce*sd)*inv
            r0 = r0*inv
            be = be - pee*lw2
            bn = bn - pen*lw2
            outward(of_turn, k) = r0 - (length*inv)*bn
            outward(of_along, k) = ce*inv
            outward(of_cross, k) = cn*inv
            outward(of_pull, k) = lw2
            outward(of_cosine, k) = cd
            outward(of_sine, k) = sd
            outward(of_down, k) = down
            outward(of_kept, k) = kept

            ! Without W'.
            be = be - w2*i%m1
            r = cd*be + (cd*ce - sd*cn)*r0 + down*bn
            bn = sd*be + (sd*ce + cd*cn)*r0 + kept*bn
            be = r
            nn = central + pnn*outer
            ee = pee*i%m2 + length**2*det
            en = pen*arm*inv
            det = (i%m0*nn + pee*central + det*outer)*inv
            ee = i%m0 + ee*inv
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

   !> phi'' from the acceleration of hinge 0.
   pure subroutine outward_pass(n, rods, rod_of, outward, omega_rate, ae, an, phi_acceleration)
      integer, intent(in) :: n
      type(rod_constants), intent(in) :: rods(*)
      integer, intent(in) :: rod_of(n)
      real(wp), intent(in) :: outward(outward_size, n)
      real(wp), intent(in) :: omega_rate            !! w' [rad/s^2]
      real(wp), intent(inout) :: ae, an             !! in: of hinge 0, moving axes; out: of the tip, axes of rod n [m/s^2]
      real(wp), intent(out) :: phi_acceleration(n)
      integer :: k
      real(wp) :: along, across, w_rate

      do k = 1, n
         associate (length => rods(rod_of(k))%length)
            along = outward(of_cosine, k)*ae + outward(of_sine, k)*an
            across = outward(of_cosine, k)*an - outward(of_sine, k)*ae
            w_rate = outward(of_turn, k) - outward(of_along, k)*along - outward(of_cross, k)*across
            phi_acceleration(k) = w_rate - omega_rate
            an = outward(of_down, k)*ae + (outward(of_kept, k)*an + length*outward(of_turn, k))
            ae = along - outward(of_pull, k)
         end associate
      end do
   end subroutine outward_pass

end module rodyn_recursion_rigid
