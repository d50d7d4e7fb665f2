!> What the reader of a result should know about the model behind it; for the terminal and the run file.
module rodyn_notes
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type
   use rodyn_hinge_law, only: hinge_law
   use rodyn_scene, only: scene_type
   use rodyn_frequencies, only: natural_frequencies
   use rodyn_switch_times, only: same_time
   use rodyn_text, only: to_text, formatted, time_text
   implicit none (type, external)
   private
   public :: notes_on

   integer, parameter :: most_dof = 600                   !! beyond, eigenvalues would cost more than they tell
   real(wp), parameter :: least_neglected = 1.0e-9_wp     !! smaller terms are not worth a word
   character(len=*), parameter :: remedy = "; dampers = 'exact' keeps them"

contains

   !> One line for each note, without a closing newline; empty if there is nothing to say.
   function notes_on(scene, hinges, q, ledger) result(text)
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      real(wp), intent(in) :: q(:)    !! coordinates at the start (dof)
      logical, intent(in) :: ledger   !! energies are recorded
      character(len=:), allocatable :: text
      real(wp) :: term, frequency
      integer :: hinge, i

      text = ''
      if (ledger .and. (scene%dynamic_bending .or. scene%condensed) .and. .not. scene%consistent) &
         text = "formulation 'paper' has no exact energy: the energy residual includes the defect of the formulation"
      do i = 1, size(scene%loads%loads)
         associate (law => scene%loads%loads(i)%law)
            if (.not. law%drops() .or. .not. any(same_time(scene%switches, law%t_end))) cycle
            if (len(text) > 0) text = text//new_line('a')
            text = text//'load '//to_text(i)//': its table ends at t = '//time_text(law%t_end)//' s, from then on it is zero; '// &
                   "after = 'hold' holds its last value"
         end associate
      end do
      call neglected_damping(scene, hinges, q, term, hinge, frequency)
      if (.not. term > least_neglected) return
      if (len(text) > 0) text = text//new_line('a')
      if (term > huge(term)) then
         text = text//'quasistatic bending neglects terms (D w/C)^2 of the dampers: without bound at hinge '// &
                to_text(hinge)//', which has a damper but no spring'//remedy_of(scene)
         return
      end if
      text = text//'quasistatic bending neglects terms (D w/C)^2 of the dampers: up to '//formatted(term, '(es8.1)')// &
             ' (hinge '//to_text(hinge)//', w = '//formatted(frequency, '(es8.2)')//' rad/s)'//remedy_of(scene)
   end function notes_on

   !> What keeps these terms; condensed rods have nothing that does.
   pure function remedy_of(scene) result(text)
      type(scene_type), intent(in) :: scene
      character(len=:), allocatable :: text
      text = remedy
      if (scene%condensed) text = ''
   end function remedy_of

   !> Largest (D w/C)^2 of the hinges, w the highest natural frequency, docs/model.md sec. 5: the relative size of what
   !> quasistatic bending with reduced dampers leaves out. Zero where nothing is left out or nobody looks.
   subroutine neglected_damping(scene, hinges, q, term, hinge, frequency)
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      real(wp), intent(in) :: q(:)       !! coordinates (dof)
      real(wp), intent(out) :: term      !! infinite for a damper without a spring
      integer, intent(out) :: hinge      !! where it is largest, 0..n-1
      real(wp), intent(out) :: frequency !! w [rad/s]
      real(wp), allocatable :: frequencies(:)
      type(error_type), allocatable :: error
      integer :: k

      term = 0.0_wp
      hinge = 0
      frequency = 0.0_wp
      if (.not. (scene%quasistatic .and. hinges%has_damping) .or. scene%n_dof > most_dof) return
      if (size(hinges%relaxing) > 0) return
      call natural_frequencies(scene, hinges, q, frequencies, error)
      if (allocated(error)) return
      frequency = maxval(frequencies)
      associate (c => hinges%stiffness, d => hinges%damping)
         do k = 0, scene%n - 1
            if (.not. size_of(d(k), c(k)) > term) cycle
            term = size_of(d(k), c(k))
            hinge = k
         end do
      end associate

   contains

      !> (D w/C)^2, without an overflow on the way.
      pure real(wp) function size_of(damping, stiffness)
         use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_positive_inf
         real(wp), intent(in) :: damping, stiffness
         size_of = 0.0_wp
         if (.not. damping > 0.0_wp) return
         size_of = ieee_value(1.0_wp, ieee_positive_inf)
         if (damping*frequency < 1.0e100_wp*stiffness) size_of = (damping*frequency/stiffness)**2
      end function size_of

   end subroutine neglected_damping

end module rodyn_notes
