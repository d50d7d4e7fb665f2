!> Constants of one distinct rod, as the kernels read them.
module rodyn_rod_constants
   use rodyn_kinds, only: wp
   use rodyn_quadrature, only: gauss_rule, new_gauss_rule, composite_rule
   use rodyn_rod_bending, only: slope_stiffness, slope_flexibility, inverse_of_flexibility
   use rodyn_rod_integrals, only: rod_integrals, new_rod_integrals, bubble_stiffness, &
                                  shortening_integrals, new_shortening_integrals
   use rodyn_rod_profile, only: rod_profile
   implicit none (type, external)
   private
   public :: rod_constants, new_rod_constants, stiffen

   !> Integrals and what follows from them. With B = ((aa, ab), (ab, bb)) the constant block of alpha'', beta'',
   !>     g = B^-1 (a1, b1),   h = B^-1 (sa, sb),
   !> and `reduced` inertias after elimination of alpha'', beta'':
   !>     m0 - (a1, b1).g,   m1 - (sa, sb).g,   m2 - (sa, sb).h.
   !> A lumped rod has no inertia at all; a rigid one has m0, m1, m2 only (its reduced inertias are those); one that bends by
   !> statics has all integrals and no reduced inertias.
   type :: rod_constants
      real(wp) :: length = 0.0_wp            !! l [m]
      real(wp) :: bending_stiffness = 0.0_wp !! EI, where it varies what the profile multiplies [N m^2]
      real(wp) :: stiffness(3) = 0.0_wp      !! k11, k12, k22 of the slopes, (2 EI/l)(2, 1, 2) if uniform [N m]
      real(wp) :: carry_over(2) = 0.5_wp     !! k12/k11, k12/k22 (Cross): 1/2 if uniform
      real(wp) :: flexibility(3) = 0.0_wp    !! f11, f12, f22 of a rod that bends without inertia [1/(N m)]
      type(rod_integrals) :: inertia         !! all zero when lumped; shape integrals zero when rigid
      real(wp) :: bubble(3) = 0.0_wp         !! int EI N'' Nc'' with Na, Nb, Nc
      real(wp) :: share(2) = 0.0_wp          !! mass that goes to the inner and the outer node when lumped [kg]
      type(shortening_integrals) :: shortening !! zero unless the arc of the rod keeps its length
      real(wp) :: second(3) = 0.0_wp         !! of second order in m2: aa, ab, bb; less S if `inextensible`; zero in `paper`
      real(wp) :: b_inverse(3) = 0.0_wp      !! B^-1: (1,1), (1,2), (2,2) [1/(kg m^2)]
      real(wp) :: g(2) = 0.0_wp              !! [1/m]
      real(wp) :: h(2) = 0.0_wp              !! [1]
      real(wp) :: m0_reduced = 0.0_wp        !! [kg]
      real(wp) :: m1_reduced = 0.0_wp        !! [kg m]
      real(wp) :: m2_reduced = 0.0_wp        !! [kg m^2]
      real(wp) :: central = 0.0_wp           !! m0 m2 - m1^2 of the reduced inertias [kg^2 m^2]
      real(wp) :: length_2 = 0.0_wp          !! l^2 [m^2]
      real(wp) :: length_m1 = 0.0_wp         !! l m1 of the reduced inertias [kg m^2]
      real(wp) :: offset = 0.0_wp            !! l m0 - m1 of them [kg m]
      real(wp) :: outer = 0.0_wp             !! m2 - 2 l m1 + l^2 m0 of them: moment about the outer node [kg m^2]
      real(wp) :: by_chord(2, 2) = 0.0_wp    !! B^-1 D(l) [1/(kg m)]
      real(wp) :: by_first(2, 2) = 0.0_wp    !! B^-1 E [1/m]
   end type rod_constants

contains

   !> Constants of a rod. Profiles multiply its mass per length and its bending stiffness; without them it is uniform.
   pure subroutine new_rod_constants(rod, length, mass_per_length, bending_stiffness, rule, lumped, flexible, &
                                     consistent, ok, mass_profile, stiffness_profile, inextensible)
      type(rod_constants), intent(out) :: rod
      real(wp), intent(in) :: length            !! l [m]
      real(wp), intent(in) :: mass_per_length   !! m [kg/m]
      real(wp), intent(in) :: bending_stiffness !! EI [N m^2]; 0 for rigid rods
      type(gauss_rule), intent(in) :: rule      !! for the integrals of a uniform rod
      logical, intent(in) :: lumped             !! its mass stands in the nodes
      logical, intent(in) :: flexible           !! alpha, beta have inertia
      logical, intent(in) :: consistent         !! keep second-order inertia
      logical, intent(out) :: ok                !! false: B, or the stiffness of the slopes, is not positive definite
      type(rod_profile), intent(in), optional :: mass_profile, stiffness_profile
      logical, intent(in), optional :: inextensible !! the arc keeps its length, not the chord
      logical :: shortens

      ok = .true.
      shortens = .false.
      if (present(inextensible)) shortens = flexible .and. inextensible
      rod%length = length
      rod%length_2 = length**2
      rod%bending_stiffness = bending_stiffness
      if (bending_stiffness > 0.0_wp) call resist_bending(rod, rule, flexible, ok, stiffness_profile)
      call integrate_mass(rod, mass_per_length, rule, lumped, shortens, mass_profile)
      if (lumped .or. .not. ok) return
      if (.not. (flexible .or. bending_stiffness > 0.0_wp)) then
         call stiffen(rod)
         return
      end if
      if (consistent) rod%second = [rod%inertia%aa, rod%inertia%ab, rod%inertia%bb] - rod%shortening%second(:3)
      if (.not. flexible) return
      call reduce(rod, ok)
      call join_chain(rod)
   end subroutine new_rod_constants

   !> A rod whose bending is no motion: nothing is to be eliminated from m0, m1, m2.
   pure subroutine stiffen(rod)
      type(rod_constants), intent(inout) :: rod

      associate (i => rod%inertia)
         rod%inertia = rod_integrals(m0=i%m0, m1=i%m1, m2=i%m2)
      end associate
      rod%m0_reduced = rod%inertia%m0
      rod%m1_reduced = rod%inertia%m1
      rod%m2_reduced = rod%inertia%m2
      call join_chain(rod)
   end subroutine stiffen

   !> What the recursions make of the reduced inertias where the rod carries a chain.
   pure subroutine join_chain(rod)
      type(rod_constants), intent(inout) :: rod

      associate (length => rod%length)
         rod%central = rod%m0_reduced*rod%m2_reduced - rod%m1_reduced**2
         rod%length_m1 = length*rod%m1_reduced
         rod%offset = length*rod%m0_reduced - rod%m1_reduced
         rod%outer = rod%m2_reduced - 2.0_wp*length*rod%m1_reduced + length**2*rod%m0_reduced
      end associate
   end subroutine join_chain

   !> Stiffness of the slopes, and flexibility where they have no inertia.
   pure subroutine resist_bending(rod, rule, flexible, ok, profile)
      type(rod_constants), intent(inout) :: rod
      type(gauss_rule), intent(in) :: rule
      logical, intent(in) :: flexible
      logical, intent(out) :: ok !! stiffness positive definite
      type(rod_profile), intent(in), optional :: profile
      type(gauss_rule) :: finer

      associate (l => rod%length, ei => rod%bending_stiffness, k => rod%stiffness, f => rod%flexibility)
         if (.not. is_varying(profile)) then
            k = (2.0_wp*ei/l)*[2.0_wp, 1.0_wp, 2.0_wp]
            f = l/(6.0_wp*ei)*[2.0_wp, 1.0_wp, 2.0_wp]
            rod%bubble = bubble_stiffness(l, spread(ei, 1, size(rule%points)), rule)
         else if (flexible) then
            finer = rule_for(profile, rule)
            k = slope_stiffness(l, ei, profile, finer)
            rod%bubble = bubble_stiffness(l, ei*profile%at(finer%points), finer)
         else
            f = slope_flexibility(l, ei, profile)
            k = inverse_of_flexibility(f)
         end if
         ok = min(k(1), k(3)) > 0.0_wp .and. k(1)*k(3) > k(2)**2
         if (ok) rod%carry_over = k(2)/[k(1), k(3)]
      end associate
   end subroutine resist_bending

   !> Integrals over the mass, or what of it goes to the nodes: half, or what keeps the centre of mass in its place.
   pure subroutine integrate_mass(rod, mass_per_length, rule, lumped, shortens, profile)
      type(rod_constants), intent(inout) :: rod
      real(wp), intent(in) :: mass_per_length
      type(gauss_rule), intent(in) :: rule
      logical, intent(in) :: lumped, shortens
      type(rod_profile), intent(in), optional :: profile
      type(gauss_rule) :: finer

      if (is_varying(profile)) then
         finer = rule_for(profile, rule)
         rod%inertia = new_rod_integrals(rod%length, mass_per_length*profile%at(finer%points), finer)
         associate (i => rod%inertia)
            rod%share = [i%m0 - i%m1/rod%length, i%m1/rod%length]
         end associate
      else if (lumped) then
         rod%share = 0.5_wp*rod%length*mass_per_length
      else
         rod%inertia = new_rod_integrals(rod%length, spread(mass_per_length, 1, size(rule%points)), rule)
      end if
      if (lumped) rod%inertia = rod_integrals()
      if (shortens) call integrate_shortening(rod, mass_per_length, size(rule%points) + 4, profile)
   end subroutine integrate_mass

   !> Integrals of the foreshortening. Those of d^2 have degree 10 with two shapes and 14 with three, those of v^2 6 and 8.
   pure subroutine integrate_shortening(rod, mass_per_length, n_points, profile)
      type(rod_constants), intent(inout) :: rod
      real(wp), intent(in) :: mass_per_length
      integer, intent(in) :: n_points
      type(rod_profile), intent(in), optional :: profile
      type(gauss_rule) :: rule

      call new_gauss_rule(rule, n_points)
      if (is_varying(profile)) then
         rule = rule_for(profile, rule)
         rod%shortening = new_shortening_integrals(rod%length, mass_per_length*profile%at(rule%points), rule)
      else
         rod%shortening = new_shortening_integrals(rod%length, spread(mass_per_length, 1, n_points), rule)
      end if
   end subroutine integrate_shortening

   pure logical function is_varying(profile)
      type(rod_profile), intent(in), optional :: profile
      is_varying = .false.
      if (present(profile)) is_varying = profile%varies()
   end function is_varying

   !> The rule with as many points more as the degree of the profile asks for, on each of its pieces.
   pure function rule_for(profile, rule) result(finer)
      type(rod_profile), intent(in) :: profile
      type(gauss_rule), intent(in) :: rule
      type(gauss_rule) :: finer
      type(gauss_rule) :: piece
      call new_gauss_rule(piece, size(rule%points) + (profile%degree() + 1)/2)
      finer = composite_rule(piece, profile%breaks())
   end function rule_for

   !> Eliminate alpha'', beta'' from the inertia of a rod, docs/model.md sec. 4.
   pure subroutine reduce(rod, ok)
      type(rod_constants), intent(inout) :: rod
      logical, intent(out) :: ok !! B positive definite
      real(wp) :: determinant

      associate (i => rod%inertia)
         determinant = i%aa*i%bb - i%ab**2
         ok = determinant > 8.0_wp*epsilon(1.0_wp)*i%aa*i%bb
         if (.not. ok) return
         rod%b_inverse = [i%bb, -i%ab, i%aa]/determinant
         rod%g = solve_b(rod, i%a1, i%b1)
         rod%h = solve_b(rod, i%sa, i%sb)
         rod%m0_reduced = i%m0 - i%a1*rod%g(1) - i%b1*rod%g(2)
         rod%m1_reduced = i%m1 - i%sa*rod%g(1) - i%sb*rod%g(2)
         rod%m2_reduced = i%m2 - i%sa*rod%h(1) - i%sb*rod%h(2)
      end associate
      associate (d => rod%shortening%chord, e => rod%shortening%first)
         rod%by_chord = reshape([solve_b(rod, d(1), d(2)), solve_b(rod, d(2), d(3))], [2, 2])
         rod%by_first = reshape([solve_b(rod, e(1), e(2)), solve_b(rod, e(2), e(3))], [2, 2])
      end associate
   end subroutine reduce

   !> B^-1 (x, y).
   pure function solve_b(rod, x, y) result(z)
      type(rod_constants), intent(in) :: rod
      real(wp), intent(in) :: x, y
      real(wp) :: z(2)
      z(1) = rod%b_inverse(1)*x + rod%b_inverse(2)*y
      z(2) = rod%b_inverse(2)*x + rod%b_inverse(3)*y
   end function solve_b

end module rodyn_rod_constants
