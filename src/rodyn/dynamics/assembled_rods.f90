!> M(q) and the forces of a chain of rods by their maps, docs/model.md sec. 3 and 4.1: M = sum_k J_k^T m_k J_k with J_k
!> from p' to the accelerations (A, W', x'') of rod k. O(n^3).
!>
!> For rods whose arcs keep their length, which have no place in the article's N(q) z. It shares the rod's own rows (`rod_alone`,
!> `shorten`) with the recursion through joints, and nothing with `rodyn_recursion_inextensible`.
!> The same equations elsewhere: docs/model.md sec. 7.
module rodyn_assembled_rods
   use rodyn_kinds, only: wp
   use rodyn_bending_matrices, only: most_shapes
   use rodyn_foreshortening, only: shorten
   use rodyn_recursion_joints, only: rod_alone
   use rodyn_scene, only: scene_type
   implicit none (type, external)
   private
   public :: sum_rods

   integer, parameter :: most = 3 + most_shapes !! unknowns of a rod at most: A, W', x
   integer, parameter, public :: n_map_rows = 2 + 2*most !! memory: maps to accelerations of a node and of a rod, m_k times that

contains

   !> M, and the forces of inertia at p' = 0 and of loads on nodes; without hinges, stiffness of rods, loads on the spacecraft.
   subroutine sum_rods(scene, sine, cosine, q, p, loaded, node_force, maps, m, force)
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: sine(0:), cosine(0:) !! of phi (0:n)
      real(wp), intent(in) :: q(:), p(:)           !! coordinates and rates (dof)
      logical, intent(in) :: loaded                !! node_force is to be used
      real(wp), intent(in) :: node_force(2, *)     !! X, Y at the nodes [N]
      real(wp), intent(inout) :: maps(:, :)        !! workspace (n_map_rows, dof)
      real(wp), intent(out) :: m(:, :)             !! M (dof, dof)
      real(wp), intent(out) :: force(:)            !! (dof)
      real(wp) :: fall(2)                          !! acceleration of a node: map p' + fall
      integer :: k

      m = 0.0_wp
      force = 0.0_wp
      maps = 0.0_wp
      fall = 0.0_wp
      if (scene%n_base > 0) call add_spacecraft(scene, p, maps, fall, m, force)
      call add_point(scene%node_mass(0), [0.0_wp, 0.0_wp], maps, fall, m, force)
      do k = 1, scene%n
         call add_rod(scene, k, [cosine(k), sine(k)], q, p, maps, fall, m, force)
         if (loaded) then
            call add_point(scene%node_mass(k), node_force(:, k), maps, fall, m, force)
         else
            call add_point(scene%node_mass(k), [0.0_wp, 0.0_wp], maps, fall, m, force)
         end if
      end do
   end subroutine sum_rods

   !> Its own inertia, and the acceleration of hinge 0: A_C + rr w' - r w^2, A_C = (Vx' - w Vy, Vy' + w Vx).
   pure subroutine add_spacecraft(scene, p, map, fall, m, force)
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: p(:)
      real(wp), intent(inout) :: map(:, :), fall(:), m(:, :), force(:)

      associate (body => scene%body, w => p(3))
         m(1, 1) = body%mass
         m(2, 2) = body%mass
         m(3, 3) = body%inertia
         force(1:2) = -body%mass*w*[-p(2), p(1)]
         map(1, 1) = 1.0_wp
         map(2, 2) = 1.0_wp
         map(:2, 3) = [-body%hinge_y, body%hinge_x]
         fall = w*[-p(2), p(1)] - w**2*[body%hinge_x, body%hinge_y]
      end associate
   end subroutine add_spacecraft

   !> A point mass on a node, and a force on it.
   pure subroutine add_point(mass, load, map, fall, m, force)
      real(wp), intent(in) :: mass, load(2), map(:, :), fall(:)
      real(wp), intent(inout) :: m(:, :), force(:)
      integer :: c

      do c = 1, size(m, 2)
         m(:, c) = m(:, c) + (mass*map(1, c))*map(1, :) + (mass*map(2, c))*map(2, :)
         force(c) = force(c) + (load(1) - mass*fall(1))*map(1, c) + (load(2) - mass*fall(2))*map(2, c)
      end do
   end subroutine add_point

   !> Rod k, and the acceleration of its outer node from that of its inner one.
   subroutine add_rod(scene, k, axis, q, p, maps, fall, m, force)
      type(scene_type), intent(in) :: scene
      integer, intent(in) :: k
      real(wp), intent(in) :: axis(2), q(:), p(:)
      real(wp), intent(inout) :: maps(:, :), fall(:), m(:, :), force(:)
      real(wp) :: h(most, most), c(most), normal(2), w, chord, x(most_shapes), u(most_shapes), slope(most_shapes)
      integer :: i

      x = scene%bends(k, q)
      u = scene%bends(k, p)
      chord = scene%chord(k, q)
      normal = [-axis(2), axis(1)]
      w = p(scene%phi_at() + k)
      if (scene%n_base > 0) w = w + p(3)
      associate (rod => scene%rods(scene%rod_of(k)), bend => scene%bending(scene%rod_of(k)))
         call rod_alone(rod%inertia, bend, x, u, w, .false., h, c)
         if (bend%inextensible) call shorten(bend, x, u, w, h, c)
         slope = matmul(bend%shortening, x)
         do i = 2, most
            h(i, :i - 1) = h(:i - 1, i)
         end do
         call map_rod(scene, k, axis, maps)
         call add_products(h, c + h(:, 1)*dot_product(axis, fall) + h(:, 2)*dot_product(normal, fall), maps, m, force)
         do i = 1, scene%n_dof
            maps(1:2, i) = maps(1:2, i) + chord*maps(5, i)*normal - dot_product(slope, maps(6:8, i))*axis
         end do
         fall = fall - (w**2*chord + dot_product(u, matmul(bend%shortening, u)))*axis + 2.0_wp*w*scene%chord_rate(k, q, p)*normal
      end associate
   end subroutine add_rod

   !> Rows 3 to 8: J_k, from p' to (A, W', x'') of rod k.
   pure subroutine map_rod(scene, k, axis, maps)
      type(scene_type), intent(in) :: scene
      integer, intent(in) :: k
      real(wp), intent(in) :: axis(2)
      real(wp), intent(inout) :: maps(:, :)
      integer :: i

      do i = 1, scene%n_dof
         maps(3, i) = axis(1)*maps(1, i) + axis(2)*maps(2, i)
         maps(4, i) = axis(1)*maps(2, i) - axis(2)*maps(1, i)
         maps(5:8, i) = 0.0_wp
      end do
      if (scene%n_base > 0) maps(5, 3) = 1.0_wp
      maps(5, scene%phi_at() + k) = 1.0_wp
      do i = 1, scene%n_bend
         maps(5 + i, scene%bend_at(i) + k) = 1.0_wp
      end do
   end subroutine map_rod

   !> J_k^T m_k J_k, and the forces -J_k^T c.
   pure subroutine add_products(h, c, maps, m, force)
      real(wp), intent(in) :: h(most, most), c(most)
      real(wp), intent(inout) :: maps(:, :), m(:, :), force(:)
      integer :: i, j

      do j = 1, size(m, 2)
         maps(9:14, j) = matmul(h, maps(3:8, j))
      end do
      do j = 1, size(m, 2)
         do i = 1, size(m, 1)
            m(i, j) = m(i, j) + dot_product(maps(3:8, i), maps(9:14, j))
         end do
         force(j) = force(j) - dot_product(c, maps(3:8, j))
      end do
   end subroutine add_products

end module rodyn_assembled_rods
