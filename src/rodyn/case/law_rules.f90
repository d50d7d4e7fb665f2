!> Rules of laws in time, of loads and of driven kinks alike.
module rodyn_law_rules
   use rodyn_kinds, only: wp
   use rodyn_key_checker, only: key_checker
   use rodyn_switch_times, only: same_time
   use rodyn_text, only: has_word, short_text, to_text
   use rodyn_time_law, only: law_config, keys_of_law
   implicit none (type, external)
   private
   public :: check_law

   character(len=*), parameter :: need_not_be_given = 't_start|t_end|rise_time|after'

contains

   !> Note everything that is wrong with the law of a group.
   subroutine check_law(checker, group, i, law, given, of_motion)
      class(key_checker), intent(inout) :: checker
      character(len=*), intent(in) :: group
      integer, intent(in) :: i !! which of these groups
      character(len=*), intent(in) :: law
      class(law_config), intent(in) :: given
      logical, intent(in) :: of_motion !! it is smooth but for a step; a force may jump

      if (of_motion) then
         call check_keys(checker, group, i, law, [character(len=9) :: 't_start', 't_end', 'value', 'rate', 'times', 'values'])
         if (law /= 'table') call check_motion_times(checker, group, i, law, given)
      else
         call check_keys(checker, group, i, law, [character(len=9) :: 'value', 'rate', 'rise_time', 'times', 'values', 'after'])
         call check_force_times(checker, group, i, law, given)
      end if
      if (law == 'table') call check_table(checker, group, i, given%times, given%values, of_motion)
   end subroutine check_law

   !> Each law has its own keys and takes no others.
   subroutine check_keys(checker, group, i, law, keys)
      class(key_checker), intent(inout) :: checker
      character(len=*), intent(in) :: group
      integer, intent(in) :: i
      character(len=*), intent(in) :: law
      character(len=*), intent(in) :: keys(:) !! of the group, which some laws do not take
      character(len=:), allocatable :: takes
      logical :: taken
      integer :: k

      if (.not. checker%is_sound(group, i, 'law')) return
      takes = keys_of_law(law)
      do k = 1, size(keys)
         taken = has_word(takes, keys(k))
         if (taken .and. has_word(need_not_be_given, keys(k))) cycle
         if (checker%is_given(group, i, trim(keys(k))) .eqv. taken) cycle
         if (taken) then
            call checker%require(group, i, trim(keys(k)), "when law = '"//trim(law)//"'")
         else
            call checker%report(group, i, trim(keys(k)), "does not apply to law = '"//trim(law)//"'")
         end if
      end do
   end subroutine check_keys

   !> The load must not end before it begins, and a smooth step must fit in between.
   subroutine check_force_times(checker, group, i, law, load)
      class(key_checker), intent(inout) :: checker
      character(len=*), intent(in) :: group
      integer, intent(in) :: i
      character(len=*), intent(in) :: law
      class(law_config), intent(in) :: load
      character(len=:), allocatable :: whose !! t_end this is

      if (.not. (checker%is_sound(group, i, 't_start') .and. checker%is_sound(group, i, 't_end'))) return
      if (.not. checker%is_given(group, i, 't_end') .and. .not. checker%is_sound('case', 1, 't_end')) return
      whose = ' of the same load'
      if (.not. checker%is_given(group, i, 't_end')) whose = ', with t_end of &case'
      if (load%t_start > load%t_end .and. .not. same_time(load%t_start, load%t_end)) then
         if (checker%is_given(group, i, 't_start')) then
            call checker%report(group, i, 't_start', 'must not be after t_end = '//short_text(load%t_end)//' [s] of the same load')
         else
            call checker%report(group, i, 't_end', 'must not be before t_start = '//short_text(load%t_start)// &
                              ' [s] of the same load')
         end if
      else if (law == 'smooth_step' .and. checker%is_sound(group, i, 'rise_time') .and. &
               checker%is_sound(group, i, 'law')) then
         if (load%t_start + load%rise_time > load%t_end .and. &
             .not. same_time(load%t_start + load%rise_time, load%t_end)) then
            call checker%report(group, i, 'rise_time', 'must not exceed t_end - t_start = ' &
               //short_text(load%t_end - load%t_start)//' [s]'//whose)
         else if (.not. load%rise_time > 0.0_wp) then
            call checker%report(group, i, 'rise_time', 'must be positive, but t_end = t_start [s]')
         end if
      end if
   end subroutine check_force_times

   !> A motion must not end before it begins; only a ramp may be a step.
   subroutine check_motion_times(checker, group, i, law, given)
      class(key_checker), intent(inout) :: checker
      character(len=*), intent(in) :: group
      integer, intent(in) :: i
      character(len=*), intent(in) :: law
      class(law_config), intent(in) :: given

      if (.not. (checker%is_sound(group, i, 't_start') .and. checker%is_sound(group, i, 't_end'))) return
      if (.not. checker%is_given(group, i, 't_end') .and. .not. checker%is_sound('case', 1, 't_end')) return
      if (given%t_start > given%t_end .and. .not. same_time(given%t_start, given%t_end)) then
         call checker%report(group, i, 't_start', 'must not be after t_end = '//short_text(given%t_end)//' [s] of the same program')
      else if (same_time(given%t_start, given%t_end) .and. law /= 'ramp') then
         call checker%report(group, i, 't_start', "must be before t_end; only law = 'ramp' may be a step")
      end if
   end subroutine check_motion_times

   !> As many values as times, two at least, and times that increase: of a spline by more than rounding; of a load two may be
   !> equal, where it jumps, but not three.
   subroutine check_table(checker, group, i, times, values, spline)
      class(key_checker), intent(inout) :: checker
      character(len=*), intent(in) :: group
      integer, intent(in) :: i !! which of these groups
      real(wp), allocatable, intent(in) :: times(:)  !! [s]
      real(wp), allocatable, intent(in) :: values(:) !! both allocated where they are given rightly
      logical, intent(in) :: spline !! smooth at its times; a load may jump there
      character(len=:), allocatable :: rule
      integer :: k

      if (.not. gives(checker, group, i, 'times')) return
      if (size(times) < 2) call checker%report(group, i, 'times', 'must have at least two values')
      do k = 2, size(times)
         if (follows(k)) cycle
         rule = 'must increase, but value '
         if (.not. spline) rule = 'must increase, or jump at two equal times, but value '
         call checker%report(group, i, 'times', rule//to_text(k)//', '//short_text(times(k))//', follows '// &
                          short_text(times(k - 1))//' [s]')
         exit
      end do
      if (.not. gives(checker, group, i, 'values')) return
      if (size(values) /= size(times)) call checker%report(group, i, 'values', 'must have as many values as times: '// &
                                                  to_text(size(times))//', not '//to_text(size(values)))

   contains

      !> May time k stand behind those before it?
      pure logical function follows(k)
         integer, intent(in) :: k
         if (spline) then
            follows = times(k) > times(k - 1) .and. .not. same_time(times(k), times(k - 1))
         else
            follows = times(k) >= times(k - 1)
            if (k > 2) follows = follows .and. times(k) > times(k - 2)
         end if
      end function follows

   end subroutine check_table

   !> Is a key given, and rightly?
   logical function gives(checker, group, i, key)
      class(key_checker), intent(in) :: checker
      character(len=*), intent(in) :: group, key
      integer, intent(in) :: i
      gives = checker%is_given(group, i, key) .and. checker%is_sound(group, i, key)
   end function gives

end module rodyn_law_rules
