!> Coefficients of the explicit Runge-Kutta pair of order 8(5,3) of Dormand and Prince.
!>
!> Source: E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, 2nd ed., Springer 1993,
!> sec. II.10 (code DOP853). Names follow the book: k_i = f(t + c_i h, y + h sum_j a_ij k_j),
!> y_new = y + h sum_i b_i k_i; e5 and e3 give the differences to the embedded solutions of order 5 and 3.
module rodyn_dop853_tableau
   use rodyn_kinds, only: wp
   implicit none (type, external)
   public

   real(wp), parameter :: c2 = 0.0526001519587677318785587544488_wp
   real(wp), parameter :: c3 = 0.0789002279381515978178381316732_wp
   real(wp), parameter :: c4 = 0.118350341907227396726757197510_wp
   real(wp), parameter :: c5 = 0.281649658092772603273242802490_wp
   real(wp), parameter :: c6 = 1.0_wp/3.0_wp
   real(wp), parameter :: c7 = 0.25_wp
   real(wp), parameter :: c8 = 4.0_wp/13.0_wp
   real(wp), parameter :: c9 = 127.0_wp/195.0_wp
   real(wp), parameter :: c10 = 0.6_wp
   real(wp), parameter :: c11 = 6.0_wp/7.0_wp
   real(wp), parameter :: c12 = 1.0_wp
   real(wp), parameter :: a2_1 = 0.0526001519587677318785587544488_wp
   real(wp), parameter :: a3_1 = 0.0197250569845378994544595329183_wp
   real(wp), parameter :: a3_2 = 0.0591751709536136983633785987549_wp
   real(wp), parameter :: a4_1 = 0.0295875854768068491816892993775_wp
   real(wp), parameter :: a4_3 = 0.0887627564304205475450678981324_wp
   real(wp), parameter :: a5_1 = 0.241365134159266685502369798665_wp
   real(wp), parameter :: a5_3 = -0.884549479328286085344864962717_wp
   real(wp), parameter :: a5_4 = 0.924834003261792003115737966543_wp
   real(wp), parameter :: a6_1 = 1.0_wp/27.0_wp
   real(wp), parameter :: a6_4 = 0.170828608729473871279604482173_wp
   real(wp), parameter :: a6_5 = 0.125467687566822425016691814123_wp
   real(wp), parameter :: a7_1 = 0.037109375_wp
   real(wp), parameter :: a7_4 = 0.170252211019544039314978060272_wp
   real(wp), parameter :: a7_5 = 0.0602165389804559606850219397283_wp
   real(wp), parameter :: a7_6 = -0.017578125_wp
   real(wp), parameter :: a8_1 = 0.0370920001185047927108779319836_wp
   real(wp), parameter :: a8_4 = 0.170383925712239993810214054705_wp
   real(wp), parameter :: a8_5 = 0.107262030446373284651809199168_wp
   real(wp), parameter :: a8_6 = -0.0153194377486244017527936158236_wp
   real(wp), parameter :: a8_7 = 0.00827378916381402288758473766002_wp
   real(wp), parameter :: a9_1 = 0.624110958716075717114429577812_wp
   real(wp), parameter :: a9_4 = -3.36089262944694129406857109825_wp
   real(wp), parameter :: a9_5 = -0.868219346841726006818189891453_wp
   real(wp), parameter :: a9_6 = 27.5920996994467083049415600797_wp
   real(wp), parameter :: a9_7 = 20.1540675504778934086186788979_wp
   real(wp), parameter :: a9_8 = -43.4898841810699588477366255144_wp
   real(wp), parameter :: a10_1 = 0.477662536438264365890433908527_wp
   real(wp), parameter :: a10_4 = -2.48811461997166764192642586468_wp
   real(wp), parameter :: a10_5 = -0.590290826836842996371446475743_wp
   real(wp), parameter :: a10_6 = 21.2300514481811942347288949897_wp
   real(wp), parameter :: a10_7 = 15.2792336328824235832596922938_wp
   real(wp), parameter :: a10_8 = -33.2882109689848629194453265587_wp
   real(wp), parameter :: a10_9 = -0.0203312017085086261358222928593_wp
   real(wp), parameter :: a11_1 = -0.93714243008598732571704021658_wp
   real(wp), parameter :: a11_4 = 5.18637242884406370830023853209_wp
   real(wp), parameter :: a11_5 = 1.09143734899672957818500254654_wp
   real(wp), parameter :: a11_6 = -8.14978701074692612513997267357_wp
   real(wp), parameter :: a11_7 = -18.5200656599969598641566180701_wp
   real(wp), parameter :: a11_8 = 22.7394870993505042818970056734_wp
   real(wp), parameter :: a11_9 = 2.49360555267965238987089396762_wp
   real(wp), parameter :: a11_10 = -3.0467644718982195003823669022_wp
   real(wp), parameter :: a12_1 = 2.27331014751653820792359768449_wp
   real(wp), parameter :: a12_4 = -10.5344954667372501984066689879_wp
   real(wp), parameter :: a12_5 = -2.00087205822486249909675718444_wp
   real(wp), parameter :: a12_6 = -17.9589318631187989172765950534_wp
   real(wp), parameter :: a12_7 = 27.9488845294199600508499808837_wp
   real(wp), parameter :: a12_8 = -2.85899827713502369474065508674_wp
   real(wp), parameter :: a12_9 = -8.87285693353062954433549289258_wp
   real(wp), parameter :: a12_10 = 12.3605671757943030647266201528_wp
   real(wp), parameter :: a12_11 = 0.643392746015763530355970484046_wp
   real(wp), parameter :: b1 = 0.0542937341165687622380535766363_wp
   real(wp), parameter :: b6 = 4.45031289275240888144113950566_wp
   real(wp), parameter :: b7 = 1.89151789931450038304281599044_wp
   real(wp), parameter :: b8 = -5.8012039600105847814672114227_wp
   real(wp), parameter :: b9 = 0.31116436695781989440891606237_wp
   real(wp), parameter :: b10 = -0.152160949662516078556178806805_wp
   real(wp), parameter :: b11 = 0.201365400804030348374776537501_wp
   real(wp), parameter :: b12 = 0.0447106157277725905176885569043_wp
   real(wp), parameter :: e5_1 = 0.01312004499419488073250102996_wp
   real(wp), parameter :: e5_6 = -1.225156446376204440720569753_wp
   real(wp), parameter :: e5_7 = -0.4957589496572501915214079952_wp
   real(wp), parameter :: e5_8 = 1.664377182454986536961530415_wp
   real(wp), parameter :: e5_9 = -0.3503288487499736816886487290_wp
   real(wp), parameter :: e5_10 = 0.3341791187130174790297318841_wp
   real(wp), parameter :: e5_11 = 0.08192320648511571246570742613_wp
   real(wp), parameter :: e5_12 = -0.02235530786388629525884427845_wp
   real(wp), parameter :: e3_1 = -0.1898007540724076157147023288757_wp
   real(wp), parameter :: e3_6 = b6
   real(wp), parameter :: e3_7 = b7
   real(wp), parameter :: e3_8 = b8
   real(wp), parameter :: e3_9 = -0.422682321323791962932445679177_wp
   real(wp), parameter :: e3_10 = b10
   real(wp), parameter :: e3_11 = b11
   real(wp), parameter :: e3_12 = 0.0226517921983608258118062039631_wp

end module rodyn_dop853_tableau
