!> A case made ready to be integrated: compiled, a motion, at its state at t = 0. Runs, cases of sweeps and of ensembles begin here;
!> `rodyn_driver` then makes or chooses the integrator, and `rodyn_simulation` or `rodyn_ensemble` goes to the end.
module rodyn_run_setup
   use rodyn_kinds, only: wp
   use rodyn_case_config, only: case_config
   use rodyn_errors, only: error_type
   use rodyn_motion, only: motion_type, new_motion, initial_state
   use rodyn_scene, only: scene_type, compile_scene
   use rodyn_user_load, only: user_load
   implicit none (type, external)
   private
   public :: run_setup, new_run_setup

   type :: run_setup
      type(motion_type) :: motion
      real(wp), allocatable :: y(:) !! state, at first that at t = 0 (n_states)
      real(wp) :: t_end = 0.0_wp    !! [s]
   end type run_setup

contains

   !> Compile a case and put it at its initial state.
   subroutine new_run_setup(setup, config, ledger, error, load)
      type(run_setup), intent(out) :: setup
      type(case_config), intent(in) :: config !! complete and sound: read from a file, or by `sound_case`
      logical, intent(in) :: ledger !! the state ends with work and dissipated energy
      type(error_type), allocatable, intent(out) :: error
      class(user_load), target, intent(inout), optional :: load !! forces of the caller's; must outlive the set-up
      type(scene_type) :: scene

      call compile_scene(scene, config, error)
      if (.not. allocated(error)) call new_motion(setup%motion, scene, ledger, error)
      if (allocated(error)) return
      if (present(load)) call setup%motion%set_user_load(load)
      setup%motion%events%most = config%solver%max_events
      call initial_state(setup%motion, config%initial, setup%y)
      setup%t_end = config%t_end
   end subroutine new_run_setup

end module rodyn_run_setup
