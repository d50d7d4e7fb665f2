!> First guesses for the stages of Gauss collocation: what is smooth of the last step, N = F + u (K v.Q + D v.P), is extrapolated.
module rodyn_gauss_guess
   use rodyn_kinds, only: wp
   use rodyn_lanes, only: s => lanes
   use rodyn_integrator, only: solver_statistics
   use rodyn_lane_algebra, only: apply, multiply, project, expand, square_sums, straight_lines, accumulate, copy
   use rodyn_gauss_stages, only: gauss_stages, step_record
   implicit none (type, external)
   private
   public :: predict, choose_degree, renew_history

   integer, parameter :: degrees(*) = [2, s - 1] !! of the extrapolation

contains

   !> First guess of F: extrapolate what is smooth, N, and solve the stiff modes with it. With Q = q + c h p, P = p the
   !> residual for F = 0 is R = N - sum u stiff, stiff = omega^2 v.Q + damping v.P, and F = R - sum u G R.v.
   subroutine predict(stages, t, y, counts, ok)
      type(gauss_stages), intent(inout) :: stages
      real(wp), intent(in) :: t                !! start of the step [s]
      real(wp), contiguous, intent(in) :: y(:) !! state there
      type(solver_statistics), intent(inout) :: counts
      logical, intent(out) :: ok
      integer :: m, base

      m = stages%mechanics%n_dof
      base = stages%mechanics%n_ignorable
      ok = .true.
      if (.not. stages%has_history) then
         call begin_history(stages, t, y, counts, ok)
         if (.not. ok) return
      end if
      if (abs(stages%now%h_last - stages%last%h) > 0.0_wp) then
         stages%now%h_last = stages%last%h
         stages%now%ahead = stages%rule%interpolation(1.0_wp, stages%now%h/stages%last%h, stages%degree)
      end if
      call multiply(m, stages%now%ahead, stages%last%smooth, stages%trial%smooth)
      associate (modes => stages%modes)
         call project(m - base, modes%n, modes%v, stages%trial%smooth(:, base + 1:), stages%modal)
         call modes%stiff_line(y(base + 1:m), y(m + base + 1:2*m), stages%rest, stages%motion)
         stages%rest(:modes%n) = -stages%rest(:modes%n)
         call straight_lines(modes%n, stages%rest, stages%motion, -stages%now%h, stages%rule%c, stages%stiff)
         call accumulate(modes%n, stages%stiff, stages%modal)
         call stages%now%modal%answer(stages%rule, stages%modes, stages%modal, stages%reply)
         call accumulate(modes%n, stages%stiff, stages%reply)
         call copy(m, stages%trial%smooth, stages%trial%f)
         call expand(m, modes%n, size(modes%u, 1), modes%u, stages%reply, stages%trial%f)
      end associate
   end subroutine predict

   !> Whether the smooth part is better extrapolated with low or full degree, seen from the step just done. What fast vibrations
   !> leave in it is large in all its coefficients, and polynomials of high degree enlarge that outside their step. The measure
   !> is what the error of the guess does to Q, A^2 dN.
   subroutine choose_degree(stages)
      type(gauss_stages), intent(inout) :: stages
      real(wp) :: errors(size(degrees)), sums(s)
      real(wp), dimension(s, s) :: minus_a2, ahead
      integer :: i, m

      m = stages%mechanics%n_dof
      minus_a2 = -stages%rule%a2 ! an expression as an argument would allocate
      do i = 1, size(degrees)
         ahead = stages%rule%interpolation(1.0_wp, stages%now%h/stages%last%h, degrees(i))
         ahead = matmul(stages%rule%a2, ahead)
         call multiply(m, ahead, stages%last%smooth, stages%guess)
         call apply(m, minus_a2, stages%trial%smooth, stages%guess)
         sums = square_sums(m, stages%guess, stages%weight)
         errors(i) = sum(sums)
      end do
      i = minloc(errors, dim=1)
      if (degrees(i) /= stages%degree) stages%now%h_last = 0.0_wp
      stages%degree = degrees(i)
   end subroutine choose_degree

   !> Before the first step: the smooth part is taken to be constant.
   subroutine begin_history(stages, t, y, counts, ok)
      type(gauss_stages), intent(inout) :: stages
      real(wp), intent(in) :: t                !! [s]
      real(wp), contiguous, intent(in) :: y(:) !! state there
      type(solver_statistics), intent(inout) :: counts
      logical, intent(out) :: ok

      associate (m => stages%mechanics%n_dof)
         stages%last%q(:, :) = spread(y(:m), 1, s)
         stages%last%p(:, :) = spread(y(m + 1:2*m), 1, s)
      end associate
      call stages%mechanics%lane_accelerations(spread(t, 1, s), stages%last%q, stages%last%p, stages%last%f, ok)
      stages%refused = .not. ok
      counts%n_rhs = counts%n_rhs + 1
      if (.not. ok) return
      call remove_stiff_part(stages, stages%last)
      stages%last%h = stages%now%h
      stages%has_history = .true.
   end subroutine begin_history

   !> What is smooth of the last step, with other modes.
   subroutine renew_history(stages, known, y_before)
      type(gauss_stages), intent(inout) :: stages
      logical, intent(in) :: known                    !! a step has been accepted, which can be restored
      real(wp), contiguous, intent(in) :: y_before(:) !! state at its start

      stages%has_history = stages%has_history .and. known
      if (.not. stages%has_history) return
      call restore_nodes(stages, y_before, stages%last)
      call remove_stiff_part(stages, stages%last)
   end subroutine renew_history

   !> smooth = F + u (K v.Q + D v.P).
   subroutine remove_stiff_part(stages, record)
      type(gauss_stages), intent(inout) :: stages
      type(step_record), intent(inout) :: record
      associate (base => stages%mechanics%n_ignorable)
         call stages%modes%stiff_rates(record%q(:, base + 1:), record%p(:, base + 1:), stages%modal, stages%reply)
      end associate
      record%smooth(:, :) = record%f
      call expand(stages%mechanics%n_dof, stages%modes%n, size(stages%modes%u, 1), stages%modes%u, stages%modal, record%smooth)
   end subroutine remove_stiff_part

   !> Q and P of the last step, whose last correction `iterate` may have left out.
   subroutine restore_nodes(stages, y_before, record)
      type(gauss_stages), intent(in) :: stages
      real(wp), contiguous, intent(in) :: y_before(:) !! state at its start
      type(step_record), intent(inout) :: record

      associate (m => stages%mechanics%n_dof, base => stages%mechanics%n_ignorable, h => record%h)
         call straight_lines(m, y_before, y_before(m + 1:), h, stages%rule%c, record%q)
         call straight_lines(m, y_before(m + 1:), y_before(m + 1:), 0.0_wp, stages%rule%c, record%p)
         call apply(m - base, h*stages%rule%a, record%f(:, base + 1:), record%p(:, base + 1:))
         call apply(m - base, h**2*stages%rule%a2, record%f(:, base + 1:), record%q(:, base + 1:))
      end associate
   end subroutine restore_nodes

end module rodyn_gauss_guess
