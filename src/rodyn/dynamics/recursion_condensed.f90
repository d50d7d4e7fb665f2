!> Accelerations in O(n) of rods with mass that bend by statics (condensed rods), docs/model.md sec. 5.
!>
!> The rotations th_k of the joints determine all openings: the springs' moments m_k = C_k th_k bend the two rods beside hinge k
!> and no others. So with x_k = th_k'' (of a locked hinge x_k = m_k'') as unknowns everything is local: with c = C, d = 1 (locked:
!> c = 1, d = 0) and m_k'' = c_k x_k, rod k between y = x_{k-1} and z = x_k has
!>     alpha'' = -(f11 c y + f12 c z),   beta'' = f12 c y + f22 c z,   W' = t + d y - alpha'',   t_out = W' + beta'',
!> t being the angular acceleration of the end tangent inside hinge k-1 and t_out that of its own outer end; gamma'' adds to t.
!> The chain beyond node k acts on it by an apparent inertia P (4x4, symmetric) and a bias b,
!>     (f, moment, force on x_k) = P (A, t_out, x_k) + b.
!> From the tip inward rod k is added in (A, t, y, z), and z eliminated: one division a rod. In these unknowns springs are local,
!> too: the force on th_k is C (opening - gamma) + t0 + D th' + f, on a locked m_k opening - gamma - th.
!> In vector lanes: `rodyn_lane_recursion_condensed`. The same equations elsewhere: docs/model.md sec. 7.
module rodyn_recursion_condensed
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use rodyn_kinds, only: wp
   use rodyn_scene, only: scene_type
   use rodyn_hinge_law, only: hinge_law
   use rodyn_spacecraft, only: spacecraft_body
   implicit none (type, external)
   private
   public :: condensed_recursion, new_condensed_recursion, condensed_accelerations, condensed_rod, prepare_rod

   !> Constants of rod k between its hinges.
   type :: condensed_rod
      real(wp) :: length, m0, m1
      real(wp) :: flexibility(3)   !! f11, f12, f22
      real(wp) :: first(2), inertia(3), second(3) !! int m N; int m N N^T, and what of it is of second order
      real(wp) :: bend_y(2), bend_z(2) !! alpha'', beta'' by y and z
      real(wp) :: turn_y, turn_z   !! W' by y and z, beside t
      real(wp) :: out_y, out_z     !! t_out by y and z
      real(wp) :: across_y, across_z !! force across the rod by y and z
      real(wp) :: tt, ty, tz, yy, yz, zz !! inertia of t, y, z of the straight rod
   end type condensed_rod

   !> Constants of hinge k.
   type :: condensed_hinge
      real(wp) :: factor   !! c
      real(wp) :: damping  !! D; 0 if locked
      real(wp) :: constant !! t0 + f; 0 if locked
      real(wp) :: held     !! th of a locked hinge, else 0 [rad]
      real(wp) :: shift    !! opening of the three-moment equation that is constant [rad]
      real(wp) :: steady   !! t0 of hinges that are not locked [N m]
   end type condensed_hinge

   !> What the inward pass leaves for the outward pass: z = z0 - (ae, an, t, y) . (Ae, An, t, y).
   type :: condensed_pass
      real(wp) :: cd, sd, fall
      real(wp) :: z0, ae, an, t, y
   end type condensed_pass

   !> Constants and memory. One per thread.
   type :: condensed_recursion
      type(condensed_rod), allocatable :: rods(:)     !! (n)
      type(condensed_hinge), allocatable :: hinges(:) !! (0:n-1)
      type(condensed_pass), allocatable :: pass(:)    !! (n)
      real(wp), allocatable :: moment(:), moment_rate(:) !! of the springs, and th and th' before (0:n)
      real(wp), allocatable :: force(:)               !! on x_k, from springs and dampers (0:n)
   end type condensed_recursion

contains

   !> Gather the constants of a scene whose hinges have these laws now.
   subroutine new_condensed_recursion(recursion, scene, hinges)
      type(condensed_recursion), intent(out) :: recursion
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      integer :: k

      associate (n => scene%n)
         allocate (recursion%rods(n), recursion%hinges(0:n - 1), recursion%pass(n))
         allocate (recursion%moment(0:n), recursion%moment_rate(0:n), recursion%force(0:n), source=0.0_wp)
      end associate
      do k = 0, scene%n - 1
         associate (hinge => recursion%hinges(k), locked => hinges%locked(k))
            hinge%factor = merge(1.0_wp, hinges%stiffness(k), locked)
            hinge%damping = merge(0.0_wp, hinges%damping(k), locked)
            hinge%constant = merge(0.0_wp, hinges%constant(k) + hinges%friction(k), locked)
            hinge%held = 0.0_wp
            hinge%steady = hinges%steady(k)
         end associate
      end do
      do k = 1, size(hinges%held)
         recursion%hinges(hinges%held(k))%held = hinges%held_at(k)
      end do
      recursion%hinges%shift = recursion%hinges%held + hinges%bent
      do k = 1, scene%n
         call prepare_rod(scene, hinges%locked, recursion%hinges%factor, k, recursion%rods(k))
      end do
   end subroutine new_condensed_recursion

   !> Constants of a rod.
   pure subroutine prepare_rod(scene, locked, factor, k, rod)
      type(scene_type), intent(in) :: scene
      logical, intent(in) :: locked(0:)    !! (0:n-1)
      real(wp), intent(in) :: factor(0:)   !! c (0:n-1)
      integer, intent(in) :: k
      type(condensed_rod), intent(out) :: rod
      real(wp) :: outer

      outer = 0.0_wp
      if (k < scene%n) outer = factor(k)
      associate (given => scene%rods(scene%rod_of(k)), f => scene%rods(scene%rod_of(k))%flexibility, &
                 i => scene%rods(scene%rod_of(k))%inertia)
         rod%length = given%length
         rod%m0 = i%m0
         rod%m1 = i%m1
         rod%flexibility = f
         rod%first = [i%a1, i%b1]
         rod%inertia = [i%aa, i%ab, i%bb]
         rod%second = given%second
         rod%bend_y = factor(k - 1)*[-f(1), f(2)]
         rod%bend_z = outer*[-f(2), f(3)]
         rod%turn_y = merge(0.0_wp, 1.0_wp, locked(k - 1)) - rod%bend_y(1)
         rod%turn_z = -rod%bend_z(1)
         rod%out_y = rod%turn_y + rod%bend_y(2)
         rod%out_z = rod%turn_z + rod%bend_z(2)
         rod%across_y = i%m1*rod%turn_y + dot_product(rod%first, rod%bend_y)
         rod%across_z = i%m1*rod%turn_z + dot_product(rod%first, rod%bend_z)
         rod%tt = i%m2
         rod%ty = inertia_of([1.0_wp, 0.0_wp, 0.0_wp], [rod%turn_y, rod%bend_y])
         rod%tz = inertia_of([1.0_wp, 0.0_wp, 0.0_wp], [rod%turn_z, rod%bend_z])
         rod%yy = inertia_of([rod%turn_y, rod%bend_y], [rod%turn_y, rod%bend_y])
         rod%yz = inertia_of([rod%turn_y, rod%bend_y], [rod%turn_z, rod%bend_z])
         rod%zz = inertia_of([rod%turn_z, rod%bend_z], [rod%turn_z, rod%bend_z])
         if (k == scene%n) rod%zz = 1.0_wp ! there is no hinge, and z is zero
      end associate

   contains

      !> Inertia of two motions (W', alpha'', beta'').
      pure real(wp) function inertia_of(a, b)
         real(wp), intent(in) :: a(3), b(3)
         associate (i => scene%rods(scene%rod_of(k))%inertia)
            inertia_of = a(1)*(i%m2*b(1) + i%sa*b(2) + i%sb*b(3)) + a(2)*(i%sa*b(1) + i%aa*b(2) + i%ab*b(3)) + &
                         a(3)*(i%sb*b(1) + i%ab*b(2) + i%bb*b(3))
         end associate
      end function inertia_of

   end subroutine prepare_rod

   !> p' = (Vx', Vy', w', phi'') for given q, p and loads. Allocates nothing.
   subroutine condensed_accelerations(recursion, scene, hinges, sine, cosine, q, p, base_force, loaded, node_force, &
                                      acceleration, ok)
      type(condensed_recursion), intent(inout) :: recursion
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges          !! laws for which the recursion was made, kinks as they are now
      real(wp), intent(in) :: sine(0:scene%n), cosine(0:scene%n) !! of phi; 0 and 1 at 0
      real(wp), intent(in) :: q(scene%n_dof), p(scene%n_dof) !! coordinates and rates
      real(wp), intent(in) :: base_force(3)          !! X_C, Y_C, M_C, moving axes
      logical, intent(in) :: loaded                  !! node_force is to be used
      real(wp), intent(in) :: node_force(2, *)       !! X, Y at nodes (n), moving axes [N]
      real(wp), intent(out) :: acceleration(scene%n_dof) !! p'
      logical, intent(out) :: ok                     !! false: not finite, or M not positive definite
      real(wp) :: inertia(3, 3), bias(3), node(3), at_hinge_0(4), omega, smallest

      omega = 0.0_wp
      if (scene%n_base > 0) omega = p(3)
      call bend_chain(scene%n, recursion%hinges, hinges%series%lower, hinges%series%pivot, hinges%series%upper, hinges%kink, &
                      hinges%kink_rate, q(scene%n_base + 1), p(scene%n_base + 1), recursion%moment, recursion%moment_rate, &
                      recursion%force)
      call inward_pass(scene%n, recursion%rods, scene%node_mass, sine, cosine, p(scene%n_base + 1), omega, recursion%moment, &
                       recursion%moment_rate, recursion%force, hinges%driven, hinges%kink_acceleration, loaded, node_force, &
                       recursion%pass, inertia, bias, at_hinge_0, smallest)
      node = 0.0_wp
      if (scene%n_base > 0) call move_spacecraft(scene%body, p, inertia, bias, base_force, acceleration, node, smallest)
      call outward_pass(scene%n, recursion%rods, recursion%pass, hinges%driven, hinges%kink_acceleration, at_hinge_0, node, &
                        acceleration(scene%n_base + 1))
      ok = smallest > 0.0_wp .and. ieee_is_finite(node(2))
   end subroutine condensed_accelerations

   !> The three-moment equation for rotations and rates at once: moments of the springs, their rates, and the forces on x_k.
   pure subroutine bend_chain(n, hinges, lower, pivot, upper, kink, kink_rate, phi, phi_rate, moment, moment_rate, force)
      integer, intent(in) :: n
      type(condensed_hinge), intent(in) :: hinges(0:n - 1)
      real(wp), intent(in) :: lower(n - 1), pivot(0:n - 1), upper(0:n - 2) !! `rodyn_three_moments`
      real(wp), intent(in) :: kink(0:n - 1), kink_rate(0:n - 1)
      real(wp), intent(in) :: phi(n), phi_rate(n)
      real(wp), intent(inout) :: moment(0:n), moment_rate(0:n), force(0:n) !! zero at n
      real(wp) :: opening, rate, theta, theta_rate
      integer :: k

      opening = phi(1) - kink(0)
      rate = phi_rate(1) - kink_rate(0)
      theta = opening - hinges(0)%shift
      theta_rate = rate
      moment(0) = theta
      moment_rate(0) = theta_rate
      force(0) = hinges(0)%factor*(opening - hinges(0)%held) + hinges(0)%constant
      do k = 1, n - 1
         opening = (phi(k + 1) - phi(k)) - kink(k)
         rate = (phi_rate(k + 1) - phi_rate(k)) - kink_rate(k)
         theta = (opening - hinges(k)%shift) - lower(k)*theta
         theta_rate = rate - lower(k)*theta_rate
         moment(k) = theta
         moment_rate(k) = theta_rate
         force(k) = hinges(k)%factor*(opening - hinges(k)%held) + hinges(k)%constant
      end do
      theta = 0.0_wp
      theta_rate = 0.0_wp
      do k = n - 1, 0, -1
         if (k < n - 1) then
            theta = moment(k) - upper(k)*theta
            theta_rate = moment_rate(k) - upper(k)*theta_rate
         else
            theta = moment(k)
            theta_rate = moment_rate(k)
         end if
         theta = theta*pivot(k)
         theta_rate = theta_rate*pivot(k)
         moment(k) = hinges(k)%factor*theta + hinges(k)%steady
         moment_rate(k) = hinges(k)%factor*theta_rate
         force(k) = force(k) + hinges(k)%damping*theta_rate
      end do
   end subroutine bend_chain

   !> The chain as the spacecraft feels it, moving axes, and what the outward pass needs of each rod.
   subroutine inward_pass(n, rods, node_mass, sine, cosine, phi_rate, omega, moment, moment_rate, force, driven, &
                          kink_acceleration, loaded, node_force, pass, inertia, bias, at_hinge_0, smallest)
      integer, intent(in) :: n
      type(condensed_rod), intent(in) :: rods(n)
      real(wp), intent(in) :: node_mass(0:n), sine(0:n), cosine(0:n)
      real(wp), intent(in) :: phi_rate(n)
      real(wp), intent(in) :: omega                    !! w [rad/s]
      real(wp), intent(in) :: moment(0:n), moment_rate(0:n), force(0:n)
      logical, intent(in) :: driven
      real(wp), intent(in) :: kink_acceleration(0:n - 1) !! used if driven
      logical, intent(in) :: loaded
      real(wp), intent(in) :: node_force(2, *)
      type(condensed_pass), intent(out) :: pass(n)
      real(wp), intent(out) :: inertia(3, 3), bias(3)  !! P, b of (A, w') at hinge 0
      real(wp), intent(out) :: at_hinge_0(4)           !! x_0 = (1) - (2:4) . (A, w')
      real(wp), intent(out) :: smallest                !! pivot
      real(wp) :: pee, pen, pnn, pet, pnt, ptt, pex, pnx, ptx, pxx, be, bn, bt, bx
      real(wp) :: cd, sd
      integer :: k

      pee = 0.0_wp
      pen = 0.0_wp
      pnn = 0.0_wp
      pet = 0.0_wp
      pnt = 0.0_wp
      ptt = 0.0_wp
      pex = 0.0_wp
      pnx = 0.0_wp
      ptx = 0.0_wp
      pxx = 0.0_wp
      be = 0.0_wp
      bn = 0.0_wp
      bt = 0.0_wp
      bx = 0.0_wp
      smallest = huge(1.0_wp)
      do k = n, 1, -1
         pee = pee + node_mass(k)
         pnn = pnn + node_mass(k)
         if (loaded) then
            be = be - (node_force(1, k)*cosine(k) + node_force(2, k)*sine(k))
            bn = bn - (node_force(2, k)*cosine(k) - node_force(1, k)*sine(k))
         end if
         call add_rod()
         if (driven) then
            be = be + pet*kink_acceleration(k - 1)
            bn = bn + pnt*kink_acceleration(k - 1)
            bt = bt + ptt*kink_acceleration(k - 1)
            bx = bx + ptx*kink_acceleration(k - 1)
         end if
         cd = cosine(k)*cosine(k - 1) + sine(k)*sine(k - 1)
         sd = sine(k)*cosine(k - 1) - cosine(k)*sine(k - 1)
         pass(k)%cd = cd
         pass(k)%sd = sd
         call turn_axes()
      end do
      call close_chain()

   contains

      !> Rod k with the chain beyond it, without z.
      subroutine add_rod()
         real(wp) :: w, w2, fall, alpha, beta, alpha_rate, beta_rate, mv, mvv, curved_a, curved_b, pull_a, pull_b
         real(wp) :: turn, on_y, on_z, ew, nw, ww, wt, wx, et, ey, ez, nt, ny, nz, ay, ty, az, tz, zz, inv
         real(wp) :: tau_t, tau_y, tau_z, y_y, y_z, z0, by_e, by_n, by_t, by_y

         associate (r => rods(k))
            w = omega + phi_rate(k)
            w2 = w*w
            fall = r%length*w2
            alpha = -(r%flexibility(1)*moment(k - 1) + r%flexibility(2)*moment(k))
            beta = r%flexibility(2)*moment(k - 1) + r%flexibility(3)*moment(k)
            alpha_rate = -(r%flexibility(1)*moment_rate(k - 1) + r%flexibility(2)*moment_rate(k))
            beta_rate = r%flexibility(2)*moment_rate(k - 1) + r%flexibility(3)*moment_rate(k)
            mv = r%first(1)*alpha + r%first(2)*beta
            curved_a = r%second(1)*alpha + r%second(2)*beta
            curved_b = r%second(2)*alpha + r%second(3)*beta
            mvv = alpha*curved_a + beta*curved_b
            pull_a = -w2*(r%inertia(1)*alpha + r%inertia(2)*beta)
            pull_b = -w2*(r%inertia(2)*alpha + r%inertia(3)*beta)

            ! Bias: forces at rest of A, t, y, z.
            be = be - fall*pee
            bn = bn - fall*pen
            bt = bt - fall*pet
            bx = bx - fall*pex
            turn = 2.0_wp*w*(alpha_rate*curved_a + beta_rate*curved_b) + r%length*bn
            on_y = r%turn_y*turn + r%out_y*bt + (r%bend_y(1)*pull_a + r%bend_y(2)*pull_b)
            on_z = r%turn_z*turn + r%out_z*bt + (r%bend_z(1)*pull_a + r%bend_z(2)*pull_b) + (bx + force(k))
            bt = bt + turn
            be = be - w2*r%m1 - 2.0_wp*w*(r%first(1)*alpha_rate + r%first(2)*beta_rate)
            bn = bn - w2*mv

            ! Inertia: rows of W' and t_out of the chain, spread over t, y, z.
            ew = r%length*pen - mv
            nw = r%length*pnn
            ww = mvv + r%length*nw
            wt = r%length*pnt
            wx = r%length*pnx
            et = ew + pet
            ey = ew*r%turn_y + pet*r%out_y
            ez = ew*r%turn_z + pet*r%out_z + pex
            nt = r%m1 + nw + pnt
            ny = r%across_y + nw*r%turn_y + pnt*r%out_y
            nz = r%across_z + nw*r%turn_z + pnt*r%out_z + pnx
            ay = ww*r%turn_y + wt*r%out_y
            ty = wt*r%turn_y + ptt*r%out_y
            az = ww*r%turn_z + wt*r%out_z + wx
            tz = wt*r%turn_z + ptt*r%out_z + ptx
            tau_t = r%tt + (ww + wt) + (wt + ptt)
            tau_y = r%ty + ay + ty
            tau_z = r%tz + az + tz
            y_y = r%yy + ay*r%turn_y + ty*r%out_y
            y_z = r%yz + az*r%turn_y + tz*r%out_y
            zz = r%zz + (az + wx)*r%turn_z + (tz + ptx)*r%out_z + pxx

            ! Without z.
            smallest = min(smallest, zz)
            inv = 1.0_wp/zz
            z0 = -on_z*inv
            by_e = ez*inv
            by_n = nz*inv
            by_t = tau_z*inv
            by_y = y_z*inv
            be = be + ez*z0
            bn = bn + nz*z0
            bt = bt + tau_z*z0
            bx = on_y + y_z*z0
            pee = r%m0 + pee - ez*by_e
            pen = pen - ez*by_n
            pnn = r%m0 + pnn - nz*by_n
            pet = et - ez*by_t
            pnt = nt - nz*by_t
            ptt = tau_t - tau_z*by_t
            pex = ey - ez*by_y
            pnx = ny - nz*by_y
            ptx = tau_y - tau_z*by_y
            pxx = y_y - y_z*by_y
            pass(k)%fall = fall
            pass(k)%z0 = z0
            pass(k)%ae = by_e
            pass(k)%an = by_n
            pass(k)%t = by_t
            pass(k)%y = by_y
         end associate
      end subroutine add_rod

      !> From the axes of rod k to those of rod k - 1.
      subroutine turn_axes()
         real(wp) :: ee, en, nn, et, ex, r

         ee = pee
         en = pen
         nn = pnn
         pee = cd*cd*ee + sd*(sd*nn - 2.0_wp*cd*en)
         pnn = cd*cd*nn + sd*(sd*ee + 2.0_wp*cd*en)
         pen = cd*sd*(ee - nn) + (cd - sd)*(cd + sd)*en
         et = cd*pet - sd*pnt
         pnt = sd*pet + cd*pnt
         pet = et
         ex = cd*pex - sd*pnx
         pnx = sd*pex + cd*pnx
         pex = ex
         r = cd*be - sd*bn
         bn = sd*be + cd*bn
         be = r
      end subroutine turn_axes

      !> Without x_0.
      subroutine close_chain()
         real(wp) :: inv, x0

         smallest = min(smallest, pxx)
         inv = 1.0_wp/pxx
         x0 = -(bx + force(0))*inv
         at_hinge_0 = [x0, pex*inv, pnx*inv, ptx*inv]
         bias = [be + pex*x0, bn + pnx*x0, bt + ptx*x0]
         inertia(1, 1) = node_mass(0) + pee - pex*at_hinge_0(2)
         inertia(2, 1) = pen - pex*at_hinge_0(3)
         inertia(3, 1) = pet - pex*at_hinge_0(4)
         inertia(2, 2) = node_mass(0) + pnn - pnx*at_hinge_0(3)
         inertia(3, 2) = pnt - pnx*at_hinge_0(4)
         inertia(3, 3) = ptt - ptx*at_hinge_0(4)
         inertia(1, 2) = inertia(2, 1)
         inertia(1, 3) = inertia(3, 1)
         inertia(2, 3) = inertia(3, 2)
      end subroutine close_chain

   end subroutine inward_pass

   !> The spacecraft under its loads and the chain. With r = (x0, y0), rr = (-y0, x0), hinge 0 accelerates by
   !> A_C + rr w' - r w^2, A_C = (Vx' - w Vy, Vy' + w Vx).
   pure subroutine move_spacecraft(body, p, inertia, bias, force, acceleration, node, smallest)
      type(spacecraft_body), intent(in) :: body
      real(wp), intent(in) :: p(3)                   !! Vx, Vy, w
      real(wp), intent(in) :: inertia(3, 3), bias(3) !! P and b of (A, w') at hinge 0, moving axes
      real(wp), intent(in) :: force(3)               !! X_C, Y_C, M_C
      real(wp), intent(out) :: acceleration(3)       !! Vx', Vy', w'
      real(wp), intent(out) :: node(3)               !! acceleration of hinge 0, and w'
      real(wp), intent(inout) :: smallest            !! pivot
      real(wp) :: m11, m12, m22, m13, m23, m33, det, fx, fy, turn, gx, gy, w2

      associate (x => body%hinge_x, y => body%hinge_y, w => p(3))
         w2 = w*w
         m11 = body%mass + inertia(1, 1)
         m12 = inertia(1, 2)
         m22 = body%mass + inertia(2, 2)
         m13 = inertia(1, 3) + (m12*x - inertia(1, 1)*y)
         m23 = inertia(2, 3) + (inertia(2, 2)*x - m12*y)
         m33 = body%inertia + inertia(3, 3) + (inertia(2, 3) + m23)*x - (inertia(1, 3) + m13)*y
         fx = bias(1) - w2*(inertia(1, 1)*x + m12*y)
         fy = bias(2) - w2*(m12*x + inertia(2, 2)*y)
         turn = bias(3) - w2*(inertia(1, 3)*x + inertia(2, 3)*y) + (x*fy - y*fx)
         fx = force(1) - fx
         fy = force(2) - fy
         ! Elimination of A_C by the adjugate of its block.
         det = m11*m22 - m12**2
         gx = (m22*m13 - m12*m23)/det
         gy = (m11*m23 - m12*m13)/det
         m33 = m33 - gx*m13 - gy*m23
         smallest = min(smallest, m11, det, m33)
         node(3) = ((force(3) - turn) - gx*fx - gy*fy)/m33
         node(1) = (m22*fx - m12*fy)/det - gx*node(3)
         node(2) = (m11*fy - m12*fx)/det - gy*node(3)
         acceleration = [node(1) + w*p(2), node(2) - w*p(1), node(3)]
         node(1) = node(1) - y*node(3) - x*w2
         node(2) = node(2) + x*node(3) - y*w2
      end associate
   end subroutine move_spacecraft

   !> phi'' from the motion of the spacecraft.
   pure subroutine outward_pass(n, rods, pass, driven, kink_acceleration, at_hinge_0, node, phi_acceleration)
      integer, intent(in) :: n
      type(condensed_rod), intent(in) :: rods(n)
      type(condensed_pass), intent(in) :: pass(n)
      logical, intent(in) :: driven
      real(wp), intent(in) :: kink_acceleration(0:n - 1) !! used if driven
      real(wp), intent(in) :: at_hinge_0(4)
      real(wp), intent(inout) :: node(3)             !! in: acceleration of hinge 0, moving axes, and w'; out: of the tip
      real(wp), intent(out) :: phi_acceleration(n)
      real(wp) :: ae, an, along, t, y, z, turn, omega_rate
      integer :: k

      ae = node(1)
      an = node(2)
      t = node(3)
      omega_rate = t
      y = at_hinge_0(1) - (at_hinge_0(2)*ae + at_hinge_0(3)*an + at_hinge_0(4)*t)
      do k = 1, n
         associate (r => rods(k), by => pass(k))
            along = by%cd*ae + by%sd*an
            an = by%cd*an - by%sd*ae
            ae = along
            if (driven) t = t + kink_acceleration(k - 1)
            z = (by%z0 - (by%t*t + by%y*y)) - (by%ae*ae + by%an*an)
            turn = t + r%turn_y*y + r%turn_z*z
            phi_acceleration(k) = turn - omega_rate
            ae = ae - by%fall
            an = an + r%length*turn
            t = t + r%out_y*y + r%out_z*z
            y = z
         end associate
      end do
      node = [ae, an, t]
   end subroutine outward_pass

end module rodyn_recursion_condensed
