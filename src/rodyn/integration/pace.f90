!> Whether a run may make one more step: not beyond the number that was asked for, nor without progress.
module rodyn_pace
   use rodyn_kinds, only: wp, i8
   use rodyn_text, only: to_text, time_text
   implicit none (type, external)
   private
   public :: pace_type

   integer, parameter :: judged_steps = 1000      !! after so many, the pace is judged: enough for any first step to grow
   real(wp), parameter :: endless = 1.0e12_wp     !! steps to the stop time: weeks for the smallest scene

   !> Steps and time at the last look.
   type :: pace_type
      private
      integer(i8) :: n_steps = 0
      real(wp) :: t = 0.0_wp !! [s]
   contains
      procedure :: begin
      procedure :: judge
   end type pace_type

contains

   !> An interval begins.
   pure subroutine begin(self, n_steps, t)
      class(pace_type), intent(inout) :: self
      integer(i8), intent(in) :: n_steps !! of the whole run so far
      real(wp), intent(in) :: t          !! [s]
      self%n_steps = n_steps
      self%t = t
   end subroutine begin

   !> Before each step. Would it take `endless` steps like the last ones to get to the stop time?
   pure subroutine judge(self, n_steps, max_steps, t, t_stop, refusal)
      class(pace_type), intent(inout) :: self
      integer(i8), intent(in) :: n_steps !! of the whole run so far
      integer, intent(in) :: max_steps   !! that it may make
      real(wp), intent(in) :: t, t_stop  !! now, and the stop time [s]
      character(len=:), allocatable, intent(out) :: refusal !! allocated: no step more, and why

      if (n_steps >= max_steps) then
         refusal = 'max_steps = '//to_text(max_steps)//' reached at t = '//time_text(t)//' s'
      else if (n_steps >= self%n_steps + judged_steps) then
         if (t - self%t < (t_stop - t)*(judged_steps/endless)) &
            refusal = 'no progress at t = '//time_text(t)//' s: the last '//to_text(judged_steps)//' steps advanced '// &
                      time_text(t - self%t)//' s; are loads or initial values out of scale?'
         call self%begin(n_steps, t)
      end if
   end subroutine judge

end module rodyn_pace
