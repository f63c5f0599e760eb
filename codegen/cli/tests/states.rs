//! Errors in states, with their places.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use crate::common::{oracle, regen, regen_with, scratch};

fn error_of(test: &str, states: &str) -> String {
    let dir = scratch(test);
    let run = regen_with(
        &dir,
        &["eval", &oracle("puma560.yaml"), "--states", "-"],
        states,
    );
    let run = run.ended(3);
    assert_eq!(run.out, "");
    run.err
}

const SIX: &str = "[1, 2, 3, 4, 5, 6]";

#[test]
fn every_wrong_length_is_reported_with_line_and_column() {
    let text = format!(
        "[{{\"q\": {SIX}, \"qd\": {SIX}, \"qdd\": {SIX}}},\n {{\"q\": [1],\n  \"qd\": {SIX}, \"qdd\": []}}]"
    );
    let err = error_of("lengths", &text);
    for part in [
        "state 2, `q`: has 1 entries, the robot has 6 coordinates",
        "<stdin>:2:8",
        "state 2, `qdd`: has 0 entries",
        "<stdin>:3:36",
    ] {
        assert!(err.contains(part), "no {part:?} in\n{err}");
    }
}

#[test]
fn values_that_are_not_finite_numbers_are_refused() {
    for (bad, column) in [
        ("NaN", 7),
        ("Infinity", 7),
        ("1e999", 7),
        ("\"1\"", 7),
        ("null", 7),
    ] {
        let text = format!("[{{\"q\":[{bad}, 2, 3, 4, 5, 6], \"qd\": {SIX}, \"qdd\": {SIX}}}]");
        let err = error_of("numbers", &text);
        let place = (column..column + 10).any(|c| err.contains(&format!("<stdin>:1:{c}\n")));
        assert!(place, "{bad}: {err}");
    }
}

#[test]
fn text_that_is_no_json_is_refused_at_its_place() {
    let err = error_of("no-json", "[\n  {\"q\": [1, 2,}\n]");
    assert!(err.contains("<stdin>:2:15"), "{err}");
    let err = error_of("empty", "");
    assert!(err.contains("<stdin>:1:1"), "{err}");
}

#[test]
fn unknown_missing_doubled_and_mixed_keys_are_refused() {
    let full = format!("\"q\": {SIX}, \"qd\": {SIX}");
    for (test, state, part) in [
        (
            "unknown",
            format!("{full}, \"qddd\": {SIX}"),
            "unknown field `qddd`",
        ),
        ("missing", full.clone(), "state 1, `qdd`: is missing"),
        (
            "doubled",
            format!("{full}, \"qd\": {SIX}"),
            "duplicate field `qd`",
        ),
        (
            "mixed",
            format!("{full}, \"qdd\": {SIX}, \"independent\": {{}}"),
            "`independent` beside q, qd or qdd",
        ),
        (
            "inner",
            format!("\"independent\": {{{full}, \"tau\": 1}}"),
            "state 1, `independent`: unknown field `tau`",
        ),
    ] {
        let err = error_of(test, &format!("[{{{state}}}]"));
        assert!(err.contains(part), "no {part:?} in\n{err}");
        assert!(err.contains("<stdin>:1:"), "{err}");
    }
}

#[test]
fn json_that_is_no_list_of_states_is_refused() {
    for (test, text) in [("object", "{}"), ("number", "[3]"), ("nested", "[[]]")] {
        let err = error_of(test, text);
        assert!(err.contains("<stdin>:1:"), "{err}");
    }
}

#[test]
fn a_file_that_is_not_there_exits_with_5() {
    let dir = scratch("no-states");
    let args = ["eval", &oracle("puma560.yaml"), "--states", "none.json"];
    let run = regen(&dir, &args).ended(5);
    assert!(run.err.contains("cannot read none.json"), "{}", run.err);
}
