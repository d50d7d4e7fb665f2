!> Modes of a case about the state in which it begins.
module rodyn_modes_at_start
   use rodyn_kinds, only: wp
   use rodyn_case_config, only: case_config
   use rodyn_equilibrium, only: find_equilibrium
   use rodyn_errors, only: error_type
   use rodyn_linear_model, only: linear_model, new_linear_model
   use rodyn_modes, only: mode_set, new_modes
   use rodyn_motion, only: motion_type, initial_state
   implicit none (type, external)
   private
   public :: modes_at_start

contains

   !> Linear model and modes of a case at t = 0. Hinges have the laws that hold there: those that are held are locked.
   subroutine modes_at_start(motion, config, equilibrium, loads, with_shapes, model, modes, error)
      type(motion_type), intent(inout) :: motion !! without a ledger
      type(case_config), intent(in) :: config
      logical, intent(in) :: equilibrium, loads, with_shapes
      type(linear_model), intent(out) :: model
      type(mode_set), intent(out) :: modes
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: y(:)

      call motion%dynamics%set_regime(0.0_wp, minval([motion%switches, config%t_end]), loaded=loads .or. equilibrium)
      call initial_state(motion, config%initial, y)
      if (motion%events%watches) then
         associate (r => motion%n_q, m => motion%n_dof)
            call motion%events%begin(motion%dynamics, y(1:r), y(r + 1:r + m), error)
         end associate
         if (allocated(error)) return
      end if
      if (equilibrium) call find_equilibrium(motion, 0.0_wp, y, error)
      if (.not. allocated(error)) call new_linear_model(model, motion, 0.0_wp, y, error)
      if (.not. allocated(error)) call new_modes(modes, model, with_shapes, error)
   end subroutine modes_at_start

end module rodyn_modes_at_start
