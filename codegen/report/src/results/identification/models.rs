//! The table of models compared on logs, as in the chapter's Table 4.

use std::path::Path;

use regen_codegen::explain::lines::columns;
use regen_identify::session::LogError;

/// An error in percent; a dash where it has no meaning, as of an effort that is the same throughout.
pub fn error_percent(value: f64) -> String {
    if value.is_finite() {
        format!("{value:.3}")
    } else {
        "-".to_owned()
    }
}

/// The table for people: a row for each model, a column for each log.
pub(super) fn models_text(title: &str, rows: &[(String, &[LogError])]) -> String {
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
                let figures = figures.map(|l| error_percent(l.relative_absolute));
                std::iter::once(name.clone()).chain(figures).collect()
            })
            .collect();
        out.push_str(&columns(&head, &lines));
    }
    out
}

/// The name of a run without the directory and the extension of each file; the part of the files
/// that is read, named after a comma, stays.
///
/// ```
/// assert_eq!(regen_report::results::stem("runs/run1.csv"), "run1");
/// ```
pub fn stem(run: &str) -> String {
    let (files, part) = match run.split_once(", ") {
        Some((files, part)) => (files, format!(", {part}")),
        None => (run, String::new()),
    };
    let one = |file: &str| {
        let stem = Path::new(file).file_stem();
        stem.map_or_else(|| file.to_owned(), |s| s.to_string_lossy().into_owned())
    };
    let names: Vec<String> = files.split(" + ").map(one).collect();
    names.join(" + ") + &part
}

#[cfg(test)]
mod tests {
    use super::{LogError, models_text, stem};

    #[test]
    fn every_model_has_its_error_of_every_log_below_the_logs_name() {
        let logs = |first: f64| -> Vec<LogError> {
            let one = |k: u32| LogError {
                log: format!("runs/log{k}.csv"),
                relative_absolute: first + f64::from(k),
            };
            (0..6).map(one).collect()
        };
        let (least, feasible) = (logs(10.0), logs(20.0));
        let rows = [
            ("least squares".to_owned(), &least[..]),
            ("feasible".to_owned(), &feasible[..]),
        ];
        let text = models_text("eps_RA, %", &rows);
        // the ends of columns, which are aligned to the right
        let ends = |line: &str, words: &[String]| -> Vec<usize> {
            let end = |word: &String| line.find(word.as_str()).map(|at| at + word.len());
            words.iter().filter_map(end).collect()
        };
        let mut found = 0;
        let lines: Vec<&str> = text.lines().collect();
        for (at, head) in lines.iter().enumerate() {
            if !head.trim_start().starts_with("eps_RA, %") {
                continue;
            }
            for k in (0..6).filter(|k| head.contains(&format!("log{k}"))) {
                let column = ends(head, &[format!("log{k}")]);
                for (first, name) in [(10 + k, "least squares"), (20 + k, "feasible")] {
                    let own = lines[at..]
                        .iter()
                        .find(|line| line.trim_start().starts_with(name))
                        .unwrap();
                    assert_eq!(ends(own, &[format!("{first}.000")]), column, "{text}");
                    found += 1;
                }
            }
        }
        assert_eq!(found, 12, "{text}");
    }

    #[test]
    fn names_of_runs_keep_the_part_that_is_read() {
        for (run, name) in [
            ("logs/run.1.csv", "run.1"),
            ("a.csv + b.csv, rows 2 to 7", "a + b, rows 2 to 7"),
            ("a.csv, 2.5 s to 4.5 s", "a, 2.5 s to 4.5 s"),
            ("b/x.mcap, /joint_states", "x, /joint_states"),
        ] {
            assert_eq!(stem(run), name);
        }
    }
}
