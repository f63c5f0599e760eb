//! The regressor K of the tree by Newton-Euler in the world frame, one parameter at a time.

use nalgebra::DMatrix;

use crate::mechanism::{Mechanism, Parameter};
use crate::scalar::{
    Mat4, Vec3, add, axis, cross, dot, identity, mul, position, rotate, scale, sub,
};

/// Velocities and accelerations of a node in the world frame.
struct Spatial {
    omega: Vec3<f64>,
    alpha: Vec3<f64>,
    /// Velocity and acceleration of the origin.
    velocity: Vec3<f64>,
    acceleration: Vec3<f64>,
}

const ZERO: Vec3<f64> = [0.0; 3];

impl Mechanism {
    fn spatial(&self, frames: &[Mat4<f64>], qd: &[f64], qdd: &[f64]) -> Vec<Spatial> {
        let mut out: Vec<Spatial> = Vec::with_capacity(self.nodes.len());
        for (i, node) in self.nodes.iter().enumerate() {
            let (mut omega, mut alpha, mut velocity, mut acceleration) = (ZERO, ZERO, ZERO, ZERO);
            if let Some(parent) = node.parent {
                let p = &out[parent];
                let r = sub(&position(&frames[i]), &position(&frames[parent]));
                (omega, alpha) = (p.omega, p.alpha);
                velocity = add(&p.velocity, &cross(&omega, &r));
                acceleration = add(
                    &p.acceleration,
                    &add(&cross(&alpha, &r), &cross(&omega, &cross(&omega, &r))),
                );
            }
            if let Some(m) = node.motion {
                let z = axis(&frames[i], m.axis.index());
                let (rate, second) = (qd[m.coordinate], qdd[m.coordinate]);
                // Both terms use the parent's omega.
                let slip = scale(&z, m.slide * rate);
                velocity = add(&velocity, &slip);
                let coriolis = scale(&cross(&omega, &slip), 2.0);
                let straight = scale(&z, m.slide * second);
                acceleration = add(&acceleration, &add(&straight, &coriolis));
                let spin = scale(&z, m.turn * rate);
                let tangential = scale(&z, m.turn * second);
                alpha = add(&alpha, &add(&tangential, &cross(&omega, &spin)));
                omega = add(&omega, &spin);
            }
            out.push(Spatial {
                omega,
                alpha,
                velocity,
                acceleration,
            });
        }
        out
    }

    /// The nodes that move a node: itself and its ancestors.
    fn ancestors_and_self(&self, node: usize) -> Vec<usize> {
        std::iter::successors(Some(node), |i| self.nodes[*i].parent).collect()
    }

    /// The regressor K of the tree (Eq. 5): one row per coordinate, one column per parameter,
    /// friction, offsets, rotors, springs and effort terms included.
    pub fn tree_regressor(&self, q: &[f64], qd: &[f64], qdd: &[f64]) -> DMatrix<f64> {
        let frames = self.frames(q);
        let motion = self.spatial(&frames, qd, qdd);
        let mut out = DMatrix::zeros(self.n(), self.parameters.len());
        for (column, parameter) in self.parameters.iter().enumerate() {
            match parameter {
                Parameter::Inertial(body, k) => {
                    let node = self.bodies[*body].node;
                    let (force, moment) = wrench(&frames[node], &motion[node], &self.gravity, *k);
                    let at = position(&frames[node]);
                    for ancestor in self.ancestors_and_self(node) {
                        let frame = &frames[ancestor];
                        let Some(m) = self.nodes[ancestor].motion else {
                            continue;
                        };
                        let arm = sub(&at, &position(frame));
                        let total = add(&moment, &cross(&arm, &force));
                        let z = axis(frame, m.axis.index());
                        out[(m.coordinate, column)] +=
                            m.turn * dot(&z, &total) + m.slide * dot(&z, &force);
                    }
                }
                Parameter::Friction(j, symbol) => {
                    out[(*j, column)] = crate::friction::friction_column(symbol, qd[*j]);
                }
                Parameter::Offset(j) => out[(*j, column)] = 1.0,
                Parameter::Rotor(j) => out[(*j, column)] = qdd[*j],
                Parameter::Spring(index) => {
                    let efforts = self.spring_efforts(&self.springs[*index].stored, q);
                    for (j, effort) in efforts.into_iter().enumerate() {
                        out[(j, column)] = effort;
                    }
                }
                Parameter::Term(index) => {
                    let term = &self.terms[*index];
                    let j = term.coordinate;
                    out[(j, column)] = term.at(q[j], qd[j]);
                }
            }
        }
        out
    }
}

/// The force on a body, and the moment about its origin, that the body's motion needs per unit of
/// one of its ten parameters, in the world's axes.
fn wrench(
    frame: &Mat4<f64>,
    motion: &Spatial,
    gravity: &Vec3<f64>,
    k: usize,
) -> (Vec3<f64>, Vec3<f64>) {
    let Spatial { omega, alpha, .. } = motion;
    let acceleration_less_gravity = sub(&motion.acceleration, gravity);
    match k {
        0..6 => {
            let (i, j) = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)][k];
            let mut tensor = [[0.0; 4]; 4];
            tensor[i][j] = 1.0;
            tensor[j][i] = 1.0;
            let mut turn = *frame;
            let mut back = identity();
            for a in 0..3 {
                turn[a][3] = 0.0;
                for b in 0..3 {
                    back[b][a] = frame[a][b];
                }
            }
            let tensor = mul(&mul(&turn, &tensor), &back);
            let momentum = rotate(&tensor, omega);
            (ZERO, add(&rotate(&tensor, alpha), &cross(omega, &momentum)))
        }
        6..9 => {
            let s = axis(frame, k - 6);
            let force = add(&cross(alpha, &s), &cross(omega, &cross(omega, &s)));
            (force, cross(&s, &acceleration_less_gravity))
        }
        _ => (acceleration_less_gravity, ZERO),
    }
}
