module rodyn
   use rodyn_kinds, only: wp
   implicit none (type, external)
   private
   public :: wp
end module rodyn
