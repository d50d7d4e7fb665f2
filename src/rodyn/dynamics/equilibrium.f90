!> Relative equilibrium near a state: the chain at rest on a spacecraft that keeps its spin, under constant loads and kinks.
!>
!> Newton's method for the coordinates of the chain (and the rotations of relaxing hinges), damped by the natural monotonicity
!> test (Deuflhard, Newton Methods for Nonlinear Problems, sec. 3.3): a step is accepted if the next one, with the same
!> Jacobian, is shorter. What is brought to zero are forces, not accelerations: the derivative of M^-1 h is that of M^-1 far
!> from the equilibrium, that of h little else than the stiffness. With the balance M a = h of spacecraft (b) and chain (c)
!> the chain at rest lacks
!>
!>     r = h_c - M_cb a_b,   M_bb a_b = h_b,
!>
!> while the spacecraft accelerates as a_b says, and dr/dq = -(dR_c/dq - M_cb M_bb^-1 dR_b/dq) with the tangent of the balance
!> R = M a - h at a = (a_b, 0). Translation does not matter: nothing depends on the place, and constant forces may
!> accelerate the whole. A spin that grows is no equilibrium. Locked hinges stay locked, the others take the laws that hold at
!> the equilibrium (stops, freeplay).
module rodyn_equilibrium
   use rodyn_kinds, only: wp
   use rodyn_text, only: formatted
   use rodyn_errors, only: error_type, raise
   use rodyn_assembled, only: mass_matrix, new_assembled_system
   use rodyn_lapack, only: dgetrf, dgetrs, dpotrf, dpotrs
   use rodyn_locks, only: expand, expansion_matrix, free_coordinates, has_slaves, reduce
   use rodyn_motion, only: balance_derivatives, motion_type
   implicit none (type, external)
   private
   public :: find_equilibrium

   integer, parameter :: most_steps = 100
   integer, parameter :: most_passes = 20          !! of hinge laws that change
   real(wp), parameter :: longest_step = 0.5_wp    !! change of an angle in one step [rad]
   real(wp), parameter :: smallest_share = 1.0e-4_wp !! of a step, before the search is given up
   real(wp), parameter :: close_enough = 1.0e-9_wp !! the step after one so short is at rounding level [rad]
   integer, parameter :: most_creeping_steps = 400
   real(wp), parameter :: creeping_step = 0.1_wp   !! largest change of an angle in one of them [rad]
   real(wp), parameter :: light_drag = 1.0e-6_wp   !! times the square of the fastest rate

   !> What the chain lacks at a state, and LU factors of its derivative there or at a state before; both without angles
   !> that locks make redundant.
   type :: newton_solver
      integer, allocatable :: chain(:)   !! the chain's coordinates that are left: places in q and p'
      integer, allocatable :: joints(:)  !! relaxing hinges that are not locked
      integer, allocatable :: kept(:)    !! both: places in q
      real(wp), allocatable :: lacking(:)      !! r of these coordinates, th' of these hinges
      real(wp), allocatable :: acceleration(:) !! (a_b, 0) (n_dof)
      real(wp), allocatable :: carried(:, :)   !! M_cb M_bb^-1 (n_dof, n_base)
      real(wp), allocatable :: weight(:)       !! of each, to make work of it along a step
      real(wp), allocatable :: step(:)         !! of these coordinates and hinges
      real(wp) :: fastest = 0.0_wp             !! largest ratio of stiffness and mass on the diagonals [1/s^2]
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
      type(newton_solver) :: solver
      real(wp), allocatable :: start(:)

      associate (dynamics => motion%dynamics)
         if (size(dynamics%regime%varying) > 0 .or. dynamics%driven .or. associated(dynamics%user)) then
            call raise(error, 'no equilibrium: a load or a kink varies in time')
            return
         end if
      end associate
      call new_newton_solver(solver, motion, error)
      if (allocated(error)) return
      associate (b => motion%dynamics%scene%n_base, r => motion%n_q, m => motion%n_dof)
         y(r + b + 1:r + m) = 0.0_wp
         start = y(b + 1:r)
         call find_with_laws(solver, motion, t, y, error)
         if (allocated(error)) then
            y(b + 1:r) = start
            call creep(solver, motion, t, y)
            call find_with_laws(solver, motion, t, y, error)
         end if
         if (allocated(error)) return
         if (motion%events%watches) call motion%events%check_latches(motion%dynamics, t, y(1:r), y(r + 1:r + m), error)
         if (b > 0 .and. .not. allocated(error)) call check_spin(motion, t, y, error)
      end associate
   end subroutine find_equilibrium

   !> By Newton's method with the laws that hinges have now, and again with those that hold where it has led, until these stay
   !> the same, or the state does although they change: on the border of two.
   subroutine find_with_laws(solver, motion, t, y, error)
      type(newton_solver), intent(inout) :: solver
      type(motion_type), intent(inout) :: motion
      real(wp), intent(in) :: t
      real(wp), contiguous, intent(inout) :: y(:)
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: before(:)
      logical :: ok
      integer :: pass

      do pass = 1, most_passes
         before = y
         call iterate(solver, motion, t, y, ok, error)
         if (allocated(error)) return
         if (.not. ok) then
            call raise(error, "no equilibrium was found near the initial state: neither Newton's method nor a creeping motion "// &
                       'leads to one from there')
            return
         end if
         if (.not. laws_change(motion, t, y)) return
         if (maxval(abs(y - before)) <= close_enough) return
      end do
      call raise(error, 'no equilibrium was found: the hinge laws (stops, freeplay) do not settle')
   end subroutine find_with_laws

   !> Let the hinges take the laws that hold at a state. Do these differ from those they had?
   logical function laws_change(motion, t, y)
      type(motion_type), intent(inout) :: motion
      real(wp), intent(in) :: t
      real(wp), intent(in) :: y(:)
      laws_change = .false.
      if (.not. motion%events%watches) return
      associate (r => motion%n_q, m => motion%n_dof)
         call motion%events%adopt(motion%dynamics, t, y(1:r), y(r + 1:r + m), laws_change)
      end associate
   end function laws_change

   !> Newton's method from a state. Not `ok`: it does not converge. Where the stiffness is singular, the state may be one of
   !> many equilibria that lie along a line: a little drag tells whether the forces are zero to rounding.
   subroutine iterate(solver, motion, t, y, ok, error)
      type(newton_solver), intent(inout) :: solver
      type(motion_type), intent(inout) :: motion
      real(wp), intent(in) :: t
      real(wp), contiguous, intent(inout) :: y(:)
      logical, intent(out) :: ok
      type(error_type), allocatable, intent(out) :: error !! the stiffness is singular
      real(wp), allocatable :: x(:), step(:), next(:)
      real(wp) :: share
      logical :: singular
      integer :: i

      associate (b => motion%dynamics%scene%n_base, r => motion%n_q)
         call find_lacking(solver, motion, t, y, ok)
         if (.not. ok) return
         do i = 1, most_steps
            call factorise(solver, motion, y, 0.0_wp, ok)
            singular = .not. ok
            if (singular) call factorise(solver, motion, y, light_drag*merge(solver%fastest, 1.0_wp, solver%fastest > 0.0_wp), ok)
            if (ok) call newton_step(solver, motion, step, ok)
            if (ok .and. singular) ok = maxval(abs(step)) <= close_enough
            if (singular .and. .not. ok) &
               call raise(error, 'no equilibrium: the tangent stiffness is singular (a hinge without spring?)')
            if (.not. ok) return
            x = y(b + 1:r)
            if (maxval(abs(step)) <= close_enough) then
               y(b + 1:r) = x + step
               return
            end if
            share = min(1.0_wp, longest_step/maxval(abs(step)))
            do
               y(b + 1:r) = x + share*step
               call find_lacking(solver, motion, t, y, ok)
               if (ok) call newton_step(solver, motion, next, ok)
               if (ok) ok = norm2(next) <= (1.0_wp - 0.5_wp*share)*norm2(step)
               if (ok .or. share < smallest_share) exit
               share = 0.5_wp*share
            end do
            if (.not. ok) return
         end do
      end associate
      ok = .false.
   end subroutine iterate

   !> Where Newton's path ends at a singular stiffness, or hinge laws lead it in a circle: the motion M q' = h of the chain
   !> in a viscous medium leads past it, to an equilibrium that is stable there. Implicit steps of Euler's method, linearised with
   !> the laws that hold at their start, whose length follows from how far they go (pseudo-transient continuation, Kelley & Keyes,
   !> SIAM J. Numer. Anal. 35, 1998, 508). Forces must do work in each, by the trapezoidal rule, so that none comes back.
   subroutine creep(solver, motion, t, y)
      type(newton_solver), intent(inout) :: solver
      type(motion_type), intent(inout) :: motion
      real(wp), intent(in) :: t
      real(wp), contiguous, intent(inout) :: y(:)
      real(wp), allocatable :: x(:), step(:), before(:)
      real(wp) :: drag !! the inverse of the step in time [1/s^2]
      logical :: ok, changed
      integer :: i, short

      drag = 1.0_wp
      short = 0
      associate (b => motion%dynamics%scene%n_base, r => motion%n_q)
         x = y(b + 1:r)
         changed = laws_change(motion, t, y)
         call find_lacking(solver, motion, t, y, ok)
         do i = 1, most_creeping_steps
            if (ok) call factorise(solver, motion, y, drag, ok)
            if (ok) call newton_step(solver, motion, step, ok)
            if (ok) ok = maxval(abs(step)) <= creeping_step
            if (ok) then
               before = solver%lacking
               y(b + 1:r) = x + step
               changed = laws_change(motion, t, y)
               call find_lacking(solver, motion, t, y, ok)
               if (ok .and. maxval(abs(step)) > close_enough) &
                  ok = sum(solver%weight*solver%step*(before + solver%lacking)) >= 0.0_wp
            end if
            if (ok) then
               x = y(b + 1:r)
               short = merge(short + 1, 0, maxval(abs(step)) < 0.01_wp*creeping_step)
               if (short == 10) return ! at rest, whatever the drag
               drag = 0.25_wp*drag
            else
               drag = 4.0_wp*drag
               y(b + 1:r) = x
               changed = laws_change(motion, t, y)
               call find_lacking(solver, motion, t, y, ok)
            end if
         end do
      end associate
   end subroutine creep

   !> What of the state is sought.
   subroutine new_newton_solver(solver, motion, error)
      type(newton_solver), intent(out) :: solver
      type(motion_type), intent(inout) :: motion
      type(error_type), allocatable, intent(out) :: error
      integer, allocatable :: free(:)
      integer :: i

      associate (b => motion%dynamics%scene%n_base, r => motion%n_q, m => motion%n_dof, scene => motion%dynamics%scene, &
                 hinges => motion%dynamics%hinges)
         if (.not. allocated(motion%system%m)) call new_assembled_system(motion%system, scene, hinges, error)
         if (allocated(error)) return
         free = free_coordinates(scene, hinges)
         solver%chain = free(b + 1:)
         solver%joints = pack([(i, i=1, r - m)], .not. hinges%locked(hinges%relaxing))
         solver%kept = [solver%chain, m + solver%joints]
         associate (n => size(solver%kept))
            allocate (solver%lacking(n), solver%acceleration(m), solver%carried(m, b), solver%pivots(n))
         end associate
         solver%weight = [spread(1.0_wp, 1, size(free) - b), hinges%damping(hinges%relaxing(solver%joints))]
      end associate
   end subroutine new_newton_solver

   !> The balance at a state, from the accelerations of the kernel: h = M a.
   subroutine find_lacking(solver, motion, t, y, ok)
      type(newton_solver), intent(inout) :: solver
      type(motion_type), intent(inout) :: motion
      real(wp), intent(in) :: t
      real(wp), contiguous, intent(in) :: y(:)
      logical, intent(out) :: ok
      real(wp) :: rate(size(y)), forces(motion%n_dof), inertia(3, 3)
      real(wp) :: by_base(3, motion%n_dof)
      integer :: j, info

      call motion%rhs(t, y, rate, ok)
      if (.not. ok) return
      associate (b => motion%dynamics%scene%n_base, r => motion%n_q, m => motion%n_dof, scene => motion%dynamics%scene, &
                 hinges => motion%dynamics%hinges, work => motion%dynamics%work, mass => motion%system%m)
         call mass_matrix(motion%system, scene, hinges, work%sine, work%cosine, y(1:r))
         forces = matmul(mass, rate(r + 1:r + m))
         solver%carried = mass(:, 1:b)
         if (has_slaves(hinges)) then
            call reduce(scene, hinges%locked, forces)
            do j = 1, b
               call reduce(scene, hinges%locked, solver%carried(:, j))
            end do
         end if
         solver%acceleration = 0.0_wp
         if (b > 0) then
            inertia = mass(1:3, 1:3)
            by_base = transpose(solver%carried)
            call dpotrf('L', 3, inertia, 3, info)
            ok = info == 0
            if (.not. ok) return
            call dpotrs('L', 3, m, inertia, 3, by_base, 3, info)
            solver%acceleration(1:3) = forces(1:3)
            call dpotrs('L', 3, 1, inertia, 3, solver%acceleration, 3, info)
            solver%carried = transpose(by_base)
         end if
         forces = forces - matmul(solver%carried, forces(1:b))
         solver%lacking = [forces(solver%chain), rate(m + solver%joints)]
      end associate
      ok = all(abs(solver%lacking) <= huge(1.0_wp))
   end subroutine find_lacking

   !> Factor the derivative of what is lacking at the state that it belongs to, rows brought to a common scale. Not `ok`: singular.
   subroutine factorise(solver, motion, y, drag, ok)
      type(newton_solver), intent(inout) :: solver
      type(motion_type), intent(in) :: motion
      real(wp), intent(in) :: y(:)
      real(wp), intent(in) :: drag !! times the mass matrix is added [1/s^2]
      logical, intent(out) :: ok
      real(wp), allocatable :: expansion(:, :)
      real(wp) :: tangent(motion%n_q, motion%n_q)
      integer :: i, info, n

      associate (b => motion%dynamics%scene%n_base, r => motion%n_q, m => motion%n_dof, scene => motion%dynamics%scene, &
                 hinges => motion%dynamics%hinges)
         call balance_derivatives(motion, y, solver%acceleration, tangent(1:m, :), tangent(m + 1:r, :))
         tangent(1:m, 1:m) = tangent(1:m, 1:m) + drag*motion%system%m
         tangent(m + 1:r, :) = -tangent(m + 1:r, :)
         if (has_slaves(hinges)) then
            do i = 1, m
               call reduce(scene, hinges%locked, tangent(1:m, i))
            end do
         end if
         tangent(1:m, :) = tangent(1:m, :) - matmul(solver%carried, tangent(1:b, :))
         if (has_slaves(hinges)) then ! and no relaxing hinges
            expansion = expansion_matrix(scene, hinges)
            solver%lu = matmul(tangent(solver%chain, :), expansion(:, b + 1:))
         else
            solver%lu = tangent(solver%kept, solver%kept)
         end if
      end associate
      n = size(solver%lacking)
      solver%fastest = 0.0_wp
      do i = 1, size(solver%chain)
         solver%fastest = max(solver%fastest, abs(solver%lu(i, i))/motion%system%m(solver%chain(i), solver%chain(i)))
      end do
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

   !> The step of the chain by the factors at hand, and what follows from it by locks.
   subroutine newton_step(solver, motion, step, ok)
      type(newton_solver), intent(inout) :: solver
      type(motion_type), intent(in) :: motion
      real(wp), allocatable, intent(out) :: step(:)
      logical, intent(out) :: ok
      real(wp) :: whole(motion%n_q), still(0:motion%dynamics%scene%n - 1)
      integer :: info, n

      n = size(solver%scale)
      ok = .true.
      associate (b => motion%dynamics%scene%n_base, m => motion%n_dof, scene => motion%dynamics%scene, &
                 hinges => motion%dynamics%hinges)
         step = solver%lacking/solver%scale
         if (n > 0) call dgetrs('N', n, 1, solver%lu, n, solver%pivots, step, n, info)
         if (n > 0) ok = info == 0 .and. all(abs(step) <= huge(step))
         solver%step = step
         whole = 0.0_wp
         whole(solver%kept) = step
         still = 0.0_wp
         if (has_slaves(hinges)) call expand(scene, hinges%locked, still, whole)
         step = whole(b + 1:)
      end associate
   end subroutine newton_step

   !> A chain may rest on a spacecraft that turns ever faster, but not for long.
   subroutine check_spin(motion, t, y, error)
      type(motion_type), intent(inout) :: motion
      real(wp), intent(in) :: t
      real(wp), contiguous, intent(in) :: y(:)
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: rate(size(y)), jac(size(y), size(y))
      logical :: ok

      call motion%rhs(t, y, rate, ok)
      if (ok) call motion%jacobian(t, y, jac, ok)
      associate (r => motion%n_q, m => motion%n_dof, spin_rate => rate(motion%n_q + 3))
         ! The derivatives of the accelerations tell of their rounding errors.
         if (ok) ok = abs(spin_rate) <= 1.0e3_wp*epsilon(1.0_wp)*max(1.0_wp, maxval(abs(jac(r + 3:r + m, :))))
         if (ok) return
         call raise(error, "no equilibrium: the loads give the spacecraft an angular acceleration, omega' = "// &
                    formatted(spin_rate, '(es10.3)')//' rad/s^2')
      end associate
   end subroutine check_spin

end module rodyn_equilibrium
