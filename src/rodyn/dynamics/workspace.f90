!> Memory of one running scene: all that the right-hand side writes besides its result. One per thread.
module rodyn_workspace
   use rodyn_kinds, only: wp
   use rodyn_outboard_chain, only: outward_size
   use rodyn_scene, only: scene_type
   implicit none (type, external)
   private
   public :: workspace_type, new_workspace

   type :: workspace_type
      real(wp), allocatable :: sine(:)       !! sin phi_k (0:n), 0 at k = 0
      real(wp), allocatable :: cosine(:)     !! cos phi_k (0:n), 1 at k = 0
      real(wp), allocatable :: theta(:)      !! joint rotations (0:n-1) [rad]
      real(wp), allocatable :: moment(:)     !! hinge moments T (0:n) [N m]
      real(wp), allocatable :: outward(:, :) !! what the inward pass leaves for the outward pass (outward_size, n)
   end type workspace_type

contains

   !> Allocate for a scene.
   subroutine new_workspace(work, scene)
      type(workspace_type), intent(out) :: work
      type(scene_type), intent(in) :: scene

      associate (n => scene%n)
         allocate (work%sine(0:n), work%cosine(0:n), work%theta(0:n - 1), work%moment(0:n), work%outward(outward_size, n), &
                   source=0.0_wp)
      end associate
      work%cosine(0) = 1.0_wp
   end subroutine new_workspace

end module rodyn_workspace
