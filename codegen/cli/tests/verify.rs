//! `regen verify`: the numeric path beside the analytic one.
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod common;

use std::fs;

use common::{mechanism, oracle, regen, root, scratch, workspace};

#[test]
fn every_robot_is_verified_beside_the_numeric_path() {
    let dir = scratch("verify-robots");
    let robots = fs::read_dir(root().join("robots")).unwrap();
    let mut files: Vec<String> = robots
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == "yaml"))
        .map(|path| path.display().to_string())
        .collect();
    for name in ["3rps", "fivebar", "puma560", "tree_branch"] {
        files.push(oracle(&format!("{name}.yaml")));
    }
    assert!(files.len() >= 10, "{files:?}");
    for file in files {
        // away from the workspace: whether generated/ is up to date is the gate's question
        fs::copy(&file, dir.join("robot.yaml")).unwrap();
        let run = regen(&dir, &["verify", "robot.yaml", "--format", "json"]).ended(0);
        let report = run.json();
        assert_eq!(report["ok"], true, "{file}");
        let base = &report["base"];
        assert_eq!(base["doubt"], false, "{file}: {base}");
        for rank in [&base["svd"]["rank"], &base["qr"]["rank"], &base["analytic"]] {
            assert_eq!(*rank, base["certificate"], "{file}: {base}");
        }
        let checks = base["checks"].as_array().unwrap();
        assert_eq!(checks.len(), 7, "{file}: {checks:?}");
        assert!(report["checks"].as_array().unwrap().len() >= 15, "{file}");
    }
}

#[test]
fn the_report_fits_80_columns_and_names_every_way() {
    let dir = scratch("verify-human");
    let run = regen(&dir, &["verify", &oracle("3rps.yaml")]).ended(0);
    for part in [
        "certificate",
        "SVD",
        "QR with pivoting",
        "analytic",
        "angle between the null spaces",
        "projection",
        "to_base",
    ] {
        assert!(run.out.contains(part), "no {part:?} in\n{}", run.out);
    }
    for line in run.out.lines() {
        assert!(line.chars().count() <= 80, "{line}");
    }
}

#[test]
fn completed_base_parameters_pass() {
    let dir = scratch("verify-parallelogram");
    let run = regen(&dir, &["verify", &mechanism("parallelogram.yaml")]).ended(0);
    assert!(!run.out.contains("INCOMPLETE"), "{}", run.out);
    assert!(!run.out.contains("FAILED"), "{}", run.out);
}

/// Axes so nearly parallel that some parameters act below double precision's reach.
#[test]
fn a_rank_that_double_precision_cannot_decide_is_a_doubt_and_no_failure() {
    let dir = scratch("verify-doubt");
    let spec = "\
name: skewed
limbs:
  - name: arm
    joints:
      - {name: q1, type: revolute, body: 1, actuated: true}
      - {name: q2, type: revolute, dh: {alpha: 1e-6, a: 0.1}, body: 2, actuated: true}
      - {name: q3, type: revolute, dh: {alpha: 1e-3, a: 0.1}, body: 3, actuated: true}
";
    fs::write(dir.join("skewed.yaml"), spec).unwrap();
    let run = regen(&dir, &["verify", "skewed.yaml"]).ended(0);
    assert!(run.out.contains("leaves a doubt"), "{}", run.out);
    assert!(!run.out.contains("SVD rank ="), "{}", run.out);
    let report = regen(&dir, &["verify", "skewed.yaml", "--format", "json"])
        .ended(0)
        .json();
    let base = &report["base"];
    assert_eq!(base["doubt"], true);
    assert_eq!(base["analytic"], base["certificate"]);
    assert_ne!(base["analytic"], base["svd"]["rank"]);
}

#[test]
fn states_can_be_chosen_but_not_too_few() {
    let dir = scratch("verify-states");
    let file = oracle("fivebar.yaml");
    let args = ["verify", &file, "--states", "30", "--format", "json"];
    let report = regen(&dir, &args).ended(0).json();
    assert_eq!(report["base"]["states"], 30);
    assert_eq!(report["base"]["rows"], 60);
    for few in ["0", "19"] {
        let run = regen(&dir, &["verify", &file, "--states", few]).ended(3);
        assert!(run.err.contains("at least --states 20"), "{}", run.err);
    }
}

#[test]
fn the_module_of_a_robot_of_the_workspace_is_checked_too() {
    let dir = workspace("verify-source", &["arm"]);
    let name = "source on disk";
    let verify = ["verify", "robots/arm.yaml"];
    assert!(!regen(&dir, &verify).ended(0).out.contains(name));
    regen(&dir, &["generate"]).ended(0);
    assert!(regen(&dir, &verify).ended(0).out.contains(name));
    let module = dir.join("generated/src/arm.rs");
    let text = fs::read_to_string(&module).unwrap() + "// more\n";
    fs::write(&module, text).unwrap();
    let run = regen(&dir, &verify).ended(1);
    assert!(run.err.contains(name), "{}", run.err);
}
