!> From a sweep file to a `sweep_config`: strict, and with every fault of the file in one error.
!>
!>     call read_input_texts('cases/table3_sweep.nml', input, error)
!>     call parse_sweep(input%text, input%name, input%base_text, input%base_name, .true., sweep, error)
!>     call new_plan(plan, sweep, error)
module rodyn_sweep_reader
   use rodyn_kinds, only: wp
   use rodyn_case_config, only: case_config, name_length
   use rodyn_case_reader, only: case_from_document
   use rodyn_case_schema, only: case_groups, case_rows
   use rodyn_checked_document, only: checked_document, blame, entry_of, instances, is_given, is_sound, match_document
   use rodyn_defaults_text, only: defaults_text
   use rodyn_document_checks, only: check_document
   use rodyn_errors, only: error_type
   use rodyn_field_loader, only: field_loader
   use rodyn_namelist_document, only: namelist_document, group_count
   use rodyn_namelist_edit, only: split_key
   use rodyn_namelist_parser, only: parse_document
   use rodyn_schema, only: any_list, group_index, nearest_key, nearest_group, row_index, type_integer, type_logical, type_real
   use rodyn_sweep_case, only: build_values
   use rodyn_sweep_config, only: sweep_axis, sweep_config, axis_size, is_ratio, value_text
   use rodyn_sweep_schema, only: sweep_extents, sweep_groups, sweep_rows
   use rodyn_text, only: lower, printable, to_text
   implicit none (type, external)
   private
   public :: parse_sweep, find_base, is_sweep_text, default_sweep

   character(len=*), parameter :: nl = new_line('a')
   character(len=*), parameter :: heading = &
      '! A sweep of Rodyn: every key, with its default or an example.'//nl// &
      "! `base` is a case file; `rodyn defaults run` prints one."//nl

contains

   !> Where the base of a sweep is: its path, from the directory of the sweep file.
   subroutine find_base(text, name, directory, path, error)
      character(len=*), intent(in) :: text, name
      character(len=*), intent(in) :: directory
      character(len=:), allocatable, intent(out) :: path
      type(error_type), allocatable, intent(out) :: error
      type(namelist_document), target :: document
      type(checked_document), target :: checked
      type(field_loader) :: loader

      path = ''
      call parse_document(text, name, document)
      call match_document(document, sweep_groups, sweep_rows, checked)
      call check_document(checked, sweep_extents)
      loader%checked => checked
      call loader%open_group('sweep', 1)
      call loader%text_field('base', path)
      if (entry_of(checked, 'sweep', 1, 'base') == 0) then
         call checked%faults%to_error(name, error)
      else if (index(path, '/') /= 1 .and. directory /= '.') then
         path = directory//'/'//path
      end if
   end subroutine find_base

   !> Check and complete a sweep and its base.
   subroutine parse_sweep(text, name, base_text, base_name, try_values, sweep, error)
      character(len=*), intent(in) :: text, name
      character(len=*), intent(in) :: base_text, base_name
      logical, intent(in) :: try_values !! build a case with each value of each axis
      type(sweep_config), intent(out) :: sweep
      type(error_type), allocatable, intent(out) :: error !! exit code 2, all faults
      type(namelist_document), target :: document
      type(checked_document), target :: checked
      type(error_type), allocatable :: base_error

      sweep%name = name
      sweep%text = text
      sweep%base_name = base_name
      sweep%base_text = base_text
      call parse_document(base_text, base_name, sweep%base)
      call case_from_document(sweep%base, sweep%base_case, base_error)
      call parse_document(text, name, document)
      call match_document(document, sweep_groups, sweep_rows, checked)
      call check_document(checked, sweep_extents)
      call load_sweep(checked, sweep, .not. allocated(base_error))
      if (try_values .and. checked%faults%count() == 0 .and. .not. allocated(base_error)) &
         call try_axes(checked, sweep)
      call checked%faults%to_error(name, error)
      if (.not. allocated(base_error)) return
      if (allocated(error)) base_error%message = error%message//nl//base_error%message
      call move_alloc(base_error, error)
   end subroutine parse_sweep

   !> Is the text a sweep file: has it a &sweep or &axis group?
   logical function is_sweep_text(text)
      character(len=*), intent(in) :: text
      type(namelist_document) :: document
      call parse_document(text, '', document)
      is_sweep_text = group_count(document, 'sweep') > 0 .or. group_count(document, 'axis') > 0
   end function is_sweep_text

   !> A complete commented sweep file.
   function default_sweep() result(text)
      character(len=:), allocatable :: text
      text = defaults_text(sweep_groups, sweep_rows, sweep_extents, heading)
   end function default_sweep

   !> Fill the configuration, and note what is wrong with several keys together.
   subroutine load_sweep(checked, sweep, base_is_sound)
      type(checked_document), intent(inout), target :: checked
      type(sweep_config), intent(inout) :: sweep
      logical, intent(in) :: base_is_sound
      type(field_loader) :: loader
      character(len=name_length) :: combine, at
      character(len=:), allocatable :: path
      integer :: i, n_axes

      loader%checked => checked
      combine = 'grid'
      path = ''
      call loader%open_group('sweep', 1)
      call loader%text_field('base', path)
      call loader%word_field('combine', combine)
      call loader%field('probe_times', sweep%probe_times)
      call loader%field('keep_series', sweep%keep_series)
      call loader%field('case_seconds', sweep%case_seconds)
      call loader%field('lanes', sweep%lanes)
      call loader%field('frequencies', sweep%frequencies)
      at = 'start'
      call loader%word_field('frequencies_at', at)
      sweep%at_equilibrium = at == 'equilibrium'
      call loader%field('integrate', sweep%integrate)
      call loader%close_group()
      if (base_is_sound .and. .not. is_given(checked, 'sweep', 1, 'probe_times')) &
         sweep%probe_times = [sweep%base_case%t_end]
      do i = 2, size(sweep%probe_times)
         if (sweep%probe_times(i) > sweep%probe_times(i - 1)) cycle
         call blame(checked, 'sweep', 1, 'probe_times', 'must increase, but value '//to_text(i)//' does not')
         exit
      end do

      if (sweep%at_equilibrium .and. sweep%frequencies == 0) &
         call blame(checked, 'sweep', 1, 'frequencies_at', 'goes with frequencies only')
      if (.not. sweep%integrate) then
         if (sweep%frequencies == 0) call blame(checked, 'sweep', 1, 'integrate', &
                                                'leaves nothing to compute unless frequencies is positive')
         if (sweep%keep_series) call blame(checked, 'sweep', 1, 'keep_series', 'needs integrate = .true.')
      end if
      n_axes = instances(checked, 'axis')
      allocate (sweep%axes(n_axes))
      if (n_axes == 0) call checked%faults%add(checked%document%n_lines, '&axis: at least one is required')
      do i = 1, n_axes
         call load_axis(checked, i, sweep%axes(i))
         if (sweep%axes(i)%key /= '' .and. base_is_sound) call resolve_key(checked, i, sweep, sweep%axes(i))
      end do
      if (checked%faults%count() > 0) return
      call check_ratio(checked, sweep)
      call set_dimensions(checked, sweep, combine)
   end subroutine load_sweep

   !> One &axis: key and values.
   subroutine load_axis(checked, i, axis)
      type(checked_document), intent(inout), target :: checked
      integer, intent(in) :: i !! which
      type(sweep_axis), intent(inout) :: axis
      type(field_loader) :: loader
      character(len=name_length) :: spacing
      character(len=:), allocatable :: key
      real(wp) :: first, last
      integer :: n, k
      logical :: by_values, by_texts, by_range

      loader%checked => checked
      key = ''
      spacing = 'linear'
      first = 0.0_wp
      last = 0.0_wp
      n = 0
      call loader%open_group('axis', i)
      call loader%text_field('key', key)
      call loader%field('values', axis%numbers)
      call loader%text_list('text_values', axis%texts)
      call loader%field('start', first)
      call loader%field('stop', last)
      call loader%field('count', n)
      call loader%word_field('spacing', spacing)
      call loader%close_group()
      axis%key = squeezed(key)
      if (axis%key == '' .and. entry_of(checked, 'axis', i, 'key') > 0) &
         call blame(checked, 'axis', i, 'key', 'must not be empty')

      by_values = given('values')
      by_texts = given('text_values')
      by_range = given('start') .or. given('stop') .or. given('count')
      axis%textual = by_texts
      if (count([by_values, by_texts, by_range]) /= 1) then
         call blame(checked, 'axis', i, 'key', 'takes its values from one of: values; text_values; start, stop and count')
      else if (by_range) then
         do k = 1, 3
            if (.not. given(trim(range_keys(k)))) call blame(checked, 'axis', i, trim(range_keys(k)), &
               'is required where the others of start, stop and count are given')
         end do
         if (.not. all([is_sound(checked, 'axis', i, 'start'), is_sound(checked, 'axis', i, 'stop'), &
                        is_sound(checked, 'axis', i, 'count'), is_sound(checked, 'axis', i, 'spacing')])) return
         if (n < 1) return ! `count` is missing, which was told above
         if (spacing == 'log' .and. .not. (first > 0.0_wp .and. last > 0.0_wp)) then
            call blame(checked, 'axis', i, 'spacing', 'needs positive start and stop')
         else if (n == 1 .and. abs(last - first) > 0.0_wp) then
            call blame(checked, 'axis', i, 'count', 'one value cannot be both start and stop')
         else
            axis%numbers = spaced(first, last, n, spacing == 'log')
         end if
      end if
      if (spacing == 'log' .and. .not. by_range) &
         call blame(checked, 'axis', i, 'spacing', 'goes with start, stop and count only')

   contains

      logical function given(key)
         character(len=*), intent(in) :: key
         given = is_given(checked, 'axis', i, key)
      end function given

      pure function range_keys(k) result(key)
         integer, intent(in) :: k
         character(len=5) :: key
         character(len=5), parameter :: keys(3) = [character(len=5) :: 'start', 'stop', 'count']
         key = keys(k)
      end function range_keys

   end subroutine load_axis

   !> n numbers from first to last; both ends exactly.
   pure function spaced(first, last, n, log_spacing) result(x)
      real(wp), intent(in) :: first, last
      integer, intent(in) :: n
      logical, intent(in) :: log_spacing
      real(wp) :: x(n)
      integer :: i

      x(1) = first
      do i = 2, n
         if (log_spacing) then
            x(i) = first*(last/first)**(real(i - 1, wp)/real(n - 1, wp))
         else
            x(i) = first + (last - first)*(real(i - 1, wp)/real(n - 1, wp))
         end if
      end do
      x(n) = last
   end function spaced

   !> A key in lower case without blanks.
   pure function squeezed(key) result(text)
      character(len=*), intent(in) :: key
      character(len=:), allocatable :: text
      integer :: i
      text = ''
      do i = 1, len(key)
         if (key(i:i) /= ' ') text = text//lower(key(i:i))
      end do
   end function squeezed

   !> Find the row of the case table that the key of an axis names, and what its values must be.
   subroutine resolve_key(checked, i, sweep, axis)
      type(checked_document), intent(inout) :: checked
      integer, intent(in) :: i
      type(sweep_config), intent(in) :: sweep
      type(sweep_axis), intent(inout) :: axis
      type(error_type), allocatable :: error
      character(len=:), allocatable :: group, name
      integer :: instance, paren, r, k
      logical :: ok

      if (is_ratio(axis)) then
         axis%unit = '1'
         if (axis%textual) call blame(checked, 'axis', i, 'text_values', 'mass_ratio is a number')
         if (.not. allocated(axis%numbers)) return
         if (any(axis%numbers <= 0.0_wp)) call blame(checked, 'axis', i, 'values', 'must be positive for mass_ratio')
         return
      end if
      call split_key(trim(axis%key), group, instance, name, error)
      if (allocated(error)) then
         call blame(checked, 'axis', i, 'key', 'a key is written group.name, or is mass_ratio')
         return
      end if
      paren = index(name, '(')
      if (paren > 0) name = name(:paren - 1)
      r = row_index(case_rows, group, name)
      if (r == 0) then
         if (.not. any(case_rows%group == group)) then
            call blame(checked, 'axis', i, 'key', 'a case has no group '//printable(group, 40)// &
                       '; the nearest one is '//nearest_group(case_groups, group))
         else
            call blame(checked, 'axis', i, 'key', '&'//group//' has no such key; the nearest one is ' &
                       //nearest_key(case_rows, group, name))
         end if
         return
      end if
      if (group == 'output' .or. (group == 'case' .and. name == 'title')) then
         call blame(checked, 'axis', i, 'key', 'has no influence on a case of a sweep')
         return
      end if
      call check_instance(checked, i, group, instance, name, group_count(sweep%base, group), ok)
      if (.not. ok) return
      axis%unit = case_rows(r)%unit
      axis%in_list = case_rows(r)%extent == any_list
      axis%whole = case_rows(r)%type == type_integer
      axis%bare = case_rows(r)%type == type_logical
      select case (case_rows(r)%type)
      case (type_integer, type_real)
         if (axis%textual) call blame(checked, 'axis', i, 'text_values', trim(axis%key)//' takes numbers')
      case default
         if (.not. axis%textual) call blame(checked, 'axis', i, 'key', 'takes text_values')
      end select
      if (.not. axis%whole .or. axis%textual .or. .not. allocated(axis%numbers)) return
      if (entry_of(checked, 'axis', i, 'values') == 0) axis%numbers = anint(axis%numbers)
      do k = 1, size(axis%numbers)
         if (abs(axis%numbers(k)) <= huge(1)) then
            if (abs(axis%numbers(k) - anint(axis%numbers(k))) <= 0.0_wp) cycle
         end if
         call blame(checked, 'axis', i, 'values', 'value '//to_text(k)//' must be a whole number')
         return
      end do
   end subroutine resolve_key

   !> Is it clear which group of the base is meant? Those that may stand several times count from 1, in the order of the file.
   subroutine check_instance(checked, i, group, instance, name, n, ok)
      type(checked_document), intent(inout) :: checked
      integer, intent(in) :: i                !! axis
      character(len=*), intent(in) :: group, name
      integer, intent(in) :: instance         !! 0: none was given
      integer, intent(in) :: n                !! groups of that name in the base
      logical, intent(out) :: ok
      character(len=:), allocatable :: has

      ok = .true.
      has = 'the base has '//to_text(n)//' groups &'//group
      if (n == 1) has = 'the base has one group &'//group
      if (.not. case_groups(group_index(case_groups, group))%repeatable) then
         ok = instance == 0
         if (.not. ok) call blame(checked, 'axis', i, 'key', '&'//group//' stands once and takes no number: '//group//'.'//name)
      else if (n == 0) then
         ok = .false.
         call blame(checked, 'axis', i, 'key', 'the base has no group &'//group)
      else if (instance > n) then
         ok = .false.
         call blame(checked, 'axis', i, 'key', has//'; the number in parentheses counts them in the order of the file')
      else if (instance == 0 .and. n > 1) then
         ok = .false.
         call blame(checked, 'axis', i, 'key', has//'; say which, as in '//group//'(1).'//name)
      end if
   end subroutine check_instance

   !> The key as it would be with the number of its group, so that load.value and load(1).value are the same.
   function full_key(key) result(text)
      character(len=*), intent(in) :: key
      character(len=:), allocatable :: text
      character(len=:), allocatable :: group, name
      type(error_type), allocatable :: error
      integer :: instance

      text = key
      call split_key(key, group, instance, name, error)
      if (.not. allocated(error)) text = group//'('//to_text(max(1, instance))//').'//name
   end function full_key

   !> A mass ratio sets all node masses, so nothing else may.
   subroutine check_ratio(checked, sweep)
      type(checked_document), intent(inout) :: checked
      type(sweep_config), intent(in) :: sweep
      integer :: i, k

      do i = 1, size(sweep%axes)
         if (index(sweep%axes(i)%key, 'chain.node_mass') == 1 .and. any(sweep%axes%key == 'mass_ratio')) &
            call blame(checked, 'axis', i, 'key', 'mass_ratio sets the node masses already')
         do k = 1, i - 1
            if (full_key(trim(sweep%axes(k)%key)) /= full_key(trim(sweep%axes(i)%key))) cycle
            call blame(checked, 'axis', i, 'key', 'the key has an axis already')
            exit
         end do
      end do
   end subroutine check_ratio

   !> Which axes advance together.
   subroutine set_dimensions(checked, sweep, combine)
      type(checked_document), intent(inout), target :: checked
      type(sweep_config), intent(inout) :: sweep
      character(len=*), intent(in) :: combine
      type(field_loader) :: loader
      character(len=:), allocatable :: along
      integer :: i, k, partner

      loader%checked => checked
      sweep%n_dimensions = 0
      do i = 1, size(sweep%axes)
         along = ''
         call loader%open_group('axis', i)
         call loader%text_field('along', along)
         call loader%close_group()
         partner = 0
         if (len_trim(along) > 0) then
            do k = 1, i - 1
               if (sweep%axes(k)%key == squeezed(along)) partner = k
            end do
            if (partner == 0) call blame(checked, 'axis', i, 'along', 'no axis above has this key')
         else if (combine == 'zip' .and. i > 1) then
            partner = 1
         end if
         if (partner == 0) then
            sweep%n_dimensions = sweep%n_dimensions + 1
            sweep%axes(i)%dimension = sweep%n_dimensions
            cycle
         end if
         sweep%axes(i)%dimension = sweep%axes(partner)%dimension
         if (axis_size(sweep%axes(i)) /= axis_size(sweep%axes(partner))) call blame(checked, 'axis', i, 'key', &
            'has '//to_text(axis_size(sweep%axes(i)))//' values, but '//trim(sweep%axes(partner)%key)// &
            ', with which it advances, has '//to_text(axis_size(sweep%axes(partner))))
      end do
   end subroutine set_dimensions

   !> Build a case with each row of each dimension, the others in their first: a value that the case refuses is told
   !> before anything is computed. What only a combination forbids fails as a case.
   subroutine try_axes(checked, sweep)
      type(checked_document), intent(inout) :: checked
      type(sweep_config), intent(in) :: sweep
      type(case_config) :: config
      type(error_type), allocatable :: error
      integer :: at(sweep%n_dimensions)
      integer, parameter :: most_tried = 10000
      integer :: a, d, n, row

      do d = 1, sweep%n_dimensions
         do a = 1, size(sweep%axes)
            if (sweep%axes(a)%dimension == d) exit
         end do
         n = axis_size(sweep%axes(a))
         do row = 1, n, 1 + n/most_tried
            at = 1
            at(d) = row
            call build_values(sweep, at, config, error)
            if (.not. allocated(error)) cycle
            call blame(checked, 'axis', a, 'key', 'value '//to_text(row)//' ('//value_text(sweep%axes(a), row)// &
                       ') makes a case that is refused: '//error%message)
            exit
         end do
      end do
   end subroutine try_axes

end module rodyn_sweep_reader
