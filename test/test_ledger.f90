!> Work and dissipated energy, against values by hand, for every method and tolerance.
module test_ledger
   use rodyn_kinds, only: wp, i8
   use rodyn_errors, only: error_type, exit_stopped
   use rodyn_lanes, only: lanes
   use rodyn_ode, only: ode_system, n_quadratures
   use rodyn_quadrature_history, only: quadrature_history
   use rodyn_case_config, only: case_config, hinge_config, kink_config, load_config
   use rodyn_case_reader, only: parse_case
   use rodyn_scene, only: scene_type, new_scene
   use rodyn_motion, only: motion_type, new_motion, initial_state
   use rodyn_integrator, only: integrator_type, monitor_type, solver_options
   use rodyn_integrators, only: new_integrator
   use rodyn_quantities, only: layout_of, new_row
   use rodyn_simulation, only: listed_times, simulate
   use test_testing, only: unittest, new_test, check
   use test_random_scenes, only: allocate_case
   use test_trajectories, only: trajectory, integrate
   implicit none (type, external)
   private
   public :: collect_ledger

   character(len=6), parameter :: methods(5) = [character(len=6) :: 'adams', 'bdf', 'erk', 'dop853', 'gauss']
   real(wp), parameter :: bound = 50.0_wp !! of errors, in rtol times the energy of the run

   !> A motion that counts its evaluations, and whose powers may fail.
   type, extends(motion_type) :: watched_motion
      integer :: n_calls = 0
      real(wp) :: t_refuse = huge(1.0_wp) !! powers cannot be evaluated from then on [s]
   contains
      procedure :: rhs => watched_rhs
      procedure :: lane_accelerations => watched_lanes
      procedure :: quadratures => watched_quadratures
   end type watched_motion

   !> A motion that is easy to follow, whose powers are noise from some time on, and who watches it and wants to stop then.
   type, extends(ode_system) :: noisy_system
      real(wp) :: t_noise = 1.0_wp !! [s]
      integer :: n_noisy = 0       !! evaluations since then
   contains
      procedure :: rhs => noisy_rhs
      procedure :: jacobian => noisy_jacobian
   end type noisy_system

   type, extends(monitor_type) :: patient_monitor
      type(noisy_system), pointer :: system => null()
   contains
      procedure :: report => no_report
      procedure :: stop_requested => wants_to_stop
   end type patient_monitor

contains

   subroutine collect_ledger(suite)
      type(unittest), allocatable, intent(out) :: suite(:)
      suite = [new_test('a damper takes what a fast kink costs', test_fast_kink), &
               new_test('dampers take all the energy of a free decay', test_decay), &
               new_test('work of a load is the kinetic energy of a free body', test_free_body), &
               new_test('a hinge that is held passes the work of its kink', test_held_kink), &
               new_test('rates of past steps integrate polynomials exactly and a vibration to their tolerance', test_history), &
               new_test('a peak within one step is seen beside a smooth past', test_peak), &
               new_test('from rest, a ledger does not chase rounding', test_from_rest), &
               new_test('powers that cannot be evaluated end a run', test_failing_powers), &
               new_test('a request to stop is heeded soon where powers are noise', test_stop_in_noise)]
   end subroutine collect_ledger

   !> One rigid rod on a fixed spacecraft, of length 1.
   subroutine one_rod(config, node_mass, stiffness, damping)
      type(case_config), intent(out) :: config
      real(wp), intent(in) :: node_mass, stiffness, damping
      call allocate_case(config, 1)
      config%spacecraft%motion = 'fixed'
      config%model%bending = 'rigid'
      config%chain%length = 1.0_wp
      config%chain%mass_per_length = 1.0_wp
      config%chain%node_mass = node_mass
      config%chain%hinge_stiffness = stiffness
      config%chain%hinge_damping = damping
      config%chain%kink = 0.0_wp
   end subroutine one_rod

   !> Run a case to t_end by every method at rtol = 1e-4 ... 1e-12 and compare the sums at its end.
   subroutine compare(config, t_end, work, dissipated, scale, error)
      type(case_config), intent(inout) :: config
      real(wp), intent(in) :: t_end, work, dissipated !! [s], [J]
      real(wp), intent(in) :: scale                   !! energy of the run [J]
      type(error_type), allocatable, intent(out) :: error
      type(trajectory) :: motion
      character(len=100) :: text
      real(wp) :: off
      integer :: i, k

      do i = 1, size(methods)
         do k = 16, 48 ! many, since an estimate may be small by chance
            config%solver%method = methods(i)
            config%solver%rtol = 10.0_wp**(-0.25_wp*k)
            config%solver%atol = 1.0e-2_wp*config%solver%rtol
            call integrate(config, [0.0_wp, 0.37_wp*t_end, t_end], motion, error)
            if (allocated(error)) return
            off = max(abs(motion%rows(3)%work_external - work), abs(motion%rows(3)%energy_dissipated - dissipated))/scale
            write (text, '(a, " at rtol =", es8.1, ": off by", es8.1, " of the energy")') trim(methods(i)), config%solver%rtol, off
            call check(error, off <= bound*config%solver%rtol + 1.0e-13_wp, trim(text))
            if (allocated(error)) return
         end do
      end do
   end subroutine compare

   !> A kink that moves by 0.1 rad within 0.2 ms against a strong damper and a heavy node. The reference: the equation of the
   !> rod by many steps of the classical Runge-Kutta method.
   subroutine test_fast_kink(error)
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: duration = 2.0e-4_wp, change = 0.1_wp, stiffness = 100.0_wp, damping = 2.0_wp, mass = 1000.0_wp
      type(case_config) :: config
      real(wp) :: y(4) ! phi, phi', work, dissipated

      call one_rod(config, mass, stiffness, damping)
      config%kink_programs = [kink_config(hinge=0, law='smooth_step', t_start=1.0e-4_wp, t_end=1.0e-4_wp + duration, value=change)]
      y = 0.0_wp
      call follow(0.0_wp, duration, y)
      call follow(duration, 1.0e-3_wp - 1.0e-4_wp, y)
      ! By hand, if the rod stood still: 10/7 D change^2/duration.
      call check(error, abs(y(4) - 10.0_wp/7.0_wp*damping*change**2/duration) < 1.0e-6_wp*y(4), 'the reference is off')
      if (.not. allocated(error)) call compare(config, 1.0e-3_wp, y(3), y(4), y(4), error)

   contains

      subroutine follow(from, to, state)
         real(wp), intent(in) :: from, to
         real(wp), intent(inout) :: state(4)
         integer, parameter :: n = 2000
         real(wp) :: h, t, k1(4), k2(4), k3(4), k4(4)
         integer :: i
         h = (to - from)/n
         do i = 0, n - 1
            t = from + i*h
            k1 = rates(t, state)
            k2 = rates(t + 0.5_wp*h, state + 0.5_wp*h*k1)
            k3 = rates(t + 0.5_wp*h, state + 0.5_wp*h*k2)
            k4 = rates(t + h, state + h*k3)
            state = state + h/6.0_wp*(k1 + 2.0_wp*(k2 + k3) + k4)
         end do
      end subroutine follow

      pure function rates(t, state) result(rate)
         real(wp), intent(in) :: t, state(4)
         real(wp) :: rate(4), x, kink, kink_rate, moment
         x = min(t/duration, 1.0_wp)
         kink = change*x**3*(10.0_wp + x*(6.0_wp*x - 15.0_wp))
         kink_rate = change/duration*30.0_wp*(x*(1.0_wp - x))**2
         moment = stiffness*(state(1) - kink) + damping*(state(2) - kink_rate)
         rate = [state(2), -moment/(mass + 1.0_wp/3.0_wp), -moment*kink_rate, damping*(state(2) - kink_rate)**2]
      end function rates

   end subroutine test_fast_kink

   !> All of the kinetic energy at the start ends in the damper: 60 times its time constant.
   subroutine test_decay(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      real(wp), parameter :: inertia = 2.0_wp + 1.0_wp/3.0_wp, rate = 0.8_wp

      call one_rod(config, 2.0_wp, 210.0_wp, 14.0_wp) ! 9.5 rad/s, damping ratio 0.32
      config%initial%phi_rate = rate
      call compare(config, 20.0_wp, 0.0_wp, 0.5_wp*inertia*rate**2, 0.5_wp*inertia*rate**2, error)
   end subroutine test_decay

   !> A force along a straight chain turns nothing: W = I^2/(2 m), I its impulse. Then the motion itself is a quadrature, to
   !> which Fehlberg's pair would be blind: with order = 8 `erk` is off by 350 to 1e10 times rtol.
   subroutine test_free_body(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      real(wp), parameter :: force = 30.0_wp, rate = 7.0_wp, t_end = 3.0_wp
      real(wp) :: work
      integer :: which

      do which = 1, 2
         call one_rod(config, 3.0_wp, 50.0_wp, 1.0_wp)
         config%spacecraft%motion = 'free'
         config%spacecraft%mass = 20.0_wp
         config%spacecraft%inertia = 5.0_wp
         config%loads = [load_config(target='spacecraft', component='X', law='constant', value=-force)]
         config%t_end = t_end
         work = (force*t_end)**2/(2.0_wp*24.0_wp)
         if (which == 2) then
            config%loads(1)%law = 'sine_squared'
            config%loads(1)%rate = rate
            work = (force*(0.5_wp*t_end - sin(2.0_wp*rate*t_end)/(4.0_wp*rate)))**2/(2.0_wp*24.0_wp)
         end if
         call compare(config, t_end, work, 0.0_wp, work, error)
         if (allocated(error)) return
      end do
   end subroutine test_free_body

   !> A rod that is held in its hinge follows the kink: the drive's work is its kinetic energy.
   subroutine test_held_kink(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      real(wp), parameter :: change = 0.6_wp, duration = 0.5_wp, t_end = 0.2_wp, inertia = 2.0_wp + 1.0_wp/3.0_wp
      real(wp), parameter :: x = t_end/duration
      real(wp), parameter :: energy = 0.5_wp*inertia*(change/duration*30.0_wp*(x*(1.0_wp - x))**2)**2

      call one_rod(config, 2.0_wp, 10.0_wp, 1.0_wp)
      config%hinges = [hinge_config(hinge=0, held=.true.)]
      config%kink_programs = [kink_config(hinge=0, law='smooth_step', t_start=0.0_wp, t_end=duration, value=change)]
      call compare(config, t_end, energy, 0.0_wp, energy, error)
   end subroutine test_held_kink

   !> Steps that grow and shrink by up to two.
   pure real(wp) function uneven(i)
      integer, intent(in) :: i
      uneven = 0.1_wp*(1.0_wp + 0.5_wp*sin(2.0_wp*i))
   end function uneven

   !> Powers of degree 12 in time: thirteen points interpolate them. And the square of a vibration, 1/60 of a period a step.
   subroutine test_history(error)
      type(error_type), allocatable, intent(out) :: error
      type(quadrature_history) :: history
      real(wp), dimension(n_quadratures) :: value, off
      real(wp) :: t, before
      logical :: ok
      integer :: i, judged

      t = -1.0_wp
      judged = 0
      call history%begin(t, rates(t))
      do i = 1, 20
         before = t
         t = t + uneven(i)
         call history%add(0.5_wp*(before + t), rates(0.5_wp*(before + t)), t, rates(t))
         call history%integrate(1.0e-6_wp, value, off, ok)
         if (i < 3) call check(error, .not. ok, 'judged by too few points')
         if (allocated(error)) return
         if (.not. ok) cycle
         judged = judged + 1
         call check(error, maxval(abs(value - (integrals(t) - integrals(before)))) < 1.0e-9_wp, 'a step is off')
         if (allocated(error)) return
      end do
      call check(error, judged >= 16, 'rates are smooth, but not taken for it')

   contains

      pure function rates(time) result(rate)
         real(wp), intent(in) :: time
         real(wp) :: rate(n_quadratures)
         rate = [time**12/12.0_wp, cos(0.5_wp*time)**2]
      end function rates

      pure function integrals(time) result(total)
         real(wp), intent(in) :: time
         real(wp) :: total(n_quadratures)
         total = [time**13/156.0_wp, 0.5_wp*(time + sin(time))]
      end function integrals

   end subroutine test_history

   !> Only the middle of a step has it, or only its end, wherever the step is.
   subroutine test_peak(error)
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: peak = 1.0e-2_wp, none(n_quadratures) = [1.0_wp, 0.0_wp]
      type(quadrature_history) :: history
      real(wp), dimension(n_quadratures) :: value, off, middle, last
      real(wp) :: t, before
      logical :: ok
      integer :: i, at, which

      do which = 1, 2
         do at = 3, 12
            t = 0.0_wp
            call history%begin(t, none)
            do i = 1, at
               before = t
               t = t + uneven(i)
               middle = none
               last = none
               if (i == at .and. which == 1) middle(2) = peak
               if (i == at .and. which == 2) last(2) = peak
               call history%add(0.5_wp*(before + t), middle, t, last)
               call history%integrate(1.0e-4_wp, value, off, ok)
               call check(error, ok .neqv. (i < 3 .or. i == at), 'a peak is not seen, or one where there is none')
               if (allocated(error)) return
            end do
         end do
      end do
   end subroutine test_peak

   !> Chains at rest until a kink, of a spline through a table, or a load sets them in motion.
   function from_rest(which) result(text)
      integer, intent(in) :: which
      character(len=:), allocatable :: text
      if (which == 1) then
         text = "&case t_end = 0.31, n_outputs = 1 / "// &
                "&spacecraft mass = 82, inertia = 310, hinge_x = 0.2 / "// &
                "&chain n_rods = 2, length = 2, mass_per_length = 2, bending_stiffness = 390, hinge_stiffness = 380 / "// &
                "&kink_program hinge = 0, law = 'table', times = 0.3, 0.9, 1.5, values = 0, 0.21, 0.3 /"
      else
         text = "&case t_end = 0.5, n_outputs = 20 / "// &
                "&spacecraft mass = 300, inertia = 80, hinge_x = 0.7 / "// &
                "&chain n_rods = 1, length = 2, mass_per_length = 0.8, bending_stiffness = 2000, node_mass = 2, "// &
                "hinge_stiffness = 1500 / "// &
                "&load component = 'M', t_start = 0.25, t_end = 4, value = 20 /"
      end if
   end function from_rest

   !> Run such a chain and count evaluations of its motion and of its powers.
   subroutine watch(which, method, ledger, t_refuse, n_calls, error)
      integer, intent(in) :: which
      character(len=*), intent(in) :: method
      logical, intent(in) :: ledger
      real(wp), intent(in) :: t_refuse !! [s]
      integer, intent(out) :: n_calls
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(scene_type) :: scene
      type(watched_motion), target :: motion
      class(integrator_type), allocatable :: integrator
      type(trajectory) :: result
      real(wp), allocatable :: y(:)
      real(wp) :: t

      n_calls = 0
      call parse_case(from_rest(which), 'from rest', config, error)
      if (.not. allocated(error)) call new_scene(scene, config, error)
      if (.not. allocated(error)) call new_motion(motion%motion_type, scene, ledger, error)
      if (allocated(error)) return
      motion%t_refuse = t_refuse
      call initial_state(motion%motion_type, config%initial, y)
      call new_integrator(integrator, motion, method, solver_options(), error)
      if (allocated(error)) return
      allocate (result%rows(2))
      config%output%ledger = ledger
      result%row = new_row(layout_of(config))
      call simulate(motion%motion_type, integrator, listed_times([0.0_wp, config%t_end]), config%t_end, result, y, t, error)
      call integrator%finalize()
      n_calls = motion%n_calls
   end subroutine watch

   !> Powers are rounding alone at first: of relative size one, which no step is short enough for. With a tolerance that vanishes
   !> with the energy, erk took 10 times the evaluations. CVODE takes two a step and five a panel where steps begin anew.
   subroutine test_from_rest(error)
      type(error_type), allocatable, intent(out) :: error
      character(len=80) :: text
      integer :: i, which, without, with

      do which = 1, 2
         do i = 1, size(methods)
            call watch(which, trim(methods(i)), .false., huge(1.0_wp), without, error)
            if (.not. allocated(error)) call watch(which, trim(methods(i)), .true., huge(1.0_wp), with, error)
            if (allocated(error)) return
            write (text, '(a, i0, a, i0, a)') trim(methods(i))//': ', with, ' evaluations with a ledger, ', without, ' without'
            call check(error, with <= 3*without, trim(text))
            if (allocated(error)) return
         end do
      end do
   end subroutine test_from_rest

   !> Nothing may be summed up that was not computed. dop853 has its powers from the right-hand side; erk, but for the first one.
   subroutine test_failing_powers(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: failure
      real(wp), parameter :: start = 0.25_wp
      integer :: i, n_calls

      do i = 1, size(methods)
         if (methods(i) == 'dop853') cycle
         call watch(2, trim(methods(i)), .true., start + merge(0.0_wp, 0.01_wp, methods(i) == 'erk'), n_calls, failure)
         call check(error, allocated(failure), trim(methods(i))//' does not notice')
         if (allocated(error)) return
      end do
   end subroutine test_failing_powers

   subroutine watched_rhs(self, t, y, ydot, ok)
      class(watched_motion), intent(inout) :: self
      real(wp), intent(in) :: t
      real(wp), contiguous, intent(in) :: y(:)
      real(wp), contiguous, intent(out) :: ydot(:)
      logical, intent(out) :: ok
      self%n_calls = self%n_calls + 1
      call self%motion_type%rhs(t, y, ydot, ok)
   end subroutine watched_rhs

   subroutine watched_lanes(self, t, q, p, acceleration, ok)
      class(watched_motion), intent(inout) :: self
      real(wp), intent(in) :: t(lanes)
      real(wp), contiguous, intent(in) :: q(:, :), p(:, :)
      real(wp), contiguous, intent(out) :: acceleration(:, :)
      logical, intent(out) :: ok
      self%n_calls = self%n_calls + lanes
      call self%motion_type%lane_accelerations(t, q, p, acceleration, ok)
   end subroutine watched_lanes

   subroutine watched_quadratures(self, t, y, rate, ok)
      class(watched_motion), intent(inout) :: self
      real(wp), intent(in) :: t
      real(wp), contiguous, intent(in) :: y(:)
      real(wp), intent(out) :: rate(n_quadratures)
      logical, intent(out) :: ok
      self%n_calls = self%n_calls + 1
      call self%motion_type%quadratures(t, y, rate, ok)
      ok = ok .and. t < self%t_refuse
   end subroutine watched_quadratures

   !> Steps are so fast at first that the monitor is asked once in thousands; then each takes hundreds of evaluations for powers.
   !> If they counted as one step still, it would be asked after up to 4096 of them: two millions of evaluations.
   subroutine test_stop_in_noise(error)
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: most = 80000 ! 4096 steps of 12 evaluations, and one step more, with room
      character(len=*), parameter :: followers(*) = [character(len=6) :: 'adams', 'erk', 'dop853']
      type(noisy_system), target :: system
      type(patient_monitor), target :: monitor
      class(integrator_type), allocatable :: integrator
      type(error_type), allocatable :: failure
      character(len=80) :: text
      real(wp) :: y(1 + n_quadratures), t
      integer :: i

      do i = 1, size(followers)
         system = noisy_system(n_states=1 + n_quadratures, n_controlled=1)
         monitor%system => system
         call new_integrator(integrator, system, trim(followers(i)), solver_options(max_step=2.0e-5_wp), error)
         if (allocated(error)) return
         call integrator%set_monitor(monitor)
         call integrator%set_stop(2.0_wp)
         call integrator%start(0.0_wp, [1.0_wp, 0.0_wp, 0.0_wp], error)
         if (allocated(error)) return
         call integrator%advance(2.0_wp, y, t, failure)
         call integrator%finalize()
         call check(error, allocated(failure), trim(followers(i))//': not stopped')
         if (allocated(error)) return
         write (text, '(a, i0, a)') trim(followers(i))//': stopped after ', system%n_noisy, ' evaluations'
         call check(error, failure%exit_code == exit_stopped .and. system%n_noisy <= most, trim(text))
         if (allocated(error)) return
      end do
   end subroutine test_stop_in_noise

   subroutine noisy_rhs(self, t, y, ydot, ok)
      class(noisy_system), intent(inout) :: self
      real(wp), intent(in) :: t
      real(wp), contiguous, intent(in) :: y(:)
      real(wp), contiguous, intent(out) :: ydot(:)
      logical, intent(out) :: ok
      ok = .true.
      ydot(1) = -y(1)
      if (size(ydot) == 1) return
      ydot(2:) = 0.0_wp
      if (t < self%t_noise) return
      self%n_noisy = self%n_noisy + 1
      ydot(2) = modulo(1.0e9_wp*sin(1.0e9_wp*t), 1.0_wp)
   end subroutine noisy_rhs

   subroutine noisy_jacobian(self, t, y, jac, ok)
      class(noisy_system), intent(inout) :: self
      real(wp), intent(in) :: t
      real(wp), contiguous, intent(in) :: y(:)
      real(wp), contiguous, intent(out) :: jac(:, :)
      logical, intent(out) :: ok
      associate (unused => self, unused_t => t, unused_y => y); end associate
      jac = -1.0_wp
      ok = .true.
   end subroutine noisy_jacobian

   subroutine no_report(self, t, n_steps)
      class(patient_monitor), intent(inout) :: self
      real(wp), intent(in) :: t
      integer(i8), intent(in) :: n_steps
      associate (unused => self, unused_t => t, unused_n => n_steps); end associate
   end subroutine no_report

   logical function wants_to_stop(self)
      class(patient_monitor), intent(in) :: self
      wants_to_stop = self%system%n_noisy > 0
   end function wants_to_stop

end module test_ledger
