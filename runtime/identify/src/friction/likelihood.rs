//! How well the shapes that a joint's friction may have explain the efforts.
//!
//! Where few samples are slow, friction with a high and narrow peak at low velocities explains them as well as
//! one with a low and wide peak: the likelihood has long ridges and several tops, which no linearisation at
//! one of them shows. So it is computed on a grid over all shapes, whose cells are divided where only few of
//! them explain the efforts. All linear parameters are the best for each shape (profile likelihood).

use super::FrictionData;
use super::columns::curved;
use crate::estimate::EstimateError;
use regen_runtime::Friction;
use regen_runtime::friction::SHAPES;

/// The number of cells in the direction of each shape parameter of a law with two, and of a law with one.
const CELLS: [usize; SHAPES] = [16, 5];
const CELLS_OF_ONE: usize = 24;
/// How often cells are divided.
const MAX_ROUNDS: usize = 3;
/// Cells whose likelihood is `exp(-8)` of the highest one do not count.
const NEGLIGIBLE: f64 = 8.0;
/// The grid is divided if less than this part of a direction counts.
const DENSE_PART: f64 = 0.5;

/// The squared residuals over a grid of shapes.
#[derive(Clone, Debug)]
pub(super) struct ShapeGrid {
    law: Friction,
    /// The number of cells in each direction.
    counts: [usize; SHAPES],
    /// The logarithms of the ends of the grid in each direction.
    ends: [(f64, f64); SHAPES],
    /// The sum of the squared residuals at the middle of each cell, direction after direction.
    costs: Vec<f64>,
}

impl ShapeGrid {
    /// Computes the costs over these ranges of the shape parameters.
    ///
    /// - `data`: equations with the friction of this joint alone.
    pub(super) fn over(
        data: &FrictionData,
        law: Friction,
        ranges: [(f64, f64); SHAPES],
    ) -> Result<Self, EstimateError> {
        let counts = match law.shape_symbols().len() {
            0 => [1, 1],
            1 => [CELLS_OF_ONE, 1],
            _ => CELLS,
        };
        let ends = ranges.map(|(low, high)| (libm::log(low), libm::log(high)));
        Self::with_ends(data, law, counts, ends)
    }

    fn with_ends(
        data: &FrictionData,
        law: Friction,
        counts: [usize; SHAPES],
        ends: [(f64, f64); SHAPES],
    ) -> Result<Self, EstimateError> {
        let mut out = Self {
            law,
            counts,
            ends,
            costs: Vec::new(),
        };
        for cell in 0..counts.iter().product() {
            let shape = out.shape(cell, [0.5; SHAPES]);
            out.costs.push(cost(data, law, shape)?);
        }
        Ok(out)
    }

    /// A shape within a cell; `part`: where in it, from 0 to 1 in each direction.
    fn shape(&self, cell: usize, part: [f64; SHAPES]) -> [f64; SHAPES] {
        let mut rest = cell;
        let mut out = [1.0; SHAPES];
        let directions = self.counts.iter().zip(&self.ends).zip(part);
        for (value, ((count, (low, high)), part)) in out.iter_mut().zip(directions) {
            let place = (rest % count) as f64 + part;
            rest /= count;
            *value = libm::exp(low + (high - low) * place / *count as f64);
        }
        out
    }

    /// The shape in the middle of the best cell, with its squared residuals.
    pub(super) fn best(&self) -> ([f64; SHAPES], f64) {
        let all = self.costs.iter().copied().enumerate();
        let best = all.min_by(|a, b| a.1.total_cmp(&b.1));
        let (cell, cost) = best.unwrap_or((0, f64::INFINITY));
        (self.shape(cell, [0.5; SHAPES]), cost)
    }

    /// The weight of each cell by its likelihood; the highest one is 1.
    ///
    /// - `noise`: the squared residuals of one independent row.
    fn weights(&self, noise: f64) -> Vec<f64> {
        let least = self.costs.iter().copied().fold(f64::INFINITY, f64::min);
        let weight = |cost: &f64| {
            let below = 0.5 * (cost - least) / noise;
            // also where the cost is no number
            if below < NEGLIGIBLE {
                libm::exp(-below)
            } else {
                0.0
            }
        };
        self.costs.iter().map(weight).collect()
    }

    /// The grid with smaller cells where only few of them count.
    pub(super) fn divided(self, data: &FrictionData, noise: f64) -> Result<Self, EstimateError> {
        let mut grid = self;
        for _ in 0..MAX_ROUNDS {
            let weights = grid.weights(noise);
            let mut ends = grid.ends;
            let mut is_denser = false;
            let mut stride = 1;
            for (count, (low, high)) in grid.counts.iter().zip(&mut ends) {
                let places = weights.iter().enumerate().filter(|(_, w)| **w > 0.0);
                let places = places.map(|(cell, _)| cell / stride % count);
                let (first, last) = places.fold((*count, 0), |(a, b), x| (a.min(x), b.max(x)));
                stride *= count;
                // one cell more on either side, whose middle does not count but whose near half may
                let (first, last) = (first.saturating_sub(1), (last + 2).min(*count));
                if last <= first || (last - first) as f64 > DENSE_PART * *count as f64 {
                    continue;
                }
                let width = (*high - *low) / *count as f64;
                (*low, *high) = (*low + width * first as f64, *low + width * last as f64);
                is_denser = true;
            }
            if !is_denser {
                break;
            }
            grid = Self::with_ends(data, grid.law, grid.counts, ends)?;
        }
        Ok(grid)
    }

    /// Shapes that are distributed as their likelihood is, one for each of these numbers from 0 to 1.
    ///
    /// - `noise`: the squared residuals of one independent row;
    /// - `within`: a place within the cell for each.
    pub(super) fn drawn(
        &self,
        noise: f64,
        parts: &[f64],
        within: &[[f64; SHAPES]],
    ) -> Vec<[f64; SHAPES]> {
        let weights = self.weights(noise);
        let total: f64 = weights.iter().sum();
        let one = |(part, within): (&f64, &[f64; SHAPES])| {
            let mut left = part * total;
            let cell = weights.iter().position(|w| {
                left -= w;
                left < 0.0
            });
            self.shape(cell.unwrap_or(0), *within)
        };
        parts.iter().zip(within).map(one).collect()
    }
}

/// The least squared residuals with this shape, where the coefficients that it changes are not negative.
///
/// - `data`: equations with the friction of this joint alone.
pub(super) fn cost(
    data: &FrictionData,
    law: Friction,
    shape: [f64; SHAPES],
) -> Result<f64, EstimateError> {
    let factor = data.factor(&[law], &[shape])?;
    let first = data.labels.len();
    let own: Vec<usize> = curved(law).into_iter().map(|c| first + c).collect();
    let others = (0..factor.columns()).filter(|c| !own.contains(c));
    let order: Vec<usize> = others.chain(own.iter().copied()).collect();
    let last = factor.select(&order)?;
    let n = last.columns();
    let negative = (n - own.len()..n).map(|k| {
        let (side, diagonal) = (last.z()[k], last.r()[k * n + k]);
        if side * diagonal < 0.0 {
            side * side
        } else {
            0.0
        }
    });
    Ok(factor.rss() + negative.sum::<f64>())
}
