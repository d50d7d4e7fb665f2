!> What the shared library knows of its build, as app/main.F90 does for the program.
module rodyn_shared
   use, intrinsic :: iso_c_binding, only: c_char, c_loc, c_null_char, c_ptr
   use rodyn_build_info, only: program_version, set_git_commit
   implicit none (type, external)
   private
   public :: initialize, version

   character(kind=c_char, len=*), parameter :: nul = c_null_char
   character(kind=c_char, len=len(program_version) + 1), target :: version_text = program_version//nul

contains

   !> To be called first.
   subroutine initialize() bind(c, name='rodyn_initialize')
#ifdef RODYN_STAMPED
      include 'git_commit.inc'
      call set_git_commit(git_commit)
#endif
   end subroutine initialize

   type(c_ptr) function version() bind(c, name='rodyn_version')
      version = c_loc(version_text)
   end function version

end module rodyn_shared
