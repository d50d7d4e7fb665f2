!> One case from its description to a table in memory: what `rodyn run` writes into a file, the same numbers and attributes.
module rodyn_memory_run
   use rodyn_attributes, only: attribute_list
   use rodyn_case_config, only: case_config
   use rodyn_driver, only: driver_type, new_driver
   use rodyn_errors, only: error_type, exit_stopped
   use rodyn_hinge_mechanism, only: kind_names
   use rodyn_integrator, only: monitor_type
   use rodyn_kinds, only: wp, i8
   use rodyn_motion, only: motion_type
   use rodyn_origin, only: describe_origin
   use rodyn_quantities, only: chain_axes, entries, layout_of, row_layout
   use rodyn_recorder, only: recorder_type
   use rodyn_result_table, only: name_length, result_table
   use rodyn_run_needs, only: check_memory, memory_of_scene, of_program
   use rodyn_run_report, only: event_columns, provenance, solver_report
   use rodyn_run_setup, only: run_setup, new_run_setup
   use rodyn_simulation, only: even_times, simulate
   use rodyn_text, only: to_text
   implicit none (type, external)
   private
   public :: run_in_memory

   integer, parameter :: bytes_per_real = 8

   !> Puts rows into a table: that of the time first, then those of the quantities.
   type, extends(recorder_type) :: memory_recorder
      type(result_table), pointer :: table => null()
      integer :: n_rows = 0 !! so far
      integer :: time = 0   !! place of the times in the table
   contains
      procedure :: keep
   end type memory_recorder

contains

   !> Run a case. On failure of the integration the table has all rows until then; on refused input it is empty.
   subroutine run_in_memory(config, name, input_text, monitor, table, error)
      type(case_config), intent(in) :: config !! complete and sound
      character(len=*), intent(in) :: name    !! of the case, for what is refused of its keys
      character(len=*), intent(in) :: input_text
      class(monitor_type), target, intent(inout) :: monitor
      type(result_table), target, intent(inout) :: table !! empty
      type(error_type), allocatable, intent(out) :: error
      type(run_setup), target :: setup
      type(driver_type) :: driver
      type(memory_recorder) :: recorder
      type(provenance) :: origin
      type(row_layout) :: layout
      integer(i8) :: clock_start, clock_end, clock_rate
      real(wp) :: t

      call system_clock(clock_start, clock_rate)
      layout = layout_of(config)
      call check_memory('n_rods = '//to_text(config%chain%n_rods)//', n_outputs = '//to_text(config%n_outputs), of_program + &
         memory_of_scene(config) + bytes_per_real*(config%n_outputs + 1.0_wp)*(layout%n_values + 1.0_wp), error)
      if (.not. allocated(error)) call new_run_setup(setup, config, config%output%ledger, error)
      if (allocated(error)) return
      call new_driver(driver, setup%motion, setup%y, config%solver, config%t_end, config%n_outputs, error, monitor)
      if (allocated(error)) error%message = name//': '//error%message
      if (allocated(error)) return
      call describe_origin(config, setup%motion, setup%y, .true., origin)
      origin%input = input_text
      call driver%make(error)
      if (allocated(error)) return
      call prepare_table(table, layout, config%n_outputs + 1, recorder%time)
      recorder%table => table
      call recorder%prepare(setup%motion%dynamics%scene, layout, config%n_outputs + 1, config%model)
      call simulate(setup%motion, driver, even_times(config%t_end, config%n_outputs), config%t_end, recorder, setup%y, t, error)
      call system_clock(clock_end)
      call complete_table(table, recorder, driver, setup%motion, config, origin, &
                          real(clock_end - clock_start, wp)/real(clock_rate, wp), error)
      call driver%finalize()
   end subroutine run_in_memory

   !> All arrays, with room for the rows.
   subroutine prepare_table(table, layout, n_rows, time)
      type(result_table), intent(inout) :: table
      type(row_layout), intent(in) :: layout
      integer, intent(in) :: n_rows
      integer, intent(out) :: time !! place of the times
      character(len=name_length) :: dims(2)
      integer :: i, m

      do i = 1, size(chain_axes)
         associate (axis => chain_axes(i))
            call table%add(trim(axis%name), entries(axis, layout%n_rods), trim(axis%name), '1', trim(axis%long_name))
         end associate
      end do
      call table%extend('time', ['time'], [n_rows], 's', 'time')
      time = table%n
      allocate (table%arrays(time)%reals(n_rows))
      do i = 1, size(layout%quantities)
         associate (x => layout%quantities(i))
            m = x%last - x%first + 1
            if (x%along > 0) then
               dims(1) = 'time'
               dims(2) = chain_axes(x%along)%name
               call table%extend(trim(x%name), dims, [n_rows, m], trim(x%units), trim(x%long_name))
            else
               call table%extend(trim(x%name), ['time'], [n_rows], trim(x%units), trim(x%long_name))
            end if
         end associate
         allocate (table%arrays(table%n)%reals(n_rows*int(m, i8)))
      end do
   end subroutine prepare_table

   !> One more row.
   subroutine keep(self, error)
      class(memory_recorder), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      integer(i8) :: before, m
      integer :: i

      if (allocated(error)) return
      self%table%arrays(self%time)%reals(self%n_rows + 1) = self%row%time
      do i = 1, size(self%row%layout%quantities)
         associate (x => self%row%layout%quantities(i))
            m = x%last - x%first + 1
            before = m*self%n_rows
            self%table%arrays(self%time + i)%reals(before + 1:before + m) = self%row%values(x%first:x%last)
         end associate
      end do
      self%n_rows = self%n_rows + 1
   end subroutine keep

   !> Rows that there are, events, and attributes.
   subroutine complete_table(table, recorder, driver, motion, config, origin, seconds, failure)
      type(result_table), intent(inout) :: table
      type(memory_recorder), intent(in) :: recorder
      type(driver_type), intent(inout) :: driver
      type(motion_type), intent(in) :: motion
      type(case_config), intent(in) :: config
      type(provenance), intent(in) :: origin
      real(wp), intent(in) :: seconds !! wall time of the run [s]
      type(error_type), allocatable, intent(in) :: failure
      type(solver_report) :: report
      type(attribute_list) :: solver
      character(len=:), allocatable :: status
      integer :: i

      table%arrays(recorder%time:recorder%time + size(recorder%row%layout%quantities))%shape(1) = recorder%n_rows
      if (motion%events%watches) call add_events(table, motion)
      call recorder%make_report(driver, motion, config, seconds, report)
      status = 'done'
      if (allocated(failure)) status = trim(merge('stopped', 'failed ', failure%exit_code == exit_stopped))
      call origin%list(status, table%attributes)
      call table%attributes%add('t_reached', last_time(table, recorder))
      call table%attributes%add('warnings', report%warnings)
      if (allocated(failure)) call table%attributes%add('message', failure%message)
      call report%list(motion%ledger, solver)
      do i = 1, solver%n
         solver%items(i)%name = 'solver_'//solver%items(i)%name
      end do
      call table%attributes%append(solver)
   end subroutine complete_table

   !> Time of the last row [s].
   pure real(wp) function last_time(table, recorder)
      type(result_table), intent(in) :: table
      type(memory_recorder), intent(in) :: recorder
      last_time = 0.0_wp
      if (recorder%n_rows > 0) last_time = table%arrays(recorder%time)%reals(recorder%n_rows)
   end function last_time

   !> What hinges did; the columns of the group `events` of a run file, over a dimension of their own.
   subroutine add_events(table, motion)
      type(result_table), intent(inout) :: table
      type(motion_type), intent(in) :: motion
      associate (events => motion%events%log(:motion%events%n_logged), x => event_columns)
         call table%add('event_time', events%time, 'event', x(1)%units, trim(x(1)%long_name))
         call table%add('event_hinge', events%hinge, 'event', x(2)%units, trim(x(2)%long_name))
         call table%add('event_kind', kind_names(events%kind), 'event', x(3)%units, trim(x(3)%long_name))
         call table%add('event_energy_lost', events%energy_lost, 'event', x(4)%units, trim(x(4)%long_name))
      end associate
   end subroutine add_events

end module rodyn_memory_run
