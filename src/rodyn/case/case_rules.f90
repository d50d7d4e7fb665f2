!> Rules that tie several keys of a case together. What one key alone must keep stands in the table.
module rodyn_case_rules
   use rodyn_kinds, only: wp
   use rodyn_case_config, only: case_config, load_config, none_given, profile_config
   use rodyn_key_checker, only: key_checker, no_such
   use rodyn_hinge_rules, only: check_moving_hinges
   use rodyn_methods, only: list_of_methods, method_named, method_type, methods, order_rule
   use rodyn_law_rules, only: check_law
   use rodyn_rod_profile, only: rod_profile, new_rod_profile, smallest_value
   use rodyn_text, only: short_text, to_text
   use rodyn_time_law, only: moves_smoothly
   implicit none (type, external)
   private
   public :: check_case, is_condensed

contains

   !> Note everything that is wrong with the case as a whole.
   subroutine check_case(checker, config)
      class(key_checker), intent(inout) :: checker
      type(case_config), intent(in) :: config !! its lists are allocated
      integer :: i

      call check_spacecraft(checker, config)
      call check_model(checker, config)
      call check_bending(checker, config)
      call check_chords(checker, config)
      call check_masses(checker, config)
      call check_solver(checker, config)
      do i = 1, size(config%profiles)
         call check_profile_rods(checker, i, config%profiles(i), config%chain%n_rods)
         call check_profile(checker, i, config%profiles(i), config%model%bending == 'quasistatic')
      end do
      do i = 1, size(config%loads)
         call check_target(checker, i, config%loads(i), config%chain%n_rods)
         call check_law(checker, 'load', i, config%loads(i)%law, config%loads(i), of_motion=.false.)
      end do
      call check_moving_hinges(checker, config)
   end subroutine check_case

   !> A free spacecraft has mass and inertia; a fixed one does not move.
   subroutine check_spacecraft(checker, config)
      class(key_checker), intent(inout) :: checker
      type(case_config), intent(in) :: config

      if (.not. checker%is_sound('spacecraft', 1, 'motion')) return
      if (config%spacecraft%motion == 'free') then
         call checker%require('spacecraft', 1, 'mass', "when motion = 'free'")
         call checker%require('spacecraft', 1, 'inertia', "when motion = 'free'")
         return
      end if
      call require_zero('velocity_x', config%initial%velocity_x)
      call require_zero('velocity_y', config%initial%velocity_y)
      call require_zero('omega', config%initial%omega)
      call require_zero('displacement_x', config%initial%displacement_x)
      call require_zero('displacement_y', config%initial%displacement_y)
      call require_zero('rotation', config%initial%rotation)

   contains

      subroutine require_zero(key, x)
         character(len=*), intent(in) :: key
         real(wp), intent(in) :: x
         if (abs(x) > 0.0_wp) call checker%report('initial', 1, key, "must be 0 when motion = 'fixed'")
      end subroutine require_zero

   end subroutine check_spacecraft

   !> docs/model.md sec. 5: which bending goes with which inertia.
   subroutine check_model(checker, config)
      class(key_checker), intent(inout) :: checker
      type(case_config), intent(in) :: config
      character(len=:), allocatable :: key

      if (.not. (checker%is_sound('model', 1, 'bending') .and. checker%is_sound('model', 1, 'inertia'))) return
      key = 'bending'
      if (.not. checker%is_given('model', 1, key)) key = 'inertia'
      if (config%model%bending == 'dynamic' .and. config%model%inertia == 'lumped') then
         call checker%report('model', 1, key, "bending = 'dynamic' is not possible with inertia = 'lumped'; " &
            //"take 'quasistatic' or 'rigid'")
      else if (is_condensed(config)) then
         call check_condensed(checker, config)
      end if
      if (.not. checker%is_sound('model', 1, 'bending_shapes') .or. config%model%bending_shapes /= 3) return
      if (config%model%bending /= 'dynamic') then
         call checker%report('model', 1, 'bending_shapes', "3 is possible with bending = 'dynamic' only")
      else if (checker%is_sound('model', 1, 'gauss_points') .and. config%model%gauss_points < 5) then
         call checker%report('model', 1, 'bending_shapes', &
                    '3 needs gauss_points = 5 or more (the square of the third shape has degree 8)')
      end if
   end subroutine check_model

   !> Rods with mass that bend by statics?
   pure logical function is_condensed(config)
      type(case_config), intent(in) :: config
      is_condensed = config%model%bending == 'quasistatic' .and. config%model%inertia == 'distributed'
   end function is_condensed

   !> Their rates follow the openings by a constant matrix: no damper has a state of its own, no spring changes its stiffness and
   !> no kink its rate in no time.
   subroutine check_condensed(checker, config)
      class(key_checker), intent(inout) :: checker
      type(case_config), intent(in) :: config
      character(len=*), parameter :: not_here = "is not possible with bending = 'quasistatic' and inertia = 'distributed'"
      integer :: i

      if (config%model%formulation == 'inextensible') &
         call checker%report('model', 1, 'formulation', "'inextensible' "//not_here//"; take 'consistent'")
      if (config%model%dampers == 'exact') &
         call checker%report('model', 1, 'dampers', "'exact' "//not_here//"; take 'reduced', or inertia = 'lumped'")
      do i = 1, size(config%hinges)
         associate (hinge => config%hinges(i))
            call refuse('freeplay', hinge%freeplay > 0.0_wp)
            call refuse('lower_stop', hinge%lower_stop < none_given)
            call refuse('upper_stop', hinge%upper_stop < none_given)
            call refuse('latch_angle', hinge%latch_angle < none_given)
            call refuse('release_time', checker%is_given('hinge', i, 'release_time'))
            call refuse('release_after', checker%is_given('hinge', i, 'release_after'))
         end associate
      end do
      do i = 1, size(config%kink_programs)
         if (.not. checker%is_sound('kink_program', i, 'law')) cycle
         if (moves_smoothly(config%kink_programs(i)%law)) cycle
         call checker%report('kink_program', i, 'law', "must be 'smooth_step' or 'table' with bending = 'quasistatic' and "// &
                             "inertia = 'distributed': the rate of the kink must not jump")
      end do

   contains

      subroutine refuse(key, is_there)
         character(len=*), intent(in) :: key
         logical, intent(in) :: is_there
         if (is_there .and. checker%is_sound('hinge', i, key)) call checker%report('hinge', i, key, not_here)
      end subroutine refuse

   end subroutine check_condensed

   !> Only dynamic bending has slopes of its own; only rigid rods need no stiffness.
   subroutine check_bending(checker, config)
      class(key_checker), intent(inout) :: checker
      type(case_config), intent(in) :: config
      character(len=:), allocatable :: reason

      if (.not. checker%is_sound('model', 1, 'bending')) return
      if (config%model%bending /= 'rigid') call checker%require('chain', 1, 'bending_stiffness', &
         "unless bending = 'rigid'")
      if (config%model%bending /= 'dynamic') then
         reason = "bending = '"//trim(config%model%bending)//"'"
         call require_zero('alpha', config%initial%alpha)
         call require_zero('beta', config%initial%beta)
         call require_zero('alpha_rate', config%initial%alpha_rate)
         call require_zero('beta_rate', config%initial%beta_rate)
      end if
      if (config%model%bending_shapes == 3) return
      reason = 'bending_shapes = 2'
      call require_zero('bubble', config%initial%bubble)
      call require_zero('bubble_rate', config%initial%bubble_rate)

   contains

      subroutine require_zero(key, x)
         character(len=*), intent(in) :: key
         real(wp), intent(in) :: x(:)
         if (any(abs(x) > 0.0_wp)) call checker%report('initial', 1, key, 'must be 0 when '//reason)
      end subroutine require_zero

   end subroutine check_bending

   !> A bent rod that keeps its arc has a chord, l - int v'^2/2 ds (docs/model.md sec. 3).
   subroutine check_chords(checker, config)
      class(key_checker), intent(inout) :: checker
      type(case_config), intent(in) :: config
      character(len=*), parameter :: keys(3) = [character(len=6) :: 'alpha', 'beta', 'bubble']
      integer :: i, k

      if (config%model%formulation /= 'inextensible' .or. config%model%bending /= 'dynamic') return
      if (.not. all([(checker%is_sound('initial', 1, trim(keys(i))), i=1, 3), checker%is_sound('chain', 1, 'length')])) return
      associate (a => config%initial%alpha, b => config%initial%beta, c => config%initial%bubble, length => config%chain%length)
         if (any([size(a), size(b), size(c)] /= size(length)) .or. .not. all(length > 0.0_wp)) return ! another fault
         k = findloc(shortening(a, b, c, length) >= 1.0_wp, .true., 1)
         if (k > 0) call checker%report('initial', 1, 'alpha', 'bends rod '//to_text(k)//' so much that int v''^2/2 ds, '// &
                                        'by which its chord is shorter than its arc, is more than its length')
      end associate

   contains

      !> Over l. Slopes of any size may have been given: none counts for more than 1000 rad.
      elemental real(wp) function shortening(alpha, beta, bubble, length)
         real(wp), intent(in) :: alpha, beta, bubble, length
         real(wp), parameter :: much = 1.0e3_wp
         real(wp) :: a, b, c

         a = sign(min(abs(alpha), much), alpha)
         b = sign(min(abs(beta), much), beta)
         c = bubble/max(length, abs(bubble)/much)
         shortening = (2.0_wp*(a**2 + b**2) - a*b)/30.0_wp + 8.0_wp/15.0_wp*(a - b)*c + 256.0_wp/105.0_wp*c**2
      end function shortening

   end subroutine check_chords

   !> What moves has mass: the shapes of a rod that bends as motion, and every node or the rod before it.
   subroutine check_masses(checker, config)
      class(key_checker), intent(inout) :: checker
      type(case_config), intent(in) :: config
      real(wp), allocatable :: mass(:)

      if (.not. (checker%is_sound('model', 1, 'bending') .and. checker%is_sound('model', 1, 'inertia'))) return
      if (config%model%bending == 'dynamic') then
         if (checker%is_sound('model', 1, 'gauss_points') .and. config%model%gauss_points < 4) &
            call checker%report('model', 1, 'gauss_points', &
                                "must be at least 4 when bending = 'dynamic' (the square of a shape has degree 6)")
      end if
      if (.not. sound_chain('mass_per_length')) return
      mass = config%chain%mass_per_length
      if (config%model%bending == 'dynamic') then
         if (any(mass <= 0.0_wp)) call checker%report('chain', 1, 'mass_per_length', &
            "must be positive when bending = 'dynamic', but is 0 for rod "//to_text(findloc(mass <= 0.0_wp, .true., 1)))
         return
      end if
      if (.not. checker%is_sound('chain', 1, 'node_mass') .or. size(config%chain%node_mass) /= size(mass)) return
      if (config%model%inertia == 'lumped') mass(:size(mass) - 1) = mass(:size(mass) - 1) + mass(2:) ! half of each to a node
      mass = mass + config%chain%node_mass
      if (any(mass <= 0.0_wp)) call checker%report('chain', 1, 'node_mass', &
         'rod '//to_text(findloc(mass <= 0.0_wp, .true., 1))//' and its outer node are both without mass')

   contains

      !> Given rightly, one for each rod?
      logical function sound_chain(key)
         character(len=*), intent(in) :: key
         sound_chain = .false.
         if (config%chain%n_rods < 1) return
         if (.not. checker%is_sound('chain', 1, key) .or. .not. checker%is_given('chain', 1, key)) return
         sound_chain = size(config%chain%mass_per_length) == config%chain%n_rods
      end function sound_chain

   end subroutine check_masses

   !> A profile reaches from one existing rod to another.
   subroutine check_profile_rods(checker, i, profile, n_rods)
      class(key_checker), intent(inout) :: checker
      integer, intent(in) :: i !! which profile
      type(profile_config), intent(in) :: profile
      integer, intent(in) :: n_rods !! 0: not known

      if (.not. (checker%is_sound('rod_profile', i, 'first_rod') .and. checker%is_sound('rod_profile', i, 'last_rod'))) return
      if (n_rods > 0 .and. max(profile%first_rod, profile%last_rod) > n_rods) then
         call checker%report('rod_profile', i, trim(merge('first_rod', 'last_rod ', profile%first_rod > n_rods)), &
            no_such('rod', 1, n_rods))
      else if (n_rods > 0 .and. profile%first_rod > profile%last_rod) then
         call checker%report('rod_profile', i, 'last_rod', 'must not be less than first_rod = '//to_text(profile%first_rod))
      end if
   end subroutine check_profile_rods

   !> A polynomial or a table, and a factor that is nowhere negative: not zero either where rods bend by statics alone, whose
   !> flexibility is 1/EI.
   subroutine check_profile(checker, i, profile, positive)
      class(key_checker), intent(inout) :: checker
      integer, intent(in) :: i !! which profile
      type(profile_config), intent(in) :: profile
      logical, intent(in) :: positive !! zero is no bending stiffness
      type(rod_profile) :: compiled
      character(len=:), allocatable :: key
      real(wp) :: rounding
      logical :: ok

      key = 'polynomial'
      if (checker%is_given('rod_profile', i, 'positions') .or. checker%is_given('rod_profile', i, 'values')) then
         if (checker%is_given('rod_profile', i, key)) then
            call checker%report('rod_profile', i, key, 'cannot be combined with positions and values')
            return
         end if
         key = 'values'
         call checker%require('rod_profile', i, 'positions', 'with values')
         call checker%require('rod_profile', i, 'values', 'with positions')
         if (size(profile%positions) == 0 .or. size(profile%values) == 0) return
         call check_positions(checker, i, profile, ok)
         if (.not. ok) return
      else
         call checker%require('rod_profile', i, key, 'unless positions and values are given')
      end if
      if (.not. checker%is_sound('rod_profile', i, key) .or. .not. checker%is_sound('rod_profile', i, 'positions')) return
      call new_rod_profile(compiled, profile)
      rounding = 0.0_wp ! of a polynomial that touches zero
      if (key == 'polynomial') rounding = 16.0_wp*epsilon(1.0_wp)*sum(abs(profile%polynomial))
      if (smallest_value(compiled) < -rounding) then
         call checker%report('rod_profile', i, key, 'must not be negative anywhere from 0 to 1, but goes down to '// &
            short_text(smallest_value(compiled)))
      else if (.not. compiled%mean() > 0.0_wp) then
         call checker%report('rod_profile', i, key, 'must not be zero everywhere')
      else if (positive .and. profile%quantity == 'bending_stiffness' .and. .not. smallest_value(compiled) > 0.0_wp) then
         call checker%report('rod_profile', i, key, "must be positive from 0 to 1 when bending = 'quasistatic'")
      end if
   end subroutine check_profile

   !> As many values as positions, which rise from 0 to 1; two may be equal, three not.
   subroutine check_positions(checker, i, profile, ok)
      class(key_checker), intent(inout) :: checker
      integer, intent(in) :: i
      type(profile_config), intent(in) :: profile
      logical, intent(out) :: ok

      ok = .false.
      associate (p => profile%positions, n => size(profile%positions))
         if (size(profile%values) /= n) then
            call checker%report('rod_profile', i, 'values', 'must have as many values as positions: '//to_text(n)//', not '// &
               to_text(size(profile%values)))
         else if (n < 2 .or. any(abs(p([1, n]) - [0.0_wp, 1.0_wp]) > 0.0_wp)) then
            call checker%report('rod_profile', i, 'positions', 'must begin with 0 and end with 1')
         else if (any(p(2:) < p(:n - 1)) .or. any(p(3:) <= p(:n - 2)) .or. p(2) <= 0.0_wp .or. p(n - 1) >= 1.0_wp) then
            call checker%report('rod_profile', i, 'positions', &
               'must increase; two equal ones make a jump, but not three, nor at the ends')
         else
            ok = .true.
         end if
      end associate
   end subroutine check_positions

   !> Each method has its orders; only some take fixed steps.
   subroutine check_solver(checker, config)
      class(key_checker), intent(inout) :: checker
      type(case_config), intent(in) :: config
      type(method_type) :: method !! nameless: 'auto'
      character(len=:), allocatable :: rule

      if (.not. checker%is_sound('solver', 1, 'method')) return
      method = method_named(config%solver%method)
      rule = order_rule(method, config%solver%order)
      if (len_trim(method%name) == 0 .and. len(rule) > 0) rule = "needs a named method: 'auto' chooses the order itself"
      if (len(rule) > 0 .and. checker%is_sound('solver', 1, 'order')) call checker%report('solver', 1, 'order', rule)
      if (.not. config%solver%fixed_step > 0.0_wp) return
      if (.not. method%fixed_steps) then
         call checker%report('solver', 1, 'fixed_step', 'is possible with method = '//list_of_methods(methods%fixed_steps)//' only')
      else if (.not. (checker%is_sound('case', 1, 't_end') .and. checker%is_sound('solver', 1, 'max_steps'))) then
         return
      else if (config%t_end/config%solver%max_steps > config%solver%fixed_step) then
         call checker%report('solver', 1, 'fixed_step', 'would take more than max_steps = '// &
                    to_text(config%solver%max_steps)//' steps until t_end = '//short_text(config%t_end)//' [s]')
      end if
   end subroutine check_solver

   !> A load on a node needs an existing node and is a force.
   subroutine check_target(checker, i, load, n_rods)
      class(key_checker), intent(inout) :: checker
      integer, intent(in) :: i !! which load
      type(load_config), intent(in) :: load
      integer, intent(in) :: n_rods !! 0: not known

      if (.not. checker%is_sound('load', i, 'target')) return
      if (load%target == 'spacecraft') then
         if (.not. checker%is_given('load', i, 'node')) return
         call checker%report('load', i, 'node', "applies only with target = 'node'")
         return
      end if
      call checker%require('load', i, 'node', "when target = 'node'")
      if (n_rods > 0 .and. load%node > n_rods) call checker%report('load', i, 'node', no_such('node', 1, n_rods))
      if (load%component /= 'M' .or. .not. checker%is_sound('load', i, 'component')) return
      call checker%report('load', i, 'component', &
         "must be 'X' or 'Y' when target = 'node'; moments act on the spacecraft only")
   end subroutine check_target

end module rodyn_case_rules
