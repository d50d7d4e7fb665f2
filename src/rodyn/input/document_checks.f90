!> Does every assignment of a document keep the rules of its row, and is everything there that must be?
module rodyn_document_checks
   use rodyn_kinds, only: i8
   use rodyn_checked_document, only: checked_document, instances, no_such, require
   use rodyn_namelist_document, only: namelist_document, namelist_entry, index_text, is_integer, is_long_integer, is_string, &
      is_word, shown_value, shown_values
   use rodyn_schema, only: schema_extent, schema_row, any_list, group_index, one_value, count_rule, type_text, type_word
   use rodyn_text, only: is_digit, to_text
   use rodyn_value_rules, only: broken_rule
   implicit none (type, external)
   private
   public :: check_document

   integer, parameter :: max_list = 1000000 !! most values of a list of any length

contains

   !> Check every entry by its row, then each group as a whole.
   subroutine check_document(checked, extents)
      type(checked_document), intent(inout) :: checked
      type(schema_extent), intent(in) :: extents(:) !! with count 0 where it is not known
      integer :: e, g, k, r

      checked%extents = extents
      do g = 1, checked%document%n_groups
         do e = checked%document%groups(g)%first, checked%document%groups(g)%last
            if (checked%row(e) > 0 .and. .not. checked%document%entries(e)%faulty) call check_entry(checked, g, e)
         end do
         call check_repeated(checked, g)
      end do
      do r = 1, size(checked%rows)
         if (checked%rows(r)%default /= 'required') cycle
         k = group_index(checked%groups, checked%rows(r)%group)
         do g = 1, merge(instances(checked, trim(checked%rows(r)%group)), 1, checked%groups(k)%repeatable)
            call require(checked, trim(checked%rows(r)%group), g, trim(checked%rows(r)%key), '')
         end do
      end do
   end subroutine check_document

   !> Values, then index and count, which mean little where some are no values of the kind that the key takes.
   subroutine check_entry(checked, g, e)
      type(checked_document), intent(inout) :: checked
      integer, intent(in) :: g, e
      character(len=:), allocatable :: rule
      integer(i8) :: element
      integer :: v
      logical :: sound !! so far: its key is not misspelt

      associate (document => checked%document, entry => checked%document%entries(e), &
                 row => checked%rows(checked%row(e)))
         if (takes_strings(row) .and. any(document%values(entry%first:entry%last)%kind /= is_string)) then
            v = entry%first - 1 + findloc(document%values(entry%first:entry%last)%kind == is_string, .false., 1)
            call broken_rule(document, row, document%values(v), rule)
            call reject(checked, g, e, rule)
            return
         end if
         if (.not. any(document%values(entry%first:entry%last)%kind == is_word)) then
            sound = checked%ok(e)
            checked%ok(e) = .true.
            call check_count(checked, g, e)
            if (.not. checked%ok(e) .and. row%extent == one_value) return
            checked%ok(e) = checked%ok(e) .and. sound
         end if
         element = 1
         do v = entry%first, entry%last
            call broken_rule(document, row, document%values(v), rule)
            if (allocated(rule)) then
               checked%ok(e) = .false.
               call report_fault(checked, g, e, element_text(checked, e, element), &
                  shown_value(document, document%values(v)), rule, document%values(v)%line)
            end if
            element = element + document%values(v)%copies
         end do
      end associate
   end subroutine check_entry

   pure logical function takes_strings(row)
      type(schema_row), intent(in) :: row
      takes_strings = row%type == type_word .or. row%type == type_text
   end function takes_strings

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
   subroutine report_fault(checked, g, e, where, value, rule, line)
      type(checked_document), intent(inout) :: checked
      integer, intent(in) :: g, e
      character(len=*), intent(in) :: where !! index in parentheses, or nothing
      character(len=*), intent(in) :: value !! as written
      character(len=*), intent(in) :: rule
      integer, intent(in) :: line
      call checked%faults%add(line, '&'//trim(checked%document%groups(g)%name)//' ' &
         //trim(checked%document%entries(e)%key)//where//' = '//value//': '//rule)
   end subroutine report_fault

   !> Note a fault of an entry as a whole, and drop the entry.
   subroutine reject(checked, g, e, rule)
      type(checked_document), intent(inout) :: checked
      integer, intent(in) :: g, e
      character(len=*), intent(in) :: rule

      checked%ok(e) = .false.
      associate (entry => checked%document%entries(e))
         call report_fault(checked, g, e, index_text(entry), shown_values(checked%document, entry), rule, entry%line)
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
            if (given > 1) call reject(checked, g, e, 'takes one value'//not_count(given, 1, checked%document, entry))
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
               call reject(checked, g, e, no_such(trim(extent%name), extent%lower, upper))
               return
            end if
         end if
         if (given == 1 .or. given == wanted) return
         if (wanted == 1 .and. entry%indexed .and. given <= upper - entry%lower + 1) then
            call reject(checked, g, e, 'takes one value'//not_count(given, wanted, checked%document, entry)//'; write '// &
                        trim(entry%key)//'('//to_text(entry%lower)//':'//to_text(entry%lower + int(given) - 1)//') for all')
         else
            call reject(checked, g, e, count_rule(extent, wanted)//not_count(given, wanted, checked%document, entry))
         end if
      end associate
   end subroutine check_extent

   !> ', not 2', and a hint at what may be the reason: decimal commas, a repeat count meant as a product
   pure function not_count(n, wanted, document, entry) result(text)
      integer(i8), intent(in) :: n !! values given
      integer, intent(in) :: wanted
      type(namelist_document), intent(in) :: document
      type(namelist_entry), intent(in) :: entry
      character(len=:), allocatable :: text

      text = ', not many'
      if (n <= huge(1)) text = ', not '//to_text(int(n))
      if (n == 2 .or. n == 2*int(wanted, i8)) text = text//comma_hint(document, entry)
      associate (first => document%values(entry%first))
         if (wanted == 1 .and. entry%first == entry%last .and. first%copies > 1) text = text//'; '//to_text(first%copies)//'*'// &
            shown_value(document, first)//' means '//to_text(first%copies)//' values of '//shown_value(document, first)
      end associate
   end function not_count

   !> '1,5' may be meant as 1.5: say so if all values are pairs of whole numbers with nothing but a comma between the two.
   pure function comma_hint(document, entry) result(hint)
      type(namelist_document), intent(in) :: document
      type(namelist_entry), intent(in) :: entry
      character(len=:), allocatable :: hint
      character(len=:), allocatable :: whole, part
      integer :: v

      hint = ''
      if (modulo(entry%last - entry%first, 2) == 0) return
      do v = entry%first, entry%last, 2
         associate (a => document%values(v), b => document%values(v + 1))
            if (.not. (any(a%kind == [is_integer, is_long_integer]) .and. any(b%kind == [is_integer, is_long_integer]))) return
            if (b%first /= a%last + 2 .or. max(a%copies, b%copies) > 1) return
            if (document%text(a%last + 1:a%last + 1) /= ',' .or. .not. is_digit(document%text(b%first:b%first))) return
         end associate
      end do
      whole = shown_value(document, document%values(entry%first))
      part = shown_value(document, document%values(entry%first + 1))
      hint = '; a decimal comma? write '//whole//'.'//part
      if (len(part) == 3 .and. len(whole) < 4) hint = hint//' or '//whole//part
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
               if (whole(r) > 0) call reject(checked, g, e, 'duplicate key, first given in line ' &
                  //to_text(whole(r) - 1))
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
      logical :: sound

      sound = .true.
      associate (document => checked%document, extent => checked%extents(checked%rows(r)%extent))
         if (extent%count == 0) return
         allocate (owner(extent%lower:extent%lower + extent%count - 1), source=0)
         first = 0
         do e = document%groups(g)%first, document%groups(g)%last
            if (checked%row(e) /= r .or. .not. document%entries(e)%indexed) cycle
            if (first == 0) first = e
            call claim(checked, g, e, owner)
            sound = sound .and. checked%ok(e)
         end do
         if (filled .or. all(owner > 0) .or. .not. sound) return
         if (checked%rows(r)%default /= 'required' .and. checked%rows(r)%default /= 'depends') return
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
               call reject(checked, g, e, 'element '//to_text(i)//' is given twice, first in line ' &
                  //to_text(checked%document%entries(owner(i))%line))
               return
            end if
            owner(i) = e
         end do
      end associate
   end subroutine claim

end module rodyn_document_checks
