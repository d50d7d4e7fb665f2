!> One place that knows every method by name.
module rodyn_integrators
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type, raise
   use rodyn_methods, only: list_of_methods, method_named, method_type, methods, order_rule
   use rodyn_ode, only: ode_system
   use rodyn_integrator, only: integrator_type, solver_options
   use rodyn_cvode_integrator, only: cvode_integrator, new_cvode_integrator
   use rodyn_erk_integrator, only: erk_integrator, new_erk_integrator
   use rodyn_dop853_integrator, only: dop853_integrator, new_dop853_integrator
   use rodyn_gauss_integrator, only: gauss_integrator, new_gauss_integrator
   use rodyn_sundials_base, only: sundials_version
   implicit none (type, external)
   private
   public :: new_integrator, sundials_version

contains

   !> An integrator for `system`, not yet started.
   subroutine new_integrator(integrator, system, method, options, error)
      class(integrator_type), allocatable, intent(out) :: integrator
      class(ode_system), target, intent(inout) :: system !! must outlive the integrator
      character(len=*), intent(in) :: method             !! one of `rodyn_methods`
      type(solver_options), intent(in) :: options
      type(error_type), allocatable, intent(out) :: error

      type(cvode_integrator), allocatable :: cvode
      type(erk_integrator), allocatable :: erk
      type(dop853_integrator), allocatable :: dop853
      type(gauss_integrator), allocatable :: gauss

      call check_options(method_named(method), options, error)
      if (allocated(error)) return
      select case (method)
      case ('adams', 'bdf')
         allocate (cvode)
         call new_cvode_integrator(cvode, system, trim(method), options, error)
         call move_alloc(cvode, integrator)
      case ('erk')
         allocate (erk)
         call new_erk_integrator(erk, system, options, error)
         call move_alloc(erk, integrator)
      case ('dop853')
         allocate (dop853)
         call new_dop853_integrator(dop853, system, options, error)
         call move_alloc(dop853, integrator)
      case ('gauss')
         allocate (gauss)
         call new_gauss_integrator(gauss, system, options, error)
         call move_alloc(gauss, integrator)
      case default
         call raise(error, 'no integrator is called '''//trim(method)//'''; there are '//list_of_methods(methods%name /= ''))
      end select
   end subroutine new_integrator

   !> What no method can work with, or this one cannot.
   subroutine check_options(method, options, error)
      type(method_type), intent(in) :: method !! nameless: unknown
      type(solver_options), intent(in) :: options
      type(error_type), allocatable, intent(out) :: error
      if (.not. options%rtol > 0.0_wp) then
         call raise(error, 'rtol: must be positive')
      else if (.not. options%atol > 0.0_wp) then
         call raise(error, 'atol: must be positive')
      else if (.not. options%max_step >= 0.0_wp) then
         call raise(error, 'max_step: must not be negative')
      else if (.not. options%fixed_step >= 0.0_wp) then
         call raise(error, 'fixed_step: must not be negative')
      else if (options%max_steps < 1) then
         call raise(error, 'max_steps: must be at least 1')
      else if (len_trim(method%name) == 0) then
         return
      else if (len(order_rule(method, options%order)) > 0) then
         call raise(error, 'order: '//order_rule(method, options%order))
      else if (options%fixed_step > 0.0_wp .and. .not. method%fixed_steps) then
         call raise(error, "fixed_step: '"//trim(method%name)//"' chooses its own steps")
      end if
   end subroutine check_options

end module rodyn_integrators
