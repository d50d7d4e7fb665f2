!> What benchmarks have in common: the article's chain at any length, times of calls, medians of rounds.
module rodyn_bench_support
   use rodyn_kinds, only: wp, i8
   use rodyn_case_config, only: case_config
   implicit none (type, external)
   private
   public :: table1_chain, set_in_motion, median, stopwatch

   !> Wall time since `start`.
   type :: stopwatch
      private
      integer(i8) :: started = 0
   contains
      procedure :: start
      procedure :: seconds
   end type stopwatch

contains

   !> The article's table-1 scene with n rods, at rest and without loads.
   subroutine table1_chain(c, n)
      type(case_config), intent(out) :: c
      integer, intent(in) :: n

      c%title = ''
      c%model%formulation = 'consistent'
      c%spacecraft%mass = 122.5_wp
      c%spacecraft%inertia = 122.5_wp*0.98_wp/12.0_wp
      c%spacecraft%hinge_x = 0.35_wp
      c%spacecraft%hinge_y = 0.35_wp
      c%chain%n_rods = n
      allocate (c%chain%length(n), source=1.5_wp)
      allocate (c%chain%mass_per_length(n), source=1.6964600329384882_wp)
      allocate (c%chain%bending_stiffness(n), source=13744.467859455345_wp)
      allocate (c%chain%node_mass(n), source=0.5_wp)
      allocate (c%chain%hinge_stiffness(0:n - 1), source=4000.0_wp)
      allocate (c%chain%hinge_damping(0:n - 1), source=0.01_wp)
      allocate (c%chain%kink(0:n - 1), source=0.0_wp)
      allocate (c%initial%phi(n), c%initial%phi_rate(n), c%initial%alpha(n), c%initial%beta(n), c%initial%alpha_rate(n), &
                c%initial%beta_rate(n), source=0.0_wp)
      allocate (c%loads(0))
   end subroutine table1_chain

   !> Turn all hinges and the spacecraft, so that no term of the equations vanishes.
   subroutine set_in_motion(c)
      type(case_config), intent(inout) :: c
      integer :: k
      c%initial%phi = [(0.1_wp*sin(0.7_wp*k), k=1, c%chain%n_rods)]
      c%initial%phi_rate = [(0.1_wp*cos(0.7_wp*k), k=1, c%chain%n_rods)]
      c%initial%omega = 0.3_wp
   end subroutine set_in_motion

   subroutine start(self)
      class(stopwatch), intent(out) :: self
      call system_clock(self%started)
   end subroutine start

   !> Since the start [s].
   real(wp) function seconds(self)
      class(stopwatch), intent(in) :: self
      integer(i8) :: now, rate
      call system_clock(now, rate)
      seconds = real(now - self%started, wp)/real(rate, wp)
   end function seconds

   pure real(wp) function median(x)
      real(wp), intent(in) :: x(:)
      real(wp) :: sorted(size(x)), swap
      integer :: a, b
      sorted = x
      do a = 2, size(x)
         do b = a, 2, -1
            if (sorted(b) >= sorted(b - 1)) exit
            swap = sorted(b)
            sorted(b) = sorted(b - 1)
            sorted(b - 1) = swap
         end do
      end do
      median = sorted((size(x) + 1)/2)
   end function median

end module rodyn_bench_support
