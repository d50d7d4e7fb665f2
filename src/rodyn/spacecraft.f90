!> The spacecraft at the root of the chain, MODEL sec. 3 and 4.2.
module rodyn_spacecraft
   use rodyn_kinds, only: wp
   implicit none (type, external)
   private
   public :: spacecraft_body, spacecraft_accelerations

   !> Constants of the rigid body.
   type :: spacecraft_body
      real(wp) :: mass = 0.0_wp     !! M0 [kg]
      real(wp) :: inertia = 0.0_wp  !! J0 about C [kg m^2]
      real(wp) :: hinge_x = 0.0_wp  !! x0 [m]
      real(wp) :: hinge_y = 0.0_wp  !! y0 [m]
   end type spacecraft_body

contains

   !> Accelerations of the spacecraft under the chain's force f = P A + b at hinge 0, and the acceleration of
   !> that hinge. With r = (x0, y0), rr = (-y0, x0), A = A_C + rr w' - r w^2, A_C = (Vx' - w Vy, Vy' + w Vx):
   !>     (M0 + P) A_C + P rr w'           = F_C - c,         c = b - w^2 P r,
   !>     rr.P A_C     + (J0 + rr.P rr) w' = M_C + T_0 - rr.c.
   !> The 3x3 matrix is symmetric and positive definite; it is solved by its LDL^T factors.
   pure subroutine spacecraft_accelerations(n_base, body, p, hinge_mass, pee, pen, pnn, be, bn, moment_0, force, &
                                            acceleration, ax, ay)
      integer, intent(in) :: n_base               !! 3: free, 0: fixed
      type(spacecraft_body), intent(in) :: body
      real(wp), intent(in) :: p(*)                !! Vx, Vy, w, ... of a free spacecraft
      real(wp), intent(in) :: hinge_mass          !! mass that rides on hinge 0 [kg]
      real(wp), intent(in) :: pee, pen, pnn       !! P, moving axes [kg]
      real(wp), intent(in) :: be, bn              !! b, moving axes [N]
      real(wp), intent(in) :: moment_0            !! T_0 [N m]
      real(wp), intent(in) :: force(3)            !! X_C, Y_C, M_C
      real(wp), intent(inout) :: acceleration(*)  !! first three: Vx', Vy', w'
      real(wp), intent(out) :: ax, ay             !! acceleration of hinge 0, moving axes [m/s^2]
      real(wp) :: pxx, pyy, cx, cy, px, py, w, w2, m11, m22, m33, l21, l31, l32, d2, d3, f1, f2, f3, w_rate

      ax = 0.0_wp
      ay = 0.0_wp
      if (n_base == 0) return
      w = p(3)
      w2 = w*w
      pxx = pee + hinge_mass
      pyy = pnn + hinge_mass
      associate (x => body%hinge_x, y => body%hinge_y)
         cx = be - w2*(pxx*x + pen*y)
         cy = bn - w2*(pen*x + pyy*y)
         px = pen*x - pxx*y
         py = pyy*x - pen*y
         m11 = body%mass + pxx
         m22 = body%mass + pyy
         m33 = body%inertia + (x*py - y*px)
         f1 = force(1) - cx
         f2 = force(2) - cy
         f3 = force(3) + moment_0 - (x*cy - y*cx)

         l21 = pen/m11
         l31 = px/m11
         d2 = m22 - l21*pen
         l32 = (py - l31*pen)/d2
         d3 = m33 - l31*px - l32*(py - l31*pen)
         f2 = f2 - l21*f1
         f3 = f3 - l31*f1 - l32*f2
         w_rate = f3/d3
         ay = f2/d2 - l32*w_rate
         ax = f1/m11 - l21*ay - l31*w_rate

         acceleration(1) = ax + w*p(2)
         acceleration(2) = ay - w*p(1)
         acceleration(3) = w_rate
         ax = ax - y*w_rate - w2*x
         ay = ay + x*w_rate - w2*y
      end associate
   end subroutine spacecraft_accelerations

end module rodyn_spacecraft
