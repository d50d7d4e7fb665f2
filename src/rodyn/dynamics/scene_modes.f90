!> Stiff modes of a scene near a configuration, for integrators that solve them implicitly (`rodyn_gauss_integrator`).
!>
!> With the constant stiffness K = L L^T of springs and rods, the modes follow from the symmetric matrix
!>     H = L^T M(q)^-1 L = Q diag(omega^2) Q^T,   u = M^-1 L Q / omega^2,   v = L Q.
!> Loads, centrifugal and gyroscopic terms are left out: they are not stiff. With locked hinges T (T^T M T)^-1 T^T stands for
!> M^-1 (`rodyn_locks`).
module rodyn_scene_modes
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type
   use rodyn_ode, only: stiff_modes
   use rodyn_scene, only: scene_type
   use rodyn_assembled, only: assembled_system, new_assembled_system, mass_matrix
   use rodyn_locks, only: has_slaves, reduce, expand, reduce_matrix
   use rodyn_jacobi_rotation, only: jacobi_rotation, rotate_columns, rotate_rows
   use rodyn_lapack, only: dpotrf, dpotrs, dsyev, dgemm, dgemv
   implicit none (type, external)
   private
   public :: modes_finder, new_modes_finder

   integer, parameter :: most_dof = 200 !! beyond, eigenvectors cost more than they bring

   !> What stays constant of a scene, and memory.
   type :: modes_finder
      logical :: available = .false.
      type(assembled_system) :: system
      real(wp), allocatable :: factor(:, :) !! L (n_dof, rank)
      real(wp), allocatable :: shapes(:, :) !! M^-1 L (n_dof, rank)
      real(wp), allocatable :: h(:, :)      !! H in the basis of the last modes (rank, rank)
      real(wp), allocatable :: rotated(:, :) !! L Q (n_dof, rank); Q of the last modes
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
      allocate (finder%factor(m, rank), finder%shapes(m, rank), finder%h(rank, rank), finder%omega_2(rank), &
                finder%work(m))
      do i = 1, rank
         finder%factor(:, i) = vectors(:, m - rank + i)*sqrt(values(m - rank + i))
      end do
      finder%rotated = finder%factor
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
      rank = size(self%factor, 2)
      call mass_matrix(self%system, scene, sine, cosine, q)
      self%shapes(:, :) = self%rotated
      if (has_slaves(scene)) then
         call reduce_matrix(scene, 1.0_wp, self%system%m)
         do i = 1, rank
            call reduce(scene, self%shapes(:, i))
         end do
      end if
      call dpotrf('L', m, self%system%m, m, info)
      ok = info == 0
      if (.not. ok) return
      call dpotrs('L', m, rank, self%system%m, m, self%shapes, m, info)
      if (has_slaves(scene)) then
         self%work(:) = 0.0_wp
         do i = 1, rank
            call expand(scene, scene%hinges%locked, self%work(:scene%n), self%shapes(:, i))
         end do
      end if
      call dgemm('T', 'N', rank, rank, m, 1.0_wp, self%rotated, m, self%shapes, m, 0.0_wp, self%h, rank)
      call diagonalise(slowest**2, self%h, self%rotated, self%shapes)
      do i = 1, rank
         self%omega_2(i) = self%h(i, i)
      end do
      modes%n = count(self%omega_2 > max(slowest**2, 1.0e-12_wp*maxval(self%omega_2)))
      if (allocated(modes%omega_2)) then
         if (size(modes%omega_2) /= modes%n) deallocate (modes%omega_2, modes%damping, modes%u, modes%v)
      end if
      if (.not. allocated(modes%omega_2)) allocate (modes%omega_2(modes%n), modes%damping(modes%n), modes%u(modes%n, m), &
                                                    modes%v(m - scene%n_base, modes%n))
      j = 0
      do i = 1, rank
         if (.not. self%omega_2(i) > max(slowest**2, 1.0e-12_wp*maxval(self%omega_2))) cycle
         j = j + 1
         modes%omega_2(j) = self%omega_2(i)
         modes%v(:, j) = self%rotated(scene%n_base + 1:, i)
         self%shapes(:, i) = self%shapes(:, i)/self%omega_2(i)
         modes%u(j, :) = self%shapes(:, i)
         modes%damping(j) = 0.0_wp
         if (.not. self%system%damped) cycle ! v^T M^-1 D u with v = omega^2 M u
         call dgemv('N', m, m, modes%omega_2(j), self%system%d, m, self%shapes(:, i), 1, 0.0_wp, self%work, 1)
         modes%damping(j) = dot_product(self%shapes(:, i), self%work)
      end do
   end subroutine find

   !> Turn a symmetric matrix to (nearly) diagonal form by Jacobi's rotations, and columns of x and y with it. Starts from
   !> what was diagonal for an earlier configuration, so that one or two sweeps are enough; what little is left
   !> off the diagonal costs the integrator less than another sweep.
   pure subroutine diagonalise(smallest, h, x, y)
      real(wp), intent(in) :: smallest !! diagonal elements below it need no precision
      real(wp), contiguous, intent(inout) :: h(:, :), x(:, :), y(:, :)
      real(wp), parameter :: negligible = 1.0e-5_wp !! off the diagonal, of the smaller element on it
      integer, parameter :: most_sweeps = 12
      real(wp) :: c, s
      integer :: sweep, i, j
      logical :: done

      do sweep = 1, most_sweeps
         done = .true.
         do j = 2, size(h, 1)
            do i = 1, j - 1
               if (abs(h(i, j)) <= negligible*max(smallest, min(abs(h(i, i)), abs(h(j, j))))) cycle
               done = .false.
               call jacobi_rotation(h, i, j, c, s)
               call rotate_columns(h, i, j, c, s)
               call rotate_rows(h, i, j, c, s)
               call rotate_columns(x, i, j, c, s)
               call rotate_columns(y, i, j, c, s)
            end do
         end do
         if (done) return
      end do
   end subroutine diagonalise

end module rodyn_scene_modes
