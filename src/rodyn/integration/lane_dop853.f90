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
   use rodyn_kinds, only: wp, i8
   use rodyn_errors, only: error_type, raise
   use rodyn_lanes, only: lanes
   use rodyn_lane_ode, only: lane_system
   use rodyn_integrator, only: solver_options, solver_statistics, time_text, judged_steps, is_hopeless, hopeless_text
   use rodyn_text, only: to_text
   use rodyn_dop853_nystrom, only: n_stages, node, a, a2, b, b2, e5, e5_2, e3, e3_2
   implicit none (type, external)
   private
   public :: lane_dop853, new_lane_dop853, suits_lane_dop853
   public :: at_nothing, at_output, at_stop, at_failure

   integer, parameter :: at_nothing = 0 !! the lane is idle or on its way
   integer, parameter :: at_output = 1  !! the wanted time is reached
   integer, parameter :: at_stop = 2    !! the stop time is reached, and no output is wanted before
   integer, parameter :: at_failure = 3 !! no way on

   integer, parameter :: idle = 0, stepping = 1, on_side_trip = 2 !! what a lane does in a pass
   real(wp), parameter :: safety = 0.9_wp, shrink = 1.0_wp/3.0_wp, grow = 6.0_wp ! Hairer's
   real(wp), parameter :: hopeless = 1.0e300_wp !! error norm of a step that came to nothing

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
      integer(i8) :: n_judged = 0    !! steps and time at the last look at the pace
      real(wp) :: t_judged = 0.0_wp  !! [s]
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
      real(wp), dimension(:, :), allocatable :: q, p !! where the pass starts (lanes, m)
      real(wp), allocatable :: f(:, :, :)        !! accelerations of the stages, the first there (lanes, m, 12)
      real(wp), allocatable :: turn(:, :, :)     !! rates of q(1:2) (lanes, 2, 12)
      real(wp), dimension(:, :), allocatable :: q_lost, p_lost !! what rounding took from q and p so far (lanes, m)
      real(wp), dimension(:, :), allocatable :: q_stage, p_stage, q_increment, p_increment, q_new, p_new, f_new !! workspace
      real(wp), dimension(:, :), allocatable :: q_after, p_after, f_after !! end of the last step, of lanes on side trips
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
      type(lane_dop853), intent(out) :: self
      class(lane_system), target, intent(inout) :: system

      self%system => system
      self%m = system%n_dof
      if (system%turning) self%n_turning = 2
      associate (m => self%m)
         allocate (self%f(lanes, m, n_stages), self%turn(lanes, 2, n_stages), source=0.0_wp)
         allocate (self%q(lanes, m), self%p(lanes, m), self%q_lost(lanes, m), self%p_lost(lanes, m), self%q_stage(lanes, m), &
                   self%p_stage(lanes, m), self%q_increment(lanes, m), self%p_increment(lanes, m), self%q_new(lanes, m), &
                   self%p_new(lanes, m), self%f_new(lanes, m), self%q_after(lanes, m), self%p_after(lanes, m), &
                   self%f_after(lanes, m), source=0.0_wp)
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
         course%options = options
         course%counts%last_order = 8
         course%t = t
         self%rtol(lane) = options%rtol
         self%atol(lane) = options%atol
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
         course%n_judged = course%counts%n_steps
         course%t_judged = course%t
         course%counts%n_starts = course%counts%n_starts + 1
         call evaluate_one(self, lane, course%t, self%q, self%p, ok)
         if (.not. ok) then
            call fail(self, lane, 'dop853 at t = '//time_text(course%t)//' s: '//trouble(course))
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
      call settle(self, lane)
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
         call choose_end(self, lane)
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

   !> The step to try and the time it ends at: on the stop time if that is near.
   subroutine choose_end(self, lane)
      class(lane_dop853), intent(inout) :: self
      integer, intent(in) :: lane
      real(wp) :: h

      self%h(lane) = 0.0_wp
      associate (course => self%course(lane))
         if (course%doing == idle .or. course%event /= at_nothing) return
         if (course%doing == on_side_trip) then
            self%h(lane) = course%t_wanted - course%t_base
            return
         end if
         if (course%counts%n_steps >= course%options%max_steps) then
            call fail(self, lane, 'max_steps = '//to_text(course%options%max_steps)//' reached at t = '// &
                      time_text(course%t)//' s')
            return
         end if
         if (course%counts%n_steps >= course%n_judged + judged_steps) then
            if (is_hopeless(course%t - course%t_judged, course%t_stop - course%t)) then
               call fail(self, lane, hopeless_text(course%t, course%t - course%t_judged))
               return
            end if
            course%n_judged = course%counts%n_steps
            course%t_judged = course%t
         end if
         h = course%h_next
         course%t_new = course%t + (h - course%t_lost)
         if (course%t_new < course%t_stop) then
            ! Two even steps rather than one and a sliver.
            if (course%t + 1.8_wp*h > course%t_stop) h = 0.5_wp*(course%t_stop - course%t)
            if (h < course%h_next) course%t_new = course%t + (h - course%t_lost)
         else
            course%t_new = course%t_stop
            h = course%t_stop - course%t
         end if
         if (h <= 8.0_wp*epsilon(h)*abs(course%t)) then
            if (h <= 4.0_wp*spacing(course%t)) then
               call fail(self, lane, 'dop853 at t = '//time_text(course%t)//' s: '//trouble(course))
               return
            end if
         end if
         self%h(lane) = h
      end associate
   end subroutine choose_end

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
         if (good .and. norm < hopeless) factor = max(shrink, safety/sqrt(sqrt(sqrt(max(norm, tiny(norm))))))
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
   subroutine settle(self, lane)
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
   end subroutine settle

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

   !> What stands in the way of a step.
   pure function trouble(course) result(text)
      type(lane_course), intent(in) :: course
      character(len=:), allocatable :: text
      if (course%refused) then
         text = 'the right-hand side could not be evaluated (mass matrix not positive definite, or not finite)'
      else
         text = 'the right-hand side was not finite, or no step is small enough'
      end if
   end function trouble

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
      real(wp) :: d0, d1, d2, h0, h1, root
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
         h0 = 1.0e-6_wp
         if (min(d0, d1) > 1.0e-5_wp) h0 = 0.01_wp*d0/d1
         h0 = min(h0, course%t_stop - course%t)
         self%q_stage = self%q
         self%p_stage = self%p
         self%q_stage(lane, :) = y(:m) + h0*f(:m)
         self%p_stage(lane, :) = y(m + 1:) + h0*f(m + 1:)
         call evaluate_one(self, lane, course%t + h0, self%q_stage, self%p_stage, ok)
         if (ok) then
            call all_rates(self, self%q_stage, self%p_stage, self%f_new, lane, f_ahead)
            d2 = norm2((f_ahead - f)/scale)/root/h0
            if (max(d1, d2) <= 1.0e-15_wp) then
               h1 = max(1.0e-6_wp, 1.0e-3_wp*h0)
            else
               h1 = (0.01_wp/max(d1, d2))**0.125_wp
            end if
            course%h_next = min(100.0_wp*h0, h1, course%t_stop - course%t)
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

   !> q(1:2)' of a free spacecraft.
   pure subroutine turning_rates(m, q, p, rate)
      integer, intent(in) :: m
      real(wp), intent(in) :: q(lanes, m), p(lanes, m)
      real(wp), intent(out) :: rate(lanes, 2)
      integer :: l
      !$omp simd
      do l = 1, lanes
         rate(l, 1) = p(l, 1) + p(l, 3)*q(l, 2)
         rate(l, 2) = p(l, 2) - p(l, 3)*q(l, 1)
      end do
   end subroutine turning_rates

   !> State of stage s.
   pure subroutine stage_states(s, m, h, q, p, f, q_stage, p_stage)
      integer, intent(in) :: s !! 2..12
      integer, intent(in) :: m
      real(wp), intent(in) :: h(lanes), q(lanes, m), p(lanes, m), f(lanes, m, n_stages)
      real(wp), intent(out) :: q_stage(lanes, m), p_stage(lanes, m)
      integer :: j, l

      select case (s)
      case (2)
         do j = 1, m
            !$omp simd
            do l = 1, lanes
               p_stage(l, j) = p(l, j) + h(l)*(a(1, 2)*f(l, j, 1))
               q_stage(l, j) = q(l, j) + h(l)*(node(2)*p(l, j))
            end do
         end do
      case (3)
         do j = 1, m
            !$omp simd
            do l = 1, lanes
               p_stage(l, j) = p(l, j) + h(l)*(a(1, 3)*f(l, j, 1) + a(2, 3)*f(l, j, 2))
               q_stage(l, j) = q(l, j) + h(l)*(node(3)*p(l, j) + h(l)*(a2(1, 3)*f(l, j, 1)))
            end do
         end do
      case (4)
         do j = 1, m
            !$omp simd
            do l = 1, lanes
               p_stage(l, j) = p(l, j) + h(l)*(a(1, 4)*f(l, j, 1) + a(3, 4)*f(l, j, 3))
               q_stage(l, j) = q(l, j) + h(l)*(node(4)*p(l, j) + h(l)*(a2(1, 4)*f(l, j, 1) + a2(2, 4)*f(l, j, 2)))
            end do
         end do
      case (5)
         do j = 1, m
            !$omp simd
            do l = 1, lanes
               p_stage(l, j) = p(l, j) + h(l)*(a(1, 5)*f(l, j, 1) + a(3, 5)*f(l, j, 3) + a(4, 5)*f(l, j, 4))
               q_stage(l, j) = q(l, j) + h(l)*(node(5)*p(l, j) + h(l)*(a2(1, 5)*f(l, j, 1) + a2(2, 5)*f(l, j, 2) + &
                                                                       a2(3, 5)*f(l, j, 3)))
            end do
         end do
      case (6)
         do j = 1, m
            !$omp simd
            do l = 1, lanes
               p_stage(l, j) = p(l, j) + h(l)*(a(1, 6)*f(l, j, 1) + a(4, 6)*f(l, j, 4) + a(5, 6)*f(l, j, 5))
               q_stage(l, j) = q(l, j) + h(l)*(node(6)*p(l, j) + h(l)*(a2(1, 6)*f(l, j, 1) + a2(3, 6)*f(l, j, 3) + &
                                                                       a2(4, 6)*f(l, j, 4)))
            end do
         end do
      case (7)
         do j = 1, m
            !$omp simd
            do l = 1, lanes
               p_stage(l, j) = p(l, j) + h(l)*(a(1, 7)*f(l, j, 1) + a(4, 7)*f(l, j, 4) + a(5, 7)*f(l, j, 5) + &
                                               a(6, 7)*f(l, j, 6))
               q_stage(l, j) = q(l, j) + h(l)*(node(7)*p(l, j) + h(l)*(a2(1, 7)*f(l, j, 1) + a2(3, 7)*f(l, j, 3) + &
                                                                       a2(4, 7)*f(l, j, 4) + a2(5, 7)*f(l, j, 5)))
            end do
         end do
      case (8)
         do j = 1, m
            !$omp simd
            do l = 1, lanes
               p_stage(l, j) = p(l, j) + h(l)*(a(1, 8)*f(l, j, 1) + a(4, 8)*f(l, j, 4) + a(5, 8)*f(l, j, 5) + &
                                               a(6, 8)*f(l, j, 6) + a(7, 8)*f(l, j, 7))
               q_stage(l, j) = q(l, j) + h(l)*(node(8)*p(l, j) + h(l)*(a2(1, 8)*f(l, j, 1) + a2(3, 8)*f(l, j, 3) + &
                                                                       a2(4, 8)*f(l, j, 4) + a2(5, 8)*f(l, j, 5) + &
                                                                       a2(6, 8)*f(l, j, 6)))
            end do
         end do
      case (9)
         do j = 1, m
            !$omp simd
            do l = 1, lanes
               p_stage(l, j) = p(l, j) + h(l)*(a(1, 9)*f(l, j, 1) + a(4, 9)*f(l, j, 4) + a(5, 9)*f(l, j, 5) + &
                                               a(6, 9)*f(l, j, 6) + a(7, 9)*f(l, j, 7) + a(8, 9)*f(l, j, 8))
               q_stage(l, j) = q(l, j) + h(l)*(node(9)*p(l, j) + h(l)*(a2(1, 9)*f(l, j, 1) + a2(3, 9)*f(l, j, 3) + &
                                                                       a2(4, 9)*f(l, j, 4) + a2(5, 9)*f(l, j, 5) + &
                                                                       a2(6, 9)*f(l, j, 6) + a2(7, 9)*f(l, j, 7)))
            end do
         end do
      case (10)
         do j = 1, m
            !$omp simd
            do l = 1, lanes
               p_stage(l, j) = p(l, j) + h(l)*(a(1, 10)*f(l, j, 1) + a(4, 10)*f(l, j, 4) + a(5, 10)*f(l, j, 5) + &
                                               a(6, 10)*f(l, j, 6) + a(7, 10)*f(l, j, 7) + a(8, 10)*f(l, j, 8) + &
                                               a(9, 10)*f(l, j, 9))
               q_stage(l, j) = q(l, j) + h(l)*(node(10)*p(l, j) + h(l)*(a2(1, 10)*f(l, j, 1) + a2(3, 10)*f(l, j, 3) + &
                                                                        a2(4, 10)*f(l, j, 4) + a2(5, 10)*f(l, j, 5) + &
                                                                        a2(6, 10)*f(l, j, 6) + a2(7, 10)*f(l, j, 7) + &
                                                                        a2(8, 10)*f(l, j, 8)))
            end do
         end do
      case (11)
         do j = 1, m
            !$omp simd
            do l = 1, lanes
               p_stage(l, j) = p(l, j) + h(l)*(a(1, 11)*f(l, j, 1) + a(4, 11)*f(l, j, 4) + a(5, 11)*f(l, j, 5) + &
                                               a(6, 11)*f(l, j, 6) + a(7, 11)*f(l, j, 7) + a(8, 11)*f(l, j, 8) + &
                                               a(9, 11)*f(l, j, 9) + a(10, 11)*f(l, j, 10))
               q_stage(l, j) = q(l, j) + h(l)*(node(11)*p(l, j) + h(l)*(a2(1, 11)*f(l, j, 1) + a2(3, 11)*f(l, j, 3) + &
                                                                        a2(4, 11)*f(l, j, 4) + a2(5, 11)*f(l, j, 5) + &
                                                                        a2(6, 11)*f(l, j, 6) + a2(7, 11)*f(l, j, 7) + &
                                                                        a2(8, 11)*f(l, j, 8) + a2(9, 11)*f(l, j, 9)))
            end do
         end do
      case default ! 12
         do j = 1, m
            !$omp simd
            do l = 1, lanes
               p_stage(l, j) = p(l, j) + h(l)*(a(1, 12)*f(l, j, 1) + a(4, 12)*f(l, j, 4) + a(5, 12)*f(l, j, 5) + &
                                               a(6, 12)*f(l, j, 6) + a(7, 12)*f(l, j, 7) + a(8, 12)*f(l, j, 8) + &
                                               a(9, 12)*f(l, j, 9) + a(10, 12)*f(l, j, 10) + a(11, 12)*f(l, j, 11))
               q_stage(l, j) = q(l, j) + h(l)*(node(12)*p(l, j) + h(l)*(a2(1, 12)*f(l, j, 1) + a2(3, 12)*f(l, j, 3) + &
                                                                        a2(4, 12)*f(l, j, 4) + a2(5, 12)*f(l, j, 5) + &
                                                                        a2(6, 12)*f(l, j, 6) + a2(7, 12)*f(l, j, 7) + &
                                                                        a2(8, 12)*f(l, j, 8) + a2(9, 12)*f(l, j, 9) + &
                                                                        a2(10, 12)*f(l, j, 10)))
            end do
         end do
      end select
   end subroutine stage_states

   !> The same of q(1:2), where they turn.
   pure subroutine turning_stage(s, m, h, q, turn, q_stage)
      integer, intent(in) :: s !! 2..12
      integer, intent(in) :: m
      real(wp), intent(in) :: h(lanes), q(lanes, m), turn(lanes, 2, n_stages)
      real(wp), intent(inout) :: q_stage(lanes, m)
      integer :: j, l

      select case (s)
      case (2)
         do j = 1, 2
            !$omp simd
            do l = 1, lanes
               q_stage(l, j) = q(l, j) + h(l)*(a(1, 2)*turn(l, j, 1))
            end do
         end do
      case (3)
         do j = 1, 2
            !$omp simd
            do l = 1, lanes
               q_stage(l, j) = q(l, j) + h(l)*(a(1, 3)*turn(l, j, 1) + a(2, 3)*turn(l, j, 2))
            end do
         end do
      case (4)
         do j = 1, 2
            !$omp simd
            do l = 1, lanes
               q_stage(l, j) = q(l, j) + h(l)*(a(1, 4)*turn(l, j, 1) + a(3, 4)*turn(l, j, 3))
            end do
         end do
      case (5)
         do j = 1, 2
            !$omp simd
            do l = 1, lanes
               q_stage(l, j) = q(l, j) + h(l)*(a(1, 5)*turn(l, j, 1) + a(3, 5)*turn(l, j, 3) + a(4, 5)*turn(l, j, 4))
            end do
         end do
      case (6)
         do j = 1, 2
            !$omp simd
            do l = 1, lanes
               q_stage(l, j) = q(l, j) + h(l)*(a(1, 6)*turn(l, j, 1) + a(4, 6)*turn(l, j, 4) + a(5, 6)*turn(l, j, 5))
            end do
         end do
      case (7)
         do j = 1, 2
            !$omp simd
            do l = 1, lanes
               q_stage(l, j) = q(l, j) + h(l)*(a(1, 7)*turn(l, j, 1) + a(4, 7)*turn(l, j, 4) + a(5, 7)*turn(l, j, 5) + &
                                               a(6, 7)*turn(l, j, 6))
            end do
         end do
      case (8)
         do j = 1, 2
            !$omp simd
            do l = 1, lanes
               q_stage(l, j) = q(l, j) + h(l)*(a(1, 8)*turn(l, j, 1) + a(4, 8)*turn(l, j, 4) + a(5, 8)*turn(l, j, 5) + &
                                               a(6, 8)*turn(l, j, 6) + a(7, 8)*turn(l, j, 7))
            end do
         end do
      case (9)
         do j = 1, 2
            !$omp simd
            do l = 1, lanes
               q_stage(l, j) = q(l, j) + h(l)*(a(1, 9)*turn(l, j, 1) + a(4, 9)*turn(l, j, 4) + a(5, 9)*turn(l, j, 5) + &
                                               a(6, 9)*turn(l, j, 6) + a(7, 9)*turn(l, j, 7) + a(8, 9)*turn(l, j, 8))
            end do
         end do
      case (10)
         do j = 1, 2
            !$omp simd
            do l = 1, lanes
               q_stage(l, j) = q(l, j) + h(l)*(a(1, 10)*turn(l, j, 1) + a(4, 10)*turn(l, j, 4) + a(5, 10)*turn(l, j, 5) + &
                                               a(6, 10)*turn(l, j, 6) + a(7, 10)*turn(l, j, 7) + a(8, 10)*turn(l, j, 8) + &
                                               a(9, 10)*turn(l, j, 9))
            end do
         end do
      case (11)
         do j = 1, 2
            !$omp simd
            do l = 1, lanes
               q_stage(l, j) = q(l, j) + h(l)*(a(1, 11)*turn(l, j, 1) + a(4, 11)*turn(l, j, 4) + a(5, 11)*turn(l, j, 5) + &
                                               a(6, 11)*turn(l, j, 6) + a(7, 11)*turn(l, j, 7) + a(8, 11)*turn(l, j, 8) + &
                                               a(9, 11)*turn(l, j, 9) + a(10, 11)*turn(l, j, 10))
            end do
         end do
      case default ! 12
         do j = 1, 2
            !$omp simd
            do l = 1, lanes
               q_stage(l, j) = q(l, j) + h(l)*(a(1, 12)*turn(l, j, 1) + a(4, 12)*turn(l, j, 4) + a(5, 12)*turn(l, j, 5) + &
                                               a(6, 12)*turn(l, j, 6) + a(7, 12)*turn(l, j, 7) + a(8, 12)*turn(l, j, 8) + &
                                               a(9, 12)*turn(l, j, 9) + a(10, 12)*turn(l, j, 10) + a(11, 12)*turn(l, j, 11))
            end do
         end do
      end select
   end subroutine turning_stage

   !> Increments, the new state, and the norm of its error: root mean square of error/tolerance, Hairer's mix of the two
   !> estimates. Anything that is not finite makes it `hopeless`.
   pure subroutine end_of_step(m, n_turning, h, q, p, f, turn, q_lost, p_lost, rtol, atol, q_increment, p_increment, q_new, &
                               p_new, norm)
      integer, intent(in) :: m, n_turning
      real(wp), intent(in) :: h(lanes), f(lanes, m, n_stages), turn(lanes, 2, n_stages), rtol(lanes), atol(lanes)
      real(wp), dimension(lanes, m), intent(in) :: q, p, q_lost, p_lost
      real(wp), dimension(lanes, m), intent(out) :: q_increment, p_increment, q_new, p_new
      real(wp), intent(out) :: norm(lanes)
      real(wp), dimension(lanes) :: sum_5, sum_3, bad
      real(wp) :: rate, five, three, weight, both
      integer :: j, l

      sum_5 = 0.0_wp
      sum_3 = 0.0_wp
      bad = 0.0_wp
      do j = 1, m
         !$omp simd
         do l = 1, lanes
            rate = b(1)*f(l, j, 1) + b(6)*f(l, j, 6) + b(7)*f(l, j, 7) + b(8)*f(l, j, 8) + b(9)*f(l, j, 9) + &
                   b(10)*f(l, j, 10) + b(11)*f(l, j, 11) + b(12)*f(l, j, 12)
            five = e5(1)*f(l, j, 1) + e5(6)*f(l, j, 6) + e5(7)*f(l, j, 7) + e5(8)*f(l, j, 8) + e5(9)*f(l, j, 9) + &
                   e5(10)*f(l, j, 10) + e5(11)*f(l, j, 11) + e5(12)*f(l, j, 12)
            three = e3(1)*f(l, j, 1) + e3(6)*f(l, j, 6) + e3(7)*f(l, j, 7) + e3(8)*f(l, j, 8) + e3(9)*f(l, j, 9) + &
                    e3(10)*f(l, j, 10) + e3(11)*f(l, j, 11) + e3(12)*f(l, j, 12)
            p_increment(l, j) = h(l)*rate
            p_new(l, j) = p(l, j) + (p_increment(l, j) - p_lost(l, j))
            weight = 1.0_wp/(atol(l) + rtol(l)*max(abs(p(l, j)), abs(p_new(l, j))))
            sum_5(l) = sum_5(l) + (five*weight)**2
            sum_3(l) = sum_3(l) + (three*weight)**2
            bad(l) = merge(bad(l), 1.0_wp, abs(p_new(l, j)) <= huge(1.0_wp))
         end do
      end do
      do j = 1, n_turning
         !$omp simd
         do l = 1, lanes
            rate = b(1)*turn(l, j, 1) + b(6)*turn(l, j, 6) + b(7)*turn(l, j, 7) + b(8)*turn(l, j, 8) + b(9)*turn(l, j, 9) + &
                   b(10)*turn(l, j, 10) + b(11)*turn(l, j, 11) + b(12)*turn(l, j, 12)
            five = e5(1)*turn(l, j, 1) + e5(6)*turn(l, j, 6) + e5(7)*turn(l, j, 7) + e5(8)*turn(l, j, 8) + &
                   e5(9)*turn(l, j, 9) + e5(10)*turn(l, j, 10) + e5(11)*turn(l, j, 11) + e5(12)*turn(l, j, 12)
            three = e3(1)*turn(l, j, 1) + e3(6)*turn(l, j, 6) + e3(7)*turn(l, j, 7) + e3(8)*turn(l, j, 8) + &
                    e3(9)*turn(l, j, 9) + e3(10)*turn(l, j, 10) + e3(11)*turn(l, j, 11) + e3(12)*turn(l, j, 12)
            q_increment(l, j) = h(l)*rate
            q_new(l, j) = q(l, j) + (q_increment(l, j) - q_lost(l, j))
            weight = 1.0_wp/(atol(l) + rtol(l)*max(abs(q(l, j)), abs(q_new(l, j))))
            sum_5(l) = sum_5(l) + (five*weight)**2
            sum_3(l) = sum_3(l) + (three*weight)**2
            bad(l) = merge(bad(l), 1.0_wp, abs(q_new(l, j)) <= huge(1.0_wp))
         end do
      end do
      do j = n_turning + 1, m
         !$omp simd
         do l = 1, lanes
            rate = p(l, j) + h(l)*(b2(1)*f(l, j, 1) + b2(6)*f(l, j, 6) + b2(7)*f(l, j, 7) + b2(8)*f(l, j, 8) + &
                   b2(9)*f(l, j, 9) + b2(10)*f(l, j, 10) + b2(11)*f(l, j, 11))
            five = h(l)*(e5_2(1)*f(l, j, 1) + e5_2(4)*f(l, j, 4) + e5_2(5)*f(l, j, 5) + e5_2(6)*f(l, j, 6) + &
                   e5_2(7)*f(l, j, 7) + e5_2(8)*f(l, j, 8) + e5_2(9)*f(l, j, 9) + e5_2(10)*f(l, j, 10) + e5_2(11)*f(l, j, 11))
            three = h(l)*(e3_2(1)*f(l, j, 1) + e3_2(4)*f(l, j, 4) + e3_2(5)*f(l, j, 5) + e3_2(6)*f(l, j, 6) + &
                    e3_2(7)*f(l, j, 7) + e3_2(8)*f(l, j, 8) + e3_2(9)*f(l, j, 9) + e3_2(10)*f(l, j, 10) + e3_2(11)*f(l, j, 11))
            q_increment(l, j) = h(l)*rate
            q_new(l, j) = q(l, j) + (q_increment(l, j) - q_lost(l, j))
            weight = 1.0_wp/(atol(l) + rtol(l)*max(abs(q(l, j)), abs(q_new(l, j))))
            sum_5(l) = sum_5(l) + (five*weight)**2
            sum_3(l) = sum_3(l) + (three*weight)**2
            bad(l) = merge(bad(l), 1.0_wp, abs(q_new(l, j)) <= huge(1.0_wp))
         end do
      end do
      !$omp simd
      do l = 1, lanes
         both = 2*m*(sum_5(l) + 0.01_wp*sum_3(l))
         norm(l) = abs(h(l))*sum_5(l)/sqrt(max(both, tiny(1.0_wp)))
         norm(l) = merge(norm(l), hopeless, both <= huge(1.0_wp) .and. norm(l) <= huge(1.0_wp) .and. bad(l) < 0.5_wp)
      end do
   end subroutine end_of_step

   !> Not ok where some rate is not finite.
   pure subroutine check_rates(m, f, ok)
      integer, intent(in) :: m
      real(wp), intent(in) :: f(lanes, m)
      logical, intent(inout) :: ok(lanes)
      real(wp) :: bad(lanes)
      integer :: j, l

      bad = 0.0_wp
      do j = 1, m
         !$omp simd
         do l = 1, lanes
            bad(l) = merge(bad(l), 1.0_wp, abs(f(l, j)) <= huge(1.0_wp))
         end do
      end do
      ok = ok .and. bad < 0.5_wp
   end subroutine check_rates

   !> Make the new states the current ones where steps were accepted, with the digits that rounding took from them.
   pure subroutine advance_states(m, commit, move, y_new, increment, lost, y)
      integer, intent(in) :: m
      real(wp), intent(in) :: commit(lanes), move(lanes)
      real(wp), dimension(lanes, m), intent(in) :: y_new, increment
      real(wp), dimension(lanes, m), intent(inout) :: lost, y
      integer :: j, l

      do j = 1, m
         !$omp simd
         do l = 1, lanes
            lost(l, j) = merge((y_new(l, j) - y(l, j)) - (increment(l, j) - lost(l, j)), lost(l, j), commit(l) > 0.5_wp)
            y(l, j) = merge(y_new(l, j), y(l, j), move(l) > 0.5_wp)
         end do
      end do
   end subroutine advance_states

   pure subroutine advance_rates(m, move, f_new, f)
      integer, intent(in) :: m
      real(wp), intent(in) :: move(lanes), f_new(lanes, m)
      real(wp), intent(inout) :: f(lanes, m)
      integer :: j, l

      do j = 1, m
         !$omp simd
         do l = 1, lanes
            f(l, j) = merge(f_new(l, j), f(l, j), move(l) > 0.5_wp)
         end do
      end do
   end subroutine advance_rates

end module rodyn_lane_dop853
