!> What CVODE and ARKODE have in common: the handles of the library, single steps towards the stop time, states and events inside
!> the last step, counts that outlive the library's own, which each restart resets.
module rodyn_sundials_integrator
   use, intrinsic :: iso_c_binding, only: c_ptr, c_int, c_null_ptr, c_associated
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type, raise
   use rodyn_text, only: time_text
   use rodyn_ode, only: ode_system, n_quadratures
   use rodyn_integrator, only: stepping_integrator, solver_options, solver_statistics
   use rodyn_event_search, only: find_event
   use rodyn_nvector, only: new_nvector, free_nvector, vector_content, content_of
   use rodyn_sundials_base, only: callback_data, all_finite, check
   use rodyn_sundials_interface, only: new_context, FSUNContext_Free, N_Vector
   implicit none (type, external)
   private
   public :: sundials_integrator

   !> Owns every handle of the library. Do not copy by assignment.
   type, abstract, extends(stepping_integrator) :: sundials_integrator
      type(c_ptr) :: context = c_null_ptr
      type(c_ptr) :: memory = c_null_ptr        !! the library's integrator
      logical :: initialized = .false.          !! it has all it needs, and may be restarted
      character(len=13) :: call_name = ''       !! of the library's procedure that makes a step
      type(N_Vector), pointer :: state => null() !! leading states: those that the library integrates
      type(callback_data), pointer :: data => null()
      real(wp) :: stop_in_force = -huge(1.0_wp) !! the stop time the library knows [s]
      real(wp) :: t_before = 0.0_wp             !! start of the last internal step [s]
      real(wp), allocatable :: y_before(:)      !! states of the library there
      real(wp), allocatable, dimension(:) :: f_before, f_after, y_event !! for events: rates at both ends of the step; workspace
      real(wp) :: rate(n_quadratures) = 0.0_wp  !! rates of the quadratures at the end of the last internal step
      type(solver_statistics) :: before_restart !! counts up to the last restart
   contains
      procedure :: start
      procedure :: step
      procedure :: finalize
      procedure :: create
      procedure :: look_for_event
      procedure :: rates_of_quadratures
      procedure :: counts_of_steps
      procedure(begin_interface), deferred :: begin         !! hand everything over to the library, or start it anew
      procedure(plain_interface), deferred :: set_library_stop !! let the library know `t_stop`
      procedure(evolve_interface), deferred :: evolve       !! one step of the library
      procedure(plain_interface), deferred :: complete_step !! quadratures and events of a step
      procedure(plain_interface), deferred :: rates_at_ends !! f_before and f_after
      procedure(free_interface), deferred :: free_memory    !! `memory` and what belongs to it
   end type sundials_integrator

   abstract interface
      subroutine begin_interface(self, t, error)
         import :: sundials_integrator, error_type, wp
         implicit none (type, external)
         class(sundials_integrator), intent(inout) :: self
         real(wp), intent(in) :: t !! [s]
         type(error_type), allocatable, intent(inout) :: error
      end subroutine begin_interface

      subroutine plain_interface(self, error)
         import :: sundials_integrator, error_type
         implicit none (type, external)
         class(sundials_integrator), intent(inout) :: self
         type(error_type), allocatable, intent(inout) :: error
      end subroutine plain_interface

      subroutine evolve_interface(self, t_reached, error)
         import :: sundials_integrator, error_type, wp
         implicit none (type, external)
         class(sundials_integrator), intent(inout) :: self
         real(wp), intent(out) :: t_reached !! [s]
         type(error_type), allocatable, intent(inout) :: error
      end subroutine evolve_interface

      subroutine free_interface(self)
         import :: sundials_integrator
         implicit none (type, external)
         class(sundials_integrator), intent(inout) :: self
      end subroutine free_interface
   end interface

contains

   !> Context, callbacks and state vector, for `new_...` of each library.
   subroutine create(self, system, options, inner, n, call_name, error)
      class(sundials_integrator), intent(inout) :: self
      class(ode_system), target, intent(inout) :: system !! must outlive the integrator
      type(solver_options), intent(in) :: options, inner !! the user's; with the tolerances that the library is given
      integer, intent(in) :: n                           !! leading states: those that the library integrates
      character(len=*), intent(in) :: call_name          !! of the library's procedure that makes a step
      type(error_type), allocatable, intent(inout) :: error

      self%system => system
      self%options = options
      self%call_name = call_name
      allocate (self%data)
      self%data%system => system
      self%data%rtol = inner%rtol
      self%data%atol = inner%atol
      allocate (self%y_before(n), source=0.0_wp)
      call check(error, new_context(self%context), 'SUNContext_Create')
      if (allocated(error)) return
      self%state => new_nvector(n, system%n_controlled, self%context)
      if (.not. associated(self%state)) call raise(error, 'N_VNewEmpty: out of memory')
   end subroutine create

   !> First start, or exact restart without history.
   subroutine start(self, t, y, error)
      class(sundials_integrator), intent(inout) :: self
      real(wp), intent(in) :: t    !! [s]
      real(wp), intent(in) :: y(:) !! (n_states)
      type(error_type), allocatable, intent(out) :: error
      type(vector_content), pointer :: content

      call self%begin_interval(t, y, error)
      if (allocated(error)) return
      content => content_of(self%state)
      associate (n => size(content%values))
         content%values(:) = y(:n)
         self%y_before(:) = y(:n)
         if (self%system%n_events > 0 .and. .not. allocated(self%y_event)) &
            allocate (self%f_before(n), self%f_after(n), self%y_event(n), source=0.0_wp)
      end associate
      self%t_before = t
      self%stop_in_force = -huge(1.0_wp)
      if (self%system%has_quadratures()) call self%rates_of_quadratures(t, self%y_good(:self%system%n_controlled), self%rate, error)
      if (self%initialized) self%before_restart = self%statistics()
      if (.not. allocated(error)) call self%begin(t, error)
      self%initialized = self%initialized .or. .not. allocated(error)
   end subroutine start

   !> One step of the library, which is told of a new stop time first.
   subroutine step(self, error)
      class(sundials_integrator), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error

      if ((self%stop_in_force < self%t_stop .or. self%stop_in_force > self%t_stop) .and. self%t_stop > self%t_good) then
         call self%set_library_stop(error)
         if (.not. allocated(error)) self%stop_in_force = self%t_stop
      end if
      if (.not. allocated(error)) call self%permit_step(error)
      if (.not. allocated(error)) call one_step(self, error)
   end subroutine step

   !> One internal step of the library.
   subroutine one_step(self, error)
      class(sundials_integrator), intent(inout) :: self
      type(error_type), allocatable, intent(inout) :: error
      type(vector_content), pointer :: content
      real(wp) :: t_reached

      content => content_of(self%state)
      call self%evolve(t_reached, error)
      if (allocated(error)) then
         call name_cause(self%data, error)
      else if (.not. all_finite(content%values)) then
         call raise(error, trim(self%call_name)//' at t = '//time_text(self%t_good)// &
                    ' s: the state is not finite after the next step')
      else if (.not. t_reached > self%t_good) then
         call raise(error, trim(self%call_name)//' at t = '//time_text(self%t_good)// &
                    ' s: the step has become too small to advance')
         call name_cause(self%data, error)
      end if
      if (allocated(error)) then
         self%n_steps = self%n_steps - 1
         return
      end if
      self%t_before = self%t_good
      self%t_good = t_reached
      associate (n => size(content%values))
         self%y_before(:) = self%y_good(:n)
         self%y_good(:n) = content%values
      end associate
      call self%complete_step(error)
   end subroutine one_step

   !> Add what the right-hand side had to say.
   subroutine name_cause(data, error)
      type(callback_data), intent(in) :: data
      type(error_type), intent(inout) :: error
      if (data%not_finite) then
         error%message = error%message//'; the right-hand side was not finite at t = '//time_text(data%t_refused)//' s'
      else if (data%refused) then
         error%message = error%message//'; the right-hand side could not be evaluated at t = '//time_text(data%t_refused)//' s'
      end if
   end subroutine name_cause

   !> Did an event function become negative in the last step? Then the step ends there. The libraries' own search for roots compares
   !> the ends of steps alone (CVODE) or works on a cubic interpolant, which is too coarse (ARKODE).
   subroutine look_for_event(self, error)
      class(sundials_integrator), intent(inout) :: self
      type(error_type), allocatable, intent(inout) :: error
      real(wp) :: t

      call self%rates_at_ends(error)
      if (allocated(error)) return
      associate (n => size(self%y_event))
         call find_event(self, self%t_before, self%y_before, self%f_before, self%t_good, self%y_good(:n), self%f_after, &
                         self%pending, t, self%y_event)
         if (.not. self%pending) return
         self%t_good = t
         self%y_good(:n) = self%y_event
      end associate
   end subroutine look_for_event

   subroutine rates_of_quadratures(self, t, y, rate, error)
      class(sundials_integrator), intent(inout) :: self
      real(wp), intent(in) :: t                !! [s]
      real(wp), contiguous, intent(in) :: y(:) !! (n_controlled)
      real(wp), intent(out) :: rate(n_quadratures)
      type(error_type), allocatable, intent(inout) :: error
      logical :: ok
      call self%system%quadratures(t, y, rate, ok)
      if (.not. ok) call raise(error, 'quadratures at t = '//time_text(t)//' s: the right-hand side could not be evaluated')
   end subroutine rates_of_quadratures

   !> Counts of the whole run that need nothing of the library.
   function counts_of_steps(self) result(stats)
      class(sundials_integrator), intent(in) :: self
      type(solver_statistics) :: stats
      stats = self%before_restart
      stats%n_steps = self%n_steps
      stats%n_starts = self%n_starts
      if (self%initialized) stats%n_rhs = self%data%n_rhs
   end function counts_of_steps

   !> Release every handle, in the reverse order of their creation.
   subroutine finalize(self)
      class(sundials_integrator), intent(inout) :: self
      integer(c_int) :: flag

      call self%free_memory()
      call free_nvector(self%state)
      if (c_associated(self%context)) flag = FSUNContext_Free(self%context)
      self%context = c_null_ptr
      if (associated(self%data)) deallocate (self%data)
      self%initialized = .false.
      nullify (self%system, self%monitor)
   end subroutine finalize

end module rodyn_sundials_integrator
