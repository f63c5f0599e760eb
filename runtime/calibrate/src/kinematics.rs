//! A mechanism as elementary motions: every placement and every joint is a chain of turns about and
//! shifts along coordinate axes, so that all derivatives are those of screws.

use nalgebra::{Matrix3, Vector3};

/// How far an elementary motion goes, rad or m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Amount {
    /// The scalar of the geometry with this index.
    Scalar(usize),
    /// The coordinate with this index times a factor: 1, or the lead of a screw, m/rad.
    Coordinate(usize, f64),
}

/// The axis of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// x
    X,
    /// y
    Y,
    /// z
    Z,
}

/// An elementary motion in the frame that the motions before it lead to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Whether it turns about the axis (rad) or shifts along it (m).
    pub turns: bool,
    /// The axis.
    pub axis: Axis,
    /// How far it goes.
    pub amount: Amount,
}

/// A frame at the end of a chain of motions that begins at a link or at the world.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Chain {
    /// The link from which it begins; `None` is the world.
    pub parent: Option<usize>,
    /// The motions, the first one at the parent.
    pub steps: Vec<Step>,
}

/// A closure equation between frames A and B of a cut; it vanishes where the loop is closed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Row {
    /// A component of pB - pA in the world, m.
    Position(Axis),
    /// The product of an axis of A and an axis of B.
    Axes(Axis, Axis),
    /// The component of pB - pA along an axis of A, m.
    Offset(Axis),
    /// A screw about z: h sin(z/h - t) with its lead h, m/rad, the shift z = zA.(pB - pA) and the
    /// angle t from xA to xB, m.
    Screw(f64),
}

/// A loop that was cut at a joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Cut {
    /// Its equations.
    pub rows: Vec<Row>,
    /// Frame A, then frame B.
    pub sides: [Chain; 2],
}

/// A coordinate that is a linear form in others: `key = constant + sum of terms`.
#[derive(Clone, Debug, PartialEq)]
pub struct Coupling {
    /// The coordinate that the form determines.
    pub key: usize,
    /// The constant, rad or m.
    pub constant: f64,
    /// The other coordinates with their factors.
    pub terms: Vec<(usize, f64)>,
}

/// The kinematics of a mechanism: links in a tree, cuts that close loops, and named frames.
///
/// ```
/// use nalgebra::Vector3;
/// use regen_calibrate::{Amount, Axis, Chain, Kinematics, Step};
///
/// // an arm of 0.4 m along x that turns about z
/// let turn = Step { turns: true, axis: Axis::Z, amount: Amount::Coordinate(0, 1.0) };
/// let arm = Step { turns: false, axis: Axis::X, amount: Amount::Scalar(0) };
/// let pendulum = Kinematics {
///     coordinates: vec!["q1".to_owned()],
///     scalars: 1,
///     links: vec![Chain { parent: None, steps: vec![turn] }],
///     frames: vec![("tip".to_owned(), Chain { parent: Some(0), steps: vec![arm] })],
///     ..Kinematics::default()
/// };
/// let tip = &pendulum.frames(&[0.4], &[core::f64::consts::FRAC_PI_2])[0];
/// assert!((tip.point - Vector3::new(0.0, 0.4, 0.0)).norm() < 1e-15);
/// // the coordinate moves it along -x, the arm's length along y
/// let velocities: Vec<_> = tip.motions.iter().map(|m| m.velocity_of(&tip.point)).collect();
/// assert!((velocities[0] - Vector3::new(-0.4, 0.0, 0.0)).norm() < 1e-15);
/// assert!((velocities[1] - Vector3::y()).norm() < 1e-15);
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Kinematics {
    /// The names of the coordinates.
    pub coordinates: Vec<String>,
    /// The number of scalars of the geometry.
    pub scalars: usize,
    /// The links, parents before children: each the chain from its parent's frame to its own.
    pub links: Vec<Chain>,
    /// The cuts.
    pub cuts: Vec<Cut>,
    /// The couplings.
    pub couplings: Vec<Coupling>,
    /// The named frames.
    pub frames: Vec<(String, Chain)>,
    /// A closed state from which the loops of others are closed, rad or m.
    pub home: Vec<f64>,
    /// The scalar that multiplies each coordinate: the scale of its encoder or the error of its gear, 1 as
    /// described. Coordinates are then readings; without an entry they are multiplied by nothing.
    pub scales: Vec<Option<usize>>,
    /// The scalar that says how far the joint of each coordinate yields: it is behind the reading of its
    /// drive by this many rad/(N m) or m/N times the effort ([`Efforts`](crate::Efforts)).
    pub compliances: Vec<Option<usize>>,
    /// The limits of each coordinate, where there are any.
    pub limits: Vec<Option<[f64; 2]>>,
    /// Gravity in the world, m/s^2.
    pub gravity: [f64; 3],
}

/// A motion as the velocity field of what is behind it, for a unit rate of its amount.
#[derive(Clone, Copy, Debug)]
pub struct Motion {
    /// What it depends on.
    pub amount: Amount,
    /// The angular velocity, in the world.
    pub(crate) turning: Vector3<f64>,
    /// The velocity of the body's point at the origin of the world.
    pub(crate) at_origin: Vector3<f64>,
}

impl Motion {
    /// A turn about an axis through a point, or a shift along it.
    pub(crate) fn new(
        amount: Amount,
        turns: bool,
        axis: Vector3<f64>,
        point: &Vector3<f64>,
    ) -> Self {
        let (turning, at_origin) = if turns {
            (axis, point.cross(&axis))
        } else {
            (Vector3::zeros(), axis)
        };
        Self {
            amount,
            turning,
            at_origin,
        }
    }

    /// The velocity of a point of the body that is moved, in the world.
    pub fn velocity_of(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.at_origin + self.turning.cross(point)
    }

    /// The angular velocity of the body that is moved, in the world.
    pub fn turning(&self) -> Vector3<f64> {
        self.turning
    }
}

/// A frame in the world, and every motion that moves it.
#[derive(Clone, Debug)]
pub struct View {
    /// Its axes as columns.
    pub axes: Matrix3<f64>,
    /// Its origin, m.
    pub point: Vector3<f64>,
    /// The motions that move it.
    pub motions: Vec<Motion>,
}

impl Axis {
    /// Its index in a vector.
    pub fn index(self) -> usize {
        match self {
            Self::X => 0,
            Self::Y => 1,
            Self::Z => 2,
        }
    }
}

impl View {
    pub(crate) fn world() -> Self {
        Self {
            axes: Matrix3::identity(),
            point: Vector3::zeros(),
            motions: Vec::new(),
        }
    }

    /// Its axis of this kind.
    pub fn axis(&self, axis: Axis) -> Vector3<f64> {
        self.axes.column(axis.index()).into_owned()
    }
}

impl Kinematics {
    /// The frame at the end of a chain, from the links in the world ([`Kinematics::links`]).
    pub fn along(&self, links: &[View], chain: &Chain, scalars: &[f64], q: &[f64]) -> View {
        let parent = chain.parent.and_then(|parent| links.get(parent));
        let mut view = parent.cloned().unwrap_or_else(View::world);
        let place = (&mut view.axes, &mut view.point, &mut view.motions);
        let turned = |_, value| libm::sincos(value);
        follow(
            &chain.steps,
            (self, scalars, q),
            (&turned, &|_| true),
            place,
        );
        view
    }

    /// The links in the world, for scalars of the geometry and coordinates.
    pub fn links(&self, scalars: &[f64], q: &[f64]) -> Vec<View> {
        let mut links: Vec<View> = Vec::with_capacity(self.links.len());
        for link in &self.links {
            let view = self.along(&links, link, scalars, q);
            links.push(view);
        }
        links
    }

    /// The named frames in the world.
    pub fn frames(&self, scalars: &[f64], q: &[f64]) -> Vec<View> {
        let links = self.links(scalars, q);
        let frames = self.frames.iter();
        frames
            .map(|(_, chain)| self.along(&links, chain, scalars, q))
            .collect()
    }

    /// What multiplies a coordinate, and the scalar that says so.
    pub(crate) fn scale(&self, scalars: &[f64], coordinate: usize) -> (f64, Option<usize>) {
        let place = self.scales.get(coordinate).copied().flatten();
        let scale = place.and_then(|place| scalars.get(place)).copied();
        (scale.unwrap_or(1.0), place)
    }

    /// The number of closure equations: those of the cuts, then one for each coupling.
    pub fn rows(&self) -> usize {
        self.cuts.iter().map(|cut| cut.rows.len()).sum::<usize>() + self.couplings.len()
    }
}

/// Turns axes about one of them.
pub(crate) fn turn(axes: &mut Matrix3<f64>, axis: Axis, (sin, cos): (f64, f64)) {
    let (i, j) = match axis {
        Axis::X => (1, 2),
        Axis::Y => (2, 0),
        Axis::Z => (0, 1),
    };
    for row in 0..3 {
        let (a, b) = (axes[(row, i)], axes[(row, j)]);
        axes[(row, i)] = cos * a + sin * b;
        axes[(row, j)] = cos * b - sin * a;
    }
}

/// Follows motions from a frame, and notes them.
///
/// - `turned`: the sine and cosine of a scalar of the geometry, from its index and its value.
/// - `is_noted`: of which scalars the motions are noted.
pub(crate) fn follow(
    steps: &[Step],
    (kinematics, scalars, q): (&Kinematics, &[f64], &[f64]),
    (turned, is_noted): (&impl Fn(usize, f64) -> (f64, f64), &impl Fn(usize) -> bool),
    (axes, point, motions): (&mut Matrix3<f64>, &mut Vector3<f64>, &mut Vec<Motion>),
) {
    for step in steps {
        let axis = axes.column(step.axis.index()).into_owned();
        let mut moves = |amount: Amount, factor: f64| {
            if matches!(amount, Amount::Scalar(k) if !is_noted(k)) {
                return;
            }
            motions.push(Motion::new(amount, step.turns, factor * axis, point));
        };
        let (value, scalar) = match step.amount {
            Amount::Scalar(k) => {
                moves(step.amount, 1.0);
                (scalars.get(k).copied().unwrap_or(0.0), Some(k))
            }
            Amount::Coordinate(c, factor) => {
                let own = q.get(c).copied().unwrap_or(0.0);
                let (scale, place) = kinematics.scale(scalars, c);
                moves(step.amount, factor * scale);
                if let Some(place) = place {
                    moves(Amount::Scalar(place), factor * own);
                }
                (factor * scale * own, None)
            }
        };
        // most errors of a placement are 0
        if value == 0.0 {
            continue;
        }
        if step.turns {
            let sine = scalar.map_or_else(|| libm::sincos(value), |k| turned(k, value));
            turn(axes, step.axis, sine);
        } else {
            *point += value * axis;
        }
    }
}
