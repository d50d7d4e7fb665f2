!> Natural modes by other routes: differences of the right-hand side, closed forms, integration in time.
module test_modes
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type
   use rodyn_case_config, only: case_config, kink_config
   use rodyn_case_reader, only: read_case
   use rodyn_equilibrium, only: find_equilibrium
   use rodyn_lapack, only: dgeev
   use rodyn_linear_model, only: linear_model, new_linear_model
   use rodyn_modes_at_start, only: modes_at_start
   use rodyn_modes, only: mode_set, new_modes, rigid_body, mechanism, oscillation
   use rodyn_motion, only: motion_type, new_motion
   use rodyn_scene, only: scene_type, new_scene
   use test_motions, only: motion_of, eigenvector_error
   use test_random_scenes, only: allocate_case, kind_name, n_all_kinds, random_case, seed_random
   use test_testing, only: check, check_close, new_test, unittest
   use test_trajectories, only: integrate, trajectory
   implicit none (type, external)
   private
   public :: collect_modes

   real(wp), parameter :: rounding = 100.0_wp*epsilon(1.0_wp)

contains

   subroutine collect_modes(suite)
      type(unittest), allocatable, intent(out) :: suite(:)
      suite = [ &
         new_test('modes are eigenvalues of differences of the right-hand side', modes_of_differences), &
         new_test('modes at rest are eigenvalues of differences, too', modes_at_rest), &
         new_test('shapes are eigenvectors of the Jacobian', shapes_of_jacobian), &
         new_test('the twelve frequencies of table 1', table_1), &
         new_test('a rigid rod on a damped hinge is an oscillator', one_rod), &
         new_test('two rigid rods on hinges', two_rods), &
         new_test('a blade on a turning hub stiffens by the centrifugal force', turning_blade), &
         new_test('a thrust along a rod weakens its hinge, up to buckling', buckling), &
         new_test('modes move as the integration in time', integrated_mode), &
         new_test('free hinges are mechanisms, not small frequencies', free_hinges), &
         new_test('a kink that moves later changes no mode at the start', later_kink), &
         new_test('equilibria are at rest', equilibria), &
         new_test('damped motion ends at the equilibrium', damped_motion, long=.true.), &
         new_test('a torque on a free spacecraft leaves no equilibrium', no_equilibrium), &
         new_test('a rod on a hinge without spring rests where it is, or in line with its force', no_stiffness)]
   end subroutine collect_modes

   subroutine modes_of(motion, y, modes, error)
      type(motion_type), intent(inout) :: motion
      real(wp), intent(in) :: y(:)
      type(mode_set), intent(out) :: modes
      type(error_type), allocatable, intent(out) :: error
      type(linear_model) :: model
      call new_linear_model(model, motion, 0.0_wp, y, error)
      if (.not. allocated(error)) call new_modes(modes, model, .true., error)
   end subroutine modes_of

   !> Eigenvalues of the Jacobian by central differences.
   subroutine difference_eigenvalues(motion, y, re, im)
      type(motion_type), intent(inout) :: motion
      real(wp), intent(in) :: y(:)
      real(wp), allocatable, intent(out) :: re(:), im(:)
      real(wp) :: jac(size(y), size(y)), plus(size(y)), minus(size(y)), shifted(size(y)), none(1, 1), work(40*size(y)), step
      logical :: ok
      integer :: j, info

      step = epsilon(1.0_wp)**(1.0_wp/3.0_wp)
      do j = 1, size(y)
         shifted = y
         shifted(j) = y(j) + step
         call motion%rhs(0.0_wp, shifted, plus, ok)
         shifted(j) = y(j) - step
         call motion%rhs(0.0_wp, shifted, minus, ok)
         jac(:, j) = (plus - minus)/(2.0_wp*step)
      end do
      allocate (re(size(y)), im(size(y)))
      call dgeev('N', 'N', size(y), jac, size(y), re, im, none, 1, none, 1, work, size(work), info)
   end subroutine difference_eigenvalues

   !> Every eigenvalue that is no rigid body has its partner, and their number is right.
   subroutine compare(motion, y, name, error)
      type(motion_type), intent(inout) :: motion
      real(wp), intent(in) :: y(:)
      character(len=*), intent(in) :: name
      type(error_type), allocatable, intent(out) :: error
      type(mode_set) :: modes
      real(wp), allocatable :: re(:), im(:), distance(:)
      real(wp) :: tolerance
      integer :: i, expected, found

      call modes_of(motion, y, modes, error)
      if (allocated(error)) return
      call difference_eigenvalues(motion, y, re, im)
      ! Differences are good to about 1e-10 of the largest entries of J, fastest**2, which is 1e-10 fastest in an eigenvalue
      ! of the fast end; ill-conditioned slow ones lose more.
      tolerance = 2.0e-6_wp*max(1.0_wp, modes%fastest)
      allocate (distance(modes%n), source=0.0_wp)
      do i = 1, modes%n
         if (modes%kind(i) == rigid_body .or. modes%kind(i) == mechanism) cycle
         distance(i) = minval(hypot(re - real(modes%eigenvalue(i), wp), im - aimag(modes%eigenvalue(i))))
      end do
      call check(error, maxval(distance) < tolerance, name//': no such eigenvalue of differences')
      if (allocated(error)) return
      associate (b => motion%dynamics%scene%n_base)
         expected = size(y) - 2*b
         found = 2*count(modes%kind == oscillation) + count(modes%kind /= oscillation .and. modes%kind /= mechanism) + &
                 2*count(modes%kind == mechanism)
         if (b > 0) expected = expected + 3 ! the three rigid bodies count once each here
      end associate
      call check(error, abs(found - expected) <= count(modes%kind == mechanism), name//': number of modes')
   end subroutine compare

   !> Turning, bent, loaded, damped, kinked.
   subroutine modes_of_differences(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(motion_type) :: motion
      real(wp), allocatable :: y(:)
      integer :: which, n

      call seed_random(11)
      do which = 1, n_all_kinds
         do n = 1, 6
            call random_case(config, which, n)
            call motion_of(motion, y, config, error, ledger=.false.)
            if (.not. allocated(error)) call compare(motion, y, kind_name(which), error)
            if (allocated(error)) return
         end do
      end do
   end subroutine modes_of_differences

   !> Straight and at rest: with dampers, without, with a steady spin.
   subroutine modes_at_rest(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(motion_type) :: motion
      real(wp), allocatable :: y(:)
      integer :: which, n, variant

      call seed_random(12)
      do which = 1, n_all_kinds
         do variant = 0, 2
            n = 3
            call random_case(config, which, n)
            deallocate (config%loads)
            allocate (config%loads(0))
            config%chain%hinge_stiffness = config%chain%hinge_stiffness + 100.0_wp
            config%chain%kink = 0.0_wp
            config%chain%hinge_damping = merge(0.3_wp, 0.0_wp, variant == 1)
            config%spacecraft%hinge_y = 0.0_wp
            config%initial%phi = 0.0_wp
            config%initial%alpha = 0.0_wp
            config%initial%beta = 0.0_wp
            config%initial%phi_rate = 0.0_wp
            config%initial%alpha_rate = 0.0_wp
            config%initial%beta_rate = 0.0_wp
            config%initial%omega = merge(1.5_wp, 0.0_wp, variant == 2)
            if (config%spacecraft%motion == 'fixed') config%initial%omega = 0.0_wp
            call motion_of(motion, y, config, error, ledger=.false.)
            if (.not. allocated(error)) call compare(motion, y, kind_name(which)//' at rest', error)
            if (allocated(error)) return
         end do
      end do
   end subroutine modes_at_rest

   !> J v = lambda v with v = (x, p), p by the kinematics of the turning axes.
   subroutine shapes_of_jacobian(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(motion_type) :: motion
      type(mode_set) :: modes
      real(wp), allocatable :: y(:), jac(:, :)
      real(wp) :: wrong
      logical :: ok
      integer :: which, n, i

      call seed_random(13)
      do which = 1, n_all_kinds
         do n = 1, 4
            call random_case(config, which, n)
            call motion_of(motion, y, config, error, ledger=.false.)
            if (.not. allocated(error)) call modes_of(motion, y, modes, error)
            if (allocated(error)) return
            if (allocated(jac)) deallocate (jac)
            allocate (jac(motion%n_controlled, motion%n_controlled))
            call motion%jacobian(0.0_wp, y, jac, ok)
            do i = 1, modes%n
               if (abs(modes%eigenvalue(i)) < 1.0e-3_wp) cycle
               wrong = eigenvector_error(motion, jac, y, modes%shape(:, i), modes%eigenvalue(i))
               call check(error, wrong < 1.0e-10_wp, kind_name(which)//': not an eigenvector')
               if (allocated(error)) return
            end do
         end do
      end do
   end subroutine shapes_of_jacobian

   !> Published digits (docs/accuracy.md) of which the last one, 2820.4, is 2820.79.
   subroutine table_1(error)
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: known(12) = [12.665_wp, 29.634_wp, 64.694_wp, 109.807_wp, 466.93_wp, 573.07_wp, 729.55_wp, &
                                          883.28_wp, 2059.6_wp, 2267.4_wp, 2564.5_wp, 2820.79_wp]
      type(case_config) :: config
      type(motion_type) :: motion
      type(linear_model) :: model
      type(mode_set) :: modes
      real(wp), allocatable :: y(:), frequency(:)

      call read_case('cases/table1.nml', config, error=error)
      if (.not. allocated(error)) call motion_of(motion, y, config, error, ledger=.false.)
      if (.not. allocated(error)) call modes_at_start(motion, config, .false., .false., .true., model, modes, error)
      if (allocated(error)) return
      call check(error, modes%n, 15, 'modes')
      call check(error, all(modes%kind(:3) == rigid_body), 'three rigid bodies')
      if (allocated(error)) return
      frequency = modes%frequency()
      call check_close(error, frequency(4:)/known, spread(1.0_wp, 1, 12), 4.0e-5_wp, 'frequencies')
   end subroutine table_1

   !> A fixed chain of rigid, equal, uniform rods.
   subroutine rigid_chain(config, n)
      type(case_config), intent(out) :: config
      integer, intent(in) :: n
      call allocate_case(config, n)
      config%spacecraft%motion = 'fixed'
      config%model%bending = 'rigid'
      config%chain%length = 2.0_wp
      config%chain%mass_per_length = 1.5_wp
      config%chain%hinge_stiffness = 300.0_wp
   end subroutine rigid_chain

   !> J x'' + D x' + C x = 0 with J = m l^2/3 + mu l^2, under- and overdamped.
   subroutine one_rod(error)
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: inertia = 1.5_wp*8.0_wp/3.0_wp + 0.7_wp*4.0_wp
      type(case_config) :: config
      type(motion_type) :: motion
      type(mode_set) :: modes
      real(wp), allocatable :: y(:)
      real(wp) :: omega, d

      call rigid_chain(config, 1)
      config%chain%node_mass = 0.7_wp
      omega = sqrt(300.0_wp/inertia)
      config%chain%hinge_damping = 2.0_wp*0.03_wp*omega*inertia
      call motion_of(motion, y, config, error, ledger=.false.)
      if (.not. allocated(error)) call modes_of(motion, y, modes, error)
      if (allocated(error)) return
      call check_close(error, [modes%frequency(), modes%damping_ratio()], [omega, 0.03_wp], rounding*omega, 'underdamped')
      call check_close(error, abs(modes%shape(1, 1)), 1.0_wp/sqrt(inertia), rounding, 'normalisation')
      if (allocated(error)) return
      config%chain%hinge_damping = 2.0_wp*1.25_wp*omega*inertia
      call motion_of(motion, y, config, error, ledger=.false.)
      if (.not. allocated(error)) call modes_of(motion, y, modes, error)
      if (allocated(error)) return
      d = sqrt(1.25_wp**2 - 1.0_wp)
      call check_close(error, -real(modes%eigenvalue, wp), [1.25_wp - d, 1.25_wp + d]*omega, 10*rounding*omega, 'overdamped')
   end subroutine one_rod

   !> Small motions: M = m l^3 ((4/3, 1/2), (1/2, 1/3)), K = C ((2, -1), (-1, 1)).
   subroutine two_rods(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(motion_type) :: motion
      type(mode_set) :: modes
      real(wp), allocatable :: y(:)
      real(wp) :: half, root

      call rigid_chain(config, 2)
      call motion_of(motion, y, config, error, ledger=.false.)
      if (.not. allocated(error)) call modes_of(motion, y, modes, error)
      if (allocated(error)) return
      ! (7/36) z^2 - 3 z + 1 = 0, z = w^2 m l^3/C
      half = 54.0_wp/7.0_wp
      root = sqrt(half**2 - 36.0_wp/7.0_wp)
      call check_close(error, modes%frequency()**2*12.0_wp/300.0_wp, [half - root, half + root], 100*rounding, 'frequencies')
   end subroutine two_rods

   !> On a hub too heavy to answer, at radius r and spin w: omega^2 = C/J + w^2 r S/J, S = m l^2/2.
   subroutine turning_blade(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(motion_type) :: motion
      type(mode_set) :: modes
      real(wp), allocatable :: y(:)
      real(wp) :: spin
      integer :: i

      do i = 0, 3
         spin = 7.0_wp*i
         call rigid_chain(config, 1)
         config%spacecraft%motion = 'free'
         config%spacecraft%mass = 1.0e9_wp
         config%spacecraft%inertia = 1.0e9_wp
         config%spacecraft%hinge_x = 0.8_wp
         config%initial%omega = spin
         call motion_of(motion, y, config, error, ledger=.false.)
         if (.not. allocated(error)) call modes_of(motion, y, modes, error)
         if (allocated(error)) return
         call check(error, modes%n, 4, 'modes')
         call check(error, modes%kind(3) == rigid_body, 'the spin itself is a rigid body')
         call check_close(error, abs(modes%eigenvalue(4))**2, 300.0_wp/4.0_wp + spin**2*0.8_wp*3.0_wp/4.0_wp, &
                          1.0e-6_wp*(1.0_wp + spin**2), 'frequency')
         call check_close(error, real(modes%eigenvalue(4), wp), 0.0_wp, 1.0e-10_wp, 'no decay')
         if (allocated(error)) return
      end do
   end subroutine turning_blade

   !> A force P towards the hinge: omega^2 = (C - P l)/J; beyond P = C/l the straight rod falls over.
   subroutine buckling(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(motion_type) :: motion
      type(mode_set) :: modes
      real(wp), allocatable :: y(:)

      call rigid_chain(config, 1)
      deallocate (config%loads)
      allocate (config%loads(1))
      config%loads(1)%target = 'node'
      config%loads(1)%node = 1
      config%loads(1)%component = 'X'
      config%loads(1)%value = -75.0_wp
      call motion_of(motion, y, config, error, ledger=.false.)
      if (.not. allocated(error)) call modes_of(motion, y, modes, error)
      if (allocated(error)) return
      call check_close(error, modes%eigenvalue(1)%im, sqrt(150.0_wp/4.0_wp), 10*rounding, 'half the load')
      if (allocated(error)) return
      config%loads(1)%value = -225.0_wp
      call motion_of(motion, y, config, error, ledger=.false.)
      if (.not. allocated(error)) call modes_of(motion, y, modes, error)
      if (allocated(error)) return
      associate (decay => minloc(modes%eigenvalue%re, 1), growth => maxloc(modes%eigenvalue%re, 1))
         call check_close(error, real(modes%eigenvalue([decay, growth]), wp), sqrt(150.0_wp/4.0_wp)*[-1.0_wp, 1.0_wp], &
                          10*rounding, 'beyond')
         call check(error, .not. modes%is_stable(growth) .and. modes%is_stable(decay), 'which is unstable')
      end associate
   end subroutine buckling

   !> A small motion along the real part of a mode of a damped, turning chain, by Runge and Kutta's method over one period:
   !> y(T) = exp(lambda_real T) y(0).
   subroutine integrated_mode(error)
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: n_steps = 20000
      real(wp), parameter :: small = 1.0e-6_wp
      type(case_config) :: config
      type(motion_type) :: motion
      type(linear_model) :: model
      type(mode_set) :: modes
      real(wp), allocatable :: y(:), start(:), at_rest(:), k1(:), k2(:), k3(:), k4(:)
      complex(wp), allocatable :: shape(:)
      complex(wp) :: lambda
      real(wp) :: period, h
      logical :: ok
      integer :: i, r, m

      call allocate_case(config, 2)
      config%spacecraft%mass = 20.0_wp
      config%spacecraft%inertia = 5.0_wp
      config%spacecraft%hinge_x = 0.4_wp
      config%spacecraft%hinge_y = 0.2_wp
      config%chain%length = [1.0_wp, 1.4_wp]
      config%chain%mass_per_length = [1.5_wp, 0.8_wp]
      config%chain%bending_stiffness = 800.0_wp
      config%chain%hinge_stiffness = [200.0_wp, 100.0_wp]
      config%chain%hinge_damping = [1.0_wp, 0.5_wp]
      config%initial%omega = 3.0_wp
      call motion_of(motion, y, config, error, ledger=.false.)
      if (.not. allocated(error)) call find_equilibrium(motion, 0.0_wp, y, error)
      if (.not. allocated(error)) call new_linear_model(model, motion, 0.0_wp, y, error)
      if (.not. allocated(error)) call new_modes(modes, model, .true., error)
      if (allocated(error)) return
      r = motion%n_q
      m = motion%n_dof
      at_rest = y
      lambda = modes%eigenvalue(4)
      shape = modes%shape(:, 4)
      start = small*[real(shape, wp), real(lambda*shape, wp)]
      ! dp of the spacecraft along the turning axes, at u = 0
      start(r + 1:r + 2) = start(r + 1:r + 2) - y(r + 3)*[start(2), -start(1)]
      y = y + start
      period = 2.0_wp*acos(-1.0_wp)/aimag(lambda)
      h = period/n_steps
      allocate (k1(size(y)), k2(size(y)), k3(size(y)), k4(size(y)))
      do i = 1, n_steps
         call motion%rhs(0.0_wp, y, k1, ok)
         call motion%rhs(0.0_wp, y + 0.5_wp*h*k1, k2, ok)
         call motion%rhs(0.0_wp, y + 0.5_wp*h*k2, k3, ok)
         call motion%rhs(0.0_wp, y + h*k3, k4, ok)
         y = y + h/6.0_wp*(k1 + 2.0_wp*(k2 + k3) + k4)
      end do
      ! The chain's own coordinates and rates; terms of second order are about `small` relative.
      associate (c => [[(i, i=4, r)], [(i, i=r + 4, r + m)]])
         call check_close(error, (y(c) - at_rest(c))/maxval(abs(start(c))), &
                          exp(real(lambda, wp)*period)*start(c)/maxval(abs(start(c))), 1.0e-4_wp, 'after one period')
      end associate
      if (allocated(error)) return
      call check(error, exp(real(lambda, wp)*period) < 0.95_wp, 'it decays visibly')
   end subroutine integrated_mode

   subroutine free_hinges(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(motion_type) :: motion
      type(mode_set) :: modes
      real(wp), allocatable :: y(:)
      integer :: damped

      do damped = 0, 1
         call rigid_chain(config, 4)
         config%chain%hinge_stiffness([1, 3]) = 0.0_wp
         config%chain%hinge_damping(1) = real(damped, wp)
         call motion_of(motion, y, config, error, ledger=.false.)
         if (.not. allocated(error)) call modes_of(motion, y, modes, error)
         if (allocated(error)) return
         call check(error, count(modes%kind == mechanism), 2, 'mechanisms')
         call check(error, count(modes%kind == oscillation), 2, 'oscillations')
         call check(error, count(modes%frequency() < 1.0e-3_wp), 2, 'no other small frequency')
         if (allocated(error)) return
      end do
   end subroutine free_hinges

   !> Kinks fold a chain at rest; on a turning spacecraft with the hinge off its axis the right-hand side is zero.
   subroutine later_kink(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(mode_set) :: straight, later, early

      call rigid_chain(config, 2)
      config%chain%kink(:) = [0.5_wp, -0.2_wp]
      config%initial%phi = [0.5_wp, 1.5_wp] ! bent, so that what accelerates it matters
      config%t_end = 10.0_wp
      call find(straight)
      allocate (config%kink_programs(1))
      config%kink_programs(1) = kink_config(hinge=1, t_start=1.0_wp, t_end=2.0_wp, value=0.5_wp)
      if (.not. allocated(error)) call find(later)
      config%kink_programs(1)%t_start = -2.0_wp
      config%kink_programs(1)%t_end = -1.0_wp
      if (.not. allocated(error)) call find(early)
      if (allocated(error)) return
      call check(error, maxval(abs(later%eigenvalue - straight%eigenvalue)) <= 0.0_wp, 'a kink acts before it is there')
      call check(error, maxval(abs(early%eigenvalue - straight%eigenvalue)) > 1.0e-3_wp, 'a kink that is there does not act')

   contains

      subroutine find(modes)
         type(mode_set), intent(out) :: modes
         type(scene_type) :: scene
         type(motion_type) :: motion
         type(linear_model) :: model

         call new_scene(scene, config, error)
         if (.not. allocated(error)) call new_motion(motion, scene, .false., error)
         if (.not. allocated(error)) call modes_at_start(motion, config, .false., .false., .false., model, modes, error)
      end subroutine find

   end subroutine later_kink

   !> Kinks by their angles; then random chains, bent at the start, with and without kinks, turning slowly and fast. Newton's
   !> method alone does not find those of some that turn fast.
   subroutine equilibria(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(motion_type) :: motion
      real(wp), allocatable :: y(:)
      integer, parameter :: n_rods(3) = [3, 4, 4]
      real(wp), parameter :: spin(3) = [1.0_wp, 1.0_wp, 4.0_wp]
      integer :: which, seed, i

      call rigid_chain(config, 3)
      config%chain%kink(:) = [0.5_wp, -0.2_wp, 0.9_wp]
      call motion_of(motion, y, config, error, ledger=.false.)
      if (.not. allocated(error)) call find_equilibrium(motion, 0.0_wp, y, error)
      if (allocated(error)) return
      call check_close(error, y(:3), [0.5_wp, 0.3_wp, 1.2_wp], rounding, 'kinks')
      if (allocated(error)) return
      do seed = 11, 22
         do i = 1, 3
            call seed_random(seed)
            do which = 1, n_all_kinds
               call random_case(config, which, n_rods(i))
               deallocate (config%loads)
               allocate (config%loads(0))
               config%chain%hinge_stiffness = config%chain%hinge_stiffness + 500.0_wp
               config%initial%phi = 0.0_wp
               if (config%spacecraft%motion == 'free') config%initial%omega = spin(i)
               call motion_of(motion, y, config, error, ledger=.false.)
               if (.not. allocated(error)) call find_equilibrium(motion, 0.0_wp, y, error)
               if (.not. allocated(error)) call check_rest(config, y, kind_name(which), error)
               if (allocated(error)) return
            end do
         end do
      end do
   end subroutine equilibria

   !> Neither rates nor, by both kernels, accelerations of the chain, and the spin of the case.
   subroutine check_rest(config, y, name, error)
      type(case_config), intent(in) :: config
      real(wp), contiguous, intent(in) :: y(:)
      character(len=*), intent(in) :: name
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: other
      type(motion_type) :: motion
      real(wp), allocatable :: start(:)
      real(wp) :: rate(size(y))
      logical :: ok
      integer :: i

      other = config
      do i = 1, 2
         other%model%kernel = merge('assembled', 'recursive', i == 1)
         call motion_of(motion, start, other, error, ledger=.false.)
         if (allocated(error)) return
         call motion%rhs(0.0_wp, y, rate, ok)
         associate (r => motion%n_q, m => motion%n_dof, b => motion%dynamics%scene%n_base)
            ok = ok .and. maxval(abs(y(r + b + 1:r + m))) <= 0.0_wp .and. maxval(abs(rate(r + min(b + 1, 3):r + m))) < 1.0e-6_wp
            if (b > 0) ok = ok .and. abs(y(r + 3) - config%initial%omega) <= 0.0_wp
         end associate
         call check(error, ok, name//': not at rest')
         if (allocated(error)) return
      end do
   end subroutine check_rest

   !> Chains with kinks, under forces at their nodes, that come to rest in their dampers.
   subroutine damped_motion(error)
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: kinds(3) = [8, 10, 13] ! fixed: bending rods, rigid rods, massless rods that bend
      type(case_config) :: config
      type(motion_type) :: motion
      type(trajectory) :: settling
      real(wp), allocatable :: y(:)
      integer :: i, seed

      do seed = 1, 2
         call seed_random(seed)
         do i = 1, size(kinds)
            call random_case(config, kinds(i), 3)
            config%loads = config%loads(4:5)
            config%loads%law = 'constant'
            config%loads%rate = 0.0_wp
            config%t_end = 240.0_wp
            config%loads%value = 0.1_wp*config%loads%value
            config%chain%hinge_stiffness = config%chain%hinge_stiffness + 500.0_wp
            config%chain%hinge_damping = 0.5_wp*config%chain%hinge_stiffness
            if (i == 1) config%chain%hinge_damping = 0.2_wp*config%chain%hinge_damping ! or the rods vibrate between stiff dampers
            config%initial%phi = 0.0_wp
            config%initial%phi_rate = 0.0_wp
            config%initial%alpha = 0.0_wp
            config%initial%beta = 0.0_wp
            config%initial%alpha_rate = 0.0_wp
            config%initial%beta_rate = 0.0_wp
            config%solver%method = 'bdf'
            config%solver%rtol = 1.0e-6_wp
            config%solver%atol = 1.0e-8_wp
            call motion_of(motion, y, config, error, ledger=.false.)
            if (.not. allocated(error)) call find_equilibrium(motion, 0.0_wp, y, error)
            if (.not. allocated(error)) call integrate(config, [240.0_wp], settling, error)
            if (allocated(error)) return
            call check(error, maxval(abs(y(:3))) > 0.1_wp, kind_name(kinds(i))//': it begins where it ends')
            call check_close(error, settling%rows(1)%phi, y(:3), 1.0e-8_wp, kind_name(kinds(i)))
            if (allocated(error)) return
         end do
      end do
   end subroutine damped_motion

   !> Without a load any angle of the rod beyond is an equilibrium, so the first one is. A force across it turns it into its
   !> line: then 300 phi_1 = F l cos(phi_1), and phi_2 = pi/2.
   subroutine no_stiffness(error)
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: force = 30.0_wp, start(2) = [0.0_wp, 0.4_wp]
      type(case_config) :: config
      type(motion_type) :: motion
      real(wp), allocatable :: y(:)

      call rigid_chain(config, 2)
      config%chain%hinge_stiffness(1) = 0.0_wp
      config%initial%phi = start
      call motion_of(motion, y, config, error, ledger=.false.)
      if (.not. allocated(error)) call find_equilibrium(motion, 0.0_wp, y, error)
      if (.not. allocated(error)) call check_close(error, y(:2), start, rounding, 'left the equilibrium where it began')
      if (allocated(error)) return
      deallocate (config%loads)
      allocate (config%loads(1))
      config%loads(1)%target = 'node'
      config%loads(1)%node = 2
      config%loads(1)%component = 'Y'
      config%loads(1)%value = force
      call motion_of(motion, y, config, error, ledger=.false.)
      if (.not. allocated(error)) call find_equilibrium(motion, 0.0_wp, y, error)
      if (.not. allocated(error)) call check_close(error, [300.0_wp*y(1), y(2)], &
                                                   [force*2.0_wp*cos(y(1)), 0.5_wp*acos(-1.0_wp)], 1.0e-9_wp, 'in line')
   end subroutine no_stiffness

   subroutine no_equilibrium(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: refusal
      type(case_config) :: config
      type(motion_type) :: motion
      real(wp), allocatable :: y(:)

      call rigid_chain(config, 2)
      config%spacecraft%motion = 'free'
      config%spacecraft%mass = 10.0_wp
      config%spacecraft%inertia = 10.0_wp
      deallocate (config%loads)
      allocate (config%loads(1))
      config%loads(1)%value = 1.0_wp
      call motion_of(motion, y, config, error, ledger=.false.)
      if (allocated(error)) return
      call find_equilibrium(motion, 0.0_wp, y, refusal)
      call check(error, allocated(refusal), 'accepted')
      if (allocated(error)) return
      call check(error, index(refusal%message, 'give the spacecraft an angular acceleration') > 0, refusal%message)
   end subroutine no_equilibrium

end module test_modes
