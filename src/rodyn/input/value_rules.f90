!> Does one value of a namelist keep the rules of its row?
module rodyn_value_rules
   use rodyn_kinds, only: wp
   use rodyn_namelist_document, only: namelist_document, namelist_value, string_content, is_integer, &
      is_long_integer, is_real, is_too_large, is_too_small, is_not_finite, is_logical, is_string, is_word
   use rodyn_schema, only: schema_row, type_integer, type_logical, type_real, type_word, requirement, rule_text, &
      matching_word, satisfies, up_to
   use rodyn_text, only: lower, to_text
   implicit none (type, external)
   private
   public :: broken_rule

contains

   !> The rule that a value breaks, in words; not allocated if it breaks none.
   pure subroutine broken_rule(document, row, value, rule)
      type(namelist_document), intent(in) :: document
      type(schema_row), intent(in) :: row
      type(namelist_value), intent(in) :: value
      character(len=:), allocatable, intent(out) :: rule

      select case (row%type)
      case (type_integer, type_real)
         call broken_number_rule(row, value, rule)
         if (allocated(rule)) rule = rule//number_hint(document, row, value)
      case (type_logical)
         if (value%kind /= is_logical) rule = requirement(row)
      case (type_word)
         if (value%kind /= is_string) then
            rule = requirement(row)//', in quotes'
         else if (matching_word(row, string_content(document, value)) == 0) then
            rule = requirement(row)
         end if
      case default
         if (value%kind /= is_string) then
            rule = requirement(row)
         else if (row%rule == up_to) then
            if (len(string_content(document, value)) > nint(row%high)) rule = rule_text(row)
         end if
      end select
   end subroutine broken_rule

   pure subroutine broken_number_rule(row, value, rule)
      type(schema_row), intent(in) :: row
      type(namelist_value), intent(in) :: value
      character(len=:), allocatable, intent(out) :: rule

      select case (value%kind)
      case (is_integer)
         if (.not. satisfies(row, value%x)) rule = rule_text(row)
      case (is_long_integer)
         if (row%type == type_integer) then
            rule = 'overflows a 32-bit integer'
         else if (.not. satisfies(row, value%x)) then
            rule = rule_text(row)
         end if
      case (is_real)
         if (row%type == type_integer) then
            rule = requirement(row)
         else if (.not. satisfies(row, value%x)) then
            rule = rule_text(row)
         end if
      case (is_too_large)
         rule = 'overflows double precision'
      case (is_too_small)
         rule = 'underflows double precision; write 0'
      case (is_not_finite)
         rule = 'must be finite'
      case default
         rule = requirement(row)
      end select
   end subroutine broken_number_rule

   !> What may have been meant by something that is no number, or no whole one.
   pure function number_hint(document, row, value) result(hint)
      type(namelist_document), intent(in) :: document
      type(schema_row), intent(in) :: row
      type(namelist_value), intent(in) :: value
      character(len=:), allocatable :: hint
      logical :: digits

      hint = ''
      if (value%kind == is_real .and. row%type == type_integer) then
         if (abs(value%x) < real(huge(1), wp) .and. abs(value%x - anint(value%x)) <= 0.0_wp) &
            hint = '; write '//to_text(nint(value%x))
      end if
      if (value%kind /= is_word .and. value%kind /= is_string) return
      associate (text => document%text(value%first:value%last))
         digits = scan(text, '0123456789') > 0
         if (value%kind == is_string) then
            if (digits) hint = '; without quotes'
         else if (scan(text, ';') > 0) then
            hint = '; values are separated by commas or blanks'
         else if (scan(text, '[](){}') > 0) then
            hint = '; values stand without brackets, and expressions are not computed'
         else if (index(lower(text), 'pi') > 0 .or. (digits .and. scan(text(2:), '*+-^') > 0)) then
            hint = '; expressions are not computed'
         end if
      end associate
   end function number_hint

end module rodyn_value_rules
