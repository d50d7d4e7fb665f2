!> A shard: a file of records that can be trusted word by word, whether it was sealed or its writer was killed.
!>
!> Header: magic; fingerprint of the plan; CRC-64 of these. Then records (`rodyn_sweep_record`), each appended when its
!> case is finished. Trailer: 0; number of records; CRC-64 of the CRCs of header and records, in their order.
!> Without a trailer the shard is open: somebody writes it, or did when he was killed. Its good records count all the same.
module rodyn_sweep_shard
   use rodyn_kinds, only: i8
   use rodyn_checksum, only: crc64
   use rodyn_sweep_case, only: case_shape
   use rodyn_sweep_record, only: fits_sweep, is_sound, shortest_record
   implicit none (type, external)
   private
   public :: shard_extent, shard_header, shard_trailer, sift_shard
   public :: header_words

   integer(i8), parameter :: magic = 3623237496189767506_i8 !! 'RODYNSH2'
   integer(i8), parameter :: end_mark = 0 !! in place of the length of a record
   integer, parameter :: header_words = 3, trailer_words = 3

   !> What a shard holds so far.
   type :: shard_extent
      integer :: used = 0        !! words: header and records
      integer :: n_records = 0
      integer(i8) :: total = 0   !! checksum of their checksums
      logical :: sealed = .false. !! a trailer follows
   contains
      procedure :: add
   end type shard_extent

contains

   pure function shard_header(fingerprint) result(words)
      integer(i8), intent(in) :: fingerprint
      integer(i8) :: words(header_words)
      words = [magic, fingerprint, crc64([magic, fingerprint])]
   end function shard_header

   pure function shard_trailer(extent) result(words)
      type(shard_extent), intent(in) :: extent
      integer(i8) :: words(trailer_words)
      words = [end_mark, int(extent%n_records, i8), extent%total]
   end function shard_trailer

   !> Note the header, or the next record.
   pure subroutine add(self, words)
      class(shard_extent), intent(inout) :: self
      integer(i8), intent(in) :: words(:)
      if (self%used > 0) self%n_records = self%n_records + 1
      self%used = self%used + size(words)
      self%total = crc64(words(size(words):), self%total)
   end subroutine add

   !> Tell the good records of a shard from the bad. On return `words(:extent%used)` is a header with the good ones. Where
   !> all is well nothing has moved, and `fault` is empty.
   pure subroutine sift_shard(words, fingerprint, shape, n_cases, extent, fault)
      integer(i8), intent(inout) :: words(:)
      integer(i8), intent(in) :: fingerprint
      type(case_shape), intent(in) :: shape
      integer, intent(in) :: n_cases
      type(shard_extent), intent(out) :: extent
      character(len=:), allocatable, intent(out) :: fault
      integer :: at, length, used

      call check_header(words, fingerprint, fault)
      if (len(fault) > 0) return
      call extent%add(words(:header_words))
      at = header_words + 1
      do while (at <= size(words))
         length = record_at(words(at:), shape, n_cases)
         if (length > 0) then
            used = extent%used
            if (at > used + 1) words(used + 1:used + length) = words(at:at + length - 1)
            call extent%add(words(used + 1:used + length))
            at = at + length
         else if (len(fault) == 0 .and. is_trailer(words(at:), extent)) then
            extent%sealed = .true.
            return
         else ! look for the next good record: there is hardly a word that could be its first but is not
            fault = 'wrong checksum'
            at = at + 1
         end if
      end do
   end subroutine sift_shard

   !> Length of the good record that begins here; 0: none does.
   pure integer function record_at(words, shape, n_cases) result(length)
      integer(i8), intent(in) :: words(:)
      type(case_shape), intent(in) :: shape
      integer, intent(in) :: n_cases

      length = 0
      if (words(1) < shortest_record .or. words(1) > size(words)) return
      associate (record => words(:int(words(1))))
         if (.not. is_sound(record)) return
         if (fits_sweep(record, shape, n_cases)) length = size(record)
      end associate
   end function record_at

   pure logical function is_trailer(words, extent)
      integer(i8), intent(in) :: words(:)
      type(shard_extent), intent(in) :: extent
      is_trailer = size(words) == trailer_words
      if (is_trailer) is_trailer = all(words == shard_trailer(extent))
   end function is_trailer

   !> Without a good header nothing that follows can be trusted.
   pure subroutine check_header(words, fingerprint, fault)
      integer(i8), intent(in) :: words(:)
      integer(i8), intent(in) :: fingerprint
      character(len=:), allocatable, intent(out) :: fault

      fault = ''
      if (size(words) < header_words) then
         fault = 'truncated'
      else if (words(1) /= magic .or. words(3) /= crc64(words(:2))) then
         fault = 'wrong header'
      else if (words(2) /= fingerprint) then
         fault = 'belongs to another sweep'
      end if
   end subroutine check_header

end module rodyn_sweep_shard
