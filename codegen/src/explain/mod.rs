//! An explanation of a mechanism in words: its mobility, its loops, how its bodies move, which
//! relations hold among its coordinates on this branch, and which parameters cannot be identified,
//! with the reason.
//!
//! A statement that follows from the joints along a limb or from linear relations among the rates
//! is marked as exact. The others are inferred from closed states, computed in multiple precision,
//! and state the number of states and the number of digits to which they hold.

mod limits;
pub mod lines;
mod loops;
mod motion;
mod plausible;
mod relations;
pub mod table;
mod unidentifiable;

use core::fmt::{self, Write as _};

pub use crate::base::Freedom;
use crate::base::certificate::closed_states;
use crate::base::{Analysis, LinearForm, LinkPath, Provenance, link_paths, velocity_constraints};
use crate::diag::{Source, Span, counted, rounded};
use crate::model::Model;
use crate::spec::Spec;
pub use plausible::frame_units;

use motion::{Motions, ObservedMotion};
use unidentifiable::Bodies;

/// Number of closed states that are sampled.
const SAMPLED_STATES: usize = 12;
/// Seed of the sampled states, other than the certificate's.
const SAMPLING_SEED: u64 = 7;
/// Largest error of a linear relation among the rates at the sampled states, relative to the
/// largest rate: the states are computed with 96 digits.
const RELATION_TOLERANCE: f64 = 1e-60;

/// The evidence for a statement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Evidence {
    /// The statement is read off the description or computed at home.
    Given,
    /// The statement follows from the order of joints, from couplings or from the rotations around
    /// a planar loop, and holds for every motion.
    Exact,
    /// The statement holds at closed states on the branch of home.
    Sampled {
        /// Number of states.
        states: usize,
        /// Number of decimal digits to which it holds.
        digits: usize,
    },
}

impl Evidence {
    /// Evidence from a number of sampled states; `largest_error` is the largest relative error that
    /// was taken for zero, from which the number of digits follows.
    fn sampled(states: usize, largest_error: f64) -> Evidence {
        let max_digits = crate::base::certificate::DIGITS;
        let is_attained = |digits: &usize| largest_error <= libm::pow(10.0, -(*digits as f64));
        let digits = (0..=max_digits).rev().find(is_attained).unwrap_or(0);
        Evidence::Sampled { states, digits }
    }
}

impl fmt::Display for Evidence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Evidence::Given => Ok(()),
            Evidence::Exact => f.write_str("shown exactly"),
            Evidence::Sampled { states, digits } => {
                write!(f, "holds at {states} sampled states to {digits} digits")
            }
        }
    }
}

/// A statement and its evidence.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fact {
    /// The statement in words.
    pub text: String,
    /// Its evidence.
    pub evidence: Evidence,
    /// The place in the spec that it is about, if there is one.
    pub place: Option<Span>,
}

impl Fact {
    fn new(text: String, evidence: Evidence) -> Fact {
        Fact {
            text,
            evidence,
            place: None,
        }
    }

    fn given(text: String) -> Fact {
        Fact::new(text, Evidence::Given)
    }

    /// A fact about a place in the spec.
    fn at(place: Option<Span>, text: String) -> Fact {
        Fact {
            place,
            ..Fact::given(text)
        }
    }
}

/// The predicate of a sentence whose subject is a body with this class of motion, such as `moves in
/// a plane`.
pub fn predicate(freedom: Freedom) -> &'static str {
    match freedom {
        Freedom::Fixed => "never moves",
        Freedom::LinearTranslation => "never rotates: it slides along a line",
        Freedom::PlanarTranslation => "never rotates: it translates in a plane",
        Freedom::SpatialTranslation => "never rotates: it translates only",
        Freedom::FixedAxisRotation => "turns about an axis at rest",
        Freedom::Screw => "turns about an axis at rest and moves along it in proportion",
        Freedom::PlanarMotion => "moves in a plane",
        Freedom::Schoenflies => "turns about a fixed direction only, and moves along it too",
        Freedom::Spherical => "turns about a point at rest",
        Freedom::General => "moves in general ways",
    }
}

/// The kind of motion of a body.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyMotion {
    /// The label of the body.
    pub body: String,
    /// The kind of its motion.
    pub freedom: Freedom,
    /// The direction of its rotation axis in the world frame, a unit vector, if this direction is
    /// fixed.
    pub direction: Option<[f64; 3]>,
    /// The evidence for the kind of motion.
    pub evidence: Evidence,
}

impl fmt::Display for BodyMotion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "body {} {}", self.body, predicate(self.freedom))?;
        match self.direction {
            Some(n) => write!(f, ", about {}", direction_text(&n)),
            None => Ok(()),
        }
    }
}

fn direction_text(n: &[f64; 3]) -> String {
    if let Some(k) = (0..3).find(|&k| n[k].abs() > 1.0 - 1e-12) {
        return format!("the world's {}", ["x", "y", "z"][k]);
    }
    // avoid -0.000
    let [x, y, z] = n.map(|x| if x.abs() < 5e-4 { 0.0 } else { x });
    format!("({x:.3}, {y:.3}, {z:.3})")
}

/// Parameters that have no effect on the forces, for one common reason.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unidentifiable {
    /// The labels of the parameters.
    pub parameters: Vec<String>,
    /// The reason, if one is known.
    pub reason: Option<String>,
    /// How this was found.
    pub provenance: Provenance,
    /// The index of the parameters' body; `None` for parameters of joints.
    body: Option<usize>,
}

/// A parameter that can be identified only in combination with others.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Grouped {
    /// The label of the parameter.
    pub parameter: String,
    /// The other parameters of the combination.
    pub with: Vec<String>,
    /// The reason, if one is known.
    pub reason: Option<String>,
    /// How this was found.
    pub provenance: Provenance,
}

/// The explanation of a mechanism in words.
#[derive(Clone, Debug, PartialEq)]
pub struct Explanation {
    /// The robot's name.
    pub robot: String,
    /// The mobility: number of degrees of freedom.
    pub mobility: usize,
    /// Statements about the numbers of coordinates and closure equations, mobility and drives.
    pub coordinate_facts: Vec<Fact>,
    /// Statements about the loops.
    pub loops: Vec<Fact>,
    /// How the bodies move; empty if no closed state could be sampled.
    pub bodies: Vec<BodyMotion>,
    /// Statements about relations among coordinates and among orientations on this branch.
    pub relations: Vec<Fact>,
    /// Parameters that cannot be identified at all.
    pub unidentifiable: Vec<Unidentifiable>,
    /// Parameters that can be identified only in combination with others.
    pub grouped: Vec<Grouped>,
    /// Statements about the base parameters that hold only at the given values of the geometry.
    pub geometry_facts: Vec<Fact>,
    /// Warnings about limits, singularities, inertias and sampling.
    pub warnings: Vec<Fact>,
}

impl Explanation {
    /// Puts the line of its place in front of each warning that has one.
    pub(crate) fn name_lines(&mut self, source: &Source) {
        for warning in &mut self.warnings {
            if let Some(place) = warning.place {
                let line = source.position(place).line;
                warning.text = format!("line {line}: {}", warning.text);
            }
        }
    }

    /// The parameters without effect (`with` is empty) or identifiable only in combination with
    /// others, each with its reason, as far as this follows from null directions completed from
    /// samples. Parameters whose directions are derived exactly are left out: the derivation is
    /// their reason.
    pub fn grouped_from_samples(self) -> Vec<Grouped> {
        let unidentifiable = self.unidentifiable.into_iter();
        let without_effect = unidentifiable
            .filter(|group| group.provenance != Provenance::Derived)
            .flat_map(|group| {
                let (reason, provenance) = (group.reason, group.provenance);
                group.parameters.into_iter().map(move |parameter| Grouped {
                    parameter,
                    with: Vec::new(),
                    reason: reason.clone(),
                    provenance,
                })
            });
        let in_combination = self
            .grouped
            .into_iter()
            .filter(|parameter| parameter.provenance != Provenance::Derived);
        without_effect.chain(in_combination).collect()
    }
}

/// Explains a mechanism.
///
/// - `home`: one value per coordinate, rad or m, which satisfies the closure equations;
/// - `redundant`: the indices of the redundant rows of the closure equations;
/// - `analysis`: the base parameters of the same model.
pub fn explain(
    spec: &Spec,
    model: &Model,
    home: &[f64],
    redundant: &[usize],
    analysis: &Analysis,
) -> Explanation {
    let link_paths = link_paths(model);
    let velocity_constraints = velocity_constraints(spec, model);
    let states = closed_states(model, home, SAMPLING_SEED, SAMPLED_STATES);
    let mut warnings = limits::facts(spec, model, home);
    warnings.extend(limits::inertias(spec));
    warnings.extend(plausible::facts(spec, model, home));
    warnings.extend(plausible::frame_units(spec));
    warnings.extend(plausible::near_right_angles(spec));
    if let Err(why) = &states {
        warnings.push(Fact::given(format!("nothing could be sampled: {why}")));
    }
    let states = states.unwrap_or_default();
    let motions = Motions::new(&states);
    let sampled = (!states.is_empty()).then_some(&motions);
    let mut explanation = Explanation {
        robot: spec.name.value.clone(),
        mobility: model.independent.len(),
        coordinate_facts: coordinate_facts(model, home, redundant),
        loops: loops::facts(
            model,
            redundant,
            &link_paths,
            &velocity_constraints,
            sampled,
            states.len(),
        ),
        bodies: Vec::new(),
        relations: Vec::new(),
        unidentifiable: Vec::new(),
        grouped: Vec::new(),
        geometry_facts: geometry_facts(analysis),
        warnings,
    };
    let Some(motions) = sampled else {
        return explanation;
    };
    let observed: Vec<ObservedMotion> = model.bodies.iter().map(|b| motions.of(b.link)).collect();
    explanation.bodies = model
        .bodies
        .iter()
        .zip(&observed)
        .map(|(body, observed)| {
            let bound = link_paths[body.link].freedom(&velocity_constraints);
            // The class of the sampled motions is a lower bound, the class that the joints allow an
            // upper bound: the result is exact where both agree.
            let exact = bound == observed.freedom
                || bound.has_constant_orientation() && observed.freedom.has_constant_orientation();
            BodyMotion {
                body: body.label.clone(),
                freedom: observed.freedom,
                direction: observed.direction,
                evidence: if exact || observed.freedom == Freedom::General {
                    Evidence::Exact
                } else {
                    Evidence::sampled(states.len(), observed.largest_error)
                },
            }
        })
        .collect();
    let relations = relations::linear_relations(model, &states);
    let facts = relations
        .iter()
        .map(|r| r.fact(model, &states, &velocity_constraints));
    explanation.relations = facts.collect();
    explanation.relations.extend(orientations(
        model,
        motions,
        &link_paths,
        &velocity_constraints,
        &observed,
        states.len(),
    ));
    let bodies = Bodies {
        model,
        motions,
        observed: &observed,
        gravity: [0, 1, 2].map(|k: usize| model.gravity[k].value.to_f64()),
    };
    explanation.unidentifiable = bodies.without_effect(&analysis.base);
    explanation.grouped = bodies.grouped(&analysis.base);
    explanation
}

/// Statements about the number of coordinates, the mobility and the drives.
fn coordinate_facts(model: &Model, home: &[f64], redundant: &[usize]) -> Vec<Fact> {
    let names = |of: &[usize]| -> String {
        let names = of.iter().map(|c| model.coordinates[*c].name.as_str());
        names.collect::<Vec<_>>().join(" ")
    };
    let n = model.coordinates.len();
    let rows = model.cuts.iter().map(|c| c.kind.equations()).sum::<usize>() + model.couplings.len();
    let mobility = model.independent.len();
    let mut facts = vec![Fact::given(if rows == 0 {
        format!(
            "{} and no loop: mobility {mobility}",
            counted(n, "coordinate", "coordinates")
        )
    } else {
        let independent_rows = rows - redundant.len();
        let redundancy_note = match redundant.len() {
            0 => String::new(),
            1 => ", one of them redundant".to_owned(),
            k => format!(", {k} of them redundant"),
        };
        format!(
            "{} and {}{redundancy_note}: mobility {n} - {independent_rows} = {mobility}",
            counted(n, "coordinate", "coordinates"),
            counted(rows, "closure row", "closure rows")
        )
    })];
    facts.push(Fact::given(format!(
        "independent are {}; that many, and the others follow from them at home",
        names(&model.independent)
    )));
    if !model.dependent.is_empty() {
        let closed = model.coordinates.iter().zip(home).enumerate();
        let closed =
            closed.filter(|(c, _)| model.dependent.contains(c) && !model.drives.contains(c));
        let closed = closed.map(|(_, (c, q))| format!("{} {}", c.name, rounded(*q)));
        facts.push(Fact::given(format!(
            "home closes at {}",
            closed.collect::<Vec<_>>().join(", ")
        )));
    }
    for &drive in &model.drives {
        facts.extend(drive_fact(model, drive));
    }
    for &payload in &model.payloads {
        let label = &model.bodies[payload].label;
        let text = format!("body {label} is a payload, carried in some runs only");
        facts.push(Fact::given(text));
    }
    let difference = |a: &[usize], b: &[usize]| -> Vec<usize> {
        a.iter().copied().filter(|c| !b.contains(c)).collect()
    };
    let dependent_drives = difference(&model.actuated, &model.independent);
    let passive = difference(&model.independent, &model.actuated);
    if dependent_drives.is_empty() && passive.is_empty() {
        facts.push(Fact::given("actuated are the same".to_owned()));
        return facts;
    }
    facts.push(Fact::given(format!(
        "actuated are {}",
        if model.actuated.is_empty() {
            "none".to_owned()
        } else {
            names(&model.actuated)
        }
    )));
    if model.actuated.len() > mobility {
        facts.push(Fact::given(format!(
            "there are {} drives for mobility {mobility}: they can work against each other, and only \
             their sum on the independent coordinates is told by the motion",
            model.actuated.len()
        )));
    }
    if !passive.is_empty() && model.actuated.len() < mobility {
        facts.push(Fact::given(format!(
            "{} than mobility {mobility}: {} cannot be held",
            counted(
                mobility - model.actuated.len(),
                "fewer drive",
                "fewer drives"
            ),
            if mobility == 1 { "it" } else { "some motion" }
        )));
    }
    facts
}

/// The form of a drive's coordinate: `drive m6 is 32 q5 + 32 q6`.
fn drive_fact(model: &Model, drive: usize) -> Option<Fact> {
    let form = model.form_of_drive(drive)?;
    let mut text = format!("drive {} is", model.coordinates[drive].name);
    for (k, (coordinate, factor)) in form.terms.iter().enumerate() {
        let sign = match (factor.is_negative(), k) {
            (true, 0) => " -",
            (false, 0) => " ",
            (true, _) => " - ",
            (false, _) => " + ",
        };
        let name = &model.coordinates[*coordinate].name;
        text.push_str(sign);
        if !factor.abs().is_one() {
            let _ = write!(text, "{} ", factor.abs().to_f64());
        }
        text.push_str(name);
    }
    let constant = form.constant.to_f64();
    if !form.constant.is_zero() {
        let sign = if constant < 0.0 { '-' } else { '+' };
        let _ = write!(text, " {sign} {}", constant.abs());
    }
    Some(Fact::given(text))
}

/// Statements that hold only at the given values of the geometry.
fn geometry_facts(analysis: &Analysis) -> Vec<Fact> {
    let base = &analysis.base;
    let coincidences = base.coincidences.iter();
    let coincidences = coincidences.map(|equality| {
        format!("the base parameters rest on {equality}, which holds by value only")
    });
    let unvaried_names = base.unvaried_names.iter();
    let unvaried_names = unvaried_names.map(|h| format!("completed factors hold for {h}"));
    let unrecognised = base.unrecognised.iter();
    let unrecognised = unrecognised.map(|n| format!("a number only: {n}"));
    coincidences
        .chain(unvaried_names)
        .chain(unrecognised)
        .map(Fact::given)
        .collect()
}

/// Statements about bodies whose orientations always agree.
fn orientations(
    model: &Model,
    motions: &Motions<'_>,
    link_paths: &[LinkPath],
    velocity_constraints: &[LinearForm],
    observed: &[ObservedMotion],
    states: usize,
) -> Vec<Fact> {
    let mut classes: Vec<Vec<usize>> = Vec::new();
    for (body, observed) in observed.iter().enumerate() {
        if observed.freedom.has_constant_orientation() {
            continue;
        }
        let link = |b: usize| Some(model.bodies[b].link);
        let class = classes
            .iter_mut()
            .find(|class| motions.same_orientation(link(class[0]), link(body)).0);
        match class {
            Some(class) => class.push(body),
            None => classes.push(vec![body]),
        }
    }
    let several = classes.iter().filter(|class| class.len() > 1);
    several
        .map(|class| {
            let link = |b: usize| model.bodies[b].link;
            let first = link(class[0]);
            let exact = class.iter().all(|b| {
                link_paths[first].has_same_orientation(&link_paths[link(*b)], velocity_constraints)
            });
            let errors = class
                .iter()
                .map(|b| motions.same_orientation(Some(first), Some(link(*b))).1);
            let same_motion = class.iter().all(|b| motions.same_move(first, link(*b)));
            let names: Vec<&str> = class
                .iter()
                .map(|b| model.bodies[*b].label.as_str())
                .collect();
            let names = names.join(" ");
            let text = if same_motion {
                format!("bodies {names} always move alike, shifted by a constant")
            } else {
                format!("bodies {names} always have the same orientation but for a constant turn")
            };
            let evidence = if exact && !same_motion {
                Evidence::Exact
            } else {
                Evidence::sampled(states, errors.fold(0.0, f64::max))
            };
            Fact::new(text, evidence)
        })
        .collect()
}
