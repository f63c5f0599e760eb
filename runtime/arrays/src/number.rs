//! How numbers are stored.

use crate::error::{Read, broken};

/// The kind of a stored number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Float,
    Signed,
    Unsigned,
}

/// How one number is stored: a float of 2, 4 or 8 bytes, or an integer of 1 to 8.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Stored {
    pub(crate) kind: Kind,
    pub(crate) size: usize,
    /// Whether the most significant byte is first.
    pub(crate) big: bool,
}

impl Stored {
    /// `None` if numbers are not stored so.
    pub(crate) fn new(kind: Kind, size: usize, big: bool) -> Option<Self> {
        let fits = match kind {
            Kind::Float => matches!(size, 2 | 4 | 8),
            Kind::Signed | Kind::Unsigned => (1..=8).contains(&size),
        };
        fits.then_some(Self { kind, size, big })
    }

    /// The number of the first bytes; NaN if there are too few.
    pub(crate) fn number(self, bytes: &[u8]) -> f64 {
        let Some(bytes) = bytes.get(..self.size) else {
            return f64::NAN;
        };
        let mut least_first = [0; 8];
        for (k, byte) in bytes.iter().enumerate() {
            least_first[if self.big { self.size - 1 - k } else { k }] = *byte;
        }
        let bits = u64::from_le_bytes(least_first);
        match (self.kind, self.size) {
            (Kind::Float, 8) => f64::from_bits(bits),
            (Kind::Float, 4) => f64::from(f32::from_bits(bits as u32)),
            (Kind::Float, _) => half(bits as u16),
            (Kind::Unsigned, _) => bits as f64,
            (Kind::Signed, size) => signed(bits, 8 * size as u32) as f64,
        }
    }
}

/// The signed number of the lowest `count` bits, 1 to 64.
pub(crate) fn signed(bits: u64, count: u32) -> i64 {
    let unused = 64 - count.clamp(1, 64);
    (bits << unused).cast_signed() >> unused
}

/// The number of half precision with these bits.
fn half(bits: u16) -> f64 {
    let sign = if bits >> 15 == 1 { -1.0 } else { 1.0 };
    let (exponent, mantissa) = (i32::from(bits >> 10 & 31), f64::from(bits & 1023));
    let size = match exponent {
        0 => mantissa * 2_f64.powi(-24),
        31 if mantissa > 0.0 => f64::NAN,
        31 => f64::INFINITY,
        _ => (1024.0 + mantissa) * 2_f64.powi(exponent - 25),
    };
    sign * size
}

/// An index that is stored as a number: 0 for what is negative or no number.
#[expect(clippy::cast_sign_loss, reason = "the cast saturates")]
pub(crate) fn index(number: f64) -> u64 {
    number as u64
}

/// The numbers at an offset in each of equal records.
pub(crate) fn of_records(
    bytes: &[u8],
    record: usize,
    offset: usize,
    stored: Stored,
) -> Read<Vec<f64>> {
    if record == 0
        || offset
            .checked_add(stored.size)
            .is_none_or(|end| end > record)
    {
        return broken("a field is not within its record");
    }
    let all = bytes.chunks_exact(record);
    Ok(all.map(|own| stored.number(&own[offset..])).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_every_kind_are_read_in_both_orders() {
        let read =
            |kind, big, bytes: &[u8]| Stored::new(kind, bytes.len(), big).unwrap().number(bytes);
        let cases = [
            (read(Kind::Signed, false, &[0xfe, 0xff]), -2.0),
            (read(Kind::Unsigned, true, &[1, 0]), 256.0),
            (read(Kind::Signed, true, &[0xff, 0xff, 0xfd]), -3.0),
            (read(Kind::Float, true, &1.5_f32.to_be_bytes()), 1.5),
            (read(Kind::Float, false, &0.1_f64.to_le_bytes()), 0.1),
            (half(0x3c00), 1.0),
            (half(0xc000), -2.0),
            (half(1), 2_f64.powi(-24)),
            (half(0x7bff), 65504.0),
            (half(0x7c00), f64::INFINITY),
        ];
        for (found, expected) in cases {
            assert_eq!(found.to_bits(), expected.to_bits(), "{expected}");
        }
        assert!(half(0x7e00).is_nan());
        assert_eq!(Stored::new(Kind::Float, 3, false), None);
    }
}
