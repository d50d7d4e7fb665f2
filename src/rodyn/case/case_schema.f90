!> The one table of all keys of a case file: checking, defaults and documentation come from it.
module rodyn_case_schema
   use rodyn_kinds, only: wp
   use rodyn_methods, only: method_words, methods
   use rodyn_schema, only: schema_group, schema_row, schema_extent, type_integer, type_real, type_logical, &
      type_word, type_text, any_list, positive, not_negative, at_least, in_range, between, up_to
   implicit none (type, external)
   private
   public :: case_groups, case_rows, case_extents

   integer, parameter :: rods = 1, nodes = 2, hinges = 3

   type(schema_group), parameter :: case_groups(11) = [ &
      schema_group('case', help='what is computed'), &
      schema_group('spacecraft', help='rigid body that carries hinge 0'), &
      schema_group('chain', help='rods and nodes 1..n, hinges 0..n-1; one single value fills a whole array'), &
      schema_group('rod_profile', repeatable=.true., &
         help='how a value of &chain varies along rods: times a factor over s/l; repeat the group, or leave it out'), &
      schema_group('model', help='which equations, and how they are evaluated'), &
      schema_group('initial', help='state at t = 0'), &
      schema_group('load', repeatable=.true., help='one load; repeat the group for each load, or leave it out'), &
      schema_group('kink_program', repeatable=.true., &
         help='a kink that moves; repeat the group for each program, or leave it out'), &
      schema_group('hinge', repeatable=.true., &
         help='more of one hinge: angles are joint rotations from its kink; repeat or leave out'), &
      schema_group('solver', help='integration in time'), &
      schema_group('output', help='what is written')]

   type(schema_row), parameter :: case_rows(*) = [ &
      schema_row('case', 'title', type_text, default="''", rule=up_to, high=1000.0_wp, &
         help='title of the case'), &
      schema_row('case', 't_end', type_real, unit='s', default='1.0', rule=positive, &
         help='end of the simulated time, which begins at 0'), &
      schema_row('case', 'n_outputs', type_integer, default='1000', rule=in_range, low=1.0_wp, high=1.0e8_wp, &
         help='output intervals: n_outputs + 1 rows'), &
      schema_row('spacecraft', 'mass', type_real, unit='kg', default='depends', rule=positive, example='122.5', &
         when="required when motion = 'free'", help='mass M0'), &
      schema_row('spacecraft', 'inertia', type_real, unit='kg m^2', default='depends', rule=positive, &
         example='10.0', when="required when motion = 'free'", &
         help='moment of inertia J0 about the centre of mass'), &
      schema_row('spacecraft', 'hinge_x', type_real, unit='m', default='0.0', &
         help='x0 of hinge 0 from the centre of mass, moving axes'), &
      schema_row('spacecraft', 'hinge_y', type_real, unit='m', default='0.0', &
         help='y0 of hinge 0 from the centre of mass, moving axes'), &
      schema_row('spacecraft', 'motion', type_word, default="'free'", words='free|fixed', &
         help='free-floating or fixed spacecraft'), &
      schema_row('chain', 'n_rods', type_integer, rule=in_range, low=1.0_wp, high=1.0e6_wp, example='4', &
         help='number of rods n'), &
      schema_row('chain', 'length', type_real, rods, 'm', rule=positive, example='1.5', &
         help='length l of each rod'), &
      schema_row('chain', 'mass_per_length', type_real, rods, 'kg/m', rule=not_negative, example='1.696', &
         help='mass per length m of each rod'), &
      schema_row('chain', 'bending_stiffness', type_real, rods, 'N m^2', default='depends', rule=positive, &
         example='1.374e4', when="required unless bending = 'rigid'", help='bending stiffness EI of each rod'), &
      schema_row('chain', 'node_mass', type_real, nodes, 'kg', '0.0', rule=not_negative, &
         help='point mass mu at the outer end of each rod'), &
      schema_row('chain', 'hinge_stiffness', type_real, hinges, 'N m/rad', rule=not_negative, example='4000.0', &
         help='torsional spring C of each hinge'), &
      schema_row('chain', 'hinge_damping', type_real, hinges, 'N m s/rad', '0.0', rule=not_negative, &
         help='viscous damper D of each hinge'), &
      schema_row('chain', 'kink', type_real, hinges, 'rad', '0.0', &
         help='imposed break gamma of the axis at each hinge'), &
      schema_row('rod_profile', 'quantity', type_word, words='mass_per_length|bending_stiffness', &
         example="'mass_per_length'", help='which key of &chain the factor multiplies'), &
      schema_row('rod_profile', 'first_rod', type_integer, default='1', rule=at_least, low=1.0_wp, &
         help='first rod that has this profile'), &
      schema_row('rod_profile', 'last_rod', type_integer, default='depends', rule=at_least, low=1.0_wp, &
         when='default: n_rods', help='last rod that has it'), &
      schema_row('rod_profile', 'polynomial', type_real, any_list, default='depends', example='1.0', &
         when='required unless positions and values are given', help='c0, c1, ...: the factor is sum c_i (s/l)**i'), &
      schema_row('rod_profile', 'positions', type_real, any_list, default='depends', rule=in_range, low=0.0_wp, &
         high=1.0_wp, when='instead of polynomial', help='s/l from 0 to 1, rising; two equal ones make a jump'), &
      schema_row('rod_profile', 'values', type_real, any_list, default='depends', rule=not_negative, &
         when='instead of polynomial', help='factor at each of the positions, linear in between'), &
      schema_row('model', 'formulation', type_word, default="'consistent'", words='consistent|paper', &
         help='every term kept, or second-order terms in bending dropped as in the article'), &
      schema_row('model', 'inertia', type_word, default="'distributed'", words='distributed|lumped', &
         help='mass along the rods, or half of it at each of their ends'), &
      schema_row('model', 'bending', type_word, default="'dynamic'", words='dynamic|quasistatic|rigid', &
         help="dynamic needs inertia = 'distributed', quasistatic needs 'lumped'"), &
      schema_row('model', 'bending_shapes', type_integer, default='2', rule=in_range, low=2.0_wp, high=3.0_wp, &
         help="of a rod, bending = 'dynamic': 2 are its end slopes; 3 adds a bubble between (gauss_points >= 5)"), &
      schema_row('model', 'dampers', type_word, default="'reduced'", words='reduced|exact', &
         help='of quasistatic bending: reduced is accurate to (D w/C)^2, exact adds a state per damped hinge'), &
      schema_row('model', 'gauss_points', type_integer, default='4', rule=in_range, low=1.0_wp, high=200.0_wp, &
         help='points of the quadrature rule for the rod integrals'), &
      schema_row('model', 'kernel', type_word, default="'recursive'", words='recursive|assembled', &
         help='O(n) recursion, or the assembled system and LAPACK'), &
      schema_row('model', 'deflection_limit', type_real, default='0.06', rule=positive, &
         help='a run warns if a rod bends by more than this part of its length; its chord is then 1 % too long'), &
      schema_row('initial', 'phi', type_real, rods, 'rad', '0.0', &
         help='angle of each chord from the moving x axis'), &
      schema_row('initial', 'alpha', type_real, rods, 'rad', '0.0', &
         help="slope at the inner end; bending = 'dynamic' only"), &
      schema_row('initial', 'beta', type_real, rods, 'rad', '0.0', &
         help="slope at the outer end; bending = 'dynamic' only"), &
      schema_row('initial', 'bubble', type_real, rods, 'm', '0.0', &
         help="deflection by the third shape in mid-rod; bending_shapes = 3 only"), &
      schema_row('initial', 'phi_rate', type_real, rods, 'rad/s', '0.0', help='rate of phi'), &
      schema_row('initial', 'alpha_rate', type_real, rods, 'rad/s', '0.0', &
         help="rate of alpha; bending = 'dynamic' only"), &
      schema_row('initial', 'beta_rate', type_real, rods, 'rad/s', '0.0', &
         help="rate of beta; bending = 'dynamic' only"), &
      schema_row('initial', 'bubble_rate', type_real, rods, 'm/s', '0.0', &
         help="rate of bubble; bending_shapes = 3 only"), &
      schema_row('initial', 'velocity_x', type_real, unit='m/s', default='0.0', &
         help='Vx of the spacecraft, moving axes'), &
      schema_row('initial', 'velocity_y', type_real, unit='m/s', default='0.0', &
         help='Vy of the spacecraft, moving axes'), &
      schema_row('initial', 'omega', type_real, unit='rad/s', default='0.0', &
         help='angular velocity of the spacecraft'), &
      schema_row('initial', 'displacement_x', type_real, unit='m', default='0.0', &
         help='u_x of the spacecraft, moving axes'), &
      schema_row('initial', 'displacement_y', type_real, unit='m', default='0.0', &
         help='u_y of the spacecraft, moving axes'), &
      schema_row('initial', 'rotation', type_real, unit='rad', default='0.0', &
         help='rotation theta of the spacecraft'), &
      schema_row('load', 'target', type_word, default="'spacecraft'", words='spacecraft|node', &
         help='where the load acts: centre of mass of the spacecraft, or a node'), &
      schema_row('load', 'node', type_integer, default='depends', rule=at_least, low=1.0_wp, &
         when="required when target = 'node'", help='node 1..n on which the load acts'), &
      schema_row('load', 'component', type_word, default="'M'", words='X|Y|M', &
         help='force along a moving axis [N], or moment [N m] (spacecraft only)'), &
      schema_row('load', 'law', type_word, default="'constant'", words='constant|table|sine_squared|smooth_step', &
         help='how the load changes between t_start and t_end; outside it is zero'), &
      schema_row('load', 't_start', type_real, unit='s', default='0.0', help='the load begins'), &
      schema_row('load', 't_end', type_real, unit='s', default='depends', &
         when='default: t_end of &case', help='the load ends'), &
      schema_row('load', 'value', type_real, unit='N or N m', default='depends', example='1500.0', &
         when="required unless law = 'table'", help='constant value, amplitude, or height of the step'), &
      schema_row('load', 'rate', type_real, unit='rad/s', default='depends', &
         when="required when law = 'sine_squared'", help='value * sin(rate * t)**2'), &
      schema_row('load', 'rise_time', type_real, unit='s', default='depends', rule=positive, &
         when="law = 'smooth_step'; default: t_end - t_start", help='duration of the rise from 0 to value'), &
      schema_row('load', 'times', type_real, any_list, 's', 'depends', &
         when="required when law = 'table'", help='increasing times, two at least; two equal ones make a jump'), &
      schema_row('load', 'values', type_real, any_list, 'N or N m', 'depends', &
         when="required when law = 'table'", help='value at each of the times, linear in between'), &
      schema_row('load', 'after', type_word, default='depends', words='zero|hold', &
         when="law = 'table'; default: 'zero'", &
         help='the load beyond its last time, until t_end; before its first time it is zero'), &
      schema_row('kink_program', 'hinge', type_integer, rule=not_negative, example='0', &
         help='hinge 0..n-1 whose kink moves'), &
      schema_row('kink_program', 'law', type_word, default="'smooth_step'", words='ramp|smooth_step|sine|table', &
         help='how it moves between t_start and t_end; after, it stays; smooth_step: continuous acceleration'), &
      schema_row('kink_program', 't_start', type_real, unit='s', default='0.0', &
         help='the motion begins; a table has its own times'), &
      schema_row('kink_program', 't_end', type_real, unit='s', default='depends', &
         when='default: t_end of &case', help='the motion ends; a ramp with t_end = t_start is a step'), &
      schema_row('kink_program', 'value', type_real, unit='rad', default='depends', example='0.1', &
         when="required unless law = 'table'", help='change of the kink, or amplitude of the sine'), &
      schema_row('kink_program', 'rate', type_real, unit='rad/s', default='depends', &
         when="required when law = 'sine'", help='value * sin(rate * (t - t_start))'), &
      schema_row('kink_program', 'times', type_real, any_list, 's', 'depends', &
         when="required when law = 'table'", help='increasing times, two at least'), &
      schema_row('kink_program', 'values', type_real, any_list, 'rad', 'depends', &
         when="required when law = 'table'", help='value at each time; a cubic spline at rest at its ends'), &
      schema_row('hinge', 'hinge', type_integer, rule=not_negative, example='0', &
         help='hinge 0..n-1'), &
      schema_row('hinge', 'held', type_logical, default='.false.', &
         help='locked at its initial angle until it is released'), &
      schema_row('hinge', 'release_time', type_real, unit='s', default='depends', rule=in_range, low=0.0_wp, high=1.0e9_wp, &
         when='default: never', help='a held hinge is released'), &
      schema_row('hinge', 'release_after', type_integer, default='depends', rule=not_negative, &
         when='default: none', help='a held hinge is released when that hinge latches'), &
      schema_row('hinge', 'rest_angle', type_real, unit='rad', default='0.0', &
         help='angle at which the spring is slack'), &
      schema_row('hinge', 'freeplay', type_real, unit='rad', default='0.0', rule=not_negative, &
         help='the spring acts beyond this rotation from its rest angle, to either side'), &
      schema_row('hinge', 'freeplay_stiffness', type_real, unit='N m/rad', default='0.0', rule=not_negative, &
         help='stiffness within the freeplay'), &
      schema_row('hinge', 'lower_stop', type_real, unit='rad', default='depends', rule=between, low=-1.0e3_wp, high=1.0e3_wp, &
         when='default: none', help='angle below which a stop acts'), &
      schema_row('hinge', 'upper_stop', type_real, unit='rad', default='depends', rule=between, low=-1.0e3_wp, high=1.0e3_wp, &
         when='default: none', help='angle beyond which a stop acts'), &
      schema_row('hinge', 'stop_stiffness', type_real, unit='N m/rad', default='0.0', rule=not_negative, &
         help='of both stops'), &
      schema_row('hinge', 'stop_damping', type_real, unit='N m s/rad', default='0.0', rule=not_negative, &
         help='of both stops, which push but never pull'), &
      schema_row('hinge', 'latch_angle', type_real, unit='rad', default='depends', rule=between, low=-1.0e3_wp, high=1.0e3_wp, &
         when='default: none', help='angle on reaching which the hinge locks for good'), &
      schema_row('hinge', 'lock_stiffness', type_real, unit='N m/rad', default='0.0', rule=not_negative, &
         help='of a spring that locks the hinge; 0: a constraint'), &
      schema_row('hinge', 'lock_damping', type_real, unit='N m s/rad', default='0.0', rule=not_negative, &
         help='of a damper beside that spring'), &
      schema_row('hinge', 'friction_moment', type_real, unit='N m', default='0.0', rule=not_negative, &
         help='moment of dry friction'), &
      schema_row('hinge', 'friction_velocity', type_real, unit='rad/s', default='depends', rule=positive, &
         when='required when friction_moment > 0', help='rate up to which friction grows linearly'), &
      schema_row('solver', 'method', type_word, default="'auto'", words='auto|'//method_words, &
         help='auto chooses; gauss, dop853: our own, order 16 and 8; erk: ARKODE; adams, bdf: CVODE, errors add up'), &
      schema_row('solver', 'rtol', type_real, default='1.0e-8', rule=between, low=0.0_wp, high=1.0_wp, &
         help='relative tolerance; at the end of a run errors may be up to 100 times that'), &
      schema_row('solver', 'atol', type_real, default='1.0e-10', rule=positive, &
         help='absolute tolerance of all states; zero would leave states at rest without a scale'), &
      schema_row('solver', 'order', type_integer, default='0', rule=in_range, low=0.0_wp, &
         high=real(maxval(methods%highest_order), wp), help="highest order, with a method named; 0: the choice of the method"), &
      schema_row('solver', 'max_step', type_real, unit='s', default='0.0', rule=not_negative, &
         help='longest step; 0: no bound'), &
      schema_row('solver', 'fixed_step', type_real, unit='s', default='0.0', rule=not_negative, &
         help="constant step of erk, dop853 or gauss; 0: adaptive"), &
      schema_row('solver', 'allow_unstable', type_logical, default='.false.', &
         help='take a fixed_step beyond the stability limit of erk or dop853, which is refused otherwise'), &
      schema_row('solver', 'max_steps', type_integer, default='1000000000', rule=at_least, low=1.0_wp, &
         help='most steps of the whole run'), &
      schema_row('solver', 'max_events', type_integer, default='100000', rule=at_least, low=1.0_wp, &
         help='most events of hinges in the whole run'), &
      schema_row('output', 'file', type_text, default="''", rule=up_to, high=4096.0_wp, &
         help='path of the result; empty: named after the case file'), &
      schema_row('output', 'ledger', type_logical, default='.true.', &
         help='record energies, work and momenta along the run'), &
      schema_row('output', 'compression', type_integer, default='4', rule=in_range, low=0.0_wp, high=9.0_wp, &
         help='gzip level')]

contains

   !> What the arrays of a chain of n rods run over.
   pure function case_extents(n_rods) result(extents)
      integer, intent(in) :: n_rods !! 0: not known
      type(schema_extent) :: extents(3)
      extents(rods) = schema_extent('rod', 1, n_rods)
      extents(nodes) = schema_extent('node', 1, n_rods)
      extents(hinges) = schema_extent('hinge', 0, n_rods)
   end function case_extents

end module rodyn_case_schema
