//! The search for the values that fit best, and the standard deviations of the noise.

use nalgebra::{DMatrix, DVector};

use crate::closure::Split;
use crate::equations::{Block, Group, Point, Pose, Problem};

/// The largest number of steps of a search.
const STEPS: usize = 60;
/// A step that is no longer made, in standard deviations.
const NEGLIGIBLE: f64 = 1e-3;
/// The part of the normal matrix's diagonal by which rounding errors are kept from its rank.
const LEAST_DAMPING: f64 = 1e-14;
/// The largest number of times that standard deviations are estimated again.
const ROUNDS: usize = 20;

/// The same of a robust fit.
const NEARLY: f64 = 0.03;

/// Standard deviations by group.
pub(crate) type Sigmas = Vec<(Group, f64)>;

/// A search over some of the columns: freedoms of mountings, then unknowns.
pub(crate) struct Search<'a> {
    pub(crate) problem: &'a Problem<'a>,
    pub(crate) split: &'a Split,
    pub(crate) poses: &'a [Pose],
    pub(crate) columns: &'a [usize],
    /// The inverse covariance of the geometry's errors before anything is measured: of the last
    /// columns, or empty.
    pub(crate) prior: &'a DMatrix<f64>,
}

/// A point with its residuals.
struct Tried {
    point: Point,
    blocks: Vec<Block>,
    weighted: Vec<Block>,
    loss: f64,
}

/// The normal equations at a point.
struct Linear {
    normal: DMatrix<f64>,
    gradient: DVector<f64>,
    /// The roots of the diagonal.
    scale: Vec<f64>,
}

impl Linear {
    /// The step with a damping, times the scale.
    fn solve(&self, damping: f64) -> Option<DVector<f64>> {
        let (n, scale) = (self.scale.len(), &self.scale);
        let scaled = DMatrix::from_fn(n, n, |i, j| {
            let entry = self.normal[(i, j)] / (scale[i] * scale[j]);
            if i == j { entry + damping } else { entry }
        });
        let right = DVector::from_fn(n, |k, _| -self.gradient[k] / scale[k]);
        Some(scaled.cholesky()?.solve(&right))
    }
}

/// Where a search ended.
pub(crate) struct Found {
    pub(crate) point: Point,
    /// Unweighted residuals.
    pub(crate) blocks: Vec<Block>,
    pub(crate) converged: bool,
}

pub(crate) fn sigma_of(sigmas: &Sigmas, group: Group) -> Option<f64> {
    let own = sigmas.iter().find(|(own, _)| *own == group);
    own.map(|(_, sigma)| *sigma)
}

impl Search<'_> {
    pub(crate) fn whitened(&self, blocks: &[Block], sigmas: &Sigmas) -> Option<Vec<Block>> {
        let of = |group| sigma_of(sigmas, group);
        let blocks = blocks.iter();
        blocks
            .map(|block| self.problem.whitened(self.split, block, &of))
            .collect()
    }

    /// The loss: half the sum of the squares, or Huber's function of each pose's norm.
    fn loss(&self, blocks: &[Block], point: &Point, robust: bool) -> f64 {
        let each = blocks.iter().map(|block| {
            let square = block.residual.norm_squared();
            let bound = bound_of(block.residual.len());
            if robust && square > bound * bound {
                bound * (libm::sqrt(square) - 0.5 * bound)
            } else {
                0.5 * square
            }
        });
        let error = self.errors(point);
        each.sum::<f64>() + 0.5 * error.dot(&(self.prior * &error))
    }

    /// How far the unknowns of the geometry for which there is a prior are from the description.
    fn errors(&self, point: &Point) -> DVector<f64> {
        let unknowns = self.problem.geometry.unknowns().iter();
        let errors = point.values.iter().zip(unknowns);
        let errors = errors.map(|(value, unknown)| value - unknown.nominal);
        DVector::from_iterator(self.prior.nrows(), errors.take(self.prior.nrows()))
    }

    /// Adds the prior to a normal matrix, and returns what it adds to the gradient.
    fn add_prior(&self, normal: &mut DMatrix<f64>, point: &Point) -> DVector<f64> {
        let (all, own) = (normal.nrows(), self.prior.nrows());
        let first = all - own;
        let mut block = normal.view_mut((first, first), (own, own));
        block += self.prior;
        let mut gradient = DVector::zeros(all);
        gradient
            .rows_mut(first, own)
            .copy_from(&(self.prior * self.errors(point)));
        gradient
    }

    /// A point with its loss.
    fn tried(
        &self,
        point: Point,
        blocks: Option<Vec<Block>>,
        (sigmas, robust): (&Sigmas, bool),
    ) -> Option<Tried> {
        let blocks = match blocks {
            Some(blocks) => blocks,
            None => self.problem.blocks(self.split, &point, self.poses)?,
        };
        let weighted = self.whitened(&blocks, sigmas)?;
        let loss = self.loss(&weighted, &point, robust);
        loss.is_finite().then_some(Tried {
            point,
            blocks,
            weighted,
            loss,
        })
    }

    /// The normal equations at a point.
    fn linear(&self, at: &Tried, robust: bool) -> Linear {
        let n = self.columns.len();
        let mut normal = DMatrix::<f64>::zeros(n, n);
        let mut gradient = DVector::<f64>::zeros(n);
        for block in &at.weighted {
            let j = block.slopes.select_columns(self.columns);
            let norm = block.residual.norm();
            let bound = bound_of(block.residual.len());
            let weight = if robust && norm > bound {
                bound / norm
            } else {
                1.0
            };
            normal.gemm_tr(weight, &j, &j, 1.0);
            gradient.gemv_tr(weight, &j, &block.residual, 1.0);
        }
        gradient += self.add_prior(&mut normal, &at.point);
        let scale = (0..n).map(|k| libm::sqrt(normal[(k, k)]).max(1e-300));
        Linear {
            scale: scale.collect(),
            normal,
            gradient,
        }
    }

    /// The point to which a damped step leads, if its loops close.
    fn stepped(
        &self,
        from: &Tried,
        linear: &Linear,
        damping: f64,
        how: (&Sigmas, bool),
    ) -> Option<Tried> {
        let solved = linear.solve(damping)?;
        let total = from
            .weighted
            .first()
            .map_or(0, |block| block.slopes.ncols());
        let mut step = vec![0.0; total];
        for (k, column) in self.columns.iter().enumerate() {
            step[*column] = solved[k] / linear.scale[k];
        }
        let next = self.problem.moved(self.split, &from.point, &step)?;
        self.tried(next, None, how)
    }

    /// Levenberg and Marquardt's search from a point, of which the residuals may be known.
    pub(crate) fn run(
        &self,
        start: Point,
        blocks: Option<Vec<Block>>,
        sigmas: &Sigmas,
        robust: bool,
    ) -> Option<Found> {
        let how = (sigmas, robust);
        let mut now = self.tried(start, blocks, how)?;
        let mut damping = 1e-8;
        let mut converged = false;
        // a robust fit is where the one by least squares begins
        let negligible = if robust { NEARLY } else { NEGLIGIBLE };
        for _ in 0..STEPS {
            let linear = self.linear(&now, robust);
            // the whole step, in standard deviations of the estimates at most: a damped one is short
            // along directions that are known badly
            if linear
                .solve(LEAST_DAMPING)
                .is_some_and(|step| step.norm() < negligible)
            {
                converged = true;
                break;
            }
            let mut accepted = None;
            while damping < 1e12 {
                if let Some(next) = self.stepped(&now, &linear, damping, how) {
                    if next.loss <= now.loss * (1.0 + 1e-13) {
                        damping = (damping * 0.01).max(LEAST_DAMPING);
                        accepted = Some(next);
                        break;
                    }
                    // a long step along a bent valley leads up its side, and the next one down again
                    let back = self.stepped(&next, &self.linear(&next, robust), damping, how);
                    if let Some(back) = back.filter(|back| back.loss < now.loss) {
                        accepted = Some(back);
                        break;
                    }
                }
                damping *= 10.0;
            }
            let Some(next) = accepted else {
                // no step lowers it: rounding errors are left
                let mut parts = linear.gradient.iter().zip(&linear.scale);
                converged = parts.all(|(g, s)| (g / s).abs() < 1e-3);
                break;
            };
            now = next;
        }
        Some(Found {
            point: now.point,
            blocks: now.blocks,
            converged,
        })
    }

    /// The leverages of every row and the inverse of the normal matrix, weighted.
    pub(crate) fn statistics(
        &self,
        weighted: &[Block],
    ) -> Option<(DMatrix<f64>, Vec<DMatrix<f64>>)> {
        let n = self.columns.len();
        let mut normal = DMatrix::<f64>::zeros(n, n);
        for block in weighted {
            let j = block.slopes.select_columns(self.columns);
            normal.gemm_tr(1.0, &j, &j, 1.0);
        }
        let own = self.prior.nrows();
        let mut block = normal.view_mut((n - own, n - own), (own, own));
        block += self.prior;
        let scale: Vec<f64> = (0..n)
            .map(|k| libm::sqrt(normal[(k, k)]).max(1e-300))
            .collect();
        let scaled = DMatrix::from_fn(n, n, |i, j| normal[(i, j)] / (scale[i] * scale[j]));
        let inverse = scaled.cholesky()?.inverse();
        let covariance = DMatrix::from_fn(n, n, |i, j| inverse[(i, j)] / (scale[i] * scale[j]));
        let hats = weighted.iter().map(|block| {
            let j = block.slopes.select_columns(self.columns);
            &j * &covariance * j.transpose()
        });
        let hats = hats.collect();
        Some((covariance, hats))
    }

    /// The search with standard deviations that are estimated where none are stated.
    pub(crate) fn settle(&self, start: Point, sigmas: &mut Sigmas, robust: bool) -> Option<Found> {
        let mut found = self.run(start, None, sigmas, robust)?;
        for _ in 0..ROUNDS {
            let weighted = self.whitened(&found.blocks, sigmas)?;
            let (_, hats) = self.statistics(&weighted)?;
            let mut change: f64 = 0.0;
            for (group, sigma) in sigmas.iter_mut() {
                if self.problem.stated(*group).is_some() {
                    continue;
                }
                let (mut sum, mut freedoms, mut rows) = (0.0, 0.0, 0.0);
                for (block, hat) in weighted.iter().zip(&hats) {
                    for (k, own) in block.groups.iter().enumerate() {
                        if own == group {
                            sum += block.residual[k] * block.residual[k];
                            freedoms += 1.0 - hat[(k, k)];
                            rows += 1.0;
                        }
                    }
                }
                let factor = if freedoms < 0.5 {
                    1.0
                } else if robust {
                    // a fit takes the same part of the median as of the rms
                    robust_factor(&weighted, *group) * libm::sqrt(rows / freedoms)
                } else {
                    libm::sqrt(sum / freedoms)
                };
                // residuals that are rounding errors have no smaller deviation
                let next = (*sigma * factor).max(1e-12);
                change = change.max((next / *sigma - 1.0).abs());
                *sigma = next;
            }
            if change < 1e-3 {
                break;
            }
            found = self.run(found.point, Some(found.blocks), sigmas, robust)?;
        }
        Some(found)
    }
}

/// From which norm the residuals of a pose count as its length: 1.345 for one number (Huber).
fn bound_of(rows: usize) -> f64 {
    1.345 * libm::sqrt(rows.max(1) as f64)
}

/// The median of the sizes of a group's weighted residuals over that of noise.
fn robust_factor(weighted: &[Block], group: Group) -> f64 {
    let mut sizes: Vec<f64> = Vec::new();
    for block in weighted {
        let own = block.groups.iter().zip(block.residual.iter());
        sizes.extend(own.filter(|(g, _)| **g == group).map(|(_, r)| r.abs()));
    }
    sizes.sort_by(f64::total_cmp);
    sizes.get(sizes.len() / 2).map_or(1.0, |m| m / 0.6745)
}
