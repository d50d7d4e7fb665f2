!> SUNDIALS' tables of explicit Runge-Kutta pairs: Heun-Euler 2(1), Bogacki-Shampine 3(2), Zonneveld 4(3), Cash-Karp 5(4),
!> Verner 6(5), Fehlberg 8(7); order 7 is Fehlberg's pair with its two solutions exchanged.
module rodyn_erk_tableau
   use, intrinsic :: iso_c_binding, only: c_ptr, c_int, c_double, c_associated, c_f_pointer
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type, raise
   use farkode_mod, only: ARKODE_HEUN_EULER_2_1_2, ARKODE_BOGACKI_SHAMPINE_4_2_3, ARKODE_ZONNEVELD_5_3_4, &
      ARKODE_CASH_KARP_6_4_5, ARKODE_VERNER_8_5_6, ARKODE_FEHLBERG_13_7_8, FARKodeButcherTable_LoadERK, FARKodeButcherTable_Free
   implicit none (type, external)
   private
   public :: erk_tableau, load_table, copy_with_errors, first_same_as_last, default_order

   integer, parameter :: default_order = 6

   !> struct ARKodeButcherTableMem of arkode_butcher.h
   type, bind(c) :: butcher_table
      integer(c_int) :: order, embedded_order, stages
      type(c_ptr) :: a !! rows of the matrix
      type(c_ptr) :: c
      type(c_ptr) :: b
      type(c_ptr) :: d
   end type butcher_table

contains

   !> Coefficients of the table of an order.
   subroutine erk_tableau(order, a, b, c, error)
      integer, intent(in) :: order                 !! 2 to 8; 0: the default
      real(wp), allocatable, intent(out) :: a(:, :) !! (stages, stages): a(j, i) multiplies rate j in stage i
      real(wp), allocatable, intent(out) :: b(:), c(:) !! (stages)
      type(error_type), allocatable, intent(out) :: error

      type(c_ptr) :: address

      call load_table(merge(default_order, order, order == 0), address, error)
      if (allocated(error)) return
      call copy_table(address, a, b, c)
      call FARKodeButcherTable_Free(address)
   end subroutine erk_tableau

   !> SUNDIALS' table of an order, to be freed by the caller.
   subroutine load_table(order, address, error)
      integer, intent(in) :: order
      type(c_ptr), intent(out) :: address
      type(error_type), allocatable, intent(out) :: error

      type(c_ptr) :: swap
      type(butcher_table), pointer :: table

      select case (order)
      case (2); address = FARKodeButcherTable_LoadERK(ARKODE_HEUN_EULER_2_1_2)
      case (3); address = FARKodeButcherTable_LoadERK(ARKODE_BOGACKI_SHAMPINE_4_2_3)
      case (4); address = FARKodeButcherTable_LoadERK(ARKODE_ZONNEVELD_5_3_4)
      case (5); address = FARKodeButcherTable_LoadERK(ARKODE_CASH_KARP_6_4_5)
      case (6); address = FARKodeButcherTable_LoadERK(ARKODE_VERNER_8_5_6)
      case default; address = FARKodeButcherTable_LoadERK(ARKODE_FEHLBERG_13_7_8)
      end select
      if (.not. c_associated(address)) then
         call raise(error, 'ARKodeButcherTable_LoadERK: out of memory')
         return
      end if
      if (order /= 7) return
      call c_f_pointer(address, table)
      swap = table%b
      table%b = table%d
      table%d = swap
      table%order = 7_c_int
      table%embedded_order = 8_c_int
   end subroutine load_table

   !> The coefficients as arrays.
   subroutine copy_table(address, a, b, c, d)
      type(c_ptr), intent(in) :: address
      real(wp), allocatable, intent(out) :: a(:, :), b(:), c(:)
      real(wp), allocatable, intent(out), optional :: d(:) !! the embedded method's b

      type(butcher_table), pointer :: table
      type(c_ptr), pointer :: rows(:)
      real(c_double), pointer :: values(:)
      integer :: i, stages

      call c_f_pointer(address, table)
      stages = table%stages
      allocate (a(stages, stages))
      call c_f_pointer(table%a, rows, [stages])
      do i = 1, stages
         call c_f_pointer(rows(i), values, [stages])
         a(:, i) = values
      end do
      call c_f_pointer(table%b, values, [stages])
      b = values
      call c_f_pointer(table%c, values, [stages])
      c = values
      if (.not. present(d)) return
      call c_f_pointer(table%d, values, [stages])
      d = values
   end subroutine copy_table

   !> The coefficients, and weights of rates whose sums are errors.
   subroutine copy_with_errors(address, a, b, c, b_error, b_doubt)
      type(c_ptr), intent(in) :: address
      real(wp), allocatable, intent(out) :: a(:, :), b(:), c(:)
      real(wp), allocatable, intent(out) :: b_error(:) !! b less that of the embedded method
      real(wp), allocatable, intent(out) :: b_doubt(:) !! of `second_look`
      call copy_table(address, a, b, c, b_error)
      b_error(:) = b - b_error
      b_doubt = second_look(c, b_error)
   end subroutine copy_with_errors

   !> Weights that, like given ones, are blind to polynomials up to some degree, but see others of higher degree: a divided
   !> difference, orthogonal to the given weights and of their length. An error that these miss by chance is seen by those.
   pure function second_look(c, weights) result(others)
      real(wp), intent(in) :: c(:)       !! times of the stages, as shares of the step
      real(wp), intent(in) :: weights(:)
      real(wp) :: others(size(c))        !! 0 if there are none
      logical :: distinct(size(c))
      integer :: i, degree

      degree = 0
      do while (degree < size(c) .and. abs(sum(weights*c**degree)) < 1.0e-10_wp) ! 0**0 = 1
         degree = degree + 1
      end do
      distinct = [(all(abs(c(:i - 1) - c(i)) > 1.0e-10_wp), i=1, size(c))]
      others = 0.0_wp
      if (count(distinct) < degree + 2) return
      do i = size(c), 1, -1 ! of the last ones
         if (count(distinct(i:)) > degree + 1) distinct(i) = .false.
      end do
      do i = 1, size(c)
         if (distinct(i)) others(i) = 1.0_wp/product(c(i) - c, mask=distinct .and. abs(c(i) - c) > 0.0_wp)
      end do
      others = others - weights*(sum(others*weights)/sum(weights**2))
      others = others*(norm2(weights)/norm2(others))
   end function second_look

   !> True if the last stage is the new state, so that its rate may begin the next step.
   !>
   !> SUNDIALS before 6.7 takes this for granted as soon as c_s = 1. For Verner's and Fehlberg's tables that is wrong
   !> and costs the order: 3 is observed instead of 6. A postprocessing function, even one that does nothing,
   !> makes ERKStep evaluate the rate at the new state.
   pure function first_same_as_last(a, b) result(same)
      real(wp), intent(in) :: a(:, :), b(:)
      logical :: same
      same = all(abs(a(:, size(b)) - b) <= epsilon(1.0_wp))
   end function first_same_as_last

end module rodyn_erk_tableau
