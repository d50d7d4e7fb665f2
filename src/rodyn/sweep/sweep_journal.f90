!> What has been done to the shards of a sweep, one line each, with a checksum in front:
!>
!>     9F0C...  2025-01-31T23:59:59Z host 4711 sealed r0000-000001.shard 12 6A31...
!>
!> One file per writer, append only. Results do not depend on it (each shard proves itself); it tells which shards
!> there should be, what checksum sweep.h5 has, and what happened when.
module rodyn_sweep_journal
   use rodyn_kinds, only: i8
   use rodyn_checksum, only: crc64_text, hexadecimal
   use rodyn_errors, only: error_type, raise
   use rodyn_file_text, only: read_text_file
   use rodyn_posix, only: host_name, path_exists, process_id, utc_now
   use rodyn_posix_files, only: append_text, list_directory
   use rodyn_text, only: to_text, word
   implicit none (type, external)
   private
   public :: write_journal, read_journals, journal_content

   integer, parameter :: name_length = 255
   character(len=*), parameter :: nl = new_line('a')

   !> What all journals say.
   type :: journal_content
      integer :: n_damaged = 0 !! lines
      integer, private :: n_sealed = 0, n_away = 0, n_merged = 0
      character(len=name_length), allocatable, private :: sealed(:), away(:) !! names of shards
      character(len=name_length), allocatable, private :: merged(:)          !! checksums
   contains
      procedure :: missing
      procedure :: has_merged
      procedure, private :: take_lines
      procedure, private :: take
   end type journal_content

contains

   !> Note one event: 'sealed', 'aside' (damaged), 'gone', 'merged'.
   subroutine write_journal(directory, tag, event, name, n_records, crc, error)
      character(len=*), intent(in) :: directory, tag
      character(len=*), intent(in) :: event, name
      integer, intent(in) :: n_records
      integer(i8), intent(in) :: crc
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: failure, line

      line = utc_now()//' '//host_name()//' '//to_text(process_id())//' '//event//' '//name//' '//to_text(n_records)//' ' &
             //hexadecimal(crc)
      failure = append_text(directory//'/journal/'//tag//'.txt', hexadecimal(crc64_text(line))//' '//line//nl)
      if (len(failure) > 0) call raise(error, directory//'/journal/'//tag//'.txt: cannot be written: '//failure)
   end subroutine write_journal

   subroutine read_journals(directory, content)
      character(len=*), intent(in) :: directory
      type(journal_content), intent(out) :: content
      character(len=name_length), allocatable :: journals(:)
      character(len=:), allocatable :: text
      type(error_type), allocatable :: error
      integer :: i

      allocate (content%sealed(64), content%away(64), content%merged(8))
      call list_directory(directory//'/journal', journals)
      do i = 1, size(journals)
         call read_text_file(directory//'/journal/'//trim(journals(i)), text, error)
         if (.not. allocated(error)) call content%take_lines(text)
      end do
   end subroutine read_journals

   !> Shards that were sealed once, and not set aside, but are not there.
   subroutine missing(self, directory, names)
      class(journal_content), intent(in) :: self
      character(len=*), intent(in) :: directory
      character(len=name_length), allocatable, intent(out) :: names(:)
      integer :: i, n

      allocate (names(64))
      n = 0
      do i = 1, self%n_sealed
         if (path_exists(directory//'/shards/'//trim(self%sealed(i)))) cycle
         if (any(self%away(:self%n_away) == self%sealed(i)) .or. any(names(:n) == self%sealed(i))) cycle
         call push(names, n, trim(self%sealed(i)))
      end do
      names = names(:n)
   end subroutine missing

   !> Has a result with this checksum been merged?
   pure logical function has_merged(self, crc)
      class(journal_content), intent(in) :: self
      integer(i8), intent(in) :: crc
      has_merged = any(self%merged(:self%n_merged) == hexadecimal(crc))
   end function has_merged

   !> Take in the lines of one journal; damaged ones are counted.
   subroutine take_lines(self, text)
      class(journal_content), intent(inout) :: self
      character(len=*), intent(in) :: text
      integer :: first, last

      first = 1
      do while (first <= len(text))
         last = index(text(first:), nl)
         if (last == 0) then
            self%n_damaged = self%n_damaged + 1
            return
         end if
         last = first + last - 2
         if (last < first + 17) then
            self%n_damaged = self%n_damaged + 1
         else if (text(first:first + 15) /= hexadecimal(crc64_text(text(first + 17:last)))) then
            self%n_damaged = self%n_damaged + 1
         else
            call self%take(text(first + 17:last))
         end if
         first = last + 2
      end do
   end subroutine take_lines

   subroutine take(self, line)
      class(journal_content), intent(inout) :: self
      character(len=*), intent(in) :: line

      select case (word(line, 4, ' '))
      case ('sealed')
         call push(self%sealed, self%n_sealed, word(line, 5, ' '))
      case ('aside', 'gone')
         call push(self%away, self%n_away, word(line, 5, ' '))
      case ('merged')
         call push(self%merged, self%n_merged, word(line, 7, ' '))
      case default ! an event of a later version
      end select
   end subroutine take

   subroutine push(list, n, name)
      character(len=name_length), allocatable, intent(inout) :: list(:)
      integer, intent(inout) :: n
      character(len=*), intent(in) :: name
      if (n == size(list)) list = [list, list]
      n = n + 1
      list(n) = name
   end subroutine push

end module rodyn_sweep_journal
