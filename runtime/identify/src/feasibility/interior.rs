//! An interior-point method for least squares over small cones.
//!
//! The method takes predictor and corrector steps along the central path in the scaling of Nesterov
//! and Todd, as for semidefinite programmes with a quadratic objective (Toh, Tutuncu and Todd,
//! 2007). Each step is itself a least-squares problem, solved by Householder's reflections, so that
//! neither the observations nor the scaling are squared. That reaches four to six digits more than
//! a solver that factors a squared or an indefinite matrix. Draws and searches, whose optimality
//! need not be proven, take quick steps instead, by products of rows ([`Precision::Quick`]).

use core::cell::OnceCell;

use pulp::Arch;

use super::cones::{Cone, Gap, Objective, add_gradient, estimated_gap, gap, remainder, residuals};
use super::normal::{Normal, Products};
use super::scaled::{Groups, Scaled, ScaledRows};
use super::symmetric::{
    Square, ZERO, cholesky, congruence, inner, inverse, one, plus, product, transposed, upper,
};
use super::triangle::Triangle;
use crate::qr_update::dot;

/// The largest number of steps.
const MAX_STEPS: usize = 120;
/// Where others may begin, the gap is still above this.
const CENTRAL_PART: f64 = 1e-2;
/// Duals are repaired when the complementarity is below this fraction of the objective.
const REPAIR_PART: f64 = 1e-2;
/// The largest number of repairs at each point.
const MAX_REPAIRS: usize = 2;

/// A point with the dual matrices of the cones.
#[derive(Clone, Debug)]
pub(super) struct Point {
    pub(super) x: Vec<f64>,
    pub(super) duals: Vec<Square>,
}

/// The result of the method.
#[derive(Clone, Debug)]
pub(super) struct InteriorOutcome {
    /// The point with the smallest gap.
    pub(super) best: Point,
    pub(super) gap: Gap,
    /// An earlier point, well inside the cones.
    pub(super) interior_point: Point,
    /// A point before that one, from which the optimum of similar observations is reached too.
    pub(super) central: Point,
}

/// The directions of one step.
struct Direction {
    x: Vec<f64>,
    /// The scaled direction of each cone's matrix.
    matrices: Vec<Square>,
    /// The scaled direction of each cone's dual.
    duals: Vec<Square>,
}

/// The linear system of one step.
struct Step<'a> {
    cones: &'a [Cone],
    scaled: Vec<Scaled>,
    block: ScaledRows<'a>,
    /// The rows of the objective with their residuals, both times sqrt(2).
    rows: &'a [Vec<f64>],
    residuals: Vec<f64>,
    linear: &'a [f64],
    factor: Factor,
}

/// The factor of the normal equations of one step.
enum Factor {
    /// By reflections of all rows.
    Reflected(Triangle),
    /// By the products of the objective's rows.
    Product(Normal),
}

impl Factor {
    fn solve(&self, g: &[f64]) -> Option<Vec<f64>> {
        match self {
            Factor::Reflected(triangle) => triangle.solve(g),
            Factor::Product(normal) => normal.solve(g),
        }
    }
}

/// How the factor of each step is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Precision {
    /// By reflections: the products of rows are never formed.
    Full,
    /// By products of rows, in a fraction of the time, and by reflections where rounding prevents
    /// it. The gap is an estimate in working precision that proves nothing.
    Quick,
}

impl Precision {
    /// The rounds in which the predicted and the corrected direction are solved for: the first
    /// solves, the others refine.
    fn rounds(self) -> [usize; 2] {
        match self {
            Precision::Full => [3, 3],
            Precision::Quick => [1, 2],
        }
    }

    /// The length of a step as a fraction of the distance to the border of the cones.
    fn step_part(self) -> f64 {
        match self {
            Precision::Full => 0.95,
            Precision::Quick => 0.98,
        }
    }

    /// The method stops after this many steps without a smaller gap.
    fn most_steps_without_gain(self) -> usize {
        match self {
            Precision::Full => 5,
            Precision::Quick => 2,
        }
    }
}

impl Step<'_> {
    /// Solves for the direction with these right-hand sides in the scaled cones.
    fn direction(&self, sides: &[Square], rounds: usize) -> Option<Direction> {
        let n = self.linear.len();
        let mut target = Vec::new();
        for ((cone, scaled), side) in self.cones.iter().zip(&self.scaled).zip(sides) {
            for (r, c) in upper(cone.size) {
                target.push(if r == c {
                    scaled.lambda[r] + side[r][r]
                } else {
                    core::f64::consts::SQRT_2 * side[r][c]
                });
            }
        }
        let mut x = vec![0.0; n];
        let mut seen = vec![0.0; target.len()];
        for _ in 0..rounds {
            // the gradient of the least squares over both kinds of rows, and of the linear part
            let over = Arch::new().dispatch(
                #[inline(always)]
                || -> Vec<f64> {
                    let rows = self.rows.iter().zip(&self.residuals);
                    rows.map(|(row, r)| -r - core::f64::consts::SQRT_2 * dot(&row[..n], &x))
                        .collect()
                },
            );
            let mut gradient: Vec<f64> = self.linear.iter().map(|c| -c).collect();
            add_gradient(self.rows, &over, core::f64::consts::SQRT_2, &mut gradient);
            let rest: Vec<f64> = target.iter().zip(&seen).map(|(t, s)| t - s).collect();
            self.block.add_products(&rest, &mut gradient);
            let more = self.factor.solve(&gradient)?;
            for (v, d) in x.iter_mut().zip(&more) {
                *v += d;
            }
            seen = self.block.along(&x);
        }
        let mut entries = seen.iter().copied();
        let matrices: Vec<Square> = self
            .cones
            .iter()
            .map(|cone| matrix(cone.size, &mut entries))
            .collect();
        let duals = sides
            .iter()
            .zip(&matrices)
            .map(|(side, m)| plus(side, m, -1.0))
            .collect();
        x.iter()
            .all(|d| d.is_finite())
            .then_some(Direction { x, matrices, duals })
    }

    /// The largest step along a direction that keeps matrices and duals in their cones.
    fn longest(&self, direction: &Direction) -> f64 {
        let each = self.cones.iter().zip(&self.scaled);
        let moves = direction.matrices.iter().zip(&direction.duals);
        each.zip(moves)
            .fold(f64::INFINITY, |most, ((cone, scaled), (m, s))| {
                most.min(scaled.step(m, cone.size))
                    .min(scaled.step(s, cone.size))
            })
    }

    /// The right-hand sides: the difference of the scaled complementarity to its target `mu`, with
    /// the second-order correction of a predicted direction.
    fn sides(&self, mu: f64, predicted: Option<&Direction>) -> Vec<Square> {
        let each = self.cones.iter().zip(&self.scaled).enumerate();
        each.map(|(k, (cone, scaled))| {
            if cone.size == 1 {
                let second = predicted.map_or(0.0, |d| d.matrices[k][0][0] * d.duals[k][0][0]);
                let l = scaled.lambda[0];
                let rest = mu + cone.logarithm - l * l - second;
                return one(rest / l);
            }
            let mut side = ZERO;
            let second = predicted.map_or(ZERO, |d| {
                let one = product(&d.matrices[k], &d.duals[k]);
                let both = plus(&one, &transposed(&one), 1.0);
                plus(&ZERO, &both, 0.5)
            });
            let l = &scaled.lambda;
            for r in 0..cone.size {
                for c in 0..cone.size {
                    let mut rest = -second[r][c];
                    if r == c {
                        rest += mu + cone.logarithm - l[r] * l[r];
                    }
                    side[r][c] = 2.0 * rest / (l[r] + l[c]);
                }
            }
            side
        })
        .collect()
    }
}

/// The duals with the smallest change, in their own scaling, for which they balance the gradient;
/// `None` if one would leave its cone.
fn repaired(
    objective: &Objective,
    cones: &[Cone],
    groups: &Groups,
    at: &Point,
) -> Option<Vec<Square>> {
    let scaled: Option<Vec<Scaled>> = cones
        .iter()
        .zip(&at.duals)
        .map(|(cone, dual)| Scaled::new(&cone.at(&at.x), dual, cone.size))
        .collect();
    let scaled = scaled?;
    let residuals = objective.residuals(&at.x);
    let (left, _) = remainder(objective, cones, &at.x, &residuals, &at.duals);
    let left: Vec<f64> = left.iter().map(super::sums::Sum::value).collect();
    let change = groups.rows(cones, &scaled).least_entries(&left)?;
    let mut entries = change.into_iter();
    let each = cones.iter().zip(&scaled).zip(&at.duals);
    let moved: Vec<Square> = each
        .map(|((cone, scaled), dual)| {
            let m = matrix(cone.size, &mut entries);
            let change = congruence(&transposed(&scaled.inverse), &m, cone.size);
            plus(dual, &change, 1.0)
        })
        .collect();
    let inside = cones
        .iter()
        .zip(&moved)
        .all(|(c, d)| cholesky(d, c.size).is_some());
    inside.then_some(moved)
}

/// Reads the next entries of an upper triangle, in which those off the diagonal are multiplied by
/// sqrt(2), as a matrix.
fn matrix(size: usize, entries: &mut impl Iterator<Item = f64>) -> Square {
    let mut m = ZERO;
    for (r, c) in upper(size) {
        let x = entries.next().unwrap_or(0.0);
        let x = if r == c {
            x
        } else {
            x / core::f64::consts::SQRT_2
        };
        m[r][c] = x;
        m[c][r] = x;
    }
    m
}

/// Minimises an objective over cones from a point strictly inside them.
///
/// - `reach`: the largest absolute value of each variable in the set;
/// - `goal`: the gap, as a fraction of the objective, at which the method stops;
/// - `precision`: of the steps; quick ones estimate the gap in working precision;
/// - `done`: another criterion to stop at a point.
///
/// `None` if the start is not strictly inside the cones.
pub(super) fn minimise(
    objective: &Objective,
    cones: &[Cone],
    reach: &[f64],
    start: Point,
    (goal, precision): (f64, Precision),
    done: &dyn Fn(&[f64]) -> bool,
) -> Option<InteriorOutcome> {
    let n = start.x.len();
    let root = core::f64::consts::SQRT_2;
    let degree = cones.iter().map(|c| c.size).sum::<usize>().max(1) as f64;
    // of the objective's rows alone, computed once
    let objective_products =
        (precision == Precision::Quick).then(|| Products::of(&objective.rows, n));
    let own = OnceCell::new();
    let groups = Groups::of(cones, n);

    let mut at = start;
    let (mut interior_point, mut central) = (at.clone(), at.clone());
    let mut best: Option<(Point, Gap)> = None;
    let mut since = 0;
    for _ in 0..MAX_STEPS {
        let mut found = match precision {
            Precision::Full => gap(objective, cones, reach, &at.x, &at.duals),
            Precision::Quick => estimated_gap(objective, cones, reach, &at.x, &at.duals),
        };
        // near the end the rounding of the duals dominates the gap
        if precision == Precision::Full
            && found.complementarity < REPAIR_PART * found.value
            && found.unbalanced > 0.1 * found.complementarity
        {
            for _ in 0..MAX_REPAIRS {
                let Some(duals) = repaired(objective, cones, &groups, &at) else {
                    break;
                };
                let better = gap(objective, cones, reach, &at.x, &duals);
                if better.part().is_nan() || better.part() >= found.part() {
                    break;
                }
                found = better;
                at.duals = duals;
            }
        }
        if found.part() > CENTRAL_PART {
            central.clone_from(&at);
        }
        if found.part() > 1e-3 {
            interior_point.clone_from(&at);
        }
        if best.as_ref().is_none_or(|(_, b)| found.part() < b.part()) {
            best = Some((at.clone(), found));
            since = 0;
        } else {
            since += 1;
        }
        let enough = found.part() <= goal || done(&at.x);
        let worn = since >= precision.most_steps_without_gain()
            && best.as_ref().is_some_and(|(_, b)| b.part() < 1e-2);
        if enough || worn {
            break;
        }
        let matrices: Vec<Square> = cones.iter().map(|c| c.at(&at.x)).collect();
        let scaled: Option<Vec<Scaled>> = cones
            .iter()
            .zip(matrices.iter().zip(&at.duals))
            .map(|(cone, (m, s))| Scaled::new(m, s, cone.size))
            .collect();
        let Some(scaled) = scaled else { break };
        let products = cones.iter().zip(matrices.iter().zip(&at.duals));
        let mu = products
            .map(|(cone, (m, s))| inner(m, s) - cone.logarithm * cone.size as f64)
            .sum::<f64>()
            / degree;
        let mu = mu.max(1e-3 * goal * found.value / degree);
        let block = groups.rows(cones, &scaled);
        let quick = objective_products
            .as_ref()
            .and_then(|products| products.with(&block));
        let factor = quick.map_or_else(
            || {
                let own = own.get_or_init(|| Triangle::of(&objective.rows, n, root));
                Factor::Reflected(block.reduced(own.clone()))
            },
            Factor::Product,
        );
        let step = Step {
            cones,
            scaled,
            block,
            rows: &objective.rows,
            residuals: match precision {
                Precision::Full => objective.residuals(&at.x),
                Precision::Quick => residuals(&objective.rows, &at.x),
            }
            .iter()
            .map(|r| root * r)
            .collect(),
            linear: &objective.linear,
            factor,
        };
        let [first, second] = precision.rounds();
        let Some(predicted) = step.direction(&step.sides(0.0, None), first) else {
            break;
        };
        let part = step.longest(&predicted).min(1.0);
        let centre = (1.0 - part).powi(3) * mu;
        let Some(direction) = step.direction(&step.sides(centre, Some(&predicted)), second) else {
            break;
        };
        let length = (precision.step_part() * step.longest(&direction)).min(1.0);
        if length.is_nan() || length < 1e-10 {
            break;
        }
        for (v, d) in at.x.iter_mut().zip(&direction.x) {
            *v += length * d;
        }
        let moved = step.cones.iter().zip(&step.scaled).zip(&direction.duals);
        for (dual, ((cone, scaled), d)) in at.duals.iter_mut().zip(moved) {
            let mut next = ZERO;
            for r in 0..cone.size {
                for c in 0..cone.size {
                    next[r][c] = length * d[r][c];
                }
                next[r][r] += scaled.lambda[r];
            }
            *dual = congruence(&transposed(&scaled.inverse), &next, cone.size);
        }
    }
    let (best, gap) = best?;
    Some(InteriorOutcome {
        best,
        gap,
        interior_point,
        central,
    })
}

/// A start at `x` with duals on the central path; `None` if `x` is not strictly inside.
pub(super) fn start(objective: &Objective, cones: &[Cone], x: Vec<f64>) -> Option<Point> {
    let degree = cones.iter().map(|c| c.size).sum::<usize>().max(1) as f64;
    let residuals = objective.residuals(&x);
    let squares: f64 = residuals.iter().map(|r| r * r).sum();
    let mu = squares.max(objective.floor) / degree;
    let dual = |cone: &Cone| {
        let l = cholesky(&cone.at(&x), cone.size)?;
        let l = inverse(&l, cone.size);
        let inverse = product(&transposed(&l), &l);
        Some(plus(&ZERO, &inverse, mu + cone.logarithm))
    };
    let duals: Option<Vec<Square>> = cones.iter().map(dual).collect();
    Some(Point { x, duals: duals? })
}
