!> From a case file to a `case_config`: strict, and with every fault of the file in one error.
!>
!>     call read_case('table1.nml', config, text, error)
!>     if (allocated(error)) print '(a)', error%message
!>     ! table1.nml:12: &chain length(3) = -1.5: must be positive [m]
!>
!> For many variants of one file, parse it once, set keys, and build each case from the document:
!>
!>     call parse_document(text, 'table1.nml', document)
!>     call set_value(document, 'chain.hinge_stiffness(0)', '7000.0', error)
!>     call case_from_document(document, config, error)
module rodyn_case_reader
   use rodyn_case_check, only: complete_case
   use rodyn_case_config, only: case_config, case_extents, case_schema, visit_blank_case, visit_case
   use rodyn_case_rules, only: check_case
   use rodyn_case_writer, only: resolved_case
   use rodyn_checked_document, only: checked_document, entry_of, instances, match_document
   use rodyn_defaults_writer, only: defaults_writer, new_defaults_writer
   use rodyn_document_checks, only: check_document
   use rodyn_errors, only: error_type
   use rodyn_field_loader, only: field_loader
   use rodyn_file_text, only: read_text_file
   use rodyn_namelist_document, only: namelist_document, is_integer
   use rodyn_namelist_edit, only: set_value
   use rodyn_namelist_parser, only: parse_document
   use rodyn_schema, only: schema_group, schema_row, row_index
   implicit none (type, external)
   private
   public :: read_case, parse_case, case_from_document
   public :: resolved_case, default_case
   public :: namelist_document, parse_document, set_value

   character(len=*), parameter :: nl = new_line('a')
   character(len=*), parameter :: heading = &
      '! A case of Rodyn: every key, with its default or an example. SI units, angles in radians.'//nl// &
      '! Keys that may be left out are shown with their defaults; keys behind a ! do not apply to this example.'//nl

contains

   !> Read, check and complete a case file.
   subroutine read_case(path, config, input_text, error)
      character(len=*), intent(in) :: path
      type(case_config), intent(out) :: config
      character(len=:), allocatable, intent(out), optional :: input_text !! the file as it is
      type(error_type), allocatable, intent(out) :: error !! exit code 2, all faults
      character(len=:), allocatable :: text

      call read_text_file(path, text, error)
      if (allocated(error)) return
      call parse_case(text, path, config, error)
      if (present(input_text)) call move_alloc(text, input_text)
   end subroutine read_case

   !> The same from text in memory.
   subroutine parse_case(text, name, config, error)
      character(len=*), intent(in) :: text
      character(len=*), intent(in) :: name !! what messages call the text
      type(case_config), intent(out) :: config
      type(error_type), allocatable, intent(out) :: error
      type(namelist_document) :: document

      call parse_document(text, name, document)
      call case_from_document(document, config, error)
   end subroutine parse_case

   !> The same from a parsed document, perhaps with values set since.
   subroutine case_from_document(document, config, error)
      type(namelist_document), intent(in), target :: document
      type(case_config), intent(out) :: config
      type(error_type), allocatable, intent(out) :: error
      type(checked_document), target :: checked
      type(field_loader) :: loader
      type(schema_group), allocatable :: groups(:)
      type(schema_row), allocatable :: rows(:)

      call case_schema(groups, rows)
      call match_document(document, groups, rows, checked)
      if (.not. document%readable) then
         call checked%faults%to_error(document%name, error)
         return
      end if
      call check_document(checked, case_extents(rods_of(checked, presumed=.true.)))
      checked%extents = case_extents(rods_of(checked, presumed=.false.))
      loader%checked => checked
      allocate (config%profiles(instances(checked, 'rod_profile')), config%loads(instances(checked, 'load')), &
                config%kink_programs(instances(checked, 'kink_program')), config%hinges(instances(checked, 'hinge')))
      call visit_case(loader, config)
      call complete_case(checked, config)
      call check_case(checked, config)
      call checked%faults%to_error(document%name, error)
   end subroutine case_from_document

   !> The number of rods if it is given rightly, or at least by a misspelt key, else 0: everything that depends on it is then left
   !> unchecked.
   integer function rods_of(checked, presumed)
      type(checked_document), intent(in) :: checked
      logical, intent(in) :: presumed !! a misspelt key will do
      integer :: e

      rods_of = 0
      e = entry_of(checked, 'chain', 1, 'n_rods')
      if (e == 0 .and. presumed) e = findloc(checked%row == row_index(checked%rows, 'chain', 'n_rods'), .true., 1)
      if (e == 0) return
      associate (entry => checked%document%entries(e), values => checked%document%values)
         if (entry%first /= entry%last .or. values(entry%first)%kind /= is_integer) return
         rods_of = values(entry%first)%number
      end associate
   end function rods_of

   !> A complete commented case that runs as it is.
   function default_case() result(text)
      character(len=:), allocatable :: text
      type(defaults_writer) :: writer

      call new_defaults_writer(writer, case_extents(0), heading)
      call visit_blank_case(writer)
      text = writer%text%content()
   end function default_case

end module rodyn_case_reader
