//! Runs from the tracks of logs.

use core::fmt;

use regen_identify::data::Track;
use regen_runtime::{ClosureError, Info, Outcome};

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
pub(crate) fn driven(
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
