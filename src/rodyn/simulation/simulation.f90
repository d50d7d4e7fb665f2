!> One scene from its initial state to the end: regime after regime of loads, event after event, output after output.
module rodyn_simulation
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type, raise
   use rodyn_text, only: time_text
   use rodyn_motion, only: motion_type
   use rodyn_integrator, only: integrator_type
   use rodyn_switch_times, only: interval_ends, same_time
   implicit none (type, external)
   private
   public :: observer_type, output_times, listed_times, even_times, simulate

   !> Times at which the state is wanted, in increasing order. Evenly spaced ones are computed when they come: a list of a
   !> hundred million would take longer to make than most runs.
   type :: output_times
      private
      integer :: n = 0
      real(wp), allocatable :: listed(:) !! (n) [s]
      real(wp) :: t_end = 0.0_wp         !! without a list: the last of n times from 0 on [s]
   contains
      procedure :: time
   end type output_times

   !> Records the state at the output times.
   type, abstract :: observer_type
   contains
      procedure(observe_interface), deferred :: observe
   end type observer_type

   abstract interface
      subroutine observe_interface(self, motion, t, y, error)
         import :: observer_type, motion_type, error_type, wp
         implicit none (type, external)
         class(observer_type), intent(inout) :: self
         type(motion_type), intent(inout) :: motion !! its memory may be used, its state is not the observer's to change
         real(wp), intent(in) :: t    !! [s]
         real(wp), intent(in) :: y(:) !! (n_states)
         type(error_type), allocatable, intent(out) :: error
      end subroutine observe_interface
   end interface

contains

   !> The times of a list.
   pure function listed_times(list) result(times)
      real(wp), intent(in) :: list(:) !! increasing [s]
      type(output_times) :: times
      times%n = size(list)
      times%listed = list
   end function listed_times

   !> From 0 to t_end in equal intervals.
   pure function even_times(t_end, n_intervals) result(times)
      real(wp), intent(in) :: t_end !! [s]
      integer, intent(in) :: n_intervals
      type(output_times) :: times
      times%n = n_intervals + 1
      times%t_end = t_end
   end function even_times

   !> Number k of them [s].
   pure real(wp) function time(self, k)
      class(output_times), intent(in) :: self
      integer, intent(in) :: k !! 1 ... n
      if (allocated(self%listed)) then
         time = self%listed(k)
      else
         time = self%t_end*(real(k - 1, wp)/(self%n - 1))
      end if
   end function time

   !> Refuse times that no run can reach.
   subroutine check_times(times, t_end, error)
      type(output_times), intent(in) :: times
      real(wp), intent(in) :: t_end !! [s]
      type(error_type), allocatable, intent(out) :: error

      if (.not. (t_end > 0.0_wp .and. t_end <= huge(t_end))) &
         call raise(error, 'simulate: t_end = '//time_text(t_end)//' s: must be positive and finite')
      if (allocated(error) .or. .not. allocated(times%listed)) return
      associate (x => times%listed)
         if (.not. all(x >= 0.0_wp .and. x <= t_end) .or. any(x(2:) < x(:size(x) - 1))) &
            call raise(error, 'simulate: the output times must increase, from 0 or later to t_end = '//time_text(t_end)//' s')
      end associate
   end subroutine check_times

   !> Integrate from t = 0 to t_end and show the observer the states at `times`. At each switch of a load or a kink, at
   !> each release and each event of a hinge the integration stops exactly and restarts. On failure t and y are the last
   !> good ones.
   subroutine simulate(motion, integrator, times, t_end, observer, y, t, error)
      type(motion_type), intent(inout), target :: motion
      class(integrator_type), intent(inout) :: integrator !! made for this motion
      type(output_times), intent(in) :: times             !! within [0, t_end]
      real(wp), intent(in) :: t_end                       !! [s]
      class(observer_type), intent(inout) :: observer
      real(wp), contiguous, intent(inout) :: y(:)         !! in: state at t = 0; out: the last one
      real(wp), intent(out) :: t                          !! time of y [s]
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: ends(:)
      integer :: segment, next

      t = 0.0_wp
      call check_times(times, t_end, error)
      if (allocated(error)) return
      ends = interval_ends(motion%switches, t_end)
      next = 1
      do segment = 1, size(ends)
         call motion%begin_regime(t, ends(segment), t_end, y, error)
         if (allocated(error)) return
         if (segment == 1) call observe_now()
         if (allocated(error)) return
         call integrator%set_stop(ends(segment))
         call integrator%start(t, y, error)
         do while (t < ends(segment) .and. .not. allocated(error))
            call go_on(ends(segment))
         end do
         if (allocated(error)) return
      end do

   contains

      !> To the next output time, event, or the end of the regime.
      subroutine go_on(t_stop)
         real(wp), intent(in) :: t_stop
         real(wp) :: target_time

         target_time = t_stop
         if (next <= times%n) target_time = min(times%time(next), t_stop)
         call integrator%advance(target_time, y, t, error)
         if (allocated(error)) return
         if (integrator%at_event .and. same_time(t, t_stop)) t = t_stop ! no method can step from the one to the other
         call observe_now()
         if (.not. allocated(error)) call integrator%check_monitor(t, error)
         if (allocated(error) .or. .not. integrator%at_event) return
         call motion%respond(t, integrator%crossed, y, error)
         if (allocated(error) .or. t >= t_stop) return
         call integrator%start(t, y, error)
      end subroutine go_on

      !> Show the state if the next output time has come.
      subroutine observe_now()
         if (next > times%n) return
         if (times%time(next) > t) return
         call motion%dynamics%move_kinks(t)
         call observer%observe(motion, t, y, error)
         next = next + 1
      end subroutine observe_now

   end subroutine simulate

end module rodyn_simulation
