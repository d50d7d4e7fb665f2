!> Random cases of every kind, the same on every machine.
module test_random_scenes
   use rodyn_kinds, only: wp, i8
   use rodyn_case_config, only: case_config, load_config
   implicit none (type, external)
   private
   public :: random_case, seed_random, uniform, kind_name, n_kinds, n_all_kinds, allocate_case

   integer, parameter :: n_kinds = 22 !! 7 models on a free and on a fixed spacecraft, 4 with a third bending shape, 4 inextensible
   integer, parameter :: n_all_kinds = n_kinds + 2 !! and condensed rods, which do not take hinges that change their stiffness
   integer, parameter :: with_two_shapes = 14, with_chords = 18
   integer(i8), parameter :: lehmer_modulus = 2147483647_i8

contains

   !> Start the sequence of random numbers anew.
   subroutine seed_random(seed)
      integer, intent(in) :: seed
      integer(i8) :: first
      first = draw(1_i8 + modulo(7919_i8*seed, lehmer_modulus - 1_i8))
   end subroutine seed_random

   !> Uniform in [low, high].
   real(wp) function uniform(low, high)
      real(wp), intent(in) :: low, high
      real(wp) :: coarse, fine
      coarse = real(draw(), wp)
      fine = real(draw(), wp)
      uniform = low + (high - low)*(coarse + fine/lehmer_modulus)/lehmer_modulus
   end function uniform

   !> The next number of the generator of Park and Miller (Comm. ACM 31, 1988, 1192), with the multiplier of their revision: the
   !> same with every compiler, as RANDOM_NUMBER is not.
   integer(i8) function draw(seed)
      integer(i8), intent(in), optional :: seed !! instead of the last number
      integer(i8), save :: state = 1_i8
      if (present(seed)) state = seed
      state = modulo(48271_i8*state, lehmer_modulus)
      draw = state
   end function draw

   !> Name of a kind of scene, for messages.
   function kind_name(which) result(name)
      integer, intent(in) :: which
      character(len=:), allocatable :: name
      type(case_config) :: config
      call set_kind(config, which)
      name = trim(config%model%formulation)//' '//trim(config%model%inertia)//' '// &
             trim(config%model%bending)//' '//trim(config%model%dampers)//' '//trim(config%spacecraft%motion)
      if (config%model%bending_shapes == 3) name = name//' with bubbles'
   end function kind_name

   !> Choose the model: 1..n_all_kinds.
   subroutine set_kind(config, which)
      type(case_config), intent(inout) :: config
      integer, intent(in) :: which
      config%model%formulation = 'consistent'
      if (which > n_kinds) then
         config%spacecraft%motion = merge('free ', 'fixed', which == n_kinds + 1)
         config%model%formulation = 'consistent'
         config%model%bending = 'quasistatic'
         return
      end if
      if (which > with_chords) then
         config%spacecraft%motion = merge('free ', 'fixed', which <= with_chords + 2)
         config%model%formulation = 'inextensible'
         config%model%bending_shapes = 2 + mod(which, 2)
         config%model%gauss_points = 5
         return
      end if
      if (which > with_two_shapes) then
         config%spacecraft%motion = merge('free ', 'fixed', which <= with_two_shapes + 2)
         config%model%formulation = merge('consistent', 'paper     ', mod(which, 2) == 1)
         config%model%bending_shapes = 3
         config%model%gauss_points = 5
         return
      end if
      config%spacecraft%motion = merge('free ', 'fixed', which <= with_two_shapes/2)
      select case (mod(which - 1, with_two_shapes/2))
      case (0)
         config%model%formulation = 'consistent'
      case (1)
         config%model%formulation = 'paper'
      case (2)
         config%model%bending = 'rigid'
      case (3)
         config%model%bending = 'rigid'
         config%model%formulation = 'paper'
      case (4)
         config%model%inertia = 'lumped'
         config%model%bending = 'rigid'
      case (5)
         config%model%inertia = 'lumped'
         config%model%bending = 'quasistatic'
      case default
         config%model%inertia = 'lumped'
         config%model%bending = 'quasistatic'
         config%model%dampers = 'exact'
      end select
   end subroutine set_kind

   !> Arrays of a case with n rods, zero where zero is a sensible default. Chords keep their length.
   subroutine allocate_case(config, n)
      type(case_config), intent(inout) :: config
      integer, intent(in) :: n
      config%chain%n_rods = n
      config%model%formulation = 'consistent'
      allocate (config%chain%length(n), config%chain%mass_per_length(n), config%chain%bending_stiffness(n), &
                config%chain%node_mass(n), config%chain%hinge_stiffness(0:n - 1), config%chain%hinge_damping(0:n - 1), &
                config%chain%kink(0:n - 1), config%initial%phi(n), config%initial%alpha(n), config%initial%beta(n), &
                config%initial%phi_rate(n), config%initial%alpha_rate(n), config%initial%beta_rate(n), &
                config%initial%bubble(n), config%initial%bubble_rate(n), source=0.0_wp)
      allocate (config%loads(0))
      config%title = ''
   end subroutine allocate_case

   !> A random case of kind 1..n_all_kinds: all rods, nodes and hinges different, loads, damping and kinks or not.
   subroutine random_case(config, which, n)
      type(case_config), intent(out) :: config
      integer, intent(in) :: which, n
      integer :: k

      call allocate_case(config, n)
      call set_kind(config, which)
      config%spacecraft%mass = uniform(1.0_wp, 200.0_wp)
      config%spacecraft%inertia = uniform(0.5_wp, 50.0_wp)
      config%spacecraft%hinge_x = uniform(-1.0_wp, 1.0_wp)
      config%spacecraft%hinge_y = uniform(-1.0_wp, 1.0_wp)
      do k = 1, n
         config%chain%length(k) = uniform(0.3_wp, 2.0_wp)
         config%chain%mass_per_length(k) = uniform(0.2_wp, 3.0_wp)
         config%chain%bending_stiffness(k) = 10.0_wp**uniform(2.0_wp, 4.0_wp)
         config%chain%node_mass(k) = max(0.0_wp, uniform(-1.0_wp, 2.0_wp))
         config%chain%hinge_stiffness(k - 1) = max(0.0_wp, uniform(-500.0_wp, 5000.0_wp))
         if (mod(which + n, 2) == 0) config%chain%hinge_damping(k - 1) = max(0.0_wp, uniform(-0.5_wp, 2.0_wp))
         if (mod(n, 3) == 0) config%chain%kink(k - 1) = uniform(-0.5_wp, 0.5_wp)
      end do
      if (n > 1) config%chain%length(2) = config%chain%length(1) ! not quite distinct rods
      if (mod(n, 4) >= 2) call vary_rods(config, n)
      call random_initial(config, n)
      if (which > with_chords) then ! slopes that the model is made for: their second powers count
         config%initial%alpha = 0.3_wp*config%initial%alpha
         config%initial%beta = 0.3_wp*config%initial%beta
         if (allocated(config%initial%bubble)) config%initial%bubble = 0.3_wp*config%initial%bubble
      end if
      call random_loads(config, n)
   end subroutine random_case

   !> Some rods of a random case vary along their length: by polynomials and by tables with a jump.
   subroutine vary_rods(config, n)
      type(case_config), intent(inout) :: config
      integer, intent(in) :: n
      integer :: i

      allocate (config%profiles(4))
      config%profiles%first_rod = [1, 1, max(1, n/2), n]
      config%profiles%last_rod = [1, n, n, n]
      config%profiles%quantity = 'mass_per_length'
      config%profiles(2:3)%quantity = 'bending_stiffness'
      config%profiles(1)%polynomial = [1.0_wp, -1.2_wp, 0.7_wp]
      config%profiles(2)%polynomial = [1.5_wp, -0.5_wp]
      do i = 3, 4
         config%profiles(i)%positions = [0.0_wp, 0.3_wp, 0.3_wp, 1.0_wp]
         config%profiles(i)%values = [1.2_wp, 1.0_wp, 1.5_wp, 1.4_wp]
      end do
   end subroutine vary_rods

   subroutine random_initial(config, n)
      type(case_config), intent(inout) :: config
      integer, intent(in) :: n
      real(wp) :: slope
      integer :: k

      slope = 0.1_wp
      if (config%model%bending_shapes == 3) slope = 0.01_wp ! the mass matrix of `paper` bears less with three shapes
      do k = 1, n
         config%initial%phi(k) = uniform(-4.0_wp, 4.0_wp)
         config%initial%phi_rate(k) = uniform(-5.0_wp, 5.0_wp)
         if (config%model%bending /= 'dynamic') cycle
         config%initial%alpha(k) = slope*uniform(-1.0_wp, 1.0_wp)
         config%initial%beta(k) = slope*uniform(-1.0_wp, 1.0_wp)
         config%initial%alpha_rate(k) = uniform(-5.0_wp, 5.0_wp)
         config%initial%beta_rate(k) = uniform(-5.0_wp, 5.0_wp)
         if (config%model%bending_shapes == 2) cycle
         config%initial%bubble(k) = uniform(-5.0e-4_wp, 5.0e-4_wp)
         config%initial%bubble_rate(k) = uniform(-0.5_wp, 0.5_wp)
      end do
      if (config%spacecraft%motion == 'fixed') return
      config%initial%velocity_x = uniform(-2.0_wp, 2.0_wp)
      config%initial%velocity_y = uniform(-2.0_wp, 2.0_wp)
      config%initial%omega = uniform(-3.0_wp, 3.0_wp)
      config%initial%displacement_x = uniform(-1.0_wp, 1.0_wp)
      config%initial%displacement_y = uniform(-1.0_wp, 1.0_wp)
      config%initial%rotation = uniform(-3.0_wp, 3.0_wp)
   end subroutine random_initial

   !> A moment and forces on the spacecraft, and forces on two nodes.
   subroutine random_loads(config, n)
      type(case_config), intent(inout) :: config
      integer, intent(in) :: n
      type(load_config) :: load
      integer :: i

      deallocate (config%loads)
      allocate (config%loads(5))
      do i = 1, 5
         load%law = merge('constant    ', 'sine_squared', mod(i, 2) == 0)
         load%rate = uniform(0.5_wp, 3.0_wp)
         if (load%law == 'constant') load%rate = 0.0_wp
         load%value = uniform(-500.0_wp, 500.0_wp)
         load%component = merge('X', 'Y', i <= 2)
         load%target = merge('spacecraft', 'node      ', i <= 3)
         if (i == 3) load%component = 'M'
         load%node = 0
         if (i > 3) load%node = 1 + int(uniform(0.0_wp, real(n, wp)))
         if (i == 5) load%component = 'X'
         load%node = min(load%node, n)
         config%loads(i) = load
      end do
   end subroutine random_loads

end module test_random_scenes
