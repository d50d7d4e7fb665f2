!> From axes to cases: which values case number i has, and which cases are the same.
!>
!> Nothing is stored per case, so that a million of them cost nothing. Cases count from 1.
module rodyn_sweep_plan
   use rodyn_kinds, only: i8, wp
   use rodyn_build_info, only: compiler, compiler_options, git_commit, program_version
   use rodyn_case_config, only: case_config
   use rodyn_case_reader, only: resolved_case
   use rodyn_errors, only: error_type, raise, exit_bad_input
   use rodyn_sorting, only: sorted_order
   use rodyn_sweep_config, only: sweep_axis, sweep_config, axis_size, value_text
   use rodyn_text, only: to_text, with_line_ends
   use rodyn_text_buffer, only: text_buffer
   implicit none (type, external)
   private
   public :: sweep_plan, new_plan, plan_text, fewest_alike

   !> Axes that advance together
   type :: plan_dimension
      integer :: length = 0
      integer, allocatable :: first_equal(:) !! the first row with the same values (length)
   end type plan_dimension

   !> All cases
   type :: sweep_plan
      integer :: n_cases = 0
      type(plan_dimension), allocatable :: dimensions(:)
   contains
      procedure :: rows
      procedure :: same_as
   end type sweep_plan

   integer(i8), parameter :: most_cases = 100000000_i8
   character(len=*), parameter :: nl = new_line('a')

contains

   !> The cases of a sweep.
   subroutine new_plan(plan, sweep, error)
      type(sweep_plan), intent(out) :: plan
      type(sweep_config), intent(in) :: sweep
      type(error_type), allocatable, intent(out) :: error
      integer(i8) :: n
      integer :: d

      allocate (plan%dimensions(sweep%n_dimensions))
      n = 1_i8
      do d = 1, sweep%n_dimensions
         call new_dimension(plan%dimensions(d), sweep%axes, d)
         n = n*plan%dimensions(d)%length
         if (n > most_cases) then
            call raise(error, sweep%name//': more than '//to_text(int(most_cases))//' cases', exit_bad_input)
            return
         end if
      end do
      plan%n_cases = int(n)
   end subroutine new_plan

   !> Length and equal rows of one dimension.
   subroutine new_dimension(dimension, axes, d)
      type(plan_dimension), intent(inout) :: dimension
      type(sweep_axis), intent(in) :: axes(:)
      integer, intent(in) :: d
      integer, allocatable :: order(:)
      real(wp), allocatable :: key(:, :) !! values of the axes (axes, length)
      integer :: a, i

      dimension%length = axis_size(axes(findloc(axes%dimension, d, dim=1)))
      allocate (key(size(axes), dimension%length), source=0.0_wp)
      do a = 1, size(axes)
         if (axes(a)%dimension == d) key(a, :) = numbers_of(axes(a))
      end do
      order = sorted_order(key)
      dimension%first_equal = order
      do i = 1, dimension%length
         dimension%first_equal(order(i)) = order(i)
         if (i == 1) cycle
         if (.not. any(abs(key(:, order(i)) - key(:, order(i - 1))) > 0.0_wp)) &
            dimension%first_equal(order(i)) = dimension%first_equal(order(i - 1))
      end do
   end subroutine new_dimension

   !> The values of an axis; for texts, numbers that differ where these do.
   pure function numbers_of(axis) result(numbers)
      type(sweep_axis), intent(in) :: axis
      real(wp) :: numbers(axis_size(axis))
      integer, allocatable :: order(:)
      integer :: i

      if (.not. axis%textual) then
         numbers = axis%numbers
         return
      end if
      order = sorted_order(axis%texts)
      do i = 1, size(order)
         numbers(order(i)) = i
         if (i == 1) cycle
         if (axis%texts(order(i)) == axis%texts(order(i - 1))) numbers(order(i)) = numbers(order(i - 1))
      end do
   end function numbers_of

   !> Row of each dimension in a case; the last dimension runs fastest.
   pure function rows(self, case) result(at)
      class(sweep_plan), intent(in) :: self
      integer, intent(in) :: case !! 1..n_cases
      integer :: at(size(self%dimensions))
      integer :: d, rest

      rest = case - 1
      do d = size(self%dimensions), 1, -1
         at(d) = 1 + modulo(rest, self%dimensions(d)%length)
         rest = rest/self%dimensions(d)%length
      end do
   end function rows

   !> The first case with the same values: the one that is computed.
   pure integer function same_as(self, case)
      class(sweep_plan), intent(in) :: self
      integer, intent(in) :: case !! 1..n_cases
      integer :: at(size(self%dimensions))
      integer :: d

      at = self%rows(case)
      same_as = 0
      do d = 1, size(at)
         same_as = same_as*self%dimensions(d)%length + self%dimensions(d)%first_equal(at(d)) - 1
      end do
      same_as = same_as + 1
   end function same_as

   !> At least so many cases differ in numbers only, from every case: those of the dimensions on which nothing depends but
   !> numbers.
   pure integer function fewest_alike(sweep, plan)
      type(sweep_config), intent(in) :: sweep
      type(sweep_plan), intent(in) :: plan
      integer :: a, d

      fewest_alike = 1
      do d = 1, sweep%n_dimensions
         if (any([(sweep%axes(a)%dimension == d .and. changes_kind(sweep%axes(a)), a=1, size(sweep%axes))])) cycle
         fewest_alike = fewest_alike*plan%dimensions(d)%length
      end do
   end function fewest_alike

   !> May cases with different values of this key be of different kinds?
   pure logical function changes_kind(axis)
      type(sweep_axis), intent(in) :: axis
      changes_kind = axis%textual .or. axis%key == 'chain.n_rods' .or. axis%key == 'solver.order' .or. &
                     axis%key == 'model.bending_shapes' .or. axis%key == 'solver.fixed_step'
   end function changes_kind

   !> All that results depend on, one line each: what a resumed sweep must have in common with the first.
   !> (The wall limit is not there: --retry-failed may give cases more time.)
   function plan_text(sweep) result(text)
      type(sweep_config), intent(in) :: sweep
      character(len=:), allocatable :: text, lines
      type(text_buffer) :: buffer
      type(case_config) :: base
      integer :: a, i

      call buffer%line('format: 1')
      call buffer%line('program: '//program_version//' ('//git_commit()//')')
      call buffer%line('compiler: '//compiler()//', '//compiler_options())
      do i = 1, size(sweep%probe_times)
         call buffer%line('probe time: '//to_text(sweep%probe_times(i)))
      end do
      call buffer%line('keep_series: '//to_text(sweep%keep_series))
      call buffer%line('lanes: '//to_text(sweep%lanes))
      if (sweep%frequencies > 0) call buffer%line('frequencies: '//to_text(sweep%frequencies))
      if (sweep%frequencies_at == 'equilibrium') call buffer%line('frequencies at: equilibrium')
      if (.not. sweep%integrate) call buffer%line('integrate: '//to_text(sweep%integrate))
      do a = 1, size(sweep%axes)
         associate (axis => sweep%axes(a))
            do i = 1, axis_size(axis)
               call buffer%line('axis '//to_text(a)//' (dimension '//to_text(axis%dimension)//') '//trim(axis%key)// &
                                ' = '//value_text(axis, i))
            end do
         end associate
      end do
      base = sweep%base_case
      base%title = '' ! the results do not depend on it, nor on where a single run would be written
      base%output%file = ''
      base%output%ledger = .false.
      base%output%compression = 0
      lines = resolved_case(base)
      call buffer%line('base: '//with_line_ends(lines(:len(lines) - 1), nl//'base: '))
      text = buffer%content()
   end function plan_text

end module rodyn_sweep_plan
