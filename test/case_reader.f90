!> What is accepted gives the right case; cases survive printing and reading; documents can be edited.
module test_case_reader
   use rodyn_kinds, only: wp
   use rodyn_case_config, only: case_config, case_schema
   use rodyn_case_reader, only: case_from_document, default_case, namelist_document, parse_case, parse_document, &
      read_case, resolved_case, set_value
   use rodyn_errors, only: error_type, exit_bad_input
   use rodyn_schema, only: schema_group, schema_row, group_index
   use test_case_support, only: chain, expect_accepted, nl, spacecraft, valid
   use test_testing, only: check, check_close, new_test, unittest
   implicit none (type, external)
   private
   public :: collect_case_reader

contains

   subroutine collect_case_reader(suite)
      type(unittest), allocatable, intent(out) :: suite(:)
      suite = [ &
         new_test('one value fills an array, a list gives each element', fill_arrays), &
         new_test('single elements go over the list and over the default', single_elements), &
         new_test('hinge arrays start at zero', hinge_bounds), &
         new_test('what is left out has its default', defaults_apply), &
         new_test('words are accepted in any case', word_case), &
         new_test('a fixed spacecraft needs neither mass nor inertia', fixed_without_mass), &
         new_test('rigid rods need no bending stiffness', rigid_without_stiffness), &
         new_test('each load has its own defaults', load_defaults), &
         new_test('long paths are kept and too long ones refused', long_paths), &
         new_test('the default case is accepted as it is', default_is_valid), &
         new_test('the default case names every key', default_is_complete), &
         new_test('every row of the table belongs to a group and has help', rows_are_sound), &
         new_test('a printed case reads back as the same case', round_trip), &
         new_test('a sparse case reads back as the same case', round_trip_sparse), &
         new_test('a key can be set in a parsed document', set_one_key), &
         new_test('one element can be set again and again', set_element_again), &
         new_test('a key can be set in a group that the file has not', set_in_new_group), &
         new_test('a repeated group needs its number', set_in_load), &
         new_test('an element of a list is replaced where it stands', set_in_list), &
         new_test('a key that cannot be set says why', set_refused), &
         new_test('a wrong value set is told without a line', set_wrong_value), &
         new_test('a file that cannot be read is named', no_such_file), &
         new_test('the text of the file is handed out', file_text)]
   end subroutine collect_case_reader

   subroutine fill_arrays(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      call expect_accepted(error, valid//'&initial phi = 2*0.5, -1d-1 2, beta = 3 /', config)
      if (allocated(error)) return
      call check_close(error, config%initial%phi, [0.5_wp, 0.5_wp, -0.1_wp, 2.0_wp], 0.0_wp, 'phi')
      if (allocated(error)) return
      call check_close(error, config%initial%beta, [3.0_wp, 3.0_wp, 3.0_wp, 3.0_wp], 0.0_wp, 'beta')
   end subroutine fill_arrays

   subroutine single_elements(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      call expect_accepted(error, valid//'&initial phi(3) = 7, phi = 1, alpha(2:3) = 0.5 0.6, beta(1:4) = 0.2 /', config)
      if (allocated(error)) return
      call check_close(error, config%initial%phi, [1.0_wp, 1.0_wp, 7.0_wp, 1.0_wp], 0.0_wp, 'phi')
      if (allocated(error)) return
      call check_close(error, config%initial%alpha, [0.0_wp, 0.5_wp, 0.6_wp, 0.0_wp], 0.0_wp, 'alpha')
      if (allocated(error)) return
      call check_close(error, config%initial%beta, [0.2_wp, 0.2_wp, 0.2_wp, 0.2_wp], 0.0_wp, 'beta')
   end subroutine single_elements

   subroutine hinge_bounds(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      call expect_accepted(error, spacecraft//'&chain n_rods = 3, length = 1, mass_per_length = 1,'//nl// &
         'bending_stiffness = 1, hinge_stiffness(0) = 7e3, hinge_stiffness(1:2) = 5e3 /', config)
      if (allocated(error)) return
      call check(error, lbound(config%chain%hinge_stiffness, 1), 0, 'first hinge')
      if (allocated(error)) return
      call check(error, lbound(config%chain%length, 1), 1, 'first rod')
      if (allocated(error)) return
      call check_close(error, config%chain%hinge_stiffness, [7.0e3_wp, 5.0e3_wp, 5.0e3_wp], 0.0_wp, 'stiffness')
   end subroutine hinge_bounds

   subroutine defaults_apply(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      call expect_accepted(error, valid, config)
      if (allocated(error)) return
      call check_close(error, [config%t_end, config%solver%rtol, config%solver%atol, config%chain%kink], &
         [1.0_wp, 1.0e-8_wp, 1.0e-10_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], 0.0_wp, 'numbers')
      if (allocated(error)) return
      call check(error, config%n_outputs == 1000 .and. config%model%gauss_points == 4 .and. size(config%loads) == 0 &
         .and. config%solver%max_steps == 1000000000 .and. config%output%compression == 4, 'whole numbers')
      if (allocated(error)) return
      call check(error, trim(config%spacecraft%motion)//' '//trim(config%model%formulation)//' ' &
         //trim(config%model%inertia)//' '//trim(config%model%bending)//' '//trim(config%model%kernel)//' ' &
         //trim(config%solver%method), 'free inextensible distributed dynamic recursive auto', 'words')
      if (allocated(error)) return
      call check(error, config%output%ledger .and. len(config%title) == 0 .and. len(config%output%file) == 0, 'output')
   end subroutine defaults_apply

   subroutine word_case(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      call expect_accepted(error, valid//"&LOAD Component = 'x ', VALUE = 1 / &model Formulation = ""PAPER"" /", config)
      if (allocated(error)) return
      call check(error, trim(config%loads(1)%component)//trim(config%model%formulation), 'Xpaper', 'words')
   end subroutine word_case

   subroutine fixed_without_mass(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      call expect_accepted(error, chain//"&spacecraft motion = 'fixed' /", config)
      if (allocated(error)) return
      call check_round_trip(config, error)
   end subroutine fixed_without_mass

   subroutine rigid_without_stiffness(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      call expect_accepted(error, spacecraft//'&chain n_rods = 1, length = 1, mass_per_length = 1,'//nl// &
         "hinge_stiffness = 0 / &model bending = 'rigid', inertia = 'lumped' /", config)
      if (allocated(error)) return
      call check(error, size(config%chain%bending_stiffness), 1, 'stiffness')
      if (allocated(error)) return
      call check_round_trip(config, error)
   end subroutine rigid_without_stiffness

   subroutine load_defaults(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      call expect_accepted(error, valid//"&case t_end = 5 / &load value = 3 /"//nl// &
         "&load target = 'node', node = 4, component = 'Y', law = 'smooth_step', t_start = 2, value = 1 /", config)
      if (allocated(error)) return
      call check_close(error, [config%loads(1)%t_start, config%loads(1)%t_end, config%loads(2)%t_end, &
         config%loads(2)%rise_time], [0.0_wp, 5.0_wp, 5.0_wp, 3.0_wp], 0.0_wp, 'times')
      if (allocated(error)) return
      call check(error, config%loads(2)%node, 4, 'node')
      if (allocated(error)) return
      call check(error, trim(config%loads(1)%target)//trim(config%loads(1)%component), 'spacecraftM', 'target')
   end subroutine load_defaults

   subroutine long_paths(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: refusal
      type(case_config) :: config
      call expect_accepted(error, valid//"&output file = '"//repeat('a', 4096)//"' /", config)
      if (allocated(error)) return
      call check(error, len(config%output%file), 4096, 'length')
      if (allocated(error)) return
      call parse_case(valid//"&output file = '"//repeat('a', 4097)//"' /", 'c.nml', config, refusal)
      call check(error, allocated(refusal), 'accepted 4097 bytes')
      if (allocated(error)) return
      call check(error, refusal%message, "c.nml:3: &output file = '"//repeat('a', 60)//"...': " &
         //"must not be longer than 4096 bytes", 'message')
   end subroutine long_paths

   subroutine default_is_valid(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      call expect_accepted(error, default_case(), config)
      if (allocated(error)) return
      call check(error, config%chain%n_rods, 4, 'rods')
   end subroutine default_is_valid

   subroutine default_is_complete(error)
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: text
      type(schema_group), allocatable :: groups(:)
      type(schema_row), allocatable :: rows(:)
      integer :: r
      text = default_case()
      call case_schema(groups, rows)
      do r = 1, size(rows)
         call check(error, index(text, '   '//trim(rows(r)%key)//' =') > 0 .or. &
            index(text, '   ! '//trim(rows(r)%key)//' =') > 0, trim(rows(r)%key)//' is missing')
         if (allocated(error)) return
      end do
   end subroutine default_is_complete

   subroutine rows_are_sound(error)
      type(error_type), allocatable, intent(out) :: error
      type(schema_group), allocatable :: groups(:)
      type(schema_row), allocatable :: rows(:)
      integer :: r
      call case_schema(groups, rows)
      do r = 1, size(rows)
         call check(error, group_index(groups, trim(rows(r)%group)) > 0 .and. &
            len_trim(rows(r)%help) > 0 .and. len_trim(rows(r)%help) < len(rows(r)%help), trim(rows(r)%key))
         if (allocated(error)) return
      end do
   end subroutine rows_are_sound

   !> Print, read, print: both texts must agree, and so must a few values to the bit.
   subroutine check_round_trip(config, error)
      type(case_config), intent(in) :: config
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: again

      call parse_case(resolved_case(config), 'resolved', again, error)
      if (allocated(error)) return
      call check(error, resolved_case(again), resolved_case(config), 'printed again')
      if (allocated(error)) return
      call check_close(error, again%initial%phi, config%initial%phi, 0.0_wp, 'phi')
      if (allocated(error)) return
      call check_close(error, again%chain%bending_stiffness, config%chain%bending_stiffness, 0.0_wp, 'stiffness')
      if (allocated(error)) return
      call check_close(error, [again%spacecraft%mass, again%t_end], [config%spacecraft%mass, config%t_end], 0.0_wp, &
         'mass and t_end')
   end subroutine check_round_trip

   subroutine round_trip(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      call expect_accepted(error, valid//"&case title = 'it''s ""one""', t_end = 0.1, n_outputs = 7 /"//nl// &
         '&initial phi = 0.1, 0.1, 0.3333333333333333333, -0.0, phi_rate = 4*1e-7, omega = 1.1 /'//nl// &
         "&load law = 'table', times = 0 0.1 0.7, values = 3*0.2, after = 'hold', component = 'X' /"//nl// &
         "&load law = 'sine_squared', value = -1500, rate = 0.3, t_start = 0.05 /"//nl// &
         "&load law = 'smooth_step', value = 1.1, target = 'node', node = 2, component = 'Y' /"//nl// &
         "&solver method = 'erk', fixed_step = 1.1e-3, order = 5 /"//nl// &
         "&output file = 'a/b''c.h5', ledger = F, compression = 0 /", config)
      if (allocated(error)) return
      call check(error, size(config%loads), 3, 'loads')
      if (allocated(error)) return
      call check_round_trip(config, error)
   end subroutine round_trip

   !> A case made by hand, with nothing but the chain.
   subroutine round_trip_sparse(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(case_config) :: again
      config%spacecraft%mass = 0.1_wp
      config%spacecraft%inertia = 0.7_wp
      config%chain%n_rods = 2
      config%chain%length = [1.0_wp/3.0_wp, 2.0_wp]
      config%chain%mass_per_length = [1.0_wp, 1.0_wp]
      config%chain%bending_stiffness = [1.0_wp, 1.0_wp]
      config%chain%hinge_stiffness = [1.0_wp, huge(1.0_wp)]
      call parse_case(resolved_case(config), 'resolved', again, error)
      if (allocated(error)) return
      call check_close(error, again%chain%hinge_stiffness, config%chain%hinge_stiffness, 0.0_wp, 'stiffness')
      if (allocated(error)) return
      call check_close(error, again%chain%length, config%chain%length, 0.0_wp, 'length')
   end subroutine round_trip_sparse

   subroutine set_one_key(error)
      type(error_type), allocatable, intent(out) :: error
      type(namelist_document) :: document
      type(case_config) :: config
      call parse_document(valid//'&initial phi = 1, phi(2) = 5, omega = 3 / &case t_end = 2 /', 'c.nml', document)
      call set_value(document, 'chain.hinge_stiffness(0)', '7e3', error)
      if (allocated(error)) return
      call set_value(document, 'Initial.Phi', '1 2 3 4', error)
      if (allocated(error)) return
      call set_value(document, 'model.formulation', '''paper''', error)
      if (allocated(error)) return
      call case_from_document(document, config, error)
      if (allocated(error)) return
      call check_close(error, config%chain%hinge_stiffness, [7.0e3_wp, 4.0e3_wp, 4.0e3_wp, 4.0e3_wp], 0.0_wp, 'C')
      if (allocated(error)) return
      call check_close(error, config%initial%phi, [1.0_wp, 2.0_wp, 3.0_wp, 4.0_wp], 0.0_wp, 'phi')
      if (allocated(error)) return
      call check_close(error, [config%initial%omega, config%t_end], [3.0_wp, 2.0_wp], 0.0_wp, 'other keys')
      if (allocated(error)) return
      call check(error, trim(config%model%formulation), 'paper', 'formulation')
   end subroutine set_one_key

   subroutine set_element_again(error)
      type(error_type), allocatable, intent(out) :: error
      type(namelist_document) :: document
      type(case_config) :: config
      integer :: n
      call parse_document(valid//'&initial phi(1:2) = 5, phi(3) = 6 /', 'c.nml', document)
      call set_value(document, 'initial.phi(2)', '1', error)
      if (allocated(error)) return
      n = document%n_entries
      call set_value(document, 'initial.phi(2)', '2', error)
      if (allocated(error)) return
      call check(error, document%n_entries, n, 'entries')
      if (allocated(error)) return
      call case_from_document(document, config, error)
      if (allocated(error)) return
      call check_close(error, config%initial%phi, [5.0_wp, 2.0_wp, 6.0_wp, 0.0_wp], 0.0_wp, 'phi')
   end subroutine set_element_again

   subroutine set_in_new_group(error)
      type(error_type), allocatable, intent(out) :: error
      type(namelist_document) :: document
      type(case_config) :: config
      call parse_document(valid, 'c.nml', document)
      call set_value(document, 'solver.rtol', '1e-5', error)
      if (allocated(error)) return
      call case_from_document(document, config, error)
      if (allocated(error)) return
      call check_close(error, [config%solver%rtol], [1.0e-5_wp], 0.0_wp, 'rtol')
   end subroutine set_in_new_group

   subroutine set_in_load(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: refusal
      type(namelist_document) :: document
      type(case_config) :: config
      call parse_document(valid//'&load value = 1 / &load value = 2 /', 'c.nml', document)
      call set_value(document, 'load.value', '3', refusal)
      call check(error, refusal%message, 'load.value: there are 2 such groups; specify one, as in load(1).value', &
         'refusal')
      if (allocated(error)) return
      call set_value(document, 'load(2).value', '3', error)
      if (allocated(error)) return
      call case_from_document(document, config, error)
      if (allocated(error)) return
      call check_close(error, [config%loads%value], [1.0_wp, 3.0_wp], 0.0_wp, 'values')
   end subroutine set_in_load

   subroutine set_in_list(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: refusal
      type(namelist_document) :: document
      type(case_config) :: config
      character(len=*), parameter :: loads = '&load value = 1 / &load law = ''table'', times = 0, 1, 2, 3, values = 2*5, 2*6.5 /'

      call parse_document(valid//loads, 'c.nml', document)
      call set_value(document, 'load(2).values(2)', '7', error, in_list=.true.)
      if (.not. allocated(error)) call set_value(document, 'load(2).values(4)', '-8e0', error, in_list=.true.)
      if (.not. allocated(error)) call set_value(document, 'load(2).values(2)', '9', error, in_list=.true.)
      if (.not. allocated(error)) call case_from_document(document, config, error)
      if (allocated(error)) return
      call check_close(error, config%loads(2)%values, [5.0_wp, 9.0_wp, 6.5_wp, -8.0_wp], 0.0_wp, 'values')
      if (allocated(error)) return
      call set_value(document, 'load(2).values(5)', '1', refusal, in_list=.true.)
      call check(error, refusal%message, 'load(2).values(5): there is no such element; the array has 4, numbered from 1', 'refusal')
      if (allocated(error)) return
      call set_value(document, 'load(1).values(1)', '1', refusal, in_list=.true.)
      call check(error, refusal%message, 'load(1).values(1): the base has no array with such an element', 'refusal')
   end subroutine set_in_list

   subroutine set_refused(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: refusal
      type(namelist_document) :: document
      character(len=16), parameter :: keys(8) = [character(len=16) :: 'rtol', '.rtol', 'solver.', 'solver(0).rtol', &
         'solver(2).rtol', 'initial.phi(x)', 'initial.phi(1', 'solver.rtol']
      character(len=8), parameter :: texts(8) = [character(len=8) :: '1', '1', '1', '1', '1', '1', '1', '1 / &x']
      integer :: i
      call parse_document(valid, 'c.nml', document)
      do i = 1, size(keys)
         call set_value(document, trim(keys(i)), trim(texts(i)), refusal)
         call check(error, allocated(refusal), 'accepted '//keys(i)//texts(i))
         if (allocated(error)) return
         call check(error, refusal%exit_code, exit_bad_input, keys(i))
         if (allocated(error)) return
      end do
   end subroutine set_refused

   subroutine set_wrong_value(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: refusal
      type(namelist_document) :: document
      type(case_config) :: config
      call parse_document(valid, 'c.nml', document)
      call set_value(document, 'chain.length(3)', '-1', error)
      if (allocated(error)) return
      call set_value(document, 'chain.lenght', '1', error)
      if (allocated(error)) return
      call case_from_document(document, config, refusal)
      call check(error, refusal%message, 'c.nml: &chain lenght: unknown key; the nearest known one is length'//nl// &
         'c.nml: &chain length(3) = -1: must be positive [m]', 'message')
   end subroutine set_wrong_value

   subroutine no_such_file(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: refusal
      type(case_config) :: config
      call read_case('no/such/file.nml', config, error=refusal)
      call check(error, refusal%message, 'no/such/file.nml: cannot be read (No such file or directory)', 'message')
      if (allocated(error)) return
      call read_case('.', config, error=refusal)
      call check(error, refusal%message, '.: cannot be read (Is a directory)', 'directory')
      if (allocated(error)) return
      call check(error, refusal%exit_code, exit_bad_input, 'exit code')
      if (allocated(error)) return
      call read_case('', config, error=refusal)
      call check(error, allocated(refusal), 'accepted an empty path')
   end subroutine no_such_file

   subroutine file_text(error)
      type(error_type), allocatable, intent(out) :: error
      character(len=*), parameter :: path = 'test_case_reader.tmp'
      character(len=:), allocatable :: text
      type(case_config) :: config
      integer :: unit
      open (newunit=unit, file=path, access='stream', form='unformatted', status='replace', action='write')
      write (unit) valid//'! end'
      close (unit)
      call read_case(path, config, text, error)
      open (newunit=unit, file=path)
      close (unit, status='delete')
      if (allocated(error)) return
      call check(error, text, valid//'! end', 'text')
   end subroutine file_text

end module test_case_reader
