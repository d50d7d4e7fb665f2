!> A load written by a user of the library: a controller that turns the spacecraft of a case by an angle and stops it there,
!> while the chain swings. `boom_slew CASE.nml RESULT.h5`.
module attitude_control
   use rodyn, only: wp, scene_type, user_load
   implicit none (type, external)
   private
   public :: attitude_controller

   !> M_C = -k (theta - r) - d (w - r'), r a smooth step.
   type, extends(user_load) :: attitude_controller
      real(wp) :: angle = 0.5_wp      !! to turn by [rad]
      real(wp) :: duration = 20.0_wp  !! of the turn [s]
      real(wp) :: stiffness = 60.0_wp !! k [N m/rad]
      real(wp) :: damping = 250.0_wp  !! d [N m s/rad]
   contains
      procedure :: add_forces
   end type attitude_controller

contains

   subroutine add_forces(self, scene, t, q, p, base, node)
      class(attitude_controller), intent(inout) :: self
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: t, q(:), p(:)
      real(wp), intent(inout) :: base(3), node(:, :)
      real(wp) :: s, wanted, wanted_rate

      associate (unused_scene => scene, unused_node => node); end associate
      s = min(t/self%duration, 1.0_wp)
      wanted = self%angle*s**3*(10.0_wp - s*(15.0_wp - 6.0_wp*s))
      wanted_rate = self%angle*30.0_wp*(s*(1.0_wp - s))**2/self%duration
      base(3) = base(3) - self%stiffness*(q(3) - wanted) - self%damping*(p(3) - wanted_rate)
   end subroutine add_forces

end module attitude_control

program boom_slew
   use rodyn, only: wp, case_config, error_type, read_case, run_case
   use attitude_control, only: attitude_controller
   implicit none (type, external)
   type(case_config) :: config
   type(error_type), allocatable :: error
   type(attitude_controller) :: controller
   character(len=:), allocatable :: text
   character(len=1000) :: case_path, result_path

   call get_command_argument(1, case_path)
   call get_command_argument(2, result_path)
   controller%switches = [controller%duration] ! the wanted angle has a jump in its third derivative there
   call read_case(trim(case_path), config, text, error)
   if (.not. allocated(error)) call run_case(config, trim(result_path), error, input_text=text, force=.true., load=controller)
   if (.not. allocated(error)) stop
   write (*, '(a)') error%message
   stop 1, quiet=.true.
end program boom_slew
