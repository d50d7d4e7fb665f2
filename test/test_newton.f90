!> The O(n) solution of Newton systems against the dense Jacobian.
module test_newton
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type, raise
   use rodyn_case_config, only: case_config
   use rodyn_scene, only: scene_type, new_scene
   use rodyn_motion, only: motion_type, new_motion, initial_state
   use rodyn_dense_newton, only: dense_newton
   use test_testing, only: unittest, new_test, check
   use test_random_scenes, only: random_case, seed_random, uniform, kind_name, n_all_kinds
   implicit none (type, external)
   private
   public :: collect_newton

contains

   subroutine collect_newton(suite)
      type(unittest), allocatable, intent(out) :: suite(:)
      suite = [new_test('O(n) solution of Newton systems equals the dense one on scenes of every kind', test_agreement), &
               new_test('O(n) solution is exact to 1e-8 with steps far beyond the stiffest vibration', test_stiff), &
               new_test('O(n) solution is exact to 1e-4 where wound springs outweigh stiffness', test_wound)]
   end subroutine collect_newton

   subroutine test_agreement(error)
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: sizes(*) = [1, 2, 3, 4, 5, 8, 13, 50]
      type(case_config) :: config
      integer :: which, i, j

      call seed_random(11)
      do which = 1, n_all_kinds
         do i = 1, size(sizes)
            do j = 1, 3
               call random_case(config, which, sizes(i))
               call compare(config, 10.0_wp**uniform(-6.0_wp, -1.5_wp), 1.0e-9_wp, error)
               if (allocated(error)) then
                  error%message = kind_name(which)//': '//error%message
                  return
               end if
            end do
         end do
      end do
   end subroutine test_agreement

   !> gamma times the highest frequency up to 1e6. Of 21600 such scenes the worst is 1.7e-10.
   subroutine test_stiff(error)
      type(error_type), allocatable, intent(out) :: error
      call compare_stiff(.false., 1.0e-8_wp, error)
   end subroutine test_stiff

   !> The same with springs wound by up to 4 rad and more, whose moments make the stiffness indefinite. Elimination along the chain
   !> exchanges no rows, so that digits are lost: 1.8e-6 in the worst of 10800 scenes. Newton's iterations converge all the same.
   subroutine test_wound(error)
      type(error_type), allocatable, intent(out) :: error
      call compare_stiff(.true., 1.0e-4_wp, error)
   end subroutine test_wound

   subroutine compare_stiff(wound, tolerance, error)
      logical, intent(in) :: wound
      real(wp), intent(in) :: tolerance
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      integer :: which, j, n

      call seed_random(12)
      do which = 1, n_all_kinds
         do j = 1, 20
            n = 1 + mod(j, 7)
            call random_case(config, which, n)
            config%chain%bending_stiffness = 10.0_wp**uniform(-2.0_wp, 8.0_wp)*config%chain%bending_stiffness
            config%chain%hinge_stiffness = 10.0_wp**uniform(-2.0_wp, 6.0_wp)*config%chain%hinge_stiffness
            config%chain%hinge_damping = 10.0_wp**uniform(-2.0_wp, 6.0_wp)*config%chain%hinge_damping
            if (.not. wound) then
               config%initial%alpha = 0.0_wp
               config%initial%beta = 0.0_wp
               config%initial%bubble = 0.0_wp
               config%chain%kink = config%initial%phi - [0.0_wp, config%initial%phi(:n - 1)]
            end if
            call compare(config, 10.0_wp**uniform(-4.0_wp, -1.0_wp), tolerance, error)
            if (allocated(error)) then
               error%message = kind_name(which)//': '//error%message
               return
            end if
         end do
      end do
   end subroutine compare_stiff

   !> Solve for a random right-hand side both ways. Either the solutions agree, or that of O(n) fits its equations, each within its
   !> own terms: of an ill-conditioned system both ways have solutions that fit and differ.
   subroutine compare(config, gamma, tolerance, error)
      type(case_config), intent(in) :: config
      real(wp), intent(in) :: gamma, tolerance
      type(error_type), allocatable, intent(out) :: error
      type(motion_type) :: motion
      type(scene_type) :: scene
      type(dense_newton) :: dense
      real(wp), allocatable :: y(:), x(:), expected(:), right(:), residual(:), matrix(:, :)
      real(wp) :: difference, left_over
      character(len=120) :: text
      logical :: ok
      integer :: i

      call new_scene(scene, config, error)
      if (.not. allocated(error)) call new_motion(motion, scene, .true., error)
      if (allocated(error)) return
      call motion%dynamics%set_regime(0.0_wp, 1.0_wp)
      call initial_state(motion, config%initial, y)
      associate (m => motion%n_dof, r => motion%n_q, last => motion%n_controlled)
         if (r > m) y(m + 1:r) = 1.1_wp*y(m + 1:r)
         right = [(uniform(-1.0_wp, 1.0_wp), i=1, size(y))]
         x = right
         call motion%factorise_newton(0.3_wp, y, 10.0_wp*gamma, .true., ok)
         call check(error, ok, 'not factored')
         if (allocated(error)) return
         call motion%factorise_newton(0.3_wp, y, gamma, .false., ok)
         call motion%solve_newton(x)
         call dense%reserve(size(y))
         call motion%jacobian(0.3_wp, y, dense%jacobian, ok)
         dense%jacobian(last + 1:, :) = 0.0_wp
         expected = right
         call dense%factorise(gamma, ok)
         call dense%solve(expected)
         difference = maxval(abs(x - expected))/maxval(abs(expected))
         matrix = -gamma*dense%jacobian
         residual = right - x + gamma*matmul(dense%jacobian, x)
         left_over = maxval(abs(residual)/(abs(right) + abs(x) + matmul(abs(matrix), abs(x))))
         if (left_over < tolerance .or. difference < tolerance) return
         write (text, '(i0, " rods, gamma = ", es8.1, ": difference ", es8.1, ", residual ", es8.1)') scene%n, gamma, &
            difference, left_over
         call raise(error, trim(text))
      end associate
   end subroutine compare

end module test_newton
