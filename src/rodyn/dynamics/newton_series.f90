!> Newton systems of massless rods in series with hinges (`rodyn_hinge_law`), in O(n).
!>
!> With `reduced` dampers T = C G z + G^T D G z', G = (1 + F C)^-1, z the openings, ties all hinges of the chain to each
!> other; relaxing hinges are springs C + D/g to a Newton system, and no dampers. This becomes local with two sets of
!> slopes: those that the springs' moments m alone bend, and those that the whole moments T bend. With f the
!> flexibility of the rod, s the opening of a hinge under springs alone (all angles in units of g^2),
!>     s_{k-1} = phi - (f11 m_{k-1} + f12 m_k) - tau_x,     m = C s,              tau_x' = phi + f12 m_{k-1} + f22 m_k,
!>     T_{k-1} = g^2 C (phi - (f11 T_{k-1} + f12 T_k)/g^2 - tau_s) + g D s_{k-1},    tau_s' = phi + (f12 T_{k-1} + f22 T_k)/g^2.
!> The chain beyond hinge k - 1 is seen as in `rodyn_newton_chain`, with two rotations and two moments:
!>     (fe, fn, -T, -m) = P (dAe, dAn, tau_s, tau_x) + P_w w' + b.
!> The moments are unknowns themselves, not differences of stiff springs' ends, so no stiffness costs digits.
!> The same equations elsewhere: docs/model.md sec. 7.
module rodyn_newton_series
   use rodyn_kinds, only: wp
   use rodyn_rod_constants, only: rod_constants
   use rodyn_newton_tangent, only: rod_tangent
   implicit none (type, external)
   private
   public :: series_factor, factorise_series, reduce_series, expand_series

   ! Unknowns of rod k: its rotation, opening and moment of the inner hinge, moments of the outer one; what its inner end does.
   integer, parameter, public :: of_phi = 1, of_opening = 2 !! phi, s_{k-1}
   integer, parameter :: of_moment = 3, of_moment_out = 4, of_spring_out = 5 !! T_{k-1}, T_k, m_k
   integer, parameter :: by_ae = 1, by_an = 2, by_tau_s = 3, by_tau_x = 4, by_w = 5
   ! Rows of the chain beyond a hinge: force, -T, -m.
   integer, parameter :: on_ae = 1, on_an = 2, on_moment = 3, on_spring = 4

   !> What elimination of a rod leaves.
   type :: series_factor
      real(wp) :: outer(4, 2)   !! P beyond the outer node, mass there included, columns dAe, dAn
      real(wp) :: ae_w, ae_phi, an_phi !! as in `rod_factor`
      real(wp) :: inverse(5, 5) !! of the rod's own block
      real(wp) :: by_inner(5, 5) !! unknowns = y - by_inner (dAe, dAn, tau_s, tau_x, w')
      real(wp) :: force(2, 5)   !! fe, fn by the unknowns
      real(wp) :: stiffness     !! C of hinge k - 1
      real(wp) :: slope(3), bend(3) !! f, f/g^2
      real(wp) :: outer_ratio   !! f22/f12
   end type series_factor

contains

   !> Eliminate all rods.
   pure subroutine factorise_series(n, gamma, rods, rod_of, node_mass, stiffness, damping, tangent, factor, apparent, &
                                    by_omega, ok)
      integer, intent(in) :: n
      real(wp), intent(in) :: gamma
      type(rod_constants), intent(in) :: rods(:)
      integer, intent(in) :: rod_of(n)
      real(wp), intent(in) :: node_mass(0:n)
      real(wp), intent(in) :: stiffness(0:n - 1), damping(0:n - 1) !! C, D of the law above
      type(rod_tangent), intent(in) :: tangent(n)
      type(series_factor), intent(inout) :: factor(n)
      real(wp), intent(out) :: apparent(3, 2)      !! P at hinge 0, moving axes, columns dAx, dAy, rows of force and moment
      real(wp), intent(out) :: by_omega(3)         !! P_w there
      logical, intent(out) :: ok                   !! false: singular
      real(wp) :: p(4, 5), own(5, 5), inner(5, 5)
      integer :: k

      p = 0.0_wp
      ok = .true.
      do k = n, 1, -1
         associate (rod => rods(rod_of(k)), t => tangent(k), f => factor(k))
            p(on_ae, by_ae) = p(on_ae, by_ae) + node_mass(k)
            p(on_an, by_an) = p(on_an, by_an) + node_mass(k)
            f%outer = p(:, 1:2)
            f%ae_w = -2.0_wp*gamma*rod%length*t%w
            f%ae_phi = f%ae_w - gamma**2*rod%length*t%wr
            f%an_phi = rod%length*(1.0_wp - (gamma*t%w)**2)
            f%stiffness = stiffness(k - 1)
            call rod_equations(rod, t, gamma, gamma*damping(k - 1), p, f, inner, own)
            call invert(own, f%inverse, ok)
            if (.not. ok) return
            f%by_inner = matmul(f%inverse, inner)
            p(1:2, by_tau_s:by_tau_x) = 0.0_wp
            p(1:2, :) = p(1:2, :) - matmul(f%force, f%by_inner)
            p(on_moment, :) = f%by_inner(of_moment, :)
            p(on_spring, :) = f%stiffness*f%by_inner(of_opening, :)
            call turn_axes(t%cd, t%sd, p)
         end associate
      end do
      apparent = p(1:3, 1:2)
      by_omega = p(1:3, by_w)
   end subroutine factorise_series

   !> Equations of phi, s, T, T_k, m_k: by these unknowns (own) and by the motion of the inner end (inner). The last two
   !> say what the chain beyond answers.
   pure subroutine rod_equations(rod, t, gamma, damper, p, f, inner, own)
      type(rod_constants), intent(in) :: rod
      type(rod_tangent), intent(in) :: t
      real(wp), intent(in) :: gamma, damper  !! g, g D
      real(wp), intent(inout) :: p(4, 5)     !! in: of the chain beyond; out: its column of w' with the rod turning along
      type(series_factor), intent(inout) :: f
      real(wp), intent(out) :: inner(5, 5)   !! columns dAe, dAn, tau_s, tau_x, w'
      real(wp), intent(out) :: own(5, 5)
      real(wp) :: answer(4, 5), spring
      integer :: j

      associate (k => rod%stiffness) ! f is its inverse; f12 factored out
         f%outer_ratio = k(1)/k(2)
         f%slope = [k(3)/k(2), 1.0_wp, f%outer_ratio]/(k(1)*(k(3)/k(2)) - k(2))
      end associate
      f%bend = f%slope/gamma**2
      spring = gamma**2*f%stiffness
      answer(:, of_phi) = p(:, by_ae)*f%ae_phi + p(:, by_an)*f%an_phi + p(:, by_tau_s) + p(:, by_tau_x)
      answer(:, of_opening) = p(:, by_tau_x)*f%slope(2)*f%stiffness
      answer(:, of_moment) = p(:, by_tau_s)*f%bend(2)
      answer(:, of_moment_out) = p(:, by_tau_s)*f%bend(3)
      answer(:, of_spring_out) = p(:, by_tau_x)*f%slope(3)
      p(:, by_w) = p(:, by_w) + p(:, by_ae)*f%ae_w + p(:, by_an)*rod%length
      f%force = answer(on_ae:on_an, :)

      own(of_phi, :) = rod%length*answer(on_an, :)
      own(of_phi, of_phi) = own(of_phi, of_phi) + gamma**2*t%phi_phi
      own(of_phi, of_moment) = own(of_phi, of_moment) + 1.0_wp
      own(of_phi, of_moment_out) = own(of_phi, of_moment_out) - 1.0_wp
      own(of_opening, :) = [-1.0_wp, 1.0_wp + f%slope(1)*f%stiffness, 0.0_wp, 0.0_wp, f%slope(2)]
      own(of_moment, :) = [-spring, -damper, 1.0_wp + f%slope(1)*f%stiffness, f%slope(2)*f%stiffness, 0.0_wp]
      own(of_moment_out, :) = answer(on_moment, :)
      own(of_moment_out, of_moment_out) = own(of_moment_out, of_moment_out) + 1.0_wp
      own(of_spring_out, :) = answer(on_spring, :)
      own(of_spring_out, of_spring_out) = own(of_spring_out, of_spring_out) + 1.0_wp

      inner = 0.0_wp
      do j = by_ae, by_w
         if (j == by_tau_s .or. j == by_tau_x) cycle
         inner(of_phi, j) = rod%length*p(on_an, j)
         inner(of_moment_out, j) = p(on_moment, j)
         inner(of_spring_out, j) = p(on_spring, j)
      end do
      inner(of_opening, by_tau_x) = 1.0_wp
      inner(of_moment, by_tau_s) = spring
   end subroutine rod_equations

   !> From the axes of rod k to those of rod k - 1.
   pure subroutine turn_axes(cd, sd, p)
      real(wp), intent(in) :: cd, sd
      real(wp), intent(inout) :: p(4, 5)
      real(wp) :: turned(4)

      turned = cd*p(:, 1) - sd*p(:, 2)
      p(:, 2) = sd*p(:, 1) + cd*p(:, 2)
      p(:, 1) = turned
      call turn_rows(p)

   contains

      pure subroutine turn_rows(x)
         real(wp), intent(inout) :: x(4, 5)
         real(wp) :: row(5)
         row = cd*x(1, :) - sd*x(2, :)
         x(2, :) = sd*x(1, :) + cd*x(2, :)
         x(1, :) = row
      end subroutine turn_rows

   end subroutine turn_axes

   !> Inverse by Gauss and Jordan with exchange of rows.
   pure subroutine invert(a, b, ok)
      real(wp), intent(inout) :: a(5, 5)
      real(wp), intent(out) :: b(5, 5)
      logical, intent(out) :: ok
      real(wp) :: row(5), factor
      integer :: i, j, best

      b = 0.0_wp
      do i = 1, 5
         b(i, i) = 1.0_wp
      end do
      do j = 1, 5
         best = j - 1 + maxloc(abs(a(j:, j)), dim=1)
         ok = abs(a(best, j)) > 0.0_wp .and. abs(a(best, j)) <= huge(1.0_wp)
         if (.not. ok) return
         if (best /= j) then
            row = a(j, :)
            a(j, :) = a(best, :)
            a(best, :) = row
            row = b(j, :)
            b(j, :) = b(best, :)
            b(best, :) = row
         end if
         factor = 1.0_wp/a(j, j)
         a(j, :) = a(j, :)*factor
         b(j, :) = b(j, :)*factor
         do i = 1, 5
            if (i == j) cycle
            factor = a(i, j)
            a(i, :) = a(i, :) - factor*a(j, :)
            b(i, :) = b(i, :) - factor*b(j, :)
         end do
      end do
   end subroutine invert

   !> Inward pass of a solution; see `reduce_chain`.
   pure subroutine reduce_series(n, rods, rod_of, tangent, factor, d_omega, phi, phi_rate, moment, left, known)
      integer, intent(in) :: n
      type(rod_constants), intent(in) :: rods(:)
      integer, intent(in) :: rod_of(n)
      type(rod_tangent), intent(in) :: tangent(n)
      type(series_factor), intent(in) :: factor(n)
      real(wp), intent(in) :: d_omega, phi(n), phi_rate(n)
      real(wp), intent(in) :: moment(0:n)  !! known parts of T
      real(wp), intent(out) :: left(5, n)  !! unknowns of a rod whose inner end is at rest
      real(wp), intent(out) :: known(3)    !! b at hinge 0, moving axes, known part of T_0 not included
      real(wp) :: b(4), rows(5), along, across
      integer :: k

      b = 0.0_wp
      do k = n, 1, -1
         associate (t => tangent(k), f => factor(k), length => rods(rod_of(k))%length)
            along = -length*(2.0_wp*t%w*(d_omega + phi_rate(k)) + t%wr*phi(k))
            across = -length*t%w**2*phi(k)
            b = b + f%outer(:, 1)*along + f%outer(:, 2)*across
            rows = [length*b(on_an) + t%phi_phi*phi(k) - (moment(k) - moment(k - 1)), 0.0_wp, 0.0_wp, b(on_moment), b(on_spring)]
            left(:, k) = -matmul(f%inverse, rows)
            b(on_ae:on_an) = b(on_ae:on_an) + matmul(f%force, left(:, k))
            b = [t%cd*b(on_ae) - t%sd*b(on_an), t%sd*b(on_ae) + t%cd*b(on_an), -left(of_moment, k), &
                 -f%stiffness*left(of_opening, k)]
         end associate
      end do
      known = b(1:3)
   end subroutine reduce_series

   !> Outward pass; see `expand_chain`. The answer has phi in row `of_phi`, changes of the hinges' openings in row `of_opening`.
   pure subroutine expand_series(n, rods, rod_of, tangent, factor, d_omega, phi, phi_rate, omega_rate, hinge_x, hinge_y, left)
      integer, intent(in) :: n
      type(rod_constants), intent(in) :: rods(:)
      integer, intent(in) :: rod_of(n)
      type(rod_tangent), intent(in) :: tangent(n)
      type(series_factor), intent(in) :: factor(n)
      real(wp), intent(in) :: d_omega, phi(n), phi_rate(n), omega_rate, hinge_x, hinge_y
      real(wp), intent(inout) :: left(5, n)
      real(wp) :: inner(5)
      integer :: k

      inner = [hinge_x, hinge_y, 0.0_wp, 0.0_wp, omega_rate]
      do k = 1, n
         associate (t => tangent(k), f => factor(k), length => rods(rod_of(k))%length)
            inner(by_ae:by_an) = [t%cd*inner(by_ae) + t%sd*inner(by_an), t%cd*inner(by_an) - t%sd*inner(by_ae)]
            left(:, k) = left(:, k) - matmul(f%by_inner, inner)
            inner(by_ae) = inner(by_ae) - length*(2.0_wp*t%w*(d_omega + phi_rate(k)) + t%wr*phi(k)) + f%ae_w*omega_rate + &
                           f%ae_phi*left(of_phi, k)
            inner(by_an) = inner(by_an) - length*t%w**2*phi(k) + length*omega_rate + f%an_phi*left(of_phi, k)
            inner(by_tau_s) = left(of_phi, k) + f%bend(2)*(left(of_moment, k) + f%outer_ratio*left(of_moment_out, k))
            inner(by_tau_x) = left(of_phi, k) + f%slope(2)*(f%stiffness*left(of_opening, k) + f%outer_ratio*left(of_spring_out, k))
         end associate
      end do
   end subroutine expand_series

end module rodyn_newton_series
