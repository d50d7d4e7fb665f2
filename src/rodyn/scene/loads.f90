!> Forces and moments as functions of time, docs/model.md sec. 2, and `&load`.
!>
!> A load is zero outside [t_start, t_end], and a table is zero before its first time and, unless it is held, after its last.
!> Between two neighbouring switch times nothing appears, vanishes or bends: such an interval is a regime, chosen once, in which
!> constant loads are mere numbers and a load that does not act does not exist.
module rodyn_loads
   use rodyn_kinds, only: wp
   use rodyn_case_config, only: load_config
   use rodyn_switch_times, only: middle_of
   use rodyn_time_law, only: time_law, new_time_law, value_at
   implicit none (type, external)
   private
   public :: load_set, new_load_set, load_regime, new_load_regime, load_forces, evaluate_loads

   !> One load, or what it is within one regime.
   type :: load_type
      type(time_law) :: law        !! [N] or [N m]
      integer :: node = 0          !! 1..n; 0: the spacecraft
      integer :: component = 1     !! 1: X, 2: Y, 3: M
   end type load_type

   !> All loads of a case.
   type :: load_set
      type(load_type), allocatable :: loads(:)
   end type load_set

   !> What acts between two switches.
   type :: load_regime
      logical :: on_spacecraft = .false. !! some load acts on the spacecraft
      logical :: on_nodes = .false.      !! some load acts on a node
      type(load_type), allocatable :: varying(:)   !! those that change with time
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
         call new_time_law(set%loads(i)%law, loads(i)%law, loads(i), of_motion=.false., hold=loads(i)%after == 'hold')
         if (loads(i)%target == 'node') set%loads(i)%node = loads(i)%node
         set%loads(i)%component = index('XYM', loads(i)%component(1:1))
      end do
   end subroutine new_load_set

   !> What acts between two neighbouring switch times (or ends of the run).
   subroutine new_load_regime(regime, set, t_from, t_to, n)
      type(load_regime), intent(out) :: regime
      type(load_set), intent(in) :: set
      real(wp), intent(in) :: t_from, t_to !! [s]
      integer, intent(in) :: n             !! nodes
      type(load_type), allocatable :: pieces(:)
      integer, allocatable :: acting(:)
      real(wp) :: middle
      integer :: i, n_varying

      middle = middle_of(t_from, t_to)
      acting = pack([(i, i=1, size(set%loads))], set%loads%law%runs_at(middle))
      regime%on_nodes = any(set%loads(acting)%node > 0)
      regime%on_spacecraft = any(set%loads(acting)%node == 0)
      allocate (regime%constant_node(2, merge(n, 0, regime%on_nodes)), source=0.0_wp)
      allocate (pieces(size(acting)))
      n_varying = 0
      do i = 1, size(acting)
         associate (load => set%loads(acting(i)), piece => pieces(n_varying + 1))
            call load%law%take_piece(middle, piece%law)
            piece%node = load%node
            piece%component = load%component
            if (.not. piece%law%is_still()) then
               n_varying = n_varying + 1
            else if (piece%node > 0) then
               regime%constant_node(piece%component, piece%node) = regime%constant_node(piece%component, piece%node) &
                                                                   + value_at(piece%law, middle)
            else
               regime%constant_base(piece%component) = regime%constant_base(piece%component) + value_at(piece%law, middle)
            end if
         end associate
      end do
      regime%varying = pieces(:n_varying)
   end subroutine new_load_regime

   !> Forces at time t. Call first with `fresh`, at the start of a regime; then only what varies is written.
   pure subroutine evaluate_loads(forces, regime, t, fresh)
      type(load_forces), intent(inout) :: forces
      type(load_regime), intent(in) :: regime
      real(wp), intent(in) :: t        !! [s], within the regime
      logical, intent(in) :: fresh     !! also copy the constant loads
      real(wp) :: value
      integer :: i

      if (fresh) then
         forces%base = regime%constant_base
         forces%node = regime%constant_node
      end if
      if (size(regime%varying) == 0) return
      forces%base = regime%constant_base
      if (regime%on_nodes) then
         do i = 1, size(regime%varying)
            associate (node => regime%varying(i)%node)
               if (node > 0) forces%node(:, node) = regime%constant_node(:, node)
            end associate
         end do
      end if
      do i = 1, size(regime%varying)
         associate (load => regime%varying(i), component => regime%varying(i)%component)
            value = value_at(load%law, t)
            if (load%node > 0) then
               forces%node(component, load%node) = forces%node(component, load%node) + value
            else
               forces%base(component) = forces%base(component) + value
            end if
         end associate
      end do
   end subroutine evaluate_loads

end module rodyn_loads
