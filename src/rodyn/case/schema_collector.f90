!> The table of the keys that a visit passes: groups and rows as they are declared, rows with their group and type.
module rodyn_schema_collector
   use rodyn_kinds, only: wp
   use rodyn_field_visitor, only: field_visitor
   use rodyn_schema, only: schema_group, schema_row, name_length, type_integer, type_logical, type_real, type_text, type_word
   implicit none (type, external)
   private
   public :: schema_collector

   type, extends(field_visitor) :: schema_collector
      private
      type(schema_group), allocatable :: groups(:)
      type(schema_row), allocatable :: rows(:)
      integer :: n_groups = 0, n_rows = 0
   contains
      procedure :: table
      procedure :: open_group
      procedure :: real_field
      procedure :: array_field
      procedure :: integer_field
      procedure :: logical_field
      procedure :: word_field
      procedure :: text_field
      procedure :: texts_field
   end type schema_collector

contains

   !> What was collected.
   subroutine table(self, groups, rows)
      class(schema_collector), intent(in) :: self
      type(schema_group), allocatable, intent(out) :: groups(:)
      type(schema_row), allocatable, intent(out) :: rows(:)
      groups = self%groups(:self%n_groups)
      rows = self%rows(:self%n_rows)
   end subroutine table

   subroutine open_group(self, group, instance)
      class(schema_collector), intent(inout) :: self
      type(schema_group), intent(in) :: group
      integer, intent(in) :: instance
      associate (unused => instance); end associate
      if (.not. allocated(self%groups)) allocate (self%groups(16), self%rows(128))
      if (self%n_groups == size(self%groups)) self%groups = [self%groups, self%groups]
      self%n_groups = self%n_groups + 1
      self%groups(self%n_groups) = group
   end subroutine open_group

   !> Append a row of the group that is open.
   subroutine append(self, row, type)
      class(schema_collector), intent(inout) :: self
      type(schema_row), intent(in) :: row
      integer, intent(in) :: type

      if (self%n_rows == size(self%rows)) self%rows = [self%rows, self%rows]
      self%n_rows = self%n_rows + 1
      self%rows(self%n_rows) = row
      self%rows(self%n_rows)%group = self%groups(self%n_groups)%name
      self%rows(self%n_rows)%type = type
   end subroutine append

   subroutine real_field(self, x, row)
      class(schema_collector), intent(inout) :: self
      real(wp), intent(inout) :: x
      type(schema_row), intent(in) :: row
      associate (unused => x); end associate
      call append(self, row, type_real)
   end subroutine real_field

   subroutine array_field(self, x, row)
      class(schema_collector), intent(inout) :: self
      real(wp), allocatable, intent(inout) :: x(:)
      type(schema_row), intent(in) :: row
      associate (unused => x); end associate
      call append(self, row, type_real)
   end subroutine array_field

   subroutine integer_field(self, x, row)
      class(schema_collector), intent(inout) :: self
      integer, intent(inout) :: x
      type(schema_row), intent(in) :: row
      associate (unused => x); end associate
      call append(self, row, type_integer)
   end subroutine integer_field

   subroutine logical_field(self, x, row)
      class(schema_collector), intent(inout) :: self
      logical, intent(inout) :: x
      type(schema_row), intent(in) :: row
      associate (unused => x); end associate
      call append(self, row, type_logical)
   end subroutine logical_field

   subroutine word_field(self, x, row)
      class(schema_collector), intent(inout) :: self
      character(len=name_length), intent(inout) :: x
      type(schema_row), intent(in) :: row
      associate (unused => x); end associate
      call append(self, row, type_word)
   end subroutine word_field

   subroutine text_field(self, x, row)
      class(schema_collector), intent(inout) :: self
      character(len=:), allocatable, intent(inout) :: x
      type(schema_row), intent(in) :: row
      associate (unused => x); end associate
      call append(self, row, type_text)
   end subroutine text_field

   subroutine texts_field(self, x, row)
      class(schema_collector), intent(inout) :: self
      character(len=:), allocatable, intent(inout) :: x(:)
      type(schema_row), intent(in) :: row
      associate (unused => x); end associate
      call append(self, row, type_text)
   end subroutine texts_field

end module rodyn_schema_collector
