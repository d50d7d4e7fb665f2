!> The commands of the program: `rodyn --help`.
module rodyn_command_line
   use rodyn_errors, only: error_type, raise, exit_done, exit_bad_input
   use rodyn_case_config, only: case_config
   use rodyn_case_reader, only: case_from_document, default_case
   use rodyn_case_notes, only: case_notes, degrees_note
   use rodyn_input_texts, only: input_texts, is_result_file, is_stream, read_input_texts
   use rodyn_launcher, only: direct_launch, launch_type
   use rodyn_modal_analysis, only: analyse_modes
   use rodyn_posix_files, only: stop_signals, watch_signals
   use rodyn_run, only: check_steps, run_case
   use rodyn_posix, only: ignore_signal, same_path, sigpipe, standard_output, write_text
   use rodyn_resources, only: ensure_stack
   use rodyn_scene, only: scene_type, compile_scene
   use rodyn_sweep_config, only: sweep_config
   use rodyn_sweep_engine, only: run_sweep, sweep_options
   use rodyn_sweep_plan, only: new_plan, sweep_plan
   use rodyn_sweep_reader, only: default_sweep, parse_sweep
   use rodyn_terminal, only: print_error_line
   use rodyn_text, only: as_utf8, joined, to_text, with_line_ends
   use rodyn_build_info, only: program_version, git_commit
   implicit none (type, external)
   private
   public :: run_command

   !> Options of all commands, as typed.
   type, extends(sweep_options) :: options_type
      logical :: help = .false., equilibrium = .false., loads = .false.
      character(len=:), allocatable :: shard_text !! of --shard
   end type options_type

   character(len=*), parameter :: nl = new_line('a')

contains

   !> Do what the arguments of the program say. Of processes that were started together, the first speaks for all.
   subroutine run_command(exit_code)
      integer, intent(out) :: exit_code
      type(error_type), allocatable :: error
      type(options_type) :: options
      type(launch_type) :: launch
      character(len=:), allocatable :: command

      exit_code = exit_done
      launch = direct_launch()
      command = ''
      if (command_argument_count() > 0) command = argument(1)
      if (launch%rank > 0 .and. all(command /= [character(len=5) :: 'run', 'modes', 'sweep'])) return
      select case (command)
      case ('run', 'check', 'sweep', 'modes')
         call ignore_signal(sigpipe) ! what nobody reads does not end what is computed
         call ensure_stack(error)
         if (.not. allocated(error)) call read_options(options, error)
         if (.not. allocated(error)) then
            if (options%help) then
               if (launch%rank == 0) call print_text(help_text(command), error)
            else if (launch%count > 1 .and. (command == 'run' .or. command == 'modes')) then
               call refuse_several_processes(command, launch, error)
            else if (command == 'run') then
               call run_file_command(options, error)
            else if (command == 'sweep') then
               call sweep_command(options, exit_code, error)
               if (.not. allocated(error)) return
            else if (command == 'modes') then
               call modes_command(options, error)
            else
               call check_command(options, error)
            end if
         end if
      case ('defaults')
         call defaults_command(error)
      case ('--version')
         call print_text('rodyn '//program_version//' ('//git_commit()//')', error)
      case ('--help', '-h', 'help')
         call print_text(help_text(''), error)
      case ('')
         call raise(error, help_text(''), exit_bad_input)
      case default
         call raise(error, "rodyn: unknown command '"//command//"'"//nl//help_text(''), exit_bad_input)
      end select
      exit_code = exit_done
      if (.not. allocated(error)) return
      if (launch%rank == 0) call print_error_line(as_utf8(error%message))
      exit_code = error%exit_code
   end subroutine run_command

   !> Several processes would all compute the same.
   subroutine refuse_several_processes(command, launch, error)
      character(len=*), intent(in) :: command
      type(launch_type), intent(in) :: launch
      type(error_type), allocatable, intent(out) :: error
      call raise(error, 'rodyn '//command//': '//to_text(launch%count)//' processes were started together ('//launch%variable// &
                 ' = '//to_text(launch%count)//'), and one computes a case; start it without mpirun or srun, '// &
                 'or with one process. rodyn sweep shares many cases among processes; to give each process a case of its own, '// &
                 'unset '//launch%variable, exit_bad_input)
   end subroutine refuse_several_processes

   !> Print what a command was asked for. That it could not be written is a failure.
   subroutine print_text(text, error)
      character(len=*), intent(in) :: text !! without the closing newline
      type(error_type), allocatable, intent(inout) :: error
      character(len=:), allocatable :: failure
      failure = write_text(standard_output, text//nl)
      if (len(failure) > 0) call raise(error, 'rodyn: standard output cannot be written: '//failure)
   end subroutine print_text

   !> rodyn run
   subroutine run_file_command(options, error)
      type(options_type), intent(in) :: options
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(input_texts) :: input
      character(len=:), allocatable :: path

      call read_one_case(options%file, 'rodyn sweep computes it', input, config, error)
      if (allocated(error)) return
      path = output_path(options, config, input%from_result)
      call refuse_input(path, options, error)
      if (allocated(error)) return
      call watch_signals()
      call run_case(config, path, error, input_text=input%text, force=options%force, quiet=options%quiet, name=input%name)
   end subroutine run_file_command

   !> The case of a file, which must not be a sweep.
   subroutine read_one_case(file, instead, input, config, error)
      character(len=*), intent(in) :: file
      character(len=*), intent(in) :: instead !! what is told of a sweep
      type(input_texts), intent(out) :: input
      type(case_config), intent(out) :: config
      type(error_type), allocatable, intent(out) :: error

      call read_input_texts(file, input, error)
      if (allocated(error)) return
      if (input%is_sweep) then
         call raise(error, file//': is a sweep; '//instead, exit_bad_input)
      else
         call case_from_document(input%document, config, error)
      end if
   end subroutine read_one_case

   !> The result must have a name, and must not take the place of the case.
   subroutine refuse_input(path, options, error)
      character(len=*), intent(in) :: path
      type(options_type), intent(in) :: options
      type(error_type), allocatable, intent(out) :: error
      if (len(path) == 0 .and. .not. allocated(options%output)) then
         call raise(error, name_is_required('FILE.h5'), exit_bad_input)
      else if (options%file /= '-' .and. same_path(path, options%file)) then
         call raise(error, path//': is the case itself; give the result another name by --output', exit_bad_input)
      end if
   end subroutine refuse_input

   !> What is told where the input is a stream, and so gives the result no name.
   function name_is_required(kind) result(text)
      character(len=*), intent(in) :: kind !! of name
      character(len=:), allocatable :: text
      text = 'rodyn '//argument(1)//': the input is a stream without a name of its own; name the result by --output '//kind
   end function name_is_required

   !> rodyn modes
   subroutine modes_command(options, error)
      type(options_type), intent(in) :: options
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(input_texts) :: input
      character(len=:), allocatable :: path

      call read_one_case(options%file, 'modes are those of one case', input, config, error)
      if (allocated(error)) return
      path = '_modes'
      if (options%equilibrium) path = path//'_equilibrium'
      if (options%loads) path = path//'_loads'
      path = result_name(options, path//'.h5')
      call refuse_input(path, options, error)
      if (.not. allocated(error)) call analyse_modes(config, path, options%equilibrium, options%loads, error, &
                                                     input_text=input%text, &
                                                     force=options%force, quiet=options%quiet)
   end subroutine modes_command

   !> rodyn check
   subroutine check_command(options, error)
      type(options_type), intent(in) :: options
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(sweep_config) :: sweep
      type(sweep_plan) :: plan
      type(scene_type) :: scene
      type(input_texts) :: input
      character(len=*), parameter :: mark = 'note    '
      character(len=:), allocatable :: name, notes

      call read_input_texts(options%file, input, error)
      if (allocated(error)) return
      name = input%name
      if (input%from_result) name = options%file
      if (input%is_sweep) then
         call parse_sweep(input, .true., sweep, error)
         if (.not. allocated(error)) call new_plan(plan, sweep, error)
         if (.not. allocated(error)) call compile_scene(scene, sweep%base_case, error)
      else ! numbers may be finite, and what follows from them not
         call case_from_document(input%document, config, error)
         if (.not. allocated(error)) call compile_scene(scene, config, error)
         if (.not. allocated(error)) call check_steps(config, input%name, error)
      end if
      if (allocated(error) .or. options%quiet) return
      name = name//': valid'
      if (input%is_sweep) then
         name = name//sweep%tried
         notes = sweep_notes(sweep)
      else
         notes = case_notes(config, .true.)
      end if
      if (len(notes) > 0) name = name//nl//mark//with_line_ends(notes, nl//mark)
      call print_text(name, error)
   end subroutine check_command

   !> Angles of a sweep, of its base and of its axes, that look like degrees.
   function sweep_notes(sweep) result(text)
      type(sweep_config), intent(in) :: sweep
      character(len=:), allocatable :: text
      integer :: i

      text = case_notes(sweep%base_case, .false.)
      do i = 1, size(sweep%axes)
         associate (axis => sweep%axes(i))
            if (axis%unit == 'rad' .and. .not. axis%textual) &
               text = joined(text, degrees_note('axis '//trim(axis%key), axis%numbers), nl)
         end associate
      end do
   end function sweep_notes

   !> rodyn sweep
   subroutine sweep_command(options, exit_code, error)
      type(options_type), intent(in) :: options
      integer, intent(out) :: exit_code
      type(error_type), allocatable, intent(out) :: error
      type(sweep_options) :: sweep

      exit_code = exit_bad_input
      sweep = options%sweep_options
      sweep%output = result_name(options, trim(merge('-again', '      ', is_result_file(options%file))))
      if (len(sweep%output) == 0 .and. .not. allocated(options%output)) then
         call raise(error, name_is_required('DIR'), exit_bad_input)
         return
      end if
      if (allocated(options%shard_text)) call read_shard(options%shard_text, sweep%shard, sweep%n_shards, error)
      if (sweep%force .and. sweep%n_shards > 0 .and. .not. allocated(error)) &
         call raise(error, 'rodyn sweep: --force would remove the results of other shards; use it without --shard', &
                    exit_bad_input)
      if (.not. allocated(error)) call run_sweep(sweep, exit_code, error)
   end subroutine sweep_command

   !> '3/16'
   subroutine read_shard(text, shard, n_shards, error)
      character(len=*), intent(in) :: text
      integer, intent(out) :: shard, n_shards
      type(error_type), allocatable, intent(out) :: error
      integer :: slash, stat

      slash = index(text, '/')
      stat = 1
      shard = 0
      n_shards = 0
      if (verify(text, '0123456789/') == 0 .and. slash > 1 .and. slash < len(text) .and. len(text) <= 13) then
         read (text(:slash - 1), '(i6)', iostat=stat) shard
         if (stat == 0) read (text(slash + 1:), '(i6)', iostat=stat) n_shards
      end if
      if (stat /= 0 .or. shard < 1 .or. shard > n_shards) call raise(error, &
         "rodyn sweep: --shard I/N needs numbers with 1 <= I <= N <= 999999, not '"//text//"'", exit_bad_input)
   end subroutine read_shard

   !> The name of a file without directories and ending.
   pure function base_name(path) result(name)
      character(len=*), intent(in) :: path
      character(len=:), allocatable :: name
      integer :: dot
      name = path(index(path, '/', back=.true.) + 1:)
      dot = index(name, '.', back=.true.)
      if (dot > 1) name = name(:dot - 1)
   end function base_name

   !> rodyn defaults [run|sweep]
   subroutine defaults_command(error)
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: kind, text

      kind = 'run'
      if (command_argument_count() > 1) kind = argument(2)
      select case (kind)
      case ('run', 'sweep')
         if (command_argument_count() > 2) then
            call raise(error, "rodyn defaults: unexpected argument '"//argument(3)//"'", exit_bad_input)
            return
         end if
         if (kind == 'run') text = default_case()
         if (kind == 'sweep') text = default_sweep()
         call print_text(text(:len(text) - 1), error) ! its last newline is print_text's
      case ('--help', '-h')
         call print_text(help_text('defaults'), error)
      case default
         call raise(error, "rodyn defaults: '"//kind//"' is not one of: run, sweep", exit_bad_input)
      end select
   end subroutine defaults_command

   !> Where the result goes: --output, or &output file, or the case's own name with .h5. A run that is made again from
   !> its result never takes that one's name.
   function output_path(options, config, again) result(path)
      type(options_type), intent(in) :: options
      type(case_config), intent(in) :: config
      logical, intent(in) :: again !! the case is that of a result
      character(len=:), allocatable :: path

      path = result_name(options, trim(merge('-again.h5', '.h5      ', again)))
      if (allocated(options%output) .or. again .or. .not. allocated(config%output%file)) return
      if (len(config%output%file) > 0) path = config%output%file
   end function output_path

   !> The name that --output gives, or else that of the input with an ending; empty if that has none.
   function result_name(options, ending) result(name)
      type(options_type), intent(in) :: options
      character(len=*), intent(in) :: ending
      character(len=:), allocatable :: name
      if (allocated(options%output)) then
         name = options%output
      else if (is_stream(options%file)) then
         name = ''
      else
         name = base_name(options%file)//ending
      end if
   end function result_name

   !> Arguments behind the command.
   subroutine read_options(options, error)
      type(options_type), intent(out) :: options
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: word
      integer :: i

      i = 2
      do while (i <= command_argument_count())
         word = argument(i)
         if (word == '--help' .or. word == '-h') then
            options%help = .true.
            return
         else if (word == '--force' .and. argument(1) /= 'check') then
            options%force = .true.
         else if (word == '--quiet') then
            options%quiet = .true.
         else if (word == '--equilibrium' .and. argument(1) == 'modes') then
            options%equilibrium = .true.
         else if (word == '--loads' .and. argument(1) == 'modes') then
            options%loads = .true.
         else if (word == '--dry-run' .and. argument(1) == 'sweep') then
            options%dry_run = .true.
         else if (word == '--retry-failed' .and. argument(1) == 'sweep') then
            options%retry_failed = .true.
         else if (word == '--shard' .and. argument(1) == 'sweep') then
            i = i + 1
            if (i > command_argument_count()) then
               call raise(error, 'rodyn sweep: --shard needs I/N', exit_bad_input)
               return
            end if
            options%shard_text = argument(i)
         else if (index(word, '--shard=') == 1 .and. argument(1) == 'sweep') then
            options%shard_text = word(len('--shard=') + 1:)
         else if ((word == '--output' .or. word == '-o') .and. argument(1) /= 'check') then
            i = i + 1
            if (i > command_argument_count()) then
               call raise(error, 'rodyn '//argument(1)//': --output needs a file name', exit_bad_input)
               return
            end if
            options%output = argument(i)
         else if (index(word, '--output=') == 1 .and. argument(1) /= 'check') then
            options%output = word(len('--output=') + 1:)
         else if (index(word, '-') == 1 .and. len(word) > 1) then
            call raise(error, 'rodyn '//argument(1)//": unknown option '"//word//"'", exit_bad_input)
            return
         else if (allocated(options%file)) then
            call raise(error, 'rodyn '//argument(1)//": one file at a time; unexpected argument '"//word//"'", exit_bad_input)
            return
         else
            options%file = word
         end if
         i = i + 1
      end do
      if (.not. allocated(options%file)) &
         call raise(error, 'rodyn '//argument(1)//': no file given'//nl//help_text(argument(1)), exit_bad_input)
   end subroutine read_options

   !> Argument i, whole.
   function argument(i) result(text)
      integer, intent(in) :: i
      character(len=:), allocatable :: text
      integer :: length
      call get_command_argument(i, length=length)
      allocate (character(len=length) :: text)
      if (length > 0) call get_command_argument(i, text)
   end function argument

   !> What --help prints.
   function help_text(command) result(text)
      character(len=*), intent(in) :: command
      character(len=:), allocatable :: text

      select case (command)
      case ('run')
         text = 'rodyn run CASE.nml [--output FILE.h5] [--force] [--quiet]'//nl// &
                '  Integrate one scene and write its HDF5 file (default: CASE.h5 in the working directory).'//nl// &
                '  The case may be a result of an earlier run: its stored input is run again (default: CASE-again.h5).'//nl// &
                '  - reads it from standard input; that, or a pipe, gives the result no name: use --output.'//nl// &
                '  --output FILE.h5   name of the result'//nl// &
                '  --force            replace an existing result when the new one is complete; if it fails it is named'//nl// &
                '                     FILE.h5.failed'//nl// &
                '  --quiet            print nothing but errors'//nl// &
                'Exit codes: 0 done, 1 the run failed (the file holds all rows until then), 2 bad input,'//nl// &
                '75 stopped by '//stop_signals()//nl// &
                '(rows until then in FILE.h5.stopped; run again).'
      case ('modes')
         text = 'rodyn modes CASE.nml [--equilibrium | --loads] [--output FILE.h5] [--force] [--quiet]'//nl// &
                '  Linearise the scene in full at its initial state, without its loads. Natural frequencies,'//nl// &
                '  damping ratios, mode shapes and matrices go to one HDF5 file (default: CASE_modes.h5 in the working'//nl// &
                '  directory, or CASE_modes_equilibrium.h5, CASE_modes_loads.h5), a table to the terminal. - reads the'//nl// &
                '  case from standard input.'//nl// &
                '  --equilibrium      at the equilibrium near the initial state instead, under the loads that act at'//nl// &
                '                     t = 0 (they must be constant), at rest on a spacecraft with the initial spin'//nl// &
                '  --loads            at the initial state, under the loads that act at t = 0'//nl// &
                '  --output FILE.h5   name of the result'//nl// &
                '  --force            replace an existing result'//nl// &
                '  --quiet            print nothing but errors'//nl// &
                'Exit codes: 0 done, 1 no modes or no equilibrium, 2 bad input.'
      case ('sweep')
         text = 'rodyn sweep SWEEP.nml [--output DIR] [--shard I/N] [--dry-run] [--retry-failed] [--force] [--quiet]'//nl// &
                '  Compute many variants of a case; the result is DIR/sweep.h5 (default: SWEEP in the working directory).'//nl// &
                '  Run the same command again to resume; under mpirun or srun the ranks share the cases.'//nl// &
                '  A sweep.h5 in place of SWEEP.nml is computed anew from its stored input (default: sweep-again).'//nl// &
                '  - reads the sweep from standard input; its base is then found from the working directory.'//nl// &
                '  --output DIR       directory of results; made if it does not exist'//nl// &
                '  --shard I/N        every N-th case, beginning with the I-th; the last shard to end merges all'//nl// &
                '  --dry-run          print the table of cases, and an estimate of time and disk'//nl// &
                '  --retry-failed     compute the failed cases again, and the missing ones'//nl// &
                '  --force            discard what the directory holds of another sweep or an older one; its sweep.h5'//nl// &
                '                     stays as sweep.h5.before until the new one is there'//nl// &
                '  --quiet            print nothing but errors'//nl// &
                'Exit codes: 0 done, 1 a case failed (its states are NaN) or the sweep is incomplete, 2 bad input,'//nl// &
                '75 stopped by '//stop_signals()//'.'
      case ('check')
         text = 'rodyn check FILE.nml [--quiet]'//nl// &
                '  Validate only: print every fault of the file at once; of a result, those of its stored input.'//nl// &
                '  - reads standard input.'//nl// &
                '  Exit code 0 or 2.'
      case ('defaults')
         text = 'rodyn defaults [run|sweep]'//nl// &
                '  Print a complete commented namelist with every key and its default.'
      case default
         text = 'Rodyn '//program_version//': planar dynamics of a chain of elastic rods on a spacecraft'//nl// &
                '  rodyn run CASE.nml [--output FILE.h5] [--force] [--quiet]   one scene to one HDF5 file'//nl// &
                '  rodyn sweep SWEEP.nml [--output DIR] [--shard I/N] ...      many scenes to DIR/sweep.h5'//nl// &
                '  rodyn modes CASE.nml [--equilibrium] [--output FILE.h5]     natural frequencies and mode shapes'//nl// &
                '  rodyn check FILE.nml                                        validate only'//nl// &
                '  rodyn defaults [run|sweep]                                  a namelist with every key'//nl// &
                '  rodyn --version | --help | COMMAND --help'
      end select
   end function help_text

end module rodyn_command_line
