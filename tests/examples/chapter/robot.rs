//! The chapter's 3-RPS: its trajectories, its equations and the predictions of its forces.

use std::sync::atomic::AtomicBool;

use regen_experiment::excite::{Criterion, Excitation, Monitor, Outcome, Settings, excite};
use regen_experiment::simulate::Noise;
use regen_generated::rps3::Rps3;
use regen_identify::estimate::QrFactor;
use regen_identify::feasibility::{BaseMap, ParameterLayout};
use regen_identify::signals::Fourier;
use regen_identify::states::directions;
use regen_runtime::{BaseModel, JointFriction, Limits, LoopClosure, State};

/// The period, s (section 6.1).
pub(crate) const PERIOD: f64 = 7.5;
/// The number of harmonics (section 3).
pub(crate) const HARMONICS: usize = 11;
/// The number of configurations used by identification, one each 0.1 s (section 6.1).
pub(crate) const POINTS: usize = 75;
/// The legs' coordinates, in the order of the independent coordinates.
pub(crate) const LEGS: [&str; 3] = ["q2", "q7", "q9"];
/// The joints with friction in our models: the legs and the pivots at the ground. The chapter has
/// friction at all joints; a spherical joint has no coordinate of its own here, so its friction is
/// left out.
pub(crate) const JOINTS: [&str; 6] = ["q2", "q7", "q9", "q1", "q6", "q8"];

pub(crate) fn model() -> &'static dyn BaseModel<f64> {
    &Rps3
}

/// An exciting trajectory as in section 3: limits of stroke, velocity and cone angle, 11 harmonics.
/// The chapter names the limits but not their values: 0.6 +- 0.15 m, 0.6 m/s and 45 degrees are our
/// choice.
pub(crate) fn trajectory(seed: u64, criterion: Criterion, steps: usize) -> Excitation {
    let info = model().info();
    let mut settings = Settings {
        criterion,
        harmonics: HARMONICS,
        frequency: 1.0 / PERIOD,
        samples: POINTS,
        seed,
        starts: 1,
        threads: 1,
        steps,
        ..Settings::of(&info)
    };
    settings.limits = vec![Limits::NONE; info.coordinates.len()];
    for c in info.independent {
        settings.limits[*c].position = Some([0.45, 0.75]);
        settings.limits[*c].velocity = Some([-0.6, 0.6]);
    }
    settings.cones.fill(45.0_f64.to_radians());
    let stop = AtomicBool::new(false);
    let watch = Monitor {
        stop: &stop,
        report: &|_| {},
    };
    match excite(&Rps3, &Rps3, &settings, watch).expect("settings that fit") {
        Outcome::Found(found) => *found,
        other => panic!("no trajectory: {other:?}"),
    }
}

/// The closed states at `count` times of a period.
pub(crate) fn states(series: &Fourier, count: usize) -> Vec<State> {
    let period = 1.0 / series.frequency();
    let mut closure = LoopClosure::new(model()).expect("a model");
    let state = |k: usize| {
        let t = period * k as f64 / count as f64;
        let at = [0, 1, 2].map(|leg| series.at(leg, t));
        let part = |order: usize| at.map(|leg| leg[order]);
        closure
            .track_state(&part(0), &part(1), &part(2))
            .expect("finite")
    };
    (0..count).map(state).collect()
}

/// The parameter that a column of the equations multiplies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Column {
    /// A rigid-body base parameter of Table 1, counted from 0.
    Body(usize),
    /// A friction or drive parameter of one of [`JOINTS`].
    Joint(&'static str, usize),
}

/// The columns of a model.
#[derive(Clone, Debug)]
pub(crate) struct Equations {
    pub(crate) columns: Vec<Column>,
}

impl Equations {
    /// All base parameters of Table 1, with these friction and drive parameters at the first
    /// `joints` of [`JOINTS`] (J at the legs only).
    pub(crate) fn new(symbols: &[&'static str], joints: usize) -> Self {
        let bodies = (0..25).map(Column::Body);
        let friction = symbols.iter().flat_map(|symbol| {
            let used = if *symbol == "J" { 3 } else { joints };
            (0..used).map(move |k| Column::Joint(symbol, k))
        });
        Self {
            columns: bodies.chain(friction).collect(),
        }
    }

    pub(crate) fn labels(&self) -> Vec<String> {
        let base = model().base_info().base;
        let label = |column: &Column| match column {
            Column::Body(k) => base[*k].label.to_owned(),
            Column::Joint(symbol, k) => format!("{symbol}({})", JOINTS[*k]),
        };
        self.columns.iter().map(label).collect()
    }

    /// The matrix by which the columns combine the parameters, and the layout of these parameters.
    pub(crate) fn combinations(&self) -> (BaseMap, ParameterLayout) {
        let info = model().info();
        let bodies = BaseMap::from_base(&model().base_info(), info.parameters.len());
        let labels = self.labels();
        let more = labels[25..].to_vec();
        let mut all = info.labels();
        all.extend(more.iter().cloned());
        let layout = ParameterLayout::new(&all).expect("known labels");
        (bodies.expect("a base").extended(&more), layout)
    }

    /// The regressor at a state: 3 rows, column by column.
    pub(crate) fn rows(&self, state: &State) -> Vec<f64> {
        let mut bodies = vec![0.0; 75];
        let _condition = model()
            .base_regressor(&state.q, &state.qd, &state.qdd, &mut bodies)
            .expect("sizes");
        let places = places();
        let (d, _) = directions(model(), &state.q, &places).expect("sizes");
        let mut out = Vec::with_capacity(3 * self.columns.len());
        for column in &self.columns {
            match column {
                Column::Body(k) => out.extend(&bodies[3 * k..3 * k + 3]),
                Column::Joint(symbol, k) => {
                    let v = state.qd[places[*k]];
                    let value = match *symbol {
                        "Fv" => v,
                        "Fc" => v.signum(),
                        "Fc+" => f64::from(u8::from(v > 0.0)),
                        "Fc-" => -f64::from(u8::from(v < 0.0)),
                        _ => state.qdd[places[*k]],
                    };
                    out.extend(d[3 * k..3 * k + 3].iter().map(|d| d * value));
                }
            }
        }
        out
    }

    /// The QR factor of the equations at these states, with three forces for each, N.
    pub(crate) fn factor(&self, states: &[State], forces: &[f64]) -> QrFactor {
        let mut factor = QrFactor::new(self.labels());
        for (state, tau) in states.iter().zip(forces.chunks(3)) {
            factor.push_block(&self.rows(state), tau).expect("sizes");
        }
        factor
    }

    /// The forces predicted by parameters, N, three for each state.
    pub(crate) fn forces(&self, states: &[State], values: &[f64]) -> Vec<f64> {
        let mut out = Vec::with_capacity(3 * states.len());
        for state in states {
            let rows = self.rows(state);
            let sum = |i: usize| {
                values
                    .iter()
                    .enumerate()
                    .map(|(j, x)| rows[3 * j + i] * x)
                    .sum()
            };
            out.extend((0..3).map(sum).collect::<Vec<f64>>());
        }
        out
    }
}

/// The indices of the coordinates of [`JOINTS`].
pub(crate) fn places() -> [usize; 6] {
    JOINTS.map(|name| model().info().index_of(name).expect("a joint"))
}

/// The forces of friction laws at [`JOINTS`] on the legs, N, three for each state.
pub(crate) fn friction_forces(states: &[State], laws: &[JointFriction; 6]) -> Vec<f64> {
    let places = places();
    let mut out = Vec::with_capacity(3 * states.len());
    for state in states {
        let (d, _) = directions(model(), &state.q, &places).expect("sizes");
        for i in 0..3 {
            let share = |k: usize| d[3 * k + i] * laws[k].smooth_effort(state.qd[places[k]], 1e-9);
            out.push((0..6).map(share).sum());
        }
    }
    out
}

/// The 25 rigid-body base parameters of Table 1 from CAD, SI.
pub(crate) fn cad() -> Vec<f64> {
    let phi = model().info().nominal_parameters().expect("nominal values");
    let mut beta = vec![0.0; 25];
    model().to_base(&phi, &mut beta).expect("sizes");
    beta
}

/// eps_RA in percent (Eq. 33), with three forces for each sample, each around its own mean.
pub(crate) fn relative_absolute(actual: &[f64], predicted: &[f64]) -> f64 {
    let samples = (actual.len() / 3).max(1) as f64;
    let mean = |i: usize| actual.iter().skip(i).step_by(3).sum::<f64>() / samples;
    let means = [mean(0), mean(1), mean(2)];
    let error: f64 = actual
        .iter()
        .zip(predicted)
        .map(|(a, p)| (a - p).abs())
        .sum();
    let spread = actual.iter().enumerate();
    let spread: f64 = spread.map(|(k, a)| (a - means[k % 3]).abs()).sum();
    100.0 * error / spread
}

/// The values with normal noise of standard deviation `sigma`.
pub(crate) fn with_noise(values: &[f64], sigma: f64, noise: &mut Noise) -> Vec<f64> {
    values.iter().map(|v| v + sigma * noise.normal()).collect()
}

/// Writes mean, minimum and maximum over several seeds as text.
pub(crate) fn summary(values: &[f64]) -> String {
    let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    format!("{mean:.2} [{low:.2}, {high:.2}]")
}
