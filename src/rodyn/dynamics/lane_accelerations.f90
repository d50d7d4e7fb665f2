!> p' of a group of scenes, or of one scene at several times, in vector lanes: the kernel that the group needs.
module rodyn_lane_accelerations
   use rodyn_kinds, only: wp
   use rodyn_lanes, only: lanes
   use rodyn_lane_scene, only: lane_scene
   use rodyn_lane_hinges, only: lane_rigid_moments, lane_flexible_moments, lane_series_moments, lane_condensed_moments
   use rodyn_lane_recursion_condensed, only: lane_condensed_accelerations
   use rodyn_lane_recursion_flexible, only: lane_flexible_accelerations
   use rodyn_inextensible_rods, only: bent_rods, lane_outward
   use rodyn_lane_recursion_inextensible, only: lane_inextensible_accelerations
   use rodyn_lane_recursion_rigid, only: lane_rigid_accelerations
   use rodyn_outboard_chain, only: lane_outward_size
   use rodyn_trigonometry, only: sine_cosine
   implicit none (type, external)
   private
   public :: lane_work, new_lane_work, group_accelerations

   !> Memory of the kernels.
   type :: lane_work
      real(wp), allocatable :: sine(:, :), cosine(:, :) !! of phi (lanes, 0:n); 0 and 1 at k = 0
      real(wp), allocatable :: outward(:, :, :)         !! between the passes (lanes, lane_outward_size, n)
      type(bent_rods), allocatable :: bent(:)           !! rods whose arcs keep their length (n)
      type(lane_outward), allocatable :: arcs(:)        !! of them between the passes (n)
      real(wp), allocatable :: theta(:, :), moment(:, :) !! joint rotations (lanes, 0:n-1), hinge moments (lanes, 0:n)
      real(wp), allocatable, dimension(:, :) :: moment_rate, force !! of condensed rods (lanes, 0:n)
   end type lane_work

contains

   subroutine new_lane_work(work, group)
      type(lane_work), intent(out) :: work
      type(lane_scene), intent(in) :: group
      associate (n => group%n)
         allocate (work%sine(lanes, 0:n), work%cosine(lanes, 0:n), work%outward(lanes, lane_outward_size, n), &
                   work%theta(lanes, 0:n - 1), work%moment(lanes, 0:n), source=0.0_wp)
         if (allocated(group%condensed)) allocate (work%moment_rate(lanes, 0:n), work%force(lanes, 0:n), source=0.0_wp)
      end associate
      if (group%inextensible) allocate (work%bent(group%n), work%arcs(group%n))
      work%cosine(:, 0) = 1.0_wp
   end subroutine new_lane_work

   !> p' in every lane. What a lane computes never depends on another one. Allocates nothing.
   subroutine group_accelerations(group, work, q, p, acceleration, ok)
      type(lane_scene), intent(in) :: group
      type(lane_work), intent(inout) :: work
      real(wp), contiguous, intent(in) :: q(:, :), p(:, :)    !! coordinates and rates (lanes, n_dof)
      real(wp), contiguous, intent(out) :: acceleration(:, :) !! p' (lanes, n_dof)
      logical, intent(out) :: ok(lanes) !! false: not finite, or M not positive definite

      associate (n => group%n, b => group%n_base)
         call sine_cosine(lanes*n, q(:, b + 1:b + n), work%sine(:, 1:), work%cosine(:, 1:))
         if (group%inextensible) then
            call lane_flexible_moments(n, group%stiffness, group%damping, group%offset, q(:, b + 1:b + n), &
                                       q(:, b + n + 1:b + 2*n), q(:, b + 2*n + 1:b + 3*n), p(:, b + 1:b + n), &
                                       p(:, b + n + 1:b + 2*n), p(:, b + 2*n + 1:b + 3*n), work%moment)
            call lane_inextensible_accelerations(n, b, group%rods, group%rod_of, group%node_mass, group%mass, group%inertia, &
                                                 group%hinge_x, group%hinge_y, group%base_force, group%loaded, group%node_force, &
                                                 work%sine, work%cosine, q(:, b + n + 1:b + 2*n), q(:, b + 2*n + 1:b + 3*n), p, &
                                                 work%moment, work%bent, work%arcs, acceleration, ok)
            return
         end if
         if (group%flexible) then
            call lane_flexible_accelerations(n, b, group%rods, group%rod_of, group%node_mass, group%stiffness, group%damping, &
                                             group%offset, group%mass, group%inertia, group%hinge_x, group%hinge_y, &
                                             group%base_force, group%loaded, group%node_force, work%sine, work%cosine, &
                                             q(:, b + 1:b + n), q(:, b + n + 1:b + 2*n), q(:, b + 2*n + 1:b + 3*n), p, &
                                             work%outward, acceleration, ok)
            return
         end if
         if (allocated(group%condensed)) then
            call lane_condensed_moments(n, group%stiffness, group%damping, group%kink, group%lower, group%pivot, group%upper, &
                                        q(:, b + 1:b + n), p(:, b + 1:b + n), work%moment, work%moment_rate, work%force)
            call lane_condensed_accelerations(n, b, group%condensed, group%node_mass, group%mass, group%inertia, group%hinge_x, &
                                              group%hinge_y, group%base_force, group%loaded, group%node_force, work%sine, &
                                              work%cosine, work%moment, work%moment_rate, work%force, p, work%outward, &
                                              acceleration, ok)
            return
         end if
         if (group%series) then
            call lane_series_moments(n, group%damped, group%stiffness, group%damping, group%kink, group%lower, group%pivot, &
                                     group%upper, q(:, b + 1:b + n), p(:, b + 1:b + n), work%theta, work%moment)
         else
            call lane_rigid_moments(n, group%stiffness, group%damping, group%offset, q(:, b + 1:b + n), &
                                    p(:, b + 1:b + n), work%moment)
         end if
         call lane_rigid_accelerations(n, b, group%rods, group%rod_of, group%node_mass, group%mass, group%inertia, &
                                       group%hinge_x, group%hinge_y, group%base_force, group%loaded, group%node_force, &
                                       work%sine, work%cosine, work%moment, p, work%outward, acceleration, ok)
      end associate
   end subroutine group_accelerations

end module rodyn_lane_accelerations
