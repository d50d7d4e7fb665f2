!> Like cases side by side in vector lanes, each from its initial state to its end, a lane that is free taking the next one.
!>
!> `rodyn_simulation` for many: the same regimes of loads, exact restarts at their switches, outputs and limits. What
!> comes out of a case does not depend on the others, nor on the lane it was in, nor on when it got there.
module rodyn_ensemble
   use rodyn_kinds, only: wp, i8
   use rodyn_errors, only: error_type, raise, exit_stopped
   use rodyn_text, only: time_text
   use rodyn_integrator, only: solver_options, solver_statistics
   use rodyn_lanes, only: lanes
   use rodyn_lane_dop853, only: lane_dop853, new_lane_dop853, at_nothing, at_output, at_stop, at_failure
   use rodyn_lane_motion, only: lane_motion, new_lane_motion
   use rodyn_run_setup, only: run_setup
   use rodyn_switch_times, only: interval_ends
   implicit none (type, external)
   private
   public :: ensemble_member, ensemble_client, run_ensemble

   !> A case on its way. Extend it by what the client wants to know of it.
   type, extends(run_setup) :: ensemble_member !! without ledger
      type(solver_options) :: options
      real(wp), allocatable :: times(:)    !! increasing, within [0, t_end]: states at these are shown to the client [s]
      real(wp) :: limit = 0.0_wp           !! of `seconds`; 0: none [s]
      real(wp) :: t = 0.0_wp               !! last good time [s]
      real(wp) :: seconds = 0.0_wp         !! its share of the wall time: that of a pass is divided among the lanes in use [s]
      logical :: late = .false.            !! the limit was exceeded
      logical :: has_failed = .false.      !! the method did, not for want of steps
      type(solver_statistics) :: counts
      type(error_type), allocatable :: error !! why it ended early
      real(wp), allocatable, private :: ends(:) !! of the regimes [s]
      integer, private :: segment = 1, next = 1 !! present regime, next of the times
   end type ensemble_member

   !> Who has the cases.
   type, abstract :: ensemble_client
   contains
      procedure(take_interface), deferred :: take
      procedure(observe_interface), deferred :: observe
      procedure(finish_interface), deferred :: finish
      procedure :: stop_requested
   end type ensemble_client

   abstract interface
      !> The next case, alike (`are_alike`) to the first; not associated: there is none for these lanes.
      subroutine take_interface(self, member)
         import :: ensemble_client, ensemble_member
         implicit none (type, external)
         class(ensemble_client), intent(inout) :: self
         class(ensemble_member), pointer, intent(out) :: member
      end subroutine take_interface

      !> State at the next of its times.
      subroutine observe_interface(self, member, t, y, error)
         import :: ensemble_client, ensemble_member, error_type, wp
         implicit none (type, external)
         class(ensemble_client), intent(inout) :: self
         class(ensemble_member), intent(inout) :: member
         real(wp), intent(in) :: t    !! [s]
         real(wp), intent(in) :: y(:) !! (n_states)
         type(error_type), allocatable, intent(out) :: error !! allocated: the case has failed
      end subroutine observe_interface

      !> A case has ended. It is the client's to deallocate.
      subroutine finish_interface(self, member)
         import :: ensemble_client, ensemble_member
         implicit none (type, external)
         class(ensemble_client), intent(inout) :: self
         class(ensemble_member), pointer, intent(inout) :: member
      end subroutine finish_interface
   end interface

   type :: slot
      class(ensemble_member), pointer :: member => null()
   end type slot

   !> An ensemble at work.
   type :: ensemble_type
      type(lane_motion) :: motion
      type(lane_dop853) :: integrator
      type(slot) :: slots(lanes)
      integer(i8) :: clock = 0            !! up to which time has been shared out [counts]
      integer(i8) :: clock_look = 0       !! at the last look [counts]
      integer :: stride = 1, to_look = 1  !! passes from look to look at the clock
      logical :: stopped = .false.
      real(wp), allocatable :: y(:)       !! workspace
   end type ensemble_type

contains

   !> Not before all cases are done, unless the client says otherwise.
   function stop_requested(self) result(requested)
      class(ensemble_client), intent(inout) :: self
      logical :: requested
      associate (unused => self); end associate
      requested = .false.
   end function stop_requested

   !> Integrate what the client has, until it has no more.
   subroutine run_ensemble(client)
      class(ensemble_client), intent(inout) :: client
      type(ensemble_type), target :: ensemble
      class(ensemble_member), pointer :: first

      call client%take(first)
      if (.not. associated(first)) return
      call new_lane_motion(ensemble%motion, first%motion%dynamics%scene)
      call new_lane_dop853(ensemble%integrator, ensemble%motion)
      allocate (ensemble%y(2*ensemble%motion%n_dof))
      call system_clock(ensemble%clock)
      call occupy(ensemble, client, 1, first)
      do
         if (.not. ensemble%stopped) call fill_slots(ensemble, client)
         if (all_empty(ensemble)) exit
         call ensemble%integrator%try()
         call handle_events(ensemble, client)
         call look(ensemble, client)
      end do
   end subroutine run_ensemble

   pure logical function all_empty(ensemble)
      type(ensemble_type), intent(in) :: ensemble
      integer :: lane
      all_empty = .true.
      do lane = 1, lanes
         if (associated(ensemble%slots(lane)%member)) all_empty = .false.
      end do
   end function all_empty

   !> Put cases into the lanes that are free.
   subroutine fill_slots(ensemble, client)
      type(ensemble_type), intent(inout) :: ensemble
      class(ensemble_client), intent(inout) :: client
      class(ensemble_member), pointer :: member
      integer :: lane

      do lane = 1, lanes
         do while (.not. associated(ensemble%slots(lane)%member)) ! a case may fail at once
            call share_time(ensemble)
            call client%take(member)
            call system_clock(ensemble%clock)
            if (.not. associated(member)) return
            call occupy(ensemble, client, lane, member)
         end do
      end do
   end subroutine fill_slots

   !> Start a case in a lane.
   subroutine occupy(ensemble, client, lane, member)
      type(ensemble_type), intent(inout) :: ensemble
      class(ensemble_client), intent(inout) :: client
      integer, intent(in) :: lane
      class(ensemble_member), pointer, intent(inout) :: member

      ensemble%slots(lane)%member => member
      member%ends = interval_ends(member%motion%switches, member%t_end)
      member%t = 0.0_wp
      member%segment = 1
      member%next = 1
      call ensemble%motion%put(lane, member%motion%dynamics%scene)
      call set_regime(ensemble, lane)
      if (wanted(member) <= 0.0_wp) call show(ensemble, client, lane, 0.0_wp, member%y)
      if (allocated(member%error)) then
         call free_slot(ensemble, client, lane)
         return
      end if
      call ensemble%integrator%enter(lane, member%options, 0.0_wp, member%y, member%ends(1), wanted(member))
      call handle_event(ensemble, client, lane)
   end subroutine occupy

   !> The next output of the present regime; huge: none [s].
   pure real(wp) function wanted(member)
      class(ensemble_member), intent(in) :: member
      wanted = huge(1.0_wp)
      if (member%next > size(member%times)) return
      if (member%times(member%next) <= member%ends(member%segment)) wanted = member%times(member%next)
   end function wanted

   !> Make the loads of the present regime act, in the lane and in what the client sees.
   subroutine set_regime(ensemble, lane)
      type(ensemble_type), intent(inout) :: ensemble
      integer, intent(in) :: lane
      associate (member => ensemble%slots(lane)%member)
         call member%motion%dynamics%set_regime(member%t, member%ends(member%segment))
         call ensemble%motion%set_regime(lane, member%motion%dynamics%regime)
      end associate
   end subroutine set_regime

   subroutine handle_events(ensemble, client)
      type(ensemble_type), intent(inout) :: ensemble
      class(ensemble_client), intent(inout) :: client
      integer :: lane
      do lane = 1, lanes
         if (ensemble%integrator%event(lane) /= at_nothing) call handle_event(ensemble, client, lane)
      end do
   end subroutine handle_events

   !> Whatever has happened in a lane, until it goes on or is free.
   subroutine handle_event(ensemble, client, lane)
      type(ensemble_type), intent(inout) :: ensemble
      class(ensemble_client), intent(inout) :: client
      integer, intent(in) :: lane

      associate (integrator => ensemble%integrator, member => ensemble%slots(lane)%member)
         do
            select case (integrator%event(lane))
            case (at_output)
               call integrator%state(lane, ensemble%y)
               call show(ensemble, client, lane, integrator%time(lane), ensemble%y)
               if (.not. allocated(member%error)) call integrator%proceed(lane, wanted(member))
            case (at_stop)
               if (member%segment == size(member%ends)) then
                  call free_slot(ensemble, client, lane)
                  return
               end if
               member%t = integrator%time(lane)
               member%segment = member%segment + 1
               call set_regime(ensemble, lane)
               call integrator%restart(lane, member%ends(member%segment), wanted(member))
            case (at_failure)
               call raise(member%error, integrator%failure(lane))
               member%counts = integrator%statistics(lane)
               member%has_failed = member%counts%n_steps < member%options%max_steps
            case default
               return
            end select
            if (allocated(member%error)) then
               call free_slot(ensemble, client, lane)
               return
            end if
         end do
      end associate
   end subroutine handle_event

   !> Show the client a state.
   subroutine show(ensemble, client, lane, t, y)
      type(ensemble_type), intent(inout) :: ensemble
      class(ensemble_client), intent(inout) :: client
      integer, intent(in) :: lane
      real(wp), intent(in) :: t, y(:)
      associate (member => ensemble%slots(lane)%member)
         call client%observe(member, t, y, member%error)
         member%next = member%next + 1
      end associate
   end subroutine show

   !> Hand a case back to the client.
   subroutine free_slot(ensemble, client, lane)
      type(ensemble_type), intent(inout) :: ensemble
      class(ensemble_client), intent(inout) :: client
      integer, intent(in) :: lane

      call share_time(ensemble)
      associate (member => ensemble%slots(lane)%member, integrator => ensemble%integrator)
         member%counts = integrator%statistics(lane)
         if (member%counts%n_starts > 0) then
            member%t = integrator%time(lane)
            call integrator%state(lane, member%y)
         end if
         call integrator%leave(lane)
         call ensemble%motion%release(lane)
      end associate
      call client%finish(ensemble%slots(lane)%member)
      nullify (ensemble%slots(lane)%member)
      call system_clock(ensemble%clock)
   end subroutine free_slot

   !> Divide the time since the last call among the lanes in use.
   subroutine share_time(ensemble)
      type(ensemble_type), intent(inout) :: ensemble
      integer(i8) :: now, rate
      real(wp) :: share
      integer :: lane, n

      call system_clock(now, rate)
      n = 0
      do lane = 1, lanes
         if (associated(ensemble%slots(lane)%member)) n = n + 1
      end do
      share = real(now - ensemble%clock, wp)/real(rate, wp)/max(1, n)
      ensemble%clock = now
      do lane = 1, lanes
         if (.not. associated(ensemble%slots(lane)%member)) cycle
         associate (member => ensemble%slots(lane)%member)
            member%seconds = member%seconds + share
         end associate
      end do
   end subroutine share_time

   !> About every 20 ms: has a case used up its time, does the client want an end?
   subroutine look(ensemble, client)
      type(ensemble_type), intent(inout) :: ensemble
      class(ensemble_client), intent(inout) :: client
      integer, parameter :: longest_stride = 4096
      integer(i8) :: rate
      real(wp) :: since_look
      integer :: lane

      ensemble%to_look = ensemble%to_look - 1
      if (ensemble%to_look > 0) return
      call share_time(ensemble)
      call system_clock(count_rate=rate)
      since_look = real(ensemble%clock - ensemble%clock_look, wp)/real(rate, wp)
      if (since_look > 0.04_wp) then
         ensemble%stride = max(1, ensemble%stride/4)
      else if (since_look < 0.01_wp) then
         ensemble%stride = min(longest_stride, 2*ensemble%stride)
      end if
      ensemble%clock_look = ensemble%clock
      ensemble%to_look = ensemble%stride
      if (.not. ensemble%stopped) ensemble%stopped = client%stop_requested()
      do lane = 1, lanes
         if (.not. associated(ensemble%slots(lane)%member)) cycle
         associate (member => ensemble%slots(lane)%member)
            member%late = member%limit > 0.0_wp .and. member%seconds > member%limit
            if (.not. (ensemble%stopped .or. member%late)) cycle
            call raise(member%error, 'stopped on request at t = '//time_text(ensemble%integrator%time(lane))//' s', exit_stopped)
         end associate
         call free_slot(ensemble, client, lane)
      end do
   end subroutine look

end module rodyn_ensemble
