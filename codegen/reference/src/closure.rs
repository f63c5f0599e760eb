//! The loop closure: residual, Jacobian and bias by dual numbers, Newton's method and continuation.

use nalgebra::{DMatrix, DVector};
use num_dual::{Dual, Dual2, Dual2_64, Dual64};

use crate::mechanism::{CutKind, CutSide, Mechanism};
use crate::scalar::{Mat4, Scalar, axis, constant_matrix, dot, mul, position, sub};

impl Mechanism {
    /// The closure equations f (Eq. 6): rows of the cuts in order, then of the couplings.
    pub fn constraints<T: Scalar>(&self, q: &[T]) -> Vec<T> {
        let frames = self.frames(q);
        let mut out = Vec::with_capacity(self.rows());
        for cut in &self.cuts {
            let [a, b] = cut.sides.each_ref().map(|side| place(side, &frames));
            let gap = sub(&position(&b), &position(&a));
            // Cosine of the angle between axis i of A and axis j of B.
            let angle = |i: usize, j: usize| dot(&axis(&a, i), &axis(&b, j));
            let along = |i: usize| dot(&axis(&a, i), &gap);
            match cut.kind {
                CutKind::Spherical => out.extend(gap),
                CutKind::Universal => {
                    out.extend(gap);
                    out.push(angle(0, 1));
                }
                CutKind::Revolute => {
                    out.extend(gap);
                    out.extend([angle(0, 2), angle(1, 2)]);
                }
                CutKind::Cylindrical => {
                    out.extend([angle(0, 2), angle(1, 2), along(0), along(1)]);
                }
                CutKind::Helical => {
                    out.extend([angle(0, 2), angle(1, 2), along(0), along(1)]);
                    // The difference between the angle that belongs to the translation and the
                    // angle of B's x axis.
                    let lead = cut.pitch / core::f64::consts::TAU;
                    let (due, x) = (along(2) / lead, [angle(0, 0), angle(1, 0)]);
                    out.push((x[0] * due.sin() - x[1] * due.cos()) * lead);
                }
                CutKind::Prismatic => {
                    out.extend([along(0), along(1)]);
                    out.extend([angle(0, 1), angle(0, 2), angle(1, 2)]);
                }
                CutKind::Fixed => {
                    out.extend(gap);
                    out.extend([angle(0, 1), angle(0, 2), angle(1, 2)]);
                }
            }
        }
        for coupling in &self.couplings {
            let mut row = q[coupling.key] - coupling.constant;
            for (c, x) in coupling.coefficients.iter().zip(q) {
                row -= *x * *c;
            }
            out.push(row);
        }
        out
    }

    /// The Jacobian A = df/dq, all rows.
    pub fn jacobian(&self, q: &[f64]) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(self.rows(), self.n());
        for k in 0..self.n() {
            let mut along: Vec<Dual64> = q.iter().map(|x| Dual::from_re(*x)).collect();
            along[k].eps = 1.0;
            for (i, row) in self.constraints(&along).iter().enumerate() {
                out[(i, k)] = row.eps;
            }
        }
        out
    }

    /// The derivative of A with respect to time along qd, all rows.
    pub fn jacobian_rate(&self, q: &[f64], qd: &[f64]) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(self.rows(), self.n());
        for k in 0..self.n() {
            let along: Vec<Dual<Dual64>> = (0..self.n())
                .map(|i| {
                    let unit = Dual::from_re(f64::from(u8::from(i == k)));
                    Dual::new(Dual::new(q[i], qd[i]), unit)
                })
                .collect();
            for (i, row) in self.constraints(&along).iter().enumerate() {
                out[(i, k)] = row.eps.eps;
            }
        }
        out
    }

    /// The bias b of A qdd = b (Eq. 7): minus the second derivative of f along q + t qd.
    pub fn bias(&self, q: &[f64], qd: &[f64]) -> Vec<f64> {
        let along: Vec<Dual2_64> = (0..self.n())
            .map(|k| Dual2::new(q[k], qd[k], 0.0))
            .collect();
        self.constraints(&along).iter().map(|row| -row.v2).collect()
    }

    /// The largest magnitude of an entry of f.
    pub fn residual(&self, q: &[f64]) -> f64 {
        self.constraints(q).iter().fold(0.0, |m, x| m.max(x.abs()))
    }

    /// Closes the loops by damped Newton's method over the dependent coordinates.
    ///
    /// # Errors
    /// If the steps stop reducing the residual above rounding, or A_e loses rank.
    pub fn close(&self, q: &[f64]) -> Result<Vec<f64>, String> {
        let mut q = q.to_vec();
        let mut residual = self.norm(&q);
        for _ in 0..100 {
            if residual < 1e-15 {
                break;
            }
            let f = DVector::from_vec(self.constraints(&q));
            let step = self.solve_dependent(&self.jacobian(&q), &DMatrix::from_columns(&[f]))?;
            let mut damping = 1.0;
            let mut better = None;
            while damping > 1e-4 {
                let mut trial = q.clone();
                for (i, k) in self.dependent.iter().enumerate() {
                    trial[*k] -= damping * step[(i, 0)];
                }
                let norm = self.norm(&trial);
                if norm < residual {
                    better = Some((trial, norm));
                    break;
                }
                damping /= 2.0;
            }
            match better {
                Some((trial, norm)) => (q, residual) = (trial, norm),
                None => break,
            }
        }
        // The rows are lengths in metres and cosines: a few roundings of numbers near 1 remain. Those
        // of drives are as large as the drives' coordinates.
        let largest = self.drives.iter().fold(1.0_f64, |m, k| m.max(q[*k].abs()));
        if residual < 1e-13 * largest {
            Ok(q)
        } else {
            Err(format!("{}: not closed, residual {residual:e}", self.name))
        }
    }

    fn norm(&self, q: &[f64]) -> f64 {
        DVector::from_vec(self.constraints(q)).norm()
    }

    /// The home of the spec, corrected to satisfy the closure equations.
    ///
    /// # Errors
    /// If it does not close, or closes at a singularity.
    pub fn home(&self) -> Result<Vec<f64>, String> {
        self.close(&self.home_guess)
    }

    /// Moves the independent coordinates on a straight line from a closed state to given values,
    /// staying on the assembly branch.
    ///
    /// # Errors
    /// If a step does not close, jumps to another assembly branch, or crosses or comes near a
    /// singularity.
    pub fn follow(&self, start: &[f64], target: &[f64]) -> Result<Vec<f64>, String> {
        let from: Vec<f64> = self.independent.iter().map(|k| start[*k]).collect();
        let moves = from.iter().zip(target).zip(&self.independent);
        let distance = moves.fold(0.0_f64, |m, ((a, b), k)| {
            m.max((b - a).abs() / self.travel(*k, 1.0, 1.0))
        });
        #[allow(clippy::cast_sign_loss, reason = "at least 1")]
        let steps = (distance / 0.05).ceil().max(1.0) as usize;
        let mut q = start.to_vec();
        let mut a_e = self.dependent_columns(&self.jacobian(&q));
        for step in 1..=steps {
            let part = step as f64 / steps as f64;
            let mut move_i = vec![0.0; self.dof()];
            for (i, k) in self.independent.iter().enumerate() {
                move_i[i] = from[i] + part * (target[i] - from[i]) - q[*k];
            }
            let change = self.velocities(&q, &move_i)?;
            let predicted: Vec<f64> = q.iter().zip(&change).map(|(x, d)| x + d).collect();
            q = self.close(&predicted)?;
            let size = |v: &mut dyn Iterator<Item = f64>| v.fold(0.0_f64, |m, x| m.max(x.abs()));
            let corrected = size(&mut q.iter().zip(&predicted).map(|(x, p)| x - p));
            // Over a short step the prediction is good: a larger correction means another assembly
            // branch.
            if corrected > 0.5 * size(&mut change.iter().copied()) + 1e-9 {
                return Err(format!("{}: a leap on the way", self.name));
            }
            let next = self.dependent_columns(&self.jacobian(&q));
            // Over a short step det(A^T A') has the sign of det A det A' of any regular rows.
            if (a_e.transpose() * &next).determinant() <= 0.0 {
                return Err(format!("{}: a singularity on the way", self.name));
            }
            a_e = next;
        }
        Ok(q)
    }
}

/// The frame of a cut's side in the world.
fn place<T: Scalar>(side: &CutSide, frames: &[Mat4<T>]) -> Mat4<T> {
    let offset = constant_matrix(&side.offset);
    match side.node {
        Some(node) => mul(&frames[node], &offset),
        None => offset,
    }
}
