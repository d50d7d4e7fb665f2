!> A strict reader of namelist syntax: text in, document out, every fault of syntax noted with its line.
!>
!> One pass, linear in the length of the text, and no input can stop it: after a fault it goes on at the next
!> value, key, group or line, so that one call finds all faults.
module rodyn_namelist_parser
   use rodyn_namelist_document, only: namelist_document, namelist_entry, namelist_value, add_group, add_entry, &
      add_value, is_string, shown_value, index_text
   use rodyn_namelist_value_text, only: classify
   use rodyn_text, only: is_digit, is_name, lower, printable, to_text
   use rodyn_utf8, only: first_bad_byte
   implicit none (type, external)
   private
   public :: parse_document, parse_values, scanner, parse_key

   character(len=1), parameter :: tab = achar(9), lf = achar(10), cr = achar(13)
   character(len=*), parameter :: blanks = ' '//tab//lf//cr
   character(len=*), parameter :: ends_token = blanks//',/!='//'"'//"'"
   integer, parameter :: shown_max = 60       !! longest piece of the file quoted in a message
   integer, parameter :: longest_index = 64   !! characters of the '(...)' after a key
   integer, parameter :: most_copies = 1000000 !! largest repeat count, as large as the largest n_rods

   !> Where the reader stands.
   type :: scanner
      integer :: at = 1   !! position of the next character
      integer :: line = 1 !! its line
   end type scanner

contains

   !> Parse the text of a whole file. Faults end up in `document%faults`.
   subroutine parse_document(text, name, document)
      character(len=*), intent(in) :: text
      character(len=*), intent(in) :: name !! of the file, for messages
      type(namelist_document), intent(out) :: document
      type(scanner) :: s

      document%name = name
      document%text = text
      call check_encoding(document)
      if (index(text, char(239)//char(187)//char(191)) == 1) s%at = 4 ! byte order mark
      do
         call skip_blanks(document, s)
         if (s%at > len(text)) exit
         if (text(s%at:s%at) == '&') then
            call parse_group(document, s)
         else
            call skip_stray_text(document, s)
         end if
      end do
      document%n_lines = s%line
      if (len(text) > 0) then
         if (text(len(text):) == lf) document%n_lines = s%line - 1
      end if
   end subroutine parse_document

   subroutine check_encoding(document)
      type(namelist_document), intent(inout) :: document
      integer :: bad, i, line
      bad = first_bad_byte(document%text)
      if (bad == 0) return
      line = 1 + count([(document%text(i:i) == lf, i=1, bad - 1)])
      call document%faults%add(line, 'byte '//to_text(ichar(document%text(bad:bad))) &
         //' is not part of UTF-8 text (further ones are not shown)')
   end subroutine check_encoding

   !> Past spaces, line ends and comments.
   pure subroutine skip_blanks(document, s)
      type(namelist_document), intent(in) :: document
      type(scanner), intent(inout) :: s
      logical :: comment

      comment = .false.
      do while (s%at <= len(document%text))
         select case (document%text(s%at:s%at))
         case (lf)
            s%line = s%line + 1
            comment = .false.
         case ('!')
            comment = .true.
         case (' ', tab, cr)
            continue
         case default
            if (.not. comment) return
         end select
         s%at = s%at + 1
      end do
   end subroutine skip_blanks

   !> Text outside of groups: one fault for the rest of the line, or up to the next group on it.
   subroutine skip_stray_text(document, s)
      type(namelist_document), intent(inout) :: document
      type(scanner), intent(inout) :: s
      integer :: first

      first = s%at
      s%at = s%at + span(document%text(first:), lf//'&!')
      call document%faults%add(s%line, printable(trim(document%text(first:s%at - 1)), shown_max) &
         //': text outside of a group')
   end subroutine skip_stray_text

   !> Characters before the first one of `set`, or all.
   pure integer function span(text, set)
      character(len=*), intent(in) :: text, set
      span = scan(text, set) - 1
      if (span < 0) span = len(text)
   end function span

   !> `&name ... /`; the scanner stands on the '&'.
   subroutine parse_group(document, s)
      type(namelist_document), intent(inout) :: document
      type(scanner), intent(inout) :: s
      integer :: g, length

      length = span(document%text(s%at + 1:), ends_token//'&')
      call add_group(document, document%text(s%at + 1:s%at + length), s%line)
      g = document%n_groups
      if (length == 0) call document%faults%add(s%line, '&: a group name must follow')
      s%at = s%at + length + 1
      do
         call skip_blanks(document, s)
         if (s%at > len(document%text)) exit
         select case (document%text(s%at:s%at))
         case ('/')
            s%at = s%at + 1
            return
         case ('&')
            exit
         case default
            call parse_assignment(document, s)
         end select
      end do
      call complain_of_open_group(document, g, s)
   end subroutine parse_group

   subroutine complain_of_open_group(document, g, s)
      type(namelist_document), intent(inout) :: document
      integer, intent(in) :: g !! group
      type(scanner), intent(in) :: s
      character(len=:), allocatable :: where_noticed

      where_noticed = 'the file ends'
      if (s%at <= len(document%text)) where_noticed = 'the next group begins in line '//to_text(s%line)
      call document%faults%add(document%groups(g)%line, '&'//printable(trim(document%groups(g)%name), shown_max) &
         //': missing / at the end of the group ('//where_noticed//')')
   end subroutine complain_of_open_group

   !> `key = values`; text that is none gets one fault and is skipped.
   subroutine parse_assignment(document, s)
      type(namelist_document), intent(inout) :: document
      type(scanner), intent(inout) :: s
      type(scanner) :: next
      integer :: first

      next = after_equals(document, s)
      first = s%at
      if (next%at > 0) then
         call parse_key(document, s, document%text(first:next%at - 2))
         s = next
         call parse_values(document, s)
      else if (scan(document%text(first:first), '"''') == 1) then
         s%at = first + 2 + span(document%text(first + 1:), document%text(first:first)//lf)
         s%at = min(s%at, len(document%text) + 1)
         if (document%text(s%at - 1:s%at - 1) == lf) s%at = s%at - 1
         call fault_in_group(document, s%line, document%text(first:s%at - 1), 'text without a key before it')
      else
         s%at = first + max(1, span(document%text(first:), ends_token))
         call fault_in_group(document, s%line, document%text(first:s%at - 1), 'expected a key and =')
         if (next_character(document, s) == ',') s%at = s%at + 1
      end if
   end subroutine parse_assignment

   subroutine fault_in_group(document, line, text, rule)
      type(namelist_document), intent(inout) :: document
      integer, intent(in) :: line
      character(len=*), intent(in) :: text, rule
      call document%faults%add(line, '&'//printable(trim(document%groups(document%n_groups)%name), shown_max)//' ' &
         //printable(trim(text), shown_max)//': '//rule)
   end subroutine fault_in_group

   !> If what stands here is followed by '=', the scanner after the '='; else one with at = 0.
   pure function after_equals(document, s) result(next)
      type(namelist_document), intent(in) :: document
      type(scanner), intent(in) :: s
      type(scanner) :: next
      integer :: closing, n

      n = len(document%text)
      next = s
      next%at = s%at + span(document%text(s%at:), ends_token//'(')
      call skip_white(document, next)
      if (next%at <= n) then
         if (document%text(next%at:next%at) == '(' .and. next%at > s%at) then
            closing = index(document%text(next%at:min(n, next%at + longest_index)), ')')
            next%at = merge(next%at + closing, n + 1, closing > 0)
            call skip_white(document, next)
         end if
      end if
      if (next%at <= n) then
         if (document%text(next%at:next%at) == '=') then
            next%at = next%at + 1
            return
         end if
      end if
      next%at = 0
   end function after_equals

   !> Past spaces and line ends, not past comments.
   pure subroutine skip_white(document, s)
      type(namelist_document), intent(in) :: document
      type(scanner), intent(inout) :: s
      do while (s%at <= len(document%text))
         if (index(blanks, document%text(s%at:s%at)) == 0) return
         if (document%text(s%at:s%at) == lf) s%line = s%line + 1
         s%at = s%at + 1
      end do
   end subroutine skip_white

   !> Append the entry for a key such as 'length', 'length(3)' or 'length (1 : 3)'.
   subroutine parse_key(document, s, text)
      type(namelist_document), intent(inout) :: document
      type(scanner), intent(in) :: s
      character(len=*), intent(in) :: text !! everything before the '='
      type(namelist_entry) :: entry
      character(len=:), allocatable :: key
      integer :: length

      length = span(text, blanks//'(')
      key = lower(text(:length))
      entry%key = key
      entry%line = s%line
      entry%faulty = .not. is_name(key)
      if (entry%faulty) then
         call fault_in_group(document, s%line, text, 'not the name of a key')
      else if (index(text, '(') > 0) then
         call parse_index(text(index(text, '(') + 1:index(text, ')') - 1), entry)
         if (entry%faulty) call fault_in_group(document, s%line, text, &
            'an index is one whole number or a range such as (1:3)')
      end if
      call add_entry(document, entry)
   end subroutine parse_key

   !> '3' or '1:3'
   subroutine parse_index(text, entry)
      character(len=*), intent(in) :: text
      type(namelist_entry), intent(inout) :: entry
      integer :: colon
      logical :: ok(2)

      entry%indexed = .true.
      colon = index(text, ':')
      if (colon == 0) then
         call parse_integer(text, entry%lower, ok(1))
         entry%upper = entry%lower
         entry%faulty = .not. ok(1)
      else
         call parse_integer(text(:colon - 1), entry%lower, ok(1))
         call parse_integer(text(colon + 1:), entry%upper, ok(2))
         entry%faulty = .not. all(ok)
         if (.not. entry%faulty) entry%faulty = entry%upper < entry%lower
      end if
   end subroutine parse_index

   subroutine parse_integer(text, i, ok)
      character(len=*), intent(in) :: text
      integer, intent(out) :: i
      logical, intent(out) :: ok
      character(len=:), allocatable :: digits
      i = 0
      digits = trim(adjustl(text))
      ok = len(digits) > 0 .and. len(digits) <= 9
      if (ok) ok = verify(digits, '0123456789') == 0 .or. &
         (len(digits) > 1 .and. digits(1:1) == '-' .and. verify(digits(2:), '0123456789') == 0)
      if (ok) read (digits, *) i
   end subroutine parse_integer

   !> Append the values of the last entry, up to the next key, '/', '&' or the end of the text.
   subroutine parse_values(document, s)
      type(namelist_document), intent(inout) :: document
      type(scanner), intent(inout) :: s
      type(scanner) :: next
      logical :: value_due !! nothing but '=' or ',' stands before

      value_due = .true.
      do
         call skip_blanks(document, s)
         if (s%at > len(document%text)) exit
         select case (document%text(s%at:s%at))
         case ('/', '&')
            exit
         case (',')
            if (value_due) call complain(document, s%line, 'a value is missing before the comma')
            value_due = .true.
            s%at = s%at + 1
         case ('=')
            call complain(document, s%line, 'unexpected second =')
            s%at = s%at + 1
         case default
            next = after_equals(document, s)
            if (next%at > 0) exit
            call parse_value(document, s)
            value_due = .false.
         end select
      end do
      associate (entry => document%entries(document%n_entries))
         if (entry%last < entry%first) call complain(document, entry%line, 'has no value')
      end associate
   end subroutine parse_values

   !> Note a fault of the last entry, the first only, and mark the entry.
   subroutine complain(document, line, rule, value)
      type(namelist_document), intent(inout) :: document
      integer, intent(in) :: line
      character(len=*), intent(in) :: rule
      character(len=*), intent(in), optional :: value !! as written
      character(len=:), allocatable :: shown

      associate (entry => document%entries(document%n_entries))
         if (entry%faulty) return
         entry%faulty = .true.
         shown = ''
         if (present(value)) shown = ' = '//printable(value, shown_max)
         call fault_in_group(document, line, trim(entry%key)//index_text(entry)//shown, rule)
      end associate
   end subroutine complain

   !> One value: [repeat count *] word or string.
   subroutine parse_value(document, s)
      type(namelist_document), intent(inout) :: document
      type(scanner), intent(inout) :: s
      type(namelist_value) :: value
      integer :: last

      value%line = s%line
      last = s%at + span(document%text(s%at:), ends_token) - 1
      call take_repeat_count(document, s, last, value)
      if (last >= s%at) then
         value%first = s%at
         value%last = last
         s%at = last + 1
         call classify(document%text(value%first:value%last), value)
      else if (scan(next_character(document, s), '"''') == 1) then
         call parse_string(document, s, value)
      else
         call complain(document, s%line, 'a value is missing after the repeat count')
         return
      end if
      call add_value(document, value)
      if (index(blanks//',/!=', next_character(document, s)) == 0) call complain(document, s%line, &
         'a comma or a blank is missing between two values', shown_value(document, value))
   end subroutine parse_value

   !> The character at the scanner; a blank at the end of the text.
   pure character(len=1) function next_character(document, s)
      type(namelist_document), intent(in) :: document
      type(scanner), intent(in) :: s
      next_character = ' '
      if (s%at <= len(document%text)) next_character = document%text(s%at:s%at)
   end function next_character

   !> Past `digits*`, if that is how the token from the scanner to `last` begins.
   subroutine take_repeat_count(document, s, last, value)
      type(namelist_document), intent(inout) :: document
      type(scanner), intent(inout) :: s
      integer, intent(in) :: last
      type(namelist_value), intent(inout) :: value
      integer :: copies, star
      logical :: ok

      star = index(document%text(s%at:last), '*')
      if (star < 2) return
      if (verify(document%text(s%at:s%at + star - 2), '0123456789') /= 0) return
      call parse_integer(document%text(s%at:s%at + star - 2), copies, ok)
      if (ok) ok = copies >= 1 .and. copies <= most_copies
      if (ok) then
         value%copies = copies
      else
         call complain(document, s%line, 'a repeat count must lie in 1..'//to_text(most_copies), &
            document%text(s%at:last))
      end if
      s%at = s%at + star
   end subroutine take_repeat_count

   !> A string; the scanner stands on its first quote. It must end on its line.
   subroutine parse_string(document, s, value)
      type(namelist_document), intent(inout) :: document
      type(scanner), intent(inout) :: s
      type(namelist_value), intent(inout) :: value
      character(len=1) :: c, quote
      logical :: closed, control

      value%kind = is_string
      quote = document%text(s%at:s%at)
      closed = .false.
      control = .false.
      s%at = s%at + 1
      value%first = s%at
      do while (s%at <= len(document%text))
         c = document%text(s%at:s%at)
         if (c == lf .or. (closed .and. c /= quote)) exit
         if (c == quote) closed = .not. closed ! a doubled quote closes and opens again
         if ((iachar(c) < 32 .and. c /= tab) .or. iachar(c) == 127) control = .true.
         s%at = s%at + 1
      end do
      value%last = s%at - merge(2, 1, closed)
      if (.not. closed) then
         call complain(document, value%line, 'the text does not end on its line: a quote is missing', &
            document%text(value%first - 1:value%last))
      else if (control) then
         call complain(document, value%line, 'control character in a text', shown_value(document, value))
      end if
   end subroutine parse_string

end module rodyn_namelist_parser
