!> A few lines on what a scene uses and what it skips, for the terminal.
module rodyn_description
   use rodyn_kinds, only: wp
   use rodyn_text, only: joined, time_text, to_text
   use rodyn_scene, only: scene_type
   use rodyn_switch_times, only: same_time
   implicit none (type, external)
   private
   public :: describe_scene

contains

   !> Three lines: the scene, what is computed, what is not.
   function describe_scene(scene, ledger) result(text)
      type(scene_type), intent(in) :: scene
      logical, intent(in) :: ledger !! energies and momenta are recorded
      character(len=:), allocatable :: text
      character(len=:), allocatable :: uses, skips

      uses = ''
      skips = ''
      call note(scene%n_base > 0, 'free spacecraft')
      call note(scene%dynamic_bending, 'dynamic bending')
      if (scene%quasistatic) call note(.true., 'quasistatic bending')
      call note(.not. scene%lumped, 'rod inertia')
      if (scene%dynamic_bending) call note(scene%inextensible, 'inextensible rods')
      call note((scene%dynamic_bending .or. scene%condensed) .and. scene%consistent, 'second-order inertia')
      call note(scene%hinges%has_damping, 'dampers')
      call note(any(abs(scene%kinks%constant) > 0.0_wp) .or. scene%hinges%driven, 'kinks')
      if (scene%hinges%driven) call note(.true., 'driven kinks')
      if (size(scene%hinges%mechanisms) > 0) call note(.true., 'hinge laws')
      call note_loads()
      call note(ledger, 'ledger')
      text = 'scene   '//count_text(scene%n, 'rod')//' ('//count_text(size(scene%rods), 'distinct kind')//'), '// &
             count_text(2*scene%n_dof, 'state')//'; '//kernel_text()//new_line('a')// &
             'uses    '//uses//new_line('a')//'skips   '//skips

   contains

      !> Put a feature on one of the two lists.
      subroutine note(used, name)
         logical, intent(in) :: used
         character(len=*), intent(in) :: name
         if (used) then
            uses = joined(uses, name, ', ')
         else
            skips = joined(skips, name, ', ')
         end if
      end subroutine note

      subroutine note_loads()
         associate (loads => scene%loads%loads)
            if (size(loads) == 0) then
               call note(.false., 'loads')
               return
            end if
            call note(.true., count_text(size(loads), 'load'))
            call note(any(loads%node > 0), 'loads on nodes')
            if (any(same_time(scene%switches, maxval(loads%law%t_end)))) &
               call note(.false., 'loads after t = '//time_text(maxval(loads%law%t_end))//' s')
         end associate
      end subroutine note_loads

      function kernel_text() result(name)
         character(len=:), allocatable :: name
         name = 'recursive kernel, O(n)'
         if (scene%assembled) name = 'assembled kernel, O(n^3)'
      end function kernel_text

   end function describe_scene

   !> '1 rod', '4 rods'.
   function count_text(number, noun) result(text)
      integer, intent(in) :: number
      character(len=*), intent(in) :: noun
      character(len=:), allocatable :: text
      text = to_text(number)//' '//noun
      if (number /= 1) text = text//'s'
   end function count_text

end module rodyn_description
