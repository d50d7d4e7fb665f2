!> What the integrators cost beside the right-hand side, for 26 states: 13 oscillators of 1 to 13 rad/s.
module rodyn_bench_oscillators
   use rodyn_kinds, only: wp
   use rodyn_ode, only: ode_system
   implicit none (type, external)
   private
   public :: oscillators

   type, extends(ode_system) :: oscillators
   contains
      procedure :: rhs => oscillators_rhs
      procedure :: jacobian => oscillators_jacobian
   end type oscillators

contains

   subroutine oscillators_rhs(self, t, y, ydot, ok)
      class(oscillators), intent(inout) :: self
      real(wp), intent(in) :: t
      real(wp), contiguous, intent(in) :: y(:)
      real(wp), contiguous, intent(out) :: ydot(:)
      logical, intent(out) :: ok
      integer :: k
      ok = t < huge(t)
      do k = 1, self%n_states/2
         ydot(2*k - 1) = y(2*k)
         ydot(2*k) = -real(k*k, wp)*y(2*k - 1)
      end do
   end subroutine oscillators_rhs

   subroutine oscillators_jacobian(self, t, y, jac, ok)
      class(oscillators), intent(inout) :: self
      real(wp), intent(in) :: t
      real(wp), contiguous, intent(in) :: y(:)
      real(wp), contiguous, intent(out) :: jac(:, :)
      logical, intent(out) :: ok
      integer :: k
      ok = t < huge(t) .and. size(y) == self%n_states
      jac = 0.0_wp
      do k = 1, self%n_states/2
         jac(2*k - 1, 2*k) = 1.0_wp
         jac(2*k, 2*k - 1) = -real(k*k, wp)
      end do
   end subroutine oscillators_jacobian

end module rodyn_bench_oscillators

!> Prints one line for the shim and one for each method.
program bench_integrators
   use, intrinsic :: iso_c_binding, only: c_ptr, c_int, c_loc, c_double
   use rodyn_kinds, only: wp, i8
   use rodyn_errors, only: error_type
   use rodyn_ode, only: ode_system
   use rodyn_bench_oscillators, only: oscillators
   use rodyn_nvector, only: new_nvector, free_nvector
   use rodyn_sundials_base, only: callback_data, rhs_shim
   use rodyn_integrator, only: integrator_type, solver_options, solver_statistics
   use rodyn_integrators, only: new_integrator
   use rodyn_sundials_interface, only: new_context, N_Vector
   implicit none (type, external)

   integer, parameter :: n = 26, n_calls = 20000000
   type(oscillators), target :: system
   class(ode_system), pointer :: any_system
   type(callback_data), target :: data
   type(N_Vector), pointer :: y, ydot
   type(c_ptr) :: context, user_data
   real(wp), allocatable :: a(:), b(:)
   real(wp) :: direct, through_shim
   integer(c_int) :: flag
   integer(i8) :: t0, t1, rate
   logical :: ok
   integer :: i

   system%n_states = n
   system%n_controlled = n
   any_system => system
   allocate (a(n), source=1.0_wp)
   allocate (b(n))
   call system_clock(t0, rate)
   do i = 1, n_calls
      call any_system%rhs(0.0_wp, a, b, ok)
      a(1) = b(2)
   end do
   call system_clock(t1)
   direct = real(t1 - t0, wp)/real(rate, wp)/real(n_calls, wp)

   data%system => system
   flag = new_context(context)
   y => new_nvector(n, n, context)
   ydot => new_nvector(n, n, context)
   user_data = c_loc(data)
   call system_clock(t0)
   do i = 1, n_calls
      flag = flag + rhs_shim(real(i, c_double), y, ydot, user_data)
   end do
   call system_clock(t1)
   through_shim = real(t1 - t0, wp)/real(rate, wp)/real(n_calls, wp)
   write (*, '(a, f6.1, a, f6.1, a, f6.1, a, i0)') 'rhs ', 1.0e9_wp*direct, ' ns, through the shim ', 1.0e9_wp*through_shim, &
      ' ns, shim ', 1.0e9_wp*(through_shim - direct), ' ns; bad flags ', flag
   call free_nvector(y)
   call free_nvector(ydot)
   call time_method('adams', direct)
   call time_method('bdf', direct)
   call time_method('erk', direct)

contains

   !> Wall time per step of a run, and what remains of it without the right-hand sides.
   subroutine time_method(method, rhs_time)
      character(len=*), intent(in) :: method
      real(wp), intent(in) :: rhs_time !! [s]
      class(integrator_type), allocatable :: integrator
      type(error_type), allocatable :: error
      type(solver_statistics) :: stats
      type(solver_options) :: options
      real(wp) :: state(n), t, t_end, wall, overhead
      integer(i8) :: start, finish

      options%rtol = 1.0e-10_wp
      options%atol = 1.0e-12_wp
      state = 0.0_wp
      state(1::2) = 1.0_wp
      t_end = merge(30.0_wp, 300.0_wp, method == 'bdf')
      call new_integrator(integrator, system, method, options, error)
      if (allocated(error)) error stop 1
      call integrator%set_stop(t_end)
      call system_clock(start)
      call integrator%start(0.0_wp, state, error)
      call integrator%advance(t_end, state, t, error)
      if (allocated(error)) error stop 2
      call system_clock(finish)
      wall = real(finish - start, wp)/real(rate, wp)
      stats = integrator%statistics()
      overhead = (wall - real(stats%n_rhs, wp)*rhs_time)/real(stats%n_steps, wp)
      write (*, '(a5, a, i0, a, i0, a, f7.3, a, f7.3, a, es8.1)') method, ': ', stats%n_steps, ' steps, ', stats%n_rhs, &
         ' rhs, ', 1.0e6_wp*wall/real(stats%n_steps, wp), ' us/step, of which not rhs ', 1.0e6_wp*overhead, ' us; error ', &
         abs(state(1) - cos(t_end))
      call integrator%finalize()
   end subroutine time_method

end program bench_integrators
