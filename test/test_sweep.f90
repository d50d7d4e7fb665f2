!> Sweeps from inside: the order of cases, checksums, and results that come back from shards as they went in.
module test_sweep
   use rodyn_kinds, only: wp, i8
   use rodyn_case_config, only: case_config
   use rodyn_checksum, only: crc64, crc64_text, hexadecimal
   use rodyn_errors, only: error_type
   use rodyn_sweep_case, only: allocate_result, build_case, case_result, case_shape, status_done
   use rodyn_sweep_config, only: sweep_config
   use rodyn_sweep_plan, only: new_plan, sweep_plan
   use rodyn_input_texts, only: input_texts, new_input_texts
   use rodyn_sweep_reader, only: parse_sweep
   use rodyn_sweep_record, only: decode_record, encode_record, is_sound, record_words
   use rodyn_sweep_shard, only: header_words, shard_extent, shard_header, shard_trailer, sift_shard
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

   integer(i8), parameter :: fingerprint = 77_i8

contains

   subroutine collect_sweep(suite)
      type(unittest), allocatable, intent(out) :: suite(:)
      suite = [ &
         new_test('the checksum is the published one', published_checksum), &
         new_test('a sweep names its base', base_is_named), &
         new_test('the last axis of a grid runs fastest', grid_order), &
         new_test('equal cases are those of equal values', equal_cases), &
         new_test('the mass ratio is that of all nodes to all rods', ratio_of_masses), &
         new_test('bending follows the inertia', bending_follows), &
         new_test('results come back as they went in', round_trip), &
         new_test('a checksum goes on where another ended', continued_checksum), &
         new_test('every flipped bit and every truncation of a shard is noticed', all_damage_noticed), &
         new_test('good records of a damaged shard are kept, and no other', good_records_kept)]
   end subroutine collect_sweep

   subroutine new_sweep(text, sweep, plan, error, more)
      character(len=*), intent(in) :: text
      type(sweep_config), intent(out) :: sweep
      type(sweep_plan), intent(out) :: plan
      type(error_type), allocatable, intent(out) :: error
      character(len=*), intent(in), optional :: more !! of the base
      type(input_texts) :: input
      if (present(more)) then
         call new_input_texts(input, text, 's.nml', base//nl//more, 'b.nml')
      else
         call new_input_texts(input, text, 's.nml', base, 'b.nml')
      end if
      call parse_sweep(input, .true., sweep, error)
      if (.not. allocated(error)) call new_plan(plan, sweep, error)
   end subroutine new_sweep

   subroutine base_is_named(error)
      type(error_type), allocatable, intent(out) :: error
      type(input_texts) :: input
      type(sweep_config) :: sweep
      type(error_type), allocatable :: refusal
      call new_input_texts(input, "&sweep base = '' / &axis key = 'case.t_end', values = 1, 2 /", 's.nml')
      call parse_sweep(input, .true., sweep, refusal)
      call check(error, allocated(refusal), 'accepted')
      if (.not. allocated(error)) call check(error, refusal%message, "s.nml:1: &sweep base = '': must not be empty", 'message')
   end subroutine base_is_named

   !> CRC-64/XZ of '123456789' is 995DC9BBDF1939FA; words and text agree.
   subroutine published_checksum(error)
      type(error_type), allocatable, intent(out) :: error
      character(len=8), parameter :: text = 'abcdefgh'
      call check(error, hexadecimal(crc64_text('123456789')), '995DC9BBDF1939FA', 'text')
      if (allocated(error)) return
      call check(error, hexadecimal(crc64([transfer(text, 0_i8)])), hexadecimal(crc64_text(text)), 'words')
   end subroutine published_checksum

   subroutine continued_checksum(error)
      type(error_type), allocatable, intent(out) :: error
      integer(i8), parameter :: words(3) = [3_i8, 1_i8, 4_i8]
      call check(error, hexadecimal(crc64(words(2:), crc64(words(:1)))), hexadecimal(crc64(words)), 'words')
      if (allocated(error)) return
      call check(error, hexadecimal(crc64_text('6789', crc64_text('12345'))), '995DC9BBDF1939FA', 'text')
   end subroutine continued_checksum

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
      if (.not. allocated(error)) call new_sweep(grid, sweep, plan, error, &
                                                      "&model formulation = 'consistent', bending = 'quasistatic' /")
      if (.not. allocated(error)) call build_case(sweep, plan, 1, config, error)
      if (allocated(error)) return
      call check(error, trim(config%model%inertia)//' '//trim(config%model%bending), 'distributed quasistatic', 'condensed base')
   end subroutine bending_follows

   !> A small result and its shape.
   subroutine sample(kept, shape)
      type(case_result), intent(out) :: kept
      type(case_shape), intent(out) :: shape
      integer :: i

      shape%layout%n_values = 12
      shape%n_probes = 2
      shape%n_modes = 3
      kept%case = 3
      kept%status = status_done
      kept%attempt = 2
      kept%n_rhs = 2_i8**40
      kept%t_reached = 0.1_wp
      kept%message = 'nine text'
      kept%final = [(real(i, wp)/3.0_wp, i=1, 12)]
      allocate (kept%probes(12, 2), kept%times(0), kept%series(12, 0))
      kept%frequency = [1.5_wp, 2.5_wp, 4.0_wp]
      kept%damping_ratio = 0.01_wp*kept%frequency
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
      call encode_record(kept, shape, words, used)
      call check(error, used, record_words(shape, status_done, 9), 'length')
      if (allocated(error)) return
      call check(error, is_sound(words(:used)), 'checksum')
      if (allocated(error)) return
      call allocate_result(back, shape)
      call decode_record(words(:used), shape, back)
      call check(error, back%message, 'nine text', 'message')
      if (allocated(error)) return
      call check(error, back%case == 3 .and. back%attempt == 2 .and. back%n_rhs == 2_i8**40, 'numbers')
      if (allocated(error)) return
      call check_close(error, [back%frequency, back%damping_ratio, back%final, back%probes(:, 2)], &
                       [kept%frequency, kept%damping_ratio, kept%final, kept%probes(:, 2)], 0.0_wp, 'states')
   end subroutine round_trip

   !> A shard of three records, of cases 1, 2 and 3.
   subroutine new_shard(shape, words, n)
      type(case_shape), intent(out) :: shape
      integer(i8), intent(out) :: words(:)
      integer, intent(out) :: n !! words in use, with the trailer
      type(case_result) :: kept
      type(shard_extent) :: extent
      integer :: i

      call sample(kept, shape)
      words(:header_words) = shard_header(fingerprint)
      call extent%add(shard_header(fingerprint))
      do i = 1, 3
         kept%case = i
         call encode_record(kept, shape, words(extent%used + 1:), n)
         call extent%add(words(extent%used + 1:extent%used + n))
      end do
      n = extent%used + 3
      words(extent%used + 1:n) = shard_trailer(extent)
   end subroutine new_shard

   !> Is this a whole, sealed shard of cases 1 to `n_cases`?
   logical function is_whole(words, shape, n_cases)
      integer(i8), intent(in) :: words(:)
      type(case_shape), intent(in) :: shape
      integer, intent(in) :: n_cases
      integer(i8) :: copy(size(words))
      type(shard_extent) :: extent
      character(len=:), allocatable :: fault

      copy = words
      call sift_shard(copy, fingerprint, shape, n_cases, extent, fault)
      is_whole = len(fault) == 0 .and. extent%sealed
   end function is_whole

   subroutine all_damage_noticed(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_shape) :: shape
      integer(i8) :: words(200)
      integer :: bit, i, n

      call new_shard(shape, words, n)
      call check(error, is_whole(words(:n), shape, 3), 'a sound shard was refused')
      if (allocated(error)) return
      call check(error, .not. is_whole(words(:n), shape, 2), 'case 3 of 2 passed')
      do i = 1, n
         do bit = 0, 63
            if (allocated(error)) return
            words(i) = ieor(words(i), ishft(1_i8, bit))
            call check(error, .not. is_whole(words(:n), shape, 3), 'a flipped bit passed')
            words(i) = ieor(words(i), ishft(1_i8, bit))
         end do
      end do
      do i = 0, n - 1
         if (allocated(error)) return
         call check(error, .not. is_whole(words(:i), shape, 3), 'a truncated shard passed')
      end do
      if (allocated(error)) return
      words(n + 1) = 0
      call check(error, .not. is_whole(words(:n + 1), shape, 3), 'an extended shard passed')
   end subroutine all_damage_noticed

   !> Whatever bit is flipped, wherever the file is cut: what remains are whole records that were written.
   subroutine good_records_kept(error)
      type(error_type), allocatable, intent(out) :: error
      type(case_shape) :: shape
      integer(i8) :: words(200), copy(200)
      type(shard_extent) :: extent
      character(len=:), allocatable :: fault
      integer :: bit, i, length, n, wanted

      call new_shard(shape, words, n)
      length = int(words(header_words + 1))
      do i = header_words + 1, header_words + length ! of the first record: only that is lost
         do bit = 0, 63, 7
            copy = words
            copy(i) = ieor(copy(i), ishft(1_i8, bit))
            call sift_shard(copy(:n), fingerprint, shape, 3, extent, fault)
            call check(error, extent%n_records == 2 .and. len(fault) > 0, 'two of three')
            if (allocated(error)) return
            call check(error, all(copy(header_words + 1:extent%used) == words(header_words + length + 1:n - 3)), 'the two')
            if (allocated(error)) return
         end do
      end do
      do i = 0, n - 3
         copy = words
         call sift_shard(copy(:i), fingerprint, shape, 3, extent, fault)
         wanted = max(0, i - header_words)/length
         call check(error, extent%n_records == wanted .and. .not. extent%sealed, 'records before the cut')
         if (allocated(error)) return
         call check(error, (len(fault) == 0) .eqv. (i >= header_words .and. modulo(i - header_words, length) == 0), 'torn')
         if (allocated(error)) return
      end do
   end subroutine good_records_kept

end module test_sweep
