//! The table of models compared on logs, as in the chapter's Table 4.

use std::path::Path;

use regen_identify::session::LogError;

use crate::table;

/// The table for people: a row for each model, a column for each log.
pub(crate) fn to_text(title: &str, rows: &[(String, &[LogError])]) -> String {
    // the number of logs whose columns fit side by side
    const BLOCK: usize = 4;
    let mut out = String::new();
    let logs = rows.first().map_or(&[][..], |(_, logs)| *logs);
    for (block, some) in logs.chunks(BLOCK).enumerate() {
        let names: Vec<String> = some.iter().map(|l| stem(&l.log)).collect();
        let head: Vec<&str> = std::iter::once(title)
            .chain(names.iter().map(String::as_str))
            .collect();
        let lines: Vec<Vec<String>> = rows
            .iter()
            .map(|(name, logs)| {
                let figures = logs.iter().skip(block * BLOCK).take(BLOCK);
                let figures = figures.map(|l| format!("{:.3}", l.relative_absolute));
                std::iter::once(name.clone()).chain(figures).collect()
            })
            .collect();
        out.push_str(&table::columns(&head, &lines));
    }
    out
}

/// A file's name without directory and extension.
pub(crate) fn stem(path: &str) -> String {
    let stem = Path::new(path).file_stem();
    stem.map_or_else(|| path.to_owned(), |s| s.to_string_lossy().into_owned())
}
