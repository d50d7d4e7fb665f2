!> Locked hinges: against dense systems with Lagrange multipliers, rigid bodies, stiff springs, and conservation laws.
module test_locks
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type
   use rodyn_case_config, only: case_config
   use rodyn_scene, only: scene_type
   use rodyn_motion, only: motion_type, state_invariants
   use rodyn_kinematics, only: invariants_type, invariants
   use rodyn_assembled, only: assembled_system, new_assembled_system, mass_matrix
   use rodyn_hinge_law, only: openings, hinge_moments
   use rodyn_frequencies, only: natural_frequencies, decay_rates
   use rodyn_fastest_rates, only: fastest_rates
   use rodyn_integrator, only: integrator_type, solver_options
   use rodyn_integrators, only: new_integrator
   use rodyn_lapack, only: dgesv
   use test_testing, only: unittest, new_test, check, check_close
   use test_motions, only: motion_of, random_motion, check_jacobian, check_energy_rate
   use test_random_scenes, only: random_case, seed_random, uniform, kind_name, n_kinds, allocate_case
   implicit none (type, external)
   private
   public :: collect_locks

contains

   subroutine collect_locks(suite)
      type(unittest), allocatable, intent(out) :: suite(:)
      suite = [ &
         new_test('both kernels solve the system with Lagrange multipliers on random scenes', test_multipliers), &
         new_test('freed hinges give back the very accelerations of before', test_freed), &
         new_test('all hinges of a rigid chain locked: one rigid body', test_rigid_body), &
         new_test('two rigid rods that latch: rates and loss in closed form', test_latch), &
         new_test('latching keeps the momenta and loses what it says', test_momenta), &
         new_test('latching of rods of every kind solves the dense impact', test_impact), &
         new_test('1000 rods latch and move as one', test_long_chain), &
         new_test('both kernels agree on 200 rods with locks', test_kernels_agree), &
         new_test('quasistatic bending: locks are the limit of stiff springs', test_quasistatic_limit), &
         new_test('quasistatic bending: locking changes no acceleration but the dampers''', test_quasistatic_latch), &
         new_test('a locked hinge is the limit of a stiff, damped one', test_stiff_limit), &
         new_test('power of all forces equals the rate of energy with locks', test_energy_rate), &
         new_test('Jacobian with locks equals central differences', test_jacobian), &
         new_test('every method keeps the constraints, and all agree', test_methods), &
         new_test('a driven lock follows its opening', test_driven), &
         new_test('frequencies and fastest rates with locks', test_frequencies)]
   end subroutine collect_locks

   !> Some hinges: none of them, all, or any.
   function random_locks(n) result(locked)
      integer, intent(in) :: n
      logical, allocatable :: locked(:)
      real(wp) :: share
      integer :: k

      share = uniform(-0.3_wp, 1.3_wp)
      allocate (locked(0:n - 1))
      do k = 0, n - 1
         locked(k) = uniform(0.0_wp, 1.0_wp) < share
      end do
   end function random_locks

   subroutine lock_at_once(motion, y, locked, error)
      type(motion_type), intent(inout) :: motion
      real(wp), intent(inout) :: y(:)
      logical, intent(in) :: locked(0:)
      type(error_type), allocatable, intent(out) :: error
      real(wp), dimension(0:size(locked) - 1) :: still, opening, theta, theta_rate, impulse
      real(wp) :: lost
      logical :: ok

      still = 0.0_wp
      associate (scene => motion%dynamics%scene, r => motion%n_q, m => motion%n_dof, first => motion%dynamics%scene%n_base)
         call openings(scene%n, scene%dynamic_bending, y(first + 1:), opening)
         call motion%dynamics%hinge_rotations(y(:r), y(r + 1:r + m), theta, theta_rate)
         call motion%dynamics%velocity_jump(y(:r), (y(r + 1:r + m)), locked, still, y(r + 1:r + m), lost, impulse, ok)
         call motion%dynamics%set_locked(locked, still, theta, error)
         call motion%dynamics%project_locked(opening, still, y(:r), y(r + 1:r + m))
      end associate
      if (.not. allocated(error)) call check(error, ok, 'no impact')
   end subroutine lock_at_once

   !> Solution of  M a - J^T lambda = r,  J a = s  with the rows of J for locked hinges. M as in the scene's kernel.
   subroutine solve_multipliers(scene, q, locked, r, s, a, lambda, error)
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: q(:), r(:), s(0:)
      logical, intent(in) :: locked(0:)
      real(wp), allocatable, intent(out) :: a(:), lambda(:)
      type(error_type), allocatable, intent(out) :: error
      type(assembled_system) :: system
      real(wp), allocatable :: k(:, :), x(:), unit(:)
      real(wp) :: opening(0:scene%n - 1)
      integer, allocatable :: pivots(:), list(:)
      integer :: i, m, c, info

      call new_assembled_system(system, scene, scene%hinges, error)
      if (allocated(error)) return
      associate (phi => q(scene%phi_at() + 1:scene%phi_at() + scene%n))
         call mass_matrix(system, scene, scene%hinges, [0.0_wp, sin(phi)], [1.0_wp, cos(phi)], q)
      end associate
      m = scene%n_dof
      list = pack([(i, i=0, scene%n - 1)], locked)
      c = size(list)
      allocate (k(m + c, m + c), x(m + c), unit(m), source=0.0_wp)
      allocate (pivots(m + c))
      k(:m, :m) = system%m
      do i = 1, m
         unit = 0.0_wp
         unit(i) = 1.0_wp
         call openings(scene%n, scene%dynamic_bending, unit(scene%n_base + 1:), opening)
         if (i <= scene%n_base) opening = 0.0_wp
         k(m + 1:, i) = opening(list)
         k(i, m + 1:) = -opening(list)
      end do
      x(:m) = r
      x(m + 1:) = s(list)
      call dgesv(m + c, 1, k, m + c, pivots, x, m + c, info)
      call check(error, info == 0, 'singular')
      a = x(:m)
      allocate (lambda(0:scene%n - 1), source=0.0_wp)
      lambda(list) = x(m + 1:)
   end subroutine solve_multipliers

   subroutine test_multipliers(error)
      type(error_type), allocatable, intent(out) :: error
      character(len=9), parameter :: kernels(2) = ['recursive', 'assembled']
      type(motion_type) :: motion
      type(case_config) :: config
      type(assembled_system) :: system
      real(wp), allocatable :: y(:), free(:), a(:), b(:), lambda(:), s(:), expected(:), theta(:)
      logical, allocatable :: locked(:)
      real(wp) :: difference
      logical :: ok
      integer :: i, k, which, n, kernel
      character(len=100) :: text

      call seed_random(11)
      do i = 0, 699
         which = 1 + mod(i, n_kinds)
         n = 1 + mod(i/n_kinds, 9)
         call random_case(config, which, n)
         if (config%model%bending == 'quasistatic') cycle ! locks the joint rotation instead
         locked = random_locks(n)
         allocate (s(0:n - 1), source=0.0_wp)
         s(:) = [(uniform(-20.0_wp, 20.0_wp)*mod(i, 2), k=1, n)]
         do kernel = 1, 2
            config%model%kernel = kernels(kernel)
            call motion_of(motion, y, config, error)
            if (allocated(error)) return
            associate (scene => motion%dynamics%scene, m => motion%n_dof)
               allocate (free(m), b(m), expected(0:n), theta(0:n - 1))
               call motion%dynamics%accelerations(0.3_wp, y(:m), y(m + 1:2*m), free, ok)
               call check(error, ok, 'no free accelerations')
               if (allocated(error)) return
               call new_assembled_system(system, scene, motion%dynamics%hinges, error)
               associate (phi => y(scene%phi_at() + 1:scene%phi_at() + n))
                  call mass_matrix(system, scene, scene%hinges, [0.0_wp, sin(phi)], [1.0_wp, cos(phi)], y(:m))
               end associate
               call solve_multipliers(scene, y(:m), locked, matmul(system%m, free), s, a, lambda, error)
               if (allocated(error)) return
               call hinge_moments(motion%dynamics%hinges, n, scene%dynamic_bending, y(scene%n_base + 1:m), &
                                  y(m + scene%n_base + 1:2*m), theta, expected)
               expected(:n - 1) = expected(:n - 1) - lambda
               call motion%dynamics%set_locked(locked, s)
               call motion%dynamics%accelerations(0.3_wp, y(:m), y(m + 1:2*m), b, ok)
               call check(error, ok, 'no accelerations')
               if (allocated(error)) return
               difference = maxval(abs(a - b))/maxval(abs(free))
               write (text, '(a, " scene ", i0, " with ", i0, " rods: ", es9.2)') kernels(kernel), i, n, difference
               call check(error, difference < 1.0e-11_wp, kind_name(which)//' '//trim(text))
               if (allocated(error)) return
               ! Moments are differences of M p', and bubbles accelerate far more than the hinges feel (1 kg m^2 of it).
               difference = maxval(abs(expected - motion%dynamics%work%moment))
               write (text(len(text) - 9:), '(es9.2)') difference
               call check(error, .not. any(locked) .or. difference < 1.0e-10_wp*maxval(abs(expected)) + &
                          4.0_wp*epsilon(1.0_wp)*maxval(abs(free)), kind_name(which)//' moments: '//trim(text))
               if (allocated(error)) return
               deallocate (free, b, expected, theta)
            end associate
         end do
         deallocate (s)
      end do
   end subroutine test_multipliers

   subroutine test_freed(error)
      type(error_type), allocatable, intent(out) :: error
      type(motion_type) :: motion
      real(wp), allocatable :: y(:), before(:), after(:)
      real(wp) :: still(0:3)
      logical :: ok
      integer :: which

      call seed_random(12)
      still = 0.0_wp
      do which = 1, n_kinds
         call random_motion(motion, y, which, 4, merge('assembled', 'recursive', which == 3), error)
         if (allocated(error)) return
         allocate (before(motion%n_states), after(motion%n_states))
         call motion%rhs(0.3_wp, y, before, ok)
         call motion%dynamics%set_locked([.true., .false., .true., .true.], still)
         call motion%rhs(0.3_wp, y, after, ok)
         call check(error, maxval(abs(after - before)) > 1.0e-3_wp*maxval(abs(before)), kind_name(which)//': not locked')
         if (allocated(error)) return
         call motion%dynamics%set_locked(spread(.false., 1, 4), still)
         call motion%rhs(0.3_wp, y, after, ok)
         call check_close(error, after, before, 0.0_wp, kind_name(which)//': freed')
         if (allocated(error)) return
         deallocate (before, after)
      end do
   end subroutine test_freed

   !> Forces X, Y and a moment M on the spacecraft of a rigid whole that turns with w: with c the vector from C to the
   !> common centre of mass, A_C + w' x c - w^2 c = F/m and J w' = M - c x F.
   subroutine test_rigid_body(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(motion_type) :: motion
      real(wp), allocatable :: y(:), a(:), expected(:)
      real(wp) :: mass, centre(2), inertia, node(2), axis(2), still(0:4), force(3), w, angle
      logical :: ok
      integer :: k, kind, kernel

      still = 0.0_wp
      do kind = 3, 5, 2 ! distributed, lumped
         do kernel = 1, 2
            call seed_random(13)
            call random_case(config, kind, 5)
            config%model%kernel = merge('assembled', 'recursive', kernel == 2)
            config%chain%hinge_stiffness = 1.0e7_wp
            config%initial%phi_rate = 0.0_wp
            config%loads = config%loads(1:3)
            call motion_of(motion, y, config, error)
            if (allocated(error)) return
            mass = config%spacecraft%mass
            centre = 0.0_wp
            inertia = config%spacecraft%inertia
            node = [config%spacecraft%hinge_x, config%spacecraft%hinge_y]
            do k = 1, 5
               angle = config%initial%phi(k)
               axis = config%chain%length(k)*[cos(angle), sin(angle)]
               if (kind == 3) then
                  call add_body(config%chain%mass_per_length(k)*config%chain%length(k), node + 0.5_wp*axis, &
                                config%chain%mass_per_length(k)*config%chain%length(k)**3/12.0_wp)
               else
                  call add_body(0.5_wp*config%chain%mass_per_length(k)*config%chain%length(k), node, 0.0_wp)
                  call add_body(0.5_wp*config%chain%mass_per_length(k)*config%chain%length(k), node + axis, 0.0_wp)
               end if
               node = node + axis
               call add_body(config%chain%node_mass(k), node, 0.0_wp)
            end do
            centre = centre/mass
            inertia = inertia - mass*sum(centre**2)
            allocate (a(motion%n_dof), expected(motion%n_dof), source=0.0_wp)
            associate (m => motion%n_dof)
               call motion%dynamics%set_locked(spread(.true., 1, 5), still)
               call motion%dynamics%accelerations(0.3_wp, y(:m), y(m + 1:2*m), a, ok)
               force = motion%dynamics%forces%base
               w = y(m + 3)
               expected(3) = (force(3) - (centre(1)*force(2) - centre(2)*force(1)))/inertia
               expected(1:2) = force(1:2)/mass - expected(3)*[-centre(2), centre(1)] + w**2*centre + &
                               w*[y(m + 2), -y(m + 1)]
            end associate
            call check_close(error, a, expected, 1.0e-12_wp*maxval(abs(expected)), 'accelerations')
            if (allocated(error)) return
            deallocate (a, expected)
         end do
      end do

   contains

      subroutine add_body(m, place, own)
         real(wp), intent(in) :: m, place(2), own
         mass = mass + m
         centre = centre + m*place
         inertia = inertia + own + m*sum(place**2)
      end subroutine add_body

   end subroutine test_rigid_body

   !> Angular momentum about hinge 0 fixes the common rate.
   subroutine test_latch(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(motion_type) :: motion
      real(wp), allocatable :: y(:)
      real(wp) :: m11, m12, m22, rate, after(2), lost, impulse(0:1)
      logical :: ok

      call allocate_case(config, 2)
      config%spacecraft%motion = 'fixed'
      config%model%bending = 'rigid'
      config%chain%length = [2.0_wp, 1.0_wp]
      config%chain%mass_per_length = [1.5_wp, 3.0_wp]
      config%chain%node_mass = [0.0_wp, 0.5_wp]
      config%initial%phi = [0.3_wp, 1.4_wp]
      config%initial%phi_rate = [2.0_wp, -5.0_wp]
      call motion_of(motion, y, config, error)
      if (allocated(error)) return
      m11 = 3.0_wp*2.0_wp**2/3.0_wp + 3.5_wp*2.0_wp**2
      m12 = (3.0_wp*0.5_wp + 0.5_wp)*2.0_wp*cos(1.1_wp)
      m22 = 3.0_wp/3.0_wp + 0.5_wp
      rate = ((m11 + m12)*2.0_wp - (m12 + m22)*5.0_wp)/(m11 + 2.0_wp*m12 + m22)
      call motion%dynamics%velocity_jump(y(:2), y(3:4), [.false., .true.], [0.0_wp, 0.0_wp], after, lost, impulse, ok)
      call check_close(error, after, [rate, rate], 1.0e-14_wp*abs(rate) + 1.0e-14_wp, 'common rate')
      call check_close(error, lost, 0.5_wp*49.0_wp*(m11*m22 - m12**2)/(m11 + 2.0_wp*m12 + m22), 1.0e-12_wp*lost, 'loss')
      if (allocated(error)) return
      ! The impulse turns the outer rod about the joint, which it also moves.
      call check_close(error, impulse, [0.0_wp, m22*(rate + 5.0_wp) + m12*(rate - 2.0_wp)], 1.0e-13_wp*m22*5.0_wp, 'impulse')
   end subroutine test_latch

   subroutine test_momenta(error)
      type(error_type), allocatable, intent(out) :: error
      type(motion_type) :: motion
      type(invariants_type) :: before, after
      real(wp), allocatable :: y(:), p(:), impulse(:), still(:), rate(:)
      logical, allocatable :: locked(:)
      real(wp) :: lost, scale
      logical :: ok
      integer :: i, n, which

      call seed_random(14)
      do i = 0, 199
         which = 1 + mod(i, 5) ! free spacecraft, not quasistatic
         n = 1 + mod(i/5, 8)
         call random_motion(motion, y, which, n, 'recursive', error)
         if (allocated(error)) return
         locked = random_locks(n)
         associate (m => motion%n_dof, scene => motion%dynamics%scene)
            allocate (p(m), impulse(0:n - 1), still(0:n - 1), rate(0:n - 1))
            still = 0.0_wp
            before = invariants(scene, motion%dynamics%hinges, y(:m), y(m + 1:2*m))
            call motion%dynamics%velocity_jump(y(:m), y(m + 1:2*m), locked, still, p, lost, impulse, ok)
            call check(error, ok .and. lost >= 0.0_wp, 'impact')
            if (allocated(error)) return
            after = invariants(scene, motion%dynamics%hinges, y(:m), p)
            scale = 1.0e-11_wp*(1.0_wp + before%kinetic)
            call check_close(error, after%momentum, before%momentum, scale, kind_name(which)//': momentum')
            if (allocated(error)) return
            call openings(n, scene%dynamic_bending, p(scene%n_base + 1:), rate)
            call check(error, .not. any(locked .and. abs(rate) > 4.0e-15_wp*maxval(abs(p))), 'hinges still move')
            if (allocated(error)) return
            if (scene%consistent .or. .not. scene%dynamic_bending) then
               call check_close(error, after%angular_momentum, before%angular_momentum, scale, &
                                kind_name(which)//': angular momentum')
               call check_close(error, before%kinetic - after%kinetic, lost, scale, kind_name(which)//': loss')
               if (allocated(error)) return
            end if
            deallocate (p, impulse, still, rate)
         end associate
      end do
   end subroutine test_momenta

   !> M (p+ - p) = J^T impulse, J p+ = given rates.
   subroutine test_impact(error)
      type(error_type), allocatable, intent(out) :: error
      type(motion_type) :: motion
      real(wp), allocatable :: y(:), p(:), impulse(:), given(:), rate(:), a(:), lambda(:)
      logical, allocatable :: locked(:)
      real(wp) :: lost
      logical :: ok
      integer :: i, k, n, which

      call seed_random(15)
      do i = 0, 279
         which = 1 + mod(i, n_kinds)
         n = 1 + mod(i/n_kinds, 7)
         call random_motion(motion, y, which, n, 'recursive', error)
         if (allocated(error)) return
         locked = random_locks(n)
         associate (r => motion%n_q, m => motion%n_dof, scene => motion%dynamics%scene)
            allocate (p(m), impulse(0:n - 1), given(0:n - 1), rate(0:n - 1))
            given(:) = [(uniform(-5.0_wp, 5.0_wp), k=1, n)]
            call motion%dynamics%velocity_jump(y(:r), y(r + 1:r + m), locked, given, p, lost, impulse, ok)
            if (scene%quasistatic) then
               call check_close(error, p, y(r + 1:r + m), 0.0_wp, 'rates of a quasistatic scene')
            else
               call openings(n, scene%dynamic_bending, y(r + scene%n_base + 1:), rate)
               call solve_multipliers(scene, y(:r), locked, spread(0.0_wp, 1, m), given - rate, a, lambda, error)
               if (allocated(error)) return
               call check_close(error, p, y(r + 1:r + m) + a, 1.0e-11_wp*max(1.0_wp, maxval(abs(a))), &
                                kind_name(which)//': rates')
               call check_close(error, impulse, lambda, 1.0e-11_wp*max(1.0_wp, maxval(abs(lambda))), &
                                kind_name(which)//': impulses')
            end if
            if (allocated(error)) return
            deallocate (p, impulse, given, rate)
         end associate
      end do
   end subroutine test_impact

   !> All hinges of a long chain that falls from motion into a lock: momenta, loss and motion as those of one body.
   subroutine test_long_chain(error)
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: n = 1000
      type(case_config) :: config
      type(motion_type) :: motion
      type(invariants_type) :: before, after
      real(wp), allocatable :: y(:), a(:), p(:), impulse(:), still(:)
      real(wp) :: lost
      logical :: ok
      integer :: k, bending

      do bending = 1, 2
         config = case_config()
         call allocate_case(config, n)
         config%spacecraft%mass = 100.0_wp
         config%spacecraft%inertia = 10.0_wp
         config%model%bending = merge('rigid  ', 'dynamic', bending == 1)
         config%chain%length = 0.1_wp
         config%chain%mass_per_length = 2.0_wp
         config%chain%bending_stiffness = 1.0e3_wp
         config%chain%node_mass = 0.1_wp
         config%chain%hinge_stiffness = 100.0_wp
         call seed_random(16)
         config%initial%phi = [(0.01_wp*k + uniform(-0.1_wp, 0.1_wp), k=1, n)]
         config%initial%phi_rate = [(uniform(-1.0_wp, 1.0_wp), k=1, n)]
         config%initial%omega = 0.3_wp
         call motion_of(motion, y, config, error)
         if (allocated(error)) return
         associate (m => motion%n_dof, scene => motion%dynamics%scene)
            allocate (a(m), p(m), impulse(0:n - 1), still(0:n - 1), source=0.0_wp)
            before = invariants(scene, motion%dynamics%hinges, y(:m), y(m + 1:2*m))
            call motion%dynamics%velocity_jump(y(:m), y(m + 1:2*m), spread(.true., 1, n), still, p, lost, impulse, ok)
            call check(error, ok, 'no impact')
            if (allocated(error)) return
            after = invariants(scene, motion%dynamics%hinges, y(:m), p)
            call check_close(error, after%momentum, before%momentum, 1.0e-10_wp*sqrt(2.0_wp*before%kinetic*320.0_wp), 'momentum')
            call check_close(error, after%angular_momentum, before%angular_momentum, &
                             1.0e-10_wp*100.0_wp*sqrt(2.0_wp*before%kinetic*320.0_wp), 'angular momentum')
            call check_close(error, before%kinetic - after%kinetic, lost, 1.0e-9_wp*before%kinetic, 'loss')
            if (allocated(error)) return
            if (bending == 1) then ! one body in free flight: w' = 0
               call motion%dynamics%set_locked(spread(.true., 1, n), still)
               call motion%dynamics%accelerations(0.0_wp, y(:m), p, a, ok)
               call check(error, ok .and. maxval(abs(a(3:))) < 1.0e-10_wp*p(3)**2, 'one body')
               if (allocated(error)) return
            end if
            deallocate (a, p, impulse, still)
         end associate
      end do
   end subroutine test_long_chain

   !> A long curled chain, every third hinge locked: rounding grows with the mass that a rod carries.
   subroutine test_kernels_agree(error)
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: n = 200, kinds(3) = [1, 3, 5]
      character(len=9), parameter :: kernels(2) = ['recursive', 'assembled']
      type(case_config) :: config
      type(motion_type) :: motion
      real(wp), allocatable :: y(:), a(:, :), still(:), moments(:, :)
      real(wp) :: scale, rounding
      logical :: ok
      integer :: i, k, kernel

      do i = 1, size(kinds)
         call seed_random(24)
         call random_case(config, kinds(i), n)
         config%initial%phi = [(0.05_wp*k + uniform(-0.3_wp, 0.3_wp), k=1, n)]
         do kernel = 1, 2
            config%model%kernel = kernels(kernel)
            call motion_of(motion, y, config, error)
            if (allocated(error)) return
            if (kernel == 1) allocate (a(motion%n_dof, 2), moments(0:n, 2), still(n))
            still = 0.0_wp
            call motion%dynamics%set_locked([(mod(k, 3) == 0, k=1, n)], still)
            call motion%dynamics%accelerations(0.3_wp, y(:motion%n_q), y(motion%n_q + 1:2*motion%n_q), a(:, kernel), ok)
            moments(:, kernel) = motion%dynamics%work%moment
            call check(error, ok, 'no accelerations')
            if (allocated(error)) return
         end do
         scale = maxval(abs(a(:, 2)))
         ! M of a chain in absolute angles is like the inverse of second differences: condition n**2, times a ratio of masses.
         rounding = 10.0_wp*n**2*epsilon(1.0_wp)*scale
         call check(error, maxval(abs(a(:, 1) - a(:, 2))) < rounding, kind_name(kinds(i))//': accelerations')
         if (allocated(error)) return
         ! The assembled kernel has moments as what is left of M p' - forces: n products, rounded, with M of some 100 kg m^2.
         rounding = n*epsilon(1.0_wp)*100.0_wp*scale
         call check(error, maxval(abs(moments(:, 1) - moments(:, 2))) < 1.0e-11_wp*maxval(abs(moments)) + rounding, &
                    kind_name(kinds(i))//': moments')
         if (allocated(error)) return
         deallocate (a, moments, still)
      end do
   end subroutine test_kernels_agree

   !> A lock at th against a spring of stiffness C whose kink is moved there: differences fall with 1/C.
   subroutine test_quasistatic_limit(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config, stiff_config
      type(motion_type) :: motion, stiff
      real(wp), allocatable :: y(:), y_stiff(:), a(:), b(:), theta(:), still(:)
      logical, allocatable :: locked(:)
      logical :: ok
      integer :: i, k, n, which, kernel

      call seed_random(17)
      do i = 0, 95
         which = merge(6, 13, mod(i, 2) == 0) ! reduced dampers, free and fixed
         if (mod(i/2, 2) == 1) which = which + 1 ! dampers as states
         n = 1 + mod(i/4, 6)
         call random_case(config, which, n)
         locked = random_locks(n)
         do k = 0, n - 1
            if (locked(k + 1)) config%chain%hinge_damping(k) = 0.0_wp
         end do
         do kernel = 1, 2
            config%model%kernel = merge('recursive', 'assembled', kernel == 1)
            call motion_of(motion, y, config, error)
            if (allocated(error)) return
            allocate (theta(0:n - 1), still(0:n - 1), source=0.0_wp)
            theta(:) = [(uniform(-0.2_wp, 0.2_wp), k=1, n)]
            stiff_config = config
            where (locked)
               stiff_config%chain%hinge_stiffness = 1.0e12_wp
               stiff_config%chain%kink = config%chain%kink + theta
            end where
            call motion_of(stiff, y_stiff, stiff_config, error)
            if (allocated(error)) return
            call motion%dynamics%set_locked(locked, still, theta)
            allocate (a(motion%n_states), b(motion%n_states))
            if (motion%n_q > motion%n_dof) y_stiff(motion%n_dof + 1:motion%n_q) = y(motion%n_dof + 1:motion%n_q)
            call motion%rhs(0.3_wp, y, a, ok)
            call stiff%rhs(0.3_wp, y_stiff, b, ok)
            associate (last => motion%n_controlled)
               call check_close(error, a(:last), b(:last), 1.0e-6_wp*maxval(abs(b(:last))), kind_name(which)//': rates')
            end associate
            if (allocated(error)) return
            if (kernel == 1) then
               call check_close(error, motion%dynamics%work%moment, stiff%dynamics%work%moment, &
                                1.0e-6_wp*maxval(abs(b)), kind_name(which)//': moments')
               if (allocated(error)) return
            end if
            deallocate (theta, still, a, b)
         end do
      end do
   end subroutine test_quasistatic_limit

   !> Held where it is, an undamped hinge passes the same moment as before, and no energy is lost.
   subroutine test_quasistatic_latch(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(motion_type) :: motion
      type(invariants_type) :: before, after
      real(wp), allocatable :: y(:), a(:), b(:), theta(:), theta_rate(:)
      real(wp) :: still(0:4)
      logical :: ok
      integer :: i, which

      still = 0.0_wp
      call seed_random(18)
      do i = 1, 20
         which = 6 + mod(i, 2)*7
         if (i > 10) which = which + 1
         call random_case(config, which, 5)
         if (i <= 10) config%chain%hinge_damping = 0.0_wp
         call motion_of(motion, y, config, error)
         if (allocated(error)) return
         associate (r => motion%n_q, m => motion%n_dof)
            allocate (a(m), b(m), theta(0:4), theta_rate(0:4))
            call motion%dynamics%accelerations(0.3_wp, y(:r), y(r + 1:r + m), a, ok)
            before = state_invariants(motion, y)
            call motion%dynamics%hinge_rotations(y(:r), y(r + 1:r + m), theta, theta_rate)
            call motion%dynamics%set_locked([.true., .false., .true., .true., .false.], still, theta)
            call motion%dynamics%accelerations(0.3_wp, y(:r), y(r + 1:r + m), b, ok)
            after = state_invariants(motion, y)
            call check_close(error, b, a, 1.0e-11_wp*maxval(abs(a)), kind_name(which)//': accelerations')
            call check_close(error, after%elastic, before%elastic, 1.0e-12_wp*before%elastic, kind_name(which)//': energy')
            if (allocated(error)) return
            deallocate (a, b, theta, theta_rate)
         end associate
      end do
   end subroutine test_quasistatic_latch

   !> Three rods, the hinge in the middle locked, or as stiff as C with a strong damper: the difference after 0.05 s falls
   !> as 1/C, and the moment of the stiff spring is that of the lock. From C = 1e7 N m/rad on it is a tenth for ten times C to
   !> 1.1e-3 in 18 scenes; from 1e6 to 1e7 it still is 0.186 in one, where bending rods are about as stiff as the hinge.
   subroutine test_stiff_limit(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(motion_type), target :: motion, stiff
      real(wp), allocatable :: y(:), x(:), ydot(:)
      real(wp) :: difference(2), still(0:2), opening(0:2), moment
      logical :: ok
      integer, parameter :: kinds(3) = [1, 3, 5] ! bending rods, rigid rods, point masses, all on a free spacecraft
      integer :: i, kind

      still = 0.0_wp
      do kind = 1, 3
         call seed_random(19)
         call random_case(config, kinds(kind), 3)
         config%chain%hinge_damping = 0.5_wp
         config%initial%phi_rate = 0.0_wp
         config%initial%phi = 0.1_wp*config%initial%phi
         config%loads%value = 0.02_wp*config%loads%value
         config%initial%alpha_rate = 0.0_wp
         config%initial%beta_rate = 0.0_wp
         config%chain%kink = 0.0_wp
         call motion_of(motion, y, config, error)
         if (allocated(error)) return
         associate (scene => motion%dynamics%scene)
            call openings(3, scene%dynamic_bending, y(scene%n_base + 1:), opening)
         end associate
         config%chain%kink(1) = opening(1)
         do i = 1, 2
            config%chain%hinge_stiffness(1) = 10.0_wp**(6 + i)
            config%chain%hinge_damping(1) = 10.0_wp**(3 + i)
            call motion_of(stiff, x, config, error)
            if (allocated(error)) return
            call run(stiff, 'bdf', 1.0e-9_wp, 0.05_wp, x, error)
            if (allocated(error)) return
            call motion_of(motion, y, config, error)
            call motion%dynamics%set_locked([.false., .true., .false.], still)
            call run(motion, 'bdf', 1.0e-9_wp, 0.05_wp, y, error)
            if (allocated(error)) return
            difference(i) = maxval(abs(x - y))/maxval(abs(y))
         end do
         call check(error, abs(difference(2)/difference(1) - 0.1_wp) < 0.005_wp .and. difference(1) < 1.0e-2_wp, 'not a limit')
         if (allocated(error)) return
         allocate (ydot(size(y)))
         call motion%rhs(0.05_wp, y, ydot, ok)
         moment = motion%dynamics%work%moment(1)
         associate (scene => stiff%dynamics%scene, hinges => stiff%dynamics%hinges, m => stiff%n_dof)
            call openings(3, scene%dynamic_bending, x(scene%n_base + 1:), opening)
            call openings(3, scene%dynamic_bending, x(m + scene%n_base + 1:), still)
            call check_close(error, hinges%stiffness(1)*(opening(1) - hinges%kink(1)) + hinges%damping(1)*still(1), moment, &
                             1.0e-2_wp*(1.0_wp + abs(moment)), 'moment')
            still = 0.0_wp
         end associate
         if (allocated(error)) return
         deallocate (ydot)
      end do
   end subroutine test_stiff_limit

   !> Integrate y from t = 0 on, with the loads of [0, 1].
   subroutine run(motion, method, rtol, t_end, y, error)
      type(motion_type), intent(inout), target :: motion
      character(len=*), intent(in) :: method
      real(wp), intent(in) :: rtol, t_end
      real(wp), contiguous, intent(inout) :: y(:)
      type(error_type), allocatable, intent(out) :: error
      class(integrator_type), allocatable :: integrator
      type(solver_options) :: options
      real(wp) :: t

      options%rtol = rtol
      options%atol = 0.01_wp*rtol
      call new_integrator(integrator, motion, method, options, error)
      if (allocated(error)) return
      call integrator%set_stop(t_end)
      call integrator%start(0.0_wp, y, error)
      if (.not. allocated(error)) call integrator%advance(t_end, y, t, error)
      call integrator%finalize()
   end subroutine run

   !> d(kinetic + elastic)/dt along the motion, by central differences, equals load power - dissipated power.
   subroutine test_energy_rate(error)
      type(error_type), allocatable, intent(out) :: error
      type(motion_type) :: motion
      real(wp), allocatable :: y(:)
      logical, allocatable :: locked(:)
      integer :: which, n

      call seed_random(20)
      do which = 1, n_kinds
         if (index(kind_name(which), 'paper distributed dynamic') > 0) cycle
         do n = 1, 6
            call random_motion(motion, y, which, n, 'recursive', error)
            if (allocated(error)) return
            locked = random_locks(n)
            call lock_at_once(motion, y, locked, error)
            if (.not. allocated(error)) call check_energy_rate(motion, y, 1.0e-3_wp, kind_name(which), error)
            if (allocated(error)) return
         end do
      end do
   end subroutine test_energy_rate

   subroutine test_jacobian(error)
      type(error_type), allocatable, intent(out) :: error
      type(motion_type) :: motion
      real(wp), allocatable :: y(:)
      logical, allocatable :: locked(:)
      integer :: which, n

      call seed_random(21)
      do which = 1, n_kinds
         do n = 1, 5
            call random_motion(motion, y, which, n, merge('assembled', 'recursive', n == 4), error)
            if (allocated(error)) return
            locked = random_locks(n)
            call lock_at_once(motion, y, locked, error)
            if (.not. allocated(error)) call check_jacobian(motion, y, kind_name(which), error)
            if (allocated(error)) return
         end do
      end do
   end subroutine test_jacobian

   !> Locks of hinges 0 and 2 for many periods of the bending rods.
   subroutine test_methods(error)
      type(error_type), allocatable, intent(out) :: error
      character(len=6), parameter :: methods(5) = ['dop853', 'gauss ', 'bdf   ', 'adams ', 'erk   ']
      type(motion_type), target :: motion
      real(wp), allocatable :: y(:), first(:)
      real(wp), dimension(0:3) :: opening, after, rate
      logical, parameter :: locked(0:3) = [.true., .false., .true., .false.]
      integer :: i, which

      do which = 1, n_kinds, 2
         do i = 1, size(methods)
            if (methods(i) == 'gauss' .and. index(kind_name(which), 'exact') > 0) cycle
            call seed_random(22)
            call random_motion(motion, y, which, 4, 'recursive', error)
            if (.not. allocated(error)) call lock_at_once(motion, y, locked, error)
            if (allocated(error)) return
            associate (scene => motion%dynamics%scene)
               call openings(4, scene%dynamic_bending, y(scene%n_base + 1:), opening)
               call run(motion, trim(methods(i)), 1.0e-10_wp, 0.01_wp, y, error)
               if (allocated(error)) return
               if (.not. scene%quasistatic) then
                  call openings(4, scene%dynamic_bending, y(scene%n_base + 1:), after)
                  call openings(4, scene%dynamic_bending, y(motion%n_q + scene%n_base + 1:), rate)
                  call check_close(error, pack(after, locked), pack(opening, locked), 1.0e-11_wp, methods(i)//': openings')
                  call check(error, .not. any(locked .and. abs(rate) > 1.0e-10_wp), methods(i)//': rates of openings')
                  if (allocated(error)) return
               end if
            end associate
            if (i == 1) first = y
            call check_close(error, y, first, 1.0e-6_wp*maxval(abs(first)), kind_name(which)//' '//methods(i))
            if (allocated(error)) return
         end do
      end do
   end subroutine test_methods

   !> A rigid pendulum on a fixed spacecraft driven with constant opening'' s, its neighbour free or locked too:
   !> phi_1' = s t, and the moment that drives one rod of moment of inertia J is J s.
   subroutine test_driven(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(motion_type), target :: motion
      real(wp), allocatable :: y(:), ydot(:)
      real(wp), parameter :: s = 3.0_wp
      logical :: ok

      call allocate_case(config, 2)
      config%spacecraft%motion = 'fixed'
      config%model%bending = 'rigid'
      config%chain%length = [1.0_wp, 0.5_wp]
      config%chain%mass_per_length = [2.0_wp, 4.0_wp]
      call motion_of(motion, y, config, error)
      if (allocated(error)) return
      call motion%dynamics%set_locked([.true., .false.], [s, 0.0_wp])
      call run(motion, 'dop853', 1.0e-11_wp, 1.0_wp, y, error)
      if (allocated(error)) return
      call check_close(error, [y(1), y(3)], [0.5_wp*s, s], 1.0e-13_wp, 'driven rod')
      if (allocated(error)) return
      y = 0.0_wp
      call motion%dynamics%set_locked([.true., .true.], [s, 0.0_wp])
      allocate (ydot(size(y)))
      call motion%rhs(0.0_wp, y, ydot, ok)
      call check_close(error, motion%dynamics%work%moment(0), -s*(2.0_wp/3.0_wp + 2.0_wp*1.25_wp**2 + 2.0_wp*0.25_wp/12.0_wp), &
                       1.0e-13_wp, 'moment of the drive')
      call check_close(error, motion%dynamics%work%moment(1), -s*(2.0_wp*0.25_wp/12.0_wp + 2.0_wp*0.25_wp*1.25_wp), &
                       1.0e-13_wp, 'moment beyond')
   end subroutine test_driven

   !> All hinges but the first of rigid rods: sqrt(C/J). And power iteration against LAPACK for every kind.
   subroutine test_frequencies(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(motion_type) :: motion
      real(wp), allocatable :: y(:), all_of_them(:)
      real(wp) :: highest, decay, still(0:4)
      integer :: which

      still = 0.0_wp
      call allocate_case(config, 5)
      config%spacecraft%motion = 'fixed'
      config%model%bending = 'rigid'
      config%chain%length = 0.2_wp
      config%chain%mass_per_length = 3.0_wp
      config%chain%hinge_stiffness = 7.0_wp
      call motion_of(motion, y, config, error)
      if (allocated(error)) return
      call motion%dynamics%set_locked([.false., .true., .true., .true., .true.], still)
      call natural_frequencies(motion%dynamics%scene, motion%dynamics%hinges, y(:5), all_of_them, error)
      if (allocated(error)) return
      call check_close(error, all_of_them, [sqrt(7.0_wp)], 1.0e-13_wp, 'one rod')
      if (allocated(error)) return
      call seed_random(23)
      do which = 1, n_kinds
         if (index(kind_name(which), 'exact') > 0) cycle ! relaxing hinges have no K and D of their own
         call random_case(config, which, 5)
         config%chain%hinge_damping = 0.5_wp
         config%chain%kink = 0.0_wp
         call motion_of(motion, y, config, error)
         if (allocated(error)) return
         y = 0.0_wp ! springs at rest: no geometric stiffness
         call motion%dynamics%set_locked([.true., .false., .false., .true., .true.], still)
         associate (scene => motion%dynamics%scene, hinges => motion%dynamics%hinges)
            call fastest_rates(scene, hinges, y(:scene%n_q), highest, decay)
            call natural_frequencies(scene, hinges, y(:scene%n_q), all_of_them, error)
            if (allocated(error)) return
            call check(error, abs(highest - maxval(all_of_them)) <= 0.2_wp*highest, kind_name(which)//': frequency')
            if (allocated(error)) return
            call decay_rates(scene, hinges, y(:scene%n_q), all_of_them, error)
            if (allocated(error)) return
            call check(error, abs(decay - maxval(all_of_them)) <= 0.2_wp*decay, kind_name(which)//': decay')
            if (allocated(error)) return
         end associate
      end do
   end subroutine test_frequencies

end module test_locks
