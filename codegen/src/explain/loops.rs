//! The loops of a mechanism: which bodies and joints they pass through, and why some of their rows
//! are redundant.

use core::fmt::Write as _;

use crate::base::{LinearForm, LinkPath};
use crate::diag::counted;
use crate::model::{Cut, Model};
use crate::spec::CutKind;

use super::motion::{Motions, Turning};
use super::{Evidence, Fact};

/// A loop: the last link common to both sides of the cut, and the two chains of links from there to
/// the cut.
struct Loop<'m> {
    model: &'m Model,
    cut: &'m Cut,
    common: Option<usize>,
    /// Links of each side beyond the common one, outward.
    sides: [Vec<usize>; 2],
}

impl<'m> Loop<'m> {
    fn new(model: &'m Model, cut: &'m Cut) -> Loop<'m> {
        let [a, b] = [0, 1].map(|k: usize| model.path(cut.sides[k].link));
        let shared = a.iter().zip(&b).take_while(|(x, y)| x == y).count();
        Loop {
            model,
            cut,
            common: shared.checked_sub(1).map(|k| a[k]),
            sides: [a[shared..].to_vec(), b[shared..].to_vec()],
        }
    }

    fn link_name(&self, link: usize) -> Option<&str> {
        let body = self.model.bodies.iter().find(|b| b.link == link);
        body.map(|b| b.label.as_str())
    }

    fn joint_name(&self, link: usize) -> Option<&str> {
        let motion = self.model.links[link].motion.as_ref()?;
        Some(&self.model.coordinates[motion.coordinate].name)
    }

    fn coordinates(&self) -> Vec<usize> {
        let links = self.sides.iter().flatten();
        links
            .filter_map(|l| self.model.links[*l].motion.as_ref().map(|m| m.coordinate))
            .collect()
    }

    /// The loop as text: `world (q1) 1 (q2) 2 [pin] 3 (q3) world`.
    fn route(&self) -> String {
        let side = |links: &[usize]| -> Vec<String> {
            let mut parts = Vec::new();
            for &link in links {
                parts.extend(self.joint_name(link).map(|j| format!("({j})")));
                parts.extend(self.link_name(link).map(str::to_owned));
            }
            parts
        };
        let start = match self.common {
            None => "world",
            Some(link) => self.link_name(link).unwrap_or("a massless link"),
        };
        let mut back = side(&self.sides[1]);
        back.reverse();
        let mut parts = vec![start.to_owned()];
        parts.extend(side(&self.sides[0]));
        parts.push(format!("[{}]", self.cut.name));
        parts.extend(back);
        parts.push(start.to_owned());
        parts.join(" ")
    }

    /// The moving links in order around the loop; one per coordinate.
    fn around(&self) -> Vec<usize> {
        let moved = |links: &[usize]| -> Vec<usize> {
            let moving = links.iter().copied();
            moving
                .filter(|l| self.model.links[*l].motion.is_some())
                .collect()
        };
        let mut all = moved(&self.sides[0]);
        let mut back = moved(&self.sides[1]);
        back.reverse();
        all.extend(back);
        all
    }
}

/// The statements about all loops.
pub(super) fn facts(
    model: &Model,
    redundant: &[usize],
    link_paths: &[LinkPath],
    velocity_constraints: &[LinearForm],
    motions: Option<&Motions<'_>>,
    states: usize,
) -> Vec<Fact> {
    let mut facts = Vec::new();
    let mut first = 0;
    for cut in &model.cuts {
        let rows = cut.kind.equations();
        let own = redundant
            .iter()
            .filter(|r| (first..first + rows).contains(*r));
        let left_out: Vec<String> = own.map(|r| (r - first + 1).to_string()).collect();
        first += rows;
        let ring = Loop::new(model, cut);
        let mut text = format!(
            "loop '{}': {}, closed by a {} joint with {}",
            cut.name,
            ring.route(),
            cut.kind.name(),
            counted(rows, "row", "rows")
        );
        if !left_out.is_empty() {
            let plural = if left_out.len() == 1 { "row" } else { "rows" };
            let _ = write!(text, ", {plural} {} redundant", left_out.join(" "));
        }
        facts.push(Fact::given(text));
        let Some(motions) = motions else { continue };
        facts.extend(shape(
            &ring,
            link_paths,
            motions,
            states,
            !left_out.is_empty(),
        ));
        facts.extend(parallelogram(
            &ring,
            link_paths,
            velocity_constraints,
            motions,
            states,
        ));
    }
    facts
}

/// The shape of a loop (planar, spherical, ...), or the reason why it has redundant rows.
fn shape(
    ring: &Loop<'_>,
    link_paths: &[LinkPath],
    motions: &Motions<'_>,
    states: usize,
    redundant: bool,
) -> Option<Fact> {
    let ends = [0, 1].map(|k: usize| ring.cut.sides[k].link);
    let shape = motions.of_loop(ends, &ring.coordinates());
    let name = &ring.cut.name;
    let sampled = Evidence::sampled(states, 0.0);
    if shape.turning == Turning::InPlane {
        let exact = ends.iter().flatten().all(|l| {
            let freedom = link_paths[*l].freedom(&[]);
            freedom.is_planar()
        });
        let evidence = if exact { Evidence::Exact } else { sampled };
        return Some(Fact::new(
            format!("loop '{name}' is planar: its axes are parallel, and it moves across them"),
            evidence,
        ));
    }
    if shape.spherical {
        return Some(Fact::new(
            format!("loop '{name}' is spherical: its axes pass through one point"),
            sampled,
        ));
    }
    if shape.translational {
        return Some(Fact::new(
            format!("loop '{name}' only slides: no joint of it turns"),
            sampled,
        ));
    }
    if redundant && shape.turning == Turning::OneDirection {
        return Some(Fact::new(
            format!(
                "loop '{name}' keeps to one direction: its axes are parallel, and it moves along them too"
            ),
            sampled,
        ));
    }
    redundant.then(|| {
        Fact::new(
            format!(
                "loop '{name}' has redundant rows though its axes are neither parallel nor through \
                 one point: it moves because of its lengths and angles, or other loops imply rows"
            ),
            sampled,
        )
    })
}

/// States that the opposite sides of a four-bar linkage stay parallel, if they do.
fn parallelogram(
    ring: &Loop<'_>,
    link_paths: &[LinkPath],
    velocity_constraints: &[LinearForm],
    motions: &Motions<'_>,
    states: usize,
) -> Option<Fact> {
    let &[first, middle, last] = &ring.around()[..] else {
        return None;
    };
    if ring.cut.kind != CutKind::Revolute {
        return None;
    }
    let (sides, off_sides) = motions.same_orientation(Some(first), Some(last));
    let (coupler, off_coupler) = motions.same_orientation(Some(middle), ring.common);
    let (turns, _) = motions.same_orientation(Some(first), ring.common);
    if !(sides && coupler) || turns {
        return None;
    }
    let exact = link_paths[first].has_same_orientation(&link_paths[last], velocity_constraints)
        && ring.common.map_or_else(
            || {
                link_paths[middle]
                    .freedom(velocity_constraints)
                    .has_constant_orientation()
            },
            |common| {
                link_paths[middle].has_same_orientation(&link_paths[common], velocity_constraints)
            },
        );
    let evidence = if exact {
        Evidence::Exact
    } else {
        Evidence::sampled(states, off_sides.max(off_coupler))
    };
    let coordinates = ring.coordinates();
    let names: Vec<&str> = coordinates
        .iter()
        .map(|c| ring.model.coordinates[*c].name.as_str())
        .collect();
    Some(Fact::new(
        format!(
            "loop '{}': opposite sides are equal and stay parallel, a parallelogram of {}",
            ring.cut.name,
            names.join(" ")
        ),
        evidence,
    ))
}
