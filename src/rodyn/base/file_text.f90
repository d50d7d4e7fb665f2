!> A whole file, or standard input, as one text, byte by byte as it is.
module rodyn_file_text
   use rodyn_errors, only: error_type, raise, exit_bad_input
   use rodyn_posix, only: read_all
   implicit none (type, external)
   private
   public :: read_text_file, read_standard_input, standard_input

   integer, parameter :: largest_file = 256*1024*1024 !! bytes; no namelist comes near
   character(len=*), parameter :: standard_input = 'standard input' !! what messages call it

contains

   !> Read a file, or anything else that can be read to an end, such as a pipe. A path behind which nothing can be read raises an
   !> error with exit code 2.
   subroutine read_text_file(path, text, error)
      character(len=*), intent(in) :: path
      character(len=:), allocatable, intent(out) :: text
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: failure

      if (len_trim(path) == 0) then
         call raise(error, 'the path of the input file is empty', exit_bad_input)
         return
      end if
      call read_all(path, largest_file, text, failure)
      if (len(failure) > 0) call raise(error, path//': cannot be read ('//failure//')', exit_bad_input)
   end subroutine read_text_file

   !> Read standard input to its end.
   subroutine read_standard_input(text, error)
      character(len=:), allocatable, intent(out) :: text
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: failure

      call read_all('', largest_file, text, failure)
      if (len(failure) > 0) call raise(error, standard_input//': cannot be read ('//failure//')', exit_bad_input)
   end subroutine read_standard_input

end module rodyn_file_text
