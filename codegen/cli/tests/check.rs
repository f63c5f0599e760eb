//! `regen check`.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use crate::common::{mechanism, oracle, regen, root, scratch};

#[test]
fn a_mechanism_is_explained_in_80_columns() {
    let dir = scratch("check-human");
    for file in [
        mechanism("delta.yaml"),
        mechanism("parallelogram_cut.yaml"),
        oracle("3rps.yaml"),
    ] {
        let run = regen(&dir, &["check", &file]).ended(0);
        assert!(
            run.out.lines().all(|line| line.chars().count() <= 80),
            "{}",
            run.out
        );
        for title in [
            "Coordinates",
            "Loops",
            "How the bodies move",
            "Parameters without any effect",
        ] {
            assert!(run.out.contains(title), "{title}\n{}", run.out);
        }
    }
    let run = regen(&dir, &["check", &mechanism("parallelogram_cut.yaml")]).ended(0);
    let words = run.out.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(
        words.contains("q3 = q1 on this branch (holds at 12 sampled states"),
        "{words}"
    );
}

#[test]
fn the_json_gives_the_evidence_of_each_statement() {
    let dir = scratch("check-json");
    let run = regen(
        &dir,
        &["check", &mechanism("delta.yaml"), "--format", "json"],
    )
    .ended(0);
    let found = run.json();
    assert_eq!(found["robot"], "delta");
    assert_eq!(found["mobility"], 3);
    let bodies = found["bodies"].as_array().unwrap();
    let platform = bodies.iter().find(|b| b["body"] == "platform").unwrap();
    assert_eq!(platform["evidence"], "sampled");
    assert!(platform["digits"].as_u64().unwrap() > 80);
    assert_eq!(platform["motion"], "never rotates: it translates only");
    let crank = bodies.iter().find(|b| b["body"] == "crank1").unwrap();
    assert_eq!(crank["evidence"], "exact");
    assert_eq!(crank["direction"], serde_json::json!([1.0, 0.0, 0.0]));
    let unseen = found["without_effect"].as_array().unwrap();
    let platform = unseen
        .iter()
        .find(|u| u["reason"] == "body platform never rotates");
    let platform = platform.unwrap();
    assert_eq!(platform["parameters"].as_array().unwrap().len(), 9);
    assert_eq!(platform["rests_on"], "completed");
}

#[test]
fn a_mechanism_that_does_not_close_is_an_error_of_its_spec() {
    let dir = scratch("check-open");
    let text = std::fs::read_to_string(mechanism("parallelogram_cut.yaml")).unwrap();
    std::fs::write(dir.join("open.yaml"), text.replace("w: 0.25", "w: 2.5")).unwrap();
    let text = std::fs::read_to_string(dir.join("open.yaml")).unwrap();
    assert!(text.contains("w: 2.5"));
    std::fs::write(
        dir.join("open.yaml"),
        text.replace("xyz: [w, 0, 0]}, {body: 3", "xyz: [w/9, 0, 0]}, {body: 3"),
    )
    .unwrap();
    let run = regen(&dir, &["check", "open.yaml"]).ended(3);
    assert!(run.err.contains("do not close"), "{}", run.err);

    // a rod of 9 m whose end comes no nearer than 6 m to that of two rods of 1 m
    let text =
        std::fs::read_to_string(root().join("tests/trybuild/ui/spec/home_does_not_close.yaml"));
    std::fs::write(dir.join("far.yaml"), text.unwrap()).unwrap();
    let run = regen(&dir, &["check", "far.yaml"]).ended(3);
    let (_, told) = run.err.split_once("cut 'pin' gapes by ").unwrap();
    let gap: f64 = told.split(' ').next().unwrap().parse().unwrap();
    assert!((6.0..9.0).contains(&gap), "{}", run.err);
    assert!(
        run.err.contains("`regen view` draws the gaps"),
        "{}",
        run.err
    );

    // without a home, that is what to mend first
    let text = std::fs::read_to_string(root().join("robots/3rps.yaml")).unwrap();
    let without: Vec<&str> = text.lines().filter(|l| !l.starts_with("home:")).collect();
    std::fs::write(dir.join("nowhere.yaml"), without.join("\n")).unwrap();
    let run = regen(&dir, &["check", "nowhere.yaml"]).ended(3);
    assert!(run.err.contains("there is no `home`"), "{}", run.err);
}

#[test]
fn a_cut_whose_axes_are_opposite_at_home_is_refused_with_what_turns_them() {
    let dir = scratch("check-opposite-axes");
    let text = std::fs::read_to_string(root().join("robots/fivebar.yaml")).unwrap();
    for joint in ["revolute", "cylindrical"] {
        let file = format!("{joint}.yaml");
        let write = |second: &str| {
            let cut = format!(
                "joint: {joint}, between: [{{body: 2, xyz: [l2, 0, 0]}}, {{body: 4, xyz: [l2, 0, 0], rpy: [{second}, 0, 0]}}]"
            );
            let before = "joint: revolute, between: [{body: 2, xyz: [l2, 0, 0]}, {body: 4, xyz: [l2, 0, 0]}]";
            assert!(text.contains(before));
            std::fs::write(dir.join(&file), text.replace(before, &cut)).unwrap();
        };
        write("pi");
        let run = regen(&dir, &["check", &file]).ended(3);
        for words in [
            "axes of A and B point in opposite directions",
            "cut 'tip'",
            "add pi to the first angle of the rpy",
        ] {
            assert!(run.err.contains(words), "{words}\n{}", run.err);
        }
        // what the message says
        write("pi + pi");
        regen(&dir, &["verify", &file]).ended(0);
    }
}
