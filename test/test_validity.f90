!> Tests of the warnings on what the model leaves out.
module test_validity
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type
   use rodyn_case_config, only: case_config
   use rodyn_scene, only: scene_type, new_scene
   use rodyn_quantities, only: layout_of, new_row, row_layout, row_type
   use rodyn_validity, only: validity_type, new_validity, greatest_deflection
   use test_random_scenes, only: allocate_case
   use test_testing, only: unittest, new_test, check, check_close
   implicit none (type, external)
   private
   public :: collect_validity

contains

   subroutine collect_validity(suite)
      type(unittest), allocatable, intent(out) :: suite(:)
      suite = [ &
         new_test('the largest deflection of a cubic, against a fine search', deflection_of_cubics), &
         new_test('a bubble counts as deflection', bubble_deflects), &
         new_test('a rod at the limit of deflection is not warned of, one above it is', limit_of_deflection), &
         new_test('at the default limit the chord is one per cent too long', chord_at_limit), &
         new_test('a rod that swings at 0.4 of its own frequency is not warned of, one at 0.6 is', limit_of_vibration), &
         new_test('a faint vibration of a rod that turns is not warned of', faint_vibration), &
         new_test('rigid rods have no warnings', rigid_rods)]
   end subroutine collect_validity

   subroutine deflection_of_cubics(error)
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: slopes(2, 9) = reshape([ &
         0.1_wp, -0.1_wp, 0.1_wp, 0.1_wp, 0.1_wp, 0.0_wp, 0.0_wp, 0.2_wp, 0.3_wp, -0.6_wp, 0.3_wp, -0.15_wp, &
         1.0e-9_wp, -1.0e-9_wp, 0.0_wp, 0.0_wp, 0.1_wp, -0.1_wp*(1.0_wp + 1.0e-12_wp)], [2, 9])
      integer, parameter :: n = 100000
      real(wp) :: x, found
      integer :: i, j

      do i = 1, size(slopes, 2)
         found = 0.0_wp
         do j = 1, n - 1
            x = real(j, wp)/n
            found = max(found, abs(slopes(1, i)*x*(1.0_wp - x)**2 - slopes(2, i)*x**2*(1.0_wp - x)))
         end do
         call check_close(error, greatest_deflection(slopes(1, i), slopes(2, i)), found, 1.0e-9_wp*sum(abs(slopes(:, i))), &
                          'largest deflection')
         if (allocated(error)) return
      end do
   end subroutine deflection_of_cubics

   !> One rod, 2 m, with its own frequency (pi/2)^2 sqrt(EI/m) = 24.674 rad/s.
   function one_rod(bending, shapes) result(scene)
      character(len=*), intent(in) :: bending
      integer, intent(in), optional :: shapes
      type(scene_type) :: scene
      type(case_config) :: config
      type(error_type), allocatable :: error

      call allocate_case(config, 1)
      config%spacecraft%mass = 10.0_wp
      config%spacecraft%inertia = 10.0_wp
      config%chain%length = 2.0_wp
      config%chain%mass_per_length = 1.0_wp
      config%chain%bending_stiffness = 100.0_wp
      config%chain%hinge_stiffness = 100.0_wp
      config%model%bending = bending
      if (present(shapes)) config%model%bending_shapes = shapes
      config%model%gauss_points = 5
      call new_scene(scene, config, error)
   end function one_rod

   !> Rows of one rod.
   function layout(shapes)
      integer, intent(in), optional :: shapes
      type(row_layout) :: layout
      type(case_config) :: config
      config%chain%n_rods = 1
      if (present(shapes)) config%model%bending_shapes = shapes
      layout = layout_of(config)
   end function layout

   !> Bend the rod to an arc.
   subroutine bend(row, slope, rate)
      type(row_type), intent(inout) :: row
      real(wp), intent(in) :: slope !! at the inner end [rad]
      real(wp), intent(in) :: rate  !! of it [rad/s]
      row%values(row%layout%before('alpha') + 1) = slope
      row%values(row%layout%before('beta') + 1) = -slope
      row%values(row%layout%before('alpha_rate') + 1) = rate
      row%values(row%layout%before('beta_rate') + 1) = -rate
   end subroutine bend

   !> An arc of deflection f l has slopes 4 f.
   subroutine limit_of_deflection(error)
      type(error_type), allocatable, intent(out) :: error
      type(validity_type) :: validity
      type(row_type) :: row

      validity = new_validity(one_rod('dynamic'), layout(), 1, 0.05_wp, 0.01_wp)
      row = new_row(layout())
      call bend(row, 4.0_wp*0.0499_wp, 0.0_wp)
      call validity%observe(row)
      call check(error, validity%warnings(), '', 'below the limit')
      if (allocated(error)) return
      row%time = 2.5_wp
      call bend(row, 4.0_wp*0.0701_wp, 0.0_wp)
      call validity%observe(row)
      call bend(row, 0.0_wp, 0.0_wp)
      call validity%observe(row)
      call check(error, index(validity%warnings(), 'rod 1 bends by 0.07 of its length (t = 2.5 s)') == 1, validity%warnings())
   end subroutine limit_of_deflection

   !> Alone, and against slopes that bend the rod the other way.
   subroutine bubble_deflects(error)
      type(error_type), allocatable, intent(out) :: error
      type(validity_type) :: validity
      type(row_type) :: row

      validity = new_validity(one_rod('dynamic', 3), layout(3), 1, 0.05_wp, 0.01_wp)
      row = new_row(layout(3))
      row%values(row%layout%before('bubble') + 1) = -2.0_wp*0.04_wp
      call bend(row, 4.0_wp*0.04_wp, 0.0_wp)
      call validity%observe(row)
      call check(error, validity%warnings(), '', 'both')
      if (allocated(error)) return
      row%values(row%layout%before('bubble') + 1) = 2.0_wp*0.03_wp
      call validity%observe(row)
      call check(error, index(validity%warnings(), 'rod 1 bends by 0.07 of its length (t = 0 s)') == 1, validity%warnings())
   end subroutine bubble_deflects

   !> By quadrature of v'^2/2 over an arc.
   subroutine chord_at_limit(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      integer, parameter :: n = 10000
      real(wp) :: x, shortening
      integer :: i

      shortening = 0.0_wp
      associate (slope => 4.0_wp*config%model%deflection_limit)
         do i = 1, n
            x = (i - 0.5_wp)/n
            shortening = shortening + 0.5_wp*(slope*(1.0_wp - 2.0_wp*x))**2/n ! v = slope x (1 - x)
         end do
         call check_close(error, greatest_deflection(slope, -slope), config%model%deflection_limit, 1.0e-15_wp, 'arc')
         if (allocated(error)) return
      end associate
      call check_close(error, shortening, 0.01_wp, 5.0e-4_wp, 'shortening')
   end subroutine chord_at_limit

   subroutine limit_of_vibration(error)
      type(error_type), allocatable, intent(out) :: error
      call check(error, swing(0.4_wp, 0.1_wp), '', 'slow')
      if (allocated(error)) return
      call check(error, index(swing(0.6_wp, 0.1_wp), 'rod 1 vibrates at 0.6 times its own first frequency (25 rad/s') == 1, &
                 swing(0.6_wp, 0.1_wp))
   end subroutine limit_of_vibration

   subroutine faint_vibration(error)
      type(error_type), allocatable, intent(out) :: error
      call check(error, swing(0.9_wp, 1.0e-3_wp), '', 'faint')
   end subroutine faint_vibration

   !> Warnings on 500 rows of a rod that is bent, turns at 1 rad/s and vibrates at part of its own frequency.
   function swing(part, amplitude) result(warnings)
      real(wp), intent(in) :: part
      real(wp), intent(in) :: amplitude !! of the slopes [rad]
      character(len=:), allocatable :: warnings
      type(validity_type) :: validity
      type(row_type) :: row
      real(wp), parameter :: own = 24.674011002723393_wp ! (pi/2)^2 10
      integer :: i

      validity = new_validity(one_rod('dynamic'), layout(), 1, 1.0_wp, 0.01_wp)
      row = new_row(layout())
      row%values(row%layout%before('phi_rate') + 1) = 1.0_wp
      do i = 1, 500
         row%time = 0.1_wp*i
         call bend(row, 0.05_wp + amplitude*cos(part*own*row%time), -amplitude*part*own*sin(part*own*row%time))
         call validity%observe(row)
      end do
      warnings = validity%warnings()
   end function swing

   subroutine rigid_rods(error)
      type(error_type), allocatable, intent(out) :: error
      type(validity_type) :: validity
      type(row_type) :: row

      validity = new_validity(one_rod('rigid'), layout(), 1, 1.0e-3_wp, 0.01_wp)
      row = new_row(layout())
      call bend(row, 1.0_wp, 0.0_wp)
      call validity%observe(row)
      call check(error, validity%warnings(), '', 'warned of')
   end subroutine rigid_rods

end module test_validity
