!> The table of quantities: each is read off a state, into its own place.
module test_quantities
   use rodyn_case_config, only: case_config
   use rodyn_case_reader, only: parse_case
   use rodyn_errors, only: error_type
   use rodyn_kinds, only: wp
   use rodyn_motion, only: initial_state, motion_type, new_motion
   use rodyn_quantities, only: fill_row, layout_of, new_row, resized, row_layout, row_type
   use rodyn_scene, only: new_scene, scene_type
   use test_testing, only: check, check_close, new_test, unittest
   implicit none (type, external)
   private
   public :: collect_quantities

   real(wp), parameter :: exact = 0.0_wp
   character(len=*), parameter :: lf = new_line('a')

   !> Everything differs from zero, and from everything else.
   character(len=*), parameter :: scene_text = &
      "&spacecraft mass = 10, inertia = 3, hinge_x = 0.1 /"//lf// &
      "&chain n_rods = 2, length = 1, mass_per_length = 1, bending_stiffness = 50, hinge_stiffness = 7, hinge_damping = 0.1,"// &
      " kink = 0.25 /"//lf// &
      "&initial phi = 0.2, 0.7, alpha = 0.01, 0.02, beta = 0.03, 0.05, phi_rate = 1, 3, alpha_rate = 0.1, 0.2,"// &
      " beta_rate = 0.3, 0.5, displacement_x = 0.11, displacement_y = 0.12, rotation = 0.13, velocity_x = 0.21,"// &
      " velocity_y = 0.22, omega = 0.23"

contains

   subroutine collect_quantities(suite)
      type(unittest), allocatable, intent(out) :: suite(:)
      suite = [ &
         new_test('each quantity of the table is read off a state', test_all_read), &
         new_test('each number stands under its own name', test_places), &
         new_test('what a scene has not is zero', test_zeros), &
         new_test('rotations of hinges are the openings less the kinks between rods with inertia', test_hinges), &
         new_test('rates of hinges are those of their angles along the motion', test_hinge_rates), &
         new_test('a longer chain has the same quantities, one behind the other', test_resized)]
   end subroutine collect_quantities

   !> The row of the initial state of a scene, and of work and dissipated energy.
   subroutine read_off(text, given, row, error)
      character(len=*), intent(in) :: text
      real(wp), intent(in) :: given !! number that stands in every place before [any unit]
      type(row_type), intent(out) :: row
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(scene_type) :: scene
      type(motion_type) :: motion
      real(wp), allocatable :: y(:)

      call parse_case(text, 'a scene', config, error)
      if (.not. allocated(error)) call new_scene(scene, config, error)
      if (.not. allocated(error)) call new_motion(motion, scene, config%output%ledger, error)
      if (allocated(error)) return
      call initial_state(motion, config%initial, y)
      if (config%output%ledger) y(size(y) - 1:) = [5.0_wp, 6.0_wp]
      row = new_row(layout_of(config))
      call fill_row(motion, 0.0_wp, y, 0.0_wp, row) ! names are compared in the first row alone
      row%values = given
      call fill_row(motion, 1.5_wp, y, 4.0_wp, row)
   end subroutine read_off

   subroutine test_all_read(error)
      type(error_type), allocatable, intent(out) :: error
      type(row_type) :: row
      integer :: i

      call read_off(scene_text//", bubble = 1e-3, 2e-3, bubble_rate = 3e-3, 4e-3 /"//lf// &
                    "&model bending_shapes = 3, gauss_points = 5 /"//lf//"&output loads = .true. /", huge(1.0_wp), row, error)
      if (allocated(error)) return
      call check_close(error, row%time, 1.5_wp, exact, 'time')
      do i = 1, size(row%layout%quantities)
         if (allocated(error)) return
         associate (x => row%layout%quantities(i))
            call check(error, all(abs(row%values(x%first:x%last)) < huge(1.0_wp)), x%name)
         end associate
      end do
   end subroutine test_all_read

   subroutine test_places(error)
      type(error_type), allocatable, intent(out) :: error
      type(row_type) :: row

      call read_off(scene_text//' /', 0.0_wp, row, error)
      call expect('phi', [0.2_wp, 0.7_wp])
      call expect('beta', [0.03_wp, 0.05_wp])
      call expect('alpha_rate', [0.1_wp, 0.2_wp])
      call expect('velocity_y', [0.22_wp])
      call expect('rotation', [0.13_wp])
      call expect('work_external', [5.0_wp])
      call expect('energy_dissipated', [6.0_wp])
      if (allocated(error)) return
      associate (x => row%values, at => row%layout)
         call check_close(error, x(at%before('energy_residual') + 1), &
                          (x(at%before('energy_kinetic') + 1) + x(at%before('energy_elastic') + 1) + 6.0_wp) - (5.0_wp + 4.0_wp), &
                          exact, 'residual')
      end associate

   contains

      subroutine expect(name, values)
         character(len=*), intent(in) :: name
         real(wp), intent(in) :: values(:)
         if (allocated(error)) return
         associate (before => row%layout%before(name))
            call check_close(error, row%values(before + 1:before + size(values)), values, exact, name)
         end associate
      end subroutine expect

   end subroutine test_places

   !> A fixed spacecraft and rigid rods.
   subroutine test_zeros(error)
      type(error_type), allocatable, intent(out) :: error
      type(row_type) :: row

      call read_off("&spacecraft motion = 'fixed' /"//lf//"&chain n_rods = 2, length = 1, mass_per_length = 1,"// &
                    " hinge_stiffness = 7 /"//lf//"&initial phi = 0.2, 0.7, phi_rate = 1, 3 /"//lf// &
                    "&model bending = 'rigid' /"//lf//"&output ledger = .false. /", 0.0_wp, row, error)
      if (allocated(error)) return
      call check(error, size(row%values), 18, 'numbers of a row')
      if (allocated(error)) return
      call check_close(error, row%values, [0.2_wp, 0.7_wp, spread(0.0_wp, 1, 4), 1.0_wp, 3.0_wp, spread(0.0_wp, 1, 10)], exact, &
                       'row')
   end subroutine test_zeros

   subroutine test_hinges(error)
      type(error_type), allocatable, intent(out) :: error
      type(row_type) :: row

      call read_off(scene_text//' /'//lf//'&output loads = .true. /', 0.0_wp, row, error)
      if (allocated(error)) return
      associate (angle => row%layout%before('hinge_angle'), rate => row%layout%before('hinge_rate'))
         call check_close(error, row%values(angle + 1:angle + 2), [0.2_wp + 0.01_wp - 0.25_wp, &
                                                                  (0.7_wp + 0.02_wp) - (0.2_wp + 0.03_wp) - 0.25_wp], &
                          4.0_wp*epsilon(1.0_wp), 'angles')
         if (.not. allocated(error)) call check_close(error, row%values(rate + 1:rate + 2), [1.0_wp + 0.1_wp, &
                                                                  (3.0_wp + 0.2_wp) - (1.0_wp + 0.3_wp)], &
                          4.0_wp*epsilon(4.0_wp), 'rates')
      end associate
   end subroutine test_hinges

   !> By central differences along y' = f, for each kind of rods and dampers; hinge 1 has no damper. Its motion has no frequency
   !> above 1e3 rad/s, so that errors are h^2 w^2/6 and epsilon/h.
   subroutine test_hinge_rates(error)
      type(error_type), allocatable, intent(out) :: error
      character(len=*), parameter :: chain = &
         "&spacecraft mass = 10, inertia = 3, hinge_x = 0.1 /"//lf//"&chain n_rods = 3, length = 1, mass_per_length = 1,"// &
         " bending_stiffness = 50, node_mass = 1, hinge_stiffness = 7, 0, 5, hinge_damping = 0.5, 0, 0.3, kink = 0.25 /"//lf// &
         "&initial phi = 0.2, 0.7, 0.5, phi_rate = 1, 3, 2 /"//lf//"&output loads = .true. /"//lf
      character(len=*), parameter :: kinds(4) = [character(len=80) :: &
         "&model bending = 'rigid' /", "&model bending = 'dynamic' /", "&model inertia = 'lumped', bending = 'quasistatic' /", &
         "&model inertia = 'lumped', bending = 'quasistatic', dampers = 'exact' /"]
      real(wp), parameter :: h = 1.0e-6_wp, tolerance = 2.0e-6_wp
      type(case_config) :: config
      type(scene_type) :: scene
      type(motion_type) :: motion
      type(row_type) :: row
      real(wp), allocatable :: y(:), f(:)
      real(wp) :: angle(3, -1:1), rate(3)
      integer :: k, side
      logical :: ok

      do k = 1, size(kinds)
         call parse_case(chain//trim(kinds(k)), 'a scene', config, error)
         if (.not. allocated(error)) call new_scene(scene, config, error)
         if (.not. allocated(error)) call new_motion(motion, scene, config%output%ledger, error)
         if (allocated(error)) return
         call initial_state(motion, config%initial, y)
         f = y
         call motion%rhs(0.0_wp, y, f, ok)
         call check(error, ok, 'no right-hand side')
         if (allocated(error)) return
         row = new_row(layout_of(config))
         do side = -1, 1
            call fill_row(motion, 0.0_wp, y + side*h*f, 0.0_wp, row)
            associate (before => row%layout%before('hinge_angle'))
               angle(:, side) = row%values(before + 1:before + 3)
            end associate
            associate (before => row%layout%before('hinge_rate'))
               if (side == 0) rate = row%values(before + 1:before + 3)
            end associate
         end do
         call check_close(error, rate, (angle(:, 1) - angle(:, -1))/(2.0_wp*h), tolerance, trim(kinds(k)))
         if (allocated(error)) return
      end do
   end subroutine test_hinge_rates

   subroutine test_resized(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(row_layout) :: layout
      integer :: i, last

      config%chain%n_rods = 3
      layout = resized(layout_of(config), 5)
      last = 0
      do i = 1, size(layout%quantities)
         associate (x => layout%quantities(i))
            call check(error, x%first, last + 1, x%name)
            if (.not. allocated(error)) call check(error, x%last - last, product(layout%row_shape(i)), x%name)
            if (allocated(error)) return
            last = x%last
         end associate
      end do
      call check(error, layout%n_values, last, 'numbers')
   end subroutine test_resized

end module test_quantities
