!> The test program: `tester [filter]` runs every test whose name contains the filter.
program tester
   use test_testing, only: suite_tally
   implicit none (type, external)
   type(suite_tally) :: tally
   character(len=200) :: filter

   filter = ''
   if (command_argument_count() > 0) call get_command_argument(1, filter)

   write (*, '(i0, " passed, ", i0, " failed")') tally%passed, tally%failed
   if (tally%failed > 0 .or. tally%passed == 0) error stop 1, quiet=.true.
end program tester
