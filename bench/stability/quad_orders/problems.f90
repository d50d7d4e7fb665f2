!> Mechanical systems q'' = f(q), p = q', whose solutions are known and in which nothing is stiff.
module smooth_problems
   use rodyn_kinds, only: wp
   use rodyn_lanes, only: lanes
   use rodyn_ode, only: mechanical_system
   use rodyn_stiff_modes, only: stiff_modes
   implicit none (type, external)
   private
   public :: smooth_problem, kepler, polynomial_chain

   type, abstract, extends(mechanical_system) :: smooth_problem
   contains
      procedure(force_at), deferred :: force
      procedure(exact_state), deferred :: exact
      procedure :: rhs
      procedure :: jacobian
      procedure :: has_lanes
      procedure :: lane_accelerations
      procedure :: find_modes
   end type smooth_problem

   abstract interface
      !> f(q)
      function force_at(self, q) result(f)
         import :: smooth_problem, wp
         implicit none (type, external)
         class(smooth_problem), intent(in) :: self
         real(wp), intent(in) :: q(:)
         real(wp) :: f(size(q))
      end function force_at
      !> (q, p) at time t after the start
      function exact_state(self, t) result(y)
         import :: smooth_problem, wp
         implicit none (type, external)
         class(smooth_problem), intent(in) :: self
         real(wp), intent(in) :: t
         real(wp) :: y(self%n_states)
      end function exact_state
   end interface

   !> q'' = -q/|q|^3 in the plane: an ellipse of half axis 1, mean motion 1 rad/s, from its pericentre.
   type, extends(smooth_problem) :: kepler
      real(wp) :: eccentricity = 0.1_wp
   contains
      procedure :: force => force_of_kepler
      procedure :: exact => kepler_orbit
   end type kepler

   !> q1'' = 4, q2'' = 100 T4(q1), q3'' = q2 T3(q1) with Chebyshev's polynomials T. From q = (1, 0, 0), p = (-4, 0, 0) and with
   !> s = t - 1, q1 = T2(s), so q2'' = 100 T8(s), q3'' = q2 T6(s): q3 is a polynomial of degree 18, just what a method of order 16
   !> does not solve exactly. So the error of a step consists of few powers of its length, however long the step is.
   type, extends(smooth_problem) :: polynomial_chain
   contains
      procedure :: force => force_of_chain
      procedure :: exact => chain_motion
   end type polynomial_chain

   integer, parameter :: degree = 20 !! of the series of Chebyshev polynomials

contains

   function force_of_kepler(self, q) result(f)
      class(kepler), intent(in) :: self
      real(wp), intent(in) :: q(:)
      real(wp) :: f(size(q))
      associate (unused => self); end associate
      f = -q/norm2(q)**3
   end function force_of_kepler

   !> From Kepler's equation E - e sin E = t.
   function kepler_orbit(self, t) result(y)
      class(kepler), intent(in) :: self
      real(wp), intent(in) :: t
      real(wp) :: y(self%n_states), anomaly, rate
      integer :: i

      associate (e => self%eccentricity)
         anomaly = t
         do i = 1, 60
            anomaly = anomaly - (anomaly - e*sin(anomaly) - t)/(1.0_wp - e*cos(anomaly))
         end do
         rate = 1.0_wp/(1.0_wp - e*cos(anomaly))
         associate (b => sqrt(1.0_wp - e**2))
            y = [cos(anomaly) - e, b*sin(anomaly), -rate*sin(anomaly), rate*b*cos(anomaly)]
         end associate
      end associate
   end function kepler_orbit

   function force_of_chain(self, q) result(f)
      class(polynomial_chain), intent(in) :: self
      real(wp), intent(in) :: q(:)
      real(wp) :: f(size(q))
      associate (unused => self); end associate
      f = [4.0_wp, 100.0_wp*(8.0_wp*q(1)**4 - 8.0_wp*q(1)**2 + 1.0_wp), q(2)*(4.0_wp*q(1)**3 - 3.0_wp*q(1))]
   end function force_of_chain

   function chain_motion(self, t) result(y)
      class(polynomial_chain), intent(in) :: self
      real(wp), intent(in) :: t
      real(wp) :: y(self%n_states)
      real(wp), dimension(0:degree) :: p2, q2, p3, q3

      p2 = integral(100.0_wp*chebyshev(8))
      q2 = integral(p2)
      p3 = integral(product_of(q2, chebyshev(6)))
      q3 = integral(p3)
      y = [2.0_wp*(t - 1.0_wp)**2 - 1.0_wp, value(q2, t - 1.0_wp), value(q3, t - 1.0_wp), &
           4.0_wp*(t - 1.0_wp), value(p2, t - 1.0_wp), value(p3, t - 1.0_wp)]
   end function chain_motion

   !> The series of T_n.
   pure function chebyshev(n) result(c)
      integer, intent(in) :: n
      real(wp) :: c(0:degree)
      c = 0.0_wp
      c(n) = 1.0_wp
   end function chebyshev

   !> Series of the integral from -1.
   pure function integral(c) result(s)
      real(wp), intent(in) :: c(0:)
      real(wp) :: s(0:degree)
      integer :: k

      s(1) = c(0) - 0.5_wp*c(2)
      do k = 2, degree
         s(k) = 0.5_wp*(c(k - 1) - merge(c(min(k + 1, degree)), 0.0_wp, k < degree))/k
      end do
      s(0) = 0.0_wp
      s(0) = -value(s, -1.0_wp)
   end function integral

   !> Series of a product: 2 T_i T_j = T_i+j + T_|i-j|.
   pure function product_of(a, b) result(c)
      real(wp), intent(in) :: a(0:), b(0:)
      real(wp) :: c(0:degree)
      integer :: i, j

      c = 0.0_wp
      do i = 0, degree
         do j = 0, degree - i
            c(i + j) = c(i + j) + 0.5_wp*a(i)*b(j)
            c(abs(i - j)) = c(abs(i - j)) + 0.5_wp*a(i)*b(j)
         end do
      end do
   end function product_of

   pure real(wp) function value(c, x)
      real(wp), intent(in) :: c(0:)
      real(wp), intent(in) :: x
      integer :: k
      value = 0.0_wp
      do k = 0, degree
         value = value + c(k)*cos(k*acos(x))
      end do
   end function value

   subroutine rhs(self, t, y, ydot, ok)
      class(smooth_problem), intent(inout) :: self
      real(wp), intent(in) :: t
      real(wp), contiguous, intent(in) :: y(:)
      real(wp), contiguous, intent(out) :: ydot(:)
      logical, intent(out) :: ok
      associate (unused => t); end associate
      ydot(:self%n_dof) = y(self%n_dof + 1:)
      ydot(self%n_dof + 1:) = self%force(y(:self%n_dof))
      ok = .true.
   end subroutine rhs

   !> Not needed.
   subroutine jacobian(self, t, y, jac, ok)
      class(smooth_problem), intent(inout) :: self
      real(wp), intent(in) :: t
      real(wp), contiguous, intent(in) :: y(:)
      real(wp), contiguous, intent(out) :: jac(:, :)
      logical, intent(out) :: ok
      associate (unused => self, unused_t => t, unused_y => y); end associate
      jac = 0.0_wp
      ok = .false.
   end subroutine jacobian

   logical function has_lanes(self)
      class(smooth_problem), intent(in) :: self
      associate (unused => self); end associate
      has_lanes = .true.
   end function has_lanes

   subroutine lane_accelerations(self, t, q, p, acceleration, ok)
      class(smooth_problem), intent(inout) :: self
      real(wp), intent(in) :: t(lanes)
      real(wp), contiguous, intent(in) :: q(:, :), p(:, :)
      real(wp), contiguous, intent(out) :: acceleration(:, :)
      logical, intent(out) :: ok
      integer :: lane
      associate (unused => t, unused_p => p); end associate
      do lane = 1, lanes
         acceleration(lane, :) = self%force(q(lane, :))
      end do
      ok = .true.
   end subroutine lane_accelerations

   !> None: the fixed-point iteration is the method's own.
   subroutine find_modes(self, q, slowest, weight, modes, ok)
      class(smooth_problem), intent(inout) :: self
      real(wp), intent(in) :: q(:)
      real(wp), intent(in) :: slowest, weight
      type(stiff_modes), intent(inout) :: modes
      logical, intent(out) :: ok
      associate (unused => q, unused_slowest => slowest, unused_weight => weight); end associate
      modes%n = 0
      call modes%reserve(0, self%n_dof, 0, 0)
      ok = .true.
   end subroutine find_modes

end module smooth_problems
