//! Loops closed for any geometry: the closure equations, their derivatives, and the coordinates that
//! solve them.

use nalgebra::{DMatrix, DVector, Vector3};

use crate::kinematics::{Amount, Axis, Kinematics, Row, View};

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
/// of side A. The velocity is that of the frame's own origin for a position, else that at pB.
fn row(row: Row, [a, b]: [&View; 2]) -> (f64, Vector3<f64>, Vector3<f64>) {
    let gap = b.point - a.point;
    match row {
        Row::Position(axis) => {
            let unit = Vector3::ith(axis.index(), 1.0);
            (gap[axis.index()], unit, Vector3::zeros())
        }
        Row::Axes(i, j) => {
            let (u, v) = (a.axis(i), b.axis(j));
            (u.dot(&v), Vector3::zeros(), v.cross(&u))
        }
        Row::Offset(axis) => {
            let u = a.axis(axis);
            (u.dot(&gap), u, Vector3::zeros())
        }
        Row::Screw(lead) => {
            let [x, y, z] = [Axis::X, Axis::Y, Axis::Z].map(|axis| a.axis(axis));
            let (sin, cos) = libm::sincos(z.dot(&gap) / lead);
            let across = sin * x - cos * y;
            let xb = b.axis(Axis::X);
            let along = (cos * x + sin * y).dot(&xb);
            (lead * across.dot(&xb), along * z, lead * xb.cross(&across))
        }
    }
}

impl Kinematics {
    /// The closure equations at a state, in the order of [`Kinematics::rows`].
    pub fn closure(&self, scalars: &[f64], q: &[f64]) -> Closure {
        self.closure_by(scalars, q, self.scalars)
    }

    /// The same with derivatives by this many of the scalars.
    fn closure_by(&self, scalars: &[f64], q: &[f64], slopes: usize) -> Closure {
        let rows = self.rows();
        let mut out = Closure {
            residual: DVector::zeros(rows),
            by_coordinate: DMatrix::zeros(rows, self.coordinates.len()),
            by_scalar: DMatrix::zeros(rows, slopes),
        };
        let links = self.links_by(scalars, q, slopes > 0);
        let mut at = 0;
        for cut in &self.cuts {
            let [a, b] =
                [0, 1].map(|k| self.along_by(&links, &cut.sides[k], (scalars, q), slopes > 0));
            for equation in &cut.rows {
                let (residual, linear, angular) = row(*equation, [&a, &b]);
                out.residual[at] = residual;
                for (view, sign) in [(&a, -1.0), (&b, 1.0)] {
                    let point = match equation {
                        Row::Position(_) => view.point,
                        _ => b.point,
                    };
                    for motion in &view.motions {
                        if matches!(motion.amount, Amount::Scalar(k) if k >= slopes) {
                            continue;
                        }
                        let value = linear.dot(&motion.velocity_of(&point))
                            + angular.dot(&motion.turning());
                        let value = sign * value;
                        match motion.amount {
                            Amount::Coordinate(c, _) => out.by_coordinate[(at, c)] += value,
                            Amount::Scalar(k) => out.by_scalar[(at, k)] += value,
                        }
                    }
                }
                at += 1;
            }
        }
        for coupling in &self.couplings {
            out.residual[at] = -coupling.constant;
            let terms = coupling.terms.iter().map(|(c, factor)| (*c, -factor));
            for (c, factor) in terms.chain([(coupling.key, 1.0)]) {
                let own = q.get(c).copied().unwrap_or(0.0);
                let (scale, place) = self.scale(scalars, c);
                out.residual[at] += factor * scale * own;
                out.by_coordinate[(at, c)] += factor * scale;
                if let Some(place) = place.filter(|place| *place < slopes) {
                    out.by_scalar[(at, place)] += factor * own;
                }
            }
            at += 1;
        }
        out
    }

    /// Chooses the coordinates that drive the mechanism among those that are measured, the first
    /// ones first: the others of these are redundant, and compared with what follows from the loops.
    /// `None` if the measured ones do not determine the state at home.
    pub fn split(&self, scalars: &[f64], measured: &[usize]) -> Option<Split> {
        let all = self.coordinates.len();
        let a = self.closure(scalars, &self.home).by_coordinate;
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
        let mut q = start.to_vec();
        let from: Vec<f64> = split.driving.iter().map(|c| start[*c]).collect();
        let (mut done, mut part) = (0.0_f64, 1.0_f64);
        while done < 1.0 {
            let next = (done + part).min(1.0);
            let along = |k: usize| from[k] + next * (target[k] - from[k]);
            if let Some(reached) = self.advance(scalars, split, &q, along) {
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
        scalars: &[f64],
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
        let closure = self.closure_by(scalars, q, 0);
        let change = &closure.by_coordinate.select_columns(&split.driving) * shifts;
        let tangent = solve(&closure, split, &(-change))?;
        for (k, c) in split.dependent.iter().enumerate() {
            next[*c] += tangent[k];
            moved = moved.max(tangent[k].abs());
        }
        let predicted = next.clone();
        let closed = self.close(scalars, split, next)?;
        let off = split.dependent.iter();
        let off = off.map(|c| (closed[*c] - predicted[*c]).abs());
        // a way of a tenth of a radian bends by its square at usual states
        (moved < 0.5 && off.fold(0.0, f64::max) <= 0.2 * moved + 1e-9).then_some(closed)
    }

    /// Closes the loops by Newton's method, with the driving coordinates as they are.
    pub fn close(&self, scalars: &[f64], split: &Split, mut q: Vec<f64>) -> Option<Vec<f64>> {
        if split.dependent.is_empty() {
            return Some(q);
        }
        let mut last = f64::INFINITY;
        for _ in 0..STEPS {
            let closure = self.closure_by(scalars, &q, 0);
            let step = solve(&closure, split, &(-&closure.residual))?;
            for (k, c) in split.dependent.iter().enumerate() {
                q[*c] += step[k];
            }
            let size = step.amax();
            if !size.is_finite() {
                return None;
            }
            // loops that more equations close than they have freedoms keep a residual that the
            // geometry's errors cause: what ends is the step
            if size < CLOSED || (size < 1e-8 && size >= 0.5 * last) {
                return Some(q);
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
    let square = a.nrows() == a.ncols();
    if square {
        let lu = a.lu();
        let diagonal = lu.u().diagonal();
        let largest = diagonal.amax();
        if diagonal.iter().any(|d| d.abs() <= 1e-12 * largest) {
            return None;
        }
        return lu.solve(right);
    }
    let qr = a.qr();
    let r = qr.r();
    let largest = r.diagonal().amax();
    if r.diagonal().iter().any(|d| d.abs() <= 1e-12 * largest) {
        return None;
    }
    let rotated = qr.q().transpose() * right;
    r.solve_upper_triangular(&rotated)
}
