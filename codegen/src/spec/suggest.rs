//! Suggestions for misspelt words ("did you mean").

/// The text `; did you mean 'x'?` if a known word is similar, else an empty text.
pub(super) fn did_you_mean<'a>(word: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    nearest(word, known).map_or_else(String::new, |near| format!("; did you mean '{near}'?"))
}

/// The known word that is most similar to a misspelt one, the first of equally similar ones; `None`
/// if none is within one typing error in a short word, or two in a longer one.
///
/// ```
/// use regen_codegen::spec::nearest;
///
/// assert_eq!(nearest("chekc", ["check", "view"]), Some("check"));
/// assert_eq!(nearest("draw", ["check", "view"]), None);
/// ```
pub fn nearest<'a>(word: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    // these limits bound the time that a hostile file can take
    const MAX_WORD_LENGTH: usize = 64;
    const MAX_CANDIDATES: usize = 1000;
    // allow one typing error in short words, two in longer ones
    let length = word.chars().count();
    let allowed = if length < 4 { 1 } else { 2 };
    if length > MAX_WORD_LENGTH {
        return None;
    }
    let lower = word.to_lowercase();
    let mut best: Option<(usize, &str)> = None;
    for candidate in known.into_iter().take(MAX_CANDIDATES) {
        if candidate.chars().count().abs_diff(length) > allowed {
            continue;
        }
        let distance = if candidate.to_lowercase() == lower {
            0
        } else {
            strsim::osa_distance(word, candidate)
        };
        let trivial = distance >= candidate.chars().count() || differ_in_digits(word, candidate);
        if distance <= allowed && !trivial && best.is_none_or(|(least, _)| distance < least) {
            best = Some((distance, candidate));
        }
    }
    best.map(|(_, candidate)| candidate)
}

/// Whether two words differ in their digits only: `q7` is not a misspelt `q1`.
fn differ_in_digits(a: &str, b: &str) -> bool {
    let same = |(x, y): (char, char)| x == y || (x.is_ascii_digit() && y.is_ascii_digit());
    a != b && a.chars().count() == b.chars().count() && a.chars().zip(b.chars()).all(same)
}

/// The words as a list: `'a', 'b' or 'c'`.
pub(super) fn one_of<'a>(words: impl IntoIterator<Item = &'a str>) -> String {
    let quoted: Vec<String> = words.into_iter().map(|word| format!("'{word}'")).collect();
    match quoted.split_last() {
        None => String::new(),
        Some((last, [])) => last.clone(),
        Some((last, rest)) => format!("{} or {last}", rest.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_words_are_found_and_far_ones_are_not() {
        let known = ["prismatic", "revolute", "fixed"];
        assert_eq!(nearest("prismtic", known), Some("prismatic"));
        assert_eq!(nearest("Revolute", known), Some("revolute"));
        assert_eq!(nearest("helical", known), None);
        assert_eq!(nearest("q", ["a", "b"]), None);
        assert_eq!(nearest("alfa", ["a", "alpha"]), Some("alpha"));
        assert_eq!(nearest("q22", ["q1", "q2"]), Some("q2"));
        assert_eq!(nearest("q7", ["q1", "q2"]), None);
        assert_eq!(nearest("x1", ["y2"]), None);
    }

    #[test]
    fn lists_read_like_sentences() {
        assert_eq!(one_of(["a"]), "'a'");
        assert_eq!(one_of(["a", "b", "c"]), "'a', 'b' or 'c'");
    }
}
