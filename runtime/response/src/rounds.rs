//! The rounds of DIDIM: simulation, estimate, and the derivatives of the estimate with respect to the
//! simulated parameters.

use nalgebra::{DMatrix, DVector};
use regen_experiment::closed_loop::{LoopRun, simulate_loop};
use regen_experiment::simulate::Settings;
use regen_identify::estimate::{Accumulator, EstimateError};
use regen_identify::identify::{
    EquationBuilder, EquationKind, Identified, Recorded, Source as _, StateSample, equations,
};
use regen_runtime::{BaseModel, SizeError};

use crate::Number;
use crate::didim::{DidimError, DidimOptions, EffortRun, MAX_HALVINGS};
use crate::effort_slopes::{SlopeColumns, effort_slopes};
use crate::plant::Plant;
use crate::threads::spread;

/// Velocities below this many widths of the simulated friction count as rest: the regressor has the
/// sign of the velocity, but the simulated friction was smoothed there.
const REST_WIDTHS: f64 = 4.0;
/// Values that differ by a smaller part than this count as equal; simulated motion is a few digits
/// more accurate.
const SAME_DIGITS: f64 = 1e-5;
/// The least rms error of efforts, as a part of their rms, that the misfit tells from zero.
const LEAST_MISFIT: f64 = 1e-6;

/// The rounds of one identification.
pub(super) struct Rounds<'a, 'r, M: ?Sized, D: ?Sized> {
    pub(super) model: &'a M,
    /// The same model for numbers with derivatives.
    pub(super) derivatives: &'a D,
    pub(super) runs: &'a [EffortRun<'r>],
    pub(super) options: &'a DidimOptions,
    pub(super) slopes: Option<Slopes>,
    /// For each row, which coordinates rest; fixed once the estimate is near its limit, because it
    /// would jump if rows were dropped or added from round to round.
    pub(super) resting: Option<Vec<Vec<bool>>>,
}

/// The derivatives of the estimate with respect to the simulated parameters.
pub(super) struct Slopes {
    /// `1 - dG/dbeta`, r x r, where G is the estimate.
    pub(super) matrix: DMatrix<f64>,
    /// The difference of the estimate and the simulated parameters at which the derivatives were
    /// computed, in standard deviations.
    pub(super) moved: f64,
}

/// A simulation of all runs.
pub(super) struct Simulated {
    /// The measured efforts at the simulated motion.
    pub(super) log: Recorded,
    /// The simulated loops, one for each run.
    loops: Vec<LoopRun>,
    /// The mean over the actuated joints of the logarithm of the rms of measured minus simulated
    /// efforts.
    pub(super) misfit: f64,
}

impl<M, D> Rounds<'_, '_, M, D>
where
    M: BaseModel<f64> + ?Sized + Sync,
    D: BaseModel<Number> + ?Sized + Sync,
{
    /// The log of the measured efforts at the motion of the loop simulated with these parameters.
    pub(super) fn simulated(&self, values: &[f64]) -> Result<Simulated, DidimError> {
        let (model, options) = (self.model, self.options);
        let info = model.info();
        let (n, dof) = (info.coordinates.len(), info.dof());
        let phi = parameters(model, values)?;
        let slow = REST_WIDTHS * Settings::default().friction_width;
        let mut out = Recorded::new().filtered(options.filtering);
        let weights = vec![1.0; dof];
        let mut tau = vec![0.0; dof];
        // for each actuated joint the sums of squared errors and of squared efforts
        let mut squares = vec![[0.0; 2]; info.actuated.len()];
        let mut loops = Vec::with_capacity(self.runs.len());
        for run in self.runs {
            let simulated = simulate_loop(model, &run.closed_loop, &phi, run.times)?;
            let (log, lead) = (&simulated.log, simulated.lead);
            let first = run.times.first().copied().unwrap_or(0.0);
            let mut follows = false;
            for (k, time) in run.times.iter().enumerate() {
                if time - first < options.settle {
                    continue;
                }
                let at = lead + k;
                let row = |all: &[f64]| all.get(at * n..(at + 1) * n).unwrap_or_default().to_vec();
                let [q, qd, qdd] = [&log.q, &log.qd, &log.qdd].map(|all| row(all));
                let efforts: Vec<f64> = run.efforts.iter().map(|e| e[k]).collect();
                let simulated = log.effort.iter().skip(at * efforts.len());
                for ((sums, x), y) in squares.iter_mut().zip(&efforts).zip(simulated) {
                    sums[0] += (x - y) * (x - y);
                    sums[1] += x * x;
                }
                let _condition = model.generalized_forces(&q, &efforts, &mut tau)?;
                let known = self.resting.as_ref().and_then(|all| all.get(out.len()));
                let still = match known {
                    Some(known) => known.clone(),
                    None => qd.iter().map(|v| v.abs() < slow).collect(),
                };
                out.push_row(&StateSample {
                    time: *time,
                    q: &q,
                    qd: &qd,
                    qdd: &qdd,
                    tau: &tau,
                    efforts: &efforts,
                    at_standstill: &still,
                    weights: &weights,
                    follows,
                });
                follows = true;
            }
            loops.push(simulated);
        }
        let misfits = squares.iter().map(|[errors, efforts]| {
            let least = LEAST_MISFIT * LEAST_MISFIT * efforts;
            0.5 * libm::log(errors.max(least).max(f64::MIN_POSITIVE))
        });
        Ok(Simulated {
            misfit: misfits.sum::<f64>() / info.actuated.len().max(1) as f64,
            log: out,
            loops,
        })
    }

    /// The parameters to simulate next: the estimate or, once the derivatives are known, a Newton
    /// step towards the parameters that reproduce themselves as the estimate.
    pub(super) fn next(&self, found: &Identified, values: &[f64]) -> Vec<f64> {
        let estimate = &found.estimate.values;
        let change = estimate.iter().zip(values).map(|(a, b)| a - b);
        let change = DVector::from_iterator(values.len(), change);
        let step = self
            .slopes
            .as_ref()
            .and_then(|s| s.matrix.clone().lu().solve(&change));
        let step = step.unwrap_or(change);
        values.iter().zip(step.iter()).map(|(x, d)| x + d).collect()
    }

    /// Simulates with these parameters or, if they cannot be simulated, with parameters between them
    /// and the last ones.
    pub(super) fn simulable(
        &self,
        values: &[f64],
        mut wanted: Vec<f64>,
    ) -> Result<(Vec<f64>, Simulated), DidimError> {
        for _ in 0..MAX_HALVINGS {
            match self.simulated(&wanted) {
                Ok(log) => return Ok((wanted, log)),
                Err(DidimError::Loop(_)) => {
                    for (x, old) in wanted.iter_mut().zip(values) {
                        *x = f64::midpoint(*x, *old);
                    }
                }
                Err(other) => return Err(other),
            }
        }
        let log = self.simulated(&wanted)?;
        Ok((wanted, log))
    }

    /// Fixes the rows that rest, as in this log, for all later rounds.
    pub(super) fn rest(&mut self, log: &mut Recorded) -> Result<(), DidimError> {
        let mut resting = Vec::new();
        log.visit(&mut |row| {
            resting.push(row.at_standstill.to_vec());
            Ok(())
        })?;
        self.resting = Some(resting);
        Ok(())
    }

    /// Computes the derivatives of the estimate.
    ///
    /// The estimate G minimises the squares of `tau - W G` with the regressor W at the motion that is
    /// simulated with beta. The simulated efforts are `W beta`, and with their derivatives J,
    /// `(dW/dbeta) beta = J - W`. Where the residuals are small beside the efforts,
    /// `1 - dG/dbeta = (W^T W)^-1 W^T J`: the least squares of J on W.
    ///
    /// - `now`: the simulation with the values;
    /// - `weights`: of the efforts;
    /// - `changed`: the difference of the estimate and the values, in standard deviations.
    pub(super) fn differentiate(
        &mut self,
        now: &mut Simulated,
        values: &[f64],
        weights: &[f64],
        changed: f64,
    ) -> Result<(), DidimError> {
        let settle = self.options.settle;
        let width = Settings::default().friction_width;
        let plant = Plant::new(self.model, self.derivatives, width)?;
        let loops = &now.loops;
        let of_run = |k: usize| -> Result<Vec<f64>, DidimError> {
            let (Some(run), Some(simulated)) = (self.runs.get(k), loops.get(k)) else {
                return Ok(Vec::new());
            };
            let closed_loop = &run.closed_loop;
            let mut slopes = effort_slopes(&plant, self.model, closed_loop, simulated, values)?;
            let first = run.times.first().copied().unwrap_or(0.0);
            let early = run.times.iter().take_while(|t| *t - first < settle).count();
            let of_row = slopes.len() / run.times.len().max(1);
            slopes.drain(..early * of_row);
            Ok(slopes)
        };
        let mut slopes = Vec::new();
        for (_, own) in spread(0, self.runs.len(), of_run, Result::is_ok) {
            slopes.extend(own?);
        }
        let n = values.len();
        let kind = EquationKind::Forces;
        let mut origin = EquationBuilder::new(self.model, kind).origin();
        let with_slopes = origin.labels.iter().map(|label| format!("d {label}"));
        let with_slopes: Vec<String> = with_slopes.collect();
        origin.labels.extend(with_slopes);
        let mut rows = Accumulator::new(&origin);
        let mut columns = SlopeColumns::new(self.model, &slopes);
        equations(self.model, kind, &mut now.log, &mut columns, &mut |found| {
            let count = found.tau.len();
            for (effort, weight) in found.weights.iter().enumerate() {
                if *weight != 0.0 {
                    rows.push(effort, &found.w[effort..], count, 0.0, *weight)?;
                }
            }
            Ok(())
        })?;
        let both = rows.finish()?.combined(weights)?;
        let r = DMatrix::from_column_slice(2 * n, 2 * n, both.r());
        let regressor = r.view((0, 0), (n, n)).clone_owned();
        let slopes = r.view((0, n), (n, n)).clone_owned();
        let Some(matrix) = regressor.solve_upper_triangular(&slopes) else {
            return Err(EstimateError::NoConvergence.into());
        };
        self.slopes = Some(Slopes {
            matrix,
            moved: changed,
        });
        Ok(())
    }

    /// The estimate with standard deviations that include the feedback through the simulation: an
    /// error of the efforts changes the parameters, these change the simulated motion, and the motion
    /// changes the parameters again.
    pub(super) fn propagated(&self, mut found: Identified) -> Identified {
        let Some(inverse) = self
            .slopes
            .as_ref()
            .and_then(|s| s.matrix.clone().try_inverse())
        else {
            return found;
        };
        let n = inverse.nrows();
        let through = |covariance: &[f64]| -> Vec<f64> {
            let inner = DMatrix::from_column_slice(n, n, covariance);
            let whole = &inverse * inner * inverse.transpose();
            (0.5 * (&whole + whole.transpose())).as_slice().to_vec()
        };
        found.estimate.covariance = through(&found.estimate.covariance);
        let freedom = found.deviations.degrees_of_freedom.clone();
        let whole = through(&found.deviations.covariance);
        found.deviations = found.deviations.with_covariance(whole, 0);
        found.deviations.degrees_of_freedom = freedom;
        found
    }
}

/// All p parameters, for these base parameters.
pub(super) fn parameters<M: BaseModel<f64> + ?Sized>(
    model: &M,
    values: &[f64],
) -> Result<Vec<f64>, SizeError> {
    let mut phi = vec![0.0; model.info().parameters.len()];
    let free = vec![0.0; model.base_info().free.len()];
    model.parameters_from_base(values, &free, &mut phi)?;
    Ok(phi)
}

/// Whether two lists of values agree as far as the simulation is accurate. If efforts have no noise,
/// standard deviations are too small to compare changes with.
pub(super) fn is_same(found: &[f64], values: &[f64]) -> bool {
    let largest = found.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let mut both = found.iter().zip(values);
    both.all(|(a, b)| (a - b).abs() <= SAME_DIGITS * a.abs().max(SAME_DIGITS * largest))
}

/// The difference of an estimate and values in standard deviations, as the root mean square over all
/// directions.
pub(super) fn moved(found: &Identified, values: &[f64]) -> Result<f64, DidimError> {
    let n = values.len().max(1) as f64;
    let (rows, factor) = (found.factor.rows(), &found.factor);
    let spare = rows.saturating_sub(values.len()).max(1) as f64;
    let variance = (factor.rss() / spare).max(f64::MIN_POSITIVE);
    let more = factor.squared_residual(values)? - factor.rss();
    Ok((more.max(0.0) / variance / n).sqrt())
}
