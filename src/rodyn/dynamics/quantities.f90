!> What is read off a state: each quantity of the output with its name, dimension, unit and meaning. They stand here and nowhere
!> else; run files, sweep files, what these need of memory and disk, and the scripts that read them follow.
!>
!> A new quantity is a row of `quantities` and a `put` at the same place of `fill_row`.
module rodyn_quantities
   use rodyn_kinds, only: wp
   use rodyn_case_config, only: case_config
   use rodyn_kinematics, only: invariants_type, invariants, slopes
   use rodyn_motion, only: motion_type
   implicit none (type, external)
   private
   public :: quantity, chain_axes, entries, row_layout, row_type
   public :: layout_of, resized, numbers_that_change, new_row, fill_row, is_finite

   !> A coordinate that counts along the chain.
   type :: chain_axis
      character(len=8) :: name
      integer :: first     !! number of the first entry
      integer :: beyond_n  !! entries: n + beyond_n
      character(len=52) :: long_name
   end type chain_axis

   type(chain_axis), parameter :: chain_axes(3) = [ &
      chain_axis('rod', 1, 0, 'rod, counted from the spacecraft'), &
      chain_axis('hinge', 0, 0, 'hinge, counted from the spacecraft; 0 sits on it'), &
      chain_axis('node', 0, 1, 'node, counted from the spacecraft; 0 sits on it')]

   ! One number at each time, or one for each entry of an axis
   enum, bind(c)
      enumerator :: scalar = 0, rod, hinge, node
   end enum

   ! What a quantity belongs to
   enum, bind(c)
      enumerator :: chain = 1, bending, spacecraft !! always there; zero if rods are rigid, if the spacecraft is fixed
      enumerator :: third_shape                    !! there with three bending shapes
      enumerator :: ledger                         !! there with the ledger
      enumerator :: loads                          !! there if asked for
   end enum
   integer, parameter :: n_parts = loads

   type :: quantity
      character(len=20) :: name
      integer :: along  !! `scalar`, or a place in `chain_axes`
      integer :: part   !! what it belongs to
      character(len=12) :: units
      character(len=64) :: long_name
      integer :: first = 0, last = 0 !! its places in a row
   end type quantity

   type(quantity), parameter :: quantities(*) = [ &
      quantity('phi', rod, chain, 'rad', 'angle from the moving x axis to the chord of the rod'), &
      quantity('alpha', rod, bending, 'rad', 'slope of the rod against its chord at the inner end'), &
      quantity('beta', rod, bending, 'rad', 'slope of the rod against its chord at the outer end'), &
      quantity('phi_rate', rod, chain, 'rad s-1', 'rate of phi'), &
      quantity('alpha_rate', rod, bending, 'rad s-1', 'rate of alpha'), &
      quantity('beta_rate', rod, bending, 'rad s-1', 'rate of beta'), &
      quantity('bubble', rod, third_shape, 'm', 'deflection by the third bending shape in the middle of the rod'), &
      quantity('bubble_rate', rod, third_shape, 'm s-1', 'rate of bubble'), &
      quantity('velocity_x', scalar, spacecraft, 'm s-1', 'velocity of the spacecraft, moving x axis'), &
      quantity('velocity_y', scalar, spacecraft, 'm s-1', 'velocity of the spacecraft, moving y axis'), &
      quantity('omega', scalar, spacecraft, 'rad s-1', 'angular velocity of the spacecraft'), &
      quantity('displacement_x', scalar, spacecraft, 'm', 'displacement of the spacecraft, moving x axis'), &
      quantity('displacement_y', scalar, spacecraft, 'm', 'displacement of the spacecraft, moving y axis'), &
      quantity('rotation', scalar, spacecraft, 'rad', 'rotation of the spacecraft'), &
      quantity('energy_kinetic', scalar, ledger, 'J', 'kinetic energy'), &
      quantity('energy_elastic', scalar, ledger, 'J', 'elastic energy of hinges and rods'), &
      quantity('energy_dissipated', scalar, ledger, 'J', 'energy dissipated in the hinges since the start'), &
      quantity('work_external', scalar, ledger, 'J', 'work of loads and moving kinks since the start'), &
      quantity('energy_residual', scalar, ledger, 'J', 'kinetic + elastic + dissipated - work - their start'), &
      quantity('momentum_x', scalar, ledger, 'kg m s-1', 'linear momentum, inertial x axis'), &
      quantity('momentum_y', scalar, ledger, 'kg m s-1', 'linear momentum, inertial y axis'), &
      quantity('angular_momentum', scalar, ledger, 'kg m2 s-1', 'angular momentum about the inertial origin'), &
      quantity('hinge_angle', hinge, loads, 'rad', 'rotation of the hinge from its kink, which its spring feels'), &
      quantity('hinge_rate', hinge, loads, 'rad s-1', 'rate of hinge_angle')]

   !> Which quantities a row has, and where.
   type :: row_layout
      integer :: n_rods = 0
      integer :: n_values = 0 !! of a row
      logical :: has(n_parts) = .false.
      type(quantity), allocatable :: quantities(:) !! one behind the other
   contains
      procedure :: counts
      procedure :: before
      procedure :: row_shape
   end type row_layout

   !> The quantities at one time. What the scene has not is zero or slaved.
   type :: row_type
      type(row_layout) :: layout
      real(wp) :: time = 0.0_wp           !! [s]
      real(wp), allocatable :: values(:)  !! (layout%n_values)
      integer, private :: next = 1        !! quantity to be filled in
      logical, private :: compared = .false. !! all names, in the order of `fill_row`
   end type row_type

contains

   !> Entries of an axis along n rods.
   pure function entries(axis, n_rods)
      type(chain_axis), intent(in) :: axis
      integer, intent(in) :: n_rods
      integer :: entries(n_rods + axis%beyond_n)
      integer :: k
      entries = [(axis%first + k, k=0, size(entries) - 1)]
   end function entries

   !> The quantities of a case.
   pure function layout_of(config) result(layout)
      type(case_config), intent(in) :: config
      type(row_layout) :: layout
      logical :: has(n_parts)

      has = .true.
      has(third_shape) = config%model%bending_shapes == 3
      has(ledger) = config%output%ledger
      has(loads) = config%output%loads
      layout = new_layout(config%chain%n_rods, has)
   end function layout_of

   !> The same quantities of a chain of another length.
   pure function resized(layout, n_rods) result(other)
      type(row_layout), intent(in) :: layout
      integer, intent(in) :: n_rods
      type(row_layout) :: other
      other = new_layout(n_rods, layout%has)
   end function resized

   pure function new_layout(n_rods, has) result(layout)
      integer, intent(in) :: n_rods
      logical, intent(in) :: has(n_parts)
      type(row_layout) :: layout
      integer :: i

      layout%n_rods = n_rods
      layout%has = has
      layout%quantities = pack(quantities, has(quantities%part))
      do i = 1, size(layout%quantities)
         associate (x => layout%quantities(i))
            x%first = layout%n_values + 1
            x%last = layout%n_values + product(layout%row_shape(i))
            layout%n_values = x%last
         end associate
      end do
   end function new_layout

   !> Numbers of a row of a case that may change with time.
   pure integer function numbers_that_change(config)
      type(case_config), intent(in) :: config
      type(row_layout) :: layout

      layout = layout_of(config)
      layout%has(bending) = config%model%bending /= 'rigid'
      layout%has(spacecraft) = config%spacecraft%motion == 'free'
      layout = new_layout(layout%n_rods, layout%has)
      numbers_that_change = layout%n_values
   end function numbers_that_change

   !> Has it a quantity along this axis?
   pure logical function counts(self, axis)
      class(row_layout), intent(in) :: self
      integer, intent(in) :: axis !! of `chain_axes`
      counts = any(self%quantities%along == axis)
   end function counts

   !> The place before the first number of a quantity; -1: it is not there.
   pure integer function before(self, name)
      class(row_layout), intent(in) :: self
      character(len=*), intent(in) :: name
      integer :: i
      before = -1
      do i = 1, size(self%quantities)
         if (self%quantities(i)%name == name) before = self%quantities(i)%first - 1
      end do
   end function before

   !> Shape of quantity i at one time; empty: one number.
   pure function row_shape(self, i)
      class(row_layout), intent(in) :: self
      integer, intent(in) :: i
      integer, allocatable :: row_shape(:)
      associate (along => self%quantities(i)%along)
         allocate (row_shape(0))
         if (along /= scalar) row_shape = [self%n_rods + chain_axes(along)%beyond_n]
      end associate
   end function row_shape

   !> A row of zeros. Make one and use it for all times.
   pure function new_row(layout) result(row)
      type(row_layout), intent(in) :: layout
      type(row_type) :: row
      row%layout = layout
      allocate (row%values(layout%n_values), source=0.0_wp)
   end function new_row

   !> Are all numbers of a row finite?
   pure logical function is_finite(row)
      type(row_type), intent(in) :: row
      is_finite = all(abs(row%values) <= huge(1.0_wp))
   end function is_finite

   !> Read a row off the state y at time t, in the order of the table; kinks that move have been moved to t. The residual is
   !>     (kinetic + elastic + dissipated - work)(t) - (kinetic + elastic)(0),
   !> zero but for the integrator's error in a `consistent` scene, docs/model.md sec. 6.
   pure subroutine fill_row(motion, t, y, initial_energy, row)
      type(motion_type), intent(in) :: motion !! with a ledger, if the row has one
      real(wp), intent(in) :: t               !! [s]
      real(wp), intent(in) :: y(:)            !! (n_states)
      real(wp), intent(in) :: initial_energy  !! kinetic + elastic at t = 0 [J]; matters with the ledger
      type(row_type), intent(inout) :: row    !! of the same number of rods
      type(invariants_type) :: now
      real(wp) :: x(motion%dynamics%scene%n, 4) ! of each rod or hinge
      integer :: n, b, f

      associate (scene => motion%dynamics%scene, q => y(:motion%n_q), p => y(motion%n_q + 1:motion%n_q + motion%n_dof), &
                 sums => y(motion%n_q + motion%n_dof + 1:))
         n = scene%n
         b = merge(n, 0, scene%n_bend == 3) ! numbers of each bubble
         f = merge(1, 0, motion%free)       ! and of each coordinate of the spacecraft
         row%time = t
         row%next = 1
         call slopes(scene, motion%dynamics%hinges, q, p, x(:, 1), x(:, 2), x(:, 3), x(:, 4))
         call put(row, 'phi', q(scene%phi_at() + 1:scene%phi_at() + n))
         call put(row, 'alpha', x(:, 1))
         call put(row, 'beta', x(:, 2))
         call put(row, 'phi_rate', p(scene%phi_at() + 1:scene%phi_at() + n))
         call put(row, 'alpha_rate', x(:, 3))
         call put(row, 'beta_rate', x(:, 4))
         if (row%layout%has(third_shape)) then
            call put(row, 'bubble', q(scene%bend_at(3) + 1:scene%bend_at(3) + b))
            call put(row, 'bubble_rate', p(scene%bend_at(3) + 1:scene%bend_at(3) + b))
         end if
         call put(row, 'velocity_x', p(1:f))
         call put(row, 'velocity_y', p(2:1 + f))
         call put(row, 'omega', p(3:2 + f))
         call put(row, 'displacement_x', q(1:f))
         call put(row, 'displacement_y', q(2:1 + f))
         call put(row, 'rotation', q(3:2 + f))
         if (row%layout%has(ledger)) then
            now = invariants(scene, motion%dynamics%hinges, q, p)
            call put(row, 'energy_kinetic', [now%kinetic])
            call put(row, 'energy_elastic', [now%elastic])
            call put(row, 'energy_dissipated', sums(2:2))
            call put(row, 'work_external', sums(1:1))
            call put(row, 'energy_residual', [(now%kinetic + now%elastic + sums(2)) - (sums(1) + initial_energy)])
            call put(row, 'momentum_x', now%momentum(1:1))
            call put(row, 'momentum_y', now%momentum(2:2))
            call put(row, 'angular_momentum', [now%angular_momentum])
         end if
         if (row%layout%has(loads)) then
            call motion%dynamics%hinge_rotations(q, p, x(:, 1), x(:, 2))
            call put(row, 'hinge_angle', x(:, 1))
            call put(row, 'hinge_rate', x(:, 2))
         end if
      end associate
      row%compared = row%next > size(row%layout%quantities)
   end subroutine fill_row

   !> The next quantity of a row; none: it stays zero. Whether it is the one of this name is compared in the first row alone, which
   !> takes longer than all the rest.
   pure subroutine put(row, name, x)
      type(row_type), intent(inout) :: row
      character(len=*), intent(in) :: name
      real(wp), intent(in) :: x(:)

      if (row%next > size(row%layout%quantities)) return
      associate (place => row%layout%quantities(row%next))
         if (.not. row%compared) then
            if (place%name /= name) return
         end if
         row%values(place%first:place%first + size(x) - 1) = x
      end associate
      row%next = row%next + 1
   end subroutine put

end module rodyn_quantities
