!> Rows of the run file from states of a motion; with a ledger, energies, momenta and what does not balance.
module rodyn_ledger
   use rodyn_kinds, only: wp
   use rodyn_motion, only: motion_type
   use rodyn_kinematics, only: invariants_type, invariants, slopes
   use rodyn_run_file, only: run_row
   implicit none (type, external)
   private
   public :: fill_row

contains

   !> Fill `row` from the state y at time t. The residual is
   !>     (kinetic + elastic + dissipated - work)(t) - (kinetic + elastic)(0),
   !> zero but for the integrator's error in a `consistent` scene, docs/model.md sec. 6.
   pure subroutine fill_row(motion, t, y, initial_energy, row)
      type(motion_type), intent(in) :: motion
      real(wp), intent(in) :: t              !! [s]
      real(wp), intent(in) :: y(:)           !! (n_states)
      real(wp), intent(in) :: initial_energy !! kinetic + elastic at t = 0 [J]
      type(run_row), intent(inout) :: row    !! of the same number of rods
      type(invariants_type) :: values

      associate (r => motion%n_q, m => motion%n_dof, scene => motion%dynamics%scene)
         associate (q => y(:r), p => y(r + 1:r + m))
            row%time = t
            row%phi = q(scene%phi_at() + 1:scene%phi_at() + scene%n)
            row%phi_rate = p(scene%phi_at() + 1:scene%phi_at() + scene%n)
            call slopes(scene, q, p, row%alpha, row%beta, row%alpha_rate, row%beta_rate)
            row%bubble = 0.0_wp
            row%bubble_rate = 0.0_wp
            if (scene%n_bend == 3) then
               row%bubble = q(scene%bend_at(3) + 1:scene%bend_at(3) + scene%n)
               row%bubble_rate = p(scene%bend_at(3) + 1:scene%bend_at(3) + scene%n)
            end if
            if (motion%free) then
               row%displacement_x = q(1)
               row%displacement_y = q(2)
               row%rotation = q(3)
               row%velocity_x = p(1)
               row%velocity_y = p(2)
               row%omega = p(3)
            end if
            if (.not. motion%ledger) return
            values = invariants(scene, q, p)
         end associate
         row%energy_kinetic = values%kinetic
         row%energy_elastic = values%elastic
         row%work_external = y(r + m + 1)
         row%energy_dissipated = y(r + m + 2)
         row%energy_residual = (values%kinetic + values%elastic + y(r + m + 2)) - (y(r + m + 1) + initial_energy)
         row%momentum_x = values%momentum(1)
         row%momentum_y = values%momentum(2)
         row%angular_momentum = values%angular_momentum
      end associate
   end subroutine fill_row

end module rodyn_ledger
