!> `rodyn sweep --dry-run`: the table of cases, and what they will cost in time and disk.
module rodyn_sweep_forecast
   use rodyn_kinds, only: wp, i8
   use rodyn_errors, only: error_type
   use rodyn_progress, only: duration_text
   use rodyn_lanes, only: lanes
   use rodyn_sweep_case, only: case_result, case_shape, status_done
   use rodyn_sweep_config, only: sweep_config, value_text
   use rodyn_sweep_plan, only: sweep_plan
   use rodyn_sweep_record, only: record_words
   use rodyn_sweep_worker, only: case_feed, lanes_text, run_cases, uses_lanes
   use rodyn_terminal, only: print_line
   use rodyn_text, only: to_text, formatted
   implicit none (type, external)
   private
   public :: print_forecast

   integer, parameter :: most_timed = 5           !! cases that are computed for the estimate
   real(wp), parameter :: most_seconds = 5.0_wp   !! for each of them [s]
   integer, parameter :: most_rows = 10000        !! of the table

   !> Hands out some cases, lets them go on for some seconds, and adds up what they took.
   type, extends(case_feed) :: sample_feed
      integer, allocatable :: cases(:)
      integer :: at = 0, last = 0       !! of the cases: handed out last, to be handed out
      integer(i8) :: clock_start = 0    !! of the one handed out last
      real(wp) :: patience = most_seconds !! [s]
      real(wp) :: total = 0.0_wp        !! wall time of the cases [s]
      integer :: n_kept = 0
      logical :: cut = .false.          !! some were cut short or failed
   contains
      procedure :: poll
      procedure :: next
      procedure :: keep
   end type sample_feed

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
      call print_line(header(sweep))
      do case = 1, plan%n_cases
         if (plan%same_as(case) == case) n_computed = n_computed + 1
         if (case <= most_rows) call print_line(table_row(sweep, plan, case))
      end do
      if (plan%n_cases > most_rows) call print_line('... and '//to_text(plan%n_cases - most_rows)//' more')
      call print_line('')
      call print_line('cases   '//to_text(plan%n_cases)//', '//to_text(n_computed)//' to compute (equal ones once)')
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
      type(sample_feed) :: feed
      integer :: i, n

      n = min(merge(lanes, most_timed, uses_lanes(sweep, plan)), plan%n_cases)
      feed%cases = [(1, i=1, n)]
      if (n > 1) feed%cases = [(1 + nint(real(plan%n_cases - 1, wp)*real(i - 1, wp)/real(n - 1, wp)), i=1, n)]
      if (uses_lanes(sweep, plan)) then
         feed%patience = 2.0_wp*most_seconds
         feed%last = n
         call run_cases(sweep, plan, shape, feed)
      else
         do i = 1, n
            feed%last = i
            feed%clock_start = 0
            call run_cases(sweep, plan, shape, feed)
         end do
      end if
      associate (mean => feed%total/max(1, feed%n_kept), cut => feed%cut)
         call print_line('lanes   '//lanes_text(sweep, plan))
         call print_line('time    about '//duration_text(mean*n_computed)//' on one core'// &
            trim(merge(' or more', '        ', cut))//', by '//to_text(feed%n_kept)//' cases of '// &
            formatted(1000.0_wp*mean, '(f12.3)')//' ms on average'// &
            trim(merge(' (some were cut short or failed)', '                                ', cut)))
      end associate
   end subroutine print_time

   !> Shards and result; states do not compress.
   subroutine print_disk(plan, shape, n_computed)
      type(sweep_plan), intent(in) :: plan
      type(case_shape), intent(in) :: shape
      integer, intent(in) :: n_computed
      real(wp) :: record
      record = 8.0_wp*record_words(shape, status_done, 0)
      call print_line('disk    about '//formatted(1.0e-6_wp*record*n_computed, '(f12.3)')//' MB of shards and '// &
         formatted(1.0e-6_wp*record*plan%n_cases, '(f12.3)')//' MB of sweep.h5')
   end subroutine print_disk

   subroutine poll(self, stop_now)
      class(sample_feed), intent(inout) :: self
      logical, intent(out) :: stop_now
      integer(i8) :: now, rate
      call system_clock(now, rate)
      stop_now = self%clock_start > 0 .and. real(now - self%clock_start, wp) > self%patience*real(rate, wp)
   end subroutine poll

   subroutine next(self, ticket, case)
      class(sample_feed), intent(inout) :: self
      integer, intent(out) :: ticket, case
      ticket = 0
      case = 0
      if (self%at == self%last) return
      self%at = self%at + 1
      ticket = self%at
      case = self%cases(ticket)
      call system_clock(self%clock_start)
   end subroutine next

   subroutine keep(self, ticket, kept, stop_now)
      class(sample_feed), intent(inout) :: self
      integer, intent(in) :: ticket
      type(case_result), intent(inout) :: kept
      logical, intent(out) :: stop_now
      associate (unused => ticket); end associate
      if (kept%status /= status_done) self%cut = .true.
      self%total = self%total + kept%wall_seconds
      self%n_kept = self%n_kept + 1
      stop_now = .false.
   end subroutine keep

end module rodyn_sweep_forecast
