//! The columns of K (Eq. 4-5) and of the reduced regressor K_i - X^T K_e (Eq. 11).
//!
//! A joint's row is the power of the link's inertial forces on the joint's unit
//! twist (e, u) at the link's origin, e and u being the partial velocities of
//! Eq. 1. With the forces linear in the ten parameters,
//! moment `eta_hat I - a x m r` and force `eta_tilde m r + a m`, the row is
//! `[e^T eta_hat | a x e + eta_tilde^T u | u . a]`. For a revolute joint
//! u = e x r_OkOi, which gives Eq. 4; for a prismatic one e = 0.

use crate::kinematics::{LinkMotion, Rates, Twist};
use crate::model::{FrictionColumn, Model, ParameterKind};
use crate::sym::{Ex, Graph, V3, ZERO3};

use super::Reduction;

/// The link's inertial forces, linear in its ten parameters.
#[derive(Clone, Debug)]
pub struct Projection {
    /// eta hat of Eq. 3-4, column by column: Ixx Ixy Ixz Iyy Iyz Izz.
    eta_hat: [V3; 6],
    /// eta tilde, column by column.
    eta_tilde: [V3; 3],
    /// Acceleration of the origin.
    a: V3,
}

impl Projection {
    /// The forces of a link in this motion.
    pub fn new(g: &mut Graph, motion: &LinkMotion) -> Self {
        let eta = &motion.eta;
        let [xx, xy, xz, yy, yz, zz] = motion.ww;
        let [ax, ay, az] = motion.alpha;
        let eta_hat = [
            [ax, xz, g.neg(xy)],
            // alpha_y - xz and alpha_x + yz also stand in eta tilde
            [g.neg(eta[2][0]), eta[2][1], g.sub(xx, yy)],
            [eta[1][0], g.sub(zz, xx), g.neg(eta[1][2])],
            [g.neg(yz), ay, xy],
            [g.sub(yy, zz), g.neg(eta[0][1]), eta[0][2]],
            [yz, g.neg(xz), az],
        ];
        Projection {
            eta_hat,
            eta_tilde: crate::sym::transposed(eta),
            a: motion.a,
        }
    }

    /// The ten entries of a row for a twist.
    pub fn row(&self, g: &mut Graph, twist: &Twist) -> [Ex; 10] {
        let mut row = [Ex::ZERO; 10];
        for (entry, column) in row.iter_mut().zip(&self.eta_hat) {
            *entry = g.dot3(&twist.e, column);
        }
        let moment = g.cross(&self.a, &twist.e);
        for axis in 0..3 {
            let force = g.dot3(&self.eta_tilde[axis], &twist.u);
            row[6 + axis] = g.add(moment[axis], force);
        }
        row[9] = g.dot3(&twist.u, &self.a);
        row
    }
}

/// The ten columns of a body in the row of one coordinate: a block of K.
pub fn inertial_row(g: &mut Graph, motion: &LinkMotion, twist: &Twist) -> [Ex; 10] {
    Projection::new(g, motion).row(g, twist)
}

/// What a friction coefficient is multiplied by (Eq. 14).
pub fn friction_factor(g: &mut Graph, column: FrictionColumn, qd: Ex, rd: Ex) -> Ex {
    match column {
        FrictionColumn::Viscous => rd,
        FrictionColumn::Coulomb => g.sign(qd),
        FrictionColumn::ViscousPositive => {
            let on = g.positive(qd);
            g.mul(on, rd)
        }
        FrictionColumn::ViscousNegative => {
            let on = g.negative(qd);
            g.mul(on, rd)
        }
        FrictionColumn::CoulombPositive => g.positive(qd),
        FrictionColumn::CoulombNegative => {
            let on = g.negative(qd);
            g.neg(on)
        }
    }
}

/// W, one column per parameter, each with a row per independent coordinate:
/// K_i - X^T K_e (Eq. 11) with friction and rotor columns (Eq. 20), the ones of
/// dependent joints projected by -X^T.
pub fn reduced_regressor(
    g: &mut Graph,
    model: &Model,
    motions: &[LinkMotion],
    twists: &[Vec<(usize, Twist)>],
    rates: &Rates,
    j: &Reduction,
) -> Vec<Vec<Ex>> {
    let mut columns = Vec::with_capacity(model.parameters.len());
    for body in &model.bodies {
        let rows = body_rows(g, &motions[body.link], &twists[body.link], j);
        for entry in 0..10 {
            columns.push(rows.iter().map(|row| row[entry]).collect());
        }
    }
    for parameter in &model.parameters {
        let (coordinate, factor) = match parameter.kind {
            ParameterKind::Inertial { .. } => continue,
            ParameterKind::Friction { coordinate, column } => {
                let factor = friction_factor(g, column, rates.qd[coordinate], rates.rd[coordinate]);
                (coordinate, factor)
            }
            ParameterKind::Rotor { coordinate } => (coordinate, rates.qdd[coordinate]),
        };
        let column = (0..j.width()).map(|i| g.mul(j.at(coordinate, i), factor));
        columns.push(column.collect());
    }
    columns
}

/// A body's block: rows by independent coordinate.
///
/// Where several of the coordinates that move the body follow one independent
/// coordinate, their unit twists are added up first and the body's forces are
/// projected once; where it is a single one, its row of K is scaled.
fn body_rows(
    g: &mut Graph,
    motion: &LinkMotion,
    twists: &[(usize, Twist)],
    j: &Reduction,
) -> Vec<[Ex; 10]> {
    let projection = Projection::new(g, motion);
    let mut rows = Vec::new();
    for i in 0..j.width() {
        let moving: Vec<(Ex, &Twist)> = twists
            .iter()
            .map(|(c, t)| (j.at(*c, i), t))
            .filter(|(weight, _)| !weight.is_zero())
            .collect();
        let row = match moving.as_slice() {
            [] => [Ex::ZERO; 10],
            [(weight, twist)] => {
                let row = projection.row(g, twist);
                row.map(|entry| g.mul(*weight, entry))
            }
            several => {
                let mut sum = Twist { e: ZERO3, u: ZERO3 };
                for (weight, twist) in several {
                    sum.e = g.add_scaled3(&sum.e, *weight, &twist.e);
                    sum.u = g.add_scaled3(&sum.u, *weight, &twist.u);
                }
                projection.row(g, &sum)
            }
        };
        rows.push(row);
    }
    rows
}
