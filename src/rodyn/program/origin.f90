!> What a result of a case is the result of: for files and for results in memory, of runs and of modes.
module rodyn_origin
   use rodyn_case_config, only: case_config
   use rodyn_case_notes, only: case_notes
   use rodyn_case_reader, only: resolved_case
   use rodyn_integrators, only: sundials_version
   use rodyn_kinds, only: wp
   use rodyn_motion, only: motion_type
   use rodyn_notes, only: notes_on
   use rodyn_run_report, only: provenance
   use rodyn_text, only: joined, text_or_empty
   implicit none (type, external)
   private
   public :: describe_origin

contains

   !> All but the input as it was read.
   subroutine describe_origin(config, motion, y, runs, origin)
      type(case_config), intent(in) :: config
      type(motion_type), intent(in) :: motion
      real(wp), intent(in) :: y(:)  !! state that the notes are on
      logical, intent(in) :: runs   !! the case goes on until t_end, as it does not where only modes are wanted
      class(provenance), intent(inout) :: origin

      origin%title = text_or_empty(config%title)
      origin%resolved_input = resolved_case(config)
      origin%sundials_version = sundials_version()
      associate (scene => motion%dynamics%scene)
         origin%notes = joined(case_notes(config, runs), notes_on(scene, motion%dynamics%hinges, y(:scene%n_dof), &
                                                                  runs .and. config%output%ledger), new_line('a'))
      end associate
   end subroutine describe_origin

end module rodyn_origin
