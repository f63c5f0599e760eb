//! What a run leaves: its end, and all samples.

use super::audit::Energy;
use regen_runtime::Outcome;

/// How a run ended. A numerical outcome.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Termination {
    /// After its whole duration.
    Complete,
    /// The loops could not be kept closed: a singularity, or the end of the branch.
    Open(Outcome),
    /// The mass matrix is not positive definite: the parameters are not those of bodies.
    NotPositiveDefinite,
    /// No step of the integration is short enough.
    StepTooSmall,
    /// Positions or velocities grew beyond all bounds.
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

/// What happened, sample by sample: one row each, row-major.
///
/// Motion and efforts of a row belong to the same instant, which is when the controller measures.
/// There its command changes, and the effort of a drive without lag jumps with it: the row has
/// the mean of the efforts just before and just after, with the accelerations of that mean. It is
/// what the second difference of the positions tells, which under a held command is the mean of
/// the two accelerations. A log that paired a position with the effort commanded from it would be
/// ahead by half a period, and friction identified from it would be biased.
#[derive(Clone, Debug, PartialEq)]
pub struct Log {
    /// How the run ended.
    pub ended: Termination,
    /// Times, s.
    pub t: Vec<f64>,
    /// All coordinates (n a row).
    pub q: Vec<f64>,
    /// All velocities (n a row).
    pub qd: Vec<f64>,
    /// All accelerations (n a row): those of `effort`.
    pub qdd: Vec<f64>,
    /// The efforts that the drives apply (one per actuated joint a row), N or N m: where they jump,
    /// the mean of both sides.
    pub effort: Vec<f64>,
    /// The positions of actuated joints as measured.
    pub measured_position: Vec<f64>,
    /// The efforts of actuated joints as measured.
    pub measured_effort: Vec<f64>,
    /// Energies.
    pub energy: Vec<Energy>,
    /// The largest constraint residual |f| of any sample, m or without unit.
    pub residual: f64,
    /// The largest imbalance of energy of any sample, J.
    pub imbalance: f64,
    /// Steps of the integration, refused ones included.
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
            measured_effort: Vec::new(),
            energy: Vec::new(),
            residual: 0.0,
            imbalance: 0.0,
            steps: 0,
        }
    }
}
