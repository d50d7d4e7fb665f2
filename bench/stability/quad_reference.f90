!> The consistent equations in quadruple precision, by brute force: a reference that shares nothing with the program.
!>
!> Coordinates are inertial, x = (X, Y, theta, phi, alpha, beta). Every point of every rod is a function of them; with its Jacobian
!> G and the part g of its acceleration that is quadratic in the rates, by Gauss points along the rods and the point masses,
!>     (sum m G^T G) x'' = forces - sum m G^T g,
!> Cholesky, and Gragg's extrapolated midpoint rule for the motion. Nothing is eliminated, no moving frame, no recursion.
module rodyn_bench_quad_reference
   use rodyn_kinds, only: wp
   use rodyn_case_config, only: case_config
   use rodyn_bench_wide_kind, only: qp
   use rodyn_bench_extrapolation, only: smooth_system, extrapolated_step
   implicit none (type, external)
   private
   public :: qp, quad_accelerations, quad_motion, condition_number, supported

   integer, parameter :: n_points = 4 !! exact for the cubes of the shape functions

   !> What does not change, and the equations of motion of y = (x, x').
   type, extends(smooth_system) :: quad_scene
      integer :: n = 0, n_base = 3, m = 0
      logical :: flexible = .true.
      real(qp) :: mass = 0.0_qp, inertia = 0.0_qp, hinge(2) = 0.0_qp
      real(qp), allocatable, dimension(:) :: length, density, bending, node_mass, spring, damper, kink
      real(qp) :: load(3) = 0.0_qp              !! on the spacecraft, moving axes
      real(qp), allocatable :: node_load(:, :)  !! (2, n)
      real(qp) :: point(n_points), weight(n_points) !! on [0, 1]
   contains
      procedure :: rates
   end type quad_scene

contains

   !> Distributed inertia and the consistent formulation; constant loads are taken to act always.
   logical function supported(config)
      type(case_config), intent(in) :: config
      supported = config%model%inertia == 'distributed' .and. config%model%formulation == 'consistent'
   end function supported

   subroutine new_quad_scene(self, config)
      type(quad_scene), intent(out) :: self
      type(case_config), intent(in) :: config
      integer :: i

      self%n = config%chain%n_rods
      self%n_base = merge(0, 3, config%spacecraft%motion == 'fixed')
      self%flexible = config%model%bending == 'dynamic'
      self%m = self%n_base + merge(3, 1, self%flexible)*self%n
      self%mass = config%spacecraft%mass
      self%inertia = config%spacecraft%inertia
      self%hinge = [config%spacecraft%hinge_x, config%spacecraft%hinge_y]
      associate (chain => config%chain)
         self%length = chain%length
         self%density = chain%mass_per_length
         allocate (self%bending(self%n), source=0.0_qp)
         if (self%flexible) self%bending = chain%bending_stiffness
         self%node_mass = chain%node_mass
         self%spring = chain%hinge_stiffness(:) ! from 1, whatever the bounds there
         self%damper = chain%hinge_damping(:)
         self%kink = chain%kink(:)
      end associate
      allocate (self%node_load(2, self%n), source=0.0_qp)
      do i = 1, size(config%loads)
         associate (load => config%loads(i))
            if (load%target == 'spacecraft') then
               self%load(index('XYM', trim(load%component))) = load%value
            else
               self%node_load(index('XY', trim(load%component)), load%node) = load%value
            end if
         end associate
      end do
      call gauss_points(self%point, self%weight)
   end subroutine new_quad_scene

   !> Gauss's rule of four points on [0, 1], roots of Legendre's polynomial in closed form.
   subroutine gauss_points(point, weight)
      real(qp), intent(out) :: point(4), weight(4)
      real(qp) :: x(4), root
      root = 2.0_qp/7.0_qp*sqrt(6.0_qp/5.0_qp)
      x = [-sqrt(3.0_qp/7.0_qp + root), -sqrt(3.0_qp/7.0_qp - root), sqrt(3.0_qp/7.0_qp - root), sqrt(3.0_qp/7.0_qp + root)]
      point = 0.5_qp*(1.0_qp + x)
      root = sqrt(30.0_qp)
      weight = [18.0_qp - root, 18.0_qp + root, 18.0_qp + root, 18.0_qp - root]/72.0_qp
   end subroutine gauss_points

   !> p' for the state (q, p) of the program, in its variables.
   subroutine quad_accelerations(config, q, p, acceleration)
      type(case_config), intent(in) :: config
      real(wp), intent(in) :: q(:), p(:)             !! (n_dof)
      real(qp), intent(out) :: acceleration(:)       !! (n_dof)
      type(quad_scene) :: scene
      real(qp), dimension(size(q)) :: x, v
      real(qp) :: c, s

      call new_quad_scene(scene, config)
      call to_inertial(scene, real(q, qp), real(p, qp), x, v)
      call second_derivative(scene, x, v, acceleration)
      if (scene%n_base == 0) return
      c = cos(x(3))
      s = sin(x(3))
      acceleration(1:2) = [c*acceleration(1) + s*acceleration(2) + p(3)*real(p(2), qp), &
                           c*acceleration(2) - s*acceleration(1) - p(3)*real(p(1), qp)]
   end subroutine quad_accelerations

   !> Condition number of the mass matrix, largest over smallest eigenvalue, each by iteration; `scaled`: after scaling its diagonal
   !> to one.
   subroutine condition_number(config, q, plain, scaled)
      type(case_config), intent(in) :: config
      real(wp), intent(in) :: q(:)
      real(wp), intent(out) :: plain, scaled
      type(quad_scene) :: scene
      real(qp), dimension(size(q)) :: x, v, diagonal
      real(qp) :: mass(size(q), size(q)), force(size(q))
      integer :: i, j

      call new_quad_scene(scene, config)
      call to_inertial(scene, real(q, qp), [(0.0_qp, i=1, size(q))], x, v)
      call equations(scene, x, v, mass, force)
      plain = ratio_of(mass)
      diagonal = [(sqrt(mass(i, i)), i=1, size(q))]
      do j = 1, size(q)
         do i = j, size(q)
            mass(i, j) = mass(i, j)/(diagonal(i)*diagonal(j))
         end do
      end do
      scaled = ratio_of(mass)
   end subroutine condition_number

   !> Largest over smallest eigenvalue of a positive definite matrix, lower triangle, by power iteration and its inverse.
   real(wp) function ratio_of(a)
      real(qp), intent(in) :: a(:, :)
      real(qp) :: factor(size(a, 1), size(a, 1)), x(size(a, 1)), y(size(a, 1)), largest, smallest
      integer :: i, k

      factor = a
      call cholesky(factor)
      x = [(cos(2.4_qp*i**2), i=1, size(x))]
      largest = 0.0_qp
      do k = 1, 60
         x = x/norm2(x)
         do i = 1, size(x)
            y(i) = sum(a(i, :i)*x(:i)) + sum(a(i + 1:, i)*x(i + 1:))
         end do
         largest = norm2(y)
         x = y
      end do
      x = [(cos(2.4_qp*i**2), i=1, size(x))]
      smallest = 1.0_qp
      do k = 1, 60
         x = x/norm2(x)
         call solve(factor, x)
         smallest = 1.0_qp/norm2(x)
      end do
      ratio_of = real(largest/smallest, wp)
   end function ratio_of

   !> The state of the program at t from its state at 0, with `steps` steps.
   subroutine quad_motion(config, t, steps, q, p)
      type(case_config), intent(in) :: config
      real(wp), intent(in) :: t          !! [s]
      integer, intent(in) :: steps
      real(qp), intent(inout) :: q(:), p(:) !! in: at 0, out: at t (n_dof)
      type(quad_scene) :: scene
      real(qp), dimension(2*size(q)) :: y
      real(qp) :: c, s
      integer :: i

      call new_quad_scene(scene, config)
      associate (m => scene%m)
         call to_inertial(scene, q, p, y(:m), y(m + 1:))
         do i = 1, steps
            call extrapolated_step(scene, 0.0_qp, real(t, qp)/steps, y) ! the equations do not know the time
         end do
         q = y(:m)
         p = y(m + 1:)
      end associate
      if (scene%n_base == 0) return
      c = cos(q(3))
      s = sin(q(3))
      q(1:2) = [c*q(1) + s*q(2), c*q(2) - s*q(1)]
      p(1:2) = [c*p(1) + s*p(2), c*p(2) - s*p(1)]
   end subroutine quad_motion

   !> Displacement and velocity of C along inertial axes.
   subroutine to_inertial(scene, q, p, x, v)
      type(quad_scene), intent(in) :: scene
      real(qp), intent(in) :: q(:), p(:)
      real(qp), intent(out) :: x(:), v(:)
      real(qp) :: c, s
      x = q
      v = p
      if (scene%n_base == 0) return
      c = cos(q(3))
      s = sin(q(3))
      x(1:2) = [c*q(1) - s*q(2), s*q(1) + c*q(2)]
      v(1:2) = [c*p(1) - s*p(2), s*p(1) + c*p(2)]
   end subroutine to_inertial

   subroutine rates(self, t, y, rate)
      class(quad_scene), intent(inout) :: self
      real(qp), intent(in) :: t
      real(qp), contiguous, intent(in) :: y(:)
      real(qp), contiguous, intent(out) :: rate(:)
      associate (unused => t, m => self%m)
         rate(:m) = y(m + 1:)
         call second_derivative(self, y(:m), y(m + 1:), rate(m + 1:))
      end associate
   end subroutine rates

   subroutine second_derivative(scene, x, v, acceleration)
      class(quad_scene), intent(in) :: scene
      real(qp), intent(in) :: x(:), v(:)
      real(qp), intent(out) :: acceleration(:)
      real(qp) :: mass(scene%m, scene%m)

      call equations(scene, x, v, mass, acceleration)
      call cholesky(mass)
      call solve(mass, acceleration)
   end subroutine second_derivative

   !> Mass matrix (lower triangle) and generalised forces.
   subroutine equations(scene, x, v, mass, force)
      class(quad_scene), intent(in) :: scene
      real(qp), intent(in) :: x(:), v(:)
      real(qp), intent(out) :: mass(:, :), force(:)
      real(qp), dimension(scene%m, 2) :: jacobian, at_node
      real(qp) :: theta, turn, e(2), n(2), g(2), g_node(2), s, na, nb, bent, bent_rate, w, load(2), c0, s0
      integer :: f, a, b, k, i

      mass = 0.0_qp
      force = 0.0_qp
      at_node = 0.0_qp
      g_node = 0.0_qp
      theta = 0.0_qp
      turn = 0.0_qp
      c0 = 1.0_qp
      s0 = 0.0_qp
      f = scene%n_base
      if (f > 0) then
         theta = x(3)
         turn = v(3)
         c0 = cos(theta)
         s0 = sin(theta)
         at_node(1, 1) = 1.0_qp
         at_node(2, 2) = 1.0_qp
         call add_point(scene%mass, at_node, g_node)
         mass(3, 3) = mass(3, 3) + scene%inertia
         call push(at_node, scene%load(1:2))
         force(3) = force(3) + scene%load(3)
         e = [c0*scene%hinge(1) - s0*scene%hinge(2), s0*scene%hinge(1) + c0*scene%hinge(2)]
         at_node(3, :) = [-e(2), e(1)]
         g_node = -turn**2*e
      end if
      do k = 1, scene%n
         w = turn + v(f + k)
         e = [cos(theta + x(f + k)), sin(theta + x(f + k))]
         n = [-e(2), e(1)]
         a = f + scene%n + k
         b = a + scene%n
         do i = 1, n_points
            s = scene%point(i)
            na = scene%length(k)*s*(1.0_qp - s)**2
            nb = -scene%length(k)*s**2*(1.0_qp - s)
            bent = 0.0_qp
            bent_rate = 0.0_qp
            jacobian = at_node
            if (scene%flexible) then
               bent = na*x(a) + nb*x(b)
               bent_rate = na*v(a) + nb*v(b)
               jacobian(a, :) = na*n
               jacobian(b, :) = nb*n
            end if
            s = s*scene%length(k)
            jacobian(f + k, :) = s*n - bent*e
            if (f > 0) jacobian(3, :) = jacobian(3, :) + jacobian(f + k, :)
            g = g_node - w**2*(s*e + bent*n) - 2.0_qp*w*bent_rate*e
            call add_point(scene%weight(i)*scene%length(k)*scene%density(k), jacobian, g)
         end do
         at_node(f + k, :) = scene%length(k)*n
         if (f > 0) at_node(3, :) = at_node(3, :) + at_node(f + k, :)
         g_node = g_node - w**2*scene%length(k)*e
         call add_point(scene%node_mass(k), at_node, g_node)
         load = scene%node_load(:, k)
         call push(at_node, load)
      end do
      call add_springs(scene, x, v, force)

   contains

      subroutine add_point(m, jac, acc)
         real(qp), intent(in) :: m, jac(:, :), acc(2)
         integer :: row, column
         do column = 1, scene%m
            if (all(jac(column, :) == 0.0_qp)) cycle
            do row = column, scene%m
               mass(row, column) = mass(row, column) + m*(jac(row, 1)*jac(column, 1) + jac(row, 2)*jac(column, 2))
            end do
            force(column) = force(column) - m*(jac(column, 1)*acc(1) + jac(column, 2)*acc(2))
         end do
      end subroutine add_point

      !> A force given along the moving axes.
      subroutine push(jac, moving)
         real(qp), intent(in) :: jac(:, :), moving(2)
         force = force + jac(:, 1)*(c0*moving(1) - s0*moving(2)) + jac(:, 2)*(s0*moving(1) + c0*moving(2))
      end subroutine push

   end subroutine equations

   !> Moments of hinges and rods.
   subroutine add_springs(scene, x, v, force)
      class(quad_scene), intent(in) :: scene
      real(qp), intent(in) :: x(:), v(:)
      real(qp), intent(inout) :: force(:)
      real(qp) :: opening, rate, moment
      integer :: f, a, b, k

      f = scene%n_base
      do k = 1, scene%n
         a = f + scene%n + k
         b = a + scene%n
         opening = x(f + k) - scene%kink(k)
         rate = v(f + k)
         if (scene%flexible) then
            opening = opening + x(a)
            rate = rate + v(a)
         end if
         if (k > 1) then
            opening = opening - x(f + k - 1)
            rate = rate - v(f + k - 1)
            if (scene%flexible) then
               opening = opening - x(b - 1)
               rate = rate - v(b - 1)
            end if
         end if
         moment = scene%spring(k)*opening + scene%damper(k)*rate
         force(f + k) = force(f + k) - moment
         if (k > 1) force(f + k - 1) = force(f + k - 1) + moment
         if (.not. scene%flexible) cycle
         force(a) = force(a) - moment - 2.0_qp*scene%bending(k)/scene%length(k)*(2.0_qp*x(a) + x(b))
         force(b) = force(b) - 2.0_qp*scene%bending(k)/scene%length(k)*(x(a) + 2.0_qp*x(b))
         if (k > 1) force(b - 1) = force(b - 1) + moment
      end do
   end subroutine add_springs

   subroutine cholesky(a)
      real(qp), intent(inout) :: a(:, :) !! lower triangle
      integer :: i, j

      do j = 1, size(a, 1)
         a(j, j) = sqrt(a(j, j) - sum(a(j, :j - 1)**2))
         do i = j + 1, size(a, 1)
            a(i, j) = (a(i, j) - sum(a(i, :j - 1)*a(j, :j - 1)))/a(j, j)
         end do
      end do
   end subroutine cholesky

   subroutine solve(factor, x)
      real(qp), intent(in) :: factor(:, :)
      real(qp), intent(inout) :: x(:)
      integer :: i

      do i = 1, size(x)
         x(i) = (x(i) - sum(factor(i, :i - 1)*x(:i - 1)))/factor(i, i)
      end do
      do i = size(x), 1, -1
         x(i) = (x(i) - sum(factor(i + 1:, i)*x(i + 1:)))/factor(i, i)
      end do
   end subroutine solve

end module rodyn_bench_quad_reference
