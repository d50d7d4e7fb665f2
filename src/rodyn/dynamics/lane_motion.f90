!> The motion of like scenes side by side, one to a lane: y = (q, p) in each, without ledger. `rodyn_motion` in lanes.
module rodyn_lane_motion
   use rodyn_kinds, only: wp
   use rodyn_lanes, only: lanes
   use rodyn_lane_ode, only: lane_system
   use rodyn_lane_scene, only: lane_scene, new_lane_scene, put_scene
   use rodyn_lane_accelerations, only: lane_work, new_lane_work, group_accelerations
   use rodyn_loads, only: load_regime, load_forces, evaluate_loads
   use rodyn_scene, only: scene_type
   implicit none (type, external)
   private
   public :: lane_motion, new_lane_motion

   !> Loads that act in one lane.
   type :: lane_load
      type(load_regime) :: regime
      type(load_forces) :: forces
      logical :: varying = .false. !! some load changes within the regime
   end type lane_load

   type, extends(lane_system) :: lane_motion
      type(lane_scene) :: group
      type(lane_work) :: work
      type(lane_load) :: loads(lanes)
      logical :: varying = .false. !! in some lane
   contains
      procedure :: accelerations
      procedure :: put
      procedure :: set_regime
      procedure :: release
   end type lane_motion

contains

   !> Room for scenes like this one (`are_alike`), which stands in every lane until others come.
   subroutine new_lane_motion(motion, scene)
      type(lane_motion), intent(out) :: motion
      type(scene_type), intent(in) :: scene

      motion%n_dof = scene%n_dof
      motion%turning = scene%n_base > 0
      call new_lane_scene(motion%group, scene, scene%hinges, one_rod_each=.true.)
      call new_lane_work(motion%work, motion%group)
      motion%group%loaded = any(scene%loads%loads%node > 0)
   end subroutine new_lane_motion

   !> Put a scene into a lane. Loads act after `set_regime`.
   subroutine put(self, lane, scene)
      class(lane_motion), intent(inout) :: self
      integer, intent(in) :: lane
      type(scene_type), intent(in) :: scene
      call put_scene(self%group, lane, scene, scene%hinges)
      call self%release(lane)
   end subroutine put

   !> Make the loads of a regime act in one lane.
   subroutine set_regime(self, lane, regime)
      class(lane_motion), intent(inout) :: self
      integer, intent(in) :: lane
      type(load_regime), intent(in) :: regime

      associate (load => self%loads(lane))
         load%regime = regime
         call evaluate_loads(load%forces, load%regime, 0.0_wp, fresh=.true.)
         load%varying = size(regime%varying) > 0
         self%group%node_force(lane, :, :) = 0.0_wp
         call write_forces(self, lane)
      end associate
      self%varying = any(self%loads%varying)
   end subroutine set_regime

   !> Nothing of interest is in this lane.
   subroutine release(self, lane)
      class(lane_motion), intent(inout) :: self
      integer, intent(in) :: lane
      self%loads(lane)%varying = .false.
      self%varying = any(self%loads%varying)
   end subroutine release

   !> Forces of a lane to where the kernel reads them.
   subroutine write_forces(self, lane)
      type(lane_motion), intent(inout) :: self
      integer, intent(in) :: lane
      associate (load => self%loads(lane))
         self%group%base_force(lane, :) = load%forces%base
         if (load%regime%on_nodes) self%group%node_force(lane, :, :) = load%forces%node
      end associate
   end subroutine write_forces

   !> p' in every lane.
   subroutine accelerations(self, t, q, p, acceleration, ok)
      class(lane_motion), intent(inout) :: self
      real(wp), intent(in) :: t(lanes)
      real(wp), contiguous, intent(in) :: q(:, :), p(:, :)
      real(wp), contiguous, intent(out) :: acceleration(:, :)
      logical, intent(out) :: ok(lanes)
      integer :: i

      if (self%varying) then
         do i = 1, lanes
            if (.not. self%loads(i)%varying) cycle
            call evaluate_loads(self%loads(i)%forces, self%loads(i)%regime, t(i), fresh=.false.)
            call write_forces(self, i)
         end do
      end if
      call group_accelerations(self%group, self%work, q, p, acceleration, ok)
   end subroutine accelerations

end module rodyn_lane_motion
