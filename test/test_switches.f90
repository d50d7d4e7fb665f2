!> Times at which something switches, and the laws of loads around them.
module test_switches
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type
   use rodyn_case_config, only: case_config
   use rodyn_case_reader, only: parse_case
   use rodyn_loads, only: load_regime, new_load_regime
   use rodyn_scene, only: scene_type, new_scene
   use rodyn_switch_times, only: add_switches, interval_ends, same_time
   use rodyn_text, only: word, word_count
   use rodyn_time_law, only: law_config, law_words, new_time_law, time_law, value_at
   use test_motions, only: idle_load
   use test_testing, only: unittest, new_test, check, check_close
   use test_trajectories, only: trajectory, integrate
   implicit none (type, external)
   private
   public :: collect_switches

   character(len=1), parameter :: nl = new_line('a')
   character(len=*), parameter :: base = '&case t_end = 1 /'//nl//'&spacecraft mass = 20, inertia = 5, hinge_x = 0.3 /'//nl// &
      '&chain n_rods = 2, length = 1, mass_per_length = 1, bending_stiffness = 200, hinge_stiffness = 100, '// &
      'hinge_damping = 0.5, node_mass = 0.5 /'//nl
   character(len=6), parameter :: methods(5) = [character(len=6) :: 'adams', 'bdf', 'erk', 'dop853', 'gauss']
   character(len=*), parameter :: after_0_3 = '0.30000000000000004' !! the next number

contains

   subroutine collect_switches(suite)
      type(unittest), allocatable, intent(out) :: suite(:)
      suite = [new_test('times that differ by rounding are one', test_same_time), &
               new_test('a smooth step between any two hundredths of a second has two switches', test_all_pairs), &
               new_test('switches one rounding apart give the motion of one switch, by every method', test_one_rounding), &
               new_test('a switch at the end of a run but for rounding is none', test_end_of_run), &
               new_test('switches of a user''s load are those of the scene but for rounding', test_user_switches), &
               new_test('what lasts no longer than rounding does not act, a jump does', test_short), &
               new_test('a hinge is released at a switch one rounding before its time', test_release), &
               new_test('three thousand overlapping loads are compiled and entered quickly', test_thousands), &
               new_test('a table ends at its last time unless it is held', test_after), &
               new_test('every law of forces and of motions has the derivatives of its value', test_derivatives)]
   end subroutine collect_switches

   subroutine compile(scene, loads, error)
      type(scene_type), intent(out) :: scene
      character(len=*), intent(in) :: loads !! groups beside those of the base
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      call parse_case(base//loads, 'c.nml', config, error)
      if (.not. allocated(error)) call new_scene(scene, config, error)
   end subroutine compile

   subroutine test_same_time(error)
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: switches(:)
      real(wp) :: one

      one = 1.0_wp
      call check(error, same_time(0.1_wp*(3.0_wp*one), 0.3_wp) .and. .not. same_time(1.0_wp, 1.0_wp + 1.0e-14_wp) .and. &
                 .not. same_time(0.0_wp, 1.0e-300_wp) .and. same_time(huge(one), huge(one)), 'which are one')
      if (allocated(error)) return
      switches = [0.3_wp, 0.5_wp]
      call add_switches(switches, [0.5_wp - spacing(0.5_wp), 0.2_wp, nearest(0.3_wp, 1.0_wp), 0.2_wp, 0.4_wp, &
                                   nearest(0.4_wp, -1.0_wp), 0.7_wp])
      call check_close(error, switches, [0.2_wp, 0.3_wp, nearest(0.4_wp, -1.0_wp), 0.5_wp, 0.7_wp], 0.0_wp, 'merged')
      call check_close(error, interval_ends(switches, nearest(0.5_wp, 1.0_wp)), &
                       [0.2_wp, 0.3_wp, nearest(0.4_wp, -1.0_wp), nearest(0.5_wp, 1.0_wp)], 0.0_wp, 'ends')
   end subroutine test_same_time

   !> t_start + (t_end - t_start) is not always t_end: 204 of these 5,050 runs ended there.
   subroutine test_all_pairs(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(scene_type) :: scene
      type(load_regime) :: regime
      integer :: i, j, n, k
      real(wp) :: ends(4)

      call parse_case(base//"&load law = 'smooth_step', value = 10 /", 'c.nml', config, error)
      if (allocated(error)) return
      config%t_end = 2.0_wp
      do i = 0, 99
         do j = i + 1, 100
            associate (load => config%loads(1))
               load%t_start = real(i, wp)/100
               load%t_end = real(j, wp)/100
               load%rise_time = load%t_end - load%t_start
            end associate
            call new_scene(scene, config, error)
            if (allocated(error)) return
            n = size(scene%switches)
            call check(error, n, merge(2, 1, i > 0), 'switches')
            if (allocated(error)) return
            ends(:n + 2) = [0.0_wp, scene%switches, 2.0_wp]
            do k = 1, n + 1
               call new_load_regime(regime, scene%loads, ends(k), ends(k + 1), 2)
               call check(error, size(regime%varying), merge(1, 0, k == n), 'loads that vary')
               if (allocated(error)) return
               call check_close(error, regime%constant_base(3), 0.0_wp, 0.0_wp, 'before and after')
               if (allocated(error)) return
            end do
         end do
      end do
   end subroutine test_all_pairs

   subroutine test_one_rounding(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: apart, together
      integer :: i

      do i = 1, size(methods)
         call parse_case(base//'&load t_end = '//after_0_3//', value = 10 /'//nl// &
                         '&load t_start = 0.3, t_end = 0.6, value = -10 /'//nl// &
                         "&load law = 'smooth_step', t_start = 0.06, t_end = 0.93, value = 10 /", 'c.nml', config, error)
         if (allocated(error)) return
         config%solver%method = methods(i)
         call integrate(config, [0.0_wp, 0.3_wp, 1.0_wp], apart, error)
         if (allocated(error)) return
         config%loads(1)%t_end = 0.3_wp
         config%loads(3)%rise_time = 0.0_wp
         call integrate(config, [0.0_wp, 0.3_wp, 1.0_wp], together, error)
         if (allocated(error)) return
         call check_close(error, [apart%rows(3)%phi, apart%rows(3)%omega], [together%rows(3)%phi, together%rows(3)%omega], &
                          1.0e-13_wp, trim(methods(i)))
         if (allocated(error)) return
      end do
   end subroutine test_one_rounding

   subroutine test_end_of_run(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(scene_type) :: scene
      type(trajectory) :: run
      integer :: i, off

      do off = -1, 1, 2
         do i = 1, size(methods)
            call parse_case(base//'&load t_end = 0.3, value = 10 /', 'c.nml', config, error)
            if (allocated(error)) return
            config%t_end = nearest(0.3_wp, real(off, wp))
            config%solver%method = methods(i)
            call new_scene(scene, config, error)
            if (allocated(error)) return
            call check(error, size(scene%switches), 0, 'switches')
            if (allocated(error)) return
            call integrate(config, [0.0_wp, config%t_end], run, error)
            if (allocated(error)) return
            call check(error, run%n_rows, 2, trim(methods(i))//': rows')
            if (allocated(error)) return
         end do
      end do
   end subroutine test_end_of_run

   subroutine test_user_switches(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: run
      type(idle_load) :: load

      call parse_case(base//'&load t_end = 0.3, value = 10 /', 'c.nml', config, error)
      if (allocated(error)) return
      load%switches = [nearest(0.3_wp, 1.0_wp), nearest(1.0_wp, -1.0_wp)]
      call integrate(config, [0.0_wp, 1.0_wp], run, error, load)
      if (allocated(error)) return
      call check(error, int(run%counts%n_starts), 2, 'starts')
   end subroutine test_user_switches

   subroutine test_short(error)
      type(error_type), allocatable, intent(out) :: error
      type(scene_type) :: scene
      type(load_regime) :: regime
      type(error_type), allocatable :: refusal

      call compile(scene, '&load t_start = 0.3, t_end = '//after_0_3//', value = 10 /', error)
      if (allocated(error)) return
      call new_load_regime(regime, scene%loads, 0.0_wp, 0.3_wp, 2)
      call check(error, size(scene%switches) == 1 .and. .not. regime%on_spacecraft, 'a pulse that acts before')
      if (allocated(error)) return
      call new_load_regime(regime, scene%loads, 0.3_wp, 1.0_wp, 2)
      call check(error, .not. regime%on_spacecraft, 'a pulse that acts after')
      if (allocated(error)) return
      call check_jump(after_0_3, error)
      if (.not. allocated(error)) call check_jump('0.3', error)
      if (allocated(error)) return
      call compile(scene, "&load law = 'table', times = 2*0.2, 2*0.6, values = 0, 2*5, 0 /", error) ! a pulse
      if (allocated(error)) return
      call check(error, size(scene%switches), 2, 'switches of a pulse')
      if (allocated(error)) return
      call new_load_regime(regime, scene%loads, 0.2_wp, 0.6_wp, 2)
      call check_close(error, regime%constant_base, [0.0_wp, 0.0_wp, 5.0_wp], 0.0_wp, 'within the pulse')
      if (allocated(error)) return
      call compile(scene, '&kink_program hinge = 0, t_start = 0.3, t_end = '//after_0_3//', value = 1 /', refusal)
      call check(error, refusal%message, &
                 "c.nml:4: &kink_program t_start = 0.3: must be before t_end; only law = 'ramp' may be a step", 'a smooth step')
      if (allocated(error)) return
      call compile(scene, "&kink_program hinge = 0, law = 'ramp', t_start = 0.3, t_end = "//after_0_3//', value = 1 /', refusal)
      call check(error, refusal%message, &
                 'c.nml:4: &kink_program hinge = 0: a step of the kink needs a hinge without hinge_damping', 'a ramp')
      if (allocated(error)) return
      call compile(scene, "&kink_program hinge = 0, law = 'table', times = 0, 0.3, "//after_0_3//', values = 1, 1, 2 /', refusal)
      call check(error, refusal%message, 'c.nml:4: &kink_program times = 0, 0.3, '//after_0_3//': must increase, but value 3, '// &
                 '0.300000, follows 0.300000 [s]', 'a spline')
   end subroutine test_short

   !> A table that jumps from 1 to 2 at 0.3, or at the number after it.
   subroutine check_jump(second, error)
      character(len=*), intent(in) :: second !! of the two times
      type(error_type), allocatable, intent(out) :: error
      type(scene_type) :: scene
      type(load_regime) :: regime

      call compile(scene, "&load law = 'table', times = 0, 0.3, "//second//', 1, values = 1, 1, 2, 2 /', error)
      if (allocated(error)) return
      call check(error, size(scene%switches), 1, 'switches of a table that jumps')
      if (allocated(error)) return
      call new_load_regime(regime, scene%loads, 0.0_wp, 0.3_wp, 2)
      call check_close(error, regime%constant_base, [0.0_wp, 0.0_wp, 1.0_wp], 0.0_wp, 'before the jump')
      if (allocated(error)) return
      call new_load_regime(regime, scene%loads, 0.3_wp, 1.0_wp, 2)
      call check_close(error, regime%constant_base, [0.0_wp, 0.0_wp, 2.0_wp], 0.0_wp, 'after the jump')
   end subroutine check_jump

   subroutine test_release(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: run

      call parse_case(base//'&load t_end = 0.3, value = 10 /'//nl//'&hinge hinge = 0, held = .true., release_time = '//after_0_3// &
                      ' /', 'c.nml', config, error)
      if (allocated(error)) return
      call integrate(config, [0.0_wp, 1.0_wp], run, error)
      if (allocated(error)) return
      call check(error, run%n_events, 1, 'released')
      call check_close(error, run%events(1)%time, 0.3_wp, 0.0_wp, 'when')
   end subroutine test_release

   !> Begins and ends at multiples of 0.1 as sums and products have them, each load over five others.
   subroutine test_thousands(error)
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: n = 3000
      type(case_config) :: config
      type(scene_type) :: scene
      type(load_regime) :: regime
      real(wp), allocatable :: ends(:)
      real(wp) :: impulse, before, after
      integer :: i

      call parse_case(base, 'c.nml', config, error)
      if (allocated(error)) return
      config%t_end = 400.0_wp
      deallocate (config%loads)
      allocate (config%loads(n))
      do i = 1, n
         config%loads(i)%t_start = 0.1_wp*i
         config%loads(i)%t_end = 0.1_wp*i + 0.5_wp
         config%loads(i)%value = 2.0_wp
         config%loads(i)%component = 'X'
      end do
      call cpu_time(before)
      call new_scene(scene, config, error)
      if (allocated(error)) return
      call check(error, size(scene%switches), n + 5, 'switches')
      if (allocated(error)) return
      ends = interval_ends([0.0_wp, scene%switches], config%t_end)
      impulse = 0.0_wp
      do i = 2, size(ends)
         call new_load_regime(regime, scene%loads, ends(i - 1), ends(i), 2)
         impulse = impulse + regime%constant_base(1)*(ends(i) - ends(i - 1))
      end do
      call cpu_time(after)
      call check_close(error, impulse, 2.0_wp*0.5_wp*n, 1.0e-9_wp, 'impulse')
      call check(error, after - before < 2.0_wp, 'more than two seconds')
   end subroutine test_thousands

   subroutine test_after(error)
      type(error_type), allocatable, intent(out) :: error
      character(len=*), parameter :: table = "&case t_end = 4 /"//nl//'&spacecraft mass = 1, inertia = 1 /'//nl// &
         '&chain n_rods = 1, length = 1, mass_per_length = 1, bending_stiffness = 1e3, hinge_stiffness = 1e3 /'//nl// &
         "&load component = 'X', law = 'table', "

      call momenta("times = 0, 1, values = 1, 1 /", [0.0_wp, 1.0_wp, 1.0_wp, 1.0_wp, 1.0_wp])
      if (allocated(error)) return
      call momenta("times = 0, 1, values = 1, 1, after = 'hold' /", [0.0_wp, 1.0_wp, 2.0_wp, 3.0_wp, 4.0_wp])
      if (allocated(error)) return
      call momenta("times = 0, 1, values = 1, 1, after = 'hold', t_end = 3 /", [0.0_wp, 1.0_wp, 2.0_wp, 3.0_wp, 3.0_wp])
      if (allocated(error)) return
      call momenta("times = 1, 3, values = 0, 2, t_start = 0.5, t_end = 3.5 /", [0.0_wp, 0.0_wp, 0.5_wp, 2.0_wp, 2.0_wp])
      if (allocated(error)) return
      call momenta("times = 0, 4, values = 0, 4, t_start = 1, t_end = 2 /", [0.0_wp, 0.0_wp, 1.5_wp, 1.5_wp, 1.5_wp])
      if (allocated(error)) return
      call momenta("times = 0, 1, values = 1, 1, t_start = 2, t_end = 3 /", [0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp])

   contains

      !> The chain lies along x and is pulled along x: nothing turns.
      subroutine momenta(rest, expected)
         character(len=*), intent(in) :: rest
         real(wp), intent(in) :: expected(5) !! at 0, 1, 2, 3, 4 s [N s]
         type(case_config) :: config
         type(trajectory) :: run
         call parse_case(table//rest, 'c.nml', config, error)
         if (allocated(error)) return
         call integrate(config, [0.0_wp, 1.0_wp, 2.0_wp, 3.0_wp, 4.0_wp], run, error)
         if (.not. allocated(error)) call check_close(error, run%rows%momentum_x, expected, 1.0e-9_wp, rest)
      end subroutine momenta

   end subroutine test_after

   !> Against central differences of the value alone, in the middle of a piece.
   subroutine test_derivatives(error)
      type(error_type), allocatable, intent(out) :: error
      type(law_config) :: given
      type(time_law) :: law, piece
      real(wp), parameter :: t = 0.7_wp, h = 1.0e-4_wp, tolerance = 200.0_wp*h**2 ! fourth derivatives are below 1300
      real(wp) :: before, now, after
      integer :: i, serves

      given = law_config(t_start=0.2_wp, t_end=1.9_wp, value=2.0_wp, rate=3.0_wp, rise_time=1.1_wp, &
                         times=[0.1_wp, 0.5_wp, 1.2_wp, 2.0_wp], values=[0.0_wp, 1.0_wp, 0.5_wp, 2.0_wp])
      do i = 1, word_count(law_words)
         do serves = 1, 2
            call new_time_law(law, word(law_words, i), given, of_motion=serves == 2, hold=.false.)
            call law%take_piece(t, piece)
            before = value_at(piece, t - h)
            now = value_at(piece, t)
            after = value_at(piece, t + h)
            call check_close(error, piece%motion_at(t), [now, (after - before)/(2.0_wp*h), (after - 2.0_wp*now + before)/h**2], &
                             tolerance, word(law_words, i))
            if (allocated(error)) return
         end do
      end do
   end subroutine test_derivatives

end module test_switches
