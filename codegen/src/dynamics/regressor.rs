//! The columns of K (Eq. 4-5) and of the reduced regressor K_i - X^T K_e (Eq. 11).
//!
//! K is the regressor of the open tree: K phi are the efforts of all coordinates. K_i and K_e are
//! its rows of the independent and of the dependent coordinates, and X = A_e^-1 A_i (Eq. 10), so
//! that the dependent velocities are -X times the independent ones.
//!
//! Each coordinate gives one row for each link that it moves: the power of the link's inertial
//! wrench on the coordinate's unit twist (e, u), where e and u are the partial velocities of Eq. 1:
//! the angular velocity of the link, and the velocity of its origin, per unit rate of the
//! coordinate. The inertial wrench is the force and the moment that the motion of the link
//! requires, less those of gravity. It is linear in the link's ten parameters: the inertia tensor I
//! about the link's origin (Ixx Ixy Ixz Iyy Iyz Izz, kg m^2, with Ixy the negative integral of x y
//! dm), the first moments m r (kg m) and the mass m (kg). All vectors are in the link's frame:
//!
//! - a: the acceleration of the link's origin less gravity, m/s^2;
//! - eta_tilde = (alpha x) + (w x)(w x), 3 by 3, 1/s^2, with the angular velocity w and the angular
//!   acceleration alpha: the force is `eta_tilde m r + a m`;
//! - eta_hat, 3 by 6, 1/s^2: the moment about the origin is `eta_hat I - a x m r`.
//!
//! So the row is `[e^T eta_hat | a x e + eta_tilde^T u | u . a]`. For a revolute joint u = e x
//! r_OkOi, with the vector r_OkOi from the joint's origin to the link's, which gives Eq. 4; for a
//! prismatic one e = 0.

use crate::kinematics::{Centre, Frames, LinkMotion, Rates, Twist};
use crate::model::{Model, ParameterKind};
use crate::sym::{Ex, Graph, V3, ZERO3};

use super::reference_points::{self, Block};
use super::{Reduction, effort_column};

/// The force (N) and the moment (N m) about the link's origin that the motion of a link requires,
/// less those of gravity, in the link's frame, as linear functions of the link's ten parameters.
#[derive(Clone, Debug)]
pub struct InertiaWrench {
    /// The columns of eta hat (Eq. 3-4), 1/s^2, for Ixx Ixy Ixz Iyy Iyz Izz.
    eta_hat: [V3; 6],
    /// The columns of eta tilde (Eq. 4), 1/s^2.
    eta_tilde: [V3; 3],
    /// Acceleration of the link's origin less gravity, m/s^2.
    a: V3,
}

impl InertiaWrench {
    /// The inertial wrench of a link in a given motion.
    pub fn new(g: &mut Graph, motion: &LinkMotion) -> Self {
        let eta = &motion.eta;
        let [xx, xy, xz, yy, yz, zz] = motion.ww;
        let [ax, ay, az] = motion.alpha;
        let eta_hat = [
            [ax, xz, g.neg(xy)],
            // alpha_y - xz and alpha_x + yz are also entries of eta tilde
            [g.neg(eta[2][0]), eta[2][1], g.sub(xx, yy)],
            [eta[1][0], g.sub(zz, xx), g.neg(eta[1][2])],
            [g.neg(yz), ay, xy],
            [g.sub(yy, zz), g.neg(eta[0][1]), eta[0][2]],
            [yz, g.neg(xz), az],
        ];
        InertiaWrench {
            eta_hat,
            eta_tilde: crate::sym::transposed(eta),
            a: motion.a,
        }
    }

    /// The ten entries of the regressor row for a unit twist in the link's frame, in the order Ixx
    /// Ixy Ixz Iyy Iyz Izz mx my mz m.
    pub fn row(&self, g: &mut Graph, twist: &Twist) -> [Ex; 10] {
        self.split_row(g, None, &ZERO3, twist)
    }

    /// The moment of the inertial wrench about another point than the link's origin, per unit of
    /// each first moment and of the mass: `v x a + arm x eta_tilde v` for each axis v, and
    /// `arm x a`. `arm` is the vector from the point to the link's origin, m. The part by the
    /// inertia tensor is a pure moment and the same about every point.
    fn moments_about(&self, g: &mut Graph, arm: &V3) -> MomentsAbout {
        let first = [0, 1, 2].map(|axis| {
            let mut unit = ZERO3;
            unit[axis] = Ex::ONE;
            let about_origin = g.cross(&unit, &self.a);
            let of_force = g.cross(arm, &self.eta_tilde[axis]);
            g.add3(&about_origin, &of_force)
        });
        let mass = g.cross(arm, &self.a);
        MomentsAbout { first, mass }
    }

    /// The regressor row for the sum of a rotation about the reference point of `moments`, with
    /// angular velocity `rotation`, and a twist. With the vector `arm` from that point to the
    /// link's origin, the whole twist is `(rotation + twist.e, rotation x arm + twist.u)`. The
    /// power of the rotation is computed from the moments about the point, so that `rotation x arm`
    /// is not needed.
    fn split_row(
        &self,
        g: &mut Graph,
        moments: Option<&MomentsAbout>,
        rotation: &V3,
        twist: &Twist,
    ) -> [Ex; 10] {
        let mut row = [Ex::ZERO; 10];
        let e = g.add3(rotation, &twist.e);
        for (entry, column) in row.iter_mut().zip(&self.eta_hat) {
            *entry = g.dot3(&e, column);
        }
        let moment = g.cross(&self.a, &twist.e);
        for axis in 0..3 {
            let force = g.dot3(&self.eta_tilde[axis], &twist.u);
            row[6 + axis] = g.add(moment[axis], force);
        }
        row[9] = g.dot3(&twist.u, &self.a);
        if let Some(moments) = moments {
            for (entry, moment) in row[6..].iter_mut().zip(moments.columns()) {
                let power = g.dot3(rotation, moment);
                *entry = g.add(*entry, power);
            }
        }
        row
    }
}

/// The moments of a link's inertial wrench about a point at which joint axes meet.
struct MomentsAbout {
    /// Per unit of each first moment mx, my, mz: m/s^2.
    first: [V3; 3],
    /// Per unit of the mass: m^2/s^2.
    mass: V3,
}

impl MomentsAbout {
    /// The columns of mx, my, mz and m.
    fn columns(&self) -> impl Iterator<Item = &V3> {
        self.first.iter().chain([&self.mass])
    }
}

/// The frames of the links, the unit twists that move them, and the points at which joint axes meet.
#[derive(Debug)]
pub struct TreeKinematics<'a> {
    /// The frame of each link.
    pub frames: &'a Frames,
    /// For each link, the coordinates that move it and their unit twists, in the link's frame.
    pub twists: &'a [Vec<(usize, Twist)>],
    /// For each link, the points at which axes of joints before it meet.
    pub centres: &'a [Vec<Centre>],
}

/// The reduced regressor W, one column per parameter with one entry per independent coordinate:
/// `tau = W phi` for the efforts tau of the independent coordinates. It is `K_i - X^T K_e` (Eq. 11)
/// with the columns of friction, offsets, rotors (Eq. 20) and springs; columns of dependent joints are projected by
/// -X^T. The columns are in the order of `model.parameters`, which begins with the ten parameters
/// of each body.
///
/// The columns of each body are built once about its origin, and once about each point at which
/// axes of joints before it meet. They have the same values but need different numbers of
/// operations; for each body those are returned that make the `wanted` columns (a flag per
/// parameter) cheap to evaluate.
///
/// - `motions`, `tree`: by link;
/// - `j`: the matrix J of `qd = J qd_i`.
pub fn reduced_regressor(
    g: &mut Graph,
    model: &Model,
    motions: &[LinkMotion],
    tree: &TreeKinematics<'_>,
    rates: &Rates,
    j: &Reduction,
    wanted: &[bool],
) -> Vec<Vec<Ex>> {
    let mut columns = Vec::with_capacity(model.parameters.len());
    let blocks: Vec<Block> = model
        .bodies
        .iter()
        .map(|body| {
            let wrench = InertiaWrench::new(g, &motions[body.link]);
            let twists = &tree.twists[body.link];
            let centres = tree.centres[body.link].iter().map(Some);
            let points = [None].into_iter().chain(centres);
            points
                .map(|centre| body_rows(g, &wrench, twists, centre, j))
                .collect()
        })
        .collect();
    let chosen = reference_points::cheapest(g, &blocks, wanted);
    for (block, choice) in blocks.iter().zip(chosen) {
        for entry in 0..10 {
            columns.push(block[choice].iter().map(|row| row[entry]).collect());
        }
    }
    for parameter in &model.parameters {
        if matches!(parameter.kind, ParameterKind::Inertial { .. }) {
            continue;
        }
        let column = effort_column(g, model, tree.frames, rates, parameter.kind);
        let entries = (0..j.width()).map(|i| {
            column.iter().fold(Ex::ZERO, |sum, (coordinate, factor)| {
                let entry = g.mul(j.at(*coordinate, i), *factor);
                g.add(sum, entry)
            })
        });
        columns.push(entries.collect());
    }
    columns
}

/// The regressor rows of a body about a centre, or about its origin for `None`; one row per
/// independent coordinate.
///
/// If several of the coordinates that move the body depend on one independent coordinate, their
/// unit twists are added first, weighted by J, and the power of the body's inertial wrench is
/// computed once. If there is only one, its row of K is multiplied by the entry of J. A coordinate
/// whose axis passes through the centre is a pure rotation about it, so that only the moments about
/// the centre have power.
fn body_rows(
    g: &mut Graph,
    wrench: &InertiaWrench,
    twists: &[(usize, Twist)],
    centre: Option<&Centre>,
    j: &Reduction,
) -> Vec<[Ex; 10]> {
    let moments = centre.map(|centre| wrench.moments_about(g, &centre.arm));
    let moments = moments.as_ref();
    let mut rows = Vec::new();
    for i in 0..j.width() {
        let moving: Vec<(Ex, usize, &Twist)> = twists
            .iter()
            .map(|(c, t)| (j.at(*c, i), *c, t))
            .filter(|(weight, ..)| !weight.is_zero())
            .collect();
        let passes_through_centre =
            |c: usize| centre.is_some_and(|centre| centre.coordinates.contains(&c));
        let zero_twist = Twist { e: ZERO3, u: ZERO3 };
        let row = match moving.as_slice() {
            [] => [Ex::ZERO; 10],
            [(weight, c, twist)] => {
                let row = if passes_through_centre(*c) {
                    wrench.split_row(g, moments, &twist.e, &zero_twist)
                } else {
                    wrench.row(g, twist)
                };
                row.map(|entry| g.mul(*weight, entry))
            }
            several => {
                let (mut rotation, mut sum) = (ZERO3, zero_twist);
                for (weight, c, twist) in several {
                    if passes_through_centre(*c) {
                        rotation = g.add_scaled3(&rotation, *weight, &twist.e);
                    } else {
                        sum.e = g.add_scaled3(&sum.e, *weight, &twist.e);
                        sum.u = g.add_scaled3(&sum.u, *weight, &twist.u);
                    }
                }
                wrench.split_row(g, moments, &rotation, &sum)
            }
        };
        rows.push(row);
    }
    rows
}
