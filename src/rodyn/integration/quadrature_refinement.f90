!> Quadratures over a step that is too long for them: the step is made again in shorter ones, which are as short as the
!> quadratures ask for, and nothing is kept of them but the quadratures. So the motion never depends on whether there are any.
module rodyn_quadrature_refinement
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use rodyn_kinds, only: wp, i8
   use rodyn_ode, only: ode_system, n_quadratures
   use rodyn_dop853_step, only: n_stages, stages, add_increment, error_norm, quadrature_errors, safety, shrink, grow
   implicit none (type, external)
   private
   public :: quadrature_refinement

   integer, parameter :: most_steps = 200 !! within one step

   !> Memory of such steps, taken when the first is needed.
   type :: quadrature_refinement
      private
      real(wp), allocatable :: k(:, :)                       !! rates of the stages (n_states, 12)
      real(wp), allocatable, dimension(:) :: y, f, stage, increment, y_new !! (n_states)
      real(wp) :: trial(n_quadratures) = 0.0_wp              !! errors of the quadratures in a step
   contains
      procedure :: refine
   end type quadrature_refinement

contains

   !> Integrals from t to t_end of the motion that starts at y.
   subroutine refine(self, system, t, y, t_end, rtol, atol, tolerance, integral, error, n_rhs, n_steps, ok)
      class(quadrature_refinement), intent(inout) :: self
      class(ode_system), intent(inout) :: system
      real(wp), intent(in) :: t, t_end         !! [s]
      real(wp), intent(in) :: y(:)             !! (n_states)
      real(wp), intent(in) :: rtol, atol       !! of the motion
      real(wp), intent(in) :: tolerance        !! of the quadratures, in each of the shorter steps
      real(wp), intent(inout) :: integral(n_quadratures) !! unchanged unless ok
      real(wp), intent(inout) :: error(n_quadratures)    !! and the estimated error
      integer(i8), intent(inout) :: n_rhs      !! is increased
      integer, intent(out) :: n_steps          !! tried
      logical, intent(out) :: ok               !! false: the motion cannot be followed in so many steps
      real(wp) :: sum_of_errors(n_quadratures), now, h, norm

      if (.not. allocated(self%k)) call reserve(self, size(y))
      self%y(:) = y
      self%y(system%n_controlled + 1:) = 0.0_wp
      sum_of_errors = 0.0_wp
      now = t
      h = 0.5_wp*(t_end - t)
      call system%rhs(now, self%y, self%f, ok)
      n_rhs = n_rhs + 1
      do n_steps = 1, most_steps
         if (.not. ok) return
         if (now + 1.01_wp*h >= t_end) h = t_end - now
         call try(self, system, now, h, rtol, atol, tolerance, norm)
         n_rhs = n_rhs + n_stages
         ok = h > 4.0_wp*spacing(now)
         if (norm <= 1.0_wp) then
            sum_of_errors = sum_of_errors + self%trial
            self%y(:) = self%y_new
            self%f(:) = self%stage
            if (now + h >= t_end) exit
            now = now + h
         end if
         h = h*min(grow, max(shrink, safety*max(norm, tiny(norm))**(-0.125_wp)))
      end do
      ok = ok .and. n_steps <= most_steps
      if (.not. ok) return
      integral = self%y(system%n_controlled + 1:)
      error = sum_of_errors
   end subroutine refine

   subroutine reserve(self, n)
      type(quadrature_refinement), intent(inout) :: self
      integer, intent(in) :: n
      allocate (self%k(n, n_stages), source=0.0_wp)
      allocate (self%y(n), self%f(n), self%stage(n), self%increment(n), self%y_new(n), source=0.0_wp)
   end subroutine reserve

   !> One of the shorter steps. The error of the motion in it counts, too.
   subroutine try(self, system, t, h, rtol, atol, tolerance, norm)
      type(quadrature_refinement), intent(inout) :: self
      class(ode_system), intent(inout) :: system
      real(wp), intent(in) :: t, h, rtol, atol, tolerance
      real(wp), intent(out) :: norm !! of the error, in tolerances
      logical :: ok

      norm = huge(1.0_wp)
      associate (m => system%n_controlled)
         call stages(system, size(self%y), t, h, self%y, self%f, self%k, self%stage, ok)
         if (.not. ok) return
         call add_increment(size(self%y), h, self%k, self%increment)
         self%y_new(:) = self%y + self%increment
         if (.not. all(ieee_is_finite(self%y_new))) return
         call system%rhs(t + h, self%y_new, self%stage, ok)
         if (.not. ok) return
         call quadrature_errors(m, h, self%k, self%trial)
         norm = error_norm(m, h, self%k, self%y, self%y_new, rtol, atol)
         if (tolerance > 0.0_wp) norm = max(norm, maxval(self%trial)/tolerance)
      end associate
      if (.not. ieee_is_finite(norm)) norm = huge(1.0_wp)
   end subroutine try

end module rodyn_quadrature_refinement
