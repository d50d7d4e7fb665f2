!> Accelerations in O(n) of a chain of flexible rods whose arcs keep their length, docs/model.md sec. 3 and 4.2.
!>
!> As in `rodyn_recursion_flexible` the chain from rod k outward is, seen from its inner node, an apparent mass P and a bias b.
!> A bent rod draws its outer node in, so the force f that the chain beyond puts on the rod along it bends the rod as well, and
!> the outer node yields to it by a mobility (`rodyn_inextensible_rods`): the chain beyond is lighter along the rod,
!>     P~ = P - P e (mobility/(1 + mobility pee)) e P,   b~ alike.
!> What is eliminated is not W' but the outer node's acceleration o across the rod. Of what is left the products are multiplied
!> out, so that the large terms cancel on paper.
!> The same equations elsewhere: docs/model.md sec. 7.
module rodyn_recursion_inextensible
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use rodyn_kinds, only: wp
   use rodyn_lanes, only: lanes
   use rodyn_outboard_chain, only: outboard_chain
   use rodyn_inextensible_rods, only: bent_rods, bend_rods
   use rodyn_lane_rods, only: lane_rod, put_rod
   use rodyn_scene, only: scene_type
   use rodyn_spacecraft_accelerations, only: spacecraft_accelerations
   implicit none (type, external)
   private
   public :: inextensible_recursion, new_inextensible_recursion, inextensible_accelerations

   ! Places in `outward` (`rodyn_outboard_chain`): accelerations o and along the rod of the outer node as they are at A = 0 and by A
   ! along and across the rod; (pee, pen, be) there; the turn from the axes of rod k - 1.
   integer, parameter :: of_outer = 1, of_along = 7, of_force = 13, of_cosine = 19, of_sine = 21, outward_size = 21

   !> Memory. Rods stand in groups of `lanes`, from hinge 0 on. One per thread.
   type :: inextensible_recursion
      type(lane_rod), allocatable :: rods(:)   !! of each group, or one for all if all rods are alike
      type(bent_rods), allocatable :: bent(:)  !! (groups)
      real(wp), allocatable :: outward(:, :)   !! (outward_size, n)
   end type inextensible_recursion

contains

   !> Allocate for a scene.
   subroutine new_inextensible_recursion(recursion, scene)
      type(inextensible_recursion), intent(out) :: recursion
      type(scene_type), intent(in) :: scene
      integer :: groups, i, k

      groups = (scene%n - 1)/lanes + 1
      allocate (recursion%bent(groups), recursion%rods(merge(1, groups, size(scene%rods) == 1)), &
                recursion%outward(outward_size, scene%n))
      do i = 1, size(recursion%rods)
         do k = 1, lanes
            call put_rod(recursion%rods(i), k, scene%rods(scene%rod_of(min((i - 1)*lanes + k, scene%n))))
         end do
      end do
   end subroutine new_inextensible_recursion

   !> p' = (Vx', Vy', w', phi'', alpha'', beta'') for given q, p, moments and loads.
   subroutine inextensible_accelerations(recursion, scene, sine, cosine, q, p, moment, base_force, loaded, node_force, &
                                         acceleration, ok)
      type(inextensible_recursion), intent(inout) :: recursion
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: sine(0:scene%n), cosine(0:scene%n) !! of phi; 0 and 1 at k = 0
      real(wp), intent(in) :: q(*), p(*)           !! coordinates and rates
      real(wp), intent(in) :: moment(0:scene%n)    !! T [N m], T(n) = 0
      real(wp), intent(in) :: base_force(3)        !! X_C, Y_C, M_C, moving axes
      logical, intent(in) :: loaded                !! node_force is to be used
      real(wp), intent(in) :: node_force(2, *)     !! X, Y at nodes (n), moving axes [N]
      real(wp), intent(out) :: acceleration(*)     !! p'
      logical, intent(out) :: ok                   !! false: not finite, or M not positive definite
      type(outboard_chain) :: chain
      real(wp) :: omega, omega_rate, ae, an, smallest, base_smallest

      omega = 0.0_wp
      if (scene%n_base > 0) omega = p(3)
      associate (n => scene%n, first => scene%n_base)
         call bend_chain(recursion, n, omega, p(first + 1), q(first + n + 1), q(first + 2*n + 1), p(first + n + 1), &
                         p(first + 2*n + 1), moment)
         call inward_pass(n, recursion%bent, scene%node_mass, sine, cosine, moment(0), loaded, node_force, recursion%outward, &
                          chain, smallest)
         call spacecraft_accelerations(first, scene%body, p, chain, base_force, acceleration, ae, an, base_smallest)
         omega_rate = 0.0_wp
         if (first > 0) omega_rate = acceleration(3)
         call outward_pass(n, recursion%bent, recursion%outward, omega_rate, ae, an, acceleration(first + 1), &
                           acceleration(first + n + 1), acceleration(first + 2*n + 1))
      end associate
      ok = ieee_is_finite(an) .and. smallest > 0.0_wp .and. base_smallest > 0.0_wp
   end subroutine inextensible_accelerations

   !> Each rod for itself. Full vectors, but at the end of a chain no more than it takes.
   pure subroutine bend_chain(recursion, n, omega, phi_rate, alpha, beta, alpha_rate, beta_rate, moment)
      type(inextensible_recursion), intent(inout) :: recursion
      integer, intent(in) :: n
      real(wp), intent(in) :: omega !! w [rad/s]
      real(wp), dimension(n), intent(in) :: phi_rate, alpha, beta, alpha_rate, beta_rate
      real(wp), intent(in) :: moment(0:n)
      real(wp) :: turning(lanes)
      integer :: first, group, width

      turning = omega
      do group = 1, size(recursion%bent)
         first = (group - 1)*lanes
         width = min(lanes, n - first)
         call bend_rods(width, recursion%rods(min(group, size(recursion%rods))), turning, phi_rate(first + 1), alpha(first + 1), &
                        beta(first + 1), alpha_rate(first + 1), beta_rate(first + 1), moment(first), moment(first + 1), &
                        recursion%bent(group))
      end do
   end subroutine bend_chain

   !> The chain as hinge 0 feels it, moving axes, and what the outward pass needs of each rod.
   subroutine inward_pass(n, bent, node_mass, sine, cosine, moment, loaded, node_force, outward, chain, smallest)
      integer, intent(in) :: n
      type(bent_rods), intent(in) :: bent(*)
      real(wp), intent(in) :: node_mass(0:n), sine(0:n), cosine(0:n)
      real(wp), intent(in) :: moment                  !! T_0 [N m]
      logical, intent(in) :: loaded
      real(wp), intent(in) :: node_force(2, *)
      real(wp), intent(out) :: outward(outward_size, n)
      type(outboard_chain), intent(out) :: chain
      real(wp), intent(out) :: smallest               !! not positive: M is not positive definite
      integer :: k, i, group
      real(wp) :: pee, pen, pnn, det, trace, be, bn, ee, en, nn

      pee = 0.0_wp
      pen = 0.0_wp
      pnn = 0.0_wp
      det = 0.0_wp
      trace = 0.0_wp
      be = 0.0_wp
      bn = 0.0_wp
      smallest = huge(1.0_wp)
      do group = (n - 1)/lanes + 1, 1, -1
         do i = min(lanes, n - (group - 1)*lanes), 1, -1
            k = (group - 1)*lanes + i
            call add_node()
            call add_rod()
            call turn_axes()
         end do
      end do
      chain = outboard_chain(pee, pen, pnn, det, be, bn, node_mass(0), moment)

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

      !> Rod k with the chain beyond it, as its inner node feels them: P and b in the axes of rod k.
      subroutine add_rod()
         real(wp) :: firm, yielding, tnn, ue, se, sn, d, inv, ce, cn, kk, ke, kn, f, at_rest, r, kept, outer

         associate (te => bent(group)%te(i), tn => bent(group)%tn(i), to => bent(group)%to(i), eo => bent(group)%eo(i), &
                    no => bent(group)%no(i), oo => bent(group)%oo(i), mobility => bent(group)%mobility(i), &
                    pull => bent(group)%pull(i), rod => bent(group))
            outward(of_force, k) = pee
            outward(of_force + 2, k) = pen
            outward(of_force + 4, k) = be

            ! The outer node yields along the rod: P~ = ((pee, pen), (pen, tnn))/firm. All of the row of o times `firm`.
            firm = 1.0_wp + mobility*pee
            yielding = 1.0_wp/firm
            tnn = pnn + mobility*det
            ue = pee*to + pen
            d = oo*firm + (to*(ue + pen) + tnn)
            smallest = min(smallest, d)
            inv = 1.0_wp/d
            se = te*ue
            sn = tn*ue
            ce = eo*firm + se
            cn = no*firm + sn

            ! P without o.
            kk = pee*oo + det
            ke = te*kk
            kn = tn*kk
            ee = rod%ee(i) + (te*ke - eo*(ce + se))*inv
            en = rod%en(i) + (tn*ke - eo*cn - se*no)*inv
            nn = rod%nn(i) + (tn*kn - no*(cn + sn))*inv

            ! At rest: f and the outer node's acceleration along the rod at o = 0, and the row of o.
            ce = ce*inv
            cn = cn*inv
            f = yielding*(be - pee*pull)
            at_rest = pull + mobility*f
            r = (bn + rod%ro(i)) + to*f - pen*at_rest
            kept = yielding*(to - mobility*pen)
            outer = -firm*inv*r
            outward(of_outer, k) = outer
            outward(of_outer + 2, k) = ce
            outward(of_outer + 4, k) = cn
            outward(of_along, k) = kept*outer - at_rest
            outward(of_along + 2, k) = yielding*te - kept*ce
            outward(of_along + 4, k) = yielding*tn - kept*cn
            be = rod%re(i) + te*f - ce*r
            bn = rod%rn(i) + tn*f - cn*r
         end associate
      end subroutine add_rod

      !> P and b in the axes of rod k - 1 (of the spacecraft for k = 1).
      subroutine turn_axes()
         real(wp) :: cd, sd, along, across, r

         cd = cosine(k)*cosine(k - 1) + sine(k)*sine(k - 1)
         sd = sine(k)*cosine(k - 1) - cosine(k)*sine(k - 1)
         outward(of_cosine, k) = cd
         outward(of_sine, k) = sd
         trace = ee + nn
         det = ee*nn - en*en
         along = cd*ee - sd*en
         across = cd*en - sd*nn
         pee = cd*along - sd*across
         pen = sd*along + cd*across
         pnn = sd*(sd*ee + cd*en) + cd*(sd*en + cd*nn)
         r = cd*be - sd*bn
         bn = sd*be + cd*bn
         be = r
      end subroutine turn_axes

   end subroutine inward_pass

   !> phi'', alpha'', beta'' from the acceleration of hinge 0.
   pure subroutine outward_pass(n, bent, outward, omega_rate, ae, an, phi_acceleration, alpha_acceleration, beta_acceleration)
      integer, intent(in) :: n
      type(bent_rods), intent(in) :: bent(*)
      real(wp), intent(in) :: outward(outward_size, n)
      real(wp), intent(in) :: omega_rate            !! w' [rad/s^2]
      real(wp), intent(inout) :: ae, an             !! in: of hinge 0, moving axes; out: of the tip, axes of rod n [m/s^2]
      real(wp), dimension(n), intent(out) :: phi_acceleration, alpha_acceleration, beta_acceleration
      integer :: k, i, group
      real(wp) :: along, across, w_rate, f

      do group = 1, (n - 1)/lanes + 1
         do i = 1, min(lanes, n - (group - 1)*lanes)
            k = (group - 1)*lanes + i
            along = outward(of_cosine, k)*ae + outward(of_sine, k)*an
            across = outward(of_cosine, k)*an - outward(of_sine, k)*ae
            ae = outward(of_along, k) + outward(of_along + 2, k)*along + outward(of_along + 4, k)*across
            an = outward(of_outer, k) - outward(of_outer + 2, k)*along - outward(of_outer + 4, k)*across
            f = outward(of_force, k)*ae + outward(of_force + 2, k)*an + outward(of_force + 4, k)
            associate (r => bent(group))
               w_rate = r%per_chord(i)*((an + r%fall(i)) - across)
               phi_acceleration(k) = w_rate - omega_rate
               beta_acceleration(k) = r%xb(i) + r%yb(i)*f + r%zb(i)*along - r%gb(i)*across - r%hb(i)*w_rate
               alpha_acceleration(k) = r%xa(i) + r%ya(i)*f + r%za(i)*along - r%ga(i)*across - r%ha(i)*w_rate - &
                                       r%coupling(i)*beta_acceleration(k)
            end associate
         end do
      end do
   end subroutine outward_pass

end module rodyn_recursion_inextensible
