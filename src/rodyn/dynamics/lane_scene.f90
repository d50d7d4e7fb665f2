!> Like scenes side by side, one to a lane of the processor's vectors, as the lane kernels read them.
!>
!> Every array has the lane as its first index, so that one vector instruction serves all lanes. The scenes of a
!> group share what decides the flow of the computation (number of rods, fixed or free spacecraft, kind of rods) and
!> differ in numbers only. The same scene may stand in all lanes: then a lane is a time, not a scene.
module rodyn_lane_scene
   use rodyn_kinds, only: wp
   use rodyn_lanes, only: lanes
   use rodyn_lane_rods, only: lane_rod, put_rod
   use rodyn_scene, only: scene_type
   use rodyn_hinge_law, only: hinge_law
   use rodyn_recursion_condensed, only: condensed_rod, prepare_rod
   implicit none (type, external)
   private
   public :: lane_condensed_rod, lane_scene, new_lane_scene, put_scene, suits_lanes, are_alike

   !> The same of condensed rods, each between its hinges (`rodyn_recursion_condensed`).
   type :: lane_condensed_rod
      real(wp), dimension(lanes) :: length, m0, m1, turn_y, turn_z, out_y, out_z, across_y, across_z, tt, ty, tz, yy, yz, zz
      real(wp), dimension(lanes, 2) :: first, bend_y, bend_z
      real(wp), dimension(lanes, 3) :: flexibility, inertia, second
   end type lane_condensed_rod

   !> A group of scenes.
   type :: lane_scene
      integer :: n = 0      !! rods
      integer :: n_base = 3 !! 3: free spacecraft, 0: fixed
      integer :: n_dof = 0  !! length of p
      logical :: flexible = .true.       !! alpha and beta are unknowns
      logical :: inextensible = .false.  !! arcs keep their length
      logical :: series = .false.        !! they follow from the hinge moments
      logical :: damped = .false.        !! some hinge has a damper, if `series`; otherwise not used
      logical :: loaded = .false.        !! some force acts on a node in some lane
      type(lane_condensed_rod), allocatable :: condensed(:) !! condensed rods (n); allocated if they are
      type(lane_rod), allocatable :: rods(:) !! distinct rods
      integer, allocatable :: rod_of(:)      !! which of them is rod k (n)
      real(wp), allocatable :: node_mass(:, :) !! mu (lanes, 0:n) [kg]
      real(wp), allocatable :: stiffness(:, :) !! C (lanes, 0:n-1) [N m/rad]
      real(wp), allocatable :: damping(:, :)   !! D (lanes, 0:n-1) [N m s/rad]
      real(wp), allocatable :: kink(:, :)      !! gamma (lanes, 0:n-1) [rad]
      real(wp), allocatable :: offset(:, :)    !! moment at rest with all openings zero (`rodyn_hinge_law`) (lanes, 0:n-1) [N m]
      real(wp), allocatable, dimension(:, :) :: lower, pivot, upper !! factors of `rodyn_three_moments` (lanes, 0:n-1), if `series`
      real(wp), dimension(lanes) :: mass = 1.0_wp, inertia = 1.0_wp, hinge_x = 0.0_wp, hinge_y = 0.0_wp !! of the spacecraft
      real(wp), allocatable :: base_force(:, :)    !! X_C, Y_C, M_C (lanes, 3), moving axes
      real(wp), allocatable :: node_force(:, :, :) !! X, Y (lanes, 2, n), moving axes [N]
   end type lane_scene

contains

   !> May this scene stand in a lane?
   pure logical function suits_lanes(scene, hinges)
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges !! as they are now
      suits_lanes = .not. scene%assembled .and. size(hinges%relaxing) == 0 .and. .not. hinges%has_locks .and. &
                    .not. hinges%curved .and. scene%n_bend < 3
      if (scene%quasistatic) suits_lanes = suits_lanes .and. .not. hinges%driven .and. size(hinges%mechanisms) == 0
   end function suits_lanes

   !> May these scenes, each of which suits lanes, stand side by side? They must not make each other compute anything
   !> that they would not compute alone.
   pure logical function are_alike(a, b)
      type(scene_type), intent(in) :: a, b
      are_alike = a%n == b%n .and. a%n_base == b%n_base .and. (a%dynamic_bending .eqv. b%dynamic_bending) .and. &
                  (a%quasistatic .eqv. b%quasistatic) .and. (a%condensed .eqv. b%condensed) .and. &
                  (a%inextensible .eqv. b%inextensible) .and. &
                  (has_series_dampers(a) .eqv. has_series_dampers(b)) .and. &
                  (any(a%loads%loads%node > 0) .eqv. any(b%loads%loads%node > 0))
   end function are_alike

   pure logical function has_series_dampers(scene)
      type(scene_type), intent(in) :: scene
      has_series_dampers = scene%quasistatic .and. scene%hinges%has_damping .and. .not. scene%condensed
   end function has_series_dampers

   !> A group with the same scene in every lane.
   subroutine new_lane_scene(group, scene, hinges, one_rod_each)
      type(lane_scene), intent(out) :: group
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      logical, intent(in) :: one_rod_each !! keep constants per rod, since other scenes will come
      integer :: i, k

      group%n = scene%n
      group%n_base = scene%n_base
      group%n_dof = scene%n_dof
      group%flexible = scene%dynamic_bending
      group%inextensible = scene%inextensible
      group%series = scene%quasistatic
      group%damped = has_series_dampers(scene)
      associate (n => scene%n)
         if (one_rod_each) then
            allocate (group%rods(n))
            group%rod_of = [(k, k=1, n)]
         else
            allocate (group%rods(size(scene%rods)))
            group%rod_of = scene%rod_of
         end if
         allocate (group%node_mass(lanes, 0:n), group%stiffness(lanes, 0:n - 1), group%damping(lanes, 0:n - 1), &
                   group%kink(lanes, 0:n - 1), group%offset(lanes, 0:n - 1), group%base_force(lanes, 3), &
                   group%node_force(lanes, 2, n), &
                   source=0.0_wp)
         if (group%series) allocate (group%lower(lanes, 0:n - 1), group%pivot(lanes, 0:n - 1), group%upper(lanes, 0:n - 1), &
                                     source=0.0_wp)
         if (scene%condensed) allocate (group%condensed(n))
      end associate
      do i = 1, lanes
         call put_scene(group, i, scene, hinges)
      end do
   end subroutine new_lane_scene

   !> Put a scene like the others into one lane, without loads.
   subroutine put_scene(group, lane, scene, hinges)
      type(lane_scene), intent(inout) :: group
      integer, intent(in) :: lane
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      type(condensed_rod) :: condensed
      integer :: k

      do k = 1, scene%n
         call put_rod(group%rods(group%rod_of(k)), lane, scene%rods(scene%rod_of(k)))
      end do
      group%node_mass(lane, :) = scene%node_mass
      group%stiffness(lane, :) = hinges%stiffness
      group%damping(lane, :) = hinges%damping
      group%kink(lane, :) = hinges%kink
      group%offset(lane, :) = hinges%offset
      group%mass(lane) = scene%body%mass
      group%inertia(lane) = scene%body%inertia
      group%hinge_x(lane) = scene%body%hinge_x
      group%hinge_y(lane) = scene%body%hinge_y
      group%base_force(lane, :) = 0.0_wp
      group%node_force(lane, :, :) = 0.0_wp
      if (.not. group%series) return
      associate (n => scene%n, series => hinges%series)
         group%lower(lane, 1:n - 1) = series%lower
         group%pivot(lane, :) = series%pivot
         group%upper(lane, 0:n - 2) = series%upper
      end associate
      if (.not. scene%condensed) return
      do k = 1, scene%n
         call prepare_rod(scene, hinges%locked, hinges%stiffness, k, condensed)
         call put_condensed_rod(group%condensed(k), lane, condensed)
      end do
   end subroutine put_scene

   pure subroutine put_condensed_rod(rods, lane, rod)
      type(lane_condensed_rod), intent(inout) :: rods
      integer, intent(in) :: lane
      type(condensed_rod), intent(in) :: rod

      rods%length(lane) = rod%length
      rods%m0(lane) = rod%m0
      rods%m1(lane) = rod%m1
      rods%turn_y(lane) = rod%turn_y
      rods%turn_z(lane) = rod%turn_z
      rods%out_y(lane) = rod%out_y
      rods%out_z(lane) = rod%out_z
      rods%across_y(lane) = rod%across_y
      rods%across_z(lane) = rod%across_z
      rods%tt(lane) = rod%tt
      rods%ty(lane) = rod%ty
      rods%tz(lane) = rod%tz
      rods%yy(lane) = rod%yy
      rods%yz(lane) = rod%yz
      rods%zz(lane) = rod%zz
      rods%first(lane, :) = rod%first
      rods%bend_y(lane, :) = rod%bend_y
      rods%bend_z(lane, :) = rod%bend_z
      rods%flexibility(lane, :) = rod%flexibility
      rods%inertia(lane, :) = rod%inertia
      rods%second(lane, :) = rod%second
   end subroutine put_condensed_rod

end module rodyn_lane_scene
