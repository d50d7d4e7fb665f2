!> Time of the parts of a BDF step over the number of rods: right-hand side, Newton matrix (linearised and factored,
!> or factored anew with another step), solution, the same with a dense Jacobian, and whole steps of CVODE. The parts of
!> one chain are measured in turns.
!>
!>     tools/bench newton
program bench_newton
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type
   use rodyn_bench_support, only: median, set_in_motion, stopwatch, table1_chain
   use rodyn_case_config, only: case_config
   use rodyn_scene, only: scene_type, new_scene
   use rodyn_motion, only: motion_type, new_motion, initial_state
   use rodyn_dense_newton, only: dense_newton
   use rodyn_integrator, only: integrator_type, solver_options, solver_statistics
   use rodyn_integrators, only: new_integrator
   implicit none (type, external)

   integer, parameter :: chain_sizes(*) = [1, 2, 4, 8, 16, 64, 256, 1024, 4096, 10000]
   integer, parameter :: largest_dense = 64, n_rounds = 7, n_parts = 6
   character(len=*), parameter :: bending(*) = [character(len=11) :: 'dynamic', 'rigid', 'quasistatic']
   integer :: i, j

   do j = 1, size(bending)
      write (*, '(a)') trim(bending(j))//': microseconds; and steps of CVODE per rod'
      write (*, '(a6, 10a10)') 'rods', 'rhs', 'fresh', 'refactor', 'solve', 'd.fresh', 'd.solve', 'step', 'step/rod', 'rhs/step', &
         'jac/step'
      do i = 1, size(chain_sizes)
         call measure_chain(chain_sizes(i), trim(bending(j)))
      end do
   end do

contains

   !> A chain of n rods, hinges damped a little, in a curved shape.
   subroutine chain(motion, y, n, kind)
      type(motion_type), intent(out) :: motion
      real(wp), allocatable, intent(out) :: y(:)
      integer, intent(in) :: n
      character(len=*), intent(in) :: kind
      type(case_config) :: c
      type(scene_type) :: scene
      type(error_type), allocatable :: error

      call table1_chain(c, n)
      call set_in_motion(c)
      c%initial%omega = 0.0_wp
      c%chain%hinge_damping = 10.0_wp
      c%model%bending = kind
      if (kind == 'quasistatic') c%model%inertia = 'lumped'
      call new_scene(scene, c, error)
      if (allocated(error)) error stop error%message
      call new_motion(motion, scene, .false., error)
      if (allocated(error)) error stop error%message
      call motion%dynamics%set_regime(0.0_wp, 1.0e3_wp)
      call initial_state(motion, c%initial, y)
   end subroutine chain

   subroutine measure_chain(n, kind)
      integer, intent(in) :: n
      character(len=*), intent(in) :: kind
      type(motion_type), target :: motion
      type(dense_newton) :: dense
      real(wp), allocatable :: y(:), right(:)
      real(wp) :: time(n_parts, n_rounds), per_step, rhs_per_step, jac_per_step
      integer :: round, part

      call chain(motion, y, n, kind)
      right = [(real(mod(part, 7), wp) - 3.0_wp, part=1, size(y))]
      time = 0.0_wp
      do round = 1, n_rounds
         do part = 1, merge(6, 4, n <= largest_dense)
            time(part, round) = timed(motion, dense, y, right, part, &
                                      merge(max(2, 20000/n), max(2, 20000/n**2), part <= 4))
         end do
      end do
      call whole_steps(motion, y, per_step, rhs_per_step, jac_per_step)
      write (*, '(i6, 7f10.2, 3f10.3)') n, (1.0e6_wp*median(time(part, :)), part=1, n_parts), 1.0e6_wp*per_step, &
         1.0e6_wp*per_step/n, rhs_per_step, jac_per_step

   end subroutine measure_chain

   !> Seconds a call of one part.
   real(wp) function timed(motion, dense, y, right, which, repeats)
      type(motion_type), intent(inout) :: motion
      type(dense_newton), intent(inout) :: dense
      real(wp), intent(in) :: y(:), right(:)
      integer, intent(in) :: which, repeats
      real(wp) :: x(size(y))
      type(stopwatch) :: clock
      integer :: j
      logical :: ok

      x = right
      if (which == 5) call dense%reserve(size(y))
      call clock%start()
      do j = 1, repeats
         select case (which)
         case (1)
            call motion%rhs(0.0_wp, y, x, ok)
         case (2)
            call motion%factorise_newton(0.0_wp, y, 1.0e-3_wp, .true., ok)
         case (3)
            call motion%factorise_newton(0.0_wp, y, 1.0e-3_wp, .false., ok)
         case (4)
            call motion%solve_newton(x)
         case (5)
            call motion%jacobian(0.0_wp, y, dense%jacobian, ok)
            call dense%factorise(1.0e-3_wp, ok)
         case default
            call dense%solve(x)
         end select
      end do
      timed = clock%seconds()/repeats
   end function timed

   !> Some hundred steps of CVODE.
   subroutine whole_steps(motion, y, per_step, rhs_per_step, jac_per_step)
      type(motion_type), target, intent(inout) :: motion
      real(wp), intent(in) :: y(:)
      real(wp), intent(out) :: per_step, rhs_per_step, jac_per_step
      class(integrator_type), allocatable :: integrator
      type(error_type), allocatable :: error
      type(solver_options) :: options
      type(solver_statistics) :: stats
      real(wp) :: state(size(y)), t
      type(stopwatch) :: clock

      options%rtol = 1.0e-6_wp
      options%atol = 1.0e-8_wp
      options%max_steps = 300
      call new_integrator(integrator, motion, 'bdf', options, error)
      if (allocated(error)) error stop error%message
      call integrator%set_stop(1.0e3_wp)
      call clock%start()
      call integrator%start(0.0_wp, y, error)
      call integrator%advance(1.0e3_wp, state, t, error) ! ends with max_steps
      per_step = clock%seconds()
      stats = integrator%statistics()
      per_step = per_step/real(stats%n_steps, wp)
      rhs_per_step = real(stats%n_rhs, wp)/real(stats%n_steps, wp)
      jac_per_step = real(stats%n_jac, wp)/real(stats%n_steps, wp)
      call integrator%finalize()
   end subroutine whole_steps

end program bench_newton
