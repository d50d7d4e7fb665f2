!> Small-motion natural frequencies of a scene about a configuration at rest: K x = w^2 M x by LAPACK.
module rodyn_frequencies
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type, raise
   use rodyn_scene, only: scene_type
   use rodyn_assembled, only: assembled_system, new_assembled_system, mass_matrix
   use rodyn_lapack, only: dsygvd
   implicit none (type, external)
   private
   public :: natural_frequencies

contains

   !> All natural frequencies, rising; rigid-body motions give zeros (to rounding).
   subroutine natural_frequencies(scene, q, frequency, error)
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: q(:)                       !! coordinates (dof)
      real(wp), allocatable, intent(out) :: frequency(:) !! (dof) [rad/s]
      type(error_type), allocatable, intent(out) :: error
      type(assembled_system) :: system
      real(wp), allocatable :: work(:)
      integer, allocatable :: integer_work(:)
      real(wp) :: sine(0:scene%n), cosine(0:scene%n), work_size(1)
      integer :: info, m, integer_size(1)

      m = scene%n_dof
      call new_assembled_system(system, scene, error)
      if (allocated(error)) return
      sine(0) = 0.0_wp
      cosine(0) = 1.0_wp
      sine(1:) = sin(q(scene%phi_at() + 1:scene%phi_at() + scene%n))
      cosine(1:) = cos(q(scene%phi_at() + 1:scene%phi_at() + scene%n))
      call mass_matrix(system, scene, sine, cosine, q)
      allocate (frequency(m))
      call dsygvd(1, 'N', 'L', m, system%k, m, system%m, m, frequency, work_size, -1, integer_size, -1, info)
      allocate (work(int(work_size(1))), integer_work(integer_size(1)))
      call dsygvd(1, 'N', 'L', m, system%k, m, system%m, m, frequency, work, size(work), integer_work, &
                  size(integer_work), info)
      if (info /= 0) then
         call raise(error, 'dsygvd: no natural frequencies (mass matrix not positive definite, or no convergence)')
         return
      end if
      frequency = sqrt(max(frequency, 0.0_wp))
   end subroutine natural_frequencies

end module rodyn_frequencies
