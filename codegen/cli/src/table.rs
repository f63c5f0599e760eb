//! The layout of printed results: plain tables of at most 80 columns, numbers, and JSON.

use serde::Serialize;

#[cfg(test)]
pub(crate) use regen_codegen::explain::lines::WIDTH;
pub(crate) use regen_codegen::explain::lines::{columns, field, item, paragraph};
pub(crate) use regen_identify::text::{figure, figure_of};

/// A value as JSON text. All printed values have string keys in maps and finite numbers, so that
/// serialising cannot fail.
pub(crate) fn json<T: Serialize>(value: &T) -> String {
    serde_json::to_string(value).unwrap_or_default() + "\n"
}

/// A number in exponent notation with `digits` significant digits, for values whose magnitude
/// matters; zero prints as `0`.
pub(crate) fn size(digits: usize, value: f64) -> String {
    if value == 0.0 {
        "0".to_owned()
    } else {
        format!("{value:.*e}", digits.max(1) - 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_told_by_their_exponent() {
        assert_eq!(size(2, 0.0), "0");
        assert_eq!(size(2, 1.23e-16), "1.2e-16");
        assert_eq!(size(1, 1.0), "1e0");
    }
}
