!> What every motion must keep: momenta, energy, symmetries, limits.
module test_invariants
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type
   use rodyn_case_config, only: case_config, load_config
   use rodyn_case_reader, only: read_case
   use rodyn_scene, only: scene_type, new_scene
   use rodyn_frequencies, only: natural_frequencies
   use test_testing, only: unittest, new_test, check, check_close
   use rodyn_motion, only: motion_type, new_motion, initial_state
   use test_random_scenes, only: allocate_case, random_case, seed_random, kind_name, n_all_kinds
   use test_trajectories, only: trajectory, integrate
   implicit none (type, external)
   private
   public :: collect_invariants

   real(wp), parameter :: pi = acos(-1.0_wp)

contains

   subroutine collect_invariants(suite)
      type(unittest), allocatable, intent(out) :: suite(:)
      suite = [new_test('free flight for 100 periods keeps momenta and energy', test_free_flight, long=.true.), &
               new_test('ledger balances to 1e-9 under loads, damping and kinks', test_ledger), &
               new_test('a mirrored scene gives the mirrored motion', test_mirror, long=.true.), &
               new_test('a scene turned within the spacecraft gives the turned motion', test_turn, long=.true.), &
               new_test('exact dampers of quasistatic rods tend to reduced ones like D^2', test_exact_dampers), &
               new_test('a strongly damped massless rod decays as its closed form', test_relaxation), &
               new_test('stiffer rods tend to rigid rods, like 1/EI', test_rigid_limit), &
               new_test('a run with a ledger makes the steps of one without', test_ledger_is_silent)]
   end subroutine collect_invariants

   !> cases/free_flight.nml, with the bounds that the case promises.
   subroutine test_free_flight(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(scene_type) :: scene
      type(trajectory) :: motion
      character(len=:), allocatable :: text
      real(wp), allocatable :: frequency(:)
      real(wp) :: momentum(2), scale
      integer :: i

      call read_case('cases/free_flight.nml', config, text, error)
      if (.not. allocated(error)) call new_scene(scene, config, error)
      if (.not. allocated(error)) call natural_frequencies(scene, scene%hinges, [0.0_wp, 0.0_wp, 0.0_wp, config%initial%phi, &
                                                                   spread(0.0_wp, 1, 12)], frequency, error)
      if (allocated(error)) return
      call check(error, config%t_end*frequency(4)/(2.0_wp*pi) >= 100.0_wp, 'the case lasts less than 100 periods')
      if (.not. allocated(error)) call integrate(config, [(config%t_end*(i/50.0_wp), i=0, 50)], motion, error)
      if (allocated(error)) return
      associate (first => motion%rows(1))
         momentum = [first%momentum_x, first%momentum_y]
         scale = norm2(momentum)
         do i = 2, size(motion%rows)
            associate (row => motion%rows(i))
               call check_close(error, [row%momentum_x, row%momentum_y]/scale, momentum/scale, 1.0e-13_wp, 'momentum')
               if (allocated(error)) return
               call check_close(error, row%angular_momentum/first%angular_momentum, 1.0_wp, 1.0e-11_wp, 'angular momentum')
               if (allocated(error)) return
               call check_close(error, row%energy_residual/(first%energy_kinetic + first%energy_elastic), 0.0_wp, &
                                1.0e-10_wp, 'energy')
               if (allocated(error)) return
            end associate
         end do
      end associate
   end subroutine test_free_flight

   !> Every kind of scene that has an energy, with loads on spacecraft and nodes, dampers and kinks.
   subroutine test_ledger(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: motion
      character(len=6), parameter :: methods(4) = [character(len=6) :: 'adams', 'erk', 'dop853', 'gauss']
      integer :: which, i

      call seed_random(11)
      do which = 1, n_all_kinds
         if (index(kind_name(which), 'paper distributed dynamic') > 0) cycle ! its equations have no energy
         call random_case(config, which, 3)
         config%chain%hinge_damping = 0.5_wp
         config%chain%kink = [0.2_wp, -0.1_wp, 0.3_wp]
         config%loads(2)%t_end = 0.21_wp
         config%solver%method = methods(1 + mod(which, size(methods)))
         if (index(kind_name(which), 'exact') > 0) config%solver%method = 'dop853'
         config%solver%rtol = 1.0e-12_wp
         config%solver%atol = 1.0e-12_wp
         call integrate(config, [(0.05_wp*i, i=0, 10)], motion, error)
         if (allocated(error)) return
         do i = 1, size(motion%rows)
            associate (row => motion%rows(i))
               call check_close(error, row%energy_residual/(row%energy_kinetic + row%energy_elastic), 0.0_wp, 1.0e-9_wp, &
                                kind_name(which)//' by '//config%solver%method)
               if (allocated(error)) return
               call check(error, i == 1 .or. (abs(row%work_external) > 1.0e-3_wp .and. row%energy_dissipated > 1.0e-3_wp), &
                          kind_name(which)//': nothing to balance')
               if (allocated(error)) return
            end associate
         end do
      end do
   end subroutine test_ledger

   !> `paper` bears small deflections only. Explicit methods bear no joints between massless rods that settle within 1e-8 s: trial
   !> steps would overflow.
   subroutine suit_method(config)
      type(case_config), intent(inout) :: config
      if (config%model%bending == 'quasistatic') then
         config%chain%hinge_damping = config%chain%hinge_damping + 0.5_wp
      else
         config%chain%bending_stiffness = 100.0_wp*config%chain%bending_stiffness
      end if
   end subroutine suit_method

   !> y -> -y turns all angles, Y and M round.
   subroutine test_mirror(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config, mirrored
      type(trajectory) :: motion, image
      integer :: which

      call seed_random(12)
      do which = 1, n_all_kinds
         call random_case(config, which, 3)
         call suit_method(config)
         config%solver%rtol = 1.0e-10_wp
         config%solver%atol = 1.0e-12_wp
         mirrored = config
         mirrored%spacecraft%hinge_y = -config%spacecraft%hinge_y
         mirrored%chain%kink = -config%chain%kink
         mirrored%initial%phi = -config%initial%phi
         mirrored%initial%alpha = -config%initial%alpha
         mirrored%initial%beta = -config%initial%beta
         mirrored%initial%bubble = -config%initial%bubble
         mirrored%initial%bubble_rate = -config%initial%bubble_rate
         mirrored%initial%phi_rate = -config%initial%phi_rate
         mirrored%initial%alpha_rate = -config%initial%alpha_rate
         mirrored%initial%beta_rate = -config%initial%beta_rate
         mirrored%initial%velocity_y = -config%initial%velocity_y
         mirrored%initial%omega = -config%initial%omega
         mirrored%initial%displacement_y = -config%initial%displacement_y
         mirrored%initial%rotation = -config%initial%rotation
         where (mirrored%loads%component /= 'X') mirrored%loads%value = -mirrored%loads%value
         call integrate(config, [0.2_wp], motion, error)
         if (.not. allocated(error)) call integrate(mirrored, [0.2_wp], image, error)
         if (allocated(error)) return
         associate (row => motion%rows(1), other => image%rows(1))
            call check_close(error, [other%phi, other%alpha, other%beta, other%phi_rate, other%velocity_x, &
                                     other%velocity_y, other%omega, other%rotation], &
                             [-row%phi, -row%alpha, -row%beta, -row%phi_rate, row%velocity_x, -row%velocity_y, &
                              -row%omega, -row%rotation], 1.0e-13_wp*maxval(abs(row%phi_rate)), kind_name(which))
            if (allocated(error)) return
         end associate
      end do
   end subroutine test_mirror

   !> Turning hinge 0, the chain (a kink at hinge 0 holds the turn) and the loads by an angle about C turns V and u. Hinges
   !> are soft and little wound, so that the motion is not chaotic: in 54 such scenes a disturbance by 1e-13 grew a thousandfold
   !> at most, and turned scenes differed by 7e-11.
   subroutine test_turn(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config, turned
      type(trajectory) :: motion, image
      type(load_config), allocatable :: loads(:)
      real(wp), parameter :: angle = 0.7_wp
      integer :: which, i

      call seed_random(13)
      do which = 1, n_all_kinds
         call random_case(config, which, 3)
         config%solver%rtol = 1.0e-13_wp
         config%solver%atol = 1.0e-14_wp
         config%loads%law = 'constant'
         config%loads%rate = 0.0_wp
         call suit_method(config)
         config%chain%hinge_stiffness = 0.1_wp*config%chain%hinge_stiffness
         config%initial%phi = 0.25_wp*config%initial%phi
         turned = config
         call turn(config%spacecraft%hinge_x, config%spacecraft%hinge_y, turned%spacecraft%hinge_x, turned%spacecraft%hinge_y)
         call turn(config%initial%velocity_x, config%initial%velocity_y, turned%initial%velocity_x, turned%initial%velocity_y)
         call turn(config%initial%displacement_x, config%initial%displacement_y, turned%initial%displacement_x, &
                   turned%initial%displacement_y)
         turned%chain%kink(0) = config%chain%kink(0) + angle
         turned%initial%phi = config%initial%phi + angle
         ! Each force along x or y becomes two.
         allocate (loads(0))
         do i = 1, size(config%loads)
            loads = [loads, config%loads(i)]
            if (config%loads(i)%component == 'M') cycle
            loads = [loads, config%loads(i)]
            associate (x => loads(size(loads) - 1), y => loads(size(loads)))
               x%component = 'X'
               y%component = 'Y'
               if (config%loads(i)%component == 'X') then
                  call turn(config%loads(i)%value, 0.0_wp, x%value, y%value)
               else
                  call turn(0.0_wp, config%loads(i)%value, x%value, y%value)
               end if
            end associate
         end do
         call move_alloc(loads, turned%loads)
         call integrate(config, [0.2_wp], motion, error)
         if (.not. allocated(error)) call integrate(turned, [0.2_wp], image, error)
         if (allocated(error)) return
         associate (row => motion%rows(1), other => image%rows(1))
            call check_close(error, [other%phi - angle, other%alpha, other%phi_rate, other%omega, other%rotation, &
                                     other%energy_kinetic/row%energy_kinetic], &
                             [row%phi, row%alpha, row%phi_rate, row%omega, row%rotation, 1.0_wp], &
                             1.0e-9_wp*max(1.0_wp, maxval(abs(row%phi_rate))), kind_name(which))
            if (allocated(error)) return
         end associate
      end do

   contains

      subroutine turn(x, y, xt, yt)
         real(wp), intent(in) :: x, y
         real(wp), intent(out) :: xt, yt
         xt = cos(angle)*x - sin(angle)*y
         yt = sin(angle)*x + cos(angle)*y
      end subroutine turn

   end subroutine test_turn

   !> The reduced treatment is accurate to (D w/C)^2: a tenth of D, a hundredth of the difference.
   subroutine test_exact_dampers(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: reduced, exact
      real(wp) :: difference(2)
      integer :: i

      call seed_random(16)
      call random_case(config, 6, 3)
      config%chain%hinge_stiffness = [3000.0_wp, 2000.0_wp, 1500.0_wp]
      config%chain%bending_stiffness = 800.0_wp
      config%initial%phi = [0.2_wp, 0.3_wp, 0.1_wp]
      config%initial%phi_rate = 0.0_wp
      config%solver%rtol = 1.0e-11_wp
      config%solver%atol = 1.0e-13_wp
      config%loads = config%loads(:0)
      config%chain%hinge_damping = 1.0_wp
      do i = 1, 2
         config%model%dampers = 'reduced'
         call integrate(config, [0.2_wp], reduced, error)
         if (allocated(error)) return
         config%model%dampers = 'exact'
         call integrate(config, [0.2_wp], exact, error)
         if (allocated(error)) return
         difference(i) = norm2(exact%rows(1)%phi - reduced%rows(1)%phi)
         config%chain%hinge_damping = 0.1_wp*config%chain%hinge_damping
      end do
      call check_close(error, log10(difference(1)/difference(2)), 2.0_wp, 0.1_wp, 'order in D')
   end subroutine test_exact_dampers

   !> One massless rod with a tip mass so heavy that it stands still: th relaxes from a disturbed start with the rate
   !> (C + 3 EI/l)/D, the hinge and the bent rod pulling at the damper (T = (phi - th) 3 EI/l).
   subroutine test_relaxation(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(scene_type) :: scene
      type(motion_type) :: motion
      real(wp), allocatable :: y(:), ydot(:)
      real(wp), parameter :: c = 50.0_wp, d = 7.0_wp, ei = 20.0_wp, l = 1.5_wp, phi = 0.2_wp, theta = 0.05_wp
      logical :: ok

      call allocate_case(config, 1)
      config%spacecraft%motion = 'fixed'
      config%model%inertia = 'lumped'
      config%model%bending = 'quasistatic'
      config%model%dampers = 'exact'
      config%chain%length = l
      config%chain%node_mass = 3.0_wp
      config%chain%bending_stiffness = ei
      config%chain%hinge_stiffness = c
      config%chain%hinge_damping = d
      config%initial%phi = phi
      call new_scene(scene, config, error)
      if (.not. allocated(error)) call new_motion(motion, scene, .false., error)
      if (allocated(error)) return
      call motion%dynamics%set_regime(0.0_wp, 1.0_wp)
      call initial_state(motion, config%initial, y)
      call check_close(error, y(2), phi*3.0_wp*ei/l/(c + 3.0_wp*ei/l), 1.0e-15_wp, 'th in balance')
      if (allocated(error)) return
      y(2) = theta
      allocate (ydot(size(y)))
      call motion%rhs(0.0_wp, y, ydot, ok)
      call check_close(error, ydot, [0.0_wp, ((phi - theta)*3.0_wp*ei/l - c*theta)/d, &
                                     -(phi - theta)*3.0_wp*ei/l/(3.0_wp*l**2)], 1.0e-13_wp, 'rates')
   end subroutine test_relaxation

   !> Differences of the chord angles from those of rigid rods, three stiffnesses a decade apart.
   subroutine test_rigid_limit(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: rigid, flexible
      real(wp) :: difference(3)
      integer :: i

      call seed_random(14)
      call random_case(config, 1, 3)
      config%chain%bending_stiffness = 1.0e5_wp
      config%chain%hinge_stiffness = 500.0_wp
      config%initial%alpha = 0.0_wp
      config%initial%beta = 0.0_wp
      config%initial%alpha_rate = 0.0_wp
      config%initial%beta_rate = 0.0_wp
      config%initial%phi = [0.1_wp, 0.2_wp, 0.1_wp]
      config%solver%rtol = 1.0e-10_wp
      config%solver%atol = 1.0e-13_wp
      config%model%bending = 'rigid'
      call integrate(config, [0.3_wp], rigid, error)
      if (allocated(error)) return
      config%model%bending = 'dynamic'
      do i = 1, 3
         call integrate(config, [0.3_wp], flexible, error)
         if (allocated(error)) return
         difference(i) = norm2(flexible%rows(1)%phi - rigid%rows(1)%phi)
         config%chain%bending_stiffness = 10.0_wp*config%chain%bending_stiffness
      end do
      call check_close(error, difference(:2)/difference(2:), [10.0_wp, 10.0_wp], 1.5_wp, 'decrease with EI')
   end subroutine test_rigid_limit

   !> The two integrals of the ledger are outside the error norm: no bit of the motion changes.
   subroutine test_ledger_is_silent(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: with, without
      character(len=6), parameter :: methods(5) = [character(len=6) :: 'adams', 'bdf', 'erk', 'dop853', 'gauss']
      integer :: i

      call seed_random(15)
      do i = 1, size(methods)
         call random_case(config, 1, 3)
         config%solver%method = methods(i)
         config%output%ledger = .true.
         call integrate(config, [0.1_wp], with, error)
         if (allocated(error)) return
         config%output%ledger = .false.
         call integrate(config, [0.1_wp], without, error)
         if (allocated(error)) return
         call check_close(error, [with%rows(1)%phi, with%rows(1)%alpha_rate], &
                          [without%rows(1)%phi, without%rows(1)%alpha_rate], 0.0_wp, methods(i))
         if (allocated(error)) return
      end do
   end subroutine test_ledger_is_silent

end module test_invariants
