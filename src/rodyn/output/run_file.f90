!> The result of one run as an HDF5 file; `rodyn_quantities` has what is in it.
!>
!>     call check_output_path(path, force, error)      ! early, before computing
!>     call run%create(path, header, force, error)
!>     call run%append(row, error)                     ! once per output time
!>     call run%finish('done', report, error)
!>
!> Until `finish`, the file has a temporary name (`rodyn_result_file`) under which it may be read: rows are in it a block at
!> a time, and where that takes long after a minute at the latest. Where they find no room, `append` fails, and `finish` ends
!> the file as a failed one with the rows that did. A failed file replaces no other than a failed one (`force`). After a failure
!> within HDF5 the file is left as it is, and every later call returns that failure again, so that the caller may end its work in
!> the usual way.
module rodyn_run_file
   use rodyn_attributes, only: attribute_list
   use rodyn_build_info, only: git_commit
   use rodyn_errors, only: error_type, raise
   use rodyn_hdf5_files, only: hdf5_file
   use rodyn_kinds, only: i8, wp
   use rodyn_posix, only: path_exists, remove_file
   use rodyn_quantities, only: chain_axes, entries, row_layout, row_type
   use rodyn_result_file, only: check_output_path, result_file
   use rodyn_run_report, only: event_columns, provenance, solver_report
   use rodyn_text, only: short_text, text_or_empty, to_text
   implicit none (type, external)
   private
   public :: run_file, run_header, check_output_path

   character(len=*), parameter :: solver_group = 'solver', events_group = 'events'

   integer, parameter :: block_bytes = 2*1024*1024 !! memory for rows that wait to be written
   integer, parameter :: most_block_rows = 4096
   integer, parameter :: bytes_per_real = 8

   ! How long rows wait to be written when a block is slow to fill: as long as the run has taken until the last writing, within
   ! these bounds. A reader needs some time in which nothing is written, and a writing costs as much as one of a block.
   real(wp), parameter :: shortest_wait = 1.0_wp, longest_wait = 60.0_wp !! wall time [s]

   ! Room that HDF5 takes beside the numbers [bytes]
   integer(i8), parameter :: bytes_of_layout = 3000_i8 !! of one data set, empty
   integer(i8), parameter :: bytes_of_node = 2700_i8   !! of the index of a data set: a tree with 32 to 64 chunks to a node
   integer, parameter :: chunks_per_node = 32
   integer(i8), parameter :: bytes_at_end = 32768_i8   !! of the group `solver`, a message and the last attributes
   integer(i8), parameter :: bytes_per_event = 64_i8

   !> What is known before the first row.
   type, extends(provenance) :: run_header
      type(row_layout) :: layout
      integer :: n_rows = 0       !! rows to expect; 0: unknown. Only sizes the blocks
      integer :: compression = 4  !! gzip level, 0..9
   end type run_header

   type, extends(result_file) :: run_file
      type(row_layout), private :: layout
      integer, private :: block_rows = 0
      integer, private :: compression = 0
      integer, private :: waiting = 0                  !! rows in the block
      integer, private :: written = 0                  !! of them, in the file already
      integer, private :: n_blocks = 0                 !! that are full and in the file
      real(wp), private :: last_time = 0.0_wp          !! of the last row in the file [s]
      integer(i8), private :: clock_start = 0, clock_written = 0
      character(len=:), allocatable, private :: resolved_input
      character(len=:), allocatable, private :: no_room !! why a row or the events are not in the file
      character(len=:), allocatable, private :: lost   !! why the file was given up
      real(wp), allocatable, private :: times(:)       !! of the block (block_rows) [s]
      real(wp), allocatable, private :: values(:, :)   !! (layout%n_values, block_rows)
   contains
      procedure :: create
      procedure :: append
      procedure :: write_events
      procedure :: finish
      procedure :: stop_at
      procedure, private :: check_open
      procedure, private :: keep_failure
      procedure, private :: write_layout
      procedure, private :: flush_is_due
      procedure, private :: write_waiting_rows
      procedure, private :: write_rows
      procedure, private :: room_for
   end type run_file

contains

   !> The rows of a stopped run get a name of their own, so that the same call can be made again: PATH, or PATH-1, PATH-2, ...
   !> behind what is not theirs to replace. Where there are some of the same case already, the more stay: `earlier` is true if
   !> those do, and then this file is not needed.
   subroutine stop_at(self, path, alike, earlier)
      class(run_file), intent(inout) :: self
      character(len=*), intent(in) :: path
      logical, intent(in) :: alike !! runs of equal input are equal
      logical, intent(out) :: earlier
      type(error_type), allocatable :: unwritten !! returned by `finish`
      logical :: same
      real(wp) :: t_earlier
      integer :: i

      call self%write_waiting_rows(unwritten)
      self%force = .false.
      earlier = .false.
      do i = 0, huge(i) - 1
         self%path = path
         if (i > 0) self%path = path//'-'//to_text(i)
         if (.not. path_exists(self%path)) return
         if (.not. alike) cycle
         call compare(self%path, self%resolved_input, same, t_earlier)
         if (.not. same) cycle
         earlier = t_earlier >= self%last_time
         if (earlier) return
         if (len(remove_file(self%path)) == 0) return ! its rows are among these, which are in a file
      end do
   end subroutine stop_at

   !> Is a file one of rows of this program and this input, and how far do they go?
   subroutine compare(path, resolved_input, same, t_reached)
      character(len=*), intent(in) :: path, resolved_input
      logical, intent(out) :: same
      real(wp), intent(out) :: t_reached !! [s]
      type(hdf5_file) :: file
      type(error_type), allocatable :: error
      character(len=:), allocatable :: input, commit

      t_reached = 0.0_wp
      same = .false.
      call file%open(path, error)
      if (allocated(error)) return
      call file%get_attribute('/', 'resolved_input', input, error)
      if (.not. allocated(error)) call file%get_attribute('/', 'git_commit', commit, error)
      if (.not. allocated(error)) call file%get_attribute('/', 't_reached', t_reached, error)
      if (.not. allocated(error)) same = input == resolved_input .and. commit == git_commit()
      call file%close(error)
   end subroutine compare

   !> Make the file under its temporary name, with all data sets, empty, and the root attributes.
   subroutine create(self, path, header, force, error)
      class(run_file), intent(inout) :: self
      character(len=*), intent(in) :: path                !! final name
      type(run_header), intent(in) :: header
      logical, intent(in) :: force                        !! `finish` may replace an existing file
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: failure

      self%layout = header%layout
      self%block_rows = rows_per_block(header)
      self%compression = header%compression
      self%waiting = 0
      self%written = 0
      self%n_blocks = 0
      self%last_time = 0.0_wp
      self%resolved_input = text_or_empty(header%resolved_input)
      call system_clock(self%clock_start)
      self%clock_written = self%clock_start
      if (allocated(self%lost)) deallocate (self%lost)
      if (allocated(self%no_room)) deallocate (self%no_room)
      if (allocated(self%values)) deallocate (self%times, self%values)
      allocate (self%times(self%block_rows), self%values(self%layout%n_values, self%block_rows))

      call self%begin(path, force, error)
      if (allocated(error)) return
      failure = self%reserve(bytes_at_end + n_sets(self%layout)*bytes_of_layout + len(text_or_empty(header%input)) &
                             + len(self%resolved_input) + len(text_or_empty(header%notes)))
      if (len(failure) > 0) call raise(error, path//': cannot be written: '//failure)
      if (.not. allocated(error)) then
         call self%write_layout()
         call self%write_provenance(header%provenance)
         call self%file%flush(error)
      end if
      if (.not. allocated(error)) return
      call self%discard()
      self%lost = error%message
   end subroutine create

   !> An error where there is no file to write to.
   subroutine check_open(self, error)
      class(run_file), intent(in) :: self
      type(error_type), allocatable, intent(out) :: error

      if (self%file%is_open()) return
      if (allocated(self%lost)) then
         call raise(error, self%lost)
      else
         call raise(error, 'a run file that is not open cannot be written')
      end if
   end subroutine check_open

   !> Leave what cannot be written on, and keep in mind why.
   subroutine keep_failure(self, error)
      class(run_file), intent(inout) :: self
      type(error_type), intent(inout) :: error
      call self%leave(error)
      self%lost = error%message
   end subroutine keep_failure

   !> Add one row. It is copied; blocks of rows are written as they fill.
   subroutine append(self, row, error)
      class(run_file), intent(inout) :: self
      type(row_type), intent(in) :: row !! of the layout of the header
      type(error_type), allocatable, intent(out) :: error

      call self%check_open(error)
      if (allocated(error)) return
      self%waiting = self%waiting + 1
      self%times(self%waiting) = row%time
      self%values(:, self%waiting) = row%values
      if (self%waiting == self%block_rows .or. self%flush_is_due()) call self%write_waiting_rows(error)
   end subroutine append

   !> Has it been long since rows were written?
   logical function flush_is_due(self)
      class(run_file), intent(in) :: self
      integer(i8) :: now, rate
      call system_clock(now, rate)
      associate (so_far => real(self%clock_written - self%clock_start, wp), waited => real(now - self%clock_written, wp))
         flush_is_due = waited > max(shortest_wait*rate, min(longest_wait*rate, so_far))
      end associate
   end function flush_is_due

   !> The group `events` of a run that may have some, behind all rows and before `finish`. Without events its data sets are empty.
   subroutine write_events(self, time, hinge, kind, energy_lost, error)
      class(run_file), intent(inout) :: self
      real(wp), intent(in) :: time(:)          !! [s]
      integer, intent(in) :: hinge(:)          !! 0..n-1
      character(len=*), intent(in) :: kind(:)
      real(wp), intent(in) :: energy_lost(:)   !! [J]
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: failure
      integer :: i

      call self%check_open(error)
      if (allocated(error)) return
      call self%write_waiting_rows(error)
      if (.not. self%file%is_open()) return
      if (allocated(error)) deallocate (error) ! no room, which `finish` reports
      failure = self%reserve(bytes_at_end + size(event_columns)*(bytes_of_layout + bytes_of_node) + size(time)*bytes_per_event)
      if (len(failure) > 0) then
         if (.not. allocated(self%no_room)) self%no_room = 'events cannot be written: '//failure
         return
      end if
      call self%file%create_group(events_group)
      call self%file%write('events/time', time, 0)
      call self%file%make_scale('events/time')
      call self%file%write('events/hinge', hinge, 0)
      call self%file%create_texts('events/kind', len(kind), max(1, size(kind)), 0)
      call self%file%append('events/kind', kind)
      call self%file%write('events/energy_lost', energy_lost, 0)
      do i = 1, size(event_columns)
         associate (x => event_columns(i))
            call self%describe('events/'//trim(x%name), x%units, trim(x%long_name))
            if (i > 1) call self%file%attach_scale('events/'//trim(x%name), 1, 'events/time')
         end associate
      end do
      call self%file%get_failure(error)
      if (allocated(error)) call self%keep_failure(error)
   end subroutine write_events

   !> Write what waits, the final attributes, and give the file its final name. A file in which something found no room is
   !> one of a failed run, and that is an error.
   subroutine finish(self, status, report, error, message)
      class(run_file), intent(inout) :: self
      character(len=*), intent(in) :: status             !! 'done', 'failed', 'stopped'
      type(solver_report), intent(in) :: report
      type(error_type), allocatable, intent(out) :: error
      character(len=*), intent(in), optional :: message  !! why it is not done
      type(attribute_list) :: attributes
      character(len=:), allocatable :: outcome, reason, warnings

      call self%check_open(error)
      if (allocated(error)) return
      call self%write_waiting_rows(error)
      if (allocated(error) .and. .not. self%file%is_open()) return
      if (allocated(self%no_room) .and. .not. self%worth_keeping) then
         call self%discard()
         call raise(error, self%no_room)
         return
      end if
      outcome = status
      reason = ''
      if (allocated(self%no_room) .and. status == 'done') outcome = 'failed'
      if (allocated(self%no_room)) reason = self%no_room
      if (present(message)) reason = message
      if (outcome == 'failed' .and. self%force) call step_aside(self%path)
      warnings = text_or_empty(report%warnings)
      if (len(self%reserve(bytes_at_end + len(warnings))) > 0) warnings = 'left out: no space left'
      call report%list(self%layout%before('work_external') >= 0, attributes)
      call self%put_attributes(solver_group, attributes)
      call self%file%put_attribute('/', 't_reached', self%last_time)
      call self%file%put_attribute('/', 'warnings', warnings)
      if (outcome /= 'done') call self%file%put_attribute('/', 'message', reason)
      call self%complete(outcome, error)
      if (.not. allocated(error) .and. outcome /= status) &
         call raise(error, reason//' (rows until then are in '//self%path//')')
   end subroutine finish

   !> A failed run takes the place of a failed run only. Whatever else has its name stays, and it is called PATH.failed.
   subroutine step_aside(path)
      character(len=:), allocatable, intent(inout) :: path !! of the result
      type(hdf5_file) :: file
      type(error_type), allocatable :: error
      character(len=:), allocatable :: status

      if (.not. path_exists(path)) return
      status = ''
      call file%open(path, error)
      if (.not. allocated(error)) call file%get_attribute('/', 'status', status, error)
      if (.not. allocated(error)) call file%close(error)
      if (allocated(error) .or. status /= 'failed') path = path//'.failed'
   end subroutine step_aside

   !> All data sets, coordinates attached, and the group `solver`.
   subroutine write_layout(self)
      class(run_file), intent(inout) :: self
      character(len=:), allocatable :: name
      integer :: i

      do i = 1, size(chain_axes)
         name = trim(chain_axes(i)%name)
         call self%file%write(name, entries(chain_axes(i), self%layout%n_rods), self%compression)
         call self%describe(name, '1', trim(chain_axes(i)%long_name))
         call self%file%make_scale(name)
      end do
      call self%file%create_series('time', [integer ::], self%block_rows, self%compression)
      call self%describe('time', 's', 'time')
      call self%file%make_scale('time')
      do i = 1, size(self%layout%quantities)
         associate (x => self%layout%quantities(i))
            name = trim(x%name)
            call self%file%create_series(name, self%layout%row_shape(i), self%block_rows, self%compression)
            call self%describe(name, trim(x%units), trim(x%long_name))
            if (x%along > 0) call self%file%attach_scale(name, 1, trim(chain_axes(x%along)%name))
            call self%file%attach_scale(name, merge(2, 1, x%along > 0), 'time')
         end associate
      end do
      call self%file%create_group(solver_group)
   end subroutine write_layout

   !> Write the rows that wait, as far as there is room for them. Those that find none are dropped.
   subroutine write_waiting_rows(self, error)
      class(run_file), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: failure
      integer :: rows

      failure = ''
      do while (self%written < self%waiting)
         rows = self%room_for(self%waiting, failure)
         if (rows == self%written) exit
         call self%write_rows(rows, error)
         if (allocated(error)) return
      end do
      if (self%written < self%waiting) then
         self%waiting = self%written
         self%no_room = self%path//': rows after t = '//short_text(self%last_time)//' s cannot be written: '//failure
         call raise(error, self%no_room)
      end if
      if (self%waiting < self%block_rows) return
      self%n_blocks = self%n_blocks + 1
      self%waiting = 0
      self%written = 0
   end subroutine write_waiting_rows

   !> How many of the first rows of the block there is room for: all, or those written before and a half, a quarter, ... of the
   !> rest, or only those.
   integer function room_for(self, most, failure) result(rows)
      class(run_file), intent(in) :: self
      integer, intent(in) :: most                           !! rows
      character(len=:), allocatable, intent(out) :: failure !! why not all; empty: all
      character(len=:), allocatable :: reason
      integer(i8) :: row_bytes, rest
      integer :: nodes !! that the index of each data set may need now

      row_bytes = bytes_per_real*(self%layout%n_values + 1_i8)
      nodes = merge(3, merge(1, 0, self%written == 0 .and. self%n_blocks == 0), &
                    self%n_blocks > 0 .and. modulo(self%n_blocks, chunks_per_node) == 0)
      rest = bytes_at_end + n_sets(self%layout)*nodes*bytes_of_node
      rows = most
      failure = ''
      do
         reason = self%reserve(rest + row_bytes*merge(rows, self%block_rows, self%compression > 0))
         if (rows == most) failure = reason
         if (len(reason) == 0) return
         rows = self%written + (rows - self%written)/2
         if (rows == self%written) return
      end do
   end function room_for

   !> Write rows of the block up to one of them; data sets grow by exactly those that are not in the file.
   subroutine write_rows(self, last, error)
      class(run_file), intent(inout) :: self
      integer, intent(in) :: last
      type(error_type), allocatable, intent(out) :: error
      integer :: i

      associate (first => self%written + 1)
         call self%file%append('time', self%times(first:last))
         do i = 1, size(self%layout%quantities)
            associate (x => self%layout%quantities(i))
               if (x%along > 0) then
                  call self%file%append(trim(x%name), self%values(x%first:x%last, first:last))
               else
                  call self%file%append(trim(x%name), self%values(x%first, first:last))
               end if
            end associate
         end do
      end associate
      call self%file%flush(error)
      if (allocated(error)) then
         call self%keep_failure(error)
         return
      end if
      self%worth_keeping = .true.
      self%written = last
      self%last_time = self%times(last)
      call system_clock(self%clock_written)
   end subroutine write_rows

   !> Data sets that grow: time and the quantities.
   pure integer function n_sets(layout)
      type(row_layout), intent(in) :: layout
      n_sets = 1 + size(layout%quantities)
   end function n_sets

   !> Rows per block and chunk: as many as the memory for waiting rows allows, in blocks of about equal size.
   pure function rows_per_block(header) result(rows)
      type(run_header), intent(in) :: header
      integer :: rows
      integer :: n_blocks

      rows = max(1, min(most_block_rows, block_bytes/bytes_per_real/(header%layout%n_values + 1)))
      if (header%n_rows > 0) then
         n_blocks = (header%n_rows - 1)/rows + 1
         rows = (header%n_rows - 1)/n_blocks + 1
      end if
   end function rows_per_block

end module rodyn_run_file
