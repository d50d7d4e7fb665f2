!> Times integrations for bench/work_precision/run.py: reads jobs from standard input, answers each with one line of JSON.
!>
!> A job is a namelist group on one line; what is left out keeps its default:
!>
!>     &job method = 'dop853', scene = 'table1.nml', rtol = 1e-8, atol = 1e-10, probe_times = 0.5, 1.0 /
!>     &job method = 'rhs', scene = 'table1.nml' /
!>     &job method = 'names' /
!>
!> Timed is the integration alone, from a made scene to the last probe time: no start-up, no reading, no file. `repeats` runs
!> follow each other and the fastest counts. The times leave out only what the reader of a result would not wait for twice.
module rodyn_bench_jobs
   use rodyn_kinds, only: wp, i8
   use rodyn_errors, only: error_type
   use rodyn_integrator, only: monitor_type
   use rodyn_motion, only: motion_type
   use rodyn_simulation, only: observer_type
   implicit none (type, external)
   private
   public :: budget_monitor, probe_recorder, text_length, most_probes

   integer, parameter :: text_length = 1024, most_probes = 64

   !> Stops a run that takes too long.
   type, extends(monitor_type) :: budget_monitor
      integer(i8) :: deadline = huge(1_i8) !! [clock counts]
   contains
      procedure :: report
      procedure :: stop_requested
   end type budget_monitor

   !> Keeps what errors are measured of.
   type, extends(observer_type) :: probe_recorder
      integer :: n_seen = 0
      real(wp), allocatable :: phi(:, :)        !! (n, probe) [rad]
      real(wp), allocatable :: alpha_rate(:, :) !! (n or 0, probe) [rad/s]
      real(wp), allocatable :: node(:, :)       !! x and y of nodes 1..n along the moving axes, from hinge 0 (2 n, probe) [m]
      real(wp), allocatable :: spacecraft(:, :) !! its displacement and rotation (3 or 0, probe) [m, rad]
   contains
      procedure :: observe
   end type probe_recorder

contains

   subroutine report(self, t, n_steps)
      class(budget_monitor), intent(inout) :: self
      real(wp), intent(in) :: t
      integer(i8), intent(in) :: n_steps
      associate (unused => self, unused_t => t, unused_steps => n_steps); end associate
   end subroutine report

   function stop_requested(self) result(requested)
      class(budget_monitor), intent(in) :: self
      logical :: requested
      integer(i8) :: now
      call system_clock(now)
      requested = now > self%deadline
   end function stop_requested

   subroutine observe(self, motion, t, y, error)
      class(probe_recorder), intent(inout) :: self
      type(motion_type), intent(inout) :: motion
      real(wp), intent(in) :: t
      real(wp), intent(in) :: y(:)
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: place(2)
      integer :: first, k

      associate (unused => t, unused_error => error); end associate
      self%n_seen = self%n_seen + 1
      associate (scene => motion%dynamics%scene, phi => self%phi(:, self%n_seen))
         phi = y(scene%phi_at() + 1:scene%phi_at() + scene%n)
         self%spacecraft(:, self%n_seen) = y(:scene%n_base)
         place = 0.0_wp
         do k = 1, scene%n
            place = place + scene%chord(k, y(:motion%n_q))*[cos(phi(k)), sin(phi(k))]
            self%node(2*k - 1:2*k, self%n_seen) = place
         end do
         if (.not. scene%dynamic_bending) return
         first = motion%n_q + scene%alpha_at()
         self%alpha_rate(:, self%n_seen) = y(first + 1:first + scene%n)
      end associate
   end subroutine observe

end module rodyn_bench_jobs

program bench_work_precision
   use, intrinsic :: iso_fortran_env, only: compiler_options, compiler_version, output_unit
   use rodyn_kinds, only: wp, i8
   use rodyn_errors, only: error_type
   use rodyn_case_config, only: case_config
   use rodyn_case_reader, only: read_case
   use rodyn_scene, only: scene_type, new_scene
   use rodyn_motion, only: motion_type, new_motion, initial_state
   use rodyn_methods, only: methods
   use rodyn_integrator, only: integrator_type, solver_options, solver_statistics
   use rodyn_integrators, only: new_integrator
   use rodyn_simulation, only: listed_times, simulate
   use rodyn_bench_jobs, only: budget_monitor, probe_recorder, text_length, most_probes
   implicit none (type, external)

   character(len=text_length) :: scene, method
   integer :: order, repeats
   real(wp) :: rtol, atol, fixed_step, budget, hinge_factor, probe_times(most_probes)
   namelist /job/ scene, method, order, repeats, rtol, atol, fixed_step, budget, hinge_factor, probe_times
   type(error_type), allocatable :: error
   character(len=text_length) :: line
   integer :: status

   do
      read (*, '(a)', iostat=status) line
      if (status /= 0) exit
      call set_defaults()
      read (line, nml=job, iostat=status)
      if (status /= 0) then
         call answer_failure('job not understood: '//trim(line))
      else if (method == 'names') then
         call answer_names()
      else if (method == 'rhs') then
         call time_rhs(error)
         if (allocated(error)) call answer_failure(error%message)
      else
         call time_integration(error)
         if (allocated(error)) call answer_failure(error%message)
      end if
      flush (output_unit)
   end do

contains

   subroutine set_defaults()
      scene = ''
      method = ''
      order = 0
      repeats = 1
      rtol = 1.0e-8_wp
      atol = 1.0e-10_wp
      fixed_step = 0.0_wp
      budget = 60.0_wp
      hinge_factor = 1.0_wp
      probe_times = -1.0_wp
   end subroutine set_defaults

   !> A scene ready to be integrated, and its state at t = 0.
   subroutine prepare(config, motion, y, error)
      type(case_config), intent(out) :: config
      type(motion_type), intent(out) :: motion
      real(wp), allocatable, intent(out) :: y(:)
      type(error_type), allocatable, intent(out) :: error
      type(scene_type) :: compiled

      call read_case(trim(scene), config, error=error)
      if (allocated(error)) return
      config%chain%hinge_stiffness = hinge_factor*config%chain%hinge_stiffness
      call new_scene(compiled, config, error)
      if (allocated(error)) return
      call new_motion(motion, compiled, .false., error)
      if (allocated(error)) return
      call initial_state(motion, config%initial, y)
   end subroutine prepare

   !> The same run `repeats` times; none starts when the time is up.
   subroutine time_integration(error)
      type(error_type), allocatable, intent(out) :: error
      class(integrator_type), allocatable :: integrator
      type(case_config) :: config
      type(motion_type), target :: motion
      type(probe_recorder) :: recorder
      type(budget_monitor), target :: monitor
      type(solver_options) :: options
      type(solver_statistics) :: counts
      real(wp), allocatable :: y0(:), y(:), times(:)
      real(wp) :: t, seconds
      integer(i8) :: start, finish, rate
      integer :: i

      call prepare(config, motion, y0, error)
      if (allocated(error)) return
      times = pack(probe_times, probe_times >= 0.0_wp)
      options%rtol = rtol
      options%atol = atol
      options%order = order
      options%fixed_step = fixed_step
      allocate (recorder%phi(motion%dynamics%scene%n, size(times)))
      allocate (recorder%alpha_rate(merge(motion%dynamics%scene%n, 0, motion%dynamics%scene%dynamic_bending), size(times)))
      allocate (recorder%node(2*motion%dynamics%scene%n, size(times)))
      allocate (recorder%spacecraft(motion%dynamics%scene%n_base, size(times)))
      call system_clock(start, rate)
      monitor%deadline = start + int(budget*real(rate, wp), i8)
      seconds = huge(1.0_wp)
      do i = 1, repeats
         y = y0
         recorder%n_seen = 0
         call system_clock(start)
         if (i > 1 .and. start > monitor%deadline) exit
         call new_integrator(integrator, motion, trim(method), options, error)
         if (allocated(error)) return
         call integrator%set_monitor(monitor)
         call simulate(motion, integrator, listed_times(times), maxval(times), recorder, y, t, error)
         call system_clock(finish)
         counts = integrator%statistics()
         call integrator%finalize()
         if (allocated(error) .and. i == 1) return
         if (allocated(error)) exit
         seconds = min(seconds, real(finish - start, wp)/real(rate, wp))
      end do
      if (allocated(error)) deallocate (error)
      write (*, '(a, es13.6, 2(a, i0), a)', advance='no') '{"status": "done", "seconds": ', seconds, ', "n_rhs": ', &
         counts%n_rhs, ', "n_steps": ', counts%n_steps, ', "phi": '
      call write_table(recorder%phi)
      write (*, '(a)', advance='no') ', "alpha_rate": '
      call write_table(recorder%alpha_rate)
      write (*, '(a)', advance='no') ', "node": '
      call write_table(recorder%node)
      write (*, '(a)', advance='no') ', "spacecraft": '
      call write_table(recorder%spacecraft)
      write (*, '(a)') '}'
   end subroutine time_integration

   !> Seconds of one right-hand side, each call starting from a state that depends on the call before; and p' at t = 0.
   subroutine time_rhs(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(motion_type) :: motion
      real(wp), allocatable :: y0(:), y(:), ydot(:), first(:)
      real(wp) :: seconds
      integer(i8) :: start, finish, rate
      integer :: i, j, n_calls
      logical :: ok

      call prepare(config, motion, y0, error)
      if (allocated(error)) return
      call motion%dynamics%set_regime(0.0_wp, config%t_end)
      allocate (ydot(size(y0)))
      call motion%rhs(0.0_wp, y0, ydot, ok)
      first = ydot
      y = y0
      n_calls = max(10, 100000/motion%dynamics%scene%n)
      seconds = huge(1.0_wp)
      do i = 1, max(repeats, 3)
         call system_clock(start, rate)
         do j = 1, n_calls
            call motion%rhs(0.0_wp, y, ydot, ok)
            y(1) = y0(1) + 1.0e-12_wp*ydot(size(ydot))
         end do
         call system_clock(finish)
         seconds = min(seconds, real(finish - start, wp)/real(rate, wp)/n_calls)
      end do
      write (*, '(a, es13.6, a)', advance='no') '{"status": "done", "seconds": ', seconds, ', "rates": '
      call write_list(first(motion%n_q + 1:))
      write (*, '(a)') '}'
   end subroutine time_rhs

   subroutine answer_names()
      integer :: i
      write (*, '(a)', advance='no') '{"status": "done", "names": ['
      do i = 1, size(methods)
         if (i > 1) write (*, '(a)', advance='no') ', '
         write (*, '(3a)', advance='no') '"', trim(methods(i)%name), '"'
      end do
      write (*, '(5a)') '], "compiler": "', compiler_version(), '", "compiler_options": "', compiler_options(), '"}'
   end subroutine answer_names

   subroutine answer_failure(message)
      character(len=*), intent(in) :: message
      character(len=len(message)) :: plain
      integer :: i
      plain = message
      do i = 1, len(plain)
         if (scan(plain(i:i), '"\') > 0 .or. iachar(plain(i:i)) < 32) plain(i:i) = ' '
      end do
      write (*, '(3a)') '{"status": "failed", "message": "', trim(plain), '"}'
   end subroutine answer_failure

   !> A row a column of Fortran's.
   subroutine write_table(values)
      real(wp), intent(in) :: values(:, :)
      integer :: j
      write (*, '(a)', advance='no') '['
      do j = 1, size(values, 2)
         if (j > 1) write (*, '(a)', advance='no') ', '
         call write_list(values(:, j))
      end do
      write (*, '(a)', advance='no') ']'
   end subroutine write_table

   subroutine write_list(values)
      real(wp), intent(in) :: values(:)
      integer :: i
      write (*, '(a)', advance='no') '['
      do i = 1, size(values)
         if (i > 1) write (*, '(a)', advance='no') ', '
         write (*, '(es24.16e3)', advance='no') values(i)
      end do
      write (*, '(a)', advance='no') ']'
   end subroutine write_list

end program bench_work_precision
