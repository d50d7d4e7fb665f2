!> A chain as the node that carries it feels it, docs/model.md sec. 4.2, and room for what the inward pass of a recursion leaves of
!> its rods for the outward pass. Beyond hinge 0 it is all that the spacecraft knows of the chain.
module rodyn_outboard_chain
   use rodyn_kinds, only: wp
   use rodyn_lanes, only: lanes
   implicit none (type, external)
   private
   public :: outboard_chain, lane_outboard_chain

   !> Numbers of a rod. The kernels use odd places only: gfortran gathers neighbours in a vector before it stores them, and that
   !> takes longer than to store them one by one (4 % of a right-hand side at n = 4, 12 % at n = 64).
   integer, parameter, public :: outward_size = 19
   integer, parameter, public :: lane_outward_size = 8 !! the same in vector lanes, which are stored one by one anyway

   !> To move the node by an acceleration A takes the force f = P A + b, P symmetric, on top of the node's own mass; the hinge
   !> there passes a moment.
   type :: outboard_chain
      real(wp) :: pee, pen, pnn !! P [kg]
      real(wp) :: det           !! its determinant [kg^2]
      real(wp) :: be, bn        !! b [N]
      real(wp) :: mass          !! mu of the node [kg]
      real(wp) :: moment        !! T of the hinge [N m]
   end type outboard_chain

   !> The same in vector lanes.
   type :: lane_outboard_chain
      real(wp), dimension(lanes) :: pee, pen, pnn, det, be, bn, mass, moment
   end type lane_outboard_chain

end module rodyn_outboard_chain
