!> Results onto the disk: each is appended to an open shard in the moment its case is finished.
!>
!>     call writer%open(directory, tag, first_number, fingerprint, shape)
!>     call writer%add(kept, error)       ! from now on a kill -9 does not cost it
!>     call writer%sync_if_due()          ! now and then: soon a loss of power does not, either
!>     call writer%seal(error)            ! at the end; `add` does so when a shard is large enough
!>
!> An open shard has the name TAG-NUMBER.shard.open. Sealing: trailer, sync, rename to TAG-NUMBER.shard, sync of the name,
!> a line in the journal.
module rodyn_sweep_writer
   use rodyn_kinds, only: wp, i8
   use rodyn_errors, only: error_type, raise
   use rodyn_growing_file, only: growing_file
   use rodyn_posix, only: parent_directory, path_exists, rename_over, sync_path
   use rodyn_sweep_case, only: case_result, case_shape
   use rodyn_sweep_journal, only: write_journal
   use rodyn_sweep_record, only: encode_record, record_words
   use rodyn_sweep_shard, only: shard_extent, shard_header, shard_trailer
   implicit none (type, external)
   private
   public :: shard_writer, seal_file, open_ending

   character(len=*), parameter :: open_ending = '.open'

   ! How long a result may wait to be synced: a loss of power in this time costs it. Short at first, and in long sweeps 5 %
   ! of the time so far up to 2 s, so that a thousand processes do not sync thousands of times each second. Cases that take
   ! longer are synced at once.
   real(wp), parameter :: shortest_wait = 1.0_wp, longest_wait = 2.0_wp, share_of_time = 0.05_wp ! [s], [s], 1
   integer, parameter :: large_enough = 1024*1024 !! words of a shard: 8 MiB

   type :: shard_writer
      private
      character(len=:), allocatable :: directory      !! of the sweep
      character(len=:), allocatable :: tag            !! of this process among all of the sweep
      character(len=:), allocatable :: name           !! of the shard in hand, once sealed
      integer :: next_number = 1
      integer(i8) :: fingerprint = 0
      type(case_shape) :: shape
      type(growing_file) :: file
      type(shard_extent) :: extent
      integer(i8), allocatable :: words(:)            !! room for a record
      integer(i8) :: clock_start = 0
      integer(i8) :: clock_waiting = 0                !! when the first result came that is not synced; 0: all are
      character(len=:), allocatable :: failure        !! of a sync; empty: none
   contains
      procedure :: open => open_writer
      procedure :: add
      procedure :: sync_if_due
      procedure :: seal
      procedure, private :: begin
      procedure, private :: sync
      procedure, private :: wait
      procedure, private :: raise_failure
   end type shard_writer

contains

   subroutine open_writer(self, directory, tag, first_number, fingerprint, shape)
      class(shard_writer), intent(out) :: self
      character(len=*), intent(in) :: directory, tag
      integer, intent(in) :: first_number !! no shard of this tag has it or a greater one
      integer(i8), intent(in) :: fingerprint
      type(case_shape), intent(in) :: shape
      self%directory = directory
      self%tag = tag
      self%next_number = first_number
      self%fingerprint = fingerprint
      self%shape = shape
      self%failure = ''
      call system_clock(self%clock_start)
      allocate (self%words(256))
   end subroutine open_writer

   !> Append a result.
   subroutine add(self, kept, error)
      class(shard_writer), intent(inout) :: self
      type(case_result), intent(in) :: kept
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: failure
      integer :: n

      failure = ''
      if (.not. self%file%is_open()) failure = self%begin()
      if (len(failure) == 0) then
         n = record_words(self%shape, kept%status, len(kept%message))
         if (n > size(self%words)) then
            deallocate (self%words)
            allocate (self%words(n))
         end if
         call encode_record(kept, self%shape, self%words, n)
         failure = self%file%append(self%words(:n))
      end if
      if (len(failure) > 0) then
         call self%sync() ! of those before it
         call self%raise_failure(failure, error)
         return
      end if
      call self%extent%add(self%words(:n))
      if (self%clock_waiting == 0) call system_clock(self%clock_waiting)
      if (kept%wall_seconds >= self%wait()) call self%sync()
      if (self%extent%used >= large_enough) call self%seal(error)
      if (len(self%failure) > 0 .and. .not. allocated(error)) call self%raise_failure(self%failure, error)
   end subroutine add

   !> Begin a shard.
   function begin(self) result(failure)
      class(shard_writer), intent(inout) :: self
      character(len=:), allocatable :: failure
      character(len=64) :: name

      do ! a shard's number is not used twice, but better look than overwrite
         write (name, '(a, "-", i6.6, ".shard")') self%tag, self%next_number
         self%name = self%directory//'/shards/'//trim(name)
         self%next_number = self%next_number + 1
         if (.not. (path_exists(self%name) .or. path_exists(self%name//open_ending))) exit
      end do
      self%extent = shard_extent()
      call self%extent%add(shard_header(self%fingerprint))
      failure = self%file%create(self%name//open_ending)
      if (len(failure) == 0) failure = self%file%append(shard_header(self%fingerprint))
      if (len(failure) == 0) failure = sync_path(parent_directory(self%name))
   end function begin

   !> Sync, if a result has waited long enough for it.
   subroutine sync_if_due(self)
      class(shard_writer), intent(inout) :: self
      integer(i8) :: now, rate

      if (self%clock_waiting == 0) return
      call system_clock(now, rate)
      if (real(now - self%clock_waiting, wp) >= self%wait()*real(rate, wp)) call self%sync()
   end subroutine sync_if_due

   !> Sync. A failure is reported by the next `add` or `seal`.
   subroutine sync(self)
      class(shard_writer), intent(inout) :: self
      if (self%clock_waiting == 0) return
      self%failure = self%file%sync()
      self%clock_waiting = 0
   end subroutine sync

   !> How long results may wait now [s].
   real(wp) function wait(self)
      class(shard_writer), intent(in) :: self
      integer(i8) :: now, rate
      call system_clock(now, rate)
      wait = max(shortest_wait, min(longest_wait, share_of_time*real(now - self%clock_start, wp)/real(rate, wp)))
   end function wait

   !> Seal the shard in hand, if there is one.
   subroutine seal(self, error)
      class(shard_writer), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: failure

      if (.not. self%file%is_open()) return
      failure = self%failure
      if (len(failure) == 0) failure = seal_file(self%file, self%name, self%extent)
      if (len(failure) > 0) then
         call self%raise_failure(failure, error)
         return
      end if
      self%clock_waiting = 0
      call write_journal(self%directory, self%tag, 'sealed', self%name(index(self%name, '/', back=.true.) + 1:), &
                         self%extent%n_records, self%extent%total, error)
   end subroutine seal

   subroutine raise_failure(self, failure, error)
      class(shard_writer), intent(in) :: self
      character(len=*), intent(in) :: failure
      type(error_type), allocatable, intent(out) :: error
      if (path_exists(parent_directory(self%name))) then
         call raise(error, self%name//open_ending//': results cannot be written: '//failure// &
                    '; run again to resume with all earlier ones')
      else
         call raise(error, self%directory//': was removed, and all results with it')
      end if
   end subroutine raise_failure

   !> Give an open shard its trailer, unless it has it, and its name. The file is closed then.
   function seal_file(file, name, extent) result(failure)
      type(growing_file), intent(inout) :: file
      character(len=*), intent(in) :: name !! path without `open_ending`; no file may have it
      type(shard_extent), intent(in) :: extent
      character(len=:), allocatable :: failure

      failure = ''
      if (.not. extent%sealed) failure = file%append(shard_trailer(extent))
      if (len(failure) == 0) failure = file%sync()
      if (len(failure) > 0) return
      call file%close()
      failure = rename_over(name//open_ending, name)
      if (len(failure) == 0) failure = sync_path(parent_directory(name))
   end function seal_file

end module rodyn_sweep_writer
