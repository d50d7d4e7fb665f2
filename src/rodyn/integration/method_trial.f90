!> What methods cost on a scene, found by trying: the beginning of a run by each, with equal and growing effort.
!>
!> Effort is counted, not timed, so that the same scene gets the same method everywhere. The unit is one right-hand side;
!> what else a step costs was measured (docs/performance.md, `bench_newton`).
module rodyn_method_trial
   use rodyn_kinds, only: wp, i8
   use rodyn_errors, only: error_type
   use rodyn_lanes, only: lanes
   use rodyn_scene, only: scene_type
   use rodyn_motion, only: motion_type, new_motion
   use rodyn_integrator, only: integrator_type, monitor_type, solver_options, solver_statistics
   use rodyn_integrators, only: new_integrator
   implicit none (type, external)
   private
   public :: candidate_type, candidates, n_even, effort_of, effort_of_nodes, try_methods

   !> A method, with the highest order if it is not the usual one.
   type :: candidate_type
      character(len=6) :: method = ''
      integer :: order = 0
   end type candidate_type

   !> Explicit; collocation; implicit; implicit and stable for every vibration, which BDF is up to order 2.
   type(candidate_type), parameter :: candidates(4) = [candidate_type('dop853', 0), candidate_type('gauss', 0), &
      candidate_type('bdf', 0), candidate_type('bdf', 2)]
   integer, parameter :: n_even = 2 !! the first of them follow all vibrations, at a rather even pace; the very first is explicit

   real(wp), parameter :: first_effort = 400.0_wp     !! of a candidate, doubled from round to round
   real(wp), parameter :: even_effort = 3000.0_wp     !! are enough to know the pace of methods that follow all vibrations
   real(wp), parameter :: clear_lead = 4.0_wp         !! of an implicit method, with which the trial ends
   real(wp), parameter :: own_share = 0.2_wp         !! of its own run that the best candidate is tried on
   real(wp), parameter :: sure_lead = 12.0_wp         !! of one over expectations, which may be wrong by 3

   !> Passes on that someone wants an end, and no more: what a trial reports is not the run.
   type, extends(monitor_type) :: trial_monitor
      class(monitor_type), pointer :: outer => null()
   contains
      procedure :: report
      procedure :: stop_requested
   end type trial_monitor

   !> A run that can be continued; started when first continued.
   type :: runner
      type(motion_type), pointer :: motion => null()
      class(integrator_type), allocatable :: integrator
      real(wp) :: effort = 0.0_wp  !! spent
      real(wp) :: reached = 0.0_wp !! [s]
      real(wp) :: pace = 0.0_wp    !! simulated time for an effort of 1 in the last round [s]
      real(wp) :: growth(2) = 1.0_wp !! of the pace, in the last round and the one before
      logical :: failed = .false.
   end type runner

contains

   !> Effort of a run: that of one right-hand side is 1. Beside them, an implicit step solves as often, which takes as
   !> long, has a new Jacobian or factors now and then, and adds vectors: 2, and what does not grow with n.
   pure real(wp) function effort_of(method, scene, stats)
      character(len=*), intent(in) :: method
      type(scene_type), intent(in) :: scene
      type(solver_statistics), intent(in) :: stats
      effort_of = real(stats%n_rhs, wp)
      if (method == 'gauss') effort_of = real(stats%n_rhs, wp)/real(lanes, wp)*effort_of_nodes(scene) + &
                                         10.0_wp*scene%n_dof*real(stats%n_jac, wp)
      if (method == 'bdf') effort_of = 2.2_wp*real(stats%n_rhs, wp) + 3.0_wp*real(stats%n_jac, wp) + &
                                       real(stats%n_steps, wp)*(2.2_wp + 20.0_wp/(1.0_wp + 0.37_wp*scene%n))
   end function effort_of

   !> Effort of one iteration of a collocation step: eight right-hand sides in lanes, and the stiff modes, whose cost grows
   !> with the square of the number of unknowns (measured from 7 to 195 of them).
   pure real(wp) function effort_of_nodes(scene)
      type(scene_type), intent(in) :: scene
      effort_of_nodes = 4.5_wp + 0.18_wp*scene%n_dof
   end function effort_of_nodes

   !> Effort that each candidate would need from 0 to `t_end`, huge if it fails. An implicit method may creep at first,
   !> until vibrations it does not follow have died out. So its pace is that of the last round; that of order 2, which no
   !> vibration holds back, may go on growing.
   !>
   !> The pace of the even methods is known well enough beforehand where implicit ones leave them far behind. Only where
   !> they do not, the even ones are tried, with no more effort than the best implicit method needs for the whole run.
   subroutine try_methods(scene, y, options, t_first, t_end, expected, share, forecast, effort, monitor)
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: y(:)                  !! state at t = 0, without quadratures
      type(solver_options), intent(in) :: options
      real(wp), intent(in) :: t_first               !! end of the trial at the latest; no load switches before [s]
      real(wp), intent(in) :: t_end                 !! [s]
      real(wp), intent(in) :: expected(n_even)      !! effort of the even methods; huge: of no use here
      real(wp), intent(in) :: share                 !! of the effort of the best even method, for one candidate at most, but
                                                    !! not more than `most_effort`
      real(wp), intent(out) :: forecast(size(candidates))
      real(wp), intent(out) :: effort               !! spent on the trial
      class(monitor_type), target, intent(inout), optional :: monitor !! may end the trial, which then tells nothing
      type(trial_monitor), target :: listener
      type(runner) :: runners(size(candidates))
      real(wp) :: allowed, budget
      integer :: i, best

      if (present(monitor)) listener%outer => monitor
      forecast(:n_even) = expected
      allowed = first_effort
      do
         do i = n_even + 1, size(candidates)
            if (hopeless(runners(i), candidates(i), t_end/forecast(1))) cycle
            call continue_runner(runners(i), candidates(i), scene, y, options, t_first, allowed, listener)
            forecast(i) = forecast_of(runners(i), t_end, candidates(i)%order == 2 .and. allowed > 3.0_wp*first_effort)
         end do
         best = n_even + minloc(forecast(n_even + 1:), dim=1)
         if (sure_lead*forecast(best) > minval(expected) .and. &
             (allowed > 3.0_wp*first_effort .or. any(runners%reached >= t_first))) call try_even()
         if (any(runners%reached >= t_first) .or. all(runners(n_even + 1:)%failed)) exit
         budget = share*minval(forecast(:n_even))
         if (forecast(best) < minval(forecast(:n_even))) budget = min(budget, own_share*forecast(best))
         budget = min(budget, most_effort(scene))
         if (1.4_wp*allowed >= budget) exit ! a short round would tell nothing
         if (allowed > 3.0_wp*first_effort .and. clear_lead*forecast(best) < &
             minval(forecast, mask=[(i /= best, i=1, size(candidates))])) exit
         allowed = min(2.0_wp*allowed, budget)
      end do
      effort = sum(runners%effort)
      do i = 1, size(runners)
         if (allocated(runners(i)%integrator)) call runners(i)%integrator%finalize()
         if (associated(runners(i)%motion)) deallocate (runners(i)%motion)
      end do

   contains

      subroutine try_even()
         integer :: j
         do j = 1, n_even
            if (expected(j) > sure_lead*minval(expected) .or. runners(j)%effort > max(even_effort, 0.25_wp*allowed)) cycle
            call continue_runner(runners(j), candidates(j), scene, y, options, t_first, &
                                 min(allowed, max(first_effort, forecast(best))), listener)
            forecast(j) = forecast_of(runners(j), t_end, .false.)
         end do
      end subroutine try_even

   end subroutine try_methods

   !> However long the run: what a candidate may spend in about a second, since a trial says nothing and cannot be stopped.
   pure real(wp) function most_effort(scene)
      type(scene_type), intent(in) :: scene
      most_effort = 5.0e6_wp/(1.0_wp + 0.37_wp*scene%n)
   end function most_effort

   !> An implicit method that vibrations hold back goes on at its even pace.
   pure logical function hopeless(self, candidate, explicit_pace)
      type(runner), intent(in) :: self
      type(candidate_type), intent(in) :: candidate
      real(wp), intent(in) :: explicit_pace
      hopeless = candidate%method == 'bdf' .and. candidate%order == 0 .and. self%effort > 2.0_wp*even_effort .and. &
                 2.0_wp*self%pace < explicit_pace .and. self%growth(1) < 1.1_wp
   end function hopeless

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
      growth = merge(max(1.0_wp, min(most_growth, minval(self%growth))), 1.0_wp, grows)
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

   subroutine start_runner(self, candidate, scene, y, options, t_end, listener)
      type(runner), intent(inout) :: self
      type(candidate_type), intent(in) :: candidate
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: y(:)
      type(solver_options), intent(in) :: options
      real(wp), intent(in) :: t_end
      type(trial_monitor), target, intent(inout) :: listener
      type(solver_options) :: own
      type(error_type), allocatable :: error

      own = options
      own%order = candidate%order
      if (candidate%method == 'bdf') own%fixed_step = 0.0_wp
      allocate (self%motion)
      call new_motion(self%motion, scene, .false., error)
      if (.not. allocated(error)) then
         call self%motion%dynamics%set_regime(0.0_wp, t_end)
         call new_integrator(self%integrator, self%motion, trim(candidate%method), own, error)
      end if
      if (.not. allocated(error)) then
         if (associated(listener%outer)) call self%integrator%set_monitor(listener)
         call self%integrator%set_stop(t_end)
         call self%integrator%start(0.0_wp, y, error)
      end if
      self%failed = allocated(error)
   end subroutine start_runner

   !> Go on until the effort is spent, or the end or a failure is met.
   subroutine continue_runner(self, candidate, scene, y, options, t_end, allowed, listener)
      type(runner), intent(inout) :: self
      type(candidate_type), intent(in) :: candidate
      type(scene_type), intent(in) :: scene
      type(solver_options), intent(in) :: options
      real(wp), intent(in) :: y(:), t_end, allowed
      type(trial_monitor), target, intent(inout) :: listener
      integer, parameter :: n_slices = 4 ! a slice too long costs no more than a quarter of what is allowed
      type(error_type), allocatable :: error
      type(solver_statistics) :: stats
      real(wp) :: state(size(y)), per_step, effort_before, reached_before, pace_before
      integer :: steps

      if (.not. associated(self%motion)) call start_runner(self, candidate, scene, y, options, t_end, listener)
      effort_before = self%effort
      reached_before = self%reached
      pace_before = self%pace
      do while (.not. self%failed .and. self%reached < t_end .and. self%effort < 0.9_wp*allowed)
         stats = self%integrator%statistics()
         per_step = 14.0_wp
         if (stats%n_steps > 0) per_step = self%effort/real(stats%n_steps, wp)
         steps = max(5, int(min((allowed - self%effort)/per_step, allowed/(n_slices*per_step))))
         self%integrator%options%max_steps = int(stats%n_steps) + steps
         call self%integrator%advance(t_end, state, self%reached, error)
         stats = self%integrator%statistics()
         self%effort = effort_of(candidate%method, scene, stats)
         self%failed = allocated(error) .and. self%reached < t_end .and. stats%n_steps < self%integrator%options%max_steps
      end do
      if (.not. self%effort > effort_before) return
      self%pace = (self%reached - reached_before)/(self%effort - effort_before)
      if (pace_before > 0.0_wp) self%growth = [self%pace/pace_before, self%growth(1)]
   end subroutine continue_runner

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
