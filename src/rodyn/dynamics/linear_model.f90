!> The equations of motion about a state, linearised in full:
!>
!>     M dp' + (D + G) dp + K dq = 0,   dq' = dp + (terms of the turning axes).
!>
!> M is the mass matrix, D that of the dampers, G what the velocities of the state add (gyroscopic, if they are those of a
!> spin), and K the tangent stiffness: springs and rods, loads that turn with the spacecraft, centrifugal and other inertia
!> forces. About a state that is no equilibrium the accelerations of the state are held fixed.
!>
!> Locked hinges make angles redundant (`rodyn_locks`), dq = T dz: what is linearised is the motion of the coordinates that
!> are left, T^T M T and so on.
module rodyn_linear_model
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type, raise
   use rodyn_assembled, only: new_assembled_system
   use rodyn_locks, only: has_slaves, expansion_matrix, free_coordinates
   use rodyn_motion, only: motion_type, differentiate_balance, hinges_at
   implicit none (type, external)
   private
   public :: linear_model, new_linear_model

   !> Matrices over equations (as p), coordinates (as q) and rates (as p), n of each: those of `kept`.
   type :: linear_model
      integer :: n_base = 0                  !! unknowns of the spacecraft: 3 or 0; the first of those that are kept
      integer :: n = 0                       !! coordinates that no lock makes redundant
      integer :: n_joints = 0                !! relaxing hinges that are not locked
      real(wp), allocatable :: q(:), p(:)    !! the state (n_q), (dof)
      real(wp), allocatable :: acceleration(:) !! p' there (dof)
      real(wp), allocatable :: hinge_angle(:), hinge_moment(:) !! rotations of hinges 0..n-1 there [rad], moments in them [N m]
      integer, allocatable :: kept(:)          !! where the coordinates stand in q, those of relaxing hinges last (n + n_joints)
      real(wp), allocatable :: expansion(:, :) !! T (dof, n); allocated if something is redundant
      real(wp), allocatable :: mass(:, :)      !! M (n, n)
      real(wp), allocatable :: damping(:, :)   !! D (n, n)
      real(wp), allocatable :: gyration(:, :)  !! G (n, n)
      real(wp), allocatable :: stiffness(:, :) !! K (n, n + n_joints); behind the n columns those of relaxing hinges
      real(wp), allocatable :: joints(:, :)    !! dth'/dq of relaxing hinges (n_q - dof, n_q)
      logical :: loaded = .false.            !! some load acts
      integer :: n_free_hinges = 0           !! hinges without spring
      integer :: n_idle_hinges = 0           !! hinges with neither spring nor damper
   contains
      procedure :: is_steady
      procedure :: whole
   end type linear_model

contains

   !> Linearise at a time and state. Loads are those of `motion%dynamics%set_regime`.
   subroutine new_linear_model(model, motion, t, y, error)
      type(linear_model), intent(out) :: model
      type(motion_type), intent(inout) :: motion
      real(wp), intent(in) :: t    !! [s]
      real(wp), intent(in) :: y(:) !! (q, p, ...)
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: by_state(:, :)
      integer, allocatable :: moving(:)
      integer :: i
      logical :: ok

      associate (r => motion%n_q, m => motion%n_dof, scene => motion%dynamics%scene, hinges => motion%dynamics%hinges, &
                 forces => motion%dynamics%forces)
         call new_assembled_system(motion%system, scene, hinges, error) ! hinges may have changed since it was used last
         if (allocated(error)) return
         model%n_base = scene%n_base
         moving = pack([(i, i=1, r - m)], .not. hinges%locked(hinges%relaxing))
         model%n_joints = size(moving)
         model%q = y(:r)
         model%p = y(r + 1:r + m)
         allocate (model%acceleration(m), model%joints(r - m, r), by_state(m, r + m))
         call differentiate_balance(motion, t, y, model%acceleration, by_state, model%joints, ok)
         if (.not. ok) then
            call raise(error, 'the equations cannot be linearised: no finite accelerations, or a mass matrix that is not '// &
                       'positive definite')
            return
         end if
         call hinges_at(motion, t, y, model%hinge_angle, model%hinge_moment, ok)
         model%mass = motion%system%m
         model%stiffness = by_state(:, :r)
         allocate (model%damping(m, m), model%gyration(m, m), source=0.0_wp)
         if (r == m) model%damping = motion%system%d
         model%gyration = by_state(:, r + 1:) - model%damping
         model%loaded = any(abs(forces%base) > 0.0_wp)
         if (motion%dynamics%regime%on_nodes) model%loaded = model%loaded .or. any(abs(forces%node) > 0.0_wp)
         associate (law => hinges)
            model%n_free_hinges = count(law%stiffness <= 0.0_wp .and. .not. law%locked)
            model%n_idle_hinges = count(law%stiffness <= 0.0_wp .and. law%damping <= 0.0_wp .and. .not. law%locked)
         end associate
         model%kept = free_coordinates(scene, hinges)
         if (model%n_joints > 0) model%kept = [model%kept, m + moving]
         model%n = size(model%kept) - model%n_joints
         if (model%n_joints < r - m) then
            model%stiffness = model%stiffness(:, model%kept)
            model%joints = model%joints(moving, model%kept)
         end if
         if (.not. has_slaves(hinges)) return
         model%expansion = expansion_matrix(scene, hinges)
      end associate
      call reduce_all(model)
   end subroutine new_linear_model

   !> Leave out what is redundant. Relaxing hinges are not there then.
   subroutine reduce_all(model)
      type(linear_model), intent(inout) :: model
      model%mass = reduced(model%mass)
      model%damping = reduced(model%damping)
      model%gyration = reduced(model%gyration)
      model%stiffness = reduced(model%stiffness)

   contains

      function reduced(full)
         real(wp), intent(in) :: full(:, :)
         real(wp), allocatable :: reduced(:, :)
         reduced = matmul(transpose(model%expansion), matmul(full, model%expansion))
      end function reduced

   end subroutine reduce_all

   !> All coordinates of a motion from those that are kept.
   pure function whole(self, x) result(full)
      class(linear_model), intent(in) :: self
      complex(wp), intent(in) :: x(:) !! (n + n_joints)
      complex(wp) :: full(size(self%q))
      full = (0.0_wp, 0.0_wp)
      full(self%kept) = x
      if (allocated(self%expansion)) full = matmul(self%expansion, x)
   end function whole

   !> Do the chain and the spin stay as they are, to rounding?
   pure logical function is_steady(self, fastest)
      class(linear_model), intent(in) :: self
      real(wp), intent(in) :: fastest !! highest frequency [rad/s]
      associate (c => self%n_base + 1, w => min(self%n_base + 1, 3))
         is_steady = all(abs(self%p(c:)) <= 0.0_wp) .and. &
                     all(abs(self%acceleration(w:)) <= 1.0e3_wp*epsilon(1.0_wp)*fastest**2)
      end associate
   end function is_steady

end module rodyn_linear_model
