!> One case from its description to its HDF5 file: what `rodyn run` does, and what a library user may call.
module rodyn_run
   use rodyn_kinds, only: wp, i8
   use rodyn_terminal, only: print_line
   use rodyn_text, only: formatted, time_text, to_text, with_line_ends
   use rodyn_errors, only: error_type, exit_stopped
   use rodyn_case_config, only: case_config
   use rodyn_case_check, only: sound_case
   use rodyn_motion, only: motion_type
   use rodyn_integrator, only: solver_statistics
   use rodyn_lapack, only: use_one_thread
   use rodyn_driver, only: driver_type, new_driver
   use rodyn_recorder, only: recorder_type
   use rodyn_simulation, only: even_times, simulate
   use rodyn_quantities, only: layout_of
   use rodyn_run_needs, only: check_needs
   use rodyn_run_setup, only: run_setup, new_run_setup
   use rodyn_run_file, only: run_file, run_header, check_output_path
   use rodyn_run_report, only: solver_report
   use rodyn_progress, only: progress_monitor, new_progress
   use rodyn_description, only: describe_scene
   use rodyn_origin, only: describe_origin
   use rodyn_hinge_mechanism, only: kind_names
   use rodyn_user_load, only: user_load
   use rodyn_step_limit, only: check_fixed_step
   implicit none (type, external)
   private
   public :: run_case, check_steps

   !> Writes rows into the run file.
   type, extends(recorder_type) :: file_recorder
      type(run_file) :: file
   contains
      procedure :: keep
   end type file_recorder

contains

   !> Run a case and write its file. On failure of the integration the file holds all rows until then, with
   !> status 'failed', or `path`.failed where `force` is set and there is a result that has not failed; on refused input nothing
   !> is written. A run that is asked to stop (see `watch_signals`) leaves
   !> its rows in `path`.stopped, so that the same call can be made again; of two stopped runs the more rows stay.
   subroutine run_case(given, path, error, input_text, force, quiet, load, name)
      type(case_config), intent(in) :: given
      character(len=*), intent(in) :: path                 !! of the HDF5 file
      type(error_type), allocatable, intent(out) :: error
      character(len=*), intent(in), optional :: input_text !! namelist as read, kept in the file
      logical, intent(in), optional :: force               !! replace an existing file
      logical, intent(in), optional :: quiet               !! print nothing
      class(user_load), target, intent(inout), optional :: load !! forces of the caller's, beside those of the case
      character(len=*), intent(in), optional :: name       !! of the case, for what is refused of its keys
      type(case_config) :: config !! with what is not given
      type(run_setup), target :: setup
      type(file_recorder) :: recorder
      type(driver_type) :: driver
      type(progress_monitor), target :: progress
      type(error_type), allocatable :: failure
      type(run_header) :: header
      logical :: silent, replace, earlier
      integer(i8) :: clock_start, clock_end, clock_rate
      real(wp) :: t, seconds

      silent = .false.
      replace = .false.
      if (present(quiet)) silent = quiet
      if (present(force)) replace = force
      call system_clock(clock_start, clock_rate)
      call use_one_thread() ! or the number of cores would decide the last digits

      call check_output_path(path, replace, error)
      if (.not. allocated(error)) call sound_case(given, config, error)
      if (.not. allocated(error)) call check_needs(config, path, error)
      if (.not. allocated(error)) call new_run_setup(setup, config, config%output%ledger, error, load)
      if (allocated(error)) return
      progress = new_progress(0.0_wp, config%t_end, silent)
      call new_driver(driver, setup%motion, setup%y, config%solver, config%t_end, config%n_outputs, error, progress)
      if (allocated(error) .and. present(name)) error%message = name//': '//error%message
      if (allocated(error)) return
      call describe_origin(config, setup%motion, setup%y, .true., header)
      header%input = ''
      if (present(input_text)) header%input = input_text
      if (.not. silent) call print_line(describe_scene(setup%motion%dynamics%scene, config%output%ledger))
      if (.not. silent) call print_line('method  '//driver%methods()//': '//driver%reason())
      if (.not. silent) call print_lines('note   ', header%notes)
      call driver%make(error)
      if (.not. allocated(error)) call begin_file(recorder, setup%motion, config, path, replace, header, error)
      if (allocated(error)) return
      call simulate(setup%motion, driver, even_times(config%t_end, config%n_outputs), config%t_end, recorder, setup%y, t, failure)
      call progress%finish()
      call system_clock(clock_end)
      seconds = real(clock_end - clock_start, wp)/real(clock_rate, wp)
      call end_file(recorder, driver, setup%motion, config, path, .not. present(load), seconds, failure, earlier, error)
      if (.not. silent .and. .not. allocated(error)) call print_result(driver, recorder, setup%motion, t, seconds, failure)
      call driver%finalize()
      if (allocated(error) .or. .not. allocated(failure)) return
      failure%message = failure%message//' (rows until then are in '//recorder%file%path// &
                        trim(merge(', of an earlier run)', ')                   ', earlier))
      call move_alloc(failure, error)
   end subroutine run_case

   !> What `run_case` would refuse of the steps of a case, exit code 2: see `rodyn_step_limit`.
   subroutine check_steps(config, name, error)
      type(case_config), intent(in) :: config
      character(len=*), intent(in) :: name !! of the case
      type(error_type), allocatable, intent(out) :: error
      type(run_setup) :: setup

      if (.not. config%solver%fixed_step > 0.0_wp) return
      call new_run_setup(setup, config, .false., error)
      if (.not. allocated(error)) call check_fixed_step(trim(config%solver%method), config%solver%solver_options, &
                                                        setup%motion%dynamics%scene, setup%motion%switches, setup%y, &
                                                        config%t_end, error)
      if (allocated(error)) error%message = name//': '//error%message
   end subroutine check_steps

   !> Create the file.
   subroutine begin_file(recorder, motion, config, path, replace, header, error)
      type(file_recorder), intent(inout) :: recorder
      type(motion_type), intent(in) :: motion
      type(case_config), intent(in) :: config
      character(len=*), intent(in) :: path
      logical, intent(in) :: replace
      type(run_header), intent(inout) :: header !! what the file says of its origin; the rest is put in here
      type(error_type), allocatable, intent(out) :: error

      header%layout = layout_of(config)
      header%n_rows = config%n_outputs + 1
      header%compression = config%output%compression
      call recorder%file%create(path, header, replace, error)
      if (allocated(error)) return
      call recorder%prepare(motion%dynamics%scene, header%layout, header%n_rows, config%model)
   end subroutine begin_file

   !> Write one row.
   subroutine keep(self, error)
      class(file_recorder), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      call self%file%append(self%row, error)
   end subroutine keep

   !> Events, attributes and the final name, whatever has ended the run: one that was stopped may step aside, or yield to an earlier
   !> one that has more rows.
   subroutine end_file(recorder, driver, motion, config, path, may_resume, seconds, failure, earlier, error)
      type(file_recorder), intent(inout) :: recorder
      type(driver_type), intent(inout) :: driver
      type(motion_type), intent(in) :: motion
      type(case_config), intent(in) :: config
      character(len=*), intent(in) :: path
      logical, intent(in) :: may_resume !! the file alone says what was run
      real(wp), intent(in) :: seconds   !! wall time of the run [s]
      type(error_type), allocatable, intent(in) :: failure
      logical, intent(out) :: earlier   !! the rows of an earlier run are kept instead
      type(error_type), allocatable, intent(out) :: error

      earlier = .false.
      if (allocated(failure)) then
         if (failure%exit_code == exit_stopped) call recorder%file%stop_at(path//'.stopped', may_resume, earlier)
      end if
      if (earlier) then
         call recorder%file%discard()
         return
      end if
      if (motion%events%watches) call write_events(recorder%file, motion, error)
      if (.not. allocated(error)) call close_file(recorder, driver, motion, config, failure, seconds, error)
   end subroutine end_file

   !> Attributes of the solver, status, and the final name.
   subroutine close_file(recorder, driver, motion, config, failure, seconds, error)
      type(file_recorder), intent(inout) :: recorder
      type(driver_type), intent(inout) :: driver
      type(motion_type), intent(in) :: motion
      type(case_config), intent(in) :: config
      type(error_type), allocatable, intent(in) :: failure
      real(wp), intent(in) :: seconds
      type(error_type), allocatable, intent(out) :: error
      type(solver_report) :: report

      call recorder%make_report(driver, motion, config, seconds, report)
      if (.not. allocated(failure)) then
         call recorder%file%finish('done', report, error)
      else if (failure%exit_code == exit_stopped) then
         call recorder%file%finish('stopped', report, error, failure%message)
      else
         call recorder%file%finish('failed', report, error, failure%message)
      end if
   end subroutine close_file

   !> What hinges did, into the file.
   subroutine write_events(file, motion, error)
      type(run_file), intent(inout) :: file
      type(motion_type), intent(in) :: motion
      type(error_type), allocatable, intent(out) :: error
      associate (events => motion%events%log(:motion%events%n_logged))
         call file%write_events(events%time, events%hinge, kind_names(events%kind), events%energy_lost, error)
      end associate
   end subroutine write_events

   !> Each event on a line of its own, as long as they are few. A loss is a difference of energies: what rounding leaves of it
   !> is none.
   subroutine print_events(motion, energy_scale)
      type(motion_type), intent(in) :: motion
      real(wp), intent(in) :: energy_scale !! largest energy of the run; 0: not known [J]
      integer, parameter :: most_lines = 20
      real(wp) :: lost, least
      integer :: i

      least = 16.0_wp*epsilon(1.0_wp)*energy_scale
      do i = 1, min(most_lines, motion%events%n_logged)
         associate (event => motion%events%log(i))
            lost = event%energy_lost
            if (abs(lost) <= least) lost = 0.0_wp
            call print_line('event   t = '//time_text(event%time)//' s: hinge '//to_text(event%hinge)//' '// &
               trim(kind_names(event%kind))//', '//formatted(lost, '(es10.3)')//' J lost')
         end associate
      end do
      if (motion%events%n_logged > most_lines) call print_line('event   and '// &
         to_text(motion%events%n_logged - most_lines)//' more, all in the file')
   end subroutine print_events

   !> Each line of a text behind a word.
   subroutine print_lines(word, text)
      character(len=*), intent(in) :: word, text
      if (len(text) > 0) call print_line(word//' '//with_line_ends(text, new_line('a')//word//' '))
   end subroutine print_lines

   !> Last lines on the terminal.
   subroutine print_result(driver, recorder, motion, t, seconds, failure)
      type(driver_type), intent(inout) :: driver
      type(file_recorder), intent(in) :: recorder
      type(motion_type), intent(in) :: motion
      real(wp), intent(in) :: t, seconds
      type(error_type), allocatable, intent(in) :: failure !! why the run ended early
      type(solver_statistics) :: stats
      character(len=8) :: outcome

      call print_events(motion, recorder%energy_scale)
      stats = driver%statistics()
      outcome = 'done'
      if (allocated(failure)) outcome = merge('stopped', 'failed ', failure%exit_code == exit_stopped)
      call print_line(outcome//'t = '//time_text(t)//' s, '//to_text(stats%n_steps)//' steps, '// &
         to_text(stats%n_rhs)//' right-hand-side evaluations, '//formatted(seconds, '(f20.3)')//' s')
      call print_lines('method ', driver%history)
      if (motion%ledger) call print_line('ledger  largest energy residual '// &
         formatted(recorder%worst_residual, '(es8.1)')//' J of '//formatted(recorder%energy_scale, '(es8.1)')//' J')
      call print_lines('warning', recorder%validity%warnings())
      call print_line('file    '//recorder%file%path)
   end subroutine print_result

end module rodyn_run
