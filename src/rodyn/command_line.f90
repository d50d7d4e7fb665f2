!> The commands of the program, SPEC "Commands".
module rodyn_command_line
   use, intrinsic :: iso_fortran_env, only: error_unit
   use rodyn_errors, only: error_type, raise, exit_done, exit_bad_input
   use rodyn_case_config, only: case_config
   use rodyn_case_reader, only: read_case, default_case
   use rodyn_run, only: run_case
   use rodyn_posix, only: same_path, write_output
   use rodyn_build_info, only: program_version, git_commit
   implicit none (type, external)
   private
   public :: run_command

   !> Options of all commands, as typed.
   type :: options_type
      character(len=:), allocatable :: file   !! the one positional argument
      character(len=:), allocatable :: output !! --output
      logical :: force = .false.
      logical :: quiet = .false.
      logical :: help = .false.
   end type options_type

   character(len=*), parameter :: nl = new_line('a')

contains

   !> Do what the arguments of the program say.
   subroutine run_command(exit_code)
      integer, intent(out) :: exit_code
      type(error_type), allocatable :: error
      type(options_type) :: options
      character(len=:), allocatable :: command

      command = ''
      if (command_argument_count() > 0) command = argument(1)
      select case (command)
      case ('run', 'check')
         call read_options(options, error)
         if (.not. allocated(error)) then
            if (options%help) then
               call print_text(help_text(command), error)
            else if (command == 'run') then
               call run_file_command(options, error)
            else
               call check_command(options, error)
            end if
         end if
      case ('defaults')
         call defaults_command(error)
      case ('--version')
         call print_text('rodyn '//program_version//' ('//git_commit//')', error)
      case ('--help', '-h', 'help')
         call print_text(help_text(''), error)
      case ('')
         call raise(error, help_text(''), exit_bad_input)
      case default
         call raise(error, "rodyn: there is no command '"//command//"'"//nl//help_text(''), exit_bad_input)
      end select
      exit_code = exit_done
      if (.not. allocated(error)) return
      write (error_unit, '(a)') error%message
      exit_code = error%exit_code
   end subroutine run_command

   !> Print what a command was asked for. That it could not be written is a failure.
   subroutine print_text(text, error)
      character(len=*), intent(in) :: text !! without the closing newline
      type(error_type), allocatable, intent(inout) :: error
      character(len=:), allocatable :: failure
      failure = write_output(text//nl)
      if (len(failure) > 0) call raise(error, 'rodyn: standard output cannot be written: '//failure)
   end subroutine print_text

   !> rodyn run
   subroutine run_file_command(options, error)
      type(options_type), intent(in) :: options
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      character(len=:), allocatable :: text, path

      call read_case(options%file, config, text, error)
      if (allocated(error)) return
      path = output_path(options, config)
      if (same_path(path, options%file)) then
         call raise(error, path//': is the case itself; give the result another name by --output', exit_bad_input)
         return
      end if
      call run_case(config, path, error, input_text=text, force=options%force, quiet=options%quiet)
   end subroutine run_file_command

   !> rodyn check
   subroutine check_command(options, error)
      type(options_type), intent(in) :: options
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      character(len=:), allocatable :: text

      call read_case(options%file, config, text, error)
      if (.not. allocated(error) .and. .not. options%quiet) call print_text(options%file//': valid', error)
   end subroutine check_command

   !> rodyn defaults [run]
   subroutine defaults_command(error)
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: kind, text

      kind = 'run'
      if (command_argument_count() > 1) kind = argument(2)
      select case (kind)
      case ('run')
         if (command_argument_count() > 2) then
            call raise(error, "rodyn defaults: '"//argument(3)//"' is too much", exit_bad_input)
            return
         end if
         text = default_case()
         call print_text(text(:len(text) - 1), error) ! its last newline is print_text's
      case ('--help', '-h')
         call print_text(help_text('defaults'), error)
      case default
         call raise(error, "rodyn defaults: '"//kind//"' is not one of: run", exit_bad_input)
      end select
   end subroutine defaults_command

   !> Where the result goes: --output, or &output file, or the case's own name with .h5.
   function output_path(options, config) result(path)
      type(options_type), intent(in) :: options
      type(case_config), intent(in) :: config
      character(len=:), allocatable :: path
      integer :: dot, slash

      if (allocated(options%output)) then
         path = options%output
         return
      end if
      if (allocated(config%output%file)) then
         path = config%output%file
         if (len(path) > 0) return
      end if
      path = options%file
      slash = index(path, '/', back=.true.)
      dot = index(path, '.', back=.true.)
      if (dot > slash + 1) path = path(:dot - 1)
      path = path(slash + 1:)//'.h5'
   end function output_path

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
         else if (word == '--force' .and. argument(1) == 'run') then
            options%force = .true.
         else if (word == '--quiet') then
            options%quiet = .true.
         else if ((word == '--output' .or. word == '-o') .and. argument(1) == 'run') then
            i = i + 1
            if (i > command_argument_count()) then
               call raise(error, 'rodyn '//argument(1)//': --output needs a file name', exit_bad_input)
               return
            end if
            options%output = argument(i)
         else if (index(word, '--output=') == 1 .and. argument(1) == 'run') then
            options%output = word(len('--output=') + 1:)
         else if (index(word, '-') == 1 .and. len(word) > 1) then
            call raise(error, 'rodyn '//argument(1)//": there is no option '"//word//"'", exit_bad_input)
            return
         else if (allocated(options%file)) then
            call raise(error, 'rodyn '//argument(1)//": one file at a time; '"//word//"' is too much", exit_bad_input)
            return
         else
            options%file = word
         end if
         i = i + 1
      end do
      if (.not. allocated(options%file)) &
         call raise(error, 'rodyn '//argument(1)//': which file?'//nl//help_text(argument(1)), exit_bad_input)
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
                '  --output FILE.h5   name of the result'//nl// &
                '  --force            replace an existing result'//nl// &
                '  --quiet            print nothing but errors'//nl// &
                'Exit codes: 0 done, 1 the run failed (the file holds all rows until then), 2 bad input.'
      case ('check')
         text = 'rodyn check FILE.nml [--quiet]'//nl// &
                '  Validate only: print every fault of the file at once. Exit code 0 or 2.'
      case ('defaults')
         text = 'rodyn defaults [run]'//nl// &
                '  Print a complete commented namelist with every key and its default.'
      case default
         text = 'Rodyn '//program_version//': planar dynamics of a chain of elastic rods on a spacecraft'//nl// &
                '  rodyn run CASE.nml [--output FILE.h5] [--force] [--quiet]   one scene to one HDF5 file'//nl// &
                '  rodyn check FILE.nml                                        validate only'//nl// &
                '  rodyn defaults [run]                                        a namelist with every key'//nl// &
                '  rodyn --version | --help | COMMAND --help'
      end select
   end function help_text

end module rodyn_command_line
