!> Tests of the forces within the chain, and of the warnings on axial ones.
module test_rod_forces
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type, raise
   use rodyn_case_config, only: case_config, profile_config
   use rodyn_kinematics, only: invariants_type, invariants
   use rodyn_motion, only: motion_type, new_motion, initial_state
   use rodyn_quantities, only: layout_of, new_row, row_type
   use rodyn_rod_forces, only: largest_tension, rod_forces
   use rodyn_scene, only: scene_type, new_scene
   use rodyn_validity, only: validity_type, new_validity
   use test_random_scenes, only: allocate_case, kind_name, n_all_kinds, random_case, seed_random
   use test_testing, only: unittest, new_test, check, check_close
   implicit none (type, external)
   private
   public :: collect_rod_forces

   real(wp), parameter :: pi = acos(-1.0_wp)

contains

   subroutine collect_rod_forces(suite)
      type(unittest), allocatable, intent(out) :: suite(:)
      suite = [ &
         new_test('the force on what is outboard changes its momentum, on random scenes of every kind', balance_of_momentum), &
         new_test('a straight chain that turns is pulled by what is outboard, at each end of each rod', pull_of_a_spin), &
         new_test('in a free rod that turns the pull is largest in its middle', pull_in_the_middle), &
         new_test('the largest axial force in a rod, against a fine search', largest_in_a_rod), &
         new_test('axial force below its limit is not warned of, above it is', limit_of_axial_force), &
         new_test('the Euler load of a rod is that of its EI, where this varies', load_of_a_profile)]
   end subroutine collect_rod_forces

   !> Accelerations of a case at its start, and the forces.
   subroutine forces_at_start(config, motion, y, rates, inner, outer, error)
      type(case_config), intent(in) :: config
      type(motion_type), intent(out) :: motion
      real(wp), allocatable, intent(out) :: y(:), rates(:), inner(:, :), outer(:, :)
      type(error_type), allocatable, intent(out) :: error
      type(scene_type) :: scene
      logical :: ok

      call new_scene(scene, config, error)
      if (.not. allocated(error)) call new_motion(motion, scene, .false., error)
      if (allocated(error)) return
      call motion%dynamics%set_regime(0.0_wp, 1.0_wp)
      call initial_state(motion, config%initial, y)
      allocate (rates(size(y)), inner(2, scene%n), outer(2, scene%n))
      call motion%rhs(0.3_wp, y, rates, ok)
      if (.not. ok) call raise(error, 'no accelerations')
      associate (n => motion%n_q, m => motion%n_dof)
         call rod_forces(motion%dynamics, y(:n), y(n + 1:n + m), rates(n + 1:n + m), inner, outer)
      end associate
   end subroutine forces_at_start

   !> The change of momentum by differences along the motion.
   subroutine balance_of_momentum(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(motion_type) :: motion
      real(wp), allocatable :: y(:), rates(:), inner(:, :), outer(:, :)
      real(wp) :: force(2), scale
      integer :: i, k

      call seed_random(5)
      do i = 1, 4*n_all_kinds
         call random_case(config, 1 + mod(i, n_all_kinds), 1 + mod(i, 5))
         call forces_at_start(config, motion, y, rates, inner, outer, error)
         if (allocated(error)) return
         scale = max(maxval(abs(inner)), maxval(abs(outer)))
         do k = 1, config%chain%n_rods
            force = force_by_differences(motion, y, rates, k)
            call check(error, maxval(abs(force - outer(:, k))) < 1.0e-6_wp*scale, kind_name(1 + mod(i, n_all_kinds)))
            if (allocated(error)) return
         end do
      end do
   end subroutine balance_of_momentum

   !> Force on node k and all beyond, along and across rod k: the rate of their momentum, less their loads.
   function force_by_differences(motion, y, rates, k) result(force)
      type(motion_type), intent(in) :: motion
      real(wp), intent(in) :: y(:), rates(:)
      integer, intent(in) :: k
      real(wp) :: force(2), angle, h
      type(scene_type) :: outboard
      integer :: i

      outboard = motion%dynamics%scene
      associate (scene => motion%dynamics%scene)
         outboard%rods = scene%rods(scene%rod_of)
         outboard%bending = scene%bending(scene%rod_of)
         outboard%rod_of = [(i, i=1, scene%n)]
         outboard%node_mass(:k - 1) = 0.0_wp
         outboard%body%mass = 0.0_wp
         do i = 1, k
            outboard%rods(i)%inertia%m0 = 0.0_wp
            outboard%rods(i)%inertia%m1 = 0.0_wp
            outboard%bending(i)%first = 0.0_wp
            outboard%bending(i)%drawn = 0.0_wp
         end do
         h = 1.0e-4_wp/max(1.0_wp, maxval(abs(rates))/max(1.0_wp, maxval(abs(y))))
         force = (momentum(y + h*rates) - momentum(y - h*rates))/(2.0_wp*h)
         angle = 0.0_wp
         if (scene%n_base > 0) angle = y(3)
         force = turned(force, angle)
         if (motion%dynamics%regime%on_nodes) force = force - sum(motion%dynamics%forces%node(:, k:), dim=2)
         force = turned(force, y(scene%phi_at() + k))
      end associate

   contains

      function momentum(state)
         real(wp), intent(in) :: state(:)
         real(wp) :: momentum(2)
         type(invariants_type) :: values
         associate (n => motion%n_q, m => motion%n_dof)
            values = invariants(outboard, motion%dynamics%hinges, state(:n), state(n + 1:n + m))
         end associate
         momentum = values%momentum
      end function momentum

   end function force_by_differences

   !> Components along axes that are turned by an angle.
   pure function turned(x, angle)
      real(wp), intent(in) :: x(2), angle
      real(wp) :: turned(2)
      turned = [cos(angle)*x(1) + sin(angle)*x(2), cos(angle)*x(2) - sin(angle)*x(1)]
   end function turned

   !> n rods, 2 m and 3 kg in all, EI = 50 N m^2, hinged 0.5 m from the centre of a spacecraft whose spin they do not change.
   function spinning_chain(n, omega, formulation) result(config)
      integer, intent(in) :: n
      real(wp), intent(in) :: omega !! [rad/s]
      character(len=*), intent(in) :: formulation
      type(case_config) :: config

      call allocate_case(config, n)
      config%spacecraft%mass = 1.0e12_wp
      config%spacecraft%inertia = 1.0e12_wp
      config%spacecraft%hinge_x = 0.5_wp
      config%chain%length = 2.0_wp/n
      config%chain%mass_per_length = 1.5_wp
      config%chain%bending_stiffness = 50.0_wp
      config%chain%hinge_stiffness = 100.0_wp
      config%model%formulation = formulation
      config%initial%omega = omega
   end function spinning_chain

   subroutine pull_of_a_spin(error)
      type(error_type), allocatable, intent(out) :: error
      type(motion_type) :: motion
      real(wp), allocatable :: y(:), rates(:), inner(:, :), outer(:, :)
      integer :: k

      call forces_at_start(spinning_chain(4, 3.0_wp, 'inextensible'), motion, y, rates, inner, outer, error)
      if (allocated(error)) return
      do k = 1, 4
         call check_close(error, -inner(1, k), pull(0.5_wp*(k - 1)), 1.0e-9_wp, 'inner end')
         if (.not. allocated(error)) call check_close(error, -outer(1, k), pull(0.5_wp*k), 1.0e-9_wp, 'outer end')
         if (allocated(error)) return
      end do

   contains

      !> m W^2 int r dr from s to the end.
      pure real(wp) function pull(s)
         real(wp), intent(in) :: s
         pull = 1.5_wp*9.0_wp*(2.5_wp**2 - (0.5_wp + s)**2)/2.0_wp
      end function pull

   end subroutine pull_of_a_spin

   !> A rod of 2 m and 3 kg whose end is a spacecraft almost without mass: m W^2 (l/2)^2/2.
   subroutine pull_in_the_middle(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(motion_type) :: motion
      real(wp), allocatable :: y(:), rates(:), inner(:, :), outer(:, :)

      config = spinning_chain(1, 3.0_wp, 'consistent')
      config%spacecraft%mass = 1.0e-9_wp
      config%spacecraft%inertia = 1.0e-9_wp
      config%spacecraft%hinge_x = 0.0_wp
      call forces_at_start(config, motion, y, rates, inner, outer, error)
      if (allocated(error)) return
      call check_close(error, largest_tension(-inner(1, 1), -outer(1, 1), 0.5_wp*3.0_wp*2.0_wp*9.0_wp), 1.5_wp*9.0_wp*0.5_wp, &
                       1.0e-6_wp, 'in the middle')
   end subroutine pull_in_the_middle

   subroutine largest_in_a_rod(error)
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: cases(3, 6) = reshape([ &
         1.0_wp, 2.0_wp, 0.0_wp, -1.0_wp, 0.5_wp, 4.0_wp, -3.0_wp, 1.0_wp, 5.0_wp, 1.0_wp, 2.0_wp, 0.9_wp, &
         2.0_wp, 1.0_wp, 3.0_wp, -2.0_wp, -2.0_wp, 1.0_wp], [3, 6])
      integer, parameter :: n = 10000
      real(wp) :: found, here, x
      integer :: i, j

      do i = 1, size(cases, 2)
         found = 0.0_wp
         associate (a => cases(1, i), b => cases(2, i), bulge => cases(3, i))
            do j = 0, n
               x = real(j, wp)/n
               here = (1.0_wp - x)*a + x*b + bulge*x*(1.0_wp - x)
               if (abs(here) > abs(found)) found = here
            end do
            call check_close(error, largest_tension(a, b, bulge), found, 1.0e-7_wp, 'largest')
         end associate
         if (allocated(error)) return
      end do
   end subroutine largest_in_a_rod

   !> Warnings on a case at its start.
   function warnings_at_start(config, error) result(text)
      type(case_config), intent(in) :: config
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: text
      type(validity_type) :: validity
      type(motion_type) :: motion
      type(row_type) :: row
      real(wp), allocatable :: y(:), rates(:), inner(:, :), outer(:, :)

      text = ''
      call forces_at_start(config, motion, y, rates, inner, outer, error)
      if (allocated(error)) return
      validity = new_validity(motion%dynamics%scene, layout_of(config), 1, 1.0_wp, config%model%axial_error_limit)
      row = new_row(layout_of(config))
      call validity%observe(row)
      call validity%observe_forces(motion, 0.0_wp, y)
      text = validity%warnings()
   end function warnings_at_start

   !> One rod of 2 m turns with W: N = 1.5 W^2 (2.5^2 - 0.5^2)/2 = 4.5 W^2 at its root, P = N 4/(pi^2 50).
   subroutine limit_of_axial_force(error)
      type(error_type), allocatable, intent(out) :: error
      character(len=*), parameter :: held = ' with held hinges between them (&hinge hinge = ..., held = .true.)'
      type(case_config) :: config
      character(len=:), allocatable :: found

      call expect('consistent', 0.0120_wp, '')
      call expect('consistent', 0.0123_wp, 'divide it into 2 rods'//held//', or take formulation')
      call expect('consistent', 1.2_wp, 'divide it into 10 rods'//held// &
                  ", or take formulation = 'inextensible' with dynamic bending, which needs 3")
      call expect('inextensible', 0.249_wp, '')
      call expect('inextensible', 0.251_wp, 'divide it into 2 rods'//held)
      call expect('inextensible', 2.3_wp, &
                  'the axial force in rod 1 is 2.3 of its Euler load pi^2 EI/l^2 (280 N of tension at t = 0 s)')
      call expect('inextensible', 2.3_wp, 'divide it into 4 rods'//held)
      if (allocated(error)) return
      config = spinning_chain(1, spin_for(100.0_wp), 'consistent')
      config%model%bending = 'rigid'
      found = warnings_at_start(config, error)
      if (.not. allocated(error)) call check(error, found, '', 'rigid rods')

   contains

      subroutine expect(formulation, share, text)
         character(len=*), intent(in) :: formulation, text
         real(wp), intent(in) :: share
         if (allocated(error)) return
         found = warnings_at_start(spinning_chain(1, spin_for(share), formulation), error)
         if (allocated(error)) return
         if (text == '') then
            call check(error, found, '', 'below the limit')
         else
            call check(error, index(found, text) > 0, found)
         end if
      end subroutine expect

      pure real(wp) function spin_for(share)
         real(wp), intent(in) :: share
         spin_for = sqrt(share*pi**2*50.0_wp/(4.0_wp*4.5_wp))
      end function spin_for

   end subroutine limit_of_axial_force

   !> EI = 50 (1 + 4 x (1 - x)): a rod that bends to an arc has the same curvature everywhere, so that its mean counts, 5/3 of 50.
   subroutine load_of_a_profile(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      character(len=:), allocatable :: found

      config = spinning_chain(1, sqrt(1.5_wp*pi**2*50.0_wp/(4.0_wp*4.5_wp)), 'consistent')
      config%profiles = [profile_config(quantity='bending_stiffness', polynomial=[1.0_wp, 4.0_wp, -4.0_wp])]
      found = warnings_at_start(config, error)
      if (.not. allocated(error)) call check(error, index(found, 'is 0.9 of its Euler load') > 0, found)
   end subroutine load_of_a_profile

end module test_rod_forces
