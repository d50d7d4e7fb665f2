!> The namelists behind a path: a case, a sweep and its base, or those that a result file holds. So a run or a sweep can
!> be made again from its result alone.
module rodyn_input_texts
   use rodyn_errors, only: error_type, raise, exit_bad_input
   use rodyn_file_text, only: read_text_file
   use rodyn_hdf5_files, only: hdf5_file
   use rodyn_kinds, only: i8
   use rodyn_sweep_reader, only: find_base, is_sweep_text
   implicit none (type, external)
   private
   public :: input_texts, is_result_file, read_input_texts

   character(len=8), parameter :: signature = achar(137)//'HDF'//achar(13)//achar(10)//achar(26)//achar(10) !! of HDF5

   type :: input_texts
      logical :: is_sweep = .false.
      logical :: from_result = .false.
      character(len=:), allocatable :: text, name           !! and what messages call it
      character(len=:), allocatable :: base_text, base_name !! of a sweep
   end type input_texts

contains

   !> Read what is behind a path, unchecked. Whatever is wrong with the files is bad input: exit code 2.
   subroutine read_input_texts(path, input, error)
      character(len=*), intent(in) :: path
      type(input_texts), intent(out) :: input
      type(error_type), allocatable, intent(out) :: error

      input%from_result = is_result_file(path)
      if (input%from_result) then
         call read_result(path, input, error)
         if (allocated(error)) error%exit_code = exit_bad_input
         return
      end if
      input%name = path
      call read_text_file(path, input%text, error)
      if (allocated(error)) return
      input%is_sweep = is_sweep_text(input%text)
      if (.not. input%is_sweep) return
      call find_base(input%text, path, input%base_name, error)
      if (.not. allocated(error)) call read_text_file(input%base_name, input%base_text, error)
   end subroutine read_input_texts

   !> Does the file begin as HDF5 files do? No, if it cannot be read.
   logical function is_result_file(path)
      character(len=*), intent(in) :: path
      character(len=len(signature)) :: beginning
      integer(i8) :: bytes
      integer :: stat, unit

      is_result_file = .false.
      inquire (file=path, size=bytes, iostat=stat) ! a pipe, which must not be read twice, has none
      if (stat /= 0 .or. bytes < len(signature)) return
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

      input%name = path//'@input'
      input%base_name = path//'@base_input'
      call file%open(path, failure)
      if (allocated(failure)) then
         call raise(error, path//': cannot be read as a result of Rodyn ('//failure%message//')')
         return
      end if
      if (.not. file%has_attribute('/', 'input')) then
         call raise(error, path//': is an HDF5 file, but not a result of Rodyn: it has no attribute `input`')
      else
         call file%get_attribute('/', 'input', input%text, error)
         input%is_sweep = file%has_attribute('/', 'base_input')
         if (input%is_sweep .and. .not. allocated(error)) &
            call file%get_attribute('/', 'base_input', input%base_text, error)
      end if
      call file%close(ignored)
      if (allocated(error)) return
      if (len_trim(input%text) == 0) call raise(error, path//': its attribute `input` is empty; `resolved_input` is a '// &
                                                'namelist that can be run')
   end subroutine read_result

end module rodyn_input_texts
