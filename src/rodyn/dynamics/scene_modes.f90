!> Stiff modes of a scene near a configuration, for integrators that solve them implicitly (`rodyn_gauss_integrator`).
!>
!> With the constant K + w D = L L^T of springs, rods and dampers and M(q) = R R^T, the modes follow from the rotation Q that
!> makes the columns of B = R^-1 L Q orthogonal:
!>     square_i = |b_i|^2,   u = R^-T B/square,   v = L Q.
!> Loads, centrifugal and gyroscopic terms are left out: they are not stiff. With locked hinges T (T^T M T)^-1 T^T stands for
!> M^-1 (`rodyn_locks`).
module rodyn_scene_modes
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type
   use rodyn_stiff_modes, only: stiff_modes
   use rodyn_scene, only: scene_type
   use rodyn_hinge_law, only: hinge_law
   use rodyn_assembled, only: assembled_system, new_assembled_system, mass_matrix
   use rodyn_locks, only: has_slaves, reduce, expand, reduce_matrix
   use rodyn_orthogonal_columns, only: column_rotator
   use rodyn_lapack, only: dpotrf, dpstrf, dtrsm, dsyev, dgemv
   implicit none (type, external)
   private
   public :: modes_finder, new_modes_finder, most_dof

   integer, parameter :: most_dof = 200 !! beyond, eigenvectors cost more than they bring
   real(wp), parameter :: negligible = 1.0e-5_wp !! b_i.b_j, of the smaller square
   real(wp), parameter :: damped_negligible = 1.0e-9_wp !! likewise where dampers matter, whose squares may be large
   real(wp), parameter :: little = 0.2_wp !! of dampers beside springs: their weight is of no importance

   !> What stays constant of a scene, and memory.
   type :: modes_finder
      logical :: available = .false.
      type(assembled_system) :: system
      real(wp) :: weight = 0.0_wp            !! w in what was factored [1/s]
      real(wp) :: least_weight = 0.0_wp      !! where the step is unknown [1/s]
      real(wp) :: relaxation = 0.0_wp        !! largest ratio of a damper to its spring; 0: no dampers [s]
      real(wp), allocatable :: first(:, :)   !! L of the least weight (n_dof, rank)
      real(wp), allocatable :: columns(:, :) !! B, and below it L Q with Q of the last modes (2 n_dof, rank)
      real(wp), allocatable :: dampers(:, :) !! G, D = G G^T (n_dof, rank of D)
      real(wp), allocatable :: squares(:), work(:)
      type(column_rotator) :: rotator
   contains
      procedure :: find
      procedure :: forget
   end type modes_finder

contains

   !> Gather what stays constant.
   subroutine new_modes_finder(finder, scene, hinges)
      type(modes_finder), intent(out) :: finder
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      type(error_type), allocatable :: error

      if (scene%n_dof > most_dof) return
      call new_assembled_system(finder%system, scene, hinges, error)
      if (allocated(error)) return
      allocate (finder%work(scene%n_dof))
      call first_weight(finder, hinges)
      call factor_dampers(finder)
      call factor(finder, finder%least_weight)
      finder%first = finder%columns(scene%n_dof + 1:, :)
      finder%available = size(finder%squares) > 0
   end subroutine new_modes_finder

   !> Relaxation times of the dampers, and a weight so small that it only makes room for what nothing but dampers hold.
   subroutine first_weight(self, hinges)
      type(modes_finder), intent(inout) :: self
      type(hinge_law), intent(in) :: hinges
      real(wp), parameter :: small = 1.0e-3_wp
      real(wp) :: time, longest !! relaxation of a damper by its spring; the longest [s]
      integer :: k

      longest = 0.0_wp
      associate (stiffness => hinges%stiffness, damping => hinges%damping, locked => hinges%locked)
         do k = lbound(damping, 1), ubound(damping, 1)
            if (locked(k) .or. .not. damping(k) > 0.0_wp) cycle
            time = damping(k)/max(stiffness(k), epsilon(1.0_wp)*damping(k))
            self%relaxation = max(self%relaxation, time)
            if (stiffness(k) > 0.0_wp) longest = max(longest, time)
         end do
      end associate
      if (self%relaxation > 0.0_wp) self%least_weight = 1.0_wp
      if (longest > 0.0_wp) self%least_weight = small/max(longest, 1.0e-100_wp)
   end subroutine first_weight

   !> G of D = G G^T.
   subroutine factor_dampers(self)
      type(modes_finder), intent(inout) :: self
      real(wp), allocatable :: matrix(:, :), work(:)
      integer, allocatable :: pivots(:)
      integer :: info, m, rank, i, j

      m = size(self%system%d, 1)
      rank = 0
      if (self%relaxation > 0.0_wp) then
         matrix = self%system%d
         allocate (pivots(m), work(2*m))
         call dpstrf('L', m, matrix, m, pivots, rank, -1.0_wp, work, info)
      end if
      allocate (self%dampers(m, rank), source=0.0_wp)
      do i = 1, rank
         do j = i, m
            self%dampers(pivots(j), i) = matrix(j, i)
         end do
      end do
   end subroutine factor_dampers

   !> L of K + weight D = L L^T, without columns of zeros.
   subroutine factor(self, weight)
      type(modes_finder), intent(inout) :: self
      real(wp), intent(in) :: weight
      real(wp), allocatable :: vectors(:, :), values(:), work(:)
      integer :: info, m, i, rank

      self%weight = weight
      vectors = self%system%k + weight*self%system%d
      m = size(vectors, 1)
      allocate (values(m), work(40*m))
      call dsyev('V', 'L', m, vectors, m, values, work, size(work), info)
      rank = count(values > 1.0e-14_wp*maxval(values))
      if (info /= 0) rank = 0
      if (allocated(self%columns)) deallocate (self%columns, self%squares)
      allocate (self%columns(2*m, rank), self%squares(rank))
      do i = 1, rank
         self%columns(m + 1:, i) = vectors(:, m - rank + i)*sqrt(values(m - rank + i))
      end do
   end subroutine factor

   !> Forget the last modes: the next search begins like the first.
   subroutine forget(self)
      class(modes_finder), intent(inout) :: self

      if (.not. self%available) return
      self%weight = self%least_weight
      associate (m => size(self%first, 1), rank => size(self%first, 2))
         if (size(self%columns, 2) /= rank) then
            deallocate (self%columns, self%squares)
            allocate (self%columns(2*m, rank), self%squares(rank))
         end if
         self%columns(m + 1:, :) = self%first
      end associate
   end subroutine forget

   !> Modes at q that are faster than `slowest`, for a weight of dampers. Not `ok`: M is not positive definite.
   subroutine find(self, scene, hinges, sine, cosine, q, slowest, weight, modes, ok)
      class(modes_finder), intent(inout) :: self
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      real(wp), intent(in) :: sine(0:), cosine(0:) !! of phi (0:n)
      real(wp), intent(in) :: q(:)                 !! (n_dof)
      real(wp), intent(in) :: slowest              !! [rad/s]
      real(wp), intent(in) :: weight               !! 0: unknown [1/s]
      type(stiff_modes), intent(inout) :: modes
      logical, intent(out) :: ok
      real(wp) :: wanted
      integer :: info, i, m, rank

      wanted = merge(weight, self%least_weight, weight > 0.0_wp)
      if (weight_matters(self, wanted)) call factor(self, wanted)
      m = scene%n_dof
      rank = size(self%columns, 2)
      call mass_matrix(self%system, scene, hinges, sine, cosine, q)
      do i = 1, rank
         self%columns(:m, i) = self%columns(m + 1:, i)
         if (has_slaves(hinges)) call reduce(scene, hinges%locked, self%columns(:m, i))
      end do
      if (has_slaves(hinges)) call reduce_matrix(scene, hinges%locked, 1.0_wp, self%system%m)
      call dpotrf('L', m, self%system%m, m, info)
      ok = info == 0
      if (.not. ok) return
      call dtrsm('L', 'L', 'N', 'N', m, rank, 1.0_wp, self%system%m, m, self%columns, 2*m)
      ! It starts from what was orthogonal for an earlier configuration, so that few sweeps are enough; what little is left
      ! costs the integrator less than another sweep.
      call self%rotator%orthogonalise(self%columns, m, slowest**2, merge(damped_negligible, negligible, &
                                      self%weight*self%relaxation > little), self%squares)
      call dtrsm('L', 'L', 'T', 'N', m, rank, 1.0_wp, self%system%m, m, self%columns, 2*m)
      if (has_slaves(hinges)) then
         self%work(:) = 0.0_wp
         do i = 1, rank
            call expand(scene, hinges%locked, self%work(:scene%n), self%columns(:m, i))
         end do
      end if
      call keep_fast_modes(self, scene%n_base, slowest, modes)
      call add_dampers(self, modes)
   end subroutine find

   !> Whether modes for this weight of dampers are others than those of the weight that was factored.
   pure logical function weight_matters(self, weight)
      type(modes_finder), intent(in) :: self
      real(wp), intent(in) :: weight !! [1/s]
      weight_matters = max(weight, self%weight)*self%relaxation > little .and. &
                       (weight > 4.0_wp*self%weight .or. weight < 0.25_wp*self%weight)
   end function weight_matters

   subroutine keep_fast_modes(self, n_base, slowest, modes)
      type(modes_finder), intent(inout) :: self
      integer, intent(in) :: n_base
      real(wp), intent(in) :: slowest !! [rad/s]
      type(stiff_modes), intent(inout) :: modes
      real(wp) :: least
      integer :: i, j, m

      m = size(self%work)
      call modes%reserve(size(self%squares), m, n_base, size(self%dampers, 2))
      least = max(slowest**2, 1.0e-12_wp*maxval(self%squares))
      j = 0
      do i = 1, size(self%squares)
         if (.not. self%squares(i) > least) cycle
         j = j + 1
         modes%square(j) = self%squares(i)
         modes%v(:, j) = self%columns(m + n_base + 1:, i)
         modes%u(j, :) = self%columns(:m, i)/self%squares(i)
      end do
      modes%n = j
   end subroutine keep_fast_modes

   !> How each mode moves the dampers, and what springs and dampers have of its square.
   subroutine add_dampers(self, modes)
      type(modes_finder), intent(in) :: self
      type(stiff_modes), intent(inout) :: modes
      integer :: i, k, m, most

      m = size(self%dampers, 1)
      most = max(1, size(modes%square))
      modes%weight = self%weight
      do k = 1, modes%n_dampers
         call dgemv('N', modes%n, m, 1.0_wp, modes%u, most, self%dampers(:, k), 1, 0.0_wp, modes%influence(:, k), 1)
      end do
      do i = 1, modes%n
         modes%influence_t(:, i) = modes%influence(i, :)
         modes%damping(i) = modes%square(i)*dot_product(modes%influence_t(:, i), modes%influence_t(:, i))
         modes%omega_2(i) = modes%square(i) - modes%weight*modes%damping(i)
      end do
      call modes%bound_coupling()
   end subroutine add_dampers

end module rodyn_scene_modes
