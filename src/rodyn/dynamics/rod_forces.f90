!> Forces within the chain, from the balance of what is outboard: mass times acceleration, less loads. O(n).
!> The same equations elsewhere: docs/model.md sec. 7.
module rodyn_rod_forces
   use rodyn_kinds, only: wp
   use rodyn_accelerations, only: dynamics_type
   use rodyn_bending_matrices, only: most_shapes
   use rodyn_condensed, only: expand_slopes, whole_state
   use rodyn_kinematics, only: acceleration_of_hinge_0
   use rodyn_scene, only: scene_type
   implicit none (type, external)
   private
   public :: rod_forces, largest_tension

contains

   !> Forces that pass through the two ends of each rod, on what is outboard of the end, along and across the chord of the rod.
   !> Beyond the outer end are the node and its load, too. Loads and hinges are those that the accelerations were computed with.
   pure subroutine rod_forces(dynamics, q, p, a, inner, outer)
      type(dynamics_type), intent(in) :: dynamics
      real(wp), intent(in) :: q(:), p(:), a(:) !! coordinates, rates and accelerations
      real(wp), intent(out) :: inner(:, :)     !! (2, n) [N]
      real(wp), intent(out) :: outer(:, :)     !! (2, n) [N]
      real(wp) :: node(2), whole(dynamics%scene%n_base + 3*dynamics%scene%n, 3), beyond(2), axis(2, dynamics%scene%n)
      integer :: k

      associate (scene => dynamics%scene, hinges => dynamics%hinges)
         if (scene%condensed) then
            call whole_state(scene, hinges, q, p, whole(:, 1), whole(:, 2))
            call expand_slopes(scene, hinges, a, whole(:, 3), hinges%kink_acceleration)
         end if
         node = acceleration_of_hinge_0(scene, p, a)
         do k = 1, scene%n
            axis(:, k) = [cos(q(scene%phi_at() + k)), sin(q(scene%phi_at() + k))]
            call move_rod(scene, k, q, p, a, whole, axis(:, k), node, inner(:, k))
            outer(:, k) = scene%node_mass(k)*node
            if (dynamics%regime%on_nodes) outer(:, k) = outer(:, k) - dynamics%forces%node(:, k)
         end do
         beyond = 0.0_wp
         do k = scene%n, 1, -1
            outer(:, k) = outer(:, k) + beyond
            beyond = inner(:, k) + outer(:, k)
            inner(:, k) = in_axes(axis(:, k), beyond)
            outer(:, k) = in_axes(axis(:, k), outer(:, k))
         end do
      end associate
   end subroutine rod_forces

   !> Components along and across the axis of a rod.
   pure function in_axes(axis, force)
      real(wp), intent(in) :: axis(2), force(2)
      real(wp) :: in_axes(2)
      in_axes = [axis(1)*force(1) + axis(2)*force(2), axis(1)*force(2) - axis(2)*force(1)]
   end function in_axes

   !> Mass times acceleration of rod k, and the acceleration of its outer node from that of the inner one; moving axes.
   pure subroutine move_rod(scene, k, q, p, a, whole, axis, node, force)
      type(scene_type), intent(in) :: scene
      integer, intent(in) :: k
      real(wp), intent(in) :: q(:), p(:), a(:)
      real(wp), intent(in) :: whole(:, :) !! the same with slopes, of condensed rods
      real(wp), intent(in) :: axis(2)     !! cos and sin of phi_k
      real(wp), intent(inout) :: node(2)  !! [m/s^2]
      real(wp), intent(out) :: force(2)   !! [N]
      real(wp), dimension(most_shapes) :: x, xr, xa
      real(wp) :: w, w_rate, chord(0:2), centre(0:2)
      integer :: at

      x = scene%bends(k, q)
      xr = scene%bends(k, p)
      xa = scene%bends(k, a)
      if (scene%condensed) then
         at = scene%alpha_at() + k
         x(:2) = whole(at::scene%n, 1)
         xr(:2) = whole(at::scene%n, 2)
         xa(:2) = whole(at::scene%n, 3)
      end if
      at = scene%phi_at() + k
      w = p(at)
      w_rate = a(at)
      if (scene%n_base > 0) then
         w = w + p(3)
         w_rate = w_rate + a(3)
      end if
      associate (i => scene%rods(scene%rod_of(k))%inertia, bend => scene%bending(scene%rod_of(k)))
         centre = [i%m1, 0.0_wp, 0.0_wp]
         chord = [scene%rods(scene%rod_of(k))%length, 0.0_wp, 0.0_wp]
         if (bend%inextensible) then
            centre = centre - drawn_in(bend%drawn, x, xr, xa)
            chord = chord - drawn_in(bend%shortening, x, xr, xa)
         end if
         force = i%m0*node + moved(centre, [dot_product(bend%first, x), dot_product(bend%first, xr), dot_product(bend%first, xa)])
         node = node + moved(chord, [0.0_wp, 0.0_wp, 0.0_wp])
      end associate

   contains

      !> What a place in the axes of the rod adds to the acceleration: the place and its first two rates, along and across.
      pure function moved(along, across)
         real(wp), intent(in) :: along(0:2), across(0:2)
         real(wp) :: moved(2), e, n
         e = along(2) - w**2*along(0) - w_rate*across(0) - 2.0_wp*w*across(1)
         n = across(2) - w**2*across(0) + w_rate*along(0) + 2.0_wp*w*along(1)
         moved = [axis(1)*e - axis(2)*n, axis(2)*e + axis(1)*n]
      end function moved

   end subroutine move_rod

   !> x.D x/2 and its first two rates.
   pure function drawn_in(d, x, xr, xa)
      real(wp), intent(in) :: d(most_shapes, most_shapes)
      real(wp), dimension(most_shapes), intent(in) :: x, xr, xa !! bending coordinates, their rates and accelerations
      real(wp) :: drawn_in(0:2)
      associate (drawn => matmul(d, x))
         drawn_in = [0.5_wp*dot_product(drawn, x), dot_product(drawn, xr), &
                     dot_product(drawn, xa) + dot_product(xr, matmul(d, xr))]
      end associate
   end function drawn_in

   !> Axial force where it is largest in a rod, at an end or between, tension positive. Between the ends it follows a parabola where
   !> the mass is spread evenly:
   !>     T(x) = (1 - x) T(0) + x T(1) + (m0 l W^2/2) x (1 - x).
   elemental real(wp) function largest_tension(inner, outer, bulge) result(tension)
      real(wp), intent(in) :: inner, outer !! tension at the ends [N]
      real(wp), intent(in) :: bulge        !! m0 l W^2/2 [N]
      real(wp) :: x, between

      tension = merge(inner, outer, abs(inner) >= abs(outer))
      if (.not. bulge > abs(outer - inner)) return
      x = 0.5_wp*(1.0_wp + (outer - inner)/bulge)
      between = inner + x*(outer - inner) + bulge*x*(1.0_wp - x)
      if (abs(between) > abs(tension)) tension = between
   end function largest_tension

end module rodyn_rod_forces
