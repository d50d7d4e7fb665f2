!> Driven kinks: breaks gamma_k(t) of the axis that move by a program: `&kink_program`,
!> docs/moving_scenes.md.
!>
!> The kink of a hinge is that of `&chain` plus all its programs. A program moves between t_start and t_end; before, it
!> has its first value, after, its last. Between two neighbouring switch times every program is smooth.
module rodyn_kink_program
   use rodyn_kinds, only: wp
   use rodyn_case_config, only: kink_config
   use rodyn_switch_times, only: last_before, middle_of, same_time
   implicit none (type, external)
   private
   public :: kink_program, kink_set, kink_regime, new_kink_set, kink_times, new_kink_regime, evaluate_kinks, program_value

   integer, parameter :: law_ramp = 1, law_smooth_step = 2, law_sine = 3, law_table = 4

   !> One program.
   type :: kink_program
      integer :: hinge = 0
      integer :: law = law_ramp
      logical :: still = .false.                   !! it has the same value at all times
      real(wp) :: t_start = 0.0_wp, t_end = 0.0_wp !! [s]
      real(wp) :: value = 0.0_wp                   !! change or amplitude [rad]
      real(wp) :: rate = 0.0_wp                    !! of a sine [rad/s]
      real(wp), allocatable :: times(:), values(:) !! knots of a table [s], [rad]
      real(wp), allocatable :: bend(:)             !! second derivatives there [rad/s^2]
   end type kink_program

   !> All programs of a case.
   type :: kink_set
      type(kink_program), allocatable :: programs(:)
      real(wp), allocatable :: constant(:) !! kinks without the programs (0:n-1) [rad]
   end type kink_set

   !> What moves between two switches.
   type :: kink_regime
      type(kink_program), allocatable :: moving(:)
      real(wp), allocatable :: constant(:) !! all that does not move (0:n-1) [rad]
   end type kink_regime

contains

   !> Collect the programs.
   subroutine new_kink_set(set, kink, programs)
      type(kink_set), intent(out) :: set
      real(wp), intent(in) :: kink(0:)                      !! kinks of `&chain` (0:n-1) [rad]
      type(kink_config), intent(in), optional :: programs(:) !! absent (not allocated): none
      integer :: i

      allocate (set%constant(0:size(kink) - 1), source=kink)
      allocate (set%programs(0))
      if (.not. present(programs)) return
      deallocate (set%programs)
      allocate (set%programs(size(programs)))
      do i = 1, size(programs)
         call new_program(set%programs(i), programs(i))
      end do
   end subroutine new_kink_set

   !> All times where some program is not smooth, in no order [s].
   pure function kink_times(set) result(times)
      type(kink_set), intent(in) :: set
      real(wp), allocatable :: times(:)
      integer :: i

      times = [set%programs%t_start, set%programs%t_end]
      do i = 1, size(set%programs)
         if (set%programs(i)%law == law_table) times = [times, set%programs(i)%times]
      end do
   end function kink_times

   !> One program as it is given, a table with its spline.
   subroutine new_program(program, given)
      type(kink_program), intent(out) :: program
      type(kink_config), intent(in) :: given

      program%hinge = given%hinge
      program%t_start = given%t_start
      program%t_end = given%t_end
      program%value = given%value
      program%rate = given%rate
      select case (given%law)
      case ('smooth_step')
         program%law = law_smooth_step
      case ('sine')
         program%law = law_sine
      case ('table')
         program%law = law_table
         program%t_start = given%times(1)
         program%t_end = given%times(size(given%times))
         program%times = given%times
         program%values = given%values
         program%bend = clamped_spline(given%times, given%values)
      case default
         program%law = law_ramp
         if (same_time(given%t_start, given%t_end)) program%t_end = given%t_start ! a step
      end select
      program%still = is_still(program)
   end subroutine new_program

   !> Second derivatives at the knots of the cubic spline that begins and ends at rest. With x' = 0 at both ends,
   !>     h_1 (2 s_1 + s_2) = 6 d_1,  h_i s_i + 2 (h_i + h_{i+1}) s_{i+1} + h_{i+1} s_{i+2} = 6 (d_{i+1} - d_i),
   !>     h_m (s_m + 2 s_{m+1}) = -6 d_m,  d the slopes of the chords: tridiagonal, diagonally dominant.
   pure function clamped_spline(times, values) result(bend)
      real(wp), intent(in) :: times(:), values(:)
      real(wp) :: bend(size(times))
      real(wp) :: h(size(times) - 1), chord(size(times) - 1), upper(size(times)), pivot
      integer :: i, m

      m = size(times)
      h = times(2:) - times(:m - 1)
      chord = (values(2:) - values(:m - 1))/h
      upper(1) = 0.5_wp
      bend(1) = 3.0_wp*chord(1)/h(1)
      do i = 2, m - 1
         pivot = 2.0_wp*(h(i - 1) + h(i)) - h(i - 1)*upper(i - 1)
         upper(i) = h(i)/pivot
         bend(i) = (6.0_wp*(chord(i) - chord(i - 1)) - h(i - 1)*bend(i - 1))/pivot
      end do
      bend(m) = (-6.0_wp*chord(m - 1)/h(m - 1) - bend(m - 1))/(2.0_wp - upper(m - 1))
      do i = m - 1, 1, -1
         bend(i) = bend(i) - upper(i)*bend(i + 1)
      end do
   end function clamped_spline

   !> What moves between two neighbouring switch times (or ends of the run).
   subroutine new_kink_regime(regime, set, t_from, t_to)
      type(kink_regime), intent(out) :: regime
      type(kink_set), intent(in) :: set
      real(wp), intent(in) :: t_from, t_to !! [s]
      logical :: moves(size(set%programs))
      real(wp) :: middle, x(3)
      integer :: i, n

      middle = middle_of(t_from, t_to)
      moves = set%programs%t_start < middle .and. middle < set%programs%t_end .and. .not. set%programs%still
      allocate (regime%constant(0:size(set%constant) - 1), source=set%constant)
      allocate (regime%moving(count(moves)))
      n = 0
      do i = 1, size(moves)
         associate (program => set%programs(i), kink => regime%constant(set%programs(i)%hinge))
            if (moves(i)) then
               n = n + 1
               call take_piece(regime%moving(n), program, middle)
            else if (program%t_start == program%t_end) then ! a step
               if (middle > program%t_start) kink = kink + program%value
            else
               x = program_value(program, merge(program%t_start, program%t_end, middle < program%t_start))
               kink = kink + x(1)
            end if
         end associate
      end do
   end subroutine new_kink_regime

   !> Does the program have the same value at all times?
   pure logical function is_still(program)
      type(kink_program), intent(in) :: program
      is_still = .not. abs(program%value) > 0.0_wp .or. (program%law == law_sine .and. .not. abs(program%rate) > 0.0_wp)
      if (program%law == law_table) is_still = .not. any(abs(program%values - program%values(1)) > 0.0_wp)
   end function is_still

   !> What of a program counts around a time: of a table the knots on either side, and one more each for times beyond by rounding.
   pure subroutine take_piece(piece, program, t)
      type(kink_program), intent(out) :: piece
      type(kink_program), intent(in) :: program
      real(wp), intent(in) :: t !! [s]
      integer :: first, last

      piece%hinge = program%hinge
      piece%law = program%law
      piece%t_start = program%t_start
      piece%t_end = program%t_end
      piece%value = program%value
      piece%rate = program%rate
      if (program%law /= law_table) return
      first = max(last_before(program%times, t) - 1, 1)
      last = min(first + 3, size(program%times))
      piece%times = program%times(first:last)
      piece%values = program%values(first:last)
      piece%bend = program%bend(first:last)
   end subroutine take_piece

   !> gamma, gamma' and gamma'' of all hinges at time t.
   pure subroutine evaluate_kinks(regime, t, kink, kink_rate, kink_acceleration)
      type(kink_regime), intent(in) :: regime
      real(wp), intent(in) :: t                        !! [s], within the regime
      real(wp), intent(inout) :: kink(0:)              !! (0:n-1) [rad]
      real(wp), intent(inout) :: kink_rate(0:)         !! (0:n-1) [rad/s]
      real(wp), intent(inout) :: kink_acceleration(0:) !! (0:n-1) [rad/s^2]
      real(wp) :: x(3)
      integer :: i, k

      do k = 0, size(kink) - 1
         kink(k) = regime%constant(k)
         kink_rate(k) = 0.0_wp
         kink_acceleration(k) = 0.0_wp
      end do
      do i = 1, size(regime%moving)
         k = regime%moving(i)%hinge
         x = program_value(regime%moving(i), t)
         kink(k) = kink(k) + x(1)
         kink_rate(k) = kink_rate(k) + x(2)
         kink_acceleration(k) = kink_acceleration(k) + x(3)
      end do
   end subroutine evaluate_kinks

   !> A program and its first two derivatives between t_start and t_end.
   pure function program_value(program, t) result(x)
      type(kink_program), intent(in) :: program
      real(wp), intent(in) :: t !! [s]
      real(wp) :: x(3)          !! [rad], [rad/s], [rad/s^2]
      real(wp) :: s, span

      span = program%t_end - program%t_start
      select case (program%law)
      case (law_ramp)
         x = [program%value*((t - program%t_start)/span), program%value/span, 0.0_wp]
      case (law_smooth_step) ! value and two derivatives vanish at the start, rate and acceleration at the end
         s = (t - program%t_start)/span
         x = [s**3*(10.0_wp - s*(15.0_wp - 6.0_wp*s)), 30.0_wp*(s*(1.0_wp - s))**2/span, &
              60.0_wp*s*(1.0_wp - s)*(1.0_wp - 2.0_wp*s)/span**2]*program%value
      case (law_sine)
         associate (phase => program%rate*(t - program%t_start), w => program%rate)
            x = [sin(phase), w*cos(phase), -w**2*sin(phase)]*program%value
         end associate
      case default
         x = spline_value(program%times, program%values, program%bend, t)
      end select
   end function program_value

   !> Cubic spline from its values and second derivatives at the knots.
   pure function spline_value(times, values, bend, t) result(x)
      real(wp), intent(in) :: times(:), values(:), bend(:)
      real(wp), intent(in) :: t
      real(wp) :: x(3)
      real(wp) :: a, b, h
      integer :: i

      i = min(last_before(times, t), size(times) - 1)
      h = times(i + 1) - times(i)
      b = (t - times(i))/h
      a = (times(i + 1) - t)/h
      x(1) = a*values(i) + b*values(i + 1) + h**2/6.0_wp*((a**3 - a)*bend(i) + (b**3 - b)*bend(i + 1))
      x(2) = (values(i + 1) - values(i))/h + h/6.0_wp*((3.0_wp*b**2 - 1.0_wp)*bend(i + 1) - (3.0_wp*a**2 - 1.0_wp)*bend(i))
      x(3) = a*bend(i) + b*bend(i + 1)
   end function spline_value

end module rodyn_kink_program
