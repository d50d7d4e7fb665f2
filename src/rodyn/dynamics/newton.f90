!> Newton systems (1 - g J) x = r of the equations of motion, J = df/dy exact: O(n) time and memory for every scene.
!>
!>     call newton%linearise(scene, hinges, sine, cosine, q, p, a, loaded, node_force)  at a state
!>     call newton%factorise(scene, hinges, gamma, ok)                          for one g, as often as wanted
!>     call newton%solve(scene, hinges, x)                                      for each right-hand side
!>
!> The mass matrix is never inverted: with z the change of p', xp = rp + g z and xq = rq + g xp, and z solves the
!> linearised balance of forces (`rodyn_newton_chain`, `rodyn_newton_series`, `rodyn_newton_root`).
!> The same equations elsewhere: docs/model.md sec. 7.
module rodyn_newton
   use rodyn_kinds, only: wp
   use rodyn_scene, only: scene_type
   use rodyn_hinge_law, only: hinge_law, hinge_tangent, openings
   use rodyn_three_moments, only: three_moments, new_three_moments
   use rodyn_newton_tangent, only: rod_tangent, linearise_rods
   use rodyn_newton_root, only: newton_root
   use rodyn_newton_chain, only: rod_factor, factorise_chain, reduce_chain, expand_chain
   use rodyn_newton_condensed, only: condensed_newton, new_condensed_newton, linearise_condensed, factorise_condensed, &
      reduce_condensed, expand_condensed
   use rodyn_newton_arcs, only: arc_tangent, linearise_arcs, factorise_arcs, reduce_arcs, expand_arcs
   use rodyn_newton_series, only: series_factor, factorise_series, reduce_series, expand_series, of_opening
   implicit none (type, external)
   private
   public :: newton_type

   !> A linearised scene and its factors.
   type :: newton_type
      private
      real(wp) :: gamma = 0.0_wp              !! of the factors [s]
      logical :: series = .false.             !! massless rods that bend
      type(rod_tangent), allocatable :: tangent(:)   !! (n)
      type(arc_tangent), allocatable :: arc(:)       !! (n) instead, of rods whose arcs keep their length
      type(rod_factor), allocatable :: factor(:)     !! (n), or
      type(series_factor), allocatable :: damped(:)  !! (n)
      type(condensed_newton), allocatable :: condensed !! for condensed rods
      type(newton_root) :: root
      real(wp) :: place(2) = 0.0_wp           !! u_x, u_y [m]
      real(wp), allocatable :: hinge(:)       !! c = g^2 C + g D, or C (+ D/g if relaxing) of massless rods that bend (0:n-1)
      real(wp), allocatable :: damping(:)     !! D, or zeros with relaxing hinges (0:n-1)
      type(three_moments) :: balance          !! relaxing hinges: springs C + D/g and rods in series
      real(wp), allocatable :: angle(:), rate(:) !! dq0, dp0 (n_q), (n_dof)
      real(wp), allocatable :: moment(:)      !! known parts of the hinge moments (0:n)
      real(wp), allocatable :: opening(:)     !! known openings of relaxing hinges (0:n-1)
      real(wp), allocatable :: left(:, :)     !! between the passes of a solution (3 or 5, n)
   contains
      procedure :: linearise
      procedure :: factorise
      procedure :: solve
   end type newton_type

contains

   !> Keep the derivatives at a state. Allocates at the first call.
   subroutine linearise(self, scene, hinges, sine, cosine, q, p, a, loaded, node_force)
      class(newton_type), intent(inout) :: self
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      real(wp), intent(in) :: sine(0:), cosine(0:) !! of phi (0:n); 0 and 1 at 0
      real(wp), intent(in) :: q(:), p(:)           !! state
      real(wp), intent(in) :: a(:)                 !! p' there
      logical, intent(in) :: loaded                !! node_force is to be used
      real(wp), intent(in) :: node_force(:, :)     !! X, Y at the nodes (2, n) [N]

      if (.not. allocated(self%hinge)) call allocate_newton(self, scene, hinges)
      if (scene%condensed) then
         call linearise_condensed(self%condensed, scene, hinges, sine, cosine, q, p, a, loaded, node_force, self%tangent)
      else if (scene%inextensible) then
         call linearise_arcs(scene, sine, cosine, q, p, a, loaded, node_force, self%arc)
      else
         call linearise_rods(scene, sine, cosine, q, p, a, loaded, node_force, self%tangent)
      end if
      if (scene%n_base == 0) return
      self%root%velocity = p(1:2)
      self%root%omega = p(3)
      self%place = q(1:2)
   end subroutine linearise

   subroutine allocate_newton(self, scene, hinges)
      class(newton_type), intent(inout) :: self
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges

      self%series = scene%lumped .and. scene%quasistatic
      associate (n => scene%n)
         if (scene%inextensible) then
            allocate (self%arc(n))
         else
            allocate (self%tangent(n))
         end if
         allocate (self%hinge(0:n - 1), self%moment(0:n), self%opening(0:n - 1))
         allocate (self%damping(0:n - 1), source=hinges%damping)
         if (size(hinges%relaxing) > 0) self%damping = 0.0_wp
         allocate (self%angle(scene%n_q), self%rate(scene%n_dof))
         if (scene%condensed) then
            allocate (self%condensed, self%left(1, n))
            call new_condensed_newton(self%condensed, scene, hinges)
         else if (self%series) then
            allocate (self%damped(n), self%left(5, n))
         else
            allocate (self%factor(n), self%left(3, n))
         end if
      end associate
   end subroutine allocate_newton

   !> Factor 1 - g J at the state of the last `linearise`.
   subroutine factorise(self, scene, hinges, gamma, ok)
      class(newton_type), intent(inout) :: self
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      real(wp), intent(in) :: gamma !! > 0 [s]
      logical, intent(out) :: ok    !! false: singular
      real(wp) :: apparent(3, 2), by_omega(3)

      self%gamma = gamma
      associate (law => hinges)
         if (scene%condensed) then
            call factorise_condensed(self%condensed, scene, law, gamma, self%tangent, apparent, by_omega, ok)
         else if (self%series) then
            self%hinge = law%stiffness
            if (size(law%relaxing) > 0) then
               self%hinge = law%stiffness + law%damping/gamma
               call new_three_moments(self%balance, self%hinge, law%series%flexibility, spread(.false., 1, scene%n))
            end if
            call factorise_series(scene%n, gamma, scene%rods, scene%rod_of, scene%node_mass, self%hinge, self%damping, &
                                  self%tangent, self%damped, apparent, by_omega, ok)
         else
            self%hinge = gamma*(gamma*law%stiffness + law%damping)
            if (scene%inextensible) then
               call factorise_arcs(scene%n, gamma, scene%node_mass, self%hinge, self%arc, self%factor, apparent, by_omega, ok)
            else
               call factorise_chain(scene%n, gamma, scene%dynamic_bending, scene%rods, scene%rod_of, scene%node_mass, &
                                    self%hinge, self%tangent, self%factor, apparent, by_omega, ok)
            end if
         end if
      end associate
      if (.not. ok .or. scene%n_base == 0) return
      apparent(1, 1) = apparent(1, 1) + scene%node_mass(0)
      apparent(2, 2) = apparent(2, 2) + scene%node_mass(0)
      call self%root%factorise(gamma, scene%body, apparent, by_omega, ok)
   end subroutine factorise

   !> x <- (1 - g J)^-1 x on the coordinates and rates; states behind them (quadratures) are not touched.
   subroutine solve(self, scene, hinges, x)
      class(newton_type), intent(inout) :: self
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      real(wp), intent(inout) :: x(:) !! (q, p, ...)
      real(wp) :: root_rate(3), z(3), known(3), acceleration(2)

      associate (n_q => scene%n_q, m => scene%n_dof, gamma => self%gamma, dq => self%angle, dp => self%rate, &
                 f => scene%phi_at() + 1)
         dp = x(n_q + 1:n_q + m)
         dq(1:m) = x(1:m) + gamma*dp
         dq(m + 1:) = x(m + 1:n_q)
         root_rate = 0.0_wp
         if (scene%n_base > 0) root_rate = dp(1:3)
         z = 0.0_wp
         acceleration = 0.0_wp
         call known_moments(self, scene, hinges)
         call inward(self, scene, hinges, root_rate(3), known)
         if (scene%n_base > 0) then
            known(3) = known(3) - self%moment(0)
            call self%root%solve(scene%body, root_rate, known, z, acceleration)
         end if
         call outward(self, scene, root_rate(3), z(3), acceleration)
         call add_rods(self, scene, hinges%relaxing, x(:n_q), x(n_q + 1:n_q + m))
         if (scene%n_base > 0) call add_spacecraft(self, z, x(:n_q), x(n_q + 1:n_q + m))
      end associate
   end subroutine solve

   !> What the known changes alone do to the hinge moments. Relaxing hinges have T = (C + D/g) th - (D/g) r, with r in dq
   !> behind phi, and the rods' flexibility F gives (1 + F (C + D/g)) th = opening + F (D/g) r.
   subroutine known_moments(self, scene, hinges)
      class(newton_type), intent(inout) :: self
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      integer :: i, k

      if (scene%condensed) then ! of its hinges `rodyn_newton_condensed` knows
         self%moment = 0.0_wp
         return
      end if
      associate (law => hinges, n => scene%n, f => scene%phi_at() + 1, pull => self%moment)
         if (size(law%relaxing) == 0) then
            call hinge_tangent(law, n, scene%dynamic_bending, self%angle(f:), self%rate(f:), self%opening, self%moment)
            return
         end if
         call openings(n, .false., self%angle(f:), self%opening)
         pull = 0.0_wp
         do i = 1, size(law%relaxing)
            k = law%relaxing(i)
            pull(k) = law%damping(k)/self%gamma*self%angle(scene%n_dof + i)
         end do
         do k = 1, n
            associate (f => law%series%flexibility(:, k))
               self%opening(k - 1) = self%opening(k - 1) + f(2)*(f(1)/f(2)*pull(k - 1) + pull(k))
               if (k < n) self%opening(k) = self%opening(k) + f(2)*(pull(k - 1) + f(3)/f(2)*pull(k))
            end associate
         end do
         call self%balance%solve(self%opening)
         self%moment(0:n - 1) = self%hinge*self%opening - pull(0:n - 1)
      end associate
   end subroutine known_moments

   subroutine inward(self, scene, hinges, d_omega, known)
      class(newton_type), intent(inout) :: self
      type(scene_type), intent(in) :: scene
      type(hinge_law), intent(in) :: hinges
      real(wp), intent(in) :: d_omega
      real(wp), intent(out) :: known(3)

      associate (f => scene%phi_at() + 1, dq => self%angle, dp => self%rate)
         if (scene%condensed) then
            call reduce_condensed(self%condensed, scene, hinges, self%tangent, dq, dp, known)
         else if (self%series) then
            call reduce_series(scene%n, scene%rods, scene%rod_of, self%tangent, self%damped, d_omega, dq(f:), dp(f:), &
                               self%moment, self%left, known)
         else if (scene%inextensible) then
            associate (a => scene%alpha_at() + 1, b => scene%beta_at() + 1)
               call reduce_arcs(scene%n, self%hinge, self%arc, self%factor, d_omega, dq(f:), dq(a:), dq(b:), dp(f:), dp(a:), &
                                dp(b:), self%moment, self%left, known)
            end associate
         else if (scene%dynamic_bending) then
            associate (a => scene%alpha_at() + 1, b => scene%beta_at() + 1)
               call reduce_chain(scene%n, .true., scene%rods, scene%rod_of, self%hinge, self%tangent, self%factor, &
                                 d_omega, dq(f:), dq(a:), dq(b:), dp(f:), dp(a:), dp(b:), self%moment, self%left, known)
            end associate
         else
            call reduce_chain(scene%n, .false., scene%rods, scene%rod_of, self%hinge, self%tangent, self%factor, &
                              d_omega, dq(f:), dq, dq, dp(f:), dp, dp, self%moment, self%left, known)
         end if
      end associate
   end subroutine inward

   subroutine outward(self, scene, d_omega, omega_rate, acceleration)
      class(newton_type), intent(inout) :: self
      type(scene_type), intent(in) :: scene
      real(wp), intent(in) :: d_omega, omega_rate, acceleration(2)

      associate (f => scene%phi_at() + 1, dq => self%angle, dp => self%rate, a => acceleration)
         if (scene%condensed) then
            call expand_condensed(self%condensed, scene, self%tangent, dq, dp, omega_rate, a, self%left(1, :))
         else if (self%series) then
            call expand_series(scene%n, scene%rods, scene%rod_of, self%tangent, self%damped, d_omega, dq(f:), dp(f:), &
                               omega_rate, a(1), a(2), self%left)
         else if (scene%inextensible) then
            associate (first => scene%alpha_at() + 1, last => scene%beta_at() + 1)
               call expand_arcs(scene%n, self%gamma, self%arc, self%factor, d_omega, dq(f:), dq(first:), dq(last:), dp(f:), &
                                dp(first:), dp(last:), omega_rate, a, self%left)
            end associate
         else
            call expand_chain(scene%n, scene%dynamic_bending, scene%rods, scene%rod_of, self%tangent, self%factor, d_omega, &
                              dq(f:), dp(f:), omega_rate, a(1), a(2), self%left)
         end if
      end associate
   end subroutine outward

   !> The rods' part of the solution, and the relaxing hinges'.
   pure subroutine add_rods(self, scene, relaxing, xq, xp)
      class(newton_type), intent(in) :: self
      type(scene_type), intent(in) :: scene
      integer, intent(in) :: relaxing(:)
      real(wp), intent(inout) :: xq(:), xp(:)
      integer :: first, group, i, k

      do group = 1, merge(3, 1, scene%dynamic_bending) ! phi, alpha, beta
         first = scene%phi_at() + (group - 1)*scene%n
         do k = 1, scene%n
            i = first + k
            xp(i) = self%rate(i) + self%gamma*self%left(group, k)
            xq(i) = self%angle(i) + self%gamma**2*self%left(group, k)
         end do
      end do
      do i = 1, size(relaxing)
         k = relaxing(i)
         xq(scene%n_dof + i) = self%opening(k) + self%gamma**2*self%left(of_opening, k + 1)
      end do
   end subroutine add_rods

   !> The spacecraft's part: u' = V + w (u_y, -u_x), theta' = w.
   pure subroutine add_spacecraft(self, z, xq, xp)
      class(newton_type), intent(in) :: self
      real(wp), intent(in) :: z(3) !! changes of Vx', Vy', w'
      real(wp), intent(inout) :: xq(:), xp(:)
      real(wp) :: right(2), turn

      associate (gamma => self%gamma)
         xp(1:3) = self%rate(1:3) + gamma*z
         right = xq(1:2) + gamma*(xp(1:2) + xp(3)*[self%place(2), -self%place(1)])
         turn = gamma*self%root%omega
         xq(1) = (right(1) + turn*right(2))/(1.0_wp + turn**2)
         xq(2) = (right(2) - turn*right(1))/(1.0_wp + turn**2)
         xq(3) = xq(3) + gamma*xp(3)
      end associate
   end subroutine add_spacecraft

end module rodyn_newton
