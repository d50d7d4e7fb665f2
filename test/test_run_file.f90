!> Run files: layout, blocks, temporary and final names.
module test_run_file
   use, intrinsic :: ieee_arithmetic, only: ieee_positive_inf, ieee_value
   use rodyn_case_config, only: case_config
   use rodyn_errors, only: error_type, exit_bad_input
   use rodyn_hdf5_files, only: hdf5_file
   use rodyn_kinds, only: i8, wp
   use rodyn_posix, only: path_exists
   use rodyn_quantities, only: is_finite, layout_of, new_row, row_layout, row_type
   use rodyn_run_file, only: check_output_path, run_file, run_header
   use rodyn_run_report, only: solver_report
   use test_hdf5_reader, only: has_set, read_attribute, read_set
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
         new_test('an infinite number is found wherever it stands', test_finite)]
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
      type(row_type) :: row
      integer :: r
      logical :: forced

      forced = .false.
      if (present(force)) forced = force
      call run%create(path, sample_header(n_rods, merge(n_rows, 0, expect_rows), ledger), forced, error)
      if (allocated(error)) return
      row = new_row(sample_layout(n_rods, ledger))
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
      header%layout = sample_layout(n_rods, ledger)
      header%n_rows = n_rows
   end function sample_header

   !> Everything that a row can have.
   function sample_layout(n_rods, ledger) result(layout)
      integer, intent(in) :: n_rods
      logical, intent(in) :: ledger
      type(row_layout) :: layout
      type(case_config) :: config
      config%chain%n_rods = n_rods
      config%model%bending_shapes = 3
      config%output%ledger = ledger
      layout = layout_of(config)
   end function sample_layout

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
      type(row_type), intent(inout) :: row
      integer, intent(in) :: r
      integer :: i, k

      row%time = 0.001_wp*real(r - 1, wp)
      do k = 1, size(row%layout%quantities)
         associate (x => row%layout%quantities(k))
            row%values(x%first:x%last) = [(value(k, i, r), i=1, x%last - x%first + 1)]
         end associate
      end do
   end subroutine fill

   !> Does the file hold exactly the sample's rows?
   subroutine check_sample_run(path, n_rods, n_rows, error)
      character(len=*), intent(in) :: path
      integer, intent(in) :: n_rods, n_rows
      type(error_type), allocatable, intent(out) :: error
      type(hdf5_file) :: file
      type(row_layout) :: layout
      real(wp), allocatable :: numbers(:)
      integer, allocatable :: extent(:)
      character(len=:), allocatable :: text
      integer :: i, k, r

      layout = sample_layout(n_rods, .true.)
      call read_set(path, 'time', extent, numbers, error)
      if (allocated(error)) return
      call check_close(error, numbers, [(0.001_wp*real(r - 1, wp), r=1, n_rows)], exact, 'time')
      do k = 1, size(layout%quantities)
         associate (x => layout%quantities(k))
            if (allocated(error)) return
            call read_set(path, trim(x%name), extent, numbers, error)
            if (allocated(error)) return
            call check_close(error, numbers, [((value(k, i, r), i=1, x%last - x%first + 1), r=1, n_rows)], exact, x%name)
         end associate
      end do
      if (.not. allocated(error)) call file%open(path, error)
      if (.not. allocated(error)) call file%get_attribute('/', 'status', text, error)
      if (.not. allocated(error)) call check(error, text, 'done', 'status')
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
      type(row_layout) :: layout, without
      character(len=:), allocatable :: path
      integer :: k

      path = scratch_path('no_ledger.h5')
      work: block
         call write_sample_run(path, 2, 3, .false., .true., error)
         if (allocated(error)) exit work
         layout = sample_layout(2, .true.)
         without = sample_layout(2, .false.)
         call check(error, size(without%quantities), size(layout%quantities) - 8, 'quantities of the ledger')
         do k = 1, size(layout%quantities)
            if (allocated(error)) exit work
            associate (name => layout%quantities(k)%name)
               call check(error, has_set(path, trim(name)) .eqv. any(without%quantities%name == name), name)
            end associate
         end do
      end block work
      call clean(path)
   end subroutine test_no_ledger

   subroutine test_failed_run(error)
      type(error_type), allocatable, intent(out) :: error
      type(run_file) :: run
      type(row_type) :: row
      type(hdf5_file) :: file
      character(len=:), allocatable :: path, text
      real(wp), allocatable :: phi(:)
      integer, allocatable :: extent(:)
      real(wp) :: n_steps, t_reached

      path = scratch_path('failed.h5')
      row = new_row(sample_layout(2, .true.))
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
         call read_set(path, 'phi', extent, phi, error)
         if (.not. allocated(error)) call check(error, all(extent == [2, 2]), 'rows')
         if (.not. allocated(error)) call read_attribute(path, 'solver', 'n_steps', n_steps, error)
         call check_close(error, n_steps, 5.0e9_wp, exact, 'n_steps')
         if (.not. allocated(error)) call file%open(path, error)
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
         call run%append(new_row(sample_layout(2, .true.)), error)
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
         type(row_type) :: row
         type(run_header) :: header
         integer :: i

         header = sample_header(2, 1000, .true.)
         header%resolved_input = input
         call run%create(scratch_path('running.h5'), header, .false., error)
         if (allocated(error)) return
         row = new_row(sample_layout(2, .true.))
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
         call run%append(new_row(sample_layout(1, .true.)), error)
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

      call run%append(new_row(sample_layout(1, .true.)), refusal)
      call check(error, allocated(refusal), 'a row went nowhere')
      if (allocated(error)) return
      call run%finish('done', sample_report(), refusal)
      call check(error, allocated(refusal), 'nothing was finished')
   end subroutine test_closed

   subroutine test_finite(error)
      type(error_type), allocatable, intent(out) :: error
      type(row_type) :: row
      real(wp) :: infinite
      integer :: i

      infinite = ieee_value(1.0_wp, ieee_positive_inf)
      row = new_row(sample_layout(2, .true.))
      call check(error, is_finite(row), 'a row of zeros is not finite')
      do i = 1, size(row%values)
         if (allocated(error)) return
         row%values(i) = infinite
         call check(error, .not. is_finite(row), 'not seen')
         row%values(i) = 0.0_wp
      end do
   end subroutine test_finite

end module test_run_file
