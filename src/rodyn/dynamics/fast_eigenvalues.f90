!> Eigenvalues of the linearised motion of a scene, for what must not miss the fastest of them: all of a short chain;
!> of a long one the fastest vibration and the strongest damper, in O(n), by Lanczos' method.
!>
!> M^-1 K is symmetric in the inner product of K, x.K y; Lanczos' tridiagonal matrix then has an eigenvalue that is never above
!> the largest of M^-1 K and soon within a thousandth of it (Golub & Van Loan, Matrix Computations, sec. 10.1). The same
!> holds for D. Symmetry needs springs without moments and the tangent in closed form; the estimate that a choice of method is
!> content with does without either (`rodyn_fastest_rates`).
module rodyn_fast_eigenvalues
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type
   use rodyn_scene, only: scene_type
   use rodyn_motion, only: motion_type, new_motion
   use rodyn_hinge_law, only: hinge_law, openings
   use rodyn_linearisation, only: balance_tangent
   use rodyn_fastest_rates, only: by_springs, by_dampers
   use rodyn_accelerations, only: dynamics_type, new_dynamics
   use rodyn_lapack, only: dgeev, dsyev
   implicit none (type, external)
   private
   public :: fast_eigenvalues, all_eigenvalues, extreme_eigenvalues

   integer, parameter :: most_states = 200 !! beyond, all eigenvalues would cost more than a run of a thousand steps
   integer, parameter :: n_iterations = 60
   integer, parameter :: springs = 1, dampers = 2
   integer, parameter :: n_ways = 9        !! what is not known of a long chain is sampled

contains

   !> Eigenvalues lambda(i, j) [1/s] of y' = f(t, y) at t = 0: for each j, one of lambda(:, j) is an eigenvalue, or near
   !> one. None if the equations cannot be evaluated.
   subroutine fast_eigenvalues(scene, y, t_end, lambda)
      type(scene_type), intent(in) :: scene
      real(wp), contiguous, intent(in) :: y(:) !! state at t = 0; quadratures behind it do not matter
      real(wp), intent(in) :: t_end            !! end of the run [s]
      complex(wp), allocatable, intent(out) :: lambda(:, :)

      if (scene%n_q + scene%n_dof <= most_states) then
         call all_eigenvalues(scene, y(:scene%n_q + scene%n_dof), t_end, lambda)
      else
         call extreme_eigenvalues(scene, y(:scene%n_q), lambda)
      end if
   end subroutine fast_eigenvalues

   !> By LAPACK, with what loads, kinks, turning and dampers do.
   subroutine all_eigenvalues(scene, y, t_end, lambda)
      type(scene_type), intent(in) :: scene
      real(wp), contiguous, intent(in) :: y(:) !! (n_q + n_dof)
      real(wp), intent(in) :: t_end            !! end of the run [s]
      complex(wp), allocatable, intent(out) :: lambda(:, :) !! (1, n_q + n_dof)
      type(motion_type) :: motion
      type(error_type), allocatable :: error
      real(wp), dimension(size(y), size(y)) :: jacobian
      real(wp), dimension(size(y)) :: re, im
      real(wp) :: none(1, 1), work(8*size(y))
      integer :: info
      logical :: ok

      allocate (lambda(1, 0))
      call new_motion(motion, scene, .false., error)
      if (allocated(error)) return
      call motion%dynamics%set_regime(0.0_wp, minval([scene%switches, t_end]))
      call motion%jacobian(0.0_wp, y, jacobian, ok)
      if (.not. ok .or. .not. all(abs(jacobian) <= huge(1.0_wp))) return
      call dgeev('N', 'N', size(y), jacobian, size(y), re, im, none, 1, none, 1, work, size(work), info)
      if (info /= 0) return
      lambda = reshape(cmplx(re, im, wp), [1, size(y)])
   end subroutine all_eigenvalues

   !> Of the fastest vibration, whose damping is not known; of the strongest damper, whose spring is not known. Springs and
   !> rods are taken without the moments they have at q, whose changes with the configuration would spoil the symmetry.
   subroutine extreme_eigenvalues(scene, q, lambda)
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: q(:) !! (n_q)
      complex(wp), allocatable, intent(out) :: lambda(:, :) !! (n_ways, 2)
      type(dynamics_type) :: dynamics
      type(error_type), allocatable :: error
      real(wp) :: stiffness, damping, part, at_rest(size(q))
      type(scene_type) :: recursive
      type(hinge_law) :: relaxed
      integer :: i

      call relax(scene, q, relaxed, at_rest)
      recursive = scene
      recursive%assembled = .false.
      call new_dynamics(dynamics, recursive, error, relaxed)
      allocate (lambda(n_ways, merge(0, 2, allocated(error))))
      if (allocated(error)) return
      stiffness = greatest_rate(dynamics, at_rest, springs)
      damping = 0.0_wp
      if (scene%hinges%has_damping) then
         if (.not. scene%quasistatic) then ! the rounding of large moments that cancel would drown weak dampers
            dynamics%hinges%stiffness = 0.0_wp
            dynamics%hinges%offset = 0.0_wp
         end if
         damping = greatest_rate(dynamics, at_rest, dampers)
      end if
      do i = 1, n_ways
         part = real(i - 1, wp)/real(n_ways - 1, wp)
         lambda(i, 1) = eigenvalue(part*damping, stiffness)
         lambda(i, 2) = eigenvalue(damping, part*stiffness)
      end do
   end subroutine extreme_eigenvalues

   !> Hinges at the same chord angles with kinks that leave no moment anywhere.
   subroutine relax(scene, q, relaxed, at_rest)
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: q(:) !! (n_q)
      type(hinge_law), intent(out) :: relaxed
      real(wp), intent(out) :: at_rest(:) !! (n_q)
      real(wp) :: opening(0:scene%n - 1)
      integer :: first, last

      relaxed = scene%hinges
      first = scene%phi_at() + 1
      last = scene%phi_at() + scene%n
      at_rest = 0.0_wp
      at_rest(first:last) = q(first:last)
      call openings(scene%n, scene%dynamic_bending, at_rest(first:), opening)
      if (relaxed%curved) call relaxed%follow(scene%dynamic_bending, at_rest(first:), 0.0_wp*at_rest(first:))
      call relaxed%rest_at(opening)
   end subroutine relax

   !> The faster root of lambda^2 + damping lambda + stiffness = 0.
   elemental complex(wp) function eigenvalue(damping, stiffness)
      real(wp), intent(in) :: damping   !! [1/s]
      real(wp), intent(in) :: stiffness !! [1/s^2]
      eigenvalue = -0.5_wp*damping - sqrt(cmplx(0.25_wp*damping**2 - stiffness, 0.0_wp, wp))
   end function eigenvalue

   !> Largest eigenvalue of M^-1 K, the square of a frequency [rad^2/s^2], or of M^-1 D [1/s]; never above it.
   real(wp) function greatest_rate(dynamics, q, which)
      type(dynamics_type), intent(inout) :: dynamics !! no loads act
      real(wp), intent(in) :: q(:)    !! (n_q)
      integer, intent(in) :: which    !! springs (1) or dampers (2)
      real(wp), dimension(dynamics%scene%n_dof) :: v, before, next, force
      real(wp) :: diagonal(n_iterations), beside(n_iterations), norm
      integer :: i, k
      logical :: ok

      greatest_rate = 0.0_wp
      before = 0.0_wp
      norm = 0.0_wp
      v = [(cos(2.4_wp*real(k, wp)**2), k=1, size(v))] ! something of everything
      do i = 1, n_iterations
         call forces_of(dynamics, q, which, v, force)
         beside(i) = sqrt(max(0.0_wp, dot_product(v, force)))
         if (.not. beside(i) > sqrt(tiny(1.0_wp)) .or. beside(i) < 1.0e-4_wp*norm) exit ! an invariant subspace, or nearly
         v = v/beside(i)
         force = force/beside(i)
         call rates_of(dynamics, q, which, v, next, ok)
         if (.not. ok) exit
         diagonal(i) = dot_product(next, force)
         norm = max(norm, diagonal(i))
         if (i > 1) next = next - beside(i)*before
         before = v
         v = next - diagonal(i)*v
         if (which == dampers) then
            call drop_undamped(dynamics%scene, v)
         else
            call drop_unsprung(dynamics%scene, dynamics%hinges%stiffness, v)
         end if
      end do
      if (i > 1) greatest_rate = largest_of(diagonal(:i - 1), beside(2:i - 1))
   end function greatest_rate

   !> Dampers see only the rates of the openings. What else is in x would grow from step to step and take its digits: put a
   !> motion in its place that opens the hinges in the same way.
   subroutine drop_undamped(scene, x)
      type(scene_type), intent(in) :: scene
      real(wp), intent(inout) :: x(:) !! (n_dof)
      real(wp) :: opening(scene%n)
      integer :: k

      call openings(scene%n, scene%dynamic_bending, x(scene%phi_at() + 1:), opening)
      x = 0.0_wp
      if (scene%dynamic_bending) then
         x(scene%alpha_at() + 1:scene%alpha_at() + scene%n) = opening
      else
         x(scene%phi_at() + 1:scene%phi_at() + scene%n) = [(sum(opening(:k)), k=1, scene%n)]
      end if
   end subroutine drop_undamped

   !> Springs see neither the motion of the spacecraft nor the openings of hinges that have none. The same of x is put to rest.
   subroutine drop_unsprung(scene, stiffness, x)
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: stiffness(0:) !! of the hinges (0:n-1) [N m/rad]
      real(wp), intent(inout) :: x(:) !! (n_dof)
      real(wp) :: opening(0:scene%n - 1), turned
      integer :: k

      x(:scene%n_base) = 0.0_wp
      call openings(scene%n, scene%dynamic_bending, x(scene%phi_at() + 1:), opening)
      turned = 0.0_wp
      do k = 1, scene%n
         if (.not. stiffness(k - 1) > 0.0_wp) turned = turned + opening(k - 1)
         x(scene%phi_at() + k) = x(scene%phi_at() + k) - turned
      end do
   end subroutine drop_unsprung

   !> K x or D x, exactly.
   subroutine forces_of(dynamics, q, which, x, force)
      type(dynamics_type), intent(in) :: dynamics
      real(wp), intent(in) :: q(:), x(:)
      integer, intent(in) :: which
      real(wp), intent(out) :: force(:)
      real(wp) :: rest(size(x)), moved(size(q)), node_force(2, 0)

      rest = 0.0_wp
      moved = 0.0_wp
      if (which == springs) then
         moved(:size(x)) = x
         call balance_tangent(dynamics%scene, dynamics%hinges, q, rest, rest, .false., node_force, moved, rest, force)
      else
         call balance_tangent(dynamics%scene, dynamics%hinges, q, rest, rest, .false., node_force, moved, x, force)
      end if
   end subroutine forces_of

   !> M^-1 K x or M^-1 D x.
   subroutine rates_of(dynamics, q, which, x, rates, ok)
      type(dynamics_type), intent(inout) :: dynamics
      real(wp), intent(in) :: q(:), x(:)
      integer, intent(in) :: which
      real(wp), intent(out) :: rates(:)
      logical, intent(out) :: ok
      real(wp) :: length

      length = norm2(x)
      if (which == springs) then
         call by_springs(dynamics, q, x/length, rates, ok)
      else
         length = length*1.0e8_wp ! slowly: centripetal forces, which cancel, are of second order
         call by_dampers(dynamics, q, x/length, rates, ok)
      end if
      rates = length*rates
   end subroutine rates_of

   !> Largest eigenvalue of a symmetric tridiagonal matrix.
   real(wp) function largest_of(diagonal, beside)
      real(wp), intent(in) :: diagonal(:), beside(:)
      real(wp) :: matrix(size(diagonal), size(diagonal)), values(size(diagonal)), work(34*size(diagonal))
      integer :: i, info

      matrix = 0.0_wp
      do i = 1, size(diagonal)
         matrix(i, i) = diagonal(i)
         if (i > 1) matrix(i, i - 1) = beside(i - 1)
      end do
      call dsyev('N', 'L', size(diagonal), matrix, size(diagonal), values, work, size(work), info)
      largest_of = 0.0_wp
      if (info == 0) largest_of = max(0.0_wp, values(size(values)))
   end function largest_of

end module rodyn_fast_eigenvalues
