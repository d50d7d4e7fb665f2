!> What is done at each key of a file: a loader fills a configuration on its way, a writer prints it. So there need
!> be only one list that ties keys to components.
module rodyn_field_visitor
   use rodyn_kinds, only: wp
   use rodyn_case_config, only: name_length
   implicit none (type, external)
   private
   public :: field_visitor

   !> What is done at each key
   type, abstract :: field_visitor
      logical :: every_key = .false. !! also those that the law of a load or a kink does not take
   contains
      procedure(open_interface), deferred :: open_group
      procedure(close_interface), deferred :: close_group
      procedure(real_interface), deferred :: real_field
      procedure(array_interface), deferred :: array_field
      procedure(integer_interface), deferred :: integer_field
      procedure(logical_interface), deferred :: logical_field
      procedure(word_interface), deferred :: word_field
      procedure(text_interface), deferred :: text_field
      generic :: field => real_field, array_field, integer_field, logical_field
   end type field_visitor

   abstract interface
      subroutine open_interface(self, group, instance)
         import :: field_visitor
         implicit none (type, external)
         class(field_visitor), intent(inout) :: self
         character(len=*), intent(in) :: group
         integer, intent(in) :: instance !! 1, 2, ... of a repeated group
      end subroutine open_interface

      subroutine close_interface(self)
         import :: field_visitor
         implicit none (type, external)
         class(field_visitor), intent(inout) :: self
      end subroutine close_interface

      subroutine real_interface(self, key, x)
         import :: field_visitor, wp
         implicit none (type, external)
         class(field_visitor), intent(inout) :: self
         character(len=*), intent(in) :: key
         real(wp), intent(inout) :: x
      end subroutine real_interface

      subroutine array_interface(self, key, x)
         import :: field_visitor, wp
         implicit none (type, external)
         class(field_visitor), intent(inout) :: self
         character(len=*), intent(in) :: key
         real(wp), allocatable, intent(inout) :: x(:)
      end subroutine array_interface

      subroutine integer_interface(self, key, x)
         import :: field_visitor
         implicit none (type, external)
         class(field_visitor), intent(inout) :: self
         character(len=*), intent(in) :: key
         integer, intent(inout) :: x
      end subroutine integer_interface

      subroutine logical_interface(self, key, x)
         import :: field_visitor
         implicit none (type, external)
         class(field_visitor), intent(inout) :: self
         character(len=*), intent(in) :: key
         logical, intent(inout) :: x
      end subroutine logical_interface

      subroutine word_interface(self, key, x)
         import :: field_visitor, name_length
         implicit none (type, external)
         class(field_visitor), intent(inout) :: self
         character(len=*), intent(in) :: key
         character(len=name_length), intent(inout) :: x
      end subroutine word_interface

      subroutine text_interface(self, key, x)
         import :: field_visitor
         implicit none (type, external)
         class(field_visitor), intent(inout) :: self
         character(len=*), intent(in) :: key
         character(len=:), allocatable, intent(inout) :: x
      end subroutine text_interface
   end interface

end module rodyn_field_visitor
