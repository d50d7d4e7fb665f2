!> What has been done to the shards of a sweep, one line each, with a checksum in front:
!>
!>     9F0C...  2025-01-31T23:59:59Z host 4711 sealed r0000-000001.shard 12 6A31...
!>
!> One file per writer, append only. Results do not depend on it (each shard proves itself); it tells which shards
!> there should be, and what happened when.
module rodyn_sweep_journal
   use rodyn_kinds, only: i8
   use rodyn_checksum, only: crc64_text, hexadecimal
   use rodyn_errors, only: error_type, raise
   use rodyn_file_text, only: read_text_file
   use rodyn_posix, only: host_name, path_exists, process_id, utc_now
   use rodyn_posix_files, only: append_text, list_directory
   use rodyn_text, only: to_text
   implicit none (type, external)
   private
   public :: write_journal, missing_shards

   integer, parameter :: name_length = 255
   character(len=*), parameter :: nl = new_line('a')

contains

   !> Note one event: 'sealed', 'combined' (into another shard), 'aside' (damaged), 'gone', 'merged'.
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

   !> Shards that were sealed once but are not there, and how many lines are damaged.
   subroutine missing_shards(directory, names, n_damaged)
      character(len=*), intent(in) :: directory
      character(len=name_length), allocatable, intent(out) :: names(:)
      integer, intent(out) :: n_damaged
      character(len=name_length), allocatable :: journals(:), away(:)
      character(len=:), allocatable :: text
      type(error_type), allocatable :: error
      logical, allocatable :: missing(:)
      integer :: i, n_away, n_sealed

      n_damaged = 0
      n_sealed = 0
      n_away = 0
      allocate (names(64), away(64))
      call list_directory(directory//'/journal', journals)
      do i = 1, size(journals)
         call read_text_file(directory//'/journal/'//trim(journals(i)), text, error)
         if (allocated(error)) cycle
         call read_lines(text)
      end do
      allocate (missing(n_sealed))
      do i = 1, n_sealed
         missing(i) = .not. path_exists(directory//'/shards/'//trim(names(i)))
         if (missing(i)) missing(i) = .not. any(away(:n_away) == names(i))
         if (missing(i)) missing(i) = .not. any(names(:i - 1) == names(i))
      end do
      names = pack(names(:n_sealed), missing)

   contains

      subroutine read_lines(text)
         character(len=*), intent(in) :: text
         integer :: first, last

         first = 1
         do while (first <= len(text))
            last = index(text(first:), nl)
            if (last == 0) then
               n_damaged = n_damaged + 1
               return
            end if
            last = first + last - 2
            if (last < first + 17) then
               n_damaged = n_damaged + 1
            else if (text(first:first + 15) /= hexadecimal(crc64_text(text(first + 17:last)))) then
               n_damaged = n_damaged + 1
            else
               call take(text(first + 17:last))
            end if
            first = last + 2
         end do
      end subroutine read_lines

      subroutine take(line)
         character(len=*), intent(in) :: line
         character(len=:), allocatable :: event, name
         event = field(line, 4)
         name = field(line, 5)
         select case (event)
         case ('sealed')
            call push(names, n_sealed, name)
         case ('combined', 'aside', 'gone')
            call push(away, n_away, name)
         case default ! says nothing of a shard
         end select
      end subroutine take

   end subroutine missing_shards

   subroutine push(list, n, name)
      character(len=name_length), allocatable, intent(inout) :: list(:)
      integer, intent(inout) :: n
      character(len=*), intent(in) :: name
      character(len=name_length), allocatable :: larger(:)
      if (n == size(list)) then
         allocate (larger(2*n))
         larger(:n) = list
         call move_alloc(larger, list)
      end if
      n = n + 1
      list(n) = name
   end subroutine push

   !> Field number `k` of a line of blank-separated ones.
   pure function field(line, k) result(text)
      character(len=*), intent(in) :: line
      integer, intent(in) :: k
      character(len=:), allocatable :: text
      integer :: first, i, length

      first = 1
      do i = 2, k
         first = first + index(line(first:), ' ')
      end do
      length = index(line(first:), ' ') - 1
      if (length < 0) length = len(line) - first + 1
      text = line(first:first + length - 1)
   end function field

end module rodyn_sweep_journal
