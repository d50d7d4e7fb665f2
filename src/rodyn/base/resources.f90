!> What the machine has left: memory for this process, space on the disk of a directory (Linux). A run that cannot fit is
!> refused with a message, rather than end in an allocation that fails or in the system's memory killer.
module rodyn_resources
   use, intrinsic :: iso_c_binding, only: c_char, c_int, c_int64_t, c_null_char
   use rodyn_errors, only: error_type, exit_bad_input, raise
   use rodyn_kinds, only: wp
   use rodyn_text, only: formatted
   implicit none (type, external)
   private
   public :: ensure_stack, free_memory, free_disk, file_size_limit, byte_text

   integer(c_int), parameter :: rlimit_fsize = 1, rlimit_stack = 3, rlimit_as = 9 ! <sys/resource.h>, Linux
   integer(c_int64_t), parameter :: least_stack = 1024*1024     !! of the program, several times what it uses [bytes]
   real(wp), parameter :: unknown = 1.0e300_wp

   interface
      integer(c_int) function posix_getrlimit(resource, limits) bind(c, name='getrlimit')
         import :: c_int, c_int64_t
         implicit none (type, external)
         integer(c_int), intent(in), value :: resource
         integer(c_int64_t), intent(out) :: limits(2) !! soft, hard; -1: none
      end function posix_getrlimit

      integer(c_int) function posix_setrlimit(resource, limits) bind(c, name='setrlimit')
         import :: c_int, c_int64_t
         implicit none (type, external)
         integer(c_int), intent(in), value :: resource
         integer(c_int64_t), intent(in) :: limits(2)
      end function posix_setrlimit

      ! struct statvfs has 11 words and 6 spare integers on 64-bit Linux
      integer(c_int) function posix_statvfs(path, words) bind(c, name='statvfs')
         import :: c_char, c_int, c_int64_t
         implicit none (type, external)
         character(kind=c_char), intent(in) :: path(*)
         integer(c_int64_t), intent(out) :: words(32)
      end function posix_statvfs
   end interface

contains

   !> Raise a limit of the stack that is too low (ulimit -s), or say that it is.
   subroutine ensure_stack(error)
      type(error_type), allocatable, intent(out) :: error
      integer(c_int64_t) :: limits(2)

      if (posix_getrlimit(rlimit_stack, limits) /= 0) return
      if (limits(1) < 0 .or. limits(1) >= least_stack) return
      if (limits(2) < 0 .or. limits(2) >= least_stack) then
         if (posix_setrlimit(rlimit_stack, [least_stack, limits(2)]) == 0) return
      end if
      call raise(error, 'rodyn: the stack is limited to '//byte_text(real(limits(1), wp))//', but '// &
                 byte_text(real(least_stack, wp))//' are needed: raise ulimit -s', exit_bad_input)
   end subroutine ensure_stack

   !> Memory that can be had without pushing anything out; huge if the system does not tell [bytes].
   real(wp) function free_memory()
      integer(c_int64_t) :: limits(2)
      real(wp) :: group, used

      free_memory = 1024.0_wp*number_in('/proc/meminfo', 'MemAvailable:')
      group = number_in('/sys/fs/cgroup/memory.max', '')
      if (group < unknown) then
         used = number_in('/sys/fs/cgroup/memory.current', '')
         if (used < group) free_memory = min(free_memory, group - used)
      end if
      if (posix_getrlimit(rlimit_as, limits) /= 0) return
      if (limits(1) >= 0) free_memory = min(free_memory, max(0.0_wp, real(limits(1), wp) - address_space()))
   end function free_memory

   !> What this process has of its address space already [bytes].
   real(wp) function address_space()
      address_space = 1024.0_wp*number_in('/proc/self/status', 'VmSize:')
      if (address_space > unknown) address_space = 0.0_wp
   end function address_space

   !> Space for the files of users; huge if the system does not tell [bytes].
   real(wp) function free_disk(directory)
      character(len=*), intent(in) :: directory
      integer(c_int64_t) :: words(32)
      integer, parameter :: fragment_size = 2, fragments_left = 5

      free_disk = unknown
      if (posix_statvfs(directory//c_null_char, words) /= 0) return
      free_disk = real(words(fragment_size), wp)*real(words(fragments_left), wp)
   end function free_disk

   !> How large a file may become (ulimit -f); huge if there is no limit [bytes].
   real(wp) function file_size_limit()
      integer(c_int64_t) :: limits(2)
      file_size_limit = unknown
      if (posix_getrlimit(rlimit_fsize, limits) /= 0) return
      if (limits(1) >= 0) file_size_limit = real(limits(1), wp)
   end function file_size_limit

   !> The number behind a word at the beginning of a line; huge if there is none.
   real(wp) function number_in(path, word)
      character(len=*), intent(in) :: path, word
      character(len=200) :: line
      integer :: stat, unit

      number_in = unknown
      open (newunit=unit, file=path, status='old', action='read', iostat=stat)
      if (stat /= 0) return
      do
         read (unit, '(a)', iostat=stat) line
         if (stat /= 0) exit
         if (index(line, word) /= 1) cycle
         read (line(len(word) + 1:), *, iostat=stat) number_in
         if (stat /= 0) number_in = unknown
         exit
      end do
      close (unit)
   end function number_in

   !> A size in words, such as '1.5 GB'.
   pure function byte_text(bytes) result(text)
      real(wp), intent(in) :: bytes
      character(len=:), allocatable :: text
      if (bytes < 1.0e6_wp) then
         text = formatted(1.0e-3_wp*bytes, '(f12.1)')//' kB'
      else if (bytes < 1.0e9_wp) then
         text = formatted(1.0e-6_wp*bytes, '(f12.1)')//' MB'
      else if (bytes < 1.0e12_wp) then
         text = formatted(1.0e-9_wp*bytes, '(f12.1)')//' GB'
      else
         text = formatted(1.0e-9_wp*bytes, '(es9.1)')//' GB'
      end if
   end function byte_text

end module rodyn_resources
