!> Modes and equilibria of scenes whose hinges are held, latched or between stops (`&hinge`).
module test_held_modes
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type
   use rodyn_case_config, only: case_config, hinge_config
   use rodyn_equilibrium, only: find_equilibrium
   use rodyn_lapack, only: dgeev
   use rodyn_linear_model, only: linear_model, new_linear_model
   use rodyn_locks, only: expansion_matrix, free_coordinates
   use rodyn_modes_at_start, only: modes_at_start
   use rodyn_modes, only: mode_set, new_modes, mechanism, oscillation, rigid_body
   use rodyn_motion, only: motion_type, new_motion, initial_state
   use rodyn_scene, only: scene_type, new_scene
   use test_motions, only: eigenvector_error
   use test_random_scenes, only: allocate_case, kind_name, n_kinds, random_case, seed_random
   use test_testing, only: check, check_close, new_test, unittest
   implicit none (type, external)
   private
   public :: collect_held_modes

   real(wp), parameter :: rounding = 1000.0_wp*epsilon(1.0_wp)

contains

   subroutine collect_held_modes(suite)
      type(unittest), allocatable, intent(out) :: suite(:)
      suite = [ &
         new_test('two rigid rods held in line have the modes of one rod', joined_rods), &
         new_test('modes with held hinges are eigenvalues of differences, in every kind of scene', modes_of_differences), &
         new_test('shapes with held hinges keep the openings, and are eigenvectors', shapes_of_jacobian), &
         new_test('a held hinge is the limit of a stiff spring, in every kind of scene', stiff_limit), &
         new_test('a profiled rod with a bubble against the same rod cut in pieces that are held together', cut_rod), &
         new_test('a scene whose hinges are all held is one rigid body', all_held), &
         new_test('a held hinge without spring is no mechanism', held_without_spring), &
         new_test('equilibria with held hinges, stops and freeplay in closed form', equilibria)]
   end subroutine collect_held_modes

   !> At the start, with the hinges as they are held there.
   subroutine start(config, motion, y, error)
      type(case_config), intent(in) :: config
      type(motion_type), intent(out) :: motion
      real(wp), allocatable, intent(out) :: y(:)
      type(error_type), allocatable, intent(out) :: error
      type(scene_type) :: scene

      call new_scene(scene, config, error)
      if (.not. allocated(error)) call new_motion(motion, scene, .false., error)
      if (allocated(error)) return
      call initial_state(motion, config%initial, y)
      call motion%begin_regime(0.0_wp, 1.0_wp, 1.0_wp, y, error)
   end subroutine start

   subroutine modes_of(config, equilibrium, modes, error)
      type(case_config), intent(in) :: config
      logical, intent(in) :: equilibrium
      type(mode_set), intent(out) :: modes
      type(error_type), allocatable, intent(out) :: error
      type(scene_type) :: scene
      type(motion_type) :: motion
      type(linear_model) :: model

      call new_scene(scene, config, error)
      if (.not. allocated(error)) call new_motion(motion, scene, .false., error)
      if (.not. allocated(error)) call modes_at_start(motion, config, equilibrium, .false., .true., model, modes, error)
   end subroutine modes_of

   !> Hold these hinges at their initial angles.
   subroutine hold(config, hinges)
      type(case_config), intent(inout) :: config
      integer, intent(in) :: hinges(:)
      integer :: i

      if (allocated(config%hinges)) deallocate (config%hinges)
      allocate (config%hinges(size(hinges)))
      do i = 1, size(hinges)
         config%hinges(i)%hinge = hinges(i)
         config%hinges(i)%held = .true.
      end do
   end subroutine hold

   !> A random case with two held hinges; the initial rates fit.
   subroutine random_held_case(config, which, n)
      type(case_config), intent(out) :: config
      integer, intent(in) :: which, n
      integer :: i, k

      call random_case(config, which, n)
      call hold(config, [0, n/2])
      config%hinges(2)%rest_angle = 0.3_wp
      if (config%model%bending == 'quasistatic') config%initial%phi_rate = 0.0_wp
      do i = 1, 2
         k = config%hinges(i)%hinge + 1
         associate (initial => config%initial)
            initial%phi_rate(k) = -initial%alpha_rate(k)
            if (k > 1) initial%phi_rate(k) = initial%phi_rate(k) + (initial%phi_rate(k - 1) + initial%beta_rate(k - 1))
         end associate
      end do
   end subroutine random_held_case

   !> With dampers and spin; the third hinge stays free.
   subroutine joined_rods(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: parts, whole
      type(mode_set) :: of_parts, of_whole
      integer :: variant

      do variant = 1, 3
         call new_chain(parts, [1.0_wp, 0.7_wp, 1.2_wp], [80.0_wp, 999.0_wp, 50.0_wp])
         call new_chain(whole, [1.7_wp, 1.2_wp], [80.0_wp, 50.0_wp])
         call hold(parts, [1])
         parts%chain%kink = [0.4_wp, 0.0_wp, -0.7_wp]
         whole%chain%kink = [0.4_wp, -0.7_wp]
         if (variant > 1) then
            parts%chain%hinge_damping = [0.6_wp, 7.0_wp, 0.2_wp]
            whole%chain%hinge_damping = [0.6_wp, 0.2_wp]
         end if
         if (variant > 2) then
            parts%initial%omega = 1.5_wp
            whole%initial%omega = 1.5_wp
         end if
         call modes_of(parts, .true., of_parts, error)
         if (.not. allocated(error)) call modes_of(whole, .true., of_whole, error)
         if (allocated(error)) return
         call check(error, of_parts%n, of_whole%n, 'modes')
         call check(error, all(of_parts%kind == of_whole%kind), 'kinds')
         call check_close(error, [real(of_parts%eigenvalue, wp), aimag(of_parts%eigenvalue)], &
                          [real(of_whole%eigenvalue, wp), aimag(of_whole%eigenvalue)], rounding*of_whole%fastest, 'eigenvalues')
         if (allocated(error)) return
         ! x, y, rotation, phi: the two rods turn as the one.
         call check_close(error, abs([of_parts%shape([1, 2, 3, 4, 6], of_parts%n)]), &
                          abs([of_whole%shape(:, of_whole%n)]), rounding, 'shape')
         call check_close(error, abs(of_parts%shape(4, :) - of_parts%shape(5, :)), spread(0.0_wp, 1, of_parts%n), rounding, 'line')
         if (allocated(error)) return
      end do
   end subroutine joined_rods

   !> Uniform rigid rods on a free spacecraft.
   subroutine new_chain(config, length, stiffness)
      type(case_config), intent(out) :: config
      real(wp), intent(in) :: length(:), stiffness(:)

      call allocate_case(config, size(length))
      config%model%bending = 'rigid'
      config%spacecraft%mass = 20.0_wp
      config%spacecraft%inertia = 5.0_wp
      config%spacecraft%hinge_x = 0.4_wp
      config%spacecraft%hinge_y = 0.2_wp
      config%chain%length = length
      config%chain%mass_per_length = 1.5_wp
      config%chain%node_mass(size(length)) = 0.8_wp
      config%chain%hinge_stiffness = stiffness
   end subroutine new_chain

   !> Jacobian of the coordinates that are left, by central differences along the constraint.
   subroutine difference_eigenvalues(motion, y, re, im)
      type(motion_type), intent(inout) :: motion
      real(wp), intent(in) :: y(:)
      real(wp), allocatable, intent(out) :: re(:), im(:)
      real(wp), allocatable :: along(:, :), t(:, :), jac(:, :), work(:)
      integer, allocatable :: chain(:), joints(:), kept(:)
      real(wp) :: plus(size(y)), minus(size(y)), shifted(size(y)), none(1, 1), step
      integer :: i, info, j, n, n_chain
      logical :: ok

      step = epsilon(1.0_wp)**(1.0_wp/3.0_wp)
      associate (m => motion%n_dof, r => motion%n_q, hinges => motion%dynamics%hinges)
         t = expansion_matrix(motion%dynamics%scene, hinges)
         chain = free_coordinates(motion%dynamics%scene, hinges)
         n_chain = size(chain)
         joints = m + pack([(i, i=1, r - m)], .not. hinges%locked(hinges%relaxing))
         kept = [chain, joints, r + chain]
         n = size(kept)
         allocate (along(r + m, n), source=0.0_wp)
         along(:m, :n_chain) = t
         do i = 1, size(joints)
            along(joints(i), n_chain + i) = 1.0_wp
         end do
         along(r + 1:, n - n_chain + 1:) = t
      end associate
      allocate (jac(n, n), re(n), im(n), work(40*n))
      do j = 1, n
         shifted = y + step*along(:, j)
         call motion%rhs(0.0_wp, shifted, plus, ok)
         shifted = y - step*along(:, j)
         call motion%rhs(0.0_wp, shifted, minus, ok)
         jac(:, j) = (plus(kept) - minus(kept))/(2.0_wp*step)
      end do
      call dgeev('N', 'N', n, jac, n, re, im, none, 1, none, 1, work, size(work), info)
   end subroutine difference_eigenvalues

   !> Turning, bent, loaded, damped, kinked.
   subroutine modes_of_differences(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(motion_type) :: motion
      type(linear_model) :: model
      type(mode_set) :: modes
      real(wp), allocatable :: y(:), re(:), im(:)
      real(wp) :: distance
      integer :: i, n, n_found, which

      call seed_random(61)
      do which = 1, n_kinds
         do n = 3, 5
            call random_held_case(config, which, n)
            call start(config, motion, y, error)
            if (.not. allocated(error)) call new_linear_model(model, motion, 0.0_wp, y, error)
            if (.not. allocated(error)) call new_modes(modes, model, .false., error)
            if (allocated(error)) return
            call difference_eigenvalues(motion, y, re, im)
            distance = 0.0_wp
            do i = 1, modes%n
               if (modes%kind(i) == rigid_body .or. modes%kind(i) == mechanism) cycle
               distance = max(distance, &
                              minval(hypot(re - real(modes%eigenvalue(i), wp), im - aimag(modes%eigenvalue(i)))))
            end do
            ! as in `test_modes`
            call check(error, distance < 2.0e-6_wp*max(1.0_wp, modes%fastest), kind_name(which)//': no such eigenvalue')
            if (allocated(error)) return
            n_found = count(modes%kind == rigid_body) + 2*count(modes%kind == oscillation .or. modes%kind == mechanism) + &
                      count(modes%kind == 'relaxation')
            associate (b => motion%dynamics%scene%n_base)
               call check(error, abs(n_found - (size(re) - b)) <= count(modes%kind == mechanism), kind_name(which)//': number')
            end associate
            if (allocated(error)) return
         end do
      end do
   end subroutine modes_of_differences

   !> J v = lambda v for the whole vector, J the Jacobian of the integrators, and no opening of held hinges.
   subroutine shapes_of_jacobian(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(motion_type) :: motion
      type(linear_model) :: model
      type(mode_set) :: modes
      real(wp), allocatable :: y(:), jac(:, :)
      real(wp) :: wrong
      integer :: i, n, which
      logical :: ok

      call seed_random(62)
      do which = 1, n_kinds
         do n = 3, 4
            call random_held_case(config, which, n)
            call start(config, motion, y, error)
            if (.not. allocated(error)) call new_linear_model(model, motion, 0.0_wp, y, error)
            if (.not. allocated(error)) call new_modes(modes, model, .true., error)
            if (allocated(error)) return
            if (allocated(jac)) deallocate (jac)
            allocate (jac(motion%n_controlled, motion%n_controlled))
            call motion%jacobian(0.0_wp, y, jac, ok)
            do i = 1, modes%n
               if (abs(modes%eigenvalue(i)) < 1.0e-3_wp) cycle
               wrong = eigenvector_error(motion, jac, y, modes%shape(:, i), modes%eigenvalue(i))
               call check(error, wrong < 1.0e-10_wp, kind_name(which)//': not an eigenvector')
               if (allocated(error)) return
               if (motion%dynamics%scene%quasistatic) cycle
               associate (scene => motion%dynamics%scene, shape => modes%shape(:, i))
                  wrong = (abs(opening_of(scene, 0, shape)) + abs(opening_of(scene, n/2, shape)))/maxval(abs(shape))
               end associate
               call check(error, wrong < rounding, kind_name(which)//': a held hinge opens')
               if (allocated(error)) return
            end do
         end do
      end do
   end subroutine shapes_of_jacobian

   pure complex(wp) function opening_of(scene, hinge, v) result(opening)
      type(scene_type), intent(in) :: scene
      integer, intent(in) :: hinge
      complex(wp), intent(in) :: v(:)
      opening = v(scene%phi_at() + hinge + 1)
      if (hinge > 0) opening = opening - v(scene%phi_at() + hinge)
      if (.not. scene%dynamic_bending) return
      opening = opening + v(scene%alpha_at() + hinge + 1)
      if (hinge > 0) opening = opening - v(scene%beta_at() + hinge)
   end function opening_of

   !> Slow modes differ by a part in C: ten times as stiff, ten times as near. Straight and at rest.
   subroutine stiff_limit(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(mode_set) :: held, soft, stiff
      real(wp) :: far, near
      integer :: which

      call seed_random(63)
      do which = 1, n_kinds
         call random_held_case(config, which, 3)
         config%initial%phi = 0.0_wp
         config%initial%alpha = 0.0_wp
         config%initial%beta = 0.0_wp
         config%initial%bubble = 0.0_wp
         config%initial%phi_rate = 0.0_wp
         config%initial%alpha_rate = 0.0_wp
         config%initial%beta_rate = 0.0_wp
         config%initial%bubble_rate = 0.0_wp
         config%initial%omega = 0.0_wp
         config%chain%kink = 0.0_wp
         config%chain%hinge_damping = 0.0_wp
         config%chain%hinge_stiffness(2) = 300.0_wp ! hinge 2 is free
         config%hinges%rest_angle = 0.0_wp
         call modes_of(config, .false., held, error)
         if (allocated(error)) return
         deallocate (config%hinges)
         config%chain%hinge_stiffness(0:1) = 1.0e7_wp
         call modes_of(config, .false., soft, error)
         config%chain%hinge_stiffness(0:1) = 1.0e8_wp
         if (.not. allocated(error)) call modes_of(config, .false., stiff, error)
         if (allocated(error)) return
         associate (first => held%oscillations(), of_soft => soft%oscillations(), of_stiff => stiff%oscillations())
            far = abs(soft%eigenvalue(of_soft(1))/held%eigenvalue(first(1)) - 1.0_wp)
            near = abs(stiff%eigenvalue(of_stiff(1))/held%eigenvalue(first(1)) - 1.0_wp)
            call check(error, size(of_stiff) == size(first) + merge(0, 2, config%model%bending == 'quasistatic'), &
                       kind_name(which)//': the locks are no unknowns')
         end associate
         if (allocated(error)) return
         call check(error, far < 0.01_wp .and. abs(far/near - 10.0_wp) < 0.2_wp, kind_name(which)//': not in proportion to 1/C')
         if (allocated(error)) return
      end do
   end subroutine stiff_limit

   !> Errors of one rod with a bubble, and of pieces with two shapes and the profile cut likewise, which fall with h^4: the pieces
   !> are the reference. A clamped rod, mass per length 1 + 0.5 x, EI (1 - 0.6 x)^2.
   subroutine cut_rod(error)
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: one(2), two(2), four(2), reference(2)

      call frequencies(1, 3, one, error)
      if (.not. allocated(error)) call frequencies(2, 3, two, error)
      if (.not. allocated(error)) call frequencies(4, 3, four, error)
      if (.not. allocated(error)) call frequencies(24, 2, reference, error)
      if (allocated(error)) return
      call check(error, abs(one(1)/reference(1) - 1.0_wp) < 5.0e-3_wp, 'one rod, first mode')
      call check(error, abs(four(1)/reference(1) - 1.0_wp) < 1.0e-5_wp, 'four rods, first mode')
      call check(error, abs(four(2)/reference(2) - 1.0_wp) < 2.0e-4_wp, 'four rods, second mode')
      call check(error, all(abs(two/four - 1.0_wp) > 4.0_wp*abs(four/reference - 1.0_wp)), 'finer is nearer')

   contains

      subroutine frequencies(n, shapes, slowest, failure)
         integer, intent(in) :: n, shapes
         real(wp), intent(out) :: slowest(2)
         type(error_type), allocatable, intent(out) :: failure
         type(case_config) :: config
         type(mode_set) :: modes
         real(wp) :: a, h
         integer :: k

         call allocate_case(config, n)
         config%spacecraft%motion = 'fixed'
         config%model%bending_shapes = shapes
         config%model%gauss_points = 8
         config%chain%length = 2.0_wp/n
         config%chain%mass_per_length = 1.3_wp
         config%chain%bending_stiffness = 500.0_wp
         h = 1.0_wp/n
         allocate (config%profiles(2*n))
         do k = 1, n
            a = (k - 1)*h
            config%profiles(2*k - 1:2*k)%first_rod = k
            config%profiles(2*k - 1:2*k)%last_rod = k
            config%profiles(2*k - 1)%polynomial = [1.0_wp + 0.5_wp*a, 0.5_wp*h]
            config%profiles(2*k)%quantity = 'bending_stiffness'
            config%profiles(2*k)%polynomial = [(1.0_wp - 0.6_wp*a)**2, -1.2_wp*h*(1.0_wp - 0.6_wp*a), 0.36_wp*h**2]
         end do
         call hold(config, [(k, k=0, n - 1)])
         call modes_of(config, .false., modes, failure)
         if (.not. allocated(failure)) slowest = aimag(modes%eigenvalue(:2))
      end subroutine frequencies

   end subroutine cut_rod

   subroutine all_held(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: refusal
      type(case_config) :: config
      type(mode_set) :: modes

      call new_chain(config, [1.0_wp, 0.7_wp], [80.0_wp, 50.0_wp])
      config%initial%phi = [0.3_wp, -1.0_wp]
      call hold(config, [0, 1])
      call modes_of(config, .false., modes, error)
      if (allocated(error)) return
      call check(error, modes%n == 3 .and. all(modes%kind == rigid_body), 'three rigid bodies')
      if (allocated(error)) return
      call modes_of(config, .true., modes, error)
      if (allocated(error)) return
      config%initial%omega = 2.0_wp
      call modes_of(config, .true., modes, error)
      if (allocated(error)) return
      call check(error, modes%n == 3 .and. all(modes%kind == rigid_body), 'three rigid bodies, spinning')
      if (allocated(error)) return
      config%initial%omega = 0.0_wp
      config%spacecraft%motion = 'fixed'
      call modes_of(config, .false., modes, refusal)
      call check(error, allocated(refusal), 'nothing can move')
   end subroutine all_held

   subroutine held_without_spring(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(mode_set) :: modes
      integer :: variant

      do variant = 1, 2
         call new_chain(config, [1.0_wp, 0.7_wp], [0.0_wp, 50.0_wp])
         call hold(config, [0])
         if (variant == 2) config%chain%hinge_damping(1) = 0.1_wp
         call modes_of(config, .false., modes, error)
         if (allocated(error)) return
         call check(error, count(modes%kind == mechanism), 0, 'mechanisms')
         call check(error, count(modes%kind == oscillation), 1, 'oscillations')
         if (allocated(error)) return
      end do
   end subroutine held_without_spring

   !> One rigid rod on a prestressed spring C against a stop Cs, or through its freeplay; then a held hinge between two kinks.
   subroutine equilibria(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: refusal
      type(case_config) :: config
      type(motion_type) :: motion
      type(mode_set) :: modes
      real(wp), parameter :: inertia = 1.5_wp*8.0_wp/3.0_wp
      real(wp), allocatable :: y(:)

      call single_rod()
      config%hinges(1)%rest_angle = 0.5_wp
      config%hinges(1)%upper_stop = 0.2_wp
      config%hinges(1)%stop_stiffness = 700.0_wp
      call compare((0.5_wp*300.0_wp + 0.2_wp*700.0_wp)/1000.0_wp, 1000.0_wp, 'stop')
      if (allocated(error)) return
      call single_rod() ! from beyond the freeplay into it
      config%initial%phi = 0.4_wp
      config%hinges(1)%freeplay = 0.1_wp
      config%hinges(1)%freeplay_stiffness = 40.0_wp
      call compare(0.0_wp, 40.0_wp, 'freeplay')
      if (allocated(error)) return
      call single_rod() ! friction holds nothing at rest, but damps
      config%hinges(1)%friction_moment = 2.0_wp
      config%hinges(1)%friction_velocity = 0.5_wp
      config%hinges(1)%rest_angle = 0.1_wp
      config%initial%phi_rate = 3.0_wp
      call compare(0.1_wp, 300.0_wp, 'friction')
      if (allocated(error)) return
      call check_close(error, real(modes%eigenvalue(:1), wp), [-0.5_wp*4.0_wp/inertia], rounding, 'decay by friction')
      if (allocated(error)) return
      call single_rod()
      config%hinges(1)%rest_angle = 0.5_wp
      config%hinges(1)%latch_angle = 0.2_wp
      call modes_of(config, .true., modes, refusal)
      call check(error, index(refusal%message, 'hinge 0 latches before') > 0, refusal%message)
      if (allocated(error)) return

      call new_chain(config, [1.0_wp, 0.7_wp, 1.2_wp], [80.0_wp, 999.0_wp, 50.0_wp])
      config%chain%kink(:) = [0.5_wp, 0.0_wp, -0.4_wp]
      config%initial%phi = [0.0_wp, 0.3_wp, 0.3_wp]
      call hold(config, [1])
      call start(config, motion, y, error)
      if (.not. allocated(error)) call find_equilibrium(motion, 0.0_wp, y, error)
      if (allocated(error)) return
      call check_close(error, y(4:6), [0.5_wp, 0.8_wp, 0.4_wp], rounding, 'kinks beside a held hinge')

   contains

      subroutine single_rod()
         type(hinge_config) :: fresh
         call new_chain(config, [2.0_wp], [300.0_wp])
         config%chain%node_mass = 0.0_wp
         config%spacecraft%motion = 'fixed'
         allocate (config%hinges(1))
         config%hinges(1) = fresh
      end subroutine single_rod

      subroutine compare(angle, stiffness, name)
         real(wp), intent(in) :: angle, stiffness
         character(len=*), intent(in) :: name
         call start(config, motion, y, error)
         if (.not. allocated(error)) call find_equilibrium(motion, 0.0_wp, y, error)
         if (.not. allocated(error)) call modes_of(config, .true., modes, error)
         if (allocated(error)) return
         call check_close(error, [y(1), abs(modes%eigenvalue(1))**2], [angle, stiffness/inertia], rounding, name)
      end subroutine compare

   end subroutine equilibria

end module test_held_modes
