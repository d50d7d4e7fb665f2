!> A run: Gragg's extrapolated midpoint rule, events by interpolation and bisection of real steps, and what hinges do at them.
module chain_motion
   use scene_data, only: dp, scene_type, none
   use joint_laws, only: joint_law, new_joint_law, kind_released, kind_latched, part_latch
   use body_equations, only: chain_type, new_chain, rates, put_back, strike, joints_of, energies, find_statics, balance, drift
   implicit none (type, external)
   private
   public :: run_type, run

   integer, parameter :: samples = 8        !! of a step, where events are looked for
   real(dp), parameter :: least = 1.0e-14_dp !! of the run: shorter steps are none

   type :: run_type
      type(chain_type) :: chain
      real(dp), allocatable :: y(:)
      real(dp), allocatable :: from(:) !! angles of the joints before the last change, from 0
      real(dp) :: t = 0.0_dp, step = 0.0_dp, largest_drift = 0.0_dp
      integer :: columns = 7, steps = 0, n_events = 0
      logical :: watches = .false.
      character(len=40) :: trouble = ''
      integer :: jumps = 0 !! latches that a joint has jumped over
   end type run_type

contains

   !> Run a scene; rows and events go to standard output.
   subroutine run(s)
      type(scene_type), intent(in) :: s
      type(run_type) :: r
      type(joint_law), allocatable :: joint(:)
      real(dp) :: next, row
      integer :: k, i, output

      allocate (joint(0:s%n - 1))
      do k = 0, s%n - 1
         joint(k) = new_joint_law(s, k)
      end do
      call new_chain(r%chain, s, joint)
      r%watches = any(joint%present)
      r%columns = merge(4, 7, r%watches)
      call start(r)
      call begin_laws(r)
      call write_row(r)
      output = 1
      do i = 1, size(s%switches) - 1
         r%chain%middle = 0.5_dp*(s%switches(i) + s%switches(i + 1))
         if (i > 1) call switch_over(r)
         next = s%switches(i + 1)
         do while (output <= s%n_outputs)
            row = s%t_end*output/s%n_outputs
            if (output == s%n_outputs) row = s%t_end
            if (row > next*(1.0_dp + 1.0e-12_dp)) exit
            call advance(r, min(row, next))
            if (r%trouble /= '') exit
            call write_row(r)
            output = output + 1
         end do
         if (r%trouble == '') call advance(r, next)
         if (r%trouble /= '') exit
      end do
      write (*, '(a, 2i12, es12.3, i6, 1x, a)') 'end', r%steps, r%chain%evaluations, r%largest_drift, r%jumps, trim(r%trouble)
   end subroutine run

   !> Inertial coordinates from those of the namelist.
   subroutine start(r)
      type(run_type), intent(inout) :: r
      real(dp) :: c, sn, tip(2), tip_rate(2), turn(2), psi(2), arm(2)
      integer :: k, b, nx

      associate (s => r%chain%s)
         nx = r%chain%nx
         allocate (r%y(2*nx + size(r%chain%relaxing) + 2), source=0.0_dp)
         turn = [s%base(3), s%base_rate(3)]
         c = cos(turn(1))
         sn = sin(turn(1))
         tip = [c*s%base(1) - sn*s%base(2), sn*s%base(1) + c*s%base(2)]
         tip_rate = [c*s%base_rate(1) - sn*s%base_rate(2), sn*s%base_rate(1) + c*s%base_rate(2)]
         if (s%free) then
            r%y(1:3) = [tip, turn(1)]
            r%y(nx + 1:nx + 3) = [tip_rate, turn(2)]
         end if
         arm = [c*s%hinge(1) - sn*s%hinge(2), sn*s%hinge(1) + c*s%hinge(2)]
         tip = tip + arm
         tip_rate = tip_rate + turn(2)*[-arm(2), arm(1)]
         do k = 1, s%n
            b = r%chain%first + (k - 1)*r%chain%size
            psi = turn + [s%start(1, k), s%start_rate(1, k)]
            r%y(b + 1:b + 3) = [tip, psi(1)]
            r%y(nx + b + 1:nx + b + 3) = [tip_rate, psi(2)]
            r%y(b + 4:b + 3 + s%shapes) = s%start(2:1 + s%shapes, k)
            r%y(nx + b + 4:nx + b + 3 + s%shapes) = s%start_rate(2:1 + s%shapes, k)
            arm = s%length(k)*[cos(psi(1)), sin(psi(1))]
            tip = tip + arm
            tip_rate = tip_rate + psi(2)*[-arm(2), arm(1)]
         end do
         r%chain%middle = 0.5_dp*(s%switches(1) + s%switches(2))
      end associate
   end subroutine start

   !> Joint rotations and rates now.
   subroutine joints_now(r, t, y, th, rate)
      type(run_type), intent(inout) :: r
      real(dp), intent(in) :: t, y(:)
      real(dp), intent(out) :: th(0:), rate(0:)
      real(dp), dimension(0:r%chain%s%n - 1) :: moment, bends
      associate (nx => r%chain%nx)
         call joints_of(r%chain, t, y(:nx), y(nx + 1:2*nx), y(2*nx + 1:2*nx + size(r%chain%relaxing)), th, rate, moment, bends)
      end associate
   end subroutine joints_now

   !> Locks and branches at the start. With statics the joints are balanced, the branches follow, until both agree; held rods are
   !> unbent.
   subroutine begin_laws(r)
      type(run_type), intent(inout) :: r
      real(dp), dimension(0:r%chain%s%n - 1) :: th, rate, open
      logical :: changed, here, statics
      integer :: k, pass

      statics = r%chain%s%statics
      r%chain%s%statics = .false. ! the opening itself
      call joints_now(r, 0.0_dp, r%y, open, rate)
      r%chain%s%statics = statics
      associate (joint => r%chain%joint)
         do k = 0, r%chain%s%n - 1
            if (.not. joint(k)%present) cycle
            here = joint(k)%choose(open(k), rate(k))
            if (joint(k)%held .and. joint(k)%release_time > 0.0_dp) then
               joint(k)%locked = .true.
               joint(k)%lock_angle = open(k)
            else
               joint(k)%held = .false.
            end if
         end do
         th = open
         if (statics) then
            do pass = 1, 100
               call balance(r%chain, 0.0_dp, r%y(:r%chain%nx), r%y(r%chain%nx + 1:), th)
               changed = .false.
               do k = 0, r%chain%s%n - 1
                  here = joint(k)%choose(th(k), 0.0_dp)
                  changed = changed .or. here
               end do
               if (.not. changed) exit
            end do
            if (changed) r%trouble = 'no balance at the start'
            r%y(2*r%chain%nx + 1:2*r%chain%nx + size(r%chain%relaxing)) = th(r%chain%relaxing)
            call joints_now(r, 0.0_dp, r%y, th, rate)
            do k = 0, r%chain%s%n - 1
               here = joint(k)%choose(th(k), rate(k))
            end do
            call find_statics(r%chain)
         end if
         do k = 0, r%chain%s%n - 1
            if (joint(k)%present .and. joint(k)%latch < none) joint(k)%latch_side = merge(1, -1, joint(k)%latch > th(k))
         end do
      end associate
   end subroutine begin_laws

   subroutine event(r, hinge, kind)
      type(run_type), intent(inout) :: r
      integer, intent(in) :: hinge, kind
      r%n_events = r%n_events + 1
      write (*, '(a, es25.16e3, 2i5)') 'event', r%t, hinge, kind
      if (r%n_events > 100000) r%trouble = 'too many events'
   end subroutine event

   !> A time where something is switched: release what is due, and let the branches follow.
   subroutine switch_over(r)
      type(run_type), intent(inout) :: r
      real(dp) :: before, worked
      integer :: k

      worked = 0.0_dp
      call note(r, before)
      do k = 0, r%chain%s%n - 1
         associate (j => r%chain%joint(k))
            if (j%held .and. j%locked .and. j%release_time <= r%t*(1.0_dp + 1.0e-12_dp)) call release(r, k)
         end associate
      end do
      call settle(r, worked)
      call book(r, before, worked)
   end subroutine switch_over

   subroutine release(r, k)
      type(run_type), intent(inout) :: r
      integer, intent(in) :: k
      r%chain%joint(k)%locked = .false.
      r%chain%joint(k)%held = .false.
      call event(r, k, kind_released)
   end subroutine release

   !> What there is before a change.
   subroutine note(r, energy)
      type(run_type), intent(inout) :: r
      real(dp), intent(out) :: energy
      real(dp), dimension(0:r%chain%s%n - 1) :: th, rate
      energy = total(r)
      call joints_now(r, r%t, r%y, th, rate)
      r%from = th
   end subroutine note

   real(dp) function total(r)
      type(run_type), intent(inout) :: r
      real(dp) :: kinetic, elastic
      call find_statics(r%chain)
      call energies(r%chain, r%t, r%y, kinetic, elastic)
      total = kinetic + elastic
   end function total

   !> What an event costs is dissipated.
   subroutine book(r, before, worked)
      type(run_type), intent(inout) :: r
      real(dp), intent(in) :: before, worked
      integer :: n
      n = size(r%y)
      r%y(n - 1) = r%y(n - 1) + worked
      r%y(n) = r%y(n) + before + worked - total(r)
   end subroutine book

   !> Take other branches until all margins are positive.
   subroutine settle(r, worked)
      type(run_type), intent(inout) :: r
      real(dp), intent(inout) :: worked
      real(dp), dimension(0:r%chain%s%n - 1) :: th, rate
      integer :: k, part, pass, i
      logical :: changed

      do pass = 1, 50
         changed = .false.
         call find_statics(r%chain)
         call joints_now(r, r%t, r%y, th, rate)
         do k = 0, r%chain%s%n - 1
            do i = 0, 4
               part = 1 + i
               if (latch_is_first(r%chain%joint(k), r%from(k), th(k))) part = 1 + mod(i + part_latch - 1, 5)
               if (r%chain%joint(k)%margin(part, r%t, th(k), rate(k)) >= 0.0_dp) cycle
               changed = .true.
               call change(r, k, part, th(k), rate(k), worked)
               call find_statics(r%chain)
               call joints_now(r, r%t, r%y, th, rate)
            end do
         end do
         if (.not. changed) return
      end do
      r%trouble = 'branches follow each other'
   end subroutine settle

   !> Whether a joint that jumps meets its latch before it meets a stop.
   pure logical function latch_is_first(joint, from, th)
      type(joint_law), intent(in) :: joint
      real(dp), intent(in) :: from, th
      real(dp) :: face
      face = merge(joint%stop(1), joint%stop(2), th < from)
      latch_is_first = (joint%latch - from)*(joint%latch - th) < 0.0_dp .and. &
                       (face >= none .or. abs(joint%latch - from) < abs(face - from))
   end function latch_is_first

   subroutine change(r, k, part, th, rate, worked)
      type(run_type), intent(inout) :: r
      integer, intent(in) :: k, part
      real(dp), intent(in) :: th, rate
      real(dp), intent(inout) :: worked
      real(dp) :: lost, more
      integer :: kind, i, nx

      associate (j => r%chain%joint(k))
         if (part /= part_latch) then
            call j%switch(part, r%t, th, rate, kind, lost)
            call event(r, k, kind)
            return
         end if
         j%latch_side = 0
         j%locked = .true.
         j%held = .false.
         j%lock_angle = th
         if (abs(th - j%latch) > 1.0e-8_dp) then ! a joint that jumps meets its latch on the way
            r%jumps = r%jumps + 1
            j%lock_angle = j%latch
         end if
         if (j%rigid() .and. .not. r%chain%s%statics) then
            nx = r%chain%nx
            call strike(r%chain, r%t, r%y(:nx), r%y(nx + 1:2*nx), lost, more)
            worked = worked + more
         end if
      end associate
      call event(r, k, kind_latched)
      do i = 0, r%chain%s%n - 1
         if (r%chain%joint(i)%held .and. r%chain%joint(i)%locked .and. r%chain%joint(i)%release_after == k) call release(r, i)
      end do
   end subroutine change

   !> The least margin at a state.
   real(dp) function least_margin(r, t, y)
      type(run_type), intent(inout) :: r
      real(dp), intent(in) :: t, y(:)
      real(dp), dimension(0:r%chain%s%n - 1) :: th, rate
      integer :: k, part
      call joints_now(r, t, y, th, rate)
      least_margin = 1.0_dp
      do k = 0, r%chain%s%n - 1
         do part = 1, 5
            least_margin = min(least_margin, r%chain%joint(k)%margin(part, t, th(k), rate(k)))
         end do
      end do
   end function least_margin

   !> Go on to a time; events on the way.
   subroutine advance(r, t_next)
      type(run_type), intent(inout) :: r
      real(dp), intent(in) :: t_next
      real(dp), allocatable :: y0(:), dy0(:), y1(:), dy1(:)
      real(dp) :: h, error, now, span
      logical :: last, found

      allocate (y0, dy0, y1, dy1, mold=r%y)
      span = r%chain%s%t_end
      if (r%step <= 0.0_dp) r%step = 1.0e-4_dp*span
      do while (t_next - r%t > least*span)
         call cpu_time(now)
         if (now > r%chain%s%seconds) r%trouble = 'time is up'
         if (r%step < least*span) r%trouble = 'no step is small enough'
         if (r%trouble /= '') return
         last = r%step >= t_next - r%t
         h = min(r%step, t_next - r%t)
         y0 = r%y
         call rates(r%chain, r%t, y0, dy0)
         call midpoint_step(r, r%t, h, y0, dy0, y1, error)
         if (.not. error <= 1.0_dp) then
            if (error > 1.0_dp) r%step = h*max(0.2_dp, 0.9_dp*error**(-1.0_dp/(2*r%columns - 1)))
            if (.not. error > 1.0_dp) r%step = 0.2_dp*h
            cycle
         end if
         found = .false.
         if (r%watches) then
            call rates(r%chain, r%t + h, y1, dy1)
            call look(r, h, y0, dy0, y1, dy1, found)
         end if
         if (found) cycle
         r%steps = r%steps + 1
         r%t = merge(t_next, r%t + h, last)
         r%y = y1
         associate (nx => r%chain%nx)
            r%largest_drift = max(r%largest_drift, drift(r%chain, r%y(:nx)))
            call put_back(r%chain, r%t, r%y(:nx), r%y(nx + 1:2*nx))
         end associate
         h = h*min(4.0_dp, 0.9_dp*max(error, 1.0e-30_dp)**(-1.0_dp/(2*r%columns - 1)))
         if (last) h = max(h, r%step)
         r%step = h
      end do
      r%t = t_next
   end subroutine advance

   !> Is there an event within a step? Then find it, go there, and let the hinges change.
   subroutine look(r, h, y0, dy0, y1, dy1, found)
      type(run_type), intent(inout) :: r
      real(dp), intent(in) :: h, y0(:), dy0(:), y1(:), dy1(:)
      logical, intent(out) :: found
      real(dp) :: m(0:samples), s(0:samples), vertex, low, high, between
      real(dp), allocatable :: y(:)
      integer :: i

      found = .false.
      allocate (y, mold=y0)
      low = 0.0_dp
      do i = 0, samples
         s(i) = real(i, dp)/samples
         m(i) = least_margin(r, r%t + s(i)*h, between_ends(r, s(i), h, y0, dy0, y1, dy1))
      end do
      do i = 1, samples
         high = s(i)
         between = m(i)
         if (between >= 0.0_dp .and. i < samples) then
            if (m(i) < m(i - 1) .and. m(i) < m(i + 1)) then ! a least value: may it be negative nearby?
               vertex = s(i) + 0.5_dp/samples*(m(i - 1) - m(i + 1))/(m(i - 1) - 2.0_dp*m(i) + m(i + 1))
               between = least_margin(r, r%t + vertex*h, between_ends(r, vertex, h, y0, dy0, y1, dy1))
               if (between < 0.0_dp) high = vertex
            end if
         end if
         if (between < 0.0_dp) then
            call go_to(r, low, high, h, y0, dy0, found)
            if (found) return
         end if
         low = s(i)
      end do
   end subroutine look

   !> State inside a step: quintic for positions, its derivative for velocities, cubic for the rest.
   function between_ends(r, s, h, y0, dy0, y1, dy1) result(y)
      type(run_type), intent(in) :: r
      real(dp), intent(in) :: s, h, y0(:), dy0(:), y1(:), dy1(:)
      real(dp) :: y(size(y0))
      real(dp), dimension(r%chain%nx) :: a, b, c, third, fourth, fifth
      integer :: nx

      nx = r%chain%nx
      if (s >= 1.0_dp) then
         y = y1
         return
      end if
      y = y0 + s*(y1 - y0) + s*(1.0_dp - s)*((1.0_dp - s)*(h*dy0 - (y1 - y0)) - s*(h*dy1 - (y1 - y0)))
      associate (x0 => y0(:nx), v0 => h*y0(nx + 1:2*nx), a0 => h**2*dy0(nx + 1:2*nx), &
                 x1 => y1(:nx), v1 => h*y1(nx + 1:2*nx), a1 => h**2*dy1(nx + 1:2*nx))
         a = x1 - x0 - v0 - 0.5_dp*a0
         b = v1 - v0 - a0
         c = a1 - a0
         third = 10.0_dp*a - 4.0_dp*b + 0.5_dp*c
         fourth = -15.0_dp*a + 7.0_dp*b - c
         fifth = 6.0_dp*a - 3.0_dp*b + 0.5_dp*c
         y(:nx) = x0 + s*(v0 + s*(0.5_dp*a0 + s*(third + s*(fourth + s*fifth))))
         y(nx + 1:2*nx) = (v0 + s*(a0 + s*(3.0_dp*third + s*(4.0_dp*fourth + s*5.0_dp*fifth))))/h
      end associate
   end function between_ends

   !> The first negative margin between two parts of a step, by real steps from its beginning; there all changes that is due.
   subroutine go_to(r, s_low, s_high, h, y0, dy0, found)
      type(run_type), intent(inout) :: r
      real(dp), intent(in) :: s_low, s_high, h, y0(:), dy0(:)
      logical, intent(out) :: found
      real(dp) :: low, high, m_low, m_high, s, m, error, worked, before, t0
      real(dp), allocatable :: y(:), at_high(:)
      integer :: i, side

      allocate (y, at_high, mold=y0)
      found = .false.
      call midpoint_step(r, r%t, s_high*h, y0, dy0, at_high, error)
      high = s_high
      m_high = least_margin(r, r%t + high*h, at_high)
      if (m_high >= 0.0_dp) return
      found = .true.
      low = s_low
      m_low = least_margin(r, r%t, y0)
      if (low > 0.0_dp) then
         call midpoint_step(r, r%t, low*h, y0, dy0, y, error)
         m_low = least_margin(r, r%t + low*h, y)
         if (m_low < 0.0_dp) then ! the interpolation saw it too late
            high = low
            m_high = m_low
            at_high = y
            low = 0.0_dp
            m_low = least_margin(r, r%t, y0)
         end if
      end if
      side = 0
      do i = 1, 100
         if ((high - low)*h < 1.0e-15_dp*max(r%t, h) .or. m_high > -1.0e-15_dp) exit
         s = high - (high - low)*m_high/(m_high - m_low) ! false position, every third a bisection
         if (mod(i, 3) == 0 .or. .not. m_low > 0.0_dp) s = 0.5_dp*(low + high)
         s = min(max(s, low + 1.0e-3_dp*(high - low)), high)
         call midpoint_step(r, r%t, s*h, y0, dy0, y, error)
         m = least_margin(r, r%t + s*h, y)
         if (m < 0.0_dp) then
            high = s
            m_high = m
            at_high = y
            if (side == -1) m_low = 0.5_dp*m_low
            side = -1
         else
            low = s
            m_low = m
            if (side == 1) m_high = 0.5_dp*m_high
            side = 1
         end if
      end do
      t0 = r%t
      r%t = r%t + high*h
      r%y = at_high
      call note(r, before)
      worked = 0.0_dp
      call settle(r, worked)
      call book(r, before, worked)
      r%step = max(0.2_dp*h, 1.0e-9_dp*r%chain%s%t_end)
   end subroutine go_to

   !> One step with a table of `columns`, numbers of substeps 2, 4, 6, ...; the error is that of the last but one column, 1: as
   !> much as asked.
   subroutine midpoint_step(r, t, h, y0, dy0, y1, error)
      type(run_type), intent(inout) :: r
      real(dp), intent(in) :: t, h, y0(:), dy0(:)
      real(dp), intent(out) :: y1(:), error
      real(dp) :: table(size(y0), r%columns), a(size(y0)), b(size(y0)), dy(size(y0)), sub, ratio, size_of(size(y0))
      integer :: j, i, k, n

      do j = 1, r%columns
         n = 2*j
         sub = h/n
         a = y0
         b = y0 + sub*dy0
         do i = 1, n - 1
            call rates(r%chain, t + i*sub, b, dy)
            a = a + 2.0_dp*sub*dy
            dy = a
            a = b
            b = dy
         end do
         table(:, j) = b
         do k = j - 1, 1, -1 ! Neville's scheme in (1/n)^2; the best of each row ends in column 1
            ratio = (real(j, dp)/k)**2
            table(:, k) = table(:, k + 1) + (table(:, k + 1) - table(:, k))/(ratio - 1.0_dp)
         end do
      end do
      y1 = table(:, 1)
      n = size(y0)
      size_of = max(abs(y0), abs(y1), 0.1_dp)
      error = maxval(abs(table(:, 1) - table(:, 2))/size_of)/r%chain%s%tolerance
   end subroutine midpoint_step

   !> time, phi, phi', alpha, beta, u, theta, V, w, kinetic, elastic, dissipated energy, work.
   subroutine write_row(r)
      type(run_type), intent(inout) :: r
      real(dp), allocatable :: phi(:, :)
      real(dp) :: kinetic, elastic, base(3), base_rate(3), c, s
      integer :: k, b, nx

      nx = r%chain%nx
      allocate (phi(4, r%chain%s%n), source=0.0_dp)
      base = 0.0_dp
      base_rate = 0.0_dp
      if (r%chain%s%free) then
         base = r%y(1:3)
         base_rate = r%y(nx + 1:nx + 3)
         c = cos(base(3))
         s = sin(base(3))
         base(1:2) = [c*base(1) + s*base(2), c*base(2) - s*base(1)]
         base_rate(1:2) = [c*base_rate(1) + s*base_rate(2), c*base_rate(2) - s*base_rate(1)]
      end if
      do k = 1, r%chain%s%n
         b = r%chain%first + (k - 1)*r%chain%size
         phi(1, k) = r%y(b + 3) - base(3)
         phi(2, k) = r%y(nx + b + 3) - base_rate(3)
         if (r%chain%s%shapes > 0) phi(3:4, k) = r%y(b + 4:b + 5)
      end do
      call energies(r%chain, r%t, r%y, kinetic, elastic)
      write (*, '(a, *(1x, es25.16e3))') 'row', r%t, phi(1, :), phi(2, :), phi(3, :), phi(4, :), base, base_rate, kinetic, &
         elastic, r%y(size(r%y)), r%y(size(r%y) - 1)
   end subroutine write_row

end module chain_motion
