!> Gauss collocation of order 16 for mechanical systems: eight nodes of a step side by side in vector lanes.
!>
!> The accelerations at the nodes, F, solve F_i = f(t_i, Q_i, P_i) with
!>     P = p + h A F,   Q = q + c h p + h^2 A^2 F.
!> Fixed-point iteration would need steps far below the period of the fastest vibration. Those vibrations are nearly
!> linear, so each correction solves them implicitly: with the stiff modes (u, v) of `rodyn_stiff_modes`, in which K and D are
!> springs and dampers, the residual R = f - F is answered by
!>     dF = R - u G v.R,   G = 1 - (1 + h D A + h^2 K A^2)^-1   (`rodyn_modal_reply`),
!> and the first guess extrapolates only N = f + u (K v.Q + D v.P), which is smooth. Three or four iterations
!> are enough for steps of half a period. The modes are those of a configuration some steps ago; they are found again
!> when the iterations they cost exceed what finding them does.
!>
!> The method is symmetric and symplectic, so that fixed steps keep the energy of an undamped scene for any length of
!> time. Outputs inside a step are computed by one shorter step from its start.
module rodyn_gauss_integrator
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use rodyn_kinds, only: wp
   use rodyn_lanes, only: s => lanes
   use rodyn_errors, only: error_type, raise
   use rodyn_text, only: time_text
   use rodyn_ode, only: ode_system, mechanical_system, n_quadratures
   use rodyn_integrator, only: solver_options, cannot_evaluate
   use rodyn_one_step_integrator, only: one_step_integrator
   use rodyn_lane_algebra, only: multiply
   use rodyn_gauss_stages, only: gauss_stages, new_gauss_stages, reserve_modes, set_step, set_weights, iterate, nodes_from, &
      form_increment, neglected_of, swap_matrices, swap_records, most_iterations, typical_lambda, wanted_estimate
   use rodyn_gauss_guess, only: predict, choose_degree, renew_history
   implicit none (type, external)
   private
   public :: gauss_integrator, new_gauss_integrator

   real(wp), parameter :: memory = 0.9_wp           !! of `late_rate`, from step to step
   real(wp), parameter :: largest_estimate = 0.7_wp !! of the error, in tolerances
   real(wp), parameter :: first_phase = 2.0_wp      !! fastest frequency times the first step
   real(wp), parameter :: smallest_phase = 0.4_wp   !! slower vibrations need no implicit treatment
   integer, parameter :: degree_interval = 16       !! steps after which the degree of the first guess is judged again
   real(wp), parameter :: search_cost = 1.0_wp      !! finding modes, in iterations per unknown
   integer, parameter :: most_inner_steps = 8       !! to an output
   character(len=*), parameter :: no_powers = 'work and dissipation cannot be evaluated'

   type, extends(one_step_integrator) :: gauss_integrator
      private
      type(gauss_stages) :: stages
      real(wp), allocatable :: node_state(:) !! workspace: (q, p) at one node
      logical :: refines = .true.            !! quadratures whose errors are too large; if explicit steps once could not follow
                                             !! what is stiff, they are not tried again before the next start
      integer :: fewest = most_iterations    !! iterations of any step since the modes were found
      real(wp) :: excess = 0.0_wp            !! iterations lost since then
      real(wp) :: estimate = 0.0_wp          !! of the error, mean of the last steps; 0: none
   contains
      procedure :: start
      procedure :: step
      procedure :: output
   end type gauss_integrator

contains

   !> Create an integrator for `system`, which must be mechanical and outlive it.
   subroutine new_gauss_integrator(self, system, options, error)
      type(gauss_integrator), intent(out) :: self
      class(ode_system), target, intent(inout) :: system
      type(solver_options), intent(in) :: options
      type(error_type), allocatable, intent(out) :: error
      class(mechanical_system), pointer :: mechanics

      mechanics => null()
      select type (system)
      class is (mechanical_system)
         if (system%has_lanes()) mechanics => system
      end select
      if (.not. associated(mechanics)) then
         call raise(error, "'gauss' cannot integrate this system (joint rotations that are states of their own: "// &
                    "dampers = 'exact'; stops, freeplay, friction and latches of hinges, which its long steps would not see)")
         return
      end if
      call mechanics%forget_modes() ! so that the result does not depend on what was integrated before
      call self%create(system, options, options, 'gauss', 16)
      call new_gauss_stages(self%stages, mechanics, options)
      allocate (self%node_state(2*mechanics%n_dof), source=0.0_wp)
   end subroutine new_gauss_integrator

   !> First start, or exact restart. `set_stop` comes before.
   subroutine start(self, t, y, error)
      class(gauss_integrator), intent(inout) :: self
      real(wp), intent(in) :: t    !! [s]
      real(wp), intent(in) :: y(:) !! (n_states)
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: fastest

      call self%begin(t, y, error)
      if (allocated(error)) return
      self%stages%has_history = .false.
      self%refines = .true.
      self%stages%now%h = 0.0_wp
      associate (span => self%t_stop - t)
         if (self%grid%n > 0) then
            self%h = span/real(self%grid%n, wp)
         else
            call search_modes(self, 0.0_wp, error)
            if (allocated(error)) return
            fastest = self%stages%modes%fastest()
            self%h = span
            if (fastest*span > first_phase) self%h = first_phase/fastest
            if (self%stages%modes%n == 0) self%h = 1.0e-3_wp*span
            if (self%options%max_step > 0.0_wp) self%h = min(self%h, self%options%max_step)
         end if
      end associate
      call search_modes(self, self%h, error)
   end subroutine start

   !> State inside the last step, by one shorter step from its start whose first guess is that step's own polynomial. Should its
   !> iteration not converge, by several steps; and if nothing helps, by the polynomial itself, which is of lower order.
   subroutine output(self, t, y, error)
      class(gauss_integrator), intent(inout) :: self
      real(wp), intent(in) :: t !! [s]
      real(wp), contiguous, intent(out) :: y(:)
      type(error_type), allocatable, intent(inout) :: error !! powers that cannot be evaluated
      integer :: n
      logical :: ok

      call swap_matrices(self%stages%now, self%stages%spare)
      n = 1
      do
         call inner_steps(self, t - self%t_before, n, .true., y, ok)
         if (ok .or. n >= most_inner_steps) exit
         n = 2*n
      end do
      if (.not. ok) call inner_steps(self, t - self%t_before, 1, .false., y, ok)
      call swap_matrices(self%stages%now, self%stages%spare)
      if (.not. ok) call raise(error, 'gauss: output at t = '//time_text(t)//' s: '//no_powers)
   end subroutine output

   !> From the start of the last step over a time h in n equal steps.
   subroutine inner_steps(self, h, n, iterated, y, ok)
      class(gauss_integrator), intent(inout) :: self
      real(wp), intent(in) :: h !! [s]
      integer, intent(in) :: n
      logical, intent(in) :: iterated !! else their first guess is left as it is
      real(wp), contiguous, intent(out) :: y(:)
      logical, intent(out) :: ok
      real(wp) :: rates(2), t
      integer :: i

      y = self%y_before
      rates = [self%stages%rate, self%stages%late_rate]
      self%stages%late_rate = 0.0_wp ! this first guess is nearly right in all its parts
      call set_step(self%stages, h/n)
      do i = 0, n - 1
         t = self%t_before + h*(real(i, wp)/n)
         associate (stages => self%stages)
            call multiply(stages%mechanics%n_dof, stages%rule%interpolation((h*i)/(n*stages%last%h), h/(n*stages%last%h)), &
                          stages%last%f, stages%trial%f)
         end associate
         ok = .true.
         if (iterated) then
            call set_weights(self%stages, y)
            call iterate(self%stages, t, y, self%counts, ok)
            if (ok) ok = all(ieee_is_finite(self%stages%trial%f))
            if (.not. ok) exit
         else
            call nodes_from(self%stages, y)
         end if
         call form_increment(self%stages, y, self%increment)
         if (self%system%has_quadratures()) call add_quadratures(self, t, y, ok)
         if (.not. ok) exit
         y = y + self%increment
      end do
      self%stages%rate = rates(1)
      self%stages%late_rate = rates(2)
   end subroutine inner_steps

   !> One accepted step: try, and shorten, until iteration and error allow it.
   subroutine step(self, error)
      class(gauss_integrator), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: h, t_new, estimate
      logical :: ok, rejected

      rejected = .false.
      call set_weights(self%stages, self%y_good)
      do
         call self%permit_step(error)
         if (allocated(error)) return
         if (self%excess > search_cost*self%stages%mechanics%n_dof) call search_modes(self, self%h, error)
         if (allocated(error)) return
         call choose_end(self, h, t_new)
         if (h <= 4.0_wp*spacing(self%t)) then
            call self%cannot_step(obstacle(self), error)
            return
         end if
         call try(self, h, estimate, ok)
         if (ok .and. (estimate <= largest_estimate .or. self%grid%n > 0)) exit
         if (self%grid%n > 0 .and. rejected) then ! not even with new modes
            call self%cannot_step(obstacle(self), error)
            return
         end if
         rejected = .true.
         call shorten(self, h, estimate, ok)
      end do
      if (modulo(self%n_steps, degree_interval) == 0) call choose_degree(self%stages)
      if (self%system%has_quadratures()) call add_quadratures(self, self%t, self%y_good, ok)
      if (.not. ok) then
         call self%cannot_step(no_powers, error)
         return
      end if
      call accept(self, h, t_new)
      if (self%system%has_quadratures()) &
         call self%system%note_quadratures(self%y_good(self%system%n_controlled + 1:), self%quadrature_error)
      if (self%grid%n == 0) call choose_next(self, h, t_new, estimate, rejected)
   end subroutine step

   !> A step of length h from t.
   subroutine try(self, h, estimate, ok)
      class(gauss_integrator), intent(inout) :: self
      real(wp), intent(in) :: h         !! [s]
      real(wp), intent(out) :: estimate !! of its error, in tolerances
      logical, intent(out) :: ok        !! false: the iteration did not converge

      associate (stages => self%stages)
         call set_step(stages, h)
         if (stages%now%coupled .neqv. stages%modes%coupled) then
            stages%modes%coupled = stages%now%coupled
            call renew_history(stages, self%grid%i > 0, self%y_before)
         end if
         call predict(stages, self%t, self%y_good, self%counts, ok)
         if (ok) call iterate(stages, self%t, self%y_good, self%counts, ok)
         estimate = huge(1.0_wp)
         if (.not. ok) return
         call form_increment(stages, self%y_good, self%increment, estimate)
         ok = all(ieee_is_finite(self%increment))
      end associate
   end subroutine try

   !> After a step that was refused.
   subroutine shorten(self, h, estimate, ok)
      class(gauss_integrator), intent(inout) :: self
      real(wp), intent(in) :: h, estimate
      logical, intent(in) :: ok !! only its error was too large

      self%counts%n_error_test_failures = self%counts%n_error_test_failures + 1
      self%n_steps = self%n_steps - 1
      if (ok) then
         self%h = h*max(0.3_wp, 0.9_wp*(wanted_estimate/estimate)**(1.0_wp/17.0_wp))
      else
         self%counts%n_nonlinear_failures = self%counts%n_nonlinear_failures + 1
         self%excess = huge(1.0_wp) ! the cause may be the modes
         if (self%grid%n == 0) self%h = 0.4_wp*h
      end if
   end subroutine shorten

   !> Keep the step while it is nearly right: a new one costs new matrices.
   subroutine choose_next(self, h, t_new, estimate, rejected)
      class(gauss_integrator), intent(inout) :: self
      real(wp), intent(in) :: h, t_new, estimate
      logical, intent(in) :: rejected
      real(wp) :: factor

      ! The estimate depends on the phase of the vibrations: two steps' mean tells more.
      self%estimate = sqrt(max(estimate, 1.0e-30_wp)*merge(self%estimate, max(estimate, 1.0e-30_wp), self%estimate > 0.0_wp))
      factor = min(2.0_wp, (wanted_estimate/self%estimate)**(1.0_wp/17.0_wp))
      if (self%stages%iterations > 8) factor = min(factor, 0.8_wp)
      if (rejected) factor = min(factor, 1.0_wp)
      if (factor > 0.93_wp .and. factor < 1.12_wp) factor = 1.0_wp
      if (factor < 1.0_wp .or. factor > 1.0_wp) self%estimate = 0.0_wp
      call self%change_step(h, factor, t_new)
   end subroutine choose_next

   !> The step to try and the time it ends at: on the stop time if that is near, or on the grid of fixed steps.
   subroutine choose_end(self, h, t_new)
      class(gauss_integrator), intent(in) :: self
      real(wp), intent(out) :: h, t_new
      real(wp) :: left

      if (self%grid%n > 0) then
         t_new = self%grid%next_end()
         h = (self%grid%t_last - self%grid%t_first)/real(self%grid%n, wp)
         return
      end if
      h = self%h
      left = self%t_stop - self%t
      t_new = self%t_stop
      if (h >= left) then
         h = left
      else if (1.8_wp*h > left) then ! two even steps rather than one and a sliver
         h = 0.5_wp*left
         t_new = self%t + (h - self%t_lost)
      else
         t_new = self%t + (h - self%t_lost)
      end if
   end subroutine choose_end

   !> Find the stiff modes at the present configuration, and what follows from them.
   subroutine search_modes(self, h, error)
      class(gauss_integrator), intent(inout) :: self
      real(wp), intent(in) :: h !! expected step, 0: unknown [s]
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: slowest, weight
      logical :: ok

      slowest = 0.0_wp
      weight = 0.0_wp
      if (h > 0.0_wp .and. self%grid%n == 0) slowest = smallest_phase/h
      if (h > 0.0_wp) weight = 1.0_wp/(typical_lambda*h)
      call self%stages%mechanics%find_modes(self%y_good(:self%stages%mechanics%n_dof), slowest, weight, self%stages%modes, ok)
      self%counts%n_jac = self%counts%n_jac + 1
      if (.not. ok) then
         call raise(error, 'gauss at t = '//time_text(self%t)//' s: mass matrix not positive definite')
         return
      end if
      self%excess = 0.0_wp
      self%fewest = most_iterations
      call reserve_modes(self%stages, size(self%stages%modes%square))
      if (h > 0.0_wp) self%stages%modes%coupled = self%stages%modes%couples(1.0_wp/(typical_lambda*h))
      call renew_history(self%stages, self%grid%i > 0, self%y_before)
   end subroutine search_modes

   !> Integrals of the states behind (q, p), by the nodes of the step or, if these are too few for them, refined.
   subroutine add_quadratures(self, t, y, ok)
      class(gauss_integrator), intent(inout) :: self
      real(wp), intent(in) :: t    !! at the start of the step [s]
      real(wp), intent(in) :: y(:) !! there
      logical, intent(out) :: ok   !! false: the rates cannot be evaluated at a node
      real(wp) :: power(s, n_quadratures) ! rates at the nodes
      real(wp) :: rate(n_quadratures)
      real(wp) :: tolerance
      logical :: followed
      integer :: i

      associate (m => self%stages%mechanics%n_dof, h => self%stages%now%h, error => self%quadrature_error)
         do i = 1, s
            self%node_state(:m) = self%stages%trial%q(i, :)
            self%node_state(m + 1:) = self%stages%trial%p(i, :)
            call self%system%quadratures(t + h*self%stages%rule%c(i), self%node_state, rate, ok)
            if (.not. ok) return
            power(i, :) = rate
         end do
         do i = 1, n_quadratures
            self%increment(2*m + i) = h*sum(self%stages%rule%b*power(:, i))
            error(i) = h*neglected_of(self%stages, power(:, i))
         end do
         tolerance = self%quadrature_limit(y)
         if (.not. maxval(error) <= tolerance) call compare_halves(self, t)
         if (.not. maxval(error) <= tolerance .and. self%refines) then
            call self%refine_quadratures(t, h, y, tolerance, followed)
            self%refines = followed
         end if
      end associate
   end subroutine add_quadratures

   !> A better estimate where the last coefficients do not fall off, as those of small fast vibrations: the distance to the
   !> same rule on both halves of the step, with its own polynomials. None, if that cannot be evaluated.
   subroutine compare_halves(self, t)
      class(gauss_integrator), intent(inout) :: self
      real(wp), intent(in) :: t !! at the start of the step [s]
      real(wp) :: matrix(s, s)
      real(wp), dimension(n_quadratures) :: both, rate
      logical :: ok
      integer :: half, i

      both = 0.0_wp
      associate (m => self%stages%mechanics%n_dof, h => self%stages%now%h)
         do half = 0, 1
            matrix = self%stages%rule%interpolation(0.5_wp*half, 0.5_wp)
            call multiply(m, matrix, self%stages%trial%q, self%stages%guess)
            call multiply(m, matrix, self%stages%trial%p, self%stages%trial%a) ! which nobody needs any more
            do i = 1, s
               self%node_state(:m) = self%stages%guess(i, :)
               self%node_state(m + 1:) = self%stages%trial%a(i, :)
               call self%system%quadratures(t + h*(0.5_wp*half + 0.5_wp*self%stages%rule%c(i)), self%node_state, rate, ok)
               if (.not. ok) return
               both = both + 0.5_wp*h*self%stages%rule%b(i)*rate
            end do
         end do
         self%quadrature_error = min(self%quadrature_error, abs(both - self%increment(2*m + 1:)))
      end associate
   end subroutine compare_halves

   !> Make the trial the last step, and keep the digits that rounding takes from the state.
   subroutine accept(self, h, t_new)
      class(gauss_integrator), intent(inout) :: self
      real(wp), intent(in) :: h, t_new
      real(wp) :: y_new
      integer :: i

      self%stages%trial%h = h
      call swap_records(self%stages%last, self%stages%trial)
      do i = 1, size(self%y_good)
         self%y_before(i) = self%y_good(i)
         y_new = self%y_good(i) + (self%increment(i) - self%lost(i))
         self%lost(i) = (y_new - self%y_good(i)) - (self%increment(i) - self%lost(i))
         self%y_good(i) = y_new
      end do
      call self%move_time(h, t_new)
      associate (stages => self%stages)
         self%excess = self%excess + real(stages%iterations - self%fewest, wp)
         self%fewest = min(self%fewest, stages%iterations)
         if (stages%iterations < 3) stages%late_rate = memory*stages%late_rate
      end associate
   end subroutine accept

   !> What stands in the way of a step.
   function obstacle(self) result(text)
      class(gauss_integrator), intent(in) :: self
      character(len=:), allocatable :: text
      text = 'the iteration for the stages does not converge, or no step is small enough'
      if (self%stages%refused) text = cannot_evaluate
   end function obstacle

end module rodyn_gauss_integrator
