!> What a run needs of the machine, estimated before it begins: one that cannot fit is refused in words.
module rodyn_run_needs
   use rodyn_kinds, only: wp
   use rodyn_case_config, only: case_config
   use rodyn_errors, only: error_type, raise, exit_bad_input
   use rodyn_method_costs, only: bytes_per_rod
   use rodyn_posix, only: parent_directory
   use rodyn_quantities, only: numbers_that_change
   use rodyn_resources, only: free_disk, free_memory, byte_text
   use rodyn_text, only: to_text
   implicit none (type, external)
   private
   public :: check_needs, check_memory, memory_of_scene, of_program

   real(wp), parameter :: word = 8.0_wp                !! of a real number [bytes]
   real(wp), parameter :: matrices = 4.75_wp           !! n_dof x n_dof, of the assembled kernel
   real(wp), parameter :: less_bending = 0.4_wp        !! memory of rods that do not bend as motion over that of those that do
   !> Whatever the scene; OpenBLAS takes 134 MB at its first call, and without them would wait for ever [bytes].
   real(wp), parameter :: of_program = 1.5e8_wp
   real(wp), parameter :: least_compressed = 0.7_wp    !! of the size of numbers that change

contains

   !> Refuse a run that needs more memory or disk than there is. The estimates are low rather than high: a run that is let
   !> through may still end for want of disk, with a message of its own.
   subroutine check_needs(config, path, error)
      type(case_config), intent(in) :: config
      character(len=*), intent(in) :: path !! of the result
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: memory, disk, rows

      rows = real(config%n_outputs, wp) + 1.0_wp
      memory = of_program + memory_of_scene(config)
      call check_memory('n_rods = '//to_text(config%chain%n_rods)//", kernel = '"//trim(config%model%kernel)//"'", memory, error)
      if (allocated(error)) return
      disk = word*rows*(1.0_wp + numbers_that_change(config))
      if (config%output%compression > 0) disk = disk*least_compressed
      if (disk > free_disk(parent_directory(path))) &
         call raise(error, path//': n_outputs = '//to_text(config%n_outputs)//' rows of '//to_text(config%chain%n_rods)// &
                    ' rods: needs about '//byte_text(disk)//' of disk, but only '// &
                    byte_text(free_disk(parent_directory(path)))//' are free', exit_bad_input)
   end subroutine check_needs

   !> Refuse what needs more memory than there is.
   subroutine check_memory(what, needed, error)
      character(len=*), intent(in) :: what
      real(wp), intent(in) :: needed !! [bytes]
      type(error_type), allocatable, intent(out) :: error
      if (needed > free_memory()) call raise(error, what//': needs about '//byte_text(needed)//' of memory, but only '// &
                                             byte_text(free_memory())//' are free', exit_bad_input)
   end subroutine check_memory

   !> Memory of a scene, its integrator and one row of results [bytes]; measured, see docs/stability_input.md.
   pure real(wp) function memory_of_scene(config)
      type(case_config), intent(in) :: config
      real(wp) :: n, n_dof

      n = real(config%chain%n_rods, wp)
      n_dof = n*merge(1.0_wp + config%model%bending_shapes, 1.0_wp, config%model%bending == 'dynamic')
      memory_of_scene = n*bytes_per_rod(config%solver%method)*merge(1.0_wp, less_bending, config%model%bending == 'dynamic')
      if (config%model%kernel == 'assembled') memory_of_scene = memory_of_scene + word*matrices*n_dof**2
   end function memory_of_scene

end module rodyn_run_needs
