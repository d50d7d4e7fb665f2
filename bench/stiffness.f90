!> Which method wins where: chains of n rods at rest on a spacecraft that is suddenly turned, over n, the rods' bending
!> stiffness and the hinges' dampers. Every method runs with several tolerances; errors are those of the chord angles (slow)
!> and of the rates of the slopes (as fast as the scene gets) at the end, against a run at 1e-11. A run that takes longer than
!> `patience` is given up and its time extrapolated. The file must not exist.
!>
!>     tools/bench stiffness stiffness.h5 4 16 64
!>
!> postproc/stiffness.py draws the file.
program bench_stiffness
   use, intrinsic :: iso_fortran_env, only: compiler_options
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type
   use rodyn_bench_support, only: stopwatch, table1_chain
   use rodyn_case_config, only: case_config, load_config
   use rodyn_scene, only: scene_type, new_scene
   use rodyn_motion, only: motion_type, new_motion, initial_state
   use rodyn_integrator, only: integrator_type, solver_options, solver_statistics
   use rodyn_integrators, only: new_integrator
   use rodyn_method_choice, only: method_choice, choose_method
   use rodyn_method_costs, only: candidates, effort_of
   use rodyn_hdf5_files, only: hdf5_file
   implicit none (type, external)

   real(wp), parameter :: t_end = 0.25_wp !! [s]
   real(wp), parameter :: bending_factors(*) = [1.0e-2_wp, 1.0_wp, 1.0e2_wp, 1.0e4_wp, 1.0e6_wp]
   real(wp), parameter :: damper_factors(*) = [1.0_wp, 1.0e3_wp, 1.0e5_wp]
   real(wp), parameter :: tolerances(*) = [1.0e-3_wp, 1.0e-4_wp, 1.0e-6_wp, 1.0e-8_wp]
   real(wp), parameter :: patience = 1.0_wp, patience_reference = 60.0_wp !! [s]
   integer, parameter :: n_chunks = 100
   !> Candidates: a method, and its highest order if not the usual one.
   character(len=8), parameter :: methods(*) = [character(len=8) :: 'dop853', 'gauss', 'bdf', 'bdf 2']

   !> One run.
   type :: run_record
      real(wp) :: values(15) = 0.0_wp
   end type run_record
   character(len=*), parameter :: names(15) = [character(len=16) :: 'n', 'bending_factor', 'damper_factor', 'method', 'rtol', &
      'seconds', 'error_phi', 'error_alpha_rate', 'n_steps', 'n_rhs', 'n_jac', 'finished', 'auto', 'effort', &
      'trial_effort']

   type(run_record), allocatable :: records(:)
   character(len=200) :: argument
   integer :: i, j, k, n

   allocate (records(0))
   do i = 2, command_argument_count()
      call get_command_argument(i, argument)
      read (argument, *) n
      do j = 1, size(bending_factors)
         do k = 1, size(damper_factors)
            call one_scene(n, bending_factors(j), damper_factors(k))
         end do
      end do
   end do
   call get_command_argument(1, argument)
   call write_file(trim(argument))

contains

   !> All methods and tolerances on one scene.
   subroutine one_scene(n, bending, damper)
      integer, intent(in) :: n
      real(wp), intent(in) :: bending, damper !! factors of EI and D of the article's table 1
      type(case_config) :: config
      type(method_choice) :: choice
      type(motion_type) :: motion
      type(scene_type) :: scene
      type(error_type), allocatable :: error
      type(run_record) :: one
      real(wp), allocatable :: reference(:), y(:)
      real(wp) :: scale_phi, scale_rate, reached, seconds
      type(solver_statistics) :: stats
      character(len=8) :: chosen
      integer :: i_method, i_tolerance

      call chain(config, n, bending, damper)
      call new_scene(scene, config, error)
      if (.not. allocated(error)) call new_motion(motion, scene, .false., error)
      if (allocated(error)) error stop error%message
      call motion%dynamics%set_regime(0.0_wp, t_end)
      call run(config, 'dop853', 1.0e-11_wp, patience_reference, reference, seconds, reached, stats)
      if (reached < t_end) then
         write (*, '(i6, 2es9.1, a)') n, bending, damper, ': no reference'
         return
      end if
      associate (f => scene%phi_at(), a => scene%n_q + scene%alpha_at())
         scale_phi = maxval(abs(reference(f + 1:f + n)))
         scale_rate = maxval(abs(reference(a + 1:a + n)))
         do i_tolerance = 1, size(tolerances)
            call choose_method(choice, options_for(tolerances(i_tolerance)), motion, spread(0.0_wp, 1, 2*scene%n_dof), &
                               0.0_wp, t_end, n_chunks, spread(.false., 1, size(candidates)), huge(1.0_wp))
            chosen = choice%method
            if (choice%options%order > 0) write (chosen, '(a, 1x, i0)') choice%method, choice%options%order
            do i_method = 1, size(methods)
               call run(config, trim(methods(i_method)), tolerances(i_tolerance), patience, y, seconds, reached, stats)
               one%values = [real(n, wp), bending, damper, real(i_method, wp), tolerances(i_tolerance), seconds*t_end/reached, &
                             maxval(abs(y(f + 1:f + n) - reference(f + 1:f + n)))/scale_phi, &
                             maxval(abs(y(a + 1:a + n) - reference(a + 1:a + n)))/scale_rate, &
                             real(stats%n_steps, wp), real(stats%n_rhs, wp), real(stats%n_jac, wp), reached/t_end, &
                             merge(1.0_wp, 0.0_wp, chosen == methods(i_method)), &
                             effort_of(trim(bare(methods(i_method))), motion%dynamics, stats), choice%effort]
               if (reached < t_end) one%values(7:8) = huge(1.0_wp)
               records = [records, one]
               write (*, '(i6, 2es9.1, 1x, a6, es9.1, f10.4, 2es10.2, 3i10, f6.3, l2, 2es9.1)') n, bending, damper, &
                  methods(i_method), tolerances(i_tolerance), one%values(6:8), stats%n_steps, stats%n_rhs, &
                  stats%n_jac, reached/t_end, chosen == methods(i_method), one%values(14:15)
            end do
         end do
      end associate
   end subroutine one_scene

   !> The article's table-1 chain with n rods.
   subroutine chain(c, n, bending, damper)
      type(case_config), intent(out) :: c
      integer, intent(in) :: n
      real(wp), intent(in) :: bending, damper

      call table1_chain(c, n)
      c%t_end = t_end
      c%chain%bending_stiffness = bending*c%chain%bending_stiffness
      c%chain%hinge_damping = damper*c%chain%hinge_damping
      c%loads = [load_config(component='M', value=1500.0_wp)]
   end subroutine chain

   !> From 0 to t_end, or as far as patience goes.
   subroutine run(config, method, tolerance, seconds_allowed, y, seconds, reached, stats)
      type(case_config), intent(in) :: config
      character(len=*), intent(in) :: method
      real(wp), intent(in) :: tolerance, seconds_allowed
      real(wp), allocatable, intent(out) :: y(:)
      real(wp), intent(out) :: seconds, reached
      type(solver_statistics), intent(out) :: stats
      type(motion_type), target :: motion
      type(scene_type) :: scene
      class(integrator_type), allocatable :: integrator
      type(error_type), allocatable :: error
      type(solver_options) :: options
      type(stopwatch) :: clock
      integer :: chunk

      call new_scene(scene, config, error)
      if (.not. allocated(error)) call new_motion(motion, scene, .false., error)
      if (allocated(error)) error stop error%message
      call motion%dynamics%set_regime(0.0_wp, t_end)
      call initial_state(motion, config%initial, y)
      options = options_for(tolerance)
      if (index(method, ' ') > 0) read (method(index(method, ' '):), *) options%order
      call new_integrator(integrator, motion, bare(method), options, error)
      if (allocated(error)) error stop error%message
      call integrator%set_stop(t_end)
      reached = 0.0_wp
      call clock%start()
      call integrator%start(0.0_wp, y, error)
      do chunk = 1, n_chunks
         if (allocated(error)) exit
         call integrator%advance(t_end*chunk/n_chunks, y, reached, error)
         seconds = clock%seconds()
         if (seconds > seconds_allowed) exit
      end do
      stats = integrator%statistics()
      reached = max(reached, tiny(1.0_wp))
      call integrator%finalize()
   end subroutine run

   pure type(solver_options) function options_for(tolerance)
      real(wp), intent(in) :: tolerance
      options_for%rtol = tolerance
      options_for%atol = 0.01_wp*tolerance
   end function options_for

   !> The method without its order.
   pure function bare(method)
      character(len=*), intent(in) :: method
      character(len=:), allocatable :: bare
      bare = trim(method)
      if (index(bare, ' ') > 0) bare = bare(:index(bare, ' ') - 1)
   end function bare

   !> One data set a column.
   subroutine write_file(path)
      character(len=*), intent(in) :: path
      type(hdf5_file) :: file
      type(error_type), allocatable :: error
      real(wp) :: column(size(records))
      character(len=:), allocatable :: list
      integer :: i, j

      list = ''
      do i = 1, size(methods)
         list = list//trim(methods(i))//','
      end do
      call file%create(path, error)
      if (allocated(error)) error stop error%message
      call file%put_attribute('/', 'methods', list(:len(list) - 1))
      call file%put_attribute('/', 'compiler_options', compiler_options())
      do i = 1, size(names)
         do j = 1, size(records)
            column(j) = records(j)%values(i)
         end do
         call file%write(trim(names(i)), column, 0)
      end do
      call file%close(error)
      if (allocated(error)) error stop error%message
   end subroutine write_file

end program bench_stiffness
