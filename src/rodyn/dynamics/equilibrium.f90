!> Relative equilibrium near a state: the chain at rest on a spacecraft that keeps its spin, under constant loads and kinks.
!>
!> Newton's method on the exact Jacobian, for the coordinates of the chain (and the rotations of relaxing hinges), damped by
!> the natural monotonicity test (Deuflhard, Newton Methods for Nonlinear Problems, sec. 3.3): a step is accepted if the next
!> one, with the same Jacobian, is shorter. Translation does not matter: nothing depends on the place, and constant forces may
!> accelerate the whole. A spin that grows is no equilibrium. Locked hinges stay locked, the others take the laws that hold at
!> the equilibrium (stops, freeplay).
module rodyn_equilibrium
   use rodyn_kinds, only: wp
   use rodyn_text, only: formatted
   use rodyn_errors, only: error_type, raise
   use rodyn_lapack, only: dgetrf, dgetrs
   use rodyn_locks, only: expand, expansion_matrix, free_coordinates, has_slaves
   use rodyn_motion, only: motion_type
   implicit none (type, external)
   private
   public :: find_equilibrium

   integer, parameter :: most_steps = 100
   integer, parameter :: most_passes = 20          !! of laws of hinges that change
   real(wp), parameter :: longest_step = 0.5_wp    !! change of an angle in one step [rad]
   real(wp), parameter :: smallest_share = 1.0e-4_wp !! of a step, before the search is given up
   real(wp), parameter :: close_enough = 1.0e-9_wp !! the step after one so short is at rounding level [rad]

   !> LU factors of the chain's part of the Jacobian, without angles that locks make redundant.
   type :: newton_solver
      integer, allocatable :: kept(:) !! the chain's coordinates that are left, and rotations of relaxing hinges: places in q
      integer, allocatable :: rows(:) !! their equations: places in y'
      real(wp), allocatable :: lu(:, :), scale(:)
      integer, allocatable :: pivots(:)
   end type newton_solver

contains

   !> Replace the state by the equilibrium, at rest relative to the spacecraft, with the spin it had.
   subroutine find_equilibrium(motion, t, y, error)
      type(motion_type), intent(inout) :: motion
      real(wp), intent(in) :: t                    !! [s]; the loads are those of `motion%dynamics%set_regime`
      real(wp), contiguous, intent(inout) :: y(:)  !! (q, p, ...)
      type(error_type), allocatable, intent(out) :: error
      logical :: changed
      integer :: pass

      do pass = 1, most_passes
         call find_with_laws(motion, t, y, error)
         if (allocated(error) .or. .not. motion%events%watches) return
         associate (r => motion%n_q, m => motion%n_dof)
            call motion%events%adopt(motion%dynamics, t, y(1:r), y(r + 1:r + m), changed, error)
         end associate
         if (allocated(error) .or. .not. changed) return
      end do
      call raise(error, 'no equilibrium was found: laws of hinges (stops, freeplay) follow each other without end')
   end subroutine find_equilibrium

   !> The same with the laws that hinges have now.
   subroutine find_with_laws(motion, t, y, error)
      type(motion_type), intent(inout) :: motion
      real(wp), intent(in) :: t                    !! [s]
      real(wp), contiguous, intent(inout) :: y(:)  !! (q, p, ...)
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: jac(:, :), x(:), step(:), next(:)
      type(newton_solver) :: solver
      real(wp) :: share
      logical :: ok, last
      integer :: i

      if (motion%dynamics%varying) then
         call raise(error, 'no equilibrium: a load or a kink varies in time')
         return
      end if
      associate (b => motion%dynamics%scene%n_base, r => motion%n_q, m => motion%n_dof)
         y(r + b + 1:r + m) = 0.0_wp
         allocate (jac(size(y), size(y)))
         last = .false.
         do i = 1, most_steps
            call motion%jacobian(t, y, jac, ok)
            if (ok) call factorise(solver, motion, jac, ok)
            if (.not. ok) then
               call raise(error, 'no equilibrium: the stiffness is singular (a hinge without spring?)')
               return
            end if
            call newton_step(solver, motion, t, y, step, ok)
            if (.not. ok) exit
            x = y(b + 1:r)
            share = min(1.0_wp, longest_step/max(maxval(abs(step)), tiny(1.0_wp)))
            do
               y(b + 1:r) = x + share*step
               if (last) exit
               call newton_step(solver, motion, t, y, next, ok)
               if (ok) ok = norm2(next) <= (1.0_wp - 0.5_wp*share)*norm2(step) .or. maxval(abs(step)) <= close_enough
               if (ok .or. share < smallest_share) exit
               share = 0.5_wp*share
            end do
            if (.not. ok .or. last) exit
            last = maxval(abs(step)) <= close_enough
         end do
         if (.not. (ok .and. last)) then
            call raise(error, "no equilibrium was found near the initial state: Newton's method does not converge from there")
            return
         end if
         if (b > 0) call check_spin(motion, t, y, maxval(abs(jac(r + 3:r + m, :))), error)
      end associate
   end subroutine find_with_laws

   !> Factor the part of the Jacobian that belongs to the chain, rows brought to a common scale. Not `ok`: singular.
   subroutine factorise(solver, motion, jac, ok)
      type(newton_solver), intent(inout) :: solver
      type(motion_type), intent(in) :: motion
      real(wp), intent(in) :: jac(:, :)
      logical, intent(out) :: ok
      real(wp), allocatable :: expansion(:, :)
      integer, allocatable :: chain(:), joints(:)
      integer :: i, info, n

      associate (b => motion%dynamics%scene%n_base, r => motion%n_q, m => motion%n_dof, scene => motion%dynamics%scene)
         chain = free_coordinates(scene)
         chain = chain(b + 1:)
         joints = m + pack([(i, i=1, r - m)], .not. scene%hinges%locked(scene%hinges%relaxing))
         solver%kept = [chain, joints]
         solver%rows = [r + chain, joints]
         n = size(solver%kept)
         if (.not. allocated(solver%pivots)) allocate (solver%pivots(n))
         if (has_slaves(scene)) then ! and no relaxing hinges
            expansion = expansion_matrix(scene)
            solver%lu = matmul(jac(solver%rows, 1:m), expansion(:, b + 1:))
         else
            solver%lu = jac(solver%rows, solver%kept)
         end if
      end associate
      solver%scale = maxval(abs(solver%lu), dim=2)
      ok = all(solver%scale > 0.0_wp)
      if (.not. ok .or. n == 0) return ! every hinge of a rigid chain is locked
      do i = 1, n
         solver%lu(:, i) = solver%lu(:, i)/solver%scale
      end do
      call dgetrf(n, n, solver%lu, n, solver%pivots, info)
      ok = info == 0
      if (ok) ok = all([(abs(solver%lu(i, i)) > 1.0e2_wp*n*epsilon(1.0_wp), i=1, n)])
   end subroutine factorise

   !> The step of the chain from y by the factors at hand: -J^-1 (p', th'), and what follows from it by locks.
   subroutine newton_step(solver, motion, t, y, step, ok)
      type(newton_solver), intent(in) :: solver
      type(motion_type), intent(inout) :: motion
      real(wp), intent(in) :: t
      real(wp), contiguous, intent(in) :: y(:)
      real(wp), allocatable, intent(out) :: step(:)
      logical, intent(out) :: ok
      real(wp) :: rate(size(y)), whole(motion%n_q), still(0:motion%dynamics%scene%n - 1)
      integer :: info, n

      n = size(solver%scale)
      call motion%rhs(t, y, rate, ok)
      associate (b => motion%dynamics%scene%n_base, r => motion%n_q, m => motion%n_dof, scene => motion%dynamics%scene)
         step = -rate(solver%rows)/solver%scale
         if (ok .and. n > 0) call dgetrs('N', n, 1, solver%lu, n, solver%pivots, step, n, info)
         if (ok .and. n > 0) ok = info == 0 .and. all(abs(step) <= huge(step))
         whole = 0.0_wp
         whole(solver%kept) = step
         still = 0.0_wp
         if (has_slaves(scene)) call expand(scene, scene%hinges%locked, still, whole)
         step = whole(b + 1:)
      end associate
   end subroutine newton_step

   !> A chain may rest on a spacecraft that turns ever faster, but not for long.
   subroutine check_spin(motion, t, y, largest, error)
      type(motion_type), intent(inout) :: motion
      real(wp), intent(in) :: t
      real(wp), contiguous, intent(in) :: y(:)
      real(wp), intent(in) :: largest !! of the derivatives of the accelerations: their rounding errors
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: rate(size(y))
      logical :: ok

      call motion%rhs(t, y, rate, ok)
      associate (spin_rate => rate(motion%n_q + 3))
         if (ok .and. abs(spin_rate) <= 1.0e3_wp*epsilon(1.0_wp)*max(1.0_wp, largest)) return
         call raise(error, "no equilibrium: the loads turn the spacecraft ever faster, omega' = "// &
                    formatted(spin_rate, '(es10.3)')//' rad/s^2')
      end associate
   end subroutine check_spin

end module rodyn_equilibrium
