!> The spacecraft that carries a chain in all lanes at once: the equations of `rodyn_spacecraft_accelerations` in the order with
!> the fewest operations, as lanes do not wait for each other: A_C follows from w', which is
!>     (J0 d2 + M0 (M0 rr.P rr + det P r^2)) w' = (M_C + T_0) d2 - rr.((M0 P + det P) F + M0 adj(M0 + P) c).
!> The same equations elsewhere: docs/model.md sec. 7.
module rodyn_lane_spacecraft
   use rodyn_kinds, only: wp
   use rodyn_lanes, only: lanes
   use rodyn_outboard_chain, only: lane_outboard_chain
   implicit none (type, external)
   private
   public :: lane_spacecraft_accelerations

contains

   !> Accelerations of the spacecraft under the chain's force f = P A + b at hinge 0, and the acceleration of that hinge.
   pure subroutine lane_spacecraft_accelerations(n_base, mass, inertia, hinge_x, hinge_y, p, chain, force, acceleration, ax, ay, &
                                                 omega_rate, smallest)
      integer, intent(in) :: n_base !! 3: free, 0: fixed
      real(wp), dimension(lanes), intent(in) :: mass, inertia, hinge_x, hinge_y !! of the spacecraft [kg], [kg m^2], [m]
      real(wp), intent(in) :: p(lanes, *)                    !! Vx, Vy, w, ... of a free spacecraft
      type(lane_outboard_chain), intent(in) :: chain         !! at hinge 0, moving axes
      real(wp), intent(in) :: force(lanes, 3)                !! X_C, Y_C, M_C
      real(wp), intent(inout) :: acceleration(lanes, *)      !! first three: Vx', Vy', w'
      real(wp), intent(out) :: ax(lanes), ay(lanes)          !! acceleration of hinge 0, moving axes [m/s^2]
      real(wp), intent(out) :: omega_rate(lanes)             !! w' [rad/s^2]
      real(wp), intent(inout) :: smallest(lanes)             !! not positive: the mass matrix is not positive definite
      real(wp) :: pxx, pyy, d, d2, d3, inverse, cx, cy, px, py, w, w2, m11, m22, gx, gy, fx, fy, w_rate, mu, pen, x, y, m
      integer :: i

      ax = 0.0_wp
      ay = 0.0_wp
      omega_rate = 0.0_wp
      if (n_base == 0) return
      !$omp simd
      do i = 1, lanes
         w = p(i, 3)
         w2 = w*w
         mu = chain%mass(i)
         pen = chain%pen(i)
         m = mass(i)
         x = hinge_x(i)
         y = hinge_y(i)
         pxx = chain%pee(i) + mu
         pyy = chain%pnn(i) + mu
         d = chain%det(i) + mu*(chain%pee(i) + chain%pnn(i) + mu)
         m11 = m + pxx
         m22 = m + pyy
         d2 = m*(m + (pxx + pyy)) + d
         inverse = 1.0_wp/d2
         cx = chain%be(i) - w2*(pxx*x + pen*y)
         cy = chain%bn(i) - w2*(pen*x + pyy*y)
         px = pen*x - pxx*y
         py = pyy*x - pen*y
         gx = m*((pxx*force(i, 1) + pen*force(i, 2)) + (m22*cx - pen*cy)) + d*force(i, 1)
         gy = m*((pen*force(i, 1) + pyy*force(i, 2)) + (m11*cy - pen*cx)) + d*force(i, 2)
         d3 = inertia(i)*d2 + m*(m*(x*py - y*px) + d*(x*x + y*y))
         smallest(i) = min(smallest(i), m11, d2, d3)
         w_rate = ((force(i, 3) + chain%moment(i))*d2 - (x*gy - y*gx))/d3
         fx = (force(i, 1) - cx) - px*w_rate
         fy = (force(i, 2) - cy) - py*w_rate
         cx = (m22*fx - pen*fy)*inverse
         cy = (m11*fy - pen*fx)*inverse
         acceleration(i, 1) = cx + w*p(i, 2)
         acceleration(i, 2) = cy - w*p(i, 1)
         acceleration(i, 3) = w_rate
         omega_rate(i) = w_rate
         ax(i) = cx - y*w_rate - w2*x
         ay(i) = cy + x*w_rate - w2*y
      end do
   end subroutine lane_spacecraft_accelerations

end module rodyn_lane_spacecraft
