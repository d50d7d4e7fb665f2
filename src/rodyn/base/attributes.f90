!> Named values that say something about a result: texts and numbers, in order.
module rodyn_attributes
   use rodyn_kinds, only: wp, i8
   implicit none (type, external)
   private
   public :: attribute_type, attribute_list, is_text, is_real, is_int32, is_int64

   enum, bind(c)
      enumerator :: is_text = 0, is_real, is_int32, is_int64
   end enum

   type :: attribute_type
      character(len=:), allocatable :: name
      integer :: kind = is_text
      character(len=:), allocatable :: text
      real(wp) :: x = 0.0_wp
      integer(i8) :: number = 0
   end type attribute_type

   type :: attribute_list
      integer :: n = 0
      type(attribute_type), allocatable :: items(:) !! the first n
   contains
      generic :: add => add_text, add_real, add_int32, add_int64, add_logical
      procedure :: append
      procedure, private :: add_text, add_real, add_int32, add_int64, add_logical
   end type attribute_list

contains

   !> One more place in a list.
   subroutine extend(list, name, kind)
      class(attribute_list), intent(inout) :: list
      character(len=*), intent(in) :: name
      integer, intent(in) :: kind
      type(attribute_type), allocatable :: longer(:)

      if (.not. allocated(list%items)) allocate (list%items(32))
      if (list%n == size(list%items)) then
         allocate (longer(2*list%n))
         longer(:list%n) = list%items
         call move_alloc(longer, list%items)
      end if
      list%n = list%n + 1
      list%items(list%n)%name = name
      list%items(list%n)%kind = kind
   end subroutine extend

   subroutine add_text(self, name, value)
      class(attribute_list), intent(inout) :: self
      character(len=*), intent(in) :: name, value
      call extend(self, name, is_text)
      self%items(self%n)%text = value
   end subroutine add_text

   subroutine add_real(self, name, value)
      class(attribute_list), intent(inout) :: self
      character(len=*), intent(in) :: name
      real(wp), intent(in) :: value
      call extend(self, name, is_real)
      self%items(self%n)%x = value
   end subroutine add_real

   subroutine add_int32(self, name, value)
      class(attribute_list), intent(inout) :: self
      character(len=*), intent(in) :: name
      integer, intent(in) :: value
      call extend(self, name, is_int32)
      self%items(self%n)%number = value
   end subroutine add_int32

   subroutine add_int64(self, name, value)
      class(attribute_list), intent(inout) :: self
      character(len=*), intent(in) :: name
      integer(i8), intent(in) :: value
      call extend(self, name, is_int64)
      self%items(self%n)%number = value
   end subroutine add_int64

   !> As a number, 0 or 1.
   subroutine add_logical(self, name, value)
      class(attribute_list), intent(inout) :: self
      character(len=*), intent(in) :: name
      logical, intent(in) :: value
      call self%add_int32(name, merge(1, 0, value))
   end subroutine add_logical

   !> All of another list behind this one.
   subroutine append(self, other)
      class(attribute_list), intent(inout) :: self
      type(attribute_list), intent(in) :: other
      integer :: i
      do i = 1, other%n
         call extend(self, other%items(i)%name, other%items(i)%kind)
         self%items(self%n) = other%items(i)
      end do
   end subroutine append

end module rodyn_attributes
