!> What the declarations of keys are made of. One table per kind of file holds everything there is to know of its keys:
!> validation, defaults and documentation are read off it.
module rodyn_schema
   use rodyn_kinds, only: wp
   use rodyn_text, only: edit_distance, lower, to_text, word, word_count
   implicit none (type, external)
   private
   public :: schema_group, schema_row, schema_extent
   public :: name_length
   public :: type_integer, type_real, type_logical, type_word, type_text
   public :: one_value, any_list
   public :: no_rule, positive, not_negative, at_least, in_range, between, up_to
   public :: satisfies, matching_word, rule_text, requirement, count_rule, row_index, group_index, nearest_key, nearest_group, &
      misspelt_key, misspelt_group

   integer, parameter :: name_length = 32 !! longest choice word ('distributed', 'sine_squared', ...)

   !> Types of a key. A word is one of a fixed list; a text is free.
   integer, parameter :: type_integer = 1, type_real = 2, type_logical = 3, type_word = 4, type_text = 5

   !> Extents of a key: one value, a list of any length, or (1, 2, ...) an array over an extent of the schema.
   integer, parameter :: one_value = 0, any_list = -1

   !> Rules for numbers: > 0; >= 0; >= low; low..high; low < x < high. For texts: at most `high` bytes.
   integer, parameter :: no_rule = 0, positive = 1, not_negative = 2, at_least = 3, in_range = 4, between = 5, &
      up_to = 6

   !> One namelist group
   type :: schema_group
      character(len=16) :: name
      logical :: repeatable = .false. !! may stand several times
      character(len=100) :: help = ''
   end type schema_group

   !> One key, as it is declared where a visitor passes; what stands last is known to the table only (`rodyn_schema_collector`).
   type :: schema_row
      character(len=24) :: key
      character(len=12) :: unit = ''            !! empty: a pure number or a text
      integer :: extent = one_value
      integer :: rule = no_rule
      real(wp) :: low = 0.0_wp, high = 0.0_wp   !! of the rule
      character(len=8) :: default = ''          !! 'required'; 'depends' (see `when`); empty: the initial value of the component
      character(len=64) :: words = ''           !! of a word: 'free|fixed'
      character(len=24) :: example = ''         !! value to show where there is no default
      character(len=64) :: when = ''            !! of 'depends': when it is required, or what else it is
      character(len=100) :: help = ''
      character(len=16) :: group = ''
      integer :: type = 0
   end type schema_row

   !> What arrays run over
   type :: schema_extent
      character(len=8) :: name = '' !! 'rod': one value per rod
      integer :: lower = 1          !! first index
      integer :: count = 0          !! values; 0: not known yet
   end type schema_extent

contains

   !> Does a finite number keep the rule of its row?
   pure logical function satisfies(row, x)
      type(schema_row), intent(in) :: row
      real(wp), intent(in) :: x
      select case (row%rule)
      case (positive)
         satisfies = x > 0.0_wp
      case (not_negative)
         satisfies = x >= 0.0_wp
      case (at_least)
         satisfies = x >= row%low
      case (in_range)
         satisfies = x >= row%low .and. x <= row%high
      case (between)
         satisfies = x > row%low .and. x < row%high
      case default
         satisfies = .true.
      end select
   end function satisfies

   !> The rule in words: 'must be positive [m]'; empty if there is none.
   pure function rule_text(row) result(text)
      type(schema_row), intent(in) :: row
      character(len=:), allocatable :: text
      select case (row%rule)
      case (positive)
         text = 'must be positive'
      case (not_negative)
         text = 'must not be negative'
      case (at_least)
         text = 'must be at least '//to_text(nint(row%low))
      case (in_range)
         text = 'must lie in '//to_text(nint(row%low))//'..'//to_text(nint(row%high))
      case (between)
         text = 'must be greater than '//to_text(nint(row%low))//' and less than '//to_text(nint(row%high))
      case (up_to)
         text = 'must not be longer than '//to_text(nint(row%high))//' bytes'
      case default
         text = ''
         if (len_trim(row%words) > 0) text = word_rule(row%words)
      end select
      if (len(text) > 0) text = text//unit_text(row)
   end function rule_text

   !> Which of the row's words a text is, case and trailing blanks aside; 0 if none.
   pure integer function matching_word(row, text) result(found)
      type(schema_row), intent(in) :: row
      character(len=*), intent(in) :: text
      do found = 1, word_count(row%words)
         if (lower(word(row%words, found)) == lower(text)) return
      end do
      found = 0
   end function matching_word

   !> What kind of value the row takes: 'must be a number [m]'.
   pure function requirement(row) result(text)
      type(schema_row), intent(in) :: row
      character(len=:), allocatable :: text
      select case (row%type)
      case (type_integer)
         text = 'must be an integer'
      case (type_real)
         text = 'must be a number'
      case (type_logical)
         text = 'must be .true. or .false.'
      case (type_word)
         text = word_rule(row%words)
      case default
         text = 'must be a quoted string'
      end select
      text = text//unit_text(row)
   end function requirement

   !> How many values an array takes.
   pure function count_rule(extent, wanted) result(text)
      type(schema_extent), intent(in) :: extent
      integer, intent(in) :: wanted !! values
      character(len=:), allocatable :: text
      text = 'takes one value'
      if (wanted /= 1) text = 'takes 1 or '//to_text(wanted)//' values, one per '//trim(extent%name)
   end function count_rule

   !> 'must be 'a', 'b' or 'c''
   pure function word_rule(words) result(text)
      character(len=*), intent(in) :: words
      character(len=:), allocatable :: text
      integer :: k, n

      n = word_count(words)
      text = 'must be '
      do k = 1, n
         if (k > 1 .and. k == n) text = text//' or '
         if (k > 1 .and. k < n) text = text//', '
         text = text//"'"//word(words, k)//"'"
      end do
   end function word_rule

   pure function unit_text(row) result(text)
      type(schema_row), intent(in) :: row
      character(len=:), allocatable :: text
      text = ''
      if (len_trim(row%unit) > 0) text = ' ['//trim(row%unit)//']'
   end function unit_text

   !> Row of a key; 0 if the table has none.
   pure integer function row_index(rows, group, key) result(found)
      type(schema_row), intent(in) :: rows(:)
      character(len=*), intent(in) :: group, key
      do found = 1, merge(size(rows), 0, len(key) > 0)
         if (rows(found)%key(1:1) /= key(1:1)) cycle ! cheap, and true of most
         if (rows(found)%key == key .and. rows(found)%group == group) return
      end do
      found = 0
   end function row_index

   !> Place of a group in the list; 0 if it is not there.
   pure integer function group_index(groups, name) result(found)
      type(schema_group), intent(in) :: groups(:)
      character(len=*), intent(in) :: name
      do found = 1, merge(size(groups), 0, len(name) > 0)
         if (groups(found)%name(1:1) /= name(1:1)) cycle ! cheap, and true of most
         if (groups(found)%name == name) return
      end do
      found = 0
   end function group_index

   !> The key of the group that is nearest to a misspelt one.
   pure function nearest_key(rows, group, key) result(nearest)
      type(schema_row), intent(in) :: rows(:)
      character(len=*), intent(in) :: group, key
      character(len=:), allocatable :: nearest
      integer :: i, distance, least

      nearest = ''
      least = huge(least)
      do i = 1, size(rows)
         if (rows(i)%group /= group) cycle
         distance = edit_distance(trim(key), trim(rows(i)%key))
         if (distance >= least) cycle
         least = distance
         nearest = trim(rows(i)%key)
      end do
   end function nearest_key

   !> The group that is nearest to a misspelt one.
   pure function nearest_group(groups, name) result(nearest)
      type(schema_group), intent(in) :: groups(:)
      character(len=*), intent(in) :: name
      character(len=:), allocatable :: nearest
      integer :: i, distance, least

      nearest = ''
      least = huge(least)
      do i = 1, size(groups)
         distance = edit_distance(trim(name), trim(groups(i)%name))
         if (distance >= least) cycle
         least = distance
         nearest = trim(groups(i)%name)
      end do
   end function nearest_group

   !> The nearest key of the group, if it is so near that it was meant; otherwise empty.
   pure function misspelt_key(rows, group, key) result(meant)
      type(schema_row), intent(in) :: rows(:)
      character(len=*), intent(in) :: group, key
      character(len=:), allocatable :: meant
      meant = nearest_key(rows, group, key)
      if (.not. is_near(trim(key), meant)) meant = ''
   end function misspelt_key

   !> The same for a group.
   pure function misspelt_group(groups, name) result(meant)
      type(schema_group), intent(in) :: groups(:)
      character(len=*), intent(in) :: name
      character(len=:), allocatable :: meant
      meant = nearest_group(groups, name)
      if (.not. is_near(trim(name), meant)) meant = ''
   end function misspelt_group

   !> About one letter wrong of every three; two that are exchanged count twice.
   pure logical function is_near(a, b)
      character(len=*), intent(in) :: a, b
      is_near = len(a) > 1 .and. edit_distance(a, b) <= max(1, (min(len(a), len(b)) + 1)/3)
   end function is_near

end module rodyn_schema
