!> The program `rodyn`: arguments in, exit code out; everything else is in the library.
program main
   use rodyn_command_line, only: run_command
   implicit none (type, external)
   integer :: exit_code

   call run_command(exit_code)
   stop exit_code, quiet=.true.
end program main
