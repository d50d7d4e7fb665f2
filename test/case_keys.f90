!> Every key keeps the rules of its row of the table, and every fault is told with its line.
module test_case_keys
   use rodyn_errors, only: error_type
   use test_case_support, only: expect_faults, nl, chain, spacecraft, valid
   use test_testing, only: new_test, unittest
   implicit none (type, external)
   private
   public :: collect_case_keys

contains

   subroutine collect_case_keys(suite)
      type(unittest), allocatable, intent(out) :: suite(:)
      suite = [ &
         new_test('an unknown group is named with the nearest one', unknown_group), &
         new_test('an unknown key is named with the nearest one', unknown_key), &
         new_test('a key of another group is sent there', key_elsewhere), &
         new_test('a second group is refused', second_group), &
         new_test('a key given twice is refused', key_twice), &
         new_test('an element given twice is refused', element_twice), &
         new_test('an element beyond the ends is refused', element_outside), &
         new_test('hinges count from zero', hinge_outside), &
         new_test('a scalar takes no index', index_of_scalar), &
         new_test('a decimal comma in a scalar is explained', comma_in_scalar), &
         new_test('a decimal comma in an array is explained', comma_in_array), &
         new_test('too many values for a scalar are counted', scalar_count), &
         new_test('too few values for an array are counted', array_count), &
         new_test('too many values for an element are counted', element_count), &
         new_test('wrong types are refused', wrong_types), &
         new_test('an unknown word is refused with those allowed', unknown_word), &
         new_test('the broken element of a list is shown', broken_element), &
         new_test('the broken element after a repeat count is shown', broken_repeat), &
         new_test('values out of their domain are refused', domain), &
         new_test('a chain without rods is refused', no_rods), &
         new_test('mass and inertia must be positive', mass_domain), &
         new_test('all that is required is asked for', all_required), &
         new_test('elements without a value are asked for', missing_element), &
         new_test('several faults come sorted by line', several_faults)]
   end subroutine collect_case_keys

   subroutine unknown_group(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&solvr rtol = 0.1 /', &
         'c.nml:3: &solvr: unknown group; the nearest known one is &solver')
   end subroutine unknown_group

   subroutine unknown_key(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&solver rtoll = 0.1 /', &
         'c.nml:3: &solver rtoll: unknown key; the nearest known one is rtol')
   end subroutine unknown_key

   subroutine key_elsewhere(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&solver n_outputs = 1 /', &
         'c.nml:3: &solver n_outputs: unknown key; it belongs to &case')
   end subroutine key_elsewhere

   subroutine second_group(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&case /'//nl//'&CASE /', &
         'c.nml:4: &case: the group must not be repeated; the first one is in line 3')
   end subroutine second_group

   subroutine key_twice(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&solver rtol = 1e-3'//nl//' RTOL = 1e-4 /', &
         'c.nml:4: &solver rtol = 1e-4: duplicate key, first given in line 3')
   end subroutine key_twice

   subroutine element_twice(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&initial phi(2) = 1'//nl//' phi(1:3) = 2 /', &
         'c.nml:4: &initial phi(1:3) = 2: element 2 is given twice, first in line 3')
   end subroutine element_twice

   subroutine element_outside(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&initial phi(0) = 1, phi(2:5) = 2 /', &
         'c.nml:3: &initial phi(0) = 1: there is no such rod; the numbers are 1..4'//nl//&
         'c.nml:3: &initial phi(2:5) = 2: there is no such rod; the numbers are 1..4')
   end subroutine element_outside

   subroutine hinge_outside(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         spacecraft//'&chain n_rods = 4, mass_per_length = 1, bending_stiffness = 1, '//&
         'hinge_stiffness = 1, length = 1'//nl//' kink(0) = 1, kink(4) = 1 /', &
         'c.nml:3: &chain kink(4) = 1: there is no such hinge; the numbers are 0..3')
   end subroutine hinge_outside

   subroutine index_of_scalar(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&initial omega(1) = 1 /', &
         'c.nml:3: &initial omega(1) = 1: takes no index')
   end subroutine index_of_scalar

   subroutine comma_in_scalar(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&case t_end = 1,5 /', &
         'c.nml:3: &case t_end = 1, 5: takes one value, not 2; a decimal comma? write 1.5')
   end subroutine comma_in_scalar

   subroutine comma_in_array(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         spacecraft//'&chain n_rods = 4, mass_per_length = 1, bending_stiffness = 1, '//&
         'hinge_stiffness = 1, length = 1,5 /', &
         'c.nml:2: &chain length = 1, 5: takes 1 or 4 values, one per rod, not 2; a '//&
         'decimal comma? write 1.5')
   end subroutine comma_in_array

   subroutine scalar_count(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&case t_end = 1 2 3 /', &
         'c.nml:3: &case t_end = 1, 2, 3: takes one value, not 3')
   end subroutine scalar_count

   subroutine array_count(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&initial phi = 3*0.5 /', &
         'c.nml:3: &initial phi = 3*0.5: takes 1 or 4 values, one per rod, not 3')
   end subroutine array_count

   subroutine element_count(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&initial phi(2) = 1, 2 /', &
         'c.nml:3: &initial phi(2) = 1, 2: takes one value, not 2; write phi(2:3) for all')
   end subroutine element_count

   subroutine wrong_types(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&case title = 3, t_end = .true., n_outputs = 1.5 /'//nl//'&model gauss_points = 1e1 /'//nl// &
         '&output ledger = 1, compression = ''4'' /'//nl//'&solver method = adams /', &
         'c.nml:3: &case title = 3: must be a quoted string'//nl//&
         'c.nml:3: &case t_end = .true.: must be a number [s]'//nl//&
         'c.nml:3: &case n_outputs = 1.5: must be an integer'//nl//&
         'c.nml:4: &model gauss_points = 1e1: must be an integer; write 10'//nl//&
         'c.nml:5: &output ledger = 1: must be .true. or .false.'//nl//&
         'c.nml:5: &output compression = ''4'': must be an integer; without quotes'//nl//&
         'c.nml:6: &solver method = adams: must be ''auto'', ''adams'', ''bdf'', ''erk'', ''dop853'' or ''gauss'', in '//&
         'quotes')
   end subroutine wrong_types

   subroutine unknown_word(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         valid//'&model formulation = ''papers'' /', &
         'c.nml:3: &model formulation = ''papers'': must be ''inextensible'', ''consistent'' or ''paper''')
   end subroutine unknown_word

   subroutine broken_element(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         spacecraft//'&chain n_rods = 4, mass_per_length = 1, bending_stiffness = 1, '//&
         'hinge_stiffness = 1, length = 1, 2'//nl//'  -1.5, 0 /', &
         'c.nml:3: &chain length(3) = -1.5: must be positive [m]'//nl//&
         'c.nml:3: &chain length(4) = 0: must be positive [m]')
   end subroutine broken_element

   subroutine broken_repeat(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         spacecraft//'&chain n_rods = 4, mass_per_length = 1, bending_stiffness = 1, '//&
         'hinge_stiffness = 1, length = 1, kink = 3*0, x'//nl//'/', &
         'c.nml:2: &chain kink(3) = x: must be a number [rad]')
   end subroutine broken_repeat

   subroutine domain(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         spacecraft//'&chain n_rods = 4, length = 0, mass_per_length = -1, bending_stiffness = 0,'//&
         nl//' node_mass = -1, hinge_stiffness = -1, hinge_damping = -1 /'//nl//&
         '&case n_outputs = 0 t_end = -1 /'//nl//'&model gauss_points = 201 /'//nl//&
         '&solver rtol = 1 atol = 0 order = 17 max_step = -1 max_steps = 0 /'//nl//&
         '&output compression = 10 /', &
         'c.nml:2: &chain length = 0: must be positive [m]'//nl//&
         'c.nml:2: &chain mass_per_length = -1: must not be negative [kg/m]'//nl//&
         'c.nml:2: &chain bending_stiffness = 0: must be positive [N m^2]'//nl//&
         'c.nml:3: &chain node_mass = -1: must not be negative [kg]'//nl//&
         'c.nml:3: &chain hinge_stiffness = -1: must not be negative [N m/rad]'//nl//&
         'c.nml:3: &chain hinge_damping = -1: must not be negative [N m s/rad]'//nl//&
         'c.nml:4: &case n_outputs = 0: must lie in 1..100000000'//nl//&
         'c.nml:4: &case t_end = -1: must be positive [s]'//nl//&
         'c.nml:5: &model gauss_points = 201: must lie in 1..200'//nl//&
         'c.nml:6: &solver rtol = 1: must be greater than 0 and less than 1'//nl//&
         'c.nml:6: &solver atol = 0: must be positive'//nl//&
         'c.nml:6: &solver order = 17: must lie in 0..16'//nl//&
         'c.nml:6: &solver max_step = -1: must not be negative [s]'//nl//&
         'c.nml:6: &solver max_steps = 0: must be at least 1'//nl//&
         'c.nml:7: &output compression = 10: must lie in 0..9')
   end subroutine domain

   subroutine no_rods(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         spacecraft//'&chain n_rods = 0, length = 1, mass_per_length = 1, bending_stiffness = 1, '//&
         'hinge_stiffness = 1 /', &
         'c.nml:2: &chain n_rods = 0: must lie in 1..1000000')
   end subroutine no_rods

   subroutine mass_domain(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         chain//'&spacecraft mass = 0 inertia = -1 /', &
         'c.nml:2: &spacecraft mass = 0: must be positive [kg]'//nl//&
         'c.nml:2: &spacecraft inertia = -1: must be positive [kg m^2]')
   end subroutine mass_domain

   subroutine all_required(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         '&chain /'//nl, &
         'c.nml:1: &chain n_rods: is required'//nl//'c.nml:1: &chain length: is required'//nl//&
         'c.nml:1: &chain mass_per_length: is required'//nl//&
         'c.nml:1: &chain hinge_stiffness: is required'//nl//&
         'c.nml:1: &spacecraft mass: is required when motion = ''free'''//nl//&
         'c.nml:1: &spacecraft inertia: is required when motion = ''free'''//nl//&
         'c.nml:1: &chain bending_stiffness: is required unless bending = ''rigid''')
   end subroutine all_required

   subroutine missing_element(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         spacecraft//'&chain n_rods = 4, mass_per_length = 1, bending_stiffness = 1, '//&
         'hinge_stiffness = 1'//nl//' length(1) = 1, length(3:4) = 2 /', &
         'c.nml:3: &chain length(2): is required, as other elements are given')
   end subroutine missing_element

   subroutine several_faults(error)
      type(error_type), allocatable, intent(out) :: error
      call expect_faults(error, &
         '&spacecraft inertia = 10, hinge_x = ''a'' /'//nl//'x'//nl//&
         '&chain n_rods = 2, length = 1, 2, 3, mass_per_length = 1'//nl//' hinge_stifness = 3 /'//nl, &
         'c.nml:1: &spacecraft hinge_x = ''a'': must be a number [m]'//nl//&
         'c.nml:1: &spacecraft mass: is required when motion = ''free'''//nl//&
         'c.nml:2: x: text outside of a group'//nl//&
         'c.nml:3: &chain length = 1, 2, 3: takes 1 or 2 values, one per rod, not 3'//nl//&
         'c.nml:3: &chain bending_stiffness: is required unless bending = ''rigid'''//nl//&
         'c.nml:4: &chain hinge_stifness: unknown key; the nearest known one is '//'hinge_stiffness')
   end subroutine several_faults


end module test_case_keys
