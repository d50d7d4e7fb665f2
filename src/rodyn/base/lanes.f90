!> How many evaluations of the equations go side by side through the processor's vector units.
module rodyn_lanes
   implicit none (type, external)
   private

   !> One vector of AVX-512, two of AVX2. Also the number of nodes of the Gauss collocation (`rodyn_gauss_collocation`).
   integer, parameter, public :: lanes = 8
end module rodyn_lanes
