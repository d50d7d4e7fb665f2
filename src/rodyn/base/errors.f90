!> Failures as values: an allocated error means that the call failed. Only `app/` ends the program.
module rodyn_errors
   implicit none (type, external)
   private
   public :: error_type, raise
   public :: exit_done, exit_failed, exit_bad_input, exit_stopped

   !> Exit codes of the program, as `rodyn --help` lists them.
   integer, parameter :: exit_done = 0, exit_failed = 1, exit_bad_input = 2, exit_stopped = 75

   !> What went wrong, in words for the user.
   type :: error_type
      character(len=:), allocatable :: message !! complete; may hold several lines
      integer :: exit_code = exit_failed       !! what the program should end with
   end type error_type

contains

   !> Allocate `error`; the caller returns next.
   subroutine raise(error, message, exit_code)
      type(error_type), allocatable, intent(out) :: error !! allocated on return
      character(len=*), intent(in) :: message             !! text for the user
      integer, intent(in), optional :: exit_code          !! default: exit_failed

      allocate (error)
      error%message = message
      if (present(exit_code)) error%exit_code = exit_code
   end subroutine raise

end module rodyn_errors
