!> From shards to the content of `sweep.h5` (docs/sweeps.md), case after case.
!>
!> What is in it depends on the sweep alone, not on who computed which case when; only `wall_seconds` differs.
module rodyn_sweep_merge
   use rodyn_kinds, only: wp, i8
   use rodyn_build_info, only: compiler, compiler_options, git_commit, program_version
   use rodyn_case_reader, only: resolved_case
   use rodyn_errors, only: error_type, raise
   use rodyn_hdf5_files, only: hdf5_file, hdf5_version
   use rodyn_integrators, only: sundials_version
   use rodyn_posix, only: ignore_signal, path_exists, remove_file, sigxfsz, sync_path
   use rodyn_quantities, only: chain_axes, entries, quantity
   use rodyn_sweep_case, only: allocate_result, case_result, case_shape, make_nan, status_done
   use rodyn_sweep_config, only: sweep_config
   use rodyn_sweep_index, only: sweep_index
   use rodyn_sweep_plan, only: sweep_plan
   use rodyn_sweep_worker, only: lanes_text
   implicit none (type, external)
   private
   public :: merge_sweep

   integer, parameter :: block_bytes = 4*1024*1024 !! memory for the states of a block of cases
   integer, parameter :: most_block_cases = 4096
   integer, parameter :: longest_message = 1000 !! [bytes]

   !> Results of consecutive cases
   type :: case_block
      integer :: n = 0
      real(wp), allocatable :: frequency(:, :), damping_ratio(:, :) !! (mode, case)
      real(wp), allocatable :: final(:, :)      !! (value, case)
      real(wp), allocatable :: probes(:, :, :)  !! (value, probe, case)
      real(wp), allocatable :: times(:, :)      !! (row, case)
      real(wp), allocatable :: series(:, :, :)  !! (value, row, case)
      real(wp), allocatable :: t_reached(:), wall_seconds(:)
      integer(i8), allocatable :: n_steps(:), n_rhs(:), same_as(:), number(:)
      character(len=8), allocatable :: status(:)
      character(len=:), allocatable :: message(:)
   end type case_block

contains

   !> Write the result, and put it onto the disk. All cases that are computed must have a result in the index.
   subroutine merge_sweep(path, sweep, plan, shape, index, error)
      character(len=*), intent(in) :: path !! temporary; what a killed merge left there is rewritten
      type(sweep_config), intent(in) :: sweep
      type(sweep_plan), intent(in) :: plan
      type(case_shape), intent(in) :: shape
      type(sweep_index), intent(inout) :: index
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: ignored
      type(hdf5_file) :: file
      character(len=:), allocatable :: failure

      call ignore_signal(sigxfsz)
      if (path_exists(path)) failure = remove_file(path)
      call file%create(path, error)
      if (allocated(error)) return
      call write_all(file, sweep, plan, shape, index, error)
      if (.not. allocated(error)) call file%flush(error)
      if (allocated(error)) then
         call file%close(ignored)
      else
         call file%close(error)
      end if
      call index%close()
      if (.not. allocated(error)) then
         failure = sync_path(path)
         if (len(failure) > 0) call raise(error, path//': cannot be written: '//failure)
      end if
      if (.not. allocated(error)) return
      error%message = error%message//'; all results are safe in the shards, run again to merge them'
      failure = remove_file(path)
   end subroutine merge_sweep

   !> Layout, then blocks of cases.
   subroutine write_all(file, sweep, plan, shape, index, error)
      type(hdf5_file), intent(inout) :: file
      type(sweep_config), intent(in) :: sweep
      type(sweep_plan), intent(in) :: plan
      type(case_shape), intent(in) :: shape
      type(sweep_index), intent(inout) :: index
      type(error_type), allocatable, intent(out) :: error
      type(case_block) :: block
      type(case_result) :: kept
      integer :: block_cases, first, message_length, n

      block_cases = cases_per_block(shape, plan%n_cases)
      message_length = min(longest_message, maxval(index%message_bytes))
      call write_header(file, sweep, plan)
      call write_layout(file, sweep, shape, block_cases, message_length)
      call new_block(block, kept, shape, block_cases, message_length)
      do first = 1, plan%n_cases, block_cases
         n = min(block_cases, plan%n_cases - first + 1)
         call file%get_failure(error)
         if (.not. allocated(error)) call fill_block(block, kept, plan, shape, index, first, n, error)
         if (allocated(error)) return
         call append_block(file, block, shape)
         call append_parameters(file, sweep, plan, first, n)
      end do
   end subroutine write_all

   !> As many cases as the memory for a block allows.
   pure integer function cases_per_block(shape, n_cases) result(n)
      type(case_shape), intent(in) :: shape
      integer, intent(in) :: n_cases
      integer :: numbers
      numbers = 2*shape%n_modes + shape%layout%n_values*(1 + shape%n_probes + shape%n_rows) + shape%n_rows + 1
      n = max(1, min(n_cases, most_block_cases, block_bytes/(8*numbers)))
   end function cases_per_block

   subroutine new_block(block, kept, shape, n, message_length)
      type(case_block), intent(out) :: block
      type(case_result), intent(out) :: kept
      type(case_shape), intent(in) :: shape
      integer, intent(in) :: n, message_length
      allocate (block%frequency(shape%n_modes, n), block%damping_ratio(shape%n_modes, n))
      allocate (block%final(shape%layout%n_values, n), block%probes(shape%layout%n_values, shape%n_probes, n))
      allocate (block%times(shape%n_rows, n), block%series(shape%layout%n_values, shape%n_rows, n))
      allocate (block%t_reached(n), block%wall_seconds(n))
      allocate (block%n_steps(n), block%n_rhs(n), block%same_as(n), block%number(n))
      allocate (block%status(n))
      allocate (character(len=message_length) :: block%message(n))
      call allocate_result(kept, shape)
   end subroutine new_block

   !> Fetch the results of cases first, first + 1, ...
   subroutine fill_block(block, kept, plan, shape, index, first, n, error)
      type(case_block), intent(inout) :: block
      type(case_result), intent(inout) :: kept
      type(sweep_plan), intent(in) :: plan
      type(case_shape), intent(in) :: shape
      type(sweep_index), intent(inout) :: index
      integer, intent(in) :: first, n
      type(error_type), allocatable, intent(out) :: error
      integer :: i, source

      block%n = n
      do i = 1, n
         source = plan%same_as(first + i - 1)
         call index%fetch(source, shape, kept, error)
         if (allocated(error)) return
         if (kept%status /= status_done) call make_nan(kept)
         block%frequency(:, i) = kept%frequency
         block%damping_ratio(:, i) = kept%damping_ratio
         block%final(:, i) = kept%final
         block%probes(:, :, i) = kept%probes
         block%times(:, i) = kept%times
         block%series(:, :, i) = kept%series
         block%t_reached(i) = kept%t_reached
         block%wall_seconds(i) = kept%wall_seconds
         block%n_steps(i) = kept%n_steps
         block%n_rhs(i) = kept%n_rhs
         block%same_as(i) = source
         block%number(i) = first + i - 1
         block%status(i) = merge('done  ', 'failed', kept%status == status_done)
         block%message(i) = kept%message
      end do
   end subroutine fill_block

   !> What the sweep was, and with what it was made. No host and no date: results do not depend on them.
   subroutine write_header(file, sweep, plan)
      type(hdf5_file), intent(inout) :: file
      type(sweep_config), intent(in) :: sweep
      type(sweep_plan), intent(in) :: plan

      call put('title', sweep%base_case%title)
      call put('program_version', program_version)
      call put('git_commit', git_commit())
      call put('compiler', compiler())
      call put('compiler_options', compiler_options())
      call put('sundials_version', sundials_version())
      call put('hdf5_version', hdf5_version())
      call put('input', sweep%text)
      call put('base_input', sweep%base_text)
      call put('resolved_base', resolved_case(sweep%base_case))
      call put('lanes', lanes_text(sweep, plan))
      call file%put_attribute('/', 'n_cases', plan%n_cases)

   contains

      subroutine put(name, value)
         character(len=*), intent(in) :: name, value
         call file%put_attribute('/', name, value)
      end subroutine put

   end subroutine write_header

   !> Coordinates, and all data sets that grow with the cases, empty: dimension scales, as xarray wants them, are attached.
   subroutine write_layout(file, sweep, shape, block_cases, message_length)
      type(hdf5_file), intent(inout) :: file
      type(sweep_config), intent(in) :: sweep
      type(case_shape), intent(in) :: shape
      integer, intent(in) :: block_cases, message_length
      integer, parameter :: no_rows(0) = [integer ::]
      character(len=1), parameter :: no_scales(0) = [character(len=1) ::]
      character(len=:), allocatable :: state
      integer :: a, compression, i

      compression = sweep%base_case%output%compression

      if (shape%layout%n_values > 0) then
         call file%write('probe_time', sweep%probe_times, compression)
         call describe_scale('probe_time', 's', 'time at which the state of each case is kept')
      end if
      do i = 1, size(chain_axes)
         if (.not. shape%layout%counts(i)) cycle
         call file%write(trim(chain_axes(i)%name), entries(chain_axes(i), shape%layout%n_rods), compression)
         call describe_scale(trim(chain_axes(i)%name), '1', trim(chain_axes(i)%long_name))
      end do
      if (shape%n_modes > 0) then
         call file%write('mode', [(i, i=1, shape%n_modes)], compression)
         call describe_scale('mode', '1', 'oscillation, by rising natural frequency')
      end if
      if (shape%n_rows > 0) then
         call file%write('row', [(i - 1, i=1, shape%n_rows)], compression)
         call describe_scale('row', '1', 'output time of a case, counted from its start')
      end if
      call file%create_series('case', [integer ::], block_cases, compression, .true.)
      call describe_scale('case', '1', 'case; the last axis runs fastest')
      do a = 1, size(sweep%axes)
         if (sweep%axes(a)%textual) then
            call make_texts(parameter_name(a), maxval(len_trim(sweep%axes(a)%texts)), 'value of '//trim(sweep%axes(a)%key))
         else
            call make(parameter_name(a), no_rows, no_scales, 'real', unit_or_one(sweep%axes(a)%unit), &
                      'value of '//trim(sweep%axes(a)%key))
         end if
      end do
      call make_texts('status', len('failed'), 'done or failed')
      call make_texts('message', message_length, 'why the case failed; or which methods gave up, and warnings on its model')
      call make('t_reached', no_rows, no_scales, 'real', 's', 'time of the last output before it failed; of a done case its end')
      call make('n_steps', no_rows, no_scales, 'integer', '1', 'internal steps')
      call make('n_rhs', no_rows, no_scales, 'integer', '1', 'right-hand-side evaluations')
      call make('same_as', no_rows, no_scales, 'integer', '1', 'first case with the same values, the one that was computed')
      call make('wall_seconds', no_rows, no_scales, 'real', 's', 'wall time of the case')
      if (shape%n_modes > 0) then
         state = 'at the initial state'
         if (sweep%frequencies_at == 'equilibrium') state = 'at the equilibrium'
         call make('frequency', [shape%n_modes], ['mode'], 'real', 'rad s-1', 'natural frequency '//state)
         call make('damping_ratio', [shape%n_modes], ['mode'], 'real', '1', 'damping ratio '//state)
      end if
      do i = 1, size(shape%layout%quantities)
         call make_quantity(shape%layout%quantities(i), shape%layout%row_shape(i))
      end do
      if (shape%n_rows > 0) call make('series_time', [shape%n_rows], ['row'], 'real', 's', 'output times; NaN behind the last')

   contains

      !> At the probe times, at the end, and perhaps all along.
      subroutine make_quantity(x, row)
         type(quantity), intent(in) :: x
         integer, intent(in) :: row(:) !! its shape
         character(len=10), allocatable :: along(:) !! as long as all names in the lists below

         allocate (along(0))
         if (x%along > 0) along = [character(len=10) :: chain_axes(x%along)%name]
         call make(trim(x%name), [row, shape%n_probes], [character(len=10) :: along, 'probe_time'], 'real', trim(x%units), &
                   trim(x%long_name)//', at the probe times')
         call make('final_'//trim(x%name), row, along, 'real', trim(x%units), trim(x%long_name)//', at the end of the case')
         if (shape%n_rows > 0) call make('series_'//trim(x%name), [row, shape%n_rows], [character(len=10) :: along, 'row'], &
                                         'real', trim(x%units), trim(x%long_name))
      end subroutine make_quantity

      function parameter_name(a) result(name)
         integer, intent(in) :: a
         character(len=:), allocatable :: name
         name = 'param_'//trim(sweep%axes(a)%key)
      end function parameter_name

      subroutine make(name, row, scales, kind_of, units, long_name)
         character(len=*), intent(in) :: name, kind_of, units, long_name
         integer, intent(in) :: row(:)             !! shape of what a case has
         character(len=*), intent(in) :: scales(:) !! of its dimensions
         integer :: k
         call file%create_series(name, row, block_cases, compression, kind_of == 'integer')
         call describe(name, units, long_name)
         do k = 1, size(scales)
            call file%attach_scale(name, k, trim(scales(k)))
         end do
         call file%attach_scale(name, size(scales) + 1, 'case')
      end subroutine make

      subroutine make_texts(name, length, long_name)
         character(len=*), intent(in) :: name, long_name
         integer, intent(in) :: length
         call file%create_texts(name, length, block_cases, compression)
         call describe(name, '', long_name)
         call file%attach_scale(name, 1, 'case')
      end subroutine make_texts

      !> Of a data set that is a coordinate of others.
      subroutine describe_scale(name, units, long_name)
         character(len=*), intent(in) :: name, units, long_name
         call describe(name, units, long_name)
         call file%make_scale(name)
      end subroutine describe_scale

      subroutine describe(name, units, long_name)
         character(len=*), intent(in) :: name, units, long_name
         if (len(units) > 0) call file%put_attribute(name, 'units', units)
         call file%put_attribute(name, 'long_name', long_name)
      end subroutine describe

   end subroutine write_layout

   pure function unit_or_one(unit) result(text)
      character(len=*), intent(in) :: unit
      character(len=:), allocatable :: text
      text = trim(unit)
      if (len(text) == 0) text = '1'
   end function unit_or_one

   !> Append the results of a block.
   subroutine append_block(file, block, shape)
      type(hdf5_file), intent(inout) :: file
      type(case_block), intent(in) :: block
      type(case_shape), intent(in) :: shape
      integer :: i

      associate (n => block%n)
         call file%append('case', block%number(:n))
         call file%append('status', block%status(:n))
         call file%append('message', block%message(:n))
         call file%append('t_reached', block%t_reached(:n))
         call file%append('n_steps', block%n_steps(:n))
         call file%append('n_rhs', block%n_rhs(:n))
         call file%append('same_as', block%same_as(:n))
         call file%append('wall_seconds', block%wall_seconds(:n))
         if (shape%n_modes > 0) then
            call file%append('frequency', block%frequency(:, :n))
            call file%append('damping_ratio', block%damping_ratio(:, :n))
         end if
         do i = 1, size(shape%layout%quantities)
            call append_quantity(file, block, shape, shape%layout%quantities(i))
         end do
         if (shape%n_rows > 0) call file%append('series_time', block%times(:, :n))
      end associate
   end subroutine append_block

   !> One of the quantities that are kept of each case.
   subroutine append_quantity(file, block, shape, x)
      type(hdf5_file), intent(inout) :: file
      type(case_block), intent(in) :: block
      type(case_shape), intent(in) :: shape
      type(quantity), intent(in) :: x
      character(len=:), allocatable :: name

      name = trim(x%name)
      associate (n => block%n, first => x%first, last => x%last)
         if (x%along > 0) then
            call file%append(name, block%probes(first:last, :, :n))
            call file%append('final_'//name, block%final(first:last, :n))
            if (shape%n_rows > 0) call file%append('series_'//name, block%series(first:last, :, :n))
         else
            call file%append(name, block%probes(first, :, :n))
            call file%append('final_'//name, block%final(first, :n))
            if (shape%n_rows > 0) call file%append('series_'//name, block%series(first, :, :n))
         end if
      end associate
   end subroutine append_quantity

   !> The values of the axes in cases first, first + 1, ...
   subroutine append_parameters(file, sweep, plan, first, n)
      type(hdf5_file), intent(inout) :: file
      type(sweep_config), intent(in) :: sweep
      type(sweep_plan), intent(in) :: plan
      integer, intent(in) :: first, n
      integer :: rows(size(plan%dimensions), n)
      real(wp), allocatable :: numbers(:)
      character(len=:), allocatable :: texts(:)
      integer :: a, i

      do i = 1, n
         rows(:, i) = plan%rows(first + i - 1)
      end do
      do a = 1, size(sweep%axes)
         associate (axis => sweep%axes(a))
            if (axis%textual) then
               texts = axis%texts(rows(axis%dimension, :))
               call file%append('param_'//trim(axis%key), texts)
            else
               numbers = axis%numbers(rows(axis%dimension, :))
               call file%append('param_'//trim(axis%key), numbers)
            end if
         end associate
      end do
   end subroutine append_parameters

end module rodyn_sweep_merge
