!> Gragg's extrapolated midpoint rule (Hairer, Norsett & Wanner, Solving ODEs I, sec. II.9).
module rodyn_bench_extrapolation
   use rodyn_bench_wide_kind, only: qp
   implicit none (type, external)
   private
   public :: smooth_system, extrapolated_step, order, evaluations

   integer, parameter :: columns = 10                        !! of the table
   integer, parameter :: order = 2*columns                   !! of the result
   integer, parameter :: evaluations = columns*(columns + 1) + 1 !! right-hand sides of a step

   !> y' = f(t, y)
   type, abstract :: smooth_system
   contains
      procedure(rates_interface), deferred :: rates
   end type smooth_system

   abstract interface
      subroutine rates_interface(self, t, y, rate)
         import :: smooth_system, qp
         implicit none (type, external)
         class(smooth_system), intent(inout) :: self
         real(qp), intent(in) :: t                !! [s]
         real(qp), contiguous, intent(in) :: y(:)
         real(qp), contiguous, intent(out) :: rate(:)
      end subroutine rates_interface
   end interface

contains

   !> y at t becomes y at t + h: the midpoint rule with 2, 4, ... 2 columns substeps, extrapolated.
   subroutine extrapolated_step(system, t, h, y, change)
      class(smooth_system), intent(inout) :: system
      real(qp), intent(in) :: t, h                    !! [s]
      real(qp), contiguous, intent(inout) :: y(:)
      real(qp), intent(out), optional :: change(:)    !! by the last column: an estimate of the error, on the safe side
      real(qp), dimension(size(y)) :: before, now, next, rate, first
      real(qp) :: table(size(y), columns), d
      integer :: i, j, k

      call system%rates(t, y, first)
      do j = 1, columns
         d = h/(2*j)
         before = y
         now = y + d*first
         do i = 1, 2*j
            call system%rates(t + i*d, now, rate)
            if (i == 2*j) exit
            next = before + 2.0_qp*d*rate
            before = now
            now = next
         end do
         table(:, j) = 0.5_qp*(now + before + d*rate)
         do k = j - 1, 1, -1 ! table(:, k) becomes T(j, j - k + 1)
            table(:, k) = table(:, k + 1) + (table(:, k + 1) - table(:, k))/((real(j, qp)/k)**2 - 1.0_qp)
         end do
      end do
      y = table(:, 1)
      if (present(change)) change = table(:, 1) - table(:, 2)
   end subroutine extrapolated_step

end module rodyn_bench_extrapolation
