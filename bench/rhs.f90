!> Time of one right-hand side: recursive against assembled, against n, and what a scene without some feature
!> saves. All figures of one run are measured in turns and ratios formed round by round, so that they hold on a
!> noisy machine.
!>
!>     tools/bench rhs
program bench_rhs
   use, intrinsic :: iso_fortran_env, only: compiler_options
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type
   use rodyn_bench_support, only: median, set_in_motion, stopwatch, table1_chain
   use rodyn_case_config, only: case_config, hinge_config, kink_config, load_config
   use rodyn_scene, only: scene_type, new_scene
   use rodyn_motion, only: motion_type, new_motion, initial_state
   implicit none (type, external)

   !> One measured scene.
   type :: subject
      character(len=44) :: name
      type(motion_type) :: motion
      real(wp), allocatable :: y(:)
      integer :: repeats = 0
      real(wp), allocatable :: nanoseconds(:) !! per call, one a round
   end type subject

   integer, parameter :: n_rounds = 31
   integer, parameter :: chain_sizes(*) = [1, 4, 8, 16, 64, 256, 1024, 4096, 10000]
   type(subject), allocatable :: subjects(:)
   type(case_config) :: config
   integer :: i, round

   allocate (subjects(32))
   i = 0
   call add('n = 4, consistent, recursive', standard(4))
   config = standard(4)
   config%model%kernel = 'assembled'
   call add('n = 4, consistent, assembled', config)
   config = standard(4)
   config%model%formulation = 'inextensible'
   call add('n = 4, inextensible, recursive', config)
   config = standard(4)
   config%model%formulation = 'paper'
   call add('n = 4, paper', config)
   config = standard(4)
   config%chain%hinge_damping = 0.0_wp
   call add('n = 4, no dampers', config)
   config = standard(4)
   config%chain%kink = 0.1_wp
   call add('n = 4, kinks', config)
   config = standard(4)
   config%loads = [load_config(component='M', value=1500.0_wp)]
   call add('n = 4, moment on the spacecraft', config)
   config = standard(4)
   config%loads = [load_config(target='node', node=4, component='Y', value=10.0_wp)]
   call add('n = 4, constant force on a node', config)
   config%loads(1)%law = 'sine_squared'
   config%loads(1)%rate = 1.0_wp
   call add('n = 4, varying force on a node', config)
   config = standard(4)
   config%spacecraft%motion = 'fixed'
   config%initial%omega = 0.0_wp
   call add('n = 4, fixed spacecraft', config)
   config = standard(4)
   call add('n = 4, with ledger', config, ledger=.true.)
   config%model%bending = 'rigid'
   call add('n = 4, rigid rods', config)
   config%model%inertia = 'lumped'
   call add('n = 4, rigid rods, lumped', config)
   config%model%bending = 'quasistatic'
   call add('n = 4, quasistatic, lumped', config)
   config%model%inertia = 'distributed'
   call add('n = 4, condensed', config)
   call add('n = 4, hinge 2 locked', standard(4), locked=[3])
   call add('n = 4, rigid rods, hinge 2 locked', rigid(4), locked=[3])
   call add('n = 1024, every other hinge locked', standard(1024), locked=[(round, round=1, 1024, 2)])
   config = standard(4)
   config%kink_programs = [kink_config(hinge=2, law='sine', value=0.1_wp, rate=2.0_wp, t_end=1.0_wp)]
   call add('n = 4, one kink driven', config)
   call add('n = 4, one kink driven, with ledger', config, ledger=.true.)
   deallocate (config%kink_programs)
   config%hinges = [hinge_config(hinge=1, freeplay=1.0e-3_wp), &
                    hinge_config(hinge=2, lower_stop=-1.0_wp, upper_stop=1.0_wp, stop_stiffness=1.0e4_wp), &
                    hinge_config(hinge=3, friction_moment=1.0_wp, friction_velocity=0.01_wp)]
   call add('n = 4, freeplay, stops, friction', config)
   call add('n = 4, the same, with ledger', config, ledger=.true.)
   config = standard(4)
   config%initial%phi_rate = 0.0_wp ! what is held must not turn
   config%hinges = [hinge_config(hinge=2, held=.true.)]
   call add('n = 4, hinge 2 held by &hinge', config)
   do round = 1, size(chain_sizes)
      call add('', standard(chain_sizes(round)))
      write (subjects(i)%name, '("chain of ", i0)') chain_sizes(round)
   end do

   do round = 0, n_rounds
      do i = 1, size(subjects)
         call measure(subjects(i), round)
      end do
   end do

   write (*, '(2a)') 'compiler options: ', compiler_options()
   write (*, '(a44, 3a12)') 'scene', 'ns/call', 'ns/rod', 'ratio'
   do i = 1, size(subjects)
      associate (time => median(subjects(i)%nanoseconds), n => subjects(i)%motion%dynamics%scene%n)
         write (*, '(a44, 2f12.1, f12.2)') subjects(i)%name, time, time/n, &
            median(subjects(i)%nanoseconds/subjects(1)%nanoseconds) ! round by round: the machine's speed drifts
      end associate
   end do

contains

   !> The article's table-1 scene with n rods in motion, without loads.
   function standard(n) result(c)
      integer, intent(in) :: n
      type(case_config) :: c
      call table1_chain(c, n)
      call set_in_motion(c)
   end function standard

   !> The same with rods that do not bend.
   function rigid(n) result(c)
      integer, intent(in) :: n
      type(case_config) :: c
      c = standard(n)
      c%model%bending = 'rigid'
   end function rigid

   subroutine add(name, c, ledger, locked)
      character(len=*), intent(in) :: name
      type(case_config), intent(in) :: c
      logical, intent(in), optional :: ledger
      integer, intent(in), optional :: locked(:) !! rods whose inner hinges are locked
      logical :: locks(c%chain%n_rods)
      type(scene_type) :: scene
      type(error_type), allocatable :: error
      logical :: with_ledger

      with_ledger = .false.
      if (present(ledger)) with_ledger = ledger
      i = i + 1
      subjects(i)%name = name
      call new_scene(scene, c, error)
      if (allocated(error)) error stop error%message
      call new_motion(subjects(i)%motion, scene, with_ledger, error)
      if (allocated(error)) error stop error%message
      call initial_state(subjects(i)%motion, c%initial, subjects(i)%y)
      call subjects(i)%motion%begin_regime(0.0_wp, 1.0_wp, 1.0_wp, subjects(i)%y, error)
      if (allocated(error)) error stop error%message
      if (present(locked)) then
         locks = .false.
         locks(locked) = .true.
         call subjects(i)%motion%dynamics%set_locked(locks, spread(0.0_wp, 1, size(locks)))
      end if
      subjects(i)%repeats = max(3, 20000/c%chain%n_rods/merge(10, 1, c%model%kernel == 'assembled'))
      allocate (subjects(i)%nanoseconds(n_rounds))
   end subroutine add

   !> Calls in sequence, each starting from a state that depends on the call before (as in an integrator).
   subroutine measure(item, slot)
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
      if (slot > 0) item%nanoseconds(slot) = 1.0e9_wp*seconds/item%repeats
   end subroutine measure

end program bench_rhs
