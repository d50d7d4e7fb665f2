!> The result of a case as a run of 64-bit words that proves itself.
!>
!> Record: length in words; case; status; attempt; n_steps; n_rhs; t_reached; wall and integration seconds; bytes of the
!> message; the message; if the case is done, frequencies, damping ratios, final state, probes, times and series; CRC-64 of all
!> before it.
module rodyn_sweep_record
   use rodyn_kinds, only: wp, i8
   use rodyn_checksum, only: crc64
   use rodyn_sweep_case, only: case_result, case_shape, status_done, status_failed
   implicit none (type, external)
   private
   public :: record_words, encode_record, decode_record, is_sound, fits_sweep
   public :: shortest_record, at_case, at_status, at_attempt, at_message

   integer, parameter :: at_case = 1, at_status = 2, at_attempt = 3, at_message = 9 !! words behind the first of a record
   integer, parameter :: fixed_words = 10
   integer, parameter :: shortest_record = fixed_words + 1

contains

   !> Words of a record with a message of that length.
   pure integer function record_words(shape, status, message_length)
      type(case_shape), intent(in) :: shape
      integer, intent(in) :: status, message_length
      record_words = shortest_record + (message_length + 7)/8
      if (status == status_done) record_words = record_words + 2*shape%n_modes + &
                                                shape%layout%n_values*(1 + shape%n_probes + shape%n_rows) + shape%n_rows
   end function record_words

   !> Write a record into the first `n` words.
   subroutine encode_record(kept, shape, words, n)
      type(case_result), intent(in) :: kept
      type(case_shape), intent(in) :: shape
      integer(i8), intent(inout) :: words(:) !! with room for `record_words`
      integer, intent(out) :: n
      integer :: at, i

      n = record_words(shape, kept%status, len(kept%message))
      words(1) = n
      words(1 + at_case) = kept%case
      words(1 + at_status) = kept%status
      words(1 + at_attempt) = kept%attempt
      words(5) = kept%n_steps
      words(6) = kept%n_rhs
      words(7) = transfer(kept%t_reached, 0_i8)
      words(8) = transfer(kept%wall_seconds, 0_i8)
      words(9) = transfer(kept%integration_seconds, 0_i8)
      words(1 + at_message) = len(kept%message)
      at = fixed_words + 1
      do i = 1, len(kept%message), 8
         words(at) = packed(kept%message(i:min(i + 7, len(kept%message))))
         at = at + 1
      end do
      if (kept%status == status_done) then
         call put(kept%frequency)
         call put(kept%damping_ratio)
         call put(kept%final)
         do i = 1, shape%n_probes
            call put(kept%probes(:, i))
         end do
         call put(kept%times)
         do i = 1, shape%n_rows
            call put(kept%series(:, i))
         end do
      end if
      words(n) = crc64(words(:n - 1))

   contains

      subroutine put(x)
         real(wp), intent(in) :: x(:)
         integer :: k
         do k = 1, size(x)
            words(at) = transfer(x(k), 0_i8)
            at = at + 1
         end do
      end subroutine put

   end subroutine encode_record

   !> Read a record. Arrays of `kept` are allocated; those of a case that is not done are left as they are.
   subroutine decode_record(words, shape, kept)
      integer(i8), intent(in) :: words(:) !! the record
      type(case_shape), intent(in) :: shape
      type(case_result), intent(inout) :: kept
      integer :: at, i, n_bytes

      kept%case = int(words(1 + at_case))
      kept%status = int(words(1 + at_status))
      kept%attempt = int(words(1 + at_attempt))
      kept%n_steps = words(5)
      kept%n_rhs = words(6)
      kept%t_reached = transfer(words(7), 0.0_wp)
      kept%wall_seconds = transfer(words(8), 0.0_wp)
      kept%integration_seconds = transfer(words(9), 0.0_wp)
      n_bytes = int(words(1 + at_message))
      at = fixed_words + 1
      kept%message = repeat(' ', n_bytes)
      do i = 1, n_bytes, 8
         call unpack(words(at), kept%message(i:min(i + 7, n_bytes)))
         at = at + 1
      end do
      if (kept%status /= status_done) return
      call get(kept%frequency)
      call get(kept%damping_ratio)
      call get(kept%final)
      do i = 1, shape%n_probes
         call get(kept%probes(:, i))
      end do
      call get(kept%times)
      do i = 1, shape%n_rows
         call get(kept%series(:, i))
      end do

   contains

      subroutine get(x)
         real(wp), intent(out) :: x(:)
         integer :: k
         do k = 1, size(x)
            x(k) = transfer(words(at), 0.0_wp)
            at = at + 1
         end do
      end subroutine get

   end subroutine decode_record

   !> Up to eight characters in a word.
   pure integer(i8) function packed(text)
      character(len=*), intent(in) :: text
      integer :: i
      packed = 0_i8
      do i = 1, len(text)
         packed = ior(packed, ishft(int(iachar(text(i:i)), i8), 8*(i - 1)))
      end do
   end function packed

   pure subroutine unpack(word, text)
      integer(i8), intent(in) :: word
      character(len=*), intent(out) :: text
      integer :: i
      do i = 1, len(text)
         text(i:i) = achar(int(iand(ishft(word, -8*(i - 1)), 255_i8)))
      end do
   end subroutine unpack

   !> Are these words as they were written? Every bit of them counts.
   pure logical function is_sound(words)
      integer(i8), intent(in) :: words(:) !! as long as their first says
      is_sound = crc64(words(:size(words) - 1)) == words(size(words))
   end function is_sound

   !> May this sound record be a result of the sweep?
   pure logical function fits_sweep(words, shape, n_cases)
      integer(i8), intent(in) :: words(:)
      type(case_shape), intent(in) :: shape
      integer, intent(in) :: n_cases

      associate (case => words(1 + at_case), status => words(1 + at_status))
         fits_sweep = case >= 1 .and. case <= n_cases .and. (status == status_done .or. status == status_failed)
         if (fits_sweep) fits_sweep = size(words) == record_words(shape, int(status), int(words(1 + at_message)))
      end associate
   end function fits_sweep

end module rodyn_sweep_record
