//! Where the parts of a file that messages name are in its text.

use super::FileError;
use crate::document::{Node, NodeKind};

impl FileError {
    /// The byte at which the part of the text begins that the error is about; `None` where it is about the
    /// whole text.
    ///
    /// ```
    /// use regen_identify::files::FileError;
    ///
    /// let place = "parameters, row 2, valu".to_owned();
    /// let error = FileError::Content { place, why: "there is no such key".to_owned() };
    /// let text = "parameters:\n- {label: a, value: 1}\n- {label: b, valu: 2}\n";
    /// assert_eq!(error.at(text), text.find("valu:"));
    /// ```
    pub fn at(&self, text: &str) -> Option<usize> {
        match self {
            Self::Content { place, .. } => part_at(text, place),
            Self::Digest { .. } => part_at(text, "model"),
            Self::Missing(_) => part_at(text, "parameters"),
            Self::Covariance => part_at(text, "covariance"),
            Self::Friction { joint, .. } => {
                let document = Node::parse(text).ok()?;
                let mut rows = document.get("friction")?.items().iter();
                let own = |row: &&Node| row.get("joint").and_then(Node::text) == Some(joint);
                Some(rows.find(own)?.at)
            }
            _ => None,
        }
    }
}

/// The byte at which a part of a text, JSON or YAML, begins, by the words that lead to it: keys, with commas
/// or points between them, and rows of lists, as in `parameters, row 3, value` or `q1.kp`. Where the last
/// parts are not there, it is that of the last one that is.
///
/// ```
/// use regen_identify::files::part_at;
///
/// let text = "u1.2: {kp: 40,\n  kq: 2}\n";
/// assert_eq!(part_at(text, "u1.2.kq"), Some(17));
/// assert_eq!(part_at(text, "u1.2, `kq`"), Some(17));
/// assert_eq!(part_at(text, "u1.2.limit"), Some(0));
/// assert_eq!(part_at(text, "q7"), None);
/// ```
pub fn part_at(text: &str, place: &str) -> Option<usize> {
    let mut node = &Node::parse(text).ok()?;
    let (mut rest, mut found) = (place, None);
    while !rest.is_empty() {
        let step = match &node.kind {
            NodeKind::Map(entries) => {
                let mut fits: Vec<_> = entries
                    .iter()
                    .filter_map(|(key, own)| {
                        after(rest, &key.text).map(|rest| (key.text.len(), key.at, own, rest))
                    })
                    .collect();
                fits.sort_by_key(|own| own.0);
                fits.pop().map(|(_, at, own, rest)| (at, own, rest))
            }
            NodeKind::List(items) => row(rest).and_then(|(k, rest)| {
                let own = items.get(k.checked_sub(1)?)?;
                Some((own.at, own, rest))
            }),
            _ => None,
        };
        let Some((at, own, further)) = step else {
            break;
        };
        (found, node, rest) = (Some(at), own, further);
    }
    found
}

/// What follows a key in the words that lead to a part; `None` if they do not begin with it.
fn after<'w>(words: &'w str, key: &str) -> Option<&'w str> {
    let quoted = words
        .strip_prefix('`')
        .and_then(|own| own.strip_prefix(key)?.strip_prefix('`'));
    let rest = quoted.or_else(|| words.strip_prefix(key))?;
    if rest.is_empty() {
        return Some(rest);
    }
    rest.strip_prefix(", ").or_else(|| rest.strip_prefix('.'))
}

/// The number of a row, and what follows it.
fn row(words: &str) -> Option<(usize, &str)> {
    let rest = words.strip_prefix("row ")?;
    let (number, rest) = rest.split_once(", ").unwrap_or((rest, ""));
    Some((number.parse().ok()?, rest))
}
