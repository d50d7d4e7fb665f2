!> Accelerations of a chain of massless rods between point masses in O(n), docs/model.md sec. 5 (`lumped`).
!>
!> A massless rod pulls and pushes only along itself, apart from the couple T_k - T_{k-1}: seen from its inner
!> node, the chain from rod k outward is  f = a Ae e + b  with one axial apparent mass
!>     a = mu (mu + a_out)/(mu + a_out sin^2(delta)),
!> delta the angle from rod k to rod k + 1 and mu the mass between them: no differences, no loss of digits. In vector lanes:
!> `rodyn_lane_recursion_rigid`, which has the same limit. The same equations elsewhere: docs/model.md sec. 7.
module rodyn_recursion_lumped
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use rodyn_kinds, only: wp
   use rodyn_outboard_chain, only: outboard_chain, outward_size
   use rodyn_rod_constants, only: rod_constants
   use rodyn_spacecraft, only: spacecraft_body
   use rodyn_spacecraft_accelerations, only: spacecraft_accelerations
   implicit none (type, external)
   private
   public :: lumped_accelerations

   ! Places in `outward` (`rodyn_outboard_chain`).
   integer, parameter :: of_shear = 1, of_along = 3, of_pull = 5, of_cosine = 7, of_sine = 9

contains

   !> p' = (Vx', Vy', w', phi'') for given rates, hinge moments and loads.
   pure subroutine lumped_accelerations(n, n_base, rods, rod_of, node_mass, body, sine, cosine, p, moment, &
                                        base_force, loaded, node_force, outward, acceleration, ok)
      integer, intent(in) :: n, n_base              !! rods; 3 or 0 unknowns of the spacecraft
      type(rod_constants), intent(in) :: rods(*)    !! distinct rods; only their lengths matter
      integer, intent(in) :: rod_of(n)              !! which of them is rod k
      real(wp), intent(in) :: node_mass(0:n)        !! node and half-rod masses, positive for k >= 1 [kg]
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
   end subroutine lumped_accelerations

   !> The chain as hinge 0 feels it, moving axes, and what the outward pass needs of each rod.
   pure subroutine inward_pass(n, rods, rod_of, node_mass, sine, cosine, phi_rate, omega, moment, loaded, node_force, &
                               outward, chain)
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
      real(wp) :: lw2, a, be, bn, mu, inv, shear, ratio, cd, sd, r

      a = 0.0_wp
      be = 0.0_wp
      bn = 0.0_wp
      cd = 1.0_wp ! of the angle from rod k to rod k + 1
      sd = 0.0_wp
      do k = n, 1, -1
         associate (length => rods(rod_of(k))%length)
            mu = node_mass(k)
            if (loaded) then
               be = be - (node_force(1, k)*cosine(k) + node_force(2, k)*sine(k))
               bn = bn - (node_force(2, k)*cosine(k) - node_force(1, k)*sine(k))
            end if
            ! P = mu I + a e'e', e' the axis of rod k + 1; its row across rod k is (pen, pnn).
            lw2 = length*(omega + phi_rate(k))**2
            shear = (moment(k) - moment(k - 1))/length
            inv = 1.0_wp/(mu + a*sd**2)
            ratio = a*cd*sd*inv
            a = mu*(mu + a)*inv
            outward(of_shear, k) = (shear - bn)*inv
            outward(of_along, k) = ratio
            outward(of_pull, k) = lw2
            be = be - a*lw2 - ratio*(bn - shear)
            bn = shear
         end associate

         cd = cosine(k)*cosine(k - 1) + sine(k)*sine(k - 1)
         sd = sine(k)*cosine(k - 1) - cosine(k)*sine(k - 1)
         outward(of_cosine, k) = cd
         outward(of_sine, k) = sd
         r = cd*be - sd*bn
         bn = sd*be + cd*bn
         be = r
      end do
      chain = outboard_chain(a*cd**2, a*cd*sd, a*sd**2, 0.0_wp, be, bn, node_mass(0), moment(0))
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
      real(wp) :: along, across, outer

      do k = 1, n
         along = outward(of_cosine, k)*ae + outward(of_sine, k)*an
         across = outward(of_cosine, k)*an - outward(of_sine, k)*ae
         ae = along - outward(of_pull, k)
         outer = outward(of_shear, k) - outward(of_along, k)*ae ! acceleration of node k across the rod
         phi_acceleration(k) = (outer - across)/rods(rod_of(k))%length - omega_rate
         an = outer
      end do
   end subroutine outward_pass

end module rodyn_recursion_lumped
