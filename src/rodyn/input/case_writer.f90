!> Prints a case as a namelist with every key and the value used. Reading it back gives the same case.
module rodyn_case_writer
   use rodyn_kinds, only: wp
   use rodyn_case_config, only: case_config, visit_case
   use rodyn_field_visitor, only: field_visitor
   use rodyn_schema, only: schema_group, schema_row, name_length, satisfies
   use rodyn_text, only: quoted, text_or_empty, to_text
   use rodyn_text_buffer, only: text_buffer
   implicit none (type, external)
   private
   public :: resolved_case

   integer, parameter :: per_line = 4 !! values of an array on one line

   !> Prints what it visits. A number that breaks its own rule stands for a value that was not given, such as
   !> the mass of a fixed spacecraft, and is left out.
   type, extends(field_visitor) :: case_writer
      type(text_buffer) :: text
   contains
      procedure :: open_group
      procedure :: close_group
      procedure :: real_field
      procedure :: array_field
      procedure :: integer_field
      procedure :: logical_field
      procedure :: word_field
      procedure :: text_field
   end type case_writer

contains

   !> The whole case as a namelist: all keys that the case has, numbers with 17 significant digits.
   function resolved_case(config) result(text)
      type(case_config), intent(in) :: config
      character(len=:), allocatable :: text
      type(case_config) :: copy
      type(case_writer) :: writer

      copy = config ! a visitor may change what it visits; this one does not
      call visit_case(writer, copy)
      text = writer%text%content()
   end function resolved_case

   subroutine open_group(self, group, instance)
      class(case_writer), intent(inout) :: self
      type(schema_group), intent(in) :: group
      integer, intent(in) :: instance
      if (instance > 1) call self%text%line('! '//trim(group%name)//' '//to_text(instance))
      call self%text%line('&'//trim(group%name))
   end subroutine open_group

   subroutine close_group(self)
      class(case_writer), intent(inout) :: self
      call self%text%line('/')
   end subroutine close_group

   subroutine put(self, row, value)
      class(case_writer), intent(inout) :: self
      type(schema_row), intent(in) :: row
      character(len=*), intent(in) :: value
      call self%text%line('   '//trim(row%key)//' = '//value)
   end subroutine put

   subroutine real_field(self, x, row)
      class(case_writer), intent(inout) :: self
      real(wp), intent(inout) :: x
      type(schema_row), intent(in) :: row
      if (satisfies(row, x)) call put(self, row, to_text(x))
   end subroutine real_field

   !> Runs of equal values become repeat counts.
   subroutine array_field(self, x, row)
      class(case_writer), intent(inout) :: self
      real(wp), allocatable, intent(inout) :: x(:)
      type(schema_row), intent(in) :: row
      integer :: first, last, runs

      if (.not. allocated(x)) return
      if (size(x) == 0) return
      if (.not. satisfies(row, minval(x))) return
      call self%text%append('   '//trim(row%key)//' = ')
      runs = 0
      first = lbound(x, 1)
      do while (first <= ubound(x, 1))
         last = end_of_run(x, first - lbound(x, 1) + 1) + lbound(x, 1) - 1
         if (runs > 0) call self%text%append(', ')
         if (runs > 0 .and. modulo(runs, per_line) == 0) call self%text%append(new_line('a')//'      ')
         if (last > first) call self%text%append(to_text(last - first + 1)//'*')
         call self%text%append(to_text(x(first)))
         runs = runs + 1
         first = last + 1
      end do
      call self%text%line('')
   end subroutine array_field

   !> Last of the values from `first` on that have the same bits (0 and -0 differ).
   pure integer function end_of_run(x, first) result(last)
      real(wp), intent(in) :: x(:)
      integer, intent(in) :: first
      last = first
      do while (last < size(x))
         if (abs(x(last + 1) - x(first)) > 0.0_wp) return
         if (sign(1.0_wp, x(last + 1))*sign(1.0_wp, x(first)) < 0.0_wp) return
         last = last + 1
      end do
   end function end_of_run

   subroutine integer_field(self, x, row)
      class(case_writer), intent(inout) :: self
      integer, intent(inout) :: x
      type(schema_row), intent(in) :: row
      if (satisfies(row, real(x, wp))) call put(self, row, to_text(x))
   end subroutine integer_field

   subroutine logical_field(self, x, row)
      class(case_writer), intent(inout) :: self
      logical, intent(inout) :: x
      type(schema_row), intent(in) :: row
      call put(self, row, to_text(x))
   end subroutine logical_field

   subroutine word_field(self, x, row)
      class(case_writer), intent(inout) :: self
      character(len=name_length), intent(inout) :: x
      type(schema_row), intent(in) :: row
      call put(self, row, quoted(trim(x)))
   end subroutine word_field

   subroutine text_field(self, x, row)
      class(case_writer), intent(inout) :: self
      character(len=:), allocatable, intent(inout) :: x
      type(schema_row), intent(in) :: row
      call put(self, row, quoted(text_or_empty(x)))
   end subroutine text_field

end module rodyn_case_writer
