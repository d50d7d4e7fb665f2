!> The fast end of a scene's spectrum in O(n): its highest natural frequency and fastest decay, by power iteration with
!> the right-hand side. Good to a fifth, which is what a choice of method needs, in all but one in ten thousand random scenes, and
!> almost always to a tenth; `rodyn_frequencies` has all of them.
!>
!> It asks for nothing but accelerations, so it serves every scene, with locked and relaxing hinges, too, and takes the springs with
!> the moments that they have at q. It knows no bound of its error: two motions of nearly the same rate may make it stop early.
!> What must not miss the fastest is the matter of `rodyn_fast_eigenvalues`, which takes several times as many
!> evaluations, and a tangent with each pair of them.
module rodyn_fastest_rates
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type
   use rodyn_scene, only: scene_type
   use rodyn_hinge_law, only: hinge_law
   use rodyn_bending_matrices, only: bending_matrices
   use rodyn_rod_constants, only: stiffen
   use rodyn_accelerations, only: dynamics_type, new_dynamics
   implicit none (type, external)
   private
   public :: fastest_rates, with_rigid_rods, by_springs, by_dampers

   integer, parameter :: n_iterations = 80
   real(wp), parameter :: small_change = 1.0e-4_wp !! of the growth; three such in sequence end the iteration
   real(wp), parameter :: step = 1.0e-5_wp !! change of the coordinates for derivatives [rad]

contains

   !> About a configuration, at rest and without loads. Zero where there is neither spring nor damper.
   subroutine fastest_rates(scene, hinges, q, frequency, decay)
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      real(wp), intent(in) :: q(:)           !! coordinates (n_q)
      real(wp), intent(out) :: frequency     !! highest natural frequency [rad/s]
      real(wp), intent(out), optional :: decay !! fastest decay if nothing but the dampers acted [1/s]
      type(dynamics_type) :: dynamics
      type(error_type), allocatable :: error
      real(wp) :: x(scene%n_dof), image(scene%n_dof), growth(2), before
      integer :: which, i, k, steady
      logical :: ok

      frequency = 0.0_wp
      if (present(decay)) decay = 0.0_wp
      growth = 0.0_wp
      call new_dynamics(dynamics, scene, error, hinges)
      if (allocated(error)) return
      do which = 1, merge(2, 1, hinges%has_damping .and. present(decay))
         x = [(cos(2.4_wp*real(k, wp)**2), k=1, scene%n_dof)] ! something of everything
         if (scene%n_base > 0) x(1:3) = 0.0_wp
         steady = 0
         do i = 1, n_iterations
            x = x/norm2(x)
            before = growth(which)
            if (which == 1) then
               call by_springs(dynamics, q, x, image, ok)
            else
               call by_dampers(dynamics, q, x, image, ok)
            end if
            if (.not. ok) return
            growth(which) = norm2(image)
            if (.not. growth(which) > tiny(1.0_wp)) exit
            x = image
            steady = merge(steady + 1, 0, abs(growth(which) - before) < small_change*growth(which))
            if (steady == 3) exit
         end do
      end do
      frequency = sqrt(growth(1))
      if (present(decay)) decay = max(growth(2), hinges%fastest_relaxation())
   end subroutine fastest_rates

   !> The scene without the bending of its rods: what is left of its spectrum are the slow motions of the chain. Scenes
   !> whose rods do not bend as motion are returned as they are.
   function with_rigid_rods(scene) result(rigid)
      type(scene_type), intent(in) :: scene
      type(scene_type) :: rigid
      integer :: j

      rigid = scene
      if (.not. scene%dynamic_bending) return
      rigid%dynamic_bending = .false.
      rigid%inextensible = .false.
      rigid%n_bend = 0
      rigid%n_dof = scene%n_base + scene%n
      rigid%n_q = rigid%n_dof
      do j = 1, size(rigid%rods)
         rigid%bending(j) = bending_matrices()
         call stiffen(rigid%rods(j))
      end do
   end function with_rigid_rods

   !> M^-1 K x, by central differences: x is of order one [rad].
   subroutine by_springs(dynamics, q, x, image, ok)
      type(dynamics_type), intent(inout) :: dynamics
      real(wp), intent(in) :: q(:), x(:)
      real(wp), intent(out) :: image(:)
      logical, intent(out) :: ok
      real(wp) :: moved(size(q)), rest(size(x)), plus(size(x)), minus(size(x))
      logical :: ok_plus

      rest = 0.0_wp
      moved = q
      moved(:size(x)) = q(:size(x)) + step*x
      call dynamics%accelerations(0.0_wp, moved, rest, plus, ok_plus)
      moved(:size(x)) = q(:size(x)) - step*x
      call dynamics%accelerations(0.0_wp, moved, rest, minus, ok)
      image = (minus - plus)/(2.0_wp*step)
      ok = ok .and. ok_plus
   end subroutine by_springs

   !> M^-1 D x: the part of the accelerations that is odd in the rates.
   subroutine by_dampers(dynamics, q, x, image, ok)
      type(dynamics_type), intent(inout) :: dynamics
      real(wp), intent(in) :: q(:), x(:)
      real(wp), intent(out) :: image(:)
      logical, intent(out) :: ok
      real(wp) :: plus(size(x)), minus(size(x))
      logical :: ok_plus

      call dynamics%accelerations(0.0_wp, q, x, plus, ok_plus)
      call dynamics%accelerations(0.0_wp, q, -x, minus, ok)
      image = 0.5_wp*(minus - plus)
      ok = ok .and. ok_plus
   end subroutine by_dampers

end module rodyn_fastest_rates
