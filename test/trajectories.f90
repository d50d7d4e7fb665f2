!> Whole integrations for tests: a case in, the states at some times out.
module test_trajectories
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type
   use rodyn_case_config, only: case_config
   use rodyn_scene, only: scene_type, new_scene
   use rodyn_motion, only: motion_type, new_motion, initial_state, state_invariants
   use rodyn_kinematics, only: invariants_type
   use rodyn_quantities, only: row_type, fill_row, layout_of, new_row
   use rodyn_user_load, only: user_load
   use rodyn_hinge_events, only: hinge_event
   use rodyn_integrator, only: integrator_type, solver_options, solver_statistics
   use rodyn_integrators, only: new_integrator
   use rodyn_simulation, only: observer_type, listed_times, simulate
   implicit none (type, external)
   private
   public :: trajectory, integrate

   !> What tests want to see of a row.
   type :: kept_row
      real(wp), allocatable, dimension(:) :: phi, alpha, beta, phi_rate, alpha_rate
      real(wp) :: velocity_x = 0.0_wp, velocity_y = 0.0_wp, omega = 0.0_wp, rotation = 0.0_wp
      real(wp) :: displacement_x = 0.0_wp, displacement_y = 0.0_wp
      real(wp) :: energy_kinetic = 0.0_wp, energy_elastic = 0.0_wp, energy_dissipated = 0.0_wp, energy_residual = 0.0_wp
      real(wp) :: work_external = 0.0_wp, momentum_x = 0.0_wp, momentum_y = 0.0_wp, angular_momentum = 0.0_wp
   end type kept_row

   !> Keeps every row.
   type, extends(observer_type) :: trajectory
      type(row_type) :: row !! the last one
      type(kept_row), allocatable :: rows(:)
      integer :: n_rows = 0
      real(wp) :: initial_energy = 0.0_wp
      type(hinge_event), allocatable :: events(:)
      integer :: n_events = 0
      type(solver_statistics) :: counts !! of the integrator
   contains
      procedure :: observe
   end type trajectory

contains

   !> Integrate a case by its method ('auto' is dop853 here) and keep the states at `times`.
   subroutine integrate(config, times, result, error, load)
      type(case_config), intent(in) :: config
      real(wp), intent(in) :: times(:)          !! increasing; the last one is the end [s]
      type(trajectory), intent(out) :: result
      type(error_type), allocatable, intent(out) :: error
      class(user_load), target, intent(inout), optional :: load !! forces beside those of the case
      type(scene_type) :: scene
      type(motion_type), target :: motion
      class(integrator_type), allocatable :: integrator
      type(solver_options) :: options
      real(wp), allocatable :: y(:)
      character(len=:), allocatable :: method
      real(wp) :: t

      call new_scene(scene, config, error)
      if (.not. allocated(error)) call new_motion(motion, scene, config%output%ledger, error)
      if (allocated(error)) return
      if (present(load)) call motion%set_user_load(load)
      call initial_state(motion, config%initial, y)
      options%rtol = config%solver%rtol
      options%atol = config%solver%atol
      options%order = config%solver%order
      options%fixed_step = config%solver%fixed_step
      method = trim(config%solver%method)
      if (method == 'auto') method = 'dop853'
      call new_integrator(integrator, motion, method, options, error)
      if (allocated(error)) return
      allocate (result%rows(size(times)))
      result%row = new_row(layout_of(config))
      motion%events%most = config%solver%max_events
      call simulate(motion, integrator, listed_times(times), times(size(times)), result, y, t, error)
      result%n_events = motion%events%n_logged
      result%events = motion%events%log
      result%counts = integrator%statistics()
      call integrator%finalize()
   end subroutine integrate

   subroutine observe(self, motion, t, y, error)
      class(trajectory), intent(inout) :: self
      type(motion_type), intent(inout) :: motion
      real(wp), intent(in) :: t
      real(wp), intent(in) :: y(:)
      type(error_type), allocatable, intent(out) :: error
      type(invariants_type) :: start

      if (self%n_rows == 0) then
         start = state_invariants(motion, y)
         self%initial_energy = start%kinetic + start%elastic
      end if
      self%n_rows = self%n_rows + 1
      call fill_row(motion, t, y, self%initial_energy, self%row)
      self%rows(self%n_rows) = kept(self%row)
      if (allocated(error)) return
   end subroutine observe

   function kept(row) result(copy)
      type(row_type), intent(in) :: row
      type(kept_row) :: copy

      copy%phi = per_rod('phi')
      copy%alpha = per_rod('alpha')
      copy%beta = per_rod('beta')
      copy%phi_rate = per_rod('phi_rate')
      copy%alpha_rate = per_rod('alpha_rate')
      copy%velocity_x = number('velocity_x')
      copy%velocity_y = number('velocity_y')
      copy%omega = number('omega')
      copy%rotation = number('rotation')
      copy%displacement_x = number('displacement_x')
      copy%displacement_y = number('displacement_y')
      copy%energy_kinetic = number('energy_kinetic')
      copy%energy_elastic = number('energy_elastic')
      copy%energy_dissipated = number('energy_dissipated')
      copy%energy_residual = number('energy_residual')
      copy%work_external = number('work_external')
      copy%momentum_x = number('momentum_x')
      copy%momentum_y = number('momentum_y')
      copy%angular_momentum = number('angular_momentum')

   contains

      function per_rod(name)
         character(len=*), intent(in) :: name
         real(wp) :: per_rod(row%layout%n_rods)
         associate (before => row%layout%before(name))
            per_rod = row%values(before + 1:before + row%layout%n_rods)
         end associate
      end function per_rod

      !> Zero without a ledger.
      real(wp) function number(name)
         character(len=*), intent(in) :: name
         number = 0.0_wp
         if (row%layout%before(name) >= 0) number = row%values(row%layout%before(name) + 1)
      end function number

   end function kept

end module test_trajectories
