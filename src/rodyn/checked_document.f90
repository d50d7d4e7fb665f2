!> A document held against a schema: which row each assignment belongs to, and whether it keeps that row's rules.
!>
!> Two steps, because how long the arrays are may itself stand in the file: `match_document` finds the rows,
!> `check_document` then checks types, rules, counts, indices and what is missing. Rules that tie several keys
!> together are the reader's; it reports with `blame`.
module rodyn_checked_document
   use rodyn_kinds, only: i8
   use rodyn_faults, only: fault_list
   use rodyn_namelist_document, only: namelist_document, namelist_entry, index_text, shown_value, shown_values
   use rodyn_schema, only: schema_extent, schema_group, schema_row, any_list, group_index, nearest_group, &
      nearest_key, one_value, row_index
   use rodyn_text, only: is_digit, printable, to_text
   use rodyn_value_rules, only: broken_rule
   implicit none (type, external)
   private
   public :: checked_document, match_document, check_document, blame, entry_of, is_sound, group_at, instances

   integer, parameter :: max_list = 1000000 !! most values of a list of any length

   !> The document, the schema, and what came out. Lives no longer than the document.
   type :: checked_document
      type(namelist_document), pointer :: document => null()
      type(schema_group), allocatable :: groups(:)
      type(schema_row), allocatable :: rows(:)
      type(schema_extent), allocatable :: extents(:)
      integer, allocatable :: known(:)  !! the document's groups, those of the first schema group first
      integer, allocatable :: before(:) !! how many of `known` stand before those of each schema group (0:)
      integer, allocatable :: row(:)  !! of each entry; 0: unknown key
      logical, allocatable :: ok(:)   !! of each entry: known, and its values keep the rules
      type(fault_list) :: faults
   end type checked_document

contains

   !> Find the row of every entry; unknown and repeated groups and unknown keys are faults.
   subroutine match_document(document, groups, rows, checked)
      type(namelist_document), intent(in), target :: document
      type(schema_group), intent(in) :: groups(:)
      type(schema_row), intent(in) :: rows(:)
      type(checked_document), intent(out) :: checked
      integer :: g, i

      checked%document => document
      checked%groups = groups
      checked%rows = rows
      checked%faults = document%faults
      allocate (checked%row(document%n_entries), source=0)
      allocate (checked%ok(document%n_entries), source=.false.)
      call sort_groups(checked)
      do i = 1, size(checked%known)
         g = checked%known(i)
         if (i > checked%before(size(groups))) then
            call complain_of_group(checked, g)
         else
            call match_entries(checked, g)
         end if
      end do
      call check_single_groups(checked)
   end subroutine match_document

   !> Order the document's groups by their place in the schema, unknown ones last, so that the
   !> k-th group of a name is found at once.
   subroutine sort_groups(checked)
      type(checked_document), intent(inout) :: checked
      integer :: kind(checked%document%n_groups)
      integer :: next(size(checked%groups) + 1)
      integer :: g, k, n

      n = size(checked%groups)
      do g = 1, size(kind)
         kind(g) = group_index(checked%groups, checked%document%groups(g)%name)
         if (kind(g) == 0) kind(g) = n + 1
      end do
      allocate (checked%known(size(kind)))
      allocate (checked%before(0:n), source=0)
      do k = 1, n
         checked%before(k) = checked%before(k - 1) + count(kind == k)
      end do
      next = checked%before
      do g = 1, size(kind)
         next(kind(g)) = next(kind(g)) + 1
         checked%known(next(kind(g))) = g
      end do
   end subroutine sort_groups

   !> How many groups of that name the document has.
   integer function instances(checked, group)
      type(checked_document), intent(in) :: checked
      character(len=*), intent(in) :: group
      integer :: k
      k = group_index(checked%groups, group)
      instances = checked%before(k) - checked%before(k - 1)
   end function instances

   !> The document's index of the `instance`-th group of that name; 0 if there is none.
   integer function group_at(checked, group, instance)
      type(checked_document), intent(in) :: checked
      character(len=*), intent(in) :: group
      integer, intent(in) :: instance
      integer :: k
      k = group_index(checked%groups, group)
      group_at = 0
      if (checked%before(k - 1) + instance > checked%before(k)) return
      group_at = checked%known(checked%before(k - 1) + instance)
   end function group_at

   subroutine check_single_groups(checked)
      type(checked_document), intent(inout) :: checked
      integer :: first, i, k

      do k = 1, size(checked%groups)
         if (checked%groups(k)%repeatable) cycle
         first = checked%before(k - 1) + 1
         do i = first + 1, checked%before(k)
            call checked%faults%add(checked%document%groups(checked%known(i))%line, '&'//trim(checked%groups(k)%name) &
               //': the group may stand only once, and begins in line ' &
               //to_text(checked%document%groups(checked%known(first))%line)//' already')
         end do
      end do
   end subroutine check_single_groups

   subroutine complain_of_group(checked, g)
      type(checked_document), intent(inout) :: checked
      integer, intent(in) :: g
      if (len_trim(checked%document%groups(g)%name) == 0) return ! the parser has said so
      if (checked%faults%full()) then
         call checked%faults%add(0, '')
         return
      end if
      associate (group => checked%document%groups(g))
         call checked%faults%add(group%line, '&'//printable(trim(group%name), len(group%name)) &
            //': unknown group; the nearest known one is &'//nearest_group(checked%groups, group%name))
      end associate
   end subroutine complain_of_group

   subroutine match_entries(checked, g)
      type(checked_document), intent(inout) :: checked
      integer, intent(in) :: g
      integer :: e

      associate (document => checked%document)
         do e = document%groups(g)%first, document%groups(g)%last
            checked%row(e) = row_index(checked%rows, trim(document%groups(g)%name), trim(document%entries(e)%key))
            checked%ok(e) = checked%row(e) > 0 .and. .not. document%entries(e)%faulty
            if (checked%row(e) == 0 .and. .not. document%entries(e)%faulty) call complain_of_key(checked, g, e)
         end do
      end associate
   end subroutine match_entries

   !> Name the group that has such a key, or else the nearest key of this group.
   subroutine complain_of_key(checked, g, e)
      type(checked_document), intent(inout) :: checked
      integer, intent(in) :: g, e
      character(len=:), allocatable :: hint
      integer :: r

      hint = ''
      associate (key => checked%document%entries(e)%key, group => checked%document%groups(g)%name)
         if (.not. checked%faults%full()) then
            hint = 'the nearest known one is '//nearest_key(checked%rows, trim(group), trim(key))
            do r = size(checked%rows), 1, -1
               if (checked%rows(r)%key == key) hint = 'it belongs to &'//trim(checked%rows(r)%group)
            end do
         end if
         call checked%faults%add(checked%document%entries(e)%line, '&'//trim(group)//' '//trim(key)// &
            index_text(checked%document%entries(e))//': unknown key; '//hint)
      end associate
   end subroutine complain_of_key

   !> Check every entry by its row, then each group as a whole.
   subroutine check_document(checked, extents)
      type(checked_document), intent(inout) :: checked
      type(schema_extent), intent(in) :: extents(:) !! with count 0 where it is not known
      integer :: e, g, k, r

      checked%extents = extents
      do g = 1, checked%document%n_groups
         do e = checked%document%groups(g)%first, checked%document%groups(g)%last
            if (checked%ok(e)) call check_entry(checked, g, e)
         end do
         call check_repeated(checked, g)
      end do
      do r = 1, size(checked%rows)
         if (checked%rows(r)%default /= 'required') cycle
         k = group_index(checked%groups, checked%rows(r)%group)
         do g = 1, merge(instances(checked, trim(checked%rows(r)%group)), 1, checked%groups(k)%repeatable)
            if (entry_of(checked, trim(checked%rows(r)%group), g, trim(checked%rows(r)%key), any_state=.true.) > 0) cycle
            call blame(checked, trim(checked%rows(r)%group), g, trim(checked%rows(r)%key), 'is required')
         end do
      end do
   end subroutine check_document

   !> Values, then index and count.
   subroutine check_entry(checked, g, e)
      type(checked_document), intent(inout) :: checked
      integer, intent(in) :: g, e
      character(len=:), allocatable :: rule
      integer(i8) :: element
      integer :: v

      associate (document => checked%document, entry => checked%document%entries(e), &
                 row => checked%rows(checked%row(e)))
         call check_count(checked, g, e)
         element = 1
         do v = entry%first, entry%last
            call broken_rule(document, row, document%values(v), rule)
            if (allocated(rule)) then
               checked%ok(e) = .false.
               call complain(checked, g, e, element_text(checked, e, element), shown_value(document, document%values(v)), &
                  rule, document%values(v)%line)
            end if
            element = element + document%values(v)%copies
         end do
      end associate
   end subroutine check_entry

   !> '(3)' for the value of that place in a list; the entry's own index if there is one value or an index.
   function element_text(checked, e, element) result(text)
      type(checked_document), intent(in) :: checked
      integer, intent(in) :: e
      integer(i8), intent(in) :: element !! 1: the first value of the entry
      character(len=:), allocatable :: text
      integer :: first

      associate (entry => checked%document%entries(e), extent => checked%rows(checked%row(e))%extent)
         text = index_text(entry)
         if (entry%first == entry%last .and. checked%document%values(entry%first)%copies == 1) return
         if (extent == one_value .or. element > max_list) return
         first = 1
         if (extent > 0) first = checked%extents(extent)%lower
         if (entry%indexed) first = entry%lower
         text = '('//to_text(first + int(element) - 1)//')'
      end associate
   end function element_text

   !> Note '&group key(index) = value: rule'.
   subroutine complain(checked, g, e, where, value, rule, line)
      type(checked_document), intent(inout) :: checked
      integer, intent(in) :: g, e
      character(len=*), intent(in) :: where !! index in parentheses, or nothing
      character(len=*), intent(in) :: value !! as written
      character(len=*), intent(in) :: rule
      integer, intent(in) :: line
      call checked%faults%add(line, '&'//trim(checked%document%groups(g)%name)//' ' &
         //trim(checked%document%entries(e)%key)//where//' = '//value//': '//rule)
   end subroutine complain

   !> Note a fault of an entry as a whole, and drop the entry.
   subroutine reject(checked, g, e, rule)
      type(checked_document), intent(inout) :: checked
      integer, intent(in) :: g, e
      character(len=*), intent(in) :: rule

      checked%ok(e) = .false.
      associate (entry => checked%document%entries(e))
         call complain(checked, g, e, index_text(entry), shown_values(checked%document, entry), rule, entry%line)
      end associate
   end subroutine reject

   !> Does the number of values fit the row, and the index the extent?
   subroutine check_count(checked, g, e)
      type(checked_document), intent(inout) :: checked
      integer, intent(in) :: g, e
      integer(i8) :: given
      integer :: extent

      extent = checked%rows(checked%row(e))%extent
      associate (entry => checked%document%entries(e), values => checked%document%values)
         given = sum(int(values(entry%first:entry%last)%copies, i8))
         if (extent <= 0 .and. entry%indexed) then
            call reject(checked, g, e, 'takes no index')
         else if (extent == one_value) then
            if (given > 1) call reject(checked, g, e, 'takes one value, not ' &
               //count_text(given)//comma_hint(checked%document, entry))
         else if (extent == any_list) then
            if (given > max_list) call reject(checked, g, e, 'takes at most '//to_text(max_list)//' values')
         else if (checked%extents(extent)%count > 0) then
            call check_extent(checked, g, e, checked%extents(extent), given)
         end if
      end associate
   end subroutine check_count

   !> The same for an array over rods, nodes, hinges ...
   subroutine check_extent(checked, g, e, extent, given)
      type(checked_document), intent(inout) :: checked
      integer, intent(in) :: g, e
      type(schema_extent), intent(in) :: extent
      integer(i8), intent(in) :: given !! values
      integer :: upper, wanted

      upper = extent%lower + extent%count - 1
      wanted = extent%count
      associate (entry => checked%document%entries(e))
         if (entry%indexed) then
            wanted = entry%upper - entry%lower + 1
            if (entry%lower < extent%lower .or. entry%upper > upper) then
               call reject(checked, g, e, 'there is no such '//trim(extent%name)//'; they are numbered ' &
                  //to_text(extent%lower)//'..'//to_text(upper))
               return
            end if
         end if
         if (given == 1 .or. given == wanted) return
         if (wanted == 1) then
            call reject(checked, g, e, 'takes one value, not '//count_text(given)//comma_hint(checked%document, entry))
         else
            call reject(checked, g, e, 'takes 1 or '//to_text(wanted)//' values, one per '//trim(extent%name) &
               //', not '//count_text(given)//comma_hint(checked%document, entry))
         end if
      end associate
   end subroutine check_extent

   pure function count_text(n) result(text)
      integer(i8), intent(in) :: n
      character(len=:), allocatable :: text
      text = 'many'
      if (n <= huge(1)) text = to_text(int(n))
   end function count_text

   !> '1,5' may be meant as 1.5: say so if two whole numbers stand with nothing but a comma between them.
   pure function comma_hint(document, entry) result(hint)
      type(namelist_document), intent(in) :: document
      type(namelist_entry), intent(in) :: entry
      character(len=:), allocatable :: hint
      integer :: first, v

      hint = ''
      do v = entry%first + 1, entry%last
         first = document%values(v)%first
         if (first < 3 .or. document%values(v - 1)%last /= first - 2) cycle
         if (document%text(first - 1:first - 1) /= ',') cycle
         if (.not. (is_digit(document%text(first - 2:first - 2)) .and. is_digit(document%text(first:first)))) cycle
         hint = '; a decimal comma? write '//shown_value(document, document%values(v - 1))//'.' &
            //shown_value(document, document%values(v))
         return
      end do
   end function comma_hint

   !> The same key, or the same element of it, twice in group `g`; elements left without a value.
   subroutine check_repeated(checked, g)
      type(checked_document), intent(inout) :: checked
      integer, intent(in) :: g
      integer :: whole(size(checked%rows)) !! line of the assignment without index + 1; 0: none
      logical :: indexed(size(checked%rows))
      integer :: e, r

      whole = 0
      indexed = .false.
      associate (document => checked%document)
         do e = document%groups(g)%first, document%groups(g)%last
            r = checked%row(e)
            if (r == 0) cycle
            if (document%entries(e)%indexed) then
               if (checked%ok(e)) indexed(r) = .true.
            else
               if (whole(r) > 0) call reject(checked, g, e, 'the key stands in line ' &
                  //to_text(whole(r) - 1)//' already')
               if (whole(r) == 0) whole(r) = document%entries(e)%line + 1
            end if
         end do
      end associate
      do r = 1, size(checked%rows)
         if (indexed(r)) call check_elements(checked, g, r, whole(r) > 0)
      end do
   end subroutine check_repeated

   !> The indexed assignments to one key.
   subroutine check_elements(checked, g, r, filled)
      type(checked_document), intent(inout) :: checked
      integer, intent(in) :: g, r
      logical, intent(in) :: filled !! an assignment without index gives the elements that no index names
      integer, allocatable :: owner(:)
      integer :: e, first, i

      associate (document => checked%document, extent => checked%extents(checked%rows(r)%extent))
         if (extent%count == 0) return
         allocate (owner(extent%lower:extent%lower + extent%count - 1), source=0)
         first = 0
         do e = document%groups(g)%first, document%groups(g)%last
            if (checked%row(e) /= r .or. .not. document%entries(e)%indexed) cycle
            if (first == 0) first = e
            call claim(checked, g, e, owner)
         end do
         if (filled .or. all(owner > 0)) return
         if (checked%rows(r)%default /= 'required' .and. checked%rows(r)%default /= 'depends') return
         if (.not. is_sound(checked, trim(checked%rows(r)%group), 1, trim(checked%rows(r)%key))) return
         i = extent%lower + findloc(owner, 0, 1) - 1
         call checked%faults%add(document%entries(first)%line, '&'//trim(checked%rows(r)%group)//' ' &
            //trim(checked%rows(r)%key)//'('//to_text(i)//'): is required, as other elements are given')
      end associate
   end subroutine check_elements

   !> Let entry `e` own the elements it names; each may have one owner.
   subroutine claim(checked, g, e, owner)
      type(checked_document), intent(inout) :: checked
      integer, intent(in) :: g, e
      integer, allocatable, intent(inout) :: owner(:)
      integer :: i

      associate (entry => checked%document%entries(e))
         if (entry%lower < lbound(owner, 1) .or. entry%upper > ubound(owner, 1)) return
         do i = entry%lower, entry%upper
            if (owner(i) > 0 .and. .not. entry%forced) then
               call reject(checked, g, e, 'element '//to_text(i)//' is given in line ' &
                  //to_text(checked%document%entries(owner(i))%line)//' already')
               return
            end if
            owner(i) = e
         end do
      end associate
   end subroutine claim

   !> The entry that gives a key in the `instance`-th group of that name; 0 if there is none.
   integer function entry_of(checked, group, instance, key, any_state) result(found)
      type(checked_document), intent(in) :: checked
      character(len=*), intent(in) :: group, key
      integer, intent(in) :: instance
      logical, intent(in), optional :: any_state !! also an entry that breaks its rules
      logical :: any_will_do
      integer :: g, r

      any_will_do = .false.
      if (present(any_state)) any_will_do = any_state
      found = 0
      g = group_at(checked, group, instance)
      if (g == 0) return
      r = row_index(checked%rows, group, key)
      do found = checked%document%groups(g)%first, checked%document%groups(g)%last
         if (checked%row(found) == r .and. (checked%ok(found) .or. any_will_do)) return
      end do
      found = 0
   end function entry_of

   !> True unless some assignment to the key breaks a rule, so that its value is not known.
   logical function is_sound(checked, group, instance, key) result(sound)
      type(checked_document), intent(in) :: checked
      character(len=*), intent(in) :: group, key
      integer, intent(in) :: instance
      integer :: e, g, r

      sound = .true.
      g = group_at(checked, group, instance)
      if (g == 0) return
      r = row_index(checked%rows, group, key)
      do e = checked%document%groups(g)%first, checked%document%groups(g)%last
         if (checked%row(e) == r .and. .not. checked%ok(e)) sound = .false.
      end do
   end function is_sound

   !> Note a fault of a key: in its line if it is given, else in that of its group, else in the last line.
   subroutine blame(checked, group, instance, key, rule)
      type(checked_document), intent(inout) :: checked
      character(len=*), intent(in) :: group, key, rule
      integer, intent(in) :: instance !! which of the groups of that name
      character(len=:), allocatable :: shown
      integer :: e, g, line

      if (checked%faults%full()) then
         call checked%faults%add(0, '') ! only counted
         return
      end if
      shown = ''
      line = checked%document%n_lines
      g = group_at(checked, group, instance)
      if (g > 0) line = checked%document%groups(g)%line
      e = entry_of(checked, group, instance, key)
      if (e > 0) then
         associate (entry => checked%document%entries(e))
            line = entry%line
            shown = index_text(entry)//' = '//shown_values(checked%document, entry)
         end associate
      end if
      call checked%faults%add(line, '&'//group//' '//key//shown//': '//rule)
   end subroutine blame

end module rodyn_checked_document
