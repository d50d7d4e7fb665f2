!> Which integrator fits a scene, and why: the rule behind `method = 'auto'`.
!>
!> The scene's spectrum decides. Lightly damped vibrations must be followed by any method that is to be accurate,
!> so the cheapest steps win: the explicit method of order 8 (docs/performance.md). Dampers so strong that they
!> alone bound an explicit step far below what the vibrations need call for BDF, while the chain is short enough
!> for a dense Jacobian.
module rodyn_method_choice
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type
   use rodyn_case_config, only: solver_config
   use rodyn_scene, only: scene_type
   use rodyn_frequencies, only: natural_frequencies, decay_rates
   use rodyn_integrator, only: time_text
   implicit none (type, external)
   private
   public :: method_choice, choose_method

   type :: method_choice
      character(len=:), allocatable :: method !! 'adams', 'bdf', 'erk' or 'dop853'
      character(len=:), allocatable :: reason !! in words
   end type method_choice

   integer, parameter :: most_dof = 600            !! beyond, eigenvalues would cost more than they tell
   integer, parameter :: most_dof_bdf = 300        !! beyond, a dense Jacobian costs more than small steps
   real(wp), parameter :: stiff_ratio = 20.0_wp    !! decay rate over highest frequency from where BDF is cheaper
   real(wp), parameter :: stability_limit = 6.0_wp !! step times frequency (decay rate) that order 8 bears

contains

   !> The user's method, or the one that fits.
   subroutine choose_method(choice, solver, scene, q, t_end)
      type(method_choice), intent(out) :: choice
      type(solver_config), intent(in) :: solver
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: q(:)  !! initial coordinates (dof)
      real(wp), intent(in) :: t_end !! [s]
      type(error_type), allocatable :: unknown
      real(wp), allocatable :: frequency(:), decay(:)
      real(wp) :: lowest, highest, fastest

      choice%method = trim(solver%method)
      choice%reason = 'chosen by the case'
      if (solver%method /= 'auto') return
      choice%method = 'dop853'
      if (scene%n_dof > most_dof) then
         choice%reason = 'auto: explicit, order 8 (too many unknowns for a look at the frequencies)'
         return
      end if
      call natural_frequencies(scene, q, frequency, unknown)
      if (allocated(unknown)) then
         choice%reason = 'auto: explicit, order 8 ('//unknown%message//')'
         return
      end if
      highest = maxval(frequency)
      lowest = minval(frequency, mask=frequency > 1.0e-6_wp*highest)
      fastest = 0.0_wp
      if (scene%hinges%has_damping) then
         call decay_rates(scene, q, decay, unknown)
         if (.not. allocated(unknown)) fastest = max(maxval(decay), scene%hinges%fastest_relaxation())
      end if
      choice%reason = 'auto: frequencies '//short(lowest)//' to '//short(highest)//' rad/s'
      if (.not. highest > 0.0_wp) choice%reason = 'auto: no vibrations'
      if (fastest > 0.0_wp) choice%reason = choice%reason//', dampers to '//short(fastest)//' 1/s'
      if (fastest > stiff_ratio*highest .and. scene%n_dof <= most_dof_bdf) then
         choice%method = 'bdf'
         choice%reason = choice%reason//': stiff dampers, implicit'
      else
         choice%reason = choice%reason//': explicit, order 8, at least '// &
                         whole(t_end*max(highest, fastest)/stability_limit)//' steps'
      end if
   end subroutine choose_method

   !> Three digits.
   function short(value) result(text)
      real(wp), intent(in) :: value
      character(len=:), allocatable :: text
      character(len=16) :: digits
      if (value >= 1.0e-3_wp .and. value < 1.0e6_wp) then
         write (digits, '(g0.4)') value
         text = time_text(real(nint(value*10.0_wp**(2 - floor(log10(value)))), wp)*10.0_wp**(floor(log10(value)) - 2))
      else
         write (digits, '(es8.2)') value
         text = trim(adjustl(digits))
      end if
   end function short

   !> A whole number, 3e9 and more as a power of ten.
   function whole(value) result(text)
      real(wp), intent(in) :: value
      character(len=:), allocatable :: text
      character(len=16) :: digits
      if (value < 1.0e9_wp) then
         write (digits, '(i0)') max(1, nint(value))
      else
         write (digits, '(es8.1)') value
      end if
      text = trim(adjustl(digits))
   end function whole

end module rodyn_method_choice
