//! Exact statements on how a link can move, derived from the order and directions of the joints
//! between the ground and the link alone: all axes parallel, only prismatic joints, no joint.

use crate::model::{Link, Model, MotionKind, Placement, Step};
use crate::sym::Number;

type Direction = [Number; 3];
/// A linear form in the coordinates or their rates: coordinates with factors.
pub type Form = Vec<(usize, Number)>;

/// The class of motions that a body can perform.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Freedom {
    /// Does not move.
    Still,
    /// Translates along a line.
    Line,
    /// Translates in a plane.
    Plane,
    /// Translates in space.
    Translates,
    /// Turns about an axis at rest.
    Spin,
    /// Screws about an axis at rest: turns about it and slides along it in a fixed proportion.
    Screw,
    /// Moves in a plane and turns about the plane's normal.
    Planar,
    /// Turns about one direction and translates, also along that direction.
    Direction,
    /// Turns about a point at rest.
    Point,
    /// May move in any way: none of the other cases is shown.
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

    /// Whether all rotations are about one direction and all translations perpendicular to it.
    pub fn is_planar(self) -> bool {
        matches!(self, Freedom::Spin | Freedom::Planar)
    }
}

/// Summary of the joints between the ground, or an inner link, and a link further out.
#[derive(Clone, Debug)]
pub struct LinkPath {
    /// The world's axes in the link's frame, as long as no revolute joint was passed.
    world: [Direction; 3],
    /// Directions of prismatic joints before the first revolute joint, in the link's frame.
    slides: Vec<Direction>,
    slide_count: usize,
    /// How many of the translations belong to helical joints, coupled to their rotation.
    screw_count: usize,
    /// The axis of the first revolute joint, in the link's frame.
    axis: Option<Direction>,
    /// The same axis in the world's frame.
    direction: Option<Direction>,
    /// Whether all revolute axes are parallel.
    parallel: bool,
    /// Whether all translations are perpendicular to the revolute axes.
    across: bool,
    /// The angle by which the link turns about the common axis, as a form in the coordinates.
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

/// The components of a vector after the frame has been rotated about one of its axes, `angle` in
/// rad.
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

    /// An upper bound on the link's freedom, given velocity constraints that hold exactly.
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

    /// Whether two links keep the same relative orientation at all times, given velocity
    /// constraints that hold exactly.
    pub fn has_same_orientation(&self, other: &LinkPath, velocity_constraints: &[Form]) -> bool {
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
    /// The path over some links, each mounted on the one before.
    pub(super) fn over(model: &Model, links: &[usize]) -> LinkPath {
        let mut path = LinkPath::ground();
        for &link in links {
            path.pass(&model.links[link]);
        }
        path
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

/// The paths from the ground to all links, in the order of the model's links.
pub fn link_paths(model: &Model) -> Vec<LinkPath> {
    let mut link_paths: Vec<LinkPath> = Vec::new();
    for link in &model.links {
        let start = link.parent.and_then(|p| link_paths.get(p));
        let mut path = start.cloned().unwrap_or_else(LinkPath::ground);
        path.pass(link);
        link_paths.push(path);
    }
    link_paths
}

/// Whether a linear form of rates is zero as a consequence of the given constraints, each a form
/// that is zero.
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
    // eliminate the pivot coordinate of one constraint after the other
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

    /// A link with a revolute joint about its x (0), y (1) or z (2) axis, after some quarter turns
    /// of its frame.
    fn turned(placement: &[(Axis, i64)], coordinate: usize, axis: usize) -> LinkPath {
        let quarter = Number::pi().mul(&Number::ratio(1, 2).unwrap());
        let steps = placement
            .iter()
            .map(|(axis, quarters)| Step::Rotate(*axis, quarter.mul(&Number::from_i64(*quarters))));
        let mut path = LinkPath::ground();
        path.place(&steps.collect());
        path.turn(coordinate, axis);
        path
    }

    #[test]
    fn links_turn_alike_where_the_ties_say_so_about_the_same_direction() {
        let n = Number::from_i64;
        let (same, opposite) = (
            vec![vec![(0, n(1)), (1, n(-1))]],
            vec![vec![(0, n(1)), (1, n(1))]],
        );
        let along = turned(&[], 0, 2);
        // y rotated into z: the same direction
        let again = turned(&[(Axis::X, 1)], 1, 1);
        assert!(
            along.has_same_orientation(&again, &same)
                ^ along.has_same_orientation(&again, &opposite)
        );
        let again = turned(&[(Axis::Z, 3)], 1, 2);
        assert!(along.has_same_orientation(&again, &same));
        assert!(!along.has_same_orientation(&again, &opposite));
        // upside down: the axis points in the opposite direction
        let against = turned(&[(Axis::X, 2)], 1, 2);
        assert!(along.has_same_orientation(&against, &opposite));
        assert!(!along.has_same_orientation(&against, &same));
        // an axis in another direction never gives the same orientation
        let across = turned(&[], 1, 0);
        assert!(
            !along.has_same_orientation(&across, &same)
                && !along.has_same_orientation(&across, &opposite)
        );
        // nor do two axes that are not parallel
        let mut bent = turned(&[], 1, 2);
        bent.turn(2, 0);
        assert!(!along.has_same_orientation(&bent, &same));
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
        // a translation in the plane and one along the axis
        let mut both = LinkPath::ground();
        both.slide(2);
        both.slide(0);
        both.turn(0, 2);
        assert_eq!(both.freedom(&[]), Freedom::Direction);
        // with the rotation locked by a constraint, the link only translates
        let constraint = vec![vec![(0, Number::one())]];
        assert_eq!(both.freedom(&constraint), Freedom::Translates);
        assert_eq!(turned(&[], 0, 2).freedom(&[]), Freedom::Spin);
    }
}
