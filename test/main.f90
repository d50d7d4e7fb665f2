!> The test program: `tester [filter]` runs every test whose name contains the filter.
program tester
   use test_namelist, only: collect_namelist
   use test_namelist_faults, only: collect_namelist_faults
   use test_namelist_fuzz, only: collect_namelist_fuzz
   use test_case_keys, only: collect_case_keys
   use test_case_rules, only: collect_case_rules
   use test_case_reader, only: collect_case_reader
   use test_schema, only: collect_schema
   use test_testing, only: run_suite, suite_tally, unittest
   implicit none (type, external)
   type(suite_tally) :: tally
   type(unittest), allocatable :: suite(:)
   character(len=200) :: filter

   filter = ''
   if (command_argument_count() > 0) call get_command_argument(1, filter)

   call collect_namelist(suite)
   call run_suite('namelist', suite, tally, trim(filter))
   call collect_namelist_faults(suite)
   call run_suite('namelist_faults', suite, tally, trim(filter))
   call collect_namelist_fuzz(suite)
   call run_suite('namelist_fuzz', suite, tally, trim(filter))
   call collect_schema(suite)
   call run_suite('schema', suite, tally, trim(filter))
   call collect_case_keys(suite)
   call run_suite('case_keys', suite, tally, trim(filter))
   call collect_case_rules(suite)
   call run_suite('case_rules', suite, tally, trim(filter))
   call collect_case_reader(suite)
   call run_suite('case_reader', suite, tally, trim(filter))

   write (*, '(i0, " passed, ", i0, " failed")') tally%passed, tally%failed
   if (tally%failed > 0 .or. tally%passed == 0) error stop 1, quiet=.true.
end program tester
