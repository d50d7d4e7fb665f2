!> Driven kinks: breaks gamma_k(t) of the axis that move by a program: `&kink_program`,
!> docs/moving_scenes.md.
!>
!> The kink of a hinge is that of `&chain` plus all its programs. A program moves between t_start and t_end; before, it
!> has its first value, after, its last. Between two neighbouring switch times every program is smooth.
module rodyn_kink_program
   use rodyn_kinds, only: wp
   use rodyn_case_config, only: kink_config
   use rodyn_switch_times, only: middle_of
   use rodyn_time_law, only: time_law, new_time_law
   implicit none (type, external)
   private
   public :: kink_set, kink_regime, new_kink_set, new_kink_regime, evaluate_kinks

   !> One program, or the piece of it that runs.
   type :: kink_program
      integer :: hinge = 0
      type(time_law) :: law !! [rad]
   end type kink_program

   !> All programs of a case.
   type :: kink_set
      type(kink_program), allocatable :: programs(:)
      real(wp), allocatable :: constant(:) !! kinks without the programs (0:n-1) [rad]
   end type kink_set

   !> What moves between two switches.
   type :: kink_regime
      type(kink_program), allocatable :: moving(:)
      real(wp), allocatable :: constant(:) !! all that does not move (0:n-1) [rad]
   end type kink_regime

contains

   !> Collect the programs.
   subroutine new_kink_set(set, kink, programs)
      type(kink_set), intent(out) :: set
      real(wp), intent(in) :: kink(0:)                      !! kinks of `&chain` (0:n-1) [rad]
      type(kink_config), intent(in), optional :: programs(:) !! absent (not allocated): none
      integer :: i

      allocate (set%constant(0:size(kink) - 1), source=kink)
      allocate (set%programs(0))
      if (.not. present(programs)) return
      deallocate (set%programs)
      allocate (set%programs(size(programs)))
      do i = 1, size(programs)
         set%programs(i)%hinge = programs(i)%hinge
         call new_time_law(set%programs(i)%law, programs(i)%law, programs(i), of_motion=.true., hold=.true.)
      end do
   end subroutine new_kink_set

   !> What moves between two neighbouring switch times (or ends of the run).
   subroutine new_kink_regime(regime, set, t_from, t_to)
      type(kink_regime), intent(out) :: regime
      type(kink_set), intent(in) :: set
      real(wp), intent(in) :: t_from, t_to !! [s]
      logical :: moves(size(set%programs))
      real(wp) :: middle
      integer :: i, n

      middle = middle_of(t_from, t_to)
      moves = set%programs%law%runs_at(middle) .and. .not. set%programs%law%is_still()
      allocate (regime%constant(0:size(set%constant) - 1), source=set%constant)
      allocate (regime%moving(count(moves)))
      n = 0
      do i = 1, size(moves)
         associate (law => set%programs(i)%law, hinge => set%programs(i)%hinge)
            if (moves(i)) then
               n = n + 1
               regime%moving(n)%hinge = hinge
               call law%take_piece(middle, regime%moving(n)%law)
            else
               regime%constant(hinge) = regime%constant(hinge) + law%resting_at(middle)
            end if
         end associate
      end do
   end subroutine new_kink_regime

   !> gamma, gamma' and gamma'' of all hinges at time t.
   pure subroutine evaluate_kinks(regime, t, kink, kink_rate, kink_acceleration)
      type(kink_regime), intent(in) :: regime
      real(wp), intent(in) :: t                        !! [s], within the regime
      real(wp), intent(inout) :: kink(0:)              !! (0:n-1) [rad]
      real(wp), intent(inout) :: kink_rate(0:)         !! (0:n-1) [rad/s]
      real(wp), intent(inout) :: kink_acceleration(0:) !! (0:n-1) [rad/s^2]
      real(wp) :: x(3)
      integer :: i, k

      do k = 0, size(kink) - 1
         kink(k) = regime%constant(k)
         kink_rate(k) = 0.0_wp
         kink_acceleration(k) = 0.0_wp
      end do
      do i = 1, size(regime%moving)
         k = regime%moving(i)%hinge
         x = regime%moving(i)%law%motion_at(t)
         kink(k) = kink(k) + x(1)
         kink_rate(k) = kink_rate(k) + x(2)
         kink_acceleration(k) = kink_acceleration(k) + x(3)
      end do
   end subroutine evaluate_kinks

end module rodyn_kink_program
