!> Forces and moments as functions of time, docs/model.md sec. 2, and `&load`.
!>
!> A load is zero outside [t_start, t_end], and a table is zero before its first time and, unless it is held, after its last.
!> Between two neighbouring switch times nothing appears, vanishes or bends: such an interval is a regime, chosen once, in which
!> constant loads are mere numbers and a load that does not act does not exist.
module rodyn_loads
   use rodyn_kinds, only: wp
   use rodyn_case_config, only: load_config
   use rodyn_switch_times, only: last_before, middle_of
   implicit none (type, external)
   private
   public :: load_set, new_load_set, load_times, is_zero, load_regime, new_load_regime, load_forces, evaluate_loads

   !> Words of the namelist as numbers, so that the right-hand side compares no text.
   integer, parameter :: law_constant = 1, law_sine_squared = 2, law_smooth_step = 3, law_table = 4

   !> One load.
   type :: load_type
      integer :: law = law_constant
      integer :: node = 0          !! 1..n; 0: the spacecraft
      integer :: component = 1     !! 1: X, 2: Y, 3: M
      real(wp) :: t_start = 0.0_wp, t_end = 0.0_wp !! it acts in between [s]
      real(wp) :: value = 0.0_wp   !! amplitude [N] or [N m]
      real(wp) :: rate = 0.0_wp    !! of sine_squared [rad/s]
      real(wp) :: rise = 0.0_wp    !! of smooth_step [s]
      real(wp), allocatable :: times(:), values(:) !! of a table [s], [N] or [N m]
   contains
      procedure :: drops
   end type load_type

   !> All loads of a case.
   type :: load_set
      type(load_type), allocatable :: loads(:)
   end type load_set

   !> What a load is within one regime.
   type :: load_piece
      integer :: law = law_constant
      integer :: node = 0
      integer :: component = 1
      real(wp) :: value = 0.0_wp, rate = 0.0_wp    !! as above; of a table, the value when the piece begins
      real(wp) :: t_start = 0.0_wp, span = 1.0_wp  !! of the rise, or of this piece of the table [s]
      real(wp) :: change = 0.0_wp                  !! of the value in this piece of the table
   end type load_piece

   !> What acts between two switches.
   type :: load_regime
      logical :: on_spacecraft = .false. !! some load acts on the spacecraft
      logical :: on_nodes = .false.      !! some load acts on a node
      type(load_piece), allocatable :: varying(:)  !! those that change with time
      real(wp) :: constant_base(3) = 0.0_wp        !! X_C, Y_C [N], M_C [N m] of all others
      real(wp), allocatable :: constant_node(:, :) !! X, Y of all others (2, n), size 0 if nodes are free [N]
   end type load_regime

   !> Values at one time.
   type :: load_forces
      real(wp) :: base(3) = 0.0_wp        !! X_C, Y_C [N], M_C [N m], moving axes
      real(wp), allocatable :: node(:, :) !! X, Y (2, n) [N], moving axes
   end type load_forces

contains

   !> Collect the loads.
   subroutine new_load_set(set, loads)
      type(load_set), intent(out) :: set
      type(load_config), intent(in), optional :: loads(:) !! absent (not allocated): none
      integer :: i

      if (.not. present(loads)) then
         allocate (set%loads(0))
         return
      end if
      allocate (set%loads(size(loads)))
      do i = 1, size(loads)
         call new_load(set%loads(i), loads(i))
      end do
   end subroutine new_load_set

   !> One load as it is given.
   subroutine new_load(load, given)
      type(load_type), intent(out) :: load
      type(load_config), intent(in) :: given

      if (given%target == 'node') load%node = given%node
      load%component = index('XYM', given%component(1:1))
      load%t_start = given%t_start
      load%t_end = given%t_end
      load%value = given%value
      load%rate = given%rate
      select case (given%law)
      case ('sine_squared')
         load%law = law_sine_squared
      case ('smooth_step')
         load%law = law_smooth_step
         load%rise = given%rise_time
      case ('table')
         load%law = law_table
         load%times = given%times
         load%values = given%values
         load%t_start = max(given%t_start, given%times(1))
         if (given%after /= 'hold') load%t_end = min(given%t_end, given%times(size(given%times)))
      case default
         load%law = law_constant
      end select
   end subroutine new_load

   !> Does a table end with the load still on?
   pure logical function drops(self)
      class(load_type), intent(in) :: self
      drops = .false.
      if (self%law /= law_table) return
      associate (last => size(self%times))
         drops = abs(self%values(last)) > 0.0_wp .and. self%t_end >= self%times(last) .and. self%t_end <= self%times(last)
      end associate
   end function drops

   !> Is a load zero at all times before one, which is behind its beginning?
   pure logical function is_zero(load, before)
      type(load_type), intent(in) :: load
      real(wp), intent(in) :: before !! [s]
      if (load%law == law_table) then
         associate (first => last_before(load%times, load%t_start), passed => count(load%times < min(before, load%t_end)))
            is_zero = .not. any(abs(load%values(first:min(passed + 1, size(load%times)))) > 0.0_wp)
         end associate
      else
         is_zero = .not. abs(load%value) > 0.0_wp .or. (load%law == law_sine_squared .and. .not. abs(load%rate) > 0.0_wp)
      end if
   end function is_zero

   !> All times where some load is not smooth, in no order [s].
   pure function load_times(set) result(times)
      type(load_set), intent(in) :: set
      real(wp), allocatable :: times(:)
      integer :: at, i, n

      n = 3*size(set%loads)
      do i = 1, size(set%loads)
         if (set%loads(i)%law == law_table) n = n + size(set%loads(i)%times)
      end do
      allocate (times(n))
      at = 0
      do i = 1, size(set%loads)
         associate (load => set%loads(i))
            times(at + 1:at + 3) = [load%t_start, load%t_end, load%t_start + load%rise]
            at = at + 3
            if (load%law /= law_table) cycle
            times(at + 1:at + size(load%times)) = min(max(load%times, load%t_start), load%t_end)
            at = at + size(load%times)
         end associate
      end do
   end function load_times

   !> What acts between two neighbouring switch times (or ends of the run).
   subroutine new_load_regime(regime, set, t_from, t_to, n)
      type(load_regime), intent(out) :: regime
      type(load_set), intent(in) :: set
      real(wp), intent(in) :: t_from, t_to !! [s]
      integer, intent(in) :: n             !! nodes
      type(load_piece), allocatable :: pieces(:)
      integer, allocatable :: acting(:)
      real(wp) :: middle
      integer :: i

      middle = middle_of(t_from, t_to)
      acting = pack([(i, i=1, size(set%loads))], set%loads%t_start < middle .and. middle < set%loads%t_end)
      allocate (pieces(size(acting)))
      do i = 1, size(acting)
         pieces(i) = piece_of(set%loads(acting(i)), middle)
      end do
      regime%on_nodes = any(pieces%node > 0)
      regime%on_spacecraft = any(pieces%node == 0)
      allocate (regime%constant_node(2, merge(n, 0, regime%on_nodes)), source=0.0_wp)
      regime%varying = pack(pieces, pieces%law /= law_constant)
      do i = 1, size(pieces)
         associate (piece => pieces(i))
            if (piece%law /= law_constant) cycle
            if (piece%node > 0) then
               regime%constant_node(piece%component, piece%node) = regime%constant_node(piece%component, piece%node) + piece%value
            else
               regime%constant_base(piece%component) = regime%constant_base(piece%component) + piece%value
            end if
         end associate
      end do
   end subroutine new_load_regime

   !> What a load is around a time at which it acts. Once a step has risen, and where a table is level, it is constant.
   pure type(load_piece) function piece_of(load, t) result(piece)
      type(load_type), intent(in) :: load
      real(wp), intent(in) :: t !! [s]
      integer :: i

      piece = load_piece(load%law, load%node, load%component, load%value, load%rate, load%t_start, load%rise)
      select case (load%law)
      case (law_smooth_step)
         if (t > load%t_start + load%rise) piece%law = law_constant
      case (law_table)
         i = last_before(load%times, t)
         piece%value = load%values(i)
         if (i < size(load%times)) then
            piece%t_start = load%times(i)
            piece%span = load%times(i + 1) - load%times(i)
            piece%change = load%values(i + 1) - load%values(i)
         end if
         if (.not. abs(piece%change) > 0.0_wp) piece%law = law_constant
      case default ! the others stay what they are
      end select
   end function piece_of

   !> Forces at time t. Call first with `fresh`, at the start of a regime; then only what varies is written.
   pure subroutine evaluate_loads(forces, regime, t, fresh)
      type(load_forces), intent(inout) :: forces
      type(load_regime), intent(in) :: regime
      real(wp), intent(in) :: t        !! [s], within the regime
      logical, intent(in) :: fresh     !! also copy the constant loads
      integer :: i

      if (fresh) then
         forces%base = regime%constant_base
         forces%node = regime%constant_node
      end if
      if (size(regime%varying) == 0) return
      forces%base = regime%constant_base
      do i = 1, size(regime%varying)
         associate (node => regime%varying(i)%node)
            if (node > 0) forces%node(:, node) = regime%constant_node(:, node)
         end associate
      end do
      do i = 1, size(regime%varying)
         associate (load => regime%varying(i), component => regime%varying(i)%component)
            if (load%node > 0) then
               forces%node(component, load%node) = forces%node(component, load%node) + value_at(load, t)
            else
               forces%base(component) = forces%base(component) + value_at(load, t)
            end if
         end associate
      end do
   end subroutine evaluate_loads

   !> A piece of a load at time t [N] or [N m].
   pure real(wp) function value_at(piece, t)
      type(load_piece), intent(in) :: piece
      real(wp), intent(in) :: t !! [s]
      real(wp) :: x

      select case (piece%law)
      case (law_sine_squared)
         value_at = piece%value*sin(piece%rate*t)**2
      case (law_smooth_step) ! continuous acceleration: value and two derivatives vanish at the start
         x = min(max((t - piece%t_start)/piece%span, 0.0_wp), 1.0_wp)
         value_at = piece%value*x**3*(10.0_wp - x*(15.0_wp - 6.0_wp*x))
      case (law_table)
         value_at = piece%value + piece%change*((t - piece%t_start)/piece%span)
      case default
         value_at = piece%value
      end select
   end function value_at

end module rodyn_loads
