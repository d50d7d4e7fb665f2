!> Cases made in memory are refused like files, in the same words.
module test_case_check
   use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan, ieee_is_nan
   use, intrinsic :: ieee_exceptions, only: ieee_usual, ieee_set_halting_mode, ieee_get_halting_mode
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type, raise, exit_bad_input
   use rodyn_case_config, only: case_config, hinge_config, kink_config, load_config, profile_config
   use rodyn_case_check, only: sound_case
   use rodyn_case_reader, only: parse_case, resolved_case
   use rodyn_motion, only: motion_type, new_motion, initial_state
   use rodyn_scene, only: scene_type, new_scene
   use rodyn_text, only: lower, plain_text
   use test_case_support, only: nl, valid
   use test_testing, only: unittest, new_test, check, check_close
   implicit none (type, external)
   private
   public :: collect_case_check

   integer, parameter :: n_faults = 63

contains

   subroutine collect_case_check(suite)
      type(unittest), allocatable, intent(out) :: suite(:)
      suite = [new_test('a case in memory is refused in the words of a file', test_same_words), &
               new_test('arrays of a case in memory are as long as what they run over', test_lengths), &
               new_test('what a case in memory leaves out has its default', test_defaults), &
               new_test('words of a case in memory may be of any case', test_words), &
               new_test('numbers in messages have as few digits as give them back', test_plain_text), &
               new_test('later groups are told by their number', test_instances)]
   end subroutine collect_case_check

   !> Fault number k: as groups of a file, and in memory.
   subroutine make_fault(k, text, config)
      integer, intent(in) :: k
      character(len=:), allocatable, intent(out) :: text
      type(case_config), intent(inout) :: config !! that of `valid`

      text = ''
      select case (k)
      case (1)
         text = "&model bending = 'elastic' /"
         config%model%bending = 'elastic'
      case (2)
         text = "&model kernel = 'dense', formulation = '', inertia = 'x' /"
         config%model%kernel = 'dense'
         config%model%formulation = ''
         config%model%inertia = 'x'
      case (3)
         text = "&model inertia = 'lumped' /"
         config%model%inertia = 'lumped'
      case (4)
         text = "&model formulation = 'consistent', bending = 'quasistatic', dampers = 'exact' /"
         config%model%formulation = 'consistent'
         config%model%bending = 'quasistatic'
         config%model%dampers = 'exact'
      case (5)
         text = '&model bending_shapes = 4 /'
         config%model%bending_shapes = 4
      case (6)
         text = '&model bending_shapes = 3 /'
         config%model%bending_shapes = 3
      case (7)
         text = '&model gauss_points = 0, deflection_limit = -0.5 /'
         config%model%gauss_points = 0
         config%model%deflection_limit = -0.5_wp
      case (8)
         text = '&model gauss_points = 1 /'
         config%model%gauss_points = 1
      case (9)
         text = '&case t_end = 0, n_outputs = 0 /'
         config%t_end = 0.0_wp
         config%n_outputs = 0
      case (10)
         text = "&model bending = 'rigid' /"//nl//'&initial alpha = 0.25, beta_rate = 0.5 /'
         config%model%bending = 'rigid'
         config%initial%alpha(:) = 0.25_wp
         config%initial%beta_rate(:) = 0.5_wp
      case (11)
         text = '&initial bubble = 0.01 /'
         config%initial%bubble(:) = 0.01_wp
      case (12)
         text = '&load value = 1, node = 2 /'
         call add_load()
         config%loads(1)%node = 2
      case (13)
         text = "&load target = 'node', component = 'X', value = 1, node = 99 /"
         call add_load()
         config%loads(1)%target = 'node'
         config%loads(1)%component = 'X'
         config%loads(1)%node = 99
      case (14)
         text = "&load target = 'node', component = 'X', value = 1 /"
         call add_load()
         config%loads(1)%target = 'node'
         config%loads(1)%component = 'X'
      case (15)
         text = "&load target = 'node', component = 'X', value = 1, node = -1 /"
         call add_load()
         config%loads(1)%target = 'node'
         config%loads(1)%component = 'X'
         config%loads(1)%node = -1
      case (16)
         text = "&load component = 'Z', law = 'step', target = 'rod', value = 1 /"
         call add_load()
         config%loads(1)%component = 'Z'
         config%loads(1)%law = 'step'
         config%loads(1)%target = 'rod'
      case (17)
         text = "&load target = 'node', node = 1, value = 1 /"
         call add_load()
         config%loads(1)%target = 'node'
         config%loads(1)%node = 1
      case (18)
         text = '&load value = 1, t_start = 3, t_end = 2 /'
         call add_load()
         config%loads(1)%t_start = 3.0_wp
         config%loads(1)%t_end = 2.0_wp
      case (19)
         text = '&load value = 1, t_end = -1 /'
         call add_load()
         config%loads(1)%t_end = -1.0_wp
      case (20)
         text = "&load value = 1, rate = 2, after = 'hold' /"
         call add_load()
         config%loads(1)%rate = 2.0_wp
         config%loads(1)%after = 'hold'
      case (21)
         text = "&load law = 'table', times = 0, 1, values = 1, 2, value = 3, rise_time = 1 /"
         call add_load()
         config%loads(1)%law = 'table'
         config%loads(1)%times = [0.0_wp, 1.0_wp]
         config%loads(1)%values = [1.0_wp, 2.0_wp]
         config%loads(1)%value = 3.0_wp
         config%loads(1)%rise_time = 1.0_wp
      case (22)
         text = "&load law = 'table', times = 0, 3*2, values = 2*1 /"
         call add_load()
         config%loads(1)%law = 'table'
         config%loads(1)%value = 0.0_wp
         config%loads(1)%times = [0.0_wp, 2.0_wp, 2.0_wp, 2.0_wp]
         config%loads(1)%values = [1.0_wp, 1.0_wp]
      case (23)
         text = "&load law = 'table' /"
         call add_load()
         config%loads(1)%law = 'table'
         config%loads(1)%value = 0.0_wp
      case (24)
         text = "&load law = 'table', times = 0, values = 1 /"
         call add_load()
         config%loads(1)%law = 'table'
         config%loads(1)%value = 0.0_wp
         config%loads(1)%times = [0.0_wp]
         config%loads(1)%values = [1.0_wp]
      case (25)
         text = "&load law = 'smooth_step', value = 1, rise_time = 3 /"
         call add_load()
         config%loads(1)%law = 'smooth_step'
         config%loads(1)%rise_time = 3.0_wp
      case (26)
         text = "&load law = 'smooth_step', value = 1, t_start = 1, t_end = 1 /"
         call add_load()
         config%loads(1)%law = 'smooth_step'
         config%loads(1)%t_start = 1.0_wp
         config%loads(1)%t_end = 1.0_wp
      case (27)
         text = "&load law = 'table', times = 0, 1, values = 1, 2, after = 'stay' /"
         call add_load()
         config%loads(1)%law = 'table'
         config%loads(1)%value = 0.0_wp
         config%loads(1)%times = [0.0_wp, 1.0_wp]
         config%loads(1)%values = [1.0_wp, 2.0_wp]
         config%loads(1)%after = 'stay'
      case (28)
         text = '&kink_program hinge = 4, value = 1 /'
         call add_program()
         config%kink_programs(1)%hinge = 4
      case (29)
         text = '&kink_program hinge = -1, value = 1 /'
         call add_program()
         config%kink_programs(1)%hinge = -1
      case (30)
         text = "&kink_program hinge = 0, law = 'swing', value = 1 /"
         call add_program()
         config%kink_programs(1)%law = 'swing'
      case (31)
         text = '&kink_program hinge = 1, value = 1, t_start = 1, t_end = 1 /'
         call add_program()
         config%kink_programs(1)%hinge = 1
         config%kink_programs(1)%t_start = 1.0_wp
         config%kink_programs(1)%t_end = 1.0_wp
      case (32)
         text = "&kink_program hinge = 0, law = 'table', value = 1, times = 0, 0.5, 0.25, values = 1, 2 /"
         call add_program()
         config%kink_programs(1)%law = 'table'
         config%kink_programs(1)%times = [0.0_wp, 0.5_wp, 0.25_wp]
         config%kink_programs(1)%values = [1.0_wp, 2.0_wp]
      case (33)
         text = "&kink_program hinge = 2, law = 'ramp', value = 1 /"//nl//'&hinge hinge = 2, held = .true. /'
         call add_program()
         call add_hinge()
         config%kink_programs(1)%hinge = 2
         config%kink_programs(1)%law = 'ramp'
         config%hinges(1)%hinge = 2
         config%hinges(1)%held = .true.
      case (34)
         text = "&kink_program hinge = 0, law = 'ramp', value = 1, t_start = 0.5, t_end = 0.5 /"//nl// &
                '&hinge hinge = 0, lower_stop = -1, stop_stiffness = 1, stop_damping = 1 /'
         call add_program()
         call add_hinge()
         config%kink_programs(1)%law = 'ramp'
         config%kink_programs(1)%t_start = 0.5_wp
         config%kink_programs(1)%t_end = 0.5_wp
         config%hinges(1)%lower_stop = -1.0_wp
         config%hinges(1)%stop_stiffness = 1.0_wp
         config%hinges(1)%stop_damping = 1.0_wp
      case (35)
         text = '&hinge hinge = 0, release_time = 1 /'
         call add_hinge()
         config%hinges(1)%release_time = 1.0_wp
      case (36)
         text = '&hinge hinge = 0, held = .true., release_after = 3 /'
         call add_hinge()
         config%hinges(1)%held = .true.
         config%hinges(1)%release_after = 3
      case (37)
         text = '&hinge hinge = 1, lower_stop = 0.1, upper_stop = -0.1 /'
         call add_hinge()
         config%hinges(1)%hinge = 1
         config%hinges(1)%lower_stop = 0.1_wp
         config%hinges(1)%upper_stop = -0.1_wp
      case (38)
         text = '&hinge hinge = 2, friction_moment = 1 /'
         call add_hinge()
         config%hinges(1)%hinge = 2
         config%hinges(1)%friction_moment = 1.0_wp
      case (39)
         text = '&hinge hinge = 3, lock_damping = 1, freeplay_stiffness = 1 /'
         call add_hinge()
         config%hinges(1)%hinge = 3
         config%hinges(1)%lock_damping = 1.0_wp
         config%hinges(1)%freeplay_stiffness = 1.0_wp
      case (40)
         text = '&hinge hinge = 9, upper_stop = 2000, stop_stiffness = 1 /'
         call add_hinge()
         config%hinges(1)%hinge = 9
         config%hinges(1)%upper_stop = 2000.0_wp
         config%hinges(1)%stop_stiffness = 1.0_wp
      case (41)
         text = '&hinge hinge = 0, held = .true., release_time = -1 /'
         call add_hinge()
         config%hinges(1)%held = .true.
         config%hinges(1)%release_time = -1.0_wp
      case (42)
         text = "&solver method = 'rk4' /"
         config%solver%method = 'rk4'
      case (43)
         text = '&solver order = 5 /'
         config%solver%order = 5
      case (44)
         text = "&solver method = 'adams', fixed_step = 0.1 /"
         config%solver%method = 'adams'
         config%solver%fixed_step = 0.1_wp
      case (45)
         text = '&solver rtol = 1, atol = 0, max_step = -1, max_steps = 0, max_events = 0 /'
         config%solver%rtol = 1.0_wp
         config%solver%atol = 0.0_wp
         config%solver%max_step = -1.0_wp
         config%solver%max_steps = 0
         config%solver%max_events = 0
      case (46)
         text = '&output compression = 10 /'
         config%output%compression = 10
      case (47)
         text = "&rod_profile quantity = 'mass', polynomial = 1 /"
         call add_profile()
         config%profiles(1)%quantity = 'mass'
      case (48)
         text = "&rod_profile quantity = 'mass_per_length', polynomial = 1, last_rod = 5 /"
         call add_profile()
         config%profiles(1)%last_rod = 5
      case (49)
         text = "&rod_profile quantity = 'mass_per_length', polynomial = 1, first_rod = 3, last_rod = 2 /"
         call add_profile()
         config%profiles(1)%first_rod = 3
         config%profiles(1)%last_rod = 2
      case (50)
         text = "&rod_profile quantity = 'mass_per_length', polynomial = 1, -2 /"
         call add_profile()
         config%profiles(1)%polynomial = [1.0_wp, -2.0_wp]
      case (51)
         text = "&rod_profile quantity = 'mass_per_length', positions = 0, 0.5, values = 3*1 /"
         call add_profile()
         deallocate (config%profiles(1)%polynomial)
         config%profiles(1)%positions = [0.0_wp, 0.5_wp]
         config%profiles(1)%values = [1.0_wp, 1.0_wp, 1.0_wp]
      case (52)
         text = "&rod_profile quantity = 'mass_per_length' /"
         call add_profile()
         deallocate (config%profiles(1)%polynomial)
      case (53)
         text = "&hinge hinge = 0, friction_velocity = 0.5 /"
         call add_hinge()
         config%hinges(1)%friction_velocity = 0.5_wp
      case (54)
         text = "&hinge hinge = 0, stop_damping = 1, latch_angle = -1000 /"
         call add_hinge()
         config%hinges(1)%stop_damping = 1.0_wp
         config%hinges(1)%latch_angle = -1000.0_wp
      case (55)
         text = '&initial phi(2) = nan /'
         config%initial%phi(2) = ieee_value(1.0_wp, ieee_quiet_nan)
      case (56)
         text = '&solver fixed_step = 1e-12, method = ''erk'' /'
         config%solver%method = 'erk'
         config%solver%fixed_step = 1.0e-12_wp
      case (57) ! what follows from a fault is none of its own
         text = '&case t_end = -1 / &load value = 1 /'
         config%t_end = -1.0_wp
         call add_load()
      case (58)
         text = "&case t_end = -1 / &load law = 'smooth_step', value = 1 /"
         config%t_end = -1.0_wp
         call add_load()
         config%loads(1)%law = 'smooth_step'
      case (59)
         text = '&case t_end = -1 / &kink_program hinge = 0, value = 1 /'
         config%t_end = -1.0_wp
         call add_program()
      case (60)
         text = '&case t_end = -1 / &kink_program hinge = 0, value = 1, t_start = 2 /'
         config%t_end = -1.0_wp
         call add_program()
         config%kink_programs(1)%t_start = 2.0_wp
      case (61)
         text = "&case t_end = 0.5 / &load value = 1, law = 'smooth_step', rise_time = 3 / &load value = 1, t_start = 2 /"
         config%t_end = 0.5_wp
         call add_load()
         config%loads = [config%loads, config%loads]
         config%loads(1)%law = 'smooth_step'
         config%loads(1)%rise_time = 3.0_wp
         config%loads(2)%t_start = 2.0_wp
      case (62)
         text = "&case t_end = -1 / &solver method = 'erk', fixed_step = 1e-12 /"
         config%t_end = -1.0_wp
         config%solver%method = 'erk'
         config%solver%fixed_step = 1.0e-12_wp
      case (63)
         text = '&initial alpha = 10, beta = -10 /'
         config%initial%alpha(:) = 10.0_wp
         config%initial%beta(:) = -10.0_wp
      case default ! there is no other
      end select

   contains

      subroutine add_load()
         type(load_config) :: load
         load%value = 1.0_wp
         config%loads = [load]
      end subroutine add_load

      subroutine add_program()
         type(kink_config) :: program
         program%value = 1.0_wp
         config%kink_programs = [program]
      end subroutine add_program

      subroutine add_hinge()
         type(hinge_config) :: hinge
         config%hinges = [hinge]
      end subroutine add_hinge

      subroutine add_profile()
         type(profile_config) :: profile
         profile%polynomial = [1.0_wp]
         config%profiles = [profile]
      end subroutine add_profile

   end subroutine make_fault

   subroutine test_same_words(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: of_file, of_case
      type(case_config) :: config, unused
      type(scene_type) :: scene
      character(len=:), allocatable :: text
      logical :: halting(size(ieee_usual))
      integer :: k

      do k = 1, n_faults
         call parse_case(valid, 'c.nml', config, error)
         if (allocated(error)) return
         call make_fault(k, text, config)
         call parse_case(valid//text, 'c.nml', unused, of_file)
         if (.not. allocated(of_file)) call raise(error, 'no fault of a file: '//text)
         call ieee_get_halting_mode(ieee_usual, halting) ! a number that is none halts the debug build
         call ieee_set_halting_mode(ieee_usual, .false.)
         call new_scene(scene, config, of_case)
         call ieee_set_halting_mode(ieee_usual, halting)
         if (.not. allocated(of_case)) call raise(error, 'no fault in memory: '//text)
         if (allocated(error)) return
         if (k == 55) of_case%message = lower(of_case%message)
         call check(error, sorted_words(of_case%message, .false.), sorted_words(of_file%message, .true.), text)
         if (.not. allocated(error)) call check(error, of_case%exit_code, exit_bad_input, 'exit code')
         if (allocated(error)) return
      end do
   end subroutine test_same_words

   !> The lines of a message in the order of the alphabet, without file and line: a case in memory has no lines to sort by.
   function sorted_words(message, in_file) result(text)
      character(len=*), intent(in) :: message
      logical, intent(in) :: in_file
      character(len=:), allocatable :: text
      character(len=300) :: lines(20), line
      integer :: first, last, n, i, j

      n = 0
      first = 1
      do while (first <= len(message))
         last = index(message(first:), nl) + first - 2
         if (last < first) last = len(message)
         n = n + 1
         line = message(first:last)
         if (in_file) line = line(index(line, '&'):)
         do i = n - 1, 1, -1
            if (lines(i) <= line) exit
            lines(i + 1) = lines(i)
         end do
         lines(i + 1) = line
         first = last + 2
      end do
      text = ''
      do j = 1, n
         text = text//trim(lines(j))//nl
      end do
   end function sorted_words

   subroutine test_lengths(error)
      type(error_type), allocatable, intent(out) :: error

      call refused(1, '&chain length = 2*1.5: takes 1 or 4 values, one per rod, not 2')
      if (.not. allocated(error)) call refused(2, '&chain length = 1.5: must be allocated to 4 values')
      if (.not. allocated(error)) call refused(3, '&chain length: is required')
      if (.not. allocated(error)) call refused(4, '&initial phi_rate = 5*1: takes 1 or 4 values, one per rod, not 5')
      if (.not. allocated(error)) call refused(5, '&chain hinge_damping(3) = -1: must not be negative [N m s/rad]')
      if (.not. allocated(error)) call refused(6, '&chain n_rods = -3: must lie in 1..1000000')
      if (.not. allocated(error)) call refused(7, "&chain bending_stiffness: is required unless bending = 'rigid'")
      if (.not. allocated(error)) call refused(8, "&spacecraft mass: is required when motion = 'free'")
      if (.not. allocated(error)) call refused(9, "&spacecraft motion = 'FIX': must be 'free' or 'fixed'")
      if (.not. allocated(error)) call refused(10, "&spacecraft inertia = -2: must be positive [kg m^2]")

   contains

      subroutine refused(k, message)
         integer, intent(in) :: k
         character(len=*), intent(in) :: message
         type(case_config) :: config
         type(scene_type) :: scene
         type(error_type), allocatable :: refusal

         call parse_case(valid, 'c.nml', config, error)
         if (allocated(error)) return
         select case (k)
         case (1)
            config%chain%length = [1.5_wp, 1.5_wp]
         case (2)
            config%chain%length = [1.5_wp]
         case (3)
            deallocate (config%chain%length)
         case (4)
            config%initial%phi_rate = spread(1.0_wp, 1, 5)
         case (5)
            config%chain%hinge_damping(3) = -1.0_wp
         case (6)
            config%chain%n_rods = -3
         case (7)
            deallocate (config%chain%bending_stiffness)
         case (8)
            config%spacecraft%mass = 0.0_wp
         case (9)
            config%spacecraft%motion = 'FIX'
         case (10)
            config%spacecraft%inertia = -2.0_wp
         case default ! there is no other
         end select
         call new_scene(scene, config, refusal)
         call check(error, allocated(refusal), 'accepted instead of '//message)
         if (.not. allocated(error)) call check(error, refusal%message, message, 'message')
      end subroutine refused

   end subroutine test_lengths

   !> Nothing but what a file must give; hinges counted from 1 by an array constructor.
   subroutine test_defaults(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config, given, resolved
      type(scene_type) :: scene, expected
      type(motion_type) :: motion
      real(wp), allocatable :: y(:)

      config%spacecraft%mass = 100.0_wp
      config%spacecraft%inertia = 10.0_wp
      config%chain%n_rods = 2
      config%chain%length = [1.5_wp, 1.0_wp]
      config%chain%mass_per_length = [1.0_wp, 1.0_wp]
      config%chain%bending_stiffness = [1.0e4_wp, 1.0e4_wp]
      config%chain%hinge_stiffness = [1.0_wp, 2.0_wp]
      allocate (config%loads(1))
      config%loads(1)%law = 'smooth_step'
      config%loads(1)%value = 1.0_wp
      call new_scene(scene, config, error)
      if (.not. allocated(error)) call sound_case(config, resolved, error)
      if (allocated(error)) return
      call parse_case('&spacecraft mass = 100, inertia = 10 / &chain n_rods = 2, length = 1.5, 1, mass_per_length = 1,'// &
                      "bending_stiffness = 1e4, hinge_stiffness = 1, 2 / &load law = 'smooth_step', value = 1 /", 'c.nml', given, &
                      error)
      if (.not. allocated(error)) call new_scene(expected, given, error)
      if (allocated(error)) return
      call check_close(error, [scene%node_mass, scene%hinges%stiffness, scene%hinges%damping, scene%loads%loads%law%span], &
                       [expected%node_mass, expected%hinges%stiffness, expected%hinges%damping, expected%loads%loads%law%span], &
                       0.0_wp, 'scene')
      if (.not. allocated(error)) call check(error, resolved_case(resolved), resolved_case(given), 'values used')
      if (allocated(error)) return
      call new_motion(motion, scene, .false., error)
      if (allocated(error)) return
      call initial_state(motion, config%initial, y)
      call check_close(error, y, spread(0.0_wp, 1, size(y)), 0.0_wp, 'initial state')
      if (allocated(error)) return
      config%initial%phi = [1.0_wp, 1.0_wp, 1.0_wp]
      call initial_state(motion, config%initial, y)
      call check(error, all(ieee_is_nan(y)), 'a state of three angles for two rods')
   end subroutine test_defaults

   !> As a file's: they are read with the spelling of the table, also where other keys depend on them.
   subroutine test_words(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config, of_file, resolved
      type(scene_type) :: scene

      call parse_case(valid, 'c.nml', config, error)
      if (.not. allocated(error)) call parse_case(valid// &
         "&model bending = 'rigid', kernel = 'assembled' / &solver method = 'dop853' /"// &
         "&load law = 'table', target = 'node', node = 2, component = 'X', times = 0, 0.5, 0.5, 1, values = 1, 1, 2, 2,"// &
         "after = 'hold' / &kink_program hinge = 1, law = 'sine', value = 1, rate = 2 /", 'c.nml', of_file, error)
      if (allocated(error)) return
      config%model%bending = 'Rigid'
      config%model%kernel = 'ASSEMBLED'
      config%solver%method = 'DOP853'
      deallocate (config%loads, config%kink_programs)
      allocate (config%loads(1), config%kink_programs(1))
      associate (load => config%loads(1), program => config%kink_programs(1))
         load%law = 'Table'
         load%target = 'Node'
         load%node = 2
         load%component = 'x'
         load%times = [0.0_wp, 0.5_wp, 0.5_wp, 1.0_wp]
         load%values = [1.0_wp, 1.0_wp, 2.0_wp, 2.0_wp]
         load%after = 'HOLD'
         program%hinge = 1
         program%law = 'Sine'
         program%value = 1.0_wp
         program%rate = 2.0_wp
      end associate
      call new_scene(scene, config, error)
      if (.not. allocated(error)) call sound_case(config, resolved, error)
      if (.not. allocated(error)) call check(error, resolved_case(resolved), resolved_case(of_file), 'values used')
   end subroutine test_words

   subroutine test_plain_text(error)
      type(error_type), allocatable, intent(out) :: error
      call check(error, plain_text(-1.5_wp)//' '//plain_text(4000.0_wp)//' '//plain_text(0.3_wp)//' '//plain_text(0.0_wp)//' '// &
                 plain_text(1.0e-12_wp)//' '//plain_text(-2.5e100_wp)//' '//plain_text(0.0025_wp)//' '//plain_text(123.0_wp), &
                 '-1.5 4000 0.3 0 1e-12 -2.5e100 0.0025 123', 'numbers')
   end subroutine test_plain_text

   subroutine test_instances(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(scene_type) :: scene
      type(error_type), allocatable :: refusal

      call parse_case(valid//'&load value = 1 / &load value = 2 /', 'c.nml', config, error)
      if (allocated(error)) return
      config%loads(2)%node = 3
      config%loads(1)%law = 'step'
      call new_scene(scene, config, refusal)
      call check(error, refusal%message, "&load law = 'step': must be 'constant', 'table', 'sine_squared', 'smooth_step', "// &
                 "'ramp' or 'sine'"//nl// &
                 "&load(2) node = 3: applies only with target = 'node'", 'message')
   end subroutine test_instances

end module test_case_check
