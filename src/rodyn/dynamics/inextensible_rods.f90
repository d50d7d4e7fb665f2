!> Rods whose arcs keep their length, each for itself: docs/model.md sec. 3, `inextensible`.
!>
!> What a bent rod is to its neighbours does not depend on them, so `lanes` rods are bent at once: several of one scene
!> (`rodyn_recursion_inextensible`), or the same one of several scenes (`rodyn_lane_recursion_inextensible`).
!> The same equations elsewhere: docs/model.md sec. 7.
module rodyn_inextensible_rods
   use rodyn_kinds, only: wp
   use rodyn_lanes, only: lanes
   use rodyn_lane_rods, only: lane_rod
   implicit none (type, external)
   private
   public :: bent_rods, bend_rods

   !> Rods at their slopes and rates, without alpha'', beta'', which are
   !>     (alpha'', beta'') = x + y f_e + z A_e - g A_n - h W'
   !> with the acceleration A of the inner node and the force f_e of the outer node on what is beyond it. Without f_e the rows of
   !> the forces on the inner node along and across the rod and of W', and the motion of the outer node, are
   !>     (fe, fn, M) = m (A_e, A_n, W') + (re, rn, -r0),
   !>     A_outer = ((t1, t2), (0, 1)) A + (j1, chord) W' - (pull, fall);
   !> f_e moves the outer node by -mobility f_e, and is (t1, t2, j1) f_e in the rows.
   type :: bent_rods
      real(wp), dimension(lanes) :: mee, men, mnn, mew, mnw, mww !! m
      real(wp), dimension(lanes) :: re, rn, r0
      real(wp), dimension(lanes) :: t1, t2, j1, chord, mobility, pull, fall
      real(wp), dimension(lanes) :: xa, xb, ya, yb, za, zb, ga, gb, ha, hb
   end type bent_rods

contains

   !> Bend rods. With the foreshortening d = x.D(s) x/2, x = (alpha, beta), the block of alpha'', beta'' is B + int m (D x)(D x)^T.
   pure subroutine bend_rods(width, rod, omega, phi_rate, alpha, beta, alpha_rate, beta_rate, moment_in, moment_out, bent)
      integer, intent(in) :: width !! how many of the lanes
      type(lane_rod), intent(in) :: rod
      real(wp), dimension(width), intent(in) :: omega !! w [rad/s]
      real(wp), dimension(width), intent(in) :: phi_rate, alpha, beta, alpha_rate, beta_rate
      real(wp), dimension(width), intent(in) :: moment_in, moment_out !! T of the hinges at both ends [N m]
      type(bent_rods), intent(inout) :: bent
      real(wp) :: a, b, u, v, uu, uv, vv, w1, w2, v11, v21, v31, v12, v22, v32, q11, q12, q22, z12, z21, skew, ta, tb, da, db, &
                  ea, eb, ca, cb, half_a, half_b, b11, b12, b22, inv, ya, yb, za, zb, ga, gb, ha, hb, drawn, mv, qa, qb
      integer :: i

      !$omp simd
      do i = 1, width
         a = alpha(i)
         b = beta(i)
         u = alpha_rate(i)
         v = beta_rate(i)
         uu = u*u
         uv = 2.0_wp*u*v
         vv = v*v
         w1 = omega(i) + phi_rate(i)
         w2 = w1*w1
         w1 = 2.0_wp*w1

         ! d' = x.D x' along the rod: int m (D x)(D x)^T.
         v11 = rod%products(i, 1)*a + rod%products(i, 2)*b
         v21 = rod%products(i, 2)*a + rod%products(i, 3)*b
         v31 = rod%products(i, 4)*a + rod%products(i, 5)*b
         v12 = rod%products(i, 2)*a + rod%products(i, 4)*b
         v22 = rod%products(i, 3)*a + rod%products(i, 5)*b
         v32 = rod%products(i, 5)*a + rod%products(i, 6)*b
         q11 = a*v11 + b*v21
         q12 = a*v12 + b*v22
         q22 = a*v22 + b*v32
         b11 = rod%aa(i) + q11
         b12 = rod%ab(i) + q12
         b22 = rod%bb(i) + q22
         inv = 1.0_wp/(b11*b22 - b12*b12)
         b11 = b11*inv
         b12 = b12*inv
         b22 = b22*inv ! the inverse is (b22, -b12, b11)

         ! v d' - d v' in the angular momentum.
         z12 = rod%across_alpha(i, 2)*a + rod%across_alpha(i, 3)*b
         z21 = rod%across_beta(i, 1)*a + rod%across_beta(i, 2)*b
         skew = z21 - z12
         ta = rod%sa(i) + 0.5_wp*(rod%across_alpha(i, 1)*a + rod%across_alpha(i, 2)*b)*a + (z21 - 0.5_wp*z12)*b
         tb = rod%sb(i) + (z12 - 0.5_wp*z21)*a + 0.5_wp*(rod%across_beta(i, 2)*a + rod%across_beta(i, 3)*b)*b

         ! Foreshortening of the chord and of the first moment, centrifugal and transverse terms.
         da = rod%shortening(i, 1)*a + rod%shortening(i, 2)*b
         db = rod%shortening(i, 2)*a + rod%shortening(i, 3)*b
         ea = rod%drawn(i, 1)*a + rod%drawn(i, 2)*b
         eb = rod%drawn(i, 2)*a + rod%drawn(i, 3)*b
         drawn = 0.5_wp*(a*ea + b*eb)
         half_a = 0.5_wp*(q11*a + q12*b)
         half_b = 0.5_wp*(q12*a + q22*b)
         ca = rod%second(i, 1)*a + rod%second(i, 2)*b + half_a
         cb = rod%second(i, 2)*a + rod%second(i, 3)*b + half_b
         mv = rod%a1(i)*a + rod%b1(i)*b

         ! Forces on alpha, beta.
         qa = w2*ca - w1*skew*v - (uu*v11 + uv*v21 + vv*v31) - moment_in(i) - &
              rod%stiffness(i, 1)*(a + rod%carry_over(i, 1)*b)
         qb = w2*cb + w1*skew*u - (uu*v12 + uv*v22 + vv*v32) + moment_out(i) - &
              rod%stiffness(i, 3)*(rod%carry_over(i, 2)*a + b)

         ! Without alpha'', beta''.
         ya = b22*da - b12*db
         yb = b11*db - b12*da
         za = b22*ea - b12*eb
         zb = b11*eb - b12*ea
         ga = b22*rod%a1(i) - b12*rod%b1(i)
         gb = b11*rod%b1(i) - b12*rod%a1(i)
         ha = b22*ta - b12*tb
         hb = b11*tb - b12*ta
         bent%mee(i) = rod%m0(i) - (ea*za + eb*zb)
         bent%men(i) = ea*ga + eb*gb
         bent%mnn(i) = rod%m0(i) - (rod%a1(i)*ga + rod%b1(i)*gb)
         bent%mew(i) = (ea*ha + eb*hb) - mv
         bent%mnw(i) = rod%m1(i) - drawn - (rod%a1(i)*ha + rod%b1(i)*hb)
         bent%mww(i) = rod%m2(i) + (a*(ca - 0.5_wp*half_a) + b*(cb - 0.5_wp*half_b)) - (ta*ha + tb*hb)
         bent%chord(i) = rod%length(i) - 0.5_wp*(a*da + b*db)
         bent%t1(i) = 1.0_wp - (da*za + db*zb)
         bent%t2(i) = da*ga + db*gb
         bent%j1(i) = da*ha + db*hb
         bent%mobility(i) = da*ya + db*yb
         bent%pull(i) = w2*bent%chord(i) + (rod%shortening(i, 1)*uu + rod%shortening(i, 2)*uv + rod%shortening(i, 3)*vv) + &
                        (ya*qa + yb*qb)
         bent%fall(i) = w1*(da*u + db*v)
         bent%r0(i) = moment_out(i) - moment_in(i) - (ha*qa + hb*qb) - w1*(u*ca + v*cb) - &
                      ((rod%across_alpha(i, 1)*uu + rod%across_alpha(i, 2)*uv + rod%across_alpha(i, 3)*vv)*a + &
                       (rod%across_beta(i, 1)*uu + rod%across_beta(i, 2)*uv + rod%across_beta(i, 3)*vv)*b)
         bent%re(i) = -w2*(rod%m1(i) - drawn) - w1*(rod%a1(i)*u + rod%b1(i)*v) - &
                      (rod%drawn(i, 1)*uu + rod%drawn(i, 2)*uv + rod%drawn(i, 3)*vv) - (za*qa + zb*qb)
         bent%rn(i) = (ga*qa + gb*qb) - w2*mv - w1*(ea*u + eb*v)
         bent%xa(i) = b22*qa - b12*qb
         bent%xb(i) = b11*qb - b12*qa
         bent%ya(i) = ya
         bent%yb(i) = yb
         bent%za(i) = za
         bent%zb(i) = zb
         bent%ga(i) = ga
         bent%gb(i) = gb
         bent%ha(i) = ha
         bent%hb(i) = hb
      end do
   end subroutine bend_rods

end module rodyn_inextensible_rods
