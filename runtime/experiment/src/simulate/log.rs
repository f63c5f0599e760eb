//! The result of a run: how it ended, and all its samples.

use super::audit::Energy;
use regen_runtime::Outcome;

/// How a run ended: a numerical outcome, not an error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Termination {
    /// The run lasted its whole duration.
    Complete,
    /// The loops could not be kept closed: a singularity, or the end of the branch.
    Open(Outcome),
    /// The mass matrix is not positive definite: the parameters are not physically possible.
    NotPositiveDefinite,
    /// The integration would need steps that are too short.
    StepTooSmall,
    /// Positions, velocities or commands are not finite.
    Diverged,
}

impl std::fmt::Display for Termination {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Complete => f.write_str("after its whole duration"),
            Self::Open(outcome) => write!(f, "the loops cannot be kept closed ({outcome})"),
            Self::NotPositiveDefinite => f.write_str(
                "the mass matrix is not positive definite: the parameters are not those of bodies",
            ),
            Self::StepTooSmall => f.write_str("no step of the integration is short enough"),
            Self::Diverged => f.write_str("positions grew beyond all bounds"),
        }
    }
}

/// The log of a run: one row per sample, row-major.
///
/// Motion and efforts of a row belong to the same instant, at which the controller measures. At
/// that instant its command changes, and the effort of a drive without lag jumps with it: the row
/// has the mean of the efforts just before and just after, with the accelerations of that mean. The
/// second difference of the positions gives the same, as under a held command it is the mean of the
/// two accelerations. A log that paired a position with the effort commanded from it would be ahead
/// by half a period, and friction identified from it would be biased.
#[derive(Clone, Debug, PartialEq)]
pub struct Log {
    /// Whether the run reached its end, and if not, why it ended.
    pub ended: Termination,
    /// The times of the rows, s.
    pub t: Vec<f64>,
    /// All coordinates (n per row), rad or m.
    pub q: Vec<f64>,
    /// All velocities (n per row), rad/s or m/s.
    pub qd: Vec<f64>,
    /// All accelerations (n per row), rad/s^2 or m/s^2, caused by `effort`.
    pub qdd: Vec<f64>,
    /// The efforts that the drives apply (one per actuated joint and row), N or N m; where they
    /// jump, the mean of both sides.
    pub effort: Vec<f64>,
    /// The measured positions (one per actuated joint and row), rad or m.
    pub measured_position: Vec<f64>,
    /// The positions that the controllers followed (one per actuated joint and row), rad or m; empty
    /// in a run without control.
    pub command: Vec<f64>,
    /// The measured efforts (one per actuated joint and row), N or N m.
    pub measured_effort: Vec<f64>,
    /// The energies of each row, J; empty without [`Settings::energies`](super::Settings::energies).
    pub energy: Vec<Energy>,
    /// The largest constraint residual |f| of any sample, m or without unit.
    pub residual: f64,
    /// The largest error of the energy balance of any sample, J; NaN without energies.
    pub imbalance: f64,
    /// The number of steps of the integration, refused ones included.
    pub steps: usize,
}

impl Log {
    pub(super) fn empty() -> Self {
        Self {
            ended: Termination::Complete,
            t: Vec::new(),
            q: Vec::new(),
            qd: Vec::new(),
            qdd: Vec::new(),
            effort: Vec::new(),
            measured_position: Vec::new(),
            command: Vec::new(),
            measured_effort: Vec::new(),
            energy: Vec::new(),
            residual: 0.0,
            imbalance: 0.0,
            steps: 0,
        }
    }
}
