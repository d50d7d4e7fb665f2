!> Natural modes of a linearised scene by LAPACK: eigenvalues, frequencies, damping ratios, shapes.
!>
!> What does not matter is left out exactly, so that no zero comes out as noise. Place and rotation act on nothing, and the
!> velocity of the spacecraft only through its acceleration: translation is eliminated, and what remains of the spacecraft is
!> its spin w. With M reduced by translation and spin, the undamped modes of the chain at rest,
!>     K x = omega^2 M x   (dsygvd),
!> are the answer if nothing else acts. Otherwise they are the coordinates in which the first-order equations of
!>     (omega eta, th of relaxing hinges, spin, eta')
!> are written down and solved (dgeev): for small damping and slow spin their matrix is nearly skew, so that small decays
!> keep their digits.
module rodyn_modes
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type, raise
   use rodyn_jacobi_rotation, only: jacobi_rotation, rotate_columns, rotate_rows
   use rodyn_lapack, only: dgeev, dgeevx, symmetric_eigenvalues
   use rodyn_linear_model, only: linear_model
   implicit none (type, external)
   private
   public :: mode_set, new_modes
   public :: rigid_body, mechanism, oscillation, relaxation

   !> What a mode is.
   character(len=*), parameter :: rigid_body = 'rigid body'   !! translation or rotation of the whole; eigenvalue 0
   character(len=*), parameter :: mechanism = 'mechanism'     !! nothing holds the chain against this motion; eigenvalue 0
   character(len=*), parameter :: oscillation = 'oscillation' !! a pair of complex eigenvalues, counted once
   character(len=*), parameter :: relaxation = 'relaxation'   !! a real eigenvalue, decaying or growing
   integer, parameter :: kind_length = 11
   real(wp), parameter :: noise = 1.0e-10_wp !! growth slower than this times the fastest rate is none
   real(wp), parameter :: slow = 1.0e-4_wp   !! times the fastest rate: what may be a zero of any kind
   real(wp), parameter :: rounding = 1.0e1_wp*epsilon(1.0_wp) !! of matrices, relative to their norms

   !> Modes in the order above, each kind by rising magnitude of its eigenvalue.
   type :: mode_set
      integer :: n = 0
      complex(wp), allocatable :: eigenvalue(:)  !! of oscillations the one with a positive imaginary part (n) [1/s]
      character(len=kind_length), allocatable :: kind(:) !! (n)
      complex(wp), allocatable :: shape(:, :)    !! changes of q (n_q, n): motion with kinetic energy |eigenvalue|^2/2
      real(wp), allocatable :: uncertainty(:)    !! what rounding may have done to the eigenvalue (n) [1/s]
      real(wp) :: fastest = 0.0_wp               !! largest magnitude [1/s]
      logical :: conservative = .false.          !! no damping, no gyration, a symmetric stiffness: real shapes
   contains
      procedure :: frequency
      procedure :: damping_ratio
      procedure :: decay
      procedure :: is_stable
      procedure :: oscillations
   end type mode_set

   !> The model without translation, in coordinates of undamped modes. s = (w, chain), or the chain alone.
   type :: reduced_model
      integer :: nc = 0, nw = 0                  !! coordinates of the chain; 1 with a free spacecraft
      real(wp), allocatable :: c(:, :), k(:, :)  !! D + G (s, s), K (s, n_q) without translation
      real(wp), allocatable :: basis(:, :)       !! undamped modes, M-orthonormal (nc, nc)
      real(wp), allocatable :: omega_2(:)        !! (nc) [1/s^2]
      real(wp), allocatable :: follow(:)         !! w = -follow . x' at zero angular momentum (nc)
      real(wp) :: inertia = 1.0_wp               !! of spin, translation free [kg m^2]
      real(wp) :: asymmetry = 0.0_wp             !! of K, relative
   end type reduced_model

contains

   !> Natural frequencies |eigenvalue| [rad/s].
   pure function frequency(self)
      class(mode_set), intent(in) :: self
      real(wp) :: frequency(self%n)
      frequency = abs(self%eigenvalue)
   end function frequency

   !> -Re/|eigenvalue|: 1 and -1 for real ones, 0 for rigid bodies and mechanisms.
   pure function damping_ratio(self) result(zeta)
      class(mode_set), intent(in) :: self
      real(wp) :: zeta(self%n)
      zeta = 0.0_wp
      where (abs(self%eigenvalue) > 0.0_wp) zeta = (0.0_wp - real(self%eigenvalue, wp))/abs(self%eigenvalue)
   end function damping_ratio

   !> Rates of decay [1/s].
   pure function decay(self)
      class(mode_set), intent(in) :: self
      real(wp) :: decay(self%n)
      decay = 0.0_wp - real(self%eigenvalue, wp) ! no negative zeros
   end function decay

   !> Does no mode grow, beyond rounding?
   elemental logical function is_stable(self, i)
      class(mode_set), intent(in) :: self
      integer, intent(in) :: i !! mode
      is_stable = real(self%eigenvalue(i), wp) <= max(noise*self%fastest, self%uncertainty(i))
   end function is_stable

   !> Which modes oscillate, by rising frequency.
   pure function oscillations(self) result(which)
      class(mode_set), intent(in) :: self
      integer, allocatable :: which(:)
      integer :: i
      which = pack([(i, i=1, self%n)], self%kind == oscillation)
   end function oscillations

   !> All modes of a linear model.
   subroutine new_modes(modes, model, with_shapes, error)
      type(mode_set), intent(out) :: modes
      type(linear_model), intent(in) :: model
      logical, intent(in) :: with_shapes !! otherwise eigenvalues and kinds only
      type(error_type), allocatable, intent(out) :: error
      type(reduced_model) :: reduced
      logical :: at_rest

      if (model%n == 0) then
         call raise(error, 'no modes: the spacecraft is fixed and every hinge is locked')
         return
      end if
      call reduce(reduced, model, error)
      if (allocated(error)) return
      if (reduced%nc == 0) then ! all of it is one rigid body, and loads along its axes do not feel how it moves
         modes%conservative = .true.
         call conservative_modes(modes, model, reduced, with_shapes)
         if (with_shapes) call complete_shapes(modes, model)
         return
      end if
      modes%fastest = sqrt(max(0.0_wp, maxval(abs(reduced%omega_2))))
      at_rest = model%is_steady(modes%fastest) .and. .not. model%loaded
      if (model%n_base > 0) at_rest = at_rest .and. abs(model%p(3)) <= 0.0_wp
      modes%conservative = at_rest .and. model%n_joints == 0 .and. all(abs(reduced%c) <= 0.0_wp) .and. &
                           reduced%asymmetry <= 1.0e3_wp*epsilon(1.0_wp)
      if (modes%conservative) then
         call conservative_modes(modes, model, reduced, with_shapes)
      else
         call general_modes(modes, model, reduced, at_rest, with_shapes, error)
      end if
      if (with_shapes .and. .not. allocated(error)) call complete_shapes(modes, model)
   end subroutine new_modes

   !> Eliminate translation: with the total mass m, M_VV = m 1. Then find the undamped modes of the chain.
   subroutine reduce(reduced, model, error)
      type(reduced_model), intent(out) :: reduced
      type(linear_model), intent(in) :: model
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: m(:, :), mc(:, :), kc(:, :), by_translation(:, :)
      integer :: s, n, i, j

      n = model%n
      reduced%nw = merge(1, 0, model%n_base > 0)
      reduced%nc = n - model%n_base
      s = model%n_base + 1 - reduced%nw ! first of w and the chain
      m = model%mass(s:, s:)
      reduced%c = model%damping(s:, s:) + model%gyration(s:, s:)
      reduced%k = model%stiffness(s:, :)
      if (model%n_base > 0) then
         by_translation = model%mass(s:, 1:2)/model%mass(1, 1)
         m = m - matmul(by_translation, model%mass(1:2, s:))
         reduced%c = reduced%c - matmul(by_translation, model%gyration(1:2, s:) + model%damping(1:2, s:))
         reduced%k = reduced%k - matmul(by_translation, model%stiffness(1:2, :))
      end if
      mc = m(reduced%nw + 1:, reduced%nw + 1:)
      kc = reduced%k(reduced%nw + 1:, model%n_base + 1:n)
      if (reduced%nw == 1) then
         reduced%inertia = m(1, 1)
         reduced%follow = m(1, 2:)/m(1, 1)
         do j = 1, reduced%nc
            do i = 1, reduced%nc
               mc(i, j) = mc(i, j) - reduced%follow(i)*m(1, j + 1)
               kc(i, j) = kc(i, j) - reduced%follow(i)*reduced%k(1, model%n_base + j)
            end do
         end do
      end if
      reduced%asymmetry = max(0.0_wp, maxval(abs(kc - transpose(kc)))) ! rigid chains with all hinges locked have no elements
      if (reduced%nw == 1) reduced%asymmetry = max(reduced%asymmetry, maxval(abs(reduced%k(1, :))))
      reduced%asymmetry = reduced%asymmetry/max(maxval(abs(kc)), tiny(1.0_wp))
      kc = 0.5_wp*(kc + transpose(kc))
      reduced%basis = kc
      call symmetric_eigenvalues(reduced%basis, mc, reduced%omega_2, .true., error)
      if (.not. allocated(error)) call polish_modes(kc, reduced%basis, reduced%omega_2)
   end subroutine reduce

   !> Give slow modes beside fast ones their digits back. dsygvd is off by epsilon times the largest omega^2, which mixes modes
   !> that are slow against it with each other; their own stiffness x^T K x has no such error, since what is slow has much
   !> mass and so small x. Rotations by Jacobi make it diagonal, each element to rounding of the two beside it.
   subroutine polish_modes(k, basis, omega_2)
      real(wp), intent(in) :: k(:, :)        !! symmetric
      real(wp), contiguous, intent(inout) :: basis(:, :) !! M-orthonormal
      real(wp), intent(inout) :: omega_2(:)  !! rising
      integer, parameter :: most_sweeps = 20
      real(wp), parameter :: negligible = 10.0_wp*epsilon(1.0_wp)
      real(wp), allocatable :: h(:, :)
      integer, allocatable :: order(:)
      real(wp) :: c, s
      integer :: i, j, sweep
      logical :: done

      h = matmul(transpose(basis), matmul(k, basis))
      do sweep = 1, most_sweeps
         done = .true.
         do j = 2, size(h, 1)
            do i = 1, j - 1
               if (abs(h(i, j)) <= negligible*sqrt(abs(h(i, i)))*sqrt(abs(h(j, j)))) cycle
               if (abs(h(i, j)) <= tiny(1.0_wp)) cycle
               done = .false.
               call jacobi_rotation(h(i, i), h(j, j), h(i, j), c, s)
               call rotate_columns(h, i, j, c, s)
               call rotate_rows(h, i, j, c, s)
               call rotate_columns(basis, i, j, c, s)
            end do
         end do
         if (done) exit
      end do
      omega_2 = [(h(i, i), i=1, size(h, 1))]
      order = rising_order(omega_2)
      omega_2 = omega_2(order)
      basis = basis(:, order)
   end subroutine polish_modes

   !> The undamped modes are all there is.
   subroutine conservative_modes(modes, model, reduced, with_shapes)
      type(mode_set), intent(inout) :: modes
      type(linear_model), intent(in) :: model
      type(reduced_model), intent(in) :: reduced
      logical, intent(in) :: with_shapes
      character(len=kind_length), allocatable :: kind(:)
      complex(wp), allocatable :: eigenvalue(:)
      real(wp), allocatable :: omega(:)
      integer :: i, n_zero

      n_zero = model%n_free_hinges
      omega = sqrt(max(reduced%omega_2(n_zero + 1:), 0.0_wp))
      eigenvalue = (0.0_wp, 1.0_wp)*omega
      allocate (kind(size(omega)))
      kind = oscillation
      call begin_modes(modes, model, reduced, eigenvalue, kind, 3*reduced%nw, n_zero, with_shapes)
      if (.not. with_shapes) return
      do i = 1, size(omega)
         modes%shape(:, modes%n - size(omega) + i) = rest_shape(model, reduced, reduced%basis(:, n_zero + i))
      end do
   end subroutine conservative_modes

   !> Rigid bodies and mechanisms, and the eigenvalues of the others.
   subroutine begin_modes(modes, model, reduced, eigenvalue, kind, n_rigid, n_zero, with_shapes)
      type(mode_set), intent(inout) :: modes
      type(linear_model), intent(in) :: model
      type(reduced_model), intent(in) :: reduced
      complex(wp), intent(in) :: eigenvalue(:)
      character(len=*), intent(in) :: kind(:)
      integer, intent(in) :: n_rigid !! rigid-body modes
      integer, intent(in) :: n_zero  !! mechanisms: the first undamped modes
      logical, intent(in) :: with_shapes
      integer :: i, first

      first = n_rigid + n_zero
      modes%n = first + size(eigenvalue)
      allocate (modes%eigenvalue(modes%n), source=(0.0_wp, 0.0_wp))
      allocate (modes%uncertainty(modes%n), source=0.0_wp)
      allocate (modes%kind(modes%n))
      modes%eigenvalue(first + 1:) = eigenvalue
      modes%kind(:n_rigid) = rigid_body
      modes%kind(n_rigid + 1:first) = mechanism
      modes%kind(first + 1:) = kind
      if (size(eigenvalue) > 0) modes%fastest = maxval(abs(eigenvalue))
      if (.not. with_shapes) return
      allocate (modes%shape(model%n + model%n_joints, modes%n), source=(0.0_wp, 0.0_wp))
      do i = 1, n_rigid
         modes%shape(i, i) = 1.0_wp
      end do
      do i = 1, n_zero
         modes%shape(:, n_rigid + i) = rest_shape(model, reduced, reduced%basis(:, i))
      end do
   end subroutine begin_modes

   !> The spacecraft follows a motion of the chain so that all momenta stay zero.
   pure function rest_shape(model, reduced, x) result(shape)
      type(linear_model), intent(in) :: model
      type(reduced_model), intent(in) :: reduced
      real(wp), intent(in) :: x(:) !! of the chain (nc)
      complex(wp) :: shape(model%n + model%n_joints)
      real(wp) :: full(model%n)

      full(model%n_base + 1:) = x
      if (reduced%nw == 1) then
         full(3) = -dot_product(reduced%follow, x)
         full(1:2) = -matmul(model%mass(1:2, 3:), full(3:))/model%mass(1, 1) + [model%q(2), -model%q(1)]*full(3)
      end if
      shape = (0.0_wp, 0.0_wp)
      shape(:size(full)) = full
   end function rest_shape

   !> Eigenvalues of the first-order equations.
   subroutine general_modes(modes, model, reduced, at_rest, with_shapes, error)
      type(mode_set), intent(inout) :: modes
      type(linear_model), intent(in) :: model
      type(reduced_model), intent(in) :: reduced
      logical, intent(in) :: at_rest     !! an unloaded equilibrium that does not spin
      logical, intent(in) :: with_shapes
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: a(:, :), scale(:), re(:), im(:), vectors(:, :), doubt(:)
      character(len=kind_length), allocatable :: kind(:)
      complex(wp), allocatable :: eigenvalue(:)
      integer, allocatable :: which(:)
      integer :: i, n_rigid, n_known, n_zero, n_neutral

      call first_order_matrix(a, scale, model, reduced)
      call eigen(a, scale, modes%fastest**2, with_shapes, re, im, vectors, doubt, error)
      if (allocated(error)) return
      ! Zeros that must be there: the spin if angular momentum stays or nothing feels it, and folding at hinges without spring.
      n_rigid = 2*reduced%nw
      if (keeps_spin(model, reduced, modes%fastest)) n_rigid = 3
      n_known = n_rigid - 2*reduced%nw
      n_zero = 0
      if (at_rest) then
         n_zero = model%n_free_hinges
         n_known = n_known + n_zero + model%n_idle_hinges
      end if
      call select_modes(n_known, scale, vectors, doubt, re, im, which, n_neutral)
      eigenvalue = cmplx(re(which), im(which), wp)
      allocate (kind(size(which)))
      kind = relaxation
      where (im(which) > 0.0_wp) kind = oscillation
      kind(:n_neutral) = mechanism
      call begin_modes(modes, model, reduced, eigenvalue, kind, n_rigid, n_zero, with_shapes)
      modes%uncertainty(n_rigid + n_zero + 1:) = doubt(which)
      if (.not. with_shapes) return
      do i = 1, size(which)
         associate (vector => vector_of(vectors, im, which(i)))
            modes%shape(:, n_rigid + n_zero + i) = moving_shape(model, reduced, scale, eigenvalue(i), vector)
         end associate
      end do
   end subroutine general_modes

   !> Does a change of the spin stay as it is?
   logical function keeps_spin(model, reduced, fastest)
      type(linear_model), intent(in) :: model
      type(reduced_model), intent(in) :: reduced
      real(wp), intent(in) :: fastest !! [1/s]
      keeps_spin = .false.
      if (reduced%nw == 0) return
      keeps_spin = (model%is_steady(fastest) .and. .not. model%loaded) .or. &
                   maxval(abs(reduced%c(:, 1))) <= 1.0e3_wp*epsilon(1.0_wp)*maxval(abs(model%mass))*maxval(abs(model%p(1:2)))
   end function keeps_spin

   !> Which eigenvalues are modes, one of each complex pair: motions that nothing holds, whose eigenvalues become exact zeros, then
   !> oscillations, then real ones, each by rising magnitude.
   subroutine select_modes(n_known, scale, vectors, doubt, re, im, which, n_neutral)
      integer, intent(in) :: n_known !! of the smallest: left out
      real(wp), intent(in) :: scale(:), vectors(:, :), doubt(:) !! as `eigen` has them
      real(wp), intent(inout) :: re(:), im(:)
      integer, allocatable, intent(out) :: which(:)
      integer, intent(out) :: n_neutral !! motions that nothing holds
      integer, allocatable :: order(:), neutral(:)
      logical, allocatable :: mask(:)

      order = rising_order(hypot(re, im))
      allocate (mask(size(re)))
      mask = im(order) >= 0.0_wp
      mask(:n_known) = .false.
      order = pack(order, mask)
      neutral = motions_of_zeros(scale, vectors, im, pack(order, hypot(re(order), im(order)) <= doubt(order)))
      order = pack(order, hypot(re(order), im(order)) > doubt(order))
      which = [neutral, pack(order, im(order) > 0.0_wp), pack(order, .not. im(order) > 0.0_wp)]
      re(neutral) = 0.0_wp
      im(neutral) = 0.0_wp
      n_neutral = size(neutral)
   end subroutine select_modes

   !> One of the zeros for each of the motions that they stand for: two zeros of one motion differ in its rate only.
   function motions_of_zeros(scale, vectors, im, zeros) result(motions)
      real(wp), intent(in) :: scale(:), vectors(:, :), im(:)
      integer, intent(in) :: zeros(:)
      integer, allocatable :: motions(:)
      complex(wp) :: x(size(scale)), other(size(scale))
      integer :: j, k

      allocate (motions(0))
      do j = 1, size(zeros)
         x = place_of(zeros(j))
         do k = 1, size(motions)
            other = place_of(motions(k))
            if (abs(dot_product(x, other))**2 > 0.99_wp*real(dot_product(x, x)*dot_product(other, other), wp)) exit
         end do
         if (k > size(motions)) motions = [motions, zeros(j)]
      end do

   contains

      !> What a vector does to the chain's place.
      pure function place_of(i) result(x)
         integer, intent(in) :: i
         complex(wp) :: x(size(scale))
         complex(wp) :: vector(size(vectors, 1))
         vector = vector_of(vectors, im, i)
         x = vector(:size(scale))/scale
      end function place_of

   end function motions_of_zeros

   !> d/dt (scale eta, th, spin, eta') = A (...), spin = sqrt(inertia) (w + follow . x'), x = basis eta.
   subroutine first_order_matrix(a, scale, model, reduced)
      real(wp), allocatable, intent(out) :: a(:, :)
      real(wp), allocatable, intent(out) :: scale(:) !! (nc) [1/s]
      type(linear_model), intent(in) :: model
      type(reduced_model), intent(in) :: reduced
      real(wp), allocatable :: c(:, :), k(:, :), joints(:, :)
      integer :: i, j, nc, nw, nj, v, b, n

      nc = reduced%nc
      nw = reduced%nw
      nj = model%n_joints
      b = model%n_base
      n = model%n
      v = nc + nj ! before the rates
      scale = sqrt(abs(reduced%omega_2))
      scale = max(scale, 1.0e-6_wp*maxval(scale), tiny(1.0_wp))
      if (maxval(scale) <= tiny(1.0_wp)) scale = 1.0_wp

      k = to_modes(reduced, reduced%k(:, b + 1:))
      c = to_modes(reduced, reduced%c)
      c = transpose(to_modes(reduced, transpose(c)))
      allocate (a(v + nw + nc, v + nw + nc), source=0.0_wp)
      do i = 1, nc
         a(i, v + nw + i) = scale(i)
      end do
      a(v + 1:, :nc) = -matmul(k(:, :nc), reduced%basis)
      a(v + 1:, nc + 1:v) = -k(:, nc + 1:)
      a(v + 1:, v + 1:) = -c
      if (nj > 0) then
         joints = model%joints
         a(nc + 1:v, :nc) = matmul(joints(:, b + 1:n), reduced%basis)
         a(nc + 1:v, nc + 1:v) = joints(:, n + 1:)
      end if
      do j = 1, nc
         a(nc + 1:, j) = a(nc + 1:, j)/scale(j)
      end do
   end subroutine first_order_matrix

   !> T^T x, rows (w, chain) to rows (spin, modes):  T = ((1/sqrt(inertia), -follow^T basis), (0, basis)).
   function to_modes(reduced, x) result(y)
      type(reduced_model), intent(in) :: reduced
      real(wp), intent(in) :: x(:, :)
      real(wp), allocatable :: y(:, :)
      real(wp), allocatable :: chain(:, :)
      integer :: j

      chain = x(reduced%nw + 1:, :)
      allocate (y(size(x, 1), size(x, 2)))
      if (reduced%nw == 1) then
         y(1, :) = x(1, :)/sqrt(reduced%inertia)
         do j = 1, size(x, 2)
            chain(:, j) = chain(:, j) - reduced%follow*x(1, j)
         end do
      end if
      y(reduced%nw + 1:, :) = matmul(transpose(reduced%basis), chain)
   end function to_modes

   !> Eigenvalues, right vectors, and what rounding may have done to the eigenvalues. A zero of two, or of three, that has fewer
   !> vectors comes out as values of the size of the square, or cube, root of epsilon around it: their condition tells. It is
   !> asked for, and vectors with it, only where a rate is so small that it might be such a zero, or where vectors are wanted.
   !> The matrix is off by rounding of its norm, and, where it has stiffnesses over small scales, by rounding of the largest.
   subroutine eigen(a, scale, stiffness, with_vectors, re, im, vectors, doubt, error)
      real(wp), intent(inout) :: a(:, :)
      real(wp), intent(in) :: scale(:)  !! of the leading coordinates [1/s]
      real(wp), intent(in) :: stiffness !! the largest, over the mass [1/s^2]
      logical, intent(in) :: with_vectors
      real(wp), allocatable, intent(out) :: re(:), im(:), vectors(:, :) !! the last is not set where it is not needed
      real(wp), allocatable, intent(out) :: doubt(:)                    !! [1/s]
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: copy(:, :), left(:, :), work(:), balance(:), condition(:)
      integer, allocatable :: unused(:)
      real(wp) :: norm, work_size(1), of_vectors(1)
      integer :: info, n, low, high, i
      logical :: asked

      n = size(a, 1)
      allocate (re(n), im(n), vectors(n, n), left(n, n), doubt(n), balance(n), condition(n), unused(2*n))
      call dgeevx('B', 'V', 'V', 'E', n, a, n, re, im, left, n, vectors, n, low, high, balance, norm, condition, of_vectors, &
                  work_size, -1, unused, info)
      allocate (work(int(work_size(1))))
      info = 0
      doubt = 0.0_wp
      asked = with_vectors
      if (.not. asked) then
         copy = a
         call dgeev('N', 'N', n, copy, n, re, im, left, n, vectors, n, work, size(work), info)
         if (info == 0) asked = minval(hypot(re, im)) <= slow*maxval(hypot(re, im))
      end if
      if (asked) then
         call dgeevx('B', 'V', 'V', 'E', n, a, n, re, im, left, n, vectors, n, low, high, balance, norm, condition, of_vectors, &
                     work, size(work), unused, info)
         do i = 1, n
            if (hypot(re(i), im(i)) > slow*maxval(hypot(re, im))) cycle
            associate (x => vectors(:size(scale), merge(i - 1, i, im(i) < 0.0_wp)))
               doubt(i) = rounding*(norm + stiffness*maxval(abs(x)/scale))/max(condition(i), epsilon(1.0_wp))
            end associate
         end do
      end if
      if (info /= 0) call raise(error, 'dgeev: the QR algorithm did not find all eigenvalues')
   end subroutine eigen

   !> Vector of the eigenvalue in place i, which has no negative imaginary part.
   pure function vector_of(vectors, im, i) result(vector)
      real(wp), intent(in) :: vectors(:, :), im(:)
      integer, intent(in) :: i
      complex(wp) :: vector(size(vectors, 1))
      if (im(i) > 0.0_wp) then
         vector = cmplx(vectors(:, i), vectors(:, i + 1), wp)
      else
         vector = cmplx(vectors(:, i), 0.0_wp, wp)
      end if
   end function vector_of

   !> Shape of a mode, with the translation and rotation of the spacecraft that go with it.
   pure function moving_shape(model, reduced, scale, lambda, z) result(shape)
      type(linear_model), intent(in) :: model
      type(reduced_model), intent(in) :: reduced
      real(wp), intent(in) :: scale(:)
      complex(wp), intent(in) :: lambda
      complex(wp), intent(in) :: z(:) !! as the first-order equations have it
      complex(wp) :: shape(model%n + model%n_joints)
      complex(wp) :: p(model%n), force(2)
      real(wp) :: energy
      integer :: b, n, nj, v

      b = model%n_base
      n = model%n
      nj = model%n_joints
      v = reduced%nc + nj + reduced%nw
      shape = (0.0_wp, 0.0_wp)
      shape(b + 1:n) = matmul(reduced%basis, z(:reduced%nc)/scale)
      shape(n + 1:) = z(reduced%nc + 1:reduced%nc + nj)
      p(b + 1:) = matmul(reduced%basis, z(v + 1:))
      if (b > 0) then
         p(3) = z(v)/sqrt(reduced%inertia) - sum(reduced%follow*p(4:))
         force = -(matmul(lambda*model%mass(1:2, 3:) + model%gyration(1:2, 3:) + model%damping(1:2, 3:), p(3:)) + &
                   matmul(model%stiffness(1:2, :), shape))
         p(1:2) = turning_response(lambda, model%p(3), force/model%mass(1, 1))
         shape(1:2) = turning_response(lambda, model%p(3), p(1:2) + [model%q(2), -model%q(1)]*p(3))
         if (abs(lambda) > 0.0_wp) shape(3) = p(3)/lambda
      end if
      energy = real(dot_product(p, matmul(model%mass, p)), wp)
      if (energy > 0.0_wp .and. abs(lambda) > 0.0_wp) shape = shape*(abs(lambda)/sqrt(energy))
   end function moving_shape

   !> From the coordinates that are kept to all of them, turned so that the largest of the chain is real and positive.
   subroutine complete_shapes(modes, model)
      type(mode_set), intent(inout) :: modes
      type(linear_model), intent(in) :: model
      complex(wp), allocatable :: shape(:, :)
      complex(wp) :: largest
      integer :: i, last

      last = size(model%p)
      allocate (shape(size(model%q), modes%n))
      do i = 1, modes%n
         shape(:, i) = model%whole(modes%shape(:, i))
         largest = shape(model%n_base + maxloc(abs(shape(model%n_base + 1:last, i)), 1), i)
         if (abs(largest) > 0.0_wp) shape(:, i) = shape(:, i)*(conjg(largest)/abs(largest))
      end do
      call move_alloc(shape, modes%shape)
   end subroutine complete_shapes

   !> x of  lambda x + w (-x_2, x_1) = f: a vector along turning axes. Translation at lambda = +-i w is at rest along inertial
   !> axes and belongs to no mode of the chain.
   pure function turning_response(lambda, w, f) result(x)
      complex(wp), intent(in) :: lambda, f(2)
      real(wp), intent(in) :: w
      complex(wp) :: x(2), det

      x = (0.0_wp, 0.0_wp)
      det = lambda**2 + w**2
      if (abs(det) <= 1.0e-10_wp*(abs(lambda)**2 + w**2)) return
      x = [lambda*f(1) + w*f(2), lambda*f(2) - w*f(1)]/det
   end function turning_response

   !> Indices that sort values (insertion into a sorted list: there are some thousands at most).
   pure function rising_order(x) result(order)
      real(wp), intent(in) :: x(:)
      integer :: order(size(x))
      integer :: i, j

      do i = 1, size(x)
         j = i
         do while (j > 1)
            if (.not. x(order(j - 1)) > x(i)) exit
            order(j) = order(j - 1)
            j = j - 1
         end do
         order(j) = i
      end do
   end function rising_order

end module rodyn_modes
