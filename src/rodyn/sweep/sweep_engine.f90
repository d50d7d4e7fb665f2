!> `rodyn sweep`: who computes which case, and what is reported of it.
!>
!> All ways of sharing the work (one process, ranks of MPI, shards of a job array, any of them stopped and started again)
!> leave the same shards but for their cut, and so the same `sweep.h5`.
module rodyn_sweep_engine
   use rodyn_kinds, only: wp, i8
   use rodyn_errors, only: error_type, raise, exit_bad_input, exit_done, exit_failed, exit_stopped
   use rodyn_input_texts, only: input_texts, new_input_texts, read_input_texts
   use rodyn_lanes, only: lanes
   use rodyn_lapack, only: use_one_thread
   use rodyn_posix, only: ignore_signal, path_exists, sigxfsz
   use rodyn_posix_files, only: stop_signal, watch_signals, write_text_file
   use rodyn_run_needs, only: check_memory, memory_of_scene, of_program
   use rodyn_sweep_case, only: allocate_result, case_result, case_shape, new_case_shape, status_done, status_failed, status_stopped
   use rodyn_sweep_config, only: sweep_config
   use rodyn_sweep_directory, only: sweep_directory, result_name
   use rodyn_sweep_forecast, only: print_forecast
   use rodyn_sweep_index, only: sweep_index
   use rodyn_sweep_plan, only: sweep_plan, new_plan, plan_text
   use rodyn_sweep_progress, only: sweep_counts, sweep_progress
   use rodyn_sweep_ranks, only: rank_group, at_done, at_errors, at_failed, at_next, at_stopped
   use rodyn_sweep_reader, only: parse_sweep
   use rodyn_sweep_result, only: result_is_sound, write_result
   use rodyn_sweep_worker, only: case_feed, lanes_text, run_cases, uses_lanes
   use rodyn_sweep_writer, only: shard_writer
   use rodyn_terminal, only: print_error_line, print_line
   use rodyn_text, only: as_utf8, formatted, to_text, with_line_ends
   implicit none (type, external)
   private
   public :: run_sweep, sweep_options

   !> The command line
   type :: sweep_options
      character(len=:), allocatable :: file   !! the one positional argument
      character(len=:), allocatable :: output !! --output
      integer :: shard = 0, n_shards = 0 !! --shard I/N; 0, 0: all cases
      logical :: dry_run = .false., retry_failed = .false., force = .false., quiet = .false.
   end type sweep_options

   !> Everything that one process knows of its sweep.
   type :: engine_type
      type(sweep_options) :: options
      type(rank_group) :: ranks
      type(sweep_config) :: sweep
      type(sweep_plan) :: plan
      type(case_shape) :: shape
      type(sweep_directory) :: directory
      type(sweep_counts) :: counts             !! this process's share; with ranks, of all
      type(sweep_progress) :: progress         !! of the first rank
      type(shard_writer) :: writer
      character(len=:), allocatable :: tag     !! of this process
      integer, allocatable :: todo(:)          !! cases without a result
      integer, allocatable :: attempt(:)       !! of each of them
      integer :: next_number = 1               !! of shards
      integer :: mine_done = 0, mine_failed = 0 !! results not yet in the shared counters
      logical :: stopped = .false.
   end type engine_type

   !> Hands out what is to be computed, takes the results, and looks around meanwhile.
   type, extends(case_feed) :: engine_feed
      type(engine_type), pointer :: engine => null()
      integer :: chunk = 1                     !! cases that are fetched at once
      integer :: at = 0, last = 0              !! of the fetched ones: the one handed out last, the last
      logical :: ended = .false.               !! none can be fetched
      type(error_type), allocatable :: error   !! results could not be written
   contains
      procedure :: poll
      procedure :: next
      procedure :: keep
   end type engine_feed

   character(len=1), parameter :: nl = new_line('a')

contains

   !> Do what the command line says. `error` is allocated on the first rank only; `exit_code` on all.
   subroutine run_sweep(options, exit_code, error)
      type(sweep_options), intent(in) :: options
      integer, intent(out) :: exit_code
      type(error_type), allocatable, intent(out) :: error
      type(engine_type), target :: engine

      engine%options = options
      call use_one_thread()
      call engine%ranks%start()
      call sweep_in_order(engine, exit_code, error)
      if (allocated(error)) exit_code = error%exit_code
      if (allocated(error) .and. engine%ranks%rank > 0) deallocate (error)
      call engine%ranks%finish()
   end subroutine run_sweep

   !> Read, look at what is there, compute, merge.
   subroutine sweep_in_order(engine, exit_code, error)
      type(engine_type), target, intent(inout) :: engine
      integer, intent(out) :: exit_code
      type(error_type), allocatable, intent(out) :: error

      exit_code = exit_done
      call read_input(engine, error)
      if (allocated(error)) return
      if (engine%options%dry_run) then
         if (engine%ranks%rank == 0) call print_forecast(engine%sweep, engine%plan, engine%shape, error)
         return
      end if
      call watch_signals()
      call ignore_signal(sigxfsz)
      call open_sweep(engine, error)
      if (allocated(error)) return
      call compute(engine, error)
      call engine%ranks%wait_for_all()
      if (engine%ranks%rank > 0) then
         call agree_on_end(engine, exit_code, error)
         return
      end if
      engine%stopped = engine%ranks%add(at_stopped, 0) > 0
      if (.not. allocated(error) .and. engine%ranks%add(at_errors, 0) > 0) &
         call raise(error, engine%directory%path//': a rank failed (see above); run again to resume')
      if (allocated(error)) then
         call engine%progress%finish('incomplete', engine%counts)
      else if (engine%stopped) then
         call engine%progress%finish('stopped', engine%counts)
         call raise(error, 'stopped by '//signal_of_stop()//': '//to_text(engine%counts%done + engine%counts%failed)//' of '// &
                    to_text(engine%counts%total)//' cases are on the disk, in '//engine%directory%path// &
                    '; run the same command again to resume', exit_stopped)
      else
         call conclude(engine, exit_code, error)
      end if
      if (allocated(error)) exit_code = error%exit_code
      call agree_on_end(engine, exit_code, error)
   end subroutine sweep_in_order

   !> Which signal ended the sweep; it may have come to another rank.
   function signal_of_stop() result(name)
      character(len=:), allocatable :: name
      name = stop_signal()
      if (len(name) == 0) name = 'a signal to another rank'
   end function signal_of_stop

   !> All ranks end with the exit code of the first.
   subroutine agree_on_end(engine, exit_code, error)
      type(engine_type), intent(inout) :: engine
      integer, intent(inout) :: exit_code
      type(error_type), allocatable, intent(inout) :: error
      integer(i8) :: word

      word = exit_code
      call engine%ranks%share_word(word)
      exit_code = int(word)
      if (engine%ranks%rank > 0 .and. allocated(error)) error%exit_code = exit_code
   end subroutine agree_on_end

   !> A failure of the first rank is one of all, with its exit code, but reported by the first alone.
   subroutine share_fault(engine, error)
      type(engine_type), intent(inout) :: engine
      type(error_type), allocatable, intent(inout) :: error !! in: allocated on the first rank only
      integer(i8) :: fault

      fault = exit_done
      if (allocated(error)) fault = error%exit_code
      call engine%ranks%share_word(fault)
      if (fault /= exit_done .and. .not. allocated(error)) call raise(error, '', int(fault))
   end subroutine share_fault

   !> The first rank reads the files, and all have the texts.
   subroutine read_input(engine, error)
      type(engine_type), intent(inout) :: engine
      type(error_type), allocatable, intent(out) :: error
      type(input_texts) :: input

      if (engine%ranks%rank == 0) then
         call read_input_texts(engine%options%file, input, error)
         if (.not. allocated(error) .and. .not. input%is_sweep) call raise(error, input%name// &
            ': has neither &sweep nor &axis, so it is no sweep; rodyn run computes a case', exit_bad_input)
         if (.not. allocated(error)) call parse_sweep(input, .true., engine%sweep, error)
         if (engine%ranks%launched > 1 .and. engine%ranks%count == 1 .and. .not. allocated(error)) &
            call raise(error, to_text(engine%ranks%launched)//' processes were started, but MPI does not connect them; '// &
                       'try srun --mpi=pmix, or --shard', exit_bad_input)
         if (engine%ranks%count > 1 .and. engine%options%n_shards > 0 .and. .not. allocated(error)) &
            call raise(error, '--shard is for single processes; ranks of MPI share the cases by themselves', exit_bad_input)
      end if
      call share_fault(engine, error)
      if (allocated(error)) return
      call engine%ranks%share_text(engine%sweep%text)
      call engine%ranks%share_text(engine%sweep%name)
      call engine%ranks%share_text(engine%sweep%base_text)
      call engine%ranks%share_text(engine%sweep%base_name)
      if (engine%ranks%rank > 0) then
         associate (sweep => engine%sweep)
            call new_input_texts(input, sweep%text, sweep%name, sweep%base_text, sweep%base_name)
         end associate
         call parse_sweep(input, .false., engine%sweep, error)
      end if
      if (.not. allocated(error)) call new_plan(engine%plan, engine%sweep, error)
      if (allocated(error)) return
      call new_case_shape(engine%shape, engine%sweep)
      call check_memory('n_rods = '//to_text(engine%shape%layout%n_rods)//', '//to_text(engine%plan%n_cases)//' cases, '// &
                        to_text(engine%shape%n_rows)//' rows of series', memory_of_sweep(engine), error)
   end subroutine read_input

   !> Memory of one process: cases that are under way with their results, and what is known of all [bytes].
   pure real(wp) function memory_of_sweep(engine)
      type(engine_type), intent(in) :: engine
      real(wp), parameter :: word = 8.0_wp, of_any_case = 64.0_wp
      real(wp) :: numbers

      numbers = real(engine%shape%layout%n_values, wp)*(1.0_wp + engine%shape%n_probes + engine%shape%n_rows) + &
                engine%shape%n_rows
      if (engine%shape%outputs) numbers = numbers + 2.0_wp*engine%sweep%base_case%n_outputs
      memory_of_sweep = of_program + of_any_case*engine%plan%n_cases + (memory_of_scene(engine%sweep%base_case) + word*numbers)* &
                        min(merge(lanes, 1, uses_lanes(engine%sweep, engine%plan)), engine%plan%n_cases)
   end function memory_of_sweep

   !> Lock the directory, verify what is in it, and find what is missing.
   subroutine open_sweep(engine, error)
      type(engine_type), intent(inout) :: engine
      type(error_type), allocatable, intent(out) :: error
      type(sweep_index) :: index
      character(len=:), allocatable :: path
      character(len=16) :: number
      integer(i8) :: ignored, number_of_shard

      if (engine%ranks%rank == 0) then
         path = engine%options%output
         write (number, '(a, i6.6)') 'r', 0
         engine%tag = trim(number)
         if (engine%options%n_shards > 0) engine%tag = shard_name(engine%options)
         call engine%directory%open(path, plan_text(engine%sweep), engine%options%shard, engine%options%n_shards, &
                                    engine%options%force, error)
         if (.not. allocated(error)) call index%scan(engine%directory, engine%shape, engine%plan%n_cases, engine%tag, &
                                                     other_shards(engine%options), .false., error)
         if (.not. allocated(error)) call list_todo(engine, index)
         call print_start(engine, index, error)
      end if
      call share_fault(engine, error)
      if (allocated(error)) return
      call engine%ranks%share_text(path)
      call engine%ranks%share_integers(engine%todo)
      call engine%ranks%share_integers(engine%attempt)
      call engine%ranks%share_word(engine%directory%fingerprint)
      if (engine%ranks%rank > 0) then
         write (number, '(a, i6.6)') 'r', engine%ranks%rank
         engine%tag = trim(number)
         call engine%directory%lock_rank(path, engine%ranks%rank, error)
         if (allocated(error)) then ! the other ranks must hear of it, or they would wait for this one
            call print_error_line(as_utf8(error%message))
            ignored = engine%ranks%add(at_errors, 1)
            deallocate (error)
            engine%todo = engine%todo(:0)
         end if
      else
         number_of_shard = index%next_number(engine%tag)
      end if
      call engine%ranks%share_word(number_of_shard) ! one rank reads the directory, not all
      engine%next_number = int(number_of_shard)
      call engine%ranks%wait_for_all() ! nobody writes before all have their locks
   end subroutine open_sweep

   !> 's0003-of-0016'
   function shard_name(options) result(name)
      type(sweep_options), intent(in) :: options
      character(len=:), allocatable :: name
      character(len=20) :: text
      write (text, '("s", i6.6, "-of-", i6.6)') options%shard, options%n_shards
      name = trim(text)
   end function shard_name

   !> What is in the names of the shards of our neighbours.
   function other_shards(options) result(part)
      type(sweep_options), intent(in) :: options
      character(len=:), allocatable :: part
      character(len=20) :: text
      part = ''
      if (options%n_shards == 0) return
      write (text, '("-of-", i6.6)') options%n_shards
      part = trim(text)
   end function other_shards

   !> Cases of this sweep, or of this shard, that have to be computed.
   subroutine list_todo(engine, index)
      type(engine_type), intent(inout) :: engine
      type(sweep_index), intent(in) :: index
      integer :: case, n
      logical :: wanted

      allocate (engine%todo(engine%plan%n_cases))
      n = 0
      do case = 1, engine%plan%n_cases
         if (engine%plan%same_as(case) /= case) cycle
         if (engine%options%n_shards > 0) then
            if (modulo(case - 1, engine%options%n_shards) /= engine%options%shard - 1) cycle
         end if
         engine%counts%total = engine%counts%total + 1
         wanted = index%status(case) == 0
         if (engine%options%retry_failed) wanted = wanted .or. index%status(case) == status_failed
         if (wanted) then
            n = n + 1
            engine%todo(n) = case
         else if (index%status(case) == status_done) then
            engine%counts%done = engine%counts%done + 1
         else
            engine%counts%failed = engine%counts%failed + 1
         end if
      end do
      engine%todo = engine%todo(:n)
      engine%attempt = index%attempt(engine%todo) + 1
      engine%counts%before = engine%counts%done + engine%counts%failed
      engine%mine_done = engine%counts%done
      engine%mine_failed = engine%counts%failed
   end subroutine list_todo

   !> First lines, and what was found in the directory.
   subroutine print_start(engine, index, error)
      type(engine_type), intent(inout) :: engine
      type(sweep_index), intent(in) :: index
      type(error_type), allocatable, intent(in) :: error
      character(len=:), allocatable :: line

      call print_notices(engine%options%output, index)
      if (allocated(error)) return
      call engine%progress%start(status_name(engine), engine%options%quiet)
      if (engine%options%quiet) return
      line = to_text(engine%plan%n_cases)//' cases'
      if (engine%options%n_shards > 0) line = line//', shard '//to_text(engine%options%shard)//' of '// &
                                              to_text(engine%options%n_shards)
      line = line//', '//to_text(engine%counts%total)//' to compute'
      if (engine%counts%before > 0) line = line//', '//to_text(engine%counts%before)//' of them on the disk'
      if (engine%ranks%count > 1) then
         line = line//'; '//to_text(engine%ranks%count)//' ranks of MPI'
      else
         line = line//'; one process'
      end if
      call print_line('sweep   '//line)
      call print_line('lanes   '//lanes_text(engine%sweep, engine%plan))
   end subroutine print_start

   subroutine print_notices(path, index)
      character(len=*), intent(in) :: path
      type(sweep_index), intent(in) :: index
      if (.not. allocated(index%notices)) return
      if (len(index%notices) > 0) call print_error_line(as_utf8(path//': '//with_line_ends(index%notices, nl//path//': ')))
   end subroutine print_notices

   function status_name(engine) result(path)
      type(engine_type), intent(in) :: engine
      character(len=:), allocatable :: path
      path = engine%options%output//'/status.txt'
      if (engine%options%n_shards > 0) path = engine%options%output//'/status-'//shard_name(engine%options)//'.txt'
   end function status_name

   !> Take cases as long as there are some.
   subroutine compute(engine, error)
      type(engine_type), target, intent(inout) :: engine
      type(error_type), allocatable, intent(out) :: error
      type(engine_feed), target :: feed
      integer(i8) :: ignored
      integer :: n

      n = size(engine%todo)
      feed%engine => engine
      if (engine%ranks%count > 1) feed%chunk = max(1, min(16, n/(64*engine%ranks%count)))
      call engine%writer%open(engine%directory%path, engine%tag, engine%next_number, engine%directory%fingerprint, &
                              engine%shape)
      call run_cases(engine%sweep, engine%plan, engine%shape, feed)
      call move_alloc(feed%error, error)
      if (.not. allocated(error)) call engine%writer%seal(error)
      if (len(stop_signal()) > 0 .and. engine%ranks%add(at_next, 0) < n) ignored = engine%ranks%add(at_next, n)
      if (len(stop_signal()) > 0) ignored = engine%ranks%add(at_stopped, 1)
      if (allocated(error)) then
         ignored = engine%ranks%add(at_errors, 1)
         if (engine%ranks%rank > 0) call print_error_line(error%message)
      end if
      call share_counts(engine)
   end subroutine compute

   !> Asked to stop? Time to tell how far we are?
   subroutine look_around(engine)
      type(engine_type), intent(inout) :: engine
      integer(i8), save :: clock_last = 0_i8
      integer(i8) :: now, rate

      engine%stopped = len(stop_signal()) > 0
      call system_clock(now, rate)
      if (real(now - clock_last, wp) < 0.1_wp*real(rate, wp)) return
      clock_last = now
      call engine%ranks%progress()
      call engine%writer%sync_if_due()
      call share_counts(engine)
      if (engine%ranks%rank == 0) call engine%progress%show(engine%counts)
   end subroutine look_around

   !> Add our results to the shared counters, and look at them.
   subroutine share_counts(engine)
      type(engine_type), intent(inout) :: engine
      integer(i8) :: done, failed
      done = engine%ranks%add(at_done, engine%mine_done) + engine%mine_done
      failed = engine%ranks%add(at_failed, engine%mine_failed) + engine%mine_failed
      engine%mine_done = 0
      engine%mine_failed = 0
      engine%counts%done = int(done)
      engine%counts%failed = int(failed)
   end subroutine share_counts

   !> Called from time to time, also from inside a case.
   subroutine poll(self, stop_now)
      class(engine_feed), intent(inout) :: self
      logical, intent(out) :: stop_now
      call look_around(self%engine)
      stop_now = self%engine%stopped
   end subroutine poll

   !> The next case that nobody has.
   subroutine next(self, ticket, case)
      class(engine_feed), intent(inout) :: self
      integer, intent(out) :: ticket, case
      integer(i8) :: first, n

      case = 0
      ticket = 0
      associate (engine => self%engine)
         n = size(engine%todo)
         if (self%at == self%last .and. .not. self%ended) then
            if (self%last > 0) self%ended = engine%ranks%add(at_errors, 0) > 0
            if (self%ended) return
            first = engine%ranks%add(at_next, self%chunk)
            self%at = int(min(first, n))
            self%last = int(min(first + self%chunk, n))
            self%ended = first + self%chunk >= n
         end if
         if (self%at == self%last) return
         self%at = self%at + 1
         ticket = self%at
         case = engine%todo(ticket)
      end associate
   end subroutine next

   !> Put a result onto the disk.
   subroutine keep(self, ticket, kept, stop_now)
      class(engine_feed), intent(inout) :: self
      integer, intent(in) :: ticket
      type(case_result), intent(inout) :: kept
      logical, intent(out) :: stop_now

      stop_now = allocated(self%error) .or. kept%status == status_stopped
      if (stop_now) return
      associate (engine => self%engine)
         kept%attempt = engine%attempt(ticket)
         call engine%writer%add(kept, self%error)
         stop_now = allocated(self%error)
         if (stop_now) return
         if (kept%status == status_done) engine%mine_done = engine%mine_done + 1
         if (kept%status == status_failed) engine%mine_failed = engine%mine_failed + 1
      end associate
   end subroutine keep

   !> All cases of this process are on the disk: merge, if those of all others are, too.
   subroutine conclude(engine, exit_code, error)
      type(engine_type), intent(inout) :: engine
      integer, intent(out) :: exit_code
      type(error_type), allocatable, intent(out) :: error
      integer :: n_finished

      exit_code = exit_done
      if (engine%counts%failed > 0) exit_code = exit_failed
      call engine%directory%begin_scan()
      if (engine%options%n_shards > 0) then
         call count_finished(engine, n_finished, error)
         if (.not. allocated(error) .and. n_finished < engine%options%n_shards) then
            call engine%progress%finish('done', engine%counts)
            if (.not. engine%options%quiet) call print_line('done    shard '//to_text(engine%options%shard)// &
               ': '//to_text(engine%counts%done)//' done, '//to_text(engine%counts%failed)//' failed; '// &
               to_text(n_finished)//' of '//to_text(engine%options%n_shards)//' shards are complete, in '// &
               engine%directory%path)
            call engine%directory%end_scan()
            return
         end if
      end if
      if (.not. allocated(error)) call verify_and_merge(engine, exit_code, error)
      call engine%directory%end_scan()
      if (allocated(error)) call engine%progress%finish('incomplete', engine%counts)
   end subroutine conclude

   !> Leave word that this shard is complete, and count those that are.
   subroutine count_finished(engine, n_finished, error)
      type(engine_type), intent(in) :: engine
      integer, intent(out) :: n_finished
      type(error_type), allocatable, intent(out) :: error
      type(sweep_options) :: other
      character(len=:), allocatable :: failure
      integer :: i

      n_finished = 0
      failure = write_text_file(engine%directory%path//'/finished-'//engine%tag//'.txt', 'all cases are in shards'//nl)
      if (len(failure) > 0) call raise(error, engine%directory%path//': cannot be written: '//failure)
      other = engine%options
      do i = 1, other%n_shards
         other%shard = i
         if (path_exists(engine%directory%path//'/finished-'//shard_name(other)//'.txt')) n_finished = n_finished + 1
      end do
   end subroutine count_finished

   !> Read all shards once more, count, and write sweep.h5 unless it is there as it was merged from these results.
   subroutine verify_and_merge(engine, exit_code, error)
      type(engine_type), intent(inout) :: engine
      integer, intent(out) :: exit_code
      type(error_type), allocatable, intent(out) :: error
      type(sweep_index) :: index
      type(sweep_counts) :: counts
      character(len=:), allocatable :: aside, path
      integer :: i, n_missing

      exit_code = exit_failed
      path = engine%directory%path//'/'//result_name
      call index%scan(engine%directory, engine%shape, engine%plan%n_cases, engine%tag, other_shards(engine%options), .true., error)
      if (allocated(error)) return
      call print_notices(engine%directory%path, index)
      n_missing = 0
      do i = 1, engine%plan%n_cases
         select case (index%status(engine%plan%same_as(i)))
         case (status_done)
            counts%done = counts%done + 1
         case (status_failed)
            counts%failed = counts%failed + 1
         case default
            n_missing = n_missing + 1
         end select
      end do
      counts%total = engine%plan%n_cases
      if (counts%done + counts%failed /= counts%total) then
         call raise(error, engine%directory%path//': '//to_text(n_missing)//' of '//to_text(counts%total)// &
                    ' cases have no result; run again to resume')
         return
      end if
      if (size(engine%todo) == 0 .and. result_is_sound(path, index)) then
         if (.not. engine%options%quiet) call print_line('done    nothing to compute; '//path//' is complete, verified')
      else
         call write_result(engine%directory%path, engine%tag, engine%sweep, engine%plan, engine%shape, index, aside, error)
         if (allocated(error)) return
         if (size(engine%todo) == 0 .and. len(aside) > 0) call print_error_line(path// &
            ': not as it was merged from these results; set aside as '//aside//', merged again')
      end if
      exit_code = merge(exit_failed, exit_done, counts%failed > 0)
      call engine%progress%finish('done', counts)
      if (engine%options%quiet) return
      call print_end(engine, index, counts, error)
      call index%close()
   end subroutine verify_and_merge

   !> Last lines: counts, costs, and the first cases that failed.
   subroutine print_end(engine, index, counts, error)
      type(engine_type), intent(in) :: engine
      type(sweep_index), intent(inout) :: index
      type(sweep_counts), intent(in) :: counts
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: most_shown = 10
      type(case_result) :: kept
      integer(i8) :: now, rate
      integer :: i, shown
      real(wp) :: integration, wall

      shown = 0
      integration = 0.0_wp
      call allocate_result(kept, engine%shape)
      if (counts%failed > 0) then
         do i = 1, engine%plan%n_cases
            if (index%status(i) /= status_failed) cycle
            shown = shown + 1
            if (shown > most_shown) exit
            call index%fetch(i, engine%shape, kept, error)
            if (allocated(error)) return
            call print_error_line('case '//to_text(i)//' failed: '//kept%message)
         end do
         if (shown > most_shown) call print_error_line('...')
      end if
      do i = 1, size(engine%todo)
         call index%fetch(engine%todo(i), engine%shape, kept, error)
         if (allocated(error)) return
         integration = integration + kept%integration_seconds
      end do
      call system_clock(now, rate)
      wall = real(now - engine%progress%clock_start, wp)/real(rate, wp)
      if (size(engine%todo) > 0) call print_line('cost    '//formatted(integration, '(f20.3)')// &
         ' s of integration in '//formatted(wall, '(f20.3)')//' s on '//to_text(engine%ranks%count)// &
         trim(merge(' ranks  ', ' process', engine%ranks%count > 1)))
      call print_line('cases   '//to_text(counts%done)//' done, '//to_text(counts%failed)//' failed')
      call print_line('file    '//engine%directory%path//'/'//result_name)
   end subroutine print_end

end module rodyn_sweep_engine
