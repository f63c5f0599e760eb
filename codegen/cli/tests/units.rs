//! The same robot in other units: metres, millimetres and tonnes, or a millionth of its size. The
//! results must be the same after scaling back.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;
use std::path::Path;

use crate::common::{regen, root, scratch};
use serde_json::{Value, json};

/// Multiplies a scalar of the file by a power of ten, exactly.
fn times(value: &mut Value, exponent: i32) {
    let text = match &*value {
        Value::String(text) => text.clone(),
        Value::Number(number) => number.to_string(),
        other => panic!("{other:?} is not a scalar"),
    };
    *value = Value::String(format!("10^({exponent})*({text})"));
}

fn each(value: Option<&mut Value>, exponent: i32) {
    if let Some(list) = value.and_then(Value::as_array_mut) {
        for value in list {
            times(value, exponent);
        }
    }
}

/// The spec with lengths in units of 10^-`length` m, masses in 10^-`mass` kg, and seconds. Limits
/// are removed; friction and rotors of revolute joints are torques, and scale with mass length^2.
fn rescaled(text: &str, length: i32, mass: i32) -> String {
    // without this option `y`, the name of an axis, is a boolean
    let options = serde_saphyr::options! { strict_booleans: true };
    let mut spec: Value = serde_saphyr::from_str_with_options(text, options).unwrap();
    // names are defined by earlier ones: they keep their order and values
    spec.as_object_mut().unwrap().remove("geometry");
    let mut inside = false;
    let names = text.lines().filter(|line| {
        if !line.starts_with([' ', '#']) && !line.is_empty() {
            inside = line.starts_with("geometry:");
        }
        inside
    });
    let names: String = names.flat_map(|line| [line, "\n"]).collect();
    if spec.get("gravity").is_none() {
        spec["gravity"] = json!([0, 0, -9.81]);
    }
    each(spec.get_mut("gravity"), length);
    let mut slides = Vec::new();
    for limb in spec["limbs"].as_array_mut().unwrap() {
        each(limb.get_mut("base").and_then(|b| b.get_mut("xyz")), length);
        for joint in limb["joints"].as_array_mut().unwrap() {
            for key in ["a", "d"] {
                if let Some(value) = joint.get_mut("dh").and_then(|dh| dh.get_mut(key)) {
                    times(value, length);
                }
            }
            each(
                joint.get_mut("origin").and_then(|o| o.get_mut("xyz")),
                length,
            );
            let sliding = joint["type"] == "prismatic";
            if sliding {
                slides.push(joint["name"].as_str().unwrap().to_owned());
            }
            let force = if sliding { mass } else { mass + 2 * length };
            if let Some(nominal) = joint.get_mut("nominal").and_then(Value::as_object_mut) {
                for value in nominal.values_mut() {
                    times(value, force);
                }
            }
            let joint = joint.as_object_mut().unwrap();
            joint.remove("limits");
        }
    }
    if let Some(cuts) = spec.get_mut("cuts").and_then(Value::as_array_mut) {
        for side in cuts
            .iter_mut()
            .flat_map(|c| c["between"].as_array_mut().unwrap())
        {
            each(side.get_mut("xyz"), length);
        }
    }
    for name in slides {
        if let Some(value) = spec.get_mut("home").and_then(|h| h.get_mut(&name)) {
            times(value, length);
        }
    }
    if let Some(bodies) = spec.get_mut("bodies").and_then(Value::as_object_mut) {
        for body in bodies.values_mut() {
            times(&mut body["mass"], mass);
            each(body.get_mut("com"), length);
            each(body.get_mut("inertia"), mass + 2 * length);
        }
    }
    names + &serde_saphyr::to_string(&spec).unwrap()
}

/// The power of ten of a parameter's unit, by the parameter's label.
fn unit(label: &str, length: i32, mass: i32) -> f64 {
    let (symbol, _) = label.split_once('(').unwrap();
    let lengths = match symbol {
        "m" => 0,
        "mx" | "my" | "mz" => 1,
        // inertias, and friction and rotors of revolute joints
        _ => 2,
    };
    10_f64.powi(mass + lengths * length)
}

fn read(robot: &str) -> String {
    fs::read_to_string(root().join("robots").join(robot)).unwrap()
}

fn base(dir: &Path, text: &str) -> Value {
    fs::write(dir.join("robot.yaml"), text).unwrap();
    regen(dir, &["base", "robot.yaml", "--format", "json"])
        .ended(0)
        .json()
}

/// Random exponents from a fixed seed: a length of a metre appears as anything from nanometres to
/// thousands of kilometres.
fn exponents(count: usize) -> Vec<i32> {
    let mut state = 11_u64;
    (0..count)
        .map(|_| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 33) as i32 % 7
        })
        .zip([1, -1].into_iter().cycle())
        .map(|(k, sign)| sign * (k + 1))
        .collect()
}

#[test]
fn base_parameters_are_the_same_combinations_in_any_units() {
    let dir = scratch("units-base");
    let robots = [
        "3rps.yaml",
        "fivebar.yaml",
        "scara.yaml",
        "delta.yaml",
        "slider_crank.yaml",
    ];
    for (robot, length) in robots.iter().cycle().zip(exponents(5)) {
        let usual = base(&dir, &rescaled(&read(robot), 0, 0));
        let other = base(&dir, &rescaled(&read(robot), length, 0));
        assert_eq!(usual["rank"], other["rank"], "{robot} 10^{length}");
        let rows = |json: &Value| json["base"].as_array().unwrap().clone();
        for (a, b) in rows(&usual).iter().zip(rows(&other)) {
            let label = a["label"].as_str().unwrap();
            assert_eq!(a["label"], b["label"], "{robot} 10^{length}");
            let terms = |row: &Value| row["terms"].as_array().unwrap().clone();
            let (ours, theirs) = (terms(a), terms(&b));
            assert_eq!(ours.len(), theirs.len(), "{robot} 10^{length} {label}");
            for (x, y) in ours.iter().zip(&theirs) {
                assert_eq!(x["parameter"], y["parameter"]);
                let parameter = x["parameter"].as_str().unwrap();
                let factor = unit(label, length, 0) / unit(parameter, length, 0);
                let (x, y) = (x["value"].as_f64().unwrap(), y["value"].as_f64().unwrap());
                // exact values, rounded once; powers of ten are rounded too
                assert!(
                    (y - x * factor).abs() <= 1e-14 * y.abs(),
                    "{robot} {label} {x} {y}"
                );
            }
        }
    }
}

#[test]
fn every_check_passes_in_any_units() {
    let dir = scratch("units-verify");
    let robots = [
        "3rps.yaml",
        "3rrr.yaml",
        "slider_crank.yaml",
        "tree_branch.yaml",
        "3prs.yaml",
    ];
    for (robot, length) in robots.iter().cycle().zip(exponents(5)) {
        fs::write(
            dir.join("robot.yaml"),
            rescaled(&read(robot), length.clamp(-6, 6), 0),
        )
        .unwrap();
        let run = regen(&dir, &["verify", "--all", "robot.yaml"]);
        assert_eq!(run.code, 0, "{robot} 10^{length}\n{}{}", run.out, run.err);
        assert!(
            !run.out.contains("open"),
            "{robot} 10^{length}\n{}",
            run.out
        );
        let run = regen(&dir, &["verify", "robot.yaml"]);
        assert_eq!(run.code, 0, "{robot} 10^{length}\n{}{}", run.out, run.err);
    }
}

/// The guide's five-bar and its log, with torques scaled with mass length^2: in millimetres and
/// tonnes, as a toy of a millimetre and a milligram whose inertias are 1e-15 kg m^2, and as a
/// crane.
#[test]
fn identified_parameters_are_the_same_in_any_units() {
    let dir = scratch("units-identify");
    let guide = root().join("runtime/guide/fivebar");
    let text = fs::read_to_string(guide.join("fivebar.yaml")).unwrap();
    let log = fs::read_to_string(guide.join("run1.csv")).unwrap();
    let mut found: Vec<(Vec<(String, f64)>, String)> = Vec::new();
    for (length, mass) in [(0, 0), (3, -3), (-3, -6), (3, 6)] {
        fs::write(dir.join("robot.yaml"), rescaled(&text, length, mass)).unwrap();
        let force = 10_f64.powi(mass + 2 * length);
        let mut scaled = String::new();
        for (k, line) in log.lines().enumerate() {
            let cells = line.split(',').enumerate().map(|(column, cell)| {
                if k == 0 || column < 3 {
                    return cell.to_owned();
                }
                (cell.parse::<f64>().unwrap() * force).to_string()
            });
            scaled.push_str(&cells.collect::<Vec<_>>().join(","));
            scaled.push('\n');
        }
        fs::write(dir.join("run.csv"), scaled).unwrap();
        let args = "identify robot.yaml run.csv --butterworth 4,20 --feasible --format json";
        let args: Vec<&str> = args.split(' ').collect();
        let json = regen(&dir, &args).ended(0).json();
        let mut values = Vec::new();
        let rows = json["parameters"].as_array().unwrap();
        let feasible = json["models"][1]["base"].as_array().unwrap();
        assert_eq!(json["models"][1]["name"], "feasible");
        assert_eq!(rows.len(), feasible.len());
        for (row, physical) in rows.iter().zip(feasible) {
            let label = row["label"].as_str().unwrap();
            let unit = unit(label, length, mass);
            values.push((label.to_owned(), row["value"].as_f64().unwrap() / unit));
            values.push((
                format!("feasible {label}"),
                physical.as_f64().unwrap() / unit,
            ));
        }
        let feasibility = json["models"][0]["feasibility"].as_str().unwrap();
        found.push((values, feasibility[..8].to_owned()));
    }
    let (usual, verdict) = &found[0];
    assert_eq!(verdict, "feasible");
    for (other, said) in &found[1..] {
        assert_eq!(said, verdict);
        assert_eq!(usual.len(), other.len());
        for ((label, x), (same, y)) in usual.iter().zip(other) {
            assert_eq!(label, same);
            // least squares loses the condition number times epsilon; the semidefinite programme is
            // solved to 1e-9 of the largest parameter in its units
            let tolerance = if label.starts_with("feasible") {
                1e-6 * x.abs() + 1e-8
            } else {
                1e-9 * x.abs()
            };
            assert!((x - y).abs() <= tolerance, "{label}: {x} {y}");
        }
    }
}
