//! Identification tests: logs are made by inverse dynamics from known parameters, which must be
//! recovered.
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod commands;
mod estimates;
mod logs;
mod one_model;
mod parquet_logs;
mod stream;

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use regen_codegen::robot::Robot;
use regen_identify::data::{Logs, Settings};
use regen_identify::estimate::{Estimate, EstimateError, FactorSet, Weighting};
use regen_identify::identify::{EquationKind, Identified, Options, identify, observe, residuals};
use regen_identify::signals::{Fourier, Method};
use regen_identify::states::Recorded;
use regen_runtime::{BaseModel, LoopClosure, Model, Motion};

use crate::load;
use regen_interpreted::{BaseTerms, Interpreted};
use regen_reference::Random;

/// The frequency of all trajectories, Hz.
const FREQUENCY: f64 = 0.2;
const HARMONICS: usize = 5;

fn robot(name: &str) -> Robot {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots");
    load::robot(&root.join(name).with_extension("yaml")).unwrap()
}

/// A Fourier series around home for each independent coordinate: amplitudes of the size `reach` in
/// rad, a fifth of that in m.
fn series(model: &Interpreted<'_>, reach: f64, random: &mut Random) -> Fourier {
    let info = model.info();
    let signals: Vec<(f64, Vec<f64>, Vec<f64>)> = info
        .independent
        .iter()
        .map(|&c| {
            let size = match info.joints[c].motion {
                Motion::Rotation => reach,
                Motion::Translation => 0.2 * reach,
            };
            let rate = size * std::f64::consts::TAU * FREQUENCY;
            let mut draw = || (0..HARMONICS).map(|_| rate * random.signed()).collect();
            (info.home[c], draw(), draw())
        })
        .collect();
    Fourier::new(FREQUENCY, &signals).unwrap()
}

/// True full and base parameters: the nominal values if the spec has all of them, else random ones.
fn truth(model: &Interpreted<'_>, random: &mut Random) -> (Vec<f64>, Vec<f64>) {
    let info = model.info();
    let drawn = info.parameters.iter().map(|_| 1.0 + 0.5 * random.signed());
    let phi: Vec<f64> = info.nominal_parameters().unwrap_or_else(|| drawn.collect());
    let mut beta = vec![0.0; model.rank()];
    model.to_base(&phi, &mut beta).unwrap();
    (phi, beta)
}

/// A state along the series, with the efforts of inverse dynamics.
struct Sample {
    time: f64,
    q: Vec<f64>,
    qd: Vec<f64>,
    qdd: Vec<f64>,
    tau: Vec<f64>,
}

/// States along a series at a fixed step, s, with the efforts that parameters `phi` give.
fn sampled(
    model: &Interpreted<'_>,
    series: &Fourier,
    phi: &[f64],
    samples: usize,
    step: f64,
) -> Vec<Sample> {
    let dof = model.info().dof();
    let mut closure = LoopClosure::new(model).unwrap();
    (0..samples)
        .map(|k| {
            let time = k as f64 * step;
            let at: Vec<[f64; 3]> = (0..dof).map(|i| series.at(i, time)).collect();
            let pick = |d: usize| -> Vec<f64> { at.iter().map(|p| p[d]).collect() };
            let state = closure.track_state(&pick(0), &pick(1), &pick(2)).unwrap();
            assert!(state.outcome.is_closed(), "{time}: {}", state.outcome);
            let mut tau = vec![0.0; dof];
            let _ = model
                .inverse_dynamics(&state.q, &state.qd, &state.qdd, phi, &mut tau)
                .unwrap();
            Sample {
                time,
                q: state.q,
                qd: state.qd,
                qdd: state.qdd,
                tau,
            }
        })
        .collect()
}

fn recorded(rows: &[Sample]) -> Recorded {
    let mut out = Recorded::new();
    for row in rows {
        out.push(row.time, &row.q, &row.qd, &row.qdd, &row.tau);
    }
    out
}

/// The largest relative error of a parameter; values below a thousandth of the largest are compared
/// with that thousandth instead.
fn worst(found: &[f64], exact: &[f64]) -> f64 {
    let largest = exact.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let error = |(a, b): (&f64, &f64)| (a - b).abs() / b.abs().max(1e-3 * largest);
    found.iter().zip(exact).map(error).fold(0.0, f64::max)
}

#[track_caller]
fn exact_data_give_exact_parameters(name: &str, reach: f64) {
    let robot = robot(name);
    let terms = BaseTerms::new(&robot);
    let model = Interpreted::with_terms(&robot, &terms);
    let mut random = Random::new(1);
    let series = series(&model, reach, &mut random);
    let (phi, beta) = truth(&model, &mut random);
    let rows = sampled(&model, &series, &phi, 400, 0.0125);
    let found = identify(
        &model,
        EquationKind::Forces,
        &Options::default(),
        &mut recorded(&rows),
    )
    .unwrap();
    let off = worst(&found.estimate.values, &beta);
    assert!(off < 1e-9, "{name}: {off:e}");
    assert!(
        found.relative_absolute < 1e-7,
        "{}",
        found.relative_absolute
    );
}

#[test]
fn exact_data_give_exact_parameters_of_the_3rps() {
    exact_data_give_exact_parameters("3rps", 0.3);
}

#[test]
fn exact_data_give_exact_parameters_of_the_fivebar() {
    exact_data_give_exact_parameters("fivebar", 0.12);
}

#[test]
fn exact_data_give_exact_parameters_of_the_delta() {
    exact_data_give_exact_parameters("delta", 0.2);
}

#[test]
fn exact_data_give_exact_parameters_of_a_7r_arm() {
    exact_data_give_exact_parameters("iiwa14", 0.8);
}

/// A CSV log with the columns of a robot that measures its actuators only.
fn csv(model: &Interpreted<'_>, rows: &[Sample]) -> String {
    let info = model.info();
    let names: Vec<&str> = info
        .independent
        .iter()
        .map(|&c| info.coordinates[c])
        .collect();
    let mut text = "t".to_owned();
    for name in &names {
        let _ = write!(text, ",{name}");
    }
    for name in &names {
        let _ = write!(text, ",tau_{name}");
    }
    text.push('\n');
    for row in rows {
        let _ = write!(text, "{}", row.time);
        for &c in info.independent {
            let _ = write!(text, ",{}", row.q[c]);
        }
        for tau in &row.tau {
            let _ = write!(text, ",{tau}");
        }
        text.push('\n');
    }
    text
}

fn scratch(name: &str, text: &str) -> PathBuf {
    let dir = std::env::temp_dir().join(format!("regen-identify-{}", std::process::id()));
    fs::create_dir_all(&dir).unwrap();
    let path = dir.join(name);
    fs::write(&path, text).unwrap();
    path
}

/// A CSV file with positions and forces of the actuators only must give the parameters.
#[track_caller]
fn a_log_of_actuators_gives_the_parameters(name: &str, reach: f64) {
    let robot = robot(name);
    let terms = BaseTerms::new(&robot);
    let model = Interpreted::with_terms(&robot, &terms);
    let mut random = Random::new(2);
    let series = series(&model, reach, &mut random);
    let (phi, beta) = truth(&model, &mut random);
    let rows = sampled(&model, &series, &phi, 500, 0.01);
    let path = scratch(&format!("{name}.csv"), &csv(&model, &rows));
    let settings = Settings {
        method: Method::Fourier {
            frequency: FREQUENCY,
            harmonics: HARMONICS,
        },
        ..Settings::default()
    };
    let mut logs = Logs::open(&model, std::slice::from_ref(&path), &settings).unwrap();
    let found = identify(&model, EquationKind::Forces, &Options::default(), &mut logs).unwrap();
    // fitting the series again magnifies the rounding of the positions by squared frequencies
    let off = worst(&found.estimate.values, &beta);
    assert!(off < 1e-8, "{name}: {off:e}");
    assert_eq!(logs.reports()[0].states, 500);
    fs::remove_file(path).unwrap();
}

#[test]
fn a_log_of_the_3rps_gives_its_parameters() {
    a_log_of_actuators_gives_the_parameters("3rps", 0.3);
}

#[test]
fn a_log_of_the_fivebar_gives_its_parameters() {
    a_log_of_actuators_gives_the_parameters("fivebar", 0.12);
}

#[test]
fn a_log_of_the_delta_gives_its_parameters() {
    a_log_of_actuators_gives_the_parameters("delta", 0.2);
}

/// A five-bar, and logs of it along one series.
struct Bench {
    robot: Robot,
}

impl Bench {
    fn new() -> Self {
        Self {
            robot: robot("fivebar"),
        }
    }

    fn with<R>(
        &self,
        samples: usize,
        step: f64,
        run: impl FnOnce(&Interpreted<'_>, Vec<Sample>, &[f64]) -> R,
    ) -> R {
        let terms = BaseTerms::new(&self.robot);
        let model = Interpreted::with_terms(&self.robot, &terms);
        let mut random = Random::new(2);
        let series = series(&model, 0.12, &mut random);
        let (phi, beta) = truth(&model, &mut random);
        let rows = sampled(&model, &series, &phi, samples, step);
        run(&model, rows, &beta)
    }
}

/// A normally distributed number (Box and Muller).
fn normal(random: &mut Random) -> f64 {
    let (u, v) = (0.5 - 0.5 * random.signed(), random.signed());
    (-2.0 * u.max(1e-300).ln()).sqrt() * (std::f64::consts::PI * v).cos()
}

fn run(
    model: &Interpreted<'_>,
    path: &Path,
    settings: &Settings,
    kind: EquationKind,
) -> Identified {
    let mut logs = Logs::open(model, &[path.to_path_buf()], settings).unwrap();
    identify(model, kind, &Options::default(), &mut logs).unwrap()
}

fn with(method: Method) -> Settings {
    Settings {
        method,
        ..Settings::default()
    }
}

#[test]
fn data_that_do_not_determine_the_parameters_name_them() {
    Bench::new().with(400, 0.0125, |model, rows, _| {
        // at rest the efforts depend on gravity only
        let mut still = Recorded::new();
        for row in &rows {
            let none = vec![0.0; 4];
            let mut tau = vec![0.0; 2];
            let phi = model.info().nominal_parameters().unwrap();
            let _ = model.gravity(&row.q, &phi, &mut tau).unwrap();
            still.push(row.time, &row.q, &none, &none, &tau);
        }
        let error =
            identify(model, EquationKind::Forces, &Options::default(), &mut still).unwrap_err();
        let EstimateError::Undetermined { labels, rank, .. } = &error else {
            panic!("{error}");
        };
        assert!(
            *rank < 11 && labels.iter().any(|l| l.starts_with("Izz")),
            "{error}"
        );
        // gravity acts through the first moments, so those are determined
        assert!(!labels.iter().any(|l| l.starts_with("mx")), "{error}");
        let short = identify(
            model,
            EquationKind::Forces,
            &Options::default(),
            &mut recorded(&rows[..3]),
        );
        assert!(matches!(
            short,
            Err(EstimateError::TooShort { rows: 6, .. })
        ));
    });
}

#[test]
fn factors_of_parts_merge_to_those_of_the_whole() {
    Bench::new().with(600, 0.01, |model, rows, _| {
        let whole = observe(model, EquationKind::Forces, &mut recorded(&rows))
            .unwrap()
            .0;
        let parts: Vec<FactorSet> = [&rows[..100], &rows[100..350], &rows[350..]]
            .iter()
            .map(|part| {
                observe(model, EquationKind::Forces, &mut recorded(part))
                    .unwrap()
                    .0
            })
            .map(|set| FactorSet::from_text(&set.to_text()).unwrap())
            .rev()
            .collect();
        let merged = FactorSet::merged(parts).unwrap();
        let a = Estimate::new(&whole, Weighting::Equal).unwrap();
        let b = Estimate::new(&merged, Weighting::Equal).unwrap();
        let size = a.values.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        for (x, y) in a.values.iter().zip(&b.values) {
            assert!((x - y).abs() < 1e-12 * size, "{x} {y}");
        }
        for (x, y) in whole.means().iter().zip(merged.means()) {
            assert!((x - y).abs() < 1e-12 * x.abs());
        }
        let means = whole.means();
        let mut source = recorded(&rows);
        let errors = residuals(
            model,
            EquationKind::Forces,
            &mut source,
            &a.values,
            &means,
            5,
        )
        .unwrap();
        assert!(errors.relative_absolute() < 1e-8);
        // another geometry with the same names must have another digest
        let longer = load::derived(&regen_codegen::diag::Source {
            name: "longer".to_owned(),
            text: fs::read_to_string(
                Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots/fivebar.yaml"),
            )
            .unwrap()
            .replace("l1: 0.30", "l1: 0.31"),
        })
        .unwrap();
        let terms = BaseTerms::new(&longer);
        let other = Interpreted::with_terms(&longer, &terms);
        let set = observe(&other, EquationKind::Forces, &mut recorded(&rows[..1]))
            .unwrap()
            .0;
        assert_eq!(
            (set.labels(), set.robot.as_str()),
            (whole.labels(), whole.robot.as_str())
        );
        assert!(FactorSet::merged(vec![set, whole]).is_err());
    });
}
