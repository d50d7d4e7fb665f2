!> Eight scenes in vector lanes against one at a time: time of a right-hand side, and of whole cases of a sweep.
!> All figures of one run are measured in turns and ratios formed round by round, so that they hold on a noisy machine.
!>
!>     OPENBLAS_NUM_THREADS=1 fpm run --example bench_lanes --flag "$(tools/flags release)"   (with FPM_FC=mpifort)
program bench_lanes
   use, intrinsic :: iso_fortran_env, only: compiler_options
   use rodyn_kinds, only: wp, i8
   use rodyn_errors, only: error_type
   use rodyn_case_config, only: case_config
   use rodyn_lanes, only: lanes
   use rodyn_scene, only: scene_type, new_scene
   use rodyn_motion, only: motion_type, new_motion, initial_state
   implicit none (type, external)

   !> One measured scene.
   type :: subject
      character(len=32) :: name
      type(motion_type) :: motion
      real(wp), allocatable :: y(:), q(:, :), p(:, :)
      integer :: repeats = 0
      real(wp), allocatable :: one(:), many(:) !! per right-hand side (and lane), one a round [ns]
   end type subject

   integer, parameter :: n_rounds = 31
   integer, parameter :: chain_sizes(*) = [4, 16, 64]
   character(len=*), parameter :: kinds(*) = [character(len=24) :: 'dynamic', 'rigid', 'rigid, lumped', 'quasistatic, lumped']

   write (*, '(2a)') 'compiler options: ', compiler_options()
   call kernels()

contains

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

   !> The article's table-1 scene with n rods, without loads.
   function standard(n, kind) result(c)
      integer, intent(in) :: n
      character(len=*), intent(in) :: kind
      type(case_config) :: c
      integer :: k

      c%title = ''
      c%spacecraft%mass = 122.5_wp
      c%spacecraft%inertia = 122.5_wp*0.98_wp/12.0_wp
      c%spacecraft%hinge_x = 0.35_wp
      c%spacecraft%hinge_y = 0.35_wp
      c%chain%n_rods = n
      allocate (c%chain%length(n), source=1.5_wp)
      allocate (c%chain%mass_per_length(n), source=1.6964600329384882_wp)
      allocate (c%chain%bending_stiffness(n), source=13744.467859455345_wp)
      allocate (c%chain%node_mass(n), source=0.5_wp)
      allocate (c%chain%hinge_stiffness(0:n - 1), source=4000.0_wp)
      allocate (c%chain%hinge_damping(0:n - 1), source=0.01_wp)
      allocate (c%chain%kink(0:n - 1), source=0.0_wp)
      allocate (c%initial%alpha(n), c%initial%beta(n), c%initial%alpha_rate(n), c%initial%beta_rate(n), source=0.0_wp)
      c%initial%phi = [(0.1_wp*sin(0.7_wp*k), k=1, n)]
      c%initial%phi_rate = [(0.1_wp*cos(0.7_wp*k), k=1, n)]
      c%initial%omega = 0.3_wp
      c%model%bending = kind
      if (index(kind, ',') > 0) then
         c%model%bending = kind(:index(kind, ',') - 1)
         c%model%inertia = 'lumped'
      end if
      allocate (c%loads(0))
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
      integer(i8) :: start, finish, rate
      integer :: j
      logical :: ok

      y = item%y
      call system_clock(start, rate)
      do j = 1, item%repeats
         call item%motion%rhs(0.3_wp, y, ydot, ok)
         y(1) = item%y(1) + 1.0e-12_wp*ydot(size(ydot))
      end do
      call system_clock(finish)
      if (.not. ok) error stop 'right-hand side failed'
      if (slot > 0) item%one(slot) = 1.0e9_wp*real(finish - start, wp)/real(rate, wp)/item%repeats
   end subroutine measure_one

   subroutine measure_many(item, slot)
      type(subject), intent(inout) :: item
      integer, intent(in) :: slot !! 0: warm up
      real(wp) :: q(size(item%q, 1), size(item%q, 2)), a(size(item%q, 1), size(item%q, 2)), t(lanes)
      integer(i8) :: start, finish, rate
      integer :: j
      logical :: ok

      q = item%q
      t = 0.3_wp
      call system_clock(start, rate)
      do j = 1, item%repeats/2
         call item%motion%lane_accelerations(t, q, item%p, a, ok)
         q(:, 1) = item%q(:, 1) + 1.0e-12_wp*a(:, size(a, 2))
      end do
      call system_clock(finish)
      if (.not. ok) error stop 'right-hand side failed'
      if (slot > 0) item%many(slot) = 1.0e9_wp*real(finish - start, wp)/real(rate, wp)/(item%repeats/2)/lanes
   end subroutine measure_many

   real(wp) function median(x)
      real(wp), intent(in) :: x(:)
      real(wp) :: sorted(size(x)), swap
      integer :: a, b
      sorted = x
      do a = 2, size(x)
         do b = a, 2, -1
            if (sorted(b) >= sorted(b - 1)) exit
            swap = sorted(b)
            sorted(b) = sorted(b - 1)
            sorted(b - 1) = swap
         end do
      end do
      median = sorted((size(x) + 1)/2)
   end function median

end program bench_lanes
