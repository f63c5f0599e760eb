/// A number with the noun for what it counts.
///
/// ```
/// use regen_codegen::diag::counted;
///
/// assert_eq!([1, 2].map(|n| counted(n, "body", "bodies")), ["1 body", "2 bodies"]);
/// ```
pub fn counted(count: usize, one: &str, several: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { several })
}

/// Formats a number with six decimals at most; rounding errors are 0.
///
/// ```
/// use regen_codegen::diag::rounded;
///
/// assert_eq!([0.5, -1e-9, 7.0, 0.123_456_7].map(rounded), ["0.5", "0", "7", "0.123457"]);
/// ```
pub fn rounded(x: f64) -> String {
    let text = format!("{x:.6}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0" } else { text }.to_owned()
}
