//! Tests of whole commands: logs in, files out, and these files read again.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command as Process;

use clap::Parser;
use regen_identify::feasibility::{ParameterLayout, Scale};
use regen_identify::friction::JointFit;
use regen_identify::session::cross;
use regen_runtime::Friction;
use serde_json::Value;

use super::{Bench, FREQUENCY, HARMONICS, Sample, csv, normal, sampled, scratch, series, truth};
use crate::args::{Cli, Command};
use crate::exit::Failure;
use crate::{export, identify, load, observe, parameters, validate};
use regen_interpreted::{BaseTerms, Interpreted};
use regen_reference::Random;

/// Runs a command line, whose words are separated by spaces.
fn regen(line: &str) -> Result<(), Failure> {
    let words = std::iter::once("regen").chain(line.split_whitespace());
    match Cli::try_parse_from(words).unwrap().command.unwrap() {
        Command::Identify(args) => identify::run(&args),
        Command::Validate(args) => validate::run(&args),
        Command::Observe(args) => observe::run(&args),
        Command::Export(args) => export::run(&args),
        other => panic!("{other:?} is not tested here"),
    }
}

fn fivebar() -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots");
    root.join("fivebar.yaml").display().to_string()
}

fn json(path: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

/// The physical parameters of a file, by label.
fn physical(file: &Value) -> (Vec<String>, Vec<f64>) {
    let rows = file["physical"].as_array().unwrap().iter();
    rows.map(|row| {
        (
            row["label"].as_str().unwrap().to_owned(),
            number(&row["value"]),
        )
    })
    .unzip()
}

/// A noisy log of the five-bar whose least-squares parameters are not physical.
fn noisy(name: &str, seed: u64, sigma: f64) -> PathBuf {
    Bench::new().with(500, 0.01, |model, mut rows, _| {
        let mut random = Random::new(seed);
        for tau in rows.iter_mut().flat_map(|row| &mut row.tau) {
            *tau += sigma * normal(&mut random);
        }
        scratch(name, &csv(model, &rows))
    })
}

#[test]
fn feasible_parameters_are_written_and_read_back_as_the_same_numbers() {
    let log = noisy("feasible.csv", 3, 0.05);
    let spec = fivebar();
    let file = |name: &str| scratch(name, "");
    let (out, yaml) = (file("feasible.json"), file("feasible.yaml"));
    let (bodies, rust) = (file("bodies.yaml"), file("feasible.rs"));
    let line = format!(
        "identify {spec} {} --fourier {FREQUENCY},{HARMONICS} --feasible --format json",
        log.display()
    );
    regen(&format!(
        "{line} --out {} --bodies {} --rust {} --module fivebar",
        out.display(),
        bodies.display(),
        rust.display()
    ))
    .unwrap();
    regen(&format!("{line} --out {}", yaml.display())).unwrap();

    let written = json(&out);
    let (labels, phi) = physical(&written);
    let layout = ParameterLayout::new(&labels).unwrap();
    assert!(layout.check(&phi, Scale::default()).unwrap().is_physical());
    // every least-squares value has a standard deviation; a feasible value has its own or none
    let least = written["least_squares"].as_array().unwrap();
    for (row, least) in written["parameters"].as_array().unwrap().iter().zip(least) {
        assert!(number(&least["sigma"]) > 0.0 && row["unit"].is_string());
        assert!(row["status"].is_string() && row["sigma"].as_f64().is_none_or(|s| s >= 0.0));
        if let (Some(low), Some(high)) = (row["low"].as_f64(), row["high"].as_f64()) {
            let value = number(&row["value"]);
            assert!(low <= value && value <= high, "{row}");
        }
    }

    // JSON and YAML contain the same parameters to the bit
    let robot = load::robot(Path::new(&spec)).unwrap();
    let terms = BaseTerms::new(&robot);
    let model = Interpreted::with_terms(&robot, &terms);
    let (a, b) = (
        parameters::read(&out, &model).unwrap().beta,
        parameters::read(&yaml, &model).unwrap().beta,
    );
    assert_eq!(a, b);
    regen(&format!(
        "validate {spec} {} {} --beside {} --fourier {FREQUENCY},{HARMONICS}",
        out.display(),
        log.display(),
        yaml.display()
    ))
    .unwrap();

    // the bodies of the written spec are the identified ones, with the same base parameters
    let filled = load::robot(&bodies).unwrap();
    let largest = phi.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let nominal: Vec<f64> = filled.nominal.iter().map(|x| x.unwrap()).collect();
    for (x, y) in nominal.iter().zip(&phi) {
        assert!((x - y).abs() < 1e-12 * largest, "{x} {y}");
    }
    let mut beta = vec![0.0; a.len()];
    regen_runtime::BaseModel::to_base(&model, &nominal, &mut beta).unwrap();
    for (x, y) in beta.iter().zip(&a) {
        assert!((x - y).abs() < 1e-9, "{x} {y}");
    }

    // the constants compile and are the same numbers
    let check = rust.with_file_name("feasible_check.rs");
    let text = fs::read_to_string(&rust).unwrap();
    let last = a.len() - 1;
    let asserts = |digest: u64| {
        format!(
            "mod fivebar {{ pub const DIGEST: u64 = {digest}; }}\n{text}\nfn main() {{ \
             assert!(BETA[{last}] == {:?} && PHI[0] == {:?}); }}\n",
            a[last], phi[0]
        )
    };
    let program = rust.with_extension("run");
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let compile = |digest: u64| {
        fs::write(&check, asserts(digest)).unwrap();
        Process::new(&rustc)
            .args(["--edition", "2024", "-D", "warnings", "-o"])
            .args([&program, &check])
            .output()
            .unwrap()
    };
    // constants next to the module of another model do not compile
    let digest = regen_codegen::digest::digest(&robot);
    let refused = compile(digest ^ 1);
    assert!(!refused.status.success());
    assert!(String::from_utf8_lossy(&refused.stderr).contains("are of another model"));
    assert!(compile(digest).status.success());
    assert!(Process::new(&program).status().unwrap().success());
    for path in [log, out, yaml, bodies, rust, check, program] {
        fs::remove_file(path).unwrap();
    }
}

#[test]
fn feasible_parameters_satisfy_known_masses_totals_bounds_and_identical_bodies() {
    let log = noisy("known.csv", 4, 0.05);
    let out = scratch("known.json", "");
    let line = format!(
        "identify {} {} --fourier {FREQUENCY},{HARMONICS} --out {}",
        fivebar(),
        log.display(),
        out.display()
    );
    regen(&format!(
        "{line} --feasible --prior weighted:50 --known m(1)=0.25 --total m(2),m(4)=0.7 \
         --bound m(3)=0.2..0.3 --identical 2,4"
    ))
    .unwrap();
    let (labels, phi) = physical(&json(&out));
    let of = |label: &str| phi[labels.iter().position(|l| l == label).unwrap()];
    assert!((of("m(1)") - 0.25).abs() < 1e-9);
    assert!((of("m(2)") + of("m(4)") - 0.7).abs() < 1e-7);
    assert!((0.2 - 1e-7..=0.3 + 1e-7).contains(&of("m(3)")));
    assert!((of("Izz(2)") - of("Izz(4)")).abs() < 1e-12);
    // wrong options are refused with a message
    let wrong = regen(&format!("{line} --feasible --known m(9)=1")).unwrap_err();
    assert!(wrong.to_string().contains("m(9)"), "{wrong}");
    let none = regen(&format!("{line} --friction")).unwrap_err();
    assert!(none.to_string().contains("stribeck"), "{none}");
    for path in [log, out] {
        fs::remove_file(path).unwrap();
    }
}

#[test]
fn a_reduction_leaves_out_what_is_zero_within_its_errors_and_its_intervals_hold_the_truth() {
    let (log, other) = (noisy("reduce.csv", 5, 0.05), noisy("against.csv", 6, 0.05));
    let out = scratch("reduced.json", "");
    regen(&format!(
        "identify {} {} --fourier {FREQUENCY},{HARMONICS} --reduce --against {} --out {}",
        fivebar(),
        log.display(),
        other.display(),
        out.display()
    ))
    .unwrap();
    let file = json(&out);
    assert_eq!(file["method"], "reduced");
    assert_eq!(file["feasibility"], "feasible");
    let rows = file["parameters"].as_array().unwrap();
    let status = |text: &str| rows.iter().filter(|r| r["status"] == text).count();
    assert!(status("left out") > 0 && status("well") > 0);
    let exact = Bench::new().with(1, 0.01, |model, _, _| truth(model, &mut Random::new(9)).1);
    for ((row, least), exact) in rows
        .iter()
        .zip(file["least_squares"].as_array().unwrap())
        .zip(exact)
    {
        let number = |row: &Value, key: &str| row[key].as_f64().unwrap();
        if row["status"] == "left out" {
            assert!(
                number(least, "value").abs() < 2.0 * number(least, "sigma"),
                "{row} {least}"
            );
        } else {
            assert!(
                (number(row, "low")..=number(row, "high")).contains(&exact),
                "{row} {exact}"
            );
            assert!(
                number(row, "sigma") >= number(least, "sigma"),
                "{row} {least}"
            );
        }
    }
    for path in [log, other, out] {
        fs::remove_file(path).unwrap();
    }
}

/// Adds Stribeck friction at the cranks of the five-bar.
fn with_friction(rows: &mut [Sample], places: [usize; 2], laws: &[JointFit; 2]) {
    for row in rows {
        for ((tau, place), law) in row.tau.iter_mut().zip(places).zip(laws) {
            *tau += law.effort(row.qd[place]);
        }
    }
}

#[test]
fn nonlinear_friction_is_identified_from_a_log_and_predicts_another() {
    let text = fs::read_to_string(fivebar()).unwrap();
    let text = text.replace("actuated: true", "actuated: true, friction: stribeck");
    let spec = scratch("stribeck_fivebar.yaml", &text);
    let robot = load::robot(&spec).unwrap();
    let terms = BaseTerms::new(&robot);
    let model = Interpreted::with_terms(&robot, &terms);
    let laws = [
        ("q1", [1.0, 2.0, 0.2, 1.5, 0.5]),
        ("q3", [0.8, 1.5, 0.3, 1.2, 0.7]),
    ]
    .map(|(name, values)| JointFit {
        name: name.to_owned(),
        friction: Friction::Stribeck,
        values: values.to_vec(),
    });
    let places = ["q1", "q3"].map(|name| model.info().index_of(name).unwrap());
    let log = |seed: u64, name: &str| {
        let series = series(&model, 0.12, &mut Random::new(seed));
        let (phi, _) = truth(&model, &mut Random::new(9));
        let mut rows = sampled(&model, &series, &phi, 250, 0.02);
        with_friction(&mut rows, places, &laws);
        scratch(name, &csv(&model, &rows))
    };
    let (one, two) = (log(1, "stribeck1.csv"), log(2, "stribeck2.csv"));
    let out = scratch("stribeck.yaml", "");
    let reading = format!("--fourier {FREQUENCY},{HARMONICS}");
    regen(&format!(
        "identify {} {} {reading} --friction --against {} --out {}",
        spec.display(),
        one.display(),
        two.display(),
        out.display()
    ))
    .unwrap();
    let found = parameters::read(&out, &model).unwrap().friction;
    for (found, law) in found.iter().zip(&laws) {
        assert_eq!(found.friction, Friction::Stribeck);
        for (a, b) in found.values.iter().zip(&law.values) {
            assert!(
                (a - b).abs() < 1e-3 * b,
                "{:?} {:?}",
                found.values,
                law.values
            );
        }
    }
    regen(&format!(
        "validate {} {} {} {reading}",
        spec.display(),
        out.display(),
        two.display()
    ))
    .unwrap();
    for path in [spec, one, two, out] {
        fs::remove_file(path).unwrap();
    }
}

#[test]
fn cross_validation_weights_outliers_down_as_the_estimate_does() {
    let log = |name: &str, seed: u64, outliers: bool| {
        Bench::new().with(500, 0.01, |model, mut rows, _| {
            let mut random = Random::new(seed);
            for (k, row) in rows.iter_mut().enumerate() {
                for tau in &mut row.tau {
                    *tau += 0.01 * normal(&mut random);
                    if outliers && k % 25 == 0 {
                        *tau += 20.0;
                    }
                }
            }
            scratch(name, &csv(model, &rows))
        })
    };
    let (clean, outlying) = (log("cross1.csv", 7, false), log("cross2.csv", 8, true));
    let error = |huber: &str| -> f64 {
        let words = format!(
            "regen identify {} {} {} --fourier {FREQUENCY},{HARMONICS} --cross {huber}",
            fivebar(),
            clean.display(),
            outlying.display()
        );
        let Some(Command::Identify(args)) = Cli::try_parse_from(words.split_whitespace())
            .unwrap()
            .command
        else {
            panic!("{words}");
        };
        let robot = load::robot(&args.file).unwrap();
        let terms = BaseTerms::new(&robot);
        let model = Interpreted::with_terms(&robot, &terms);
        // the error of the clean log, predicted by parameters from the log with outliers
        cross(&identify::session(&args, &model), &args.logs).unwrap()[0].relative_absolute
    };
    let (plain, robust) = (error(""), error("--huber 1.345"));
    assert!(robust < 0.3 * plain, "{robust} {plain}");
    for path in [clean, outlying] {
        fs::remove_file(path).unwrap();
    }
}
