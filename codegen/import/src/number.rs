//! Recognition of printed multiples of pi in files, and formatting of numbers and angles for specs.

use std::f64::consts::PI;

/// The divisors of the multiples of pi that are recognised, each with the least number of printed
/// decimals: the finer the multiples, the more digits must agree to exclude a coincidence.
const PRINTED_MULTIPLES: [(u32, i32); 6] = [(1, 2), (2, 2), (3, 4), (4, 4), (6, 4), (12, 5)];

/// The tolerance for angles printed with many decimals, rad: some tools compute angles with errors
/// of this size.
const PRINTED_TOLERANCE_RAD: f64 = 1e-9;

/// Tolerance in rad for computed angles.
const COMPUTED_TOLERANCE_RAD: f64 = 1e-12;

/// The multiple of pi that was rounded or truncated to a printed number, such as pi/2 for 1.57,
/// 1.5708 and 1.570796; `None` if there is none.
pub(crate) fn printed_multiple(text: &str) -> Option<f64> {
    let value: f64 = text.trim().parse().ok()?;
    let decimals = decimals(text.trim())?;
    let unit = libm::pow(10.0, -f64::from(decimals));
    PRINTED_MULTIPLES
        .iter()
        .filter(|(_, needed)| decimals >= *needed)
        .find_map(|&(n, _)| {
            let k = libm::round(value * f64::from(n) / PI);
            let exact = k * PI / f64::from(n);
            let near = (value - exact).abs() <= unit.max(PRINTED_TOLERANCE_RAD);
            (k != 0.0 && k.abs() <= 4.0 * f64::from(n) && near).then_some(exact)
        })
}

/// Number of decimals of a printed number.
fn decimals(text: &str) -> Option<i32> {
    let (mantissa, exponent) = text.split_once(['e', 'E']).unwrap_or((text, "0"));
    let fraction = mantissa.split_once('.').map_or("", |(_, f)| f);
    let places = i32::try_from(fraction.len()).ok()?;
    places.checked_sub(exponent.parse().ok()?)
}

/// Formats a number for a spec: the shortest decimal that gives the same number, without trailing
/// digits of a rounding error.
pub(crate) fn number(x: f64) -> String {
    let shortest = shortest_decimal(x);
    let rounded = shortest_decimal(format!("{x:.14e}").parse().unwrap_or(x));
    // a number that rounding shortens by three digits had a rounding error; others keep all digits
    if rounded.len() + 3 <= shortest.len() {
        rounded
    } else {
        shortest
    }
}

fn shortest_decimal(x: f64) -> String {
    if x == 0.0 {
        "0".to_owned()
    } else if (1e-4..1e7).contains(&x.abs()) {
        format!("{x}")
    } else {
        format!("{x:e}")
    }
}

/// A computed number, rounded to `digits` digits relative to the largest number that it was
/// computed from.
pub(crate) fn rounded(x: f64, largest: f64, digits: i32) -> f64 {
    let size = largest.abs();
    if x == 0.0 || size == 0.0 || !size.is_finite() {
        return x;
    }
    let last = libm::floor(libm::log10(size)) as i32 - digits;
    let places = usize::try_from(-last).unwrap_or(0);
    format!("{x:.places$}").parse().unwrap_or(x)
}

/// Tolerance in rad for angles whose printed digits count: four roundings of a half turn.
const EXACT_TOLERANCE_RAD: f64 = 1.8e-15;

/// Numerator and denominator of the multiple of pi that an angle (rad) equals up to a tolerance.
fn multiple(angle: f64, tolerance: f64) -> Option<(i64, i64)> {
    (1..=12_i64).find_map(|n| {
        let k = libm::round(angle * n as f64 / PI);
        let near = (angle - k * PI / n as f64).abs() <= tolerance;
        (near && k.abs() <= 48.0).then_some((k as i64, n))
    })
}

/// Formats an angle (rad) for a spec: `0`, `-pi/2`, `2*pi/3`, or a number.
pub(crate) fn angle(x: f64) -> String {
    angle_within(x, COMPUTED_TOLERANCE_RAD)
}

/// As [`angle`]; a multiple of pi only where the number agrees with it in all of its digits.
pub(crate) fn exact_angle(x: f64) -> String {
    angle_within(x, EXACT_TOLERANCE_RAD)
}

fn angle_within(x: f64, tolerance: f64) -> String {
    match multiple(x, tolerance) {
        Some((0, _)) => "0".to_owned(),
        Some((k, n)) => {
            let sign = if k < 0 { "-" } else { "" };
            let factor = match k.abs() {
                1 => String::new(),
                k => format!("{k}*"),
            };
            let divisor = if n == 1 {
                String::new()
            } else {
                format!("/{n}")
            };
            format!("{sign}{factor}pi{divisor}")
        }
        None => number(x),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn printed_multiples_are_told_from_other_numbers() {
        for (text, expected) in [
            ("1.57", Some(PI / 2.0)),
            ("1.5708", Some(PI / 2.0)),
            ("1.5707", Some(PI / 2.0)),
            ("-3.14159", Some(-PI)),
            ("3.1416", Some(PI)),
            ("0.7854", Some(PI / 4.0)),
            ("2.0944", Some(2.0 * PI / 3.0)),
            ("0.261799", Some(PI / 12.0)),
            ("157.0796e-2", Some(PI / 2.0)),
            ("0", None),
            ("1.5", None),
            ("1.6", None),
            ("1.5702", None),
            ("0.79", None),
            ("0.262", None),
            ("0.524", None),
            ("3", None),
            ("no", None),
        ] {
            assert_eq!(printed_multiple(text), expected, "{text}");
        }
    }

    #[test]
    fn numbers_lose_rounding_errors_and_nothing_else() {
        for (x, text) in [
            (0.1 + 0.2, "0.3"),
            (0.133_885_781_862_332_5, "0.1338857818623325"),
            (-0.0, "0"),
            (1.352e-21, "1.352e-21"),
            (0.163, "0.163"),
            (2.5e8, "2.5e8"),
        ] {
            assert_eq!(number(x), text);
        }
    }

    #[test]
    fn figures_are_rounded_beside_their_largest() {
        assert_eq!(
            rounded(0.123_456_789_012_345, 1.0, 12).to_string(),
            "0.123456789012"
        );
        assert_eq!(rounded(1e-14, 1.0, 12), 0.0);
        assert_eq!(rounded(1e-14, 1e-10, 12), 1e-14);
    }

    #[test]
    fn angles_are_multiples_of_pi_where_they_are() {
        for (x, text) in [
            (PI / 2.0, "pi/2"),
            (-PI, "-pi"),
            (2.0 * PI / 3.0, "2*pi/3"),
            (-5.0 * PI / 12.0, "-5*pi/12"),
            (0.3, "0.3"),
            (1e-14, "0"),
            (1.570_9, "1.5709"),
        ] {
            assert_eq!(angle(x), text);
        }
        for (x, text) in [
            (PI / 2.0, "pi/2"),
            (2.094_395_102_4, "2.0943951024"),
            (0.628_318_530_718, "0.628318530718"),
            (1e-14, "1e-14"),
        ] {
            assert_eq!(exact_angle(x), text);
        }
    }
}
