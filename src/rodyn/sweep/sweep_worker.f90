!> Computes cases of a sweep as they are handed out: like ones side by side in vector lanes, others one by one.
!>
!> Which of the two it is depends on the sweep and the case alone. A case that may go in lanes does so also when no other is
!> there, so that its bytes never depend on ranks, shards or what was computed before.
module rodyn_sweep_worker
   use rodyn_kinds, only: wp, i8
   use rodyn_ensemble, only: ensemble_client, ensemble_member, run_ensemble
   use rodyn_errors, only: error_type
   use rodyn_lane_dop853, only: suits_lane_dop853
   use rodyn_lane_scene, only: are_alike, suits_lanes
   use rodyn_lanes, only: lanes
   use rodyn_driver, only: driver_type
   use rodyn_method_choice, only: method_choice
   use rodyn_methods, only: method_named, method_type
   use rodyn_scene, only: scene_type
   use rodyn_sweep_case, only: case_result, case_shape, clear_result, conclude_case, integrate_case, keep_final, keeper_type, &
      prepare_case, poller_type
   use rodyn_sweep_config, only: sweep_config
   use rodyn_sweep_plan, only: fewest_alike, sweep_plan
   use rodyn_text, only: to_text
   implicit none (type, external)
   private
   public :: case_feed, run_cases, lanes_text, uses_lanes

   integer, parameter :: worthwhile = 4            !! like cases: fewer are faster one by one
   integer, parameter :: most_waiting = 4*lanes    !! cases that wait for others of their kind

   !> Hands out cases and takes their results.
   type, extends(poller_type), abstract :: case_feed
   contains
      procedure(next_interface), deferred :: next
      procedure(keep_interface), deferred :: keep
   end type case_feed

   abstract interface
      !> The next case to compute; 0: none.
      subroutine next_interface(self, ticket, case)
         import :: case_feed
         implicit none (type, external)
         class(case_feed), intent(inout) :: self
         integer, intent(out) :: ticket !! the feed's number of it
         integer, intent(out) :: case
      end subroutine next_interface

      !> What came of a case. One that was stopped has no result.
      subroutine keep_interface(self, ticket, kept, stop_now)
         import :: case_feed, case_result
         implicit none (type, external)
         class(case_feed), intent(inout) :: self
         integer, intent(in) :: ticket
         type(case_result), intent(inout) :: kept
         logical, intent(out) :: stop_now
      end subroutine keep_interface
   end interface

   !> A case that goes in a lane.
   type, extends(ensemble_member) :: lane_case
      integer :: ticket = 0
      type(case_result) :: kept
      type(keeper_type) :: keeper
      type(method_choice) :: choice
      real(wp) :: preparation = 0.0_wp !! wall time before the integration [s]
   end type lane_case

   !> What was done on a case.
   type :: work_type
      integer(i8) :: n_steps = 0, n_rhs = 0
      real(wp) :: wall_seconds = 0.0_wp        !! [s]
      real(wp) :: integration_seconds = 0.0_wp !! [s]
   end type work_type

   type(work_type), parameter :: no_work = work_type()

   type :: queued
      type(lane_case), pointer :: case => null()
   end type queued

   !> Between the feed and the lanes.
   type, extends(ensemble_client) :: worker_type
      type(sweep_config), pointer :: sweep => null()
      type(sweep_plan), pointer :: plan => null()
      type(case_shape), pointer :: shape => null()
      class(case_feed), pointer :: feed => null()
      type(scene_type), allocatable :: kind  !! of the cases in the lanes now; not allocated: none
      type(queued) :: waiting(most_waiting)  !! cases of other kinds
      integer :: n_waiting = 0
      logical :: in_lanes = .true.           !! the sweep uses lanes
      logical :: ended = .false.             !! the feed has no more cases
      logical :: stopped = .false.
   contains
      procedure :: take
      procedure :: observe
      procedure :: finish
      procedure :: stop_requested
   end type worker_type

contains

   !> May cases of this sweep go side by side?
   pure logical function uses_lanes(sweep, plan)
      type(sweep_config), intent(in) :: sweep
      type(sweep_plan), intent(in) :: plan
      uses_lanes = .false.
      if (sweep%lanes .and. sweep%integrate .and. .not. hinges_move(sweep)) uses_lanes = fewest_alike(sweep, plan) >= worthwhile
   end function uses_lanes

   !> Do hinges have switches and events of their own, which differ from case to case?
   pure logical function hinges_move(sweep)
      type(sweep_config), intent(in) :: sweep
      hinges_move = size(sweep%base_case%kink_programs) + size(sweep%base_case%hinges) > 0
   end function hinges_move

   !> The same in words.
   function lanes_text(sweep, plan) result(text)
      type(sweep_config), intent(in) :: sweep
      type(sweep_plan), intent(in) :: plan
      character(len=:), allocatable :: text
      if (.not. sweep%integrate) then
         text = 'none (nothing is integrated)'
      else if (uses_lanes(sweep, plan)) then
         text = 'like cases by dop853 side by side in '//to_text(lanes)//' lanes, others one by one'
      else if (sweep%lanes .and. hinges_move(sweep)) then
         text = 'one by one (hinges move by programs or have events)'
      else if (sweep%lanes) then
         text = 'one by one (too few cases are alike)'
      else
         text = 'one by one'
      end if
   end function lanes_text

   !> Compute all that the feed has.
   subroutine run_cases(sweep, plan, shape, feed)
      type(sweep_config), target, intent(in) :: sweep
      type(sweep_plan), target, intent(in) :: plan
      type(case_shape), target, intent(in) :: shape
      class(case_feed), target, intent(inout) :: feed
      type(worker_type), target :: worker
      integer :: i

      worker%sweep => sweep
      worker%plan => plan
      worker%shape => shape
      worker%feed => feed
      worker%in_lanes = uses_lanes(sweep, plan)
      do while (.not. worker%stopped .and. .not. (worker%ended .and. worker%n_waiting == 0))
         call run_ensemble(worker)
         if (allocated(worker%kind)) deallocate (worker%kind)
      end do
      do i = 1, worker%n_waiting
         deallocate (worker%waiting(i)%case)
      end do
   end subroutine run_cases

   !> The next case of the kind that is in the lanes. Others that the feed has meanwhile wait, and when too many do, the
   !> lanes run empty for them.
   subroutine take(self, member)
      class(worker_type), intent(inout) :: self
      class(ensemble_member), pointer, intent(out) :: member
      type(lane_case), pointer :: new

      nullify (member)
      call take_waiting(self, new)
      do while (.not. associated(new))
         if (self%ended .or. self%stopped .or. self%n_waiting == most_waiting) return
         call prepare_next(self, new)
         if (.not. associated(new)) cycle
         if (.not. allocated(self%kind)) exit
         if (are_alike(self%kind, new%motion%dynamics%scene)) exit
         self%n_waiting = self%n_waiting + 1
         self%waiting(self%n_waiting)%case => new
         nullify (new)
      end do
      if (.not. allocated(self%kind)) self%kind = new%motion%dynamics%scene
      member => new
   end subroutine take

   !> The first of the waiting cases that is of the right kind.
   subroutine take_waiting(self, found)
      class(worker_type), intent(inout) :: self
      type(lane_case), pointer, intent(out) :: found
      integer :: i

      nullify (found)
      if (self%stopped) return
      do i = 1, self%n_waiting
         if (allocated(self%kind)) then
            if (.not. are_alike(self%kind, self%waiting(i)%case%motion%dynamics%scene)) cycle
         end if
         found => self%waiting(i)%case
         self%waiting(i:self%n_waiting - 1) = self%waiting(i + 1:self%n_waiting)
         nullify (self%waiting(self%n_waiting)%case)
         self%n_waiting = self%n_waiting - 1
         return
      end do
   end subroutine take_waiting

   !> Take a case from the feed and prepare it.
   subroutine prepare_next(self, new)
      class(worker_type), intent(inout) :: self
      type(lane_case), pointer, intent(out) :: new !! not associated: none for a lane
      integer :: ticket, case

      nullify (new)
      call self%feed%poll(self%stopped)
      if (self%stopped) return
      call self%feed%next(ticket, case)
      self%ended = case == 0
      if (.not. self%ended) call begin_case(self, ticket, case, self%in_lanes, no_work, new)
   end subroutine prepare_next

   !> Prepare a case. If it cannot go in a lane, compute it at once.
   subroutine begin_case(self, ticket, case, in_lanes, before, new)
      class(worker_type), intent(inout) :: self
      integer, intent(in) :: ticket, case
      logical, intent(in) :: in_lanes !! it may
      type(work_type), intent(in) :: before !! on this case; its time is part of what the case may take
      type(lane_case), pointer, intent(out) :: new !! not associated: none for a lane
      type(driver_type) :: driver
      type(error_type), allocatable :: error
      integer(i8) :: clock_start, clock_end, rate
      logical :: late, stop_now

      call system_clock(clock_start, rate)
      clock_start = clock_start - nint(before%wall_seconds*real(rate, wp), i8)
      allocate (new)
      new%ticket = ticket
      call clear_result(new%kept, self%shape, case)
      new%keeper%kept => new%kept
      call prepare_case(self%sweep, self%plan, self%shape, case, self%feed, clock_start, new%run_setup, new%times, new%keeper, &
                        driver, late, error)
      if (.not. allocated(error) .and. self%sweep%integrate) then
         new%choice = driver%choice
         new%options = driver%choice%options
         new%limit = self%sweep%case_seconds
         if (in_lanes .and. goes_in_lane(new)) then
            call system_clock(clock_end)
            new%preparation = real(clock_end - clock_start, wp)/real(rate, wp)
            return
         end if
         call integrate_case(self%sweep, driver, new%run_setup, new%times, self%feed, clock_start, new%keeper, late, error)
      end if
      call system_clock(clock_end)
      associate (kept => new%kept)
         kept%wall_seconds = real(clock_end - clock_start, wp)/real(rate, wp)
         kept%n_steps = kept%n_steps + before%n_steps
         kept%n_rhs = kept%n_rhs + before%n_rhs
         kept%integration_seconds = kept%integration_seconds + before%integration_seconds
         call conclude_case(self%sweep, new%keeper, late, error, kept)
         call self%feed%keep(ticket, kept, stop_now)
      end associate
      self%stopped = self%stopped .or. stop_now
      deallocate (new)
   end subroutine begin_case

   pure logical function goes_in_lane(case)
      type(lane_case), intent(in) :: case
      type(method_type) :: method
      method = method_named(case%choice%method)
      goes_in_lane = .false.
      if (method%in_lanes .and. suits_lane_dop853(case%choice%options)) &
         goes_in_lane = suits_lanes(case%motion%dynamics%scene, case%motion%dynamics%hinges)
   end function goes_in_lane

   subroutine observe(self, member, t, y, error)
      class(worker_type), intent(inout) :: self
      class(ensemble_member), intent(inout) :: member
      real(wp), intent(in) :: t, y(:)
      type(error_type), allocatable, intent(out) :: error
      associate (unused => self); end associate
      select type (member)
      type is (lane_case)
         call member%keeper%observe(member%motion, t, y, error)
      end select
   end subroutine observe

   !> Keep what came of a case. Where `dop853` gave up and was chosen by `auto`, the case is computed again by itself.
   subroutine finish(self, member)
      class(worker_type), intent(inout) :: self
      class(ensemble_member), pointer, intent(inout) :: member
      type(lane_case), pointer :: none
      logical :: stop_now

      select type (member)
      type is (lane_case)
         associate (kept => member%kept)
            kept%t_reached = member%t
            kept%n_steps = member%counts%n_steps
            kept%n_rhs = member%counts%n_rhs
            kept%integration_seconds = member%seconds
            kept%wall_seconds = member%preparation + member%seconds
            if (member%has_failed .and. member%choice%automatic) then
               call begin_case(self, member%ticket, kept%case, .false., work_type(kept%n_steps, kept%n_rhs, kept%wall_seconds, &
                                                                                  kept%integration_seconds), none)
            else
               if (.not. allocated(member%error)) call keep_final(member, member%keeper, member%error)
               call conclude_case(self%sweep, member%keeper, member%late, member%error, kept)
               call self%feed%keep(member%ticket, kept, stop_now)
               self%stopped = self%stopped .or. stop_now
            end if
         end associate
      end select
      deallocate (member)
   end subroutine finish

   function stop_requested(self) result(requested)
      class(worker_type), intent(inout) :: self
      logical :: requested
      if (.not. self%stopped) call self%feed%poll(self%stopped)
      requested = self%stopped
   end function stop_requested

end module rodyn_sweep_worker
