!> The test program: `tester [--all] [filter]` runs every test whose name contains the filter, `tester '!filter'` every other.
!> Tests that take long run with --all, or when a filter is given.
program tester
   use test_testing, only: run_suite, suite_tally, unittest
   use test_article, only: collect_article
   use test_case_check, only: collect_case_check
   use test_case_keys, only: collect_case_keys
   use test_case_reader, only: collect_case_reader
   use test_case_rules, only: collect_case_rules
   use test_condensed, only: collect_condensed
   use test_gauss, only: collect_gauss
   use test_balance, only: collect_balance
   use test_beams, only: collect_beams
   use test_invariants, only: collect_invariants
   use test_ensemble, only: collect_ensemble
   use test_hdf5_files, only: collect_hdf5_files
   use test_integrators, only: collect_integrators
   use test_kernels, only: collect_kernels
   use test_lanes, only: collect_lanes
   use test_ledger, only: collect_ledger
   use test_locks, only: collect_locks
   use test_driver, only: collect_driver
   use test_method_choice, only: collect_method_choice
   use test_held_modes, only: collect_held_modes
   use test_modes, only: collect_modes
   use test_motion, only: collect_motion
   use test_moving, only: collect_moving
   use test_newton, only: collect_newton
   use test_namelist, only: collect_namelist
   use test_namelist_faults, only: collect_namelist_faults
   use test_namelist_fuzz, only: collect_namelist_fuzz
   use test_progress, only: collect_progress
   use test_quadrature, only: collect_quadrature
   use test_quantities, only: collect_quantities
   use test_rod_profiles, only: collect_rod_profiles
   use test_run_file, only: collect_run_file
   use test_schema, only: collect_schema
   use test_step_limit, only: collect_step_limit
   use test_sweep, only: collect_sweep
   use test_switches, only: collect_switches
   use test_rod_forces, only: collect_rod_forces
   use test_validity, only: collect_validity
   implicit none (type, external)

   abstract interface
      subroutine collect_interface(suite)
         import :: unittest
         implicit none (type, external)
         type(unittest), allocatable, intent(out) :: suite(:)
      end subroutine collect_interface
   end interface

   type(suite_tally) :: tally
   character(len=200) :: filter
   logical :: all

   filter = ''
   if (command_argument_count() > 0) call get_command_argument(1, filter)
   all = filter /= '' ! a filter, or --all
   if (filter == '--all') call get_command_argument(2, filter)

   call run('quadrature', collect_quadrature)
   call run('rod_profiles', collect_rod_profiles)
   call run('kernels', collect_kernels)
   call run('locks', collect_locks)
   call run('lanes', collect_lanes)
   call run('motion', collect_motion)
   call run('modes', collect_modes)
   call run('held_modes', collect_held_modes)
   call run('moving', collect_moving)
   call run('switches', collect_switches)
   call run('balance', collect_balance)
   call run('newton', collect_newton)
   call run('integrators', collect_integrators)
   call run('gauss', collect_gauss)
   call run('ensemble', collect_ensemble)
   call run('method_choice', collect_method_choice)
   call run('driver', collect_driver)
   call run('step_limit', collect_step_limit)
   call run('quantities', collect_quantities)
   call run('rod_forces', collect_rod_forces)
   call run('validity', collect_validity)
   call run('progress', collect_progress)
   call run('namelist', collect_namelist)
   call run('namelist_faults', collect_namelist_faults)
   call run('namelist_fuzz', collect_namelist_fuzz)
   call run('schema', collect_schema)
   call run('sweep', collect_sweep)
   call run('case_keys', collect_case_keys)
   call run('case_check', collect_case_check)
   call run('case_rules', collect_case_rules)
   call run('case_reader', collect_case_reader)
   call run('hdf5_files', collect_hdf5_files)
   call run('run_file', collect_run_file)
   call run('article', collect_article)
   call run('condensed', collect_condensed)
   call run('invariants', collect_invariants)
   call run('ledger', collect_ledger)
   call run('beams', collect_beams)

   write (*, '(i0, " passed, ", i0, " failed")') tally%passed, tally%failed
   if (tally%failed > 0 .or. tally%passed == 0) stop 1, quiet=.true.

contains

   subroutine run(name, collect)
      character(len=*), intent(in) :: name
      procedure(collect_interface) :: collect
      type(unittest), allocatable :: suite(:)
      call collect(suite)
      call run_suite(name, suite, tally, trim(filter), all)
   end subroutine run

end program tester
