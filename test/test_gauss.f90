!> The collocation method of order 16: against another method, its order, its tolerance, long times, what it refuses.
module test_gauss
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type
   use rodyn_case_config, only: case_config
   use rodyn_lanes, only: lanes
   use rodyn_gauss_collocation, only: gauss_collocation, new_gauss_collocation
   use rodyn_stiff_modes, only: stiff_modes
   use rodyn_modal_reply, only: modal_reply
   use rodyn_lapack, only: dgesv
   use rodyn_orthogonal_columns, only: column_rotator
   use rodyn_scene, only: scene_type, new_scene
   use rodyn_motion, only: motion_type, new_motion, initial_state
   use rodyn_integrator, only: solver_options
   use rodyn_gauss_integrator, only: gauss_integrator, new_gauss_integrator
   use test_testing, only: unittest, new_test, check, check_close
   use test_random_scenes, only: random_case, seed_random, uniform, kind_name, n_all_kinds, allocate_case
   use rodyn_case_reader, only: read_case
   use test_trajectories, only: trajectory, integrate
   implicit none (type, external)
   private
   public :: collect_gauss

   !> A motion that cannot be evaluated in steps of some lengths.
   type, extends(motion_type) :: fickle_motion
      real(wp) :: refused(2) = 0.0_wp !! lengths of such steps [s]
      integer :: n_refused = 0
   contains
      procedure :: lane_accelerations => refuse_some
   end type fickle_motion

contains

   subroutine collect_gauss(suite)
      type(unittest), allocatable, intent(out) :: suite(:)
      suite = [ &
         new_test('collocation matrices integrate, interpolate and have the right functions', test_matrices), &
         new_test('every kind of scene moves as by dop853', test_kinds, long=.true.), &
         new_test('fixed steps show order 16', test_order), &
         new_test('the error follows the tolerance over nine decades', test_tolerance), &
         new_test('large fixed steps keep the energy for thousands of periods', test_energy), &
         new_test('steps far beyond the stiffest vibration keep the slow motion', test_stiff), &
         new_test('few and many columns become orthogonal by rotations, also if some are small', test_columns), &
         new_test('modes that dampers couple answer as the equations of all nodes at once', test_coupled), &
         new_test('dampers of any strength cost no more than 7 iterations a step', test_dampers), &
         new_test('fixed steps bear strong dampers', test_fixed_with_dampers), &
         new_test('dampers alone hold a free hinge', test_free_hinge), &
         new_test('damped slews give every state inside their long steps', test_damped_slews), &
         new_test('long steps follow what strong dampers let go slowly', test_slow_damped), &
         new_test('what a step loses of a damped mode is an integral of a Legendre polynomial', test_lost_response), &
         new_test('what couples modes is judged for steps of each length', test_coupling_of_steps), &
         new_test('a state inside a step is there even if no shorter step is', test_refused_inside), &
         new_test('a run does not depend on the one before', test_history), &
         new_test('relaxing joints are refused by name', test_refused)]
   end subroutine collect_gauss

   !> Powers of x up to the degree where each must be exact.
   subroutine test_matrices(error)
      type(error_type), allocatable, intent(out) :: error
      type(gauss_collocation) :: rule
      real(wp), dimension(lanes, lanes) :: ahead, added, reply
      integer :: k

      call new_gauss_collocation(rule)
      ahead = rule%interpolation(1.0_wp, 0.5_wp)
      do k = 0, lanes - 1
         call check_close(error, matmul(rule%a, rule%c**k), rule%c**(k + 1)/(k + 1), 1.0e-15_wp, 'A')
         call check_close(error, matmul(ahead, rule%c**k), (1.0_wp + 0.5_wp*rule%c)**k, 2.0e-11_wp, 'interpolation')
         if (allocated(error)) return
      end do
      do k = 0, 2*lanes - 1
         call check_close(error, [sum(rule%b*rule%c**k)], [1.0_wp/(k + 1)], 1.0e-15_wp, 'b')
         if (allocated(error)) return
      end do
      ! (1 + A/2 + 9 A^2)^-1 - 1 through the eigenvalues, against its definition: times 1 + A/2 + 9 A^2 it is minus A/2 + 9 A^2.
      added = 0.5_wp*rule%a + 9.0_wp*matmul(rule%a, rule%a)
      call rule%mode_reply(0.5_wp, 9.0_wp, reply)
      call check(error, maxval(abs(reply + matmul(reply, added) + added)) < 1.0e-9_wp, 'mode_reply')
   end subroutine test_matrices

   subroutine test_kinds(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: motion, other
      integer :: which, i

      call seed_random(161)
      do which = 1, n_all_kinds
         if (index(kind_name(which), 'exact') > 0) cycle ! joints of their own
         call random_case(config, which, 4)
         config%chain%bending_stiffness = 100.0_wp*config%chain%bending_stiffness
         config%solver%rtol = 1.0e-13_wp
         config%solver%atol = 1.0e-14_wp
         config%solver%method = 'gauss'
         call integrate(config, [0.01_wp, 0.05_wp], motion, error)
         if (allocated(error)) return
         config%solver%method = 'dop853'
         call integrate(config, [0.01_wp, 0.05_wp], other, error)
         if (allocated(error)) return
         do i = 1, 2
            associate (a => motion%rows(i), b => other%rows(i))
               call check_close(error, [a%displacement_x, a%displacement_y, a%rotation, a%phi], &
                                [b%displacement_x, b%displacement_y, b%rotation, b%phi], 1.0e-8_wp, kind_name(which))
               call check_close(error, [a%work_external, a%energy_dissipated], [b%work_external, b%energy_dissipated], &
                                1.0e-8_wp*(1.0_wp + abs(b%work_external) + b%energy_dissipated), kind_name(which)//' ledger')
               if (allocated(error)) return
            end associate
         end do
      end do
   end subroutine test_kinds

   !> Errors of alpha' at 0.1 s of table 1 with fixed steps of 5.6, 4.7 and 3.8 in phase of the fastest vibration.
   subroutine test_order(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: exact, motion
      integer, parameter :: n_steps(3) = [50, 60, 74]
      real(wp) :: e(3)
      integer :: i

      call table1_case(config, error)
      if (allocated(error)) return
      config%solver%method = 'dop853'
      call integrate(config, [0.1_wp], exact, error)
      if (allocated(error)) return
      config%solver%method = 'gauss'
      do i = 1, 3
         config%solver%fixed_step = 0.1_wp/n_steps(i)
         call integrate(config, [0.1_wp], motion, error)
         if (allocated(error)) return
         e(i) = norm2(motion%rows(1)%alpha_rate - exact%rows(1)%alpha_rate)
      end do
      associate (order => log(e(:2)/e(2:))/log(real(n_steps(2:), wp)/real(n_steps(:2), wp)))
         call check(error, all(abs(order - 16.0_wp) < 1.0_wp), 'observed order')
      end associate
   end subroutine test_order

   subroutine test_tolerance(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: exact, motion
      real(wp) :: ratio(9)
      integer :: i

      call table1_case(config, error)
      if (allocated(error)) return
      config%solver%method = 'dop853'
      call integrate(config, [0.25_wp], exact, error)
      if (allocated(error)) return
      config%solver%method = 'gauss'
      do i = 1, 9
         config%solver%rtol = 10.0_wp**(-2 - i)
         config%solver%atol = 0.01_wp*config%solver%rtol
         call integrate(config, [0.25_wp], motion, error)
         if (allocated(error)) return
         ratio(i) = maxval(abs(motion%rows(1)%alpha_rate - exact%rows(1)%alpha_rate))/config%solver%rtol
      end do
      call check(error, maxval(ratio) < 20.0_wp .and. minval(ratio) > 0.02_wp, 'error over tolerance')
   end subroutine test_tolerance

   !> Free, undamped vibration of one flexible rod on a spacecraft, thousands of its fastest periods.
   subroutine test_energy(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: motion
      integer :: i

      call table1_case(config, error)
      if (allocated(error)) return
      deallocate (config%loads)
      config%chain%hinge_damping = 0.0_wp
      config%initial%phi_rate = [0.1_wp, -0.2_wp, 0.3_wp, 0.1_wp]
      config%initial%alpha_rate = 0.5_wp
      config%output%ledger = .true.
      config%solver%method = 'gauss'
      config%solver%fixed_step = 1.0e-3_wp
      call integrate(config, [(0.5_wp*i, i=0, 10)], motion, error)
      if (allocated(error)) return
      do i = 1, size(motion%rows)
         associate (row => motion%rows(i), first => motion%rows(1))
            call check_close(error, row%energy_residual/(first%energy_kinetic + first%energy_elastic), 0.0_wp, 2.0e-12_wp, 'energy')
            if (allocated(error)) return
         end associate
      end do
   end subroutine test_energy

   !> Bending 100 times stiffer than it is, and steps of 56 in phase: the iteration converges, the fast vibrations are
   !> not resolved, and the slow motion is right all the same.
   subroutine test_stiff(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: exact, motion

      call table1_case(config, error)
      if (allocated(error)) return
      config%chain%bending_stiffness = 100.0_wp*config%chain%bending_stiffness
      config%solver%method = 'dop853'
      call integrate(config, [0.2_wp], exact, error)
      if (allocated(error)) return
      config%solver%method = 'gauss'
      config%solver%rtol = 1.0e-9_wp
      config%solver%atol = 1.0e-11_wp
      config%solver%fixed_step = 2.0e-3_wp
      call integrate(config, [0.2_wp], motion, error)
      if (allocated(error)) return
      call check_close(error, motion%rows(1)%phi, exact%rows(1)%phi, 1.0e-5_wp, 'phi')
   end subroutine test_stiff

   !> Rotations leave B B^T and C B^T, with C the rows below B.
   subroutine test_columns(error)
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: m = 50, counts(*) = [8, 23, 24, 40, 40]
      real(wp), parameter :: negligible = 1.0e-9_wp, scales(*) = [1.0_wp, 1.0e-9_wp, 1.0_wp, 1.0_wp, 1.0e-9_wp] ! of the last column
      type(column_rotator) :: rotator
      real(wp), allocatable :: x(:, :), squares(:)
      real(wp) :: before(2*m, m), gram, allowed, found
      integer :: which, i, j, n

      call seed_random(311)
      do which = 1, size(counts)
         n = counts(which)
         if (allocated(x)) deallocate (x, squares)
         allocate (x(2*m, n), squares(n))
         do j = 1, n
            do i = 1, 2*m
               x(i, j) = scales(which)**(real(j - 1, wp)/(n - 1))*uniform(-1.0_wp, 1.0_wp)
            end do
         end do
         before = matmul(x, transpose(x(:m, :)))
         call rotator%orthogonalise(x, m, 0.0_wp, negligible, squares)
         found = 0.0_wp
         do j = 1, n
            do i = 1, j - 1
               gram = dot_product(x(:m, i), x(:m, j))
               allowed = 2.0_wp*negligible*min(squares(i), squares(j)) + 8.0_wp*epsilon(1.0_wp)*sqrt(squares(i)*squares(j))
               found = max(found, abs(gram)/allowed)
            end do
            call check_close(error, squares(j), dot_product(x(:m, j), x(:m, j)), 1.0e-10_wp*squares(j), 'squares')
            if (allocated(error)) return
         end do
         call check(error, found <= 1.0_wp, 'columns are not orthogonal')
         call check_close(error, [matmul(x, transpose(x(:m, :)))], [before], 1.0e-12_wp*maxval(abs(before)), 'no rotation')
         if (allocated(error)) return
      end do
   end subroutine test_columns

   !> z = (1 + h A D + h^2 A^2 K)^-1 r - r for three modes, by LAPACK from the equations of all nodes and modes at once. Where
   !> each damper is moved by one mode only, both ways of the program must agree, too.
   subroutine test_coupled(error)
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: n = 3, m = n*lanes
      real(wp), parameter :: h = 0.3_wp
      type(gauss_collocation) :: rule
      type(stiff_modes) :: modes
      type(modal_reply) :: modal
      real(wp) :: matrix(m, m), x(m, 1), residuals(lanes, n), reply(lanes, n), k_ij, d_ij
      integer :: pivots(m), info, i, j, l

      call new_gauss_collocation(rule)
      call modes%reserve(n, n, 0, 2)
      modes%n = n
      modes%weight = 0.7_wp
      modes%square = [900.0_wp, 30.0_wp, 5.0_wp]
      modes%influence = reshape([0.2_wp, 0.4_wp, -0.3_wp, -0.1_wp, 0.3_wp, 0.8_wp], [n, 2])
      modes%influence_t = transpose(modes%influence)
      residuals = reshape([(sin(3.0_wp*i), i=1, m)], [lanes, n])
      do i = 1, n
         do j = 1, n
            d_ij = modes%square(i)*dot_product(modes%influence_t(:, i), modes%influence_t(:, j))
            k_ij = -modes%weight*d_ij
            if (i == j) k_ij = k_ij + modes%square(i)
            matrix((i - 1)*lanes + 1:i*lanes, (j - 1)*lanes + 1:j*lanes) = h*d_ij*rule%a + h**2*k_ij*rule%a2
         end do
      end do
      do l = 1, m
         matrix(l, l) = matrix(l, l) + 1.0_wp
      end do
      x = reshape(residuals, [m, 1])
      call dgesv(m, 1, matrix, m, pivots, x, m, info)
      call modal%prepare(rule, modes, h, .true.)
      call modal%answer(rule, modes, residuals, reply)
      call check(error, info == 0 .and. maxval(abs(reply + residuals - reshape(x, [lanes, n]))) < 1.0e-9_wp, 'coupled')
      if (allocated(error)) return
      modes%influence = 0.0_wp
      modes%influence(1, 1) = 0.3_wp
      modes%influence(3, 2) = 0.5_wp
      modes%influence_t = transpose(modes%influence)
      modes%damping = modes%square*sum(modes%influence**2, dim=2)
      modes%omega_2 = modes%square - modes%weight*modes%damping
      call modal%prepare(rule, modes, h, .true.)
      call modal%answer(rule, modes, residuals, reply)
      x = reshape(reply, [m, 1])
      call modal%prepare(rule, modes, h, .false.)
      call modal%answer(rule, modes, residuals, reply)
      call check_close(error, reshape(reply, [m]), x(:, 1), 1.0e-10_wp, 'not coupled')
   end subroutine test_coupled

   !> Dampers of table 1 times 1 to 1e6, decay rates up to 2000 times the fastest frequency, against explicit steps or BDF.
   subroutine test_dampers(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: exact, motion
      character(len=40) :: text
      integer :: i

      do i = 0, 6
         call table1_case(config, error)
         if (allocated(error)) return
         config%chain%hinge_damping = 10.0_wp**i*config%chain%hinge_damping
         call integrate_both(config, merge('dop853', 'bdf   ', i < 4), 1.0e-8_wp, 0.0_wp, exact, motion, error)
         if (allocated(error)) return
         write (text, '(a, i0, 2(a, i0))') 'D times 1e', i, ': steps ', motion%counts%n_steps, ', rhs ', motion%counts%n_rhs
         call check_close(error, motion%rows(1)%phi, exact%rows(1)%phi, 1.0e-8_wp, text)
         call check(error, motion%counts%n_steps < 100 .and. motion%counts%n_rhs < 7*lanes*motion%counts%n_steps, text)
         if (allocated(error)) return
      end do
   end subroutine test_dampers

   !> To 0.1 s by a reference method at a tight tolerance, and by `gauss`.
   subroutine integrate_both(config, reference, tolerance, fixed_step, exact, motion, error)
      type(case_config), intent(inout) :: config
      character(len=*), intent(in) :: reference
      real(wp), intent(in) :: tolerance, fixed_step !! of `gauss`; 0: adaptive
      type(trajectory), intent(out) :: exact, motion
      type(error_type), allocatable, intent(out) :: error

      config%solver%method = reference
      config%solver%rtol = 1.0e-11_wp
      config%solver%atol = 1.0e-13_wp
      call integrate(config, [0.1_wp], exact, error)
      if (allocated(error)) return
      config%solver%method = 'gauss'
      config%solver%rtol = tolerance
      config%solver%atol = tolerance
      config%solver%fixed_step = fixed_step
      call integrate(config, [0.1_wp], motion, error)
   end subroutine integrate_both

   !> The search for modes begins with those of the search before, but not with those of another run.
   subroutine test_history(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(scene_type) :: scene
      type(motion_type), target :: motion
      type(gauss_integrator) :: integrator
      real(wp), allocatable :: first(:), y(:)
      real(wp) :: t
      integer :: i

      do i = 1, 4 ! two runs without, two with strong dampers, which have another matrix factored
         if (modulo(i, 2) == 1) then
            call table1_case(config, error)
            if (allocated(error)) return
            if (i > 1) config%chain%hinge_damping = 1.0e5_wp*config%chain%hinge_damping
            call new_scene(scene, config, error)
            if (allocated(error)) return
            call new_motion(motion, scene, .false., error)
            if (allocated(error)) return
            call motion%dynamics%set_regime(0.0_wp, 1.0_wp)
         end if
         call initial_state(motion, config%initial, y)
         call new_gauss_integrator(integrator, motion, solver_options(rtol=1.0e-4_wp, atol=1.0e-4_wp), error)
         if (allocated(error)) return
         call integrator%set_stop(0.1_wp)
         call integrator%start(0.0_wp, y, error)
         if (allocated(error)) return
         call integrator%advance(0.1_wp, y, t, error)
         if (allocated(error)) return
         call integrator%finalize()
         if (modulo(i, 2) == 1) first = y
         call check(error, all(abs(y - first) <= 0.0_wp), 'another run by the same motion ends elsewhere')
         if (allocated(error)) return
      end do
   end subroutine test_history

   !> Fixed steps know their length before the first one.
   subroutine test_fixed_with_dampers(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: exact, motion

      call table1_case(config, error)
      if (allocated(error)) return
      config%chain%hinge_damping = 1.0e5_wp*config%chain%hinge_damping
      call integrate_both(config, 'bdf', 1.0e-9_wp, 1.0e-3_wp, exact, motion, error)
      if (allocated(error)) return
      call check_close(error, motion%rows(1)%phi, exact%rows(1)%phi, 1.0e-6_wp, 'phi')
      call check(error, motion%counts%n_steps == 100 .and. motion%counts%n_rhs < 6*lanes*100, 'effort')
   end subroutine test_fixed_with_dampers

   !> No spring in a hinge, but a strong damper: it is no part of the stiffness.
   subroutine test_free_hinge(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: exact, motion

      call table1_case(config, error)
      if (allocated(error)) return
      config%chain%hinge_stiffness(2) = 0.0_wp
      config%chain%hinge_damping = 100.0_wp
      call integrate_both(config, 'bdf', 1.0e-8_wp, 0.0_wp, exact, motion, error)
      if (allocated(error)) return
      call check_close(error, motion%rows(1)%phi, exact%rows(1)%phi, 1.0e-8_wp, 'phi')
      call check(error, motion%counts%n_steps < 100 .and. motion%counts%n_rhs < 7*lanes*motion%counts%n_steps, 'effort')
   end subroutine test_free_hinge

   !> Long after the load these steps are of a second or more, in which dampers do not couple the modes, with up to ten outputs
   !> inside, in shorter steps in which they do.
   subroutine test_damped_slews(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: exact, motion
      integer :: i, j
      integer, parameter :: n_rods(3) = [3, 2, 3]
      real(wp), parameter :: bending(3) = [1.0e3_wp, 3.0e2_wp, 3.0e2_wp], spring(3) = [308.5_wp, 111.0_wp, 79.42_wp], &
         damper(3) = [3.598_wp, 1.797_wp, 3.192_wp], tolerance = 1.0e-8_wp, times(*) = [(0.2_wp*i, i=1, 175)]

      do j = 1, 3
         call slew(config, n_rods(j), bending(j), spring(j), damper(j))
         config%solver%method = 'dop853'
         config%solver%rtol = 1.0e-12_wp
         config%solver%atol = 1.0e-14_wp
         call integrate(config, times, exact, error)
         if (allocated(error)) return
         config%solver%method = 'gauss'
         config%solver%rtol = tolerance
         config%solver%atol = 0.01_wp*tolerance
         call integrate(config, times, motion, error)
         if (allocated(error)) return
         do i = 1, size(times)
            call check_close(error, motion%rows(i)%phi, exact%rows(i)%phi, 10.0_wp*tolerance, 'phi')
            if (allocated(error)) return
         end do
         call check(error, motion%counts%last_step > 1.0_wp, 'the steps are short')
         if (allocated(error)) return
      end do
   end subroutine test_damped_slews

   !> Dampers of the boom against light rods: modes of 5000 1/s that give way at 30 to 130 1/s, in steps of 1 to 2 s. The mean of F
   !> neglects next to nothing there, but positions are lost, 76 rtol at 1e-8 and 269 at 1e-9 where nobody looks.
   subroutine test_slow_damped(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(trajectory) :: exact, motion
      integer :: i, digits
      real(wp) :: tolerance, largest
      real(wp), parameter :: times(*) = [(0.1_wp*i, i=1, 350)]

      call read_case('cases/boom_slew.nml', config, error=error)
      if (allocated(error)) return
      config%output%ledger = .false.
      config%solver%method = 'dop853'
      config%solver%rtol = 1.0e-12_wp
      config%solver%atol = 1.0e-14_wp
      call integrate(config, times, exact, error)
      if (allocated(error)) return
      largest = maxval([(maxval(abs(exact%rows(i)%phi)), i=1, size(times))])
      config%solver%method = 'gauss'
      do digits = 8, 9
         tolerance = 10.0_wp**(-digits)
         config%solver%rtol = tolerance
         config%solver%atol = 0.01_wp*tolerance
         call integrate(config, times, motion, error)
         if (allocated(error)) return
         do i = 1, size(times)
            call check_close(error, motion%rows(i)%phi, exact%rows(i)%phi, 10.0_wp*tolerance*largest, 'phi')
            if (allocated(error)) return
         end do
         call check(error, motion%counts%n_steps < 130, 'too many steps')
         if (allocated(error)) return
      end do
   end subroutine test_slow_damped

   !> A mode that gives way at the rate r answers to P_8 with h r times the integral of exp(-h r (1 - x)) P_8(2 x - 1), here by
   !> midpoints. Coefficients that do not fall off leave the eighth as large as the last ones.
   subroutine test_lost_response(error)
      type(error_type), allocatable, intent(out) :: error
      type(stiff_modes) :: modes
      real(wp), parameter :: phases(*) = [20.0_wp, 50.0_wp, 300.0_wp], h = 0.7_wp, tolerances = 1.0e6_wp
      real(wp) :: answer, forces(lanes, 1), x
      integer :: i, j
      integer, parameter :: n = 20000

      call modes%reserve(1, 1, 0, 1)
      modes%n = 1
      forces(:, 1) = [0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.6_wp, 0.8_wp, 0.8_wp, 0.6_wp]
      do i = 1, size(phases)
         modes%damping = 1.0e6_wp
         modes%omega_2 = modes%damping*phases(i)/h
         answer = 0.0_wp
         do j = 1, n
            x = (j - 0.5_wp)/n
            answer = answer + phases(i)/n*exp(-phases(i)*(1.0_wp - x))*legendre_8(2.0_wp*x - 1.0_wp)
         end do
         call check_close(error, modes%lost_response(h, forces, [tolerances]), answer/modes%omega_2(1)*tolerances, &
                          0.05_wp*answer/modes%omega_2(1)*tolerances, 'answer to P_8')
         if (allocated(error)) return
      end do
      modes%omega_2 = 1.0_wp ! slower than the step
      call check(error, .not. modes%lost_response(h, forces, [tolerances]) > 0.0_wp, 'slow modes lose nothing')
   end subroutine test_lost_response

   pure real(wp) function legendre_8(x)
      real(wp), intent(in) :: x
      legendre_8 = (6435.0_wp*x**8 - 12012.0_wp*x**6 + 6930.0_wp*x**4 - 1260.0_wp*x**2 + 35.0_wp)/128.0_wp
   end function legendre_8

   !> A spacecraft with equal rods that a moment turns for a second.
   subroutine slew(config, n, bending, spring, damper)
      type(case_config), intent(out) :: config
      integer, intent(in) :: n
      real(wp), intent(in) :: bending, spring, damper !! EI, C, D
      call allocate_case(config, n)
      config%spacecraft%mass = 300.0_wp
      config%spacecraft%inertia = 120.0_wp
      config%spacecraft%hinge_x = 0.7_wp
      config%chain%length = 2.0_wp
      config%chain%mass_per_length = 0.8_wp
      config%chain%bending_stiffness = bending
      config%chain%hinge_stiffness = spring
      config%chain%hinge_damping = damper
      deallocate (config%loads)
      allocate (config%loads(1))
      config%loads%component = 'M'
      config%loads%value = 10.0_wp
      config%loads%t_end = 1.0_wp
      config%output%ledger = .false.
   end subroutine slew

   !> Two modes with omega = 1 and 100 that one damper couples, by definition: the off-diagonal of h lambda D in units that make the
   !> diagonal of 1 + (h lambda)^2 K one is largest for h lambda = 1/10, and falls off to both sides.
   subroutine test_coupling_of_steps(error)
      type(error_type), allocatable, intent(out) :: error
      type(stiff_modes) :: modes
      real(wp) :: weight, off_diagonal
      integer :: i

      call modes%reserve(2, 2, 0, 1)
      modes%n = 2
      modes%square = [1.0_wp, 1.0e4_wp]
      modes%influence(:, 1) = [0.2_wp, 0.2_wp]
      modes%influence_t = transpose(modes%influence)
      call modes%bound_coupling()
      do i = -5, 9
         weight = 10.0_wp**(0.5_wp*i)
         off_diagonal = weight*0.04_wp*100.0_wp/sqrt((weight**2 + 1.0_wp)*(weight**2 + 1.0e4_wp))
         call check(error, modes%couples(weight) .eqv. off_diagonal > 0.03_wp, 'coupled')
         if (allocated(error)) return
      end do
      modes%influence_t = 0.8_wp*modes%influence_t ! now the largest is 0.025
      call modes%bound_coupling()
      call check(error, .not. modes%couples(10.0_wp), 'not coupled')
   end subroutine test_coupling_of_steps

   !> One step of 0.1 s, and a state at 0.06 s: by one shorter step, by two where that one is refused, by the polynomial of the
   !> step, which is of lower order, where all are.
   subroutine test_refused_inside(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(scene_type) :: scene
      type(fickle_motion), target :: motion
      type(gauss_integrator) :: integrator
      real(wp), parameter :: lengths(2, 3) = reshape([0.0_wp, 0.0_wp, 0.05_wp, 0.07_wp, 0.0_wp, 0.07_wp], [2, 3]), &
         closeness(3) = [0.0_wp, 1.0e-9_wp, 1.0e-5_wp] ! the iteration leaves 0.05 rtol
      integer, parameter :: n_refused(3) = [0, 1, 4]
      real(wp), allocatable :: y(:), first(:)
      real(wp) :: t
      integer :: i

      call slew(config, 3, 1.0e3_wp, 300.0_wp, 0.0_wp)
      config%model%bending = 'rigid'
      config%initial%phi = [0.2_wp, 0.4_wp, 0.5_wp]
      call new_scene(scene, config, error)
      if (allocated(error)) return
      do i = 1, 3
         call new_motion(motion%motion_type, scene, .true., error)
         if (allocated(error)) return
         motion%refused = lengths(:, i)
         motion%n_refused = 0
         call motion%dynamics%set_regime(0.0_wp, 1.0_wp)
         call initial_state(motion%motion_type, config%initial, y)
         call new_gauss_integrator(integrator, motion, solver_options(fixed_step=0.1_wp), error)
         if (allocated(error)) return
         call integrator%set_stop(0.1_wp)
         call integrator%start(0.0_wp, y, error)
         if (allocated(error)) return
         call integrator%advance(0.06_wp, y, t, error)
         if (allocated(error)) return
         call integrator%finalize()
         if (i == 1) first = y
         call check_close(error, y, first, closeness(i), 'state inside the step')
         call check(error, abs(t - 0.06_wp) <= 0.0_wp .and. motion%n_refused == n_refused(i), 'refusals')
         if (allocated(error)) return
      end do
   end subroutine test_refused_inside

   subroutine refuse_some(self, t, q, p, acceleration, ok)
      class(fickle_motion), intent(inout) :: self
      real(wp), intent(in) :: t(lanes)
      real(wp), contiguous, intent(in) :: q(:, :), p(:, :)
      real(wp), contiguous, intent(out) :: acceleration(:, :)
      logical, intent(out) :: ok
      real(wp) :: length

      call self%motion_type%lane_accelerations(t, q, p, acceleration, ok)
      length = (t(lanes) - t(1))/0.96028986_wp ! between the outer nodes
      if (length < self%refused(1) .or. length > self%refused(2)) return
      if (all(abs(t - t(1)) <= 0.0_wp)) return ! the first guess of all
      ok = .false.
      self%n_refused = self%n_refused + 1
   end subroutine refuse_some

   subroutine test_refused(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: refusal
      type(case_config) :: config
      type(trajectory) :: motion

      call table1_case(config, error)
      if (allocated(error)) return
      config%model%inertia = 'lumped'
      config%model%bending = 'quasistatic'
      config%model%dampers = 'exact'
      config%solver%method = 'gauss'
      call integrate(config, [0.1_wp], motion, refusal)
      call check(error, allocated(refusal), 'not refused')
      if (allocated(error)) return
      call check(error, index(refusal%message, "dampers = 'exact'") > 0, refusal%message)
   end subroutine test_refused

   !> Table 1 with all inertia terms, at a tight tolerance.
   subroutine table1_case(config, error)
      type(case_config), intent(out) :: config
      type(error_type), allocatable, intent(out) :: error
      call read_case('cases/table1.nml', config, error=error)
      if (allocated(error)) return
      config%model%formulation = 'consistent'
      config%output%ledger = .false.
      config%solver%rtol = 1.0e-13_wp
      config%solver%atol = 1.0e-14_wp
   end subroutine table1_case

end module test_gauss
