//! Hints about brackets that are not closed.

/// The hint about a bracket, with the text before it.
pub(super) fn still_open(before: &str, bracket: char) -> String {
    let line = before.matches('\n').count() + 1;
    let column = before.rsplit('\n').next().unwrap_or(before).chars().count() + 1;
    format!("the `{bracket}` of line {line}, column {column} is still open here")
}

/// The hint about the innermost bracket that is open at a place by its characters alone: the reader
/// looks ahead, and may notice a mistake before it reports what was opened. Brackets count where YAML
/// begins a value.
pub(super) fn open_before(text: &str, at: usize) -> Option<String> {
    let text = text.get(..at)?;
    let mut open: Vec<(usize, char)> = Vec::new();
    let mut quote = None;
    let mut is_comment = false;
    let mut before = '\n';
    for (place, c) in text.char_indices() {
        let begins = before.is_whitespace() || "[{,:".contains(before);
        match (quote, c) {
            _ if is_comment => is_comment = c != '\n',
            (Some(end), _) => quote = Some(end).filter(|end| *end != c),
            (None, '#') if before.is_whitespace() => is_comment = true,
            (None, '"' | '\'') if begins => quote = Some(c),
            (None, '[' | '{') if begins => open.push((place, c)),
            (None, ']' | '}') => {
                open.pop();
            }
            _ => {}
        }
        before = c;
    }
    let (place, bracket) = open.pop()?;
    Some(still_open(text.get(..place)?, bracket))
}

#[cfg(test)]
mod tests {
    use super::open_before;

    #[test]
    fn the_innermost_open_bracket_is_named() {
        let hint = |text: &str| open_before(text, text.len());
        let open = hint("a: [1, 2]\nb: {c: [1,\nd: 2").unwrap_or_default();
        assert!(open.contains("`[` of line 2, column 8"), "{open}");
        // those in comments, quotes and words do not count
        assert_eq!(hint("a: 1 # [\nb: \"{\" \nc: x[1\nd: '['\n"), None);
        assert_eq!(hint("a: [1, {b: 2}]\n"), None);
    }
}
