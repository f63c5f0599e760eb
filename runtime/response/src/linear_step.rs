//! The motion beside a simulated motion, from one sample to the next: the equations of motion
//! linearised along it.
//!
//! With the changes dq and dv of the independent coordinates and velocities, those of the efforts du
//! and of the parameters dbeta:
//!
//! `M dv' = K dq + D dv + G du - W dbeta - sum_j c_j x_j (x_j^T dv + t_j^T dq)`
//!
//! where K and D are the derivatives of `G u - W beta` at constant accelerations, and the last sum is the
//! friction that changes its direction with the velocity of joint j, whose derivatives by the independent
//! velocities and positions are `x_j` and `t_j`. Over half a sample all matrices are means of both ends, and
//! dq and dv change by the trapezoidal rule. One step over the whole sample is then extrapolated with the
//! two halves to the fourth order (Richardson; the accelerations in the middle are of second order): in
//! a loop of 3 Hz that swings, derivatives of the trapezoidal rule alone are 40 % off after ten
//! seconds of 100 samples each.
//!
//! Where friction changes its direction within half a sample, the direction
//! and `c_j` are their means over the velocities from end to end, as if these changed evenly; in truth
//! they change faster before a reversal than after it, which is an error of a part of a sample at each
//! reversal. Where a joint sticks, `c_j` is so large that dv would
//! alternate; the rule then leans towards the end of the step as far as is needed to prevent that.
//! Nothing is extrapolated where a joint sticks or turns.

use nalgebra::DMatrix;

use crate::plant::Directed;

/// Steps are extrapolated where friction that changes its direction takes away, or adds, less than this
/// part of a joint's velocity in half a sample.
const STICKING: f64 = 0.1;

/// What the equations depend on at one time.
pub(crate) struct Place {
    /// The mass matrix, dof x dof.
    pub(crate) mass: DMatrix<f64>,
    /// K and D, each dof x dof.
    pub(crate) by_position: DMatrix<f64>,
    pub(crate) by_velocity: DMatrix<f64>,
    /// G, dof x a.
    pub(crate) by_effort: DMatrix<f64>,
    /// W with the sign of the velocities in the columns of friction, dof x r.
    pub(crate) regressor: DMatrix<f64>,
    /// dq/dq_i, n x dof.
    pub(crate) reach: DMatrix<f64>,
    /// The derivatives of all velocities by the independent positions, n x dof.
    pub(crate) turning: DMatrix<f64>,
    /// All velocities, n.
    pub(crate) qd: Vec<f64>,
}

/// The changes of the independent coordinates and velocities: dof x m each, a column for each unknown.
#[derive(Clone, Debug)]
pub(crate) struct Beside {
    pub(crate) q: DMatrix<f64>,
    pub(crate) v: DMatrix<f64>,
}

impl Beside {
    pub(crate) fn zeros(dof: usize, unknowns: usize) -> Self {
        Self {
            q: DMatrix::zeros(dof, unknowns),
            v: DMatrix::zeros(dof, unknowns),
        }
    }

    /// Moves on from one sample to the next, `h` seconds later; false if the equations are singular.
    ///
    /// - `places`: the sample, the middle between both, and the next one;
    /// - `efforts`: the changes of the efforts between the samples, a x m; the first r unknowns are the
    ///   base parameters `beta`.
    pub(crate) fn advance(
        &mut self,
        [from, middle, to]: [&Place; 3],
        directed: &[Directed],
        beta: &[f64],
        efforts: &DMatrix<f64>,
        h: f64,
    ) -> bool {
        let (mut halves, mut whole) = (self.clone(), self.clone());
        let half = 0.5 * h;
        let first = halves.step([from, middle], directed, beta, efforts, half);
        let second = halves.step([middle, to], directed, beta, efforts, half);
        let Some((first, second)) = first.zip(second) else {
            return false;
        };
        if first.max(second) < STICKING {
            if whole.step([from, to], directed, beta, efforts, h).is_none() {
                return false;
            }
            halves.q = (&halves.q * 4.0 - whole.q) / 3.0;
            halves.v = (&halves.v * 4.0 - whole.v) / 3.0;
        }
        *self = halves;
        true
    }

    /// One step of the trapezoidal rule, `h` seconds long. Returns the largest part of a joint's velocity
    /// that friction that changes its direction takes away in the step; `None` if the equations are
    /// singular.
    fn step(
        &mut self,
        [from, to]: [&Place; 2],
        directed: &[Directed],
        beta: &[f64],
        efforts: &DMatrix<f64>,
        h: f64,
    ) -> Option<f64> {
        let mean = |a: &DMatrix<f64>, b: &DMatrix<f64>| (a + b) * 0.5;
        let mass = mean(&from.mass, &to.mass);
        let mut regressor = mean(&from.regressor, &to.regressor);
        // friction at the beginning and at the end of the sample
        let dof = mass.nrows();
        let mut friction = [DMatrix::zeros(dof, dof), DMatrix::zeros(dof, dof)];
        let mut by_position = mean(&from.by_position, &to.by_position);
        let inverse = mass.clone().cholesky()?.inverse();
        let mut sticking: f64 = 0.0;
        for joint in directed {
            let row = mean(&from.reach, &to.reach)
                .row(joint.coordinate)
                .transpose();
            let [before, after] = [from, to].map(|place| place.qd[joint.coordinate]);
            let [sign, slope] = joint.between(before, after);
            let signs = f64::midpoint(joint.sign(before), joint.sign(after));
            for (k, factor) in joint.combination.iter().enumerate() {
                if *factor != 0.0 {
                    let mut column = regressor.column_mut(k);
                    column.axpy(factor * (sign - signs), &row, 1.0);
                }
            }
            let damping = joint.coefficient(beta) * slope;
            let product = damping * h * row.dot(&(&inverse * &row));
            sticking = sticking.max(product.abs());
            let late = (1.0 - 1.0 / product.max(1e-300)).max(0.5);
            let outer = &row * row.transpose() * damping;
            let turning = mean(&from.turning, &to.turning);
            by_position -= &row * turning.row(joint.coordinate) * damping;
            friction[0] += &outer * (1.0 - late);
            friction[1] += outer * late;
        }
        let by_velocity = mean(&from.by_velocity, &to.by_velocity);
        let smooth = &by_position * (0.25 * h) + &by_velocity * 0.5;
        let ends = &mass / h - &smooth + &friction[1];
        let begins = mass / h + smooth - &friction[0];
        let mut right = begins * &self.v + by_position * &self.q;
        right += mean(&from.by_effort, &to.by_effort) * efforts;
        let mut own = right.columns_mut(0, regressor.ncols());
        own -= regressor;
        let next = ends.lu().solve(&right)?;
        self.q += (&self.v + &next) * (0.5 * h);
        self.v = next;
        Some(sticking)
    }
}

impl Place {
    /// The changes of position and velocity of a coordinate, one for each unknown.
    pub(crate) fn coordinate(&self, coordinate: usize, beside: &Beside) -> [Vec<f64>; 2] {
        let reach = self.reach.row(coordinate);
        let position = reach * &beside.q;
        let velocity = reach * &beside.v + self.turning.row(coordinate) * &beside.q;
        [position, velocity].map(|row| row.iter().copied().collect())
    }
}

/// A matrix from its columns, one after the other.
pub(crate) fn matrix(columns: &[f64], rows: usize) -> DMatrix<f64> {
    DMatrix::from_column_slice(rows, columns.len() / rows.max(1), columns)
}
