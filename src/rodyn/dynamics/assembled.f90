!> The article's system  M(q) p' + N(q) z + D p + K q = Q1 + Q2  in full, MODEL sec. 3: O(n^3).
!>
!> Written independently of the recursion, as the second route to the same accelerations. For the columns of N,
!>     z = (w Vx, w Vy, w^2, phi_m'(2 w + phi_m'), (w + phi_m') alpha_m', (w + phi_m') beta_m'),  m = 1..n;
!> the article joins the last two for uniform rods, where int m Na = -int m Nb. On a fixed spacecraft the first
!> three rows and columns are absent. For massless rods all rod integrals are zero.
module rodyn_assembled
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type, raise
   use rodyn_scene, only: scene_type
   use rodyn_lapack, only: dpotrf, dpotrs, dgesv, dgemv
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
      real(wp), allocatable :: static(:, :) !! S_k, first moment outboard (2, n) [kg m]
      real(wp), allocatable :: axial(:, :)  !! X_k, the same turned by -90 degrees (2, n) [kg m]
      real(wp), allocatable :: outboard(:)  !! mass beyond rod k (0:n) [kg]
      logical :: damped = .false.       !! D is not zero
      logical :: kinked = .false.       !! Q2 is not zero
   end type assembled_system

contains

   !> Constant matrices of a scene. Fails if there is no memory for O(n^2) numbers.
   subroutine new_assembled_system(system, scene, error)
      type(assembled_system), intent(out) :: system
      type(scene_type), intent(in) :: scene
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: b(:, :), c(:, :), r(:, :)
      character(len=32) :: size_text
      integer :: status, n_dof, n, k

      n = scene%n
      n_dof = scene%n_dof
      allocate (system%k(n_dof, n_dof), system%d(n_dof, n_dof), system%m(n_dof, n_dof), system%n(n_dof, n_dof), &
                system%z(n_dof), system%row(n_dof), system%q2(n_dof), &
                system%static(2, n), system%axial(2, n), system%outboard(0:n), &
                b(0:n - 1, n_dof), c(0:n - 1, n_dof), r(0:n - 1, n_dof), stat=status)
      if (status /= 0) then
         write (size_text, '(f0.1, " GiB")') 4.75_wp*8.0_wp*real(n_dof, wp)**2/1024.0_wp**3
         call raise(error, "kernel = 'assembled' needs "//trim(size_text)//" for this scene; use 'recursive'")
         return
      end if
      system%damped = scene%hinges%has_damping
      system%kinked = scene%hinges%has_kinks
      call joint_map(scene, b)
      r = 0.0_wp ! th = r q - r_gamma
      c = b
      if (scene%quasistatic) call soften(scene, c)
      ! Generalised spring force -K q + Q2 with K = B^T C G B; dampers D = (G B)^T D (G B).
      do k = 0, n - 1
         r(k, :) = scene%hinges%stiffness(k)*c(k, :)
      end do
      system%k = matmul(transpose(b), r)
      system%q2 = matmul(scene%hinges%kink, r)
      do k = 0, n - 1
         r(k, :) = scene%hinges%damping(k)*c(k, :)
      end do
      system%d = matmul(transpose(c), r)
      if (scene%dynamic_bending) call add_bending(scene, system%k)
   end subroutine new_assembled_system

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

   !> Quasistatic bending: G B with G = (I + F C)^-1, F the flexibility of the rods (three moments).
   subroutine soften(scene, b)
      type(scene_type), intent(in) :: scene
      real(wp), intent(inout) :: b(0:, :)
      real(wp) :: g(0:scene%n - 1, 0:scene%n - 1)
      integer :: pivots(scene%n), info, k

      g = 0.0_wp
      do k = 0, scene%n - 1
         g(k, k) = 1.0_wp
      end do
      associate (c => scene%hinges%stiffness)
         do k = 1, scene%n
            associate (f => scene%rods(scene%rod_of(k))%flexibility)
               g(k - 1, k - 1) = g(k - 1, k - 1) + f(1)*c(k - 1)
               if (k == scene%n) cycle
               g(k, k) = g(k, k) + f(3)*c(k)
               g(k - 1, k) = f(2)*c(k)
               g(k, k - 1) = f(2)*c(k - 1)
            end associate
         end do
      end associate
      call dgesv(scene%n, scene%n_dof, g, scene%n, pivots, b, scene%n, info)
   end subroutine soften

   !> Bending stiffness of the rods on (alpha, beta).
   subroutine add_bending(scene, stiffness)
      type(scene_type), intent(in) :: scene
      real(wp), intent(inout) :: stiffness(:, :)
      integer :: k, a, b

      do k = 1, scene%n
         a = scene%alpha_at() + k
         b = scene%beta_at() + k
         associate (rod => scene%rods(scene%rod_of(k)))
            stiffness(a, a) = stiffness(a, a) + rod%stiffness(1)
            stiffness(b, b) = stiffness(b, b) + rod%stiffness(3)
            stiffness(a, b) = stiffness(a, b) + rod%stiffness(2)
            stiffness(b, a) = stiffness(b, a) + rod%stiffness(2)
         end associate
      end do
   end subroutine add_bending

   !> p' from M p' = Q1 + Q2 - N z - D p - K q by Cholesky.
   subroutine assembled_accelerations(system, scene, sine, cosine, q, p, moment, base_force, loaded, node_force, &
                                      acceleration, ok)
      type(assembled_system), intent(inout) :: system
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: sine(0:), cosine(0:) !! of phi (0:n)
      real(wp), intent(in) :: q(:), p(:)           !! coordinates and rates (dof)
      real(wp), intent(in) :: moment(0:)           !! hinge moments (0:n), used if hinges relax: T is then no K q + D p
      real(wp), intent(in) :: base_force(3)        !! X_C, Y_C, M_C
      logical, intent(in) :: loaded                !! node_force is to be used
      real(wp), intent(in) :: node_force(2, *)     !! X, Y at the nodes [N]
      real(wp), intent(out) :: acceleration(:)     !! p' (dof)
      logical, intent(out) :: ok                   !! false: M not positive definite, or not finite
      integer :: info, n_dof

      n_dof = scene%n_dof
      call mass_matrix(system, scene, sine, cosine, q)
      call gyration_matrix(system, scene, sine, cosine, q)
      call quadratic_rates(scene, p, system%z)
      acceleration = 0.0_wp
      if (scene%n_base > 0) acceleration(1:3) = base_force
      if (loaded) call add_node_forces(scene, sine, cosine, node_force, acceleration)
      call dgemv('N', n_dof, n_dof, -1.0_wp, system%n, n_dof, system%z, 1, 1.0_wp, acceleration, 1)
      if (size(scene%hinges%relaxing) > 0) then
         associate (first => scene%phi_at() + 1, n => scene%n)
            acceleration(first:) = acceleration(first:) + moment(1:n) - moment(0:n - 1)
         end associate
      else
         if (system%kinked) acceleration = acceleration + system%q2
         call dgemv('N', n_dof, n_dof, -1.0_wp, system%k, n_dof, q, 1, 1.0_wp, acceleration, 1)
         if (system%damped) call dgemv('N', n_dof, n_dof, -1.0_wp, system%d, n_dof, p, 1, 1.0_wp, acceleration, 1)
      end if
      call dpotrf('L', n_dof, system%m, n_dof, info)
      ok = info == 0
      if (.not. ok) return
      call dpotrs('L', n_dof, 1, system%m, n_dof, acceleration, n_dof, info)
      ok = info == 0 .and. all(ieee_is_finite(acceleration))
   end subroutine assembled_accelerations

   !> z of the article for the rates p.
   pure subroutine quadratic_rates(scene, p, z)
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: p(:)
      real(wp), intent(out) :: z(:)
      real(wp) :: w
      integer :: k

      w = 0.0_wp
      if (scene%n_base > 0) then
         w = p(3)
         z(1:3) = [w*p(1), w*p(2), w*w]
      end if
      do k = 1, scene%n
         associate (phi_rate => p(scene%phi_at() + k))
            z(scene%phi_at() + k) = phi_rate*(2.0_wp*w + phi_rate)
            if (.not. scene%dynamic_bending) cycle
            z(scene%alpha_at() + k) = (w + phi_rate)*p(scene%alpha_at() + k)
            z(scene%beta_at() + k) = (w + phi_rate)*p(scene%beta_at() + k)
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
   subroutine mass_matrix(system, scene, sine, cosine, q)
      type(assembled_system), intent(inout) :: system
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: sine(0:), cosine(0:) !! of phi (0:n)
      real(wp), intent(in) :: q(:)                 !! coordinates (dof)
      integer :: j, k, fj, fk, aj, ak, bj, bk
      real(wp) :: mvv, normal(2), along

      associate (m => system%m, n => scene%n)
         m = 0.0_wp
         call first_moments(system, scene, sine, cosine, q)
         do k = 1, n
            fk = scene%phi_at() + k
            associate (rod => scene%rods(scene%rod_of(k)), i => scene%rods(scene%rod_of(k))%inertia)
               mvv = 0.0_wp
               if (scene%dynamic_bending) then
                  ak = scene%alpha_at() + k
                  bk = scene%beta_at() + k
                  mvv = rod%second(1)*q(ak)**2 + 2.0_wp*rod%second(2)*q(ak)*q(bk) + rod%second(3)*q(bk)**2
                  m(ak, ak) = i%aa
                  m(bk, bk) = i%bb
                  m(ak, bk) = i%ab
                  m(bk, ak) = i%ab
                  call set_pair(m, fk, ak, i%sa)
                  call set_pair(m, fk, bk, i%sb)
               end if
               m(fk, fk) = i%m2 + mvv + rod%length**2*system%outboard(k)
               do j = 1, k - 1
                  fj = scene%phi_at() + j
                  normal = scene%rods(scene%rod_of(j))%length*[-sine(j), cosine(j)]
                  call set_pair(m, fj, fk, dot_product(normal, system%static(:, k)))
                  if (.not. scene%dynamic_bending) cycle
                  along = normal(2)*cosine(k) - normal(1)*sine(k)
                  call set_pair(m, fj, ak, i%a1*along)
                  call set_pair(m, fj, bk, i%b1*along)
               end do
            end associate
         end do
         if (scene%n_base > 0) call add_spacecraft_rows(system, scene, sine, cosine)
      end associate
   end subroutine mass_matrix

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
      real(wp) :: arm, mv
      integer :: k

      system%outboard(scene%n) = scene%node_mass(scene%n)
      do k = scene%n, 1, -1
         associate (rod => scene%rods(scene%rod_of(k)), i => scene%rods(scene%rod_of(k))%inertia)
            arm = i%m1 + rod%length*system%outboard(k)
            mv = 0.0_wp
            if (scene%dynamic_bending) mv = i%a1*q(scene%alpha_at() + k) + i%b1*q(scene%beta_at() + k)
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
      integer :: k, x

      associate (m => system%m, row => system%row, n => scene%n, chain => system%outboard(0), body => scene%body)
         turned = [-body%hinge_y, body%hinge_x]
         do k = 1, n
            m(1:2, scene%phi_at() + k) = system%static(:, k)
            if (.not. scene%dynamic_bending) cycle
            associate (i => scene%rods(scene%rod_of(k))%inertia)
               m(1:2, scene%alpha_at() + k) = i%a1*[-sine(k), cosine(k)]
               m(1:2, scene%beta_at() + k) = i%b1*[-sine(k), cosine(k)]
            end associate
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
      real(wp) :: inward(2)
      integer :: k, column

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
            if (.not. scene%dynamic_bending) cycle
            associate (inertia => scene%rods(scene%rod_of(k))%inertia, &
                       across => inward(2)*cosine(k) - inward(1)*sine(k))
               nm(scene%alpha_at() + k, column) = inertia%a1*across
               nm(scene%beta_at() + k, column) = inertia%b1*across
            end associate
         end do
         if (scene%dynamic_bending) then
            associate (inertia => rod_i%inertia, alpha => q(scene%alpha_at() + i), beta => q(scene%beta_at() + i))
               nm(scene%alpha_at() + i, column) = -(inertia%aa*alpha + inertia%ab*beta)
               nm(scene%beta_at() + i, column) = -(inertia%ab*alpha + inertia%bb*beta)
            end associate
         end if
         inward = -system%axial(:, i) ! now of all that lies outboard
         if (scene%n_base > 0) call close_column(system, scene, column, inward)
      end associate
   end subroutine centrifugal_column

   !> Columns of (w + phi_i') alpha_i' and beta_i': points of rod i accelerate by -2 Na e (-2 Nb e).
   subroutine coriolis_columns(system, scene, sine, cosine, q, i)
      type(assembled_system), intent(inout) :: system
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: sine(0:), cosine(0:)
      real(wp), intent(in) :: q(:)
      integer, intent(in) :: i
      real(wp) :: force(2, 2)
      integer :: k, columns(2), j

      columns = [scene%alpha_at() + i, scene%beta_at() + i]
      associate (nm => system%n, rod => scene%rods(scene%rod_of(i)), inertia => scene%rods(scene%rod_of(i))%inertia, &
                 alpha => q(scene%alpha_at() + i), beta => q(scene%beta_at() + i))
         force(:, 1) = -2.0_wp*inertia%a1*[cosine(i), sine(i)]
         force(:, 2) = -2.0_wp*inertia%b1*[cosine(i), sine(i)]
         nm(scene%phi_at() + i, columns(1)) = 2.0_wp*(rod%second(1)*alpha + rod%second(2)*beta)
         nm(scene%phi_at() + i, columns(2)) = 2.0_wp*(rod%second(2)*alpha + rod%second(3)*beta)
         do j = 1, 2
            do k = 1, i - 1
               associate (length => scene%rods(scene%rod_of(k))%length)
                  nm(scene%phi_at() + k, columns(j)) = length*dot_product([-sine(k), cosine(k)], force(:, j))
               end associate
            end do
            if (scene%n_base > 0) call close_column(system, scene, columns(j), force(:, j))
         end do
      end associate
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
