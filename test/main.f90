!> The test program: `tester [filter]` runs every test whose name contains the filter.
program tester
   use test_testing, only: run_suite, suite_tally, unittest
   use test_hdf5_files, only: collect_hdf5_files
   use test_kernels, only: collect_kernels
   use test_motion, only: collect_motion
   use test_run_file, only: collect_run_file
   use test_testing, only: suite_tally, unittest, run_suite
   use test_integrators, only: collect_integrators
   use test_progress, only: collect_progress
   implicit none (type, external)
   type(suite_tally) :: tally
   type(unittest), allocatable :: suite(:)
   character(len=200) :: filter

   filter = ''
   if (command_argument_count() > 0) call get_command_argument(1, filter)

   call collect_kernels(suite)
   call run_suite('kernels', suite, tally, trim(filter))
   call collect_motion(suite)
   call run_suite('motion', suite, tally, trim(filter))
   call collect_hdf5_files(suite)
   call run_suite('hdf5_files', suite, tally, trim(filter))
   call collect_run_file(suite)
   call run_suite('run_file', suite, tally, trim(filter))
   call collect_integrators(suite)
   call run_suite('integrators', suite, tally, trim(filter))
   call collect_progress(suite)
   call run_suite('progress', suite, tally, trim(filter))

   write (*, '(i0, " passed, ", i0, " failed")') tally%passed, tally%failed
   if (tally%failed > 0 .or. tally%passed == 0) stop 1, quiet=.true.
end program tester
