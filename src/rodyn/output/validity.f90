!> Whether a run stayed where its model holds, judged at the output times.
!>
!> Two things are left out for rods that bend (docs/model.md sec. 1):
!> - The chord keeps its length, although bending by v shortens it by int v'^2/2, a part
!>       (alpha^2/15 - alpha beta/30 + beta^2/15) = (8/3) (v_max/l)^2 for a rod bent to an arc (beta = -alpha)
!>   of l: 1 % where v_max = 0.06 l, which is the default of `deflection_limit`.
!> - The shape is one cubic. That is exact for moments at its ends. The first vibration of the rod between its nodes,
!>   pi^2 sqrt(EI/m l^4), comes out 11 % too fast, and the slopes of a rod whose ends are moved at half that frequency 1 %
!>   too small. So a rod had better be cut in two if it vibrates faster than that, with more than 1 % of the energy of its turning.
!>   How fast is told by the mean squares of its deflection, without the mean, and of its rate, both weighed by the bending energy.
module rodyn_validity
   use rodyn_kinds, only: wp
   use rodyn_quantities, only: row_layout, row_type
   use rodyn_scene, only: scene_type
   use rodyn_text, only: joined, time_text, to_text
   implicit none (type, external)
   private
   public :: validity_type, new_validity, greatest_deflection

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
   end type rod_record

   !> A run as it goes on.
   type :: validity_type
      real(wp) :: deflection_limit = 0.0_wp
      integer :: n_seen = 0 !! rows
      integer :: alpha = 0, beta = 0, alpha_rate = 0, beta_rate = 0, phi_rate = 0, omega = 0 !! where they begin in a row, less one
      type(rod_record), allocatable :: rods(:) !! (n); none if rods do not bend
   contains
      procedure :: observe
      procedure :: warnings
   end type validity_type

contains

   !> Nothing seen yet of the rods of a scene.
   function new_validity(scene, layout, deflection_limit) result(self)
      type(scene_type), intent(in) :: scene
      type(row_layout), intent(in) :: layout   !! of the rows
      real(wp), intent(in) :: deflection_limit !! of v/l
      type(validity_type) :: self
      integer :: k

      self%deflection_limit = deflection_limit
      self%alpha = layout%before('alpha')
      self%beta = layout%before('beta')
      self%alpha_rate = layout%before('alpha_rate')
      self%beta_rate = layout%before('beta_rate')
      self%phi_rate = layout%before('phi_rate')
      self%omega = layout%before('omega')
      allocate (self%rods(merge(scene%n, 0, scene%dynamic_bending .or. scene%quasistatic)))
      do k = 1, size(self%rods)
         associate (rod => scene%rods(scene%rod_of(k)), seen => self%rods(k))
            seen%length = rod%length
            seen%mass_per_length = rod%inertia%m0/rod%length
            if (scene%dynamic_bending) seen%own_frequency = (pi/rod%length)**2*sqrt(rod%bending_stiffness/seen%mass_per_length)
         end associate
      end do
   end function new_validity

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
            deflection = greatest_deflection(a, b)
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

   !> What a reader of the results should know, one line each, without a closing newline; empty if all is well.
   function warnings(self) result(text)
      class(validity_type), intent(in) :: self
      character(len=:), allocatable :: text
      integer :: k

      text = ''
      if (size(self%rods) == 0) return
      k = maxloc(self%rods%deflection, dim=1)
      if (self%rods(k)%deflection > self%deflection_limit) text = deflection_warning(self, k)
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
                'deflection_limit = '//two_digits(self%deflection_limit)//' its chord is more than '// &
                two_digits(100.0_wp*8.0_wp/3.0_wp*self%deflection_limit**2)//' % too long'
      end associate
      associate (others => count(self%rods%deflection > self%deflection_limit) - 1)
         if (others > 0) text = text//trim(merge(', as is ', ', as are', others == 1))//' '//more_rods(others)
      end associate
   end function deflection_warning

   !> Vibrates too fast for one cubic.
   function vibration_warning(self, k) result(text)
      type(validity_type), intent(in) :: self
      integer, intent(in) :: k !! the rod
      character(len=:), allocatable :: text

      text = 'rod '//to_text(k)//' vibrates at '//two_digits(vibration(self%rods(k), self%n_seen))// &
             ' times its own first frequency ('//two_digits(self%rods(k)%own_frequency)// &
             ' rad/s, which one rod overestimates by 11 %); divide it into two rods'
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
