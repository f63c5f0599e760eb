//! The columns of a run as they are, for estimators that simulate: positions, velocities, commands
//! and efforts, none of them differentiated or filtered.

use super::columns::{Assignment, Quantity, ValuesFrom};
use super::file_rows::Table;
use super::layout::{ColumnLayout, Finder, Search, Unfit};
use super::logs::{FileReport, signal};
use super::policy::Policy;
use super::problem::{DataError, Problems};
use super::reader::LogFile;
use super::run::Run;
use super::settings::Settings;
use crate::signals::SignalError;
use regen_runtime::Info;

/// A stretch of a log without gaps: its columns in SI, each with the index of its coordinate. The
/// lists contain only the columns that the log has.
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

/// Reads a run as stretches without gaps.
///
/// - `settings`: how its files are read: columns, format, rate, even grid, whether velocities are
///   used, and what is done with faulty rows; filters and delays are ignored;
/// - `commands`: the columns of the commanded positions, as positions of the joints; a command
///   without one is in the column `cmd_NAME`, if there is such a column.
///
/// # Errors
/// When a file cannot be read, an assigned column is missing, the run has fewer than two usable
/// rows, or it has faulty rows under [`Policy::Fail`].
///
/// ```
/// use regen_identify::data::{Run, Settings, tracks};
/// use regen_runtime::Info;
///
/// let info = Info { coordinates: &["q1"], independent: &[0], actuated: &[0], ..Info::EMPTY };
/// let path = std::env::temp_dir().join(format!("track-{}.csv", std::process::id()));
/// std::fs::write(&path, "t;q1;goal\n0;0,1;200\n0,01;0,11;210\n0,02;0,12;220\n")?;
/// let run = Run::from(path.as_path());
/// let goal = "q1=goal:mm".parse()?;
/// let (found, report) = tracks(&run, &info, &Settings::default(), &[goal])?;
/// assert_eq!(found[0].commands, [(0, vec![0.2, 0.21, 0.22])]);
/// assert_eq!((report.rows, found[0].efforts.len()), (3, 0));
/// # std::fs::remove_file(path)?;
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
pub fn tracks(
    run: &Run,
    info: &Info<'_>,
    settings: &Settings,
    commands: &[Assignment],
) -> Result<(Vec<Track>, FileReport), DataError> {
    if settings.poses {
        return Err(DataError::ColumnLayout {
            file: run.to_string(),
            why: "poses at rest have no motion that could be followed: leave out `--poses`"
                .to_owned(),
        });
    }
    let mut places = Places::default();
    let mut file = LogFile::with(run, settings, |tables, search| {
        let (layout, found) = layout(tables, info, search, commands)?;
        places = found;
        Ok(layout)
    })?;
    // a track has no filter that would end at a gap
    file.bridging = None;
    // commands would be wrapped as they were
    file.unwraps = false;
    let survey = file.survey(info)?;
    let mut problems = Problems::default();
    let mut out: Vec<Track> = Vec::new();
    let (mut rows, mut is_ended) = (0, false);
    file.rows(
        &survey,
        &mut |problem| problems.add(problem),
        &mut |row, follows| {
            // a track has no equations of which some could be left out
            if !row.unknown.is_empty() {
                is_ended = true;
                return Ok(());
            }
            rows += 1;
            if !follows || out.is_empty() || core::mem::take(&mut is_ended) {
                out.push(places.track());
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
    let policies = settings.policies();
    let refused = problems.treated(&policies, Policy::Fail);
    if refused.total() > 0 {
        return Err(DataError::Problems {
            file: file.name,
            problems: refused,
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
        file: file.name,
        rows,
        step: survey.time_step(),
        problems,
        policies,
        ..FileReport::default()
    };
    Ok((out, report))
}

/// The coordinates of each kind of signal, in the order of a row.
#[derive(Default)]
struct Places {
    positions: Vec<usize>,
    velocities: Vec<usize>,
    commands: Vec<usize>,
    efforts: Vec<usize>,
}

impl Places {
    /// A track without rows.
    fn track(&self) -> Track {
        let empty = |places: &[usize]| places.iter().map(|c| (*c, Vec::new())).collect();
        Track {
            times: Vec::new(),
            positions: empty(&self.positions),
            velocities: empty(&self.velocities),
            commands: empty(&self.commands),
            efforts: empty(&self.efforts),
        }
    }
}

/// Finds the columns of a track: time, then the positions, velocities, commands and efforts that
/// are there.
fn layout(
    tables: &[Table],
    info: &Info<'_>,
    search: Search<'_>,
    commands: &[Assignment],
) -> Result<(ColumnLayout, Places), Unfit> {
    let finder = Finder::new(tables, info, search, commands)?;
    let (time, times) = finder.times()?;
    let mut channels = Vec::from([time]);
    let mut add = |coordinates: &[usize],
                   of: &dyn Fn(String) -> Quantity,
                   commanded: bool|
     -> Result<Vec<usize>, Unfit> {
        let mut places = Vec::new();
        for &c in coordinates {
            let Some(name) = info.coordinates.get(c) else {
                continue;
            };
            let quantity = of((*name).to_owned());
            let found = if commanded {
                let given = commands.iter().find(|a| a.quantity == quantity);
                finder.find_as(given, &format!("cmd_{quantity}"))?
            } else {
                let given = finder.given(&quantity);
                let measured = given.is_none_or(|own| own.from != ValuesFrom::Unmeasured);
                finder.find(&quantity)?.filter(|_| measured)
            };
            if let Some(channel) = found {
                if channel.late != 0.0 {
                    let why = format!(
                        "`{quantity}` is stated to be late, and no track is moved in time: state the delay of its \
                         signal in the controllers' file"
                    );
                    return Err(why.into());
                }
                channels.push(channel);
                places.push(c);
            }
        }
        Ok(places)
    };
    let all: Vec<usize> = (0..info.coordinates.len()).collect();
    let with_rates = if search.rates { &all[..] } else { &[] };
    let places = Places {
        positions: add(&all, &Quantity::Position, false)?,
        velocities: add(with_rates, &Quantity::Velocity, false)?,
        commands: add(info.actuated, &Quantity::Position, true)?,
        efforts: add(info.actuated, &Quantity::Effort, false)?,
    };
    let before = 1 + places.positions.len();
    let velocity = |c: &usize| {
        let place = places.velocities.iter().position(|own| own == c);
        place.map(|place| before + place)
    };
    let layout = ColumnLayout {
        velocities: places.positions.iter().map(velocity).collect(),
        accelerations: vec![None; places.positions.len()],
        measured: places.positions.clone(),
        channels,
        derivatives: false,
        efforts: places.efforts.len(),
        unmeasured: Vec::new(),
        times,
        unused: Vec::new(),
        header: finder.header,
    };
    Ok((layout, places))
}
