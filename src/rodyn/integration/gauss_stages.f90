!> A step of Gauss collocation, `rodyn_gauss_integrator`: the stage equations with their matrices, their solution for the
!> accelerations at the nodes, F, from a first guess, and the increments that follow from F with estimates of their errors.
module rodyn_gauss_stages
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use rodyn_kinds, only: wp
   use rodyn_lanes, only: s => lanes
   use rodyn_trigonometry, only: sine_cosine
   use rodyn_ode, only: mechanical_system
   use rodyn_stiff_modes, only: stiff_modes
   use rodyn_integrator, only: solver_options, solver_statistics
   use rodyn_lane_algebra, only: add, apply, apply_one, expand, multiply, project, residual, square_sums, straight_lines
   use rodyn_gauss_collocation, only: gauss_collocation, new_gauss_collocation
   use rodyn_modal_reply, only: modal_reply
   implicit none (type, external)
   private
   public :: gauss_stages, step_record, new_gauss_stages, reserve_modes, set_step, set_weights, iterate, nodes_from, &
      form_increment, neglected_of, swap_matrices, swap_records, most_iterations, typical_lambda, wanted_estimate

   integer, parameter :: most_iterations = 15
   real(wp), parameter :: iteration_error = 0.05_wp !! of the tolerance that the iteration may leave
   real(wp), parameter :: typical_lambda = 0.14_wp  !! size of an eigenvalue of A
   real(wp), parameter :: error_constant = 0.5_wp   !! of the error estimate, see `form_increment`
   real(wp), parameter :: regular = 0.25_wp         !! see `neglected`
   real(wp), parameter :: wanted_estimate = 0.05_wp !! of the error, in tolerances
   real(wp), parameter :: wanted_loss = 1.0_wp      !! of positions, in tolerances, see `lost_response`

   ! The numbers of the method, made once: a sweep has thousands of integrators.
   type(gauss_collocation) :: made_rule
   logical :: rule_is_made = .false.

   !> The matrices of one step length.
   type :: step_matrices
      real(wp) :: h = 0.0_wp                 !! step [s]
      real(wp) :: h_a(s, s) = 0.0_wp         !! h A
      real(wp) :: h2_a2(s, s) = 0.0_wp       !! h^2 A^2
      logical :: coupled = .false.           !! dampers couple the modes in such steps
      logical :: damped = .false.            !! dampers are fast in such steps
      type(modal_reply) :: modal             !! (1 + h A D + h^2 A^2 K)^-1 - 1 in modes
      real(wp) :: h_last = 0.0_wp            !! step that `ahead` extrapolates from [s]
      real(wp) :: ahead(s, s) = 0.0_wp       !! node values of that step to those of this one
   end type step_matrices

   !> What is kept of a step.
   type :: step_record
      real(wp), allocatable :: f(:, :)       !! F (s, n_dof)
      real(wp), allocatable :: a(:, :)       !! accelerations of the last evaluation (s, n_dof)
      real(wp), allocatable :: q(:, :), p(:, :) !! at the nodes (s, n_dof)
      real(wp), allocatable :: smooth(:, :)  !! accelerations without the stiff part (s, n_dof)
      real(wp) :: h = 0.0_wp                 !! step [s]
   end type step_record

   type :: gauss_stages
      class(mechanical_system), pointer :: mechanics => null()
      type(gauss_collocation) :: rule
      type(stiff_modes) :: modes
      type(step_matrices), allocatable :: now, spare !! for the step in hand; for steps to outputs
      type(step_record) :: last, trial       !! the last accepted step, the one being tried
      real(wp) :: rtol = 0.0_wp, atol = 0.0_wp
      real(wp), allocatable :: weight(:)     !! 1/tolerance of the rates (n_dof)
      real(wp), allocatable :: modal(:, :), reply(:, :), stiff(:, :) !! workspace (s, modes)
      real(wp), allocatable :: rest(:), motion(:) !! v.q and v.p at the start of a step; workspace (modes)
      real(wp), allocatable :: guess(:, :)   !! workspace (s, n_dof)
      real(wp) :: rate = 0.1_wp              !! contraction of the iteration
      real(wp) :: late_rate = 0.0_wp         !! likewise, from its second correction on; 0: not known
      integer :: iterations = 0              !! of the last step
      integer :: degree = s - 1              !! of the first guess
      logical :: has_history = .false.       !! `last` may be extrapolated
      logical :: refused = .false.           !! the last failure came from the equations
   end type gauss_stages

contains

   !> Stages of `mechanics`, which must outlive them.
   subroutine new_gauss_stages(stages, mechanics, options)
      type(gauss_stages), intent(inout) :: stages
      class(mechanical_system), target, intent(inout) :: mechanics
      type(solver_options), intent(in) :: options

      stages%mechanics => mechanics
      stages%rtol = options%rtol
      stages%atol = options%atol
      if (.not. rule_is_made) call new_gauss_collocation(made_rule)
      rule_is_made = .true.
      stages%rule = made_rule
      allocate (stages%now, stages%spare)
      associate (m => mechanics%n_dof)
         allocate (stages%weight(m), stages%guess(s, m), source=0.0_wp)
         call allocate_record(stages%last, m)
         call allocate_record(stages%trial, m)
      end associate
   end subroutine new_gauss_stages

   subroutine allocate_record(record, m)
      type(step_record), intent(inout) :: record
      integer, intent(in) :: m
      allocate (record%f(s, m), record%a(s, m), record%q(s, m), record%p(s, m), record%smooth(s, m), source=0.0_wp)
   end subroutine allocate_record

   !> Make room for so many modes; matrices of other modes are of no use any more.
   subroutine reserve_modes(stages, most)
      type(gauss_stages), intent(inout) :: stages
      integer, intent(in) :: most

      stages%now%h = 0.0_wp
      stages%spare%h = 0.0_wp
      if (allocated(stages%modal)) then
         if (size(stages%modal, 2) == most) return
         deallocate (stages%modal, stages%reply, stages%stiff, stages%rest, stages%motion)
      end if
      allocate (stages%modal(s, most), stages%reply(s, most), stages%stiff(s, most), stages%rest(most), stages%motion(most))
   end subroutine reserve_modes

   !> Matrices for a step of length h.
   subroutine set_step(stages, h)
      type(gauss_stages), intent(inout) :: stages
      real(wp), intent(in) :: h

      if (.not. abs(h - stages%now%h) > 0.0_wp) return
      stages%now%h = h
      stages%now%h_last = 0.0_wp
      stages%now%h_a = h*stages%rule%a
      stages%now%h2_a2 = h**2*stages%rule%a2
      stages%now%coupled = stages%modes%couples(1.0_wp/(typical_lambda*h))
      stages%now%damped = any(h*stages%modes%damping(:stages%modes%n) > 1.0_wp)
      call stages%now%modal%prepare(stages%rule, stages%modes, h, stages%now%coupled)
   end subroutine set_step

   subroutine set_weights(stages, y)
      type(gauss_stages), intent(inout) :: stages
      real(wp), intent(in) :: y(:)
      associate (m => stages%mechanics%n_dof)
         stages%weight(:) = 1.0_wp/(stages%atol + stages%rtol*abs(y(m + 1:2*m)))
      end associate
   end subroutine set_weights

   !> Solve for F of `trial` from its first guess. Q and P follow, but for the last correction where nobody asks for it.
   !>
   !> What F has beside the stiff part, N = F + u (K v.Q + D v.P), follows from the residuals alone: the
   !> correction that answers R changes N by R, since (1 - G)(1 + h D A + h^2 K A^2) = 1.
   subroutine iterate(stages, t, y, counts, ok)
      type(gauss_stages), intent(inout) :: stages
      real(wp), contiguous, intent(in) :: y(:)
      real(wp), intent(in) :: t
      type(solver_statistics), intent(inout) :: counts
      logical, intent(out) :: ok
      real(wp) :: change, before, times(s), sums(s)
      integer :: j, m, base
      logical :: done

      m = stages%mechanics%n_dof
      base = stages%mechanics%n_ignorable
      before = 0.0_wp
      times = t + stages%now%h*stages%rule%c
      call nodes_from(stages, y)
      do j = 1, most_iterations
         stages%iterations = j
         call stages%mechanics%lane_accelerations(times, stages%trial%q, stages%trial%p, stages%trial%a, ok)
         counts%n_rhs = counts%n_rhs + s
         if (stages%now%coupled) counts%n_coupled = counts%n_coupled + s
         stages%refused = .not. ok
         if (.not. ok) return
         call residual(m, stages%trial%a, stages%trial%f, stages%guess, stages%trial%smooth)
         call project(m - base, stages%modes%n, stages%modes%v, stages%guess(:, base + 1:), stages%modal)
         call stages%now%modal%answer(stages%rule, stages%modes, stages%modal, stages%reply)
         call expand(m, stages%modes%n, size(stages%modes%u, 1), stages%modes%u, stages%reply, stages%guess)
         call add(m, stages%guess, stages%weight, stages%trial%f, sums)
         change = stages%now%h*sqrt(sum(sums)/real(s*m, wp))
         call judge(done)
         if (done) exit
         call move_nodes(stages, stages%guess)
         before = change
      end do
      ok = ok .and. done
      if (.not. ok) return
      if (size(y) > 2*m) then ! the quadratures need all of Q and P
         call move_nodes(stages, stages%guess)
      else
         call apply(base, stages%now%h_a, stages%guess, stages%trial%p)
      end if

   contains

      !> Whether this correction was the last one; not `ok`: the iteration diverges. The first contraction is that of what was
      !> most wrong with the guess, mostly in stiff modes, which contract fast; the rest, hidden below, may contract a hundred
      !> times slower, as later corrections show, if not of this step, of those before.
      subroutine judge(done)
         logical, intent(out) :: done
         done = .true.
         ok = ieee_is_finite(change)
         if (.not. ok) return
         if (j > 1) then
            if (change > 0.5_wp*before) then ! no progress: at the level of rounding, or divergence
               ok = change <= max(0.1_wp, rounding(stages, y))
               if (ok .or. (j > 4 .and. change > 2.0_wp*before)) return
               ok = .true.
            end if
            stages%rate = min(1.0_wp, max(1.0e-4_wp, change/before))
            if (j > 2) stages%late_rate = stages%rate
         end if
         done = max(stages%rate, stages%late_rate)*change <= iteration_error
      end subroutine judge

   end subroutine iterate

   !> What rounding leaves of a correction, in tolerances: that of F, and that of Q, which F must balance.
   real(wp) function rounding(stages, y)
      type(gauss_stages), intent(in) :: stages
      real(wp), intent(in) :: y(:)
      associate (m => stages%mechanics%n_dof, h => stages%now%h)
         rounding = 64.0_wp*epsilon(1.0_wp)*(h*weighted_norm(stages%trial%f, stages%weight) + &
                                             norm2(y(:m)*stages%weight)/(h*sqrt(real(m, wp))))
      end associate
   end function rounding

   !> P = p + h A F,  Q = q + c h p + h^2 A^2 F.
   subroutine nodes_from(stages, y)
      type(gauss_stages), intent(inout) :: stages
      real(wp), contiguous, intent(in) :: y(:)
      integer :: m

      m = stages%mechanics%n_dof
      call straight_lines(m, y, y(m + 1:), stages%now%h, stages%rule%c, stages%trial%q)
      call straight_lines(m, y(m + 1:), y(m + 1:), 0.0_wp, stages%rule%c, stages%trial%p)
      call move_nodes(stages, stages%trial%f)
   end subroutine nodes_from

   !> P = P + h A dF, Q = Q + h^2 A^2 dF; ignorable coordinates are not followed.
   subroutine move_nodes(stages, df)
      type(gauss_stages), intent(inout) :: stages
      real(wp), contiguous, intent(in) :: df(:, :)
      associate (m => stages%mechanics%n_dof, base => stages%mechanics%n_ignorable)
         call apply(m, stages%now%h_a, df, stages%trial%p)
         call apply(m - base, stages%now%h2_a2, df(:, base + 1:), stages%trial%q(:, base + 1:))
      end associate
   end subroutine move_nodes

   !> Root mean square of weighted values over nodes and unknowns.
   pure real(wp) function weighted_norm(x, weight)
      real(wp), contiguous, intent(in) :: x(:, :) !! (s, n_dof)
      real(wp), intent(in) :: weight(:)
      weighted_norm = sqrt(sum(square_sums(size(weight), x, weight))/real(size(x), wp))
   end function weighted_norm

   !> Increment of q and p over the step; and an estimate of its error in units of the tolerance.
   !>
   !> F is a polynomial with Legendre coefficients C_0..C_7; the increments are h C_0 and h p + h^2 (C_0/2 - C_1/6).
   !> A vibration of frequency omega has C_k ~ (h omega)^k, and its error over the step is ~ (h omega)^17: about what the mean of F
   !> neglects.
   subroutine form_increment(stages, y, increment, estimate)
      type(gauss_stages), intent(inout) :: stages
      real(wp), contiguous, intent(in) :: y(:)            !! at the start of the step
      real(wp), contiguous, intent(inout) :: increment(:) !! (n_states); quadratures are left alone
      real(wp), intent(out), optional :: estimate
      real(wp) :: sums(s)
      integer :: j, m

      m = stages%mechanics%n_dof
      call multiply(m, stages%rule%coefficients, stages%trial%f, stages%guess) ! one polynomial to a lane
      sums = square_sums(m, stages%guess, stages%weight)
      associate (h => stages%now%h)
         do j = 1, m
            increment(m + j) = h*stages%guess(1, j)
            increment(j) = h*(y(m + j) + h*(0.5_wp*stages%guess(1, j) - stages%guess(2, j)/6.0_wp))
         end do
      end associate
      if (stages%mechanics%n_ignorable == 3) call turn_displacement(stages, y, increment)
      if (.not. present(estimate)) return
      estimate = error_constant*stages%now%h*neglected(sums)/sqrt(real(m, wp))
      if (stages%now%damped) estimate = max(estimate, wanted_estimate*(loss(stages, y)/wanted_loss)**(17.0_wp/s))
   end subroutine form_increment

   !> `lost_response` of the step: the estimate above knows nothing of it.
   real(wp) function loss(stages, y)
      type(gauss_stages), intent(inout) :: stages
      real(wp), intent(in) :: y(:)
      integer :: i, j

      associate (m => stages%mechanics%n_dof, base => stages%mechanics%n_ignorable, modes => stages%modes)
         call multiply(m, stages%rule%coefficients, stages%trial%smooth, stages%guess)
         call project(m - base, modes%n, modes%v, stages%guess(:, base + 1:), stages%modal)
         stages%rest(:modes%n) = 0.0_wp
         do j = 1, m
            do i = 1, modes%n
               stages%rest(i) = stages%rest(i) + (modes%u(i, j)/(stages%atol + stages%rtol*abs(y(j))))**2
            end do
         end do
         stages%rest(:modes%n) = sqrt(stages%rest(:modes%n)/m)
         loss = modes%lost_response(stages%now%h, stages%modal, stages%rest)
      end associate
   end function loss

   !> Displacement of C along axes that turn. As a complex number u' = V - i w u, so with theta the turn since the start
   !> of the step, u exp(i theta) = u_0 + integral of V exp(i theta).
   subroutine turn_displacement(stages, y, increment)
      type(gauss_stages), intent(in) :: stages
      real(wp), intent(in) :: y(:)
      real(wp), intent(inout) :: increment(:)
      real(wp), dimension(s + 1) :: theta, sine, cosine !! at the nodes; half the turn of the step
      real(wp) :: x, v, cos_end, sin_end

      associate (p => stages%trial%p, h => stages%now%h, b => stages%rule%b)
         theta(:s) = 0.0_wp
         call apply_one(stages%now%h_a, p(:, 3), theta(:s))
         theta(s + 1) = 0.5_wp*increment(3)
         call sine_cosine(s + 1, theta, sine, cosine)
         x = h*sum(b*(p(:, 1)*cosine(:s) - p(:, 2)*sine(:s)))
         v = h*sum(b*(p(:, 1)*sine(:s) + p(:, 2)*cosine(:s)))
         cos_end = -2.0_wp*sine(s + 1)**2 ! cos(theta) - 1 at the end
         sin_end = 2.0_wp*sine(s + 1)*cosine(s + 1)
         increment(1) = x + ((y(1) + x)*cos_end + (y(2) + v)*sin_end)
         increment(2) = v + ((y(2) + v)*cos_end - (y(1) + x)*sin_end)
      end associate
   end subroutine turn_displacement

   !> What the rule neglects of the mean of a function, the part of degree 16. The last Legendre coefficients are those of the
   !> fastest vibration that matters; how fast it is shows in how they fall off:
   !>     |C_16| ~ |C_7, C_6| (|C_7, C_6|/|C_5, C_4|)^4.5.
   !> Those of a vibration fall off faster and faster, |C_7, C_6|/|C_5, C_4| being 0.35 to 0.44 of |C_5, C_4|/|C_3, C_2|. If it is
   !> less than a quarter, they are small by chance, and a quarter is taken.
   pure real(wp) function neglected(square)
      real(wp), intent(in) :: square(s) !! of the coefficients of P_0..P_7
      real(wp) :: high, low, least, ratio ! of squares

      high = square(8) + square(7)
      low = square(6) + square(5)
      least = regular**2*fall_off(low, square(4) + square(3))
      ratio = max(fall_off(high, low), least)
      neglected = sqrt(max(high, least*low))*ratio**2*sqrt(sqrt(ratio))
   end function neglected

   !> The same by values of the function at the nodes.
   pure real(wp) function neglected_of(stages, values)
      type(gauss_stages), intent(in) :: stages
      real(wp), intent(in) :: values(s)
      neglected_of = neglected(matmul(stages%rule%coefficients, values)**2)
   end function neglected_of

   pure real(wp) function fall_off(high, low)
      real(wp), intent(in) :: high, low
      fall_off = 1.0_wp
      if (high < low) fall_off = high/low
   end function fall_off

   subroutine swap_matrices(a, b)
      type(step_matrices), allocatable, intent(inout) :: a, b
      type(step_matrices), allocatable :: c
      call move_alloc(a, c)
      call move_alloc(b, a)
      call move_alloc(c, b)
   end subroutine swap_matrices

   subroutine swap_records(a, b)
      type(step_record), intent(inout) :: a, b
      real(wp) :: h
      call swap(a%f, b%f)
      call swap(a%a, b%a)
      call swap(a%q, b%q)
      call swap(a%p, b%p)
      call swap(a%smooth, b%smooth)
      h = a%h
      a%h = b%h
      b%h = h
   end subroutine swap_records

   subroutine swap(a, b)
      real(wp), allocatable, intent(inout) :: a(:, :), b(:, :)
      real(wp), allocatable :: c(:, :)
      call move_alloc(a, c)
      call move_alloc(b, a)
      call move_alloc(c, b)
   end subroutine swap

end module rodyn_gauss_stages
