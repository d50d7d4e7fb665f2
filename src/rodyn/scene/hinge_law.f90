!> Moments of the visco-elastic hinges, docs/model.md sec. 1, 2 and 5.
!>
!> With joint rotation th and its rate, T = C th + D th' + t0 + f. Kinks may move (`rodyn_kink_program`); t0 and f, the moment
!> of sliding friction, are zero but for mechanisms (`rodyn_hinge_mechanism`), whose C, D, t0 and f change at events. What
!> does not depend on angles and rates is one number a hinge, T = C opening + D opening' - offset,
!>     offset = C gamma + D gamma' - t0 - f.
!> When bending is quasistatic the rods are springs in
!> series with the hinges, and the joint rotations follow from one constant tridiagonal system (see
!> `rodyn_three_moments`). Dampers in such a series are treated in one of two ways:
!> - `reduced`: rates follow from the same system as rotations, accurate to (D w/C)^2;
!> - `exact`: the rotation of each damped hinge is a state of its own, th' = (T - C th)/D, behind phi in q.
!>
!> A locked hinge is a constraint and its moment a reaction. Between rods with inertia or rigid ones the kernels find it
!> (`rodyn_recursion_joints`, `rodyn_locks`). With quasistatic bending it comes from the three-moment equation, in which
!> th is given; see docs/locks.md.
module rodyn_hinge_law
   use rodyn_kinds, only: wp
   use rodyn_case_config, only: chain_config, hinge_config
   use rodyn_hinge_mechanism, only: hinge_mechanism, new_mechanism
   use rodyn_three_moments, only: three_moments, new_three_moments
   implicit none (type, external)
   private
   public :: hinge_law, new_hinge_law, hinge_moments, hinge_state, hinge_tangent, openings, &
      relaxation_rates, relaxation_tangent, initial_joints, spring_energy, damper_power, relaxing_power

   !> Springs, dampers and kinks of hinges 0..n-1.
   type :: hinge_law
      integer :: n = 0 !! hinges
      real(wp), allocatable :: stiffness(:) !! C (0:n-1) [N m/rad]
      real(wp), allocatable :: damping(:)   !! D (0:n-1) [N m s/rad]
      real(wp), allocatable :: kink(:)      !! gamma (0:n-1) [rad]
      real(wp), allocatable :: kink_rate(:) !! gamma' (0:n-1) [rad/s]
      real(wp), allocatable :: kink_acceleration(:) !! gamma'' (0:n-1) [rad/s^2]
      real(wp), allocatable :: constant(:)  !! t0 (0:n-1) [N m]
      real(wp), allocatable :: friction(:)  !! f (0:n-1) [N m]
      real(wp), allocatable :: offset(:)    !! C gamma + D gamma' - t0 - f (0:n-1) [N m]
      real(wp), allocatable :: steady(:)    !! t0 of hinges that are neither relaxing nor locked (0:n-1) [N m]
      real(wp), allocatable :: bent(:)      !! quasistatic: opening that it makes in the rods (0:n-1) [rad]
      type(hinge_mechanism), allocatable :: mechanisms(:) !! hinges that are more than this, in any order
      logical :: has_damping = .false.      !! some D > 0
      logical :: driven = .false.           !! some kink moves
      logical :: has_offsets = .false.      !! some offset may not be zero
      logical :: has_friction = .false.     !! some f /= 0
      logical :: curved = .false.           !! some law is not linear between events: C, D, t0 and f are those of its tangents
      logical :: quasistatic = .false.      !! rods bend without inertia
      type(three_moments) :: series         !! hinges and rods in series, when quasistatic
      integer, allocatable :: relaxing(:)   !! hinges whose rotation is a state (only quasistatic, exact dampers)
      logical, allocatable :: locked(:)     !! a constraint stands for spring and damper (0:n-1)
      logical :: has_locks = .false.        !! some are locked
      integer, allocatable :: held(:)       !! quasistatic: locked hinges that are not relaxing,
      real(wp), allocatable :: held_at(:)   !! and their th [rad]
   contains
      procedure :: lock
      procedure :: fastest_relaxation
      procedure :: next_release
      procedure :: find_locks
      procedure :: rest_at
      procedure :: set_kinks
      procedure :: follow
      procedure :: set_mechanisms
   end type hinge_law

contains

   !> Take over the hinges of a chain; factor the three-moment equation if bending is quasistatic.
   subroutine new_hinge_law(law, chain, flexibility, quasistatic, exact_dampers, driven, hinges)
      type(hinge_law), intent(out) :: law
      type(chain_config), intent(in) :: chain
      real(wp), intent(in) :: flexibility(:, :) !! of the rods (3, n), read when quasistatic (`rodyn_rod_bending`)
      logical, intent(in) :: quasistatic
      logical, intent(in) :: exact_dampers !! matters only when quasistatic
      logical, intent(in) :: driven !! some kink will move
      type(hinge_config), intent(in), optional :: hinges(:) !! more of some hinges; absent (not allocated): of none
      logical :: given(0:chain%n_rods - 1)
      integer :: k

      law%n = chain%n_rods
      allocate (law%stiffness(0:law%n - 1), law%damping(0:law%n - 1), law%kink(0:law%n - 1), law%kink_rate(0:law%n - 1), &
                law%kink_acceleration(0:law%n - 1), &
                law%constant(0:law%n - 1), law%friction(0:law%n - 1), law%offset(0:law%n - 1), &
                law%steady(0:law%n - 1), law%bent(0:law%n - 1), &
                source=0.0_wp)
      allocate (law%locked(0:law%n - 1), source=.false.)
      allocate (law%held(0), law%held_at(0))
      law%stiffness(:) = chain%hinge_stiffness
      law%damping(:) = chain%hinge_damping
      law%kink(:) = chain%kink
      law%quasistatic = quasistatic
      law%driven = driven
      given = quasistatic .and. exact_dampers .and. law%damping > 0.0_wp
      law%relaxing = pack([(k, k=0, law%n - 1)], given)
      if (quasistatic) law%series%flexibility = flexibility
      allocate (law%mechanisms(0))
      if (present(hinges)) then
         deallocate (law%mechanisms)
         allocate (law%mechanisms(size(hinges)))
         do k = 1, size(hinges)
            call new_mechanism(law%mechanisms(k), hinges(k), chain, quasistatic .and. .not. exact_dampers)
         end do
      end if
      law%curved = .not. all(law%mechanisms%is_linear())
      call law%set_mechanisms()
   end subroutine new_hinge_law

   !> Take the tangents of curved laws at a state between rods whose bending is rigid or dynamic.
   subroutine follow(self, flexible, angle, angle_rate)
      class(hinge_law), intent(inout) :: self
      logical, intent(in) :: flexible
      real(wp), intent(in) :: angle(*), angle_rate(*) !! as of `hinge_moments`
      real(wp), dimension(0:self%n - 1) :: opening, opening_rate
      integer :: i

      call openings(self%n, flexible, angle, opening)
      call openings(self%n, flexible, angle_rate, opening_rate)
      do i = 1, size(self%mechanisms)
         associate (mechanism => self%mechanisms(i), k => self%mechanisms(i)%hinge)
            mechanism%theta = opening(k) - self%kink(k)
            mechanism%theta_rate = opening_rate(k) - self%kink_rate(k)
         end associate
      end do
      call self%set_mechanisms()
   end subroutine follow

   !> Compile the laws that the mechanisms have now.
   subroutine set_mechanisms(self)
      class(hinge_law), intent(inout) :: self
      type(three_moments) :: series
      logical :: given(0:self%n - 1)
      integer :: i

      do i = 1, size(self%mechanisms)
         associate (k => self%mechanisms(i)%hinge)
            call self%mechanisms(i)%linear_law(self%stiffness(k), self%damping(k), self%constant(k), self%friction(k))
         end associate
      end do
      self%has_damping = any(self%damping > 0.0_wp)
      self%has_friction = any(abs(self%friction) > 0.0_wp)
      if (self%quasistatic) then
         given = self%locked
         given(self%relaxing) = .true.
         call new_three_moments(series, self%stiffness, self%series%flexibility, given)
         self%series = series
         call bend_rods(self)
      end if
      call self%set_kinks(self%kink, self%kink_rate)
      self%has_offsets = self%driven .or. any(abs(self%offset) > 0.0_wp) .or. any(abs(self%kink) > 0.0_wp)
   end subroutine set_mechanisms

   !> Opening F t0 that the constant moments make in the rods (`rodyn_three_moments`); relaxing and locked
   !> hinges have T as an unknown.
   pure subroutine bend_rods(self)
      type(hinge_law), intent(inout) :: self

      self%steady = self%constant
      self%steady(self%relaxing) = 0.0_wp
      self%steady(self%held) = 0.0_wp
      call bend_by(self, self%steady, self%bent)
   end subroutine bend_rods

   !> Opening F T that moments make in the rods.
   pure subroutine bend_by(self, moment, opening)
      type(hinge_law), intent(in) :: self
      real(wp), intent(in) :: moment(0:)   !! (0:n-1) [N m]
      real(wp), intent(out) :: opening(0:) !! (0:n-1) [rad]
      integer :: k

      opening = 0.0_wp
      do k = 1, self%n
         associate (f => self%series%flexibility(:, k))
            opening(k - 1) = opening(k - 1) + f(1)*moment(k - 1)
            if (k == self%n) cycle
            opening(k - 1) = opening(k - 1) + f(2)*moment(k)
            opening(k) = opening(k) + (f(2)*moment(k - 1) + f(3)*moment(k))
         end associate
      end do
   end subroutine bend_by

   !> Move the kinks. Scenes whose kinks move have `has_offsets` set for good.
   pure subroutine set_kinks(self, kink, kink_rate)
      class(hinge_law), intent(inout) :: self
      real(wp), intent(in) :: kink(0:)      !! gamma (0:n-1) [rad]
      real(wp), intent(in) :: kink_rate(0:) !! gamma' (0:n-1) [rad/s]
      integer :: k

      do k = 0, self%n - 1
         self%kink(k) = kink(k)
         self%kink_rate(k) = kink_rate(k)
         self%offset(k) = (self%stiffness(k)*kink(k) + self%damping(k)*kink_rate(k)) - (self%constant(k) + self%friction(k))
      end do
   end subroutine set_kinks

   !> Lock these hinges and free all others. With quasistatic bending the rotations at which they are held are needed,
   !> except those of relaxing hinges, which are states and stay where they are.
   subroutine lock(self, locked, theta)
      class(hinge_law), intent(inout) :: self
      logical, intent(in) :: locked(0:)            !! (0:n-1)
      real(wp), intent(in), optional :: theta(0:)  !! th of locked hinges (0:n-1) [rad]; absent: 0
      type(three_moments) :: series
      logical :: given(0:self%n - 1), state(0:self%n - 1)
      integer :: k

      self%locked(:) = locked
      self%has_locks = any(locked)
      if (.not. self%quasistatic) return
      state = .false.
      state(self%relaxing) = .true.
      self%held = pack([(k, k=0, self%n - 1)], locked .and. .not. state)
      self%held_at = spread(0.0_wp, 1, size(self%held))
      if (present(theta)) self%held_at = theta(self%held)
      given = locked .or. state
      call new_three_moments(series, self%stiffness, self%series%flexibility, given)
      self%series = series
      call bend_rods(self)
   end subroutine lock

   !> Which hinges the mechanisms lock by a constraint now, and where.
   pure subroutine find_locks(self, locked, theta)
      class(hinge_law), intent(in) :: self
      logical, intent(out) :: locked(0:) !! (0:n-1)
      real(wp), intent(out) :: theta(0:) !! th of these (0:n-1) [rad]
      integer :: i

      locked = .false.
      theta = 0.0_wp
      do i = 1, size(self%mechanisms)
         associate (mechanism => self%mechanisms(i))
            locked(mechanism%hinge) = mechanism%is_constrained()
            theta(mechanism%hinge) = mechanism%lock_angle
         end associate
      end do
   end subroutine find_locks

   !> When the next hinge that is held will be released [s].
   pure real(wp) function next_release(self, t)
      class(hinge_law), intent(in) :: self
      real(wp), intent(in) :: t !! [s]
      associate (mechanisms => self%mechanisms)
         next_release = minval(mechanisms%release_time, mechanisms%locked .and. mechanisms%release_time > t)
      end associate
   end function next_release

   !> Put the kinks where they leave no moment in any hinge, for good.
   pure subroutine rest_at(self, opening)
      class(hinge_law), intent(inout) :: self
      real(wp), intent(in) :: opening(0:) !! (0:n-1) [rad]
      self%driven = .false.
      self%curved = .false.
      self%has_offsets = .true.
      self%constant = 0.0_wp
      self%friction = 0.0_wp
      self%steady = 0.0_wp
      self%bent = 0.0_wp
      self%kink_acceleration = 0.0_wp
      call self%set_kinks(opening, spread(0.0_wp, 1, self%n))
   end subroutine rest_at

   !> Hinge moments T(0:n); T(n) = 0 at the free end. The opening of hinge k is phi_{k+1} - phi_k (rigid or
   !> quasistatic rods) or (phi + alpha)_{k+1} - (phi + beta)_k (dynamic bending), phi_0 = beta_0 = 0.
   pure subroutine hinge_moments(law, n, flexible, angle, angle_rate, theta, moment)
      type(hinge_law), intent(in) :: law
      integer, intent(in) :: n
      logical, intent(in) :: flexible !! angle and rate hold alpha and beta behind phi
      real(wp), intent(in) :: angle(*)      !! phi(n) [, alpha(n), beta(n)] [, th of relaxing hinges] [rad]
      real(wp), intent(in) :: angle_rate(*) !! their rates [rad/s]
      real(wp), intent(inout) :: theta(0:n - 1) !! workspace
      real(wp), intent(out) :: moment(0:n)  !! T [N m]

      if (size(law%relaxing) > 0) then
         call relaxing_moments(law, n, angle, theta, moment)
      else if (law%quasistatic) then
         call series_moments(law, n, angle, angle_rate, theta, moment)
      else if (flexible) then
         call flexible_moments(n, law%stiffness, law%damping, law%offset, law%has_damping, law%has_offsets, &
                               angle, angle_rate, moment)
      else
         call rigid_moments(n, law%stiffness, law%damping, law%offset, law%has_damping, law%has_offsets, &
                            angle, angle_rate, moment)
      end if
   end subroutine hinge_moments

   !> T = C opening + D opening' - offset between rods that bend. One pass: the tangent at the outer end of
   !> rod k, (phi + beta)_k, is kept for the next hinge.
   pure subroutine flexible_moments(n, stiffness, damping, offset, damped, shifted, angle, angle_rate, moment)
      integer, intent(in) :: n
      real(wp), intent(in) :: stiffness(0:n - 1), damping(0:n - 1), offset(0:n - 1)
      logical, intent(in) :: damped, shifted
      real(wp), intent(in) :: angle(n, 3), angle_rate(n, 3) !! phi, alpha, beta and rates
      real(wp), intent(out) :: moment(0:n)
      real(wp) :: outer, outer_rate
      integer :: k

      outer = 0.0_wp
      outer_rate = 0.0_wp
      if (damped) then
         do k = 1, n
            moment(k - 1) = stiffness(k - 1)*((angle(k, 1) + angle(k, 2)) - outer) + &
                            damping(k - 1)*((angle_rate(k, 1) + angle_rate(k, 2)) - outer_rate)
            outer = angle(k, 1) + angle(k, 3)
            outer_rate = angle_rate(k, 1) + angle_rate(k, 3)
         end do
      else
         do k = 1, n
            moment(k - 1) = stiffness(k - 1)*((angle(k, 1) + angle(k, 2)) - outer)
            outer = angle(k, 1) + angle(k, 3)
         end do
      end if
      moment(n) = 0.0_wp
      if (shifted) moment(0:n - 1) = moment(0:n - 1) - offset
   end subroutine flexible_moments

   !> The same between rigid rods.
   pure subroutine rigid_moments(n, stiffness, damping, offset, damped, shifted, angle, angle_rate, moment)
      integer, intent(in) :: n
      real(wp), intent(in) :: stiffness(0:n - 1), damping(0:n - 1), offset(0:n - 1)
      logical, intent(in) :: damped, shifted
      real(wp), intent(in) :: angle(n), angle_rate(n) !! phi and rates
      real(wp), intent(out) :: moment(0:n)
      integer :: k

      moment(0) = stiffness(0)*angle(1)
      do k = 1, n - 1
         moment(k) = stiffness(k)*(angle(k + 1) - angle(k))
      end do
      moment(n) = 0.0_wp
      if (shifted) moment(0:n - 1) = moment(0:n - 1) - offset
      if (.not. damped) return
      moment(0) = moment(0) + damping(0)*angle_rate(1)
      do k = 1, n - 1
         moment(k) = moment(k) + damping(k)*(angle_rate(k + 1) - angle_rate(k))
      end do
   end subroutine rigid_moments

   !> Opening of each hinge, without its kink; the same map takes rates to rates.
   pure subroutine openings(n, flexible, angle, opening)
      integer, intent(in) :: n
      logical, intent(in) :: flexible
      real(wp), intent(in) :: angle(*)
      real(wp), intent(out) :: opening(0:n - 1)
      integer :: k

      if (flexible) then
         opening(0) = angle(1) + angle(n + 1)
         do k = 1, n - 1
            opening(k) = (angle(k + 1) + angle(n + k + 1)) - (angle(k) + angle(2*n + k))
         end do
      else
         opening(0) = angle(1)
         do k = 1, n - 1
            opening(k) = angle(k + 1) - angle(k)
         end do
      end if
   end subroutine openings

   !> Quasistatic bending: th = G (opening - gamma - F t0), T = C th + t0 + G^T (D th' + f), th' = G (opening' - gamma'), G of
   !> the three-moment equation. The damping term is what Rayleigh's function sum D th'^2 / 2 gives, so energy balances
   !> exactly; friction goes with it.
   pure subroutine series_moments(law, n, angle, angle_rate, theta, moment)
      type(hinge_law), intent(in) :: law
      integer, intent(in) :: n
      real(wp), intent(in) :: angle(*), angle_rate(*)
      real(wp), intent(inout) :: theta(0:n - 1)
      real(wp), intent(out) :: moment(0:n)

      call openings(n, .false., angle, theta)
      if (law%has_offsets) theta = theta - (law%kink + law%bent)
      call take_held(law, theta)
      call law%series%solve(theta)
      moment(0:n - 1) = law%stiffness*theta
      if (law%has_offsets) moment(0:n - 1) = moment(0:n - 1) + law%steady
      moment(n) = 0.0_wp
      call put_at(law%held, theta, moment)
      if (.not. (law%has_damping .or. law%has_friction)) return
      call openings(n, .false., angle_rate, theta)
      if (law%has_offsets) theta = theta - law%kink_rate
      call law%series%solve(theta)
      theta = law%damping*theta
      if (law%has_friction) theta = theta + law%friction
      call clear_at(law%held, theta)
      call law%series%solve_transposed(theta)
      moment(0:n - 1) = moment(0:n - 1) + theta
   end subroutine series_moments

   !> Rotations at which hinges are held leave the right-hand side of the three-moment equation.
   pure subroutine take_held(law, theta)
      type(hinge_law), intent(in) :: law
      real(wp), intent(inout) :: theta(0:)
      integer :: i
      do i = 1, size(law%held)
         theta(law%held(i)) = theta(law%held(i)) - law%held_at(i)
      end do
   end subroutine take_held

   !> moment(k) = solution(k) for hinges whose moment is the unknown of the three-moment equation.
   pure subroutine put_at(hinges, solution, moment)
      integer, intent(in) :: hinges(:)
      real(wp), intent(in) :: solution(0:)
      real(wp), intent(inout) :: moment(0:)
      integer :: i
      do i = 1, size(hinges)
         moment(hinges(i)) = solution(hinges(i))
      end do
   end subroutine put_at

   !> rate(k) = 0 for hinges that are held.
   pure subroutine clear_at(hinges, rate)
      integer, intent(in) :: hinges(:)
      real(wp), intent(inout) :: rate(0:)
      integer :: i
      do i = 1, size(hinges)
         rate(hinges(i)) = 0.0_wp
      end do
   end subroutine clear_at

   !> Quasistatic bending with the rotations of the damped hinges as states: their moments, and the rotations
   !> of the others, solve one system.
   pure subroutine relaxing_moments(law, n, angle, theta, moment)
      type(hinge_law), intent(in) :: law
      integer, intent(in) :: n
      real(wp), intent(in) :: angle(*)
      real(wp), intent(out) :: theta(0:n - 1) !! solution: T of relaxing hinges, th of the others
      real(wp), intent(out) :: moment(0:n)

      call openings(n, .false., angle, theta)
      if (law%has_offsets) theta = theta - (law%kink + law%bent)
      call take_held(law, theta)
      call moments_of_series(law, n, theta, angle(n + 1:n + size(law%relaxing)), moment)
      if (law%has_offsets) moment(0:n - 1) = moment(0:n - 1) + law%steady
   end subroutine relaxing_moments

   !> T(0:n) from openings (in `theta`, less what is held) and given rotations of the relaxing hinges, without constant
   !> moments: linear, so it serves changes as well.
   pure subroutine moments_of_series(law, n, theta, given, moment)
      type(hinge_law), intent(in) :: law
      integer, intent(in) :: n
      real(wp), intent(inout) :: theta(0:n - 1)
      real(wp), intent(in) :: given(:)
      real(wp), intent(out) :: moment(0:n)
      integer :: i

      do i = 1, size(given)
         theta(law%relaxing(i)) = theta(law%relaxing(i)) - given(i)
      end do
      call law%series%solve(theta)
      moment(0:n - 1) = law%stiffness*theta
      moment(n) = 0.0_wp
      call put_at(law%relaxing, theta, moment)
      call put_at(law%held, theta, moment)
   end subroutine moments_of_series

   !> th' = (T - C th - t0 - f)/D of the relaxing hinges, 0 of locked ones.
   pure subroutine relaxation_rates(law, moment, theta, theta_rate)
      type(hinge_law), intent(in) :: law
      real(wp), intent(in) :: moment(0:)      !! T (0:n) [N m]
      real(wp), intent(in) :: theta(:)        !! th of the relaxing hinges [rad]
      real(wp), intent(out) :: theta_rate(:)  !! [rad/s]
      integer :: i

      call relaxation_tangent(law, moment, theta, theta_rate)
      if (.not. law%has_offsets) return
      do i = 1, size(law%relaxing)
         associate (k => law%relaxing(i))
            if (.not. law%locked(k)) theta_rate(i) = theta_rate(i) - (law%constant(k) + law%friction(k))/law%damping(k)
         end associate
      end do
   end subroutine relaxation_rates

   !> The same for changes.
   pure subroutine relaxation_tangent(law, moment, theta, theta_rate)
      type(hinge_law), intent(in) :: law
      real(wp), intent(in) :: moment(0:)      !! T (0:n) [N m]
      real(wp), intent(in) :: theta(:)        !! th of the relaxing hinges [rad]
      real(wp), intent(out) :: theta_rate(:)  !! [rad/s]
      integer :: i, k

      do i = 1, size(law%relaxing)
         k = law%relaxing(i)
         theta_rate(i) = (moment(k) - law%stiffness(k)*theta(i))/law%damping(k)
         if (law%locked(k)) theta_rate(i) = 0.0_wp
      end do
   end subroutine relaxation_tangent

   !> A bound of the rates at which relaxing hinges follow [1/s]: (C + 1/F_min)/D, F_min the smallest eigenvalue of the
   !> flexibility of the rods, at least that of the stiffest rod: l/(6 EI) if uniform.
   pure real(wp) function fastest_relaxation(self)
      class(hinge_law), intent(in) :: self
      fastest_relaxation = 0.0_wp
      if (size(self%relaxing) == 0) return
      associate (f => self%series%flexibility)
         fastest_relaxation = maxval((self%stiffness(self%relaxing) + 1.0_wp/minval(softness(f)))/self%damping(self%relaxing))
      end associate
   end function fastest_relaxation

   !> Smaller eigenvalue of the flexibility of each rod [1/(N m)].
   pure function softness(f)
      real(wp), intent(in) :: f(:, :) !! f11, f12, f22 (3, n)
      real(wp) :: softness(size(f, 2))
      softness = 0.5_wp*(f(1, :) + f(3, :) - sqrt((f(1, :) - f(3, :))**2 + 4.0_wp*f(2, :)**2))
   end function softness

   !> Rotations of the relaxing hinges at the start: those of springs and rods in balance, dampers at rest; where hinges are
   !> locked, theirs.
   subroutine initial_joints(law, phi, locked_at, theta)
      type(hinge_law), intent(in) :: law
      real(wp), intent(in) :: phi(:)        !! chord angles (n) [rad]
      real(wp), intent(in) :: locked_at(0:) !! th of locked hinges, others are not read (0:n-1) [rad]
      real(wp), intent(out) :: theta(:)     !! of the relaxing hinges [rad]
      type(three_moments) :: undamped
      real(wp), dimension(0:law%n - 1) :: all_joints, bent

      call new_three_moments(undamped, law%stiffness, law%series%flexibility, law%locked)
      call openings(law%n, .false., phi, all_joints)
      call bend_by(law, merge(0.0_wp, law%constant, law%locked), bent)
      all_joints = all_joints - (law%kink + bent)
      where (law%locked) all_joints = all_joints - locked_at
      call undamped%solve(all_joints)
      where (law%locked) all_joints = locked_at
      theta = all_joints(law%relaxing)
   end subroutine initial_joints

   !> Joint rotations th, their rates, and the moments that bend the rods, for events, output and ledger. In the `reduced`
   !> treatment rods feel the springs only.
   pure subroutine hinge_state(law, n, flexible, angle, angle_rate, theta, theta_rate, moment, moment_rate)
      type(hinge_law), intent(in) :: law
      integer, intent(in) :: n
      logical, intent(in) :: flexible
      real(wp), intent(in) :: angle(*), angle_rate(*)
      real(wp), intent(out) :: theta(0:n - 1)      !! th [rad]
      real(wp), intent(out) :: theta_rate(0:n - 1) !! th' [rad/s]
      real(wp), intent(out) :: moment(0:n)         !! [N m]
      real(wp), intent(out) :: moment_rate(0:n)    !! [N m/s]

      moment = 0.0_wp
      moment_rate = 0.0_wp
      call openings(n, flexible, angle, theta)
      theta = theta - law%kink
      call openings(n, flexible, angle_rate, theta_rate)
      theta_rate = theta_rate - law%kink_rate
      if (.not. law%quasistatic) return
      theta = theta - law%bent
      associate (r => size(law%relaxing))
         if (r > 0) then
            call relaxing_state(law, n, angle(n + 1:n + r), theta, theta_rate, moment, moment_rate)
            return
         end if
      end associate
      call take_held(law, theta)
      call law%series%solve(theta)
      call law%series%solve(theta_rate)
      moment(0:n - 1) = law%stiffness*theta + law%steady
      moment_rate(0:n - 1) = law%stiffness*theta_rate
      call put_at(law%held, theta, moment)
      call put_at(law%held, theta_rate, moment_rate)
      theta(law%held) = law%held_at
      call clear_at(law%held, theta_rate)
   end subroutine hinge_state

   !> The same with relaxing hinges; on entry theta and theta_rate hold the openings from their kinks (and what constant
   !> moments bend), and their rates.
   pure subroutine relaxing_state(law, n, given, theta, theta_rate, moment, moment_rate)
      type(hinge_law), intent(in) :: law
      integer, intent(in) :: n
      real(wp), intent(in) :: given(:) !! th of the relaxing hinges
      real(wp), intent(inout) :: theta(0:n - 1), theta_rate(0:n - 1)
      real(wp), intent(out) :: moment(0:n), moment_rate(0:n)
      real(wp) :: rate(size(given))

      call take_held(law, theta)
      call moments_of_series(law, n, theta, given, moment)
      moment(0:n - 1) = moment(0:n - 1) + law%steady
      call relaxation_rates(law, moment, given, rate)
      call moments_of_series(law, n, theta_rate, rate, moment_rate)
      theta(law%held) = law%held_at
      theta(law%relaxing) = given
      theta_rate(law%relaxing) = rate
      call clear_at(law%held, theta_rate)
   end subroutine relaxing_state

   !> Rates th' of the joint rotations alone, where no hinge is relaxing.
   pure subroutine hinge_rates(law, n, flexible, angle_rate, theta_rate)
      type(hinge_law), intent(in) :: law
      integer, intent(in) :: n
      logical, intent(in) :: flexible
      real(wp), intent(in) :: angle_rate(*)
      real(wp), intent(out) :: theta_rate(0:n - 1) !! th' [rad/s]

      call openings(n, flexible, angle_rate, theta_rate)
      if (law%driven) theta_rate = theta_rate - law%kink_rate
      if (law%quasistatic) call law%series%solve(theta_rate)
      call clear_at(law%held, theta_rate)
   end subroutine hinge_rates

   !> Energy of all springs [J].
   pure real(wp) function spring_energy(law, theta)
      type(hinge_law), intent(in) :: law
      real(wp), intent(in) :: theta(0:) !! th (0:n-1) [rad]
      integer :: i

      spring_energy = 0.5_wp*sum(law%stiffness*theta**2)
      do i = 1, size(law%mechanisms)
         associate (mechanism => law%mechanisms(i), k => law%mechanisms(i)%hinge)
            spring_energy = spring_energy + (mechanism%energy(theta(k)) - 0.5_wp*law%stiffness(k)*theta(k)**2)
         end associate
      end do
   end function spring_energy

   !> Power that dampers and sliding friction take, sum D th'^2 + f th' [W], where no hinge is relaxing.
   pure subroutine damper_power(law, n, flexible, angle_rate, rate, power)
      type(hinge_law), intent(in) :: law
      integer, intent(in) :: n
      logical, intent(in) :: flexible
      real(wp), intent(in) :: angle_rate(*)
      real(wp), intent(inout) :: rate(0:n - 1) !! workspace: th' [rad/s]
      real(wp), intent(out) :: power           !! [W]
      integer :: k

      power = 0.0_wp
      if (.not. (law%has_damping .or. law%has_friction)) return
      call hinge_rates(law, n, flexible, angle_rate, rate)
      do k = 0, n - 1
         power = power + law%damping(k)*rate(k)**2
      end do
      if (.not. law%has_friction) return
      do k = 0, n - 1
         power = power + law%friction(k)*rate(k)
      end do
   end subroutine damper_power

   !> The same where hinges are relaxing: these have all dampers.
   pure real(wp) function relaxing_power(law, rate) result(power)
      type(hinge_law), intent(in) :: law
      real(wp), intent(in) :: rate(:) !! th' of the relaxing hinges [rad/s]
      integer :: i

      power = 0.0_wp
      do i = 1, size(rate)
         associate (k => law%relaxing(i))
            power = power + (law%damping(k)*rate(i) + law%friction(k))*rate(i)
         end associate
      end do
   end function relaxing_power

   !> Change of the hinge moments for a change of angles and rates (the law is linear but for its offset). Reactions of
   !> locked hinges are left out where the kernels find them.
   pure subroutine hinge_tangent(law, n, flexible, d_angle, d_angle_rate, work, d_moment)
      type(hinge_law), intent(in) :: law
      integer, intent(in) :: n
      logical, intent(in) :: flexible
      real(wp), intent(in) :: d_angle(*), d_angle_rate(*)
      real(wp), intent(inout) :: work(0:n - 1)
      real(wp), intent(out) :: d_moment(0:n)

      call openings(n, flexible, d_angle, work)
      if (size(law%relaxing) > 0) then
         call moments_of_series(law, n, work, d_angle(n + 1:n + size(law%relaxing)), d_moment)
         return
      end if
      if (law%quasistatic) call law%series%solve(work)
      d_moment(0:n - 1) = law%stiffness*work
      d_moment(n) = 0.0_wp
      call put_at(law%held, work, d_moment)
      if (law%has_damping) then
         call openings(n, flexible, d_angle_rate, work)
         if (law%quasistatic) call law%series%solve(work)
         work = law%damping*work
         call clear_at(law%held, work)
         if (law%quasistatic) call law%series%solve_transposed(work)
         d_moment(0:n - 1) = d_moment(0:n - 1) + work
      end if
      if (law%quasistatic .or. .not. law%has_locks) return
      where (law%locked) d_moment(0:n - 1) = 0.0_wp
   end subroutine hinge_tangent

end module rodyn_hinge_law
