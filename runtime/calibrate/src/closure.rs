//! Loops closed for any geometry: the closure equations, their derivatives, and the coordinates that
//! solve them.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use crate::kinematics::{Axis, Kinematics, Row};
use crate::placed::Placed;

/// The closure residual above which coordinates are not closed, m or 1.
const CLOSED: f64 = 1e-11;
/// The largest number of Newton's steps for one state.
const STEPS: usize = 12;
/// Parts of the way to a state, at most.
const MOST_PARTS: usize = 4096;

/// The closure equations f = 0 (Eq. 6) at a state, with their derivatives.
#[derive(Clone, Debug)]
pub struct Closure {
    /// The residual f, m or 1.
    pub residual: DVector<f64>,
    /// df/dq over all coordinates: A of Eq. 7.
    pub by_coordinate: DMatrix<f64>,
    /// df over the scalars of the geometry.
    pub by_scalar: DMatrix<f64>,
}

/// The coordinates that are given and those that follow from the closure.
#[derive(Clone, Debug, PartialEq)]
pub struct Split {
    /// The coordinates that drive the mechanism.
    pub driving: Vec<usize>,
    /// The coordinates that the loops determine.
    pub dependent: Vec<usize>,
}

/// A row's residual, and what multiplies the velocity and the angular velocity of side B less those
/// of side A, each given by its axes and its point. The velocity is that of the frame's own origin for a
/// position, else that at pB.
pub(crate) fn row(
    row: Row,
    [a, b]: [(&Matrix3<f64>, &Vector3<f64>); 2],
) -> (f64, Vector3<f64>, Vector3<f64>) {
    let gap = b.1 - a.1;
    let of_a = |axis: Axis| a.0.column(axis.index()).into_owned();
    let of_b = |axis: Axis| b.0.column(axis.index()).into_owned();
    match row {
        Row::Position(axis) => {
            let unit = Vector3::ith(axis.index(), 1.0);
            (gap[axis.index()], unit, Vector3::zeros())
        }
        Row::Axes(i, j) => {
            let (u, v) = (of_a(i), of_b(j));
            (u.dot(&v), Vector3::zeros(), v.cross(&u))
        }
        Row::Offset(axis) => {
            let u = of_a(axis);
            (u.dot(&gap), u, Vector3::zeros())
        }
        Row::Screw(lead) => {
            let [x, y, z] = [Axis::X, Axis::Y, Axis::Z].map(of_a);
            let (sin, cos) = libm::sincos(z.dot(&gap) / lead);
            let across = sin * x - cos * y;
            let xb = of_b(Axis::X);
            let along = (cos * x + sin * y).dot(&xb);
            (lead * across.dot(&xb), along * z, lead * xb.cross(&across))
        }
    }
}

impl Kinematics {
    /// The closure equations at a state, in the order of [`Kinematics::rows`].
    pub fn closure(&self, scalars: &[f64], q: &[f64]) -> Closure {
        let all = vec![true; self.scalars];
        Placed::new(self, scalars).closure(q, Some(&all))
    }

    /// Chooses the coordinates that drive the mechanism among those that are measured, the first
    /// ones first: the others of these are redundant, and compared with what follows from the loops.
    /// `None` if the measured ones do not determine the state at home.
    pub fn split(&self, scalars: &[f64], measured: &[usize]) -> Option<Split> {
        let all = self.coordinates.len();
        let a = Placed::new(self, scalars).closure(&self.home, None);
        let a = a.by_coordinate;
        // dependent first: what is not measured, then the last measured ones
        let mut order: Vec<usize> = (0..all).filter(|c| !measured.contains(c)).collect();
        let unmeasured = order.len();
        order.extend(measured.iter().rev());
        let mut basis: Vec<DVector<f64>> = Vec::new();
        let (mut dependent, mut driving) = (Vec::new(), Vec::new());
        for (k, c) in order.into_iter().enumerate() {
            let column = a.column(c).into_owned();
            let size = column.norm();
            let mut rest = column;
            for _ in 0..2 {
                for unit in &basis {
                    let part = unit.dot(&rest);
                    rest.axpy(-part, unit, 1.0);
                }
            }
            if rest.norm() > 1e-6 * size.max(1e-3) {
                let norm = rest.norm();
                basis.push(rest / norm);
                dependent.push(c);
            } else if k < unmeasured {
                return None;
            } else {
                driving.push(c);
            }
        }
        driving.sort_unstable();
        dependent.sort_unstable();
        Some(Split { driving, dependent })
    }

    /// The state with these driving coordinates that is reached from `start` along a straight line,
    /// on which dependent coordinates move as the loops lead them; `None` if none is reached.
    ///
    /// - `start`: a state that is closed.
    /// - `target`: the driving coordinates, in the order of [`Split::driving`].
    pub fn reach(
        &self,
        scalars: &[f64],
        split: &Split,
        start: &[f64],
        target: &[f64],
    ) -> Option<Vec<f64>> {
        Placed::new(self, scalars).reach(split, start, target)
    }

    /// Closes the loops by Newton's method, with the driving coordinates as they are.
    pub fn close(&self, scalars: &[f64], split: &Split, q: Vec<f64>) -> Option<Vec<f64>> {
        Placed::new(self, scalars).close(split, q)
    }
}

impl Placed<'_> {
    /// As [`Kinematics::reach`].
    pub(crate) fn reach(&self, split: &Split, start: &[f64], target: &[f64]) -> Option<Vec<f64>> {
        let mut q = start.to_vec();
        let from: Vec<f64> = split.driving.iter().map(|c| start[*c]).collect();
        let (mut done, mut part) = (0.0_f64, 1.0_f64);
        while done < 1.0 {
            let next = (done + part).min(1.0);
            let along = |k: usize| from[k] + next * (target[k] - from[k]);
            if let Some(reached) = self.advance(split, &q, along) {
                q = reached;
                done = next;
                part *= 2.0;
            } else {
                part *= 0.5;
                if part < 1.0 / MOST_PARTS as f64 {
                    return None;
                }
            }
        }
        Some(q)
    }

    /// One part of a way: a step along the tangent, then Newton's. `None` where the two differ by more
    /// than a part of the step, as another branch of the assembly would.
    fn advance(
        &self,
        split: &Split,
        q: &[f64],
        driving: impl Fn(usize) -> f64,
    ) -> Option<Vec<f64>> {
        let mut next = q.to_vec();
        let mut moved: f64 = 0.0;
        let mut shifts = DVector::zeros(split.driving.len());
        for (k, c) in split.driving.iter().enumerate() {
            shifts[k] = driving(k) - q[*c];
            moved = moved.max(shifts[k].abs());
            next[*c] = driving(k);
        }
        if split.dependent.is_empty() {
            return Some(next);
        }
        let closure = self.closure(q, None);
        let change = &closure.by_coordinate.select_columns(&split.driving) * shifts;
        let tangent = solve(&closure, split, &(-change))?;
        for (k, c) in split.dependent.iter().enumerate() {
            next[*c] += tangent[k];
            moved = moved.max(tangent[k].abs());
        }
        // a way of a tenth of a radian bends by its square at usual states
        if moved >= 0.5 {
            return None;
        }
        self.close_within(split, next, 0.2 * moved + 1e-9)
    }

    /// As [`Kinematics::close`].
    pub(crate) fn close(&self, split: &Split, q: Vec<f64>) -> Option<Vec<f64>> {
        self.close_within(split, q, f64::INFINITY)
    }

    /// The same, if no dependent coordinate moves by more than a bound. Where one moves by twice as much on
    /// the way, Newton's method leads elsewhere.
    fn close_within(&self, split: &Split, start: Vec<f64>, bound: f64) -> Option<Vec<f64>> {
        if split.dependent.is_empty() {
            return Some(start);
        }
        let mut q = start.clone();
        let mut last = f64::INFINITY;
        for _ in 0..STEPS {
            let closure = self.closure(&q, None);
            let step = solve(&closure, split, &(-&closure.residual))?;
            let mut off: f64 = 0.0;
            for (k, c) in split.dependent.iter().enumerate() {
                q[*c] += step[k];
                off = off.max((q[*c] - start[*c]).abs());
            }
            let size = step.amax();
            if !size.is_finite() || off > 2.0 * bound {
                return None;
            }
            // loops that more equations close than they have freedoms keep a residual that the
            // geometry's errors cause: what ends is the step
            if size < CLOSED || (size < 1e-8 && size >= 0.5 * last) {
                return (off <= bound).then_some(q);
            }
            last = size;
        }
        None
    }
}

/// The dependent coordinates' rates that solve A_e x = right in the least squares.
fn solve(closure: &Closure, split: &Split, right: &DVector<f64>) -> Option<DVector<f64>> {
    let right = DMatrix::from_column_slice(right.len(), 1, right.as_slice());
    let solved = dependent_rates(closure, split, &right)?;
    Some(solved.column(0).into_owned())
}

/// The part of a diagonal below which a factor is singular.
const SINGULAR: f64 = 1e-12;

/// The dependent coordinates' rates for several right sides of A_e x = right, in the least squares.
pub(crate) fn dependent_rates(
    closure: &Closure,
    split: &Split,
    right: &DMatrix<f64>,
) -> Option<DMatrix<f64>> {
    let a = closure.by_coordinate.select_columns(&split.dependent);
    if a.nrows() < a.ncols() {
        return None;
    }
    if a.is_square() {
        return solved(a, right.clone());
    }
    let qr = a.qr();
    let r = qr.r();
    is_regular(&r).then_some(())?;
    r.solve_upper_triangular(&(qr.q().tr_mul(right)))
}

/// What multiplies the closure equations where the dependent coordinates are to drop out of others: the x
/// of x A_e = left for each row of `left`, those of the least squares.
pub(crate) fn multipliers(
    closure: &Closure,
    split: &Split,
    left: &DMatrix<f64>,
) -> Option<DMatrix<f64>> {
    let a = closure.by_coordinate.select_columns(&split.dependent);
    if a.nrows() < a.ncols() {
        return None;
    }
    let right = left.transpose();
    if a.is_square() {
        return Some(solved(a.transpose(), right)?.transpose());
    }
    let qr = a.qr();
    let r = qr.r();
    is_regular(&r).then_some(())?;
    let solved = r.transpose().solve_lower_triangular(&right)?;
    Some((qr.q() * solved).transpose())
}

fn is_regular(factor: &DMatrix<f64>) -> bool {
    let diagonal = factor.diagonal();
    let largest = diagonal.amax();
    diagonal.iter().all(|d| d.abs() > SINGULAR * largest)
}

/// Solves a x = b; `None` if a is singular.
fn solved(a: DMatrix<f64>, mut b: DMatrix<f64>) -> Option<DMatrix<f64>> {
    let lu = a.lu();
    is_regular(lu.lu_internal()).then_some(())?;
    lu.solve_mut(&mut b).then_some(b)
}
