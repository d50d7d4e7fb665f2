!> What the ensemble integrator needs to know of like systems side by side, one to a lane: y = (q, p) with
!> q' = p, p' = f(t, q, p) in each.
module rodyn_lane_ode
   use rodyn_kinds, only: wp
   use rodyn_lanes, only: lanes
   implicit none (type, external)
   private
   public :: lane_system

   type, abstract :: lane_system
      integer :: n_dof = 0         !! length of q and p, the same in every lane
      logical :: turning = .false. !! q(1)' = p(1) + p(3) q(2),  q(2)' = p(2) - p(3) q(1)
   contains
      procedure(lane_accelerations_interface), deferred :: accelerations
   end type lane_system

   abstract interface
      !> p' in every lane. What a lane computes never depends on another one. Allocates nothing.
      subroutine lane_accelerations_interface(self, t, q, p, acceleration, ok)
         import :: lane_system, wp, lanes
         implicit none (type, external)
         class(lane_system), intent(inout) :: self
         real(wp), intent(in) :: t(lanes)                        !! [s]
         real(wp), contiguous, intent(in) :: q(:, :), p(:, :)    !! (lanes, n_dof)
         real(wp), contiguous, intent(out) :: acceleration(:, :) !! p' (lanes, n_dof)
         logical, intent(out) :: ok(lanes)                       !! false: not finite, or M not positive definite
      end subroutine lane_accelerations_interface
   end interface

end module rodyn_lane_ode
