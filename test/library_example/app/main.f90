!> One rod on a spacecraft at rest, turned by a moment: a scene made in memory, checked and run.
program library_example
   use rodyn, only: wp, case_config, error_type, parse_case, run_case
   implicit none (type, external)
   character(len=*), parameter :: nl = new_line('a')
   character(len=*), parameter :: scene = &
      "&case title = 'One rod', t_end = 1, n_outputs = 10 /"//nl// &
      "&spacecraft mass = 100, inertia = 10 /"//nl// &
      "&chain n_rods = 1, length = 2, mass_per_length = 1.5, bending_stiffness = 1e4, node_mass = 1,"//nl// &
      "       hinge_stiffness = 5000 /"//nl// &
      "&load component = 'M', t_end = 0.5, value = 100 /"//nl
   type(case_config) :: config
   type(error_type), allocatable :: error
   character(len=1000) :: path

   call get_command_argument(1, path)
   if (path == '') path = 'one_rod.h5'

   call parse_case(scene, 'one rod', config, error)
   call stop_on(error)
   config%spacecraft%hinge_x = 0.4_wp
   call run_case(config, trim(path), error, input_text=scene, force=.true., quiet=.true.)
   call stop_on(error)
   write (*, '(2a)') 'wrote ', trim(path)

contains

   subroutine stop_on(failure)
      type(error_type), intent(in), allocatable :: failure
      if (.not. allocated(failure)) return
      write (*, '(a)') failure%message
      stop 1, quiet=.true.
   end subroutine stop_on

end program library_example
