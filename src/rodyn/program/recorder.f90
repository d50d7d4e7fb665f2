!> Reads rows off a run at its output times, and watches its energies and whether the model holds. What becomes of the rows is for
!> those to say who extend it.
module rodyn_recorder
   use rodyn_kinds, only: wp
   use rodyn_case_config, only: case_config, model_config
   use rodyn_driver, only: driver_type
   use rodyn_errors, only: error_type, raise
   use rodyn_kinematics, only: invariants_type
   use rodyn_motion, only: motion_type, state_invariants
   use rodyn_quantities, only: row_layout, row_type, fill_row, is_finite, new_row
   use rodyn_run_report, only: solver_report
   use rodyn_scene, only: scene_type
   use rodyn_simulation, only: observer_type
   use rodyn_text, only: time_text
   use rodyn_validity, only: validity_type, interval_of_rows, new_validity
   implicit none (type, external)
   private
   public :: recorder_type

   integer, parameter :: most_judgements = 500 !! of axial forces, about: 1 % of what as many rows cost to write

   type, abstract, extends(observer_type) :: recorder_type
      type(row_type) :: row
      real(wp) :: initial_energy = 0.0_wp !! kinetic + elastic at t = 0 [J]
      logical :: started = .false.
      integer :: kinetic = 0, elastic = 0, residual = 0 !! places of energies in the row; 0: no ledger
      real(wp) :: worst_residual = 0.0_wp !! of the ledger [J]
      real(wp) :: energy_scale = 0.0_wp   !! largest energy so far [J]
      type(validity_type) :: validity
   contains
      procedure :: prepare
      procedure :: observe
      procedure :: make_report
      procedure(keep_interface), deferred :: keep !! `row`
   end type recorder_type

   abstract interface
      subroutine keep_interface(self, error)
         import :: recorder_type, error_type
         implicit none (type, external)
         class(recorder_type), intent(inout) :: self
         type(error_type), allocatable, intent(out) :: error
      end subroutine keep_interface
   end interface

contains

   !> Ready for the rows of a scene.
   subroutine prepare(self, scene, layout, n_rows, model)
      class(recorder_type), intent(inout) :: self
      type(scene_type), intent(in) :: scene
      type(row_layout), intent(in) :: layout
      integer, intent(in) :: n_rows !! to expect
      type(model_config), intent(in) :: model

      self%row = new_row(layout)
      self%kinetic = layout%before('energy_kinetic') + 1
      self%elastic = layout%before('energy_elastic') + 1
      self%residual = layout%before('energy_residual') + 1
      self%validity = new_validity(scene, layout, interval_of_rows(n_rows, most_judgements), &
                                   model%deflection_limit, model%axial_error_limit)
   end subroutine prepare

   !> Read a row and keep it.
   subroutine observe(self, motion, t, y, error)
      class(recorder_type), intent(inout) :: self
      type(motion_type), intent(inout) :: motion
      real(wp), intent(in) :: t
      real(wp), intent(in) :: y(:)
      type(error_type), allocatable, intent(out) :: error
      type(invariants_type) :: start

      if (.not. self%started .and. motion%ledger) then
         start = state_invariants(motion, y)
         self%initial_energy = start%kinetic + start%elastic
      end if
      self%started = .true.
      call fill_row(motion, t, y, self%initial_energy, self%row)
      if (.not. is_finite(self%row)) then
         call raise(error, 'at t = '//time_text(t)//' s: states or energies overflow')
         return
      end if
      if (self%residual > 0) then
         associate (x => self%row%values)
            self%worst_residual = max(self%worst_residual, abs(x(self%residual)))
            self%energy_scale = max(self%energy_scale, x(self%kinetic) + x(self%elastic))
         end associate
      end if
      call self%validity%observe(self%row)
      call self%validity%observe_forces(motion, t, y)
      call self%keep(error)
   end subroutine observe

   !> What the solver did, at the end of the run.
   subroutine make_report(self, driver, motion, config, seconds, report)
      class(recorder_type), intent(in) :: self
      type(driver_type), intent(inout) :: driver
      type(motion_type), intent(in) :: motion
      type(case_config), intent(in) :: config
      real(wp), intent(in) :: seconds !! wall time [s]
      type(solver_report), intent(out) :: report

      report%solver_statistics = driver%statistics()
      report%method = driver%methods()
      report%reason = driver%reason()
      report%kernel = trim(merge('assembled', 'recursive', motion%dynamics%scene%assembled))
      report%options = config%solver%solver_options
      if (motion%ledger) then
         report%work_external_error = motion%quadrature_error(1)
         report%energy_dissipated_error = motion%quadrature_error(2)
      end if
      report%wall_seconds = seconds
      report%warnings = self%validity%warnings()
   end subroutine make_report

end module rodyn_recorder
