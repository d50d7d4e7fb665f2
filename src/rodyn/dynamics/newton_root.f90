!> The spacecraft's part of a Newton system: three equations for the changes of Vx', Vy', w' once the chain is
!> eliminated.
!>
!> With dq = dq0 + g^2 x, dp = dp0 + g x (g: CVODE's gamma, x: change of p'), hinge 0 accelerates by
!>     dA = J x + dA0,   J = ((1, -g w, -y0 - g Vy - 2 g w x0), (g w, 1, x0 + g Vx - 2 g w y0)),
!> and the chain answers with a force P dA + ... and a moment. The same equations elsewhere: docs/model.md sec. 7.
module rodyn_newton_root
   use rodyn_kinds, only: wp
   use rodyn_spacecraft, only: spacecraft_body
   use rodyn_lapack, only: dgetrf, dgetrs
   implicit none (type, external)
   private
   public :: newton_root

   !> Factors, and what a solution needs of the state.
   type :: newton_root
      real(wp) :: omega = 0.0_wp       !! w [rad/s]
      real(wp) :: velocity(2) = 0.0_wp !! Vx, Vy [m/s]
      real(wp) :: hinge_map(2, 3) = 0.0_wp !! J
      real(wp) :: apparent(3, 2) = 0.0_wp  !! change of force (2) on, and minus moment at, hinge 0 by dA
      real(wp) :: matrix(3, 3) = 0.0_wp    !! LU factors
      integer :: pivots(3) = 0
   contains
      procedure :: factorise
      procedure :: known_acceleration
      procedure :: solve
   end type newton_root

contains

   !> Build and factor the three equations; `velocity` and `omega` are set.
   pure subroutine factorise(self, gamma, body, apparent, by_omega, ok)
      class(newton_root), intent(inout) :: self
      real(wp), intent(in) :: gamma
      type(spacecraft_body), intent(in) :: body
      real(wp), intent(in) :: apparent(3, 2) !! of the chain, moving axes
      real(wp), intent(in) :: by_omega(3)    !! force and minus moment by a change of w' alone, dA = 0
      logical, intent(out) :: ok
      real(wp) :: answer(3, 3), gw
      integer :: info

      gw = gamma*self%omega
      associate (x => body%hinge_x, y => body%hinge_y, v => self%velocity, m => body%mass)
         self%hinge_map(1, :) = [1.0_wp, -gw, -y - gamma*v(2) - 2.0_wp*gw*x]
         self%hinge_map(2, :) = [gw, 1.0_wp, x + gamma*v(1) - 2.0_wp*gw*y]
         self%apparent = apparent
         answer = matmul(apparent, self%hinge_map)
         answer(:, 3) = answer(:, 3) + by_omega
         self%matrix(1, :) = answer(1, :) + m*[1.0_wp, -gw, -gamma*v(2)]
         self%matrix(2, :) = answer(2, :) + m*[gw, 1.0_wp, gamma*v(1)]
         self%matrix(3, :) = x*answer(2, :) - y*answer(1, :) + answer(3, :)
         self%matrix(3, 3) = self%matrix(3, 3) + body%inertia
      end associate
      call dgetrf(3, 3, self%matrix, 3, self%pivots, info)
      ok = info == 0
   end subroutine factorise

   !> dA0: what known changes of the rates add to the acceleration of hinge 0.
   pure function known_acceleration(self, body, dp0) result(change)
      class(newton_root), intent(in) :: self
      type(spacecraft_body), intent(in) :: body
      real(wp), intent(in) :: dp0(3) !! of Vx, Vy, w
      real(wp) :: change(2)
      change = [-dp0(3)*self%velocity(2) - self%omega*dp0(2), dp0(3)*self%velocity(1) + self%omega*dp0(1)] - &
               2.0_wp*self%omega*dp0(3)*[body%hinge_x, body%hinge_y]
   end function known_acceleration

   !> x of the spacecraft, and the change of the acceleration of hinge 0.
   pure subroutine solve(self, body, dp0, known, x, hinge)
      class(newton_root), intent(in) :: self
      type(spacecraft_body), intent(in) :: body
      real(wp), intent(in) :: dp0(3)     !! known changes of Vx, Vy, w
      real(wp), intent(in) :: known(3)   !! known force on, and minus moment at, hinge 0 without that of dA0
      real(wp), intent(out) :: x(3)      !! changes of Vx', Vy', w'
      real(wp), intent(out) :: hinge(2)  !! dA
      real(wp) :: answer(3), known_hinge(2)
      integer :: info

      known_hinge = self%known_acceleration(body, dp0)
      answer = known + matmul(self%apparent, known_hinge)
      x(1) = -answer(1) + body%mass*(dp0(3)*self%velocity(2) + self%omega*dp0(2))
      x(2) = -answer(2) - body%mass*(dp0(3)*self%velocity(1) + self%omega*dp0(1))
      x(3) = body%hinge_y*answer(1) - body%hinge_x*answer(2) - answer(3)
      call dgetrs('N', 3, 1, self%matrix, 3, self%pivots, x, 3, info)
      hinge = known_hinge + matmul(self%hinge_map, x)
   end subroutine solve

end module rodyn_newton_root
