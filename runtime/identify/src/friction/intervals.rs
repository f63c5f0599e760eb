//! Confidence intervals of a fit with nonlinear friction, by linearisation at its optimum.

use super::FrictionData;
use super::columns::{Behind, FrictionColumns};
use super::fit::{FrictionFit, range};
use super::reversals;
use super::scores::FittedColumns;
use super::values::symbols;
use crate::estimate::{Deviations, EstimateError, QrFactor};
use crate::feasibility::{BaseMap, Bound, FeasibilityError, Options, ParameterLayout};
use crate::intervals::{Draws, LeastSquares, Spread, determined, replicate};
use regen_runtime::friction::SHAPES;

/// The bound on the change of the logarithm of a shape parameter in a draw: a factor of 20 up or
/// down.
const LOG_SHAPE_REACH: f64 = 3.0;

/// The largest standard deviation of the step of a shape parameter, in units of [`LOG_SHAPE_REACH`]. Beyond
/// it the interval is the whole range of the search: most draws would end at their bound, wherever that is.
const MAX_STEP_DEVIATION: f64 = 1.0;

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
    /// The covariance of the linearised fit, over base parameters, coefficients of friction, and
    /// steps of shape parameters.
    pub deviations: Deviations,
    /// The number of draws that were projected onto the constraints.
    pub replicates: usize,
    /// The number of draws that were left out because their programme was not solved.
    pub failed: usize,
}

/// Computes the confidence intervals of a fit.
///
/// The fit is linearised at its optimum: its columns are those of the base parameters, of
/// friction's linear coefficients, and one for the logarithm of each shape parameter. The
/// covariance of its least-squares parameters accounts for the correlation of the residuals
/// ([`Deviations`]). For equations that passed a filter it contains what the filter and the sampling
/// leave unknown of the velocities near reversals: how far the fit moves with other velocities. What
/// sampling leaves unknown of the base parameters with linear friction is in it too. Draws of these parameters are projected onto the constraints, see
/// [`intervals`](crate::intervals). Derived values, such as `Fs` from `Fc` and the excess over it,
/// are computed for each draw.
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
    let equations = data.linearised(&point.laws, &point.shapes)?;
    let whole = equations.with_steps(&point.values, LOG_SHAPE_REACH)?;
    let (factor, kept) = determined_part(&whole, known)?;
    let values = factor.solve()?;
    let linearised = FittedColumns {
        data,
        columns: FrictionColumns {
            laws: &point.laws,
            shapes: &point.shapes,
            behind: Behind::Steps(&point.values, LOG_SHAPE_REACH),
        },
        kept: &kept,
        values: &values,
    };
    let deviations = linearised.deviations(&factor)?;
    let changes = reversals::changes(data, combinations, layout, options, fit)?;
    let deviations = changes
        .iter()
        .chain(&data.sampling)
        .fold(deviations, |sum, change| {
            let step = |column: usize| {
                let change = change.get(column).copied().unwrap_or_default();
                if column < known {
                    change
                } else {
                    change / LOG_SHAPE_REACH
                }
            };
            let own: Vec<f64> = kept.iter().map(|column| step(*column)).collect();
            sum.with_change(&own)
        });

    let labels = factor.labels();
    let more = &labels[r..];
    let extended = layout.extended(more)?;
    let combined = combinations.extended(more);
    let mut own = options.clone();
    if !own.reference.is_empty() {
        own.reference.resize(extended.len(), None);
    }
    own.bounds.extend(labels[known..].iter().map(|label| Bound {
        parameter: label.clone(),
        lowest: 0.0,
        highest: 2.0,
    }));
    let found = LeastSquares {
        factor: &factor,
        values: &values,
        deviations: &deviations,
    };
    let draws = Draws {
        seed: fit.seed,
        ..Draws::new(found, replicates)
    };
    let drawn = replicate(found, &combined, &extended, &own, &draws, progress)?;

    let p = layout.len();
    let base = fit.beta.iter().enumerate();
    let base = base.map(|(k, value)| drawn.base_spread(k, *value));
    let known_ones = determined(combinations, layout, options)?;
    let physical = fit.phi.iter().zip(known_ones).enumerate();
    let physical =
        physical.map(|(k, (value, known))| known.then(|| drawn.physical_spread(k, *value)));
    // the values of every joint's law, for each draw
    let mut printed: Vec<Vec<Vec<f64>>> = Vec::with_capacity(drawn.phi.len());
    for draw in &drawn.phi {
        let mut shapes = point.shapes.clone();
        let mut column = known;
        for (law, shape) in point.laws.iter().zip(&mut shapes) {
            for value in shape.iter_mut().take(law.shape_symbols().len()) {
                if let Some(place) = kept.iter().position(|c| *c == column) {
                    let step = draw.get(p + place - r).copied().unwrap_or(1.0);
                    *value *= libm::exp(LOG_SHAPE_REACH * (step - 1.0));
                }
                column += 1;
            }
        }
        let own = draw.get(p..).unwrap_or_default();
        printed.push(symbols(data, &point.laws, own, &shapes));
    }
    let fastest = data.fastest();
    let mut joints = Vec::with_capacity(fit.joints.len());
    let mut column = known;
    for (j, ((joint, law), own)) in fit
        .joints
        .iter()
        .zip(&data.laws)
        .zip(&point.laws)
        .enumerate()
    {
        let all = joint.friction.symbols();
        // symbols without an interval: undetermined shape parameters, and those that linear
        // friction does not have
        let mut silent: Vec<&str> = Vec::new();
        let mut open: Vec<(&str, usize)> = Vec::new();
        for (which, symbol) in own.shape_symbols().iter().enumerate().take(SHAPES) {
            match kept.iter().position(|c| *c == column) {
                None => silent.push(symbol),
                Some(place) if deviations.sigma(place) > MAX_STEP_DEVIATION => {
                    open.push((symbol, which));
                }
                Some(_) => {}
            }
            column += 1;
        }
        if own != law {
            silent.extend(law.shape_symbols());
            silent.extend(law.coefficients().iter().filter(|s| **s == "Fv2"));
        }
        let one = |(k, symbol): (usize, &&str)| {
            if silent.contains(symbol) {
                return None;
            }
            let value = joint.values.get(k).copied()?;
            if let Some((_, which)) = open.iter().find(|(own, _)| own == symbol) {
                let (lowest, highest) = range(joint.friction, *which, fastest[j]);
                let ends = [lowest, highest].into_iter().cycle();
                let ends = ends.take(printed.len()).collect();
                return Some(drawn.spread(value, ends));
            }
            let draws = printed.iter().map(|d| d.get(j)?.get(k).copied());
            let draws = draws.map(|x| x.unwrap_or(f64::NAN));
            Some(drawn.spread(value, draws.collect()))
        };
        joints.push(all.iter().enumerate().map(one).collect());
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

/// The factor without the steps of shape parameters that the data leave undetermined, and the
/// indices of the remaining columns.
fn determined_part(
    whole: &QrFactor,
    known: usize,
) -> Result<(QrFactor, Vec<usize>), EstimateError> {
    let mut kept: Vec<usize> = (0..whole.columns()).collect();
    loop {
        let factor = whole.select(&kept)?;
        let spectrum = factor.spectrum()?;
        if spectrum.rank() == kept.len() {
            return Ok((factor, kept));
        }
        let undetermined = spectrum.undetermined();
        let step = undetermined.into_iter().rev().find(|k| kept[*k] >= known);
        match step {
            Some(k) => {
                kept.remove(k);
            }
            // the error of the solution lists the undetermined parameters
            None => return Ok((factor, kept)),
        }
    }
}
