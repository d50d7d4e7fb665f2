!> Shards that are not as they should be: left open by a process that was killed, or damaged.
!>
!> One that was left open and is good to its end is sealed, as its writer would have done. Of any other the good records
!> go into a new shard, and the file itself stays, under the name NAME-1.damaged.
module rodyn_sweep_repair
   use rodyn_kinds, only: i8
   use rodyn_errors, only: error_type, raise
   use rodyn_growing_file, only: growing_file
   use rodyn_posix, only: path_exists
   use rodyn_posix_files, only: file_bytes, read_words, rename_aside, write_words
   use rodyn_sweep_case, only: case_shape
   use rodyn_sweep_journal, only: write_journal
   use rodyn_sweep_shard, only: shard_extent, shard_header, shard_trailer, sift_shard
   use rodyn_sweep_writer, only: open_ending, seal_file
   use rodyn_text, only: ends_with, joined, to_text
   implicit none (type, external)
   private
   public :: repair_shard

contains

   !> Repair one. No living process may write it, and no other may repair it now.
   subroutine repair_shard(directory, name, tag, fingerprint, shape, n_cases, notices, error)
      character(len=*), intent(in) :: directory
      character(len=*), intent(in) :: name !! of the shard, perhaps with `open_ending`
      character(len=*), intent(in) :: tag  !! of the journal
      integer(i8), intent(in) :: fingerprint
      type(case_shape), intent(in) :: shape
      integer, intent(in) :: n_cases
      character(len=:), allocatable, intent(inout) :: notices !! what was found, one line each
      type(error_type), allocatable, intent(out) :: error
      integer(i8), allocatable :: words(:)
      type(shard_extent) :: extent
      character(len=:), allocatable :: fault, path, sealed_name
      logical :: left_open, torn

      path = directory//'/shards/'//name
      if (.not. path_exists(path)) return ! another process has repaired it
      call read_words(path, words, torn)
      call sift_shard(words, fingerprint, shape, n_cases, extent, fault)
      if (torn .and. len(fault) == 0) fault = 'torn'
      left_open = ends_with(name, open_ending)
      sealed_name = name
      if (left_open) sealed_name = name(:len(name) - len(open_ending))
      if (.not. left_open .and. len(fault) == 0) then
         if (extent%sealed) return ! it could not be read for a moment
         fault = 'truncated'
      end if
      if (left_open .and. file_bytes(path) == 0) fault = '' ! killed before the first word
      if (len(fault) == 0 .and. path_exists(directory//'/shards/'//sealed_name)) fault = 'a sealed shard has its name'
      if (len(fault) == 0) then
         call finish(directory, sealed_name, tag, shard_header(fingerprint), extent, error)
      else
         call salvage(directory, name, sealed_name, tag, words(:extent%used), extent, error)
         if (.not. allocated(error)) notices = joined(notices, 'shard '//name//': '//fault//'; set aside, '// &
            to_text(extent%n_records)//' intact results of it are kept', new_line('a'))
      end if
   end subroutine repair_shard

   !> Seal a shard that was left open.
   subroutine finish(directory, name, tag, header, extent, error)
      character(len=*), intent(in) :: directory, name, tag
      integer(i8), intent(in) :: header(:)
      type(shard_extent), intent(inout) :: extent
      type(error_type), allocatable, intent(out) :: error
      type(growing_file) :: file
      character(len=:), allocatable :: failure, path

      path = directory//'/shards/'//name
      failure = file%reopen(path//open_ending)
      if (extent%used == 0 .and. len(failure) == 0) then
         failure = file%append(header)
         call extent%add(header)
      end if
      if (len(failure) == 0) failure = seal_file(file, path, extent)
      if (len(failure) == 0) then
         call write_journal(directory, tag, 'sealed', name, extent%n_records, extent%total, error)
      else
         call raise(error, path//open_ending//': cannot be sealed: '//failure//'; its results are safe, run again to resume')
      end if
   end subroutine finish

   !> Write the good records into a shard of their own, and rename the file they come from. A kill between the two leaves
   !> both, and the records in the shard are in it once more: equal, so it does not matter which of them counts.
   subroutine salvage(directory, name, sealed_name, tag, words, extent, error)
      character(len=*), intent(in) :: directory, name, sealed_name, tag
      integer(i8), intent(in) :: words(:) !! header and good records
      type(shard_extent), intent(in) :: extent
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: aside, failure, path, new_name

      path = directory//'/shards/'//name
      failure = ''
      if (extent%n_records > 0) then
         new_name = free_name(directory//'/shards/', sealed_name)
         failure = write_words(directory//'/shards/'//new_name, [words, shard_trailer(extent)])
         if (len(failure) == 0) call write_journal(directory, tag, 'sealed', new_name, extent%n_records, extent%total, error)
         if (allocated(error)) return
      end if
      if (len(failure) == 0) call rename_aside(path, path, '.damaged', aside, failure)
      if (len(failure) == 0) then
         call write_journal(directory, tag, 'aside', name, extent%n_records, extent%total, error)
      else
         call raise(error, path//': is damaged and cannot be set aside: '//failure)
      end if
   end subroutine salvage

   !> STEM.shard, STEM-1.shard, ...: the first that does not exist.
   function free_name(directory, sealed_name) result(name)
      character(len=*), intent(in) :: directory, sealed_name
      character(len=:), allocatable :: name
      integer :: i

      name = sealed_name
      do i = 1, huge(i) - 1
         if (.not. path_exists(directory//name)) return
         name = sealed_name(:index(sealed_name, '.shard') - 1)//'-'//to_text(i)//'.shard'
      end do
   end function free_name

end module rodyn_sweep_repair
