!> What a launcher of parallel jobs (mpirun, srun) says in the environment of the processes that it starts together.
module rodyn_launcher
   use rodyn_posix, only: parent_id, read_all
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

   !> Those that the launcher itself has started with this command line. A script that it started (its environment says so, too)
   !> knows what it does: it may give each process a case of its own. So does a shell in a job of several tasks.
   function direct_launch() result(launch)
      type(launch_type) :: launch
      character(len=:), allocatable :: environment, failure
      integer :: i, n

      launch%variable = ''
      do i = 1, size(counts)
         n = number_in(counts(i))
         if (n <= launch%count) cycle
         if (.not. allocated(failure)) call read_all('/proc/'//to_text(parent_id())//'/environ', 16777216, environment, failure)
         if (len(failure) == 0) then ! otherwise another user's, as launchers of the system are
            if (index(achar(0)//environment, achar(0)//trim(counts(i))//'=') > 0) cycle
         end if
         launch%count = n
         launch%rank = number_in(ranks(i))
         launch%variable = trim(counts(i))
      end do
   end function direct_launch

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
