!> Accelerations of a chain of rigid rods with distributed mass in O(n): docs/model.md sec. 4.2 without alpha, beta.
!>
!> The recursion of `rodyn_recursion_flexible` with v = 0; see there for the notation and for why the products
!> are multiplied out.
module rodyn_recursion_rigid
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use rodyn_kinds, only: wp
   use rodyn_outward, only: outward_size
   use rodyn_rod_constants, only: rod_constants
   use rodyn_spacecraft, only: spacecraft_body, spacecraft_accelerations
   implicit none (type, external)
   private
   public :: rigid_accelerations

   ! Places in `outward` (`rodyn_outward`).
   integer, parameter :: of_turn = 1, of_along = 3, of_cross = 5, of_pull = 7, of_cosine = 9, of_sine = 11, &
                         of_down = 13, of_kept = 15

contains

   !> p' = (Vx', Vy', w', phi'') for given rates, hinge moments and loads.
   pure subroutine rigid_accelerations(n, n_base, rods, rod_of, node_mass, body, sine, cosine, p, moment, &
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

      integer :: k
      real(wp) :: omega, omega_rate, w2, lw2, w_rate, arm, r0, ce, down, kept
      real(wp) :: pee, pen, pnn, det, trace, be, bn, mu, inv, cn, r, ee, en, nn, cd, sd, ae, an, base_smallest

      omega = 0.0_wp
      if (n_base > 0) omega = p(3)
      pee = 0.0_wp
      pen = 0.0_wp
      pnn = 0.0_wp
      det = 0.0_wp
      trace = 0.0_wp
      be = 0.0_wp
      bn = 0.0_wp

      inward: do k = n, 1, -1
         associate (i => rods(rod_of(k))%inertia, length => rods(rod_of(k))%length, &
                    central => rods(rod_of(k))%central, outer => rods(rod_of(k))%outer)
            mu = node_mass(k)
            det = det + mu*(trace + mu)
            pee = pee + mu
            pnn = pnn + mu
            if (loaded) then
               be = be - (node_force(1, k)*cosine(k) + node_force(2, k)*sine(k))
               bn = bn - (node_force(2, k)*cosine(k) - node_force(1, k)*sine(k))
            end if

            w2 = (omega + p(n_base + k))**2
            lw2 = length*w2
            r0 = moment(k) - moment(k - 1)
            cd = cosine(k)*cosine(k - 1) + sine(k)*sine(k - 1)
            sd = sine(k)*cosine(k - 1) - cosine(k)*sine(k - 1)
            arm = i%m2 - length*i%m1
            inv = 1.0_wp/(i%m2 + length**2*pnn)
            ce = length*pen
            cn = i%m1 + length*pnn
            r0 = r0*inv
            be = be - pee*lw2
            bn = bn - pen*lw2
            down = -(arm*sd + length*ce*cd)*inv
            kept = (arm*cd - length*ce*sd)*inv
            outward(of_turn, k) = r0 - (length*inv)*bn
            outward(of_along, k) = ce*inv
            outward(of_cross, k) = cn*inv
            outward(of_pull, k) = lw2
            outward(of_cosine, k) = cd
            outward(of_sine, k) = sd
            outward(of_down, k) = down
            outward(of_kept, k) = kept

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
         trace = ee + nn
         pee = cd*cd*ee + sd*(sd*nn - 2.0_wp*cd*en)
         pnn = cd*cd*nn + sd*(sd*ee + 2.0_wp*cd*en)
         pen = cd*sd*(ee - nn) + (cd - sd)*(cd + sd)*en
      end do inward

      call spacecraft_accelerations(n_base, body, p, node_mass(0), pee, pen, pnn, det, be, bn, moment(0), &
                                    base_force, acceleration, ae, an, base_smallest)
      omega_rate = 0.0_wp
      if (n_base > 0) omega_rate = acceleration(3)

      do k = 1, n
         associate (length => rods(rod_of(k))%length)
            ee = outward(of_cosine, k)*ae + outward(of_sine, k)*an
            nn = outward(of_cosine, k)*an - outward(of_sine, k)*ae
            w_rate = outward(of_turn, k) - outward(of_along, k)*ee - outward(of_cross, k)*nn
            acceleration(n_base + k) = w_rate - omega_rate
            an = outward(of_down, k)*ae + (outward(of_kept, k)*an + length*outward(of_turn, k))
            ae = ee - outward(of_pull, k)
         end associate
      end do
      ok = ieee_is_finite(an)
   end subroutine rigid_accelerations

end module rodyn_recursion_rigid
