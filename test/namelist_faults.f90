!> What is no proper namelist is refused, with the line and the reason.
module test_namelist_faults
   use rodyn_errors, only: error_type
   use test_case_support, only: expect_faults, nl, valid
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
         new_test('an index must be a whole number or a range', bad_index), &
         new_test('repeat counts are bounded', repeat_count), &
         new_test('a repeat count needs a value', repeat_nothing), &
         new_test('values need a separator between them', glued_values), &
         new_test('control characters in a text are refused', control_character), &
         new_test('a group needs a name', nameless_group), &
         new_test('bytes that are not UTF-8 are refused', not_utf8)]
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
         'c.nml:3: &initial omega = 1e999: is beyond the largest number'//nl//&
         'c.nml:3: &initial rotation = -1.8d308: is beyond the largest number')
   end subroutine overflow_value

   subroutine underflow_value(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&initial omega = 1e-400 /', &
         'c.nml:3: &initial omega = 1e-400: is smaller than the smallest number; write 0')
   end subroutine underflow_value

   subroutine long_integer(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&case n_outputs = 99999999999 /', &
         'c.nml:3: &case n_outputs = 99999999999: is beyond the largest whole number')
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
         'c.nml:3: &case title = ''abc: the text does not end on its line: a quote is '//'missing'//&
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
         'c.nml:3: &initial 2omega: not the name of a key')
   end subroutine bad_key

   subroutine bad_index(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&initial phi(1,2) = 3, phi(3:1) = 2, phi(x) = 1 /', &
         'c.nml:3: &initial phi(1,2): an index is one whole number or a range such as '//'(1:3)'//nl//&
         'c.nml:3: &initial phi(3:1): an index is one whole number or a range such as '//'(1:3)'//nl//&
         'c.nml:3: &initial phi(x): an index is one whole number or a range such as (1:3)')
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
         'c.nml:3: &case title = ''a?b'': control character in a text')
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


end module test_namelist_faults
