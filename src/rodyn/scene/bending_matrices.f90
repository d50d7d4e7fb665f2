!> Inertia and stiffness of one rod as matrices over its bending coordinates, whatever their number: none (rigid or
!> massless rods), the slopes alpha, beta, or these and the bubble. For code that is written once for all of them.
module rodyn_bending_matrices
   use rodyn_kinds, only: wp
   use rodyn_rod_constants, only: rod_constants
   implicit none (type, external)
   private
   public :: bending_matrices, new_bending_matrices, most_shapes

   integer, parameter :: most_shapes = 3 !! bending coordinates of a rod at most

   !> With x the bending coordinates, N their shapes and m(s) the mass per length. Rows beyond the rod's coordinates are zero.
   !> Units are those of alpha, beta [rad]; the bubble is a length and has 1/m less.
   type :: bending_matrices
      integer :: n = 0                                   !! bending coordinates
      real(wp) :: first(most_shapes) = 0.0_wp            !! int m N [kg m]
      real(wp) :: turning(most_shapes) = 0.0_wp          !! int m s N [kg m^2]
      real(wp) :: inertia(most_shapes, most_shapes) = 0.0_wp   !! B = int m N N^T [kg m^2]
      real(wp) :: second(most_shapes, most_shapes) = 0.0_wp    !! in int m |r|^2: B; B - S if `inextensible`; 0 in `paper`
      real(wp) :: centrifugal(most_shapes, most_shapes) = 0.0_wp !! W^2 on x: B; B - S if `inextensible` [kg m^2]
      real(wp) :: shortening(most_shapes, most_shapes) = 0.0_wp  !! D(l) of the foreshortening (`rodyn_rod_integrals`) [m]
      real(wp) :: drawn(most_shapes, most_shapes) = 0.0_wp     !! E = int m D [kg m]
      logical :: inextensible = .false.                  !! the arc keeps its length: D, E, S are not zero
      real(wp) :: across(most_shapes, 6) = 0.0_wp        !! int m N_a D_i [kg m^2]
      real(wp) :: products(6, 6) = 0.0_wp                !! int m D_i D_j [kg m^2]
      real(wp) :: stiffness(most_shapes, most_shapes) = 0.0_wp !! elastic energy is x^T stiffness x / 2 [N m]
   end type bending_matrices

contains

   !> Matrices of a rod.
   pure function new_bending_matrices(rod, n, consistent) result(bending)
      type(rod_constants), intent(in) :: rod
      integer, intent(in) :: n          !! bending coordinates: 0, 2 or 3
      logical, intent(in) :: consistent !! keep second-order inertia
      type(bending_matrices) :: bending
      integer :: last

      bending%n = n
      if (n == 0) return
      associate (i => rod%inertia)
         bending%first = [i%a1, i%b1, i%c1]
         bending%turning = [i%sa, i%sb, i%sc]
         bending%first(n + 1:) = 0.0_wp
         bending%turning(n + 1:) = 0.0_wp
         call fill(bending%inertia, n, [i%aa, i%ab, i%bb, i%ac, i%bc, i%cc])
         call fill(bending%centrifugal, n, [i%aa, i%ab, i%bb, i%ac, i%bc, i%cc] - rod%shortening%second)
         if (consistent) bending%second = bending%centrifugal
         call fill(bending%stiffness, n, [rod%stiffness, rod%bubble])
      end associate
      call fill(bending%shortening, n, rod%shortening%chord)
      call fill(bending%drawn, n, rod%shortening%first)
      bending%inextensible = bending%shortening(1, 1) > 0.0_wp
      last = n*(n + 1)/2
      bending%across(:n, :last) = rod%shortening%across(:n, :last)
      bending%products(:last, :last) = rod%shortening%products(:last, :last)
   end function new_bending_matrices

   !> The first n rows and columns of a symmetric matrix, from (1,1), (1,2), (2,2), (1,3), (2,3), (3,3).
   pure subroutine fill(matrix, n, elements)
      real(wp), intent(inout) :: matrix(:, :)
      integer, intent(in) :: n
      real(wp), intent(in) :: elements(6)
      integer :: i, j, at

      at = 0
      do j = 1, n
         do i = 1, j
            at = at + 1
            matrix(i, j) = elements(at)
            matrix(j, i) = elements(at)
         end do
      end do
   end subroutine fill

end module rodyn_bending_matrices
