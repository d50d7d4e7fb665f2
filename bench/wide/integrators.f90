!> In place of the program's list of methods: those that know other precisions.
module rodyn_integrators
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type, raise
   use rodyn_ode, only: ode_system
   use rodyn_integrator, only: integrator_type, solver_options
   use rodyn_dop853_integrator, only: dop853_integrator, new_dop853_integrator
   use rodyn_bench_gragg_integrator, only: gragg_integrator
   implicit none (type, external)
   private
   public :: new_integrator, integrator_names

   character(len=6), parameter :: integrator_names(2) = [character(len=6) :: 'gragg', 'dop853']

contains

   subroutine new_integrator(integrator, system, method, options, error)
      class(integrator_type), allocatable, intent(out) :: integrator
      class(ode_system), target, intent(inout) :: system !! must outlive the integrator
      character(len=*), intent(in) :: method             !! one of `integrator_names`
      type(solver_options), intent(in) :: options
      type(error_type), allocatable, intent(out) :: error
      type(dop853_integrator), allocatable :: dop853

      if (precision(1.0_wp) < 18) error stop 'compile with another wp'
      select case (method)
      case ('gragg')
         allocate (gragg_integrator :: integrator)
         integrator%system => system
         integrator%options = options
      case ('dop853')
         allocate (dop853)
         call new_dop853_integrator(dop853, system, options, error)
         call move_alloc(dop853, integrator)
      case default
         call raise(error, 'here are gragg and dop853, not '//method)
      end select
   end subroutine new_integrator

end module rodyn_integrators
