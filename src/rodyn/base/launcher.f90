!> What a launcher of parallel jobs (mpirun, srun) says in the environment of the processes that it starts together.
module rodyn_launcher
   use rodyn_posix, only: parent_id, read_all, same_path
   use rodyn_text, only: to_text
   implicit none (type, external)
   private
   public :: launch_type, launched_processes, direct_launch

   !> Open MPI, MPICH and Intel MPI, MVAPICH2, IBM's jsrun, Slurm. Slurm's number of tasks of the whole job, SLURM_NTASKS, is not
   !> among them: it is set in job scripts and shells, too, which are one process.
   character(len=*), parameter :: counts(6) = [character(len=20) :: 'OMPI_COMM_WORLD_SIZE', 'PMI_SIZE', 'MPI_LOCALNRANKS', &
                                               'MV2_COMM_WORLD_SIZE', 'JSM_NAMESPACE_SIZE', 'SLURM_STEP_NUM_TASKS']
   character(len=*), parameter :: ranks(6) = [character(len=20) :: 'OMPI_COMM_WORLD_RANK', 'PMI_RANK', 'MPI_LOCALRANKID', &
                                              'MV2_COMM_WORLD_RANK', 'JSM_NAMESPACE_RANK', 'SLURM_PROCID']

   character(len=1), parameter :: nul = achar(0) ! around the words of command lines and environments

   !> Processes that were started together, each with the same command line.
   type :: launch_type
      integer :: count = 1
      integer :: rank = 0                      !! of this one
      character(len=:), allocatable :: variable !! of the environment, that says so
   end type launch_type

contains

   !> Processes that were started together, be it by scripts that were; 1 without a launcher.
   integer function launched_processes() result(n)
      integer :: i
      n = max(1, maxval([(number_in(counts(i)), i=1, size(counts))]))
   end function launched_processes

   !> Those that would all do the same: the launcher has started each with this command line, be it under a program that measures
   !> or limits it (time, timeout, perf). A script that it started knows what it does: it may give each process a case of its own.
   !> So does a shell in a job of several tasks, whose environment says the same.
   function direct_launch() result(launch)
      type(launch_type) :: launch
      integer :: i, n

      launch%variable = ''
      do i = 1, size(counts)
         n = number_in(counts(i))
         if (n <= launch%count) cycle
         if (is_started_by_script(trim(counts(i)))) cycle
         launch%count = n
         launch%rank = number_in(ranks(i))
         launch%variable = trim(counts(i))
      end do
   end function direct_launch

   !> Is there a script between the launcher, whose own environment has no such variable, and this process?
   logical function is_started_by_script(variable) result(script)
      character(len=*), intent(in) :: variable
      character(len=:), allocatable :: environment
      integer :: pid

      script = .false.
      pid = parent_id()
      do while (.not. script)
         environment = text_of(to_text(pid), 'environ') ! none of another user's, as launchers of the system are
         if (index(environment, nul//variable//'=') == 0) exit
         script = .not. wraps_this(pid, environment)
         pid = parent_of(pid)
      end do
      if (script) return
      script = same_path(variable_in(text_of('self', 'environ'), '_'), '/proc/self/exe') ! a shell that became this program
      if (.not. script) script = launcher_names_another(pid)
   end function is_started_by_script

   !> Does a process only run this command line, and in its own directory?
   logical function wraps_this(pid, environment)
      integer, intent(in) :: pid
      character(len=*), intent(in) :: environment !! of that process when it began
      wraps_this = ends_with_this(text_of(to_text(pid), 'cmdline'))
      if (wraps_this) wraps_this = same_path(variable_in(environment, 'PWD'), '.')
   end function wraps_this

   !> Has a launcher that can be asked (mpirun on this machine) another command line to start, or several, or was it started in
   !> another directory? Then shells were in between, which became this program.
   logical function launcher_names_another(pid) result(another)
      integer, intent(in) :: pid !! of the launcher, or what it has on each machine
      character(len=:), allocatable :: command
      integer :: above

      another = .false.
      above = pid
      do while (above > 1)
         command = text_of(to_text(above), 'cmdline')
         if (is_launcher(command)) then
            another = .not. (ends_with_this(command) .and. same_path('/proc/'//to_text(above)//'/cwd', '.')) .or. &
                      index(command, nul//':'//nul) > 0
            return
         end if
         above = parent_of(above)
      end do
   end function launcher_names_another

   !> Is it a command line of mpirun, whose last words are those that it starts?
   pure logical function is_launcher(command)
      character(len=*), intent(in) :: command !! between zero bytes
      integer :: first, last

      last = index(command(2:), nul)
      first = index(command(:last), '/', back=.true.) + 1
      if (first == 1) first = 2
      is_launcher = any(command(first:last) == [character(len=13) :: 'mpirun', 'mpiexec', 'mpiexec.hydra', 'orterun', 'prterun'])
   end function is_launcher

   !> Does a command line end with that of this process, by whatever path of the program?
   logical function ends_with_this(command)
      character(len=*), intent(in) :: command !! between zero bytes
      character(len=:), allocatable :: this

      this = text_of('self', 'cmdline')
      this = this(max(2, index(this(:index(this(2:), nul)), '/', back=.true.) + 1):)
      ends_with_this = len(command) > len(this) .and. len(this) > 0
      if (.not. ends_with_this) return
      associate (at => len(command) - len(this))
         ends_with_this = command(at + 1:) == this .and. (command(at:at) == '/' .or. command(at:at) == nul)
      end associate
   end function ends_with_this

   !> The value of a variable in an environment; empty if there is none.
   pure function variable_in(environment, name) result(value)
      character(len=*), intent(in) :: environment, name
      character(len=:), allocatable :: value
      integer :: first

      value = ''
      first = index(environment, nul//name//'=') + len(name) + 2
      if (first > len(name) + 2) value = environment(first:first + index(environment(first:), nul) - 2)
   end function variable_in

   !> What the system tells of a process ('self': this one), with a zero byte in front; empty if it does not tell.
   function text_of(process, name) result(text)
      character(len=*), intent(in) :: process, name
      character(len=:), allocatable :: text, failure

      call read_all('/proc/'//process//'/'//name, 16777216, text, failure)
      if (len(failure) > 0) text = ''
      if (len(text) > 0) text = nul//text
   end function text_of

   !> Process that started another one; 0 if the system does not tell.
   integer function parent_of(pid) result(above)
      integer, intent(in) :: pid
      character(len=:), allocatable :: line
      character(len=1) :: state
      integer :: stat

      line = text_of(to_text(pid), 'stat')
      read (line(index(line, ')', back=.true.) + 1:), *, iostat=stat) state, above ! the name in brackets may hold anything
      if (stat /= 0) above = 0
   end function parent_of

   !> A whole number in the environment; 0: none.
   integer function number_in(name)
      character(len=*), intent(in) :: name
      character(len=20) :: text
      integer :: length, stat

      number_in = 0
      call get_environment_variable(name, text, length, stat)
      if (stat /= 0 .or. length == 0) return
      read (text, *, iostat=stat) number_in
      if (stat /= 0) number_in = 0
   end function number_in

end module rodyn_launcher
