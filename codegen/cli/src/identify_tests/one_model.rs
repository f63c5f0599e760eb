//! Tests that all outputs describe one model: with any options, the base parameters, the physical
//! parameters and everything printed or written are of the same model.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use clap::Parser;
use regen_codegen::diag::Source;
use regen_codegen::robot::Robot;
use regen_identify::identify::{EquationKind, Options, identify};
use regen_runtime::{BaseModel, Model};
use serde_json::Value;

use super::{
    FREQUENCY, HARMONICS, Sample, csv, normal, recorded, sampled, scratch, series, truth, worst,
};
use crate::args::{Cli, Command, IdentifyArgs};
use crate::identify::{Outcome, solve};
use crate::{load, observe, outputs, parameters, table};
use regen_identify::model::IdentifiedModel;
use regen_interpreted::{BaseTerms, Interpreted};
use regen_reference::Random;
use regen_report::results::identification_text;

/// The largest difference of base and physical predictions, relative to the largest effort.
const MAX_RELATIVE_DIFFERENCE: f64 = 1e-9;

/// The number of logs made so far, which makes file names unique.
static LOGS_MADE: AtomicUsize = AtomicUsize::new(0);

/// A robot with a noisy log of it: noise makes constraints active.
struct RobotWithLog {
    source: Source,
    robot: Robot,
    rows: Vec<Sample>,
    log: PathBuf,
}

impl RobotWithLog {
    /// - `samples`: the number of samples over one period of the motion, 5 s.
    fn new(name: &str, samples: usize, change: impl Fn(String) -> String) -> Self {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let path = root.join(name).with_extension("yaml");
        let read = load::source(&path).unwrap();
        let source = Source::new(read.name, change(read.text));
        let robot = load::with_base(&source).unwrap();
        let (rows, log) = {
            let terms = BaseTerms::new(&robot);
            let model = Interpreted::with_terms(&robot, &terms);
            let mut random = Random::new(7);
            let series = series(&model, 0.06, &mut random);
            let (phi, _) = truth(&model, &mut random);
            let mut rows = sampled(&model, &series, &phi, samples, 5.0 / samples as f64);
            let efforts = rows.iter().flat_map(|row| &row.tau);
            let largest = efforts.fold(0.0, |m: f64, t| m.max(t.abs()));
            for tau in rows.iter_mut().flat_map(|row| &mut row.tau) {
                *tau += 0.02 * largest * normal(&mut random);
            }
            // tests run in parallel
            let number = LOGS_MADE.fetch_add(1, Ordering::Relaxed);
            let file = format!("one-{}-{number}.csv", name.replace('/', "-"));
            let log = scratch(&file, &csv(&model, &rows));
            (rows, log)
        };
        Self {
            source,
            robot,
            rows,
            log,
        }
    }

    fn args(&self, options: &str) -> IdentifyArgs {
        let words = format!(
            "regen identify {} {} --fourier {FREQUENCY},{HARMONICS} {options} {}",
            self.source.name,
            self.log.display(),
            // an interval from few draws is rough, but must contain its value all the same
            if options.contains("--f") {
                "--draws 6"
            } else {
                ""
            }
        );
        let parsed = Cli::try_parse_from(words.split_whitespace()).unwrap();
        match parsed.command.unwrap() {
            Command::Identify(args) => *args,
            other => panic!("{other:?}"),
        }
    }

    /// Checks everything that must agree after `regen identify` with these options.
    #[track_caller]
    fn check(&self, options: &str) {
        let terms = BaseTerms::new(&self.robot);
        let model = Interpreted::with_terms(&self.robot, &terms);
        let what = format!("{} {options}", self.source.name);
        let args = self.args(options);
        let Outcome {
            json, identified, ..
        } = solve(&args, &model).unwrap_or_else(|error| panic!("{what}: {error}"));
        self.predictions_are_one(&model, &identified, &what);

        // the model read from the file is the same to the bit
        let number = LOGS_MADE.fetch_add(1, Ordering::Relaxed);
        let named = |ending: &str| format!("one-{number}.{ending}");
        let out = scratch(
            &named("json"),
            &parameters::text(&json.file, Path::new("one.json")).unwrap(),
        );
        let read = parameters::read(&out, &model).unwrap();
        assert_eq!(read.beta, identified.beta, "{what}");
        assert_eq!(read.phi, identified.phi, "{what}");
        assert_eq!(read.friction, identified.friction, "{what}");
        let out = scratch(
            &named("yaml"),
            &parameters::text(&json.file, Path::new("one.yaml")).unwrap(),
        );
        assert_eq!(
            parameters::read(&out, &model).unwrap().beta,
            identified.beta
        );

        // the printed values are the same too
        let printed: Value = serde_json::from_str(&table::json(&json)).unwrap();
        let rows = printed["parameters"].as_array().unwrap();
        assert_eq!(rows.len(), identified.beta.len());
        let human = identification_text(&json);
        let adopted = human
            .split("the least-squares estimates, for")
            .next()
            .unwrap();
        assert!(
            !human.contains("NaN") && !human.contains("inf "),
            "{what}\n{human}"
        );
        for (row, value) in rows.iter().zip(&identified.beta) {
            assert_eq!(row["value"].as_f64(), Some(*value), "{what}");
            let label = row["label"].as_str().unwrap();
            let line = format!("  {label} ");
            let mut lines = adopted.lines().filter(|l| l.starts_with(&line));
            let figure = format!(" {} ", table::figure(*value));
            assert!(
                lines.any(|l| l.contains(&figure)),
                "{what}: {label}\n{human}"
            );
            // a value lies in its interval
            if let (Some(low), Some(high)) = (row["low"].as_f64(), row["high"].as_f64()) {
                assert!(low <= *value && *value <= high, "{what}: {row}");
            }
        }
        if let Some(phi) = &identified.phi {
            let rows = printed["physical"].as_array().unwrap();
            let values: Vec<f64> = rows.iter().map(|r| r["value"].as_f64().unwrap()).collect();
            assert_eq!(&values, phi, "{what}");
            // `spec` itself checks that all values read back
            outputs::spec(&self.source, None, &model, &identified)
                .unwrap_or_else(|error| panic!("{what}: {error}"));
        }

        // the Rust constants are the same
        let rust = regen_identify::files::rust_constants(&model, &identified, None).unwrap();
        let number = |line: &str| -> Option<f64> { line.trim().split_once(", //")?.0.parse().ok() };
        let numbers: Vec<f64> = rust.lines().filter_map(number).collect();
        let expected = identified
            .beta
            .iter()
            .chain(identified.phi.iter().flatten())
            .chain(identified.friction.iter().flat_map(|joint| &joint.values));
        assert_eq!(numbers, expected.copied().collect::<Vec<f64>>(), "{what}");

        // the errors that the summary states of the log are those of the model in the file
        let mut log =
            observe::open(&model, std::slice::from_ref(&self.log), &args.reading).unwrap();
        let kind = observe::kind(&args.reading);
        let means = regen_identify::identify::observe(&model, kind, &mut log).unwrap();
        let found = read
            .residuals(&model, kind, &mut log, &means.0.means(), 1)
            .unwrap();
        let (told, own) = (
            json.summary.relative_absolute.unwrap(),
            found.relative_absolute(),
        );
        assert!(
            (told - own).abs() <= MAX_RELATIVE_DIFFERENCE * told,
            "{what}: {told} {own}"
        );
    }

    /// The base parameters predict the same forces as the physical parameters.
    #[track_caller]
    fn predictions_are_one(&self, model: &Interpreted<'_>, found: &IdentifiedModel, what: &str) {
        let Some(phi) = &found.phi else {
            return;
        };
        let dof = model.info().dof();
        let (mut base, mut full) = (vec![0.0; dof], vec![0.0; dof]);
        let (mut largest, mut apart) = (0.0_f64, 0.0_f64);
        for row in self.rows.iter().step_by(17) {
            let (q, qd, qdd) = (&row.q, &row.qd, &row.qdd);
            let _ = model
                .base_inverse_dynamics(q, qd, qdd, &found.beta, &mut base)
                .unwrap();
            let _ = model.inverse_dynamics(q, qd, qdd, phi, &mut full).unwrap();
            for (a, b) in base.iter().zip(&full) {
                largest = largest.max(a.abs());
                apart = apart.max((a - b).abs());
            }
        }
        assert!(
            apart <= MAX_RELATIVE_DIFFERENCE * largest,
            "{what}: {apart:e} of {largest}"
        );
    }
}

/// Options that give every kind of model.
const ALL: [&str; 11] = [
    "",
    "--weighting equal",
    "--huber 1.345",
    "--bandwidth 5 --confidence 0.99",
    "--reduce",
    "--feasible",
    "--feasible --weighting equal --huber 2",
    "--feasible --energy 0.1",
    "--reduce --delay q1=0.004",
    "--feasible --standstill keep --delay q3=0.004",
    "--iv",
];

/// Checks options that need the robot's nominal values and labels.
fn constrained(robot: &RobotWithLog) {
    let nominal: BTreeMap<&str, f64> = robot
        .robot
        .parameters
        .iter()
        .zip(&robot.robot.nominal)
        .filter_map(|(parameter, value)| Some((parameter.label.as_str(), (*value)?)))
        .collect();
    let mass = |k: usize| {
        let label = format!("m({})", robot.robot.bodies[k]);
        let value = nominal[&*label];
        (label, value)
    };
    let ((first, one), (second, two)) = (mass(0), mass(1));
    for options in [
        "--feasible --prior weighted:20".to_owned(),
        "--feasible --prior entropic".to_owned(),
        format!("--feasible --known {first}={one}"),
        format!("--feasible --bound {second}={}..{}", 0.8 * two, 1.1 * two),
        format!("--feasible --total {first},{second}={}", one + two),
    ] {
        robot.check(&options);
    }
}

#[test]
fn a_five_bars_models_are_one_whatever_is_asked_for() {
    let robot = RobotWithLog::new("robots/fivebar", 200, |text| text);
    for options in ALL {
        robot.check(options);
    }
    constrained(&robot);
    robot.check("--feasible --identical 2,4");
}

#[test]
fn an_asymmetric_five_bars_models_are_one_whatever_is_asked_for() {
    let robot = RobotWithLog::new("runtime/guide/fivebar/fivebar", 200, |text| {
        text.replacen("friction: linear", "friction: coulomb_asymmetric", 1)
    });
    for options in ALL {
        robot.check(options);
    }
}

#[test]
fn a_3rps_models_are_one_whatever_is_asked_for() {
    let robot = RobotWithLog::new("robots/3rps_friction", 200, |text| text);
    for options in ["--reduce", "--feasible --prior weighted"] {
        robot.check(options);
    }
}

#[test]
fn nonlinear_frictions_models_are_one() {
    for law in ["atan", "power", "stribeck"] {
        let law = format!("actuated: true, friction: {law}");
        let robot = RobotWithLog::new("robots/fivebar", 100, |text| {
            text.replace("actuated: true", &law)
        });
        robot.check("--friction");
    }
}

/// Small robots, arms and platforms, with each of the options.
#[track_caller]
fn models_are_one(names: &[&str], options: &[&str]) {
    for name in names {
        // as few samples as still determine all parameters, to make the test cheap
        let robot = RobotWithLog::new(&format!("robots/{name}"), 60, |text| text);
        for options in options {
            robot.check(options);
        }
    }
}

#[test]
fn small_robots_models_are_one() {
    models_are_one(
        &["fourbar", "slider_crank", "scara", "3rrr"],
        &["--reduce", "--feasible"],
    );
}

#[test]
fn trees_and_platforms_models_are_one() {
    models_are_one(&["tree_branch", "delta", "palletiser"], &["--feasible"]);
}

/// Options of a fit with every constraint at once, for a robot whose efforts and weights may work
/// against them.
fn all_at_once(robot: &RobotWithLog) -> String {
    let mass = |k: usize| {
        let label = format!("m({})", robot.robot.bodies[k]);
        let places = robot.robot.parameters.iter().zip(&robot.robot.nominal);
        let found = places.filter(|(p, _)| p.label == label);
        let value = found.map(|(_, value)| value.unwrap()).next().unwrap();
        (label, value)
    };
    let ((first, one), (second, two)) = (mass(0), mass(1));
    let last = mass(robot.robot.bodies.len() - 1);
    format!(
        "--feasible --weighting equal --huber 2 --prior weighted:20 --known {first}={one} \
         --bound {second}={}..{} --total {second},{}={}",
        0.8 * two,
        1.1 * two,
        last.0,
        two + last.1
    )
}

/// Large robots, whose equations take the interpreter long: as few samples as still give the fit an
/// optimum, and a physical fit without and with all other options.
#[track_caller]
fn large_robots_models_are_one(names: &[&str]) {
    for name in names {
        let robot = RobotWithLog::new(&format!("robots/{name}"), 40, |text| text);
        robot.check("--feasible");
        robot.check(&all_at_once(&robot));
    }
}

#[test]
fn six_axis_arms_models_are_one() {
    large_robots_models_are_one(&["rx90", "puma560", "stanford", "ur5e"]);
}

#[test]
fn seven_axis_arms_models_are_one() {
    large_robots_models_are_one(&["panda", "iiwa14"]);
}

#[test]
fn large_platforms_models_are_one() {
    large_robots_models_are_one(&["3prs", "linear_delta", "hybrid"]);
}

/// Six loops: one option takes ten seconds, so all options are combined in one run.
#[test]
fn a_stewart_platforms_models_are_one() {
    let robot = RobotWithLog::new("robots/stewart", 24, |text| text);
    robot.check("--feasible");
    robot.check(&all_at_once(&robot));
}

/// The choices about base parameters in the spec: parameters and forms that are zero, bodies that
/// are equal, and base parameters that are dropped. All of them are true of the nominal bodies but
/// the last, which the log contradicts.
#[test]
fn models_with_choices_about_the_base_are_one() {
    let five = |base: &str| {
        let base = format!("\nbase:\n{base}\n");
        RobotWithLog::new("robots/fivebar", 100, |text| text + &base)
    };
    for base in [
        "  zero: [my(1), mx(2) - l2/2*m(2)]",
        "  equal: [[1, 3], [2, 4]]",
        "  drop: [my(2), mx(4)]",
    ] {
        let robot = five(base);
        for options in ["--reduce", "--feasible", "--feasible --prior weighted:20"] {
            robot.check(options);
        }
    }
    let robot = five(
        "  zero: [my(1), mx(2) - l2/2*m(2)]\n  equal: [[1, 3], [2, 4]]\n  drop: [my(2)]\n  \
         eliminate: [m(2)]",
    );
    for options in ALL {
        robot.check(options);
    }
    constrained(&robot);

    let robot = RobotWithLog::new("robots/3rps_friction", 60, |text| {
        let more = "  zero: [mx(1), Ixy(3) + a/2*my(3)]\n  equal: [[1, 4, 6], [2, 5, 7]]\n  \
                    drop: [mx(2), Ixz(3), Iyz(3), mz(3)]\n";
        text.replacen("\nbase:\n", &format!("\nbase:\n{more}"), 1)
    });
    robot.check("--reduce");
    robot.check("--feasible");

    let robot = RobotWithLog::new("robots/rx90", 40, |text| {
        text + "\nbase:\n  zero: [Ixy(2), my(2), mx(5), mz(3)]\n  drop: [mx(3), Ixz(4)]\n"
    });
    robot.check("--feasible");
}

/// A base parameter of bodies that the spec says are equal has the energy of all of them.
#[test]
fn the_balance_of_energy_knows_the_choices_about_the_base() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots/fivebar.yaml");
    let read = load::source(&path).unwrap();
    for choices in [
        "equal: [[1, 3], [2, 4]]",
        "zero: [my(1), mx(2) - l2/2*m(2)]",
    ] {
        let text = format!("{}\nbase: {{{choices}}}\n", read.text);
        let robot = load::with_base(&Source::new(read.name.clone(), text)).unwrap();
        let terms = BaseTerms::new(&robot);
        let model = Interpreted::with_terms(&robot, &terms);
        let mut random = Random::new(11);
        let series = series(&model, 0.12, &mut random);
        let (phi, beta) = truth(&model, &mut random);
        let rows = sampled(&model, &series, &phi, 2000, 0.0025);
        let energy = EquationKind::Energy { window: 0.05 };
        let found = identify(&model, energy, &Options::default(), &mut recorded(&rows)).unwrap();
        let off = worst(&found.estimate.values, &beta);
        assert!(off < 1e-2, "{choices}: {off:e}");
    }
}
