!> The modes of a scene as a table, docs/modes.md.
!>
!> Over (mode, rod), (mode) or (mode, joint): each coordinate of the shapes as two arrays, NAME_real and NAME_imag, since
!> HDF5 has no complex numbers. Over (equation, rate) and (equation, coordinate): the matrices of the linear model.
module rodyn_modes_table
   use rodyn_kinds, only: wp
   use rodyn_kinematics, only: slopes
   use rodyn_linear_model, only: linear_model
   use rodyn_modes, only: mode_set
   use rodyn_result_table, only: name_length, result_table
   use rodyn_hinge_law, only: hinge_law
   use rodyn_scene, only: scene_type
   use rodyn_text, only: to_text
   implicit none (type, external)
   private
   public :: tabulate_modes

   real(wp), parameter :: pi = acos(-1.0_wp)

contains

   !> All of them, with the linear model.
   subroutine tabulate_modes(scene, hinges, model, modes, equilibrium, warnings, table)
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      type(linear_model), intent(in) :: model
      type(mode_set), intent(in) :: modes      !! with shapes
      logical, intent(in) :: equilibrium       !! the state was sought as one
      character(len=*), intent(in) :: warnings !! where the model does not hold, one line each
      type(result_table), intent(inout) :: table
      integer :: i

      call add_axes()
      call add_eigenvalues()
      call add_shapes(table, scene, hinges, model, modes)
      call add_state()
      call add_matrices()
      call add_summary()

   contains

      subroutine add_axes()
         call axis('mode', [(i, i=1, modes%n)], 'rigid bodies, mechanisms, oscillations, relaxations; each by rising frequency')
         call axis('rod', [(i, i=1, scene%n)], 'rod, counted from the spacecraft')
         call axis('hinge', [(i, i=0, scene%n - 1)], 'hinge, counted from the spacecraft')
         if (size(scene%hinges%relaxing) > 0) &
            call axis('joint', scene%hinges%relaxing, 'hinge whose rotation is a state, counted from the spacecraft')
         call names('coordinate', kept_names(scene, model, .false.), &
                    'coordinate, as its change; without angles that locked hinges make redundant')
         call names('rate', kept_names(scene, model, .true.), 'rate; of the spacecraft along the turning axes')
         call names('equation', kept_names(scene, model, .true.), 'balance of forces in the row of this rate')
      end subroutine add_axes

      subroutine axis(name, values, long_name)
         character(len=*), intent(in) :: name, long_name
         integer, intent(in) :: values(:)
         call table%add(name, values, name, '1', long_name)
      end subroutine axis

      subroutine names(name, values, long_name)
         character(len=*), intent(in) :: name, values(:), long_name
         call table%add(name, values, name, '', long_name)
      end subroutine names

      subroutine add_eigenvalues()
         call per_mode('frequency', modes%frequency(), 'rad s-1', 'natural frequency, magnitude of the eigenvalue')
         call per_mode('frequency_hz', modes%frequency()/(2.0_wp*pi), 'Hz', 'natural frequency in cycles')
         call per_mode('frequency_damped', aimag(modes%eigenvalue), 'rad s-1', 'frequency of the motion, imaginary part')
         call per_mode('damping_ratio', modes%damping_ratio(), '1', 'decay over natural frequency; -1 or 1 of relaxations')
         call per_mode('decay', modes%decay(), 's-1', 'rate of decay, minus the real part; negative: it grows')
         call table%add('kind', modes%kind, 'mode', '', 'rigid body, mechanism, oscillation or relaxation')
      end subroutine add_eigenvalues

      subroutine per_mode(name, values, units, long_name)
         character(len=*), intent(in) :: name, units, long_name
         real(wp), intent(in) :: values(:)
         call table%add(name, values, 'mode', units, long_name)
      end subroutine per_mode

      !> The state the equations are linearised about.
      subroutine add_state()
         call table%add('state', model%q(model%kept), 'coordinate', 'm or rad', 'coordinates of the state')
         call table%add('state_rate', model%p(model%kept(:model%n)), 'rate', 'm s-1 or rad s-1', 'rates of the state')
         call table%add('state_acceleration', model%acceleration(model%kept(:model%n)), 'rate', &
                           'm s-2 or rad s-2', 'rates of these rates')
         call add_configuration(table, scene, hinges, model)
      end subroutine add_state

      subroutine add_matrices()
         call matrix('mass_matrix', model%mass, 'rate', 'kg, kg m or kg m2', 'M of M dp'' + (D + G) dp + K dq = 0')
         call matrix('damping_matrix', model%damping, 'rate', 'N s and N m s', 'D of the dampers in the hinges')
         call matrix('gyroscopic_matrix', model%gyration, 'rate', 'N s and N m s', 'G of the velocities of the state')
         call matrix('stiffness_matrix', model%stiffness, 'coordinate', 'N and N m', 'K, tangent stiffness')
      end subroutine add_matrices

      !> Rows of a Fortran matrix become rows in C and Python.
      subroutine matrix(name, values, column, units, long_name)
         character(len=*), intent(in) :: name, column, units, long_name
         real(wp), intent(in) :: values(:, :)
         call table%add(name, transpose(values), column, 'equation', units, long_name)
      end subroutine matrix

      subroutine add_summary()
         call table%attributes%add('warnings', warnings)
         call table%attributes%add('at', trim(merge('equilibrium  ', 'initial state', equilibrium)))
         call table%attributes%add('stable', all([(modes%is_stable(i), i=1, modes%n)]))
         call table%attributes%add('conservative', modes%conservative)
         call table%attributes%add('steady', model%is_steady(modes%fastest))
      end subroutine add_summary

   end subroutine tabulate_modes

   !> All of the state, with what locked hinges make redundant, slopes without inertia, and the hinges.
   subroutine add_configuration(table, scene, hinges, model)
      type(result_table), intent(inout) :: table
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      type(linear_model), intent(in) :: model
      real(wp), dimension(scene%n) :: alpha, beta, alpha_rate, beta_rate

      call slopes(scene, hinges, model%q, model%p, alpha, beta, alpha_rate, beta_rate)
      if (scene%n_base > 0) then
         call table%attributes%add('state_displacement_x', model%q(1))
         call table%attributes%add('state_displacement_y', model%q(2))
         call table%attributes%add('state_rotation', model%q(3))
      end if
      call per_rod('state_phi', model%q(scene%phi_at() + 1:scene%phi_at() + scene%n), 'rad', 'chord angle of the state')
      call per_rod('state_alpha', alpha, 'rad', 'slope of the rod at its inner end')
      call per_rod('state_beta', beta, 'rad', 'slope of the rod at its outer end')
      if (scene%n_bend == 3) call per_rod('state_bubble', model%q(scene%bend_at(3) + 1:scene%bend_at(3) + scene%n), 'm', &
                                          'deflection by the third bending shape')
      call table%add('state_hinge_angle', model%hinge_angle, 'hinge', 'rad', 'rotation of the hinge')
      call table%add('state_hinge_moment', model%hinge_moment, 'hinge', 'N m', &
                        'moment in the hinge, on its inner body; that of a locked hinge holds it')

   contains

      subroutine per_rod(name, values, units, long_name)
         character(len=*), intent(in) :: name, units, long_name
         real(wp), intent(in) :: values(:)
         call table%add(name, values, 'rod', units, long_name)
      end subroutine per_rod

   end subroutine add_configuration

   !> Names of the coordinates that are kept, or of their rates.
   function kept_names(scene, model, rates) result(names)
      type(scene_type), intent(in) :: scene
      type(linear_model), intent(in) :: model
      logical, intent(in) :: rates
      character(len=name_length), allocatable :: names(:)
      names = coordinate_names(scene, rates)
      if (rates) then
         names = names(model%kept(:model%n))
      else
         names = names(model%kept)
      end if
   end function kept_names

   !> 'displacement_x', ..., 'phi_1', ... or those of the rates.
   function coordinate_names(scene, rates) result(names)
      type(scene_type), intent(in) :: scene
      logical, intent(in) :: rates
      character(len=name_length), allocatable :: names(:)
      integer :: i, at

      allocate (names(merge(scene%n_dof, scene%n_q, rates)))
      if (scene%n_base > 0 .and. rates) names(:3) = [character(len=name_length) :: 'velocity_x', 'velocity_y', 'omega']
      if (scene%n_base > 0 .and. .not. rates) &
         names(:3) = [character(len=name_length) :: 'displacement_x', 'displacement_y', 'rotation']
      at = scene%n_base
      call add('phi')
      if (scene%dynamic_bending) call add('alpha')
      if (scene%dynamic_bending) call add('beta')
      if (scene%n_bend == 3) call add('bubble')
      do i = scene%n_dof + 1, size(names)
         names(i) = 'joint_'//to_text(scene%hinges%relaxing(i - scene%n_dof))
      end do

   contains

      subroutine add(name)
         character(len=*), intent(in) :: name
         character(len=5) :: ending
         ending = ''
         if (rates) ending = '_rate'
         do i = 1, scene%n
            names(at + i) = name//trim(ending)//'_'//to_text(i)
         end do
         at = at + scene%n
      end subroutine add

   end function coordinate_names

   !> The shapes, one coordinate after the other; what the scene has not is zero, and slopes without inertia follow.
   subroutine add_shapes(table, scene, hinges, model, modes)
      type(result_table), intent(inout) :: table
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      type(linear_model), intent(in) :: model
      type(mode_set), intent(in) :: modes
      complex(wp), allocatable :: place(:, :), phi(:, :), alpha(:, :), beta(:, :)
      integer :: i

      allocate (place(modes%n, 3), source=(0.0_wp, 0.0_wp))
      if (scene%n_base > 0) place = transpose(modes%shape(:3, :))
      allocate (alpha(scene%n, modes%n), beta(scene%n, modes%n))
      do i = 1, modes%n
         call slope_shapes(scene, hinges, size(model%p), modes%shape(:, i), alpha(:, i), beta(:, i))
      end do
      call scalar('displacement_x', place(:, 1), 'm', 'displacement of the spacecraft, moving x axis')
      call scalar('displacement_y', place(:, 2), 'm', 'displacement of the spacecraft, moving y axis')
      call scalar('rotation', place(:, 3), 'rad', 'rotation of the spacecraft')
      phi = modes%shape(scene%phi_at() + 1:scene%phi_at() + scene%n, :)
      call array('phi', phi, 'rod', 'angle from the moving x axis to the chord of the rod')
      call array('alpha', alpha, 'rod', 'slope of the rod against its chord at the inner end')
      call array('beta', beta, 'rod', 'slope of the rod against its chord at the outer end')
      if (scene%n_bend == 3) call array('bubble', modes%shape(scene%bend_at(3) + 1:scene%bend_at(3) + scene%n, :), 'rod', &
                                        'deflection by the third bending shape in the middle of the rod', 'm')
      if (scene%n_q > scene%n_dof) call array('joint_rotation', modes%shape(scene%n_dof + 1:, :), 'joint', &
                                             'rotation of the hinge, a state of its own')

   contains

      subroutine scalar(name, x, units, long_name)
         character(len=*), intent(in) :: name, units, long_name
         complex(wp), intent(in) :: x(:)
         call table%add(name//'_real', real(x, wp), 'mode', units, long_name//', real part of the shape')
         call table%add(name//'_imag', aimag(x), 'mode', units, long_name//', imaginary part of the shape')
      end subroutine scalar

      subroutine array(name, x, scale, long_name, units)
         character(len=*), intent(in) :: name, scale, long_name
         complex(wp), intent(in) :: x(:, :)
         character(len=*), intent(in), optional :: units !! absent: 'rad'
         character(len=:), allocatable :: unit
         unit = 'rad'
         if (present(units)) unit = units
         call table%add(name//'_real', real(x, wp), scale, 'mode', unit, long_name//', real part of the shape')
         call table%add(name//'_imag', aimag(x), scale, 'mode', unit, long_name//', imaginary part of the shape')
      end subroutine array

   end subroutine add_shapes

   !> Slopes that go with a change of q: they are affine in it.
   subroutine slope_shapes(scene, hinges, n_p, shape, alpha, beta)
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      integer, intent(in) :: n_p
      complex(wp), intent(in) :: shape(:)
      complex(wp), intent(out) :: alpha(:), beta(:)
      real(wp), dimension(scene%n, 3) :: a, b
      real(wp) :: rates(n_p), unused(scene%n), also_unused(scene%n)

      rates = 0.0_wp
      call slopes(scene, hinges, spread(0.0_wp, 1, size(shape)), rates, a(:, 3), b(:, 3), unused, also_unused)
      call slopes(scene, hinges, real(shape, wp), rates, a(:, 1), b(:, 1), unused, also_unused)
      call slopes(scene, hinges, aimag(shape), rates, a(:, 2), b(:, 2), unused, also_unused)
      alpha = cmplx(a(:, 1) - a(:, 3), a(:, 2) - a(:, 3), wp)
      beta = cmplx(b(:, 1) - b(:, 3), b(:, 2) - b(:, 3), wp)
   end subroutine slope_shapes

end module rodyn_modes_table
