!> Newton systems of condensed rods in O(n).
!>
!> The rods' equations are those of a chain whose slopes are coordinates (`rodyn_newton_tangent`, rows of `rodyn_newton_chain`) in
!> the unknowns of `rodyn_recursion_condensed`: rod k between y = x_{k-1} and z = x_k turns by phi = t + turn_y y + turn_z z, with
!> (alpha, beta) = bend_y y + bend_z z. What rod k - 1 has to know of the chain beyond it is
!>     (fe, fn, moment, force on x) = P (dAe, dAn, t, x, w') + b;
!> z is eliminated from rod to rod, x_0 last. The spring's share g^2 C + g D of hinge k is on the diagonal of x_k.
!> The same equations elsewhere: docs/model.md sec. 7.
module rodyn_newton_condensed
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use rodyn_kinds, only: wp
   use rodyn_scene, only: scene_type
   use rodyn_hinge_law, only: hinge_law, openings
   use rodyn_condensed, only: whole_scene, whole_state, expand_slopes
   use rodyn_newton_tangent, only: rod_tangent, linearise_rods
   use rodyn_recursion_condensed, only: condensed_rod, prepare_rod
   implicit none (type, external)
   private
   public :: condensed_newton, new_condensed_newton, linearise_condensed, factorise_condensed, reduce_condensed, expand_condensed

   !> What elimination of a rod leaves for the solutions.
   type :: rod_factor
      real(wp) :: outer(4, 2)          !! P of the chain beyond the outer node, mass there included, columns dAe, dAn
      real(wp) :: ae_w, ae_phi, an_phi !! change of acceleration of the outer node by w' and phi (by w' across: l)
      real(wp) :: by(5)                !! z = z0 - by (dAe, dAn, t, y, w')
      real(wp) :: column(4)            !! fe, fn and rows of t, y by z
      real(wp) :: softness             !! z by a force on it
      real(wp) :: z0                   !! of a solution
   end type rod_factor

   !> A linearised chain and its factors.
   type :: condensed_newton
      type(scene_type) :: whole                  !! the chain whose slopes are coordinates
      type(condensed_rod), allocatable :: rods(:)  !! (n)
      type(rod_factor), allocatable :: factor(:)   !! (n)
      real(wp), allocatable :: hinge(:)          !! g^2 C + g D; 0 if locked (0:n-1)
      type(rod_factor) :: root                   !! of x_0: y and t are not used
      real(wp), allocatable, dimension(:) :: whole_q, whole_p !! known changes (n_base + 3 n)
   end type condensed_newton

contains

   !> Allocate, and gather the constants of the rods between hinges with these laws.
   subroutine new_condensed_newton(newton, scene, hinges)
      type(condensed_newton), intent(out) :: newton
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      integer :: k

      newton%whole = whole_scene(scene)
      allocate (newton%rods(scene%n), newton%factor(scene%n), newton%hinge(0:scene%n - 1))
      allocate (newton%whole_q(newton%whole%n_dof), newton%whole_p(newton%whole%n_dof))
      do k = 1, scene%n
         call prepare_rod(scene, hinges%locked, merge(1.0_wp, hinges%stiffness, hinges%locked), k, newton%rods(k))
      end do
   end subroutine new_condensed_newton

   !> Coefficients of all rods at a state.
   pure subroutine linearise_condensed(newton, scene, hinges, sine, cosine, q, p, a, loaded, node_force, tangent)
      type(condensed_newton), intent(in) :: newton
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      real(wp), intent(in) :: sine(0:), cosine(0:)
      real(wp), intent(in) :: q(:), p(:), a(:)
      logical, intent(in) :: loaded
      real(wp), intent(in) :: node_force(:, :)
      type(rod_tangent), intent(inout) :: tangent(:)
      real(wp), dimension(newton%whole%n_dof) :: whole_q, whole_p, whole_a

      call whole_state(scene, hinges, q, p, whole_q, whole_p)
      call expand_slopes(scene, hinges, a, whole_a, hinges%kink_acceleration)
      call linearise_rods(newton%whole, sine, cosine, whole_q, whole_p, whole_a, loaded, node_force, tangent)
   end subroutine linearise_condensed

   !> Eliminate all rods.
   pure subroutine factorise_condensed(newton, scene, hinges, gamma, tangent, apparent, by_omega, ok)
      type(condensed_newton), intent(inout) :: newton
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      real(wp), intent(in) :: gamma            !! [s]
      type(rod_tangent), intent(in) :: tangent(:)
      real(wp), intent(out) :: apparent(3, 2)  !! change of force on hinge 0 and of moment by dAx, dAy
      real(wp), intent(out) :: by_omega(3)     !! by w'
      logical, intent(out) :: ok               !! false: singular
      real(wp) :: p(4, 5), s(5, 6)
      integer :: j, k

      newton%hinge = merge(0.0_wp, gamma*(gamma*hinges%stiffness + hinges%damping), hinges%locked)
      p = 0.0_wp
      do k = scene%n, 1, -1
         p(1, 1) = p(1, 1) + scene%node_mass(k)
         p(2, 2) = p(2, 2) + scene%node_mass(k)
         associate (f => newton%factor(k), t => tangent(k))
            f%outer = p(:, 1:2)
            call rod_equations(newton%whole, k, newton%rods(k), t, gamma, p, f, s)
            s(5, 5) = s(5, 5) + merge(1.0_wp, newton%hinge(min(k, scene%n - 1)), k == scene%n)
            f%softness = 1.0_wp/s(5, 5)
            f%by = s(5, [1, 2, 3, 4, 6])*f%softness
            f%column = s(1:4, 5)
            p(:, 1:4) = s(1:4, 1:4)
            p(:, 5) = s(1:4, 6)
            do j = 1, 5
               p(:, j) = p(:, j) - f%column*f%by(j)
            end do
            call turn_axes(t%cd, t%sd, p)
         end associate
      end do
      associate (f => newton%root)
         f%softness = 1.0_wp/(p(4, 4) + newton%hinge(0))
         f%by = p(4, :)*f%softness
         f%column = p(:, 4)
         apparent = p(1:3, 1:2)
         do j = 1, 2
            apparent(:, j) = apparent(:, j) - f%column(1:3)*f%by(j)
         end do
         by_omega = p(1:3, 5) - f%column(1:3)*f%by(5)
      end associate
      ok = all(ieee_is_finite(p)) .and. ieee_is_finite(newton%root%softness)
   end subroutine factorise_condensed

   !> Rows fe, fn, t, y, z of one rod with the chain beyond it; columns dAe, dAn, t, y, z, w'.
   pure subroutine rod_equations(whole, k, rod, t, g, p, f, s)
      type(scene_type), intent(in) :: whole
      integer, intent(in) :: k
      type(condensed_rod), intent(in) :: rod
      type(rod_tangent), intent(in) :: t
      real(wp), intent(in) :: g        !! gamma
      real(wp), intent(in) :: p(4, 5)  !! of the chain from the outer node, mass included, axes of this rod
      type(rod_factor), intent(inout) :: f
      real(wp), intent(out) :: s(5, 6)
      real(wp) :: q(6, 6), map(3, 3), by_w(4), by_phi(4), g2

      g2 = g**2
      f%ae_w = -2.0_wp*g*rod%length*t%w
      f%ae_phi = f%ae_w - g2*rod%length*t%wr
      f%an_phi = rod%length*(1.0_wp - (g*t%w)**2)
      by_w = p(:, 1)*f%ae_w + p(:, 2)*rod%length + p(:, 5)
      by_phi = p(:, 1)*f%ae_phi + p(:, 2)*f%an_phi + p(:, 3)
      ! Of the rod alone, rows fe, fn, phi, alpha, beta, and columns dAe, dAn, phi, alpha, beta, w'; in row 6 the force on x.
      associate (i => whole%rods(whole%rod_of(k))%inertia)
         q(1, :) = [i%m0, 0.0_wp, g2*t%fe_phi, g*t%fe_va + g2*t%fe_a, g*t%fe_vb + g2*t%fe_b, -t%mv + g*t%fe_w]
         q(2, :) = [0.0_wp, i%m0, g2*t%fn_phi, i%a1 + g2*t%fn_a, i%b1 + g2*t%fn_b, i%m1 + g*t%fn_w]
         q(3, :) = [-t%mv, i%m1, g2*t%phi_phi, i%sa + g*t%phi_va + g2*t%phi_a, i%sb + g*t%phi_vb + g2*t%phi_b, &
                    i%m2 + t%mvv + g*t%phi_w]
         q(4, :) = [0.0_wp, i%a1, g2*t%a_phi, i%aa + g2*t%a_a, i%ab + g2*t%a_b, i%sa + g*t%a_w]
         q(5, :) = [0.0_wp, i%b1, g2*t%b_phi, i%ab + g2*t%a_b, i%bb + g2*t%b_b, i%sb + g*t%b_w]
      end associate
      q(:5, 3) = q(:5, 3) + q(:5, 6) ! W' = w' + phi''
      ! The chain: force, moment on phi and beta, force on x.
      call add_row(q(1, :), 1, 1.0_wp)
      call add_row(q(2, :), 2, 1.0_wp)
      call add_row(q(3, :), 2, rod%length)
      call add_row(q(3, :), 3, 1.0_wp)
      call add_row(q(5, :), 3, 1.0_wp)
      q(6, :) = 0.0_wp
      call add_row(q(6, :), 4, 1.0_wp)
      ! phi, alpha, beta by t, y, z.
      map = reshape([1.0_wp, 0.0_wp, 0.0_wp, rod%turn_y, rod%bend_y, rod%turn_z, rod%bend_z], [3, 3])
      q(:, 3:5) = matmul(q(:, 3:5), map)
      q(:, 5) = q(:, 5) + [p(1, 4), p(2, 4), rod%length*p(2, 4) + p(3, 4), 0.0_wp, p(3, 4), p(4, 4)]
      s(1:2, :) = q(1:2, :)
      s(3:5, :) = matmul(transpose(map), q(3:5, :))
      s(5, :) = s(5, :) + q(6, :)

   contains

      !> Add a multiple of row i of the chain, by the unknowns of this rod.
      pure subroutine add_row(row, i, factor)
         real(wp), intent(inout) :: row(6)
         integer, intent(in) :: i
         real(wp), intent(in) :: factor
         row = row + factor*[p(i, 1), p(i, 2), by_phi(i), 0.0_wp, p(i, 3), by_w(i)]
      end subroutine add_row

   end subroutine rod_equations

   !> From the axes of rod k to those of rod k - 1.
   pure subroutine turn_axes(cd, sd, p)
      real(wp), intent(in) :: cd, sd
      real(wp), intent(inout) :: p(4, 5)
      real(wp) :: column(4), row(5)

      column = cd*p(:, 1) - sd*p(:, 2)
      p(:, 2) = sd*p(:, 1) + cd*p(:, 2)
      p(:, 1) = column
      row = cd*p(1, :) - sd*p(2, :)
      p(2, :) = sd*p(1, :) + cd*p(2, :)
      p(1, :) = row
   end subroutine turn_axes

   !> Inward pass of a solution: known changes dq0, dp0 as forces on hinge 0.
   pure subroutine reduce_condensed(newton, scene, hinges, tangent, dq, dp, known)
      type(condensed_newton), intent(inout) :: newton
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      type(rod_tangent), intent(in) :: tangent(:)
      real(wp), intent(in) :: dq(:), dp(:)  !! (n_dof)
      real(wp), intent(out) :: known(3)     !! force, moving axes, and moment
      real(wp) :: b(4), rows(5), force(0:scene%n), d_omega, dw, turned, along, across
      integer :: k

      d_omega = 0.0_wp
      if (scene%n_base > 0) d_omega = dp(3)
      call expand_slopes(scene, hinges, dq, newton%whole_q)
      call expand_slopes(scene, hinges, dp, newton%whole_p)
      call spring_forces(scene, hinges, dq, dp, force)
      b = 0.0_wp
      do k = scene%n, 1, -1
         associate (t => tangent(k), f => newton%factor(k), rod => newton%rods(k), phi => dq(scene%phi_at() + k))
            dw = d_omega + dp(scene%phi_at() + k)
            along = -rod%length*(2.0_wp*t%w*dw + t%wr*phi)
            across = -rod%length*t%w**2*phi
            b = b + f%outer(:, 1)*along + f%outer(:, 2)*across
            rows = known_rows(t, dw, phi, newton%whole_q(scene%alpha_at() + k), newton%whole_q(scene%beta_at() + k), &
                              newton%whole_p(scene%alpha_at() + k), newton%whole_p(scene%beta_at() + k))
            rows = rows + [b(1), b(2), rod%length*b(2) + b(3), 0.0_wp, b(3)]
            f%z0 = -f%softness*(rod%turn_z*rows(3) + dot_product(rod%bend_z, rows(4:5)) + b(4) + force(k))
            b = [rows(1:3), rod%turn_y*rows(3) + dot_product(rod%bend_y, rows(4:5))] + f%column*f%z0
            turned = t%cd*b(1) - t%sd*b(2)
            b(2) = t%sd*b(1) + t%cd*b(2)
            b(1) = turned
         end associate
      end do
      newton%root%z0 = -newton%root%softness*(b(4) + force(0))
      known = b(1:3) + newton%root%column(1:3)*newton%root%z0
   end subroutine reduce_condensed

   !> What known changes put on the joints: C th + D th'. Of the rods' bending the rows of alpha and beta know.
   pure subroutine spring_forces(scene, hinges, dq, dp, force)
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      real(wp), intent(in) :: dq(:), dp(:)
      real(wp), intent(out) :: force(0:) !! (0:n) [N m]
      real(wp), dimension(0:scene%n - 1) :: theta, theta_rate

      call openings(scene%n, .false., dq(scene%phi_at() + 1:), theta)
      call openings(scene%n, .false., dp(scene%phi_at() + 1:), theta_rate)
      call hinges%series%solve(theta)
      call hinges%series%solve(theta_rate)
      force(:scene%n - 1) = merge(0.0_wp, hinges%stiffness*theta + hinges%damping*theta_rate, hinges%locked)
      force(scene%n) = 0.0_wp
   end subroutine spring_forces

   !> Rows fe, fn, phi, alpha, beta of a rod for known changes.
   pure function known_rows(t, dw, phi, alpha, beta, alpha_rate, beta_rate) result(rows)
      type(rod_tangent), intent(in) :: t
      real(wp), intent(in) :: dw, phi, alpha, beta, alpha_rate, beta_rate
      real(wp) :: rows(5)

      rows(1) = t%fe_w*dw + t%fe_phi*phi + t%fe_va*alpha_rate + t%fe_vb*beta_rate + t%fe_a*alpha + t%fe_b*beta
      rows(2) = t%fn_w*dw + t%fn_phi*phi + t%fn_a*alpha + t%fn_b*beta
      rows(3) = t%phi_w*dw + t%phi_phi*phi + t%phi_va*alpha_rate + t%phi_vb*beta_rate + t%phi_a*alpha + t%phi_b*beta
      rows(4) = t%a_w*dw + t%a_phi*phi + t%a_a*alpha + t%a_b*beta
      rows(5) = t%b_w*dw + t%b_phi*phi + t%a_b*alpha + t%b_b*beta
   end function known_rows

   !> Outward pass: the unknowns of all rods from the motion of hinge 0.
   pure subroutine expand_condensed(newton, scene, tangent, dq, dp, omega_rate, hinge, phi)
      type(condensed_newton), intent(in) :: newton
      type(scene_type), intent(in) :: scene
      type(rod_tangent), intent(in) :: tangent(:)
      real(wp), intent(in) :: dq(:), dp(:)  !! as for reduce_condensed
      real(wp), intent(in) :: omega_rate    !! change of w'
      real(wp), intent(in) :: hinge(2)      !! dA of hinge 0, moving axes
      real(wp), intent(out) :: phi(:)       !! change of phi'' (n)
      real(wp) :: ae, an, along, turn, y, z, dw, d_omega
      integer :: k

      d_omega = 0.0_wp
      if (scene%n_base > 0) d_omega = dp(3)
      ae = hinge(1)
      an = hinge(2)
      turn = 0.0_wp
      associate (f => newton%root)
         y = f%z0 - (f%by(1)*ae + f%by(2)*an + f%by(5)*omega_rate)
      end associate
      do k = 1, scene%n
         associate (t => tangent(k), f => newton%factor(k), rod => newton%rods(k), known => dq(scene%phi_at() + k))
            along = t%cd*ae + t%sd*an
            an = t%cd*an - t%sd*ae
            ae = along
            z = f%z0 - (f%by(1)*ae + f%by(2)*an + f%by(3)*turn + f%by(4)*y + f%by(5)*omega_rate)
            phi(k) = turn + rod%turn_y*y + rod%turn_z*z
            turn = turn + rod%out_y*y + rod%out_z*z
            y = z
            dw = d_omega + dp(scene%phi_at() + k)
            ae = ae - rod%length*(2.0_wp*t%w*dw + t%wr*known) + f%ae_w*omega_rate + f%ae_phi*phi(k)
            an = an - rod%length*t%w**2*known + rod%length*omega_rate + f%an_phi*phi(k)
         end associate
      end do
   end subroutine expand_condensed

end module rodyn_newton_condensed
