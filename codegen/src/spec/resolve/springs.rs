//! Evaluates springs and effort terms.

use super::{Resolver, body_label, collect_all, spanned};
use crate::spec::expression::effort_term;
use crate::spec::raw::RawSpring;
use crate::spec::shape::Scalar;
use crate::spec::types::{EffortExpr, PointSpring, SpringEnd, SpringForce};

impl Resolver<'_> {
    /// Evaluates the constants of an effort term's factor.
    pub(super) fn effort_term(&mut self, scalar: &Scalar) -> Option<EffortExpr> {
        if self.uses_failed_value(&scalar.ast) {
            return None;
        }
        let lookup = |name: &str| self.values.get(name).cloned().flatten();
        match effort_term(&scalar.ast, &lookup) {
            Ok(EffortExpr::Constant(constant)) if constant.value.is_zero() => {
                self.report(scalar, "this effort term is always 0");
                None
            }
            Ok(factor) => Some(factor),
            Err(error) => {
                self.sink.push(error.at(&scalar.path));
                None
            }
        }
    }

    pub(super) fn spring(&mut self, raw: &RawSpring) -> Option<PointSpring> {
        let ends = collect_all(&raw.between, |point| {
            Some(SpringEnd {
                body: body_label(&point.body),
                xyz: self.quantities(&point.xyz)?,
            })
        });
        let length = match &raw.length {
            Some(length) => {
                let value = self.quantity(length)?;
                if value.value.is_negative() {
                    self.report(length, "the length of a spring must not be negative");
                    return None;
                }
                Some(value)
            }
            None => None,
        };
        let nominal = collect_all(
            raw.nominal.iter().flat_map(|nominal| &nominal.0),
            |(symbol, scalar)| {
                let quantity = self.quantity(scalar)?;
                if symbol.0.text != "f" && quantity.value.is_negative() {
                    self.report(scalar, "the stiffness of a spring must not be negative");
                    return None;
                }
                Some((spanned(&symbol.0), quantity))
            },
        );
        Some(PointSpring {
            name: spanned(&raw.name.0),
            ends: ends?.try_into().ok()?,
            force: if raw.constant.value {
                SpringForce::Constant
            } else {
                SpringForce::Elastic { length }
            },
            nominal: nominal?,
            span: raw.span,
        })
    }
}
