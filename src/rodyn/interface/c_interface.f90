!> The library for other languages: cases and results behind handles, docs/python.md and rodyn.h.
!>
!> A handle of a case has the case as text, with keys set since; one of a result has arrays and attributes. Calls return an exit
!> code of the program; the message is with the case. Calls must not overlap, not even with different handles: gfortran keeps
!> the lengths of texts that functions return in static memory. The package for Python sees to that.
module rodyn_c_interface
   use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_double, c_f_pointer, c_f_procpointer, c_funptr, c_int, &
      c_int64_t, c_loc, c_null_char, c_null_ptr, c_ptr
   use rodyn_attributes, only: is_text
   use rodyn_case_config, only: case_config, case_schema
   use rodyn_case_reader, only: case_from_document, resolved_case
   use rodyn_errors, only: error_type, exit_done
   use rodyn_integrator, only: monitor_type
   use rodyn_kinds, only: wp, i8
   use rodyn_lapack, only: use_one_thread
   use rodyn_linear_model, only: linear_model
   use rodyn_memory_run, only: run_in_memory
   use rodyn_modes, only: mode_set
   use rodyn_modes_of_case, only: modes_of_case
   use rodyn_namelist_document, only: namelist_document
   use rodyn_namelist_edit, only: set_value, split_key
   use rodyn_namelist_parser, only: parse_document
   use rodyn_posix, only: c_text
   use rodyn_result_table, only: result_table
   use rodyn_run_report, only: provenance
   use rodyn_schema, only: any_list, row_index, schema_group, schema_row
   implicit none (type, external)
   private
   public :: new_case, set_key, check_case, run_case, modes_of, message_of, resolved_text, free_case
   public :: n_arrays, get_array, n_attributes, get_attribute, free_result

   enum, bind(c)
      enumerator :: reals = 0, integers, texts !! kinds of arrays
   end enum

   integer(c_int), parameter :: at_equilibrium = 1, under_loads = 2 !! where modes are wanted; 0: the initial state without loads

   !> A text for C.
   type :: c_string
      character(kind=c_char), allocatable :: characters(:)
   end type c_string

   type :: case_handle
      type(namelist_document) :: document
      character(len=:), allocatable :: input
      logical :: is_checked = .false. !! `config` is the document's
      type(case_config) :: config
      type(c_string) :: message, resolved
   end type case_handle

   type :: result_handle
      type(result_table) :: table
      type(c_string), allocatable :: names(:), dims(:), units(:), long_names(:), texts(:) !! of arrays
      type(c_string), allocatable :: attribute_names(:), attribute_texts(:)
   end type result_handle

   type, bind(c) :: c_array
      type(c_ptr) :: name, dims, units, long_name
      integer(c_int) :: kind        !! `reals`, `integers`, `texts`
      integer(c_int) :: text_length !! of each text, filled with blanks; 0: no texts
      integer(c_int64_t) :: shape(2)
      type(c_ptr) :: values
   end type c_array

   type, bind(c) :: c_attribute
      type(c_ptr) :: name
      integer(c_int) :: kind !! of `rodyn_attributes`
      type(c_ptr) :: text
      real(c_double) :: x
      integer(c_int64_t) :: number
   end type c_attribute

   abstract interface
      !> Called about five times a second; anything but 0 stops the run.
      integer(c_int) function watcher_interface(t, t_end, n_steps, data) bind(c)
         import :: c_double, c_int, c_int64_t, c_ptr
         implicit none (type, external)
         real(c_double), value :: t, t_end     !! [s]
         integer(c_int64_t), value :: n_steps
         type(c_ptr), value :: data
      end function watcher_interface
   end interface

   type, extends(monitor_type) :: watcher_monitor
      procedure(watcher_interface), pointer, nopass :: watch => null()
      type(c_ptr) :: data = c_null_ptr
      real(wp) :: t_end = 0.0_wp
      logical :: stop_now = .false.
   contains
      procedure :: report
      procedure :: stop_requested
   end type watcher_monitor

contains

   !> A case from its text. What is wrong with it is found by the first call that needs it.
   type(c_ptr) function new_case(text, name) bind(c, name='rodyn_case_new')
      type(c_ptr), value :: text !! namelist
      type(c_ptr), value :: name !! of the case in messages
      type(case_handle), pointer :: case

      call use_one_thread() ! or the number of cores would decide the last digits
      allocate (case)
      case%input = c_text(text)
      call parse_document(case%input, c_text(name), case%document)
      call to_c('', case%message)
      new_case = c_loc(case)
   end function new_case

   !> Let a key have values in namelist syntax, as an axis of a sweep does.
   integer(c_int) function set_key(handle, key, values) bind(c, name='rodyn_case_set')
      type(c_ptr), value :: handle, key, values
      type(case_handle), pointer :: case
      type(error_type), allocatable :: error
      character(len=:), allocatable :: name

      call c_f_pointer(handle, case)
      name = c_text(key)
      case%is_checked = .false.
      call set_value(case%document, name, c_text(values), error, is_list(name))
      set_key = outcome(case, error)
   end function set_key

   !> Is this an element of a key whose length is that of its values?
   logical function is_list(key)
      character(len=*), intent(in) :: key
      type(schema_group), allocatable :: groups(:)
      type(schema_row), allocatable :: rows(:)
      type(error_type), allocatable :: error
      character(len=:), allocatable :: group, name
      integer :: instance, row

      is_list = .false.
      call split_key(key, group, instance, name, error)
      if (allocated(error)) return
      if (index(name, '(') == 0) return
      call case_schema(groups, rows)
      row = row_index(rows, group, name(:index(name, '(') - 1))
      if (row > 0) is_list = rows(row)%extent == any_list
   end function is_list

   !> Find all faults of a case.
   integer(c_int) function check_case(handle) bind(c, name='rodyn_case_check')
      type(c_ptr), value :: handle
      type(case_handle), pointer :: case
      type(error_type), allocatable :: error

      call c_f_pointer(handle, case)
      call check(case, error)
      check_case = outcome(case, error)
   end function check_case

   !> Integrate a case. There is a result unless the case is refused: of a run that failed or was stopped, with the rows until then.
   integer(c_int) function run_case(handle, watcher, data, result) bind(c, name='rodyn_case_run')
      type(c_ptr), value :: handle
      type(c_funptr), value :: watcher !! see `watcher_interface`; may be null
      type(c_ptr), value :: data       !! for the watcher
      type(c_ptr), intent(out) :: result
      type(case_handle), pointer :: case
      type(result_handle), pointer :: made
      type(watcher_monitor), target :: monitor
      type(error_type), allocatable :: error

      result = c_null_ptr
      call c_f_pointer(handle, case)
      call check(case, error)
      if (.not. allocated(error)) then
         if (c_associated(watcher)) call c_f_procpointer(watcher, monitor%watch)
         monitor%data = data
         monitor%t_end = case%config%t_end
         allocate (made)
         call run_in_memory(case%config, case%document%name, case%input, monitor, made%table, error)
         call hand_over(made, result)
      end if
      run_case = outcome(case, error)
   end function run_case

   !> Modes of a case.
   integer(c_int) function modes_of(handle, at, result) bind(c, name='rodyn_case_modes')
      type(c_ptr), value :: handle
      integer(c_int), value :: at !! 0, `at_equilibrium` or `under_loads`
      type(c_ptr), intent(out) :: result
      type(case_handle), pointer :: case
      type(result_handle), pointer :: made
      type(error_type), allocatable :: error
      type(linear_model) :: model
      type(mode_set) :: modes
      type(provenance) :: origin
      character(len=:), allocatable :: warnings

      result = c_null_ptr
      call c_f_pointer(handle, case)
      call check(case, error)
      if (.not. allocated(error)) then
         allocate (made)
         call modes_of_case(case%config, at == at_equilibrium, at == under_loads, model, modes, made%table, origin, &
                            warnings, error)
         origin%input = case%input
         if (.not. allocated(error)) call origin%list('done', made%table%attributes)
         call hand_over(made, result)
      end if
      modes_of = outcome(case, error)
   end function modes_of

   !> Why the last call with this case did not return 0; all faults, one line each. Valid until the next call.
   type(c_ptr) function message_of(handle) bind(c, name='rodyn_case_message')
      type(c_ptr), value :: handle
      type(case_handle), pointer :: case
      call c_f_pointer(handle, case)
      message_of = c_loc(case%message%characters)
   end function message_of

   !> Every key with the value that is used, as a namelist; null if the case has faults. Valid until the next call.
   type(c_ptr) function resolved_text(handle) bind(c, name='rodyn_case_resolved')
      type(c_ptr), value :: handle
      type(case_handle), pointer :: case
      type(error_type), allocatable :: error

      resolved_text = c_null_ptr
      call c_f_pointer(handle, case)
      call check(case, error)
      if (outcome(case, error) /= exit_done) return
      call to_c(resolved_case(case%config), case%resolved)
      resolved_text = c_loc(case%resolved%characters)
   end function resolved_text

   subroutine free_case(handle) bind(c, name='rodyn_case_free')
      type(c_ptr), value :: handle
      type(case_handle), pointer :: case
      if (.not. c_associated(handle)) return
      call c_f_pointer(handle, case)
      deallocate (case)
   end subroutine free_case

   integer(c_int) function n_arrays(handle) bind(c, name='rodyn_result_arrays')
      type(c_ptr), value :: handle
      type(result_handle), pointer :: result
      call c_f_pointer(handle, result)
      n_arrays = result%table%n
   end function n_arrays

   !> Array i of a result. What it points to is the result's.
   subroutine get_array(handle, i, array) bind(c, name='rodyn_result_array')
      type(c_ptr), value :: handle
      integer(c_int), value :: i !! 0 ... n_arrays - 1
      type(c_array), intent(out) :: array
      type(result_handle), pointer :: result

      call c_f_pointer(handle, result)
      array%name = c_loc(result%names(i + 1)%characters)
      array%dims = c_loc(result%dims(i + 1)%characters)
      array%units = c_loc(result%units(i + 1)%characters)
      array%long_name = c_loc(result%long_names(i + 1)%characters)
      associate (x => result%table%arrays(i + 1))
         array%shape = x%shape
         array%text_length = x%text_length
         if (allocated(x%reals)) then
            array%kind = reals
            array%values = c_loc(result%table%arrays(i + 1)%reals)
         else if (allocated(x%integers)) then
            array%kind = integers
            array%values = c_loc(result%table%arrays(i + 1)%integers)
         else
            array%kind = texts
            array%values = c_loc(result%texts(i + 1)%characters)
         end if
      end associate
   end subroutine get_array

   integer(c_int) function n_attributes(handle) bind(c, name='rodyn_result_attributes')
      type(c_ptr), value :: handle
      type(result_handle), pointer :: result
      call c_f_pointer(handle, result)
      n_attributes = result%table%attributes%n
   end function n_attributes

   !> Attribute i of a result. What it points to is the result's.
   subroutine get_attribute(handle, i, attribute) bind(c, name='rodyn_result_attribute')
      type(c_ptr), value :: handle
      integer(c_int), value :: i !! 0 ... n_attributes - 1
      type(c_attribute), intent(out) :: attribute
      type(result_handle), pointer :: result

      call c_f_pointer(handle, result)
      attribute%name = c_loc(result%attribute_names(i + 1)%characters)
      attribute%text = c_loc(result%attribute_texts(i + 1)%characters)
      associate (x => result%table%attributes%items(i + 1))
         attribute%kind = x%kind
         attribute%x = x%x
         attribute%number = x%number
      end associate
   end subroutine get_attribute

   subroutine free_result(handle) bind(c, name='rodyn_result_free')
      type(c_ptr), value :: handle
      type(result_handle), pointer :: result
      if (.not. c_associated(handle)) return
      call c_f_pointer(handle, result)
      deallocate (result)
   end subroutine free_result

   !> Build the configuration if a key has been set since.
   subroutine check(case, error)
      type(case_handle), intent(inout) :: case
      type(error_type), allocatable, intent(out) :: error
      if (case%is_checked) return
      call case_from_document(case%document, case%config, error)
      case%is_checked = .not. allocated(error)
   end subroutine check

   !> Exit code of a call, whose message stays with the case.
   integer(c_int) function outcome(case, error)
      type(case_handle), intent(inout) :: case
      type(error_type), allocatable, intent(in) :: error
      outcome = exit_done
      if (allocated(error)) then
         outcome = error%exit_code
         call to_c(error%message, case%message)
      else
         call to_c('', case%message)
      end if
   end function outcome

   !> A table with texts for C, as a handle; nothing if it is empty.
   subroutine hand_over(made, handle)
      type(result_handle), pointer, intent(inout) :: made
      type(c_ptr), intent(out) :: handle
      integer :: i

      handle = c_null_ptr
      if (made%table%attributes%n == 0) then
         deallocate (made)
         return
      end if
      associate (n => made%table%n, m => made%table%attributes%n)
         allocate (made%names(n), made%dims(n), made%units(n), made%long_names(n), made%texts(n))
         allocate (made%attribute_names(m), made%attribute_texts(m))
      end associate
      do i = 1, made%table%n
         associate (x => made%table%arrays(i))
            call to_c(trim(x%name), made%names(i))
            call to_c(trim(trim(x%dims(1))//' '//x%dims(2)), made%dims(i))
            call to_c(x%units, made%units(i))
            call to_c(x%long_name, made%long_names(i))
            if (.not. allocated(x%texts)) cycle
            call join(x%texts, x%text_length, made%texts(i))
         end associate
      end do
      do i = 1, made%table%attributes%n
         associate (x => made%table%attributes%items(i))
            call to_c(x%name, made%attribute_names(i))
            if (x%kind == is_text) then
               call to_c(x%text, made%attribute_texts(i))
            else
               call to_c('', made%attribute_texts(i))
            end if
         end associate
      end do
      handle = c_loc(made)
   end subroutine hand_over

   !> Texts one behind the other, each of the same length.
   subroutine join(list, length, string)
      character(len=*), intent(in) :: list(:)
      integer, intent(in) :: length
      type(c_string), intent(out) :: string
      integer :: i, k
      allocate (string%characters(length*size(list)))
      do i = 1, size(list)
         do k = 1, length
            string%characters((i - 1)*length + k) = list(i)(k:k)
         end do
      end do
   end subroutine join

   !> With a zero behind it.
   subroutine to_c(text, string)
      character(len=*), intent(in) :: text
      type(c_string), intent(inout) :: string
      string%characters = transfer(text//c_null_char, [' '], len(text) + 1)
   end subroutine to_c

   subroutine report(self, t, n_steps)
      class(watcher_monitor), intent(inout) :: self
      real(wp), intent(in) :: t
      integer(i8), intent(in) :: n_steps
      if (.not. associated(self%watch)) return
      if (self%watch(t, self%t_end, n_steps, self%data) /= 0) self%stop_now = .true.
   end subroutine report

   function stop_requested(self) result(requested)
      class(watcher_monitor), intent(in) :: self
      logical :: requested
      requested = self%stop_now
   end function stop_requested

end module rodyn_c_interface
