//! Checks the names under `adjustable`: numbers of `geometry` that functions of generated sources can take
//! as arguments.

use std::collections::BTreeMap;

use crate::diag::{Diagnostic, Sink, Span};
use crate::spec::suggest::did_you_mean;
use crate::spec::types::{Expr, Function, JointFrame, Quantity, Spanned, Spec};

/// The largest exponent of a power of an adjustable name.
const MAX_EXPONENT: i64 = 16;

/// How an expression depends on adjustable names.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Dependence {
    None,
    Linear,
    Other,
    /// In an exponent, or under one that is not a small whole number.
    Power,
}

/// Reports names that are unknown, repeated or no numbers, and uses of them for which functions have no
/// arguments.
pub(super) fn check(spec: &Spec, sink: &mut Sink) {
    for fault in faults(spec) {
        sink.push(fault);
    }
}

fn faults(spec: &Spec) -> Vec<Diagnostic> {
    let mut found = Vec::new();
    if spec.adjustable.is_empty() {
        return found;
    }
    for (index, name) in spec.adjustable.iter().enumerate() {
        if let Some(fault) = fault(spec, index, &name.value, name.span) {
            found.push(fault.path("adjustable"));
        }
    }
    let mut names: BTreeMap<&str, Dependence> = BTreeMap::new();
    for (name, quantity) in &spec.geometry {
        let is_adjustable = spec.adjustable.iter().any(|own| own.value == name.value);
        let own = if is_adjustable {
            Dependence::Linear
        } else {
            dependence(&quantity.expr, &names)
        };
        names.insert(&name.value, own);
    }
    let mut all = spec.clone();
    for quantity in all.quantities_mut() {
        if dependence(&quantity.expr, &names) == Dependence::Power {
            found.push(
                Diagnostic::new(quantity.span, "a power of an adjustable name")
                    .hint("its exponent must be a whole number from 0 to 16"),
            );
        }
    }
    for quantity in angles(spec) {
        if dependence(&quantity.expr, &names) == Dependence::Other {
            found.push(
                Diagnostic::new(
                    quantity.span,
                    "an angle that is not linear in an adjustable name",
                )
                .hint("name the angle itself in `geometry`, or make the name a constant"),
            );
        }
    }
    for (_, form) in &spec.couplings {
        let factors = form.terms.iter().map(|(_, factor)| factor);
        let mut parts = factors.chain([&form.constant]);
        if parts.any(|part| dependence(&part.expr, &names) != Dependence::None) {
            found.push(
                Diagnostic::new(form.span, "a coupling depends on an adjustable name")
                    .hint("the factors of couplings and drives are constants in generated sources"),
            );
        }
    }
    found
}

/// The names of the geometry that functions can take as arguments together: numbers other than 0, and no angles
/// at which axes are parallel or at right angles, which shape the functions. In the order of the description.
///
/// - `is_angle`: whether an angle depends on a name.
pub(crate) fn possible(spec: &Spec, is_angle: impl Fn(&str) -> bool) -> Vec<Spanned<String>> {
    let mut tried = spec.clone();
    tried.adjustable.clear();
    for (name, quantity) in &spec.geometry {
        let value = &quantity.value;
        let quarter_turns = value.pi_multiple().map(|own| own.clone() + own);
        let is_special = quarter_turns.is_some_and(|own| own.is_int()) && is_angle(&name.value);
        if value.is_zero() || is_special {
            continue;
        }
        tried.adjustable.push(name.clone());
        // a name that follows from others is among the faults
        if !faults(&tried).is_empty() {
            tried.adjustable.pop();
        }
    }
    tried.adjustable
}

/// What is wrong with a name, if something is.
fn fault(spec: &Spec, index: usize, name: &str, span: Span) -> Option<Diagnostic> {
    let mut before = spec.adjustable.iter().take(index);
    if let Some(first) = before.find(|own| own.value == name) {
        let message = format!("duplicate name '{name}'");
        return Some(Diagnostic::new(span, message).secondary(first.span, "first named here"));
    }
    let known = || spec.geometry.iter().map(|(own, _)| own.value.as_str());
    let Some((key, quantity)) = spec.geometry.iter().find(|(own, _)| own.value == name) else {
        let near = did_you_mean(name, known());
        let fault = Diagnostic::new(span, format!("unknown name '{name}'{near}"));
        return Some(fault.hint("adjustable are names of `geometry`"));
    };
    let mut others = Vec::new();
    names_of(&quantity.expr, &mut others);
    let other = others.first()?;
    Some(
        Diagnostic::new(span, format!("'{name}' follows from '{other}'"))
            .secondary(key.span, "defined here")
            .hint(format!(
                "name '{other}' here, or define '{name}' as a number"
            )),
    )
}

fn names_of<'e>(expr: &'e Expr, out: &mut Vec<&'e str>) {
    match expr {
        Expr::Number(_) | Expr::Pi => {}
        Expr::Name(name) => out.push(name),
        Expr::Neg(a) | Expr::Call(_, a) => names_of(a, out),
        Expr::Add(a, b) | Expr::Sub(a, b) | Expr::Mul(a, b) | Expr::Div(a, b) | Expr::Pow(a, b) => {
            names_of(a, out);
            names_of(b, out);
        }
    }
}

fn dependence(expr: &Expr, names: &BTreeMap<&str, Dependence>) -> Dependence {
    use Dependence::{None, Other, Power};
    let of = |expr: &Expr| dependence(expr, names);
    // what is not linear in something that depends on names is at least `Other`
    let nonlinear = |own: Dependence| if own == None { None } else { own.max(Other) };
    match expr {
        Expr::Number(_) | Expr::Pi => None,
        Expr::Name(name) => names.get(name.as_str()).copied().unwrap_or(None),
        Expr::Neg(a) | Expr::Call(Function::Deg, a) => of(a),
        Expr::Call(_, a) => nonlinear(of(a)),
        Expr::Add(a, b) | Expr::Sub(a, b) => of(a).max(of(b)),
        Expr::Mul(a, b) => match (of(a), of(b)) {
            (None, own) | (own, None) => own,
            (a, b) => nonlinear(a.max(b)),
        },
        Expr::Div(a, b) => match (of(a), of(b)) {
            (own, None) => own,
            (a, b) => nonlinear(a.max(b)),
        },
        Expr::Pow(a, b) => match (of(a), of(b)) {
            (None, None) => None,
            (_, own) if own != None => Power,
            (own, _) => match &**b {
                Expr::Number(n) if n.as_i64().is_some_and(|n| (0..=MAX_EXPONENT).contains(&n)) => {
                    nonlinear(own)
                }
                _ => Power,
            },
        },
    }
}

/// The angles of placements.
fn angles(spec: &Spec) -> Vec<&Quantity> {
    let bases = spec.limbs.iter().map(|limb| &limb.base);
    let sides = spec.cuts.iter().flat_map(|cut| &cut.sides);
    let sides = sides.chain(spec.frames.iter().map(|frame| &frame.on));
    let placements = bases.chain(sides.map(|side| &side.placement));
    let mut out: Vec<&Quantity> = placements.flat_map(|own| &own.rpy).collect();
    for joint in spec.limbs.iter().flat_map(|limb| &limb.joints) {
        match &joint.frame {
            JointFrame::Dh { alpha, theta, .. } => out.extend([alpha, theta]),
            JointFrame::Origin(placement) => out.extend(&placement.rpy),
        }
    }
    out
}
