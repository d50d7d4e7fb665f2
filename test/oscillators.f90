!> An oscillator with a known solution, for tests of integrators.
module test_oscillators
   use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
   use rodyn_kinds, only: wp, i8
   use rodyn_ode, only: ode_system, n_quadratures
   implicit none (type, external)
   private
   public :: oscillator, new_oscillator

   !> x'' = -w^2 x - d x' + f; behind x and v, if wanted, the quadratures of v^2 and of v. Records what it was asked.
   type, extends(ode_system) :: oscillator
      real(wp) :: frequency = 1.0_wp   !! w [rad/s]
      real(wp) :: damping = 0.0_wp     !! d [1/s]
      real(wp) :: force = 0.0_wp       !! f now
      real(wp) :: t_largest = -huge(1.0_wp) !! largest time of a call
      real(wp) :: t_refuse = huge(1.0_wp)   !! ok = .false. from then on
      real(wp) :: t_nan = huge(1.0_wp)      !! NaN with ok = .true. from then on
      integer(i8) :: n_calls = 0
   contains
      procedure :: rhs
      procedure :: jacobian
   end type oscillator

contains

   !> An oscillator with or without quadratures.
   function new_oscillator(frequency, quadratures) result(system)
      real(wp), intent(in) :: frequency !! [rad/s]
      logical, intent(in) :: quadratures
      type(oscillator) :: system
      system%frequency = frequency
      system%n_controlled = 2
      system%n_states = merge(2 + n_quadratures, 2, quadratures)
   end function new_oscillator

   subroutine rhs(self, t, y, ydot, ok)
      class(oscillator), intent(inout) :: self
      real(wp), intent(in) :: t
      real(wp), contiguous, intent(in) :: y(:)
      real(wp), contiguous, intent(out) :: ydot(:)
      logical, intent(out) :: ok
      self%n_calls = self%n_calls + 1
      self%t_largest = max(self%t_largest, t)
      ok = t < self%t_refuse
      ydot(1) = y(2)
      ydot(2) = -self%frequency**2*y(1) - self%damping*y(2) + self%force
      if (size(ydot) > 2) ydot(3:4) = [y(2)**2, y(2)]
      if (t >= self%t_nan) ydot(1) = ieee_value(1.0_wp, ieee_quiet_nan)
   end subroutine rhs

   subroutine jacobian(self, t, y, jac, ok)
      class(oscillator), intent(inout) :: self
      real(wp), intent(in) :: t
      real(wp), contiguous, intent(in) :: y(:)
      real(wp), contiguous, intent(out) :: jac(:, :)
      logical, intent(out) :: ok
      ok = t < huge(t)
      jac = 0.0_wp
      jac(1, 2) = 1.0_wp
      jac(2, 1) = -self%frequency**2
      jac(2, 2) = -self%damping
   end subroutine jacobian

end module test_oscillators
