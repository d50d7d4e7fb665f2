!> The two kernels against each other.
module test_kernels
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type, raise
   use rodyn_case_config, only: case_config
   use rodyn_scene, only: scene_type, new_scene
   use rodyn_motion, only: motion_type, new_motion, initial_state
   use test_testing, only: unittest, new_test
   use test_random_scenes, only: random_case, seed_random, kind_name, n_all_kinds
   implicit none (type, external)
   private
   public :: collect_kernels

contains

   subroutine collect_kernels(suite)
      type(unittest), allocatable, intent(out) :: suite(:)
      suite = [new_test('recursive and assembled agree on 1000 random scenes of every kind', test_agreement)]
   end subroutine collect_kernels

   subroutine test_agreement(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      real(wp), allocatable :: recursive(:), assembled(:)
      real(wp) :: difference, worst
      integer :: i
      character(len=100) :: text

      call seed_random(1)
      worst = 0.0_wp
      do i = 1, 1000
         call random_case(config, 1 + mod(i, n_all_kinds), 1 + mod(i/n_all_kinds, 9))
         call accelerations_by(config, 'recursive', recursive, error)
         if (allocated(error)) return
         call accelerations_by(config, 'assembled', assembled, error)
         if (allocated(error)) return
         difference = maxval(abs(recursive - assembled))/maxval(abs(assembled))
         worst = max(worst, difference)
         ! With bubbles the recursion is the one that forms its differences as they stand.
         if (.not. difference < merge(1.0e-10_wp, 1.0e-11_wp, config%model%bending_shapes == 3)) then
            write (text, '("scene ", i0, " with ", i0, " rods: relative difference ", es9.2)') i, config%chain%n_rods, difference
            call raise(error, kind_name(1 + mod(i, n_all_kinds))//' '//trim(text))
            return
         end if
      end do

   end subroutine test_agreement

   subroutine accelerations_by(config, kernel, acceleration, error)
      type(case_config), intent(inout) :: config
      character(len=*), intent(in) :: kernel
      real(wp), allocatable, intent(out) :: acceleration(:)
      type(error_type), allocatable, intent(out) :: error
      type(scene_type) :: scene
      type(motion_type) :: motion
      real(wp), allocatable :: y(:)
      logical :: ok

      config%model%kernel = kernel
      call new_scene(scene, config, error)
      if (.not. allocated(error)) call new_motion(motion, scene, .false., error)
      if (allocated(error)) return
      call motion%dynamics%set_regime(0.0_wp, 1.0_wp)
      call initial_state(motion, config%initial, y)
      if (motion%n_q > motion%n_dof) y(motion%n_dof + 1:motion%n_q) = 1.1_wp*y(motion%n_dof + 1:motion%n_q)
      allocate (acceleration(size(y)))
      call motion%rhs(0.3_wp, y, acceleration, ok)
      if (.not. ok) call raise(error, kernel//' kernel failed')
   end subroutine accelerations_by

end module test_kernels
