!> The integrator of a run: the method that the case names, or with `method = 'auto'` the one that fits, and another where the
!> motion changes its character or a method fails.
!>
!> A choice (`rodyn_method_choice`) holds for the laws that hinges have when it is made. At a time that is known before, as that of
!> a release, it is made for laws that are new; for others the last one is taken again. After an event the run goes on by
!> explicit steps: where the next event comes soon, nothing is gained by a choice, so it is made after `choice_delay` right-hand
!> sides. Where BDF is slower than explicit steps would be, the choice is made again, too. All later trials together may cost a
!> share of what the run has cost; one that this ends before it knows enough is made again when the run has cost twice as much.
!> A method that fails is not used again, and another one goes on from the last good state.
module rodyn_driver
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use rodyn_kinds, only: wp, i8
   use rodyn_errors, only: error_type, exit_stopped
   use rodyn_case_config, only: solver_config
   use rodyn_text, only: joined, time_text
   use rodyn_integrator, only: integrator_type, monitor_type, solver_options, solver_statistics
   use rodyn_integrators, only: new_integrator
   use rodyn_method_choice, only: method_choice, choose_method, named_method
   use rodyn_method_costs, only: candidates, collocation, effort_of, explicit, n_even
   use rodyn_method_numbers, only: clear_advantage, effort_of_rates, explicit_step, most_past_choices, postponed, choice_delay, &
      short_delay, trial_share, trials_free, watch_steps
   use rodyn_motion, only: motion_type
   use rodyn_step_limit, only: check_fixed_step
   implicit none (type, external)
   private
   public :: driver_type, new_driver

   integer, parameter :: most_lines = 12          !! of the history
   character(len=1), parameter :: nl = new_line('a')

   !> A method that may take part. Made when it is first needed.
   type :: member_type
      class(integrator_type), allocatable :: integrator
      logical :: has_failed = .false.
   end type member_type

   !> What was chosen for some hinge laws.
   type :: past_choice
      integer, allocatable :: laws(:) !! numbers of the laws of mechanisms
      integer :: member = 0
      character(len=:), allocatable :: reason
      real(wp) :: pace = 0.0_wp       !! of the best even method [s]
      logical :: clear = .false.      !! an implicit method that left explicit steps far behind
   end type past_choice

   !> All methods together, to those who run them an integrator like others.
   type, extends(integrator_type) :: driver_type
      type(method_choice) :: choice                  !! at the start
      character(len=:), allocatable, private :: used !! names of methods, in order
      integer :: n_choices = 0                       !! so far
      integer, private :: n_lines = 0                !! of the history
      type(member_type) :: members(size(candidates)) !! in the order of the candidates; a named method is the first, alone
      character(len=:), allocatable :: history       !! changes of the method, one line each
      character(len=:), allocatable :: failures      !! those of them where a method gave up
      type(motion_type), pointer, private :: motion => null() !! not owned
      real(wp), private :: t_end = 0.0_wp            !! of the run [s]
      integer, private :: n_outputs = 0
      integer, private :: now = 1                    !! active member
      logical, private :: begun = .false.
      logical, private :: timed = .false.            !! the next start is at a time that was known before
      type(past_choice), allocatable, private :: past_choices(:) !! the last one first
      logical, private :: is_delayed = .false.
      real(wp), private :: pace = 0.0_wp             !! expected of explicit steps or collocation [s]; 0: nothing is watched
      real(wp), private :: t_window = 0.0_wp         !! since when the delay or the watch lasts [s]
      real(wp), private :: effort_window = 0.0_wp    !! of the active member at that time
      real(wp), private :: effort_begun = 0.0_wp     !! likewise, when it was started
      real(wp), private :: spent = 0.0_wp            !! effort of the run until then
      real(wp) :: tried = 0.0_wp                     !! effort of later choices
      real(wp), private :: next_choice = 0.0_wp      !! effort of the run before which none is made
      real(wp), private :: t_last = 0.0_wp           !! the last good state [s]
      real(wp), allocatable, private :: y_last(:)    !! (n_states)
      character(len=:), allocatable, private :: why  !! the next method, in words
      type(error_type), allocatable, private :: cause !! why the last method gave up
      real(wp), private :: t_cause = 0.0_wp          !! [s]
   contains
      procedure :: make
      procedure :: start
      procedure :: advance
      procedure :: statistics
      procedure :: finalize
      procedure :: set_stop
      procedure :: set_monitor
      procedure :: check_monitor
      procedure :: methods
      procedure :: reason
      procedure, private :: name
   end type driver_type

contains

   !> Choose the method for a motion that has not begun.
   subroutine new_driver(driver, motion, y, solver, t_end, n_outputs, error, monitor)
      type(driver_type), intent(out) :: driver
      type(motion_type), target, intent(inout) :: motion !! must outlive the driver
      real(wp), contiguous, intent(in) :: y(:)    !! state at t = 0
      type(solver_config), intent(in) :: solver   !! of the case
      real(wp), intent(in) :: t_end               !! of the run [s]
      integer, intent(in) :: n_outputs            !! states that are wanted
      type(error_type), allocatable, intent(out) :: error
      class(monitor_type), target, intent(inout), optional :: monitor !! must outlive the driver

      driver%motion => motion
      driver%options = solver%solver_options
      driver%t_end = t_end
      driver%n_outputs = n_outputs
      driver%history = ''
      driver%failures = ''
      driver%used = ''
      allocate (driver%past_choices(0))
      if (present(monitor)) call driver%set_monitor(monitor)
      if (solver%method == 'auto') then
         call choose_first(driver, y, error)
      else
         driver%choice = named_method(trim(solver%method), solver%solver_options)
      end if
      if (.not. allocated(error)) &
         call check_fixed_step(driver%choice%method, driver%choice%options, motion%dynamics%scene, motion%switches, y, t_end, error)
   end subroutine new_driver

   !> The choice at the start, for the laws that hinges have once the run has begun.
   subroutine choose_first(self, y, error)
      type(driver_type), intent(inout) :: self
      real(wp), contiguous, intent(in) :: y(:)
      type(error_type), allocatable, intent(out) :: error
      type(motion_type) :: begun
      real(wp) :: state(size(y))

      begun = self%motion
      state = y
      call begun%begin_regime(0.0_wp, min(self%t_end, minval(begun%switches)), self%t_end, state, error)
      if (.not. allocated(error)) call judge(self, begun, 0.0_wp, state, self%choice, self%now)
   end subroutine choose_first

   !> Choose for the laws of a motion, from a state on, and keep what was chosen.
   subroutine judge(self, motion, t, y, choice, member)
      type(driver_type), intent(inout) :: self
      type(motion_type), intent(in) :: motion !! in the regime that begins or goes on at t
      real(wp), intent(in) :: t               !! [s]
      real(wp), intent(in) :: y(:)            !! (n_states)
      type(method_choice), intent(out) :: choice
      integer, intent(out) :: member
      type(past_choice) :: past
      real(wp) :: t_until
      logical :: out(size(candidates))
      integer :: i

      t_until = min(self%t_end, motion%dynamics%hinges%next_release(t))
      out = self%members%has_failed
      call choose_method(choice, self%options, motion, y(:motion%n_controlled), t, t_until, &
                         nint(self%n_outputs*((t_until - t)/self%t_end)), out, most_trial(self), self%monitor)
      if (self%n_choices > 0) self%tried = self%tried + choice%effort + effort_of_rates
      self%n_choices = self%n_choices + 1
      self%is_delayed = .not. choice%conclusive
      if (self%is_delayed) self%next_choice = postponed*effort_of_run(self)
      member = findloc(self%members%has_failed, .false., dim=1)
      if (.not. self%members(choice%candidate)%has_failed) member = choice%candidate
      self%pace = 0.0_wp
      if (self%is_delayed) return
      past = past_choice(motion%dynamics%hinges%mechanisms%law_number(), member, choice%reason(), &
                             merge(choice%pace, 0.0_wp, choice%tried .and. member > n_even), &
                             member > n_even .and. choice%advantage > clear_advantage)
      self%pace = past%pace
      i = place_of(self, past%laws)
      if (i > 0) then
         self%past_choices(i) = past
      else
         self%past_choices = [past, self%past_choices(:min(size(self%past_choices), most_past_choices - 1))]
      end if
   end subroutine judge

   !> Effort that a trial may cost now. The first, and one for want of explicit steps, as much as it takes.
   real(wp) function most_trial(self)
      type(driver_type), intent(inout) :: self
      most_trial = huge(1.0_wp)
      if (self%n_choices > 0 .and. .not. self%members(explicit)%has_failed) &
         most_trial = max(trials_free, trials_free + trial_share*effort_of_run(self) - self%tried)
   end function most_trial

   !> Where the earlier choice for some laws stands; 0: there is none.
   pure integer function place_of(self, laws)
      type(driver_type), intent(in) :: self
      integer, intent(in) :: laws(:)
      integer :: i
      place_of = 0
      do i = 1, size(self%past_choices)
         if (all(self%past_choices(i)%laws == laws)) place_of = i
      end do
   end function place_of

   !> Where the earlier choice for today's laws stands; 0: there is none, or its method has given up.
   pure integer function known_choice(self)
      type(driver_type), intent(in) :: self
      known_choice = place_of(self, self%motion%dynamics%hinges%mechanisms%law_number())
      if (known_choice == 0) return
      if (self%members(self%past_choices(known_choice)%member)%has_failed) known_choice = 0
   end function known_choice

   !> First start, or exact restart; before it, the method that fits what begins here.
   subroutine start(self, t, y, error)
      class(driver_type), intent(inout) :: self
      real(wp), intent(in) :: t    !! [s]
      real(wp), intent(in) :: y(:) !! (n_states)
      type(error_type), allocatable, intent(out) :: error
      integer :: member

      self%t_last = t
      self%y_last = y
      member = self%now
      if (self%begun .and. self%choice%automatic .and. self%motion%events%watches) call reconsider(self, member)
      call start_member(self, member, error)
      self%timed = .false.
   end subroutine start

   !> Which method, at the beginning of a regime or after an event.
   subroutine reconsider(self, member)
      type(driver_type), intent(inout) :: self
      integer, intent(out) :: member
      integer :: known

      known = known_choice(self)
      self%is_delayed = .false.
      self%pace = 0.0_wp
      member = self%now
      if (known > 0) member = self%past_choices(known)%member
      if (known > 0 .and. (self%timed .or. member <= n_even)) then
         call follow(self, known, member)
      else if ((self%timed .and. may_choose(self)) .or. self%members(explicit)%has_failed) then
         call judge_here(self, member)
      else
         self%is_delayed = .true.
         self%why = 'explicit steps after an event'
         member = explicit
      end if
   end subroutine reconsider

   !> The method of an earlier choice.
   subroutine follow(self, known, member)
      type(driver_type), intent(inout) :: self
      integer, intent(in) :: known
      integer, intent(out) :: member
      self%is_delayed = .false.
      self%pace = self%past_choices(known)%pace
      self%why = self%past_choices(known)%reason
      member = self%past_choices(known)%member
   end subroutine follow

   !> Choose again, at the last good state. Where a trial tells nothing, an implicit method that was far ahead the last time is
   !> taken again; its pace is watched.
   subroutine judge_here(self, member)
      type(driver_type), intent(inout) :: self
      integer, intent(out) :: member
      type(method_choice) :: choice

      call judge(self, self%motion, self%t_last, self%y_last, choice, member)
      self%why = choice%reason()
      if (choice%conclusive) return
      self%why = 'explicit steps, until a trial is worth its effort'
      if (last_is_clear(self)) call follow(self, 1, member)
   end subroutine judge_here

   !> Whether an implicit method was far ahead the last time, which is worth a try under other laws, too.
   pure logical function last_is_clear(self)
      type(driver_type), intent(in) :: self
      last_is_clear = size(self%past_choices) > 0
      if (last_is_clear) last_is_clear = self%past_choices(1)%clear .and. .not. self%members(self%past_choices(1)%member)%has_failed
   end function last_is_clear

   !> One more line of the history.
   subroutine add_to_history(self, line)
      type(driver_type), intent(inout) :: self
      character(len=*), intent(in) :: line
      if (self%n_lines < most_lines) self%history = joined(self%history, line, nl)
      if (self%n_lines == most_lines) self%history = joined(self%history, 'and further changes of the method', nl)
      self%n_lines = self%n_lines + 1
   end subroutine add_to_history

   !> Start a member at the last good state; where it fails, another.
   subroutine start_member(self, member, error)
      type(driver_type), intent(inout) :: self
      integer, value :: member
      type(error_type), allocatable, intent(out) :: error

      if (self%begun .and. self%name(member) /= self%name(self%now) .and. .not. self%members(self%now)%has_failed) &
         call add_to_history(self, 'from t = '//time_text(self%t_last)//' s '//self%name(member)//': '//self%why)
      do
         call switch_to(self, member, error)
         if (.not. allocated(error)) then
            call limit_steps(self)
            call self%members(member)%integrator%set_stop(self%t_stop)
            call self%members(member)%integrator%start(self%t_last, self%y_last, error)
         end if
         if (.not. allocated(error)) exit
         if (.not. another_may_help(self, error)) return
         call replace(self, error, member)
         if (allocated(error)) return
      end do
      self%begun = .true.
      if (index(self%used, self%name(member)) > 0) return
      self%used = joined(self%used, self%name(member), ', ')
   end subroutine start_member

   !> Make the integrator of a method that the case names, which may not know how to integrate it: an error before the run.
   subroutine make(self, error)
      class(driver_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      if (.not. self%choice%automatic) call switch_to(self, self%now, error)
   end subroutine make

   !> Put a member in its place, made if it is new. It goes on counting the steps of the run.
   subroutine switch_to(self, member, error)
      type(driver_type), intent(inout) :: self
      integer, intent(in) :: member
      type(error_type), allocatable, intent(out) :: error
      type(solver_options) :: options

      if (member /= self%now) self%spent = effort_of_run(self)
      if (.not. allocated(self%members(member)%integrator)) then
         options = self%choice%options
         if (self%choice%automatic) options%order = candidates(member)%order
         call new_integrator(self%members(member)%integrator, self%motion, self%name(member), options, error)
         if (allocated(error)) return
         if (associated(self%monitor)) call self%members(member)%integrator%set_monitor(self%monitor)
      else if (member == self%now) then
         return
      end if
      self%now = member
      self%members(member)%integrator%n_steps = self%n_steps
      self%effort_begun = effort_of_member(self)
      self%effort_window = self%effort_begun
      self%t_window = self%t_last
   end subroutine switch_to

   !> How far the active member may go until it is looked at.
   subroutine limit_steps(self)
      type(driver_type), intent(inout) :: self
      integer(i8) :: most
      most = self%options%max_steps
      if (self%is_delayed) then
         most = min(most, self%n_steps + ceiling(short_delay/explicit_step))
      else if (self%pace > 0.0_wp) then
         most = min(most, self%n_steps + watch_steps)
      end if
      self%members(self%now)%integrator%options%max_steps = int(most)
   end subroutine limit_steps

   !> Integrate to exactly t_out, or to an event before or at it.
   subroutine advance(self, t_out, y, t, error)
      class(driver_type), intent(inout) :: self
      real(wp), intent(in) :: t_out !! [s]
      real(wp), contiguous, intent(out) :: y(:) !! (n_states)
      real(wp), intent(out) :: t    !! t_out, that of the event, or the last good time [s]
      type(error_type), allocatable, intent(out) :: error

      do
         call self%members(self%now)%integrator%advance(t_out, y, t, error)
         self%n_steps = self%members(self%now)%integrator%n_steps
         if (.not. self%choice%automatic) exit
         if (.not. allocated(error) .or. (t >= self%t_last .and. t <= t_out .and. all(ieee_is_finite(y)))) then
            self%t_last = t
            self%y_last(:) = y
         end if
         if (.not. allocated(error)) exit
         call go_on(self, error)
         if (.not. allocated(error)) cycle
         t = self%t_last
         y = self%y_last
         return
      end do
      associate (integrator => self%members(self%now)%integrator)
         self%at_event = integrator%at_event
         if (self%at_event) self%crossed = integrator%crossed
      end associate
   end subroutine advance

   !> What ends the steps of a member: it is to be looked at, or it has failed.
   subroutine go_on(self, error)
      type(driver_type), intent(inout) :: self
      type(error_type), allocatable, intent(inout) :: error
      integer :: member

      if (.not. another_may_help(self, error)) return
      member = self%now
      if (self%n_steps >= self%members(member)%integrator%options%max_steps) then
         deallocate (error)
         call review(self, member)
         if (member == self%now) then
            call limit_steps(self)
            return
         end if
      else
         call replace(self, error, member)
         if (allocated(error)) return
      end if
      call start_member(self, member, error)
   end subroutine go_on

   !> Whether what has ended the steps is the method's own.
   pure logical function another_may_help(self, error)
      type(driver_type), intent(in) :: self
      type(error_type), intent(in) :: error
      another_may_help = self%choice%automatic .and. error%exit_code /= exit_stopped .and. &
                         self%n_steps < self%options%max_steps
   end function another_may_help

   !> Probation may be over, or BDF be too slow.
   subroutine review(self, member)
      type(driver_type), intent(inout) :: self
      integer, intent(inout) :: member
      real(wp) :: effort
      integer :: known

      effort = effort_of_member(self) - self%effort_window
      if (self%is_delayed) then
         known = known_choice(self)
         if (known > 0) then
            call follow(self, known, member)
         else if (last_is_clear(self)) then
            call follow(self, 1, member)
         else if (effort >= choice_delay .and. may_choose(self)) then
            call judge_here(self, member)
         end if
         return
      end if
      if (self%t_last - self%t_window < effort*self%pace .and. may_choose(self)) call judge_here(self, member)
      self%t_window = self%t_last
      self%effort_window = self%effort_window + effort
   end subroutine review

   !> Whether choices have cost so little that another one can be afforded.
   logical function may_choose(self)
      type(driver_type), intent(inout) :: self
      may_choose = self%tried <= trials_free + trial_share*effort_of_run(self) .and. effort_of_run(self) >= self%next_choice
   end function may_choose

   !> Another method in place of the one at work, which has given up; `error` is left if there is none.
   subroutine replace(self, error, member)
      type(driver_type), intent(inout) :: self
      type(error_type), allocatable, intent(inout) :: error !! why
      integer, intent(inout) :: member !! in: the one that has given up; out: the one to go on with
      character(len=:), allocatable :: line
      integer :: i

      self%members(member)%has_failed = .true.
      self%is_delayed = .false.
      if (allocated(self%cause)) then
         if (self%t_last > self%t_cause) deallocate (self%cause)
      end if
      if (.not. allocated(self%cause)) then
         self%cause = error
         self%t_cause = self%t_last
      end if
      if (.not. any([(suits(self, i), i=1, size(candidates))])) then
         error%message = self%cause%message
         return
      end if
      line = self%name(member)//' gave up ('//error%message//'), '
      deallocate (error)
      call judge_here(self, member)
      line = line//'from t = '//time_text(self%t_last)//' s '//self%name(member)
      self%failures = joined(self%failures, line, nl)
      call add_to_history(self, line)
   end subroutine replace

   !> Whether a candidate may be started now.
   logical function suits(self, member)
      type(driver_type), intent(in) :: self
      integer, intent(in) :: member
      suits = .not. self%members(member)%has_failed
      if (member == collocation) suits = suits .and. self%motion%has_lanes()
   end function suits

   !> Name of a member's method.
   pure function name(self, member)
      class(driver_type), intent(in) :: self
      integer, intent(in) :: member
      character(len=:), allocatable :: name
      name = self%choice%method
      if (self%choice%automatic) name = trim(candidates(member)%method)
   end function name

   !> Effort of the active member, all in all.
   real(wp) function effort_of_member(self)
      type(driver_type), intent(inout) :: self
      effort_of_member = 0.0_wp
      if (.not. allocated(self%members(self%now)%integrator)) return
      effort_of_member = effort_of(self%name(self%now), self%motion%dynamics, &
                                   self%members(self%now)%integrator%statistics())
   end function effort_of_member

   !> Effort of the run so far.
   real(wp) function effort_of_run(self)
      type(driver_type), intent(inout) :: self
      effort_of_run = self%spent + (effort_of_member(self) - self%effort_begun)
   end function effort_of_run

   !> Names of the methods that were used, in order.
   function methods(self) result(text)
      class(driver_type), intent(in) :: self
      character(len=:), allocatable :: text
      text = self%used
      if (len(text) == 0) text = self%choice%method
   end function methods

   !> Why these methods, in words.
   function reason(self) result(text)
      class(driver_type), intent(in) :: self
      character(len=:), allocatable :: text
      text = joined(self%choice%reason(), self%history, nl)
   end function reason

   !> A time that was known before.
   subroutine set_stop(self, t_stop)
      class(driver_type), intent(inout) :: self
      real(wp), intent(in) :: t_stop !! [s]
      self%t_stop = t_stop
      self%timed = .true.
   end subroutine set_stop

   subroutine set_monitor(self, monitor)
      class(driver_type), intent(inout) :: self
      class(monitor_type), target, intent(inout) :: monitor !! must outlive the run
      integer :: i
      self%monitor => monitor
      do i = 1, size(self%members)
         if (allocated(self%members(i)%integrator)) call self%members(i)%integrator%set_monitor(monitor)
      end do
   end subroutine set_monitor

   subroutine check_monitor(self, t, error)
      class(driver_type), intent(inout) :: self
      real(wp), intent(in) :: t !! of the last good state [s]
      type(error_type), allocatable, intent(out) :: error !! a stop was requested
      call self%members(self%now)%integrator%check_monitor(t, error)
   end subroutine check_monitor

   !> Sums over all methods; order and step of the last one.
   function statistics(self) result(stats)
      class(driver_type), intent(inout) :: self
      type(solver_statistics) :: stats, other
      integer :: i

      if (allocated(self%members(self%now)%integrator)) stats = self%members(self%now)%integrator%statistics()
      do i = 1, size(self%members)
         if (i == self%now .or. .not. allocated(self%members(i)%integrator)) cycle
         other = self%members(i)%integrator%statistics()
         stats%n_rhs = stats%n_rhs + other%n_rhs
         stats%n_coupled = stats%n_coupled + other%n_coupled
         stats%n_jac = stats%n_jac + other%n_jac
         stats%n_error_test_failures = stats%n_error_test_failures + other%n_error_test_failures
         stats%n_nonlinear_failures = stats%n_nonlinear_failures + other%n_nonlinear_failures
         stats%n_starts = stats%n_starts + other%n_starts
      end do
   end function statistics

   subroutine finalize(self)
      class(driver_type), intent(inout) :: self
      integer :: i
      do i = 1, size(self%members)
         if (allocated(self%members(i)%integrator)) call self%members(i)%integrator%finalize()
      end do
      nullify (self%motion, self%monitor)
   end subroutine finalize

end module rodyn_driver
