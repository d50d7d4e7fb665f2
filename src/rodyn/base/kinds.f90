!> The one working precision of the program.
module rodyn_kinds
   use, intrinsic :: iso_fortran_env, only: int64, real64
   implicit none (type, external)
   private
   public :: wp, i8

   integer, parameter :: wp = real64 !! every real of the model
   integer, parameter :: i8 = int64  !! counters that outgrow a default integer
end module rodyn_kinds
