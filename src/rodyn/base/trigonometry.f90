!> Sine and cosine of many angles at once, in a form that compilers turn into vector instructions.
!>
!> The library functions are called one angle at a time and took more than half of a right-hand side. This is
!> their classic algorithm without branches: reduction by multiples of pi/2 in three parts (Cody & Waite) that
!> keeps the rounding error of the reduced angle, then the minimax polynomials of fdlibm (k_sin.c, k_cos.c,
!> Sun Microsystems 1993), summed in pairs for speed. Error below 1 unit in the last place; angles beyond
!> `largest` go to the library.
module rodyn_trigonometry
   use rodyn_kinds, only: wp, i8
   implicit none (type, external)
   private
   public :: sine_cosine

   real(wp), parameter :: largest = 5.0e5_wp !! [rad]; the quadrant number then fits the exact products below

   real(wp), parameter :: two_over_pi = 6.36619772367581382433e-01_wp
   real(wp), parameter :: pio2_1 = 1.57079632673412561417_wp      !! first 33 bits of pi/2
   real(wp), parameter :: pio2_2 = 6.07710050630396597660e-11_wp  !! next 33 bits
   real(wp), parameter :: pio2_2t = 2.02226624879595063154e-21_wp !! pi/2 - pio2_1 - pio2_2
   real(wp), parameter :: to_integer = 6755399441055744.0_wp      !! 1.5 * 2^52: adding it rounds to an integer

   real(wp), parameter :: s1 = -1.66666666666666324348e-01_wp, s2 = 8.33333333332248946124e-03_wp, &
                          s3 = -1.98412698298579493134e-04_wp, s4 = 2.75573137070700676789e-06_wp, &
                          s5 = -2.50507602534068634195e-08_wp, s6 = 1.58969099521155010221e-10_wp
   real(wp), parameter :: c1 = 4.16666666666666019037e-02_wp, c2 = -1.38888888888741095749e-03_wp, &
                          c3 = 2.48015872894767294178e-05_wp, c4 = -2.75573143513906633035e-07_wp, &
                          c5 = 2.08757232129817482790e-09_wp, c6 = -1.13596475577881948265e-11_wp

contains

   !> s = sin(x), c = cos(x).
   pure subroutine sine_cosine(n, x, s, c)
      integer, intent(in) :: n
      real(wp), intent(in) :: x(n)  !! angles [rad]
      real(wp), intent(out) :: s(n)
      real(wp), intent(out) :: c(n)
      real(wp) :: shifted, quadrants, r0, w, r1, lost, r, tail, z, z2, v, hz, sin_r, cos_r
      integer(i8) :: quadrant, odd, sin_bits, cos_bits, outside
      integer :: i

      outside = 0_i8
      do i = 1, n
         ! Reduced angle r + tail = x - quadrants*pi/2; r0 and w are exact.
         shifted = x(i)*two_over_pi + to_integer
         quadrants = shifted - to_integer
         r0 = x(i) - quadrants*pio2_1
         w = quadrants*pio2_2
         r1 = r0 - w
         lost = quadrants*pio2_2t - ((r0 - r1) - w)
         r = r1 - lost
         tail = (r1 - r) - lost

         z = r*r
         v = z*r
         z2 = z*z
         sin_r = r - ((z*(0.5_wp*tail - v*((s2 + z*s3) + z2*((s4 + z*s5) + z2*s6))) - tail) - v*s1)
         hz = 0.5_wp*z
         w = 1.0_wp - hz
         cos_r = w + (((1.0_wp - w) - hz) + (z2*((c1 + z*c2) + z2*((c3 + z*c4) + z2*(c5 + z*c6))) - r*tail))

         ! Odd quadrants swap sine and cosine; bit 1 of the quadrant number gives the signs.
         quadrant = transfer(shifted, quadrant)
         odd = -iand(quadrant, 1_i8)
         sin_bits = transfer(sin_r, sin_bits)
         cos_bits = transfer(cos_r, cos_bits)
         s(i) = transfer(ieor(ieor(sin_bits, iand(odd, ieor(sin_bits, cos_bits))), &
                              ishft(iand(quadrant, 2_i8), 62)), 0.0_wp)
         c(i) = transfer(ieor(ieor(cos_bits, iand(odd, ieor(sin_bits, cos_bits))), &
                              ishft(iand(quadrant + 1_i8, 2_i8), 62)), 0.0_wp)
         outside = ior(outside, merge(0_i8, 1_i8, abs(x(i)) <= largest))
      end do
      if (outside == 0_i8) return
      do i = 1, n
         if (abs(x(i)) <= largest) cycle
         s(i) = sin(x(i))
         c(i) = cos(x(i))
      end do
   end subroutine sine_cosine

end module rodyn_trigonometry
