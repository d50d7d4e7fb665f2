!> The vector SUNDIALS works on: a plain array whose operations are compiled with the program.
!>
!> Two reasons not to take SUNDIALS' serial vector. Distributed builds of SUNDIALS are often not optimized,
!> and an Adams step of order 12 adds about a hundred short vectors, which then cost more than the right-hand
!> side. And here the norm runs over the leading `n_controlled` elements only, so that quadrature states
!> cannot change a step, not even by rounding.
module rodyn_nvector
   use, intrinsic :: iso_c_binding, only: c_ptr, c_int, c_int64_t, c_double, c_f_pointer, c_loc, c_funloc, c_null_ptr
   use rodyn_kinds, only: wp
   use rodyn_sundials_interface, only: N_Vector, N_Vector_Ops, FN_VNewEmpty, FN_VFreeEmpty, FN_VCopyOps
   implicit none (type, external)
   private
   public :: new_nvector, free_nvector, vector_content, content_of

   !> What an N_Vector of this module holds.
   type :: vector_content
      integer :: n_controlled = 0         !! leading elements in the norm
      real(wp), allocatable :: values(:)
   end type vector_content

   integer, parameter :: block_length = 32 !! elements kept in registers and cache while a sum of vectors is formed

contains

   !> A vector of zeros. Null on failure of the allocation in SUNDIALS.
   function new_nvector(n, n_controlled, context) result(vector)
      integer, intent(in) :: n            !! length
      integer, intent(in) :: n_controlled !! leading elements in the norm, >= 1
      type(c_ptr), intent(in) :: context  !! SUNContext
      type(N_Vector), pointer :: vector

      type(N_Vector_Ops), pointer :: ops
      type(vector_content), pointer :: content
      type(c_ptr) :: context_copy

      context_copy = context
      vector => FN_VNewEmpty(context_copy)
      if (.not. associated(vector)) return
      allocate (content)
      content%n_controlled = n_controlled
      allocate (content%values(n), source=0.0_wp)
      vector%content = c_loc(content)

      call c_f_pointer(vector%ops, ops)
      ops%nvgetvectorid = c_funloc(vector_id)
      ops%nvclone = c_funloc(clone)
      ops%nvdestroy = c_funloc(destroy)
      ops%nvgetarraypointer = c_funloc(array_pointer)
      ops%nvgetlength = c_funloc(length)
      ops%nvlinearsum = c_funloc(linear_sum)
      ops%nvconst = c_funloc(set_constant)
      ops%nvprod = c_funloc(product_of)
      ops%nvdiv = c_funloc(quotient)
      ops%nvscale = c_funloc(scale_by)
      ops%nvabs = c_funloc(absolute)
      ops%nvinv = c_funloc(inverse)
      ops%nvaddconst = c_funloc(add_constant)
      ops%nvdotprod = c_funloc(dot_of)
      ops%nvmaxnorm = c_funloc(max_norm)
      ops%nvwrmsnorm = c_funloc(wrms_norm)
      ops%nvmin = c_funloc(minimum)
      ops%nvlinearcombination = c_funloc(linear_combination)
      ops%nvscaleaddmulti = c_funloc(scale_add_multi)
   end function new_nvector

   !> Release a vector; null is allowed.
   subroutine free_nvector(vector)
      type(N_Vector), pointer, intent(inout) :: vector
      if (associated(vector)) call destroy(vector)
      nullify (vector)
   end subroutine free_nvector

   !> The array behind a vector.
   function content_of(vector) result(content)
      type(N_Vector), intent(in) :: vector
      type(vector_content), pointer :: content
      call c_f_pointer(vector%content, content)
   end function content_of

   !> That of the serial vector.
   function vector_id(x) result(id) bind(c)
      type(N_Vector), intent(in) :: x
      integer(c_int) :: id
      associate (unused => x); end associate
      id = 0_c_int
   end function vector_id

   function clone(x) result(copy) bind(c)
      type(N_Vector), intent(inout), target :: x
      type(c_ptr) :: copy
      type(vector_content), pointer :: content
      type(N_Vector), pointer :: vector
      integer(c_int) :: flag

      content => content_of(x)
      vector => new_nvector(size(content%values), content%n_controlled, x%sunctx)
      copy = c_null_ptr
      if (.not. associated(vector)) return
      flag = FN_VCopyOps(x, vector)
      copy = c_loc(vector)
   end function clone

   subroutine destroy(x) bind(c)
      type(N_Vector), intent(inout), target :: x
      type(vector_content), pointer :: content
      content => content_of(x)
      if (associated(content)) deallocate (content)
      x%content = c_null_ptr
      call FN_VFreeEmpty(x)
   end subroutine destroy

   function array_pointer(x) result(address) bind(c)
      type(N_Vector), intent(in) :: x
      type(c_ptr) :: address
      type(vector_content), pointer :: content
      content => content_of(x)
      address = c_loc(content%values)
   end function array_pointer

   function length(x) result(n) bind(c)
      type(N_Vector), intent(in) :: x
      integer(c_int64_t) :: n
      type(vector_content), pointer :: content
      content => content_of(x)
      n = size(content%values, kind=c_int64_t)
   end function length

   !> z = a x + b y; x, y and z may be one vector.
   subroutine linear_sum(a, x, b, y, z) bind(c)
      real(c_double), intent(in), value :: a, b
      type(N_Vector), intent(in) :: x, y, z
      type(vector_content), pointer :: cx, cy, cz
      integer :: i

      cx => content_of(x); cy => content_of(y); cz => content_of(z)
      if (is(a, 1.0_wp) .and. is(b, 1.0_wp)) then
         do i = 1, size(cz%values)
            cz%values(i) = cx%values(i) + cy%values(i)
         end do
      else if (is(a, 1.0_wp) .and. is(b, -1.0_wp)) then
         do i = 1, size(cz%values)
            cz%values(i) = cx%values(i) - cy%values(i)
         end do
      else
         do i = 1, size(cz%values)
            cz%values(i) = a*cx%values(i) + b*cy%values(i)
         end do
      end if
   end subroutine linear_sum

   !> Exact equality, meant.
   elemental logical function is(a, b)
      real(wp), intent(in) :: a, b
      is = .not. (a < b .or. a > b)
   end function is

   subroutine set_constant(c, z) bind(c)
      real(c_double), intent(in), value :: c
      type(N_Vector), intent(in) :: z
      type(vector_content), pointer :: cz
      cz => content_of(z)
      cz%values(:) = c
   end subroutine set_constant

   subroutine product_of(x, y, z) bind(c)
      type(N_Vector), intent(in) :: x, y, z
      type(vector_content), pointer :: cx, cy, cz
      cx => content_of(x); cy => content_of(y); cz => content_of(z)
      cz%values(:) = cx%values*cy%values
   end subroutine product_of

   subroutine quotient(x, y, z) bind(c)
      type(N_Vector), intent(in) :: x, y, z
      type(vector_content), pointer :: cx, cy, cz
      cx => content_of(x); cy => content_of(y); cz => content_of(z)
      cz%values(:) = cx%values/cy%values
   end subroutine quotient

   subroutine scale_by(c, x, z) bind(c)
      real(c_double), intent(in), value :: c
      type(N_Vector), intent(in) :: x, z
      type(vector_content), pointer :: cx, cz
      integer :: i
      cx => content_of(x); cz => content_of(z)
      do i = 1, size(cz%values)
         cz%values(i) = c*cx%values(i)
      end do
   end subroutine scale_by

   subroutine absolute(x, z) bind(c)
      type(N_Vector), intent(in) :: x, z
      type(vector_content), pointer :: cx, cz
      cx => content_of(x); cz => content_of(z)
      cz%values(:) = abs(cx%values)
   end subroutine absolute

   subroutine inverse(x, z) bind(c)
      type(N_Vector), intent(in) :: x, z
      type(vector_content), pointer :: cx, cz
      cx => content_of(x); cz => content_of(z)
      cz%values(:) = 1.0_wp/cx%values
   end subroutine inverse

   subroutine add_constant(x, b, z) bind(c)
      type(N_Vector), intent(in) :: x, z
      real(c_double), intent(in), value :: b
      type(vector_content), pointer :: cx, cz
      cx => content_of(x); cz => content_of(z)
      cz%values(:) = cx%values + b
   end subroutine add_constant

   function max_norm(x) result(norm) bind(c)
      type(N_Vector), intent(in) :: x
      real(c_double) :: norm
      type(vector_content), pointer :: cx
      cx => content_of(x)
      norm = maxval(abs(cx%values(:cx%n_controlled)))
   end function max_norm

   !> Demanded by the fixed-point solver, used by its acceleration only.
   function dot_of(x, y) result(dot) bind(c)
      type(N_Vector), intent(in) :: x, y
      real(c_double) :: dot
      type(vector_content), pointer :: cx, cy
      cx => content_of(x); cy => content_of(y)
      dot = dot_product(cx%values, cy%values)
   end function dot_of

   function minimum(x) result(least) bind(c)
      type(N_Vector), intent(in) :: x
      real(c_double) :: least
      type(vector_content), pointer :: cx
      cx => content_of(x)
      least = minval(cx%values)
   end function minimum

   !> sqrt(mean((x w)^2)) over the controlled elements, in four partial sums.
   function wrms_norm(x, w) result(norm) bind(c)
      type(N_Vector), intent(in) :: x, w
      real(c_double) :: norm
      type(vector_content), pointer :: cx, cw
      real(wp) :: part(4)
      integer :: i, n, n_fours

      cx => content_of(x); cw => content_of(w)
      n = cx%n_controlled
      n_fours = n - mod(n, 4)
      part = 0.0_wp
      do i = 1, n_fours, 4
         part = part + (cx%values(i:i + 3)*cw%values(i:i + 3))**2
      end do
      do i = n_fours + 1, n
         part(1) = part(1) + (cx%values(i)*cw%values(i))**2
      end do
      norm = sqrt(((part(1) + part(2)) + (part(3) + part(4)))/real(n, wp))
   end function wrms_norm

   !> z = sum_j c_j x_j in one pass; z may be any of the x.
   function linear_combination(n_vectors, c, x, z) result(flag) bind(c)
      integer(c_int), intent(in), value :: n_vectors
      real(c_double), intent(in) :: c(n_vectors)
      type(c_ptr), intent(in) :: x(n_vectors) !! N_Vector each
      type(N_Vector), intent(in) :: z
      integer(c_int) :: flag

      type(N_Vector), pointer :: vector
      type(vector_content), pointer :: cx, cz
      real(wp) :: total(block_length)
      integer :: first, n, j, i

      cz => content_of(z)
      do first = 0, size(cz%values) - 1, block_length
         n = min(block_length, size(cz%values) - first)
         total = 0.0_wp
         do j = 1, n_vectors
            if (is(c(j), 0.0_wp)) cycle
            call c_f_pointer(x(j), vector)
            cx => content_of(vector)
            do i = 1, n
               total(i) = total(i) + c(j)*cx%values(first + i)
            end do
         end do
         cz%values(first + 1:first + n) = total(:n)
      end do
      flag = 0_c_int
   end function linear_combination

   !> z_j = a_j x + y_j.
   function scale_add_multi(n_vectors, a, x, y, z) result(flag) bind(c)
      integer(c_int), intent(in), value :: n_vectors
      real(c_double), intent(in) :: a(n_vectors)
      type(N_Vector), intent(in) :: x
      type(c_ptr), intent(in) :: y(n_vectors), z(n_vectors) !! N_Vector each
      integer(c_int) :: flag

      type(N_Vector), pointer :: vector
      type(vector_content), pointer :: cx, cy, cz
      integer :: i, j

      cx => content_of(x)
      do j = 1, n_vectors
         call c_f_pointer(y(j), vector)
         cy => content_of(vector)
         call c_f_pointer(z(j), vector)
         cz => content_of(vector)
         do i = 1, size(cx%values)
            cz%values(i) = a(j)*cx%values(i) + cy%values(i)
         end do
      end do
      flag = 0_c_int
   end function scale_add_multi

end module rodyn_nvector
