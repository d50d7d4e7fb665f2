!> CRC-64 (polynomial of ECMA-182): any one flipped bit, and any burst of up to 64, changes it.
module rodyn_checksum
   use rodyn_kinds, only: i8
   implicit none (type, external)
   private
   public :: crc64, crc64_text, hexadecimal

   integer(i8), parameter :: polynomial = int(z'C96C5795D7870F42', i8) !! reflected

contains

   !> Checksum of words, as their bytes stand in memory (little endian).
   pure function crc64(words) result(crc)
      integer(i8), intent(in) :: words(:)
      integer(i8) :: crc
      integer(i8) :: table(0:255)
      integer :: i, byte

      table = new_table()
      crc = not(0_i8)
      do i = 1, size(words)
         crc = ieor(crc, words(i)) ! eight bytes at once: each step below takes one of them in
         do byte = 1, 8
            crc = ieor(ishft(crc, -8), table(iand(crc, 255_i8)))
         end do
      end do
      crc = not(crc)
   end function crc64

   !> Checksum of a text.
   pure function crc64_text(text) result(crc)
      character(len=*), intent(in) :: text
      integer(i8) :: crc
      integer(i8) :: table(0:255)
      integer :: i

      table = new_table()
      crc = not(0_i8)
      do i = 1, len(text)
         crc = ieor(ishft(crc, -8), table(iand(ieor(crc, int(iachar(text(i:i)), i8)), 255_i8)))
      end do
      crc = not(crc)
   end function crc64_text

   !> What each value of a byte does.
   pure function new_table() result(table)
      integer(i8) :: table(0:255)
      integer(i8) :: value
      integer :: bit, i

      do i = 0, 255
         value = int(i, i8)
         do bit = 1, 8
            value = merge(ieor(ishft(value, -1), polynomial), ishft(value, -1), btest(value, 0))
         end do
         table(i) = value
      end do
   end function new_table

   !> 16 hexadecimal digits.
   pure function hexadecimal(number) result(text)
      integer(i8), intent(in) :: number
      character(len=16) :: text
      write (text, '(z16.16)') number
   end function hexadecimal

end module rodyn_checksum
