!> Spring and damper of a hinge with a `&hinge` group: their form stands here and nowhere else.
!>
!> For the joint rotation th, rest angle a and freeplay g the spring has Ci (th - a) for |th - a| < g and
!> +-Ci g + C (th - a -+ g) beyond; the damper has D th'. A
!> curved one gives its tangents at the last state, which pass the moment there exactly (`follow` of `rodyn_hinge_law`).
module rodyn_hinge_spring
   use rodyn_kinds, only: wp
   use rodyn_case_config, only: hinge_config
   implicit none (type, external)
   private
   public :: hinge_spring, add_spring

   !> What is given of a hinge, and (from `side` on) what changes.
   type, extends(hinge_config) :: hinge_spring
      real(wp) :: stiffness = 0.0_wp  !! C [N m/rad]
      real(wp) :: damping = 0.0_wp    !! D [N m s/rad]
      integer :: side = 1             !! of the freeplay: -1, 0 within, 1
      real(wp) :: theta = 0.0_wp      !! th of the last state [rad], and
      real(wp) :: theta_rate = 0.0_wp !! th' [rad/s]: where curved laws have their tangents
   contains
      procedure :: is_linear
      procedure :: linear_moment
      procedure :: spring_energy
      procedure :: choose_side
      procedure :: side_margin
      procedure :: change_side
   end type hinge_spring

contains

   !> Are spring and damper straight from event to event? So are all that there are.
   elemental logical function is_linear(self)
      class(hinge_spring), intent(in) :: self
      associate (unused => self); end associate
      is_linear = .true.
   end function is_linear

   !> Spring and damper as they are now, T = C th + D th' + t0 + f.
   pure subroutine linear_moment(self, stiffness, damping, constant, friction)
      class(hinge_spring), intent(in) :: self
      real(wp), intent(out) :: stiffness, damping !! C, D
      real(wp), intent(out) :: constant           !! t0, of springs [N m]
      real(wp), intent(out) :: friction           !! f, of dampers [N m]

      stiffness = 0.0_wp
      constant = 0.0_wp
      damping = self%damping
      friction = 0.0_wp
      call add_spring(self%freeplay_stiffness, self%rest_angle, stiffness, constant)
      if (self%side /= 0) call add_spring(self%stiffness - self%freeplay_stiffness, self%rest_angle + self%side*self%freeplay, &
                                          stiffness, constant)
   end subroutine linear_moment

   !> T = C th + t0 of one more spring.
   pure subroutine add_spring(c, slack, stiffness, constant)
      real(wp), intent(in) :: c     !! [N m/rad]
      real(wp), intent(in) :: slack !! th without moment [rad]
      real(wp), intent(inout) :: stiffness, constant
      stiffness = stiffness + c
      constant = constant - c*slack
   end subroutine add_spring

   !> Energy of the spring [J], as a sum of squares: the differences of a parabola's coefficients would lose digits.
   pure real(wp) function spring_energy(self, theta)
      class(hinge_spring), intent(in) :: self
      real(wp), intent(in) :: theta !! th [rad]
      real(wp) :: e

      e = theta - self%rest_angle
      if (self%side == 0) then
         spring_energy = 0.5_wp*self%freeplay_stiffness*e**2
         return
      end if
      e = self%side*e - self%freeplay ! beyond the freeplay
      spring_energy = 0.5_wp*self%stiffness*e**2 + self%freeplay_stiffness*self%freeplay*(e + 0.5_wp*self%freeplay)
   end function spring_energy

   !> Choose the side that holds at a rotation to which no motion led.
   pure subroutine choose_side(self, theta)
      class(hinge_spring), intent(inout) :: self
      real(wp), intent(in) :: theta
      if (.not. self%freeplay > 0.0_wp) return
      self%side = 0
      if (abs(theta - self%rest_angle) > self%freeplay) self%side = merge(1, -1, theta > self%rest_angle)
   end subroutine choose_side

   !> Negative where another side holds [rad].
   pure real(wp) function side_margin(self, theta)
      class(hinge_spring), intent(in) :: self
      real(wp), intent(in) :: theta
      if (self%side == 0) then
         side_margin = self%freeplay - abs(theta - self%rest_angle)
      else
         side_margin = self%side*(theta - self%rest_angle) - self%freeplay
      end if
   end function side_margin

   !> Take the side next to it: there are three in a row.
   pure subroutine change_side(self, theta)
      class(hinge_spring), intent(inout) :: self
      real(wp), intent(in) :: theta
      self%side = merge(0, merge(1, -1, theta > self%rest_angle), self%side /= 0)
   end subroutine change_side

end module rodyn_hinge_spring
