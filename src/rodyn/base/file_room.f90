!> Room for a file to grow, made sure of before it is needed: so a full disk, a quota or a limit of file sizes is met between
!> two writes, and not within one.
!>
!>     failure = room%open(path)
!>     failure = room%reserve(bytes)   ! empty: that much may be written behind its end now
!>     call room%close()
!>
!> As in `rodyn_posix`, calls return why they failed, empty on success.
module rodyn_file_room
   use, intrinsic :: iso_c_binding, only: c_int, c_int64_t, c_null_char
   use rodyn_kinds, only: i8, wp
   use rodyn_posix, only: error_text, last_failure, last_failure_is, parent_directory, posix_close, posix_open
   use rodyn_resources, only: file_size_limit, free_disk
   implicit none (type, external)
   private
   public :: file_room

   integer(c_int), parameter :: o_rdwr = 2, seek_end = 2, keep_size = 1 ! <fcntl.h>, <unistd.h>, Linux
   integer(c_int), parameter :: efbig = 27, enospc = 28                 ! <errno.h>, Linux
   integer, parameter :: eintr = 4, enodev = 19, einval = 22, enosys = 38, enotsup = 95

   type :: file_room
      integer(c_int), private :: descriptor = -1
      character(len=:), allocatable, private :: path
   contains
      procedure :: open => open_room
      procedure :: reserve
      procedure :: copy
      procedure :: close => close_room
   end type file_room

   interface
      function posix_lseek(descriptor, offset, whence) result(place) bind(c, name='lseek')
         import :: c_int, c_int64_t
         implicit none (type, external)
         integer(c_int), value :: descriptor, whence
         integer(c_int64_t), value :: offset
         integer(c_int64_t) :: place
      end function posix_lseek

      function posix_fallocate(descriptor, mode, offset, bytes) result(status) bind(c, name='fallocate')
         import :: c_int, c_int64_t
         implicit none (type, external)
         integer(c_int), value :: descriptor, mode
         integer(c_int64_t), value :: offset, bytes
         integer(c_int) :: status
      end function posix_fallocate

      function posix_sendfile(to, from, offset, bytes) result(sent) bind(c, name='sendfile')
         import :: c_int, c_int64_t
         implicit none (type, external)
         integer(c_int), value :: to, from
         integer(c_int64_t), intent(inout) :: offset
         integer(c_int64_t), value :: bytes
         integer(c_int64_t) :: sent
      end function posix_sendfile
   end interface

contains

   !> Watch a file that somebody writes.
   function open_room(self, path) result(failure)
      class(file_room), intent(inout) :: self
      character(len=*), intent(in) :: path
      character(len=:), allocatable :: failure

      failure = ''
      self%path = path
      self%descriptor = posix_open(path//c_null_char, o_rdwr)
      if (self%descriptor < 0) failure = last_failure()
   end function open_room

   !> Have the file system set bytes aside behind the end of the file, whose size stays as it is. File systems that cannot
   !> are asked what is free.
   function reserve(self, bytes) result(failure)
      class(file_room), intent(in) :: self
      integer(i8), intent(in) :: bytes
      character(len=:), allocatable :: failure
      integer(c_int64_t) :: at

      failure = ''
      at = posix_lseek(self%descriptor, 0_c_int64_t, seek_end)
      if (real(at + bytes, wp) > file_size_limit()) then
         failure = error_text(efbig)
         return
      end if
      do
         if (posix_fallocate(self%descriptor, keep_size, at, bytes) == 0) return
         if (.not. last_failure_is(eintr)) exit
      end do
      if (last_failure_is(enotsup) .or. last_failure_is(enosys) .or. last_failure_is(einval) .or. last_failure_is(enodev)) then
         if (real(bytes, wp) > free_disk(parent_directory(self%path))) failure = error_text(enospc)
      else
         failure = last_failure()
      end if
   end function reserve

   !> Write the content of the file, which may have no name any more, into another that is open.
   function copy(self, descriptor) result(failure)
      class(file_room), intent(in) :: self
      integer(c_int), intent(in) :: descriptor
      character(len=:), allocatable :: failure
      integer(c_int64_t) :: at, bytes, sent

      failure = ''
      bytes = posix_lseek(self%descriptor, 0_c_int64_t, seek_end)
      at = 0
      do while (at < bytes)
         sent = posix_sendfile(descriptor, self%descriptor, at, bytes - at)
         if (sent > 0) cycle
         failure = last_failure()
         return
      end do
   end function copy

   subroutine close_room(self)
      class(file_room), intent(inout) :: self
      integer(c_int) :: status
      if (self%descriptor >= 0) status = posix_close(self%descriptor)
      self%descriptor = -1
   end subroutine close_room

end module rodyn_file_room
