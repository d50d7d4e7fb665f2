!> Events of a running scene: hinges that are released, latch, meet stops, slide or stick.
!>
!> What an integrator watches are the margins of `rodyn_hinge_mechanism`, one for each part that a hinge has. When one becomes
!> negative the run stops there, `respond` changes the laws, and it starts anew. A hinge that becomes a constraint
!> changes the rates in no time: momenta stay, energy is lost (`rodyn_velocity_jump`).
module rodyn_hinge_events
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type, raise
   use rodyn_text, only: to_text
   use rodyn_integrator, only: time_text
   use rodyn_hinge_mechanism, only: hinge_mechanism, kind_names, kind_released, kind_latched, n_parts, &
      part_spring, part_lower, part_upper, part_friction, part_latch
   use rodyn_hinge_law, only: hinge_law, hinge_state, initial_joints, openings
   use rodyn_case_config, only: none_given
   use rodyn_accelerations, only: dynamics_type
   implicit none (type, external)
   private
   public :: hinge_event, event_set, new_event_set

   integer, parameter :: most_passes = 8     !! of laws that follow each other at one time
   integer, parameter :: crowd = 32          !! events of one hinge in no time are chatter
   real(wp), parameter :: no_time = 1.0e-8_wp !! of the simulated time

   !> Something that a hinge did.
   type :: hinge_event
      real(wp) :: time = 0.0_wp !! [s]
      integer :: hinge = 0      !! 0..n-1
      integer :: kind = 0       !! of `kind_names`
      real(wp) :: energy_lost = 0.0_wp !! [J]
   end type hinge_event

   !> What is watched, and what has happened.
   type :: event_set
      logical :: watches = .false.      !! some hinge has a mechanism
      integer :: n = 0                  !! margins
      integer, allocatable :: mechanism(:), part(:) !! of each margin
      type(hinge_event), allocatable :: log(:)      !! events so far (n_logged of them)
      integer :: n_logged = 0
      integer :: most = huge(1)         !! events of a run
      real(wp) :: worked = 0.0_wp       !! by drives of locked hinges in impacts, so far [J]
      real(wp) :: span = 0.0_wp         !! simulated time of the run [s]
      real(wp), allocatable, dimension(:) :: theta, theta_rate, moment, moment_rate !! workspace
   contains
      procedure :: margins
      procedure :: begin
      procedure :: adopt
      procedure :: respond
      procedure :: release_due
      procedure :: settle
      procedure :: note
   end type event_set

contains

   !> The margins of a scene's hinges.
   subroutine new_event_set(events, law)
      type(event_set), intent(out) :: events
      type(hinge_law), intent(in) :: law
      integer :: i, part

      allocate (events%log(0), events%mechanism(0), events%part(0))
      events%watches = size(law%mechanisms) > 0
      if (.not. events%watches) return
      do i = 1, size(law%mechanisms)
         do part = 1, n_parts
            if (.not. has_part(law%mechanisms(i), part)) cycle
            events%mechanism = [events%mechanism, i]
            events%part = [events%part, part]
         end do
      end do
      events%n = size(events%part)
      allocate (events%theta(0:law%n - 1), events%theta_rate(0:law%n - 1), events%moment(0:law%n), &
                events%moment_rate(0:law%n), source=0.0_wp)
   end subroutine new_event_set

   !> Does the mechanism have this part?
   pure logical function has_part(mechanism, part)
      type(hinge_mechanism), intent(in) :: mechanism
      integer, intent(in) :: part
      select case (part)
      case (part_spring)
         has_part = mechanism%freeplay > 0.0_wp
      case (part_lower, part_upper)
         has_part = abs(mechanism%stop(part - part_lower + 1)) < none_given
      case (part_friction)
         has_part = mechanism%friction > 0.0_wp
      case default
         has_part = mechanism%latch < none_given
      end select
   end function has_part

   !> Joint rotations and rates into the workspace.
   subroutine find_joints(self, dynamics, t, q, p)
      class(event_set), intent(inout) :: self
      type(dynamics_type), intent(inout) :: dynamics
      real(wp), intent(in) :: t, q(:), p(:)

      call dynamics%move_kinks(t)
      associate (scene => dynamics%scene, first => dynamics%scene%n_base + 1)
         call hinge_state(scene%hinges, scene%n, scene%dynamic_bending, q(first:), p(first:), self%theta, self%theta_rate, &
                          self%moment, self%moment_rate)
      end associate
   end subroutine find_joints

   !> All margins at a time and state.
   subroutine margins(self, dynamics, t, q, p, margin)
      class(event_set), intent(inout) :: self
      type(dynamics_type), intent(inout) :: dynamics
      real(wp), intent(in) :: t, q(:), p(:)
      real(wp), intent(out) :: margin(:) !! (n)
      integer :: i

      call find_joints(self, dynamics, t, q, p)
      do i = 1, self%n
         margin(i) = margin_of(self, dynamics, i, t)
      end do
   end subroutine margins

   !> One margin at a time and the joints of the workspace.
   pure real(wp) function margin_of(self, dynamics, i, t)
      class(event_set), intent(in) :: self
      type(dynamics_type), intent(in) :: dynamics
      integer, intent(in) :: i !! margin
      real(wp), intent(in) :: t
      associate (mechanism => dynamics%scene%hinges%mechanisms(self%mechanism(i)))
         margin_of = mechanism%margin(self%part(i), t, self%theta(mechanism%hinge), self%theta_rate(mechanism%hinge))
      end associate
   end function margin_of

   !> Locks and laws at the start. Massless rods are held unbent; the rotations of relaxing hinges, which are part of q, follow.
   subroutine begin(self, dynamics, q, p, error)
      class(event_set), intent(inout) :: self
      type(dynamics_type), intent(inout) :: dynamics
      real(wp), intent(inout) :: q(:)
      real(wp), intent(in) :: p(:)
      type(error_type), allocatable, intent(out) :: error
      real(wp), dimension(0:dynamics%scene%n - 1) :: at, turning
      integer :: i

      call find_joints(self, dynamics, 0.0_wp, q, p)
      at = self%theta
      turning = self%theta_rate
      if (dynamics%scene%quasistatic) then
         call openings(dynamics%scene%n, .false., q(dynamics%scene%n_base + 1:), at)
         call openings(dynamics%scene%n, .false., p(dynamics%scene%n_base + 1:), turning)
         at = at - dynamics%scene%hinges%kink
         turning = turning - dynamics%scene%hinges%kink_rate
      end if
      do i = 1, size(dynamics%scene%hinges%mechanisms)
         associate (mechanism => dynamics%scene%hinges%mechanisms(i))
            associate (theta => self%theta(mechanism%hinge), rate => self%theta_rate(mechanism%hinge))
               call mechanism%settle(theta, rate)
               if (mechanism%held .and. mechanism%release_time > 0.0_wp) then
                  call mechanism%lock(theta)
                  if (mechanism%is_constrained()) call mechanism%lock(at(mechanism%hinge))
                  if (mechanism%is_constrained() .and. abs(turning(mechanism%hinge)) > 1.0e-9_wp) &
                     call raise(error, 'hinge '//to_text(mechanism%hinge)//' is held, but turns at the start')
               end if
               if (mechanism%latch < none_given) mechanism%latch_side = merge(1, -1, mechanism%latch > theta)
            end associate
         end associate
         if (allocated(error)) return
      end do
      call dynamics%change_hinges()
      associate (scene => dynamics%scene)
         if (size(scene%hinges%relaxing) > 0) &
            call initial_joints(scene%hinges, q(scene%phi_at() + 1:scene%phi_at() + scene%n), at, q(scene%n_dof + 1:))
      end associate
   end subroutine begin

   !> Choose the laws anew at a state to which no motion led; what is locked stays so. An equilibrium beyond a latch is none.
   subroutine adopt(self, dynamics, t, q, p, changed, error)
      class(event_set), intent(inout) :: self
      type(dynamics_type), intent(inout) :: dynamics
      real(wp), intent(in) :: t, q(:), p(:)
      logical, intent(out) :: changed !! some hinge has another law
      type(error_type), allocatable, intent(out) :: error
      real(wp), dimension(0:dynamics%scene%n - 1) :: stiffness, constant ! of T = C th + constant at rest
      integer :: i

      call find_joints(self, dynamics, t, q, p)
      stiffness = dynamics%scene%hinges%stiffness
      constant = dynamics%scene%hinges%constant + dynamics%scene%hinges%friction
      do i = 1, size(dynamics%scene%hinges%mechanisms)
         associate (mechanism => dynamics%scene%hinges%mechanisms(i))
            if (mechanism%is_constrained()) cycle
            associate (theta => self%theta(mechanism%hinge), rate => self%theta_rate(mechanism%hinge))
               call mechanism%settle(theta, rate)
               if (mechanism%margin(part_latch, t, theta, rate) < 0.0_wp) call raise(error, &
                  'no equilibrium: hinge '//to_text(mechanism%hinge)//' latches before the chain comes to rest')
            end associate
         end associate
         if (allocated(error)) return
      end do
      call dynamics%change_hinges(error)
      changed = any(abs(stiffness - dynamics%scene%hinges%stiffness) > 0.0_wp) .or. &
                any(abs(constant - (dynamics%scene%hinges%constant + dynamics%scene%hinges%friction)) > 0.0_wp)
   end subroutine adopt

   !> Change the laws whose margins became negative. The rates p change if a hinge becomes a constraint.
   subroutine respond(self, dynamics, t, q, p, crossed, lost, error)
      class(event_set), intent(inout) :: self
      type(dynamics_type), intent(inout) :: dynamics
      real(wp), intent(in) :: t, q(:)
      real(wp), intent(inout) :: p(:)
      logical, intent(in) :: crossed(:)  !! (n)
      real(wp), intent(out) :: lost      !! energy [J]
      type(error_type), allocatable, intent(out) :: error
      integer :: i

      lost = 0.0_wp
      call find_joints(self, dynamics, t, q, p)
      do i = 1, self%n
         if (.not. crossed(i)) cycle
         call change_part(self, dynamics, i, t, q, p, lost, error)
         if (allocated(error)) return
      end do
      call dynamics%change_hinges()
      call self%settle(dynamics, t, q, p, lost, error)
   end subroutine respond

   !> What follows when a margin has become negative.
   subroutine change_part(self, dynamics, i, t, q, p, lost, error)
      class(event_set), intent(inout) :: self
      type(dynamics_type), intent(inout) :: dynamics
      integer, intent(in) :: i !! margin
      real(wp), intent(in) :: t, q(:)
      real(wp), intent(inout) :: p(:)
      real(wp), intent(inout) :: lost
      type(error_type), allocatable, intent(inout) :: error
      if (self%part(i) == part_latch) then
         call latch(self, dynamics, self%mechanism(i), t, q, p, lost, error)
      else
         call change_law(self, dynamics, i, t, lost, error)
      end if
   end subroutine change_part

   !> Take the other law of one part.
   subroutine change_law(self, dynamics, i, t, lost, error)
      class(event_set), intent(inout) :: self
      type(dynamics_type), intent(inout) :: dynamics
      integer, intent(in) :: i !! margin
      real(wp), intent(in) :: t
      real(wp), intent(inout) :: lost
      type(error_type), allocatable, intent(inout) :: error
      real(wp) :: lost_here
      integer :: kind

      associate (mechanism => dynamics%scene%hinges%mechanisms(self%mechanism(i)))
         call mechanism%change(self%part(i), t, self%theta(mechanism%hinge), self%theta_rate(mechanism%hinge), kind, lost_here)
         call self%note(t, mechanism%hinge, kind, lost_here, error)
      end associate
      lost = lost + lost_here
   end subroutine change_law

   !> Lock a hinge for good, and release those that wait for it.
   subroutine latch(self, dynamics, which, t, q, p, lost, error)
      class(event_set), intent(inout) :: self
      type(dynamics_type), intent(inout) :: dynamics
      integer, intent(in) :: which
      real(wp), intent(in) :: t, q(:)
      real(wp), intent(inout) :: p(:)
      real(wp), intent(inout) :: lost
      type(error_type), allocatable, intent(inout) :: error
      real(wp) :: lost_here, worked
      logical :: ok
      integer :: hinge

      lost_here = 0.0_wp
      hinge = dynamics%scene%hinges%mechanisms(which)%hinge
      dynamics%scene%hinges%mechanisms(which)%latch_side = 0
      call dynamics%scene%hinges%mechanisms(which)%lock(self%theta(hinge))
      if (dynamics%scene%hinges%mechanisms(which)%is_constrained()) then
         call dynamics%change_hinges()
         call dynamics%strike(q, p, lost_here, worked, ok)
         if (.not. ok) call raise(error, 'latching at t = '//time_text(t)//' s: mass matrix not positive definite')
         if (allocated(error)) return
         self%worked = self%worked + worked
         call find_joints(self, dynamics, t, q, p)
      end if
      lost = lost + lost_here
      call self%note(t, hinge, kind_latched, lost_here, error)
      call release(self, dynamics, dynamics%scene%hinges%mechanisms%release_after == hinge, t, lost, error)
   end subroutine latch

   !> Release those of some hinges that are locked.
   subroutine release(self, dynamics, due, t, lost, error)
      class(event_set), intent(inout) :: self
      type(dynamics_type), intent(inout) :: dynamics
      logical, intent(in) :: due(:) !! of each mechanism
      real(wp), intent(in) :: t
      real(wp), intent(inout) :: lost
      type(error_type), allocatable, intent(inout) :: error
      real(wp) :: lost_here
      integer :: i

      do i = 1, size(due)
         associate (mechanism => dynamics%scene%hinges%mechanisms(i))
            if (.not. mechanism%locked .or. .not. due(i) .or. allocated(error)) cycle
            call mechanism%release(self%theta(mechanism%hinge), lost_here)
            lost = lost + lost_here
            call self%note(t, mechanism%hinge, kind_released, lost_here, error)
         end associate
      end do
   end subroutine release

   !> Release the hinges whose time has come.
   subroutine release_due(self, dynamics, t, q, p, lost, error)
      class(event_set), intent(inout) :: self
      type(dynamics_type), intent(inout) :: dynamics
      real(wp), intent(in) :: t, q(:), p(:)
      real(wp), intent(inout) :: lost
      type(error_type), allocatable, intent(inout) :: error

      call find_joints(self, dynamics, t, q, p)
      call release(self, dynamics, dynamics%scene%hinges%mechanisms%release_time <= t, t, lost, error)
      call dynamics%change_hinges()
   end subroutine release_due

   !> Follow a jump of the state: change laws until all margins are positive.
   subroutine settle(self, dynamics, t, q, p, lost, error)
      class(event_set), intent(inout) :: self
      type(dynamics_type), intent(inout) :: dynamics
      real(wp), intent(in) :: t, q(:)
      real(wp), intent(inout) :: p(:)
      real(wp), intent(inout) :: lost
      type(error_type), allocatable, intent(inout) :: error
      integer :: i, pass
      logical :: changed

      do pass = 1, most_passes
         if (allocated(error)) return
         call find_joints(self, dynamics, t, q, p)
         changed = .false.
         do i = 1, self%n
            if (.not. margin_of(self, dynamics, i, t) < 0.0_wp) cycle
            changed = .true.
            call change_part(self, dynamics, i, t, q, p, lost, error)
            if (allocated(error)) return
         end do
         if (.not. changed) return
         call dynamics%change_hinges()
      end do
   end subroutine settle

   !> Take down an event. Too many of them, in all or in no time, are an error.
   subroutine note(self, t, hinge, kind, lost, error)
      class(event_set), intent(inout) :: self
      real(wp), intent(in) :: t
      integer, intent(in) :: hinge, kind
      real(wp), intent(in) :: lost !! [J]
      type(error_type), allocatable, intent(inout) :: error
      type(hinge_event), allocatable :: longer(:)
      integer :: i, found

      if (self%n_logged == size(self%log)) then
         allocate (longer(max(64, 2*self%n_logged)))
         longer(:self%n_logged) = self%log(:self%n_logged)
         call move_alloc(longer, self%log)
      end if
      self%n_logged = self%n_logged + 1
      self%log(self%n_logged) = hinge_event(t, hinge, kind, lost)
      if (self%n_logged > self%most) then
         call raise(error, 'max_events = '//to_text(self%most)//' reached at t = '//time_text(t)//' s; the last one: hinge '// &
                    to_text(hinge)//' '//trim(kind_names(kind)))
         return
      end if
      found = 0
      do i = self%n_logged, 1, -1
         if (self%log(i)%time < t - no_time*self%span) return
         if (self%log(i)%hinge /= hinge) cycle
         found = found + 1
         if (found < crowd) cycle
         call raise(error, 'events accumulate at t = '//time_text(t)//' s: hinge '//to_text(hinge)//' had '//to_text(crowd)// &
                    ' within '//time_text(max(t - self%log(i)%time, tiny(t)))//' s, the last one '//trim(kind_names(kind))// &
                    '; softer stops, more damping or a larger friction_velocity may help')
         return
      end do
   end subroutine note

end module rodyn_hinge_events
