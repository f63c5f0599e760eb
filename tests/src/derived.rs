//! The engine under test, interpreted: programs as they leave the derivation.

use nalgebra::DMatrix;
use regen_codegen::diag::Source;
use regen_codegen::interpret::run;
use regen_codegen::pipeline::{BaseFrom, DeriveError, derive, derive_with};
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
        match derive_with(&Source::new(name, text), BaseFrom::Nowhere) {
            Ok(robot) => Ok(Derived { robot }),
            Err(DeriveError::Spec(report)) => Err(report.to_string()),
            Err(other) => Err(format!("{other:?}")),
        }
    }

    /// Derives the robot of a file.
    ///
    /// # Errors
    /// Where the file cannot be read, or the report of the spec's mistakes.
    pub fn from_file(path: &std::path::Path) -> Answer<Derived> {
        let text = std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))?;
        Derived::new(&path.display().to_string(), &text)
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

    /// A result stored column by column.
    fn columns(&self, kind: FunctionKind, inputs: &[&[f64]]) -> Answer<DMatrix<f64>> {
        let rows = self.robot.independent.len();
        let values = self.call(kind, inputs)?;
        Ok(DMatrix::from_column_slice(
            rows,
            values.len() / rows,
            &values,
        ))
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
            parameters: robot.parameters.clone(),
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

    fn constraints(&self, q: &[f64]) -> Answer<Vec<f64>> {
        self.call(FunctionKind::Constraints, &[q])
    }

    fn jacobian(&self, q: &[f64]) -> Answer<DMatrix<f64>> {
        let values = self.call(FunctionKind::Jacobian, &[q])?;
        Ok(DMatrix::from_row_slice(self.robot.rows, q.len(), &values))
    }

    fn bias(&self, q: &[f64], qd: &[f64]) -> Answer<Vec<f64>> {
        self.call(FunctionKind::Bias, &[q, qd])
    }

    fn newton_step(&self, q: &[f64]) -> Answer<Vec<f64>> {
        self.call(FunctionKind::NewtonStep, &[q])
    }

    fn velocities(&self, q: &[f64], qd_i: &[f64]) -> Answer<Vec<f64>> {
        self.call(FunctionKind::Velocities, &[q, qd_i])
    }

    fn accelerations(&self, q: &[f64], qd: &[f64], qdd_i: &[f64]) -> Answer<Vec<f64>> {
        self.call(FunctionKind::Accelerations, &[q, qd, qdd_i])
    }

    fn regressor(&self, q: &[f64], qd: &[f64], qdd: &[f64]) -> Answer<DMatrix<f64>> {
        self.columns(FunctionKind::Regressor, &[q, qd, qdd])
    }

    fn inverse_dynamics(
        &self,
        q: &[f64],
        qd: &[f64],
        qdd: &[f64],
        phi: &[f64],
    ) -> Answer<Vec<f64>> {
        self.call(FunctionKind::InverseDynamics, &[q, qd, qdd, phi])
    }

    fn gravity(&self, q: &[f64], phi: &[f64]) -> Answer<Vec<f64>> {
        self.call(FunctionKind::Gravity, &[q, phi])
    }

    fn bias_forces(&self, q: &[f64], qd: &[f64], phi: &[f64]) -> Answer<Vec<f64>> {
        self.call(FunctionKind::BiasForces, &[q, qd, phi])
    }

    fn mass_matrix(&self, q: &[f64], phi: &[f64]) -> Answer<DMatrix<f64>> {
        self.columns(FunctionKind::MassMatrix, &[q, phi])
    }

    fn slotine_li(
        &self,
        q: &[f64],
        qd: &[f64],
        qd_r_i: &[f64],
        qdd_r_i: &[f64],
    ) -> Answer<DMatrix<f64>> {
        self.columns(FunctionKind::SlotineLi, &[q, qd, qd_r_i, qdd_r_i])
    }

    fn efforts(&self, q: &[f64], tau_actuated: &[f64]) -> Answer<Vec<f64>> {
        self.call(FunctionKind::Efforts, &[q, tau_actuated])
    }

    fn poses(&self, q: &[f64]) -> Answer<Vec<[f64; 12]>> {
        let values = self.call(FunctionKind::Poses, &[q])?;
        let (poses, _) = values.as_chunks::<12>();
        Ok(poses.to_vec())
    }

    fn cones(&self, q: &[f64]) -> Answer<Vec<f64>> {
        if self.robot.cones.is_empty() {
            return Ok(Vec::new());
        }
        self.call(FunctionKind::Cones, &[q])
    }
}
