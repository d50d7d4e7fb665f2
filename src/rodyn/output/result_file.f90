!> A result on its way to the disk.
!>
!> Until `complete` has put everything onto the disk, the file has a temporary name, `PATH.partial-PID`: whatever has the
!> final name is complete. What is about to be written is reserved before: a file that has been flushed stays sound.
module rodyn_result_file
   use, intrinsic :: iso_c_binding, only: c_int
   use rodyn_attributes, only: attribute_list, is_text, is_real, is_int32
   use rodyn_errors, only: error_type, exit_bad_input, raise
   use rodyn_file_room, only: file_room
   use rodyn_hdf5_files, only: hdf5_file, hdf5_version
   use rodyn_kinds, only: i8
   use rodyn_posix, only: ignore_signal, is_directory, is_special, is_writable, last_failure, parent_directory, &
      path_exists, posix_close, process_id, remove_file, rename_new, rename_over, sigxfsz, sync_path
   use rodyn_posix_files, only: create_file, make_directory
   use rodyn_run_report, only: provenance
   implicit none (type, external)
   private
   public :: result_file, check_output_path

   integer, parameter :: longest_name = 255 - 24, longest_path = 4095 - 24 !! of Linux, less what temporary names add [bytes]

   !> An HDF5 file under its temporary name.
   type :: result_file
      type(hdf5_file) :: file               !! for what this type does not write
      character(len=:), allocatable :: path !! final name
      character(len=:), allocatable :: temporary_path
      logical :: force = .false.            !! `complete` may replace an existing file
      logical :: worth_keeping = .false.    !! what has been flushed is of use, even if the rest cannot be written
      type(file_room), private :: room
   contains
      procedure :: begin
      procedure :: reserve
      procedure :: write_provenance
      procedure :: put_attributes
      procedure :: describe
      procedure :: complete
      procedure :: discard
      procedure :: leave
      procedure, private :: put_on_disk
      procedure, private :: bring_back
      procedure, private :: copy_to
   end type result_file

contains

   !> Refuse a path at which no result can or may appear. Nothing is written.
   subroutine check_output_path(path, force, error)
      character(len=*), intent(in) :: path
      logical, intent(in) :: force                       !! an existing file may be replaced
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: directory

      directory = parent_directory(path)
      if (len(path) == 0) then
         call raise(error, 'the name of the output file is empty', exit_bad_input)
      else if (len(path) - index(path, '/', back=.true.) > longest_name .or. len(path) > longest_path) then
         call raise(error, path//': the name of the output file is too long', exit_bad_input)
      else if (is_directory(path)) then
         call raise(error, path//': is a directory; give the name of a file', exit_bad_input)
      else if (is_special(path)) then
         call raise(error, path//': is a device or a pipe; give the name of a file', exit_bad_input)
      else if (path_exists(path) .and. .not. force) then
         call raise(error, path//': exists already; --force replaces it', exit_bad_input)
      else if (.not. path_exists(directory)) then
         call raise(error, path//": the directory '"//directory//"' does not exist", exit_bad_input)
      else if (.not. is_directory(directory)) then
         call raise(error, path//": '"//directory//"' is not a directory that can be read", exit_bad_input)
      else if (.not. is_writable(directory)) then
         call raise(error, path//": no permission to write in the directory '"//directory//"'", exit_bad_input)
      end if
   end subroutine check_output_path

   !> Make the file under its temporary name.
   subroutine begin(self, path, force, error)
      class(result_file), intent(inout) :: self
      character(len=*), intent(in) :: path                !! final name
      logical, intent(in) :: force                        !! `complete` may replace an existing file
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: failure

      call check_output_path(path, force, error)
      if (allocated(error)) return
      call ignore_signal(sigxfsz)
      self%path = path
      self%worth_keeping = .false.
      self%temporary_path = free_temporary_name(path)
      self%force = force
      call self%file%create(self%temporary_path, error)
      if (.not. allocated(error)) then
         failure = self%room%open(self%temporary_path)
         if (len(failure) > 0) call raise(error, self%temporary_path//': cannot be opened: '//failure)
      end if
      if (allocated(error)) call self%discard() ! on a full disk it is there, empty
   end subroutine begin

   !> Make sure that the file may grow by so many bytes; empty: it may.
   function reserve(self, bytes) result(failure)
      class(result_file), intent(in) :: self
      integer(i8), intent(in) :: bytes
      character(len=:), allocatable :: failure
      failure = self%room%reserve(bytes)
   end function reserve

   !> Root attributes: what ran, with what, on what.
   subroutine write_provenance(self, origin)
      class(result_file), intent(inout) :: self
      class(provenance), intent(in) :: origin
      type(attribute_list) :: attributes
      call origin%list('running', attributes, hdf5_version())
      call self%put_attributes('/', attributes)
   end subroutine write_provenance

   subroutine put_attributes(self, object, attributes)
      class(result_file), intent(inout) :: self
      character(len=*), intent(in) :: object !! '/' for the root
      type(attribute_list), intent(in) :: attributes
      integer :: i

      do i = 1, attributes%n
         associate (x => attributes%items(i))
            select case (x%kind)
            case (is_text); call self%file%put_attribute(object, x%name, x%text)
            case (is_real); call self%file%put_attribute(object, x%name, x%x)
            case (is_int32); call self%file%put_attribute(object, x%name, int(x%number))
            case default; call self%file%put_attribute(object, x%name, x%number)
            end select
         end associate
      end do
   end subroutine put_attributes

   !> Unit and meaning of a data set.
   subroutine describe(self, name, units, long_name)
      class(result_file), intent(inout) :: self
      character(len=*), intent(in) :: name, units, long_name

      call self%file%put_attribute(name, 'units', units)
      call self%file%put_attribute(name, 'long_name', long_name)
   end subroutine describe

   !> Write the status, close the file and give it its final name.
   subroutine complete(self, status, error)
      class(result_file), intent(inout) :: self
      character(len=*), intent(in) :: status !! 'done', 'failed', 'stopped'
      type(error_type), allocatable, intent(out) :: error

      call self%file%put_attribute('/', 'status', status)
      call self%file%flush(error)
      if (.not. allocated(error)) call self%file%close(error)
      if (allocated(error)) then
         call self%leave(error)
      else
         call self%put_on_disk(error)
      end if
      call self%room%close()
   end subroutine complete

   !> Give up: close and remove the temporary file.
   subroutine discard(self)
      class(result_file), intent(inout) :: self
      type(error_type), allocatable :: ignored
      character(len=:), allocatable :: failure

      call self%file%close(ignored)
      call self%room%close()
      if (allocated(self%temporary_path)) failure = remove_file(self%temporary_path)
   end subroutine discard

   !> Close what could not be completed. If it is of use, it stays, and the message says where.
   subroutine leave(self, error)
      class(result_file), intent(inout) :: self
      type(error_type), intent(inout) :: error
      type(error_type), allocatable :: ignored

      if (.not. self%worth_keeping) then
         call self%discard()
         return
      end if
      call self%file%close(ignored)
      call self%room%close()
      error%message = error%message//"; what was written is left as '"//self%temporary_path//"'"
   end subroutine leave

   !> Sync the closed file, rename it, sync the directory's names. If the final name was taken meanwhile, the
   !> result stays under its temporary name and the message says so.
   subroutine put_on_disk(self, error)
      class(result_file), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: failure
      logical :: taken

      failure = ''
      if (.not. path_exists(self%temporary_path)) call self%bring_back(failure, error)
      if (allocated(error)) return
      if (len(failure) == 0) failure = sync_path(self%temporary_path)
      if (len(failure) > 0) then
         call raise(error, self%temporary_path//': the result could not be flushed to disk: '//failure)
         return
      end if

      taken = .false.
      if (self%force) then
         failure = rename_over(self%temporary_path, self%path)
      else
         call rename_new(self%temporary_path, self%path, taken, failure)
      end if
      if (taken) then
         call raise(error, self%path//": appeared while this run was computing and is left alone; this run's result is '"// &
            self%temporary_path//"'", exit_bad_input)
      else if (len(failure) > 0) then
         call raise(error, self%path//": cannot be renamed: "//failure//"; the result is '"//self%temporary_path//"'")
      else
         failure = sync_path(parent_directory(self%path))
         if (len(failure) > 0) call raise(error, self%path//': its name could not be flushed to disk: '//failure)
      end if
   end subroutine put_on_disk

   !> Somebody has removed the file, perhaps with its directory: as long as it is open its content is there. Where the directory
   !> cannot be made again it goes among the temporary files of the system, and that is an error.
   subroutine bring_back(self, failure, error)
      class(result_file), intent(inout) :: self
      character(len=:), allocatable, intent(out) :: failure !! empty: it is there again
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: elsewhere

      failure = make_directory(parent_directory(self%temporary_path))
      if (len(failure) == 0) failure = self%copy_to(self%temporary_path)
      if (len(failure) == 0) return
      elsewhere = free_temporary_name(temporary_directory()//'/'//self%path(index(self%path, '/', back=.true.) + 1:))
      if (len(self%copy_to(elsewhere)) > 0) return
      call raise(error, self%path//': its directory was removed and cannot be recreated: '//failure// &
                 "; the result is '"//elsewhere//"'")
   end subroutine bring_back

   !> Write the content of the file, which is open but has no name, into a new one.
   function copy_to(self, path) result(failure)
      class(result_file), intent(in) :: self
      character(len=*), intent(in) :: path
      character(len=:), allocatable :: failure
      integer(c_int) :: descriptor, status

      failure = ''
      descriptor = create_file(path)
      if (descriptor < 0) then
         failure = last_failure()
         return
      end if
      failure = self%room%copy(descriptor)
      status = posix_close(descriptor)
      if (len(failure) == 0) failure = sync_path(path)
   end function copy_to

   !> A name beside the final one that no file has. Process numbers repeat in containers, so they alone will not do.
   function free_temporary_name(path) result(name)
      character(len=*), intent(in) :: path
      character(len=:), allocatable :: name
      character(len=32) :: suffix
      integer :: attempt

      write (suffix, '(".partial-", i0)') process_id()
      name = path//trim(suffix)
      do attempt = 2, 1000
         if (.not. path_exists(name)) return
         write (suffix, '(".partial-", i0, "-", i0)') process_id(), attempt
         name = path//trim(suffix)
      end do
   end function free_temporary_name

   !> For what finds no other place.
   function temporary_directory() result(path)
      character(len=:), allocatable :: path
      integer :: length

      call get_environment_variable('TMPDIR', length=length)
      allocate (character(len=length) :: path)
      call get_environment_variable('TMPDIR', path)
      if (length == 0) path = '/tmp'
   end function temporary_directory

end module rodyn_result_file
