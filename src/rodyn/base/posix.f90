!> The few POSIX calls the program needs (Linux: glibc or musl). Those of sweeps are in `rodyn_posix_files`.
!>
!> Calls that can fail return the reason as text, empty on success, so that callers word their own messages.
module rodyn_posix
   use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_f_pointer, c_funptr, c_int, c_int16_t, c_int64_t, &
      c_intptr_t, c_loc, c_long, c_null_char, c_null_funptr, c_ptr, c_size_t
   use rodyn_text, only: to_text
   implicit none (type, external)
   private
   public :: posix_close, posix_fsync, posix_ftruncate, posix_open, posix_signal, sig_ign ! for the other modules of files
   public :: read_all
   public :: process_id, parent_id, host_name, utc_now
   public :: path_exists, same_path, is_directory, is_special, is_writable, parent_directory
   public :: sync_path, rename_over, rename_new, remove_file
   public :: ignore_signal, sigpipe, sigxfsz, write_all, write_text, standard_output, standard_error
   public :: c_text, error_text, failure_of, last_failure, last_failure_is
   public :: eacces, eagain, eexist, efbig, eintr, einval, enodev, enosys, enotsup

   integer(c_int), parameter :: f_ok = 0, x_ok = 1, w_ok = 2, r_ok = 4     ! <unistd.h>
   integer(c_int), parameter :: o_rdonly = 0                               ! <fcntl.h>
   integer(c_int), parameter :: eperm = 1, eintr = 4, eagain = 11, enomem = 12, eacces = 13, eexist = 17 ! <errno.h>, Linux
   integer(c_int), parameter :: enodev = 19, einval = 22, efbig = 27, emlink = 31, enosys = 38, enotsup = 95 ! likewise
   integer(c_int), parameter :: sigpipe = 13, sigxfsz = 25                 ! <signal.h>, Linux
   integer(c_int), parameter :: standard_output = 1, standard_error = 2    ! <unistd.h>
   integer(c_intptr_t), parameter :: sig_ign = 1_c_intptr_t                ! <signal.h>
   integer, parameter :: statx_words = 128, at_mode = 15                   ! struct statx, in words of 16 bits
   integer, parameter :: all_kinds = int(o'170000'), file_kind = int(o'100000'), directory_kind = int(o'040000') ! <sys/stat.h>

   interface
      !> Number of this process.
      integer(c_int) function process_id() bind(c, name='getpid')
         import :: c_int
         implicit none (type, external)
      end function process_id

      !> Number of the process that started this one.
      integer(c_int) function parent_id() bind(c, name='getppid')
         import :: c_int
         implicit none (type, external)
      end function parent_id

      integer(c_int) function posix_gethostname(name, length) bind(c, name='gethostname')
         import :: c_char, c_int, c_size_t
         implicit none (type, external)
         character(kind=c_char), intent(out) :: name(*)
         integer(c_size_t), value :: length
      end function posix_gethostname

      integer(c_intptr_t) function posix_write(descriptor, data, count) bind(c, name='write')
         import :: c_int, c_intptr_t, c_ptr, c_size_t
         implicit none (type, external)
         integer(c_int), intent(in), value :: descriptor
         type(c_ptr), intent(in), value :: data
         integer(c_size_t), intent(in), value :: count
      end function posix_write

      integer(c_intptr_t) function posix_read(descriptor, bytes, count) bind(c, name='read')
         import :: c_char, c_int, c_intptr_t, c_size_t
         implicit none (type, external)
         integer(c_int), intent(in), value :: descriptor
         character(kind=c_char), intent(inout) :: bytes(*)
         integer(c_size_t), intent(in), value :: count
      end function posix_read

      ! variadic in C; without its third argument the call is an ordinary one
      integer(c_int) function posix_open(path, flags) bind(c, name='open')
         import :: c_char, c_int
         implicit none (type, external)
         character(kind=c_char), intent(in) :: path(*)
         integer(c_int), value :: flags
      end function posix_open

      integer(c_int) function posix_close(descriptor) bind(c, name='close')
         import :: c_int
         implicit none (type, external)
         integer(c_int), value :: descriptor
      end function posix_close

      integer(c_int) function posix_fsync(descriptor) bind(c, name='fsync')
         import :: c_int
         implicit none (type, external)
         integer(c_int), value :: descriptor
      end function posix_fsync

      integer(c_int) function posix_ftruncate(descriptor, bytes) bind(c, name='ftruncate')
         import :: c_int, c_int64_t
         implicit none (type, external)
         integer(c_int), value :: descriptor
         integer(c_int64_t), value :: bytes
      end function posix_ftruncate

      integer(c_int) function posix_access(path, mode) bind(c, name='access')
         import :: c_char, c_int
         implicit none (type, external)
         character(kind=c_char), intent(in) :: path(*)
         integer(c_int), value :: mode
      end function posix_access

      ! statx(2) has one layout on all processors
      integer(c_int) function posix_statx(directory, path, flags, mask, words) bind(c, name='statx')
         import :: c_char, c_int, c_int16_t, statx_words
         implicit none (type, external)
         integer(c_int), value :: directory, flags, mask
         character(kind=c_char), intent(in) :: path(*)
         integer(c_int16_t), intent(out) :: words(statx_words)
      end function posix_statx

      integer(c_int) function posix_rename(old, new) bind(c, name='rename')
         import :: c_char, c_int
         implicit none (type, external)
         character(kind=c_char), intent(in) :: old(*), new(*)
      end function posix_rename

      integer(c_int) function posix_link(old, new) bind(c, name='link')
         import :: c_char, c_int
         implicit none (type, external)
         character(kind=c_char), intent(in) :: old(*), new(*)
      end function posix_link

      integer(c_int) function posix_unlink(path) bind(c, name='unlink')
         import :: c_char, c_int
         implicit none (type, external)
         character(kind=c_char), intent(in) :: path(*)
      end function posix_unlink

      type(c_funptr) function posix_signal(number, handler) bind(c, name='signal')
         import :: c_funptr, c_int
         implicit none (type, external)
         integer(c_int), value :: number
         type(c_funptr), value :: handler
      end function posix_signal

      type(c_ptr) function posix_errno_location() bind(c, name='__errno_location')
         import :: c_ptr
         implicit none (type, external)
      end function posix_errno_location

      type(c_ptr) function posix_strerror(number) bind(c, name='strerror')
         import :: c_int, c_ptr
         implicit none (type, external)
         integer(c_int), value :: number
      end function posix_strerror

      integer(c_size_t) function posix_strlen(text) bind(c, name='strlen')
         import :: c_ptr, c_size_t
         implicit none (type, external)
         type(c_ptr), value :: text
      end function posix_strlen

      ! time_t is taken as long, which it is on every 64-bit Linux
      integer(c_long) function posix_time(seconds) bind(c, name='time')
         import :: c_long
         implicit none (type, external)
         integer(c_long), intent(out) :: seconds
      end function posix_time

      type(c_ptr) function posix_gmtime(seconds) bind(c, name='gmtime')
         import :: c_long, c_ptr
         implicit none (type, external)
         integer(c_long), intent(in) :: seconds
      end function posix_gmtime

      integer(c_size_t) function posix_strftime(text, size, format, broken_down) bind(c, name='strftime')
         import :: c_char, c_ptr, c_size_t
         implicit none (type, external)
         character(kind=c_char), intent(out) :: text(*)
         integer(c_size_t), value :: size
         character(kind=c_char), intent(in) :: format(*)
         type(c_ptr), value :: broken_down
      end function posix_strftime
   end interface

contains

   !> Name of this machine; 'unknown' if the system does not tell.
   function host_name() result(name)
      character(len=:), allocatable :: name
      character(kind=c_char, len=256) :: buffer

      buffer = repeat(c_null_char, len(buffer))
      name = 'unknown'
      if (posix_gethostname(buffer, int(len(buffer) - 1, c_size_t)) /= 0) return
      if (index(buffer, c_null_char) > 1) name = buffer(:index(buffer, c_null_char) - 1)
   end function host_name

   !> The time now, UTC, ISO 8601: '2025-01-31T23:59:59Z'.
   function utc_now() result(text)
      character(len=:), allocatable :: text
      character(kind=c_char, len=32) :: buffer
      integer(c_long) :: seconds, again
      integer(c_size_t) :: length

      again = posix_time(seconds)
      length = posix_strftime(buffer, int(len(buffer), c_size_t), '%Y-%m-%dT%H:%M:%SZ'//c_null_char, posix_gmtime(again))
      text = buffer(:length)
   end function utc_now

   !> Is there anything (file, directory, ...) with this name?
   function path_exists(path) result(exists)
      character(len=*), intent(in) :: path
      logical :: exists
      exists = posix_access(path//c_null_char, f_ok) == 0
   end function path_exists

   !> Do two paths name one existing file, by whatever links and dots?
   function same_path(a, b) result(same)
      character(len=*), intent(in) :: a, b
      logical :: same
      integer, parameter :: number_and_device(8) = [17, 18, 19, 20, 69, 70, 71, 72]
      integer(c_int16_t) :: of_a(statx_words), of_b(statx_words)
      of_a = status_of(a)
      of_b = status_of(b)
      same = of_a(at_mode) /= 0 .and. all(of_a(number_and_device) == of_b(number_and_device))
   end function same_path

   !> Is this a directory that can be read?
   function is_directory(path) result(directory)
      character(len=*), intent(in) :: path
      logical :: directory
      directory = kind_of(path) == directory_kind .and. posix_access(path//c_null_char, r_ok) == 0
   end function is_directory

   !> Is there something at this path that is neither a file nor a directory: a device, a pipe, a socket?
   function is_special(path) result(special)
      character(len=*), intent(in) :: path
      logical :: special
      special = all(kind_of(path) /= [0, file_kind, directory_kind])
   end function is_special

   !> Kind of what a path leads to; 0: nothing.
   integer function kind_of(path)
      character(len=*), intent(in) :: path
      integer(c_int16_t) :: words(statx_words)
      words = status_of(path)
      kind_of = iand(int(words(at_mode)), all_kinds)
   end function kind_of

   !> What the system knows of the file that a path leads to: zeros if there is none.
   function status_of(path) result(words)
      character(len=*), intent(in) :: path
      integer(c_int16_t) :: words(statx_words)
      integer(c_int), parameter :: at_fdcwd = -100, statx_type_and_number = int(z'101') ! <fcntl.h>, <sys/stat.h>
      if (posix_statx(at_fdcwd, path//c_null_char, 0_c_int, statx_type_and_number, words) /= 0) words = 0_c_int16_t
   end function status_of

   !> May this process make files in a directory?
   function is_writable(directory) result(writable)
      character(len=*), intent(in) :: directory
      logical :: writable
      writable = posix_access(directory//c_null_char, ior(w_ok, x_ok)) == 0
   end function is_writable

   !> The directory a path lies in: 'a' for 'a/b', '.' for 'b', '/' for '/b'.
   pure function parent_directory(path) result(directory)
      character(len=*), intent(in) :: path
      character(len=:), allocatable :: directory
      integer :: slash

      slash = index(path, '/', back=.true.)
      directory = '.'
      if (slash > 0) directory = path(:max(1, slash - 1))
   end function parent_directory

   !> Have the system put a file's data, or a directory's names, onto the disk.
   function sync_path(path) result(failure)
      character(len=*), intent(in) :: path
      character(len=:), allocatable :: failure !! empty on success
      integer(c_int) :: descriptor, status

      descriptor = posix_open(path//c_null_char, o_rdonly)
      failure = failure_of(descriptor)
      if (descriptor < 0) return
      failure = failure_of(posix_fsync(descriptor))
      status = posix_close(descriptor)
   end function sync_path

   !> Rename a file, replacing an existing one in the same instant.
   function rename_over(old, new) result(failure)
      character(len=*), intent(in) :: old, new
      character(len=:), allocatable :: failure !! empty on success
      failure = failure_of(posix_rename(old//c_null_char, new//c_null_char))
   end function rename_over

   !> Rename a file unless the new name is taken, with no instant in which another process could slip in:
   !> link(2) refuses an existing name. Where a file system has no hard links, a check and a rename must do.
   subroutine rename_new(old, new, taken, failure)
      character(len=*), intent(in) :: old, new
      logical, intent(out) :: taken                         !! the new name exists; nothing was done
      character(len=:), allocatable, intent(out) :: failure !! empty on success
      integer(c_int) :: number

      failure = ''
      taken = .false.
      if (posix_link(old//c_null_char, new//c_null_char) == 0) then
         failure = remove_file(old)
         return
      end if

      number = errno()
      select case (number)
      case (eexist)
         taken = .true.
      case (eperm, emlink, enosys, enotsup)
         taken = path_exists(new)
         if (.not. taken) failure = rename_over(old, new)
      case default
         failure = error_text(number)
      end select
      if (taken) failure = error_text(eexist)
   end subroutine rename_new

   !> Remove a file's name.
   function remove_file(path) result(failure)
      character(len=*), intent(in) :: path
      character(len=:), allocatable :: failure !! empty on success
      failure = failure_of(posix_unlink(path//c_null_char))
   end function remove_file

   !> Let what causes a signal fail with a reason instead: a write beyond the file-size limit (SIGXFSZ, EFBIG), or into a
   !> pipe that nobody reads (SIGPIPE, EPIPE). By default these signals kill.
   subroutine ignore_signal(number)
      integer(c_int), intent(in) :: number
      type(c_funptr) :: previous
      previous = posix_signal(number, transfer(sig_ign, c_null_funptr))
   end subroutine ignore_signal

   !> Write a text to an open file.
   function write_text(descriptor, text) result(failure)
      integer(c_int), intent(in) :: descriptor
      character(len=*), intent(in), target :: text
      character(len=:), allocatable :: failure !! empty on success
      failure = write_all(descriptor, c_loc(text), len(text, kind=c_size_t))
   end function write_text

   !> Hand all bytes to the system: in one call, unless it takes less or is interrupted.
   function write_all(descriptor, data, bytes) result(failure)
      integer(c_int), intent(in) :: descriptor
      type(c_ptr), intent(in) :: data
      integer(c_size_t), intent(in) :: bytes
      character(len=:), allocatable :: failure !! empty on success
      character(kind=c_char), pointer :: rest(:)
      integer(c_size_t) :: done
      integer(c_intptr_t) :: written

      failure = ''
      done = 0
      if (bytes > 0) call c_f_pointer(data, rest, [bytes])
      do while (done < bytes)
         written = posix_write(descriptor, c_loc(rest(done + 1)), bytes - done)
         if (written > 0) then
            done = done + written
         else if (errno() /= eintr) then
            failure = last_failure()
            return
         end if
      end do
   end function write_all

   !> Everything that can be read behind a path, whatever its kind: a file, a pipe, a device; its size is not asked for.
   subroutine read_all(path, most, text, failure)
      character(len=*), intent(in) :: path !! empty: standard input
      integer, intent(in) :: most          !! bytes; what is longer is a failure
      character(len=:), allocatable, intent(out) :: text
      character(len=:), allocatable, intent(out) :: failure !! empty on success
      integer(c_int), parameter :: standard_input = 0
      integer(c_int) :: descriptor, status

      descriptor = standard_input
      if (len(path) > 0) descriptor = posix_open(path//c_null_char, o_rdonly)
      failure = failure_of(descriptor)
      if (descriptor < 0) return
      call read_until_end(descriptor, most, text, failure)
      if (len(path) > 0) status = posix_close(descriptor)
   end subroutine read_all

   subroutine read_until_end(descriptor, most, text, failure)
      integer(c_int), intent(in) :: descriptor
      integer, intent(in) :: most
      character(len=:), allocatable, intent(out) :: text
      character(len=:), allocatable, intent(out) :: failure
      character(len=:), allocatable :: buffer
      integer(c_intptr_t) :: n
      integer :: length

      failure = ''
      length = 0
      call resize(buffer, 0, min(most, 65536) + 1, failure)
      do while (len(failure) == 0)
         if (length == len(buffer)) call resize(buffer, length, min(most, 2*length) + 1, failure)
         if (len(failure) > 0) exit
         n = posix_read(descriptor, buffer(length + 1:), int(len(buffer) - length, c_size_t))
         if (n == 0) exit
         if (n > 0) then
            length = length + int(n)
            if (length > most) failure = 'more than '//to_text(most/1024**2)//' MB'
         else if (errno() /= eintr) then
            failure = last_failure()
         end if
      end do
      if (len(failure) == 0) text = buffer(:length)
   end subroutine read_until_end

   !> Room for a text that grows.
   subroutine resize(buffer, length, size, failure)
      character(len=:), allocatable, intent(inout) :: buffer
      integer, intent(in) :: length !! characters to keep
      integer, intent(in) :: size
      character(len=:), allocatable, intent(inout) :: failure
      character(len=:), allocatable :: larger
      integer :: stat

      allocate (character(len=size) :: larger, stat=stat)
      if (stat /= 0) then
         failure = error_text(enomem)
         return
      end if
      if (length > 0) larger(:length) = buffer(:length)
      call move_alloc(larger, buffer)
   end subroutine resize

   !> Why the last call failed.
   function last_failure() result(text)
      character(len=:), allocatable :: text
      text = error_text(errno())
   end function last_failure

   !> Why the call that returned this failed; empty: it did not.
   function failure_of(status) result(failure)
      integer(c_int), intent(in) :: status !! < 0: failed
      character(len=:), allocatable :: failure
      failure = ''
      if (status < 0) failure = last_failure()
   end function failure_of

   !> Did the last call fail for this reason (an errno of Linux)?
   function last_failure_is(number) result(same)
      integer, intent(in) :: number
      logical :: same
      same = errno() == int(number, c_int)
   end function last_failure_is

   function errno() result(number)
      integer(c_int) :: number
      integer(c_int), pointer :: location
      call c_f_pointer(posix_errno_location(), location)
      number = location
   end function errno

   !> What an errno means.
   function error_text(number) result(text)
      integer(c_int), intent(in) :: number
      character(len=:), allocatable :: text
      text = c_text(posix_strerror(number))
   end function error_text

   !> A text of C; empty for a null pointer.
   function c_text(address) result(text)
      type(c_ptr), intent(in) :: address
      character(len=:), allocatable :: text
      character(kind=c_char), pointer :: characters(:)
      integer :: i

      text = ''
      if (.not. c_associated(address)) return
      call c_f_pointer(address, characters, [posix_strlen(address)])
      text = repeat(' ', size(characters))
      do i = 1, size(characters)
         text(i:i) = characters(i)
      end do
   end function c_text

end module rodyn_posix
