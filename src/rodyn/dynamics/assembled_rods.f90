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

contains

   !> M, and the forces of inertia at p' = 0 and of loads on nodes; without hinges, stiffness of rods, loads on the spacecraft.
   subroutine sum_rods(scene, sine, cosine, q, p, loaded, node_force, m, force)
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: sine(0:), cosine(0:) !! of phi (0:n)
      real(wp), intent(in) :: q(:), p(:)           !! coordinates and rates (dof)
      logical, intent(in) :: loaded                !! node_force is to be used
      real(wp), intent(in) :: node_force(2, *)     !! X, Y at the nodes [N]
      real(wp), intent(out) :: m(:, :)             !! M (dof, dof)
      real(wp), intent(out) :: force(:)            !! (dof)
      real(wp) :: map(2, scene%n_dof), fall(2)     !! acceleration of a node: map p' + fall
      integer :: k

      m = 0.0_wp
      force = 0.0_wp
      map = 0.0_wp
      fall = 0.0_wp
      if (scene%n_base > 0) call add_spacecraft(scene, p, map, fall, m, force)
      call add_point(scene%node_mass(0), [0.0_wp, 0.0_wp], map, fall, m, force)
      do k = 1, scene%n
         call add_rod(scene, k, [cosine(k), sine(k)], q, p, map, fall, m, force)
         if (loaded) then
            call add_point(scene%node_mass(k), node_force(:, k), map, fall, m, force)
         else
            call add_point(scene%node_mass(k), [0.0_wp, 0.0_wp], map, fall, m, force)
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
         map(:, 3) = [-body%hinge_y, body%hinge_x]
         fall = w*[-p(2), p(1)] - w**2*[body%hinge_x, body%hinge_y]
      end associate
   end subroutine add_spacecraft

   !> A point mass on a node, and a force on it.
   pure subroutine add_point(mass, load, map, fall, m, force)
      real(wp), intent(in) :: mass, load(2), map(:, :), fall(:)
      real(wp), intent(inout) :: m(:, :), force(:)

      m = m + mass*matmul(transpose(map), map)
      force = force + matmul(load - mass*fall, map)
   end subroutine add_point

   !> Rod k, and the acceleration of its outer node from that of its inner one.
   subroutine add_rod(scene, k, axis, q, p, map, fall, m, force)
      type(scene_type), intent(in) :: scene
      integer, intent(in) :: k
      real(wp), intent(in) :: axis(2), q(:), p(:)
      real(wp), intent(inout) :: map(:, :), fall(:), m(:, :), force(:)
      real(wp) :: j(most, scene%n_dof), h(most, most), c(most), normal(2), w, x(most_shapes), u(most_shapes)
      integer :: i

      x = scene%bends(k, q)
      u = scene%bends(k, p)
      normal = [-axis(2), axis(1)]
      w = p(scene%phi_at() + k)
      j = 0.0_wp
      j(1, :) = matmul(axis, map)
      j(2, :) = matmul(normal, map)
      j(3, scene%phi_at() + k) = 1.0_wp
      if (scene%n_base > 0) then
         w = w + p(3)
         j(3, 3) = 1.0_wp
      end if
      do i = 1, scene%n_bend
         j(3 + i, scene%bend_at(i) + k) = 1.0_wp
      end do
      associate (rod => scene%rods(scene%rod_of(k)), bend => scene%bending(scene%rod_of(k)))
         call rod_alone(rod%inertia, bend, x, u, w, .false., h, c)
         if (bend%inextensible) call shorten(bend, x, u, w, h, c)
         do i = 2, most
            h(i, :i - 1) = h(:i - 1, i)
         end do
         m = m + matmul(transpose(j), matmul(h, j))
         force = force - matmul(c + h(:, 1)*dot_product(axis, fall) + h(:, 2)*dot_product(normal, fall), j)
         associate (slope => matmul(bend%shortening, x))
            map = map + spread(scene%chord(k, q)*normal, 2, scene%n_dof)*spread(j(3, :), 1, 2) - &
                  spread(axis, 2, scene%n_dof)*spread(matmul(slope, j(4:, :)), 1, 2)
            fall = fall - (w**2*scene%chord(k, q) + dot_product(u, matmul(bend%shortening, u)))*axis + &
                   2.0_wp*w*scene%chord_rate(k, q, p)*normal
         end associate
      end associate
   end subroutine add_rod

end module rodyn_assembled_rods
