!> One sweep as the user describes it: a base case and the keys that are varied.
!>
!> Axes that advance together share a *dimension*; the cases are all combinations of the rows of the dimensions, the
!> last dimension running fastest. In a grid each axis has its own dimension, unless it goes `along` another; in a zip
!> all share one.
module rodyn_sweep_config
   use rodyn_kinds, only: wp
   use rodyn_case_config, only: case_config
   use rodyn_namelist_document, only: namelist_document
   use rodyn_sweep_keys, only: sweep_keys
   use rodyn_text, only: formatted, plain_text, quoted, tidy, to_text
   implicit none (type, external)
   private
   public :: sweep_config, sweep_axis, axis_size, shown_value, short_value_text, value_text, is_ratio

   integer, parameter :: key_length = 80

   !> &axis
   type :: sweep_axis
      character(len=key_length) :: key = ''           !! 'group.name(3)' in lower case, or 'mass_ratio'
      logical :: textual = .false.                    !! `texts`, otherwise `numbers`
      logical :: whole = .false.                      !! the numbers are integers
      logical :: bare = .false.                       !! the texts stand without quotes: .true., .false.
      logical :: in_list = .false.                    !! the key is a list, as long as the base has it
      real(wp), allocatable :: numbers(:)
      character(len=:), allocatable :: texts(:)
      character(len=12) :: unit = ''
      integer :: dimension = 0                        !! 0: not to be built, since the axis is at fault
      logical, allocatable :: bad(:)                  !! values that break a rule of the key itself
   end type sweep_axis

   !> A whole sweep: what its file says in &sweep, and what was made of the rest
   type, extends(sweep_keys) :: sweep_config
      character(len=:), allocatable :: name, text           !! of the sweep file
      character(len=:), allocatable :: base_name, base_text !! of the case file
      type(namelist_document) :: base_document              !! parsed
      type(case_config) :: base_case                        !! as the base file alone has it
      type(sweep_axis), allocatable :: axes(:)
      integer :: n_dimensions = 0
      character(len=:), allocatable :: tried                !! what was tried of the values, in words
   end type sweep_config

contains

   !> Number of values of an axis.
   pure integer function axis_size(axis)
      type(sweep_axis), intent(in) :: axis
      if (axis%textual) then
         axis_size = size(axis%texts)
      else
         axis_size = size(axis%numbers)
      end if
   end function axis_size

   !> Is it the ratio of node mass to rod mass, which no single key of a case holds?
   pure logical function is_ratio(axis)
      type(sweep_axis), intent(in) :: axis
      is_ratio = axis%key == 'mass_ratio'
   end function is_ratio

   !> Value `row` of an axis for a message.
   function shown_value(axis, row) result(text)
      type(sweep_axis), intent(in) :: axis
      integer, intent(in) :: row
      character(len=:), allocatable :: text
      if (axis%textual .or. axis%whole) then
         text = value_text(axis, row)
      else
         text = tidy(formatted(axis%numbers(row), '(g0.15)'))
      end if
   end function shown_value

   !> Value `row` of an axis in namelist syntax, as short as it may be to read back the same.
   function short_value_text(axis, row) result(text)
      type(sweep_axis), intent(in) :: axis
      integer, intent(in) :: row
      character(len=:), allocatable :: text

      if (axis%textual .or. axis%whole) then
         text = value_text(axis, row)
      else
         text = plain_text(axis%numbers(row))
      end if
   end function short_value_text

   !> Value `row` of an axis in namelist syntax.
   function value_text(axis, row) result(text)
      type(sweep_axis), intent(in) :: axis
      integer, intent(in) :: row
      character(len=:), allocatable :: text
      if (axis%bare) then
         text = trim(axis%texts(row))
      else if (axis%textual) then
         text = quoted(trim(axis%texts(row)))
      else if (axis%whole) then
         text = to_text(nint(axis%numbers(row)))
      else
         text = to_text(axis%numbers(row))
      end if
   end function value_text

end module rodyn_sweep_config
