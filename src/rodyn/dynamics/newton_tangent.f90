!> The equations of each rod linearised at a state, in the axes of the rod: what the Newton matrix is made of.
!>
!> The same derivatives as in `rodyn_linearisation`, as coefficients instead of directional derivatives. Changes of
!> the force on the inner node (along e and across n) and of the rows of phi, alpha, beta are
!>     M (dAe, dAn, dW', dalpha'', dbeta'') + G (dW, dalpha', dbeta') + K (dphi, dalpha, dbeta)
!> with M of docs/model.md sec. 3. The tangent holds G and K, whose columns of phi contain that forces turn with the rod.
!> The same equations elsewhere: docs/model.md sec. 7.
module rodyn_newton_tangent
   use rodyn_kinds, only: wp
   use rodyn_scene, only: scene_type
   use rodyn_rod_constants, only: rod_constants
   implicit none (type, external)
   private
   public :: rod_tangent, linearise_rods

   !> Coefficients of one rod: row_column, rates of alpha and beta as va, vb.
   type :: rod_tangent
      real(wp) :: cd = 1.0_wp, sd = 0.0_wp !! cosine and sine of the turn from the axes of rod k - 1
      real(wp) :: w = 0.0_wp, wr = 0.0_wp  !! W, W' [rad/s], [rad/s^2]
      real(wp) :: mv = 0.0_wp, mvv = 0.0_wp !! int m v, int m v^2 [kg m], [kg m^2]
      real(wp) :: fe_w = 0.0_wp, fn_w = 0.0_wp, phi_w = 0.0_wp, a_w = 0.0_wp, b_w = 0.0_wp
      real(wp) :: fe_va = 0.0_wp, fe_vb = 0.0_wp, phi_va = 0.0_wp, phi_vb = 0.0_wp
      real(wp) :: fe_phi = 0.0_wp, fn_phi = 0.0_wp, phi_phi = 0.0_wp, a_phi = 0.0_wp, b_phi = 0.0_wp
      real(wp) :: fe_a = 0.0_wp, fe_b = 0.0_wp, fn_a = 0.0_wp, fn_b = 0.0_wp, phi_a = 0.0_wp, phi_b = 0.0_wp
      real(wp) :: a_a = 0.0_wp, a_b = 0.0_wp, b_b = 0.0_wp !! symmetric: b_a = a_b
   end type rod_tangent

contains

   !> Coefficients of all rods.
   pure subroutine linearise_rods(scene, sine, cosine, q, p, a, loaded, node_force, tangent)
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: sine(0:), cosine(0:) !! of phi (0:n); 0 and 1 at 0
      real(wp), intent(in) :: q(:), p(:)           !! state (dof)
      real(wp), intent(in) :: a(:)                 !! accelerations p' there (dof)
      logical, intent(in) :: loaded                !! node_force is to be used
      real(wp), intent(in) :: node_force(:, :)     !! X, Y at the nodes (2, n) [N]
      type(rod_tangent), intent(inout) :: tangent(:) !! (n)
      real(wp) :: ae(scene%n), an(scene%n) ! acceleration of the inner node, axes of the rod

      call accelerate_nodes(scene, sine, cosine, q, p, a, tangent, ae, an)
      call differentiate_rods(scene, sine, cosine, q, p, a, loaded, node_force, ae, an, tangent)
   end subroutine linearise_rods

   !> Outward: W, W' and the accelerations A_k = A_{k-1} + l n W' - l W^2 e of the nodes.
   pure subroutine accelerate_nodes(scene, sine, cosine, q, p, a, tangent, ae, an)
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: sine(0:), cosine(0:), q(:), p(:), a(:)
      type(rod_tangent), intent(inout) :: tangent(:)
      real(wp), intent(out) :: ae(:), an(:)
      real(wp) :: omega, omega_rate, along, across
      integer :: k

      omega = 0.0_wp
      omega_rate = 0.0_wp
      along = 0.0_wp
      across = 0.0_wp
      if (scene%n_base > 0) then
         omega = p(3)
         omega_rate = a(3)
         associate (x => scene%body%hinge_x, y => scene%body%hinge_y)
            along = a(1) - omega*p(2) - omega_rate*y - omega**2*x
            across = a(2) + omega*p(1) + omega_rate*x - omega**2*y
         end associate
      end if
      do k = 1, scene%n
         associate (t => tangent(k), length => scene%rods(scene%rod_of(k))%length)
            t%cd = cosine(k)*cosine(k - 1) + sine(k)*sine(k - 1)
            t%sd = sine(k)*cosine(k - 1) - cosine(k)*sine(k - 1)
            t%w = omega + p(scene%phi_at() + k)
            t%wr = omega_rate + a(scene%phi_at() + k)
            ae(k) = t%cd*along + t%sd*across
            an(k) = t%cd*across - t%sd*along
            along = ae(k) - length*t%w**2
            across = an(k) + length*t%wr
         end associate
      end do
   end subroutine accelerate_nodes

   !> Inward: the force on the outer node of each rod, which turns with it, and the rod's own terms.
   pure subroutine differentiate_rods(scene, sine, cosine, q, p, a, loaded, node_force, ae, an, tangent)
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: sine(0:), cosine(0:), q(:), p(:), a(:)
      logical, intent(in) :: loaded
      real(wp), intent(in) :: node_force(:, :), ae(:), an(:)
      type(rod_tangent), intent(inout) :: tangent(:)
      real(wp) :: fe, fn, turned
      integer :: k

      fe = 0.0_wp
      fn = 0.0_wp
      do k = scene%n, 1, -1
         associate (t => tangent(k), rod => scene%rods(scene%rod_of(k)), mu => scene%node_mass(k))
            fe = fe + mu*(ae(k) - rod%length*t%w**2)
            fn = fn + mu*(an(k) + rod%length*t%wr)
            if (loaded) then
               fe = fe - (node_force(1, k)*cosine(k) + node_force(2, k)*sine(k))
               fn = fn - (node_force(2, k)*cosine(k) - node_force(1, k)*sine(k))
            end if
            t%phi_phi = -rod%length*fe
            if (.not. scene%lumped) call differentiate_rod(scene, k, q, p, a, ae(k), an(k), fe, fn, t)
            turned = t%cd*fe - t%sd*fn
            fn = t%sd*fe + t%cd*fn
            fe = turned
         end associate
      end do
   end subroutine differentiate_rods

   !> Coefficients of a rod with mass, and its force on the inner node added to (fe, fn).
   pure subroutine differentiate_rod(scene, k, q, p, a, ae, an, fe, fn, t)
      type(scene_type), intent(in) :: scene
      integer, intent(in) :: k
      real(wp), intent(in) :: q(:), p(:), a(:), ae, an
      real(wp), intent(inout) :: fe, fn
      type(rod_tangent), intent(inout) :: t
      real(wp) :: alpha, beta, va, vb, mv_rate, along, across, bending, w2

      associate (rod => scene%rods(scene%rod_of(k)), i => scene%rods(scene%rod_of(k))%inertia)
         w2 = t%w**2
         mv_rate = 0.0_wp
         bending = 0.0_wp
         if (scene%dynamic_bending) then
            alpha = q(scene%alpha_at() + k)
            beta = q(scene%beta_at() + k)
            va = p(scene%alpha_at() + k)
            vb = p(scene%beta_at() + k)
            bending = i%a1*a(scene%alpha_at() + k) + i%b1*a(scene%beta_at() + k)
            t%mv = i%a1*alpha + i%b1*beta
            mv_rate = i%a1*va + i%b1*vb
            call differentiate_bending(rod, alpha, beta, va, vb, ae, t)
         end if
         ! Inertia force of the rod without m0 A, which turns with the rod and with A alike.
         along = -w2*i%m1 - t%wr*t%mv - 2.0_wp*t%w*mv_rate
         across = t%wr*i%m1 - w2*t%mv + bending
         t%fe_w = -2.0_wp*(t%w*i%m1 + mv_rate)
         t%fn_w = -2.0_wp*t%w*t%mv
         t%fe_phi = -across
         t%fn_phi = along
         t%phi_phi = t%phi_phi - i%m1*ae - t%mv*an
         fe = fe + i%m0*ae + along
         fn = fn + i%m0*an + across
      end associate

   end subroutine differentiate_rod

   !> Rows and columns of alpha and beta.
   pure subroutine differentiate_bending(rod, alpha, beta, va, vb, ae, t)
      type(rod_constants), intent(in) :: rod
      real(wp), intent(in) :: alpha, beta, va, vb !! slopes and rates
      real(wp), intent(in) :: ae                  !! acceleration of the inner node along the rod
      type(rod_tangent), intent(inout) :: t
      real(wp) :: sx(2), sv(2), w2

      w2 = t%w**2
      associate (i => rod%inertia, w => t%w)
         sx = [rod%second(1)*alpha + rod%second(2)*beta, rod%second(2)*alpha + rod%second(3)*beta]
         sv = [rod%second(1)*va + rod%second(2)*vb, rod%second(2)*va + rod%second(3)*vb]
         t%mvv = alpha*sx(1) + beta*sx(2)
         t%phi_w = 2.0_wp*(alpha*sv(1) + beta*sv(2))
         t%a_w = -2.0_wp*w*(i%aa*alpha + i%ab*beta)
         t%b_w = -2.0_wp*w*(i%ab*alpha + i%bb*beta)
         t%fe_va = -2.0_wp*w*i%a1
         t%fe_vb = -2.0_wp*w*i%b1
         t%phi_va = 2.0_wp*w*sx(1)
         t%phi_vb = 2.0_wp*w*sx(2)
         t%a_phi = -i%a1*ae
         t%b_phi = -i%b1*ae
         t%fe_a = -t%wr*i%a1
         t%fe_b = -t%wr*i%b1
         t%fn_a = -w2*i%a1
         t%fn_b = -w2*i%b1
         t%phi_a = -i%a1*ae + 2.0_wp*(t%wr*sx(1) + w*sv(1))
         t%phi_b = -i%b1*ae + 2.0_wp*(t%wr*sx(2) + w*sv(2))
         t%a_a = rod%stiffness(1) - w2*i%aa
         t%a_b = rod%stiffness(2) - w2*i%ab
         t%b_b = rod%stiffness(3) - w2*i%bb
      end associate
   end subroutine differentiate_bending

end module rodyn_newton_tangent
