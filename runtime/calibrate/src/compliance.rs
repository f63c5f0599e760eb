//! Joints that yield to their efforts: what readings at the drives say of the state behind them.

use nalgebra::DMatrix;

use crate::closure::Split;
use crate::equations::{Pose, Problem};
use crate::placed::Placed;

/// The efforts that hold a mechanism at rest.
pub trait Efforts {
    /// The effort of every coordinate's drive at a state, N m or N, 0 where it has none; `None` where the
    /// state has none that is finite.
    fn at(&self, q: &[f64]) -> Option<Vec<f64>>;
}

/// The largest number of times that efforts follow the state that they lead to.
const ROUNDS: usize = 30;
/// A change of the state that is none, rad or m.
const SETTLED: f64 = 1e-12;
/// The step of differences of efforts, rad or m.
const STEP: f64 = 1e-5;

/// How far joints yield at a state.
pub(crate) struct Yielding {
    /// The efforts of all coordinates.
    pub(crate) efforts: Vec<f64>,
    /// The derivatives of deflections, compliance times effort, by coordinates.
    pub(crate) slopes: DMatrix<f64>,
}

impl Problem<'_> {
    /// How far a coordinate is behind its reading for a unit of its effort, rad/(N m) or m/N, and the
    /// scalar that says so.
    fn compliance(&self, scalars: &[f64], coordinate: usize) -> (f64, Option<usize>) {
        let places = &self.kinematics.compliances;
        let place = places.get(coordinate).copied().flatten();
        let value = place.and_then(|place| scalars.get(place)).copied();
        (value.unwrap_or(0.0), place)
    }

    /// The readings at a state: drives are ahead of joints that yield.
    pub(crate) fn readings(&self, scalars: &[f64], q: &[f64]) -> Option<Vec<f64>> {
        let efforts = match self.efforts {
            Some(efforts) => efforts.at(q)?,
            None => vec![0.0; q.len()],
        };
        let measured = self.measured.iter();
        let readings = measured.map(|c| q[*c] + self.compliance(scalars, *c).0 * efforts[*c]);
        Some(readings.collect())
    }

    /// The closed state near one that the readings of a pose lead to.
    pub(crate) fn state_of(
        &self,
        (placed, split): (&Placed<'_>, &Split),
        pose: &Pose,
        near: &[f64],
    ) -> Option<Vec<f64>> {
        let mut q = near.to_vec();
        let Some(efforts) = self.efforts else {
            return placed.close(split, q);
        };
        for _ in 0..ROUNDS {
            let efforts = efforts.at(&q)?;
            let mut change: f64 = 0.0;
            for (c, reading) in self.measured.iter().zip(&pose.readings) {
                if split.driving.contains(c) {
                    let next = reading - self.compliance(placed.scalars, *c).0 * efforts[*c];
                    change = change.max((next - q[*c]).abs());
                    q[*c] = next;
                }
            }
            q = placed.close(split, q)?;
            if change < SETTLED {
                return Some(q);
            }
        }
        None
    }

    /// How far joints yield at a state.
    pub(crate) fn yielding(
        &self,
        efforts: &dyn Efforts,
        scalars: &[f64],
        q: &[f64],
    ) -> Option<Yielding> {
        let n = q.len();
        let mut out = Yielding {
            efforts: efforts.at(q)?,
            slopes: DMatrix::zeros(n, n),
        };
        let compliances: Vec<f64> = (0..n).map(|c| self.compliance(scalars, c).0).collect();
        if compliances.iter().any(|own| *own != 0.0) {
            for column in 0..n {
                let ends = [-STEP, STEP].map(|step| {
                    let mut moved = q.to_vec();
                    moved[column] += step;
                    efforts.at(&moved)
                });
                let [Some(before), Some(after)] = ends else {
                    return None;
                };
                for (row, compliance) in compliances.iter().enumerate() {
                    let slope = (after[row] - before[row]) / (2.0 * STEP);
                    out.slopes[(row, column)] = compliance * slope;
                }
            }
        }
        Some(out)
    }
}
