//! Vectors of another program for a spec, in a file `vectors/NAME.json`.

use std::path::Path;

use regen_codegen::robot::Robot;
use serde::Deserialize;

use crate::exit::Failure;
use crate::load;

/// States with parameters, and the forces that the other program finds.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Vectors {
    /// Which program.
    pub(crate) by: String,
    coordinates: Vec<String>,
    independent: Vec<String>,
    parameters: Vec<String>,
    pub(crate) states: Vec<State>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct State {
    pub(crate) q: Vec<f64>,
    pub(crate) qd: Vec<f64>,
    pub(crate) qdd: Vec<f64>,
    pub(crate) phi: Vec<f64>,
    pub(crate) tau: Vec<f64>,
}

/// Where the vectors of a spec are looked for, from its folder: beside it, or among the fixtures of
/// the workspace whose folder of robots holds it.
const FOLDERS: [&str; 2] = ["vectors", "../tests/fixtures/vectors"];

impl Vectors {
    /// Those of a spec; `None` where there are none.
    pub(crate) fn of(spec: &Path) -> Result<Option<Self>, Failure> {
        let Some(stem) = spec.file_stem() else {
            return Ok(None);
        };
        let mut files = FOLDERS.iter().map(|folder| {
            let mut file = spec.with_file_name(folder).join(stem);
            file.as_mut_os_string().push(".json");
            file
        });
        let Some(file) = files.find(|file| file.is_file()) else {
            return Ok(None);
        };
        let text = load::text(&file)?;
        serde_json::from_str(&text).map(Some).map_err(|error| {
            Failure::Input(format!(
                "{}: {error}; tests/tools/vectors/forces.py writes such files",
                file.display()
            ))
        })
    }

    /// Whether they are of this robot: names in the same order, and as many numbers.
    pub(crate) fn fit(&self, robot: &Robot) -> Result<(), String> {
        let independent: Vec<&String> = robot
            .independent
            .iter()
            .filter_map(|k| robot.coordinates.get(*k))
            .collect();
        let names = self.coordinates == robot.coordinates
            && self.independent.iter().eq(independent)
            && self.parameters == robot.parameters;
        let n = self.coordinates.len();
        let long = |state: &State| {
            [state.q.len(), state.qd.len(), state.qdd.len()] == [n; 3]
                && state.phi.len() == self.parameters.len()
                && state.tau.len() == self.independent.len()
        };
        if names && !self.states.is_empty() && self.states.iter().all(long) {
            Ok(())
        } else {
            Err("vectors of another spec".to_owned())
        }
    }
}
