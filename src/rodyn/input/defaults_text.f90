!> A complete commented namelist from a schema: every key with its unit, rule, default and meaning.
module rodyn_defaults_text
   use rodyn_schema, only: schema_group, schema_row, schema_extent, any_list, rule_text, type_text, type_word
   use rodyn_text_buffer, only: text_buffer
   implicit none (type, external)
   private
   public :: defaults_text

   integer, parameter :: assignment_width = 32 !! columns before the comment

contains

   !> Keys with a default stand with it, required ones with an example; the rest is commented out.
   function defaults_text(groups, rows, extents, heading) result(text)
      type(schema_group), intent(in) :: groups(:)
      type(schema_row), intent(in) :: rows(:)
      type(schema_extent), intent(in) :: extents(:)
      character(len=*), intent(in) :: heading !! comment lines to begin with
      character(len=:), allocatable :: text
      type(text_buffer) :: buffer
      integer :: g, r

      call buffer%append(heading)
      do g = 1, size(groups)
         call buffer%line('')
         call buffer%line('! '//trim(groups(g)%help))
         call buffer%line('&'//trim(groups(g)%name))
         do r = 1, size(rows)
            if (rows(r)%group == groups(g)%name) call buffer%line(row_line(rows(r), extents))
         end do
         call buffer%line('/')
      end do
      text = buffer%content()
   end function defaults_text

   !> '   length = 1.5     ! [m] one per rod; required; must be positive; length l of each rod'
   function row_line(row, extents) result(line)
      type(schema_row), intent(in) :: row
      type(schema_extent), intent(in) :: extents(:)
      character(len=:), allocatable :: line
      character(len=assignment_width) :: assignment
      logical :: no_value

      no_value = row%default == 'required' .or. row%default == 'depends'
      if (no_value .and. len_trim(row%example) == 0) then
         assignment = '   ! '//trim(row%key)//' ='
      else if (no_value) then
         assignment = '   '//trim(row%key)//' = '//trim(row%example)
      else
         assignment = '   '//trim(row%key)//' = '//trim(row%default)
      end if
      line = assignment//' ! '//trim(row%help)//notes(row, extents)
   end function row_line

   !> Unit, extent, rule and default, in parentheses.
   function notes(row, extents) result(text)
      type(schema_row), intent(in) :: row
      type(schema_extent), intent(in) :: extents(:)
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
         text = text//'; default '//trim(row%default)
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

end module rodyn_defaults_text
