!> What an integrator needs to know of a system of first-order equations y' = f(t, y), and no more.
module rodyn_ode
   use rodyn_kinds, only: wp
   use rodyn_lanes, only: lanes
   use rodyn_dense_newton, only: dense_newton
   use rodyn_stiff_modes, only: stiff_modes
   implicit none (type, external)
   private
   public :: ode_system, mechanical_system
   public :: factorise_dense, solve_dense

   !> A system of `n_states` equations, of which the first `n_controlled` take part in step-size control.
   !> The others are pure quadratures (work, dissipated energy): no equation depends on them, and a run
   !> with them makes the same steps as one without.
   !>
   !> Implicit methods solve (1 - g df/dy) x = r by `factorise_newton` and `solve_newton`. A system that knows the
   !> structure of its Jacobian overrides both.
   type, abstract :: ode_system
      integer :: n_states = 0     !! length of y
      integer :: n_controlled = 0 !! leading states in the error norm
      integer :: n_events = 0     !! functions whose sign changes end the smooth part of the run
      type(dense_newton), private :: dense
   contains
      procedure :: event_functions
      procedure(rhs_interface), deferred :: rhs
      procedure(jacobian_interface), deferred :: jacobian
      procedure :: factorise_newton => factorise_dense
      procedure :: solve_newton => solve_dense
   end type ode_system

   !> A mechanical system: y = (q, p [, quadratures]) with p' from q, p and t, and q' = p. If there are ignorable
   !> coordinates, the first two are a displacement along axes that turn:  q(1)' = p(1) + p(3) q(2),  q(2)' = p(2) - p(3) q(1).
   type, abstract, extends(ode_system) :: mechanical_system
      integer :: n_dof = 0        !! length of p
      integer :: n_ignorable = 0  !! leading coordinates that p' does not depend on: 0, or 3 (displacement and rotation)
   contains
      procedure(can_interface), deferred :: has_lanes
      procedure(lanes_interface), deferred :: lane_accelerations
      procedure(modes_interface), deferred :: find_modes
      procedure :: forget_modes => nothing_to_forget
      procedure(quadratures_interface), deferred :: quadratures
   end type mechanical_system

   abstract interface
      !> True if q has the length of p and the procedures below work.
      logical function can_interface(self)
         import :: mechanical_system
         implicit none (type, external)
         class(mechanical_system), intent(in) :: self
      end function can_interface

      !> p' at several times and states at once.
      subroutine lanes_interface(self, t, q, p, acceleration, ok)
         import :: mechanical_system, wp, lanes
         implicit none (type, external)
         class(mechanical_system), intent(inout) :: self
         real(wp), intent(in) :: t(lanes)                        !! [s]
         real(wp), contiguous, intent(in) :: q(:, :), p(:, :)    !! (lanes, n_dof)
         real(wp), contiguous, intent(out) :: acceleration(:, :) !! (lanes, n_dof)
         logical, intent(out) :: ok                              !! false: not in all lanes
      end subroutine lanes_interface

      !> Modes of K + weight D at q that are faster than a given rate.
      subroutine modes_interface(self, q, slowest, weight, modes, ok)
         import :: mechanical_system, stiff_modes, wp
         implicit none (type, external)
         class(mechanical_system), intent(inout) :: self
         real(wp), intent(in) :: q(:)     !! (n_dof)
         real(wp), intent(in) :: slowest  !! modes below this frequency may be left out [rad/s]
         real(wp), intent(in) :: weight   !! of dampers beside springs [1/s]; a factor of four in it does not matter
         type(stiff_modes), intent(inout) :: modes
         logical, intent(out) :: ok
      end subroutine modes_interface

      !> Rates of the states behind (q, p).
      subroutine quadratures_interface(self, t, q, p, rate)
         import :: mechanical_system, wp
         implicit none (type, external)
         class(mechanical_system), intent(inout) :: self
         real(wp), intent(in) :: t
         real(wp), contiguous, intent(in) :: q(:), p(:) !! (n_dof)
         real(wp), intent(out) :: rate(:)   !! (n_states - 2 n_dof)
      end subroutine quadratures_interface
   end interface

   abstract interface
      !> Right-hand side. Allocates nothing.
      subroutine rhs_interface(self, t, y, ydot, ok)
         import :: ode_system, wp
         implicit none (type, external)
         class(ode_system), intent(inout) :: self
         real(wp), intent(in) :: t       !! time [s]
         real(wp), contiguous, intent(in) :: y(:)    !! states (n_states)
         real(wp), contiguous, intent(out) :: ydot(:) !! their rates (n_states)
         logical, intent(out) :: ok      !! false: not finite, or a factorization failed
      end subroutine rhs_interface

      !> Exact Jacobian df/dy.
      subroutine jacobian_interface(self, t, y, jac, ok)
         import :: ode_system, wp
         implicit none (type, external)
         class(ode_system), intent(inout) :: self
         real(wp), intent(in) :: t         !! time [s]
         real(wp), contiguous, intent(in) :: y(:)      !! states (n_states)
         real(wp), contiguous, intent(out) :: jac(:, :) !! df_i/dy_j (n_states, n_states)
         logical, intent(out) :: ok        !! false: it could not be formed
      end subroutine jacobian_interface
   end interface

contains

   !> Values that are positive while the present right-hand side holds; where one becomes negative, integration stops for the
   !> system to change. A system with `n_events` > 0 overrides this.
   subroutine event_functions(self, t, y, values)
      class(ode_system), intent(inout) :: self
      real(wp), intent(in) :: t                  !! [s]
      real(wp), contiguous, intent(in) :: y(:)   !! (n_states)
      real(wp), contiguous, intent(out) :: values(:) !! (n_events)
      associate (unused => self, unused_t => t, unused_y => y); end associate
      values = 1.0_wp
   end subroutine event_functions

   !> Factor 1 - gamma df/dy. Nothing depends on the quadratures; their rows are left out, so that a system with them is
   !> solved to the last bit as one without. Their own correction is within the tolerance of the iteration.
   subroutine factorise_dense(self, t, y, gamma, fresh, ok)
      class(ode_system), intent(inout) :: self
      real(wp), intent(in) :: t                !! time [s]
      real(wp), contiguous, intent(in) :: y(:) !! states (n_states)
      real(wp), intent(in) :: gamma            !! > 0 [s]
      logical, intent(in) :: fresh             !! linearise at (t, y); else the last linearisation will do
      logical, intent(out) :: ok               !! false: no Jacobian here, or the matrix is singular

      ok = .true.
      call self%dense%reserve(self%n_states)
      if (fresh) then
         call self%jacobian(t, y, self%dense%jacobian, ok)
         self%dense%jacobian(self%n_controlled + 1:, :) = 0.0_wp
      end if
      if (ok) call self%dense%factorise(gamma, ok)
   end subroutine factorise_dense

   !> x <- (1 - gamma df/dy)^-1 x.
   subroutine solve_dense(self, x)
      class(ode_system), intent(inout) :: self
      real(wp), contiguous, intent(inout) :: x(:) !! (n_states)
      call self%dense%solve(x)
   end subroutine solve_dense

   !> Forget what searches for modes keep from one to the next. By default nothing.
   subroutine nothing_to_forget(self)
      class(mechanical_system), intent(inout) :: self
      associate (unused => self); end associate
   end subroutine nothing_to_forget

end module rodyn_ode
