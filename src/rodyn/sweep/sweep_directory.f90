!> The directory of a sweep: who may write in it, and whether it belongs to this sweep.
!>
!>     DIR/plan.txt      what the results depend on; a resumed sweep must have the same
!>     DIR/lock          locked, never changed
!>     DIR/shards/       results               DIR/journal/   what was done to them
!>     DIR/status*.txt   how far it is         DIR/sweep.h5   the result
!>     DIR/sweep.h5.before   the result that --force discards, until the new one is there
!>
!> The lock file's bytes are locked: 0 while somebody scans the shards, 1 by a sweep with all cases, N * 2^20 + I by shard I
!> of N, and 2^50 + rank by the other ranks of an MPI job. The system drops the locks of a process when it ends, however
!> it ends.
module rodyn_sweep_directory
   use rodyn_kinds, only: i8
   use rodyn_checksum, only: crc64_text
   use rodyn_errors, only: error_type, raise, exit_bad_input
   use rodyn_file_text, only: read_text_file
   use rodyn_posix, only: path_exists, remove_file, rename_over
   use rodyn_posix_files, only: list_directory, lock_file, lock_holder, make_directory, open_lock, release_lock, &
      take_lock, write_text_file
   use rodyn_text, only: ends_with, to_text
   implicit none (type, external)
   private
   public :: sweep_directory, result_name, replaced_name

   character(len=*), parameter :: result_name = 'sweep.h5', replaced_name = 'sweep.h5.before'
   character(len=*), parameter :: nl = new_line('a')
   integer(i8), parameter :: scan_byte = 0, whole = 1, per_count = 2_i8**20, first_rank = 2_i8**50

   type :: sweep_directory
      character(len=:), allocatable :: path
      type(lock_file) :: lock
      integer(i8) :: fingerprint = 0 !! of the plan
      logical :: resumed = .false.   !! there was a plan already
      integer, private :: scans = 0  !! calls of `begin_scan` without `end_scan`
   contains
      procedure :: open => open_directory
      procedure :: lock_rank
      procedure :: begin_scan
      procedure :: end_scan
   end type sweep_directory

contains

   !> Lock the directory, and compare or write the plan.
   subroutine open_directory(self, path, plan, shard, n_shards, force, error)
      class(sweep_directory), intent(out) :: self
      character(len=*), intent(in) :: path
      character(len=*), intent(in) :: plan        !! all that results depend on
      integer, intent(in) :: shard, n_shards      !! 0, 0: all cases
      logical, intent(in) :: force                !! what the directory holds may go
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: failure

      self%path = path
      self%fingerprint = crc64_text(plan)
      failure = make_directory(path//'/shards')
      if (len(failure) == 0) failure = make_directory(path//'/journal')
      if (len(failure) > 0) then
         call raise(error, path//': the directory cannot be made: '//failure, exit_bad_input)
         return
      end if
      call open_lock(self%lock, path//'/lock', error)
      if (self%lock%pretend .and. n_shards > 0) &
         call raise(error, path//': shards need a file system with locks', exit_bad_input)
      if (allocated(error)) return
      call self%begin_scan()
      call lock_cases(self, shard, n_shards, error)
      if (.not. allocated(error)) call compare_plan(self, plan, force, error)
      call self%end_scan()
   end subroutine open_directory

   !> Keep others from scanning until `end_scan`.
   subroutine begin_scan(self)
      class(sweep_directory), intent(inout) :: self
      character(len=:), allocatable :: failure
      logical :: taken
      if (self%scans == 0) call take_lock(self%lock, scan_byte, 1_i8, .true., taken, failure)
      self%scans = self%scans + 1
   end subroutine begin_scan

   subroutine end_scan(self)
      class(sweep_directory), intent(inout) :: self
      self%scans = self%scans - 1
      if (self%scans == 0) call release_lock(self%lock, scan_byte, 1_i8)
   end subroutine end_scan

   !> Nobody else may work on the same cases.
   subroutine lock_cases(self, shard, n_shards, error)
      class(sweep_directory), intent(in) :: self
      integer, intent(in) :: shard, n_shards
      type(error_type), allocatable, intent(out) :: error
      integer(i8) :: base
      character(len=:), allocatable :: failure
      integer :: holder
      logical :: taken

      failure = ''
      taken = .false.
      base = n_shards*per_count
      if (n_shards == 0) then
         holder = lock_holder(self%lock, whole, 0_i8)
         if (holder == 0) call take_lock(self%lock, whole, 1_i8, .false., taken, failure)
      else
         holder = lock_holder(self%lock, whole, base - whole)
         if (holder == 0) holder = lock_holder(self%lock, base + per_count, 0_i8)
         if (holder == 0) holder = lock_holder(self%lock, base + shard, 1_i8)
         if (holder == 0) call take_lock(self%lock, base + shard, 1_i8, .false., taken, failure)
      end if
      if (taken) return
      if (holder > 0) then
         call raise(error, self%path//': process '//to_text(holder)//' works on this sweep', exit_bad_input)
      else if (len(failure) > 0) then
         call raise(error, self%path//'/lock: cannot be locked: '//failure, exit_bad_input)
      else
         call raise(error, self%path//': a process on another machine works on this sweep', exit_bad_input)
      end if
   end subroutine lock_cases

   !> Ranks other than the first have locks of their own, so that a survivor of a killed job is noticed.
   subroutine lock_rank(self, path, rank, error)
      class(sweep_directory), intent(inout) :: self
      character(len=*), intent(in) :: path
      integer, intent(in) :: rank !! 1, 2, ...
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: failure
      logical :: taken

      self%path = path
      call open_lock(self%lock, path//'/lock', error)
      if (allocated(error)) return
      call take_lock(self%lock, first_rank + rank, 1_i8, .false., taken, failure)
      if (taken) return
      if (len(failure) == 0) failure = 'another rank '//to_text(rank)//' works on this sweep'
      call raise(error, path//': '//failure, exit_bad_input)
   end subroutine lock_rank

   !> Is the plan the one that is there? If none is there, it is written.
   subroutine compare_plan(self, plan, force, error)
      class(sweep_directory), intent(inout) :: self
      character(len=*), intent(in) :: plan
      logical, intent(in) :: force
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: failure, old

      if (force) call remove_all(self%path, error)
      if (allocated(error)) return
      if (path_exists(self%path//'/plan.txt')) then
         call read_text_file(self%path//'/plan.txt', old, error)
         if (allocated(error)) return
         self%resumed = .true.
         if (old /= plan .or. len(old) /= len(plan)) call refuse(self%path, old, plan, error)
         return
      end if
      if (path_exists(self%path//'/'//result_name)) then
         call raise(error, self%path//'/'//result_name//': exists, but no plan.txt beside it; --force replaces it', &
                    exit_bad_input)
         return
      end if
      failure = write_text_file(self%path//'/plan.txt', plan)
      if (len(failure) > 0) call raise(error, self%path//'/plan.txt: cannot be written: '//failure)
   end subroutine compare_plan

   !> Remove what a sweep makes, and nothing else; its result waits for the new one. The plan goes last.
   subroutine remove_all(path, error)
      character(len=*), intent(in) :: path
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: failure

      failure = ''
      if (path_exists(path//'/'//result_name)) failure = rename_over(path//'/'//result_name, path//'/'//replaced_name)
      if (len(failure) > 0) then
         call raise(error, path//'/'//result_name//': cannot be set aside: '//failure)
         return
      end if
      call remove_in('/shards/', '.shard')
      call remove_in('/shards/', '.shard.open')
      call remove_in('/shards/', '.shard.tmp')
      call remove_in('/shards/', '.damaged')
      call remove_in('/journal/', '.txt')
      call remove_in('/', '.h5', 'sweep-')
      call remove_in('/', '.h5.partial', 'sweep.')
      call remove_in('/', '.txt', 'status')
      call remove_in('/', '.txt', 'finished-s')
      failure = remove_file(path//'/plan.txt')

   contains

      subroutine remove_in(below, ending, beginning)
         character(len=*), intent(in) :: below, ending
         character(len=*), intent(in), optional :: beginning
         character(len=255), allocatable :: names(:)
         integer :: i
         call list_directory(path//below, names)
         do i = 1, size(names)
            if (.not. ends_with(names(i), ending)) cycle
            if (present(beginning)) then
               if (index(names(i), beginning) /= 1) cycle
            end if
            failure = remove_file(path//below//trim(names(i)))
         end do
      end subroutine remove_in

   end subroutine remove_all

   !> Say which lines differ.
   subroutine refuse(path, old, new, error)
      character(len=*), intent(in) :: path, old, new
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: most_shown = 10
      character(len=:), allocatable :: message, a, b
      integer :: at_old, at_new, n

      message = path//': holds another sweep; choose another --output, or discard it with --force. It differs in'
      at_old = 1
      at_new = 1
      n = 0
      do while (at_old <= len(old) .or. at_new <= len(new))
         a = next_line(old, at_old)
         b = next_line(new, at_new)
         if (a == b) cycle
         n = n + 1
         if (n > most_shown) cycle
         message = message//nl//'  there: '//shown(a)//nl//'  now:   '//shown(b)
      end do
      if (n > most_shown) message = message//nl//'  and '//to_text(n - most_shown)//' more lines'
      call raise(error, message, exit_bad_input)

   contains

      pure function shown(line) result(text)
         character(len=*), intent(in) :: line
         character(len=:), allocatable :: text
         text = line
         if (len(text) == 0) text = '(nothing)'
      end function shown

   end subroutine refuse

   !> The line at a place, and the place behind it.
   function next_line(text, at) result(line)
      character(len=*), intent(in) :: text
      integer, intent(inout) :: at
      character(len=:), allocatable :: line
      integer :: length

      line = ''
      if (at > len(text)) return
      length = index(text(at:), nl) - 1
      if (length < 0) length = len(text) - at + 1
      line = text(at:at + length - 1)
      at = at + length + 1
   end function next_line

end module rodyn_sweep_directory
