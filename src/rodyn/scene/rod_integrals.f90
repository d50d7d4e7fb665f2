!> Shape functions of a rod and the inertia integrals over them, docs/model.md sec. 1 and 3.
module rodyn_rod_integrals
   use rodyn_kinds, only: wp
   use rodyn_quadrature, only: gauss_rule, new_gauss_rule
   implicit none (type, external)
   private
   public :: rod_integrals, new_rod_integrals, shape_alpha, shape_beta, curvature_alpha, curvature_beta
   public :: bubble_stiffness, shortening_integrals, new_shortening_integrals

   !> Integrals over one rod, 0 <= s <= l; m(s) is its mass per length.
   type :: rod_integrals
      real(wp) :: m0 = 0.0_wp !! int m [kg]
      real(wp) :: m1 = 0.0_wp !! int m s [kg m]
      real(wp) :: m2 = 0.0_wp !! int m s^2 [kg m^2]
      real(wp) :: a1 = 0.0_wp !! int m Na [kg m]
      real(wp) :: b1 = 0.0_wp !! int m Nb [kg m]
      real(wp) :: sa = 0.0_wp !! int m s Na [kg m^2]
      real(wp) :: sb = 0.0_wp !! int m s Nb [kg m^2]
      real(wp) :: aa = 0.0_wp !! int m Na^2 [kg m^2]
      real(wp) :: ab = 0.0_wp !! int m Na Nb [kg m^2]
      real(wp) :: bb = 0.0_wp !! int m Nb^2 [kg m^2]
      real(wp) :: c1 = 0.0_wp !! int m Nc [kg]
      real(wp) :: sc = 0.0_wp !! int m s Nc [kg m]
      real(wp) :: ac = 0.0_wp !! int m Na Nc [kg m]
      real(wp) :: bc = 0.0_wp !! int m Nb Nc [kg m]
      real(wp) :: cc = 0.0_wp !! int m Nc^2 [kg]
   end type rod_integrals

   !> Foreshortening of a rod whose arc keeps its length: a point at s moves towards the inner node by d(s) = x.D(s) x/2 with the
   !> bending coordinates x and D(s) = int_0^s N' N'^T. Elements (1,1), (1,2), (2,2), (1,3), (2,3), (3,3) of symmetric matrices over
   !> x; what belongs to the bubble has 1/m less for each of its indices.
   type :: shortening_integrals
      real(wp) :: chord(6) = 0.0_wp       !! D(l) [m]
      real(wp) :: first(6) = 0.0_wp       !! E = int m D [kg m]
      real(wp) :: second(6) = 0.0_wp      !! S = int m s D [kg m^2]
      real(wp) :: across(3, 6) = 0.0_wp   !! int m N_a D_i [kg m^2]
      real(wp) :: products(6, 6) = 0.0_wp !! int m D_i D_j [kg m^2]
   end type shortening_integrals

contains

   !> Na(s) = s (1 - s/l)^2: deflection for a unit slope at the inner end [m].
   elemental real(wp) function shape_alpha(s, length)
      real(wp), intent(in) :: s      !! arc length from the inner node [m]
      real(wp), intent(in) :: length !! l [m]
      shape_alpha = s*(1.0_wp - s/length)**2
   end function shape_alpha

   !> Nb(s) = -(s^2/l)(1 - s/l): deflection for a unit slope at the outer end [m].
   elemental real(wp) function shape_beta(s, length)
      real(wp), intent(in) :: s      !! arc length from the inner node [m]
      real(wp), intent(in) :: length !! l [m]
      shape_beta = -(s**2/length)*(1.0_wp - s/length)
   end function shape_beta

   !> Nc(s) = 16 (s/l)^2 (1 - s/l)^2: the bubble, 1 in the middle, without deflection and slope at both ends [1].
   elemental real(wp) function shape_bubble(s, length)
      real(wp), intent(in) :: s      !! arc length from the inner node [m]
      real(wp), intent(in) :: length !! l [m]
      shape_bubble = 16.0_wp*((s/length)*(1.0_wp - s/length))**2
   end function shape_bubble

   !> N' N'^T of the three shapes: (1,1), (1,2), (2,2), (1,3), (2,3), (3,3).
   pure function slope_products(s, length) result(products)
      real(wp), intent(in) :: s      !! arc length from the inner node [m]
      real(wp), intent(in) :: length !! l [m]
      real(wp) :: products(6)
      real(wp) :: x, a, b, c

      x = s/length
      a = (1.0_wp - x)*(1.0_wp - 3.0_wp*x)
      b = x*(3.0_wp*x - 2.0_wp)
      c = 32.0_wp*x*(1.0_wp - x)*(1.0_wp - 2.0_wp*x)/length
      products = [a*a, a*b, b*b, a*c, b*c, c*c]
   end function slope_products

   !> Na'' = (6 s/l - 4)/l [1/m].
   elemental real(wp) function curvature_alpha(s, length)
      real(wp), intent(in) :: s      !! arc length from the inner node [m]
      real(wp), intent(in) :: length !! l [m]
      curvature_alpha = (6.0_wp*s/length - 4.0_wp)/length
   end function curvature_alpha

   !> Nb'' = (6 s/l - 2)/l [1/m].
   elemental real(wp) function curvature_beta(s, length)
      real(wp), intent(in) :: s      !! arc length from the inner node [m]
      real(wp), intent(in) :: length !! l [m]
      curvature_beta = (6.0_wp*s/length - 2.0_wp)/length
   end function curvature_beta

   !> Nc'' = 32 (1 - 6 s/l + 6 (s/l)^2)/l^2 [1/m^2].
   elemental real(wp) function curvature_bubble(s, length)
      real(wp), intent(in) :: s      !! arc length from the inner node [m]
      real(wp), intent(in) :: length !! l [m]
      curvature_bubble = 32.0_wp*(1.0_wp - 6.0_wp*(s/length)*(1.0_wp - s/length))/length**2
   end function curvature_bubble

   !> All integrals of a rod by a Gauss rule. The mass per length may vary along the rod: it is given at the
   !> points of the rule. A constant one needs 4 points (Na^2 has degree 6),
   !> or 5 with the bubble (Nc^2 has degree 8).
   pure function new_rod_integrals(length, mass_per_length, rule) result(integrals)
      real(wp), intent(in) :: length             !! l [m]
      real(wp), intent(in) :: mass_per_length(:) !! m at s = l*rule%points (points) [kg/m]
      type(gauss_rule), intent(in) :: rule       !! on [0, 1]
      type(rod_integrals) :: integrals
      real(wp), dimension(size(rule%points)) :: s, dm, na, nb, nc

      s = length*rule%points
      dm = length*rule%weights*mass_per_length
      na = shape_alpha(s, length)
      nb = shape_beta(s, length)
      nc = shape_bubble(s, length)
      integrals%m0 = sum(dm)
      integrals%m1 = sum(dm*s)
      integrals%m2 = sum(dm*s**2)
      integrals%a1 = sum(dm*na)
      integrals%b1 = sum(dm*nb)
      integrals%sa = sum(dm*s*na)
      integrals%sb = sum(dm*s*nb)
      integrals%aa = sum(dm*na**2)
      integrals%ab = sum(dm*na*nb)
      integrals%bb = sum(dm*nb**2)
      integrals%c1 = sum(dm*nc)
      integrals%sc = sum(dm*s*nc)
      integrals%ac = sum(dm*na*nc)
      integrals%bc = sum(dm*nb*nc)
      integrals%cc = sum(dm*nc**2)
   end function new_rod_integrals

   !> Integrals of the foreshortening, with the mass per length at the points of a Gauss rule.
   pure function new_shortening_integrals(length, mass_per_length, rule) result(integrals)
      real(wp), intent(in) :: length             !! l [m]
      real(wp), intent(in) :: mass_per_length(:) !! m at s = l*rule%points (points) [kg/m]
      type(gauss_rule), intent(in) :: rule       !! on [0, 1]
      type(shortening_integrals) :: integrals
      type(gauss_rule) :: exact
      real(wp) :: dm, s, d(6), shapes(3)
      integer :: i, j

      call new_gauss_rule(exact, 4) ! N' N'^T has degree 6
      integrals%chord = shortening_up_to(length)
      do i = 1, size(rule%points)
         s = length*rule%points(i)
         dm = length*rule%weights(i)*mass_per_length(i)
         d = shortening_up_to(s)
         shapes = [shape_alpha(s, length), shape_beta(s, length), shape_bubble(s, length)]
         integrals%first = integrals%first + dm*d
         integrals%second = integrals%second + dm*s*d
         do j = 1, 6
            integrals%across(:, j) = integrals%across(:, j) + dm*d(j)*shapes
            integrals%products(:, j) = integrals%products(:, j) + dm*d(j)*d
         end do
      end do

   contains

      !> D(s).
      pure function shortening_up_to(s) result(d)
         real(wp), intent(in) :: s !! [m]
         real(wp) :: d(6)
         integer :: j

         d = 0.0_wp
         do j = 1, size(exact%points)
            d = d + s*exact%weights(j)*slope_products(s*exact%points(j), length)
         end do
      end function shortening_up_to

   end function new_shortening_integrals

   !> int EI N'' Nc'' for N = Na, Nb [N] and Nc [N/m], by a Gauss rule. A constant EI couples the bubble with nothing:
   !> integrated twice by parts, Nc'' against a linear function leaves only what Nc is at the ends.
   pure function bubble_stiffness(length, bending_stiffness, rule) result(integrals)
      real(wp), intent(in) :: length               !! l [m]
      real(wp), intent(in) :: bending_stiffness(:) !! EI at s = l*rule%points (points) [N m^2]
      type(gauss_rule), intent(in) :: rule         !! on [0, 1]
      real(wp) :: integrals(3)
      real(wp), dimension(size(rule%points)) :: s, moment

      s = length*rule%points
      moment = length*rule%weights*bending_stiffness*curvature_bubble(s, length)
      integrals(1) = sum(moment*curvature_alpha(s, length))
      integrals(2) = sum(moment*curvature_beta(s, length))
      integrals(3) = sum(moment*curvature_bubble(s, length))
   end function bubble_stiffness

end module rodyn_rod_integrals
