!> The processes of a sweep; the only module that knows MPI.
!>
!> Started by mpirun or srun, a process is one of several ranks, otherwise it is alone and MPI is not even initialised.
!> Work is handed out by a counter that every rank may fetch and advance (one-sided, on the first rank), so that no rank
!> waits for another and none only serves.
module rodyn_sweep_ranks
   use, intrinsic :: iso_c_binding, only: c_f_pointer, c_ptr
   use mpi_f08, only: mpi_address_kind, mpi_any_source, mpi_any_tag, mpi_barrier, mpi_bcast, mpi_char, mpi_comm_rank, &
      mpi_comm_size, mpi_comm_world, mpi_fetch_and_op, mpi_finalize, mpi_info_null, mpi_init, mpi_integer, mpi_integer8, &
      mpi_iprobe, mpi_mode_nocheck, mpi_status_ignore, mpi_sum, mpi_win, mpi_win_allocate, mpi_win_flush, &
      mpi_win_free, mpi_win_lock_all, mpi_win_unlock_all
   use rodyn_kinds, only: i8
   use rodyn_launcher, only: launched_processes
   implicit none (type, external)
   private
   public :: rank_group, at_next, at_done, at_failed, at_stopped, at_errors

   !> Counters that all ranks share.
   integer, parameter :: at_next = 1    !! cases handed out
   integer, parameter :: at_done = 2    !! cases done in this run
   integer, parameter :: at_failed = 3  !! cases failed in this run
   integer, parameter :: at_stopped = 4 !! ranks that were asked to stop
   integer, parameter :: at_errors = 5  !! ranks that cannot go on
   integer, parameter :: n_counters = 5

   type :: rank_group
      integer :: rank = 0  !! 0: the first
      integer :: count = 1
      integer :: launched = 1 !! processes the launcher says it started
      logical, private :: parallel = .false.
      type(mpi_win), private :: window
      integer(i8), private :: counters(n_counters) = 0_i8 !! of a process that is alone
   contains
      procedure :: start
      procedure :: finish
      procedure :: add
      procedure :: progress
      procedure :: wait_for_all
      procedure :: share_text
      procedure :: share_integers
      procedure :: share_word
   end type rank_group

contains

   !> Find out who else there is.
   subroutine start(self)
      class(rank_group), intent(inout) :: self
      integer(i8), pointer :: shared(:)
      type(c_ptr) :: base
      integer(mpi_address_kind) :: bytes

      self%launched = launched_processes()
      if (self%launched == 1) return
      call mpi_init()
      call mpi_comm_rank(mpi_comm_world, self%rank)
      call mpi_comm_size(mpi_comm_world, self%count)
      self%parallel = .true.
      bytes = 0
      if (self%rank == 0) bytes = 8*n_counters
      call mpi_win_allocate(bytes, 8, mpi_info_null, mpi_comm_world, base, self%window)
      if (self%rank == 0) then
         call c_f_pointer(base, shared, [n_counters])
         shared = 0_i8
      end if
      call mpi_barrier(mpi_comm_world)
      call mpi_win_lock_all(mpi_mode_nocheck, self%window)
   end subroutine start

   !> All ranks together: the end.
   subroutine finish(self)
      class(rank_group), intent(inout) :: self
      if (.not. self%parallel) return
      call mpi_win_unlock_all(self%window)
      call mpi_win_free(self%window)
      call mpi_finalize()
      self%parallel = .false.
   end subroutine finish

   !> Advance a shared counter; its value before. With 0: look at it.
   integer(i8) function add(self, counter, amount) result(before)
      class(rank_group), intent(inout) :: self
      integer, intent(in) :: counter
      integer, intent(in) :: amount
      integer(i8) :: origin
      integer(mpi_address_kind) :: place

      if (.not. self%parallel) then
         before = self%counters(counter)
         self%counters(counter) = before + amount
         return
      end if
      origin = amount
      place = counter - 1
      call mpi_fetch_and_op(origin, before, mpi_integer8, 0, place, mpi_sum, self%window)
      call mpi_win_flush(0, self%window)
   end function add

   !> Let MPI work on what other ranks ask of this one, where the network cannot do that by itself.
   subroutine progress(self)
      class(rank_group), intent(inout) :: self
      logical :: there
      if (.not. self%parallel) return
      call mpi_iprobe(mpi_any_source, mpi_any_tag, mpi_comm_world, there, mpi_status_ignore)
   end subroutine progress

   subroutine wait_for_all(self)
      class(rank_group), intent(in) :: self
      if (self%parallel) call mpi_barrier(mpi_comm_world)
   end subroutine wait_for_all

   !> Give all ranks the text of the first.
   subroutine share_text(self, text)
      class(rank_group), intent(in) :: self
      character(len=:), allocatable, intent(inout) :: text
      integer :: length

      if (.not. self%parallel) return
      length = 0
      if (allocated(text)) length = len(text)
      call mpi_bcast(length, 1, mpi_integer, 0, mpi_comm_world)
      if (self%rank > 0) then
         if (allocated(text)) deallocate (text)
         allocate (character(len=length) :: text)
      end if
      if (length > 0) call mpi_bcast(text, length, mpi_char, 0, mpi_comm_world)
   end subroutine share_text

   !> Give all ranks the numbers of the first.
   subroutine share_integers(self, numbers)
      class(rank_group), intent(in) :: self
      integer, allocatable, intent(inout) :: numbers(:)
      integer :: length

      if (.not. self%parallel) return
      length = 0
      if (allocated(numbers)) length = size(numbers)
      call mpi_bcast(length, 1, mpi_integer, 0, mpi_comm_world)
      if (self%rank > 0) then
         if (allocated(numbers)) deallocate (numbers)
         allocate (numbers(length))
      end if
      if (length > 0) call mpi_bcast(numbers, length, mpi_integer, 0, mpi_comm_world)
   end subroutine share_integers

   subroutine share_word(self, word)
      class(rank_group), intent(in) :: self
      integer(i8), intent(inout) :: word
      if (self%parallel) call mpi_bcast(word, 1, mpi_integer8, 0, mpi_comm_world)
   end subroutine share_word

end module rodyn_sweep_ranks
