!> CRC-64 (polynomial of ECMA-182): any one flipped bit, and any burst of up to 64, changes it.
module rodyn_checksum
   use rodyn_kinds, only: i8
   implicit none (type, external)
   private
   public :: crc64, crc64_text, hexadecimal

   integer(i8), parameter :: polynomial = int(z'C96C5795D7870F42', i8) !! reflected

   ! What each value of a byte does to the remainder: eight times "shift, and subtract the polynomial if a bit fell out".
   integer :: i
   integer(i8), parameter :: bits_0(0:255) = [(int(i, i8), i=0, 255)]
   integer(i8), parameter :: bits_1(0:255) = merge(ieor(ishft(bits_0, -1), polynomial), ishft(bits_0, -1), btest(bits_0, 0))
   integer(i8), parameter :: bits_2(0:255) = merge(ieor(ishft(bits_1, -1), polynomial), ishft(bits_1, -1), btest(bits_1, 0))
   integer(i8), parameter :: bits_3(0:255) = merge(ieor(ishft(bits_2, -1), polynomial), ishft(bits_2, -1), btest(bits_2, 0))
   integer(i8), parameter :: bits_4(0:255) = merge(ieor(ishft(bits_3, -1), polynomial), ishft(bits_3, -1), btest(bits_3, 0))
   integer(i8), parameter :: bits_5(0:255) = merge(ieor(ishft(bits_4, -1), polynomial), ishft(bits_4, -1), btest(bits_4, 0))
   integer(i8), parameter :: bits_6(0:255) = merge(ieor(ishft(bits_5, -1), polynomial), ishft(bits_5, -1), btest(bits_5, 0))
   integer(i8), parameter :: bits_7(0:255) = merge(ieor(ishft(bits_6, -1), polynomial), ishft(bits_6, -1), btest(bits_6, 0))
   integer(i8), parameter :: table(0:255) = merge(ieor(ishft(bits_7, -1), polynomial), ishft(bits_7, -1), btest(bits_7, 0))

contains

   !> Checksum of words, as their bytes stand in memory (little endian).
   pure function crc64(words, before) result(crc)
      integer(i8), intent(in) :: words(:)
      integer(i8), intent(in), optional :: before !! checksum of what precedes them; the result is then that of both
      integer(i8) :: crc
      integer :: byte, k

      crc = 0_i8
      if (present(before)) crc = before
      crc = not(crc)
      do k = 1, size(words)
         crc = ieor(crc, words(k)) ! eight bytes at once: each step below takes one of them in
         do byte = 1, 8
            crc = ieor(ishft(crc, -8), table(iand(crc, 255_i8)))
         end do
      end do
      crc = not(crc)
   end function crc64

   !> Checksum of a text.
   pure function crc64_text(text, before) result(crc)
      character(len=*), intent(in) :: text
      integer(i8), intent(in), optional :: before !! as in `crc64`
      integer(i8) :: crc
      integer :: k

      crc = 0_i8
      if (present(before)) crc = before
      crc = not(crc)
      do k = 1, len(text)
         crc = ieor(ishft(crc, -8), table(iand(ieor(crc, int(iachar(text(k:k)), i8)), 255_i8)))
      end do
      crc = not(crc)
   end function crc64_text

   !> 16 hexadecimal digits.
   pure function hexadecimal(number) result(text)
      integer(i8), intent(in) :: number
      character(len=16) :: text
      write (text, '(z16.16)') number
   end function hexadecimal

end module rodyn_checksum
