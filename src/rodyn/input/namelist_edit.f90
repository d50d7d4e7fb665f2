!> Set a key of a parsed document, as a sweep does for each of its cases.
module rodyn_namelist_edit
   use rodyn_errors, only: error_type, raise, exit_bad_input
   use rodyn_namelist_document, only: namelist_document, namelist_entry, namelist_value, add_group, find_group, group_count
   use rodyn_namelist_parser, only: parse_key, parse_values, scanner
   use rodyn_text, only: is_name, lower, to_text
   implicit none (type, external)
   private
   public :: set_value, split_key

contains

   !> Let `key` have the value `text`, whatever the file says.
   !>
   !> `key` is 'group.name' or 'group.name(3)', and 'load(2).value' where a group stands several times. `text` is
   !> one or several values in namelist syntax; texts are in quotes. Whether the schema knows the key is found
   !> when the case is built. A key set without index replaces all assignments to it; with an index, that element. Elements
   !> of a list, whose length is that of its assignment (`in_list`), are replaced where they stand.
   subroutine set_value(document, key, text, error, in_list)
      type(namelist_document), intent(inout) :: document
      character(len=*), intent(in) :: key
      character(len=*), intent(in) :: text
      type(error_type), allocatable, intent(out) :: error
      logical, intent(in), optional :: in_list !! the key is a list; absent: no
      character(len=:), allocatable :: group, name
      type(namelist_document) :: fresh
      type(scanner) :: s
      integer :: g, instance
      logical :: listed

      listed = .false.
      if (present(in_list)) listed = in_list
      call split_key(key, group, instance, name, error)
      if (allocated(error)) return
      call parse_one(name, text, fresh, s, error)
      if (allocated(error)) return
      if (instance == 0 .and. group_count(document, group) > 1) then
         call raise(error, key//': there are '//to_text(group_count(document, group)) &
            //' such groups; specify one, as in '//group//'(1).'//name, exit_bad_input)
         return
      end if
      g = find_group(document, group, max(1, instance))
      if (g == 0 .and. instance > 1) then
         call raise(error, key//': there is no such group; the number of them is '//to_text(group_count(document, group)), &
                    exit_bad_input)
         return
      end if
      if (g == 0) then
         call add_group(document, group, 0)
         g = document%n_groups
      end if
      if (listed .and. fresh%entries(1)%indexed) then
         call replace_in_list(document, g, fresh, key, error)
      else
         call replace(document, g, fresh)
      end if
   end subroutine set_value

   !> 'load(2).value' -> 'load', 2, 'value'; instance 0: none was given.
   subroutine split_key(key, group, instance, name, error)
      character(len=*), intent(in) :: key
      character(len=:), allocatable, intent(out) :: group, name !! in lower case; `name` with its index
      integer, intent(out) :: instance
      type(error_type), allocatable, intent(out) :: error
      integer :: dot, paren
      logical :: ok

      ok = .true.
      instance = 0
      dot = index(key, '.')
      group = trim(adjustl(lower(key(:max(0, dot - 1)))))
      name = trim(adjustl(lower(key(dot + 1:))))
      paren = index(group, '(')
      if (paren > 0) then
         call read_instance(group(paren:), instance, ok)
         group = group(:paren - 1)
      end if
      if (dot > 0 .and. ok .and. is_name(group)) return
      call raise(error, key//': a key is written group.name', exit_bad_input)
   end subroutine split_key

   !> '(2)' -> 2
   subroutine read_instance(text, instance, ok)
      character(len=*), intent(in) :: text
      integer, intent(out) :: instance
      logical, intent(out) :: ok
      integer :: last

      instance = 0
      last = len(text) - 1
      ok = last >= 2 .and. last <= 10 .and. index(text, ')') == last + 1
      if (ok) ok = verify(text(2:last), '0123456789') == 0
      if (ok) read (text(2:last), *) instance
      ok = ok .and. instance >= 1
   end subroutine read_instance

   !> A document with a single nameless group holding the one assignment.
   subroutine parse_one(name, text, fresh, s, error)
      character(len=*), intent(in) :: name, text
      type(namelist_document), intent(out) :: fresh
      type(scanner), intent(out) :: s
      type(error_type), allocatable, intent(out) :: error
      logical :: bad

      fresh%name = name
      fresh%text = text
      call add_group(fresh, '', 0)
      s%line = 0
      bad = index(name, '(') > 0 .and. index(name, ')') /= len(name)
      if (.not. bad) then
         call parse_key(fresh, s, name)
         call parse_values(fresh, s)
         bad = s%at <= len(text) .or. fresh%faults%count() > 0
      end if
      if (bad) call raise(error, name//' = '//text//': not a key and values in namelist syntax', exit_bad_input)
   end subroutine parse_one

   !> Put the only entry of `fresh` into group `g`, in place of those it makes void.
   subroutine replace(document, g, fresh)
      type(namelist_document), intent(inout) :: document
      integer, intent(in) :: g
      type(namelist_document), intent(in) :: fresh
      type(namelist_entry) :: entry
      integer :: e

      entry = fresh%entries(1)
      entry%forced = .true.
      call append_values(document, entry, placed_values(document, fresh))
      do e = document%groups(g)%last, document%groups(g)%first, -1
         if (is_void(document%entries(e), entry)) call remove(document, g, e)
      end do
      call insert(document, g, entry)
   end subroutine replace

   !> Put the only value of `fresh` into elements of a list that stands in group `g`.
   subroutine replace_in_list(document, g, fresh, key, error)
      type(namelist_document), intent(inout) :: document
      integer, intent(in) :: g
      type(namelist_document), intent(in) :: fresh
      character(len=*), intent(in) :: key !! for messages
      type(error_type), allocatable, intent(out) :: error
      type(namelist_value), allocatable :: list(:), new(:)
      type(namelist_entry) :: entry
      integer :: e, v

      associate (wanted => fresh%entries(1))
         do e = document%groups(g)%first, document%groups(g)%last
            if (document%entries(e)%key == wanted%key .and. .not. document%entries(e)%indexed) exit
         end do
         if (e > document%groups(g)%last) then
            call raise(error, key//': the base has no array with such an element', exit_bad_input)
            return
         end if
         allocate (list(0))
         do v = document%entries(e)%first, document%entries(e)%last
            list = [list, spread(document%values(v), 1, document%values(v)%copies)]
         end do
         list%copies = 1
         if (wanted%lower < 1 .or. wanted%upper > size(list)) then
            call raise(error, key//': there is no such element; the array has '//to_text(size(list))//', numbered from 1', &
                       exit_bad_input)
            return
         end if
         new = placed_values(document, fresh)
         list(wanted%lower:wanted%upper) = new(1)
      end associate
      entry = document%entries(e)
      call append_values(document, entry, list)
      document%entries(e) = entry
   end subroutine replace_in_list

   !> The values of `fresh`, with its text put behind that of the document.
   function placed_values(document, fresh) result(values)
      type(namelist_document), intent(inout) :: document
      type(namelist_document), intent(in) :: fresh
      type(namelist_value), allocatable :: values(:)

      values = fresh%values(:fresh%n_values)
      values%first = values%first + len(document%text)
      values%last = values%last + len(document%text)
      values%line = 0
      document%text = document%text//fresh%text
   end function placed_values

   !> Let an entry have these values.
   subroutine append_values(document, entry, values)
      type(namelist_document), intent(inout) :: document
      type(namelist_entry), intent(inout) :: entry
      type(namelist_value), intent(in) :: values(:)

      entry%first = document%n_values + 1
      entry%last = document%n_values + size(values)
      if (.not. allocated(document%values)) allocate (document%values(0))
      document%values = [document%values(:document%n_values), values]
      document%n_values = entry%last
   end subroutine append_values

   !> Does the new entry leave nothing of the old one?
   pure logical function is_void(old, new)
      type(namelist_entry), intent(in) :: old, new
      is_void = old%key == new%key .and. (.not. new%indexed .or. &
         (old%indexed .and. old%lower >= new%lower .and. old%upper <= new%upper))
   end function is_void

   subroutine remove(document, g, e)
      type(namelist_document), intent(inout) :: document
      integer, intent(in) :: g, e
      document%entries(e:document%n_entries - 1) = document%entries(e + 1:document%n_entries)
      document%n_entries = document%n_entries - 1
      call shift_groups(document, g, -1)
   end subroutine remove

   subroutine insert(document, g, entry)
      type(namelist_document), intent(inout) :: document
      integer, intent(in) :: g
      type(namelist_entry), intent(in) :: entry
      integer :: e, n

      if (.not. allocated(document%entries)) allocate (document%entries(32))
      n = document%n_entries
      e = document%groups(g)%last + 1
      document%entries = [document%entries(:e - 1), entry, document%entries(e:n)]
      document%n_entries = n + 1
      call shift_groups(document, g, 1)
   end subroutine insert

   !> Group `g` has grown by `change` entries; those behind it have moved.
   subroutine shift_groups(document, g, change)
      type(namelist_document), intent(inout) :: document
      integer, intent(in) :: g, change
      document%groups(g)%last = document%groups(g)%last + change
      document%groups(g + 1:document%n_groups)%first = document%groups(g + 1:document%n_groups)%first + change
      document%groups(g + 1:document%n_groups)%last = document%groups(g + 1:document%n_groups)%last + change
   end subroutine shift_groups

end module rodyn_namelist_edit
