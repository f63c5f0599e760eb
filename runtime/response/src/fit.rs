//! Fits base parameters, gains and signals to responses to commands.

use regen_identify::estimate::{Deviations, EffortError, QrFactor};
use regen_identify::model::{IdentifiedModel, Interval, Intervals};
use regen_runtime::BaseModel;

use crate::parameters::Unknowns;
use crate::plant::Plant;
use crate::rank::{Direction, undetermined};
use crate::residuals::measured;
use crate::search::Signals;
use crate::setup::{Run, Setup, SignalKind};
use crate::start;
use crate::window::{Experiment, Window};
use crate::{Number, ResponseError};

/// The smallest number of rows of a window, as a multiple of its own unknowns.
const MIN_ROWS: usize = 2;

/// A value that was estimated together with the base parameters: a gain, a delay, a bias.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimated {
    /// Its label, such as `kp(q1)`.
    pub label: String,
    /// The value, SI.
    pub value: f64,
    /// Its standard deviation and confidence interval; `None` where the data do not determine it.
    pub interval: Option<Interval>,
}

/// The result of a fit to responses.
#[derive(Clone, Debug)]
pub struct ResponseFit {
    /// The identified model: base parameters with intervals, none where the data do not determine
    /// the value.
    pub model: IdentifiedModel,
    /// The gains and the values of signals that were estimated.
    pub estimated: Vec<Estimated>,
    /// The directions that the responses leave undetermined, along which the values are those of the
    /// start.
    pub undetermined: Vec<Direction>,
    /// The errors of each signal, in the order of the measured positions, then velocities: those of
    /// the residuals, in rad or m, and in rad/s or m/s.
    pub errors: Vec<EffortError>,
    /// The standard deviations of the determined unknowns.
    pub deviations: Deviations,
    /// The weighted QR factor of the base parameters, whose right-hand side is the part of the
    /// signals that they explain. The contributions of the parameters follow from it.
    pub factor: QrFactor,
    /// The number of windows.
    pub windows: usize,
    /// The number of steps of the search.
    pub steps: usize,
    /// The number of candidates that could not be simulated.
    pub refused: usize,
    /// Whether the last step was below a thousandth of the standard deviations.
    pub converged: bool,
}

/// Fits base parameters, and the gains and values of signals that the settings leave open, to the
/// responses of runs under commands; no effort is used.
///
/// The closed loop is simulated in windows, whose first states are estimated with the parameters,
/// and the squares of measured minus simulated signals are minimised, each signal weighted by its
/// noise.
///
/// - `derivatives`: the same model for numbers with derivatives;
/// - `runs`: at least one;
/// - `start`: base parameters of a robot that can be simulated, such as nominal ones, r;
/// - `confidence`: the level of the intervals, in (0, 1);
/// - `progress`: called with the number of each step and the sum of the squared residuals.
///
/// # Errors
/// When lists do not fit the model or each other, a joint has nonlinear friction, or the robot
/// cannot be simulated with the first values: see [`ResponseError`].
pub fn fit_responses<M, D>(
    model: &M,
    derivatives: &D,
    runs: &[Run],
    setup: &Setup,
    start: &[f64],
    confidence: f64,
    progress: &mut dyn FnMut(usize, f64),
) -> Result<ResponseFit, ResponseError>
where
    M: BaseModel<f64> + ?Sized + Sync,
    D: BaseModel<Number> + ?Sized + Sync,
{
    let info = model.info();
    let base = model.base_info();
    check(model, runs, setup, start)?;
    let plant = Plant::new(model, derivatives, setup.friction_width)?;
    let name = |c: usize| info.coordinates.get(c).copied().unwrap_or("?");
    let title = |kind: &SignalKind| match *kind {
        SignalKind::Position(c) => name(c).to_owned(),
        SignalKind::Velocity(c) => format!("qd_{}", name(c)),
        SignalKind::Command(c) => format!("cmd_{}", name(c)),
    };
    let mut kinds: Vec<SignalKind> = Vec::new();
    let mut sizes: Vec<[f64; 2]> = Vec::new();
    for run in runs {
        for (kind, values) in measured(run) {
            let place = kinds.iter().position(|k| *k == kind).unwrap_or_else(|| {
                kinds.push(kind);
                sizes.push([0.0; 2]);
                kinds.len() - 1
            });
            sizes[place][0] += values.iter().map(|x| x * x).sum::<f64>();
            sizes[place][1] += values.len() as f64;
        }
    }
    let names: Vec<String> = kinds.iter().map(title).collect();
    let commands = info.actuated.iter().map(|c| SignalKind::Command(*c));
    let all: Vec<(SignalKind, String)> = kinds
        .iter()
        .copied()
        .chain(commands)
        .map(|kind| (kind, title(&kind)))
        .collect();
    let labelled: Vec<(&str, f64)> = base
        .base
        .iter()
        .map(|b| b.label)
        .zip(start.iter().copied())
        .collect();
    let joints: Vec<&str> = info.actuated.iter().map(|c| name(*c)).collect();
    let (unknowns, shared) = Unknowns::new(&labelled, &joints, &all, setup);
    let experiment = Experiment {
        plant: &plant,
        model,
        unknowns: &unknowns,
        setup,
        runs,
    };
    let rms: Vec<f64> = sizes.iter().map(|[s, n]| (s / n.max(1.0)).sqrt()).collect();
    let signals = Signals::new(kinds, &rms);
    let windows = windows(model, &experiment, runs, setup)?;
    let found = experiment.search(&signals, windows, shared, progress)?;
    let open = undetermined(&found.factor, &found.shared, &|k| unknowns.is_effort(k));
    let statistics = experiment.statistics(&signals, &names, &found, &open)?;

    let r = unknowns.base;
    let method = format!(
        "output error of responses, {}",
        statistics.deviations.in_words()
    );
    let of_kept = Intervals::of(
        &statistics.white,
        &statistics.correlated,
        confidence,
        method,
    );
    let interval = |k: usize| {
        let place = open.kept.iter().position(|c| *c == k)?;
        let determined = !open.involved.get(k).copied().unwrap_or(true);
        let own = of_kept.base.get(place).copied().flatten();
        own.filter(|i| determined && i.sigma.is_finite())
    };
    let columns: Vec<usize> = (0..r).collect();
    let of_base = found.factor.select(&columns)?;
    let explained = product(&of_base, &found.shared[..r]);
    let factor = QrFactor::from_parts(
        of_base.labels().to_vec(),
        of_base.r().to_vec(),
        explained,
        of_base.rss(),
        of_base.rows(),
    )?;
    let estimated = (r..unknowns.len()).map(|k| Estimated {
        label: unknowns.labels[k].clone(),
        value: found.shared[k],
        interval: interval(k),
    });
    Ok(ResponseFit {
        model: IdentifiedModel {
            name: "response".to_owned(),
            beta: found.shared[..r].to_vec(),
            feasibility: "not judged".to_owned(),
            intervals: Intervals {
                base: (0..r).map(interval).collect(),
                method: of_kept.method.clone(),
                ..Intervals::default()
            },
            ..IdentifiedModel::default()
        },
        estimated: estimated.collect(),
        undetermined: open.directions,
        errors: statistics.errors,
        deviations: statistics.deviations,
        factor,
        windows: found.windows.len(),
        steps: found.steps,
        refused: found.refused,
        converged: found.converged,
    })
}

/// Refuses data and settings that do not fit the model or each other.
fn check<M: BaseModel<f64> + ?Sized>(
    model: &M,
    runs: &[Run],
    setup: &Setup,
    start: &[f64],
) -> Result<(), ResponseError> {
    let info = model.info();
    let size = |what, expected, got| {
        if expected == got {
            return Ok(());
        }
        Err(ResponseError::Size {
            what,
            expected,
            got,
        })
    };
    for (joint, name) in info.joints.iter().zip(info.coordinates) {
        if !joint.friction.is_linear() {
            return Err(ResponseError::NonlinearFriction((*name).to_owned()));
        }
    }
    size("start", model.base_info().base.len(), start.len())?;
    size("controllers", info.actuated.len(), setup.laws.len())?;
    let positive = [
        ("window", setup.window),
        ("friction width", setup.friction_width),
    ];
    for (what, value) in positive {
        if !(value > 0.0 && value.is_finite()) {
            return Err(ResponseError::Setting(what));
        }
    }
    if !(setup.greatest_delay >= 0.0 && setup.greatest_delay.is_finite()) {
        return Err(ResponseError::Setting("greatest delay"));
    }
    for law in &setup.laws {
        if !law.gains().iter().all(|gain| gain.value.is_finite()) {
            return Err(ResponseError::Setting("gains of a controller"));
        }
    }
    if runs.is_empty() {
        return Err(ResponseError::NoRows);
    }
    for run in runs {
        let rows = run.times.len();
        size("commands", info.actuated.len(), run.commands.len())?;
        for values in &run.commands {
            size("rows of a command", rows, values.len())?;
        }
        for (coordinate, values) in run.positions.iter().chain(&run.velocities) {
            if *coordinate >= info.coordinates.len() {
                return Err(ResponseError::Size {
                    what: "coordinates",
                    expected: info.coordinates.len(),
                    got: coordinate + 1,
                });
            }
            size("rows of a signal", rows, values.len())?;
        }
        let signals = run.positions.iter().chain(&run.velocities).map(|(_, x)| x);
        let all = signals.chain(&run.commands).chain([&run.times]);
        if !all.flatten().all(|x| x.is_finite()) {
            return Err(ResponseError::NotFinite);
        }
        if run.times.windows(2).any(|pair| pair[1] <= pair[0]) {
            return Err(ResponseError::Times);
        }
        if run.positions.len() < info.dof() {
            return Err(ResponseError::Size {
                what: "measured positions",
                expected: info.dof(),
                got: run.positions.len(),
            });
        }
    }
    Ok(())
}

/// Cuts the runs into windows, with first states from the measured positions.
fn windows<M, D>(
    model: &M,
    experiment: &Experiment<'_, '_, M, D>,
    runs: &[Run],
    setup: &Setup,
) -> Result<Vec<Window>, ResponseError>
where
    M: BaseModel<f64> + ?Sized,
    D: BaseModel<Number> + ?Sized,
{
    let own = experiment.own();
    let mut out = Vec::new();
    for (k, run) in runs.iter().enumerate() {
        for rows in run.windows(setup.window, MIN_ROWS * own + 2) {
            let Some(mut state) = start::state(model, setup, run, &rows)? else {
                let time = run.times.get(rows.start).copied().unwrap_or(0.0);
                return Err(ResponseError::Start {
                    time,
                    why: "the loops cannot be closed at the measured positions",
                });
            };
            state.resize(own, 0.0);
            out.push(Window {
                run: k,
                rows,
                own: state,
            });
        }
    }
    if out.is_empty() {
        return Err(ResponseError::NoRows);
    }
    Ok(out)
}

/// The product R x.
fn product(factor: &QrFactor, x: &[f64]) -> Vec<f64> {
    let n = x.len();
    let mut out = vec![0.0; n];
    for (column, value) in factor.r().chunks_exact(n.max(1)).zip(x) {
        for (sum, r) in out.iter_mut().zip(column) {
            *sum += r * value;
        }
    }
    out
}
