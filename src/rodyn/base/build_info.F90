!> Which program this is: version, commit, compiler.
!>
!> `tools/stamp_commit` writes the commit into `git_commit.inc` (ignored by git), and `tools/build` compiles with
!> -DRODYN_STAMPED, a flag that never changes, so that a new commit recompiles this file and not everything. A plain
!> `fpm build` has no stamp: the commit is 'unknown'.
module rodyn_build_info
   use, intrinsic :: iso_fortran_env, only: fortran_compiler => compiler_version, fortran_options => compiler_options
   implicit none (type, external)
   private
   public :: program_version, git_commit, compiler, compiler_options

   character(len=*), parameter :: program_version = '0.1.0'
#ifdef RODYN_STAMPED
   include 'git_commit.inc'
#else
   character(len=*), parameter :: git_commit = 'unknown'
#endif

contains

   !> Compiler and its version, as it calls itself.
   pure function compiler() result(text)
      character(len=:), allocatable :: text
      text = fortran_compiler()
   end function compiler

   !> Options this file was compiled with, and so, by fpm, all files.
   pure function compiler_options() result(text)
      character(len=:), allocatable :: text
      text = fortran_options()
   end function compiler_options

end module rodyn_build_info
