!> A complete commented namelist: every key that a visit passes, with its unit, rule, default and meaning.
module rodyn_defaults_writer
   use rodyn_kinds, only: wp
   use rodyn_field_visitor, only: field_visitor
   use rodyn_schema, only: schema_extent, schema_group, schema_row, name_length, any_list, rule_text, type_real
   use rodyn_text, only: plain_text, quoted, to_text
   use rodyn_text_buffer, only: text_buffer
   implicit none (type, external)
   private
   public :: defaults_writer, new_defaults_writer

   integer, parameter :: assignment_width = 32 !! columns before the comment

   !> Prints what it visits, a configuration that has its initial values. Keys with a default stand with it, required ones with
   !> an example; the rest is commented out.
   type, extends(field_visitor) :: defaults_writer
      type(text_buffer) :: text
      type(schema_extent), allocatable :: extents(:)
   contains
      procedure :: open_group
      procedure :: close_group
      procedure :: real_field
      procedure :: any_field
      procedure :: integer_field
      procedure :: logical_field
      procedure :: word_field
   end type defaults_writer

contains

   subroutine new_defaults_writer(self, extents, heading)
      type(defaults_writer), intent(out) :: self
      type(schema_extent), intent(in) :: extents(:) !! what arrays run over
      character(len=*), intent(in) :: heading       !! comment lines to begin with
      self%every_key = .true.
      self%extents = extents
      call self%text%append(heading)
   end subroutine new_defaults_writer

   subroutine open_group(self, group, instance)
      class(defaults_writer), intent(inout) :: self
      type(schema_group), intent(in) :: group
      integer, intent(in) :: instance
      associate (unused => instance); end associate
      call self%text%line('')
      call self%text%line('! '//trim(group%help))
      call self%text%line('&'//trim(group%name))
   end subroutine open_group

   subroutine close_group(self)
      class(defaults_writer), intent(inout) :: self
      call self%text%line('/')
   end subroutine close_group

   subroutine real_field(self, x, row)
      class(defaults_writer), intent(inout) :: self
      real(wp), intent(inout) :: x
      type(schema_row), intent(in) :: row
      if (len_trim(row%default) > 0) then ! x is what stands for 'not given', perhaps too large for a text of fewer digits
         call put(self, row, '')
      else
         call put(self, row, decimal(x))
      end if
   end subroutine real_field

   subroutine integer_field(self, x, row)
      class(defaults_writer), intent(inout) :: self
      integer, intent(inout) :: x
      type(schema_row), intent(in) :: row
      call put(self, row, to_text(x))
   end subroutine integer_field

   subroutine logical_field(self, x, row)
      class(defaults_writer), intent(inout) :: self
      logical, intent(inout) :: x
      type(schema_row), intent(in) :: row
      call put(self, row, to_text(x))
   end subroutine logical_field

   subroutine word_field(self, x, row)
      class(defaults_writer), intent(inout) :: self
      character(len=name_length), intent(inout) :: x
      type(schema_row), intent(in) :: row
      call put(self, row, quoted(trim(x)))
   end subroutine word_field

   !> Lists and texts: an array of numbers has zeros, a text is empty.
   subroutine any_field(self, row, type)
      class(defaults_writer), intent(inout) :: self
      type(schema_row), intent(in) :: row
      integer, intent(in) :: type
      if (type == type_real) then
         call put(self, row, '0.0')
      else
         call put(self, row, "''")
      end if
   end subroutine any_field

   !> A number by few digits, with a decimal point: '1.0e-8'.
   pure function decimal(x) result(text)
      real(wp), intent(in) :: x
      character(len=:), allocatable :: text
      integer :: last !! of what stands before an exponent

      text = plain_text(x)
      if (index(text, '.') > 0) return
      last = scan(text//'e', 'e') - 1
      text = text(:last)//'.0'//text(last + 1:)
   end function decimal

   !> '   length = 1.5     ! length l of each rod [m]; one per rod; must be positive; required'
   subroutine put(self, row, initial)
      class(defaults_writer), intent(inout) :: self
      type(schema_row), intent(in) :: row
      character(len=*), intent(in) :: initial !! value, the default if the key has one
      character(len=assignment_width) :: assignment

      if (len_trim(row%default) == 0) then
         assignment = '   '//trim(row%key)//' = '//initial
      else if (len_trim(row%example) > 0) then
         assignment = '   '//trim(row%key)//' = '//trim(row%example)
      else
         assignment = '   ! '//trim(row%key)//' ='
      end if
      call self%text%line(assignment//' ! '//trim(row%help)//notes(row, self%extents, initial))
   end subroutine put

   !> Unit, extent, rule and default.
   function notes(row, extents, initial) result(text)
      type(schema_row), intent(in) :: row
      type(schema_extent), intent(in) :: extents(:)
      character(len=*), intent(in) :: initial
      character(len=:), allocatable :: text

      text = ''
      if (len_trim(row%unit) > 0) text = ' ['//trim(row%unit)//']'
      if (row%extent > 0) text = text//'; one per '//trim(extents(row%extent)%name)
      if (row%extent == any_list) text = text//'; a list'
      if (len(rule_text(row)) > 0) text = text//'; '//rule_without_unit(row)
      select case (row%default)
      case ('required')
         text = text//'; required'
      case ('depends')
         text = text//'; '//trim(row%when)
      case default
         text = text//'; default '//initial
      end select
   end function notes

   function rule_without_unit(row) result(text)
      type(schema_row), intent(in) :: row
      character(len=:), allocatable :: text
      type(schema_row) :: plain
      plain = row
      plain%unit = ''
      text = rule_text(plain)
   end function rule_without_unit

end module rodyn_defaults_writer
