//! Comparison of the functions for controllers with the others and with differences along motions
//! that keep the loops closed.

use regen_reference::{Random, State};
use regen_runtime::{ControlModel, Model, SizeError};

use crate::check::Identities;
use crate::identities::{CheckedState, DIFFERENCE_BOUND, ROUNDING_BOUND};
use crate::vector::{derivative_at_zero, dot, fill, max_abs, mul_column_major, mul_row_major};

/// A state at which the functions are checked, with its sizes.
struct Checked<'a> {
    at: &'a CheckedState<'a>,
    dof: usize,
    qd_i: Vec<f64>,
    qdd_i: Vec<f64>,
}

/// Checks momentum, Coriolis matrix, forward dynamics and derivatives.
pub(crate) fn check(
    at: &CheckedState<'_>,
    all: &mut Identities,
    random: &mut Random,
) -> Result<(), SizeError> {
    let State { qd, qdd, .. } = at.state;
    let checked = Checked {
        at,
        dof: at.model.info().dof(),
        qd_i: at.independent(qd),
        qdd_i: at.independent(qdd),
    };
    checked.momentum(all)?;
    checked.coriolis(all)?;
    checked.inverse(all)?;
    checked.frames(all)?;
    checked.forward(all, random)
}

impl Checked<'_> {
    /// q and qd at the time t of the motion.
    fn moved(&self, t: f64) -> [Vec<f64>; 2] {
        let State { q, qd, qdd } = self.at.state;
        let along = |x: &[f64], rate: &[f64]| x.iter().zip(rate).map(|(x, v)| x + t * v).collect();
        [along(q, qd), along(qd, qdd)]
    }

    fn momentum(&self, all: &mut Identities) -> Result<(), SizeError> {
        let (at, dof) = (self.at, self.dof);
        let State { q, qd, qdd } = at.state;
        let (model, phi) = (at.model, at.phi);
        let p = |q: &[f64], qd: &[f64]| fill(dof, |out| model.momentum(q, qd, phi, out));
        let mass = fill(dof * dof, |out| model.mass_matrix(q, phi, out))?;
        let own = p(q, qd)?;
        let product = mul_row_major(&mass, &self.qd_i);
        let mut same = |statement, a: &[f64], b: &[f64], bound| {
            at.compare(all, statement, [a, b], 1.0, bound);
        };
        same("momentum = M qd_i", &own, &product, ROUNDING_BOUND);
        let columns = fill(dof * phi.len(), |out| model.momentum_regressor(q, qd, out))?;
        let product = mul_column_major(&columns, phi, dof);
        same("Y_p phi = momentum", &product, &own, ROUNDING_BOUND);
        let rate = fill(dof, |out| model.momentum_rate(q, qd, phi, out))?;
        let columns = fill(dof * phi.len(), |out| {
            model.momentum_rate_regressor(q, qd, out)
        })?;
        let product = mul_column_major(&columns, phi, dof);
        same(
            "Y_r phi = rate of momentum",
            &product,
            &rate,
            ROUNDING_BOUND,
        );
        let tau = fill(dof, |out| model.inverse_dynamics(q, qd, qdd, phi, out))?;
        let sum: Vec<f64> = tau.iter().zip(&rate).map(|(a, b)| a + b).collect();
        let differences = derivative_at_zero(|t| {
            let [q, qd] = self.moved(t);
            p(&q, &qd)
        })?;
        same("dp/dt = tau + r", &differences, &sum, DIFFERENCE_BOUND);
        Ok(())
    }

    fn coriolis(&self, all: &mut Identities) -> Result<(), SizeError> {
        let (at, dof) = (self.at, self.dof);
        let State { q, qd, .. } = at.state;
        let model = at.model;
        let phi = at.with_energy();
        let c = fill(dof * dof, |out| model.coriolis_matrix(q, qd, &phi, out))?;
        let efforts = mul_row_major(&c, &self.qd_i);
        let bias = fill(dof, |out| model.bias_forces(q, qd, &phi, out))?;
        at.compare(
            all,
            "C qd_i = bias forces",
            [&efforts, &bias],
            1.0,
            ROUNDING_BOUND,
        );
        let both: Vec<f64> = (0..dof * dof)
            .map(|k| c[k] + c[(k % dof) * dof + k / dof])
            .collect();
        let rate = derivative_at_zero(|t| {
            let [q, _] = self.moved(t);
            fill(dof * dof, |out| model.mass_matrix(&q, &phi, out))
        })?;
        at.compare(
            all,
            "dM/dt = C + C^T",
            [&rate, &both],
            1.0,
            DIFFERENCE_BOUND,
        );
        // the velocities of any other motion, for the symmetry of the Christoffel symbols
        let v_i: Vec<f64> = (0..dof).map(|k| 1.0 / (k as f64 + 1.5)).collect();
        let v = fill(q.len(), |out| model.velocities(q, &v_i, out))?;
        let other = fill(dof * dof, |out| model.coriolis_matrix(q, &v, &phi, out))?;
        let [there, back] = [mul_row_major(&c, &v_i), mul_row_major(&other, &self.qd_i)];
        at.compare(
            all,
            "C(qd) v = C(v) qd",
            [&there, &back],
            1.0,
            ROUNDING_BOUND,
        );
        Ok(())
    }

    /// Inverse dynamics where the independent coordinates and velocities are displaced, the others
    /// following along the closure to first order.
    fn displaced(&self, dq_i: &[f64], dqd_i: &[f64], phi: &[f64]) -> Result<Vec<f64>, SizeError> {
        let model = self.at.model;
        let State { q, .. } = self.at.state;
        let n = q.len();
        let dq = fill(n, |out| model.velocities(q, dq_i, out))?;
        let q: Vec<f64> = q.iter().zip(&dq).map(|(q, d)| q + d).collect();
        let qd_i: Vec<f64> = self.qd_i.iter().zip(dqd_i).map(|(v, d)| v + d).collect();
        let qd = fill(n, |out| model.velocities(&q, &qd_i, out))?;
        let qdd = fill(n, |out| model.accelerations(&q, &qd, &self.qdd_i, out))?;
        fill(self.dof, |out| {
            model.inverse_dynamics(&q, &qd, &qdd, phi, out)
        })
    }

    fn inverse(&self, all: &mut Identities) -> Result<(), SizeError> {
        let (at, dof) = (self.at, self.dof);
        let State { q, qd, qdd } = at.state;
        let own = fill(2 * dof * dof, |out| {
            at.model
                .inverse_dynamics_derivatives(q, qd, qdd, at.phi, out)
        })?;
        let mut differences = Vec::with_capacity(own.len());
        for column in 0..2 * dof {
            differences.extend(derivative_at_zero(|t| {
                let mut steps = vec![0.0; 2 * dof];
                steps[column] = t;
                let (dq_i, dqd_i) = steps.split_at(dof);
                self.displaced(dq_i, dqd_i, at.phi)
            })?);
        }
        let halves = own.chunks(dof * dof).zip(differences.chunks(dof * dof));
        let statements = ["d tau / d q_i along the closure", "d tau / d qd_i"];
        for (statement, (a, b)) in statements.into_iter().zip(halves) {
            at.compare(all, statement, [a, b], 1.0, DIFFERENCE_BOUND);
        }
        Ok(())
    }

    fn frames(&self, all: &mut Identities) -> Result<(), SizeError> {
        let at = self.at;
        let State { q, qd, .. } = at.state;
        let model = at.model;
        let count = model.info().frames.len();
        if count == 0 {
            return Ok(());
        }
        let pose = |q: &[f64]| fill(12 * count, |out| model.frame_pose(q, out));
        let velocities = |q: &[f64], qd_i: &[f64]| -> Result<Vec<f64>, SizeError> {
            let jacobian = fill(6 * count * self.dof, |out| model.frame_jacobian(q, out))?;
            Ok(mul_row_major(&jacobian, qd_i))
        };
        let own = velocities(q, &self.qd_i)?;
        let rates = derivative_at_zero(|t| pose(&self.moved(t)[0]))?;
        let mut turned = Vec::with_capacity(own.len());
        for (rate, pose) in rates.chunks(12).zip(pose(q)?.chunks(12)) {
            // dR/dt R^T has the entries of the angular velocity
            let row = |m: &[f64], i: usize| [m[3 * i], m[3 * i + 1], m[3 * i + 2]];
            let entry = |i: usize, j: usize| dot(&row(rate, i), &row(pose, j));
            turned.extend_from_slice(&rate[9..]);
            turned.extend([entry(2, 1), entry(0, 2), entry(1, 0)]);
        }
        let statement = "J of frames = rate of their poses";
        at.compare(all, statement, [&own, &turned], 1.0, DIFFERENCE_BOUND);
        let bias = fill(6 * count, |out| model.frame_jacobian_rate(q, qd, out))?;
        let pushed = velocities(q, &self.qdd_i)?;
        let sum: Vec<f64> = pushed.iter().zip(&bias).map(|(a, b)| a + b).collect();
        let rates = derivative_at_zero(|t| {
            let [q, qd] = self.moved(t);
            velocities(&q, &at.independent(&qd))
        })?;
        let statement = "J qdd_i + dJ/dt qd_i = rate of J qd_i";
        at.compare(all, statement, [&sum, &rates], 1.0, DIFFERENCE_BOUND);
        Ok(())
    }

    fn forward(&self, all: &mut Identities, random: &mut Random) -> Result<(), SizeError> {
        let (at, dof) = (self.at, self.dof);
        let State { q, qd, qdd } = at.state;
        let model = at.model;
        // parameters of bodies that could exist, so that M is positive definite
        let mut phi: Vec<f64> = at.phi.iter().map(|value| value.abs()).collect();
        let bodies = model.info().bodies.len();
        for body in phi.chunks_mut(10).take(bodies) {
            for (entry, value) in body
                .iter_mut()
                .zip([1.3, 0.1, 0.1, 1.1, 0.1, 1.2, 0.3, 0.2, 0.1, 1.0])
            {
                *entry = value * (1.0 + 0.1 * random.signed());
            }
        }
        let tau = fill(dof, |out| model.inverse_dynamics(q, qd, qdd, &phi, out))?;
        let qdd_i = fill(dof, |out| model.forward_dynamics(q, qd, &tau, &phi, out))?;
        let scale = 1.0 + max_abs(&tau);
        at.compare(
            all,
            "forward dynamics undo inverse dynamics",
            [&qdd_i, &self.qdd_i],
            scale,
            ROUNDING_BOUND,
        );
        let mass = fill(dof * dof, |out| model.mass_matrix(q, &phi, out))?;
        let inverse = fill(2 * dof * dof, |out| {
            model.inverse_dynamics_derivatives(q, qd, qdd, &phi, out)
        })?;
        let forward = fill(3 * dof * dof, |out| {
            model.forward_dynamics_derivatives(q, qd, &tau, &phi, out)
        })?;
        let mut expected: Vec<f64> = inverse.iter().map(|slope| -slope).collect();
        expected.extend((0..dof * dof).map(|k| f64::from(u8::from(k % dof == k / dof))));
        let product: Vec<f64> = forward
            .chunks(dof.max(1))
            .flat_map(|column| mul_row_major(&mass, column))
            .collect();
        at.compare(
            all,
            "M d qdd_i / d (q, qd, tau) = (-d tau / d (q, qd), 1)",
            [&product, &expected],
            1.0,
            ROUNDING_BOUND,
        );
        Ok(())
    }
}
