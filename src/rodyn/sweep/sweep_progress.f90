!> How far a sweep has come: a line that is rewritten on a terminal, plain lines in a log, and a status file.
module rodyn_sweep_progress
   use rodyn_kinds, only: wp, i8
   use rodyn_posix, only: host_name, process_id, utc_now
   use rodyn_posix_files, only: write_text_file
   use rodyn_progress, only: duration_text, is_terminal
   use rodyn_terminal, only: print_error_line, print_error_text
   use rodyn_text, only: to_text, formatted
   implicit none (type, external)
   private
   public :: sweep_progress, sweep_counts

   !> Cases by what has become of them.
   type :: sweep_counts
      integer :: total = 0      !! to be computed, equal cases once
      integer :: done = 0, failed = 0
      integer :: before = 0     !! of these, found on the disk at the start
   end type sweep_counts

   type :: sweep_progress
      character(len=:), allocatable :: status_path !! empty: no file
      logical :: quiet = .false.
      logical :: terminal = .false.
      integer(i8) :: clock_start = 0, clock_line = 0, clock_file = 0
      integer :: width = 0 !! of the line on the terminal now
   contains
      procedure :: start
      procedure :: show
      procedure :: finish
   end type sweep_progress

   real(wp), parameter :: terminal_interval = 0.2_wp, log_interval = 10.0_wp, file_interval = 2.0_wp !! wall time [s]

contains

   subroutine start(self, status_path, quiet)
      class(sweep_progress), intent(out) :: self
      character(len=*), intent(in) :: status_path
      logical, intent(in) :: quiet
      self%status_path = status_path
      self%quiet = quiet
      self%terminal = is_terminal()
      call system_clock(self%clock_start)
      self%clock_line = self%clock_start
      self%clock_file = self%clock_start
   end subroutine start

   !> Print and write what is due.
   subroutine show(self, counts)
      class(sweep_progress), intent(inout) :: self
      type(sweep_counts), intent(in) :: counts
      character(len=:), allocatable :: line
      integer(i8) :: now, rate

      call system_clock(now, rate)
      if (seconds(self%clock_file) >= file_interval) then
         self%clock_file = now
         call write_status(self, 'running', counts, seconds(self%clock_start))
      end if
      if (self%quiet .or. seconds(self%clock_line) < merge(terminal_interval, log_interval, self%terminal)) return
      self%clock_line = now
      line = sweep_line(counts, seconds(self%clock_start))
      if (self%terminal) then
         line = bar(counts)//' '//line
         call print_error_text(achar(13)//line//repeat(' ', max(0, self%width - len(line))))
         self%width = len(line)
      else
         call print_error_line(line)
      end if

   contains

      real(wp) function seconds(since)
         integer(i8), intent(in) :: since
         seconds = real(now - since, wp)/real(rate, wp)
      end function seconds

   end subroutine show

   !> Clear the line and write the last status.
   subroutine finish(self, state, counts)
      class(sweep_progress), intent(inout) :: self
      character(len=*), intent(in) :: state !! 'done', 'failed', 'stopped', 'incomplete'
      type(sweep_counts), intent(in) :: counts
      integer(i8) :: now, rate

      call system_clock(now, rate)
      call write_status(self, state, counts, real(now - self%clock_start, wp)/real(rate, wp))
      if (self%quiet .or. self%width == 0) return
      call print_error_text(achar(13)//repeat(' ', self%width)//achar(13))
      self%width = 0
   end subroutine finish

   !> `123 of 500 cases, 24.6 %, 2 failed, 0:01:23 left`
   pure function sweep_line(counts, elapsed) result(line)
      type(sweep_counts), intent(in) :: counts
      real(wp), intent(in) :: elapsed !! since the start of this run [s]
      character(len=:), allocatable :: line
      integer :: ended

      ended = counts%done + counts%failed
      line = to_text(ended)//' of '//to_text(counts%total)//' cases, '// &
             formatted(100.0_wp*real(ended, wp)/real(max(1, counts%total), wp), '(f8.1)')//' %, '// &
             to_text(counts%failed)//' failed, '//left(counts, elapsed)//' left'
   end function sweep_line

   !> Time that the cases of this run took, applied to those that are missing.
   pure function left(counts, elapsed) result(text)
      type(sweep_counts), intent(in) :: counts
      real(wp), intent(in) :: elapsed
      character(len=:), allocatable :: text
      integer :: ended, now

      ended = counts%done + counts%failed
      now = ended - counts%before
      text = 'unknown time'
      if (now > 0) text = duration_text(elapsed*real(counts%total - ended, wp)/real(now, wp))
      if (ended == counts%total) text = duration_text(0.0_wp)
   end function left

   !> `[#####---------------]`
   pure function bar(counts) result(text)
      type(sweep_counts), intent(in) :: counts
      character(len=22) :: text
      integer :: filled
      filled = int(20.0_wp*real(counts%done + counts%failed, wp)/real(max(1, counts%total), wp))
      text = '['//repeat('#', filled)//repeat('-', 20 - filled)//']'
   end function bar

   !> Replace the status file. That it cannot be written is no reason to stop.
   subroutine write_status(self, state, counts, elapsed)
      class(sweep_progress), intent(in) :: self
      character(len=*), intent(in) :: state
      type(sweep_counts), intent(in) :: counts
      real(wp), intent(in) :: elapsed
      character(len=1), parameter :: nl = new_line('a')
      character(len=:), allocatable :: failure

      if (len(self%status_path) == 0) return
      failure = write_text_file(self%status_path, &
         'state = '//state//nl// &
         'cases = '//to_text(counts%total)//nl// &
         'done = '//to_text(counts%done)//nl// &
         'failed = '//to_text(counts%failed)//nl// &
         'missing = '//to_text(counts%total - counts%done - counts%failed)//nl// &
         'elapsed = '//duration_text(elapsed)//nl// &
         'left = '//left(counts, elapsed)//nl// &
         'updated = '//utc_now()//nl// &
         'process = '//host_name()//' '//to_text(process_id())//nl)
   end subroutine write_status

end module rodyn_sweep_progress
