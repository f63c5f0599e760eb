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
    assert_eq!(platform["rests_on"], "proven");
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
fn a_loop_that_closes_almost_is_told_to_have_rounded_lengths() {
    let dir = scratch("check-rounded");
    let text = std::fs::read_to_string(root().join("tests/fixtures/base/bennett.yaml")).unwrap();
    for (b, is_rounded) in [("0.3000002", true), ("0.37", false)] {
        let off = text.replace("b: 0.3,", &format!("b: {b},"));
        std::fs::write(dir.join("b.yaml"), &off).unwrap();
        let run = regen(&dir, &["check", "b.yaml"]).ended(3);
        let told = run
            .err
            .contains("They close almost: where a loop closes for some lengths");
        assert_eq!(told, is_rounded, "{b} {}", run.err);
        assert!(!run.err.contains(". ;"), "{}", run.err);
    }
}

#[test]
fn a_file_of_another_kind_is_named_and_nothing_else_is_asked_of_it() {
    let dir = scratch("check-other-file");
    let files = [
        (
            "runs.yaml",
            "columns: {q1: a}\nruns: [{files: [a.csv]}]\n",
            "an experiment file",
        ),
        (
            "f.json",
            r#"{"format": "regen observation factors", "version": 1, "factors": []}"#,
            "a file of factors",
        ),
        (
            "p.json",
            r#"{"version": 1, "robot": "arm", "parameters": []}"#,
            "a file of parameters",
        ),
    ];
    for (name, text, what) in files {
        std::fs::write(dir.join(name), text).unwrap();
        let run = regen(&dir, &["base", name]).ended(3);
        let told = format!("error: this is {what}");
        assert!(
            run.err.contains(&told) && run.err.matches("error:").count() == 1,
            "{}",
            run.err
        );
        assert!(run.err.contains(&format!("--> {name}:")), "{}", run.err);
    }
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

/// A four-bar between pivots at a distance of `base`, with a crank of 3/10.
fn fourbar(base: &str, coupler: &str, rocker: &str, more: &str) -> String {
    format!(
        "name: bars\nlimbs:\n  - name: left\n    joints:\n      \
         - {{name: q1, type: revolute, body: crank, actuated: true}}\n      \
         - {{name: q2, type: revolute, dh: {{a: 3/10}}, body: coupler}}\n  - name: right\n    \
         base: {{xyz: [{base}, 0, 0]}}\n    \
         joints: [{{name: q3, type: revolute, body: rocker}}]\ncuts:\n  \
         - {{name: pin, joint: revolute, between: [{{body: coupler, xyz: [{coupler}, 0, 0]}}, \
         {{body: rocker, xyz: [{rocker}, 0, 0]}}]}}\n{more}\n"
    )
}

#[test]
fn a_singular_home_is_refused_with_a_home_from_which_base_parameters_are_complete() {
    let dir = scratch("check-singular-home");
    let flat = fourbar("6/10", "6/10", "3/10", "");
    let folded = fourbar("5/10", "4/10", "4/10", "home: {q1: pi, q2: pi, q3: pi}");
    // Newton's method ends near the singular state, not at it
    let near = format!("{flat}home: {{q1: 0, q2: -0.1, q3: 0.2}}\n");
    for (name, text) in [
        ("flat.yaml", &flat),
        ("as_motors.yaml", &format!("{flat}independent: [q1, q2]\n")),
        ("folded.yaml", &folded),
        ("near.yaml", &near),
    ] {
        std::fs::write(dir.join(name), text).unwrap();
        for command in ["check", "base", "generate"] {
            let out: &[&str] = match command {
                "generate" => &["--out", "generated"],
                _ => &[],
            };
            let run = regen(&dir, &[&[command, name], out].concat()).ended(3);
            let words =
                "home is singular: the mechanism has 2 degrees of freedom there, and 1 beside it";
            assert!(run.err.contains(words), "{name} {command}\n{}", run.err);
            assert!(
                !run.err.contains("give a joint with a motor"),
                "{}",
                run.err
            );
        }
        let run = regen(&dir, &["check", name]).ended(3);
        let said = run.err.split("`home: ").nth(1).expect(&run.err);
        let home = said.split('`').next().unwrap();
        let kept = text
            .lines()
            .filter(|l| !l.starts_with("home") && !l.starts_with("indep"));
        let mended = format!("{}\nhome: {home}\n", kept.collect::<Vec<_>>().join("\n"));
        std::fs::write(dir.join("mended.yaml"), mended).unwrap();
        let found = regen(&dir, &["check", "mended.yaml", "--format", "json"])
            .ended(0)
            .json();
        assert_eq!(found["mobility"], 1, "{name} {home}");
        regen(&dir, &["base", "mended.yaml"]).ended(0);
    }
}

#[test]
fn a_mechanism_whose_freedoms_are_the_same_beside_home_has_no_singular_home() {
    let dir = scratch("check-regular-home");
    // one more joint: two freedoms at home and beside it
    let five = fourbar(
        "8/10",
        "4/10",
        "4/10",
        "home: {q1: 2, q2: -0.5, q4: -1, q3: 2}",
    )
    .replace(
        "body: coupler}\n",
        "body: link}\n      - {name: q4, type: revolute, dh: {a: 4/10}, body: coupler}\n",
    );
    // a slider at its dead centre: one freedom there too, which the slider cannot drive
    let slider = "name: slider\nlimbs:\n  - name: left\n    joints:\n      \
                  - {name: q1, type: revolute, body: crank}\n      \
                  - {name: q2, type: revolute, dh: {a: 3/10}, body: rod}\n  - name: right\n    \
                  joints: [{name: s, type: prismatic, axis: x, body: slider, actuated: true}]\ncuts:\n  \
                  - {name: pin, joint: revolute, between: [{body: rod, xyz: [7/10, 0, 0]}, {body: slider}]}\n\
                  home: {s: 1}\n";
    for (name, text, words) in [
        (
            "five.yaml",
            five.as_str(),
            "the mechanism has 2 degrees of freedom at home",
        ),
        (
            "slider.yaml",
            slider,
            "the other coordinates do not follow from [s] at home",
        ),
    ] {
        std::fs::write(dir.join(name), text).unwrap();
        let run = regen(&dir, &["check", name]).ended(3);
        assert!(run.err.contains(words), "{}", run.err);
        assert!(!run.err.contains("home is singular"), "{}", run.err);
    }
}
