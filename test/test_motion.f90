module test_motion
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type
   use rodyn_motion, only: motion_type
   use rodyn_kinematics, only: kinetic_energy
   use rodyn_assembled, only: assembled_system, new_assembled_system, mass_matrix
   use test_testing, only: unittest, new_test, check
   use test_motions, only: random_motion, check_jacobian, check_energy_rate
   use test_random_scenes, only: seed_random, kind_name, n_all_kinds
   implicit none (type, external)
   private
   public :: collect_motion

contains

   subroutine collect_motion(suite)
      type(unittest), allocatable, intent(out) :: suite(:)
      suite = [new_test('Jacobian equals central differences on scenes of every kind', test_jacobian), &
               new_test('mass matrix equals second differences of the kinetic energy', test_mass_matrix), &
               new_test('power of all forces equals the rate of energy (consistent)', test_energy_rate)]
   end subroutine collect_motion

   subroutine test_jacobian(error)
      type(error_type), allocatable, intent(out) :: error
      type(motion_type) :: motion
      real(wp), allocatable :: y(:)
      integer :: which, n

      call seed_random(2)
      do which = 1, n_all_kinds
         do n = 1, 6
            call random_motion(motion, y, which, n, 'recursive', error)
            if (.not. allocated(error)) call check_jacobian(motion, y, kind_name(which), error)
            if (allocated(error)) return
         end do
      end do
   end subroutine test_jacobian

   !> T is quadratic in p, so M_ij = T(e_i + e_j) - T(e_i) - T(e_j) holds exactly.
   subroutine test_mass_matrix(error)
      type(error_type), allocatable, intent(out) :: error
      type(motion_type) :: motion
      type(assembled_system) :: system
      real(wp), allocatable :: y(:), m(:, :), ei(:), ej(:)
      integer :: which, n, i, j

      call seed_random(3)
      do which = 1, n_all_kinds
         if (index(kind_name(which), 'paper distributed dynamic') > 0) cycle ! its M is not that of an energy
         do n = 1, 5
            call random_motion(motion, y, which, n, 'recursive', error)
            if (allocated(error)) return
            associate (scene => motion%dynamics%scene, hinges => motion%dynamics%hinges, d => motion%n_dof)
               call new_assembled_system(system, scene, motion%dynamics%hinges, error)
               if (allocated(error)) return
               call mass_matrix(system, scene, scene%hinges, [0.0_wp, sin(y(scene%phi_at() + 1:scene%phi_at() + n))], &
                                [1.0_wp, cos(y(scene%phi_at() + 1:scene%phi_at() + n))], y(:d))
               allocate (m(d, d), ei(d), ej(d))
               do i = 1, d
                  do j = 1, d
                     ei = 0.0_wp
                     ej = 0.0_wp
                     ei(i) = 1.0_wp
                     ej(j) = 1.0_wp
                     m(i, j) = kinetic_energy(scene, hinges, y(:d), ei + ej) - kinetic_energy(scene, hinges, y(:d), ei) - &
                               kinetic_energy(scene, hinges, y(:d), ej)
                  end do
               end do
               call check(error, maxval(abs(m - system%m)) < 100*epsilon(1.0_wp)*maxval(abs(m)), &
                          kind_name(which)//': M is not the Hessian of the kinetic energy')
               if (allocated(error)) return
               deallocate (m, ei, ej)
            end associate
         end do
      end do
   end subroutine test_mass_matrix

   subroutine test_energy_rate(error)
      type(error_type), allocatable, intent(out) :: error
      type(motion_type) :: motion
      real(wp), allocatable :: y(:)
      integer :: which, n

      call seed_random(4)
      do which = 1, n_all_kinds
         if (index(kind_name(which), 'paper distributed dynamic') > 0) cycle
         do n = 1, 5
            call random_motion(motion, y, which, n, 'recursive', error)
            if (.not. allocated(error)) call check_energy_rate(motion, y, 0.0_wp, kind_name(which), error)
            if (allocated(error)) return
         end do
      end do
   end subroutine test_energy_rate

end module test_motion
