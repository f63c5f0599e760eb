//! Checks the names in constant expressions.

use super::super::shape::Scalar;
use super::super::suggest::did_you_mean;
use super::{Checker, listing};
use crate::diag::Diagnostic;

impl Checker<'_> {
    /// Checks that every name in a constant expression is a geometry name; in `geometry` itself, an
    /// earlier one.
    pub(super) fn constants(&mut self) {
        let raw = self.raw;
        let geometry = raw
            .geometry
            .as_ref()
            .map_or(&[][..], |geometry| &geometry.0);
        for (index, (_, scalar)) in geometry.iter().enumerate() {
            self.constant(scalar, index);
        }
        let all = geometry.len();
        for scalar in &raw.gravity {
            self.constant(scalar, all);
        }
        for limb in &raw.limbs {
            for scalar in limb.base.constants() {
                self.constant(scalar, all);
            }
            for joint in &limb.joints {
                for scalar in joint.constants() {
                    self.constant(scalar, all);
                }
            }
        }
        for drive in raw.drive_joints() {
            for scalar in drive.constants() {
                self.constant(scalar, all);
            }
        }
        for cut in raw.cuts.iter().flatten() {
            for scalar in cut.constants() {
                self.constant(scalar, all);
            }
        }
        for spring in raw.springs.iter().flatten() {
            for scalar in spring.constants() {
                self.constant(scalar, all);
            }
        }
        for frame in raw.frames.iter().flatten() {
            for scalar in frame.xyz.iter().chain(&frame.rpy) {
                self.constant(scalar, all);
            }
        }
        for (_, scalar) in raw.home.iter().flat_map(|home| &home.value.0) {
            self.constant(scalar, all);
        }
        for (_, inertia) in raw.bodies.iter().flat_map(|bodies| &bodies.0) {
            self.constant(&inertia.mass, all);
            for scalar in inertia.com.iter().chain(&inertia.inertia) {
                self.constant(scalar, all);
            }
        }
    }

    /// The index of a geometry name in the list of definitions.
    pub(super) fn geometry_index(&self, name: &str) -> Option<usize> {
        self.geometry.get(name).copied()
    }

    /// All geometry names.
    pub(super) fn geometry_names(&self) -> Vec<String> {
        let geometry = self.raw.geometry.iter().flat_map(|geometry| &geometry.0);
        geometry.map(|(name, _)| name.0.text.clone()).collect()
    }

    /// Checks one expression, which may use the first `visible` geometry names.
    fn constant(&mut self, scalar: &Scalar, visible: usize) {
        if self.sink.is_full() {
            return;
        }
        let mut faults = Vec::new();
        scalar
            .ast
            .names(&mut |ast, name| match self.geometry_index(name) {
                Some(index) if index < visible => {}
                Some(index) => {
                    let message = if index == visible {
                        format!("'{name}' is defined by itself")
                    } else {
                        format!("'{name}' is only defined later")
                    };
                    let mut fault = Diagnostic::new(ast.span, message)
                        .path(&*scalar.path)
                        .hint("expressions in `geometry` use earlier names; change the order");
                    if let Some((key, _)) = self
                        .raw
                        .geometry
                        .as_ref()
                        .and_then(|geometry| geometry.0.get(index))
                        && index != visible
                    {
                        fault = fault.secondary(key.0.span, "defined here");
                    }
                    faults.push(fault);
                }
                None => faults.push(self.unknown_name(ast.span, name).path(&*scalar.path)),
            });
        for fault in faults {
            self.sink.push(fault);
        }
    }

    pub(super) fn unknown_name(&self, span: crate::diag::Span, name: &str) -> Diagnostic {
        let known = self.geometry_names();
        let near = did_you_mean(name, known.iter().map(String::as_str).chain(["pi"]));
        let fault = Diagnostic::new(span, format!("unknown name '{name}'{near}"));
        if self.coordinates.contains(name) {
            fault.hint("it is a coordinate; this value must be constant")
        } else if near.is_empty() {
            fault.hint(match known.as_slice() {
                [] => "names are defined in `geometry`, which is not there".to_owned(),
                known => format!(
                    "names are defined in `geometry`; {}",
                    listing("name", known)
                ),
            })
        } else {
            fault
        }
    }
}
