!> Positions, velocities, energies and momenta of a scene in a given state, docs/model.md sec. 1 and 2. O(n).
!> The same equations elsewhere: docs/model.md sec. 7.
module rodyn_kinematics
   use rodyn_kinds, only: wp
   use rodyn_scene, only: scene_type
   use rodyn_bending_matrices, only: bending_matrices, most_shapes
   use rodyn_foreshortening, only: axial_inertia, crossed_inertia
   use rodyn_hinge_law, only: hinge_law, hinge_state, spring_energy
   use rodyn_three_moments, only: slopes_from_moments
   implicit none (type, external)
   private
   public :: invariants_type, invariants, load_power, slopes, kinetic_energy, elastic_energy, acceleration_of_hinge_0

   !> What the ledger records of a state. Momenta along inertial axes, angular momentum about their origin.
   type :: invariants_type
      real(wp) :: kinetic = 0.0_wp          !! kinetic energy, all terms kept in any formulation [J]
      real(wp) :: elastic = 0.0_wp          !! energy of hinges and rods [J]
      real(wp) :: momentum(2) = 0.0_wp      !! [kg m/s]
      real(wp) :: angular_momentum = 0.0_wp !! [kg m^2/s]
   end type invariants_type

   !> Sums over the chain, moving axes.
   type :: chain_sums
      real(wp) :: kinetic = 0.0_wp
      real(wp) :: momentum(2) = 0.0_wp
      real(wp) :: turning = 0.0_wp !! angular momentum about the inertial origin
   end type chain_sums

contains

   !> Energies and momenta of a state.
   pure function invariants(scene, hinges, q, p) result(values)
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      real(wp), intent(in) :: q(:), p(:) !! coordinates and rates (dof)
      type(invariants_type) :: values
      type(chain_sums) :: sums
      real(wp) :: velocity(2), place(2), rotation

      velocity = 0.0_wp
      place = 0.0_wp
      rotation = 0.0_wp
      call sum_chain(scene, hinges, q, p, sums)
      values%kinetic = sums%kinetic
      if (scene%n_base > 0) then
         velocity = p(1:2)
         place = q(1:2)
         rotation = q(3)
         associate (body => scene%body)
            values%kinetic = values%kinetic + 0.5_wp*(body%mass*sum(velocity**2) + body%inertia*p(3)**2)
            sums%momentum = sums%momentum + body%mass*velocity
            sums%turning = sums%turning + body%mass*cross(place, velocity) + body%inertia*p(3)
         end associate
      end if
      values%elastic = elastic_energy(scene, hinges, q, p)
      values%momentum = [cos(rotation)*sums%momentum(1) - sin(rotation)*sums%momentum(2), &
                         sin(rotation)*sums%momentum(1) + cos(rotation)*sums%momentum(2)]
      values%angular_momentum = sums%turning
   end function invariants

   !> Kinetic energy [J].
   pure real(wp) function kinetic_energy(scene, hinges, q, p)
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      real(wp), intent(in) :: q(:), p(:)
      type(invariants_type) :: values
      values = invariants(scene, hinges, q, p)
      kinetic_energy = values%kinetic
   end function kinetic_energy

   !> One pass outward. A point of rod k moves by U + W ((s - d) n - v e) + v' n - d' e, U the velocity of its inner node.
   pure subroutine sum_chain(scene, hinges, q, p, sums)
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      real(wp), intent(in) :: q(:), p(:)
      type(chain_sums), intent(out) :: sums
      real(wp) :: u(2), place(2), axis(2), normal(2), omega, w, x(most_shapes), xr(most_shapes), first(2), flow(2), spin, inertia
      real(wp), dimension(scene%n) :: alpha, beta, alpha_rate, beta_rate ! of condensed rods
      real(wp) :: moving
      integer :: k

      if (scene%condensed) call slopes(scene, hinges, q, p, alpha, beta, alpha_rate, beta_rate)
      call at_hinge_0(scene, q, p, place, u, omega)
      call add_mass(sums, scene%node_mass(0), place, u)
      do k = 1, scene%n
         axis = [cos(q(scene%phi_at() + k)), sin(q(scene%phi_at() + k))]
         normal = [-axis(2), axis(1)]
         w = omega + p(scene%phi_at() + k)
         x = scene%bends(k, q)
         xr = scene%bends(k, p)
         if (scene%condensed) then
            x(1:2) = [alpha(k), beta(k)]
            xr(1:2) = [alpha_rate(k), beta_rate(k)]
         end if
         associate (i => scene%rods(scene%rod_of(k))%inertia, bend => scene%bending(scene%rod_of(k)))
            first = i%m1*axis + dot_product(bend%first, x)*normal           ! int m ((s - d) e + v n)
            flow = w*[-first(2), first(1)] + dot_product(bend%first, xr)*normal
            inertia = i%m2 + dot_product(x, matmul(bend%centrifugal, x))
            spin = w*inertia + dot_product(bend%turning, xr)
            moving = dot_product(xr, matmul(bend%inertia, xr))
            if (bend%inextensible) call shorten_sums(bend, x, xr, w, axis, normal, first, flow, inertia, spin, moving)
            sums%kinetic = sums%kinetic + 0.5_wp*(i%m0*sum(u**2) + w*(2.0_wp*spin - w*inertia) + moving) + dot_product(u, flow)
            sums%momentum = sums%momentum + i%m0*u + flow
            sums%turning = sums%turning + cross(place, i%m0*u + flow) + cross(first, u) + spin
            place = place + scene%chord(k, q)*axis
            u = u + scene%chord(k, q)*w*normal
            if (bend%inextensible) u = u + scene%chord_rate(k, q, p)*axis
         end associate
         call add_mass(sums, scene%node_mass(k), place, u)
      end do
   end subroutine sum_chain

   !> What foreshortening adds to the sums over a rod (`rodyn_foreshortening`).
   pure subroutine shorten_sums(bend, x, xr, w, axis, normal, first, flow, inertia, spin, moving)
      type(bending_matrices), intent(in) :: bend
      real(wp), intent(in) :: x(most_shapes), xr(most_shapes), w, axis(2), normal(2)
      real(wp), intent(inout) :: first(2), flow(2), inertia, spin, moving
      real(wp) :: drawn(most_shapes), z(most_shapes, most_shapes), q(most_shapes, most_shapes), drawn_in, added

      drawn = matmul(bend%drawn, x)
      drawn_in = 0.5_wp*dot_product(x, drawn)
      z = crossed_inertia(bend, x)
      q = axial_inertia(bend, x, x)
      added = 0.25_wp*dot_product(x, matmul(q, x))
      first = first - drawn_in*axis
      flow = flow - w*drawn_in*normal - dot_product(xr, drawn)*axis
      inertia = inertia + added
      spin = spin + w*added + dot_product(matmul(x, z) - 0.5_wp*matmul(z, x), xr)
      moving = moving + dot_product(xr, matmul(q, xr))
   end subroutine shorten_sums

   !> A point mass.
   pure subroutine add_mass(sums, mass, place, u)
      type(chain_sums), intent(inout) :: sums
      real(wp), intent(in) :: mass, place(2), u(2)
      sums%kinetic = sums%kinetic + 0.5_wp*mass*sum(u**2)
      sums%momentum = sums%momentum + mass*u
      sums%turning = sums%turning + mass*cross(place, u)
   end subroutine add_mass

   !> Place (from the inertial origin) and velocity of hinge 0, moving axes.
   pure subroutine at_hinge_0(scene, q, p, place, u, omega)
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: q(:), p(:)
      real(wp), intent(out) :: place(2), u(2), omega
      place = [scene%body%hinge_x, scene%body%hinge_y]
      u = 0.0_wp
      omega = 0.0_wp
      if (scene%n_base == 0) return
      omega = p(3)
      u = p(1:2) + omega*[-place(2), place(1)]
      place = place + q(1:2)
   end subroutine at_hinge_0

   !> Absolute acceleration of hinge 0, moving axes [m/s^2].
   pure function acceleration_of_hinge_0(scene, p, a) result(node)
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: p(:), a(:) !! rates and their rates (dof)
      real(wp) :: node(2)

      node = 0.0_wp
      if (scene%n_base == 0) return
      associate (x => scene%body%hinge_x, y => scene%body%hinge_y, w => p(3))
         node = [a(1) - w*p(2) - a(3)*y - w**2*x, a(2) + w*p(1) + a(3)*x - w**2*y]
      end associate
   end function acceleration_of_hinge_0

   pure real(wp) function cross(a, b)
      real(wp), intent(in) :: a(2), b(2)
      cross = a(1)*b(2) - a(2)*b(1)
   end function cross

   !> Elastic energy of hinges and rods [J].
   pure real(wp) function elastic_energy(scene, hinges, q, p)
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      real(wp), intent(in) :: q(:), p(:)
      real(wp), dimension(0:scene%n - 1) :: theta, theta_rate
      real(wp), dimension(0:scene%n) :: moment, moment_rate
      real(wp), dimension(scene%n) :: alpha, beta, alpha_rate, beta_rate
      integer :: k

      associate (first => scene%n_base + 1)
         call hinge_state(hinges, scene%n, scene%dynamic_bending, q(first:), p(first:), theta, theta_rate, &
                          moment, moment_rate)
      end associate
      elastic_energy = spring_energy(hinges, theta)
      if (.not. (scene%dynamic_bending .or. scene%quasistatic)) return
      if (scene%dynamic_bending) then
         do k = 1, scene%n
            associate (x => scene%bends(k, q))
               elastic_energy = elastic_energy + 0.5_wp*dot_product(x, matmul(scene%bending(scene%rod_of(k))%stiffness, x))
            end associate
         end do
         return
      end if
      call slopes(scene, hinges, q, p, alpha, beta, alpha_rate, beta_rate)
      do k = 1, scene%n
         associate (s => scene%rods(scene%rod_of(k))%stiffness, carry => scene%rods(scene%rod_of(k))%carry_over)
            elastic_energy = elastic_energy + 0.5_wp*s(1)* &
                             (alpha(k)**2 + (2.0_wp*carry(1)*alpha(k))*beta(k) + (s(3)/s(1)*beta(k))*beta(k))
         end associate
      end do
   end function elastic_energy

   !> End slopes alpha, beta and their rates: states, or slaved to the moments in the hinges, or zero.
   pure subroutine slopes(scene, hinges, q, p, alpha, beta, alpha_rate, beta_rate)
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      real(wp), intent(in) :: q(:), p(:)
      real(wp), intent(out) :: alpha(:), beta(:)           !! (n) [rad]
      real(wp), intent(out) :: alpha_rate(:), beta_rate(:) !! (n) [rad/s]
      real(wp), dimension(0:scene%n - 1) :: theta, theta_rate
      real(wp), dimension(0:scene%n) :: moment, moment_rate

      alpha = 0.0_wp
      beta = 0.0_wp
      alpha_rate = 0.0_wp
      beta_rate = 0.0_wp
      associate (n => scene%n, first => scene%n_base + 1)
         if (scene%dynamic_bending) then
            alpha = q(scene%alpha_at() + 1:scene%alpha_at() + n)
            beta = q(scene%beta_at() + 1:scene%beta_at() + n)
            alpha_rate = p(scene%alpha_at() + 1:scene%alpha_at() + n)
            beta_rate = p(scene%beta_at() + 1:scene%beta_at() + n)
         else if (scene%quasistatic) then
            call hinge_state(hinges, n, .false., q(first:), p(first:), theta, theta_rate, moment, moment_rate)
            call slopes_from_moments(hinges%series, moment(:n - 1), alpha, beta)
            call slopes_from_moments(hinges%series, moment_rate(:n - 1), alpha_rate, beta_rate)
         end if
      end associate
   end subroutine slopes

   !> Power of the loads on the spacecraft and on the nodes [W].
   pure real(wp) function load_power(scene, q, p, base_force, loaded, node_force)
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: q(:), p(:)
      real(wp), intent(in) :: base_force(3)    !! X_C, Y_C, M_C, moving axes
      logical, intent(in) :: loaded            !! node_force is to be used
      real(wp), intent(in) :: node_force(:, :) !! X, Y at the nodes (2, n)
      real(wp) :: place(2), u(2), omega
      integer :: k

      load_power = 0.0_wp
      if (scene%n_base > 0) load_power = dot_product(base_force, p(1:3))
      if (.not. loaded) return
      call at_hinge_0(scene, q, p, place, u, omega)
      do k = 1, scene%n
         associate (angle => q(scene%phi_at() + k), w => omega + p(scene%phi_at() + k))
            u = u + scene%chord(k, q)*w*[-sin(angle), cos(angle)]
            if (scene%inextensible) u = u + scene%chord_rate(k, q, p)*[cos(angle), sin(angle)]
         end associate
         load_power = load_power + dot_product(node_force(:, k), u)
      end do
   end function load_power

end module rodyn_kinematics
