!> The namelist behind a path, a case or a sweep, or what a result file holds of its own: so a run or a sweep can be made again
!> from its result alone.
module rodyn_input_texts
   use rodyn_errors, only: error_type, raise, exit_bad_input
   use rodyn_file_text, only: read_standard_input, read_text_file, standard_input
   use rodyn_hdf5_files, only: hdf5_file
   use rodyn_namelist_document, only: namelist_document, group_count
   use rodyn_namelist_parser, only: parse_document
   use rodyn_posix, only: is_special, parent_directory
   implicit none (type, external)
   private
   public :: input_texts, is_result_file, is_stream, new_input_texts, read_input_texts

   character(len=8), parameter :: signature = achar(137)//'HDF'//achar(13)//achar(10)//achar(26)//achar(10) !! of HDF5

   type :: input_texts
      logical :: is_sweep = .false.
      logical :: from_result = .false.
      character(len=:), allocatable :: text, name           !! and what messages call it
      type(namelist_document) :: document                   !! `text`, parsed
      character(len=:), allocatable :: directory            !! of the file: the base of a sweep is found from there
      character(len=:), allocatable :: base_text, base_name !! of a sweep whose base came with it; otherwise not allocated
   end type input_texts

contains

   !> A namelist, and that of its base if it is a sweep and brings it along.
   subroutine new_input_texts(input, text, name, base_text, base_name)
      type(input_texts), intent(inout) :: input
      character(len=*), intent(in) :: text, name
      character(len=*), intent(in), optional :: base_text, base_name

      input%text = text
      input%name = name
      call parse_document(text, name, input%document)
      input%is_sweep = group_count(input%document, 'sweep') > 0 .or. group_count(input%document, 'axis') > 0
      if (present(base_text)) input%base_text = base_text
      if (present(base_name)) input%base_name = base_name
   end subroutine new_input_texts

   !> Read what is behind a path, unchecked; '-' is standard input. Whatever is wrong with the files is bad input: exit code 2.
   subroutine read_input_texts(path, input, error)
      character(len=*), intent(in) :: path
      type(input_texts), intent(out) :: input
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: text, name

      input%from_result = is_result_file(path)
      if (input%from_result) then
         call read_result(path, input, error)
         if (allocated(error)) error%exit_code = exit_bad_input
         return
      end if
      name = path
      if (path == '-') then
         name = standard_input
         call read_standard_input(text, error)
      else
         call read_text_file(path, text, error)
      end if
      if (allocated(error)) return
      if (index(text, signature) == 1) then
         call raise(error, name//': an HDF5 file cannot be read from a pipe; give its name', exit_bad_input)
         return
      end if
      call new_input_texts(input, text, name)
      input%directory = '.'
      if (.not. is_stream(path)) input%directory = parent_directory(path)
   end subroutine read_input_texts

   !> Is the input a stream: standard input, a pipe, a device? It has no name that its result could have, too.
   logical function is_stream(path)
      character(len=*), intent(in) :: path
      is_stream = path == '-' .or. path == '/dev/stdin' .or. index(path, '/dev/fd/') == 1 .or. is_special(path)
   end function is_stream

   !> Does the file begin as HDF5 files do? No, if it cannot be read.
   logical function is_result_file(path)
      character(len=*), intent(in) :: path
      character(len=len(signature)) :: beginning
      integer :: stat, unit

      is_result_file = .false.
      if (path == '-' .or. is_special(path)) return ! a pipe must not be read twice
      open (newunit=unit, file=path, access='stream', form='unformatted', status='old', action='read', iostat=stat)
      if (stat /= 0) return
      read (unit, iostat=stat) beginning
      is_result_file = stat == 0 .and. beginning == signature
      close (unit)
   end function is_result_file

   !> Take the namelists from a result file.
   subroutine read_result(path, input, error)
      character(len=*), intent(in) :: path
      type(input_texts), intent(inout) :: input
      type(error_type), allocatable, intent(out) :: error
      type(hdf5_file) :: file
      type(error_type), allocatable :: ignored, failure
      character(len=:), allocatable :: text

      call file%open(path, failure)
      if (allocated(failure)) then
         call raise(error, path//': cannot be read as a result of Rodyn ('//failure%message//')')
         return
      end if
      if (.not. file%has_attribute('/', 'input')) then
         call raise(error, path//': is an HDF5 file, but not a result of Rodyn: it has no attribute `input`')
      else
         call file%get_attribute('/', 'input', text, error)
         if (.not. allocated(error) .and. file%has_attribute('/', 'base_input')) then
            input%base_name = path//'@base_input'
            call file%get_attribute('/', 'base_input', input%base_text, error)
         end if
      end if
      call file%close(ignored)
      if (allocated(error)) return
      if (len_trim(text) == 0) call raise(error, path//': its attribute `input` is empty; `resolved_input` is a namelist that '// &
                                                 'can be run')
      call new_input_texts(input, text, path//'@input')
      input%is_sweep = allocated(input%base_name)
   end subroutine read_result

end module rodyn_input_texts
