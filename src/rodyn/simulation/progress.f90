!> How far a run has come, on standard error: one line that is rewritten on a terminal, plain lines in a log.
module rodyn_progress
   use, intrinsic :: iso_fortran_env, only: error_unit
   use, intrinsic :: iso_c_binding, only: c_int
   use rodyn_kinds, only: wp, i8
   use rodyn_text, only: formatted, time_text
   use rodyn_posix_files, only: is_stop_asked
   use rodyn_integrator, only: monitor_type
   implicit none (type, external)
   private
   public :: progress_monitor, new_progress, progress_line, duration_text, is_terminal

   !> Prints while a run goes on, and stops it after a signal; see `new_progress`.
   type, extends(monitor_type) :: progress_monitor
      real(wp) :: t_start = 0.0_wp, t_end = 1.0_wp !! the whole run [s]
      logical :: quiet = .false.
      logical :: terminal = .false.
      integer :: unit = error_unit
      integer(i8) :: clock_start = 0 !! [counts]
      integer(i8) :: clock_print = 0 !! last line printed [counts]
      integer :: width = 0           !! of the line on the terminal now
   contains
      procedure :: report
      procedure :: finish
      procedure :: stop_requested => signal_came
   end type progress_monitor

   real(wp), parameter :: terminal_interval = 0.2_wp !! wall time between lines [s]
   real(wp), parameter :: log_interval = 10.0_wp     !! wall time between lines [s]

   interface
      !> POSIX: 1 if the descriptor is a terminal.
      integer(c_int) function c_isatty(descriptor) bind(c, name='isatty')
         import :: c_int
         implicit none (type, external)
         integer(c_int), intent(in), value :: descriptor
      end function c_isatty
   end interface

contains

   !> Start the clock.
   function new_progress(t_start, t_end, quiet) result(self)
      real(wp), intent(in) :: t_start, t_end !! the whole run [s]
      logical, intent(in) :: quiet           !! print nothing
      type(progress_monitor) :: self

      self%t_start = t_start
      self%t_end = t_end
      self%quiet = quiet
      self%terminal = is_terminal()
      call system_clock(self%clock_start)
      self%clock_print = self%clock_start
   end function new_progress

   !> Is standard error a terminal?
   logical function is_terminal()
      integer(c_int), parameter :: standard_error = 2_c_int
      is_terminal = c_isatty(standard_error) == 1_c_int
   end function is_terminal

   !> Print, if it is time to.
   subroutine report(self, t, n_steps)
      class(progress_monitor), intent(inout) :: self
      real(wp), intent(in) :: t          !! simulated time reached [s]
      integer(i8), intent(in) :: n_steps !! internal steps so far

      integer(i8) :: now, rate
      integer :: stat
      character(len=:), allocatable :: line

      if (self%quiet) return
      call system_clock(now, rate)
      if (real(now - self%clock_print, wp) < merge(terminal_interval, log_interval, self%terminal)*real(rate, wp)) return
      self%clock_print = now
      line = progress_line(t, self%t_start, self%t_end, n_steps, real(now - self%clock_start, wp)/real(rate, wp))
      if (self%terminal) then
         write (self%unit, '(3a)', advance='no', iostat=stat) achar(13), line, repeat(' ', max(0, self%width - len(line)))
         self%width = len(line)
      else
         write (self%unit, '(a)', iostat=stat) line
      end if
      if (stat == 0) flush (self%unit, iostat=stat)
      self%quiet = stat /= 0 ! nobody reads along any more
   end subroutine report

   !> True after a signal that the program watches.
   function signal_came(self) result(requested)
      class(progress_monitor), intent(in) :: self
      logical :: requested
      associate (unused => self); end associate
      requested = is_stop_asked()
   end function signal_came

   !> Wipe the line from a terminal, so that what follows starts at the margin.
   subroutine finish(self)
      class(progress_monitor), intent(inout) :: self
      integer :: stat
      if (self%quiet .or. .not. self%terminal .or. self%width == 0) return
      write (self%unit, '(3a)', advance='no', iostat=stat) achar(13), repeat(' ', self%width), achar(13)
      if (stat == 0) flush (self%unit, iostat=stat)
      self%quiet = stat /= 0
      self%width = 0
   end subroutine finish

   !> `t = 1.25000 of 10 s, 12.5 %, 34567 steps, 0:01:23 left`
   pure function progress_line(t, t_start, t_end, n_steps, elapsed) result(line)
      real(wp), intent(in) :: t              !! simulated time reached [s]
      real(wp), intent(in) :: t_start, t_end !! the whole run [s]
      integer(i8), intent(in) :: n_steps     !! internal steps so far
      real(wp), intent(in) :: elapsed        !! wall time since the start [s]
      character(len=:), allocatable :: line

      character(len=24) :: steps
      real(wp) :: done

      done = 1.0_wp
      if (t_end > t_start) done = min(1.0_wp, max(0.0_wp, (t - t_start)/(t_end - t_start)))
      write (steps, '(i0)') n_steps
      ! The time keeps its zeros, so that the line does not dance.
      line = 't = '//formatted(t, '(g16.6)')//' of '//time_text(t_end)//' s, '//formatted(100.0_wp*done, '(f8.1)')//' %, ' &
         //trim(steps)//' steps, '
      if (done > 0.0_wp) then
         line = line//duration_text(elapsed*(1.0_wp - done)/done)//' left'
      else
         line = line//'time left unknown'
      end if
   end function progress_line

   !> `h:mm:ss`, with the days in front from one day on: `2 d 03:04:05`. Rounded to seconds.
   pure function duration_text(seconds) result(text)
      real(wp), intent(in) :: seconds !! not negative [s]
      character(len=:), allocatable :: text

      real(wp), parameter :: longest = 1.0e14_wp
      integer(i8) :: total, days, hours
      character(len=40) :: buffer

      if (.not. seconds < longest) then
         text = 'very long'
         return
      end if
      total = nint(max(0.0_wp, seconds), i8)
      days = total/86400
      hours = mod(total, 86400_i8)/3600
      if (days > 0) then
         write (buffer, '(i0, " d ", i2.2, ":", i2.2, ":", i2.2)') days, hours, mod(total, 3600_i8)/60, mod(total, 60_i8)
      else
         write (buffer, '(i0, ":", i2.2, ":", i2.2)') hours, mod(total, 3600_i8)/60, mod(total, 60_i8)
      end if
      text = trim(buffer)
   end function duration_text

end module rodyn_progress
