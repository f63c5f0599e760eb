//! Physical parameters for `regen identify`: verdict, constraints, nonlinear friction.

use std::fmt::Write as _;

use indicatif::ProgressBar;
use regen_runtime::feasibility::{
    Bound, Combinations, FeasibilityError, Layout, OPTIMAL, Options, Outcome, Physical, Prior,
    SYMBOLS, Scale, Total, Verdict, identify, verdict,
};
use regen_runtime::friction::{self, FrictionData, FrictionJoint, JointFit, fit};
use regen_runtime::intervals::{LeastSquares, Spread, constrained};
use regen_runtime::{Closure, Friction};

use crate::args::{IdentifyArgs, PhysicalArgs, PriorArg};
use crate::exit::Failure;
use crate::identified::{IdentifiedModel, Interval, Intervals};
use crate::identify::{Start, note_short, spoken};
use crate::terminal;
use regen_interpreted::Interpreted;

/// The layout and combinations of a model.
pub(crate) fn frame(model: &Interpreted<'_>) -> Result<(Layout, Combinations), Failure> {
    let layout = Layout::new(model.info().parameters)?;
    let combinations = Combinations::from_model(model, layout.len())?;
    Ok((layout, combinations))
}

/// The models of a start: least squares with its verdict, and the physical one.
///
/// The parameters of the start behind the base parameters are of linear friction at joints whose
/// friction is not linear.
pub(crate) fn models(
    model: &Interpreted<'_>,
    args: &IdentifyArgs,
    start: &Start,
    working: &ProgressBar,
) -> Result<Vec<IdentifiedModel>, Failure> {
    let (factor, values) = (&start.factor, start.estimate.values.as_slice());
    let data = start.data.as_ref();
    let (plain_layout, plain) = frame(model)?;
    let r = plain.labels().len();
    let more = factor.labels().get(r..).unwrap_or_default();
    let joints = data.map_or(&[][..], FrictionData::joints);
    let layout = plain_layout.extended(more)?;
    let combinations = plain.extended(more);
    let scale = scale(model, &layout, &combinations, values)?;
    let options = Options {
        scale,
        ..options(model, &args.physical, &layout)?
    };
    let judged = verdict(&layout, &combinations, values, scale)?;
    let mut out = vec![IdentifiedModel {
        name: if data.is_some() {
            "linear, least squares"
        } else {
            "least squares"
        },
        beta: values.get(..r).unwrap_or_default().to_vec(),
        phi: None,
        friction: linear(joints, values.get(r..).unwrap_or_default()),
        feasibility: told(&judged),
        ..IdentifiedModel::default()
    }];
    let linear_fit = identify(factor, &combinations, &layout, &options)?;
    let p = plain_layout.len();
    let draws = args.physical.draws;
    let mut progress = |done: usize| {
        working.set_message(format!("intervals: {done} of {draws} fits"));
    };
    let intervals = if data.is_some() || draws == 0 {
        Intervals::default()
    } else {
        let least = LeastSquares {
            factor,
            values,
            deviations: &start.deviations,
        };
        let found = (linear_fit.phi.as_slice(), linear_fit.beta.as_slice());
        let found = constrained(
            least,
            &combinations,
            &layout,
            &options,
            found,
            draws,
            &mut progress,
        )?;
        let known = match start.blocks {
            Some(_) => spoken(&start.deviations),
            None => "for white residuals".to_owned(),
        };
        let one = |s: &Spread| drawn_interval(s, args.confidence);
        Intervals {
            base: found.base.iter().map(one).collect(),
            physical: found.physical.iter().map(|s| one(s.as_ref()?)).collect(),
            friction: Vec::new(),
            method: drawn(found.replicates, &known),
        }
    };
    out.push(IdentifiedModel {
        name: if data.is_some() {
            "linear, feasible"
        } else {
            "feasible"
        },
        beta: linear_fit.beta.get(..r).unwrap_or_default().to_vec(),
        phi: linear_fit.phi.get(..p).map(<[f64]>::to_vec),
        friction: linear(joints, linear_fit.phi.get(p..).unwrap_or_default()),
        feasibility: cost(&linear_fit, &layout),
        gap: Some(linear_fit.gap),
        intervals,
        ..IdentifiedModel::default()
    });
    if let Some(data) = data {
        let own = Options {
            scale,
            ..self::options(model, &args.physical, &plain_layout)?
        };
        let found = fit(data, &plain, &plain_layout, &own)?;
        let mut text = format!(
            "physical; {:.3} % of the linear model's squared residuals; with these shapes {}",
            100.0 * found.squared_residual / found.linear,
            proven(found.gap)
        );
        if !found.converged {
            text.push_str("; the search for the shapes had not settled");
        }
        let intervals = if draws == 0 {
            Intervals::default()
        } else {
            let spread = friction::intervals(
                data,
                &plain,
                &plain_layout,
                &own,
                &found,
                draws,
                &mut progress,
            )?;
            note_short(&spread.deviations);
            let one = |s: &Spread| drawn_interval(s, args.confidence);
            let of_joint =
                |joint: &Vec<Option<Spread>>| joint.iter().map(|s| one(s.as_ref()?)).collect();
            Intervals {
                base: spread.base.iter().map(one).collect(),
                physical: spread.physical.iter().map(|s| one(s.as_ref()?)).collect(),
                friction: spread.joints.iter().map(of_joint).collect(),
                method: format!(
                    "linearised at the optimum; {}",
                    drawn(spread.replicates, &spoken(&spread.deviations))
                ),
            }
        };
        out.push(IdentifiedModel {
            name: "nonlinear, feasible",
            beta: found.beta,
            phi: Some(found.phi),
            friction: found.joints,
            feasibility: text,
            gap: Some(found.gap),
            intervals,
            ..IdentifiedModel::default()
        });
    }
    Ok(out)
}

/// How intervals under constraints were found.
fn drawn(replicates: usize, known: &str) -> String {
    format!("percentiles of {replicates} draws of least squares under the constraints; {known}")
}

/// What draws say of a value.
///
/// There is none where nothing could be drawn.
fn drawn_interval(spread: &Spread, confidence: f64) -> Option<Interval> {
    let (low, high) = spread.interval(confidence);
    low.is_finite().then_some(Interval {
        sigma: spread.sigma,
        sigma_white: f64::NAN,
        low,
        high,
    })
}

/// Units near those of the robot, by its size and its base parameters.
pub(crate) fn scale(
    model: &Interpreted<'_>,
    layout: &Layout,
    combinations: &Combinations,
    beta: &[f64],
) -> Result<Scale, Failure> {
    let length = Closure::new(model)?.length_unit();
    Ok(Scale::near(layout, combinations, beta, length))
}

/// A verdict in words.
fn told(judged: &Verdict) -> String {
    match judged {
        Verdict::Feasible { margin, .. } => {
            format!("feasible: a physical robot has them (smallest eigenvalue {margin:.2e})")
        }
        Verdict::Infeasible { certificate } => {
            let escape = certificate.escape();
            if escape.is_finite() {
                format!("infeasible: proven for robots of less than {escape:.1e} kg and kg m^2")
            } else {
                "infeasible: proven, no physical robot has them".to_owned()
            }
        }
        Verdict::Undecided { .. } => {
            "undecided: too close to the border for double precision".to_owned()
        }
    }
}

/// What the gap to the optimum says.
fn proven(gap: f64) -> String {
    if gap <= OPTIMAL {
        format!("the optimum, proven to {gap:.1e}")
    } else {
        format!("NOT proven to be the optimum, gap {gap:.1e}")
    }
}

/// Fails where the result is no optimum; it is printed and written already.
pub(crate) fn require_optimum(found: &IdentifiedModel) -> Result<(), Failure> {
    match found.gap {
        Some(gap) if gap.is_nan() || gap > OPTIMAL => Err(Failure::Numeric(format!(
            "the physical parameters are not proven to be the optimum: others may fit better by up \
             to {gap:.1e} of the squared residuals"
        ))),
        _ => Ok(()),
    }
}

/// What being physical costs, and how far the result can be from the optimum.
fn cost(found: &Physical, layout: &Layout) -> String {
    let how = match found.outcome {
        Outcome::Unconstrained => "physical, no constraint is active".to_owned(),
        Outcome::Constrained => format!("physical, {}", proven(found.gap)),
    };
    let (margin, rise) = (found.check.margin(), 100.0 * found.rise());
    let mut text = format!("{how} (smallest eigenvalue {margin:.2e}, rms residual +{rise:.3} %)");
    if !found.limited.is_empty() {
        // a String takes everything
        let _ = write!(
            text,
            "; the fit wants {} heavier than any robot of this size: give --bound 'm(...)=..'",
            found.limited.join(", ")
        );
    }
    let heavy = heavy(found, layout);
    if !heavy.is_empty() {
        let _ = write!(
            text,
            "; the masses {} hardly matter to the fit and are no masses of this robot: give \
             --bound 'm(...)=..', or bodies with nominal masses",
            heavy.join(", ")
        );
    }
    text
}

/// A body beyond this part of its generous limit, which is a thousand times what is known of the
/// robot, is told.
const HEAVY: f64 = 0.1;

/// The masses that are far from any that the robot can have, of bodies that the fit does not ask to
/// be so heavy.
fn heavy(found: &Physical, layout: &Layout) -> Vec<String> {
    let bodies = layout.bodies().iter().zip(&found.sizes);
    let heavy = bodies.filter(|(body, size)| {
        let mass = body.columns.last().and_then(|c| found.phi.get(*c));
        !found.limited.contains(&body.label) && mass.is_some_and(|m| *m > HEAVY * size.mass)
    });
    heavy
        .map(|(body, _)| format!("m({})", body.label))
        .collect()
}

/// Linear friction at joints whose law is another: Fc and Fv of each.
fn linear(joints: &[FrictionJoint], values: &[f64]) -> Vec<JointFit> {
    let pairs = joints.iter().zip(values.chunks_exact(2));
    pairs
        .map(|(joint, own)| JointFit {
            name: joint.name.clone(),
            friction: Friction::Linear,
            // the symbols are Fv, Fc
            values: own.iter().rev().copied().collect(),
        })
        .collect()
}

/// Least-squares parameters apart: base parameters, and linear friction at these joints.
pub(crate) fn linear_part(
    model: &Interpreted<'_>,
    joints: &[FrictionJoint],
    values: &[f64],
) -> (Vec<f64>, Vec<JointFit>) {
    let r = model.base_info().base.len().min(values.len());
    let (beta, more) = values.split_at(r);
    (beta.to_vec(), linear(joints, more))
}

/// What is known besides the data.
fn options(
    model: &Interpreted<'_>,
    args: &PhysicalArgs,
    layout: &Layout,
) -> Result<Options, Failure> {
    let info = model.info();
    let mut reference = info.nominal.to_vec();
    reference.resize(layout.len(), None);
    let names = |text: &str| -> Vec<String> {
        let parts = text.split(',').map(str::trim);
        parts.map(str::to_owned).collect()
    };
    let mut options = Options {
        identical: args.identical.iter().map(|text| names(text)).collect(),
        known: args.known.clone(),
        bounds: args
            .bound
            .iter()
            .map(|(label, lowest, highest)| Bound {
                parameter: label.clone(),
                lowest: *lowest,
                highest: *highest,
            })
            .collect(),
        totals: args
            .total
            .iter()
            .map(|(labels, value)| Total {
                parameters: names(labels),
                value: *value,
            })
            .collect(),
        reference,
        ..Options::default()
    };
    match args.prior {
        None => {}
        Some(PriorArg::Entropic(weight)) => {
            let complete = |body: &regen_runtime::feasibility::Body| {
                let values = body.columns.map(|c| options.reference.get(c).copied());
                values.iter().all(|v| v.flatten().is_some())
            };
            if !layout.bodies().iter().any(complete) {
                return Err(no_nominal(info.name));
            }
            options.entropic = weight;
        }
        Some(PriorArg::Weighted(part)) => {
            options.priors = beliefs(layout, &options.reference, part);
            if options.priors.is_empty() {
                return Err(no_nominal(info.name));
            }
        }
    }
    Ok(options)
}

fn no_nominal(name: &str) -> Failure {
    Failure::Input(format!(
        "{name} has no nominal values to believe in: give `bodies:` and `nominal:` in the spec"
    ))
}

/// Nominal values with deviations: a part of the value, or of what is usual for the body where
/// the value is small.
fn beliefs(layout: &Layout, nominal: &[Option<f64>], part: f64) -> Vec<Prior> {
    let of = |k: usize| nominal.get(k).copied().flatten();
    let mut out = Vec::new();
    let mut push = |k: usize, size: f64| {
        if let (Some(value), Some(label), true) = (of(k), layout.labels().get(k), size > 0.0) {
            out.push(Prior {
                parameter: label.clone(),
                value,
                deviation: part * size,
            });
        }
    };
    for body in layout.bodies() {
        let at = |symbol: &str| {
            let place = SYMBOLS.iter().position(|s| *s == symbol);
            place.and_then(|k| of(body.columns[k])).unwrap_or(0.0)
        };
        let mass = at("m");
        let moment = at("Ixx").max(at("Iyy")).max(at("Izz"));
        for (column, symbol) in body.columns.iter().zip(SYMBOLS) {
            let usual = match symbol {
                "m" => mass,
                "mx" | "my" | "mz" => (mass * moment).sqrt(),
                _ => moment,
            };
            push(*column, usual);
        }
    }
    for k in layout.single() {
        push(*k, of(*k).unwrap_or(0.0).abs());
    }
    out
}

/// Notes that friction of the spec is left out of a linear model.
pub(crate) fn note_friction(model: &Interpreted<'_>) {
    let joints = regen_runtime::friction::nonlinear_joints(model);
    if !joints.is_empty() {
        let names: Vec<&str> = joints.iter().map(|j| j.name.as_str()).collect();
        terminal::note(&format!(
            "note: the nonlinear friction of {} is left out; --friction identifies it",
            names.join(", ")
        ));
    }
}

impl From<FeasibilityError> for Failure {
    fn from(error: FeasibilityError) -> Self {
        match error {
            FeasibilityError::Estimate(error) => error.into(),
            FeasibilityError::Solver(_) => Self::Numeric(error.to_string()),
            other => Self::Input(other.to_string()),
        }
    }
}
