//! The columns of a log as they are, for estimators that simulate: positions, velocities, commands
//! and efforts, none of them differentiated or filtered.

use std::path::Path;

use super::columns::{Assignment, ColumnLayout};
use super::logs::{FileReport, signal};
use super::problem::{DataError, Policy, Problems};
use super::reader::LogFile;
use crate::signals::SignalError;
use regen_runtime::Info;

/// A stretch of a log without gaps: its columns in SI, by coordinate. What the log does not have is
/// missing in the lists.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Track {
    /// The times, s.
    pub times: Vec<f64>,
    /// Measured positions, rad or m.
    pub positions: Vec<(usize, Vec<f64>)>,
    /// Measured velocities, rad/s or m/s.
    pub velocities: Vec<(usize, Vec<f64>)>,
    /// Commanded positions of actuated joints, rad or m.
    pub commands: Vec<(usize, Vec<f64>)>,
    /// Efforts of actuated joints, N m or N.
    pub efforts: Vec<(usize, Vec<f64>)>,
}

/// Reads a log as stretches without gaps.
///
/// - `columns`: assignments of columns whose headers do not name their quantities;
/// - `commands`: those of the commanded positions, as positions of the joints; a command without
///   one is in the column `cmd_NAME`, if there is such a column;
/// - `policy`: what is done with faulty rows.
///
/// # Errors
/// When the file cannot be read, an assigned column is missing, the file has fewer than two usable
/// rows, or it has faulty rows under [`Policy::Fail`].
///
/// ```
/// use regen_identify::data::{Policy, tracks};
/// use regen_runtime::Info;
///
/// let info = Info { coordinates: &["q1"], independent: &[0], actuated: &[0], ..Info::EMPTY };
/// let path = std::env::temp_dir().join(format!("track-{}.csv", std::process::id()));
/// std::fs::write(&path, "t,q1,cmd_q1\n0,0.1,0.2\n0.01,0.11,0.21\n0.02,0.12,0.22\n")?;
/// let (found, report) = tracks(&path, &info, &[], &[], Policy::Fail)?;
/// assert_eq!(found[0].commands, [(0, vec![0.2, 0.21, 0.22])]);
/// assert_eq!((report.rows, found[0].efforts.len()), (3, 0));
/// # std::fs::remove_file(path)?;
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
pub fn tracks(
    path: &Path,
    info: &Info<'_>,
    columns: &[Assignment],
    commands: &[Assignment],
    policy: Policy,
) -> Result<(Vec<Track>, FileReport), DataError> {
    let mut kinds: [Vec<usize>; 4] = Default::default();
    let mut file = LogFile::with(path, |header| {
        let (layout, found) = ColumnLayout::of_track(header, info, columns, commands)?;
        kinds = found;
        Ok(layout)
    })?;
    file.keep = policy.keeps();
    let survey = file.survey()?;
    let mut problems = Problems::default();
    let mut out: Vec<Track> = Vec::new();
    let empty = |places: &Vec<usize>| places.iter().map(|c| (*c, Vec::new())).collect();
    let mut rows = 0;
    file.rows(
        &survey,
        &mut |problem| problems.add(problem),
        &mut |row, follows| {
            rows += 1;
            if !follows || out.is_empty() {
                let [positions, velocities, commands, efforts] = &kinds;
                out.push(Track {
                    times: Vec::new(),
                    positions: empty(positions),
                    velocities: empty(velocities),
                    commands: empty(commands),
                    efforts: empty(efforts),
                });
            }
            let Some(track) = out.last_mut() else {
                return Ok(());
            };
            let mut values = row.values.iter().copied();
            track.times.extend(values.next());
            let lists = [
                &mut track.positions,
                &mut track.velocities,
                &mut track.commands,
                &mut track.efforts,
            ];
            for ((_, list), value) in lists.into_iter().flatten().zip(values) {
                list.push(value);
            }
            Ok(())
        },
    )?;
    let name = path.display().to_string();
    if policy == Policy::Fail && problems.total() > 0 {
        return Err(DataError::Problems {
            file: name,
            problems,
        });
    }
    if rows < 2 {
        let why = SignalError::TooFew {
            samples: rows,
            needed: 2,
        };
        return Err(signal(&file, why));
    }
    let report = FileReport {
        file: name,
        rows,
        step: survey.time_step(),
        problems,
        policy,
        ..FileReport::default()
    };
    Ok((out, report))
}
