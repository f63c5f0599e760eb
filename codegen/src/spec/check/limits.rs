//! How large a robot may be: what is larger is a mistake or an attack, and would take hours or
//! all memory instead of an error.

use super::super::raw::RawSpec;
use super::Checker;
use crate::diag::{Diagnostic, Span};

/// Most coordinates. The largest robots people describe have less than a hundred.
pub(super) const COORDINATES: usize = 256;
/// Most bodies, those on fixed joints among them.
pub(super) const BODIES: usize = 384;
/// Most equations of cuts and couplings. As many as coordinates can be independent, but a planar
/// loop has three redundant ones in five.
pub(super) const EQUATIONS: usize = 640;

impl Checker<'_> {
    /// Whether the robot is within the limits; tells what is not.
    pub(super) fn limits(&mut self) -> bool {
        let raw = self.raw;
        let coordinates = self.inventory.coordinates.len();
        let bodies = self.inventory.bodies.len();
        let first = |span: Option<Span>| span.unwrap_or_default();
        let limb = first(raw.limbs.first().map(|limb| limb.name.0.span));
        let cut = first(raw.cuts.iter().flatten().next().map(|cut| cut.name.0.span));
        let found = [
            (coordinates, COORDINATES, "coordinates", limb),
            (bodies, BODIES, "bodies", limb),
            (
                equations(raw),
                EQUATIONS,
                "equations of cuts and couplings",
                cut,
            ),
        ];
        let mut within = true;
        for (count, limit, what, span) in found {
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
    rows + raw
        .couplings
        .as_ref()
        .map_or(0, |couplings| couplings.0.len())
}
