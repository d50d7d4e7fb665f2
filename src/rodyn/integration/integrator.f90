!> What every integrator offers: start, advance to a time exactly, stop times that are never crossed.
!>
!> A run is one or more intervals between switches of the loads. Each interval is `set_stop(t_stop)`,
!> `start(t, y)` and any number of `advance(t_out, ...)` with t_out <= t_stop:
!>
!>     call integrator%set_stop(t_switch)
!>     call integrator%start(t, y, error)
!>     do i = 1, size(times)
!>        call integrator%advance(times(i), y, t, error)
!>        if (allocated(error)) exit        ! t, y: the last good time and state
!>     end do
!>
!> The output times never influence the steps: they are found from the steps, not stepped to.
module rodyn_integrator
   use rodyn_kinds, only: wp, i8
   use rodyn_errors, only: error_type, raise, exit_stopped
   use rodyn_methods, only: solver_options
   use rodyn_ode, only: ode_system
   use rodyn_pace, only: pace_type
   use rodyn_text, only: time_text
   implicit none (type, external)
   private
   public :: integrator_type, stepping_integrator, solver_options, solver_statistics, monitor_type
   public :: tightened, cannot_evaluate

   !> Why a step of a mechanical system cannot be made.
   character(len=*), parameter :: cannot_evaluate = &
      'the right-hand side could not be evaluated (mass matrix not positive definite, or not finite)'

   !> Counts over the whole run, restarts included.
   type :: solver_statistics
      integer(i8) :: n_steps = 0               !! internal steps
      integer(i8) :: n_rhs = 0                 !! right-hand-side evaluations
      integer(i8) :: n_coupled = 0             !! of them, those of collocation while dampers couple its modes
      integer(i8) :: n_jac = 0                 !! Jacobians
      integer(i8) :: n_error_test_failures = 0 !! steps repeated because the error was too large
      integer(i8) :: n_nonlinear_failures = 0  !! failures of the nonlinear iteration
      integer(i8) :: n_starts = 0              !! starts and restarts
      integer :: last_order = 0                !! order of the last step
      real(wp) :: last_step = 0.0_wp           !! [s]
   end type solver_statistics

   !> Someone who watches a run: called about five times a second of wall time.
   type, abstract :: monitor_type
   contains
      procedure :: report
      procedure :: stop_requested
   end type monitor_type

   !> An initial value solver for one system.
   type, abstract :: integrator_type
      class(ode_system), pointer :: system => null()    !! not owned; must outlive the integrator
      class(monitor_type), pointer :: monitor => null() !! not owned
      type(solver_options) :: options
      real(wp) :: t_stop = -huge(1.0_wp)  !! no right-hand side is evaluated beyond it [s]
      real(wp) :: t_good = 0.0_wp         !! end of the last good internal step [s]
      real(wp), allocatable :: y_good(:)  !! state there (n_states)
      integer(i8) :: n_steps = 0          !! internal steps of the whole run
      integer(i8) :: n_starts = 0
      logical :: goes_on = .false.        !! the last start was from its own last state, whose lost digits may still be known
      logical :: at_event = .false.       !! the last `advance` ended at an event, the system must respond, and `start` follow
      logical :: pending = .false.        !! the steps have met an event, at t_good
      logical, allocatable :: crossed(:)  !! the event functions that became negative there (n_events)
      real(wp), allocatable :: margin(:)  !! event functions at the end of the last step (n_events)
      type(pace_type), private :: step_pace
      integer(i8), private :: clock_report = 0, clock_look = 0 !! wall clock at the last report, the last look [counts]
      integer, private :: steps_to_look = 1, stride = 1        !! the clock is read every `stride` steps and outputs
   contains
      procedure(start_interface), deferred :: start
      procedure(advance_interface), deferred :: advance
      procedure(statistics_interface), deferred :: statistics
      procedure(finalize_interface), deferred :: finalize
      procedure :: set_stop
      procedure :: set_monitor
      procedure :: begin_interval
      procedure :: check_target
      procedure :: permit_step
      procedure :: check_monitor
      procedure :: count_as_steps
      procedure :: state_within
   end type integrator_type

   !> One whose steps go past the times that are asked for: an output lies inside the last step.
   type, abstract, extends(integrator_type) :: stepping_integrator
   contains
      procedure :: advance => advance_by_steps
      procedure(step_interface), deferred :: step     !! one accepted step, not past the stop time
      procedure(output_interface), deferred :: output !! the state inside the last step
   end type stepping_integrator

   abstract interface
      !> First start, and every exact restart: forget the history and begin at (t, y). `set_stop` comes before.
      subroutine start_interface(self, t, y, error)
         import :: integrator_type, error_type, wp
         implicit none (type, external)
         class(integrator_type), intent(inout) :: self
         real(wp), intent(in) :: t    !! [s]
         real(wp), intent(in) :: y(:) !! (n_states)
         type(error_type), allocatable, intent(out) :: error
      end subroutine start_interface

      !> Integrate to exactly t_out, or to an event before or at it (`at_event`).
      !> On failure `error` is allocated and t, y are the last good internal time and state.
      subroutine advance_interface(self, t_out, y, t, error)
         import :: integrator_type, error_type, wp
         implicit none (type, external)
         class(integrator_type), intent(inout) :: self
         real(wp), intent(in) :: t_out !! not before the previous one, not after the stop time [s]
         real(wp), contiguous, intent(out) :: y(:) !! (n_states)
         real(wp), intent(out) :: t    !! t_out, that of the event, or the last good time [s]
         type(error_type), allocatable, intent(out) :: error
      end subroutine advance_interface

      subroutine step_interface(self, error)
         import :: stepping_integrator, error_type
         implicit none (type, external)
         class(stepping_integrator), intent(inout) :: self
         type(error_type), allocatable, intent(out) :: error
      end subroutine step_interface

      subroutine output_interface(self, t, y, error)
         import :: stepping_integrator, error_type, wp
         implicit none (type, external)
         class(stepping_integrator), intent(inout) :: self
         real(wp), intent(in) :: t !! [s]
         real(wp), contiguous, intent(out) :: y(:) !! (n_states)
         type(error_type), allocatable, intent(inout) :: error
      end subroutine output_interface

      function statistics_interface(self) result(stats)
         import :: integrator_type, solver_statistics
         implicit none (type, external)
         class(integrator_type), intent(inout) :: self
         type(solver_statistics) :: stats
      end function statistics_interface

      !> Release everything; may be called twice.
      subroutine finalize_interface(self)
         import :: integrator_type
         implicit none (type, external)
         class(integrator_type), intent(inout) :: self
      end subroutine finalize_interface
   end interface

   real(wp), parameter :: report_interval = 0.2_wp !! wall time between two reports [s]

contains

   !> Options with tolerances that make the steps shorter by a factor. A tolerance bounds the error of one step; those of all steps
   !> add up, from one period of a vibration to the next. Each method says with which steps the error at the end stays below
   !> 100 rtol in ordinary scenes (docs/stability.md). Not below what rounding allows.
   pure function tightened(options, factor, power) result(inner)
      type(solver_options), intent(in) :: options !! the user's
      real(wp), intent(in) :: factor              !! of the steps, < 1
      integer, intent(in) :: power                !! of the step in the error that is tested
      type(solver_options) :: inner
      real(wp), parameter :: least_rtol = 1.0e-13_wp
      real(wp) :: share

      share = max(factor**power, min(1.0_wp, least_rtol/options%rtol))
      inner = options
      inner%rtol = share*options%rtol
      inner%atol = share*options%atol
   end function tightened

   !> How far the run has come: nothing is made of it, unless a monitor says otherwise.
   subroutine report(self, t, n_steps)
      class(monitor_type), intent(inout) :: self
      real(wp), intent(in) :: t          !! simulated time reached [s]
      integer(i8), intent(in) :: n_steps !! internal steps so far
      associate (unused => self, unused_t => t, unused_n => n_steps); end associate
   end subroutine report

   !> Never, unless a monitor says otherwise. When true, `advance` ends with exit code `exit_stopped`.
   function stop_requested(self) result(requested)
      class(monitor_type), intent(in) :: self
      logical :: requested
      associate (unused => self); end associate
      requested = .false.
   end function stop_requested

   !> The next time that must not be crossed: a switch of a load, or the end.
   subroutine set_stop(self, t_stop)
      class(integrator_type), intent(inout) :: self
      real(wp), intent(in) :: t_stop !! [s]
      self%t_stop = t_stop
   end subroutine set_stop

   subroutine set_monitor(self, monitor)
      class(integrator_type), intent(inout) :: self
      class(monitor_type), target, intent(inout) :: monitor !! must outlive the run
      self%monitor => monitor
   end subroutine set_monitor

   !> Note the start of an interval; refuse a state that is no state. For use by `start` of every integrator.
   subroutine begin_interval(self, t, y, error)
      class(integrator_type), intent(inout) :: self
      real(wp), intent(in) :: t    !! [s]
      real(wp), intent(in) :: y(:) !! (n_states)
      type(error_type), allocatable, intent(out) :: error

      if (.not. associated(self%system)) then
         call raise(error, 'start: the integrator has no system')
      else if (size(y) /= self%system%n_states) then
         call raise(error, 'start: wrong number of states')
      else if (.not. all(abs(y) <= huge(y))) then
         call raise(error, 'start at t = '//time_text(t)//' s: the initial state is not finite')
      else if (self%t_stop < t) then
         call raise(error, 'start at t = '//time_text(t)//' s: the stop time '//time_text(self%t_stop)//' s lies before it')
      end if
      if (allocated(error)) return
      self%goes_on = self%n_starts > 0
      if (self%goes_on) self%goes_on = .not. any(abs(self%y_good - y) > 0.0_wp)
      self%t_good = t
      self%y_good = y
      self%n_starts = self%n_starts + 1
      call self%step_pace%begin(self%n_steps, t)
      self%at_event = .false.
      self%pending = .false.
      associate (n => self%system%n_events)
         if (n == 0) return
         if (.not. allocated(self%margin)) allocate (self%margin(n), self%crossed(n))
         call self%system%event_functions(t, self%y_good, self%margin)
      end associate
   end subroutine begin_interval

   !> Refuse an output time beyond the stop time, or an integrator that was never started.
   subroutine check_target(self, t_out, error)
      class(integrator_type), intent(in) :: self
      real(wp), intent(in) :: t_out !! [s]
      type(error_type), allocatable, intent(out) :: error
      if (self%n_starts == 0) then
         call raise(error, 'advance: the integrator was not started')
      else if (.not. t_out <= self%t_stop) then
         call raise(error, 'advance to t = '//time_text(t_out)//' s: beyond the stop time '//time_text(self%t_stop)//' s')
      end if
   end subroutine check_target

   subroutine advance_by_steps(self, t_out, y, t, error)
      class(stepping_integrator), intent(inout) :: self
      real(wp), intent(in) :: t_out !! not after the stop time [s]
      real(wp), contiguous, intent(out) :: y(:) !! (n_states)
      real(wp), intent(out) :: t    !! t_out, that of an event, or the last good time [s]
      type(error_type), allocatable, intent(out) :: error

      call self%check_target(t_out, error)
      do while (.not. allocated(error) .and. self%t_good < t_out .and. .not. self%pending)
         call self%step(error)
      end do
      self%at_event = self%pending .and. self%t_good <= t_out
      if (.not. allocated(error) .and. t_out < self%t_good) then
         t = t_out
         call self%output(t_out, y, error)
         if (.not. allocated(error)) return
      end if
      t = self%t_good
      y(:) = self%y_good
   end subroutine advance_by_steps

   !> The state at a time within the last internal step, as accurate as the steps. For `rodyn_event_search`.
   subroutine state_within(self, t, y, ok)
      class(integrator_type), intent(inout) :: self
      real(wp), intent(in) :: t                 !! [s]
      real(wp), contiguous, intent(out) :: y(:) !! (n_states)
      logical, intent(out) :: ok
      associate (unused_t => t); end associate
      y = self%y_good
      ok = .false.
   end subroutine state_within

   !> Called before each internal step: counts it, refuses one too many, gives up without progress, lets the
   !> monitor speak and stop the run.
   subroutine permit_step(self, error)
      class(integrator_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error !! max_steps reached, no progress, or a stop was requested
      character(len=:), allocatable :: refusal

      call self%step_pace%judge(self%n_steps, self%options%max_steps, self%t_good, self%t_stop, refusal)
      if (allocated(refusal)) then
         call raise(error, refusal)
         return
      end if
      call self%check_monitor(self%t_good, error)
      if (.not. allocated(error)) self%n_steps = self%n_steps + 1
   end subroutine permit_step

   !> Let the monitor speak and stop the run. Called before each internal step and after each output, of which there may be
   !> any number in a step.
   subroutine check_monitor(self, t, error)
      class(integrator_type), intent(inout) :: self
      real(wp), intent(in) :: t                           !! of the last good state [s]
      type(error_type), allocatable, intent(out) :: error !! a stop was requested

      if (.not. associated(self%monitor)) return
      self%steps_to_look = self%steps_to_look - 1
      if (self%steps_to_look > 0) return
      call look_at_clock(self, t)
      if (self%monitor%stop_requested()) call raise(error, 'stopped on request at t = '//time_text(t)//' s', exit_stopped)
   end subroutine check_monitor

   !> Within a step, or an output, there was other work, about that of so many steps: the monitor is asked so much earlier.
   subroutine count_as_steps(self, n)
      class(integrator_type), intent(inout) :: self
      integer, intent(in) :: n
      self%steps_to_look = max(1, self%steps_to_look - n)
   end subroutine count_as_steps

   !> Report when it is time, and choose how many steps and outputs to make until the next look: about 20 ms of them.
   subroutine look_at_clock(self, t)
      class(integrator_type), intent(inout) :: self
      real(wp), intent(in) :: t !! [s]
      integer, parameter :: longest_stride = 4096
      integer(i8) :: now, rate
      real(wp) :: since_look

      call system_clock(now, rate)
      since_look = real(now - self%clock_look, wp)/real(rate, wp)
      if (since_look > 0.04_wp) then
         self%stride = max(1, self%stride/4)
      else if (since_look < 0.01_wp) then
         self%stride = min(longest_stride, 2*self%stride)
      end if
      self%clock_look = now
      self%steps_to_look = self%stride
      if (real(now - self%clock_report, wp) < report_interval*real(rate, wp)) return
      self%clock_report = now
      call self%monitor%report(t, self%n_steps)
   end subroutine look_at_clock

end module rodyn_integrator
