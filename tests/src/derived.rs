//! The engine under test: the derived programs, evaluated by the interpreter.

use regen_codegen::diag::Source;
use regen_codegen::interpret::run;
use regen_codegen::pipeline::{BaseSource, DeriveError, derive, derive_with};
use regen_codegen::robot::{FunctionKind, Robot};

use crate::engine::{Answer, Engine, Names};

/// A robot derived from a spec, its programs interpreted.
#[derive(Debug)]
pub struct Derived {
    /// The derived robot.
    pub robot: Robot,
}

impl Derived {
    /// Derives the robot of a spec's text.
    ///
    /// # Errors
    /// The report of the spec's mistakes.
    pub fn new(name: &str, text: &str) -> Answer<Derived> {
        let robot = derive(&Source::new(name, text)).map_err(|e| e.to_string())?;
        Ok(Derived { robot })
    }

    /// Derives the robot of a spec's text without base parameters, which take longer than the rest.
    ///
    /// # Errors
    /// The report of the spec's mistakes.
    pub fn without_base(name: &str, text: &str) -> Answer<Derived> {
        match derive_with(&Source::new(name, text), BaseSource::Skip) {
            Ok(robot) => Ok(Derived { robot }),
            Err(DeriveError::Spec(report)) => Err(report.to_string()),
            Err(other) => Err(format!("{other:?}")),
        }
    }

    /// Derives the robot of a file.
    ///
    /// # Errors
    /// When the file cannot be read, or the report of the spec's mistakes.
    pub fn from_file(path: &std::path::Path) -> Answer<Derived> {
        let text = std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))?;
        Derived::new(&path.display().to_string(), &text)
    }
}

impl Engine for Derived {
    fn names(&self) -> Names {
        let robot = &self.robot;
        let of = |which: &[usize]| {
            which
                .iter()
                .map(|c| robot.coordinates[*c].clone())
                .collect()
        };
        Names {
            coordinates: robot.coordinates.clone(),
            independent: of(&robot.independent),
            actuated: of(&robot.actuated),
            parameters: robot.parameters.iter().map(|p| p.label.clone()).collect(),
            bodies: robot.bodies.clone(),
            cuts: robot
                .cuts
                .iter()
                .map(|c| (c.name.clone(), c.rows))
                .collect(),
            cones: robot
                .cones
                .iter()
                .map(|c| (c.name.clone(), c.greatest))
                .collect(),
            nominal: robot.nominal.clone(),
        }
    }

    fn home(&self) -> Vec<f64> {
        self.robot.home.clone()
    }

    fn call(&self, kind: FunctionKind, inputs: &[&[f64]]) -> Answer<Vec<f64>> {
        let Some(function) = self.robot.function(kind) else {
            return Ok(Vec::new());
        };
        let (values, condition) = run(&function.program, inputs);
        if condition > 1e-10 {
            Ok(values)
        } else {
            Err(format!("{} is singular ({condition:e})", kind.name()))
        }
    }
}
