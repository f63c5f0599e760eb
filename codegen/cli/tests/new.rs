//! `regen new` and `regen man`, as a user runs them.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;

use crate::common::{regen, scratch};

#[test]
fn every_kind_of_new_spec_is_a_robot_with_certified_base_parameters() {
    let dir = scratch("new");
    for (kind, dof, rank) in [
        ("serial", 3, 21),
        ("planar", 2, 15),
        ("parallel", 3, 31),
        ("drives", 3, 24),
        ("delta", 3, 40),
        ("stewart", 6, 94),
    ] {
        let name = format!("my_{kind}");
        // the name of the file is understood too
        let given = if kind == "serial" {
            "my_serial.yaml"
        } else {
            &name
        };
        let run = regen(&dir, &["new", given, "--kind", kind]).ended(0);
        assert!(
            run.out.starts_with(&format!("wrote {name}.yaml\n")),
            "{}",
            run.out
        );
        let file = format!("{name}.yaml");
        let text = fs::read_to_string(dir.join(&file)).unwrap();
        assert!(!text.contains("NAME") && !text.contains("FILE"), "{text}");
        assert!(text.lines().all(|line| line.len() <= 140), "{text}");
        let info = regen(&dir, &["info", &file, "--format", "json"])
            .ended(0)
            .json();
        assert_eq!(info["robot"], name);
        assert_eq!(info["dof"], dof);
        let base = regen(&dir, &["base", &file, "--format", "json"])
            .ended(0)
            .json();
        assert_eq!(base["certificate"]["rank"], rank);
    }
}

/// The commands of a first hour, with a short search for the motion.
#[test]
fn every_kind_goes_from_a_new_spec_to_a_report_without_an_edit() {
    let dir = scratch("new_chain");
    for kind in ["serial", "planar", "parallel", "drives", "delta", "stewart"] {
        let (search, most) = match kind {
            "delta" => ("--steps 6 --harmonics 3", 3.0),
            // six legs need a richer motion
            "stewart" => ("--steps 20 --harmonics 5", 5.0),
            _ => ("--harmonics 3", 3.0),
        };
        let run = |line: &str| {
            let line = line.replace("KIND", kind).replace("SEARCH", search);
            let words: Vec<&str> = line.split_whitespace().collect();
            regen(&dir, &words).ended(0)
        };
        run("new KIND --kind KIND");
        run("check KIND.yaml");
        run("view KIND.yaml --out KIND.html");
        run("excite KIND.yaml --out KIND.json --seed 1 --starts 1 SEARCH");
        run("simulate KIND.yaml --trajectory KIND.json --out KIND.csv");
        let fit =
            run("identify KIND.yaml KIND.csv --butterworth 4,20 --out KIND.p.json --format json");
        // without noise, the remaining error is that of the filter and of the sampling
        let error = fit.json()["relative_absolute"].as_f64().unwrap();
        assert!(error < most, "{kind}: {error} %");
        run("validate KIND.yaml KIND.p.json KIND.csv --butterworth 4,20");
        run("report KIND.yaml KIND.p.json KIND.csv --butterworth 4,20 --out KIND.report.html");
    }
}

#[test]
fn a_table_of_denavit_and_hartenberg_becomes_an_arm_that_is_identified() {
    let dir = scratch("new_table");
    fs::write(
        dir.join("table.csv"),
        "joint,alpha [deg],a [mm],theta,d\nbase,90,0,0,0.3\nshoulder,0,400,0,0\nelbow,0,350,0,0\n",
    )
    .unwrap();
    regen(&dir, &["new", "arm", "--from-dh", "table.csv", "--classic"]).ended(0);
    let base = regen(&dir, &["base", "arm.yaml", "--format", "json"]).ended(0);
    // the first link turns about a fixed axis, so it has one base parameter, the others have seven
    // each; linear friction has two for each of three joints
    assert_eq!(base.json()["certificate"]["rank"], 15 + 6);
    let run = regen(
        &dir,
        &["new", "other", "--kind", "serial", "--from-dh", "table.csv"],
    );
    assert_eq!(run.code, 2, "{}", run.err);
    fs::write(dir.join("table.csv"), "alpha,a,theta\n0,0,0\n").unwrap();
    let run = regen(&dir, &["new", "other", "--from-dh", "table.csv"]).ended(3);
    assert!(run.err.contains("table.csv:1:1"), "{}", run.err);
    assert!(run.err.contains("there is no column 'd'"), "{}", run.err);
    assert!(!dir.join("other.yaml").exists());
}

#[test]
fn a_file_that_exists_is_never_replaced() {
    let dir = scratch("new_exists");
    fs::write(dir.join("mine.yaml"), "my work\n").unwrap();
    let run = regen(&dir, &["new", "mine", "--kind", "serial"]).ended(5);
    assert!(run.err.contains("mine.yaml exists already"), "{}", run.err);
    assert_eq!(
        fs::read_to_string(dir.join("mine.yaml")).unwrap(),
        "my work\n"
    );
    regen(
        &dir,
        &[
            "new",
            "mine",
            "--kind",
            "serial",
            "--out",
            "robots/mine.yaml",
        ],
    )
    .ended(0);
    assert!(dir.join("robots/mine.yaml").exists());
}

#[test]
fn a_name_that_no_module_can_have_is_refused_and_nothing_is_written() {
    let dir = scratch("new_name");
    for name in ["My-Arm", "3rps", "fn", "a\nb: c"] {
        let run = regen(&dir, &["new", name, "--kind", "planar", "--out", "x.yaml"]).ended(3);
        assert!(run.err.contains("name"), "{}", run.err);
        assert!(!dir.join("x.yaml").exists());
    }
}

#[test]
fn manual_pages_list_every_command() {
    let dir = scratch("man");
    let page = regen(&dir, &["man"]).ended(0).out;
    for command in ["new", "identify", "base", "completions"] {
        assert!(page.contains(&format!("regen\\-{command}(1)")), "{page}");
        let own = regen(&dir, &["man", command]).ended(0).out;
        assert!(own.contains(".SH NAME") && own.contains(command), "{own}");
    }
    let run = regen(&dir, &["man", "identifie"]).ended(3);
    assert!(
        run.err.contains("there is no command 'identifie'"),
        "{}",
        run.err
    );
}
