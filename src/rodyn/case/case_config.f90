!> One case as the user describes it: plain values in SI units and radians, one type per namelist group.
!>
!> A key of a case file is a component of one of these types and its declaration in the `visit_` procedure of that type: unit,
!> extent, rule, words, meaning. Its default is the initial value of the component; that of an array over rods, nodes or hinges
!> is 0. Reading, checking, writing and documentation are visitors (`rodyn_field_visitor`), so a new key is these two lines.
!>
!> Arrays are as long as what they run over: rods and nodes count 1..n, hinges 0..n-1. What a library user leaves out, an array
!> that is not allocated or a number with its initial value, has the default that a file would give it; `new_scene` checks a case
!> as a file is checked (`rodyn_case_check`).
module rodyn_case_config
   use rodyn_kinds, only: wp
   use rodyn_field_visitor, only: field_visitor
   use rodyn_methods, only: method_words, methods, solver_options
   use rodyn_schema, only: group => schema_group, key => schema_row, schema_extent, schema_group, schema_row, name_length, &
      any_list, positive, not_negative, at_least, in_range, between, up_to
   use rodyn_schema_collector, only: schema_collector
   use rodyn_text, only: has_word
   use rodyn_time_law, only: keys_of_law, law_config, law_words, motion_words
   implicit none (type, external)
   private
   public :: case_config, spacecraft_config, chain_config, profile_config, model_config, initial_config, load_config, kink_config, &
      hinge_config, solver_config, output_config, none_given
   public :: visit_case, visit_blank_case, case_schema, case_extents

   integer, parameter :: rods = 1, nodes = 2, hinges = 3 !! what arrays run over, see `case_extents`
   integer, parameter :: most_rods = 1000000
   character(len=*), parameter :: rate_when = "required when law = 'sine' or 'sine_squared'"
   character(len=*), parameter :: rate_help = 'sine: value * sin(rate * (t - t_start)); sine_squared: value * sin(rate * t)**2'
   real(wp), parameter :: none_given = huge(1.0_wp) !! an angle or time that the case does not have

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
      character(len=name_length) :: formulation = 'inextensible' !! 'inextensible', 'consistent' or 'paper'
      character(len=name_length) :: inertia = 'distributed'    !! 'distributed' or 'lumped'
      character(len=name_length) :: bending = 'dynamic'        !! 'dynamic', 'quasistatic' or 'rigid'
      integer :: bending_shapes = 2                            !! shapes of a rod that bends as motion: 2, or 3 with the bubble
      character(len=name_length) :: dampers = 'reduced'        !! 'reduced' or 'exact', matters when quasistatic
      integer :: gauss_points = 4                              !! points of the rule for the rod integrals
      character(len=name_length) :: kernel = 'recursive'       !! 'recursive' or 'assembled'
      real(wp) :: deflection_limit = 0.06_wp                   !! deflection/length beyond which a run is warned of
      real(wp) :: axial_error_limit = 0.01_wp                  !! error of bending by axial force beyond which it is warned of
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
      character(len=name_length) :: law = 'constant'      !! of `law_words`
      character(len=name_length) :: after = 'zero'        !! of table, beyond its last time: 'zero' or 'hold'
   end type load_config

   !> One &kink_program group; values in [rad]. A step has t_end = t_start
   type, extends(law_config) :: kink_config
      integer :: hinge = 0                              !! 0..n-1
      character(len=name_length) :: law = 'smooth_step' !! of `motion_words`
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
      logical :: loads = .false.            !! what hinges do along the run
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

contains

   !> The table of all groups and keys.
   subroutine case_schema(groups, rows)
      type(schema_group), allocatable, intent(out) :: groups(:)
      type(schema_row), allocatable, intent(out) :: rows(:)
      type(schema_collector) :: collector

      collector%every_key = .true.
      call visit_blank_case(collector)
      call collector%table(groups, rows)
   end subroutine case_schema

   !> Visit a case that has one group of each kind, and all values as they are initially.
   subroutine visit_blank_case(visitor)
      class(field_visitor), intent(inout) :: visitor
      type(case_config) :: blank
      allocate (blank%profiles(1), blank%loads(1), blank%kink_programs(1), blank%hinges(1))
      call visit_case(visitor, blank)
   end subroutine visit_blank_case

   !> What the arrays of a chain of n rods run over; their lengths are not known where there is no such chain.
   pure function case_extents(n_rods) result(extents)
      integer, intent(in) :: n_rods
      type(schema_extent) :: extents(3)
      integer :: n

      n = n_rods
      if (n < 1 .or. n > most_rods) n = 0
      extents(rods) = schema_extent('rod', 1, n)
      extents(nodes) = schema_extent('node', 1, n)
      extents(hinges) = schema_extent('hinge', 0, n)
   end function case_extents

   !> Visit every key of a case, in the order in which documentation and messages have them. Groups of a list that is not
   !> allocated are none, and it is allocated to that.
   subroutine visit_case(visitor, config)
      class(field_visitor), intent(inout) :: visitor
      type(case_config), intent(inout) :: config
      integer :: i

      if (.not. allocated(config%profiles)) allocate (config%profiles(0))
      if (.not. allocated(config%loads)) allocate (config%loads(0))
      if (.not. allocated(config%kink_programs)) allocate (config%kink_programs(0))
      if (.not. allocated(config%hinges)) allocate (config%hinges(0))
      call visitor%open_group(group('case', help='what is computed'), 1)
      call visitor%text_field(config%title, key('title', rule=up_to, high=1000.0_wp, help='title of the case'))
      call visitor%field(config%t_end, key('t_end', 's', rule=positive, help='end of the simulated time, which begins at 0'))
      call visitor%field(config%n_outputs, key('n_outputs', rule=in_range, low=1.0_wp, high=1.0e8_wp, &
         help='output intervals: n_outputs + 1 rows'))
      call visitor%close_group()
      call visit_spacecraft(visitor, config%spacecraft)
      call visit_chain(visitor, config%chain)
      do i = 1, size(config%profiles)
         call visit_profile(visitor, i, config%profiles(i))
      end do
      call visit_model(visitor, config%model)
      call visit_initial(visitor, config%initial)
      do i = 1, size(config%loads)
         call visit_load(visitor, i, config%loads(i))
      end do
      do i = 1, size(config%kink_programs)
         call visit_kink_program(visitor, i, config%kink_programs(i))
      end do
      do i = 1, size(config%hinges)
         call visit_hinge(visitor, i, config%hinges(i))
      end do
      call visit_solver(visitor, config%solver)
      call visit_output(visitor, config%output)
   end subroutine visit_case

   subroutine visit_spacecraft(visitor, spacecraft)
      class(field_visitor), intent(inout) :: visitor
      type(spacecraft_config), intent(inout) :: spacecraft
      call visitor%open_group(group('spacecraft', help='rigid body that carries hinge 0'), 1)
      call visitor%field(spacecraft%mass, key('mass', 'kg', rule=positive, default='depends', example='122.5', &
         when="required when motion = 'free'", help='mass M0'))
      call visitor%field(spacecraft%inertia, key('inertia', 'kg m^2', rule=positive, default='depends', example='10.0', &
         when="required when motion = 'free'", help='moment of inertia J0 about the centre of mass'))
      call visitor%field(spacecraft%hinge_x, key('hinge_x', 'm', help='x0 of hinge 0 from the centre of mass, moving axes'))
      call visitor%field(spacecraft%hinge_y, key('hinge_y', 'm', help='y0 of hinge 0 from the centre of mass, moving axes'))
      call visitor%word_field(spacecraft%motion, key('motion', words='free|fixed', help='free-floating or fixed spacecraft'))
      call visitor%close_group()
   end subroutine visit_spacecraft

   subroutine visit_chain(visitor, chain)
      class(field_visitor), intent(inout) :: visitor
      type(chain_config), intent(inout) :: chain
      call visitor%open_group(group('chain', help='rods and nodes 1..n, hinges 0..n-1; one single value fills a whole array'), 1)
      call visitor%field(chain%n_rods, key('n_rods', rule=in_range, low=1.0_wp, high=real(most_rods, wp), default='required', &
         example='4', help='number of rods n'))
      call visitor%field(chain%length, key('length', 'm', rods, rule=positive, default='required', example='1.5', &
         help='length l of each rod'))
      call visitor%field(chain%mass_per_length, key('mass_per_length', 'kg/m', rods, rule=not_negative, default='required', &
         example='1.696', help='mass per length m of each rod'))
      call visitor%field(chain%bending_stiffness, key('bending_stiffness', 'N m^2', rods, rule=positive, default='depends', &
         example='1.374e4', when="required unless bending = 'rigid'", help='bending stiffness EI of each rod'))
      call visitor%field(chain%node_mass, key('node_mass', 'kg', nodes, rule=not_negative, &
         help='point mass mu at the outer end of each rod'))
      call visitor%field(chain%hinge_stiffness, key('hinge_stiffness', 'N m/rad', hinges, rule=not_negative, default='required', &
         example='4000.0', help='torsional spring C of each hinge'))
      call visitor%field(chain%hinge_damping, key('hinge_damping', 'N m s/rad', hinges, rule=not_negative, &
         help='viscous damper D of each hinge'))
      call visitor%field(chain%kink, key('kink', 'rad', hinges, help='imposed kink gamma at each hinge'))
      call visitor%close_group()
   end subroutine visit_chain

   subroutine visit_profile(visitor, instance, profile)
      class(field_visitor), intent(inout) :: visitor
      integer, intent(in) :: instance
      type(profile_config), intent(inout) :: profile
      call visitor%open_group(group('rod_profile', repeatable=.true., &
         help='how a value of &chain varies along rods: times a factor over s/l; repeat the group, or leave it out'), instance)
      call visitor%word_field(profile%quantity, key('quantity', default='required', words='mass_per_length|bending_stiffness', &
         example="'mass_per_length'", help='which key of &chain the factor multiplies'))
      call visitor%field(profile%first_rod, key('first_rod', rule=at_least, low=1.0_wp, help='first rod that has this profile'))
      call visitor%field(profile%last_rod, key('last_rod', rule=at_least, low=1.0_wp, default='depends', when='default: n_rods', &
         help='last rod that has it'))
      call visitor%field(profile%polynomial, key('polynomial', extent=any_list, default='depends', example='1.0', &
         when='required unless positions and values are given', help='c0, c1, ...: the factor is sum c_i (s/l)**i'))
      call visitor%field(profile%positions, key('positions', extent=any_list, rule=in_range, low=0.0_wp, high=1.0_wp, &
         default='depends', when='instead of polynomial', help='s/l from 0 to 1, rising; two equal ones make a jump'))
      call visitor%field(profile%values, key('values', extent=any_list, rule=not_negative, default='depends', &
         when='instead of polynomial', help='factor at each of the positions, linear in between'))
      call visitor%close_group()
   end subroutine visit_profile

   subroutine visit_model(visitor, model)
      class(field_visitor), intent(inout) :: visitor
      type(model_config), intent(inout) :: model
      call visitor%open_group(group('model', help='which equations, and how they are evaluated'), 1)
      call visitor%word_field(model%formulation, key('formulation', words='inextensible|consistent|paper', &
         help="bent rods keep their arc, or chord; paper: chord, as the article. Condensed: default 'consistent'"))
      call visitor%word_field(model%inertia, key('inertia', words='distributed|lumped', &
         help='mass along the rods, or half of it at each of their ends'))
      call visitor%word_field(model%bending, key('bending', words='dynamic|quasistatic|rigid', &
         help="dynamic needs inertia = 'distributed'; quasistatic: by statics, with mass if 'distributed'"))
      call visitor%field(model%bending_shapes, key('bending_shapes', rule=in_range, low=2.0_wp, high=3.0_wp, &
         help="of a rod, bending = 'dynamic': 2 are its end slopes; 3 adds a bubble between (gauss_points >= 5)"))
      call visitor%word_field(model%dampers, key('dampers', words='reduced|exact', &
         help='of quasistatic bending: reduced is accurate to (D w/C)^2, exact adds a state per damped hinge'))
      call visitor%field(model%gauss_points, key('gauss_points', rule=in_range, low=1.0_wp, high=200.0_wp, &
         help='points of the quadrature rule for the rod integrals'))
      call visitor%word_field(model%kernel, key('kernel', words='recursive|assembled', &
         help='O(n) recursion, or the assembled system and LAPACK'))
      call visitor%field(model%deflection_limit, key('deflection_limit', rule=positive, &
         help='a run warns if a rod bends by more than this part of its length: chord or curvature is 1 % off'))
      call visitor%field(model%axial_error_limit, key('axial_error_limit', rule=positive, &
         help='a run warns if axial force may put the bending of a rod off by more than this part'))
      call visitor%close_group()
   end subroutine visit_model

   subroutine visit_initial(visitor, initial)
      class(field_visitor), intent(inout) :: visitor
      type(initial_config), intent(inout) :: initial
      call visitor%open_group(group('initial', help='state at t = 0'), 1)
      call visitor%field(initial%phi, key('phi', 'rad', rods, help='angle of each chord from the moving x axis'))
      call visitor%field(initial%alpha, key('alpha', 'rad', rods, help="slope at the inner end; bending = 'dynamic' only"))
      call visitor%field(initial%beta, key('beta', 'rad', rods, help="slope at the outer end; bending = 'dynamic' only"))
      call visitor%field(initial%bubble, key('bubble', 'm', rods, &
         help="deflection by the third shape in mid-rod; bending_shapes = 3 only"))
      call visitor%field(initial%phi_rate, key('phi_rate', 'rad/s', rods, help='rate of phi'))
      call visitor%field(initial%alpha_rate, key('alpha_rate', 'rad/s', rods, help="rate of alpha; bending = 'dynamic' only"))
      call visitor%field(initial%beta_rate, key('beta_rate', 'rad/s', rods, help="rate of beta; bending = 'dynamic' only"))
      call visitor%field(initial%bubble_rate, key('bubble_rate', 'm/s', rods, help="rate of bubble; bending_shapes = 3 only"))
      call visitor%field(initial%velocity_x, key('velocity_x', 'm/s', help='Vx of the spacecraft, moving axes'))
      call visitor%field(initial%velocity_y, key('velocity_y', 'm/s', help='Vy of the spacecraft, moving axes'))
      call visitor%field(initial%omega, key('omega', 'rad/s', help='angular velocity of the spacecraft'))
      call visitor%field(initial%displacement_x, key('displacement_x', 'm', help='u_x of the spacecraft, moving axes'))
      call visitor%field(initial%displacement_y, key('displacement_y', 'm', help='u_y of the spacecraft, moving axes'))
      call visitor%field(initial%rotation, key('rotation', 'rad', help='rotation theta of the spacecraft'))
      call visitor%close_group()
   end subroutine visit_initial

   !> Only the keys that the target and the law of this load have.
   subroutine visit_load(visitor, instance, load)
      class(field_visitor), intent(inout) :: visitor
      integer, intent(in) :: instance
      type(load_config), intent(inout) :: load
      character(len=:), allocatable :: keys
      call visitor%open_group(group('load', repeatable=.true., &
         help='one load; repeat the group for each load, or leave it out'), instance)
      call visitor%word_field(load%target, key('target', words='spacecraft|node', &
         help='where the load acts: centre of mass of the spacecraft, or a node'))
      if (visitor%every_key .or. load%target == 'node') &
         call visitor%field(load%node, key('node', rule=at_least, low=1.0_wp, default='depends', &
            when="required when target = 'node'", help='node 1..n on which the load acts'))
      call visitor%word_field(load%component, key('component', words='X|Y|M', &
         help='force along a moving axis [N], or moment [N m] (spacecraft only)'))
      call visitor%word_field(load%law, key('law', words=law_words, &
         help='how the load changes between t_start and t_end; outside it is zero'))
      keys = keys_of_law(load%law) ! a reader has just read it
      call visitor%field(load%t_start, key('t_start', 's', help='the load begins'))
      call visitor%field(load%t_end, key('t_end', 's', default='depends', when='default: t_end of &case', help='the load ends'))
      if (visitor%every_key .or. has_word(keys, 'value')) &
         call visitor%field(load%value, key('value', 'N or N m', default='depends', example='1500.0', &
            when="required unless law = 'table'", help='constant value, amplitude, or height of the step'))
      if (visitor%every_key .or. has_word(keys, 'rate')) &
         call visitor%field(load%rate, key('rate', 'rad/s', default='depends', when=rate_when, &
            help=rate_help))
      if (visitor%every_key .or. has_word(keys, 'rise_time')) &
         call visitor%field(load%rise_time, key('rise_time', 's', rule=positive, default='depends', &
            when="law = 'smooth_step'; default: t_end - t_start", help='duration of the rise from 0 to value'))
      if (visitor%every_key .or. has_word(keys, 'times')) &
         call visitor%field(load%times, key('times', 's', any_list, default='depends', when="required when law = 'table'", &
            help='increasing times, two at least; two equal ones make a jump'))
      if (visitor%every_key .or. has_word(keys, 'values')) &
         call visitor%field(load%values, key('values', 'N or N m', any_list, default='depends', &
            when="required when law = 'table'", help='value at each of the times, linear in between'))
      if (visitor%every_key .or. has_word(keys, 'after')) &
         call visitor%word_field(load%after, key('after', default='depends', words='zero|hold', &
            when="law = 'table'; default: 'zero'", &
            help='the load beyond its last time, until t_end; before its first time it is zero'))
      call visitor%close_group()
   end subroutine visit_load

   !> Only the keys that the law has.
   subroutine visit_kink_program(visitor, instance, program)
      class(field_visitor), intent(inout) :: visitor
      integer, intent(in) :: instance
      type(kink_config), intent(inout) :: program
      character(len=:), allocatable :: keys
      call visitor%open_group(group('kink_program', repeatable=.true., &
         help='a kink that moves; repeat the group for each program, or leave it out'), instance)
      call visitor%field(program%hinge, key('hinge', rule=not_negative, default='required', example='0', &
         help='hinge 0..n-1 whose kink moves'))
      call visitor%word_field(program%law, key('law', words=motion_words, &
         help='how it moves between t_start and t_end; after, it stays; smooth_step: continuous acceleration'))
      keys = keys_of_law(program%law)
      if (visitor%every_key .or. has_word(keys, 't_start')) &
         call visitor%field(program%t_start, key('t_start', 's', help='the motion begins; a table has its own times'))
      if (visitor%every_key .or. has_word(keys, 't_end')) &
         call visitor%field(program%t_end, key('t_end', 's', default='depends', when='default: t_end of &case', &
            help='the motion ends; a ramp with t_end = t_start is a step'))
      if (visitor%every_key .or. has_word(keys, 'value')) &
         call visitor%field(program%value, key('value', 'rad', default='depends', example='0.1', &
            when="required unless law = 'table'", help='change of the kink, or amplitude of the sine'))
      if (visitor%every_key .or. has_word(keys, 'rate')) &
         call visitor%field(program%rate, key('rate', 'rad/s', default='depends', when=rate_when, help=rate_help))
      if (visitor%every_key .or. has_word(keys, 'times')) &
         call visitor%field(program%times, key('times', 's', any_list, default='depends', when="required when law = 'table'", &
            help='increasing times, two at least'))
      if (visitor%every_key .or. has_word(keys, 'values')) &
         call visitor%field(program%values, key('values', 'rad', any_list, default='depends', when="required when law = 'table'", &
            help='value at each time; a cubic spline at rest at its ends'))
      call visitor%close_group()
   end subroutine visit_kink_program

   subroutine visit_hinge(visitor, instance, hinge)
      class(field_visitor), intent(inout) :: visitor
      integer, intent(in) :: instance
      type(hinge_config), intent(inout) :: hinge
      call visitor%open_group(group('hinge', repeatable=.true., &
         help='further laws of one hinge; angles are joint rotations; repeat the group, or leave it out'), instance)
      call visitor%field(hinge%hinge, key('hinge', rule=not_negative, default='required', example='0', help='hinge 0..n-1'))
      call visitor%field(hinge%held, key('held', help='locked at its initial angle until it is released'))
      call visitor%field(hinge%release_time, key('release_time', 's', rule=in_range, low=0.0_wp, high=1.0e9_wp, default='depends', &
         when='default: never', help='a held hinge is released'))
      call visitor%field(hinge%release_after, key('release_after', rule=not_negative, default='depends', when='default: none', &
         help='a held hinge is released when that hinge latches'))
      call visitor%field(hinge%rest_angle, key('rest_angle', 'rad', help='joint rotation at which the spring has no moment'))
      call visitor%field(hinge%freeplay, key('freeplay', 'rad', rule=not_negative, &
         help='the spring acts beyond this rotation from its rest angle, to either side'))
      call visitor%field(hinge%freeplay_stiffness, key('freeplay_stiffness', 'N m/rad', rule=not_negative, &
         help='stiffness within the freeplay'))
      call visitor%field(hinge%lower_stop, key('lower_stop', 'rad', rule=between, low=-1.0e3_wp, high=1.0e3_wp, default='depends', &
         when='default: none', help='angle below which a stop acts'))
      call visitor%field(hinge%upper_stop, key('upper_stop', 'rad', rule=between, low=-1.0e3_wp, high=1.0e3_wp, default='depends', &
         when='default: none', help='angle beyond which a stop acts'))
      call visitor%field(hinge%stop_stiffness, key('stop_stiffness', 'N m/rad', rule=not_negative, help='of both stops'))
      call visitor%field(hinge%stop_damping, key('stop_damping', 'N m s/rad', rule=not_negative, &
         help='of both stops, which push but never pull'))
      call visitor%field(hinge%latch_angle, key('latch_angle', 'rad', rule=between, low=-1.0e3_wp, high=1.0e3_wp, &
         default='depends', when='default: none', help='angle at which the hinge latches: locks for good'))
      call visitor%field(hinge%lock_stiffness, key('lock_stiffness', 'N m/rad', rule=not_negative, &
         help='of a spring that locks the hinge; 0: a constraint'))
      call visitor%field(hinge%lock_damping, key('lock_damping', 'N m s/rad', rule=not_negative, &
         help='of a damper beside that spring'))
      call visitor%field(hinge%friction_moment, key('friction_moment', 'N m', rule=not_negative, help='moment of dry friction'))
      call visitor%field(hinge%friction_velocity, key('friction_velocity', 'rad/s', rule=positive, default='depends', &
         when='required when friction_moment > 0', help='rate up to which friction grows linearly'))
      call visitor%close_group()
   end subroutine visit_hinge

   subroutine visit_solver(visitor, solver)
      class(field_visitor), intent(inout) :: visitor
      type(solver_config), intent(inout) :: solver
      call visitor%open_group(group('solver', help='integration in time'), 1)
      call visitor%word_field(solver%method, key('method', words='auto|'//method_words, &
         help='auto chooses; gauss (order 16), dop853 (8): built in; erk: ARKODE; adams, bdf: CVODE, errors add up'))
      call visitor%field(solver%rtol, key('rtol', rule=between, low=0.0_wp, high=1.0_wp, &
         help='relative tolerance of a step; errors at the end of a run may be 100 times that'))
      call visitor%field(solver%atol, key('atol', rule=positive, &
         help='absolute tolerance of all states; zero would leave states at rest without a scale'))
      call visitor%field(solver%order, key('order', rule=in_range, low=0.0_wp, high=real(maxval(methods%highest_order), wp), &
         help="maximum order, of a named method; 0: its default"))
      call visitor%field(solver%max_step, key('max_step', 's', rule=not_negative, help='maximum step; 0: no limit'))
      call visitor%field(solver%fixed_step, key('fixed_step', 's', rule=not_negative, &
         help="constant step of erk, dop853 or gauss; 0: adaptive"))
      call visitor%field(solver%allow_unstable, key('allow_unstable', &
         help='take a fixed_step beyond the stability limit of erk or dop853, which is refused otherwise'))
      call visitor%field(solver%max_steps, key('max_steps', rule=at_least, low=1.0_wp, help='maximum number of steps in the run'))
      call visitor%field(solver%max_events, key('max_events', rule=at_least, low=1.0_wp, &
         help='maximum number of hinge events in the run'))
      call visitor%close_group()
   end subroutine visit_solver

   subroutine visit_output(visitor, output)
      class(field_visitor), intent(inout) :: visitor
      type(output_config), intent(inout) :: output
      call visitor%open_group(group('output', help='what is written'), 1)
      call visitor%text_field(output%file, key('file', rule=up_to, high=4096.0_wp, &
         help='path of the result; empty: named after the case file'))
      call visitor%field(output%ledger, key('ledger', help='record energies, work and momenta along the run'))
      call visitor%field(output%loads, key('loads', help='record angles and rates of hinges along the run'))
      call visitor%field(output%compression, key('compression', rule=in_range, low=0.0_wp, high=9.0_wp, help='gzip level'))
      call visitor%close_group()
   end subroutine visit_output

end module rodyn_case_config
