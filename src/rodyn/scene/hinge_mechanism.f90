!> Hinges that are more than a spring and a damper: freeplay, stops, dry friction, locks: `&hinge`, docs/moving_scenes.md.
!>
!> Between events every such hinge is linear again,
!>     T = C th + D th' + t0 + f,
!> with f the moment of sliding friction. Its parts, for the joint rotation th:
!> - spring with rest angle and freeplay, and damper (`rodyn_hinge_spring`);
!> - stops: Cs d + Ds d' with d the depth in the stop. They push but never pull: the stop is left when that moment vanishes (when
!>   d does, where dampers bend no rods: `reduced` dampers of quasistatic bending). Its face then follows by itself,
!>   d_face = d0 exp(-Cs (t - t0)/Ds), and may be met again;
!> - dry friction F, regularised: F th'/vf while |th'| < vf (sticks), F sign(th') beyond (slides);
!> - a lock: th stays (a constraint), or a spring and damper about the angle where it locked.
!> What is left in a stop's face or a lock's spring when it is left is lost, and booked at that event. A hinge that is held
!> waits for its release; one that has latched is locked for good.
!>
!> Each law holds while its margins are positive; an event is a margin that has become negative. A hinge changes its law
!> only `hysteresis` beyond the point where two laws meet, so that rounding cannot make it change back at once.
module rodyn_hinge_mechanism
   use rodyn_kinds, only: wp
   use rodyn_case_config, only: chain_config, hinge_config, none_given
   use rodyn_hinge_spring, only: hinge_spring, add_spring
   implicit none (type, external)
   private
   public :: hinge_mechanism, new_mechanism
   public :: part_spring, part_lower, part_upper, part_friction, part_latch
   public :: kind_names, kind_released, kind_latched

   !> Parts of a mechanism that have a margin.
   integer, parameter :: part_spring = 1, part_lower = 2, part_upper = 3, part_friction = 4, part_latch = 5

   !> Kinds of events.
   integer, parameter :: kind_released = 1, kind_latched = 2, kind_in_freeplay = 3, kind_out_of_freeplay = 4, &
      kind_at_lower = 5, kind_off_lower = 6, kind_at_upper = 7, kind_off_upper = 8, kind_slides = 9, kind_sticks = 10
   character(len=*), parameter :: kind_names(10) = [character(len=16) :: 'released', 'latched', 'in_freeplay', &
      'out_of_freeplay', 'at_lower_stop', 'off_lower_stop', 'at_upper_stop', 'off_upper_stop', 'slides', 'sticks']

   real(wp), parameter :: hysteresis = 1.0e-12_wp !! [rad], [rad/s]

   !> One hinge: what is given of it, and (from `touches` on) the law it has now.
   type, extends(hinge_spring) :: hinge_mechanism
      logical :: dampers_apart = .false.    !! dampers bend no rods (reduced dampers): stops are left at their angle
      logical :: touches(2) = .false.       !! lower, upper stop
      real(wp) :: face(2) = 0.0_wp          !! depth of a stop's face where it was left [rad]
      real(wp) :: left(2) = 0.0_wp          !! when [s]
      integer :: slides = 0                 !! 0: sticks; else the sign of th'
      logical :: is_held = .false.          !! locked from the start, until its release
      logical :: locked = .false.           !! held or latched
      logical :: latched = .false.          !! for good
      real(wp) :: lock_angle = 0.0_wp       !! [rad]
      integer :: latch_side = 0             !! sign of the way to the latch; 0: there is none
      logical :: at_latch = .false.         !! not latched, but still where it began or was released: at its latch
   contains
      procedure :: has_part
      procedure :: law_number
      procedure :: choose_laws
      procedure :: margin
      procedure :: change
      procedure :: lock
      procedure :: face_latch
      procedure :: lock_at_latch
      procedure :: release
      procedure :: list_events
      procedure :: linear_law
      procedure :: energy
      procedure :: is_constrained
   end type hinge_mechanism

contains

   !> Take over what is given of a hinge. Its law is that of the bare spring until `choose_laws`.
   pure subroutine new_mechanism(self, given, chain, dampers_apart)
      type(hinge_mechanism), intent(out) :: self
      type(hinge_config), intent(in) :: given
      type(chain_config), intent(in) :: chain
      logical, intent(in) :: dampers_apart !! see there

      self%hinge_config = given
      self%dampers_apart = dampers_apart
      self%stiffness = chain%hinge_stiffness(lbound(chain%hinge_stiffness, 1) + given%hinge)
      self%damping = chain%hinge_damping(lbound(chain%hinge_damping, 1) + given%hinge)
      self%side = merge(0, 1, given%freeplay > 0.0_wp)
      if (.not. given%lower_stop < none_given) self%lower_stop = -none_given ! below all angles
   end subroutine new_mechanism

   !> Has it this part?
   pure logical function has_part(self, part)
      class(hinge_mechanism), intent(in) :: self
      integer, intent(in) :: part
      select case (part)
      case (part_spring)
         has_part = self%freeplay > 0.0_wp
      case (part_lower, part_upper)
         has_part = abs(stop_angle(self, part - part_lower + 1)) < none_given
      case (part_friction)
         has_part = self%friction_moment > 0.0_wp
      case default
         has_part = self%latch_angle < none_given
      end select
   end function has_part

   !> The law that it has now, as a number.
   elemental integer function law_number(self)
      class(hinge_mechanism), intent(in) :: self
      law_number = merge(1, 0, self%locked) + merge(2, 0, self%side /= 0) + merge(4, 0, self%touches(1)) + &
                   merge(8, 0, self%touches(2)) + merge(16, 0, self%slides /= 0)
   end function law_number

   !> Choose the laws that hold at a state to which no motion led. A stop that is left too fast to follow keeps its face there.
   pure subroutine choose_laws(self, theta, theta_rate)
      class(hinge_mechanism), intent(inout) :: self
      real(wp), intent(in) :: theta, theta_rate !! th [rad], th' [rad/s]
      integer :: i

      call self%choose_side(theta)
      do i = 1, 2
         self%touches(i) = depth(self, i, theta) > 0.0_wp .and. push(self, i, theta, theta_rate) > 0.0_wp
         self%face(i) = merge(0.0_wp, max(depth(self, i, theta), 0.0_wp), self%touches(i))
         self%left(i) = 0.0_wp
      end do
      if (self%friction_moment > 0.0_wp) then
         self%slides = 0
         if (abs(theta_rate) > self%friction_velocity) self%slides = merge(1, -1, theta_rate > 0.0_wp)
      end if
   end subroutine choose_laws

   !> Angle of the lower or upper stop.
   pure real(wp) function stop_angle(self, i)
      type(hinge_mechanism), intent(in) :: self
      integer, intent(in) :: i
      stop_angle = merge(self%lower_stop, self%upper_stop, i == 1)
   end function stop_angle

   !> Depth in it.
   pure real(wp) function depth(self, i, theta)
      type(hinge_mechanism), intent(in) :: self
      integer, intent(in) :: i
      real(wp), intent(in) :: theta
      depth = merge(self%lower_stop - theta, theta - self%upper_stop, i == 1)
   end function depth

   !> Moment of a stop, divided by its stiffness [rad].
   pure real(wp) function push(self, i, theta, theta_rate)
      type(hinge_mechanism), intent(in) :: self
      integer, intent(in) :: i
      real(wp), intent(in) :: theta, theta_rate
      push = 0.0_wp
      if (.not. self%stop_stiffness > 0.0_wp) return
      push = depth(self, i, theta)
      if (.not. self%dampers_apart) push = push + self%stop_damping/self%stop_stiffness*merge(-theta_rate, theta_rate, i == 1)
   end function push

   !> Where the face of a stop is, by itself [rad].
   pure real(wp) function face_depth(self, i, t)
      type(hinge_mechanism), intent(in) :: self
      integer, intent(in) :: i
      real(wp), intent(in) :: t
      face_depth = 0.0_wp
      if (self%face(i) > 0.0_wp .and. self%stop_damping > 0.0_wp) &
         face_depth = self%face(i)*exp(-min(self%stop_stiffness*(t - self%left(i))/self%stop_damping, 500.0_wp))
   end function face_depth

   !> Margin of the law of a part: negative once it no longer holds [rad] or [rad/s].
   pure real(wp) function margin(self, part, t, theta, theta_rate)
      class(hinge_mechanism), intent(in) :: self
      integer, intent(in) :: part
      real(wp), intent(in) :: t, theta, theta_rate
      integer :: i

      margin = 1.0_wp
      if (self%is_constrained()) return
      select case (part)
      case (part_spring)
         margin = self%side_margin(theta)
      case (part_lower, part_upper)
         i = part - part_lower + 1
         if (self%touches(i)) then
            margin = push(self, i, theta, theta_rate)
         else
            ! Where a stop has just been left, both bodies move alike to first order; but what would pull does not touch.
            margin = max(face_depth(self, i, t) - depth(self, i, theta), -push(self, i, theta, theta_rate))
         end if
      case (part_friction)
         if (self%slides == 0) then
            margin = self%friction_velocity - abs(theta_rate)
         else
            margin = self%slides*theta_rate - self%friction_velocity
         end if
      case (part_latch)
         if (self%locked) return
         if (self%at_latch) margin = hysteresis - abs(self%latch_angle - theta)
         if (self%latch_side /= 0) margin = self%latch_side*(self%latch_angle - theta)
         return ! the angle itself, not beyond
      case default ! there is no other part
         return
      end select
      margin = margin + hysteresis
   end function margin

   !> The margin of a part other than the latch has become negative: take the law next to it.
   pure subroutine change(self, part, t, theta, theta_rate)
      class(hinge_mechanism), intent(inout) :: self
      integer, intent(in) :: part
      real(wp), intent(in) :: t, theta, theta_rate
      integer :: i

      select case (part)
      case (part_spring)
         call self%change_side(theta)
      case (part_lower, part_upper)
         i = part - part_lower + 1
         self%touches(i) = .not. self%touches(i)
         if (self%touches(i)) return
         self%face(i) = max(depth(self, i, theta), 0.0_wp)
         self%left(i) = t
      case (part_friction)
         self%slides = merge(0, merge(1, -1, theta_rate > 0.0_wp), self%slides /= 0)
      case default ! a latch has no other law
         return
      end select
   end subroutine change

   !> What has happened to a part since it `was` so: events, and the energy they cost. A stop keeps that of its face when it is
   !> left, and gives back what the face still has when it is met there. A joint that jumps into a stop, which has no face then,
   !> has worked on it.
   pure subroutine list_events(self, was, part, theta, kinds, lost)
      class(hinge_mechanism), intent(in) :: self
      type(hinge_mechanism), intent(in) :: was
      integer, intent(in) :: part
      real(wp), intent(in) :: theta                 !! th now [rad]
      integer, allocatable, intent(out) :: kinds(:) !! in their order
      real(wp), intent(out) :: lost                 !! by the last of them [J]
      integer :: i

      lost = 0.0_wp
      allocate (kinds(0))
      select case (part)
      case (part_spring)
         kinds = between(was%side, self%side, kind_in_freeplay, kind_out_of_freeplay)
      case (part_lower, part_upper)
         i = part - part_lower + 1
         if (self%touches(i) .eqv. was%touches(i)) return
         if (self%touches(i)) then
            kinds = [merge(kind_at_lower, kind_at_upper, i == 1)]
            if (was%face(i) > 0.0_wp) lost = -0.5_wp*self%stop_stiffness*depth(self, i, theta)**2
         else
            kinds = [merge(kind_off_lower, kind_off_upper, i == 1)]
            lost = 0.5_wp*self%stop_stiffness*self%face(i)**2
         end if
      case (part_friction)
         if (self%is_constrained()) return ! it sticks for good: one event
         kinds = between(was%slides, self%slides, kind_sticks, kind_slides)
      case default
         return
      end select
   end subroutine list_events

   !> Events on the way from one of three laws in a row, -1, 0 and 1, to another one.
   pure function between(before, after, to_middle, from_middle) result(kinds)
      integer, intent(in) :: before, after
      integer, intent(in) :: to_middle, from_middle !! kinds of events
      integer, allocatable :: kinds(:)
      logical :: moved
      moved = before /= after
      kinds = pack([to_middle, from_middle], [moved .and. before /= 0, moved .and. after /= 0])
   end function between

   !> Lock at an angle.
   pure subroutine lock(self, theta)
      class(hinge_mechanism), intent(inout) :: self
      real(wp), intent(in) :: theta
      self%locked = .true.
      self%lock_angle = theta
   end subroutine lock

   !> Look which way the latch is. One that is just here does not catch before the hinge comes back.
   pure subroutine face_latch(self, theta)
      class(hinge_mechanism), intent(inout) :: self
      real(wp), intent(in) :: theta
      if (.not. self%latch_angle < none_given) return
      self%at_latch = abs(self%latch_angle - theta) < hysteresis
      self%latch_side = merge(0, merge(1, -1, self%latch_angle > theta), self%at_latch)
   end subroutine face_latch

   !> Lock at the latch, for good.
   pure subroutine lock_at_latch(self)
      class(hinge_mechanism), intent(inout) :: self
      call self%lock(self%latch_angle)
      self%latched = .true.
   end subroutine lock_at_latch

   !> Release what was held; what the lock's spring holds is lost.
   pure subroutine release(self, theta, lost)
      class(hinge_mechanism), intent(inout) :: self
      real(wp), intent(in) :: theta
      real(wp), intent(out) :: lost !! [J]
      lost = 0.5_wp*self%lock_stiffness*(theta - self%lock_angle)**2
      self%locked = .false.
      self%is_held = .false.
      call self%face_latch(theta)
   end subroutine release

   !> Locked, and not by a spring?
   elemental logical function is_constrained(self)
      class(hinge_mechanism), intent(in) :: self
      is_constrained = self%locked .and. .not. self%lock_stiffness > 0.0_wp
   end function is_constrained

   !> The law as it is now: T = C th + D th' + t0 + f.
   pure subroutine linear_law(self, stiffness, damping, constant, friction)
      class(hinge_mechanism), intent(in) :: self
      real(wp), intent(out) :: stiffness, damping !! C, D
      real(wp), intent(out) :: constant           !! t0 [N m]
      real(wp), intent(out) :: friction           !! f [N m]
      integer :: i

      call self%linear_moment(stiffness, damping, constant, friction)
      do i = 1, 2
         if (.not. self%touches(i)) cycle
         call add_spring(self%stop_stiffness, stop_angle(self, i), stiffness, constant)
         damping = damping + self%stop_damping
      end do
      if (self%locked) then
         call add_spring(self%lock_stiffness, self%lock_angle, stiffness, constant)
         damping = damping + self%lock_damping
      end if
      if (.not. self%friction_moment > 0.0_wp .or. self%is_constrained()) return
      if (self%slides == 0) then
         damping = damping + self%friction_moment/self%friction_velocity
      else
         friction = friction + self%slides*self%friction_moment
      end if
   end subroutine linear_law

   !> Energy of its springs [J].
   pure real(wp) function energy(self, theta)
      class(hinge_mechanism), intent(in) :: self
      real(wp), intent(in) :: theta !! th [rad]
      integer :: i

      energy = self%spring_energy(theta)
      do i = 1, 2
         if (self%touches(i)) energy = energy + 0.5_wp*self%stop_stiffness*depth(self, i, theta)**2
      end do
      if (self%locked) energy = energy + 0.5_wp*self%lock_stiffness*(theta - self%lock_angle)**2
   end function energy

end module rodyn_hinge_mechanism
