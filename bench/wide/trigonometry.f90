!> Sine and cosine in place of the program's, whose polynomials are those of double precision.
module rodyn_trigonometry
   use rodyn_kinds, only: wp
   implicit none (type, external)
   private
   public :: sine_cosine

contains

   !> s = sin(x), c = cos(x).
   pure subroutine sine_cosine(n, x, s, c)
      integer, intent(in) :: n
      real(wp), intent(in) :: x(n)  !! angles [rad]
      real(wp), intent(out) :: s(n)
      real(wp), intent(out) :: c(n)
      s = sin(x)
      c = cos(x)
   end subroutine sine_cosine

end module rodyn_trigonometry
