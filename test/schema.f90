!> The machinery with other keys than those of a case: a list of texts, a repeated group, required keys in each.
module test_schema
   use rodyn_kinds, only: wp
   use rodyn_checked_document, only: checked_document, instances, match_document
   use rodyn_defaults_writer, only: defaults_writer, new_defaults_writer
   use rodyn_document_checks, only: check_document
   use rodyn_errors, only: error_type
   use rodyn_field_loader, only: field_loader
   use rodyn_field_visitor, only: field_visitor
   use rodyn_namelist_document, only: namelist_document
   use rodyn_namelist_parser, only: parse_document
   use rodyn_schema, only: schema_extent, schema_group, schema_row, any_list, at_least, rule_text, type_integer, type_logical, &
      type_real, type_text
   use rodyn_schema_collector, only: schema_collector
   use test_testing, only: check, check_close, new_test, unittest
   implicit none (type, external)
   private
   public :: collect_schema

   character(len=1), parameter :: nl = new_line('a')
   type :: axis_type
      character(len=:), allocatable :: key
      real(wp), allocatable :: values(:)
      character(len=:), allocatable :: texts(:)
      integer :: count = 2
      real(wp) :: factor = 1.0e-8_wp
      logical :: shown = .true.
   end type axis_type

   type(schema_extent), parameter :: extents(0) = [schema_extent ::]

contains

   subroutine collect_schema(suite)
      type(unittest), allocatable, intent(out) :: suite(:)
      suite = [ &
         new_test('the table has what a visit passes', table_of_visit), &
         new_test('a second table needs no other machinery', other_table), &
         new_test('what is required is required in each repeated group', required_in_each), &
         new_test('the defaults of keys pass their own checks', defaults_pass), &
         new_test('defaults are the initial values of components', defaults_are_initial), &
         new_test('rules read as sentences', rules_in_words)]
   end subroutine collect_schema

   subroutine visit_base(visitor, base)
      class(field_visitor), intent(inout) :: visitor
      character(len=:), allocatable, intent(inout) :: base
      call visitor%open_group(schema_group('sweep', help='what is varied'), 1)
      call visitor%text_field(base, schema_row('base', default='required', example="'a.nml'", help='case file'))
      call visitor%close_group()
   end subroutine visit_base

   subroutine visit_axis(visitor, instance, axis)
      class(field_visitor), intent(inout) :: visitor
      integer, intent(in) :: instance
      type(axis_type), intent(inout) :: axis
      call visitor%open_group(schema_group('axis', repeatable=.true., help='one key'), instance)
      call visitor%text_field(axis%key, schema_row('key', default='required', example="'case.t_end'", help='key that is varied'))
      call visitor%field(axis%values, schema_row('values', extent=any_list, default='depends', when='or text_values', &
         help='numbers'))
      call visitor%texts_field(axis%texts, schema_row('text_values', extent=any_list, default='depends', when='or values', &
         help='texts'))
      call visitor%field(axis%count, schema_row('count', rule=at_least, low=2.0_wp, help='how many'))
      call visitor%field(axis%factor, schema_row('factor', help='of each'))
      call visitor%field(axis%shown, schema_row('shown', help='on the terminal'))
      call visitor%close_group()
   end subroutine visit_axis

   subroutine visit_blank(visitor)
      class(field_visitor), intent(inout) :: visitor
      type(axis_type) :: axis
      character(len=:), allocatable :: base
      call visit_base(visitor, base)
      call visit_axis(visitor, 1, axis)
   end subroutine visit_blank

   subroutine make_table(groups, rows)
      type(schema_group), allocatable, intent(out) :: groups(:)
      type(schema_row), allocatable, intent(out) :: rows(:)
      type(schema_collector) :: collector
      call visit_blank(collector)
      call collector%table(groups, rows)
   end subroutine make_table

   subroutine table_of_visit(error)
      type(error_type), allocatable, intent(out) :: error
      type(schema_group), allocatable :: groups(:)
      type(schema_row), allocatable :: rows(:)
      call make_table(groups, rows)
      call check(error, all(groups%name == [character(len=16) :: 'sweep', 'axis']) .and. size(rows) == 7, 'groups and rows')
      if (allocated(error)) return
      call check(error, all(rows%group == [character(len=16) :: 'sweep', 'axis', 'axis', 'axis', 'axis', 'axis', 'axis']), 'group')
      if (allocated(error)) return
      call check(error, all(rows%type == [type_text, type_text, type_real, type_text, type_integer, type_real, type_logical]), &
                 'type')
   end subroutine table_of_visit

   subroutine checked_text(text, document, checked, error)
      character(len=*), intent(in) :: text
      type(namelist_document), intent(out), target :: document
      type(checked_document), intent(out) :: checked
      type(error_type), allocatable, intent(out) :: error
      type(schema_group), allocatable :: groups(:)
      type(schema_row), allocatable :: rows(:)
      call make_table(groups, rows)
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
      type(axis_type) :: axis(2)

      call checked_text('&sweep base = ''b'' / &axis key = ''x'' values = 1 2*3, count = 7 /'//nl// &
         '&axis key = ''it''''s'' text_values = ''ab'', 2*''c'' /', document, checked, error)
      if (allocated(error)) return
      call check(error, instances(checked, 'axis'), 2, 'axes')
      if (allocated(error)) return
      loader%checked => checked
      call visit_axis(loader, 1, axis(1))
      call visit_axis(loader, 2, axis(2))
      call check_close(error, axis(1)%values, [1.0_wp, 3.0_wp, 3.0_wp], 0.0_wp, 'values')
      if (allocated(error)) return
      call check(error, axis(1)%count, 7, 'count')
      if (allocated(error)) return
      call check(error, axis(2)%texts(1)//axis(2)%texts(2)//axis(2)%texts(3), 'abc c ', 'texts')
      if (allocated(error)) return
      call check(error, axis(2)%count, 2, 'default')
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
      type(defaults_writer) :: writer
      call new_defaults_writer(writer, extents, '! heading'//nl)
      call visit_blank(writer)
      call checked_text(writer%text%content(), document, checked, error)
   end subroutine defaults_pass

   !> The default of a key is the initial value of its component, and stands nowhere else.
   subroutine defaults_are_initial(error)
      type(error_type), allocatable, intent(out) :: error
      type(defaults_writer) :: writer
      character(len=:), allocatable :: text
      call new_defaults_writer(writer, extents, '')
      call visit_blank(writer)
      text = writer%text%content()
      call check(error, index(text, nl//'   count = 2                     ! how many; must be at least 2; default 2'//nl) > 0, text)
      if (allocated(error)) return
      call check(error, index(text, nl//'   factor = 1.0e-8               ! of each; default 1.0e-8'//nl) > 0, text)
      if (allocated(error)) return
      call check(error, index(text, nl//'   shown = .true.                ! on the terminal; default .true.'//nl) > 0, text)
   end subroutine defaults_are_initial

   subroutine rules_in_words(error)
      type(error_type), allocatable, intent(out) :: error
      type(schema_group), allocatable :: groups(:)
      type(schema_row), allocatable :: rows(:)
      call make_table(groups, rows)
      call check(error, rule_text(rows(5)), 'must be at least 2', 'rule')
      if (allocated(error)) return
      call check(error, rule_text(rows(3)), '', 'no rule')
   end subroutine rules_in_words

end module test_schema
