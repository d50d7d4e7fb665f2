!> Write a run file of made-up rows, for the Python tests and for timing:
!> `sample_run PATH N_RODS N_ROWS`. Without arguments it does nothing.
program sample_run
   use, intrinsic :: iso_fortran_env, only: error_unit
   use rodyn_errors, only: error_type
   use rodyn_kinds, only: i8, wp
   use test_run_file, only: write_sample_run
   implicit none (type, external)
   type(error_type), allocatable :: error
   character(len=4000) :: path, number
   integer :: n_rods, n_rows
   integer(i8) :: start, finish, rate

   if (command_argument_count() == 0) stop
   call get_command_argument(1, path)
   call get_command_argument(2, number)
   read (number, *) n_rods
   call get_command_argument(3, number)
   read (number, *) n_rows

   call system_clock(start, rate)
   call write_sample_run(trim(path), n_rods, n_rows, .true., .true., error)
   call system_clock(finish)
   if (allocated(error)) then
      write (error_unit, '(a)') error%message
      stop error%exit_code, quiet=.true.
   end if
   write (*, '(a, ": ", i0, " rows of ", i0, " rods in ", f0.1, " ms")') trim(path), n_rows, n_rods, &
      1000.0_wp*real(finish - start, wp)/real(rate, wp)
end program sample_run
