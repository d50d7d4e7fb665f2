!> Constants of one distinct rod, as the kernels read them.
module rodyn_rod_constants
   use rodyn_kinds, only: wp
   use rodyn_quadrature, only: gauss_rule
   use rodyn_rod_integrals, only: rod_integrals, new_rod_integrals, bubble_stiffness
   implicit none (type, external)
   private
   public :: rod_constants, new_rod_constants

   !> Integrals and what follows from them. With B = ((aa, ab), (ab, bb)) the constant block of alpha'', beta'',
   !>     g = B^-1 (a1, b1),   h = B^-1 (sa, sb),
   !> and `reduced` inertias after elimination of alpha'', beta'':
   !>     m0 - (a1, b1).g,   m1 - (sa, sb).g,   m2 - (sa, sb).h.
   !> A lumped rod has no inertia at all; a rigid one has m0, m1, m2 only (its reduced inertias are those).
   type :: rod_constants
      real(wp) :: length = 0.0_wp            !! l [m]
      real(wp) :: bending_stiffness = 0.0_wp !! EI [N m^2]
      real(wp) :: kappa = 0.0_wp             !! 2 EI / l: elastic energy is kappa (alpha^2 + alpha beta + beta^2) [N m]
      type(rod_integrals) :: inertia         !! all zero when lumped; shape integrals zero when rigid
      real(wp) :: bubble(3) = 0.0_wp         !! int EI N'' Nc'' with Na, Nb, Nc
      real(wp) :: second(3) = 0.0_wp         !! aa, ab, bb where they are of second order: zero in `paper`
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
   end type rod_constants

contains

   !> Constants of a rod of constant mass per length.
   pure subroutine new_rod_constants(rod, length, mass_per_length, bending_stiffness, rule, lumped, flexible, &
                                     consistent, ok)
      type(rod_constants), intent(out) :: rod
      real(wp), intent(in) :: length            !! l [m]
      real(wp), intent(in) :: mass_per_length   !! m [kg/m]
      real(wp), intent(in) :: bending_stiffness !! EI [N m^2]; ignored for rigid rods
      type(gauss_rule), intent(in) :: rule      !! for the integrals
      logical, intent(in) :: lumped             !! its mass stands in the nodes
      logical, intent(in) :: flexible           !! alpha, beta have inertia
      logical, intent(in) :: consistent         !! keep second-order inertia
      logical, intent(out) :: ok                !! false: B is not positive definite
      real(wp) :: mass(size(rule%points))

      ok = .true.
      rod%length = length
      rod%length_2 = length**2
      rod%bending_stiffness = bending_stiffness
      rod%kappa = 2.0_wp*bending_stiffness/length
      if (lumped) return
      mass = mass_per_length
      rod%inertia = new_rod_integrals(length, mass, rule)
      if (flexible) then
         rod%bubble = bubble_stiffness(length, spread(bending_stiffness, 1, size(rule%points)), rule)
         if (consistent) rod%second = [rod%inertia%aa, rod%inertia%ab, rod%inertia%bb]
         call reduce(rod, ok)
      else
         associate (i => rod%inertia)
            rod%inertia = rod_integrals(m0=i%m0, m1=i%m1, m2=i%m2)
         end associate
         rod%m0_reduced = rod%inertia%m0
         rod%m1_reduced = rod%inertia%m1
         rod%m2_reduced = rod%inertia%m2
      end if
      rod%central = rod%m0_reduced*rod%m2_reduced - rod%m1_reduced**2
      rod%length_m1 = length*rod%m1_reduced
      rod%offset = length*rod%m0_reduced - rod%m1_reduced
      rod%outer = rod%m2_reduced - 2.0_wp*length*rod%m1_reduced + length**2*rod%m0_reduced
   end subroutine new_rod_constants

   !> Eliminate alpha'', beta'' from the inertia of a rod, MODEL sec. 4.
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
