!> Laws of hinges and joints between massless rods are found together; what jumps at a release or a step is booked where it belongs.
module test_balance
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type
   use rodyn_case_config, only: case_config, hinge_config, kink_config, none_given
   use rodyn_hinge_mechanism, only: kind_latched, kind_names, kind_released
   use rodyn_scene, only: scene_type, new_scene
   use rodyn_motion, only: motion_type, new_motion, initial_state, state_invariants
   use rodyn_kinematics, only: invariants_type
   use test_random_scenes, only: allocate_case, seed_random, uniform
   use test_testing, only: unittest, new_test, check, check_close
   use test_trajectories, only: trajectory, integrate
   implicit none (type, external)
   private
   public :: collect_balance

   real(wp), parameter :: close_enough = 1.0e-9_wp

contains

   subroutine collect_balance(suite)
      type(unittest), allocatable, intent(out) :: suite(:)
      suite = [new_test('joints start where the potential energy is least, of all combinations of laws', test_start), &
               new_test('after a release and a step of a kink, too, and the ledger knows which is which', test_jumps), &
               new_test('they stay there in runs', test_runs), &
               new_test('no law is broken after a start or a release, in chains of up to 30 hinges', test_long_chains), &
               new_test('a joint that starts below its latch does not latch on its way down', test_latch_side), &
               new_test('a joint that starts beyond a stop is pushed, with both kinds of dampers', test_beyond_stop), &
               new_test('a held joint stays on the side of its latch where it is held', test_held_latch_side), &
               new_test('a held joint has the laws of its angle', test_held_stop), &
               new_test('a joint that jumps past its latch stays there', test_jump_to_latch), &
               new_test('a kink of &chain and a program that does not move are one scene', test_constant_program), &
               new_test('a release loses what its joint jumps, loads and steps of kinks work beside it', test_release_books), &
               new_test('a step of a kink into a stop and out of it loses nothing', test_step_at_stop), &
               new_test('what has latched stays so when another hinge is released', test_two_panels), &
               new_test('no switch of any kind frees what has latched', test_latched_for_good), &
               new_test('a hinge that begins at its latch angle latches when it comes back', test_from_latch)]
   end subroutine collect_balance

   !> Uniform massless rods of length 1 on a fixed spacecraft, EI and C as given.
   subroutine massless_rods(config, bending_stiffness, stiffness)
      type(case_config), intent(out) :: config
      real(wp), intent(in) :: bending_stiffness(:), stiffness(:)

      call allocate_case(config, size(stiffness))
      config%spacecraft%motion = 'fixed'
      config%model%inertia = 'lumped'
      config%model%bending = 'quasistatic'
      config%chain%length = 1.0_wp
      config%chain%mass_per_length = 1.0_wp
      config%chain%node_mass = 1.0_wp
      config%chain%bending_stiffness = bending_stiffness
      config%chain%hinge_stiffness(:) = stiffness
      config%t_end = 1.0_wp
      config%solver%rtol = 1.0e-10_wp
      config%solver%atol = 1.0e-12_wp
      allocate (config%hinges(0), config%kink_programs(0))
   end subroutine massless_rods

   !> Rods with hinges of all kinds, some of them held until 0.5 s.
   subroutine random_rods(config, n, exact)
      type(case_config), intent(out) :: config
      integer, intent(in) :: n
      logical, intent(in) :: exact
      real(wp) :: ei(n), c(n)
      integer :: k

      do k = 1, n
         ei(k) = 10.0_wp**uniform(1.0_wp, 3.0_wp)
         c(k) = 10.0_wp**uniform(1.0_wp, 3.0_wp)
      end do
      call massless_rods(config, ei, c)
      if (exact) config%model%dampers = 'exact'
      deallocate (config%hinges)
      allocate (config%hinges(n))
      do k = 1, n
         config%initial%phi(k) = uniform(-1.0_wp, 1.0_wp)
         config%chain%kink(k - 1) = max(0.0_wp, uniform(-0.3_wp, 0.3_wp))
         if (exact) config%chain%hinge_damping(k - 1) = max(0.0_wp, uniform(-1.0_wp, 3.0_wp))
         associate (hinge => config%hinges(k))
            hinge%hinge = k - 1
            hinge%rest_angle = uniform(-0.3_wp, 0.3_wp)
            hinge%freeplay = max(0.0_wp, uniform(-0.2_wp, 0.3_wp))
            if (hinge%freeplay > 0.0_wp) hinge%freeplay_stiffness = max(0.0_wp, uniform(-500.0_wp, 1500.0_wp))
            if (uniform(0.0_wp, 1.0_wp) < 0.6_wp) hinge%lower_stop = uniform(-0.4_wp, 0.0_wp)
            if (uniform(0.0_wp, 1.0_wp) < 0.6_wp) hinge%upper_stop = uniform(0.0_wp, 0.4_wp)
            hinge%stop_stiffness = 10.0_wp**uniform(1.0_wp, 5.0_wp)
            if (min(hinge%lower_stop, hinge%upper_stop) >= none_given) hinge%stop_stiffness = 0.0_wp
            hinge%held = uniform(0.0_wp, 1.0_wp) < 0.4_wp
            if (hinge%held) hinge%release_time = 0.5_wp
         end associate
      end do
   end subroutine random_rods

   !> Second route: the joints of least potential energy under openings, by trying every combination of laws. Some joints are given.
   subroutine least_energy(config, opening, given, at, theta, energy)
      type(case_config), intent(in) :: config
      real(wp), intent(in) :: opening(:) !! without kinks (n)
      logical, intent(in) :: given(:)    !! joint stays at ... (n)
      real(wp), intent(in) :: at(:)      !! ... (n)
      real(wp), intent(out) :: theta(:), energy
      real(wp), dimension(size(opening), size(opening)) :: flexibility, a
      real(wp), dimension(size(opening)) :: c, t0, x, moment, joint
      real(wp) :: trial
      integer :: k, n, number, piece

      n = size(opening)
      flexibility = 0.0_wp
      do k = 1, n
         associate (f => 1.0_wp/(3.0_wp*config%chain%bending_stiffness(k)))
            flexibility(k, k) = flexibility(k, k) + f
            if (k < n) flexibility(k + 1, k + 1) = f
            if (k < n) flexibility(k, k + 1) = 0.5_wp*f
            if (k < n) flexibility(k + 1, k) = 0.5_wp*f
         end associate
      end do
      energy = huge(1.0_wp)
      do number = 0, 9**n - 1
         piece = number
         do k = 1, n
            call law_of(config%hinges(k), config%chain%hinge_stiffness(k - 1), mod(piece, 9), c(k), t0(k))
            piece = piece/9
         end do
         ! th + F T = opening with T = c th + t0; of a joint that is given T is the unknown.
         x = opening
         do k = 1, n
            a(:, k) = flexibility(:, k)*merge(1.0_wp, c(k), given(k))
            if (given(k)) then
               x(k) = x(k) - at(k)
            else
               a(k, k) = a(k, k) + 1.0_wp
               x = x - flexibility(:, k)*t0(k)
            end if
         end do
         call eliminate(a, x)
         joint = merge(at, x, given)
         moment = merge(x, c*x + t0, given)
         trial = 0.5_wp*dot_product(moment, matmul(flexibility, moment))
         do k = 1, n
            trial = trial + energy_of(config%hinges(k), config%chain%hinge_stiffness(k - 1), joint(k))
         end do
         if (trial >= energy) cycle
         energy = trial
         theta = joint
      end do
   end subroutine least_energy

   !> Law number 0 to 8, T = c th + t0: three of the spring, three of the stops.
   subroutine law_of(hinge, stiffness, number, c, t0)
      type(hinge_config), intent(in) :: hinge
      real(wp), intent(in) :: stiffness
      integer, intent(in) :: number
      real(wp), intent(out) :: c, t0
      integer :: side, stop

      side = mod(number, 3) - 1
      stop = number/3
      c = hinge%freeplay_stiffness
      t0 = -c*hinge%rest_angle
      if (side /= 0 .or. .not. hinge%freeplay > 0.0_wp) then
         c = stiffness
         t0 = -c*hinge%rest_angle
         if (hinge%freeplay > 0.0_wp) t0 = t0 - side*(stiffness - hinge%freeplay_stiffness)*hinge%freeplay
      end if
      if (stop == 1 .and. hinge%lower_stop < none_given) call add(hinge%lower_stop)
      if (stop == 2 .and. hinge%upper_stop < none_given) call add(hinge%upper_stop)

   contains

      subroutine add(angle)
         real(wp), intent(in) :: angle
         c = c + hinge%stop_stiffness
         t0 = t0 - hinge%stop_stiffness*angle
      end subroutine add

   end subroutine law_of

   !> Energy of a hinge, whichever law holds: the spring's moment integrated from its rest angle, and that of stops.
   pure real(wp) function energy_of(hinge, stiffness, theta) result(energy)
      type(hinge_config), intent(in) :: hinge
      real(wp), intent(in) :: stiffness, theta
      real(wp) :: e, beyond

      e = abs(theta - hinge%rest_angle)
      beyond = max(e - hinge%freeplay, 0.0_wp)
      energy = 0.5_wp*stiffness*beyond**2 + hinge%freeplay_stiffness*(0.5_wp*min(e, hinge%freeplay)**2 + hinge%freeplay*beyond)
      if (hinge%lower_stop < none_given) &
         energy = energy + 0.5_wp*hinge%stop_stiffness*max(hinge%lower_stop - theta, 0.0_wp)**2
      if (hinge%upper_stop < none_given) &
         energy = energy + 0.5_wp*hinge%stop_stiffness*max(theta - hinge%upper_stop, 0.0_wp)**2
   end function energy_of

   !> x <- a^-1 x, a of at most three rows; some joints' columns are far smaller than others, so rows change places.
   subroutine eliminate(a, x)
      real(wp), intent(inout) :: a(:, :), x(:)
      real(wp) :: row(size(x)), last
      integer :: i, j, k, n

      n = size(x)
      do k = 1, n
         j = k - 1 + maxloc(abs(a(k:, k)), dim=1)
         row = a(k, :)
         a(k, :) = a(j, :)
         a(j, :) = row
         last = x(k)
         x(k) = x(j)
         x(j) = last
         do i = 1, n
            if (i == k) cycle
            x(i) = x(i) - a(i, k)/a(k, k)*x(k)
            a(i, :) = a(i, :) - a(i, k)/a(k, k)*a(k, :)
         end do
      end do
      x = [(x(k)/a(k, k), k=1, n)]
   end subroutine eliminate

   !> Openings of the chords beside the kinks of a case.
   function openings_of(phi, kink) result(opening)
      real(wp), intent(in) :: phi(:), kink(:)
      real(wp) :: opening(size(phi))
      opening = phi - [0.0_wp, phi(:size(phi) - 1)] - kink
   end function openings_of

   !> A motion at the start of its run.
   subroutine begin(motion, y, config, error)
      type(motion_type), intent(out) :: motion
      real(wp), allocatable, intent(out) :: y(:)
      type(case_config), intent(in) :: config
      type(error_type), allocatable, intent(out) :: error
      type(scene_type) :: scene

      call new_scene(scene, config, error)
      if (.not. allocated(error)) call new_motion(motion, scene, .true., error)
      if (allocated(error)) return
      call initial_state(motion, config%initial, y)
      call motion%begin_regime(0.0_wp, 0.5_wp, 1.0_wp, y, error)
   end subroutine begin

   !> Joints and energy of a motion against the least energy.
   subroutine compare(motion, y, theta, energy, name, error)
      type(motion_type), intent(in) :: motion
      real(wp), intent(in) :: y(:), theta(:), energy
      character(len=*), intent(in) :: name
      type(error_type), allocatable, intent(out) :: error
      type(invariants_type) :: values
      real(wp), dimension(size(theta)) :: found, rate

      call motion%dynamics%hinge_rotations(y(:motion%n_q), y(motion%n_q + 1:), found, rate)
      call check_close(error, found, theta, close_enough, name//': joints')
      values = state_invariants(motion, y)
      if (.not. allocated(error)) call check_close(error, values%elastic, energy, close_enough*(1.0_wp + energy), name//': energy')
   end subroutine compare

   subroutine test_start(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(motion_type) :: motion
      real(wp), allocatable :: y(:), opening(:), theta(:)
      real(wp) :: energy
      integer :: i

      call seed_random(41)
      do i = 1, 400
         call random_rods(config, 1 + mod(i, 3), exact=mod(i, 2) == 0)
         call begin(motion, y, config, error)
         if (allocated(error)) return
         opening = openings_of(config%initial%phi, config%chain%kink)
         theta = opening
         call least_energy(config, opening, config%hinges%held, opening, theta, energy)
         call compare(motion, y, theta, energy, 'start', error)
         if (allocated(error)) return
      end do
   end subroutine test_start

   !> At 0.5 s hinges are released and, in some scenes, the last kink steps if it is undamped: `energy_dissipated` is what the first
   !> loses, `work_external` what the second does. Damped joints (exact) do not jump.
   subroutine test_jumps(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(motion_type) :: motion
      real(wp), allocatable :: y(:), opening(:), theta(:), shifted(:)
      real(wp) :: energy(3)
      logical, allocatable :: given(:)
      logical :: steps
      integer :: i, n, released

      call seed_random(42)
      do i = 1, 400
         n = 1 + mod(i, 3)
         call random_rods(config, n, exact=mod(i, 2) == 0)
         steps = mod(i/6, 2) == 0 .and. .not. config%chain%hinge_damping(n - 1) > 0.0_wp .and. .not. config%hinges(n)%held
         if (steps) config%kink_programs = [kink_config(hinge=n - 1, law='ramp', t_start=0.5_wp, t_end=0.5_wp, value=0.3_wp)]
         call begin(motion, y, config, error)
         if (allocated(error)) return
         opening = openings_of(config%initial%phi, config%chain%kink)
         theta = opening
         call least_energy(config, opening, config%hinges%held, opening, theta, energy(1))
         call motion%begin_regime(0.5_wp, 1.0_wp, 1.0_wp, y, error)
         if (allocated(error)) return
         given = config%chain%hinge_damping > 0.0_wp
         call least_energy(config, opening, given, (theta), theta, energy(2))
         energy(3) = energy(2)
         shifted = opening
         if (steps) shifted(n) = shifted(n) - 0.3_wp
         if (steps) call least_energy(config, shifted, given, (theta), theta, energy(3))
         call compare(motion, y, theta, energy(3), 'after the jump', error)
         if (allocated(error)) return
         released = count(config%hinges%held)
         associate (last => motion%n_controlled, tolerance => close_enough*(1.0_wp + maxval(energy)))
            call check_close(error, y(last + 1:), [energy(3) - energy(2), energy(1) - energy(2)], tolerance, 'work and loss')
            call check(error, count(motion%events%log(:motion%events%n_logged)%kind == kind_released), released, 'releases')
            if (allocated(error)) return
            if (released > 0) call check_close(error, motion%events%log(released)%energy_lost, energy(1) - energy(2), tolerance, &
                                               'loss with the event')
            if (allocated(error)) return
         end associate
      end do
   end subroutine test_jumps

   !> Reduced dampers: in every row the joints, as the slopes show them, are those of least energy; energy balances.
   subroutine test_runs(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: run
      real(wp), allocatable :: opening(:), theta(:), found(:)
      logical, allocatable :: held(:)
      real(wp), parameter :: times(7) = [0.0_wp, 0.2_wp, 0.4_wp, 0.6_wp, 0.8_wp, 0.9_wp, 1.0_wp]
      real(wp) :: energy
      integer :: i, j

      call seed_random(43)
      do i = 1, 60
         call random_rods(config, 1 + mod(i, 3), exact=.false.)
         config%chain%hinge_damping = 0.3_wp
         call integrate(config, times, run, error)
         if (allocated(error)) return
         do j = 1, size(times)
            associate (row => run%rows(j))
               opening = openings_of(row%phi, config%chain%kink)
               held = config%hinges%held .and. times(j) < 0.5_wp
               theta = opening
               call least_energy(config, opening, held, openings_of(config%initial%phi, config%chain%kink), theta, energy)
               found = (row%phi + row%alpha) - config%chain%kink
               found(2:) = found(2:) - (row%phi(:size(found) - 1) + row%beta(:size(found) - 1))
               call check_close(error, found, theta, close_enough, 'joints')
               call check_close(error, row%energy_elastic, energy, close_enough*(1.0_wp + energy), 'elastic energy')
               call check(error, row%energy_dissipated >= 0.0_wp, 'dissipated energy below zero')
               call check_close(error, row%work_external, 0.0_wp, 0.0_wp, 'work of no loads')
               call check_close(error, row%energy_residual, 0.0_wp, 1.0e-7_wp*run%initial_energy, 'residual')
               if (allocated(error)) return
            end associate
         end do
      end do
   end subroutine test_runs

   !> With friction and damped stops, in motion, massless rods with both kinds of dampers and rigid ones: where all margins are
   !> positive the laws are those that hold together, since there is only one answer.
   subroutine test_long_chains(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(motion_type) :: motion
      real(wp), allocatable :: y(:), margins(:)
      integer :: i, k, n

      call seed_random(44)
      do i = 1, 300
         n = 1 + mod(i, 30)
         call random_rods(config, n, exact=mod(i, 3) == 1)
         if (mod(i, 3) == 2) config%model%bending = 'rigid'
         config%chain%hinge_damping = config%chain%hinge_damping + 0.1_wp
         do k = 1, n
            config%initial%phi_rate(k) = uniform(-2.0_wp, 2.0_wp)
            if (config%hinges(k)%held) config%initial%phi_rate(k) = sum(config%initial%phi_rate(max(1, k - 1):k - 1))
            config%hinges(k)%stop_damping = max(0.0_wp, uniform(-1.0_wp, 2.0_wp))
            if (.not. config%hinges(k)%stop_stiffness > 0.0_wp) config%hinges(k)%stop_damping = 0.0_wp
            if (uniform(0.0_wp, 1.0_wp) < 0.5_wp) cycle
            config%hinges(k)%friction_moment = 10.0_wp**uniform(-1.0_wp, 2.0_wp)
            config%hinges(k)%friction_velocity = 10.0_wp**uniform(-3.0_wp, 0.0_wp)
         end do
         call begin(motion, y, config, error)
         if (allocated(error)) return
         margins = spread(0.0_wp, 1, motion%n_events)
         call motion%event_functions(0.0_wp, y, margins)
         call check(error, all(margins >= 0.0_wp), 'a law is broken at the start')
         if (.not. allocated(error)) call motion%begin_regime(0.5_wp, 1.0_wp, 1.0_wp, y, error)
         if (allocated(error)) return
         call motion%event_functions(0.5_wp, y, margins)
         call check(error, all(margins >= 0.0_wp), 'a law is broken after the release')
         if (allocated(error)) return
      end do
   end subroutine test_long_chains

   !> One rod, hinge 0 with more than a spring.
   subroutine one_hinge(config, bending_stiffness, stiffness, hinge)
      type(case_config), intent(out) :: config
      real(wp), intent(in) :: bending_stiffness, stiffness
      type(hinge_config), intent(in) :: hinge
      call massless_rods(config, [bending_stiffness], [stiffness])
      config%hinges = [hinge]
   end subroutine one_hinge

   !> 100 (th - 0.2) = 100 (0.4 - th): th = 0.3 at the start, below the latch at 0.35, and phi' < 0.
   subroutine test_latch_side(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: run

      call one_hinge(config, 100.0_wp/3.0_wp, 100.0_wp, hinge_config(freeplay=0.2_wp, latch_angle=0.35_wp))
      config%initial%phi = 0.4_wp
      config%initial%phi_rate = -0.5_wp
      call integrate(config, [0.0_wp, 0.6_wp], run, error)
      if (allocated(error)) return
      call check_close(error, run%rows(1)%phi(1) + run%rows(1)%alpha(1), 0.3_wp, 1.0e-14_wp, 'joint at the start')
      call check(error, all(run%events(:run%n_events)%kind /= 2), 'latched')
      call check_close(error, run%rows(2)%phi(1), -0.298_wp, 5.0e-4_wp, 'phi')
   end subroutine test_latch_side

   !> 300 (th + 0.45) + 1e4 (th + 0.1) + 300 th = 0.
   subroutine test_beyond_stop(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: run
      integer :: i

      do i = 1, 2
         call one_hinge(config, 100.0_wp, 300.0_wp, &
                        hinge_config(rest_angle=-0.5_wp, freeplay=0.05_wp, lower_stop=-0.1_wp, stop_stiffness=1.0e4_wp))
         config%chain%hinge_damping = 1.0_wp
         if (i == 2) config%model%dampers = 'exact'
         call integrate(config, [0.0_wp, 0.1_wp], run, error)
         if (allocated(error)) return
         call check_close(error, run%rows(1)%alpha(1), -1135.0_wp/10600.0_wp, 1.0e-13_wp, 'balance')
         call check(error, all(run%rows%energy_dissipated >= 0.0_wp), 'dissipated energy below zero')
         call check_close(error, run%rows(2)%energy_residual, 0.0_wp, 1.0e-8_wp*run%initial_energy, 'residual')
         if (allocated(error)) return
      end do
   end subroutine test_beyond_stop

   !> Released at 0.1, a damped joint creeps to 0.025 and latches at 0.05: D th' = 100 (0.1 - th) - 300 th while phi has hardly
   !> moved, so after about D/400 log(0.075/0.025) s.
   subroutine test_held_latch_side(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: run

      call one_hinge(config, 100.0_wp/3.0_wp, 300.0_wp, hinge_config(held=.true., release_time=0.05_wp, latch_angle=0.05_wp))
      config%model%dampers = 'exact'
      config%chain%hinge_damping = 5.0_wp
      config%initial%phi = 0.1_wp
      call integrate(config, [0.0_wp, 0.05_wp, 0.3_wp], run, error)
      if (allocated(error)) return
      call check(error, run%n_events == 2 .and. &
                 all(run%events(:2)%kind == [kind_released, kind_latched]), 'released and latched')
      call check(error, run%events(2)%time - 0.05_wp > 0.005_wp .and. run%events(2)%time - 0.05_wp < 0.03_wp, 'time of the latch')
      call check_close(error, run%rows(3)%phi(1) + run%rows(3)%alpha(1), 0.05_wp, 1.0e-9_wp, 'latched angle')
   end subroutine test_held_latch_side

   !> Held at 0.1, above the stop at 0.06: 300 0.1^2/2 J. Released, 300 th + 1000 (th - 0.06) = 100 (0.1 - th): th = 0.05, 0.55 J.
   subroutine test_held_stop(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: run

      call one_hinge(config, 100.0_wp/3.0_wp, 300.0_wp, &
                     hinge_config(held=.true., release_time=0.05_wp, lower_stop=0.06_wp, stop_stiffness=1.0e3_wp))
      config%initial%phi = 0.1_wp
      call integrate(config, [0.0_wp, 0.049_wp, 0.1_wp], run, error)
      if (allocated(error)) return
      call check_close(error, run%rows(1)%energy_elastic, 1.5_wp, 1.0e-13_wp, 'held')
      call check_close(error, run%events(1)%energy_lost, 0.95_wp, 1.0e-8_wp, 'lost')
      call check_close(error, run%rows%work_external, [0.0_wp, 0.0_wp, 0.0_wp], 0.0_wp, 'work of no loads')
   end subroutine test_held_stop

   !> Undamped, the joint that is held at 0.1 and balanced at 0.025 jumps past its latch at 0.05: it stays there, with
   !> 300 0.05^2/2 + 100 0.05^2/2 = 0.5 J of the 1.5 J. Another hinge that waits for it is released.
   subroutine test_jump_to_latch(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: run

      call massless_rods(config, [100.0_wp/3.0_wp, 100.0_wp/3.0_wp], [300.0_wp, 300.0_wp])
      config%initial%phi = 0.1_wp
      config%hinges = [hinge_config(held=.true., release_time=0.05_wp, latch_angle=0.05_wp), &
                       hinge_config(hinge=1, held=.true., release_after=0)]
      call integrate(config, [0.0_wp, 0.3_wp], run, error)
      if (allocated(error)) return
      call check(error, run%n_events == 3 .and. &
                 all(run%events(:3)%kind == [kind_released, kind_latched, kind_released]), 'released, latched, released')
      call check_close(error, run%events(:3)%time, spread(0.05_wp, 1, 3), 0.0_wp, 'at once')
      call check_close(error, run%rows(2)%phi(1) + run%rows(2)%alpha(1), 0.05_wp, 1.0e-12_wp, 'latched angle')
      call check(error, all(run%events(:3)%energy_lost >= 0.0_wp) .and. run%events(1)%energy_lost > 0.5_wp, 'loss of the release')
      call check_close(error, run%rows(2)%energy_residual, 0.0_wp, 1.0e-8_wp, 'residual')
   end subroutine test_jump_to_latch

   !> 50 th = 300 (-0.3 - th): 0.5 50 0.2571^2 + 0.5 300 0.0429^2 = 1.9286 J. Programs that
   !> begin before the run, too.
   subroutine test_constant_program(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: run
      type(kink_config) :: program
      real(wp) :: phi
      integer :: i

      do i = 1, 4
         call massless_rods(config, [100.0_wp], [50.0_wp])
         config%model%dampers = 'exact'
         config%chain%hinge_damping = 5.0_wp
         program%law = 'ramp'
         program%value = 0.3_wp
         select case (i)
         case (2)
            program%law = 'table'
            program%value = 0.0_wp
            program%times = [-1.0_wp, 1.0_wp]
            program%values = [0.3_wp, 0.3_wp]
         case (3)
            deallocate (program%times, program%values)
            program%t_start = -2.0_wp
            program%t_end = -1.0_wp
         case (4) ! 0.3 rad at t = 0, and hardly more at 0.02 s
            program%t_start = -1.0e6_wp
            program%t_end = 1.0_wp
         case default
            continue
         end select
         if (i == 1) config%chain%kink = 0.3_wp
         if (i > 1) config%kink_programs = [program]
         if (i == 3) config%hinges = [hinge_config(hinge=0)]
         call integrate(config, [0.0_wp, 0.02_wp], run, error)
         if (allocated(error)) return
         call check_close(error, run%rows(1)%energy_elastic, 13.5_wp/7.0_wp, 1.0e-5_wp, 'energy')
         if (allocated(error)) return
         if (i == 1) phi = run%rows(2)%phi(1)
         call check_close(error, run%rows(2)%phi(1), phi, merge(1.0e-7_wp, 1.0e-10_wp, i == 4), 'phi')
         if (allocated(error)) return
      end do
      call check_close(error, phi, 0.001705_wp, 5.0e-7_wp, 'phi')
   end subroutine test_constant_program

   !> Held at 0 under a load across the rod, the joint of the bent rod jumps past a stop when it is released: with o = phi,
   !> 100 o^2/2 before and, in the stop at 0.01, 300 th + 1000 (th - 0.01) = 100 (o - th). The work of F is F l sin(phi). In the
   !> second run the load ends at that time.
   subroutine test_release_books(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: run
      real(wp) :: th, loss
      integer :: i

      do i = 1, 2
         call one_hinge(config, 100.0_wp/3.0_wp, 300.0_wp, &
                        hinge_config(held=.true., release_time=0.1_wp, upper_stop=0.01_wp, stop_stiffness=1.0e3_wp))
         deallocate (config%loads)
         allocate (config%loads(1))
         config%loads(1)%target = 'node'
         config%loads(1)%node = 1
         config%loads(1)%component = 'Y'
         config%loads(1)%value = 40.0_wp
         config%loads(1)%t_end = merge(0.1_wp, 1.0_wp, i == 2)
         call integrate(config, [0.0_wp, 0.05_wp, 0.1_wp, 0.15_wp, 0.2_wp], run, error)
         if (allocated(error)) return
         associate (phi => run%rows(3)%phi(1))
            th = (100.0_wp*phi + 10.0_wp)/1400.0_wp
            loss = 50.0_wp*phi**2 - (150.0_wp*th**2 + 500.0_wp*(th - 0.01_wp)**2 + 50.0_wp*(phi - th)**2)
            call check(error, all(kind_names(run%events(:2)%kind) == [character(len=16) :: 'released', 'at_upper_stop']), &
                       'released, and at the upper stop')
            call check_close(error, run%events(:2)%energy_lost, [loss, 0.0_wp], 1.0e-10_wp, 'loss')
            call check_close(error, loss, 0.1324_wp, 5.0e-5_wp, 'loss by hand')
            call check_close(error, run%rows(4)%energy_dissipated, loss, 1.0e-10_wp, 'dissipated')
            call check_close(error, run%rows%work_external, &
                             40.0_wp*sin([run%rows(1)%phi, run%rows(2)%phi, run%rows(3)%phi, &
                                          merge(phi, run%rows(4)%phi, i == 2), merge(phi, run%rows(5)%phi, i == 2)]), &
                             1.0e-8_wp, 'work of the load')
            if (allocated(error)) return
         end associate
      end do
   end subroutine test_release_books

   !> A rigid rod at rest with an undamped stop at 0.1: its kink steps by -0.3, which puts the joint 0.2 into the stop, and back
   !> at the same state. Work is what springs hold, and nothing is lost.
   subroutine test_step_at_stop(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(motion_type) :: motion
      real(wp), allocatable :: y(:)
      integer :: bending

      do bending = 1, 2
         call one_hinge(config, 1000.0_wp, 10.0_wp, hinge_config(upper_stop=0.1_wp, stop_stiffness=1.0e3_wp))
         if (bending == 1) config%model%bending = 'rigid'
         config%kink_programs = [kink_config(law='ramp', t_start=0.5_wp, t_end=0.5_wp, value=-0.3_wp), &
                                 kink_config(law='ramp', t_start=0.7_wp, t_end=0.7_wp, value=0.3_wp)]
         call begin(motion, y, config, error)
         if (.not. allocated(error)) call motion%begin_regime(0.5_wp, 0.7_wp, 1.0_wp, y, error)
         if (allocated(error)) return
         associate (last => motion%n_controlled)
            if (bending == 1) then
               call check_close(error, y(last + 1), 0.5_wp*10.0_wp*0.3_wp**2 + 0.5_wp*1000.0_wp*0.2_wp**2, 1.0e-12_wp, 'work')
               if (allocated(error)) return
            end if
            call check(error, y(last + 1) > 1.0_wp, 'hardly any work')
            call check_close(error, y(last + 2), 0.0_wp, 0.0_wp, 'lost into the stop')
            if (allocated(error)) return
            call motion%begin_regime(0.7_wp, 1.0_wp, 1.0_wp, y, error)
            if (allocated(error)) return
            call check_close(error, y(last + 1:), [0.0_wp, 0.0_wp], 1.0e-12_wp, 'work and loss there and back')
            call check(error, motion%events%n_logged, 2, 'events')
            if (allocated(error)) return
         end associate
      end do
   end subroutine test_step_at_stop

   !> Two panels, each released at its own time, on a heavy spacecraft: the first one has latched when the second is released.
   subroutine test_two_panels(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: run

      call two_panels(config)
      call integrate(config, [0.0_wp, 5.0_wp, 8.0_wp, 12.0_wp], run, error)
      if (allocated(error)) return
      call check(error, run%n_events == 4 .and. &
                 all(run%events(:4)%kind == [kind_released, kind_latched, kind_released, kind_latched]), &
                 'released and latched, twice')
      call check(error, all(run%events(:4)%hinge == [0, 0, 1, 1]), 'one after the other')
      call check_close(error, [run%rows(2)%phi(1), run%rows(3)%phi(1), run%rows(4)%phi(1)], [0.0_wp, 0.0_wp, 0.0_wp], 1.0e-9_wp, &
                       'phi_1')
      call check_close(error, run%events(1)%energy_lost, 0.0_wp, 0.0_wp, 'a release of rigid rods')
   end subroutine test_two_panels

   subroutine two_panels(config)
      type(case_config), intent(out) :: config

      call allocate_case(config, 2)
      config%spacecraft%mass = 200.0_wp
      config%spacecraft%inertia = 60.0_wp
      config%spacecraft%hinge_x = 0.6_wp
      config%model%bending = 'rigid'
      config%chain%length = 1.5_wp
      config%chain%mass_per_length = 2.0_wp
      config%chain%bending_stiffness = 1.0_wp
      config%chain%hinge_stiffness = 2.0_wp
      config%initial%phi = [1.6_wp, -1.2_wp]
      config%t_end = 12.0_wp
      allocate (config%kink_programs(0))
      allocate (config%hinges(2))
      config%hinges(1) = hinge_config(hinge=0, held=.true., release_time=1.0_wp, rest_angle=-0.3_wp, latch_angle=0.0_wp)
      config%hinges(2) = hinge_config(hinge=1, held=.true., release_time=6.0_wp, rest_angle=0.3_wp, latch_angle=0.0_wp)
   end subroutine two_panels

   !> Switches of a load and a kink after the first panel has latched; by constraint and by a spring; released by time, after
   !> another hinge or at t = 0. Each latches once and stays.
   subroutine test_latched_for_good(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: run
      integer :: i

      do i = 1, 4
         call two_panels(config)
         deallocate (config%loads)
         allocate (config%loads(1))
         config%loads(1)%target = 'spacecraft'
         config%loads(1)%component = 'M'
         config%loads(1)%value = 1.0e-3_wp
         config%loads(1)%t_start = 5.0_wp
         config%loads(1)%t_end = 5.5_wp
         config%kink_programs = [kink_config(hinge=1, law='smooth_step', t_start=5.2_wp, t_end=5.8_wp, value=0.01_wp)]
         select case (i)
         case (2)
            config%hinges%lock_stiffness = 1.0e4_wp
            config%hinges%lock_damping = 300.0_wp
         case (3)
            config%hinges(1)%release_time = 0.0_wp
         case (4)
            config%hinges(2)%release_time = none_given
            config%hinges(2)%release_after = 0
         case default
            continue
         end select
         call integrate(config, [0.0_wp, 12.0_wp], run, error)
         if (allocated(error)) return
         call check(error, count(run%events(:run%n_events)%kind == kind_released), merge(1, 2, i == 3), 'releases')
         call check(error, count(run%events(:run%n_events)%kind == kind_latched), 2, 'latches')
         call check_close(error, run%rows(2)%phi, [0.0_wp, 0.01_wp], merge(2.0e-3_wp, 1.0e-9_wp, i == 2), 'angles')
         if (allocated(error)) return
      end do
   end subroutine test_latched_for_good

   !> th - 0.1 = -+0.2 sin 5 t for J = 1, C = 25: back at the latch after pi/5 s, where J 1^2/2 is lost; not when a load is switched
   !> in between. Held there and released, a damped hinge goes to its rest angle and never comes back.
   subroutine test_from_latch(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: run
      integer :: i

      do i = 1, 3
         call one_hinge(config, 1.0_wp, 25.0_wp, hinge_config(rest_angle=0.1_wp, latch_angle=0.1_wp))
         config%model%bending = 'rigid'
         config%chain%mass_per_length = 0.0_wp
         config%initial%phi = 0.1_wp
         config%initial%phi_rate = real(2*i - 3, wp)
         deallocate (config%loads)
         allocate (config%loads(1))
         config%loads(1)%target = 'node'
         config%loads(1)%node = 1
         config%loads(1)%component = 'Y'
         config%loads(1)%t_start = 0.2_wp
         config%loads(1)%t_end = 0.3_wp
         if (i == 3) then
            config%initial%phi_rate = 0.0_wp
            config%chain%hinge_damping = 8.0_wp
            config%hinges = [hinge_config(held=.true., release_time=0.1_wp, rest_angle=-0.3_wp, latch_angle=0.1_wp)]
         end if
         call integrate(config, [0.0_wp, 0.9_wp], run, error)
         if (allocated(error)) return
         call check(error, run%n_events, 1, 'events')
         call check(error, run%events(1)%kind, merge(kind_released, kind_latched, i == 3), 'kind of the event')
         if (allocated(error)) return
         if (i == 3) call check(error, run%rows(2)%phi(1) < -0.2_wp, 'hardly a motion')
         if (i < 3) call check_close(error, [run%events(1)%time, run%events(1)%energy_lost, run%rows(2)%phi(1)], &
                                     [acos(-1.0_wp)/5.0_wp, 0.5_wp, 0.1_wp], 1.0e-8_wp, 'latch')
         if (allocated(error)) return
      end do
   end subroutine test_from_latch

end module test_balance
