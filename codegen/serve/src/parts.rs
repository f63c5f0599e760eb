//! The parts of the page, and the arguments of the command that makes each from the files.

use serde::{Deserialize, Serialize};

/// A part of the page.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Part {
    View,
    Check,
    Base,
    Report,
}

/// All parts, the quickest first, since every command reports the mistakes in a description.
const ALL: [Part; 4] = [Part::View, Part::Check, Part::Base, Part::Report];

/// The name of the page in the command's arguments; no file with this name is written.
const PAGE: &str = "page.html";

/// A command of a job.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Task {
    pub(crate) part: Part,
    pub(crate) words: Vec<String>,
    /// The file that the command writes, which is the result; `None` if the result is what the
    /// command prints.
    pub(crate) written: Option<String>,
}

impl Part {
    /// The part with this name in requests.
    pub(crate) fn of(name: &str) -> Option<Self> {
        ALL.into_iter().find(|part| part.name() == name)
    }

    /// Its name in requests.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::View => "view",
            Self::Check => "check",
            Self::Base => "base",
            Self::Report => "report",
        }
    }

    /// Whether it is a page of its own, shown in a frame.
    pub(crate) fn is_page(self) -> bool {
        matches!(self, Self::View | Self::Report)
    }

    /// The command that makes the part from a description and, if given, an experiment file; `None`
    /// if the part needs an experiment file and there is none.
    fn task(self, spec: &str, runs: Option<&str>) -> Option<Task> {
        let words = match (self, runs) {
            (Self::View, _) => vec!["view", spec, "--out", PAGE],
            (Self::Check, _) => vec!["check", spec],
            (Self::Base, _) => vec!["base", spec, "--format", "json"],
            (Self::Report, Some(runs)) => vec!["identify", spec, runs, "--report", PAGE],
            (Self::Report, None) => return None,
        };
        Some(Task {
            part: self,
            words: words.into_iter().map(str::to_owned).collect(),
            written: self.is_page().then(|| PAGE.to_owned()),
        })
    }
}

/// The commands for all parts that can be made from a description and, if given, an experiment
/// file.
pub(crate) fn tasks(spec: &str, runs: Option<&str>) -> Vec<Task> {
    ALL.iter()
        .filter_map(|part| part.task(spec, runs))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_report_needs_an_experiment_file() {
        let parts = |runs| tasks("arm.yaml", runs).into_iter().map(|task| task.part);
        assert!(parts(None).eq([Part::View, Part::Check, Part::Base]));
        assert!(parts(Some("runs.yaml")).eq(ALL));
        for part in ALL {
            assert_eq!(Part::of(part.name()), Some(part));
        }
        assert_eq!(Part::of("other"), None);
    }
}
