!> One case of a sweep: from its place on the axes to the states that are kept.
!>
!> Whatever goes wrong stays in this case: its states are NaN, and `status`, `message` and `t_reached` say why.
module rodyn_sweep_case
   use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
   use rodyn_kinds, only: wp, i8
   use rodyn_case_config, only: case_config, model_config
   use rodyn_case_reader, only: case_from_document
   use rodyn_errors, only: error_type, raise, exit_bad_input, exit_stopped
   use rodyn_driver, only: driver_type, new_driver
   use rodyn_integrator, only: monitor_type, solver_statistics
   use rodyn_linear_model, only: linear_model
   use rodyn_modes_at_start, only: modes_at_start
   use rodyn_modes, only: mode_set
   use rodyn_motion, only: motion_type, new_motion
   use rodyn_namelist_document, only: namelist_document
   use rodyn_namelist_edit, only: set_value
   use rodyn_quantities, only: row_layout, row_type, fill_row, layout_of, new_row, resized
   use rodyn_rod_profile, only: mean_mass_factors
   use rodyn_run_setup, only: run_setup, new_run_setup
   use rodyn_scene, only: scene_type
   use rodyn_switch_times, only: same_time
   use rodyn_simulation, only: observer_type, listed_times, simulate
   use rodyn_sweep_config, only: sweep_axis, sweep_config, is_ratio, short_value_text
   use rodyn_sweep_plan, only: sweep_plan
   use rodyn_validity, only: validity_type, interval_of_rows, new_validity
   use rodyn_text, only: joined, short_text, with_line_ends
   implicit none (type, external)
   private
   public :: case_result, case_shape, poller_type, keeper_type, build_case, build_values, new_case_shape
   public :: allocate_result, clear_result, make_nan, prepare_case, integrate_case, keep_final, conclude_case
   public :: status_done, status_failed, status_stopped

   integer, parameter :: status_done = 1, status_failed = 2
   integer, parameter :: status_stopped = 3 !! by a signal: no result, to be done again

   !> Sizes that all cases of a sweep have in common.
   type :: case_shape
      integer :: n_modes = 0  !! natural frequencies that are kept
      type(row_layout) :: layout !! of a row of the longest chain, shorter ones end in NaN; empty where nothing is integrated
      integer :: n_probes = 0
      integer :: n_rows = 0   !! of the longest series; 0: no series are kept
      logical :: outputs = .false. !! the states at the n_outputs times are made, whether they are kept or not
   end type case_shape

   !> What is kept of a case. Rows as the layout of `case_shape` says.
   type :: case_result
      integer :: case = 0
      integer :: status = status_stopped
      integer :: attempt = 1                  !! 2, 3, ...: after --retry-failed
      integer(i8) :: n_steps = 0, n_rhs = 0
      real(wp) :: t_reached = 0.0_wp          !! end of the case; of a failed one the last output time before it failed [s]
      real(wp) :: wall_seconds = 0.0_wp       !! whole case
      real(wp) :: integration_seconds = 0.0_wp !! of them, inside the integration
      character(len=:), allocatable :: message
      real(wp), allocatable :: frequency(:)   !! natural frequencies (n_modes) [rad/s]; NaN beyond the last
      real(wp), allocatable :: damping_ratio(:) !! (n_modes)
      real(wp), allocatable :: final(:)       !! (n_values)
      real(wp), allocatable :: probes(:, :)   !! (n_values, n_probes); NaN beyond the end of the case
      real(wp), allocatable :: times(:)       !! (n_rows) [s]; NaN beyond the last row
      real(wp), allocatable :: series(:, :)   !! (n_values, n_rows)
   end type case_result

   !> Someone who is shown about 50 times a second that work goes on, and may want it stopped.
   type, abstract :: poller_type
   contains
      procedure(poll_interface), deferred :: poll
   end type poller_type

   abstract interface
      subroutine poll_interface(self, stop_now)
         import :: poller_type
         implicit none (type, external)
         class(poller_type), intent(inout) :: self
         logical, intent(out) :: stop_now
      end subroutine poll_interface
   end interface

   !> Stops a case that takes too long, or when the poller says so.
   type, extends(monitor_type) :: case_monitor
      class(poller_type), pointer :: poller => null()
      integer(i8) :: clock_start = 0
      real(wp) :: limit = 0.0_wp !! wall time [s]; 0: none
      logical, pointer :: late => null()
   contains
      procedure :: stop_requested
   end type case_monitor

   integer, parameter :: most_judgements = 64 !! of axial forces in a case, about: below 1 % of its time in lanes

   !> Keeps the states that are wanted.
   type, extends(observer_type) :: keeper_type
      type(row_type) :: row                  !! of the case
      type(row_layout) :: layout             !! of the sweep
      integer, allocatable :: probe_of(:)    !! of each time; 0: none
      integer, allocatable :: output_of(:)   !! row of the series of each time; 0: none
      logical :: keep_series = .false.
      integer :: seen = 0                    !! times so far
      real(wp) :: t_end = 0.0_wp             !! of the case [s]
      integer :: n_outputs = 1               !! of the case, intervals from 0 to t_end
      type(validity_type) :: validity
      type(case_result), pointer :: kept => null()
   contains
      procedure :: observe
   end type keeper_type

contains

   !> Sizes of the results of a sweep.
   subroutine new_case_shape(shape, sweep)
      type(case_shape), intent(out) :: shape
      type(sweep_config), intent(in) :: sweep
      type(case_config) :: config !! with the largest of all values
      integer :: a

      config = sweep%base_case
      config%output%ledger = .false.
      shape%n_modes = sweep%frequencies
      shape%outputs = sweep%keep_series
      do a = 1, size(sweep%axes)
         select case (sweep%axes(a)%key)
         case ('chain.n_rods')
            config%chain%n_rods = nint(maxval(sweep%axes(a)%numbers))
         case ('model.bending_shapes')
            config%model%bending_shapes = max(config%model%bending_shapes, nint(maxval(sweep%axes(a)%numbers)))
         case ('case.n_outputs')
            config%n_outputs = nint(maxval(sweep%axes(a)%numbers))
            shape%outputs = .true.
         case default ! changes no size
         end select
      end do
      if (.not. sweep%integrate) then
         shape%layout%n_rods = config%chain%n_rods
         allocate (shape%layout%quantities(0))
         return
      end if
      shape%layout = layout_of(config)
      shape%n_probes = size(sweep%probe_times)
      if (sweep%keep_series) shape%n_rows = config%n_outputs + 1
   end subroutine new_case_shape

   !> The configuration of case number `case`.
   subroutine build_case(sweep, plan, case, config, error)
      type(sweep_config), intent(in) :: sweep
      type(sweep_plan), intent(in) :: plan
      integer, intent(in) :: case
      type(case_config), intent(out) :: config
      type(error_type), allocatable, intent(out) :: error
      call build_values(sweep, plan%rows(case), config, error)
   end subroutine build_case

   !> The configuration with the given row of each dimension; 0: what the base has.
   subroutine build_values(sweep, rows, config, error)
      type(sweep_config), intent(in) :: sweep
      integer, intent(in) :: rows(:) !! (dimensions)
      type(case_config), intent(out) :: config
      type(error_type), allocatable, intent(out) :: error
      integer :: a

      if (all([(is_ratio(sweep%axes(a)), a=1, size(sweep%axes))])) then
         config = sweep%base_case ! nothing to read again
      else
         call read_values(sweep, rows, config, error)
         if (allocated(error)) return
      end if
      do a = 1, size(sweep%axes)
         associate (axis => sweep%axes(a), chain => config%chain)
            if (.not. is_ratio(axis) .or. row_of(axis, rows) == 0) cycle
            chain%node_mass(:) = axis%numbers(rows(axis%dimension))* &
               sum(chain%length*chain%mass_per_length*mean_mass_factors(chain%n_rods, config%profiles))/chain%n_rods
            if (.not. chain%node_mass(1) <= huge(1.0_wp)) call raise(error, '&chain node_mass = Infinity: must be finite', &
                                                                    exit_bad_input)
         end associate
      end do
   end subroutine build_values

   !> The same without mass ratios: keys of the base case set, and all read and checked.
   subroutine read_values(sweep, rows, config, error)
      type(sweep_config), intent(in) :: sweep
      integer, intent(in) :: rows(:) !! (dimensions)
      type(case_config), intent(out) :: config
      type(error_type), allocatable, intent(out) :: error
      type(namelist_document) :: document
      integer :: a

      document = sweep%base_document
      do a = 1, size(sweep%axes)
         associate (axis => sweep%axes(a))
            if (is_ratio(axis) .or. row_of(axis, rows) == 0) cycle
            call set_value(document, trim(axis%key), short_value_text(axis, rows(axis%dimension)), error, &
                           axis%in_list)
            if (allocated(error)) return
            if (axis%key /= 'model.inertia' .or. any(sweep%axes%key == 'model.bending')) cycle
            call follow_inertia(document, sweep%base_case%model, axis%texts(rows(axis%dimension)), error)
            if (allocated(error)) return
         end associate
      end do
      call case_from_document(document, config, error)
   end subroutine read_values

   !> The row of an axis; 0: none.
   pure integer function row_of(axis, rows)
      type(sweep_axis), intent(in) :: axis
      integer, intent(in) :: rows(:) !! (dimensions)
      row_of = 0
      if (axis%dimension > 0) row_of = rows(axis%dimension)
   end function row_of

   !> Rods without inertia cannot swing by themselves: where an axis changes the inertia and none the bending,
   !> 'dynamic' becomes 'quasistatic' for lumped mass, and the reverse for distributed mass. A base with condensed rods keeps them.
   subroutine follow_inertia(document, base, inertia, error)
      type(namelist_document), intent(inout) :: document
      type(model_config), intent(in) :: base
      character(len=*), intent(in) :: inertia !! of the case
      type(error_type), allocatable, intent(out) :: error

      if (inertia == 'lumped' .and. base%bending == 'dynamic') then
         call set_value(document, 'model.bending', "'quasistatic'", error)
      else if (inertia == 'distributed' .and. base%bending == 'quasistatic' .and. base%inertia == 'lumped') then
         call set_value(document, 'model.bending', "'dynamic'", error)
      end if
   end subroutine follow_inertia

   !> Memory for what is kept of a case.
   subroutine allocate_result(kept, shape)
      type(case_result), intent(inout) :: kept
      type(case_shape), intent(in) :: shape
      allocate (kept%frequency(shape%n_modes), kept%damping_ratio(shape%n_modes), kept%final(shape%layout%n_values))
      allocate (kept%probes(shape%layout%n_values, shape%n_probes))
      allocate (kept%times(shape%n_rows), kept%series(shape%layout%n_values, shape%n_rows))
   end subroutine allocate_result

   !> Ready for a case.
   subroutine clear_result(kept, shape, case)
      type(case_result), intent(inout) :: kept
      type(case_shape), intent(in) :: shape
      integer, intent(in) :: case

      if (.not. allocated(kept%final)) call allocate_result(kept, shape)
      kept%case = case
      kept%attempt = 1
      kept%n_steps = 0
      kept%n_rhs = 0
      kept%t_reached = 0.0_wp
      kept%integration_seconds = 0.0_wp
      kept%message = ''
      call make_nan(kept)
   end subroutine clear_result

   subroutine make_nan(kept)
      type(case_result), intent(inout) :: kept
      real(wp) :: nan
      nan = ieee_value(0.0_wp, ieee_quiet_nan)
      kept%frequency = nan
      kept%damping_ratio = nan
      kept%final = nan
      kept%probes = nan
      kept%times = nan
      kept%series = nan
   end subroutine make_nan

   !> Everything about a case that comes before its integration, frequencies among it. `keeper%kept` is the caller's to set.
   subroutine prepare_case(sweep, plan, shape, case, poller, clock_start, setup, times, keeper, driver, late, error)
      type(sweep_config), intent(in) :: sweep
      type(sweep_plan), intent(in) :: plan
      type(case_shape), intent(in) :: shape
      integer, intent(in) :: case
      class(poller_type), target, intent(inout) :: poller
      integer(i8), intent(in) :: clock_start         !! when work on the case began [counts]
      type(run_setup), target, intent(inout) :: setup !! must outlive the driver
      real(wp), allocatable, intent(out) :: times(:) !! at which the keeper wants to see it [s]
      type(keeper_type), intent(inout) :: keeper
      type(driver_type), intent(out) :: driver       !! without a monitor
      logical, target, intent(out) :: late           !! the choice of the method alone took longer than the case may
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(case_monitor), target :: monitor

      late = .false.
      call build_case(sweep, plan, case, config, error)
      if (.not. allocated(error)) call new_run_setup(setup, config, .false., error)
      if (allocated(error)) return
      call merge_times(config, sweep%probe_times, shape%outputs, times, keeper%probe_of, keeper%output_of)
      keeper%layout = shape%layout
      keeper%row = new_row(resized(shape%layout, config%chain%n_rods))
      keeper%validity = new_validity(setup%motion%dynamics%scene, keeper%row%layout, &
                                     interval_of_rows(size(times), most_judgements), config%model%deflection_limit, &
                                     config%model%axial_error_limit)
      if (sweep%frequencies > 0) call keep_frequencies(setup%motion%dynamics%scene, config, &
                                                       sweep%frequencies_at == 'equilibrium', keeper, error)
      if (allocated(error) .or. .not. sweep%integrate) return
      monitor = new_monitor(sweep, poller, clock_start, late)
      call new_driver(driver, setup%motion, setup%y, config%solver, config%t_end, size(times), error, monitor)
      nullify (driver%monitor)
      if (allocated(error)) return
      if (driver%choice%tried) then
         if (monitor%stop_requested()) call raise(error, 'stopped on request at t = 0 s', exit_stopped)
         if (allocated(error)) return
      end if
      keeper%t_end = config%t_end
      keeper%n_outputs = config%n_outputs
      keeper%keep_series = sweep%keep_series
   end subroutine prepare_case

   !> The lowest natural frequencies, rigid bodies and mechanisms left out.
   subroutine keep_frequencies(scene, config, equilibrium, keeper, error)
      type(scene_type), intent(in) :: scene
      type(case_config), intent(in) :: config
      logical, intent(in) :: equilibrium !! at the one near the initial state, under loads; otherwise there, without loads
      type(keeper_type), intent(inout) :: keeper
      type(error_type), allocatable, intent(out) :: error
      type(motion_type) :: motion !! of its own: matrices would stay with the one that is integrated
      type(linear_model) :: model
      type(mode_set) :: modes
      integer, allocatable :: which(:)
      real(wp), allocatable :: frequency(:), ratio(:)
      integer :: n

      call new_motion(motion, scene, .false., error)
      if (.not. allocated(error)) call modes_at_start(motion, config, equilibrium, loads=.false., with_shapes=.false., &
                                                     model=model, modes=modes, error=error)
      if (allocated(error)) return
      which = modes%oscillations()
      frequency = modes%frequency()
      ratio = modes%damping_ratio()
      associate (kept => keeper%kept)
         n = min(size(which), size(kept%frequency))
         kept%frequency(:n) = frequency(which(:n))
         kept%damping_ratio(:n) = ratio(which(:n))
         call keeper%validity%judge_forces(motion%dynamics, 0.0_wp, model%q, model%p, model%acceleration)
         kept%message = with_line_ends(keeper%validity%warnings(), '; ')
      end associate
   end subroutine keep_frequencies

   !> Integrate a prepared case by itself, and keep what is wanted.
   subroutine integrate_case(sweep, driver, setup, times, poller, clock_start, keeper, late, error)
      type(sweep_config), intent(in) :: sweep
      type(driver_type), intent(inout) :: driver !! for this motion
      type(run_setup), target, intent(inout) :: setup
      real(wp), intent(in) :: times(:)          !! at which the keeper wants to see it [s]
      class(poller_type), target, intent(inout) :: poller
      integer(i8), intent(in) :: clock_start    !! when work on the case began [counts]
      type(keeper_type), intent(inout) :: keeper
      logical, target, intent(out) :: late      !! it took longer than it may
      type(error_type), allocatable, intent(out) :: error
      type(case_monitor), target :: monitor
      type(solver_statistics) :: stats
      integer(i8) :: clock_a, clock_b, clock_rate

      late = .false.
      monitor = new_monitor(sweep, poller, clock_start, late)
      call driver%set_monitor(monitor)
      call system_clock(clock_a, clock_rate)
      call simulate(setup%motion, driver, listed_times(times), setup%t_end, keeper, setup%y, keeper%kept%t_reached, error)
      call system_clock(clock_b)
      keeper%kept%integration_seconds = real(clock_b - clock_a, wp)/real(clock_rate, wp)
      stats = driver%statistics()
      keeper%kept%n_steps = stats%n_steps
      keeper%kept%n_rhs = stats%n_rhs
      if (.not. allocated(error)) call keep_final(setup, keeper, error)
      if (.not. allocated(error) .and. len(driver%failures) > 0) keeper%kept%message = &
         with_line_ends(joined(driver%failures, keeper%kept%message, '; '), '; ')
      call driver%finalize()
   end subroutine integrate_case

   !> Keep the state at the end of a case.
   subroutine keep_final(setup, keeper, error)
      class(run_setup), intent(inout) :: setup !! with the state at the end
      type(keeper_type), intent(inout) :: keeper
      type(error_type), allocatable, intent(out) :: error

      if (.not. all(abs(setup%y) <= huge(setup%y))) then
         call raise(error, 'the final state is not finite')
         return
      end if
      call setup%motion%dynamics%move_kinks(setup%t_end)
      call fill_row(setup%motion, setup%t_end, setup%y, 0.0_wp, keeper%row)
      call keeper%validity%observe(keeper%row)
      call keeper%validity%observe_forces(setup%motion, setup%t_end, setup%y)
      keeper%kept%message = with_line_ends(keeper%validity%warnings(), '; ') ! a message has no line ends
      call place(keeper%row, keeper%layout, keeper%kept%final)
   end subroutine keep_final

   !> Status and message of a case that has ended. Nothing that happens to a case is an error of the sweep.
   subroutine conclude_case(sweep, keeper, late, error, kept)
      type(sweep_config), intent(in) :: sweep
      type(keeper_type), intent(in) :: keeper
      logical, intent(in) :: late
      type(error_type), allocatable, intent(in) :: error
      type(case_result), intent(inout) :: kept

      kept%status = status_done
      if (.not. allocated(error)) return
      kept%status = status_failed
      kept%t_reached = last_row(keeper, kept%t_reached)
      kept%message = error%message
      if (late) then
         kept%message = 'case_seconds = '//short_text(sweep%case_seconds)//' s exceeded'
      else if (error%exit_code == exit_stopped) then
         kept%status = status_stopped
      end if
      call make_nan(kept)
   end subroutine conclude_case

   !> Time of the last row a run of this case would have: that of its last output [s].
   pure real(wp) function last_row(keeper, t)
      type(keeper_type), intent(in) :: keeper
      real(wp), intent(in) :: t !! last good time [s]
      integer :: k

      last_row = 0.0_wp
      if (.not. keeper%t_end > 0.0_wp) return ! it failed before it began
      associate (t_end => keeper%t_end, n => keeper%n_outputs)
         if (allocated(keeper%output_of) .and. keeper%keep_series) then
            k = max(1, maxval(keeper%output_of(:keeper%seen))) - 1
         else
            k = min(n, int(t/t_end*n) + 1)
            if (t_end*(real(k, wp)/n) > t) k = k - 1
            if (t_end*(real(k, wp)/n) > t) k = k - 1
         end if
         last_row = t_end*(real(k, wp)/n)
      end associate
   end function last_row

   !> The times at which states are wanted, in order: probes up to the end of the case, and outputs.
   subroutine merge_times(config, probe_times, outputs, times, probe_of, output_of)
      type(case_config), intent(in) :: config
      real(wp), intent(in) :: probe_times(:) !! increasing
      logical, intent(in) :: outputs
      real(wp), allocatable, intent(out) :: times(:)
      integer, allocatable, intent(out) :: probe_of(:), output_of(:) !! of each time; 0: none
      real(wp) :: next_probe, next_output
      integer :: n, p, k, n_probes, n_outputs

      n_probes = count(probe_times <= config%t_end .or. same_time(probe_times, config%t_end))
      n_outputs = merge(config%n_outputs + 1, 0, outputs)
      allocate (times(n_probes + n_outputs))
      allocate (probe_of(size(times)), output_of(size(times)), source=0)
      p = 1
      k = 1
      n = 0
      do while (p <= n_probes .or. k <= n_outputs)
         next_probe = huge(1.0_wp)
         next_output = huge(1.0_wp)
         if (p <= n_probes) next_probe = min(probe_times(p), config%t_end)
         if (k <= n_outputs) next_output = config%t_end*(real(k - 1, wp)/config%n_outputs)
         n = n + 1
         times(n) = min(next_probe, next_output)
         if (next_probe <= times(n)) then
            probe_of(n) = p
            p = p + 1
         end if
         if (next_output <= times(n)) then
            output_of(n) = k
            k = k + 1
         end if
      end do
      times = times(:n)
      probe_of = probe_of(:n)
      output_of = output_of(:n)
   end subroutine merge_times

   !> Keep the state at a time, if it is to be kept.
   subroutine observe(self, motion, t, y, error)
      class(keeper_type), intent(inout) :: self
      type(motion_type), intent(inout) :: motion
      real(wp), intent(in) :: t
      real(wp), intent(in) :: y(:)
      type(error_type), allocatable, intent(out) :: error
      integer :: probe, output

      if (.not. all(abs(y) <= huge(y))) then
         call raise(error, 'the state is not finite')
         return
      end if
      self%seen = self%seen + 1
      probe = self%probe_of(self%seen)
      output = self%output_of(self%seen)
      if (probe == 0 .and. .not. self%keep_series) return
      call fill_row(motion, t, y, 0.0_wp, self%row)
      call self%validity%observe(self%row)
      call self%validity%observe_forces(motion, t, y)
      if (probe > 0) call place(self%row, self%layout, self%kept%probes(:, probe))
      if (output == 0 .or. .not. self%keep_series) return
      self%kept%times(output) = t
      call place(self%row, self%layout, self%kept%series(:, output))
   end subroutine observe

   !> A row of a case among those of the sweep.
   pure subroutine place(row, layout, values)
      type(row_type), intent(in) :: row
      type(row_layout), intent(in) :: layout !! of the sweep: the same quantities, of as many rods or more
      real(wp), intent(inout) :: values(:)   !! what the row has not is left as it is
      integer :: i

      do i = 1, size(layout%quantities)
         associate (from => row%layout%quantities(i), first => layout%quantities(i)%first)
            values(first:first + from%last - from%first) = row%values(from%first:from%last)
         end associate
      end do
   end subroutine place

   function new_monitor(sweep, poller, clock_start, late) result(monitor)
      type(sweep_config), intent(in) :: sweep
      class(poller_type), target, intent(inout) :: poller
      integer(i8), intent(in) :: clock_start
      logical, target, intent(inout) :: late
      type(case_monitor) :: monitor
      monitor%poller => poller
      monitor%clock_start = clock_start
      monitor%limit = sweep%case_seconds
      monitor%late => late
   end function new_monitor

   !> Has someone asked the sweep to stop, or has this case used up its wall time?
   function stop_requested(self) result(requested)
      class(case_monitor), intent(in) :: self
      logical :: requested
      integer(i8) :: now, rate

      call self%poller%poll(requested)
      if (requested .or. .not. self%limit > 0.0_wp) return
      call system_clock(now, rate)
      requested = real(now - self%clock_start, wp) > self%limit*real(rate, wp)
      self%late = requested
   end function stop_requested

end module rodyn_sweep_case
