!> One clamped-free beam cut into rods with stiff hinges, against Euler and Bernoulli.
module test_beams
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type
   use rodyn_case_config, only: case_config
   use rodyn_scene, only: scene_type, new_scene
   use rodyn_assembled, only: assembled_system, new_assembled_system, mass_matrix
   use rodyn_accelerations, only: dynamics_type, new_dynamics
   use rodyn_frequencies, only: natural_frequencies
   use rodyn_lapack, only: symmetric_eigenvalues
   use test_testing, only: unittest, new_test, check
   use test_random_scenes, only: allocate_case
   implicit none (type, external)
   private
   public :: collect_beams

   !> Roots of cos x cosh x = -1.
   real(wp), parameter :: roots(3) = [1.8751040687119612_wp, 4.694091132974175_wp, 7.854757438237613_wp]

contains

   subroutine collect_beams(suite)
      type(unittest), allocatable, intent(out) :: suite(:)
      suite = [new_test('locked hinges and a third bending shape against closed-form frequencies', test_shapes), &
               new_test('clamped-free frequencies converge with order 2 or better, distributed inertia', test_distributed), &
               new_test('clamped-free frequencies converge with order 2, lumped inertia', test_lumped)]
   end subroutine collect_beams

   !> The same beam, its hinges locked: exact to the shapes. N rods of two shapes have a frequency error of order N^-4 (cubic
   !> deflections), of three shapes N^-6 (quartic), always from above.
   subroutine test_shapes(error)
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: pieces(4) = [1, 2, 4, 8]
      real(wp), parameter :: least_order(2:3) = [3.6_wp, 5.9_wp]
      real(wp) :: wrong(3, 4), two(3, 4), order
      character(len=80) :: text
      integer :: i, mode, shapes

      do shapes = 2, 3
         wrong = 0.0_wp
         do i = 1, size(pieces)
            call locked_beam_errors(pieces(i), shapes, wrong(:, i), error)
            if (allocated(error)) return
         end do
         do mode = 1, 3
            do i = 1, size(pieces)
               write (text, '(i0, " shapes, mode ", i0, ", ", i0, " rods: error ", es9.2)') shapes, mode, pieces(i), wrong(mode, i)
               if (mode > shapes .and. i == 1) cycle ! there is no such mode
               call check(error, wrong(mode, i) > -1.0e-10_wp, trim(text)//' from below') ! Rayleigh and Ritz
               if (allocated(error)) return
               if (i < merge(3, 4, mode == 1) .or. wrong(mode, i) < 1.0e-8_wp) cycle ! not yet in the limit; rounding
               order = log(wrong(mode, i - 1)/wrong(mode, i))/log(2.0_wp)
               write (text(len_trim(text) + 1:), '(", order ", f0.2)') order
               call check(error, order > least_order(shapes), trim(text))
               if (allocated(error)) return
            end do
         end do
         if (shapes == 2) two = wrong
      end do
      ! Four rods of three shapes have 12 unknowns, eight of two have 16.
      call check(error, all(wrong(:, 3) < two(:, 4)) .and. wrong(1, 3) < 0.05_wp*two(1, 4), &
                 'three shapes buy less than twice the rods')
   end subroutine test_shapes

   !> Relative errors of the first three frequencies, with signs; what the beam has not is left zero.
   subroutine locked_beam_errors(n, shapes, wrong, error)
      integer, intent(in) :: n, shapes
      real(wp), intent(out) :: wrong(3)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(scene_type) :: scene
      type(dynamics_type) :: dynamics
      real(wp), allocatable :: frequency(:)
      integer :: modes

      call allocate_case(config, n)
      config%spacecraft%motion = 'fixed'
      config%model%bending_shapes = shapes
      config%model%gauss_points = 5
      config%chain%length = 1.0_wp/n
      config%chain%mass_per_length = 1.0_wp
      config%chain%bending_stiffness = 1.0_wp
      call new_scene(scene, config, error)
      if (.not. allocated(error)) call new_dynamics(dynamics, scene, error)
      if (allocated(error)) return
      call dynamics%set_locked(spread(.true., 1, n), spread(0.0_wp, 1, n))
      call natural_frequencies(dynamics%scene, dynamics%hinges, spread(0.0_wp, 1, scene%n_dof), frequency, error)
      if (allocated(error)) return
      wrong = 0.0_wp
      modes = min(3, size(frequency))
      wrong(:modes) = frequency(:modes)/roots(:modes)**2 - 1.0_wp
   end subroutine locked_beam_errors

   subroutine test_distributed(error)
      type(error_type), allocatable, intent(out) :: error
      call check_orders('distributed', 'dynamic', 2.0_wp, 1, error)
   end subroutine test_distributed

   subroutine test_lumped(error)
      type(error_type), allocatable, intent(out) :: error
      call check_orders('lumped', 'quasistatic', 1.95_wp, 2, error) ! order 2 from below; four masses are too few for it
   end subroutine test_lumped

   !> Observed orders of the first three frequencies between 4, 8, 16 and 32 rods.
   subroutine check_orders(inertia, bending, least, first, error)
      character(len=*), intent(in) :: inertia, bending
      real(wp), intent(in) :: least !! order to be seen
      integer, intent(in) :: first  !! from this refinement on
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: pieces(4) = [4, 8, 16, 32]
      real(wp) :: wrong(3, 4), order
      character(len=80) :: text
      integer :: i, mode

      do i = 1, size(pieces)
         call frequency_errors(inertia, bending, pieces(i), wrong(:, i), error)
         if (allocated(error)) return
      end do
      do mode = 1, 3
         do i = 2, size(pieces)
            order = log(wrong(mode, i - 1)/wrong(mode, i))/log(2.0_wp)
            write (text, '("mode ", i0, ", ", i0, " rods: order ", f0.2, ", error ", es8.1)') mode, pieces(i), order, wrong(mode, i)
            call check(error, order > least .or. i <= first, trim(text))
            if (allocated(error)) return
         end do
      end do
   end subroutine check_orders

   !> Relative errors of the first three frequencies of a beam of length 1, mass 1, stiffness 1. Hinges as stiff as
   !> `stiffness` leave an error of about n/stiffness.
   subroutine frequency_errors(inertia, bending, n, wrong, error)
      character(len=*), intent(in) :: inertia, bending
      integer, intent(in) :: n
      real(wp), intent(out) :: wrong(3)
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: stiffness = 1.0e10_wp
      type(case_config) :: config
      type(scene_type) :: scene
      type(assembled_system) :: system
      real(wp), allocatable :: inverse(:)
      integer :: m

      call allocate_case(config, n)
      config%spacecraft%motion = 'fixed'
      config%model%inertia = inertia
      config%model%bending = bending
      config%chain%length = 1.0_wp/n
      config%chain%mass_per_length = 1.0_wp
      config%chain%bending_stiffness = 1.0_wp
      config%chain%hinge_stiffness = stiffness
      call new_scene(scene, config, error)
      if (.not. allocated(error)) call new_assembled_system(system, scene, scene%hinges, error)
      if (allocated(error)) return
      m = scene%n_dof
      call mass_matrix(system, scene, scene%hinges, [0.0_wp, spread(0.0_wp, 1, n)], [1.0_wp, spread(1.0_wp, 1, n)], &
                       spread(0.0_wp, 1, m))
      if (scene%dynamic_bending) call use_joint_rotations(scene, stiffness, system)
      ! M x = (1/w^2) K x: the lowest frequencies are the largest eigenvalues and keep their digits.
      call symmetric_eigenvalues(system%m, system%k, inverse, .false., error)
      if (allocated(error)) return
      wrong = abs(1.0_wp/sqrt(inverse(m:m - 2:-1))/roots**2 - 1.0_wp)
   end subroutine frequency_errors

   !> Joint rotations (times sqrt(C)) instead of chord angles: phi_{k+1} = phi_k + beta_k - alpha_{k+1} + th_k. Then the
   !> stiff hinges and the soft rods do not meet in one entry of K, and no digits are lost between them.
   subroutine use_joint_rotations(scene, stiffness, system)
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: stiffness
      type(assembled_system), intent(inout) :: system
      real(wp) :: map(scene%n_dof, scene%n_dof)
      integer :: k, n

      n = scene%n
      map = 0.0_wp
      do k = 1, 3*n
         if (k > n) map(k, k) = 1.0_wp
      end do
      do k = 1, n
         if (k > 1) map(k, :) = map(k - 1, :)
         if (k > 1) map(k, 2*n + k - 1) = map(k, 2*n + k - 1) + 1.0_wp
         map(k, n + k) = map(k, n + k) - 1.0_wp
         map(k, k) = 1.0_wp/sqrt(stiffness)
      end do
      system%m = matmul(transpose(map), matmul(system%m, map))
      system%k = 0.0_wp
      do k = 1, n
         system%k(k, k) = 1.0_wp
         associate (a => n + k, b => 2*n + k, stiffness => scene%rods(scene%rod_of(k))%stiffness)
            system%k(a, a) = stiffness(1)
            system%k(b, b) = stiffness(3)
            system%k(a, b) = stiffness(2)
            system%k(b, a) = stiffness(2)
         end associate
      end do
   end subroutine use_joint_rotations

end module test_beams
