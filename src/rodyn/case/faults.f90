!> The faults of one input, a file or a case in memory, collected until all are known, then shown together.
module rodyn_faults
   use rodyn_errors, only: error_type, raise, exit_bad_input
   use rodyn_text, only: to_text
   use rodyn_text_buffer, only: text_buffer
   implicit none (type, external)
   private
   public :: fault_list

   integer, parameter :: max_shown = 1000 !! a broken table of a million values is not worth a million lines

   !> Faults in the order they were found.
   type :: fault_list
      private
      integer :: n = 0                         !! found
      integer, allocatable :: line(:)          !! line of each fault kept; 0: no line
      integer, allocatable :: first(:), last(:) !! its text in `buffer`
      type(text_buffer) :: buffer
   contains
      procedure :: add
      procedure :: count => fault_count
      procedure :: full
      procedure :: to_error
   end type fault_list

contains

   !> Note one fault: `text` is everything after 'file:line: '.
   subroutine add(self, line, text)
      class(fault_list), intent(inout) :: self
      integer, intent(in) :: line !! 0: the fault has no line
      character(len=*), intent(in) :: text

      if (.not. allocated(self%line)) allocate (self%line(max_shown), self%first(max_shown), self%last(max_shown))
      self%n = self%n + 1
      if (self%n > max_shown) return
      self%line(self%n) = line
      self%first(self%n) = self%buffer%length() + 1
      call self%buffer%append(text)
      self%last(self%n) = self%buffer%length()
   end subroutine add

   !> Faults found so far.
   pure integer function fault_count(self)
      class(fault_list), intent(in) :: self
      fault_count = self%n
   end function fault_count

   !> True when the text of further faults would be dropped, so need not be made.
   pure logical function full(self)
      class(fault_list), intent(in) :: self
      full = self%n >= max_shown
   end function full

   !> Raise an error that shows all faults, sorted by line; nothing happens if there are none.
   subroutine to_error(self, name, error)
      class(fault_list), intent(in) :: self
      character(len=*), intent(in) :: name !! of the file; empty: a case in memory
      type(error_type), allocatable, intent(out) :: error
      type(text_buffer) :: message
      character(len=:), allocatable :: place
      integer, allocatable :: order(:)
      integer :: i, k

      if (self%n == 0) return
      place = ''
      if (len(name) > 0) place = name//':'
      order = sorted(self%line(:min(self%n, max_shown)))
      do i = 1, size(order)
         k = order(i)
         if (i > 1) call message%append(new_line('a'))
         call message%append(place)
         if (self%line(k) > 0) call message%append(to_text(self%line(k))//':')
         if (len(name) > 0) call message%append(' ')
         call message%append(self%buffer%part(self%first(k), self%last(k)))
      end do
      if (self%n > max_shown) call message%append(new_line('a')//place//' and ' &
         //to_text(self%n - max_shown)//' more faults')
      call raise(error, message%content(), exit_bad_input)
   end subroutine to_error

   !> Order of the lines, stable; by insertion, for a list that is nearly sorted and never long.
   pure function sorted(line) result(order)
      integer, intent(in) :: line(:)
      integer, allocatable :: order(:)
      integer :: i, j

      allocate (order(size(line)))
      do i = 1, size(line)
         do j = i - 1, 1, -1
            if (line(order(j)) <= line(i)) exit
            order(j + 1) = order(j)
         end do
         order(j + 1) = i
      end do
   end function sorted

end module rodyn_faults
