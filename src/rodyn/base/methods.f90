!> The methods of integration: what the user may choose of them, and what each is capable of.
!>
!> The rules of the keys of &solver, notes on a case, the choice of `auto` and the checks of the integrators all read the table
!> `methods`. To add a method: a row here, its integrator, and a `case` in `rodyn_integrators`.
module rodyn_methods
   use rodyn_kinds, only: wp
   use rodyn_text, only: to_text
   implicit none (type, external)
   private
   public :: solver_options, method_type, methods, method_words, method_named, order_rule, list_of_methods

   !> What the user chooses of a method.
   type :: solver_options
      real(wp) :: rtol = 1.0e-8_wp        !! relative tolerance, > 0
      real(wp) :: atol = 1.0e-10_wp       !! absolute tolerance of every controlled state, > 0
      integer :: order = 0                !! highest order of a multistep method, order of a one-step method; 0: the default
      real(wp) :: max_step = 0.0_wp       !! [s]; 0: no bound
      real(wp) :: fixed_step = 0.0_wp     !! [s], where `fixed_steps`; 0: adaptive
      logical :: allow_unstable = .false. !! fixed steps beyond the stability limit, see `rodyn_step_limit`
      integer :: max_steps = 1000000000   !! internal steps of the whole run, restarts included
   end type solver_options

   !> What a method is capable of.
   type :: method_type
      character(len=6) :: name = ''
      integer :: lowest_order = 0      !! that may be asked for
      integer :: highest_order = 0
      logical :: fixed_steps = .false. !! it can take them
      logical :: multistep = .false.   !! errors add up from period to period of a vibration
      logical :: in_lanes = .false.    !! like systems go side by side in vector lanes (`rodyn_lane_dop853`)
   end type method_type

   type(method_type), parameter :: methods(*) = [ &
      method_type('adams', 1, 12, multistep=.true.), &
      method_type('bdf', 1, 5, multistep=.true.), &
      method_type('erk', 2, 8, fixed_steps=.true.), &
      method_type('dop853', 8, 8, fixed_steps=.true., in_lanes=.true.), &
      method_type('gauss', 16, 16, fixed_steps=.true.)]

   !> The same names as the words of a key.
   character(len=*), parameter :: method_words = 'adams|bdf|erk|dop853|gauss'

contains

   !> The row of a method; without a name if there is none.
   pure type(method_type) function method_named(name)
      character(len=*), intent(in) :: name
      integer :: i
      do i = 1, size(methods)
         if (methods(i)%name == name) method_named = methods(i)
      end do
   end function method_named

   !> What a method says against an order; empty if nothing.
   pure function order_rule(method, order) result(rule)
      type(method_type), intent(in) :: method
      integer, intent(in) :: order !! 0: the method's own choice
      character(len=:), allocatable :: rule

      rule = ''
      associate (low => method%lowest_order, high => method%highest_order)
         if (order == 0 .or. (order >= low .and. order <= high)) return
         if (low == high) then
            rule = 'must be 0 or '//to_text(high)
         else if (low == 1) then
            rule = 'must lie in 0..'//to_text(high)
         else
            rule = 'must be 0 or lie in '//to_text(low)//'..'//to_text(high)
         end if
      end associate
      rule = rule//" when method = '"//trim(method%name)//"'"
   end function order_rule

   !> Names of some of the methods: "'erk', 'dop853' or 'gauss'".
   pure function list_of_methods(wanted) result(text)
      logical, intent(in) :: wanted(:) !! of the methods
      character(len=:), allocatable :: text
      integer :: i

      text = ''
      do i = 1, size(methods)
         if (.not. wanted(i)) cycle
         if (len(text) > 0) text = text//trim(merge(',  ', ' or', any(wanted(i + 1:))))//' '
         text = text//"'"//trim(methods(i)%name)//"'"
      end do
   end function list_of_methods

end module rodyn_methods
