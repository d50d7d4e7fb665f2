!> What methods cost on a scene, found by trying: the beginning of a run by each, with equal and growing effort.
!>
!> Effort is counted, not timed, so that the same scene gets the same method everywhere. The unit is one right-hand side;
!> what else a step costs was measured (docs/performance.md, `tools/bench newton`).
module rodyn_method_trial
   use rodyn_kinds, only: wp, i8
   use rodyn_errors, only: error_type
   use rodyn_lane_scene, only: suits_lanes
   use rodyn_lanes, only: lanes
   use rodyn_locks, only: has_slaves
   use rodyn_accelerations, only: dynamics_type
   use rodyn_motion, only: motion_type
   use rodyn_integrator, only: integrator_type, monitor_type, solver_options, solver_statistics
   use rodyn_integrators, only: new_integrator
   implicit none (type, external)
   private
   public :: fast_rates, candidate_type, candidates, n_even, effort_of, effort_of_nodes, effort_of_modes, &
      effort_of_step, effort_of_coupling, effort_of_output, explicit_step, try_methods

   !> A method, with the highest order if it is not the usual one.
   type :: candidate_type
      character(len=6) :: method = ''
      integer :: order = 0
   end type candidate_type

   !> Explicit; collocation; implicit; implicit and stable for every vibration, which BDF is up to order 2.
   type(candidate_type), parameter :: candidates(4) = [candidate_type('dop853', 0), candidate_type('gauss', 0), &
      candidate_type('bdf', 0), candidate_type('bdf', 2)]
   integer, parameter :: n_even = 2 !! the first of them follow all vibrations, at a rather even pace; the very first is explicit

   real(wp), parameter :: first_effort = 400.0_wp     !! of a candidate, doubled from round to round; or `first_share` of the run
   real(wp), parameter :: first_share = 0.1_wp
   real(wp), parameter :: even_steps = 200.0_wp       !! are enough to know the pace of methods that follow all vibrations
   real(wp), parameter :: explicit_step = 13.5_wp     !! effort of an explicit step, rejected ones included
   real(wp), parameter :: clear_lead = 3.0_wp         !! with which another need not go on
   real(wp), parameter :: own_share = 0.2_wp          !! of its own run that the best candidate is tried on
   real(wp), parameter :: growing_share = 0.7_wp      !! likewise where its pace still grows
   real(wp), parameter :: even_share = 0.7_wp         !! of the run of the best even method, likewise
   real(wp), parameter :: most_share = 1.0_wp         !! of that, for all candidates together
   real(wp), parameter :: expectation_error = 3.0_wp  !! factor by which expectations may be wrong
   real(wp), parameter :: even_trial = 0.1_wp         !! of its run that an even method is tried on
   real(wp), parameter :: bounded = 0.7_wp            !! phase in a step of BDF above order 2 that vibrations hold back
   real(wp), parameter :: damped = 0.03_wp            !! decay over frequency from where fast vibrations are damped

   !> Passes on that someone wants an end, and no more: what a trial reports is not the run.
   type, extends(monitor_type) :: trial_monitor
      class(monitor_type), pointer :: outer => null()
   contains
      procedure :: report
      procedure :: stop_requested
   end type trial_monitor

   !> The fast end of a scene's spectrum.
   type :: fast_rates
      real(wp) :: frequency = 0.0_wp !! highest natural frequency [rad/s]
      real(wp) :: decay = 0.0_wp     !! fastest decay [1/s]
      real(wp) :: slow = 0.0_wp      !! highest natural frequency of the chain, were its rods rigid; 0: unknown [rad/s]
   contains
      procedure :: strongly_damped
   end type fast_rates

   !> A run that can be continued; started when first continued.
   type :: runner
      type(motion_type), pointer :: motion => null()
      class(integrator_type), allocatable :: integrator
      real(wp) :: effort = 0.0_wp  !! spent
      real(wp) :: begun = 0.0_wp   !! of that before the first step
      real(wp) :: t_start = 0.0_wp !! [s]
      real(wp) :: reached = 0.0_wp !! [s]
      real(wp) :: pace = 0.0_wp    !! simulated time for an effort of 1 in the last round [s]
      real(wp) :: growth = 1.0_wp  !! of the pace, in the last round
      real(wp) :: growth_before = 1.0_wp !! in the round before
      real(wp) :: ends(3) = 0.0_wp !! efforts at the ends of the last rounds
      logical :: failed = .false.
   end type runner

contains

   !> Dampers about as fast as vibrations, or faster.
   pure logical function strongly_damped(self)
      class(fast_rates), intent(in) :: self
      strongly_damped = self%decay > 0.5_wp*self%frequency
   end function strongly_damped

   !> Effort of a run: that of one right-hand side of `dop853` is 1. Beside right-hand sides, an implicit step solves as often,
   !> which takes as long, has a new Jacobian or factors now and then, and adds vectors: 2, and what does not grow with n.
   pure real(wp) function effort_of(method, dynamics, stats)
      character(len=*), intent(in) :: method
      type(dynamics_type), intent(in) :: dynamics
      type(solver_statistics), intent(in) :: stats
      effort_of = real(stats%n_rhs, wp)
      if (method == 'gauss') effort_of = effort_of_modes(dynamics, int(stats%n_jac)) + &
                                         (real(stats%n_rhs, wp)/real(lanes, wp)*effort_of_nodes(dynamics) + &
                                          effort_of_step(dynamics)*real(stats%n_steps, wp)) &
                                         *(1.0_wp + effort_of_coupling(dynamics)*stats%n_coupled/max(1.0_wp, real(stats%n_rhs, wp)))
      if (method == 'bdf') effort_of = 2.1_wp*real(stats%n_rhs, wp) + effort_of_jacobian(dynamics)*real(stats%n_jac, wp) + &
                                       real(stats%n_steps, wp)*(2.1_wp + 15.0_wp/(1.0_wp + 0.37_wp*dynamics%scene%n)) &
                                       /rhs_cost(dynamics)
   end function effort_of

   !> Time of a right-hand side over that of an ordinary chain. Locked hinges and third bending shapes have a recursion of their own
   !> (measured for chains of 4 to 64 rods that bend, all hinges held: 2.6 to 5.9).
   pure real(wp) function rhs_cost(dynamics)
      type(dynamics_type), intent(in) :: dynamics
      rhs_cost = merge(4.5_wp, 1.0_wp, joins(dynamics))
   end function rhs_cost

   !> Locked hinges or third bending shapes?
   pure logical function joins(dynamics)
      type(dynamics_type), intent(in) :: dynamics
      joins = has_slaves(dynamics%hinges) .or. dynamics%scene%n_bend == 3
   end function joins

   !> Effort of one iteration of a collocation step: eight right-hand sides, in lanes where they can, and the stiff modes, whose
   !> cost grows with the square of the number of unknowns (measured from 6 to 195 of them).
   pure real(wp) function effort_of_nodes(dynamics)
      type(dynamics_type), intent(in) :: dynamics
      effort_of_nodes = merge(2.0_wp, real(lanes, wp), suits_lanes(dynamics%scene, dynamics%hinges)) + &
                        (1.4_wp + 0.055_wp*dynamics%scene%n_dof)/rhs_cost(dynamics)
   end function effort_of_nodes

   !> Effort of a collocation step beside its iterations.
   pure real(wp) function effort_of_step(dynamics)
      type(dynamics_type), intent(in) :: dynamics
      effort_of_step = 4.0_wp/rhs_cost(dynamics)
   end function effort_of_step

   !> What coupled modes add to steps and iterations, times these: their equations, and more modes to be found more precisely
   !> (measured for 15, 51 and 195 unknowns: 0.3, 0.8 and 2).
   pure real(wp) function effort_of_coupling(dynamics)
      type(dynamics_type), intent(in) :: dynamics
      effort_of_coupling = 0.05_wp*real(dynamics%scene%n_dof, wp)**0.7_wp/rhs_cost(dynamics)
   end function effort_of_coupling

   !> Effort of a Jacobian with its factors: O(n), and dense where hinges are locked or rods have a third bending shape.
   pure real(wp) function effort_of_jacobian(dynamics)
      type(dynamics_type), intent(in) :: dynamics
      effort_of_jacobian = merge(8.0_wp*dynamics%scene%n, 3.0_wp, joins(dynamics))
   end function effort_of_jacobian

   !> Effort of a state between steps: a shorter step, whose first guess collocation knows, so that one or two iterations are
   !> enough; BDF has a polynomial.
   pure real(wp) function effort_of_output(method, dynamics)
      character(len=*), intent(in) :: method
      type(dynamics_type), intent(in) :: dynamics
      effort_of_output = 11.0_wp
      if (method == 'gauss') effort_of_output = 1.5_wp*effort_of_nodes(dynamics) + 0.3_wp*dynamics%scene%n_dof/rhs_cost(dynamics)
      if (method == 'bdf') effort_of_output = 1.5_wp/rhs_cost(dynamics)
   end function effort_of_output

   !> Effort of finding the modes so many times: the first has no guess.
   pure real(wp) function effort_of_modes(dynamics, times)
      type(dynamics_type), intent(in) :: dynamics
      integer, intent(in) :: times
      effort_of_modes = (0.4_wp*real(dynamics%scene%n_dof, wp)**2 + 6.0_wp*dynamics%scene%n_dof*times)/rhs_cost(dynamics)
   end function effort_of_modes

   !> Effort that each candidate would need from `t` to `t_end`, huge if it fails. An implicit method may creep at first,
   !> until vibrations it does not follow have died out. So its pace is that of the last round; that of order 2, which no
   !> vibration holds back for ever, goes on growing until they are calm.
   !>
   !> The implicit methods are tried with efforts that double from round to round. One that has nothing left to hope for drops out,
   !> and the trial ends when the best has a share of its run behind it. The pace of the even methods is known to a factor of 3
   !> beforehand; only where that leaves a doubt at the end they are tried, too (and collocation from the first where dampers calm
   !> the vibrations).
   subroutine try_methods(motion, y, t, options, t_first, t_end, rates, expected, quiet_after, out, most, forecast, effort, &
                          conclusive, monitor)
      type(motion_type), intent(in) :: motion       !! in the regime that begins or goes on at t
      real(wp), intent(in) :: y(:)                  !! state at t, without quadratures
      real(wp), intent(in) :: t                     !! [s]
      type(solver_options), intent(in) :: options
      real(wp), intent(in) :: t_first               !! end of the trial at the latest; no load switches before [s]
      real(wp), intent(in) :: t_end                 !! [s]
      type(fast_rates), intent(in) :: rates
      real(wp), intent(in) :: expected(n_even)      !! effort of the even methods; huge: of no use here
      real(wp), intent(in) :: quiet_after           !! time in which dampers will have calmed the fastest vibrations [s]
      logical, intent(in) :: out(size(candidates))  !! those of no use
      real(wp), intent(in) :: most                  !! effort that the trial may cost
      real(wp), intent(out) :: forecast(size(candidates))
      real(wp), intent(out) :: effort               !! spent on the trial
      logical, intent(out) :: conclusive            !! otherwise `most` ended it, and the forecasts are worth little
      class(monitor_type), target, intent(inout), optional :: monitor !! may end the trial, which then tells nothing
      type(trial_monitor), target :: listener
      type(runner) :: runners(size(candidates))
      real(wp) :: first, allowed, t_quiet
      integer :: i, best
      logical :: over, even_tried

      if (present(monitor)) listener%outer => monitor
      t_quiet = t + quiet_after
      runners%t_start = t
      runners%reached = t
      runners%failed = out
      forecast(:n_even) = expected
      forecast(n_even + 1:) = huge(1.0_wp)
      first = min(first_effort, first_share*minval(expected))
      allowed = first
      even_tried = .false.
      conclusive = .true.
      do
         call follow_collocation()
         do i = n_even + 1, size(candidates)
            if (outdone(i)) cycle
            call continue_runner(runners(i), candidates(i), motion, y, options, t_first, allowed, listener)
            forecast(i) = forecast_of(runners(i), t_end, candidates(i)%order == 2 .and. allowed > 3.0_wp*first)
            if (candidates(i)%order == 2 .and. grows_for_good(runners(i), rates)) &
               forecast(i) = min(forecast_of(runners(i), t_end, .false.), &
                                 settled(runners(i), rates) + quiet(runners(i), rates, options%rtol, t_end))
         end do
         best = n_even + minloc(forecast(n_even + 1:), dim=1)
         over = any(runners(n_even + 1:)%reached >= t_first) .or. runners(2)%reached >= t_end .or. &
                all([(outdone(i), i=n_even + 1, size(candidates))])
         if (over .or. is_spent()) then
            if (even_tried) exit
            call try_even()
            even_tried = .true.
            if (over .or. is_spent()) exit
         end if
         conclusive = after_next_round() <= most
         if (.not. conclusive) exit
         allowed = 2.0_wp*allowed
      end do
      effort = sum(runners%effort)
      do i = 1, size(runners)
         if (allocated(runners(i)%integrator)) call runners(i)%integrator%finalize()
         if (associated(runners(i)%motion)) deallocate (runners(i)%motion)
      end do

   contains

      !> Where dampers will calm the vibrations, collocation takes part in the rounds: it may need far less than expected. Its pace
      !> counts once they are calm; before, it is the least to be expected.
      subroutine follow_collocation()
         if (.not. expected(2) < huge(1.0_wp)) return
         if (.not. t_quiet < t_end .or. runners(2)%failed .or. effort_of_modes(motion%dynamics, 2) > allowed) return
         if (expected(2)/expectation_error > minval(forecast(n_even + 1:))) return
         call continue_runner(runners(2), candidates(2), motion, y, options, t_first, allowed, listener)
         forecast(2) = forecast_of(runners(2), t_end, .false.)
         if (runners(2)%reached - t < 3.0_wp*quiet_after .and. .not. runners(2)%failed) forecast(2) = min(forecast(2), expected(2))
      end subroutine follow_collocation

      !> Whether the trial has had its share of the run, or would have with another round. One that may still become unstable
      !> has to show its whole run.
      logical function is_spent()
         real(wp) :: budget, share
         budget = min(most_effort(motion%dynamics), even_share*minval(forecast(:n_even)))
         share = own_share
         if (candidates(best)%order == 2 .and. runners(best)%growth > 1.4_wp) share = growing_share
         if (forecast(best) < minval(forecast(:n_even)) .and. .not. order_is_risky(best)) budget = min(budget, share*forecast(best))
         is_spent = allowed >= budget .or. after_next_round() > most_share*minval(forecast(:n_even))
      end function is_spent

      !> Effort of the trial with another round, which doubles what implicit methods have spent.
      real(wp) function after_next_round()
         integer :: j
         after_next_round = sum(runners%effort) + allowed*count([(.not. outdone(j), j=n_even + 1, size(candidates))])
      end function after_next_round

      !> Sharpen the forecasts of the even methods that may be the best, if that is not settled and they are worth it.
      subroutine try_even()
         logical :: contends(size(candidates))
         real(wp) :: most, start, a_step
         integer :: j
         contends = forecast/expectation_error <= minval(forecast)
         if (count(contends) < 2) return
         do j = 1, n_even
            if (.not. contends(j)) cycle
            a_step = explicit_step
            start = 0.0_wp
            if (candidates(j)%method == 'gauss') then
               a_step = effort_of_step(motion%dynamics) + 2.0_wp*effort_of_nodes(motion%dynamics)
               start = effort_of_modes(motion%dynamics, 2)
            end if
            if (start > 2.0_wp*even_trial*expected(j)) cycle
            most = min(even_steps*a_step, even_trial*expected(j))
            call continue_runner(runners(j), candidates(j), motion, y, options, t_first, 0.4_wp*most, listener)
            call continue_runner(runners(j), candidates(j), motion, y, options, t_first, most, listener)
            forecast(j) = forecast_of(runners(j), t_end, .false.)
            ! Explicit steps bound by dampers cost what is known beforehand, once the first vibrations have died out.
            if (j == 1 .and. rates%decay > rates%frequency .and. .not. runners(j)%failed) &
               forecast(j) = min(forecast(j), expected(j))
         end do
         if (.not. t_quiet < t_end) return
         do j = 1, n_even ! what was seen of these two are vibrations that dampers will calm: the rest is not dearer than expected
            if (runners(j)%reached - t < 3.0_wp*quiet_after .and. .not. runners(j)%failed) &
               forecast(j) = min(forecast(j), expected(j))
         end do
      end subroutine try_even

      !> Whether an implicit method has failed, or has nothing left to hope for.
      logical function outdone(j)
         integer, intent(in) :: j
         real(wp) :: rival, hope
         integer :: k
         outdone = runners(j)%failed
         if (outdone .or. .not. runners(j)%effort > 0.0_wp) return
         outdone = order_is_risky(j) .and. phase_of(runners(j), rates) < bounded
         if (outdone .or. runners(j)%effort < 3.0_wp*first .or. runners(j)%growth > 1.2_wp) return
         rival = minval(forecast, mask=[(k /= j .and. k > n_even, k=1, size(candidates))])
         do k = 1, n_even
            rival = min(rival, merge(forecast(k), expectation_error*min(forecast(k), 1.0e30_wp), runners(k)%effort > 0.0_wp))
         end do
         hope = forecast(j)/clear_lead
         if (candidates(j)%order == 2) hope = min(hope, runners(j)%effort + dying_out(runners(j), rates))
         outdone = hope > rival
      end function outdone

      !> BDF above order 2 is unstable for vibrations without dampers where its steps are longer than some half a radian, which
      !> shows as late as they have grown from nothing.
      logical function order_is_risky(j)
         integer, intent(in) :: j
         order_is_risky = candidates(j)%order == 0 .and. rates%decay < damped*rates%frequency
      end function order_is_risky

   end subroutine try_methods

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
   !> h. The slower vibrations of rods last longer than the fastest: 15 to 46 times in chains of like rods. 0: unknown.
   real(wp) function dying_out(self, rates)
      type(runner), intent(in) :: self
      type(fast_rates), intent(in) :: rates
      real(wp), parameter :: slower = 15.0_wp
      dying_out = 0.0_wp
      if (rates%decay > damped*rates%frequency .or. .not. self%pace > 0.0_wp) return ! dampers are at work, too
      dying_out = slower*3.0_wp/max(1.0e-3_wp, min(0.4_wp, phase_of(self, rates)))**4*per_step(self)
   end function dying_out

   !> However long the run: what a candidate may spend in about a second, since a trial says nothing and cannot be stopped.
   pure real(wp) function most_effort(dynamics)
      type(dynamics_type), intent(in) :: dynamics
      most_effort = 2.5e6_wp/(1.0_wp + 0.37_wp*dynamics%scene%n) ! the last round may double it
   end function most_effort

   !> Effort to the end if the pace stays, or goes on growing as it did.
   pure real(wp) function forecast_of(self, t_end, grows)
      type(runner), intent(in) :: self
      real(wp), intent(in) :: t_end
      logical, intent(in) :: grows
      real(wp), parameter :: most_growth = 2.0_wp
      real(wp) :: reached, pace, growth

      forecast_of = huge(1.0_wp)
      if (self%failed .or. .not. self%pace > 0.0_wp) return
      forecast_of = self%effort
      reached = self%reached
      growth = merge(max(1.0_wp, min(most_growth, self%growth)), 1.0_wp, grows)
      pace = self%pace
      do while (reached < t_end)
         pace = pace*growth
         if (reached + forecast_of*pace >= t_end .or. growth < 1.2_wp) then
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
      grows_for_good = min(self%growth, self%growth_before) > 1.2_wp .and. self%growth*self%growth_before > 1.65_wp .and. &
                       self%ends(3) > 1.8_wp*self%ends(2)
      if (rates%strongly_damped()) grows_for_good = grows_for_good .and. self%growth > 1.4_wp
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

   !> Effort of BDF of order 2 on the rest of the run once vibrations are calm: some 11 steps for a radian of the chain's motion at
   !> rtol = 1e-3, measured, and h^3 ~ rtol.
   real(wp) function quiet(self, rates, rtol, t_end)
      type(runner), intent(in) :: self
      type(fast_rates), intent(in) :: rates
      real(wp), intent(in) :: rtol, t_end
      quiet = 11.0_wp*(1.0e-3_wp/rtol)**(1.0_wp/3.0_wp)*rates%slow*(t_end - self%reached)*per_step(self)
   end function quiet

   !> With a copy of the motion as it stands, but for the ledger and the record of events.
   subroutine start_runner(self, candidate, motion, y, options, t_end, listener)
      type(runner), intent(inout) :: self
      type(candidate_type), intent(in) :: candidate
      type(motion_type), intent(in) :: motion
      real(wp), intent(in) :: y(:)
      type(solver_options), intent(in) :: options
      real(wp), intent(in) :: t_end
      type(trial_monitor), target, intent(inout) :: listener
      type(solver_options) :: own
      type(error_type), allocatable :: error

      own = options
      own%order = candidate%order
      allocate (self%motion)
      self%motion = motion
      self%motion%ledger = .false.
      self%motion%n_states = motion%n_controlled
      self%motion%events%n_logged = 0
      call new_integrator(self%integrator, self%motion, trim(candidate%method), own, error)
      if (.not. allocated(error)) then
         if (associated(listener%outer)) call self%integrator%set_monitor(listener)
         call self%integrator%set_stop(t_end)
         call self%integrator%start(self%t_start, y, error)
      end if
      self%failed = allocated(error)
   end subroutine start_runner

   !> Go on until the effort is spent, or the end or a failure is met.
   subroutine continue_runner(self, candidate, motion, y, options, t_end, allowed, listener)
      type(runner), intent(inout) :: self
      type(candidate_type), intent(in) :: candidate
      type(motion_type), intent(in) :: motion
      type(solver_options), intent(in) :: options
      real(wp), intent(in) :: y(:), t_end, allowed
      type(trial_monitor), target, intent(inout) :: listener
      integer, parameter :: n_slices = 4 ! a slice too long costs no more than a quarter of what is allowed
      type(error_type), allocatable :: error
      type(solver_statistics) :: stats
      real(wp) :: state(size(y)), effort_before, reached_before, pace_before
      integer :: steps

      if (.not. associated(self%motion)) then
         call start_runner(self, candidate, motion, y, options, t_end, listener)
         if (.not. self%failed) self%begun = effort_of(candidate%method, motion%dynamics, self%integrator%statistics())
         self%effort = self%begun
      end if
      effort_before = self%effort
      reached_before = self%reached
      pace_before = self%pace
      do while (.not. self%failed .and. self%reached < t_end .and. self%effort - self%begun < 0.9_wp*allowed)
         stats = self%integrator%statistics()
         steps = max(5, int(min(allowed - (self%effort - self%begun), allowed/n_slices)/per_step(self)))
         self%integrator%options%max_steps = int(min(stats%n_steps + steps, int(huge(steps), i8)))
         call self%integrator%advance(t_end, state, self%reached, error)
         stats = self%integrator%statistics()
         self%effort = effort_of(candidate%method, motion%dynamics, stats)
         if (.not. allocated(error) .and. self%integrator%at_event) call pass_event(self, state, error)
         self%failed = allocated(error) .and. self%reached < t_end .and. stats%n_steps < self%integrator%options%max_steps
      end do
      if (.not. self%effort > effort_before) return
      self%ends = [self%ends(2), effort_before, self%effort]
      self%pace = (self%reached - reached_before)/(self%effort - effort_before)
      self%growth_before = self%growth
      if (pace_before > 0.0_wp) self%growth = self%pace/pace_before
   end subroutine continue_runner

   !> Go on behind an event.
   subroutine pass_event(self, y, error)
      type(runner), intent(inout) :: self
      real(wp), contiguous, intent(inout) :: y(:)
      type(error_type), allocatable, intent(out) :: error
      call self%motion%respond(self%reached, self%integrator%crossed, y, error)
      if (.not. allocated(error)) call self%integrator%start(self%reached, y, error)
   end subroutine pass_event

   !> Nothing.
   subroutine report(self, t, n_steps)
      class(trial_monitor), intent(inout) :: self
      real(wp), intent(in) :: t
      integer(i8), intent(in) :: n_steps
      associate (unused => self, unused_t => t, unused_n => n_steps); end associate
   end subroutine report

   function stop_requested(self) result(requested)
      class(trial_monitor), intent(in) :: self
      logical :: requested
      requested = self%outer%stop_requested()
   end function stop_requested

end module rodyn_method_trial
