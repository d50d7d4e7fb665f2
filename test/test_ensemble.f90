!> Many cases at once in vector lanes: they move as they do alone, and nothing they do depends on the others.
module test_ensemble
   use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_positive_inf
   use, intrinsic :: ieee_exceptions, only: ieee_usual, ieee_set_halting_mode, ieee_get_halting_mode
   use rodyn_kinds, only: wp, i8
   use rodyn_errors, only: error_type, raise
   use rodyn_case_config, only: case_config, load_config
   use rodyn_scene, only: scene_type, new_scene
   use rodyn_motion, only: motion_type, new_motion, initial_state
   use rodyn_integrator, only: solver_options, solver_statistics, integrator_type
   use rodyn_integrators, only: new_integrator
   use rodyn_lane_scene, only: suits_lanes, are_alike
   use rodyn_ensemble, only: ensemble_member, ensemble_client, run_ensemble
   use rodyn_simulation, only: observer_type, listed_times, simulate
   use test_testing, only: unittest, new_test, check
   use test_random_scenes, only: random_case, seed_random, kind_name, n_all_kinds, uniform
   implicit none (type, external)
   private
   public :: collect_ensemble

   !> What is kept of a case.
   type :: outcome
      real(wp), allocatable :: states(:, :) !! (n_states, times)
      integer :: n_seen = 0
      type(solver_statistics) :: counts
      character(len=200) :: message = ''
      real(wp) :: t = 0.0_wp
      logical :: has_failed = .false.
   end type outcome

   !> A case with its number.
   type, extends(ensemble_member) :: numbered
      integer :: number = 0
   end type numbered

   !> Gives out the cases of a list in some order.
   type, extends(ensemble_client) :: list_client
      type(case_config), allocatable :: configs(:)
      logical :: spoilt = .false. !! case 2 has a negative mass, case 5 an infinite rate: no case could
      real(wp), allocatable :: times(:)
      type(solver_options) :: options
      integer, allocatable :: order(:)
      integer :: next = 1
      integer :: stop_after = huge(1)  !! looks at the clock
      type(outcome), allocatable :: outcomes(:)
   contains
      procedure :: take
      procedure :: observe
      procedure :: finish
      procedure :: stop_requested
   end type list_client

   !> The same one by one.
   type, extends(observer_type) :: keeper
      type(outcome) :: kept
   contains
      procedure :: observe => keep
   end type keeper

   real(wp), parameter :: t_end = 0.3_wp !! [s]

contains

   subroutine collect_ensemble(suite)
      type(unittest), allocatable, intent(out) :: suite(:)
      suite = [new_test('cases of every kind in lanes move as they do one by one', test_kinds, long=.true.), &
               new_test('the steps in lanes are those of dop853', test_counts), &
               new_test('order, companions and lanes change no bit', test_order, long=.true.), &
               new_test('cases that fail say so and disturb nobody', test_failures), &
               new_test('max_step and max_steps hold in each lane', test_limits), &
               new_test('a case that takes too long is ended, the others are not', test_time_limit), &
               new_test('an ensemble stops when it is asked to', test_stop)]
   end subroutine collect_ensemble

   subroutine take(self, member)
      class(list_client), intent(inout) :: self
      class(ensemble_member), pointer, intent(out) :: member
      type(numbered), pointer :: mine
      type(scene_type) :: scene
      type(error_type), allocatable :: error

      nullify (member)
      if (self%next > size(self%order)) return
      allocate (mine)
      mine%number = self%order(self%next)
      self%next = self%next + 1
      call new_scene(scene, self%configs(mine%number), error)
      if (allocated(error)) error stop error%message
      if (self%spoilt .and. mine%number == 2) scene%body%mass = -1.0e3_wp
      call new_motion(mine%motion, scene, .false., error)
      call initial_state(mine%motion, self%configs(mine%number)%initial, mine%y)
      if (self%spoilt .and. mine%number == 5) mine%y(mine%motion%n_q + 3) = ieee_value(1.0_wp, ieee_positive_inf)
      mine%times = self%times
      mine%t_end = t_end
      mine%options = self%options
      if (mine%number == 2) then
         mine%options%max_steps = min(self%options%max_steps, 100000)
         mine%limit = merge(1.0e-5_wp, 0.0_wp, self%options%max_step > 0.0_wp .and. self%options%max_step < 1.0e-4_wp)
      end if
      associate (kept => self%outcomes(mine%number))
         allocate (kept%states(size(mine%y), size(mine%times)), source=0.0_wp)
      end associate
      member => mine
   end subroutine take

   subroutine observe(self, member, t, y, error)
      class(list_client), intent(inout) :: self
      class(ensemble_member), intent(inout) :: member
      real(wp), intent(in) :: t, y(:)
      type(error_type), allocatable, intent(out) :: error

      select type (member)
      type is (numbered)
         associate (kept => self%outcomes(member%number))
            kept%n_seen = kept%n_seen + 1
            kept%states(:, kept%n_seen) = y
            if (abs(t - member%times(kept%n_seen)) > 0.0_wp) call raise(error, 'shown at a wrong time')
         end associate
      end select
   end subroutine observe

   subroutine finish(self, member)
      class(list_client), intent(inout) :: self
      class(ensemble_member), pointer, intent(inout) :: member

      select type (member)
      type is (numbered)
         associate (kept => self%outcomes(member%number))
            kept%counts = member%counts
            kept%t = member%t
            kept%has_failed = member%has_failed
            if (allocated(member%error)) kept%message = member%error%message
            if (member%late) kept%message = 'late'
         end associate
      end select
      deallocate (member)
   end subroutine finish

   function stop_requested(self) result(requested)
      class(list_client), intent(inout) :: self
      logical :: requested
      self%stop_after = self%stop_after - 1
      requested = self%stop_after < 0
   end function stop_requested

   subroutine keep(self, motion, t, y, error)
      class(keeper), intent(inout) :: self
      type(motion_type), intent(inout) :: motion
      real(wp), intent(in) :: t, y(:)
      type(error_type), allocatable, intent(out) :: error
      associate (unused => t, unused_motion => motion); end associate
      self%kept%n_seen = self%kept%n_seen + 1
      self%kept%states(:, self%kept%n_seen) = y
      if (self%kept%n_seen < 0) call raise(error, '')
   end subroutine keep

   !> Random cases of one kind with n rods that may stand side by side; loads are switched at random times.
   subroutine random_list(client, which, n, number, found)
      type(list_client), intent(out) :: client
      integer, intent(in) :: which, n, number
      logical, intent(out) :: found
      type(scene_type) :: scene, first
      type(case_config) :: config
      type(error_type), allocatable :: error
      integer :: i, j

      allocate (client%configs(number), client%outcomes(number))
      client%times = [0.0_wp, 0.01_wp, 0.012_wp, 0.0121_wp, 0.1_wp, 0.2_wp, t_end]
      client%options = solver_options(rtol=1.0e-10_wp, atol=1.0e-12_wp)
      client%order = [(i, i=1, number)]
      i = 0
      do while (i < number)
         call random_case(config, which, n)
         config%t_end = t_end
         do j = 1, size(config%loads)
            config%loads(j)%t_start = uniform(-0.1_wp, 0.2_wp)
            config%loads(j)%t_end = uniform(0.2_wp, 0.4_wp)
         end do
         if (i > 0) config%loads(1)%t_end = 0.1_wp ! a switch at an output
         config%loads(1)%t_start = min(config%loads(1)%t_start, 0.05_wp)
         config%chain%hinge_stiffness = config%chain%hinge_stiffness*0.1_wp
         call new_scene(scene, config, error)
         if (allocated(error)) error stop error%message
         found = suits_lanes(scene, scene%hinges)
         if (.not. found) return
         if (i == 0) first = scene
         if (.not. are_alike(first, scene)) cycle
         i = i + 1
         client%configs(i) = config
      end do
   end subroutine random_list

   !> One case of a list by the integrator for one case.
   subroutine run_alone(client, i, kept, error)
      type(list_client), intent(in) :: client
      integer, intent(in) :: i
      type(outcome), intent(out) :: kept
      type(error_type), allocatable, intent(out) :: error
      type(scene_type) :: scene
      type(motion_type), target :: motion
      class(integrator_type), allocatable :: integrator
      type(keeper) :: observer
      real(wp), allocatable :: y(:)

      call new_scene(scene, client%configs(i), error)
      if (.not. allocated(error)) call new_motion(motion, scene, .false., error)
      if (.not. allocated(error)) call new_integrator(integrator, motion, 'dop853', client%options, error)
      if (allocated(error)) return
      call initial_state(motion, client%configs(i)%initial, y)
      allocate (observer%kept%states(size(y), size(client%times)), source=0.0_wp)
      call simulate(motion, integrator, listed_times(client%times), t_end, observer, y, observer%kept%t, error)
      observer%kept%counts = integrator%statistics()
      kept = observer%kept
   end subroutine run_alone

   subroutine test_kinds(error)
      type(error_type), allocatable, intent(out) :: error
      type(list_client) :: client
      type(outcome) :: alone
      real(wp) :: difference
      integer :: which, i
      logical :: found
      character(len=100) :: text

      call seed_random(11)
      do which = 1, n_all_kinds
         call random_list(client, which, 3, 19, found)
         if (.not. found) cycle
         call run_ensemble(client)
         do i = 1, size(client%outcomes), 3
            call run_alone(client, i, alone, error)
            associate (kept => client%outcomes(i))
               if (allocated(error) .and. kept%message(:15) == 'dop853 at t = 0') then ! a motion that explodes does so in both
                  deallocate (error)
                  cycle
               end if
               if (allocated(error)) return
               difference = maxval(abs(kept%states - alone%states))/maxval(abs(alone%states))
               if (kept%n_seen == size(client%times) .and. .not. kept%t < t_end) then
                  if (difference < 1.0e-8_wp) cycle
                  if (difference < sensitivity(client, i, alone)) cycle
               end if
               write (text, '(": case ", i0, ": difference ", es9.2, " ", a)') i, difference, trim(kept%message)
            end associate
            call raise(error, kind_name(which)//trim(text))
            return
         end do
      end do
   end subroutine test_kinds

   !> How far a motion is led elsewhere by changes in the last digits of where it begins: chaotic ones are. The largest of four: one
   !> leads two or three times as far as another.
   real(wp) function sensitivity(client, i, alone)
      type(list_client), intent(inout) :: client
      integer, intent(in) :: i
      type(outcome), intent(in) :: alone
      type(outcome) :: moved
      type(error_type), allocatable :: error
      real(wp) :: phi
      integer :: sample

      sensitivity = 0.0_wp
      phi = client%configs(i)%initial%phi(1)
      do sample = 1, 4
         client%configs(i)%initial%phi(1) = phi + (-1)**sample*((sample + 1)/2)*0.5e-13_wp
         call run_alone(client, i, moved, error)
         sensitivity = max(sensitivity, maxval(abs(moved%states - alone%states))/maxval(abs(alone%states)))
      end do
      client%configs(i)%initial%phi(1) = phi
   end function sensitivity

   !> Not the same bits, since vector instructions round elsewhere; but the same method with the same control.
   subroutine test_counts(error)
      type(error_type), allocatable, intent(out) :: error
      type(list_client) :: client
      type(outcome) :: alone
      integer :: i
      logical :: found

      call seed_random(12)
      call random_list(client, 1, 2, 11, found)
      client%options%rtol = 1.0e-8_wp
      call run_ensemble(client)
      do i = 1, size(client%outcomes)
         call run_alone(client, i, alone, error)
         if (allocated(error)) return
         associate (kept => client%outcomes(i))
            call check(error, abs(kept%counts%n_steps - alone%counts%n_steps) < 1 + alone%counts%n_steps/50, 'steps')
            call check(error, abs(kept%counts%n_rhs - alone%counts%n_rhs) < 1 + alone%counts%n_rhs/50, 'right-hand sides')
            call check(error, kept%counts%n_starts == alone%counts%n_starts, 'starts')
            if (allocated(error)) return
         end associate
      end do
   end subroutine test_counts

   !> All together, in reverse, and each for itself.
   subroutine test_order(error)
      type(error_type), allocatable, intent(out) :: error
      type(list_client) :: client, other
      integer :: which, i, trial
      logical :: found

      call seed_random(13)
      do which = 1, n_all_kinds
         call random_list(client, which, 4, 13, found)
         if (.not. found) cycle
         client%options = solver_options(rtol=1.0e-6_wp, atol=1.0e-8_wp)
         call copy(client, other)
         call run_ensemble(client)
         do trial = 0, size(client%configs)
            if (trial > 3 .and. trial < size(client%configs)) cycle
            other%order = client%order(size(client%order):1:-1)
            if (trial > 0) other%order = [trial]
            other%next = 1
            do i = 1, size(other%outcomes)
               if (allocated(other%outcomes(i)%states)) deallocate (other%outcomes(i)%states)
               other%outcomes(i)%n_seen = 0
            end do
            call run_ensemble(other)
            do i = 1, size(other%order)
               associate (a => client%outcomes(other%order(i)), b => other%outcomes(other%order(i)))
                  if (same(a, b)) cycle
               end associate
               call raise(error, kind_name(which)//': other bits in other company')
               return
            end do
         end do
      end do
   end subroutine test_order

   pure logical function same(a, b)
      type(outcome), intent(in) :: a, b
      same = all(transfer(a%states, [0_i8]) == transfer(b%states, [0_i8])) .and. a%counts%n_steps == b%counts%n_steps .and. &
             a%counts%n_rhs == b%counts%n_rhs .and. a%message == b%message .and. a%n_seen == b%n_seen
   end function same

   !> The same list, nothing computed.
   subroutine copy(client, other)
      type(list_client), intent(in) :: client
      type(list_client), intent(out) :: other
      other%configs = client%configs
      other%times = client%times
      other%options = client%options
      other%order = client%order
      allocate (other%outcomes(size(client%configs)))
   end subroutine copy

   !> A mass matrix that is not positive definite, a state that is not finite, and a load that breaks everything half-way.
   subroutine test_failures(error)
      type(error_type), allocatable, intent(out) :: error
      type(list_client) :: client, other
      integer :: i
      logical :: found, halting(size(ieee_usual))

      call seed_random(14)
      call random_list(client, 1, 3, 20, found)
      client%options = solver_options(rtol=1.0e-6_wp, atol=1.0e-8_wp)
      call copy(client, other)
      call run_ensemble(client)
      other%spoilt = .true.
      other%configs(7)%loads(1) = load_config(component='X', value=huge(1.0_wp), t_start=0.15_wp, t_end=1.0_wp)
      call ieee_get_halting_mode(ieee_usual, halting)
      call ieee_set_halting_mode(ieee_usual, .false.)
      call run_ensemble(other)
      call ieee_set_halting_mode(ieee_usual, halting)
      do i = 1, size(client%outcomes)
         select case (i)
         case (2)
            call check(error, index(other%outcomes(i)%message, 'not positive definite') > 0, 'negative mass passes')
         case (5)
            call check(error, index(other%outcomes(i)%message, 'not finite') > 0, 'infinite rotation passes')
         case (7)
            call check(error, index(other%outcomes(i)%message, 't = 0.15') > 0 .and. other%outcomes(i)%n_seen == 5 .and. &
                       abs(other%outcomes(i)%t - 0.15_wp) < 1.0e-15_wp, 'infinite force: '//trim(other%outcomes(i)%message))
         case default
            call check(error, same(client%outcomes(i), other%outcomes(i)), 'another case was disturbed')
         end select
         if (.not. allocated(error)) &
            call check(error, other%outcomes(i)%has_failed .eqv. any(i == [2, 5, 7]), 'the method gave up, or did not')
         if (allocated(error)) return
      end do
   end subroutine test_failures

   subroutine test_limits(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: failure
      type(list_client) :: client
      type(outcome) :: alone
      integer :: i
      logical :: found

      call seed_random(15)
      call random_list(client, 3, 3, 9, found)
      client%options%max_step = 1.0e-3_wp
      client%options%max_steps = 150
      call run_ensemble(client)
      do i = 1, size(client%outcomes)
         call run_alone(client, i, alone, failure)
         call check(error, allocated(failure), 'enough steps')
         if (allocated(error)) return
         associate (message => client%outcomes(i)%message)
            call check(error, message(:33), failure%message(:33), 'message') ! up to the fourth digit of the time
         end associate
         if (allocated(error)) return
         call check(error, client%outcomes(i)%counts%n_steps == 150 .and. .not. client%outcomes(i)%has_failed, 'steps')
         if (allocated(error)) return
      end do
   end subroutine test_limits

   !> The second case has 10 microseconds.
   subroutine test_time_limit(error)
      type(error_type), allocatable, intent(out) :: error
      type(list_client) :: client
      integer :: i
      logical :: found

      call seed_random(16)
      call random_list(client, 1, 3, 9, found)
      client%options%max_step = 0.99e-4_wp
      call run_ensemble(client)
      do i = 1, size(client%outcomes)
         call check(error, (client%outcomes(i)%message == 'late') .eqv. (i == 2), 'ended too late or too early')
         if (allocated(error)) return
      end do
   end subroutine test_time_limit

   subroutine test_stop(error)
      type(error_type), allocatable, intent(out) :: error
      type(list_client) :: client
      logical :: found

      call seed_random(17)
      call random_list(client, 1, 3, 20, found)
      client%stop_after = 5
      call run_ensemble(client)
      call check(error, index(client%outcomes(1)%message, 'stopped on request at t = ') == 1, 'stopped')
      call check(error, client%next < 20, 'no further cases')
   end subroutine test_stop

end module test_ensemble
