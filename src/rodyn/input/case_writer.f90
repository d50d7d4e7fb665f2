!> Prints a case as a namelist with every key and the value used. Reading it back gives the same case.
module rodyn_case_writer
   use rodyn_kinds, only: wp
   use rodyn_case_config, only: case_config, name_length
   use rodyn_case_schema, only: case_rows
   use rodyn_case_fields, only: visit_case
   use rodyn_field_visitor, only: field_visitor
   use rodyn_schema, only: row_index, satisfies
   use rodyn_text, only: quoted, to_text
   use rodyn_text_buffer, only: text_buffer
   implicit none (type, external)
   private
   public :: resolved_case

   integer, parameter :: per_line = 4 !! values of an array on one line

   !> Prints what it visits. A number that breaks its own rule stands for a value that was not given, such as
   !> the mass of a fixed spacecraft, and is left out.
   type, extends(field_visitor) :: case_writer
      type(text_buffer) :: text
      character(len=:), allocatable :: group
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
      if (.not. allocated(copy%loads)) allocate (copy%loads(0))
      if (.not. allocated(copy%kink_programs)) allocate (copy%kink_programs(0))
      if (.not. allocated(copy%hinges)) allocate (copy%hinges(0))
      if (.not. allocated(copy%profiles)) allocate (copy%profiles(0))
      call visit_case(writer, copy)
      text = writer%text%content()
   end function resolved_case

   subroutine open_group(self, group, instance)
      class(case_writer), intent(inout) :: self
      character(len=*), intent(in) :: group
      integer, intent(in) :: instance
      self%group = group
      if (instance > 1) call self%text%line('! '//group//' '//to_text(instance))
      call self%text%line('&'//group)
   end subroutine open_group

   subroutine close_group(self)
      class(case_writer), intent(inout) :: self
      call self%text%line('/')
   end subroutine close_group

   subroutine put(self, key, value)
      class(case_writer), intent(inout) :: self
      character(len=*), intent(in) :: key, value
      call self%text%line('   '//key//' = '//value)
   end subroutine put

   !> Does the number keep its rule?
   logical function is_given(self, key, x)
      class(case_writer), intent(in) :: self
      character(len=*), intent(in) :: key
      real(wp), intent(in) :: x
      is_given = satisfies(case_rows(row_index(case_rows, self%group, key)), x)
   end function is_given

   subroutine real_field(self, key, x)
      class(case_writer), intent(inout) :: self
      character(len=*), intent(in) :: key
      real(wp), intent(inout) :: x
      if (is_given(self, key, x)) call put(self, key, to_text(x))
   end subroutine real_field

   !> Runs of equal values become repeat counts.
   subroutine array_field(self, key, x)
      class(case_writer), intent(inout) :: self
      character(len=*), intent(in) :: key
      real(wp), allocatable, intent(inout) :: x(:)
      integer :: first, last, runs

      if (.not. allocated(x)) return
      if (size(x) == 0) return
      if (.not. is_given(self, key, minval(x))) return
      call self%text%append('   '//key//' = ')
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

   subroutine integer_field(self, key, x)
      class(case_writer), intent(inout) :: self
      character(len=*), intent(in) :: key
      integer, intent(inout) :: x
      if (is_given(self, key, real(x, wp))) call put(self, key, to_text(x))
   end subroutine integer_field

   subroutine logical_field(self, key, x)
      class(case_writer), intent(inout) :: self
      character(len=*), intent(in) :: key
      logical, intent(inout) :: x
      call put(self, key, to_text(x))
   end subroutine logical_field

   subroutine word_field(self, key, x)
      class(case_writer), intent(inout) :: self
      character(len=*), intent(in) :: key
      character(len=name_length), intent(inout) :: x
      call put(self, key, quoted(trim(x)))
   end subroutine word_field

   subroutine text_field(self, key, x)
      class(case_writer), intent(inout) :: self
      character(len=*), intent(in) :: key
      character(len=:), allocatable, intent(inout) :: x
      if (allocated(x)) then
         call put(self, key, quoted(x))
      else
         call put(self, key, quoted(''))
      end if
   end subroutine text_field

end module rodyn_case_writer
