!> One case from its description to its modes: what `rodyn modes` does, and what a library user may call.
module rodyn_modal_analysis
   use rodyn_kinds, only: wp
   use rodyn_case_config, only: case_config
   use rodyn_case_check, only: sound_case
   use rodyn_errors, only: error_type
   use rodyn_linear_model, only: linear_model
   use rodyn_modes, only: mode_set, rigid_body, mechanism, relaxation
   use rodyn_modes_file, only: write_modes
   use rodyn_modes_of_case, only: modes_of_case
   use rodyn_result_file, only: check_output_path
   use rodyn_result_table, only: result_table
   use rodyn_run_report, only: provenance
   use rodyn_terminal, only: print_line
   use rodyn_text, only: formatted, to_text
   implicit none (type, external)
   private
   public :: analyse_modes

   real(wp), parameter :: pi = acos(-1.0_wp)
   integer, parameter :: most_rows = 40 !! of the table on the terminal

contains

   !> Compute the modes of a case, write them, and print a table.
   subroutine analyse_modes(given, path, equilibrium, loads, error, input_text, force, quiet)
      type(case_config), intent(in) :: given
      character(len=*), intent(in) :: path                 !! of the HDF5 file
      logical, intent(in) :: equilibrium                   !! about the equilibrium near the initial state, under loads
      logical, intent(in) :: loads                         !! about the initial state: the loads of t = 0 act
      type(error_type), allocatable, intent(out) :: error
      character(len=*), intent(in), optional :: input_text !! namelist as read, kept in the file
      logical, intent(in), optional :: force               !! replace an existing file
      logical, intent(in), optional :: quiet               !! print nothing
      type(case_config) :: config !! with what is not given
      type(linear_model) :: model
      type(mode_set) :: modes
      type(result_table) :: table
      type(provenance) :: origin
      character(len=:), allocatable :: warnings
      logical :: silent, replace

      silent = .false.
      replace = .false.
      if (present(quiet)) silent = quiet
      if (present(force)) replace = force
      call check_output_path(path, replace, error)
      if (.not. allocated(error)) call sound_case(given, config, error)
      if (.not. allocated(error)) call modes_of_case(config, equilibrium, loads, model, modes, table, origin, warnings, error)
      if (allocated(error)) return
      if (present(input_text)) origin%input = input_text
      call write_modes(path, replace, origin, table, error)
      if (allocated(error) .or. silent) return
      call print_table(modes)
      if (.not. equilibrium .and. .not. model%is_steady(modes%fastest)) call print_line(&
         'note    the initial state is no equilibrium: these are the modes of its equations held at t = 0; see --equilibrium')
      if (len(warnings) > 0) call print_line('warning '//warnings)
      call print_line('file    '//path)
   end subroutine analyse_modes

   !> One line for each mode, as far as there is room.
   subroutine print_table(modes)
      type(mode_set), intent(in) :: modes
      real(wp), dimension(modes%n) :: frequency, ratio, decay
      character(len=120) :: line
      integer :: i

      frequency = modes%frequency()
      ratio = modes%damping_ratio()
      decay = modes%decay()
      call print_line('  mode   frequency, rad/s   frequency, Hz   damping ratio      decay, 1/s   kind')
      do i = 1, min(modes%n, most_rows)
         if (modes%kind(i) == rigid_body .or. modes%kind(i) == mechanism) then
            write (line, '(i6, f19.6, f16.6, 35x, a)') i, 0.0_wp, 0.0_wp, modes%kind(i)
         else if (modes%kind(i) == relaxation) then
            write (line, '(i6, 51x, a16, 3x, a)') i, formatted(decay(i), '(es16.6)'), modes%kind(i)
         else
            write (line, '(i6, a19, 3a16, 3x, a)') i, formatted(frequency(i), '(f19.6)'), &
               formatted(frequency(i)/(2.0_wp*pi), '(f16.6)'), formatted(ratio(i), '(es16.6)'), formatted(decay(i), '(es16.6)'), &
               modes%kind(i)
         end if
         if (.not. modes%is_stable(i)) line = trim(line)//', growing'
         call print_line(trim(line))
      end do
      if (modes%n > most_rows) call print_line('   ... and '//to_text(modes%n - most_rows)//' more in the file')
      if (all([(modes%is_stable(i), i=1, modes%n)])) then
         call print_line('stable  no mode grows')
      else
         call print_line('unstable  '//to_text(count([(.not. modes%is_stable(i), i=1, modes%n)]))//' of them grow')
      end if
   end subroutine print_table

end module rodyn_modal_analysis
