!> What the user should be told of a directory.
module rodyn_sweep_notices
   implicit none (type, external)
   private
   public :: notice_list

   integer, parameter :: text_length = 255, most_notices = 1000

   type :: notice_list
      integer :: n = 0
      character(len=text_length) :: text(most_notices)
   contains
      procedure :: tell
   end type notice_list

contains

   subroutine tell(self, text)
      class(notice_list), intent(inout) :: self
      character(len=*), intent(in) :: text
      if (self%n == most_notices) return
      self%n = self%n + 1
      self%text(self%n) = text
   end subroutine tell

end module rodyn_sweep_notices
