!> Moving scenes: driven kinks, hinge laws, events, locks.
module test_moving
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type
   use rodyn_case_config, only: none_given, case_config, hinge_config, kink_config, load_config
   use rodyn_kink_program, only: kink_set, kink_regime, new_kink_set, new_kink_regime, evaluate_kinks
   use rodyn_hinge_mechanism, only: kind_latched
   use rodyn_scene, only: scene_type, new_scene
   use rodyn_text, only: to_text
   use rodyn_motion, only: motion_type, new_motion, initial_state
   use rodyn_user_load, only: user_load
   use test_motions, only: check_jacobian
   use test_random_scenes, only: allocate_case, random_case, seed_random, kind_name, n_kinds
   use test_testing, only: unittest, new_test, check, check_close
   use test_trajectories, only: trajectory, integrate
   implicit none (type, external)
   private
   public :: collect_moving

   !> What five `&load` groups of a random case do, written as a user would.
   type, extends(user_load) :: written_loads
      type(load_config), allocatable :: loads(:)
   contains
      procedure :: add_forces => add_written
   end type written_loads

   !> A spring and damper that hold the spacecraft's attitude.
   type, extends(user_load) :: attitude_spring
      real(wp) :: stiffness = 0.0_wp, damping = 0.0_wp
   contains
      procedure :: add_forces => add_spring
   end type attitude_spring

contains

   subroutine collect_moving(suite)
      type(unittest), allocatable, intent(out) :: suite(:)
      suite = [new_test('rates of kink programs equal central differences of their values', test_program_rates), &
               new_test('a table of a cubic polynomial at rest at its ends is that polynomial', test_spline), &
               new_test('a driven kink moves the chain as moving loads of its hinge would', test_drive_energy), &
               new_test('power of drives balances energy in every kind of scene', test_drive_power), &
               new_test('a very stiff driven hinge follows its kink', test_stiff_drive), &
               new_test('a step of the kink works on the spring, and every method restarts there', test_kink_step), &
               new_test('scenes whose hinges never change watch no events', test_nothing_to_watch), &
               new_test('a rod between two stops bounces as the closed form says', test_bounce), &
               new_test('a stop that is only grazed is seen, however short the touch', test_graze), &
               new_test('a damped stop pushes but never pulls', test_damped_stop), &
               new_test('a damped stop that is left is not met again at once, by any method', test_left_stop), &
               new_test('freeplay follows its closed form', test_freeplay), &
               new_test('dry friction stops a rod after F-limited decay', test_friction), &
               new_test('adams, bdf, erk and dop853 find the same events', test_methods_agree), &
               new_test('energy balances through events in every kind of scene', test_energy_everywhere), &
               new_test('Jacobian equals central differences beside stops and friction', test_jacobian), &
               new_test('curved laws have their tangents where the joints of the state are', test_tangents), &
               new_test('events without end are refused', test_chatter), &
               new_test('collocation refuses events', test_gauss_refuses), &
               new_test('collocation takes hinges that are prestressed, held and released at a time', test_gauss_takes), &
               new_test('two rigid rods that latch keep momentum and lose what the closed form says', test_latch_impulse), &
               new_test('a hold released at t0 goes on as a run that starts there', test_release), &
               new_test('a held chain is one rigid body', test_held_body), &
               new_test('a lock is the limit of a stiff spring', test_stiff_lock), &
               new_test('locks beside exact dampers are limits of stiff springs, and of weak dampers', test_exact_locks), &
               new_test('hinges deploy one after the other, in every kind of scene, and energy balances', test_sequence), &
               new_test('loads written by a user do what the same loads of a case do, by every method', test_written_loads), &
               new_test('feedback of a user holds the attitude as its closed form says', test_feedback), &
               new_test('a driven hinge that is held moves as its kink says, and its work balances', test_held_drive)]
   end subroutine collect_moving

   !> One rigid rod of inertia m l^2/3 = 1 on a fixed spacecraft, spring C and damper D.
   subroutine one_rod(config, stiffness, damping)
      type(case_config), intent(out) :: config
      real(wp), intent(in) :: stiffness, damping
      call allocate_case(config, 1)
      config%spacecraft%motion = 'fixed'
      config%model%bending = 'rigid'
      config%chain%length = 1.0_wp
      config%chain%mass_per_length = 3.0_wp
      config%chain%bending_stiffness = 1.0_wp
      config%chain%hinge_stiffness = stiffness
      config%chain%hinge_damping = damping
      config%solver%rtol = 1.0e-11_wp
      config%solver%atol = 1.0e-13_wp
      allocate (config%hinges(0), config%kink_programs(0))
   end subroutine one_rod

   !> phi_1 in all rows.
   function angles_of(run) result(angles)
      type(trajectory), intent(in) :: run
      real(wp) :: angles(run%n_rows)
      integer :: i
      angles = [(run%rows(i)%phi(1), i=1, run%n_rows)]
   end function angles_of

   !> phi_1' in all rows.
   function rates_of(run) result(rates)
      type(trajectory), intent(in) :: run
      real(wp) :: rates(run%n_rows)
      integer :: i
      rates = [(run%rows(i)%phi_rate(1), i=1, run%n_rows)]
   end function rates_of

   !> Four programs, one of each law.
   function four_programs() result(programs)
      type(kink_config), allocatable :: programs(:)
      allocate (programs(4))
      programs(:3)%t_start = 0.1_wp
      programs(:3)%t_end = 0.9_wp
      programs(:3)%value = 0.3_wp
      programs(3)%rate = 7.0_wp
      programs(1)%law = 'ramp'
      programs(2)%law = 'smooth_step'
      programs(3)%law = 'sine'
      programs(4)%law = 'table'
      programs(4)%times = [0.05_wp, 0.2_wp, 0.5_wp, 0.6_wp, 0.95_wp]
      programs(4)%values = [0.0_wp, 0.3_wp, -0.1_wp, 0.2_wp, 0.4_wp]
      programs%hinge = [0, 1, 2, 3]
   end function four_programs

   subroutine test_program_rates(error)
      type(error_type), allocatable, intent(out) :: error
      type(kink_set) :: set
      type(kink_regime) :: regime
      real(wp), dimension(0:3) :: kink, rate, acceleration, plus, minus, rate_plus, rate_minus, unused
      real(wp), parameter :: h = 1.0e-5_wp
      real(wp) :: edges(8)
      integer :: i

      call new_kink_set(set, spread(0.0_wp, 1, 4), four_programs())
      edges = [0.0_wp, 0.05_wp, 0.1_wp, 0.2_wp, 0.5_wp, 0.6_wp, 0.9_wp, 0.95_wp]
      do i = 1, 7
         call new_kink_regime(regime, set, edges(i), edges(i + 1))
         associate (t => 0.4_wp*edges(i) + 0.6_wp*edges(i + 1))
            call evaluate_kinks(regime, t, kink, rate, acceleration)
            call evaluate_kinks(regime, t + h, plus, rate_plus, unused)
            call evaluate_kinks(regime, t - h, minus, rate_minus, unused)
            ! Third derivatives reach 2000 in the table: h^2/6 of them, and rounding 1e-16/h.
            call check_close(error, rate, (plus - minus)/(2.0_wp*h), 5.0e-8_wp, 'rate')
            call check_close(error, acceleration, (rate_plus - rate_minus)/(2.0_wp*h), 1.0e-7_wp, 'acceleration')
            if (allocated(error)) return
         end associate
         ! The end of a regime is the start of the next one.
         call evaluate_kinks(regime, edges(i + 1), plus, rate_plus, unused)
         if (i == 7) exit
         call new_kink_regime(regime, set, edges(i + 1), edges(i + 2))
         call evaluate_kinks(regime, edges(i + 1), minus, rate_minus, unused)
         call check_close(error, plus, minus, 1.0e-14_wp, 'value at a switch')
         call check_close(error, rate_plus(3), rate_minus(3), 1.0e-13_wp, 'rate of the table at a knot')
         if (allocated(error)) return
      end do
   end subroutine test_program_rates

   !> 3 x^2 - 2 x^3 is at rest at 0 and 1, and cubic: its spline through any knots is itself.
   subroutine test_spline(error)
      type(error_type), allocatable, intent(out) :: error
      type(kink_config) :: program
      type(kink_set) :: set
      type(kink_regime) :: regime
      real(wp), dimension(0:0) :: kink, rate, acceleration
      real(wp) :: t
      integer :: i

      program%law = 'table'
      program%times = [0.0_wp, 0.15_wp, 0.5_wp, 0.7_wp, 1.0_wp]
      program%values = 3.0_wp*program%times**2 - 2.0_wp*program%times**3
      call new_kink_set(set, [0.0_wp], [program])
      do i = 1, 20
         t = real(i, wp)/21.0_wp
         call new_kink_regime(regime, set, t - 1.0e-3_wp, t + 1.0e-3_wp)
         call evaluate_kinks(regime, t, kink, rate, acceleration)
         call check_close(error, [kink, rate, acceleration], &
                          [3.0_wp*t**2 - 2.0_wp*t**3, 6.0_wp*(t - t**2), 6.0_wp - 12.0_wp*t], 1.0e-13_wp, 'spline')
         if (allocated(error)) return
      end do
   end subroutine test_spline

   !> Second route for one rigid rod: phi'' = -C (phi - gamma) - D (phi' - gamma'), gamma = a sin(w t), from rest. Its steady
   !> part is the real part of a complex amplitude, the transient decays from what is left.
   subroutine test_drive_energy(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(kink_config) :: program
      type(trajectory) :: run
      complex(wp) :: steady, root, homogeneous
      real(wp), parameter :: c = 30.0_wp, d = 0.7_wp, a = 0.2_wp, w = 4.0_wp, t = 2.0_wp
      character(len=6), parameter :: methods(5) = [character(len=6) :: 'dop853', 'adams', 'bdf', 'erk', 'gauss']
      real(wp) :: phi, damped
      integer :: i

      call one_rod(config, c, d)
      program%law = 'sine'
      program%value = a
      program%rate = w
      program%t_end = 10.0_wp
      deallocate (config%kink_programs)
      allocate (config%kink_programs(1))
      config%kink_programs(1) = program
      config%t_end = 10.0_wp
      steady = a*cmplx(c, d*w, wp)/cmplx(c - w**2, d*w, wp) ! of exp(i w t); the imaginary part is the motion
      damped = sqrt(c - 0.25_wp*d**2)
      root = cmplx(-0.5_wp*d, damped, wp)
      ! Real homogeneous part: x e^{-d t/2} cos + y e^{-d t/2} sin with phi(0) = phi'(0) = 0.
      homogeneous = cmplx(-aimag(steady), (-w*real(steady) - 0.5_wp*d*aimag(steady))/damped, wp)
      phi = aimag(steady*exp(cmplx(0.0_wp, w*t, wp))) + &
            exp(real(root)*t)*(real(homogeneous)*cos(damped*t) + aimag(homogeneous)*sin(damped*t))
      do i = 1, size(methods)
         config%solver%method = methods(i)
         call integrate(config, [0.0_wp, 1.0_wp, t], run, error)
         if (allocated(error)) return
         call check_close(error, run%rows(3)%phi(1), phi, merge(1.0e-8_wp, 1.0e-10_wp, i == 2 .or. i == 3), trim(methods(i)))
         call check_close(error, run%rows(3)%energy_residual, 0.0_wp, merge(1.0e-8_wp, 1.0e-10_wp, i == 2 .or. i == 3), &
                          trim(methods(i))//': residual')
         if (allocated(error)) return
      end do
   end subroutine test_drive_energy

   !> A random scene of a kind, its kinks driven.
   subroutine driven_case(config, which, n)
      type(case_config), intent(out) :: config
      integer, intent(in) :: which, n
      type(kink_config), allocatable :: programs(:)
      integer :: i

      call random_case(config, which, n)
      programs = four_programs()
      allocate (config%kink_programs(4))
      do i = 1, 4
         config%kink_programs(i) = programs(i)
         config%kink_programs(i)%hinge = mod(i, n)
      end do
      config%chain%hinge_damping = config%chain%hinge_damping + 0.1_wp
   end subroutine driven_case

   !> d(kinetic + elastic)/dt along the motion, by central differences, equals power of loads and drives - dissipated power;
   !> recursive and assembled kernels agree; so do lanes.
   subroutine test_drive_power(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: run
      real(wp) :: scale
      integer :: which, n

      call seed_random(11)
      do which = 1, n_kinds
         if (index(kind_name(which), 'paper distributed dynamic') > 0) cycle
         do n = 1, 3
            call driven_case(config, which, n)
            config%chain%bending_stiffness = 300.0_wp
            config%solver%rtol = 1.0e-11_wp
            config%solver%atol = 1.0e-12_wp
            call integrate(config, [0.0_wp, 0.3_wp, 0.7_wp, 1.0_wp], run, error)
            if (allocated(error)) return
            scale = maxval(run%rows%energy_kinetic + run%rows%energy_elastic) + maxval(abs(run%rows%work_external))
            call check_close(error, run%rows%energy_residual/scale, spread(0.0_wp, 1, 4), 1.0e-9_wp, kind_name(which))
            if (allocated(error)) return
         end do
      end do
   end subroutine test_drive_power

   !> As C grows the opening becomes gamma: the difference falls as 1/C.
   subroutine test_stiff_drive(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: run
      real(wp) :: miss(2)
      integer :: i

      do i = 1, 2
         call one_rod(config, 10.0_wp**(2*i + 2), 0.0_wp)
         deallocate (config%kink_programs)
         allocate (config%kink_programs(1))
         config%kink_programs(1)%law = 'smooth_step'
         config%kink_programs(1)%value = 0.5_wp
         config%kink_programs(1)%t_start = 0.0_wp
         config%kink_programs(1)%t_end = 1.0_wp
         config%t_end = 1.0_wp
         call integrate(config, [0.0_wp, 0.25_wp], run, error)
         if (allocated(error)) return
         associate (s => 0.25_wp) ! gamma'' of a unit step; phi - gamma is about -gamma''/C
            miss(i) = (run%rows(2)%phi(1) - 0.5_wp*s**3*(10.0_wp - s*(15.0_wp - 6.0_wp*s)))*10.0_wp**(2*i + 2) &
                      /(0.5_wp*60.0_wp*s*(1.0_wp - s)*(1.0_wp - 2.0_wp*s))
         end associate
      end do
      ! The oscillation excited by the jerk of 30 rad/s^3 at the start adds jerk/(w gamma'') = 30/(w 2.8).
      call check_close(error, miss, [-1.0_wp, -1.0_wp], 0.12_wp, 'spring under the load of inertia')
      call check(error, abs(miss(2) + 1.0_wp) < 0.02_wp, 'it does not vanish with 1/C')
   end subroutine test_stiff_drive

   !> A step a of the kink at t0 under spring C: phi = a (1 - cos(w (t - t0))), work C a^2/2.
   subroutine test_kink_step(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: run
      character(len=6), parameter :: methods(5) = [character(len=6) :: 'dop853', 'adams', 'bdf', 'erk', 'gauss']
      integer :: i

      call one_rod(config, 25.0_wp, 0.0_wp)
      deallocate (config%kink_programs)
      allocate (config%kink_programs(1))
      config%kink_programs(1)%law = 'ramp'
      config%kink_programs(1)%value = 0.2_wp
      config%kink_programs(1)%t_start = 0.3_wp
      config%kink_programs(1)%t_end = 0.3_wp
      config%t_end = 1.0_wp
      do i = 1, 5
         config%solver%method = methods(i)
         call integrate(config, [0.0_wp, 0.3_wp, 0.8_wp], run, error)
         if (allocated(error)) return
         call check_close(error, angles_of(run), [0.0_wp, 0.0_wp, 0.2_wp*(1.0_wp - cos(2.5_wp))], 1.0e-8_wp, trim(methods(i)))
         call check_close(error, run%rows(3)%work_external, 0.5_wp, 1.0e-12_wp, 'work of the step')
         call check_close(error, run%rows(3)%energy_residual, 0.0_wp, 1.0e-8_wp, 'residual')
         if (allocated(error)) return
      end do
   end subroutine test_kink_step

   !> One &hinge of hinge 0.
   subroutine add_hinge(config, hinge)
      type(case_config), intent(inout) :: config
      type(hinge_config), intent(in) :: hinge
      deallocate (config%hinges)
      allocate (config%hinges(1))
      config%hinges(1) = hinge
   end subroutine add_hinge

   !> No functions to watch with springs, driven kinks or prestress, in any kind of scene; one with a stop.
   subroutine test_nothing_to_watch(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(hinge_config) :: hinge
      type(scene_type) :: scene
      type(motion_type) :: motion
      integer :: which

      do which = 1, n_kinds
         call random_case(config, which, 4)
         config%kink_programs = four_programs()
         call new_scene(scene, config, error)
         if (.not. allocated(error)) call new_motion(motion, scene, .true., error)
         if (.not. allocated(error)) call check(error, motion%n_events, 0, kind_name(which)//': event functions')
         if (allocated(error)) return
      end do
      call one_rod(config, 1.0_wp, 0.0_wp)
      hinge%rest_angle = 0.2_wp
      call add_hinge(config, hinge)
      call new_scene(scene, config, error)
      if (.not. allocated(error)) call new_motion(motion, scene, .true., error)
      if (.not. allocated(error)) call check(error, motion%n_events, 0, 'event functions with prestress')
      if (allocated(error)) return
      hinge%upper_stop = 0.3_wp
      hinge%stop_stiffness = 1.0e3_wp
      call add_hinge(config, hinge)
      call new_scene(scene, config, error)
      if (.not. allocated(error)) call new_motion(motion, scene, .true., error)
      if (.not. allocated(error)) call check(error, motion%n_events, 1, 'event functions with a stop')
   end subroutine test_nothing_to_watch

   !> Free flight between stops at -+b, half a sine of w = sqrt(Cs) in them: one period is 4 b/v + 2 pi/w.
   subroutine test_bounce(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(hinge_config) :: hinge
      type(trajectory) :: run
      real(wp), parameter :: b = 0.3_wp, v = 2.0_wp, cs = 400.0_wp, pi = acos(-1.0_wp)
      real(wp) :: period
      character(len=6), parameter :: methods(4) = [character(len=6) :: 'dop853', 'adams', 'bdf', 'erk']
      integer :: i

      call one_rod(config, 0.0_wp, 0.0_wp)
      config%initial%phi_rate = v
      hinge%lower_stop = -b
      hinge%upper_stop = b
      hinge%stop_stiffness = cs
      call add_hinge(config, hinge)
      period = 4.0_wp*b/v + 2.0_wp*pi/sqrt(cs)
      config%t_end = 10.0_wp
      do i = 1, 4
         config%solver%method = methods(i)
         call integrate(config, [0.0_wp, b/v + 0.5_wp*pi/sqrt(cs), 5.0_wp*period, 5.0_wp*period + 0.1_wp], run, error)
         if (allocated(error)) return
         call check_close(error, run%rows(2)%phi(1), b + v/sqrt(cs), 1.0e-7_wp, trim(methods(i))//': deepest')
         call check_close(error, [run%rows(3)%phi(1), run%rows(3)%phi_rate(1), run%rows(4)%phi(1)], &
                          [0.0_wp, v, 0.1_wp*v], merge(2.0e-7_wp, 1.0e-9_wp, i == 2 .or. i == 3), &
                          trim(methods(i))//': after five periods')
         call check(error, run%n_events, 20, trim(methods(i))//': events')
         call check_close(error, run%rows(4)%energy_residual, 0.0_wp, merge(2.0e-7_wp, 1.0e-9_wp, i == 2 .or. i == 3), 'residual')
         if (allocated(error)) return
      end do
   end subroutine test_bounce

   !> x = A sin w t meets a stop at s = (1 - e) A from below: with W^2 = (C + Cs)/J, x - s = u + R cos(W t - f) until it is left
   !> after 2 f/W, u = -C s/(C + Cs), R cos f = -u, R sin f = v/W. The stop returns all, so that x goes on as if it had begun later:
   !> a touch each period. Touches last 2 f/W, down to a thousandth of the time from one point of the search to the next. A stop
   !> just beyond A is not touched.
   subroutine test_graze(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(hinge_config) :: hinge
      type(trajectory) :: run
      real(wp), parameter :: c = 25.0_wp, cs = 40.0_wp, amplitude = 0.5_wp, pi = acos(-1.0_wp), w = sqrt(c), fast = sqrt(c + cs)
      real(wp), parameter :: error_of_x = 5.0e-9_wp ! of the integration with its tolerance of 1e-10
      integer, parameter :: n_periods = 12, n_phases = 23
      character(len=6), parameter :: methods(2) = [character(len=6) :: 'dop853', 'erk']
      real(wp) :: depth, s, f, speed, touch, period, first
      integer :: i, k, m

      do m = 1, 2
         do k = 1, 8
            depth = 10.0_wp**(-k)
            call one_rod(config, c, 0.0_wp)
            config%initial%phi_rate = amplitude*w
            s = amplitude*(1.0_wp - depth)
            hinge%upper_stop = s
            hinge%stop_stiffness = cs
            call add_hinge(config, hinge)
            speed = amplitude*w*sqrt(depth*(2.0_wp - depth))
            f = atan2(speed/fast, c*s/(c + cs))
            touch = 2.0_wp*f/fast
            first = asin(1.0_wp - depth)/w
            period = touch + pi/w + 2.0_wp*first
            config%t_end = n_periods*period
            config%solver%method = methods(m)
            config%solver%rtol = 1.0e-10_wp
            config%solver%atol = 1.0e-12_wp
            call integrate(config, [0.0_wp, config%t_end], run, error)
            if (allocated(error)) return
            call check(error, run%n_events, 2*n_periods, trim(methods(m))//': events at depth 1e-'//to_text(k))
            if (allocated(error)) return
            do i = 1, n_periods
               call check_close(error, run%events(2*i - 1)%time, first + (i - 1)*period, error_of_x/speed, &
                                trim(methods(m))//': touches')
               if (allocated(error)) return
            end do
            config%t_end = 2.0_wp ! the same from other phases: the touch is anywhere in a step
            do i = 1, n_phases
               config%initial%phi = -amplitude*sin(1.2_wp*i/n_phases)
               config%initial%phi_rate = amplitude*w*cos(1.2_wp*i/n_phases)
               config%hinges(1)%upper_stop = s
               call integrate(config, [0.0_wp, first + 0.24_wp*i/n_phases + touch + 0.1_wp], run, error)
               if (allocated(error)) return
               call check(error, run%n_events, 2, trim(methods(m))//': events at depth 1e-'//to_text(k)//', phase '//to_text(i))
               if (allocated(error)) return
               config%hinges(1)%upper_stop = amplitude*(1.0_wp + depth)
               call integrate(config, [0.0_wp, 2.0_wp], run, error)
               if (allocated(error)) return
               call check(error, run%n_events, 0, trim(methods(m))//': no touch')
               if (allocated(error)) return
            end do
         end do
      end do
   end subroutine test_graze

   !> Meeting a stop with v: x'' = -Cs x - Ds x' until its moment Cs x + Ds x' vanishes, where x'' = 0. With
   !> 2 z = Ds, w^2 = Cs - z^2:  x = (v/w) e^{-z t} sin w t, and x'' = 0 at tan(w t) = 2 z w/(z^2 - w^2).
   subroutine test_damped_stop(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(hinge_config) :: hinge
      type(trajectory) :: run
      real(wp), parameter :: v = 2.0_wp, cs = 400.0_wp, ds = 12.0_wp, z = 0.5_wp*ds
      real(wp) :: w, t1, depth, rate

      call one_rod(config, 0.0_wp, 0.0_wp)
      config%initial%phi_rate = v
      config%initial%phi = -1.0_wp
      hinge%upper_stop = 0.0_wp
      hinge%stop_stiffness = cs
      hinge%stop_damping = ds
      call add_hinge(config, hinge)
      w = sqrt(cs - z**2)
      t1 = atan2(2.0_wp*z*w, z**2 - w**2)/w
      depth = v/w*exp(-z*t1)*sin(w*t1)
      rate = v*exp(-z*t1)*(cos(w*t1) - z/w*sin(w*t1))
      config%t_end = 3.0_wp
      call integrate(config, [0.0_wp, 0.5_wp + t1 + 1.0_wp], run, error)
      if (allocated(error)) return
      call check_close(error, run%events(:2)%time, [0.5_wp, 0.5_wp + t1], 1.0e-9_wp, 'times of the events')
      call check_close(error, [run%rows(2)%phi(1), run%rows(2)%phi_rate(1)], [depth + rate, rate], 1.0e-9_wp, 'rebound')
      call check_close(error, run%events(2)%energy_lost, 0.5_wp*cs*depth**2, 1.0e-9_wp, 'what stays in the stop')
      call check_close(error, run%rows(2)%energy_residual, 0.0_wp, 1.0e-9_wp, 'residual')
      call check(error, rate < 0.0_wp .and. depth > 0.0_wp, 'the closed form is not the one meant')
   end subroutine test_damped_stop

   !> A rod with friction falls on a damped stop and creeps away from it, 11 events; three rods on three stops, 60 events. Errors
   !> of the first steps after an event, of order one, are larger than what is between the rod and the face of the stop it leaves.
   subroutine test_left_stop(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: run
      character(len=6), parameter :: methods(4) = [character(len=6) :: 'dop853', 'erk', 'bdf', 'adams']
      integer, parameter :: n_events(2) = [11, 60]
      integer :: i, j

      do j = 1, 2
         if (j == 1) call rod_on_stop(config)
         if (j == 2) call rods_on_stops(config)
         do i = 1, size(methods)
            config%solver%method = methods(i)
            call integrate(config, [0.0_wp, 10.0_wp], run, error)
            if (allocated(error)) return
            call check(error, run%n_events, n_events(j), 'events by '//trim(methods(i)))
            if (allocated(error)) return
         end do
      end do
   end subroutine test_left_stop

   subroutine rod_on_stop(config)
      type(case_config), intent(out) :: config
      type(hinge_config) :: hinge

      call one_rod(config, 45.0_wp, 0.0_wp)
      config%chain%length = 1.5_wp
      config%chain%mass_per_length = 1.8_wp
      config%chain%node_mass = 2.2_wp
      config%initial%phi = 1.2_wp
      config%solver%rtol = 1.0e-8_wp
      config%solver%atol = 1.0e-10_wp
      hinge%rest_angle = -0.2_wp
      hinge%lower_stop = 0.0_wp
      hinge%stop_stiffness = 240.0_wp
      hinge%stop_damping = 58.0_wp
      hinge%friction_moment = 5.7_wp
      hinge%friction_velocity = 0.01_wp
      hinge%freeplay = 0.01_wp
      call add_hinge(config, hinge)
   end subroutine rod_on_stop

   subroutine rods_on_stops(config)
      type(case_config), intent(out) :: config

      call allocate_case(config, 3)
      config%spacecraft%motion = 'fixed'
      config%model%bending = 'rigid'
      config%chain%length = 1.2_wp
      config%chain%mass_per_length = 1.7_wp
      config%chain%bending_stiffness = 1.0_wp
      config%chain%node_mass = 1.6_wp
      config%chain%hinge_stiffness = 13.0_wp
      config%initial%phi = [1.2_wp, -1.2_wp, 1.2_wp]
      allocate (config%hinges(3), config%kink_programs(0))
      config%hinges%hinge = [0, 1, 2]
      config%hinges%rest_angle = [-0.2_wp, 0.2_wp, -0.2_wp]
      config%hinges(1)%lower_stop = 0.0_wp
      config%hinges(2)%upper_stop = 0.0_wp
      config%hinges(3)%lower_stop = 0.0_wp
      config%hinges%stop_stiffness = [630.0_wp, 1800.0_wp, 4800.0_wp]
      config%hinges%stop_damping = [13.0_wp, 71.0_wp, 3.7_wp]
   end subroutine rods_on_stops

   !> Start at g + a outside the freeplay g with spring C: quarter period outside, coast through at v = a w, and so on.
   subroutine test_freeplay(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(hinge_config) :: hinge
      type(trajectory) :: run
      real(wp), parameter :: g = 0.1_wp, a = 0.2_wp, c = 25.0_wp, rest = 0.4_wp, pi = acos(-1.0_wp)
      real(wp) :: w, half

      call one_rod(config, c, 0.0_wp)
      config%initial%phi = rest + g + a
      hinge%rest_angle = rest
      hinge%freeplay = g
      call add_hinge(config, hinge)
      w = sqrt(c)
      half = pi/w + 2.0_wp*g/(a*w)
      config%t_end = 10.0_wp
      call integrate(config, [0.0_wp, 0.5_wp*half, half, 4.0_wp*half], run, error)
      if (allocated(error)) return
      call check_close(error, angles_of(run), rest + [g + a, 0.0_wp, -g - a, g + a], 1.0e-9_wp, 'angles')
      call check_close(error, run%rows%energy_residual, spread(0.0_wp, 1, 4), 1.0e-10_wp, 'residual')
      call check(error, run%n_events, 8, 'events')
   end subroutine test_freeplay

   !> phi'' = -F while phi' > vf, then phi' decays at the rate F/vf: it slides until t1 = (v - vf)/F.
   subroutine test_friction(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(hinge_config) :: hinge
      type(trajectory) :: run
      real(wp), parameter :: f = 0.5_wp, vf = 1.0e-2_wp, v = 1.0_wp
      real(wp) :: t1
      character(len=6), parameter :: methods(4) = [character(len=6) :: 'dop853', 'adams', 'bdf', 'erk']
      integer :: i

      call one_rod(config, 0.0_wp, 0.0_wp)
      config%initial%phi_rate = v
      hinge%friction_moment = f
      hinge%friction_velocity = vf
      call add_hinge(config, hinge)
      t1 = (v - vf)/f
      config%t_end = 10.0_wp
      do i = 1, 4
         config%solver%method = methods(i)
         call integrate(config, [0.0_wp, 1.0_wp, t1 + 0.01_wp, 4.0_wp], run, error)
         if (allocated(error)) return
         call check_close(error, rates_of(run), [v, v - f, vf*exp(-0.5_wp), 0.0_wp], 1.0e-7_wp, trim(methods(i)))
         call check_close(error, run%rows(4)%energy_dissipated, 0.5_wp*v**2, 1.0e-7_wp, 'all is dissipated')
         call check(error, run%n_events, 1, 'events')
         if (allocated(error)) return
      end do
   end subroutine test_friction

   !> A scene of a kind with freeplay, stops and friction in its hinges, soft enough to meet them.
   subroutine eventful_case(config, which, n)
      type(case_config), intent(out) :: config
      integer, intent(in) :: which, n
      integer :: k

      call random_case(config, which, n)
      config%initial%phi = 0.0_wp
      config%initial%alpha = 0.0_wp
      config%initial%beta = 0.0_wp
      config%initial%alpha_rate = 0.0_wp
      config%initial%beta_rate = 0.0_wp
      config%chain%bending_stiffness = 500.0_wp
      config%chain%hinge_stiffness = 200.0_wp
      config%chain%hinge_damping = 0.3_wp
      allocate (config%hinges(n), config%kink_programs(0))
      do k = 0, n - 1
         config%hinges(k + 1)%hinge = k
         select case (mod(k, 3))
         case (0)
            config%hinges(k + 1)%lower_stop = -0.15_wp
            config%hinges(k + 1)%upper_stop = 0.1_wp
            config%hinges(k + 1)%stop_stiffness = 3000.0_wp
            config%hinges(k + 1)%stop_damping = 2.0_wp
         case (1)
            config%hinges(k + 1)%freeplay = 0.05_wp
            config%hinges(k + 1)%freeplay_stiffness = 20.0_wp
            config%hinges(k + 1)%rest_angle = 0.02_wp
         case default
            config%hinges(k + 1)%friction_moment = 3.0_wp
            config%hinges(k + 1)%friction_velocity = 0.5_wp
         end select
      end do
      config%solver%rtol = 1.0e-11_wp
      config%solver%atol = 1.0e-12_wp
      config%t_end = 1.0_wp
   end subroutine eventful_case

   subroutine test_methods_agree(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: reference, run
      character(len=6), parameter :: methods(3) = [character(len=6) :: 'adams', 'bdf', 'erk']
      real(wp), parameter :: tolerance(3) = [1.0e-6_wp, 1.0e-6_wp, 1.0e-7_wp]
      integer :: i, n

      call seed_random(5)
      call eventful_case(config, 3, 3)
      call integrate(config, [0.0_wp, 0.4_wp, 1.0_wp], reference, error)
      if (allocated(error)) return
      call check(error, reference%n_events > 10, 'the scene has hardly an event')
      if (allocated(error)) return
      do i = 1, 3
         config%solver%method = methods(i)
         call integrate(config, [0.0_wp, 0.4_wp, 1.0_wp], run, error)
         if (allocated(error)) return
         call check(error, run%n_events, reference%n_events, trim(methods(i))//': events')
         if (allocated(error)) return
         n = run%n_events
         call check(error, all(run%events(:n)%kind == reference%events(:n)%kind), trim(methods(i))//': kinds of events')
         call check_close(error, run%events(:n)%time, reference%events(:n)%time, tolerance(i), trim(methods(i))//': times')
         call check_close(error, run%rows(3)%phi, reference%rows(3)%phi, tolerance(i), trim(methods(i))//': angles')
         if (allocated(error)) return
      end do
   end subroutine test_methods_agree

   subroutine test_energy_everywhere(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: run
      real(wp) :: scale
      integer :: which, n

      call seed_random(6)
      do which = 1, n_kinds
         if (index(kind_name(which), 'paper distributed dynamic') > 0) cycle
         do n = 1, 3
            call eventful_case(config, which, n)
            config%model%kernel = merge('assembled', 'recursive', n == 2)
            call integrate(config, [0.0_wp, 0.3_wp, 0.7_wp, 1.0_wp], run, error)
            if (allocated(error)) then
               error%message = kind_name(which)//': '//error%message
               return
            end if
            scale = maxval(run%rows%energy_kinetic + run%rows%energy_elastic) + maxval(abs(run%rows%work_external))
            call check_close(error, run%rows%energy_residual/scale, spread(0.0_wp, 1, 4), 1.0e-9_wp, kind_name(which))
            call check(error, run%n_events > 0, kind_name(which)//': no event')
            if (allocated(error)) return
         end do
      end do
   end subroutine test_energy_everywhere

   !> At a state in a stop, beyond freeplay and sliding, in every kind of scene.
   subroutine test_jacobian(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(scene_type) :: scene
      type(motion_type) :: motion
      real(wp), allocatable :: y(:)
      integer :: which

      call seed_random(8)
      do which = 1, n_kinds
         call eventful_case(config, which, 3)
         config%initial%phi = [0.2_wp, 0.4_wp, 0.45_wp]
         config%initial%phi_rate = [1.0_wp, -1.0_wp, 3.0_wp]
         call new_scene(scene, config, error)
         if (.not. allocated(error)) call new_motion(motion, scene, .true., error)
         if (allocated(error)) return
         call initial_state(motion, config%initial, y)
         call motion%begin_regime(0.0_wp, 1.0_wp, 1.0_wp, y, error)
         if (allocated(error)) return
         call check_jacobian(motion, y, kind_name(which), error)
         if (allocated(error)) return
      end do
   end subroutine test_jacobian

   !> Laws that are called curved though they are not: nothing changes, but that they know rotations and rates of the state that the
   !> right-hand side, or the power, was asked for last.
   subroutine test_tangents(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(scene_type) :: scene
      type(motion_type) :: motion
      real(wp), allocatable :: y(:), f(:), g(:)
      real(wp) :: power(2), same(2)
      integer :: which
      logical :: ok

      call seed_random(8)
      do which = 1, n_kinds
         call eventful_case(config, which, 3)
         if (config%model%bending == 'quasistatic') cycle
         config%initial%phi = [0.2_wp, 0.4_wp, 0.45_wp]
         config%initial%phi_rate = [1.0_wp, -1.0_wp, 3.0_wp]
         config%kink_programs = [kink_config(hinge=1, law='sine', t_end=1.0_wp, value=0.1_wp, rate=2.0_wp)]
         call new_scene(scene, config, error)
         if (.not. allocated(error)) call new_motion(motion, scene, .true., error)
         if (allocated(error)) return
         call initial_state(motion, config%initial, y)
         call motion%begin_regime(0.0_wp, 1.0_wp, 1.0_wp, y, error)
         if (allocated(error)) return
         f = y
         g = y
         call motion%rhs(0.3_wp, y, f, ok)
         call motion%quadratures(0.4_wp, y + 0.01_wp*f, power, ok)
         motion%dynamics%hinges%curved = .true.
         call motion%dynamics%set_regime(0.0_wp, 1.0_wp)
         call motion%rhs(0.3_wp, y, g, ok)
         call check_joints(0.3_wp, y)
         call motion%quadratures(0.4_wp, y + 0.01_wp*f, same, ok)
         call check_joints(0.4_wp, y + 0.01_wp*f)
         call check_close(error, [g, same], [f, power], 0.0_wp, kind_name(which)//': rates, powers')
         if (allocated(error)) return
      end do

   contains

      subroutine check_joints(t, state)
         real(wp), intent(in) :: t, state(:)
         real(wp), dimension(3) :: theta, theta_rate
         if (allocated(error)) return
         call motion%dynamics%move_kinks(t)
         call motion%dynamics%hinge_rotations(state(:motion%n_q), state(motion%n_q + 1:), theta, theta_rate)
         associate (mechanisms => motion%dynamics%hinges%mechanisms)
            call check_close(error, [mechanisms%theta, mechanisms%theta_rate], [theta, theta_rate], 0.0_wp, kind_name(which))
         end associate
      end subroutine check_joints

   end subroutine test_tangents

   subroutine test_chatter(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(hinge_config) :: hinge
      type(trajectory) :: run
      type(error_type), allocatable :: refusal

      call one_rod(config, 0.0_wp, 0.0_wp)
      config%initial%phi_rate = 2.0_wp
      hinge%lower_stop = -0.1_wp
      hinge%upper_stop = 0.1_wp
      hinge%stop_stiffness = 1.0e4_wp
      call add_hinge(config, hinge)
      config%t_end = 1.0e3_wp
      config%solver%max_events = 11
      call integrate(config, [0.0_wp, 1000.0_wp], run, refusal)
      call check(error, allocated(refusal), 'no end of the events')
      if (allocated(error)) return
      call check(error, index(refusal%message, 'max_events = 11 reached at t = ') == 1, refusal%message)
      if (allocated(error)) return
      config%solver%max_events = 100000 ! 32 bounces of 0.1 s within 1e-8 of the time
      config%t_end = 1.0e9_wp
      call integrate(config, [0.0_wp, 1.0e9_wp], run, refusal)
      call check(error, allocated(refusal), 'no end of the events')
      if (allocated(error)) return
      call check(error, index(refusal%message, 'chatter at t = ') == 1, refusal%message)
   end subroutine test_chatter

   subroutine test_gauss_refuses(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(hinge_config) :: hinge
      type(trajectory) :: run
      type(error_type), allocatable :: refusal

      call one_rod(config, 1.0_wp, 0.0_wp)
      hinge%freeplay = 0.1_wp
      call add_hinge(config, hinge)
      config%solver%method = 'gauss'
      call integrate(config, [0.0_wp, 1.0_wp], run, refusal)
      call check(error, allocated(refusal), 'accepted')
      if (allocated(error)) return
      call check(error, index(refusal%message, 'stops, freeplay, friction and latches') > 0, refusal%message)
   end subroutine test_gauss_refuses

   !> Two equal rigid rods on a fixed hinge without springs, the first at rest, the second turning with v. When they are in
   !> line, the impulse L at hinge 1 makes the rates equal: with M = m l^2 ((4/3, 1/2), (1/2, 1/3)) and p = (0, v) the angular
   !> momentum about hinge 0 stays, (1/2 + 1/3) v = (4/3 + 1 + 1/3) w, w = 5/16 v, and the loss is
   !> m l^2 v^2/2 (1/3 - 8/3 (5/16)^2).
   subroutine test_latch_impulse(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(hinge_config) :: hinge
      type(trajectory) :: run
      character(len=6), parameter :: methods(4) = [character(len=6) :: 'dop853', 'adams', 'bdf', 'erk']
      real(wp) :: before(2), loss, m(2, 2), w
      integer :: i, kernel

      call allocate_case(config, 2)
      config%spacecraft%motion = 'fixed'
      config%model%bending = 'rigid'
      config%chain%length = 1.2_wp
      config%chain%mass_per_length = 0.9_wp
      config%chain%bending_stiffness = 1.0_wp
      config%initial%phi = [0.3_wp, -0.9_wp]
      config%initial%phi_rate = [0.5_wp, 2.0_wp]
      config%solver%rtol = 1.0e-11_wp
      config%solver%atol = 1.0e-13_wp
      config%t_end = 3.0_wp
      allocate (config%hinges(0), config%kink_programs(0))
      hinge%hinge = 1
      hinge%latch_angle = 0.0_wp
      call add_hinge(config, hinge)
      m = 0.9_wp*1.2_wp**3*reshape([4.0_wp/3.0_wp, 0.5_wp, 0.5_wp, 1.0_wp/3.0_wp], [2, 2])
      do i = 1, 4
         do kernel = 1, 2
            config%solver%method = methods(i)
            config%model%kernel = merge('recursive', 'assembled', kernel == 1)
            call integrate(config, [0.0_wp, 2.9_wp, 3.0_wp], run, error)
            if (allocated(error)) return
            call check(error, run%n_events, 1, 'events')
            if (allocated(error)) return
            ! The rates just before: from momentum and energy of the free motion, which both stay.
            before = rates_before(config, m)
            w = sum(matmul(m, before))/sum(m)
            loss = 0.5_wp*(dot_product(before, matmul(m, before)) - w**2*sum(m))
            call check_close(error, run%events(1)%energy_lost, loss, 1.0e-7_wp, trim(methods(i))//': loss')
            call check_close(error, run%rows(3)%phi_rate, [w, w], 1.0e-7_wp, trim(methods(i))//': rates after')
            call check_close(error, run%rows(3)%phi(1), run%rows(3)%phi(2), 1.0e-11_wp, 'the lock holds')
            call check_close(error, run%rows(3)%angular_momentum, run%rows(1)%angular_momentum, 1.0e-7_wp, 'angular momentum')
            call check_close(error, run%rows(3)%energy_residual, 0.0_wp, merge(1.0e-7_wp, 1.0e-9_wp, i == 2 .or. i == 3), &
                             'residual')
            if (allocated(error)) return
         end do
      end do
      call check(error, loss > 0.1_wp, 'hardly a latch')
   end subroutine test_latch_impulse

   !> Rates when the rods of `test_latch_impulse` come in line: momentum about hinge 0 and energy are those of the start, and
   !> the second rod overtakes the first.
   function rates_before(config, m) result(rates)
      type(case_config), intent(in) :: config
      real(wp), intent(in) :: m(2, 2) !! in line
      real(wp) :: rates(2)
      real(wp) :: start(2, 2), p(2), momentum, energy, reduced

      p = config%initial%phi_rate
      start = m
      start(1, 2) = m(1, 2)*cos(config%initial%phi(2) - config%initial%phi(1))
      start(2, 1) = start(1, 2)
      momentum = sum(matmul(start, p))
      energy = 0.5_wp*dot_product(p, matmul(start, p))
      ! T = momentum^2/(2 sum M) + reduced d^2/2 with d the rate of opening.
      reduced = m(2, 2) - sum(m(2, :))**2/sum(m)
      associate (d => sqrt(2.0_wp*(energy - 0.5_wp*momentum**2/sum(m))/reduced))
         rates(1) = (momentum - sum(m(2, :))*d)/sum(m)
         rates(2) = rates(1) + d
      end associate
   end function rates_before

   !> A prestressed chain of a kind: hinge 1 of three is held.
   subroutine held_case(config, which)
      type(case_config), intent(out) :: config
      integer, intent(in) :: which
      type(hinge_config) :: hinge

      call random_case(config, which, 3)
      deallocate (config%loads)
      allocate (config%loads(0), config%hinges(0), config%kink_programs(0))
      config%chain%bending_stiffness = 500.0_wp
      config%chain%hinge_stiffness = 100.0_wp
      config%chain%kink = 0.0_wp
      config%initial%phi = 0.0_wp
      config%initial%phi_rate = 0.0_wp
      config%initial%alpha = 0.0_wp
      config%initial%beta = 0.0_wp
      config%initial%alpha_rate = 0.0_wp
      config%initial%beta_rate = 0.0_wp
      config%initial%bubble = 0.0_wp
      config%initial%bubble_rate = 0.0_wp
      hinge%hinge = 1
      hinge%held = .true.
      hinge%release_time = 0.4_wp
      hinge%rest_angle = 0.8_wp
      call add_hinge(config, hinge)
      config%solver%rtol = 1.0e-11_wp
      config%solver%atol = 1.0e-12_wp
      config%t_end = 1.0_wp
   end subroutine held_case

   !> A hinge is held for a while, another one pulls by its prestress, a kink moves: against dop853.
   subroutine test_gauss_takes(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(hinge_config) :: hinge
      type(trajectory) :: by_gauss, by_dop853
      real(wp) :: scale
      integer :: which

      call seed_random(28)
      do which = 1, n_kinds
         call held_case(config, which)
         if (config%model%dampers == 'exact' .or. index(kind_name(which), 'paper distributed dynamic') > 0) cycle
         hinge%hinge = 2
         hinge%rest_angle = -0.5_wp
         config%hinges = [config%hinges(1), hinge]
         deallocate (config%kink_programs)
         allocate (config%kink_programs(1))
         config%kink_programs(1)%t_start = 0.2_wp
         config%kink_programs(1)%t_end = 0.7_wp
         config%kink_programs(1)%value = 0.3_wp
         config%solver%method = 'gauss'
         call integrate(config, [0.0_wp, 0.4_wp, 1.0_wp], by_gauss, error)
         config%solver%method = 'dop853'
         if (.not. allocated(error)) call integrate(config, [0.0_wp, 0.4_wp, 1.0_wp], by_dop853, error)
         if (allocated(error)) return
         call check(error, by_gauss%n_events, 1, kind_name(which)//': released')
         call check_close(error, [by_gauss%rows(2)%phi, by_gauss%rows(3)%phi], [by_dop853%rows(2)%phi, by_dop853%rows(3)%phi], &
                          1.0e-7_wp, kind_name(which)//': angles')
         if (allocated(error)) return
         scale = maxval(by_gauss%rows%energy_kinetic + by_gauss%rows%energy_elastic)
         call check_close(error, by_gauss%rows%energy_residual, spread(0.0_wp, 1, 3), 1.0e-8_wp*scale, &
                          kind_name(which)//': residual')
         if (allocated(error)) return
      end do
   end subroutine test_gauss_takes

   !> Nothing moves while all is in balance and the prestressed hinge is held. Released, it moves as if it had started then.
   subroutine test_release(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: held, free
      integer :: which

      call seed_random(21)
      do which = 1, n_kinds
         call held_case(config, which)
         config%initial%velocity_x = 0.0_wp
         config%initial%velocity_y = 0.0_wp
         config%initial%omega = 0.0_wp
         call integrate(config, [0.0_wp, 0.4_wp, 1.0_wp], held, error)
         if (allocated(error)) return
         call check_close(error, held%rows(2)%phi, [0.0_wp, 0.0_wp, 0.0_wp], 1.0e-12_wp, kind_name(which)//': held')
         if (allocated(error)) return
         if (config%model%dampers == 'exact') cycle ! a run that starts with balanced dampers is another motion
         config%hinges(1)%held = .false.
         config%hinges(1)%release_time = none_given
         call integrate(config, [0.0_wp, 0.6_wp], free, error)
         if (allocated(error)) return
         call check_close(error, held%rows(3)%phi, free%rows(2)%phi, 1.0e-8_wp, kind_name(which)//': released')
         call check(error, maxval(abs(free%rows(2)%phi)) > 1.0e-2_wp, 'hardly a motion')
         if (allocated(error)) return
      end do
   end subroutine test_release

   !> All hinges held, free spacecraft, rigid rods: torque-free motion of one rigid body.
   subroutine test_held_body(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: run
      integer :: k

      call seed_random(22)
      call random_case(config, 3, 4)
      deallocate (config%loads)
      allocate (config%loads(0), config%hinges(4), config%kink_programs(0))
      config%initial%phi_rate = 0.0_wp
      do k = 0, 3
         config%hinges(k + 1)%hinge = k
         config%hinges(k + 1)%held = .true.
      end do
      config%solver%rtol = 1.0e-11_wp
      config%solver%atol = 1.0e-12_wp
      config%t_end = 2.0_wp
      call integrate(config, [0.0_wp, 1.0_wp, 2.0_wp], run, error)
      if (allocated(error)) return
      call check_close(error, run%rows(3)%phi, config%initial%phi, 1.0e-12_wp, 'angles to the spacecraft')
      call check_close(error, run%rows(3)%omega, config%initial%omega, 1.0e-9_wp, 'rate of turning')
      call check_close(error, run%rows(3)%rotation, config%initial%rotation + 2.0_wp*config%initial%omega, 1.0e-9_wp, 'turn')
      call check_close(error, run%rows%energy_residual, [0.0_wp, 0.0_wp, 0.0_wp], 1.0e-9_wp, 'residual')
   end subroutine test_held_body

   !> With lock_stiffness C in place of the constraint, the difference falls as 1/C.
   subroutine test_stiff_lock(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: exact, soft
      real(wp) :: miss(2)
      integer :: i

      call seed_random(23)
      call held_case(config, 3)
      config%hinges(1)%release_time = 5.0_wp
      config%initial%omega = 0.0_wp
      config%chain%kink = [0.1_wp, 0.0_wp, 0.2_wp]
      call integrate(config, [0.0_wp, 0.7_wp], exact, error)
      if (allocated(error)) return
      do i = 1, 2
         config%hinges(1)%lock_stiffness = 10.0_wp**(4 + 2*i)
         config%hinges(1)%lock_damping = 10.0_wp**(1 + i)
         call integrate(config, [0.0_wp, 0.7_wp], soft, error)
         if (allocated(error)) return
         miss(i) = maxval(abs(soft%rows(2)%phi - exact%rows(2)%phi))
      end do
      call check(error, miss(1) > 1.0e-6_wp .and. miss(2) < 0.02_wp*miss(1), 'the difference does not fall as 1/C')
   end subroutine test_stiff_lock

   !> A held hinge, released under load, which then latches, each hinge with a damper whose rotation is a state. As a constraint
   !> against springs C (differences fall with 1/C); and against reduced dampers, whose joints jump where these creep (with D).
   subroutine test_exact_locks(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config, weak
      type(trajectory) :: exact, other
      real(wp) :: miss(2)
      integer :: i

      call seed_random(27)
      call held_case(config, 7)
      call check(error, trim(config%model%dampers), 'exact', 'kind')
      if (allocated(error)) return
      config%chain%hinge_damping = 2.0_wp
      config%initial%omega = 0.0_wp
      config%hinges(1)%release_time = 0.1_wp
      config%hinges(1)%latch_angle = 0.1_wp
      config%hinges(1)%rest_angle = 0.0_wp
      deallocate (config%loads)
      allocate (config%loads(1))
      config%loads(1)%target = 'node'
      config%loads(1)%component = 'Y'
      config%loads(1)%node = 3
      config%loads(1)%value = 40.0_wp
      config%solver%method = 'bdf'
      call integrate(config, [0.0_wp, 1.0_wp], exact, error)
      if (allocated(error)) return
      call check(error, exact%n_events, 2, 'released and latched')
      if (allocated(error)) return
      do i = 1, 2
         weak = config
         weak%hinges(1)%lock_stiffness = 10.0_wp**(4 + i)
         call integrate(weak, [0.0_wp, 1.0_wp], other, error)
         if (allocated(error)) return
         miss(i) = maxval(abs(other%rows(2)%phi - exact%rows(2)%phi))
      end do
      call check(error, miss(1) > 1.0e-6_wp .and. abs(miss(1)/miss(2) - 10.0_wp) < 2.0_wp, 'the difference does not fall as 1/C')
      if (allocated(error)) return
      do i = 1, 2
         config%chain%hinge_damping = 10.0_wp**(-i)
         config%model%dampers = 'exact'
         call integrate(config, [0.0_wp, 1.0_wp], exact, error)
         config%model%dampers = 'reduced'
         if (.not. allocated(error)) call integrate(config, [0.0_wp, 1.0_wp], other, error)
         if (allocated(error)) return
         miss(i) = maxval(abs(other%rows(2)%phi - exact%rows(2)%phi))
      end do
      call check(error, miss(1) > 1.0e-6_wp .and. abs(miss(1)/miss(2) - 10.0_wp) < 3.0_wp, 'the difference does not fall with D')
   end subroutine test_exact_locks

   !> Three hinges: the first latches and releases the second, which latches and releases the third, which latches.
   subroutine test_sequence(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: run
      real(wp) :: scale
      integer :: which, k, latched

      call seed_random(24)
      do which = 1, n_kinds
         if (index(kind_name(which), 'paper distributed dynamic') > 0) cycle
         call held_case(config, which)
         deallocate (config%hinges)
         allocate (config%hinges(3))
         do k = 0, 2
            associate (hinge => config%hinges(k + 1))
               hinge%hinge = k
               hinge%held = .true.
               hinge%rest_angle = merge(1.0_wp, -1.0_wp, k == 1)
               hinge%latch_angle = merge(0.5_wp, -0.5_wp, k == 1)
               if (k == 0) hinge%release_time = 0.05_wp
               if (k > 0) hinge%release_after = k - 1
            end associate
         end do
         config%t_end = 2.0_wp
         config%chain%hinge_damping = 0.5_wp
         call integrate(config, [0.0_wp, 0.5_wp, 1.0_wp, 2.0_wp], run, error)
         if (allocated(error)) then
            error%message = kind_name(which)//': '//error%message
            return
         end if
         latched = count(run%events(:run%n_events)%kind == kind_latched)
         call check(error, latched, 3, kind_name(which)//': latched')
         if (allocated(error)) return
         scale = maxval(run%rows%energy_kinetic + run%rows%energy_elastic)
         call check_close(error, run%rows%energy_residual/scale, spread(0.0_wp, 1, 4), 1.0e-9_wp, kind_name(which)//': residual')
         if (allocated(error)) return
         if (config%spacecraft%motion == 'fixed') cycle
         call check_close(error, run%rows%angular_momentum - run%rows(1)%angular_momentum, spread(0.0_wp, 1, 4), &
                          1.0e-7_wp, kind_name(which)//': angular momentum')
         if (allocated(error)) return
      end do
   end subroutine test_sequence

   !> The opening of a held hinge is its kink, to rounding; the work of the drive is all the energy there is.
   subroutine test_held_drive(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: run
      real(wp) :: opening
      integer :: which, kernel

      call seed_random(25)
      do which = 1, n_kinds
         if (index(kind_name(which), 'paper distributed dynamic') > 0) cycle
         do kernel = 1, 2
            call held_case(config, which)
            config%model%kernel = merge('recursive', 'assembled', kernel == 1)
            config%hinges(1)%release_time = 100.0_wp
            deallocate (config%kink_programs)
            allocate (config%kink_programs(1))
            config%kink_programs(1)%hinge = 1
            config%kink_programs(1)%value = 0.7_wp
            config%kink_programs(1)%t_start = 0.1_wp
            config%kink_programs(1)%t_end = 0.8_wp
            call integrate(config, [0.0_wp, 0.45_wp, 1.0_wp], run, error)
            if (allocated(error)) return
            call check_close(error, run%rows%energy_residual, [0.0_wp, 0.0_wp, 0.0_wp], &
                             1.0e-9_wp*maxval(run%rows%energy_kinetic + run%rows%energy_elastic), kind_name(which)//': residual')
            if (allocated(error)) return
            if (config%model%bending == 'quasistatic') cycle
            opening = (run%rows(2)%phi(2) + run%rows(2)%alpha(2)) - (run%rows(2)%phi(1) + run%rows(2)%beta(1))
            call check_close(error, opening, 0.35_wp, 1.0e-10_wp, kind_name(which)//': half of the way')
            if (allocated(error)) return
         end do
      end do
   end subroutine test_held_drive

   subroutine add_written(self, scene, t, q, p, base, node)
      class(written_loads), intent(inout) :: self
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: t, q(:), p(:)
      real(wp), intent(inout) :: base(3), node(:, :)
      integer :: i, component

      associate (unused_scene => scene, unused_q => q, unused_p => p); end associate
      do i = 1, size(self%loads)
         component = index('XYM', self%loads(i)%component(1:1))
         if (self%loads(i)%target == 'node') then
            node(component, self%loads(i)%node) = node(component, self%loads(i)%node) + value_at(self%loads(i), t)
         else
            base(component) = base(component) + value_at(self%loads(i), t)
         end if
      end do
   end subroutine add_written

   !> The laws of random cases.
   pure real(wp) function value_at(load, t)
      type(load_config), intent(in) :: load
      real(wp), intent(in) :: t
      value_at = load%value
      if (load%law == 'sine_squared') value_at = load%value*sin(load%rate*t)**2
   end function value_at

   subroutine test_written_loads(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: given, written
      type(written_loads) :: load
      type(load_config), allocatable :: loads(:)
      character(len=6), parameter :: methods(5) = [character(len=6) :: 'dop853', 'adams', 'bdf', 'erk', 'gauss']
      integer :: i

      call seed_random(31)
      call random_case(config, 3, 3)
      loads = config%loads
      config%solver%rtol = 1.0e-11_wp
      config%solver%atol = 1.0e-13_wp
      load%loads = loads
      load%on_nodes = .true.
      do i = 1, 5
         config%solver%method = methods(i)
         config%loads = loads
         call integrate(config, [0.0_wp, 0.3_wp], given, error)
         if (allocated(error)) return
         deallocate (config%loads)
         allocate (config%loads(0))
         call integrate(config, [0.0_wp, 0.3_wp], written, error, load)
         if (allocated(error)) return
         call check_close(error, [written%rows(2)%phi, written%rows(2)%omega, written%rows(2)%work_external], &
                          [given%rows(2)%phi, given%rows(2)%omega, given%rows(2)%work_external], &
                          1.0e-7_wp*max(1.0_wp, abs(given%rows(2)%work_external)), trim(methods(i)))
         if (allocated(error)) return
      end do
   end subroutine test_written_loads

   subroutine add_spring(self, scene, t, q, p, base, node)
      class(attitude_spring), intent(inout) :: self
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: t, q(:), p(:)
      real(wp), intent(inout) :: base(3), node(:, :)
      associate (unused_scene => scene, unused_t => t, unused_node => node); end associate
      base(3) = base(3) - self%stiffness*q(3) - self%damping*p(3)
   end subroutine add_spring

   !> One held rigid rod at the centre of mass: I theta'' = -k theta - d theta' with I = J0 + m l^2/3 - (first moment)^2/mass.
   subroutine test_feedback(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(hinge_config) :: hinge
      type(trajectory) :: run
      type(attitude_spring) :: load
      real(wp) :: inertia, decay, w

      call one_rod(config, 0.0_wp, 0.0_wp)
      config%spacecraft%motion = 'free'
      config%spacecraft%mass = 9.0_wp
      config%spacecraft%inertia = 2.0_wp
      config%initial%rotation = 0.4_wp
      hinge%held = .true.
      call add_hinge(config, hinge)
      load%stiffness = 5.0_wp
      load%damping = 1.0_wp
      inertia = 2.0_wp + 1.0_wp - 1.5_wp**2/12.0_wp
      decay = 0.5_wp*load%damping/inertia
      w = sqrt(load%stiffness/inertia - decay**2)
      call integrate(config, [0.0_wp, 1.3_wp], run, error, load)
      if (allocated(error)) return
      call check_close(error, run%rows(2)%rotation, 0.4_wp*exp(-1.3_wp*decay)*(cos(1.3_wp*w) + decay/w*sin(1.3_wp*w)), &
                       1.0e-10_wp, 'rotation')
      call check_close(error, run%rows(2)%energy_residual, 0.0_wp, 1.0e-10_wp, 'residual')
   end subroutine test_feedback

end module test_moving
