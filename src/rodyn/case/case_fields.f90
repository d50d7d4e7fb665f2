!> All keys of a case, each with its component, in the order of the table.
module rodyn_case_fields
   use rodyn_case_config, only: case_config, chain_config, hinge_config, initial_config, kink_config, load_config, &
      model_config, output_config, profile_config, solver_config, spacecraft_config
   use rodyn_field_visitor, only: field_visitor
   use rodyn_text, only: has_word
   use rodyn_time_law, only: keys_of_law
   implicit none (type, external)
   private
   public :: visit_case

contains

   !> Visit every key of a case whose `profiles`, `loads`, `kink_programs` and `hinges` have been allocated.
   subroutine visit_case(visitor, config)
      class(field_visitor), intent(inout) :: visitor
      type(case_config), intent(inout) :: config
      integer :: i

      call visitor%open_group('case', 1)
      call visitor%text_field('title', config%title)
      call visitor%field('t_end', config%t_end)
      call visitor%field('n_outputs', config%n_outputs)
      call visitor%close_group()
      call visit_spacecraft(visitor, config%spacecraft)
      call visit_chain(visitor, config%chain)
      do i = 1, size(config%profiles)
         call visit_profile(visitor, i, config%profiles(i))
      end do
      call visit_model(visitor, config%model)
      call visit_initial(visitor, config%initial)
      do i = 1, size(config%loads)
         call visit_load(visitor, i, config%loads(i))
      end do
      do i = 1, size(config%kink_programs)
         call visit_kink_program(visitor, i, config%kink_programs(i))
      end do
      do i = 1, size(config%hinges)
         call visit_hinge(visitor, i, config%hinges(i))
      end do
      call visit_solver(visitor, config%solver)
      call visit_output(visitor, config%output)
   end subroutine visit_case

   subroutine visit_spacecraft(visitor, spacecraft)
      class(field_visitor), intent(inout) :: visitor
      type(spacecraft_config), intent(inout) :: spacecraft
      call visitor%open_group('spacecraft', 1)
      call visitor%field('mass', spacecraft%mass)
      call visitor%field('inertia', spacecraft%inertia)
      call visitor%field('hinge_x', spacecraft%hinge_x)
      call visitor%field('hinge_y', spacecraft%hinge_y)
      call visitor%word_field('motion', spacecraft%motion)
      call visitor%close_group()
   end subroutine visit_spacecraft

   subroutine visit_chain(visitor, chain)
      class(field_visitor), intent(inout) :: visitor
      type(chain_config), intent(inout) :: chain
      call visitor%open_group('chain', 1)
      call visitor%field('n_rods', chain%n_rods)
      call visitor%field('length', chain%length)
      call visitor%field('mass_per_length', chain%mass_per_length)
      call visitor%field('bending_stiffness', chain%bending_stiffness)
      call visitor%field('node_mass', chain%node_mass)
      call visitor%field('hinge_stiffness', chain%hinge_stiffness)
      call visitor%field('hinge_damping', chain%hinge_damping)
      call visitor%field('kink', chain%kink)
      call visitor%close_group()
   end subroutine visit_chain

   subroutine visit_profile(visitor, instance, profile)
      class(field_visitor), intent(inout) :: visitor
      integer, intent(in) :: instance
      type(profile_config), intent(inout) :: profile
      call visitor%open_group('rod_profile', instance)
      call visitor%word_field('quantity', profile%quantity)
      call visitor%field('first_rod', profile%first_rod)
      call visitor%field('last_rod', profile%last_rod)
      call visitor%field('polynomial', profile%polynomial)
      call visitor%field('positions', profile%positions)
      call visitor%field('values', profile%values)
      call visitor%close_group()
   end subroutine visit_profile

   subroutine visit_model(visitor, model)
      class(field_visitor), intent(inout) :: visitor
      type(model_config), intent(inout) :: model
      call visitor%open_group('model', 1)
      call visitor%word_field('formulation', model%formulation)
      call visitor%word_field('inertia', model%inertia)
      call visitor%word_field('bending', model%bending)
      call visitor%field('bending_shapes', model%bending_shapes)
      call visitor%word_field('dampers', model%dampers)
      call visitor%field('gauss_points', model%gauss_points)
      call visitor%word_field('kernel', model%kernel)
      call visitor%field('deflection_limit', model%deflection_limit)
      call visitor%close_group()
   end subroutine visit_model

   subroutine visit_initial(visitor, initial)
      class(field_visitor), intent(inout) :: visitor
      type(initial_config), intent(inout) :: initial
      call visitor%open_group('initial', 1)
      call visitor%field('phi', initial%phi)
      call visitor%field('alpha', initial%alpha)
      call visitor%field('beta', initial%beta)
      call visitor%field('bubble', initial%bubble)
      call visitor%field('phi_rate', initial%phi_rate)
      call visitor%field('alpha_rate', initial%alpha_rate)
      call visitor%field('beta_rate', initial%beta_rate)
      call visitor%field('bubble_rate', initial%bubble_rate)
      call visitor%field('velocity_x', initial%velocity_x)
      call visitor%field('velocity_y', initial%velocity_y)
      call visitor%field('omega', initial%omega)
      call visitor%field('displacement_x', initial%displacement_x)
      call visitor%field('displacement_y', initial%displacement_y)
      call visitor%field('rotation', initial%rotation)
      call visitor%close_group()
   end subroutine visit_initial

   !> Only the keys that the target and the law of this load have.
   subroutine visit_load(visitor, instance, load)
      class(field_visitor), intent(inout) :: visitor
      integer, intent(in) :: instance
      type(load_config), intent(inout) :: load
      character(len=:), allocatable :: keys
      call visitor%open_group('load', instance)
      call visitor%word_field('target', load%target)
      if (visitor%every_key .or. load%target == 'node') call visitor%field('node', load%node)
      call visitor%word_field('component', load%component)
      call visitor%word_field('law', load%law)
      keys = keys_of_law(load%law) ! a reader has just read it
      call visitor%field('t_start', load%t_start)
      call visitor%field('t_end', load%t_end)
      if (visitor%every_key .or. has_word(keys, 'value')) call visitor%field('value', load%value)
      if (visitor%every_key .or. has_word(keys, 'rate')) call visitor%field('rate', load%rate)
      if (visitor%every_key .or. has_word(keys, 'rise_time')) call visitor%field('rise_time', load%rise_time)
      if (visitor%every_key .or. has_word(keys, 'times')) call visitor%field('times', load%times)
      if (visitor%every_key .or. has_word(keys, 'values')) call visitor%field('values', load%values)
      if (visitor%every_key .or. has_word(keys, 'after')) call visitor%word_field('after', load%after)
      call visitor%close_group()
   end subroutine visit_load

   !> Only the keys that the law has.
   subroutine visit_kink_program(visitor, instance, program)
      class(field_visitor), intent(inout) :: visitor
      integer, intent(in) :: instance
      type(kink_config), intent(inout) :: program
      character(len=:), allocatable :: keys
      call visitor%open_group('kink_program', instance)
      call visitor%field('hinge', program%hinge)
      call visitor%word_field('law', program%law)
      keys = keys_of_law(program%law)
      if (visitor%every_key .or. has_word(keys, 't_start')) call visitor%field('t_start', program%t_start)
      if (visitor%every_key .or. has_word(keys, 't_end')) call visitor%field('t_end', program%t_end)
      if (visitor%every_key .or. has_word(keys, 'value')) call visitor%field('value', program%value)
      if (visitor%every_key .or. has_word(keys, 'rate')) call visitor%field('rate', program%rate)
      if (visitor%every_key .or. has_word(keys, 'times')) call visitor%field('times', program%times)
      if (visitor%every_key .or. has_word(keys, 'values')) call visitor%field('values', program%values)
      call visitor%close_group()
   end subroutine visit_kink_program

   subroutine visit_hinge(visitor, instance, hinge)
      class(field_visitor), intent(inout) :: visitor
      integer, intent(in) :: instance
      type(hinge_config), intent(inout) :: hinge
      call visitor%open_group('hinge', instance)
      call visitor%field('hinge', hinge%hinge)
      call visitor%field('held', hinge%held)
      call visitor%field('release_time', hinge%release_time)
      call visitor%field('release_after', hinge%release_after)
      call visitor%field('rest_angle', hinge%rest_angle)
      call visitor%field('freeplay', hinge%freeplay)
      call visitor%field('freeplay_stiffness', hinge%freeplay_stiffness)
      call visitor%field('lower_stop', hinge%lower_stop)
      call visitor%field('upper_stop', hinge%upper_stop)
      call visitor%field('stop_stiffness', hinge%stop_stiffness)
      call visitor%field('stop_damping', hinge%stop_damping)
      call visitor%field('latch_angle', hinge%latch_angle)
      call visitor%field('lock_stiffness', hinge%lock_stiffness)
      call visitor%field('lock_damping', hinge%lock_damping)
      call visitor%field('friction_moment', hinge%friction_moment)
      call visitor%field('friction_velocity', hinge%friction_velocity)
      call visitor%close_group()
   end subroutine visit_hinge

   subroutine visit_solver(visitor, solver)
      class(field_visitor), intent(inout) :: visitor
      type(solver_config), intent(inout) :: solver
      call visitor%open_group('solver', 1)
      call visitor%word_field('method', solver%method)
      call visitor%field('rtol', solver%rtol)
      call visitor%field('atol', solver%atol)
      call visitor%field('order', solver%order)
      call visitor%field('max_step', solver%max_step)
      call visitor%field('fixed_step', solver%fixed_step)
      call visitor%field('allow_unstable', solver%allow_unstable)
      call visitor%field('max_steps', solver%max_steps)
      call visitor%field('max_events', solver%max_events)
      call visitor%close_group()
   end subroutine visit_solver

   subroutine visit_output(visitor, output)
      class(field_visitor), intent(inout) :: visitor
      type(output_config), intent(inout) :: output
      call visitor%open_group('output', 1)
      call visitor%text_field('file', output%file)
      call visitor%field('ledger', output%ledger)
      call visitor%field('compression', output%compression)
      call visitor%close_group()
   end subroutine visit_output

end module rodyn_case_fields
