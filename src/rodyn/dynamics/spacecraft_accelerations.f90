!> The spacecraft that carries a chain, docs/model.md sec. 3 and 4.2. The same equations elsewhere: docs/model.md sec. 7.
module rodyn_spacecraft_accelerations
   use rodyn_kinds, only: wp
   use rodyn_outboard_chain, only: outboard_chain
   use rodyn_spacecraft, only: spacecraft_body
   implicit none (type, external)
   private
   public :: spacecraft_accelerations

contains

   !> Accelerations of the spacecraft under the chain's force f = P A + b at hinge 0, and the acceleration of
   !> that hinge. With r = (x0, y0), rr = (-y0, x0), A = A_C + rr w' - r w^2, A_C = (Vx' - w Vy, Vy' + w Vx):
   !>     (M0 + P) A_C + P rr w'           = F - c,           c = b - w^2 P r,
   !>     rr.P A_C     + (J0 + rr.P rr) w' = M_C + T_0 - rr.c.
   !> A_C is eliminated with the adjugate adj(M0 + P) = M0 + adj P and the determinant d2 = M0^2 + M0 tr P + det P, which gives
   !>     (J0 d2 + M0 (M0 rr.P rr + det P r^2)) w' = (M_C + T_0) d2 - rr.((M0 P + det P) F) + k.c,
   !>     A = adj(M0 + P) (F - c)/d2 - r w^2 + (-k_x, -k_y) w'/d2,    k = -M0 adj(M0 + P) rr:
   !> sums of positive terms on the left, for a light spacecraft on a heavy chain as for the reverse, two divisions that need
   !> not wait for each other, and little to do once b is known, which comes last.
   pure subroutine spacecraft_accelerations(n_base, body, p, chain, force, acceleration, ax, ay, smallest)
      integer, intent(in) :: n_base               !! 3: free, 0: fixed
      type(spacecraft_body), intent(in) :: body
      real(wp), intent(in) :: p(*)                !! Vx, Vy, w, ... of a free spacecraft
      type(outboard_chain), intent(in) :: chain   !! at hinge 0, moving axes
      real(wp), intent(in) :: force(3)            !! X_C, Y_C, M_C
      real(wp), intent(inout) :: acceleration(*)  !! first three: Vx', Vy', w'
      real(wp), intent(out) :: ax, ay             !! acceleration of hinge 0, moving axes [m/s^2]
      real(wp), intent(out) :: smallest           !! not positive: the mass matrix is not positive definite
      real(wp) :: pxx, pyy, d, d2, d3, inverse, kx, ky, cx, cy, pull, w, w2, m11, m22, fx, fy, w_rate

      ax = 0.0_wp
      ay = 0.0_wp
      smallest = huge(1.0_wp)
      if (n_base == 0) return
      w = p(3)
      w2 = w*w
      associate (x => body%hinge_x, y => body%hinge_y, mass => body%mass, mu => chain%mass, pee => chain%pee, pen => chain%pen, &
                 pnn => chain%pnn, be => chain%be, bn => chain%bn)
         pxx = pee + mu
         pyy = pnn + mu
         d = chain%det + mu*(pee + pnn + mu)
         m11 = mass + pxx
         m22 = mass + pyy
         d2 = mass*(mass + (pxx + pyy)) + d
         d3 = body%inertia*d2 + mass*(mass*(x*(pyy*x - pen*y) + y*(pxx*y - pen*x)) + d*(x*x + y*y))
         smallest = min(m11, d2, d3)
         inverse = 1.0_wp/d2
         kx = mass*(pen*x + m22*y)
         ky = -mass*(m11*x + pen*y)
         pull = mass*(x*(pen*force(1) + pyy*force(2)) - y*(pxx*force(1) + pen*force(2))) + d*(x*force(2) - y*force(1))
         cx = be - w2*(pxx*x + pen*y)
         cy = bn - w2*(pen*x + pyy*y)
         fx = force(1) - cx
         fy = force(2) - cy
         w_rate = ((force(3) + chain%moment)*d2 - pull + (kx*cx + ky*cy))*(1.0_wp/d3)
         ax = (m22*fx - pen*fy)*inverse
         ay = (m11*fy - pen*fx)*inverse
         acceleration(1) = ax - (mass*(pen*x - pxx*y) - d*y)*inverse*w_rate + w*p(2)
         acceleration(2) = ay - (mass*(pyy*x - pen*y) + d*x)*inverse*w_rate - w*p(1)
         acceleration(3) = w_rate
         ax = ax - w2*x - kx*inverse*w_rate
         ay = ay - w2*y - ky*inverse*w_rate
      end associate
   end subroutine spacecraft_accelerations

end module rodyn_spacecraft_accelerations
