!> Stiff modes of a mechanical system, which an integrator solves implicitly (`rodyn_modal_reply`).
module rodyn_stiff_modes
   use rodyn_kinds, only: wp
   use rodyn_lanes, only: s => lanes
   use rodyn_lane_algebra, only: project, project_pair, expand
   implicit none (type, external)
   private
   public :: stiff_modes

   real(wp), parameter :: much = 0.03_wp !! coupling of modes by dampers that matters

   !> The stiff part of M(q) p' = ... - K q - D p near a configuration, in modes that are orthogonal for K + w D:
   !>     M^-1 (K + w D) ~ sum square_i u_i v_i^T,   v_i^T u_j = delta_ij,
   !>     M^-1 D ~ sum square_i (influence_i . influence_j) u_i v_j^T.
   !> `influence_i`: how mode i moves the dampers, D = G G^T, influence_i = G^T u_i. If dampers are weak or much stronger than the
   !> springs, the modes are nearly orthogonal for both. Else they are `coupled`: the products of different modes matter, too. How
   !> much dampers matter beside springs depends on the length of a step, and so does that.
   type :: stiff_modes
      integer :: n = 0                       !! modes; their number changes, so the arrays have room for `most`
      integer :: n_dampers = 0
      logical :: coupled = .false.           !! in the steps in hand, see `coupling`
      logical :: may_couple = .false.        !! in steps of some length
      real(wp) :: weight = 0.0_wp            !! w [1/s]
      real(wp), allocatable :: square(:)          !! (most) [1/s^2]
      real(wp), allocatable :: omega_2(:)         !! square_i - w damping_i: by springs alone (most) [rad^2/s^2]
      real(wp), allocatable :: damping(:)         !! square_i influence_i . influence_i (most) [1/s]
      real(wp), allocatable :: u(:, :)            !! shapes, transposed (most, n_dof)
      real(wp), allocatable :: v(:, :)            !! their duals, without ignorable coordinates (n_dof - n_ignorable, most)
      real(wp), allocatable :: influence(:, :)    !! (most, n_dampers) [s^1/2]
      real(wp), allocatable :: influence_t(:, :)  !! the same, transposed
      real(wp), allocatable, private :: work(:), damper_rates(:), lane_damper_rates(:, :) !! (most), (n_dampers), (lanes, n_dampers)
   contains
      procedure :: reserve
      procedure :: fastest
      procedure :: stiff_rates
      procedure :: stiff_line
      procedure :: bound_coupling
      procedure :: couples
      procedure :: lost_response
   end type stiff_modes

contains

   !> Make room for so many modes and dampers, if that is not what there is.
   subroutine reserve(self, most, n_dof, n_ignorable, n_dampers)
      class(stiff_modes), intent(inout) :: self
      integer, intent(in) :: most, n_dof, n_ignorable, n_dampers

      if (allocated(self%square)) then
         if (size(self%square) == most .and. self%n_dampers == n_dampers) return
         deallocate (self%square, self%omega_2, self%damping, self%u, self%v, self%influence, self%influence_t, self%work, &
                     self%damper_rates, self%lane_damper_rates)
      end if
      self%n_dampers = n_dampers
      allocate (self%square(most), self%omega_2(most), self%damping(most), self%u(most, n_dof), self%v(n_dof - n_ignorable, most), &
                self%influence(most, n_dampers), self%influence_t(n_dampers, most), self%work(most), self%damper_rates(n_dampers), &
                self%lane_damper_rates(s, n_dampers))
   end subroutine reserve

   !> The fastest rate, dampers included as far as their weight does [rad/s].
   pure real(wp) function fastest(self)
      class(stiff_modes), intent(in) :: self
      fastest = 0.0_wp
      if (self%n > 0) fastest = sqrt(maxval(self%square(:self%n)))
   end function fastest

   !> What stiff forces take from the accelerations at several states at once, in modes: v.M^-1 (K q + D p).
   subroutine stiff_rates(self, q, p, rates, work)
      class(stiff_modes), intent(inout) :: self
      real(wp), contiguous, intent(in) :: q(:, :), p(:, :)  !! (lanes, n_dof - n_ignorable)
      real(wp), contiguous, intent(out) :: rates(:, :)      !! (lanes, most)
      real(wp), contiguous, intent(inout) :: work(:, :)     !! (lanes, most)
      integer :: i, l

      call project(size(q, 2), self%n, self%v, q, rates)
      call project(size(q, 2), self%n, self%v, p, work)
      if (.not. self%coupled) then
         do i = 1, self%n
            rates(:, i) = self%omega_2(i)*rates(:, i) + self%damping(i)*work(:, i)
         end do
         return
      end if
      do i = 1, self%n
         !$omp simd
         do l = 1, s
            work(l, i) = work(l, i) - self%weight*rates(l, i)
         end do
      end do
      self%lane_damper_rates = 0.0_wp
      call expand(self%n_dampers, self%n, size(self%influence, 1), self%influence, work, self%lane_damper_rates)
      call expand(self%n, self%n_dampers, self%n_dampers, self%influence_t, self%lane_damper_rates, rates)
      do i = 1, self%n
         rates(:, i) = self%square(i)*rates(:, i)
      end do
   end subroutine stiff_rates

   !> The same at one state in uniform motion: v.M^-1 (K (q + t p) + D p) = offset + t slope.
   subroutine stiff_line(self, q, p, offset, slope)
      class(stiff_modes), intent(inout) :: self
      real(wp), contiguous, intent(in) :: q(:), p(:)             !! (n_dof - n_ignorable)
      real(wp), contiguous, intent(out) :: offset(:), slope(:)   !! (most)
      integer :: i

      call project_pair(size(q), self%n, self%v, q, p, offset, slope)
      associate (n => self%n, w => self%weight)
         if (.not. self%coupled) then
            do i = 1, n
               offset(i) = self%omega_2(i)*offset(i) + self%damping(i)*slope(i)
               slope(i) = self%omega_2(i)*slope(i)
            end do
            return
         end if
         self%work(:n) = slope(:n) - w*offset(:n)
         call sum_damper_rates(self)
         do i = 1, n
            offset(i) = self%square(i)*(offset(i) + dot_product(self%influence_t(:, i), self%damper_rates))
         end do
         self%work(:n) = slope(:n)
         call sum_damper_rates(self)
         do i = 1, n
            slope(i) = self%square(i)*(slope(i) - w*dot_product(self%influence_t(:, i), self%damper_rates))
         end do
      end associate
   end subroutine stiff_line

   !> Whether dampers couple the modes in steps whose h lambda has the size 1/weight: the largest norm of a row of h lambda D
   !> without its diagonal, in units that make the diagonal of 1 + h^2 lambda^2 (K + w D) one. (What couples K is as large.)
   pure logical function couples(self, weight)
      class(stiff_modes), intent(in) :: self
      real(wp), intent(in) :: weight !! [1/s]
      real(wp) :: row
      integer :: i, j

      couples = .false.
      if (.not. self%may_couple) return
      do i = 1, self%n
         row = 0.0_wp
         do j = 1, self%n
            if (j /= i) row = row + self%square(j)/(weight**2 + self%square(j))*contact(self, i, j)
         end do
         couples = weight**2*self%square(i)/(weight**2 + self%square(i))*row > much**2
         if (couples) return
      end do
   end function couples

   !> Whether they do in steps of any length: each term of a row is largest where weight^2 = omega_i omega_j.
   pure subroutine bound_coupling(self)
      class(stiff_modes), intent(inout) :: self
      real(wp) :: omega(self%n), row
      integer :: i, j

      self%may_couple = .false.
      if (self%n_dampers == 0) return
      omega = sqrt(self%square(:self%n))
      do i = 1, self%n
         row = 0.0_wp
         do j = 1, self%n
            if (j /= i) row = row + (omega(i)*omega(j)/(omega(i) + omega(j)))**2*contact(self, i, j)
         end do
         self%may_couple = row > much**2
         if (self%may_couple) return
      end do
   end subroutine bound_coupling

   !> Square of how two modes move the dampers together [s^2].
   pure real(wp) function contact(self, i, j)
      type(stiff_modes), intent(in) :: self
      integer, intent(in) :: i, j
      contact = dot_product(self%influence_t(:, i), self%influence_t(:, j))**2
   end function contact

   !> What all modes together, each by its `work`, do to the dampers.
   subroutine sum_damper_rates(self)
      class(stiff_modes), intent(inout) :: self
      integer :: k
      do k = 1, self%n_dampers
         self%damper_rates(k) = dot_product(self%influence(:self%n, k), self%work(:self%n))
      end do
   end subroutine sum_damper_rates

   !> What a step of collocation loses of positions, in tolerances. A mode that gives way fast follows its force, q ~ v.N/omega^2,
   !> and of that P_s, which vanishes at all nodes, is lost: order s instead of 2 s. The answer of q' = -r q + r P_s at the end of a
   !> step is h r exp(-h r/2) i_s(h r/2), i_s a modified spherical Bessel function, which is close to exp(-s(s + 1)/(h r)).
   pure real(wp) function lost_response(self, h, forces, reach)
      class(stiff_modes), intent(in) :: self
      real(wp), intent(in) :: h            !! [s]
      real(wp), intent(in) :: forces(:, :) !! v.N of the modes, coefficients of P_0..P_7 (s, most)
      real(wp), intent(in) :: reach(:)     !! |u_i| in tolerances of positions (most)
      real(wp), dimension(4:7) :: square   ! of q, for each degree
      real(wp) :: r, share, high, low
      integer :: i

      square = 0.0_wp
      do i = 1, self%n
         r = sqrt(self%omega_2(i))
         if (self%damping(i) > r) r = self%omega_2(i)/self%damping(i)
         if (.not. h*r > 1.0_wp) cycle ! 1e-31
         share = exp(-real(s*(s + 1), wp)/(h*r))*reach(i)/self%omega_2(i)
         square = square + (share*forces(5:8, i))**2
      end do
      high = square(7) + square(6)
      low = square(5) + square(4)
      lost_response = sqrt(high)
      if (high < low) lost_response = lost_response*(high/low)**0.375_wp ! from degree 6.5 to 8
   end function lost_response

end module rodyn_stiff_modes
