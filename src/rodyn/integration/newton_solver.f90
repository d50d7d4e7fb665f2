!> Newton systems of an `ode_system` as SUNDIALS' matrix and linear solver.
!>
!> The matrix is an empty shell: what would be in it stays with the system, which factors 1 - g J when CVODE asks for
!> the linear system (`linear_system_shim`) and solves in place when it asks for a solution.
module rodyn_newton_solver
   use, intrinsic :: iso_c_binding, only: c_ptr, c_int, c_double, c_null_ptr, c_f_pointer, c_loc, c_funloc
   use rodyn_nvector, only: vector_content, content_of
   use rodyn_sundials_base, only: callback_data
   use rodyn_sundials_interface, only: N_Vector, SUNMatrix, SUNMatrix_Ops, SUNMATRIX_CUSTOM, FSUNMatNewEmpty, &
      SUNLinearSolver, SUNLinearSolver_Ops, SUNLINEARSOLVER_DIRECT, SUNLINEARSOLVER_CUSTOM, FSUNLinSolNewEmpty
   implicit none (type, external)
   private
   public :: new_newton_matrix, new_newton_solver, linear_system_shim

contains

   !> The shell. Null on failure of the allocation in SUNDIALS.
   function new_newton_matrix(context) result(matrix)
      type(c_ptr), intent(in) :: context !! SUNContext
      type(SUNMatrix), pointer :: matrix
      type(SUNMatrix_Ops), pointer :: ops
      type(c_ptr) :: context_copy

      context_copy = context
      matrix => FSUNMatNewEmpty(context_copy)
      if (.not. associated(matrix)) return
      call c_f_pointer(matrix%ops, ops)
      ops%getid = c_funloc(matrix_id)
   end function new_newton_matrix

   !> The solver of the system behind `data`. Null on failure of the allocation in SUNDIALS.
   function new_newton_solver(data, context) result(solver)
      type(callback_data), target, intent(in) :: data !! must outlive the solver
      type(c_ptr), intent(in) :: context              !! SUNContext
      type(SUNLinearSolver), pointer :: solver
      type(SUNLinearSolver_Ops), pointer :: ops
      type(c_ptr) :: context_copy

      context_copy = context
      solver => FSUNLinSolNewEmpty(context_copy)
      if (.not. associated(solver)) return
      solver%content = c_loc(data)
      call c_f_pointer(solver%ops, ops)
      ops%gettype = c_funloc(solver_type)
      ops%getid = c_funloc(solver_id)
      ops%setup = c_funloc(set_up)
      ops%solve = c_funloc(solve)
      ops%free = c_funloc(release)
   end function new_newton_solver

   !> CVLsLinSysFn: linearise unless the last linearisation will do, factor 1 - gamma J.
   function linear_system_shim(t, y, rates, matrix, reuse, linearised, gamma, user_data, work1, work2, work3) &
      result(flag) bind(c)
      real(c_double), intent(in), value :: t
      type(N_Vector), intent(in) :: y, rates
      type(SUNMatrix), intent(in) :: matrix
      integer(c_int), intent(in), value :: reuse !! the last linearisation will do
      integer(c_int), intent(out) :: linearised  !! whether there is a new one
      real(c_double), intent(in), value :: gamma
      type(c_ptr), intent(in), value :: user_data
      type(N_Vector), intent(in) :: work1, work2, work3
      integer(c_int) :: flag
      type(callback_data), pointer :: data
      type(vector_content), pointer :: states
      logical :: ok

      associate (u1 => rates, u2 => matrix, u3 => work1, u4 => work2, u5 => work3); end associate
      call c_f_pointer(user_data, data)
      states => content_of(y)
      call data%system%factorise_newton(t, states%values, gamma, reuse == 0_c_int, ok)
      linearised = merge(1_c_int, 0_c_int, reuse == 0_c_int)
      flag = merge(0_c_int, 1_c_int, ok)
   end function linear_system_shim

   function matrix_id(matrix) result(id) bind(c)
      type(SUNMatrix), intent(in) :: matrix
      integer(c_int) :: id
      associate (unused => matrix); end associate
      id = SUNMATRIX_CUSTOM
   end function matrix_id

   function solver_type(solver) result(type_id) bind(c)
      type(SUNLinearSolver), intent(in) :: solver
      integer(c_int) :: type_id
      associate (unused => solver); end associate
      type_id = SUNLINEARSOLVER_DIRECT
   end function solver_type

   function solver_id(solver) result(id) bind(c)
      type(SUNLinearSolver), intent(in) :: solver
      integer(c_int) :: id
      associate (unused => solver); end associate
      id = SUNLINEARSOLVER_CUSTOM
   end function solver_id

   !> Nothing: the factors are made with the linear system.
   function set_up(solver, matrix) result(flag) bind(c)
      type(SUNLinearSolver), intent(in) :: solver
      type(SUNMatrix), intent(in) :: matrix
      integer(c_int) :: flag
      associate (u1 => solver, u2 => matrix); end associate
      flag = 0_c_int
   end function set_up

   !> x = (1 - gamma J)^-1 b.
   function solve(solver, matrix, x, b, tolerance) result(flag) bind(c)
      type(SUNLinearSolver), intent(in) :: solver
      type(SUNMatrix), intent(in) :: matrix
      type(N_Vector), intent(in) :: x, b
      real(c_double), intent(in), value :: tolerance
      integer(c_int) :: flag
      type(callback_data), pointer :: data
      type(vector_content), pointer :: cx, cb

      associate (u1 => matrix, u2 => tolerance); end associate
      call c_f_pointer(solver%content, data)
      cx => content_of(x)
      cb => content_of(b)
      cx%values(:) = cb%values
      call data%system%solve_newton(cx%values)
      flag = 0_c_int
   end function solve

   !> The content is not the solver's own.
   function release(solver) result(flag) bind(c)
      type(SUNLinearSolver), intent(inout) :: solver
      integer(c_int) :: flag
      interface
         subroutine free_empty(solver) bind(c, name='SUNLinSolFreeEmpty')
            import :: SUNLinearSolver
            implicit none (type, external)
            type(SUNLinearSolver), intent(inout) :: solver
         end subroutine free_empty
      end interface
      solver%content = c_null_ptr
      call free_empty(solver)
      flag = 0_c_int
   end function release

end module rodyn_newton_solver
