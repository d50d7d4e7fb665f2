!> What a result says beside its numbers: what it is the result of, what the solver did, and the columns of the events. Files and
!> results in memory have the same.
module rodyn_run_report
   use rodyn_attributes, only: attribute_list
   use rodyn_build_info, only: compiler, compiler_options, git_commit, program_version
   use rodyn_integrator, only: solver_statistics
   use rodyn_kinds, only: i8, wp
   use rodyn_methods, only: solver_options
   use rodyn_posix, only: host_name, utc_now
   use rodyn_text, only: text_or_empty
   implicit none (type, external)
   private
   public :: provenance, solver_report, column, event_columns

   !> What a result is the result of.
   type :: provenance
      character(len=:), allocatable :: title
      character(len=:), allocatable :: input            !! the namelist as read
      character(len=:), allocatable :: resolved_input   !! every key with the value used
      character(len=:), allocatable :: notes            !! what to know about the model, one line each
      character(len=:), allocatable :: sundials_version
   contains
      procedure :: list => list_provenance
   end type provenance

   !> What the integrator did.
   type, extends(solver_statistics) :: solver_report
      character(len=:), allocatable :: method     !! those used
      character(len=:), allocatable :: reason     !! why it was chosen
      character(len=:), allocatable :: kernel     !! 'recursive' or 'assembled'
      type(solver_options) :: options             !! of the case
      real(wp) :: work_external_error = 0.0_wp     !! estimated, at the end of the run [J]; with the ledger
      real(wp) :: energy_dissipated_error = 0.0_wp !! likewise [J]
      real(wp) :: wall_seconds = 0.0_wp
      character(len=:), allocatable :: warnings   !! where the model does not hold, one line each; a root attribute
   contains
      procedure :: list => list_solver
   end type solver_report

   !> What a data set is.
   type :: column
      character(len=11) :: name
      character(len=1) :: units
      character(len=34) :: long_name
   end type column

   type(column), parameter :: event_columns(4) = [ &
      column('time', 's', 'time of the event'), &
      column('hinge', '1', 'hinge, counted from the spacecraft'), &
      column('kind', '1', 'what happened'), &
      column('energy_lost', 'J', 'mechanical energy lost in it')]

contains

   !> What ran, with what, on what.
   subroutine list_provenance(self, status, attributes, hdf5_version)
      class(provenance), intent(in) :: self
      character(len=*), intent(in) :: status !! 'done', 'running', ...
      type(attribute_list), intent(inout) :: attributes
      character(len=*), intent(in), optional :: hdf5_version !! of a file

      call attributes%add('title', text_or_empty(self%title))
      call attributes%add('status', status)
      call attributes%add('program_version', program_version)
      call attributes%add('git_commit', git_commit())
      call attributes%add('compiler', compiler())
      call attributes%add('compiler_options', compiler_options())
      call attributes%add('sundials_version', text_or_empty(self%sundials_version))
      if (present(hdf5_version)) call attributes%add('hdf5_version', hdf5_version)
      call attributes%add('hostname', host_name())
      call attributes%add('created', utc_now())
      call attributes%add('input', text_or_empty(self%input))
      call attributes%add('resolved_input', text_or_empty(self%resolved_input))
      call attributes%add('notes', text_or_empty(self%notes))
   end subroutine list_provenance

   !> What the solver was asked for and did.
   subroutine list_solver(self, ledger, attributes)
      class(solver_report), intent(in) :: self
      logical, intent(in) :: ledger !! the run had one
      type(attribute_list), intent(inout) :: attributes

      call attributes%add('method', text_or_empty(self%method))
      call attributes%add('reason', text_or_empty(self%reason))
      call attributes%add('kernel', text_or_empty(self%kernel))
      call attributes%add('order', self%options%order)
      call attributes%add('rtol', self%options%rtol)
      call attributes%add('atol', self%options%atol)
      call attributes%add('max_step', self%options%max_step)
      call attributes%add('fixed_step', self%options%fixed_step)
      call attributes%add('last_step', self%last_step)
      call attributes%add('n_steps', self%n_steps)
      call attributes%add('n_rhs', self%n_rhs)
      call attributes%add('n_jac', self%n_jac)
      call attributes%add('n_nonlinear_failures', self%n_nonlinear_failures)
      call attributes%add('n_error_test_failures', self%n_error_test_failures)
      call attributes%add('n_restarts', max(0_i8, self%n_starts - 1_i8))
      if (ledger) then
         call attributes%add('work_external_error', self%work_external_error)
         call attributes%add('energy_dissipated_error', self%energy_dissipated_error)
      end if
      call attributes%add('wall_seconds', self%wall_seconds)
   end subroutine list_solver

end module rodyn_run_report
