!> Tests of the progress line.
module test_progress
   use rodyn_kinds, only: wp, i8
   use rodyn_errors, only: error_type
   use rodyn_progress, only: progress_monitor, new_progress, progress_line, duration_text
   use test_testing, only: unittest, new_test, check
   implicit none (type, external)
   private
   public :: collect_progress

contains

   subroutine collect_progress(suite)
      type(unittest), allocatable, intent(out) :: suite(:)
      suite = [ &
         new_test('a line tells time, percent, steps and time left', line_complete), &
         new_test('nothing done leaves the time unknown', line_at_start), &
         new_test('durations read as h:mm:ss with days in front', durations), &
         new_test('a log gets no line before its interval is over', log_is_sparse), &
         new_test('a log gets a plain line after its interval', log_line), &
         new_test('a terminal line is rewritten and wiped', terminal_line), &
         new_test('quiet prints nothing', quiet_is_silent)]
   end subroutine collect_progress

   subroutine line_complete(error)
      type(error_type), allocatable, intent(out) :: error
      call check(error, progress_line(2.5_wp, 0.0_wp, 10.0_wp, 34567_i8, 30.0_wp), &
         't = 2.50000 of 10 s, 25.0 %, 34567 steps, 0:01:30 left', 'line')
      if (allocated(error)) return
      call check(error, progress_line(10.0_wp, 0.0_wp, 10.0_wp, 3000000000_i8, 30.0_wp), &
         't = 10.0000 of 10 s, 100.0 %, 3000000000 steps, 0:00:00 left', 'line')
      if (allocated(error)) return
      call check(error, progress_line(0.05_wp, 0.0_wp, 10.0_wp, 7_i8, 1.0_wp), &
         't = 0.500000E-01 of 10 s, 0.5 %, 7 steps, 0:03:19 left', 'line')
   end subroutine line_complete

   subroutine line_at_start(error)
      type(error_type), allocatable, intent(out) :: error
      call check(error, progress_line(0.0_wp, 0.0_wp, 10.0_wp, 0_i8, 0.5_wp), &
         't = 0.00000 of 10 s, 0.0 %, 0 steps, time left unknown', 'line')
   end subroutine line_at_start

   subroutine durations(error)
      type(error_type), allocatable, intent(out) :: error
      call check(error, duration_text(0.4_wp), '0:00:00', 'duration')
      if (allocated(error)) return
      call check(error, duration_text(3599.6_wp), '1:00:00', 'duration')
      if (allocated(error)) return
      call check(error, duration_text(86399.0_wp), '23:59:59', 'duration')
      if (allocated(error)) return
      call check(error, duration_text(2*86400.0_wp + 3*3600.0_wp + 4*60.0_wp + 5.0_wp), '2 d 03:04:05', 'duration')
      if (allocated(error)) return
      call check(error, duration_text(huge(1.0_wp)), 'very long', 'duration')
   end subroutine durations

   !> Bytes a monitor writes for two reports in a row, its clocks set back by `waited` seconds.
   function bytes_written(terminal, quiet, waited) result(bytes)
      logical, intent(in) :: terminal, quiet
      real(wp), intent(in) :: waited !! wall time since the start and the last line [s]
      integer :: bytes
      type(progress_monitor) :: monitor
      integer(i8) :: rate

      monitor = new_progress(0.0_wp, 10.0_wp, quiet)
      call system_clock(count_rate=rate)
      monitor%terminal = terminal
      monitor%clock_start = monitor%clock_start - nint(waited*real(rate, wp), i8)
      monitor%clock_print = monitor%clock_start
      open (newunit=monitor%unit, status='scratch', access='stream', form='formatted', action='readwrite')
      call monitor%report(5.0_wp, 100_i8)
      call monitor%report(5.0_wp, 101_i8)
      call monitor%finish()
      inquire (unit=monitor%unit, size=bytes)
      close (monitor%unit)
   end function bytes_written

   subroutine log_is_sparse(error)
      type(error_type), allocatable, intent(out) :: error
      call check(error, bytes_written(.false., .false., 9.0_wp), 0, 'bytes')
   end subroutine log_is_sparse

   subroutine log_line(error)
      type(error_type), allocatable, intent(out) :: error
      integer :: length
      length = len(progress_line(5.0_wp, 0.0_wp, 10.0_wp, 100_i8, 10.5_wp))
      call check(error, bytes_written(.false., .false., 10.5_wp), length + 1, 'bytes')
   end subroutine log_line

   subroutine terminal_line(error)
      type(error_type), allocatable, intent(out) :: error
      integer :: length
      length = len(progress_line(5.0_wp, 0.0_wp, 10.0_wp, 100_i8, 0.3_wp))
      call check(error, bytes_written(.true., .false., 0.3_wp) >= 2*length + 3, 'line not rewritten')
   end subroutine terminal_line

   subroutine quiet_is_silent(error)
      type(error_type), allocatable, intent(out) :: error
      call check(error, bytes_written(.false., .true., 100.0_wp), 0, 'bytes')
      if (allocated(error)) return
      call check(error, bytes_written(.true., .true., 100.0_wp), 0, 'bytes')
   end subroutine quiet_is_silent

end module test_progress
