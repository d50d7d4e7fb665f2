!> The precision of what checks the program; `bench/wide/precisions.py` puts another in its place.
module rodyn_bench_wide_kind
   use, intrinsic :: iso_fortran_env, only: real128
   implicit none (type, external)
   private
   public :: qp

   integer, parameter :: qp = real128

end module rodyn_bench_wide_kind
