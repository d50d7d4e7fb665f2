!> sweep.h5 in its directory: is it as it was merged, and if not, a new one.
!>
!> The journal has its checksum, written before it gets its name. So a sweep.h5 that the journal does not know is damaged,
!> or not ours; it is never overwritten, but renamed to sweep-1.h5, sweep-2.h5, ...
module rodyn_sweep_result
   use rodyn_kinds, only: i8
   use rodyn_errors, only: error_type, raise
   use rodyn_posix, only: parent_directory, path_exists, remove_file, rename_new, sync_path
   use rodyn_posix_files, only: file_checksum, rename_aside
   use rodyn_sweep_case, only: case_shape
   use rodyn_sweep_config, only: sweep_config
   use rodyn_sweep_directory, only: replaced_name, result_name
   use rodyn_sweep_index, only: sweep_index
   use rodyn_sweep_journal, only: write_journal
   use rodyn_sweep_merge, only: merge_sweep
   use rodyn_sweep_plan, only: sweep_plan
   implicit none (type, external)
   private
   public :: result_is_sound, write_result

contains

   !> Is it there, with every bit as it was merged from the results of the index?
   logical function result_is_sound(path, index)
      character(len=*), intent(in) :: path
      type(sweep_index), intent(in) :: index
      integer(i8) :: crc

      call file_checksum(path, crc, result_is_sound)
      if (result_is_sound) result_is_sound = index%has_merged(crc)
   end function result_is_sound

   !> Merge all results into sweep.h5. One that is there gets another name.
   subroutine write_result(directory, tag, sweep, plan, shape, index, aside, error)
      character(len=*), intent(in) :: directory, tag
      type(sweep_config), intent(in) :: sweep
      type(sweep_plan), intent(in) :: plan
      type(case_shape), intent(in) :: shape
      type(sweep_index), intent(inout) :: index
      character(len=:), allocatable, intent(out) :: aside !! new name of the old one; empty: there was none
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: failure, path, temporary
      integer(i8) :: crc
      logical :: readable, taken

      aside = ''
      path = directory//'/'//result_name
      temporary = path//'.partial'
      call merge_sweep(temporary, sweep, plan, shape, index, error)
      if (allocated(error)) return
      call file_checksum(temporary, crc, readable)
      if (.not. readable) then
         call raise(error, temporary//': cannot be read back; run again to merge')
         return
      end if
      call write_journal(directory, tag, 'merged', result_name, plan%n_cases, index%merge_mark(crc), error)
      if (allocated(error)) return
      failure = ''
      if (path_exists(path)) call rename_aside(path, directory//'/sweep', '.h5', aside, failure)
      if (len(failure) == 0) call rename_new(temporary, path, taken, failure)
      if (len(failure) == 0) failure = sync_path(parent_directory(path))
      if (len(failure) > 0) call raise(error, path//': cannot be written: '//failure// &
                                       '; all results are safe in the shards, run again to merge them')
      if (len(failure) == 0) failure = remove_file(directory//'/'//replaced_name) ! if there is one
   end subroutine write_result

end module rodyn_sweep_result
