//! Adds keys to the text of an experiment file, which keeps everything else as it is.

use crate::document::{Node, NodeKind};

/// Adds keys to `process` of an experiment file, in the style in which it is written: lines with an indent, or
/// braces. Keys that it states already stay as they are. `None` where the text is no mapping, or takes no
/// further keys.
///
/// ```
/// use regen_identify::experiment_file::with_process;
///
/// let keys = [("decimate", "3".to_owned()), ("delay", "{q1: 1e-3}".to_owned())];
/// let braces = with_process("{runs: [{files: a.csv}], process: {decimate: 2}}", &keys);
/// let expected = "{runs: [{files: a.csv}], process: {delay: {q1: 1e-3}, decimate: 2}}";
/// assert_eq!(braces.as_deref(), Some(expected));
/// let without = with_process("{runs: [{files: a.csv}]}", &keys[..1]);
/// assert_eq!(without.as_deref(), Some("{process: {decimate: 3}, runs: [{files: a.csv}]}"));
/// let lines = with_process("process:\n    decimate: 2\nruns: []\n", &keys);
/// assert_eq!(lines.as_deref(), Some("process:\n    delay: {q1: 1e-3}\n    decimate: 2\nruns: []\n"));
/// ```
pub fn with_process(text: &str, keys: &[(&str, String)]) -> Option<String> {
    let root = Node::parse(text).ok()?;
    let NodeKind::Map(entries) = &root.kind else {
        return None;
    };
    let process = entries.iter().find(|(key, _)| key.text == "process");
    let stated = process.map(|(_, node)| node);
    let new: Vec<_> = keys
        .iter()
        .filter(|(key, _)| stated.and_then(|node| node.get(key)).is_none())
        .collect();
    if new.is_empty() {
        return Some(text.to_owned());
    }
    let pairs: Vec<String> = new
        .iter()
        .map(|(key, value)| format!("{key}: {value}"))
        .collect();
    let braces = format!("{{{}}}", pairs.join(", "));
    let is_flow = |at: usize| text.get(at..).is_some_and(|rest| rest.starts_with('{'));
    let (at, added) = match process {
        None if is_flow(root.at) => {
            let comma = if entries.is_empty() { "" } else { ", " };
            (root.at + 1, format!("process: {braces}{comma}"))
        }
        None => {
            let lines = format!("  {}\n", pairs.join("\n  "));
            let end = if text.ends_with('\n') { "" } else { "\n" };
            (text.len(), format!("{end}process:\n{lines}"))
        }
        Some((_, node)) => match &node.kind {
            NodeKind::Map(own) if is_flow(node.at) => {
                let comma = if own.is_empty() { "" } else { ", " };
                (node.at + 1, format!("{}{comma}", pairs.join(", ")))
            }
            NodeKind::Map(own) => {
                let at = own.first()?.0.at;
                let before = text.get(..at)?;
                let indent = before.len() - before.rfind('\n').map_or(0, |end| end + 1);
                let lines = pairs
                    .iter()
                    .map(|pair| format!("{pair}\n{}", " ".repeat(indent)));
                (at, lines.collect())
            }
            NodeKind::Null => {
                let key = process?.0.at;
                let colon = text.get(key..)?.find(':')?;
                (key + colon + 1, format!(" {braces}"))
            }
            _ => return None,
        },
    };
    let mut out = text.to_owned();
    if !out.is_char_boundary(at) {
        return None;
    }
    out.insert_str(at, &added);
    // an alias or a document's end would make another text of it
    let read = Node::parse(&out).ok()?;
    let has =
        |(key, _): &&(&str, String)| read.get("process").and_then(|own| own.get(key)).is_some();
    let keeps = read.entries().len() == entries.len() + usize::from(process.is_none());
    (keeps && new.iter().copied().all(|own| has(&own))).then_some(out)
}
