//! Comparison of a robot's functions with each other: each quantity is computed in two ways at
//! random closed states.

use regen_codegen::robot::{FunctionKind, Robot};
use regen_interpreted::Interpreted;
use regen_reference::{Random, State};
use regen_runtime::{LoopClosure, Model, Parameter, SizeError, Symbol};

use crate::check::{Identities, Report};
use crate::error::VerifyError;
use crate::states::{Reach, SEED, closed_state};
use crate::vector::{
    derivative_at_zero, dot, fill, larger, max_abs, mul_column_major, mul_row_major,
    relative_difference,
};
use crate::{base_identities, control_identities};

/// Number of closed states.
const STATES: usize = 8;
/// Largest error of identities whose sides differ by rounding only, relative to the larger side:
/// rounding of 1e-16, with seven digits left for terms that cancel.
pub(crate) const ROUNDING_BOUND: f64 = 1e-9;
/// Largest error of comparisons with finite differences, relative to the larger side: epsilon over
/// the step of the differences is some 1e-12, with six digits left for terms that cancel.
pub(crate) const DIFFERENCE_BOUND: f64 = 1e-6;

/// Checks a robot's functions against each other; the errors of the identities are relative.
///
/// # Errors
/// If no closed state is found near home, or the robot's sizes contradict each other.
pub fn identities(robot: &Robot) -> Result<Report, VerifyError> {
    let model = Interpreted::new(robot);
    let mut closure = LoopClosure::new(&model)?;
    let mut random = Random::new(SEED);
    let mut all = Identities::default();
    for index in 0..STATES {
        let state = closed_state(&model, &mut closure, &mut random, Reach::IDENTITIES)?;
        let phi: Vec<f64> = robot.parameters.iter().map(|_| random.signed()).collect();
        let checked_state = CheckedState {
            model: &model,
            index,
            state: &state,
            phi: &phi,
        };
        if robot.rows > 0 {
            checked_state.closure(&mut all)?;
        }
        checked_state.dynamics(&mut all, &mut random)?;
        checked_state.energy(&mut all, &mut random)?;
        if robot.function(FunctionKind::Momentum).is_some() {
            control_identities::check(&checked_state, &mut all, &mut random)?;
        }
        // the identities of base parameters need base parameters
        let analysis = robot.analysis.as_ref();
        if let Some(analysis) = analysis.filter(|a| a.base.rank() > 0) {
            base_identities::check(&checked_state, &analysis.base, &mut all, &mut random)?;
        }
    }
    Ok(Report {
        robot: robot.name.clone(),
        states: STATES,
        checks: all.checks(),
    })
}

/// A closed state with parameters, at which identities are checked.
pub(crate) struct CheckedState<'a> {
    pub(crate) model: &'a Interpreted<'a>,
    /// The index of the state in the order of sampling, from 0.
    index: usize,
    pub(crate) state: &'a State,
    /// The dynamic parameters, random numbers in the order of `Info::parameters`.
    pub(crate) phi: &'a [f64],
}

impl CheckedState<'_> {
    /// Compares two vectors that should be equal, with an error relative to the larger one or to
    /// `scale`.
    pub(crate) fn compare(
        &self,
        all: &mut Identities,
        statement: &'static str,
        [a, b]: [&[f64]; 2],
        scale: f64,
        bound: f64,
    ) {
        let error = relative_difference(a, b, scale);
        all.note(self.index, statement, error, bound);
    }

    /// q + t qd. The functions accept any q, closed or not, so that only the direction matters for
    /// a derivative.
    fn displaced(&self, t: f64) -> Vec<f64> {
        let State { q, qd, .. } = self.state;
        q.iter().zip(qd).map(|(q, qd)| q + t * qd).collect()
    }

    /// The derivative with respect to time of a function of q.
    fn rate(
        &self,
        f: impl Fn(&[f64]) -> Result<Vec<f64>, SizeError>,
    ) -> Result<Vec<f64>, SizeError> {
        derivative_at_zero(|t| f(&self.displaced(t)))
    }

    fn closure(&self, all: &mut Identities) -> Result<(), SizeError> {
        let State { q, qd, qdd } = self.state;
        let info = self.model.info();
        let (n, rows) = (q.len(), info.rows);
        let f = |q: &[f64]| fill(rows, |out| self.model.constraints(q, out));
        let jacobian = |q: &[f64]| fill(rows * n, |out| self.model.jacobian(q, out));
        let zero = vec![0.0; rows];

        self.compare(all, "f(q) = 0", [&f(q)?, &zero], 1.0, ROUNDING_BOUND);
        let a = jacobian(q)?;
        let slopes = |part: f64| {
            let mut out = vec![0.0; rows * n];
            for column in 0..n {
                let rates = derivative_at_zero(|h| {
                    let mut q = q.clone();
                    q[column] += part * h;
                    f(&q)
                })?;
                for (row, rate) in rates.into_iter().enumerate() {
                    out[row * n + column] = rate / part;
                }
            }
            Ok(out)
        };
        let differences = nearest(&a, slopes)?;
        self.compare(all, "A = df/dq", [&a, &differences], 0.0, DIFFERENCE_BOUND);
        let scale = max_abs(&a) * max_abs(qd);
        self.compare(
            all,
            "A qd = 0",
            [&mul_row_major(&a, qd), &zero],
            scale,
            ROUNDING_BOUND,
        );
        let b = fill(rows, |out| self.model.bias(q, qd, out))?;
        let scale = max_abs(&a) * max_abs(qdd);
        self.compare(
            all,
            "A qdd = b",
            [&mul_row_major(&a, qdd), &b],
            scale,
            ROUNDING_BOUND,
        );
        let drift: Vec<f64> = mul_row_major(&self.rate(jacobian)?, qd)
            .iter()
            .map(|x| -x)
            .collect();
        self.compare(
            all,
            "b = -(dA/dt) qd",
            [&b, &drift],
            scale,
            DIFFERENCE_BOUND,
        );
        // Newton's step at q - h d, with the dependent coordinates displaced by d, is h d to first
        // order.
        let offset: Vec<f64> = (0..info.dependent.len())
            .map(|k| 1.0 / (k as f64 + 1.0))
            .collect();
        let step = |part: f64| {
            let steps = derivative_at_zero(|h| {
                let mut q = q.clone();
                for (k, d) in info.dependent.iter().zip(&offset) {
                    q[*k] -= part * h * d;
                }
                fill(offset.len(), |out| self.model.newton_step(&q, out))
            })?;
            Ok(steps.iter().map(|x| x / part).collect())
        };
        let recovered = nearest(&offset, step)?;
        self.compare(
            all,
            "Newton's step leads back",
            [&recovered, &offset],
            1.0,
            DIFFERENCE_BOUND,
        );
        Ok(())
    }

    fn dynamics(&self, all: &mut Identities, random: &mut Random) -> Result<(), SizeError> {
        let State { q, qd, qdd } = self.state;
        let (model, phi) = (self.model, self.phi);
        let info = model.info();
        let (n, dof) = (q.len(), info.dof());
        let qd_i = self.independent(qd);
        let qdd_i = self.independent(qdd);

        let w = fill(dof * phi.len(), |out| model.regressor(q, qd, qdd, out))?;
        let w_phi = mul_column_major(&w, phi, dof);
        let tau = fill(dof, |out| model.inverse_dynamics(q, qd, qdd, phi, out))?;
        self.compare(
            all,
            "inverse dynamics = W phi",
            [&tau, &w_phi],
            1.0,
            ROUNDING_BOUND,
        );

        let mass = fill(dof * dof, |out| model.mass_matrix(q, phi, out))?;
        let bias_forces = fill(dof, |out| model.bias_forces(q, qd, phi, out))?;
        let gravity = fill(dof, |out| model.gravity(q, phi, out))?;
        let sum: Vec<f64> = mul_row_major(&mass, &qdd_i)
            .iter()
            .zip(bias_forces.iter().zip(&gravity))
            .map(|(inertial, (bias, gravity))| inertial + bias + gravity)
            .collect();
        self.compare(
            all,
            "W phi = M qdd_i + bias forces + gravity",
            [&w_phi, &sum],
            1.0,
            ROUNDING_BOUND,
        );
        let transposed: Vec<f64> = (0..dof * dof)
            .map(|k| mass[(k % dof) * dof + k / dof])
            .collect();
        self.compare(
            all,
            "M is symmetric",
            [&mass, &transposed],
            1.0,
            ROUNDING_BOUND,
        );

        let (zero_qd, zero_qdd_i) = (vec![0.0; n], vec![0.0; dof]);
        let qdd_at_rest = fill(n, |out| model.accelerations(q, &zero_qd, &zero_qdd_i, out))?;
        let tau_at_rest = fill(dof, |out| {
            model.inverse_dynamics(q, &zero_qd, &qdd_at_rest, phi, out)
        })?;
        self.compare(
            all,
            "gravity = W phi at rest",
            [&gravity, &tau_at_rest],
            1.0,
            ROUNDING_BOUND,
        );

        let y = fill(w.len(), |out| {
            model.adaptive_regressor(q, qd, &qd_i, &qdd_i, out)
        })?;
        self.compare(all, "Y(q, qd, qd, qdd) = W", [&y, &w], 1.0, ROUNDING_BOUND);

        let drive_efforts: Vec<f64> = info.actuated.iter().map(|_| random.signed()).collect();
        let generalized_forces = fill(dof, |out| model.generalized_forces(q, &drive_efforts, out))?;
        let drive_rates: Vec<f64> = info.actuated.iter().map(|&k| qd[k]).collect();
        self.compare(
            all,
            "power of the drives = efforts . qd_i",
            [
                &[dot(&generalized_forces, &qd_i)],
                &[dot(&drive_efforts, &drive_rates)],
            ],
            1.0,
            ROUNDING_BOUND,
        );
        Ok(())
    }

    /// The parameters without those that belong to no energy: friction and effort terms.
    pub(crate) fn with_energy(&self) -> Vec<f64> {
        // Friction and effort terms take power that no energy contains.
        let without_energy = |parameter: &Parameter<'_>| {
            parameter.is_friction() || matches!(parameter.symbol, Symbol::Term(_))
        };
        let info = self.model.info();
        let parameters = info.parameters.iter().zip(self.phi);
        parameters
            .map(|(parameter, &value)| {
                if without_energy(parameter) {
                    0.0
                } else {
                    value
                }
            })
            .collect()
    }

    fn energy(&self, all: &mut Identities, random: &mut Random) -> Result<(), SizeError> {
        let State { q, qd, .. } = self.state;
        let model = self.model;
        let info = model.info();
        let dof = info.dof();
        let qd_i = self.independent(qd);
        let phi = self.with_energy();

        let mass = |q: &[f64]| fill(dof * dof, |out| model.mass_matrix(q, &phi, out));
        let twice_kinetic = dot(&mul_row_major(&mass(q)?, &qd_i), &qd_i);
        self.compare(
            all,
            "kinetic energy of M = of the bodies' poses",
            [&[0.5 * twice_kinetic], &[self.kinetic(&phi)?]],
            1.0,
            DIFFERENCE_BOUND,
        );

        let bias_forces = fill(dof, |out| model.bias_forces(q, qd, &phi, out))?;
        let mass_rate = self.rate(mass)?;
        let mass_rate_power = dot(&mul_row_major(&mass_rate, &qd_i), &qd_i);
        self.compare(
            all,
            "power of bias forces = qd_i (dM/dt) qd_i / 2",
            [&[dot(&bias_forces, &qd_i)], &[0.5 * mass_rate_power]],
            1.0,
            DIFFERENCE_BOUND,
        );

        // dM/dt - 2 C is skew-symmetric, which adaptive control relies on. At zero accelerations
        // and without gravity, Y phi equals C v.
        let v: Vec<f64> = qd_i.iter().map(|_| random.signed()).collect();
        let zero_qdd_i = vec![0.0; dof];
        let y = fill(dof * phi.len(), |out| {
            model.adaptive_regressor(q, qd, &v, &zero_qdd_i, out)
        })?;
        let gravity = fill(dof, |out| model.gravity(q, &phi, out))?;
        self.compare(
            all,
            "v C v = v (dM/dt) v / 2",
            [
                &[dot(&mul_column_major(&y, &phi, dof), &v) - dot(&gravity, &v)],
                &[0.5 * dot(&mul_row_major(&mass_rate, &v), &v)],
            ],
            1.0,
            DIFFERENCE_BOUND,
        );
        Ok(())
    }

    /// The kinetic energy, with the bodies' velocities from finite differences of their poses.
    fn kinetic(&self, phi: &[f64]) -> Result<f64, SizeError> {
        let info = self.model.info();
        let poses = |q: &[f64]| fill(12 * info.bodies.len(), |out| self.model.poses(q, out));
        let poses_at_state = poses(&self.state.q)?;
        let rates = self.rate(poses)?;
        let mut energy = 0.0;
        for ((pose, rate), p) in poses_at_state
            .chunks_exact(12)
            .zip(rates.chunks_exact(12))
            .zip(phi.chunks_exact(10))
        {
            // p is Ixx, Ixy, Ixz, Iyy, Iyz, Izz, mx, my, mz, m of the body.
            // Velocities in body axes: v = R^T dp/dt, omega from R^T dR/dt.
            let column = |m: &[f64], j: usize| [m[j], m[3 + j], m[6 + j]];
            let v = [0, 1, 2].map(|j| dot(&column(pose, j), &rate[9..12]));
            let angular_rate = |i: usize, j: usize| dot(&column(pose, i), &column(rate, j));
            let omega = [angular_rate(2, 1), angular_rate(0, 2), angular_rate(1, 0)];
            let inertia = [p[0], p[1], p[2], p[1], p[3], p[4], p[2], p[4], p[5]];
            let v_cross_omega = [
                v[1] * omega[2] - v[2] * omega[1],
                v[2] * omega[0] - v[0] * omega[2],
                v[0] * omega[1] - v[1] * omega[0],
            ];
            energy += 0.5 * dot(&mul_row_major(&inertia, &omega), &omega)
                + 0.5 * p[9] * dot(&v, &v)
                + dot(&v_cross_omega, &p[6..9]);
        }
        for (parameter, value) in info.parameters.iter().zip(phi) {
            if let Some(k) = info
                .index_of(parameter.owner)
                .filter(|_| parameter.is_rotor())
            {
                energy += 0.5 * value * self.state.qd[k].powi(2);
            }
        }
        Ok(energy)
    }

    /// The entries of the independent coordinates, out of one entry per coordinate.
    pub(crate) fn independent(&self, all: &[f64]) -> Vec<f64> {
        let indices = self.model.info().independent;
        indices
            .iter()
            .filter_map(|&k| all.get(k).copied())
            .collect()
    }
}

/// Parts of the usual step of differences: along a screw with a small lead the usual one is a large angle.
const STEP_PARTS: [f64; 3] = [1.0, 1.0 / 16.0, 1.0 / 256.0];

/// The derivatives nearest to these, by steps of several sizes: a wrong derivative is far from all of them.
fn nearest(
    to: &[f64],
    derivatives: impl Fn(f64) -> Result<Vec<f64>, SizeError>,
) -> Result<Vec<f64>, SizeError> {
    let apart = |own: &[f64]| {
        let pairs = own.iter().zip(to);
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, larger)
    };
    let mut found = derivatives(1.0)?;
    for part in STEP_PARTS.into_iter().skip(1) {
        let other = derivatives(part)?;
        // false for NaN
        if apart(&other) < apart(&found) {
            found = other;
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used)]

    use super::*;
    use regen_codegen::Mechanism;
    use regen_codegen::diag::Source;
    use regen_codegen::optimize::Operand;

    fn robot(file: &str) -> Robot {
        let path = format!("{}/../../robots/{file}", env!("CARGO_MANIFEST_DIR"));
        let text = std::fs::read_to_string(path).unwrap();
        let mechanism = Mechanism::open(&Source::new(file, text)).unwrap();
        mechanism.robot(&FunctionKind::ALL).unwrap()
    }

    fn passes(robot: &Robot) -> bool {
        identities(robot).is_ok_and(|report| report.failed().next().is_none())
    }

    #[test]
    fn a_derived_robot_passes() {
        for file in ["fourbar.yaml", "tree_branch.yaml", "3rps_friction.yaml"] {
            assert!(passes(&robot(file)), "{file}");
        }
    }

    /// Replaces one output of one function: some check must fail. The matrix `A_e` is not compared
    /// here, since the closure uses only the sign of its determinant. Cones, which the five-bar
    /// does not have, do not affect the dynamics.
    #[test]
    fn a_wrong_output_of_any_function_is_noticed() {
        let derived = robot("fivebar.yaml");
        for kind in FunctionKind::ALL {
            if matches!(kind, FunctionKind::DependentJacobian | FunctionKind::Cones) {
                continue;
            }
            let mut altered = derived.clone();
            let function = altered
                .functions
                .iter_mut()
                .find(|f| f.kind == kind)
                .unwrap();
            // The last output that is not a constant.
            let outputs = &mut function.program.outputs;
            let is_computed = |o: &Operand| !matches!(o, Operand::Constant(_));
            let k = outputs.iter().rposition(is_computed).unwrap();
            outputs[k] = Operand::Constant(0.321);
            assert!(!passes(&altered), "{kind:?}, output {k}");
        }
    }
}
