!> A document held against a schema: which row of the table each assignment belongs to.
!>
!> Three steps, because how long the arrays are may itself stand in the file: `match_document` finds the rows, the
!> reader looks up the extents, and `check_document` of `rodyn_document_checks` checks types, rules, counts, indices
!> and what is missing. Rules that tie several keys together are the reader's; it reports them with `report`.
module rodyn_checked_document
   use rodyn_faults, only: fault_list
   use rodyn_key_checker, only: key_checker, no_such
   use rodyn_namelist_document, only: namelist_document, index_text, shown_values
   use rodyn_schema, only: schema_extent, schema_group, schema_row, group_index, misspelt_group, misspelt_key, nearest_group, &
      nearest_key, row_index
   use rodyn_text, only: printable, to_text
   implicit none (type, external)
   private
   public :: checked_document, match_document, report, require, no_such, entry_of, is_given, is_sound, group_at, instances

   !> The document, the schema, and what came out. Lives no longer than the document.
   type, extends(key_checker) :: checked_document
      type(namelist_document), pointer :: document => null()
      type(schema_group), allocatable :: groups(:)
      type(schema_row), allocatable :: rows(:)
      type(schema_extent), allocatable :: extents(:)
      integer, allocatable :: known(:)  !! the document's groups, those of the first schema group first; misspelt ones where they
                                        !! seem to belong
      integer, allocatable :: before(:) !! how many of `known` stand before those of each schema group (0:)
      integer, allocatable :: row(:)  !! of each entry, also of a misspelt key; 0: none is near
      logical, allocatable :: ok(:)   !! of each entry: known, and its values keep the rules
      type(fault_list) :: faults
   contains
      procedure :: is_given
      procedure :: is_sound
      procedure :: report
      procedure :: require
   end type checked_document

contains

   !> Find the row of every entry; unknown and repeated groups and unknown keys are faults. What is misspelt is then taken for
   !> what is near, so that its own faults are found, too, and nothing is missed that is there.
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
         if (group_index(groups, document%groups(g)%name) == 0) call report_group(checked, g)
         if (i <= checked%before(size(groups))) call match_entries(checked, g, groups(count(checked%before < i))%name)
      end do
      call check_single_groups(checked)
   end subroutine match_document

   !> Order the document's groups by their place in the schema, unknown ones last, so that the
   !> k-th group of a name is found at once.
   subroutine sort_groups(checked)
      type(checked_document), intent(inout) :: checked
      integer, allocatable :: kind(:)
      integer :: next(size(checked%groups) + 1)
      integer :: g, k, n

      n = size(checked%groups)
      allocate (kind(checked%document%n_groups))
      do g = 1, size(kind)
         kind(g) = group_index(checked%groups, checked%document%groups(g)%name)
      end do
      do g = 1, size(kind)
         if (kind(g) > 0) cycle
         k = group_index(checked%groups, misspelt_group(checked%groups, checked%document%groups(g)%name))
         kind(g) = n + 1
         if (k == 0) cycle
         if (checked%groups(k)%repeatable .or. .not. any(kind == k)) kind(g) = k
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
               //': the group must not be repeated; the first one is in line ' &
               //to_text(checked%document%groups(checked%known(first))%line))
         end do
      end do
   end subroutine check_single_groups

   subroutine report_group(checked, g)
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
   end subroutine report_group

   subroutine match_entries(checked, g, group)
      type(checked_document), intent(inout) :: checked
      integer, intent(in) :: g
      character(len=*), intent(in) :: group !! what it is, or seems to be
      integer :: e, r

      associate (document => checked%document, first => checked%document%groups(g)%first, last => checked%document%groups(g)%last)
         do e = first, last
            checked%row(e) = row_index(checked%rows, trim(group), trim(document%entries(e)%key))
            checked%ok(e) = checked%row(e) > 0 .and. .not. document%entries(e)%faulty
         end do
         do e = first, last
            if (checked%row(e) > 0 .or. document%entries(e)%faulty) cycle
            call report_key(checked, g, e, trim(group))
            r = row_index(checked%rows, trim(group), misspelt_key(checked%rows, trim(group), document%entries(e)%key))
            if (r > 0 .and. .not. any(checked%row(first:last) == r)) checked%row(e) = r
         end do
      end associate
   end subroutine match_entries

   !> Name the group that has such a key, or else the nearest key of this group.
   subroutine report_key(checked, g, e, group)
      type(checked_document), intent(inout) :: checked
      integer, intent(in) :: g, e
      character(len=*), intent(in) :: group !! what it is, or seems to be
      character(len=:), allocatable :: hint
      integer :: r

      hint = ''
      associate (key => checked%document%entries(e)%key)
         if (.not. checked%faults%full()) then
            hint = 'the nearest known one is '//nearest_key(checked%rows, group, trim(key))
            do r = size(checked%rows), 1, -1
               if (checked%rows(r)%key == key) hint = 'it belongs to &'//trim(checked%rows(r)%group)
            end do
         end if
         call checked%faults%add(checked%document%entries(e)%line, '&'//trim(checked%document%groups(g)%name)//' '//trim(key)// &
            index_text(checked%document%entries(e))//': unknown key; '//hint)
      end associate
   end subroutine report_key

   !> Does the key stand in some group that does not take it? Then that is the fault, not that it is missing.
   logical function is_misplaced(checked, key)
      type(checked_document), intent(in) :: checked
      character(len=*), intent(in) :: key
      integer :: e
      is_misplaced = .false.
      do e = 1, size(checked%row)
         is_misplaced = is_misplaced .or. (checked%row(e) == 0 .and. checked%document%entries(e)%key == key)
      end do
   end function is_misplaced

   !> The entry that gives a key rightly in the `instance`-th group of that name; 0 if there is none.
   integer function entry_of(checked, group, instance, key) result(found)
      type(checked_document), intent(in) :: checked
      character(len=*), intent(in) :: group, key
      integer, intent(in) :: instance
      integer :: g, r

      found = 0
      g = group_at(checked, group, instance)
      if (g == 0) return
      r = row_index(checked%rows, group, key)
      do found = checked%document%groups(g)%first, checked%document%groups(g)%last
         if (checked%row(found) == r .and. checked%ok(found)) return
      end do
      found = 0
   end function entry_of

   !> Is the key given, rightly or wrongly?
   logical function is_given(self, group, instance, key)
      class(checked_document), intent(in) :: self
      character(len=*), intent(in) :: group, key
      integer, intent(in) :: instance
      integer :: g

      is_given = .false.
      g = group_at(self, group, instance)
      if (g == 0) return
      associate (entries => self%document%groups(g))
         is_given = any(self%row(entries%first:entries%last) == row_index(self%rows, group, key))
      end associate
   end function is_given

   !> True unless some assignment to the key breaks a rule, so that its value is not known.
   logical function is_sound(self, group, instance, key) result(sound)
      class(checked_document), intent(in) :: self
      character(len=*), intent(in) :: group, key
      integer, intent(in) :: instance
      integer :: e, g, r

      sound = .true.
      g = group_at(self, group, instance)
      if (g == 0) return
      r = row_index(self%rows, group, key)
      do e = self%document%groups(g)%first, self%document%groups(g)%last
         if (self%row(e) == r .and. .not. self%ok(e)) sound = .false.
      end do
   end function is_sound

   !> Note a fault of a key: in its line if it is given, else in that of its group, else in the last line.
   subroutine report(self, group, instance, key, rule)
      class(checked_document), intent(inout) :: self
      character(len=*), intent(in) :: group, key, rule
      integer, intent(in) :: instance !! which of the groups of that name
      character(len=:), allocatable :: shown
      integer :: e, g, line

      if (self%faults%full()) then
         call self%faults%add(0, '') ! only counted
         return
      end if
      shown = ''
      line = self%document%n_lines
      g = group_at(self, group, instance)
      if (g > 0) line = self%document%groups(g)%line
      e = entry_of(self, group, instance, key)
      if (e > 0) then
         associate (entry => self%document%entries(e))
            line = entry%line
            shown = index_text(entry)//' = '//shown_values(self%document, entry)
         end associate
      end if
      call self%faults%add(line, '&'//group//' '//key//shown//': '//rule)
   end subroutine report

   !> Note a key that is not given but must be.
   subroutine require(self, group, instance, key, when)
      class(checked_document), intent(inout) :: self
      character(len=*), intent(in) :: group, key
      integer, intent(in) :: instance
      character(len=*), intent(in) :: when !! as in 'is required '//when; empty: always
      if (is_given(self, group, instance, key)) return
      if (is_misplaced(self, key)) return
      call report(self, group, instance, key, trim('is required '//when))
   end subroutine require

end module rodyn_checked_document
