//! Checks springs: those between points of two bodies, and the names in effort terms.

use super::super::expression::{POSITION, RATE};
use super::super::raw::{RawJoint, RawSpring};
use super::super::shape::Scalar;
use super::super::suggest::{did_you_mean, one_of};
use super::{Checker, duplicates};
use crate::diag::Diagnostic;

impl Checker<'_> {
    pub(super) fn springs(&mut self) {
        let springs = self.raw.springs.iter().flatten();
        let names = springs.clone().map(|spring| &spring.name.0);
        duplicates("spring name", names, self.sink);
        for spring in springs {
            self.spring(spring);
        }
    }

    fn spring(&mut self, spring: &RawSpring) {
        let [a, b] = [&spring.between[0].body.0, &spring.between[1].body.0];
        let known = self.known_bodies(&[a, b]);
        if known && a.text == b.text {
            let name = &spring.name.0.text;
            let message = format!("both ends of spring '{name}' are on '{}'", a.text);
            self.sink.push(
                b.error(message)
                    .secondary(a.span, "the first end is on it too")
                    .hint("its length never changes: attach one end to another body"),
            );
        }
        if let Some(length) = &spring.length
            && spring.constant.value
        {
            self.sink.push(
                Diagnostic::new(length.ast.span, "a constant pull has no length")
                    .path(&*length.path)
                    .secondary(spring.constant.span, "the pull is constant")
                    .hint("remove the length, or `constant: true`"),
            );
        }
        let symbols = spring.symbols();
        for (symbol, _) in spring.nominal.iter().flat_map(|nominal| &nominal.0) {
            let symbol = &symbol.0;
            if !symbols.contains(&symbol.text.as_str()) {
                let near = did_you_mean(&symbol.text, symbols.iter().copied());
                let all = one_of(symbols.iter().copied()).replace(" or ", " and ");
                self.sink.push(
                    symbol
                        .error(format!(
                            "'{}' is not a parameter of this spring{near}",
                            symbol.text
                        ))
                        .hint(format!("it has {all}")),
                );
            }
        }
    }

    /// Checks the names in a joint's effort terms: `q`, `qd` and geometry names.
    pub(super) fn effort_terms(&mut self, joint: &RawJoint) {
        for (_, factor) in joint.terms.iter().flat_map(|terms| &terms.0) {
            self.effort_term(&factor.0);
        }
    }

    fn effort_term(&mut self, factor: &Scalar) {
        let mut faults = Vec::new();
        factor.ast.names(&mut |ast, name| {
            if name == POSITION || name == RATE || self.geometry_index(name).is_some() {
                return;
            }
            let fault = if self.coordinates.contains(name) {
                Diagnostic::new(ast.span, format!("an effort term cannot use '{name}'"))
                    .hint("write `q` for the joint's own coordinate and `qd` for its rate")
            } else {
                self.unknown_name(ast.span, name)
            };
            faults.push(fault.path(&*factor.path));
        });
        for fault in faults {
            self.sink.push(fault);
        }
    }
}
