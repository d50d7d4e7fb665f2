!> A case made in memory, held against the rules that a case file is held against: those of its keys (`rodyn_case_config`) and
!> what ties keys together (`rodyn_case_rules`), in the same words. What is left out gets its default as in a file:
!> arrays that are not allocated, and whatever still has the initial value of its type.
module rodyn_case_check
   use rodyn_kinds, only: wp
   use rodyn_case_config, only: case_config, hinge_config, kink_config, load_config, model_config, profile_config, case_extents, &
      none_given, visit_case
   use rodyn_case_rules, only: check_case, is_condensed
   use rodyn_case_values, only: list_text, value_shown
   use rodyn_errors, only: error_type
   use rodyn_faults, only: fault_list
   use rodyn_field_visitor, only: field_visitor
   use rodyn_key_checker, only: key_checker
   use rodyn_schema, only: schema_extent, schema_group, schema_row, name_length, any_list, count_rule, matching_word, rule_text, &
      satisfies, up_to
   use rodyn_text, only: has_word, plain_text, printable, quoted, to_text, word
   use rodyn_time_law, only: keys_of_law
   implicit none (type, external)
   private
   public :: sound_case, complete_case

   !> Where a fault was found: no rule that needs this key is applied then.
   type :: unsound_key
      character(len=16) :: group = ''
      character(len=24) :: key = ''
      integer :: instance = 1
   end type unsound_key

   !> Faults of a case.
   type, extends(key_checker) :: case_checker
      type(case_config), pointer :: given => null()  !! says what was given
      type(case_config), pointer :: config => null() !! with what was left out
      type(fault_list) :: faults
      type(unsound_key), allocatable :: unsound(:) !! not allocated: none
   contains
      procedure :: is_given
      procedure :: is_sound
      procedure :: report
   end type case_checker

   !> Holds each value against the rule of its key.
   type, extends(field_visitor) :: value_checker
      type(case_checker), pointer :: checker => null()
      type(schema_extent) :: extents(3)
      character(len=16) :: group = ''
      integer :: instance = 1
   contains
      procedure :: open_group
      procedure :: real_field
      procedure :: array_field
      procedure :: integer_field
      procedure :: word_field
      procedure :: text_field
   end type value_checker

   ! What a caller leaves as it is was not given
   type(profile_config) :: blank_profile
   type(model_config) :: blank_model
   type(load_config) :: blank_load
   type(hinge_config) :: blank_hinge

contains

   !> A copy of a case with everything that was left out; an error, exit code 2, that tells all its faults.
   subroutine sound_case(given, config, error)
      type(case_config), target, intent(in) :: given
      type(case_config), target, intent(out) :: config
      type(error_type), allocatable, intent(out) :: error
      type(case_config), target :: spelt !! what was given, its words as in the table
      type(case_checker), target :: checker
      type(value_checker) :: visitor

      config = given
      checker%given => given
      checker%config => config
      visitor%checker => checker
      visitor%extents = case_extents(config%chain%n_rods)
      call visit_case(visitor, config)
      spelt = config
      checker%given => spelt
      call complete_case(checker, config)
      call check_case(checker, config)
      call checker%faults%to_error('', error)
   end subroutine sound_case

   !> Defaults that come from other keys, as far as these are sound. A table of a kink has its own times. Condensed rods keep their
   !> chords.
   subroutine complete_case(checker, config)
      class(key_checker), intent(in) :: checker
      type(case_config), intent(inout) :: config !! lists allocated
      integer :: i

      if (is_condensed(config) .and. .not. checker%is_given('model', 1, 'formulation')) config%model%formulation = 'consistent'
      do i = 1, size(config%profiles)
         if (config%profiles(i)%last_rod == blank_profile%last_rod) config%profiles(i)%last_rod = config%chain%n_rods
      end do
      if (.not. checker%is_sound('case', 1, 't_end')) return
      do i = 1, size(config%loads)
         associate (load => config%loads(i))
            if (is_none(load%t_end)) load%t_end = end_by_default(load%t_start, config%t_end)
            if (load%law == 'smooth_step' .and. is_unset(load%rise_time)) load%rise_time = load%t_end - load%t_start
         end associate
      end do
      do i = 1, size(config%kink_programs)
         associate (program => config%kink_programs(i))
            if (program%law /= 'table' .and. is_none(program%t_end)) program%t_end = end_by_default(program%t_start, config%t_end)
         end associate
      end do
   end subroutine complete_case

   !> The end of the case; of what begins later, and so never acts, some time after its beginning.
   elemental real(wp) function end_by_default(t_start, end_of_case) result(t_end)
      real(wp), intent(in) :: t_start, end_of_case !! [s]
      t_end = end_of_case
      if (t_start >= end_of_case) t_end = t_start + min(t_start, huge(t_start) - t_start)
   end function end_by_default

   !> Does a number still have the initial value of its type?
   elemental logical function is_unset(x)
      real(wp), intent(in) :: x
      is_unset = abs(x) <= 0.0_wp .or. is_none(x)
   end function is_unset

   !> Is it the initial value of an angle or a time that a case need not have? An infinite one is not.
   elemental logical function is_none(x)
      real(wp), intent(in) :: x
      is_none = x >= none_given .and. x <= none_given
   end function is_none

   !> Does the case give the key? Only the keys that rules ask for.
   logical function is_given(self, group, instance, key) result(given)
      class(case_checker), intent(in) :: self
      character(len=*), intent(in) :: group, key
      integer, intent(in) :: instance

      given = .true.
      associate (c => self%given)
         select case (group)
         case ('spacecraft')
            if (key == 'mass') given = .not. is_unset(c%spacecraft%mass)
            if (key == 'inertia') given = .not. is_unset(c%spacecraft%inertia)
         case ('chain')
            if (key == 'mass_per_length') given = has_values(c%chain%mass_per_length)
            if (key == 'bending_stiffness') then
               given = has_values(c%chain%bending_stiffness)
               if (given) given = .not. all(is_unset(c%chain%bending_stiffness))
            end if
         case ('model')
            if (key == 'bending') given = c%model%bending /= blank_model%bending
            if (key == 'formulation') given = c%model%formulation /= blank_model%formulation
         case ('rod_profile')
            given = profile_gives(c%profiles(instance), key)
         case ('load')
            given = load_gives(c%loads(instance), key)
         case ('kink_program')
            given = program_gives(c%kink_programs(instance), key)
         case ('hinge')
            given = hinge_gives(c%hinges(instance), key)
         case default ! asked for in files alone
         end select
      end associate
   end function is_given

   pure logical function has_values(x)
      real(wp), allocatable, intent(in) :: x(:)
      has_values = .false.
      if (allocated(x)) has_values = size(x) > 0
   end function has_values

   pure logical function profile_gives(profile, key) result(given)
      type(profile_config), intent(in) :: profile
      character(len=*), intent(in) :: key
      select case (key)
      case ('last_rod')
         given = profile%last_rod /= blank_profile%last_rod
      case ('polynomial')
         given = has_values(profile%polynomial)
      case ('positions')
         given = has_values(profile%positions)
      case ('values')
         given = has_values(profile%values)
      case default
         given = .true.
      end select
   end function profile_gives

   !> A number that the law takes is given whatever it is; another one if it is not zero.
   pure logical function load_gives(load, key) result(given)
      type(load_config), intent(in) :: load
      character(len=*), intent(in) :: key
      select case (key)
      case ('node')
         given = load%node /= blank_load%node
      case ('t_start')
         given = .not. is_unset(load%t_start)
      case ('t_end')
         given = .not. is_none(load%t_end)
      case ('value')
         given = .not. is_unset(load%value)
         if (.not. given) given = has_word(keys_of_law(load%law), key)
      case ('rate')
         given = .not. is_unset(load%rate)
         if (.not. given) given = has_word(keys_of_law(load%law), key)
      case ('rise_time')
         given = .not. is_unset(load%rise_time)
      case ('times')
         given = has_values(load%times)
      case ('values')
         given = has_values(load%values)
      case ('component')
         given = load%component /= blank_load%component
      case ('after')
         given = load%after /= blank_load%after
      case default
         given = .true.
      end select
   end function load_gives

   pure logical function program_gives(program, key) result(given)
      type(kink_config), intent(in) :: program
      character(len=*), intent(in) :: key
      select case (key)
      case ('t_start')
         given = .not. is_unset(program%t_start)
      case ('t_end')
         given = .not. is_none(program%t_end)
      case ('value')
         given = .not. is_unset(program%value)
         if (.not. given) given = has_word(keys_of_law(program%law), key)
      case ('rate')
         given = .not. is_unset(program%rate)
         if (.not. given) given = has_word(keys_of_law(program%law), key)
      case ('times')
         given = has_values(program%times)
      case ('values')
         given = has_values(program%values)
      case default
         given = .true.
      end select
   end function program_gives

   pure logical function hinge_gives(hinge, key) result(given)
      type(hinge_config), intent(in) :: hinge
      character(len=*), intent(in) :: key
      select case (key)
      case ('release_time')
         given = .not. is_none(hinge%release_time)
      case ('release_after')
         given = hinge%release_after /= blank_hinge%release_after
      case ('stop_stiffness')
         given = .not. is_unset(hinge%stop_stiffness)
      case ('friction_velocity')
         given = .not. is_unset(hinge%friction_velocity)
      case default
         given = .true.
      end select
   end function hinge_gives

   logical function is_sound(self, group, instance, key) result(sound)
      class(case_checker), intent(in) :: self
      character(len=*), intent(in) :: group, key
      integer, intent(in) :: instance
      sound = .true.
      if (allocated(self%unsound)) sound = .not. any(self%unsound%group == group .and. self%unsound%key == key .and. &
                                                      self%unsound%instance == instance)
   end function is_sound

   !> Note a fault: '&group key = value: rule'.
   subroutine report(self, group, instance, key, rule)
      class(case_checker), intent(inout) :: self
      character(len=*), intent(in) :: group, key, rule
      integer, intent(in) :: instance

      if (self%faults%full()) then
         call self%faults%add(0, '') ! only counted
      else if (.not. self%is_given(group, instance, key)) then
         call self%faults%add(0, name_of(group, instance)//' '//key//': '//rule)
      else
         call self%faults%add(0, name_of(group, instance)//' '//key//value_shown(self%config, group, instance, key)//': '//rule)
      end if
   end subroutine report

   !> '&load', and from the second on '&load(2)', as an axis of a sweep has it.
   pure function name_of(group, instance) result(name)
      character(len=*), intent(in) :: group
      integer, intent(in) :: instance
      character(len=:), allocatable :: name
      name = '&'//trim(group)
      if (instance > 1) name = name//'('//to_text(instance)//')'
   end function name_of

   !> Note a fault of a value itself.
   subroutine reject(self, row, where, value, rule)
      class(value_checker), intent(inout) :: self
      type(schema_row), intent(in) :: row
      character(len=*), intent(in) :: where !! index in parentheses, or nothing
      character(len=*), intent(in) :: value !! ' = value', or nothing
      character(len=*), intent(in) :: rule

      associate (checker => self%checker)
         call checker%faults%add(0, name_of(self%group, self%instance)//' '//trim(row%key)//where//value//': '//rule)
         if (.not. allocated(checker%unsound)) allocate (checker%unsound(0))
         if (checker%is_sound(trim(self%group), self%instance, trim(row%key))) &
            checker%unsound = [checker%unsound, unsound_key(self%group, row%key, self%instance)]
      end associate
   end subroutine reject

   subroutine open_group(self, group, instance)
      class(value_checker), intent(inout) :: self
      type(schema_group), intent(in) :: group
      integer, intent(in) :: instance
      self%group = group%name
      self%instance = instance
   end subroutine open_group

   !> The rule that a number breaks, in words; empty if it breaks none.
   pure function broken_rule(row, x) result(rule)
      type(schema_row), intent(in) :: row
      real(wp), intent(in) :: x
      character(len=:), allocatable :: rule
      rule = ''
      if (.not. abs(x) <= huge(x)) then
         rule = 'must be finite'
      else if (.not. satisfies(row, x)) then
         rule = rule_text(row)
      end if
   end function broken_rule

   !> May a number be passed over, because it keeps its rule or was not given?
   pure logical function passes(row, x)
      type(schema_row), intent(in) :: row
      real(wp), intent(in) :: x
      passes = .false.
      if (abs(x) <= huge(x)) passes = satisfies(row, x)
      if (.not. passes) passes = row%default == 'depends' .and. is_unset(x)
   end function passes

   subroutine real_field(self, x, row)
      class(value_checker), intent(inout) :: self
      real(wp), intent(inout) :: x
      type(schema_row), intent(in) :: row
      if (.not. passes(row, x)) call reject(self, row, '', ' = '//plain_text(x), broken_rule(row, x))
   end subroutine real_field

   subroutine integer_field(self, x, row)
      class(value_checker), intent(inout) :: self
      integer, intent(inout) :: x
      type(schema_row), intent(in) :: row

      if (satisfies(row, real(x, wp))) return
      if (row%default == 'depends' .and. .not. self%checker%is_given(trim(self%group), self%instance, trim(row%key))) return
      call reject(self, row, '', ' = '//to_text(x), rule_text(row))
   end subroutine integer_field

   !> An array is as long as what it runs over, and begins there: it may come with other bounds. Each stretch of equal wrong
   !> values is one fault.
   subroutine array_field(self, x, row)
      class(value_checker), intent(inout) :: self
      real(wp), allocatable, intent(inout) :: x(:)
      type(schema_row), intent(in) :: row
      integer :: lower

      lower = 1
      if (row%extent /= any_list) lower = self%extents(row%extent)%lower
      if (has_values(x) .and. row%extent /= any_list .and. row%default == 'depends') then
         if (all(is_unset(x))) deallocate (x) ! stiffnesses of rigid rods
      end if
      if (.not. has_values(x)) then
         call leave_out(self, row, x)
         return
      end if
      if (lbound(x, 1) /= lower) call shift(x, lower)
      if (row%extent /= any_list) then
         associate (wanted => self%extents(row%extent)%count)
            if (wanted > 0 .and. size(x) /= wanted) then
               if (size(x) == 1) then ! in a file it would stand for all
                  call reject(self, row, '', ' = '//list_text(x, .true.), 'must be allocated to '//to_text(wanted)//' values')
               else
                  call reject(self, row, '', ' = '//list_text(x, .true.), &
                              count_rule(self%extents(row%extent), wanted)//', not '//to_text(size(x)))
               end if
               return
            end if
         end associate
      end if
      call check_values(self, row, x, lower)
   end subroutine array_field

   subroutine check_values(self, row, x, lower)
      class(value_checker), intent(inout) :: self
      type(schema_row), intent(in) :: row
      real(wp), intent(in) :: x(:)
      integer, intent(in) :: lower !! index of the first
      character(len=:), allocatable :: where
      integer :: first, last

      last = 0
      do while (last < size(x) .and. .not. self%checker%faults%full())
         first = last + 1
         last = first
         if (passes_rule(x(first))) cycle
         do while (last < size(x))
            if (.not. abs(x(last + 1) - x(first)) <= 0.0_wp) exit
            last = last + 1
         end do
         where = '('//to_text(lower + first - 1)//')'
         if (last - first + 1 == size(x)) where = '' ! all of them
         call reject(self, row, where, ' = '//plain_text(x(first)), broken_rule(row, x(first)))
      end do

   contains

      pure logical function passes_rule(value)
         real(wp), intent(in) :: value
         passes_rule = .false.
         if (abs(value) <= huge(value)) passes_rule = satisfies(row, value)
      end function passes_rule

   end subroutine check_values

   !> The default of an array that was left out, if there is one.
   subroutine leave_out(self, row, x)
      class(value_checker), intent(inout) :: self
      type(schema_row), intent(in) :: row
      real(wp), allocatable, intent(inout) :: x(:)

      if (allocated(x)) deallocate (x)
      if (row%extent == any_list) then
         allocate (x(0))
      else if (row%default == 'required') then
         call reject(self, row, '', '', 'is required')
      else
         associate (range => self%extents(row%extent))
            if (row%default == 'depends') then
               allocate (x(range%lower:range%lower - 1))
            else
               allocate (x(range%lower:range%lower + range%count - 1), source=0.0_wp)
            end if
         end associate
      end if
   end subroutine leave_out

   !> Another first index.
   subroutine shift(x, lower)
      real(wp), allocatable, intent(inout) :: x(:)
      integer, intent(in) :: lower
      real(wp), allocatable :: copy(:)
      allocate (copy(lower:lower + size(x) - 1))
      copy(:) = x
      call move_alloc(copy, x)
   end subroutine shift

   !> A word takes the spelling of the table, as in a file.
   subroutine word_field(self, x, row)
      class(value_checker), intent(inout) :: self
      character(len=name_length), intent(inout) :: x
      type(schema_row), intent(in) :: row
      integer :: k

      if (has_word(row%words, x)) return
      k = matching_word(row, x)
      if (k == 0) then
         call reject(self, row, '', ' = '//printable(quoted(trim(x)), 60), rule_text(row))
      else
         x = word(row%words, k)
      end if
   end subroutine word_field

   subroutine text_field(self, x, row)
      class(value_checker), intent(inout) :: self
      character(len=:), allocatable, intent(inout) :: x
      type(schema_row), intent(in) :: row

      if (.not. allocated(x)) then
         x = ''
      else if (row%rule == up_to .and. len(x) > nint(row%high)) then
         call reject(self, row, '', ' = '//printable(quoted(x), 60), rule_text(row))
      end if
   end subroutine text_field

end module rodyn_case_check
