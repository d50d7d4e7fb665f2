!> What CVODE and ARKODE are given and what they return: the callbacks, the text of return codes, the version.
module rodyn_sundials_base
   use, intrinsic :: iso_c_binding, only: c_ptr, c_int, c_long, c_double, c_char, c_f_pointer, c_loc, c_associated
   use rodyn_kinds, only: wp, i8
   use rodyn_errors, only: error_type, raise
   use rodyn_posix, only: c_text
   use rodyn_text, only: time_text
   use rodyn_ode, only: ode_system, n_quadratures
   use rodyn_nvector, only: vector_content, content_of
   use rodyn_sundials_interface, only: N_Vector
   implicit none (type, external)
   private
   public :: callback_data, rhs_shim, weights_shim, all_finite, check, sundials_version

   !> What the callbacks find behind `user_data`.
   type :: callback_data
      class(ode_system), pointer :: system => null()
      real(wp) :: rtol = 0.0_wp
      real(wp) :: atol = 0.0_wp
      integer(i8) :: n_rhs = 0       !! calls of the right-hand side
      real(wp), allocatable :: recent(:, :) !! rates of the quadratures in the last calls, in turn, if somebody wants them
                                            !! (n_quadratures, calls)
      integer :: latest = 0          !! column of the last call
      integer :: last_stage = 0      !! column of the last stage of the last step, where it was noted
      real(wp) :: next_rate(n_quadratures) = 0.0_wp !! rates of the quadratures in the first call after a noted step
      logical :: next_awaited = .false. !! that call was not yet made
      logical :: refused = .false.   !! the last call said ok = .false.
      logical :: not_finite = .false. !! the last call gave NaN or infinity
      real(wp) :: t_refused = 0.0_wp !! time of the last bad call [s]
   end type callback_data

   !> Weight of a quadrature state. Not zero, because SUNDIALS inverts the weights when it chooses the first step.
   real(wp), parameter :: no_weight = 1.0e-100_wp

   interface
      integer(c_int) function get_version(version, length) bind(c, name='SUNDIALSGetVersion')
         import :: c_int, c_char
         implicit none (type, external)
         character(kind=c_char), intent(out) :: version(*)
         integer(c_int), intent(in), value :: length
      end function get_version

      !> Names of return codes. The caller frees the text; the Fortran interfaces of SUNDIALS would lose it.
      type(c_ptr) function cvode_flag_name(flag) bind(c, name='CVodeGetReturnFlagName')
         import :: c_ptr, c_long
         implicit none (type, external)
         integer(c_long), intent(in), value :: flag
      end function cvode_flag_name

      type(c_ptr) function erkstep_flag_name(flag) bind(c, name='ERKStepGetReturnFlagName')
         import :: c_ptr, c_long
         implicit none (type, external)
         integer(c_long), intent(in), value :: flag
      end function erkstep_flag_name

      !> The C library's free.
      subroutine c_release(address) bind(c, name='free')
         import :: c_ptr
         implicit none (type, external)
         type(c_ptr), intent(in), value :: address
      end subroutine c_release
   end interface

contains

   !> CVRhsFn and ARKRhsFn: 0 done, 1 recoverable (the step may be shortened).
   function rhs_shim(t, y, ydot, user_data) result(flag) bind(c)
      real(c_double), intent(in), value :: t
      type(N_Vector), intent(in) :: y, ydot
      type(c_ptr), intent(in), value :: user_data
      integer(c_int) :: flag

      type(callback_data), pointer :: data
      type(vector_content), pointer :: states, rates
      logical :: ok
      integer :: i

      call c_f_pointer(user_data, data)
      states => content_of(y)
      rates => content_of(ydot)
      data%n_rhs = data%n_rhs + 1
      call data%system%rhs(t, states%values, rates%values, ok)
      if (allocated(data%recent)) then
         data%latest = modulo(data%latest, size(data%recent, 2)) + 1
         do i = 1, n_quadratures ! one by one: an array behind pointers would be copied through the heap
            data%recent(i, data%latest) = rates%values(data%system%n_controlled + i)
         end do
         if (data%next_awaited) data%next_rate(:) = data%recent(:, data%latest)
         data%next_awaited = .false.
      end if
      flag = 0_c_int
      if (ok) then
         if (all_finite(rates%values)) return
      end if
      data%refused = .not. ok
      data%not_finite = ok
      data%t_refused = t
      flag = 1_c_int
   end function rhs_shim

   !> CVEwtFn and ARKEwtFn: w = 1/(rtol |y| + atol) for the controlled states, next to nothing for the quadratures.
   function weights_shim(y, w, user_data) result(flag) bind(c)
      type(N_Vector), intent(in) :: y, w
      type(c_ptr), intent(in), value :: user_data
      integer(c_int) :: flag

      type(callback_data), pointer :: data
      type(vector_content), pointer :: states, weights
      integer :: i

      call c_f_pointer(user_data, data)
      states => content_of(y)
      weights => content_of(w)
      do i = 1, states%n_controlled
         weights%values(i) = 1.0_wp/(data%rtol*abs(states%values(i)) + data%atol)
      end do
      weights%values(states%n_controlled + 1:) = no_weight
      flag = 0_c_int
   end function weights_shim

   !> True if no element is NaN or infinite. x - x is 0 for all others; a NaN would raise a trap in a comparison,
   !> so the exponent bits are looked at.
   pure function all_finite(x) result(finite)
      real(wp), intent(in) :: x(:)
      logical :: finite
      integer(i8), parameter :: exponent_bits = int(z'7FF0000000000000', i8)
      integer(i8) :: bits
      integer :: i

      finite = .true.
      do i = 1, size(x)
         bits = iand(transfer(x(i), bits), exponent_bits)
         if (bits == exponent_bits) finite = .false.
      end do
   end function all_finite

   !> The tail of a message for a return code below zero; the codes from -1 to -11 are the same in CVODE and ARKODE.
   pure function failure_text(flag) result(text)
      integer(c_int), intent(in) :: flag
      character(len=:), allocatable :: text
      select case (flag)
      case (-1); text = 'too many internal steps'
      case (-2); text = 'the tolerances ask for more than the working precision'
      case (-3); text = 'error test failures occurred too many times, or with the smallest step'
      case (-4); text = 'the nonlinear iteration failed too many times, or with the smallest step'
      case (-5); text = 'the linear solver could not be initialized'
      case (-6); text = 'the Jacobian or its factorization failed'
      case (-7); text = 'the linear solver failed'
      case (-8); text = 'the right-hand side failed'
      case (-9); text = 'the right-hand side failed at the first call'
      case (-10); text = 'the right-hand side failed repeatedly'
      case (-11); text = 'the right-hand side failed'
      case (-20); text = 'out of memory'
      case (-22); text = 'illegal input'
      case (-27); text = 'the interval is too short to start in'
      case default; text = 'failed'
      end select
   end function failure_text

   !> A negative return code becomes an error that names the call, the time and the code. An earlier error stays.
   subroutine check(error, flag, call_name, t)
      type(error_type), allocatable, intent(inout) :: error
      integer(c_int), intent(in) :: flag
      character(len=*), intent(in) :: call_name
      real(wp), intent(in), optional :: t !! [s]
      character(len=:), allocatable :: place
      type(c_ptr) :: name

      if (flag >= 0_c_int .or. allocated(error)) return
      if (index(call_name, 'ERKStep') == 1) then
         name = erkstep_flag_name(int(flag, c_long))
      else
         name = cvode_flag_name(int(flag, c_long))
      end if
      place = ''
      if (present(t)) place = ' at t = '//time_text(t)//' s'
      call raise(error, call_name//place//': '//failure_text(flag)//' ('//c_text(name)//')')
      if (c_associated(name)) call c_release(name)
   end subroutine check

   !> The version of the SUNDIALS library in use, like '6.4.1'.
   function sundials_version() result(text)
      character(len=:), allocatable :: text
      integer, parameter :: length = 40
      character(kind=c_char), target :: buffer(length)
      text = 'unknown'
      if (get_version(buffer, int(length, c_int)) == 0_c_int) text = c_text(c_loc(buffer))
   end function sundials_version

end module rodyn_sundials_base
