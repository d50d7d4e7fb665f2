!> Characters of a namelist that only look like plain ones, as word processors and web pages write them, and files that are no text.
module rodyn_namelist_characters
   use rodyn_faults, only: fault_list
   implicit none (type, external)
   private
   public :: not_a_text, make_plain

   character(len=1), parameter :: lf = achar(10), cr = achar(13), nul = achar(0)
   character(len=2), parameter :: little_endian = char(255)//char(254), big_endian = char(254)//char(255)

   !> What is taken for what.
   integer, parameter :: blank = 1, quote = 2, dash = 3, invisible = 4
   character(len=1), parameter :: plain(4) = [' ', '''', '-', ' '] !! nothing, for the invisible
   character(len=*), parameter :: rules(4) = [character(len=40) :: ' is not an ASCII blank: write a blank', &
                                              ' is not an ASCII quote: write '' or "', ' is not an ASCII minus sign: write -', &
                                              ' is invisible: delete it']

contains

   !> Why this is no text that could be read; empty if it is one.
   pure function not_a_text(text) result(reason)
      character(len=*), intent(in) :: text
      character(len=:), allocatable :: reason
      integer :: i, zeros
      logical :: wide !! four bytes a character

      reason = ''
      zeros = 0
      wide = .false.
      if (index(text, nul) > 0) zeros = count([(text(i:i) == nul, i=1, len(text))])
      if (zeros > 0) wide = index(text, little_endian//nul//nul) == 1 .or. index(text, nul//nul//big_endian) == 1
      if (wide .or. 10*zeros > 7*len(text)) then
         reason = 'the file is UTF-32 text; save it as UTF-8'
      else if (index(text, little_endian) == 1 .or. index(text, big_endian) == 1 .or. 5*zeros > 2*len(text)) then
         reason = 'the file is UTF-16 text; save it as UTF-8'
      else if (zeros > 0) then
         reason = 'not a text file: it has bytes that are 0'
      else if (index(text, lf) == 0 .and. index(text, cr) > 0) then
         reason = 'the lines end in CR alone; save the file with LF or CR LF'
      end if
   end function not_a_text

   !> Put plain characters in the place of those that look like them, but in comments and in texts, and note each kind in each line.
   subroutine make_plain(text, faults)
      character(len=:), allocatable, intent(inout) :: text
      type(fault_list), intent(inout) :: faults
      character(len=:), allocatable :: buffer
      character(len=1) :: c, within !! quote of the text that is open; blank: none
      integer :: reported(4)        !! line of the last fault of each kind
      integer :: at, code, kind, length, line, n
      logical :: comment, foreign   !! in a comment; in a text with quotes that are not plain

      if (all_ascii(text)) return
      allocate (character(len=len(text)) :: buffer)
      reported = 0
      line = 1
      n = 0
      within = ' '
      comment = .false.
      foreign = .false.
      at = 1
      if (index(text, char(239)//char(187)//char(191)) == 1) at = 4 ! byte order mark
      do while (at <= len(text))
         kind = 0
         length = 1
         c = text(at:at)
         if (iachar(c) > 127 .and. .not. comment) call recognise(text(at:min(len(text), at + 2)), kind, code, length)
         if (within /= ' ' .and. .not. (foreign .and. kind == quote)) kind = 0
         if (kind == 0) length = 1
         if (kind > 0) then
            if (reported(kind) /= line) call faults%add(line, 'character '//code_text(code)//trim(rules(kind)))
            reported(kind) = line
            c = plain(kind)
         end if
         if (kind /= invisible) then
            n = n + 1
            buffer(n:n) = c
         end if
         select case (c)
         case (lf)
            line = line + 1
            comment = .false.
            within = ' '
         case ('!')
            comment = comment .or. within == ' '
         case ('''', '"')
            if (.not. comment .and. within == ' ') then
               within = c
               foreign = kind == quote
            else if (c == within) then
               within = ' '
            end if
         case default ! changes nothing
         end select
         at = at + length
      end do
      text = buffer(:n)
   end subroutine make_plain

   pure logical function all_ascii(text)
      character(len=*), intent(in) :: text
      integer :: i
      all_ascii = .false.
      do i = 1, len(text)
         if (iachar(text(i:i)) > 127) return
      end do
      all_ascii = .true.
   end function all_ascii

   !> Which plain character the one at the beginning of a text looks like.
   pure subroutine recognise(text, kind, code, length)
      character(len=*), intent(in) :: text !! up to three bytes
      integer, intent(out) :: kind         !! 0: none
      integer, intent(out) :: code         !! of Unicode
      integer, intent(out) :: length       !! bytes

      kind = 0
      code = 0
      length = min(2, len(text))
      if (length == 2) then
         code = ior(ishft(iand(iachar(text(1:1)), 31), 6), iand(iachar(text(2:2)), 63))
         if (text(1:1) /= char(194)) code = 0
         if (code == 160) kind = blank
         if (code == 173) kind = invisible
      end if
      if (kind > 0 .or. len(text) < 3 .or. iand(iachar(text(1:1)), 240) /= 224) return
      length = 3
      code = ior(ior(ishft(iand(iachar(text(1:1)), 15), 12), ishft(iand(iachar(text(2:2)), 63), 6)), iand(iachar(text(3:3)), 63))
      select case (code)
      case (8192:8202, 8239, 8287, 12288)
         kind = blank
      case (8216:8223, 8242, 8243)
         kind = quote
      case (8208:8213, 8722)
         kind = dash
      case (8203:8207, 8288, 65279)
         kind = invisible
      case default ! stays what it is
      end select
   end subroutine recognise

   !> 'U+00A0'
   pure function code_text(code) result(text)
      integer, intent(in) :: code
      character(len=6) :: text
      write (text, '("U+", z4.4)') code
   end function code_text

end module rodyn_namelist_characters
