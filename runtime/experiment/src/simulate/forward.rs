//! Forward dynamics of a closed chain over its independent coordinates.

use regen_runtime::{Condition, Model, SizeError};

/// A Cholesky pivot below this, times n and the diagonal entry of M, counts as rounding error; the
/// factor 8 allows for rounding errors in the entries of M.
const PIVOT_ROUNDING: f64 = 8.0 * f64::EPSILON;

/// Forward dynamics: the accelerations caused by given efforts, from the mass matrix and the
/// inverse dynamics of one model, M qdd_i = tau_i - X^T tau_e - (bias + gravity).
#[derive(Debug)]
pub struct Forward<'m, M: ?Sized> {
    model: &'m M,
    /// The parameters, those of friction set to zero.
    phi: Vec<f64>,
    dof: usize,
    accelerations: Vec<f64>,
    zero: Vec<f64>,
    mass: Vec<f64>,
    forces: Vec<f64>,
}

/// The result of a solve for accelerations: a numerical outcome, not an error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ForwardOutcome {
    /// The accelerations are in `out`; the condition is that of A_e.
    Solved(Condition<f64>),
    /// The mass matrix is not positive definite, or its smallest pivot may be nothing but rounding
    /// error: the parameters are not physically possible, or a coordinate moves almost no mass.
    NotPositiveDefinite,
}

impl<'m, M: Model<f64> + ?Sized> Forward<'m, M> {
    /// Prepares forward dynamics for a model with these parameters (p, in `Info::parameters`
    /// order). Friction parameters are ignored: friction must be included in the efforts.
    ///
    /// # Errors
    /// When the length of `phi` does not fit.
    pub fn new(model: &'m M, phi: &[f64]) -> Result<Self, SizeError> {
        let info = model.info();
        if phi.len() != info.parameters.len() {
            return Err(SizeError {
                argument: "phi",
                expected: info.parameters.len(),
                got: phi.len(),
            });
        }
        let phi = info.parameters.iter().zip(phi);
        let phi = phi
            .map(|(parameter, value)| if parameter.is_friction() { 0.0 } else { *value })
            .collect();
        let (n, dof) = (info.coordinates.len(), info.dof());
        Ok(Self {
            model,
            phi,
            dof,
            accelerations: vec![0.0; n],
            zero: vec![0.0; dof],
            mass: vec![0.0; dof * dof],
            forces: vec![0.0; dof],
        })
    }

    /// The parameters (p), those of friction set to zero.
    pub fn phi(&self) -> &[f64] {
        &self.phi
    }

    /// Computes qdd_i (dof, rad/s^2 or m/s^2) at a closed state q, qd (n) under the reduced efforts
    /// tau_i - X^T tau_e (dof, N m or N), from which friction has been subtracted.
    ///
    /// # Errors
    /// When a length does not fit.
    pub fn accelerations(
        &mut self,
        q: &[f64],
        qd: &[f64],
        efforts: &[f64],
        out: &mut [f64],
    ) -> Result<ForwardOutcome, SizeError> {
        let fits = |argument, got| {
            let expected = self.dof;
            if got == expected {
                return Ok(());
            }
            Err(SizeError {
                argument,
                expected,
                got,
            })
        };
        fits("efforts", efforts.len())?;
        fits("out", out.len())?;
        let Some(condition) = self.place(q)? else {
            return Ok(ForwardOutcome::NotPositiveDefinite);
        };
        let condition = condition.worst(self.set_velocities(q, qd)?);
        self.solve(efforts, out);
        Ok(ForwardOutcome::Solved(condition))
    }

    /// Computes, at a closed state, everything that depends on the positions alone; `None` if the mass
    /// matrix is not positive definite.
    pub(super) fn place(&mut self, q: &[f64]) -> Result<Option<Condition<f64>>, SizeError> {
        let condition = self.model.mass_matrix(q, &self.phi, &mut self.mass)?;
        Ok(factor_mass(&mut self.mass, self.dof).then_some(condition))
    }

    /// Computes everything else that does not depend on the efforts, at the positions of the last call
    /// of [`place`](Self::place).
    pub(super) fn set_velocities(
        &mut self,
        q: &[f64],
        qd: &[f64],
    ) -> Result<Condition<f64>, SizeError> {
        let model = self.model;
        let condition = model.accelerations(q, qd, &self.zero, &mut self.accelerations)?;
        Ok(condition.worst(model.inverse_dynamics(
            q,
            qd,
            &self.accelerations,
            &self.phi,
            &mut self.forces,
        )?))
    }

    /// The accelerations of all coordinates at the velocities of the last call of
    /// [`set_velocities`](Self::set_velocities), where the independent ones are zero.
    pub(super) fn without_acceleration(&self) -> &[f64] {
        &self.accelerations
    }

    /// The accelerations under the efforts at the state of the last call of
    /// [`set_velocities`](Self::set_velocities).
    pub(super) fn solve(&self, efforts: &[f64], out: &mut [f64]) {
        for ((out, effort), force) in out.iter_mut().zip(efforts).zip(&self.forces) {
            *out = effort - force;
        }
        solve_mass(&self.mass, out);
    }
}

/// Solves M x = b in place by the Cholesky factor; false where M is not positive definite.
#[cfg(test)]
fn solve_symmetric(m: &mut [f64], b: &mut [f64]) -> bool {
    let regular = factor_mass(m, b.len());
    if regular {
        solve_mass(m, b);
    }
    regular
}

/// Replaces a mass matrix by its Cholesky factor; false where it is not positive definite.
///
/// - `m`: n x n, symmetric, row-major; afterwards L with `m = L L^T` in the lower half.
///
/// If a pivot is below 8 n eps times its diagonal entry, it may consist of rounding errors of M alone
/// (Higham, *Accuracy and Stability of Numerical Algorithms*, theorem 10.7, for M scaled to a unit
/// diagonal), and no digit of x is certain. The test does not depend on the units of the
/// coordinates.
///
/// ```
/// use regen_experiment::simulate::{factor_mass, solve_mass};
///
/// let mut mass = [4.0, 2.0, 2.0, 3.0];
/// assert!(factor_mass(&mut mass, 2));
/// let mut forces = [6.0, 5.0];
/// solve_mass(&mass, &mut forces);
/// assert!((forces[0] - 1.0).abs() < 1e-15 && (forces[1] - 1.0).abs() < 1e-15);
/// assert!(!factor_mass(&mut [1.0, 2.0, 2.0, 1.0], 2));
/// ```
pub fn factor_mass(m: &mut [f64], n: usize) -> bool {
    if m.len() != n * n {
        return false;
    }
    let floor = PIVOT_ROUNDING * n as f64;
    for j in 0..n {
        let whole = m[j * n + j].abs();
        for k in 0..j {
            for i in j..n {
                m[i * n + j] -= m[i * n + k] * m[j * n + k];
            }
        }
        let pivot = m[j * n + j];
        if pivot.is_nan() || pivot <= floor * whole {
            return false;
        }
        let root = pivot.sqrt();
        for i in j..n {
            m[i * n + j] /= root;
        }
    }
    true
}

/// Solves M x = b in place, given the factor of [`factor_mass`]; b is unchanged if the sizes do not
/// fit.
pub fn solve_mass(l: &[f64], b: &mut [f64]) {
    let n = b.len();
    if l.len() != n * n {
        return;
    }
    for i in 0..n {
        for k in 0..i {
            b[i] -= l[i * n + k] * b[k];
        }
        b[i] /= l[i * n + i];
    }
    for i in (0..n).rev() {
        for k in i + 1..n {
            b[i] -= l[k * n + i] * b[k];
        }
        b[i] /= l[i * n + i];
    }
}

#[cfg(test)]
mod tests {

    use super::solve_symmetric;

    #[test]
    fn a_symmetric_system_is_solved_and_an_indefinite_one_refused() {
        let m = [4.0, 2.0, 0.6, 2.0, 3.0, 0.4, 0.6, 0.4, 1.0];
        let x = [1.0, -2.0, 0.5];
        let mut b: Vec<f64> = (0..3)
            .map(|i| (0..3).map(|j| m[3 * i + j] * x[j]).sum())
            .collect();
        assert!(solve_symmetric(&mut m.clone(), &mut b));
        for (b, x) in b.iter().zip(x) {
            assert!((b - x).abs() < 1e-14);
        }
        assert!(!solve_symmetric(&mut [1.0, 2.0, 2.0, 1.0], &mut [1.0, 1.0]));
        assert!(!solve_symmetric(&mut [f64::NAN], &mut [1.0]));
    }

    /// In any units of the coordinates, a regular system is solved accurately, and a system that is
    /// singular except for rounding errors is refused.
    #[test]
    fn units_do_not_decide_what_is_singular() {
        for scale in [1e-12, 1e-6, 1.0, 1e6] {
            let unit = [1.0, scale, 1.0 / scale];
            let scaled = |m: &[f64; 9]| -> Vec<f64> {
                let entry = |k: usize| m[k] * unit[k / 3] * unit[k % 3];
                (0..9).map(entry).collect()
            };
            let mut good = scaled(&[4.0, 2.0, 0.6, 2.0, 3.0, 0.4, 0.6, 0.4, 1.0]);
            let mut b: Vec<f64> = (0..3)
                .map(|i| good[3 * i] + good[3 * i + 1] / scale)
                .collect();
            assert!(solve_symmetric(&mut good, &mut b), "{scale}");
            for (b, x) in b.iter().zip([1.0, 1.0 / scale, 0.0]) {
                assert!(
                    (b - x).abs() < 1e-13 * (1.0 + x.abs()).max(scale),
                    "{scale} {b} {x}"
                );
            }
            // the third row is a third of the others' sum, rounded
            let third = 1.0 / 3.0;
            let rows = [[4.0, 2.0], [2.0, 3.0]];
            let last = [(4.0 + 2.0) * third, (2.0 + 3.0) * third];
            let corner = (last[0] + last[1]) * third;
            let singular = [
                rows[0][0], rows[0][1], last[0], rows[1][0], rows[1][1], last[1], last[0], last[1],
                corner,
            ];
            assert!(
                !solve_symmetric(&mut scaled(&singular), &mut [1.0; 3]),
                "{scale}"
            );
        }
    }
}
