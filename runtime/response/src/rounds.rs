//! The rounds of DIDIM: simulation, estimate, and the derivatives of the estimate with respect to the
//! simulated parameters.

use nalgebra::{DMatrix, DVector};
use regen_experiment::closed_loop::follow;
use regen_experiment::simulate::Settings;
use regen_identify::identify::{
    EquationKind, Identified, Recorded, Source as _, StateSample, observe,
};
use regen_runtime::{BaseModel, SizeError};

use crate::departure::Departure;
use crate::didim::{DidimError, DidimOptions, EffortRun, MAX_HALVINGS, NEAR_DEVIATIONS};
use crate::threads::spread;

/// Velocities below this many widths of the simulated friction count as rest: the regressor has the
/// sign of the velocity, but the simulated friction was smoothed there.
const REST_WIDTHS: f64 = 4.0;
/// Values that differ by a smaller part than this count as equal; simulated motion is a few digits
/// more accurate.
const SAME_DIGITS: f64 = 1e-5;
/// The derivatives are computed over steps that change the efforts of all rows together by this many
/// standard deviations of one effort.
const STEP_DEVIATIONS: f64 = 5.0;

/// The rounds of one identification.
pub(super) struct Rounds<'a, 'r, M: ?Sized> {
    pub(super) model: &'a M,
    pub(super) runs: &'a [EffortRun<'r>],
    pub(super) options: &'a DidimOptions,
    pub(super) slopes: Option<Slopes>,
    /// For each row, which coordinates rest; fixed once the derivatives are known, because the
    /// estimate would jump if rows were dropped or added from round to round.
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

impl<M: BaseModel<f64> + ?Sized + Sync> Rounds<'_, '_, M> {
    /// The log of the measured efforts at the motion of the loop simulated with these parameters.
    pub(super) fn simulated(&self, values: &[f64]) -> Result<Recorded, DidimError> {
        let (model, options) = (self.model, self.options);
        let info = model.info();
        let (n, dof) = (info.coordinates.len(), info.dof());
        let phi = self.parameters(values)?;
        let slow = REST_WIDTHS * Settings::default().friction_width;
        let mut out = Recorded::new().filtered(options.filtering);
        let weights = vec![1.0; dof];
        let mut tau = vec![0.0; dof];
        for run in self.runs {
            let log = follow(model, &run.closed_loop, &phi, run.times)?;
            let first = run.times.first().copied().unwrap_or(0.0);
            let mut follows = false;
            for (k, time) in run.times.iter().enumerate() {
                if time - first < options.settle {
                    continue;
                }
                let row = |all: &[f64]| all.get(k * n..(k + 1) * n).unwrap_or_default().to_vec();
                let [q, qd, qdd] = [&log.q, &log.qd, &log.qdd].map(|all| row(all));
                let efforts: Vec<f64> = run.efforts.iter().map(|e| e[k]).collect();
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
        }
        Ok(out)
    }

    /// All p parameters, for these base parameters.
    fn parameters(&self, values: &[f64]) -> Result<Vec<f64>, SizeError> {
        let mut phi = vec![0.0; self.model.info().parameters.len()];
        let free = vec![0.0; self.model.base_info().free.len()];
        self.model.parameters_from_base(values, &free, &mut phi)?;
        Ok(phi)
    }

    /// The departures of the motion simulated with these parameters from the measured positions.
    pub(super) fn departures(&self, values: &[f64]) -> Result<Vec<Departure>, DidimError> {
        if self.runs.iter().all(|run| run.positions.is_empty()) {
            return Ok(Vec::new());
        }
        let info = self.model.info();
        let n = info.coordinates.len();
        let phi = self.parameters(values)?;
        // for each coordinate the squares of differences and of the motion
        let mut squares = vec![[0.0; 2]; n];
        for run in self.runs {
            let log = follow(self.model, &run.closed_loop, &phi, run.times)?;
            let first = run.times.first().copied().unwrap_or(0.0);
            let skip = run.times.iter();
            let skip = skip
                .take_while(|t| *t - first < self.options.settle)
                .count();
            for (c, measured) in run.positions {
                let Some(sums) = squares.get_mut(*c) else {
                    continue;
                };
                let used = measured.get(skip..).unwrap_or_default();
                let mean = used.iter().sum::<f64>() / used.len().max(1) as f64;
                for (k, x) in used.iter().enumerate() {
                    let simulated = log.q.get((skip + k) * n + c).copied().unwrap_or(*x);
                    sums[0] += (x - simulated) * (x - simulated);
                    sums[1] += (x - mean) * (x - mean);
                }
            }
        }
        let named = info.coordinates.iter().zip(&squares);
        let moving = named.filter(|(_, [_, motion])| *motion > 0.0);
        Ok(moving
            .map(|(name, [difference, motion])| Departure {
                name: (*name).to_owned(),
                percent: 100.0 * (difference / motion).sqrt(),
            })
            .collect())
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
    ) -> Result<(Vec<f64>, Recorded), DidimError> {
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

    /// Computes the derivatives by differences.
    ///
    /// - `changed`: the difference of the estimate and the values, in standard deviations.
    pub(super) fn differentiate(
        &mut self,
        found: &Identified,
        values: &[f64],
        changed: f64,
    ) -> Result<(), DidimError> {
        let n = values.len();
        let weights: Vec<f64> = found.estimate.efforts.iter().map(|e| e.weight).collect();
        if self.resting.is_none() || changed > NEAR_DEVIATIONS {
            self.resting = None;
            let mut log = self.simulated(values)?;
            self.rest(&mut log)?;
        }
        let this = &*self;
        let estimate = |values: &[f64]| -> Result<Vec<f64>, DidimError> {
            let mut log = this.simulated(values)?;
            let (set, _) = observe(this.model, EquationKind::Forces, &mut log)?;
            Ok(set.combined(&weights)?.solve()?)
        };
        let here = estimate(values)?;
        // step so far that the efforts of all rows together change by a few standard deviations
        let norms = found.factor.column_norms();
        let step = |k: usize| {
            let norm = norms.get(k).copied().unwrap_or(0.0);
            if norm > 0.0 {
                STEP_DEVIATIONS / norm
            } else {
                1e-6
            }
        };
        let column = |k: usize| -> Result<Vec<f64>, DidimError> {
            let moved = |by: f64| {
                let mut moved = values.to_vec();
                moved[k] += by;
                estimate(&moved)
            };
            // use the opposite direction if this one cannot be simulated
            let (h, there) = match moved(step(k)) {
                Ok(there) => (step(k), there),
                Err(_) => (-step(k), moved(-step(k))?),
            };
            Ok(there.iter().zip(&here).map(|(a, b)| (a - b) / h).collect())
        };
        let columns = spread(0, n, column, Result::is_ok);
        let mut slopes = DMatrix::identity(n, n);
        for (k, column) in columns {
            for (i, slope) in column?.iter().enumerate() {
                slopes[(i, k)] -= slope;
            }
        }
        self.slopes = Some(Slopes {
            matrix: slopes,
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
