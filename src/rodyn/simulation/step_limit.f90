!> Fixed steps of explicit methods that cannot be stable are refused before the first of them.
!>
!> A vibration or decay lambda of the scene is multiplied by R(h lambda) in a step (`rodyn_stability_function`). Some methods
!> amplify vibrations a little at any step, and are of use nevertheless; so what counts is the run: a step is beyond the limit if
!> the method amplifies some motion by more than `most_growth` between the start and the end, apart from what the motion
!> grows by itself. The eigenvalues are those of the initial state.
module rodyn_step_limit
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type, raise, exit_bad_input
   use rodyn_text, only: time_text
   use rodyn_scene, only: scene_type
   use rodyn_switch_times, only: interval_ends
   use rodyn_integrator, only: solver_options
   use rodyn_stability_function, only: stability_function, stability_function_of
   use rodyn_fast_eigenvalues, only: fast_eigenvalues
   implicit none (type, external)
   private
   public :: check_fixed_step, growth_in_run, largest_stable_step

   real(wp), parameter :: most_growth = 1000.0_wp

contains

   !> Refuse a fixed step that is beyond the limit of its method. Nothing is looked at without one.
   subroutine check_fixed_step(method, options, scene, switches, y, t_end, error)
      character(len=*), intent(in) :: method
      type(solver_options), intent(in) :: options
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: switches(:) !! of the motion, increasing [s]
      real(wp), contiguous, intent(in) :: y(:) !! state at t = 0
      real(wp), intent(in) :: t_end !! [s]
      type(error_type), allocatable, intent(out) :: error !! exit code 2
      type(stability_function) :: r
      complex(wp), allocatable :: lambda(:, :)
      real(wp), allocatable :: growth(:)
      real(wp) :: step

      if (.not. options%fixed_step > 0.0_wp .or. options%allow_unstable) return
      call stability_function_of(r, method, options%order, error)
      if (allocated(error) .or. .not. allocated(r%coefficient)) return
      call fast_eigenvalues(scene, y, t_end, lambda)
      step = longest_step(switches, options%fixed_step, t_end)
      allocate (growth(size(lambda, 2)))
      growth = growth_in_run(r, lambda, step, t_end)
      if (all(growth <= log(most_growth))) return
      associate (limit => largest_stable_step(r, lambda, step, t_end), fastest => lambda(1, maxloc(growth, dim=1)))
         call raise(error, "&solver fixed_step = "//time_text(options%fixed_step)//": method = '"//method// &
                    "' is unstable in this scene with steps above "//three_digits(limit)//" s ("//motion_text(fastest)// &
                    "); take that or less, or fixed_step = 0, or method = 'gauss'; "// &
                    "allow_unstable = .true. runs it all the same", exit_bad_input)
      end associate
   end subroutine check_fixed_step

   !> The longest of the steps that are really taken: each interval between switches has a whole number of them.
   pure real(wp) function longest_step(switches, fixed_step, t_end)
      real(wp), intent(in) :: switches(:), fixed_step, t_end !! [s]
      real(wp), allocatable :: ends(:)
      integer :: i

      ends = [0.0_wp, interval_ends(switches, t_end)]
      longest_step = 0.0_wp
      do i = 2, size(ends)
         associate (span => ends(i) - ends(i - 1))
            longest_step = max(longest_step, span/max(1.0_wp, aint(span/fixed_step*(1.0_wp - 4.0_wp*epsilon(span)) + 1.0_wp)))
         end associate
      end do
   end function longest_step

   !> Log of the amplification of each motion in t_end/h steps.
   pure function growth_in_run(r, lambda, h, t_end) result(growth)
      type(stability_function), intent(in) :: r
      complex(wp), intent(in) :: lambda(:, :) !! of each motion j, lambda(:, j) are alternatives: the mildest counts [1/s]
      real(wp), intent(in) :: h, t_end        !! [s]
      real(wp) :: growth(size(lambda, 2))
      integer :: j

      do j = 1, size(lambda, 2)
         growth(j) = t_end/h*minval(r%growth(h*lambda(:, j)) - max(0.0_wp, h*real(lambda(:, j), wp)))
      end do
   end function growth_in_run

   !> The largest step below h, to one in 200, that is not beyond the limit, and none down to a fifth of it is.
   pure real(wp) function largest_stable_step(r, lambda, h, t_end) result(step)
      type(stability_function), intent(in) :: r
      complex(wp), intent(in) :: lambda(:, :)
      real(wp), intent(in) :: h, t_end
      real(wp), parameter :: shrink = 0.995_wp
      real(wp) :: smaller

      step = shrink*h
      smaller = h
      do while (step > tiny(step))
         smaller = smaller*shrink
         if (any(growth_in_run(r, lambda, smaller, t_end) > log(most_growth))) step = smaller*shrink
         if (smaller < 0.2_wp*step) exit
      end do
   end function largest_stable_step

   !> What is amplified, in words.
   pure function motion_text(lambda) result(text)
      complex(wp), intent(in) :: lambda
      character(len=:), allocatable :: text
      if (abs(aimag(lambda)) > abs(real(lambda, wp))) then
         text = 'vibration of '//three_digits(abs(lambda))//' rad/s'
      else
         text = 'decay of '//three_digits(abs(lambda))//' 1/s'
      end if
   end function motion_text

   !> Three digits, rounded down so that a limit can be taken at its word.
   pure function three_digits(value) result(text)
      real(wp), intent(in) :: value
      character(len=:), allocatable :: text
      real(wp) :: unit
      if (.not. value > 0.0_wp) then
         text = '0'
         return
      end if
      unit = 10.0_wp**(floor(log10(value)) - 2)
      text = time_text(unit*aint(value/unit*(1.0_wp + 1.0e-9_wp)))
   end function three_digits

end module rodyn_step_limit
