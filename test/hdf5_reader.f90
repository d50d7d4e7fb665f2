!> Numbers out of HDF5 files, read by the library itself: the program writes them and reads none.
module test_hdf5_reader
   use, intrinsic :: iso_c_binding, only: c_loc, c_ptr
   use hdf5, only: hid_t, hsize_t, h5open_f, h5fopen_f, h5fclose_f, h5f_acc_rdonly_f, h5lexists_f, h5dopen_f, h5dclose_f, &
      h5dread_f, h5dget_space_f, h5sclose_f, h5sget_simple_extent_ndims_f, h5sget_simple_extent_dims_f, h5t_native_double, &
      h5aopen_by_name_f, h5aread_f, h5aclose_f
   use rodyn_errors, only: error_type, raise
   use rodyn_kinds, only: wp
   implicit none (type, external)
   private
   public :: has_set, read_set, read_attribute

contains

   !> Is there a group or data set of this name?
   logical function has_set(path, name)
      character(len=*), intent(in) :: path, name
      integer(hid_t) :: file
      integer :: status

      call h5open_f(status)
      call h5fopen_f(path, h5f_acc_rdonly_f, file, status)
      call h5lexists_f(file, name, has_set, status)
      if (status /= 0) has_set = .false.
      call h5fclose_f(file, status)
   end function has_set

   !> A whole data set of numbers.
   subroutine read_set(path, name, extent, values, error)
      character(len=*), intent(in) :: path, name
      integer, allocatable, intent(out) :: extent(:) !! its shape
      real(wp), allocatable, target, intent(out) :: values(:) !! in the order of memory
      type(error_type), allocatable, intent(out) :: error
      integer(hid_t) :: file, set, space
      integer(hsize_t) :: sizes(7), most(7)
      type(c_ptr) :: buffer
      integer :: rank, status, ignored

      call h5open_f(status)
      call h5fopen_f(path, h5f_acc_rdonly_f, file, status)
      if (status == 0) call h5dopen_f(file, name, set, status)
      if (status == 0) then
         call h5dget_space_f(set, space, status)
         call h5sget_simple_extent_ndims_f(space, rank, status)
         call h5sget_simple_extent_dims_f(space, sizes, most, status)
         call h5sclose_f(space, status)
         extent = int(sizes(:rank))
         allocate (values(product(extent)))
         buffer = c_loc(values)
         call h5dread_f(set, h5t_native_double, buffer, status)
         call h5dclose_f(set, ignored)
      end if
      if (status /= 0) call raise(error, name//' of '//path//': cannot be read')
      call h5fclose_f(file, ignored)
   end subroutine read_set

   !> An attribute that is a number.
   subroutine read_attribute(path, object, name, value, error)
      character(len=*), intent(in) :: path, object, name
      real(wp), target, intent(out) :: value
      type(error_type), allocatable, intent(out) :: error
      integer(hid_t) :: file, attribute
      type(c_ptr) :: buffer
      integer :: status, ignored

      value = 0.0_wp
      buffer = c_loc(value)
      call h5open_f(status)
      call h5fopen_f(path, h5f_acc_rdonly_f, file, status)
      if (status == 0) call h5aopen_by_name_f(file, object, name, attribute, status)
      if (status == 0) then
         call h5aread_f(attribute, h5t_native_double, buffer, status)
         call h5aclose_f(attribute, ignored)
      end if
      if (status /= 0) call raise(error, object//'@'//name//' of '//path//': cannot be read')
      call h5fclose_f(file, ignored)
   end subroutine read_attribute

end module test_hdf5_reader
