!> One integration of the campaign: a case in, how it ended and what is left of its invariants out.
module rodyn_bench_campaign_runs
   use rodyn_kinds, only: wp, i8
   use rodyn_errors, only: error_type, exit_stopped
   use rodyn_case_check, only: sound_case
   use rodyn_case_config, only: case_config
   use rodyn_motion, only: motion_type, state_invariants
   use rodyn_run_setup, only: run_setup, new_run_setup
   use rodyn_kinematics, only: invariants_type
   use rodyn_integrator, only: monitor_type
   use rodyn_driver, only: driver_type, new_driver
   use rodyn_simulation, only: observer_type, listed_times, simulate
   implicit none (type, external)
   private
   public :: run_result, run_campaign_case, empty_case, article_chain

   !> How a run ended.
   type :: run_result
      character(len=12) :: status = ''   !! done, refused, failed, slow (its time was up)
      character(len=8) :: method = ''
      character(len=:), allocatable :: message
      real(wp) :: t = 0.0_wp             !! reached [s]
      real(wp) :: seconds = 0.0_wp       !! processor time
      real(wp) :: seconds_choice = 0.0_wp !! of it, before the first step
      integer(i8) :: n_steps = 0
      real(wp) :: energy_error = 0.0_wp  !! largest at the looks, of the largest energy
      real(wp) :: momentum_error = 0.0_wp !! of sqrt(2 E M)
      real(wp) :: angular_error = 0.0_wp !! of sqrt(2 E M) times the extent of the chain
      real(wp), allocatable :: y(:)      !! last state, quadratures behind
      real(wp), allocatable :: times(:), errors(:) !! looks; energy error then, of the energy at 0
   end type run_result

   type, extends(monitor_type) :: budget_monitor
      real(wp) :: deadline = huge(1.0_wp) !! of processor time: other work on the machine does not count [s]
   contains
      procedure :: report
      procedure :: stop_requested
   end type budget_monitor

   type, extends(observer_type) :: invariant_recorder
      integer :: n_seen = 0
      real(wp) :: first_energy = 0.0_wp, scale = 0.0_wp, momentum(2) = 0.0_wp, turning = 0.0_wp
      real(wp) :: worst(3) = 0.0_wp
      logical :: finite = .true.
      real(wp), allocatable :: errors(:)
   contains
      procedure :: observe
   end type invariant_recorder

contains

   subroutine report(self, t, n_steps)
      class(budget_monitor), intent(inout) :: self
      real(wp), intent(in) :: t
      integer(i8), intent(in) :: n_steps
      associate (unused => self, unused_t => t, unused_n => n_steps); end associate
   end subroutine report

   function stop_requested(self) result(requested)
      class(budget_monitor), intent(in) :: self
      logical :: requested
      real(wp) :: now
      call cpu_time(now)
      requested = now > self%deadline
   end function stop_requested

   subroutine observe(self, motion, t, y, error)
      class(invariant_recorder), intent(inout) :: self
      type(motion_type), intent(inout) :: motion
      real(wp), intent(in) :: t, y(:)
      type(error_type), allocatable, intent(out) :: error
      type(invariants_type) :: now
      real(wp) :: energy

      associate (unused => t, unused_error => error); end associate
      self%n_seen = self%n_seen + 1
      self%finite = self%finite .and. all(abs(y) <= huge(1.0_wp))
      if (.not. self%finite) return
      now = state_invariants(motion, y)
      energy = now%kinetic + now%elastic + y(size(y)) - y(size(y) - 1)
      if (self%n_seen == 1) then
         self%first_energy = energy
         self%momentum = now%momentum
         self%turning = now%angular_momentum
      end if
      self%scale = max(self%scale, abs(energy), now%kinetic + now%elastic)
      self%worst = max(self%worst, [abs(energy - self%first_energy), norm2(now%momentum - self%momentum), &
                                    abs(now%angular_momentum - self%turning)])
      self%errors(self%n_seen) = energy - self%first_energy
   end subroutine observe

   !> Integrate a case, with looks at the given times, for at most `budget` seconds of processor time beside the choice of a method.
   subroutine run_campaign_case(given, times, budget, result)
      type(case_config), intent(in) :: given
      real(wp), intent(in) :: times(:) !! increasing from 0; the last is the end [s]
      real(wp), intent(in) :: budget   !! [s]
      type(run_result), intent(out) :: result
      type(case_config) :: config !! with what is not given
      type(run_setup), target :: setup
      type(driver_type) :: driver
      type(invariant_recorder) :: recorder
      type(budget_monitor), target :: monitor
      type(error_type), allocatable :: error
      real(wp) :: total, extent, start, finish

      call cpu_time(start)
      result%status = 'refused'
      result%message = ''
      call sound_case(given, config, error)
      if (.not. allocated(error)) call new_run_setup(setup, config, .true., error)
      if (.not. allocated(error)) call new_driver(driver, setup%motion, setup%y, config%solver, times(size(times)), size(times), &
                                                  error)
      if (.not. allocated(error)) call driver%make(error)
      if (.not. allocated(error)) result%method = driver%choice%method
      if (allocated(error)) then
         result%message = error%message
         return
      end if
      call cpu_time(finish)
      result%seconds_choice = finish - start
      monitor%deadline = finish + budget
      call driver%set_monitor(monitor)
      allocate (recorder%errors(size(times)), source=0.0_wp)
      call simulate(setup%motion, driver, listed_times(times), times(size(times)), recorder, setup%y, result%t, error)
      result%y = setup%y
      call cpu_time(finish)
      result%seconds = finish - start
      result%n_steps = driver%n_steps
      call driver%finalize()
      result%status = 'done'
      if (allocated(error)) then
         result%status = merge('slow  ', 'failed', error%exit_code == exit_stopped)
         result%message = error%message
      else if (.not. recorder%finite .or. .not. all(abs(result%y) <= huge(1.0_wp))) then
         result%status = 'WRONG'
         result%message = 'done, but not finite'
      end if
      total = sum(setup%motion%dynamics%scene%node_mass) + sum(config%chain%length*config%chain%mass_per_length)
      if (setup%motion%dynamics%scene%n_base > 0) total = total + config%spacecraft%mass
      extent = sum(config%chain%length)
      associate (scale => max(recorder%scale, tiny(1.0_wp)))
         result%energy_error = recorder%worst(1)/scale
         result%momentum_error = recorder%worst(2)/sqrt(2.0_wp*scale*total)
         result%angular_error = recorder%worst(3)/(sqrt(2.0_wp*scale*total)*extent)
         if (setup%motion%dynamics%scene%n_base == 0) result%momentum_error = 0.0_wp
         if (setup%motion%dynamics%scene%n_base == 0) result%angular_error = 0.0_wp
         result%times = times(:recorder%n_seen)
         result%errors = recorder%errors(:recorder%n_seen)/max(abs(recorder%first_energy), tiny(1.0_wp))
      end associate
   end subroutine run_campaign_case

   !> Arrays for n rods, zero where zero is a sensible default.
   subroutine empty_case(config, n)
      type(case_config), intent(out) :: config
      integer, intent(in) :: n
      config%title = ''
      config%model%formulation = 'consistent'
      config%chain%n_rods = n
      associate (chain => config%chain, initial => config%initial)
         allocate (chain%length(n), chain%mass_per_length(n), chain%bending_stiffness(n), chain%node_mass(n), &
                   chain%hinge_stiffness(0:n - 1), chain%hinge_damping(0:n - 1), chain%kink(0:n - 1), source=0.0_wp)
         allocate (initial%phi(n), initial%alpha(n), initial%beta(n), initial%phi_rate(n), initial%alpha_rate(n), &
                   initial%beta_rate(n), source=0.0_wp)
      end associate
      allocate (config%loads(0))
   end subroutine empty_case

   !> The article's data without dampers and loads, for n rods, in the consistent formulation; hinges in motion.
   subroutine article_chain(config, n)
      type(case_config), intent(out) :: config
      integer, intent(in) :: n
      integer :: k

      call empty_case(config, n)
      config%spacecraft%mass = 122.5_wp
      config%spacecraft%inertia = 10.004166666666667_wp
      config%spacecraft%hinge_x = 0.35_wp
      config%spacecraft%hinge_y = 0.35_wp
      config%chain%length = 1.5_wp
      config%chain%mass_per_length = 1.6964600329384882_wp
      config%chain%bending_stiffness = 13744.467859455345_wp
      config%chain%node_mass = 0.5_wp
      config%chain%hinge_stiffness = 4000.0_wp
      config%chain%hinge_stiffness(0) = 6000.0_wp
      config%initial%omega = 0.5_wp
      config%initial%phi_rate = [(real(2*mod(k, 2) - 1, wp)*(1.0_wp + mod(k, 4)), k=1, n)]
   end subroutine article_chain

end module rodyn_bench_campaign_runs
