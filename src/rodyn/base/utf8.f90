!> Is a text UTF-8? What is read from a file travels on into HDF5 attributes, which have to be.
module rodyn_utf8
   implicit none (type, external)
   private
   public :: first_bad_byte

contains

   !> Position of the first byte that is NUL or no part of a UTF-8 sequence; 0 if there is none.
   pure integer function first_bad_byte(text) result(bad)
      character(len=*), intent(in) :: text
      integer :: i, tail

      bad = 0
      i = 1
      do while (i <= len(text))
         tail = tail_length(ichar(text(i:i)))
         if (tail < 0 .or. i + tail > len(text)) bad = i
         if (bad == 0) then
            if (.not. is_tail(text(i:i + tail))) bad = i
         end if
         if (bad > 0) return
         i = i + tail + 1
      end do
   end function first_bad_byte

   !> Bytes that follow a leading byte; -1 for a byte that leads nothing.
   pure integer function tail_length(code)
      integer, intent(in) :: code
      select case (code)
      case (1:127)
         tail_length = 0
      case (194:223)
         tail_length = 1
      case (224:239)
         tail_length = 2
      case (240:244)
         tail_length = 3
      case default
         tail_length = -1
      end select
   end function tail_length

   !> Are the bytes after the first continuation bytes, and the sequence neither overlong nor out of range?
   pure logical function is_tail(bytes)
      character(len=*), intent(in) :: bytes
      integer :: i, second

      is_tail = .true.
      do i = 2, len(bytes)
         if (iand(ichar(bytes(i:i)), 192) /= 128) is_tail = .false.
      end do
      if (len(bytes) < 3) return
      second = ichar(bytes(2:2))
      select case (ichar(bytes(1:1)))
      case (224, 240) ! overlong
         is_tail = is_tail .and. second >= merge(160, 144, ichar(bytes(1:1)) == 224)
      case (237, 244) ! halves of UTF-16 pairs; beyond the last code
         is_tail = is_tail .and. second <= merge(159, 143, ichar(bytes(1:1)) == 237)
      case default
         continue
      end select
   end function is_tail

end module rodyn_utf8
