//! The closed mechanism: X, dependent velocities and accelerations, the reduced regressor.

use nalgebra::{DMatrix, DVector};

use crate::mechanism::Mechanism;

/// Singular values below this, relative to the largest, count as zero.
const RANK_TOLERANCE: f64 = 1e-9;

impl Mechanism {
    /// The dependent columns A_e of A.
    pub fn dependent_columns(&self, a: &DMatrix<f64>) -> DMatrix<f64> {
        a.select_columns(&self.dependent)
    }

    /// The least-squares solution of A_e x = r over all rows.
    ///
    /// # Errors
    /// If A_e does not have full column rank.
    pub fn solve_dependent(
        &self,
        a: &DMatrix<f64>,
        rhs: &DMatrix<f64>,
    ) -> Result<DMatrix<f64>, String> {
        if self.dependent.is_empty() {
            return Ok(DMatrix::zeros(0, rhs.ncols()));
        }
        let a_e = self.dependent_columns(a);
        let svd = a_e.clone().svd(true, true);
        if svd.rank(RANK_TOLERANCE * svd.singular_values.max()) < self.dependent.len() {
            return Err(format!("{}: A_e is singular", self.name));
        }
        let mut x = svd.solve(rhs, 0.0)?;
        // The error of the decomposition is up to 1e-3, far larger than rounding: refine the
        // solution until the corrections vanish.
        for _ in 0..20 {
            let correction = svd.solve(&(rhs - &a_e * &x), 0.0)?;
            x += &correction;
            if correction.amax() <= 1e-15 * x.amax() {
                break;
            }
        }
        Ok(x)
    }

    /// Smallest over largest singular value of A_e; 1 for a tree.
    pub fn conditioning(&self, q: &[f64]) -> f64 {
        if self.dependent.is_empty() {
            return 1.0;
        }
        let values = self.dependent_columns(&self.jacobian(q)).singular_values();
        // The values are sorted; a matrix with fewer rows than columns is singular.
        if values.len() < self.dependent.len() {
            return 0.0;
        }
        values.min() / values.max()
    }

    /// The mobility at a state: coordinates minus the rank of A.
    pub fn mobility(&self, q: &[f64]) -> usize {
        if self.rows() == 0 {
            return self.n();
        }
        let values = self.jacobian(q).singular_values();
        let bound = RANK_TOLERANCE * values.max();
        self.n() - values.iter().filter(|v| **v > bound).count()
    }

    /// X = A_e^-1 A_i (Eq. 10): one row per dependent coordinate, one column per independent one.
    ///
    /// # Errors
    /// At a singularity.
    pub fn x(&self, q: &[f64]) -> Result<DMatrix<f64>, String> {
        let a = self.jacobian(q);
        self.solve_dependent(&a, &a.select_columns(&self.independent))
    }

    /// N with qd = N qd_i: the identity on independent rows, -X on dependent ones.
    ///
    /// # Errors
    /// At a singularity.
    pub fn null_space(&self, q: &[f64]) -> Result<DMatrix<f64>, String> {
        let x = self.x(q)?;
        let mut out = DMatrix::zeros(self.n(), self.dof());
        for (i, k) in self.independent.iter().enumerate() {
            out[(*k, i)] = 1.0;
        }
        for (i, k) in self.dependent.iter().enumerate() {
            for j in 0..self.dof() {
                out[(*k, j)] = -x[(i, j)];
            }
        }
        Ok(out)
    }

    /// dN/dt along qd: A dN/dt = -dA/dt N.
    ///
    /// # Errors
    /// At a singularity.
    pub fn null_space_rate(&self, q: &[f64], qd: &[f64]) -> Result<DMatrix<f64>, String> {
        let rhs = -(self.jacobian_rate(q, qd) * self.null_space(q)?);
        let rate = self.solve_dependent(&self.jacobian(q), &rhs)?;
        let mut out = DMatrix::zeros(self.n(), self.dof());
        for (i, k) in self.dependent.iter().enumerate() {
            out.row_mut(*k).copy_from(&rate.row(i));
        }
        Ok(out)
    }

    /// All velocities from the independent ones.
    ///
    /// # Errors
    /// At a singularity.
    pub fn velocities(&self, q: &[f64], qd_i: &[f64]) -> Result<Vec<f64>, String> {
        let all = self.null_space(q)? * DVector::from_column_slice(qd_i);
        Ok(all.as_slice().to_vec())
    }

    /// All accelerations from the independent ones.
    ///
    /// # Errors
    /// At a singularity.
    pub fn accelerations(&self, q: &[f64], qd: &[f64], qdd_i: &[f64]) -> Result<Vec<f64>, String> {
        let a = self.jacobian(q);
        let b = DVector::from_vec(self.bias(q, qd));
        let forced = a.select_columns(&self.independent) * DVector::from_column_slice(qdd_i);
        let qdd_e = self.solve_dependent(&a, &DMatrix::from_columns(&[b - forced]))?;
        let mut out = vec![0.0; self.n()];
        for (value, k) in qdd_i.iter().zip(&self.independent) {
            out[*k] = *value;
        }
        for (i, k) in self.dependent.iter().enumerate() {
            out[*k] = qdd_e[(i, 0)];
        }
        Ok(out)
    }

    /// The efforts of all coordinates reduced to the independent ones: tau_i - X^T tau_e.
    ///
    /// # Errors
    /// At a singularity.
    pub fn reduce(&self, q: &[f64], tau: &[f64]) -> Result<Vec<f64>, String> {
        let out = self.null_space(q)?.transpose() * DVector::from_column_slice(tau);
        Ok(out.as_slice().to_vec())
    }

    /// The reduced regressor K_i - X^T K_e (Eq. 11), friction and rotors included.
    ///
    /// # Errors
    /// At a singularity.
    pub fn regressor(&self, q: &[f64], qd: &[f64], qdd: &[f64]) -> Result<DMatrix<f64>, String> {
        Ok(self.null_space(q)?.transpose() * self.tree_regressor(q, qd, qdd))
    }

    /// The mass matrix of the independent coordinates and its derivative with respect to time along
    /// qd.
    ///
    /// # Errors
    /// At a singularity.
    pub fn mass_matrix(
        &self,
        q: &[f64],
        qd: &[f64],
        phi: &[f64],
    ) -> Result<(DMatrix<f64>, DMatrix<f64>), String> {
        let (h, h_rate) = self.tree_mass_matrix(q, qd, phi);
        let n = self.null_space(q)?;
        let n_rate = self.null_space_rate(q, qd)?;
        let mass = n.transpose() * &h * &n;
        let half = n.transpose() * &h * &n_rate;
        let rate = &half + half.transpose() + n.transpose() * h_rate * &n;
        Ok((mass, rate))
    }
}
