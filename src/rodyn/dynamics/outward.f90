!> Room for what the inward pass of a recursion leaves of a rod for the outward pass.
module rodyn_outward
   implicit none (type, external)
   private

   !> Numbers of a rod. The kernels use odd places only: gfortran gathers neighbours in a vector before it stores them, and that
   !> takes longer than to store them one by one (4 % of a right-hand side at n = 4, 12 % at n = 64).
   integer, parameter, public :: outward_size = 19
end module rodyn_outward
