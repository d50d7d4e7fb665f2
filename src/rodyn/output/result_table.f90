!> A result in memory: arrays with the names of what they run over, their units and meanings, and attributes.
module rodyn_result_table
   use rodyn_attributes, only: attribute_list
   use rodyn_kinds, only: wp
   implicit none (type, external)
   private
   public :: result_array, result_table, name_length

   integer, parameter :: name_length = 24 !! of arrays and of coordinates

   !> Numbers or texts, over one or two dimensions. A dimension has the name of the array with its coordinates, if there is one.
   type :: result_array
      character(len=name_length) :: name = ''
      character(len=name_length) :: dims(2) = '' !! the slowest first; the second may be empty
      integer :: shape(2) = 1                    !! the slowest first
      character(len=:), allocatable :: units     !! empty: none
      character(len=:), allocatable :: long_name
      real(wp), allocatable :: reals(:)          !! one of these three, the last dimension fastest
      integer, allocatable :: integers(:)
      character(len=name_length), allocatable :: texts(:)
      integer :: text_length = 0                 !! of all texts
   end type result_array

   type :: result_table
      integer :: n = 0
      type(result_array), allocatable :: arrays(:) !! the first n
      type(attribute_list) :: attributes
   contains
      generic :: add => add_vector, add_matrix, add_integers, add_texts
      procedure :: extend
      procedure, private :: add_vector, add_matrix, add_integers, add_texts
   end type result_table

contains

   !> One more array, without values.
   subroutine extend(self, name, dims, shape, units, long_name)
      class(result_table), intent(inout) :: self
      character(len=*), intent(in) :: name, dims(:), units, long_name
      integer, intent(in) :: shape(:)
      type(result_array), allocatable :: longer(:)

      if (.not. allocated(self%arrays)) allocate (self%arrays(64))
      if (self%n == size(self%arrays)) then
         allocate (longer(2*self%n))
         longer(:self%n) = self%arrays
         call move_alloc(longer, self%arrays)
      end if
      self%n = self%n + 1
      associate (new => self%arrays(self%n))
         new%name = name
         new%dims(:size(dims)) = dims
         new%shape(:size(shape)) = shape
         new%units = units
         new%long_name = long_name
      end associate
   end subroutine extend

   subroutine add_vector(self, name, values, dim, units, long_name)
      class(result_table), intent(inout) :: self
      character(len=*), intent(in) :: name, dim, units, long_name
      real(wp), intent(in) :: values(:)
      call self%extend(name, [dim], [size(values)], units, long_name)
      self%arrays(self%n)%reals = values
   end subroutine add_vector

   subroutine add_matrix(self, name, values, fast_dim, slow_dim, units, long_name)
      class(result_table), intent(inout) :: self
      character(len=*), intent(in) :: name, fast_dim, slow_dim, units, long_name
      real(wp), intent(in) :: values(:, :) !! the first index runs over `fast_dim`
      character(len=name_length) :: dims(2)
      dims(1) = slow_dim
      dims(2) = fast_dim
      call self%extend(name, dims, [size(values, 2), size(values, 1)], units, long_name)
      self%arrays(self%n)%reals = reshape(values, [size(values)])
   end subroutine add_matrix

   subroutine add_integers(self, name, values, dim, units, long_name)
      class(result_table), intent(inout) :: self
      character(len=*), intent(in) :: name, dim, units, long_name
      integer, intent(in) :: values(:)
      call self%extend(name, [dim], [size(values)], units, long_name)
      self%arrays(self%n)%integers = values
   end subroutine add_integers

   subroutine add_texts(self, name, values, dim, units, long_name)
      class(result_table), intent(inout) :: self
      character(len=*), intent(in) :: name, values(:), dim, units, long_name
      call self%extend(name, [dim], [size(values)], units, long_name)
      allocate (self%arrays(self%n)%texts(size(values)))
      self%arrays(self%n)%texts = values
      self%arrays(self%n)%text_length = len(values)
   end subroutine add_texts

end module rodyn_result_table
