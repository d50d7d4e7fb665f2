!> The kernels that take eight scenes at once, against those that take one.
module test_lanes
   use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
   use, intrinsic :: ieee_exceptions, only: ieee_usual, ieee_set_halting_mode, ieee_get_halting_mode
   use rodyn_kinds, only: wp, i8
   use rodyn_errors, only: error_type, raise
   use rodyn_case_config, only: case_config
   use rodyn_scene, only: scene_type, new_scene
   use rodyn_motion, only: motion_type, new_motion, initial_state
   use rodyn_lanes, only: lanes
   use rodyn_lane_scene, only: lane_scene, new_lane_scene, put_scene, suits_lanes, are_alike
   use rodyn_lane_accelerations, only: lane_work, new_lane_work, group_accelerations
   use test_testing, only: unittest, new_test
   use test_random_scenes, only: random_case, seed_random, kind_name, n_all_kinds, uniform
   implicit none (type, external)
   private
   public :: collect_lanes

   real(wp), parameter :: t_now = 0.3_wp !! [s]

   !> Eight scenes with a state each.
   type :: octet
      type(motion_type), allocatable :: motions(:) !! (lanes)
      type(lane_scene) :: group
      type(lane_work) :: work
      real(wp), allocatable :: q(:, :), p(:, :), acceleration(:, :) !! (lanes, n_dof)
      logical :: ok(lanes)
   end type octet

contains

   subroutine collect_lanes(suite)
      type(unittest), allocatable, intent(out) :: suite(:)
      suite = [new_test('each lane is the scalar kernel, on 1000 random scenes of every kind', test_agreement), &
               new_test('all lanes of one scene are the scalar kernel, also without lanes', test_one_scene), &
               new_test('massless rods between masses of all ratios lose no digits in lanes', test_extreme_masses), &
               new_test('no lane changes a bit of another, whatever it holds', test_independence), &
               new_test('a scene has the same bits in every lane', test_places)]
   end subroutine collect_lanes

   !> Fill the lanes with random scenes of one kind. `found` is false if that kind has no place in lanes.
   subroutine random_octet(eight, which, n, found, error)
      type(octet), intent(out) :: eight
      integer, intent(in) :: which, n
      logical, intent(out) :: found
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(scene_type) :: scene
      integer :: i

      i = 0
      do while (i < lanes)
         call random_case(config, which, n)
         call new_scene(scene, config, error)
         if (allocated(error)) return
         found = suits_lanes(scene, scene%hinges)
         if (.not. found) return
         if (i > 0) then
            if (.not. are_alike(scene, eight%motions(1)%dynamics%scene)) cycle
         end if
         i = i + 1
         call put(eight, i, scene, config, error)
         if (allocated(error)) return
      end do
   end subroutine random_octet

   subroutine clear(eight)
      type(octet), intent(out) :: eight
      eight%ok = .false.
   end subroutine clear

   !> Put a scene at rest in its initial state into a lane, with the loads of `t_now`.
   subroutine put(eight, lane, scene, config, error)
      type(octet), intent(inout) :: eight
      integer, intent(in) :: lane
      type(scene_type), intent(in) :: scene
      type(case_config), intent(in) :: config
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: y(:), ydot(:)
      logical :: ok

      if (.not. allocated(eight%motions)) allocate (eight%motions(lanes))
      call new_motion(eight%motions(lane), scene, .false., error)
      if (allocated(error)) return
      if (lane == 1) then
         call new_lane_scene(eight%group, scene, scene%hinges, one_rod_each=.true.)
         call new_lane_work(eight%work, eight%group)
         allocate (eight%q(lanes, scene%n_dof), eight%p(lanes, scene%n_dof), eight%acceleration(lanes, scene%n_dof))
      end if
      associate (motion => eight%motions(lane), group => eight%group)
         call put_scene(group, lane, scene, motion%dynamics%hinges)
         call motion%dynamics%set_regime(0.0_wp, 1.0_wp)
         call initial_state(motion, config%initial, y)
         allocate (ydot(size(y)))
         call motion%rhs(t_now, y, ydot, ok)
         eight%q(lane, :) = y(:scene%n_dof)
         eight%p(lane, :) = y(scene%n_dof + 1:)
         group%loaded = group%loaded .or. motion%dynamics%regime%on_nodes
         group%base_force(lane, :) = motion%dynamics%forces%base
         if (motion%dynamics%regime%on_nodes) group%node_force(lane, :, :) = motion%dynamics%forces%node
      end associate
   end subroutine put

   subroutine evaluate(eight)
      type(octet), intent(inout) :: eight
      call group_accelerations(eight%group, eight%work, eight%q, eight%p, eight%acceleration, eight%ok)
   end subroutine evaluate

   !> Largest relative difference of a lane to the scalar kernel.
   real(wp) function difference_of(eight, lane)
      type(octet), intent(inout) :: eight
      integer, intent(in) :: lane
      real(wp) :: acceleration(size(eight%q, 2)), q(size(eight%q, 2)), p(size(eight%q, 2))
      logical :: ok

      q = eight%q(lane, :)
      p = eight%p(lane, :)
      call eight%motions(lane)%dynamics%accelerations(t_now, q, p, acceleration, ok)
      difference_of = maxval(abs(eight%acceleration(lane, :) - acceleration))/maxval(abs(acceleration))
      if (.not. (ok .and. eight%ok(lane))) difference_of = huge(1.0_wp)
   end function difference_of

   subroutine test_agreement(error)
      type(error_type), allocatable, intent(out) :: error
      type(octet) :: eight
      real(wp) :: worst(n_all_kinds), difference
      integer :: scenes(n_all_kinds), which, i, lane
      logical :: found
      character(len=100) :: text

      call seed_random(2)
      worst = 0.0_wp
      scenes = 0
      do which = 1, n_all_kinds
         if (index(kind_name(which), 'bubbles') > 0) cycle ! have no lanes
         do i = 1, 125
            call random_octet(eight, which, 1 + mod(i, 9), found, error)
            if (allocated(error)) return
            if (.not. found) cycle
            call evaluate(eight)
            do lane = 1, lanes
               scenes(which) = scenes(which) + 1
               difference = difference_of(eight, lane)
               worst(which) = max(worst(which), difference)
            end do
         end do
         if (scenes(which) < merge(1, 1000, index(kind_name(which), 'exact') > 0)) &
            call raise(error, kind_name(which)//': too few scenes')
         if (worst(which) < 1.0e-13_wp) cycle
         write (text, '(": relative difference ", es9.2)') worst(which)
         call raise(error, kind_name(which)//trim(text))
         return
      end do
   end subroutine test_agreement

   !> `lane_accelerations` of one scene, with varying loads at eight times.
   subroutine test_one_scene(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(scene_type) :: scene
      type(motion_type) :: motion
      real(wp), allocatable :: y(:), q(:, :), p(:, :), a(:, :), q1(:), p1(:), a1(:)
      real(wp) :: t(lanes)
      integer :: which, i
      logical :: ok

      call seed_random(3)
      do which = 1, n_all_kinds
         do i = 1, 2
            call random_case(config, which, 4)
            config%chain%hinge_damping = 0.0_wp ! no hinge with a state of its own
            if (i == 2) config%model%kernel = 'assembled'
            call new_scene(scene, config, error)
            if (.not. allocated(error)) call new_motion(motion, scene, .false., error)
            if (allocated(error)) return
            call initial_state(motion, config%initial, y)
            call motion%dynamics%set_regime(0.0_wp, 1.0_wp)
            t = [0.1_wp, 0.2_wp, 0.3_wp, 0.4_wp, 0.5_wp, 0.6_wp, 0.7_wp, 0.8_wp]
            q = spread(y(:scene%n_dof), 1, lanes)
            p = spread(y(scene%n_dof + 1:), 1, lanes)
            p(:, 1) = p(:, 1) + t
            a = p
            call motion%lane_accelerations(t, q, p, a, ok)
            q1 = q(5, :)
            p1 = p(5, :)
            a1 = p1
            if (ok) call motion%dynamics%accelerations(t(5), q1, p1, a1, ok)
            if (ok) ok = maxval(abs(a(5, :) - a1)) < 1.0e-13_wp*maxval(abs(a1))
            if (ok) cycle
            call raise(error, kind_name(which)//' '//trim(config%model%kernel)//': lanes differ')
            return
         end do
      end do
   end subroutine test_one_scene

   !> Node masses from 1 mg to 1 t beside each other: the recursion for rods with mass must be as exact as the one that
   !> was made for rods without.
   subroutine test_extreme_masses(error)
      type(error_type), allocatable, intent(out) :: error
      type(octet) :: eight
      type(case_config) :: config
      type(scene_type) :: scene
      real(wp) :: worst
      integer :: i, lane, n
      character(len=60) :: text

      call seed_random(4)
      worst = 0.0_wp
      do i = 1, 200
         n = 1 + mod(i, 9)
         call clear(eight)
         do lane = 1, lanes
            call random_case(config, merge(5, 12, mod(i, 2) == 0), n)
            call spread_masses(config, n)
            call new_scene(scene, config, error)
            if (.not. allocated(error)) call put(eight, lane, scene, config, error)
            if (allocated(error)) return
         end do
         call evaluate(eight)
         do lane = 1, lanes
            worst = max(worst, difference_of(eight, lane))
         end do
      end do
      if (worst < 1.0e-12_wp) return
      write (text, '("relative difference ", es9.2)') worst
      call raise(error, trim(text))
   end subroutine test_extreme_masses

   subroutine spread_masses(config, n)
      type(case_config), intent(inout) :: config
      integer, intent(in) :: n
      integer :: k
      config%chain%mass_per_length = 1.0e-9_wp
      do k = 1, n
         config%chain%node_mass(k) = 10.0_wp**uniform(-6.0_wp, 3.0_wp)
      end do
   end subroutine spread_masses

   !> NaN, infinity, huge numbers and angles that the library must reduce, in one lane.
   subroutine test_independence(error)
      type(error_type), allocatable, intent(out) :: error
      type(octet) :: eight
      real(wp), allocatable :: before(:, :), q(:, :), p(:, :)
      real(wp) :: poison(4)
      integer :: which, lane, i, j
      logical :: found, halting(size(ieee_usual))

      call ieee_get_halting_mode(ieee_usual, halting)
      call ieee_set_halting_mode(ieee_usual, .false.)
      poison = [ieee_value(0.0_wp, ieee_quiet_nan), 1.0e300_wp, -7.0e5_wp, 0.0_wp]
      call seed_random(5)
      kinds: do which = 1, n_all_kinds
         call random_octet(eight, which, 5, found, error)
         if (allocated(error)) exit kinds
         if (.not. found) cycle kinds
         call evaluate(eight)
         before = eight%acceleration
         q = eight%q
         p = eight%p
         do i = 1, size(poison)
            do lane = 1, lanes
               eight%q(lane, :) = poison(i)
               eight%p(lane, :) = poison(i)
               call evaluate(eight)
               do j = 1, lanes
                  if (j == lane) cycle
                  if (same_bits(eight%acceleration(j, :), before(j, :)) .and. eight%ok(j)) cycle
                  call raise(error, kind_name(which)//': a lane was disturbed')
                  exit kinds
               end do
               eight%q = q
               eight%p = p
            end do
         end do
      end do kinds
      call ieee_set_halting_mode(ieee_usual, halting)
   end subroutine test_independence

   !> Each scene in each lane, its companions moved along.
   subroutine test_places(error)
      type(error_type), allocatable, intent(out) :: error
      type(octet) :: eight, other
      integer :: which, lane, shift, n, to
      logical :: found

      call seed_random(6)
      do which = 1, n_all_kinds
         do n = 1, 6
            call random_octet(eight, which, n, found, error)
            if (allocated(error)) return
            if (.not. found) cycle
            eight%q(3, eight%group%n_base + 1:) = 1.0e6_wp ! an angle for the library
            call evaluate(eight)
            do shift = 1, lanes - 1
               other%group = eight%group
               other%work = eight%work
               other%q = eight%q
               other%p = eight%p
               other%acceleration = eight%acceleration
               do lane = 1, lanes
                  to = 1 + modulo(lane - 1 + shift, lanes)
                  call put_scene(other%group, to, eight%motions(lane)%dynamics%scene, eight%motions(lane)%dynamics%hinges)
                  other%group%base_force(to, :) = eight%group%base_force(lane, :)
                  other%group%node_force(to, :, :) = eight%group%node_force(lane, :, :)
                  other%q(to, :) = eight%q(lane, :)
                  other%p(to, :) = eight%p(lane, :)
               end do
               call evaluate(other)
               do lane = 1, lanes
                  to = 1 + modulo(lane - 1 + shift, lanes)
                  if (same_bits(other%acceleration(to, :), eight%acceleration(lane, :))) cycle
                  call raise(error, kind_name(which)//': other bits in another lane')
                  return
               end do
            end do
         end do
      end do
   end subroutine test_places

   pure logical function same_bits(x, y)
      real(wp), intent(in) :: x(:), y(:)
      same_bits = all(transfer(x, [0_i8]) == transfer(y, [0_i8]))
   end function same_bits

end module test_lanes
