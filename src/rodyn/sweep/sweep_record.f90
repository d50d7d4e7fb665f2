!> The result of a case as a run of 64-bit words, and a shard as a file of them.
!>
!> Record: length in words; case; status; attempt; n_steps; n_rhs; t_reached; wall and integration seconds; bytes of the
!> message; the message; and, if the case is done, final state, probes, times and series.
!> Shard: magic; fingerprint of the plan; number of records; length in words; records; CRC-64 of all before it.
module rodyn_sweep_record
   use rodyn_kinds, only: wp, i8
   use rodyn_checksum, only: crc64
   use rodyn_sweep_case, only: case_result, case_shape, status_done, status_failed
   implicit none (type, external)
   private
   public :: append_record, decode_record, header_words, record_words, seal_words, check_shard
   public :: at_case, at_status, at_attempt

   integer(i8), parameter :: magic = 3551179902151839570_i8 !! 'RODYNSH1'
   integer, parameter :: header_words = 4, trailer_words = 1
   integer, parameter :: at_case = 1, at_status = 2, at_attempt = 3 !! words behind the first of a record
   integer, parameter :: fixed_words = 10, message_at = 9

contains

   !> Words of a record with a message of that length.
   pure integer function record_words(shape, status, message_length)
      type(case_shape), intent(in) :: shape
      integer, intent(in) :: status, message_length
      record_words = fixed_words + (message_length + 7)/8
      if (status == status_done) record_words = record_words + shape%n_states*(1 + shape%n_probes + shape%n_rows) + shape%n_rows
   end function record_words

   !> Write a record behind the words in use. There must be room for it.
   subroutine append_record(kept, shape, words, used)
      type(case_result), intent(in) :: kept
      type(case_shape), intent(in) :: shape
      integer(i8), intent(inout) :: words(:)
      integer, intent(inout) :: used
      integer :: at, i, n

      n = record_words(shape, kept%status, len(kept%message))
      at = used + 1
      words(at) = n
      words(at + at_case) = kept%case
      words(at + at_status) = kept%status
      words(at + at_attempt) = kept%attempt
      words(at + 4) = kept%n_steps
      words(at + 5) = kept%n_rhs
      words(at + 6) = transfer(kept%t_reached, 0_i8)
      words(at + 7) = transfer(kept%wall_seconds, 0_i8)
      words(at + 8) = transfer(kept%integration_seconds, 0_i8)
      words(at + message_at) = len(kept%message)
      at = at + fixed_words
      do i = 1, len(kept%message), 8
         words(at) = packed(kept%message(i:min(i + 7, len(kept%message))))
         at = at + 1
      end do
      used = used + n
      if (kept%status /= status_done) return
      call put(kept%final)
      do i = 1, shape%n_probes
         call put(kept%probes(:, i))
      end do
      call put(kept%times)
      do i = 1, shape%n_rows
         call put(kept%series(:, i))
      end do

   contains

      subroutine put(x)
         real(wp), intent(in) :: x(:)
         integer :: k
         do k = 1, size(x)
            words(at) = transfer(x(k), 0_i8)
            at = at + 1
         end do
      end subroutine put

   end subroutine append_record

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
      n_bytes = int(words(1 + message_at))
      at = fixed_words + 1
      kept%message = repeat(' ', n_bytes)
      do i = 1, n_bytes, 8
         call unpack(words(at), kept%message(i:min(i + 7, n_bytes)))
         at = at + 1
      end do
      if (kept%status /= status_done) return
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

   !> Make a shard of records that begin behind the header: fill header and trailer.
   pure subroutine seal_words(words, used, n_records, fingerprint)
      integer(i8), intent(inout) :: words(:) !! with room for the trailer
      integer, intent(inout) :: used         !! with the header; out: the whole shard
      integer, intent(in) :: n_records
      integer(i8), intent(in) :: fingerprint
      words(1) = magic
      words(2) = fingerprint
      words(3) = n_records
      words(4) = used + trailer_words
      words(used + 1) = crc64(words(:used))
      used = used + trailer_words
   end subroutine seal_words

   !> Why these words are no whole shard of this sweep; empty if they are. Every bit of the file counts.
   pure function check_shard(words, fingerprint, shape, n_cases) result(fault)
      integer(i8), intent(in) :: words(:)
      integer(i8), intent(in) :: fingerprint
      type(case_shape), intent(in) :: shape
      integer, intent(in) :: n_cases
      character(len=:), allocatable :: fault
      integer(i8) :: at, length, n
      integer :: last

      fault = 'truncated'
      last = size(words)
      if (last < header_words + trailer_words) return
      if (words(4) /= last) then
         if (crc64(words(:last - 1)) == words(last)) fault = 'wrong length'
         return
      end if
      fault = 'checksum wrong'
      if (words(1) /= magic .or. crc64(words(:last - 1)) /= words(last)) return
      fault = 'belongs to another sweep'
      if (words(2) /= fingerprint) return
      fault = 'records do not fit the sweep'
      at = header_words + 1
      do n = 1, words(3)
         if (at + fixed_words > last) return
         length = words(at)
         if (words(at + at_case) < 1 .or. words(at + at_case) > n_cases) return
         if (words(at + at_status) /= status_done .and. words(at + at_status) /= status_failed) return
         if (length /= record_words(shape, int(words(at + at_status)), int(words(at + message_at)))) return
         at = at + length
      end do
      if (at == last) fault = ''
   end function check_shard

end module rodyn_sweep_record
