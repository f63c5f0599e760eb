//! A mechanism in words: its mobility, its loops, how its bodies move, what its
//! coordinates have to do with each other on this branch, and which parameters
//! cannot be identified, with the reason.
//!
//! What joints in a limb and ties of rates prove is marked as exact. The rest is
//! told from closed states in multiple precision, and says at how many and to how
//! many digits it holds.

mod limits;
pub mod lines;
mod loops;
mod motion;
mod relations;
pub mod table;
mod unseen;

use core::fmt;

pub use crate::base::Freedom;
use crate::base::certificate::observe;
use crate::base::{Analysis, Form, LinkPath, velocity_constraints, ways};
use crate::model::Model;
use crate::spec::Spec;

use motion::{Motions, ObservedMotion};
use unseen::Bodies;

/// How many closed states are observed.
const STATES: usize = 12;
/// Where they come from: others than the certificate's.
const SEED: u64 = 7;
/// A number below this part of the largest counts as nothing.
const ROUNDING: f64 = 1e-60;

/// On what a statement rests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Evidence {
    /// It is read off the description or computed at home.
    Given,
    /// It follows from the order of joints, from couplings or from the turns around
    /// a planar loop, and holds whatever the motion.
    Exact,
    /// It holds at closed states on the branch of home.
    Sampled {
        /// How many.
        states: usize,
        /// To how many decimal digits.
        digits: usize,
    },
}

impl Evidence {
    /// Sampled, where the largest number that counted as nothing was `off`.
    fn sampled(states: usize, off: f64) -> Evidence {
        let all = crate::base::certificate::DIGITS;
        let holds = |digits: &usize| off <= libm::pow(10.0, -(*digits as f64));
        let digits = (0..=all).rev().find(holds).unwrap_or(0);
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

/// A statement and what it rests on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fact {
    /// In words.
    pub text: String,
    /// What it rests on.
    pub evidence: Evidence,
}

impl Fact {
    fn new(text: String, evidence: Evidence) -> Fact {
        Fact { text, evidence }
    }

    fn given(text: String) -> Fact {
        Fact::new(text, Evidence::Given)
    }
}

/// What a body does, after its name.
pub fn words(freedom: Freedom) -> &'static str {
    match freedom {
        Freedom::Still => "never moves",
        Freedom::Line => "never rotates: it slides along a line",
        Freedom::Plane => "never rotates: it translates in a plane",
        Freedom::Translates => "never rotates: it translates only",
        Freedom::Spin => "turns about an axis at rest",
        Freedom::Screw => "turns about an axis at rest and moves along it in proportion",
        Freedom::Planar => "moves in a plane",
        Freedom::Direction => "turns about a fixed direction only, and moves along it too",
        Freedom::Point => "turns about a point at rest",
        Freedom::General => "moves in general ways",
    }
}

/// How a body moves.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyMotion {
    /// Its label.
    pub body: String,
    /// How it moves.
    pub freedom: Freedom,
    /// The direction about which it turns, in the world's axes, where there is
    /// one only.
    pub direction: Option<[f64; 3]>,
    /// What that rests on.
    pub evidence: Evidence,
}

impl fmt::Display for BodyMotion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "body {} {}", self.body, words(self.freedom))?;
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
    // not -0.000
    let [x, y, z] = n.map(|x| if x.abs() < 5e-4 { 0.0 } else { x });
    format!("({x:.3}, {y:.3}, {z:.3})")
}

/// Parameters without any effect on the forces.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unidentifiable {
    /// Their labels.
    pub parameters: Vec<String>,
    /// Why, where a reason can be named.
    pub reason: Option<String>,
    /// Whether it was derived exactly, and not completed from samples.
    pub derived: bool,
    body: Option<usize>,
}

/// A parameter that acts only together with others.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Grouped {
    /// Its label.
    pub parameter: String,
    /// The parameters with which it acts.
    pub with: Vec<String>,
    /// Why, where a reason can be named.
    pub reason: Option<String>,
    /// Whether it was derived exactly, and not completed from samples.
    pub derived: bool,
}

/// A mechanism in words.
#[derive(Clone, Debug, PartialEq)]
pub struct Explanation {
    /// The robot's name.
    pub robot: String,
    /// Degrees of freedom.
    pub mobility: usize,
    /// Coordinates, mobility, and which are independent and actuated.
    pub coordinates: Vec<Fact>,
    /// The loops.
    pub loops: Vec<Fact>,
    /// How the bodies move; empty where nothing could be sampled.
    pub bodies: Vec<BodyMotion>,
    /// Relations among coordinates and among orientations on this branch.
    pub relations: Vec<Fact>,
    /// Parameters that cannot be identified at all.
    pub unseen: Vec<Unidentifiable>,
    /// Parameters that can be identified only together with others.
    pub merged: Vec<Grouped>,
    /// What holds at the given values of the geometry only.
    pub values: Vec<Fact>,
    /// Trouble with limits and singularities.
    pub trouble: Vec<Fact>,
}

impl Explanation {
    /// Why parameters act together or not at all, where the direction was completed from samples:
    /// what the order of joints proves needs no other reason.
    pub fn completed(self) -> Vec<Grouped> {
        let unseen = self.unseen.into_iter();
        let alone = unseen.filter(|u| !u.derived).flat_map(|u| {
            let reason = u.reason;
            u.parameters.into_iter().map(move |parameter| Grouped {
                parameter,
                with: Vec::new(),
                reason: reason.clone(),
                derived: false,
            })
        });
        let together = self.merged.into_iter().filter(|m| !m.derived);
        alone.chain(together).collect()
    }
}

/// Explains a mechanism that closes at `home`; `redundant` are the closure's rows
/// that are left out.
pub fn explain(
    spec: &Spec,
    model: &Model,
    home: &[f64],
    redundant: &[usize],
    analysis: &Analysis,
) -> Explanation {
    let ways = ways(model);
    let velocity_constraints = velocity_constraints(spec, model);
    let states = observe(model, home, SEED, STATES);
    let mut trouble = limits::facts(spec, model, home);
    trouble.extend(limits::inertias(spec));
    if let Err(why) = &states {
        trouble.push(Fact::given(format!("nothing could be sampled: {why}")));
    }
    let states = states.unwrap_or_default();
    let motions = Motions::new(&states);
    let sampled = (!states.is_empty()).then_some(&motions);
    let mut explanation = Explanation {
        robot: spec.name.value.clone(),
        mobility: model.independent.len(),
        coordinates: coordinates(model, redundant),
        loops: loops::facts(
            model,
            redundant,
            &ways,
            &velocity_constraints,
            sampled,
            states.len(),
        ),
        bodies: Vec::new(),
        relations: Vec::new(),
        unseen: Vec::new(),
        merged: Vec::new(),
        values: values(analysis),
        trouble,
    };
    let Some(motions) = sampled else {
        return explanation;
    };
    let seen: Vec<ObservedMotion> = model.bodies.iter().map(|b| motions.of(b.link)).collect();
    explanation.bodies = model
        .bodies
        .iter()
        .zip(&seen)
        .map(|(body, seen)| {
            let bound = ways[body.link].freedom(&velocity_constraints);
            // samples bound a motion from below, joints from above
            let exact = bound == seen.freedom || bound.never_turns() && seen.freedom.never_turns();
            BodyMotion {
                body: body.label.clone(),
                freedom: seen.freedom,
                direction: seen.direction,
                evidence: if exact || seen.freedom == Freedom::General {
                    Evidence::Exact
                } else {
                    Evidence::sampled(states.len(), seen.off)
                },
            }
        })
        .collect();
    let relations = relations::found(model, &states);
    let facts = relations
        .iter()
        .map(|r| r.fact(model, &states, &velocity_constraints));
    explanation.relations = facts.collect();
    explanation.relations.extend(orientations(
        model,
        motions,
        &ways,
        &velocity_constraints,
        &seen,
        states.len(),
    ));
    let bodies = Bodies {
        model,
        motions,
        seen: &seen,
        gravity: [0, 1, 2].map(|k: usize| model.gravity[k].value.to_f64()),
    };
    explanation.unseen = bodies.without_effect(&analysis.base);
    explanation.merged = bodies.merged(&analysis.base);
    explanation
}

/// Coordinates and mobility.
fn coordinates(model: &Model, redundant: &[usize]) -> Vec<Fact> {
    let names = |of: &[usize]| -> String {
        let names = of.iter().map(|c| model.coordinates[*c].name.as_str());
        names.collect::<Vec<_>>().join(" ")
    };
    let n = model.coordinates.len();
    let rows = model.cuts.iter().map(|c| c.kind.equations()).sum::<usize>() + model.couplings.len();
    let mobility = model.independent.len();
    let mut facts = vec![Fact::given(if rows == 0 {
        format!("{n} coordinates and no loop: mobility {mobility}")
    } else {
        let used = rows - redundant.len();
        let apart = match redundant.len() {
            0 => String::new(),
            1 => ", one of them redundant".to_owned(),
            k => format!(", {k} of them redundant"),
        };
        format!(
            "{n} coordinates and {rows} closure rows{apart}: mobility {n} - {used} = {mobility}"
        )
    })];
    facts.push(Fact::given(format!(
        "independent are {}; that many, and the others follow from them at home",
        names(&model.independent)
    )));
    let difference = |a: &[usize], b: &[usize]| -> Vec<usize> {
        a.iter().copied().filter(|c| !b.contains(c)).collect()
    };
    let extra = difference(&model.actuated, &model.independent);
    let passive = difference(&model.independent, &model.actuated);
    if extra.is_empty() && passive.is_empty() {
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
            "{} fewer drives than mobility {mobility}: {} cannot be held",
            mobility - model.actuated.len(),
            if mobility == 1 { "it" } else { "some motion" }
        )));
    }
    facts
}

/// What holds at the given geometry only.
fn values(analysis: &Analysis) -> Vec<Fact> {
    let base = &analysis.base;
    let equal = base.coincidences.iter();
    let equal =
        equal.map(|e| format!("the base parameters rest on {e}, which holds by value only"));
    let held = base.held.iter();
    let held = held.map(|h| format!("completed factors hold for {h}"));
    let numbers = base.unrecognised.iter();
    let numbers = numbers.map(|n| format!("a number only: {n}"));
    equal.chain(held).chain(numbers).map(Fact::given).collect()
}

/// Bodies whose orientations stay together.
fn orientations(
    model: &Model,
    motions: &Motions<'_>,
    ways: &[LinkPath],
    velocity_constraints: &[Form],
    seen: &[ObservedMotion],
    states: usize,
) -> Vec<Fact> {
    let mut classes: Vec<Vec<usize>> = Vec::new();
    for (body, seen) in seen.iter().enumerate() {
        if seen.freedom.never_turns() {
            continue;
        }
        let link = |b: usize| Some(model.bodies[b].link);
        let with = classes
            .iter_mut()
            .find(|class| motions.same_orientation(link(class[0]), link(body)).0);
        match with {
            Some(class) => class.push(body),
            None => classes.push(vec![body]),
        }
    }
    let several = classes.iter().filter(|class| class.len() > 1);
    several
        .map(|class| {
            let link = |b: usize| model.bodies[b].link;
            let first = link(class[0]);
            let exact = class
                .iter()
                .all(|b| ways[first].turns_as(&ways[link(*b)], velocity_constraints));
            let off = class
                .iter()
                .map(|b| motions.same_orientation(Some(first), Some(link(*b))).1);
            let alike = class.iter().all(|b| motions.same_move(first, link(*b)));
            let names: Vec<&str> = class
                .iter()
                .map(|b| model.bodies[*b].label.as_str())
                .collect();
            let names = names.join(" ");
            let text = if alike {
                format!("bodies {names} always move alike, shifted by a constant")
            } else {
                format!("bodies {names} always have the same orientation but for a constant turn")
            };
            let evidence = if exact && !alike {
                Evidence::Exact
            } else {
                Evidence::sampled(states, off.fold(0.0, f64::max))
            };
            Fact::new(text, evidence)
        })
        .collect()
}
