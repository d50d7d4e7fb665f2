!> Changes of the method in a run: where one gives up, and where hinges change the character of the motion.
module test_driver
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type, raise
   use rodyn_case_config, only: case_config
   use rodyn_case_reader, only: parse_case
   use rodyn_motion, only: motion_type
   use rodyn_run_setup, only: run_setup, new_run_setup
   use rodyn_integrator, only: integrator_type, solver_statistics
   use rodyn_driver, only: driver_type, new_driver
   use rodyn_method_costs, only: effort_of
   use rodyn_simulation, only: observer_type, even_times, simulate
   use test_testing, only: unittest, new_test, check
   implicit none (type, external)
   private
   public :: collect_driver

   !> Works like another integrator until a certain time.
   type, extends(integrator_type) :: quitter
      class(integrator_type), allocatable :: inner
      real(wp) :: t_quit = 0.0_wp
   contains
      procedure :: start
      procedure :: advance
      procedure :: statistics
      procedure :: finalize
   end type quitter

   !> Keeps every state.
   type, extends(observer_type) :: keeper
      real(wp), allocatable :: states(:, :)
      integer :: n = 0
   contains
      procedure :: observe
   end type keeper

   !> One case on its way.
   type :: run_type
      type(case_config) :: config
      type(run_setup), pointer :: setup => null()
      type(driver_type) :: driver
      type(keeper) :: kept
      real(wp) :: t = 0.0_wp
   end type run_type

   character(len=*), parameter :: nl = new_line('a')
   character(len=*), parameter :: slewed = '&case t_end = 1 /'//nl// &
      '&spacecraft mass = 120, inertia = 10, hinge_x = 0.4 /'//nl// &
      '&chain n_rods = 2, length = 1.5, mass_per_length = 1.7, bending_stiffness = 1e4, hinge_stiffness = 4e3 /'//nl// &
      "&load component = 'M', value = 500, t_end = 0.7 /"//nl
   character(len=*), parameter :: prestressed = '&case t_end = 1 /'//nl// &
      '&spacecraft mass = 150, inertia = 150, hinge_x = 0.5 /'//nl// &
      '&chain n_rods = 1, length = 1, mass_per_length = 2, bending_stiffness = 3e4, hinge_stiffness = 5 /'//nl// &
      '&initial phi = 0.8 /'//nl
   character(len=*), parameter :: rattling = '&case t_end = 12 /'//nl// &
      '&spacecraft mass = 150, inertia = 150, hinge_x = 0.5 /'//nl// &
      '&chain n_rods = 2, length = 1, mass_per_length = 2, bending_stiffness = 3e4, hinge_stiffness = 50 /'//nl// &
      '&initial phi = 0.5, 0.1 /'//nl// &
      '&hinge hinge = 0, lower_stop = -0.01, upper_stop = 0.02, stop_stiffness = 3e4 /'//nl// &
      '&hinge hinge = 1, lower_stop = -0.02, upper_stop = 0.01, stop_stiffness = 3e4 /'//nl
   character(len=*), parameter :: released_and_latched = '&case t_end = 1 /'//nl// &
      '&spacecraft mass = 150, inertia = 150, hinge_x = 0.5 /'//nl// &
      '&chain n_rods = 1, length = 1, mass_per_length = 2, bending_stiffness = 3e4, hinge_stiffness = 50 /'//nl// &
      '&hinge hinge = 0, held = .true., release_time = 0.1, rest_angle = 0.2, latch_angle = 0.1 /'//nl
   character(len=*), parameter :: in_sequence = '&case t_end = 2.0 /'//nl// &
      '&spacecraft mass = 420.0, inertia = 190.0, hinge_x = 1.4, hinge_y = -0.73 /'//nl// &
      '&chain n_rods = 3, length = 3*1.2, mass_per_length = 0.53, 2.2, 0.95, bending_stiffness = 3*1100.0, '// &
      'node_mass = 3*0.28, hinge_stiffness = 3*7.3 /'//nl// &
      '&initial phi = 1.1, -0.88, 0.88 /'//nl// &
      '&hinge hinge = 0, held = .true., rest_angle = -0.13, latch_angle = 0.0, release_time = 0.1, friction_moment = 2.1, '// &
      'friction_velocity = 0.01 /'//nl// &
      '&hinge hinge = 1, held = .true., rest_angle = 0.32, latch_angle = 0.0, release_after = 0 /'//nl// &
      '&hinge hinge = 2, held = .true., rest_angle = -0.18, latch_angle = 0.0, release_after = 1 /'//nl

contains

   subroutine collect_driver(suite)
      type(unittest), allocatable, intent(out) :: suite(:)
      suite = [new_test('a method that gives up hands over to another, and counts are sums', test_hand_over), &
               new_test('a method that is named does not hand over', test_named), &
               new_test('where every method gives up the first cause is told', test_all_give_up), &
               new_test('max_steps counts the steps of all methods', test_max_steps), &
               new_test('a chain that is released later is judged as it will be', test_release), &
               new_test('a chain that latches is judged anew', test_latch), &
               new_test('events in numbers do not make choices in numbers', test_many_events), &
               new_test('every change of the method is told', test_told), &
               new_test('a method that gave up is not taken again where it was chosen before', test_left_for_good), &
               new_test('trials after releases cost less than the run', test_trials_after_releases)]
   end subroutine collect_driver

   !> The article's chain, shorter: collocation is the choice.
   subroutine test_hand_over(error)
      type(error_type), allocatable, intent(out) :: error
      type(run_type) :: run, reference
      type(solver_statistics) :: stats, first, second

      call prepare(reference, slewed//"&solver method = 'dop853', rtol = 1e-11, atol = 1e-13 /", error)
      if (.not. allocated(error)) call perform(reference, error)
      if (.not. allocated(error)) call prepare(run, slewed, error)
      if (allocated(error)) return
      call check(error, run%driver%choice%method == 'gauss', 'auto takes '//run%driver%choice%method)
      if (allocated(error)) return
      call make_quit(run%driver, run%setup%motion, 2, 0.33_wp)
      call perform(run, error)
      if (allocated(error)) return
      call check(error, maxval(abs(run%kept%states - reference%kept%states)) < 1.0e-5_wp, 'states are off')
      call check(error, run%driver%methods() == 'gauss, dop853', run%driver%methods())
      call check(error, index(run%driver%failures, 'gauss gave up (enough for a test), from t = 0.3 s dop853') == 1, &
                 run%driver%failures)
      call check(error, index(run%driver%reason(), run%driver%failures) > 0, run%driver%reason())
      if (allocated(error)) return
      stats = run%driver%statistics()
      first = run%driver%members(2)%integrator%statistics()
      second = run%driver%members(1)%integrator%statistics()
      call check(error, stats%n_rhs == first%n_rhs + second%n_rhs .and. stats%n_steps == second%n_steps .and. &
                 second%n_steps > first%n_steps .and. first%n_steps > 0 .and. &
                 stats%n_starts == first%n_starts + second%n_starts .and. stats%n_jac == first%n_jac, 'counts are no sums')
   end subroutine test_hand_over

   subroutine test_named(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: failure
      type(run_type) :: run

      call prepare(run, slewed//"&solver method = 'gauss' /", error)
      if (allocated(error)) return
      call make_quit(run%driver, run%setup%motion, 1, 0.33_wp)
      call perform(run, failure)
      call check(error, allocated(failure), 'the run does not end')
      if (allocated(error)) return
      call check(error, failure%message == 'enough for a test' .and. len(run%driver%history) == 0, failure%message)
   end subroutine test_named

   subroutine test_all_give_up(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: failure
      type(run_type) :: run
      integer :: i

      call prepare(run, slewed, error)
      if (allocated(error)) return
      do i = 1, size(run%driver%members)
         call make_quit(run%driver, run%setup%motion, i, 0.33_wp)
      end do
      call perform(run, failure)
      call check(error, allocated(failure), 'the run does not end')
      if (allocated(error)) return
      call check(error, failure%message == 'enough for a test', failure%message)
      call check(error, run%t > 0.29_wp .and. run%t < 0.31_wp .and. run%kept%n == 4, 'not the last good state')
   end subroutine test_all_give_up

   subroutine test_max_steps(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: failure
      type(run_type) :: run

      call prepare(run, slewed//'&solver max_steps = 300 /', error)
      if (allocated(error)) return
      call make_quit(run%driver, run%setup%motion, 2, 0.33_wp)
      call perform(run, failure)
      call check(error, allocated(failure), 'the run does not end')
      if (allocated(error)) return
      call check(error, index(failure%message, 'max_steps = 300 reached at t = ') == 1 .and. run%driver%n_steps == 300, &
                 failure%message)
   end subroutine test_max_steps

   !> Until it is released nothing moves, and any method seems fast.
   subroutine test_release(error)
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: auto, gauss
      call measure(prestressed//'&hinge hinge = 0, held = .true., release_time = 0.1, rest_angle = -0.2 /', 'auto', auto, error)
      if (.not. allocated(error)) call measure(prestressed// &
         '&hinge hinge = 0, held = .true., release_time = 0.1, rest_angle = -0.2 /', 'gauss', gauss, error)
      if (.not. allocated(error)) call check(error, auto < 1.1_wp*gauss, 'auto does not take what is best')
   end subroutine test_release

   !> Before it latches there is little to see of the rods.
   subroutine test_latch(error)
      type(error_type), allocatable, intent(out) :: error
      type(run_type) :: run
      call prepare(run, prestressed//'&hinge hinge = 0, rest_angle = -0.2, latch_angle = 0.79 /', error)
      if (.not. allocated(error)) call perform(run, error)
      if (allocated(error)) return
      call check(error, run%driver%methods() == 'dop853, gauss' .and. index(run%driver%history, ' s gauss: auto: ') > 0, &
                 run%driver%methods()//': '//run%driver%history)
   end subroutine test_latch

   !> Four combinations of two stops.
   subroutine test_many_events(error)
      type(error_type), allocatable, intent(out) :: error
      type(run_type) :: run
      call prepare(run, rattling, error)
      if (.not. allocated(error)) call perform(run, error)
      if (allocated(error)) return
      call check(error, run%setup%motion%events%n_logged > 200, 'too few events')
      if (.not. allocated(error)) call check(error, run%driver%n_choices <= 6, 'choices in numbers')
   end subroutine test_many_events

   !> Held, free, and latched: collocation, explicit steps, and what was chosen at the start.
   subroutine test_told(error)
      type(error_type), allocatable, intent(out) :: error
      type(run_type) :: run
      character(len=:), allocatable :: told
      call prepare(run, released_and_latched, error)
      if (.not. allocated(error)) call perform(run, error)
      if (allocated(error)) return
      told = run%driver%reason()
      call check(error, index(told, 'auto: ') == 1 .and. index(told, ': collocation') > 0 .and. &
                 index(told, nl//'from t = 0.1 s dop853: ') > 0 .and. index(told, ' s gauss: auto: ', back=.true.) > &
                 index(told, ' s dop853: ', back=.true.), told)
   end subroutine test_told

   subroutine test_left_for_good(error)
      type(error_type), allocatable, intent(out) :: error
      type(run_type) :: run
      type(solver_statistics) :: stats
      call prepare(run, released_and_latched, error)
      if (allocated(error)) return
      run%driver%members(2)%has_failed = .true.
      call perform(run, error)
      if (allocated(error)) return
      stats = run%driver%members(2)%integrator%statistics()
      call check(error, run%setup%motion%events%n_logged == 2 .and. stats%n_starts == 1 .and. &
                 index(run%driver%reason(), ' s gauss: ') == 0, run%driver%reason())
   end subroutine test_left_for_good

   !> Dampers of friction let implicit methods seem the better ones for long.
   subroutine test_trials_after_releases(error)
      type(error_type), allocatable, intent(out) :: error
      type(run_type) :: run
      real(wp) :: effort
      call prepare(run, in_sequence, error)
      if (.not. allocated(error)) call perform(run, error)
      if (allocated(error)) return
      effort = effort_of('dop853', run%setup%motion%dynamics, run%driver%statistics())
      call check(error, run%driver%n_choices > 1 .and. run%driver%tried < 0.5_wp*effort, 'trials cost too much')
   end subroutine test_trials_after_releases

   !> Effort of a run.
   subroutine measure(text, method, effort, error)
      character(len=*), intent(in) :: text, method
      real(wp), intent(out) :: effort
      type(error_type), allocatable, intent(out) :: error
      type(run_type) :: run

      effort = 0.0_wp
      call prepare(run, text//"&solver method = '"//method//"' /", error)
      if (.not. allocated(error)) call perform(run, error)
      if (.not. allocated(error)) effort = effort_of('gauss', run%setup%motion%dynamics, run%driver%statistics())
   end subroutine measure

   !> Ready to begin.
   subroutine prepare(run, text, error)
      type(run_type), intent(out) :: run
      character(len=*), intent(in) :: text
      type(error_type), allocatable, intent(out) :: error

      call parse_case(text, 'c.nml', run%config, error)
      if (allocated(error)) return
      allocate (run%setup)
      call new_run_setup(run%setup, run%config, .true., error)
      if (allocated(error)) return
      call new_driver(run%driver, run%setup%motion, run%setup%y, run%config%solver, run%config%t_end, 10, error)
      allocate (run%kept%states(size(run%setup%y), 11), source=0.0_wp)
   end subroutine prepare

   !> From the start to the end, with 10 intervals between outputs.
   subroutine perform(run, error)
      type(run_type), intent(inout) :: run
      type(error_type), allocatable, intent(out) :: error
      associate (setup => run%setup)
         call simulate(setup%motion, run%driver, even_times(setup%t_end, 10), setup%t_end, run%kept, setup%y, run%t, error)
      end associate
   end subroutine perform

   !> Let a member work as it does, and give up.
   subroutine make_quit(driver, motion, member, t_quit)
      use rodyn_integrators, only: new_integrator
      use rodyn_method_costs, only: candidates
      type(driver_type), intent(inout) :: driver
      type(motion_type), target, intent(inout) :: motion
      integer, intent(in) :: member
      real(wp), intent(in) :: t_quit
      type(quitter), allocatable :: wrapper
      type(error_type), allocatable :: error

      allocate (wrapper)
      wrapper%t_quit = t_quit
      call new_integrator(wrapper%inner, motion, merge('gauss ', candidates(member)%method, .not. driver%choice%automatic), &
                          driver%options, error)
      if (allocated(error)) error stop error%message
      call move_alloc(wrapper, driver%members(member)%integrator)
   end subroutine make_quit

   subroutine start(self, t, y, error)
      class(quitter), intent(inout) :: self
      real(wp), intent(in) :: t, y(:)
      type(error_type), allocatable, intent(out) :: error
      self%t_good = t
      self%y_good = y
      call self%inner%set_stop(self%t_stop)
      call self%inner%start(t, y, error)
   end subroutine start

   subroutine advance(self, t_out, y, t, error)
      class(quitter), intent(inout) :: self
      real(wp), intent(in) :: t_out
      real(wp), contiguous, intent(out) :: y(:)
      real(wp), intent(out) :: t
      type(error_type), allocatable, intent(out) :: error

      if (t_out > self%t_quit) then
         call raise(error, 'enough for a test')
         t = self%t_good
         y = self%y_good
         return
      end if
      call self%inner%advance(t_out, y, t, error)
      self%t_good = t
      self%y_good = y
      self%n_steps = self%inner%n_steps
   end subroutine advance

   function statistics(self) result(stats)
      class(quitter), intent(inout) :: self
      type(solver_statistics) :: stats
      stats = self%inner%statistics()
   end function statistics

   subroutine finalize(self)
      class(quitter), intent(inout) :: self
      call self%inner%finalize()
   end subroutine finalize

   subroutine observe(self, motion, t, y, error)
      class(keeper), intent(inout) :: self
      type(motion_type), intent(inout) :: motion
      real(wp), intent(in) :: t, y(:)
      type(error_type), allocatable, intent(out) :: error
      associate (unused => motion, unused_t => t); end associate
      self%n = self%n + 1
      self%states(:, self%n) = y
   end subroutine observe

end module test_driver
