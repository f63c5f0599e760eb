//! Exit codes, and the distribution of output on the two streams.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;
use std::process::Stdio;

use crate::common::{command, oracle, pendulum, regen, scratch, workspace};

#[test]
fn results_go_to_standard_output_and_messages_to_standard_error() {
    let dir = workspace("streams", &["arm"]);
    let run = regen(&dir, &["robots/arm.yaml"]).ended(0);
    assert!(
        run.out.contains("verified at") && !run.out.contains("derived"),
        "{}",
        run.out
    );
    assert!(
        run.err.starts_with("derived robots/arm.yaml in "),
        "{}",
        run.err
    );

    let run = regen(&dir, &["info", "robots/none.yaml"]).ended(5);
    assert_eq!(run.out, "");
    assert!(
        run.err.starts_with("error: cannot read robots/none.yaml: "),
        "{}",
        run.err
    );
}

#[test]
fn a_wrong_command_line_exits_with_2() {
    let dir = scratch("usage");
    for args in [
        &["--frobnicate"][..],
        &["info"],
        &["eval", "x.yaml"],
        &["info", "x.yaml", "--format", "xml"],
        &[],
    ] {
        let run = regen(&dir, args).ended(2);
        assert_eq!(run.out, "", "{args:?}");
        assert!(
            run.err.contains("--help") || run.err.contains("Usage: regen"),
            "{args:?}: {}",
            run.err
        );
    }
}

#[test]
fn the_nearest_command_is_proposed_for_an_unknown_command() {
    let dir = scratch("unknown-command");
    for (args, text) in [
        (&["chekc", "arm.yaml"][..], "'chekc'; did you mean 'check'?"),
        (&["Info"], "'Info'; did you mean 'info'?"),
        (&["frobnicate"], "`regen --help` lists the commands"),
    ] {
        let run = regen(&dir, args).ended(2);
        assert!(run.err.contains(text), "{}", run.err);
    }
    // the name of a file needs no extension
    fs::write(dir.join("arm"), pendulum("arm")).unwrap();
    regen(&dir, &["arm", "--out", "o"]).ended(0);
}

#[test]
fn negative_numbers_are_values_of_options() {
    let dir = scratch("negative");
    fs::write(dir.join("arm.yaml"), pendulum("arm")).unwrap();
    let run = regen(&dir, &["excite", "arm.yaml", "--frequency", "-1"]).ended(3);
    assert!(
        run.err.contains("the frequency must be positive"),
        "{}",
        run.err
    );
}

#[test]
fn a_wrong_spec_exits_with_3_and_shows_the_place() {
    let dir = scratch("spec");
    fs::write(
        dir.join("bad.yaml"),
        pendulum("bad").replace("revolute", "revolut"),
    )
    .unwrap();
    for args in [
        &["bad.yaml", "--out", "o"][..],
        &["info", "bad.yaml"],
        &["generate", "bad.yaml", "--out", "o"],
    ] {
        let run = regen(&dir, args).ended(3);
        assert_eq!(run.out, "", "{args:?}");
        for part in [
            "bad.yaml:6:26",
            "'revolut'",
            "did you mean 'revolute'",
            "^^^^^^^",
        ] {
            assert!(
                run.err.contains(part),
                "{args:?}: no {part:?} in\n{}",
                run.err
            );
        }
    }
    assert!(
        !dir.join("o").exists(),
        "nothing is written for a spec that is wrong"
    );
}

#[test]
fn the_errors_of_all_files_are_reported_at_once() {
    let dir = workspace("all-errors", &["a", "b"]);
    for name in ["a", "b"] {
        let path = dir.join(format!("robots/{name}.yaml"));
        fs::write(path, pendulum(name).replace("revolute", "revolut")).unwrap();
    }
    let run = regen(&dir, &["generate"]).ended(3);
    assert!(
        run.err.contains("robots/a.yaml:6") && run.err.contains("robots/b.yaml:6"),
        "{}",
        run.err
    );
}

#[test]
fn text_that_is_not_utf8_exits_with_3() {
    let dir = scratch("utf8");
    fs::write(dir.join("latin.yaml"), b"name: caf\xe9\n").unwrap();
    let run = regen(&dir, &["info", "latin.yaml"]).ended(3);
    assert_eq!(
        run.err,
        "error: latin.yaml is not UTF-8 text (byte 10 is not)\n"
    );
}

#[test]
fn a_singular_state_exits_with_4() {
    let dir = scratch("singular");
    // with all links stretched along a line, the two halves of the five-bar do not determine the
    // state
    let info = regen(&dir, &["info", &oracle("fivebar.yaml"), "--format", "json"])
        .ended(0)
        .json();
    let n = info["coordinates"].as_array().unwrap().len();
    let zeros = format!("{:?}", vec![0.0; n]);
    let states = format!(r#"[{{"q": {zeros}, "qd": {zeros}, "qdd": {zeros}}}]"#);
    fs::write(dir.join("in.json"), states).unwrap();
    let run = regen(
        &dir,
        &["eval", &oracle("fivebar.yaml"), "--states", "in.json"],
    )
    .ended(4);
    assert!(
        run.err.starts_with("error: state 1 is singular"),
        "{}",
        run.err
    );
    assert_eq!(run.out, "");
}

#[test]
fn a_target_out_of_reach_exits_with_4() {
    let dir = scratch("reach");
    let far = r#"[{"independent": {"q": [50, 50, -50], "qd": [0, 0, 0], "qdd": [0, 0, 0]}}]"#;
    fs::write(dir.join("in.json"), far).unwrap();
    let run = regen(&dir, &["eval", &oracle("3rps.yaml"), "--states", "in.json"]).ended(4);
    assert!(run.err.starts_with("error: state 1: "), "{}", run.err);
    assert!(run.err.contains("of the way from home"), "{}", run.err);
}

#[test]
fn a_directory_that_cannot_be_written_exits_with_5() {
    let dir = workspace("unwritable", &["arm"]);
    fs::write(dir.join("file"), "in the way").unwrap();
    let run = regen(&dir, &["generate", "robots/arm.yaml", "--out", "file"]).ended(5);
    assert!(run.err.contains("file/arm.rs"), "{}", run.err);
    assert_eq!(fs::read_to_string(dir.join("file")).unwrap(), "in the way");
}

#[test]
fn a_missing_workspace_is_explained() {
    // A workspace cannot be next to the root of the file system.
    let run = regen(std::path::Path::new("/"), &["generate"]).ended(3);
    assert!(
        run.err.contains("robots/ and generated/src/"),
        "{}",
        run.err
    );
}

#[test]
fn a_closed_pipe_at_standard_output_is_no_error() {
    let dir = scratch("pipe");
    let mut child = command(&dir, &["info", &oracle("3rps.yaml")])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(String::from_utf8_lossy(&output.stderr), "");
}

#[test]
fn messages_have_no_colour_outside_a_terminal() {
    let dir = scratch("colour");
    fs::write(dir.join("bad.yaml"), "nme: x\n").unwrap();
    let run = regen(&dir, &["info", "bad.yaml"]).ended(3);
    assert!(!run.err.contains('\x1b'), "{:?}", run.err);
}

#[test]
fn help_documents_every_exit_code_in_80_columns() {
    let dir = scratch("help");
    let run = regen(&dir, &["--help"]).ended(0);
    for code in 0..=5 {
        assert!(run.out.contains(&format!("\n  {code}  ")), "{code}");
    }
    for command in [
        "generate",
        "info",
        "base",
        "verify",
        "eval",
        "schema",
        "completions",
    ] {
        let run = regen(&dir, &[command, "--help"]).ended(0);
        assert!(run.out.contains("Usage: regen"), "{command}");
        for line in run.out.lines() {
            assert!(line.chars().count() <= 80, "{command}: {line}");
        }
    }
}

#[test]
fn completions_contain_the_subcommands() {
    let dir = scratch("completions");
    for shell in ["bash", "zsh", "fish"] {
        let run = regen(&dir, &["completions", shell]).ended(0);
        for word in ["generate", "eval", "states"] {
            assert!(run.out.contains(word), "{shell}: {word}");
        }
    }
}

#[test]
fn the_schema_is_json_that_names_the_required_keys() {
    let dir = scratch("schema");
    let schema = regen(&dir, &["schema"]).ended(0).json();
    let root = schema["$ref"].as_str().unwrap().trim_start_matches('#');
    let required = schema.pointer(root).unwrap()["required"]
        .as_array()
        .unwrap();
    for key in ["name", "limbs"] {
        assert!(required.iter().any(|k| k == key), "{key}: {required:?}");
    }
}
