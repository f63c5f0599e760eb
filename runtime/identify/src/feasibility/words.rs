//! Says what a physical fit found: verdicts, gaps, and the masses that the data leave open.

use std::fmt::Write as _;

use super::{Body, Bound, MAX_OPTIMAL_GAP, Outcome, ParameterLayout, PhysicalFit, Verdict};
use crate::text::figure_of;

/// Describes how intervals under constraints were computed; `known` describes how the standard
/// deviations of least squares were.
pub(crate) fn describe_draws(replicates: usize, known: &str) -> String {
    format!("percentiles of {replicates} draws of least squares under the constraints; {known}")
}

/// Describes a verdict in words.
pub(crate) fn describe_verdict(judged: &Verdict) -> String {
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
            "undecided: too close to the border of feasibility for double precision".to_owned()
        }
    }
}

/// Describes in words whether the gap to the optimum proves optimality.
pub(crate) fn describe_gap(gap: f64) -> String {
    if gap <= MAX_OPTIMAL_GAP {
        format!("the optimum, proven to {gap:.1e}")
    } else {
        format!("NOT proven to be the optimum, gap {gap:.1e}")
    }
}

/// Describes a physically feasible fit: how much the constraints increase the residual, and how far
/// the result can be from the optimum.
pub(crate) fn describe_fit(found: &PhysicalFit, layout: &ParameterLayout) -> String {
    let how = match found.outcome {
        Outcome::Unconstrained => "physical, no constraint is active".to_owned(),
        Outcome::Constrained => format!("physical, {}", describe_gap(found.gap)),
    };
    let (margin, rise) = (found.check.margin(), 100.0 * found.rise());
    let mut text = format!("{how} (smallest eigenvalue {margin:.2e}, rms residual +{rise:.3} %)");
    // a body of little mass reaches its limit by its moments of inertia
    let is_heavy = |label: &&String| heavy_bodies(found, layout).any(|body| body.label == **label);
    let (heavier, larger): (Vec<&String>, Vec<&String>) = found.limited.iter().partition(is_heavy);
    let list = |labels: &[&String]| {
        labels
            .iter()
            .map(|l| l.as_str())
            .collect::<Vec<_>>()
            .join(", ")
    };
    for (bodies, than, what) in [
        (heavier, "heavier", "masses"),
        (larger, "of larger inertia", "moments of inertia"),
    ] {
        if !bodies.is_empty() {
            // writing to a String cannot fail
            let _ = write!(
                text,
                "; the fit wants {} {than} than any robot of this size: bound their {what}",
                list(&bodies)
            );
        }
    }
    let heavy = heavy(found, layout);
    if !heavy.is_empty() {
        let _ = write!(
            text,
            "; the masses {} hardly affect the fit, and this robot cannot have these values: bound \
             them",
            heavy.join(", ")
        );
    }
    text
}

/// Bodies heavier than this part of the safety limit of their mass are reported. The limit is a
/// thousand times the mass that is known of the robot, so that a reported body is a hundred times as
/// heavy as that: no load or counterweight is.
const MAX_LIMIT_PART: f64 = 0.1;

/// The bodies whose masses are far above any that the robot can have.
fn heavy_bodies<'a>(
    found: &'a PhysicalFit,
    layout: &'a ParameterLayout,
) -> impl Iterator<Item = &'a Body> {
    let bodies = layout.bodies().iter().zip(&found.sizes);
    let heavy = bodies.filter(|(body, size)| {
        let mass = body.columns.last().and_then(|c| found.phi.get(*c));
        mass.is_some_and(|m| *m > MAX_LIMIT_PART * size.mass)
    });
    heavy.map(|(body, _)| body)
}

/// The labels of masses far above any that the robot can have, without bodies that reach their
/// limit.
fn heavy(found: &PhysicalFit, layout: &ParameterLayout) -> Vec<String> {
    let own = heavy_bodies(found, layout).filter(|body| !found.limited.contains(&body.label));
    own.map(|body| format!("m({})", body.label)).collect()
}

/// The labels of masses that neither the data nor a meaningful limit bounds.
pub(crate) fn unbounded(found: &PhysicalFit, layout: &ParameterLayout) -> Vec<String> {
    let is_limited = |body: &&Body| found.limited.contains(&body.label);
    let limited = heavy_bodies(found, layout).filter(is_limited);
    let limited = limited.map(|body| format!("m({})", body.label));
    limited.chain(heavy(found, layout)).collect()
}

/// A mass that the data leave open is held below so many times its nominal value or, without one, the mass that is
/// known of the whole robot.
const MAX_NOMINAL: f64 = 3.0;
/// The limit of a body's mass over the mass that is known of the robot, see
/// [`SizeLimit`](crate::feasibility::SizeLimit).
const LIMIT_RATIO: f64 = 1000.0;
/// Limits of masses may cost this part of the rms residual: less than its last printed digit.
pub(crate) const MAX_COST: f64 = 1e-4;

/// Limits of the masses that hardly affect a fit and are far above any that the robot can have.
///
/// - `nominal`: the nominal values of all parameters, SI.
pub(crate) fn limits_of_free_masses(
    found: &PhysicalFit,
    layout: &ParameterLayout,
    nominal: &[Option<f64>],
) -> Vec<Bound> {
    let free = unbounded(found, layout);
    let bodies = layout.bodies().iter().zip(&found.sizes);
    let limits = bodies.map(|(body, size)| {
        let own = body.columns.last().and_then(|c| *nominal.get(*c)?);
        let own = own.filter(|mass| *mass > 0.0);
        Bound {
            parameter: format!("m({})", body.label),
            lowest: f64::NEG_INFINITY,
            highest: MAX_NOMINAL * own.unwrap_or(size.mass / LIMIT_RATIO),
        }
    });
    limits.filter(|own| free.contains(&own.parameter)).collect()
}

/// Says which masses are held below limits that no one gave.
pub(crate) fn describe_held(limits: &[Bound]) -> String {
    let all = limits
        .iter()
        .map(|own| format!("{} below {} kg", own.parameter, figure_of(3, own.highest)));
    let all: Vec<String> = all.collect();
    if all.is_empty() {
        return String::new();
    }
    format!(
        "; masses that hardly affect the fit are held below what this robot can have: {}",
        all.join(", ")
    )
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::estimate::QrFactor;
    use crate::feasibility::{BaseMap, Options, SYMBOLS, identify};

    /// A mass that the fit leaves open is held below three times its nominal value or, without one, the largest mass
    /// that is known of the robot.
    #[test]
    fn open_masses_are_held_below_what_the_robot_can_have() {
        let labels: Vec<String> = (1..=2)
            .flat_map(|body| SYMBOLS.iter().map(move |s| format!("{s}({body})")))
            .collect();
        let layout = ParameterLayout::new(&labels).unwrap();
        // the moment of mass of body 1 without inertia about z, which takes an infinite mass; body 2 weighs 4 kg
        let map = BaseMap::identity(&labels).select(&[6, 5, 19]).unwrap();
        let mut factor = QrFactor::new(map.labels().to_vec());
        let identity = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
        factor.push_block(&identity, &[0.1, -1.0, 4.0]).unwrap();
        let found = identify(&factor, &map, &layout, &Options::default()).unwrap();
        assert_eq!(unbounded(&found, &layout), ["m(1)"]);
        let mut nominal = vec![None; 20];
        let [own] = &limits_of_free_masses(&found, &layout, &nominal)[..] else {
            panic!("one mass is open")
        };
        let known = found.sizes[0].mass / LIMIT_RATIO;
        assert_eq!((own.parameter.as_str(), own.highest), ("m(1)", 3.0 * known));
        nominal[9] = Some(0.7);
        let bounds = limits_of_free_masses(&found, &layout, &nominal);
        assert!((bounds[0].highest - 2.1).abs() < 1e-12);
        assert!(describe_held(&bounds).contains("m(1) below 2.10 kg"));
        let held = Options {
            bounds,
            ..Options::default()
        };
        let found = identify(&factor, &map, &layout, &held).unwrap();
        assert!(found.phi[9] < 2.1 + 1e-6 && unbounded(&found, &layout).is_empty());
    }

    /// What is asked to be bounded is what grew: the mass for a moment of mass without inertia, the
    /// inertia for one without mass, and nothing for a fit that needs no limit.
    #[test]
    fn the_advice_names_what_has_no_bound() {
        let labels: Vec<String> = SYMBOLS.iter().map(|s| format!("{s}(1)")).collect();
        let layout = ParameterLayout::new(&labels).unwrap();
        let said = |observed: [usize; 2], values: [f64; 2]| {
            let map = BaseMap::identity(&labels).select(&observed).unwrap();
            let mut factor = QrFactor::new(map.labels().to_vec());
            factor.push_block(&[1.0, 0.0, 0.0, 1.0], &values).unwrap();
            let found = identify(&factor, &map, &layout, &Options::default()).unwrap();
            (describe_fit(&found, &layout), unbounded(&found, &layout))
        };
        let (mx, izz, m) = (6, 5, 9);
        let (text, masses) = said([mx, izz], [0.1, -1.0]);
        assert!(text.contains("1 heavier than any"), "{text}");
        assert_eq!(masses, ["m(1)"]);
        let (text, masses) = said([mx, m], [0.1, -1.0]);
        assert!(text.contains("1 of larger inertia than any"), "{text}");
        assert!(!text.contains("masses") && masses.is_empty(), "{text}");
        let (text, masses) = said([izz, m], [-0.1, 1.0]);
        assert!(!text.contains("bound") && masses.is_empty(), "{text}");
    }
}
