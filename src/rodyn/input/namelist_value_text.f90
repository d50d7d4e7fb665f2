!> What a bare word of a namelist means: a number, a truth value, or neither.
!>
!> The grammar is checked before any conversion, and overflow is decided from the digits, so that no
!> floating-point exception can arise and NaN, Inf and 1e999 never become numbers.
module rodyn_namelist_value_text
   use rodyn_kinds, only: wp, i8
   use rodyn_namelist_document, only: namelist_value, is_integer, is_long_integer, is_real, is_too_large, &
      is_too_small, is_not_finite, is_logical, is_word
   use rodyn_text, only: is_digit, lower
   implicit none (type, external)
   private
   public :: classify

   integer, parameter :: longest_number = 400        !! characters; more digits than any real has
   integer, parameter :: largest_exponent = 308      !! of huge(1.0_wp) = 1.7976931348623157e308
   integer, parameter :: smallest_exponent = -324    !! of the least subnormal, 4.94e-324
   character(len=17), parameter :: largest_digits = '17976931348623157'

   !> The parts of a decimal number that decide its size.
   type :: decimal
      logical :: valid = .false.     !! follows the grammar
      logical :: whole = .true.      !! neither point nor exponent
      character(len=17) :: digits = '00000000000000000' !! leading significant digits
      integer :: n_digits = 0        !! significant digits seen; 0: the number is zero
      integer :: exponent = 0        !! d.ddd * 10**exponent
   end type decimal

contains

   !> Set kind and value from the text of a bare word.
   pure subroutine classify(text, value)
      character(len=*), intent(in) :: text
      type(namelist_value), intent(inout) :: value

      select case (lower(text))
      case ('t', '.t.', 'true', '.true.')
         value%kind = is_logical
         value%truth = .true.
      case ('f', '.f.', 'false', '.false.')
         value%kind = is_logical
         value%truth = .false.
      case default
         value%kind = is_word
         if (names_no_number(lower(text))) then
            value%kind = is_not_finite
         else if (len(text) > 0 .and. len(text) <= longest_number) then
            call convert(text, split(text), value)
         end if
      end select
   end subroutine classify

   !> nan, nan(...), inf, infinity, with or without a sign
   pure logical function names_no_number(text)
      character(len=*), intent(in) :: text
      integer :: first
      first = 1
      if (len(text) > 1 .and. scan(text(1:1), '+-') == 1) first = 2
      names_no_number = text(first:) == 'inf' .or. text(first:) == 'infinity' .or. text(first:) == 'nan' &
         .or. index(text(first:), 'nan(') == 1
   end function names_no_number

   pure subroutine convert(text, number, value)
      character(len=*), intent(in) :: text
      type(decimal), intent(in) :: number
      type(namelist_value), intent(inout) :: value
      integer :: stat

      if (.not. number%valid) return
      if (number%exponent > largest_exponent .or. &
          (number%exponent == largest_exponent .and. number%digits > largest_digits)) then
         value%kind = is_too_large
      else if (number%exponent < smallest_exponent) then
         value%kind = is_too_small
      else
         value%kind = is_real
         read (text, *, iostat=stat) value%x
         if (stat /= 0) value%kind = is_word
         if (number%n_digits > 0 .and. abs(value%x) <= 0.0_wp) value%kind = is_too_small
         if (number%whole) call convert_integer(text, number, value)
      end if
   end subroutine convert

   pure subroutine convert_integer(text, number, value)
      character(len=*), intent(in) :: text
      type(decimal), intent(in) :: number
      type(namelist_value), intent(inout) :: value
      integer(i8) :: i

      value%kind = is_long_integer
      if (number%exponent > 9) return
      read (text, *) i
      if (abs(i) > huge(1)) return
      value%kind = is_integer
      value%number = int(i)
   end subroutine convert_integer

   !> Check  [sign] digits [. digits] [e|d [sign] digits]  and find the size.
   pure function split(text) result(number)
      character(len=*), intent(in) :: text
      type(decimal) :: number
      integer :: at, n_mantissa

      at = 1
      if (scan(text(1:1), '+-') == 1) at = 2
      number%exponent = -1
      n_mantissa = 0
      call take_digits(text, at, 1, number, n_mantissa)
      if (at <= len(text)) then
         if (text(at:at) == '.') then
            number%whole = .false.
            at = at + 1
            call take_digits(text, at, 0, number, n_mantissa)
         end if
      end if
      if (n_mantissa == 0) return
      if (at <= len(text)) then
         call take_exponent(text, at, number)
      else
         number%valid = .true.
      end if
      if (number%n_digits == 0) number%exponent = 0
   end function split

   !> Digits before (`before` = 1) or after (0) the decimal point.
   pure subroutine take_digits(text, at, before, number, n_mantissa)
      character(len=*), intent(in) :: text
      integer, intent(inout) :: at
      integer, intent(in) :: before
      type(decimal), intent(inout) :: number
      integer, intent(inout) :: n_mantissa

      do while (at <= len(text))
         if (.not. is_digit(text(at:at))) return
         n_mantissa = n_mantissa + 1
         if (number%n_digits > 0 .or. text(at:at) /= '0') then
            number%n_digits = number%n_digits + 1
            if (number%n_digits <= 17) number%digits(number%n_digits:number%n_digits) = text(at:at)
            number%exponent = number%exponent + before
         else if (before == 0) then
            number%exponent = number%exponent - 1
         end if
         at = at + 1
      end do
   end subroutine take_digits

   !> The exponent must end the text. Exponents of more than six digits are taken as 999999.
   pure subroutine take_exponent(text, at, number)
      character(len=*), intent(in) :: text
      integer, intent(in) :: at
      type(decimal), intent(inout) :: number
      integer :: first, i, power

      if (scan(text(at:at), 'eEdD') == 0) return
      first = at + 1
      if (first > len(text)) return
      if (scan(text(first:first), '+-') == 1) first = first + 1
      if (first > len(text)) return
      if (verify(text(first:), '0123456789') /= 0) return
      power = 0
      do i = first, len(text)
         power = min(999999, 10*power + ichar(text(i:i)) - ichar('0'))
      end do
      if (text(at + 1:at + 1) == '-') power = -power
      number%exponent = number%exponent + power
      number%whole = .false.
      number%valid = .true.
   end subroutine take_exponent

end module rodyn_namelist_value_text
