//! Exact statements on how a link can move, derived from the order and directions of the joints
//! between the ground and the link alone: all axes parallel, only prismatic joints, no joint.

use crate::model::{Link, Model, MotionKind, Placement, Step};
use crate::sym::Number;

type Direction = [Number; 3];
/// A linear form in the coordinates or in their rates: a list of coordinate indices with their
/// coefficients.
pub type LinearForm = Vec<(usize, Number)>;

/// The class of motions of a body relative to the ground.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Freedom {
    /// Does not move.
    Fixed,
    /// Translates along a line, with constant orientation.
    LinearTranslation,
    /// Translates in a plane, with constant orientation.
    PlanarTranslation,
    /// Translates in space, with constant orientation.
    SpatialTranslation,
    /// Rotates about an axis that is fixed in the world.
    FixedAxisRotation,
    /// Screws about an axis that is fixed in the world: rotates about it and slides along it in a
    /// fixed proportion.
    Screw,
    /// Translates in a plane and rotates about the plane's normal.
    PlanarMotion,
    /// Rotates about a fixed direction and translates in space (the Schoenflies motions, as of a
    /// SCARA robot).
    Schoenflies,
    /// Rotates about a point that is fixed in the world.
    Spherical,
    /// May move in any way: the motion is not proven to belong to another class.
    General,
}

impl Freedom {
    /// Whether the orientation never changes.
    pub fn has_constant_orientation(self) -> bool {
        matches!(
            self,
            Freedom::Fixed
                | Freedom::LinearTranslation
                | Freedom::PlanarTranslation
                | Freedom::SpatialTranslation
        )
    }

    /// Whether all rotations are about one direction and all translations perpendicular to it.
    pub fn is_planar(self) -> bool {
        matches!(self, Freedom::FixedAxisRotation | Freedom::PlanarMotion)
    }
}

/// Summary of the joints on the path from the ground, or from an inner link, to a link further
/// out.
#[derive(Clone, Debug)]
pub struct LinkPath {
    /// The components of the world's axes in the link's frame, with all revolute coordinates 0:
    /// used only until the first revolute joint.
    world: [Direction; 3],
    /// Directions of prismatic joints before the first revolute joint, in the link's frame.
    slides: Vec<Direction>,
    /// The number of translations: one for each prismatic and each helical joint.
    slide_count: usize,
    /// The number of helical joints, whose translation is proportional to their rotation.
    screw_count: usize,
    /// The direction of the first revolute axis in the link's frame, a unit vector; `None` before
    /// the first revolute joint.
    axis_in_link: Option<Direction>,
    /// The direction of the same axis in the world's frame.
    axis_in_world: Option<Direction>,
    /// Whether all revolute axes are parallel.
    parallel: bool,
    /// Whether all translations are perpendicular to the revolute axes.
    slides_perpendicular: bool,
    /// The rotation angle of the link about the common axis, up to a constant, as a linear form in
    /// the coordinates.
    pub(super) rotation_angle: LinearForm,
}

fn zero() -> Direction {
    [(); 3].map(|()| Number::zero())
}

fn unit(axis: usize) -> Direction {
    let mut v = zero();
    v[axis] = Number::one();
    v
}

/// The components of a vector `v` in a frame that has been rotated by `angle`, rad, about its own
/// axis number `axis` (0 for x, 1 for y, 2 for z).
fn in_rotated_frame(v: &Direction, axis: usize, angle: &Number) -> Direction {
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
    /// The empty path, which ends at the ground.
    fn ground() -> LinkPath {
        LinkPath {
            world: [0, 1, 2].map(unit),
            slides: Vec::new(),
            slide_count: 0,
            screw_count: 0,
            axis_in_link: None,
            axis_in_world: None,
            parallel: true,
            slides_perpendicular: true,
            rotation_angle: Vec::new(),
        }
    }

    /// Expresses all directions in the frame that a placement leads to.
    fn apply_placement(&mut self, placement: &Placement) {
        for step in placement {
            let Step::Rotate(axis, angle) = step else {
                continue;
            };
            let axis = axis.index();
            let vectors = self.world.iter_mut().chain(&mut self.slides);
            for v in vectors.chain(&mut self.axis_in_link) {
                *v = in_rotated_frame(v, axis, &angle.value);
            }
        }
    }

    /// Appends a rotation about the axis of number `axis` of the link's frame.
    fn add_revolute(&mut self, coordinate: usize, axis: usize) {
        match &self.axis_in_link {
            None => {
                self.slides_perpendicular &= self.slides.iter().all(|s| s[axis].is_zero());
                self.axis_in_world = Some([0, 1, 2].map(|k| self.world[k][axis].clone()));
                self.axis_in_link = Some(unit(axis));
                self.rotation_angle.push((coordinate, Number::one()));
            }
            Some(first) if is_unit(&first[axis]) => {
                self.rotation_angle.push((coordinate, first[axis].clone()));
            }
            Some(_) => self.parallel = false,
        }
    }

    /// Appends a translation along the axis of number `axis` of the link's frame.
    fn add_prismatic(&mut self, axis: usize) {
        self.slide_count += 1;
        match &self.axis_in_link {
            None => self.slides.push(unit(axis)),
            Some(first) => self.slides_perpendicular &= first[axis].is_zero(),
        }
    }

    /// An upper bound on the link's motions: a class that contains all of them by the joints on the
    /// path and by the given velocity constraints, which hold exactly.
    pub fn freedom(&self, velocity_constraints: &[LinearForm]) -> Freedom {
        if !self.parallel {
            return Freedom::General;
        }
        match (self.rotation_angle.len(), self.slide_count) {
            (0, 0) => Freedom::Fixed,
            (0, 1) => Freedom::LinearTranslation,
            (0, _) => Freedom::SpatialTranslation,
            _ if is_implied_by(velocity_constraints, &self.rotation_angle) => {
                Freedom::SpatialTranslation
            }
            (1, 0) => Freedom::FixedAxisRotation,
            (1, 1) if self.screw_count == 1 => Freedom::Screw,
            _ if self.slides_perpendicular => Freedom::PlanarMotion,
            _ => Freedom::Schoenflies,
        }
    }

    /// Whether two links keep the same relative orientation at all times, given velocity
    /// constraints that hold exactly.
    pub fn has_same_orientation(
        &self,
        other: &LinkPath,
        velocity_constraints: &[LinearForm],
    ) -> bool {
        if !(self.parallel && other.parallel) {
            return false;
        }
        let sign = match (&self.axis_in_world, &other.axis_in_world) {
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
        let mut difference = self.rotation_angle.clone();
        let sign = Number::from_i64(sign);
        difference.extend(other.rotation_angle.iter().map(|(c, k)| (*c, k.mul(&sign))));
        is_implied_by(velocity_constraints, &difference)
    }
}

impl LinkPath {
    /// The path along some links, each mounted on the one before it.
    pub(super) fn along_links(model: &Model, links: &[usize]) -> LinkPath {
        let mut path = LinkPath::ground();
        for &link in links {
            path.add_link(&model.links[link]);
        }
        path
    }

    /// Appends a link: its placement, then its joint; a helical joint is a rotation and a
    /// translation.
    fn add_link(&mut self, link: &Link) {
        self.apply_placement(&link.placement);
        if let Some(motion) = &link.motion {
            let axis = motion.axis.index();
            match motion.kind {
                MotionKind::Rotation => self.add_revolute(motion.coordinate, axis),
                MotionKind::Translation => self.add_prismatic(axis),
            }
            if motion.lead.is_some() {
                self.add_prismatic(axis);
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
        path.add_link(link);
        link_paths.push(path);
    }
    link_paths
}

/// Whether the velocity constraints, each a linear form of rates that is zero, imply that `form` is
/// zero too: whether `form` is a linear combination of them.
pub fn is_implied_by(velocity_constraints: &[LinearForm], form: &[(usize, Number)]) -> bool {
    let merged = |form: &[(usize, Number)]| -> LinearForm {
        let mut sums: LinearForm = Vec::new();
        for (c, k) in form {
            match sums.iter_mut().find(|(summed, _)| summed == c) {
                Some((_, sum)) => *sum = sum.add(k),
                None => sums.push((*c, k.clone())),
            }
        }
        sums.retain(|(_, k)| !k.is_zero());
        sums
    };
    let mut rows: Vec<LinearForm> = velocity_constraints
        .iter()
        .map(|constraint| merged(constraint))
        .collect();
    let mut remainder = merged(form);
    // eliminate the pivot coordinate of one constraint after the other
    while let Some(eliminated) = rows.pop() {
        let Some((pivot, pivot_coefficient)) = eliminated.first().cloned() else {
            continue;
        };
        let reduced = |row_to_reduce: &LinearForm| -> LinearForm {
            let pivot_term = row_to_reduce.iter().find(|(c, _)| *c == pivot);
            let Some(factor) = pivot_term.and_then(|(_, k)| k.div(&pivot_coefficient)) else {
                return row_to_reduce.clone();
            };
            let mut sum = row_to_reduce.clone();
            sum.extend(eliminated.iter().map(|(c, k)| (*c, k.mul(&factor).neg())));
            merged(&sum)
        };
        rows = rows.iter().map(reduced).collect();
        remainder = reduced(&remainder);
    }
    remainder.is_empty()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::diag::Span;
    use crate::spec::{Axis, Expr, Quantity};

    #[test]
    fn constraints_imply_the_forms_in_their_span() {
        let n = Number::from_i64;
        let velocity_constraints = vec![vec![(0, n(1)), (1, n(1))], vec![(1, n(2)), (2, n(-2))]];
        assert!(is_implied_by(
            &velocity_constraints,
            &[(0, n(3)), (2, n(3))]
        ));
        assert!(is_implied_by(
            &velocity_constraints,
            &[(1, n(1)), (1, n(-1))]
        ));
        assert!(!is_implied_by(&velocity_constraints, &[(0, n(1))]));
    }

    /// A link with a revolute joint about its x (0), y (1) or z (2) axis, after some quarter turns
    /// of its frame.
    fn turned(placement: &[(Axis, i64)], coordinate: usize, axis: usize) -> LinkPath {
        let quarter = Number::pi().mul(&Number::ratio(1, 2).unwrap());
        let steps = placement.iter().map(|(axis, quarters)| {
            let angle = quarter.mul(&Number::from_i64(*quarters));
            let expr = Expr::Number(angle.clone());
            let quantity = Quantity {
                expr,
                value: angle,
                span: Span::default(),
            };
            Step::Rotate(*axis, quantity)
        });
        let mut path = LinkPath::ground();
        path.apply_placement(&steps.collect());
        path.add_revolute(coordinate, axis);
        path
    }

    #[test]
    fn constraints_between_parallel_axes_fix_the_relative_orientation() {
        let n = Number::from_i64;
        let (same, opposite) = (
            vec![vec![(0, n(1)), (1, n(-1))]],
            vec![vec![(0, n(1)), (1, n(1))]],
        );
        let turned_about_z = turned(&[], 0, 2);
        // y rotated into z: the same direction
        let again = turned(&[(Axis::X, 1)], 1, 1);
        assert!(
            turned_about_z.has_same_orientation(&again, &same)
                ^ turned_about_z.has_same_orientation(&again, &opposite)
        );
        let again = turned(&[(Axis::Z, 3)], 1, 2);
        assert!(turned_about_z.has_same_orientation(&again, &same));
        assert!(!turned_about_z.has_same_orientation(&again, &opposite));
        // upside down: the axis points in the opposite direction
        let against = turned(&[(Axis::X, 2)], 1, 2);
        assert!(turned_about_z.has_same_orientation(&against, &opposite));
        assert!(!turned_about_z.has_same_orientation(&against, &same));
        // an axis in another direction never gives the same orientation
        let across = turned(&[], 1, 0);
        assert!(
            !turned_about_z.has_same_orientation(&across, &same)
                && !turned_about_z.has_same_orientation(&across, &opposite)
        );
        // nor do two axes that are not parallel
        let mut bent = turned(&[], 1, 2);
        bent.add_revolute(2, 0);
        assert!(!turned_about_z.has_same_orientation(&bent, &same));
    }

    #[test]
    fn a_slide_across_the_axis_leaves_a_motion_planar_and_one_along_it_does_not() {
        for (slide, free) in [
            (0, Freedom::PlanarMotion),
            (1, Freedom::PlanarMotion),
            (2, Freedom::Schoenflies),
        ] {
            let mut before = LinkPath::ground();
            before.add_prismatic(slide);
            before.add_revolute(0, 2);
            assert_eq!(before.freedom(&[]), free, "slide {slide}, then turn");
            let mut behind = turned(&[], 0, 2);
            behind.add_prismatic(slide);
            assert_eq!(behind.freedom(&[]), free, "turn, then slide {slide}");
        }
        // a translation in the plane and one along the axis
        let mut both = LinkPath::ground();
        both.add_prismatic(2);
        both.add_prismatic(0);
        both.add_revolute(0, 2);
        assert_eq!(both.freedom(&[]), Freedom::Schoenflies);
        // with the rotation locked by a constraint, the link only translates
        let constraint = vec![vec![(0, Number::one())]];
        assert_eq!(both.freedom(&constraint), Freedom::SpatialTranslation);
        assert_eq!(turned(&[], 0, 2).freedom(&[]), Freedom::FixedAxisRotation);
    }
}
