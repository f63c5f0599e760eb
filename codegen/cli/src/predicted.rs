//! Models compared on logs, as in the chapter's Table 4.

use std::path::Path;

use regen_identify::identify;
use serde::Serialize;

use crate::args::ReadingArgs;
use crate::exit::Failure;
use crate::{observe, table};
use regen_identify::model::IdentifiedModel;
use regen_interpreted::Interpreted;

/// A model's error on a log.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct OnLog {
    pub(crate) log: String,
    /// eps_RA in percent (Eq. 33).
    pub(crate) relative_absolute: f64,
}

/// eps_RA of each model on each log: a list for each model.
pub(crate) fn table(
    model: &Interpreted<'_>,
    reading: &ReadingArgs,
    logs: &[&Path],
    models: &[IdentifiedModel],
) -> Result<Vec<Vec<OnLog>>, Failure> {
    let kind = observe::kind(reading);
    let mut out = vec![Vec::with_capacity(logs.len()); models.len()];
    for path in logs {
        let mut log = observe::open(model, &[path.to_path_buf()], reading)?;
        let means = identify::observe(model, kind, &mut log)?.0.means();
        for (one, row) in models.iter().zip(&mut out) {
            let found = one.residuals(model, kind, &mut log, &means, 1)?;
            row.push(OnLog {
                log: path.display().to_string(),
                relative_absolute: found.relative_absolute(),
            });
        }
    }
    Ok(out)
}

/// The table for people: a row for each model, a column for each log.
pub(crate) fn human(title: &str, rows: &[(String, &[OnLog])]) -> String {
    // as many logs beside each other as fit
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
