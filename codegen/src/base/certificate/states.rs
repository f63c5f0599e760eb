//! Random closed states on the assembly branch of home.
//!
//! The states are found by a walk in small steps of double precision: the independent coordinates
//! move towards a random target, the dependent ones follow by linear prediction and Newton's
//! method. Where the independent coordinates are a poor choice, so that others move far more than they do, the
//! walk goes along the tangents of the closure instead, in which no coordinate is distinguished. A step that
//! nears a singularity, crosses one, jumps to another assembly branch or leaves
//! a coordinate's limits is rejected. At the end of each leg of the walk, Newton's method in
//! multiple precision refines the state.

use crate::constraints::{Equations, NumericLoops};
use crate::model::Model;
use crate::numeric::solve_pivoted;
use crate::sym::Graph;

use super::CertificateError;
use super::evaluate::Evaluator;
use super::float320::Float320;
use super::linear::solve;
use super::units::Units;

/// The least pivot ratio of A_e, or a tenth of that at home if that is less; a step that brings A_e
/// closer to singular is rejected.
const MIN_PIVOT_RATIO: f64 = 1e-3;
/// The largest change of an angle in a step, rad.
const MAX_TURN_RAD: f64 = 0.18;
/// The largest change of a prismatic coordinate in a step, as a fraction of its range.
const MAX_SLIDE_FRACTION: f64 = 0.03;
/// The least and largest number of steps of a leg.
const LEG_STEPS: (u32, u32) = (5, 14);
/// The largest correction of a joint by Newton's method, as a fraction of the largest predicted
/// change of any joint; a larger one could be a jump to another assembly branch.
const MAX_CORRECTION_FRACTION: f64 = 0.25;
/// Largest closure residual in double precision, as a fraction of the mechanism's size.
const CLOSURE_TOLERANCE: f64 = 1e-11;
/// log10 of the largest closure residual in multiple precision: 1e-80.
const CLOSURE_TOLERANCE_LOG10: f64 = -80.0;
/// Largest number of Newton steps in multiple precision. They start from a solution in double
/// precision, and each doubles the number of digits.
const MAX_NEWTON_STEPS: usize = 6;
/// Number of legs that may fail in a row before the walk restarts at home.
const MAX_FAILED_LEGS: usize = 4;
/// Number of restarts before the search for a state ends.
const MAX_RESTARTS: usize = 25;

/// Reproducible pseudo-random numbers.
#[derive(Clone, Debug)]
pub(in crate::base) struct Random(u64);

impl Random {
    pub(in crate::base) fn new(seed: u64) -> Random {
        Random(seed)
    }

    /// The next number, uniform in [-1, 1).
    pub(super) fn next(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    /// The next number, uniform in a range.
    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * 0.5 * (self.next() + 1.0)
    }

    /// The next 64 bits.
    pub(in crate::base) fn bits(&mut self) -> u64 {
        // splitmix64: Steele, Lea and Flood 2014
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }
}

/// A state that satisfies the closure equations, in multiple precision.
#[derive(Clone, Debug)]
pub(super) struct State {
    /// Values of all coordinates, rad or m.
    pub(super) q: Vec<Float320>,
    /// J with qd = J qd_i: one row per coordinate, one column per independent coordinate.
    pub(super) j: Vec<Vec<Float320>>,
}

/// A walk through the mechanism's closed states.
#[derive(Debug)]
pub(super) struct Walk<'a> {
    model: &'a Model,
    loops: NumericLoops<'a>,
    wide: Evaluator<'a>,
    rows: usize,
    random: Random,
    /// The permitted range of each coordinate.
    ranges: Vec<[f64; 2]>,
    /// The largest step of each independent coordinate.
    largest_steps: Vec<f64>,
    min_pivot_ratio: f64,
    closure_tolerance: f64,
    home: Vec<f64>,
    q: Vec<f64>,
    /// The largest step of each coordinate, by which tangents are measured.
    units: Vec<f64>,
    /// Whether steps are along the tangents of the closure, whichever coordinates are independent.
    is_tangential: bool,
}

impl<'a> Walk<'a> {
    /// Begins at home. The error says that home does not close in multiple precision.
    pub(super) fn new(
        g: &'a Graph,
        equations: &Equations,
        model: &'a Model,
        home: &[f64],
        seed: u64,
        units: Units,
    ) -> Result<Walk<'a>, CertificateError> {
        let jacobian = equations.jacobian.iter().flatten();
        let roots = equations.residual.iter().chain(jacobian).copied();
        let loops = NumericLoops::new(g, equations, model);
        let mut size = 1.0;
        let mut ratio = 1.0;
        if !model.dependent.is_empty() {
            let (_, a) = loops.at(home);
            ratio = pivot_ratio(&dependent(model, &a));
            size = a.iter().flatten().fold(size, |m: f64, x| m.max(x.abs()));
        }
        let mut ranges: Vec<[f64; 2]> = (0..model.coordinates.len())
            .map(|c| range(model, home, c, units))
            .collect();
        for (follower, _) in crate::model::contradicting_limits(model) {
            ranges[follower] = [f64::NEG_INFINITY, f64::INFINITY];
        }
        let independent = model.independent.iter();
        let walk = Walk {
            largest_steps: independent
                .map(|c| largest_step(model, &ranges, home, *c, units))
                .collect(),
            model,
            wide: Evaluator::new(g, roots.collect()),
            loops,
            rows: equations.residual.len(),
            random: Random::new(seed),
            ranges,
            min_pivot_ratio: MIN_PIVOT_RATIO.min(0.1 * ratio),
            closure_tolerance: CLOSURE_TOLERANCE * size,
            home: home.to_vec(),
            q: home.to_vec(),
            units: Vec::new(),
            is_tangential: false,
        };
        let all = 0..model.coordinates.len();
        let walk = Walk {
            units: all
                .map(|c| largest_step(model, &walk.ranges, home, c, units))
                .collect(),
            ..walk
        };
        match walk.polish(home) {
            Some(_) => Ok(walk),
            None => Err(CertificateError::Inexact),
        }
    }

    /// The random numbers of the walk.
    pub(super) fn random(&mut self) -> &mut Random {
        &mut self.random
    }

    /// The state at home.
    pub(super) fn at_home(&self) -> Option<State> {
        self.polish(&self.home)
    }

    /// The next state, or `None` if the walk cannot continue.
    ///
    /// Where no state is found within all limits, those of the dependent coordinates are left out from
    /// then on: they keep states usual, but any closed state on the branch counts. So it is where
    /// drives are independent, and a joint that follows them has a narrow range. Where none is found
    /// either way, the walk goes along the tangents of the closure from then on.
    pub(super) fn next(&mut self) -> Option<State> {
        if let Some(state) = self.search().or_else(|| self.search_without_limits()) {
            return Some(state);
        }
        if self.is_tangential || self.model.dependent.is_empty() {
            return None;
        }
        self.is_tangential = true;
        self.search()
    }

    /// The next state without the limits of dependent coordinates; `None` if they have none.
    fn search_without_limits(&mut self) -> Option<State> {
        let mut freed = false;
        for &c in &self.model.dependent {
            freed |= self.ranges[c][0].is_finite();
            self.ranges[c] = [f64::NEG_INFINITY, f64::INFINITY];
        }
        if freed { self.search() } else { None }
    }

    /// The next state within the ranges.
    fn search(&mut self) -> Option<State> {
        for _ in 0..MAX_RESTARTS {
            for _ in 0..MAX_FAILED_LEGS {
                if self.leg()
                    && let Some(state) = self.polish(&self.q)
                {
                    return Some(state);
                }
            }
            // no leg from here leads to a state: restart at home
            self.q.clone_from(&self.home);
        }
        None
    }

    /// Walks one leg; false if it could not move at all.
    fn leg(&mut self) -> bool {
        if self.model.dependent.is_empty() {
            for &c in &self.model.independent {
                let turn = core::f64::consts::PI;
                let [low, high] = match self.ranges[c] {
                    [low, _] if low.is_infinite() => [-turn, turn],
                    range => range,
                };
                self.q[c] = self.random.between(low, high);
            }
            return true;
        }
        let (least, most) = LEG_STEPS;
        let steps = least + (self.random.bits() % u64::from(most - least + 1)) as u32;
        if self.is_tangential {
            return self.tangential_leg(steps);
        }
        let count = f64::from(steps);
        let mut step = vec![0.0; self.model.independent.len()];
        let independent = self.model.independent.iter().zip(&self.largest_steps);
        for (d, (&c, &length)) in step.iter_mut().zip(independent) {
            let [low, high] = self.ranges[c];
            if low.is_infinite() {
                *d = length * self.random.next();
                continue;
            }
            // the leg covers a fraction of the way to a random target, so that ratios of the rates
            // vary
            let way = self.random.between(low, high) - self.q[c];
            *d = way.clamp(-count * length, count * length) / count;
        }
        let before = self.q.clone();
        let mut last = before.clone();
        for _ in 0..steps {
            let Some(next) = self.step(&self.q, &step) else {
                // undo the last step before the obstacle
                self.q = last;
                break;
            };
            last = core::mem::replace(&mut self.q, next);
        }
        self.q != before
    }

    /// Walks one leg along the tangents of the closure, in a direction that goes on as straight as they
    /// allow; false if it could not move at all.
    fn tangential_leg(&mut self, steps: u32) -> bool {
        let n = self.q.len();
        let direction: Vec<f64> = (0..n).map(|_| self.random.next()).collect();
        let size = self.random.between(0.2, 1.0);
        let (before, mut direction) = (self.q.clone(), direction);
        let mut last = before.clone();
        for _ in 0..steps {
            let Some((next, along)) = self.tangential_step(&self.q, &direction, size) else {
                // undo the last step before the obstacle
                self.q = last;
                break;
            };
            direction = along;
            last = core::mem::replace(&mut self.q, next);
        }
        self.q != before
    }

    /// Takes a small step along the tangent that is nearest to a direction, in which the coordinate that
    /// moves most moves by this part of its largest step. Returns the state and the tangent, or `None` if
    /// the step must be rejected.
    ///
    /// Newton's steps are across the tangents: were the independent coordinates kept, an error would be
    /// corrected by far larger moves where they are a poor choice.
    fn tangential_step(
        &self,
        from: &[f64],
        direction: &[f64],
        size: f64,
    ) -> Option<(Vec<f64>, Vec<f64>)> {
        let (_, a) = self.loops.at(from);
        let a_before = dependent(self.model, &a);
        let (tangents, _) = self.tangents(&a, None)?;
        let mut along = projected(&tangents, direction);
        let most = along.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        if most.is_nan() || most <= 0.0 {
            return None;
        }
        for x in &mut along {
            *x /= most;
        }
        let pairs = from.iter().zip(along.iter().zip(&self.units));
        let start: Vec<f64> = pairs.map(|(q, (x, unit))| q + size * x * unit).collect();
        let mut q = start.clone();
        let mut a_after = None;
        for _ in 0..8 {
            let (f, a) = self.loops.at(&q);
            let largest = f.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
            let (tangents, correction) = self.tangents(&a, Some(&f))?;
            if largest <= self.closure_tolerance {
                a_after = Some(dependent(self.model, &a));
                break;
            }
            let within = projected(&tangents, &correction);
            let moves = correction.iter().zip(&within).zip(&self.units);
            for (q, ((x, inside), unit)) in q.iter_mut().zip(moves) {
                *q += (x - inside) * unit;
            }
        }
        let a_after = a_after?;
        let moves = q.iter().zip(&start).zip(&self.units);
        let corrected = moves.fold(0.0, |m: f64, ((a, b), unit)| m.max(((a - b) / unit).abs()));
        let inside = q
            .iter()
            .zip(&self.ranges)
            .all(|(q, [low, high])| (low..=high).contains(&q));
        (inside && corrected <= MAX_CORRECTION_FRACTION * size && same_side(&a_before, &a_after))
            .then_some((q, along))
    }

    /// An orthonormal basis of the tangents of the closure, and the step of the dependent coordinates
    /// that closes the loops to first order, both in parts of the largest steps. `None` too close to a
    /// singularity.
    ///
    /// - `f`: the residuals; without them the step is 0.
    fn tangents(&self, a: &[Vec<f64>], f: Option<&[f64]>) -> Option<(Vec<Vec<f64>>, Vec<f64>)> {
        let model = self.model;
        let sides = a.iter().enumerate().map(|(row, own)| {
            let rates = model.independent.iter().map(|&c| -own[c]);
            let residual = f.and_then(|f| f.get(row)).map_or(0.0, |x| -x);
            rates.chain([residual]).collect()
        });
        let solved = solve_pivoted(dependent(model, a), sides.collect());
        let ratio = solved.pivot_ratio;
        if ratio.is_nan() || ratio <= self.min_pivot_ratio {
            return None;
        }
        let width = model.independent.len();
        let mut columns = vec![vec![0.0; self.units.len()]; width + 1];
        for (k, &c) in model.independent.iter().enumerate() {
            columns[k][c] = 1.0 / self.units[c];
        }
        for (&c, row) in model.dependent.iter().zip(&solved.solution) {
            for (column, x) in columns.iter_mut().zip(row) {
                column[c] = x / self.units[c];
            }
        }
        let correction = columns.pop()?;
        let mut basis: Vec<Vec<f64>> = Vec::with_capacity(width);
        for mut column in columns {
            // twice is enough (Giraud et al. 2005)
            for _ in 0..2 {
                let within = projected(&basis, &column);
                for (x, y) in column.iter_mut().zip(within) {
                    *x -= y;
                }
            }
            let length = column.iter().map(|x| x * x).sum::<f64>().sqrt();
            for x in &mut column {
                *x /= length;
            }
            basis.push(column);
        }
        Some((basis, correction))
    }

    /// Takes a small step of the independent coordinates; `None` if it must be rejected.
    fn step(&self, from: &[f64], step: &[f64]) -> Option<Vec<f64>> {
        let model = self.model;
        let (_, a) = self.loops.at(from);
        let a_before = dependent(model, &a);
        let mut q = from.to_vec();
        for (c, d) in model.independent.iter().zip(step) {
            q[*c] += d;
        }
        let rates = a.iter().map(|row| {
            let terms = model.independent.iter().zip(step);
            vec![-terms.map(|(&c, d)| row[c] * d).sum::<f64>()]
        });
        let solved = solve_pivoted(a_before.clone(), rates.collect());
        // drives move much farther than joints and say nothing about the branch
        let is_joint = |c: &usize| !model.drives.contains(c);
        let mut moved = 0.0_f64;
        for (c, d) in model.dependent.iter().zip(&solved.solution) {
            q[*c] += d[0];
            if is_joint(c) {
                moved = moved.max(d[0].abs());
            }
        }
        let start = q.clone();
        let a_after = self.close(&mut q)?;
        let joints = model.dependent.iter().filter(|c| is_joint(c));
        let corrections = joints.map(|&c| (q[c] - start[c]).abs());
        let corrected = corrections.fold(0.0, f64::max);
        let given = model.independent.iter().zip(step);
        let given = given.filter(|(c, _)| is_joint(c));
        let turned = given.fold(moved, |m, (_, d)| m.max(d.abs()));
        let inside = q
            .iter()
            .zip(&self.ranges)
            .all(|(q, [low, high])| (low..=high).contains(&q));
        (inside && corrected <= MAX_CORRECTION_FRACTION * turned && same_side(&a_before, &a_after))
            .then_some(q)
    }

    /// Closes the loops by Newton's method in double precision. Returns A_e at the solution; `None`
    /// if A_e is too close to singular or the method does not converge.
    fn close(&self, q: &mut [f64]) -> Option<Vec<Vec<f64>>> {
        for _ in 0..8 {
            let (f, a) = self.loops.at(q);
            let a_e = dependent(self.model, &a);
            let size = f.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
            let rhs = f.iter().map(|x| vec![-x]).collect();
            let solved = solve_pivoted(a_e.clone(), rhs);
            // this also rejects NaN
            if !(size.is_finite() && solved.pivot_ratio > self.min_pivot_ratio) {
                return None;
            }
            if size <= self.closure_tolerance {
                return Some(a_e);
            }
            for (c, d) in self.model.dependent.iter().zip(&solved.solution) {
                q[*c] += d[0];
            }
        }
        None
    }

    /// The closed state that the independent coordinates reach from a state at some rates after a
    /// short time, s; `None` if the loops do not close there.
    pub(super) fn after(&self, state: &State, qd: &[Float320], time: Float320) -> Option<State> {
        let moved = state.q.iter().zip(qd);
        self.refine(moved.map(|(q, qd)| *q + *qd * time).collect())
    }

    /// Refines a state of double precision.
    fn polish(&self, q: &[f64]) -> Option<State> {
        self.refine(q.iter().map(|x| Float320::from_f64(*x)).collect())
    }

    /// Closes a state in multiple precision, by Newton's method over the dependent coordinates.
    fn refine(&self, mut q: Vec<Float320>) -> Option<State> {
        let model = self.model;
        let width = model.independent.len();
        let mut j = vec![vec![Float320::ZERO; width]; q.len()];
        for (k, &c) in model.independent.iter().enumerate() {
            j[c][k] = Float320::ONE;
        }
        if model.dependent.is_empty() {
            return Some(State { q, j });
        }
        for _ in 0..MAX_NEWTON_STEPS {
            let mut values = self.wide.run(&q)?;
            let jacobian = values.split_off(self.rows);
            let a: Vec<&[Float320]> = jacobian.chunks(q.len()).collect();
            let pick = |columns: &[usize]| -> Vec<Vec<Float320>> {
                a.iter()
                    .map(|row| columns.iter().map(|&c| row[c]).collect())
                    .collect()
            };
            let residual_log10 = values
                .iter()
                .fold(f64::NEG_INFINITY, |m, f| m.max(f.log10()));
            if residual_log10 < CLOSURE_TOLERANCE_LOG10 {
                let x = solve(pick(&model.dependent), pick(&model.independent))?;
                for (&c, row) in model.dependent.iter().zip(x) {
                    j[c] = row.into_iter().map(|x| -x).collect();
                }
                return Some(State { q, j });
            }
            let residual = values.into_iter().map(|f| vec![f]).collect();
            let step = solve(pick(&model.dependent), residual)?;
            for (&c, d) in model.dependent.iter().zip(step) {
                q[c] = q[c] - d[0];
            }
        }
        None
    }
}

/// The permitted range of a coordinate: its limits, if home is within them; otherwise a range about
/// home for independent prismatic joints, and no bounds for angles, drives and dependent
/// coordinates.
fn range(model: &Model, home: &[f64], c: usize, units: Units) -> [f64; 2] {
    if let Some([low, high]) = model.coordinates[c].position
        && low < high
        && (low..=high).contains(&home[c])
    {
        return [low, high];
    }
    let slides = model.slides(c) && model.independent.contains(&c);
    let reach = if slides && !model.drives.contains(&c) {
        slide(home[c], units)
    } else {
        f64::INFINITY
    };
    [home[c] - reach, home[c] + reach]
}

/// How far a prismatic coordinate without limits may go from home, m.
fn slide(home: f64, units: Units) -> f64 {
    0.75 * home.abs().max(0.4 * units.metres())
}

/// The largest change of a coordinate in a step; for a drive, that which moves its joints as far.
fn largest_step(model: &Model, ranges: &[[f64; 2]], home: &[f64], c: usize, units: Units) -> f64 {
    if let Some(form) = model.form_of_drive(c) {
        let of = |j: usize| largest_step(model, ranges, home, j, units);
        let terms = form.terms.iter();
        return terms.map(|(j, k)| k.to_f64().abs() * of(*j)).sum();
    }
    if !model.slides(c) {
        return MAX_TURN_RAD;
    }
    let [low, high] = ranges[c];
    let length = high - low;
    MAX_SLIDE_FRACTION
        * if length.is_finite() {
            length
        } else {
            2.0 * slide(home[c], units)
        }
}

/// The part of a vector in the span of orthonormal ones.
fn projected(basis: &[Vec<f64>], vector: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; vector.len()];
    for own in basis {
        let part: f64 = own.iter().zip(vector).map(|(a, b)| a * b).sum();
        for (x, y) in out.iter_mut().zip(own) {
            *x += part * y;
        }
    }
    out
}

/// A_e: the dependent columns of all rows.
fn dependent(model: &Model, a: &[Vec<f64>]) -> Vec<Vec<f64>> {
    a.iter()
        .map(|row| model.dependent.iter().map(|&c| row[c]).collect())
        .collect()
}

fn pivot_ratio(a_e: &[Vec<f64>]) -> f64 {
    solve_pivoted(a_e.to_vec(), vec![vec![]; a_e.len()]).pivot_ratio
}

/// Whether no singularity lies between two close matrices of full column rank.
///
/// With more rows than columns there is no determinant, and which rows matter changes as the
/// mechanism moves; but the determinant of `A^T B` is the sum over all choices of rows of the
/// products of both determinants (Cauchy and Binet), positive for close matrices and negative
/// across a singularity.
fn same_side(a: &[Vec<f64>], b: &[Vec<f64>]) -> bool {
    let n = a.first().map_or(0, Vec::len);
    let product: Vec<Vec<f64>> = (0..n)
        .map(|i| {
            (0..n)
                .map(|j| a.iter().zip(b).map(|(x, y)| x[i] * y[j]).sum())
                .collect()
        })
        .collect();
    determinant_is_positive(product)
}

fn determinant_is_positive(mut m: Vec<Vec<f64>>) -> bool {
    let n = m.len();
    let mut positive = true;
    for k in 0..n {
        let largest = (k..n).max_by(|&i, &j| m[i][k].abs().total_cmp(&m[j][k].abs()));
        let row = largest.unwrap_or(k);
        if row != k {
            m.swap(k, row);
            positive = !positive;
        }
        let pivot = m[k].clone();
        if pivot[k] == 0.0 {
            return false;
        }
        positive ^= pivot[k] < 0.0;
        for other in m.iter_mut().skip(k + 1) {
            let factor = other[k] / pivot[k];
            for (x, p) in other.iter_mut().zip(&pivot).skip(k) {
                *x -= factor * p;
            }
        }
    }
    positive
}

#[cfg(test)]
mod tests;
