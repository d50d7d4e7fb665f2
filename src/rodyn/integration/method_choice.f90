!> Which integrator fits a scene, and why: the rule behind `method = 'auto'`.
!>
!> The measure is the time to the end of the run at the user's tolerances, by which all methods bring the chord angles to some
!> ten times rtol or better (docs/performance.md, "Large and stiff"). Vibrations that the tolerances resolve must be followed
!> by any method, and the cheapest steps win: collocation of order 16 for short chains, else explicit steps of order 8. Strong
!> dampers, or rods so stiff that their vibrations drown in the tolerances, call for BDF. How much of a fast vibration is
!> excited depends on loads and initial values, so where the fastest rates are far above those of the chain of rods, the
!> methods are tried on the beginning of the run.
module rodyn_method_choice
   use rodyn_kinds, only: wp
   use rodyn_text, only: to_text, formatted
   use rodyn_case_config, only: none_given, solver_config
   use rodyn_scene, only: scene_type
   use rodyn_fastest_rates, only: fastest_rates, with_rigid_rods
   use rodyn_integrator, only: monitor_type, solver_options, time_text
   use rodyn_method_trial, only: candidates, n_even, effort_of_nodes, try_methods
   implicit none (type, external)
   private
   public :: method_choice, choose_method

   type :: method_choice
      character(len=:), allocatable :: method !! name of an integrator
      type(solver_options) :: options         !! the user's, with the order that was chosen
      logical :: automatic = .false.          !! `auto` chose
      logical :: tried = .false.              !! after a trial
      real(wp) :: effort = 0.0_wp             !! of the trial, in right-hand sides
      real(wp) :: frequency = 0.0_wp          !! highest natural frequency [rad/s]
      real(wp) :: decay = 0.0_wp              !! fastest decay [1/s]
      real(wp) :: steps = 0.0_wp              !! forecast
      real(wp) :: advantage = 1.0_wp          !! over explicit steps, by the trial
   contains
      procedure :: reason
   end type method_choice

   real(wp), parameter :: vibration_limit = 3.0_wp !! step times frequency that order 8 takes
   real(wp), parameter :: stability_limit = 6.0_wp !! step times decay rate that it bears
   real(wp), parameter :: stages = 12.0_wp         !! right-hand sides of its step
   real(wp), parameter :: iterations = 4.0_wp      !! of a collocation step
   real(wp), parameter :: first_search = 20.0_wp   !! right-hand sides per unknown that its first modes cost
   real(wp), parameter :: long_run = 5000.0_wp     !! right-hand sides of an explicit run that are worth a trial
   real(wp), parameter :: stiff_ratio = 200.0_wp   !! fastest rate over the chain's frequencies from where implicit steps may pay
   real(wp), parameter :: trial_share = 0.5_wp     !! of a run that follows all vibrations, spent on one candidate at most
   real(wp), parameter :: lead = 1.1_wp            !! by which an implicit method must be faster: it is less accurate

contains

   !> The user's method, or the one that fits.
   subroutine choose_method(choice, solver, options, scene, y, t_end, monitor)
      type(method_choice), intent(out) :: choice
      type(solver_config), intent(in) :: solver
      type(solver_options), intent(in) :: options !! of the user
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: y(:)  !! state at t = 0, without quadratures
      real(wp), intent(in) :: t_end !! [s]
      class(monitor_type), target, intent(inout), optional :: monitor !! of the run; what is chosen after a stop is of no use
      real(wp) :: slow, explicit, expected(n_even), forecast(size(candidates))
      integer :: best

      choice%method = trim(solver%method)
      choice%options = options
      choice%automatic = solver%method == 'auto'
      if (.not. choice%automatic) return
      choice%method = 'dop853'
      call fastest_rates(scene, y(:scene%n_q), choice%frequency, choice%decay)
      explicit = stages*t_end*max(choice%frequency/vibration_limit, choice%decay/stability_limit)
      choice%steps = explicit/stages
      expected = expected_efforts(scene, options, choice%frequency, choice%decay, t_end)
      ! Latching excites all vibrations of the rods, which a trial on the beginning of the run does not see.
      if (scene%dynamic_bending .and. any(scene%hinges%mechanisms%latch < none_given)) return
      slow = 0.0_wp
      if (explicit >= long_run) &
         call fastest_rates(with_rigid_rods(scene), y(:scene%n_base + scene%n + scene%n_q - scene%n_dof), slow)
      if (explicit < long_run .or. max(choice%frequency, choice%decay) < stiff_ratio*slow) then
         if (expected(1) <= expected(2)) return
         choice%method = 'gauss'
         choice%steps = t_end*choice%frequency/collocation_phase(options%rtol)
         return
      end if
      call try_methods(scene, y, options, minval([t_end, scene%switches]), t_end, &
                       expected, trial_share, forecast, choice%effort, monitor)
      forecast(:2) = forecast(:2)/lead ! dop853, gauss
      best = minloc(forecast, dim=1)
      choice%tried = .true.
      choice%method = trim(candidates(best)%method)
      choice%options%order = candidates(best)%order
      choice%advantage = min(forecast(1)*lead/forecast(best), 1.0e9_wp)
   end subroutine choose_method

   !> Why this method, in words.
   function reason(self) result(text)
      class(method_choice), intent(in) :: self
      character(len=:), allocatable :: text

      text = 'chosen by the case'
      if (.not. self%automatic) return
      text = 'auto: no vibrations'
      if (self%frequency > 0.0_wp) text = 'auto: frequencies to '//short(self%frequency)//' rad/s'
      if (self%decay > 0.0_wp) text = text//', dampers to '//short(self%decay)//' 1/s'
      if (self%method == 'dop853') then
         text = text//': explicit, order 8, about '//whole(self%steps)//' steps'
      else if (self%method == 'gauss') then
         text = text//': collocation, order 16, '
         if (self%tried) text = text//'in a trial the fastest'
         if (.not. self%tried) text = text//'about '//whole(self%steps)//' steps'
      else
         text = text//': stiff, implicit, '
         if (self%options%order > 0) text = text//'order '//whole(real(self%options%order, wp))//', '
         text = text//'in a trial '//short(self%advantage)//' times as fast as explicit'
      end if
   end function reason

   !> Efforts of explicit steps of order 8 and of collocation, by what a unit of phase of the fastest vibration costs at the
   !> user's tolerance. The phases of their steps are those of table 1 (docs/performance.md); they change little from scene
   !> to scene. Collocation is out of the question (huge) where it has no lanes or hinges have events, or where dampers are
   !> faster than vibrations.
   function expected_efforts(scene, options, frequency, decay, t_end) result(effort)
      type(scene_type), intent(in) :: scene
      type(solver_options), intent(in) :: options
      real(wp), intent(in) :: frequency, decay, t_end
      real(wp) :: effort(n_even)
      real(wp) :: explicit_phase, radians

      radians = frequency*t_end
      explicit_phase = vibration_limit*min(1.0_wp, (1.0e4_wp*options%rtol)**0.125_wp)
      effort(1) = (stages + 1.0_wp)*max(radians/explicit_phase, decay*t_end/stability_limit)
      effort(2) = huge(1.0_wp)
      if (scene%assembled .or. scene%n_q > scene%n_dof .or. decay > frequency .or. size(scene%hinges%mechanisms) > 0) return
      effort(2) = first_search*scene%n_dof + iterations*effort_of_nodes(scene)*radians/collocation_phase(options%rtol)
   end function expected_efforts

   !> Phase of the fastest vibration in a collocation step.
   pure real(wp) function collocation_phase(rtol)
      real(wp), intent(in) :: rtol
      collocation_phase = 9.0_wp*min(1.0_wp, (1.0e4_wp*rtol)**0.0625_wp)
   end function collocation_phase

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
