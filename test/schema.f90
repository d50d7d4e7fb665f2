!> The machinery with another table than that of a case: a list of texts, a repeated group, required keys in each.
module test_schema
   use rodyn_kinds, only: wp
   use rodyn_checked_document, only: checked_document, instances, match_document
   use rodyn_defaults_text, only: defaults_text
   use rodyn_document_checks, only: check_document
   use rodyn_errors, only: error_type
   use rodyn_field_loader, only: field_loader
   use rodyn_namelist_document, only: namelist_document
   use rodyn_namelist_parser, only: parse_document
   use rodyn_schema, only: schema_extent, schema_group, schema_row, any_list, at_least, rule_text, type_integer, &
      type_real, type_text
   use test_testing, only: check, check_close, new_test, unittest
   implicit none (type, external)
   private
   public :: collect_schema

   character(len=1), parameter :: nl = new_line('a')
   type(schema_group), parameter :: groups(2) = [ &
      schema_group('sweep', help='what is varied'), schema_group('axis', repeatable=.true., help='one key')]
   type(schema_row), parameter :: rows(5) = [ &
      schema_row('sweep', 'base', type_text, example="'a.nml'", help='case file'), &
      schema_row('axis', 'key', type_text, example="'case.t_end'", help='key that is varied'), &
      schema_row('axis', 'values', type_real, any_list, default='depends', when='or text_values', help='numbers'), &
      schema_row('axis', 'text_values', type_text, any_list, default='depends', when='or values', help='texts'), &
      schema_row('axis', 'count', type_integer, default='2', rule=at_least, low=2.0_wp, help='how many')]
   type(schema_extent), parameter :: extents(0) = [schema_extent ::]

contains

   subroutine collect_schema(suite)
      type(unittest), allocatable, intent(out) :: suite(:)
      suite = [ &
         new_test('a second table needs no other machinery', other_table), &
         new_test('what is required is required in each repeated group', required_in_each), &
         new_test('the defaults of a table pass its own checks', defaults_pass), &
         new_test('rules read as sentences', rules_in_words)]
   end subroutine collect_schema

   subroutine checked_text(text, document, checked, error)
      character(len=*), intent(in) :: text
      type(namelist_document), intent(out), target :: document
      type(checked_document), intent(out) :: checked
      type(error_type), allocatable, intent(out) :: error
      call parse_document(text, 's.nml', document)
      call match_document(document, groups, rows, checked)
      call check_document(checked, extents)
      call checked%faults%to_error('s.nml', error)
   end subroutine checked_text

   subroutine other_table(error)
      type(error_type), allocatable, intent(out) :: error
      type(namelist_document), target :: document
      type(checked_document), target :: checked
      type(field_loader) :: loader
      character(len=:), allocatable :: texts(:)
      real(wp), allocatable :: values(:)
      integer :: n

      call checked_text('&sweep base = ''b'' / &axis key = ''x'' values = 1 2*3, count = 7 /'//nl// &
         '&axis key = ''it''''s'' text_values = ''ab'', 2*''c'' /', document, checked, error)
      if (allocated(error)) return
      call check(error, instances(checked, 'axis'), 2, 'axes')
      if (allocated(error)) return
      loader%checked => checked
      call loader%open_group('axis', 1)
      call loader%field('values', values)
      call loader%field('count', n)
      call loader%close_group()
      call loader%open_group('axis', 2)
      call loader%text_list('text_values', texts)
      call check_close(error, values, [1.0_wp, 3.0_wp, 3.0_wp], 0.0_wp, 'values')
      if (allocated(error)) return
      call check(error, n, 7, 'count')
      if (allocated(error)) return
      call check(error, texts(1)//texts(2)//texts(3), 'abc c ', 'texts')
   end subroutine other_table

   subroutine required_in_each(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: refusal
      type(namelist_document), target :: document
      type(checked_document) :: checked
      call checked_text('&axis key = ''a'', values(1) = 2 /'//nl//'&axis'//nl//'count = 1 /', document, &
         checked, refusal)
      call check(error, refusal%message, 's.nml:1: &axis values(1) = 2: takes no index'//nl// &
         's.nml:2: &axis key: is required'//nl//'s.nml:3: &axis count = 1: must be at least 2'//nl// &
         's.nml:3: &sweep base: is required', 'message')
   end subroutine required_in_each

   subroutine defaults_pass(error)
      type(error_type), allocatable, intent(out) :: error
      type(namelist_document), target :: document
      type(checked_document) :: checked
      call checked_text(defaults_text(groups, rows, extents, '! heading'//nl), document, checked, error)
   end subroutine defaults_pass

   subroutine rules_in_words(error)
      type(error_type), allocatable, intent(out) :: error
      call check(error, rule_text(rows(5)), 'must be at least 2', 'rule')
      if (allocated(error)) return
      call check(error, rule_text(rows(3)), '', 'no rule')
   end subroutine rules_in_words

end module test_schema
