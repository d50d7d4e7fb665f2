!> The recursion of `rodyn_recursion_inextensible` in all lanes at once: same equations, names and order of steps, so that the two
!> can be read side by side.
!>
!> What a lane computes never depends on another one. The same equations elsewhere: docs/model.md sec. 7.
module rodyn_lane_recursion_inextensible
   use rodyn_kinds, only: wp
   use rodyn_inextensible_rods, only: bent_rods, bend_rods
   use rodyn_lanes, only: lanes
   use rodyn_lane_rods, only: lane_rod
   use rodyn_lane_spacecraft, only: lane_spacecraft_accelerations
   use rodyn_outboard_chain, only: lane_outboard_chain
   implicit none (type, external)
   private
   public :: lane_inextensible_accelerations

   !> What the inward pass leaves of a rod for the outward pass: W', f_e and the acceleration of the outer node at A = 0 and by A
   !> along and across the rod, and the turn from the axes of rod k - 1.
   type, public :: lane_outward
      real(wp), dimension(lanes) :: turn, ce, cn, cd, sd, pull_0, pull_e, pull_n, along_0, along_e, along_n
   end type lane_outward

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
            call add_rod(bent(k), outward(k))
         end do
      end subroutine inward_pass

      !> Force on node k.
      subroutine load_node()
         do i = 1, lanes
            chain%be(i) = chain%be(i) - (node_force(i, 1, k)*cosine(i, k) + node_force(i, 2, k)*sine(i, k))
            chain%bn(i) = chain%bn(i) - (node_force(i, 2, k)*cosine(i, k) - node_force(i, 1, k)*sine(i, k))
         end do
      end subroutine load_node

      !> Rod k with the chain beyond it, as its inner node feels them, in the axes of rod k - 1 (of the spacecraft for k = 1).
      subroutine add_rod(rod, out)
         type(bent_rods), intent(in) :: rod
         type(lane_outward), intent(inout) :: out
         real(wp) :: mu, pee, pen, pnn, det, be, bn, firm, yielding, tee, ten, tnn, ue, un, se, sn, ve, vn, d, inv, me, mn, ee, &
                     en, nn, ce, cn, turn, bse, bsn, along, across, cd, sd

         !$omp simd
         do i = 1, lanes
            ! `add_node`.
            mu = node_mass(i, k)
            det = chain%det(i) + mu*(chain%pee(i) + chain%pnn(i) + mu)
            pee = chain%pee(i) + mu
            pnn = chain%pnn(i) + mu
            pen = chain%pen(i)
            be = chain%be(i)
            bn = chain%bn(i)

            ! `add_rod`. The outer node yields along the rod: P~ = ((pee, pen), (pen, tnn))/firm.
            firm = 1.0_wp + rod%mobility(i)*pee
            tnn = pnn + rod%mobility(i)*det
            ue = pee*rod%j1(i) + pen*rod%chord(i)
            un = pen*rod%j1(i) + tnn*rod%chord(i)
            se = rod%t1(i)*ue
            sn = rod%t2(i)*ue + un
            ve = -rod%t1(i)*rod%chord(i)
            vn = rod%j1(i) - rod%t2(i)*rod%chord(i)
            d = rod%mww(i)*firm + (rod%j1(i)*ue + rod%chord(i)*un)
            smallest(i) = min(smallest(i), d)
            inv = 1.0_wp/d
            me = rod%mew(i)*firm
            mn = rod%mnw(i)*firm
            ce = me + se
            cn = mn + sn

            ! P without W'.
            ee = rod%mee(i) + (rod%t1(i)*rod%t1(i)*pee*rod%mww(i) - rod%mew(i)*(ce + se) + det*ve*ve)*inv
            en = rod%men(i) + (rod%t1(i)*(pee*rod%t2(i) + pen)*rod%mww(i) - rod%mew(i)*cn - se*rod%mnw(i) + det*ve*vn)*inv
            nn = rod%mnn(i) + ((rod%t2(i)*(rod%t2(i)*pee + 2.0_wp*pen) + tnn)*rod%mww(i) - rod%mnw(i)*(cn + sn) + det*vn*vn)*inv

            ! At rest.
            yielding = 1.0_wp/firm
            tee = yielding*pee
            ten = yielding*pen
            tnn = yielding*tnn
            be = yielding*be
            bsn = bn - rod%mobility(i)*pen*be - ten*rod%pull(i) - tnn*rod%fall(i)
            bse = be - tee*rod%pull(i) - ten*rod%fall(i)
            turn = firm*inv*(rod%r0(i) - (rod%j1(i)*bse + rod%chord(i)*bsn))
            ce = ce*inv
            cn = cn*inv
            along = rod%j1(i)*turn - rod%pull(i)
            across = rod%chord(i)*turn - rod%fall(i)
            out%turn(i) = turn
            out%ce(i) = ce
            out%cn(i) = cn
            out%pull_0(i) = tee*along + ten*across + be
            out%along_0(i) = along - rod%mobility(i)*out%pull_0(i)
            along = rod%t1(i) - rod%j1(i)*ce
            out%pull_e(i) = tee*along - ten*rod%chord(i)*ce
            out%along_e(i) = along - rod%mobility(i)*out%pull_e(i)
            along = rod%t2(i) - rod%j1(i)*cn
            across = ((rod%mww(i) - rod%chord(i)*rod%mnw(i))*firm + ue*vn)*inv
            out%pull_n(i) = tee*along + ten*across
            out%along_n(i) = along - rod%mobility(i)*out%pull_n(i)
            be = rod%re(i) + rod%t1(i)*bse + (rod%mew(i) + yielding*se)*turn
            bn = rod%rn(i) + (bsn*across + bse*((rod%t2(i)*rod%mww(i) - rod%j1(i)*rod%mnw(i))*firm - un*vn)*inv) + cn*rod%r0(i)

            ! `turn_axes`, with b.
            cd = cosine(i, k)*cosine(i, k - 1) + sine(i, k)*sine(i, k - 1)
            sd = sine(i, k)*cosine(i, k - 1) - cosine(i, k)*sine(i, k - 1)
            out%cd(i) = cd
            out%sd(i) = sd
            chain%det(i) = ee*nn - en*en
            chain%pee(i) = cd*cd*ee + sd*(sd*nn - 2.0_wp*cd*en)
            chain%pnn(i) = cd*cd*nn + sd*(sd*ee + 2.0_wp*cd*en)
            chain%pen(i) = cd*sd*(ee - nn) + (cd - sd)*(cd + sd)*en
            chain%be(i) = cd*be - sd*bn
            chain%bn(i) = sd*be + cd*bn
         end do
      end subroutine add_rod

      !> phi'', alpha'', beta'' from the acceleration of hinge 0.
      subroutine outward_pass()
         real(wp) :: along, across, w_rate, pull

         do k = 1, n
            associate (out => outward(k), rod => bent(k))
               !$omp simd
               do i = 1, lanes
                  along = out%cd(i)*ae(i) + out%sd(i)*an(i)
                  across = out%cd(i)*an(i) - out%sd(i)*ae(i)
                  w_rate = out%turn(i) - out%ce(i)*along - out%cn(i)*across
                  pull = out%pull_0(i) + out%pull_e(i)*along + out%pull_n(i)*across
                  ae(i) = out%along_0(i) + out%along_e(i)*along + out%along_n(i)*across
                  an(i) = across + rod%chord(i)*w_rate - rod%fall(i)
                  acceleration(i, ip + k) = w_rate - omega_rate(i)
                  acceleration(i, ia + k) = rod%xa(i) + rod%ya(i)*pull + rod%za(i)*along - rod%ga(i)*across - rod%ha(i)*w_rate
                  acceleration(i, ib + k) = rod%xb(i) + rod%yb(i)*pull + rod%zb(i)*along - rod%gb(i)*across - rod%hb(i)*w_rate
               end do
            end associate
         end do
      end subroutine outward_pass

   end subroutine lane_inextensible_accelerations

end module rodyn_lane_recursion_inextensible
