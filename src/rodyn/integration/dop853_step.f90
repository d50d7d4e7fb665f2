!> One step of the explicit Runge-Kutta method of order 8 of Dormand and Prince, DOP853: Hairer, Norsett & Wanner, Solving
!> ODEs I, sec. II.5 and II.10.
module rodyn_dop853_step
   use rodyn_kinds, only: wp
   use rodyn_ode, only: ode_system
   use rodyn_integrator, only: solver_options, tightened, cannot_evaluate
   use rodyn_dop853_tableau, only: c2, c3, c4, c5, c6, c7, c8, c9, c10, c11, c12, a2_1, a3_1, a3_2, a4_1, &
      a4_3, a5_1, a5_3, a5_4, a6_1, a6_4, a6_5, a7_1, a7_4, a7_5, a7_6, a8_1, a8_4, a8_5, a8_6, a8_7, a9_1, &
      a9_4, a9_5, a9_6, a9_7, a9_8, a10_1, a10_4, a10_5, a10_6, a10_7, a10_8, a10_9, a11_1, a11_4, a11_5, &
      a11_6, a11_7, a11_8, a11_9, a11_10, a12_1, a12_4, a12_5, a12_6, a12_7, a12_8, a12_9, a12_10, a12_11, &
      b1, b6, b7, b8, b9, b10, b11, b12, e5_1, e5_6, e5_7, e5_8, e5_9, e5_10, e5_11, e5_12, e3_1, e3_6, e3_7, &
      e3_8, e3_9, e3_10, e3_11, e3_12
   implicit none (type, external)
   private
   public :: n_stages, inner_options, stages, add_increment, error_norm, quadrature_errors
   public :: safety, shrink, grow, choose_end, trial_step, first_step_length, obstacle

   integer, parameter :: n_stages = 12
   real(wp), parameter :: safety = 0.9_wp, shrink = 1.0_wp/3.0_wp, grow = 6.0_wp !! of the choice of steps (Hairer's)

contains

   !> The tolerances by which steps are judged. Without this one ordinary scene of 500 is some 100 to 250 rtol off.
   pure type(solver_options) function inner_options(options)
      type(solver_options), intent(in) :: options !! the user's
      real(wp), parameter :: shorter = 0.86_wp
      inner_options = tightened(options, shorter, 8)
   end function inner_options

   !> k_2..k_12 from k_1 = f.
   subroutine stages(system, n, t, h, y, f, k, stage, ok)
      class(ode_system), intent(inout) :: system
      integer, intent(in) :: n
      real(wp), intent(in) :: t, h
      real(wp), intent(in) :: y(n), f(n)
      real(wp), intent(inout) :: k(n, n_stages), stage(n)
      logical, intent(out) :: ok

      k(:, 1) = f
      stage = y + h*(a2_1*k(:, 1))
      call system%rhs(t + c2*h, stage, k(:, 2), ok)
      if (.not. ok) return
      stage = y + h*(a3_1*k(:, 1) + a3_2*k(:, 2))
      call system%rhs(t + c3*h, stage, k(:, 3), ok)
      if (.not. ok) return
      stage = y + h*(a4_1*k(:, 1) + a4_3*k(:, 3))
      call system%rhs(t + c4*h, stage, k(:, 4), ok)
      if (.not. ok) return
      stage = y + h*(a5_1*k(:, 1) + a5_3*k(:, 3) + a5_4*k(:, 4))
      call system%rhs(t + c5*h, stage, k(:, 5), ok)
      if (.not. ok) return
      stage = y + h*(a6_1*k(:, 1) + a6_4*k(:, 4) + a6_5*k(:, 5))
      call system%rhs(t + c6*h, stage, k(:, 6), ok)
      if (.not. ok) return
      stage = y + h*(a7_1*k(:, 1) + a7_4*k(:, 4) + a7_5*k(:, 5) + a7_6*k(:, 6))
      call system%rhs(t + c7*h, stage, k(:, 7), ok)
      if (.not. ok) return
      stage = y + h*(a8_1*k(:, 1) + a8_4*k(:, 4) + a8_5*k(:, 5) + a8_6*k(:, 6) + a8_7*k(:, 7))
      call system%rhs(t + c8*h, stage, k(:, 8), ok)
      if (.not. ok) return
      stage = y + h*(a9_1*k(:, 1) + a9_4*k(:, 4) + a9_5*k(:, 5) + a9_6*k(:, 6) + a9_7*k(:, 7) + &
                       a9_8*k(:, 8))
      call system%rhs(t + c9*h, stage, k(:, 9), ok)
      if (.not. ok) return
      stage = y + h*(a10_1*k(:, 1) + a10_4*k(:, 4) + a10_5*k(:, 5) + a10_6*k(:, 6) + a10_7*k(:, 7) + &
                       a10_8*k(:, 8) + a10_9*k(:, 9))
      call system%rhs(t + c10*h, stage, k(:, 10), ok)
      if (.not. ok) return
      stage = y + h*(a11_1*k(:, 1) + a11_4*k(:, 4) + a11_5*k(:, 5) + a11_6*k(:, 6) + a11_7*k(:, 7) + &
                       a11_8*k(:, 8) + a11_9*k(:, 9) + a11_10*k(:, 10))
      call system%rhs(t + c11*h, stage, k(:, 11), ok)
      if (.not. ok) return
      stage = y + h*(a12_1*k(:, 1) + a12_4*k(:, 4) + a12_5*k(:, 5) + a12_6*k(:, 6) + a12_7*k(:, 7) + &
                       a12_8*k(:, 8) + a12_9*k(:, 9) + a12_10*k(:, 10) + a12_11*k(:, 11))
      call system%rhs(t + c12*h, stage, k(:, 12), ok)
      if (.not. ok) return
   end subroutine stages

   !> h sum b_i k_i.
   pure subroutine add_increment(n, h, k, increment)
      integer, intent(in) :: n
      real(wp), intent(in) :: h
      real(wp), intent(in) :: k(n, n_stages)
      real(wp), intent(out) :: increment(n)
      increment = h*(b1*k(:, 1) + b6*k(:, 6) + b7*k(:, 7) + b8*k(:, 8) + b9*k(:, 9) + b10*k(:, 10) + &
                      b11*k(:, 11) + b12*k(:, 12))
   end subroutine add_increment

   !> Root mean square of error/tolerance over the controlled states; Hairer's mix of the two estimates.
   pure real(wp) function error_norm(n, h, k, y, y_new, rtol, atol)
      integer, intent(in) :: n
      real(wp), intent(in) :: h
      real(wp), intent(in) :: k(:, :)
      real(wp), intent(in) :: y(n), y_new(n)
      real(wp), intent(in) :: rtol, atol
      real(wp) :: sum_5, sum_3, weight, e5, e3
      integer :: i

      sum_5 = 0.0_wp
      sum_3 = 0.0_wp
      do i = 1, n
         weight = 1.0_wp/(atol + rtol*max(abs(y(i)), abs(y_new(i))))
         e5 = e5_1*k(i, 1) + e5_6*k(i, 6) + e5_7*k(i, 7) + e5_8*k(i, 8) + e5_9*k(i, 9) + &
               e5_10*k(i, 10) + e5_11*k(i, 11) + e5_12*k(i, 12)
         e3 = e3_1*k(i, 1) + e3_6*k(i, 6) + e3_7*k(i, 7) + e3_8*k(i, 8) + e3_9*k(i, 9) + &
               e3_10*k(i, 10) + e3_11*k(i, 11) + e3_12*k(i, 12)
         sum_5 = sum_5 + (e5*weight)**2
         sum_3 = sum_3 + (e3*weight)**2
      end do
      error_norm = 0.0_wp
      if (sum_5 + sum_3 > 0.0_wp) error_norm = abs(h)*sum_5/sqrt(n*(sum_5 + 0.01_wp*sum_3))
   end function error_norm

   !> The same mix for each quadrature on its own, behind the controlled states.
   pure subroutine quadrature_errors(n, h, k, error)
      integer, intent(in) :: n              !! of the states before them
      real(wp), intent(in) :: h
      real(wp), intent(in) :: k(:, :)       !! (n_states, 12)
      real(wp), intent(inout) :: error(:)   !! (n_states - n)
      real(wp) :: e5, e3
      integer :: i

      do i = n + 1, size(k, 1)
         e5 = e5_1*k(i, 1) + e5_6*k(i, 6) + e5_7*k(i, 7) + e5_8*k(i, 8) + e5_9*k(i, 9) + &
              e5_10*k(i, 10) + e5_11*k(i, 11) + e5_12*k(i, 12)
         e3 = e3_1*k(i, 1) + e3_6*k(i, 6) + e3_7*k(i, 7) + e3_8*k(i, 8) + e3_9*k(i, 9) + &
              e3_10*k(i, 10) + e3_11*k(i, 11) + e3_12*k(i, 12)
         error(i - n) = 0.0_wp
         if (abs(e5) > 0.0_wp) error(i - n) = abs(h*e5)*(abs(e5)/hypot(e5, 0.1_wp*e3))
      end do
   end subroutine quadrature_errors

   !> The step to try and the time it ends at: on the stop time if that is near.
   pure subroutine choose_end(t, t_lost, t_stop, h_next, h, t_new)
      real(wp), intent(in) :: t, t_lost !! now, and what rounding took from it [s]
      real(wp), intent(in) :: t_stop    !! [s]
      real(wp), intent(in) :: h_next    !! step that the error allows [s]
      real(wp), intent(out) :: h, t_new !! [s]

      h = h_next
      t_new = t + (h - t_lost)
      if (t_new < t_stop) then
         if (t + 1.8_wp*h > t_stop) h = 0.5_wp*(t_stop - t) ! two even steps rather than one and a sliver
         if (h < h_next) t_new = t + (h - t_lost)
      else
         t_new = t_stop
         h = t_stop - t
      end if
   end subroutine choose_end

   !> A short step for a look at how rates change (Hairer, Norsett & Wanner, sec. II.4).
   pure real(wp) function trial_step(d0, d1, span)
      real(wp), intent(in) :: d0, d1 !! weighted norms of the state and of its rates
      real(wp), intent(in) :: span   !! to the stop time [s]
      trial_step = 1.0e-6_wp
      if (min(d0, d1) > 1.0e-5_wp) trial_step = 0.01_wp*d0/d1
      trial_step = min(trial_step, span)
   end function trial_step

   !> Length of the first step by that look (sec. II.4).
   pure real(wp) function first_step_length(h0, d1, d2, span)
      real(wp), intent(in) :: h0     !! `trial_step` [s]
      real(wp), intent(in) :: d1, d2 !! weighted norms of the rates and of their change in that step, by its length
      real(wp), intent(in) :: span   !! to the stop time [s]
      real(wp) :: h1
      if (max(d1, d2) <= 1.0e-15_wp) then
         h1 = max(1.0e-6_wp, 1.0e-3_wp*h0)
      else
         h1 = (0.01_wp/max(d1, d2))**0.125_wp
      end if
      first_step_length = min(100.0_wp*h0, h1, span)
   end function first_step_length

   !> What stands in the way of a step.
   pure function obstacle(refused) result(text)
      logical, intent(in) :: refused !! the right-hand side could not be evaluated
      character(len=:), allocatable :: text
      text = 'the right-hand side was not finite, or no step is small enough'
      if (refused) text = cannot_evaluate
   end function obstacle

end module rodyn_dop853_step
