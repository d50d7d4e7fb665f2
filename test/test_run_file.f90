!> Run files: layout, blocks, temporary and final names.
module test_run_file
   use, intrinsic :: ieee_arithmetic, only: ieee_positive_inf, ieee_value
   use, intrinsic :: iso_fortran_env, only: int64
   use rodyn_errors, only: error_type, exit_bad_input
   use rodyn_hdf5_files, only: hdf5_file
   use rodyn_kinds, only: i8, wp
   use rodyn_posix, only: path_exists
   use rodyn_run_file, only: check_output_path, is_finite, new_run_row, run_file, run_header, run_row, solver_report
   use rodyn_run_layout, only: n_run_variables, run_variables
   use test_scratch, only: clean, scratch_path
   use test_testing, only: check, check_close, new_test, unittest
   implicit none (type, external)
   private
   public :: collect_run_file, write_sample_run

   real(wp), parameter :: exact = 0.0_wp

contains

   subroutine collect_run_file(suite)
      type(unittest), allocatable, intent(out) :: suite(:)
      suite = [ &
         new_test('rows are read back, one rod', test_one_rod), &
         new_test('rows are read back over many blocks', test_many_blocks), &
         new_test('rows are read back, 10,000 rods', test_many_rods), &
         new_test('a run of no rows is a readable file', test_no_rows), &
         new_test('without the ledger there are no energies', test_no_ledger), &
         new_test('a failed run tells its message and last time', test_failed_run), &
         new_test('the final name appears only at the end', test_temporary_name), &
         new_test('a discarded run leaves nothing', test_discard), &
         new_test('rows of a stopped run never need the name of another file', test_stopped), &
         new_test('an existing result is refused before computing', test_refused), &
         new_test('an existing result is replaced when forced', test_forced), &
         new_test('a result that appears meanwhile is left alone', test_race), &
         new_test('a missing directory and a directory as file are refused', test_bad_paths), &
         new_test('a run file is used after finish only with an error', test_closed), &
         new_test('an infinite number of any rod is found', test_finite)]
   end subroutine collect_run_file

   !> A file of made-up rows: entry i of data set k at row r is value(k, i, r).
   subroutine write_sample_run(path, n_rods, n_rows, ledger, expect_rows, error, force)
      character(len=*), intent(in) :: path
      integer, intent(in) :: n_rods, n_rows
      logical, intent(in) :: ledger, expect_rows
      type(error_type), allocatable, intent(out) :: error
      logical, intent(in), optional :: force
      type(error_type), allocatable :: failure
      type(run_file) :: run
      type(run_row) :: row
      integer :: r
      logical :: forced

      forced = .false.
      if (present(force)) forced = force
      call run%create(path, sample_header(n_rods, merge(n_rows, 0, expect_rows), ledger), forced, error)
      if (allocated(error)) return
      row = new_run_row(n_rods)
      do r = 1, n_rows
         call fill(row, r)
         call run%append(row, failure)
         if (allocated(failure)) exit
      end do
      if (allocated(failure)) then
         call run%finish('failed', sample_report(), error, failure%message)
         if (.not. allocated(error)) call move_alloc(failure, error)
      else
         call run%finish('done', sample_report(), error)
      end if
   end subroutine write_sample_run

   function sample_header(n_rods, n_rows, ledger) result(header)
      integer, intent(in) :: n_rods, n_rows
      logical, intent(in) :: ledger
      type(run_header) :: header
      header%title = 'A sample: стержни'
      header%input = "&case title = 'A sample' /"//new_line('a')//repeat('! a long input'//new_line('a'), 10000)
      header%resolved_input = "&case title = 'A sample', t_end = 1.0 /"
      header%sundials_version = '6.4.1'
      header%n_rods = n_rods
      header%n_rows = n_rows
      header%ledger = ledger
      header%bubbles = .true.
   end function sample_header

   function sample_report() result(report)
      type(solver_report) :: report
      report%method = 'bdf'
      report%reason = 'asked for'
      report%kernel = 'recursive'
      report%options%order = 5
      report%options%rtol = 1.0e-8_wp
      report%options%atol = 1.0e-10_wp
      report%n_steps = 5000000000_i8
      report%n_rhs = 123_i8
      report%wall_seconds = 0.5_wp
   end function sample_report

   !> A number that depends on all three. A square root of an integer is rounded exactly, and so the same to the last bit in
   !> scalar and in vector code; a sine is not.
   pure function value(k, i, r)
      integer, intent(in) :: k, i, r
      real(wp) :: value
      value = sqrt(real(r*k + 3*k + 100*i, wp))
   end function value

   subroutine fill(row, r)
      type(run_row), intent(inout) :: row
      integer, intent(in) :: r
      integer :: i

      row%time = 0.001_wp*real(r - 1, wp)
      do i = 1, size(row%phi)
         row%phi(i) = value(2, i, r)
         row%alpha(i) = value(3, i, r)
         row%beta(i) = value(4, i, r)
         row%phi_rate(i) = value(5, i, r)
         row%alpha_rate(i) = value(6, i, r)
         row%beta_rate(i) = value(7, i, r)
         row%bubble(i) = value(22, i, r)
         row%bubble_rate(i) = value(23, i, r)
      end do
      row%velocity_x = value(8, 1, r)
      row%velocity_y = value(9, 1, r)
      row%omega = value(10, 1, r)
      row%displacement_x = value(11, 1, r)
      row%displacement_y = value(12, 1, r)
      row%rotation = value(13, 1, r)
      row%energy_kinetic = value(14, 1, r)
      row%energy_elastic = value(15, 1, r)
      row%energy_dissipated = value(16, 1, r)
      row%work_external = value(17, 1, r)
      row%energy_residual = value(18, 1, r)
      row%momentum_x = value(19, 1, r)
      row%momentum_y = value(20, 1, r)
      row%angular_momentum = value(21, 1, r)
   end subroutine fill

   !> Does the file hold exactly the sample's rows?
   subroutine check_sample_run(path, n_rods, n_rows, error)
      character(len=*), intent(in) :: path
      integer, intent(in) :: n_rods, n_rows
      type(error_type), allocatable, intent(out) :: error
      type(hdf5_file) :: file
      real(wp), allocatable :: scalars(:), rods(:, :)
      character(len=:), allocatable :: text
      integer :: i, k, r

      call file%open(path, error)
      if (allocated(error)) return
      do k = 1, n_run_variables
         if (run_variables(k)%per_rod) then
            call file%read(trim(run_variables(k)%name), rods, error)
            if (allocated(error)) return
            call check_close(error, [rods], [((value(k, i, r), i=1, n_rods), r=1, n_rows)], exact, run_variables(k)%name)
         else
            call file%read(trim(run_variables(k)%name), scalars, error)
            if (allocated(error)) return
            if (k == 1) then
               call check_close(error, scalars, [(0.001_wp*real(r - 1, wp), r=1, n_rows)], exact, 'time')
            else
               call check_close(error, scalars, [(value(k, 1, r), r=1, n_rows)], exact, run_variables(k)%name)
            end if
         end if
         if (allocated(error)) return
      end do
      call file%get_attribute('/', 'status', text, error)
      if (allocated(error)) return
      call check(error, text, 'done', 'status')
   end subroutine check_sample_run

   subroutine round_trip(n_rods, n_rows, expect_rows, error)
      integer, intent(in) :: n_rods, n_rows
      logical, intent(in) :: expect_rows
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: path

      path = scratch_path('round_trip.h5')
      call write_sample_run(path, n_rods, n_rows, .true., expect_rows, error)
      if (.not. allocated(error)) call check_sample_run(path, n_rods, n_rows, error)
      call clean(path)
   end subroutine round_trip

   subroutine test_one_rod(error)
      type(error_type), allocatable, intent(out) :: error
      call round_trip(1, 101, .true., error)
   end subroutine test_one_rod

   subroutine test_many_blocks(error)
      type(error_type), allocatable, intent(out) :: error
      call round_trip(4, 10001, .true., error)
      if (.not. allocated(error)) call round_trip(4, 10001, .false., error)
   end subroutine test_many_blocks

   subroutine test_many_rods(error)
      type(error_type), allocatable, intent(out) :: error
      call round_trip(10000, 10, .true., error)
   end subroutine test_many_rods

   subroutine test_no_rows(error)
      type(error_type), allocatable, intent(out) :: error
      call round_trip(2, 0, .true., error)
   end subroutine test_no_rows

   subroutine test_no_ledger(error)
      type(error_type), allocatable, intent(out) :: error
      type(hdf5_file) :: file
      character(len=:), allocatable :: path
      integer :: k

      path = scratch_path('no_ledger.h5')
      work: block
         call write_sample_run(path, 2, 3, .false., .true., error)
         if (allocated(error)) exit work
         call file%open(path, error)
         if (allocated(error)) exit work
         do k = 1, n_run_variables
            call check(error, file%exists(trim(run_variables(k)%name)) .neqv. run_variables(k)%ledger, run_variables(k)%name)
            if (allocated(error)) exit work
         end do
      end block work
      call clean(path)
   end subroutine test_no_ledger

   subroutine test_failed_run(error)
      type(error_type), allocatable, intent(out) :: error
      type(run_file) :: run
      type(run_row) :: row
      type(hdf5_file) :: file
      character(len=:), allocatable :: path, text
      integer(int64), allocatable :: extent(:)
      real(wp) :: t_reached
      integer(i8) :: n_steps

      path = scratch_path('failed.h5')
      row = new_run_row(2)
      work: block
         call run%create(path, sample_header(2, 1001, .true.), .false., error)
         if (allocated(error)) exit work
         call run%append(row, error)
         if (allocated(error)) exit work
         row%time = 0.25_wp
         call run%append(row, error)
         if (allocated(error)) exit work
         call run%finish('failed', sample_report(), error, message='too many steps')
         if (allocated(error)) exit work
         call file%open(path, error)
         if (allocated(error)) exit work
         call file%get_shape('phi', extent, error)
         if (allocated(error)) exit work
         call check(error, all(extent == [2_int64, 2_int64]), 'rows')
         if (allocated(error)) exit work
         call file%get_attribute('/', 'status', text, error)
         if (allocated(error)) exit work
         call check(error, text, 'failed', 'status')
         if (allocated(error)) exit work
         call file%get_attribute('/', 'message', text, error)
         if (allocated(error)) exit work
         call check(error, text, 'too many steps', 'message')
         if (allocated(error)) exit work
         call file%get_attribute('/', 't_reached', t_reached, error)
         if (allocated(error)) exit work
         call check_close(error, t_reached, 0.25_wp, exact, 't_reached')
         if (allocated(error)) exit work
         call file%get_attribute('solver', 'n_steps', n_steps, error)
         if (allocated(error)) exit work
         call check(error, n_steps == 5000000000_i8, 'n_steps')
      end block work
      call clean(path)
   end subroutine test_failed_run

   subroutine test_temporary_name(error)
      type(error_type), allocatable, intent(out) :: error
      type(run_file) :: run
      character(len=:), allocatable :: path

      path = scratch_path('temporary.h5')
      work: block
         call run%create(path, sample_header(2, 3, .true.), .false., error)
         if (allocated(error)) exit work
         call run%append(new_run_row(2), error)
         if (allocated(error)) exit work
         call check(error, .not. path_exists(path), 'the final name exists too early')
         if (allocated(error)) exit work
         call check(error, path_exists(run%temporary_path), 'no temporary file')
         if (allocated(error)) exit work
         call check(error, index(run%temporary_path, path//'.partial-') == 1, run%temporary_path)
         if (allocated(error)) exit work
         call run%finish('done', sample_report(), error)
         if (allocated(error)) exit work
         call check(error, path_exists(path), 'no final file')
         if (allocated(error)) exit work
         call check(error, .not. path_exists(run%temporary_path), 'the temporary file is still there')
      end block work
      call clean(path)
   end subroutine test_temporary_name

   subroutine test_discard(error)
      type(error_type), allocatable, intent(out) :: error
      type(run_file) :: run
      character(len=:), allocatable :: path

      path = scratch_path('discard.h5')
      call run%create(path, sample_header(2, 3, .true.), .false., error)
      if (allocated(error)) return
      call run%discard()
      call check(error, .not. path_exists(path), 'the final file is left')
      if (allocated(error)) return
      call check(error, .not. path_exists(run%temporary_path), 'the temporary file is left')
   end subroutine test_discard

   !> Shorter rows of the same case are replaced; longer ones, and whatever else has the name, stay.
   subroutine test_stopped(error)
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: path
      logical :: earlier

      path = scratch_path('stopped.h5')
      work: block
         call stop_after(3, '', .false., path)
         if (allocated(error)) exit work
         call stop_after(2, '', .true., path)
         if (allocated(error)) exit work
         call stop_after(4, '', .false., path)
         if (allocated(error)) exit work
         call stop_after(2, 'another', .false., path//'-1')
         if (allocated(error)) exit work
         call stop_after(3, 'another', .false., path//'-1')
         if (allocated(error)) exit work
         call stop_after(2, 'a third', .false., path//'-2')
      end block work
      call clean(path)
      call clean(path//'-1')
      call clean(path//'-2')

   contains

      !> A run of some rows that stops.
      subroutine stop_after(n_rows, input, is_earlier, name)
         integer, intent(in) :: n_rows
         character(len=*), intent(in) :: input
         logical, intent(in) :: is_earlier     !! a longer one is there
         character(len=*), intent(in) :: name  !! of the file that has the rows
         type(run_file) :: run
         type(run_row) :: row
         type(run_header) :: header
         integer :: i

         header = sample_header(2, 1000, .true.)
         header%resolved_input = input
         call run%create(scratch_path('running.h5'), header, .false., error)
         if (allocated(error)) return
         row = new_run_row(2)
         do i = 1, n_rows
            row%time = i
            call run%append(row, error)
            if (allocated(error)) return
         end do
         call run%stop_at(path, .true., earlier)
         call check(error, earlier .eqv. is_earlier, 'which is longer')
         if (.not. allocated(error)) call check(error, run%path, name, 'name')
         if (allocated(error)) return
         if (earlier) then
            call run%discard()
         else
            call run%finish('stopped', sample_report(), error, message='stopped')
         end if
      end subroutine stop_after

   end subroutine test_stopped

   subroutine test_refused(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: refusal
      character(len=:), allocatable :: path

      path = scratch_path('refused.h5')
      work: block
         call write_sample_run(path, 1, 2, .true., .true., error)
         if (allocated(error)) exit work
         call write_sample_run(path, 1, 5, .true., .true., refusal)
         call check(error, allocated(refusal), 'not refused')
         if (allocated(error)) exit work
         call check(error, refusal%exit_code, exit_bad_input, 'exit code')
         if (allocated(error)) exit work
         call check(error, refusal%message, path//': exists already; --force replaces it', 'message')
         if (allocated(error)) exit work
         call check_sample_run(path, 1, 2, error)
      end block work
      call clean(path)
   end subroutine test_refused

   subroutine test_forced(error)
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: path

      path = scratch_path('forced.h5')
      work: block
         call write_sample_run(path, 1, 2, .true., .true., error)
         if (allocated(error)) exit work
         call write_sample_run(path, 1, 5, .true., .true., error, force=.true.)
         if (allocated(error)) exit work
         call check_sample_run(path, 1, 5, error)
      end block work
      call clean(path)
   end subroutine test_forced

   subroutine test_race(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: refusal
      type(run_file) :: run
      type(hdf5_file) :: file
      character(len=:), allocatable :: path, text

      path = scratch_path('race.h5')
      work: block
         call run%create(path, sample_header(1, 3, .true.), .false., error)
         if (allocated(error)) exit work
         call write_sample_run(path, 1, 2, .true., .true., error)
         if (allocated(error)) exit work
         call run%append(new_run_row(1), error)
         if (allocated(error)) exit work
         call run%finish('done', sample_report(), refusal)
         call check(error, allocated(refusal), 'the other result was replaced')
         if (allocated(error)) exit work
         call check(error, refusal%exit_code, exit_bad_input, 'exit code')
         if (allocated(error)) exit work
         call check_sample_run(path, 1, 2, error)
         if (allocated(error)) exit work
         call check(error, index(refusal%message, run%temporary_path) > 0, refusal%message)
         if (allocated(error)) exit work
         call file%open(run%temporary_path, error)
         if (allocated(error)) exit work
         call file%get_attribute('/', 'status', text, error)
         if (allocated(error)) exit work
         call check(error, text, 'done', 'status of the kept result')
      end block work
      call clean(path)
      if (allocated(run%temporary_path)) call clean(run%temporary_path)
   end subroutine test_race

   subroutine test_bad_paths(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: refusal

      call check_output_path('/no/such/directory/a.h5', .false., refusal)
      call check(error, allocated(refusal), 'a missing directory is accepted')
      if (allocated(error)) return
      call check(error, refusal%message, &
         "/no/such/directory/a.h5: the directory '/no/such/directory' does not exist", 'message')
         if (allocated(error)) return
      call check_output_path('/tmp', .true., refusal)
      call check(error, allocated(refusal), 'a directory is accepted')
      if (allocated(error)) return
      call check(error, refusal%exit_code, exit_bad_input, 'exit code')
      if (allocated(error)) return
      call check_output_path('', .false., refusal)
      call check(error, allocated(refusal), 'an empty name is accepted')
      if (allocated(error)) return
      call check_output_path('a_name_in_the_working_directory.h5', .false., refusal)
      call check(error, .not. allocated(refusal), 'a plain name is refused')
   end subroutine test_bad_paths

   subroutine test_closed(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: refusal
      type(run_file) :: run

      call run%append(new_run_row(1), refusal)
      call check(error, allocated(refusal), 'a row went nowhere')
      if (allocated(error)) return
      call run%finish('done', sample_report(), refusal)
      call check(error, allocated(refusal), 'nothing was finished')
   end subroutine test_closed

   subroutine test_finite(error)
      type(error_type), allocatable, intent(out) :: error
      type(run_row), target :: row
      real(wp) :: infinite
      logical :: found(8)

      infinite = ieee_value(1.0_wp, ieee_positive_inf)
      row = new_run_row(2)
      call check(error, is_finite(row), 'a row of zeros is not finite')
      if (allocated(error)) return
      found = [seen(row%phi), seen(row%alpha), seen(row%beta), seen(row%bubble), seen(row%phi_rate), seen(row%alpha_rate), &
               seen(row%beta_rate), seen(row%bubble_rate)]
      call check(error, all(found), 'not seen')

   contains

      !> Is it found in this part of the row?
      logical function seen(x)
         real(wp), target, intent(inout) :: x(:)
         x(2) = infinite
         seen = .not. is_finite(row)
         x(2) = 0.0_wp
      end function seen

   end subroutine test_finite

end module test_run_file
