!> What the ensemble integrator needs to know of like systems side by side, one to a lane: y' = f(t, y) in each.
module rodyn_lane_ode
   use rodyn_kinds, only: wp
   use rodyn_lanes, only: lanes
   implicit none (type, external)
   private
   public :: lane_system

   type, abstract :: lane_system
      integer :: n_states = 0 !! length of y, the same in every lane
   contains
      procedure(lane_rhs_interface), deferred :: rhs
   end type lane_system

   abstract interface
      !> Right-hand sides. What a lane computes never depends on another one. Allocates nothing.
      subroutine lane_rhs_interface(self, t, y, ydot, ok)
         import :: lane_system, wp, lanes
         implicit none (type, external)
         class(lane_system), intent(inout) :: self
         real(wp), intent(in) :: t(lanes)                !! [s]
         real(wp), contiguous, intent(in) :: y(:, :)     !! states (lanes, n_states)
         real(wp), contiguous, intent(out) :: ydot(:, :) !! their rates (lanes, n_states)
         logical, intent(out) :: ok(lanes)               !! false: not finite, or M not positive definite
      end subroutine lane_rhs_interface
   end interface

end module rodyn_lane_ode
