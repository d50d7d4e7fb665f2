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
   use rodyn_integrator, only: solver_options, solver_statistics, time_text
   use rodyn_text, only: to_text
   use rodyn_dop853_tableau, only: c2, c3, c4, c5, c6, c7, c8, c9, c10, c11, c12, a2_1, a3_1, a3_2, a4_1, &
      a4_3, a5_1, a5_3, a5_4, a6_1, a6_4, a6_5, a7_1, a7_4, a7_5, a7_6, a8_1, a8_4, a8_5, a8_6, a8_7, a9_1, &
      a9_4, a9_5, a9_6, a9_7, a9_8, a10_1, a10_4, a10_5, a10_6, a10_7, a10_8, a10_9, a11_1, a11_4, a11_5, &
      a11_6, a11_7, a11_8, a11_9, a11_10, a12_1, a12_4, a12_5, a12_6, a12_7, a12_8, a12_9, a12_10, a12_11, &
      b1, b6, b7, b8, b9, b10, b11, b12, e5_1, e5_6, e5_7, e5_8, e5_9, e5_10, e5_11, e5_12, e3_1, e3_6, e3_7, &
      e3_8, e3_9, e3_10, e3_11, e3_12
   implicit none (type, external)
   private
   public :: lane_dop853, new_lane_dop853, suits_lane_dop853
   public :: at_nothing, at_output, at_stop, at_failure

   integer, parameter :: at_nothing = 0 !! the lane is idle or on its way
   integer, parameter :: at_output = 1  !! the wanted time is reached
   integer, parameter :: at_stop = 2    !! the stop time is reached, and no output is wanted before
   integer, parameter :: at_failure = 3 !! no way on

   integer, parameter :: idle = 0, stepping = 1, on_side_trip = 2 !! what a lane does in a pass
   integer, parameter :: n_stages = 12
   real(wp), parameter :: node(n_stages) = [0.0_wp, c2, c3, c4, c5, c6, c7, c8, c9, c10, c11, c12]
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
      logical :: rejected = .false.  !! the last try was
      logical :: refused = .false.   !! because the right-hand side said so
      type(solver_options) :: options
      type(solver_statistics) :: counts
      character(len=:), allocatable :: failure
   end type lane_course

   type :: lane_dop853
      private
      class(lane_system), pointer :: system => null() !! not owned
      integer :: n = 0                           !! states
      type(lane_course) :: course(lanes)
      real(wp), dimension(lanes) :: h = 0.0_wp, rtol = 1.0e-8_wp, atol = 1.0e-8_wp !! step of the pass [s]; tolerances
      real(wp), allocatable :: y(:, :)           !! states where the pass starts (lanes, n)
      real(wp), allocatable :: k(:, :, :)        !! rates of the stages, the first there (lanes, n, 12)
      real(wp), allocatable :: lost(:, :)        !! what rounding took from the state so far (lanes, n)
      real(wp), dimension(:, :), allocatable :: stage, increment, y_new, f_new !! workspace (lanes, n)
      real(wp), dimension(:, :), allocatable :: y_after, f_after !! end of the last step, of lanes on side trips (lanes, n)
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
      self%n = system%n_states
      associate (n => self%n)
         allocate (self%y(lanes, n), self%k(lanes, n, n_stages), self%lost(lanes, n), self%stage(lanes, n), &
                   self%increment(lanes, n), self%y_new(lanes, n), self%f_new(lanes, n), self%y_after(lanes, n), &
                   self%f_after(lanes, n), source=0.0_wp)
      end associate
   end subroutine new_lane_dop853

   !> Put a case into an idle lane, at its start.
   subroutine enter(self, lane, options, t, y, t_stop, t_wanted)
      class(lane_dop853), intent(inout) :: self
      integer, intent(in) :: lane
      type(solver_options), intent(in) :: options !! rtol, atol, max_step and max_steps are used
      real(wp), intent(in) :: t        !! [s]
      real(wp), intent(in) :: y(:)     !! (n_states)
      real(wp), intent(in) :: t_stop   !! end of the first interval [s]
      real(wp), intent(in) :: t_wanted !! next output, after t and not after t_stop; huge: none [s]

      call clear(self%course(lane))
      associate (course => self%course(lane))
         course%options = options
         course%counts%last_order = 8
         course%t = t
         self%rtol(lane) = options%rtol
         self%atol(lane) = options%atol
         self%lost(lane, :) = 0.0_wp
         if (all(abs(y) <= huge(y))) then
            self%y(lane, :) = y
            call self%restart(lane, t_stop, t_wanted)
         else
            self%y(lane, :) = 0.0_wp
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
         course%counts%n_starts = course%counts%n_starts + 1
         call evaluate_one(self, lane, course%t, self%y, ok)
         if (.not. ok) then
            call fail(self, lane, 'dop853 at t = '//time_text(course%t)//' s: '//trouble(course))
            return
         end if
         self%k(lane, :, 1) = self%f_new(lane, :)
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
      real(wp), intent(out) :: y(:) !! (n_states)
      associate (course => self%course(lane))
         if (course%doing /= on_side_trip) then
            y = self%y(lane, :)
         else if (course%event == at_output) then
            y = self%y(lane, :) + self%increment(lane, :)
         else
            y = self%y_after(lane, :)
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
      do s = 2, n_stages
         call stage_state(s, self%n, self%y, self%h, self%k, self%stage)
         t = self%course%t_base + node(s)*self%h
         call self%system%rhs(t, self%stage, self%k(:, :, s), ok)
         good = good .and. ok
      end do
      call add_increment(self%n, self%h, self%k, self%y, self%lost, self%rtol, self%atol, self%increment, self%y_new, norm)
      t = self%course%t_new
      call self%system%rhs(t, self%y_new, self%f_new, ok)
      call check_rates(self%n, self%f_new, ok)
      do lane = 1, lanes
         call judge(self, lane, good(lane), ok(lane), norm(lane), commit(lane), move(lane))
      end do
      call advance_states(self%n, commit, move, self%y_new, self%increment, self%f_new, self%lost, self%y, self%k)
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
            self%y(lane, :) = self%y_after(lane, :)
            self%k(lane, :, 1) = self%f_after(lane, :)
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
      self%y_after(lane, :) = self%y_new(lane, :)
      self%f_after(lane, :) = self%f_new(lane, :)
   end subroutine keep_end

   !> A lane cannot go on. Its state is the last good one.
   subroutine fail(self, lane, text)
      class(lane_dop853), intent(inout) :: self
      integer, intent(in) :: lane
      character(len=*), intent(in) :: text

      associate (course => self%course(lane))
         if (course%doing == on_side_trip) self%y(lane, :) = self%y_after(lane, :)
         course%doing = idle
         course%event = at_failure
         course%failure = text
      end associate
      self%k(lane, :, :) = 0.0_wp ! what follows in this lane is thrown away, but should be harmless
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

   !> Rates of one lane, in `f_new`. The others are computed, too, and not used.
   subroutine evaluate_one(self, lane, t, y, ok)
      class(lane_dop853), intent(inout) :: self
      integer, intent(in) :: lane
      real(wp), intent(in) :: t
      real(wp), contiguous, intent(in) :: y(:, :)
      logical, intent(out) :: ok
      real(wp) :: times(lanes)
      logical :: all_ok(lanes)

      times = self%course%t_base
      times(lane) = t
      call self%system%rhs(times, y, self%f_new, all_ok)
      self%course(lane)%counts%n_rhs = self%course(lane)%counts%n_rhs + 1
      ok = all_ok(lane)
      self%course(lane)%refused = .not. ok
      if (ok) ok = all(ieee_is_finite(self%f_new(lane, :)))
   end subroutine evaluate_one

   !> Length of the first step (Hairer, Norsett & Wanner, sec. II.4).
   subroutine first_step(self, lane)
      class(lane_dop853), intent(inout) :: self
      integer, intent(in) :: lane
      real(wp) :: d0, d1, d2, h0, h1, scale(self%n)
      logical :: ok

      associate (n => self%n, course => self%course(lane), y => self%y(lane, :), f => self%k(lane, :, 1), &
                 options => self%course(lane)%options)
         associate (span => course%t_stop - course%t)
            if (span <= 0.0_wp) return
            scale = options%atol + options%rtol*abs(y)
            d0 = norm2(y/scale)/sqrt(real(n, wp))
            d1 = norm2(f/scale)/sqrt(real(n, wp))
            h0 = 1.0e-6_wp
            if (min(d0, d1) > 1.0e-5_wp) h0 = 0.01_wp*d0/d1
            h0 = min(h0, span)
            self%stage = self%y
            self%stage(lane, :) = y + h0*f
            call evaluate_one(self, lane, course%t + h0, self%stage, ok)
            if (ok) then
               d2 = norm2((self%f_new(lane, :) - f)/scale)/sqrt(real(n, wp))/h0
               if (max(d1, d2) <= 1.0e-15_wp) then
                  h1 = max(1.0e-6_wp, 1.0e-3_wp*h0)
               else
                  h1 = (0.01_wp/max(d1, d2))**0.125_wp
               end if
               course%h_next = min(100.0_wp*h0, h1, span)
            else
               course%h_next = 1.0e-3_wp*h0
            end if
            if (options%max_step > 0.0_wp) course%h_next = min(course%h_next, options%max_step)
            if (.not. course%h_next > 0.0_wp) &
               call fail(self, lane, 'dop853 at t = '//time_text(course%t)//' s: no first step found')
         end associate
      end associate
   end subroutine first_step

   !> State of stage s.
   pure subroutine stage_state(s, n, y, h, k, stage)
      integer, intent(in) :: s !! 2..12
      integer, intent(in) :: n
      real(wp), intent(in) :: y(lanes, n), h(lanes), k(lanes, n, n_stages)
      real(wp), intent(out) :: stage(lanes, n)
      integer :: j, l

      select case (s)
      case (2)
         do j = 1, n
            !$omp simd
            do l = 1, lanes
               stage(l, j) = y(l, j) + h(l)*(a2_1*k(l, j, 1))
            end do
         end do
      case (3)
         do j = 1, n
            !$omp simd
            do l = 1, lanes
               stage(l, j) = y(l, j) + h(l)*(a3_1*k(l, j, 1) + a3_2*k(l, j, 2))
            end do
         end do
      case (4)
         do j = 1, n
            !$omp simd
            do l = 1, lanes
               stage(l, j) = y(l, j) + h(l)*(a4_1*k(l, j, 1) + a4_3*k(l, j, 3))
            end do
         end do
      case (5)
         do j = 1, n
            !$omp simd
            do l = 1, lanes
               stage(l, j) = y(l, j) + h(l)*(a5_1*k(l, j, 1) + a5_3*k(l, j, 3) + a5_4*k(l, j, 4))
            end do
         end do
      case (6)
         do j = 1, n
            !$omp simd
            do l = 1, lanes
               stage(l, j) = y(l, j) + h(l)*(a6_1*k(l, j, 1) + a6_4*k(l, j, 4) + a6_5*k(l, j, 5))
            end do
         end do
      case (7)
         do j = 1, n
            !$omp simd
            do l = 1, lanes
               stage(l, j) = y(l, j) + h(l)*(a7_1*k(l, j, 1) + a7_4*k(l, j, 4) + a7_5*k(l, j, 5) + a7_6*k(l, j, 6))
            end do
         end do
      case (8)
         do j = 1, n
            !$omp simd
            do l = 1, lanes
               stage(l, j) = y(l, j) + h(l)*(a8_1*k(l, j, 1) + a8_4*k(l, j, 4) + a8_5*k(l, j, 5) + a8_6*k(l, j, 6) + &
                                             a8_7*k(l, j, 7))
            end do
         end do
      case (9)
         do j = 1, n
            !$omp simd
            do l = 1, lanes
               stage(l, j) = y(l, j) + h(l)*(a9_1*k(l, j, 1) + a9_4*k(l, j, 4) + a9_5*k(l, j, 5) + a9_6*k(l, j, 6) + &
                                             a9_7*k(l, j, 7) + a9_8*k(l, j, 8))
            end do
         end do
      case (10)
         do j = 1, n
            !$omp simd
            do l = 1, lanes
               stage(l, j) = y(l, j) + h(l)*(a10_1*k(l, j, 1) + a10_4*k(l, j, 4) + a10_5*k(l, j, 5) + a10_6*k(l, j, 6) + &
                                             a10_7*k(l, j, 7) + a10_8*k(l, j, 8) + a10_9*k(l, j, 9))
            end do
         end do
      case (11)
         do j = 1, n
            !$omp simd
            do l = 1, lanes
               stage(l, j) = y(l, j) + h(l)*(a11_1*k(l, j, 1) + a11_4*k(l, j, 4) + a11_5*k(l, j, 5) + a11_6*k(l, j, 6) + &
                                             a11_7*k(l, j, 7) + a11_8*k(l, j, 8) + a11_9*k(l, j, 9) + a11_10*k(l, j, 10))
            end do
         end do
      case default ! 12
         do j = 1, n
            !$omp simd
            do l = 1, lanes
               stage(l, j) = y(l, j) + h(l)*(a12_1*k(l, j, 1) + a12_4*k(l, j, 4) + a12_5*k(l, j, 5) + a12_6*k(l, j, 6) + &
                                             a12_7*k(l, j, 7) + a12_8*k(l, j, 8) + a12_9*k(l, j, 9) + a12_10*k(l, j, 10) + &
                                             a12_11*k(l, j, 11))
            end do
         end do
      end select
   end subroutine stage_state

   !> h sum b_i k_i, the new state, and the norm of its error: root mean square of error/tolerance, Hairer's mix of the
   !> two estimates. Anything that is not finite makes it `hopeless`.
   pure subroutine add_increment(n, h, k, y, lost, rtol, atol, increment, y_new, norm)
      integer, intent(in) :: n
      real(wp), intent(in) :: h(lanes), k(lanes, n, n_stages), y(lanes, n), lost(lanes, n), rtol(lanes), atol(lanes)
      real(wp), intent(out) :: increment(lanes, n), y_new(lanes, n), norm(lanes)
      real(wp) :: sum_5(lanes), sum_3(lanes), bad(lanes), weight, e5, e3, both
      integer :: j, l

      sum_5 = 0.0_wp
      sum_3 = 0.0_wp
      bad = 0.0_wp
      do j = 1, n
         !$omp simd
         do l = 1, lanes
            increment(l, j) = h(l)*(b1*k(l, j, 1) + b6*k(l, j, 6) + b7*k(l, j, 7) + b8*k(l, j, 8) + b9*k(l, j, 9) + &
                                    b10*k(l, j, 10) + b11*k(l, j, 11) + b12*k(l, j, 12))
            y_new(l, j) = y(l, j) + (increment(l, j) - lost(l, j))
            weight = 1.0_wp/(atol(l) + rtol(l)*max(abs(y(l, j)), abs(y_new(l, j))))
            e5 = e5_1*k(l, j, 1) + e5_6*k(l, j, 6) + e5_7*k(l, j, 7) + e5_8*k(l, j, 8) + e5_9*k(l, j, 9) + &
                 e5_10*k(l, j, 10) + e5_11*k(l, j, 11) + e5_12*k(l, j, 12)
            e3 = e3_1*k(l, j, 1) + e3_6*k(l, j, 6) + e3_7*k(l, j, 7) + e3_8*k(l, j, 8) + e3_9*k(l, j, 9) + &
                 e3_10*k(l, j, 10) + e3_11*k(l, j, 11) + e3_12*k(l, j, 12)
            sum_5(l) = sum_5(l) + (e5*weight)**2
            sum_3(l) = sum_3(l) + (e3*weight)**2
            bad(l) = merge(bad(l), 1.0_wp, abs(y_new(l, j)) <= huge(1.0_wp))
         end do
      end do
      !$omp simd
      do l = 1, lanes
         both = n*(sum_5(l) + 0.01_wp*sum_3(l))
         norm(l) = abs(h(l))*sum_5(l)/sqrt(max(both, tiny(1.0_wp)))
         norm(l) = merge(norm(l), hopeless, both <= huge(1.0_wp) .and. norm(l) <= huge(1.0_wp) .and. bad(l) < 0.5_wp)
      end do
   end subroutine add_increment

   !> Not ok where some rate is not finite.
   pure subroutine check_rates(n, f, ok)
      integer, intent(in) :: n
      real(wp), intent(in) :: f(lanes, n)
      logical, intent(inout) :: ok(lanes)
      real(wp) :: bad(lanes)
      integer :: j, l

      bad = 0.0_wp
      do j = 1, n
         !$omp simd
         do l = 1, lanes
            bad(l) = merge(bad(l), 1.0_wp, abs(f(l, j)) <= huge(1.0_wp))
         end do
      end do
      ok = ok .and. bad < 0.5_wp
   end subroutine check_rates

   !> Make the new states the current ones where steps were accepted, with the digits that rounding took from them.
   pure subroutine advance_states(n, commit, move, y_new, increment, f_new, lost, y, k)
      integer, intent(in) :: n
      real(wp), intent(in) :: commit(lanes), move(lanes)
      real(wp), dimension(lanes, n), intent(in) :: y_new, increment, f_new
      real(wp), dimension(lanes, n), intent(inout) :: lost, y
      real(wp), intent(inout) :: k(lanes, n, n_stages)
      integer :: j, l

      do j = 1, n
         !$omp simd
         do l = 1, lanes
            lost(l, j) = merge((y_new(l, j) - y(l, j)) - (increment(l, j) - lost(l, j)), lost(l, j), commit(l) > 0.5_wp)
            y(l, j) = merge(y_new(l, j), y(l, j), move(l) > 0.5_wp)
            k(l, j, 1) = merge(f_new(l, j), k(l, j, 1), move(l) > 0.5_wp)
         end do
      end do
   end subroutine advance_states

end module rodyn_lane_dop853
