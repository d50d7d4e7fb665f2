!> Namelist syntax that is accepted, and what it means.
module test_namelist
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type
   use rodyn_namelist_document, only: namelist_document, namelist_value, string_content, is_integer, &
      is_long_integer, is_logical, is_not_finite, is_real, is_string, is_too_large, is_too_small, is_word
   use rodyn_namelist_parser, only: parse_document
   use rodyn_namelist_value_text, only: classify
   use rodyn_text, only: edit_distance, quoted, to_text
   use rodyn_utf8, only: first_bad_byte
   use test_testing, only: check, check_close, new_test, unittest
   implicit none (type, external)
   private
   public :: collect_namelist

   character(len=1), parameter :: nl = new_line('a'), cr = achar(13)

contains

   subroutine collect_namelist(suite)
      type(unittest), allocatable, intent(out) :: suite(:)
      suite = [ &
         new_test('a group may stand on one line or on many', layouts), &
         new_test('line ends of all systems and tabs are blanks', line_ends), &
         new_test('comments and texts may hold UTF-8', utf8), &
         new_test('quotes are doubled inside a text', quotes), &
         new_test('an index is one element or a range', indices), &
         new_test('a slash or a comment sign in a text is text', slash_in_text), &
         new_test('bare words are told apart by what they look like', kinds), &
         new_test('numbers are read to the last bit', numbers), &
         new_test('the largest number is accepted and the next refused', largest), &
         new_test('a hundred thousand values are read', many_values), &
         new_test('a text of twenty million bytes is survived', huge_text), &
         new_test('the edit distance counts single changes', distances)]
   end subroutine collect_namelist

   subroutine parse(text, document, error)
      character(len=*), intent(in) :: text
      type(namelist_document), intent(out) :: document
      type(error_type), allocatable, intent(out) :: error
      call parse_document(text, 'c.nml', document)
      call document%faults%to_error('c.nml', error)
   end subroutine parse

   subroutine layouts(error)
      type(error_type), allocatable, intent(out) :: error
      type(namelist_document) :: document
      call parse('&A x=1,y= 2 3*4 , z=.true./ &B x = 5'//nl//'! x'//nl//'6,'//nl//'Y'//nl//'= T'//nl//'/', &
         document, error)
      if (allocated(error)) return
      call check(error, document%n_groups, 2, 'groups')
      if (allocated(error)) return
      call check(error, document%n_entries, 5, 'entries')
      if (allocated(error)) return
      call check(error, trim(document%groups(1)%name)//trim(document%entries(5)%key), 'ay', 'lower case')
      if (allocated(error)) return
      call check(error, document%values(3)%copies, 3, 'repeat count')
      if (allocated(error)) return
      call check(error, document%values(6)%line, 3, 'line of a value')
      if (allocated(error)) return
      call check(error, document%entries(5)%line, 4, 'line of a key')
   end subroutine layouts

   subroutine line_ends(error)
      type(error_type), allocatable, intent(out) :: error
      type(namelist_document) :: document
      call parse('&a'//cr//nl//achar(9)//'x = 1'//cr//nl//'t = ''b'''//cr//nl//'/'//cr//nl, document, error)
      if (allocated(error)) return
      call check(error, document%n_entries == 2 .and. document%entries(2)%line == 3 .and. document%n_lines == 4, &
         'entries or lines')
   end subroutine line_ends

   subroutine utf8(error)
      type(error_type), allocatable, intent(out) :: error
      type(namelist_document) :: document
      character(len=*), parameter :: e_acute = char(195)//char(169)
      call parse('&a t = "'//e_acute//'" ! '//e_acute//nl//'/', document, error)
      if (allocated(error)) return
      call check(error, string_content(document, document%values(1)), e_acute, 'content')
      if (allocated(error)) return
      call check(error, first_bad_byte('a'//char(224)//char(128)//char(128)), 2, 'overlong sequence')
      if (allocated(error)) return
      call check(error, first_bad_byte(e_acute//achar(0)), 3, 'NUL')
   end subroutine utf8

   subroutine quotes(error)
      type(error_type), allocatable, intent(out) :: error
      type(namelist_document) :: document
      character(len=*), parameter :: text = "it's ""so"" ''"
      call parse('&a t = '//quoted(text)//', "a""b'''//'", '''' /', document, error)
      if (allocated(error)) return
      call check(error, string_content(document, document%values(1)), text, 'single quotes')
      if (allocated(error)) return
      call check(error, string_content(document, document%values(2)), 'a"b''', 'double quotes')
      if (allocated(error)) return
      call check(error, string_content(document, document%values(3)), '', 'empty text')
   end subroutine quotes

   subroutine indices(error)
      type(error_type), allocatable, intent(out) :: error
      type(namelist_document) :: document
      call parse('&a x(3)=1 x (0 : 2 ) = 2 y(-1)=3 z=4/', document, error)
      if (allocated(error)) return
      call check(error, all(document%entries(:4)%lower == [3, 0, -1, 0]) .and. &
         all(document%entries(:4)%upper == [3, 2, -1, 0]) .and. &
         all(document%entries(:4)%indexed .eqv. [.true., .true., .true., .false.]), 'indices')
   end subroutine indices

   subroutine slash_in_text(error)
      type(error_type), allocatable, intent(out) :: error
      type(namelist_document) :: document
      call parse("&a t = 'a/b!c&d=e,f' x = 2 / ! / &", document, error)
      if (allocated(error)) return
      call check(error, document%n_values, 2, 'values')
   end subroutine slash_in_text

   subroutine kinds(error)
      type(error_type), allocatable, intent(out) :: error
      call check_kinds('1 +2 -03 2147483647', is_integer)
      call check_kinds('2147483648 -99999999999999999999', is_long_integer)
      call check_kinds('1. .5 +1.5e3 -1D-3 1e+05 0e999 0.0', is_real)
      call check_kinds('1e309 -1.8e308 9e99999999999', is_too_large)
      call check_kinds('1e-400 0.1e-99999999999', is_too_small)
      call check_kinds('nan NaN -inf +Infinity nan(0x1)', is_not_finite)
      call check_kinds('T f .TRUE. .false. true .t.', is_logical)
      call check_kinds('. e5 1e 1e+ + - 1.2.3 1,5e 0x10 1.5+3 in tru (1 1_8', is_word)

   contains

      !> All blank-separated words must be of the kind.
      subroutine check_kinds(words, kind)
         character(len=*), intent(in) :: words
         integer, intent(in) :: kind
         type(namelist_value) :: value
         integer :: first, last

         first = 1
         do while (first <= len(words) .and. .not. allocated(error))
            last = first + index(words(first:)//' ', ' ') - 2
            call classify(words(first:last), value)
            call check(error, value%kind, kind, words(first:last))
            first = last + 2
         end do
      end subroutine check_kinds

   end subroutine kinds

   subroutine numbers(error)
      type(error_type), allocatable, intent(out) :: error
      type(namelist_value) :: value
      real(wp) :: x
      integer :: i

      x = 0.1_wp
      do i = 1, 1000
         x = -x*1.0123456789_wp**mod(i, 137) + 1.0e-3_wp
         if (abs(x) > 1.0e100_wp) x = 1.0e-200_wp*x
         call classify(to_text(x), value)
         call check_close(error, [value%x], [x], 0.0_wp, to_text(x))
         if (allocated(error)) return
      end do
   end subroutine numbers

   subroutine largest(error)
      type(error_type), allocatable, intent(out) :: error
      type(namelist_value) :: value
      call classify(to_text(huge(1.0_wp)), value)
      call check_close(error, [value%x], [huge(1.0_wp)], 0.0_wp, 'largest')
      if (allocated(error)) return
      call classify('1.7976931348623158e308', value)
      call check(error, value%kind, is_too_large, 'beyond the largest')
      if (allocated(error)) return
      call classify('0.0000017976931348623157e314', value)
      call check(error, value%kind, is_real, 'leading zeros')
   end subroutine largest

   subroutine many_values(error)
      type(error_type), allocatable, intent(out) :: error
      type(namelist_document) :: document
      call parse('&a x = '//repeat('1.25, ', 100000)//'y = '//repeat('''a'' ', 1000)//'/', document, error)
      if (allocated(error)) return
      call check(error, document%n_values, 101000, 'values')
      if (allocated(error)) return
      call check(error, document%values(101000)%kind, is_string, 'kind of the last value')
   end subroutine many_values

   subroutine huge_text(error)
      type(error_type), allocatable, intent(out) :: error
      type(namelist_document) :: document
      call parse('&a t = "'//repeat('a""', 7000000)//'" /', document, error)
      if (allocated(error)) return
      call check(error, len(string_content(document, document%values(1))), 14000000, 'length')
   end subroutine huge_text

   subroutine distances(error)
      type(error_type), allocatable, intent(out) :: error
      call check(error, edit_distance('kitten', 'sitting'), 3, 'kitten, sitting')
      if (allocated(error)) return
      call check(error, edit_distance('lenght', 'length'), 2, 'lenght, length')
      if (allocated(error)) return
      call check(error, edit_distance('', 'abc'), 3, 'empty')
   end subroutine distances

end module test_namelist
