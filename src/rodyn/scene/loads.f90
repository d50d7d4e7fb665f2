!> Forces and moments as functions of time, docs/model.md sec. 2, and `&load`.
!>
!> A load is zero outside [t_start, t_end]. Between two neighbouring switch times nothing appears, vanishes or
!> bends: such an interval is a regime, chosen once, in which constant loads are mere numbers and a load that
!> does not act does not exist.
module rodyn_loads
   use rodyn_kinds, only: wp
   use rodyn_case_config, only: load_config
   implicit none (type, external)
   private
   public :: load_set, new_load_set, load_regime, new_load_regime, load_forces, evaluate_loads, load_value

   !> Words of the namelist as numbers, so that the right-hand side compares no text.
   integer, parameter :: law_constant = 1, law_sine_squared = 2, law_smooth_step = 3, law_table = 4

   !> A load that changes within a regime.
   type :: varying_load
      integer :: law = law_constant
      integer :: node = 0      !! 1..n; 0: the spacecraft
      integer :: component = 1 !! 1: X, 2: Y, 3: M
      type(load_config) :: given
   end type varying_load

   !> All loads of a case and the times where any of them is not smooth.
   type :: load_set
      type(load_config), allocatable :: loads(:)
      real(wp), allocatable :: switches(:) !! increasing, within (0, t_end) [s]
   end type load_set

   !> What acts between two switches.
   type :: load_regime
      logical :: on_spacecraft = .false. !! some load acts on the spacecraft
      logical :: on_nodes = .false.      !! some load acts on a node
      type(varying_load), allocatable :: varying(:) !! those that change with time
      real(wp) :: constant_base(3) = 0.0_wp        !! X_C, Y_C [N], M_C [N m] of all others
      real(wp), allocatable :: constant_node(:, :) !! X, Y of all others (2, n), size 0 if nodes are free [N]
   end type load_regime

   !> Values at one time.
   type :: load_forces
      real(wp) :: base(3) = 0.0_wp        !! X_C, Y_C [N], M_C [N m], moving axes
      real(wp), allocatable :: node(:, :) !! X, Y (2, n) [N], moving axes
   end type load_forces

contains

   !> Collect the loads and their switch times.
   subroutine new_load_set(set, loads, t_end)
      type(load_set), intent(out) :: set
      type(load_config), intent(in), optional :: loads(:) !! absent (not allocated): none
      real(wp), intent(in) :: t_end                       !! end of the run [s]
      integer :: i, j

      allocate (set%loads(0), set%switches(0))
      if (.not. present(loads)) return
      set%loads = loads
      do i = 1, size(loads)
         associate (load => loads(i))
            call add_switch(set%switches, load%t_start, t_end)
            call add_switch(set%switches, load%t_end, t_end)
            if (load%law == 'smooth_step') call add_switch(set%switches, load%t_start + rise_of(load), t_end)
            if (load%law /= 'table') cycle
            do j = 1, size(load%times)
               if (load%times(j) > load%t_start .and. load%times(j) < load%t_end) &
                  call add_switch(set%switches, load%times(j), t_end)
            end do
         end associate
      end do
   end subroutine new_load_set

   !> Insert one time in order, once, if it lies inside the run.
   subroutine add_switch(switches, t, t_end)
      real(wp), allocatable, intent(inout) :: switches(:)
      real(wp), intent(in) :: t, t_end
      integer :: i

      if (t <= 0.0_wp .or. t >= t_end) return
      if (any(switches == t)) return
      i = count(switches < t)
      switches = [switches(:i), t, switches(i + 1:)]
   end subroutine add_switch

   !> What acts between two neighbouring switch times (or ends of the run).
   subroutine new_load_regime(regime, set, t_from, t_to, n)
      type(load_regime), intent(out) :: regime
      type(load_set), intent(in) :: set
      real(wp), intent(in) :: t_from, t_to !! [s]
      integer, intent(in) :: n             !! nodes
      logical :: acts(size(set%loads)), varies(size(set%loads))
      real(wp) :: middle
      integer :: i, component

      middle = t_from + 0.5_wp*(t_to - t_from)
      acts = set%loads%t_start <= middle .and. middle <= set%loads%t_end
      varies = [(is_varying(set%loads(i), middle), i=1, size(varies))]
      regime%on_nodes = any(acts .and. set%loads%target == 'node')
      regime%on_spacecraft = any(acts .and. set%loads%target /= 'node')
      allocate (regime%varying(count(acts .and. varies)))
      allocate (regime%constant_node(2, merge(n, 0, regime%on_nodes)), source=0.0_wp)
      do i = 1, size(set%loads)
         if (.not. acts(i)) cycle
         if (varies(i)) then
            associate (load => regime%varying(count(acts(:i) .and. varies(:i))))
               load%given = set%loads(i)
               load%law = law_of(set%loads(i))
               load%component = component_of(set%loads(i))
               if (set%loads(i)%target == 'node') load%node = set%loads(i)%node
            end associate
            cycle
         end if
         associate (load => set%loads(i))
            component = component_of(load)
            if (load%target == 'node') then
               regime%constant_node(component, load%node) = regime%constant_node(component, load%node) + &
                                                            load_value(load, middle)
            else
               regime%constant_base(component) = regime%constant_base(component) + load_value(load, middle)
            end if
         end associate
      end do
   end subroutine new_load_regime

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
               forces%node(component, load%node) = forces%node(component, load%node) + value_at(load%law, load%given, t)
            else
               forces%base(component) = forces%base(component) + value_at(load%law, load%given, t)
            end if
         end associate
      end do
   end subroutine evaluate_loads

   !> The law of a load at time t, whether it acts then or not [N] or [N m].
   pure real(wp) function load_value(load, t)
      type(load_config), intent(in) :: load
      real(wp), intent(in) :: t !! [s]
      load_value = value_at(law_of(load), load, t)
   end function load_value

   !> The same with the law as a number.
   pure real(wp) function value_at(law, load, t)
      integer, intent(in) :: law
      type(load_config), intent(in) :: load
      real(wp), intent(in) :: t !! [s]
      real(wp) :: x

      select case (law)
      case (law_sine_squared)
         value_at = load%value*sin(load%rate*t)**2
      case (law_smooth_step) ! continuous acceleration: value and two derivatives vanish at the start
         x = min(max((t - load%t_start)/rise_of(load), 0.0_wp), 1.0_wp)
         value_at = load%value*x**3*(10.0_wp - x*(15.0_wp - 6.0_wp*x))
      case (law_table)
         value_at = interpolate(load%times, load%values, t)
      case default
         value_at = load%value
      end select
   end function value_at

   !> Number of a law.
   pure integer function law_of(load)
      type(load_config), intent(in) :: load
      select case (load%law)
      case ('sine_squared')
         law_of = law_sine_squared
      case ('smooth_step')
         law_of = law_smooth_step
      case ('table')
         law_of = law_table
      case default
         law_of = law_constant
      end select
   end function law_of

   !> Piecewise linear; constant beyond the ends of the table.
   pure real(wp) function interpolate(times, values, t)
      real(wp), intent(in) :: times(:), values(:)
      real(wp), intent(in) :: t
      integer :: low, high, middle

      low = 1
      high = size(times)
      interpolate = values(low)
      if (t <= times(low)) return
      interpolate = values(high)
      if (t >= times(high)) return
      do while (high - low > 1)
         middle = (low + high)/2
         if (times(middle) <= t) then
            low = middle
         else
            high = middle
         end if
      end do
      interpolate = values(low) + (values(high) - values(low))*((t - times(low))/(times(high) - times(low)))
   end function interpolate

   !> False if the load is constant around a time inside its regime.
   pure logical function is_varying(load, t)
      type(load_config), intent(in) :: load
      real(wp), intent(in) :: t
      is_varying = load%law /= 'constant'
      if (load%law == 'smooth_step') is_varying = t < load%t_start + rise_of(load)
      if (load%law == 'table') is_varying = t > load%times(1) .and. t < load%times(size(load%times))
   end function is_varying

   !> Rise time of a smooth step; by default all the time it acts [s].
   pure real(wp) function rise_of(load)
      type(load_config), intent(in) :: load
      rise_of = load%rise_time
      if (rise_of <= 0.0_wp) rise_of = load%t_end - load%t_start
   end function rise_of

   !> 1: X, 2: Y, 3: M.
   pure integer function component_of(load)
      type(load_config), intent(in) :: load
      component_of = index('XYM', load%component(1:1))
   end function component_of

end module rodyn_loads
