!> POSIX for sweeps: durable small files, directories, locks that die with their process, signals that ask to stop.
!>
!> Calls that can fail return the reason as text, empty on success.
module rodyn_posix_files
   use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_f_pointer, c_funloc, c_funptr, c_int, c_int16_t, &
      c_int64_t, c_loc, c_null_char, c_ptr, c_size_t
   use rodyn_checksum, only: crc64_text
   use rodyn_errors, only: error_type, exit_bad_input, raise
   use rodyn_kinds, only: i8
   use rodyn_posix, only: c_text, eacces, eagain, eexist, failure_of, ignore_signal, last_failure, last_failure_is, &
      parent_directory, path_exists, rename_over, sig_ign, sync_path, write_all, posix_close, posix_fsync, posix_open, posix_signal
   use rodyn_sorting, only: sorted_order
   use rodyn_text, only: to_text
   implicit none (type, external)
   private
   public :: make_directory, list_directory
   public :: write_words, read_words, write_text_file, append_text, file_bytes, file_checksum, rename_aside
   public :: create_file, o_append, o_wronly ! for `rodyn_growing_file`
   public :: lock_file, open_lock, take_lock, lock_holder, release_lock
   public :: watch_signals, stop_signal, stop_signals, is_stop_asked

   integer(c_int), parameter :: o_wronly = 1, o_append = 1024            ! <fcntl.h>, Linux
   integer(c_int), parameter :: f_getlk = 5, f_setlk = 6, f_setlkw = 7   ! <fcntl.h>, Linux, 64 bit
   integer(c_int16_t), parameter :: f_wrlck = 1, f_unlck = 2, seek_set = 0
   integer(c_int), parameter :: file_mode = int(o'644', c_int), directory_mode = int(o'755', c_int)
   integer(i8), parameter :: probe = 2_i8**51                            !! byte on which locks are tried
   !> Signals that ask to stop, <signal.h> of Linux. SIGXCPU comes at the soft limit of CPU time, some seconds before the end.
   integer(c_int), parameter :: watched(6) = [1_c_int, 2_c_int, 10_c_int, 12_c_int, 15_c_int, 24_c_int]
   character(len=*), parameter :: watched_names(6) = [character(len=7) :: 'SIGHUP', 'SIGINT', 'SIGUSR1', 'SIGUSR2', 'SIGTERM', &
                                                    'SIGXCPU']
   integer, parameter :: name_offset = 19                                ! of d_name in struct dirent, Linux, 64 bit
   integer, parameter :: longest_name = 255

   !> A file whose bytes are locked, not its content. One descriptor per process.
   type :: lock_file
      integer(c_int) :: descriptor = -1
      character(len=:), allocatable :: path
      logical :: pretend = .false. !! nothing is locked
   end type lock_file

   !> struct flock of Linux, 64 bit
   type, bind(c) :: flock_record
      integer(c_int16_t) :: kind
      integer(c_int16_t) :: whence
      integer(c_int64_t) :: start
      integer(c_int64_t) :: length
      integer(c_int) :: pid
   end type flock_record

   !> The signal that came; 0: none.
   integer(c_int), volatile :: caught = 0

   interface
      integer(c_int) function posix_creat(path, mode) bind(c, name='creat')
         import :: c_char, c_int
         implicit none (type, external)
         character(kind=c_char), intent(in) :: path(*)
         integer(c_int), value :: mode
      end function posix_creat

      integer(c_int) function posix_mkdir(path, mode) bind(c, name='mkdir')
         import :: c_char, c_int
         implicit none (type, external)
         character(kind=c_char), intent(in) :: path(*)
         integer(c_int), value :: mode
      end function posix_mkdir

      type(c_ptr) function posix_opendir(path) bind(c, name='opendir')
         import :: c_char, c_ptr
         implicit none (type, external)
         character(kind=c_char), intent(in) :: path(*)
      end function posix_opendir

      integer(c_int) function posix_closedir(stream) bind(c, name='closedir')
         import :: c_int, c_ptr
         implicit none (type, external)
         type(c_ptr), value :: stream
      end function posix_closedir

      type(c_ptr) function posix_readdir(stream) bind(c, name='readdir')
         import :: c_ptr
         implicit none (type, external)
         type(c_ptr), value :: stream
      end function posix_readdir

      ! variadic in C; with integers and pointers only, all calling conventions of Linux pass these the same way
      integer(c_int) function posix_fcntl(descriptor, command, lock) bind(c, name='fcntl')
         import :: c_int, flock_record
         implicit none (type, external)
         integer(c_int), value :: descriptor, command
         type(flock_record), intent(inout) :: lock
      end function posix_fcntl
   end interface

contains

   !> Make a directory and those above it; fine if it exists.
   recursive function make_directory(path) result(failure)
      character(len=*), intent(in) :: path
      character(len=:), allocatable :: failure
      character(len=:), allocatable :: above

      failure = ''
      if (path_exists(path)) return
      above = parent_directory(path)
      if (above /= path .and. .not. path_exists(above)) failure = make_directory(above)
      if (len(failure) > 0) return
      failure = failure_of(posix_mkdir(path//c_null_char, directory_mode))
      if (len(failure) > 0 .and. last_failure_is(eexist)) failure = ''
   end function make_directory

   !> Names in a directory, sorted, without those that begin with a dot.
   subroutine list_directory(path, names)
      character(len=*), intent(in) :: path
      character(len=longest_name), allocatable, intent(out) :: names(:) !! empty if it cannot be read
      character(len=longest_name) :: name
      character(kind=c_char), pointer :: bytes(:)
      type(c_ptr) :: stream, entry
      integer(c_int) :: status
      integer :: n

      allocate (names(64))
      n = 0
      stream = posix_opendir(path//c_null_char)
      if (c_associated(stream)) then
         do
            entry = posix_readdir(stream)
            if (.not. c_associated(entry)) exit
            call c_f_pointer(entry, bytes, [name_offset + 1])
            name = c_text(c_loc(bytes(name_offset + 1)))
            if (name(1:1) == '.') cycle
            if (n == size(names)) names = [names, names]
            n = n + 1
            names(n) = name
         end do
         status = posix_closedir(stream)
      end if
      names = names(sorted_order(names(:n)))
   end subroutine list_directory

   !> Write a file that is there whole or not at all: temporary name, data to the disk, rename, name to the disk.
   function write_words(path, words) result(failure)
      character(len=*), intent(in) :: path
      integer(i8), intent(in), contiguous, target :: words(:)
      character(len=:), allocatable :: failure
      failure = write_durably(path, c_loc(words), 8_c_size_t*size(words, kind=c_size_t))
   end function write_words

   !> The same for a text; an existing file is replaced in one instant.
   function write_text_file(path, text) result(failure)
      character(len=*), intent(in) :: path
      character(len=*), intent(in), target :: text
      character(len=:), allocatable :: failure
      failure = write_durably(path, c_loc(text), len(text, kind=c_size_t))
   end function write_text_file

   function write_durably(path, data, bytes) result(failure)
      character(len=*), intent(in) :: path
      type(c_ptr), intent(in) :: data
      integer(c_size_t), intent(in) :: bytes
      character(len=:), allocatable :: failure
      character(len=:), allocatable :: temporary

      temporary = path//'.tmp'
      failure = write_and_close(create_file(temporary), data, bytes)
      if (len(failure) == 0) failure = rename_over(temporary, path)
      if (len(failure) == 0) failure = sync_path(parent_directory(path))
   end function write_durably

   !> An empty file, open for writing; negative on failure.
   function create_file(path) result(descriptor)
      character(len=*), intent(in) :: path
      integer(c_int) :: descriptor
      descriptor = posix_creat(path//c_null_char, file_mode)
   end function create_file

   !> All bytes, then onto the disk.
   function write_and_close(descriptor, data, bytes) result(failure)
      integer(c_int), intent(in) :: descriptor !! < 0: the file could not be opened
      type(c_ptr), intent(in) :: data
      integer(c_size_t), intent(in) :: bytes
      character(len=:), allocatable :: failure
      integer(c_int) :: status

      failure = failure_of(descriptor)
      if (len(failure) > 0) return
      failure = write_all(descriptor, data, bytes)
      if (len(failure) == 0) failure = failure_of(posix_fsync(descriptor))
      status = posix_close(descriptor)
      if (len(failure) == 0) failure = failure_of(status)
   end function write_and_close

   !> Append a text in one write and put it onto the disk.
   function append_text(path, text) result(failure)
      character(len=*), intent(in) :: path
      character(len=*), intent(in), target :: text
      character(len=:), allocatable :: failure
      failure = write_and_close(open_file(path, ior(o_wronly, o_append)), c_loc(text), len(text, kind=c_size_t))
   end function append_text

   !> Open a file, which is made if it is not there; negative on failure.
   function open_file(path, flags) result(descriptor)
      character(len=*), intent(in) :: path
      integer(c_int), intent(in) :: flags
      integer(c_int) :: descriptor
      if (path_exists(path)) then
         descriptor = posix_open(path//c_null_char, flags)
      else
         descriptor = create_file(path)
      end if
   end function open_file

   !> Size of a file; -1 if it cannot be read.
   function file_bytes(path) result(bytes)
      character(len=*), intent(in) :: path
      integer(i8) :: bytes
      inquire (file=path, size=bytes)
   end function file_bytes

   !> A whole file as words; none if it cannot be read.
   subroutine read_words(path, words, torn)
      character(len=*), intent(in) :: path
      integer(i8), allocatable, intent(out) :: words(:)
      logical, intent(out) :: torn !! it ends within a word, which is left out
      integer(i8) :: bytes
      integer :: unit, stat

      bytes = max(0_i8, file_bytes(path))
      torn = modulo(bytes, 8_i8) /= 0
      allocate (words(bytes/8))
      open (newunit=unit, file=path, access='stream', form='unformatted', status='old', action='read', iostat=stat)
      if (stat == 0) then
         if (size(words) > 0) read (unit, iostat=stat) words
         close (unit)
      end if
      if (stat /= 0) words = words(:0)
   end subroutine read_words

   !> CRC-64 of all bytes of a file; `readable` is false if it cannot be read to its end.
   subroutine file_checksum(path, crc, readable)
      character(len=*), intent(in) :: path
      integer(i8), intent(out) :: crc
      logical, intent(out) :: readable
      integer(i8), parameter :: block_bytes = 256*1024
      character(len=block_bytes) :: block
      integer(i8) :: bytes, done, n
      integer :: unit, stat

      crc = 0
      done = 0
      bytes = file_bytes(path)
      open (newunit=unit, file=path, access='stream', form='unformatted', status='old', action='read', iostat=stat)
      readable = stat == 0
      if (.not. readable) return
      do while (done < bytes .and. readable)
         n = min(block_bytes, bytes - done)
         read (unit, iostat=stat) block(:n)
         readable = stat == 0
         crc = crc64_text(block(:n), crc)
         done = done + n
      end do
      close (unit)
   end subroutine file_checksum

   !> Give a file the first of the names STEM-1ENDING, STEM-2ENDING, ... that no file has.
   subroutine rename_aside(path, stem, ending, name, failure)
      character(len=*), intent(in) :: path
      character(len=*), intent(in) :: stem, ending
      character(len=:), allocatable, intent(out) :: name
      character(len=:), allocatable, intent(out) :: failure !! empty on success
      integer :: i

      do i = 1, huge(i) - 1
         name = stem//'-'//to_text(i)//ending
         if (.not. path_exists(name)) exit
      end do
      failure = rename_over(path, name)
      if (len(failure) == 0) failure = sync_path(parent_directory(name))
   end subroutine rename_aside

   !> Open, perhaps make, a lock file. It is never removed: a lock is on its bytes and ends with the process. Where the file
   !> system has no locks, that is an error, unless the user has said that they shall not be used.
   subroutine open_lock(self, path, error)
      type(lock_file), intent(out) :: self
      character(len=*), intent(in) :: path
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: failure
      logical :: taken

      self%path = path
      self%descriptor = open_file(path, o_wronly)
      if (self%descriptor < 0) then
         call raise(error, path//': cannot be opened: '//last_failure())
         return
      end if
      call take_lock(self, probe, 1_i8, .false., taken, failure)
      if (taken) call release_lock(self, probe, 1_i8)
      if (len(failure) == 0) return
      self%pretend = locks_are_switched_off()
      if (.not. self%pretend) call raise(error, path//': cannot be locked: '//failure//'; the file system seems to have no '// &
         'locks. Use another directory, or set HDF5_USE_FILE_LOCKING=FALSE where nobody else works in this one', exit_bad_input)
   end subroutine open_lock

   !> Does the environment say what HDF5 takes for it?
   logical function locks_are_switched_off()
      character(len=16) :: value
      call get_environment_variable('HDF5_USE_FILE_LOCKING', value)
      locks_are_switched_off = value == 'FALSE' .or. value == '0' .or. value == 'BEST_EFFORT'
   end function locks_are_switched_off

   !> Lock bytes for this process alone.
   subroutine take_lock(self, start, length, wait, taken, failure)
      type(lock_file), intent(in) :: self
      integer(i8), intent(in) :: start, length !! length 0: to the end of all
      logical, intent(in) :: wait              !! until they are free
      logical, intent(out) :: taken
      character(len=:), allocatable, intent(out) :: failure !! why not; empty: another process has one of them
      type(flock_record) :: record

      failure = ''
      record = flock_record(f_wrlck, seek_set, start, length, 0)
      taken = self%pretend
      if (.not. taken) taken = posix_fcntl(self%descriptor, merge(f_setlkw, f_setlk, wait), record) == 0
      if (taken .or. last_failure_is(eacces) .or. last_failure_is(eagain)) return
      failure = last_failure()
   end subroutine take_lock

   !> Process that has locked one of these bytes; 0: none.
   function lock_holder(self, start, length) result(pid)
      type(lock_file), intent(in) :: self
      integer(i8), intent(in) :: start, length
      integer :: pid
      type(flock_record) :: record

      pid = 0
      if (length < 0 .or. self%pretend) return
      record = flock_record(f_wrlck, seek_set, start, length, 0)
      if (posix_fcntl(self%descriptor, f_getlk, record) /= 0) return
      if (record%kind == f_unlck) return
      pid = int(record%pid)
      if (pid == 0) pid = -1 ! on another machine
   end function lock_holder

   subroutine release_lock(self, start, length)
      type(lock_file), intent(in) :: self
      integer(i8), intent(in) :: start, length
      type(flock_record) :: record
      integer(c_int) :: status
      if (self%pretend) return
      record = flock_record(f_unlck, seek_set, start, length, 0)
      status = posix_fcntl(self%descriptor, f_setlk, record)
   end subroutine release_lock

   !> From now on the watched signals only leave a note. One that is ignored already, as SIGHUP is under nohup, stays so.
   subroutine watch_signals()
      type(c_funptr) :: previous
      integer :: i

      do i = 1, size(watched)
         previous = posix_signal(watched(i), c_funloc(note_signal))
         if (transfer(previous, sig_ign) == sig_ign) call ignore_signal(watched(i))
      end do
   end subroutine watch_signals

   subroutine note_signal(number) bind(c)
      integer(c_int), value :: number
      caught = number
   end subroutine note_signal

   !> Did a signal ask to stop? For loops, which allocate nothing.
   logical function is_stop_asked()
      is_stop_asked = findloc(watched, caught, dim=1) > 0
   end function is_stop_asked

   !> The names of all of them, 'SIGHUP, ... or SIGXCPU'.
   function stop_signals() result(names)
      character(len=:), allocatable :: names
      integer :: i

      names = trim(watched_names(1))
      do i = 2, size(watched_names)
         names = names//trim(merge(' or', ',  ', i == size(watched_names)))//' '//trim(watched_names(i))
      end do
   end function stop_signals

   !> Name of the signal that asks to stop; empty: none came.
   function stop_signal() result(name)
      character(len=:), allocatable :: name
      integer :: place

      place = findloc(watched, caught, dim=1)
      name = ''
      if (place > 0) name = trim(watched_names(place))
   end function stop_signal

end module rodyn_posix_files
