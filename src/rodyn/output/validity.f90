!> Whether a run stayed where its model holds, judged at the output times.
!>
!> Three things are left out for rods that bend (docs/model.md sec. 1):
!> - The chord keeps its length, although bending by v shortens it by int v'^2/2, a part
!>       (alpha^2/15 - alpha beta/30 + beta^2/15) = (8/3) (v_max/l)^2 for a rod bent to an arc (beta = -alpha)
!>   of l: 1 % where v_max = 0.06 l, which is the default of `deflection_limit`. Where the arc is kept, v'' falls short of the
!>   curvature v''/sqrt(1 - v'^2) by the same part in the mean.
!> - The shape is one cubic. That is exact for moments at its ends. The first vibration of the rod between its nodes,
!>   pi^2 sqrt(EI/m l^4), comes out 11 % too fast, and the slopes of a rod whose ends are moved at half that frequency 1 %
!>   too small. So a rod had better be cut in two if it vibrates faster than that, with more than 1 % of the energy of its turning.
!>   How fast is told by the mean squares of its deflection, without the mean, and of its rate, both weighed by the bending energy.
!> - Axial force N does not act on the bending of a rod that keeps its chord, whose stiffness is off by N l^2/(12 EI): 1 % where
!>   P = |N| l^2/(pi^2 EI) is 0.012. Where the arc is kept, what few shapes leave open grows with P^2, with three shapes with P^3
!>   (docs/stability.md, "Validity", has the measured errors). P falls with the square of the number of rods.
module rodyn_validity
   use rodyn_kinds, only: wp
   use rodyn_accelerations, only: dynamics_type
   use rodyn_motion, only: motion_type
   use rodyn_quantities, only: row_layout, row_type
   use rodyn_rod_constants, only: rod_constants
   use rodyn_rod_forces, only: largest_tension, rod_forces
   use rodyn_scene, only: scene_type
   use rodyn_text, only: joined, time_text, to_text
   implicit none (type, external)
   private
   public :: validity_type, new_validity, interval_of_rows, greatest_deflection

   character(len=*), parameter :: held = ' with held hinges between them (&hinge hinge = ..., held = .true.)'
   real(wp), parameter :: frequency_share = 0.5_wp !! of the rod's own first frequency
   real(wp), parameter :: energy_share = 0.01_wp   !! of the energy of the rod's turning and vibration
   integer, parameter :: fewest_rows = 20          !! mean squares of fewer tell nothing
   real(wp), parameter :: pi = acos(-1.0_wp)

   !> What has been seen of a rod.
   type :: rod_record
      real(wp) :: own_frequency = 0.0_wp !! first, between its nodes; 0: does not vibrate by itself [rad/s]
      real(wp) :: mass_per_length = 0.0_wp, length = 0.0_wp !! [kg/m], [m]
      real(wp) :: deflection = 0.0_wp    !! largest |v|/l
      real(wp) :: t_deflection = 0.0_wp  !! when [s]
      real(wp) :: sum_alpha = 0.0_wp, sum_beta = 0.0_wp     !! [rad]
      real(wp) :: sum_bent = 0.0_wp      !! of alpha^2 + alpha beta + beta^2
      real(wp) :: sum_bent_rate = 0.0_wp !! the same of the rates [1/s^2]
      real(wp) :: sum_vibration = 0.0_wp, sum_turning = 0.0_wp !! of the squares of the speeds [m^2/s^2]
      real(wp) :: euler_load = 0.0_wp    !! pi^2 EI/l^2 [N]
      real(wp) :: tension = 0.0_wp       !! axial force where and when it was largest, along the rod, too [N]
      real(wp) :: t_tension = 0.0_wp     !! when [s]
   end type rod_record

   !> A run as it goes on.
   type :: validity_type
      real(wp) :: deflection_limit = 0.0_wp
      real(wp) :: axial_error_limit = 0.0_wp
      real(wp) :: axial_limit = 0.0_wp     !! of P, for the rods that there are
      real(wp) :: axial_limit_arc = 0.0_wp !! the same if their arcs were kept; zero if they are
      integer :: n_seen = 0 !! rows
      integer :: every = 1  !! from row to row of those whose axial forces are judged
      integer :: bubble = -1 !! the same as the next ones; -1: there is none
      integer :: alpha = 0, beta = 0, alpha_rate = 0, beta_rate = 0, phi_rate = 0, omega = 0 !! where they begin in a row, less one
      type(rod_record), allocatable :: rods(:) !! (n); none if rods do not bend
   contains
      procedure :: observe
      procedure :: observe_forces
      procedure :: judge_forces
      procedure :: warnings
   end type validity_type

contains

   !> Nothing seen yet of the rods of a scene.
   function new_validity(scene, layout, every, deflection_limit, axial_error_limit) result(self)
      type(scene_type), intent(in) :: scene
      type(row_layout), intent(in) :: layout    !! of the rows
      integer, intent(in) :: every              !! from row to row of those whose axial forces are judged, by a right-hand side
      real(wp), intent(in) :: deflection_limit  !! of v/l
      real(wp), intent(in) :: axial_error_limit !! of the bending
      type(validity_type) :: self
      integer :: k

      self%deflection_limit = deflection_limit
      self%axial_error_limit = axial_error_limit
      self%axial_limit = axial_limit(axial_error_limit, scene%inextensible, scene%n_bend)
      if (.not. scene%inextensible) self%axial_limit_arc = axial_limit(axial_error_limit, .true., scene%n_bend)
      self%every = every
      self%alpha = layout%before('alpha')
      self%beta = layout%before('beta')
      if (scene%n_bend == 3) self%bubble = layout%before('bubble')
      self%alpha_rate = layout%before('alpha_rate')
      self%beta_rate = layout%before('beta_rate')
      self%phi_rate = layout%before('phi_rate')
      self%omega = layout%before('omega')
      allocate (self%rods(merge(scene%n, 0, scene%dynamic_bending .or. scene%quasistatic)))
      do k = 1, size(self%rods)
         associate (rod => scene%rods(scene%rod_of(k)), seen => self%rods(k))
            seen%length = rod%length
            seen%mass_per_length = rod%inertia%m0/rod%length
            seen%euler_load = euler_load(rod)
            if (scene%dynamic_bending) seen%own_frequency = (pi/rod%length)**2*sqrt(rod%bending_stiffness/seen%mass_per_length)
         end associate
      end do
   end function new_validity

   !> From row to row of those whose forces are judged, so that they are `most` or one more.
   pure integer function interval_of_rows(n_rows, most)
      integer, intent(in) :: n_rows, most
      interval_of_rows = max(1, (n_rows + most - 2)/most)
   end function interval_of_rows

   !> Look at an output.
   pure subroutine observe(self, row)
      class(validity_type), intent(inout) :: self
      type(row_type), intent(in) :: row
      real(wp) :: deflection
      integer :: k

      self%n_seen = self%n_seen + 1
      do k = 1, size(self%rods)
         associate (seen => self%rods(k), a => row%values(self%alpha + k), b => row%values(self%beta + k), &
                    ar => row%values(self%alpha_rate + k), br => row%values(self%beta_rate + k), &
                    w => row%values(self%omega + 1) + row%values(self%phi_rate + k))
            if (self%bubble < 0) then
               deflection = greatest_deflection(a, b)
            else
               deflection = deflection_with_bubble(a, b, row%values(self%bubble + k)/seen%length)
            end if
            if (deflection > seen%deflection) then
               seen%deflection = deflection
               seen%t_deflection = row%time
            end if
            if (.not. seen%own_frequency > 0.0_wp) cycle
            seen%sum_alpha = seen%sum_alpha + a
            seen%sum_beta = seen%sum_beta + b
            seen%sum_bent = seen%sum_bent + (a**2 + a*b + b**2)
            seen%sum_bent_rate = seen%sum_bent_rate + (ar**2 + ar*br + br**2)
            ! int v'^2 ds and W^2 int s^2 ds about the middle, over l^3
            seen%sum_vibration = seen%sum_vibration + (ar**2 + br**2)/105.0_wp - ar*br/70.0_wp
            seen%sum_turning = seen%sum_turning + w**2/12.0_wp
         end associate
      end do
   end subroutine observe

   !> Look at the axial forces of an output, which has been observed; at some of the outputs only where there are many.
   subroutine observe_forces(self, motion, t, y)
      class(validity_type), intent(inout) :: self
      type(motion_type), intent(inout) :: motion
      real(wp), intent(in) :: t    !! [s], within the regime
      real(wp), intent(in) :: y(:) !! (n_states)
      real(wp) :: a(motion%n_dof)
      logical :: ok

      if (size(self%rods) == 0 .or. mod(self%n_seen - 1, self%every) /= 0) return
      associate (q => y(:motion%n_q), p => y(motion%n_q + 1:motion%n_q + motion%n_dof))
         call motion%dynamics%accelerations(t, q, p, a, ok)
         if (ok) call self%judge_forces(motion%dynamics, t, q, p, a)
      end associate
   end subroutine observe_forces

   !> Look at the axial forces of a state.
   pure subroutine judge_forces(self, dynamics, t, q, p, a)
      class(validity_type), intent(inout) :: self
      type(dynamics_type), intent(in) :: dynamics
      real(wp), intent(in) :: t                !! [s]
      real(wp), intent(in) :: q(:), p(:), a(:) !! coordinates, rates and accelerations
      real(wp) :: inner(2, size(self%rods)), outer(2, size(self%rods)), tension, w
      integer :: k

      if (size(self%rods) == 0) return
      call rod_forces(dynamics, q, p, a, inner, outer)
      do k = 1, size(self%rods)
         associate (seen => self%rods(k), scene => dynamics%scene)
            w = p(scene%phi_at() + k)
            if (scene%n_base > 0) w = w + p(3)
            tension = largest_tension(-inner(1, k), -outer(1, k), 0.5_wp*seen%mass_per_length*(seen%length*w)**2)
            if (.not. (abs(tension) > abs(seen%tension) .and. abs(tension) <= huge(tension))) cycle
            seen%tension = tension
            seen%t_tension = t
         end associate
      end do
   end subroutine judge_forces

   !> P at which axial force puts the bending of a rod off by an error: that of the stiffness where the chord is kept; where the
   !> arc is, what blades, columns and beams under thrust have shown.
   pure real(wp) function axial_limit(error, inextensible, n_shapes)
      real(wp), intent(in) :: error
      logical, intent(in) :: inextensible
      integer, intent(in) :: n_shapes

      if (.not. inextensible) then
         axial_limit = 12.0_wp/pi**2*error
      else if (n_shapes == 3) then
         axial_limit = (100.0_wp*error)**(1.0_wp/3.0_wp)
      else
         axial_limit = 2.5_wp*sqrt(error)
      end if
   end function axial_limit

   !> pi^2 EI/l^2 [N]. In its two slopes a rod whose ends are hinged buckles at the least eigenvalue of K x = N D(l) x, 12 EI/l^2 if
   !> it is uniform; one whose EI varies is given pi^2/12 of that. D(l)^-1 = (8, 2; 2, 8)/l.
   pure real(wp) function euler_load(rod)
      type(rod_constants), intent(in) :: rod
      real(wp) :: half_trace, determinant

      associate (k => rod%stiffness/rod%stiffness(1))
         half_trace = 4.0_wp*(k(1) + k(3)) + 2.0_wp*k(2)
         determinant = 60.0_wp*(k(1)*k(3) - k(2)**2)
      end associate
      euler_load = pi**2/12.0_wp*rod%stiffness(1)/rod%length* &
                   (determinant/(half_trace + sqrt(max(0.0_wp, half_trace**2 - determinant))))
   end function euler_load

   !> Largest |v|/l of a rod with end slopes alpha and beta, v/l = x (1 - x) (alpha (1 - x) - beta x).
   elemental real(wp) function greatest_deflection(alpha, beta)
      real(wp), intent(in) :: alpha, beta !! [rad]
      real(wp) :: a, b, c, root, scale

      ! dv/dx = alpha - 2 (2 alpha + beta) x + 3 (alpha + beta) x^2
      scale = max(abs(alpha), abs(beta), tiny(1.0_wp))
      a = 3.0_wp*(alpha + beta)/scale
      b = (2.0_wp*alpha + beta)/scale
      c = alpha/scale
      root = b + sign(sqrt(max(0.0_wp, b**2 - a*c)), b)
      greatest_deflection = 0.0_wp
      if (abs(a) > 1.0e-6_wp) greatest_deflection = at(root/a) ! else it lies far outside
      if (abs(root) > 0.0_wp) greatest_deflection = max(greatest_deflection, at(c/root))

   contains

      pure real(wp) function at(x)
         real(wp), intent(in) :: x
         at = 0.0_wp
         if (x > 0.0_wp .and. x < 1.0_wp) at = abs(x*(1.0_wp - x)*(alpha*(1.0_wp - x) - beta*x))
      end function at

   end function greatest_deflection

   !> The same with the third shape: the largest of 63 points, 0.1 % below the largest at most.
   pure real(wp) function deflection_with_bubble(alpha, beta, bubble) result(largest)
      real(wp), intent(in) :: alpha, beta !! [rad]
      real(wp), intent(in) :: bubble      !! over l
      real(wp) :: x
      integer :: i

      largest = 0.0_wp
      do i = 1, 63
         x = i/64.0_wp
         largest = max(largest, abs(x*(1.0_wp - x)*(alpha*(1.0_wp - x) - beta*x + 16.0_wp*x*(1.0_wp - x)*bubble)))
      end do
   end function deflection_with_bubble

   !> What a reader of the results should know, one line each, without a closing newline; empty if all is well.
   function warnings(self) result(text)
      class(validity_type), intent(in) :: self
      character(len=:), allocatable :: text
      integer :: k

      text = ''
      if (size(self%rods) == 0) return
      k = maxloc(self%rods%deflection, dim=1)
      if (self%rods(k)%deflection > self%deflection_limit) text = deflection_warning(self, k)
      k = maxloc(axial_share(self%rods), dim=1)
      if (axial_share(self%rods(k)) > self%axial_limit) text = joined(text, axial_warning(self, k), new_line('a'))
      k = maxloc(vibration(self%rods, self%n_seen), dim=1)
      if (.not. vibration(self%rods(k), self%n_seen) > frequency_share) return
      text = joined(text, vibration_warning(self, k), new_line('a'))
   end function warnings

   !> Bent too far: how far, where, when, and what it means.
   function deflection_warning(self, k) result(text)
      type(validity_type), intent(in) :: self
      integer, intent(in) :: k !! the rod
      character(len=:), allocatable :: text

      associate (rod => self%rods(k))
         text = 'rod '//to_text(k)//' bends by '//two_digits(rod%deflection)//' of its length (t = '// &
                time_text(rod%t_deflection)//' s); the model assumes small deflections: above '// &
                'deflection_limit = '//two_digits(self%deflection_limit)//' its '// &
                trim(merge('chord    ', 'curvature', self%axial_limit_arc > 0.0_wp))//' is more than '// &
                two_digits(100.0_wp*8.0_wp/3.0_wp*self%deflection_limit**2)//' % '// &
                trim(merge('too long ', 'too small', self%axial_limit_arc > 0.0_wp))
      end associate
      associate (others => count(self%rods%deflection > self%deflection_limit) - 1)
         if (others > 0) text = text//trim(merge(', as is ', ', as are', others == 1))//' '//more_rods(others)
      end associate
   end function deflection_warning

   !> Too much axial force: how much, where, when, and into how many rods to cut.
   function axial_warning(self, k) result(text)
      type(validity_type), intent(in) :: self
      integer, intent(in) :: k !! the rod
      character(len=:), allocatable :: text

      associate (rod => self%rods(k), share => axial_share(self%rods(k)))
         text = 'the axial force in rod '//to_text(k)//' is '//two_digits(share)//' of its Euler load pi^2 EI/l^2 ('// &
                two_digits(abs(rod%tension))//' N of '//trim(merge('tension    ', 'compression', rod%tension > 0.0_wp))// &
                ' at t = '//time_text(rod%t_tension)//' s); above '//two_digits(self%axial_limit)// &
                ' bending may be off by more than axial_error_limit = '//two_digits(self%axial_error_limit)// &
                ' of it; divide it into '//to_text(pieces(share, self%axial_limit))//' rods'//held
         if (self%axial_limit_arc > 0.0_wp) text = text//', or '//with_arcs(pieces(share, self%axial_limit_arc))
      end associate
      associate (others => count(axial_share(self%rods) > self%axial_limit) - 1)
         if (others > 0) text = text//'; and '//more_rods(others)//' likewise'
      end associate
   end function axial_warning

   !> What rods that keep their arc need instead.
   pure function with_arcs(n) result(text)
      integer, intent(in) :: n !! rods
      character(len=:), allocatable :: text
      text = "take formulation = 'inextensible' with dynamic bending"
      if (n > 1) text = text//', which needs '//to_text(n)
   end function with_arcs

   !> Rods to cut a rod into, so that P comes down to a limit: it falls with their square.
   pure integer function pieces(share, limit)
      real(wp), intent(in) :: share, limit
      pieces = ceiling(min(sqrt(share/limit), 1.0e9_wp))
   end function pieces

   !> P of a rod.
   elemental real(wp) function axial_share(rod)
      type(rod_record), intent(in) :: rod
      axial_share = min(abs(rod%tension)/rod%euler_load, huge(1.0_wp))
   end function axial_share

   !> Vibrates too fast for one cubic.
   function vibration_warning(self, k) result(text)
      type(validity_type), intent(in) :: self
      integer, intent(in) :: k !! the rod
      character(len=:), allocatable :: text

      text = 'rod '//to_text(k)//' vibrates at '//two_digits(vibration(self%rods(k), self%n_seen))// &
             ' times its own first frequency ('//two_digits(self%rods(k)%own_frequency)// &
             ' rad/s, which one rod overestimates by 11 %); divide it into two rods'//held
      associate (others => count(vibration(self%rods, self%n_seen) > frequency_share) - 1)
         if (others > 0) text = text//', and '//more_rods(others)//' likewise'
      end associate
   end function vibration_warning

   pure function more_rods(n) result(text)
      integer, intent(in) :: n
      character(len=:), allocatable :: text
      text = to_text(n)//' more rods'
      if (n == 1) text = 'one more rod'
   end function more_rods

   !> Frequency of the bending motion of a rod as a part of the rod's own; zero if it carries little energy.
   elemental real(wp) function vibration(rod, n)
      type(rod_record), intent(in) :: rod
      integer, intent(in) :: n !! rows seen
      real(wp) :: bent

      vibration = 0.0_wp
      if (n < fewest_rows .or. .not. rod%sum_vibration > energy_share*(rod%sum_vibration + rod%sum_turning)) return
      bent = rod%sum_bent - (rod%sum_alpha**2 + rod%sum_alpha*rod%sum_beta + rod%sum_beta**2)/real(n, wp)
      if (bent > 0.0_wp) vibration = sqrt(rod%sum_bent_rate/bent)/rod%own_frequency
   end function vibration

   !> Two digits.
   pure function two_digits(value) result(text)
      real(wp), intent(in) :: value
      character(len=:), allocatable :: text
      real(wp) :: unit
      text = '0'
      if (.not. value > 0.0_wp) return
      unit = 10.0_wp**(floor(log10(value)) - 1)
      text = time_text(unit*anint(value/unit))
   end function two_digits

end module rodyn_validity
