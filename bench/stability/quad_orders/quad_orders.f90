!> Orders of the methods of order 6 and more where rounding does not end the measurement: the sources of `gauss` and `dop853`
!> compiled with wp = real128, and the tables of `erk`, on problems whose solutions are known.
!> `bench/stability/run.py orders` builds and runs it, with the tables that `tools/bench stability tableaux` prints on its input.
!>
!> Printed, columns apart by tabs: method, order, problem, first step, and the errors of (q, p) at the end of runs, each with
!> twice the steps of the one before.
program quad_orders
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type
   use rodyn_integrator, only: integrator_type, solver_options
   use rodyn_dop853_integrator, only: dop853_integrator, new_dop853_integrator
   use rodyn_gauss_integrator, only: gauss_integrator, new_gauss_integrator
   use smooth_problems, only: smooth_problem, kepler, polynomial_chain
   use table_steps, only: table_type, read_table, steps_by_table
   implicit none (type, external)
   character(len=1), parameter :: tab = achar(9)
   type(kepler), target :: orbit
   type(polynomial_chain), target :: chain
   type(table_type) :: table

   if (precision(1.0_wp) < 30) error stop 'compile with wp = real128'
   call set_size(orbit, 2)
   call set_size(chain, 3)
   do while (read_table(table))
      call measure('erk', table%order, 'ellipse', orbit, 8.0_wp, 128, 5)
   end do
   call measure('dop853', 8, 'ellipse', orbit, 8.0_wp, 64, 5)
   call measure('gauss', 16, 'ellipse', orbit, 8.0_wp, 8, 4) ! then rounding is seen
   call measure('gauss', 16, 'polynomials', chain, 2.0_wp, 1, 5)

contains

   subroutine set_size(system, n)
      class(smooth_problem), intent(inout) :: system
      integer, intent(in) :: n
      system%n_dof = n
      system%n_states = 2*n
      system%n_controlled = 2*n
   end subroutine set_size

   subroutine measure(method, order, problem, system, t_end, fewest, halvings)
      character(len=*), intent(in) :: method, problem
      integer, intent(in) :: order
      class(smooth_problem), target, intent(inout) :: system
      real(wp), intent(in) :: t_end
      integer, intent(in) :: fewest !! steps of the first run
      integer, intent(in) :: halvings
      real(wp) :: error(0:halvings)
      integer :: i

      do i = 0, halvings
         error(i) = norm2(last_state(method, system, t_end, fewest*2**i) - system%exact(t_end))
      end do
      write (*, '(a, a, i0, 2a, a, f6.4, *(a, es12.5))') method, tab, order, tab, problem, tab, t_end/fewest, &
         (tab, error(i), i=0, halvings)
   end subroutine measure

   !> After so many equal steps.
   function last_state(method, system, t_end, n_steps) result(y)
      character(len=*), intent(in) :: method
      class(smooth_problem), target, intent(inout) :: system
      real(wp), intent(in) :: t_end
      integer, intent(in) :: n_steps
      type(gauss_integrator), target :: gauss
      type(dop853_integrator), target :: dop853
      type(solver_options) :: options
      type(error_type), allocatable :: error
      real(wp) :: y(system%n_states)

      options%fixed_step = t_end/n_steps
      ! What the iteration of gauss may leave: far less than the error of the method, but no more digits than 15 iterations bring.
      options%rtol = max(1.0e-33_wp, 1.0e-18_wp*options%fixed_step**16)
      options%atol = 0.01_wp*options%rtol
      select case (method)
      case ('gauss')
         call new_gauss_integrator(gauss, system, options, error)
         if (.not. allocated(error)) call run(gauss, system%exact(0.0_wp), t_end, y, error)
      case ('dop853')
         call new_dop853_integrator(dop853, system, options, error)
         if (.not. allocated(error)) call run(dop853, system%exact(0.0_wp), t_end, y, error)
      case default
         y = steps_by_table(table, system, system%exact(0.0_wp), options%fixed_step, n_steps)
      end select
      if (allocated(error)) error stop 'no solution'
   end function last_state

   subroutine run(integrator, y0, t_end, y, error)
      class(integrator_type), intent(inout) :: integrator
      real(wp), intent(in) :: y0(:), t_end
      real(wp), intent(out) :: y(:)
      type(error_type), allocatable, intent(inout) :: error
      real(wp) :: t

      call integrator%set_stop(t_end)
      call integrator%start(0.0_wp, y0, error)
      if (.not. allocated(error)) call integrator%advance(t_end, y, t, error)
   end subroutine run

end program quad_orders

!> In place of LAPACK's, which knows no quadruple precision: the eigenvalues of A serve stiff modes only, and there are none.
! allow(procedure-not-in-module)
subroutine dgeev(jobvl, jobvr, n, a, lda, wr, wi, vl, ldvl, vr, ldvr, work, lwork, info)
   use rodyn_kinds, only: wp
   implicit none (type, external)
   character(len=1), intent(in) :: jobvl, jobvr
   integer, intent(in) :: n, lda, ldvl, ldvr, lwork
   real(wp), intent(inout) :: a(lda, n), wr(n), wi(n), vl(ldvl, n), vr(ldvr, n), work(lwork)
   integer, intent(out) :: info
   associate (unused => [jobvl, jobvr], unused_a => [a, vl, vr], unused_w => [wr, work]); end associate
   wi = 0.0_wp
   info = 0
end subroutine dgeev
