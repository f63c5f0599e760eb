//! Numbers that are roots, multiples of pi or fractions, as such.

/// What multiplies a fraction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Irrational {
    None,
    /// The square root of a number.
    Root(u32),
    Pi,
}

impl Irrational {
    const ALL: [Irrational; 7] = [
        Irrational::None,
        Irrational::Root(3),
        Irrational::Root(2),
        Irrational::Root(6),
        Irrational::Root(5),
        Irrational::Root(7),
        Irrational::Pi,
    ];

    fn value(self) -> f64 {
        match self {
            Irrational::None => 1.0,
            Irrational::Root(number) => f64::from(number).sqrt(),
            Irrational::Pi => core::f64::consts::PI,
        }
    }
}

/// The largest denominator.
const MAX_DENOMINATOR: u32 = 24;
/// The largest numerator.
const MAX_NUMERATOR: f64 = 99.0;
/// A number of at most so many digits is left as it is.
const SHORT: usize = 8;

/// A number as a fraction: numerator, an irrational factor, and denominator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Form {
    /// A short decimal, such as 9.81, or an integer.
    pub(crate) above: f64,
    pub(crate) irrational: Irrational,
    pub(crate) below: u32,
}

/// How a number that is not negative is written as a fraction, with a root or pi; `None` where its digits say it better.
pub(crate) fn form(value: f64) -> Option<Form> {
    if !value.is_finite() || super::plain::digits(value).len() <= SHORT {
        return None;
    }
    let forms = |scale: f64| {
        (1..=MAX_DENOMINATOR).flat_map(move |below| {
            Irrational::ALL.into_iter().filter_map(move |irrational| {
                let known = irrational.value() / f64::from(below);
                let above = (value / known * scale).round() / scale;
                let is_near = (above * known - value).abs() <= 4.0 * f64::EPSILON * value;
                let found = is_near && above > 0.0 && above <= MAX_NUMERATOR;
                found.then_some(Form {
                    above,
                    irrational,
                    below,
                })
            })
        })
    };
    let integer = forms(1.0).next();
    // a decimal over a number is no shorter than its digits, but with a root it is
    let decimals = forms(10_000.0).filter(|form| matches!(form.irrational, Irrational::Root(_)));
    // 0.1521 sqrt(3) rather than 1.521 sqrt(3)/10
    let length = |form: &Form| {
        let far = if form.below < 10 { 0 } else { 3 };
        super::plain::digits(form.above).len() + far
    };
    integer.or_else(|| decimals.min_by_key(|form| (length(form), form.below)))
}

#[cfg(test)]
mod tests {
    use super::{Form, Irrational, form};

    #[test]
    fn roots_and_fractions_are_recognised_and_other_numbers_left() {
        let is = |above: f64, irrational: Irrational, below: u32| {
            Some(Form {
                above,
                irrational,
                below,
            })
        };
        let root = Irrational::Root;
        assert_eq!(
            form(core::f64::consts::FRAC_PI_3),
            is(1.0, Irrational::Pi, 3)
        );
        assert_eq!(form(6.0_f64.sqrt() / 4.0), is(1.0, root(6), 4));
        assert_eq!(form(3.0_f64.sqrt() / 2.0), is(1.0, root(3), 2));
        assert_eq!(form(2.0 / 3.0), is(2.0, Irrational::None, 3));
        assert_eq!(form(9.81 * 2.0_f64.sqrt() / 2.0), is(9.81, root(2), 2));
        assert_eq!(form(0.4563 / 3.0_f64.sqrt()), is(0.1521, root(3), 1));
        for other in [
            0.25,
            0.3,
            9.81,
            0.4563,
            1.234_567_89,
            0.564_642_473_395_035_4,
        ] {
            assert_eq!(form(other), None, "{other}");
        }
    }
}
