!> Fills a configuration, which comes with its defaults, from a checked document: what the file says, then single elements.
!> It knows nothing of cases; any schema will do.
module rodyn_field_loader
   use rodyn_kinds, only: wp
   use rodyn_field_visitor, only: field_visitor
   use rodyn_checked_document, only: checked_document, group_at
   use rodyn_namelist_document, only: string_content
   use rodyn_schema, only: schema_group, schema_row, name_length, any_list, matching_word
   use rodyn_text, only: word
   implicit none (type, external)
   private
   public :: field_loader

   !> Values that break a rule are passed over: their key keeps its default, and the fault is on the list already.
   type, extends(field_visitor) :: field_loader
      type(checked_document), pointer :: checked => null()
      integer :: group = 0 !! the open group of the document; 0: not in the file
      integer :: row = 0   !! number of the row visited last; rows are visited in the order of the table
   contains
      procedure :: open_group
      procedure :: close_group
      procedure :: real_field
      procedure :: array_field
      procedure :: integer_field
      procedure :: logical_field
      procedure :: word_field
      procedure :: text_field
      procedure :: texts_field
   end type field_loader

contains

   subroutine open_group(self, group, instance)
      class(field_loader), intent(inout) :: self
      type(schema_group), intent(in) :: group
      integer, intent(in) :: instance
      integer :: r

      self%group = group_at(self%checked, trim(group%name), instance)
      do r = 1, size(self%checked%rows)
         if (self%checked%rows(r)%group == group%name) exit
      end do
      self%row = r - 1
   end subroutine open_group

   subroutine close_group(self)
      class(field_loader), intent(inout) :: self
      self%group = 0
   end subroutine close_group

   !> Go to the row of a key, and find the last valid entry for it; 0 if there is none.
   integer function find(self, row) result(found)
      class(field_loader), intent(inout) :: self
      type(schema_row), intent(in) :: row

      found = 0
      do while (self%checked%rows(self%row + 1)%key /= row%key)
         self%row = self%row + 1
      end do
      self%row = self%row + 1
      if (self%group == 0) return
      associate (group => self%checked%document%groups(self%group))
         do found = group%last, group%first, -1
            if (self%checked%row(found) == self%row .and. self%checked%ok(found)) return
         end do
      end associate
      found = 0
   end function find

   !> The place of the one value of a key; 0: it has none.
   integer function place_of(self, row) result(place)
      class(field_loader), intent(inout) :: self
      type(schema_row), intent(in) :: row
      place = find(self, row)
      if (place > 0) place = self%checked%document%entries(place)%first
   end function place_of

   subroutine real_field(self, x, row)
      class(field_loader), intent(inout) :: self
      real(wp), intent(inout) :: x
      type(schema_row), intent(in) :: row
      integer :: place
      place = place_of(self, row)
      if (place > 0) x = self%checked%document%values(place)%x
   end subroutine real_field

   !> Arrays over an extent get its length, 0 by default; lists the length they have in the file.
   subroutine array_field(self, x, row)
      class(field_loader), intent(inout) :: self
      real(wp), allocatable, intent(inout) :: x(:)
      type(schema_row), intent(in) :: row
      integer :: e, last

      last = find(self, row)
      if (allocated(x)) deallocate (x)
      if (row%extent == any_list) then
         allocate (x(list_length(self, last)))
         if (last > 0) call spread_values(self, last, x)
         return
      end if
      associate (range => self%checked%extents(row%extent))
         allocate (x(range%lower:range%lower + range%count - 1), source=0.0_wp)
         if (last == 0 .or. range%count == 0) return
      end associate
      do e = self%checked%document%groups(self%group)%first, last
         if (takes(self, e, .false.)) call spread_values(self, e, x)
      end do
      do e = self%checked%document%groups(self%group)%first, last
         associate (entry => self%checked%document%entries(e))
            if (takes(self, e, .true.)) call spread_values(self, e, x(entry%lower:entry%upper))
         end associate
      end do
   end subroutine array_field

   !> Is this a valid entry for the row, with or without an index?
   logical function takes(self, entry, indexed)
      class(field_loader), intent(in) :: self
      integer, intent(in) :: entry
      logical, intent(in) :: indexed
      takes = self%checked%row(entry) == self%row .and. self%checked%ok(entry) .and. &
         (self%checked%document%entries(entry)%indexed .eqv. indexed)
   end function takes

   integer function list_length(self, entry)
      class(field_loader), intent(in) :: self
      integer, intent(in) :: entry !! 0: none
      list_length = 0
      if (entry == 0) return
      associate (e => self%checked%document%entries(entry))
         list_length = sum(self%checked%document%values(e%first:e%last)%copies)
      end associate
   end function list_length

   !> Write out the repeat counts of an entry; one single value fills all of `x`.
   subroutine spread_values(self, entry, x)
      class(field_loader), intent(in) :: self
      integer, intent(in) :: entry
      real(wp), intent(inout) :: x(:)
      integer :: at, v

      at = 0
      associate (e => self%checked%document%entries(entry), values => self%checked%document%values)
         if (e%first == e%last .and. values(e%first)%copies == 1) then
            x = values(e%first)%x
            return
         end if
         do v = e%first, e%last
            x(at + 1:at + values(v)%copies) = values(v)%x
            at = at + values(v)%copies
         end do
      end associate
   end subroutine spread_values

   subroutine integer_field(self, x, row)
      class(field_loader), intent(inout) :: self
      integer, intent(inout) :: x
      type(schema_row), intent(in) :: row
      integer :: place
      place = place_of(self, row)
      if (place > 0) x = self%checked%document%values(place)%number
   end subroutine integer_field

   subroutine logical_field(self, x, row)
      class(field_loader), intent(inout) :: self
      logical, intent(inout) :: x
      type(schema_row), intent(in) :: row
      integer :: place
      place = place_of(self, row)
      if (place > 0) x = self%checked%document%values(place)%truth
   end subroutine logical_field

   !> A word takes the spelling of the table.
   subroutine word_field(self, x, row)
      class(field_loader), intent(inout) :: self
      character(len=name_length), intent(inout) :: x
      type(schema_row), intent(in) :: row
      integer :: place

      place = place_of(self, row)
      associate (document => self%checked%document)
         if (place > 0) x = word(row%words, matching_word(row, string_content(document, document%values(place))))
      end associate
   end subroutine word_field

   subroutine text_field(self, x, row)
      class(field_loader), intent(inout) :: self
      character(len=:), allocatable, intent(inout) :: x
      type(schema_row), intent(in) :: row
      integer :: place

      place = place_of(self, row)
      if (place > 0) then
         x = string_content(self%checked%document, self%checked%document%values(place))
      else if (.not. allocated(x)) then
         x = ''
      end if
   end subroutine text_field

   !> A list of texts, all as long as the longest; without values if the key is not given.
   subroutine texts_field(self, x, row)
      class(field_loader), intent(inout) :: self
      character(len=:), allocatable, intent(inout) :: x(:)
      type(schema_row), intent(in) :: row
      integer :: at, e, longest, v

      e = find(self, row)
      if (allocated(x)) deallocate (x)
      if (e == 0) then
         allocate (character(len=1) :: x(0))
         return
      end if
      associate (entry => self%checked%document%entries(e), values => self%checked%document%values)
         longest = maxval(values(entry%first:entry%last)%last - values(entry%first:entry%last)%first) + 1
         allocate (character(len=longest) :: x(list_length(self, e)))
         at = 0
         do v = entry%first, entry%last
            x(at + 1:at + values(v)%copies) = string_content(self%checked%document, values(v))
            at = at + values(v)%copies
         end do
      end associate
   end subroutine texts_field

end module rodyn_field_loader
