!> Rods whose arcs keep their length, each for itself and, in vector lanes, with the chain beyond: docs/model.md sec. 3,
!> `inextensible`.
!>
!> What a bent rod is to its neighbours does not depend on them, so `lanes` rods are bent at once: several of one scene
!> (`rodyn_recursion_inextensible`), or the same one of several scenes (`rodyn_lane_recursion_inextensible`).
!> The same equations elsewhere: docs/model.md sec. 7.
module rodyn_inextensible_rods
   use rodyn_kinds, only: wp
   use rodyn_lanes, only: lanes
   use rodyn_lane_rods, only: lane_rod
   use rodyn_outboard_chain, only: lane_outboard_chain
   implicit none (type, external)
   private
   public :: bent_rods, bend_rods, lane_outward, add_rods

   !> Rods at their slopes and rates, without alpha'', beta''. What is left are the accelerations A of the inner node and o, across
   !> the rod, of the outer one, which turn the rod by
   !>     W' = (o - A_n + fall)/chord,
   !> and the force f along the rod on what is beyond it. Without the force on it across the rod, the rows of (A_e, A_n, o) and the
   !> outer node's acceleration along the rod are
   !>     m (A_e, A_n, o) + (te, tn, to) f + (re, rn, ro),     (te, tn, to).(A_e, A_n, o) - mobility f - pull.
   !> Written for o instead of W', the chain beyond adds nothing to the rows of A, however heavy it is.
   type :: bent_rods
      real(wp), dimension(lanes) :: ee, en, nn, eo, no, oo !! m
      real(wp), dimension(lanes) :: re, rn, ro, te, tn, to, mobility, pull
      real(wp), dimension(lanes) :: per_chord, fall
      ! beta'' = xb + yb f + zb A_e - gb A_n - hb W', alpha'' = xa + ya f + za A_e - ga A_n - ha W' - coupling beta''
      real(wp), dimension(lanes) :: xa, xb, ya, yb, za, zb, ga, gb, ha, hb, coupling
      real(wp), dimension(lanes) :: inv_a, inv_b, ca, cb, da, db, ea, eb, m1, mv, chord !! on the way to these (`bend_rods`)
   end type bent_rods

   !> What the inward pass leaves of a rod for the outward pass: o and the outer node's acceleration along the rod at A = 0 and by A
   !> along and across it, f = pee along + pen o + be, and the turn from the axes of rod k - 1.
   type :: lane_outward
      real(wp), dimension(lanes) :: o_0, o_e, o_n, along_0, along_e, along_n, pee, pen, be, cd, sd
   end type lane_outward

contains

   !> Bend rods. With the foreshortening d = x.D(s) x/2, x = (alpha, beta), the block of alpha'', beta'' is B + int m (D x)(D x)^T.
   pure subroutine bend_rods(width, rod, omega, phi_rate, alpha, beta, alpha_rate, beta_rate, moment_in, moment_out, bent)
      integer, intent(in) :: width !! how many of the lanes
      type(lane_rod), intent(in) :: rod
      real(wp), dimension(width), intent(in) :: omega !! w [rad/s]
      real(wp), dimension(width), intent(in) :: phi_rate, alpha, beta, alpha_rate, beta_rate
      real(wp), dimension(width), intent(in) :: moment_in, moment_out !! T of the hinges at both ends [N m]
      type(bent_rods), intent(inout) :: bent
      real(wp) :: a, b, u, v, aa, ab, bb, uu, uv, vv, w, w1, w2, half_w2, b11, b12, b22, coupling, skew, fa, fb, fc, qa, qb, &
                  ta, tb, b1, ha, hb, mew, mnw, mww, per, eo, no, oo, to, r0, re, rn, fall
      integer :: i

      ! What depends on the slopes only.
      !$omp simd
      do i = 1, width
         a = alpha(i)
         b = beta(i)
         aa = a*a
         ab = (a + a)*b
         bb = b*b

         ! d' = x.D x' along the rod: the block is B + Q, Q = int m (D x)(D x)^T. Its factors L (inv_a, inv_b)^-1 L^T,
         ! L = ((1, 0), (coupling, 1)).
         b11 = rod%aa(i) + rod%products(i, 1)*aa + rod%products(i, 2)*ab + rod%products(i, 3)*bb
         b12 = rod%ab(i) + rod%products(i, 2)*aa + rod%products(i, 7)*ab + rod%products(i, 5)*bb
         b22 = rod%bb(i) + rod%products(i, 3)*aa + rod%products(i, 5)*ab + rod%products(i, 6)*bb
         bent%inv_a(i) = 1.0_wp/b11
         coupling = b12*bent%inv_a(i)
         bent%inv_b(i) = 1.0_wp/(b22 - coupling*b12)
         bent%coupling(i) = coupling

         ! (2 (B - S) + Q) x, and the moment of inertia.
         bent%ca(i) = (rod%curved(i, 1) + b11)*a + (rod%curved(i, 2) + b12)*b
         bent%cb(i) = (rod%curved(i, 2) + b12)*a + (rod%curved(i, 3) + b22)*b
         mww = rod%m2(i) + 0.25_wp*(a*bent%ca(i) + b*bent%cb(i) + rod%twice(i, 1)*aa + rod%twice(i, 2)*ab + rod%twice(i, 3)*bb)

         ! Deflection; foreshortening of the chord and of the first moment.
         bent%mv(i) = rod%a1(i)*a + rod%b1(i)*b
         bent%da(i) = rod%shortening(i, 1)*a + rod%shortening(i, 2)*b
         bent%db(i) = rod%shortening(i, 2)*a + rod%shortening(i, 3)*b
         bent%ea(i) = rod%drawn(i, 1)*a + rod%drawn(i, 2)*b
         bent%eb(i) = rod%drawn(i, 2)*a + rod%drawn(i, 3)*b
         bent%m1(i) = rod%m1(i) - 0.5_wp*(a*bent%ea(i) + b*bent%eb(i))
         bent%chord(i) = rod%length(i) - 0.5_wp*(a*bent%da(i) + b*bent%db(i))
         per = 1.0_wp/bent%chord(i)
         bent%per_chord(i) = per

         ! L^-1 of the columns of alpha'', beta'', and what is left of the matrix without them.
         bent%db(i) = bent%db(i) - coupling*bent%da(i)
         bent%eb(i) = bent%eb(i) - coupling*bent%ea(i)
         b1 = rod%b1(i) - coupling*rod%a1(i)
         ta = rod%sa(i) + rod%turning_alpha(i, 1)*aa + rod%turning_alpha(i, 2)*ab + rod%turning_alpha(i, 3)*bb
         tb = rod%sb(i) + rod%turning_beta(i, 1)*aa + rod%turning_beta(i, 2)*ab + rod%turning_beta(i, 3)*bb - coupling*ta
         bent%ya(i) = bent%inv_a(i)*bent%da(i)
         bent%yb(i) = bent%inv_b(i)*bent%db(i)
         bent%za(i) = bent%inv_a(i)*bent%ea(i)
         bent%zb(i) = bent%inv_b(i)*bent%eb(i)
         bent%ga(i) = bent%inv_a(i)*rod%a1(i)
         bent%gb(i) = bent%inv_b(i)*b1
         ha = bent%inv_a(i)*ta
         hb = bent%inv_b(i)*tb
         bent%ha(i) = ha
         bent%hb(i) = hb
         mww = mww - ha*ta - hb*tb
         mew = ha*bent%ea(i) - bent%mv(i) + hb*bent%eb(i)
         mnw = bent%m1(i) - ha*rod%a1(i) - hb*b1
         bent%mobility(i) = bent%ya(i)*bent%da(i) + bent%yb(i)*bent%db(i)
         bent%te(i) = 1.0_wp - bent%za(i)*bent%da(i) - bent%zb(i)*bent%db(i)
         bent%ee(i) = rod%m0(i) - bent%za(i)*bent%ea(i) - bent%zb(i)*bent%eb(i)

         ! o instead of W'.
         to = per*(ha*bent%da(i) + hb*bent%db(i))
         eo = per*mew
         oo = per*per*mww
         no = per*mnw - oo
         bent%to(i) = to
         bent%eo(i) = eo
         bent%oo(i) = oo
         bent%no(i) = no
         bent%tn(i) = bent%ga(i)*bent%da(i) - to + bent%gb(i)*bent%db(i)
         bent%en(i) = bent%ga(i)*bent%ea(i) - eo + bent%gb(i)*bent%eb(i)
         bent%nn(i) = rod%m0(i) - bent%ga(i)*rod%a1(i) - bent%gb(i)*b1 - per*mnw - no
      end do

      ! Forces, and what depends on the rates: centrifugal and Coriolis terms of v and d, d'' without alpha'', beta''.
      !$omp simd
      do i = 1, width
         a = alpha(i)
         b = beta(i)
         u = alpha_rate(i)
         v = beta_rate(i)
         uu = u*u
         uv = (u + u)*v
         vv = v*v
         w = omega(i) + phi_rate(i)
         w1 = w + w
         w2 = w*w
         half_w2 = 0.5_wp*w2

         fa = rod%products(i, 1)*uu + rod%products(i, 2)*uv + rod%products(i, 4)*vv
         fb = rod%products(i, 2)*uu + rod%products(i, 3)*uv + rod%products(i, 5)*vv
         fc = rod%products(i, 4)*uu + rod%products(i, 5)*uv + rod%products(i, 6)*vv
         skew = w1*(rod%skew(i, 1)*a + rod%skew(i, 2)*b)
         qa = half_w2*bent%ca(i) - moment_in(i) - skew*v - a*fa - b*fb - rod%stiffness(i, 1)*(a + rod%carry_over(i, 1)*b)
         qb = half_w2*bent%cb(i) + moment_out(i) + skew*u - a*fb - b*fc - rod%stiffness(i, 3)*(rod%carry_over(i, 2)*a + b) - &
              bent%coupling(i)*qa
         bent%xa(i) = bent%inv_a(i)*qa
         bent%xb(i) = bent%inv_b(i)*qb
         r0 = moment_out(i) - moment_in(i) - w*(u*bent%ca(i) + v*bent%cb(i)) - &
              a*(rod%across_alpha(i, 1)*uu + rod%across_alpha(i, 2)*uv + rod%across_alpha(i, 3)*vv) - &
              b*(rod%across_beta(i, 1)*uu + rod%across_beta(i, 2)*uv + rod%across_beta(i, 3)*vv) - bent%ha(i)*qa - bent%hb(i)*qb
         re = -w2*bent%m1(i) - w1*(rod%a1(i)*u + rod%b1(i)*v) - rod%drawn(i, 1)*uu - rod%drawn(i, 2)*uv - rod%drawn(i, 3)*vv
         u = u + bent%coupling(i)*v ! L^T of the rates
         rn = -w2*bent%mv(i) - w1*(bent%ea(i)*u + bent%eb(i)*v)
         fall = w1*(bent%da(i)*u + bent%db(i)*v)
         bent%fall(i) = fall
         bent%pull(i) = w2*bent%chord(i) + rod%shortening(i, 1)*uu + rod%shortening(i, 2)*uv + rod%shortening(i, 3)*vv + &
                        bent%ya(i)*qa + bent%yb(i)*qb - bent%to(i)*fall
         bent%re(i) = re - bent%za(i)*qa - bent%zb(i)*qb + bent%eo(i)*fall
         r0 = bent%per_chord(i)*r0
         bent%ro(i) = bent%oo(i)*fall - r0
         bent%rn(i) = rn + bent%ga(i)*qa + bent%gb(i)*qb + bent%no(i)*fall + r0
      end do
   end subroutine bend_rods

   !> Rods with the chains beyond them, as their inner nodes feel them, in the axes of the rods further in (of the spacecraft), in
   !> all lanes. Derived in `rodyn_recursion_inextensible`. (In a module of its own so that it is not compiled into its caller:
   !> there the compiler keeps an address for each of its many arrays.)
   pure subroutine add_rods(rod, node_mass, sine, cosine, inner_sine, inner_cosine, chain, out, smallest)
      type(bent_rods), intent(in) :: rod
      real(wp), intent(in) :: node_mass(lanes) !! of the outer nodes [kg]
      real(wp), dimension(lanes), intent(in) :: sine, cosine, inner_sine, inner_cosine !! of phi, and of that of the rod further in
      type(lane_outboard_chain), intent(inout) :: chain
      type(lane_outward), intent(inout) :: out
      real(wp), intent(inout) :: smallest(lanes)
      real(wp) :: mu, pee, pen, pnn, det, be, bn, firm, yielding, tnn, ue, se, sn, d, inv, ce, cn, kk, ke, kn, ee, en, nn, f, &
                  at_rest, kept, r, outer, cd, sd, along, across
      integer :: i

      !$omp simd
      do i = 1, lanes
         ! `add_node`.
         mu = node_mass(i)
         det = chain%det(i) + mu*(chain%pee(i) + chain%pnn(i) + mu)
         pee = chain%pee(i) + mu
         pnn = chain%pnn(i) + mu
         pen = chain%pen(i)
         be = chain%be(i)
         bn = chain%bn(i)
         out%pee(i) = pee
         out%pen(i) = pen
         out%be(i) = be

         ! `add_rod`.
         firm = 1.0_wp + rod%mobility(i)*pee
         yielding = 1.0_wp/firm
         tnn = pnn + rod%mobility(i)*det
         ue = pee*rod%to(i) + pen
         d = rod%oo(i)*firm + tnn + rod%to(i)*(ue + pen)
         smallest(i) = min(smallest(i), d)
         inv = 1.0_wp/d
         se = rod%te(i)*ue
         sn = rod%tn(i)*ue
         ce = rod%eo(i)*firm + se
         cn = rod%no(i)*firm + sn

         ! P without o.
         kk = pee*rod%oo(i) + det
         ke = rod%te(i)*kk
         kn = rod%tn(i)*kk
         ee = rod%ee(i) + (rod%te(i)*ke - rod%eo(i)*(ce + se))*inv
         en = rod%en(i) + (rod%tn(i)*ke - rod%eo(i)*cn - se*rod%no(i))*inv
         nn = rod%nn(i) + (rod%tn(i)*kn - rod%no(i)*(cn + sn))*inv

         ! At rest.
         ce = ce*inv
         cn = cn*inv
         f = yielding*(be - pee*rod%pull(i))
         at_rest = rod%pull(i) + rod%mobility(i)*f
         r = bn + rod%ro(i) + rod%to(i)*f - pen*at_rest
         kept = yielding*(rod%to(i) - rod%mobility(i)*pen)
         outer = -firm*inv*r
         out%o_0(i) = outer
         out%o_e(i) = ce
         out%o_n(i) = cn
         out%along_0(i) = kept*outer - at_rest
         out%along_e(i) = yielding*rod%te(i) - kept*ce
         out%along_n(i) = yielding*rod%tn(i) - kept*cn
         be = rod%re(i) + rod%te(i)*f - ce*r
         bn = rod%rn(i) + rod%tn(i)*f - cn*r

         ! `turn_axes`, with b.
         cd = cosine(i)*inner_cosine(i) + sine(i)*inner_sine(i)
         sd = sine(i)*inner_cosine(i) - cosine(i)*inner_sine(i)
         out%cd(i) = cd
         out%sd(i) = sd
         chain%det(i) = ee*nn - en*en
         along = cd*ee - sd*en
         across = cd*en - sd*nn
         chain%pee(i) = cd*along - sd*across
         chain%pen(i) = sd*along + cd*across
         chain%pnn(i) = sd*(sd*ee + cd*en) + cd*(sd*en + cd*nn)
         chain%be(i) = cd*be - sd*bn
         chain%bn(i) = sd*be + cd*bn
      end do
   end subroutine add_rods

end module rodyn_inextensible_rods
