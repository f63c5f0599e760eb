//! The rounds of DIDIM: simulation, linearisation and estimate.

use regen_experiment::closed_loop::{LoopRun, simulate_loop};
use regen_experiment::simulate::{Settings, friction_width};
use regen_identify::estimate::{EstimateError, QrFactor, Weighting};
use regen_identify::gains::LoadedLoops;
use regen_identify::identify::{Identified, errors_of_prediction, identify_linearised};
use regen_identify::states::{Recorded, Source as _, Standstill, StateSample};
use regen_runtime::{BaseModel, SizeError};

use crate::Number;
use crate::didim::{DidimError, DidimOptions, EffortRun};
use crate::effort_slopes::{LinearisedColumns, effort_slopes};
use crate::loaded_didim::LoadedColumns;
use crate::plant::Plant;
use crate::search::substitute;
use crate::threads::spread;

/// Velocities below this many widths of the simulated friction count as rest: there the simulated friction
/// changes its direction smoothly, which no real one does.
const REST_WIDTHS: f64 = 4.0;
/// Values that differ by a smaller part than this count as equal; simulated motion is a few digits
/// more accurate.
const SAME_DIGITS: f64 = 1e-5;

/// A step is refused if the misfit grows, by more than this where the estimate does not minimise it
/// exactly: with other weights, or while the rows that are left out still change.
const MISFIT_GROWTH: f64 = 0.003;
/// The largest number of steps that are tried from one estimate.
const MAX_STEPS: usize = 8;
/// The least damping other than none, and the factor by which it changes.
const LEAST_DAMPING: f64 = 1e-3;
const DAMPING_FACTOR: f64 = 8.0;

/// The rounds of one identification.
pub(super) struct Rounds<'a, 'r, M: ?Sized, D: ?Sized> {
    pub(super) model: &'a M,
    /// The same model for numbers with derivatives.
    pub(super) derivatives: &'a D,
    pub(super) runs: &'a [EffortRun<'r>],
    pub(super) options: &'a DidimOptions,
    /// The unknown gains and payloads; `None`: the unknowns are the base parameters.
    pub(super) loads: Option<&'a LoadedLoops<'a, M>>,
    /// For each row, which coordinates rest; fixed once the estimate is near its limit, because it
    /// would jump if rows were dropped or added from round to round.
    pub(super) resting: Option<Vec<Vec<bool>>>,
}

/// A simulation of all runs.
pub(super) struct Simulated {
    /// The measured efforts at the simulated motion.
    pub(super) log: Recorded,
    /// For each row of the log measured minus simulated efforts of all actuated joints, SI.
    pub(super) differences: Vec<f64>,
    /// For each row of the log the simulated efforts of all actuated joints, SI.
    pub(super) efforts: Vec<f64>,
    /// The simulated loops, one for each run.
    pub(super) loops: Vec<LoopRun>,
    /// The mean over all equations of the logarithm of the rms error of their effort, measured minus
    /// simulated, filtered as for the estimate. Its minimum is that of the least squares with weights by
    /// effort, which are the inverse of these rms errors.
    pub(super) misfit: f64,
}

/// The least squares of a round.
pub(super) struct Round {
    /// The unknowns.
    pub(super) values: Vec<f64>,
    /// The weighted QR factor of the linearised equations.
    pub(super) factor: QrFactor,
    /// eps_RA of the simulation over all efforts, percent (Eq. 33).
    pub(super) relative_absolute: f64,
    pub(super) kind: RoundKind,
}

/// What a round leads to.
pub(super) enum RoundKind {
    /// Base parameters.
    Base(Box<Identified>),
    /// Base parameters, gains and payloads: the derivatives from which these follow, see
    /// [`effort_slopes`].
    Loaded(Vec<f64>),
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
        let gains = self.gains(values);
        let width = Settings::default().friction_width;
        let slow = info.joints.iter();
        let slow: Vec<f64> = slow
            .map(|joint| REST_WIDTHS * friction_width(Some(joint), width))
            .collect();
        let mut out = Recorded::new().filtered(options.filtering);
        let weights = vec![1.0; dof];
        let mut tau = vec![0.0; dof];
        let (mut differences, mut efforts_of_loops) = (Vec::new(), Vec::new());
        let mut loops = Vec::with_capacity(self.runs.len());
        for (number, run) in self.runs.iter().enumerate() {
            let phi = parameters(model, &self.base(values, number))?;
            let simulated = simulate_loop(model, &run.closed_loop, &phi, run.times)?;
            let (log, lead) = (&simulated.log, simulated.lead);
            let first = run.times.first().copied().unwrap_or(0.0);
            let mut follows = false;
            for (k, time) in run.times.iter().enumerate() {
                if time - first < options.settle {
                    continue;
                }
                let at = lead + k * simulated.stride;
                let row = |all: &[f64]| all.get(at * n..(at + 1) * n).unwrap_or_default().to_vec();
                let [q, qd, qdd] = [&log.q, &log.qd, &log.qdd].map(|all| row(all));
                let measured = run.efforts.iter().zip(&gains);
                let efforts: Vec<f64> = measured.map(|(e, gain)| gain * e[k]).collect();
                let own = log.effort.iter().skip(at * efforts.len()).copied();
                differences.extend(efforts.iter().zip(own.clone()).map(|(x, y)| x - y));
                efforts_of_loops.extend(own.take(efforts.len()));
                let _condition = model.generalized_forces(&q, &efforts, &mut tau)?;
                let known = self.resting.as_ref().and_then(|all| all.get(out.len()));
                let still = match known {
                    Some(known) => known.clone(),
                    None => qd
                        .iter()
                        .zip(&slow)
                        .map(|(v, slow)| v.abs() < *slow)
                        .collect(),
                };
                out.push_row(&StateSample {
                    time: *time,
                    q: &q,
                    qd: &qd,
                    qdd: &qdd,
                    tau: &tau,
                    efforts: &efforts,
                    held: &[],
                    at_standstill: &still,
                    weights: &weights,
                    follows,
                    bridged: false,
                });
                follows = true;
            }
            loops.push(simulated);
        }
        let errors = if let Some(loads) = self.loads {
            // in the units in which efforts were measured, and by drives, as they are fitted
            let mut difference = LoadedColumns::of_differences(loads, &differences, &gains);
            errors_of_prediction(model, &mut out, &mut difference, 0)?
        } else {
            let mut difference = LinearisedColumns::new(model, None, &differences);
            errors_of_prediction(model, &mut out, &mut difference, 0)?
        };
        let errors = errors.efforts();
        let samples: f64 = errors.iter().map(|e| e.samples as f64).sum();
        let own = errors.iter();
        let own = own.map(|e| e.samples as f64 * libm::log(e.rms.max(f64::MIN_POSITIVE)));
        Ok(Simulated {
            misfit: own.sum::<f64>() / samples.max(1.0),
            log: out,
            differences,
            efforts: efforts_of_loops,
            loops,
        })
    }

    /// Returns an error unless each run has an effort of each actuated joint at each time.
    pub(super) fn require_sizes(&self) -> Result<(), DidimError> {
        let fits = |expected, got| {
            if expected == got {
                return Ok(());
            }
            Err(DidimError::Size(SizeError {
                argument: "efforts",
                expected,
                got,
            }))
        };
        let actuated = self.model.info().actuated.len();
        for run in self.runs {
            fits(actuated, run.efforts.len())?;
            for efforts in run.efforts {
                fits(run.times.len(), efforts.len())?;
            }
        }
        Ok(())
    }

    /// The base parameters of a run, by its number.
    pub(super) fn base(&self, values: &[f64], run: usize) -> Vec<f64> {
        let loaded = self.loads.map(|loads| loads.base(values, run));
        loaded.unwrap_or_else(|| values.to_vec())
    }

    /// The number of a run's rows in the log: those after the time to settle.
    pub(super) fn rows_of(&self, run: usize) -> usize {
        let times = self.runs.get(run).map_or(&[][..], |run| run.times);
        let first = times.first().copied().unwrap_or(0.0);
        let early = times.iter();
        let early = early.take_while(|t| *t - first < self.options.settle);
        times.len() - early.count()
    }

    /// eps_RA of a simulation over all efforts, percent (Eq. 33).
    pub(super) fn relative_absolute(&self, now: &mut Simulated) -> Result<f64, DidimError> {
        let mut difference = LinearisedColumns::new(self.model, None, &now.differences);
        let errors = errors_of_prediction(self.model, &mut now.log, &mut difference, 0)?;
        Ok(errors.relative_absolute())
    }

    /// The gains of all actuated joints; 1 where efforts are measured in N m or N.
    pub(super) fn gains(&self, values: &[f64]) -> Vec<f64> {
        let loaded = self.loads.map(|loads| loads.gains(values));
        loaded.unwrap_or_else(|| vec![1.0; self.model.info().actuated.len()])
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

    /// The estimate of the next round: the least squares of the measured efforts on the linearised
    /// simulated ones.
    ///
    /// - `now`: the simulation with `values`.
    pub(super) fn estimate(
        &self,
        now: &mut Simulated,
        values: &[f64],
    ) -> Result<Round, DidimError> {
        let slopes = self.slopes(&now.loops, values)?;
        if let Some(loads) = self.loads {
            return self.loaded_estimate(loads, now, values, slopes);
        }
        let columns = LinearisedColumns::new(self.model, Some(&slopes), &now.differences);
        let mut difference = LinearisedColumns::new(self.model, None, &now.differences);
        let found = identify_linearised(
            self.model,
            &self.options.least_squares,
            &mut now.log,
            Box::new(columns),
            &mut difference,
            values,
        )?;
        Ok(Round {
            values: found.estimate.values.clone(),
            factor: found.factor.clone(),
            relative_absolute: found.relative_absolute,
            kind: RoundKind::Base(Box::new(found)),
        })
    }

    /// The next values and their simulation: the estimate of a round, damped until the robot can be
    /// simulated with it and its efforts fit better; `None` where no step gives that.
    ///
    /// - `misfit`: of the simulation at `values`;
    /// - `damping`: of the last step, replaced by that of this one; see [`damped`].
    pub(super) fn step(
        &self,
        found: &Round,
        values: &[f64],
        misfit: f64,
        damping: &mut f64,
    ) -> Result<Option<(Vec<f64>, Simulated)>, DidimError> {
        let least_squares = &self.options.least_squares;
        let is_exact = self.resting.is_some()
            && least_squares.huber.is_none()
            && least_squares.weighting == Weighting::PerEffort
            && self.options.filtering.standstill != Standstill::Weigh
            && self.loads.is_none();
        let most = misfit + if is_exact { 0.0 } else { MISFIT_GROWTH };
        for _ in 0..MAX_STEPS {
            let wanted = damped(found, values, *damping)?;
            match self.simulated(&wanted) {
                Ok(there) if there.misfit <= most => {
                    *damping *= 1.0 / DAMPING_FACTOR;
                    if *damping < LEAST_DAMPING {
                        *damping = 0.0;
                    }
                    return Ok(Some((wanted, there)));
                }
                Ok(_) | Err(DidimError::Loop(_)) => {
                    *damping = (*damping * DAMPING_FACTOR).max(LEAST_DAMPING);
                }
                Err(other) => return Err(other),
            }
        }
        Ok(None)
    }

    /// The derivatives of the simulated efforts at all rows of the log, see [`effort_slopes`].
    ///
    /// Those by parameters of payloads that a run does not carry are 0.
    fn slopes(&self, loops: &[LoopRun], values: &[f64]) -> Result<Vec<f64>, DidimError> {
        let width = Settings::default().friction_width;
        let plant = Plant::new(self.model, self.derivatives, width)?;
        let of_run = |k: usize| -> Result<Vec<f64>, DidimError> {
            let (Some(run), Some(simulated)) = (self.runs.get(k), loops.get(k)) else {
                return Ok(Vec::new());
            };
            let closed_loop = &run.closed_loop;
            let base = self.base(values, k);
            let mut slopes = effort_slopes(&plant, self.model, closed_loop, simulated, &base)?;
            let early = run.times.len() - self.rows_of(k);
            let of_row = slopes.len() / run.times.len().max(1);
            slopes.drain(..early * of_row);
            let a = run.efforts.len();
            for row in slopes.chunks_exact_mut(of_row.max(1)) {
                for column in self.loads.map_or(&[][..], |loads| loads.absent(k)) {
                    row[column * a..(column + 1) * a].fill(0.0);
                }
            }
            Ok(slopes)
        };
        let mut slopes = Vec::new();
        for (_, own) in spread(0, self.runs.len(), of_run, Result::is_ok) {
            slopes.extend(own?);
        }
        Ok(slopes)
    }
}

/// The values of a step: the least squares of a linearised round, damped.
///
/// - `damping`: the part of each parameter's squared column that is added to it (Levenberg's and
///   Marquardt's method); 0 for the least squares themselves.
pub(super) fn damped(
    found: &Round,
    values: &[f64],
    damping: f64,
) -> Result<Vec<f64>, EstimateError> {
    if damping == 0.0 {
        return Ok(found.values.clone());
    }
    let factor = &found.factor;
    let n = values.len();
    let mut residual = factor.z().to_vec();
    for (column, x) in factor.r().chunks_exact(n.max(1)).zip(values) {
        for (sum, r) in residual.iter_mut().zip(column) {
            *sum -= r * x;
        }
    }
    let (labels, r) = (factor.labels().to_vec(), factor.r().to_vec());
    let mut all = QrFactor::from_parts(labels, r, residual, factor.rss(), factor.rows())?;
    let mut rows = vec![0.0; n * n];
    for (k, norm) in factor.column_norms().iter().enumerate() {
        rows[k * n + k] = damping.sqrt() * norm;
    }
    all.push_block(&rows, &vec![0.0; n])?;
    let step = substitute(all.r(), all.z());
    Ok(values.iter().zip(&step).map(|(x, d)| x + d).collect())
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
pub(super) fn deviations_from(found: &Round, values: &[f64]) -> Result<f64, DidimError> {
    let n = values.len().max(1) as f64;
    let (rows, factor) = (found.factor.rows(), &found.factor);
    let spare = rows.saturating_sub(values.len()).max(1) as f64;
    let variance = (factor.rss() / spare).max(f64::MIN_POSITIVE);
    let more = factor.squared_residual(values)? - factor.rss();
    Ok((more.max(0.0) / variance / n).sqrt())
}
