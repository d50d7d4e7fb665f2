!> What is no proper namelist is refused, with the line and the reason.
module test_namelist_faults
   use rodyn_case_config, only: case_config
   use rodyn_errors, only: error_type
   use test_case_support, only: chain, expect_accepted, expect_faults, nl, spacecraft, valid
   use test_testing, only: new_test, unittest
   implicit none (type, external)
   private
   public :: collect_namelist_faults

contains

   subroutine collect_namelist_faults(suite)
      type(unittest), allocatable, intent(out) :: suite(:)
      suite = [ &
         new_test('NaN is refused', nan_value), &
         new_test('infinity is refused in all spellings', infinite_value), &
         new_test('numbers beyond the largest are refused', overflow_value), &
         new_test('numbers that would become zero are refused', underflow_value), &
         new_test('whole numbers beyond the largest are refused', long_integer), &
         new_test('a missing slash at the end of the file is found', open_at_end), &
         new_test('a missing slash before the next group is found', open_before_next), &
         new_test('text outside of groups is found', stray_text), &
         new_test('a text without its closing quote is found', open_string), &
         new_test('an empty value between commas is found', null_value), &
         new_test('a key without a value is found', no_value), &
         new_test('a value without a key is found', no_key), &
         new_test('a text without a key is found', text_without_key), &
         new_test('a second equals sign is found', second_equals), &
         new_test('a key must be a name', bad_key), &
         new_test('an index must be an integer or a range', bad_index), &
         new_test('repeat counts are bounded', repeat_count), &
         new_test('a repeat count needs a value', repeat_nothing), &
         new_test('values need a separator between them', glued_values), &
         new_test('control characters in a text are refused', control_character), &
         new_test('a group needs a name', nameless_group), &
         new_test('bytes that are not UTF-8 are refused', not_utf8), &
         new_test('other marks of the end of a group are told', other_ends), &
         new_test('fractions and paths without quotes are told from the end of a group', slash_in_word), &
         new_test('a text without its closing quote hides nothing behind it', open_string_in_line), &
         new_test('characters that look like plain ones are named', look_alikes), &
         new_test('look-alikes in comments and texts do no harm', harmless_look_alikes), &
         new_test('files that are no text have one fault', no_text), &
         new_test('comments of other languages are told', foreign_comments), &
         new_test('words without a key are one fault', words_without_key), &
         new_test('what is no number is told what it may be', no_numbers), &
         new_test('a misspelt key hides no other fault and misses nothing', misspelt), &
         new_test('a misspelt group hides no other fault and misses nothing', misspelt_group), &
         new_test('a key of another group is not missed there', misplaced)]
   end subroutine collect_namelist_faults

   subroutine nan_value(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&solver'//nl//'rtol = NaN /'//nl, &
         'c.nml:4: &solver rtol = NaN: must be finite')
   end subroutine nan_value

   subroutine infinite_value(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&initial omega = -Inf, rotation = +infinity, velocity_x = nan(1) /', &
         'c.nml:3: &initial omega = -Inf: must be finite'//nl//&
         'c.nml:3: &initial rotation = +infinity: must be finite'//nl//&
         'c.nml:3: &initial velocity_x = nan(1): must be finite')
   end subroutine infinite_value

   subroutine overflow_value(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&initial omega = 1e999, rotation = -1.8d308 /', &
         'c.nml:3: &initial omega = 1e999: overflows double precision'//nl//&
         'c.nml:3: &initial rotation = -1.8d308: overflows double precision')
   end subroutine overflow_value

   subroutine underflow_value(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&initial omega = 1e-400 /', &
         'c.nml:3: &initial omega = 1e-400: underflows double precision; write 0')
   end subroutine underflow_value

   subroutine long_integer(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&case n_outputs = 99999999999 /', &
         'c.nml:3: &case n_outputs = 99999999999: overflows a 32-bit integer')
   end subroutine long_integer

   subroutine open_at_end(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&case t_end = 2'//nl//nl, &
         'c.nml:3: &case: missing / at the end of the group (the file ends)')
   end subroutine open_at_end

   subroutine open_before_next(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&case t_end = 2'//nl//'&solver rtol = 1e-6 /'//nl, &
         'c.nml:3: &case: missing / at the end of the group (the next group begins in '//'line 4)')
   end subroutine open_before_next

   subroutine stray_text(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'hello world ! comment'//nl//'/'//nl, &
         'c.nml:3: hello world: text outside of a group'//nl//'c.nml:4: /: text outside of a group')
   end subroutine stray_text

   subroutine open_string(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&case title = ''abc'//nl//' t_end = 0 /'//nl, &
         'c.nml:3: &case title = ''abc: the string does not end on its line: a quote is '//'missing'//&
         nl//'c.nml:4: &case t_end = 0: must be positive [s]')
   end subroutine open_string

   subroutine null_value(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&initial phi = 1,,2,3 /', &
         'c.nml:3: &initial phi: a value is missing before the comma')
   end subroutine null_value

   subroutine no_value(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&initial phi = '//nl//' omega = 1 /', &
         'c.nml:3: &initial phi: has no value')
   end subroutine no_value

   subroutine no_key(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&initial 3.0, phi = 1 /', &
         'c.nml:3: &initial 3.0: expected a key and =')
   end subroutine no_key

   subroutine text_without_key(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&output ''a b'' /', &
         'c.nml:3: &output ''a b'': text without a key before it')
   end subroutine text_without_key

   subroutine second_equals(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&initial omega = = 3 /', &
         'c.nml:3: &initial omega: unexpected second =')
   end subroutine second_equals

   subroutine bad_key(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&initial 2omega = 3 /', &
         'c.nml:3: &initial 2omega: not a valid key name')
   end subroutine bad_key

   subroutine bad_index(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&initial phi(1,2) = 3, phi(3:1) = 2, phi(x) = 1 /', &
         'c.nml:3: &initial phi(1,2): an index is one integer or a range such as '//'(1:3)'//nl//&
         'c.nml:3: &initial phi(3:1): an index is one integer or a range such as '//'(1:3)'//nl//&
         'c.nml:3: &initial phi(x): an index is one integer or a range such as (1:3)')
   end subroutine bad_index

   subroutine repeat_count(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&initial phi = 999999999*1, omega = 0*1 /', &
         'c.nml:3: &initial phi = 999999999*1: a repeat count must lie in 1..1000000'//nl//&
         'c.nml:3: &initial omega = 0*1: a repeat count must lie in 1..1000000')
   end subroutine repeat_count

   subroutine repeat_nothing(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&initial phi = 4* /', &
         'c.nml:3: &initial phi: a value is missing after the repeat count')
   end subroutine repeat_nothing

   subroutine glued_values(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&output file = ''a''''b''c /', &
         'c.nml:3: &output file = ''a''''b'': a comma or a blank is missing between two values')
   end subroutine glued_values

   subroutine control_character(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&case title = ''a'//char(7)//'b'' /', &
         'c.nml:3: &case title = ''a?b'': control character in a string')
   end subroutine control_character

   subroutine nameless_group(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'& /', &
         'c.nml:3: &: a group name must follow')
   end subroutine nameless_group

   subroutine not_utf8(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'! caf'//char(233)//' '//nl, &
         'c.nml:3: byte 233 is not part of UTF-8 text (further ones are not shown)')
   end subroutine not_utf8

   subroutine other_ends(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&case t_end = 1 &end'//nl//'$solver rtol = 0 $end'//nl//'$output ledger = T'//nl//'$', &
         'c.nml:3: &case &end: a group ends with /'//nl// &
         'c.nml:4: $solver: a group begins with &'//nl// &
         'c.nml:4: &solver $end: a group ends with /'//nl// &
         'c.nml:4: &solver rtol = 0: must be greater than 0 and less than 1'//nl// &
         'c.nml:5: $output: a group begins with &'//nl// &
         'c.nml:6: &output $: a group ends with /')
   end subroutine other_ends

   subroutine slash_in_word(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      call expect_faults(error, &
         valid//'&case t_end = 3/2, n_outputs = 0 /'//nl//'&output file = a/b.h5 /'//nl//'&initial omega = pi/2 /'//nl// &
         '&solver rtol = 0.1 / 2, atol = 1 /'//nl, &
         'c.nml:3: &case t_end = 3/2: fractions are not computed: write 1.5'//nl// &
         'c.nml:3: &case n_outputs = 0: must lie in 1..100000000'//nl// &
         'c.nml:4: &output file = a/b.h5: a / ends the group; a string with one must be in quotes'//nl// &
         'c.nml:5: &initial omega = pi/2: a / ends the group; fractions are not computed'//nl// &
         'c.nml:6: 2, atol = 1 /: text outside of a group; the / before it ends &solver')
      if (allocated(error)) return
      call expect_accepted(error, valid//'&case t_end = 3/&solver rtol = 1e-6/! ends'//nl//'&initial omega = 1/', config)
   end subroutine slash_in_word

   subroutine open_string_in_line(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&case title = ''abc, t_end = 0 /'//nl//'&output file = "x /'//nl, &
         'c.nml:3: &case title = ''abc: the string does not end on its line: a quote is missing'//nl// &
         'c.nml:3: &case t_end = 0: must be positive [s]'//nl// &
         'c.nml:4: &output file = "x: the string does not end on its line: a quote is missing')
   end subroutine open_string_in_line

   subroutine look_alikes(error)
      type(error_type), allocatable, intent(out) :: error
      character(len=*), parameter :: no_break = char(194)//char(160), left = char(226)//char(128)//char(152), &
                                     right = char(226)//char(128)//char(153), minus = char(226)//char(136)//char(146), &
                                     zero_width = char(226)//char(128)//char(139)
      call expect_faults(error, &
         valid//'&case'//no_break//'t_end'//no_break//'= 0, title = '//left//'a'//right//' /'//nl// &
         '&initial omega = '//minus//'2, ro'//zero_width//'tation = 1 /'//nl, &
         'c.nml:3: character U+00A0 is not an ASCII blank: write a blank'//nl// &
         'c.nml:3: character U+2018 is not an ASCII quote: write '' or "'//nl// &
         'c.nml:3: &case t_end = 0: must be positive [s]'//nl// &
         'c.nml:4: character U+2212 is not an ASCII minus sign: write -'//nl// &
         'c.nml:4: character U+200B is invisible: delete it')
   end subroutine look_alikes

   subroutine harmless_look_alikes(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      character(len=*), parameter :: odd = char(194)//char(160)//char(226)//char(128)//char(153)//char(226)//char(136)//char(146)
      call expect_accepted(error, char(239)//char(187)//char(191)//'! '//odd//nl//valid//'&case title = ''a'//odd//''' / ! '//odd, &
                           config)
   end subroutine harmless_look_alikes

   subroutine no_text(error)
      type(error_type), allocatable, intent(out) :: error
      character(len=*), parameter :: wide = '&'//char(0)//'c'//char(0)//'a'//char(0)//' '//char(0)
      character(len=*), parameter :: nuls = repeat(char(0), 3), very_wide = '&'//nuls//'c'//nuls//'a'//nuls//' '//nuls
      call expect_faults(error, char(255)//char(254)//wide, 'c.nml:1: the file is UTF-16 text; save it as UTF-8')
      if (.not. allocated(error)) call expect_faults(error, wide, 'c.nml:1: the file is UTF-16 text; save it as UTF-8')
      if (.not. allocated(error)) call expect_faults(error, very_wide, 'c.nml:1: the file is UTF-32 text; save it as UTF-8')
      if (.not. allocated(error)) call expect_faults(error, char(255)//char(254)//repeat(char(0), 2)//very_wide, &
         'c.nml:1: the file is UTF-32 text; save it as UTF-8')
      if (.not. allocated(error)) call expect_faults(error, valid//char(0), &
         'c.nml:1: not a text file: it has bytes that are 0')
      if (.not. allocated(error)) call expect_faults(error, '&case t_end = 1 /'//char(13)//'! x'//char(13), &
         'c.nml:1: the lines end in CR alone; save the file with LF or CR LF')
   end subroutine no_text

   subroutine foreign_comments(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'# a case'//nl//'&case t_end = 1 # seconds'//nl//'// outputs'//nl//' n_outputs = 0 /'//nl, &
         'c.nml:3: # a case: text outside of a group; a comment begins with !'//nl// &
         'c.nml:4: &case # seconds: a comment begins with !'//nl// &
         'c.nml:5: &case // outputs: a comment begins with !'//nl// &
         'c.nml:6: &case n_outputs = 0: must lie in 1..100000000')
   end subroutine foreign_comments

   subroutine words_without_key(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, valid//'&case t_end 5 s, n_outputs = 0 /', &
         'c.nml:3: &case t_end 5 s: expected a key and ='//nl//'c.nml:3: &case n_outputs = 0: must lie in 1..100000000')
   end subroutine words_without_key

   subroutine no_numbers(error)
      type(error_type), allocatable, intent(out) :: error
      character(len=*), parameter :: brackets = '; values stand without brackets, and expressions are not computed'
      call expect_faults(error, &
         valid//'&case t_end = ''1'' /'//nl//'&initial phi = [1, 0, 0, 0], omega = 2*3.0,'//nl// &
         'rotation = 2*pi, alpha = 1; 2'//nl// &
         'beta(1) = 1.5, 2, 3 / '//nl//'&output file = my result /'//nl, &
         'c.nml:3: &case t_end = ''1'': must be a number [s]; without quotes'//nl// &
         'c.nml:4: &initial phi(1) = [1: must be a number [rad]'//brackets//nl// &
         'c.nml:4: &initial phi(4) = 0]: must be a number [rad]'//brackets//nl// &
         'c.nml:4: &initial omega = 2*3.0: takes one value, not 2; 2*3.0 means 2 values of 3.0'//nl// &
         'c.nml:5: &initial rotation = pi: must be a number [rad]; expressions are not computed'//nl// &
         'c.nml:5: &initial alpha(1) = 1;: must be a number [rad]; values are separated by commas or blanks'//nl// &
         'c.nml:6: &initial beta(1) = 1.5, 2, 3: takes one value, not 3; write beta(1:3) for all'//nl// &
         'c.nml:7: &output file = my, result: must be a quoted string')
   end subroutine no_numbers

   subroutine misspelt(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         spacecraft//'&chain n_rod = 4, lenght = 1, 2, -3, mass_per_length = 1, 2, bending_stiffness = 1e4, '// &
         'hinge_stiffness = 1 /', &
         'c.nml:2: &chain n_rod: unknown key; the nearest known one is n_rods'//nl// &
         'c.nml:2: &chain lenght: unknown key; the nearest known one is length'//nl// &
         'c.nml:2: &chain lenght = 1, 2, -3: takes 1 or 4 values, one per rod, not 3'//nl// &
         'c.nml:2: &chain lenght(3) = -3: must be positive [m]'//nl// &
         'c.nml:2: &chain mass_per_length = 1, 2: takes 1 or 4 values, one per rod, not 2')
   end subroutine misspelt

   subroutine misspelt_group(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, '&spacecarft mass = -1, inertia = 1 /'//nl//chain, &
         'c.nml:1: &spacecarft: unknown group; the nearest known one is &spacecraft'//nl// &
         'c.nml:1: &spacecarft mass = -1: must be positive [kg]')
   end subroutine misspelt_group

   subroutine misplaced(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, '&spacecraft mass = 1, n_rods = 4 /'//nl// &
         '&chain inertia = 1, length = 1, mass_per_length = 1, bending_stiffness = 1, hinge_stiffness = 1 /', &
         'c.nml:1: &spacecraft n_rods: unknown key; it belongs to &chain'//nl// &
         'c.nml:2: &chain inertia: unknown key; it belongs to &spacecraft')
   end subroutine misplaced

end module test_namelist_faults
