!> What leaving something out buys, and what it costs: time of runs with and without it, measured in turns, and the change of
!> the motion. The scene is the article's table 1, one second, all terms kept.
!>
!>     tools/bench skips
module rodyn_bench_wasteful
   use rodyn_kinds, only: wp
   use rodyn_motion, only: motion_type
   use rodyn_quadrature, only: gauss_rule, new_gauss_rule
   use rodyn_rod_constants, only: new_rod_constants
   implicit none (type, external)
   private
   public :: integrals_in_loop, fresh_jacobians

   !> Computes the rods' integrals at each right-hand side, as the article's program did.
   type, extends(motion_type) :: integrals_in_loop
      type(gauss_rule) :: rule
   contains
      procedure :: rhs => rhs_with_integrals
   end type integrals_in_loop

   !> Linearises whenever the implicit method asks for a matrix.
   type, extends(motion_type) :: fresh_jacobians
   contains
      procedure :: factorise_newton => factorise_fresh
   end type fresh_jacobians

contains

   subroutine rhs_with_integrals(self, t, y, ydot, ok)
      class(integrals_in_loop), intent(inout) :: self
      real(wp), intent(in) :: t
      real(wp), contiguous, intent(in) :: y(:)
      real(wp), contiguous, intent(out) :: ydot(:)
      logical, intent(out) :: ok
      integer :: k

      if (.not. allocated(self%rule%points)) call new_gauss_rule(self%rule, 4)
      associate (scene => self%dynamics%scene)
         do k = 1, scene%n
            associate (rod => scene%rods(scene%rod_of(k)))
               call new_rod_constants(rod, rod%length, rod%inertia%m0/rod%length, rod%bending_stiffness, self%rule, &
                                      .false., .true., .true., ok)
            end associate
         end do
      end associate
      call self%motion_type%rhs(t, y, ydot, ok)
   end subroutine rhs_with_integrals

   subroutine factorise_fresh(self, t, y, gamma, fresh, ok)
      class(fresh_jacobians), intent(inout) :: self
      real(wp), intent(in) :: t
      real(wp), contiguous, intent(in) :: y(:)
      real(wp), intent(in) :: gamma
      logical, intent(in) :: fresh
      logical, intent(out) :: ok
      associate (unused => fresh); end associate
      call self%motion_type%factorise_newton(t, y, gamma, .true., ok)
   end subroutine factorise_fresh

end module rodyn_bench_wasteful

program bench_skips
   use, intrinsic :: iso_fortran_env, only: compiler_options
   use rodyn_kinds, only: wp, i8
   use rodyn_errors, only: error_type
   use rodyn_bench_support, only: median, stopwatch
   use rodyn_bench_wasteful, only: integrals_in_loop, fresh_jacobians
   use rodyn_case_config, only: case_config, load_config
   use rodyn_case_reader, only: read_case
   use rodyn_integrator, only: integrator_type, solver_options, solver_statistics
   use rodyn_integrators, only: new_integrator
   use rodyn_lapack, only: use_one_thread
   use rodyn_motion, only: motion_type, new_motion, initial_state
   use rodyn_scene, only: scene_type, new_scene
   implicit none (type, external)

   integer, parameter :: n_rounds = 9, n_rods = 4
   real(wp), parameter :: t_end = 1.0_wp

   !> One way to run the scene.
   type :: subject
      class(motion_type), pointer :: motion => null()
      character(len=8) :: method = 'dop853'
      real(wp), allocatable :: y(:)
      integer :: n_outputs = 1
      integer(i8) :: n_rhs = 0
      real(wp) :: seconds(n_rounds) = 0.0_wp
      real(wp) :: phi(n_rods) = 0.0_wp          !! at the end [rad]
      real(wp) :: alpha_rate(n_rods) = 0.0_wp   !! [rad/s]
   end type subject

   type :: comparison
      character(len=72) :: name
      type(subject) :: with, without
   end type comparison

   type(comparison), allocatable :: all(:)
   type(case_config) :: base, other
   class(motion_type), pointer :: motion
   integer :: i, round

   call use_one_thread()
   allocate (all(0))
   base = article()

   other = base
   other%model%kernel = 'assembled'
   call compare('recursion instead of the assembled system (dop853)', subject_of(other), subject_of(base))
   allocate (integrals_in_loop :: motion)
   call compare('integrals once instead of in the loop (dop853)', subject_with(motion, base), subject_of(base))
   allocate (fresh_jacobians :: motion)
   call compare('linearisation kept instead of at every matrix (bdf)', subject_with(motion, base, 'bdf'), subject_of(base, 'bdf'))
   call compare('stiff modes solved implicitly: gauss instead of dop853', subject_of(base), subject_of(base, 'gauss'))
   other = base
   other%output%ledger = .true.
   call compare('no ledger (dop853)', subject_of(other), subject_of(base))
   call compare('no ledger (gauss)', subject_of(other, 'gauss'), subject_of(base, 'gauss'))
   call compare('one output instead of 1000 (dop853)', subject_of(base, n_outputs=1000), subject_of(base))
   call compare('one output instead of 1000 (gauss)', subject_of(base, 'gauss', n_outputs=1000), subject_of(base, 'gauss'))
   other = base
   other%chain%hinge_damping = 0.0_wp
   call compare('no dampers (dop853)', subject_of(base), subject_of(other))
   other = base
   deallocate (other%loads)
   allocate (other%loads(0))
   call compare('no loads (dop853)', subject_of(base), subject_of(other))
   other = base
   other%spacecraft%motion = 'fixed'
   deallocate (other%loads)
   allocate (other%loads(1))
   other%loads(1) = load_config(target='node', node=4, component='Y', value=100.0_wp)
   base%loads = other%loads
   call compare('fixed spacecraft, force on node 4 (dop853)', subject_of(base), subject_of(other))
   base = article()
   other = base
   other%model%formulation = 'paper'
   call compare('inertia of second order in the deflection: paper (dop853)', subject_of(base), subject_of(other))
   other = base
   other%model%inertia = 'lumped'
   other%model%bending = 'quasistatic'
   call compare('rods without inertia: lumped, quasistatic (dop853)', subject_of(base), subject_of(other))
   other = base
   other%model%bending = 'rigid'
   call compare('bending: rigid (dop853)', subject_of(base), subject_of(other))
   other%model%inertia = 'lumped'
   call compare('bending and inertia of rods: lumped, rigid (dop853)', subject_of(base), subject_of(other))

   do round = 0, n_rounds
      do i = 1, size(all)
         call run(all(i)%with, round)
         call run(all(i)%without, round)
      end do
   end do
   write (*, '(2a)') 'compiler options: ', compiler_options()
   write (*, '(a)') '| left out | time without/with | ms with | ms without | right-hand sides | change of phi [rad] | '// &
      'of alpha'' [rad/s] |'
   write (*, '(a)') '|---|---:|---:|---:|---:|---:|---:|'
   do i = 1, size(all)
      associate (a => all(i)%with, b => all(i)%without)
         write (*, '(3a, f0.3, 2(a, f0.2), a, i0, a, i0, 2(a, es7.1), a)') '| ', trim(all(i)%name), ' | ', &
            median(b%seconds/a%seconds), ' | ', 1.0e3_wp*median(a%seconds), ' | ', 1.0e3_wp*median(b%seconds), ' | ', a%n_rhs, &
            ' to ', b%n_rhs, ' | ', maxval(abs(a%phi - b%phi)), ' | ', maxval(abs(a%alpha_rate - b%alpha_rate)), ' |'
      end associate
   end do

contains

   function article() result(c)
      type(case_config) :: c
      type(error_type), allocatable :: error
      call read_case('cases/table1.nml', c, error=error)
      if (allocated(error)) error stop error%message
      c%model%formulation = 'consistent'
      c%output%ledger = .false.
   end function article

   subroutine compare(name, with, without)
      character(len=*), intent(in) :: name
      type(subject), intent(in) :: with, without
      type(comparison), allocatable :: longer(:)
      integer :: n
      n = size(all)
      allocate (longer(n + 1))
      longer(:n) = all
      longer(n + 1)%name = name
      longer(n + 1)%with = with
      longer(n + 1)%without = without
      call move_alloc(longer, all)
   end subroutine compare

   function subject_of(c, method, n_outputs) result(item)
      type(case_config), intent(in) :: c
      character(len=*), intent(in), optional :: method
      integer, intent(in), optional :: n_outputs
      type(subject) :: item
      class(motion_type), pointer :: plain
      allocate (motion_type :: plain)
      item = subject_with(plain, c, method)
      if (present(n_outputs)) item%n_outputs = n_outputs
   end function subject_of

   function subject_with(some_motion, c, method) result(item)
      class(motion_type), pointer, intent(in) :: some_motion
      type(case_config), intent(in) :: c
      character(len=*), intent(in), optional :: method
      type(subject) :: item
      type(scene_type) :: scene
      type(motion_type) :: made
      type(error_type), allocatable :: error

      call new_scene(scene, c, error)
      if (.not. allocated(error)) call new_motion(made, scene, c%output%ledger, error)
      if (allocated(error)) error stop error%message
      select type (some_motion)
      type is (integrals_in_loop)
         some_motion%motion_type = made
      type is (fresh_jacobians)
         some_motion%motion_type = made
      type is (motion_type)
         some_motion = made
      end select
      item%motion => some_motion
      if (present(method)) item%method = method
      call initial_state(made, c%initial, item%y)
   end function subject_with

   !> One run; round 0 warms up.
   subroutine run(item, slot)
      type(subject), intent(inout) :: item
      integer, intent(in) :: slot
      class(integrator_type), allocatable :: integrator
      type(solver_options) :: options
      type(solver_statistics) :: stats
      type(error_type), allocatable :: error
      real(wp) :: y(size(item%y)), t
      type(stopwatch) :: clock
      real(wp) :: seconds
      integer :: j

      options%rtol = 1.0e-8_wp
      options%atol = 1.0e-10_wp
      call item%motion%dynamics%set_regime(0.0_wp, t_end)
      call clock%start()
      call new_integrator(integrator, item%motion, trim(item%method), options, error)
      if (allocated(error)) error stop error%message
      call integrator%set_stop(t_end)
      call integrator%start(0.0_wp, item%y, error)
      do j = 1, item%n_outputs
         if (.not. allocated(error)) call integrator%advance(t_end*j/item%n_outputs, y, t, error)
      end do
      seconds = clock%seconds()
      if (allocated(error)) error stop error%message
      stats = integrator%statistics()
      item%n_rhs = stats%n_rhs
      call integrator%finalize()
      associate (scene => item%motion%dynamics%scene, n_q => item%motion%n_q)
         item%phi = y(scene%phi_at() + 1:scene%phi_at() + scene%n)
         if (scene%dynamic_bending) item%alpha_rate = y(n_q + scene%alpha_at() + 1:n_q + scene%alpha_at() + scene%n)
      end associate
      if (slot > 0) item%seconds(slot) = seconds
   end subroutine run

end program bench_skips
