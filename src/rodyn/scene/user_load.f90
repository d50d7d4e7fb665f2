!> Loads that a user of the library writes: forces and moments as functions of time and state (feedback control).
!>
!>     type, extends(user_load) :: controller
!>        real(wp) :: gain = 100.0_wp
!>     contains
!>        procedure :: add_forces
!>     end type controller
!>
!> `add_forces` adds to what acts already. Hand it to `run_case`, or to a motion by `set_user_load`. It must be smooth but at
!> the times `switches`. BDF knows nothing of its derivatives by the state; that costs iterations, not accuracy.
module rodyn_user_load
   use rodyn_kinds, only: wp
   use rodyn_scene, only: scene_type
   implicit none (type, external)
   private
   public :: user_load

   type, abstract :: user_load
      logical :: on_nodes = .false.        !! it acts on nodes, too
      real(wp), allocatable :: switches(:) !! times where it is not smooth [s]
   contains
      procedure(forces_interface), deferred :: add_forces
   end type user_load

   abstract interface
      !> Add the forces and moments at a time and state. Called by every right-hand side.
      subroutine forces_interface(self, scene, t, q, p, base, node)
         import :: user_load, scene_type, wp
         implicit none (type, external)
         class(user_load), intent(inout) :: self
         type(scene_type), intent(in) :: scene       !! where unknowns stand: phi_k is q(scene%phi_at() + k)
         real(wp), intent(in) :: t                   !! [s]
         real(wp), intent(in) :: q(:)                !! coordinates: u_x, u_y, theta, phi, alpha, beta
         real(wp), intent(in) :: p(:)                !! their rates: Vx, Vy, w, phi', alpha', beta'
         real(wp), intent(inout) :: base(3)          !! X_C, Y_C [N], M_C [N m], moving axes
         real(wp), intent(inout) :: node(:, :)       !! X, Y (2, n) [N], moving axes; (2, 0) unless `on_nodes`
      end subroutine forces_interface
   end interface

end module rodyn_user_load
