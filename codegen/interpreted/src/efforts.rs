//! The efforts of a robot's drives at rest, to which joints yield that a calibration finds.

use core::fmt;

use nalgebra::{DMatrix, DVector};
use regen_calibrate::Efforts;
use regen_codegen::robot::Robot;
use regen_codegen::signature::FunctionKind;
use regen_runtime::Model;

use crate::Interpreted;

/// The efforts of a robot's drives at rest, with the values that its description states.
pub struct NominalEfforts<'a> {
    model: Interpreted<'a>,
    phi: Vec<f64>,
}

/// Why the efforts at rest are not known.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum UnknownEfforts {
    /// These parameters have no value in the description.
    Missing(Vec<String>),
    /// There are not as many drives as freedoms, so that balance does not say what each of them holds.
    Shared,
}

impl fmt::Display for UnknownEfforts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing(labels) => write!(
                f,
                "compliances need the efforts that hold the robot, and its description states no value of {}",
                labels.join(", ")
            ),
            Self::Shared => f.write_str(
                "compliances need the effort of each drive, and there are not as many drives as freedoms",
            ),
        }
    }
}

impl core::error::Error for UnknownEfforts {}

impl<'a> NominalEfforts<'a> {
    /// The functions that it needs of a robot.
    pub const KINDS: [FunctionKind; 2] = [FunctionKind::Gravity, FunctionKind::GeneralizedForces];

    /// The efforts of a robot that was derived with [`Self::KINDS`].
    ///
    /// # Errors
    /// When values of the description are missing on which they depend, or balance does not determine
    /// them.
    pub fn new(robot: &'a Robot) -> Result<Self, UnknownEfforts> {
        let model = Interpreted::new(robot);
        if robot.actuated.len() != robot.independent.len() {
            return Err(UnknownEfforts::Shared);
        }
        let mut out = Self {
            model,
            phi: vec![0.0; robot.parameters.len()],
        };
        // states that need not be closed show which parameters count
        let turned = |way: f64| {
            let home = robot.home.iter().enumerate();
            home.map(|(k, x)| x + way * (0.3 + 0.1 * k as f64))
                .collect()
        };
        let states: [Vec<f64>; 3] = [robot.home.clone(), turned(1.0), turned(-1.0)];
        let mut missing = Vec::new();
        let stated = |k: usize| robot.nominal.get(k).copied().flatten();
        for (k, parameter) in robot.parameters.iter().enumerate() {
            if stated(k).is_none() {
                // forces are linear in the parameters, and all others are 0
                out.phi[k] = 1.0;
                let mut forces = states.iter().filter_map(|q| out.forces(q));
                if forces.any(|all| all.iter().any(|force| force.abs() > 1e-9)) {
                    missing.push(parameter.label.clone());
                }
                out.phi[k] = 0.0;
            }
        }
        if !missing.is_empty() {
            return Err(UnknownEfforts::Missing(missing));
        }
        for (k, value) in out.phi.iter_mut().enumerate() {
            *value = stated(k).unwrap_or(0.0);
        }
        Ok(out)
    }

    /// The forces that hold the independent coordinates.
    fn forces(&self, q: &[f64]) -> Option<Vec<f64>> {
        let mut out = vec![0.0; self.model.info().dof()];
        let _condition = self.model.gravity(q, &self.phi, &mut out).ok()?;
        out.iter().all(|x| x.is_finite()).then_some(out)
    }
}

impl Efforts for NominalEfforts<'_> {
    fn at(&self, q: &[f64]) -> Option<Vec<f64>> {
        let info = self.model.info();
        let mut forces = self.forces(q)?;
        if info.actuated != info.independent {
            let n = forces.len();
            let mut shares = DMatrix::zeros(n, n);
            let mut unit = vec![0.0; n];
            let mut column = vec![0.0; n];
            for k in 0..n {
                unit.fill(0.0);
                unit[k] = 1.0;
                let forces = self.model.generalized_forces(q, &unit, &mut column);
                let _condition = forces.ok()?;
                shares.column_mut(k).copy_from_slice(&column);
            }
            let solved = shares.lu().solve(&DVector::from_vec(forces))?;
            forces = solved.as_slice().to_vec();
        }
        let mut out = vec![0.0; q.len()];
        for (c, force) in info.actuated.iter().zip(forces) {
            out[*c] = force;
        }
        out.iter().all(|x| x.is_finite()).then_some(out)
    }
}
