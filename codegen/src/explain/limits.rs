//! Warnings about limits, singularities and nominal inertias.

use crate::constraints::{NumericLoops, world_equations, world_views};
use crate::diag::rounded;
use crate::kinematics::{Frames, Geometry};
use crate::model::Model;
use crate::numeric::solve_pivoted;
use crate::spec::{Flaw, JointKind, Quantity, Spec, flaw};
use crate::sym::eval::Evaluator;
use crate::sym::{Ex, Graph};

use super::Fact;
use super::plausible::{home_place, joint_place};

/// A joint position or swing angle is reported as near its limit within this fraction of its range.
const NEAR_LIMIT_FRACTION: f64 = 0.05;
/// Home is reported as near a singularity below this ratio of the smallest pivot to the largest.
const NEAR_SINGULAR_PIVOT_RATIO: f64 = 1e-3;
/// Relative tolerance of the triangle inequality of principal moments. Thin rods and plates satisfy
/// it with equality, and their inertias are printed with few digits.
const INERTIA_TOLERANCE: f64 = 1e-3;

/// Warnings about limits of position, swing limits and singularities at home.
pub(super) fn facts(spec: &Spec, model: &Model, home: &[f64]) -> Vec<Fact> {
    let mut facts = Vec::new();
    for (coordinate, &q) in model.coordinates.iter().zip(home) {
        let Some([low, high]) = coordinate.position else {
            continue;
        };
        let name = &coordinate.name;
        let range = high - low;
        let left = (q - low).min(high - q);
        if left < 0.0 {
            facts.push(Fact::at(
                home_place(spec, name).or_else(|| joint_place(spec, name)),
                format!(
                    "home of {name}, {}, is outside its limits [{}, {}]: correct one of the two; until \
                     then, states beyond the limits are sampled too",
                    rounded(q),
                    rounded(low),
                    rounded(high)
                ),
            ));
        } else if left < NEAR_LIMIT_FRACTION * range {
            facts.push(Fact::given(format!(
                "home of {name}, {}, is near the end of its limits [{}, {}]: motions start with {:.1} % \
                 of its range on that side",
                rounded(q),
                rounded(low),
                rounded(high),
                100.0 * left / range
            )));
        }
    }
    let mut g = Graph::new();
    for coordinate in &model.coordinates {
        g.symbol(&coordinate.name);
    }
    g.set_naming(false);
    let frames = Frames::new(&mut g, model, Geometry::Values);
    facts.extend(joint_cones(spec, model, home));
    for (cut, written) in model.cuts.iter().zip(&spec.cuts) {
        let Some(cone) = &written.limits.cone else {
            continue;
        };
        let [a, b] = world_views(&mut g, &frames, model, cut, None);
        let cosine: Ex = g.dot3(&a.axes[2], &b.axes[2]);
        let value = Evaluator::new(&g, vec![cosine]).run(home);
        let cosine = value.first().copied().unwrap_or(1.0);
        facts.extend(cone_fact(&format!("cut '{}'", cut.name), cosine, cone));
    }
    let equations = world_equations(&mut g, &frames, model, None);
    if !model.dependent.is_empty() {
        let loops = NumericLoops::new(&g, &equations, model);
        let (_, a) = loops.normal(home);
        let dependent: Vec<Vec<f64>> = a
            .iter()
            .map(|row| model.dependent.iter().map(|&c| row[c]).collect())
            .collect();
        let sides = vec![Vec::new(); dependent.len()];
        let ratio = solve_pivoted(dependent, sides).pivot_ratio;
        if ratio < NEAR_SINGULAR_PIVOT_RATIO {
            facts.push(Fact::given(format!(
                "home is close to a singularity of this choice of independent coordinates (pivot \
                 ratio {ratio:.1e}): dependent rates are large there, and numbers lose digits"
            )));
        }
    }
    facts
}

/// Warnings about nominal inertias that no rigid body has.
pub(super) fn inertias(spec: &Spec) -> Vec<Fact> {
    let broken = spec.bodies.iter().filter_map(|(label, body)| {
        let tensor = body.inertia.each_ref().map(|entry| entry.value.to_f64());
        Some((label, flaw(tensor, INERTIA_TOLERANCE)?))
    });
    let facts = broken.map(|(label, flaw)| {
        let why = match flaw {
            Flaw::Triangle => "two principal moments are less than the third together",
            Flaw::Indefinite => "it is not positive semidefinite",
        };
        let text = format!(
            "no body has the nominal inertia of '{}': {why}; the order is Ixx, Ixy, Ixz, Iyy, Iyz, \
             Izz, about the centre of mass",
            label.value
        );
        Fact::at(Some(label.span), text)
    });
    facts.collect()
}

/// Warnings about swing limits of the tree's joints; the swing angle follows from two of their
/// coordinates.
fn joint_cones(spec: &Spec, model: &Model, home: &[f64]) -> Vec<Fact> {
    let joints = spec.limbs.iter().flat_map(|limb| &limb.joints);
    let value = |name: &str, k: usize| {
        let name = format!("{name}.{k}");
        let at = model.coordinates.iter().position(|c| c.name == name);
        at.and_then(|c| home.get(c)).copied().unwrap_or(0.0)
    };
    let fact = |joint: &crate::spec::Joint| {
        let (name, cone) = (joint.name.as_ref()?, joint.limits.cone.as_ref()?);
        let angles = match joint.kind.value {
            JointKind::Universal => (1, 2),
            _ => (2, 3),
        };
        let cosine =
            libm::cos(value(&name.value, angles.0)) * libm::cos(value(&name.value, angles.1));
        cone_fact(&format!("joint '{}'", name.value), cosine, cone)
    };
    joints.filter_map(fact).collect()
}

fn cone_fact(what: &str, cosine: f64, cone: &Quantity) -> Option<Fact> {
    let angle = libm::acos(cosine.clamp(-1.0, 1.0));
    let most = cone.value.to_f64();
    if angle > most {
        return Some(Fact::given(format!(
            "{what} is tilted by {angle:.4} rad at home, beyond its cone of {most:.4}"
        )));
    }
    (most - angle < NEAR_LIMIT_FRACTION * most).then(|| {
        Fact::given(format!(
            "{what} is tilted by {angle:.4} rad at home, near its cone of {most:.4}"
        ))
    })
}
