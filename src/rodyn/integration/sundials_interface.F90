!> What is not the same in the Fortran interfaces of SUNDIALS 6 and 7, under one name.
!>
!> Version 6 has a module for each class, and messages are silenced integrator by integrator; version 7 has one module, and
!> messages are silenced in the context.
#ifndef RODYN_SUNDIALS
#error Before fpm, type: eval "$(PATH_OF_RODYN/tools/flags fpm)"
#endif
module rodyn_sundials_interface
   use, intrinsic :: iso_c_binding, only: c_ptr, c_int, c_null_ptr, c_funloc
#if RODYN_SUNDIALS == 6
   use fsundials_context_mod, only: FSUNContext_Create, FSUNContext_Free
   use fsundials_nvector_mod, only: N_Vector, N_Vector_Ops, FN_VNewEmpty, FN_VFreeEmpty, FN_VCopyOps
   use fsundials_matrix_mod, only: SUNMatrix, SUNMatrix_Ops, SUNMATRIX_CUSTOM, FSUNMatNewEmpty, FSUNMatDestroy
   use fsundials_linearsolver_mod, only: SUNLinearSolver, SUNLinearSolver_Ops, SUNLINEARSOLVER_DIRECT, SUNLINEARSOLVER_CUSTOM, &
      FSUNLinSolNewEmpty, FSUNLinSolFree
   use fsundials_nonlinearsolver_mod, only: SUNNonlinearSolver, FSUNNonlinSolFree
   use fcvode_mod, only: FCVodeSetErrHandlerFn
   use farkode_erkstep_mod, only: FERKStepSetErrHandlerFn
#else
   use fsundials_core_mod, only: FSUNContext_Create, FSUNContext_Free, FSUNContext_ClearErrHandlers, SUN_COMM_NULL, N_Vector, &
      N_Vector_Ops, FN_VNewEmpty, FN_VFreeEmpty, FN_VCopyOps, SUNMatrix, SUNMatrix_Ops, SUNMATRIX_CUSTOM, FSUNMatNewEmpty, &
      FSUNMatDestroy, SUNLinearSolver, SUNLinearSolver_Ops, SUNLINEARSOLVER_DIRECT, SUNLINEARSOLVER_CUSTOM, FSUNLinSolNewEmpty, &
      FSUNLinSolFree, SUNNonlinearSolver, FSUNNonlinSolFree
#endif
   implicit none (type, external)
   private
   public :: FSUNContext_Free, N_Vector, N_Vector_Ops, FN_VNewEmpty, FN_VFreeEmpty, FN_VCopyOps, SUNMatrix, SUNMatrix_Ops, &
      SUNMATRIX_CUSTOM, FSUNMatNewEmpty, FSUNMatDestroy, SUNLinearSolver, SUNLinearSolver_Ops, SUNLINEARSOLVER_DIRECT, &
      SUNLINEARSOLVER_CUSTOM, FSUNLinSolNewEmpty, FSUNLinSolFree, SUNNonlinearSolver, FSUNNonlinSolFree
   public :: new_context, silence_cvode, silence_erkstep

contains

#if RODYN_SUNDIALS == 6

   !> A context without MPI; the flag of SUNDIALS.
   integer(c_int) function new_context(context) result(flag)
      type(c_ptr), intent(inout) :: context
      flag = FSUNContext_Create(c_null_ptr, context)
   end function new_context

   !> Let CVODE print nothing: its return codes become messages of ours.
   integer(c_int) function silence_cvode(memory) result(flag)
      type(c_ptr), intent(in) :: memory
      flag = FCVodeSetErrHandlerFn(memory, c_funloc(quiet_handler), c_null_ptr)
   end function silence_cvode

   !> The same for ERKStep.
   integer(c_int) function silence_erkstep(memory) result(flag)
      type(c_ptr), intent(in) :: memory
      flag = FERKStepSetErrHandlerFn(memory, c_funloc(quiet_handler), c_null_ptr)
   end function silence_erkstep

   !> CVErrHandlerFn and ARKErrHandlerFn.
   subroutine quiet_handler(code, module_name, function_name, message, handler_data) bind(c)
      integer(c_int), intent(in), value :: code
      type(c_ptr), intent(in), value :: module_name, function_name, message, handler_data
      associate (u1 => code, u2 => module_name, u3 => function_name, u4 => message, u5 => handler_data); end associate
   end subroutine quiet_handler

#else

   !> A context without MPI that prints nothing: return codes become messages of ours. The flag of SUNDIALS.
   integer(c_int) function new_context(context) result(flag)
      type(c_ptr), intent(inout) :: context
      flag = FSUNContext_Create(SUN_COMM_NULL, context)
      if (flag == 0_c_int) flag = FSUNContext_ClearErrHandlers(context)
   end function new_context

   !> Nothing to do: the context is silent.
   integer(c_int) function silence_cvode(memory) result(flag)
      type(c_ptr), intent(in) :: memory
      associate (unused => memory); end associate
      flag = 0_c_int
   end function silence_cvode

   !> The same for ERKStep.
   integer(c_int) function silence_erkstep(memory) result(flag)
      type(c_ptr), intent(in) :: memory
      associate (unused => memory); end associate
      flag = 0_c_int
   end function silence_erkstep

#endif

end module rodyn_sundials_interface
