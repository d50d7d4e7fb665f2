!> One case as the user describes it: plain values in SI units and radians, one type per namelist group.
!>
!> Arrays are as long as what they run over: rods and nodes count 1..n, hinges 0..n-1. What a library user leaves out, an array
!> that is not allocated or a number with its initial value, has the default that a file would give it; `new_scene` checks a case
!> as a file is checked (`rodyn_case_check`). Defaults stand in one place, the table of `rodyn_case_schema`; the initial values
!> here serve cases that are filled by hand.
module rodyn_case_config
   use rodyn_kinds, only: wp
   use rodyn_methods, only: solver_options
   use rodyn_time_law, only: law_config
   implicit none (type, external)
   private
   public :: case_config, spacecraft_config, chain_config, profile_config, model_config, initial_config, load_config, kink_config, &
      hinge_config, solver_config, output_config, none_given
   public :: name_length

   real(wp), parameter :: none_given = huge(1.0_wp) !! an angle or time that the case does not have
   integer, parameter :: name_length = 32 !! longest choice word ('distributed', 'sine_squared', ...)

   !> &spacecraft
   type :: spacecraft_config
      real(wp) :: mass = 0.0_wp    !! M0 [kg]
      real(wp) :: inertia = 0.0_wp !! J0, about the centre of mass [kg m^2]
      real(wp) :: hinge_x = 0.0_wp !! x0 of hinge 0, moving frame [m]
      real(wp) :: hinge_y = 0.0_wp !! y0 of hinge 0, moving frame [m]
      character(len=name_length) :: motion = 'free' !! 'free' or 'fixed'
   end type spacecraft_config

   !> &chain
   type :: chain_config
      integer :: n_rods = 0 !! n
      real(wp), allocatable :: length(:)            !! l (1:n) [m]
      real(wp), allocatable :: mass_per_length(:)   !! m (1:n) [kg/m]
      real(wp), allocatable :: bending_stiffness(:) !! EI (1:n) [N m^2]; unused when bending is 'rigid'
      real(wp), allocatable :: node_mass(:)         !! mu (1:n) [kg]
      real(wp), allocatable :: hinge_stiffness(:)   !! C (0:n-1) [N m/rad]
      real(wp), allocatable :: hinge_damping(:)     !! D (0:n-1) [N m s/rad]
      real(wp), allocatable :: kink(:)              !! gamma (0:n-1) [rad]
   end type chain_config

   !> One &rod_profile group: a factor on the mass per length or the bending stiffness of some rods, over s/l = 0..1, as a
   !> polynomial or as a table
   type :: profile_config
      character(len=name_length) :: quantity = 'mass_per_length' !! 'mass_per_length' or 'bending_stiffness'
      integer :: first_rod = 1              !! 1..n
      integer :: last_rod = huge(1)         !! first_rod..n
      real(wp), allocatable :: polynomial(:) !! c0, c1, ...: sum c_i (s/l)^i
      real(wp), allocatable :: positions(:)  !! of the table, s/l from 0 to 1, rising; equal neighbours make a jump
      real(wp), allocatable :: values(:)     !! of the table, linear in between
   end type profile_config

   !> &model
   type :: model_config
      character(len=name_length) :: formulation = 'consistent' !! 'consistent' or 'paper'
      character(len=name_length) :: inertia = 'distributed'    !! 'distributed' or 'lumped'
      character(len=name_length) :: bending = 'dynamic'        !! 'dynamic', 'quasistatic' or 'rigid'
      integer :: bending_shapes = 2                            !! shapes of a rod that bends as motion: 2, or 3 with the bubble
      character(len=name_length) :: dampers = 'reduced'        !! 'reduced' or 'exact', matters when quasistatic
      integer :: gauss_points = 4                              !! points of the rule for the rod integrals
      character(len=name_length) :: kernel = 'recursive'       !! 'recursive' or 'assembled'
      real(wp) :: deflection_limit = 0.06_wp                   !! deflection/length beyond which a run is warned of
   end type model_config

   !> &initial
   type :: initial_config
      real(wp), allocatable :: phi(:)        !! chord angles (1:n) [rad]
      real(wp), allocatable :: alpha(:)      !! inner end slopes (1:n) [rad]
      real(wp), allocatable :: beta(:)       !! outer end slopes (1:n) [rad]
      real(wp), allocatable :: bubble(:)     !! deflections of the third shape in mid-rod (1:n) [m]
      real(wp), allocatable :: phi_rate(:)   !! (1:n) [rad/s]
      real(wp), allocatable :: alpha_rate(:) !! (1:n) [rad/s]
      real(wp), allocatable :: beta_rate(:)  !! (1:n) [rad/s]
      real(wp), allocatable :: bubble_rate(:) !! (1:n) [m/s]
      real(wp) :: velocity_x = 0.0_wp        !! Vx, moving frame [m/s]
      real(wp) :: velocity_y = 0.0_wp        !! Vy, moving frame [m/s]
      real(wp) :: omega = 0.0_wp             !! w [rad/s]
      real(wp) :: displacement_x = 0.0_wp    !! u_x, moving frame [m]
      real(wp) :: displacement_y = 0.0_wp    !! u_y, moving frame [m]
      real(wp) :: rotation = 0.0_wp          !! theta [rad]
   end type initial_config

   !> One &load group; values in [N] or [N m]
   type, extends(law_config) :: load_config
      character(len=name_length) :: target = 'spacecraft' !! 'spacecraft' or 'node'
      integer :: node = 0                                 !! 1..n when target is 'node'
      character(len=name_length) :: component = 'M'       !! 'X', 'Y' [N] or 'M' [N m], moving axes
      character(len=name_length) :: law = 'constant'      !! 'constant', 'table', 'sine_squared', 'smooth_step'
      character(len=name_length) :: after = 'zero'        !! of table, beyond its last time: 'zero' or 'hold'
   end type load_config

   !> One &kink_program group; values in [rad]. A step has t_end = t_start
   type, extends(law_config) :: kink_config
      integer :: hinge = 0                              !! 0..n-1
      character(len=name_length) :: law = 'smooth_step' !! 'ramp', 'smooth_step', 'sine' or 'table'
   end type kink_config

   !> One &hinge group. All angles are joint rotations th, from the kink.
   type :: hinge_config
      integer :: hinge = 0                      !! 0..n-1
      logical :: held = .false.                 !! locked at its initial angle
      real(wp) :: release_time = none_given     !! [s]
      integer :: release_after = -1             !! hinge whose latching releases this one; -1: none
      real(wp) :: rest_angle = 0.0_wp           !! of the spring [rad]
      real(wp) :: freeplay = 0.0_wp             !! to either side of the rest angle [rad]
      real(wp) :: freeplay_stiffness = 0.0_wp   !! within it [N m/rad]
      real(wp) :: lower_stop = none_given       !! [rad]
      real(wp) :: upper_stop = none_given       !! [rad]
      real(wp) :: stop_stiffness = 0.0_wp       !! [N m/rad]
      real(wp) :: stop_damping = 0.0_wp         !! [N m s/rad]
      real(wp) :: latch_angle = none_given      !! [rad]
      real(wp) :: lock_stiffness = 0.0_wp       !! of a spring in place of the constraint [N m/rad]; 0: a constraint
      real(wp) :: lock_damping = 0.0_wp         !! beside that spring [N m s/rad]
      real(wp) :: friction_moment = 0.0_wp      !! [N m]
      real(wp) :: friction_velocity = 0.0_wp    !! from which all of it acts [rad/s]
   end type hinge_config

   !> &solver: what integrators are told, and which of them it is.
   type, extends(solver_options) :: solver_config
      character(len=name_length) :: method = 'auto' !! or one of `rodyn_methods`
      integer :: max_events = 100000                !! events of the whole run
   end type solver_config

   !> &output
   type :: output_config
      character(len=:), allocatable :: file !! path of the result; empty: named after the case
      logical :: ledger = .true.            !! energy and momentum along the run
      integer :: compression = 4            !! gzip level 0..9
   end type output_config

   !> A whole case
   type :: case_config
      character(len=:), allocatable :: title
      real(wp) :: t_end = 1.0_wp  !! [s]
      integer :: n_outputs = 1000 !! intervals; n_outputs + 1 rows
      type(spacecraft_config) :: spacecraft
      type(chain_config) :: chain
      type(profile_config), allocatable :: profiles(:) !! may be left unallocated: uniform rods
      type(model_config) :: model
      type(initial_config) :: initial
      type(load_config), allocatable :: loads(:)
      type(kink_config), allocatable :: kink_programs(:)
      type(hinge_config), allocatable :: hinges(:)
      type(solver_config) :: solver
      type(output_config) :: output
   end type case_config

end module rodyn_case_config
