!> Rodyn: nonlinear planar dynamics of a chain of elastic rods on a free-floating spacecraft.
!>
!>     use rodyn, only: case_config, error_type, read_case, run_case
!>     type(case_config) :: config
!>     type(error_type), allocatable :: error
!>     character(len=:), allocatable :: text
!>     call read_case('cases/table1.nml', config, text, error)
!>     if (.not. allocated(error)) call run_case(config, 'table1.h5', error, input_text=text)
!>     if (allocated(error)) print *, error%message
!>
!> Forces of your own: extend `user_load` and hand it to `run_case` (docs/moving_scenes.md).
!> For more than whole runs: `new_scene` compiles a case, `new_motion` makes its equations y' = f(t, y).
module rodyn
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type
   use rodyn_case_config, only: case_config, hinge_config, kink_config, load_config, profile_config
   use rodyn_case_reader, only: read_case, parse_case, resolved_case, default_case
   use rodyn_scene, only: scene_type, new_scene
   use rodyn_motion, only: motion_type, new_motion, initial_state
   use rodyn_frequencies, only: natural_frequencies
   use rodyn_run, only: run_case
   use rodyn_user_load, only: user_load
   use rodyn_modal_analysis, only: analyse_modes
   use rodyn_build_info, only: program_version
   implicit none (type, external)
   private
   public :: wp, error_type
   public :: case_config, hinge_config, kink_config, load_config, profile_config
   public :: read_case, parse_case, resolved_case, default_case, run_case, analyse_modes
   public :: scene_type, new_scene, motion_type, new_motion, initial_state, natural_frequencies
   public :: user_load
   public :: program_version
end module rodyn
