!> The tableau of `rodyn_dop853_tableau` for second-order equations q' = p, p' = f, as matrices.
!>
!> With q' = p in every stage, P_s = p + h sum a_is f_i and Q_s = q + h sum a_is P_i give
!>     Q_s = q + h c_s p + h^2 sum a2_is f_i,   a2 = a a,
!> the same numbers but for rounding, from half as much to keep and to read. Sums of the error coefficients vanish.
module rodyn_dop853_nystrom
   use rodyn_kinds, only: wp
   use rodyn_dop853_tableau, only: &
      c2, c3, c4, c5, c6, c7, c8, c9, c10, c11, c12, a2_1, a3_1, a3_2, a4_1, a4_3, a5_1, a5_3, a5_4, a6_1, a6_4, &
      a6_5, a7_1, a7_4, a7_5, a7_6, a8_1, a8_4, a8_5, a8_6, a8_7, a9_1, a9_4, a9_5, a9_6, a9_7, a9_8, a10_1, a10_4, &
      a10_5, a10_6, a10_7, a10_8, a10_9, a11_1, a11_4, a11_5, a11_6, a11_7, a11_8, a11_9, a11_10, a12_1, a12_4, &
      a12_5, a12_6, a12_7, a12_8, a12_9, a12_10, a12_11, b1, b6, b7, b8, b9, b10, b11, b12, e5_1, e5_6, e5_7, e5_8, &
      e5_9, e5_10, e5_11, e5_12, e3_1, e3_6, e3_7, e3_8, e3_9, e3_10, e3_11, e3_12
   implicit none (type, external)
   private
   public :: n_stages, node, a, a2, b, b2, e5, e5_2, e3, e3_2

   integer, parameter :: n_stages = 12
   real(wp), parameter :: node(n_stages) = [0.0_wp, c2, c3, c4, c5, c6, c7, c8, c9, c10, c11, c12]
   real(wp), parameter :: none = 0.0_wp

   !> Coefficient of rate i in stage s: a(i, s).
   real(wp), parameter :: a(n_stages, n_stages) = reshape([ &
      none, none, none, none, none, none, none, none, none, none, none, none, &
      a2_1, none, none, none, none, none, none, none, none, none, none, none, &
      a3_1, a3_2, none, none, none, none, none, none, none, none, none, none, &
      a4_1, none, a4_3, none, none, none, none, none, none, none, none, none, &
      a5_1, none, a5_3, a5_4, none, none, none, none, none, none, none, none, &
      a6_1, none, none, a6_4, a6_5, none, none, none, none, none, none, none, &
      a7_1, none, none, a7_4, a7_5, a7_6, none, none, none, none, none, none, &
      a8_1, none, none, a8_4, a8_5, a8_6, a8_7, none, none, none, none, none, &
      a9_1, none, none, a9_4, a9_5, a9_6, a9_7, a9_8, none, none, none, none, &
      a10_1, none, none, a10_4, a10_5, a10_6, a10_7, a10_8, a10_9, none, none, none, &
      a11_1, none, none, a11_4, a11_5, a11_6, a11_7, a11_8, a11_9, a11_10, none, none, &
      a12_1, none, none, a12_4, a12_5, a12_6, a12_7, a12_8, a12_9, a12_10, a12_11, none], [n_stages, n_stages])
   real(wp), parameter :: b(n_stages) = [b1, none, none, none, none, b6, b7, b8, b9, b10, b11, b12]
   real(wp), parameter :: e5(n_stages) = [e5_1, none, none, none, none, e5_6, e5_7, e5_8, e5_9, e5_10, e5_11, e5_12]
   real(wp), parameter :: e3(n_stages) = [e3_1, none, none, none, none, e3_6, e3_7, e3_8, e3_9, e3_10, e3_11, e3_12]
   real(wp), parameter :: a2(n_stages, n_stages) = matmul(a, a)
   real(wp), parameter :: b2(n_stages) = matmul(a, b), e5_2(n_stages) = matmul(a, e5), e3_2(n_stages) = matmul(a, e3)

end module rodyn_dop853_nystrom
