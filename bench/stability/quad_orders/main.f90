!> Order of `gauss` where rounding does not end the measurement: the sources of the integrator, compiled with wp = real128, on
!> Kepler's problem, whose solution is known. `bench/stability/run.py orders` builds and runs it.
!>
!> Printed: the errors of (q, p) at the end of five runs, each with twice the steps.
module kepler_problem
   use rodyn_kinds, only: wp
   use rodyn_lanes, only: lanes
   use rodyn_ode, only: mechanical_system, stiff_modes
   implicit none (type, external)
   private
   public :: kepler, exact_state

   !> q'' = -q/|q|^3 in the plane: an ellipse of half axis 1, mean motion 1 rad/s.
   type, extends(mechanical_system) :: kepler
   contains
      procedure :: rhs
      procedure :: jacobian
      procedure :: has_lanes
      procedure :: lane_accelerations
      procedure :: find_modes
      procedure :: quadratures
   end type kepler

contains

   !> (q, p) at time t after the pericentre, from Kepler's equation E - e sin E = t.
   function exact_state(eccentricity, t) result(y)
      real(wp), intent(in) :: eccentricity, t
      real(wp) :: y(4), anomaly, rate
      integer :: i

      anomaly = t
      do i = 1, 60
         anomaly = anomaly - (anomaly - eccentricity*sin(anomaly) - t)/(1.0_wp - eccentricity*cos(anomaly))
      end do
      rate = 1.0_wp/(1.0_wp - eccentricity*cos(anomaly))
      associate (b => sqrt(1.0_wp - eccentricity**2))
         y = [cos(anomaly) - eccentricity, b*sin(anomaly), -rate*sin(anomaly), rate*b*cos(anomaly)]
      end associate
   end function exact_state

   subroutine rhs(self, t, y, ydot, ok)
      class(kepler), intent(inout) :: self
      real(wp), intent(in) :: t
      real(wp), contiguous, intent(in) :: y(:)
      real(wp), contiguous, intent(out) :: ydot(:)
      logical, intent(out) :: ok
      associate (unused => self, unused_t => t); end associate
      ydot = [y(3:4), -y(1:2)/(y(1)**2 + y(2)**2)**1.5_wp]
      ok = .true.
   end subroutine rhs

   !> Not needed.
   subroutine jacobian(self, t, y, jac, ok)
      class(kepler), intent(inout) :: self
      real(wp), intent(in) :: t
      real(wp), contiguous, intent(in) :: y(:)
      real(wp), contiguous, intent(out) :: jac(:, :)
      logical, intent(out) :: ok
      associate (unused => self, unused_t => t, unused_y => y); end associate
      jac = 0.0_wp
      ok = .false.
   end subroutine jacobian

   logical function has_lanes(self)
      class(kepler), intent(in) :: self
      associate (unused => self); end associate
      has_lanes = .true.
   end function has_lanes

   subroutine lane_accelerations(self, t, q, p, acceleration, ok)
      class(kepler), intent(inout) :: self
      real(wp), intent(in) :: t(lanes)
      real(wp), contiguous, intent(in) :: q(:, :), p(:, :)
      real(wp), contiguous, intent(out) :: acceleration(:, :)
      logical, intent(out) :: ok
      real(wp) :: cubed(lanes)
      associate (unused => self, unused_t => t, unused_p => p); end associate
      cubed = (q(:, 1)**2 + q(:, 2)**2)**1.5_wp
      acceleration(:, 1) = -q(:, 1)/cubed
      acceleration(:, 2) = -q(:, 2)/cubed
      ok = .true.
   end subroutine lane_accelerations

   !> Nothing is stiff: the fixed-point iteration is the method's own.
   subroutine find_modes(self, q, slowest, modes, ok)
      class(kepler), intent(inout) :: self
      real(wp), intent(in) :: q(:)
      real(wp), intent(in) :: slowest
      type(stiff_modes), intent(inout) :: modes
      logical, intent(out) :: ok
      associate (unused => self, unused_q => q, unused_slowest => slowest); end associate
      modes%n = 0
      if (.not. allocated(modes%omega_2)) allocate (modes%omega_2(0), modes%damping(0), modes%u(0, 2), modes%v(2, 0))
      ok = .true.
   end subroutine find_modes

   subroutine quadratures(self, t, q, p, rate)
      class(kepler), intent(inout) :: self
      real(wp), intent(in) :: t
      real(wp), contiguous, intent(in) :: q(:), p(:)
      real(wp), intent(out) :: rate(:)
      associate (unused => self, unused_t => t, unused_q => q, unused_p => p); end associate
      rate = 0.0_wp
   end subroutine quadratures

end module kepler_problem

program quad_orders
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type
   use rodyn_integrator, only: solver_options
   use rodyn_gauss_integrator, only: gauss_integrator, new_gauss_integrator
   use kepler_problem, only: kepler, exact_state
   implicit none (type, external)
   real(wp), parameter :: eccentricity = 0.1_wp, t_end = 8.0_wp
   integer, parameter :: steps(5) = [8, 16, 32, 64, 128]
   real(wp) :: errors(size(steps))
   integer :: i

   if (precision(1.0_wp) < 30) error stop 'compile with wp = real128'
   do i = 1, size(steps)
      errors(i) = error_of(steps(i))
   end do
   write (*, '(a, *(a, es12.5))') 'gauss', (achar(9), errors(i), i=1, size(steps))

contains

   !> Error of (q, p) at the end of so many equal steps.
   real(wp) function error_of(n_steps)
      integer, intent(in) :: n_steps
      type(kepler), target :: system
      type(gauss_integrator) :: gauss
      type(solver_options) :: options
      type(error_type), allocatable :: error
      real(wp) :: y(4), t

      system%n_states = 4
      system%n_controlled = 4
      system%n_dof = 2
      options%fixed_step = t_end/n_steps
      ! What the iteration may leave: far less than the error of the method, but no more digits than 15 iterations bring.
      options%rtol = max(1.0e-33_wp, 1.0e-18_wp*options%fixed_step**16)
      options%atol = 0.01_wp*options%rtol
      call new_gauss_integrator(gauss, system, options, error)
      if (.not. allocated(error)) call gauss%set_stop(t_end)
      if (.not. allocated(error)) call gauss%start(0.0_wp, exact_state(eccentricity, 0.0_wp), error)
      if (.not. allocated(error)) call gauss%advance(t_end, y, t, error)
      if (allocated(error)) error stop 'no solution'
      error_of = norm2(y - exact_state(eccentricity, t_end))
   end function error_of

end program quad_orders

!> In place of LAPACK's, which knows no quadruple precision: the eigenvalues of A serve stiff modes only, and there are none.
! allow(procedure-not-in-module)
subroutine dgeev(jobvl, jobvr, n, a, lda, wr, wi, vl, ldvl, vr, ldvr, work, lwork, info)
   use rodyn_kinds, only: wp
   implicit none (type, external)
   character(len=1), intent(in) :: jobvl, jobvr
   integer, intent(in) :: n, lda, ldvl, ldvr, lwork
   real(wp), intent(inout) :: a(lda, n), wr(n), wi(n), vl(ldvl, n), vr(ldvr, n), work(lwork)
   integer, intent(out) :: info
   associate (unused => [jobvl, jobvr], unused_a => [a, vl, vr], unused_w => [wr, work]); end associate
   wi = 0.0_wp
   info = 0
end subroutine dgeev
