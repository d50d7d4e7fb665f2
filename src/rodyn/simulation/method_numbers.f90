!> The numbers behind `method = 'auto'`, and where each comes from. The unit of effort is one evaluation of the right-hand side by
!> `dop853`: it is counted, not timed, so that the same scene gets the same method everywhere.
!>
!> [newton]    `tools/bench newton`, and medians of runs with 6 to 195 unknowns: docs/performance.md, "Large and stiff"
!> [grid]      set so that `auto` is within 1.5 of the cheapest method in the scenes of `tools/bench stiffness` and in random ones
!>             beside them (same place; test/test_method_choice.f90 holds it). Together they do; none was measured by itself
!> [campaign]  `bench/stability/auto_choice.py`, 128 ordinary scenes: processor times of whole runs
!> [theory]    follows from the method
!> [decision]  how much a choice may cost, or what is remembered: chosen, not measured
module rodyn_method_numbers
   use rodyn_kinds, only: wp
   implicit none (type, external)
   private

   ! What steps cost [evaluations]
   real(wp), parameter, public :: explicit_step = 13.5_wp    !! of `dop853`, rejected ones included; 12.3 to 14.8 in cases/
   real(wp), parameter, public :: explicit_output = 11.0_wp  !! a state between its steps: a shorter step [theory]
   real(wp), parameter, public :: bdf_evaluation = 2.1_wp    !! with the solution that goes with it, 1.4 alone [newton]
   real(wp), parameter, public :: bdf_step = 2.1_wp          !! beside its evaluations: vectors [newton]
   real(wp), parameter, public :: bdf_overhead = 15.0_wp     !! likewise, what does not grow with n, of one rod [newton]
   real(wp), parameter, public :: growth_with_rods = 0.37_wp !! an evaluation takes as long as 1 + 0.37 n [newton]
   real(wp), parameter, public :: bdf_jacobian = 3.0_wp      !! with its factors, O(n) [newton]
   real(wp), parameter, public :: dense_jacobian = 8.0_wp    !! likewise, of each rod, with locked hinges [newton]
   real(wp), parameter, public :: bdf_output = 1.5_wp        !! a state between steps: a polynomial [newton]
   real(wp), parameter, public :: joined_evaluation = 4.5_wp !! where hinges are locked: 2.6 to 5.9 for 4 to 64 rods [newton]
   real(wp), parameter, public :: lane_evaluation = 2.0_wp   !! all nodes of `gauss` in vector lanes [newton]
   real(wp), parameter, public :: gauss_iteration = 1.4_wp   !! beside its evaluations [newton]
   real(wp), parameter, public :: gauss_modes = 0.055_wp     !! likewise, of each unknown [newton]
   real(wp), parameter, public :: gauss_step = 4.0_wp        !! beside its iterations [newton]
   real(wp), parameter, public :: gauss_output = 1.5_wp      !! iterations for a state between steps [newton]
   real(wp), parameter, public :: gauss_output_modes = 0.3_wp !! likewise, of each unknown [newton]
   real(wp), parameter, public :: first_modes = 0.4_wp       !! finding modes, of each unknown squared [newton]
   real(wp), parameter, public :: modes_again = 6.0_wp       !! likewise with a guess, of each unknown [newton]
   real(wp), parameter, public :: coupling_cost = 0.05_wp    !! coupled modes add this times n_dof**coupling_power: 0.3, 0.8 and 2
   real(wp), parameter, public :: coupling_power = 0.7_wp    !! for 15, 51 and 195 unknowns [newton]

   ! Steps that are expected
   real(wp), parameter, public :: stability_limit = 6.4_wp   !! step times decay rate that `dop853` bears: the real axis of its
                                                             !! stability region; `rodyn check` refuses fixed steps from 6.34 on
   real(wp), parameter, public :: explicit_phase = 2.6_wp    !! of the fastest vibration in its step at rtol <= 1e-4 [rad] [grid]
   real(wp), parameter, public :: explicit_calm = 5.5_wp     !! likewise once it has died out [rad] [grid]
   real(wp), parameter, public :: gauss_phase = 8.0_wp       !! of `gauss` [rad] [grid]
   real(wp), parameter, public :: gauss_calm = 12.0_wp       !! likewise once it has died out [rad] [grid]
   real(wp), parameter, public :: gauss_overdamped = 18.0_wp !! likewise where decays are `overdamped` times as fast
   real(wp), parameter, public :: overdamped = 10.0_wp       !! [grid]
   real(wp), parameter, public :: phase_rtol = 1.0e4_wp      !! 1/rtol from where phases shrink, as rtol**(1/order) [theory]
   real(wp), parameter, public :: seen_longer = 0.08_wp      !! power of 1e-3/rtol by which vibrations that die out last [grid]
   real(wp), parameter, public :: lasting = 150.0_wp         !! times the fastest decay that vibrations with dampers last [grid]
   real(wp), parameter, public :: iterations_alike = 4.5_wp  !! of a `gauss` step where no rate is far above the chain's [grid]
   real(wp), parameter, public :: iterations_at_one = 8.0_wp !! where one is r times as high: 8 r**(-0.2), at least 1.2 [grid]
   real(wp), parameter, public :: iterations_power = -0.2_wp
   real(wp), parameter, public :: fewest_iterations = 1.2_wp
   ! ... and where dampers calm the vibrations: 11 r**(-0.21) (1e6 rtol)**(-0.05), from 1 to 9. A fit to 190 scenes of
   ! `bench/stability/damped_slews.py`'s kind, mostly right to a quarter
   real(wp), parameter, public :: damped_at_one = 11.0_wp, damped_power = -0.21_wp, damped_rtol_power = -0.05_wp
   real(wp), parameter, public :: least_damped = 1.0_wp, most_damped = 9.0_wp

   ! When scenes are what [decay rate over frequency]
   real(wp), parameter, public :: damped = 0.03_wp           !! from where fast vibrations are damped [grid]
   real(wp), parameter, public :: coupling_decay = 0.3_wp    !! from where dampers couple modes of collocation [grid]
   real(wp), parameter, public :: strongly_damped = 0.5_wp   !! dampers about as fast as vibrations [grid]
   real(wp), parameter, public :: mostly_damped = 2.0_wp     !! dampers alone are fast [grid]

   ! Choice without a trial
   real(wp), parameter, public :: short_run = 1500.0_wp      !! effort of a run that is not worth a trial [decision]
   real(wp), parameter, public :: stiff_from = 40.0_wp       !! fastest rate over those of the rigid chain from where implicit steps
                                                             !! may pay, at rtol = 1e-3 [grid]
   real(wp), parameter, public :: stiff_damped_from = 6.0_wp !! likewise where mostly damped [grid]
   real(wp), parameter, public :: stiff_power = 0.25_wp      !! of 1e-3/rtol by which it rises [grid]
   real(wp), parameter, public :: lead = 1.1_wp              !! by which an implicit method must be faster: less accurate [decision]
   real(wp), parameter, public :: lead_over_events = 2.0_wp  !! likewise where hinges may have events: after each it restarts, at
                                                             !! order 1 [campaign]
   real(wp), parameter, public :: even_lead = 1.2_wp         !! of collocation over explicit steps without a trial: these gain more
                                                             !! where loads are smooth and excite no fast vibrations [grid]

   ! The trial
   real(wp), parameter, public :: first_effort = 400.0_wp    !! of a candidate, doubled from round to round [decision]
   real(wp), parameter, public :: first_share = 0.1_wp       !! or that of the run [decision]
   integer, parameter, public :: n_slices = 4                !! a step too long costs no more than one of these parts [decision]
   integer, parameter, public :: fewest_steps = 5            !! of a slice [decision]
   real(wp), parameter, public :: spent_share = 0.9_wp       !! of what a round allows, with which it ends [decision]
   real(wp), parameter, public :: trial_limit = 2.5e6_wp     !! of a candidate, for one rod, however long the run: half a second;
                                                             !! docs/history.md, "Choice of the method"
   real(wp), parameter, public :: own_share = 0.2_wp         !! of its own run that the best candidate is tried on [grid]
   real(wp), parameter, public :: growing_share = 0.7_wp     !! likewise where its pace still grows by `grows_on` [grid]
   real(wp), parameter, public :: even_share = 0.7_wp        !! of the run of the best even method, likewise [grid]
   real(wp), parameter, public :: most_share = 1.0_wp        !! of that, for all candidates together [decision]
   real(wp), parameter, public :: clear_lead = 3.0_wp        !! with which another need not go on [grid]
   real(wp), parameter, public :: expectation_error = 3.0_wp !! factor by which expectations may be wrong [grid]
   real(wp), parameter, public :: even_steps = 200.0_wp      !! are enough to know the pace of an even method [grid]
   real(wp), parameter, public :: even_trial = 0.1_wp        !! of its run that it is tried on at most [decision]
   real(wp), parameter, public :: even_start = 0.4_wp        !! of that until its pace is taken [decision]
   real(wp), parameter, public :: even_iterations = 2.0_wp   !! of a step of collocation that is tried [grid]
   real(wp), parameter, public :: some_rounds = 3.0_wp      !! first efforts after which a pace means something [decision]
   real(wp), parameter, public :: calm_after = 3.0_wp        !! times as long as vibrations last, what is seen is the rest [grid]

   ! Growth of the pace from round to round
   real(wp), parameter, public :: growing = 1.2_wp           !! it does [grid]
   real(wp), parameter, public :: grows_twice = 1.65_wp      !! in two rounds together, if vibrations die out [grid]
   real(wp), parameter, public :: grows_on = 1.4_wp          !! and it does not slacken, with strong dampers [grid]
   real(wp), parameter, public :: doubled = 1.8_wp           !! effort of a round that was not cut short [decision]
   real(wp), parameter, public :: most_growth = 2.0_wp       !! that is taken to go on [theory]: pace and effort double

   ! BDF and vibrations
   real(wp), parameter, public :: bounded = 0.7_wp           !! phase in a step above order 2 that vibrations hold back [rad]; they
                                                             !! do so to 0.55 [grid]
   real(wp), parameter, public :: dying_steps = 3.0_wp       !! (h w)**4 times the steps until a vibration has died out [theory]
   real(wp), parameter, public :: slower = 15.0_wp           !! times as long last slower ones: 15 to 46 in like rods [grid]
   real(wp), parameter, public :: least_phase = 1.0e-3_wp, most_phase = 0.4_wp !! h w for which this holds [rad] [theory]
   real(wp), parameter, public :: calm_steps = 11.0_wp       !! of order 2 for a radian of the chain at rtol = 1e-3 [grid]

   ! Choices in the course of a run
   real(wp), parameter, public :: choice_delay = 1500.0_wp   !! effort of explicit steps that is not worth a choice [decision]
   real(wp), parameter, public :: short_delay = 300.0_wp     !! likewise where it is known already [decision]
   real(wp), parameter, public :: trials_free = 3000.0_wp    !! effort that later trials may cost together [decision]
   real(wp), parameter, public :: trial_share = 0.3_wp       !! and this share of the run beside [decision]
   real(wp), parameter, public :: effort_of_rates = 300.0_wp !! of a choice beside its trial: power iterations; not measured
   real(wp), parameter, public :: clear_advantage = 3.0_wp   !! over explicit steps, of an implicit method far ahead [decision]
   real(wp), parameter, public :: postponed = 2.0_wp         !! growth of the run's effort until an inconclusive trial is repeated
   integer, parameter, public :: watch_steps = 200           !! of BDF, after which its pace is judged [decision]
   integer, parameter, public :: most_past_choices = 64      !! that are remembered [decision]

end module rodyn_method_numbers
