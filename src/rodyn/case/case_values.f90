!> Values of a case in memory as a namelist would have them, for messages.
module rodyn_case_values
   use rodyn_kinds, only: wp
   use rodyn_case_config, only: case_config, name_length
   use rodyn_case_fields, only: visit_case
   use rodyn_case_schema, only: case_rows
   use rodyn_field_visitor, only: field_visitor
   use rodyn_schema, only: any_list, row_index
   use rodyn_text, only: printable, quoted, to_text
   implicit none (type, external)
   private
   public :: value_shown, list_text, plain_text

   integer, parameter :: shown_max = 60 !! longest value quoted in a message

   !> Looks for one key.
   type, extends(field_visitor) :: value_finder
      character(len=:), allocatable :: group, key, text
      integer :: instance = 1
      logical :: here = .false. !! in the group
   contains
      procedure :: open_group
      procedure :: close_group
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

   !> A number by as few digits as give it back.
   pure function plain_text(x) result(text)
      real(wp), intent(in) :: x
      character(len=:), allocatable :: text, digits
      character(len=32) :: buffer
      character(len=12) :: format
      real(wp) :: back
      integer :: exponent, n, mark

      text = 'NaN'
      if (x > huge(x)) text = 'Infinity'
      if (x < -huge(x)) text = '-Infinity'
      if (.not. abs(x) <= huge(x)) return
      do n = 0, 16
         write (format, '(a, i0, a)') '(es28.', n, 'e4)'
         write (buffer, format) abs(x)
         read (buffer, *) back
         if (.not. abs(back - abs(x)) > 0.0_wp) exit
      end do
      buffer = adjustl(buffer)
      mark = scan(buffer, 'E')
      read (buffer(mark + 1:), *) exponent
      digits = buffer(1:1)//buffer(3:mark - 1)
      if (exponent < -3 .or. exponent > 6) then
         text = buffer(1:1)
         if (n > 0) text = buffer(:mark - 1)
         text = text//'e'//to_text(exponent)
      else if (exponent < 0) then
         text = '0.'//repeat('0', -exponent - 1)//digits
      else if (n <= exponent) then
         text = digits//repeat('0', exponent - n)
      else
         text = digits(:exponent + 1)//'.'//digits(exponent + 2:)
      end if
      if (x < 0.0_wp) text = '-'//text
   end function plain_text

   !> Is this the key?
   pure logical function found(self, key)
      type(value_finder), intent(in) :: self
      character(len=*), intent(in) :: key
      found = self%here .and. key == self%key
   end function found

   subroutine open_group(self, group, instance)
      class(value_finder), intent(inout) :: self
      character(len=*), intent(in) :: group
      integer, intent(in) :: instance
      self%here = group == self%group .and. instance == self%instance
   end subroutine open_group

   subroutine close_group(self)
      class(value_finder), intent(inout) :: self
      self%here = .false.
   end subroutine close_group

   subroutine real_field(self, key, x)
      class(value_finder), intent(inout) :: self
      character(len=*), intent(in) :: key
      real(wp), intent(inout) :: x
      if (found(self, key)) self%text = plain_text(x)
   end subroutine real_field

   subroutine array_field(self, key, x)
      class(value_finder), intent(inout) :: self
      character(len=*), intent(in) :: key
      real(wp), allocatable, intent(inout) :: x(:)
      if (.not. found(self, key) .or. .not. allocated(x)) return
      self%text = list_text(x, case_rows(row_index(case_rows, self%group, key))%extent == any_list)
   end subroutine array_field

   subroutine integer_field(self, key, x)
      class(value_finder), intent(inout) :: self
      character(len=*), intent(in) :: key
      integer, intent(inout) :: x
      if (found(self, key)) self%text = to_text(x)
   end subroutine integer_field

   subroutine logical_field(self, key, x)
      class(value_finder), intent(inout) :: self
      character(len=*), intent(in) :: key
      logical, intent(inout) :: x
      if (found(self, key)) self%text = to_text(x)
   end subroutine logical_field

   subroutine word_field(self, key, x)
      class(value_finder), intent(inout) :: self
      character(len=*), intent(in) :: key
      character(len=name_length), intent(inout) :: x
      if (found(self, key)) self%text = printable(quoted(trim(x)), shown_max)
   end subroutine word_field

   subroutine text_field(self, key, x)
      class(value_finder), intent(inout) :: self
      character(len=*), intent(in) :: key
      character(len=:), allocatable, intent(inout) :: x
      if (.not. found(self, key) .or. .not. allocated(x)) return
      self%text = printable(quoted(x), shown_max)
   end subroutine text_field

end module rodyn_case_values
