!> Ends of fixed steps over an interval: h = interval/ceiling(interval/fixed_step). Times are never summed up.
module rodyn_step_grid
   use rodyn_kinds, only: wp, i8
   use rodyn_errors, only: error_type, raise
   use rodyn_text, only: time_text
   implicit none (type, external)
   private
   public :: step_grid

   type :: step_grid
      integer(i8) :: n = 0 !! steps of the interval; 0: steps are not fixed
      integer(i8) :: i = 0 !! steps done
      real(wp) :: t_first = 0.0_wp, t_last = 0.0_wp !! [s]
   contains
      procedure :: lay
      procedure :: next_end
   end type step_grid

contains

   !> A grid from t_first to t_last.
   subroutine lay(self, t_first, t_last, fixed_step, error)
      class(step_grid), intent(inout) :: self
      real(wp), intent(in) :: t_first, t_last !! [s]
      real(wp), intent(in) :: fixed_step      !! the longest step; 0: no grid [s]
      type(error_type), allocatable, intent(inout) :: error
      real(wp) :: n_steps

      self%n = 0
      self%i = 0
      if (.not. fixed_step > 0.0_wp) return
      self%t_first = t_first
      self%t_last = t_last
      n_steps = (t_last - t_first)/fixed_step
      if (n_steps > 1.0e15_wp) then
         call raise(error, 'fixed_step: more than 1e15 steps to t = '//time_text(t_last)//' s')
         return
      end if
      self%n = max(1_i8, ceiling(n_steps*(1.0_wp - 4.0_wp*epsilon(1.0_wp)), i8))
   end subroutine lay

   !> Where the next step ends [s].
   pure real(wp) function next_end(self)
      class(step_grid), intent(in) :: self
      next_end = self%t_last
      if (self%i + 1 < self%n) &
         next_end = self%t_first + (self%t_last - self%t_first)*(real(self%i + 1, wp)/real(self%n, wp))
   end function next_end

end module rodyn_step_grid
