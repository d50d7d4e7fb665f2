!> Condensed rods: inertia along rods that bend by statics, docs/model.md sec. 5.
module test_condensed
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type
   use rodyn_case_config, only: case_config, hinge_config, kink_config
   use rodyn_case_reader, only: read_case
   use rodyn_frequencies, only: natural_frequencies
   use rodyn_motion, only: motion_type
   use rodyn_scene, only: scene_type, new_scene
   use test_motions, only: check_jacobian, motion_of
   use test_random_scenes, only: allocate_case, n_all_kinds, random_case, seed_random, uniform
   use test_testing, only: unittest, new_test, check, check_close
   use test_trajectories, only: trajectory, integrate
   implicit none (type, external)
   private
   public :: collect_condensed

   integer, parameter :: dynamic = 1, condensed = 2, lumped = 3

contains

   subroutine collect_condensed(suite)
      type(unittest), allocatable, intent(out) :: suite(:)
      suite = [new_test('condensed rods: angles of table 1 as another code has them, by every kernel', test_table1), &
               new_test('condensed rods are fifty times closer to the dynamic chain than lumped ones', test_distance), &
               new_test('condensed rods have the slow modes of the dynamic chain', test_slow_modes), &
               new_test('stiffer condensed rods tend to rigid rods, like 1/EI', test_rigid_limit), &
               new_test('condensed rods: energy balances with springs at an angle, friction, held hinges, driven kinks', &
                        test_hinges)]
   end subroutine collect_condensed

   !> The scene of table 1 with consistent equations.
   subroutine table1(config, which, error)
      type(case_config), intent(out) :: config
      integer, intent(in) :: which
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: text

      call read_case('cases/table1.nml', config, text, error)
      if (allocated(error)) return
      config%model%formulation = 'consistent'
      if (which /= dynamic) config%model%bending = 'quasistatic'
      if (which == lumped) config%model%inertia = 'lumped'
      config%output%ledger = .false.
      config%solver%method = 'dop853'
      config%solver%rtol = 1.0e-11_wp
      config%solver%atol = 1.0e-13_wp
   end subroutine table1

   !> Numbers of a program that evaluates the kinetic energy by quadrature and forms T^T M T.
   subroutine test_table1(error)
      type(error_type), allocatable, intent(out) :: error
      character(len=9), parameter :: kernels(*) = ['recursive', 'assembled']
      type(case_config) :: config
      type(trajectory) :: motion
      integer :: i

      do i = 1, size(kernels)
         call table1(config, condensed, error)
         if (allocated(error)) return
         config%model%kernel = kernels(i)
         call integrate(config, [0.5_wp, 1.0_wp], motion, error)
         if (allocated(error)) return
         call check_close(error, motion%rows(1)%phi, [-0.0319968809_wp, 0.0119165993_wp, 0.1037901148_wp, 0.1781743924_wp], &
                          1.0e-10_wp, 'phi(0.5 s)')
         if (allocated(error)) return
         call check_close(error, [motion%rows(2)%phi, motion%rows(2)%rotation], [0.0448258593_wp, 0.1872736232_wp, &
                          0.3712504048_wp, 0.4865986720_wp, 3.8209395553_wp], 1.0e-10_wp, 'phi, theta(1 s)')
         if (allocated(error)) return
      end do
   end subroutine test_table1

   !> The dynamic chain vibrates by itself, so distances are not compared where lumped rods happen to pass it.
   subroutine test_distance(error)
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: times(*) = [0.25_wp, 0.5_wp, 0.75_wp]
      type(case_config) :: config
      type(trajectory) :: motion(3)
      integer :: i, which

      do which = dynamic, lumped
         call table1(config, which, error)
         if (.not. allocated(error)) call integrate(config, times, motion(which), error)
         if (allocated(error)) return
      end do
      do i = 1, size(times)
         call check(error, 50.0_wp*distance(condensed) < distance(lumped), 'condensed rods are too far from the dynamic chain')
         if (allocated(error)) return
      end do

   contains

      real(wp) function distance(which)
         integer, intent(in) :: which
         distance = maxval(abs(motion(which)%rows(i)%phi - motion(dynamic)%rows(i)%phi))
      end function distance

   end subroutine test_distance

   !> What the slopes' own inertia does to the slow modes is of second order in slow over fast frequencies.
   subroutine test_slow_modes(error)
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: of_chain(:), found(:)
      real(wp) :: off(4)
      integer :: k

      call frequencies(dynamic, of_chain, error)
      if (.not. allocated(error)) call frequencies(condensed, found, error)
      if (allocated(error)) return
      call check(error, size(found), 7, 'degrees of freedom')
      if (allocated(error)) return
      off = found(4:7)/of_chain(4:7) - 1.0_wp
      do k = 1, 4 ! a constraint raises frequencies
         call check(error, off(k) >= 0.0_wp .and. off(k) < (of_chain(3 + k)/of_chain(8))**2, 'a slow mode is off')
         if (allocated(error)) return
      end do
      call frequencies(lumped, found, error)
      if (allocated(error)) return
      call check(error, all(50.0_wp*off < abs(found(4:7)/of_chain(4:7) - 1.0_wp)), 'lumped rods are as good')
   end subroutine test_slow_modes

   subroutine frequencies(which, frequency, error)
      integer, intent(in) :: which
      real(wp), allocatable, intent(out) :: frequency(:)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(scene_type) :: scene

      call table1(config, which, error)
      if (.not. allocated(error)) call new_scene(scene, config, error)
      if (.not. allocated(error)) &
         call natural_frequencies(scene, scene%hinges, spread(0.0_wp, 1, scene%n_dof), frequency, error)
   end subroutine frequencies

   !> Differences of the chord angles from those of rigid rods, three stiffnesses a decade apart.
   subroutine test_rigid_limit(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: rigid, bent
      real(wp) :: difference(3)
      integer :: i

      call table1(config, condensed, error)
      if (allocated(error)) return
      config%model%bending = 'rigid'
      call integrate(config, [0.3_wp], rigid, error)
      if (allocated(error)) return
      config%model%bending = 'quasistatic'
      do i = 1, 3
         config%chain%bending_stiffness = 10.0_wp**(i + 6)
         call integrate(config, [0.3_wp], bent, error)
         if (allocated(error)) return
         difference(i) = norm2(bent%rows(1)%phi - rigid%rows(1)%phi)
      end do
      call check_close(error, difference(:2)/difference(2:), [10.0_wp, 10.0_wp], 0.2_wp, 'ratio of differences')
   end subroutine test_rigid_limit

   !> Work of loads and drives less what dampers and friction take is what the energy gains; the Jacobian is that of differences.
   subroutine test_hinges(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(motion_type) :: motion
      type(trajectory) :: run
      real(wp), allocatable :: y(:)
      real(wp) :: scale
      integer :: which, n

      call seed_random(3)
      do which = n_all_kinds - 1, n_all_kinds
         do n = 1, 4
            call many_hinges(config, which, n)
            call motion_of(motion, y, config, error)
            if (allocated(error)) return
            call motion%begin_regime(0.0_wp, 1.0_wp, 1.0_wp, y, error)
            if (allocated(error)) return
            call check_jacobian(motion, y, 'with all hinges', error)
            if (.not. allocated(error)) call check_newton(motion, y, error)
            if (allocated(error)) return
            call integrate(config, [0.0_wp, 0.3_wp, 0.7_wp, 1.0_wp], run, error)
            if (allocated(error)) return
            scale = maxval(run%rows%energy_kinetic + run%rows%energy_elastic) + maxval(abs(run%rows%work_external))
            call check_close(error, run%rows%energy_residual/scale, spread(0.0_wp, 1, 4), 1.0e-9_wp, 'energy residual')
            if (allocated(error)) return
         end do
      end do
   end subroutine test_hinges

   !> The O(n) solution of a Newton system fits the equations with the Jacobian.
   subroutine check_newton(motion, y, error)
      type(motion_type), intent(inout) :: motion
      real(wp), contiguous, intent(in) :: y(:)
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: gamma = 1.0e-2_wp
      real(wp) :: jac(size(y), size(y))
      real(wp), dimension(size(y)) :: right, x, residual
      logical :: ok
      integer :: i

      right = [(uniform(-1.0_wp, 1.0_wp), i=1, size(y))]
      x = right
      call motion%factorise_newton(0.3_wp, y, gamma, .true., ok)
      call check(error, ok, 'not factored')
      if (allocated(error)) return
      call motion%solve_newton(x)
      call motion%jacobian(0.3_wp, y, jac, ok)
      residual = right - x + gamma*matmul(jac, x)
      associate (last => motion%n_controlled)
         residual = abs(residual)/(abs(right) + abs(x) + gamma*matmul(abs(jac), abs(x)))
         call check(error, maxval(residual(:last)) < 1.0e-9_wp, 'the solution of a Newton system is off')
      end associate
   end subroutine check_newton

   !> Driven kinks at the first and the last hinge, which has a spring at an angle and friction; the one before it is held.
   subroutine many_hinges(config, which, n)
      type(case_config), intent(out) :: config
      integer, intent(in) :: which, n
      type(hinge_config) :: hinge

      call random_case(config, which, n)
      config%initial%phi = 0.1_wp*config%initial%phi
      config%initial%phi_rate = 0.1_wp*config%initial%phi_rate
      config%solver%rtol = 1.0e-11_wp
      config%solver%atol = 1.0e-12_wp
      allocate (config%kink_programs(2), config%hinges(min(n, 2)))
      config%kink_programs(1) = kink_config(hinge=0, law='smooth_step', t_start=0.1_wp, t_end=0.9_wp, value=0.4_wp)
      config%kink_programs(2)%hinge = n - 1
      config%kink_programs(2)%law = 'table'
      config%kink_programs(2)%times = [0.0_wp, 0.4_wp, 1.0_wp]
      config%kink_programs(2)%values = [0.0_wp, 0.2_wp, -0.1_wp]
      hinge%hinge = n - 1
      hinge%rest_angle = 0.2_wp
      hinge%friction_moment = 5.0_wp
      hinge%friction_velocity = 0.05_wp
      config%hinges(1) = hinge
      if (n == 1) return
      config%initial%phi_rate(max(n - 2, 1):n - 1) = 0.0_wp
      config%hinges(2)%hinge = n - 2
      config%hinges(2)%held = .true.
   end subroutine many_hinges

end module test_condensed
