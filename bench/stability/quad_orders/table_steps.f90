!> Explicit Runge-Kutta steps by a table of SUNDIALS. It has them in double precision, but they are ratios of small integers, which
!> are found again here.
module table_steps
   use rodyn_kinds, only: wp
   use smooth_problems, only: smooth_problem
   implicit none (type, external)
   private
   public :: table_type, read_table, steps_by_table

   type :: table_type
      integer :: order = 0
      real(wp), allocatable :: a(:, :) !! (stages, stages): a(j, i) multiplies rate j in stage i
      real(wp), allocatable :: b(:)    !! (stages)
   end type table_type

contains

   !> The next table of the input: order and stages, then b and the columns of a. False at its end.
   logical function read_table(table)
      type(table_type), intent(out) :: table
      integer :: stages, status

      read (*, *, iostat=status) table%order, stages
      read_table = status == 0
      if (.not. read_table) return
      allocate (table%a(stages, stages), table%b(stages))
      read (*, *) table%b, table%a
      table%a = rational(table%a)
      table%b = rational(table%b)
      if (abs(sum(table%b) - 1.0_wp) > 1.0e-30_wp) error stop 'a table is not what it was taken for'
   end function read_table

   !> The first convergent of the continued fraction of x that is x in double precision.
   elemental real(wp) function rational(x)
      real(wp), intent(in) :: x
      real(wp) :: rest, p(2), q(2)

      p = [1.0_wp, aint(x)]
      q = [0.0_wp, 1.0_wp]
      rest = x - aint(x)
      do while (abs(p(2)/q(2) - x) > 1.2e-16_wp*abs(x))
         rest = 1.0_wp/rest
         p = [p(2), aint(rest)*p(2) + p(1)]
         q = [q(2), aint(rest)*q(2) + q(1)]
         rest = rest - aint(rest)
      end do
      rational = p(2)/q(2)
   end function rational

   !> State after n steps of length h.
   function steps_by_table(table, system, y0, h, n) result(y)
      type(table_type), intent(in) :: table
      class(smooth_problem), intent(inout) :: system
      real(wp), intent(in) :: y0(:), h
      integer, intent(in) :: n
      real(wp) :: y(size(y0)), rate(size(y0), size(table%b))
      logical :: ok
      integer :: step, i

      y = y0
      do step = 1, n
         do i = 1, size(table%b)
            call system%rhs(0.0_wp, y + h*matmul(rate(:, :i - 1), table%a(:i - 1, i)), rate(:, i), ok)
         end do
         y = y + h*matmul(rate, table%b)
      end do
   end function steps_by_table

end module table_steps
