!> Coefficients of the explicit Runge-Kutta pair of order 8(5,3) of Dormand and Prince.
!>
!> Source: E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, 2nd ed., Springer 1993,
!> sec. II.10 (code DOP853). Names follow the book: k_i = f(t + c_i h, y + h sum_j a_ij k_j),
!> y_new = y + h sum_i b_i k_i; e5 and e3 give the differences to the embedded solutions of order 5 and 3.
module rodyn_dop853_tableau
   use rodyn_kinds, only: wp
   implicit none (type, external)
   public

   real(wp), parameter :: c2 = 0.05260015195876773_wp
   real(wp), parameter :: c3 = 0.0789002279381516_wp
   real(wp), parameter :: c4 = 0.1183503419072274_wp
   real(wp), parameter :: c5 = 0.2816496580927726_wp
   real(wp), parameter :: c6 = 0.3333333333333333_wp
   real(wp), parameter :: c7 = 0.25_wp
   real(wp), parameter :: c8 = 0.3076923076923077_wp
   real(wp), parameter :: c9 = 0.6512820512820513_wp
   real(wp), parameter :: c10 = 0.6_wp
   real(wp), parameter :: c11 = 0.8571428571428571_wp
   real(wp), parameter :: c12 = 1.0_wp
   real(wp), parameter :: a2_1 = 0.05260015195876773_wp
   real(wp), parameter :: a3_1 = 0.0197250569845379_wp
   real(wp), parameter :: a3_2 = 0.0591751709536137_wp
   real(wp), parameter :: a4_1 = 0.02958758547680685_wp
   real(wp), parameter :: a4_3 = 0.08876275643042054_wp
   real(wp), parameter :: a5_1 = 0.2413651341592667_wp
   real(wp), parameter :: a5_3 = -0.8845494793282861_wp
   real(wp), parameter :: a5_4 = 0.924834003261792_wp
   real(wp), parameter :: a6_1 = 0.037037037037037035_wp
   real(wp), parameter :: a6_4 = 0.17082860872947386_wp
   real(wp), parameter :: a6_5 = 0.12546768756682242_wp
   real(wp), parameter :: a7_1 = 0.037109375_wp
   real(wp), parameter :: a7_4 = 0.17025221101954405_wp
   real(wp), parameter :: a7_5 = 0.06021653898045596_wp
   real(wp), parameter :: a7_6 = -0.017578125_wp
   real(wp), parameter :: a8_1 = 0.03709200011850479_wp
   real(wp), parameter :: a8_4 = 0.17038392571223998_wp
   real(wp), parameter :: a8_5 = 0.10726203044637328_wp
   real(wp), parameter :: a8_6 = -0.015319437748624402_wp
   real(wp), parameter :: a8_7 = 0.008273789163814023_wp
   real(wp), parameter :: a9_1 = 0.6241109587160757_wp
   real(wp), parameter :: a9_4 = -3.3608926294469414_wp
   real(wp), parameter :: a9_5 = -0.868219346841726_wp
   real(wp), parameter :: a9_6 = 27.59209969944671_wp
   real(wp), parameter :: a9_7 = 20.154067550477894_wp
   real(wp), parameter :: a9_8 = -43.48988418106996_wp
   real(wp), parameter :: a10_1 = 0.47766253643826434_wp
   real(wp), parameter :: a10_4 = -2.4881146199716677_wp
   real(wp), parameter :: a10_5 = -0.590290826836843_wp
   real(wp), parameter :: a10_6 = 21.230051448181193_wp
   real(wp), parameter :: a10_7 = 15.279233632882423_wp
   real(wp), parameter :: a10_8 = -33.28821096898486_wp
   real(wp), parameter :: a10_9 = -0.020331201708508627_wp
   real(wp), parameter :: a11_1 = -0.9371424300859873_wp
   real(wp), parameter :: a11_4 = 5.186372428844064_wp
   real(wp), parameter :: a11_5 = 1.0914373489967295_wp
   real(wp), parameter :: a11_6 = -8.149787010746927_wp
   real(wp), parameter :: a11_7 = -18.52006565999696_wp
   real(wp), parameter :: a11_8 = 22.739487099350505_wp
   real(wp), parameter :: a11_9 = 2.4936055526796523_wp
   real(wp), parameter :: a11_10 = -3.0467644718982196_wp
   real(wp), parameter :: a12_1 = 2.273310147516538_wp
   real(wp), parameter :: a12_4 = -10.53449546673725_wp
   real(wp), parameter :: a12_5 = -2.0008720582248625_wp
   real(wp), parameter :: a12_6 = -17.9589318631188_wp
   real(wp), parameter :: a12_7 = 27.94888452941996_wp
   real(wp), parameter :: a12_8 = -2.8589982771350235_wp
   real(wp), parameter :: a12_9 = -8.87285693353063_wp
   real(wp), parameter :: a12_10 = 12.360567175794303_wp
   real(wp), parameter :: a12_11 = 0.6433927460157636_wp
   real(wp), parameter :: b1 = 0.054293734116568765_wp
   real(wp), parameter :: b6 = 4.450312892752409_wp
   real(wp), parameter :: b7 = 1.8915178993145003_wp
   real(wp), parameter :: b8 = -5.801203960010585_wp
   real(wp), parameter :: b9 = 0.3111643669578199_wp
   real(wp), parameter :: b10 = -0.1521609496625161_wp
   real(wp), parameter :: b11 = 0.20136540080403034_wp
   real(wp), parameter :: b12 = 0.04471061572777259_wp
   real(wp), parameter :: e5_1 = 0.01312004499419488_wp
   real(wp), parameter :: e5_6 = -1.2251564463762044_wp
   real(wp), parameter :: e5_7 = -0.4957589496572502_wp
   real(wp), parameter :: e5_8 = 1.6643771824549864_wp
   real(wp), parameter :: e5_9 = -0.35032884874997366_wp
   real(wp), parameter :: e5_10 = 0.3341791187130175_wp
   real(wp), parameter :: e5_11 = 0.08192320648511571_wp
   real(wp), parameter :: e5_12 = -0.022355307863886294_wp
   real(wp), parameter :: e3_1 = -0.18980075407240762_wp
   real(wp), parameter :: e3_6 = 4.450312892752409_wp
   real(wp), parameter :: e3_7 = 1.8915178993145003_wp
   real(wp), parameter :: e3_8 = -5.801203960010585_wp
   real(wp), parameter :: e3_9 = -0.4226823213237919_wp
   real(wp), parameter :: e3_10 = -0.1521609496625161_wp
   real(wp), parameter :: e3_11 = 0.20136540080403034_wp
   real(wp), parameter :: e3_12 = 0.02265179219836082_wp

end module rodyn_dop853_tableau
