//! The Gibbs-Appell equations (Eq. 1) in their original form, for bodies given by mass, centre of
//! mass and inertia about it. Angular accelerations and those of the centres of mass come from
//! second-order dual numbers.

use crate::kinematics::Motion;
use crate::mechanism::Mechanism;
use crate::random::PhysicalBody;
use crate::scalar::{Mat4, Vec3, add, cross, dot};

impl Mechanism {
    /// The efforts tau_k (n, N m or N) of the tree's coordinates by Eq. 1. Gravity enters as an
    /// acceleration of the world in the opposite direction.
    pub fn gibbs_appell(
        &self,
        q: &[f64],
        qd: &[f64],
        qdd: &[f64],
        bodies: &[PhysicalBody],
    ) -> Vec<f64> {
        let n = self.n();
        let rest = vec![0.0; n];
        let moving = self.motions(q, qd, qdd);
        let partials: Vec<Vec<Motion>> = (0..n)
            .map(|k| {
                let mut unit = rest.clone();
                unit[k] = 1.0;
                // accelerations are linear in qdd, so at zero velocity and unit qdd_k they equal
                // their derivatives with respect to qdd_k
                self.motions(q, &rest, &unit)
            })
            .collect();
        (0..n)
            .map(|k| {
                let mut tau = 0.0;
                for (body, inertial) in self.bodies.iter().zip(bodies) {
                    let (state, partial) = (&moving[body.node], &partials[k][body.node]);
                    let (omega, alpha) = angular(state);
                    let (_, alpha_k) = angular(partial);
                    let spin = times(&inertial.inertia, &omega);
                    let moment = add(&times(&inertial.inertia, &alpha), &cross(&omega, &spin));
                    let lift = in_body(&state.pose, &self.gravity.map(|g| -g));
                    let acceleration = add(&centre(state, &inertial.com), &lift);
                    let acceleration_k = centre(partial, &inertial.com);
                    tau += dot(&alpha_k, &moment)
                        + dot(&acceleration_k, &acceleration) * inertial.mass;
                }
                tau
            })
            .collect()
    }
}

/// Angular velocity and acceleration in the body's axes, from R^T R' and its time derivative.
fn angular(m: &Motion) -> (Vec3<f64>, Vec3<f64>) {
    let product = |a: &Mat4<f64>, b: &Mat4<f64>, i: usize, j: usize| -> f64 {
        (0..3).map(|k| a[k][i] * b[k][j]).sum()
    };
    let vee = |entry: &dyn Fn(usize, usize) -> f64| [entry(2, 1), entry(0, 2), entry(1, 0)];
    let omega = vee(&|i, j| product(&m.pose, &m.rate, i, j));
    let alpha = vee(&|i, j| product(&m.pose, &m.second, i, j) + product(&m.rate, &m.rate, i, j));
    (omega, alpha)
}

/// The acceleration of the centre of mass, in the body's axes.
fn centre(m: &Motion, com: &Vec3<f64>) -> Vec3<f64> {
    let mut world = [0.0; 3];
    for (i, entry) in world.iter_mut().enumerate() {
        *entry = m.second[i][3] + (0..3).map(|k| m.second[i][k] * com[k]).sum::<f64>();
    }
    in_body(&m.pose, &world)
}

/// A vector of the world in the body's axes.
fn in_body(pose: &Mat4<f64>, v: &Vec3<f64>) -> Vec3<f64> {
    let mut out = [0.0; 3];
    for (j, entry) in out.iter_mut().enumerate() {
        *entry = (0..3).map(|i| pose[i][j] * v[i]).sum();
    }
    out
}

/// The product of an inertia (Ixx Ixy Ixz Iyy Iyz Izz) and a vector.
fn times(inertia: &[f64; 6], v: &Vec3<f64>) -> Vec3<f64> {
    let [xx, xy, xz, yy, yz, zz] = *inertia;
    [
        xx * v[0] + xy * v[1] + xz * v[2],
        xy * v[0] + yy * v[1] + yz * v[2],
        xz * v[0] + yz * v[1] + zz * v[2],
    ]
}
