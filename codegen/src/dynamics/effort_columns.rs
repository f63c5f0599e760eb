//! The columns of parameters that belong to no body: the generalised forces of friction, offsets,
//! rotors, springs and effort terms, each for a parameter of 1.

use crate::kinematics::{Frames, Rates, spring_column};
use crate::model::{FrictionColumn, Model, ParameterKind};
use crate::sym::{Ex, Graph};

/// The efforts in the joints of the tree for a value of 1 of the parameter, as pairs of coordinate
/// and effort; the other coordinates have no effort. Empty for inertial parameters.
///
/// Efforts that remain at rest (offsets, springs, effort terms without the rate) are included only
/// if `rates.gravity` is set, as gravity is. Of an effort term that depends on the rate, the part
/// that vanishes at rest remains if it is not set.
pub fn effort_column(
    g: &mut Graph,
    model: &Model,
    frames: &Frames,
    rates: &Rates,
    kind: ParameterKind,
) -> Vec<(usize, Ex)> {
    match kind {
        ParameterKind::Friction { coordinate, column } => {
            let (qd, rd) = (rates.qd[coordinate], rates.rd[coordinate]);
            vec![(coordinate, friction_factor(g, column, qd, rd))]
        }
        ParameterKind::Offset { coordinate } if rates.gravity => vec![(coordinate, Ex::ONE)],
        ParameterKind::Rotor { coordinate } => vec![(coordinate, rates.qdd[coordinate])],
        ParameterKind::Inertial { .. } | ParameterKind::Offset { .. } => Vec::new(),
        ParameterKind::JointSpring { .. }
        | ParameterKind::EffortTerm { .. }
        | ParameterKind::PointSpring { .. } => spring_column(g, model, frames, rates, kind),
    }
}

/// The factor that multiplies a friction coefficient in the joint's effort (Eq. 14). `qd` is the
/// joint's velocity, which decides the direction of friction; `rd` is its reference velocity, which
/// viscous friction is proportional to. Both are equal unless the forces are those of a
/// passivity-based controller (see [`Rates::rd`]).
fn friction_factor(g: &mut Graph, column: FrictionColumn, qd: Ex, rd: Ex) -> Ex {
    match column {
        FrictionColumn::Viscous => rd,
        FrictionColumn::Coulomb => g.sign(qd),
        FrictionColumn::ViscousPositive => {
            let is_positive = g.positive(qd);
            g.mul(is_positive, rd)
        }
        FrictionColumn::ViscousNegative => {
            let is_negative = g.negative(qd);
            g.mul(is_negative, rd)
        }
        FrictionColumn::CoulombPositive => g.positive(qd),
        FrictionColumn::CoulombNegative => {
            let is_negative = g.negative(qd);
            g.neg(is_negative)
        }
    }
}
