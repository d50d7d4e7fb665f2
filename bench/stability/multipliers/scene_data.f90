!> What a scene is: numbers as they were typed, laws in time, and element integrals by a rule of its own.
!>
!> The format is that of `bench/stability/multipliers.py`: numbers in a fixed order, each group counted.
module scene_data
   use, intrinsic :: iso_fortran_env, only: dp => real64
   implicit none (type, external)
   private
   public :: dp, scene_type, read_scene, load_at, kinks_at, none

   real(dp), parameter :: none = 1.0e300_dp !! an angle or time that is not given
   integer, parameter :: points = 12         !! of Gauss's rule on each piece

   !> A load, or a kink that moves.
   type :: time_law
      integer :: node = 0, component = 1 !! of a load: 0 the spacecraft; 1, 2, 3: X, Y, M. Of a kink: node is its hinge
      integer :: law = 1                 !! load: constant, sine squared, smooth step, table; kink: ramp, smooth step, sine, table
      real(dp) :: begin = 0.0_dp, end = 0.0_dp, value = 0.0_dp, rate = 0.0_dp, rise = 0.0_dp
      real(dp), allocatable :: times(:), values(:), bend(:) !! of a table; second derivatives of a kink's spline
   end type time_law

   !> What `&hinge` adds to a hinge.
   type, public :: joint_data
      logical :: present = .false., held = .false.
      real(dp) :: release_time = none, rest = 0.0_dp, freeplay = 0.0_dp, inner = 0.0_dp
      integer :: release_after = -1
      real(dp) :: stop(2) = none, stop_stiffness = 0.0_dp, stop_damping = 0.0_dp, latch = none
      real(dp) :: lock_stiffness = 0.0_dp, lock_damping = 0.0_dp, friction = 0.0_dp, friction_velocity = 1.0_dp
   end type joint_data

   type :: scene_type
      integer :: n = 0, shapes = 0 !! shapes 0: rigid or massless rods
      logical :: free = .true., statics = .false., exact = .false., lumped = .false.
      real(dp) :: t_end = 1.0_dp, tolerance = 1.0e-12_dp, seconds = 10.0_dp
      integer :: n_outputs = 1
      real(dp) :: mass = 0.0_dp, inertia = 0.0_dp, hinge(2) = 0.0_dp
      real(dp), allocatable, dimension(:) :: length, density, bending, node_mass, spring, damper, kink
      real(dp), allocatable, dimension(:, :) :: start, start_rate !! phi and shapes (4, n)
      real(dp) :: base(3) = 0.0_dp, base_rate(3) = 0.0_dp         !! displacement, rotation; moving axes
      type(time_law), allocatable :: loads(:), kinks(:)
      type(joint_data), allocatable :: joints(:)                  !! (0:n-1)
      real(dp), allocatable :: m0(:), m1(:), m2(:)                !! masses of a rod and its node: int m, int m s, int m s^2
      real(dp), allocatable :: shape1(:, :), shape_s(:, :)        !! int m N, int m s N (3, n)
      real(dp), allocatable :: shape2(:, :, :), stiffness(:, :, :) !! int m N N, int EI N'' N'' (3, 3, n)
      real(dp), allocatable :: flexibility(:, :)                  !! of massless rods: f11, f12, f22 (3, n)
      real(dp), allocatable :: switches(:)                        !! 0, ..., t_end: nothing changes in between
   end type scene_type

contains

   subroutine read_scene(s)
      type(scene_type), intent(out) :: s
      integer :: bending, lumped, free, i, count

      read (*, *) s%n, free, bending, lumped, s%shapes
      s%free = free == 1
      s%statics = bending >= 2
      s%exact = bending == 3
      s%lumped = lumped == 1
      if (bending /= 1) s%shapes = 0
      read (*, *) s%t_end, s%n_outputs, s%tolerance, s%seconds
      read (*, *) s%mass, s%inertia, s%hinge
      allocate (s%length(s%n), s%density(s%n), s%bending(s%n), s%node_mass(s%n), s%spring(0:s%n - 1), s%damper(0:s%n - 1), &
                s%kink(0:s%n - 1), s%start(4, s%n), s%start_rate(4, s%n), s%joints(0:s%n - 1))
      do i = 1, s%n
         read (*, *) s%length(i), s%density(i), s%bending(i), s%node_mass(i), s%spring(i - 1), s%damper(i - 1), s%kink(i - 1), &
            s%start(:, i), s%start_rate(:, i)
      end do
      read (*, *) s%base, s%base_rate
      call integrate_rods(s)
      read (*, *) count
      allocate (s%loads(count))
      do i = 1, count
         call read_law(s%loads(i))
      end do
      read (*, *) count
      allocate (s%kinks(count))
      do i = 1, count
         call read_law(s%kinks(i))
         if (s%kinks(i)%law == 4) s%kinks(i)%bend = spline(s%kinks(i)%times, s%kinks(i)%values)
      end do
      read (*, *) count
      do i = 1, count
         call read_joint(s)
      end do
      call find_switches(s)
   end subroutine read_scene

   subroutine read_law(law)
      type(time_law), intent(out) :: law
      integer :: count
      read (*, *) law%node, law%component, law%law, law%begin, law%end, law%value, law%rate, law%rise, count
      allocate (law%times(count), law%values(count))
      if (count == 0) return
      read (*, *) law%times, law%values
      law%begin = max(law%begin, law%times(1)) ! a table is nothing before its first time and beyond its last
      law%end = min(law%end, law%times(count))
   end subroutine read_law

   subroutine read_joint(s)
      type(scene_type), intent(inout) :: s
      type(joint_data) :: j
      integer :: hinge, held
      read (*, *) hinge, held, j%release_time, j%release_after, j%rest, j%freeplay, j%inner, j%stop, j%stop_stiffness, &
         j%stop_damping, j%latch, j%lock_stiffness, j%lock_damping, j%friction, j%friction_velocity
      j%held = held == 1
      j%present = .true.
      s%joints(hinge) = j
   end subroutine read_joint

   !> Integrals over every rod; its profiles are pieces between positions, polynomials in s/l.
   subroutine integrate_rods(s)
      type(scene_type), intent(inout) :: s
      real(dp) :: x(points), w(points), factor(2)
      real(dp) :: xs, ds, dm, shape(3), curved(3), share
      real(dp), allocatable :: pieces(:)
      real(dp), allocatable :: polynomial(:, :, :)
      integer :: k, i, j, p, cut, cuts

      allocate (s%m0(s%n), s%m1(s%n), s%m2(s%n), s%shape1(3, s%n), s%shape_s(3, s%n), s%shape2(3, 3, s%n), s%stiffness(3, 3, s%n), &
                s%flexibility(3, s%n), source=0.0_dp)
      call gauss_rule(x, w)
      cuts = merge(64, 1, s%statics)
      do k = 1, s%n
         call read_pieces(pieces, polynomial)
         associate (l => s%length(k))
            do p = 1, size(pieces) - 1
               do cut = 1, cuts
                  do i = 1, points
                     ds = (pieces(p + 1) - pieces(p))/cuts
                     xs = pieces(p) + ds*(cut - 1 + x(i))
                     do j = 1, 2
                        factor(j) = polynomial(1, j, p) + xs*(polynomial(2, j, p) + xs*polynomial(3, j, p))
                     end do
                     dm = s%density(k)*factor(1)*w(i)*ds*l
                     s%m0(k) = s%m0(k) + dm
                     s%m1(k) = s%m1(k) + dm*xs*l
                     s%m2(k) = s%m2(k) + dm*(xs*l)**2
                     if (s%statics) s%flexibility(:, k) = s%flexibility(:, k) + &
                        w(i)*ds*l/(s%bending(k)*factor(2))*[(1.0_dp - xs)**2, xs*(1.0_dp - xs), xs**2]
                     if (s%shapes == 0) cycle
                     shape = [l*xs*(1.0_dp - xs)**2, -l*xs**2*(1.0_dp - xs), 16.0_dp*(xs*(1.0_dp - xs))**2]
                     curved = [(6.0_dp*xs - 4.0_dp)/l, (6.0_dp*xs - 2.0_dp)/l, 32.0_dp*(1.0_dp - 6.0_dp*xs + 6.0_dp*xs**2)/l**2]
                     s%shape1(:, k) = s%shape1(:, k) + dm*shape
                     s%shape_s(:, k) = s%shape_s(:, k) + dm*xs*l*shape
                     do j = 1, 3
                        s%shape2(:, j, k) = s%shape2(:, j, k) + dm*shape*shape(j)
                        s%stiffness(:, j, k) = s%stiffness(:, j, k) + s%bending(k)*factor(2)*w(i)*ds*l*curved*curved(j)
                     end do
                  end do
               end do
            end do
            if (s%lumped) then ! two point masses with the same mass and centre of mass
               share = s%m1(k)/l
               s%m2(k) = share*l**2
            end if
            s%m0(k) = s%m0(k) + s%node_mass(k)
            s%m1(k) = s%m1(k) + s%node_mass(k)*l
            s%m2(k) = s%m2(k) + s%node_mass(k)*l**2
         end associate
      end do
   end subroutine integrate_rods

   !> Pieces of a rod, and for each the parabolas of mass and stiffness in s/l.
   subroutine read_pieces(pieces, polynomial)
      real(dp), allocatable, intent(out) :: pieces(:)
      real(dp), allocatable, intent(out) :: polynomial(:, :, :) !! (3, 2, pieces)
      integer :: count, p
      read (*, *) count
      allocate (pieces(count + 1), polynomial(3, 2, count))
      read (*, *) pieces
      do p = 1, count
         read (*, *) polynomial(:, :, p)
      end do
   end subroutine read_pieces

   !> Gauss's rule on [0, 1]: Newton's iteration for the roots of Legendre's polynomial.
   subroutine gauss_rule(x, w)
      real(dp), intent(out) :: x(:), w(:)
      real(dp) :: z, p0, p1, p2, slope
      integer :: i, j, k, n

      n = size(x)
      do i = 1, n
         z = cos(acos(-1.0_dp)*(i - 0.25_dp)/(n + 0.5_dp))
         do k = 1, 20
            p1 = 1.0_dp
            p2 = 0.0_dp
            do j = 1, n
               p0 = p2
               p2 = p1
               p1 = ((2*j - 1)*z*p2 - (j - 1)*p0)/j
            end do
            slope = n*(z*p1 - p2)/(z**2 - 1.0_dp)
            z = z - p1/slope
         end do
         x(i) = 0.5_dp*(1.0_dp - z)
         w(i) = 1.0_dp/((1.0_dp - z**2)*slope**2)
      end do
   end subroutine gauss_rule

   !> Second derivatives of the spline at rest at both ends: its equations, by elimination of a full matrix.
   function spline(t, x) result(bend)
      real(dp), intent(in) :: t(:), x(:)
      real(dp) :: bend(size(t)), a(size(t), size(t) + 1), h
      integer :: i, j, m

      m = size(t)
      a = 0.0_dp
      do i = 1, m - 1 ! slopes at both ends of each piece, by its chord and second derivatives
         h = t(i + 1) - t(i)
         a(i, i) = a(i, i) + h/3.0_dp
         a(i, i + 1) = a(i, i + 1) + h/6.0_dp
         a(i, m + 1) = a(i, m + 1) + (x(i + 1) - x(i))/h
         a(i + 1, i) = a(i + 1, i) + h/6.0_dp
         a(i + 1, i + 1) = a(i + 1, i + 1) + h/3.0_dp
         a(i + 1, m + 1) = a(i + 1, m + 1) - (x(i + 1) - x(i))/h
      end do
      do i = 1, m
         a(i, :) = a(i, :)/a(i, i)
         do j = 1, m
            if (j /= i) a(j, :) = a(j, :) - a(j, i)*a(i, :)
         end do
      end do
      bend = a(:, m + 1)
   end function spline

   !> All times where a law in time begins, ends or bends, and hinges are released.
   subroutine find_switches(s)
      type(scene_type), intent(inout) :: s
      real(dp), allocatable :: times(:)
      integer :: i

      times = [0.0_dp, s%t_end]
      do i = 1, size(s%loads)
         associate (law => s%loads(i))
            times = [times, law%begin, law%end, law%times]
            if (law%law == 3) times = [times, law%begin + law%rise]
         end associate
      end do
      do i = 1, size(s%kinks)
         times = [times, s%kinks(i)%begin, s%kinks(i)%end, s%kinks(i)%times]
      end do
      do i = 0, s%n - 1
         if (s%joints(i)%held .and. s%joints(i)%release_time < none) times = [times, s%joints(i)%release_time]
      end do
      s%switches = [0.0_dp]
      do while (any(times > s%switches(size(s%switches)) + 1.0e-12_dp*s%t_end))
         s%switches = [s%switches, minval(times, times > s%switches(size(s%switches)) + 1.0e-12_dp*s%t_end)]
         if (s%switches(size(s%switches)) >= s%t_end*(1.0_dp - 1.0e-12_dp)) exit
      end do
      s%switches(size(s%switches)) = s%t_end
   end subroutine find_switches

   !> Forces at t, between switches around `middle`: on the spacecraft (3) and the nodes (2, n), moving axes.
   pure subroutine load_at(s, middle, t, base, node)
      type(scene_type), intent(in) :: s
      real(dp), intent(in) :: middle, t
      real(dp), intent(out) :: base(3), node(:, :)
      real(dp) :: value
      integer :: i

      base = 0.0_dp
      node = 0.0_dp
      do i = 1, size(s%loads)
         associate (law => s%loads(i))
            if (middle < law%begin .or. middle > law%end) cycle
            select case (law%law)
            case (1)
               value = law%value
            case (2)
               value = law%value*sin(law%rate*t)**2
            case (3)
               value = law%value*step((t - law%begin)/law%rise)
            case default
               value = broken_line(law, middle, t)
            end select
            if (law%node == 0) then
               base(law%component) = base(law%component) + value
            else
               node(law%component, law%node) = node(law%component, law%node) + value
            end if
         end associate
      end do
   end subroutine load_at

   pure real(dp) function broken_line(law, middle, t)
      type(time_law), intent(in) :: law
      real(dp), intent(in) :: middle, t
      integer :: i
      i = count(law%times < middle)
      broken_line = law%values(i) + (law%values(i + 1) - law%values(i))*(t - law%times(i))/(law%times(i + 1) - law%times(i))
   end function broken_line

   !> 10 x^3 - 15 x^4 + 6 x^5 between 0 and 1.
   pure real(dp) function step(x)
      real(dp), intent(in) :: x
      step = 0.0_dp
      if (x > 0.0_dp) step = x**3*(10.0_dp - 15.0_dp*x + 6.0_dp*x**2)
      if (x > 1.0_dp) step = 1.0_dp
   end function step

   !> Kinks, rates and accelerations of all hinges (0:n-1, 3) at t, between switches around `middle`.
   pure subroutine kinks_at(s, middle, t, kink)
      type(scene_type), intent(in) :: s
      real(dp), intent(in) :: middle, t
      real(dp), intent(out) :: kink(0:, :)
      real(dp) :: x(3)
      integer :: i

      kink = 0.0_dp
      kink(:, 1) = s%kink
      do i = 1, size(s%kinks)
         if (middle > s%kinks(i)%begin .and. middle < s%kinks(i)%end) then
            x = moved(s%kinks(i), middle, t)
         else
            x = moved(s%kinks(i), middle, merge(s%kinks(i)%begin, s%kinks(i)%end, middle < s%kinks(i)%begin))
            x(2:) = 0.0_dp
         end if
         kink(s%kinks(i)%node, :) = kink(s%kinks(i)%node, :) + x
      end do
   end subroutine kinks_at

   pure function moved(law, middle, t) result(x)
      type(time_law), intent(in) :: law
      real(dp), intent(in) :: middle, t
      real(dp) :: x(3), z, span, a, b, h
      integer :: i

      span = law%end - law%begin
      z = (t - law%begin)/span
      select case (law%law)
      case (1)
         x = law%value*[z, 1.0_dp/span, 0.0_dp]
      case (2)
         x = law%value*[step(z), (30.0_dp*z**2 - 60.0_dp*z**3 + 30.0_dp*z**4)/span, &
                        (60.0_dp*z - 180.0_dp*z**2 + 120.0_dp*z**3)/span**2]
      case (3)
         z = law%rate*(t - law%begin)
         x = law%value*[sin(z), law%rate*cos(z), -law%rate**2*sin(z)]
      case default
         i = min(max(count(law%times < middle), 1), size(law%times) - 1)
         if (middle < law%begin) i = 1
         h = law%times(i + 1) - law%times(i)
         b = (t - law%times(i))/h
         a = 1.0_dp - b
         associate (low => law%bend(i), high => law%bend(i + 1))
            x = [a*law%values(i) + b*law%values(i + 1) + ((a**3 - a)*low + (b**3 - b)*high)*h**2/6.0_dp, &
                 (law%values(i + 1) - law%values(i))/h + ((3.0_dp*b**2 - 1.0_dp)*high - (3.0_dp*a**2 - 1.0_dp)*low)*h/6.0_dp, &
                 a*low + b*high]
         end associate
      end select
   end function moved

end module scene_data
