//! Sines and cosines of related angles. Those of a sum are computed from those of its parts by four
//! products, if these are needed anyway; otherwise directly.

use rustc_hash::FxHashMap;

use crate::sym::{Angle, AngleId, Graph, Number, SymbolId};

use super::program::{Op, Operand};

/// The angles of which a program needs the sine and cosine.
#[derive(Debug)]
pub(super) struct Angles {
    needed: Vec<Angle>,
    /// The sines and cosines for which the program has steps.
    done: FxHashMap<Angle, (Operand, Operand)>,
}

impl Angles {
    pub(super) fn new(g: &Graph, needed: &[AngleId]) -> Self {
        Angles {
            needed: needed.iter().map(|id| g.angle(*id).clone()).collect(),
            done: FxHashMap::default(),
        }
    }

    /// Whether the program needs the sine and cosine of this angle, or has steps for them already.
    fn wanted(&self, angle: &Angle) -> bool {
        self.done.contains_key(angle) || self.needed.contains(angle)
    }
}

/// The program to which steps are added.
pub(super) trait Target {
    /// The angles that the program needs, and those whose sine and cosine it has.
    fn angles(&mut self) -> &mut Angles;
    /// The operand and the name of a symbol.
    fn symbol(&self, id: SymbolId) -> (Operand, String);
    /// Adds a step with one result, for which a name may be suggested.
    fn step(&mut self, op: Op, name: Option<String>) -> Operand;
    /// Adds the step for a sine and a cosine, with the suggested names of both.
    fn sin_cos_step(&mut self, argument: Operand, names: (String, String)) -> (Operand, Operand);
}

/// Adds the steps for the sine and cosine of an angle.
pub(super) fn lower(target: &mut impl Target, angle: &Angle) -> (Operand, Operand) {
    if let Some(done) = target.angles().done.get(angle) {
        return *done;
    }
    let result = match split(target.angles(), angle) {
        Some((first, second, sign)) => {
            let (sa, ca) = lower(target, &first);
            let (sb, cb) = if second.terms.is_empty() {
                let (sin, cos) = second.constant.sin_cos();
                (
                    Operand::Constant(sin.to_f64()),
                    Operand::Constant(cos.to_f64()),
                )
            } else {
                lower(target, &second)
            };
            let label = label(target, angle);
            // sin(a +- b) = sa cb +- ca sb, cos(a +- b) = ca cb -+ sa sb
            let (right, low) = (
                target.step(Op::Mul(ca, sb), None),
                target.step(Op::Mul(sa, sb), None),
            );
            let sin_name = Some(format!("sin_{label}"));
            let cos_name = Some(format!("cos_{label}"));
            if sign {
                (
                    target.step(Op::MulAdd(sa, cb, right), sin_name),
                    target.step(Op::MulSub(ca, cb, low), cos_name),
                )
            } else {
                (
                    target.step(Op::MulSub(sa, cb, right), sin_name),
                    target.step(Op::MulAdd(ca, cb, low), cos_name),
                )
            }
        }
        None => direct(target, angle),
    };
    target.angles().done.insert(angle.clone(), result);
    result
}

/// Splits an angle into the sum (`true`) or difference (`false`) of two angles whose sine and
/// cosine are needed anyway; a constant second part costs nothing.
fn split(angles: &Angles, angle: &Angle) -> Option<(Angle, Angle, bool)> {
    let one = Number::one();
    if !angle.constant.is_zero() && !angle.terms.is_empty() {
        let bare = Angle {
            terms: angle.terms.clone(),
            constant: Number::zero(),
        };
        if angles.wanted(&bare) {
            return Some((bare, Angle::constant(angle.constant.clone()), true));
        }
    }
    if angle.terms.len() < 2 {
        return None;
    }
    for (symbol, coefficient) in angle.terms.iter().rev() {
        let part = Angle::symbol(*symbol);
        let sign = coefficient.is_one();
        if !sign && !coefficient.neg().is_one() {
            continue;
        }
        let rest = angle.plus(&part, &if sign { one.neg() } else { one.clone() });
        let leads = rest.terms.first().is_some_and(|t| !t.1.is_negative());
        let simpler =
            rest.terms.len() == 1 || angles.wanted(&rest) || split(angles, &rest).is_some();
        if leads
            && angles.wanted(&part)
            && simpler
            && (rest.terms.len() > 1 || angles.wanted(&rest))
        {
            return Some((rest, part, sign));
        }
    }
    None
}

/// Adds the steps for the angle as a linear form, then for its sine and cosine.
fn direct(target: &mut impl Target, angle: &Angle) -> (Operand, Operand) {
    let mut sum: Option<Operand> =
        (!angle.constant.is_zero()).then(|| Operand::Constant(angle.constant.to_f64()));
    for (symbol, coefficient) in &angle.terms {
        let (operand, _) = target.symbol(*symbol);
        let factor = Operand::Constant(coefficient.to_f64());
        sum = Some(match sum {
            None if coefficient.is_one() => operand,
            None => target.step(Op::Mul(factor, operand), None),
            Some(sum) if coefficient.is_one() => target.step(Op::Add(operand, sum), None),
            Some(sum) if coefficient.neg().is_one() => target.step(Op::Sub(sum, operand), None),
            Some(sum) => target.step(Op::MulAdd(factor, operand, sum), None),
        });
    }
    let label = label(target, angle);
    let argument = sum.unwrap_or(Operand::Constant(0.0));
    target.sin_cos_step(argument, (format!("sin_{label}"), format!("cos_{label}")))
}

/// A name such as `q1_q2` for q1 + q2.
fn label(target: &impl Target, angle: &Angle) -> String {
    let mut label = String::new();
    for (symbol, coefficient) in &angle.terms {
        let (_, name) = target.symbol(*symbol);
        if !label.is_empty() {
            label.push('_');
        }
        if coefficient.is_negative() {
            label.push_str("minus_");
        }
        if !coefficient.abs().is_one() {
            label.push_str("times_");
        }
        label.push_str(&name);
    }
    if !angle.constant.is_zero() {
        label.push_str("_off");
    }
    label
}
