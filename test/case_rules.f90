!> Rules that tie several keys of a case together.
module test_case_rules
   use rodyn_errors, only: error_type
   use rodyn_case_config, only: case_config
   use test_case_support, only: expect_accepted, expect_faults, nl, spacecraft, chain, valid
   use test_testing, only: new_test, unittest
   implicit none (type, external)
   private
   public :: collect_case_rules

contains

   subroutine collect_case_rules(suite)
      type(unittest), allocatable, intent(out) :: suite(:)
      suite = [ &
         new_test('dynamic bending with lumped inertia is refused', dynamic_lumped), &
         new_test('lumped inertia with the default bending is refused', default_lumped), &
         new_test('condensed rods take reduced dampers only', condensed_exact), &
         new_test('condensed rods take no hinges that change their stiffness and no kinks that jerk', condensed_changes), &
         new_test('bent rods at the start are refused unless bending is dynamic', bent_rigid), &
         new_test('a third bending shape needs dynamic bending and five Gauss points', third_shape), &
         new_test('bubbles at the start are refused with two shapes', bubbles_refused), &
         new_test('a fixed spacecraft does not move at the start', fixed_moves), &
         new_test('a load on a node needs the node', node_missing), &
         new_test('a load on a node that does not exist is refused', node_unknown), &
         new_test('a node goes with loads on nodes only', node_forbidden), &
         new_test('moments act on the spacecraft only', moment_on_node), &
         new_test('a load must not begin after its end', load_reversed), &
         new_test('each law asks for its keys', law_required), &
         new_test('each law refuses the keys of others', law_forbidden), &
         new_test('a table has as many values as times', table_count), &
         new_test('the times of a table increase', table_order), &
         new_test('a smooth step fits between start and end', rise_too_long), &
         new_test('a fixed step goes with erk only', fixed_step_adams), &
         new_test('no rule is applied to a key that is wrong itself', no_echo), &
         new_test('rods that bend as motion need mass and two Gauss points', bending_needs_mass), &
         new_test('a rod and its outer node are not both without mass', massless_rod), &
         new_test('each method has its orders', orders), &
         new_test('programs of kinks keep their rules', kink_rules), &
         new_test('hinge laws keep their rules', hinge_rules), &
         new_test('a free spacecraft needs mass and inertia', free_needs_mass)]
   end subroutine collect_case_rules

   subroutine kink_rules(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, valid//'&kink_program hinge = 4, value = 1 /'//nl// &
         "&kink_program hinge = 0, law = 'sine', value = 1 /"//nl// &
         "&kink_program hinge = 0, law = 'table', value = 1, times = 0, 0, values = 1 /"//nl// &
         '&kink_program hinge = 1, value = 1, t_start = 1, t_end = 1 /'//nl// &
         "&kink_program hinge = 2, law = 'ramp', value = 1 /"//nl//'&hinge hinge = 2, held = .true. /', &
         'c.nml:3: &kink_program hinge = 4: there is no such hinge; the numbers are 0..3'//nl// &
         "c.nml:4: &kink_program rate: is required when law = 'sine'"//nl// &
         "c.nml:5: &kink_program value = 1: does not apply to law = 'table'"//nl// &
         'c.nml:5: &kink_program times = 0, 0: must increase, but value 2, 0.00000, follows 0.00000 [s]'//nl// &
         'c.nml:5: &kink_program values = 1: must have as many values as times: 2, not 1'//nl// &
         "c.nml:6: &kink_program t_start = 1: must be before t_end; only law = 'ramp' may be a step"//nl// &
         "c.nml:7: &kink_program law = 'ramp': must be 'smooth_step' or 'table' at a hinge that is held or latches: "// &
         'its rate must not jump')
   end subroutine kink_rules

   subroutine hinge_rules(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, valid//'&hinge hinge = 0, release_time = 1 /'//nl// &
         '&hinge hinge = 0, held = .true., release_after = 3 /'//nl// &
         '&hinge hinge = 1, lower_stop = 0.1, upper_stop = -0.1 /'//nl// &
         '&hinge hinge = 2, friction_moment = 1 /'//nl// &
         '&hinge hinge = 3, lock_damping = 1, freeplay_stiffness = 1 /', &
         'c.nml:3: &hinge release_time = 1: applies only with held = .true.'//nl// &
         'c.nml:4: &hinge hinge = 0: this hinge already has a group &hinge'//nl// &
         'c.nml:4: &hinge release_after = 3: that hinge must have a latch_angle of its own'//nl// &
         'c.nml:5: &hinge upper_stop = -0.1: must be greater than lower_stop'//nl// &
         'c.nml:5: &hinge stop_stiffness: is required with a stop and must be positive'//nl// &
         'c.nml:6: &hinge friction_velocity: is required when friction_moment > 0'//nl// &
         'c.nml:7: &hinge freeplay_stiffness = 1: applies only with freeplay'//nl// &
         'c.nml:7: &hinge lock_damping = 1: applies only with lock_stiffness')
   end subroutine hinge_rules

   subroutine dynamic_lumped(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&model inertia = ''lumped'','//nl//' bending = ''dynamic'' /', &
         'c.nml:4: &model bending = ''dynamic'': bending = ''dynamic'' is not possible with '//&
         'inertia = ''lumped''; take ''quasistatic'' or ''rigid''')
   end subroutine dynamic_lumped

   subroutine default_lumped(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&model inertia = ''lumped'' /', &
         'c.nml:3: &model inertia = ''lumped'': bending = ''dynamic'' is not possible with '//&
         'inertia = ''lumped''; take ''quasistatic'' or ''rigid''')
   end subroutine default_lumped

   subroutine condensed_exact(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&model formulation = ''consistent'', bending = ''quasistatic'', dampers = ''exact'' /', &
         'c.nml:3: &model dampers = ''exact'': ''exact'' is not possible with bending = ''quasistatic'' and '//&
         'inertia = ''distributed''; take ''reduced'', or inertia = ''lumped''')
   end subroutine condensed_exact

   subroutine condensed_changes(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&model formulation = ''consistent'', bending = ''quasistatic'' /'//new_line('a')//&
         '&hinge hinge = 0, upper_stop = 1, stop_stiffness = 9 / &kink_program hinge = 0, law = ''sine'', value = 1, rate = 1 /', &
         'c.nml:4: &hinge upper_stop = 1: is not possible with bending = ''quasistatic'' and inertia = ''distributed'''//&
         new_line('a')//'c.nml:4: &kink_program law = ''sine'': must be ''smooth_step'' or ''table'' with bending = '//&
         '''quasistatic'' and inertia = ''distributed'': the rate of the kink must not jump')
   end subroutine condensed_changes

   subroutine bent_rigid(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&model bending = ''rigid'' /'//nl//&
         '&initial alpha(2) = 0.1, beta = 0, alpha_rate = 1, beta_rate = 4*1, phi_rate '//'= 1 /', &
         'c.nml:4: &initial alpha(2) = 0.1: must be 0 when bending = ''rigid'''//nl//&
         'c.nml:4: &initial alpha_rate = 1: must be 0 when bending = ''rigid'''//nl//&
         'c.nml:4: &initial beta_rate = 4*1: must be 0 when bending = ''rigid''')
   end subroutine bent_rigid

   subroutine third_shape(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&model bending_shapes = 3 /', &
         'c.nml:3: &model bending_shapes = 3: 3 needs gauss_points = 5 or more (the square of the third shape has degree 8)')
      if (allocated(error)) return
      call expect_faults(error, &
         valid//'&model bending_shapes = 3, gauss_points = 5, bending = ''rigid'' /', &
         'c.nml:3: &model bending_shapes = 3: 3 is possible with bending = ''dynamic'' only')
      if (allocated(error)) return
      call expect_faults(error, valid//'&model bending_shapes = 4 /', 'c.nml:3: &model bending_shapes = 4: must lie in 2..3')
   end subroutine third_shape

   subroutine bubbles_refused(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, valid//'&initial bubble(2) = 0.01, bubble_rate = 1 /', &
         'c.nml:3: &initial bubble(2) = 0.01: must be 0 when bending_shapes = 2'//nl//&
         'c.nml:3: &initial bubble_rate = 1: must be 0 when bending_shapes = 2')
   end subroutine bubbles_refused

   subroutine fixed_moves(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         chain//'&spacecraft motion = ''fixed'' /'//nl//&
         '&initial velocity_x = 1, velocity_y = 1, omega = 1, displacement_x = 1, '//&
         'displacement_y = 1, rotation = 1 /', &
         'c.nml:3: &initial velocity_x = 1: must be 0 when motion = ''fixed'''//nl//&
         'c.nml:3: &initial velocity_y = 1: must be 0 when motion = ''fixed'''//nl//&
         'c.nml:3: &initial omega = 1: must be 0 when motion = ''fixed'''//nl//&
         'c.nml:3: &initial displacement_x = 1: must be 0 when motion = ''fixed'''//nl//&
         'c.nml:3: &initial displacement_y = 1: must be 0 when motion = ''fixed'''//nl//&
         'c.nml:3: &initial rotation = 1: must be 0 when motion = ''fixed''')
   end subroutine fixed_moves

   subroutine node_missing(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&load target = ''node'', component = ''X'', value = 1 /', &
         'c.nml:3: &load node: is required when target = ''node''')
   end subroutine node_missing

   subroutine node_unknown(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&load target = ''node'', component = ''X'', value = 1, node = 5 /'//nl//&
         '&load target = ''node'', component = ''Y'', value = 1, node = 0 /', &
         'c.nml:3: &load node = 5: there is no such node; the numbers are 1..4'//nl//&
         'c.nml:4: &load node = 0: must be at least 1')
   end subroutine node_unknown

   subroutine node_forbidden(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&load value = 1, node = 2 /', &
         'c.nml:3: &load node = 2: applies only with target = ''node''')
   end subroutine node_forbidden

   subroutine moment_on_node(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&load target = ''node'', node = 1, component = ''M'', value = 1 /', &
         'c.nml:3: &load component = ''M'': must be ''X'' or ''Y'' when target = ''node''; '//&
         'moments act on the spacecraft only')
   end subroutine moment_on_node

   subroutine load_reversed(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&load value = 1, t_start = 3, t_end = 2 /'//nl//'&load value = 1, t_end = -1 /', &
         'c.nml:3: &load t_start = 3: must not be after t_end = 2.00000 [s] of the same load'//nl//&
         'c.nml:4: &load t_end = -1: must not be before t_start = 0.00000 [s] of the same load')
   end subroutine load_reversed

   subroutine law_required(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&load /'//nl//'&load law = ''sine_squared'' /'//nl//'&load law = ''table'' /'//nl//&
         '&load law = ''smooth_step'' /', &
         'c.nml:3: &load value: is required when law = ''constant'''//nl//&
         'c.nml:4: &load value: is required when law = ''sine_squared'''//nl//&
         'c.nml:4: &load rate: is required when law = ''sine_squared'''//nl//&
         'c.nml:5: &load times: is required when law = ''table'''//nl//&
         'c.nml:5: &load values: is required when law = ''table'''//nl//&
         'c.nml:6: &load value: is required when law = ''smooth_step''')
   end subroutine law_required

   subroutine law_forbidden(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&load value = 1, rate = 2 /'//nl//&
         '&load law = ''table'', times = 0, 1, values = 1, 2, value = 3, rise_time = 1 /'//nl//&
         '&load value = 1, after = ''hold'' /', &
         'c.nml:3: &load rate = 2: does not apply to law = ''constant'''//nl//&
         'c.nml:4: &load value = 3: does not apply to law = ''table'''//nl//&
         'c.nml:4: &load rise_time = 1: does not apply to law = ''table'''//nl//&
         'c.nml:5: &load after = ''hold'': does not apply to law = ''constant''')
   end subroutine law_forbidden

   subroutine table_count(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&load law = ''table'', times = 0, 1, 2, values = 1, 2 /'//nl//&
         '&load law = ''table'', times = 0, values = 1 /', &
         'c.nml:3: &load values = 1, 2: must have as many values as times: 3, not 2'//nl//&
         'c.nml:4: &load times = 0: must have at least two values')
   end subroutine table_count

   subroutine table_order(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&load law = ''table'', times = 0, 2, 2, 2, values = 4*1 /'//nl// &
         '&load law = ''table'', times = 0, 2, 1, values = 3*1 /', &
         'c.nml:3: &load times = 0, 2, 2, 2: must increase, or jump at two equal times, but value 4, 2.00000, follows '// &
         '2.00000 [s]'//nl// &
         'c.nml:4: &load times = 0, 2, 1: must increase, or jump at two equal times, but value 3, 1.00000, follows '// &
         '2.00000 [s]')
   end subroutine table_order

   subroutine rise_too_long(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&load law = ''smooth_step'', value = 1, rise_time = 3 /'//nl//&
         '&load law = ''smooth_step'', value = 1, rise_time = 0 /'//nl//&
         '&load law = ''smooth_step'', value = 1, t_start = 1, t_end = 1 /'//nl//&
         '&load law = ''smooth_step'', value = 1, rise_time = 3, t_end = 2 /', &
         'c.nml:3: &load rise_time = 3: must not exceed t_end - t_start = 1.00000 [s], with t_end of &case'//nl//&
         'c.nml:4: &load rise_time = 0: must be positive [s]'//nl//&
         'c.nml:5: &load rise_time: must be positive, but t_end = t_start [s]'//nl//&
         'c.nml:6: &load rise_time = 3: must not exceed t_end - t_start = 2.00000 [s] of the same load')
   end subroutine rise_too_long

   subroutine fixed_step_adams(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&solver method = ''adams'', fixed_step = 0.1 /'//nl, &
         'c.nml:3: &solver fixed_step = 0.1: is possible with method = ''erk'', ''dop853'' or ''gauss'' only')
   end subroutine fixed_step_adams

   subroutine no_echo(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&load law = ''step'', rate = 1 /'//nl//&
         '&model inertia = ''lumped'', bending = ''elastic'' /'//nl, &
         'c.nml:3: &load law = ''step'': must be ''constant'', ''table'', ''sine_squared'', '//&
         '''smooth_step'', ''ramp'' or ''sine'''//nl//&
         'c.nml:4: &model bending = ''elastic'': must be ''dynamic'', ''quasistatic'' or ''rigid''')
   end subroutine no_echo

   subroutine free_needs_mass(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         chain//'&spacecraft /'//nl, &
         'c.nml:2: &spacecraft mass: is required when motion = ''free'''//nl//&
         'c.nml:2: &spacecraft inertia: is required when motion = ''free''')
   end subroutine free_needs_mass

   subroutine bending_needs_mass(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         spacecraft//'&chain n_rods = 3, length = 1, mass_per_length = 2*1, 0, bending_stiffness = 1, hinge_stiffness = 1 /'//nl// &
         '&model gauss_points = 1 /', &
         'c.nml:2: &chain mass_per_length = 2*1, 0: must be positive when bending = ''dynamic'', but is 0 for rod 3'//nl// &
         'c.nml:3: &model gauss_points = 1: must be at least 4 when bending = ''dynamic'' (the square of a shape has degree 6)')
   end subroutine bending_needs_mass

   subroutine massless_rod(error)
      type(error_type), allocatable, intent(out) :: error
      character(len=*), parameter :: rods = '&chain n_rods = 3, length = 1, hinge_stiffness = 1, mass_per_length = 1, 0, '
      call expect_faults(error, &
         spacecraft//rods//'0 /'//nl//'&model bending = ''rigid'', inertia = ''lumped'' /', &
         'c.nml:2: &chain node_mass: rod 2 and its outer node are both without mass')
      if (allocated(error)) return
      call expect_faults(error, &
         spacecraft//rods//'1 /'//nl//'&model bending = ''rigid'' /', &
         'c.nml:2: &chain node_mass: rod 2 and its outer node are both without mass')
   end subroutine massless_rod

   subroutine orders(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      call expect_faults(error, valid//'&solver order = 5 /', &
         'c.nml:3: &solver order = 5: needs a named method: ''auto'' chooses the order itself')
      if (allocated(error)) return
      call expect_faults(error, valid//'&solver method = ''bdf'', order = 6 /', &
         'c.nml:3: &solver order = 6: must lie in 0..5 when method = ''bdf''')
      if (allocated(error)) return
      call expect_faults(error, valid//'&solver method = ''erk'', order = 1 /', &
         'c.nml:3: &solver order = 1: must be 0 or lie in 2..8 when method = ''erk''')
      if (allocated(error)) return
      call expect_faults(error, valid//'&solver method = ''dop853'', order = 7 /', &
         'c.nml:3: &solver order = 7: must be 0 or 8 when method = ''dop853''')
      if (allocated(error)) return
      call expect_accepted(error, valid//'&solver method = ''gauss'', order = 16 /', config)
   end subroutine orders

end module test_case_rules
