!> HDF5 files: what is written is read back, and failures are told.
module test_hdf5_files
   use rodyn_errors, only: error_type
   use rodyn_hdf5_files, only: hdf5_file
   use rodyn_kinds, only: i8, wp
   use test_hdf5_reader, only: has_set, read_attribute, read_set
   use test_scratch, only: clean, scratch_path
   use test_testing, only: check, check_close, new_test, unittest
   implicit none (type, external)
   private
   public :: collect_hdf5_files

   real(wp), parameter :: exact = 0.0_wp

contains

   subroutine collect_hdf5_files(suite)
      type(unittest), allocatable, intent(out) :: suite(:)
      suite = [ &
         new_test('attributes of every kind are read back', test_attributes), &
         new_test('a text attribute of a megabyte is read back', test_long_text), &
         new_test('an attribute written twice has the second value', test_replaced_attribute), &
         new_test('a series appended in blocks is read back whole', test_series), &
         new_test('whole data sets of rank 1 to 3 are read back', test_whole), &
         new_test('equal contents are equal bytes', test_equal_bytes), &
         new_test('an existing file is never made anew', test_no_clobber), &
         new_test('a missing file is told with call, path and reason', test_missing_file), &
         new_test('a file that is not HDF5 is told', test_not_hdf5), &
         new_test('a flipped bit is noticed by the checksum', test_flipped_bit), &
         new_test('a missing attribute is an error with its name', test_missing_attribute), &
         new_test('after a failure nothing more is written, and the first failure is told', test_first_failure)]
   end subroutine collect_hdf5_files

   subroutine test_attributes(error)
      type(error_type), allocatable, intent(out) :: error
      type(hdf5_file) :: file
      character(len=:), allocatable :: path, text, empty
      type(error_type), allocatable :: refusal
      real(wp) :: number

      path = scratch_path('attributes.h5')
      work: block
         call file%create(path, error)
         if (allocated(error)) exit work
         call file%create_group('solver')
         call file%put_attribute('/', 'text', 'Стержни, 5 µm'//new_line('a')//'  two  ')
         call file%put_attribute('/', 'empty', '')
         call file%put_attribute('solver', 'number', 0.1_wp)
         call file%put_attribute('solver', 'count', -7)
         call file%put_attribute('solver', 'long_count', 5000000000_i8)
         call file%put_attribute('solver', 'flag', .true.)
         call file%close(error)
         if (allocated(error)) exit work

         call file%open(path, error)
         if (allocated(error)) exit work
         call file%get_attribute('/', 'text', text, error)
         if (allocated(error)) exit work
         call file%get_attribute('/', 'empty', empty, error)
         if (allocated(error)) exit work
         call file%get_attribute('solver', 'number', number, error)
         if (allocated(error)) exit work
         call check(error, text, 'Стержни, 5 µm'//new_line('a')//'  two  ', 'text')
         if (allocated(error)) exit work
         call check(error, empty, '', 'empty text')
         if (allocated(error)) exit work
         call check_close(error, number, 0.1_wp, exact, 'number')
         if (allocated(error)) exit work
         call check(error, file%has_attribute('solver', 'flag'), 'has_attribute')
         if (allocated(error)) exit work
         call check(error, .not. file%has_attribute('solver', 'other'), 'has_attribute of a missing one')
         call file%close(refusal)
         call expect('count', -7.0_wp)
         call expect('long_count', 5.0e9_wp)
         call expect('flag', 1.0_wp)
      end block work
      call clean(path)

   contains

      subroutine expect(name, expected)
         character(len=*), intent(in) :: name
         real(wp), intent(in) :: expected
         if (allocated(error)) return
         call read_attribute(path, 'solver', name, number, error)
         call check_close(error, number, expected, exact, name)
      end subroutine expect

   end subroutine test_attributes

   subroutine test_long_text(error)
      type(error_type), allocatable, intent(out) :: error
      type(hdf5_file) :: file
      character(len=:), allocatable :: path, text, again

      path = scratch_path('long.h5')
      text = repeat('length = 1.5, ! metre'//new_line('a'), 50000)
      work: block
         call file%create(path, error)
         if (allocated(error)) exit work
         call file%put_attribute('/', 'input', text)
         call file%close(error)
         if (allocated(error)) exit work
         call file%open(path, error)
         if (allocated(error)) exit work
         call file%get_attribute('/', 'input', again, error)
         if (allocated(error)) exit work
         call check(error, again == text .and. len(again) == len(text), 'the long text differs')
      end block work
      call clean(path)
   end subroutine test_long_text

   subroutine test_replaced_attribute(error)
      type(error_type), allocatable, intent(out) :: error
      type(hdf5_file) :: file
      character(len=:), allocatable :: path, text

      path = scratch_path('replaced.h5')
      work: block
         call file%create(path, error)
         if (allocated(error)) exit work
         call file%put_attribute('/', 'status', 'running')
         call file%put_attribute('/', 'status', 'done')
         call file%get_failure(error)
         if (allocated(error)) exit work
         call file%get_attribute('/', 'status', text, error)
         if (allocated(error)) exit work
         call check(error, text, 'done', 'status')
      end block work
      call clean(path)
   end subroutine test_replaced_attribute

   subroutine test_series(error)
      type(error_type), allocatable, intent(out) :: error
      type(hdf5_file) :: file
      character(len=:), allocatable :: path
      real(wp), allocatable :: times(:), phi(:, :), values(:)
      integer, allocatable :: extent(:)
      integer, parameter :: first(4) = [1, 3, 6, 7], last(4) = [2, 5, 6, 7]
      integer :: k

      path = scratch_path('series.h5')
      times = [(0.25_wp*k, k=1, 7)]
      phi = reshape([(sin(1.0_wp*k), k=1, 21)], [3, 7])
      work: block
         call file%create(path, error)
         if (allocated(error)) exit work
         call file%create_series('time', [integer ::], 3, 4)
         call file%create_series('phi', [3], 3, 0)
         call file%make_scale('time')
         call file%attach_scale('phi', 2, 'time')
         do k = 1, size(first)
            call file%append('time', times(first(k):last(k)))
            call file%append('phi', phi(:, first(k):last(k)))
         end do
         call file%append('time', [real(wp) ::])
         call file%close(error)
         if (allocated(error)) exit work
         call read_set(path, 'time', extent, values, error)
         if (allocated(error)) exit work
         call check_close(error, values, times, exact, 'time')
         if (.not. allocated(error)) call read_set(path, 'phi', extent, values, error)
         if (allocated(error)) exit work
         call check(error, all(extent == [3, 7]), 'shape of phi')
         call check_close(error, values, [phi], exact, 'phi')
      end block work
      call clean(path)
   end subroutine test_series

   subroutine test_whole(error)
      type(error_type), allocatable, intent(out) :: error
      type(hdf5_file) :: file
      character(len=:), allocatable :: path
      real(wp) :: values(24), table(4, 6)
      integer :: k

      path = scratch_path('whole.h5')
      values = [(sqrt(1.0_wp*k), k=1, 24)]
      work: block
         call file%create(path, error)
         if (allocated(error)) exit work
         call file%write('rod', [1, 2, 3], 4)
         call file%write('one', values, 4)
         call file%write('two', reshape(values, [4, 6]), 4)
         call file%write('three', reshape(values, [2, 3, 4]), 4)
         table = reshape(values, [4, 6])
         call file%write('part', table(2:3, :3), 4) ! which is not contiguous
         call file%create_group('cases')
         call file%write('cases/b', [5], 0)
         call file%close(error)
         if (allocated(error)) exit work
         call expect('rod', [3], [1.0_wp, 2.0_wp, 3.0_wp])
         call expect('one', [24], values)
         call expect('two', [4, 6], values)
         call expect('three', [2, 3, 4], values)
         call expect('part', [2, 3], [values([2, 3, 6, 7, 10, 11])])
         call expect('cases/b', [1], [5.0_wp])
      end block work
      call clean(path)

   contains

      subroutine expect(name, extent, expected)
         character(len=*), intent(in) :: name
         integer, intent(in) :: extent(:)
         real(wp), intent(in) :: expected(:)
         integer, allocatable :: found(:)
         real(wp), allocatable :: numbers(:)
         if (allocated(error)) return
         call read_set(path, name, found, numbers, error)
         if (allocated(error)) return
         call check(error, size(found) == size(extent), name//': rank')
         if (.not. allocated(error)) call check(error, all(found == extent), name//': extent')
         call check_close(error, numbers, expected, exact, name)
      end subroutine expect

   end subroutine test_whole

   subroutine test_equal_bytes(error)
      type(error_type), allocatable, intent(out) :: error
      type(hdf5_file) :: file
      character(len=:), allocatable :: path, first, second
      integer :: k

      path = scratch_path('bytes.h5')
      work: block
         do k = 1, 2
            call file%create(path, error)
            if (allocated(error)) exit work
            call file%create_group('solver')
            call file%write('rod', [1, 2, 3], 4)
            call file%make_scale('rod')
            call file%create_series('phi', [3], 5, 4)
            call file%attach_scale('phi', 1, 'rod')
            call file%append('phi', reshape([1.0_wp, 2.0_wp, 3.0_wp], [3, 1]))
            call file%close(error)
            if (allocated(error)) exit work
            if (k == 1) first = file_bytes(path)
            if (k == 2) second = file_bytes(path)
            call clean(path)
            if (k == 1) call execute_command_line('sleep 1.1')
         end do
         call check(error, len(first) > 0 .and. first == second, 'the files differ')
      end block work
      call clean(path)
   end subroutine test_equal_bytes

   subroutine test_no_clobber(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: refusal
      type(hdf5_file) :: file
      character(len=:), allocatable :: path

      path = scratch_path('clobber.h5')
      call write_bytes(path, 'precious')
      call file%create(path, refusal)
      call check(error, allocated(refusal), 'an existing file was replaced')
      if (.not. allocated(error)) call check(error, file_bytes(path), 'precious', 'contents')
      if (.not. allocated(error)) call check(error, .not. file%is_open(), 'the file counts as open')
      call clean(path)
   end subroutine test_no_clobber

   subroutine test_missing_file(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: refusal
      type(hdf5_file) :: file

      call file%open('/no/such/file.h5', refusal)
      call check(error, allocated(refusal), 'no error')
      if (allocated(error)) return
      call check(error, refusal%message, &
         "/no/such/file.h5: HDF5 call h5fopen_f failed on '/': No such file or directory", 'message')
   end subroutine test_missing_file

   subroutine test_not_hdf5(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: refusal
      type(hdf5_file) :: file
      character(len=:), allocatable :: path

      path = scratch_path('text.h5')
      call write_bytes(path, repeat('not HDF5 ', 100))
      call file%open(path, refusal)
      call clean(path)
      call check(error, allocated(refusal), 'no error')
      if (allocated(error)) return
      call check(error, index(refusal%message, 'file signature not found') > 0, refusal%message)
   end subroutine test_not_hdf5

   subroutine test_flipped_bit(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: refusal
      type(hdf5_file) :: file
      character(len=:), allocatable :: path, bytes
      real(wp), allocatable :: values(:)
      integer, allocatable :: extent(:)
      integer :: place

      path = scratch_path('bit.h5')
      work: block
         call file%create(path, error)
         if (allocated(error)) exit work
         call file%write('values', [1.5_wp, 2.5_wp, 3.5_wp], 0)
         call file%close(error)
         if (allocated(error)) exit work
         bytes = file_bytes(path)
         place = index(bytes, transfer(2.5_wp, '12345678'))
         call check(error, place > 0, 'value not found in the file')
         if (allocated(error)) exit work
         bytes(place:place) = achar(1)
         call read_set(path, 'values', extent, values, error)
         if (allocated(error)) exit work
         call write_bytes(path, bytes)
         call read_set(path, 'values', extent, values, refusal)
         call check(error, allocated(refusal), 'a changed value was read')
      end block work
      call clean(path)
   end subroutine test_flipped_bit

   subroutine test_missing_attribute(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: refusal
      type(hdf5_file) :: file
      character(len=:), allocatable :: path, text

      path = scratch_path('wrong.h5')
      work: block
         call file%create(path, error)
         if (allocated(error)) exit work
         call file%write('rod', [1, 2], 0)
         call file%get_attribute('rod', 'units', text, refusal)
         call check(error, allocated(refusal), 'a missing attribute was read')
         if (allocated(error)) exit work
         call check(error, index(refusal%message, "h5aopen_by_name_f failed on 'rod@units'") > 0, refusal%message)
      end block work
      call clean(path)
   end subroutine test_missing_attribute

   subroutine test_first_failure(error)
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: told
      type(hdf5_file) :: file
      character(len=:), allocatable :: path

      path = scratch_path('first.h5')
      work: block
         call file%create(path, error)
         if (allocated(error)) exit work
         call file%write('rod', [1, 2], 0)
         call file%make_scale('none')
         call file%append('neither', [1.0_wp])
         call file%write('late', [1, 2], 0)
         call file%put_attribute('/', 'late', 'text')
         call check(error, .not. file%has_attribute('/', 'late'), 'contents')
         if (allocated(error)) exit work
         call file%get_failure(told)
         call expect("h5dopen_f failed on 'none'")
         if (.not. allocated(error)) call file%flush(told)
         call expect("h5dopen_f failed on 'none'")
         if (.not. allocated(error)) call file%close(told)
         call expect("h5dopen_f failed on 'none'")
         if (.not. allocated(error)) call check(error, has_set(path, 'rod') .and. .not. has_set(path, 'late'), 'data sets')
         call clean(path)
         if (.not. allocated(error)) call file%create(path, error)
         if (allocated(error)) exit work
         call file%write('rod', [1, 2], 0)
         call file%close(error)
      end block work
      call clean(path)

   contains

      subroutine expect(words)
         character(len=*), intent(in) :: words
         if (allocated(error)) return
         call check(error, allocated(told), 'not told')
         if (.not. allocated(error)) call check(error, index(told%message, words) > 0, told%message)
      end subroutine expect

   end subroutine test_first_failure

   function file_bytes(path) result(bytes)
      character(len=*), intent(in) :: path
      character(len=:), allocatable :: bytes
      integer :: unit, length

      open (newunit=unit, file=path, access='stream', form='unformatted', status='old', action='read')
      inquire (unit=unit, size=length)
      allocate (character(len=length) :: bytes)
      read (unit) bytes
      close (unit)
   end function file_bytes

   subroutine write_bytes(path, bytes)
      character(len=*), intent(in) :: path, bytes
      integer :: unit

      open (newunit=unit, file=path, access='stream', form='unformatted', status='replace', action='write')
      write (unit) bytes
      close (unit)
   end subroutine write_bytes

end module test_hdf5_files
