//! Runs from the tracks of logs.

use core::fmt;

use regen_experiment::simulate::Reference;
use regen_identify::data::Track;
use regen_identify::identify::{Completed, Completion};
use regen_runtime::{ClosureError, Info, Model, Outcome};

use crate::setup::Run;

/// What a track lacks, or where its commands cannot be followed.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum TrackError {
    /// A signal of an actuated joint is missing.
    Missing {
        /// What is missing: `command` or `effort`.
        what: &'static str,
        /// The joint's name.
        joint: String,
    },
    /// The loops cannot be closed at the commanded positions.
    Open {
        /// The time, s.
        time: f64,
        /// The reason.
        outcome: Option<Outcome>,
    },
    /// The commands do not fit the model.
    Closure(ClosureError),
}

impl fmt::Display for TrackError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing { what, joint } => write!(f, "the log has no {what} of {joint}"),
            Self::Open { time, outcome } => {
                write!(
                    f,
                    "the loops cannot be closed at the commanded positions at {time} s"
                )?;
                outcome.map_or(Ok(()), |why| write!(f, ": {why}"))
            }
            Self::Closure(why) => why.fmt(f),
        }
    }
}

impl core::error::Error for TrackError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            Self::Closure(why) => Some(why),
            _ => None,
        }
    }
}

impl From<ClosureError> for TrackError {
    fn from(why: ClosureError) -> Self {
        Self::Closure(why)
    }
}

/// The signals of all actuated joints, in the order of `Info::actuated`.
fn driven(
    signals: &[(usize, Vec<f64>)],
    info: &Info<'_>,
    what: &'static str,
) -> Result<Vec<Vec<f64>>, TrackError> {
    let of = |c: &usize| {
        let own = signals.iter().find(|(k, _)| k == c);
        own.map(|(_, x)| x.clone())
            .ok_or_else(|| TrackError::Missing {
                what,
                joint: info.coordinates.get(*c).copied().unwrap_or("?").to_owned(),
            })
    };
    info.actuated.iter().map(of).collect()
}

/// The efforts of all actuated joints in a track, in the order of `Info::actuated`.
///
/// # Errors
/// [`TrackError::Missing`].
pub fn efforts(track: &Track, info: &Info<'_>) -> Result<Vec<Vec<f64>>, TrackError> {
    driven(&track.efforts, info, "effort")
}

impl Run {
    /// The run of a track.
    ///
    /// # Errors
    /// [`TrackError::Missing`] without a command of each actuated joint.
    ///
    /// ```
    /// use regen_identify::data::Track;
    /// use regen_response::{Run, TrackError};
    /// use regen_runtime::Info;
    ///
    /// let info = Info { coordinates: &["q1"], independent: &[0], actuated: &[0], ..Info::EMPTY };
    /// let track = Track { times: vec![0.0, 0.1], ..Track::default() };
    /// let error = Run::of_track(&track, &info).unwrap_err();
    /// assert_eq!(error.to_string(), "the log has no command of q1");
    /// ```
    pub fn of_track(track: &Track, info: &Info<'_>) -> Result<Self, TrackError> {
        Ok(Self {
            times: track.times.clone(),
            commands: driven(&track.commands, info, "command")?,
            positions: track.positions.clone(),
            velocities: track.velocities.clone(),
        })
    }
}

/// The motion of the independent coordinates that the commands of a track require. At any time the
/// positions are those of the nearest row, velocities are central differences of the rows (at the first
/// row, with whose velocity simulations begin, that of the cubic through four rows if these change alike),
/// and accelerations are 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Commanded {
    times: Vec<f64>,
    /// For each row, the independent positions.
    positions: Vec<Vec<f64>>,
}

impl Commanded {
    /// Closes the loops at the commanded positions of all actuated joints.
    ///
    /// # Errors
    /// When a command is missing, or the loops do not close at the commands.
    pub fn new<M: Model<f64> + ?Sized>(model: &M, track: &Track) -> Result<Self, TrackError> {
        let info = model.info();
        let commands = driven(&track.commands, &info, "command")?;
        let mut completion =
            Completion::new(model, info.actuated, &vec![1.0; info.actuated.len()])?;
        let still = vec![0.0; info.actuated.len()];
        let mut positions = Vec::with_capacity(track.times.len());
        for (row, time) in track.times.iter().enumerate() {
            let q: Vec<f64> = commands.iter().map(|x| x[row]).collect();
            let state = match completion.complete(&q, &still, &still)? {
                Completed::State(state) => state,
                Completed::Open(outcome) => {
                    return Err(TrackError::Open {
                        time: *time,
                        outcome: Some(outcome),
                    });
                }
                Completed::Unmeasured => {
                    return Err(TrackError::Open {
                        time: *time,
                        outcome: None,
                    });
                }
            };
            let independent = info.independent.iter();
            positions.push(independent.map(|c| state.q[*c]).collect());
        }
        Ok(Self {
            times: track.times.clone(),
            positions,
        })
    }
}

impl Reference for Commanded {
    fn at(&self, t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]) {
        // the nearest row: simulated samples are those of the log, up to rounding
        let next = self.times.partition_point(|x| *x < t);
        let last = self.times.len().saturating_sub(1);
        let distance = |k: usize| self.times.get(k).map_or(f64::INFINITY, |x| (x - t).abs());
        let row = if next > 0 && distance(next - 1) < distance(next) {
            next - 1
        } else {
            next.min(last)
        };
        let [before, after] = [row.saturating_sub(1), (row + 1).min(last)];
        let span = self.times.get(after).zip(self.times.get(before));
        let span = span.map_or(0.0, |(b, a)| b - a);
        qdd.fill(0.0);
        for (k, (q, qd)) in q.iter_mut().zip(qd).enumerate() {
            let value = |row: usize| self.positions.get(row).and_then(|p| p.get(k)).copied();
            *q = value(row).unwrap_or(f64::NAN);
            let difference = value(after).zip(value(before)).map_or(0.0, |(b, a)| b - a);
            *qd = if span > 0.0 { difference / span } else { 0.0 };
            if row == 0
                && span > 0.0
                && let [Some(a), Some(b), Some(c), Some(d)] = [0, 1, 2, 3].map(value)
            {
                // of the cubic through four rows, unless commands are steps
                let (first, middle, last) = (b - a, c - b, d - c);
                let is_like_middle = |x: f64| (0.5..2.0).contains(&(x / middle));
                if is_like_middle(first) && is_like_middle(last) {
                    *qd = (11.0 * first - 7.0 * middle + 2.0 * last) / (6.0 * span);
                }
            }
        }
    }
}
