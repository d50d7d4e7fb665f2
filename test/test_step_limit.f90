!> Tests of the stability limits of explicit methods.
module test_step_limit
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type, exit_bad_input
   use rodyn_case_config, only: case_config, solver_config
   use rodyn_driver, only: driver_type, new_driver
   use rodyn_hinge_law, only: hinge_law
   use rodyn_scene, only: scene_type, new_scene
   use rodyn_motion, only: motion_type, new_motion, initial_state, state_invariants
   use rodyn_kinematics, only: invariants_type
   use rodyn_frequencies, only: decay_rates, natural_frequencies
   use rodyn_fast_eigenvalues, only: extreme_eigenvalues, all_eigenvalues
   use rodyn_integrator, only: integrator_type, solver_options
   use rodyn_integrators, only: new_integrator
   use rodyn_stability_function, only: stability_function, stability_function_of
   use rodyn_step_limit, only: check_fixed_step, largest_stable_step
   use test_motions, only: idle_load
   use test_oscillators, only: oscillator, new_oscillator
   use test_random_scenes, only: random_case, seed_random, n_all_kinds, kind_name
   use test_testing, only: unittest, new_test, check, check_close
   implicit none (type, external)
   private
   public :: collect_step_limit

   !> Refuses states that an unstable method has blown up, before they overflow.
   type, extends(oscillator) :: bounded_oscillator
   contains
      procedure :: rhs => bounded_rhs
   end type bounded_oscillator

   !> The explicit methods, by name and order.
   character(len=6), parameter :: methods(8) = [character(len=6) :: 'erk', 'erk', 'erk', 'erk', 'erk', 'erk', 'erk', 'dop853']
   integer, parameter :: orders(8) = [2, 3, 4, 5, 6, 7, 8, 8]
   integer, parameter :: n_steps = 20000

contains

   subroutine collect_step_limit(suite)
      type(unittest), allocatable, intent(out) :: suite(:)
      suite = [ &
         new_test('stability functions begin with the exponential series, to the order and no further', exponential_series), &
         new_test('known limits: Heun 0, cubic sqrt 3, quartic sqrt 8, on the real axis 2, 2.5127, 2.7853', known_limits), &
         new_test('an oscillator stays below the limit of each method and grows above it', oscillator_limits), &
         new_test('an overdamped oscillator decays below the limit of each method and grows above it', damper_limits), &
         new_test('eigenvalues of random scenes at rest are their natural frequencies', undamped_eigenvalues), &
         new_test('the fastest vibration and damper in O(n), from below and to a hundredth', extreme_rates), &
         new_test('a scene keeps its energy below the limit of each method and explodes above it', scene_limits), &
         new_test('a refused step is named with a limit that is accepted', refusals), &
         new_test('steps that moving kinks make shorter are not refused', shortened_steps), &
         new_test('eigenvalues are those of the loads and kinks at the start', eigenvalues_at_start)]
   end subroutine collect_step_limit

   subroutine bounded_rhs(self, t, y, ydot, ok)
      class(bounded_oscillator), intent(inout) :: self
      real(wp), intent(in) :: t
      real(wp), contiguous, intent(in) :: y(:)
      real(wp), contiguous, intent(out) :: ydot(:)
      logical, intent(out) :: ok
      ok = all(abs(y) < 1.0e100_wp)
      ydot = 0.0_wp
      if (ok) call self%oscillator%rhs(t, y, ydot, ok)
   end subroutine bounded_rhs

   subroutine exponential_series(error)
      type(error_type), allocatable, intent(out) :: error
      type(stability_function) :: r
      real(wp) :: factorial
      integer :: i, k

      do i = 1, size(methods)
         call stability_function_of(r, trim(methods(i)), orders(i), error)
         if (allocated(error)) return
         factorial = 1.0_wp
         do k = 1, orders(i)
            factorial = factorial*k
            call check_close(error, r%coefficient(k)*factorial, 1.0_wp, 1.0e-12_wp, 'coefficient within the order')
            if (allocated(error)) return
         end do
         k = orders(i) + 1
         if (ubound(r%coefficient, 1) < k) cycle
         call check(error, abs(r%coefficient(k)*factorial*k - 1.0_wp) > 1.0e-3_wp, 'coefficient beyond the order')
         if (allocated(error)) return
      end do
      call stability_function_of(r, 'gauss', 0, error)
      if (.not. allocated(error)) call check(error, .not. allocated(r%coefficient), 'an implicit method has a limit')
   end subroutine exponential_series

   !> Textbook values of the polynomials of degree 2, 3 and 4 that are the exponential series.
   subroutine known_limits(error)
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: imaginary(2:4) = [0.0_wp, sqrt(3.0_wp), sqrt(8.0_wp)], real_axis(2:4) = [2.0_wp, 2.5127_wp, 2.7853_wp]
      real(wp), parameter :: near = 1.0e-3_wp
      type(stability_function) :: r
      integer :: order

      do order = 2, 4
         call stability_function_of(r, 'erk', order, error)
         if (allocated(error)) return
         if (order > 2) call check(error, r%growth(cmplx(0.0_wp, imaginary(order) - near, wp)) < 0.0_wp, 'imaginary axis, below')
         if (allocated(error)) return
         call check(error, r%growth(cmplx(0.0_wp, imaginary(order) + near, wp)) > 0.0_wp, 'imaginary axis, above')
         call check(error, r%growth(cmplx(near - real_axis(order), 0.0_wp, wp)) < 0.0_wp, 'real axis, below')
         call check(error, r%growth(cmplx(-near - real_axis(order), 0.0_wp, wp)) > 0.0_wp, 'real axis, above')
         if (allocated(error)) return
      end do
   end subroutine known_limits

   subroutine oscillator_limits(error)
      type(error_type), allocatable, intent(out) :: error
      call step_across_limit(100.0_wp, 0.0_wp, error)
   end subroutine oscillator_limits

   subroutine damper_limits(error)
      type(error_type), allocatable, intent(out) :: error
      call step_across_limit(10.0_wp, 1000.0_wp, error)
   end subroutine damper_limits

   !> Step an oscillator with 0.98 and 1.05 of the limit that is found from 10/w.
   subroutine step_across_limit(frequency, damping, error)
      real(wp), intent(in) :: frequency, damping
      type(error_type), allocatable, intent(out) :: error
      type(stability_function) :: r
      complex(wp) :: lambda(1, 1)
      real(wp) :: limit, t_end
      integer :: i

      lambda(1, 1) = -0.5_wp*damping - sqrt(cmplx(0.25_wp*damping**2 - frequency**2, 0.0_wp, wp))
      do i = 1, size(methods)
         call stability_function_of(r, trim(methods(i)), orders(i), error)
         if (allocated(error)) return
         t_end = n_steps/abs(lambda(1, 1))
         limit = largest_stable_step(r, lambda, 20.0_wp/abs(lambda(1, 1)), t_end)
         call check(error, final_size(i, 0.98_wp*limit) < 1000.0_wp, trim(methods(i))//' grows below its limit')
         if (allocated(error)) return
         call check(error, final_size(i, 1.05_wp*limit) > 1000.0_wp, trim(methods(i))//' stays above its limit')
         if (allocated(error)) return
      end do

   contains

      !> Size of the state at t_end, 1 at the start; huge if the run failed.
      real(wp) function final_size(which, step)
         integer, intent(in) :: which
         real(wp), intent(in) :: step
         type(bounded_oscillator), target :: system
         type(solver_options) :: options
         class(integrator_type), allocatable :: integrator
         type(error_type), allocatable :: failure
         real(wp) :: y(2), t

         system%oscillator = new_oscillator(frequency, .false.)
         system%damping = damping
         options%order = orders(which)
         options%fixed_step = step
         y = [1.0_wp, 0.0_wp]
         call new_integrator(integrator, system, trim(methods(which)), options, failure)
         if (.not. allocated(failure)) call integrator%set_stop(t_end)
         if (.not. allocated(failure)) call integrator%start(0.0_wp, y, failure)
         if (.not. allocated(failure)) call integrator%advance(t_end, y, t, failure)
         final_size = huge(1.0_wp)
         if (.not. allocated(failure)) final_size = norm2([y(1), y(2)/frequency])
         call integrator%finalize()
      end function final_size

   end subroutine step_across_limit

   !> Without dampers, loads and turning, lambda = +- i w.
   subroutine undamped_eigenvalues(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(scene_type) :: scene
      complex(wp), allocatable :: lambda(:, :)
      real(wp), allocatable :: frequency(:), y(:)
      integer :: which, i

      call seed_random(41)
      do which = 1, n_all_kinds
         call random_case(config, which, 3)
         if (config%model%dampers == 'exact') cycle
         config%chain%hinge_damping = 0.0_wp
         config%chain%kink = config%initial%phi - eoshift(config%initial%phi, -1) ! no moments, so no acceleration
         config%loads = config%loads(:0)
         call new_scene(scene, config, error)
         if (allocated(error)) return
         allocate (y(2*scene%n_dof), source=0.0_wp)
         y(scene%phi_at() + 1:scene%phi_at() + 3) = config%initial%phi
         call natural_frequencies(scene, scene%hinges, y(:scene%n_dof), frequency, error)
         if (allocated(error)) return
         call all_eigenvalues(scene, y, 1.0_wp, lambda)
         call check(error, size(lambda), 2*scene%n_dof, 'eigenvalues found')
         if (allocated(error)) return
         do i = 1, size(frequency)
            call check_close(error, minval(abs(lambda - cmplx(0.0_wp, frequency(i), wp)))/maxval(frequency), 0.0_wp, &
                             1.0e-6_wp, kind_name(which))
            if (allocated(error)) return
         end do
         deallocate (y)
      end do
   end subroutine undamped_eigenvalues

   subroutine extreme_rates(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(scene_type) :: scene
      complex(wp), allocatable :: lambda(:, :)
      type(hinge_law) :: hinges
      real(wp), allocatable :: frequency(:), decay(:), q(:), phi(:)
      integer, parameter :: rods(*) = [1, 2, 3, 6, 13, 40] ! fewer unknowns than steps, and more
      integer :: which, j

      call seed_random(42)
      do j = 1, size(rods)
         do which = 1, n_all_kinds
            call random_case(config, which, rods(j))
            call new_scene(scene, config, error)
            if (allocated(error)) return
            if (scene%n_q > scene%n_dof) cycle
            allocate (q(scene%n_q), source=0.0_wp)
            q(scene%phi_at() + 1:scene%phi_at() + scene%n) = config%initial%phi
            hinges = scene%hinges
            if (scene%condensed) then ! its inertia depends on the moments
               phi = [0.0_wp, config%initial%phi]
               call hinges%rest_at(phi(2:) - phi(:scene%n))
            end if
            call natural_frequencies(scene, hinges, q, frequency, error)
            if (allocated(error)) return
            call extreme_eigenvalues(scene, q, lambda)
            call check_from_below(abs(lambda(1, 1)), maxval(frequency), kind_name(which)//': frequency')
            if (allocated(error)) return
            if (scene%hinges%has_damping) then
               call decay_rates(scene, hinges, q, decay, error)
               if (allocated(error)) return
               call check_from_below(abs(lambda(1, 2)), maxval(decay), kind_name(which)//': decay')
               if (allocated(error)) return
            end if
            deallocate (q)
         end do
      end do

   contains

      subroutine check_from_below(found, largest, what)
         real(wp), intent(in) :: found, largest
         character(len=*), intent(in) :: what
         call check(error, found <= largest*(1.0_wp + 1.0e-6_wp), what//' above the highest')
         if (.not. allocated(error)) call check(error, found >= 0.99_wp*largest, what//' not near the highest')
      end subroutine check_from_below

   end subroutine extreme_rates

   !> Two rods that swing a little, for 300 periods of their fastest vibration: largest energy over that at the start.
   subroutine scene_limits(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(scene_type) :: scene
      type(stability_function) :: r
      complex(wp), allocatable :: lambda(:, :)
      real(wp), allocatable :: y(:)
      type(motion_type) :: motion
      real(wp) :: limit, t_end
      integer :: i

      call seed_random(43)
      call random_case(config, 1, 2)
      config%chain%hinge_damping = 0.0_wp
      config%chain%kink = 0.0_wp
      config%loads = config%loads(:0)
      config%initial%alpha = 0.0_wp
      config%initial%beta = 0.0_wp
      call new_scene(scene, config, error)
      if (.not. allocated(error)) call new_motion(motion, scene, .false., error)
      if (allocated(error)) return
      call initial_state(motion, config%initial, y)
      y(:motion%n_q) = 0.0_wp
      y = 1.0e-6_wp*y
      call all_eigenvalues(scene, y, 1.0_wp, lambda)
      t_end = 2000.0_wp/maxval(abs(lambda))
      do i = 1, size(methods)
         call stability_function_of(r, trim(methods(i)), orders(i), error)
         if (allocated(error)) return
         limit = largest_stable_step(r, lambda, 20.0_wp/maxval(abs(lambda)), t_end)
         call check(error, energy_ratio(i, 0.9_wp*limit) < 1.0e6_wp, trim(methods(i))//': explodes below its limit')
         call check(error, energy_ratio(i, 1.5_wp*limit) > 1.0e6_wp, trim(methods(i))//': stays above its limit')
         if (allocated(error)) return
      end do

   contains

      real(wp) function energy_ratio(which, step)
         integer, intent(in) :: which
         real(wp), intent(in) :: step
         type(motion_type), target :: fresh
         type(solver_options) :: options
         class(integrator_type), allocatable :: integrator
         type(error_type), allocatable :: failure
         type(invariants_type) :: first, last
         integer, parameter :: n_looks = 400
         real(wp) :: state(size(y)), t
         integer :: j

         options%order = orders(which)
         options%fixed_step = step
         call new_motion(fresh, scene, .false., failure)
         call fresh%dynamics%set_regime(0.0_wp, t_end)
         call new_integrator(integrator, fresh, trim(methods(which)), options, failure)
         if (.not. allocated(failure)) call integrator%set_stop(t_end)
         if (.not. allocated(failure)) call integrator%start(0.0_wp, y, failure)
         first = state_invariants(fresh, y)
         energy_ratio = 1.0_wp
         do j = 1, n_looks
            if (.not. allocated(failure)) call integrator%advance(t_end*(real(j, wp)/n_looks), state, t, failure)
            if (allocated(failure)) exit
            last = state_invariants(fresh, state)
            energy_ratio = (last%kinetic + last%elastic)/(first%kinetic + first%elastic)
            if (energy_ratio > 1.0e6_wp) exit
         end do
         call integrator%finalize()
      end function energy_ratio

   end subroutine scene_limits

   !> Take the number behind 'steps above'.
   subroutine refusals(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(scene_type) :: scene
      type(motion_type) :: motion
      type(solver_options) :: options
      type(error_type), allocatable :: refusal
      real(wp), allocatable :: y(:)
      character(len=*), parameter :: words = 'with steps above '
      integer :: i, n, at, n_rods

      call seed_random(44)
      do n = 1, 2
         n_rods = merge(3, 40, n == 1)
         call random_case(config, 1, n_rods)
         call new_scene(scene, config, error)
         if (.not. allocated(error)) call new_motion(motion, scene, .false., error)
         if (allocated(error)) return
         call initial_state(motion, config%initial, y)
         do i = 1, size(methods)
            options = solver_options(order=orders(i), fixed_step=0.1_wp)
            call check_fixed_step(trim(methods(i)), options, scene, scene%switches, y, 10.0_wp, refusal)
            call check(error, allocated(refusal), 'not refused')
            if (allocated(error)) return
            call check(error, refusal%exit_code, exit_bad_input, 'exit code')
            if (allocated(error)) return
            at = index(refusal%message, words)
            call check(error, at > 0, 'no limit in: '//refusal%message)
            if (allocated(error)) return
            read (refusal%message(at + len(words):), *) options%fixed_step
            call check_fixed_step(trim(methods(i)), options, scene, scene%switches, y, 10.0_wp, refusal)
            call check(error, .not. allocated(refusal), 'the limit itself is refused')
            if (allocated(error)) return
            options%fixed_step = 0.1_wp
            options%allow_unstable = .true.
            call check_fixed_step(trim(methods(i)), options, scene, scene%switches, y, 10.0_wp, refusal)
            call check(error, .not. allocated(refusal), 'refused although allowed')
            if (allocated(error)) return
         end do
         options = solver_options(fixed_step=0.1_wp)
         call check_fixed_step('gauss', options, scene, scene%switches, y, 10.0_wp, refusal)
         call check(error, .not. allocated(refusal), 'gauss refused')
         if (allocated(error)) return
      end do
   end subroutine refusals

   !> Half as long again as the limit, but a table's knots, or the switches of a user's load, end the steps at 0.9 of it.
   subroutine shortened_steps(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      real(wp) :: limit
      type(idle_load), target :: load
      logical :: watched
      integer, parameter :: n = 100
      integer :: i

      watched = .false.
      call seed_random(45)
      call random_case(config, 1, 3)
      config%t_end = 10.0_wp
      limit = limit_of(1.0_wp)
      config%t_end = 0.9_wp*n*limit
      call check(error, limit_of(1.5_wp*limit) < huge(limit), 'a step above the limit is accepted')
      if (allocated(error)) return
      allocate (config%kink_programs(1))
      config%kink_programs(1)%law = 'table'
      config%kink_programs(1)%times = [(config%t_end*(real(i, wp)/n), i=0, n)]
      config%kink_programs(1)%values = [(0.0_wp, i=0, n)]
      call check(error, limit_of(1.5_wp*limit) >= huge(limit), 'shorter steps are refused')
      if (allocated(error)) return
      load%switches = config%kink_programs(1)%times
      deallocate (config%kink_programs)
      allocate (config%kink_programs(0))
      call check(error, limit_of(1.5_wp*limit) < huge(limit), 'a step above the limit is accepted again')
      if (allocated(error)) return
      watched = .true.
      call check(error, limit_of(1.5_wp*limit) >= huge(limit), 'steps between switches of a user''s load are refused')

   contains

      !> The limit that a refusal names; huge if the step is accepted.
      real(wp) function limit_of(step)
         real(wp), intent(in) :: step
         type(scene_type) :: scene
         type(motion_type), target :: motion
         type(driver_type) :: driver
         type(error_type), allocatable :: refusal
         real(wp), allocatable :: y(:)
         character(len=*), parameter :: words = 'with steps above '

         limit_of = 0.0_wp
         call new_scene(scene, config, refusal)
         if (.not. allocated(refusal)) call new_motion(motion, scene, .false., refusal)
         if (allocated(refusal)) return
         call initial_state(motion, config%initial, y)
         if (watched) call motion%set_user_load(load)
         call new_driver(driver, motion, y, solver_config(method='dop853', fixed_step=step), config%t_end, 1, refusal)
         limit_of = huge(limit_of)
         if (.not. allocated(refusal)) return
         read (refusal%message(index(refusal%message, words) + len(words):), *) limit_of
      end function limit_of

   end subroutine shortened_steps

   !> A kink that bends the chain later is no kink yet; a load that acts to the end of the run acts.
   subroutine eigenvalues_at_start(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      complex(wp), allocatable :: straight(:, :), later(:, :), early(:, :), loaded(:, :), for_ever(:, :)

      call seed_random(46)
      call random_case(config, 1, 3)
      config%t_end = 10.0_wp
      config%loads = config%loads(:0)
      straight = eigenvalues()
      allocate (config%kink_programs(1))
      config%kink_programs(1)%t_start = 1.0_wp
      config%kink_programs(1)%t_end = 2.0_wp
      config%kink_programs(1)%value = 0.5_wp
      later = eigenvalues()
      call check(error, maxval(abs(later - straight)) <= 0.0_wp, 'a kink acts before it is there')
      if (allocated(error)) return
      config%kink_programs(1)%t_start = -2.0_wp
      config%kink_programs(1)%t_end = -1.0_wp
      early = eigenvalues()
      call check(error, maxval(abs(early - straight)) > 1.0e-3_wp, 'a kink that is there does not act')
      if (allocated(error)) return
      deallocate (config%kink_programs)
      deallocate (config%loads)
      allocate (config%loads(1))
      config%loads(1)%component = 'X'
      config%loads(1)%value = 1000.0_wp
      for_ever = eigenvalues()
      call check(error, maxval(abs(for_ever - straight)) > 1.0e-3_wp, 'a load does not act')
      if (allocated(error)) return
      config%loads(1)%t_end = config%t_end
      loaded = eigenvalues()
      call check(error, maxval(abs(loaded - for_ever)) <= 0.0_wp, 'a load to the end of the run does not act')

   contains

      function eigenvalues() result(lambda)
         complex(wp), allocatable :: lambda(:, :)
         type(scene_type) :: scene
         type(motion_type) :: motion
         type(error_type), allocatable :: failure
         real(wp), allocatable :: y(:)

         allocate (lambda(1, 0))
         call new_scene(scene, config, failure)
         if (.not. allocated(failure)) call new_motion(motion, scene, .false., failure)
         if (allocated(failure)) return
         call initial_state(motion, config%initial, y)
         call all_eigenvalues(scene, y, config%t_end, lambda)
      end function eigenvalues

   end subroutine eigenvalues_at_start

end module test_step_limit
