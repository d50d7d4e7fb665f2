/* Debian builds flang's run-time library without functions of 128-bit numbers (FLANG_RUNTIME_F128_MATH_LIB); GCC has them. */
#include <quadmath.h>
__float128 _FortranACosF128(__float128 x) { return cosq(x); }
__float128 _FortranASinF128(__float128 x) { return sinq(x); }
