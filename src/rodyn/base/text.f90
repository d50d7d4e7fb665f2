!> Small services on text: case, numbers as text, quotes, nearest names.
module rodyn_text
   use rodyn_kinds, only: i8, wp
   use rodyn_utf8, only: first_bad_byte
   implicit none (type, external)
   private
   public :: lower, is_name, is_digit
   public :: to_text, formatted, tidy, plain_text, short_text, time_text, quoted, printable, as_utf8, ends_with
   public :: edit_distance, word_count, has_word, word, joined, with_line_ends, text_or_empty

   !> A number as the shortest text (integer), or with 17 significant digits (real), or as T or F.
   interface to_text
      module procedure integer_text
      module procedure long_text
      module procedure real_text
      module procedure logical_text
   end interface to_text

contains

   !> ASCII letters in lower case; everything else as it is.
   pure function lower(text) result(small)
      character(len=*), intent(in) :: text
      character(len=len(text)) :: small
      integer :: i, code

      do i = 1, len(text)
         code = iachar(text(i:i))
         if (code >= iachar('A') .and. code <= iachar('Z')) code = code + 32
         small(i:i) = achar(code)
      end do
   end function lower

   pure logical function is_digit(c)
      character(len=1), intent(in) :: c
      is_digit = c >= '0' .and. c <= '9'
   end function is_digit

   !> Is the text a Fortran name in lower case?
   pure logical function is_name(text)
      character(len=*), intent(in) :: text
      is_name = .false.
      if (len(text) == 0) return
      if (text(1:1) < 'a' .or. text(1:1) > 'z') return
      is_name = verify(text, 'abcdefghijklmnopqrstuvwxyz0123456789_') == 0
   end function is_name

   pure function integer_text(i) result(text)
      integer, intent(in) :: i
      character(len=:), allocatable :: text
      text = long_text(int(i, i8))
   end function integer_text

   pure function long_text(i) result(text)
      integer(i8), intent(in) :: i
      character(len=:), allocatable :: text
      character(len=24) :: digits
      write (digits, '(i0)') i
      text = trim(digits)
   end function long_text

   !> 17 significant digits: reading them back gives the same number.
   pure function real_text(x) result(text)
      real(wp), intent(in) :: x
      character(len=:), allocatable :: text
      text = formatted(x, '(es25.16e3)')
   end function real_text

   pure function logical_text(x) result(text)
      logical, intent(in) :: x
      character(len=:), allocatable :: text
      text = '.false.'
      if (x) text = '.true.'
   end function logical_text

   !> A namelist string: in quotes, inner quotes doubled.
   pure function quoted(text) result(string)
      character(len=*), intent(in) :: text
      character(len=:), allocatable :: string
      character(len=:), allocatable :: buffer
      integer :: i, n

      allocate (character(len=2*len(text) + 2) :: buffer)
      buffer(1:1) = "'"
      n = 1
      do i = 1, len(text)
         n = n + 1
         buffer(n:n) = text(i:i)
         if (text(i:i) /= "'") cycle
         n = n + 1
         buffer(n:n) = "'"
      end do
      string = buffer(:n)//"'"
   end function quoted

   !> Text that is safe on a terminal: control characters and bytes that are no UTF-8 become '?', and no more than `limit` bytes.
   pure function printable(text, limit) result(clean)
      character(len=*), intent(in) :: text
      integer, intent(in) :: limit !! longest result, not counting the dots that mark a cut
      character(len=:), allocatable :: clean
      integer :: i

      clean = text(:min(len(text), limit))
      do i = 1, len(clean)
         if (iachar(clean(i:i)) < 32 .or. iachar(clean(i:i)) == 127) clean(i:i) = '?'
      end do
      if (len(text) > limit) then
         do i = limit, max(1, limit - 3), -1 ! never cut a UTF-8 sequence in two
            if (iand(iachar(text(i + 1:i + 1)), 192) /= 128) exit
            clean = clean(:i - 1)
         end do
      end if
      clean = as_utf8(clean)
      if (len(text) > limit) clean = clean//'...'
   end function printable

   !> A message of several lines may name files as their bytes are; what of it is no UTF-8 becomes '?'.
   pure function as_utf8(text) result(clean)
      character(len=*), intent(in) :: text
      character(len=:), allocatable :: clean
      integer :: start, bad

      clean = text
      start = 1
      do
         bad = first_bad_byte(clean(start:))
         if (bad == 0) exit
         start = start + bad
         clean(start - 1:start - 1) = '?'
      end do
   end function as_utf8

   !> Levenshtein distance: insertions, deletions and substitutions of one character.
   pure integer function edit_distance(a, b) result(distance)
      character(len=*), intent(in) :: a, b
      integer :: row(0:len(b))
      integer :: i, j, diagonal, above

      row = [(j, j=0, len(b))]
      do i = 1, len(a)
         diagonal = row(0)
         row(0) = i
         do j = 1, len(b)
            above = row(j)
            row(j) = min(above + 1, row(j - 1) + 1, diagonal + merge(0, 1, a(i:i) == b(j:j)))
            diagonal = above
         end do
      end do
      distance = row(len(b))
   end function edit_distance

   !> How many words a list such as 'free|fixed' has.
   pure integer function word_count(list)
      character(len=*), intent(in) :: list
      integer :: i
      word_count = 0
      if (len_trim(list) > 0) word_count = 1 + count([(list(i:i) == '|', i=1, len(list))])
   end function word_count

   !> Is a word in a list such as 'free|fixed'?
   pure logical function has_word(list, text)
      character(len=*), intent(in) :: list, text
      integer :: first, i, last

      last = len_trim(list)
      first = 1
      do i = 1, last + 1
         if (i <= last) then
            if (list(i:i) /= '|') cycle
         end if
         has_word = i - first == len_trim(text)
         if (has_word) has_word = list(first:i - 1) == text(:i - first)
         if (has_word) return
         first = i + 1
      end do
   end function has_word

   !> Word `k` of a list such as 'free|fixed'.
   pure function word(list, k, between) result(text)
      character(len=*), intent(in) :: list
      integer, intent(in) :: k
      character(len=1), intent(in), optional :: between !! what stands between words; absent: '|'
      character(len=:), allocatable :: text
      character(len=1) :: mark
      integer :: i, first, last

      mark = '|'
      if (present(between)) mark = between
      first = 1
      do i = 2, k
         first = first + index(list(first:), mark)
      end do
      last = index(list(first:), mark) + first - 2
      if (last < first) last = len_trim(list)
      text = list(first:last)
   end function word

   !> Two texts, each of which may be empty, and what stands between them if neither is.
   pure function joined(first, second, between) result(text)
      character(len=*), intent(in) :: first, second, between
      character(len=:), allocatable :: text
      text = first//second
      if (len(first) > 0 .and. len(second) > 0) text = first//between//second
   end function joined

   !> A text of several lines with something else in the place of their ends.
   pure function with_line_ends(text, mark) result(lines)
      character(len=*), intent(in) :: text, mark
      character(len=:), allocatable :: lines
      integer :: i

      lines = ''
      do i = 1, len(text)
         if (text(i:i) == new_line('a')) then
            lines = lines//mark
         else
            lines = lines//text(i:i)
         end if
      end do
   end function with_line_ends

   !> A text that may not be there.
   pure function text_or_empty(text) result(value)
      character(len=:), allocatable, intent(in) :: text
      character(len=:), allocatable :: value
      value = ''
      if (allocated(text)) value = text
   end function text_or_empty

   !> Does a text, but for trailing blanks, end like this, with something in front?
   pure logical function ends_with(text, ending)
      character(len=*), intent(in) :: text, ending
      integer :: n
      n = len_trim(text)
      ends_with = n > len(ending)
      if (ends_with) ends_with = text(n - len(ending) + 1:n) == ending
   end function ends_with

   !> A number for a message, six significant digits.
   pure function short_text(x) result(text)
      real(wp), intent(in) :: x
      character(len=:), allocatable :: text
      text = formatted(x, '(g0.6)')
   end function short_text

   !> A number as a format has it, without blanks.
   pure function formatted(x, format) result(text)
      real(wp), intent(in) :: x
      character(len=*), intent(in) :: format !! such as '(f8.1)'; at most 32 characters wide
      character(len=:), allocatable :: text
      character(len=32) :: digits
      integer :: sign

      write (digits, format) x
      if (index(digits, '*') > 0) write (digits, '(es16.6)') x ! too wide for the format
      text = trim(adjustl(digits))
      if (text(1:1) == '.') text = '0'//text ! which some compilers leave out
      if (index(text, '-.') == 1) text = '-0'//text(2:)
      sign = scan(text(2:), '+-')            ! and the E of exponents of three digits
      if (sign == 0) return
      if (is_digit(text(sign:sign))) text = text(:sign)//'E'//text(sign + 1:)
   end function formatted

   !> A number without idle zeros: 1.500E-05 as 1.5E-05.
   pure function tidy(number) result(text)
      character(len=*), intent(in) :: number !! as `formatted` gives it
      character(len=:), allocatable :: text
      integer :: exponent, last

      exponent = scan(number, 'E')
      if (exponent == 0) exponent = len(number) + 1
      last = exponent - 1
      if (index(number(:last), '.') > 0) last = verify(number(:last), '0', back=.true.)
      if (number(last:last) == '.') last = last - 1
      text = number(:last)//number(exponent:)
   end function tidy

   !> A number by as few digits as give it back.
   pure function plain_text(x) result(text)
      real(wp), intent(in) :: x
      character(len=:), allocatable :: text, digits
      character(len=32) :: buffer
      character(len=12) :: format
      real(wp) :: back
      integer :: exponent, n, mark

      text = 'NaN'
      if (x > huge(x)) text = 'Infinity'
      if (x < -huge(x)) text = '-Infinity'
      if (.not. abs(x) <= huge(x)) return
      do n = 0, 16
         write (format, '(a, i0, a)') '(es28.', n, 'e4)'
         write (buffer, format) abs(x)
         read (buffer, *) back
         if (.not. abs(back - abs(x)) > 0.0_wp) exit
      end do
      buffer = adjustl(buffer)
      mark = scan(buffer, 'E')
      read (buffer(mark + 1:), *) exponent
      digits = buffer(1:1)//buffer(3:mark - 1)
      if (exponent < -3 .or. exponent > 6) then
         text = buffer(1:1)
         if (n > 0) text = buffer(:mark - 1)
         text = text//'e'//to_text(exponent)
      else if (exponent < 0) then
         text = '0.'//repeat('0', -exponent - 1)//digits
      else if (n <= exponent) then
         text = digits//repeat('0', exponent - n)
      else
         text = digits(:exponent + 1)//'.'//digits(exponent + 2:)
      end if
      if (x < 0.0_wp) text = '-'//text
   end function plain_text

   !> A time for a message: ten digits, no idle zeros.
   pure function time_text(t) result(text)
      real(wp), intent(in) :: t !! [s]
      character(len=:), allocatable :: text

      if (abs(t) >= 1.0e-3_wp .and. abs(t) < 1.0e6_wp) then
         text = tidy(formatted(t, '(f0.10)'))
      else if (abs(t) > 0.0_wp) then
         text = tidy(formatted(t, '(es16.9)'))
      else
         text = '0'
      end if
   end function time_text

end module rodyn_text
