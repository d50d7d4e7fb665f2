!> The program `rodyn`: arguments in, exit code out; everything else is in the library.
!>
!> `tools/stamp_commit` writes the commit into `git_commit.inc` (ignored by git) for builds with -DRODYN_STAMPED,
!> those of `tools/compile`.
program main
   use rodyn_build_info, only: set_git_commit
   use rodyn_command_line, only: run_command
   implicit none (type, external)
   integer :: exit_code
#ifdef RODYN_STAMPED
   include 'git_commit.inc'
   call set_git_commit(git_commit)
#endif

   call run_command(exit_code)
   stop exit_code, quiet=.true.
end program main
