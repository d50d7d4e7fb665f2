!> Small motions of a scene about a configuration at rest, by LAPACK: natural frequencies K x = w^2 M x, and how
!> fast its dampers act alone, D x = lambda M x. Coordinates that locked hinges make redundant are left out
!> (`rodyn_locks`).
module rodyn_frequencies
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type, raise
   use rodyn_scene, only: scene_type
   use rodyn_hinge_law, only: hinge_law
   use rodyn_assembled, only: assembled_system, new_assembled_system, mass_matrix
   use rodyn_locks, only: has_slaves, free_coordinates, reduce_matrix
   use rodyn_lapack, only: symmetric_eigenvalues
   implicit none (type, external)
   private
   public :: natural_frequencies, decay_rates

contains

   !> All natural frequencies, rising; rigid-body motions give zeros (to rounding).
   subroutine natural_frequencies(scene, hinges, q, frequency, error)
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      real(wp), intent(in) :: q(:)                       !! coordinates (dof)
      real(wp), allocatable, intent(out) :: frequency(:) !! (dof less redundant coordinates) [rad/s]
      type(error_type), allocatable, intent(out) :: error
      type(assembled_system) :: system

      if (scene%n < 1 .or. size(q) < scene%n_dof) then
         call raise(error, 'natural_frequencies: the scene is not compiled, or has more coordinates than q')
         return
      end if
      call new_assembled_system(system, scene, hinges, error)
      if (allocated(error)) return
      call eigenvalues(scene, hinges, q, system, system%k, frequency, error)
      if (allocated(error)) return
      frequency = sqrt(max(frequency, 0.0_wp))
   end subroutine natural_frequencies

   !> Rates of decay if nothing but the dampers acted, rising: 2 zeta w of a lightly damped mode, and the stiff
   !> end of the spectrum when the dampers are strong.
   subroutine decay_rates(scene, hinges, q, rate, error)
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      real(wp), intent(in) :: q(:)                  !! coordinates (dof)
      real(wp), allocatable, intent(out) :: rate(:) !! (dof less redundant coordinates) [1/s]
      type(error_type), allocatable, intent(out) :: error
      type(assembled_system) :: system

      call new_assembled_system(system, scene, hinges, error)
      if (allocated(error)) return
      call eigenvalues(scene, hinges, q, system, system%d, rate, error)
   end subroutine decay_rates

   !> Eigenvalues of A x = lambda M(q) x, rising; A is overwritten.
   subroutine eigenvalues(scene, hinges, q, system, a, value, error)
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      real(wp), intent(in) :: q(:)
      type(assembled_system), intent(inout) :: system
      real(wp), intent(in) :: a(:, :)
      real(wp), allocatable, intent(out) :: value(:)
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: matrix(:, :), mass(:, :)
      integer, allocatable :: free(:)
      real(wp) :: sine(0:scene%n), cosine(0:scene%n)

      matrix = a
      sine(0) = 0.0_wp
      cosine(0) = 1.0_wp
      sine(1:) = sin(q(scene%phi_at() + 1:scene%phi_at() + scene%n))
      cosine(1:) = cos(q(scene%phi_at() + 1:scene%phi_at() + scene%n))
      call mass_matrix(system, scene, hinges, sine, cosine, q)
      mass = system%m
      if (has_slaves(hinges)) then
         call reduce_matrix(scene, hinges%locked, 1.0_wp, mass)
         call reduce_matrix(scene, hinges%locked, 0.0_wp, matrix)
         free = free_coordinates(scene, hinges)
         mass = mass(free, free)
         matrix = matrix(free, free)
      end if
      call symmetric_eigenvalues(matrix, mass, value, .false., error)
   end subroutine eigenvalues

end module rodyn_frequencies
