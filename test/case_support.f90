!> A small valid case, and a check of the exact message that a text is refused with.
module test_case_support
   use rodyn_case_config, only: case_config
   use rodyn_case_reader, only: parse_case
   use rodyn_errors, only: error_type, raise, exit_bad_input
   use test_testing, only: check
   implicit none (type, external)
   private
   public :: nl, spacecraft, chain, valid, expect_faults, expect_accepted

   character(len=1), parameter :: nl = new_line('a')
   character(len=*), parameter :: spacecraft = '&spacecraft mass = 100, inertia = 10 /'//nl
   character(len=*), parameter :: chain = &
      '&chain n_rods = 4, length = 1.5, mass_per_length = 1, bending_stiffness = 1e4, hinge_stiffness = 4e3 /'//nl
   character(len=*), parameter :: valid = spacecraft//chain !! two lines

contains

   !> The text must be refused with this message, and with exit code 2.
   subroutine expect_faults(error, text, message)
      type(error_type), allocatable, intent(out) :: error
      character(len=*), intent(in) :: text, message
      type(case_config) :: config
      type(error_type), allocatable :: refusal

      call parse_case(text, 'c.nml', config, refusal)
      if (.not. allocated(refusal)) then
         call raise(error, 'accepted, instead of: '//message)
         return
      end if
      call check(error, refusal%message, message, 'message')
      if (allocated(error)) return
      call check(error, refusal%exit_code, exit_bad_input, 'exit code')
   end subroutine expect_faults

   !> The text must be accepted.
   subroutine expect_accepted(error, text, config)
      type(error_type), allocatable, intent(out) :: error
      character(len=*), intent(in) :: text
      type(case_config), intent(out) :: config
      call parse_case(text, 'c.nml', config, error)
   end subroutine expect_accepted

end module test_case_support
