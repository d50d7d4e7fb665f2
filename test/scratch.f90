!> Names for temporary files of tests.
module test_scratch
   use rodyn_posix, only: path_exists, process_id, remove_file
   implicit none (type, external)
   private
   public :: scratch_path, clean

contains

   !> A path under TMPDIR (or /tmp) that belongs to this process.
   function scratch_path(name) result(path)
      character(len=*), intent(in) :: name
      character(len=:), allocatable :: path
      character(len=1000) :: directory
      character(len=32) :: number
      integer :: length, status

      call get_environment_variable('TMPDIR', directory, length, status)
      if (status /= 0 .or. length == 0) directory = '/tmp'
      write (number, '("/rodyn-test-", i0, "-")') process_id()
      path = trim(directory)//trim(number)//name
   end function scratch_path

   !> Remove a file if it is there.
   subroutine clean(path)
      character(len=*), intent(in) :: path
      character(len=:), allocatable :: failure
      if (path_exists(path)) failure = remove_file(path)
   end subroutine clean

end module test_scratch
