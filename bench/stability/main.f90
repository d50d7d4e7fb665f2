!> Measurements for bench/stability/run.py, one table each, columns apart by tabs:
!>
!>     tools/bench stability limits | orders | tableaux | tolerances | configurations | samples | extremes
!>     tools/bench stability drift SCENE PERIODS METHOD...
!>     tools/bench stability reference SCENE.nml STEPS TIME...   (for bench/work_precision/run.py)
program bench_stability
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type
   use rodyn_case_config, only: case_config
   use rodyn_case_reader, only: read_case
   use rodyn_scene, only: scene_type, new_scene
   use rodyn_frequencies, only: decay_rates, natural_frequencies
   use rodyn_accelerations, only: dynamics_type, new_dynamics
   use rodyn_erk_tableau, only: erk_tableau
   use rodyn_stability_function, only: stability_function, stability_function_of
   use rodyn_step_limit, only: largest_stable_step
   use rodyn_bench_campaign_runs, only: run_result, run_campaign_case, article_chain
   use rodyn_bench_quad_reference, only: qp, quad_accelerations, quad_motion, condition_number, supported
   implicit none (type, external)

   character(len=1), parameter :: tab = achar(9)
   character(len=6), parameter :: explicit(8) = [character(len=6) :: 'erk', 'erk', 'erk', 'erk', 'erk', 'erk', 'erk', 'dop853']
   integer, parameter :: orders(8) = [2, 3, 4, 5, 6, 7, 8, 8]
   real(wp), parameter :: pi = acos(-1.0_wp)
   character(len=32) :: command

   call get_command_argument(1, command)
   select case (command)
   case ('limits'); call limits()
   case ('orders'); call observed_orders()
   case ('tableaux'); call tableaux()
   case ('tolerances'); call tolerances()
   case ('configurations'); call configurations()
   case ('samples'); call samples()
   case ('extremes'); call extremes()
   case ('drift'); call drift()
   case ('reference'); call print_reference()
   case default
      error stop 'tools/bench stability PART ...: see the head of its source'
   end select

contains

   !> h omega of each explicit method that grows by 1000 in runs of so many radians, and h decay in a thousand decays.
   subroutine limits()
      real(wp), parameter :: radians(3) = [1.0e3_wp, 1.0e6_wp, 1.0e9_wp]
      type(stability_function) :: r
      type(error_type), allocatable :: error
      complex(wp) :: vibration(1, 1), decay(1, 1)
      integer :: i, j

      vibration = cmplx(0.0_wp, 1.0_wp, wp)
      decay = -1.0_wp
      do i = 1, size(explicit)
         call stability_function_of(r, trim(explicit(i)), orders(i), error)
         write (*, '(a, a, i0, 4(a, f7.4))') trim(explicit(i)), tab, orders(i), &
            (tab, largest_stable_step(r, vibration, 20.0_wp, radians(j)), j=1, 3), &
            tab, largest_stable_step(r, decay, 20.0_wp, 1.0e3_wp)
      end do
   end subroutine limits

   !> A short scene for errors: three rods, one load, all frequencies within a decade and a half.
   subroutine error_scene(config)
      type(case_config), intent(out) :: config
      call article_chain(config, 2)
      config%chain%bending_stiffness = 400.0_wp
      config%chain%hinge_stiffness = [300.0_wp, 200.0_wp]
      config%chain%hinge_damping = [0.2_wp, 0.1_wp]
      config%initial%phi = [0.5_wp, -0.4_wp]
   end subroutine error_scene

   !> State of the scene at t in quadruple precision: q, then p.
   function reference(config, t, steps) result(y)
      type(case_config), intent(in) :: config
      real(wp), intent(in) :: t
      integer, intent(in) :: steps
      real(qp), allocatable :: y(:)
      integer :: m

      call state_at_start(config, y, m)
      call quad_motion(config, t, steps, y(:m), y(m + 1:))
   end function reference

   !> A scene in quadruple precision: a line for each of the times, chord angles and then slope rates alpha', apart by tabs.
   !> STEPS is their number between two of the times.
   subroutine print_reference()
      type(case_config) :: config
      type(error_type), allocatable :: error
      real(qp), allocatable :: y(:)
      character(len=4096) :: word
      real(wp) :: t, before
      integer :: i, j, m, steps, base

      call get_command_argument(2, word)
      call read_case(trim(word), config, error=error)
      if (allocated(error)) error stop 'the scene cannot be read'
      if (.not. supported(config)) error stop 'this reference does not know such scenes'
      call get_command_argument(3, word)
      read (word, *) steps
      call state_at_start(config, y, m)
      base = merge(0, 3, config%spacecraft%motion == 'fixed')
      before = 0.0_wp
      do i = 4, command_argument_count()
         call get_command_argument(i, word)
         read (word, *) t
         call quad_motion(config, t - before, steps, y(:m), y(m + 1:))
         before = t
         associate (n => config%chain%n_rods)
            write (*, '(*(es41.32, :, a))') (y(base + j), tab, j=1, n), &
               (y(m + base + n + j), tab, j=1, merge(n, 0, config%model%bending == 'dynamic'))
         end associate
      end do
   end subroutine print_reference

   subroutine state_at_start(config, y, m)
      type(case_config), intent(in) :: config
      real(qp), allocatable, intent(out) :: y(:)
      integer, intent(out) :: m !! length of q
      integer :: n, base

      n = config%chain%n_rods
      base = merge(0, 3, config%spacecraft%motion == 'fixed')
      m = base + merge(3, 1, config%model%bending == 'dynamic')*n
      allocate (y(2*m), source=0.0_qp)
      associate (initial => config%initial)
         y(base + 1:base + n) = initial%phi
         y(m + base + 1:m + base + n) = initial%phi_rate
         if (base > 0) y(m + 1:m + 3) = [initial%velocity_x, initial%velocity_y, initial%omega]
         if (m == base + n) return
         y(base + n + 1:m) = [initial%alpha, initial%beta]
         y(m + base + n + 1:) = [initial%alpha_rate, initial%beta_rate]
      end associate
   end subroutine state_at_start

   !> The tables of `erk` of order 6 and more, for `quad_orders`: order and stages, then b and the columns of a.
   subroutine tableaux()
      real(wp), allocatable :: a(:, :), b(:), c(:)
      type(error_type), allocatable :: error
      integer :: order

      do order = 6, 8
         call erk_tableau(order, a, b, c, error)
         if (allocated(error)) error stop 'no table'
         write (*, '(i0, 1x, i0)') order, size(b)
         write (*, '(es24.16)') b, a
      end do
   end subroutine tableaux

   !> Errors of six fixed steps, the slope of a straight line through their logarithms, and the slope that the method's stability
   !> function foretells: over five halvings, or as many as there are between the steps at which further terms of the expansion
   !> are seen and those at which rounding is.
   !>
   !> A rod is let go at rest and swings. Of R(i y) exp(-i y) - 1 = c_p+1 (i y)^(p+1) + c_p+2 (i y)^(p+2) + ..., y = h omega,
   !> the even powers change the amplitude and the odd ones the phase, and with c_p+2 ten times c_p+1 the wrong one of the two
   !> prevails at all steps that double precision leaves. So methods of even order are looked at where the rod turns, and an
   !> error of phase is one of velocity, the larger part of the norm by omega; those of odd order where it passes the middle.
   subroutine observed_orders()
      integer, parameter :: points = 6, methods = size(explicit) + 1
      real(wp), parameter :: coarsest(methods) = [0.05_wp, 0.1_wp, 0.2_wp, 0.2_wp, 0.1_wp, 0.4_wp, 0.4_wp, 0.8_wp, 2.4_wp]
      real(wp), parameter :: halvings(methods) = [5.0_wp, 5.0_wp, 5.0_wp, 5.0_wp, 2.5_wp, 3.0_wp, 2.0_wp, 3.0_wp, 0.5_wp]
      type(case_config) :: config
      type(run_result) :: result
      real(qp), allocatable :: truth(:)
      real(wp) :: fastest, t_end, error(points), step(points), expected(points)
      integer :: i, j, order

      do i = 1, methods
         order = 16
         call article_chain(config, 1)
         config%model%bending = 'rigid'
         config%chain%hinge_stiffness = 300.0_wp
         config%initial%omega = 0.0_wp
         config%initial%phi_rate = 0.0_wp
         config%initial%phi = merge(0.03_wp, 0.3_wp, i == methods) ! harmonics of large swings cross the steps of gauss
         config%solver%rtol = 1.0e-15_wp ! of the iteration of gauss
         config%solver%atol = 1.0e-16_wp
         config%solver%method = 'gauss'
         if (i < methods) then
            order = orders(i)
            config%solver%method = explicit(i)
            config%solver%order = order
         end if
         fastest = highest_frequency(config)
         call find_look(config, merge(40.0_wp, 4.0_wp, i == methods), fastest, modulo(order, 2) == 0, t_end, truth)
         do j = 1, points
            config%solver%fixed_step = t_end/anint(t_end*fastest/coarsest(i)*2.0_wp**(halvings(i)*(j - 1)/(points - 1)))
            call run_campaign_case(config, [0.0_wp, t_end], 60.0_wp, result)
            error(j) = real(norm2(result%y(:size(truth)) - truth)/norm2(truth), wp)
            if (result%status /= 'done') error(j) = huge(1.0_wp)
            step(j) = config%solver%fixed_step
            expected(j) = expected_error(config%solver%method, order, step(j)*fastest)
         end do
         write (*, '(a, a, i0, 3(a, f6.2), 7(a, es10.2e3))') trim(config%solver%method), tab, order, tab, halvings(i), &
            tab, slope(log(step), log(error)), tab, slope(log(step), log(expected)), tab, step(1)*fastest, &
            (tab, error(j), j=1, points)
      end do
   end subroutine observed_orders

   !> Where the rod turns, or passes the middle, next to a time, and its state there.
   subroutine find_look(config, near, frequency, turns, t, state)
      type(case_config), intent(in) :: config !! of one rigid rod
      real(wp), intent(in) :: near, frequency !! [s], [rad/s]
      logical, intent(in) :: turns
      real(wp), intent(out) :: t              !! [s]
      real(qp), allocatable, intent(out) :: state(:)
      integer, parameter :: iterations = 6, at_phi = 4
      integer :: i

      t = near
      do i = 1, iterations
         state = reference(config, t, ceiling(t*frequency/0.75_wp))
         associate (phi => real(state(at_phi), wp), rate => real(state(size(state)), wp)/frequency)
            ! The phase of a harmonic motion, from the nearest turn or passage.
            if (turns) t = t + atan(rate/phi)/frequency
            if (.not. turns) t = t - atan(phi/rate)/frequency
         end associate
      end do
      state = reference(config, t, ceiling(t*frequency/0.75_wp))
   end subroutine find_look

   !> Error of an oscillator in a radian: of the phase where the order is even, of the amplitude where it is odd.
   real(wp) function expected_error(method, order, y) result(expected)
      character(len=*), intent(in) :: method
      integer, intent(in) :: order
      real(wp), intent(in) :: y !! step times frequency
      type(stability_function) :: r
      type(error_type), allocatable :: error
      complex(wp) :: difference, term ! of R(i y) and exp(i y); its terms
      integer, parameter :: most_terms = 40
      integer :: k

      if (method == 'gauss') then
         expected = gauss_phase_error(order/2, y)/y
         return
      end if
      call stability_function_of(r, method, order, error)
      difference = 0.0_wp
      do k = order + 1, most_terms
         term = cmplx(0.0_wp, y, wp)**k
         if (k <= ubound(r%coefficient, 1)) difference = difference + r%coefficient(k)*term
         difference = difference - term/gamma(real(k + 1, wp))
      end do
      difference = difference*exp(cmplx(0.0_wp, -y, wp))
      difference = difference - 0.5_wp*difference**2 ! of log(1 + difference), without its rounding
      expected = abs(merge(aimag(difference), real(difference, wp), modulo(order, 2) == 0))/y
   end function expected_error

   !> Error of the phase of an oscillator in one step of Gauss' method of s stages, whose stability function is the diagonal Padé
   !> approximant P(z)/P(-z), P(z) = sum of C(s, j) (2 s - j)!/(2 s)! z^j.
   real(wp) function gauss_phase_error(stages, y) result(phase_error)
      integer, intent(in) :: stages
      real(wp), intent(in) :: y
      complex(qp) :: p
      real(qp) :: coefficient
      integer :: j

      p = 1.0_qp
      coefficient = 1.0_qp
      do j = 1, stages
         coefficient = coefficient*(stages - j + 1)/(j*real(2*stages - j + 1, qp))
         p = p + coefficient*cmplx(0.0_qp, y, qp)**j
      end do
      ! P turns by half the step's angle; its rest is taken as an angle of its own, so that nothing is lost.
      phase_error = real(2.0_qp*abs(aimag(log(p*exp(cmplx(0.0_qp, -0.5_qp*y, qp))))), wp)
   end function gauss_phase_error

   !> Slope of the straight line through points.
   pure real(wp) function slope(x, y)
      real(wp), intent(in) :: x(:), y(:)
      slope = sum((x - sum(x)/size(x))*(y - sum(y)/size(y)))/sum((x - sum(x)/size(x))**2)
   end function slope

   real(wp) function highest_frequency(config)
      type(case_config), intent(in) :: config
      type(scene_type) :: scene
      type(error_type), allocatable :: error
      real(wp), allocatable :: frequency(:), q(:)

      call new_scene(scene, config, error)
      allocate (q(scene%n_dof), source=0.0_wp)
      q(scene%phi_at() + 1:scene%phi_at() + scene%n) = config%initial%phi
      call natural_frequencies(scene, scene%hinges, q, frequency, error)
      highest_frequency = maxval(frequency)
   end function highest_frequency

   real(wp) function fastest_decay(config)
      type(case_config), intent(in) :: config
      type(scene_type) :: scene
      type(error_type), allocatable :: error
      real(wp), allocatable :: rate(:), q(:)

      call new_scene(scene, config, error)
      allocate (q(scene%n_dof), source=0.0_wp)
      call decay_rates(scene, scene%hinges, q, rate, error)
      fastest_decay = maxval(rate)
   end function fastest_decay

   !> Errors of the state at the end for tolerances of 1e-4 to 1e-12, on the stiffer of two scenes.
   subroutine tolerances()
      character(len=6), parameter :: methods(12) = [character(len=6) :: 'adams', 'bdf', 'erk', 'erk', 'erk', 'erk', 'erk', 'erk', &
                                                    'erk', 'dop853', 'gauss', 'auto']
      integer, parameter :: order(12) = [0, 0, 2, 3, 4, 5, 6, 7, 8, 0, 0, 0]
      type(case_config) :: config
      type(run_result) :: result
      real(qp), allocatable :: truth(:)
      real(wp) :: rtol
      real(wp), parameter :: t_end = 1.0_wp
      integer :: i, k

      call error_scene(config)
      truth = reference(config, t_end, ceiling(t_end*highest_frequency(config)/1.5_wp))
      do i = 1, size(methods)
         config%solver%method = methods(i)
         config%solver%order = order(i)
         write (*, '(a, a, i0)', advance='no') trim(methods(i)), tab, order(i)
         do k = 4, 12
            rtol = 10.0_wp**(-k)
            config%solver%rtol = rtol
            config%solver%atol = 0.01_wp*rtol
            call run_campaign_case(config, [0.0_wp, t_end], 6.0_wp, result)
            if (result%status /= 'done') then
               write (*, '(a, a)', advance='no') tab, 'nan'
               cycle
            end if
            write (*, '(a, es10.2e3)', advance='no') tab, real(maxval(abs(result%y(:size(truth)/2) - truth(:size(truth)/2))), wp)
         end do
         write (*, '(a, a)') tab, trim(result%method)
      end do
   end subroutine tolerances

   !> Loss of digits of the two kernels in configurations at rest and in fast rotation, and along two motions.
   subroutine configurations()
      integer, parameter :: lengths(2) = [4, 24]
      type(case_config) :: config
      integer :: i, k, n

      do i = 1, size(lengths)
         n = lengths(i)
         call article_chain(config, n)
         call compare('straight', config)
         config%initial%alpha = 0.01_wp
         config%initial%beta = -0.02_wp
         call compare('straight, bent rods', config)
         config%initial%phi = [(0.5_wp*k, k=1, n)]
         call compare('curled up', config)
         config%initial%phi = [(pi*mod(k, 2), k=1, n)]
         call compare('folded, all rods on one line', config)
         config%initial%phi = [(pi*mod(k, 2) + 1.0e-9_wp*k, k=1, n)]
         call compare('folded, 1e-9 rad apart', config)
         config%initial%phi = [(2.0_wp*pi*1000.0_wp*k + 0.3_wp*k, k=1, n)]
         config%chain%kink = 2.0_wp*pi*1000.0_wp + 0.3_wp
         call compare('1000 turns from rod to rod, springs at rest', config)
         config%chain%kink = 0.0_wp
         call compare('1000 turns from rod to rod, springs wound up', config)
         config%initial%phi = 0.3_wp + 2.0e6_wp*pi
         config%chain%kink(0) = 2.0e6_wp*pi
         call compare('all rods after 1e6 turns', config)
         config%chain%kink = 0.0_wp
         config%initial%phi = [(0.2_wp*k, k=1, n)]
         config%initial%omega = 1000.0_wp
         call compare('turning at 1000 rad/s', config)
         config%initial%phi_rate = -1000.0_wp
         call compare('spacecraft at 1000 rad/s under a chain at rest', config)
         call article_chain(config, n)
         config%initial%phi = [(0.2_wp*k, k=1, n)]
         config%chain%node_mass = 1.0e6_wp
         call compare('node masses 4e5 times those of the rods', config)
         config%chain%node_mass = 1.0e-6_wp
         config%spacecraft%mass = 1.0e-3_wp
         config%spacecraft%inertia = 1.0e-4_wp
         call compare('spacecraft of 1 g', config)
         config%spacecraft%mass = 1.0e9_wp
         config%spacecraft%inertia = 1.0e8_wp
         call compare('spacecraft of 1e9 kg', config)
         call article_chain(config, n)
         config%initial%phi = [(0.2_wp*k, k=1, n)]
         config%chain%length(1::2) = 1.0e-3_wp
         config%chain%length(2::2) = 1.0e3_wp
         call compare('rods of 1 mm and 1 km in turn', config)
         call article_chain(config, n)
         config%initial%phi = [(pi*mod(k, 2), k=1, n)]
         config%chain%kink = [pi, (pi*(2*mod(k, 2) - 1), k=2, n)]
         call along_motion('folded, released', config)
         call article_chain(config, n)
         config%initial%omega = 30.0_wp
         call along_motion('thrown off at 30 rad/s', config)
      end do
   end subroutine configurations

   !> Both kernels against quadruple precision at the initial state of a case.
   subroutine compare(name, config)
      character(len=*), intent(in) :: name
      type(case_config), intent(in) :: config
      real(qp), allocatable :: y(:)
      real(wp) :: condition(2), loss(2)
      integer :: m

      call state_at_start(config, y, m)
      call losses(config, real(y(:m), wp), real(y(m + 1:), wp), condition, loss)
      write (*, '(a, a, i0, 4(a, es10.1e3))') name, tab, config%chain%n_rods, tab, condition(1), tab, condition(2), &
         tab, loss(1), tab, loss(2)
   end subroutine compare

   !> The same at 20 times of a motion: the worst of each.
   subroutine along_motion(name, config)
      character(len=*), intent(in) :: name
      type(case_config), intent(inout) :: config
      type(run_result) :: result
      real(wp) :: condition(2), loss(2), worst(4)
      integer :: i, m

      m = 3 + 3*config%chain%n_rods
      config%solver%method = 'dop853'
      worst = 0.0_wp
      do i = 1, 20
         call run_campaign_case(config, [0.0_wp, 0.02_wp*i], 60.0_wp, result)
         call losses(config, result%y(:m), result%y(m + 1:2*m), condition, loss)
         worst = max(worst, [condition, loss])
      end do
      write (*, '(a, a, i0, 4(a, es10.1e3))') name, tab, config%chain%n_rods, (tab, worst(i), i=1, 4)
   end subroutine along_motion

   !> Condition of M, plain and with its diagonal scaled to one, and errors of the accelerations, each of the largest of its kind.
   subroutine losses(config, q, p, condition, loss)
      type(case_config), intent(in) :: config
      real(wp), intent(in) :: q(:), p(:)
      real(wp), intent(out) :: condition(2), loss(2) !! recursive, assembled
      type(case_config) :: other
      type(scene_type) :: scene
      type(dynamics_type) :: dynamics
      type(error_type), allocatable :: error
      real(qp) :: truth(size(q))
      real(wp) :: acceleration(size(q))
      integer :: i
      logical :: ok

      call quad_accelerations(config, q, p, truth)
      call condition_number(config, q, condition(1), condition(2))
      other = config
      do i = 1, 2
         if (i == 2) other%model%kernel = 'assembled'
         call new_scene(scene, other, error)
         call new_dynamics(dynamics, scene, error)
         call dynamics%set_regime(0.0_wp, 1.0_wp)
         call dynamics%accelerations(0.0_wp, q, p, acceleration, ok)
         loss(i) = huge(1.0_wp)
         if (ok) loss(i) = worst_of_kinds(scene, acceleration, truth)
      end do
   end subroutine losses

   !> Largest error of a kind of acceleration over the largest acceleration of the kind: V', w', phi'', alpha'' and beta''.
   real(wp) function worst_of_kinds(scene, a, truth) result(worst)
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: a(:)
      real(qp), intent(in) :: truth(:)
      integer :: last(4), i, first

      last = [2, 3, 3 + scene%n, scene%n_dof]
      if (scene%n_base == 0) last(:2) = 0
      if (scene%n_base == 0) last(3) = scene%n
      worst = 0.0_wp
      first = 1
      do i = 1, 4
         if (last(i) < first) cycle
         associate (exact => truth(first:last(i)), found => a(first:last(i)))
            if (maxval(abs(exact)) > 0.0_qp) worst = max(worst, real(maxval(abs(found - exact))/maxval(abs(exact)), wp))
         end associate
         first = last(i) + 1
      end do
   end function worst_of_kinds

   !> A sample of extreme cases against quadruple precision: chord angles at the end.
   subroutine samples()
      type(case_config) :: config
      integer :: i

      do i = 1, 10
         call article_chain(config, 3)
         select case (i)
         case (1); call sample('as it is', config, 0.05_wp)
         case (2)
            config%chain%bending_stiffness = config%chain%bending_stiffness*1.0e-6_wp
            call sample('EI x 1e-6', config, 0.05_wp)
         case (3)
            config%chain%bending_stiffness = config%chain%bending_stiffness*1.0e3_wp
            call sample('EI x 1e3', config, 0.002_wp)
         case (4)
            config%chain%hinge_stiffness = config%chain%hinge_stiffness*1.0e-9_wp
            call sample('C x 1e-9', config, 0.05_wp)
         case (5)
            config%chain%node_mass = 1.0e6_wp*2.5_wp
            call sample('mass ratio 1e6', config, 0.05_wp)
         case (6)
            config%spacecraft%mass = 1.0e-3_wp
            config%spacecraft%inertia = 1.0e-4_wp
            call sample('spacecraft 1 g', config, 0.01_wp)
         case (7)
            config%initial%omega = 1000.0_wp
            call sample('spin 1000 rad/s', config, 0.01_wp)
         case (8)
            config%chain%length = [1.0e-3_wp, 1.0e3_wp, 1.0e-3_wp]
            config%model%bending = 'rigid'
            call sample('1 mm and 1 km, rigid', config, 0.002_wp)
         case (9)
            config%chain%hinge_damping = 1000.0_wp
            call sample('D = 1e3', config, 0.002_wp)
         case default
            config%chain%node_mass = 0.0_wp
            call sample('no node masses', config, 0.05_wp)
         end select
      end do
   end subroutine samples

   subroutine sample(name, config, t_end)
      character(len=*), intent(in) :: name
      type(case_config), intent(inout) :: config
      real(wp), intent(in) :: t_end
      type(run_result) :: result
      real(qp), allocatable :: truth(:), check(:)
      real(wp) :: agreement, error
      integer :: steps, m

      steps = max(10, ceiling(t_end*max(highest_frequency(config), 3.0_wp*abs(config%initial%omega), fastest_decay(config))))
      truth = reference(config, t_end, steps)
      check = reference(config, t_end, ceiling(0.7_wp*steps))
      m = size(truth)/2
      agreement = real(maxval(abs(truth - check))/maxval(abs(truth)), wp)
      config%solver%rtol = 1.0e-12_wp
      config%solver%atol = 1.0e-14_wp
      call run_campaign_case(config, [0.0_wp, t_end], 30.0_wp, result)
      associate (first => 4, last => 3 + config%chain%n_rods)
         error = real(maxval(abs(result%y(first:last) - truth(first:last))), wp)
      end associate
      write (*, '(4a, a, 2(a, es10.1e3), 2a)') name, tab, trim(result%method), tab, trim(result%status), tab, error, &
         tab, agreement, tab, result%message
   end subroutine sample

   !> The grid: each case on a line with how it ended, what its invariants kept, and what the other kernel makes of it.
   subroutine extremes()
      type(case_config) :: config
      real(wp), parameter :: factors(7) = [1.0e-9_wp, 1.0e-6_wp, 1.0e-3_wp, 1.0_wp, 1.0e3_wp, 1.0e6_wp, 1.0e9_wp]
      real(wp), parameter :: dampers(6) = [0.0_wp, 1.0e-3_wp, 1.0_wp, 1.0e2_wp, 1.0e4_wp, 1.0e6_wp]
      real(wp), parameter :: ratios(5) = [1.0e-6_wp, 1.0e-3_wp, 1.0_wp, 1.0e3_wp, 1.0e6_wp]
      real(wp), parameter :: masses(5) = [1.0e-3_wp, 1.0_wp, 1.0e3_wp, 1.0e6_wp, 1.0e9_wp]
      real(wp), parameter :: spins(4) = [1.0_wp, 10.0_wp, 100.0_wp, 1000.0_wp]
      integer, parameter :: lengths(6) = [1, 2, 10, 100, 1000, 10000]
      character(len=11), parameter :: bendings(4) = [character(len=11) :: 'rigid', 'rigid', 'quasistatic', 'quasistatic']
      character(len=11), parameter :: inertias(4) = [character(len=11) :: 'distributed', 'lumped', 'lumped', 'lumped']
      integer :: i, j, k

      do i = 1, size(factors)
         do j = 1, size(factors)
            call article_chain(config, 4)
            config%chain%bending_stiffness = factors(i)*config%chain%bending_stiffness
            config%chain%hinge_stiffness = factors(j)*config%chain%hinge_stiffness
            call try_case('stiffness', label('EI x', factors(i))//label(', C x', factors(j)), config, 0.5_wp)
         end do
      end do
      do i = 1, size(dampers)
         do j = 1, size(factors), 3
            call article_chain(config, 4)
            config%chain%hinge_damping = dampers(i)
            config%chain%hinge_stiffness = factors(j)*config%chain%hinge_stiffness
            call try_case('damping', label('D =', dampers(i))//label(', C x', factors(j)), config, 0.5_wp)
         end do
      end do
      do i = 1, size(ratios)
         do j = 1, size(masses)
            call article_chain(config, 4)
            config%chain%node_mass = ratios(i)*sum(config%chain%length*config%chain%mass_per_length)/4.0_wp
            config%spacecraft%mass = masses(j)
            config%spacecraft%inertia = masses(j)*0.98_wp/12.0_wp
            call try_case('masses', label('mass ratio', ratios(i))//label(', spacecraft', masses(j)), config, 0.5_wp)
         end do
      end do
      do i = 1, 4
         call article_chain(config, 4)
         config%chain%length(1::2) = 1.0e-3_wp
         config%chain%length(2::2) = 1.0e3_wp
         if (i == 2) config%chain%length = config%chain%length(4:1:-1)
         if (i >= 3) config%model%bending = bendings(i)
         if (i >= 3) config%model%inertia = inertias(i)
         if (i == 4) config%model%dampers = 'exact'
         call try_case('lengths', '1 mm and 1 km'//label(',', real(i, wp)), config, 0.5_wp)
      end do
      do i = 1, size(spins)
         do j = 1, 3
            call article_chain(config, 4)
            config%initial%omega = spins(i)
            if (j == 2) config%initial%phi = [(pi*mod(k, 2), k=1, 4)]
            if (j == 3) config%initial%phi = [(0.7_wp*k, k=1, 4)]
            call try_case('spin', label('turning at', spins(i))//label(', shape', real(j, wp)), config, 0.5_wp)
         end do
      end do
      do i = 1, 6
         call article_chain(config, 4)
         if (i > 1 .and. i < 6) config%model%bending = bendings(i - 1)
         if (i > 1 .and. i < 6) config%model%inertia = inertias(i - 1)
         if (i == 5) config%model%dampers = 'exact'
         config%chain%node_mass = 0.0_wp
         if (i == 6) config%chain%node_mass(:3) = 0.5_wp
         if (i == 6) config%chain%mass_per_length(4) = 0.0_wp
         call try_case('no masses', 'no node masses'//label(', model', real(i, wp)), config, 0.5_wp)
      end do
      do i = 1, size(lengths)
         call article_chain(config, lengths(i))
         call try_case('n', label('n =', real(lengths(i), wp)), config, merge(0.5_wp, 0.02_wp, lengths(i) <= 100))
      end do
      do i = 1, size(bendings)
         do j = 1, size(factors), 3
            do k = 1, 7, 3
               call article_chain(config, 4)
               config%model%bending = bendings(i)
               config%model%inertia = inertias(i)
               config%chain%hinge_damping = 0.01_wp
               if (i == 4) config%model%dampers = 'exact'
               config%chain%bending_stiffness = factors(k)*config%chain%bending_stiffness
               config%chain%hinge_stiffness = factors(j)*config%chain%hinge_stiffness
               if (i <= 2 .and. k > 1) cycle
               call try_case('models', trim(inertias(i))//' '//trim(bendings(i))//merge(' exact', '      ', i == 4)// &
                             label(', EI x', factors(k))//label(', C x', factors(j)), config, 0.5_wp)
            end do
         end do
      end do
   end subroutine extremes

   !> ' word 1.0E+09'
   function label(word, value) result(text)
      character(len=*), intent(in) :: word
      real(wp), intent(in) :: value
      character(len=:), allocatable :: text
      character(len=16) :: digits
      write (digits, '(es9.0)') value
      if (value >= 0.01_wp .and. value < 1.0e5_wp) write (digits, '(g0.3)') value
      if (value >= 1.0_wp .and. value < 1.0e5_wp) write (digits, '(i0)') nint(value)
      if (.not. value > 0.0_wp) digits = '0'
      text = word//' '//trim(adjustl(digits))
   end function label

   subroutine try_case(family, name, config, t_end)
      character(len=*), intent(in) :: family, name
      type(case_config), intent(inout) :: config
      real(wp), intent(in) :: t_end !! [s]
      real(wp), parameter :: budget = 1.5_wp
      type(run_result) :: result, other
      real(wp) :: difference
      integer :: i

      call run_campaign_case(config, [(t_end*(real(i, wp)/20.0_wp), i=0, 20)], budget, result)
      difference = -1.0_wp
      if (result%status == 'done' .and. config%chain%n_rods <= 100) then
         config%model%kernel = 'assembled'
         config%solver%method = result%method
         call run_campaign_case(config, [(t_end*(real(i, wp)/20.0_wp), i=0, 20)], budget, other)
         associate (first => 4, last => 3 + config%chain%n_rods)
            if (other%status == 'done') difference = maxval(abs(result%y(first:last) - other%y(first:last)))
         end associate
      end if
      write (*, '(8a, 4(es10.1e3, a), i0, a, f6.2, a, es10.2e3, 4a)') family, tab, name, tab, &
         trim(result%status), tab, trim(result%method), tab, &
          result%energy_error, tab, result%momentum_error, tab, result%angular_error, tab, difference, tab, result%n_steps, &
         tab, result%seconds_choice, tab, result%t, tab, trim(other%status), tab, result%message
      flush (6)
   end subroutine try_case

   !> Energy error against time of undamped scenes, by methods: one rod that bends, on a soft hinge, two rigid rods, and one.
   subroutine drift()
      type(case_config) :: config
      type(run_result) :: result
      character(len=32) :: word, scene
      real(wp) :: periods, lowest, t_end
      real(wp), allocatable :: times(:)
      integer, parameter :: per_decade = 40
      integer :: i, k, n

      call get_command_argument(2, scene)
      call get_command_argument(3, word)
      read (word, *) periods
      call article_chain(config, merge(2, 1, scene == 'rigid'))
      config%chain%bending_stiffness = 300.0_wp
      config%chain%hinge_stiffness = 300.0_wp
      config%initial%omega = 0.05_wp
      config%initial%phi_rate = [(2.0_wp - k, k=1, config%chain%n_rods)]
      if (scene /= 'flexible') config%model%bending = 'rigid'
      lowest = lowest_frequency(config)
      t_end = periods*2.0_wp*pi/lowest
      n = nint(per_decade*log10(periods))
      times = [0.0_wp, (t_end*10.0_wp**(real(k - n, wp)/per_decade), k=1, n)]
      do i = 4, command_argument_count()
         call get_command_argument(i, word)
         call choose_drift_method(word, config, lowest)
         call run_campaign_case(config, times, 600.0_wp, result)
         write (*, '(4a, f8.2, a, i0, 2a)') trim(word), tab, trim(result%status), &
            tab, result%seconds, tab, result%n_steps, tab, result%message
         do k = 2, size(result%times)
            write (*, '(a, es12.5, a, es13.4e3)') tab, result%times(k)*lowest/(2.0_wp*pi), tab, result%errors(k)
         end do
      end do
   end subroutine drift

   !> 'dop853:1e-10', 'erk4:1e-8', 'gauss:fixed'.
   subroutine choose_drift_method(word, config, lowest)
      character(len=*), intent(in) :: word
      type(case_config), intent(inout) :: config
      real(wp), intent(in) :: lowest !! frequency [rad/s]
      integer :: colon

      colon = index(word, ':')
      config%solver%method = word(:colon - 1)
      config%solver%order = 0
      if (word(:3) == 'erk') then
         config%solver%method = 'erk'
         read (word(4:colon - 1), *) config%solver%order
      end if
      config%solver%fixed_step = 0.0_wp
      config%solver%rtol = 1.0e-12_wp
      if (word(colon + 1:) == 'fixed') then
         config%solver%fixed_step = merge(6.0_wp, 2.0_wp, config%model%bending == 'dynamic')/highest_frequency(config)
         if (config%solver%method == 'dop853') config%solver%fixed_step = 1.0_wp/highest_frequency(config)
         if (.not. lowest > 0.0_wp) error stop 'drift: no lowest mode'
      else
         read (word(colon + 1:), *) config%solver%rtol
      end if
      config%solver%atol = 0.01_wp*config%solver%rtol
   end subroutine choose_drift_method

   real(wp) function lowest_frequency(config)
      type(case_config), intent(in) :: config
      type(scene_type) :: scene
      type(error_type), allocatable :: error
      real(wp), allocatable :: frequency(:), q(:)

      call new_scene(scene, config, error)
      allocate (q(scene%n_dof), source=0.0_wp)
      call natural_frequencies(scene, scene%hinges, q, frequency, error)
      lowest_frequency = minval(frequency, mask=frequency > 1.0e-6_wp*maxval(frequency))
   end function lowest_frequency

end program bench_stability
