!> Work for the instruction counter: the same calls a given number of times, and nothing that depends on the clock.
!>
!>     tools/bench instructions KIND TIMES
!>
!> KIND is rhs, rhs_inextensible, rhs_rigid, rhs_lumped (rigid rods), rhs_quasistatic (lumped), rhs_condensed, lanes,
!> lanes_inextensible (eight right-hand sides), or run_dop853, run_gauss, run_adams, run_bdf (0.02 s of the article's table 1),
!> which print the number of their right-hand sides. The instructions of one are the difference between two TIMES
!> (`instructions/guard.py`).
program bench_instructions
   use rodyn_kinds, only: wp, i8
   use rodyn_errors, only: error_type
   use rodyn_case_config, only: case_config
   use rodyn_case_reader, only: read_case
   use rodyn_integrator, only: integrator_type, solver_options, solver_statistics
   use rodyn_integrators, only: new_integrator
   use rodyn_lanes, only: lanes
   use rodyn_lapack, only: use_one_thread
   use rodyn_motion, only: motion_type, new_motion, initial_state
   use rodyn_scene, only: scene_type, new_scene
   implicit none (type, external)

   character(len=32) :: kind, times_text
   type(motion_type), target :: motion
   real(wp), allocatable :: y(:)
   integer :: times, i
   integer(i8) :: n_rhs

   call use_one_thread()
   call get_command_argument(1, kind)
   call get_command_argument(2, times_text)
   read (times_text, *) times
   call prepare()
   if (kind(1:5) == 'lanes') then
      call evaluate_lanes()
   else if (kind(1:4) == 'run_') then
      n_rhs = 0
      do i = 1, times
         call run(trim(kind(5:)))
      end do
      print '(i0, a)', n_rhs, ' right-hand sides'
   else
      call evaluate()
   end if

contains

   subroutine prepare()
      type(case_config) :: config
      type(scene_type) :: scene
      type(error_type), allocatable :: error

      call read_case('cases/table1.nml', config, error=error)
      if (allocated(error)) error stop error%message
      config%model%formulation = merge('inextensible', 'consistent  ', index(kind, 'inextensible') > 0)
      if (kind == 'rhs_rigid' .or. kind == 'rhs_lumped') config%model%bending = 'rigid'
      if (kind == 'rhs_quasistatic' .or. index(kind, 'condensed') > 0) config%model%bending = 'quasistatic'
      if (kind == 'rhs_lumped' .or. kind == 'rhs_quasistatic') config%model%inertia = 'lumped'
      config%initial%phi = [0.1_wp, 0.2_wp, -0.1_wp, 0.3_wp]
      call new_scene(scene, config, error)
      if (.not. allocated(error)) call new_motion(motion, scene, .false., error)
      if (allocated(error)) error stop error%message
      call motion%dynamics%set_regime(0.0_wp, 1.0_wp)
      call initial_state(motion, config%initial, y)
   end subroutine prepare

   subroutine evaluate()
      real(wp) :: rate(size(y))
      logical :: ok
      integer :: j
      do j = 1, times
         call motion%rhs(0.3_wp, y, rate, ok)
         y(1) = 1.0e-12_wp*rate(size(rate))
      end do
   end subroutine evaluate

   subroutine evaluate_lanes()
      real(wp), dimension(lanes, motion%n_dof) :: q, p, acceleration
      real(wp) :: t(lanes)
      logical :: ok
      integer :: j
      t = 0.3_wp
      q = spread(y(:motion%n_dof), 1, lanes)
      p = spread(y(motion%n_dof + 1:2*motion%n_dof), 1, lanes)
      do j = 1, times
         call motion%lane_accelerations(t, q, p, acceleration, ok)
         p(1, 1) = 1.0e-12_wp*acceleration(1, 1)
      end do
   end subroutine evaluate_lanes

   subroutine run(method)
      character(len=*), intent(in) :: method
      class(integrator_type), allocatable :: integrator
      type(solver_options) :: options
      type(solver_statistics) :: stats
      type(error_type), allocatable :: error
      real(wp) :: final(size(y)), t

      options%rtol = 1.0e-8_wp
      options%atol = 1.0e-10_wp
      call new_integrator(integrator, motion, method, options, error)
      call integrator%set_stop(0.02_wp)
      call integrator%start(0.0_wp, y, error)
      if (.not. allocated(error)) call integrator%advance(0.02_wp, final, t, error)
      if (allocated(error)) error stop error%message
      stats = integrator%statistics()
      n_rhs = n_rhs + stats%n_rhs
      call integrator%finalize()
   end subroutine run

end program bench_instructions
