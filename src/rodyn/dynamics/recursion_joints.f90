!> Accelerations in O(n) of a chain of every kind of rod, with or without the bubble, of whose hinges any may be locked:
!> docs/model.md sec. 4.2 with moments.
!>
!> A free hinge passes a force and a moment that is known (T of its spring and damper). A locked one passes a moment that
!> is not known, but makes the angular accelerations of the two end tangents equal, up to a given sigma. So the chain
!> beyond node k acts on what is inside by an apparent inertia P (3x3, symmetric) and a bias b:
!>     (f, -T) = P (A, tau) + b,
!> f and -T the force and moment it takes to move it, A the acceleration of the node, tau the angular acceleration of the
!> end tangent of the rod inside. Beyond a free hinge the third row and column of P are zero and b(3) = -T.
!>
!> From the tip inward, rod k with its bending coordinates x is added in the unknowns (A, tau, x), tau = W' + alpha'' of
!> its inner end tangent: then locked rods of any stiffness add up like rigid bodies. The equations of rod and chain,
!>     H (A, tau, x'') + h = (f, -T, 0),
!> lose x by elimination, and tau as well if the hinge inside is free: -T is known there.
!>
!> The other recursions are faster and multiply the differences out on paper. Here they are formed as they stand, which
!> costs as many digits as what a light rod carries beyond a free hinge is heavier than the rod.
!> The same equations elsewhere: docs/model.md sec. 7.
module rodyn_recursion_joints
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use rodyn_kinds, only: wp
   use rodyn_rod_integrals, only: rod_integrals
   use rodyn_foreshortening, only: shorten
   use rodyn_scene, only: scene_type
   use rodyn_bending_matrices, only: bending_matrices, most_shapes
   implicit none (type, external)
   private
   public :: joint_recursion, new_joint_recursion, joint_accelerations, rod_alone

   integer, parameter :: most = 3 + most_shapes !! unknowns of a rod at most: A, tau, x

   !> What the inward pass leaves of a rod for the outward pass.
   type :: rod_pass
      real(wp) :: cd = 1.0_wp, sd = 0.0_wp !! cosine and sine of the turn from the axes of rod k - 1
      real(wp) :: fall = 0.0_wp            !! l W^2, of the outer node against e beside -(l)'' of x'' [m/s^2]
      real(wp) :: across = 0.0_wp          !! 2 W l', of the outer node along n [m/s^2]
      real(wp) :: chord = 0.0_wp           !! l, the chord [m]
      real(wp) :: slope(most_shapes) = 0.0_wp !! -dl/dx: zero unless `inextensible`
      real(wp) :: x0(most_shapes) = 0.0_wp, x(most_shapes, 3) = 0.0_wp !! x'' = x0 - x (A, tau)
      real(wp) :: t0 = 0.0_wp, t(3) = 0.0_wp !! free inside: tau = t0 - t(1:2) A; locked: -T = t0 + t (A, tau)
   end type rod_pass

   !> Memory. One per thread.
   type :: joint_recursion
      type(rod_pass), allocatable :: pass(:) !! (n)
   end type joint_recursion

contains

   !> Allocate for a scene.
   subroutine new_joint_recursion(recursion, scene)
      type(joint_recursion), intent(out) :: recursion
      type(scene_type), intent(in) :: scene

      allocate (recursion%pass(scene%n))
   end subroutine new_joint_recursion

   !> p' for given q, p and loads, and the moments of locked hinges. Allocates nothing.
   pure subroutine joint_accelerations(recursion, scene, sine, cosine, q, p, elastic, locked, opening_acceleration, &
                                       moment, base_force, loaded, node_force, acceleration, ok)
      type(joint_recursion), intent(inout) :: recursion
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: sine(0:), cosine(0:)   !! of phi (0:n); 0 and 1 at 0
      real(wp), intent(in) :: q(:), p(:)             !! coordinates and rates (dof)
      logical, intent(in) :: elastic                 !! rods resist bending (not so during an impact)
      logical, intent(in) :: locked(0:)              !! (0:n-1)
      real(wp), intent(in) :: opening_acceleration(0:) !! sigma: second derivative of the opening of locked hinges (0:n-1) [rad/s^2]
      real(wp), intent(inout) :: moment(0:)          !! T (0:n) [N m], T(n) = 0; in: of free hinges; out: of locked ones too
      real(wp), intent(in) :: base_force(3)          !! X_C, Y_C, M_C, moving axes
      logical, intent(in) :: loaded                  !! node_force is to be used
      real(wp), intent(in) :: node_force(2, *)       !! X, Y at nodes (n), moving axes [N]
      real(wp), intent(out) :: acceleration(:)       !! p' (dof)
      logical, intent(out) :: ok                     !! false: not finite, or M not positive definite
      real(wp) :: inertia(3, 3), bias(3), h(most, most), c(most), node(3), smallest
      integer :: k

      inertia = 0.0_wp
      bias = 0.0_wp
      smallest = huge(1.0_wp)
      do k = scene%n, 1, -1
         call add_node(scene%node_mass(k), inertia)
         if (loaded) then
            bias(1) = bias(1) - (node_force(1, k)*cosine(k) + node_force(2, k)*sine(k))
            bias(2) = bias(2) - (node_force(2, k)*cosine(k) - node_force(1, k)*sine(k))
         end if
         associate (pass => recursion%pass(k), bending => scene%bending(scene%rod_of(k)))
            call rod_equations(scene, bending, k, q, p, elastic, inertia, bias, pass, h, c)
            call eliminate_bending(bending%n, h, c, pass, inertia, bias, smallest)
            if (locked(k - 1)) then
               pass%t = inertia(3, :)
               pass%t0 = bias(3)
               bias = bias + inertia(:, 3)*opening_acceleration(k - 1)
            else
               call release(moment(k - 1), pass, inertia, bias, smallest)
            end if
            if (.not. smallest > 0.0_wp) then ! the state of a step that was much too long: nothing to divide by
               acceleration = 0.0_wp
               ok = .false.
               return
            end if
            pass%cd = cosine(k)*cosine(k - 1) + sine(k)*sine(k - 1)
            pass%sd = sine(k)*cosine(k - 1) - cosine(k)*sine(k - 1)
            call turn_axes(pass%cd, pass%sd, inertia, bias)
         end associate
      end do
      call add_node(scene%node_mass(0), inertia)
      call move_spacecraft(scene, p, inertia, bias, base_force, acceleration, node, smallest)
      call outward_pass(recursion, scene, locked, opening_acceleration, node, moment, acceleration)
      ok = smallest > 0.0_wp .and. all(ieee_is_finite(acceleration))
   end subroutine joint_accelerations

   !> A point mass on the node.
   pure subroutine add_node(mass, inertia)
      real(wp), intent(in) :: mass
      real(wp), intent(inout) :: inertia(3, 3)
      inertia(1, 1) = inertia(1, 1) + mass
      inertia(2, 2) = inertia(2, 2) + mass
   end subroutine add_node

   !> H and h of rod k and of the chain that it carries, in (A, tau, x).
   pure subroutine rod_equations(scene, bending, k, q, p, elastic, inertia, bias, pass, h, c)
      type(scene_type), intent(in) :: scene
      type(bending_matrices), intent(in) :: bending
      integer, intent(in) :: k
      real(wp), intent(in) :: q(:), p(:)
      logical, intent(in) :: elastic
      real(wp), intent(in) :: inertia(3, 3), bias(3) !! P and b at node k, axes of rod k
      type(rod_pass), intent(inout) :: pass
      real(wp), intent(out) :: h(most, most), c(most)
      real(wp) :: w
      integer :: i, j

      w = p(scene%phi_at() + k)
      if (scene%n_base > 0) w = w + p(3)
      associate (rod => scene%rods(scene%rod_of(k)))
         pass%chord = rod%length
         pass%fall = rod%length*w**2
         call rod_alone(rod%inertia, bending, scene%bends(k, q), scene%bends(k, p), w, elastic, h, c)
         if (bending%inextensible) then
            call draw_in(rod%length, bending, scene%bends(k, q), scene%bends(k, p), w, pass, h, c)
            call add_chain(pass%chord, .true., inertia, bias - pass%fall*inertia(:, 1) + pass%across*inertia(:, 2), h, c)
            call pull_slopes(pass%chord, pass%slope, inertia, bias(1) - pass%fall*inertia(1, 1) + pass%across*inertia(1, 2), h, c)
         else
            call add_chain(rod%length, bending%n > 0, inertia, bias - pass%fall*inertia(:, 1), h, c)
         end if
      end associate
      if (bending%n > 0) then ! W' = tau - alpha'': the column, then the row of alpha
         h(4, 4) = h(4, 4) - h(3, 4)
         h(:3, 4) = h(:3, 4) - h(:3, 3)
         h(4, 4:) = h(4, 4:) - h(3, 4:)
         c(4) = c(4) - c(3)
      end if
      do i = 2, most
         do j = 1, i - 1
            h(i, j) = h(j, i)
         end do
      end do
   end subroutine rod_equations

   !> The rod, docs/model.md sec. 3, in (A, W', x): the upper triangle of H. (Fixed sizes keep the products off the heap; rows
   !> beyond the rod's coordinates are zero.)
   pure subroutine rod_alone(integrals, bending, x, rate, w, elastic, h, c)
      type(rod_integrals), intent(in) :: integrals
      type(bending_matrices), intent(in) :: bending
      real(wp), intent(in) :: x(most_shapes), rate(most_shapes) !! bending coordinates and rates
      real(wp), intent(in) :: w                                 !! W [rad/s]
      logical, intent(in) :: elastic
      real(wp), intent(out) :: h(most, most), c(most)
      real(wp) :: mv, curved(most_shapes)

      mv = dot_product(bending%first, x)
      curved = matmul(bending%second, x)
      h(:, 1) = 0.0_wp
      h(:2, 2) = [0.0_wp, integrals%m0]
      h(1, 1) = integrals%m0
      h(:3, 3) = [-mv, integrals%m1, integrals%m2 + dot_product(x, curved)]
      h(1, 4:) = 0.0_wp
      h(2, 4:) = bending%first
      h(3, 4:) = bending%turning
      h(4:, 4:) = bending%inertia
      c(1) = -w**2*integrals%m1 - 2.0_wp*w*dot_product(bending%first, rate)
      c(2) = -w**2*mv
      c(3) = 2.0_wp*w*dot_product(rate, curved)
      c(4:) = -w**2*matmul(bending%centrifugal, x)
      if (elastic) c(4:) = c(4:) + matmul(bending%stiffness, x)
   end subroutine rod_alone

   !> What foreshortening changes of a rod alone, and the motion of its outer node (docs/model.md sec. 3, `inextensible`).
   pure subroutine draw_in(length, bending, x, rate, w, pass, h, c)
      real(wp), intent(in) :: length
      type(bending_matrices), intent(in) :: bending
      real(wp), intent(in) :: x(most_shapes), rate(most_shapes), w
      type(rod_pass), intent(inout) :: pass
      real(wp), intent(inout) :: h(most, most), c(most)

      call shorten(bending, x, rate, w, h, c)
      pass%slope = matmul(bending%shortening, x)
      pass%chord = length - 0.5_wp*dot_product(x, pass%slope)
      pass%fall = pass%chord*w**2 + dot_product(rate, matmul(bending%shortening, rate))
      pass%across = -2.0_wp*w*dot_product(rate, pass%slope)
   end subroutine draw_in

   !> The chain beyond pulls on the bending coordinates, whose x'' move the outer node by -slope.x'' along the rod.
   pure subroutine pull_slopes(length, slope, inertia, outer, h, c)
      real(wp), intent(in) :: length, slope(most_shapes)
      real(wp), intent(in) :: inertia(3, 3), outer !! P; along the rod: b with the fall of node k
      real(wp), intent(inout) :: h(most, most), c(most)
      integer :: j

      do j = 1, most_shapes
         h(1, 3 + j) = h(1, 3 + j) - inertia(1, 1)*slope(j)
         h(2, 3 + j) = h(2, 3 + j) - inertia(1, 2)*slope(j)
         h(3, 3 + j) = h(3, 3 + j) - (inertia(1, 3) + length*inertia(1, 2))*slope(j)
         h(4:3 + j, 3 + j) = h(4:3 + j, 3 + j) + inertia(1, 1)*slope(:j)*slope(j)
         h(min(5, 3 + j), max(5, 3 + j)) = h(min(5, 3 + j), max(5, 3 + j)) - merge(2.0_wp, 1.0_wp, j == 2)*inertia(1, 3)*slope(j)
      end do
      c(4:) = c(4:) - slope*outer
   end subroutine pull_slopes

   !> The chain beyond, which node k moves by A + l n W' - l W^2 e and the end tangent turns by W' + beta''.
   pure subroutine add_chain(length, bends, inertia, outer, h, c)
      real(wp), intent(in) :: length
      logical, intent(in) :: bends
      real(wp), intent(in) :: inertia(3, 3), outer(3) !! P, and b with the fall of node k
      real(wp), intent(inout) :: h(most, most), c(most)

      h(1, 1) = h(1, 1) + inertia(1, 1)
      h(1, 2) = h(1, 2) + inertia(1, 2)
      h(2, 2) = h(2, 2) + inertia(2, 2)
      h(:2, 3) = h(:2, 3) + inertia(:2, 3) + length*inertia(:2, 2)
      h(3, 3) = h(3, 3) + inertia(3, 3) + length*(2.0_wp*inertia(2, 3) + length*inertia(2, 2))
      c(1:2) = c(1:2) + outer(1:2)
      c(3) = c(3) + outer(3) + length*outer(2)
      if (.not. bends) return
      h(:2, 5) = h(:2, 5) + inertia(:2, 3)
      h(3, 5) = h(3, 5) + inertia(3, 3) + length*inertia(2, 3)
      h(5, 5) = h(5, 5) + inertia(3, 3)
      c(5) = c(5) + outer(3)
   end subroutine add_chain

   !> x'' from its own rows, and P, b at the inner end without it.
   pure subroutine eliminate_bending(nb, h, c, pass, inertia, bias, smallest)
      integer, intent(in) :: nb
      real(wp), intent(inout) :: h(most, most), c(most) !! rows of x are used up
      type(rod_pass), intent(inout) :: pass
      real(wp), intent(out) :: inertia(3, 3), bias(3)
      real(wp), intent(inout) :: smallest !! pivot
      real(wp) :: factor
      integer :: i, j, m, last

      last = 3 + nb
      inertia = 0.0_wp
      bias = 0.0_wp
      do i = last, 4, -1
         smallest = min(smallest, h(i, i))
         if (.not. h(i, i) > 0.0_wp) return
         factor = 1.0_wp/h(i, i)
         h(i, :i - 1) = h(i, :i - 1)*factor
         c(i) = c(i)*factor
         do j = 1, i - 1
            c(j) = c(j) - h(j, i)*c(i)
            do m = 1, i - 1
               h(m, j) = h(m, j) - h(m, i)*h(i, j)
            end do
         end do
      end do
      ! Row i now says x_i = -c_i - h_i (A, tau, x_1..x_{i-1}).
      do i = 4, last
         pass%x0(i - 3) = -c(i)
         pass%x(i - 3, :) = h(i, 1:3)
         do j = 4, i - 1
            pass%x0(i - 3) = pass%x0(i - 3) - h(i, j)*pass%x0(j - 3)
            pass%x(i - 3, :) = pass%x(i - 3, :) - h(i, j)*pass%x(j - 3, :)
         end do
      end do
      inertia = h(1:3, 1:3)
      bias = c(1:3)
   end subroutine eliminate_bending

   !> A free hinge inside: -T is known, tau follows from A, and only a force is left.
   pure subroutine release(moment, pass, inertia, bias, smallest)
      real(wp), intent(in) :: moment !! T [N m]
      type(rod_pass), intent(inout) :: pass
      real(wp), intent(inout) :: inertia(3, 3), bias(3), smallest
      integer :: j

      smallest = min(smallest, inertia(3, 3))
      if (.not. inertia(3, 3) > 0.0_wp) return
      pass%t(1:2) = inertia(1:2, 3)/inertia(3, 3)
      pass%t0 = -(bias(3) + moment)/inertia(3, 3)
      bias(1:2) = bias(1:2) + inertia(1:2, 3)*pass%t0
      do j = 1, 2
         inertia(1:2, j) = inertia(1:2, j) - inertia(1:2, 3)*pass%t(j)
      end do
      inertia(:, 3) = 0.0_wp
      inertia(3, :) = 0.0_wp
      bias(3) = -moment
   end subroutine release

   !> From the axes of rod k to those of rod k - 1.
   pure subroutine turn_axes(cd, sd, inertia, bias)
      real(wp), intent(in) :: cd, sd
      real(wp), intent(inout) :: inertia(3, 3), bias(3)
      real(wp) :: ee, en, nn

      ee = inertia(1, 1)
      en = inertia(1, 2)
      nn = inertia(2, 2)
      inertia(1, 1) = cd*cd*ee + sd*(sd*nn - 2.0_wp*cd*en)
      inertia(2, 2) = cd*cd*nn + sd*(sd*ee + 2.0_wp*cd*en)
      inertia(1, 2) = cd*sd*(ee - nn) + (cd - sd)*(cd + sd)*en
      inertia(2, 1) = inertia(1, 2)
      inertia(1:2, 3) = [cd*inertia(1, 3) - sd*inertia(2, 3), sd*inertia(1, 3) + cd*inertia(2, 3)]
      inertia(3, 1:2) = inertia(1:2, 3)
      bias(1:2) = [cd*bias(1) - sd*bias(2), sd*bias(1) + cd*bias(2)]
   end subroutine turn_axes

   !> The spacecraft under its loads and the chain. With r = (x0, y0), rr = (-y0, x0), hinge 0 accelerates by
   !> A_C + rr w' - r w^2, A_C = (Vx' - w Vy, Vy' + w Vx), and tau = w' (sigma_0 is in the bias).
   pure subroutine move_spacecraft(scene, p, inertia, bias, force, acceleration, node, smallest)
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: p(:)
      real(wp), intent(in) :: inertia(3, 3), bias(3) !! P and b at hinge 0, moving axes
      real(wp), intent(in) :: force(3)
      real(wp), intent(inout) :: acceleration(:)
      real(wp), intent(out) :: node(3)               !! acceleration of hinge 0, moving axes, and w'
      real(wp), intent(inout) :: smallest
      real(wp) :: m(3, 3), f(3), fallen(3), r(2), rr(2), w, d2

      node = 0.0_wp
      if (scene%n_base == 0) return
      w = p(3)
      associate (body => scene%body)
         r = [body%hinge_x, body%hinge_y]
         rr = [-r(2), r(1)]
         m = inertia
         m(:2, 3) = m(:2, 3) + inertia(:2, 1)*rr(1) + inertia(:2, 2)*rr(2)
         m(3, 3) = body%inertia + inertia(3, 3) + dot_product(rr, inertia(:2, 3) + m(:2, 3))
         m(1, 1) = m(1, 1) + body%mass
         m(2, 2) = m(2, 2) + body%mass
         fallen = bias - w**2*(inertia(:, 1)*r(1) + inertia(:, 2)*r(2))
         f(1:2) = force(1:2) - fallen(1:2)
         f(3) = force(3) - fallen(3) - dot_product(rr, fallen(1:2))
         ! Elimination of A_C by the adjugate of its block.
         d2 = m(1, 1)*m(2, 2) - m(1, 2)**2
         node(1) = (m(2, 2)*m(1, 3) - m(1, 2)*m(2, 3))/d2
         node(2) = (m(1, 1)*m(2, 3) - m(1, 2)*m(1, 3))/d2
         m(3, 3) = m(3, 3) - dot_product(node(1:2), m(:2, 3))
         smallest = min(smallest, m(1, 1), d2, m(3, 3))
         node(3) = (f(3) - dot_product(node(1:2), f(1:2)))/m(3, 3)
         f(1:2) = f(1:2) - m(:2, 3)*node(3)
         node(1) = (m(2, 2)*f(1) - m(1, 2)*f(2))/d2
         node(2) = (m(1, 1)*f(2) - m(1, 2)*f(1))/d2
         acceleration(1:3) = [node(1) + w*p(2), node(2) - w*p(1), node(3)]
         node(1:2) = node(1:2) + rr*node(3) - r*w**2
      end associate
   end subroutine move_spacecraft

   !> Outward: accelerations of the rods, moments of locked hinges.
   pure subroutine outward_pass(recursion, scene, locked, opening_acceleration, node, moment, acceleration)
      type(joint_recursion), intent(in) :: recursion
      type(scene_type), intent(in) :: scene
      logical, intent(in) :: locked(0:)
      real(wp), intent(in) :: opening_acceleration(0:)
      real(wp), intent(inout) :: node(3) !! at hinge 0: A, moving axes, and w'
      real(wp), intent(inout) :: moment(0:), acceleration(:)
      real(wp) :: omega_rate, w_rate, bent(most_shapes)
      integer :: i, k, nb

      omega_rate = node(3)
      do k = 1, scene%n
         associate (pass => recursion%pass(k))
            nb = scene%n_bend
            node(1:2) = [pass%cd*node(1) + pass%sd*node(2), pass%cd*node(2) - pass%sd*node(1)]
            if (locked(k - 1)) then
               node(3) = node(3) + opening_acceleration(k - 1)
               moment(k - 1) = -(pass%t0 + dot_product(pass%t, node))
            else
               node(3) = pass%t0 - dot_product(pass%t(1:2), node(1:2))
            end if
            w_rate = node(3)
            do i = 1, nb
               bent(i) = pass%x0(i) - dot_product(pass%x(i, :), node)
               acceleration(scene%phi_at() + i*scene%n + k) = bent(i)
            end do
            if (nb > 0) then
               w_rate = node(3) - bent(1)
               node(3) = w_rate + bent(2)
            end if
            acceleration(scene%phi_at() + k) = w_rate - omega_rate
            node(1) = node(1) - pass%fall
            node(2) = node(2) + pass%chord*w_rate
            if (scene%inextensible) node(1:2) = node(1:2) + [-dot_product(pass%slope(:nb), bent(:nb)), pass%across]
         end associate
      end do
   end subroutine outward_pass

end module rodyn_recursion_joints
