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
