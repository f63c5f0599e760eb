//! Numbers as they are written in logs.

/// The powers of ten that are exact in double precision.
const POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16,
    1e17, 1e18, 1e19, 1e20, 1e21, 1e22,
];
/// Every whole number below this is exact in double precision.
const EXACT: u64 = 1 << 53;

/// The number, finite or not, that an entry of a table is, with a point or a comma before its
/// decimals; `None` if it is no number. The nearest double, as [`str::parse`] has it.
pub(super) fn of_bytes(entry: &[u8], decimal_comma: bool) -> Option<f64> {
    let text = core::str::from_utf8(entry).ok()?;
    of_text(text.trim(), decimal_comma)
}

/// As [`of_bytes`], of a text without spaces at its ends.
pub(super) fn of_text(text: &str, decimal_comma: bool) -> Option<f64> {
    if decimal_comma && text.contains(',') {
        text.replacen(',', ".", 1).parse().ok()
    } else {
        text.parse().ok()
    }
}

/// The number at the start of a line up to the next separator or its end, and the number of bytes
/// that it takes; `None` unless it is a number of a few digits without an exponent, as nearly all
/// are. Its digits are a whole number over a power of ten: both are exact, so that the quotient is
/// the nearest double.
#[inline]
pub(super) fn leading(line: &[u8], separator: u8, decimal_comma: bool) -> Option<(f64, usize)> {
    let (negative, entry) = match line {
        [b'-', rest @ ..] => (true, rest),
        _ => (false, line),
    };
    let mut digits = 0_u64;
    let mut point = None;
    let mut length = 0;
    for byte in entry {
        let digit = byte.wrapping_sub(b'0');
        if digit < 10 {
            digits = digits.wrapping_mul(10).wrapping_add(u64::from(digit));
        } else if *byte == separator {
            break;
        } else if point.is_none() && (*byte == b'.' || decimal_comma && *byte == b',') {
            point = Some(length);
        } else {
            return None;
        }
        length += 1;
    }
    let decimals = point.map_or(0, |point| length - 1 - point);
    // with one point at most, numbers of so few bytes do not overflow; a point alone is no number
    let few = length <= 19 && length > usize::from(point.is_some());
    if !few || digits >= EXACT {
        return None;
    }
    let size = digits as f64 / POWERS.get(decimals)?;
    let value = if negative { -size } else { size };
    Some((value, length + usize::from(negative)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Entries near to numbers: signs, digits, points, commas, exponents and spaces in any order.
        #[test]
        fn a_number_that_is_read_at_once_is_what_the_standard_library_reads(text in "[-+]?[ 0-9.,e-]{0,21}", comma: bool) {
            if let Some((value, length)) = leading(text.as_bytes(), b';', comma) {
                prop_assert_eq!(length, text.len());
                prop_assert_eq!(Some(value.to_bits()), of_text(&text, comma).map(f64::to_bits));
            }
            let before_another = format!("{text};1");
            let same = leading(before_another.as_bytes(), b';', comma);
            prop_assert_eq!(same, leading(text.as_bytes(), b';', comma));
        }

        #[test]
        fn a_decimal_number_is_read_to_the_nearest_double(
            digits in 0_u64..1 << 56, decimals in 0_usize..18, negative: bool
        ) {
            let sign = if negative { "-" } else { "" };
            let digits = format!("{digits:0>width$}", width = decimals + 1);
            let (whole, part) = digits.split_at(digits.len() - decimals);
            let text = format!("{sign}{whole}.{part}");
            let expected: f64 = text.parse().unwrap();
            let found = leading(text.as_bytes(), b'\t', false);
            // 2^53 has 16 digits
            prop_assert!(found.is_some() || text.len() > 16);
            prop_assert!(found.is_none_or(|found| found == (expected, text.len())));
            let with_comma = text.replace('.', ",");
            prop_assert_eq!(leading(with_comma.as_bytes(), b'\t', true), found);
            prop_assert_eq!(of_bytes(with_comma.as_bytes(), true), Some(expected));
        }
    }

    #[test]
    fn what_is_no_number_is_none() {
        for text in [
            "",
            "-",
            ".",
            "-.",
            "1.2.3",
            "1,5",
            "a",
            "--1",
            "\u{2212}1",
            "1e",
        ] {
            assert_eq!(of_bytes(text.as_bytes(), false), None, "{text}");
            assert_eq!(leading(text.as_bytes(), b';', false), None, "{text}");
        }
        assert!(of_bytes(b"nan", false).is_some_and(f64::is_nan));
    }
}
