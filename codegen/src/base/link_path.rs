//! What the order of a limb's joints alone says of how a link can move, exactly:
//! all its axes parallel, nothing but slides, nothing at all.

use crate::model::{Link, Model, MotionKind, Placement, Step};
use crate::sym::Number;

type Direction = [Number; 3];
/// Coordinates with factors.
pub type Form = Vec<(usize, Number)>;

/// How a body can move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Freedom {
    /// Not at all.
    Still,
    /// Along a line, without turning.
    Line,
    /// In a plane, without turning.
    Plane,
    /// In space, without turning.
    Translates,
    /// About an axis at rest.
    Spin,
    /// About and along an axis at rest, in a fixed proportion.
    Screw,
    /// In a plane.
    Planar,
    /// About a fixed direction, and along it too.
    Direction,
    /// About a point at rest.
    Point,
    /// Otherwise.
    General,
}

impl Freedom {
    /// Whether the orientation never changes.
    pub fn never_turns(self) -> bool {
        matches!(
            self,
            Freedom::Still | Freedom::Line | Freedom::Plane | Freedom::Translates
        )
    }

    /// Whether all turns are about one direction and all moves across it.
    pub fn is_planar(self) -> bool {
        matches!(self, Freedom::Spin | Freedom::Planar)
    }
}

/// The way from the ground, or from a link, to a link further out.
#[derive(Clone, Debug)]
pub struct LinkPath {
    /// The world's axes in the link's frame, up to the first turn.
    world: [Direction; 3],
    /// Directions of slides before the first turn, in the link's frame.
    slides: Vec<Direction>,
    slide_count: usize,
    /// How many of the slides are those of a turn in proportion.
    screw_count: usize,
    /// The first axis that turns, in the link's frame.
    axis: Option<Direction>,
    /// The same in the world's axes.
    direction: Option<Direction>,
    /// Whether all axes that turn are parallel.
    parallel: bool,
    /// Whether all slides are across them.
    across: bool,
    /// By how much the link turns about the direction.
    pub(super) turn: Form,
}

fn zero() -> Direction {
    [(); 3].map(|()| Number::zero())
}

fn unit(axis: usize) -> Direction {
    let mut v = zero();
    v[axis] = Number::one();
    v
}

/// A vector in the axes of a frame that was turned.
pub(super) fn into(v: &Direction, axis: usize, angle: &Number) -> Direction {
    let (sin, cos) = angle.sin_cos();
    let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
    let mut out = v.clone();
    out[i] = v[i].mul(&cos).add(&v[j].mul(&sin));
    out[j] = v[j].mul(&cos).sub(&v[i].mul(&sin));
    out
}

fn is_unit(x: &Number) -> bool {
    x.abs().is_one()
}

impl LinkPath {
    fn ground() -> LinkPath {
        LinkPath {
            world: [0, 1, 2].map(unit),
            slides: Vec::new(),
            slide_count: 0,
            screw_count: 0,
            axis: None,
            direction: None,
            parallel: true,
            across: true,
            turn: Vec::new(),
        }
    }

    fn place(&mut self, placement: &Placement) {
        for step in placement {
            let Step::Rotate(axis, angle) = step else {
                continue;
            };
            let axis = axis.index();
            let vectors = self.world.iter_mut().chain(&mut self.slides);
            for v in vectors.chain(&mut self.axis) {
                *v = into(v, axis, angle);
            }
        }
    }

    fn turn(&mut self, coordinate: usize, axis: usize) {
        match &self.axis {
            None => {
                self.across &= self.slides.iter().all(|s| s[axis].is_zero());
                self.direction = Some([0, 1, 2].map(|k| self.world[k][axis].clone()));
                self.axis = Some(unit(axis));
                self.turn.push((coordinate, Number::one()));
            }
            Some(first) if is_unit(&first[axis]) => {
                self.turn.push((coordinate, first[axis].clone()));
            }
            Some(_) => self.parallel = false,
        }
    }

    fn slide(&mut self, axis: usize) {
        self.slide_count += 1;
        match &self.axis {
            None => self.slides.push(unit(axis)),
            Some(first) => self.across &= first[axis].is_zero(),
        }
    }

    /// What the link's motion is at most, given ties of rates that hold exactly.
    pub fn freedom(&self, velocity_constraints: &[Form]) -> Freedom {
        if !self.parallel {
            return Freedom::General;
        }
        match (self.turn.len(), self.slide_count) {
            (0, 0) => Freedom::Still,
            (0, 1) => Freedom::Line,
            (0, _) => Freedom::Translates,
            _ if follows(velocity_constraints, &self.turn) => Freedom::Translates,
            (1, 0) => Freedom::Spin,
            (1, 1) if self.screw_count == 1 => Freedom::Screw,
            _ if self.across => Freedom::Planar,
            _ => Freedom::Direction,
        }
    }

    /// Whether two links have the same orientation all the time.
    pub fn turns_as(&self, other: &LinkPath, velocity_constraints: &[Form]) -> bool {
        if !(self.parallel && other.parallel) {
            return false;
        }
        let sign = match (&self.direction, &other.direction) {
            (Some(a), Some(b)) => {
                let same = |sign: i64| {
                    let sign = Number::from_i64(sign);
                    (0..3).all(|k| a[k].sub(&b[k].mul(&sign)).is_zero())
                };
                if same(1) {
                    -1
                } else if same(-1) {
                    1
                } else {
                    return false;
                }
            }
            _ => -1,
        };
        let mut difference = self.turn.clone();
        let sign = Number::from_i64(sign);
        difference.extend(other.turn.iter().map(|(c, k)| (*c, k.mul(&sign))));
        follows(velocity_constraints, &difference)
    }
}

impl LinkPath {
    /// The way over some links, one standing on the other.
    pub(super) fn over(model: &Model, links: &[usize]) -> LinkPath {
        let mut way = LinkPath::ground();
        for &link in links {
            way.pass(&model.links[link]);
        }
        way
    }

    fn pass(&mut self, link: &Link) {
        self.place(&link.placement);
        if let Some(motion) = &link.motion {
            let axis = motion.axis.index();
            match motion.kind {
                MotionKind::Rotation => self.turn(motion.coordinate, axis),
                MotionKind::Translation => self.slide(axis),
            }
            if motion.lead.is_some() {
                self.slide(axis);
                self.screw_count += 1;
            }
        }
    }
}

/// The ways to all links.
pub fn ways(model: &Model) -> Vec<LinkPath> {
    let mut ways: Vec<LinkPath> = Vec::new();
    for link in &model.links {
        let start = link.parent.and_then(|p| ways.get(p));
        let mut way = start.cloned().unwrap_or_else(LinkPath::ground);
        way.pass(link);
        ways.push(way);
    }
    ways
}

/// Whether a form of rates vanishes where these do.
pub fn follows(velocity_constraints: &[Form], form: &[(usize, Number)]) -> bool {
    let merged = |form: &[(usize, Number)]| -> Form {
        let mut out: Form = Vec::new();
        for (c, k) in form {
            match out.iter_mut().find(|(o, _)| o == c) {
                Some((_, sum)) => *sum = sum.add(k),
                None => out.push((*c, k.clone())),
            }
        }
        out.retain(|(_, k)| !k.is_zero());
        out
    };
    let mut rows: Vec<Form> = velocity_constraints.iter().map(|t| merged(t)).collect();
    let mut rest = merged(form);
    // eliminate the coordinates of the form's ties one after the other
    while let Some(row) = rows.pop() {
        let Some((pivot, lead)) = row.first().cloned() else {
            continue;
        };
        let reduced = |of: &Form| -> Form {
            let at = of.iter().find(|(c, _)| *c == pivot);
            let Some(factor) = at.and_then(|(_, k)| k.div(&lead)) else {
                return of.clone();
            };
            let mut sum = of.clone();
            sum.extend(row.iter().map(|(c, k)| (*c, k.mul(&factor).neg())));
            merged(&sum)
        };
        rows = rows.iter().map(reduced).collect();
        rest = reduced(&rest);
    }
    rest.is_empty()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::spec::Axis;

    #[test]
    fn a_form_follows_from_ties_that_span_it() {
        let n = Number::from_i64;
        let velocity_constraints = vec![vec![(0, n(1)), (1, n(1))], vec![(1, n(2)), (2, n(-2))]];
        assert!(follows(&velocity_constraints, &[(0, n(3)), (2, n(3))]));
        assert!(follows(&velocity_constraints, &[(1, n(1)), (1, n(-1))]));
        assert!(!follows(&velocity_constraints, &[(0, n(1))]));
    }

    /// A link that turns about its x (0), y (1) or z (2) by a coordinate, its frame turned before.
    fn turned(placement: &[(Axis, i64)], coordinate: usize, axis: usize) -> LinkPath {
        let quarter = Number::pi().mul(&Number::ratio(1, 2).unwrap());
        let steps = placement
            .iter()
            .map(|(axis, quarters)| Step::Rotate(*axis, quarter.mul(&Number::from_i64(*quarters))));
        let mut way = LinkPath::ground();
        way.place(&steps.collect());
        way.turn(coordinate, axis);
        way
    }

    #[test]
    fn links_turn_alike_where_the_ties_say_so_about_the_same_direction() {
        let n = Number::from_i64;
        let (same, opposite) = (
            vec![vec![(0, n(1)), (1, n(-1))]],
            vec![vec![(0, n(1)), (1, n(1))]],
        );
        let along = turned(&[], 0, 2);
        // y turned into z, the same direction
        let again = turned(&[(Axis::X, 1)], 1, 1);
        assert!(along.turns_as(&again, &same) ^ along.turns_as(&again, &opposite));
        let again = turned(&[(Axis::Z, 3)], 1, 2);
        assert!(along.turns_as(&again, &same));
        assert!(!along.turns_as(&again, &opposite));
        // upside down: the other way round about the opposite direction
        let against = turned(&[(Axis::X, 2)], 1, 2);
        assert!(along.turns_as(&against, &opposite));
        assert!(!along.turns_as(&against, &same));
        // about another direction never
        let across = turned(&[], 1, 0);
        assert!(!along.turns_as(&across, &same) && !along.turns_as(&across, &opposite));
        // nor where axes are not parallel
        let mut bent = turned(&[], 1, 2);
        bent.turn(2, 0);
        assert!(!along.turns_as(&bent, &same));
    }

    #[test]
    fn a_slide_across_the_axis_leaves_a_motion_planar_and_one_along_it_does_not() {
        for (slide, free) in [
            (0, Freedom::Planar),
            (1, Freedom::Planar),
            (2, Freedom::Direction),
        ] {
            let mut before = LinkPath::ground();
            before.slide(slide);
            before.turn(0, 2);
            assert_eq!(before.freedom(&[]), free, "slide {slide}, then turn");
            let mut behind = turned(&[], 0, 2);
            behind.slide(slide);
            assert_eq!(behind.freedom(&[]), free, "turn, then slide {slide}");
        }
        // a slide in the plane and one along the axis
        let mut both = LinkPath::ground();
        both.slide(2);
        both.slide(0);
        both.turn(0, 2);
        assert_eq!(both.freedom(&[]), Freedom::Direction);
        // held by a tie, it only slides
        let tie = vec![vec![(0, Number::one())]];
        assert_eq!(both.freedom(&tie), Freedom::Translates);
        assert_eq!(turned(&[], 0, 2).freedom(&[]), Freedom::Spin);
    }
}
