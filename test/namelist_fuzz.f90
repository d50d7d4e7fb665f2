!> Thousands of damaged texts: whatever the damage, the reader returns, and never with a number that is none.
module test_namelist_fuzz
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use rodyn_kinds, only: i8, wp
   use rodyn_case_config, only: case_config
   use rodyn_case_reader, only: default_case, parse_case
   use rodyn_errors, only: error_type, exit_bad_input
   use test_case_support, only: nl, valid
   use test_testing, only: check, new_test, unittest
   implicit none (type, external)
   private
   public :: collect_namelist_fuzz

   character(len=*), parameter :: rich = valid//"&case title = 'it''s', t_end = 2.5e0 / ! comment"//nl// &
      '&initial phi = 2*0.5, -1d-1 2, alpha(2:3) = .5 6e-1, beta(1) = 1 /'//nl// &
      "&load law = 'table', times = 0 0.1 0.7, values = 3*0.2, component = 'X' /"//nl// &
      "&load law = ""sine_squared"", value = -1500, rate = 0.3, t_start = .05 /"//nl// &
      "&solver method = 'erk', fixed_step = 1.1e-3, order = 5 /"//nl//'&output ledger = .false. /'//nl
   character(len=12), parameter :: pieces(20) = [character(len=12) :: 'nan', 'inf', '1e999', "'", '"', '/', '&', &
      '=', ',', '(', ')', '!', '*', '999999999*1', ' -', 'e', '1:2', ';', '&load', '/ &']

contains

   subroutine collect_namelist_fuzz(suite)
      type(unittest), allocatable, intent(out) :: suite(:)
      suite = [ &
         new_test('three thousand damaged texts neither crash the reader nor slip a bad number in', damaged_texts), &
         new_test('every beginning of a text is survived', beginnings)]
   end subroutine collect_namelist_fuzz

   subroutine damaged_texts(error)
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: text
      integer(i8) :: seed
      integer :: i, k

      seed = 20170707_i8
      do i = 1, 3000
         text = rich
         if (modulo(i, 4) == 0) text = default_case()
         do k = 1, 1 + random(seed, 6)
            call damage(text, seed)
         end do
         call check_text(text, error)
         if (allocated(error)) return
      end do
   end subroutine damaged_texts

   subroutine beginnings(error)
      type(error_type), allocatable, intent(out) :: error
      integer :: i
      do i = 0, len(rich)
         call check_text(rich(:i), error)
         if (allocated(error)) return
      end do
   end subroutine beginnings

   !> A number 0..n-1, the same on every machine.
   integer function random(seed, n)
      integer(i8), intent(inout) :: seed
      integer, intent(in) :: n
      seed = modulo(seed*48271_i8, 2147483647_i8)
      random = int(modulo(seed/7_i8, int(n, i8)))
   end function random

   !> One random change: a byte, a piece, a cut, a copy or a swap.
   subroutine damage(text, seed)
      character(len=:), allocatable, intent(inout) :: text
      integer(i8), intent(inout) :: seed
      integer :: at, last

      if (len(text) < 4) return
      at = 1 + random(seed, len(text))
      last = min(len(text), at + random(seed, 20))
      select case (random(seed, 6))
      case (0)
         text(at:at) = char(random(seed, 256))
      case (1)
         text = text(:at - 1)//trim(pieces(1 + random(seed, size(pieces))))//text(at:)
      case (2)
         text = text(:at - 1)//text(last + 1:)
      case (3)
         text = text(:last)//text(at:)
      case (4)
         text = text(at:)//text(:at - 1)
      case default
         text = text(:at - 1)//trim(pieces(1 + random(seed, size(pieces))))//text(last + 1:)
      end select
   end subroutine damage

   !> Refused with a message and exit code 2, or accepted with finite numbers that keep the rules.
   subroutine check_text(text, error)
      character(len=*), intent(in) :: text
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: refusal
      type(case_config) :: config

      call parse_case(text, 'f', config, refusal)
      if (allocated(refusal)) then
         call check(error, refusal%exit_code == exit_bad_input .and. index(refusal%message, 'f:') == 1, &
            refusal%message//' for '//text)
      else
         call check(error, all(ieee_is_finite([config%t_end, config%spacecraft%mass, config%chain%length, &
            config%chain%hinge_stiffness, config%initial%phi, config%initial%alpha, config%loads%value, &
            config%loads%t_end, config%loads%rate, config%solver%fixed_step])) .and. &
            all(config%chain%length > 0.0_wp) .and. config%t_end > 0.0_wp .and. &
            size(config%chain%length) == config%chain%n_rods, 'bad numbers for '//text)
      end if
   end subroutine check_text

end module test_namelist_fuzz
