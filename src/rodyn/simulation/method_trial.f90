!> What methods cost on a scene, found by trying: the beginning of a run by each, with equal and growing effort.
!>
!> Effort is counted by `rodyn_method_costs`, not timed, so that the same scene gets the same method everywhere.
module rodyn_method_trial
   use rodyn_kinds, only: wp, i8
   use rodyn_errors, only: error_type
   use rodyn_integrator, only: integrator_type, monitor_type, solver_options, solver_statistics
   use rodyn_integrators, only: new_integrator
   use rodyn_method_costs, only: candidates, collocation, effort_of, effort_of_modes, effort_of_nodes, effort_of_step, explicit, &
      fast_rates, n_even
   use rodyn_method_numbers, only: bounded, calm_after, calm_steps, clear_lead, damped, doubled, dying_steps, even_iterations, &
      even_share, even_start, even_steps, even_trial, expectation_error, explicit_step, fewest_steps, first_effort, &
      first_share, growing_share, growing, grows_on, grows_twice, growth_with_rods, least_phase, most_growth, most_phase, &
      most_share, n_slices, own_share, slower, some_rounds, spent_share, trial_limit
   use rodyn_motion, only: motion_type
   implicit none (type, external)
   private
   public :: trial_type, try_methods

   !> Passes on that someone wants an end, and no more: what a trial reports is not the run.
   type, extends(monitor_type) :: trial_monitor
      class(monitor_type), pointer :: outer => null()
   contains
      procedure :: stop_requested
   end type trial_monitor

   !> A run that can be continued; started when first continued.
   type :: runner
      type(motion_type), pointer :: motion => null()
      class(integrator_type), allocatable :: integrator
      real(wp) :: effort = 0.0_wp  !! spent
      real(wp) :: begun = 0.0_wp   !! of that before the first step
      real(wp) :: reached = 0.0_wp !! [s]
      real(wp) :: pace = 0.0_wp    !! simulated time for an effort of 1 in the last round [s]
      real(wp) :: growth = 1.0_wp  !! of the pace, in the last round
      real(wp) :: growth_before = 1.0_wp !! in the round before
      real(wp) :: ends(3) = 0.0_wp !! efforts at the ends of the last rounds
      logical :: failed = .false.
   end type runner

   !> A trial: what it is of, for the caller to say, and how far it has come.
   type :: trial_type
      type(motion_type), pointer :: motion => null() !! not owned; in the regime that begins or goes on at t
      real(wp), allocatable :: y(:)                  !! state at t, without quadratures
      type(solver_options) :: options
      real(wp) :: t = 0.0_wp                         !! start [s]
      real(wp) :: t_first = 0.0_wp                   !! end of the trial at the latest; no load switches before [s]
      real(wp) :: t_end = 0.0_wp                     !! end of the run [s]
      type(fast_rates) :: rates
      real(wp) :: expected(n_even) = 0.0_wp          !! effort of the even methods; huge: of no use here
      real(wp) :: quiet_after = 0.0_wp               !! time in which dampers will have calmed the fastest vibrations [s]
      logical :: out(size(candidates)) = .false.     !! candidates of no use
      class(monitor_type), pointer :: monitor => null() !! may end the trial, which then tells nothing
      real(wp) :: forecast(size(candidates)) = huge(1.0_wp) !! effort of each on the whole run
      logical :: conclusive = .true.   !! otherwise the effort it may cost has ended it, and the forecasts are worth little
      type(trial_monitor), private :: listener
      type(runner), private :: runners(size(candidates))
      integer, private :: best = n_even + 1          !! implicit method
      real(wp), private :: first = 0.0_wp            !! effort of a candidate in the first round
      real(wp), private :: allowed = 0.0_wp          !! up to the end of the present one
      logical, private :: calms_down = .false.       !! dampers will calm the vibrations
      real(wp), private :: calm_after = 0.0_wp       !! what is seen after this time is no longer them [s]
   end type trial_type

contains

   !> Effort that each candidate would need from `t` to `t_end`, huge if it fails. An implicit method may creep at first,
   !> until vibrations it does not follow have died out. So its pace is that of the last round; that of order 2, which no
   !> vibration holds back for ever, goes on growing until they are calm.
   !>
   !> The implicit methods are tried with efforts that double from round to round. One that has nothing left to hope for drops out,
   !> and the trial ends when the best has a share of its run behind it. The pace of the even methods is known to a factor of 3
   !> beforehand; only where that leaves a doubt at the end they are tried, too (and collocation from the first where dampers calm
   !> the vibrations).
   subroutine try_methods(trial, most, effort)
      type(trial_type), target, intent(inout) :: trial
      real(wp), intent(in) :: most    !! effort that the trial may cost
      real(wp), intent(out) :: effort !! spent on it

      trial%listener%outer => trial%monitor
      trial%calm_after = calm_after*trial%quiet_after
      trial%calms_down = trial%t + trial%quiet_after < trial%t_end
      trial%runners%reached = trial%t
      trial%runners%failed = trial%out
      trial%forecast(:n_even) = trial%expected
      trial%first = min(first_effort, first_share*minval(trial%expected))
      call run_rounds(trial, most)
      effort = sum(trial%runners%effort)
      call end_trial(trial)
   end subroutine try_methods

   !> Round after round, until what is known is enough, or as much as it may cost. Before the last one the even methods are tried.
   subroutine run_rounds(trial, most)
      type(trial_type), target, intent(inout) :: trial
      real(wp), intent(in) :: most
      logical :: over, even_tried

      trial%allowed = trial%first
      even_tried = .false.
      do
         call follow_collocation(trial)
         call try_implicit(trial)
         over = has_ended(trial)
         if (over .or. is_spent(trial)) then
            if (even_tried) exit
            call try_even(trial)
            even_tried = .true.
            if (over .or. is_spent(trial)) exit
         end if
         trial%conclusive = after_next_round(trial) <= most
         if (.not. trial%conclusive) exit
         trial%allowed = 2.0_wp*trial%allowed
      end do
   end subroutine run_rounds

   !> A round of the implicit methods that have a chance.
   subroutine try_implicit(trial)
      type(trial_type), target, intent(inout) :: trial
      logical :: calms
      integer :: j

      do j = n_even + 1, size(candidates)
         if (outdone(trial, j)) cycle
         call continue_runner(trial, j, trial%allowed)
         calms = candidates(j)%order == 2
         associate (self => trial%runners(j), rates => trial%rates, t_end => trial%t_end)
            trial%forecast(j) = forecast_of(self, t_end, calms .and. trial%allowed > some_rounds*trial%first)
            if (.not. calms) cycle
            if (grows_for_good(self, rates)) trial%forecast(j) = min(forecast_of(self, t_end, .false.), &
               settled(self, rates) + quiet(self, rates, trial%options%rtol, t_end))
         end associate
      end do
      trial%best = n_even + minloc(trial%forecast(n_even + 1:), dim=1)
   end subroutine try_implicit

   !> Where dampers will calm the vibrations, collocation takes part in the rounds: it may need far less than expected. Its pace
   !> counts once they are calm; before, it is the least to be expected.
   subroutine follow_collocation(trial)
      type(trial_type), target, intent(inout) :: trial

      associate (self => trial%runners(collocation), expected => trial%expected(collocation))
         if (.not. expected < huge(1.0_wp)) return
         if (.not. trial%calms_down .or. self%failed .or. effort_of_modes(trial%motion%dynamics, 2) > trial%allowed) return
         if (expected/expectation_error > minval(trial%forecast(n_even + 1:))) return
         call continue_runner(trial, collocation, trial%allowed)
         call forecast_even(trial, collocation)
      end associate
   end subroutine follow_collocation

   !> Forecast of an even method by its pace. What was seen while vibrations that dampers will calm still last makes the run no
   !> dearer than expected.
   subroutine forecast_even(trial, j)
      type(trial_type), intent(inout) :: trial
      integer, intent(in) :: j

      associate (self => trial%runners(j))
         trial%forecast(j) = forecast_of(self, trial%t_end, .false.)
         if (trial%calms_down .and. self%reached - trial%t < trial%calm_after .and. .not. self%failed) &
            trial%forecast(j) = min(trial%forecast(j), trial%expected(j))
      end associate
   end subroutine forecast_even

   !> Sharpen the forecasts of the even methods that may be the best, if that is not settled and they are worth it.
   subroutine try_even(trial)
      type(trial_type), target, intent(inout) :: trial
      logical :: contends(size(candidates))
      real(wp) :: most, begin, a_step
      integer :: j

      contends = trial%forecast/expectation_error <= minval(trial%forecast)
      if (count(contends) < 2) return
      do j = 1, n_even
         if (.not. contends(j)) cycle
         a_step = explicit_step
         begin = 0.0_wp
         if (j == collocation) then
            a_step = effort_of_step(trial%motion%dynamics) + even_iterations*effort_of_nodes(trial%motion%dynamics)
            begin = effort_of_modes(trial%motion%dynamics, 2)
         end if
         if (begin > 2.0_wp*even_trial*trial%expected(j)) cycle
         most = min(even_steps*a_step, even_trial*trial%expected(j))
         call continue_runner(trial, j, even_start*most)
         call continue_runner(trial, j, most)
         call forecast_even(trial, j)
         ! Explicit steps bound by dampers cost what is known beforehand, once the first vibrations have died out.
         if (j == explicit .and. trial%rates%decay > trial%rates%frequency .and. .not. trial%runners(j)%failed) &
            trial%forecast(j) = min(trial%forecast(j), trial%expected(j))
      end do
   end subroutine try_even

   !> Whether someone has reached the end, or all implicit methods have dropped out.
   logical function has_ended(trial)
      type(trial_type), intent(in) :: trial
      integer :: j
      has_ended = any(trial%runners(n_even + 1:)%reached >= trial%t_first) .or. trial%runners(collocation)%reached >= trial%t_end &
                  .or. all([(outdone(trial, j), j=n_even + 1, size(candidates))])
   end function has_ended

   !> Whether the trial has had its share of the run, or would have with another round. One that may still become unstable
   !> has to show its whole run.
   logical function is_spent(trial)
      type(trial_type), intent(in) :: trial
      real(wp) :: budget, share, even

      associate (best => trial%best)
         even = minval(trial%forecast(:n_even))
         budget = min(most_effort(trial%motion%dynamics%scene%n), even_share*even)
         share = own_share
         if (candidates(best)%order == 2 .and. trial%runners(best)%growth > grows_on) share = growing_share
         if (trial%forecast(best) < even .and. .not. order_is_risky(best, trial%rates)) &
            budget = min(budget, share*trial%forecast(best))
         is_spent = trial%allowed >= budget .or. after_next_round(trial) > most_share*even
      end associate
   end function is_spent

   !> Effort of the trial with another round, which doubles what implicit methods have spent.
   real(wp) function after_next_round(trial)
      type(trial_type), intent(in) :: trial
      integer :: j
      after_next_round = sum(trial%runners%effort) + &
                         trial%allowed*count([(.not. outdone(trial, j), j=n_even + 1, size(candidates))])
   end function after_next_round

   !> Whether an implicit method has failed, or has nothing left to hope for.
   logical function outdone(trial, j)
      type(trial_type), intent(in) :: trial
      integer, intent(in) :: j
      real(wp) :: rival, hope
      integer :: k

      associate (self => trial%runners(j), forecast => trial%forecast)
         outdone = self%failed
         if (outdone .or. .not. self%effort > 0.0_wp) return
         outdone = order_is_risky(j, trial%rates) .and. phase_of(self, trial%rates) < bounded
         if (outdone .or. self%effort < some_rounds*trial%first .or. self%growth > growing) return
         rival = minval(forecast, mask=[(k /= j .and. k > n_even, k=1, size(candidates))])
         do k = 1, n_even
            rival = min(rival, merge(forecast(k), expectation_error*min(forecast(k), 1.0e30_wp), trial%runners(k)%effort > 0.0_wp))
         end do
         hope = forecast(j)/clear_lead
         if (candidates(j)%order == 2) hope = min(hope, self%effort + dying_out(self, trial%rates))
         outdone = hope > rival
      end associate
   end function outdone

   !> BDF above order 2 is unstable for vibrations without dampers where its steps are longer than some half a radian, which
   !> shows as late as they have grown from nothing.
   pure logical function order_is_risky(j, rates)
      integer, intent(in) :: j
      type(fast_rates), intent(in) :: rates
      order_is_risky = candidates(j)%order == 0 .and. rates%decay < damped*rates%frequency
   end function order_is_risky

   !> Phase of the fastest vibration in a step of the last round.
   pure real(wp) function phase_of(self, rates)
      type(runner), intent(in) :: self
      type(fast_rates), intent(in) :: rates
      phase_of = rates%frequency*self%pace*per_step(self)
   end function phase_of

   !> Effort of a step.
   pure real(wp) function per_step(self)
      type(runner), intent(in) :: self
      per_step = explicit_step
      if (.not. allocated(self%integrator)) return
      if (self%integrator%n_steps > 0) per_step = (self%effort - self%begun)/real(self%integrator%n_steps, wp)
   end function per_step

   !> Effort until vibrations have died out that hold back the steps of BDF of order 2. A step h damps a vibration of frequency w
   !> by (h w)^4/4, and the tolerance allows h ~ amplitude^(-1/3); both together let it vanish after 3/(h w)^4 steps, with today's
   !> h. The slower vibrations of rods last longer than the fastest. 0: unknown.
   real(wp) function dying_out(self, rates)
      type(runner), intent(in) :: self
      type(fast_rates), intent(in) :: rates
      dying_out = 0.0_wp
      if (rates%decay > damped*rates%frequency .or. .not. self%pace > 0.0_wp) return ! dampers are at work, too
      dying_out = slower*dying_steps/max(least_phase, min(most_phase, phase_of(self, rates)))**4*per_step(self)
   end function dying_out

   !> However long the run: what a candidate may spend on a trial.
   pure real(wp) function most_effort(n_rods)
      integer, intent(in) :: n_rods
      most_effort = trial_limit/(1.0_wp + growth_with_rods*n_rods) ! the last round may double it
   end function most_effort

   !> Effort to the end if the pace stays, or goes on growing as it did.
   pure real(wp) function forecast_of(self, t_end, grows)
      type(runner), intent(in) :: self
      real(wp), intent(in) :: t_end
      logical, intent(in) :: grows
      real(wp) :: reached, pace, growth

      forecast_of = huge(1.0_wp)
      if (self%failed .or. .not. self%pace > 0.0_wp) return
      forecast_of = self%effort
      reached = self%reached
      growth = merge(max(1.0_wp, min(most_growth, self%growth)), 1.0_wp, grows)
      pace = self%pace
      do while (reached < t_end)
         pace = pace*growth
         if (reached + forecast_of*pace >= t_end .or. growth < growing) then
            forecast_of = forecast_of + (t_end - reached)/pace
            exit
         end if
         reached = reached + forecast_of*pace
         forecast_of = 2.0_wp*forecast_of
      end do
   end function forecast_of

   !> Whether the growth of the pace is that of vibrations dying out: it has lasted two rounds, the last of which doubled the
   !> effort. With strong dampers the pace grows for other reasons, too, and it must not slacken.
   logical function grows_for_good(self, rates)
      type(runner), intent(in) :: self
      type(fast_rates), intent(in) :: rates
      grows_for_good = min(self%growth, self%growth_before) > growing .and. self%growth*self%growth_before > grows_twice .and. &
                       self%ends(3) > doubled*self%ends(2)
      if (rates%is_strongly_damped()) grows_for_good = grows_for_good .and. self%growth > grows_on
   end function grows_for_good

   !> Effort until the vibrations are calm that hold back the steps of BDF of order 2, h ~ amplitude^(-1/3). Dampers reduce the
   !> amplitude exponentially in time, so that 1/h falls to zero linearly with the number of steps. The method itself, by
   !> (h omega)^4/4 a step, would make 1/h^4 do so; where dampers are weak or none the square is about right, since slower
   !> vibrations of the rods last longer than the fastest. With the growth of the pace from round to round that gives the end.
   real(wp) function settled(self, rates)
      type(runner), intent(in) :: self
      type(fast_rates), intent(in) :: rates
      real(wp) :: before, now !! the middle of the last two rounds
      before = 0.5_wp*(self%ends(1) + self%ends(2))
      now = 0.5_wp*(self%ends(2) + self%ends(3))
      settled = max(self%effort, now + (now - before)/(self%growth**merge(1, 2, rates%decay > damped*rates%frequency) - 1.0_wp))
   end function settled

   !> Effort of BDF of order 2 on the rest of the run once vibrations are calm; h^3 ~ rtol.
   real(wp) function quiet(self, rates, rtol, t_end)
      type(runner), intent(in) :: self
      type(fast_rates), intent(in) :: rates
      real(wp), intent(in) :: rtol, t_end
      quiet = calm_steps*(1.0e-3_wp/rtol)**(1.0_wp/3.0_wp)*rates%slow*(t_end - self%reached)*per_step(self)
   end function quiet

   !> With a copy of the motion as it stands, but for the ledger and the record of events.
   subroutine start_runner(trial, j)
      type(trial_type), target, intent(inout) :: trial
      integer, intent(in) :: j
      type(solver_options) :: own
      type(error_type), allocatable :: error

      own = trial%options
      own%order = candidates(j)%order
      associate (self => trial%runners(j))
         allocate (self%motion)
         self%motion = trial%motion
         self%motion%ledger = .false.
         self%motion%n_states = trial%motion%n_controlled
         self%motion%events%n_logged = 0
         call new_integrator(self%integrator, self%motion, trim(candidates(j)%method), own, error)
         if (.not. allocated(error)) then
            if (associated(trial%listener%outer)) call self%integrator%set_monitor(trial%listener)
            call self%integrator%set_stop(trial%t_first)
            call self%integrator%start(trial%t, trial%y, error)
         end if
         self%failed = allocated(error)
         if (.not. self%failed) self%begun = effort_of(candidates(j)%method, trial%motion%dynamics, &
                                                       self%integrator%statistics())
         self%effort = self%begun
      end associate
   end subroutine start_runner

   !> Go on until the effort is spent, or the end or a failure is met.
   subroutine continue_runner(trial, j, allowed)
      type(trial_type), target, intent(inout) :: trial
      integer, intent(in) :: j
      real(wp), intent(in) :: allowed
      real(wp) :: effort_before, reached_before, pace_before

      associate (self => trial%runners(j))
         if (.not. associated(self%motion)) call start_runner(trial, j)
         effort_before = self%effort
         reached_before = self%reached
         pace_before = self%pace
         do while (.not. self%failed .and. self%reached < trial%t_first .and. self%effort - self%begun < spent_share*allowed)
            call run_slice(trial, j, allowed)
         end do
         if (.not. self%effort > effort_before) return
         self%ends = [self%ends(2), effort_before, self%effort]
         self%pace = (self%reached - reached_before)/(self%effort - effort_before)
         self%growth_before = self%growth
         if (pace_before > 0.0_wp) self%growth = self%pace/pace_before
      end associate
   end subroutine continue_runner

   !> As many steps as a slice of the effort allows, or to an event.
   subroutine run_slice(trial, j, allowed)
      type(trial_type), intent(inout) :: trial
      integer, intent(in) :: j
      real(wp), intent(in) :: allowed
      type(error_type), allocatable :: error
      type(solver_statistics) :: stats
      real(wp) :: state(size(trial%y))
      integer :: steps

      associate (self => trial%runners(j))
         stats = self%integrator%statistics()
         steps = max(fewest_steps, int(min(allowed - (self%effort - self%begun), allowed/n_slices)/per_step(self)))
         self%integrator%options%max_steps = int(min(stats%n_steps + steps, int(huge(steps), i8)))
         call self%integrator%advance(trial%t_first, state, self%reached, error)
         stats = self%integrator%statistics()
         self%effort = effort_of(candidates(j)%method, trial%motion%dynamics, stats)
         if (.not. allocated(error) .and. self%integrator%at_event) call pass_event(self, state, error)
         self%failed = allocated(error) .and. self%reached < trial%t_first .and. &
                       stats%n_steps < self%integrator%options%max_steps
      end associate
   end subroutine run_slice

   !> Release everything.
   subroutine end_trial(trial)
      type(trial_type), intent(inout) :: trial
      integer :: j
      do j = 1, size(trial%runners)
         if (allocated(trial%runners(j)%integrator)) call trial%runners(j)%integrator%finalize()
         if (associated(trial%runners(j)%motion)) deallocate (trial%runners(j)%motion)
      end do
   end subroutine end_trial

   !> Go on behind an event.
   subroutine pass_event(self, y, error)
      type(runner), intent(inout) :: self
      real(wp), contiguous, intent(inout) :: y(:)
      type(error_type), allocatable, intent(out) :: error
      call self%motion%respond(self%reached, self%integrator%crossed, y, error)
      if (.not. allocated(error)) call self%integrator%start(self%reached, y, error)
   end subroutine pass_event

   function stop_requested(self) result(requested)
      class(trial_monitor), intent(in) :: self
      logical :: requested
      requested = self%outer%stop_requested()
   end function stop_requested

end module rodyn_method_trial
