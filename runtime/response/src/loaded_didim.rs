//! DIDIM with unknown gains of drives and payloads: each run is simulated with the payload that it
//! carries, and measured currents are compared with simulated efforts over the gains.

use std::borrow::Cow;

use regen_identify::estimate::EstimateError;
use regen_identify::gains::{GainFit, LoadedLoops};
use regen_identify::identify::Columns;
use regen_identify::states::StateSample;
use regen_runtime::BaseModel;

use crate::Number;
use crate::departure::{self, Departure};
use crate::didim::{DidimError, DidimOptions, EffortRun, Ended, iterate};
use crate::rounds::{Round, RoundKind, Rounds, Simulated};

/// The result of DIDIM with gains and payloads.
#[derive(Clone, Debug)]
pub struct LoadedDidim {
    /// The least squares of the last round, with the standard deviations that account for the
    /// dependence of the motion on the estimate.
    pub fit: GainFit,
    /// As [`Didim::norms`](crate::Didim::norms).
    pub norms: Vec<f64>,
    /// Whether the rounds converged, as [`Didim::converged`](crate::Didim::converged).
    pub converged: bool,
    /// As [`Didim::departures`](crate::Didim::departures).
    pub departures: Vec<Departure>,
}

/// Identifies base parameters, unknown gains and payloads from efforts and currents, by simulating the
/// closed loop of each run.
///
/// The controllers are those of the efforts in N m or N: they are the same for any gains.
///
/// - `derivatives`: the same model for numbers with derivatives;
/// - `runs`: as for [`didim`](crate::didim); efforts of unknown gain in A;
/// - `loads`: the unknowns, prepared for these runs in this order. Gains begin with the values that fit
///   the first simulation best.
///
/// # Errors
/// As [`didim`](crate::didim), and [`DidimError::Gains`].
///
/// ```
/// # mod models {
/// #     include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/pendulum.rs"));
/// #     include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/pendulum_base.rs"));
/// #     base_of_the_pendulum!(regen_response::Number);
/// # }
/// use regen_experiment::closed_loop::{ClosedLoop, Controllers, follow};
/// use regen_experiment::simulate::Pid;
/// use regen_identify::gains::{GainOptions, KnownRobot, LoadedLoops, Plan};
/// use regen_response::{DidimOptions, EffortRun, didim_with_gains};
///
/// let swing = |t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]| {
///     let w = 3.0;
///     (q[0], qd[0], qdd[0]) =
///         ((w * t).sin(), w * (w * t).cos(), -w * w * (w * t).sin());
/// };
/// let closed_loop = ClosedLoop {
///     reference: &swing,
///     lead: 0.0,
///     controllers: Controllers::Known { pid: &[Pid { kp: 80.0, ki: 0.0, kd: 9.0, ..Pid::default() }], offset: &[] },
/// };
/// let times: Vec<f64> = (0..300).map(|k| 0.01 * f64::from(k)).collect();
/// // a known pendulum of 0.5 kg m^2 and 2 kg m, driven by a current of unknown gain
/// let log = follow(&models::Pendulum, &closed_loop, &[0.5, 2.0], &times)?;
/// let current: Vec<f64> = log.effort.iter().map(|tau| tau / 4.0).collect();
/// let run = EffortRun { times: &times, efforts: &[current], positions: &[], closed_loop };
/// let plan = Plan {
///     unknown_gains: vec!["q1".to_owned()],
///     robot: Some(KnownRobot { beta: vec![0.5, 2.0], ..KnownRobot::default() }),
///     ..Plan::default()
/// };
/// let model = &models::Pendulum;
/// let loads = LoadedLoops::new(model, &GainOptions::default(), &plan, &[None], &[0.5, 2.0])?;
/// let found = didim_with_gains(model, model, &[run], &loads, &DidimOptions::default())?;
/// assert!(found.converged);
/// assert!((found.fit.model.gains[0].value - 4.0).abs() < 1e-3);
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
pub fn didim_with_gains<M, D>(
    model: &M,
    derivatives: &D,
    runs: &[EffortRun<'_>],
    loads: &LoadedLoops<'_, M>,
    options: &DidimOptions,
) -> Result<LoadedDidim, DidimError>
where
    M: BaseModel<f64> + ?Sized + Sync,
    D: BaseModel<Number> + ?Sized + Sync,
{
    let mut rounds = Rounds {
        model,
        derivatives,
        runs,
        options,
        loads: Some(loads),
        resting: None,
    };
    rounds.require_sizes()?;
    let ones = vec![1.0; model.info().actuated.len()];
    let gains = first_gains(&rounds.simulated(&loads.start(&ones))?, ones.len());
    let Ended {
        found,
        values,
        mut now,
        norms,
        converged,
    } = iterate(&mut rounds, loads.start(&gains))?;
    let RoundKind::Loaded(slopes) = &found.kind else {
        return Err(EstimateError::NoConvergence.into());
    };
    let efforts = rounds.measured(&now, &values);
    let constants = rounds.constants(&now, slopes, &values);
    let mut columns = LoadedColumns::new(loads, slopes, constants, &efforts);
    let rows: Vec<usize> = (0..runs.len()).map(|run| rounds.rows_of(run)).collect();
    let fit = loads.finish(&mut now.log, &mut columns, &rows, &values)?;
    Ok(LoadedDidim {
        departures: departure::of_loops(&model.info(), runs, &now.loops, options.settle),
        fit,
        norms,
        converged,
    })
}

/// The gains with which a simulation fits the measured efforts best, 1 where none does.
///
/// - `now`: a simulation with gains of 1; `a`: the number of drives.
fn first_gains(now: &Simulated, a: usize) -> Vec<f64> {
    let (mut squares, mut products) = (vec![0.0; a], vec![0.0; a]);
    let rows = now.efforts.chunks_exact(a.max(1));
    for (simulated, off) in rows.zip(now.differences.chunks_exact(a.max(1))) {
        for (k, (tau, off)) in simulated.iter().zip(off).enumerate() {
            squares[k] += tau * tau;
            products[k] += tau * (tau + off);
        }
    }
    let gains = squares.iter().zip(&products).map(|(s, p)| s / p);
    gains.map(|k| if k.is_normal() { k } else { 1.0 }).collect()
}

impl<M, D> Rounds<'_, '_, M, D>
where
    M: BaseModel<f64> + ?Sized + Sync,
    D: BaseModel<Number> + ?Sized + Sync,
{
    /// The estimate of the next round, see [`Rounds::estimate`].
    pub(super) fn loaded_estimate(
        &self,
        loads: &LoadedLoops<'_, M>,
        now: &mut Simulated,
        values: &[f64],
        slopes: Vec<f64>,
    ) -> Result<Round, DidimError> {
        let efforts = self.measured(now, values);
        let constants = self.constants(now, &slopes, values);
        let columns = LoadedColumns::new(loads, &slopes, constants, &efforts);
        let found = loads.estimate(&mut now.log, Box::new(columns), values)?;
        Ok(Round {
            values: found.values,
            factor: found.factor,
            relative_absolute: self.relative_absolute(now)?,
            kind: RoundKind::Loaded(slopes),
        })
    }

    /// For each row of the log the measured efforts in their own units.
    fn measured(&self, now: &Simulated, values: &[f64]) -> Vec<f64> {
        let gains = self.gains(values);
        let all = now.differences.iter().zip(&now.efforts);
        all.zip(gains.iter().cycle())
            .map(|((off, tau), gain)| (tau + off) / gain)
            .collect()
    }

    /// For each row of the log the simulated efforts minus their derivatives times the base parameters.
    fn constants(&self, now: &Simulated, slopes: &[f64], values: &[f64]) -> Vec<f64> {
        let a = self.model.info().actuated.len().max(1);
        let mut out = now.efforts.clone();
        let of_row = self.model.base_info().base.len() * a;
        let mut rows = out
            .chunks_exact_mut(a)
            .zip(slopes.chunks_exact(of_row.max(1)));
        for run in 0..self.runs.len() {
            let base = self.base(values, run);
            for (row, slopes) in rows.by_ref().take(self.rows_of(run)) {
                for (column, x) in slopes.chunks_exact(a).zip(&base) {
                    for (sum, j) in row.iter_mut().zip(column) {
                        *sum -= j * x;
                    }
                }
            }
        }
        out
    }
}

/// The columns of [`LoadedLoops`], row by row.
pub(super) struct LoadedColumns<'a> {
    /// For each row, the place among the actuated joints.
    drives: Vec<usize>,
    /// For each row of the log the derivatives of the efforts, a x r, column by column.
    slopes: &'a [f64],
    /// For each row of the log the constant part of the efforts, a.
    constants: Vec<f64>,
    /// For each row of the log the measured efforts, a.
    measured: Cow<'a, [f64]>,
    /// The number of base parameters.
    base: usize,
    row: usize,
}

impl<'a> LoadedColumns<'a> {
    fn new<M: BaseModel<f64> + ?Sized>(
        loads: &LoadedLoops<'_, M>,
        slopes: &'a [f64],
        constants: Vec<f64>,
        measured: &'a [f64],
    ) -> Self {
        Self {
            drives: loads.drives(),
            base: slopes.len() / constants.len().max(1),
            slopes,
            constants,
            measured: Cow::Borrowed(measured),
            row: 0,
        }
    }

    /// One column: the differences of measured and simulated efforts, in the units of the measured ones.
    ///
    /// - `differences`: SI; `gains`: of all actuated joints.
    pub(super) fn of_differences<M: BaseModel<f64> + ?Sized>(
        loads: &LoadedLoops<'_, M>,
        differences: &[f64],
        gains: &[f64],
    ) -> Self {
        let own = differences.iter().zip(gains.iter().cycle());
        Self {
            drives: loads.drives(),
            base: 0,
            slopes: &[],
            constants: Vec::new(),
            measured: Cow::Owned(own.map(|(off, gain)| off / gain).collect()),
            row: 0,
        }
    }

    /// Copies the efforts of a row, a for each column, in the order of the equations.
    fn copy(&self, from: &[f64], out: &mut [f64]) {
        let a = self.drives.len().max(1);
        for (column, efforts) in out.chunks_exact_mut(a).zip(from.chunks_exact(a)) {
            for (slot, drive) in column.iter_mut().zip(&self.drives) {
                *slot = efforts.get(*drive).copied().unwrap_or(0.0);
            }
        }
    }

    fn of_row<'b>(&self, all: &'b [f64], width: usize) -> &'b [f64] {
        all.get(self.row * width..(self.row + 1) * width)
            .unwrap_or_default()
    }
}

impl Columns for LoadedColumns<'_> {
    fn count(&self) -> usize {
        self.base + 1 + usize::from(!self.constants.is_empty())
    }

    fn fill(
        &mut self,
        _: &StateSample<'_>,
        _: &[f64],
        out: &mut [f64],
    ) -> Result<bool, EstimateError> {
        let a = self.drives.len();
        let (slopes, rest) = out.split_at_mut((a * self.base).min(out.len()));
        let (constant, measured) = rest.split_at_mut(rest.len().saturating_sub(a));
        self.copy(self.of_row(self.slopes, a * self.base), slopes);
        self.copy(self.of_row(&self.constants, a), constant);
        self.copy(self.of_row(&self.measured, a), measured);
        self.row += 1;
        Ok(true)
    }

    fn restart(&mut self) {
        self.row = 0;
    }

    fn skip(&mut self) {
        self.row += 1;
    }
}
