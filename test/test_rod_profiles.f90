!> Rods whose mass and stiffness vary: integrals by other routes, joined rods, published frequencies of tapered beams.
module test_rod_profiles
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type
   use rodyn_case_config, only: case_config
   use rodyn_case_reader, only: parse_case, resolved_case
   use rodyn_linear_model, only: linear_model
   use rodyn_modes_at_start, only: modes_at_start
   use rodyn_modes, only: mode_set
   use rodyn_motion, only: motion_type, new_motion
   use rodyn_quadrature, only: gauss_rule, new_gauss_rule
   use rodyn_rod_constants, only: rod_constants, new_rod_constants
   use rodyn_rod_integrals, only: shape_alpha, shape_beta
   use rodyn_rod_profile, only: rod_profile, new_rod_profile, smallest_value
   use rodyn_scene, only: scene_type, new_scene
   use test_random_scenes, only: allocate_case
   use test_testing, only: check, check_close, new_test, unittest
   implicit none (type, external)
   private
   public :: collect_rod_profiles

   real(wp), parameter :: rounding = 50.0_wp*epsilon(1.0_wp)

contains

   subroutine collect_rod_profiles(suite)
      type(unittest), allocatable, intent(out) :: suite(:)
      suite = [ &
         new_test('integrals of a linear mass are those in closed form', linear_mass), &
         new_test('integrals of a table with a jump are those of brute force', table_with_jump), &
         new_test('a table of two points is the linear polynomial', table_is_polynomial), &
         new_test('a constant profile only scales', constant_profile), &
         new_test('a stepped rod bends as its two halves joined', stepped_flexibility), &
         new_test('a linearly varying stiffness bends by logarithms', linear_flexibility), &
         new_test('the cubic is never softer than statics', cubic_is_stiffer), &
         new_test('lumped mass keeps total and centre', lumped_shares), &
         new_test('rods of equal profiles share their constants', shared_constants), &
         new_test('the least value of a polynomial is found between the ends', least_value), &
         new_test('frequencies of wedge and cone are the published ones', tapered_cantilevers), &
         new_test('a varying case reads back from its resolved form', reads_back), &
         new_test('faults of profiles are told with their reason', faults_told)]
   end subroutine collect_rod_profiles

   function polynomial(c) result(profile)
      real(wp), intent(in) :: c(:)
      type(rod_profile) :: profile
      profile%polynomial = c
   end function polynomial

   function stepped(inner, outer) result(profile)
      real(wp), intent(in) :: inner, outer
      type(rod_profile) :: profile
      profile%positions = [0.0_wp, 0.5_wp, 0.5_wp, 1.0_wp]
      profile%values = [inner, inner, outer, outer]
   end function stepped

   !> l = 2, m = 3 (1 + 2 x): int x^j (1-x)^k dx = j! k!/(j+k+1)!
   subroutine linear_mass(error)
      type(error_type), allocatable, intent(out) :: error
      type(rod_constants) :: rod
      type(gauss_rule) :: rule
      logical :: ok
      real(wp), parameter :: l = 2.0_wp, m = 3.0_wp

      call new_gauss_rule(rule, 4)
      call new_rod_constants(rod, l, m, 1.0_wp, rule, .false., .true., .true., ok, polynomial([1.0_wp, 2.0_wp]))
      associate (i => rod%inertia)
         call check_close(error, [i%m0, i%m1, i%m2, i%a1, i%b1, i%sa, i%sb, i%aa, i%ab, i%bb], m*l* &
            [2.0_wp, l*(1.0_wp/2 + 2.0_wp/3), l**2*(1.0_wp/3 + 2.0_wp/4), &
             l*(1.0_wp/12 + 2.0_wp/30), -l*(1.0_wp/12 + 2.0_wp/20), &
             l**2*(1.0_wp/30 + 2.0_wp/60), -l**2*(1.0_wp/20 + 2.0_wp/30), &
             l**2*(1.0_wp/105 + 2.0_wp/280), -l**2*(1.0_wp/140 + 2.0_wp/280), l**2*(1.0_wp/105 + 2.0_wp/168)], &
            rounding*m*l**3, 'integrals')
      end associate
   end subroutine linear_mass

   !> Midpoints of 2e5 cells, of which the jump is a boundary: error of order (1/2e5)^2.
   subroutine table_with_jump(error)
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: cells = 200000
      type(rod_constants) :: rod
      type(rod_profile) :: profile
      type(gauss_rule) :: rule
      real(wp) :: brute(10), s, dm, na, nb
      logical :: ok
      integer :: i

      profile%positions = [0.0_wp, 0.25_wp, 0.25_wp, 1.0_wp]
      profile%values = [1.0_wp, 3.0_wp, 0.5_wp, 2.0_wp]
      call new_gauss_rule(rule, 4)
      call new_rod_constants(rod, 1.5_wp, 1.2_wp, 1.0_wp, rule, .false., .true., .true., ok, profile)
      brute = 0.0_wp
      do i = 1, cells
         s = 1.5_wp*(i - 0.5_wp)/cells
         dm = 1.2_wp*1.5_wp/cells*profile%at(s/1.5_wp)
         na = shape_alpha(s, 1.5_wp)
         nb = shape_beta(s, 1.5_wp)
         brute = brute + dm*[1.0_wp, s, s**2, na, nb, s*na, s*nb, na**2, na*nb, nb**2]
      end do
      associate (x => rod%inertia)
         call check_close(error, [x%m0, x%m1, x%m2, x%a1, x%b1, x%sa, x%sb, x%aa, x%ab, x%bb], brute, 1.0e-9_wp, 'integrals')
      end associate
   end subroutine table_with_jump

   subroutine table_is_polynomial(error)
      type(error_type), allocatable, intent(out) :: error
      type(rod_constants) :: a, b
      type(rod_profile) :: table
      type(gauss_rule) :: rule
      logical :: ok

      table%positions = [0.0_wp, 1.0_wp]
      table%values = [1.0_wp, 3.0_wp]
      call new_gauss_rule(rule, 4)
      call new_rod_constants(a, 0.7_wp, 2.0_wp, 5.0_wp, rule, .false., .true., .true., ok, table, table)
      call new_rod_constants(b, 0.7_wp, 2.0_wp, 5.0_wp, rule, .false., .true., .true., ok, polynomial([1.0_wp, 2.0_wp]), &
                             polynomial([1.0_wp, 2.0_wp]))
      call check_close(error, [a%inertia%aa, a%inertia%m1, a%stiffness, a%b_inverse/100, a%g, a%h], &
                       [b%inertia%aa, b%inertia%m1, b%stiffness, b%b_inverse/100, b%g, b%h], 1.0e-12_wp, 'constants')
   end subroutine table_is_polynomial

   subroutine constant_profile(error)
      type(error_type), allocatable, intent(out) :: error
      type(rod_constants) :: a, b
      type(gauss_rule) :: rule
      logical :: ok

      call new_gauss_rule(rule, 4)
      call new_rod_constants(a, 0.7_wp, 2.0_wp, 5.0_wp, rule, .false., .true., .true., ok, polynomial([3.0_wp]), &
                             polynomial([2.0_wp]))
      call new_rod_constants(b, 0.7_wp, 6.0_wp, 10.0_wp, rule, .false., .true., .true., ok)
      call check_close(error, [a%inertia%aa, a%inertia%ab, a%stiffness, a%carry_over, a%m0_reduced], &
                       [b%inertia%aa, b%inertia%ab, b%stiffness, b%carry_over, b%m0_reduced], 100*rounding, 'dynamic')
      if (allocated(error)) return
      call new_rod_constants(a, 0.7_wp, 2.0_wp, 5.0_wp, rule, .true., .false., .true., ok, polynomial([3.0_wp]), &
                             polynomial([2.0_wp]))
      call new_rod_constants(b, 0.7_wp, 6.0_wp, 10.0_wp, rule, .true., .false., .true., ok)
      call check_close(error, [a%stiffness, a%carry_over, a%flexibility, a%share], &
                       [b%stiffness, b%carry_over, b%flexibility, b%share], 100*rounding, 'quasistatic')
   end subroutine constant_profile

   !> Moment T at the inner end, none at the outer: the slope there is T int (1 - x)^2/EI. Halves by hand.
   subroutine stepped_flexibility(error)
      type(error_type), allocatable, intent(out) :: error
      type(rod_constants) :: rod
      type(gauss_rule) :: rule
      logical :: ok
      real(wp), parameter :: l = 1.4_wp, ei = 30.0_wp, outer = 0.1_wp

      call new_gauss_rule(rule, 4)
      call new_rod_constants(rod, l, 1.0_wp, ei, rule, .true., .false., .true., ok, &
                             stiffness_profile=stepped(1.0_wp, outer))
      call check_close(error, rod%flexibility*ei/l, [7.0_wp/24 + 1.0_wp/24/outer, 1.0_wp/12 + 1.0_wp/12/outer, &
                                                     1.0_wp/24 + 7.0_wp/24/outer], rounding, 'flexibility')
      if (allocated(error)) return
      associate (k => rod%stiffness, f => rod%flexibility)
         call check_close(error, [k(1)*f(1) - k(2)*f(2), -k(1)*f(2) + k(2)*f(3), k(3)*f(3) - k(2)*f(2)], &
                          [1.0_wp, 0.0_wp, 1.0_wp], 100*rounding, 'inverse')
      end associate
   end subroutine stepped_flexibility

   !> EI = 1 + c x: int dx/EI = log(1 + c)/c = a, int x/EI = (1 - a)/c = b, int x^2/EI = (1/2 - b)/c.
   subroutine linear_flexibility(error)
      type(error_type), allocatable, intent(out) :: error
      type(rod_constants) :: rod
      type(gauss_rule) :: rule
      real(wp) :: a, b, c2
      logical :: ok
      real(wp), parameter :: c = -0.99_wp

      call new_gauss_rule(rule, 4)
      call new_rod_constants(rod, 1.0_wp, 1.0_wp, 1.0_wp, rule, .true., .false., .true., ok, &
                             stiffness_profile=polynomial([1.0_wp, c]))
      a = log(1.0_wp + c)/c
      b = (1.0_wp - a)/c
      c2 = (0.5_wp - b)/c
      call check_close(error, rod%flexibility, [a - 2*b + c2, b - c2, c2], 1.0e-13_wp, 'flexibility')
   end subroutine linear_flexibility

   !> With the same end slopes, the shape of statics has the least energy.
   subroutine cubic_is_stiffer(error)
      type(error_type), allocatable, intent(out) :: error
      type(rod_constants) :: cubic, static
      type(gauss_rule) :: rule
      real(wp) :: d(3)
      logical :: ok

      call new_gauss_rule(rule, 4)
      call new_rod_constants(cubic, 1.0_wp, 1.0_wp, 1.0_wp, rule, .false., .true., .true., ok, &
                             stiffness_profile=stepped(1.0_wp, 0.2_wp))
      call new_rod_constants(static, 1.0_wp, 1.0_wp, 1.0_wp, rule, .true., .false., .true., ok, &
                             stiffness_profile=stepped(1.0_wp, 0.2_wp))
      d = cubic%stiffness - static%stiffness
      call check(error, min(d(1), d(3), d(1)*d(3) - d(2)**2) > 0.0_wp, 'the difference is not positive definite')
   end subroutine cubic_is_stiffer

   !> m = 1 + 3 x over l = 2: mass 5, centre at 6/5.
   subroutine lumped_shares(error)
      type(error_type), allocatable, intent(out) :: error
      type(rod_constants) :: rod
      type(gauss_rule) :: rule
      logical :: ok

      call new_gauss_rule(rule, 4)
      call new_rod_constants(rod, 2.0_wp, 1.0_wp, 1.0_wp, rule, .true., .false., .true., ok, polynomial([1.0_wp, 3.0_wp]))
      call check_close(error, [sum(rod%share), 2.0_wp*rod%share(2)], [5.0_wp, 6.0_wp], rounding*5, 'mass and moment')
   end subroutine lumped_shares

   subroutine shared_constants(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(scene_type) :: scene

      call allocate_case(config, 6)
      call fill(config)
      allocate (config%profiles(3))
      config%profiles%quantity = 'mass_per_length'
      config%profiles%first_rod = [1, 4, 6]
      config%profiles%last_rod = [2, 4, 6]
      config%profiles(1)%polynomial = [1.0_wp, 1.0_wp]
      config%profiles(2)%polynomial = [1.0_wp, 1.0_wp]
      config%profiles(3)%polynomial = [1.0_wp, 2.0_wp]
      call new_scene(scene, config, error)
      if (allocated(error)) return
      call check(error, size(scene%rods), 3, 'distinct rods')
      if (allocated(error)) return
      call check(error, all(scene%rod_of([1, 2]) == scene%rod_of(4)) .and. scene%rod_of(3) == scene%rod_of(5), 'which is which')
   end subroutine shared_constants

   subroutine fill(config)
      type(case_config), intent(inout) :: config
      config%spacecraft%motion = 'fixed'
      config%chain%length = 1.0_wp/config%chain%n_rods
      config%chain%mass_per_length = 1.0_wp
      config%chain%bending_stiffness = 1.0_wp
      config%chain%hinge_stiffness = 1.0e7_wp
   end subroutine fill

   !> 1 - 4 x + 5 x^2 is 1/5 at 2/5; a quartic with two dips against a fine grid, on which it is at most 1e-9 higher.
   subroutine least_value(error)
      type(error_type), allocatable, intent(out) :: error
      type(rod_profile) :: quartic
      integer :: i

      call check_close(error, smallest_value(polynomial([1.0_wp, -4.0_wp, 5.0_wp])), 0.2_wp, rounding, 'parabola')
      if (allocated(error)) return
      ! (x - 1/4)^2 (x - 3/4)^2 + x/10
      quartic = polynomial([9.0_wp/256, -0.375_wp + 0.1_wp, 1.375_wp, -2.0_wp, 1.0_wp])
      call check_close(error, smallest_value(quartic), minval(quartic%at([(i*1.0e-5_wp, i=0, 100000)])), 1.0e-9_wp, 'quartic')
      if (allocated(error)) return
      call check_close(error, smallest_value(polynomial([2.0_wp, -1.0_wp])), 1.0_wp, rounding, 'line')
   end subroutine least_value

   !> Clamped at the thick end, sharp at the other: A = x, EI = x^3 (wedge) or A = x^2, EI = x^4 (cone), x from the tip.
   !> Frequencies omega l^2 sqrt(m0/EI0) from Kirchhoff's solution (1879) J_n I_{n+1} + I_n J_{n+1} = 0 at 2 sqrt(omega),
   !> n = 1 and 2: 5.315, 15.207, 30.020 and 8.719, 21.146, 38.453.
   subroutine tapered_cantilevers(error)
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: published(3, 2) = reshape( &
         [5.315099423653649_wp, 15.207167955005175_wp, 30.019809145653735_wp, &
          8.719258855079923_wp, 21.145662387868818_wp, 38.453771227750345_wp], [3, 2])
      integer, parameter :: n(2) = [12, 24]
      real(wp) :: frequency(3), wrong(3, 2)
      character(len=80) :: text
      integer :: i, power

      do power = 1, 2
         do i = 1, 2
            call lowest_frequencies(power, n(i), frequency, error)
            if (allocated(error)) return
            wrong(:, i) = abs(frequency/published(:, power) - 1.0_wp)
         end do
         write (text, '(6es10.2)') wrong
         call check(error, all(wrong(:, 2) < 1.0e-4_wp), 'frequencies:'//text)
         if (allocated(error)) return
         call check(error, all(wrong(:, 2) < 0.35_wp*wrong(:, 1) + 2.0e-5_wp), 'no convergence:'//text)
         if (allocated(error)) return
      end do
   end subroutine tapered_cantilevers

   !> Of a cantilever of n rods with A = x^power and EI = x^(power + 2).
   subroutine lowest_frequencies(power, n, frequency, error)
      integer, intent(in) :: power, n
      real(wp), intent(out) :: frequency(3)
      type(error_type), allocatable, intent(out) :: error
      type(case_config) :: config
      type(scene_type) :: scene
      type(motion_type) :: motion
      type(linear_model) :: model
      type(mode_set) :: modes
      integer :: k

      call allocate_case(config, n)
      call fill(config)
      allocate (config%profiles(2*n))
      do k = 1, n
         config%profiles([k, n + k])%first_rod = k
         config%profiles([k, n + k])%last_rod = k
         config%profiles(k)%quantity = 'mass_per_length'
         config%profiles(n + k)%quantity = 'bending_stiffness'
         config%profiles(k)%polynomial = power_of_taper(power)
         config%profiles(n + k)%polynomial = power_of_taper(power + 2)
      end do
      call new_scene(scene, config, error)
      if (.not. allocated(error)) call new_motion(motion, scene, .false., error)
      if (.not. allocated(error)) call modes_at_start(motion, config, .false., .false., .false., model, modes, error)
      if (.not. allocated(error)) frequency = aimag(modes%eigenvalue(:3))

   contains

      !> (1 - (k - 1 + x)/n)^p as a polynomial in x.
      pure function power_of_taper(p) result(c)
         integer, intent(in) :: p
         real(wp) :: c(p + 1)
         integer :: j, factor
         c = 0.0_wp
         c(1) = 1.0_wp
         do factor = 1, p
            do j = p + 1, 2, -1
               c(j) = c(j)*real(n - k + 1, wp)/n - c(j - 1)/n
            end do
            c(1) = c(1)*real(n - k + 1, wp)/n
         end do
      end function power_of_taper

   end subroutine lowest_frequencies

   subroutine faults_told(error)
      type(error_type), allocatable, intent(out) :: error
      character(len=*), parameter :: ei = "quantity = 'bending_stiffness', ", m = "quantity = 'mass_per_length', "

      call expect(m//'polynomial = 1, -2', 'polynomial = 1, -2: must not be negative anywhere from 0 to 1, but goes down to -1.')
      if (.not. allocated(error)) call expect(m//'polynomial = 1, last_rod = 4', &
                                              'last_rod = 4: there is no such rod; the numbers are 1..3')
      if (.not. allocated(error)) call expect(m//'polynomial = 1, first_rod = 3, last_rod = 2', &
                                              'last_rod = 2: must not be less than first_rod = 3')
      if (.not. allocated(error)) call expect(m//'positions = 0, 1', 'values: is required with positions')
      if (.not. allocated(error)) call expect(m//'positions = 0, 1, values = 1, 2, 3', &
                                              'values = 1, 2, 3: must have as many values as positions: 2, not 3')
      if (.not. allocated(error)) call expect(m//'positions = 0, 0.5, values = 1, 2', &
                                              'positions = 0, 0.5: must begin with 0 and end with 1')
      if (.not. allocated(error)) call expect(m//'positions = 0, 0.5, 0.4, 1, values = 4*1', 'must increase; two equal ones make')
      if (.not. allocated(error)) call expect(m, 'polynomial: is required unless positions and values are given')
      if (.not. allocated(error)) call expect(m//'polynomial = 1, positions = 0, 1, values = 1, 2', &
                                              'polynomial = 1: cannot be combined with positions and values')
      if (.not. allocated(error)) call expect(ei//'polynomial = 0', 'polynomial = 0: must not be zero everywhere')
      if (.not. allocated(error)) call expect(ei//"polynomial = 1, -1 / &model inertia = 'lumped', bending = 'quasistatic'", &
                                              "must be positive from 0 to 1 when bending = 'quasistatic'")

   contains

      subroutine expect(group, message)
         character(len=*), intent(in) :: group, message
         type(error_type), allocatable :: fault
         type(case_config) :: config
         character(len=1), parameter :: nl = new_line('a')

         call parse_case('&spacecraft mass = 1, inertia = 1 /'//nl// &
                         '&chain n_rods = 3, length = 1, mass_per_length = 1, bending_stiffness = 1, hinge_stiffness = 1 /'// &
                         nl//'&rod_profile '//group//' /'//nl, 'c.nml', config, fault)
         call check(error, allocated(fault), 'accepted: '//group)
         if (allocated(error)) return
         call check(error, index(fault%message, 'c.nml:3: &rod_profile ') == 1 .and. index(fault%message, message) > 0, &
                    fault%message)
      end subroutine expect

   end subroutine faults_told

   subroutine reads_back(error)
      type(error_type), allocatable, intent(out) :: error
      character(len=1), parameter :: nl = new_line('a')
      type(case_config) :: config, again
      type(rod_profile) :: profile
      character(len=:), allocatable :: text

      call parse_case('&spacecraft mass = 1, inertia = 1 /'//nl// &
                      '&chain n_rods = 3, length = 1, mass_per_length = 1, bending_stiffness = 1, hinge_stiffness = 1 /'//nl// &
                      "&rod_profile quantity = 'bending_stiffness', polynomial = 1, -0.25, first_rod = 2 /"//nl// &
                      "&rod_profile quantity = 'mass_per_length', positions = 0, 0.5, 0.5, 1, values = 2*1, 2*3, last_rod = 1 /", &
                      'c.nml', config, error)
      if (allocated(error)) return
      text = resolved_case(config)
      call parse_case(text, 'r.nml', again, error)
      if (allocated(error)) return
      call check(error, resolved_case(again), text, 'resolved')
      if (allocated(error)) return
      call check(error, config%profiles(1)%last_rod, 3, 'last rod')
      if (allocated(error)) return
      call new_rod_profile(profile, again%profiles(2))
      call check_close(error, [profile%at(0.2_wp), profile%at(0.7_wp), profile%mean()], [1.0_wp, 3.0_wp, 2.0_wp], rounding, 'table')
   end subroutine reads_back

end module test_rod_profiles
