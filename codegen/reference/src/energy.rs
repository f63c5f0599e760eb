//! Energy in trace form, and Lagrange's equations and the mass matrix derived from it by dual
//! numbers. No twist and no cross product occurs here.

use nalgebra::DMatrix;
use num_dual::{Dual, Dual64, HyperDual, HyperDual64};

use crate::mechanism::{Mechanism, Parameter};
use crate::scalar::{Mat4, Scalar};

impl Mechanism {
    /// The 4x4 pseudo-inertia of each body: second moments, first moments, mass.
    fn pseudo_inertias(&self, phi: &[f64]) -> Vec<Mat4<f64>> {
        (0..self.bodies.len())
            .map(|body| {
                let p = &phi[10 * body..10 * body + 10];
                let half = (p[0] + p[3] + p[5]) / 2.0;
                [
                    [half - p[0], -p[1], -p[2], p[6]],
                    [-p[1], half - p[3], -p[4], p[7]],
                    [-p[2], -p[4], half - p[5], p[8]],
                    [p[6], p[7], p[8], p[9]],
                ]
            })
            .collect()
    }

    fn rotor_inertias(&self, phi: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; self.n()];
        for (parameter, value) in self.parameters.iter().zip(phi) {
            if let Parameter::Rotor(j) = parameter {
                out[*j] = *value;
            }
        }
        out
    }

    /// The derivatives of the frames along qd.
    fn frame_rates<T: Scalar>(&self, q: &[T], qd: &[T]) -> Vec<Mat4<T>> {
        let along: Vec<Dual<T>> = q.iter().zip(qd).map(|(x, v)| Dual::new(*x, *v)).collect();
        self.frames(&along)
            .iter()
            .map(|m| m.map(|row| row.map(|x| x.eps)))
            .collect()
    }

    /// Kinetic energy of the tree at (q, qd) in J, rotors included.
    pub fn kinetic_energy<T: Scalar>(&self, q: &[T], qd: &[T], phi: &[f64]) -> T {
        let rates = self.frame_rates(q, qd);
        let mut twice = T::from(0.0);
        for (body, p) in self.bodies.iter().zip(self.pseudo_inertias(phi)) {
            twice += trace(&rates[body.node], &p, &rates[body.node]);
        }
        for (j, v) in self.rotor_inertias(phi).iter().zip(qd) {
            twice += *v * *v * *j;
        }
        twice * 0.5
    }

    /// Potential energy of the tree at q in J: of weights, constant efforts (Fo q) and
    /// springs; effort terms count as friction, which has none.
    pub fn potential_energy<T: Scalar>(&self, q: &[T], phi: &[f64]) -> T {
        let frames = self.frames(q);
        let mut out = T::from(0.0);
        for (body, p) in self.bodies.iter().zip(self.pseudo_inertias(phi)) {
            for (row, g) in frames[body.node].iter().zip(self.gravity) {
                for (x, moment) in row.iter().zip(p) {
                    out -= *x * (moment[3] * g);
                }
            }
        }
        for (parameter, value) in self.parameters.iter().zip(phi) {
            match parameter {
                Parameter::Offset(j) => out += q[*j] * *value,
                Parameter::Spring(index) => {
                    out += self.stored_energy(&self.springs[*index].stored, q) * *value;
                }
                _ => {}
            }
        }
        out
    }

    /// Efforts of the tree by Lagrange's equations: d/dt dT/dqd - dT/dq + dV/dq, without friction.
    pub fn lagrange(&self, q: &[f64], qd: &[f64], qdd: &[f64], phi: &[f64]) -> Vec<f64> {
        (0..self.n())
            .map(|k| {
                let unit = |i: usize| f64::from(u8::from(i == k));
                // First direction: qd_k. Second direction: time.
                let along: Vec<HyperDual64> = (0..self.n())
                    .map(|i| HyperDual::new(q[i], 0.0, qd[i], 0.0))
                    .collect();
                let rates: Vec<HyperDual64> = (0..self.n())
                    .map(|i| HyperDual::new(qd[i], unit(i), qdd[i], 0.0))
                    .collect();
                let momentum_rate = self.kinetic_energy(&along, &rates, phi).eps1eps2;
                let moved: Vec<Dual64> = (0..self.n()).map(|i| Dual::new(q[i], unit(i))).collect();
                let still: Vec<Dual64> = qd.iter().map(|v| Dual::new(*v, 0.0)).collect();
                momentum_rate - self.kinetic_energy(&moved, &still, phi).eps
                    + self.potential_energy(&moved, phi).eps
            })
            .collect()
    }

    /// The derivative of the total energy, d/dt (T + V), along a motion.
    pub fn energy_rate(&self, q: &[f64], qd: &[f64], qdd: &[f64], phi: &[f64]) -> f64 {
        let along = |x: &[f64], v: &[f64]| -> Vec<Dual64> {
            x.iter().zip(v).map(|(x, v)| Dual::new(*x, *v)).collect()
        };
        let (q, qd) = (along(q, qd), along(qd, qdd));
        self.kinetic_energy(&q, &qd, phi).eps + self.potential_energy(&q, phi).eps
    }

    /// The mass matrix of the tree and its derivative along qd.
    pub fn tree_mass_matrix(
        &self,
        q: &[f64],
        qd: &[f64],
        phi: &[f64],
    ) -> (DMatrix<f64>, DMatrix<f64>) {
        let n = self.n();
        let along: Vec<Dual64> = q.iter().zip(qd).map(|(x, v)| Dual::new(*x, *v)).collect();
        let partials: Vec<Vec<Mat4<Dual64>>> = (0..n)
            .map(|k| {
                let unit: Vec<Dual64> = (0..n)
                    .map(|i| Dual::new(f64::from(u8::from(i == k)), 0.0))
                    .collect();
                self.frame_rates(&along, &unit)
            })
            .collect();
        let inertias = self.pseudo_inertias(phi);
        let rotors = self.rotor_inertias(phi);
        let (mut mass, mut rate) = (DMatrix::zeros(n, n), DMatrix::zeros(n, n));
        for i in 0..n {
            mass[(i, i)] += rotors[i];
            for j in 0..n {
                for (body, p) in self.bodies.iter().zip(&inertias) {
                    let entry = trace(&partials[i][body.node], p, &partials[j][body.node]);
                    mass[(i, j)] += entry.re;
                    rate[(i, j)] += entry.eps;
                }
            }
        }
        (mass, rate)
    }
}

/// The trace tr(A P B^T).
fn trace<T: Scalar>(a: &Mat4<T>, p: &Mat4<f64>, b: &Mat4<T>) -> T {
    let mut out = T::from(0.0);
    for (a_row, b_row) in a.iter().zip(b) {
        for (x, p_row) in a_row.iter().zip(p) {
            for (value, y) in p_row.iter().zip(b_row) {
                out += *x * *y * *value;
            }
        }
    }
    out
}
