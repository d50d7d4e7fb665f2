!> Stiff modes of a scene near a configuration, for integrators that solve them implicitly (`rodyn_gauss_integrator`).
!>
!> With the constant stiffness K = L L^T of springs and rods and M(q) = R R^T, the modes follow from the rotation Q that
!> makes the columns of B = R^-1 L Q orthogonal:
!>     |b_i|^2 = omega_i^2,   u = R^-T B / omega^2,   v = L Q.
!> Loads, centrifugal and gyroscopic terms are left out: they are not stiff. With locked hinges T (T^T M T)^-1 T^T stands for
!> M^-1 (`rodyn_locks`).
module rodyn_scene_modes
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type
   use rodyn_ode, only: stiff_modes
   use rodyn_scene, only: scene_type
   use rodyn_assembled, only: assembled_system, new_assembled_system, mass_matrix
   use rodyn_locks, only: has_slaves, reduce, expand, reduce_matrix
   use rodyn_jacobi_rotation, only: orthogonalise_columns
   use rodyn_lapack, only: dpotrf, dtrsm, dsyev, dgemv
   implicit none (type, external)
   private
   public :: modes_finder, new_modes_finder, most_dof

   integer, parameter :: most_dof = 200 !! beyond, eigenvectors cost more than they bring
   real(wp), parameter :: negligible = 1.0e-5_wp !! b_i.b_j, of the smaller omega^2

   !> What stays constant of a scene, and memory.
   type :: modes_finder
      logical :: available = .false.
      type(assembled_system) :: system
      real(wp), allocatable :: columns(:, :) !! B, and below it L Q with Q of the last modes (2 n_dof, rank)
      real(wp), allocatable :: omega_2(:), work(:)
   contains
      procedure :: find
   end type modes_finder

contains

   !> Factor the stiffness.
   subroutine new_modes_finder(finder, scene)
      type(modes_finder), intent(out) :: finder
      type(scene_type), intent(in) :: scene
      type(error_type), allocatable :: error
      real(wp), allocatable :: vectors(:, :), values(:), work(:)
      integer :: info, m, i, rank

      m = scene%n_dof
      if (m > most_dof) return
      call new_assembled_system(finder%system, scene, error)
      if (allocated(error)) return
      vectors = finder%system%k
      allocate (values(m), work(40*m))
      call dsyev('V', 'L', m, vectors, m, values, work, size(work), info)
      if (info /= 0) return
      rank = count(values > 1.0e-14_wp*maxval(values))
      allocate (finder%columns(2*m, rank), finder%omega_2(rank), finder%work(m))
      do i = 1, rank
         finder%columns(m + 1:, i) = vectors(:, m - rank + i)*sqrt(values(m - rank + i))
      end do
      finder%available = rank > 0
   end subroutine new_modes_finder

   !> Modes at q that are faster than `slowest`. Not `ok`: M is not positive definite.
   subroutine find(self, scene, sine, cosine, q, slowest, modes, ok)
      class(modes_finder), intent(inout) :: self
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: sine(0:), cosine(0:) !! of phi (0:n)
      real(wp), intent(in) :: q(:)                 !! (n_dof)
      real(wp), intent(in) :: slowest              !! [rad/s]
      type(stiff_modes), intent(inout) :: modes
      logical, intent(out) :: ok
      integer :: info, i, j, m, rank

      m = scene%n_dof
      rank = size(self%columns, 2)
      call mass_matrix(self%system, scene, sine, cosine, q)
      do i = 1, rank
         self%columns(:m, i) = self%columns(m + 1:, i)
         if (has_slaves(scene)) call reduce(scene, self%columns(:m, i))
      end do
      if (has_slaves(scene)) call reduce_matrix(scene, 1.0_wp, self%system%m)
      call dpotrf('L', m, self%system%m, m, info)
      ok = info == 0
      if (.not. ok) return
      call dtrsm('L', 'L', 'N', 'N', m, rank, 1.0_wp, self%system%m, m, self%columns, 2*m)
      ! It starts from what was orthogonal for an earlier configuration, so that few sweeps are enough; what little is left
      ! costs the integrator less than another sweep.
      call orthogonalise_columns(self%columns, m, slowest**2, negligible, self%omega_2)
      call dtrsm('L', 'L', 'T', 'N', m, rank, 1.0_wp, self%system%m, m, self%columns, 2*m)
      if (has_slaves(scene)) then
         self%work(:) = 0.0_wp
         do i = 1, rank
            call expand(scene, scene%hinges%locked, self%work(:scene%n), self%columns(:m, i))
         end do
      end if
      modes%n = count(self%omega_2 > max(slowest**2, 1.0e-12_wp*maxval(self%omega_2)))
      call modes%reserve(rank, m, scene%n_base)
      j = 0
      do i = 1, rank
         if (.not. self%omega_2(i) > max(slowest**2, 1.0e-12_wp*maxval(self%omega_2))) cycle
         j = j + 1
         modes%omega_2(j) = self%omega_2(i)
         modes%v(:, j) = self%columns(m + scene%n_base + 1:, i)
         self%columns(:m, i) = self%columns(:m, i)/self%omega_2(i)
         modes%u(j, :) = self%columns(:m, i)
         modes%damping(j) = 0.0_wp
         if (.not. self%system%damped) cycle ! v^T M^-1 D u with v = omega^2 M u
         call dgemv('N', m, m, modes%omega_2(j), self%system%d, m, self%columns(:m, i), 1, 0.0_wp, self%work, 1)
         modes%damping(j) = dot_product(self%columns(:m, i), self%work)
      end do
   end subroutine find

end module rodyn_scene_modes
