!> Scenes made ready to be evaluated, and what must hold of each at any state.
module test_motions
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type
   use rodyn_case_config, only: case_config
   use rodyn_kinematics, only: invariants_type
   use rodyn_motion, only: motion_type, new_motion, initial_state, state_invariants
   use rodyn_scene, only: scene_type, new_scene
   use rodyn_user_load, only: user_load
   use test_random_scenes, only: random_case
   use test_testing, only: check
   implicit none (type, external)
   private
   public :: idle_load, motion_of, random_motion, check_jacobian, check_energy_rate, eigenvector_error

   !> Does nothing, but has switches.
   type, extends(user_load) :: idle_load
   contains
      procedure :: add_forces
   end type idle_load

contains

   !> A case with its initial state; loads act as they do from 0 to 1 s.
   subroutine motion_of(motion, y, config, error, ledger)
      type(motion_type), intent(out) :: motion
      real(wp), allocatable, intent(out) :: y(:)
      type(case_config), intent(in) :: config
      type(error_type), allocatable, intent(out) :: error
      logical, intent(in), optional :: ledger !! default .true.
      type(scene_type) :: scene
      logical :: with_ledger

      with_ledger = .true.
      if (present(ledger)) with_ledger = ledger
      call new_scene(scene, config, error)
      if (.not. allocated(error)) call new_motion(motion, scene, with_ledger, error)
      if (allocated(error)) return
      call motion%dynamics%set_regime(0.0_wp, 1.0_wp)
      call initial_state(motion, config%initial, y)
   end subroutine motion_of

   subroutine add_forces(self, scene, t, q, p, base, node)
      class(idle_load), intent(inout) :: self
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: t, q(:), p(:)
      real(wp), intent(inout) :: base(3), node(:, :)
      associate (u1 => self, u2 => scene, u3 => t, u4 => q, u5 => p, u6 => base, u7 => node); end associate
   end subroutine add_forces

   !> A random scene with its initial state and loads; no load is switched within (0, 1).
   subroutine random_motion(motion, y, which, n, kernel, error)
      type(motion_type), intent(out) :: motion
      real(wp), allocatable, intent(out) :: y(:)
      integer, intent(in) :: which, n !! kind, rods
      character(len=*), intent(in) :: kernel
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config

      call random_case(config, which, n)
      config%model%kernel = kernel
      call motion_of(motion, y, config, error)
   end subroutine random_motion

   !> The Jacobian at t = 0.3 s against central differences.
   subroutine check_jacobian(motion, y, name, error)
      type(motion_type), intent(inout) :: motion
      real(wp), contiguous, intent(in) :: y(:)
      character(len=*), intent(in) :: name
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: jac(size(y), size(y)), off(size(y)), step, scale
      logical :: ok
      integer :: j

      call motion%jacobian(0.3_wp, y, jac, ok)
      call check(error, ok, 'no Jacobian')
      if (allocated(error)) return
      associate (n => motion%n_controlled)
         scale = maxval(abs(jac(:n, :n)))
      end associate
      do j = 1, motion%n_controlled
         step = 1.0e-5_wp*max(1.0_wp, abs(y(j)))
         off = jac(:, j) - (8.0_wp*(moved(j, step) - moved(j, -step)) - &
                            (moved(j, 2.0_wp*step) - moved(j, -2.0_wp*step)))/(12.0_wp*step)
         call check(error, maxval(abs(off(:motion%n_controlled))) < 1.0e-7_wp*scale, name//': Jacobian is off')
         if (allocated(error)) return
      end do

   contains

      !> Rates with coordinate j moved. Differences of fourth order: inertia is of fourth degree in the slopes.
      function moved(j, by) result(rates)
         integer, intent(in) :: j
         real(wp), intent(in) :: by
         real(wp) :: rates(size(y)), there(size(y))
         logical :: there_ok
         there = y
         there(j) = y(j) + by
         call motion%rhs(0.3_wp, there, rates, there_ok)
      end function moved

   end subroutine check_jacobian

   !> d(kinetic + elastic)/dt along the motion, by central differences, equals load power - dissipated power.
   subroutine check_energy_rate(motion, y, least_power, name, error)
      type(motion_type), intent(inout) :: motion !! with a ledger
      real(wp), contiguous, intent(in) :: y(:)
      real(wp), intent(in) :: least_power        !! that differences can tell from none [W]
      character(len=*), intent(in) :: name
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: h = 1.0e-6_wp !! [s]
      type(invariants_type) :: before, after
      real(wp) :: ydot(size(y)), rate, scale
      logical :: ok

      call motion%rhs(0.3_wp, y, ydot, ok)
      before = state_invariants(motion, y - h*ydot)
      after = state_invariants(motion, y + h*ydot)
      associate (power => ydot(motion%n_controlled + 1:))
         rate = (after%kinetic + after%elastic - before%kinetic - before%elastic)/(2.0_wp*h)
         scale = least_power + sum(abs(power)) + sum(ydot**2)*1.0e-3_wp
         call check(error, ok .and. abs(rate - (power(1) - power(2))) < 1.0e-5_wp*scale, name//': energy does not balance')
      end associate
   end subroutine check_energy_rate

   !> Residual of an eigenvector of the Jacobian made of a mode, relative to both.
   real(wp) function eigenvector_error(motion, jac, y, shape, eigenvalue)
      type(motion_type), intent(in) :: motion
      real(wp), intent(in) :: jac(:, :), y(:) !! the Jacobian at state y
      complex(wp), intent(in) :: shape(:)     !! change of q (n_q)
      complex(wp), intent(in) :: eigenvalue   !! [1/s]
      complex(wp) :: v(motion%n_q + motion%n_dof)

      associate (r => motion%n_q)
         v = [shape, eigenvalue*shape(:motion%n_dof)]
         ! dp = dq' less the terms of the turning axes, in which the spacecraft's position is.
         if (motion%free) v(r + 1:r + 2) = v(r + 1:r + 2) - y(r + 3)*[v(2), -v(1)] - v(r + 3)*[y(2), -y(1)]
      end associate
      eigenvector_error = maxval(abs(matmul(jac, v) - eigenvalue*v))/(maxval(abs(jac))*maxval(abs(v)))
   end function eigenvector_error

end module test_motions
