//! The helpers that emitted C functions call: the C counterparts of the runtime's linear solve and
//! of its sines and cosines, with the same bounds and the same order of operations.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::fmt::Write as _;

use super::angles::{ANGLE, SIN_COS, SIN_COS_LANES};
use super::statements::Precision;

/// A static function of a robot's C file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Helper {
    /// The macros of fused products.
    Fused,
    /// The absolute value.
    Size,
    /// The smaller of two numbers.
    Smaller,
    /// Zero for finite numbers.
    Finite,
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
        let takes_angles = self.has(Helper::SinCos) || self.has(Helper::SinCosLanes);
        let mut out = String::new();
        if takes_angles || self.has(Helper::Fused) {
            out.push_str(Helper::Fused.template());
        }
        if takes_angles {
            out.push_str(ANGLE);
        }
        let called = self.0.borrow();
        for helper in called.iter().filter(|h| **h != Helper::Fused) {
            out.push_str(helper.template());
        }
        spelled(&out, prefix, precision)
    }
}

impl Helper {
    /// The function's name.
    pub(super) fn name(self, prefix: &str, precision: Precision) -> String {
        let name = match self {
            Helper::Fused => "fma",
            Helper::Size => "size_of",
            Helper::Smaller => "smaller",
            Helper::Finite => "zero_if_finite",
            Helper::Sign => "sign_of",
            Helper::SinCos => "sin_cos",
            Helper::SinCosLanes => "sin_cos_lanes",
            Helper::SolvePivoted => "solve_pivoted",
        };
        format!("{prefix}_{name}{}", precision.suffix())
    }

    fn template(self) -> &'static str {
        match self {
            Helper::Fused => FUSED,
            Helper::Size => SIZE,
            Helper::Smaller => SMALLER,
            Helper::Finite => FINITE,
            Helper::Sign => SIGN,
            Helper::SinCos => SIN_COS,
            Helper::SinCosLanes => SIN_COS_LANES,
            Helper::SolvePivoted => SOLVE_PIVOTED,
        }
    }
}

/// A template with names and types: `@name` is a helper, `$NAME` a macro, `REAL` the type, `#` before
/// digits marks a number of that type, and `RESTRICT` is the header's macro.
pub(super) fn spelled(template: &str, prefix: &str, precision: Precision) -> String {
    // before names of the robot are in it, which may contain these words
    let restrict = format!("{}_RESTRICT", prefix.to_ascii_uppercase());
    let template = template
        .replace("REAL", precision.type_name())
        .replace("FLOATS", &precision.library_suffix().to_ascii_uppercase())
        .replace("FMAS", &format!("fma{}", precision.library_suffix()))
        .replace("RESTRICT", &restrict);
    let mut out = String::new();
    let mut rest = template.as_str();
    while let Some(at) = rest.find(['@', '$', '#']) {
        let (before, marked) = rest.split_at(at);
        out.push_str(before);
        let (mark, word) = marked.split_at(1);
        let end = word.find(|c: char| !(c.is_ascii_alphanumeric() || c == '_' || c == '.'));
        let (word, after) = word.split_at(end.unwrap_or(word.len()));
        match (mark, word.parse::<f64>()) {
            ("@", _) => {
                let _ = write!(out, "{prefix}_{word}{}", precision.suffix());
            }
            ("$", _) => out.push_str(&macro_name(prefix, word, precision)),
            (_, Ok(value)) => out.push_str(&precision.literal(value)),
            (_, Err(_)) => {
                let _ = write!(out, "#{word}");
            }
        }
        rest = after;
    }
    out.push_str(rest);
    out
}

/// The name of a macro of the C file.
pub(super) fn macro_name(prefix: &str, word: &str, precision: Precision) -> String {
    let prefix = prefix.to_ascii_uppercase();
    format!("{prefix}_{word}{}", precision.suffix().to_ascii_uppercase())
}

/// Fused products wherever a program has them. ISO C lets a compiler fuse none, and GNU C any, so that
/// without these macros the flags would decide how fast the functions are, and their last bits.
/// Clang says by `__FMA__` alone that an x86 processor fuses.
const FUSED: &str = r"
/* a b + c, c - a b and a b - c, rounded once where the processor computes each by one instruction. */
#if defined(__GNUC__) && (defined(__FP_FAST_FMAFLOATS) || defined(__FMA__))
#define $FUSES
#define $FMA(a, b, c) __builtin_FMAS(a, b, c)
#define $FNMA(a, b, c) __builtin_FMAS(-(a), b, c)
#define $FMS(a, b, c) __builtin_FMAS(a, b, -(c))
#else
#define $FMA(a, b, c) ((a) * (b) + (c))
#define $FNMA(a, b, c) ((c) - (a) * (b))
#define $FMS(a, b, c) ((a) * (b) - (c))
#endif
";

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

const FINITE: &str = r"
/* Zero where all numbers are finite, else NaN. */
static inline REAL @zero_if_finite(const REAL *x, int count)
{
    REAL sum = #0.0;
    for (int k = 0; k < count; k++) {
        sum += x[k];
    }
    return #0.0 * sum;
}
";

const SIGN: &str = r"
/* The sign: -1, 0 or 1. */
static inline REAL @sign_of(REAL x)
{
    return x > #0.0 ? #1.0 : x < #0.0 ? -#1.0 : x;
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_robots_that_are_words_of_templates_stay_names() {
        let template = "static REAL @f(const REAL *RESTRICT x) { return $FMS(x[0], #2.0, FMAS); }";
        for name in ["restrict", "real", "floats", "fmas", "arm"] {
            let upper = name.to_ascii_uppercase();
            let expected = format!(
                "static double {name}_f(const double *{upper}_RESTRICT x) {{ return \
                 {upper}_FMS(x[0], 2.0, fma); }}"
            );
            assert_eq!(spelled(template, name, Precision::Double), expected);
        }
    }
}
