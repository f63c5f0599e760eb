//! The helpers that emitted C functions call: the C counterparts of the runtime's linear solve and
//! of its sines and cosines, with the same bounds and the same order of operations.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::fmt::Write as _;

use super::statements::Precision;

/// Number of angles whose sines and cosines are computed together.
pub(super) const LANES: usize = 4;

/// A static function of a robot's C file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Helper {
    /// The absolute value.
    Size,
    /// The smaller of two numbers.
    Smaller,
    /// The sign: -1, 0 or 1.
    Sign,
    /// A sine and a cosine.
    SinCos,
    /// Several sines and cosines.
    SinCosLanes,
    /// The solve with complete pivoting.
    SolvePivoted,
}

/// The helpers that functions of one precision call.
#[derive(Debug, Default)]
pub(super) struct Helpers(RefCell<BTreeSet<Helper>>);

impl Helpers {
    /// Notes that a function calls a helper.
    pub(super) fn call(&self, helper: Helper) {
        self.0.borrow_mut().insert(helper);
    }

    /// Whether a function calls a helper.
    pub(super) fn has(&self, helper: Helper) -> bool {
        self.0.borrow().contains(&helper)
    }

    /// The text of the helpers that were called, for these names and this type.
    pub(super) fn text(&self, prefix: &str, precision: Precision) -> String {
        let mut out = String::new();
        if self.has(Helper::SinCos) || self.has(Helper::SinCosLanes) {
            out.push_str(ANGLE);
        }
        let called = self.0.borrow();
        for helper in called.iter() {
            out.push_str(helper.template());
        }
        spelled(&out, prefix, precision)
    }
}

impl Helper {
    /// The function's name.
    pub(super) fn name(self, prefix: &str, precision: Precision) -> String {
        let name = match self {
            Helper::Size => "size_of",
            Helper::Smaller => "smaller",
            Helper::Sign => "sign_of",
            Helper::SinCos => "sin_cos",
            Helper::SinCosLanes => "sin_cos_lanes",
            Helper::SolvePivoted => "solve_pivoted",
        };
        format!("{prefix}_{name}{}", precision.suffix())
    }

    fn template(self) -> &'static str {
        match self {
            Helper::Size => SIZE,
            Helper::Smaller => SMALLER,
            Helper::Sign => SIGN,
            Helper::SinCos => SIN_COS,
            Helper::SinCosLanes => SIN_COS_LANES,
            Helper::SolvePivoted => SOLVE_PIVOTED,
        }
    }
}

/// A template with names and types: `@name` is a helper, `REAL` the type, `#` before digits marks a
/// number of that type, and `RESTRICT` is the header's macro.
fn spelled(template: &str, prefix: &str, precision: Precision) -> String {
    let mut out = String::new();
    let mut rest = template;
    while let Some(at) = rest.find(['@', '#']) {
        let (before, marked) = rest.split_at(at);
        out.push_str(before);
        let (mark, word) = marked.split_at(1);
        let end = word.find(|c: char| !(c.is_ascii_alphanumeric() || c == '_' || c == '.'));
        let (word, after) = word.split_at(end.unwrap_or(word.len()));
        match (mark, word.parse::<f64>()) {
            ("@", _) => {
                let _ = write!(out, "{prefix}_{word}{}", precision.suffix());
            }
            (_, Ok(value)) => out.push_str(&precision.literal(value)),
            (_, Err(_)) => {
                let _ = write!(out, "#{word}");
            }
        }
        rest = after;
    }
    out.push_str(rest);
    let restrict = format!("{}_RESTRICT", prefix.to_ascii_uppercase());
    out.replace("REAL", precision.type_name())
        .replace("RESTRICT", &restrict)
}

const SIZE: &str = r"
/* The absolute value. */
static inline REAL @size_of(REAL x)
{
    return x < #0.0 ? -x : x;
}
";

const SMALLER: &str = r"
/* The smaller of two numbers; NaN if one of them is NaN. */
static inline REAL @smaller(REAL x, REAL y)
{
    return x < y || x != x ? x : y;
}
";

const SIGN: &str = r"
/* The sign: -1, 0 or 1. */
static inline REAL @sign_of(REAL x)
{
    return x > #0.0 ? #1.0 : x < #0.0 ? -#1.0 : x;
}
";

/// The polynomials and the reductions of the runtime's `scalar/angles.rs`. Only conversions to
/// integers decide which quarter turn an angle is in, so that compilers may reorder sums; the shorter
/// reduction is left out where they may.
const ANGLE: &str = r"
/* Sine and cosine of y + tail, where y is at most a quarter turn's half and tail its rounding error. */
static inline void @near(double y, double tail, double *s, double *c)
{
    const double z = y * y;
    const double square = z * z;
    const double half = z * 0.5;
    const double sin_low = 0.00833333333333094 * z + -0.16666666666666666;
    const double sin_middle = 2.755731609787775e-6 * z + -0.0001984126983674956;
    const double sin_high = 1.591805913698281e-10 * z + -2.5051130870968297e-8;
    const double sin_all = (sin_high * square + sin_middle) * square + sin_low;
    const double cos_low = -0.0013888888888887393 * z + 0.041666666666666664;
    const double cos_middle = -2.755731726880539e-7 * z + 2.4801587298760048e-5;
    const double cos_high = -1.1382588535352526e-11 * z + 2.0876145659059344e-9;
    const double cos_all = (cos_high * square + cos_middle) * square + cos_low;
    *s = y + (y * z * sin_all + tail * (1.0 - half));
    const double leading = 1.0 - half;
    const double lost = (1.0 - leading) - half;
    *c = leading + (lost + (square * cos_all + -(y * tail)));
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

#if defined(__GNUC__) && defined(__FP_FAST_FMA) && !defined(__FAST_MATH__)
/* The same where products and sums are fused, by a shorter reduction; 0 where the angle is too close
   to a multiple of a quarter turn for it. Bits of a sum say which quarter turn it is. */
static inline uint64_t @angle_fused(double x, double *s, double *c)
{
    union { double number; uint64_t bits; } shifted, sine, cosine;
    shifted.number = __builtin_fma(x, 0.6366197723675814, 6755399441055744.0);
    const double quarters = shifted.number - 6755399441055744.0;
    const double first = __builtin_fma(-quarters, 1.5707963267948966, x);
    const double y = __builtin_fma(-quarters, 6.123233995736766e-17, first);
    const double tail = __builtin_fma(-quarters, 6.123233995736766e-17, first - y);
    @near(y, tail, &sine.number, &cosine.number);
    const uint64_t turns = shifted.bits;
    const uint64_t exchanged = (sine.bits ^ cosine.bits) & (0u - (turns & 1u));
    sine.bits = (sine.bits ^ exchanged) ^ ((turns & 2u) << 62);
    cosine.bits = (cosine.bits ^ exchanged) ^ (((turns + 1u) & 2u) << 62);
    *s = sine.number;
    *c = cosine.number;
    return (uint64_t)((y >= 5.960464477539063e-8) | (y <= -5.960464477539063e-8) | (x == 0.0));
}
#endif
";

const SIN_COS: &str = r"
/* Sine and cosine; the C library's for angles beyond 2^20 rad. */
static inline void @sin_cos(double x, double *s, double *c)
{
    if (x > -1048576.0 && x < 1048576.0) {
#if defined(__GNUC__) && defined(__FP_FAST_FMA) && !defined(__FAST_MATH__)
        if (@angle_fused(x, s, c)) {
            return;
        }
#endif
        @angle(x, s, c);
    } else {
        *s = sin(x);
        *c = cos(x);
    }
}
";

const SIN_COS_LANES: &str = r"
/* Sines and cosines of four angles; the C library's if one is beyond 2^20 rad. */
static inline void @sin_cos_lanes(const double *RESTRICT x, double *RESTRICT s, double *RESTRICT c)
{
    int within = 1;
    for (int i = 0; i < 4; i++) {
        within &= (x[i] > -1048576.0) & (x[i] < 1048576.0);
    }
    if (within) {
        uint64_t done = 0;
#if defined(__GNUC__) && defined(__FP_FAST_FMA) && !defined(__FAST_MATH__)
        done = 1;
        for (int i = 0; i < 4; i++) {
            done &= @angle_fused(x[i], s + i, c + i);
        }
#endif
        for (int i = 0; i < 4 && !done; i++) {
            @angle(x[i], s + i, c + i);
        }
    } else {
        for (int i = 0; i < 4; i++) {
            s[i] = sin(x[i]);
            c[i] = cos(x[i]);
        }
    }
}
";

const SOLVE_PIVOTED: &str = r"
/* The largest absolute value of the entries of a row from `first` on. */
static inline REAL @row_size(const REAL *row, int first, int count)
{
    REAL largest = #0.0;
    for (int j = first; j < count; j++) {
        const REAL size = @size_of(row[j]);
        largest = largest < size ? size : largest;
    }
    return largest;
}

/* Turns the sizes of rows or columns into divisors: none below 1/1024 of the largest, none zero. */
static void @bound(REAL *sizes, int count)
{
    const REAL smallest = @row_size(sizes, 0, count) * #0.0009765625;
    for (int i = 0; i < count; i++) {
        const REAL divisor = sizes[i] < smallest ? smallest : sizes[i];
        sizes[i] = #0.0 < divisor ? divisor : #1.0;
    }
}

static inline void @exchange(REAL *p, REAL *q)
{
    const REAL old = *p;
    *p = *q;
    *q = old;
}

/* Solves a x = b with complete pivoting: `a` has `rows` rows of `unknowns` coefficients, `b` as many
   rows of `sides`, and `x` one row for each unknown. Changes a and b. `scales` has rows + unknowns
   entries, `order` one for each unknown. Returns the ratio of the smallest to the largest pivot, 0
   where a is singular, NaN where a or b is not finite. */
#if defined(__GNUC__)
__attribute__((cold, noinline))
#endif
static REAL @solve_pivoted(int rows, int unknowns, int sides, REAL *a, REAL *b, REAL *x, REAL *scales,
                           int *order)
{
    REAL *row_scale = scales, *column_scale = scales + rows;
    REAL poison = #0.0, smallest = #0.0, largest = #0.0;
    for (int i = 0; i < rows * unknowns; i++) {
        poison += a[i] * #0.0;
    }
    for (int i = 0; i < rows * sides; i++) {
        poison += b[i] * #0.0;
    }
    for (int i = 0; i < rows; i++) {
        row_scale[i] = @row_size(a + i * unknowns, 0, unknowns);
    }
    @bound(row_scale, rows);
    for (int i = 0; i < rows; i++) {
        for (int j = 0; j < unknowns; j++) {
            a[i * unknowns + j] /= row_scale[i];
        }
        for (int j = 0; j < sides; j++) {
            b[i * sides + j] /= row_scale[i];
        }
    }
    for (int j = 0; j < unknowns; j++) {
        column_scale[j] = #0.0;
        for (int i = 0; i < rows; i++) {
            const REAL size = @size_of(a[i * unknowns + j]);
            column_scale[j] = column_scale[j] < size ? size : column_scale[j];
        }
        order[j] = j;
    }
    @bound(column_scale, unknowns);
    for (int i = 0; i < rows; i++) {
        for (int j = 0; j < unknowns; j++) {
            a[i * unknowns + j] /= column_scale[j];
        }
    }
    for (int k = 0; k < unknowns; k++) {
        REAL *top = a + k * unknowns, *top_side = b + k * sides;
        /* the row with the largest entry comes to the top, then that entry to column k */
        for (int i = k + 1; i < rows; i++) {
            if (@row_size(top, k, unknowns) < @row_size(a + i * unknowns, k, unknowns)) {
                for (int j = 0; j < unknowns; j++) {
                    @exchange(top + j, a + i * unknowns + j);
                }
                for (int j = 0; j < sides; j++) {
                    @exchange(top_side + j, b + i * sides + j);
                }
                @exchange(row_scale + k, row_scale + i);
            }
        }
        for (int j = k + 1; j < unknowns; j++) {
            if (@size_of(top[k]) < @size_of(top[j])) {
                const int old = order[k];
                order[k] = order[j];
                order[j] = old;
                @exchange(column_scale + k, column_scale + j);
                for (int i = 0; i < rows; i++) {
                    @exchange(a + i * unknowns + k, a + i * unknowns + j);
                }
            }
        }
        for (int i = k + 1; i < rows; i++) {
            const REAL factor = a[i * unknowns + k] / top[k];
            for (int j = k; j < unknowns; j++) {
                a[i * unknowns + j] -= factor * top[j];
            }
            for (int j = 0; j < sides; j++) {
                b[i * sides + j] -= factor * top_side[j];
            }
        }
    }
    for (int k = 0; k < unknowns; k++) {
        const REAL size = @size_of(a[k * unknowns + k] * row_scale[k] * column_scale[k]);
        smallest = k == 0 || size < smallest ? size : smallest;
        largest = k == 0 || largest < size ? size : largest;
    }
    for (int k = unknowns - 1; k >= 0; k--) {
        for (int side = 0; side < sides; side++) {
            REAL value = b[k * sides + side];
            for (int j = k + 1; j < unknowns; j++) {
                value -= a[k * unknowns + j] * b[j * sides + side];
            }
            value /= a[k * unknowns + k];
            b[k * sides + side] = value;
            x[order[k] * sides + side] = value / column_scale[k] + poison;
        }
    }
    return (#0.0 < largest ? smallest / largest : #0.0) + poison;
}
";
