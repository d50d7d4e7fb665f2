!> What a third bending shape buys: natural frequencies of a clamped-free uniform beam cut into N rods with locked hinges,
!> against the closed form cos x cosh x = -1, and the fastest frequency that it brings. Nothing is timed.
!>
!>     tools/bench bending_shapes
program bench_bending_shapes
   use rodyn_kinds, only: wp
   use rodyn_errors, only: error_type
   use rodyn_case_config, only: case_config
   use rodyn_scene, only: scene_type, new_scene
   use rodyn_accelerations, only: dynamics_type, new_dynamics
   use rodyn_frequencies, only: natural_frequencies
   implicit none (type, external)

   !> Roots of cos x cosh x = -1; frequencies are their squares for a beam of length, mass and stiffness 1.
   real(wp), parameter :: roots(5) = [1.8751040687119612_wp, 4.694091132974175_wp, 7.854757438237613_wp, &
                                      10.995540734875467_wp, 14.13716839104647_wp]
   integer, parameter :: pieces(*) = [1, 2, 4, 8, 16]
   real(wp), allocatable :: frequency(:)
   integer :: i, mode, shapes

   write (*, '(a)') '| rods | shapes | unknowns | mode 1 | mode 2 | mode 3 | mode 4 | mode 5 | fastest, rad/s |', &
      '|---:|---:|---:|---:|---:|---:|---:|---:|---:|'
   do i = 1, size(pieces)
      do shapes = 2, 3
         call find_frequencies(pieces(i), shapes, frequency)
         write (*, '("| ", i0, " | ", i0, " | ", i0, " |")', advance='no') pieces(i), shapes, size(frequency)
         do mode = 1, size(roots)
            if (mode > size(frequency)) then
               write (*, '(a)', advance='no') ' |'
            else
               write (*, '(es9.1, " |")', advance='no') frequency(mode)/roots(mode)**2 - 1.0_wp
            end if
         end do
         write (*, '(f10.1, " |")') maxval(frequency)
      end do
   end do

contains

   !> Of a beam cut into n rods.
   subroutine find_frequencies(n, shapes, frequency)
      integer, intent(in) :: n, shapes
      real(wp), allocatable, intent(out) :: frequency(:)
      type(case_config) :: c
      type(scene_type) :: scene
      type(dynamics_type) :: dynamics
      type(error_type), allocatable :: error

      c%title = ''
      c%spacecraft%motion = 'fixed'
      c%model%formulation = 'consistent'
      c%model%bending_shapes = shapes
      c%model%gauss_points = 5
      c%chain%n_rods = n
      allocate (c%chain%length(n), source=1.0_wp/n)
      allocate (c%chain%mass_per_length(n), c%chain%bending_stiffness(n), source=1.0_wp)
      allocate (c%chain%node_mass(n), c%chain%hinge_stiffness(0:n - 1), c%chain%hinge_damping(0:n - 1), c%chain%kink(0:n - 1), &
                source=0.0_wp)
      allocate (c%loads(0))
      call new_scene(scene, c, error)
      if (.not. allocated(error)) call new_dynamics(dynamics, scene, error)
      if (allocated(error)) error stop error%message
      call dynamics%set_locked(spread(.true., 1, n), spread(0.0_wp, 1, n))
      call natural_frequencies(dynamics%scene, dynamics%hinges, spread(0.0_wp, 1, scene%n_dof), frequency, error)
      if (allocated(error)) error stop error%message
   end subroutine find_frequencies

end program bench_bending_shapes
