!> A file that only grows. What has been appended outlives the process, however that ends; after `sync` it outlives a loss
!> of power as well.
!>
!>     failure = file%create(path)        ! or file%reopen(path)
!>     failure = file%append(words)       ! one write; if it fails, the file is cut to what was whole before
!>     failure = file%sync()
!>     call file%close()
!>
!> As in `rodyn_posix`, calls return why they failed, empty on success.
module rodyn_growing_file
   use, intrinsic :: iso_c_binding, only: c_int, c_loc, c_null_char, c_size_t
   use rodyn_kinds, only: i8
   use rodyn_posix, only: failure_of, posix_close, posix_fsync, posix_ftruncate, posix_open, write_all
   use rodyn_posix_files, only: create_file, file_bytes, o_append, o_wronly
   implicit none (type, external)
   private
   public :: growing_file

   type :: growing_file
      integer(c_int), private :: descriptor = -1
      integer(i8), private :: bytes = 0 !! of whole appends
   contains
      procedure :: is_open
      procedure :: create
      procedure :: reopen
      procedure :: append
      procedure :: sync
      procedure :: close => close_file
   end type growing_file

contains

   pure logical function is_open(self)
      class(growing_file), intent(in) :: self
      is_open = self%descriptor >= 0
   end function is_open

   !> Begin a file. No file may have that name.
   function create(self, path) result(failure)
      class(growing_file), intent(inout) :: self
      character(len=*), intent(in) :: path
      character(len=:), allocatable :: failure

      self%bytes = 0
      self%descriptor = create_file(path)
      failure = failure_of(self%descriptor)
   end function create

   !> Go on with a file that is there.
   function reopen(self, path) result(failure)
      class(growing_file), intent(inout) :: self
      character(len=*), intent(in) :: path
      character(len=:), allocatable :: failure

      self%bytes = file_bytes(path)
      self%descriptor = posix_open(path//c_null_char, ior(o_wronly, o_append))
      failure = failure_of(self%descriptor)
   end function reopen

   !> Add words at the end: all of them or none.
   function append(self, words) result(failure)
      class(growing_file), intent(inout) :: self
      integer(i8), intent(in), contiguous, target :: words(:)
      character(len=:), allocatable :: failure
      integer(c_int) :: status

      failure = write_all(self%descriptor, c_loc(words), 8_c_size_t*size(words, kind=c_size_t))
      if (len(failure) == 0) then
         self%bytes = self%bytes + 8_i8*size(words)
      else
         status = posix_ftruncate(self%descriptor, self%bytes) ! if this fails too, the torn end is noticed on reading
      end if
   end function append

   !> Have the system put all of it onto the disk.
   function sync(self) result(failure)
      class(growing_file), intent(in) :: self
      character(len=:), allocatable :: failure
      failure = failure_of(posix_fsync(self%descriptor))
   end function sync

   subroutine close_file(self)
      class(growing_file), intent(inout) :: self
      integer(c_int) :: status
      if (self%is_open()) status = posix_close(self%descriptor)
      self%descriptor = -1
   end subroutine close_file

end module rodyn_growing_file
