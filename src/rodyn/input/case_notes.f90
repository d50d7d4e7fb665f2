!> What is allowed in a case but hardly intended: loads that never act, releases that never come, angles in degrees; and methods
!> whose errors are not what the tolerances seem to say.
module rodyn_case_notes
   use rodyn_kinds, only: wp
   use rodyn_case_config, only: case_config, hinge_config, none_given
   use rodyn_kink_program, only: kink_set, new_kink_set
   use rodyn_methods, only: method_named, method_type
   use rodyn_loads, only: load_set, new_load_set
   use rodyn_switch_times, only: same_time
   use rodyn_text, only: formatted, joined, tidy, to_text
   implicit none (type, external)
   private
   public :: case_notes, degrees_note

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
      type(method_type) :: method
      logical :: vibrates

      method = method_named(config%solver%method)
      vibrates = config%model%bending == 'dynamic'
      if (allocated(config%chain%hinge_stiffness)) vibrates = vibrates .or. any(config%chain%hinge_stiffness > 0.0_wp)
      if (vibrates .and. method%multistep) call add(text, "method '"//trim(method%name)//"': its errors add up from period "// &
                                                    'to period of a vibration, to hundreds of rtol in a thousand; '// &
                                                    'a smaller rtol shows them')
   end subroutine note_method

   subroutine add(text, note)
      character(len=:), allocatable, intent(inout) :: text
      character(len=*), intent(in) :: note
      text = joined(text, note, new_line('a'))
   end subroutine add

   !> A number with six digits, without idle zeros.
   pure function number(x) result(text)
      real(wp), intent(in) :: x
      character(len=:), allocatable :: text
      if (abs(x) <= 0.0_wp) then
         text = '0'
      else if (abs(x) >= 1.0e-3_wp .and. abs(x) < 1.0e6_wp) then
         text = tidy(formatted(x, '(f0.6)'))
      else
         text = tidy(formatted(x, '(es13.5)'))
      end if
   end function number

   !> What has no influence until t_end. Groups are counted in the order of the file.
   subroutine note_idle(config, text)
      type(case_config), intent(in) :: config
      character(len=:), allocatable, intent(inout) :: text
      type(load_set) :: loads
      type(kink_set) :: kinks
      character(len=:), allocatable :: why
      integer :: i

      call new_load_set(loads, config%loads)
      call new_kink_set(kinks, [real(wp) ::], config%kink_programs)
      do i = 1, size(loads%loads)
         associate (load => loads%loads(i))
            why = idle_span(load%law%t_start, load%law%t_end, config%t_end)
            if (len(why) == 0 .and. load%law%is_zero(config%t_end)) &
               why = zero_of(config%loads(i)%law, config%loads(i)%value, 'its values are 0 as long as it acts')
            if (config%spacecraft%motion == 'fixed' .and. load%node == 0) why = 'the spacecraft is fixed'
         end associate
         if (len(why) > 0) call add(text, '&load, number '//to_text(i)//', never acts: '//why)
      end do
      do i = 1, size(kinks%programs)
         associate (law => kinks%programs(i)%law)
            why = ''
            if (law%t_start < law%t_end .or. law%t_start >= config%t_end) & ! but for a step
               why = idle_span(law%t_start, law%t_end, config%t_end)
            if (len(why) == 0 .and. law%is_still()) &
               why = zero_of(config%kink_programs(i)%law, law%value, 'all its values are equal')
         end associate
         if (len(why) > 0) call add(text, '&kink_program, number '//to_text(i)//', moves nothing: '//why)
      end do
      if (allocated(config%hinges)) call note_releases(config%hinges, config%t_end, text)
   end subroutine note_idle

   !> Releases that do not come until t_end: too late, or by a latching of what stays held.
   subroutine note_releases(hinges, t_end, text)
      type(hinge_config), intent(in) :: hinges(:)
      real(wp), intent(in) :: t_end !! [s]
      character(len=:), allocatable, intent(inout) :: text
      logical :: comes_free(size(hinges))
      integer :: i, k

      associate (t => hinges%release_time)
         comes_free = .not. hinges%held .or. (t < t_end .and. .not. same_time(t, t_end))
         do k = 1, size(hinges) ! along chains of hinges that release one another
            do i = 1, size(hinges)
               comes_free(i) = comes_free(i) .or. any(comes_free .and. hinges%hinge == hinges(i)%release_after)
            end do
         end do
         do i = 1, size(hinges)
            if (comes_free(i)) cycle
            if (t(i) < none_given) then
               call add(text, '&hinge, hinge '//to_text(hinges(i)%hinge)//', is never released: release_time = '// &
                        number(t(i))//' s is not before the end of the case, '//number(t_end)//' s')
            else if (hinges(i)%release_after >= 0) then
               call add(text, '&hinge, hinge '//to_text(hinges(i)%hinge)//', is never released: hinge '// &
                        to_text(hinges(i)%release_after)//' is held and so cannot latch')
            end if
         end do
      end associate
   end subroutine note_releases

   !> What makes a law in time vanish.
   pure function zero_of(law, value, table) result(why)
      character(len=*), intent(in) :: law
      real(wp), intent(in) :: value
      character(len=*), intent(in) :: table !! what it is if it is a table
      character(len=:), allocatable :: why
      if (law == 'table') then
         why = table
      else if (abs(value) > 0.0_wp) then
         why = 'its rate is 0'
      else
         why = 'its value is 0'
      end if
   end function zero_of

   !> Why nothing of an interval lies within the case; empty if something does.
   function idle_span(t_start, t_end, end_of_case) result(why)
      real(wp), intent(in) :: t_start, t_end, end_of_case !! [s]
      character(len=:), allocatable :: why

      why = ''
      if (t_start >= end_of_case .or. same_time(t_start, end_of_case)) then
         why = 'it begins at t = '//number(t_start)//' s, and the case ends at '//number(end_of_case)//' s'
      else if (t_end <= 0.0_wp) then
         why = 'it ends at t = '//number(t_end)//' s, and the case begins at 0 s'
      else if (t_end <= t_start .or. same_time(t_start, t_end)) then
         why = 'it begins at t = '//number(t_start)//' s, and ends at '//number(t_end)//' s'
      end if
   end function idle_span

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
         character(len=:), allocatable :: note

         if (.not. present(angles)) return
         note = degrees_note(what, angles)
         if (len(note) > 0) call add(text, note)
      end subroutine look

   end subroutine note_degrees

   !> What there is to say of the first angle that looks like degrees; empty if none does.
   pure function degrees_note(what, angles) result(note)
      character(len=*), intent(in) :: what
      real(wp), intent(in) :: angles(:) !! [rad]
      character(len=:), allocatable :: note
      integer :: k

      note = ''
      k = findloc(looks_like_degrees(angles), .true., 1)
      if (k > 0) note = what//' = '//number(angles(k))//' rad is '//number(abs(angles(k))/(2.0_wp*pi))// &
                        ' turns; if degrees were meant, write '//number(angles(k)*pi/180.0_wp)
   end function degrees_note

   !> Beyond a turn, and a whole number of half degrees; nobody types such a number of radians.
   elemental logical function looks_like_degrees(angle)
      real(wp), intent(in) :: angle
      real(wp), parameter :: largest = 3600.0_wp
      looks_like_degrees = abs(angle) > 2.0_wp*pi .and. abs(angle) <= largest
      if (looks_like_degrees) looks_like_degrees = abs(2.0_wp*angle - anint(2.0_wp*angle)) <= 0.0_wp
   end function looks_like_degrees

end module rodyn_case_notes
