!> What an integrator needs to know of a system of first-order equations y' = f(t, y), and no more.
module rodyn_ode
   use rodyn_kinds, only: wp
   implicit none (type, external)
   private
   public :: ode_system

   !> A system of `n_states` equations, of which the first `n_controlled` take part in step-size control.
   !> The others are pure quadratures (work, dissipated energy): no equation depends on them, and a run
   !> with them makes the same steps as one without.
   type, abstract :: ode_system
      integer :: n_states = 0     !! length of y
      integer :: n_controlled = 0 !! leading states in the error norm
   contains
      procedure(rhs_interface), deferred :: rhs
      procedure(jacobian_interface), deferred :: jacobian
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

end module rodyn_ode
