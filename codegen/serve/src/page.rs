//! The page, its style and its script, as they are sent.

const HTML: &str = include_str!("page/page.html");
pub(crate) const STYLE: &str = include_str!("page/page.css");
pub(crate) const SCRIPT: &str = include_str!("page/page.js");

/// The page for a token, which consists of hexadecimal digits.
pub(crate) fn html(token: &str) -> String {
    HTML.replace("{{token}}", token)
}
