!> What an integrator needs to know of a system of first-order equations y' = f(t, y), and no more.
module rodyn_ode
   use rodyn_kinds, only: wp
   use rodyn_lanes, only: lanes
   use rodyn_dense_newton, only: dense_newton
   use rodyn_stiff_modes, only: stiff_modes
   implicit none (type, external)
   private
   public :: ode_system, mechanical_system, n_quadratures
   public :: factorise_dense, solve_dense

   !> Of a system that has any: work and dissipated energy. A constant, so that sums of them need no memory from the heap.
   integer, parameter :: n_quadratures = 2

   !> A system of `n_controlled` equations, and quadratures behind them (work, dissipated energy), `n_states` in all. No equation
   !> depends on a quadrature, so a run with them makes the same steps as one without. Their error is controlled apart: that of
   !> each step is held below `quadrature_tolerance`, in shorter steps of their own if need be.
   !>
   !> Implicit methods solve (1 - g df/dy) x = r by `factorise_newton` and `solve_newton`. A system that knows the
   !> structure of its Jacobian overrides both.
   type, abstract :: ode_system
      integer :: n_states = 0     !! length of y
      integer :: n_controlled = 0 !! leading states: those in the error norm
      integer :: n_events = 0     !! functions whose sign changes end the smooth part of the run
      real(wp) :: quadrature_base = 0.0_wp  !! what quadratures are compared with beside themselves, of their unit
      real(wp) :: quadrature_scale = 0.0_wp !! the largest sum of that and their absolute values so far
      real(wp) :: unit_energy = 0.0_wp      !! kinetic energy at rates of one: what a tolerance of rates is as energy
      real(wp) :: quadrature_error(n_quadratures) = 0.0_wp !! their estimated errors, summed over the steps
      type(dense_newton), private :: dense
   contains
      procedure :: has_quadratures
      procedure :: quadratures
      procedure :: begin_quadratures
      procedure :: quadrature_tolerance
      procedure :: note_quadratures
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
   end interface

   abstract interface
      !> Right-hand side, that of the quadratures only where ydot has room for them. Allocates nothing.
      subroutine rhs_interface(self, t, y, ydot, ok)
         import :: ode_system, wp
         implicit none (type, external)
         class(ode_system), intent(inout) :: self
         real(wp), intent(in) :: t       !! time [s]
         real(wp), contiguous, intent(in) :: y(:)    !! states (n_states or n_controlled)
         real(wp), contiguous, intent(out) :: ydot(:) !! their rates
         logical, intent(out) :: ok      !! false: not finite, or a factorization failed
      end subroutine rhs_interface

      !> Exact Jacobian df/dy of the controlled states.
      subroutine jacobian_interface(self, t, y, jac, ok)
         import :: ode_system, wp
         implicit none (type, external)
         class(ode_system), intent(inout) :: self
         real(wp), intent(in) :: t         !! time [s]
         real(wp), contiguous, intent(in) :: y(:)      !! states (n_controlled or more)
         real(wp), contiguous, intent(out) :: jac(:, :) !! df_i/dy_j (n_controlled, n_controlled)
         logical, intent(out) :: ok        !! false: it could not be formed
      end subroutine jacobian_interface
   end interface

contains

   !> True if quadratures stand behind the controlled states.
   pure logical function has_quadratures(self)
      class(ode_system), intent(in) :: self
      has_quadratures = self%n_states > self%n_controlled
   end function has_quadratures

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

   !> Rates of the quadratures alone. A system that has cheaper means than its right-hand side overrides this.
   subroutine quadratures(self, t, y, rate, ok)
      class(ode_system), intent(inout) :: self
      real(wp), intent(in) :: t                !! [s]
      real(wp), contiguous, intent(in) :: y(:) !! states (n_controlled)
      real(wp), intent(out) :: rate(n_quadratures)
      logical, intent(out) :: ok
      real(wp) :: ydot(self%n_states), all_of_y(self%n_states)

      all_of_y = 0.0_wp
      all_of_y(:self%n_controlled) = y
      call self%rhs(t, all_of_y, ydot, ok)
      rate = ydot(self%n_controlled + 1:)
   end subroutine quadratures

   !> Before a run: nothing has been summed up yet.
   subroutine begin_quadratures(self, base, unit_energy)
      class(ode_system), intent(inout) :: self
      real(wp), intent(in) :: base        !! what they are compared with beside themselves, >= 0
      real(wp), intent(in) :: unit_energy !! kinetic energy at rates of one, > 0
      self%quadrature_base = base
      self%unit_energy = unit_energy
      self%quadrature_scale = 0.0_wp
      self%quadrature_error = 0.0_wp
   end subroutine begin_quadratures

   !> The error that a step to these values may make: rtol of the largest energy E so far, which is at most the initial one and the
   !> sums, and what E changes by where rates are off by atol, as the motion's may be. With E = e v^2, e being the kinetic energy at
   !> rates of one, that is e (v + atol)^2 - E. So at rest, where powers are rounding alone, the tolerance does not vanish.
   pure real(wp) function quadrature_tolerance(self, rtol, atol, values) result(tolerance)
      class(ode_system), intent(in) :: self
      real(wp), intent(in) :: rtol, atol !! of the motion
      real(wp), intent(in) :: values(n_quadratures)
      real(wp) :: energy
      energy = max(self%quadrature_scale, self%quadrature_base + sum(abs(values)))
      tolerance = rtol*energy + atol*(2.0_wp*sqrt(self%unit_energy*energy) + atol*self%unit_energy)
   end function quadrature_tolerance

   !> A step to these values is done, with so much of an error.
   subroutine note_quadratures(self, values, error)
      class(ode_system), intent(inout) :: self
      real(wp), intent(in) :: values(n_quadratures), error(n_quadratures)
      self%quadrature_scale = max(self%quadrature_scale, self%quadrature_base + sum(abs(values)))
      self%quadrature_error = self%quadrature_error + error
   end subroutine note_quadratures

   !> Factor 1 - gamma df/dy.
   subroutine factorise_dense(self, t, y, gamma, fresh, ok)
      class(ode_system), intent(inout) :: self
      real(wp), intent(in) :: t                !! time [s]
      real(wp), contiguous, intent(in) :: y(:) !! states (n_controlled)
      real(wp), intent(in) :: gamma            !! > 0 [s]
      logical, intent(in) :: fresh             !! linearise at (t, y); else the last linearisation will do
      logical, intent(out) :: ok               !! false: no Jacobian here, or the matrix is singular

      ok = .true.
      call self%dense%reserve(self%n_controlled)
      if (fresh) call self%jacobian(t, y, self%dense%jacobian, ok)
      if (ok) call self%dense%factorise(gamma, ok)
   end subroutine factorise_dense

   !> x <- (1 - gamma df/dy)^-1 x.
   subroutine solve_dense(self, x)
      class(ode_system), intent(inout) :: self
      real(wp), contiguous, intent(inout) :: x(:) !! (n_controlled)
      call self%dense%solve(x)
   end subroutine solve_dense

   !> Forget what searches for modes keep from one to the next. By default nothing.
   subroutine nothing_to_forget(self)
      class(mechanical_system), intent(inout) :: self
      associate (unused => self); end associate
   end subroutine nothing_to_forget

end module rodyn_ode
