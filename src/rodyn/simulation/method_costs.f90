!> What methods cost on a scene: that of what a run has done, and that of a run to come.
!>
!> The numbers, and what measured them, stand in `rodyn_method_numbers`.
module rodyn_method_costs
   use rodyn_kinds, only: wp
   use rodyn_accelerations, only: dynamics_type
   use rodyn_integrator, only: solver_options, solver_statistics
   use rodyn_lane_scene, only: suits_lanes
   use rodyn_lanes, only: lanes
   use rodyn_locks, only: has_slaves
   use rodyn_method_numbers, only: bdf_evaluation, bdf_jacobian, bdf_output, bdf_overhead, bdf_step, coupling_cost, &
      coupling_decay, coupling_power, damped_at_one, damped_power, damped_rtol_power, dense_jacobian, explicit_calm, &
      explicit_output, explicit_phase, explicit_step, fewest_iterations, first_modes, gauss_calm, gauss_iteration, gauss_modes, &
      gauss_output, gauss_output_modes, gauss_overdamped, gauss_phase, gauss_step, growth_with_rods, iterations_alike, &
      iterations_at_one, iterations_power, joined_evaluation, lane_evaluation, lasting, least_damped, modes_again, most_damped, &
      overdamped, phase_rtol, seen_longer, stability_limit, strongly_damped
   use rodyn_scene_modes, only: most_dof
   implicit none (type, external)
   private
   public :: fast_rates, candidate_type, candidates, explicit, collocation, n_even
   public :: effort_of, effort_of_nodes, effort_of_modes, effort_of_step, effort_of_output, bytes_per_rod
   public :: expected_efforts, expected_steps, vibrating

   !> A method, with the highest order if it is not the usual one.
   type :: candidate_type
      character(len=6) :: method = ''
      integer :: order = 0
   end type candidate_type

   !> What `auto` chooses from: explicit; collocation; implicit; implicit and stable for every vibration, as BDF is up to order 2.
   type(candidate_type), parameter :: candidates(4) = [candidate_type('dop853', 0), candidate_type('gauss', 0), &
      candidate_type('bdf', 0), candidate_type('bdf', 2)]
   integer, parameter :: explicit = 1, collocation = 2
   integer, parameter :: n_even = 2 !! the first of them follow all vibrations, at a rather even pace

   !> The fast end of a scene's spectrum.
   type :: fast_rates
      real(wp) :: frequency = 0.0_wp !! highest natural frequency [rad/s]
      real(wp) :: decay = 0.0_wp     !! fastest decay [1/s]
      real(wp) :: slow = 0.0_wp      !! highest natural frequency of the chain, were its rods rigid; 0: unknown [rad/s]
   contains
      procedure :: is_strongly_damped
   end type fast_rates

contains

   !> Dampers about as fast as vibrations, or faster.
   pure logical function is_strongly_damped(self)
      class(fast_rates), intent(in) :: self
      is_strongly_damped = self%decay > strongly_damped*self%frequency
   end function is_strongly_damped

   !> Effort of a run. Beside evaluations, an implicit step solves as often, has a new Jacobian or factors now and then, and adds
   !> vectors.
   pure real(wp) function effort_of(method, dynamics, stats)
      character(len=*), intent(in) :: method
      type(dynamics_type), intent(in) :: dynamics
      type(solver_statistics), intent(in) :: stats
      select case (method)
      case ('gauss')
         effort_of = effort_of_modes(dynamics, int(stats%n_jac)) + &
                     (real(stats%n_rhs, wp)/real(lanes, wp)*effort_of_nodes(dynamics) + &
                      effort_of_step(dynamics)*real(stats%n_steps, wp)) &
                     *(1.0_wp + effort_of_coupling(dynamics)*stats%n_coupled/max(1.0_wp, real(stats%n_rhs, wp)))
      case ('bdf')
         effort_of = bdf_evaluation*real(stats%n_rhs, wp) + effort_of_jacobian(dynamics)*real(stats%n_jac, wp) + &
                     real(stats%n_steps, wp)*(bdf_step + bdf_overhead/(1.0_wp + growth_with_rods*dynamics%scene%n)) &
                     /rhs_cost(dynamics)
      case default
         effort_of = real(stats%n_rhs, wp)
      end select
   end function effort_of

   !> Time of an evaluation over that of an ordinary chain. Locked hinges and third bending shapes have a recursion of their own.
   pure real(wp) function rhs_cost(dynamics)
      type(dynamics_type), intent(in) :: dynamics
      rhs_cost = merge(joined_evaluation, 1.0_wp, joins(dynamics))
   end function rhs_cost

   !> Locked hinges or third bending shapes?
   pure logical function joins(dynamics)
      type(dynamics_type), intent(in) :: dynamics
      joins = has_slaves(dynamics%hinges) .or. dynamics%scene%n_bend == 3
   end function joins

   !> Effort of one iteration of a collocation step: eight evaluations, in lanes where they can, and the stiff modes.
   pure real(wp) function effort_of_nodes(dynamics)
      type(dynamics_type), intent(in) :: dynamics
      effort_of_nodes = merge(lane_evaluation, real(lanes, wp), suits_lanes(dynamics%scene, dynamics%hinges)) + &
                        (gauss_iteration + gauss_modes*dynamics%scene%n_dof)/rhs_cost(dynamics)
   end function effort_of_nodes

   !> Effort of a collocation step beside its iterations.
   pure real(wp) function effort_of_step(dynamics)
      type(dynamics_type), intent(in) :: dynamics
      effort_of_step = gauss_step/rhs_cost(dynamics)
   end function effort_of_step

   !> What coupled modes add to steps and iterations, times these: their equations, and more modes to be found more precisely.
   pure real(wp) function effort_of_coupling(dynamics)
      type(dynamics_type), intent(in) :: dynamics
      effort_of_coupling = coupling_cost*real(dynamics%scene%n_dof, wp)**coupling_power/rhs_cost(dynamics)
   end function effort_of_coupling

   !> Effort of a Jacobian with its factors: O(n), and dense where hinges are locked or rods have a third bending shape.
   pure real(wp) function effort_of_jacobian(dynamics)
      type(dynamics_type), intent(in) :: dynamics
      effort_of_jacobian = merge(dense_jacobian*dynamics%scene%n, bdf_jacobian, joins(dynamics))
   end function effort_of_jacobian

   !> Effort of a state between steps: a shorter step, whose first guess collocation knows, so that one or two iterations are
   !> enough; BDF has a polynomial.
   pure real(wp) function effort_of_output(method, dynamics)
      character(len=*), intent(in) :: method
      type(dynamics_type), intent(in) :: dynamics
      select case (method)
      case ('gauss')
         effort_of_output = gauss_output*effort_of_nodes(dynamics) + gauss_output_modes*dynamics%scene%n_dof/rhs_cost(dynamics)
      case ('bdf')
         effort_of_output = bdf_output/rhs_cost(dynamics)
      case default
         effort_of_output = explicit_output
      end select
   end function effort_of_output

   !> Effort of finding the modes so many times: the first has no guess.
   pure real(wp) function effort_of_modes(dynamics, times)
      type(dynamics_type), intent(in) :: dynamics
      integer, intent(in) :: times
      effort_of_modes = (first_modes*real(dynamics%scene%n_dof, wp)**2 + modes_again*dynamics%scene%n_dof*times)/rhs_cost(dynamics)
   end function effort_of_modes

   !> Memory of each rod that bends as motion, of 20,000 and 100,000 of them (docs/stability_input.md); `auto` is taken for the
   !> least of those it may choose [bytes].
   pure real(wp) function bytes_per_rod(method)
      character(len=*), intent(in) :: method
      select case (method)
      case ('gauss')
         bytes_per_rod = 4400.0_wp
      case ('bdf')
         bytes_per_rod = 2200.0_wp
      case default
         bytes_per_rod = 1800.0_wp
      end select
   end function bytes_per_rod

   !> Efforts of explicit steps of order 8 and of collocation, by their steps (docs/performance.md). What the fast vibrations add
   !> to the motion of the chain is nearly linear, so the faster they are, the fewer iterations a step of collocation needs.
   !> It is out of the question (huge) where it has no lanes or modes, hinges may have events, or nothing vibrates.
   function expected_efforts(dynamics, options, rates, ratio, t_end, available) result(effort)
      type(dynamics_type), intent(in) :: dynamics
      type(solver_options), intent(in) :: options
      type(fast_rates), intent(in) :: rates
      real(wp), intent(in) :: ratio !! fastest rate over the frequencies of the chain; 1: unknown, or rods are rigid
      real(wp), intent(in) :: t_end !! length of the run [s]
      logical, intent(in) :: available(n_even)
      real(wp) :: effort(n_even)
      real(wp) :: iterations

      effort = huge(1.0_wp)
      if (available(explicit)) effort(explicit) = explicit_step*expected_steps(explicit, options, rates, t_end)
      if (.not. available(collocation) .or. dynamics%scene%assembled .or. dynamics%scene%n_dof > most_dof) return
      if (.not. rates%frequency > 0.0_wp) return
      iterations = iterations_alike
      if (ratio > 1.0_wp) iterations = max(fewest_iterations, iterations_at_one*ratio**iterations_power)
      if (vibrating(rates, t_end) < 1.0_wp) iterations = damped_iterations(rates, options%rtol)
      associate (it => effort(collocation))
         it = (effort_of_step(dynamics) + iterations*effort_of_nodes(dynamics))*expected_steps(collocation, options, rates, t_end)
         if (rates%decay > coupling_decay*rates%frequency) it = it*(1.0_wp + effort_of_coupling(dynamics))
         it = it + effort_of_modes(dynamics, merge(4, 2, vibrating(rates, t_end) < 1.0_wp))
      end associate
   end function expected_efforts

   !> Iterations of a collocation step where dampers calm the vibrations, which allows longer steps.
   pure real(wp) function damped_iterations(rates, rtol)
      type(fast_rates), intent(in) :: rates
      real(wp), intent(in) :: rtol
      real(wp) :: ratio !! fastest frequency over those of the chain
      ratio = 1.0_wp
      if (rates%slow > 0.0_wp) ratio = rates%frequency/rates%slow
      damped_iterations = min(most_damped, max(least_damped, damped_at_one*ratio**damped_power* &
                                              (1.0e6_wp*rtol)**damped_rtol_power))
   end function damped_iterations

   !> Steps of a run by a method that follows vibrations: of so many radians of the fastest, while it lasts; later as many as
   !> stability or the motion of the chain allow.
   pure real(wp) function expected_steps(candidate, options, rates, t_end) result(steps)
      integer, intent(in) :: candidate !! explicit or collocation
      type(solver_options), intent(in) :: options
      type(fast_rates), intent(in) :: rates
      real(wp), intent(in) :: t_end
      real(wp) :: phase, later, share

      share = vibrating(rates, t_end)
      if (candidate == collocation) then
         phase = gauss_phase*min(1.0_wp, (phase_rtol*options%rtol)**0.0625_wp)
         later = merge(gauss_calm, gauss_overdamped, rates%decay > overdamped*rates%frequency)
      else
         phase = explicit_phase*min(1.0_wp, (phase_rtol*options%rtol)**0.125_wp)
         later = explicit_calm
         if (rates%is_strongly_damped()) share = min(1.0_wp, share*(1.0e-3_wp/options%rtol)**seen_longer)
      end if
      steps = rates%frequency*t_end*(share/phase + (1.0_wp - share)/later)
      if (candidate == explicit) steps = max(steps, rates%decay*t_end/stability_limit)
   end function expected_steps

   !> Share of a run in which fast vibrations last: dampers leave them below tolerance after some time.
   pure real(wp) function vibrating(rates, t_end)
      type(fast_rates), intent(in) :: rates
      real(wp), intent(in) :: t_end
      vibrating = 1.0_wp
      if (rates%decay*t_end > lasting) vibrating = lasting/(rates%decay*t_end)
   end function vibrating

end module rodyn_method_costs
