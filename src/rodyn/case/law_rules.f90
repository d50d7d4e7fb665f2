!> Rules of laws in time, of loads and of driven kinks alike.
module rodyn_law_rules
   use rodyn_kinds, only: wp
   use rodyn_key_judge, only: key_judge
   use rodyn_switch_times, only: same_time
   use rodyn_text, only: has_word, short_text, to_text
   implicit none (type, external)
   private
   public :: check_law_keys, check_table

contains

   !> Each law has its own keys and takes no others.
   subroutine check_law_keys(judge, group, i, law, keys, takes, defaults)
      class(key_judge), intent(inout) :: judge
      character(len=*), intent(in) :: group
      integer, intent(in) :: i !! which of these groups
      character(len=*), intent(in) :: law
      character(len=*), intent(in) :: keys(:)
      character(len=*), intent(in) :: takes    !! keys that the law takes, a list such as 'value|rate'
      character(len=*), intent(in) :: defaults !! those of them that need not be given
      logical :: taken
      integer :: k

      if (.not. judge%is_sound(group, i, 'law')) return
      do k = 1, size(keys)
         taken = has_word(takes, keys(k))
         if (taken .and. has_word(defaults, keys(k))) cycle
         if (judge%is_given(group, i, trim(keys(k))) .eqv. taken) cycle
         if (taken) then
            call judge%require(group, i, trim(keys(k)), "when law = '"//trim(law)//"'")
         else
            call judge%blame(group, i, trim(keys(k)), "does not go with law = '"//trim(law)//"'")
         end if
      end do
   end subroutine check_law_keys

   !> As many values as times, two at least, and times that increase: of a spline by more than rounding; of a load two may be
   !> equal, where it jumps, but not three.
   subroutine check_table(judge, group, i, times, values, spline)
      class(key_judge), intent(inout) :: judge
      character(len=*), intent(in) :: group
      integer, intent(in) :: i !! which of these groups
      real(wp), allocatable, intent(in) :: times(:)  !! [s]
      real(wp), allocatable, intent(in) :: values(:) !! both allocated where they are given rightly
      logical, intent(in) :: spline !! smooth at its times; a load may jump there
      character(len=:), allocatable :: rule
      integer :: k

      if (.not. gives(judge, group, i, 'times')) return
      if (size(times) < 2) call judge%blame(group, i, 'times', 'must be two values at least')
      do k = 2, size(times)
         if (follows(k)) cycle
         rule = 'must increase, but value '
         if (.not. spline) rule = 'must increase, or jump at two equal times, but value '
         call judge%blame(group, i, 'times', rule//to_text(k)//', '//short_text(times(k))//', follows '// &
                          short_text(times(k - 1))//' [s]')
         exit
      end do
      if (.not. gives(judge, group, i, 'values')) return
      if (size(values) /= size(times)) call judge%blame(group, i, 'values', 'must be as many as times: '// &
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
   logical function gives(judge, group, i, key)
      class(key_judge), intent(in) :: judge
      character(len=*), intent(in) :: group, key
      integer, intent(in) :: i
      gives = judge%is_given(group, i, key) .and. judge%is_sound(group, i, key)
   end function gives

end module rodyn_law_rules
