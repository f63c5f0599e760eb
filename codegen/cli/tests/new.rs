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
    ] {
        let name = format!("my_{kind}");
        let run = regen(&dir, &["new", &name, "--kind", kind]).ended(0);
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
fn manual_pages_tell_of_every_command() {
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
