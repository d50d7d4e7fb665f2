!> One scene from its initial state to the end: regime after regime of loads, output after output.
module rodyn_simulation
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type
   use rodyn_motion, only: motion_type
   use rodyn_integrator, only: integrator_type
   implicit none (type, external)
   private
   public :: observer_type, simulate

   !> Someone who takes down the state at the output times.
   type, abstract :: observer_type
   contains
      procedure(observe_interface), deferred :: observe
   end type observer_type

   abstract interface
      subroutine observe_interface(self, motion, t, y, error)
         import :: observer_type, motion_type, error_type, wp
         implicit none (type, external)
         class(observer_type), intent(inout) :: self
         type(motion_type), intent(in) :: motion
         real(wp), intent(in) :: t    !! [s]
         real(wp), intent(in) :: y(:) !! (n_states)
         type(error_type), allocatable, intent(out) :: error
      end subroutine observe_interface
   end interface

contains

   !> Integrate from t = 0 to t_end and show the observer the states at `times`. At each switch of a load the
   !> integration stops exactly and starts anew. On failure t and y are the last good ones.
   subroutine simulate(motion, integrator, times, t_end, observer, y, t, error)
      type(motion_type), intent(inout), target :: motion
      class(integrator_type), intent(inout) :: integrator !! made for this motion
      real(wp), intent(in) :: times(:)                    !! increasing, within [0, t_end] [s]
      real(wp), intent(in) :: t_end                       !! [s]
      class(observer_type), intent(inout) :: observer
      real(wp), contiguous, intent(inout) :: y(:)         !! in: state at t = 0; out: the last one
      real(wp), intent(out) :: t                          !! time of y [s]
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: ends(:)
      integer :: segment, next

      associate (switches => motion%dynamics%scene%loads%switches)
         ends = [pack(switches, switches < t_end), t_end]
      end associate
      t = 0.0_wp
      next = 1
      do segment = 1, size(ends)
         call motion%dynamics%set_regime(t, ends(segment))
         if (segment == 1) call observe_now()
         if (allocated(error)) return
         call integrator%set_stop(ends(segment))
         call integrator%start(t, y, error)
         if (allocated(error)) return
         do while (next <= size(times))
            if (times(next) > ends(segment)) exit
            call integrator%advance(times(next), y, t, error)
            if (allocated(error)) return
            call observe_now()
            if (allocated(error)) return
         end do
         if (t < ends(segment)) call integrator%advance(ends(segment), y, t, error)
         if (allocated(error)) return
      end do

   contains

      !> Show the state if the next output time has come.
      subroutine observe_now()
         if (next > size(times)) return
         if (times(next) > t) return
         call observer%observe(motion, t, y, error)
         next = next + 1
      end subroutine observe_now

   end subroutine simulate

end module rodyn_simulation
