//! Checks the size of a robot: a larger one is a mistake or an attack, and would take hours or all
//! memory instead of giving an error.

use super::super::raw::RawSpec;
use super::Checker;
use crate::diag::{Diagnostic, Span};

/// Largest number of coordinates. The largest robots that people describe have fewer than a
/// hundred.
pub(super) const MAX_COORDINATES: usize = 256;
/// Largest number of bodies, including those on fixed joints.
pub(super) const MAX_BODIES: usize = 384;
/// Largest number of equations of cuts and couplings. It is above the number of coordinates,
/// although no more equations can be independent: three of the five equations of a planar loop are
/// redundant.
pub(super) const MAX_EQUATIONS: usize = 640;

impl Checker<'_> {
    /// Whether the robot is within the limits; reports those that it exceeds.
    pub(super) fn limits(&mut self) -> bool {
        let raw = self.raw;
        let coordinates = self.inventory.coordinates.len();
        let bodies = self.inventory.bodies.len();
        let first = |span: Option<Span>| span.unwrap_or_default();
        let limb = first(raw.limbs.first().map(|limb| limb.name.0.span));
        let cut = first(raw.cuts.iter().flatten().next().map(|cut| cut.name.0.span));
        let counts = [
            (coordinates, MAX_COORDINATES, "coordinates", limb),
            (bodies, MAX_BODIES, "bodies", limb),
            (
                equations(raw),
                MAX_EQUATIONS,
                "equations of cuts and couplings",
                cut,
            ),
        ];
        let mut within = true;
        for (count, limit, what, span) in counts {
            if count > limit {
                within = false;
                let message = format!("the robot has {count} {what}; the limit is {limit}");
                self.sink.push(
                    Diagnostic::new(span, message)
                        .hint("describe a part of it: several robots may stand in several files"),
                );
            }
        }
        within
    }
}

fn equations(raw: &RawSpec) -> usize {
    let cuts = raw.cuts.iter().flatten();
    let rows: usize = cuts.map(|cut| cut.joint.value.equations()).sum();
    let couplings = raw.couplings.as_ref().map_or(0, |all| all.0.len());
    rows + couplings + raw.drives().count()
}
