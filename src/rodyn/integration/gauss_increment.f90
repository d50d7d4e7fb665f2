!> Increments over a step of Gauss collocation from the accelerations at its nodes, and estimates of their errors.
!>
!> F is a polynomial with Legendre coefficients C_0..C_7; the increments are h C_0 and h p + h^2 (C_0/2 - C_1/6).
!> A vibration of frequency omega has C_k ~ (h omega)^k, and its error over the step is ~ (h omega)^17: about what the mean of F
!> neglects.
module rodyn_gauss_increment
   use rodyn_kinds, only: wp
   use rodyn_lanes, only: s => lanes
   use rodyn_trigonometry, only: sine_cosine
   use rodyn_lane_algebra, only: apply_one, multiply, project, square_sums
   use rodyn_gauss_stages, only: gauss_stages
   implicit none (type, external)
   private
   public :: form_increment, neglected_of, wanted_estimate

   real(wp), parameter :: error_constant = 0.5_wp   !! of the error estimate, see `form_increment`
   real(wp), parameter :: regular = 0.25_wp         !! see `neglected`
   real(wp), parameter :: wanted_estimate = 0.05_wp !! of the error, in tolerances
   real(wp), parameter :: wanted_loss = 1.0_wp      !! of positions, in tolerances, see `lost_response`

contains

   !> Increment of q and p over the step; and an estimate of its error in units of the tolerance.
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

end module rodyn_gauss_increment
