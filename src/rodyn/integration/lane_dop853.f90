!> The method of `rodyn_dop853_integrator` in vector lanes: each lane has a case of its own, with its own time, step, error
!> control, stop time and outputs.
!>
!> One pass (`try`) tries one step in each lane. A lane whose step is refused tries a shorter one in the next pass, a lane
!> with an output inside its last step spends a pass on the shorter step to it, while the others go on. What a lane computes
!> never depends on the others: every update is masked, and no branch that one lane takes changes what another computes.
!>
!>     call integrator%enter(lane, options, t, y, t_stop, t_wanted)
!>     do
!>        call integrator%try()
!>        select case (integrator%event(lane))       ! at_nothing: go on
!>        case (at_output)                           ! `state` is that at t_wanted
!>           call integrator%proceed(lane, next_t_wanted)
!>        case (at_stop)                             ! `state` is that at t_stop
!>           call integrator%restart(lane, next_t_stop, t_wanted)
!>        case (at_failure)                          ! `state` is the last good one, `failure` the reason; the lane is idle
!>        end select
!>     end do
module rodyn_lane_dop853
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use rodyn_kinds, only: wp
   use rodyn_lanes, only: lanes
   use rodyn_aligned_store, only: aligned_store
   use rodyn_lane_ode, only: lane_system
   use rodyn_integrator, only: solver_options, solver_statistics
   use rodyn_pace, only: pace_type
   use rodyn_text, only: time_text
   use rodyn_dop853_step, only: inner_options, choose_end, trial_step, first_step_length, obstacle, safety, shrink, grow
   use rodyn_dop853_nystrom, only: n_stages, node
   use rodyn_lane_dop853_sums, only: failed_norm, turning_rates, stage_states, turning_stage, end_of_step, check_rates, &
      advance_states, advance_rates
   implicit none (type, external)
   private
   public :: lane_dop853, new_lane_dop853, suits_lane_dop853
   public :: at_nothing, at_output, at_stop, at_failure

   integer, parameter :: at_nothing = 0 !! the lane is idle or on its way
   integer, parameter :: at_output = 1  !! the wanted time is reached
   integer, parameter :: at_stop = 2    !! the stop time is reached, and no output is wanted before
   integer, parameter :: at_failure = 3 !! no way on

   integer, parameter :: idle = 0, stepping = 1, on_side_trip = 2 !! what a lane does in a pass

   !> Where a lane is, beside its states.
   type :: lane_course
      integer :: doing = idle
      real(wp) :: t = 0.0_wp         !! end of the last step [s]
      real(wp) :: t_lost = 0.0_wp    !! what rounding took from it [s]
      real(wp) :: t_base = 0.0_wp    !! where the pass starts: t, or the start of the last step on a side trip [s]
      real(wp) :: t_new = 0.0_wp     !! where the pass ends [s]
      real(wp) :: t_stop = 0.0_wp    !! never crossed [s]
      real(wp) :: t_wanted = huge(1.0_wp) !! next output, not after t_stop; huge: none [s]
      real(wp) :: h_next = 0.0_wp    !! step to try next [s]
      integer :: event = at_nothing
      type(pace_type) :: pace
      logical :: rejected = .false.  !! the last try was
      logical :: refused = .false.   !! because the right-hand side said so
      type(solver_options) :: options
      type(solver_statistics) :: counts
      character(len=:), allocatable :: failure
   end type lane_course

   type :: lane_dop853
      private
      class(lane_system), pointer :: system => null() !! not owned
      integer :: m = 0                           !! length of q and p
      integer :: n_turning = 0                   !! q(1:2) turn
      type(lane_course) :: course(lanes)
      real(wp), dimension(lanes) :: h = 0.0_wp, rtol = 1.0e-8_wp, atol = 1.0e-8_wp !! step of the pass [s]; tolerances
      type(aligned_store) :: store               !! of all arrays below
      real(wp), pointer, contiguous :: f(:, :, :) => null()    !! accelerations of the stages, the first there (lanes, m, 12)
      real(wp), pointer, contiguous :: turn(:, :, :) => null() !! rates of q(1:2) (lanes, 2, 12)
      ! Of (lanes, m):
      real(wp), dimension(:, :), pointer, contiguous :: q => null(), p => null() !! where the pass starts
      real(wp), dimension(:, :), pointer, contiguous :: q_lost => null(), p_lost => null() !! what rounding took from them so far
      real(wp), dimension(:, :), pointer, contiguous :: q_stage => null(), p_stage => null(), q_increment => null(), &
         p_increment => null(), q_new => null(), p_new => null(), f_new => null() !! workspace
      real(wp), dimension(:, :), pointer, contiguous :: q_after => null(), p_after => null(), f_after => null() !! end of the
      !! last step, of lanes on side trips
   contains
      procedure :: enter
      procedure :: restart
      procedure :: proceed
      procedure :: leave
      procedure :: try
      procedure :: event
      procedure :: time
      procedure :: state
      procedure :: failure
      procedure :: statistics
   end type lane_dop853

contains

   !> Can this method do what the options ask for?
   pure logical function suits_lane_dop853(options)
      type(solver_options), intent(in) :: options
      suits_lane_dop853 = (options%order == 0 .or. options%order == 8) .and. .not. options%fixed_step > 0.0_wp
   end function suits_lane_dop853

   !> Create an integrator for `system`, which must outlive it. All lanes are idle.
   subroutine new_lane_dop853(self, system)
      type(lane_dop853), target, intent(out) :: self
      class(lane_system), target, intent(inout) :: system

      self%system => system
      self%m = system%n_dof
      if (system%turning) self%n_turning = 2
      associate (m => self%m)
         call self%store%reserve((m + 2)*n_stages + 14*m)
         self%f => self%store%matrices(m, n_stages)
         self%turn => self%store%matrices(2, n_stages)
         self%q => self%store%matrix(m)
         self%p => self%store%matrix(m)
         self%q_lost => self%store%matrix(m)
         self%p_lost => self%store%matrix(m)
         self%q_stage => self%store%matrix(m)
         self%p_stage => self%store%matrix(m)
         self%q_increment => self%store%matrix(m)
         self%p_increment => self%store%matrix(m)
         self%q_new => self%store%matrix(m)
         self%p_new => self%store%matrix(m)
         self%f_new => self%store%matrix(m)
         self%q_after => self%store%matrix(m)
         self%p_after => self%store%matrix(m)
         self%f_after => self%store%matrix(m)
      end associate
   end subroutine new_lane_dop853

   !> Put a case into an idle lane, at its start.
   subroutine enter(self, lane, options, t, y, t_stop, t_wanted)
      class(lane_dop853), intent(inout) :: self
      integer, intent(in) :: lane
      type(solver_options), intent(in) :: options !! rtol, atol, max_step and max_steps are used
      real(wp), intent(in) :: t        !! [s]
      real(wp), intent(in) :: y(:)     !! (2 m)
      real(wp), intent(in) :: t_stop   !! end of the first interval [s]
      real(wp), intent(in) :: t_wanted !! next output, after t and not after t_stop; huge: none [s]

      call clear(self%course(lane))
      associate (course => self%course(lane))
         course%options = inner_options(options)
         course%counts%last_order = 8
         course%t = t
         self%rtol(lane) = course%options%rtol
         self%atol(lane) = course%options%atol
         self%q_lost(lane, :) = 0.0_wp
         self%p_lost(lane, :) = 0.0_wp
         self%q(lane, :) = 0.0_wp
         self%p(lane, :) = 0.0_wp
         if (all(abs(y) <= huge(y))) then
            self%q(lane, :) = y(:self%m)
            self%p(lane, :) = y(self%m + 1:)
            call self%restart(lane, t_stop, t_wanted)
         else
            call fail(self, lane, 'start at t = '//time_text(t)//' s: the initial state is not finite')
         end if
      end associate
   end subroutine enter

   subroutine clear(course)
      type(lane_course), intent(out) :: course
      course%failure = ''
   end subroutine clear

   !> Go on from the present state with other equations, up to another stop time.
   subroutine restart(self, lane, t_stop, t_wanted)
      class(lane_dop853), intent(inout) :: self
      integer, intent(in) :: lane
      real(wp), intent(in) :: t_stop, t_wanted !! [s]
      logical :: ok

      associate (course => self%course(lane))
         course%event = at_nothing
         course%doing = stepping
         course%t_base = course%t
         course%t_lost = 0.0_wp
         course%t_stop = t_stop
         course%t_wanted = t_wanted
         course%rejected = .false.
         call course%pace%begin(course%counts%n_steps, course%t)
         course%counts%n_starts = course%counts%n_starts + 1
         call evaluate_one(self, lane, course%t, self%q, self%p, ok)
         if (.not. ok) then
            call cannot_step(self, lane)
            return
         end if
         self%f(lane, :, 1) = self%f_new(lane, :)
         call first_step(self, lane)
      end associate
   end subroutine restart

   !> After an output: the next one that is wanted.
   subroutine proceed(self, lane, t_wanted)
      class(lane_dop853), intent(inout) :: self
      integer, intent(in) :: lane
      real(wp), intent(in) :: t_wanted !! not after t_stop; huge: none in this interval [s]
      self%course(lane)%t_wanted = t_wanted
      call choose_event(self, lane)
   end subroutine proceed

   !> Make a lane idle.
   subroutine leave(self, lane)
      class(lane_dop853), intent(inout) :: self
      integer, intent(in) :: lane
      call clear(self%course(lane))
   end subroutine leave

   !> What has to be done about a lane.
   elemental integer function event(self, lane)
      class(lane_dop853), intent(in) :: self
      integer, intent(in) :: lane
      event = self%course(lane)%event
   end function event

   !> Time of `state` [s].
   elemental real(wp) function time(self, lane)
      class(lane_dop853), intent(in) :: self
      integer, intent(in) :: lane
      associate (course => self%course(lane))
         time = course%t
         if (course%doing == on_side_trip .and. course%event == at_output) time = course%t_wanted
      end associate
   end function time

   !> State of a lane: at the wanted time if that is the event, else at the end of the last step.
   subroutine state(self, lane, y)
      class(lane_dop853), intent(in) :: self
      integer, intent(in) :: lane
      real(wp), intent(out) :: y(:) !! (2 m)
      associate (course => self%course(lane))
         if (course%doing /= on_side_trip) then
            y = [self%q(lane, :), self%p(lane, :)]
         else if (course%event == at_output) then
            y = [self%q(lane, :) + self%q_increment(lane, :), self%p(lane, :) + self%p_increment(lane, :)]
         else
            y = [self%q_after(lane, :), self%p_after(lane, :)]
         end if
      end associate
   end subroutine state

   !> Why a lane failed.
   function failure(self, lane) result(text)
      class(lane_dop853), intent(in) :: self
      integer, intent(in) :: lane
      character(len=:), allocatable :: text
      text = self%course(lane)%failure
   end function failure

   !> Counts of the case in a lane.
   pure function statistics(self, lane) result(stats)
      class(lane_dop853), intent(in) :: self
      integer, intent(in) :: lane
      type(solver_statistics) :: stats
      stats = self%course(lane)%counts
   end function statistics

   !> One step in every lane that is not idle.
   subroutine try(self)
      class(lane_dop853), intent(inout) :: self
      real(wp) :: t(lanes), norm(lanes), commit(lanes), move(lanes)
      logical :: ok(lanes), good(lanes)
      integer :: lane, s

      do lane = 1, lanes
         call begin_pass(self, lane)
      end do
      good = .true.
      if (self%n_turning > 0) call turning_rates(self%m, self%q, self%p, self%turn(:, :, 1))
      do s = 2, n_stages
         call stage_states(s, self%m, self%h, self%q, self%p, self%f, self%q_stage, self%p_stage)
         if (self%n_turning > 0) call turning_stage(s, self%m, self%h, self%q, self%turn, self%q_stage)
         t = self%course%t_base + node(s)*self%h
         call self%system%accelerations(t, self%q_stage, self%p_stage, self%f(:, :, s), ok)
         if (self%n_turning > 0) call turning_rates(self%m, self%q_stage, self%p_stage, self%turn(:, :, s))
         good = good .and. ok
      end do
      call end_of_step(self%m, self%n_turning, self%h, self%q, self%p, self%f, self%turn, self%q_lost, self%p_lost, self%rtol, &
                       self%atol, self%q_increment, self%p_increment, self%q_new, self%p_new, norm)
      t = self%course%t_new
      call self%system%accelerations(t, self%q_new, self%p_new, self%f_new, ok)
      call check_rates(self%m, self%f_new, ok)
      do lane = 1, lanes
         call judge(self, lane, good(lane), ok(lane), norm(lane), commit(lane), move(lane))
      end do
      call advance_states(self%m, commit, move, self%q_new, self%q_increment, self%q_lost, self%q)
      call advance_states(self%m, commit, move, self%p_new, self%p_increment, self%p_lost, self%p)
      call advance_rates(self%m, move, self%f_new, self%f(:, :, 1))
      do lane = 1, lanes
         if (self%course(lane)%doing == on_side_trip .and. commit(lane) > 0.5_wp) call keep_end(self, lane)
      end do
   end subroutine try

   !> The step to try and the time it ends at.
   subroutine begin_pass(self, lane)
      class(lane_dop853), intent(inout) :: self
      integer, intent(in) :: lane
      character(len=:), allocatable :: refusal
      real(wp) :: h

      self%h(lane) = 0.0_wp
      associate (course => self%course(lane))
         if (course%doing == idle .or. course%event /= at_nothing) return
         if (course%doing == on_side_trip) then
            self%h(lane) = course%t_wanted - course%t_base
            return
         end if
         call course%pace%judge(course%counts%n_steps, course%options%max_steps, course%t, course%t_stop, refusal)
         if (allocated(refusal)) then
            call fail(self, lane, refusal)
            return
         end if
         call choose_end(course%t, course%t_lost, course%t_stop, course%h_next, h, course%t_new)
         if (h <= 8.0_wp*epsilon(h)*abs(course%t)) then
            if (h <= 4.0_wp*spacing(course%t)) then
               call cannot_step(self, lane)
               return
            end if
         end if
         self%h(lane) = h
      end associate
   end subroutine begin_pass

   !> Accept or refuse what a lane has tried, and choose its next step.
   subroutine judge(self, lane, good, new_good, norm, commit, move)
      class(lane_dop853), intent(inout) :: self
      integer, intent(in) :: lane
      logical, intent(in) :: good     !! all stages could be evaluated
      logical, intent(in) :: new_good !! and the end of the step
      real(wp), intent(in) :: norm    !! of the error, in tolerances
      real(wp), intent(out) :: commit !! 1: the step counts
      real(wp), intent(out) :: move   !! 1: the next pass starts at its end
      real(wp) :: factor, h
      logical :: accepted

      commit = 0.0_wp
      move = 0.0_wp
      h = self%h(lane)
      associate (course => self%course(lane))
         if (course%doing == idle .or. course%event /= at_nothing) return
         course%counts%n_rhs = course%counts%n_rhs + n_stages - 1
         if (course%doing == on_side_trip) then
            course%event = at_output
            if (.not. good) call fail(self, lane, 'dop853: output at t = '//time_text(course%t_wanted)// &
                                      ' s: the right-hand side cannot be evaluated')
            return
         end if
         accepted = good .and. norm <= 1.0_wp
         if (accepted) course%counts%n_rhs = course%counts%n_rhs + 1
         course%refused = .not. good .or. (accepted .and. .not. new_good)
         accepted = accepted .and. new_good
         factor = shrink
         if (good .and. norm < failed_norm) factor = max(shrink, safety/sqrt(sqrt(sqrt(max(norm, tiny(norm))))))
         if (.not. accepted) then
            if (norm <= 1.0_wp) factor = shrink ! the end of the step could not be evaluated
            course%counts%n_error_test_failures = course%counts%n_error_test_failures + 1
            course%rejected = .true.
            course%h_next = h*factor
            return
         end if
         commit = 1.0_wp
         course%counts%n_steps = course%counts%n_steps + 1
         course%counts%last_step = h
         factor = min(grow, factor)
         if (course%rejected) factor = min(1.0_wp, factor)
         course%rejected = .false.
         ! A step cut short by the stop time says little about the next one.
         if (course%t_new < course%t_stop .or. h*factor > course%h_next) course%h_next = h*factor
         if (course%options%max_step > 0.0_wp) course%h_next = min(course%h_next, course%options%max_step)
         course%t_lost = (course%t_new - course%t) - (h - course%t_lost)
         if (course%t_new >= course%t_stop) course%t_lost = 0.0_wp
         course%t = course%t_new
         if (course%t_wanted < course%t) then
            course%doing = on_side_trip
            return
         end if
         move = 1.0_wp
         course%t_base = course%t
         if (course%t >= course%t_stop) course%event = at_stop
         if (course%t >= course%t_wanted) course%event = at_output
      end associate
   end subroutine judge

   !> After an event: the next side trip, the end of side trips, or the next event at once.
   subroutine choose_event(self, lane)
      class(lane_dop853), intent(inout) :: self
      integer, intent(in) :: lane

      associate (course => self%course(lane))
         course%event = at_nothing
         if (course%t_wanted < course%t) return
         if (course%doing == on_side_trip) then
            self%q(lane, :) = self%q_after(lane, :)
            self%p(lane, :) = self%p_after(lane, :)
            self%f(lane, :, 1) = self%f_after(lane, :)
            course%doing = stepping
            course%t_base = course%t
         end if
         if (course%t >= course%t_stop) course%event = at_stop
         if (course%t >= course%t_wanted) course%event = at_output
      end associate
   end subroutine choose_event

   !> Keep the end of a step before the side trips inside it.
   subroutine keep_end(self, lane)
      class(lane_dop853), intent(inout) :: self
      integer, intent(in) :: lane
      self%q_after(lane, :) = self%q_new(lane, :)
      self%p_after(lane, :) = self%p_new(lane, :)
      self%f_after(lane, :) = self%f_new(lane, :)
   end subroutine keep_end

   !> A lane cannot go on. Its state is the last good one.
   subroutine fail(self, lane, text)
      class(lane_dop853), intent(inout) :: self
      integer, intent(in) :: lane
      character(len=*), intent(in) :: text

      associate (course => self%course(lane))
         if (course%doing == on_side_trip) then
            self%q(lane, :) = self%q_after(lane, :)
            self%p(lane, :) = self%p_after(lane, :)
         end if
         course%doing = idle
         course%event = at_failure
         course%failure = text
      end associate
      self%f(lane, :, :) = 0.0_wp ! what follows in this lane is thrown away, but should be harmless
      self%h(lane) = 0.0_wp
   end subroutine fail

   subroutine cannot_step(self, lane)
      class(lane_dop853), intent(inout) :: self
      integer, intent(in) :: lane
      associate (course => self%course(lane))
         call fail(self, lane, 'dop853 at t = '//time_text(course%t)//' s: '//obstacle(course%refused))
      end associate
   end subroutine cannot_step

   !> Accelerations of one lane, in `f_new`. The others are computed, too, and not used.
   subroutine evaluate_one(self, lane, t, q, p, ok)
      class(lane_dop853), intent(inout) :: self
      integer, intent(in) :: lane
      real(wp), intent(in) :: t
      real(wp), contiguous, intent(in) :: q(:, :), p(:, :)
      logical, intent(out) :: ok
      real(wp) :: times(lanes)
      logical :: all_ok(lanes)

      times = self%course%t_base
      times(lane) = t
      call self%system%accelerations(times, q, p, self%f_new, all_ok)
      self%course(lane)%counts%n_rhs = self%course(lane)%counts%n_rhs + 1
      ok = all_ok(lane)
      self%course(lane)%refused = .not. ok
      if (ok) ok = all(ieee_is_finite(self%f_new(lane, :)))
   end subroutine evaluate_one

   !> Length of the first step (Hairer, Norsett & Wanner, sec. II.4).
   subroutine first_step(self, lane)
      class(lane_dop853), intent(inout) :: self
      integer, intent(in) :: lane
      real(wp) :: d0, d1, d2, h0, root
      real(wp), dimension(2*self%m) :: y, f, f_ahead, scale
      logical :: ok

      root = sqrt(real(2*self%m, wp))
      associate (m => self%m, course => self%course(lane), options => self%course(lane)%options)
         if (course%t_stop <= course%t) return
         call all_rates(self, self%q, self%p, self%f(:, :, 1), lane, f)
         y = [self%q(lane, :), self%p(lane, :)]
         scale = options%atol + options%rtol*abs(y)
         d0 = norm2(y/scale)/root
         d1 = norm2(f/scale)/root
         h0 = trial_step(d0, d1, course%t_stop - course%t)
         self%q_stage = self%q
         self%p_stage = self%p
         self%q_stage(lane, :) = y(:m) + h0*f(:m)
         self%p_stage(lane, :) = y(m + 1:) + h0*f(m + 1:)
         call evaluate_one(self, lane, course%t + h0, self%q_stage, self%p_stage, ok)
         if (ok) then
            call all_rates(self, self%q_stage, self%p_stage, self%f_new, lane, f_ahead)
            d2 = norm2((f_ahead - f)/scale)/root/h0
            course%h_next = first_step_length(h0, d1, d2, course%t_stop - course%t)
         else
            course%h_next = 1.0e-3_wp*h0
         end if
         if (options%max_step > 0.0_wp) course%h_next = min(course%h_next, options%max_step)
         if (.not. course%h_next > 0.0_wp) &
            call fail(self, lane, 'dop853 at t = '//time_text(course%t)//' s: no first step found')
      end associate
   end subroutine first_step

   !> (q', p') of one lane.
   pure subroutine all_rates(self, q, p, f, lane, rates)
      class(lane_dop853), intent(in) :: self
      real(wp), dimension(lanes, self%m), intent(in) :: q, p, f
      integer, intent(in) :: lane
      real(wp), intent(out) :: rates(2*self%m)

      rates = [p(lane, :), f(lane, :)]
      if (self%n_turning == 0) return
      rates(1) = rates(1) + p(lane, 3)*q(lane, 2)
      rates(2) = rates(2) - p(lane, 3)*q(lane, 1)
   end subroutine all_rates

end module rodyn_lane_dop853
