!> Which program this is: version, commit, compiler.
!>
!> The program says its commit first of all (`app/main.F90`), so that a new commit recompiles that file and nothing else. What
!> was not stamped, a plain `fpm build` or another project that uses the library, is of commit 'unknown'.
module rodyn_build_info
   use, intrinsic :: iso_fortran_env, only: fortran_compiler => compiler_version, fortran_options => compiler_options
   implicit none (type, external)
   private
   public :: program_version, git_commit, set_git_commit, compiler, compiler_options

   character(len=*), parameter :: program_version = '0.1.0'
   character(len=64) :: commit = 'unknown'

contains

   !> Commit of the program.
   function git_commit() result(text)
      character(len=:), allocatable :: text
      text = trim(commit)
   end function git_commit

   !> Say which commit the program is of.
   subroutine set_git_commit(text)
      character(len=*), intent(in) :: text
      commit = text
   end subroutine set_git_commit

   !> Compiler and its version, as it calls itself.
   pure function compiler() result(text)
      character(len=:), allocatable :: text
      text = fortran_compiler()
   end function compiler

   !> Options this file was compiled with, and so were all files.
   pure function compiler_options() result(text)
      character(len=:), allocatable :: text
      text = fortran_options()
   end function compiler_options

end module rodyn_build_info
