!> Accelerations in O(n) of a chain of flexible rods whose arcs keep their length, docs/model.md sec. 3 and 4.2.
!>
!> As in `rodyn_recursion_flexible` the chain from rod k outward is, seen from its inner node, an apparent mass P and a bias b.
!> A bent rod draws its outer node in, so the force f_e that the chain beyond puts on the rod along it bends the rod as well, and
!> the outer node yields to it by a mobility (`rodyn_inextensible_rods`): the chain beyond is lighter along the rod,
!>     P~ = P - P e (mobility/(1 + mobility pee)) e P,   b~ alike.
!> With the outer node's acceleration T A + j W' + c, P' = m + T^T P~ T without W' follows as there: products multiplied
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

   ! Places in `outward` (`rodyn_outboard_chain`): W', f_e and the acceleration of the outer node as they are at A = 0 and by A
   ! along and across the rod, and the turn from the axes of rod k - 1.
   integer, parameter :: of_turn = 1, of_pull = 7, of_along = 13, of_across = 19, of_cosine = 25, of_sine = 27, outward_size = 27

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
         real(wp) :: firm, tnn, ue, un, se, sn, ve, vn, d, inv, yielding, along(2), across(2), pull(2), ce, cn, arm, &
                     pull_0, along_0, across_0, turn, me, mn, r

         associate (chord => bent(group)%chord(i), mobility => bent(group)%mobility(i), t1 => bent(group)%t1(i), &
                    t2 => bent(group)%t2(i), j1 => bent(group)%j1(i), mew => bent(group)%mew(i), &
                    mnw => bent(group)%mnw(i), mww => bent(group)%mww(i), rod => bent(group))
            ! The outer node yields along the rod: P~ = ((pee, pen), (pen, tnn))/firm. All of the row of W' times `firm`.
            firm = 1.0_wp + mobility*pee
            tnn = pnn + mobility*det
            ue = pee*j1 + pen*chord
            un = pen*j1 + tnn*chord
            se = t1*ue
            sn = t2*ue + un
            ve = -t1*chord
            vn = j1 - t2*chord
            d = mww*firm + (j1*ue + chord*un)
            smallest = min(smallest, d)
            inv = 1.0_wp/d
            me = mew*firm
            mn = mnw*firm

            ! P without W'.
            ee = rod%mee(i) + (t1*t1*pee*mww - mew*(me + 2.0_wp*se) + det*ve*ve)*inv
            en = rod%men(i) + (t1*(pee*t2 + pen)*mww - mew*(mn + sn) - se*mnw + det*ve*vn)*inv
            nn = (rod%mnn(i)*d - mnw*(mn + 2.0_wp*sn) + (t2*(t2*pee + 2.0_wp*pen) + tnn)*mww + det*vn*vn)*inv

            ! By A: W', f_e, and the acceleration of the outer node.
            yielding = 1.0_wp/firm
            ce = (me + se)*inv
            cn = (mn + sn)*inv
            arm = (mww - chord*mnw)*firm + ue*vn
            along = [t1 - j1*ce, t2 - j1*cn]
            across = [-chord*ce, arm*inv]
            pull = yielding*(pee*along + pen*across)
            along = along - mobility*pull
            outward(of_turn + 2, k) = ce
            outward(of_turn + 4, k) = cn
            outward(of_pull + 2, k) = pull(1)
            outward(of_pull + 4, k) = pull(2)
            outward(of_along + 2, k) = along(1)
            outward(of_along + 4, k) = along(2)
            outward(of_across + 2, k) = across(1)
            outward(of_across + 4, k) = across(2)

            ! At rest, first without b, whose parts follow by the same T as those of A.
            along_0 = -yielding*(pee*rod%pull(i) + pen*rod%fall(i))
            across_0 = -yielding*(pen*rod%pull(i) + tnn*rod%fall(i))
            turn = firm*inv*(rod%r0(i) - (j1*along_0 + chord*across_0))
            me = rod%re(i) + t1*along_0 + (mew + yielding*se)*turn
            mn = rod%rn(i) + (across_0*arm + along_0*((t2*mww - j1*mnw)*firm - un*vn))*inv + cn*rod%r0(i)
            turn = turn - inv*(j1*be + chord*(firm*bn - mobility*pen*be))
            pull_0 = j1*turn - rod%pull(i)
            across_0 = chord*turn - rod%fall(i)
            along_0 = pull_0
            pull_0 = yielding*(pee*along_0 + pen*across_0 + be)
            outward(of_turn, k) = turn
            outward(of_pull, k) = pull_0
            outward(of_along, k) = along_0 - mobility*pull_0
            outward(of_across, k) = across_0
            r = me + along(1)*be + across(1)*bn
            bn = mn + along(2)*be + across(2)*bn
            be = r
         end associate
      end subroutine add_rod

      !> P and b in the axes of rod k - 1 (of the spacecraft for k = 1).
      subroutine turn_axes()
         real(wp) :: cd, sd, r

         cd = cosine(k)*cosine(k - 1) + sine(k)*sine(k - 1)
         sd = sine(k)*cosine(k - 1) - cosine(k)*sine(k - 1)
         outward(of_cosine, k) = cd
         outward(of_sine, k) = sd
         trace = ee + nn
         det = ee*nn - en*en
         pee = cd*cd*ee + sd*(sd*nn - 2.0_wp*cd*en)
         pnn = cd*cd*nn + sd*(sd*ee + 2.0_wp*cd*en)
         pen = cd*sd*(ee - nn) + (cd - sd)*(cd + sd)*en
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
      real(wp) :: along, across, w_rate, pull

      do group = 1, (n - 1)/lanes + 1
         do i = 1, min(lanes, n - (group - 1)*lanes)
            k = (group - 1)*lanes + i
            along = outward(of_cosine, k)*ae + outward(of_sine, k)*an
            across = outward(of_cosine, k)*an - outward(of_sine, k)*ae
            w_rate = outward(of_turn, k) - outward(of_turn + 2, k)*along - outward(of_turn + 4, k)*across
            pull = outward(of_pull, k) + outward(of_pull + 2, k)*along + outward(of_pull + 4, k)*across
            ae = outward(of_along, k) + outward(of_along + 2, k)*along + outward(of_along + 4, k)*across
            an = outward(of_across, k) + outward(of_across + 2, k)*along + outward(of_across + 4, k)*across
            phi_acceleration(k) = w_rate - omega_rate
            associate (r => bent(group))
               alpha_acceleration(k) = r%xa(i) + r%ya(i)*pull + r%za(i)*along - r%ga(i)*across - r%ha(i)*w_rate
               beta_acceleration(k) = r%xb(i) + r%yb(i)*pull + r%zb(i)*along - r%gb(i)*across - r%hb(i)*w_rate
            end associate
         end do
      end do
   end subroutine outward_pass

end module rodyn_recursion_inextensible
