!> Rules of moving scenes: which keys of `&kink_program` and `&hinge` go together.
module rodyn_hinge_rules
   use rodyn_kinds, only: wp
   use rodyn_case_config, only: case_config, hinge_config, kink_config, none_given
   use rodyn_key_checker, only: key_checker, no_such
   use rodyn_law_rules, only: check_law
   use rodyn_switch_times, only: same_time
   use rodyn_time_law, only: moves_smoothly
   implicit none (type, external)
   private
   public :: check_moving_hinges

contains

   !> Note everything that is wrong with programs of kinks and hinge laws.
   subroutine check_moving_hinges(checker, config)
      class(key_checker), intent(inout) :: checker
      type(case_config), intent(in) :: config
      integer :: i

      do i = 1, size(config%kink_programs)
         call check_exists(checker, 'kink_program', i, config%kink_programs(i)%hinge, config%chain%n_rods)
         call check_law(checker, 'kink_program', i, config%kink_programs(i)%law, config%kink_programs(i), of_motion=.true.)
         call check_jumps(checker, i, config%kink_programs(i), config)
      end do
      do i = 1, size(config%hinges)
         call check_exists(checker, 'hinge', i, config%hinges(i)%hinge, config%chain%n_rods)
         call check_once(checker, i, config%hinges)
         call check_release(checker, i, config%hinges)
         call check_stops(checker, i, config%hinges(i))
         call check_friction(checker, i, config%hinges(i))
         call check_dampers(checker, i, config%hinges(i), config)
      end do
   end subroutine check_moving_hinges

   !> Hinges are numbered from 0; that a number is not negative stands in the table.
   subroutine check_exists(checker, group, i, hinge, n_rods)
      class(key_checker), intent(inout) :: checker
      character(len=*), intent(in) :: group
      integer, intent(in) :: i, hinge, n_rods !! n_rods 0: not known
      if (n_rods < 1 .or. hinge < n_rods) return
      if (.not. checker%is_sound(group, i, 'hinge')) return
      call checker%report(group, i, 'hinge', no_such('hinge', 0, n_rods - 1))
   end subroutine check_exists

   !> A kink that jumps would strike a damper or a lock with infinite force; so would one whose rate jumps a lock.
   subroutine check_jumps(checker, i, program, config)
      class(key_checker), intent(inout) :: checker
      integer, intent(in) :: i
      type(kink_config), intent(in) :: program
      type(case_config), intent(in) :: config
      logical :: step
      integer :: h

      if (.not. checker%is_sound('kink_program', i, 'hinge') .or. .not. checker%is_sound('kink_program', i, 'law')) return
      step = program%law == 'ramp' .and. same_time(program%t_start, program%t_end)
      if (step .and. checker%is_sound('chain', 1, 'hinge_damping') .and. &
          program%hinge < min(config%chain%n_rods, size(config%chain%hinge_damping))) then
         if (config%chain%hinge_damping(program%hinge) > 0.0_wp) call checker%report('kink_program', i, 'hinge', &
            'a step of the kink needs a hinge without hinge_damping')
      end if
      do h = 1, size(config%hinges)
         associate (hinge => config%hinges(h))
            if (hinge%hinge /= program%hinge) cycle
            if (step .and. max(hinge%stop_damping, hinge%lock_damping) > 0.0_wp) call checker%report('kink_program', i, 'hinge', &
               'a step of the kink needs a hinge without stop_damping and lock_damping')
            if (hinge%lock_stiffness > 0.0_wp .or. .not. (hinge%held .or. hinge%latch_angle < none_given)) cycle
            if (.not. moves_smoothly(program%law)) call checker%report('kink_program', i, 'law', &
               "must be 'smooth_step' or 'table' at a hinge that is held or latches: its rate must not jump")
         end associate
      end do
   end subroutine check_jumps

   !> One group for each hinge.
   subroutine check_once(checker, i, hinges)
      class(key_checker), intent(inout) :: checker
      integer, intent(in) :: i
      type(hinge_config), intent(in) :: hinges(:)
      if (.not. checker%is_sound('hinge', i, 'hinge')) return
      if (any(hinges(:i - 1)%hinge == hinges(i)%hinge)) call checker%report('hinge', i, 'hinge', &
         'this hinge already has a group &hinge')
   end subroutine check_once

   !> Only what is held can be released, by one cause, and only what latches can release others.
   subroutine check_release(checker, i, hinges)
      class(key_checker), intent(inout) :: checker
      integer, intent(in) :: i
      type(hinge_config), intent(in) :: hinges(:)
      logical :: by_time, by_latch
      integer :: k

      by_time = checker%is_given('hinge', i, 'release_time')
      by_latch = checker%is_given('hinge', i, 'release_after')
      if (checker%is_sound('hinge', i, 'held') .and. .not. hinges(i)%held) then
         if (by_time) call checker%report('hinge', i, 'release_time', 'applies only with held = .true.')
         if (by_latch) call checker%report('hinge', i, 'release_after', 'applies only with held = .true.')
         return
      end if
      if (by_time .and. by_latch) call checker%report('hinge', i, 'release_after', 'cannot be combined with release_time')
      if (.not. by_latch .or. .not. checker%is_sound('hinge', i, 'release_after')) return
      do k = 1, size(hinges)
         if (hinges(k)%hinge == hinges(i)%release_after .and. hinges(k)%latch_angle < none_given .and. k /= i) return
      end do
      call checker%report('hinge', i, 'release_after', 'that hinge must have a latch_angle of its own')
   end subroutine check_release

   !> Stops, freeplay and locks need their stiffnesses, and these need them.
   subroutine check_stops(checker, i, hinge)
      class(key_checker), intent(inout) :: checker
      integer, intent(in) :: i
      type(hinge_config), intent(in) :: hinge

      if (hinge%lower_stop < none_given .and. hinge%upper_stop < none_given .and. hinge%lower_stop >= hinge%upper_stop) &
         call checker%report('hinge', i, 'upper_stop', 'must be greater than lower_stop')
      if (min(hinge%lower_stop, hinge%upper_stop) < none_given) then
         if (.not. hinge%stop_stiffness > 0.0_wp .and. checker%is_sound('hinge', i, 'stop_stiffness')) &
            call checker%report('hinge', i, 'stop_stiffness', 'is required with a stop and must be positive')
      else if (hinge%stop_stiffness > 0.0_wp .or. hinge%stop_damping > 0.0_wp) then
         if (checker%is_sound('hinge', i, 'lower_stop') .and. checker%is_sound('hinge', i, 'upper_stop')) &
            call checker%report('hinge', i, 'stop_stiffness', 'applies only with lower_stop or upper_stop')
      end if
      if (hinge%freeplay_stiffness > 0.0_wp .and. .not. hinge%freeplay > 0.0_wp) &
         call checker%report('hinge', i, 'freeplay_stiffness', 'applies only with freeplay')
      if (hinge%lock_damping > 0.0_wp .and. .not. hinge%lock_stiffness > 0.0_wp) &
         call checker%report('hinge', i, 'lock_damping', 'applies only with lock_stiffness')
   end subroutine check_stops

   !> Moment and velocity of dry friction go together.
   subroutine check_friction(checker, i, hinge)
      class(key_checker), intent(inout) :: checker
      integer, intent(in) :: i
      type(hinge_config), intent(in) :: hinge

      if (.not. (checker%is_sound('hinge', i, 'friction_moment') .and. &
                 checker%is_sound('hinge', i, 'friction_velocity'))) return
      if (hinge%friction_moment > 0.0_wp .and. .not. hinge%friction_velocity > 0.0_wp) then
         call checker%report('hinge', i, 'friction_velocity', 'is required when friction_moment > 0')
      else if (hinge%friction_velocity > 0.0_wp .and. .not. hinge%friction_moment > 0.0_wp) then
         call checker%report('hinge', i, 'friction_velocity', 'applies only with friction_moment')
      end if
   end subroutine check_friction

   !> Exact dampers make a state of the rotation of each damped hinge. Damping must not come and go there.
   subroutine check_dampers(checker, i, hinge, config)
      class(key_checker), intent(inout) :: checker
      integer, intent(in) :: i
      type(hinge_config), intent(in) :: hinge
      type(case_config), intent(in) :: config

      if (config%model%bending /= 'quasistatic' .or. config%model%dampers /= 'exact') return
      if (.not. max(hinge%stop_damping, hinge%lock_damping, hinge%friction_moment) > 0.0_wp) return
      if (.not. checker%is_sound('chain', 1, 'hinge_damping')) return
      if (hinge%hinge < 0 .or. hinge%hinge >= min(config%chain%n_rods, size(config%chain%hinge_damping))) return
      if (.not. config%chain%hinge_damping(hinge%hinge) > 0.0_wp) call checker%report('hinge', i, 'hinge', &
         "with dampers = 'exact', stop_damping, lock_damping and friction_moment need a hinge with hinge_damping")
   end subroutine check_dampers

end module rodyn_hinge_rules
