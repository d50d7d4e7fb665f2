!> What the rules of a case ask of its keys, and whom they tell of faults. A document knows what is written in which line
!> (`rodyn_checked_document`); a case in memory has values only (`rodyn_case_check`).
module rodyn_key_checker
   use rodyn_text, only: to_text
   implicit none (type, external)
   private
   public :: key_checker, no_such

   type, abstract :: key_checker
   contains
      procedure(ask_interface), deferred :: is_given
      procedure(ask_interface), deferred :: is_sound
      procedure(report_interface), deferred :: report
      procedure :: require
   end type key_checker

   abstract interface
      !> Is the key given, rightly or wrongly? Or: does nothing that is given for it break a rule of its own?
      logical function ask_interface(self, group, instance, key)
         import :: key_checker
         implicit none (type, external)
         class(key_checker), intent(in) :: self
         character(len=*), intent(in) :: group, key
         integer, intent(in) :: instance !! which of the groups of that name
      end function ask_interface

      !> Note a fault of a key.
      subroutine report_interface(self, group, instance, key, rule)
         import :: key_checker
         implicit none (type, external)
         class(key_checker), intent(inout) :: self
         character(len=*), intent(in) :: group, key, rule
         integer, intent(in) :: instance
      end subroutine report_interface
   end interface

contains

   !> Note a key that is not given but must be.
   subroutine require(self, group, instance, key, when)
      class(key_checker), intent(inout) :: self
      character(len=*), intent(in) :: group, key
      integer, intent(in) :: instance
      character(len=*), intent(in) :: when !! as in 'is required '//when; empty: always
      if (.not. self%is_given(group, instance, key)) call self%report(group, instance, key, trim('is required '//when))
   end subroutine require

   !> The fault of a number that no rod, node, hinge ... has.
   pure function no_such(what, first, last) result(rule)
      character(len=*), intent(in) :: what
      integer, intent(in) :: first, last
      character(len=:), allocatable :: rule
      rule = 'there is no such '//what//'; the numbers are '//to_text(first)//'..'//to_text(last)
   end function no_such

end module rodyn_key_checker
