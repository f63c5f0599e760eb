//! Formats numbers and names for people.

/// A text as YAML, in quotes where YAML needs them or would read another value than a whole number.
///
/// ```
/// use regen_identify::text::yaml_text;
///
/// assert_eq!(["3", "q1", "../a.csv", "leg-1.q"].map(yaml_text), ["3", "q1", "../a.csv", "leg-1.q"]);
/// assert_eq!(["", "no", "1e5", "a: b"].map(yaml_text), [r#""""#, r#""no""#, r#""1e5""#, r#""a: b""#]);
/// ```
pub fn yaml_text(text: &str) -> String {
    const VALUES: [&str; 9] = ["true", "false", "null", "yes", "no", "on", "off", "y", "n"];
    let is_number = !text.is_empty() && text.chars().all(|c| c.is_ascii_digit());
    let starts = text.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_' || c == '/')
        || text.starts_with('.') && text.contains('/');
    let is_word = starts
        && text
            .chars()
            .all(|c| c.is_ascii_alphanumeric() || "_-./".contains(c));
    if is_number || is_word && !VALUES.contains(&text.to_ascii_lowercase().as_str()) {
        return text.to_owned();
    }
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\""))
}

/// A number with the noun for what it counts.
///
/// ```
/// use regen_identify::text::counted;
///
/// assert_eq!([1, 2].map(|n| counted(n, "pose", "poses")), ["1 pose", "2 poses"]);
/// ```
pub fn counted(count: usize, one: &str, several: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { several })
}

/// A number in five significant digits, with an exponent only where it is hard to read without.
///
/// ```
/// assert_eq!(regen_identify::text::figure(2.2), "2.2000");
/// assert_eq!(regen_identify::text::figure(123_456.0), "1.2346e5");
/// ```
pub fn figure(value: f64) -> String {
    figure_of(5, value)
}

/// A number in `digits` significant digits, at least one, with an exponent only where it is hard to
/// read without.
///
/// ```
/// assert_eq!(regen_identify::text::figure_of(2, 0.012_34), "0.012");
/// ```
pub fn figure_of(digits: usize, value: f64) -> String {
    let digits = digits.max(1);
    let text = format!("{value:.*e}", digits - 1);
    // the exponent after rounding: 0.99999 may become 1.0
    let exponent = text.split_once('e').and_then(|(_, e)| e.parse().ok());
    let places = match exponent {
        _ if value == 0.0 => return "0".to_owned(),
        Some(before @ 0_isize..=4) => (digits - 1).saturating_sub(before.unsigned_abs()),
        Some(after @ -3..=-1) => digits - 1 + after.unsigned_abs(),
        _ => return text,
    };
    format!("{value:.places$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_have_an_exponent_only_where_they_are_hard_to_read_without() {
        for (value, text) in [
            (0.0, "0"),
            (-0.0, "0"),
            (2.2, "2.2000"),
            (-1.4143, "-1.4143"),
            (0.001, "0.0010000"),
            (0.000_999_999_9, "0.0010000"),
            (0.000_36, "3.6000e-4"),
            (9_999.99, "10000"),
            (12_345.6, "12346"),
            (123_456.0, "1.2346e5"),
            (f64::NAN, "NaN"),
            (f64::INFINITY, "inf"),
        ] {
            assert_eq!(figure(value), text);
        }
    }
}
