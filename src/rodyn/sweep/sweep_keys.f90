!> The keys of a sweep file, declared as those of a case are: a component and a line of its `visit_` procedure.
module rodyn_sweep_keys
   use rodyn_kinds, only: wp
   use rodyn_field_visitor, only: field_visitor
   use rodyn_schema, only: group => schema_group, key => schema_row, schema_extent, schema_group, schema_row, name_length, &
      any_list, in_range, not_negative, up_to
   use rodyn_schema_collector, only: schema_collector
   implicit none (type, external)
   private
   public :: sweep_keys, axis_keys, visit_sweep, visit_axis, visit_blank_sweep, sweep_schema, sweep_extents

   type(schema_extent), parameter :: sweep_extents(0) = [schema_extent ::]

   !> &sweep
   type :: sweep_keys
      character(len=:), allocatable :: base              !! path of the case file, from the directory of the sweep file
      character(len=name_length) :: combine = 'grid'     !! or 'zip'
      real(wp), allocatable :: probe_times(:)            !! increasing [s]
      logical :: keep_series = .false.
      real(wp) :: case_seconds = 0.0_wp                  !! wall time limit; 0: none
      logical :: lanes = .true.                          !! like cases may go side by side
      integer :: frequencies = 0                         !! natural frequencies that are kept of each case
      character(len=name_length) :: frequencies_at = 'start' !! or 'equilibrium'
      logical :: integrate = .true.                      !! otherwise nothing else is computed
   end type sweep_keys

   !> &axis
   type :: axis_keys
      character(len=:), allocatable :: key
      real(wp), allocatable :: values(:)
      character(len=:), allocatable :: text_values(:)
      real(wp) :: start = 0.0_wp, stop = 0.0_wp
      integer :: count = 0
      character(len=name_length) :: spacing = 'linear' !! or 'log'
      character(len=:), allocatable :: along
   end type axis_keys

contains

   !> The table of all groups and keys.
   subroutine sweep_schema(groups, rows)
      type(schema_group), allocatable, intent(out) :: groups(:)
      type(schema_row), allocatable, intent(out) :: rows(:)
      type(schema_collector) :: collector
      call visit_blank_sweep(collector)
      call collector%table(groups, rows)
   end subroutine sweep_schema

   !> Visit a sweep of one axis, which has its initial values.
   subroutine visit_blank_sweep(visitor)
      class(field_visitor), intent(inout) :: visitor
      type(sweep_keys) :: sweep
      type(axis_keys) :: axis
      call visit_sweep(visitor, sweep)
      call visit_axis(visitor, 1, axis)
   end subroutine visit_blank_sweep

   subroutine visit_sweep(visitor, sweep)
      class(field_visitor), intent(inout) :: visitor
      class(sweep_keys), intent(inout) :: sweep
      call visitor%open_group(group('sweep', help='many variants of one case'), 1)
      call visitor%text_field(sweep%base, key('base', rule=up_to, high=4096.0_wp, default='required', example="'base.nml'", &
         help='case file that is varied, found from the directory of this file'))
      call visitor%word_field(sweep%combine, key('combine', words='grid|zip', &
         help='every value of an axis with every value of the others, or first with first, second with second'))
      call visitor%field(sweep%probe_times, key('probe_times', 's', any_list, rule=not_negative, default='depends', &
         when='default: t_end of the base', help='increasing times at which the state of each case is kept'))
      call visitor%field(sweep%keep_series, key('keep_series', &
         help='keep the state at all n_outputs + 1 output times of each case'))
      call visitor%field(sweep%case_seconds, key('case_seconds', 's', rule=not_negative, &
         help='a case that computes longer than this has failed; 0: no limit'))
      call visitor%field(sweep%lanes, key('lanes', &
         help='like cases by dop853 side by side in vector lanes, eight at once; false: one by one'))
      call visitor%field(sweep%frequencies, key('frequencies', rule=in_range, low=0.0_wp, high=1.0e6_wp, &
         help='natural frequencies and damping ratios to keep of each case, from the lowest'))
      call visitor%word_field(sweep%frequencies_at, key('frequencies_at', words='start|equilibrium', &
         help='initial state without loads, or equilibrium near it under the loads of t = 0'))
      call visitor%field(sweep%integrate, key('integrate', help='false: only the frequencies are computed'))
      call visitor%close_group()
   end subroutine visit_sweep

   subroutine visit_axis(visitor, instance, axis)
      class(field_visitor), intent(inout) :: visitor
      integer, intent(in) :: instance
      type(axis_keys), intent(inout) :: axis
      call visitor%open_group(group('axis', repeatable=.true., &
         help='one key that is varied; repeat the group for each key'), instance)
      call visitor%text_field(axis%key, key('key', rule=up_to, high=80.0_wp, default='required', example="'mass_ratio'", &
         help='group.name, group.name(3) for one element, load(2).name for the second &load; or mass_ratio'))
      call visitor%field(axis%values, key('values', extent=any_list, default='depends', example='2, 4, 8', &
         when='this, text_values, or start to count', help='numbers'))
      call visitor%texts_field(axis%text_values, key('text_values', extent=any_list, default='depends', &
         when='for keys that take strings', help="strings, such as 'bdf', 'erk'"))
      call visitor%field(axis%start, key('start', default='depends', when='with stop and count', help='first number'))
      call visitor%field(axis%stop, key('stop', default='depends', when='with start and count', help='last number'))
      call visitor%field(axis%count, key('count', rule=in_range, low=1.0_wp, high=1.0e6_wp, default='depends', &
         when='with start and stop', help='how many numbers from start to stop, both included'))
      call visitor%word_field(axis%spacing, key('spacing', words='linear|log', &
         help='equal differences or equal ratios from start to stop'))
      call visitor%text_field(axis%along, key('along', rule=up_to, high=80.0_wp, &
         help='key of an axis above: the two advance together, whatever &sweep combine says'))
      call visitor%close_group()
   end subroutine visit_axis

end module rodyn_sweep_keys
