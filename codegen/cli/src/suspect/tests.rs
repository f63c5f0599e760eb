//! Tests with planted mistakes in logs: each mistake is reported with its remedy, and correct logs
//! are read without a warning.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;
use std::path::{Path, PathBuf};

use regen_codegen::diag::Source;
use regen_identify::data::{Assignment, Logs, Run, Settings};
use regen_identify::identify::{EquationKind, Options, identify};
use regen_identify::session::{Session, errors_with_columns};
use regen_identify::signals::{Fourier, Method};
use regen_runtime::{LoopClosure, Model};

use super::{LogColumns, Suspected, suspect, with_options};
use crate::load;
use regen_interpreted::{BaseTerms, Interpreted};
use regen_reference::Random;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// A log in memory: its column titles and columns.
#[derive(Clone)]
struct Log {
    titles: Vec<String>,
    columns: Vec<Vec<f64>>,
}

impl Log {
    fn read(path: &Path) -> Self {
        let text = fs::read_to_string(path).unwrap();
        let mut lines = text.lines();
        let titles: Vec<String> = lines
            .next()
            .unwrap()
            .split(',')
            .map(str::to_owned)
            .collect();
        let mut columns = vec![Vec::new(); titles.len()];
        for line in lines {
            for (column, cell) in columns.iter_mut().zip(line.split(',')) {
                column.push(cell.parse().unwrap());
            }
        }
        Self { titles, columns }
    }

    fn text(&self) -> String {
        let mut out = self.titles.join(",") + "\n";
        for k in 0..self.columns[0].len() {
            let cells: Vec<String> = self.columns.iter().map(|c| c[k].to_string()).collect();
            out += &(cells.join(",") + "\n");
        }
        out
    }

    fn place(&self, name: &str) -> usize {
        self.titles.iter().position(|t| t == name).unwrap()
    }

    /// The log with a function applied to every number of some columns.
    fn each(&self, names: &[&str], change: impl Fn(f64) -> f64) -> Self {
        let mut out = self.clone();
        for name in names {
            let place = self.place(name);
            out.columns[place].iter_mut().for_each(|x| *x = change(*x));
        }
        out
    }

    /// The log with two columns exchanged under the same titles.
    fn swapped(&self, a: &str, b: &str) -> Self {
        let mut out = self.clone();
        let (a, b) = (self.place(a), self.place(b));
        out.columns.swap(a, b);
        out
    }
}

/// The warnings about a log, read with these settings.
fn warnings(model: &Interpreted<'_>, log: &Log, settings: &Settings) -> Vec<Suspected> {
    let dir = std::env::temp_dir().join(format!("regen-suspicion-{}", std::process::id()));
    fs::create_dir_all(&dir).unwrap();
    let path = dir.join(format!("{}.csv", model.info().name));
    fs::write(&path, log.text()).unwrap();
    let mut logs = Logs::open(model, std::slice::from_ref(&path), settings).unwrap();
    let found = identify(model, EquationKind::Forces, &Options::default(), &mut logs).ok();
    let used = found.map(|found| found.correlated());
    let sample = logs.sample(0).unwrap();
    let columns = LogColumns {
        file: "log.csv",
        given: &settings.columns,
        model,
    };
    let session = Session::new(model, settings.clone());
    let run = Run::from(path.clone());
    let whole = |columns: &[Assignment]| errors_with_columns(&session, &run, columns).ok();
    let out = suspect::suspicions(&columns, &sample, used.as_ref(), &whole, &mut |_, _| {});
    let out = out.into_iter().map(with_options).collect();
    fs::remove_file(path).unwrap();
    out
}

/// A planted mistake: its name, the log, and the words that the warning must contain.
type Mistake<'a> = (&'a str, Log, &'a [&'a str]);

/// Every mistake must be the first that is reported, in these words; where options are the remedy,
/// the log must be read without a warning with them.
#[track_caller]
fn assert_reported(model: &Interpreted<'_>, settings: &Settings, mistakes: &[Mistake<'_>]) {
    let mut missed = Vec::new();
    for (name, log, words) in mistakes {
        let found = warnings(model, log, settings);
        let text = found
            .iter()
            .map(Suspected::to_string)
            .collect::<Vec<_>>()
            .join("\n");
        println!("{name}: {text}");
        if !words.iter().all(|word| text.contains(word)) {
            missed.push(format!("{name}: wanted {words:?}, got:\n{text}"));
            continue;
        }
        let options = found
            .first()
            .and_then(|first| first.remedy.find("--column"));
        let Some((first, at)) = found.first().zip(options) else {
            continue;
        };
        let mut settings = settings.clone();
        for option in first.remedy[at..]
            .split("--column ")
            .filter(|o| !o.is_empty())
        {
            let given: Assignment = option.trim().trim_matches('\'').parse().unwrap();
            settings.columns.retain(|a| a.quantity != given.quantity);
            settings.columns.push(given);
        }
        let again = warnings(model, log, &settings);
        if !again.is_empty() {
            missed.push(format!(
                "{name}: the remedy {} leaves {}",
                first.remedy, again[0]
            ));
        }
    }
    assert!(missed.is_empty(), "{}", missed.join("\n"));
}

#[test]
fn mistakes_in_the_log_of_a_fivebar_are_reported() {
    let guide = root().join("runtime/guide/fivebar");
    let robot = load::robot(&guide.join("fivebar.yaml")).unwrap();
    let terms = BaseTerms::new(&robot);
    let model = Interpreted::with_terms(&robot, &terms);
    let settings = Settings {
        method: Method::Butterworth {
            order: 4,
            cutoff: 20.0,
        },
        decimation: 5,
        ..Settings::default()
    };
    for run in ["run1.csv", "run2.csv"] {
        let clean = warnings(&model, &Log::read(&guide.join(run)), &settings);
        assert!(clean.is_empty(), "{}", clean[0]);
    }
    let log = Log::read(&guide.join("run1.csv"));
    let both = ["tau_q1", "tau_q3"];
    assert_reported(
        &model,
        &settings,
        &[
            (
                "efforts swapped",
                log.swapped("tau_q1", "tau_q3"),
                &["`tau_q1`", "`tau_q3`", "swapped"],
            ),
            (
                "one sign",
                log.each(&["tau_q3"], |x| -x),
                &["`tau_q3`", "sign", "flipped"],
            ),
            (
                "swapped and a sign",
                log.swapped("tau_q1", "tau_q3").each(&["tau_q1"], |x| -x),
                &["swapped", "`tau_q1`", "sign"],
            ),
            (
                "all signs",
                log.each(&both, |x| -x),
                &["tau_q1", "tau_q3", "flipped"],
            ),
            (
                "positions swapped",
                log.swapped("q1", "q3"),
                &["`q1`", "`q3`", "swapped"],
            ),
            (
                "a position reversed",
                log.each(&["q1"], |x| -x),
                &["`q1`", "sign"],
            ),
            (
                "N mm",
                log.each(&both, |x| 1e3 * x),
                &["mN m", "tau_q1", "tau_q3"],
            ),
            (
                "one in N mm",
                log.each(&["tau_q1"], |x| 1e3 * x),
                &["`tau_q1`", "mN m"],
            ),
            (
                "degrees",
                log.each(&["q1", "q3"], f64::to_degrees),
                &["`q1`", "`q3`", "degrees"],
            ),
            (
                "one in degrees",
                log.each(&["q3"], f64::to_degrees),
                &["`q3`", "degrees"],
            ),
            (
                "a gain is missing",
                log.each(&["tau_q1"], |x| x / 0.12),
                &["`tau_q1`", "gain"],
            ),
            (
                "all gains are missing",
                log.each(&both, |x| x / 0.12),
                &["`tau_q1`, `tau_q3`", "torque constant"],
            ),
            (
                "a constant offset",
                log.each(&["tau_q3"], |x| x + 2.0),
                &["`tau_q3`", "constant of 2."],
            ),
            (
                "kgf",
                log.each(&["tau_q3"], |x| x / 9.806_65),
                &["`tau_q3`"],
            ),
            (
                "efforts swapped, one of them in N mm",
                log.swapped("tau_q1", "tau_q3")
                    .each(&["tau_q1"], |x| -1e3 * x),
                &["swapped", "`tau_q1`", "mN m", "sign"],
            ),
            (
                "a position shifted by much",
                log.each(&["q1"], |x| x - 0.15),
                &["column `q1` looks shifted by -0.15"],
            ),
            (
                "efforts swapped and a constant",
                log.swapped("tau_q1", "tau_q3")
                    .each(&["tau_q1"], |x| x + 3.0),
                &["swapped", "constant of"],
            ),
            (
                "a position reversed and shifted",
                log.each(&["q1"], |x| 0.2 - x),
                &["`q1`", "sign", "shifted by"],
            ),
            (
                "degrees, a sign and a constant",
                log.each(&["q1", "q3"], f64::to_degrees)
                    .each(&["tau_q3"], |x| -2.0 - x),
                &["degrees", "`tau_q3`", "sign"],
            ),
            (
                "times of another rate",
                log.each(&["t"], |x| 2.5 * x),
                &["the rate of the rows looks like"],
            ),
        ],
    );
    // central differences, since a low-pass filter refuses a log with a step of seconds
    let plain = Settings {
        method: Method::Central,
        ..settings
    };
    assert_reported(
        &model,
        &plain,
        &[(
            "ms",
            log.each(&["t"], |t| 1e3 * t),
            &["`t`", "looks like ms"],
        )],
    );
}

/// Friction with coefficients for each direction absorbs a constant offset, and the fit is as good
/// as without it; the offset is detected by the negative friction of one direction.
#[test]
fn an_offset_that_friction_of_two_directions_absorbs_is_reported() {
    let guide = root().join("runtime/guide/fivebar");
    let read = load::source(&guide.join("fivebar.yaml")).unwrap();
    let text = read
        .text
        .replace("friction: linear", "friction: coulomb_asymmetric");
    let robot = load::with_base(&Source::new(read.name, text)).unwrap();
    let terms = BaseTerms::new(&robot);
    let model = Interpreted::with_terms(&robot, &terms);
    let settings = Settings {
        method: Method::Butterworth {
            order: 4,
            cutoff: 20.0,
        },
        decimation: 5,
        ..Settings::default()
    };
    let log = Log::read(&guide.join("run1.csv"));
    let other = Log::read(&guide.join("run2.csv"));
    for clean in [&log, &other] {
        let clean = warnings(&model, clean, &settings);
        assert!(clean.is_empty(), "{}", clean[0]);
    }
    // an offset of the size of friction cannot be distinguished from slightly different friction
    let small = warnings(&model, &log.each(&["tau_q1"], |x| x + 0.01), &settings);
    assert!(small.is_empty(), "{}", small[0]);
    assert_reported(
        &model,
        &settings,
        &[
            (
                "an offset forward",
                log.each(&["tau_q3"], |x| x + 2.0),
                &["`tau_q3`", "constant 2.0", "Fc-(q3) is -", "Subtract 2.0"],
            ),
            (
                "an offset backward",
                log.each(&["tau_q1"], |x| x - 0.5),
                &[
                    "`tau_q1`",
                    "constant -0.49",
                    "Fc+(q1) is -",
                    "Subtract -0.49",
                ],
            ),
        ],
    );
}

/// A log of the 3-RPS with rotors and friction along a series, with noise, and bodies that differ
/// from the nominal ones.
fn legs(model: &Interpreted<'_>, series: &Fourier) -> Log {
    let info = model.info();
    let mut random = Random::new(3);
    let nominal = info.nominal_parameters().unwrap();
    let phi: Vec<f64> = nominal
        .iter()
        .map(|x| x * (1.0 + 0.1 * random.signed()))
        .collect();
    let mut closure = LoopClosure::new(model).unwrap();
    let names = info
        .independent
        .iter()
        .map(|c| info.coordinates[*c].to_owned());
    let names: Vec<String> = names.collect();
    let mut titles = vec!["t".to_owned()];
    titles.extend(names.iter().cloned());
    titles.extend(names.iter().map(|n| format!("tau_{n}")));
    let mut columns = vec![Vec::new(); titles.len()];
    let dof = info.dof();
    for k in 0..800 {
        let time = 0.0125 * f64::from(k);
        let at: Vec<[f64; 3]> = (0..dof).map(|i| series.at(i, time)).collect();
        let pick = |d: usize| -> Vec<f64> { at.iter().map(|p| p[d]).collect() };
        let state = closure.track_state(&pick(0), &pick(1), &pick(2)).unwrap();
        let mut tau = vec![0.0; dof];
        let _ = model
            .inverse_dynamics(&state.q, &state.qd, &state.qdd, &phi, &mut tau)
            .unwrap();
        columns[0].push(time);
        for i in 0..dof {
            columns[1 + i].push(state.q[info.independent[i]] + 1e-6 * random.signed());
            columns[1 + dof + i].push(tau[i] + 1.0 * random.signed());
        }
    }
    Log { titles, columns }
}

/// A constant offset is not tested: upright legs carry a constant weight, which absorbs it.
#[test]
fn mistakes_in_the_log_of_a_3rps_are_reported() {
    let robot = load::robot(&root().join("robots/3rps_friction.yaml")).unwrap();
    let terms = BaseTerms::new(&robot);
    let model = Interpreted::with_terms(&robot, &terms);
    let frequency = 0.2;
    let info = model.info();
    let mut random = Random::new(5);
    let signals: Vec<(f64, Vec<f64>, Vec<f64>)> = info
        .independent
        .iter()
        .map(|c| {
            let rate = 0.04 * std::f64::consts::TAU * frequency;
            let mut draw = || (0..5).map(|_| rate * random.signed()).collect();
            (info.home[*c], draw(), draw())
        })
        .collect();
    let log = legs(&model, &Fourier::new(frequency, &signals).unwrap());
    let settings = Settings {
        method: Method::Fourier {
            frequency,
            harmonics: 5,
        },
        ..Settings::default()
    };
    let clean = warnings(&model, &log, &settings);
    assert!(clean.is_empty(), "{}", clean[0]);
    let all = ["tau_q2", "tau_q7", "tau_q9"];
    assert_reported(
        &model,
        &settings,
        &[
            (
                "efforts swapped",
                log.swapped("tau_q2", "tau_q9"),
                &["`tau_q2`", "`tau_q9`", "swapped"],
            ),
            (
                "one sign",
                log.each(&["tau_q7"], |x| -x),
                &["`tau_q7`", "sign", "flipped"],
            ),
            (
                "swapped and a sign",
                log.swapped("tau_q2", "tau_q7").each(&["tau_q2"], |x| -x),
                &["swapped", "`tau_q2`", "sign"],
            ),
            (
                "all signs",
                log.each(&all, |x| -x),
                &["tau_q2", "tau_q7", "tau_q9", "flipped"],
            ),
            // the legs are equal, so that no log can show whether positions or efforts are swapped
            (
                "positions swapped",
                log.swapped("q7", "q9"),
                &["q7`", "q9`", "swapped"],
            ),
            (
                "mN",
                log.each(&all, |x| 1e3 * x),
                &["mN", "tau_q2", "tau_q7", "tau_q9"],
            ),
            (
                "one in mN",
                log.each(&["tau_q2"], |x| 1e3 * x),
                &["`tau_q2`", "mN"],
            ),
            (
                "mm",
                log.each(&["q2", "q7", "q9"], |x| 1e3 * x),
                &["`q2`", "mm"],
            ),
            (
                "a gain is missing",
                log.each(&["tau_q7"], |x| x / 35.5),
                &["`tau_q7`", "torque constant"],
            ),
        ],
    );
    // more than the whole friction or rotor of a leg is subtracted, like by a drive that
    // overcompensates it before it logs its effort
    let series = Fourier::new(frequency, &signals).unwrap();
    let without = |effort: &str, leg: usize, derivative: usize, part: f64| {
        let mut out = log.clone();
        let place = out.place(effort);
        let times = out.columns[0].clone();
        for (x, time) in out.columns[place].iter_mut().zip(times) {
            *x -= part * series.at(leg, time)[derivative];
        }
        out
    };
    assert_reported(
        &model,
        &settings,
        &[(
            "friction that drives",
            without("tau_q7", 1, 1, 9000.0),
            &["Fv(q7) is -", "cannot be negative", "--feasible"],
        )],
    );
    // a rotor inertia with a nominal value is compared together with the nominal bodies; only one
    // without such a value is left to the check of its sign
    let read = load::source(&root().join("robots/3rps_friction.yaml")).unwrap();
    let stated = read.text.matches(", J: 483.1").count();
    assert_eq!(stated, 3);
    let text = read.text.replace(", J: 483.1", "");
    let other = load::with_base(&Source::new(read.name, text)).unwrap();
    let other_terms = BaseTerms::new(&other);
    assert_reported(
        &Interpreted::with_terms(&other, &other_terms),
        &settings,
        &[(
            "a rotor of negative inertia",
            without("tau_q2", 0, 2, 1000.0),
            &["J(q2) is -", "cannot be negative", "--feasible"],
        )],
    );
    let wrong = Settings {
        method: Method::Fourier {
            frequency: 0.17,
            harmonics: 5,
        },
        ..settings
    };
    assert_reported(
        &model,
        &wrong,
        &[(
            "a wrong frequency",
            log,
            &["the Fourier series leaves", "% of the motion"],
        )],
    );
}
