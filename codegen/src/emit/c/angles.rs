//! The C templates of sines and cosines: the polynomials and the reductions of the runtime's
//! `scalar/angles.rs`, with the same bounds. Only conversions to integers decide in which quarter turn
//! an angle is, so that compilers may reorder sums; the shorter reduction is left out where they may.

/// Number of angles whose sines and cosines are computed together.
pub(super) const LANES: usize = 4;

/// The functions that the templates for one angle and for several have in common.
pub(super) const ANGLE: &str = r"
/* Sine and cosine of y + tail, where y is at most an eighth of a turn and tail its rounding error. */
static inline void @near(double y, double tail, double *s, double *c)
{
    const double z = y * y;
    const double square = z * z;
    const double half = z * 0.5;
    const double sin_low = $FMA(0.00833333333333094, z, -0.16666666666666666);
    const double sin_middle = $FMA(2.755731609787775e-6, z, -0.0001984126983674956);
    const double sin_high = $FMA(1.591805913698281e-10, z, -2.5051130870968297e-8);
    const double sin_all = $FMA($FMA(sin_high, square, sin_middle), square, sin_low);
    const double cos_low = $FMA(-0.0013888888888887393, z, 0.041666666666666664);
    const double cos_middle = $FMA(-2.755731726880539e-7, z, 2.4801587298760048e-5);
    const double cos_high = $FMA(-1.1382588535352526e-11, z, 2.0876145659059344e-9);
    const double cos_all = $FMA($FMA(cos_high, square, cos_middle), square, cos_low);
    *s = y + $FMA(y * z, sin_all, tail * (1.0 - half));
    const double leading = 1.0 - half;
    const double lost = (1.0 - leading) - half;
    *c = leading + (lost + $FMS(square, cos_all, y * tail));
}

/* Sine and cosine of an angle of at most 2^20 rad, each within one unit in the last place. There are
   no branches, so that compilers can compute several angles in vector registers. */
static inline void @angle(double x, double *s, double *c)
{
    const int32_t turns = (int32_t)(x * 0.6366197723675814 + (x < 0.0 ? -0.5 : 0.5));
    const double quarters = (double)turns;
    /* y + tail = x - quarters * pi / 2, which is given in four parts (Cody and Waite, 1980) */
    const double first = x - quarters * 1.5707963267341256;
    const double b2 = -(quarters * 6.077100506303966e-11);
    const double second = first + b2;
    const double from_b2 = second - first;
    const double error_2 = (first - (second - from_b2)) + (b2 - from_b2);
    const double b3 = -(quarters * 2.0222662487111665e-21);
    const double third = second + b3;
    const double from_b3 = third - second;
    const double error_3 = (second - (third - from_b3)) + (b3 - from_b3);
    const double rest = (error_2 + error_3) - quarters * 8.4784276603689e-32;
    const double y = third + rest;
    const double tail = (third - y) + rest;
    double sine, cosine;
    @near(y, tail, &sine, &cosine);
    const double turned_s = (turns & 1) ? cosine : sine;
    const double turned_c = (turns & 1) ? sine : cosine;
    *s = (turns & 2) ? -turned_s : turned_s;
    *c = ((turns + 1) & 2) ? -turned_c : turned_c;
}

/* The same for any angle; the C library's beyond 2^20 rad. */
#if defined(__GNUC__)
__attribute__((cold, noinline))
#endif
static void @any_angle(double x, double *s, double *c)
{
    if (x > -1048576.0 && x < 1048576.0) {
        @angle(x, s, c);
    } else {
        *s = sin(x);
        *c = cos(x);
    }
}

#if defined($FUSES) && !defined(__FAST_MATH__)
/* The same where products and sums are fused, by a shorter reduction; 0 where the angle is beyond
   2^20 rad, or too close to a multiple of a quarter turn for it. Bits of a sum say which quarter turn
   it is. */
static inline uint64_t @angle_fused(double x, double *s, double *c)
{
    union { double number; uint64_t bits; } shifted, sine, cosine;
    shifted.number = $FMA(x, 0.6366197723675814, 6755399441055744.0);
    const double quarters = shifted.number - 6755399441055744.0;
    const double first = $FNMA(quarters, 1.5707963267948966, x);
    const double y = $FNMA(quarters, 6.123233995736766e-17, first);
    const double tail = $FNMA(quarters, 6.123233995736766e-17, first - y);
    @near(y, tail, &sine.number, &cosine.number);
    const uint64_t turns = shifted.bits;
    const uint64_t exchanged = (sine.bits ^ cosine.bits) & (0u - (turns & 1u));
    sine.bits = (sine.bits ^ exchanged) ^ ((turns & 2u) << 62);
    cosine.bits = (cosine.bits ^ exchanged) ^ (((turns + 1u) & 2u) << 62);
    *s = sine.number;
    *c = cosine.number;
    /* the bounds are squares, of 2^-24 and 2^20 */
    return (uint64_t)(((y * y >= 3.552713678800501e-15) | (quarters == 0.0)) & (x * x < 1099511627776.0));
}
#endif
";

/// One angle.
pub(super) const SIN_COS: &str = r"
/* Sine and cosine. */
static inline void @sin_cos(double x, double *s, double *c)
{
#if defined($FUSES) && !defined(__FAST_MATH__)
    if (!@angle_fused(x, s, c)) {
        @any_angle(x, s, c);
    }
#else
    if (x > -1048576.0 && x < 1048576.0) {
        @angle(x, s, c);
    } else {
        @any_angle(x, s, c);
    }
#endif
}
";

/// Four angles. The function is always inlined: a call would pass the angles in memory, stored one by
/// one, and a vector register could be loaded only after all stores are done.
pub(super) const SIN_COS_LANES: &str = r"
/* Sines and cosines of four angles. */
#if defined($FUSES) && !defined(__FAST_MATH__)
__attribute__((always_inline))
#endif
static inline void @sin_cos_lanes(const double *RESTRICT x, double *RESTRICT s, double *RESTRICT c)
{
#if defined($FUSES) && !defined(__FAST_MATH__)
    uint64_t done = 1;
    for (int i = 0; i < 4; i++) {
        done &= @angle_fused(x[i], s + i, c + i);
    }
#else
    int done = 1;
    for (int i = 0; i < 4; i++) {
        done &= (x[i] > -1048576.0) & (x[i] < 1048576.0);
    }
    for (int i = 0; i < 4 && done; i++) {
        @angle(x[i], s + i, c + i);
    }
#endif
    for (int i = 0; i < 4 && !done; i++) {
        @any_angle(x[i], s + i, c + i);
    }
}
";
