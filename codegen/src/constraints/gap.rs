//! The distances and angles by which cuts are open where the loops do not close.

use crate::model::Model;

use super::home::NumericLoops;

/// The distance and the angle between the two sides of an open cut.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gap {
    /// The cut, by its place in the spec.
    pub cut: usize,
    /// The distance between points that should coincide, m.
    pub metres: f64,
    /// The largest angle between axes and the directions that they should have, rad.
    pub radians: f64,
}

/// The cuts that are open at a state, the widest first.
pub fn gaps(loops: &NumericLoops<'_>, model: &Model, q: &[f64]) -> Vec<Gap> {
    /// Below this, m and rad, a cut counts as closed.
    const CLOSED: f64 = 1e-6;
    let (residual, _) = loops.at(q);
    let mut rows = residual.into_iter();
    let mut gaps: Vec<Gap> = Vec::new();
    for (cut, side) in model.cuts.iter().enumerate() {
        let (mut square, mut radians) = (0.0, 0.0_f64);
        for (is_length, x) in super::rows::lengths_of(side.kind).zip(rows.by_ref()) {
            if is_length {
                square += x * x;
            } else {
                radians = radians.max(libm::asin(x.abs().min(1.0)));
            }
        }
        let metres = libm::sqrt(square);
        if metres > CLOSED || radians > CLOSED {
            gaps.push(Gap {
                cut,
                metres,
                radians,
            });
        }
    }
    let width = |gap: &Gap| gap.metres.max(gap.radians);
    gaps.sort_by(|one, other| width(other).total_cmp(&width(one)));
    gaps
}
