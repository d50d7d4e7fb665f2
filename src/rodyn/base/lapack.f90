!> The LAPACK and BLAS routines in use, with their interfaces; the only module that names them.
module rodyn_lapack
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type, raise
   use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_f_procpointer, c_funptr, c_int, c_null_char, c_null_ptr, &
      c_ptr
   implicit none (type, external)
   private
   public :: use_one_thread, symmetric_eigenvalues
   public :: dpotrf, dpotrs, dpstrf, dgesv, dgetrf, dgetrs, dsyev, dsyevd, dgeev, dgeevx, dgemv, dgemm, dtrsm

   interface
      !> Cholesky factors of a symmetric positive definite matrix.
      pure subroutine dpotrf(uplo, n, a, lda, info)
         import :: wp
         implicit none (type, external)
         character(len=1), intent(in) :: uplo
         integer, intent(in) :: n, lda
         real(wp), intent(inout) :: a(lda, *)
         integer, intent(out) :: info
      end subroutine dpotrf

      !> Cholesky factorisation of a semidefinite matrix, rows and columns interchanged.
      pure subroutine dpstrf(uplo, n, a, lda, piv, rank, tol, work, info)
         import :: wp
         implicit none (type, external)
         character(len=1), intent(in) :: uplo
         integer, intent(in) :: n, lda
         real(wp), intent(inout) :: a(lda, *)
         integer, intent(out) :: piv(*), rank, info
         real(wp), intent(in) :: tol
         real(wp), intent(out) :: work(*)
      end subroutine dpstrf

      !> Solve with the factors of dpotrf.
      pure subroutine dpotrs(uplo, n, nrhs, a, lda, b, ldb, info)
         import :: wp
         implicit none (type, external)
         character(len=1), intent(in) :: uplo
         integer, intent(in) :: n, nrhs, lda, ldb
         real(wp), intent(in) :: a(lda, *)
         real(wp), intent(inout) :: b(ldb, *)
         integer, intent(out) :: info
      end subroutine dpotrs

      !> Solve a triangular system for many right-hand sides.
      pure subroutine dtrsm(side, uplo, transa, diag, m, n, alpha, a, lda, b, ldb)
         import :: wp
         implicit none (type, external)
         character(len=1), intent(in) :: side, uplo, transa, diag
         integer, intent(in) :: m, n, lda, ldb
         real(wp), intent(in) :: alpha, a(lda, *)
         real(wp), intent(inout) :: b(ldb, *)
      end subroutine dtrsm

      !> Solve a general system by LU with pivoting.
      pure subroutine dgesv(n, nrhs, a, lda, ipiv, b, ldb, info)
         import :: wp
         implicit none (type, external)
         integer, intent(in) :: n, nrhs, lda, ldb
         real(wp), intent(inout) :: a(lda, *)
         integer, intent(out) :: ipiv(*)
         real(wp), intent(inout) :: b(ldb, *)
         integer, intent(out) :: info
      end subroutine dgesv

      !> LU factors of a general matrix, rows exchanged.
      pure subroutine dgetrf(m, n, a, lda, ipiv, info)
         import :: wp
         implicit none (type, external)
         integer, intent(in) :: m, n, lda
         real(wp), intent(inout) :: a(lda, *)
         integer, intent(out) :: ipiv(*)
         integer, intent(out) :: info
      end subroutine dgetrf

      !> Solve with the factors of dgetrf.
      pure subroutine dgetrs(trans, n, nrhs, a, lda, ipiv, b, ldb, info)
         import :: wp
         implicit none (type, external)
         character(len=1), intent(in) :: trans
         integer, intent(in) :: n, nrhs, lda, ldb
         real(wp), intent(in) :: a(lda, *)
         integer, intent(in) :: ipiv(*)
         real(wp), intent(inout) :: b(ldb, *)
         integer, intent(out) :: info
      end subroutine dgetrs

      !> Eigenvalues (ascending) and vectors of A x = lambda B x, A symmetric, B positive definite.
      pure subroutine dsygvd(itype, jobz, uplo, n, a, lda, b, ldb, w, work, lwork, iwork, liwork, info)
         import :: wp
         implicit none (type, external)
         integer, intent(in) :: itype, n, lda, ldb, lwork, liwork
         character(len=1), intent(in) :: jobz, uplo
         real(wp), intent(inout) :: a(lda, *), b(ldb, *)
         real(wp), intent(out) :: w(*)
         real(wp), intent(inout) :: work(*)
         integer, intent(inout) :: iwork(*)
         integer, intent(out) :: info
      end subroutine dsygvd

      !> Eigenvalues (ascending) and vectors of a symmetric matrix.
      pure subroutine dsyev(jobz, uplo, n, a, lda, w, work, lwork, info)
         import :: wp
         implicit none (type, external)
         character(len=1), intent(in) :: jobz, uplo
         integer, intent(in) :: n, lda, lwork
         real(wp), intent(inout) :: a(lda, *)
         real(wp), intent(out) :: w(*)
         real(wp), intent(inout) :: work(*)
         integer, intent(out) :: info
      end subroutine dsyev

      !> The same by divide and conquer, faster for large matrices.
      pure subroutine dsyevd(jobz, uplo, n, a, lda, w, work, lwork, iwork, liwork, info)
         import :: wp
         implicit none (type, external)
         character(len=1), intent(in) :: jobz, uplo
         integer, intent(in) :: n, lda, lwork, liwork
         real(wp), intent(inout) :: a(lda, *)
         real(wp), intent(out) :: w(*)
         real(wp), intent(inout) :: work(*)
         integer, intent(inout) :: iwork(*)
         integer, intent(out) :: info
      end subroutine dsyevd

      !> Eigenvalues, left and right vectors of a general matrix.
      pure subroutine dgeev(jobvl, jobvr, n, a, lda, wr, wi, vl, ldvl, vr, ldvr, work, lwork, info)
         import :: wp
         implicit none (type, external)
         character(len=1), intent(in) :: jobvl, jobvr
         integer, intent(in) :: n, lda, ldvl, ldvr, lwork
         real(wp), intent(inout) :: a(lda, *)
         real(wp), intent(out) :: wr(*), wi(*), vl(ldvl, *), vr(ldvr, *)
         real(wp), intent(inout) :: work(*)
         integer, intent(out) :: info
      end subroutine dgeev

      !> The same with the condition of each eigenvalue: |left . right| of its unit vectors, as the balanced matrix has them.
      pure subroutine dgeevx(balanc, jobvl, jobvr, sense, n, a, lda, wr, wi, vl, ldvl, vr, ldvr, ilo, ihi, scale, abnrm, &
                             rconde, rcondv, work, lwork, iwork, info)
         import :: wp
         implicit none (type, external)
         character(len=1), intent(in) :: balanc, jobvl, jobvr, sense
         integer, intent(in) :: n, lda, ldvl, ldvr, lwork
         real(wp), intent(inout) :: a(lda, *), vl(ldvl, *), vr(ldvr, *), work(*)
         real(wp), intent(out) :: wr(*), wi(*), scale(*), abnrm
         real(wp), intent(inout) :: rconde(*), rcondv(*)
         integer, intent(out) :: ilo, ihi, info
         integer, intent(inout) :: iwork(*)
      end subroutine dgeevx

      !> y <- alpha A x + beta y.
      pure subroutine dgemv(trans, m, n, alpha, a, lda, x, incx, beta, y, incy)
         import :: wp
         implicit none (type, external)
         character(len=1), intent(in) :: trans
         integer, intent(in) :: m, n, lda, incx, incy
         real(wp), intent(in) :: alpha, beta
         real(wp), intent(in) :: a(lda, *), x(*)
         real(wp), intent(inout) :: y(*)
      end subroutine dgemv

      !> C = alpha op(A) op(B) + beta C.
      pure subroutine dgemm(transa, transb, m, n, k, alpha, a, lda, b, ldb, beta, c, ldc)
         import :: wp
         implicit none (type, external)
         character(len=1), intent(in) :: transa, transb
         integer, intent(in) :: m, n, k, lda, ldb, ldc
         real(wp), intent(in) :: alpha, a(lda, *), b(ldb, *), beta
         real(wp), intent(inout) :: c(ldc, *)
      end subroutine dgemm
   end interface

contains

   !> Eigenvalues of A x = lambda M x, rising, A symmetric and M positive definite; the lower triangles are read, both are
   !> overwritten, A by the vectors if they are wanted, x^T M x = 1.
   subroutine symmetric_eigenvalues(a, m, values, with_vectors, error)
      real(wp), contiguous, intent(inout) :: a(:, :), m(:, :) !! (n, n)
      real(wp), allocatable, intent(out) :: values(:)         !! (n)
      logical, intent(in) :: with_vectors
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: work(:)
      integer, allocatable :: integer_work(:)
      real(wp) :: work_size(1)
      character(len=1) :: job
      integer :: info, n, integer_size(1)

      n = size(a, 1)
      job = merge('V', 'N', with_vectors)
      allocate (values(n))
      if (n == 0) return
      call dsygvd(1, job, 'L', n, a, n, m, n, values, work_size, -1, integer_size, -1, info)
      allocate (work(int(work_size(1))), integer_work(integer_size(1)))
      call dsygvd(1, job, 'L', n, a, n, m, n, values, work, size(work), integer_work, size(integer_work), info)
      if (info /= 0) call raise(error, 'dsygvd: no eigenvalues (mass matrix not positive definite, or no convergence)')
   end subroutine symmetric_eigenvalues

   !> Have the library compute in the calling thread. OpenBLAS would start one per core for the smallest matrix, and
   !> the processes of a sweep have a core each already. Other libraries are left as they are.
   subroutine use_one_thread()
      abstract interface
         subroutine set_threads(n) bind(c)
            import :: c_int
            implicit none (type, external)
            integer(c_int), value :: n
         end subroutine set_threads
      end interface
      interface
         function posix_dlsym(library, name) result(address) bind(c, name='dlsym')
            import :: c_char, c_funptr, c_ptr
            implicit none (type, external)
            type(c_ptr), value :: library !! null: everything that is loaded
            character(kind=c_char), intent(in) :: name(*)
            type(c_funptr) :: address
         end function posix_dlsym
      end interface
      procedure(set_threads), pointer :: set
      type(c_funptr) :: address

      address = posix_dlsym(c_null_ptr, 'openblas_set_num_threads'//c_null_char)
      if (.not. c_associated(address)) return
      call c_f_procpointer(address, set)
      call set(1_c_int)
   end subroutine use_one_thread

end module rodyn_lapack
