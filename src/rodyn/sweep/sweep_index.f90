!> Which results are on the disk: every shard read and verified, and where the result of each case stands.
module rodyn_sweep_index
   use rodyn_kinds, only: i8
   use rodyn_checksum, only: crc64
   use rodyn_errors, only: error_type, raise
   use rodyn_posix_files, only: list_directory, read_words
   use rodyn_sweep_case, only: case_result, case_shape
   use rodyn_sweep_directory, only: sweep_directory
   use rodyn_sweep_journal, only: journal_content, read_journals, write_journal
   use rodyn_sweep_repair, only: repair_shard
   use rodyn_sweep_record, only: at_attempt, at_case, at_message, at_status, decode_record, is_sound, shortest_record
   use rodyn_sweep_shard, only: header_words, shard_extent, sift_shard
   use rodyn_sweep_writer, only: open_ending
   use rodyn_text, only: ends_with, joined, to_text
   implicit none (type, external)
   private
   public :: sweep_index

   integer, parameter :: name_length = 255
   character(len=1), parameter :: nl = new_line('a')
   integer, parameter :: most_open = 64 !! files open at once while results are fetched

   type :: sweep_index
      character(len=:), allocatable :: directory
      character(len=name_length), allocatable :: files(:)
      integer, allocatable :: status(:)       !! of each case; 0: no result
      integer, allocatable :: attempt(:)      !! of each case
      integer, allocatable :: message_bytes(:) !! of each case
      integer, allocatable, private :: file(:)    !! which file has the result
      integer(i8), allocatable, private :: at(:)  !! where: first byte
      integer, allocatable, private :: units(:)   !! of each file; 0: closed
      integer, private :: n_open = 0
      integer(i8) :: bytes = 0                !! of all shards
      character(len=:), allocatable :: notices !! what the user should know of the directory, one line each
      type(journal_content), private :: journals
   contains
      procedure :: scan
      procedure :: next_number
      procedure :: has_merged
      procedure :: merge_mark
      procedure :: fetch
      procedure :: close => close_files
   end type sweep_index

contains

   !> Read all shards. Those that are damaged, or left open by a dead process, are repaired first.
   subroutine scan(self, directory, shape, n_cases, tag, others, all_shards, error)
      class(sweep_index), intent(out) :: self
      type(sweep_directory), intent(inout) :: directory
      type(case_shape), intent(in) :: shape
      integer, intent(in) :: n_cases
      character(len=*), intent(in) :: tag    !! ours; findings are noted in its journal
      character(len=*), intent(in) :: others !! what the names of shards have whose writers may be alive, and ours; empty: none
      logical, intent(in) :: all_shards      !! read those of living writers, too, as far as they are sealed
      type(error_type), allocatable, intent(out) :: error
      character(len=name_length), allocatable :: faulty(:)
      integer :: i

      self%directory = directory%path
      self%notices = ''
      do
         call read_all(self, directory%fingerprint, shape, n_cases, tag, others, all_shards, faulty)
         if (size(faulty) == 0) exit ! otherwise there are other files then
         call directory%begin_scan()
         do i = 1, size(faulty)
            if (.not. allocated(error)) call repair_shard(self%directory, trim(faulty(i)), tag, directory%fingerprint, shape, &
                                                        n_cases, self%notices, error)
         end do
         call directory%end_scan()
         if (allocated(error)) return
      end do
      if (all_shards .or. len(others) == 0) call note_missing(self, tag, error)
   end subroutine scan

   !> Read and verify, and list what has to be repaired.
   subroutine read_all(self, fingerprint, shape, n_cases, tag, others, all_shards, faulty)
      class(sweep_index), intent(inout) :: self
      integer(i8), intent(in) :: fingerprint
      type(case_shape), intent(in) :: shape
      integer, intent(in) :: n_cases
      character(len=*), intent(in) :: tag, others
      logical, intent(in) :: all_shards
      character(len=name_length), allocatable, intent(out) :: faulty(:)
      character(len=name_length), allocatable :: names(:)
      integer(i8), allocatable :: words(:)
      logical, allocatable :: to_repair(:)
      integer :: i, n

      call forget(self, n_cases)
      call list_directory(self%directory//'/shards', names)
      allocate (self%files(size(names)))
      allocate (to_repair(size(names)), source=.false.)
      n = 0
      do i = 1, size(names)
         if (ends_with(names(i), '.shard'//open_ending)) then
            to_repair(i) = .not. may_live(names(i))
         else if (ends_with(names(i), '.shard') .and. (all_shards .or. .not. may_live(names(i)))) then
            call read_sealed(self%directory//'/shards/'//trim(names(i)), to_repair(i))
            if (to_repair(i)) cycle
            n = n + 1
            self%files(n) = names(i)
            self%bytes = self%bytes + 8_i8*size(words)
            call take(self, words, n)
         end if
      end do
      self%files = self%files(:n)
      allocate (self%units(n), source=0)
      faulty = pack(names, to_repair)

   contains

      !> Is its writer a neighbour, who may be alive?
      pure logical function may_live(name)
         character(len=*), intent(in) :: name
         may_live = len(others) > 0
         if (may_live) may_live = index(name, others) > 0 .and. index(name, tag//'-') /= 1
      end function may_live

      subroutine read_sealed(path, bad)
         character(len=*), intent(in) :: path
         logical, intent(out) :: bad
         type(shard_extent) :: extent
         character(len=:), allocatable :: fault
         call read_words(path, words, bad)
         if (bad) return
         call sift_shard(words, fingerprint, shape, n_cases, extent, fault)
         bad = len(fault) > 0 .or. .not. extent%sealed
      end subroutine read_sealed

   end subroutine read_all

   subroutine forget(self, n_cases)
      class(sweep_index), intent(inout) :: self
      integer, intent(in) :: n_cases
      if (allocated(self%status)) &
         deallocate (self%status, self%attempt, self%message_bytes, self%file, self%at, self%files, self%units)
      allocate (self%status(n_cases), self%attempt(n_cases), self%message_bytes(n_cases), self%file(n_cases), source=0)
      allocate (self%at(n_cases), source=0_i8)
      self%bytes = 0
   end subroutine forget

   !> Shards that the journal knows but that are not there.
   subroutine note_missing(self, tag, error)
      class(sweep_index), intent(inout) :: self
      character(len=*), intent(in) :: tag
      type(error_type), allocatable, intent(out) :: error
      character(len=name_length), allocatable :: names(:)
      integer :: i

      call read_journals(self%directory, self%journals)
      call self%journals%missing(self%directory, names)
      do i = 1, size(names)
         self%notices = joined(self%notices, 'shard '//trim(names(i))//': sealed but missing; its cases are recomputed', nl)
         call write_journal(self%directory, tag, 'gone', trim(names(i)), 0, 0_i8, error)
         if (allocated(error)) return
      end do
      if (self%journals%n_damaged > 0) self%notices = joined(self%notices, 'journal: '// &
         to_text(self%journals%n_damaged)//' damaged line(s) skipped', nl)
   end subroutine note_missing

   !> Was this the checksum of sweep.h5 when it was merged, and from these very results?
   logical function has_merged(self, crc)
      class(sweep_index), intent(in) :: self
      integer(i8), intent(in) :: crc
      has_merged = self%journals%has_merged(self%merge_mark(crc))
   end function has_merged

   !> What the journal has for a merge: checksum of sweep.h5, and of which attempt at each case is in it.
   pure integer(i8) function merge_mark(self, crc)
      class(sweep_index), intent(in) :: self
      integer(i8), intent(in) :: crc !! of the file
      merge_mark = crc64(int(self%status, i8), crc64(int(self%attempt, i8), crc))
   end function merge_mark

   !> Note the records of a sound shard. Of two results for a case the one of the later attempt counts.
   subroutine take(self, words, file)
      class(sweep_index), intent(inout) :: self
      integer(i8), intent(in) :: words(:)
      integer, intent(in) :: file
      integer(i8) :: at
      integer :: case, attempt

      at = header_words + 1
      do while (words(at) > 0) ! up to the trailer
         case = int(words(at + at_case))
         attempt = int(words(at + at_attempt))
         if (attempt >= self%attempt(case)) then
            self%attempt(case) = attempt
            self%status(case) = int(words(at + at_status))
            self%message_bytes(case) = int(words(at + at_message))
            self%file(case) = file
            self%at(case) = 8*(at - 1) + 1
         end if
         at = at + words(at)
      end do
   end subroutine take

   !> The first number that no shard of a tag has had; of a rank: no shard of any rank, so that one of them can look for all.
   integer function next_number(self, tag) result(next)
      class(sweep_index), intent(in) :: self
      character(len=*), intent(in) :: tag
      character(len=name_length), allocatable :: names(:)
      integer :: i, number, stat

      next = 1
      call list_directory(self%directory//'/shards', names)
      do i = 1, size(names)
         if (names(i)(1:1) /= tag(1:1) .or. names(i)(len(tag) + 1:len(tag) + 1) /= '-') cycle
         if (tag(1:1) /= 'r' .and. index(names(i), tag//'-') /= 1) cycle
         read (names(i)(len(tag) + 2:len(tag) + 7), '(i6)', iostat=stat) number
         if (stat == 0) next = max(next, number + 1)
      end do
   end function next_number

   !> The result of a case that has one.
   subroutine fetch(self, case, shape, kept, error)
      class(sweep_index), intent(inout) :: self
      integer, intent(in) :: case
      type(case_shape), intent(in) :: shape
      type(case_result), intent(inout) :: kept !! its arrays are allocated
      type(error_type), allocatable, intent(out) :: error
      integer(i8), allocatable :: words(:)
      integer :: f, stat

      f = self%file(case)
      if (self%units(f) == 0) then
         if (self%n_open == most_open) call self%close()
         open (newunit=self%units(f), file=self%directory//'/shards/'//trim(self%files(f)), access='stream', &
               form='unformatted', status='old', action='read', iostat=stat)
         if (stat /= 0) self%units(f) = 0
         if (stat == 0) self%n_open = self%n_open + 1
      end if
      if (self%units(f) /= 0) call read_record(self%units(f), self%at(case), self%bytes/8, words)
      if (allocated(words)) then
         call decode_record(words, shape, kept)
      else
         call raise(error, self%directory//'/shards/'//trim(self%files(f))//': cannot be read any more; run again')
      end if
   end subroutine fetch

   !> A record from its place in a file; not allocated if it is not as it was when it was verified.
   subroutine read_record(unit, at, most, words)
      integer, intent(in) :: unit
      integer(i8), intent(in) :: at    !! first byte
      integer(i8), intent(in) :: most  !! words it can have
      integer(i8), allocatable, intent(out) :: words(:)
      integer(i8) :: length
      integer :: stat

      read (unit, pos=at, iostat=stat) length
      if (stat /= 0) return
      if (length < shortest_record .or. length > most) return
      allocate (words(length))
      read (unit, pos=at, iostat=stat) words
      if (stat == 0) then
         if (is_sound(words)) return
      end if
      deallocate (words)
   end subroutine read_record

   subroutine close_files(self)
      class(sweep_index), intent(inout) :: self
      integer :: f
      if (.not. allocated(self%units)) return
      do f = 1, size(self%units)
         if (self%units(f) /= 0) close (self%units(f))
         self%units(f) = 0
      end do
      self%n_open = 0
   end subroutine close_files

end module rodyn_sweep_index
