//! A mechanism with a geometry: what is constant is computed once, so that a state costs little more than
//! its coordinates.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use crate::closure::{Closure, row};
use crate::kinematics::{Amount, Axis, Chain, Kinematics, Motion, Row, View, follow, turn};

/// A mechanism with values of its geometry's scalars.
pub(crate) struct Placed<'a> {
    pub(crate) kinematics: &'a Kinematics,
    pub(crate) scalars: &'a [f64],
    /// The sine and cosine of each scalar.
    sines: Vec<(f64, f64)>,
    links: Vec<Folded>,
    sides: Vec<[Folded; 2]>,
}

/// A constant turn and shift.
#[derive(Clone, Copy)]
struct Fixed {
    axes: Matrix3<f64>,
    point: Vector3<f64>,
}

/// A chain whose constant motions between coordinates are put together.
struct Folded {
    first: Fixed,
    moves: Vec<Move>,
}

/// A motion of a coordinate, and what follows it up to the next one.
struct Move {
    turns: bool,
    axis: Axis,
    coordinate: usize,
    /// The factor of the coordinate in `amount`, and what multiplies it in all.
    amount: Amount,
    factor: f64,
    then: Fixed,
}

/// A frame of a [`State`]: the motions that move it are its own and those of its parents.
struct Place {
    axes: Matrix3<f64>,
    point: Vector3<f64>,
    parent: Option<usize>,
    own: core::ops::Range<usize>,
}

/// Frames of a mechanism at a state: those of the links, then others.
pub(crate) struct State<'p> {
    placed: &'p Placed<'p>,
    q: &'p [f64],
    /// For each scalar, whether its motions are noted; `None` where none are.
    noted: Option<&'p [bool]>,
    places: Vec<Place>,
    motions: Vec<Motion>,
}

impl Fixed {
    const NONE: Self = Self {
        axes: Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
        point: Vector3::new(0.0, 0.0, 0.0),
    };

    /// What it does to a frame. Written out, since products of matrices are loops in the library.
    fn after(&self, axes: &mut Matrix3<f64>, point: &mut Vector3<f64>) {
        let [x, y, z] = [0, 1, 2].map(|k| Vector3::new(axes[(0, k)], axes[(1, k)], axes[(2, k)]));
        let along = |v: [f64; 3]| v[0] * x + v[1] * y + v[2] * z;
        *point += along([self.point.x, self.point.y, self.point.z]);
        for k in 0..3 {
            let own = along([self.axes[(0, k)], self.axes[(1, k)], self.axes[(2, k)]]);
            for row in 0..3 {
                axes[(row, k)] = own[row];
            }
        }
    }
}

impl<'a> Placed<'a> {
    pub(crate) fn new(kinematics: &'a Kinematics, scalars: &'a [f64]) -> Self {
        let mut out = Self {
            kinematics,
            scalars,
            sines: scalars.iter().map(|value| libm::sincos(*value)).collect(),
            links: Vec::new(),
            sides: Vec::new(),
        };
        out.links = kinematics.links.iter().map(|own| out.folded(own)).collect();
        let cuts = kinematics.cuts.iter();
        out.sides = cuts
            .map(|cut| [0, 1].map(|k| out.folded(&cut.sides[k])))
            .collect();
        out
    }

    fn folded(&self, chain: &Chain) -> Folded {
        let mut out = Folded {
            first: Fixed::NONE,
            moves: Vec::new(),
        };
        for step in &chain.steps {
            let last = out.moves.last_mut();
            let fixed = last.map_or(&mut out.first, |own| &mut own.then);
            match step.amount {
                Amount::Scalar(k) if step.turns => {
                    let sine = self.sines.get(k).copied().unwrap_or((0.0, 1.0));
                    turn(&mut fixed.axes, step.axis, sine);
                }
                Amount::Scalar(k) => {
                    let value = self.scalars.get(k).copied().unwrap_or(0.0);
                    fixed.point += value * fixed.axes.column(step.axis.index());
                }
                Amount::Coordinate(coordinate, factor) => out.moves.push(Move {
                    turns: step.turns,
                    axis: step.axis,
                    coordinate,
                    amount: step.amount,
                    factor: factor * self.kinematics.scale(self.scalars, coordinate).0,
                    then: Fixed::NONE,
                }),
            }
        }
        out
    }

    /// The links at a state.
    ///
    /// - `noted`: for each scalar, whether its motions are noted; `None` where none are.
    pub(crate) fn at<'p>(&'p self, q: &'p [f64], noted: Option<&'p [bool]>) -> State<'p> {
        let chains = self.links.len() + 2 * self.sides.len() + 1;
        let mut out = State {
            placed: self,
            q,
            noted,
            places: Vec::with_capacity(chains),
            motions: Vec::with_capacity(4 * chains),
        };
        for (chain, folded) in self.kinematics.links.iter().zip(&self.links) {
            out.add(chain, folded);
        }
        out
    }

    /// The closure equations at a state, with derivatives by scalars as in [`Placed::at`].
    pub(crate) fn closure(&self, q: &[f64], noted: Option<&[bool]>) -> Closure {
        self.at(q, noted).closure()
    }
}

impl State<'_> {
    /// Adds the frame at the end of a chain; returned is its index.
    fn add(&mut self, chain: &Chain, folded: &Folded) -> usize {
        let start = chain.parent.and_then(|parent| self.places.get(parent));
        let (mut axes, mut point) = start.map_or((Matrix3::identity(), Vector3::zeros()), |own| {
            (own.axes, own.point)
        });
        let first = self.motions.len();
        if let Some(noted) = self.noted {
            let Placed {
                kinematics,
                scalars,
                sines,
                ..
            } = self.placed;
            let turned = |k: usize, value| {
                let own = sines.get(k).copied();
                own.unwrap_or_else(|| libm::sincos(value))
            };
            let place = (&mut axes, &mut point, &mut self.motions);
            let is_noted = |k: usize| noted.get(k).copied().unwrap_or(false);
            let at = (*kinematics, *scalars, self.q);
            follow(&chain.steps, at, (&turned, &is_noted), place);
        } else {
            folded.first.after(&mut axes, &mut point);
            for own in &folded.moves {
                let axis = axes.column(own.axis.index()).into_owned();
                let moved = own.factor * axis;
                self.motions
                    .push(Motion::new(own.amount, own.turns, moved, &point));
                let value = own.factor * self.q.get(own.coordinate).copied().unwrap_or(0.0);
                if own.turns {
                    turn(&mut axes, own.axis, libm::sincos(value));
                } else {
                    point += value * axis;
                }
                own.then.after(&mut axes, &mut point);
            }
        }
        self.places.push(Place {
            axes,
            point,
            parent: chain.parent,
            own: first..self.motions.len(),
        });
        self.places.len() - 1
    }

    /// Calls a function with every motion that moves a frame.
    fn each(&self, place: usize, mut f: impl FnMut(&Motion)) {
        let mut at = self.places.get(place);
        while let Some(own) = at {
            self.motions[own.own.clone()].iter().for_each(&mut f);
            at = own.parent.and_then(|parent| self.places.get(parent));
        }
    }

    /// A frame with its motions.
    fn view(&self, place: usize) -> View {
        let mut out = View::world();
        if let Some(own) = self.places.get(place) {
            (out.axes, out.point) = (own.axes, own.point);
        }
        self.each(place, |motion| out.motions.push(*motion));
        out
    }

    /// The named frames that are wanted; others are the world's.
    pub(crate) fn frames(&mut self, is_wanted: impl Fn(usize) -> bool) -> Vec<View> {
        let kinematics = self.placed.kinematics;
        let frames = kinematics.frames.iter().enumerate();
        frames
            .map(|(k, (_, chain))| {
                if is_wanted(k) {
                    let folded = self.placed.folded(chain);
                    let place = self.add(chain, &folded);
                    self.view(place)
                } else {
                    View::world()
                }
            })
            .collect()
    }

    /// The closure equations.
    pub(crate) fn closure(&mut self) -> Closure {
        let Placed {
            kinematics,
            scalars,
            ..
        } = *self.placed;
        let rows = kinematics.rows();
        let slopes = self.noted.map_or(0, |_| kinematics.scalars);
        let mut out = Closure {
            residual: DVector::zeros(rows),
            by_coordinate: DMatrix::zeros(rows, kinematics.coordinates.len()),
            by_scalar: DMatrix::zeros(rows, slopes),
        };
        let mut first = 0;
        // what multiplies a motion in each row of a cut, for side A and side B
        let mut wrenches: Vec<[(Vector3<f64>, Vector3<f64>); 2]> = Vec::new();
        for (cut, folded) in kinematics.cuts.iter().zip(&self.placed.sides) {
            let places = [0, 1].map(|k| self.add(&cut.sides[k], &folded[k]));
            let [a, b] = places.map(|place| {
                let own = &self.places[place];
                (&own.axes, &own.point)
            });
            wrenches.clear();
            for (k, equation) in cut.rows.iter().enumerate() {
                let (residual, linear, angular) = row(*equation, [a, b]);
                out.residual[first + k] = residual;
                let points = match equation {
                    Row::Position(_) => [a.1, b.1],
                    _ => [b.1, b.1],
                };
                let moment = |point: &Vector3<f64>| angular + point.cross(&linear);
                wrenches.push([(-linear, -moment(points[0])), (linear, moment(points[1]))]);
            }
            for (side, place) in places.into_iter().enumerate() {
                self.each(place, |motion| {
                    let mut column = match motion.amount {
                        Amount::Coordinate(c, _) => out.by_coordinate.column_mut(c),
                        Amount::Scalar(k) => out.by_scalar.column_mut(k),
                    };
                    for (k, wrench) in wrenches.iter().enumerate() {
                        let (force, moment) = &wrench[side];
                        column[first + k] +=
                            force.dot(&motion.at_origin) + moment.dot(&motion.turning);
                    }
                });
            }
            first += cut.rows.len();
        }
        for coupling in &kinematics.couplings {
            out.residual[first] = -coupling.constant;
            let terms = coupling.terms.iter().map(|(c, factor)| (*c, -factor));
            for (c, factor) in terms.chain([(coupling.key, 1.0)]) {
                let own = self.q.get(c).copied().unwrap_or(0.0);
                let (scale, place) = kinematics.scale(scalars, c);
                out.residual[first] += factor * scale * own;
                out.by_coordinate[(first, c)] += factor * scale;
                if let Some(place) = place.filter(|place| *place < slopes) {
                    out.by_scalar[(first, place)] += factor * own;
                }
            }
            first += 1;
        }
        out
    }
}
