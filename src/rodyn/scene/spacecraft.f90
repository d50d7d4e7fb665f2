!> The rigid body of the spacecraft, docs/model.md sec. 1.
module rodyn_spacecraft
   use rodyn_kinds, only: wp
   implicit none (type, external)
   private
   public :: spacecraft_body

   !> Constants of the rigid body.
   type :: spacecraft_body
      real(wp) :: mass = 0.0_wp     !! M0 [kg]
      real(wp) :: inertia = 0.0_wp  !! J0 about C [kg m^2]
      real(wp) :: hinge_x = 0.0_wp  !! x0 [m]
      real(wp) :: hinge_y = 0.0_wp  !! y0 [m]
   end type spacecraft_body

end module rodyn_spacecraft
