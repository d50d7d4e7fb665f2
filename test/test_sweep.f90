!> Sweeps from inside: the order of cases, checksums, and results that come back from shards as they went in.
module test_sweep
   use rodyn_kinds, only: wp, i8
   use rodyn_case_config, only: case_config
   use rodyn_checksum, only: crc64, crc64_text, hexadecimal
   use rodyn_errors, only: error_type
   use rodyn_sweep_case, only: build_case, case_result, case_shape, new_case_shape, status_done
   use rodyn_sweep_config, only: sweep_config
   use rodyn_sweep_plan, only: new_plan, sweep_plan
   use rodyn_sweep_reader, only: parse_sweep
   use rodyn_sweep_record, only: append_record, check_shard, decode_record, header_words, record_words, seal_words
   use test_testing, only: check, check_close, new_test, unittest
   implicit none (type, external)
   private
   public :: collect_sweep

   character(len=1), parameter :: nl = new_line('a')
   character(len=*), parameter :: base = &
      '&spacecraft mass = 100, inertia = 10 /'//nl// &
      '&chain n_rods = 2, length = 1, 3, mass_per_length = 2, bending_stiffness = 1e4, hinge_stiffness = 100 /'
   character(len=*), parameter :: grid = &
      "&sweep base = 'b.nml' /"//nl// &
      "&axis key = 'mass_ratio', values = 2, 4, 2 /"//nl// &
      "&axis key = 'model.inertia', text_values = 'distributed', 'lumped' /"

contains

   subroutine collect_sweep(suite)
      type(unittest), allocatable, intent(out) :: suite(:)
      suite = [ &
         new_test('the checksum is the published one', published_checksum), &
         new_test('the last axis of a grid runs fastest', grid_order), &
         new_test('equal cases are those of equal values', equal_cases), &
         new_test('the mass ratio is that of all nodes to all rods', ratio_of_masses), &
         new_test('bending follows the inertia', bending_follows), &
         new_test('results come back as they went in', round_trip), &
         new_test('every flipped bit and every truncation of a shard is noticed', all_damage_noticed)]
   end subroutine collect_sweep

   subroutine new_sweep(text, sweep, plan, error)
      character(len=*), intent(in) :: text
      type(sweep_config), intent(out) :: sweep
      type(sweep_plan), intent(out) :: plan
      type(error_type), allocatable, intent(out) :: error
      call parse_sweep(text, 's.nml', base, 'b.nml', .true., sweep, error)
      if (.not. allocated(error)) call new_plan(plan, sweep, error)
   end subroutine new_sweep

   !> CRC-64/XZ of '123456789' is 995DC9BBDF1939FA; words and text agree.
   subroutine published_checksum(error)
      type(error_type), allocatable, intent(out) :: error
      character(len=8), parameter :: text = 'abcdefgh'
      call check(error, hexadecimal(crc64_text('123456789')), '995DC9BBDF1939FA', 'text')
      if (allocated(error)) return
      call check(error, hexadecimal(crc64([transfer(text, 0_i8)])), hexadecimal(crc64_text(text)), 'words')
   end subroutine published_checksum

   subroutine grid_order(error)
      type(error_type), allocatable, intent(out) :: error
      type(sweep_config) :: sweep
      type(sweep_plan) :: plan

      call new_sweep(grid, sweep, plan, error)
      if (allocated(error)) return
      call check(error, plan%n_cases, 6, 'cases')
      if (allocated(error)) return
      call check(error, all([plan%rows(1), plan%rows(2), plan%rows(5)] == [1, 1, 1, 2, 3, 1]), 'rows')
   end subroutine grid_order

   subroutine equal_cases(error)
      type(error_type), allocatable, intent(out) :: error
      type(sweep_config) :: sweep
      type(sweep_plan) :: plan
      integer :: i

      call new_sweep(grid, sweep, plan, error)
      if (allocated(error)) return
      call check(error, all([(plan%same_as(i), i=1, 6)] == [1, 2, 3, 4, 1, 2]), 'same_as')
   end subroutine equal_cases

   subroutine ratio_of_masses(error)
      type(error_type), allocatable, intent(out) :: error
      type(sweep_config) :: sweep
      type(sweep_plan) :: plan
      type(case_config) :: config

      call new_sweep(grid, sweep, plan, error)
      if (.not. allocated(error)) call build_case(sweep, plan, 3, config, error)
      if (allocated(error)) return
      ! rods: 2 kg/m * 4 m = 8 kg; ratio 4: 32 kg on two nodes
      call check_close(error, config%chain%node_mass, [16.0_wp, 16.0_wp], 1e-13_wp, 'node masses')
   end subroutine ratio_of_masses

   subroutine bending_follows(error)
      type(error_type), allocatable, intent(out) :: error
      type(sweep_config) :: sweep
      type(sweep_plan) :: plan
      type(case_config) :: config

      call new_sweep(grid, sweep, plan, error)
      if (.not. allocated(error)) call build_case(sweep, plan, 2, config, error)
      if (allocated(error)) return
      call check(error, trim(config%model%inertia)//' '//trim(config%model%bending), 'lumped quasistatic', 'case 2')
      if (.not. allocated(error)) call build_case(sweep, plan, 1, config, error)
      if (allocated(error)) return
      call check(error, trim(config%model%inertia)//' '//trim(config%model%bending), 'distributed dynamic', 'case 1')
   end subroutine bending_follows

   !> A small result and its shape.
   subroutine sample(kept, shape)
      type(case_result), intent(out) :: kept
      type(case_shape), intent(out) :: shape
      integer :: i

      shape%n_rods = 1
      shape%n_states = 12
      shape%n_probes = 2
      kept%case = 3
      kept%status = status_done
      kept%attempt = 2
      kept%n_rhs = 2_i8**40
      kept%t_reached = 0.1_wp
      kept%message = 'nine text'
      kept%final = [(real(i, wp)/3.0_wp, i=1, 12)]
      allocate (kept%probes(12, 2), kept%times(0), kept%series(12, 0))
      kept%probes(:, 1) = -kept%final
      kept%probes(:, 2) = kept%final**2
   end subroutine sample

   subroutine round_trip(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_result) :: kept, back
      type(case_shape) :: shape
      integer(i8) :: words(100)
      integer :: used

      call sample(kept, shape)
      used = 0
      call append_record(kept, shape, words, used)
      call check(error, used, record_words(shape, status_done, 9), 'length')
      if (allocated(error)) return
      allocate (back%final(12), back%probes(12, 2), back%times(0), back%series(12, 0))
      call decode_record(words(:used), shape, back)
      call check(error, back%message, 'nine text', 'message')
      if (allocated(error)) return
      call check(error, back%case == 3 .and. back%attempt == 2 .and. back%n_rhs == 2_i8**40, 'numbers')
      if (allocated(error)) return
      call check_close(error, [back%final, back%probes(:, 2)], [kept%final, kept%probes(:, 2)], 0.0_wp, 'states')
   end subroutine round_trip

   subroutine all_damage_noticed(error)
      type(error_type), allocatable, intent(out) :: error
      integer(i8), parameter :: fingerprint = 77_i8
      type(case_result) :: kept
      type(case_shape) :: shape
      integer(i8) :: words(100)
      integer :: bit, i, used

      call sample(kept, shape)
      used = header_words
      call append_record(kept, shape, words, used)
      call seal_words(words, used, 1, fingerprint)
      call check(error, check_shard(words(:used), fingerprint, shape, 3), '', 'sound')
      if (allocated(error)) return
      call check(error, check_shard(words(:used), fingerprint, shape, 2), 'records do not fit the sweep', 'case 3 of 2')
      do i = 1, used
         do bit = 0, 63
            if (allocated(error)) return
            words(i) = ieor(words(i), ishft(1_i8, bit))
            call check(error, len(check_shard(words(:used), fingerprint, shape, 3)) > 0, 'a flipped bit passed')
            words(i) = ieor(words(i), ishft(1_i8, bit))
         end do
      end do
      do i = 0, used - 1
         if (allocated(error)) return
         call check(error, len(check_shard(words(:i), fingerprint, shape, 3)) > 0, 'a truncated shard passed')
      end do
   end subroutine all_damage_noticed

end module test_sweep
