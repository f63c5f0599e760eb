//! Numbers as they are written in logs.

use super::dates;

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

/// Whether an entry is a number, or a date with a time of the day, which has a number too.
pub(super) fn is_one(text: &str, decimal_comma: bool) -> bool {
    of_text(text, decimal_comma).is_some() || dates::nanoseconds(text.as_bytes()).is_some()
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
    while let Some(byte) = entry.get(length) {
        let digit = byte.wrapping_sub(b'0');
        length += 1;
        if digit < 10 {
            digits = digits.wrapping_mul(10).wrapping_add(u64::from(digit));
        } else if *byte == separator {
            length -= 1;
            break;
        } else if point.is_none() && (*byte == b'.' || decimal_comma && *byte == b',') {
            point = Some(length - 1);
            // most decimals are many
            let next = entry.get(length..).and_then(<[u8]>::first_chunk);
            if let Some(eight) = next.and_then(|next| eight_digits(*next)) {
                digits = digits.wrapping_mul(100_000_000).wrapping_add(eight);
                length += 8;
            }
        } else {
            return None;
        }
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

/// The number that eight digits are; `None` if one of them is none.
#[inline]
fn eight_digits(text: [u8; 8]) -> Option<u64> {
    /// The same byte eight times.
    const fn all(byte: u8) -> u64 {
        u64::from_le_bytes([byte; 8])
    }
    // the first digit is in the lowest byte; of a digit, nothing but its value is left
    let bytes = u64::from_le_bytes(text) ^ all(b'0');
    // 10 to 127 reach the highest bit with 118 more, and above that they have it already
    let too_large = bytes | (bytes & all(0x7f)).wrapping_add(all(118));
    if too_large & all(0x80) != 0 {
        return None;
    }
    // pairs of digits in every second byte, then two and four pairs in every fourth
    let pairs = bytes.wrapping_mul(10).wrapping_add(bytes >> 8);
    let (even, odd) = (pairs & 0xff_0000_00ff, (pairs >> 16) & 0xff_0000_00ff);
    let even = even.wrapping_mul(100 + (1_000_000 << 32));
    let odd = odd.wrapping_mul(1 + (10_000 << 32));
    Some(even.wrapping_add(odd) >> 32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn eight_digits_are_their_number_and_any_other_byte_is_none() {
        for number in [0, 1, 12_345_678, 87_654_321, 99_999_999, 90_000_000] {
            let text = format!("{number:08}");
            let mut bytes: [u8; 8] = text.as_bytes().try_into().unwrap();
            assert_eq!(eight_digits(bytes), Some(number));
            for place in 0..8 {
                let own = bytes[place];
                for other in 0..=u8::MAX {
                    bytes[place] = other;
                    assert_eq!(eight_digits(bytes).is_some(), other.is_ascii_digit());
                }
                bytes[place] = own;
            }
        }
    }

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
