!> From a case to its modes, as a table in memory.
module rodyn_modes_of_case
   use rodyn_case_config, only: case_config
   use rodyn_errors, only: error_type
   use rodyn_kinds, only: wp
   use rodyn_linear_model, only: linear_model
   use rodyn_modes, only: mode_set
   use rodyn_modes_at_start, only: modes_at_start
   use rodyn_modes_table, only: tabulate_modes
   use rodyn_origin, only: describe_origin
   use rodyn_quantities, only: layout_of
   use rodyn_result_table, only: result_table
   use rodyn_run_needs, only: check_memory, memory_of_scene, of_program
   use rodyn_run_report, only: provenance
   use rodyn_run_setup, only: run_setup, new_run_setup
   use rodyn_text, only: to_text
   use rodyn_validity, only: validity_type, new_validity
   implicit none (type, external)
   private
   public :: modes_of_case

contains

   subroutine modes_of_case(config, equilibrium, loads, model, modes, table, origin, warnings, error)
      type(case_config), intent(in) :: config !! complete and sound
      logical, intent(in) :: equilibrium      !! about the equilibrium near the initial state, under loads
      logical, intent(in) :: loads            !! about the initial state: the loads of t = 0 act
      type(linear_model), intent(out) :: model
      type(mode_set), intent(out) :: modes
      type(result_table), intent(inout) :: table
      type(provenance), intent(out) :: origin !! without the input
      character(len=:), allocatable, intent(out) :: warnings !! where the model does not hold, one line each
      type(error_type), allocatable, intent(out) :: error
      type(run_setup) :: setup
      type(validity_type) :: validity

      call check_memory('n_rods = '//to_text(config%chain%n_rods), of_program + memory_of_scene(config), error)
      if (.not. allocated(error)) call new_run_setup(setup, config, .false., error)
      if (.not. allocated(error)) call modes_at_start(setup%motion, config, equilibrium, loads, .true., model, modes, error)
      if (allocated(error)) return
      call describe_origin(config, setup%motion, model%q, .false., origin)
      associate (scene => setup%motion%dynamics%scene, hinges => setup%motion%dynamics%hinges)
         validity = new_validity(scene, layout_of(config), 1, config%model%deflection_limit, config%model%axial_error_limit)
         call validity%judge_forces(setup%motion%dynamics, 0.0_wp, model%q, model%p, model%acceleration)
         warnings = validity%warnings()
         call tabulate_modes(scene, hinges, model, modes, equilibrium, warnings, table)
      end associate
   end subroutine modes_of_case

end module rodyn_modes_of_case
