!> Eight scenes in vector lanes against one at a time: time of a right-hand side, and of whole cases of a sweep.
!> All figures of one run are measured in turns and ratios formed round by round, so that they hold on a noisy machine.
!>
!>     tools/bench lanes
module rodyn_lanes_bench
   use rodyn_kinds, only: wp, i8
   use rodyn_errors, only: error_type
   use rodyn_bench_support, only: median, set_in_motion, stopwatch, table1_chain
   use rodyn_case_config, only: case_config
   use rodyn_lanes, only: lanes
   use rodyn_scene, only: scene_type, new_scene
   use rodyn_motion, only: motion_type, new_motion, initial_state
   use rodyn_case_config, only: load_config
   use rodyn_ensemble, only: ensemble_client, ensemble_member, run_ensemble
   use rodyn_integrator, only: integrator_type, solver_options
   use rodyn_integrators, only: new_integrator
   use rodyn_simulation, only: observer_type, listed_times, simulate
   implicit none (type, external)
   private
   public :: kernels, cases, peak

   integer, parameter :: n_rounds = 31
   integer, parameter :: n_cases = 64
   integer, parameter :: case_rounds = 7
   integer, parameter :: n_streams = 10, stream_length = 20000 !! of multiply-adds, none of which waits for another

   !> One measured scene.
   type :: subject
      character(len=32) :: name
      type(motion_type) :: motion
      real(wp), allocatable :: y(:), q(:, :), p(:, :)
      integer :: repeats = 0
      real(wp), allocatable :: one(:), many(:) !! per right-hand side (and lane), one a round [ns]
   end type subject

   !> A case of a sweep in a lane.
   type, extends(ensemble_member) :: numbered
      integer :: number = 0
   end type numbered

   !> Cases of a sweep over the mass of the nodes.
   type, extends(ensemble_client) :: sweep_client
      integer :: next = 0
      type(solver_options) :: options
      real(wp) :: phi(n_cases) = 0.0_wp !! of the last rod, at the end
      integer(i8) :: n_rhs = 0
   contains
      procedure :: take
      procedure :: observe
      procedure :: finish
   end type sweep_client

   !> Keeps nothing.
   type, extends(observer_type) :: nobody
   contains
      procedure :: observe => look_away
   end type nobody

   integer, parameter :: chain_sizes(*) = [4, 16, 64]
   character(len=*), parameter :: kinds(*) = [character(len=24) :: 'dynamic', 'dynamic, inextensible', 'rigid', 'rigid, lumped', &
      'quasistatic, lumped', 'quasistatic']

contains

   !> Cases per second: table 1 for 1 s with 64 masses of the nodes, in lanes and one by one.
   subroutine cases()
      character(len=*), parameter :: methods(*) = [character(len=8) :: 'lanes', 'dop853', 'gauss']
      real(wp), parameter :: rtols(*) = [1.0e-6_wp, 1.0e-9_wp]
      real(wp) :: seconds(case_rounds, size(methods)), phi(n_cases, size(methods)), exact(n_cases)
      integer(i8) :: n_rhs(size(methods))
      integer :: i, j, round

      call by_one('dop853', solver_options(rtol=1.0e-12_wp, atol=1.0e-14_wp), exact, n_rhs(1), seconds(1, 1))
      write (*, '(/, a8, a10, 5a14)') 'rtol', 'method', 'cases/s', 'per dop853', 'error phi_4', 'rhs/case', 'ns/rhs'
      do j = 1, size(rtols)
         associate (options => solver_options(rtol=rtols(j), atol=0.01_wp*rtols(j)))
            do round = 1, case_rounds
               call by_lanes(options, phi(:, 1), n_rhs(1), seconds(round, 1))
               call by_one('dop853', options, phi(:, 2), n_rhs(2), seconds(round, 2))
               call by_one('gauss', options, phi(:, 3), n_rhs(3), seconds(round, 3))
            end do
         end associate
         do i = 1, size(methods)
            write (*, '(es8.0, a10, f14.1, f14.2, es14.1, i14, f14.1)') rtols(j), methods(i), n_cases/median(seconds(:, i)), &
               median(seconds(:, 2)/seconds(:, i)), maxval(abs(phi(:, i) - exact)), n_rhs(i)/n_cases, &
               1.0e9_wp*median(seconds(:, i))/n_rhs(i)
         end do
      end do
   end subroutine cases

   !> Case i of the sweep.
   function swept(i) result(c)
      integer, intent(in) :: i
      type(case_config) :: c

      c = standard(4, 'dynamic')
      c%t_end = 1.0_wp
      c%chain%hinge_stiffness(0) = 6000.0_wp
      c%chain%hinge_damping(0) = 0.02_wp
      c%chain%node_mass = 0.4_wp + 0.2_wp*real(i, wp)/n_cases
      c%initial%phi = 0.0_wp
      c%initial%phi_rate = 0.0_wp
      c%initial%omega = 0.0_wp
      deallocate (c%loads)
      allocate (c%loads(3))
      c%loads(1) = load_config(component='X', value=500.0_wp)
      c%loads(2) = load_config(component='Y', value=500.0_wp)
      c%loads(3) = load_config(component='M', value=1500.0_wp)
   end function swept

   subroutine by_lanes(options, phi, n_rhs, seconds)
      type(solver_options), intent(in) :: options
      real(wp), intent(out) :: phi(n_cases), seconds
      integer(i8), intent(out) :: n_rhs
      type(sweep_client) :: client
      type(stopwatch) :: clock

      client%options = options
      call clock%start()
      call run_ensemble(client)
      seconds = clock%seconds()
      phi = client%phi
      n_rhs = client%n_rhs
   end subroutine by_lanes

   subroutine by_one(method, options, phi, n_rhs, seconds)
      character(len=*), intent(in) :: method
      type(solver_options), intent(in) :: options
      real(wp), intent(out) :: phi(n_cases), seconds
      integer(i8), intent(out) :: n_rhs
      type(motion_type), target :: motion
      class(integrator_type), allocatable :: integrator
      type(scene_type) :: scene
      type(error_type), allocatable :: error
      type(nobody) :: observer
      real(wp), allocatable :: y(:)
      real(wp) :: t
      type(stopwatch) :: clock
      integer :: i

      n_rhs = 0
      call clock%start()
      do i = 1, n_cases
         call new_scene(scene, swept(i), error)
         if (.not. allocated(error)) call new_motion(motion, scene, .false., error)
         if (.not. allocated(error)) call new_integrator(integrator, motion, method, options, error)
         if (allocated(error)) error stop error%message
         allocate (y(motion%n_states), source=0.0_wp)
         call simulate(motion, integrator, listed_times([1.0_wp]), 1.0_wp, observer, y, t, error)
         if (allocated(error)) error stop error%message
         phi(i) = y(7)
         associate (counts => integrator%statistics())
            n_rhs = n_rhs + counts%n_rhs
         end associate
         call integrator%finalize()
         deallocate (y, integrator)
      end do
      seconds = clock%seconds()
   end subroutine by_one

   subroutine take(self, member)
      class(sweep_client), intent(inout) :: self
      class(ensemble_member), pointer, intent(out) :: member
      type(numbered), pointer :: mine
      type(scene_type) :: scene
      type(error_type), allocatable :: error

      nullify (member)
      if (self%next == n_cases) return
      self%next = self%next + 1
      allocate (mine)
      mine%number = self%next
      call new_scene(scene, swept(mine%number), error)
      if (.not. allocated(error)) call new_motion(mine%motion, scene, .false., error)
      if (allocated(error)) error stop error%message
      allocate (mine%y(mine%motion%n_states), source=0.0_wp)
      mine%times = [1.0_wp]
      mine%t_end = 1.0_wp
      mine%options = self%options
      member => mine
   end subroutine take

   subroutine observe(self, member, t, y, error)
      class(sweep_client), intent(inout) :: self
      class(ensemble_member), intent(inout) :: member
      real(wp), intent(in) :: t, y(:)
      type(error_type), allocatable, intent(out) :: error
      associate (unused => t, unused_error => error); end associate
      select type (member)
      type is (numbered)
         self%phi(member%number) = y(7)
      end select
   end subroutine observe

   subroutine finish(self, member)
      class(sweep_client), intent(inout) :: self
      class(ensemble_member), pointer, intent(inout) :: member
      if (allocated(member%error)) error stop member%error%message
      self%n_rhs = self%n_rhs + member%counts%n_rhs
      deallocate (member)
   end subroutine finish

   subroutine look_away(self, motion, t, y, error)
      class(nobody), intent(inout) :: self
      type(motion_type), intent(inout) :: motion
      real(wp), intent(in) :: t, y(:)
      type(error_type), allocatable, intent(out) :: error
      associate (unused => self, unused_motion => motion, unused_t => t, unused_y => y, unused_error => error); end associate
   end subroutine look_away

   !> The most that lanes can bring where both sides are bound by arithmetic: multiply-adds, a number or a vector at a time.
   subroutine peak()
      real(wp) :: x(n_streams), y(lanes, n_streams), one(n_rounds), many(n_rounds)
      type(stopwatch) :: clock
      real(wp) :: seconds
      integer :: round

      call random_number(x)
      call random_number(y)
      do round = 1, n_rounds
         call clock%start()
         call stream_numbers(x)
         seconds = clock%seconds()
         one(round) = 1.0e9_wp*seconds/(n_streams*stream_length)
         call clock%start()
         call stream_vectors(y)
         seconds = clock%seconds()
         many(round) = 1.0e9_wp*seconds/(n_streams*stream_length*lanes)
      end do
      if (any(x > 2.0_wp) .or. any(y > 2.0_wp)) error stop 'multiply-adds went wrong'
      write (*, '(/, a, 2(f7.4, a), f5.2)') 'multiply-add: ', median(one), ' ns, in lanes ', median(many), ' ns, ratio ', &
         median(one/many)
   end subroutine peak

   !> x = a x + b in each stream; scalars by name, since compilers make vectors of arrays.
   subroutine stream_numbers(x)
      real(wp), intent(inout) :: x(n_streams)
      real(wp), parameter :: a = 0.5_wp, b = 0.3_wp
      real(wp) :: x1, x2, x3, x4, x5, x6, x7, x8, x9, x10
      integer :: i

      x1 = x(1)
      x2 = x(4)
      x3 = x(7)
      x4 = x(10)
      x5 = x(3)
      x6 = x(6)
      x7 = x(9)
      x8 = x(2)
      x9 = x(5)
      x10 = x(8)
      do i = 1, stream_length
         x1 = a*x1 + b
         x2 = a*x2 + b
         x3 = a*x3 + b
         x4 = a*x4 + b
         x5 = a*x5 + b
         x6 = a*x6 + b
         x7 = a*x7 + b
         x8 = a*x8 + b
         x9 = a*x9 + b
         x10 = a*x10 + b
      end do
      x(1) = 0.1_wp*(x1 + x2 + x3 + x4 + x5 + x6 + x7 + x8 + x9 + x10)
   end subroutine stream_numbers

   !> The same in all lanes.
   subroutine stream_vectors(x)
      real(wp), intent(inout) :: x(lanes, n_streams)
      real(wp), parameter :: a = 0.5_wp, b = 0.3_wp
      real(wp), dimension(lanes) :: x1, x2, x3, x4, x5, x6, x7, x8, x9, x10
      integer :: i, l

      x1 = x(:, 1)
      x2 = x(:, 4)
      x3 = x(:, 7)
      x4 = x(:, 10)
      x5 = x(:, 3)
      x6 = x(:, 6)
      x7 = x(:, 9)
      x8 = x(:, 2)
      x9 = x(:, 5)
      x10 = x(:, 8)
      do i = 1, stream_length
         !$omp simd
         do l = 1, lanes
            x1(l) = a*x1(l) + b
            x2(l) = a*x2(l) + b
            x3(l) = a*x3(l) + b
            x4(l) = a*x4(l) + b
            x5(l) = a*x5(l) + b
            x6(l) = a*x6(l) + b
            x7(l) = a*x7(l) + b
            x8(l) = a*x8(l) + b
            x9(l) = a*x9(l) + b
            x10(l) = a*x10(l) + b
         end do
      end do
      x(:, 1) = 0.1_wp*(x1 + x2 + x3 + x4 + x5 + x6 + x7 + x8 + x9 + x10)
   end subroutine stream_vectors

   !> Time of a right-hand side.
   subroutine kernels()
      type(subject), allocatable :: subjects(:)
      integer :: i, j, round

      allocate (subjects(size(kinds)*size(chain_sizes)))
      do i = 1, size(kinds)
         do j = 1, size(chain_sizes)
            call set_up(subjects(size(chain_sizes)*(i - 1) + j), trim(kinds(i)), chain_sizes(j))
         end do
      end do
      do round = 0, n_rounds
         do i = 1, size(subjects)
            call measure_one(subjects(i), round)
            call measure_many(subjects(i), round)
         end do
      end do
      write (*, '(a32, a6, 3a14)') 'scene', 'n', 'one [ns]', 'lane [ns]', 'ratio'
      do i = 1, size(subjects)
         associate (s => subjects(i))
            write (*, '(a32, i6, 2f14.1, f14.2)') s%name, s%motion%dynamics%scene%n, median(s%one), median(s%many), &
               median(s%one/s%many)
         end associate
      end do
   end subroutine kernels

   !> The article's table-1 scene with n rods in motion, without loads.
   function standard(n, kind) result(c)
      integer, intent(in) :: n
      character(len=*), intent(in) :: kind
      type(case_config) :: c

      call table1_chain(c, n)
      call set_in_motion(c)
      c%model%bending = kind
      if (index(kind, ',') > 0) then
         c%model%bending = kind(:index(kind, ',') - 1)
         if (index(kind, 'lumped') > 0) c%model%inertia = 'lumped'
         if (index(kind, 'inextensible') > 0) c%model%formulation = 'inextensible'
      end if
   end function standard

   subroutine set_up(item, kind, n)
      type(subject), intent(out) :: item
      character(len=*), intent(in) :: kind
      integer, intent(in) :: n
      type(case_config) :: c
      type(scene_type) :: scene
      type(error_type), allocatable :: error

      c = standard(n, kind)
      item%name = kind
      call new_scene(scene, c, error)
      if (.not. allocated(error)) call new_motion(item%motion, scene, .false., error)
      if (allocated(error)) error stop error%message
      call item%motion%dynamics%set_regime(0.0_wp, 1.0_wp)
      call initial_state(item%motion, c%initial, item%y)
      item%q = spread(item%y(:scene%n_dof), 1, lanes)
      item%p = spread(item%y(scene%n_dof + 1:), 1, lanes)
      item%repeats = max(3, 40000/n)
      allocate (item%one(n_rounds), item%many(n_rounds))
   end subroutine set_up

   !> Calls in sequence, each starting from a state that depends on the call before (as in an integrator).
   subroutine measure_one(item, slot)
      type(subject), intent(inout) :: item
      integer, intent(in) :: slot !! 0: warm up
      real(wp) :: y(size(item%y)), ydot(size(item%y))
      type(stopwatch) :: clock
      real(wp) :: seconds
      integer :: j
      logical :: ok

      y = item%y
      call clock%start()
      do j = 1, item%repeats
         call item%motion%rhs(0.3_wp, y, ydot, ok)
         y(1) = item%y(1) + 1.0e-12_wp*ydot(size(ydot))
      end do
      seconds = clock%seconds()
      if (.not. ok) error stop 'right-hand side failed'
      if (slot > 0) item%one(slot) = 1.0e9_wp*seconds/item%repeats
   end subroutine measure_one

   subroutine measure_many(item, slot)
      type(subject), intent(inout) :: item
      integer, intent(in) :: slot !! 0: warm up
      real(wp) :: q(size(item%q, 1), size(item%q, 2)), a(size(item%q, 1), size(item%q, 2)), t(lanes)
      type(stopwatch) :: clock
      real(wp) :: seconds
      integer :: j
      logical :: ok

      q = item%q
      t = 0.3_wp
      call clock%start()
      do j = 1, item%repeats/2
         call item%motion%lane_accelerations(t, q, item%p, a, ok)
         q(:, 1) = item%q(:, 1) + 1.0e-12_wp*a(:, size(a, 2))
      end do
      seconds = clock%seconds()
      if (.not. ok) error stop 'right-hand side failed'
      if (slot > 0) item%many(slot) = 1.0e9_wp*seconds/(item%repeats/2)/lanes
   end subroutine measure_many

end module rodyn_lanes_bench

program bench_lanes
   use, intrinsic :: iso_fortran_env, only: compiler_options
   use rodyn_lanes_bench, only: kernels, cases, peak
   implicit none (type, external)
   write (*, '(2a)') 'compiler options: ', compiler_options()
   call kernels()
   call cases()
   call peak()
end program bench_lanes
