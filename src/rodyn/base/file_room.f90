!> Room for a file to grow, made sure of before it is needed: so a full disk, a quota or a limit of file sizes is met between
!> two writes, and not within one.
!>
!> File systems that copy on writing (btrfs, ZFS, bcachefs) need new space for what is overwritten, and for their own trees: some
!> is left over there. Those that cannot set bytes aside (NFS before 4.2, FUSE), and may have quotas that only a write meets, are
!> tried with zeros.
!>
!>     failure = room%open(path)
!>     failure = room%reserve(bytes)   ! empty: that much may be written behind its end now
!>     call room%close()
!>
!> As in `rodyn_posix`, calls return why they failed, empty on success.
module rodyn_file_room
   use, intrinsic :: iso_c_binding, only: c_char, c_int, c_int64_t, c_null_char
   use rodyn_kinds, only: i8, wp
   use rodyn_posix, only: efbig, eintr, einval, enodev, enosys, enotsup, error_text, failure_of, last_failure, last_failure_is, &
      posix_close, posix_fsync, posix_ftruncate, posix_open
   use rodyn_resources, only: file_size_limit
   implicit none (type, external)
   private
   public :: file_room

   integer(c_int), parameter :: o_rdwr = 2, seek_end = 2                ! <fcntl.h>, <unistd.h>, Linux
   integer(c_int), parameter :: keep_size = 1, punch_hole = 2           ! <linux/falloc.h>
   integer(c_int64_t), parameter :: copying(3) = [int(z'9123683E', c_int64_t), int(z'2FC12FC1', c_int64_t), &
                                                  int(z'CA451A4E', c_int64_t)] ! <linux/magic.h> and others: what copies
   integer(i8), parameter :: bytes_of_copies = 262144

   type :: file_room
      integer(c_int), private :: descriptor = -1
      integer(i8), private :: spare = 0 !! left over at each call [bytes]
   contains
      procedure :: open => open_room
      procedure :: reserve
      procedure :: copy
      procedure :: close => close_room
      procedure, private :: set_aside
      procedure, private :: try_with_zeros
   end type file_room

   interface
      integer(c_int64_t) function posix_lseek(descriptor, offset, whence) bind(c, name='lseek')
         import :: c_int, c_int64_t
         implicit none (type, external)
         integer(c_int), value :: descriptor, whence
         integer(c_int64_t), value :: offset
      end function posix_lseek

      integer(c_int) function posix_fallocate(descriptor, mode, offset, bytes) bind(c, name='fallocate')
         import :: c_int, c_int64_t
         implicit none (type, external)
         integer(c_int), value :: descriptor, mode
         integer(c_int64_t), value :: offset, bytes
      end function posix_fallocate

      integer(c_int64_t) function posix_pwrite(descriptor, bytes, count, offset) bind(c, name='pwrite')
         import :: c_char, c_int, c_int64_t
         implicit none (type, external)
         integer(c_int), value :: descriptor
         character(kind=c_char), intent(in) :: bytes(*)
         integer(c_int64_t), value :: count, offset
      end function posix_pwrite

      integer(c_int) function posix_fstatfs(descriptor, words) bind(c, name='fstatfs')
         import :: c_int, c_int64_t
         implicit none (type, external)
         integer(c_int), value :: descriptor
         integer(c_int64_t), intent(inout) :: words(*) !! the first: kind of file system
      end function posix_fstatfs

      integer(c_int64_t) function posix_sendfile(to, from, offset, bytes) bind(c, name='sendfile')
         import :: c_int, c_int64_t
         implicit none (type, external)
         integer(c_int), value :: to, from
         integer(c_int64_t), intent(inout) :: offset
         integer(c_int64_t), value :: bytes
      end function posix_sendfile
   end interface

contains

   !> Watch a file that somebody writes.
   function open_room(self, path) result(failure)
      class(file_room), intent(inout) :: self
      character(len=*), intent(in) :: path
      character(len=:), allocatable :: failure
      integer(c_int64_t) :: words(32)

      self%descriptor = posix_open(path//c_null_char, o_rdwr)
      failure = failure_of(self%descriptor)
      self%spare = 0
      if (posix_fstatfs(self%descriptor, words) == 0) self%spare = merge(bytes_of_copies, 0_i8, any(words(1) == copying))
   end function open_room

   !> Have the file system set bytes aside behind the end of the file, whose size stays as it is.
   function reserve(self, bytes) result(failure)
      class(file_room), intent(in) :: self
      integer(i8), intent(in) :: bytes
      character(len=:), allocatable :: failure
      integer(c_int64_t) :: at
      integer(c_int) :: status

      at = posix_lseek(self%descriptor, 0_c_int64_t, seek_end)
      if (real(at + bytes, wp) > file_size_limit()) then
         failure = error_text(efbig)
         return
      end if
      failure = self%set_aside(at, bytes + self%spare)
      if (self%spare > 0) status = posix_fallocate(self%descriptor, ior(punch_hole, keep_size), at + bytes, self%spare)
   end function reserve

   !> Bytes from a place on; empty: they are there.
   function set_aside(self, at, bytes) result(failure)
      class(file_room), intent(in) :: self
      integer(c_int64_t), intent(in) :: at, bytes
      character(len=:), allocatable :: failure

      failure = ''
      do
         if (posix_fallocate(self%descriptor, keep_size, at, bytes) == 0) return
         if (.not. last_failure_is(eintr)) exit
      end do
      if (last_failure_is(enotsup) .or. last_failure_is(enosys) .or. last_failure_is(einval) .or. last_failure_is(enodev)) then
         failure = self%try_with_zeros(at, bytes)
      else
         failure = last_failure()
      end if
   end function set_aside

   !> Write zeros, have them put onto the disk, where quotas of servers are met, and take them away again.
   function try_with_zeros(self, at, bytes) result(failure)
      class(file_room), intent(in) :: self
      integer(c_int64_t), intent(in) :: at, bytes
      character(len=:), allocatable :: failure
      character(len=65536) :: zeros
      integer(c_int64_t) :: done, written
      integer(c_int) :: status

      failure = ''
      zeros = repeat(c_null_char, len(zeros))
      done = 0
      do while (done < bytes .and. len(failure) == 0)
         written = posix_pwrite(self%descriptor, zeros, min(len(zeros, c_int64_t), bytes - done), at + done)
         if (written > 0) then
            done = done + written
         else if (.not. last_failure_is(eintr)) then
            failure = last_failure()
         end if
      end do
      if (len(failure) == 0) failure = failure_of(posix_fsync(self%descriptor))
      status = posix_ftruncate(self%descriptor, at)
   end function try_with_zeros

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
