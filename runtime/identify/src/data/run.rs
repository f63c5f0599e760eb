//! The files of one run of a robot, and the part of it that is read.

use core::fmt;
use std::path::{Path, PathBuf};

use super::parsed::ParsedFiles;

/// How the rows of files that are read together correspond.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Join {
    /// By time if every file names a column of time, else row by row.
    #[default]
    Auto,
    /// Row by row; the files must have the same number of rows.
    Rows,
    /// By time: the other files are interpolated at the times of the first one.
    Time,
}

/// One run of a robot: its log, in one file or in several that are joined, and the part that is
/// read.
///
/// ```
/// use std::path::PathBuf;
///
/// use regen_identify::data::{Join, Run};
///
/// let whole = Run::from(PathBuf::from("logs/run1.csv"));
/// assert_eq!(whole.to_string(), "logs/run1.csv");
/// let part = Run {
///     files: vec!["logs/pos.csv".into(), "logs/currents.csv".into()],
///     rows: Some((355, 5090)),
///     join: Join::Rows,
///     ..Run::default()
/// };
/// assert_eq!(part.to_string(), "logs/pos.csv + currents.csv, rows 355 to 5090");
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Run {
    /// The files, at least one. The columns of several files are concatenated in this order.
    pub files: Vec<PathBuf>,
    /// How the rows of several files correspond.
    pub join: Join,
    /// The topic to read from recordings (MCAP files and bags); `None` for the only topic with joint
    /// states.
    pub topic: Option<String>,
    /// The index of the episode to read from a LeRobot file; `None` for the only episode.
    pub episode: Option<u64>,
    /// The first and the last row to read, counted from 1 without header and comments; `None` for
    /// all. If the files are joined by time, these are rows of the first one.
    pub rows: Option<(u64, u64)>,
    /// The first and the last time that is read, s, in the log's own time; `None` for all.
    pub times: Option<(f64, f64)>,
    /// What has been read of its files.
    pub parsed: ParsedFiles,
}

impl Run {
    /// The message about the first of its files that does not exist; `None` if all do. Commands take a
    /// word that no option takes for a log, as in `--friction atan`.
    ///
    /// ```
    /// use std::path::Path;
    ///
    /// use regen_identify::data::Run;
    ///
    /// let text = Run::from(Path::new("atan")).missing().unwrap_or_default();
    /// assert!(text.starts_with("cannot read atan: no such file"));
    /// assert_eq!(Run::from(Path::new("Cargo.toml")).missing(), None);
    /// ```
    pub fn missing(&self) -> Option<String> {
        let is_missing = |file: &&PathBuf| matches!(file.try_exists(), Ok(false));
        self.files.iter().find(is_missing).map(|file| {
            format!(
                "cannot read {}: no such file (a word that is no value of an option is a log)",
                file.display()
            )
        })
    }
}

impl From<PathBuf> for Run {
    /// A whole file.
    fn from(file: PathBuf) -> Self {
        Self {
            files: vec![file],
            ..Self::default()
        }
    }
}

impl From<&Path> for Run {
    /// A whole file.
    fn from(file: &Path) -> Self {
        Self::from(file.to_path_buf())
    }
}

impl fmt::Display for Run {
    /// The path of the first file, the names of the others, and the part that is read.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (k, file) in self.files.iter().enumerate() {
            match file.file_name() {
                Some(name) if k > 0 => write!(f, " + {}", name.display())?,
                _ => write!(f, "{}", file.display())?,
            }
        }
        if let Some(topic) = &self.topic {
            write!(f, ", {topic}")?;
        }
        if let Some(episode) = self.episode {
            write!(f, ", episode {episode}")?;
        }
        if let Some((first, last)) = self.rows {
            write!(f, ", rows {first} to {last}")?;
        }
        if let Some((start, end)) = self.times {
            write!(f, ", {start} s to {end} s")?;
        }
        Ok(())
    }
}
