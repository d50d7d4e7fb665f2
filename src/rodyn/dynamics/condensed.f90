!> Rods with mass that bend by statics (condensed rods), docs/model.md sec. 5, as rods whose bending is motion.
!>
!> Slopes follow the openings of the hinges by the three-moment equation, (alpha, beta) = S (opening - gamma) + constants, so the
!> rates of all coordinates of the dynamic chain, the whole, are linear in those that are left: with T = (1; S B), constant
!> between events, and what moving kinks add,
!>     p_whole = T p + (0, 0, -S gamma'),   and   T^T (M (T p' - S gamma'') + h - F) = 0
!> are the equations of motion. T and T^T cost O(n) each. The same equations in one pass: `rodyn_recursion_condensed`.
!> The same equations elsewhere: docs/model.md sec. 7.
module rodyn_condensed
   use rodyn_kinds, only: wp
   use rodyn_scene, only: scene_type
   use rodyn_hinge_law, only: hinge_law, openings
   use rodyn_kinematics, only: acceleration_of_hinge_0, slopes
   use rodyn_three_moments, only: slopes_from_moments
   implicit none (type, external)
   private
   public :: whole_scene, whole_state, expand_slopes, reduce_slopes, add_inertia_moments

contains

   !> The scene with slopes as coordinates of their own, whose bending matrices have inertia only. Hinges and loads stay behind.
   pure function whole_scene(scene) result(whole)
      type(scene_type), intent(in) :: scene
      type(scene_type) :: whole
      integer :: j

      whole%n = scene%n
      whole%n_base = scene%n_base
      whole%n_dof = scene%n_base + 3*scene%n
      whole%n_q = whole%n_dof
      whole%consistent = scene%consistent
      whole%body = scene%body
      whole%node_mass = scene%node_mass
      whole%rods = scene%rods
      whole%bending = scene%bending
      whole%rod_of = scene%rod_of
      do j = 1, size(whole%bending)
         whole%bending(j)%stiffness = 0.0_wp
      end do
   end function whole_scene

   !> Coordinates and rates of the whole.
   pure subroutine whole_state(scene, hinges, q, p, whole_q, whole_p)
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      real(wp), intent(in) :: q(:), p(:)                    !! (n_dof)
      real(wp), intent(out) :: whole_q(:), whole_p(:)       !! (n_base + 3 n)
      integer :: a, b

      a = scene%alpha_at()
      b = scene%beta_at()
      whole_q(:a) = q(:a)
      whole_p(:a) = p(:a)
      call slopes(scene, hinges, q, p, whole_q(a + 1:b), whole_q(b + 1:), whole_p(a + 1:b), whole_p(b + 1:))
   end subroutine whole_state

   !> T x: changes of the coordinates (or rates) of the whole; with kinks that change by themselves, T x - S kink.
   pure subroutine expand_slopes(scene, hinges, x, whole, kink)
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      real(wp), intent(in) :: x(:)                !! (n_dof)
      real(wp), intent(out) :: whole(:)           !! (n_base + 3 n)
      real(wp), intent(in), optional :: kink(0:)  !! (0:n-1)
      real(wp) :: moment(0:scene%n - 1)

      associate (a => scene%alpha_at(), b => scene%beta_at())
         whole(:a) = x(:a)
         call openings(scene%n, .false., x(scene%phi_at() + 1:), moment)
         if (present(kink)) moment = moment - kink
         call hinges%series%solve(moment)
         moment = moment*merge(1.0_wp, hinges%stiffness, hinges%locked)
         call slopes_from_moments(hinges%series, moment, whole(a + 1:b), whole(b + 1:))
      end associate
   end subroutine expand_slopes

   !> T^T times forces on the coordinates of the whole.
   pure subroutine reduce_slopes(scene, hinges, whole, force)
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      real(wp), intent(in) :: whole(:)  !! (n_base + 3 n)
      real(wp), intent(out) :: force(:) !! (n_dof)
      real(wp) :: moment(0:scene%n)
      integer :: k

      associate (a => scene%alpha_at(), b => scene%beta_at(), f => scene%phi_at())
         call moments_of_slopes(hinges, whole(a + 1:b), whole(b + 1:), moment)
         force = whole(:a)
         do k = 1, scene%n
            force(f + k) = force(f + k) + (moment(k - 1) - moment(k))
         end do
      end associate
   end subroutine reduce_slopes

   !> S^T times forces on the slopes: the moments in the hinges that go with them, on top of those of springs and dampers.
   pure subroutine moments_of_slopes(hinges, on_alpha, on_beta, moment)
      type(hinge_law), intent(in) :: hinges
      real(wp), intent(in) :: on_alpha(:), on_beta(:) !! (n) [N m]
      real(wp), intent(out) :: moment(0:)             !! (0:n) [N m]
      integer :: k

      moment = 0.0_wp
      do k = 1, hinges%n
         associate (f => hinges%series%flexibility(:, k))
            moment(k - 1) = moment(k - 1) + (f(2)*on_beta(k) - f(1)*on_alpha(k))
            moment(k) = f(3)*on_beta(k) - f(2)*on_alpha(k)
         end associate
      end do
      moment(:hinges%n - 1) = moment(:hinges%n - 1)*merge(1.0_wp, hinges%stiffness, hinges%locked)
      moment(hinges%n) = 0.0_wp
      call hinges%series%solve_transposed(moment)
   end subroutine moments_of_slopes

   !> Moments in the hinges: on top of those of springs and dampers, what the inertia of rods that bend takes.
   pure subroutine add_inertia_moments(scene, hinges, q, p, a, moment)
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      real(wp), intent(in) :: q(:), p(:), a(:)     !! state and accelerations (n_dof)
      real(wp), intent(inout) :: moment(0:)        !! T (0:n) [N m]
      real(wp), dimension(scene%n_base + 3*scene%n) :: whole_q, whole_p, whole_a
      real(wp) :: node(2), axis(2), normal(2), w, w_rate, row(2), on_alpha(scene%n), on_beta(scene%n), added(0:scene%n)
      integer :: k

      call whole_state(scene, hinges, q, p, whole_q, whole_p)
      call expand_slopes(scene, hinges, a, whole_a, hinges%kink_acceleration)
      node = acceleration_of_hinge_0(scene, p, a)
      do k = 1, scene%n
         axis = [cos(q(scene%phi_at() + k)), sin(q(scene%phi_at() + k))]
         normal = [-axis(2), axis(1)]
         w = p(scene%phi_at() + k)
         w_rate = a(scene%phi_at() + k)
         if (scene%n_base > 0) then
            w = w + p(3)
            w_rate = w_rate + a(3)
         end if
         associate (bend => scene%bending(scene%rod_of(k)), alpha => scene%alpha_at() + k, beta => scene%beta_at() + k, &
                    length => scene%rods(scene%rod_of(k))%length)
            row = bend%first(:2)*dot_product(node, normal) + bend%turning(:2)*w_rate + &
                  matmul(bend%inertia(:2, :2), [whole_a(alpha) - w**2*whole_q(alpha), whole_a(beta) - w**2*whole_q(beta)])
            node = node + length*(w_rate*normal - w**2*axis)
         end associate
         on_alpha(k) = row(1)
         on_beta(k) = row(2)
      end do
      call moments_of_slopes(hinges, on_alpha, on_beta, added)
      moment(0:scene%n) = moment(0:scene%n) + added
   end subroutine add_inertia_moments

end module rodyn_condensed
