!> How a rod resists bending, for a bending stiffness that may vary along it.
!>
!> With inertia its shape is the cubic of the end slopes and the elastic energy a quadratic form of them,
!>     (k11 alpha^2 + 2 k12 alpha beta + k22 beta^2)/2,   k_ij = int EI N_i'' N_j'' ds.
!> Without inertia its shape is that of statics: end moments -T_{k-1}, +T_k bend it to the slopes
!>     alpha = -(f11 T_{k-1} + f12 T_k),   beta = f12 T_{k-1} + f22 T_k,
!>     f11 = int (1 - s/l)^2/EI ds,   f12 = int (s/l)(1 - s/l)/EI ds,   f22 = int (s/l)^2/EI ds.
!> Uniform rods have k = (2 EI/l)(2, 1, 2) and f = (l/6EI)(2, 1, 2), one the inverse of the other; where EI varies the
!> cubic is stiffer than statics, the less the more rods there are.
module rodyn_rod_bending
   use rodyn_kinds, only: wp
   use rodyn_quadrature, only: gauss_rule, new_gauss_rule, composite_rule
   use rodyn_rod_integrals, only: curvature_alpha, curvature_beta
   use rodyn_rod_profile, only: rod_profile
   implicit none (type, external)
   private
   public :: slope_stiffness, slope_flexibility, inverse_of_flexibility

contains

   !> k11, k12, k22 [N m].
   pure function slope_stiffness(length, bending_stiffness, profile, rule) result(k)
      real(wp), intent(in) :: length              !! l [m]
      real(wp), intent(in) :: bending_stiffness   !! what the profile multiplies [N m^2]
      type(rod_profile), intent(in) :: profile
      type(gauss_rule), intent(in) :: rule        !! on [0, 1], exact for the profile times a parabola
      real(wp) :: k(3)
      real(wp), dimension(size(rule%points)) :: weight, s, a, b

      s = length*rule%points
      weight = length*rule%weights*bending_stiffness*profile%at(rule%points)
      a = curvature_alpha(s, length)
      b = curvature_beta(s, length)
      k = [sum(weight*a**2), sum(weight*a*b), sum(weight*b**2)]
   end function slope_stiffness

   !> f11, f12, f22 [1/(N m)]. 1/EI is no polynomial: each piece is halved until the sums stand still.
   pure function slope_flexibility(length, bending_stiffness, profile) result(f)
      real(wp), intent(in) :: length            !! l [m]
      real(wp), intent(in) :: bending_stiffness !! what the profile multiplies [N m^2]
      type(rod_profile), intent(in) :: profile  !! positive
      real(wp) :: f(3)
      integer, parameter :: n_points = 16, most_halvings = 10
      real(wp), parameter :: enough = 4.0_wp*epsilon(1.0_wp)
      type(gauss_rule) :: basis, rule
      real(wp), allocatable :: breaks(:), finer(:), weight(:)
      real(wp) :: before(3)
      integer :: i, m

      call new_gauss_rule(basis, n_points)
      breaks = profile%breaks()
      f = 0.0_wp
      do i = 0, most_halvings
         rule = composite_rule(basis, breaks)
         weight = length*rule%weights/(bending_stiffness*profile%at(rule%points))
         before = f
         associate (x => rule%points)
            f = [sum(weight*(1.0_wp - x)**2), sum(weight*x*(1.0_wp - x)), sum(weight*x**2)]
         end associate
         if (all(abs(f - before) <= enough*f)) return
         m = size(breaks)
         allocate (finer(2*m - 1))
         finer(1::2) = breaks
         finer(2::2) = 0.5_wp*(breaks(:m - 1) + breaks(2:))
         call move_alloc(finer, breaks)
      end do
   end function slope_flexibility

   !> k11, k12, k22 of a rod without inertia.
   pure function inverse_of_flexibility(f) result(k)
      real(wp), intent(in) :: f(3) !! f11, f12, f22 [1/(N m)]
      real(wp) :: k(3)
      k = [f(3), f(2), f(1)]/(f(1)*f(3) - f(2)**2)
   end function inverse_of_flexibility

end module rodyn_rod_bending
