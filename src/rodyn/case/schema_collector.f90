!> The table of the keys that a visit passes: groups and rows as they are declared, rows with their group and type.
module rodyn_schema_collector
   use rodyn_field_visitor, only: field_visitor
   use rodyn_schema, only: schema_group, schema_row
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
      procedure :: any_field
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
   subroutine any_field(self, row, type)
      class(schema_collector), intent(inout) :: self
      type(schema_row), intent(in) :: row
      integer, intent(in) :: type

      if (self%n_rows == size(self%rows)) self%rows = [self%rows, self%rows]
      self%n_rows = self%n_rows + 1
      self%rows(self%n_rows) = row
      self%rows(self%n_rows)%group = self%groups(self%n_groups)%name
      self%rows(self%n_rows)%type = type
   end subroutine any_field

end module rodyn_schema_collector
