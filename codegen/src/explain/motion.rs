//! How links move, inferred from sampled states.

use crate::base::certificate::{ClosedState, Float320, LinkMotion, Vector3, rank_of};

use super::Freedom;

/// The observed motion of a link.
#[derive(Clone, Copy, Debug)]
pub(super) struct ObservedMotion {
    pub(super) freedom: Freedom,
    /// The direction of its rotation axis in the world frame, a unit vector, if this direction is
    /// fixed.
    pub(super) direction: Option<[f64; 3]>,
    /// The same direction in the link's frame.
    pub(super) in_link: Option<[f64; 3]>,
    /// Whether its origin never moves.
    pub(super) origin_rests: bool,
    /// The largest relative error that was taken for zero.
    pub(super) largest_error: f64,
}

/// The sampled states from which motions are inferred.
#[derive(Debug)]
pub(super) struct Motions<'a> {
    states: &'a [ClosedState],
    /// The largest angular and the largest linear velocity of any link, for unit rates.
    size: (Float320, Float320),
}

fn dot(a: &Vector3, b: &Vector3) -> Float320 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn largest<'v>(vectors: impl Iterator<Item = &'v Vector3>) -> Float320 {
    vectors
        .flatten()
        .fold(Float320::ZERO, |m, x| m.max(x.abs()))
}

impl<'a> Motions<'a> {
    pub(super) fn new(states: &'a [ClosedState]) -> Motions<'a> {
        let links = || states.iter().flat_map(|s| &s.links);
        let or_one = |x: Float320| if x.is_zero() { Float320::ONE } else { x };
        Motions {
            states,
            size: (
                or_one(largest(links().flat_map(|l| &l.angular_velocities)).max(Float320::ONE)),
                or_one(largest(links().flat_map(|l| {
                    l.origin_velocities.iter().chain(&l.spatial_velocities)
                }))),
            ),
        }
    }

    fn all<'s>(
        &'s self,
        link: usize,
        what: impl Fn(&'s LinkMotion) -> &'s [Vector3] + 's,
    ) -> impl Iterator<Item = &'s Vector3> + 's {
        let links = self.states.iter().filter_map(move |s| s.links.get(link));
        links.flat_map(what)
    }

    /// The observed motion of a link.
    pub(super) fn of(&self, link: usize) -> ObservedMotion {
        let turns: Vec<Vector3> = self.all(link, |l| &l.angular_velocities).copied().collect();
        let moves: Vec<Vector3> = self.all(link, |l| &l.origin_velocities).copied().collect();
        let rows = |v: &[Vector3]| v.iter().map(|x| x.to_vec()).collect::<Vec<_>>();
        let (turning, off_turns) = rank_of(rows(&turns), self.size.0);
        let (moving, off_moves) = rank_of(rows(&moves), self.size.1);
        let mut observed = ObservedMotion {
            freedom: Freedom::General,
            direction: None,
            in_link: None,
            origin_rests: moving == 0,
            largest_error: off_turns,
        };
        match turning {
            0 => {
                observed.freedom = match moving {
                    0 => Freedom::Fixed,
                    1 => Freedom::LinearTranslation,
                    2 => Freedom::PlanarTranslation,
                    _ => Freedom::SpatialTranslation,
                };
                observed.largest_error = observed.largest_error.max(off_moves);
            }
            1 => self.about_a_direction(link, &turns, &moves, &mut observed),
            _ => {
                let (point, off) = self.has_fixed_point(link);
                if point {
                    observed.freedom = Freedom::Spherical;
                    observed.largest_error = observed.largest_error.max(off);
                }
            }
        }
        observed
    }

    fn about_a_direction(
        &self,
        link: usize,
        turns: &[Vector3],
        moves: &[Vector3],
        observed: &mut ObservedMotion,
    ) {
        let fastest = turns.iter().max_by(|a, b| dot(a, a).cmp_abs(&dot(b, b)));
        let Some(n) = fastest else { return };
        let along: Vec<Vec<Float320>> = moves.iter().map(|v| vec![dot(v, n)]).collect();
        let (leaves, off) = rank_of(along, self.size.0 * self.size.1);
        observed.largest_error = observed.largest_error.max(off);
        let (screws, off) = self.screw_rank(link);
        observed.freedom = match (screws, leaves) {
            (1, 0) => Freedom::FixedAxisRotation,
            (1, _) => Freedom::Screw,
            (_, 0) => Freedom::PlanarMotion,
            _ => Freedom::Schoenflies,
        };
        if screws == 1 {
            observed.largest_error = observed.largest_error.max(off);
        }
        let length = libm::sqrt(dot(n, n).to_f64());
        // orient the axis so that its largest component is positive
        let parts = n.map(|x| x.to_f64() / length);
        let by_size =
            parts.iter().copied().fold(
                0.0_f64,
                |m, x| if x.abs() > m.abs() + 1e-12 { x } else { m },
            );
        let parts = parts.map(|x| if by_size < 0.0 { -x } else { x });
        observed.direction = Some(parts);
        let axes = self.states.first().and_then(|s| s.links.get(link));
        observed.in_link = axes.map(|l| {
            l.axes.map(|axis| {
                let axis = axis.map(|x| x.to_f64());
                axis[0] * parts[0] + axis[1] * parts[1] + axis[2] * parts[2]
            })
        });
    }

    /// The rank of a link's velocity screws; the linear parts are scaled by the largest velocity.
    fn screw_rank(&self, link: usize) -> (usize, f64) {
        let turns = self.all(link, |l| &l.angular_velocities);
        let passes = self.all(link, |l| &l.spatial_velocities);
        let rows = turns.zip(passes).map(|(w, v)| {
            let w = w.iter().map(|x| *x * self.size.1);
            w.chain(v.iter().map(|x| *x * self.size.0)).collect()
        });
        rank_of(rows.collect(), self.size.0 * self.size.1)
    }

    /// Whether a point of the link never moves, and the largest relative error that was taken for
    /// zero.
    fn has_fixed_point(&self, link: usize) -> (bool, f64) {
        let turns = self.all(link, |l| &l.angular_velocities);
        let pairs: Vec<(&Vector3, &Vector3)> = turns
            .zip(self.all(link, |l| &l.spatial_velocities))
            .collect();
        fixed_point(pairs.into_iter(), self.size)
    }

    /// Whether two links always have the same angular velocity (`None` is the world), and the
    /// largest relative error that was taken for zero.
    pub(super) fn same_orientation(&self, a: Option<usize>, b: Option<usize>) -> (bool, f64) {
        self.equal(a, b, self.size.0, |l| &l.angular_velocities)
    }

    /// Whether the origins of two links always have the same velocity.
    pub(super) fn same_move(&self, a: usize, b: usize) -> bool {
        self.equal(Some(a), Some(b), self.size.1, |l| &l.origin_velocities)
            .0
    }

    fn equal(
        &self,
        a: Option<usize>,
        b: Option<usize>,
        size: Float320,
        what: fn(&LinkMotion) -> &[Vector3],
    ) -> (bool, f64) {
        let mut rows = Vec::new();
        for state in self.states {
            let of = |link: Option<usize>| link.and_then(|l| state.links.get(l)).map(what);
            let (a, b) = (of(a), of(b));
            let count = a.or(b).map_or(0, <[Vector3]>::len);
            for k in 0..count {
                let part = |v: Option<&[Vector3]>, i: usize| {
                    v.and_then(|v| v.get(k)).map_or(Float320::ZERO, |v| v[i])
                };
                rows.push((0..3).map(|i| part(a, i) - part(b, i)).collect());
            }
        }
        let (rank, off) = rank_of(rows, size);
        (rank == 0, off)
    }

    /// The common geometry of a loop's axes. `ends` are the links on both sides of the cut,
    /// `within` the coordinates of the loop.
    pub(super) fn of_loop(&self, ends: [Option<usize>; 2], within: &[usize]) -> LoopShape {
        let mut shape = LoopShape {
            turning: Turning::InPlane,
            spherical: true,
            translational: true,
        };
        for state in self.states {
            let links = ends.iter().flatten().filter_map(|l| state.links.get(*l));
            let screws = links.flat_map(|l| &l.unit_twists);
            let screws: Vec<_> = screws.filter(|s| within.contains(&s.0)).collect();
            let turns: Vec<Vec<Float320>> = screws.iter().map(|s| s.1.to_vec()).collect();
            let (turning, _) = rank_of(turns, Float320::ONE);
            shape.translational &= turning == 0;
            let axis = screws
                .iter()
                .find(|s| s.1.iter().any(|x| x.log10() > -60.0));
            let across = axis.is_none_or(|n| {
                // a slide or a screw that moves along the axis leaves the plane
                let along: Vec<Vec<Float320>> =
                    screws.iter().map(|s| vec![dot(&s.2, &n.1)]).collect();
                rank_of(along, Float320::ONE).0 == 0
            });
            shape.turning = match (turning, across, shape.turning) {
                (1, false, Turning::InPlane) => Turning::OneDirection,
                (1, _, turning) => turning,
                _ => Turning::Other,
            };
            let slides = screws.iter().any(|s| s.1.iter().all(Float320::is_zero));
            let through = fixed_point(screws.iter().map(|s| (&s.1, &s.2)), self.size).0;
            shape.spherical &= turning > 1 && !slides && through;
        }
        shape
    }
}

/// The directions of a loop's rotation axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Turning {
    /// All axes are parallel, and no joint moves along them.
    InPlane,
    /// All axes are parallel, and some joint also moves along them.
    OneDirection,
    /// The axes are not all parallel, or the loop has none.
    Other,
}

/// The common geometry of a loop's axes.
#[derive(Clone, Copy, Debug)]
pub(super) struct LoopShape {
    pub(super) turning: Turning,
    /// Whether all axes pass through one point, with at least two directions among them.
    pub(super) spherical: bool,
    /// Whether no joint rotates.
    pub(super) translational: bool,
}

/// Whether some point c is at rest: v + w x c = 0 for all angular velocities w, with v the velocity
/// of the body at the world's origin. Also returns the largest relative error taken for zero.
fn fixed_point<'v>(
    screws: impl Iterator<Item = (&'v Vector3, &'v Vector3)>,
    size: (Float320, Float320),
) -> (bool, f64) {
    let mut rows: Vec<Vec<Float320>> = Vec::new();
    for (w, v) in screws {
        let [x, y, z] = w.map(|x| x * size.1);
        let v = v.map(|x| x * size.0);
        rows.push(vec![Float320::ZERO, -z, y, v[0]]);
        rows.push(vec![z, Float320::ZERO, -x, v[1]]);
        rows.push(vec![-y, x, Float320::ZERO, v[2]]);
    }
    let size = size.0 * size.1;
    let without = rows.iter().map(|r| r[..3].to_vec()).collect();
    let (of_turns, _) = rank_of(without, size);
    let (together, off) = rank_of(rows, size);
    (together == of_turns, off)
}
