!> Laws in time: of loads, of driven kinks and of whatever else is prescribed. Everything about a law stands here: its word and
!> its keys, its value and derivatives, and the times at which it is not smooth.
!>
!> A law runs from `t_start` to `t_end`. What it is before and after is a matter of what it serves: a force is zero there, a
!> motion stays where it is. Between two neighbouring switch times a law is one smooth piece, `take_piece`: what has risen,
!> and where a table is level, is constant. A table of forces is linear between its times and may jump; that of a motion is
!> a cubic spline at rest at its ends.
module rodyn_time_law
   use rodyn_kinds, only: wp
   use rodyn_switch_times, only: last_before, same_time
   implicit none (type, external)
   private
   public :: law_config, time_law, new_time_law, law_times, law_words, motion_words, keys_of_law, moves_smoothly, value_at

   !> What a namelist group gives of its law, but for its name, whose default is the group's own.
   type :: law_config
      real(wp) :: t_start = 0.0_wp      !! [s]
      real(wp) :: t_end = huge(1.0_wp)  !! [s]; huge: t_end of the case
      real(wp) :: value = 0.0_wp        !! constant value, amplitude, or change of a step or ramp
      real(wp) :: rate = 0.0_wp         !! of sine and sine_squared [rad/s]
      real(wp) :: rise_time = 0.0_wp    !! of smooth_step [s]; 0: t_end - t_start
      real(wp), allocatable :: times(:)  !! of table, increasing; of forces, two equal ones: a jump [s]
      real(wp), allocatable :: values(:) !! of table
   end type law_config

   !> A law as cases name it.
   type :: law_row
      character(len=12) :: word
      character(len=32) :: keys !! that it takes; a group may have fewer
      logical :: smooth         !! a motion by it starts and ends at rest, and its rate never jumps
   end type law_row

   type(law_row), parameter :: laws(6) = [ &
      law_row('constant', 't_start|t_end|value', .false.), &
      law_row('table', 'times|values|after', .true.), &
      law_row('sine_squared', 't_start|t_end|value|rate', .false.), &
      law_row('smooth_step', 't_start|t_end|value|rise_time', .true.), &
      law_row('ramp', 't_start|t_end|value', .false.), &
      law_row('sine', 't_start|t_end|value|rate', .false.)]

   !> Their words as a list; a motion is not constant.
   character(len=*), parameter :: motion_words = trim(laws(2)%word)//'|'//trim(laws(3)%word)//'|'//trim(laws(4)%word)//'|'// &
      trim(laws(5)%word)//'|'//trim(laws(6)%word)
   character(len=*), parameter :: law_words = trim(laws(1)%word)//'|'//motion_words

   !> The same as numbers, so that the right-hand side compares no text; the last is the table of a motion.
   integer, parameter :: law_constant = 1, law_table = 2, law_sine_squared = 3, law_smooth_step = 4, law_ramp = 5, law_sine = 6, &
      law_spline = 7

   !> A law, or a piece of it.
   type :: time_law
      integer :: law = law_constant
      real(wp) :: t_start = 0.0_wp, t_end = 0.0_wp !! it runs in between [s]; of a piece of a table, where that begins
      real(wp) :: value = 0.0_wp                   !! as given; of a piece of a table, at its beginning
      real(wp) :: rate = 0.0_wp                    !! of sine and sine_squared [rad/s]
      real(wp) :: span = 1.0_wp                    !! of the rise, the ramp, or the piece of a table [s]
      real(wp) :: t_risen = 0.0_wp                 !! when a step has risen [s]
      real(wp) :: change = 0.0_wp                  !! of the value in a piece of a table
      real(wp), allocatable :: times(:), values(:) !! of a table [s]
      real(wp), allocatable :: bend(:)             !! of a spline: second derivatives there
   contains
      procedure :: runs_at
      procedure :: is_still
      procedure :: is_zero
      procedure :: drops
      procedure :: take_piece
      procedure :: motion_at
      procedure :: resting_at
   end type time_law

contains

   !> Keys that a law takes, a list such as 'value|rate'.
   pure function keys_of_law(word) result(keys)
      character(len=*), intent(in) :: word
      character(len=:), allocatable :: keys
      integer :: i
      i = findloc(laws%word, word, 1)
      keys = ''
      if (i > 0) keys = trim(laws(i)%keys)
   end function keys_of_law

   !> Does a motion by this law start and end at rest, without a jump of its rate?
   pure logical function moves_smoothly(word)
      character(len=*), intent(in) :: word
      moves_smoothly = any(laws%word == word .and. laws%smooth)
   end function moves_smoothly

   !> Compile a law.
   pure subroutine new_time_law(self, word, given, of_motion, hold)
      type(time_law), intent(out) :: self
      character(len=*), intent(in) :: word
      class(law_config), intent(in) :: given
      logical, intent(in) :: of_motion !! otherwise of a force
      logical, intent(in) :: hold      !! a table of a force keeps its last value

      self%law = findloc(laws%word, word, 1)
      self%t_start = given%t_start
      self%t_end = given%t_end
      self%value = given%value
      self%rate = given%rate
      select case (self%law)
      case (law_table)
         call take_table(self, given, of_motion, hold)
      case (law_ramp)
         if (same_time(given%t_start, given%t_end)) self%t_end = given%t_start ! a step
         self%span = self%t_end - self%t_start
      case (law_smooth_step)
         self%span = self%t_end - self%t_start
         if (.not. of_motion) self%span = given%rise_time
      case default ! no more of it
      end select
      self%t_risen = self%t_end
      if (self%law == law_smooth_step .and. .not. of_motion) self%t_risen = self%t_start + self%span
   end subroutine new_time_law

   !> A table has times of its own: a force is zero before the first and, unless it is held, after the last.
   pure subroutine take_table(self, given, of_motion, hold)
      type(time_law), intent(inout) :: self
      class(law_config), intent(in) :: given
      logical, intent(in) :: of_motion, hold

      self%times = given%times
      self%values = given%values
      associate (first => given%times(1), last => given%times(size(given%times)))
         if (of_motion) then
            self%law = law_spline
            self%t_start = first
            self%t_end = last
            self%bend = clamped_spline(given%times, given%values)
         else
            self%t_start = max(given%t_start, first)
            if (.not. hold) self%t_end = min(given%t_end, last)
         end if
      end associate
   end subroutine take_table

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

   !> All times at which some of these laws are not smooth, in no order [s].
   pure function law_times(some) result(times)
      type(time_law), intent(in) :: some(:)
      real(wp), allocatable :: times(:)
      integer :: i

      times = [some%t_start, some%t_end, some%t_risen]
      do i = 1, size(some)
         if (allocated(some(i)%times)) times = [times, min(max(some(i)%times, some(i)%t_start), some(i)%t_end)]
      end do
   end function law_times

   !> Is a time within its run?
   elemental logical function runs_at(self, t)
      class(time_law), intent(in) :: self
      real(wp), intent(in) :: t !! [s], not a switch
      runs_at = self%t_start < t .and. t < self%t_end
   end function runs_at

   !> Has it, or this piece of it, the same value at all times of its run?
   elemental logical function is_still(self)
      class(time_law), intent(in) :: self
      select case (self%law)
      case (law_constant)
         is_still = .true.
      case (law_table, law_spline)
         is_still = .not. abs(self%change) > 0.0_wp
         if (allocated(self%values)) is_still = .not. any(abs(self%values - self%values(1)) > 0.0_wp)
      case default
         is_still = vanishes(self)
      end select
   end function is_still

   !> Is it zero at all times of its run before one, which is behind its beginning?
   pure logical function is_zero(self, before)
      class(time_law), intent(in) :: self
      real(wp), intent(in) :: before !! [s]
      is_zero = vanishes(self)
      if (.not. allocated(self%times)) return
      associate (first => last_before(self%times, self%t_start), passed => count(self%times < min(before, self%t_end)))
         is_zero = .not. any(abs(self%values(first:min(passed + 1, size(self%times)))) > 0.0_wp)
      end associate
   end function is_zero

   !> Is a law other than a table zero?
   pure logical function vanishes(self)
      class(time_law), intent(in) :: self
      vanishes = .not. abs(self%value) > 0.0_wp
      if (self%law == law_sine .or. self%law == law_sine_squared) vanishes = vanishes .or. .not. abs(self%rate) > 0.0_wp
   end function vanishes

   !> Does its run end with a table that is not zero there?
   pure logical function drops(self)
      class(time_law), intent(in) :: self
      drops = .false.
      if (self%law /= law_table) return
      associate (last => size(self%times))
         drops = abs(self%values(last)) > 0.0_wp .and. self%t_end >= self%times(last) .and. self%t_end <= self%times(last)
      end associate
   end function drops

   !> What the law is around a time of its run.
   pure subroutine take_piece(self, t, piece)
      class(time_law), intent(in) :: self
      real(wp), intent(in) :: t !! [s], not a switch
      type(time_law), intent(out) :: piece
      integer :: first, last

      piece = time_law(self%law, self%t_start, self%t_end, self%value, self%rate, self%span, self%t_risen)
      select case (self%law)
      case (law_smooth_step)
         if (t > self%t_risen) piece%law = law_constant
      case (law_table)
         first = last_before(self%times, t)
         piece%value = self%values(first)
         if (first < size(self%times)) then
            piece%t_start = self%times(first)
            piece%span = self%times(first + 1) - self%times(first)
            piece%change = self%values(first + 1) - self%values(first)
         end if
         if (.not. abs(piece%change) > 0.0_wp) piece%law = law_constant
      case (law_spline) ! the knots on either side, and one more each for times beyond by rounding
         first = max(last_before(self%times, t) - 1, 1)
         last = min(first + 3, size(self%times))
         piece%times = self%times(first:last)
         piece%values = self%values(first:last)
         piece%bend = self%bend(first:last)
      case default ! the others are one piece
      end select
   end subroutine take_piece

   !> Value of a piece. It stands apart from the derivatives, which cost more, for laws that are evaluated again and again.
   pure real(wp) function value_at(self, t)
      type(time_law), intent(in) :: self
      real(wp), intent(in) :: t !! [s]
      real(wp) :: s

      select case (self%law)
      case (law_constant)
         value_at = self%value
      case (law_table)
         value_at = self%value + self%change*((t - self%t_start)/self%span)
      case (law_sine_squared)
         value_at = self%value*sin(self%rate*t)**2
      case (law_smooth_step)
         s = min(max((t - self%t_start)/self%span, 0.0_wp), 1.0_wp)
         value_at = self%value*s**3*(10.0_wp - s*(15.0_wp - 6.0_wp*s))
      case default
         value_at = first_of(self, t)
      end select
   end function value_at

   !> Value of a law that has no shorter way to it.
   pure real(wp) function first_of(self, t)
      type(time_law), intent(in) :: self
      real(wp), intent(in) :: t !! [s]
      real(wp) :: x(3)
      x = self%motion_at(t)
      first_of = x(1)
   end function first_of

   !> Value of a piece and its first two derivatives in time.
   pure function motion_at(self, t) result(x)
      class(time_law), intent(in) :: self
      real(wp), intent(in) :: t !! [s]
      real(wp) :: x(3)
      real(wp) :: s

      select case (self%law)
      case (law_constant)
         x = [self%value, 0.0_wp, 0.0_wp]
      case (law_table)
         x = [self%value + self%change*((t - self%t_start)/self%span), self%change/self%span, 0.0_wp]
      case (law_sine_squared)
         associate (phase => self%rate*t, w => self%rate)
            x = [sin(phase)**2, w*sin(2.0_wp*phase), 2.0_wp*w**2*cos(2.0_wp*phase)]*self%value
         end associate
      case (law_smooth_step) ! value and two derivatives vanish at the start, rate and acceleration at the end
         s = min(max((t - self%t_start)/self%span, 0.0_wp), 1.0_wp)
         x = [s**3*(10.0_wp - s*(15.0_wp - 6.0_wp*s)), 30.0_wp*(s*(1.0_wp - s))**2/self%span, &
              60.0_wp*s*(1.0_wp - s)*(1.0_wp - 2.0_wp*s)/self%span**2]*self%value
      case (law_ramp)
         x = [self%value*((t - self%t_start)/self%span), self%value/self%span, 0.0_wp]
      case (law_sine)
         associate (phase => self%rate*(t - self%t_start), w => self%rate)
            x = [sin(phase), w*cos(phase), -w**2*sin(phase)]*self%value
         end associate
      case default
         x = spline_value(self%times, self%values, self%bend, t)
      end select
   end function motion_at

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

   !> Where a motion rests before or after its run: at its first or its last value. One without duration is a step.
   pure real(wp) function resting_at(self, t)
      class(time_law), intent(in) :: self
      real(wp), intent(in) :: t !! [s], outside the run
      real(wp) :: x(3)

      if (self%t_end <= self%t_start) then
         resting_at = merge(self%value, 0.0_wp, t > self%t_start)
      else
         x = self%motion_at(merge(self%t_start, self%t_end, t < self%t_start))
         resting_at = x(1)
      end if
   end function resting_at

end module rodyn_time_law
