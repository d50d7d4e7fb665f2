!> A small test harness: a suite is a list of named tests; a test fails by raising an error.
module test_testing
   use, intrinsic :: iso_fortran_env, only: output_unit
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type, raise
   implicit none (type, external)
   private
   public :: unittest, new_test, suite_tally, run_suite, check, check_close

   abstract interface
      subroutine test_interface(error)
         import :: error_type
         implicit none (type, external)
         type(error_type), allocatable, intent(out) :: error !! allocated: the test failed
      end subroutine test_interface
   end interface

   type :: unittest
      character(len=160) :: name = '' !! what holds, in words; an allocatable one would leak from array constructors (gfortran 12)
      procedure(test_interface), pointer, nopass :: test => null()
      logical :: long = .false.      !! takes many seconds: only with --all
   end type unittest

   type :: suite_tally
      integer :: passed = 0
      integer :: failed = 0
   end type suite_tally

   !> Fail unless a condition holds. The first failure of a test stays: the checks after it do nothing.
   interface check
      module procedure check_condition
      module procedure check_integer
      module procedure check_text
   end interface check

   !> Fail unless |actual - expected| <= tolerance everywhere; NaN always fails. The first failure stays.
   interface check_close
      module procedure check_close_scalar
      module procedure check_close_array
   end interface check_close

contains

   !> One entry of a suite.
   function new_test(name, test, long) result(entry)
      character(len=*), intent(in) :: name
      procedure(test_interface) :: test
      logical, intent(in), optional :: long !! see `unittest`
      type(unittest) :: entry
      entry%name = name
      entry%test => test
      if (present(long)) entry%long = long
   end function new_test

   !> Run the tests of a suite that the filter chooses, print each, and add to the tally.
   subroutine run_suite(suite_name, suite, tally, filter, all)
      character(len=*), intent(in) :: suite_name
      type(unittest), intent(in) :: suite(:)
      type(suite_tally), intent(inout) :: tally
      character(len=*), intent(in) :: filter !! see `chosen`
      logical, intent(in) :: all !! also those that take long
      type(error_type), allocatable :: error
      integer :: i

      do i = 1, size(suite)
         if (suite(i)%long .and. .not. all) cycle
         if (.not. chosen(trim(suite(i)%name), filter)) cycle
         call suite(i)%test(error)
         if (allocated(error)) then
            tally%failed = tally%failed + 1
            write (output_unit, '(a)') 'FAILED '//suite_name//': '//trim(suite(i)%name)
            write (output_unit, '(a)') '       '//error%message
         else
            tally%passed = tally%passed + 1
            write (output_unit, '(a)') 'passed '//suite_name//': '//trim(suite(i)%name)
         end if
         flush (output_unit)
      end do
   end subroutine run_suite

   !> All names without a filter, those that contain it, or after '!' those that do not.
   pure logical function chosen(name, filter)
      character(len=*), intent(in) :: name, filter
      chosen = len(filter) == 0
      if (chosen) return
      if (filter(1:1) == '!') then
         chosen = index(name, filter(2:)) == 0
      else
         chosen = index(name, filter) > 0
      end if
   end function chosen

   subroutine check_condition(error, condition, message)
      type(error_type), allocatable, intent(inout) :: error
      logical, intent(in) :: condition
      character(len=*), intent(in) :: message
      if (.not. (condition .or. allocated(error))) call raise(error, message)
   end subroutine check_condition

   subroutine check_integer(error, actual, expected, message)
      type(error_type), allocatable, intent(inout) :: error
      integer, intent(in) :: actual, expected
      character(len=*), intent(in) :: message
      character(len=80) :: numbers
      if (actual == expected .or. allocated(error)) return
      write (numbers, '(": ", i0, " instead of ", i0)') actual, expected
      call raise(error, message//trim(numbers))
   end subroutine check_integer

   subroutine check_text(error, actual, expected, message)
      type(error_type), allocatable, intent(inout) :: error
      character(len=*), intent(in) :: actual, expected
      character(len=*), intent(in) :: message
      if (allocated(error)) return
      if (actual == expected .and. len(actual) == len(expected)) return
      call raise(error, message//': "'//actual//'" instead of "'//expected//'"')
   end subroutine check_text

   subroutine check_close_scalar(error, actual, expected, tolerance, message)
      type(error_type), allocatable, intent(inout) :: error
      real(wp), intent(in) :: actual, expected
      real(wp), intent(in) :: tolerance !! absolute
      character(len=*), intent(in) :: message
      call check_close_array(error, [actual], [expected], tolerance, message)
   end subroutine check_close_scalar

   subroutine check_close_array(error, actual, expected, tolerance, message)
      type(error_type), allocatable, intent(inout) :: error
      real(wp), intent(in) :: actual(:), expected(:)
      real(wp), intent(in) :: tolerance !! absolute
      character(len=*), intent(in) :: message
      character(len=200) :: numbers
      integer :: i

      if (allocated(error)) return
      if (size(actual) /= size(expected)) then
         write (numbers, '(": ", i0, " values instead of ", i0)') size(actual), size(expected)
         call raise(error, message//trim(numbers))
         return
      end if
      do i = 1, size(actual)
         if (ieee_is_finite(actual(i))) then
            if (abs(actual(i) - expected(i)) <= tolerance) cycle
         end if
         write (numbers, '(": value ", i0, " is ", es23.16, " instead of ", es23.16, ", difference ", es9.2, " > ", es9.2)') &
            i, actual(i), expected(i), actual(i) - expected(i), tolerance
         call raise(error, message//trim(numbers))
         return
      end do
   end subroutine check_close_array

end module test_testing
