!> Values of a case in memory as a namelist would have them, for messages.
module rodyn_case_values
   use rodyn_kinds, only: wp
   use rodyn_case_config, only: case_config, visit_case
   use rodyn_field_visitor, only: field_visitor
   use rodyn_schema, only: schema_group, schema_row, name_length, any_list
   use rodyn_text, only: plain_text, printable, quoted, to_text
   implicit none (type, external)
   private
   public :: value_shown, list_text

   integer, parameter :: shown_max = 60 !! longest value quoted in a message

   !> Looks for one key.
   type, extends(field_visitor) :: value_finder
      character(len=:), allocatable :: group, key, text
      integer :: instance = 1
      logical :: here = .false. !! in the group
   contains
      procedure :: open_group
      procedure :: real_field
      procedure :: array_field
      procedure :: integer_field
      procedure :: logical_field
      procedure :: word_field
      procedure :: text_field
   end type value_finder

contains

   !> ' = value' of a key; empty if it has none.
   function value_shown(config, group, instance, key) result(text)
      type(case_config), intent(inout) :: config !! not changed
      character(len=*), intent(in) :: group, key
      integer, intent(in) :: instance
      character(len=:), allocatable :: text
      type(value_finder) :: finder

      finder%every_key = .true.
      finder%group = group
      finder%key = key
      finder%instance = instance
      finder%text = ''
      call visit_case(finder, config)
      text = finder%text
      if (len(text) > 0) text = ' = '//text
   end function value_shown

   !> Values of an array, equal ones counted: '2*1, 0'; a single value if all are equal.
   pure function list_text(x, as_list) result(text)
      real(wp), intent(in) :: x(:)
      logical, intent(in) :: as_list !! one value does not stand for all
      character(len=:), allocatable :: text
      integer :: first, last

      text = ''
      first = 1
      do while (first <= size(x))
         if (len(text) > shown_max) then
            text = text//', ...'
            return
         end if
         last = first
         do while (last < size(x))
            if (.not. abs(x(last + 1) - x(first)) <= 0.0_wp) exit
            last = last + 1
         end do
         if (first > 1) text = text//', '
         if (last > first .and. (as_list .or. last - first + 1 < size(x))) text = text//to_text(last - first + 1)//'*'
         text = text//plain_text(x(first))
         first = last + 1
      end do
   end function list_text

   !> Is this the key?
   pure logical function found(self, row)
      type(value_finder), intent(in) :: self
      type(schema_row), intent(in) :: row
      found = self%here .and. row%key == self%key
   end function found

   subroutine open_group(self, group, instance)
      class(value_finder), intent(inout) :: self
      type(schema_group), intent(in) :: group
      integer, intent(in) :: instance
      self%here = group%name == self%group .and. instance == self%instance
   end subroutine open_group

   subroutine real_field(self, x, row)
      class(value_finder), intent(inout) :: self
      real(wp), intent(inout) :: x
      type(schema_row), intent(in) :: row
      if (found(self, row)) self%text = plain_text(x)
   end subroutine real_field

   subroutine array_field(self, x, row)
      class(value_finder), intent(inout) :: self
      real(wp), allocatable, intent(inout) :: x(:)
      type(schema_row), intent(in) :: row
      if (.not. found(self, row) .or. .not. allocated(x)) return
      self%text = list_text(x, row%extent == any_list)
   end subroutine array_field

   subroutine integer_field(self, x, row)
      class(value_finder), intent(inout) :: self
      integer, intent(inout) :: x
      type(schema_row), intent(in) :: row
      if (found(self, row)) self%text = to_text(x)
   end subroutine integer_field

   subroutine logical_field(self, x, row)
      class(value_finder), intent(inout) :: self
      logical, intent(inout) :: x
      type(schema_row), intent(in) :: row
      if (found(self, row)) self%text = to_text(x)
   end subroutine logical_field

   subroutine word_field(self, x, row)
      class(value_finder), intent(inout) :: self
      character(len=name_length), intent(inout) :: x
      type(schema_row), intent(in) :: row
      if (found(self, row)) self%text = printable(quoted(trim(x)), shown_max)
   end subroutine word_field

   subroutine text_field(self, x, row)
      class(value_finder), intent(inout) :: self
      character(len=:), allocatable, intent(inout) :: x
      type(schema_row), intent(in) :: row
      if (.not. found(self, row) .or. .not. allocated(x)) return
      self%text = printable(quoted(x), shown_max)
   end subroutine text_field

end module rodyn_case_values
