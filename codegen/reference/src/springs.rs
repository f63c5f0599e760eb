//! Springs by their energies, and effort terms by their formulas.

use num_dual::{Dual, Dual64};

use crate::expr::evaluate;
use crate::load_fields::Names;
use crate::mechanism::Mechanism;
use crate::scalar::{Scalar, Vec3};

/// A point of a node, or of the world.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    /// The node's index; `None` is the world.
    pub node: Option<usize>,
    /// The point in the frame of the node or the world, m.
    pub at: [f64; 3],
}

/// The energy that is stored for a parameter of 1.
#[derive(Clone, Debug)]
pub enum Stored {
    /// (q - rest)^2 / 2.
    Joint {
        /// The index of the coordinate.
        coordinate: usize,
        /// The coordinate at which the spring is relaxed, rad or m.
        rest: f64,
    },
    /// (d - length)^2 / 2 with the distance d of two points.
    Stretch {
        /// The two points.
        ends: [Point; 2],
        /// The length of the relaxed spring, m.
        length: f64,
    },
    /// The distance of two points, times a factor.
    Distance {
        /// The two points.
        ends: [Point; 2],
        /// The factor: 1 for a pull, -1 for a preload.
        factor: f64,
    },
}

/// A spring's parameter.
#[derive(Clone, Debug)]
pub struct Spring {
    /// The label of the parameter.
    pub label: String,
    /// The energy for a parameter of 1.
    pub stored: Stored,
}

/// An effort term.
#[derive(Clone, Debug)]
pub struct EffortTerm {
    /// The label of the parameter.
    pub label: String,
    /// The index of the coordinate.
    pub coordinate: usize,
    /// The factor as written, in `q`, `qd` and names.
    pub factor: String,
    /// The names with their values.
    pub names: Names,
}

impl EffortTerm {
    /// The factor at a coordinate and its rate; NaN where it has no value.
    pub fn at(&self, q: f64, qd: f64) -> f64 {
        let lookup = |name: &str| match name {
            "q" => Some(q),
            "qd" => Some(qd),
            _ => self.names.get(name).copied(),
        };
        evaluate(&self.factor, &lookup).unwrap_or(f64::NAN)
    }
}

impl Mechanism {
    /// The energy that a spring stores at q for a parameter of 1.
    pub fn stored_energy<T: Scalar>(&self, stored: &Stored, q: &[T]) -> T {
        let half = T::from(0.5);
        let square = |x: T| x * x;
        match stored {
            Stored::Joint { coordinate, rest } => square(q[*coordinate] - T::from(*rest)) * half,
            // without a length no square root is needed, which has no derivative at 0
            Stored::Stretch { ends, length } if *length == 0.0 => {
                self.squared_distance(ends, q) * half
            }
            Stored::Stretch { ends, length } => {
                square(self.squared_distance(ends, q).sqrt() - T::from(*length)) * half
            }
            Stored::Distance { ends, factor } => self.squared_distance(ends, q).sqrt() * *factor,
        }
    }

    fn squared_distance<T: Scalar>(&self, ends: &[Point; 2], q: &[T]) -> T {
        let frames = self.frames(q);
        let place = |point: &Point| -> Vec3<T> {
            let Some(node) = point.node else {
                return point.at.map(T::from);
            };
            let frame = &frames[node];
            [0, 1, 2].map(|i| {
                let terms = point.at.iter().zip(&frame[i]);
                terms.fold(frame[i][3], |sum, (x, r)| sum + *r * *x)
            })
        };
        let [a, b] = ends.each_ref().map(place);
        let mut sum = T::from(0.0);
        for (x, y) in a.into_iter().zip(b) {
            sum += (x - y) * (x - y);
        }
        sum
    }

    /// The derivatives of a stored energy by all coordinates.
    pub fn spring_efforts(&self, stored: &Stored, q: &[f64]) -> Vec<f64> {
        let along = |k: usize| {
            let moved = q.iter().enumerate();
            let moved = moved.map(|(i, x)| Dual::new(*x, f64::from(u8::from(i == k))));
            let moved: Vec<Dual64> = moved.collect();
            self.stored_energy(stored, &moved).eps
        };
        (0..q.len()).map(along).collect()
    }
}
