!> The one table of all keys of a sweep file: checking, defaults and documentation come from it.
module rodyn_sweep_schema
   use rodyn_kinds, only: wp
   use rodyn_schema, only: schema_group, schema_row, schema_extent, type_integer, type_real, type_logical, &
      type_word, type_text, any_list, not_negative, in_range, up_to
   implicit none (type, external)
   private
   public :: sweep_groups, sweep_rows, sweep_extents

   type(schema_group), parameter :: sweep_groups(2) = [ &
      schema_group('sweep', help='many variants of one case'), &
      schema_group('axis', repeatable=.true., help='one key that is varied; repeat the group for each key')]

   type(schema_row), parameter :: sweep_rows(*) = [ &
      schema_row('sweep', 'base', type_text, rule=up_to, high=4096.0_wp, example="'base.nml'", &
         help='case file that is varied, found from the directory of this file'), &
      schema_row('sweep', 'combine', type_word, default="'grid'", words='grid|zip', &
         help='every value of an axis with every value of the others, or first with first, second with second'), &
      schema_row('sweep', 'probe_times', type_real, any_list, 's', 'depends', rule=not_negative, &
         when='default: t_end of the base', help='increasing times at which the state of each case is kept'), &
      schema_row('sweep', 'keep_series', type_logical, default='.false.', &
         help='keep the state at all n_outputs + 1 output times of each case'), &
      schema_row('sweep', 'case_seconds', type_real, unit='s', default='0.0', rule=not_negative, &
         help='a case that computes longer than this has failed; 0: no limit'), &
      schema_row('sweep', 'lanes', type_logical, default='.true.', &
         help='like cases by dop853 side by side in vector lanes, eight at once; false: one by one'), &
      schema_row('sweep', 'frequencies', type_integer, default='0', rule=in_range, low=0.0_wp, high=1.0e6_wp, &
         help='natural frequencies and damping ratios to keep of each case, from the lowest'), &
      schema_row('sweep', 'frequencies_at', type_word, default="'start'", words='start|equilibrium', &
         help='initial state without loads, or equilibrium near it under the loads of t = 0'), &
      schema_row('sweep', 'integrate', type_logical, default='.true.', &
         help='false: only the frequencies are computed'), &
      schema_row('axis', 'key', type_text, rule=up_to, high=80.0_wp, example="'mass_ratio'", &
         help='group.name, group.name(3) for one element, load(2).name for the second &load; or mass_ratio'), &
      schema_row('axis', 'values', type_real, any_list, default='depends', example='2, 4, 8', &
         when='this, text_values, or start to count', help='numbers'), &
      schema_row('axis', 'text_values', type_text, any_list, default='depends', &
         when='for keys that take texts', help="texts, such as 'bdf', 'erk'"), &
      schema_row('axis', 'start', type_real, default='depends', when='with stop and count', help='first number'), &
      schema_row('axis', 'stop', type_real, default='depends', when='with start and count', help='last number'), &
      schema_row('axis', 'count', type_integer, default='depends', rule=in_range, low=1.0_wp, high=1.0e6_wp, &
         when='with start and stop', help='how many numbers from start to stop, both included'), &
      schema_row('axis', 'spacing', type_word, default="'linear'", words='linear|log', &
         help='equal differences or equal ratios from start to stop'), &
      schema_row('axis', 'along', type_text, default="''", rule=up_to, high=80.0_wp, &
         help='key of an axis above: the two advance together, whatever &sweep combine says')]

   type(schema_extent), parameter :: sweep_extents(0) = [schema_extent ::]

end module rodyn_sweep_schema
