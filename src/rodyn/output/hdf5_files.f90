!> HDF5 files as the program needs them; the only module that knows the HDF5 library.
!>
!> Objects are addressed by name ('/' is the root, 'solver' a group, 'phi' a data set); no handle but the file's
!> own lives longer than a call. Shapes are Fortran's: `(rod, time)` here is `(time, rod)` in C and Python.
!> Files are readable by HDF5 1.8 and later and carry no time stamps: equal contents are equal bytes.
!> A failed library call becomes a message with the call, the object, the path and the library's own reason. A failure in writing
!> is kept: whatever is to be written after it is not, and `get_failure`, `flush` and `close` return it.
module rodyn_hdf5_files
   use, intrinsic :: iso_c_binding, only: c_bool, c_char, c_f_pointer, c_funloc, c_funptr, c_int, c_int64_t, c_loc, c_ptr
   use, intrinsic :: iso_fortran_env, only: int32, int64
   use hdf5, only: hid_t, hsize_t, size_t, h5dont_atexit_f, h5open_f, h5get_libversion_f, h5eset_auto_f, &
      h5fcreate_f, h5fopen_f, h5fclose_f, h5fflush_f, h5f_acc_excl_f, h5f_acc_rdonly_f, h5f_close_strong_f, &
      h5f_libver_v18_f, h5f_scope_local_f, &
      h5pcreate_f, h5pclose_f, h5p_file_access_f, h5p_file_create_f, h5p_group_create_f, h5p_dataset_create_f, &
      h5pset_fclose_degree_f, h5pset_libver_bounds_f, h5pset_obj_track_times_f, h5pset_chunk_f, &
      h5pset_shuffle_f, h5pset_deflate_f, h5pset_fletcher32_f, &
      h5gcreate_f, h5gclose_f, &
      h5screate_f, h5screate_simple_f, h5sclose_f, h5s_scalar_f, h5s_unlimited_f, h5s_select_set_f, &
      h5sselect_hyperslab_f, h5sget_simple_extent_ndims_f, h5sget_simple_extent_dims_f, &
      h5sget_simple_extent_npoints_f, &
      h5tcopy_f, h5tclose_f, h5tset_size_f, h5tset_strpad_f, h5tset_cset_f, h5tget_size_f, h5tget_class_f, h5t_string_f, &
      h5tis_variable_str_f, &
      h5t_str_nullpad_f, h5t_str_spacepad_f, h5t_cset_ascii_f, h5t_cset_utf8_f, &
      h5t_fortran_s1, h5t_ieee_f64le, h5t_std_i32le, h5t_std_i64le, &
      h5t_native_double, h5kind_to_type, h5_integer_kind, &
      h5dcreate_f, h5dopen_f, h5dclose_f, h5dwrite_f, h5dread_f, h5dset_extent_f, h5dget_space_f, &
      h5acreate_by_name_f, h5aopen_by_name_f, h5aexists_by_name_f, h5adelete_by_name_f, h5aclose_f, h5awrite_f, &
      h5aread_f, h5aget_type_f, h5aget_space_f
   use h5ds, only: h5dsset_scale_f, h5dsattach_scale_f
   use rodyn_errors, only: error_type, raise
   use rodyn_kinds, only: wp
   use rodyn_posix, only: c_text
   implicit none (type, external)
   private
   public :: hdf5_file, hdf5_version

   integer, parameter :: max_rank = 7
   integer, parameter :: longest_reason = 512 !! of the library's failures [bytes]
   integer(size_t), parameter :: longest_text = 256*1024*1024 !! of an attribute [bytes]

   !> An open file. Leaving the scope closes it, silently: call `close` to hear of failures.
   type :: hdf5_file
      character(len=:), allocatable :: path
      integer(hid_t), private :: id = -1_hid_t
      type(error_type), allocatable, private :: error !! first failure in writing
   contains
      procedure :: create
      procedure :: open
      procedure :: is_open
      procedure :: flush => flush_file
      procedure :: close => close_file
      procedure :: get_failure
      procedure :: create_group
      procedure :: create_series
      procedure :: create_texts
      generic :: append => append_reals, append_int64, append_texts
      generic :: write => write_integers, write_reals
      procedure :: make_scale
      procedure :: attach_scale
      generic :: put_attribute => put_text, put_real, put_int32, put_int64, put_logical
      procedure :: has_attribute
      generic :: get_attribute => get_text, get_real
      procedure, private :: failed
      procedure, private :: note
      procedure, private :: fails
      procedure, private :: append_reals, append_int64, append_texts, append_block
      procedure, private :: write_integers, write_reals, write_whole
      procedure, private :: put_text, put_real, put_int32, put_int64, put_logical, put_number
      procedure, private :: get_text, get_real
      final :: finalize
   end type hdf5_file

   !> H5E_error2_t of the C library: one record of its error stack.
   type, bind(c) :: error_record
      integer(c_int64_t) :: class_id
      integer(c_int64_t) :: major
      integer(c_int64_t) :: minor
      integer(c_int) :: line
      type(c_ptr) :: function_name
      type(c_ptr) :: file_name
      type(c_ptr) :: description
   end type error_record

   interface
      ! The Fortran interface can only print the error stack; the reason is wanted as text.
      integer(c_int) function h5ewalk2(stack, direction, callback, client_data) bind(c, name='H5Ewalk2')
         import :: c_funptr, c_int, c_int64_t, c_ptr
         implicit none (type, external)
         integer(c_int64_t), value :: stack
         integer(c_int), value :: direction
         type(c_funptr), value :: callback
         type(c_ptr), value :: client_data
      end function h5ewalk2

      ! not in the Fortran interface of HDF5 1.10
      integer(c_int) function h5pset_file_locking(access_list, use_locks, ignore_when_disabled) &
         bind(c, name='H5Pset_file_locking')
         import :: c_bool, c_int, c_int64_t
         implicit none (type, external)
         integer(c_int64_t), value :: access_list
         logical(c_bool), value :: use_locks, ignore_when_disabled
      end function h5pset_file_locking
   end interface

contains

   !> Version of the library in use, '1.10.8'.
   function hdf5_version() result(text)
      character(len=:), allocatable :: text
      character(len=32) :: buffer
      integer :: major, minor, release, status

      call h5get_libversion_f(major, minor, release, status)
      write (buffer, '(i0, ".", i0, ".", i0)') major, minor, release
      text = trim(buffer)
   end function hdf5_version

   !> Make a new file; an existing one is never touched, that is an error.
   subroutine create(self, path, error)
      class(hdf5_file), intent(inout) :: self
      character(len=*), intent(in) :: path
      type(error_type), allocatable, intent(out) :: error
      integer(hid_t) :: access_list, creation_list
      integer :: status

      if (allocated(self%error)) deallocate (self%error)
      call start_library()
      self%path = path
      call new_access_list(access_list)
      call h5pcreate_f(h5p_file_create_f, creation_list, status)
      call h5pset_obj_track_times_f(creation_list, .false., status)
      call h5fcreate_f(path, h5f_acc_excl_f, self%id, status, creation_list, access_list)
      if (self%failed(status, 'h5fcreate_f', '/', error)) self%id = -1_hid_t
      call h5pclose_f(creation_list, status)
      call h5pclose_f(access_list, status)
   end subroutine create

   !> Open an existing file for reading.
   subroutine open(self, path, error)
      class(hdf5_file), intent(inout) :: self
      character(len=*), intent(in) :: path
      type(error_type), allocatable, intent(out) :: error
      integer(hid_t) :: access_list
      integer :: status

      call start_library()
      self%path = path
      call new_access_list(access_list)
      call h5fopen_f(path, h5f_acc_rdonly_f, self%id, status, access_list)
      if (self%failed(status, 'h5fopen_f', '/', error)) self%id = -1_hid_t
      call h5pclose_f(access_list, status)
   end subroutine open

   !> Is a file open?
   pure function is_open(self)
      class(hdf5_file), intent(in) :: self
      logical :: is_open
      is_open = self%id >= 0_hid_t
   end function is_open

   !> Hand everything written so far to the operating system.
   subroutine flush_file(self, error)
      class(hdf5_file), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      integer :: status

      if (.not. allocated(self%error)) then
         call h5fflush_f(self%id, h5f_scope_local_f, status)
         call self%note(status, 'h5fflush_f', '/')
      end if
      call self%get_failure(error)
   end subroutine flush_file

   !> Close the file and whatever of it is still open; nothing happens if it is closed already.
   subroutine close_file(self, error)
      class(hdf5_file), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      integer :: status

      if (.not. self%is_open()) return
      call h5fclose_f(self%id, status)
      self%id = -1_hid_t
      call self%note(status, 'h5fclose_f', '/')
      call move_alloc(self%error, error)
   end subroutine close_file

   !> The first failure in writing, if there was one.
   subroutine get_failure(self, error)
      class(hdf5_file), intent(in) :: self
      type(error_type), allocatable, intent(out) :: error
      if (allocated(self%error)) error = self%error
   end subroutine get_failure

   impure elemental subroutine finalize(self)
      type(hdf5_file), intent(inout) :: self
      type(error_type), allocatable :: error
      call self%close(error)
   end subroutine finalize

   !> Make a group.
   subroutine create_group(self, name)
      class(hdf5_file), intent(inout) :: self
      character(len=*), intent(in) :: name
      integer(hid_t) :: group, creation_list
      integer :: status

      if (allocated(self%error)) return
      call h5pcreate_f(h5p_group_create_f, creation_list, status)
      call h5pset_obj_track_times_f(creation_list, .false., status)
      call h5gcreate_f(self%id, name, group, status, gcpl_id=creation_list)
      if (.not. self%fails(status, 'h5gcreate_f', name)) call h5gclose_f(group, status)
      call h5pclose_f(creation_list, status)
   end subroutine create_group

   !> Make an empty data set of numbers that grows along its last dimension, time.
   subroutine create_series(self, name, row_shape, chunk_rows, compression, whole)
      class(hdf5_file), intent(inout) :: self
      character(len=*), intent(in) :: name
      integer, intent(in) :: row_shape(:) !! shape of one row; empty: one number per time
      integer, intent(in) :: chunk_rows   !! rows per chunk, >= 1; blocks of as many are written fastest
      integer, intent(in) :: compression  !! gzip level, 0..9
      logical, intent(in), optional :: whole !! integers of 64 bits
      integer(hid_t) :: file_type

      file_type = h5t_ieee_f64le
      if (present(whole)) file_type = merge(h5t_std_i64le, h5t_ieee_f64le, whole)
      call new_series(self, name, file_type, row_shape, chunk_rows, compression)
   end subroutine create_series

   !> Make an empty series of texts, one per time. They have one length in the file, or Octave could not read them, nor
   !> filters reach them; and they are called ASCII, whatever they are, as Octave wants it. The attribute is xarray's.
   subroutine create_texts(self, name, length, chunk_rows, compression)
      class(hdf5_file), intent(inout) :: self
      character(len=*), intent(in) :: name
      integer, intent(in) :: length       !! of the longest [bytes]
      integer, intent(in) :: chunk_rows, compression !! as in `create_series`
      integer(hid_t) :: file_type
      integer :: status

      file_type = text_type(length, h5t_str_nullpad_f, h5t_cset_ascii_f)
      call new_series(self, name, file_type, [integer ::], chunk_rows, compression)
      call h5tclose_f(file_type, status)
      call self%put_attribute(name, '_Encoding', 'utf-8')
   end subroutine create_texts

   subroutine new_series(self, name, file_type, row_shape, chunk_rows, compression)
      class(hdf5_file), intent(inout) :: self
      character(len=*), intent(in) :: name
      integer(hid_t), intent(in) :: file_type
      integer, intent(in) :: row_shape(:), chunk_rows, compression
      integer(hid_t) :: set
      integer :: status

      if (allocated(self%error)) return
      call new_dataset(self, name, file_type, int([row_shape, 0], hsize_t), int([row_shape, chunk_rows], hsize_t), .true., &
                       compression, set)
      if (allocated(self%error)) return
      call h5dclose_f(set, status)
      call self%note(status, 'h5dclose_f', name)
   end subroutine new_series

   !> Append rows to a series: numbers, one per time, or arrays, whose last dimension is time.
   subroutine append_reals(self, name, values)
      class(hdf5_file), intent(inout) :: self
      character(len=*), intent(in) :: name
      real(wp), intent(in), contiguous, target :: values(..)
      call self%append_block(name, h5t_native_double, c_loc(values), extent_of(values))
   end subroutine append_reals

   !> Append whole numbers to a series of integers.
   subroutine append_int64(self, name, values)
      class(hdf5_file), intent(inout) :: self
      character(len=*), intent(in) :: name
      integer(int64), intent(in), contiguous, target :: values(:)
      call self%append_block(name, h5kind_to_type(int64, h5_integer_kind), c_loc(values), int(shape(values), hsize_t))
   end subroutine append_int64

   !> Append texts to a series of texts.
   subroutine append_texts(self, name, values)
      class(hdf5_file), intent(inout) :: self
      character(len=*), intent(in) :: name
      character(len=*), intent(in) :: values(:) !! trailing blanks do not count
      character(len=max(1, len(values))), allocatable, target :: texts(:)
      integer(hid_t) :: memory_type
      integer :: status

      if (size(values) == 0) return
      allocate (texts(size(values)))
      texts(:) = values
      memory_type = text_type(len(texts), h5t_str_spacepad_f, h5t_cset_ascii_f)
      call self%append_block(name, memory_type, c_loc(texts), [size(values, kind=hsize_t)])
      call h5tclose_f(memory_type, status)
   end subroutine append_texts

   !> The type of texts of one length.
   function text_type(length, padding, characters)
      integer, intent(in) :: length  !! [bytes]; 0: one null
      integer, intent(in) :: padding !! what fills it up
      integer, intent(in) :: characters !! their set
      integer(hid_t) :: text_type
      integer :: status
      call h5tcopy_f(h5t_fortran_s1, text_type, status)
      call h5tset_size_f(text_type, int(max(1, length), size_t), status)
      call h5tset_strpad_f(text_type, padding, status)
      call h5tset_cset_f(text_type, characters, status)
   end function text_type

   !> Extend a data set along its last dimension and fill the new part.
   subroutine append_block(self, name, memory_type, values, counts)
      class(hdf5_file), intent(inout) :: self
      character(len=*), intent(in) :: name
      integer(hid_t), intent(in) :: memory_type
      type(c_ptr), intent(in) :: values         !! contiguous, of that type
      integer(hsize_t), intent(in) :: counts(:) !! shape of values
      integer(hid_t) :: set, file_space, memory_space
      integer(hsize_t) :: extent(max_rank), most(max_rank), start(size(counts))
      integer :: rank, status

      if (allocated(self%error) .or. any(counts == 0)) return
      rank = size(counts)
      call h5dopen_f(self%id, name, set, status)
      if (self%fails(status, 'h5dopen_f', name)) return
      work: block
         call h5dget_space_f(set, file_space, status)
         if (self%fails(status, 'h5dget_space_f', name)) exit work
         call h5sget_simple_extent_dims_f(file_space, extent, most, status)
         call h5sclose_f(file_space, status)
         start = 0_hsize_t
         start(rank) = extent(rank)
         call h5dset_extent_f(set, [counts(:rank - 1), start(rank) + counts(rank)], status)
         if (self%fails(status, 'h5dset_extent_f', name)) exit work
         call h5dget_space_f(set, file_space, status)
         if (self%fails(status, 'h5dget_space_f', name)) exit work
         call h5sselect_hyperslab_f(file_space, h5s_select_set_f, start, counts, status)
         call h5screate_simple_f(rank, counts, memory_space, status)
         call h5dwrite_f(set, memory_type, values, status, memory_space, file_space)
         call self%note(status, 'h5dwrite_f', name)
         call h5sclose_f(memory_space, status)
         call h5sclose_f(file_space, status)
      end block work
      call h5dclose_f(set, status)
      call self%note(status, 'h5dclose_f', name)
   end subroutine append_block

   !> Write a whole data set of fixed shape, as one chunk with checksum.
   subroutine write_integers(self, name, values, compression)
      class(hdf5_file), intent(inout) :: self
      character(len=*), intent(in) :: name
      integer, intent(in), contiguous, target :: values(:)
      integer, intent(in) :: compression !! gzip level, 0..9
      call self%write_whole(name, h5t_std_i32le, h5kind_to_type(kind(values), h5_integer_kind), c_loc(values), &
         int(shape(values), hsize_t), compression)
   end subroutine write_integers

   subroutine write_reals(self, name, values, compression)
      class(hdf5_file), intent(inout) :: self
      character(len=*), intent(in) :: name
      real(wp), intent(in), contiguous, target :: values(..)
      integer, intent(in) :: compression !! gzip level, 0..9
      call self%write_whole(name, h5t_ieee_f64le, h5t_native_double, c_loc(values), extent_of(values), compression)
   end subroutine write_reals

   !> The shape of an array. (That of an empty one of any rank is negative in gfortran 12.)
   pure function extent_of(values) result(extent)
      real(wp), intent(in) :: values(..)
      integer(hsize_t), allocatable :: extent(:)
      extent = max(0, shape(values))
   end function extent_of

   subroutine write_whole(self, name, file_type, memory_type, values, extent, compression)
      class(hdf5_file), intent(inout) :: self
      character(len=*), intent(in) :: name
      integer(hid_t), intent(in) :: file_type, memory_type
      type(c_ptr), intent(in) :: values
      integer(hsize_t), intent(in) :: extent(:)
      integer, intent(in) :: compression
      integer(hid_t) :: set
      integer :: status

      if (allocated(self%error)) return
      call new_dataset(self, name, file_type, extent, max(extent, 1_hsize_t), .false., compression, set)
      if (allocated(self%error)) return
      if (product(extent) > 0_hsize_t) then
         call h5dwrite_f(set, memory_type, values, status)
         call self%note(status, 'h5dwrite_f', name)
      end if
      call h5dclose_f(set, status)
      call self%note(status, 'h5dclose_f', name)
   end subroutine write_whole

   !> Make a data set with the filters of every data set: shuffle and gzip (level > 0), then a checksum.
   subroutine new_dataset(self, name, file_type, extent, chunk, growing, compression, set)
      class(hdf5_file), intent(inout) :: self
      character(len=*), intent(in) :: name
      integer(hid_t), intent(in) :: file_type
      integer(hsize_t), intent(in) :: extent(:), chunk(:)
      logical, intent(in) :: growing     !! the last dimension has no bound
      integer, intent(in) :: compression !! gzip level, 0..9
      integer(hid_t), intent(out) :: set !! open; the caller closes it
      integer(hsize_t) :: most(size(extent))
      integer(hid_t) :: space, creation_list
      integer :: status

      set = -1_hid_t
      most = extent
      if (growing) most(size(most)) = h5s_unlimited_f
      call h5screate_simple_f(size(extent), extent, space, status, most)
      if (self%fails(status, 'h5screate_simple_f', name)) return
      call h5pcreate_f(h5p_dataset_create_f, creation_list, status)
      work: block
         call h5pset_obj_track_times_f(creation_list, .false., status)
         call h5pset_chunk_f(creation_list, size(chunk), chunk, status)
         if (self%fails(status, 'h5pset_chunk_f', name)) exit work
         if (compression > 0) then
            call h5pset_shuffle_f(creation_list, status)
            if (self%fails(status, 'h5pset_shuffle_f', name)) exit work
            call h5pset_deflate_f(creation_list, compression, status)
            if (self%fails(status, 'h5pset_deflate_f', name)) exit work
         end if
         call h5pset_fletcher32_f(creation_list, status)
         if (self%fails(status, 'h5pset_fletcher32_f', name)) exit work
         call h5dcreate_f(self%id, name, file_type, space, set, status, dcpl_id=creation_list)
         if (self%fails(status, 'h5dcreate_f', name)) exit work
      end block work
      call h5pclose_f(creation_list, status)
      call h5sclose_f(space, status)
   end subroutine new_dataset

   !> Turn a data set into a dimension scale, the coordinate of a dimension of the same name.
   subroutine make_scale(self, name)
      class(hdf5_file), intent(inout) :: self
      character(len=*), intent(in) :: name
      integer(hid_t) :: set
      integer :: status

      if (allocated(self%error)) return
      call h5dopen_f(self%id, name, set, status)
      if (self%fails(status, 'h5dopen_f', name)) return
      call h5dsset_scale_f(set, status, name(index(name, '/', back=.true.) + 1:))
      call self%note(status, 'h5dsset_scale_f', name)
      call h5dclose_f(set, status)
   end subroutine make_scale

   !> Attach a dimension scale to one dimension of a data set.
   subroutine attach_scale(self, name, dimension, scale)
      class(hdf5_file), intent(inout) :: self
      character(len=*), intent(in) :: name
      integer, intent(in) :: dimension      !! 1: the first of the Fortran array
      character(len=*), intent(in) :: scale !! data set after `make_scale`
      integer(hid_t) :: set, scale_set, space
      integer :: rank, status

      if (allocated(self%error)) return
      call h5dopen_f(self%id, name, set, status)
      if (self%fails(status, 'h5dopen_f', name)) return
      call h5dopen_f(self%id, scale, scale_set, status)
      if (.not. self%fails(status, 'h5dopen_f', scale)) then
         call h5dget_space_f(set, space, status)
         call h5sget_simple_extent_ndims_f(space, rank, status)
         call h5sclose_f(space, status)
         ! unlike the rest of the Fortran interface, this call counts dimensions (from 1) in C order
         call h5dsattach_scale_f(set, scale_set, rank - dimension + 1, status)
         call self%note(status, 'h5dsattach_scale_f', name//' to '//scale)
         call h5dclose_f(scale_set, status)
      end if
      call h5dclose_f(set, status)
   end subroutine attach_scale

   !> Write a text attribute: scalar, fixed length, UTF-8, padded with nulls; of any length. An empty text
   !> is one null. An attribute of that name is replaced.
   subroutine put_text(self, object, name, value)
      class(hdf5_file), intent(inout) :: self
      character(len=*), intent(in) :: object !! '/' for the root
      character(len=*), intent(in) :: name
      character(len=*), intent(in) :: value
      integer(hid_t) :: value_type, attribute
      integer :: status

      if (allocated(self%error)) return
      value_type = text_type(len(value), h5t_str_nullpad_f, h5t_cset_utf8_f)
      call new_attribute(self, object, name, value_type, attribute)
      if (.not. allocated(self%error)) then
         call h5awrite_f(attribute, value_type, value//achar(0), [1_hsize_t], status) ! as much of it as the type is long
         call self%note(status, 'h5awrite_f', object//'@'//name)
         call h5aclose_f(attribute, status)
      end if
      call h5tclose_f(value_type, status)
   end subroutine put_text

   subroutine put_real(self, object, name, value)
      class(hdf5_file), intent(inout) :: self
      character(len=*), intent(in) :: object, name
      real(wp), intent(in), target :: value
      call self%put_number(object, name, h5t_ieee_f64le, h5t_native_double, c_loc(value))
   end subroutine put_real

   subroutine put_int32(self, object, name, value)
      class(hdf5_file), intent(inout) :: self
      character(len=*), intent(in) :: object, name
      integer(int32), intent(in), target :: value
      call self%put_number(object, name, h5t_std_i32le, h5kind_to_type(int32, h5_integer_kind), c_loc(value))
   end subroutine put_int32

   subroutine put_int64(self, object, name, value)
      class(hdf5_file), intent(inout) :: self
      character(len=*), intent(in) :: object, name
      integer(int64), intent(in), target :: value
      call self%put_number(object, name, h5t_std_i64le, h5kind_to_type(int64, h5_integer_kind), c_loc(value))
   end subroutine put_int64

   !> Write a logical as an integer, 0 or 1.
   subroutine put_logical(self, object, name, value)
      class(hdf5_file), intent(inout) :: self
      character(len=*), intent(in) :: object, name
      logical, intent(in) :: value
      call self%put_int32(object, name, merge(1_int32, 0_int32, value))
   end subroutine put_logical

   subroutine put_number(self, object, name, file_type, memory_type, value)
      class(hdf5_file), intent(inout) :: self
      character(len=*), intent(in) :: object, name
      integer(hid_t), intent(in) :: file_type, memory_type
      type(c_ptr), intent(in) :: value
      integer(hid_t) :: attribute
      integer :: status

      if (allocated(self%error)) return
      call new_attribute(self, object, name, file_type, attribute)
      if (allocated(self%error)) return
      call h5awrite_f(attribute, memory_type, value, status)
      call self%note(status, 'h5awrite_f', object//'@'//name)
      call h5aclose_f(attribute, status)
   end subroutine put_number

   !> Make a scalar attribute, in the place of one with that name.
   subroutine new_attribute(self, object, name, file_type, attribute)
      class(hdf5_file), intent(inout) :: self
      character(len=*), intent(in) :: object, name
      integer(hid_t), intent(in) :: file_type
      integer(hid_t), intent(out) :: attribute !! open; the caller closes it
      integer(hid_t) :: space
      integer :: status
      logical :: present_already

      attribute = -1_hid_t
      call h5aexists_by_name_f(self%id, object, name, present_already, status)
      if (self%fails(status, 'h5aexists_by_name_f', object//'@'//name)) return
      if (present_already) then
         call h5adelete_by_name_f(self%id, object, name, status)
         if (self%fails(status, 'h5adelete_by_name_f', object//'@'//name)) return
      end if
      call h5screate_f(h5s_scalar_f, space, status)
      if (self%fails(status, 'h5screate_f', object//'@'//name)) return
      call h5acreate_by_name_f(self%id, object, name, file_type, space, attribute, status)
      call self%note(status, 'h5acreate_by_name_f', object//'@'//name)
      call h5sclose_f(space, status)
   end subroutine new_attribute

   !> Does an object have an attribute of this name?
   function has_attribute(self, object, name)
      class(hdf5_file), intent(in) :: self
      character(len=*), intent(in) :: object !! '/' for the root
      character(len=*), intent(in) :: name
      logical :: has_attribute
      integer :: status

      call h5aexists_by_name_f(self%id, object, name, has_attribute, status)
      if (status /= 0) has_attribute = .false.
   end function has_attribute

   !> Read a text attribute, scalar and of fixed length, without its padding nulls.
   subroutine get_text(self, object, name, value, error)
      class(hdf5_file), intent(in) :: self
      character(len=*), intent(in) :: object !! '/' for the root
      character(len=*), intent(in) :: name
      character(len=:), allocatable, intent(out) :: value
      type(error_type), allocatable, intent(out) :: error
      integer(hid_t) :: attribute, text_type
      integer(size_t) :: length
      integer :: status, used

      call h5aopen_by_name_f(self%id, object, name, attribute, status)
      if (self%failed(status, 'h5aopen_by_name_f', object//'@'//name, error)) return
      work: block
         call h5aget_type_f(attribute, text_type, status)
         if (self%failed(status, 'h5aget_type_f', object//'@'//name, error)) exit work
         if (.not. is_plain_text(attribute, text_type, length)) then
            call raise(error, "'"//object//'@'//name//"' of "//self%path//' is not a scalar text of fixed length')
         else
            allocate (character(len=length) :: value)
            call h5aread_f(attribute, text_type, value, [1_hsize_t], status)
            if (self%failed(status, 'h5aread_f', object//'@'//name, error)) continue
         end if
         call h5tclose_f(text_type, status)
      end block work
      call h5aclose_f(attribute, status)
      if (allocated(error)) return
      used = verify(value, achar(0), back=.true.)
      value = value(:used)
   end subroutine get_text

   !> Is an attribute one text of fixed length? Files may be damaged, or of other programs.
   logical function is_plain_text(attribute, text_type, length)
      integer(hid_t), intent(in) :: attribute, text_type
      integer(size_t), intent(out) :: length !! bytes
      integer(hid_t) :: space
      integer(hsize_t) :: n_points
      integer :: class, rank, status
      logical :: variable

      length = 0
      is_plain_text = .false.
      call h5tget_class_f(text_type, class, status)
      if (status < 0 .or. class /= h5t_string_f) return
      call h5tis_variable_str_f(text_type, variable, status)
      if (status < 0 .or. variable) return
      call h5aget_space_f(attribute, space, status)
      if (status < 0) return
      call h5sget_simple_extent_ndims_f(space, rank, status)
      call h5sget_simple_extent_npoints_f(space, n_points, status) ! none in a null space
      is_plain_text = status >= 0 .and. rank == 0 .and. n_points == 1
      call h5sclose_f(space, status)
      call h5tget_size_f(text_type, length, status)
      is_plain_text = is_plain_text .and. status >= 0 .and. length <= longest_text
   end function is_plain_text

   subroutine get_real(self, object, name, value, error)
      class(hdf5_file), intent(in) :: self
      character(len=*), intent(in) :: object, name
      real(wp), target, intent(out) :: value
      type(error_type), allocatable, intent(out) :: error
      type(c_ptr) :: buffer
      integer(hid_t) :: attribute
      integer :: status

      value = 0.0_wp
      buffer = c_loc(value)
      call h5aopen_by_name_f(self%id, object, name, attribute, status)
      if (self%failed(status, 'h5aopen_by_name_f', object//'@'//name, error)) return
      call h5aread_f(attribute, h5t_native_double, buffer, status)
      if (self%failed(status, 'h5aread_f', object//'@'//name, error)) continue
      call h5aclose_f(attribute, status)
   end subroutine get_real

   !> Start the library once and keep it from printing; its reasons go into our messages. Nor does it clean up
   !> when the program ends: all files are closed by then, except one that could not be (full disk), on which
   !> HDF5 1.10 would crash.
   subroutine start_library()
      logical, save :: started = .false.
      integer :: status

      if (started) return
      call h5dont_atexit_f(status)
      call h5open_f(status)
      call h5eset_auto_f(0, status)
      started = .true.
   end subroutine start_library

   !> Access properties of every file: format of HDF5 1.8 (attributes beyond 64 KiB, checksummed metadata), closing the
   !> file closes all that failed calls left open, and no locks. A file being written has a name of its own, so that nobody
   !> else writes it, anybody may look at it, and file systems without locks will do.
   subroutine new_access_list(access_list)
      integer(hid_t), intent(out) :: access_list
      integer :: status

      call h5pcreate_f(h5p_file_access_f, access_list, status)
      call h5pset_libver_bounds_f(access_list, h5f_libver_v18_f, h5f_libver_v18_f, status)
      call h5pset_fclose_degree_f(access_list, h5f_close_strong_f, status)
      status = h5pset_file_locking(access_list, .false._c_bool, .true._c_bool)
   end subroutine new_access_list

   !> Did a library call fail? If so, `error` names the call, the object, the path and the reason. To be called
   !> right after the call, before the library forgets why.
   function failed(self, status, call_name, object, error)
      class(hdf5_file), intent(in) :: self
      integer, intent(in) :: status !! the call's return code
      character(len=*), intent(in) :: call_name
      character(len=*), intent(in) :: object
      type(error_type), allocatable, intent(inout) :: error !! allocated: it failed
      logical :: failed

      failed = status < 0
      if (.not. failed) return
      call raise(error, self%path//": HDF5 call "//call_name//" failed on '"//object//"': "//library_reason())
   end function failed

   !> Keep the failure of a library call in writing, if it is the first.
   subroutine note(self, status, call_name, object)
      class(hdf5_file), intent(inout) :: self
      integer, intent(in) :: status !! the call's return code
      character(len=*), intent(in) :: call_name, object
      type(error_type), allocatable :: error

      if (.not. self%failed(status, call_name, object, error)) return
      if (.not. allocated(self%error)) call move_alloc(error, self%error)
   end subroutine note

   !> The same; did it fail?
   logical function fails(self, status, call_name, object)
      class(hdf5_file), intent(inout) :: self
      integer, intent(in) :: status
      character(len=*), intent(in) :: call_name, object
      call self%note(status, call_name, object)
      fails = status < 0
   end function fails

   !> The library's own words for its last failure.
   function library_reason() result(text)
      character(len=:), allocatable :: text
      character(len=*), parameter :: mark = "error message = '"
      character(kind=c_char, len=longest_reason), target :: buffer
      integer(c_int) :: status
      integer :: first, length
      logical :: no_lock

      buffer = ' '
      status = h5ewalk2(0_c_int64_t, 0_c_int, c_funloc(keep_first_record), c_loc(buffer))
      text = trim(buffer)
      if (len(text) == 0) text = 'no reason given'

      ! of a failed system call only its reason is of use
      first = index(text, mark)
      if (first == 0) return
      no_lock = index(text, 'unable to lock file') == 1 .and. index(text, 'errno = 11,') == 0 ! EAGAIN: another has it
      first = first + len(mark)
      length = index(text(first:), "'") - 1
      if (length > 0) text = text(first:first + length - 1)
      if (no_lock) text = text//' (the file system has no locks: set HDF5_USE_FILE_LOCKING=FALSE)'
   end function library_reason

   !> Copy the description of the innermost record of the error stack and end the walk.
   function keep_first_record(position, record, client_data) result(stop_here) bind(c)
      integer(c_int), value :: position        !! 0 for the innermost
      type(error_record), intent(in) :: record
      type(c_ptr), value :: client_data        !! character(len=longest_reason)
      integer(c_int) :: stop_here
      character(kind=c_char, len=longest_reason), pointer :: text

      stop_here = 1_c_int
      call c_f_pointer(client_data, text)
      if (position == 0) text = c_text(record%description)
   end function keep_first_record

end module rodyn_hdf5_files
