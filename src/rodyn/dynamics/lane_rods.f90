!> Constants of rods side by side in vector lanes: the same rod of several scenes (`rodyn_lane_scene`), or several rods of one
!> scene. The same equations elsewhere: docs/model.md sec. 7.
module rodyn_lane_rods
   use rodyn_kinds, only: wp
   use rodyn_lanes, only: lanes
   use rodyn_rod_constants, only: rod_constants
   implicit none (type, external)
   private
   public :: lane_rod, put_rod

   !> What the recursion reads of a rod (`rodyn_rod_constants`).
   type :: lane_rod
      real(wp), dimension(lanes) :: length, length_2, m0, m1, a1, b1, sa, sb, m0_reduced, m1_reduced, m2_reduced, central, &
                                    length_m1, offset, outer
      real(wp), dimension(lanes, 2) :: carry_over, g, h
      real(wp), dimension(lanes, 3) :: stiffness, second, b_inverse
      ! Of rods whose arcs keep their length.
      real(wp), dimension(lanes) :: m2, aa, ab, bb
      real(wp), dimension(lanes, 3) :: shortening, drawn, across_alpha, across_beta !! D(l), E, int m Na D, int m Nb D
      real(wp), dimension(lanes, 3) :: twice, curved !! 2 (B - S), and without B
      real(wp), dimension(lanes, 3) :: turning_alpha, turning_beta !! Z^T x - Z x/2 of (alpha^2, 2 alpha beta, beta^2)
      real(wp), dimension(lanes, 2) :: skew     !! Z(2,1) - Z(1,2) of (alpha, beta)
      real(wp), dimension(lanes, 7) :: products !! int m D_i D_j: (1,1), (1,2), (2,2), (1,3), (2,3), (3,3), half of (2,2) + (1,3)
   end type lane_rod

contains

   !> Put a rod into one lane.
   pure subroutine put_rod(rods, lane, rod)
      type(lane_rod), intent(inout) :: rods
      integer, intent(in) :: lane
      type(rod_constants), intent(in) :: rod

      rods%length(lane) = rod%length
      rods%length_2(lane) = rod%length_2
      rods%m0(lane) = rod%inertia%m0
      rods%m1(lane) = rod%inertia%m1
      rods%a1(lane) = rod%inertia%a1
      rods%b1(lane) = rod%inertia%b1
      rods%sa(lane) = rod%inertia%sa
      rods%sb(lane) = rod%inertia%sb
      rods%m0_reduced(lane) = rod%m0_reduced
      rods%m1_reduced(lane) = rod%m1_reduced
      rods%m2_reduced(lane) = rod%m2_reduced
      rods%central(lane) = rod%central
      rods%length_m1(lane) = rod%length_m1
      rods%offset(lane) = rod%offset
      rods%outer(lane) = rod%outer
      rods%carry_over(lane, :) = rod%carry_over
      rods%g(lane, :) = rod%g
      rods%h(lane, :) = rod%h
      rods%stiffness(lane, :) = rod%stiffness
      rods%second(lane, :) = rod%second
      rods%b_inverse(lane, :) = rod%b_inverse
      rods%m2(lane) = rod%inertia%m2
      rods%aa(lane) = rod%inertia%aa
      rods%ab(lane) = rod%inertia%ab
      rods%bb(lane) = rod%inertia%bb
      rods%twice(lane, :) = 2.0_wp*rod%second
      rods%curved(lane, :) = rods%twice(lane, :) - [rod%inertia%aa, rod%inertia%ab, rod%inertia%bb]
      associate (short => rod%shortening)
         rods%shortening(lane, :) = short%chord(:3)
         rods%drawn(lane, :) = short%first(:3)
         rods%across_alpha(lane, :) = short%across(1, :3)
         rods%across_beta(lane, :) = short%across(2, :3)
         rods%products(lane, :) = [short%products(1, 1), short%products(1, 2), short%products(2, 2), &
                                   short%products(1, 3), short%products(2, 3), short%products(3, 3), &
                                   0.5_wp*(short%products(2, 2) + short%products(1, 3))]
      end associate
      associate (za => rods%across_alpha(lane, :), zb => rods%across_beta(lane, :))
         rods%turning_alpha(lane, :) = [0.5_wp*za(1), 0.5_wp*zb(1), zb(2) - 0.5_wp*za(3)]
         rods%turning_beta(lane, :) = [za(2) - 0.5_wp*zb(1), 0.5_wp*za(3), 0.5_wp*zb(3)]
         rods%skew(lane, :) = zb(1:2) - za(2:3)
      end associate
   end subroutine put_rod

end module rodyn_lane_rods
