!> What is done at each key of a file: a loader fills a configuration on its way, a writer prints it, a collector makes the table
!> of all keys. So each key is declared once, where it is tied to its component (`rodyn_case_config`, `rodyn_sweep_keys`).
module rodyn_field_visitor
   use rodyn_kinds, only: wp
   use rodyn_schema, only: schema_group, schema_row, name_length, type_integer, type_logical, type_real, type_text, type_word
   implicit none (type, external)
   private
   public :: field_visitor

   !> What is done at each key: by the procedure of its type, or by `any_field` where a visitor has none of its own.
   type, abstract :: field_visitor
      logical :: every_key = .false. !! also those that the law of a load or a kink does not take
   contains
      procedure(open_interface), deferred :: open_group
      procedure :: close_group
      procedure :: any_field
      procedure :: real_field
      procedure :: array_field
      procedure :: integer_field
      procedure :: logical_field
      procedure :: word_field
      procedure :: text_field
      procedure :: texts_field
      generic :: field => real_field, array_field, integer_field, logical_field
   end type field_visitor

   abstract interface
      subroutine open_interface(self, group, instance)
         import :: field_visitor, schema_group
         implicit none (type, external)
         class(field_visitor), intent(inout) :: self
         type(schema_group), intent(in) :: group
         integer, intent(in) :: instance !! 1, 2, ... of a repeated group
      end subroutine open_interface
   end interface

contains

   !> Most need not know.
   subroutine close_group(self)
      class(field_visitor), intent(inout) :: self
      associate (unused => self); end associate
   end subroutine close_group

   !> Whatever is done at keys of all types alike: nothing, unless a visitor says what.
   subroutine any_field(self, row, type)
      class(field_visitor), intent(inout) :: self
      type(schema_row), intent(in) :: row
      integer, intent(in) :: type !! `type_real` ...
      associate (unused => self, unused_row => row, unused_type => type); end associate
   end subroutine any_field

   subroutine real_field(self, x, row)
      class(field_visitor), intent(inout) :: self
      real(wp), intent(inout) :: x
      type(schema_row), intent(in) :: row
      associate (unused => x); end associate
      call self%any_field(row, type_real)
   end subroutine real_field

   subroutine array_field(self, x, row)
      class(field_visitor), intent(inout) :: self
      real(wp), allocatable, intent(inout) :: x(:)
      type(schema_row), intent(in) :: row
      associate (unused => x); end associate
      call self%any_field(row, type_real)
   end subroutine array_field

   subroutine integer_field(self, x, row)
      class(field_visitor), intent(inout) :: self
      integer, intent(inout) :: x
      type(schema_row), intent(in) :: row
      associate (unused => x); end associate
      call self%any_field(row, type_integer)
   end subroutine integer_field

   subroutine logical_field(self, x, row)
      class(field_visitor), intent(inout) :: self
      logical, intent(inout) :: x
      type(schema_row), intent(in) :: row
      associate (unused => x); end associate
      call self%any_field(row, type_logical)
   end subroutine logical_field

   subroutine word_field(self, x, row)
      class(field_visitor), intent(inout) :: self
      character(len=name_length), intent(inout) :: x
      type(schema_row), intent(in) :: row
      associate (unused => x); end associate
      call self%any_field(row, type_word)
   end subroutine word_field

   subroutine text_field(self, x, row)
      class(field_visitor), intent(inout) :: self
      character(len=:), allocatable, intent(inout) :: x
      type(schema_row), intent(in) :: row
      associate (unused => x); end associate
      call self%any_field(row, type_text)
   end subroutine text_field

   subroutine texts_field(self, x, row)
      class(field_visitor), intent(inout) :: self
      character(len=:), allocatable, intent(inout) :: x(:)
      type(schema_row), intent(in) :: row
      associate (unused => x); end associate
      call self%any_field(row, type_text)
   end subroutine texts_field

end module rodyn_field_visitor
