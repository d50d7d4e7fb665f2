!> A whole file as one text, byte by byte as it is.
module rodyn_file_text
   use rodyn_kinds, only: i8
   use rodyn_errors, only: error_type, raise, exit_bad_input
   implicit none (type, external)
   private
   public :: read_text_file

   integer(i8), parameter :: largest_file = 256_i8*1024*1024 !! bytes; no namelist comes near

contains

   !> Read a file. A path that names no readable file raises an error with exit code 2.
   subroutine read_text_file(path, text, error)
      character(len=*), intent(in) :: path
      character(len=:), allocatable, intent(out) :: text
      type(error_type), allocatable, intent(out) :: error
      character(len=len(path) + 300) :: reason ! the system's message repeats the path
      integer :: stat, unit
      integer(i8) :: bytes

      if (len_trim(path) == 0) then
         call raise(error, 'the path of the input file is empty', exit_bad_input)
         return
      end if
      open (newunit=unit, file=path, access='stream', form='unformatted', status='old', action='read', &
         iostat=stat, iomsg=reason)
      if (stat /= 0) then
         call refuse(path, reason, error)
         return
      end if
      inquire (unit=unit, size=bytes)
      if (bytes < 0 .or. bytes > largest_file) then
         call refuse(path, 'not a file of at most 256 MB', error)
      else
         allocate (character(len=int(bytes)) :: text)
         if (bytes > 0) read (unit, iostat=stat, iomsg=reason) text
         if (stat /= 0) call refuse(path, reason, error)
      end if
      close (unit)
   end subroutine read_text_file

   !> The last part of the system's message says why.
   subroutine refuse(path, reason, error)
      character(len=*), intent(in) :: path, reason
      type(error_type), allocatable, intent(out) :: error
      integer :: first
      first = index(reason, ': ', back=.true.) + 1
      call raise(error, path//': cannot be read ('//trim(adjustl(reason(first:)))//')', exit_bad_input)
   end subroutine refuse

end module rodyn_file_text
