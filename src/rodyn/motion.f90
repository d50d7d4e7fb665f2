!> The motion of a scene as first-order equations: y = (q, p [, work of the loads, dissipated energy]).
!>
!> The two integrals are there only with a ledger. They take no part in step-size control, so that a run with a
!> ledger makes the same steps as one without.
module rodyn_motion
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type
   use rodyn_ode, only: ode_system
   use rodyn_case_config, only: initial_config
   use rodyn_scene, only: scene_type
   use rodyn_accelerations, only: dynamics_type, new_dynamics
   use rodyn_assembled, only: assembled_system, new_assembled_system, mass_matrix
   use rodyn_linearisation, only: balance_tangent
   use rodyn_kinematics, only: load_power, dissipated_power
   use rodyn_lapack, only: dpotrf, dpotrs
   implicit none (type, external)
   private
   public :: motion_type, new_motion, initial_state

   !> A running scene.
   type, extends(ode_system) :: motion_type
      type(dynamics_type) :: dynamics
      type(assembled_system) :: system !! mass matrix of the Jacobian; allocated when first needed
      integer :: n_dof = 0             !! length of q and of p
      logical :: free = .true.         !! the spacecraft moves
      logical :: ledger = .true.       !! y ends with work and dissipated energy
   contains
      procedure :: rhs
      procedure :: jacobian
   end type motion_type

contains

   !> Prepare a scene for integration. Loads act after `dynamics%set_regime`.
   subroutine new_motion(motion, scene, ledger, error)
      type(motion_type), intent(out) :: motion
      type(scene_type), intent(in) :: scene
      logical, intent(in) :: ledger
      type(error_type), allocatable, intent(out) :: error

      call new_dynamics(motion%dynamics, scene, error)
      if (allocated(error)) return
      motion%n_dof = scene%n_dof
      motion%free = scene%n_base > 0
      motion%ledger = ledger
      motion%n_controlled = 2*scene%n_dof
      motion%n_states = motion%n_controlled + merge(2, 0, ledger)
   end subroutine new_motion

   !> y at t = 0.
   subroutine initial_state(motion, initial, y)
      type(motion_type), intent(in) :: motion
      type(initial_config), intent(in) :: initial
      real(wp), allocatable, intent(out) :: y(:) !! (n_states)

      allocate (y(motion%n_states), source=0.0_wp)
      associate (scene => motion%dynamics%scene, n_dof => motion%n_dof, n => motion%dynamics%scene%n)
         if (motion%free) then
            y(1:3) = [initial%displacement_x, initial%displacement_y, initial%rotation]
            y(n_dof + 1:n_dof + 3) = [initial%velocity_x, initial%velocity_y, initial%omega]
         end if
         call place(scene%phi_at(), initial%phi, initial%phi_rate)
         if (.not. scene%dynamic_bending) return
         call place(scene%alpha_at(), initial%alpha, initial%alpha_rate)
         call place(scene%beta_at(), initial%beta, initial%beta_rate)
      end associate

   contains

      subroutine place(before, values, rates)
         integer, intent(in) :: before
         real(wp), intent(in) :: values(:), rates(:)
         y(before + 1:before + size(values)) = values
         y(motion%n_dof + before + 1:motion%n_dof + before + size(rates)) = rates
      end subroutine place

   end subroutine initial_state

   !> y' = (q', p' [, powers]). The displacement of C is measured along the turning axes, MODEL sec. 1.
   subroutine rhs(self, t, y, ydot, ok)
      class(motion_type), intent(inout) :: self
      real(wp), intent(in) :: t
      real(wp), contiguous, intent(in) :: y(:)
      real(wp), contiguous, intent(out) :: ydot(:)
      logical, intent(out) :: ok

      associate (m => self%n_dof)
         call self%dynamics%accelerations(t, y(1:m), y(m + 1:2*m), ydot(m + 1:2*m), ok)
         ydot(1:m) = y(m + 1:2*m)
         if (self%free) then
            ydot(1) = ydot(1) + y(m + 3)*y(2)
            ydot(2) = ydot(2) - y(m + 3)*y(1)
         end if
         if (.not. self%ledger) return
         ydot(2*m + 1) = load_power(self%dynamics%scene, y(1:m), y(m + 1:2*m), self%dynamics%forces%base, &
                                    self%dynamics%regime%on_nodes, self%dynamics%forces%node)
         ydot(2*m + 2) = dissipated_power(self%dynamics%scene, y(m + 1:2*m))
      end associate
   end subroutine rhs

   !> Exact Jacobian: the linearised balance solved with the mass matrix.
   subroutine jacobian(self, t, y, jac, ok)
      class(motion_type), intent(inout) :: self
      real(wp), intent(in) :: t
      real(wp), contiguous, intent(in) :: y(:)
      real(wp), contiguous, intent(out) :: jac(:, :)
      logical, intent(out) :: ok
      type(error_type), allocatable :: error
      real(wp) :: a(self%n_dof), direction(2*self%n_dof), change(self%n_dof, 2*self%n_dof)
      integer :: j, info

      associate (m => self%n_dof, scene => self%dynamics%scene, work => self%dynamics%work)
         jac = 0.0_wp
         ok = .true.
         if (.not. allocated(self%system%m)) call new_assembled_system(self%system, scene, error)
         if (.not. allocated(error)) call self%dynamics%accelerations(t, y(1:m), y(m + 1:2*m), a, ok)
         ok = ok .and. .not. allocated(error)
         if (.not. ok) return
         direction = 0.0_wp
         do j = 1, 2*m
            direction(j) = 1.0_wp
            call balance_tangent(scene, y(1:m), y(m + 1:2*m), a, self%dynamics%regime%on_nodes, &
                                 self%dynamics%forces%node, direction(1:m), direction(m + 1:), change(:, j))
            direction(j) = 0.0_wp
         end do
         call mass_matrix(self%system, scene, work%sine, work%cosine, y(1:m))
         call dpotrf('L', m, self%system%m, m, info)
         ok = info == 0
         if (.not. ok) return
         call dpotrs('L', m, 2*m, self%system%m, m, change, m, info)
         jac(m + 1:2*m, 1:2*m) = -change
         do j = 1, m
            jac(j, m + j) = 1.0_wp
         end do
         if (self%free) then
            jac(1, 2) = y(m + 3)
            jac(2, 1) = -y(m + 3)
            jac(1, m + 3) = y(2)
            jac(2, m + 3) = -y(1)
         end if
         if (self%ledger) call power_rows(self, y(1:m), y(m + 1:2*m), jac(2*m + 1:, :))
      end associate
   end subroutine jacobian

   !> Rows of the two powers. The power of the loads is linear in p and its dependence on phi_j is that of the
   !> lever l_j W_j n_j; the dissipated power is quadratic in p.
   subroutine power_rows(self, q, p, rows)
      class(motion_type), intent(in) :: self
      real(wp), intent(in) :: q(:), p(:)
      real(wp), intent(inout) :: rows(:, :)
      real(wp) :: unit(self%n_dof), force(2), omega
      integer :: j, k

      associate (m => self%n_dof, scene => self%dynamics%scene, forces => self%dynamics%forces, &
                 loaded => self%dynamics%regime%on_nodes)
         unit = 0.0_wp
         do j = 1, m
            unit(j) = 1.0_wp
            rows(1, m + j) = load_power(scene, q, unit, forces%base, loaded, forces%node)
            ! 2 b(p, unit) of the quadratic form b(p, p)
            rows(2, m + j) = 0.5_wp*(dissipated_power(scene, p + unit) - dissipated_power(scene, p - unit))
            unit(j) = 0.0_wp
         end do
         if (.not. loaded) return
         omega = 0.0_wp
         if (self%free) omega = p(3)
         force = 0.0_wp
         do k = scene%n, 1, -1
            force = force + forces%node(:, k)
            j = scene%phi_at() + k
            rows(1, j) = -scene%rods(scene%rod_of(k))%length*(omega + p(j))*(cos(q(j))*force(1) + sin(q(j))*force(2))
         end do
      end associate
   end subroutine power_rows

end module rodyn_motion
