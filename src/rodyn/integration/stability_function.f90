!> Stability functions of explicit Runge-Kutta methods: on x' = lambda x a step of length h multiplies x by R(h lambda),
!>     R(z) = 1 + z b.1 + z^2 b.A 1 + z^3 b.A^2 1 + ...,
!> a polynomial of the coefficients of the method (Hairer & Wanner, Solving ODEs II, sec. IV.2).
module rodyn_stability_function
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type
   use rodyn_dop853_nystrom, only: dop853_a => a, dop853_b => b
   use rodyn_erk_tableau, only: erk_tableau
   implicit none (type, external)
   private
   public :: stability_function, stability_function_of

   type :: stability_function
      real(wp), allocatable :: coefficient(:) !! of z^k (0:stages)
   contains
      procedure :: growth
   end type stability_function

contains

   !> Of a method with the given coefficients.
   pure function new_stability_function(a, b) result(self)
      real(wp), intent(in) :: a(:, :) !! a(j, i) multiplies rate j in stage i
      real(wp), intent(in) :: b(:)
      type(stability_function) :: self
      real(wp) :: power(size(b)) ! A^(k-1) 1
      integer :: k

      allocate (self%coefficient(0:size(b)))
      self%coefficient(0) = 1.0_wp
      power = 1.0_wp
      do k = 1, size(b)
         self%coefficient(k) = dot_product(b, power)
         power = matmul(power, a)
      end do
   end function new_stability_function

   !> Of an explicit method by name. Others have no limit that this module knows: no coefficients.
   subroutine stability_function_of(self, method, order, error)
      type(stability_function), intent(out) :: self
      character(len=*), intent(in) :: method !! as in `rodyn_integrators`
      integer, intent(in) :: order           !! of 'erk'; 0: its default
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: a(:, :), b(:), c(:)

      select case (method)
      case ('dop853')
         self = new_stability_function(dop853_a, dop853_b)
      case ('erk')
         call erk_tableau(order, a, b, c, error)
         if (.not. allocated(error)) self = new_stability_function(a, b)
      case default
         return
      end select
   end subroutine stability_function_of

   !> log |R(z)|: positive where a step amplifies.
   elemental real(wp) function growth(self, z)
      class(stability_function), intent(in) :: self
      complex(wp), intent(in) :: z !! h lambda
      complex(wp) :: r
      integer :: k

      r = 0.0_wp
      do k = ubound(self%coefficient, 1), 0, -1
         r = r*z + self%coefficient(k)
      end do
      growth = log(max(abs(r), tiny(1.0_wp)))
   end function growth

end module rodyn_stability_function
