!> What a run file holds: names, dimensions, units and meanings. They stand here and nowhere else.
module rodyn_run_layout
   implicit none (type, external)
   private
   public :: run_variable, run_coordinate, run_variables, run_coordinates, n_run_variables, solver_group, events_group
   public :: i_time, i_phi, i_alpha, i_beta, i_phi_rate, i_alpha_rate, i_beta_rate, i_velocity_x, i_velocity_y, i_omega, &
      i_displacement_x, i_displacement_y, i_rotation, i_energy_kinetic, i_energy_elastic, i_energy_dissipated, &
      i_work_external, i_energy_residual, i_momentum_x, i_momentum_y, i_angular_momentum, i_bubble, i_bubble_rate

   !> One data set that grows along time.
   type :: run_variable
      character(len=20) :: name
      character(len=12) :: units
      logical :: per_rod !! (rod, time), otherwise (time)
      logical :: ledger  !! present only with the ledger
      character(len=64) :: long_name
   end type run_variable

   !> One coordinate that counts.
   type :: run_coordinate
      character(len=20) :: name
      integer :: first     !! number of the first entry
      integer :: beyond_n  !! entries: n + beyond_n
      character(len=64) :: long_name
   end type run_coordinate

   character(len=*), parameter :: solver_group = 'solver'
   character(len=*), parameter :: events_group = 'events'

   !> Places in `run_variables`.
   enum, bind(c)
      enumerator :: i_time = 1
      enumerator :: i_phi, i_alpha, i_beta, i_phi_rate, i_alpha_rate, i_beta_rate
      enumerator :: i_velocity_x, i_velocity_y, i_omega, i_displacement_x, i_displacement_y, i_rotation
      enumerator :: i_energy_kinetic, i_energy_elastic, i_energy_dissipated, i_work_external, i_energy_residual
      enumerator :: i_momentum_x, i_momentum_y, i_angular_momentum
      enumerator :: i_bubble, i_bubble_rate ! only with three bending shapes
   end enum

   integer, parameter :: n_run_variables = i_bubble_rate

   logical, parameter :: rod = .true., scalar = .false. ! per_rod
   logical, parameter :: state = .false., books = .true. ! ledger

   type(run_variable), parameter :: run_variables(n_run_variables) = [ &
      run_variable('time', 's', scalar, state, 'time'), &
      run_variable('phi', 'rad', rod, state, 'angle from the moving x axis to the chord of the rod'), &
      run_variable('alpha', 'rad', rod, state, 'slope of the rod against its chord at the inner end'), &
      run_variable('beta', 'rad', rod, state, 'slope of the rod against its chord at the outer end'), &
      run_variable('phi_rate', 'rad s-1', rod, state, 'rate of phi'), &
      run_variable('alpha_rate', 'rad s-1', rod, state, 'rate of alpha'), &
      run_variable('beta_rate', 'rad s-1', rod, state, 'rate of beta'), &
      run_variable('velocity_x', 'm s-1', scalar, state, 'velocity of the spacecraft, moving x axis'), &
      run_variable('velocity_y', 'm s-1', scalar, state, 'velocity of the spacecraft, moving y axis'), &
      run_variable('omega', 'rad s-1', scalar, state, 'angular velocity of the spacecraft'), &
      run_variable('displacement_x', 'm', scalar, state, 'displacement of the spacecraft, moving x axis'), &
      run_variable('displacement_y', 'm', scalar, state, 'displacement of the spacecraft, moving y axis'), &
      run_variable('rotation', 'rad', scalar, state, 'rotation of the spacecraft'), &
      run_variable('energy_kinetic', 'J', scalar, books, 'kinetic energy'), &
      run_variable('energy_elastic', 'J', scalar, books, 'elastic energy of hinges and rods'), &
      run_variable('energy_dissipated', 'J', scalar, books, 'energy dissipated in the hinges since the start'), &
      run_variable('work_external', 'J', scalar, books, 'work of loads and moving kinks since the start'), &
      run_variable('energy_residual', 'J', scalar, books, 'kinetic + elastic + dissipated - work - their start'), &
      run_variable('momentum_x', 'kg m s-1', scalar, books, 'linear momentum, inertial x axis'), &
      run_variable('momentum_y', 'kg m s-1', scalar, books, 'linear momentum, inertial y axis'), &
      run_variable('angular_momentum', 'kg m2 s-1', scalar, books, 'angular momentum about the inertial origin'), &
      run_variable('bubble', 'm', rod, state, 'deflection by the third bending shape in the middle of the rod'), &
      run_variable('bubble_rate', 'm s-1', rod, state, 'rate of bubble')]

   type(run_coordinate), parameter :: run_coordinates(3) = [ &
      run_coordinate('rod', 1, 0, 'rod, counted from the spacecraft'), &
      run_coordinate('hinge', 0, 0, 'hinge, counted from the spacecraft; 0 sits on it'), &
      run_coordinate('node', 0, 1, 'node, counted from the spacecraft; 0 sits on it')]

end module rodyn_run_layout
