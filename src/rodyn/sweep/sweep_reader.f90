!> From a sweep file to a `sweep_config`: strict, and with every fault of the file in one error.
!>
!>     call read_input_texts('cases/table3_sweep.nml', input, error)
!>     call parse_sweep(input, .true., sweep, error)
!>     call new_plan(plan, sweep, error)
module rodyn_sweep_reader
   use rodyn_kinds, only: i8, wp
   use rodyn_case_config, only: case_config, case_schema
   use rodyn_case_reader, only: case_from_document
   use rodyn_checked_document, only: checked_document, report, entry_of, instances, is_given, is_sound, match_document
   use rodyn_defaults_writer, only: defaults_writer, new_defaults_writer
   use rodyn_document_checks, only: check_document
   use rodyn_errors, only: error_type
   use rodyn_field_loader, only: field_loader
   use rodyn_file_text, only: read_text_file
   use rodyn_input_texts, only: input_texts
   use rodyn_namelist_document, only: group_count
   use rodyn_namelist_edit, only: split_key
   use rodyn_namelist_parser, only: parse_document
   use rodyn_schema, only: schema_group, schema_row, any_list, group_index, matching_word, nearest_key, nearest_group, positive, &
      row_index, rule_text, satisfies, type_integer, type_logical, type_real, type_word
   use rodyn_sweep_case, only: build_values
   use rodyn_sweep_config, only: sweep_axis, sweep_config, axis_size, is_ratio, shown_value
   use rodyn_sweep_keys, only: axis_keys, sweep_extents, sweep_schema, visit_axis, visit_blank_sweep, visit_sweep
   use rodyn_text, only: formatted, lower, printable, tidy, to_text
   implicit none (type, external)
   private
   public :: parse_sweep, default_sweep

   character(len=*), parameter :: nl = new_line('a')
   integer, parameter :: most_tried = 10000 !! rows of a dimension that are built
   integer, parameter :: most_dimensions = 60 !! of a sweep whose rows are built: of more it has too many cases in any event
   integer, parameter :: most_named = 10    !! values of an axis that are named
   type(schema_row), parameter :: ratio_row = schema_row('mass_ratio', rule=positive, type=type_real)
   character(len=*), parameter :: heading = &
      '! A sweep of Rodyn: every key, with its default or an example.'//nl// &
      "! `base` is a case file; `rodyn defaults run` prints one."//nl

contains

   !> Check and complete a sweep and its base.
   subroutine parse_sweep(input, try_values, sweep, error)
      type(input_texts), intent(in), target :: input
      logical, intent(in) :: try_values !! build a case with each value of each axis
      type(sweep_config), intent(out) :: sweep
      type(error_type), allocatable, intent(out) :: error !! exit code 2, all faults
      type(checked_document), target :: checked
      type(schema_group), allocatable :: groups(:)
      type(schema_row), allocatable :: rows(:)
      type(field_loader) :: loader
      type(error_type), allocatable :: base_error
      logical :: has_base

      sweep%name = input%name
      sweep%text = input%text
      sweep%tried = ''
      call sweep_schema(groups, rows)
      call match_document(input%document, groups, rows, checked)
      call check_document(checked, sweep_extents)
      loader%checked => checked
      call visit_sweep(loader, sweep)
      call read_base(checked, input, sweep, has_base)
      if (has_base) then
         call parse_document(sweep%base_text, sweep%base_name, sweep%base_document)
         call case_from_document(sweep%base_document, sweep%base_case, base_error)
      end if
      call load_sweep(checked, sweep, has_base, has_base .and. .not. allocated(base_error))
      if (try_values .and. has_base .and. .not. allocated(base_error) .and. sweep%n_dimensions <= most_dimensions) &
         call try_axes(checked, sweep)
      call checked%faults%to_error(input%name, error)
      if (.not. allocated(base_error)) return
      if (allocated(error)) base_error%message = error%message//nl//base_error%message
      call move_alloc(base_error, error)
   end subroutine parse_sweep

   !> The text of the base: it came with the sweep, or is a file that the sweep names.
   subroutine read_base(checked, input, sweep, found)
      type(checked_document), intent(inout) :: checked
      type(input_texts), intent(in) :: input
      type(sweep_config), intent(inout) :: sweep
      logical, intent(out) :: found
      type(error_type), allocatable :: failure

      sweep%base_text = ''
      sweep%base_name = ''
      found = allocated(input%base_name)
      if (found) then
         sweep%base_text = input%base_text
         sweep%base_name = input%base_name
      else if (entry_of(checked, 'sweep', 1, 'base') == 0) then
         return ! which was reported
      else if (len_trim(sweep%base) == 0) then
         call report(checked, 'sweep', 1, 'base', 'must not be empty')
      else
         sweep%base_name = sweep%base
         if (index(sweep%base, '/') /= 1 .and. input%directory /= '.') sweep%base_name = input%directory//'/'//sweep%base
         call read_text_file(sweep%base_name, sweep%base_text, failure)
         found = .not. allocated(failure)
         if (.not. found) call report(checked, 'sweep', 1, 'base', failure%message)
      end if
   end subroutine read_base

   !> A complete commented sweep file.
   function default_sweep() result(text)
      character(len=:), allocatable :: text
      type(defaults_writer) :: writer

      call new_defaults_writer(writer, sweep_extents, heading)
      call visit_blank_sweep(writer)
      text = writer%text%content()
   end function default_sweep

   !> Fill the configuration, and note what is wrong with several keys together.
   subroutine load_sweep(checked, sweep, has_base, base_is_sound)
      type(checked_document), intent(inout), target :: checked
      type(sweep_config), intent(inout) :: sweep !! has the keys of &sweep
      logical, intent(in) :: has_base, base_is_sound
      type(field_loader) :: loader
      type(axis_keys), allocatable :: given(:)
      logical, allocatable :: sound(:)
      integer :: i, n_axes, n_faults

      loader%checked => checked
      if (base_is_sound .and. .not. is_given(checked, 'sweep', 1, 'probe_times')) &
         sweep%probe_times = [sweep%base_case%t_end]
      do i = 2, size(sweep%probe_times)
         if (sweep%probe_times(i) > sweep%probe_times(i - 1)) cycle
         call report(checked, 'sweep', 1, 'probe_times', 'must increase, but value '//to_text(i)//' does not')
         exit
      end do

      if (sweep%frequencies_at == 'equilibrium' .and. sweep%frequencies == 0) &
         call report(checked, 'sweep', 1, 'frequencies_at', 'applies only with frequencies')
      if (.not. sweep%integrate) then
         if (sweep%frequencies == 0) call report(checked, 'sweep', 1, 'integrate', &
                                                'leaves nothing to compute unless frequencies is positive')
         if (sweep%keep_series) call report(checked, 'sweep', 1, 'keep_series', 'needs integrate = .true.')
      end if
      n_axes = instances(checked, 'axis')
      allocate (sweep%axes(n_axes), given(n_axes))
      if (n_axes == 0) call checked%faults%add(checked%document%n_lines, '&axis: at least one is required')
      allocate (sound(n_axes))
      do i = 1, n_axes
         n_faults = checked%faults%count()
         call visit_axis(loader, i, given(i))
         call load_axis(checked, i, given(i), sweep%axes(i))
         sound(i) = checked%faults%count() == n_faults .and. all_sound(checked, i)
         if (sweep%axes(i)%key /= '') call resolve_key(checked, i, sweep, has_base, sweep%axes(i), sound(i))
      end do
      call check_ratio(checked, sweep)
      call set_dimensions(checked, sweep, given, sound)
   end subroutine load_sweep

   !> Are all keys of an axis sound?
   logical function all_sound(checked, i)
      type(checked_document), intent(in) :: checked
      integer, intent(in) :: i !! which
      integer :: r
      all_sound = .true.
      do r = 1, size(checked%rows)
         if (checked%rows(r)%group == 'axis') all_sound = all_sound .and. is_sound(checked, 'axis', i, trim(checked%rows(r)%key))
      end do
   end function all_sound

   !> One &axis: key and values.
   subroutine load_axis(checked, i, keys, axis)
      type(checked_document), intent(inout) :: checked
      integer, intent(in) :: i !! which
      type(axis_keys), intent(inout) :: keys !! what the file says; its values go to the axis
      type(sweep_axis), intent(inout) :: axis
      character(len=5), parameter :: range_keys(3) = [character(len=5) :: 'start', 'stop', 'count']
      integer :: k
      logical :: by_values, by_texts, by_range

      call move_alloc(keys%values, axis%numbers)
      call move_alloc(keys%text_values, axis%texts)
      axis%key = squeezed(keys%key)
      if (axis%key == '' .and. entry_of(checked, 'axis', i, 'key') > 0) &
         call report(checked, 'axis', i, 'key', 'must not be empty')

      by_values = given('values')
      by_texts = given('text_values')
      by_range = given('start') .or. given('stop') .or. given('count')
      axis%textual = by_texts
      if (count([by_values, by_texts, by_range]) /= 1) then
         call report(checked, 'axis', i, 'key', 'takes its values from one of: values; text_values; start, stop and count')
      else if (by_range) then
         do k = 1, 3
            if (.not. given(trim(range_keys(k)))) call report(checked, 'axis', i, trim(range_keys(k)), &
               'is required where the others of start, stop and count are given')
         end do
         if (.not. all([is_sound(checked, 'axis', i, 'start'), is_sound(checked, 'axis', i, 'stop'), &
                        is_sound(checked, 'axis', i, 'count'), is_sound(checked, 'axis', i, 'spacing')])) return
         if (keys%count < 1) return ! `count` is missing, which was reported above
         if (keys%spacing == 'log' .and. .not. (keys%start > 0.0_wp .and. keys%stop > 0.0_wp)) then
            call report(checked, 'axis', i, 'spacing', 'needs positive start and stop')
         else if (keys%count == 1 .and. abs(keys%stop - keys%start) > 0.0_wp) then
            call report(checked, 'axis', i, 'count', 'one value cannot be both start and stop')
         else
            axis%numbers = spaced(keys%start, keys%stop, keys%count, keys%spacing == 'log')
         end if
      end if
      if (keys%spacing == 'log' .and. .not. by_range) &
         call report(checked, 'axis', i, 'spacing', 'applies only with start, stop and count')

   contains

      logical function given(key)
         character(len=*), intent(in) :: key
         given = is_given(checked, 'axis', i, key)
      end function given

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

   !> Find the row of the case table that the key of an axis names, and hold every value against it.
   subroutine resolve_key(checked, i, sweep, has_base, axis, sound)
      type(checked_document), intent(inout) :: checked
      integer, intent(in) :: i
      type(sweep_config), intent(in) :: sweep
      logical, intent(in) :: has_base
      type(sweep_axis), intent(inout) :: axis
      logical, intent(inout) :: sound !! false: the axis cannot be built from
      type(error_type), allocatable :: error
      character(len=:), allocatable :: group, name
      type(schema_group), allocatable :: groups(:)
      type(schema_row), allocatable :: rows(:)
      integer :: instance, paren, r
      logical :: ok

      if (is_ratio(axis)) then
         axis%unit = '1'
         if (axis%textual) call refuse('text_values', 'mass_ratio is a number')
         if (sound) call check_values(checked, i, ratio_row, axis)
         return
      end if
      call split_key(trim(axis%key), group, instance, name, error)
      if (allocated(error)) then
         call refuse('key', 'a key is written group.name, or is mass_ratio')
         return
      end if
      paren = index(name, '(')
      if (paren > 0) name = name(:paren - 1)
      call case_schema(groups, rows)
      r = row_index(rows, group, name)
      if (r == 0) then
         if (.not. any(groups%name == group)) then
            call refuse('key', 'a case has no group '//printable(group, 40)//'; the nearest one is '// &
                        nearest_group(groups, group))
         else
            call refuse('key', '&'//group//' has no such key; the nearest one is '//nearest_key(rows, group, name))
         end if
         return
      end if
      if (group == 'output' .or. (group == 'case' .and. name == 'title')) then
         call refuse('key', 'has no influence on a case of a sweep')
         return
      end if
      ok = .true.
      if (has_base) call check_instance(checked, i, group, instance, name, group_count(sweep%base_document, group), &
                                           groups(group_index(groups, group))%repeatable, ok)
      sound = sound .and. ok
      axis%unit = rows(r)%unit
      axis%in_list = rows(r)%extent == any_list
      axis%whole = rows(r)%type == type_integer
      axis%bare = rows(r)%type == type_logical
      select case (rows(r)%type)
      case (type_integer, type_real)
         if (axis%textual) call refuse('text_values', trim(axis%key)//' takes numbers')
      case default
         if (.not. axis%textual) call refuse('key', 'takes text_values')
      end select
      if (.not. sound) return
      if (axis%whole .and. entry_of(checked, 'axis', i, 'values') == 0) axis%numbers = anint(axis%numbers)
      call check_values(checked, i, rows(r), axis)

   contains

      subroutine refuse(key, rule)
         character(len=*), intent(in) :: key, rule
         call report(checked, 'axis', i, key, rule)
         sound = .false.
      end subroutine refuse

   end subroutine resolve_key

   !> Note every value that breaks the rule of its key, as far as they are few.
   subroutine check_values(checked, i, row, axis)
      type(checked_document), intent(inout) :: checked
      integer, intent(in) :: i !! axis
      type(schema_row), intent(in) :: row
      type(sweep_axis), intent(inout) :: axis
      character(len=:), allocatable :: key, rule
      integer :: k, n_bad

      key = 'values'
      if (axis%textual) key = 'text_values'
      if (entry_of(checked, 'axis', i, key) == 0) key = 'key'
      n_bad = 0
      allocate (axis%bad(axis_size(axis)), source=.false.)
      do k = 1, size(axis%bad)
         rule = ''
         if (axis%textual) then
            if (row%type == type_word) then
               if (matching_word(row, trim(axis%texts(k))) == 0) rule = rule_text(row)
            end if
         else if (row%type == type_integer .and. .not. is_whole(axis%numbers(k))) then
            rule = 'must be an integer'
         else if (.not. satisfies(row, axis%numbers(k))) then
            rule = rule_text(row)
         end if
         if (len(rule) == 0) cycle
         axis%bad(k) = .true.
         n_bad = n_bad + 1
         if (n_bad <= most_named) call report(checked, 'axis', i, key, 'value '//to_text(k)//' ('//shown(k)//') '//rule)
      end do
      if (n_bad > most_named) call report(checked, 'axis', i, key, 'and '//to_text(n_bad - most_named)//' more of its values')

   contains

      function shown(k) result(text)
         integer, intent(in) :: k
         character(len=:), allocatable :: text
         if (axis%whole) then
            text = tidy(formatted(axis%numbers(k), '(g0.15)')) ! which may be none
         else
            text = shown_value(axis, k)
         end if
      end function shown

   end subroutine check_values

   pure logical function is_whole(x)
      real(wp), intent(in) :: x
      is_whole = abs(x) <= huge(1)
      if (is_whole) is_whole = abs(x - anint(x)) <= 0.0_wp
   end function is_whole

   !> Is it clear which group of the base is meant? Those that may stand several times count from 1, in the order of the file.
   subroutine check_instance(checked, i, group, instance, name, n, repeatable, ok)
      type(checked_document), intent(inout) :: checked
      integer, intent(in) :: i                !! axis
      character(len=*), intent(in) :: group, name
      integer, intent(in) :: instance         !! 0: none was given
      integer, intent(in) :: n                !! groups of that name in the base
      logical, intent(in) :: repeatable       !! it may stand several times
      logical, intent(out) :: ok
      character(len=:), allocatable :: has

      ok = .true.
      has = 'the base has '//to_text(n)//' groups &'//group
      if (n == 1) has = 'the base has one group &'//group
      if (.not. repeatable) then
         ok = instance == 0
         if (.not. ok) call report(checked, 'axis', i, 'key', '&'//group//' is not repeatable: write '//group//'.'//name)
      else if (n == 0) then
         ok = .false.
         call report(checked, 'axis', i, 'key', 'the base has no group &'//group)
      else if (instance > n) then
         ok = .false.
         call report(checked, 'axis', i, 'key', has//'; the index counts them in the order of the file')
      else if (instance == 0 .and. n > 1) then
         ok = .false.
         call report(checked, 'axis', i, 'key', has//'; specify one, as in '//group//'(1).'//name)
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
            call report(checked, 'axis', i, 'key', 'mass_ratio already sets the node masses')
         do k = 1, i - 1
            if (full_key(trim(sweep%axes(k)%key)) /= full_key(trim(sweep%axes(i)%key))) cycle
            call report(checked, 'axis', i, 'key', 'the key already has an axis')
            exit
         end do
      end do
   end subroutine check_ratio

   !> Which axes advance together. Those at fault have no dimension; without them the others can still be tried.
   subroutine set_dimensions(checked, sweep, keys, sound)
      type(checked_document), intent(inout) :: checked
      type(sweep_config), intent(inout) :: sweep
      type(axis_keys), intent(in) :: keys(:) !! what the file says (axes)
      logical, intent(in) :: sound(:)        !! (axes)
      integer :: i, k, partner

      sweep%n_dimensions = 0
      do i = 1, size(sweep%axes)
         partner = 0
         if (len_trim(keys(i)%along) > 0) then
            do k = 1, i - 1
               if (sweep%axes(k)%key == squeezed(keys(i)%along)) partner = k
            end do
            if (partner == 0) call report(checked, 'axis', i, 'along', 'no axis above has this key')
         else if (sweep%combine == 'zip') then
            partner = findloc(sweep%axes(:i - 1)%dimension > 0, .true., 1)
         end if
         if (.not. sound(i)) cycle
         if (partner > 0) then
            if (sweep%axes(partner)%dimension == 0) partner = 0
         end if
         if (partner == 0) then
            sweep%n_dimensions = sweep%n_dimensions + 1
            sweep%axes(i)%dimension = sweep%n_dimensions
            cycle
         end if
         if (axis_size(sweep%axes(i)) == axis_size(sweep%axes(partner))) then
            sweep%axes(i)%dimension = sweep%axes(partner)%dimension
         else
            call report(checked, 'axis', i, 'key', &
               'has '//to_text(axis_size(sweep%axes(i)))//' values, but '//trim(sweep%axes(partner)%key)// &
               ', with which it advances, has '//to_text(axis_size(sweep%axes(partner))))
         end if
      end do
   end subroutine set_dimensions

   !> Build a case with each row of each dimension, the others in rows that are accepted: a value that the case refuses is told
   !> before anything is computed, at its own axis. What only a combination forbids fails as a case.
   subroutine try_axes(checked, sweep)
      type(checked_document), intent(inout) :: checked
      type(sweep_config), intent(inout) :: sweep
      integer :: reference(sweep%n_dimensions), at(sweep%n_dimensions)
      integer :: d, i, n, n_refused, n_tried, n_values, row
      logical :: conflict !! one of values that are fine by themselves was reported
      character(len=:), allocatable :: why

      call find_reference(sweep, reference)
      n_tried = 0
      n_values = 0
      conflict = .false.
      do d = 1, sweep%n_dimensions
         n = dimension_size(sweep, d)
         n_refused = 0
         n_values = n_values + n
         do i = 1, min(n, most_tried)
            row = tried_row(i, n, most_tried)
            if (is_bad(sweep, d, row)) cycle
            n_tried = n_tried + 1
            at = reference
            at(d) = row
            call judge(sweep, d, at, conflict, why)
            if (len(why) == 0) cycle
            n_refused = n_refused + 1
            call report(checked, 'axis', faulty_axis(sweep, d, row), 'key', 'value '//to_text(row)//' ('// &
                       shown_value(sweep%axes(faulty_axis(sweep, d, row)), row)//') '//why)
            if (n_refused < most_named .or. i == min(n, most_tried)) cycle
            call report(checked, 'axis', faulty_axis(sweep, d, row), 'key', 'further values were not tried')
            exit
         end do
      end do
      sweep%tried = '; each of '//to_text(n_values)//' values tried'
      if (n_tried < n_values) sweep%tried = '; '//to_text(n_tried)//' of '//to_text(n_values)// &
                                            ' values tried, the others held against the rules of their keys alone'
      if (sweep%n_dimensions > 1) sweep%tried = sweep%tried//'; a combination that is refused fails as a case'
   end subroutine try_axes

   !> Is a row refused, and why? Empty if it is not, or not with all of the others.
   subroutine judge(sweep, d, at, conflict, why)
      type(sweep_config), intent(in) :: sweep
      integer, intent(in) :: d             !! dimension
      integer, intent(in) :: at(:)         !! its row, and accepted ones of the others
      logical, intent(inout) :: conflict   !! one was reported, which the other axes need not repeat
      character(len=:), allocatable, intent(out) :: why
      type(case_config) :: config
      type(error_type), allocatable :: error, alone_error
      integer :: alone(size(at))

      why = ''
      call build_values(sweep, at, config, error)
      if (.not. allocated(error)) return
      if (works_elsewhere(sweep, d, at)) return
      alone = 0
      alone(d) = at(d)
      call build_values(sweep, alone, config, alone_error)
      if (allocated(alone_error)) then
         why = 'makes a case that is refused: '//alone_error%message
      else if (.not. conflict) then
         conflict = .true.
         why = 'is refused together with the other axes: '//error%message
      end if
   end subroutine judge

   !> Does the row of one dimension make a valid case with some other row of another one?
   logical function works_elsewhere(sweep, d, at) result(works)
      type(sweep_config), intent(in) :: sweep
      integer, intent(in) :: d, at(:)
      type(case_config) :: config
      type(error_type), allocatable :: error
      integer, parameter :: most = 100 !! rows of each
      integer :: e, i, n
      integer :: other(size(at))

      works = .true.
      do e = 1, sweep%n_dimensions
         if (e == d) cycle
         n = dimension_size(sweep, e)
         do i = 1, min(n, most)
            other = at
            other(e) = tried_row(i, n, most)
            if (is_bad(sweep, e, other(e))) cycle
            call build_values(sweep, other, config, error)
            if (.not. allocated(error)) return
         end do
      end do
      works = .false.
   end function works_elsewhere

   !> Rows in which the others stand while one dimension is tried: the first ones if they make a valid case, otherwise the first of
   !> each that is accepted with the base; 0, the base's own values, where none is.
   subroutine find_reference(sweep, reference)
      type(sweep_config), intent(in) :: sweep
      integer, intent(out) :: reference(:)
      type(case_config) :: config
      type(error_type), allocatable :: error
      integer :: alone(size(reference))
      integer :: d, i, n

      reference = 1
      if (.not. any([(is_bad(sweep, d, 1), d=1, size(reference))])) then
         call build_values(sweep, reference, config, error)
         if (.not. allocated(error)) return
      end if
      reference = 0
      do d = 1, size(reference)
         n = dimension_size(sweep, d)
         do i = 1, min(n, most_tried)
            alone = 0
            alone(d) = tried_row(i, n, most_tried)
            if (is_bad(sweep, d, alone(d))) cycle
            call build_values(sweep, alone, config, error)
            if (allocated(error)) cycle
            reference(d) = alone(d)
            exit
         end do
      end do
   end subroutine find_reference

   !> Row number i of those that are tried: all, or `most` of them from the first to the last.
   pure integer function tried_row(i, n, most)
      integer, intent(in) :: i, n, most
      tried_row = i
      if (n > most) tried_row = 1 + int(int(i - 1, i8)*(n - 1)/(most - 1))
   end function tried_row

   !> Rows of a dimension.
   pure integer function dimension_size(sweep, d)
      type(sweep_config), intent(in) :: sweep
      integer, intent(in) :: d
      dimension_size = axis_size(sweep%axes(findloc(sweep%axes%dimension, d, 1)))
   end function dimension_size

   !> Does a value of the row break the rule of its own key, or is the key itself at fault, which has been reported?
   pure logical function is_bad(sweep, d, row)
      type(sweep_config), intent(in) :: sweep
      integer, intent(in) :: d, row
      integer :: a
      is_bad = .false.
      do a = 1, size(sweep%axes)
         if (sweep%axes(a)%dimension /= d) cycle
         is_bad = .not. allocated(sweep%axes(a)%bad)
         if (.not. is_bad) is_bad = sweep%axes(a)%bad(row)
         if (is_bad) return
      end do
   end function is_bad

   !> Which axis of a dimension is at fault: the first that the base refuses alone, or the first one.
   integer function faulty_axis(sweep, d, row)
      type(sweep_config), intent(in) :: sweep
      integer, intent(in) :: d, row
      type(sweep_config) :: single
      type(case_config) :: config
      type(error_type), allocatable :: error

      if (count(sweep%axes%dimension == d) > 1) then
         do faulty_axis = 1, size(sweep%axes)
            if (sweep%axes(faulty_axis)%dimension /= d) cycle
            single = sweep
            single%axes%dimension = 0
            single%axes(faulty_axis)%dimension = 1
            call build_values(single, [row], config, error)
            if (allocated(error)) return
         end do
      end if
      faulty_axis = findloc(sweep%axes%dimension, d, 1)
   end function faulty_axis

end module rodyn_sweep_reader
