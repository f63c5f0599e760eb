//! Tries the spec with another gravity, or with constant efforts, on logs that contradict it.

use std::path::Path;

use regen_codegen::Mechanism;
use regen_codegen::robot::{FunctionKind, Robot};
use regen_identify::data::Sample;
use regen_identify::data::{Assignment, Quantity};
use regen_identify::suspect::{self, LogColumns, Remedy, Suspicion, Trial};
use regen_interpreted::{BaseTerms, Interpreted};
use regen_runtime::{
    Arguments, BaseFunction, BaseInfo, BaseModel, Condition, Function, Info, Model, Parameter,
    SizeError,
};

use crate::args::PayloadArg;
use crate::load;

/// The size of gravity that is tried where the spec has none, m/s^2.
const USUAL_GRAVITY: f64 = 9.81;
/// A gravity that differs by more than this part may be in another unit.
const USUAL_TOLERANCE: f64 = 0.05;
/// Gravity is as good an explanation as numbers that are fitted up to this factor: it has no more unknowns.
const AS_GOOD: f64 = 1.05;
/// The largest number of parameters of a robot that is derived again for another gravity.
const MAX_PARAMETERS: usize = 120;

/// The functions that a trial calls: the others take most of the time of a derivation.
const TRIED_FUNCTIONS: [FunctionKind; 11] = [
    FunctionKind::Constraints,
    FunctionKind::Jacobian,
    FunctionKind::Bias,
    FunctionKind::NewtonStep,
    FunctionKind::DependentJacobian,
    FunctionKind::Velocities,
    FunctionKind::Accelerations,
    FunctionKind::GeneralizedForces,
    FunctionKind::BaseRegressor,
    FunctionKind::ToBase,
    FunctionKind::BaseMassMatrix,
];

/// A spec that is tried with other values.
#[derive(Debug, Default)]
pub(crate) struct OtherSpecs<'a> {
    file: Option<&'a Path>,
    payload: Option<PayloadArg>,
}

impl<'a> OtherSpecs<'a> {
    /// The spec in a file, for runs in which its payloads are, or are not, carried.
    pub(crate) fn new(file: &'a Path, payload: Option<PayloadArg>) -> Self {
        Self {
            file: Some(file),
            payload,
        }
    }

    /// The mechanism; `None` where the file was standard input, or runs differ in their payload.
    fn mechanism(&self) -> Option<Mechanism> {
        let file = self.file.filter(|file| *file != Path::new("-"))?;
        load::loaded(&load::source(file).ok()?, self.payload).ok()
    }
}

/// What looks wrong with a log, and the change of the spec that explains it, if there is one. It then
/// takes the place of changes of columns that explain the log less well.
///
/// - `found`: what looks wrong with the log for the present spec.
pub(super) fn with_spec(
    columns: &LogColumns<'_, Interpreted<'_>>,
    sample: &Sample,
    specs: &OtherSpecs<'_>,
    found: Vec<Suspicion>,
) -> Vec<Suspicion> {
    if found.iter().any(prevents) {
        return found;
    }
    let Some((other, _, has_gravity)) = best(columns, sample, specs) else {
        return found;
    };
    let of_columns = found.iter().filter_map(|f| {
        let left = f.left_in_sample.or(f.changed);
        let Remedy::Read { columns, .. } = &f.remedy else {
            return left;
        };
        let is_number = |c: &Assignment| c.offset != 0.0 || c.quantity == Quantity::Time;
        let are_numbers = has_gravity && (columns.is_empty() || columns.iter().any(is_number));
        left.map(|left| left * if are_numbers { AS_GOOD } else { 1.0 })
    });
    let least = of_columns.fold(f64::INFINITY, f64::min);
    if other.left_in_sample.is_none_or(|left| left >= least) {
        return found;
    }
    // what follows from the wrong gravity is not said besides
    let apart = |f: &Suspicion| {
        let columns = matches!(&f.remedy, Remedy::Read { columns, .. } if columns.is_empty());
        f.error.is_none() && columns
    };
    let rest = found.into_iter().filter(apart);
    std::iter::once(other).chain(rest).collect()
}

/// Whether a log cannot be compared with the spec: its clock or its series is wrong.
fn prevents(found: &Suspicion) -> bool {
    match &found.remedy {
        // a rate that was found by a fit has its errors
        Remedy::Read { columns, .. } => {
            found.changed.is_none() && columns.iter().any(|c| c.quantity == Quantity::Time)
        }
        remedy => *remedy == Remedy::Series,
    }
}

/// The change of the spec that fits a log best, if one fits it better than the spec itself, and whether it is one
/// to another gravity than none.
fn best(
    columns: &LogColumns<'_, Interpreted<'_>>,
    sample: &Sample,
    specs: &OtherSpecs<'_>,
) -> Option<(Suspicion, Trial, bool)> {
    let short = suspect::short_trial(columns.model, sample)?;
    if !short.is_doubtful() {
        return None;
    }
    let before = suspect::trial(columns.model, sample)?;
    // only the nominal bodies tell that a weight is missing
    let mut out = (!before.nominal.is_empty())
        .then(|| suspect::weightless(columns, sample))
        .flatten()
        .map(|(suspicion, trial)| (suspicion, trial, false));
    let info = columns.model.info();
    if info.parameters.len() > MAX_PARAMETERS {
        return out;
    }
    let Some(mechanism) = specs.mechanism() else {
        return out;
    };
    let own = mechanism.gravity();
    for group in groups(own, has_gravity_only(&info)) {
        let Some(first) = group.first().copied() else {
            continue;
        };
        let robot;
        let terms;
        let other;
        let (base, model) = if is_scaled(first, own) && has_gravity_only(&info) {
            (own, columns.model)
        } else {
            let Some(derived) = derived(&mechanism, first) else {
                continue;
            };
            robot = derived;
            terms = BaseTerms::new(&robot);
            other = Interpreted::with_terms(&robot, &terms);
            (first, &other)
        };
        if model.info().coordinates != info.coordinates {
            continue;
        }
        for gravity in group {
            let model = UnderGravity {
                model,
                scale: along(gravity, base),
            };
            let is_promising = suspect::short_trial(&model, sample)
                .is_some_and(|found| found.gain_over(&short).is_some());
            let found = is_promising
                .then(|| suspect::trial(&model, sample))
                .flatten();
            let Some(found) = found else {
                continue;
            };
            let better = found.gain_over(&before).is_some()
                && out
                    .as_ref()
                    .is_none_or(|(_, best, _)| found.is_better_than(best));
            if better {
                let what = words(own, gravity);
                let advice = format!("Give the spec {}, if that is so", key(gravity));
                let suspicion = columns.other_spec(what, &before, &found, advice);
                let has_gravity = gravity.iter().any(|g| *g != 0.0);
                out = Some((suspicion, found, has_gravity));
            }
        }
    }
    out
}

/// A model under a multiple of its gravity: what is left of the regressor at rest is that of gravity.
struct UnderGravity<'a, 'b> {
    model: &'a Interpreted<'b>,
    scale: f64,
}

impl Model for UnderGravity<'_, '_> {
    fn info(&self) -> Info<'_> {
        self.model.info()
    }

    fn eval(
        &self,
        function: Function,
        arguments: Arguments<'_, f64>,
        out: &mut [f64],
    ) -> Result<Condition<f64>, SizeError> {
        self.model.eval(function, arguments, out)
    }
}

impl BaseModel for UnderGravity<'_, '_> {
    fn base_info(&self) -> BaseInfo<'_> {
        self.model.base_info()
    }

    fn eval_base(
        &self,
        function: BaseFunction,
        arguments: Arguments<'_, f64>,
        out: &mut [f64],
    ) -> Result<Condition<f64>, SizeError> {
        let condition = self.model.eval_base(function, arguments, out)?;
        if function != BaseFunction::BaseRegressor || (self.scale - 1.0).abs() < f64::EPSILON {
            return Ok(condition);
        }
        let still = vec![0.0; arguments.q.len()];
        let mut weights = vec![0.0; out.len()];
        let at_rest = Arguments {
            qd: &still,
            qdd: &still,
            ..arguments
        };
        let _ = self.model.eval_base(function, at_rest, &mut weights)?;
        let info = self.model.info();
        let base = self.model.base_info().base;
        let dof = info.dof().max(1);
        let columns = out.chunks_mut(dof).zip(weights.chunks(dof));
        for (parameter, (column, weights)) in base.iter().zip(columns) {
            // friction stays, whatever it is at rest
            let mut terms = parameter.terms.iter();
            if terms.any(|t| {
                info.parameters
                    .get(t.index)
                    .is_some_and(Parameter::is_friction)
            }) {
                continue;
            }
            for (own, weight) in column.iter_mut().zip(weights) {
                *own += (self.scale - 1.0) * weight;
            }
        }
        Ok(condition)
    }
}

/// Whether nothing but gravity and friction needs an effort at rest.
fn has_gravity_only(info: &Info<'_>) -> bool {
    let mut parameters = info.parameters.iter();
    !parameters.any(|p| p.is_offset() || p.is_spring_or_term())
}

/// The others, with those together that need one derivation, if multiples of one gravity need no other.
fn groups(own: [f64; 3], are_multiples_one: bool) -> Vec<Vec<[f64; 3]>> {
    let mut out: Vec<Vec<[f64; 3]>> = Vec::new();
    for gravity in others(own) {
        let same = out.iter_mut().find(|group| {
            let first = group.first().copied().unwrap_or_default();
            are_multiples_one
                && (is_scaled(gravity, first) || (is_scaled(first, own) && is_scaled(gravity, own)))
        });
        match same {
            Some(group) => group.push(gravity),
            None => out.push(vec![gravity]),
        }
    }
    out
}

/// Whether a gravity is a multiple of another one.
fn is_scaled(gravity: [f64; 3], of: [f64; 3]) -> bool {
    let size = of.iter().fold(0.0, |m: f64, g| m.max(g.abs()));
    let factor = along(gravity, of);
    let mut pairs = gravity.iter().zip(of);
    size > 0.0 && pairs.all(|(a, b)| (a - factor * b).abs() < 1e-9 * size)
}

/// The factor of another gravity along which this one is; 1 if that is none.
fn along(gravity: [f64; 3], of: [f64; 3]) -> f64 {
    let dot = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    match dot(of, of) {
        0.0 => 1.0,
        square => dot(gravity, of) / square,
    }
}

/// The robot with another gravity, if it can be derived.
fn derived(mechanism: &Mechanism, gravity: [f64; 3]) -> Option<Robot> {
    let other = mechanism.with_gravity(gravity)?;
    other.robot(&TRIED_FUNCTIONS).ok()
}

/// None, the opposite, and each axis and its opposite, without the present one.
fn others(own: [f64; 3]) -> Vec<[f64; 3]> {
    let size = own.iter().map(|g| g * g).sum::<f64>().sqrt();
    let size = if size > 0.0 { size } else { USUAL_GRAVITY };
    let mut out = vec![[0.0; 3], own.map(|g| 0.0 - g)];
    // in g or in mm/s^2, as it is on earth
    if (size / USUAL_GRAVITY - 1.0).abs() > USUAL_TOLERANCE {
        let scale = USUAL_GRAVITY / size;
        out.extend([scale, -scale].map(|scale| own.map(|g| 0.0 + scale * g)));
    }
    for axis in (0..3).rev() {
        for sign in [-size, size] {
            let mut gravity = [0.0; 3];
            gravity[axis] = sign;
            out.push(gravity);
        }
    }
    let mut tried = vec![own];
    out.retain(|gravity| {
        let new = !tried.contains(gravity);
        tried.push(*gravity);
        new
    });
    out
}

/// What another gravity says of the log.
fn words(own: [f64; 3], gravity: [f64; 3]) -> String {
    let is_none = |of: [f64; 3]| of.iter().all(|g| *g == 0.0);
    let sums = own.iter().zip(gravity).map(|(a, b)| a + b);
    if is_none(gravity) {
        "these efforts do not contain gravity"
    } else if is_none(own) {
        "these efforts contain gravity, and the spec has none"
    } else if is_along(own, gravity) {
        "the spec's gravity looks as if in another unit"
    } else if sums.fold(0.0, |m: f64, sum| m.max(sum.abs())) == 0.0 {
        "the spec's gravity looks upside down"
    } else {
        "the spec's gravity looks as if along another axis"
    }
    .to_owned()
}

/// Whether both have one direction.
fn is_along(one: [f64; 3], other: [f64; 3]) -> bool {
    let size = |v: [f64; 3]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    let dot: f64 = one.iter().zip(other).map(|(a, b)| a * b).sum();
    dot > (1.0 - 1e-9) * size(one) * size(other)
}

/// The key of the spec with a gravity.
fn key(gravity: [f64; 3]) -> String {
    let [x, y, z] = gravity;
    format!("`gravity: [{x}, {y}, {z}]`")
}

#[cfg(test)]
mod tests {
    use super::*;
    use regen_runtime::Symbol;

    const DOWN: [f64; 3] = [0.0, 0.0, -9.81];

    #[test]
    fn each_axis_is_tried_once_and_earths_gravity_where_the_specs_is_in_another_unit() {
        let found = others(DOWN);
        assert_eq!(found.len(), 6);
        assert!(
            found.contains(&[0.0; 3])
                && found.contains(&[0.0, 0.0, 9.81])
                && !found.contains(&DOWN)
        );
        for (place, gravity) in found.iter().enumerate() {
            assert!(!found[..place].contains(gravity), "{found:?}");
        }
        let in_millimetres = others([0.0, 0.0, -9810.0]);
        let is_earths = |sign: f64| {
            let near = |own: &&[f64; 3]| (own[2] - sign * USUAL_GRAVITY).abs() < 1e-9;
            in_millimetres.iter().filter(near).count() == 1
        };
        assert!(
            in_millimetres.len() == 8 && is_earths(1.0) && is_earths(-1.0),
            "{in_millimetres:?}"
        );
        // without a gravity, those of earth
        assert_eq!(others([0.0; 3]).len(), 6);
    }

    #[test]
    fn multiples_of_one_gravity_are_derived_together_if_nothing_else_acts_at_rest() {
        let of = |gravity: [f64; 3], are_one: bool| -> Vec<usize> {
            groups(gravity, are_one).iter().map(Vec::len).collect()
        };
        // none and upside down; then both directions of each axis
        assert_eq!(of(DOWN, true), [2, 2, 2]);
        assert_eq!(of([0.0, 0.0, -9810.0], true), [4, 2, 2]);
        assert_eq!(of(DOWN, false), [1; 6]);
        let with = |symbol: Symbol<'static>| {
            has_gravity_only(&Info {
                parameters: &[
                    Parameter::new(Symbol::Mass, "a"),
                    Parameter::new(symbol, "b"),
                ],
                ..Info::EMPTY
            })
        };
        assert!(with(Symbol::Friction("Fv")) && with(Symbol::Mass));
        assert!(!with(Symbol::Offset) && !with(Symbol::Stiffness) && !with(Symbol::Term("k")));
    }

    #[test]
    fn what_another_gravity_says_depends_on_its_direction() {
        let says = |gravity: [f64; 3], what: &str| words(DOWN, gravity).contains(what);
        assert!(says([0.0; 3], "do not contain"));
        assert!(says([0.0, 0.0, -9810.0], "another unit"));
        assert!(says([0.0, 0.0, 9.81], "upside down"));
        assert!(says([0.0, 9.81, 0.0], "another axis"));
        assert!(words([0.0, -5.0, -8.4], [0.0, 0.0, -9.81]).contains("another axis"));
        assert!(words([0.0; 3], DOWN).contains("the spec has none"));
    }

    #[test]
    fn a_spec_of_standard_input_is_not_read_again() {
        assert!(OtherSpecs::new(Path::new("-"), None).mechanism().is_none());
        assert!(OtherSpecs::default().mechanism().is_none());
        let fivebar = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../runtime/guide/fivebar/fivebar.yaml"
        );
        assert!(
            OtherSpecs::new(Path::new(fivebar), None)
                .mechanism()
                .is_some()
        );
    }
}
