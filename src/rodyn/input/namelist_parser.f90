!> A strict reader of namelist syntax: text in, document out, every fault of syntax noted with its line.
!>
!> One pass, linear in the length of the text, and no input can stop it: after a fault it goes on at the next
!> value, key, group or line, so that one call finds all faults.
module rodyn_namelist_parser
   use rodyn_kinds, only: wp
   use rodyn_namelist_document, only: namelist_document, namelist_entry, namelist_value, add_group, add_entry, &
      add_value, is_integer, is_long_integer, is_real, is_string, shown_value, index_text
   use rodyn_namelist_characters, only: make_plain, not_a_text
   use rodyn_namelist_value_text, only: classify
   use rodyn_text, only: formatted, is_name, lower, printable, tidy, to_text
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

   !> Parse the text of a whole file. Faults end up in `document%faults`; of a file that is no text there is one.
   subroutine parse_document(text, name, document)
      character(len=*), intent(in) :: text
      character(len=*), intent(in) :: name !! of the file, for messages
      type(namelist_document), intent(out) :: document
      type(scanner) :: s

      document%name = name
      document%text = text
      document%readable = len(not_a_text(text)) == 0
      if (.not. document%readable) then
         call document%faults%add(1, not_a_text(text))
         return
      end if
      call check_encoding(document)
      call make_plain(document%text, document%faults)
      do
         call skip_blanks(document, s)
         if (s%at > len(document%text)) exit
         if (begins_group(document, s)) then
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

   !> Does a group begin here? It should with &; some programs take $.
   pure logical function begins_group(document, s)
      type(namelist_document), intent(in) :: document
      type(scanner), intent(in) :: s
      begins_group = scan(next_character(document, s), '&$') == 1 .and. length_of_end(document, s) == 0
   end function begins_group

   !> Characters of a mark that ends groups in other programs, &end, $end or $; 0 if none stands here.
   pure integer function length_of_end(document, s) result(length)
      type(namelist_document), intent(in) :: document
      type(scanner), intent(in) :: s

      length = 0
      if (scan(next_character(document, s), '&$') == 0) return
      length = 1 + span(document%text(s%at + 1:), ends_token//'&$')
      if (lower(document%text(s%at + 1:s%at + length - 1)) == 'end') return
      if (length == 1 .and. document%text(s%at:s%at) == '$') return
      length = 0
   end function length_of_end

   !> Text outside of groups: one fault for the rest of the line, or up to the next group on it.
   subroutine skip_stray_text(document, s)
      type(namelist_document), intent(inout) :: document
      type(scanner), intent(inout) :: s
      integer :: first

      first = s%at
      s%at = s%at + 1 + span(document%text(first + 1:), lf//'&!')
      call document%faults%add(s%line, printable(trim(document%text(first:s%at - 1)), shown_max) &
         //': text outside of a group'//end_hint(document, s%line)//comment_hint(document%text(first:s%at - 1)))
   end subroutine skip_stray_text

   !> Where a group has just ended on the same line, its / may not have been meant so.
   pure function end_hint(document, line) result(hint)
      type(namelist_document), intent(in) :: document
      integer, intent(in) :: line
      character(len=:), allocatable :: hint

      hint = ''
      if (document%n_groups == 0 .or. line /= document%last_end) return
      hint = '; the / before it ends &'//printable(trim(document%groups(document%n_groups)%name), shown_max)
   end function end_hint

   !> Marks of comments in other languages.
   pure function comment_hint(text) result(hint)
      character(len=*), intent(in) :: text
      character(len=:), allocatable :: hint
      hint = ''
      if (scan(text(1:1), '#%;*') == 1 .or. text(:min(2, len(text))) == '//' .or. text(:min(2, len(text))) == '--') &
         hint = '; a comment begins with !'
   end function comment_hint

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
      if (document%text(s%at:s%at) == '$') call document%faults%add(s%line, &
         printable(document%text(s%at:s%at + length), shown_max)//': a group begins with &')
      s%at = s%at + length + 1
      do
         call skip_blanks(document, s)
         if (s%at > len(document%text)) exit
         if (length_of_end(document, s) > 0) then
            call end_by_word(document, s)
            return
         end if
         select case (document%text(s%at:s%at))
         case ('/')
            s%at = s%at + 1
            if (next_character(document, s) == '/') then ! a comment, as other languages have it
               call skip_words(document, s, s%at - 1, 'a comment begins with !')
               cycle
            end if
            document%last_end = s%line
            return
         case ('&')
            exit
         case default
            call parse_assignment(document, s)
         end select
      end do
      call report_open_group(document, g, s)
   end subroutine parse_group

   !> &end, $end or $ in place of the /.
   subroutine end_by_word(document, s)
      type(namelist_document), intent(inout) :: document
      type(scanner), intent(inout) :: s
      integer :: length
      length = length_of_end(document, s)
      call fault_in_group(document, s%line, document%text(s%at:s%at + length - 1), 'a group ends with /')
      s%at = s%at + length
   end subroutine end_by_word

   subroutine report_open_group(document, g, s)
      type(namelist_document), intent(inout) :: document
      integer, intent(in) :: g !! group
      type(scanner), intent(in) :: s
      character(len=:), allocatable :: where_noticed

      where_noticed = 'the file ends'
      if (s%at <= len(document%text)) where_noticed = 'the next group begins in line '//to_text(s%line)
      call document%faults%add(document%groups(g)%line, '&'//printable(trim(document%groups(g)%name), shown_max) &
         //': missing / at the end of the group ('//where_noticed//')')
   end subroutine report_open_group

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
         call skip_words(document, s, first, 'expected a key and ='// &
                         comment_hint(document%text(first:min(len(document%text), first + 1))))
      end if
   end subroutine parse_assignment

   !> Words without a key: one fault for all of them, up to the next assignment, the end of the group or that of the line.
   subroutine skip_words(document, s, first, rule)
      type(namelist_document), intent(inout) :: document
      type(scanner), intent(inout) :: s
      integer, value :: first !! where they begin; a copy, for it may come as `s%at`
      character(len=*), intent(in) :: rule
      type(scanner) :: next
      integer :: last

      s%at = first + max(1, span(document%text(first:), ends_token))
      if (document%text(first:min(len(document%text), s%at)) == '//') s%at = s%at + 1
      last = s%at - 1
      do while (s%at <= len(document%text))
         if (index(' ,'//tab, document%text(s%at:s%at)) > 0) then
            s%at = s%at + 1
            cycle
         end if
         if (scan(document%text(s%at:s%at), '/!&'//lf//cr) == 1 .or. length_of_end(document, s) > 0) exit
         next = after_equals(document, s)
         if (next%at > 0) exit
         s%at = s%at + max(1, span(document%text(s%at:), ends_token))
         last = s%at - 1
      end do
      call fault_in_group(document, s%line, document%text(first:last), rule)
   end subroutine skip_words

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
         call fault_in_group(document, s%line, text, 'not a valid key name')
      else if (index(text, '(') > 0) then
         call parse_index(text(index(text, '(') + 1:index(text, ')') - 1), entry)
         if (entry%faulty) call fault_in_group(document, s%line, text, &
            'an index is one integer or a range such as (1:3)')
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
         if (length_of_end(document, s) > 0) exit
         select case (document%text(s%at:s%at))
         case ('/', '&')
            exit
         case (',')
            if (value_due) call report_fault(document, s%line, 'a value is missing before the comma')
            value_due = .true.
            s%at = s%at + 1
         case ('=')
            call report_fault(document, s%line, 'unexpected second =')
            s%at = s%at + 1
         case ('#', '%') ! a comment, as other languages have it
            call skip_words(document, s, s%at, 'a comment begins with !')
         case default
            next = after_equals(document, s)
            if (next%at > 0) exit
            call parse_value(document, s)
            value_due = .false.
         end select
      end do
      associate (entry => document%entries(document%n_entries))
         if (entry%last < entry%first) call report_fault(document, entry%line, 'has no value')
      end associate
   end subroutine parse_values

   !> Note a fault of the last entry, the first only, and mark the entry.
   subroutine report_fault(document, line, rule, value)
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
   end subroutine report_fault

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
         if (slash_within(document, s)) then
            call report_slash(document, s, value)
            call add_value(document, value)
            return
         end if
      else if (scan(next_character(document, s), '"''') == 1) then
         call parse_string(document, s, value)
      else
         call report_fault(document, s%line, 'a value is missing after the repeat count')
         return
      end if
      call add_value(document, value)
      if (index(blanks//',/!=', next_character(document, s)) == 0) call report_fault(document, s%line, &
         'a comma or a blank is missing between two values', shown_value(document, value))
   end subroutine parse_value

   !> Does a word go on behind a '/', as in 3/2 or a/b.csv? The / that ends a group has a blank, a comment or a group behind it.
   pure logical function slash_within(document, s)
      type(namelist_document), intent(in) :: document
      type(scanner), intent(in) :: s
      slash_within = .false.
      if (next_character(document, s) /= '/' .or. s%at >= len(document%text)) return
      slash_within = index(blanks//'/!&$', document%text(s%at + 1:s%at + 1)) == 0
   end function slash_within

   subroutine report_slash(document, s, value)
      type(namelist_document), intent(inout) :: document
      type(scanner), intent(inout) :: s
      type(namelist_value), intent(inout) :: value
      type(namelist_value) :: divisor
      integer, parameter :: numbers(3) = [is_integer, is_long_integer, is_real]
      integer :: last

      last = s%at + span(document%text(s%at + 1:), ends_token)
      call classify(document%text(s%at + 1:last), divisor)
      s%at = last + 1
      value%last = last
      if (any(value%kind == numbers) .and. any(divisor%kind == numbers) .and. abs(divisor%x) > 0.0_wp) then
         call report_fault(document, value%line, 'fractions are not computed: write '// &
                       tidy(formatted(value%x/divisor%x, '(g0.15)')), document%text(value%first:last))
      else if (any(divisor%kind == numbers)) then
         call report_fault(document, value%line, 'a / ends the group; fractions are not computed', document%text(value%first:last))
      else
         call report_fault(document, value%line, 'a / ends the group; a string with one must be in quotes', &
                       document%text(value%first:last))
      end if
   end subroutine report_slash

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
         call report_fault(document, s%line, 'a repeat count must lie in 1..'//to_text(most_copies), &
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
         call resume_in_line(document, s, value)
         call report_fault(document, value%line, 'the string does not end on its line: a quote is missing', &
            document%text(value%first - 1:value%last))
      else if (control) then
         call report_fault(document, value%line, 'control character in a string', shown_value(document, value))
      end if
   end subroutine parse_string

   !> A text without its closing quote: go on where the line seems to, at the next key behind a comma or at a / at its end.
   subroutine resume_in_line(document, s, value)
      type(namelist_document), intent(in) :: document
      type(scanner), intent(inout) :: s
      type(namelist_value), intent(inout) :: value
      type(scanner) :: key, next
      integer :: at

      key = s
      do at = value%first, value%last
         if (document%text(at:at) == ',') then
            key%at = at + 1
            key%line = value%line
            call skip_white(document, key)
            next = after_equals(document, key)
            if (next%at == 0 .or. key%line > value%line) cycle
            s%at = key%at
            value%last = at - 1
            return
         end if
      end do
      at = verify(document%text(:value%last), blanks, back=.true.)
      if (at < value%first) return
      if (document%text(at:at) /= '/') return
      s%at = at
      value%last = at - 1
   end subroutine resume_in_line

end module rodyn_namelist_parser
