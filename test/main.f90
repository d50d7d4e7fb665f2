!> The test program: `tester [filter]` runs every test whose name contains the filter.
program tester
   use test_testing, only: run_suite, suite_tally, unittest
   use test_quadrature, only: collect_quadrature
   use test_article, only: collect_article
   use test_hdf5_files, only: collect_hdf5_files
   use test_kernels, only: collect_kernels
   use test_motion, only: collect_motion
   use test_run_file, only: collect_run_file
   use test_integrators, only: collect_integrators
   use test_progress, only: collect_progress
   use test_namelist, only: collect_namelist
   use test_namelist_faults, only: collect_namelist_faults
   use test_namelist_fuzz, only: collect_namelist_fuzz
   use test_case_keys, only: collect_case_keys
   use test_case_rules, only: collect_case_rules
   use test_case_reader, only: collect_case_reader
   implicit none (type, external)
   type(suite_tally) :: tally
   type(unittest), allocatable :: suite(:)
   character(len=200) :: filter

   filter = ''
   if (command_argument_count() > 0) call get_command_argument(1, filter)

   call collect_quadrature(suite)
   call run_suite('quadrature', suite, tally, trim(filter))
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
   call collect_namelist(suite)
   call run_suite('namelist', suite, tally, trim(filter))
   call collect_namelist_faults(suite)
   call run_suite('namelist_faults', suite, tally, trim(filter))
   call collect_namelist_fuzz(suite)
   call run_suite('namelist_fuzz', suite, tally, trim(filter))
   call collect_case_keys(suite)
   call run_suite('case_keys', suite, tally, trim(filter))
   call collect_case_rules(suite)
   call run_suite('case_rules', suite, tally, trim(filter))
   call collect_case_reader(suite)
   call run_suite('case_reader', suite, tally, trim(filter))
   call collect_article(suite)
   call run_suite('article', suite, tally, trim(filter))

   write (*, '(i0, " passed, ", i0, " failed")') tally%passed, tally%failed
   if (tally%failed > 0 .or. tally%passed == 0) stop 1, quiet=.true.
end program tester
