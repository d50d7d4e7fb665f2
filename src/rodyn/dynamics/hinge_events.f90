!> Events of a running scene: hinges that are released, latch, meet stops, slide or stick.
!>
!> What an integrator watches are the margins of `rodyn_hinge_mechanism`, one for each part that a hinge has. When one becomes
!> negative the run stops there, `respond` changes the laws, and it restarts. A hinge that becomes a constraint
!> changes the rates in no time: momenta stay, energy is lost (`velocity_jump` of `rodyn_accelerations`).
!>
!> Between massless rods the joints follow from their laws (`rodyn_three_moments`), and the laws hold for joints: both are sought
!> together, at the start and after every jump (`balance`). All laws are monotone, so there is one answer, that of least
!> potential energy. Laws that do not hold are changed for those next to them, all at once while that leads on quickly;
!> then always only the first in a fixed order, which cannot go round in circles and ends (Murty, Linear complementarity,
!> linear and nonlinear programming, 1988, ch. 4: the least-index method).
module rodyn_hinge_events
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type, raise
   use rodyn_text, only: to_text, time_text
   use rodyn_hinge_mechanism, only: hinge_mechanism, kind_names, kind_released, kind_latched, &
      part_spring, part_lower, part_upper, part_friction, part_latch
   use rodyn_hinge_law, only: hinge_law, hinge_state, initial_joints, openings
   use rodyn_accelerations, only: dynamics_type
   use rodyn_kinematics, only: elastic_energy
   implicit none (type, external)
   private
   public :: hinge_event, event_set, new_event_set

   integer, parameter :: quick_passes = 16         !! of `balance`, in which laws change together
   integer, parameter :: most_passes = 100000      !! in all
   integer, parameter :: chatter_count = 32        !! events of one hinge in no time are chatter
   real(wp), parameter :: chatter_span = 1.0e-8_wp !! of the simulated time

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
      integer :: n_series = 0           !! the first ones: of laws on which joints between massless rods depend at once
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
      procedure :: check_latches
      procedure :: respond
      procedure :: release_due
      procedure :: follow
      procedure :: note
   end type event_set

contains

   !> The margins of a scene's hinges.
   subroutine new_event_set(events, law)
      type(event_set), intent(out) :: events
      type(hinge_law), intent(in) :: law

      allocate (events%log(0), events%mechanism(0), events%part(0))
      events%watches = size(law%mechanisms) > 0
      if (.not. events%watches) return
      call add(in_series=.true., parts=[part_spring, part_lower, part_upper])
      events%n_series = size(events%part)
      call add(in_series=.true., parts=[part_friction])
      call add(in_series=.false., parts=[part_friction, part_spring, part_lower, part_upper]) ! each after what decides on it
      call add(in_series=.true., parts=[part_latch])
      call add(in_series=.false., parts=[part_latch])
      events%n = size(events%part)
      allocate (events%theta(0:law%n - 1), events%theta_rate(0:law%n - 1), events%moment(0:law%n), &
                events%moment_rate(0:law%n), source=0.0_wp)

   contains

      !> Margins of some parts of all hinges whose rotation follows from the others, or is a coordinate.
      subroutine add(in_series, parts)
         logical, intent(in) :: in_series
         integer, intent(in) :: parts(:)
         integer :: i, j

         do i = 1, size(law%mechanisms)
            associate (mechanism => law%mechanisms(i))
               if ((law%quasistatic .and. .not. any(law%relaxing == mechanism%hinge)) .neqv. in_series) cycle
               do j = 1, size(parts)
                  if (.not. mechanism%has_part(parts(j))) cycle
                  events%mechanism = [events%mechanism, i]
                  events%part = [events%part, parts(j)]
               end do
            end associate
         end do
      end subroutine add

   end subroutine new_event_set

   !> Joint rotations and rates into the workspace.
   subroutine find_joints(self, dynamics, t, q, p)
      class(event_set), intent(inout) :: self
      type(dynamics_type), intent(inout) :: dynamics
      real(wp), intent(in) :: t, q(:), p(:)

      call dynamics%move_kinks(t)
      associate (scene => dynamics%scene, first => dynamics%scene%n_base + 1)
         call hinge_state(dynamics%hinges, scene%n, scene%dynamic_bending, q(first:), p(first:), self%theta, self%theta_rate, &
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
      associate (mechanism => dynamics%hinges%mechanisms(self%mechanism(i)))
         margin_of = mechanism%margin(self%part(i), t, self%theta(mechanism%hinge), self%theta_rate(mechanism%hinge))
      end associate
   end function margin_of

   !> Locks and laws at the start, found together with the joints. Rotations of relaxing hinges, which are part of q, follow.
   subroutine begin(self, dynamics, q, p, error)
      class(event_set), intent(inout) :: self
      type(dynamics_type), intent(inout) :: dynamics
      real(wp), intent(inout) :: q(:)
      real(wp), intent(in) :: p(:)
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: at(0:dynamics%scene%n - 1)
      integer :: i, pass
      logical :: changed

      call hold(self, dynamics, q, p, at, error)
      if (allocated(error)) return
      do pass = 1, most_passes
         call rest_joints(self, dynamics, at, q, p)
         call correct_laws(self, dynamics, 0.0_wp, pass, changed)
         if (.not. changed) exit
      end do
      if (changed) call raise(error, no_balance(0.0_wp))
      do i = 1, size(dynamics%hinges%mechanisms)
         associate (mechanism => dynamics%hinges%mechanisms(i))
            call mechanism%face_latch(self%theta(mechanism%hinge))
         end associate
      end do
   end subroutine begin

   !> Lock what is held, massless rods unbent, with the laws that hold there. Other hinges begin with the laws that they would have.
   subroutine hold(self, dynamics, q, p, at, error)
      class(event_set), intent(inout) :: self
      type(dynamics_type), intent(inout) :: dynamics
      real(wp), intent(in) :: q(:), p(:)
      real(wp), intent(out) :: at(0:) !! th of all hinges between unbent massless rods, or as it is (0:n-1) [rad]
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: turning(0:dynamics%scene%n - 1)
      integer :: i

      call find_joints(self, dynamics, 0.0_wp, q, p)
      at = self%theta
      turning = self%theta_rate
      associate (scene => dynamics%scene)
         if (scene%quasistatic) then
            call openings(scene%n, .false., q(scene%n_base + 1:), at)
            call openings(scene%n, .false., p(scene%n_base + 1:), turning)
            at = at - dynamics%hinges%kink
            turning = turning - dynamics%hinges%kink_rate
         end if
      end associate
      do i = 1, size(dynamics%hinges%mechanisms)
         associate (mechanism => dynamics%hinges%mechanisms(i), k => dynamics%hinges%mechanisms(i)%hinge)
            mechanism%is_held = mechanism%held .and. mechanism%release_time > 0.0_wp
            if (mechanism%is_held) call mechanism%lock(at(k))
            if (mechanism%is_constrained() .and. abs(turning(k)) > 1.0e-9_wp) then
               call raise(error, 'hinge '//to_text(k)//' is held but has an initial rate')
               return
            end if
            call mechanism%choose_laws(at(k), merge(0.0_wp, turning(k), dynamics%scene%quasistatic))
         end associate
      end do
      call dynamics%change_hinges()
   end subroutine hold

   !> Joints at the start into the workspace; relaxing ones are at rest in their balance, and become part of q.
   subroutine rest_joints(self, dynamics, at, q, p)
      class(event_set), intent(inout) :: self
      type(dynamics_type), intent(inout) :: dynamics
      real(wp), intent(in) :: at(0:) !! th of locked hinges (0:n-1) [rad]
      real(wp), intent(inout) :: q(:)
      real(wp), intent(in) :: p(:)

      associate (scene => dynamics%scene, relaxing => dynamics%hinges%relaxing)
         if (size(relaxing) > 0) &
            call initial_joints(dynamics%hinges, q(scene%phi_at() + 1:scene%phi_at() + scene%n), at, q(scene%n_dof + 1:))
         call find_joints(self, dynamics, 0.0_wp, q, p)
         self%theta_rate(relaxing) = 0.0_wp
      end associate
   end subroutine rest_joints

   !> Choose the laws again at a state to which no motion led; what is locked stays so.
   subroutine adopt(self, dynamics, t, q, p, changed)
      class(event_set), intent(inout) :: self
      type(dynamics_type), intent(inout) :: dynamics
      real(wp), intent(in) :: t, q(:), p(:)
      logical, intent(out) :: changed !! some hinge has another law
      real(wp), dimension(0:dynamics%scene%n - 1) :: stiffness, constant ! of T = C th + constant at rest
      integer :: i

      call find_joints(self, dynamics, t, q, p)
      stiffness = dynamics%hinges%stiffness
      constant = dynamics%hinges%constant + dynamics%hinges%friction
      do i = 1, size(dynamics%hinges%mechanisms)
         associate (mechanism => dynamics%hinges%mechanisms(i))
            if (mechanism%is_constrained()) cycle
            call mechanism%choose_laws(self%theta(mechanism%hinge), self%theta_rate(mechanism%hinge))
         end associate
      end do
      call dynamics%change_hinges()
      changed = any(abs(stiffness - dynamics%hinges%stiffness) > 0.0_wp) .or. &
                any(abs(constant - (dynamics%hinges%constant + dynamics%hinges%friction)) > 0.0_wp)
   end subroutine adopt

   !> Refuse a state beyond a latch, to which no motion leads.
   subroutine check_latches(self, dynamics, t, q, p, error)
      class(event_set), intent(inout) :: self
      type(dynamics_type), intent(inout) :: dynamics
      real(wp), intent(in) :: t, q(:), p(:)
      type(error_type), allocatable, intent(out) :: error
      integer :: i

      call find_joints(self, dynamics, t, q, p)
      do i = 1, self%n
         if (self%part(i) /= part_latch .or. margin_of(self, dynamics, i, t) >= 0.0_wp) cycle
         call raise(error, 'no equilibrium: hinge '//to_text(dynamics%hinges%mechanisms(self%mechanism(i))%hinge)// &
                    ' latches before the chain comes to rest')
         return
      end do
   end subroutine check_latches

   !> Change the laws whose margins became negative. The rates p change if a hinge becomes a constraint.
   subroutine respond(self, dynamics, t, q, p, crossed, lost, error)
      class(event_set), intent(inout) :: self
      type(dynamics_type), intent(inout) :: dynamics
      real(wp), intent(in) :: t, q(:)
      real(wp), intent(inout) :: p(:)
      logical, intent(in) :: crossed(:)  !! (n)
      real(wp), intent(out) :: lost      !! energy [J]
      type(error_type), allocatable, intent(out) :: error
      type(hinge_mechanism) :: was
      integer :: i

      lost = 0.0_wp
      call find_joints(self, dynamics, t, q, p)
      do i = 1, self%n
         if (.not. crossed(i)) cycle
         if (self%part(i) == part_latch) then
            if (dynamics%hinges%mechanisms(self%mechanism(i))%at_latch) cycle ! leaves it, see `settle`
            call latch(self, dynamics, self%mechanism(i), t, q, p, lost, error)
         else
            associate (mechanism => dynamics%hinges%mechanisms(self%mechanism(i)))
               was = mechanism
               call mechanism%change(self%part(i), t, self%theta(mechanism%hinge), self%theta_rate(mechanism%hinge))
            end associate
            call note_part(self, dynamics, i, was, t, lost, error)
         end if
         if (allocated(error)) return
      end do
      call dynamics%change_hinges()
      call self%follow(dynamics, t, q, p, lost, error)
   end subroutine respond

   !> Take down what happened to the part of a margin.
   subroutine note_part(self, dynamics, i, was, t, lost, error)
      class(event_set), intent(inout) :: self
      type(dynamics_type), intent(in) :: dynamics
      integer, intent(in) :: i !! margin
      type(hinge_mechanism), intent(in) :: was
      real(wp), intent(in) :: t
      real(wp), intent(inout) :: lost !! is added to [J]
      type(error_type), allocatable, intent(inout) :: error
      integer, allocatable :: kinds(:)
      real(wp) :: lost_here
      integer :: j

      call dynamics%hinges%mechanisms(self%mechanism(i))%list_events(was, self%part(i), self%theta(was%hinge), kinds, &
                                                                           lost_here)
      do j = 1, size(kinds)
         if (allocated(error)) return
         call self%note(t, was%hinge, kinds(j), merge(lost_here, 0.0_wp, j == size(kinds)), error)
      end do
      lost = lost + lost_here
   end subroutine note_part

   !> Lock a hinge for good. Its rate, if it has one, is gone at once.
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

      lost_here = 0.0_wp
      call dynamics%hinges%mechanisms(which)%lock_at_latch()
      call dynamics%change_hinges()
      if (dynamics%hinges%mechanisms(which)%is_constrained()) then
         call dynamics%apply_impulse(q, p, lost_here, worked, ok)
         if (.not. ok) call raise(error, 'latching at t = '//time_text(t)//' s: mass matrix not positive definite')
         if (allocated(error)) return
         self%worked = self%worked + worked
         call find_joints(self, dynamics, t, q, p)
      end if
      lost = lost + lost_here
      call self%note(t, dynamics%hinges%mechanisms(which)%hinge, kind_latched, lost_here, error)
   end subroutine latch

   !> Release the hinges whose time has come.
   subroutine release_due(self, dynamics, t, q, p, lost, error)
      class(event_set), intent(inout) :: self
      type(dynamics_type), intent(inout) :: dynamics
      real(wp), intent(in) :: t, q(:)
      real(wp), intent(inout) :: p(:)
      real(wp), intent(inout) :: lost
      type(error_type), allocatable, intent(inout) :: error
      logical :: released
      call release(self, dynamics, dynamics%hinges%mechanisms%release_time <= t, t, q, p, lost, released, error)
      call release_followers(self, dynamics, t, q, p, lost, error)
   end subroutine release_due

   !> Release those that wait for a hinge that has latched, and those that wait for them.
   subroutine release_followers(self, dynamics, t, q, p, lost, error)
      class(event_set), intent(inout) :: self
      type(dynamics_type), intent(inout) :: dynamics
      real(wp), intent(in) :: t, q(:)
      real(wp), intent(inout) :: p(:)
      real(wp), intent(inout) :: lost
      type(error_type), allocatable, intent(inout) :: error
      logical :: due(size(dynamics%hinges%mechanisms)), released
      integer :: i

      released = .true.
      do while (released)
         associate (mechanisms => dynamics%hinges%mechanisms)
            due = [(any(mechanisms%hinge == mechanisms(i)%release_after .and. mechanisms%latched), i=1, size(due))]
         end associate
         call release(self, dynamics, due, t, q, p, lost, released, error)
      end do
   end subroutine release_followers

   !> Release those of some hinges that are held. Between massless rods joints jump then; what that costs belongs to the
   !> (last) release.
   subroutine release(self, dynamics, due, t, q, p, lost, released, error)
      class(event_set), intent(inout) :: self
      type(dynamics_type), intent(inout) :: dynamics
      logical, intent(in) :: due(:) !! of each mechanism
      real(wp), intent(in) :: t, q(:)
      real(wp), intent(inout) :: p(:)
      real(wp), intent(inout) :: lost
      logical, intent(out) :: released !! some were
      type(error_type), allocatable, intent(inout) :: error
      real(wp) :: before, lost_here, lost_in_all, in_jump
      integer :: i, last

      released = any(due .and. dynamics%hinges%mechanisms%is_held) .and. .not. allocated(error)
      if (.not. released) return
      call find_joints(self, dynamics, t, q, p)
      before = elastic_energy(dynamics%scene, dynamics%hinges, q, p)
      lost_in_all = 0.0_wp
      do i = 1, size(due)
         associate (mechanism => dynamics%hinges%mechanisms(i))
            if (.not. (due(i) .and. mechanism%is_held)) cycle
            call mechanism%release(self%theta(mechanism%hinge), lost_here)
            lost_in_all = lost_in_all + lost_here
            call self%note(t, mechanism%hinge, kind_released, lost_here, error)
         end associate
      end do
      last = self%n_logged
      call dynamics%change_hinges()
      call settle(self, dynamics, t, q, p, lost_in_all, error)
      if (dynamics%scene%quasistatic) then
         in_jump = max((before - elastic_energy(dynamics%scene, dynamics%hinges, q, p)) - lost_in_all, 0.0_wp)
         self%log(last)%energy_lost = self%log(last)%energy_lost + in_jump
         lost_in_all = lost_in_all + in_jump
      end if
      lost = lost + lost_in_all
   end subroutine release

   !> Follow a jump of the state: `settle`, and release what waits for hinges that have latched. The workspace holds the joints
   !> before the jump.
   subroutine follow(self, dynamics, t, q, p, lost, error)
      class(event_set), intent(inout) :: self
      type(dynamics_type), intent(inout) :: dynamics
      real(wp), intent(in) :: t, q(:)
      real(wp), intent(inout) :: p(:)
      real(wp), intent(inout) :: lost
      type(error_type), allocatable, intent(inout) :: error
      call settle(self, dynamics, t, q, p, lost, error)
      call release_followers(self, dynamics, t, q, p, lost, error)
   end subroutine follow

   !> Bring laws and joints to agree after a jump. A joint that would pass its latch stays there; of several the one that comes
   !> to it first on the straight way.
   subroutine settle(self, dynamics, t, q, p, lost, error)
      class(event_set), intent(inout) :: self
      type(dynamics_type), intent(inout) :: dynamics
      real(wp), intent(in) :: t, q(:)
      real(wp), intent(inout) :: p(:)
      real(wp), intent(inout) :: lost
      type(error_type), allocatable, intent(inout) :: error
      type(hinge_mechanism), allocatable :: was(:)
      real(wp) :: before(0:dynamics%scene%n - 1)
      integer :: i

      was = dynamics%hinges%mechanisms
      before = self%theta
      do
         if (.not. allocated(error)) call balance(self, dynamics, t, q, p, error)
         if (allocated(error)) return
         i = first_latch(self, dynamics, before, t)
         if (i == 0) exit
         associate (mechanism => dynamics%hinges%mechanisms(i))
            if (dynamics%scene%quasistatic .and. .not. mechanism%lock_stiffness > 0.0_wp) &
               call mechanism%choose_laws(mechanism%latch_angle, 0.0_wp) ! its springs stay as they are there
         end associate
         call latch(self, dynamics, i, t, q, p, lost, error)
      end do
      do i = 1, size(was)
         associate (mechanism => dynamics%hinges%mechanisms(i))
            if (mechanism%at_latch .and. .not. mechanism%locked) call mechanism%face_latch(self%theta(mechanism%hinge))
         end associate
      end do
      do i = 1, self%n
         call note_part(self, dynamics, i, was(self%mechanism(i)), t, lost, error)
         if (allocated(error)) return
      end do
   end subroutine settle

   !> The mechanism that passes its latch first on the straight way of the joints; 0: none does.
   pure integer function first_latch(self, dynamics, before, t) result(first)
      class(event_set), intent(in) :: self !! joints after the jump
      type(dynamics_type), intent(in) :: dynamics
      real(wp), intent(in) :: before(0:) !! th before (0:n-1) [rad]
      real(wp), intent(in) :: t
      real(wp) :: way, shortest
      integer :: i

      first = 0
      shortest = huge(1.0_wp)
      do i = 1, self%n
         if (self%part(i) /= part_latch) cycle
         if (.not. margin_of(self, dynamics, i, t) < 0.0_wp) cycle
         associate (mechanism => dynamics%hinges%mechanisms(self%mechanism(i)))
            if (mechanism%at_latch) cycle
            way = (mechanism%latch_angle - before(mechanism%hinge))/(self%theta(mechanism%hinge) - before(mechanism%hinge))
            if (first > 0 .and. .not. way < shortest) cycle
            first = self%mechanism(i)
            shortest = way
         end associate
      end do
   end function first_latch

   !> Change laws until all hold for the joints that follow from them, which are in the workspace then.
   subroutine balance(self, dynamics, t, q, p, error)
      class(event_set), intent(inout) :: self
      type(dynamics_type), intent(inout) :: dynamics
      real(wp), intent(in) :: t, q(:), p(:)
      type(error_type), allocatable, intent(inout) :: error
      integer :: pass
      logical :: changed

      do pass = 1, most_passes
         call find_joints(self, dynamics, t, q, p)
         call correct_laws(self, dynamics, t, pass, changed)
         if (.not. changed) return
      end do
      call raise(error, no_balance(t))
   end subroutine balance

   !> Change laws that do not hold for the joints of the workspace: one of each hinge, first those on which joints depend; after
   !> some passes only the first of all.
   subroutine correct_laws(self, dynamics, t, pass, changed)
      class(event_set), intent(inout) :: self
      type(dynamics_type), intent(inout) :: dynamics
      real(wp), intent(in) :: t
      integer, intent(in) :: pass
      logical, intent(out) :: changed
      logical :: moved(size(dynamics%hinges%mechanisms))
      integer :: i

      moved = .false.
      do i = 1, self%n
         if (any(moved) .and. (i == self%n_series + 1 .or. pass > quick_passes)) exit
         if (self%part(i) == part_latch .or. moved(self%mechanism(i))) cycle
         if (.not. margin_of(self, dynamics, i, t) < 0.0_wp) cycle
         associate (mechanism => dynamics%hinges%mechanisms(self%mechanism(i)))
            call mechanism%change(self%part(i), t, self%theta(mechanism%hinge), self%theta_rate(mechanism%hinge))
         end associate
         moved(self%mechanism(i)) = .true.
      end do
      changed = any(moved)
      if (changed) call dynamics%change_hinges()
   end subroutine correct_laws

   !> What is said where that does not end.
   function no_balance(t) result(text)
      real(wp), intent(in) :: t
      character(len=:), allocatable :: text
      text = 'at t = '//time_text(t)//' s no consistent set of hinge laws (stops, freeplay, friction) was found'
   end function no_balance

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
         if (self%log(i)%time < t - chatter_span*self%span) return
         if (self%log(i)%hinge /= hinge) cycle
         found = found + 1
         if (found < chatter_count) cycle
         call raise(error, 'chatter at t = '//time_text(t)//' s: hinge '//to_text(hinge)//' had '//to_text(chatter_count)// &
                    ' within '//time_text(max(t - self%log(i)%time, tiny(t)))//' s, the last one '//trim(kind_names(kind))// &
                    '; softer stops, more damping or a larger friction_velocity may help')
         return
      end do
   end subroutine note

end module rodyn_hinge_events
