module test_motion
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type, raise
   use rodyn_case_config, only: case_config
   use rodyn_scene, only: scene_type, new_scene
   use rodyn_motion, only: motion_type, new_motion, initial_state, state_invariants
   use rodyn_kinematics, only: invariants_type, kinetic_energy
   use rodyn_assembled, only: assembled_system, new_assembled_system, mass_matrix
   use test_testing, only: unittest, new_test, check
   use test_random_scenes, only: random_case, seed_random, kind_name, n_kinds
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

   !> A random scene with its initial state; no load is switched within (0, 1).
   subroutine random_motion(motion, y, which, n, error)
      type(motion_type), intent(out) :: motion
      real(wp), allocatable, intent(out) :: y(:)
      integer, intent(in) :: which, n
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(scene_type) :: scene

      call random_case(config, which, n)
      call new_scene(scene, config, error)
      if (allocated(error)) return
      call new_motion(motion, scene, .true., error)
      if (allocated(error)) return
      call motion%dynamics%set_regime(0.0_wp, 1.0_wp)
      call initial_state(motion, config%initial, y)
   end subroutine random_motion

   subroutine test_jacobian(error)
      type(error_type), allocatable, intent(out) :: error
      type(motion_type) :: motion
      real(wp), allocatable :: y(:), jac(:, :), plus(:), minus(:), yp(:), ym(:), column(:)
      real(wp) :: step, worst
      logical :: ok
      integer :: which, n, j

      call seed_random(2)
      do which = 1, n_kinds
         do n = 1, 6
            call random_motion(motion, y, which, n, error)
            if (allocated(error)) return
            allocate (jac(size(y), size(y)), plus(size(y)), minus(size(y)))
            call motion%jacobian(0.3_wp, y, jac, ok)
            call check(error, ok, 'no Jacobian')
            if (allocated(error)) return
            do j = 1, size(y)
               step = epsilon(1.0_wp)**(1.0_wp/3.0_wp)*max(1.0_wp, abs(y(j)))
               yp = y
               ym = y
               yp(j) = y(j) + step
               ym(j) = y(j) - step
               call motion%rhs(0.3_wp, yp, plus, ok)
               call motion%rhs(0.3_wp, ym, minus, ok)
               column = (plus - minus)/(yp(j) - ym(j))
               worst = maxval(abs(jac(:, j) - column))/maxval(abs(jac))
               ! Truncation of central differences: step^2 relative, with margin for third derivatives.
               call check(error, worst < 1.0e-7_wp, kind_name(which)//': Jacobian is off')
               if (allocated(error)) return
            end do
            deallocate (jac, plus, minus)
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
      do which = 1, n_kinds
         if (index(kind_name(which), 'paper distributed dynamic') > 0) cycle ! its M is not that of an energy
         do n = 1, 5
            call random_motion(motion, y, which, n, error)
            if (allocated(error)) return
            associate (scene => motion%dynamics%scene, d => motion%n_dof)
               call new_assembled_system(system, scene, error)
               if (allocated(error)) return
               call mass_matrix(system, scene, [0.0_wp, sin(y(scene%phi_at() + 1:scene%phi_at() + n))], &
                                [1.0_wp, cos(y(scene%phi_at() + 1:scene%phi_at() + n))], y(:d))
               allocate (m(d, d), ei(d), ej(d))
               do i = 1, d
                  do j = 1, d
                     ei = 0.0_wp
                     ej = 0.0_wp
                     ei(i) = 1.0_wp
                     ej(j) = 1.0_wp
                     m(i, j) = kinetic_energy(scene, y(:d), ei + ej) - kinetic_energy(scene, y(:d), ei) - &
                               kinetic_energy(scene, y(:d), ej)
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

   !> d(kinetic + elastic)/dt along the motion, by central differences, equals load power - dissipated power.
   subroutine test_energy_rate(error)
      type(error_type), allocatable, intent(out) :: error
      type(motion_type) :: motion
      type(invariants_type) :: before, after
      real(wp), allocatable :: y(:), ydot(:)
      real(wp) :: rate, h, scale
      logical :: ok
      integer :: which, n

      call seed_random(4)
      h = 1.0e-6_wp
      do which = 1, n_kinds
         if (index(kind_name(which), 'paper distributed dynamic') > 0) cycle
         do n = 1, 5
            call random_motion(motion, y, which, n, error)
            if (allocated(error)) return
            allocate (ydot(size(y)))
            call motion%rhs(0.3_wp, y, ydot, ok)
            before = state_invariants(motion, y - h*ydot)
            after = state_invariants(motion, y + h*ydot)
            associate (last => motion%n_controlled)
               rate = (after%kinetic + after%elastic - before%kinetic - before%elastic)/(2.0_wp*h)
               scale = sum(abs(ydot(last + 1:))) + sum(ydot**2)*1.0e-3_wp
               call check(error, abs(rate - (ydot(last + 1) - ydot(last + 2))) < 1.0e-5_wp*scale, &
                          kind_name(which)//': energy does not balance')
               if (allocated(error)) return
            end associate
            deallocate (ydot)
         end do
      end do
   end subroutine test_energy_rate

end module test_motion
