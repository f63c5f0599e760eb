//! What a run leaves: its end, and all samples.

use std::vec::Vec;

use super::audit::Energy;
use crate::Outcome;

/// How a run ended. A numerical outcome.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Ended {
    /// After its whole duration.
    Complete,
    /// The loops could not be kept closed: a singularity, or the end of the branch.
    Open(Outcome),
    /// The mass matrix is not positive definite: the parameters are not those of bodies.
    NoMass,
    /// No step of the integration is short enough.
    Stiff,
    /// Positions or velocities grew beyond all bounds.
    Diverged,
}

/// What happened, sample by sample: one row each, row-major.
#[derive(Clone, Debug, PartialEq)]
pub struct Log {
    /// How the run ended.
    pub ended: Ended,
    /// Times, s.
    pub t: Vec<f64>,
    /// All coordinates (n a row).
    pub q: Vec<f64>,
    /// All velocities (n a row).
    pub qd: Vec<f64>,
    /// All accelerations (n a row).
    pub qdd: Vec<f64>,
    /// The efforts that the drives apply (one per actuated joint a row).
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
            ended: Ended::Complete,
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
