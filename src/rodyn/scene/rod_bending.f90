!> Inertia and stiffness of one rod as matrices over its bending coordinates, whatever their number: none (rigid or
!> massless rods) or the slopes alpha, beta. For code that is written once for all of them.
module rodyn_rod_bending
   use rodyn_kinds, only: wp
   use rodyn_rod_constants, only: rod_constants
   implicit none (type, external)
   private
   public :: rod_bending, new_rod_bending, most_shapes

   integer, parameter :: most_shapes = 2 !! bending coordinates of a rod at most

   !> With x the bending coordinates, N their shapes and m(s) the mass per length.
   type :: rod_bending
      integer :: n = 0                                   !! bending coordinates
      real(wp) :: first(most_shapes) = 0.0_wp            !! int m N [kg m]
      real(wp) :: turning(most_shapes) = 0.0_wp          !! int m s N [kg m^2]
      real(wp) :: inertia(most_shapes, most_shapes) = 0.0_wp   !! B = int m N N^T [kg m^2]
      real(wp) :: second(most_shapes, most_shapes) = 0.0_wp    !! B where it is of second order: zero in `paper`
      real(wp) :: stiffness(most_shapes, most_shapes) = 0.0_wp !! elastic energy is x^T stiffness x / 2 [N m]
   end type rod_bending

contains

   !> Matrices of a rod.
   pure function new_rod_bending(rod, n) result(bending)
      type(rod_constants), intent(in) :: rod
      integer, intent(in) :: n !! bending coordinates
      type(rod_bending) :: bending

      bending%n = n
      if (n == 0) return
      associate (i => rod%inertia)
         bending%first = [i%a1, i%b1]
         bending%turning = [i%sa, i%sb]
         bending%inertia = symmetric([i%aa, i%ab, i%bb])
         bending%second = symmetric(rod%second)
         bending%stiffness = symmetric([2.0_wp*rod%kappa, rod%kappa, 2.0_wp*rod%kappa])
      end associate
   end function new_rod_bending

   !> From (1,1), (1,2), (2,2).
   pure function symmetric(elements) result(matrix)
      real(wp), intent(in) :: elements(3)
      real(wp) :: matrix(2, 2)
      matrix(:, 1) = elements(1:2)
      matrix(:, 2) = elements(2:3)
   end function symmetric

end module rodyn_rod_bending
