!> Modes as an HDF5 file: a table, array by array.
module rodyn_modes_file
   use rodyn_errors, only: error_type
   use rodyn_kinds, only: wp
   use rodyn_result_file, only: result_file
   use rodyn_result_table, only: result_array, result_table
   use rodyn_run_report, only: provenance
   implicit none (type, external)
   private
   public :: write_modes

   integer, parameter :: compression = 4

contains

   !> Write everything and give the file its name.
   subroutine write_modes(path, force, origin, table, error)
      character(len=*), intent(in) :: path
      logical, intent(in) :: force             !! replace an existing file
      type(provenance), intent(in) :: origin
      type(result_table), intent(in) :: table
      type(error_type), allocatable, intent(out) :: error
      type(result_file) :: file
      integer :: i

      call file%begin(path, force, error)
      if (allocated(error)) return
      call file%write_provenance(origin)
      do i = 1, table%n
         call write_array(file, table%arrays(i))
      end do
      call file%put_attributes('/', table%attributes)
      call file%complete('done', error)
   end subroutine write_modes

   !> One data set, over the scales that have been written before; one that is over itself becomes a scale.
   subroutine write_array(file, array)
      type(result_file), intent(inout) :: file
      type(result_array), intent(in), target :: array
      character(len=:), allocatable :: name
      real(wp), pointer :: matrix(:, :)

      name = trim(array%name)
      if (allocated(array%texts)) then
         call file%file%create_texts(name, array%text_length, size(array%texts), compression)
         call file%file%append(name, array%texts(:)(:array%text_length))
      else if (allocated(array%integers)) then
         call file%file%write(name, array%integers, compression)
      else if (array%dims(2) == '') then
         call file%file%write(name, array%reals, compression)
      else
         matrix(1:array%shape(2), 1:array%shape(1)) => array%reals
         call file%file%write(name, matrix, compression)
      end if
      if (len(array%units) > 0) call file%file%put_attribute(name, 'units', array%units)
      call file%file%put_attribute(name, 'long_name', array%long_name)
      if (array%dims(1) == array%name) then
         call file%file%make_scale(name)
      else if (array%dims(2) == '') then
         call file%file%attach_scale(name, 1, trim(array%dims(1)))
      else
         call file%file%attach_scale(name, 1, trim(array%dims(2)))
         call file%file%attach_scale(name, 2, trim(array%dims(1)))
      end if
   end subroutine write_array

end module rodyn_modes_file
