!> Memory that begins at a cache line, for arrays whose columns are vectors of `lanes` numbers: what ALLOCATE gives begins 16
!> bytes off, so that each vector of AVX-512 would straddle two lines, and every access cost two.
module rodyn_aligned_store
   use, intrinsic :: iso_c_binding, only: c_intptr_t, c_loc
   use rodyn_kinds, only: wp
   use rodyn_lanes, only: lanes
   implicit none (type, external)
   private
   public :: aligned_store

   integer, parameter :: line = 8 !! length of a cache line [words]

   !> One piece of memory, given away in order. It must be a target, and outlive what it gave.
   type :: aligned_store
      private
      real(wp), allocatable :: words(:)
      integer :: used = 0 !! words
   contains
      procedure :: reserve
      procedure :: matrix
      procedure :: matrices
   end type aligned_store

contains

   !> Get memory for so many columns of (lanes) numbers, all zero.
   subroutine reserve(self, n_columns)
      class(aligned_store), target, intent(inout) :: self
      integer, intent(in) :: n_columns
      integer(c_intptr_t) :: address

      allocate (self%words(lanes*n_columns + line), source=0.0_wp)
      address = transfer(c_loc(self%words(1)), address)/8_c_intptr_t
      self%used = int(modulo(-address, int(line, c_intptr_t)))
   end subroutine reserve

   !> The next m columns as (lanes, m).
   function matrix(self, m) result(array)
      class(aligned_store), target, intent(inout) :: self
      integer, intent(in) :: m
      real(wp), pointer, contiguous :: array(:, :)
      array(1:lanes, 1:m) => self%words(self%used + 1:self%used + lanes*m)
      self%used = self%used + lanes*m
   end function matrix

   !> The next m n columns as (lanes, m, n).
   function matrices(self, m, n) result(array)
      class(aligned_store), target, intent(inout) :: self
      integer, intent(in) :: m, n
      real(wp), pointer, contiguous :: array(:, :, :)
      array(1:lanes, 1:m, 1:n) => self%words(self%used + 1:self%used + lanes*m*n)
      self%used = self%used + lanes*m*n
   end function matrices

end module rodyn_aligned_store
