!> The recursion of `rodyn_recursion_condensed` in all lanes at once, for hinges none of which is locked and kinks that do not move:
!> same names, same order of steps. What a lane computes never depends on another one.
!> The same equations elsewhere: docs/model.md sec. 7.
module rodyn_lane_recursion_condensed
   use rodyn_kinds, only: wp
   use rodyn_lanes, only: lanes
   use rodyn_lane_scene, only: lane_condensed_rod
   use rodyn_outboard_chain, only: lane_outward_size
   implicit none (type, external)
   private
   public :: lane_condensed_accelerations, outboard_inertia, add_rod

   ! Places in `outward` (`rodyn_outboard_chain`).
   integer, parameter :: of_z0 = 1, of_ae = 2, of_an = 3, of_t = 4, of_y = 5, of_fall = 6, of_cosine = 7, of_sine = 8

   !> The chain as the node that carries it feels it: P and b of (A, t, x).
   type :: outboard_inertia
      real(wp), dimension(lanes) :: ee, en, nn, et, nt, tt, ex, nx, tx, xx, be, bn, bt, bx
   end type outboard_inertia

contains

   !> p' = (Vx', Vy', w', phi'') in every lane.
   subroutine lane_condensed_accelerations(n, n_base, rods, node_mass, mass, inertia, hinge_x, hinge_y, base_force, loaded, &
                                           node_force, sine, cosine, moment, moment_rate, force, p, outward, acceleration, ok)
      integer, intent(in) :: n, n_base           !! rods; 3 or 0 unknowns of the spacecraft
      type(lane_condensed_rod), intent(in) :: rods(n)
      real(wp), intent(in) :: node_mass(lanes, 0:n) !! mu [kg]
      real(wp), dimension(lanes), intent(in) :: mass, inertia, hinge_x, hinge_y !! of the spacecraft
      real(wp), intent(in) :: base_force(lanes, 3) !! X_C, Y_C, M_C, moving axes
      logical, intent(in) :: loaded              !! node_force is to be used
      real(wp), intent(in) :: node_force(lanes, 2, n) !! X, Y at nodes, moving axes [N]
      real(wp), dimension(lanes, 0:n), intent(in) :: sine, cosine !! of phi; 0 and 1 at k = 0
      real(wp), dimension(lanes, 0:n), intent(in) :: moment, moment_rate, force !! `lane_condensed_moments`
      real(wp), intent(in) :: p(lanes, n_base + n)          !! rates
      real(wp), intent(inout) :: outward(lanes, lane_outward_size, n) !! workspace
      real(wp), intent(out) :: acceleration(lanes, n_base + n) !! p'
      logical, intent(out) :: ok(lanes)          !! false: not finite, or M not positive definite
      type(outboard_inertia) :: chain
      integer :: i, k, ip
      real(wp), dimension(lanes) :: omega, omega_rate, ae, an, y, smallest

      ip = n_base
      omega = 0.0_wp
      if (n_base > 0) omega = p(:, 3)
      call inward_pass()
      call move_spacecraft()
      call outward_pass()
      ok = abs(an) <= huge(1.0_wp) .and. smallest > 0.0_wp ! finite; the intrinsic is not vectorised

   contains

      subroutine inward_pass()
         chain%ee = 0.0_wp
         chain%en = 0.0_wp
         chain%nn = 0.0_wp
         chain%et = 0.0_wp
         chain%nt = 0.0_wp
         chain%tt = 0.0_wp
         chain%ex = 0.0_wp
         chain%nx = 0.0_wp
         chain%tx = 0.0_wp
         chain%xx = 0.0_wp
         chain%be = 0.0_wp
         chain%bn = 0.0_wp
         chain%bt = 0.0_wp
         chain%bx = 0.0_wp
         smallest = huge(1.0_wp)
         do k = n, 1, -1
            if (loaded) call load_node()
            call add_rod(rods(k), node_mass(:, k), omega, p(:, ip + k), moment(:, k - 1:k), moment_rate(:, k - 1:k), force(:, k), &
                         sine(:, k - 1:k), cosine(:, k - 1:k), chain, outward(:, :, k), smallest)
         end do
      end subroutine inward_pass

      !> Force on node k.
      subroutine load_node()
         !$omp simd
         do i = 1, lanes
            chain%be(i) = chain%be(i) - (node_force(i, 1, k)*cosine(i, k) + node_force(i, 2, k)*sine(i, k))
            chain%bn(i) = chain%bn(i) - (node_force(i, 2, k)*cosine(i, k) - node_force(i, 1, k)*sine(i, k))
         end do
      end subroutine load_node

      !> x_0, and the spacecraft under its loads and the chain.
      subroutine move_spacecraft()
         real(wp) :: inv, x0, ex, nx, tx, p11, p12, p22, p13, p23, p33, b1, b2, b3, x, y0, w2
         real(wp) :: m11, m22, m13, m23, m33, det, fx, fy, turn, gx, gy, w_rate, cx, cy, vx, vy

         !$omp simd
         do i = 1, lanes
            smallest(i) = min(smallest(i), chain%xx(i))
            inv = 1.0_wp/chain%xx(i)
            x0 = -(chain%bx(i) + force(i, 0))*inv
            ex = chain%ex(i)*inv
            nx = chain%nx(i)*inv
            tx = chain%tx(i)*inv
            y(i) = x0 ! of a fixed spacecraft
            ae(i) = 0.0_wp
            an(i) = 0.0_wp
            omega_rate(i) = 0.0_wp
            if (n_base > 0) then
               b1 = chain%be(i) + chain%ex(i)*x0
               b2 = chain%bn(i) + chain%nx(i)*x0
               b3 = chain%bt(i) + chain%tx(i)*x0
               p11 = node_mass(i, 0) + chain%ee(i) - chain%ex(i)*ex
               p12 = chain%en(i) - chain%ex(i)*nx
               p22 = node_mass(i, 0) + chain%nn(i) - chain%nx(i)*nx
               p13 = chain%et(i) - chain%ex(i)*tx
               p23 = chain%nt(i) - chain%nx(i)*tx
               p33 = chain%tt(i) - chain%tx(i)*tx
               x = hinge_x(i)
               y0 = hinge_y(i)
               w2 = omega(i)*omega(i)
               m11 = mass(i) + p11
               m22 = mass(i) + p22
               m13 = p13 + (p12*x - p11*y0)
               m23 = p23 + (p22*x - p12*y0)
               m33 = inertia(i) + p33 + (p23 + m23)*x - (p13 + m13)*y0
               fx = b1 - w2*(p11*x + p12*y0)
               fy = b2 - w2*(p12*x + p22*y0)
               turn = b3 - w2*(p13*x + p23*y0) + (x*fy - y0*fx)
               fx = base_force(i, 1) - fx
               fy = base_force(i, 2) - fy
               det = m11*m22 - p12*p12
               inv = 1.0_wp/det
               gx = (m22*m13 - p12*m23)*inv
               gy = (m11*m23 - p12*m13)*inv
               m33 = m33 - gx*m13 - gy*m23
               smallest(i) = min(smallest(i), m11, det, m33)
               w_rate = ((base_force(i, 3) - turn) - gx*fx - gy*fy)/m33
               cx = (m22*fx - p12*fy)*inv - gx*w_rate
               cy = (m11*fy - p12*fx)*inv - gy*w_rate
               vx = p(i, 1)
               vy = p(i, 2)
               acceleration(i, 1) = cx + omega(i)*vy
               acceleration(i, 2) = cy - omega(i)*vx
               acceleration(i, 3) = w_rate
               omega_rate(i) = w_rate
               ae(i) = cx - y0*w_rate - x*w2
               an(i) = cy + x*w_rate - y0*w2
               y(i) = x0 - (ex*ae(i) + nx*an(i) + tx*w_rate)
            end if
         end do
      end subroutine move_spacecraft

      !> phi'' from the motion of the spacecraft.
      subroutine outward_pass()
         real(wp) :: along, across, z, turn
         real(wp) :: t(lanes)

         t = omega_rate
         do k = 1, n
            associate (r => rods(k))
               !$omp simd
               do i = 1, lanes
                  along = outward(i, of_cosine, k)*ae(i) + outward(i, of_sine, k)*an(i)
                  across = outward(i, of_cosine, k)*an(i) - outward(i, of_sine, k)*ae(i)
                  z = (outward(i, of_z0, k) - (outward(i, of_t, k)*t(i) + outward(i, of_y, k)*y(i))) - &
                      (outward(i, of_ae, k)*along + outward(i, of_an, k)*across)
                  turn = t(i) + r%turn_y(i)*y(i) + r%turn_z(i)*z
                  acceleration(i, ip + k) = turn - omega_rate(i)
                  ae(i) = along - outward(i, of_fall, k)
                  an(i) = across + r%length(i)*turn
                  t(i) = t(i) + r%out_y(i)*y(i) + r%out_z(i)*z
                  y(i) = z
               end do
            end associate
         end do
      end subroutine outward_pass

   end subroutine lane_condensed_accelerations

   !> A rod with the chain beyond it: what is outboard of its inner node, in the axes of the rod further in (of the spacecraft).
   !> (Public, so that it is not compiled into the loop over rods: there the compiler keeps an address for each of its arrays.)
   pure subroutine add_rod(r, node_mass, omega, phi_rate, moment, moment_rate, force, sine, cosine, chain, outward, smallest)
      type(lane_condensed_rod), intent(in) :: r
      real(wp), dimension(lanes), intent(in) :: node_mass, omega, phi_rate, force !! of the outer node, w, phi', of the outer hinge
      real(wp), dimension(lanes, 0:1), intent(in) :: moment, moment_rate !! of the hinges at both ends
      real(wp), dimension(lanes, 0:1), intent(in) :: sine, cosine !! of phi of the rod further in, and of this one
      type(outboard_inertia), intent(inout) :: chain
      real(wp), intent(inout) :: outward(lanes, lane_outward_size), smallest(lanes)
      real(wp) :: w, w2, fall, alpha, beta, alpha_rate, beta_rate, mv, mvv, curved_a, curved_b, pull_a, pull_b, mu
      real(wp) :: turn, on_y, on_z, ew, nw, ww, wt, wx, et, ey, ez, nt, ny, nz, ay, ty, az, tz, zz, inv
      real(wp) :: tau_t, tau_y, tau_z, y_y, y_z, z0, by_e, by_n, by_t, by_y, be, bn, bt, bx
      real(wp) :: pee, pen, pnn, pet, pnt, ptt, pex, pnx, ptx, pxx, ee, en, nn, cd, sd
      integer :: i

      !$omp simd
      do i = 1, lanes
         mu = node_mass(i)
         pee = chain%ee(i) + mu
         pen = chain%en(i)
         pnn = chain%nn(i) + mu
         pet = chain%et(i)
         pnt = chain%nt(i)
         ptt = chain%tt(i)
         pex = chain%ex(i)
         pnx = chain%nx(i)
         ptx = chain%tx(i)
         pxx = chain%xx(i)
         w = omega(i) + phi_rate(i)
         w2 = w*w
         fall = r%length(i)*w2
         alpha = -(r%flexibility(i, 1)*moment(i, 0) + r%flexibility(i, 2)*moment(i, 1))
         beta = r%flexibility(i, 2)*moment(i, 0) + r%flexibility(i, 3)*moment(i, 1)
         alpha_rate = -(r%flexibility(i, 1)*moment_rate(i, 0) + r%flexibility(i, 2)*moment_rate(i, 1))
         beta_rate = r%flexibility(i, 2)*moment_rate(i, 0) + r%flexibility(i, 3)*moment_rate(i, 1)
         mv = r%first(i, 1)*alpha + r%first(i, 2)*beta
         curved_a = r%second(i, 1)*alpha + r%second(i, 2)*beta
         curved_b = r%second(i, 2)*alpha + r%second(i, 3)*beta
         mvv = alpha*curved_a + beta*curved_b
         pull_a = -w2*(r%inertia(i, 1)*alpha + r%inertia(i, 2)*beta)
         pull_b = -w2*(r%inertia(i, 2)*alpha + r%inertia(i, 3)*beta)

         ! Bias: forces at rest of A, t, y, z.
         be = chain%be(i) - fall*pee
         bn = chain%bn(i) - fall*pen
         bt = chain%bt(i) - fall*pet
         bx = chain%bx(i) - fall*pex
         turn = 2.0_wp*w*(alpha_rate*curved_a + beta_rate*curved_b) + r%length(i)*bn
         on_y = r%turn_y(i)*turn + r%out_y(i)*bt + (r%bend_y(i, 1)*pull_a + r%bend_y(i, 2)*pull_b)
         on_z = r%turn_z(i)*turn + r%out_z(i)*bt + (r%bend_z(i, 1)*pull_a + r%bend_z(i, 2)*pull_b) + (bx + force(i))
         bt = bt + turn
         be = be - w2*r%m1(i) - 2.0_wp*w*(r%first(i, 1)*alpha_rate + r%first(i, 2)*beta_rate)
         bn = bn - w2*mv

         ! Inertia: rows of W' and t_out of the chain, spread over t, y, z.
         ew = r%length(i)*pen - mv
         nw = r%length(i)*pnn
         ww = mvv + r%length(i)*nw
         wt = r%length(i)*pnt
         wx = r%length(i)*pnx
         et = ew + pet
         ey = ew*r%turn_y(i) + pet*r%out_y(i)
         ez = ew*r%turn_z(i) + pet*r%out_z(i) + pex
         nt = r%m1(i) + nw + pnt
         ny = r%across_y(i) + nw*r%turn_y(i) + pnt*r%out_y(i)
         nz = r%across_z(i) + nw*r%turn_z(i) + pnt*r%out_z(i) + pnx
         ay = ww*r%turn_y(i) + wt*r%out_y(i)
         ty = wt*r%turn_y(i) + ptt*r%out_y(i)
         az = ww*r%turn_z(i) + wt*r%out_z(i) + wx
         tz = wt*r%turn_z(i) + ptt*r%out_z(i) + ptx
         tau_t = r%tt(i) + (ww + wt) + (wt + ptt)
         tau_y = r%ty(i) + ay + ty
         tau_z = r%tz(i) + az + tz
         y_y = r%yy(i) + ay*r%turn_y(i) + ty*r%out_y(i)
         y_z = r%yz(i) + az*r%turn_y(i) + tz*r%out_y(i)
         zz = r%zz(i) + (az + wx)*r%turn_z(i) + (tz + ptx)*r%out_z(i) + pxx

         ! Without z.
         smallest(i) = min(smallest(i), zz)
         inv = 1.0_wp/zz
         z0 = -on_z*inv
         by_e = ez*inv
         by_n = nz*inv
         by_t = tau_z*inv
         by_y = y_z*inv
         be = be + ez*z0
         bn = bn + nz*z0
         chain%bt(i) = bt + tau_z*z0
         chain%bx(i) = on_y + y_z*z0
         ee = r%m0(i) + pee - ez*by_e
         en = pen - ez*by_n
         nn = r%m0(i) + pnn - nz*by_n
         pet = et - ez*by_t
         pnt = nt - nz*by_t
         chain%tt(i) = tau_t - tau_z*by_t
         pex = ey - ez*by_y
         pnx = ny - nz*by_y
         chain%tx(i) = tau_y - tau_z*by_y
         chain%xx(i) = y_y - y_z*by_y
         cd = cosine(i, 1)*cosine(i, 0) + sine(i, 1)*sine(i, 0)
         sd = sine(i, 1)*cosine(i, 0) - cosine(i, 1)*sine(i, 0)
         outward(i, of_z0) = z0
         outward(i, of_ae) = by_e
         outward(i, of_an) = by_n
         outward(i, of_t) = by_t
         outward(i, of_y) = by_y
         outward(i, of_fall) = fall
         outward(i, of_cosine) = cd
         outward(i, of_sine) = sd

         ! `turn_axes`.
         chain%ee(i) = cd*cd*ee + sd*(sd*nn - 2.0_wp*cd*en)
         chain%nn(i) = cd*cd*nn + sd*(sd*ee + 2.0_wp*cd*en)
         chain%en(i) = cd*sd*(ee - nn) + (cd - sd)*(cd + sd)*en
         chain%et(i) = cd*pet - sd*pnt
         chain%nt(i) = sd*pet + cd*pnt
         chain%ex(i) = cd*pex - sd*pnx
         chain%nx(i) = sd*pex + cd*pnx
         chain%be(i) = cd*be - sd*bn
         chain%bn(i) = sd*be + cd*bn
      end do
   end subroutine add_rod

end module rodyn_lane_recursion_condensed
