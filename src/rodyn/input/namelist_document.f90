!> A namelist file as data: groups in order, their assignments, and the values as written.
!>
!> Nothing here knows which groups and keys make sense; that is the schema's business. Values keep their place
!> in the text and their line, so that messages can quote them. Repeat counts stay unexpanded.
module rodyn_namelist_document
   use rodyn_kinds, only: wp
   use rodyn_faults, only: fault_list
   use rodyn_text, only: lower, printable, to_text
   implicit none (type, external)
   private
   public :: namelist_document, namelist_group, namelist_entry, namelist_value
   public :: add_group, add_entry, add_value, find_group, group_count
   public :: string_content, shown_value, shown_values, index_text
   public :: name_max
   public :: is_integer, is_long_integer, is_real, is_too_large, is_too_small, is_not_finite, is_logical, &
      is_string, is_word

   integer, parameter :: name_max = 40  !! longest name kept; no known name comes near
   integer, parameter :: shown_max = 60 !! longest value quoted in a message

   !> What a value looks like.
   integer, parameter :: is_word = 0         !! none of the below
   integer, parameter :: is_integer = 1      !! and fits a default integer
   integer, parameter :: is_long_integer = 2 !! an integer that does not; a fine real
   integer, parameter :: is_real = 3         !! has a point or an exponent
   integer, parameter :: is_too_large = 4    !! a number beyond the largest real
   integer, parameter :: is_too_small = 5    !! a number other than zero that would become zero
   integer, parameter :: is_not_finite = 6   !! NaN, Inf
   integer, parameter :: is_logical = 7
   integer, parameter :: is_string = 8       !! in quotes

   !> One value, perhaps repeated
   type :: namelist_value
      integer :: kind = is_word
      integer :: first = 1, last = 0 !! place in the text, without quotes and repeat count
      integer :: line = 0
      integer :: copies = 1          !! repeat count
      integer :: number = 0          !! if is_integer
      real(wp) :: x = 0.0_wp         !! if is_integer, is_long_integer or is_real
      logical :: truth = .false.     !! if is_logical
   end type namelist_value

   !> `key = ...`, `key(3) = ...` or `key(1:3) = ...`
   type :: namelist_entry
      character(len=name_max) :: key = '' !! in lower case
      integer :: line = 0                 !! 0: set by the program, not in the file
      logical :: indexed = .false.
      integer :: lower = 0, upper = 0     !! indices, if indexed
      integer :: first = 1, last = 0      !! values
      logical :: faulty = .false.         !! the parser has already reported it
      logical :: forced = .false.         !! overrides what the file says
   end type namelist_entry

   !> `&name ... /`
   type :: namelist_group
      character(len=name_max) :: name = '' !! in lower case
      integer :: line = 0
      integer :: first = 1, last = 0       !! entries
   end type namelist_group

   !> A whole file. Only the leading `n_...` elements of each array are in use.
   type :: namelist_document
      character(len=:), allocatable :: name !! of the file, for messages
      character(len=:), allocatable :: text !! as read; values set later are appended
      logical :: readable = .true.          !! false: the file is no text, which is its one fault
      integer :: n_lines = 0
      integer :: last_end = 0               !! line in which a / ended a group last
      integer :: n_groups = 0, n_entries = 0, n_values = 0
      type(namelist_group), allocatable :: groups(:)
      type(namelist_entry), allocatable :: entries(:)
      type(namelist_value), allocatable :: values(:)
      type(fault_list) :: faults !! of syntax
   end type namelist_document

contains

   !> Append a group without entries.
   subroutine add_group(document, name, line)
      type(namelist_document), intent(inout) :: document
      character(len=*), intent(in) :: name
      integer, intent(in) :: line

      if (.not. allocated(document%groups)) allocate (document%groups(8))
      if (document%n_groups == size(document%groups)) document%groups = [document%groups, document%groups] ! twice the room
      document%n_groups = document%n_groups + 1
      document%groups(document%n_groups) = namelist_group(lower(name), line, first=document%n_entries + 1, &
         last=document%n_entries)
   end subroutine add_group

   !> Append an entry, without values, to the last group.
   subroutine add_entry(document, entry)
      type(namelist_document), intent(inout) :: document
      type(namelist_entry), intent(in) :: entry
      integer :: n

      if (.not. allocated(document%entries)) allocate (document%entries(32))
      if (document%n_entries == size(document%entries)) document%entries = [document%entries, document%entries] ! twice the room
      n = document%n_entries + 1
      document%n_entries = n
      document%entries(n) = entry
      document%entries(n)%first = document%n_values + 1
      document%entries(n)%last = document%n_values
      document%groups(document%n_groups)%last = n
   end subroutine add_entry

   !> Append a value to the last entry.
   subroutine add_value(document, value)
      type(namelist_document), intent(inout) :: document
      type(namelist_value), intent(in) :: value

      if (.not. allocated(document%values)) allocate (document%values(64))
      if (document%n_values == size(document%values)) document%values = [document%values, document%values] ! twice the room
      document%n_values = document%n_values + 1
      document%values(document%n_values) = value
      document%entries(document%n_entries)%last = document%n_values
   end subroutine add_value

   !> Index of the `instance`-th group of that name; 0 if there is none.
   pure integer function find_group(document, name, instance) result(found)
      type(namelist_document), intent(in) :: document
      character(len=*), intent(in) :: name
      integer, intent(in) :: instance
      integer :: i, seen

      found = 0
      seen = 0
      do i = 1, document%n_groups
         if (document%groups(i)%name /= name) cycle
         seen = seen + 1
         if (seen == instance) then
            found = i
            return
         end if
      end do
   end function find_group

   !> How many groups have that name.
   pure integer function group_count(document, name)
      type(namelist_document), intent(in) :: document
      character(len=*), intent(in) :: name
      integer :: i
      group_count = 0
      do i = 1, document%n_groups
         if (document%groups(i)%name == name) group_count = group_count + 1
      end do
   end function group_count

   !> What a string value says: doubled quotes made single.
   pure function string_content(document, value) result(text)
      type(namelist_document), intent(in) :: document
      type(namelist_value), intent(in) :: value
      character(len=:), allocatable :: text
      character(len=:), allocatable :: buffer ! not automatic: a text may be larger than the stack
      character(len=1) :: quote
      integer :: i, n

      allocate (character(len=value%last - value%first + 1) :: buffer)
      quote = document%text(value%first - 1:value%first - 1)
      n = 0
      i = value%first
      do while (i <= value%last)
         n = n + 1
         buffer(n:n) = document%text(i:i)
         if (buffer(n:n) == quote) i = i + 1
         i = i + 1
      end do
      text = buffer(:n)
   end function string_content

   !> A value as a message quotes it.
   pure function shown_value(document, value) result(text)
      type(namelist_document), intent(in) :: document
      type(namelist_value), intent(in) :: value
      character(len=:), allocatable :: text
      character(len=:), allocatable :: quote

      quote = ''
      if (value%kind == is_string) quote = document%text(value%first - 1:value%first - 1)
      text = quote//printable(document%text(value%first:value%last), shown_max)//quote
   end function shown_value

   !> The values of an entry as a message quotes them, cut when they are many.
   pure function shown_values(document, entry) result(text)
      type(namelist_document), intent(in) :: document
      type(namelist_entry), intent(in) :: entry
      character(len=:), allocatable :: text
      integer :: i

      text = ''
      do i = entry%first, entry%last
         if (i > entry%first) text = text//', '
         if (len(text) > shown_max) then
            text = text//'...'
            return
         end if
         if (document%values(i)%copies > 1) text = text//to_text(document%values(i)%copies)//'*'
         text = text//shown_value(document, document%values(i))
      end do
   end function shown_values

   !> '(3)', '(1:3)' or nothing.
   pure function index_text(entry) result(text)
      type(namelist_entry), intent(in) :: entry
      character(len=:), allocatable :: text
      text = ''
      if (.not. entry%indexed) return
      text = '('//to_text(entry%lower)
      if (entry%upper /= entry%lower) text = text//':'//to_text(entry%upper)
      text = text//')'
   end function index_text

end module rodyn_namelist_document
