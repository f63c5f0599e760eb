//! Quotients, square roots, sines and cosines.

use std::sync::OnceLock;

use crate::sym::Number;

use super::Float320;

/// Newton steps that refine the 53 bits of an `f64` to more than 320.
const NEWTON_STEPS: usize = 3;
/// Number of times an angle is halved before its series is summed.
const HALVINGS: i32 = 8;
/// Terms of the series: for arguments below 2^-8 the first omitted term is below 2^-370.
const TERMS: usize = 15;

/// Constants for sine and cosine.
struct Constants {
    half_pi: Float320,
    /// 2/pi.
    quarters_per_rad: Float320,
    /// 1/n! for even n from 2, signs alternating from minus.
    even: [Float320; TERMS],
    /// 1/n! for odd n from 3, signs alternating from minus.
    odd: [Float320; TERMS],
}

fn constants() -> &'static Constants {
    static CONSTANTS: OnceLock<Constants> = OnceLock::new();
    CONSTANTS.get_or_init(|| {
        let half_pi = Float320::from_number(&Number::pi()).scaled(-1);
        let mut even = [Float320::ZERO; TERMS];
        let mut odd = [Float320::ZERO; TERMS];
        let mut inverse = Float320::ONE;
        for k in 0..TERMS {
            let n = 2.0 * k as f64 + 2.0;
            for (entry, divisor) in [(&mut even[k], n), (&mut odd[k], n + 1.0)] {
                let quotient = inverse.checked_div(Float320::from_f64(divisor));
                inverse = quotient.unwrap_or(Float320::ZERO);
                *entry = if k % 2 == 0 { -inverse } else { inverse };
            }
        }
        Constants {
            half_pi,
            quarters_per_rad: half_pi.reciprocal().unwrap_or(Float320::ZERO),
            even,
            odd,
        }
    })
}

impl Float320 {
    /// `1 / self`; `None` if `self` is 0.
    pub fn reciprocal(self) -> Option<Float320> {
        if self.is_zero() {
            return None;
        }
        // the reciprocal of the mantissa, which an f64 can hold whatever the exponent
        let mantissa = self.abs().scaled(-self.exponent);
        let mut y = Float320::from_f64(1.0 / mantissa.to_f64());
        for _ in 0..NEWTON_STEPS {
            y = y + y * (Float320::ONE - mantissa * y);
        }
        let y = y.scaled(-self.exponent);
        Some(if self.negative { -y } else { y })
    }

    /// `self / divisor`; `None` if the divisor is 0.
    pub fn checked_div(self, divisor: Float320) -> Option<Float320> {
        let y = divisor.reciprocal()?;
        let quotient = self * y;
        Some(quotient + y * (self - divisor * quotient))
    }

    /// The square root; `None` for a negative value.
    pub fn sqrt(self) -> Option<Float320> {
        if self.is_zero() {
            return Some(Float320::ZERO);
        }
        if self.negative {
            return None;
        }
        let half = self.exponent.div_euclid(2);
        let x = self.scaled(-2 * half);
        let mut y = Float320::from_f64(1.0 / libm::sqrt(x.to_f64()));
        for _ in 0..NEWTON_STEPS {
            y = y + (y * (Float320::ONE - x * y * y)).scaled(-1);
        }
        let root = x * y;
        let root = root + ((x - root * root) * y).scaled(-1);
        Some(root.scaled(half))
    }

    /// Sine and cosine of an angle in rad, with an absolute error of about 2^-315.
    pub fn sin_cos(self) -> (Float320, Float320) {
        let constants = constants();
        let mut quadrant = 0u8;
        let mut rest = self;
        // one pass is enough, unless the angle is so large that an f64 cannot count its quarter
        // turns
        for _ in 0..8 {
            let turns = libm::round((rest * constants.quarters_per_rad).to_f64());
            if turns == 0.0 {
                break;
            }
            let in_four = turns - 4.0 * libm::floor(turns / 4.0);
            quadrant += [0, 1, 2, 3]
                .into_iter()
                .find(|k| f64::from(*k) >= in_four)
                .unwrap_or(0);
            rest = rest - constants.half_pi * Float320::from_f64(turns);
        }
        let (sine, cosine) = near_zero(rest, constants);
        match quadrant % 4 {
            0 => (sine, cosine),
            1 => (cosine, -sine),
            2 => (-sine, -cosine),
            _ => (-cosine, sine),
        }
    }
}

/// Sine and cosine of a small angle: the series of the angle, halved several times, then doubled
/// back.
fn near_zero(angle: Float320, constants: &Constants) -> (Float320, Float320) {
    let x = angle.scaled(-HALVINGS);
    let square = x * x;
    let series = |coefficients: &[Float320; TERMS]| {
        let start = Float320::ZERO;
        let sum = coefficients.iter().rev();
        sum.fold(start, |sum, c| (sum + *c) * square)
    };
    let mut sine = x + x * series(&constants.odd);
    // 1 - cos, whose relative precision survives the doubling
    let mut versine = -series(&constants.even);
    for _ in 0..HALVINGS {
        let cosine = Float320::ONE - versine;
        versine = (sine * sine).scaled(1);
        sine = (sine * cosine).scaled(1);
    }
    (sine, Float320::ONE - versine)
}
