//! Confidence intervals of a fit with nonlinear friction, by draws of its shapes and its linear parameters.

use super::FrictionData;
use super::columns::{FrictionColumns, curved};
use super::fit::{FrictionFit, Optimum, shape_ranges};
use super::likelihood::Shapes;
use super::reversals;
use super::scores::FittedColumns;
use super::starts::within;
use super::values::{explained, symbols};
use crate::estimate::{Deviations, QrFactor};
use crate::feasibility::{BaseMap, FeasibilityError, Options, ParameterLayout};
use crate::intervals::{LeastSquares, Random, Spread, determined, factor_with_solution, projected};
use crate::qr_update::substitute;
use regen_runtime::friction::SHAPES;

/// A shape has no effect if the columns that it changes explain less than this part of the noise of a row.
const NO_EFFECT: f64 = 1e-6;

/// Confidence intervals of a fit with nonlinear friction.
#[derive(Clone, Debug, PartialEq)]
pub struct FrictionIntervals {
    /// The intervals of the r base parameters.
    pub base: Vec<Spread>,
    /// The intervals of all p parameters; `None` for those whose values are a choice, because
    /// neither observations nor constraints determine them.
    pub physical: Vec<Option<Spread>>,
    /// The intervals of each joint's values in the order of
    /// [`Friction::symbols`](regen_runtime::Friction::symbols); `None` for a shape parameter that
    /// the data do not determine.
    pub joints: Vec<Vec<Option<Spread>>>,
    /// The covariance of the base parameters and the coefficients of friction with these shapes.
    pub deviations: Deviations,
    /// The number of draws that were projected onto the constraints.
    pub replicates: usize,
    /// The number of draws that were left out because their programme was not solved.
    pub failed: usize,
}

/// Computes the confidence intervals of a fit.
///
/// With the shapes of friction at the optimum the equations are linear in the base parameters and in friction's
/// coefficients, and the covariance of their least-squares parameters accounts for the correlation of the
/// residuals ([`Deviations`]). The shapes are not known: those of each draw are distributed as their likelihood
/// is, joint by joint, and its parameters are drawn about the best ones for these shapes.
/// For equations that passed a filter a draw also contains what the filter and the sampling
/// leave unknown of the velocities near reversals: how far the fit moves with other velocities. What
/// sampling leaves unknown of the parameters with linear friction is in it too. Draws of these parameters are
/// projected onto the constraints, see [`intervals`](crate::intervals). Derived values, such as `Fs` from `Fc` and
/// the excess over it, are computed for each draw.
///
/// - `combinations`, `layout`, `options`: those of the fit;
/// - `replicates`: the number of draws, see [`DEFAULT_DRAWS`](crate::intervals::DEFAULT_DRAWS);
/// - `progress`: called with the number of draws done.
///
/// # Errors
/// When sizes do not fit, the data leave base parameters undetermined, or more than a tenth of the
/// programmes fail.
pub fn intervals(
    data: &FrictionData,
    combinations: &BaseMap,
    layout: &ParameterLayout,
    options: &Options,
    fit: &FrictionFit,
    replicates: usize,
    progress: &mut dyn FnMut(usize),
) -> Result<FrictionIntervals, FeasibilityError> {
    let point = &fit.point;
    let coefficients = data.coefficients(&point.laws);
    let r = combinations.labels().len();
    let known = r + coefficients.len();
    let factor = data.factor(&point.laws, &point.shapes)?;
    let values = factor.solve()?;
    let fitted = FittedColumns {
        data,
        columns: FrictionColumns {
            laws: &point.laws,
            shapes: &point.shapes,
            has_slopes: false,
        },
        values: &values,
    };
    let deviations = fitted.deviations(&factor)?;
    let mut changes = reversals::changes(data, combinations, layout, options, fit)?;
    changes.extend(data.changes_with(&point.laws));
    let extended = layout.extended(&coefficients)?;
    let combined = combinations.extended(&coefficients);
    let found = LeastSquares {
        factor: &factor,
        values: &values,
        deviations: &deviations,
    };
    let mut own = options.clone();
    if !own.reference.is_empty() {
        own.reference.resize(extended.len(), None);
    }
    let draws = ShapeDraws {
        data,
        point,
        found,
        changes: &changes,
    };
    let draws = draws.drawn(fit.seed, replicates)?;
    let drawn = projected(
        found,
        &combined,
        &extended,
        &own,
        &draws.data,
        None,
        progress,
    )?;
    let noise = factor.rss() / factor.rows().saturating_sub(known).max(1) as f64;

    let p = layout.len();
    let base = fit.beta.iter().enumerate();
    let base = base.map(|(k, value)| drawn.base_spread(k, *value));
    let known_ones = determined(combinations, layout, options)?;
    let physical = fit.phi.iter().zip(known_ones).enumerate();
    let physical =
        physical.map(|(k, (value, known))| known.then(|| drawn.physical_spread(k, *value)));
    // the values of every joint's law, for each draw
    let of_draw = |(draw, shapes): (&Vec<f64>, &Vec<[f64; SHAPES]>)| {
        let own = draw.get(p..).unwrap_or_default();
        symbols(data, &point.laws, own, shapes)
    };
    let solved = drawn.solved.iter().filter_map(|k| draws.shapes.get(*k));
    let pairs = drawn.phi.iter().zip(solved);
    let printed: Vec<Vec<Vec<f64>>> = pairs.map(of_draw).collect();
    let mut joints = Vec::with_capacity(fit.joints.len());
    let mut column = r;
    for (j, ((joint, law), own)) in fit
        .joints
        .iter()
        .zip(&data.laws)
        .zip(&point.laws)
        .enumerate()
    {
        // symbols without an interval: shape parameters without effect, and those that linear friction does not have
        let mut silent: Vec<&str> = Vec::new();
        let columns: Vec<usize> = curved(*own).into_iter().map(|c| column + c).collect();
        if explained(&factor, &columns, &point.values)? < NO_EFFECT * noise {
            silent.extend(own.shape_symbols());
        }
        column += own.coefficients().len();
        if own != law {
            silent.extend(law.shape_symbols());
            silent.extend(law.coefficients().iter().filter(|s| **s == "Fv2"));
        }
        let one = |(k, symbol): (usize, &&str)| {
            if silent.contains(symbol) {
                return None;
            }
            let value = joint.values.get(k).copied()?;
            let draws = printed.iter().map(|d| d.get(j)?.get(k).copied());
            let draws = draws.map(|x| x.unwrap_or(f64::NAN));
            Some(drawn.spread(value, draws.collect()))
        };
        joints.push(
            joint
                .friction
                .symbols()
                .iter()
                .enumerate()
                .map(one)
                .collect(),
        );
    }
    Ok(FrictionIntervals {
        base: base.collect(),
        physical: physical.collect(),
        joints,
        deviations,
        replicates: drawn.phi.len(),
        failed: drawn.failed,
    })
}

/// What draws of the parameters and shapes of a fit are made from.
struct ShapeDraws<'a> {
    data: &'a FrictionData,
    point: &'a Optimum,
    /// The least-squares parameters with the shapes of the fit.
    found: LeastSquares<'a>,
    /// Changes of the parameters and the logarithms of the shapes, each of which counts as a standard deviation.
    changes: &'a [Vec<f64>],
}

/// Draws.
#[derive(Default)]
struct Drawn {
    /// The data of each, with their least-squares parameters.
    data: Vec<(QrFactor, Vec<f64>)>,
    /// The shapes of all joints in each.
    shapes: Vec<Vec<[f64; SHAPES]>>,
}

impl ShapeDraws<'_> {
    /// Draws so many.
    fn drawn(&self, seed: u64, count: usize) -> Result<Drawn, FeasibilityError> {
        let LeastSquares {
            factor, deviations, ..
        } = self.found;
        let n = factor.columns();
        if deviations.root().iter().any(|x| !x.is_finite()) {
            return Ok(Drawn::default());
        }
        let mut random = Random(seed);
        let steps = random.steps(deviations, n, count);
        let mut shapes = vec![self.point.shapes.clone(); count];
        let ranges = shape_ranges(self.data, &self.point.laws);
        for (joint, range) in ranges.iter().enumerate() {
            let own = self.shapes_of_joint(joint, *range, &mut random, count)?;
            for (all, own) in shapes.iter_mut().zip(own) {
                if let Some(slot) = all.get_mut(joint) {
                    *slot = own;
                }
            }
        }
        let mut data = Vec::with_capacity(count);
        for (step, shapes) in steps.iter().zip(&mut shapes) {
            let own = self.data.factor(&self.point.laws, shapes)?;
            // what noise moves with the shapes of the fit, it moves in the same directions of the rows with others
            let along = product(factor.r(), step);
            let moved = own.solve().ok().zip(substitute(own.r(), &along));
            let (own, mut values): (_, Vec<f64>) = if let Some((best, step)) = moved {
                (own, best.iter().zip(&step).map(|(x, s)| x + s).collect())
            } else {
                shapes.clone_from(&self.point.shapes);
                let values = self.found.values.iter().zip(step);
                (factor.clone(), values.map(|(x, s)| x + s).collect())
            };
            for change in self.changes {
                let by = random.normal();
                let (linear, rest) = change.split_at(change.len().min(n));
                for (value, change) in values.iter_mut().zip(linear) {
                    *value += by * change;
                }
                let mut rest = rest.iter();
                let joints = self.point.laws.iter().zip(shapes.iter_mut()).zip(&ranges);
                for ((law, shape), range) in joints {
                    for value in shape.iter_mut().take(law.shape_symbols().len()) {
                        *value *= libm::exp(by * rest.next().copied().unwrap_or(0.0));
                    }
                    *shape = within(range, *shape);
                }
            }
            data.push((factor_with_solution(&own, &values)?, values));
        }
        Ok(Drawn { data, shapes })
    }

    /// Shapes of one joint with the distribution of their likelihood.
    fn shapes_of_joint(
        &self,
        joint: usize,
        range: [(f64, f64); SHAPES],
        random: &mut Random,
        count: usize,
    ) -> Result<Vec<[f64; SHAPES]>, FeasibilityError> {
        let (point, law) = (self.point, self.point.laws.get(joint).copied());
        let Some(law) = law.filter(|law| !law.is_linear()) else {
            let same = point.shapes.get(joint).copied().unwrap_or([1.0; SHAPES]);
            return Ok(vec![same; count]);
        };
        let own = self
            .data
            .of_joint(joint, &point.laws, &point.shapes, Some(&point.values))?;
        let noise = self.noise_of(joint);
        let shapes = Shapes {
            data: &own,
            law,
            ranges: range,
        };
        let known = point.shapes.get(joint).copied().unwrap_or([1.0; SHAPES]);
        Ok(shapes.drawn(known, noise, random, count)?)
    }

    /// The squared residuals of one independent row in the directions of a joint's coefficients, the others being known:
    /// rows that noise correlates tell less than their number.
    fn noise_of(&self, joint: usize) -> f64 {
        let LeastSquares {
            factor, deviations, ..
        } = self.found;
        let n = factor.columns();
        let laws = &self.point.laws;
        let before = laws.iter().take(joint).map(|law| law.coefficients().len());
        let first = self.data.labels.len() + before.sum::<usize>();
        let own = laws.get(joint).map_or(0, |law| law.coefficients().len());
        let along = deviations.root().chunks_exact(n.max(1));
        let rows: Vec<Vec<f64>> = along.map(|step| product(factor.r(), step)).collect();
        let squares = (first..first + own).map(|k| {
            let of_row = rows.iter().filter_map(|row| row.get(k));
            of_row.map(|x| x * x).sum::<f64>()
        });
        squares.sum::<f64>() / own.max(1) as f64
    }
}

/// The product of an upper triangle, column by column, and a vector.
fn product(r: &[f64], x: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; x.len()];
    for (column, x) in r.chunks_exact(x.len().max(1)).zip(x) {
        for (sum, r) in out.iter_mut().zip(column) {
            *sum += r * x;
        }
    }
    out
}
