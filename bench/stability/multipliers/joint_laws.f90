!> One hinge between two events: which branch of each of its laws holds, and when it holds no longer.
module joint_laws
   use scene_data, only: dp, scene_type, joint_data, none
   implicit none (type, external)
   private
   public :: joint_law, new_joint_law, kind_released, kind_latched, part_latch, slack

   integer, parameter :: kind_released = 1, kind_latched = 2, part_latch = 5
   real(dp), parameter :: slack = 1.0e-12_dp !! beyond the point where two branches meet [rad], [rad/s]

   type, extends(joint_data) :: joint_law
      real(dp) :: spring = 0.0_dp, damper = 0.0_dp
      logical :: apart = .false.       !! dampers bend no rods: a stop is left at its angle
      integer :: branch = 0            !! -1, 0, 1: beyond or within the freeplay
      logical :: touches(2) = .false.
      real(dp) :: face(2) = 0.0_dp, left(2) = 0.0_dp
      integer :: slides = 0
      logical :: locked = .false.
      real(dp) :: lock_angle = 0.0_dp
      integer :: latch_side = 0
   contains
      procedure :: choose
      procedure :: margin
      procedure :: switch
      procedure :: law
      procedure :: energy
      procedure :: rigid
   end type joint_law

contains

   function new_joint_law(s, k) result(j)
      type(scene_type), intent(in) :: s
      integer, intent(in) :: k
      type(joint_law) :: j
      j%joint_data = s%joints(k)
      j%spring = s%spring(k)
      j%damper = s%damper(k)
      j%apart = s%statics .and. .not. s%exact
   end function new_joint_law

   !> Is it a constraint now?
   elemental logical function rigid(j)
      class(joint_law), intent(in) :: j
      rigid = j%locked .and. j%lock_stiffness <= 0.0_dp
   end function rigid

   pure real(dp) function depth(j, i, th)
      class(joint_law), intent(in) :: j
      integer, intent(in) :: i
      real(dp), intent(in) :: th
      depth = -none
      if (j%stop(i) < none) depth = merge(j%stop(1) - th, th - j%stop(2), i == 1)
   end function depth

   !> The branches that hold at a state to which no motion led. Returns whether anything has changed.
   logical function choose(j, th, rate) result(changed)
      class(joint_law), intent(inout) :: j
      real(dp), intent(in) :: th, rate
      integer :: i, branch
      logical :: touch
      real(dp) :: e

      changed = .false.
      if (.not. j%present .or. j%rigid()) return
      if (j%freeplay > 0.0_dp) then
         e = th - j%rest
         branch = 0
         if (abs(e) > j%freeplay) branch = merge(1, -1, e > 0.0_dp)
         changed = branch /= j%branch
         j%branch = branch
      end if
      do i = 1, 2
         if (j%stop(i) >= none) cycle
         touch = depth(j, i, th) > 0.0_dp .and. push(j, i, th, rate) > 0.0_dp
         changed = changed .or. (touch .neqv. j%touches(i))
         j%touches(i) = touch
         j%face(i) = 0.0_dp
      end do
      if (j%friction <= 0.0_dp) return
      branch = 0
      if (abs(rate) > j%friction_velocity) branch = merge(1, -1, rate > 0.0_dp)
      changed = changed .or. branch /= j%slides
      j%slides = branch
   end function choose

   !> Moment of a stop that is touched.
   pure real(dp) function push(j, i, th, rate)
      class(joint_law), intent(in) :: j
      integer, intent(in) :: i
      real(dp), intent(in) :: th, rate
      push = j%stop_stiffness*depth(j, i, th)
      if (.not. j%apart) push = push + j%stop_damping*merge(-rate, rate, i == 1)
   end function push

   !> Negative once the branch of a part holds no longer: 1 spring, 2, 3 stops, 4 friction, 5 latch. Of a touched stop: its
   !> moment over its stiffness.
   pure real(dp) function margin(j, part, t, th, rate)
      class(joint_law), intent(in) :: j
      integer, intent(in) :: part
      real(dp), intent(in) :: t, th, rate
      integer :: i

      margin = 1.0_dp
      if (.not. j%present .or. j%rigid()) return
      select case (part)
      case (1)
         if (j%freeplay <= 0.0_dp) return
         if (j%branch == 0) then
            margin = j%freeplay - abs(th - j%rest)
         else
            margin = j%branch*(th - j%rest) - j%freeplay
         end if
      case (2, 3)
         i = part - 1
         if (j%stop(i) >= none) return
         if (j%touches(i)) then
            margin = push(j, i, th, rate)/j%stop_stiffness
         else
            margin = -depth(j, i, th)
            if (j%face(i) > 0.0_dp .and. j%stop_damping > 0.0_dp) &
               margin = margin + j%face(i)*exp(-min(j%stop_stiffness*(t - j%left(i))/j%stop_damping, 600.0_dp))
         end if
      case (4)
         if (j%friction <= 0.0_dp) return
         if (j%slides == 0) then
            margin = j%friction_velocity - abs(rate)
         else
            margin = j%slides*rate - j%friction_velocity
         end if
      case default
         if (j%latch_side /= 0) margin = j%latch_side*(j%latch - th)
         return
      end select
      margin = margin + slack
   end function margin

   !> Take the other branch of a part; what a stop keeps that is left is lost.
   subroutine switch(j, part, t, th, rate, kind, lost)
      class(joint_law), intent(inout) :: j
      integer, intent(in) :: part
      real(dp), intent(in) :: t, th, rate
      integer, intent(out) :: kind
      real(dp), intent(out) :: lost
      integer :: i

      lost = 0.0_dp
      kind = 0
      select case (part)
      case (1)
         kind = merge(4, 3, j%branch == 0)
         j%branch = merge(merge(1, -1, th > j%rest), 0, j%branch == 0)
      case (2, 3)
         i = part - 1
         lost = 0.5_dp*j%stop_stiffness*depth(j, i, th)**2
         if (j%touches(i)) then
            j%face(i) = max(depth(j, i, th), 0.0_dp)
            j%left(i) = t
         else
            lost = -lost
         end if
         kind = 2*i + merge(4, 3, j%touches(i))
         j%touches(i) = .not. j%touches(i)
      case (4)
         kind = merge(9, 10, j%slides == 0)
         j%slides = merge(merge(1, -1, rate > 0.0_dp), 0, j%slides == 0)
      case default ! a latch has no other branch
         return
      end select
   end subroutine switch

   !> T = c th + d th' + t0 + f, f the friction of sliding.
   pure subroutine law(j, c, d, t0, f)
      class(joint_law), intent(in) :: j
      real(dp), intent(out) :: c, d, t0, f
      integer :: i

      c = j%spring
      d = j%damper
      t0 = -j%spring*j%rest
      f = 0.0_dp
      if (.not. j%present) return
      if (j%freeplay > 0.0_dp) then
         if (j%branch == 0) then
            c = j%inner
            t0 = -j%inner*j%rest
         else
            t0 = -j%spring*(j%rest + j%branch*j%freeplay) + j%branch*j%inner*j%freeplay
         end if
      end if
      do i = 1, 2
         if (.not. j%touches(i)) cycle
         c = c + j%stop_stiffness
         t0 = t0 - j%stop_stiffness*j%stop(i)
         d = d + j%stop_damping
      end do
      if (j%locked) then
         c = c + j%lock_stiffness
         t0 = t0 - j%lock_stiffness*j%lock_angle
         d = d + j%lock_damping
      end if
      if (j%friction <= 0.0_dp) return
      if (j%slides == 0) then
         d = d + j%friction/j%friction_velocity
      else
         f = j%slides*j%friction
      end if
   end subroutine law

   !> Energy of its springs.
   pure real(dp) function energy(j, th)
      class(joint_law), intent(in) :: j
      real(dp), intent(in) :: th
      real(dp) :: e, beyond
      integer :: i

      e = th - j%rest
      energy = 0.5_dp*j%spring*e**2
      if (j%freeplay > 0.0_dp) then
         beyond = j%branch*e - j%freeplay
         energy = 0.5_dp*j%inner*e**2
         if (j%branch /= 0) energy = 0.5_dp*j%spring*beyond**2 + j%inner*j%freeplay*(beyond + 0.5_dp*j%freeplay)
      end if
      do i = 1, 2
         if (j%touches(i)) energy = energy + 0.5_dp*j%stop_stiffness*depth(j, i, th)**2
      end do
      if (j%locked) energy = energy + 0.5_dp*j%lock_stiffness*(th - j%lock_angle)**2
   end function energy

end module joint_laws
