!> What an integrator needs to know of a system of first-order equations y' = f(t, y), and no more.
module rodyn_ode
   use rodyn_kinds, only: wp
   use rodyn_dense_newton, only: dense_newton
   implicit none (type, external)
   private
   public :: ode_system

   !> A system of `n_states` equations, of which the first `n_controlled` take part in step-size control.
   !> The others are pure quadratures (work, dissipated energy): no equation depends on them, and a run
   !> with them makes the same steps as one without.
   !>
   !> Implicit methods solve (1 - g df/dy) x = r by `factorise_newton` and `solve_newton`. A system that knows the
   !> structure of its Jacobian overrides both.
   type, abstract :: ode_system
      integer :: n_states = 0     !! length of y
      integer :: n_controlled = 0 !! leading states in the error norm
      type(dense_newton), private :: dense
   contains
      procedure(rhs_interface), deferred :: rhs
      procedure(jacobian_interface), deferred :: jacobian
      procedure :: factorise_newton
      procedure :: solve_newton
   end type ode_system

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

   !> Factor 1 - gamma df/dy. Nothing depends on the quadratures; their rows are left out, so that a system with them is
   !> solved to the last bit as one without. Their own correction is within the tolerance of the iteration.
   subroutine factorise_newton(self, t, y, gamma, fresh, ok)
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
   end subroutine factorise_newton

   !> x <- (1 - gamma df/dy)^-1 x.
   subroutine solve_newton(self, x)
      class(ode_system), intent(inout) :: self
      real(wp), contiguous, intent(inout) :: x(:) !! (n_states)
      call self%dense%solve(x)
   end subroutine solve_newton

end module rodyn_ode
