!> Which integrator fits a scene, and why: the rule behind `method = 'auto'`.
!>
!> The measure is the time to the end of the run at the user's tolerances, by which all methods bring the chord angles to some
!> ten times rtol or better (docs/performance.md, "Large and stiff"). Vibrations that the tolerances resolve must be followed
!> by any method, and the cheapest steps win: collocation of order 16 for short chains, else explicit steps of order 8. Long
!> chains with strong dampers, or rods so stiff that their vibrations drown in the tolerances, call for BDF. How much of a fast
!> vibration is excited depends on loads and initial values, so where the fastest rates are far above those of the chain of rods,
!> the methods are tried on the beginning of the run.
module rodyn_method_choice
   use rodyn_kinds, only: wp
   use rodyn_text, only: to_text, formatted, time_text
   use rodyn_motion, only: motion_type
   use rodyn_fastest_rates, only: fastest_rates, with_rigid_rods
   use rodyn_integrator, only: monitor_type, solver_options
   use rodyn_method_costs, only: candidates, collocation, effort_of_output, expected_efforts, expected_steps, explicit, &
      fast_rates, n_even, vibrating
   use rodyn_method_numbers, only: even_lead, lead, lead_over_events, mostly_damped, short_run, stiff_damped_from, stiff_from, &
      stiff_power
   use rodyn_method_trial, only: trial_type, try_methods
   implicit none (type, external)
   private
   public :: method_choice, choose_method, named_method

   type :: method_choice
      character(len=:), allocatable :: method !! name of an integrator
      integer :: candidate = 0                !! of `auto`
      type(solver_options) :: options         !! the user's, with the order that was chosen
      logical :: automatic = .false.          !! `auto` chose
      logical :: tried = .false.              !! after a trial
      logical :: conclusive = .true.          !! otherwise the trial was too short, and this is what is safe
      real(wp) :: effort = 0.0_wp             !! of the trial
      real(wp) :: pace = 0.0_wp               !! of the best even method, expected: time for an effort of 1 [s]
      type(fast_rates) :: rates               !! of the scene
      real(wp) :: steps = 0.0_wp              !! forecast
      real(wp) :: advantage = 1.0_wp          !! over explicit steps, by the trial
   contains
      procedure :: reason
   end type method_choice

contains

   !> The method that fits a motion from t on, among those that are not out.
   subroutine choose_method(choice, options, motion, y, t, t_end, n_outputs, out, most_trial, monitor)
      type(method_choice), intent(out) :: choice
      type(solver_options), intent(in) :: options !! of the user
      type(motion_type), target, intent(in) :: motion !! in the regime that begins or goes on at t
      real(wp), intent(in) :: y(:)     !! state at t, without quadratures
      real(wp), intent(in) :: t, t_end !! until when it shall serve [s]
      integer, intent(in) :: n_outputs !! states between steps that are wanted meanwhile
      logical, intent(in) :: out(size(candidates)) !! methods that are of no use
      real(wp), intent(in) :: most_trial !! effort that a trial may cost
      class(monitor_type), target, intent(inout), optional :: monitor !! of the run; what is chosen after a stop is of no use
      real(wp) :: span, ratio, wanted, expected(n_even), forecast(size(candidates)), outputs(size(candidates))
      type(trial_type) :: trial
      logical :: available(n_even)
      integer :: best, i

      choice%options = options
      choice%automatic = .true.
      call take(choice, explicit)
      span = t_end - t
      available = [.not. out(explicit), .not. out(collocation) .and. motion%has_lanes()]
      associate (scene => motion%dynamics%scene, rates => choice%rates)
         call fastest_rates(scene, motion%dynamics%hinges, y(:scene%n_q), rates%frequency, rates%decay)
         choice%steps = expected_steps(explicit, options, rates, span)
         ratio = 1.0_wp
         outputs = [(n_outputs*effort_of_output(candidates(i)%method, motion%dynamics), i=1, size(candidates))]
         expected = expected_efforts(motion%dynamics, options, rates, ratio, span, available)
         if (minval(expected + outputs(:n_even)) >= short_run) then
            rates%slow = rates%frequency
            if (scene%dynamic_bending) call fastest_rates(with_rigid_rods(scene), motion%dynamics%hinges, &
                                                          y(:scene%n_base + scene%n + scene%n_q - scene%n_dof), rates%slow)
            if (rates%slow > 0.0_wp) ratio = max(rates%frequency, rates%decay)/rates%slow
            expected = expected_efforts(motion%dynamics, options, rates, ratio, span, available)
         end if
         best = minloc(expected + outputs(:n_even), dim=1)
         if (needs_no_trial(any(available), expected(best), outputs(best), ratio, options%rtol, rates)) then
            expected = expected + outputs(:n_even)
            if (expected(explicit)/merge(1.0_wp, even_lead, vibrating(rates, span) < 1.0_wp) <= expected(collocation)) return
            call take(choice, collocation)
            choice%steps = expected_steps(collocation, options, rates, span)
            return
         end if
      end associate
      call describe(trial)
      call try_methods(trial, most_trial, choice%effort)
      choice%conclusive = trial%conclusive
      forecast = trial%forecast
      if (.not. choice%conclusive) return
      choice%pace = span/minval(forecast(:n_even))
      wanted = merge(lead_over_events, lead, motion%events%watches)
      forecast = forecast + outputs
      forecast(:n_even) = forecast(:n_even)/wanted
      best = minloc(forecast, dim=1)
      choice%tried = .true.
      call take(choice, best)
      choice%advantage = min(forecast(explicit)*wanted/forecast(best), 1.0e9_wp)

   contains

      subroutine describe(trial)
         type(trial_type), intent(inout) :: trial
         trial%motion => motion
         trial%y = y
         trial%options = options
         trial%t = t
         trial%t_first = minval([t_end, pack(motion%switches, motion%switches > t)])
         trial%t_end = t_end
         trial%rates = choice%rates
         trial%expected = expected
         trial%quiet_after = vibrating(choice%rates, span)*span
         trial%out = out
         if (present(monitor)) trial%monitor => monitor
      end subroutine describe

   end subroutine choose_method

   !> Choose a candidate.
   pure subroutine take(choice, candidate)
      type(method_choice), intent(inout) :: choice
      integer, intent(in) :: candidate
      choice%candidate = candidate
      choice%method = trim(candidates(candidate)%method)
      choice%options%order = candidates(candidate)%order
   end subroutine take

   !> The method that the case names.
   function named_method(method, options) result(choice)
      character(len=*), intent(in) :: method
      type(solver_options), intent(in) :: options
      type(method_choice) :: choice
      choice%method = method
      choice%options = options
   end function named_method

   !> Why this method, in words.
   function reason(self) result(text)
      class(method_choice), intent(in) :: self
      character(len=:), allocatable :: text

      text = 'chosen by the case'
      if (.not. self%automatic) return
      text = 'auto: no vibrations'
      if (self%rates%frequency > 0.0_wp) text = 'auto: frequencies to '//short(self%rates%frequency)//' rad/s'
      if (self%rates%decay > 0.0_wp) text = text//', dampers to '//short(self%rates%decay)//' 1/s'
      if (self%candidate == explicit) then
         text = text//': explicit, order 8, about '//whole(self%steps)//' steps'
      else if (self%candidate == collocation) then
         text = text//': collocation, order 16, '
         if (self%tried) text = text//'in a trial the fastest'
         if (.not. self%tried) text = text//'about '//whole(self%steps)//' steps'
      else
         text = text//': stiff, implicit, '
         if (self%options%order > 0) text = text//'order '//whole(real(self%options%order, wp))//', '
         text = text//'in a trial '//short(self%advantage)//' times as fast as explicit'
      end if
   end function reason

   !> Is the run short, or are steps that follow all vibrations the best for certain?
   pure logical function needs_no_trial(available, expected, output, ratio, rtol, rates)
      logical, intent(in) :: available    !! a method that follows vibrations
      real(wp), intent(in) :: expected    !! effort of the best of them, maybe huge
      real(wp), intent(in) :: output      !! and that of its outputs
      real(wp), intent(in) :: ratio       !! of the fastest rate to the chain's
      real(wp), intent(in) :: rtol
      type(fast_rates), intent(in) :: rates
      needs_no_trial = .false.
      if (.not. available) return
      needs_no_trial = expected + output < short_run .or. .not. rates%slow > 0.0_wp
      if (needs_no_trial) return
      needs_no_trial = ratio*(1.0_wp + output/expected) < stiff_ratio(rtol, rates)
   end function needs_no_trial

   !> Ratio of the fastest rate to the highest frequency of the chain from where implicit steps may pay. They need not follow
   !> vibrations below the tolerance, but the motion of the chain, with steps that shrink as the tolerance does.
   pure real(wp) function stiff_ratio(rtol, rates)
      real(wp), intent(in) :: rtol
      type(fast_rates), intent(in) :: rates
      stiff_ratio = merge(stiff_damped_from, stiff_from, rates%decay > mostly_damped*rates%frequency) &
                    *(1.0e-3_wp/rtol)**stiff_power
   end function stiff_ratio

   !> Three digits.
   function short(value) result(text)
      real(wp), intent(in) :: value
      character(len=:), allocatable :: text
      if (value >= 1.0e-3_wp .and. value < 1.0e6_wp) then
         text = time_text(real(nint(value*10.0_wp**(2 - floor(log10(value)))), wp)*10.0_wp**(floor(log10(value)) - 2))
      else
         text = formatted(value, '(es8.2)')
      end if
   end function short

   !> A whole number, 3e9 and more as a power of ten.
   function whole(value) result(text)
      real(wp), intent(in) :: value
      character(len=:), allocatable :: text
      if (value < 1.0e9_wp) then
         text = to_text(max(1, nint(value)))
      else
         text = formatted(value, '(es8.1)')
      end if
   end function whole

end module rodyn_method_choice
