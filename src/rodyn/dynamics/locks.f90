!> Locked hinges as a change of coordinates, for code that works with whole matrices.
!>
!> The opening of a locked hinge is given. Between rods with inertia or rigid ones that makes one angle redundant,
!>     phi_{k+1} = phi_k + beta_k - alpha_{k+1} + opening_k                 (alpha, beta: with dynamic bending)
!> which is linear: with z the other coordinates, dq = T dz. `reduce` applies T^T to forces, `expand` applies T to changes,
!> and a symmetric matrix becomes T^T M T; all keep their size, with zeros (ones on the diagonal of M) for what is slaved.
!> With quasistatic bending nothing is redundant: see `rodyn_hinge_law`. The same equations elsewhere: docs/model.md sec. 7.
module rodyn_locks
   use rodyn_kinds, only: wp
   use rodyn_scene, only: scene_type
   use rodyn_hinge_law, only: hinge_law
   implicit none (type, external)
   private
   public :: has_slaves, reduce, expand, reduce_matrix, free_coordinates, expansion_matrix, reactions

contains

   !> Some chord angle follows from others.
   pure logical function has_slaves(hinges)
      type(hinge_law), intent(in) :: hinges
      has_slaves = hinges%has_locks .and. .not. hinges%quasistatic
   end function has_slaves

   !> x <- T^T x (generalised forces), zero where a coordinate is slaved.
   pure subroutine reduce(scene, locked, x)
      type(scene_type), intent(in) :: scene
      logical, intent(in) :: locked(0:)   !! (0:n-1)
      real(wp), intent(inout) :: x(:) !! (n_dof)
      real(wp) :: force
      integer :: k

      do k = scene%n, 1, -1
         if (.not. locked(k - 1)) cycle
         force = x(scene%phi_at() + k)
         x(scene%phi_at() + k) = 0.0_wp
         if (k > 1) x(scene%phi_at() + k - 1) = x(scene%phi_at() + k - 1) + force
         if (.not. scene%dynamic_bending) cycle
         x(scene%alpha_at() + k) = x(scene%alpha_at() + k) - force
         if (k > 1) x(scene%beta_at() + k - 1) = x(scene%beta_at() + k - 1) + force
      end do
   end subroutine reduce

   !> Set slaved coordinates (or rates, or accelerations) by those of the others and the openings (likewise).
   pure subroutine expand(scene, locked, opening, x)
      type(scene_type), intent(in) :: scene
      logical, intent(in) :: locked(0:)   !! which are locked, or will be (0:n-1)
      real(wp), intent(in) :: opening(0:) !! of locked hinges (0:n-1)
      real(wp), intent(inout) :: x(:)     !! (n_dof)
      real(wp) :: outer
      integer :: k

      outer = 0.0_wp ! end tangent of rod k - 1
      do k = 1, scene%n
         associate (phi => x(scene%phi_at() + k))
            if (locked(k - 1)) then
               phi = outer + opening(k - 1)
               if (scene%dynamic_bending) phi = phi - x(scene%alpha_at() + k)
            end if
            outer = phi
            if (scene%dynamic_bending) outer = outer + x(scene%beta_at() + k)
         end associate
      end do
   end subroutine expand

   !> Matrix <- T^T matrix T, with `diagonal` where a coordinate is slaved.
   pure subroutine reduce_matrix(scene, locked, diagonal, matrix)
      type(scene_type), intent(in) :: scene
      logical, intent(in) :: locked(0:)       !! (0:n-1)
      real(wp), intent(in) :: diagonal        !! 1 keeps a mass matrix positive definite
      real(wp), intent(inout) :: matrix(:, :) !! symmetric, both triangles (n_dof, n_dof)
      integer :: j, k

      do j = 1, scene%n_dof
         call reduce(scene, locked, matrix(:, j))
      end do
      do j = 1, scene%n_dof
         call reduce(scene, locked, matrix(j, :))
      end do
      do k = 1, scene%n
         associate (i => scene%phi_at() + k)
            if (locked(k - 1)) matrix(i, i) = diagonal
         end associate
      end do
   end subroutine reduce_matrix

   !> Indices of the coordinates that are not slaved.
   pure function free_coordinates(scene, hinges) result(list)
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      integer, allocatable :: list(:)
      logical :: free(scene%n_dof)
      integer :: i

      free = .true.
      free(scene%phi_at() + 1:scene%phi_at() + scene%n) = .not. (hinges%locked .and. has_slaves(hinges))
      list = pack([(i, i=1, scene%n_dof)], free)
   end function free_coordinates

   !> T, dq = T dz, z the coordinates that are not slaved.
   pure function expansion_matrix(scene, hinges) result(t)
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      real(wp), allocatable :: t(:, :) !! (n_dof, size of z)
      integer, allocatable :: free(:)
      real(wp) :: still(0:scene%n - 1)
      integer :: j

      free = free_coordinates(scene, hinges)
      still = 0.0_wp
      allocate (t(scene%n_dof, size(free)), source=0.0_wp)
      do j = 1, size(free)
         t(free(j), j) = 1.0_wp
         if (has_slaves(hinges)) call expand(scene, hinges%locked, still, t(:, j))
      end do
   end function expansion_matrix

   !> Moments of locked hinges from what the motion lacks without them, M p' - forces = sum -T_k d(opening_k)/dq: turning
   !> all rods beyond hinge k opens that hinge alone.
   pure subroutine reactions(scene, locked, lacking, moment)
      type(scene_type), intent(in) :: scene
      logical, intent(in) :: locked(0:)     !! (0:n-1)
      real(wp), intent(in) :: lacking(:)    !! (n_dof) [N m in rows of angles]
      real(wp), intent(inout) :: moment(0:) !! T of locked hinges (0:n) [N m]
      real(wp) :: turning
      integer :: k

      turning = 0.0_wp
      do k = scene%n, 1, -1
         turning = turning + lacking(scene%phi_at() + k)
         if (locked(k - 1)) moment(k - 1) = -turning
      end do
   end subroutine reactions

end module rodyn_locks
