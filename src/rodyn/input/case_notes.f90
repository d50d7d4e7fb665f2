!> What is allowed in a case but hardly meant: loads that never act, releases that never come, angles in degrees; and methods whose
!> errors are not what the tolerances seem to say.
module rodyn_case_notes
   use rodyn_kinds, only: wp
   use rodyn_case_config, only: case_config, none_given
   use rodyn_text, only: formatted, tidy, to_text
   implicit none (type, external)
   private
   public :: case_notes, joined_lines

   character(len=1), parameter :: nl = new_line('a')
   real(wp), parameter :: pi = acos(-1.0_wp)

contains

   !> One line for each note, without a closing newline; empty if there is nothing to say.
   function case_notes(config, runs) result(text)
      type(case_config), intent(in) :: config
      logical, intent(in) :: runs !! the case goes on until t_end, as it does not where only modes are wanted
      character(len=:), allocatable :: text

      text = ''
      if (runs) call note_idle(config, text)
      if (runs) call note_method(config, text)
      call note_degrees(config, text)
   end function case_notes

   !> Multistep methods in a chain that vibrates (docs/stability.md, "Multistep methods add up").
   subroutine note_method(config, text)
      type(case_config), intent(in) :: config
      character(len=:), allocatable, intent(inout) :: text
      logical :: vibrates

      if (config%solver%method /= 'adams' .and. config%solver%method /= 'bdf') return
      vibrates = config%model%bending == 'dynamic'
      if (allocated(config%chain%hinge_stiffness)) vibrates = vibrates .or. any(config%chain%hinge_stiffness > 0.0_wp)
      if (vibrates) call add(text, "method '"//trim(config%solver%method)//"': its errors add up from period to period of a "// &
                             'vibration, to hundreds of rtol in a thousand; a smaller rtol shows them')
   end subroutine note_method

   subroutine add(text, note)
      character(len=:), allocatable, intent(inout) :: text
      character(len=*), intent(in) :: note
      if (len(text) > 0) text = text//nl
      text = text//note
   end subroutine add

   !> Two texts of some lines or none, one under the other.
   pure function joined_lines(first, second) result(text)
      character(len=*), intent(in) :: first, second
      character(len=:), allocatable :: text
      text = first//second
      if (len(first) > 0 .and. len(second) > 0) text = first//nl//second
   end function joined_lines

   !> A number with six digits, without idle zeros.
   pure function number(x) result(text)
      real(wp), intent(in) :: x
      character(len=:), allocatable :: text
      if (abs(x) >= 1.0e-3_wp .and. abs(x) < 1.0e6_wp) then
         text = tidy(formatted(x, '(f0.6)'))
      else
         text = tidy(formatted(x, '(es13.5)'))
      end if
   end function number

   !> What has no influence until t_end. Groups are counted in the order of the file.
   subroutine note_idle(config, text)
      type(case_config), intent(in) :: config
      character(len=:), allocatable, intent(inout) :: text
      character(len=:), allocatable :: why
      integer :: i

      if (allocated(config%loads)) then
         do i = 1, size(config%loads)
            associate (load => config%loads(i))
               why = idle_law(load%law, load%t_start, load%value, load%times, load%values, config%t_end)
               if (load%law == 'sine_squared' .and. .not. abs(load%rate) > 0.0_wp) why = 'its rate is 0'
               if (len(why) == 0 .and. load%law /= 'table' .and. .not. load%t_end > load%t_start) why = 'it ends as it begins'
            end associate
            if (len(why) > 0) call add(text, '&load, number '//to_text(i)//', never acts: '//why)
         end do
      end if
      if (allocated(config%kink_programs)) then
         do i = 1, size(config%kink_programs)
            associate (program => config%kink_programs(i))
               why = idle_law(program%law, program%t_start, program%value, program%times, program%values, config%t_end)
            end associate
            if (len(why) > 0) call add(text, '&kink_program, number '//to_text(i)//', moves nothing: '//why)
         end do
      end if
      if (.not. allocated(config%hinges)) return
      do i = 1, size(config%hinges)
         associate (t => config%hinges(i)%release_time)
            if (t > config%t_end .and. t < none_given) call add(text, '&hinge, hinge '//to_text(config%hinges(i)%hinge)// &
               ', is never released: release_time = '//number(t)//' s is after the end of the case, '// &
               number(config%t_end)//' s')
         end associate
      end do
   end subroutine note_idle

   !> Why a law in time does nothing; empty if it does something.
   function idle_law(law, t_start, value, times, values, end_of_case) result(why)
      character(len=*), intent(in) :: law
      real(wp), intent(in) :: t_start, value
      real(wp), allocatable, intent(in) :: times(:), values(:) !! of a table
      real(wp), intent(in) :: end_of_case
      character(len=:), allocatable :: why
      real(wp) :: begin

      why = ''
      begin = t_start
      if (law == 'table') then
         if (.not. (allocated(times) .and. allocated(values))) return
         if (size(times) == 0 .or. size(values) == 0) return
         begin = max(t_start, times(1))
         if (.not. any(abs(values) > 0.0_wp)) why = 'all its values are 0'
      else if (.not. abs(value) > 0.0_wp) then
         why = 'its value is 0'
      end if
      if (begin >= end_of_case) why = 'it begins at t = '//number(begin)//' s, and the case ends at '// &
                                      number(end_of_case)//' s'
   end function idle_law

   !> Angles that are beyond a whole turn and round: those are typed in degrees.
   subroutine note_degrees(config, text)
      type(case_config), intent(in) :: config
      character(len=:), allocatable, intent(inout) :: text
      integer :: i

      call look('&initial phi', config%initial%phi)
      call look('&initial alpha', config%initial%alpha)
      call look('&initial beta', config%initial%beta)
      call look('&initial rotation', [config%initial%rotation])
      call look('&chain kink', config%chain%kink)
      if (allocated(config%kink_programs)) then
         do i = 1, size(config%kink_programs)
            call look('&kink_program value', [config%kink_programs(i)%value])
            call look('&kink_program values', config%kink_programs(i)%values)
         end do
      end if
      if (.not. allocated(config%hinges)) return
      do i = 1, size(config%hinges)
         associate (hinge => config%hinges(i))
            call look('&hinge rest_angle', [hinge%rest_angle])
            call look('&hinge freeplay', [hinge%freeplay])
            call look('&hinge lower_stop', [hinge%lower_stop])
            call look('&hinge upper_stop', [hinge%upper_stop])
            call look('&hinge latch_angle', [hinge%latch_angle])
         end associate
      end do

   contains

      !> One note for each key.
      subroutine look(what, angles)
         character(len=*), intent(in) :: what
         real(wp), intent(in), optional :: angles(:)
         integer :: k

         if (.not. present(angles)) return
         do k = 1, size(angles)
            if (.not. looks_like_degrees(angles(k))) cycle
            call add(text, what//' = '//number(angles(k))//' rad is '// &
                     number(abs(angles(k))/(2.0_wp*pi))//' turns; if degrees were meant, write '// &
                     number(angles(k)*pi/180.0_wp))
            return
         end do
      end subroutine look

   end subroutine note_degrees

   !> Beyond a turn, and a whole number of half degrees; nobody types such a number of radians.
   pure logical function looks_like_degrees(angle)
      real(wp), intent(in) :: angle
      real(wp), parameter :: largest = 3600.0_wp
      looks_like_degrees = abs(angle) > 2.0_wp*pi .and. abs(angle) <= largest
      if (looks_like_degrees) looks_like_degrees = abs(2.0_wp*angle - anint(2.0_wp*angle)) <= 0.0_wp
   end function looks_like_degrees

end module rodyn_case_notes
