//! `regen verify`: the numeric method compared with the analytic one.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;

use crate::common::{mechanism, oracle, regen, root, scratch, workspace};

#[test]
fn the_oracle_robots_have_the_same_symbolic_and_numeric_base_parameters() {
    let dir = scratch("verify-robots");
    for name in ["3rps", "fivebar", "puma560", "tree_branch"] {
        let file = oracle(&format!("{name}.yaml"));
        // the copy is outside of the workspace, so that no generated module is checked with it
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

/// Every robot, and the guide's page: the current output of the command, byte for byte.
#[test]
fn the_guide_shows_the_evidence_for_every_robot() {
    let run = regen(&root(), &["verify", "--all", "--format", "markdown"]).ended(0);
    let page = root().join("runtime/guide/pages/evidence-table.md");
    let shown = fs::read_to_string(page).unwrap();
    assert_eq!(
        run.out, shown,
        "update it with: regen verify --all --format markdown > runtime/guide/pages/evidence-table.md"
    );
    let robots = fs::read_dir(root().join("robots")).unwrap();
    let is_spec = |e: &fs::DirEntry| e.path().extension().is_some_and(|e| e == "yaml");
    let count = robots.filter(|e| is_spec(e.as_ref().unwrap())).count();
    assert_eq!(shown.lines().count(), count + 2);
    assert!(
        !shown.contains("open") && !shown.contains("none"),
        "{shown}"
    );
}

#[test]
fn the_evidence_of_ones_own_spec_fits_80_columns_and_is_json_too() {
    let dir = scratch("verify-evidence");
    for name in ["fivebar", "tree_branch"] {
        fs::copy(
            oracle(&format!("{name}.yaml")),
            dir.join(format!("{name}.yaml")),
        )
        .unwrap();
    }
    // an experiment file beside its spec is no robot
    fs::write(dir.join("runs.yaml"), "runs: []\n").unwrap();
    let one = regen(&dir, &["verify", "--all", "fivebar.yaml"]).ended(0);
    let all = regen(&dir, &["verify", "--all", "."]).ended(0);
    for run in [&one, &all] {
        for line in run.out.lines() {
            assert!(line.chars().count() <= 80, "{line}");
        }
    }
    assert!(all.out.contains("fivebar") && all.out.contains("tree_branch"));
    let json = regen(&dir, &["verify", "--all", ".", "--format", "json"])
        .ended(0)
        .json();
    let robots = json.as_array().unwrap();
    assert_eq!(robots.len(), 2);
    for robot in robots {
        assert_eq!(robot["ok"], true);
        for check in robot["checks"].as_array().unwrap() {
            // there are no vectors for these, and the tree has no loop
            let absent = check["verdict"] == "absent";
            assert!(absent || check["verdict"] == "holds", "{check}");
            assert_eq!(absent, check["figure"].is_null(), "{check}");
        }
    }
}

#[test]
fn failed_evidence_exits_with_1_and_is_named() {
    let dir = scratch("verify-evidence-fails");
    fs::create_dir(dir.join("vectors")).unwrap();
    let text = fs::read_to_string(root().join("robots/fivebar.yaml")).unwrap();
    fs::write(
        dir.join("fivebar.yaml"),
        text.replace("l1: 0.30", "l1: 0.31"),
    )
    .unwrap();
    let vectors = root().join("tests/fixtures/vectors/fivebar.json");
    fs::copy(vectors, dir.join("vectors/fivebar.json")).unwrap();
    let run = regen(&dir, &["verify", "--all", "fivebar.yaml"]).ended(1);
    assert!(run.out.contains("FAILED"), "{}", run.out);
    assert!(run.err.contains("another program"), "{}", run.err);
    fs::write(dir.join("vectors/fivebar.json"), "{}").unwrap();
    let run = regen(&dir, &["verify", "--all", "fivebar.yaml"]).ended(3);
    assert!(run.err.contains("vectors/forces.py"), "{}", run.err);
    let run = regen(&dir, &["verify", "fivebar.yaml", "--format", "markdown"]).ended(2);
    assert!(run.err.contains("--all"), "{}", run.err);
}

#[test]
fn the_report_fits_80_columns_and_names_every_method() {
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

/// Axes so nearly parallel that double precision cannot resolve the effect of some parameters.
/// A parallelogram, whose coupler never turns: its columns are the rounding of the state.
const PARALLELOGRAM: &str = "\
name: parallelogram
limbs:
  - name: left
    base: {rpy: [pi/2, 0, 0]}
    joints:
      - {name: q1, type: revolute, body: crank, actuated: true}
      - {name: q2, type: revolute, dh: {a: 0.25}, body: coupler}
  - name: right
    base: {xyz: [0.7, 0, 0], rpy: [pi/2, 0, 0]}
    joints: [{name: q3, type: revolute, body: rocker}]
cuts:
  - {name: pin, joint: revolute, between: [{body: coupler, xyz: [0.7, 0, 0]}, {body: rocker, xyz: [0.25, 0, 0]}]}
home: {q1: 1.1, q2: -1.1, q3: 1.1}
";

/// A nut on a screw with a lead of few millimetres lifts a table.
const SCREW: &str = "\
name: screw
limbs:
  - name: nut
    joints: [{name: n, type: revolute, body: nut, actuated: true}]
  - name: table
    joints: [{name: z, type: prismatic, body: table}]
cuts:
  - {name: thread, joint: helical, pitch: LEAD, between: [{body: nut}, {body: table}]}
";

#[test]
fn bodies_that_never_turn_and_screws_of_small_leads_pass() {
    let dir = scratch("verify-degenerate");
    let of = |lead: &str| SCREW.replace("LEAD", lead);
    for (name, spec) in [
        ("parallelogram", PARALLELOGRAM.to_owned()),
        ("lead of 4 mm", of("0.004")),
        ("lead of 20 mm", of("0.02")),
    ] {
        fs::write(dir.join("robot.yaml"), spec).unwrap();
        let run = regen(&dir, &["verify", "robot.yaml", "--format", "json"]);
        assert_eq!(run.code, 0, "{name}: {}", run.err);
        let base = &run.json()["base"];
        assert_eq!(base["svd"]["rank"], base["certificate"], "{name}: {base}");
    }
}

#[test]
fn a_rank_that_double_precision_cannot_decide_is_a_doubt_and_no_failure() {
    let dir = scratch("verify-doubt");
    let spec = "\
name: skewed
limbs:
  - name: arm
    joints:
      - {name: q1, type: revolute, body: 1, actuated: true}
      - {name: q2, type: revolute, dh: {alpha: 1e-9, a: 0.1}, body: 2, actuated: true}
      - {name: q3, type: revolute, dh: {alpha: 1e-9, a: 0.1}, body: 3, actuated: true}
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

#[test]
fn a_body_of_which_only_the_mass_is_stated_is_verified() {
    let dir = scratch("verify_mass_alone");
    let text = crate::common::pendulum("arm") + "bodies:\n  1: {mass: 2}\n";
    fs::write(dir.join("arm.yaml"), text).unwrap();
    regen(&dir, &["verify", "--all", "arm.yaml"]).ended(0);
}
