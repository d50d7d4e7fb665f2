!> What is done at each key of a file: a loader fills a configuration on its way, a writer prints it, a collector makes the table
!> of all keys. So each key is declared once, where it is tied to its component (`rodyn_case_config`, `rodyn_sweep_keys`).
module rodyn_field_visitor
   use rodyn_kinds, only: wp
   use rodyn_schema, only: name_length, schema_group, schema_row
   implicit none (type, external)
   private
   public :: field_visitor

   !> What is done at each key
   type, abstract :: field_visitor
      logical :: every_key = .false. !! also those that the law of a load or a kink does not take
   contains
      procedure(open_interface), deferred :: open_group
      procedure(real_interface), deferred :: real_field
      procedure(array_interface), deferred :: array_field
      procedure(integer_interface), deferred :: integer_field
      procedure(logical_interface), deferred :: logical_field
      procedure(word_interface), deferred :: word_field
      procedure(text_interface), deferred :: text_field
      procedure :: texts_field
      procedure :: close_group
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

      subroutine real_interface(self, x, row)
         import :: field_visitor, schema_row, wp
         implicit none (type, external)
         class(field_visitor), intent(inout) :: self
         real(wp), intent(inout) :: x
         type(schema_row), intent(in) :: row
      end subroutine real_interface

      subroutine array_interface(self, x, row)
         import :: field_visitor, schema_row, wp
         implicit none (type, external)
         class(field_visitor), intent(inout) :: self
         real(wp), allocatable, intent(inout) :: x(:)
         type(schema_row), intent(in) :: row
      end subroutine array_interface

      subroutine integer_interface(self, x, row)
         import :: field_visitor, schema_row
         implicit none (type, external)
         class(field_visitor), intent(inout) :: self
         integer, intent(inout) :: x
         type(schema_row), intent(in) :: row
      end subroutine integer_interface

      subroutine logical_interface(self, x, row)
         import :: field_visitor, schema_row
         implicit none (type, external)
         class(field_visitor), intent(inout) :: self
         logical, intent(inout) :: x
         type(schema_row), intent(in) :: row
      end subroutine logical_interface

      subroutine word_interface(self, x, row)
         import :: field_visitor, schema_row, name_length
         implicit none (type, external)
         class(field_visitor), intent(inout) :: self
         character(len=name_length), intent(inout) :: x
         type(schema_row), intent(in) :: row
      end subroutine word_interface

      subroutine text_interface(self, x, row)
         import :: field_visitor, schema_row
         implicit none (type, external)
         class(field_visitor), intent(inout) :: self
         character(len=:), allocatable, intent(inout) :: x
         type(schema_row), intent(in) :: row
      end subroutine text_interface
   end interface

contains

   !> A list of texts, which no case has: only those who visit sweeps do anything.
   subroutine texts_field(self, x, row)
      class(field_visitor), intent(inout) :: self
      character(len=:), allocatable, intent(inout) :: x(:)
      type(schema_row), intent(in) :: row
      associate (unused => self, unused_x => x, unused_row => row); end associate
   end subroutine texts_field

   !> Most need not know.
   subroutine close_group(self)
      class(field_visitor), intent(inout) :: self
      associate (unused => self); end associate
   end subroutine close_group

end module rodyn_field_visitor
