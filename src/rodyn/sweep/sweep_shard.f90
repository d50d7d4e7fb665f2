!> Results onto the disk: finished cases are collected for a moment, then sealed as a shard.
!>
!>     call writer%open(directory, tag, first_number, fingerprint, shape)
!>     call writer%add(kept, error)       ! seals by itself, several times a second at first
!>     call writer%seal(error)            ! whatever waits
!>
!> A shard is written under a temporary name, synced, renamed, and its name synced; then the journal says so. Many small
!> shards of one process are combined into one, and many of these again, so that their number stays small.
module rodyn_sweep_shard
   use rodyn_kinds, only: wp, i8
   use rodyn_errors, only: error_type, raise
   use rodyn_posix, only: remove_file
   use rodyn_posix_files, only: read_words, write_words
   use rodyn_sweep_case, only: case_result, case_shape
   use rodyn_sweep_journal, only: write_journal
   use rodyn_sweep_record, only: append_record, check_shard, header_words, record_words, seal_words
   implicit none (type, external)
   private
   public :: shard_writer

   ! How long a result may wait: a kill in this time costs it. Short at first, and in long sweeps 5 % of the time so far
   ! up to 2 s, so that a thousand processes do not make thousands of files each second. Longer cases never wait.
   real(wp), parameter :: shortest_wait = 0.25_wp, longest_wait = 2.0_wp, share_of_time = 0.05_wp ! [s], [s], 1
   integer, parameter :: most_words = 512*1024            !! words that wait: 4 MiB
   integer, parameter :: combine_at = 32                  !! shards of one level that become one of the next
   integer, parameter :: n_levels = 4
   integer, parameter :: largest_combined = 16*1024*1024  !! words: 128 MiB
   integer, parameter :: name_length = 64

   type :: shard_writer
      character(len=:), allocatable :: directory      !! of the sweep
      character(len=:), allocatable :: tag            !! of this process among all of the sweep
      integer :: next_number = 1
      integer(i8) :: fingerprint = 0
      integer :: n_cases = 0
      type(case_shape) :: shape
      integer(i8), allocatable :: words(:)
      integer :: used = header_words
      integer :: n_waiting = 0                        !! results in `words`
      integer(i8) :: clock_first = 0                  !! when the first of them came
      integer(i8) :: clock_start = 0
      character(len=name_length) :: names(combine_at, n_levels) !! shards that may be combined
      integer :: n_names(n_levels) = 0
      integer(i8) :: n_words(n_levels) = 0            !! in them
   contains
      procedure :: open => open_writer
      procedure :: add
      procedure :: seal
      procedure, private :: write_shard
      procedure, private :: note
      procedure, private :: combine
   end type shard_writer

contains

   subroutine open_writer(self, directory, tag, first_number, fingerprint, shape, n_cases)
      class(shard_writer), intent(out) :: self
      character(len=*), intent(in) :: directory, tag
      integer, intent(in) :: first_number !! no shard of this tag has it or a greater one
      integer(i8), intent(in) :: fingerprint
      type(case_shape), intent(in) :: shape
      integer, intent(in) :: n_cases
      self%directory = directory
      self%tag = tag
      self%next_number = first_number
      self%fingerprint = fingerprint
      self%shape = shape
      self%n_cases = n_cases
      call system_clock(self%clock_start)
      allocate (self%words(4096))
   end subroutine open_writer

   !> Take a result. On return it may be on the disk or wait; `seal` ends the waiting.
   subroutine add(self, kept, error)
      class(shard_writer), intent(inout) :: self
      type(case_result), intent(in) :: kept
      type(error_type), allocatable, intent(out) :: error
      integer(i8), allocatable :: larger(:)
      integer(i8) :: now, rate
      integer :: needed
      real(wp) :: wait

      call system_clock(now, rate)
      wait = max(shortest_wait, min(longest_wait, share_of_time*real(now - self%clock_start, wp)/real(rate, wp)))
      if (self%n_waiting == 0) self%clock_first = now
      needed = self%used + record_words(self%shape, kept%status, len(kept%message)) + 1
      if (needed > size(self%words)) then
         allocate (larger(max(needed, 2*size(self%words))))
         larger(:self%used) = self%words(:self%used)
         call move_alloc(larger, self%words)
      end if
      call append_record(kept, self%shape, self%words, self%used)
      self%n_waiting = self%n_waiting + 1
      if (self%used < most_words .and. real(now - self%clock_first, wp) < wait*real(rate, wp) &
          .and. kept%wall_seconds < wait) return
      call self%seal(error)
   end subroutine add

   !> Put all that waits onto the disk. After a failure it still waits.
   subroutine seal(self, error)
      class(shard_writer), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      character(len=name_length) :: name

      if (self%n_waiting == 0) return
      call self%write_shard(self%words, self%used, self%n_waiting, name, error)
      if (allocated(error)) return
      self%n_waiting = 0
      call self%note(1, name, self%used, error)
      self%used = header_words
   end subroutine seal

   !> A new shard of a level; when there are many, they become one of the next.
   recursive subroutine note(self, level, name, n_words, error)
      class(shard_writer), intent(inout) :: self
      integer, intent(in) :: level
      character(len=name_length), intent(in) :: name
      integer, intent(in) :: n_words
      type(error_type), allocatable, intent(out) :: error

      if (level > n_levels) return
      self%n_names(level) = self%n_names(level) + 1
      self%n_words(level) = self%n_words(level) + n_words
      self%names(self%n_names(level), level) = name
      if (self%n_words(level) > largest_combined) then
         self%n_names(level) = 0
         self%n_words(level) = 0
      else if (self%n_names(level) == combine_at) then
         call self%combine(level, error)
      end if
   end subroutine note

   !> A shard of `n_records` records behind the header of `words`.
   subroutine write_shard(self, words, used, n_records, name, error)
      class(shard_writer), intent(inout) :: self
      integer(i8), contiguous, intent(inout) :: words(:)
      integer, intent(in) :: used
      integer, intent(in) :: n_records
      character(len=name_length), intent(out) :: name
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: failure
      integer :: total

      total = used
      write (name, '(a, "-", i6.6, ".shard")') self%tag, self%next_number
      call seal_words(words, total, n_records, self%fingerprint)
      failure = write_words(self%directory//'/shards/'//trim(name), words(:total))
      if (len(failure) > 0) then
         call raise(error, self%directory//'/shards/'//trim(name)//': results cannot be put onto the disk: '//failure// &
                    '; all before them are safe, run again to resume')
         return
      end if
      self%next_number = self%next_number + 1
      call write_journal(self%directory, self%tag, 'sealed', trim(name), n_records, words(total), error)
   end subroutine write_shard

   !> Make one shard of those of a level. They are removed only when it is on the disk; if anything is wrong with one
   !> of them, all stay as they are.
   recursive subroutine combine(self, level, error)
      class(shard_writer), intent(inout) :: self
      integer, intent(in) :: level
      type(error_type), allocatable, intent(out) :: error
      integer(i8), allocatable :: words(:), part(:)
      character(len=name_length) :: name
      character(len=:), allocatable :: failure
      integer :: i, n, n_records, used

      allocate (words(self%n_words(level) + 1))
      used = header_words
      n_records = 0
      n = self%n_names(level)
      self%n_names(level) = 0
      self%n_words(level) = 0
      do i = 1, n
         call read_words(self%directory//'/shards/'//trim(self%names(i, level)), part)
         if (len(check_shard(part, self%fingerprint, self%shape, self%n_cases)) > 0) return
         n_records = n_records + int(part(3))
         associate (length => size(part) - header_words - 1)
            words(used + 1:used + length) = part(header_words + 1:header_words + length)
            used = used + length
         end associate
      end do
      call self%write_shard(words, used, n_records, name, error)
      if (allocated(error)) return
      do i = 1, n
         call write_journal(self%directory, self%tag, 'combined', trim(self%names(i, level)), 0, 0_i8, error)
         if (allocated(error)) return
         failure = remove_file(self%directory//'/shards/'//trim(self%names(i, level)))
      end do
      call self%note(level + 1, name, used, error)
   end subroutine combine

end module rodyn_sweep_shard
