!> The chain as free bodies held together by multipliers.
!>
!> Coordinates of a rod are inertial: (X, Y) of its inner end, the angle psi of its chord, and its shapes; of the spacecraft
!> (X, Y) of its centre and its angle. Joint k holds the ends of bodies k and k+1 together (2 equations), and a joint that is
!> locked their tangents, too. With M the mass matrices, one for each body, and G the gradients of all these equations,
!>     M x'' = f + G^T lambda,   G x'' = c,   (G M^-1 G^T) lambda = c - G M^-1 f,
!> the last block-tridiagonal with a block of three for each joint. Positions and velocities are put back on the constraints by
!> the same system after each step. Rods without inertia of their own bend by statics, with matrices solved in full.
module body_equations
   use scene_data, only: dp, scene_type, load_at, kinks_at
   use joint_laws, only: joint_law
   implicit none (type, external)
   private
   public :: chain_type, new_chain, rates, put_back, strike, joints_of, energies, find_statics, balance, drift

   type :: chain_type
      type(scene_type) :: s
      type(joint_law), allocatable :: joint(:) !! (0:n-1)
      integer :: first = 0, size = 3, nx = 0   !! coordinates of the spacecraft; of a rod; of all
      integer, allocatable :: relaxing(:)      !! joints whose rotation is a state
      real(dp) :: middle = 0.0_dp              !! a time between the switches around now
      real(dp), allocatable :: kink(:, :)      !! (0:n-1, 3) at the last time asked for
      real(dp), allocatable :: series(:, :), inverse(:, :) !! statics: see `find_statics`
      logical, allocatable :: given(:)         !! statics: th is given, T unknown (0:n-1)
      integer :: evaluations = 0
   end type chain_type

   !> What elimination of the multipliers needs.
   type :: elimination
      real(dp), allocatable :: inner(:, :, :), outer(:, :, :) !! M^-1 G^T of each body (6, 3, 0:n)
      real(dp), allocatable :: diagonal(:, :, :), coupling(:, :, :) !! (3, 3, 0:n-1)
      real(dp), allocatable :: factor(:, :, :)                 !! of mass matrices (6, 6, 0:n)
   end type elimination

contains

   subroutine new_chain(chain, s, joint)
      type(chain_type), intent(out) :: chain
      type(scene_type), intent(in) :: s
      type(joint_law), intent(in) :: joint(0:)
      integer :: k
      chain%s = s
      allocate (chain%joint(0:s%n - 1), source=joint)
      chain%first = merge(3, 0, s%free)
      chain%size = 3 + s%shapes
      chain%nx = chain%first + s%n*chain%size
      chain%relaxing = pack([(k, k=0, s%n - 1)], s%statics .and. s%exact .and. s%damper > 0.0_dp)
      allocate (chain%kink(0:s%n - 1, 3), chain%given(0:s%n - 1))
   end subroutine new_chain

   !> Where the coordinates of rod k begin.
   pure integer function at(chain, k)
      type(chain_type), intent(in) :: chain
      integer, intent(in) :: k
      at = chain%first + (k - 1)*chain%size
   end function at

   pure logical function is_locked(chain, k)
      type(chain_type), intent(in) :: chain
      integer, intent(in) :: k
      is_locked = .not. chain%s%statics .and. chain%joint(k)%rigid()
   end function is_locked

   !> M of body k and what of its force comes from its own motion, elasticity and loads.
   subroutine body(chain, k, x, v, base, node, m, f)
      type(chain_type), intent(in) :: chain
      integer, intent(in) :: k
      real(dp), intent(in) :: x(:), v(:)         !! of this body
      real(dp), intent(in) :: base(3), node(:, :) !! loads, inertial axes
      real(dp), intent(out) :: m(6, 6), f(6)
      real(dp) :: e(2), n(2), sv, svd, q(3), qd(3), w
      integer :: i, j, ns

      m = 0.0_dp
      f = 0.0_dp
      associate (s => chain%s)
         if (k == 0) then
            m(1, 1) = s%mass
            m(2, 2) = s%mass
            m(3, 3) = s%inertia
            f(1:3) = base
            return
         end if
         ns = s%shapes
         e = [cos(x(3)), sin(x(3))]
         n = [-e(2), e(1)]
         w = v(3)
         associate (a => x(4:3 + ns), ad => v(4:3 + ns))
            sv = sum(s%shape1(:ns, k)*a)
            svd = sum(s%shape1(:ns, k)*ad)
            q(:ns) = matmul(s%shape2(:ns, :ns, k), a)
            qd(:ns) = matmul(s%shape2(:ns, :ns, k), ad)
            m(1, 1) = s%m0(k)
            m(2, 2) = s%m0(k)
            m(3, 1:2) = s%m1(k)*n - sv*e
            m(3, 3) = s%m2(k) + sum(a*q(:ns))
            f(1:2) = w**2*(s%m1(k)*e + sv*n) + 2.0_dp*w*svd*e + node(:, k)
            f(3) = -2.0_dp*w*sum(a*qd(:ns)) + s%length(k)*sum(n*node(:, k))
            do j = 1, ns
               m(3 + j, 1:2) = s%shape1(j, k)*n
               m(3 + j, 3) = s%shape_s(j, k)
               do i = 1, j
                  m(3 + j, 3 + i) = s%shape2(i, j, k)
               end do
               f(3 + j) = w**2*q(j) - sum(s%stiffness(:ns, j, k)*a)
            end do
         end associate
      end associate
   end subroutine body

   !> Gradient (transposed) of joint k's three equations with the coordinates of its inboard (its `outer` end) or outboard body.
   subroutine gradient(chain, k, outer, x, g)
      type(chain_type), intent(in) :: chain
      integer, intent(in) :: k
      logical, intent(in) :: outer
      real(dp), intent(in) :: x(:) !! of that body
      real(dp), intent(out) :: g(6, 3)
      real(dp) :: arm(2), c, s

      g = 0.0_dp
      if (.not. outer) then
         g(1, 1) = 1.0_dp
         g(2, 2) = 1.0_dp
         if (.not. is_locked(chain, k)) return
         g(3, 3) = 1.0_dp
         if (chain%s%shapes > 0) g(4, 3) = 1.0_dp
         return
      end if
      c = cos(x(3))
      s = sin(x(3))
      if (k == 0) then
         arm = [c*chain%s%hinge(1) - s*chain%s%hinge(2), s*chain%s%hinge(1) + c*chain%s%hinge(2)]
      else
         arm = chain%s%length(k)*[c, s]
      end if
      g(1, 1) = -1.0_dp
      g(2, 2) = -1.0_dp
      g(3, 1:2) = [arm(2), -arm(1)]
      if (.not. is_locked(chain, k)) return
      g(3, 3) = -1.0_dp
      if (k > 0 .and. chain%s%shapes > 0) g(5, 3) = -1.0_dp
   end subroutine gradient

   !> Factors for one position: mass matrices and G M^-1 G^T.
   subroutine eliminate(chain, x, m, el)
      type(chain_type), intent(in) :: chain
      real(dp), intent(in) :: x(:)
      real(dp), intent(inout) :: m(6, 6, 0:chain%s%n)
      type(elimination), intent(out) :: el
      real(dp) :: g_inner(6, 3), g_outer(6, 3)
      integer :: k, b, nb, j

      associate (n => chain%s%n)
         allocate (el%inner(6, 3, 0:n), el%outer(6, 3, 0:n), el%diagonal(3, 3, 0:n - 1), el%coupling(3, 3, 0:n - 1), &
                   el%factor(6, 6, 0:n), source=0.0_dp)
         do k = merge(0, 1, chain%s%free), n
            b = merge(0, at(chain, k), k == 0)
            nb = merge(3, chain%size, k == 0)
            el%factor(:, :, k) = m(:, :, k)
            call cholesky(nb, el%factor(:, :, k))
            if (k > 0) then
               call gradient(chain, k - 1, .false., x(b + 1:b + nb), g_inner)
               el%inner(:, :, k) = g_inner
               do j = 1, merge(3, 2, is_locked(chain, k - 1))
                  call back(nb, el%factor(:, :, k), el%inner(:, j, k))
               end do
               el%diagonal(:, :, k - 1) = el%diagonal(:, :, k - 1) + matmul(transpose(g_inner(:nb, :)), el%inner(:nb, :, k))
            end if
            if (k == n) cycle
            call gradient(chain, k, .true., x(b + 1:b + nb), g_outer)
            el%outer(:, :, k) = g_outer
            do j = 1, merge(3, 2, is_locked(chain, k))
               call back(nb, el%factor(:, :, k), el%outer(:, j, k))
            end do
            el%diagonal(:, :, k) = el%diagonal(:, :, k) + matmul(transpose(g_outer(:nb, :)), el%outer(:nb, :, k))
            if (k > 0) el%coupling(:, :, k) = matmul(transpose(g_inner(:nb, :)), el%outer(:nb, :, k))
         end do
         do k = 0, n - 1
            if (.not. is_locked(chain, k)) el%diagonal(3, 3, k) = 1.0_dp
         end do
         do k = n - 1, 1, -1 ! from the tip: the Schur complement of each block goes to the one before
            call cholesky3(el%diagonal(:, :, k))
            el%diagonal(:, :, k - 1) = el%diagonal(:, :, k - 1) - &
                                       matmul(el%coupling(:, :, k), solved3(el%diagonal(:, :, k), transpose(el%coupling(:, :, k))))
         end do
         call cholesky3(el%diagonal(:, :, 0))
      end associate
   end subroutine eliminate

   !> lambda for a right-hand side of joints.
   subroutine multipliers(chain, el, lambda)
      type(chain_type), intent(in) :: chain
      type(elimination), intent(in) :: el
      real(dp), intent(inout) :: lambda(3, 0:chain%s%n - 1)
      integer :: k
      do k = chain%s%n - 1, 0, -1
         lambda(:, k:k) = solved3(el%diagonal(:, :, k), lambda(:, k:k))
         if (k > 0) lambda(:, k - 1) = lambda(:, k - 1) - matmul(el%coupling(:, :, k), lambda(:, k))
      end do
      do k = 1, chain%s%n - 1
         lambda(:, k:k) = lambda(:, k:k) - &
                          solved3(el%diagonal(:, :, k), matmul(transpose(el%coupling(:, :, k)), lambda(:, k - 1:k - 1)))
      end do
   end subroutine multipliers

   !> M^-1 G^T lambda for all bodies, added to z.
   subroutine add_reaction(chain, el, lambda, z)
      type(chain_type), intent(in) :: chain
      type(elimination), intent(in) :: el
      real(dp), intent(in) :: lambda(3, 0:chain%s%n - 1)
      real(dp), intent(inout) :: z(:)
      integer :: k, b, nb
      do k = merge(0, 1, chain%s%free), chain%s%n
         b = merge(0, at(chain, k), k == 0)
         nb = merge(3, chain%size, k == 0)
         if (k > 0) z(b + 1:b + nb) = z(b + 1:b + nb) + matmul(el%inner(:nb, :, k), lambda(:, k - 1))
         if (k < chain%s%n) z(b + 1:b + nb) = z(b + 1:b + nb) + matmul(el%outer(:nb, :, k), lambda(:, k))
      end do
   end subroutine add_reaction

   !> G z of all joints.
   function along(chain, x, z) result(g)
      type(chain_type), intent(in) :: chain
      real(dp), intent(in) :: x(:), z(:)
      real(dp) :: g(3, 0:chain%s%n - 1), column(6, 3)
      integer :: k, b, nb
      g = 0.0_dp
      do k = merge(0, 1, chain%s%free), chain%s%n
         b = merge(0, at(chain, k), k == 0)
         nb = merge(3, chain%size, k == 0)
         if (k > 0) then
            call gradient(chain, k - 1, .false., x(b + 1:b + nb), column)
            g(:, k - 1) = g(:, k - 1) + matmul(z(b + 1:b + nb), column(:nb, :))
         end if
         if (k < chain%s%n) then
            call gradient(chain, k, .true., x(b + 1:b + nb), column)
            g(:, k) = g(:, k) + matmul(z(b + 1:b + nb), column(:nb, :))
         end if
      end do
   end function along

   !> The equations of the joints themselves: gaps.
   function gaps(chain, x) result(gap)
      type(chain_type), intent(in) :: chain
      real(dp), intent(in) :: x(:)
      real(dp) :: gap(3, 0:chain%s%n - 1)
      real(dp) :: tip(2), tangent, c, s
      integer :: k, b

      tip = chain%s%hinge
      tangent = 0.0_dp
      if (chain%s%free) then
         c = cos(x(3))
         s = sin(x(3))
         tip = x(1:2) + [c*tip(1) - s*tip(2), s*tip(1) + c*tip(2)]
         tangent = x(3)
      end if
      do k = 0, chain%s%n - 1
         b = at(chain, k + 1)
         gap(1:2, k) = x(b + 1:b + 2) - tip
         gap(3, k) = x(b + 3) - tangent
         if (chain%s%shapes > 0) gap(3, k) = gap(3, k) + x(b + 4)
         gap(3, k) = gap(3, k) - chain%kink(k, 1) - chain%joint(k)%lock_angle
         if (.not. is_locked(chain, k)) gap(3, k) = 0.0_dp
         tip = x(b + 1:b + 2) + chain%s%length(k + 1)*[cos(x(b + 3)), sin(x(b + 3))]
         tangent = x(b + 3)
         if (chain%s%shapes > 0) tangent = tangent + x(b + 5)
      end do
   end function gaps

   !> Largest gap.
   real(dp) function drift(chain, x)
      type(chain_type), intent(in) :: chain
      real(dp), intent(in) :: x(:)
      drift = maxval(abs(gaps(chain, x)))
   end function drift

   subroutine mass_matrices(chain, x, m)
      type(chain_type), intent(in) :: chain
      real(dp), intent(in) :: x(:)
      real(dp), intent(out) :: m(6, 6, 0:chain%s%n)
      real(dp) :: f(6), none(2, chain%s%n), rest(6)
      integer :: k, b, nb
      none = 0.0_dp
      rest = 0.0_dp
      m = 0.0_dp
      do k = merge(0, 1, chain%s%free), chain%s%n
         b = merge(0, at(chain, k), k == 0)
         nb = merge(3, chain%size, k == 0)
         call body(chain, k, x(b + 1:b + nb), rest(:nb), [0.0_dp, 0.0_dp, 0.0_dp], none, m(:, :, k), f)
      end do
   end subroutine mass_matrices

   !> Put positions and velocities back on the constraints, by the least change in the metric of the masses.
   subroutine put_back(chain, t, x, v)
      type(chain_type), intent(inout) :: chain
      real(dp), intent(in) :: t
      real(dp), intent(inout) :: x(:), v(:)
      type(elimination) :: el
      real(dp) :: m(6, 6, 0:chain%s%n), lambda(3, 0:chain%s%n - 1)

      call kinks_at(chain%s, chain%middle, t, chain%kink)
      call mass_matrices(chain, x, m)
      call eliminate(chain, x, m, el)
      lambda = -gaps(chain, x)
      call multipliers(chain, el, lambda)
      call add_reaction(chain, el, lambda, x)
      lambda = -along(chain, x, v)
      call drive(chain, 2, lambda)
      call multipliers(chain, el, lambda)
      call add_reaction(chain, el, lambda, v)
   end subroutine put_back

   !> Add rates (2) or accelerations (3) of kinks at locked joints.
   subroutine drive(chain, order, lambda)
      type(chain_type), intent(in) :: chain
      integer, intent(in) :: order
      real(dp), intent(inout) :: lambda(3, 0:chain%s%n - 1)
      integer :: k
      do k = 0, chain%s%n - 1
         if (is_locked(chain, k)) lambda(3, k) = lambda(3, k) + chain%kink(k, order)
      end do
   end subroutine drive

   !> Velocities after joints have become locked: impulses at all joints; energy lost, and work of drives at locked ones.
   subroutine strike(chain, t, x, v, lost, worked)
      type(chain_type), intent(inout) :: chain
      real(dp), intent(in) :: t, x(:)
      real(dp), intent(inout) :: v(:)
      real(dp), intent(out) :: lost, worked
      type(elimination) :: el
      real(dp) :: m(6, 6, 0:chain%s%n), lambda(3, 0:chain%s%n - 1), change(size(v))
      integer :: k, b, nb, i, j

      call kinks_at(chain%s, chain%middle, t, chain%kink)
      call mass_matrices(chain, x, m)
      call eliminate(chain, x, m, el)
      lambda = -along(chain, x, v)
      call drive(chain, 2, lambda)
      call multipliers(chain, el, lambda)
      change = 0.0_dp
      call add_reaction(chain, el, lambda, change)
      v = v + change
      worked = sum(lambda(3, :)*chain%kink(:, 2))
      lost = 0.0_dp
      do k = merge(0, 1, chain%s%free), chain%s%n
         b = merge(0, at(chain, k), k == 0)
         nb = merge(3, chain%size, k == 0)
         do i = 1, nb
            lost = lost + 0.5_dp*m(i, i, k)*change(b + i)**2
            do j = 1, i - 1
               lost = lost + m(i, j, k)*change(b + i)*change(b + j)
            end do
         end do
      end do
   end subroutine strike

   !> Openings of the joints (angles between tangents) and their rates, without kinks.
   subroutine openings(chain, x, v, opening, rate)
      type(chain_type), intent(in) :: chain
      real(dp), intent(in) :: x(:), v(:)
      real(dp), intent(out) :: opening(0:), rate(0:)
      real(dp) :: tangent(2)
      integer :: k, b

      tangent = 0.0_dp
      if (chain%s%free) tangent = [x(3), v(3)]
      do k = 0, chain%s%n - 1
         b = at(chain, k + 1)
         opening(k) = x(b + 3) - tangent(1)
         rate(k) = v(b + 3) - tangent(2)
         tangent = [x(b + 3), v(b + 3)]
         if (chain%s%shapes == 0) cycle
         opening(k) = opening(k) + x(b + 4)
         rate(k) = rate(k) + v(b + 4)
         tangent = tangent + [x(b + 5), v(b + 5)]
      end do
   end subroutine openings

   !> Statics: with u = th of free joints and T of those whose th is given,
   !>     (1 or 0 + F (C or 1)) u = opening - gamma - F t0 - th given,
   !> F the flexibility of all rods in full. The inverse is kept while no branch changes.
   subroutine find_statics(chain)
      type(chain_type), intent(inout) :: chain
      real(dp) :: c, d, t0, f, a(chain%s%n, 2*chain%s%n)
      integer :: k, i, j, p
      real(dp), allocatable :: row(:)

      if (.not. chain%s%statics) return
      associate (n => chain%s%n)
         if (.not. allocated(chain%series)) then
            allocate (chain%series(0:n - 1, 0:n - 1), chain%inverse(0:n - 1, 0:n - 1))
            chain%series = 0.0_dp
            do k = 1, n ! moments -T(k-1), T(k) at the ends of rod k turn them by -(f11 T(k-1) + f12 T(k)) and f12 T(k-1) + f22 T(k)
               associate (fl => chain%s%flexibility(:, k))
                  chain%series(k - 1, k - 1) = chain%series(k - 1, k - 1) + fl(1)
                  if (k == n) cycle
                  chain%series(k - 1, k) = fl(2)
                  chain%series(k, k - 1) = fl(2)
                  chain%series(k, k) = fl(3)
               end associate
            end do
         end if
         chain%given = chain%joint%rigid()
         chain%given(chain%relaxing) = .true.
         a = 0.0_dp
         do k = 0, n - 1
            call chain%joint(k)%law(c, d, t0, f)
            a(:, k + 1) = chain%series(:, k)*merge(1.0_dp, c, chain%given(k))
            if (.not. chain%given(k)) a(k + 1, k + 1) = a(k + 1, k + 1) + 1.0_dp
            a(k + 1, n + k + 1) = 1.0_dp
         end do
         do i = 1, n
            p = i - 1 + maxloc(abs(a(i:, i)), 1)
            row = a(p, :)
            a(p, :) = a(i, :)
            a(i, :) = row/row(i)
            do j = 1, n
               if (j /= i) a(j, :) = a(j, :) - a(j, i)*a(i, :)
            end do
         end do
         chain%inverse = a(:, n + 1:)
      end associate
   end subroutine find_statics

   !> Joint rotations, rates, the moments that act on the rods and those that bend them. `relaxed` are th of relaxing joints.
   subroutine joints_of(chain, t, x, v, relaxed, th, rate, moment, bends)
      type(chain_type), intent(inout) :: chain
      real(dp), intent(in) :: t, x(:), v(:), relaxed(:)
      real(dp), intent(out) :: th(0:), rate(0:)
      real(dp), intent(out) :: moment(0:) !! 0 where a multiplier stands for it
      real(dp), intent(out) :: bends(0:)
      real(dp), dimension(0:chain%s%n - 1) :: c, d, t0, f, u, more, fixed
      integer :: k, i

      call kinks_at(chain%s, chain%middle, t, chain%kink)
      call openings(chain, x, v, th, rate)
      th = th - chain%kink(:, 1)
      rate = rate - chain%kink(:, 2)
      do k = 0, chain%s%n - 1
         call chain%joint(k)%law(c(k), d(k), t0(k), f(k))
      end do
      bends = 0.0_dp
      if (.not. chain%s%statics) then
         moment = c*th + d*rate + t0 + f
         where (chain%joint%rigid()) moment = 0.0_dp
         return
      end if
      fixed = merge(chain%joint%lock_angle, 0.0_dp, chain%joint%rigid())
      fixed(chain%relaxing) = relaxed
      u = th - matmul(chain%series, merge(0.0_dp, t0, chain%given)) - merge(fixed, 0.0_dp, chain%given)
      u = matmul(chain%inverse, u)
      th = merge(fixed, u, chain%given)
      bends = merge(u, c*u + t0, chain%given)
      moment = bends
      if (chain%s%exact) then
         rate = 0.0_dp
         do i = 1, size(chain%relaxing)
            k = chain%relaxing(i)
            if (.not. chain%joint(k)%rigid()) rate(k) = (moment(k) - c(k)*th(k) - t0(k) - f(k))/d(k)
         end do
      else
         rate = merge(0.0_dp, matmul(chain%inverse, rate), chain%given)
         more = merge(0.0_dp, d*rate + f, chain%given)
         moment = moment + matmul(more, chain%inverse)
      end if
   end subroutine joints_of

   !> Rotations of all joints when springs and rods are in balance and all dampers at rest.
   subroutine balance(chain, t, x, v, th)
      type(chain_type), intent(inout) :: chain
      real(dp), intent(in) :: t, x(:), v(:)
      real(dp), intent(out) :: th(0:)
      real(dp), dimension(0:chain%s%n - 1) :: rate, moment, bends
      integer, allocatable :: relaxing(:)

      allocate (relaxing(0))
      call move_and_keep()
      call find_statics(chain)
      call joints_of(chain, t, x, v, [real(dp) ::], th, rate, moment, bends)
      chain%relaxing = relaxing
      call find_statics(chain)

   contains

      subroutine move_and_keep()
         integer, allocatable :: empty(:)
         relaxing = chain%relaxing
         allocate (empty(0))
         chain%relaxing = empty
      end subroutine move_and_keep

   end subroutine balance

   !> y' for y = (x, v, th of relaxing joints, work of loads and drives, dissipated energy).
   subroutine rates(chain, t, y, dy)
      type(chain_type), intent(inout) :: chain
      real(dp), intent(in) :: t, y(:)
      real(dp), intent(out) :: dy(:)
      type(elimination) :: el
      real(dp) :: m(6, 6, 0:chain%s%n), f(6, 0:chain%s%n), base(3), node(2, chain%s%n), lambda(3, 0:chain%s%n - 1)
      real(dp), dimension(0:chain%s%n - 1) :: th, rate, moment, bends
      real(dp) :: c, s, tip(2), arm(2), cc, dd, t0, ff
      integer :: k, b, nb, i, nx, r

      chain%evaluations = chain%evaluations + 1
      nx = chain%nx
      r = size(chain%relaxing)
      associate (x => y(:nx), v => y(nx + 1:2*nx), n => chain%s%n)
         call load_at(chain%s, chain%middle, t, base, node)
         if (chain%s%free) then
            c = cos(x(3))
            s = sin(x(3))
            base(1:2) = [c*base(1) - s*base(2), s*base(1) + c*base(2)]
            do k = 1, n
               node(:, k) = [c*node(1, k) - s*node(2, k), s*node(1, k) + c*node(2, k)]
            end do
         end if
         call joints_of(chain, t, x, v, y(2*nx + 1:2*nx + r), th, rate, moment, bends)
         m = 0.0_dp
         f = 0.0_dp
         do k = merge(0, 1, chain%s%free), n
            b = merge(0, at(chain, k), k == 0)
            nb = merge(3, chain%size, k == 0)
            call body(chain, k, x(b + 1:b + nb), v(b + 1:b + nb), base, node, m(:, :, k), f(:, k))
            if (k < n) then
               f(3, k) = f(3, k) + moment(k)
               if (k > 0 .and. chain%s%shapes > 0) f(5, k) = f(5, k) + moment(k)
            end if
            if (k > 0) then
               f(3, k) = f(3, k) - moment(k - 1)
               if (chain%s%shapes > 0) f(4, k) = f(4, k) - moment(k - 1)
            end if
         end do
         call eliminate(chain, x, m, el)
         dy(:nx) = v
         do k = merge(0, 1, chain%s%free), n
            b = merge(0, at(chain, k), k == 0)
            nb = merge(3, chain%size, k == 0)
            call back(nb, el%factor(:, :, k), f(:, k))
            dy(nx + b + 1:nx + b + nb) = f(:nb, k)
         end do
         lambda = -along(chain, x, dy(nx + 1:2*nx))
         do k = 0, n - 1 ! the ends keep together: what turns in the meantime
            if (k > 0) then
               b = at(chain, k)
               lambda(1:2, k) = lambda(1:2, k) - chain%s%length(k)*v(b + 3)**2*[cos(x(b + 3)), sin(x(b + 3))]
            else if (chain%s%free) then
               arm = [c*chain%s%hinge(1) - s*chain%s%hinge(2), s*chain%s%hinge(1) + c*chain%s%hinge(2)]
               lambda(1:2, 0) = lambda(1:2, 0) - v(3)**2*arm
            end if
         end do
         call drive(chain, 3, lambda)
         call multipliers(chain, el, lambda)
         call add_reaction(chain, el, lambda, dy(nx + 1:2*nx))

         do i = 1, r
            dy(2*nx + i) = rate(chain%relaxing(i))
         end do
         associate (work => dy(2*nx + r + 1), heat => dy(2*nx + r + 2))
            work = 0.0_dp
            heat = 0.0_dp
            if (chain%s%free) work = sum(base*v(1:3))
            do k = 1, n
               b = at(chain, k)
               tip = v(b + 1:b + 2) + chain%s%length(k)*v(b + 3)*[-sin(x(b + 3)), cos(x(b + 3))]
               work = work + sum(node(:, k)*tip)
            end do
            do k = 0, n - 1
               if (is_locked(chain, k)) then
                  work = work + lambda(3, k)*chain%kink(k, 2)
                  cycle
               end if
               work = work - moment(k)*chain%kink(k, 2)
               if (chain%joint(k)%rigid()) cycle
               call chain%joint(k)%law(cc, dd, t0, ff)
               if (.not. chain%s%exact .or. dd > 0.0_dp) heat = heat + (dd*rate(k) + ff)*rate(k)
            end do
         end associate
      end associate
   end subroutine rates

   !> Kinetic and elastic energy.
   subroutine energies(chain, t, y, kinetic, elastic)
      type(chain_type), intent(inout) :: chain
      real(dp), intent(in) :: t, y(:)
      real(dp), intent(out) :: kinetic, elastic
      real(dp) :: m(6, 6, 0:chain%s%n), full(6, 6)
      real(dp), dimension(0:chain%s%n - 1) :: th, rate, moment, bends
      integer :: k, b, nb, nx, i, j

      nx = chain%nx
      associate (x => y(:nx), v => y(nx + 1:2*nx), n => chain%s%n, ns => chain%s%shapes)
         call mass_matrices(chain, x, m)
         kinetic = 0.0_dp
         elastic = 0.0_dp
         do k = merge(0, 1, chain%s%free), n
            b = merge(0, at(chain, k), k == 0)
            nb = merge(3, chain%size, k == 0)
            full = m(:, :, k)
            do j = 1, nb
               do i = 1, j - 1
                  full(i, j) = full(j, i)
               end do
            end do
            kinetic = kinetic + 0.5_dp*dot_product(v(b + 1:b + nb), matmul(full(:nb, :nb), v(b + 1:b + nb)))
            if (k == 0 .or. ns == 0) cycle
            elastic = elastic + 0.5_dp*dot_product(x(b + 4:b + 3 + ns), matmul(chain%s%stiffness(:ns, :ns, k), x(b + 4:b + 3 + ns)))
         end do
         call joints_of(chain, t, x, v, y(2*nx + 1:2*nx + size(chain%relaxing)), th, rate, moment, bends)
         do k = 0, n - 1
            elastic = elastic + chain%joint(k)%energy(th(k))
         end do
         if (chain%s%statics) elastic = elastic + 0.5_dp*dot_product(bends, matmul(chain%series, bends))
      end associate
   end subroutine energies

   ! ------------------------------------------------------------------ small matrices

   !> Cholesky's factor of the leading block, lower triangle.
   pure subroutine cholesky(n, a)
      integer, intent(in) :: n
      real(dp), intent(inout) :: a(6, 6)
      integer :: i, j, k
      do j = 1, n
         do k = 1, j - 1
            do i = j, n
               a(i, j) = a(i, j) - a(i, k)*a(j, k)
            end do
         end do
         a(j, j) = sqrt(a(j, j))
         a(j + 1:n, j) = a(j + 1:n, j)/a(j, j)
      end do
   end subroutine cholesky

   pure subroutine back(n, a, x)
      integer, intent(in) :: n
      real(dp), intent(in) :: a(6, 6)
      real(dp), intent(inout) :: x(6)
      integer :: i, j
      do i = 1, n
         x(i) = x(i)/a(i, i)
         do j = i + 1, n
            x(j) = x(j) - a(j, i)*x(i)
         end do
      end do
      do i = n, 1, -1
         do j = i + 1, n
            x(i) = x(i) - a(j, i)*x(j)
         end do
         x(i) = x(i)/a(i, i)
      end do
   end subroutine back

   pure subroutine cholesky3(a)
      real(dp), intent(inout) :: a(3, 3)
      integer :: j, k
      do j = 1, 3
         do k = 1, j - 1
            a(j:3, j) = a(j:3, j) - a(j:3, k)*a(j, k)
         end do
         a(j, j) = sqrt(a(j, j))
         a(j + 1:3, j) = a(j + 1:3, j)/a(j, j)
      end do
   end subroutine cholesky3

   pure function solved3(a, b) result(x)
      real(dp), intent(in) :: a(3, 3), b(:, :)
      real(dp) :: x(3, size(b, 2))
      integer :: i
      x = b
      do i = 1, 3
         x(i, :) = (x(i, :) - matmul(a(i, :i - 1), x(:i - 1, :)))/a(i, i)
      end do
      do i = 3, 1, -1
         x(i, :) = (x(i, :) - matmul(a(i + 1:, i), x(i + 1:, :)))/a(i, i)
      end do
   end function solved3

end module body_equations
