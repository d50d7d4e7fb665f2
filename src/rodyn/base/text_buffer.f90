!> A character buffer that grows by doubling, so that building a text of N characters costs O(N).
module rodyn_text_buffer
   implicit none (type, external)
   private
   public :: text_buffer

   !> Append-only text. `content()` hands out what has been written.
   type :: text_buffer
      private
      character(len=:), allocatable :: chars !! storage, longer than the text
      integer :: used = 0                    !! characters written
   contains
      procedure :: append
      procedure :: line
      procedure :: length
      procedure :: content
      procedure :: part
   end type text_buffer

contains

   !> Add `text` at the end.
   subroutine append(self, text)
      class(text_buffer), intent(inout) :: self
      character(len=*), intent(in) :: text
      character(len=:), allocatable :: larger
      integer :: room

      if (.not. allocated(self%chars)) allocate (character(len=max(256, len(text))) :: self%chars)
      if (self%used + len(text) > len(self%chars)) then
         room = max(2*len(self%chars), self%used + len(text))
         allocate (character(len=room) :: larger)
         larger(:self%used) = self%chars(:self%used)
         call move_alloc(larger, self%chars)
      end if
      self%chars(self%used + 1:self%used + len(text)) = text
      self%used = self%used + len(text)
   end subroutine append

   !> Add `text` and a line end.
   subroutine line(self, text)
      class(text_buffer), intent(inout) :: self
      character(len=*), intent(in) :: text
      call self%append(text)
      call self%append(new_line('a'))
   end subroutine line

   !> Characters written so far.
   pure integer function length(self)
      class(text_buffer), intent(in) :: self
      length = self%used
   end function length

   !> All that has been written.
   pure function content(self) result(text)
      class(text_buffer), intent(in) :: self
      character(len=:), allocatable :: text
      text = self%part(1, self%used)
   end function content

   !> The characters from `first` to `last`; empty if there are none.
   pure function part(self, first, last) result(text)
      class(text_buffer), intent(in) :: self
      integer, intent(in) :: first, last
      character(len=:), allocatable :: text
      if (last < first) then
         text = ''
      else
         text = self%chars(first:last)
      end if
   end function part

end module rodyn_text_buffer
