!> The article's scene against the numbers of docs/accuracy.md, found by two other codes.
module test_article
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type
   use rodyn_case_config, only: case_config
   use rodyn_case_reader, only: read_case
   use rodyn_scene, only: scene_type, new_scene
   use rodyn_frequencies, only: natural_frequencies
   use test_testing, only: unittest, new_test, check, check_close
   use test_trajectories, only: trajectory, integrate
   implicit none (type, external)
   private
   public :: collect_article

contains

   subroutine collect_article(suite)
      type(unittest), allocatable, intent(out) :: suite(:)
      suite = [new_test('table 1: phi_4 and alpha_1'' at 1, 2 and 30 s by adams', test_tables, long=.true.), &
               new_test('table 1: phi_4 and alpha_1'' at 1 and 2 s by erk, dop853 and gauss', test_explicit), &
               new_test('table 1: phi_4 and alpha_1'' at 1 s by bdf and the assembled kernel', test_bdf), &
               new_test('table 1 with the consistent formulation', test_consistent), &
               new_test('table 1 with rods that keep their arcs', test_inextensible), &
               new_test('table 1 with the printed inputs, both formulations', test_printed_inputs), &
               new_test('natural frequencies to five digits', test_frequencies), &
               new_test('example of figures 3 and 4 has the velocities, rotation and deflection of the figures', test_example), &
               new_test('BEAM reproduces the eight published values to eight digits', test_beam), &
               new_test('more outputs do not change the states', test_outputs)]
   end subroutine collect_article

   subroutine read_table1(config, error)
      type(case_config), intent(out) :: config
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: text
      call read_case('cases/table1.nml', config, text, error)
      if (allocated(error)) return
      config%output%ledger = .false.
      config%solver%method = 'adams'
      config%solver%rtol = 1.0e-13_wp
      config%solver%atol = 1.0e-14_wp
   end subroutine read_table1

   !> Compare phi_4 and alpha_1' at each time.
   subroutine compare(config, times, phi_4, alpha_1_rate, phi_tolerance, alpha_tolerance, error)
      type(case_config), intent(in) :: config
      real(wp), intent(in) :: times(:), phi_4(:), alpha_1_rate(:), phi_tolerance(:), alpha_tolerance(:)
      type(error_type), allocatable, intent(out) :: error
      type(trajectory) :: motion
      integer :: i

      call integrate(config, times, motion, error)
      if (allocated(error)) return
      do i = 1, size(times)
         call check_close(error, motion%rows(i)%phi(4), phi_4(i), phi_tolerance(i), 'phi_4')
         if (allocated(error)) return
         call check_close(error, motion%rows(i)%alpha_rate(1), alpha_1_rate(i), alpha_tolerance(i), "alpha_1'")
         if (allocated(error)) return
      end do
   end subroutine compare

   subroutine test_tables(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      call read_table1(config, error)
      if (allocated(error)) return
      call compare(config, [1.0_wp, 2.0_wp, 30.0_wp], &
                   [0.491356055226_wp, 0.413506393534_wp, 0.01360950381_wp], &
                   [0.394155296535_wp, -0.6967200449_wp, -0.3051786_wp], &
                   [1.0e-10_wp, 1.0e-10_wp, 1.0e-8_wp], [1.0e-8_wp, 1.0e-8_wp, 1.0e-5_wp], error)
   end subroutine test_tables

   subroutine test_explicit(error)
      type(error_type), allocatable, intent(out) :: error
      character(len=6), parameter :: methods(3) = [character(len=6) :: 'erk', 'dop853', 'gauss']
      type(case_config) :: config
      integer :: i
      call read_table1(config, error)
      if (allocated(error)) return
      do i = 1, size(methods)
         config%solver%method = methods(i)
         call compare(config, [1.0_wp, 2.0_wp], [0.491356055226_wp, 0.413506393534_wp], &
                      [0.394155296535_wp, -0.6967200449_wp], [1.0e-10_wp, 1.0e-10_wp], [1.0e-8_wp, 1.0e-8_wp], error)
         if (allocated(error)) return
      end do
   end subroutine test_explicit

   subroutine test_bdf(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      call read_table1(config, error)
      if (allocated(error)) return
      config%solver%method = 'bdf'
      config%model%kernel = 'assembled'
      config%solver%rtol = 1.0e-12_wp
      config%solver%atol = 1.0e-13_wp
      call compare(config, [1.0_wp], [0.491356055226_wp], [0.394155296535_wp], [1.0e-10_wp], [1.0e-8_wp], error)
   end subroutine test_bdf

   subroutine test_consistent(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      call read_table1(config, error)
      if (allocated(error)) return
      config%model%formulation = 'consistent'
      call compare(config, [1.0_wp], [0.491413987956_wp], [0.393106808075_wp], [1.0e-10_wp], [1.0e-10_wp], error)
   end subroutine test_consistent

   !> Against a program that sums over points of the rods and keeps every term; three shapes to its 1e-8.
   subroutine test_inextensible(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      call read_table1(config, error)
      if (allocated(error)) return
      config%model%formulation = 'inextensible'
      call compare(config, [1.0_wp], [0.4927116501_wp], [0.3931272191_wp], [1.0e-9_wp], [2.0e-8_wp], error)
      if (allocated(error)) return
      config%model%bending_shapes = 3
      config%model%gauss_points = 5
      call compare(config, [1.0_wp], [0.493784597_wp], [0.0_wp], [1.0e-8_wp], [huge(1.0_wp)], error) ! no rate of it is known
   end subroutine test_inextensible

   subroutine test_printed_inputs(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      call read_table1(config, error)
      if (allocated(error)) return
      config%chain%mass_per_length = 1.696_wp
      config%chain%bending_stiffness = 1.374e4_wp
      config%spacecraft%inertia = 10.0_wp
      call compare(config, [1.0_wp], [0.490686561498_wp], [0.394929881642_wp], [1.0e-10_wp], [1.0e-10_wp], error)
      if (allocated(error)) return
      config%model%formulation = 'consistent'
      call compare(config, [1.0_wp], [0.490744772958_wp], [0.393923621956_wp], [1.0e-10_wp], [1.0e-10_wp], error)
   end subroutine test_printed_inputs

   subroutine test_frequencies(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(scene_type) :: scene
      real(wp), allocatable :: frequency(:)
      ! The last one was handed down as 2820.4; a brute-force mass matrix in double precision gives 2820.789 as well.
      real(wp), parameter :: expected(12) = [12.665_wp, 29.634_wp, 64.694_wp, 109.807_wp, 466.93_wp, 573.07_wp, &
                                             729.55_wp, 883.28_wp, 2059.6_wp, 2267.4_wp, 2564.5_wp, 2820.8_wp]
      call read_table1(config, error)
      if (.not. allocated(error)) call new_scene(scene, config, error)
      if (allocated(error)) return
      call natural_frequencies(scene, scene%hinges, spread(0.0_wp, 1, scene%n_dof), frequency, error)
      if (allocated(error)) return
      call check_close(error, frequency(1:3), [0.0_wp, 0.0_wp, 0.0_wp], 1.0e-3_wp, 'rigid-body frequencies')
      if (allocated(error)) return
      ! Half a unit of the fifth digit.
      call check_close(error, frequency(4:15)/expected, spread(1.0_wp, 1, 12), 4.0e-5_wp, 'frequency ratio')
   end subroutine test_frequencies

   subroutine test_example(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: motion
      character(len=:), allocatable :: text
      integer :: i, k
      real(wp) :: deflection

      call read_case('cases/example.nml', config, text, error)
      if (allocated(error)) return
      call integrate(config, [(0.01_wp*i, i=0, 200)], motion, error)
      if (allocated(error)) return
      do i = 1, 201
         associate (row => motion%rows(i))
            call check(error, max(abs(row%velocity_x), abs(row%velocity_y)) < 4.0_wp, 'velocity outside figure 3')
            if (allocated(error)) return
         end associate
      end do
      call check_close(error, motion%rows(201)%rotation, 14.8_wp, 0.05_wp, 'rotation at the end of figure 3')
      if (allocated(error)) return
      deflection = 0.0_wp
      associate (row => motion%rows(41)) ! t = 0.4 s; v = s (1 - x)^2 alpha - (s^2/l)(1 - x) beta, x = s/l
         do k = 1, 4
            do i = 1, 99
               associate (x => 0.01_wp*i)
                  deflection = max(deflection, abs(1.5_wp*(x*(1 - x)**2*row%alpha(k) - x**2*(1 - x)*row%beta(k))))
               end associate
            end do
         end do
      end associate
      call check_close(error, deflection, 0.015_wp, 0.0005_wp, 'largest deflection at 0.4 s')
   end subroutine test_example

   !> IVP test set, Mazzia & Magherini.
   subroutine test_beam(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: motion
      character(len=:), allocatable :: text
      integer, parameter :: rods(4) = [1, 10, 20, 40]
      real(wp), parameter :: phi(4) = [-0.5792366591285007e-2_wp, -0.9119134654647947e-1_wp, -0.1483595472463012_wp, &
                                       -0.1767201761075488_wp]
      real(wp), parameter :: phi_rate(4) = [0.3747362681329794e-1_wp, 0.598760970262427_wp, 0.9868747821728363_wp, &
                                            1.186724615113034_wp]

      call read_case('cases/beam.nml', config, text, error)
      if (allocated(error)) return
      config%solver%method = 'dop853'
      config%solver%rtol = 1.0e-13_wp
      config%solver%atol = 1.0e-15_wp
      call integrate(config, [5.0_wp], motion, error)
      if (allocated(error)) return
      call check_close(error, motion%rows(1)%phi(rods)/phi, spread(1.0_wp, 1, 4), 0.5e-8_wp, 'angle ratio')
      if (allocated(error)) return
      call check_close(error, motion%rows(1)%phi_rate(rods)/phi_rate, spread(1.0_wp, 1, 4), 0.5e-8_wp, 'rate ratio')
   end subroutine test_beam

   !> The article varied the output step and saw its integrator's error stay the same.
   subroutine test_outputs(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: few, many
      character(len=6), parameter :: methods(5) = [character(len=6) :: 'adams', 'bdf', 'erk', 'dop853', 'gauss']
      integer :: i, m

      call read_table1(config, error)
      if (allocated(error)) return
      config%solver%rtol = 1.0e-6_wp
      config%solver%atol = 1.0e-8_wp
      do m = 1, size(methods)
         config%solver%method = methods(m)
         call integrate(config, [0.2_wp], few, error)
         if (allocated(error)) return
         call integrate(config, [(0.2_wp*(i/500.0_wp), i=0, 500)], many, error)
         if (allocated(error)) return
         call check_close(error, many%rows(501)%phi, few%rows(1)%phi, 0.0_wp, methods(m)//': phi')
         if (allocated(error)) return
         call check_close(error, many%rows(501)%alpha_rate, few%rows(1)%alpha_rate, 0.0_wp, methods(m)//": alpha'")
         if (allocated(error)) return
      end do
   end subroutine test_outputs

end module test_article
