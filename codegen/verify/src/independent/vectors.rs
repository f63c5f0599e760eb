//! Forces at given states, computed by another program.

use regen_codegen::robot::Robot;
use serde::Deserialize;

use crate::error::VerifyError;

/// States with parameters, and the forces that another program computed for them.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Vectors {
    /// The name of the program.
    pub(super) by: String,
    coordinates: Vec<String>,
    independent: Vec<String>,
    parameters: Vec<String>,
    pub(super) states: Vec<State>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct State {
    pub(super) q: Vec<f64>,
    pub(super) qd: Vec<f64>,
    pub(super) qdd: Vec<f64>,
    pub(super) phi: Vec<f64>,
    pub(super) tau: Vec<f64>,
}

impl Vectors {
    /// Reads the vectors from JSON.
    ///
    /// # Errors
    /// If the text is not JSON of this form.
    pub fn parse(text: &str) -> Result<Self, VerifyError> {
        serde_json::from_str(text).map_err(VerifyError::Vectors)
    }

    /// Checks that the vectors belong to this robot: the same names in the same order, and the
    /// right counts of numbers. The error describes the difference.
    pub(super) fn fit(&self, robot: &Robot) -> Result<(), String> {
        let independent: Vec<&String> = robot
            .independent
            .iter()
            .filter_map(|k| robot.coordinates.get(*k))
            .collect();
        let names = self.coordinates == robot.coordinates
            && self.independent.iter().eq(independent)
            && self.parameters == robot.labels();
        let n = self.coordinates.len();
        let has_all_numbers = |state: &State| {
            [state.q.len(), state.qd.len(), state.qdd.len()] == [n; 3]
                && state.phi.len() == self.parameters.len()
                && state.tau.len() == self.independent.len()
        };
        if names && !self.states.is_empty() && self.states.iter().all(has_all_numbers) {
            Ok(())
        } else {
            Err("vectors of another spec".to_owned())
        }
    }
}
