!> How a quantity varies along a rod: a factor over x = s/l, 0 <= x <= 1, on the value that the chain gives the rod.
!>
!> A profile is a polynomial, or a table that is linear between its positions; two equal positions make a jump. Without
!> either the factor is 1.
module rodyn_rod_profile
   use rodyn_kinds, only: wp
   use rodyn_case_config, only: profile_config
   implicit none (type, external)
   private
   public :: rod_profile, new_rod_profile, smallest_value, mean_mass_factors

   !> A factor along a rod.
   type :: rod_profile
      real(wp), allocatable :: polynomial(:) !! c0, c1, ...: sum c_i x^i
      real(wp), allocatable :: positions(:)  !! of the table, rising from 0 to 1
      real(wp), allocatable :: values(:)     !! of the table
   contains
      procedure :: varies
      procedure :: degree
      procedure :: breaks
      procedure :: at
      procedure :: mean
      procedure :: equals
   end type rod_profile

contains

   !> Take over what the user gave.
   pure subroutine new_rod_profile(profile, config)
      type(rod_profile), intent(out) :: profile
      type(profile_config), intent(in) :: config

      if (allocated(config%polynomial)) then
         if (size(config%polynomial) > 0) then
            profile%polynomial = config%polynomial
            return
         end if
      end if
      if (.not. allocated(config%positions) .or. .not. allocated(config%values)) return
      profile%positions = config%positions
      profile%values = config%values
   end subroutine new_rod_profile

   !> Is there anything but a factor of 1?
   pure logical function varies(self)
      class(rod_profile), intent(in) :: self
      varies = allocated(self%polynomial) .or. allocated(self%positions)
   end function varies

   !> Degree of the polynomial pieces.
   pure integer function degree(self)
      class(rod_profile), intent(in) :: self
      degree = 0
      if (allocated(self%polynomial)) degree = size(self%polynomial) - 1
      if (allocated(self%positions)) degree = 1
   end function degree

   !> Ends of the pieces on which the factor is a polynomial, 0 and 1 among them, rising.
   pure function breaks(self) result(x)
      class(rod_profile), intent(in) :: self
      real(wp), allocatable :: x(:)
      logical, allocatable :: fresh(:)

      if (.not. allocated(self%positions)) then
         x = [0.0_wp, 1.0_wp]
         return
      end if
      associate (p => self%positions)
         fresh = [.true., p(2:) > p(:size(p) - 1)]
         x = pack(p, fresh)
      end associate
   end function breaks

   !> The factor at x, not at a jump.
   elemental real(wp) function at(self, x)
      class(rod_profile), intent(in) :: self
      real(wp), intent(in) :: x !! s/l
      integer :: i

      at = 1.0_wp
      if (allocated(self%polynomial)) then
         at = horner(self%polynomial, x)
      else if (allocated(self%positions)) then
         associate (p => self%positions, v => self%values)
            i = min(max(count(p <= x), 1), size(p) - 1)
            at = v(i) + (v(i + 1) - v(i))*((x - p(i))/(p(i + 1) - p(i)))
         end associate
      end if
   end function at

   !> Mean factor on [0, 1].
   pure real(wp) function mean(self)
      class(rod_profile), intent(in) :: self
      integer :: i

      mean = 1.0_wp
      if (allocated(self%polynomial)) then
         mean = sum([(self%polynomial(i)/i, i=1, size(self%polynomial))])
      else if (allocated(self%positions)) then
         associate (p => self%positions, v => self%values, n => size(self%positions))
            mean = 0.5_wp*sum((p(2:) - p(:n - 1))*(v(2:) + v(:n - 1)))
         end associate
      end if
   end function mean

   !> Mass of each rod over that of a uniform one. Where several profiles are given for a rod, the last one counts.
   pure function mean_mass_factors(n, profiles) result(factor)
      integer, intent(in) :: n !! rods
      type(profile_config), intent(in) :: profiles(:)
      real(wp) :: factor(n)
      type(rod_profile) :: profile
      integer :: i

      factor = 1.0_wp
      do i = 1, size(profiles)
         if (profiles(i)%quantity /= 'mass_per_length') cycle
         call new_rod_profile(profile, profiles(i))
         factor(profiles(i)%first_rod:min(n, profiles(i)%last_rod)) = profile%mean()
      end do
   end function mean_mass_factors

   !> The same factor, to the bit?
   pure logical function equals(self, other)
      class(rod_profile), intent(in) :: self
      type(rod_profile), intent(in) :: other
      equals = same(self%polynomial, other%polynomial) .and. same(self%positions, other%positions) .and. &
               same(self%values, other%values)
   end function equals

   pure logical function same(a, b)
      real(wp), allocatable, intent(in) :: a(:), b(:)
      same = .not. allocated(a) .and. .not. allocated(b)
      if (.not. allocated(a) .or. .not. allocated(b)) return
      same = size(a) == size(b)
      if (same) same = all(a == b)
   end function same

   !> The least factor on [0, 1].
   pure real(wp) function smallest_value(profile) result(least)
      type(rod_profile), intent(in) :: profile
      real(wp), allocatable :: x(:)
      integer :: i

      least = 1.0_wp
      if (allocated(profile%values)) least = minval(profile%values)
      if (allocated(profile%polynomial)) then
         associate (c => profile%polynomial)
            x = [0.0_wp, turning_points(c), 1.0_wp]
            least = minval([(horner(c, x(i)), i=1, size(x))])
         end associate
      end if
   end function smallest_value

   !> Where the polynomial turns within (0, 1): roots of its derivative, which lie one by one between the turning points of
   !> that derivative and are found by bisection.
   pure recursive function turning_points(c) result(x)
      real(wp), intent(in) :: c(:) !! c0, c1, ...
      real(wp), allocatable :: x(:)
      real(wp), allocatable :: d(:), ends(:)
      real(wp) :: low, high, middle
      integer :: i, j

      allocate (x(0))
      if (size(c) < 3) return
      d = [(i*c(i + 1), i=1, size(c) - 1)]
      ends = [0.0_wp, turning_points(d), 1.0_wp]
      do i = 1, size(ends) - 1
         low = ends(i)
         high = ends(i + 1)
         if (sign(1.0_wp, horner(d, low))*sign(1.0_wp, horner(d, high)) > 0.0_wp) cycle
         do j = 1, digits(1.0_wp)
            middle = 0.5_wp*(low + high)
            if (sign(1.0_wp, horner(d, low))*sign(1.0_wp, horner(d, middle)) > 0.0_wp) then
               low = middle
            else
               high = middle
            end if
         end do
         x = [x, low]
      end do
   end function turning_points

   !> sum c_i x^i.
   pure real(wp) function horner(c, x) result(value)
      real(wp), intent(in) :: c(:) !! c0, c1, ...
      real(wp), intent(in) :: x
      integer :: i
      value = 0.0_wp
      do i = size(c), 1, -1
         value = value*x + c(i)
      end do
   end function horner

end module rodyn_rod_profile
