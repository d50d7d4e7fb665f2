!> The compiled scene: everything about a case that does not change while it runs.
!>
!> `new_scene` turns a case into constants that the kernels read: integrals once per distinct rod, what may be
!> skipped, and where each unknown stands. Coordinates and rates are vectors in the article's order,
!>     q = (u_x, u_y, theta, phi, alpha, beta),   p = (Vx, Vy, w, phi', alpha', beta'),
!> without the first three on a fixed spacecraft and without the last two groups unless bending is dynamic. A third bending
!> shape adds the bubbles behind beta.
module rodyn_scene
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type, raise, exit_bad_input
   use rodyn_case_check, only: sound_case
   use rodyn_case_config, only: case_config
   use rodyn_quadrature, only: gauss_rule, new_gauss_rule
   use rodyn_rod_constants, only: rod_constants, new_rod_constants
   use rodyn_bending_matrices, only: bending_matrices, new_bending_matrices, most_shapes
   use rodyn_rod_profile, only: rod_profile, new_rod_profile
   use rodyn_spacecraft, only: spacecraft_body
   use rodyn_hinge_law, only: hinge_law, new_hinge_law
   use rodyn_loads, only: load_set, new_load_set
   use rodyn_kink_program, only: kink_set, new_kink_set
   use rodyn_sorting, only: sorted_order
   use rodyn_time_law, only: law_times
   use rodyn_switch_times, only: add_switches, same_time, united_time
   implicit none (type, external)
   private
   public :: scene_type, new_scene, compile_scene

   !> A compiled case.
   type :: scene_type
      integer :: n = 0       !! rods
      integer :: n_base = 3  !! unknowns of the spacecraft: 3, or 0 when it is fixed
      integer :: n_dof = 0   !! length of p
      integer :: n_q = 0     !! length of q: n_dof, and the rotations of relaxing hinges behind (`rodyn_hinge_law`)
      integer :: n_bend = 2  !! bending coordinates of a rod: 0, 2 (alpha, beta) or 3 (and the bubble)
      logical :: dynamic_bending = .true. !! n_bend > 0: alpha and beta are unknowns
      logical :: quasistatic = .false.    !! alpha and beta follow from the hinge moments
      logical :: lumped = .false.         !! all mass in the nodes
      logical :: condensed = .false.      !! quasistatic and not lumped: rods have mass where they bend without inertia of their own
      logical :: consistent = .true.      !! second-order inertia terms kept
      logical :: inextensible = .false.   !! rods that bend as motion keep their arc, not their chord
      logical :: assembled = .false.      !! kernel: assembled instead of recursive
      type(spacecraft_body) :: body
      real(wp), allocatable :: node_mass(:)    !! (0:n) [kg]; node 0 and the halves of rods only when lumped
      type(rod_constants), allocatable :: rods(:) !! the distinct rods
      type(bending_matrices), allocatable :: bending(:) !! their matrices over the bending coordinates
      integer, allocatable :: rod_of(:)        !! which of them is rod k (1:n)
      type(hinge_law) :: hinges                !! laws as a run finds them; those of the moment are the motion's
      type(load_set) :: loads
      type(kink_set) :: kinks
      real(wp), allocatable :: switches(:)     !! times within the run where a force, kink or lock is not smooth, increasing [s]
   contains
      procedure :: phi_at
      procedure :: alpha_at
      procedure :: beta_at
      procedure :: bend_at
      procedure :: bends
      procedure :: chord
      procedure :: chord_rate
      procedure :: rod
   end type scene_type

contains

   !> Index in q or p before the chord angles: phi_k stands at phi_at() + k.
   elemental integer function phi_at(self)
      class(scene_type), intent(in) :: self
      phi_at = self%n_base
   end function phi_at

   !> Index in q or p before the inner slopes.
   elemental integer function alpha_at(self)
      class(scene_type), intent(in) :: self
      alpha_at = self%n_base + self%n
   end function alpha_at

   !> Index in q or p before the outer slopes.
   elemental integer function beta_at(self)
      class(scene_type), intent(in) :: self
      beta_at = self%n_base + 2*self%n
   end function beta_at

   !> Index in q or p before bending coordinate i: alpha, beta, bubble.
   elemental integer function bend_at(self, i)
      class(scene_type), intent(in) :: self
      integer, intent(in) :: i
      bend_at = self%n_base + i*self%n
   end function bend_at

   !> Bending coordinates of rod k (or their rates, or accelerations), zeros behind the last.
   pure function bends(self, k, q) result(x)
      class(scene_type), intent(in) :: self
      integer, intent(in) :: k
      real(wp), intent(in) :: q(:) !! (n_q) or (n_dof)
      real(wp) :: x(most_shapes)
      integer :: i

      x = 0.0_wp
      do i = 1, self%n_bend
         x(i) = q(self%n_base + i*self%n + k)
      end do
   end function bends

   !> Chord of rod k [m]: its length, less the foreshortening of a bent `inextensible` one.
   pure real(wp) function chord(self, k, q)
      class(scene_type), intent(in) :: self
      integer, intent(in) :: k
      real(wp), intent(in) :: q(:) !! (n_q) or (n_dof)
      real(wp) :: x(most_shapes)

      chord = self%rods(self%rod_of(k))%length
      if (.not. self%inextensible) return
      x = self%bends(k, q)
      chord = chord - 0.5_wp*dot_product(x, matmul(self%bending(self%rod_of(k))%shortening, x))
   end function chord

   !> Rate of the chord [m/s].
   pure real(wp) function chord_rate(self, k, q, p)
      class(scene_type), intent(in) :: self
      integer, intent(in) :: k
      real(wp), intent(in) :: q(:), p(:)

      chord_rate = 0.0_wp
      if (self%inextensible) chord_rate = &
         -dot_product(self%bends(k, q), matmul(self%bending(self%rod_of(k))%shortening, self%bends(k, p)))
   end function chord_rate

   !> Constants of rod k.
   elemental function rod(self, k)
      class(scene_type), intent(in) :: self
      integer, intent(in) :: k
      type(rod_constants) :: rod
      rod = self%rods(self%rod_of(k))
   end function rod

   !> Compile a case. Fails, exit code 2, with all faults that `rodyn check` would find in it, in the same words.
   subroutine new_scene(scene, given, error)
      type(scene_type), intent(out) :: scene
      type(case_config), intent(in) :: given
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config !! with what is not given

      call sound_case(given, config, error)
      if (.not. allocated(error)) call compile_scene(scene, config, error)
   end subroutine new_scene

   !> The same of a case that is complete and was found sound, by `sound_case` or as it was read.
   subroutine compile_scene(scene, config, error)
      type(scene_type), intent(out) :: scene
      type(case_config), intent(in) :: config
      type(error_type), allocatable, intent(out) :: error
      integer :: k

      scene%n = config%chain%n_rods
      scene%n_base = merge(0, 3, config%spacecraft%motion == 'fixed')
      scene%dynamic_bending = config%model%bending == 'dynamic'
      scene%quasistatic = config%model%bending == 'quasistatic'
      scene%lumped = config%model%inertia == 'lumped'
      scene%condensed = scene%quasistatic .and. .not. scene%lumped
      scene%consistent = config%model%formulation /= 'paper'
      scene%inextensible = config%model%formulation == 'inextensible' .and. scene%dynamic_bending
      scene%assembled = config%model%kernel == 'assembled'
      scene%n_bend = merge(config%model%bending_shapes, 0, scene%dynamic_bending)
      scene%n_dof = scene%n_base + (1 + scene%n_bend)*scene%n
      associate (craft => config%spacecraft)
         scene%body = spacecraft_body(craft%mass, craft%inertia, craft%hinge_x, craft%hinge_y)
      end associate
      call compile_rods(scene, config, error)
      if (allocated(error)) return
      call compile_nodes(scene, config)
      call new_kink_set(scene%kinks, config%chain%kink, config%kink_programs)
      call new_hinge_law(scene%hinges, config%chain, reshape([(scene%rods(scene%rod_of(k))%flexibility, k=1, scene%n)], &
                                                             [3, scene%n]), scene%quasistatic, config%model%dampers == 'exact', &
                         size(scene%kinks%programs) > 0, config%hinges)
      if (scene%hinges%curved .and. (scene%quasistatic .or. scene%assembled)) then
         call raise(error, "&hinge: a curved law needs kernel = 'recursive' and bending = 'dynamic' or 'rigid'", exit_bad_input)
         return
      end if
      scene%n_q = scene%n_dof + size(scene%hinges%relaxing)
      call new_load_set(scene%loads, config%loads)
      call collect_switches(scene, config%t_end)
   end subroutine compile_scene

   !> Switches of loads, kinks and releases. What is released at a switch is released then, to the last digit.
   subroutine collect_switches(scene, t_end)
      type(scene_type), intent(inout) :: scene
      real(wp), intent(in) :: t_end !! [s]
      real(wp), allocatable :: times(:)
      integer :: i

      associate (mechanisms => scene%hinges%mechanisms)
         times = [law_times(scene%loads%loads%law), law_times(scene%kinks%programs%law), mechanisms%release_time]
         allocate (scene%switches(0))
         call add_switches(scene%switches, pack(times, times > 0.0_wp .and. times < t_end .and. .not. same_time(times, t_end)))
         do i = 1, size(mechanisms)
            mechanisms(i)%release_time = united_time(mechanisms(i)%release_time, scene%switches)
         end do
      end associate
   end subroutine collect_switches

   !> Integrals and derived constants, once per distinct (length, mass per length, stiffness, profiles).
   subroutine compile_rods(scene, config, error)
      type(scene_type), intent(inout) :: scene
      type(case_config), intent(in) :: config
      type(error_type), allocatable, intent(out) :: error
      type(gauss_rule) :: rule
      type(rod_constants), allocatable :: rods(:)
      type(rod_profile), allocatable :: profiles(:)
      integer, allocatable :: first(:), profile_of(:, :)
      character(len=12) :: number
      logical :: ok
      integer :: j, n_distinct

      call find_profiles(config, profiles, profile_of)
      call find_distinct(config, profile_of, scene%rod_of, first)
      n_distinct = size(first)
      call new_gauss_rule(rule, config%model%gauss_points)
      allocate (rods(n_distinct), scene%bending(n_distinct))
      do j = 1, n_distinct
         associate (k => first(j), chain => config%chain)
            call new_rod_constants(rods(j), chain%length(k), chain%mass_per_length(k), stiffness_of(k), rule, &
                                   scene%lumped, scene%dynamic_bending, scene%consistent, ok, profiles(profile_of(1, k)), &
                                   profiles(profile_of(2, k)), scene%inextensible)
            if (.not. ok) then
               write (number, '(i0)') k
               call raise(error, '&chain: rod '//trim(number)//' has no bending inertia or stiffness: dynamic bending needs '// &
                          'mass_per_length > 0, bending_stiffness > 0, gauss_points >= 2, and m l^3 that is a number', &
                          exit_bad_input)
               return
            end if
            scene%bending(j) = new_bending_matrices(rods(j), merge(2, scene%n_bend, scene%condensed), scene%consistent)
         end associate
      end do
      call move_alloc(rods, scene%rods)

   contains

      real(wp) function stiffness_of(k)
         integer, intent(in) :: k
         stiffness_of = 0.0_wp
         if (config%model%bending /= 'rigid') stiffness_of = config%chain%bending_stiffness(k)
      end function stiffness_of

   end subroutine compile_rods

   !> The distinct profiles, the first of them uniform, and which of them each rod has: for its mass per length in row 1,
   !> for its bending stiffness in row 2. Where several are given for a rod, the last one counts.
   subroutine find_profiles(config, profiles, profile_of)
      type(case_config), intent(in) :: config
      type(rod_profile), allocatable, intent(out) :: profiles(:)
      integer, allocatable, intent(out) :: profile_of(:, :) !! (2, n)
      type(rod_profile), allocatable :: found(:)
      integer :: i, j, n_found, n_given

      n_given = 0
      if (allocated(config%profiles)) n_given = size(config%profiles)
      allocate (found(n_given + 1))
      allocate (profile_of(2, config%chain%n_rods), source=1)
      n_found = 1
      do i = 1, n_given
         associate (given => config%profiles(i))
            call new_rod_profile(found(n_found + 1), given)
            do j = 1, n_found
               if (found(j)%equals(found(n_found + 1))) exit
            end do
            n_found = max(n_found, j)
            if (given%quantity == 'mass_per_length') then
               profile_of(1, given%first_rod:min(config%chain%n_rods, given%last_rod)) = j
            else if (config%model%bending /= 'rigid') then
               profile_of(2, given%first_rod:min(config%chain%n_rods, given%last_rod)) = j
            end if
         end associate
      end do
      profiles = found(:n_found)
   end subroutine find_profiles

   !> Number the distinct rods: `rod_of(k)` is the number of rod k, `first(j)` one rod of number j.
   !> A sort by value keeps this O(n log n) when all rods differ.
   subroutine find_distinct(config, profile_of, rod_of, first)
      type(case_config), intent(in) :: config
      integer, intent(in) :: profile_of(:, :)        !! (2, n)
      integer, allocatable, intent(out) :: rod_of(:) !! (n)
      integer, allocatable, intent(out) :: first(:)  !! (number of distinct rods)
      integer, allocatable :: order(:)
      real(wp), allocatable :: key(:, :)
      integer :: i, n, n_distinct

      n = config%chain%n_rods
      allocate (key(5, n), source=0.0_wp)
      key(1, :) = config%chain%length
      key(2, :) = config%chain%mass_per_length
      if (config%model%bending /= 'rigid') key(3, :) = config%chain%bending_stiffness
      key(4:5, :) = profile_of
      order = sorted_order(key)
      allocate (rod_of(n), first(n))
      n_distinct = 0
      do i = 1, n
         if (i == 1) then
            n_distinct = 1
         else if (any(key(:, order(i)) /= key(:, order(i - 1)))) then
            n_distinct = n_distinct + 1
         end if
         rod_of(order(i)) = n_distinct
         first(n_distinct) = order(i)
      end do
      first = first(:n_distinct)
   end subroutine find_distinct

   !> Node masses, with the mass of each rod shared by its two nodes when lumped. No rod and its node are both without mass
   !> (`rodyn_case_rules`), so every apparent mass that the recursion divides by is positive.
   subroutine compile_nodes(scene, config)
      type(scene_type), intent(inout) :: scene
      type(case_config), intent(in) :: config
      integer :: k

      allocate (scene%node_mass(0:scene%n), source=0.0_wp)
      scene%node_mass(1:) = config%chain%node_mass
      if (scene%lumped) then
         do k = 1, scene%n
            associate (share => scene%rods(scene%rod_of(k))%share)
               scene%node_mass(k - 1:k) = scene%node_mass(k - 1:k) + share
            end associate
         end do
      end if
   end subroutine compile_nodes

end module rodyn_scene
