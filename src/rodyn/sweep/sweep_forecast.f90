!> `rodyn sweep --dry-run`: the table of cases, and what they will cost in time and disk.
module rodyn_sweep_forecast
   use, intrinsic :: iso_fortran_env, only: output_unit
   use rodyn_kinds, only: wp, i8
   use rodyn_errors, only: error_type
   use rodyn_progress, only: duration_text
   use rodyn_sweep_case, only: case_result, case_shape, pulse_type, run_sweep_case, status_done
   use rodyn_sweep_config, only: sweep_config, value_text
   use rodyn_sweep_plan, only: sweep_plan
   use rodyn_sweep_record, only: record_words
   use rodyn_text, only: to_text
   implicit none (type, external)
   private
   public :: print_forecast

   integer, parameter :: most_timed = 5           !! cases that are computed for the estimate
   real(wp), parameter :: most_seconds = 5.0_wp   !! for each of them [s]
   integer, parameter :: most_rows = 10000        !! of the table

   !> Lets a case go on for some seconds.
   type, extends(pulse_type) :: patience
      integer(i8) :: clock_start = 0
   contains
      procedure :: beat
   end type patience

contains

   !> Print everything.
   subroutine print_forecast(sweep, plan, shape, error)
      type(sweep_config), intent(in) :: sweep
      type(sweep_plan), intent(in) :: plan
      type(case_shape), intent(in) :: shape
      type(error_type), allocatable, intent(out) :: error
      integer :: case, n_computed

      associate (unused => error); end associate
      n_computed = 0
      write (output_unit, '(a)') header(sweep)
      do case = 1, plan%n_cases
         if (plan%same_as(case) == case) n_computed = n_computed + 1
         if (case <= most_rows) write (output_unit, '(a)') table_row(sweep, plan, case)
      end do
      if (plan%n_cases > most_rows) write (output_unit, '(a)') '... and '//to_text(plan%n_cases - most_rows)//' more'
      write (output_unit, '(a)') ''
      write (output_unit, '(a)') 'cases   '//to_text(plan%n_cases)//', '//to_text(n_computed)//' to compute (equal ones once)'
      call print_time(sweep, plan, shape, n_computed)
      call print_disk(plan, shape, n_computed)
   end subroutine print_forecast

   function header(sweep) result(line)
      type(sweep_config), intent(in) :: sweep
      character(len=:), allocatable :: line
      integer :: a
      line = '    case'
      do a = 1, size(sweep%axes)
         line = line//'  '//cell(trim(sweep%axes(a)%key))
      end do
   end function header

   function table_row(sweep, plan, case) result(line)
      type(sweep_config), intent(in) :: sweep
      type(sweep_plan), intent(in) :: plan
      integer, intent(in) :: case
      character(len=:), allocatable :: line
      character(len=8) :: number
      character(len=24) :: short
      integer :: rows(size(plan%dimensions))
      integer :: a

      rows = plan%rows(case)
      write (number, '(i8)') case
      line = number
      do a = 1, size(sweep%axes)
         associate (axis => sweep%axes(a))
            if (axis%textual .or. axis%whole) then
               line = line//'  '//cell(value_text(axis, rows(axis%dimension)))
            else
               write (short, '(g0.8)') axis%numbers(rows(axis%dimension))
               line = line//'  '//cell(trim(short))
            end if
         end associate
      end do
      if (plan%same_as(case) /= case) line = line//'  same as case '//to_text(plan%same_as(case))
   end function table_row

   !> Text, right-aligned.
   pure function cell(text) result(wide)
      character(len=*), intent(in) :: text
      character(len=:), allocatable :: wide
      wide = repeat(' ', max(0, 16 - len(text)))//text
   end function cell

   !> Compute a few cases, or the beginnings of them, and take the mean for all.
   subroutine print_time(sweep, plan, shape, n_computed)
      type(sweep_config), intent(in) :: sweep
      type(sweep_plan), intent(in) :: plan
      type(case_shape), intent(in) :: shape
      integer, intent(in) :: n_computed
      type(patience), target :: pulse
      type(case_result), target :: kept
      real(wp) :: total
      integer :: case, i, n
      logical :: cut

      n = min(most_timed, plan%n_cases)
      total = 0.0_wp
      cut = .false.
      do i = 1, n
         case = 1
         if (n > 1) case = 1 + nint(real(plan%n_cases - 1, wp)*real(i - 1, wp)/real(n - 1, wp))
         call system_clock(pulse%clock_start)
         call run_sweep_case(sweep, plan, shape, case, pulse, kept)
         if (kept%status /= status_done) cut = .true.
         total = total + kept%wall_seconds
      end do
      write (output_unit, '(a)') 'time    about '//duration_text(total/n*n_computed)//' on one core'// &
         trim(merge(' or more', '        ', cut))//', by '//to_text(n)//' cases of '//short_number(1000.0_wp*total/n)// &
         ' ms on average'//trim(merge(' (some were cut short or failed)', '                                ', cut))
   end subroutine print_time

   !> Shards and result; states do not compress.
   subroutine print_disk(plan, shape, n_computed)
      type(sweep_plan), intent(in) :: plan
      type(case_shape), intent(in) :: shape
      integer, intent(in) :: n_computed
      real(wp) :: record
      record = 8.0_wp*record_words(shape, status_done, 0)
      write (output_unit, '(a)') 'disk    about '//short_number(1.0e-6_wp*record*n_computed)//' MB of shards and '// &
         short_number(1.0e-6_wp*record*plan%n_cases)//' MB of sweep.h5'
   end subroutine print_disk

   pure function short_number(x) result(text)
      real(wp), intent(in) :: x
      character(len=:), allocatable :: text
      character(len=16) :: digits
      write (digits, '(f12.3)') x
      text = trim(adjustl(digits))
   end function short_number

   subroutine beat(self, stop_now)
      class(patience), intent(inout) :: self
      logical, intent(out) :: stop_now
      integer(i8) :: now, rate
      call system_clock(now, rate)
      stop_now = real(now - self%clock_start, wp) > most_seconds*real(rate, wp)
   end subroutine beat

end module rodyn_sweep_forecast
