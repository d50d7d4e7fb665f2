!> The article's system  M(q) p' + N(q) z + D p + K q = Q1 + Q2  in full, docs/model.md sec. 3: O(n^3).
!>
!> Written independently of the recursion, as the second route to the same accelerations. For the columns of N,
!>     z = (w Vx, w Vy, w^2, phi_m'(2 w + phi_m'), (w + phi_m') alpha_m', (w + phi_m') beta_m'),  m = 1..n;
!> the article joins the last two for uniform rods, where int m Na = -int m Nb. On a fixed spacecraft the first
!> three rows and columns are absent. Bubbles stand behind beta and are treated like alpha and beta. For massless rods
!> all rod integrals are zero. Locked hinges: `rodyn_locks`. The same equations elsewhere: docs/model.md sec. 7.
module rodyn_assembled
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type, raise
   use rodyn_scene, only: scene_type
   use rodyn_hinge_law, only: hinge_law
   use rodyn_bending_matrices, only: most_shapes
   use rodyn_condensed, only: whole_scene, whole_state, expand_slopes
   use rodyn_assembled_rods, only: n_map_rows, sum_rods
   use rodyn_locks, only: has_slaves, reduce, expand, reduce_matrix, reactions
   use rodyn_lapack, only: dpotrf, dpotrs, dgesv, dgemv
   use rodyn_text, only: formatted
   implicit none (type, external)
   private
   public :: assembled_system, new_assembled_system, mass_matrix, assembled_accelerations

   !> The constant matrices, and memory for the others.
   type :: assembled_system
      real(wp), allocatable :: k(:, :)  !! K, stiffness (dof, dof)
      real(wp), allocatable :: d(:, :)  !! D, damping (dof, dof)
      real(wp), allocatable :: q2(:)    !! Q2, moments of the kinks (dof)
      real(wp), allocatable :: m(:, :)  !! M, or its Cholesky factor: lower triangle
      real(wp), allocatable :: n(:, :)  !! N (dof, size of z)
      real(wp), allocatable :: z(:)     !! z
      real(wp), allocatable :: row(:)   !! row of w of M (dof)
      real(wp), allocatable :: maps(:, :) !! memory of `sum_rods`, `inextensible` only
      real(wp), allocatable :: static(:, :) !! S_k, first moment outboard (2, n) [kg m]
      real(wp), allocatable :: axial(:, :)  !! X_k, the same turned by -90 degrees (2, n) [kg m]
      real(wp), allocatable :: outboard(:)  !! mass beyond rod k (0:n) [kg]
      type(scene_type), allocatable :: whole     !! condensed rods: the chain whose slopes are coordinates (`rodyn_condensed`),
      real(wp), allocatable :: whole_m(:, :)     !! its M; n, z and row are of its size, too
      real(wp), allocatable :: expansion(:, :)   !! T, its rates by those of the scene
      logical :: damped = .false.       !! D is not zero
      logical :: kinked = .false.       !! Q2 is not zero
      logical :: moving = .false.       !! Q2 changes: it is made of the moments of openings and rates that are zero
   end type assembled_system

contains

   !> Constant matrices of a scene. Fails if there is no memory for O(n^2) numbers.
   subroutine new_assembled_system(system, scene, hinges, error)
      type(assembled_system), intent(out) :: system
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: b(:, :), c(:, :), r(:, :)
      real(wp) :: factor(0:scene%n - 1), angle(0:scene%n - 1)
      integer :: status, n_dof, n, k, n_whole

      n = scene%n
      n_dof = scene%n_dof
      n_whole = n_dof
      if (scene%condensed) n_whole = n_dof + 2*n
      allocate (system%k(n_dof, n_dof), system%d(n_dof, n_dof), system%m(n_dof, n_dof), system%n(n_whole, n_whole), &
                system%z(n_whole), system%row(n_whole), system%q2(n_dof), &
                system%static(2, n), system%axial(2, n), system%outboard(0:n), &
                b(0:n - 1, n_dof), c(0:n - 1, n_dof), r(0:n - 1, n_dof), stat=status)
      if (status == 0 .and. scene%inextensible) allocate (system%maps(n_map_rows, n_dof), stat=status)
      if (status /= 0) then
         call raise(error, "kernel = 'assembled' needs "//formatted(4.75_wp*8.0_wp*real(n_dof, wp)**2/1024.0_wp**3, '(f0.1)')// &
                    " GiB for this scene; use 'recursive'")
         return
      end if
      system%damped = hinges%has_damping
      system%moving = hinges%driven .or. size(hinges%mechanisms) > 0
      call joint_map(scene, b)
      r = 0.0_wp ! th = r q - r_gamma
      c = b
      if (scene%quasistatic) call soften(scene, hinges, c)
      ! Generalised spring force -K q + Q2 with K = B^T C G B; dampers D = (G B)^T D (G B). A locked hinge has neither;
      ! with quasistatic bending its row of G B is that of its moment.
      associate (law => hinges)
         factor = merge(merge(1.0_wp, 0.0_wp, scene%quasistatic), law%stiffness, law%locked)
         angle = law%kink
         angle(law%held) = angle(law%held) + law%held_at
         do k = 0, n - 1
            r(k, :) = factor(k)*c(k, :)
         end do
         system%k = matmul(transpose(b), r)
         system%q2 = matmul(angle, r)
         system%kinked = any(abs(angle) > 0.0_wp)
         do k = 0, n - 1
            r(k, :) = merge(0.0_wp, law%damping(k), law%locked(k))*c(k, :)
         end do
      end associate
      system%d = matmul(transpose(c), r)
      if (scene%dynamic_bending) call add_bending(scene, system%k)
      if (scene%condensed) call expand_system(system, scene, hinges)
   end subroutine new_assembled_system

   !> The chain whose slopes are coordinates, and T.
   subroutine expand_system(system, scene, hinges)
      type(assembled_system), intent(inout) :: system
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      real(wp) :: unit(scene%n_dof)
      integer :: i

      allocate (system%whole)
      system%whole = whole_scene(scene)
      associate (n_whole => size(system%z))
         allocate (system%whole_m(n_whole, n_whole), system%expansion(n_whole, scene%n_dof))
      end associate
      unit = 0.0_wp
      do i = 1, scene%n_dof
         unit(i) = 1.0_wp
         call expand_slopes(scene, hinges, unit, system%expansion(:, i))
         unit(i) = 0.0_wp
      end do
   end subroutine expand_system

   !> Constant map B from q to the openings of hinges 0..n-1.
   subroutine joint_map(scene, b)
      type(scene_type), intent(in) :: scene
      real(wp), intent(out) :: b(0:, :)
      integer :: k

      b = 0.0_wp
      do k = 0, scene%n - 1
         b(k, scene%phi_at() + k + 1) = 1.0_wp
         if (k > 0) b(k, scene%phi_at() + k) = -1.0_wp
         if (.not. scene%dynamic_bending) cycle
         b(k, scene%alpha_at() + k + 1) = 1.0_wp
         if (k > 0) b(k, scene%beta_at() + k) = -1.0_wp
      end do
   end subroutine joint_map

   !> Quasistatic bending: G B with G = (I + F C)^-1, F the flexibility of the rods (three moments). Of a locked hinge
   !> the moment is the unknown and th is given: its column is that of F alone.
   subroutine soften(scene, hinges, b)
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      real(wp), intent(inout) :: b(0:, :)
      real(wp) :: g(0:scene%n - 1, 0:scene%n - 1), c(0:scene%n - 1)
      integer :: pivots(scene%n), info, k

      g = 0.0_wp
      c = merge(1.0_wp, hinges%stiffness, hinges%locked)
      do k = 0, scene%n - 1
         if (.not. hinges%locked(k)) g(k, k) = 1.0_wp
      end do
      do k = 1, scene%n
         associate (f => scene%rods(scene%rod_of(k))%flexibility)
            g(k - 1, k - 1) = g(k - 1, k - 1) + f(1)*c(k - 1)
            if (k == scene%n) cycle
            g(k, k) = g(k, k) + f(3)*c(k)
            g(k - 1, k) = f(2)*c(k)
            g(k, k - 1) = f(2)*c(k - 1)
         end associate
      end do
      call dgesv(scene%n, scene%n_dof, g, scene%n, pivots, b, scene%n, info)
   end subroutine soften

   !> Bending stiffness of the rods.
   subroutine add_bending(scene, stiffness)
      type(scene_type), intent(in) :: scene
      real(wp), intent(inout) :: stiffness(:, :)
      integer :: i, j, k

      do k = 1, scene%n
         do j = 1, scene%n_bend
            do i = 1, scene%n_bend
               associate (element => stiffness(scene%bend_at(i) + k, scene%bend_at(j) + k))
                  element = element + scene%bending(scene%rod_of(k))%stiffness(i, j)
               end associate
            end do
         end do
      end do
   end subroutine add_bending

   !> p' from M p' = Q1 + Q2 - N z - D p - K q by Cholesky.
   subroutine assembled_accelerations(system, scene, hinges, sine, cosine, q, p, moment, opening_acceleration, base_force, &
                                      loaded, node_force, acceleration, ok)
      type(assembled_system), intent(inout) :: system
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      real(wp), intent(in) :: sine(0:), cosine(0:) !! of phi (0:n)
      real(wp), intent(in) :: q(:), p(:)           !! coordinates and rates (dof)
      real(wp), intent(inout) :: moment(0:)        !! hinge moments (0:n), used if hinges relax: T is then no K q + D p;
                                                   !! of zero openings and rates, if hinges move;
                                                   !! those of locked hinges are results unless bending is quasistatic
      real(wp), intent(in) :: opening_acceleration(0:) !! of locked hinges, given (0:n-1) [rad/s^2]
      real(wp), intent(in) :: base_force(3)        !! X_C, Y_C, M_C
      logical, intent(in) :: loaded                !! node_force is to be used
      real(wp), intent(in) :: node_force(2, *)     !! X, Y at the nodes [N]
      real(wp), intent(out) :: acceleration(:)     !! p' (dof)
      logical, intent(out) :: ok                   !! false: M not positive definite, or not finite
      integer :: info, n_dof

      n_dof = scene%n_dof
      if (scene%condensed) then
         call condensed_forces(system, scene, hinges, sine, cosine, q, p, base_force, loaded, node_force, acceleration)
      else
         call form_mass(system, scene, sine, cosine, q)
         call inertia_forces(system, scene, sine, cosine, q, p, base_force, loaded, node_force, acceleration)
      end if
      if (size(hinges%relaxing) > 0) then
         associate (first => scene%phi_at() + 1, n => scene%n)
            acceleration(first:) = acceleration(first:) + moment(1:n) - moment(0:n - 1)
         end associate
      else
         if (system%moving) then
            call add_moments(scene, hinges, moment, acceleration)
         else if (system%kinked) then
            acceleration = acceleration + system%q2
         end if
         call dgemv('N', n_dof, n_dof, -1.0_wp, system%k, n_dof, q, 1, 1.0_wp, acceleration, 1)
         if (system%damped) call dgemv('N', n_dof, n_dof, -1.0_wp, system%d, n_dof, p, 1, 1.0_wp, acceleration, 1)
      end if
      if (has_slaves(hinges)) then
         call solve_locked(system, scene, hinges%locked, opening_acceleration, acceleration, moment, ok)
         return
      end if
      call dpotrf('L', n_dof, system%m, n_dof, info)
      ok = info == 0
      if (.not. ok) return
      call dpotrs('L', n_dof, 1, system%m, n_dof, acceleration, n_dof, info)
      ok = info == 0 .and. all(ieee_is_finite(acceleration))
   end subroutine assembled_accelerations

   !> Q1 - N z; M must be current.
   subroutine inertia_forces(system, scene, sine, cosine, q, p, base_force, loaded, node_force, force)
      type(assembled_system), intent(inout) :: system
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: sine(0:), cosine(0:)
      real(wp), intent(in) :: q(:), p(:)
      real(wp), intent(in) :: base_force(3)
      logical, intent(in) :: loaded
      real(wp), intent(in) :: node_force(2, *)
      real(wp), intent(out) :: force(:) !! (dof)

      if (scene%inextensible) then
         call sum_rods(scene, sine, cosine, q, p, loaded, node_force, system%maps, system%m, force)
         if (scene%n_base > 0) force(1:3) = force(1:3) + base_force
         return
      end if
      call gyration_matrix(system, scene, sine, cosine, q)
      call quadratic_rates(scene, p, system%z)
      force = 0.0_wp
      if (scene%n_base > 0) force(1:3) = base_force
      if (loaded) call add_node_forces(scene, sine, cosine, node_force, force)
      associate (n_dof => scene%n_dof)
         call dgemv('N', n_dof, n_dof, -1.0_wp, system%n, n_dof, system%z, 1, 1.0_wp, force, 1)
      end associate
   end subroutine inertia_forces

   !> The same of condensed rods, T^T (Q1 - N z - M a) with the accelerations a that kinks add to the slopes, and T^T M T.
   subroutine condensed_forces(system, scene, hinges, sine, cosine, q, p, base_force, loaded, node_force, force)
      type(assembled_system), intent(inout) :: system
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      real(wp), intent(in) :: sine(0:), cosine(0:)
      real(wp), intent(in) :: q(:), p(:)
      real(wp), intent(in) :: base_force(3)
      logical, intent(in) :: loaded
      real(wp), intent(in) :: node_force(2, *)
      real(wp), intent(out) :: force(:) !! (dof)
      real(wp), dimension(size(system%z)) :: whole_q, whole_p, whole_force, given
      real(wp), allocatable :: reduced(:, :)
      real(wp) :: still(scene%n_dof)

      call whole_state(scene, hinges, q, p, whole_q, whole_p)
      still = 0.0_wp
      call expand_slopes(scene, hinges, still, given, hinges%kink_acceleration)
      call move_alloc(system%m, reduced)
      call move_alloc(system%whole_m, system%m)
      call form_mass(system, system%whole, sine, cosine, whole_q)
      call inertia_forces(system, system%whole, sine, cosine, whole_q, whole_p, base_force, loaded, node_force, whole_force)
      force = matmul(whole_force - matmul(system%m, given), system%expansion)
      reduced(:, :) = matmul(transpose(system%expansion), matmul(system%m, system%expansion))
      call move_alloc(system%m, system%whole_m)
      call move_alloc(reduced, system%m)
   end subroutine condensed_forces

   !> M(q) of a scene into system%m; of condensed rods T^T M T.
   subroutine mass_matrix(system, scene, hinges, sine, cosine, q)
      type(assembled_system), intent(inout) :: system
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      real(wp), intent(in) :: sine(0:), cosine(0:) !! of phi (0:n)
      real(wp), intent(in) :: q(:)                 !! coordinates (dof)
      real(wp), dimension(scene%n_dof) :: rest, force
      real(wp), parameter :: none(3) = 0.0_wp, nowhere(2, 1) = 0.0_wp

      if (.not. scene%condensed) then
         call form_mass(system, scene, sine, cosine, q)
         return
      end if
      rest = 0.0_wp
      call condensed_forces(system, scene, hinges, sine, cosine, q, rest, none, .false., nowhere, force)
   end subroutine mass_matrix

   !> Forces of moments T(0:n) in the hinges, T(n) = 0, but those of locked hinges that `solve_locked` finds.
   pure subroutine add_moments(scene, hinges, moment, force)
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      real(wp), intent(in) :: moment(0:)
      real(wp), intent(inout) :: force(:)
      real(wp) :: inner, outer
      integer :: k

      outer = 0.0_wp
      do k = scene%n, 1, -1
         inner = moment(k - 1)
         if (hinges%locked(k - 1) .and. .not. scene%quasistatic) inner = 0.0_wp
         force(scene%phi_at() + k) = force(scene%phi_at() + k) + outer - inner
         if (scene%dynamic_bending) then
            force(scene%alpha_at() + k) = force(scene%alpha_at() + k) - inner
            force(scene%beta_at() + k) = force(scene%beta_at() + k) + outer
         end if
         outer = inner
      end do
   end subroutine add_moments

   !> The same with locked hinges: with p' = T z + a, a the part that is given, T^T M T z = T^T (forces - M a). N and its
   !> z are used up.
   subroutine solve_locked(system, scene, locked, opening_acceleration, x, moment, ok)
      type(assembled_system), intent(inout) :: system
      type(scene_type), intent(in) :: scene
      logical, intent(in) :: locked(0:)
      real(wp), intent(in) :: opening_acceleration(0:)
      real(wp), intent(inout) :: x(:)       !! in: forces; out: p'
      real(wp), intent(inout) :: moment(0:) !! of locked hinges: results
      logical, intent(out) :: ok
      integer :: info, n_dof

      n_dof = scene%n_dof
      associate (mass => system%n, forces => system%row, lacking => system%z)
         mass = system%m
         forces = x
         x = 0.0_wp
         call expand(scene, locked, opening_acceleration, x)
         lacking = forces
         call dgemv('N', n_dof, n_dof, -1.0_wp, mass, n_dof, x, 1, 1.0_wp, lacking, 1)
         call reduce(scene, locked, lacking)
         call reduce_matrix(scene, locked, 1.0_wp, system%m)
         call dpotrf('L', n_dof, system%m, n_dof, info)
         ok = info == 0
         if (.not. ok) return
         call dpotrs('L', n_dof, 1, system%m, n_dof, lacking, n_dof, info)
         x = lacking
         call expand(scene, locked, opening_acceleration, x)
         lacking = -forces
         call dgemv('N', n_dof, n_dof, 1.0_wp, mass, n_dof, x, 1, 1.0_wp, lacking, 1)
         call reactions(scene, locked, lacking, moment)
      end associate
      ok = info == 0 .and. all(ieee_is_finite(x))
   end subroutine solve_locked

   !> z of the article for the rates p.
   pure subroutine quadratic_rates(scene, p, z)
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: p(:)
      real(wp), intent(out) :: z(:)
      real(wp) :: w
      integer :: i, k

      w = 0.0_wp
      if (scene%n_base > 0) then
         w = p(3)
         z(1:3) = [w*p(1), w*p(2), w*w]
      end if
      do k = 1, scene%n
         associate (phi_rate => p(scene%phi_at() + k))
            z(scene%phi_at() + k) = phi_rate*(2.0_wp*w + phi_rate)
            do i = 1, scene%n_bend
               z(scene%bend_at(i) + k) = (w + phi_rate)*p(scene%bend_at(i) + k)
            end do
         end associate
      end do
   end subroutine quadratic_rates

   !> Loads at the nodes in the rows of Q1: node k moves with V, w and phi_1..phi_k.
   pure subroutine add_node_forces(scene, sine, cosine, node_force, row)
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: sine(0:), cosine(0:)
      real(wp), intent(in) :: node_force(2, *)
      real(wp), intent(inout) :: row(:)
      real(wp) :: force(2), turn
      integer :: k

      force = 0.0_wp
      turn = 0.0_wp
      do k = scene%n, 1, -1
         force = force + node_force(:, k)
         associate (length => scene%rods(scene%rod_of(k))%length)
            row(scene%phi_at() + k) = row(scene%phi_at() + k) + length*(force(2)*cosine(k) - force(1)*sine(k))
            turn = turn + length*(force(2)*cosine(k) - force(1)*sine(k))
         end associate
      end do
      if (scene%n_base == 0) return
      row(1:2) = row(1:2) + force
      row(3) = row(3) + turn + scene%body%hinge_x*force(2) - scene%body%hinge_y*force(1)
   end subroutine add_node_forces

   !> Lower triangle and upper triangle of M(q) into system%m, with the first moments it is made of.
   !>
   !> With absolute rotations Phi_k = theta + phi_k, the outboard part moves by S_k^perp = S_k dPhi_k,
   !>     S_k = (m1 + l M_out) n_k - int m v e_k;
   !> the row of w is the row of the spacecraft's own rotation plus those of all Phi_k.
   subroutine form_mass(system, scene, sine, cosine, q)
      type(assembled_system), intent(inout) :: system
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: sine(0:), cosine(0:) !! of phi (0:n)
      real(wp), intent(in) :: q(:)                 !! coordinates (dof)
      integer :: i, j, k, fj, fk
      real(wp), parameter :: nowhere(2, 1) = 0.0_wp
      real(wp) :: mvv, normal(2), along, x(most_shapes), curved(most_shapes)

      if (scene%inextensible) then
         system%z = 0.0_wp
         call sum_rods(scene, sine, cosine, q, system%z, .false., nowhere, system%maps, system%m, system%row)
         return
      end if
      associate (m => system%m, n => scene%n)
         m = 0.0_wp
         call first_moments(system, scene, sine, cosine, q)
         do k = 1, n
            fk = scene%phi_at() + k
            x = scene%bends(k, q)
            associate (rod => scene%rods(scene%rod_of(k)), bend => scene%bending(scene%rod_of(k)))
               curved = matmul(bend%second, x)
               mvv = dot_product(x, curved)
               do i = 1, scene%n_bend
                  do j = 1, i
                     call set_pair(m, scene%bend_at(i) + k, scene%bend_at(j) + k, bend%inertia(i, j))
                  end do
                  call set_pair(m, fk, scene%bend_at(i) + k, bend%turning(i))
               end do
               m(fk, fk) = rod%inertia%m2 + mvv + rod%length**2*system%outboard(k)
               do j = 1, k - 1
                  fj = scene%phi_at() + j
                  normal = scene%rods(scene%rod_of(j))%length*[-sine(j), cosine(j)]
                  call set_pair(m, fj, fk, dot_product(normal, system%static(:, k)))
                  along = normal(2)*cosine(k) - normal(1)*sine(k)
                  do i = 1, scene%n_bend
                     call set_pair(m, fj, scene%bend_at(i) + k, bend%first(i)*along)
                  end do
               end do
            end associate
         end do
         if (scene%n_base > 0) call add_spacecraft_rows(system, scene, sine, cosine)
      end associate
   end subroutine form_mass

   !> m(i, j) = m(j, i) = value.
   pure subroutine set_pair(m, i, j, value)
      real(wp), intent(inout) :: m(:, :)
      integer, intent(in) :: i, j
      real(wp), intent(in) :: value
      m(i, j) = value
      m(j, i) = value
   end subroutine set_pair

   !> Outboard masses and first moments.
   pure subroutine first_moments(system, scene, sine, cosine, q)
      type(assembled_system), intent(inout) :: system
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: sine(0:), cosine(0:)
      real(wp), intent(in) :: q(:)
      real(wp) :: arm, mv, x(most_shapes)
      integer :: k

      system%outboard(scene%n) = scene%node_mass(scene%n)
      do k = scene%n, 1, -1
         associate (rod => scene%rods(scene%rod_of(k)), i => scene%rods(scene%rod_of(k))%inertia)
            arm = i%m1 + rod%length*system%outboard(k)
            x = scene%bends(k, q)
            mv = dot_product(scene%bending(scene%rod_of(k))%first, x)
            system%static(:, k) = [-arm*sine(k) - mv*cosine(k), arm*cosine(k) - mv*sine(k)]
            system%axial(:, k) = [system%static(2, k), -system%static(1, k)]
            system%outboard(k - 1) = system%outboard(k) + i%m0 + scene%node_mass(k - 1)
         end associate
      end do
   end subroutine first_moments

   !> Rows and columns of Vx, Vy, w.
   pure subroutine add_spacecraft_rows(system, scene, sine, cosine)
      type(assembled_system), intent(inout) :: system
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: sine(0:), cosine(0:)
      real(wp) :: turned(2), swung(2) !! of hinge 0; of all rods together
      integer :: i, k, x

      associate (m => system%m, row => system%row, n => scene%n, chain => system%outboard(0), body => scene%body)
         turned = [-body%hinge_y, body%hinge_x]
         do k = 1, n
            m(1:2, scene%phi_at() + k) = system%static(:, k)
            do i = 1, scene%n_bend
               m(1:2, scene%bend_at(i) + k) = scene%bending(scene%rod_of(k))%first(i)*[-sine(k), cosine(k)]
            end do
         end do
         ! Row of w: turning the spacecraft about C carries hinge 0 and turns every rod.
         row = 0.0_wp
         do x = 4, scene%n_dof
            row(x) = dot_product(turned, m(1:2, x)) + sum(m(scene%phi_at() + 1:scene%phi_at() + n, x))
         end do
         do x = 1, 2
            swung(x) = sum(m(x, scene%phi_at() + 1:scene%phi_at() + n))
         end do
         row(1:2) = chain*turned + swung
         row(3) = body%inertia + chain*dot_product(turned, turned) + &
                  dot_product(turned, swung) + sum(row(scene%phi_at() + 1:scene%phi_at() + n))
         m(1, 1) = body%mass + chain
         m(2, 2) = body%mass + chain
         m(1:2, 3) = row(1:2)
         m(3, :) = row
         do k = 1, 3
            do x = 1, scene%n_dof
               m(x, k) = m(k, x)
            end do
         end do
      end associate
   end subroutine add_spacecraft_rows

   !> N(q) into system%n; M and its first moments must be current.
   subroutine gyration_matrix(system, scene, sine, cosine, q)
      type(assembled_system), intent(inout) :: system
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: sine(0:), cosine(0:)
      real(wp), intent(in) :: q(:)
      integer :: i, k

      system%n = 0.0_wp
      do i = 1, scene%n
         call centrifugal_column(system, scene, sine, cosine, q, i)
         if (scene%dynamic_bending) call coriolis_columns(system, scene, sine, cosine, q, i)
      end do
      if (scene%n_base == 0) return
      associate (nm => system%n, m => system%m, body => scene%body)
         nm(:, 1) = m(:, 2)  ! w Vx accelerates everything along y
         nm(:, 2) = -m(:, 1) ! w Vy along -x
         ! w^2: hinge 0 falls towards C, and every rod turns with w.
         nm(:, 3) = -(body%hinge_x*m(:, 1) + body%hinge_y*m(:, 2))
         nm(1, 3) = -(body%hinge_x*(m(1, 1) - body%mass) + body%hinge_y*m(1, 2)) ! C itself does not fall
         nm(2, 3) = -(body%hinge_x*m(2, 1) + body%hinge_y*(m(2, 2) - body%mass))
         do k = 1, scene%n
            nm(:, 3) = nm(:, 3) + nm(:, scene%phi_at() + k)
         end do
      end associate
   end subroutine gyration_matrix

   !> Column of phi_i'(2 w + phi_i') (and of W_i^2): points of rod i accelerate by -(s e + v n), all beyond by -l e.
   subroutine centrifugal_column(system, scene, sine, cosine, q, i)
      type(assembled_system), intent(inout) :: system
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: sine(0:), cosine(0:)
      real(wp), intent(in) :: q(:)
      integer, intent(in) :: i
      real(wp) :: inward(2), across, x(most_shapes), pull(most_shapes)
      integer :: j, k, column

      column = scene%phi_at() + i
      associate (nm => system%n, rod_i => scene%rods(scene%rod_of(i)))
         do k = 1, i - 1
            associate (length => scene%rods(scene%rod_of(k))%length)
               nm(scene%phi_at() + k, column) = -length*dot_product([-sine(k), cosine(k)], system%axial(:, i))
            end associate
         end do
         inward = -rod_i%length*[cosine(i), sine(i)]
         do k = i + 1, scene%n
            nm(scene%phi_at() + k, column) = dot_product(system%static(:, k), inward)
            across = inward(2)*cosine(k) - inward(1)*sine(k)
            do j = 1, scene%n_bend
               nm(scene%bend_at(j) + k, column) = scene%bending(scene%rod_of(k))%first(j)*across
            end do
         end do
         x = scene%bends(i, q)
         pull = matmul(scene%bending(scene%rod_of(i))%inertia, x)
         do j = 1, scene%n_bend
            nm(scene%bend_at(j) + i, column) = -pull(j)
         end do
         inward = -system%axial(:, i) ! now of all that lies outboard
         if (scene%n_base > 0) call close_column(system, scene, column, inward)
      end associate
   end subroutine centrifugal_column

   !> Columns of (w + phi_i') alpha_i', beta_i' and so on: points of rod i accelerate by -2 Na e, -2 Nb e ...
   subroutine coriolis_columns(system, scene, sine, cosine, q, i)
      type(assembled_system), intent(inout) :: system
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: sine(0:), cosine(0:)
      real(wp), intent(in) :: q(:)
      integer, intent(in) :: i
      real(wp) :: force(2), x(most_shapes), turn(most_shapes)
      integer :: j, k, column

      x = scene%bends(i, q)
      turn = matmul(scene%bending(scene%rod_of(i))%second, x)
      do j = 1, scene%n_bend
         column = scene%bend_at(j) + i
         force = -2.0_wp*scene%bending(scene%rod_of(i))%first(j)*[cosine(i), sine(i)]
         system%n(scene%phi_at() + i, column) = 2.0_wp*turn(j)
         do k = 1, i - 1
            associate (length => scene%rods(scene%rod_of(k))%length)
               system%n(scene%phi_at() + k, column) = length*dot_product([-sine(k), cosine(k)], force)
            end associate
         end do
         if (scene%n_base > 0) call close_column(system, scene, column, force)
      end do
   end subroutine coriolis_columns

   !> Rows of Vx, Vy, w of a column of N, from the total force and the rows of phi.
   pure subroutine close_column(system, scene, column, force)
      type(assembled_system), intent(inout) :: system
      type(scene_type), intent(in) :: scene
      integer, intent(in) :: column
      real(wp), intent(in) :: force(2)

      system%n(1:2, column) = force
      system%n(3, column) = scene%body%hinge_x*force(2) - scene%body%hinge_y*force(1) + &
                            sum(system%n(scene%phi_at() + 1:scene%phi_at() + scene%n, column))
   end subroutine close_column

end module rodyn_assembled
