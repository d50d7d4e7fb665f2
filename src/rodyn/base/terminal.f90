!> Lines for whoever reads along. A reader who has gone (`rodyn run a.nml | head -1`, a closed terminal) or a full disk costs
!> the lines, not the run; where lines are the result, `write_text` of `rodyn_posix` returns failures.
module rodyn_terminal
   use rodyn_posix, only: standard_error, standard_output, write_text
   implicit none (type, external)
   private
   public :: print_line, print_error_line, print_error_text

contains

   !> A line on standard output, at once.
   subroutine print_line(line)
      character(len=*), intent(in) :: line
      character(len=:), allocatable :: ignored
      ignored = write_text(standard_output, line//new_line('a'))
   end subroutine print_line

   !> A line on standard error.
   subroutine print_error_line(line)
      character(len=*), intent(in) :: line
      call print_error_text(line//new_line('a'))
   end subroutine print_error_line

   !> A text on standard error as it is.
   subroutine print_error_text(text)
      character(len=*), intent(in) :: text
      character(len=:), allocatable :: ignored
      ignored = write_text(standard_error, text)
   end subroutine print_error_text

end module rodyn_terminal
