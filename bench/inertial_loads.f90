!> Run a case whose forces have fixed axes: `inertial_loads CASE.nml RESULT.h5`. Those on the spacecraft and on nodes, which a
!> case gives along the moving axes, are turned back by the rotation of the spacecraft; moments are left as they are.
module fixed_axes
   use rodyn, only: wp, scene_type, user_load
   implicit none (type, external)
   private
   public :: fixed_axes_load

   type, extends(user_load) :: fixed_axes_load
   contains
      procedure :: add_forces
   end type fixed_axes_load

contains

   subroutine add_forces(self, scene, t, q, p, base, node)
      class(fixed_axes_load), intent(inout) :: self
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: t, q(:), p(:)
      real(wp), intent(inout) :: base(3), node(:, :)
      real(wp) :: turn(2, 2)

      associate (unused_self => self, unused_scene => scene, unused_t => t, unused_p => p); end associate
      turn = reshape([cos(q(3)), -sin(q(3)), sin(q(3)), cos(q(3))], [2, 2])
      base(:2) = matmul(turn, base(:2))
      node = matmul(turn, node)
   end subroutine add_forces

end module fixed_axes

program inertial_loads
   use rodyn, only: case_config, error_type, read_case, run_case
   use fixed_axes, only: fixed_axes_load
   implicit none (type, external)
   type(case_config) :: config
   type(error_type), allocatable :: error
   type(fixed_axes_load) :: load
   character(len=:), allocatable :: text
   character(len=1000) :: case_path, result_path

   call get_command_argument(1, case_path)
   call get_command_argument(2, result_path)
   load%on_nodes = .true.
   call read_case(trim(case_path), config, text, error)
   if (.not. allocated(error)) call run_case(config, trim(result_path), error, text, force=.true., quiet=.true., load=load)
   if (.not. allocated(error)) stop
   write (*, '(a)') error%message
   stop 1, quiet=.true.
end program inertial_loads
