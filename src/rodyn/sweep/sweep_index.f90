!> Which results are on the disk: every shard read and verified, and where the result of each case stands.
module rodyn_sweep_index
   use rodyn_kinds, only: i8
   use rodyn_errors, only: error_type, raise
   use rodyn_posix, only: path_exists, rename_over
   use rodyn_posix_files, only: list_directory, read_words
   use rodyn_sweep_case, only: case_result, case_shape
   use rodyn_sweep_journal, only: missing_shards, write_journal
   use rodyn_sweep_record, only: at_attempt, at_case, at_status, check_shard, decode_record, header_words
   use rodyn_text, only: to_text
   implicit none (type, external)
   private
   public :: sweep_index, notice_list

   integer, parameter :: name_length = 255
   integer, parameter :: most_open = 64 !! files open at once while results are fetched
   integer, parameter :: most_notices = 1000

   !> What should be told of a directory.
   type :: notice_list
      integer :: n = 0
      character(len=name_length) :: text(most_notices)
   end type notice_list

   type :: sweep_index
      character(len=:), allocatable :: directory
      character(len=name_length), allocatable :: files(:)
      integer, allocatable :: status(:)       !! of each case; 0: no result
      integer, allocatable :: attempt(:)      !! of each case
      integer, allocatable, private :: file(:)    !! which file has the result
      integer(i8), allocatable, private :: at(:)  !! where: first byte
      integer, allocatable, private :: units(:)   !! of each file; 0: closed
      integer, private :: n_open = 0
      integer(i8) :: bytes = 0                !! of all shards
      integer :: n_damaged = 0                !! shards set aside now
      integer :: n_gone = 0                   !! shards that are not there although the journal has them
   contains
      procedure :: scan
      procedure :: next_number
      procedure :: fetch
      procedure :: close => close_files
   end type sweep_index

contains

   !> Read all shards. Those that are damaged are set aside under another name, so that their cases count as missing.
   subroutine scan(self, directory, fingerprint, shape, n_cases, tag, others, notices, error)
      class(sweep_index), intent(out) :: self
      character(len=*), intent(in) :: directory
      integer(i8), intent(in) :: fingerprint
      type(case_shape), intent(in) :: shape
      integer, intent(in) :: n_cases
      character(len=*), intent(in) :: tag    !! journal in which findings are noted
      character(len=*), intent(in) :: others !! do not read shards whose names end like this, unless they begin with `tag`
      type(notice_list), intent(inout) :: notices
      type(error_type), allocatable, intent(out) :: error
      character(len=name_length), allocatable :: names(:)
      character(len=:), allocatable :: fault
      integer(i8), allocatable :: words(:)
      integer :: i, n

      self%directory = directory
      allocate (self%status(n_cases), self%attempt(n_cases), self%file(n_cases), source=0)
      allocate (self%at(n_cases), source=0_i8)
      call list_directory(directory//'/shards', names)
      allocate (self%files(size(names)))
      n = 0
      do i = 1, size(names)
         if (.not. ends_with(names(i), '.shard')) cycle
         if (len(others) > 0) then
            if (index(names(i), others) > 0 .and. index(names(i), tag//'-') /= 1) cycle
         end if
         call read_words(directory//'/shards/'//trim(names(i)), words)
         fault = check_shard(words, fingerprint, shape, n_cases)
         if (len(fault) > 0) then
            call set_aside(self, trim(names(i)), tag, fault, notices, error)
            if (allocated(error)) return
            cycle
         end if
         n = n + 1
         self%files(n) = names(i)
         self%bytes = self%bytes + 8_i8*size(words)
         call take(self, words, n)
      end do
      self%files = self%files(:n)
      allocate (self%units(n), source=0)
      if (len(others) > 0) return
      call tell_of_missing(self, tag, notices, error)
   end subroutine scan

   !> Rename a damaged shard; its number is not used again.
   subroutine set_aside(self, name, tag, fault, notices, error)
      class(sweep_index), intent(inout) :: self
      character(len=*), intent(in) :: name, tag, fault
      type(notice_list), intent(inout) :: notices
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: path, failure

      path = self%directory//'/shards/'//name
      failure = rename_over(path, path//'.damaged')
      if (len(failure) > 0 .and. path_exists(path)) then
         call raise(error, path//': is damaged ('//fault//') and cannot be set aside: '//failure)
         return
      end if
      self%n_damaged = self%n_damaged + 1
      call tell(notices, 'shard '//name//': '//fault//'; set aside, its cases are done again')
      call write_journal(self%directory, tag, 'aside', name, 0, 0_i8, error)
   end subroutine set_aside

   !> Shards that the journal knows but that are not there.
   subroutine tell_of_missing(self, tag, notices, error)
      class(sweep_index), intent(inout) :: self
      character(len=*), intent(in) :: tag
      type(notice_list), intent(inout) :: notices
      type(error_type), allocatable, intent(out) :: error
      character(len=name_length), allocatable :: names(:)
      integer :: i, n_lines

      call missing_shards(self%directory, names, n_lines)
      self%n_gone = size(names)
      do i = 1, size(names)
         call tell(notices, 'shard '//trim(names(i))//': sealed, but not there; its cases are done again')
         call write_journal(self%directory, tag, 'gone', trim(names(i)), 0, 0_i8, error)
         if (allocated(error)) return
      end do
      if (n_lines > 0) call tell(notices, 'journal: '//to_text(n_lines)//' damaged line(s) passed over')
   end subroutine tell_of_missing

   subroutine tell(notices, text)
      type(notice_list), intent(inout) :: notices
      character(len=*), intent(in) :: text
      if (notices%n == most_notices) return
      notices%n = notices%n + 1
      notices%text(notices%n) = text
   end subroutine tell

   !> Note the records of a shard. Of two results for a case the one of the later attempt counts.
   subroutine take(self, words, file)
      class(sweep_index), intent(inout) :: self
      integer(i8), intent(in) :: words(:)
      integer, intent(in) :: file
      integer(i8) :: at, n
      integer :: case, attempt

      at = header_words + 1
      do n = 1, words(3)
         case = int(words(at + at_case))
         attempt = int(words(at + at_attempt))
         if (attempt >= self%attempt(case)) then
            self%attempt(case) = attempt
            self%status(case) = int(words(at + at_status))
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
      integer(i8) :: length
      integer :: f, stat

      f = self%file(case)
      if (self%units(f) == 0) then
         if (self%n_open == most_open) call self%close()
         open (newunit=self%units(f), file=self%directory//'/shards/'//trim(self%files(f)), access='stream', &
               form='unformatted', status='old', action='read', iostat=stat)
         if (stat /= 0) self%units(f) = 0
         if (stat == 0) self%n_open = self%n_open + 1
      end if
      if (self%units(f) /= 0) read (self%units(f), pos=self%at(case), iostat=stat) length
      if (stat == 0) then
         allocate (words(length))
         read (self%units(f), pos=self%at(case), iostat=stat) words
      end if
      if (stat == 0) then
         call decode_record(words, shape, kept)
      else
         call raise(error, self%directory//'/shards/'//trim(self%files(f))//': cannot be read any more; run again')
      end if
   end subroutine fetch

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

   pure logical function ends_with(name, ending)
      character(len=*), intent(in) :: name, ending
      integer :: n
      n = len_trim(name)
      ends_with = n > len(ending)
      if (ends_with) ends_with = name(n - len(ending) + 1:n) == ending
   end function ends_with

end module rodyn_sweep_index
