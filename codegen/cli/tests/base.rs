//! `regen base`: tables, JSON, and bases that are not certified.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fmt::Write as _;
use std::fs;

use crate::common::{self, mechanism, oracle, regen, regen_with, scratch};
use serde_json::{Value, json};

fn keys(value: &Value) -> Vec<&str> {
    let keys = value.as_object().unwrap().keys();
    keys.map(String::as_str).collect()
}

fn base_json(file: &str, code: i32) -> Value {
    let dir = scratch("base-json");
    let run = regen(&dir, &["base", file, "--format", "json"]);
    run.ended(code).json()
}

/// The text with `#` for numbers such as 1.2e-30: those of the certificate depend on random states.
fn masked(text: &str) -> String {
    let is_figure = |word: &str| {
        let word = word.trim_end_matches("\\par");
        let digits = word.trim_end_matches([',', '.', '\\']).split_once("e-");
        digits.is_some_and(|(_, e)| !e.is_empty() && e.bytes().all(|b| b.is_ascii_digit()))
    };
    let mut out = String::new();
    for piece in text.split_inclusive([' ', '\n']) {
        let word = piece.trim_end();
        out.push_str(if is_figure(word) { "#" } else { word });
        out.push_str(&piece[word.len()..]);
    }
    out
}

#[test]
fn the_tables_of_the_3rps_are_those_of_the_chapter() {
    let dir = scratch("base-tables");
    let file = oracle("3rps.yaml");
    let print = |args: &[&str]| {
        let all: Vec<&str> = ["base", &file].iter().chain(args).copied().collect();
        masked(&regen(&dir, &all).ended(0).out)
    };
    insta::assert_snapshot!("3rps_human", print(&[]));
    insta::assert_snapshot!("3rps_numbers", print(&["--numbers"]));
    insta::assert_snapshot!("3rps_markdown", print(&["--format", "markdown"]));
    insta::assert_snapshot!("3rps_latex", print(&["--format", "latex"]));
}

#[test]
fn numbers_are_rounded_as_the_chapter_prints_them() {
    let dir = scratch("base-numbers");
    let file = oracle("3rps.yaml");
    let out = regen(&dir, &["base", &file, "--numbers"]).ended(0).out;
    for part in [
        "m(5) + m(3) + m(2) - 2.531 my(3)",
        "m(7) + 2.531 my(3)",
        "Ixx(3) - 0.3952 my(3)",
        "Ixy(3) + 0.2282 my(3)",
        "Iyy(3) + 0.3952 my(3) - 0.2082 m(3) - 0.2082 m(2)",
        "mx(3) + 0.5774 my(3) - 0.4563 m(3) - 0.4563 m(2)",
    ] {
        assert!(out.contains(&format!("  {part}\n")), "no {part} in\n{out}");
    }
}

#[test]
fn the_json_has_the_keys_of_the_format() {
    let base = base_json(&oracle("3rps.yaml"), 0);
    for key in [
        "robot",
        "parameters",
        "rank",
        "base",
        "null_directions",
        "certificate",
    ] {
        assert!(base.get(key).is_some(), "{key}");
    }
    assert_eq!(base["robot"], "rps3");
    assert_eq!(base["parameters"].as_array().unwrap().len(), 70);
    assert_eq!(
        (&base["rank"], &base["complete"]),
        (&json!(25), &json!(true))
    );
    assert_eq!(
        base["null_directions"],
        json!({"trees": 45, "completed": 0})
    );
    let certificate = &base["certificate"];
    let mut found = keys(certificate);
    found.sort_unstable();
    assert_eq!(
        found,
        [
            "columns",
            "digits",
            "largest_dropped",
            "rank",
            "smallest_kept",
            "states"
        ]
    );
    assert_eq!(
        (&certificate["columns"], &certificate["rank"]),
        (&json!(70), &json!(25))
    );
    let part = |key: &str| certificate[key].as_f64().unwrap();
    assert!(part("smallest_kept") > 1e20 * part("largest_dropped"));

    let rows = base["base"].as_array().unwrap();
    assert_eq!(rows.len(), 25);
    for row in rows {
        assert_eq!(row["terms"][0]["parameter"], row["label"], "{row}");
        assert_eq!(row["terms"][0]["coefficient"], "1");
        assert_eq!(row["layer"], "derived");
    }
    let platform = rows.iter().find(|row| row["label"] == "m(5)").unwrap();
    let term = platform["terms"].as_array().unwrap().last().unwrap();
    let expected = -2.0 * 3_f64.sqrt() / (3.0 * 0.4563);
    assert_eq!(term["parameter"], "my(3)");
    assert_eq!(term["coefficient"], "-2*sqrt(3)/(3*a)");
    assert!((term["value"].as_f64().unwrap() - expected).abs() < 1e-15);
}

/// A four-bar that closes only to the digits of a decimal angle, so that its base cannot be
/// certified.
fn uncertified() -> String {
    let text = fs::read_to_string(common::root().join("robots/fourbar.yaml")).unwrap();
    let (before, after) = text.split_once("name: following").unwrap();
    let after = after.replacen("rpy: [pi/2,", "rpy: [1.5707963267949,", 1);
    format!("{before}name: following{after}")
}

#[test]
fn a_base_without_certificate_is_headed_incomplete_in_every_format() {
    let dir = scratch("base-uncertified");
    fs::write(dir.join("f.yaml"), uncertified()).unwrap();
    for format in ["human", "markdown", "latex"] {
        let run = regen(&dir, &["base", "f.yaml", "--format", format]).ended(1);
        let head: String = run.out.lines().take(6).collect();
        assert!(head.contains("INCOMPLETE"), "{format}: {}", run.out);
        assert!(
            run.out.contains("at most") && !run.out.contains("rank: 8"),
            "{format}: {}",
            run.out
        );
        assert!(run.err.contains("INCOMPLETE"), "{}", run.err);
    }
    let run = regen(&dir, &["base", "f.yaml", "--format", "json"]).ended(1);
    let base = run.json();
    assert_eq!(base["complete"], false);
    assert_eq!(base["certificate"], Value::Null);
    let reason = base["reason"].as_str().unwrap();
    assert!(reason.contains("no certificate"), "{reason}");

    let run = regen(&dir, &["f.yaml", "--out", "."]).ended(0);
    assert!(run.out.contains("INCOMPLETE"), "{}", run.out);
    let run = regen(&dir, &["verify", "f.yaml"]).ended(1);
    assert!(run.err.contains("certified complete"), "{}", run.err);
}

#[test]
fn null_directions_that_no_tree_yields_are_completed_and_marked() {
    let base = base_json(&mechanism("parallelogram_cut.yaml"), 0);
    assert_eq!(base["complete"], true);
    assert_eq!(base["rank"], 3);
    assert_eq!(base["null_directions"]["completed"], 5);
    let dir = scratch("base-completed");
    let run = regen(&dir, &["base", &mechanism("parallelogram_cut.yaml")]).ended(0);
    assert!(
        run.out
            .contains("5 more null directions from samples, all proven"),
        "{}",
        run.out
    );
    assert!(run.out.contains("proven    mx(1)"), "{}", run.out);
}

/// The 3-RPS with further choices under `base`.
fn chosen(choices: &str) -> String {
    let text = fs::read_to_string(oracle("3rps.yaml")).unwrap();
    format!("{}\n{choices}", text.trim_end())
}

#[test]
fn known_and_dropped_parameters_of_the_spec_are_printed() {
    let dir = scratch("base-known");
    let choices = "  equal: [[1, 4, 6], [2, 5, 7]]\n  zero: [mx(1), Ixy(3) + a/2*my(3)]\n  \
                   drop: [mz(3)]\n";
    fs::write(dir.join("c.yaml"), chosen(choices)).unwrap();
    let run = regen(&dir, &["base", "c.yaml"]).ended(0);
    let text = run.out.split_whitespace().collect::<Vec<_>>().join(" ");
    for part in [
        "body 4 as body 1; body 6 as body 1; body 5 as body 2; body 7 as body 2; mx(1) = 0",
        "Ixy(3) = -a/2 my(3)",
        "dropped the base parameters kept at mz(3)",
        "columns, 42 of them known",
    ] {
        assert!(text.contains(part), "no {part:?} in\n{}", run.out);
    }
    assert!(!run.out.contains("derived   mz(3)\n"), "{}", run.out);

    let base = regen(&dir, &["base", "c.yaml", "--format", "json"])
        .ended(0)
        .json();
    let rows = base["base"].as_array().unwrap().len();
    assert_eq!(base["rank"], rows);
    assert_eq!(base["dropped"][0]["label"], "mz(3)");
    assert_eq!(base["known"].as_array().unwrap().len(), 42);
    // the numeric method finds the rank before the dropped parameter is removed
    let run = regen(&dir, &["verify", "c.yaml", "--format", "json"])
        .ended(0)
        .json();
    assert_eq!(run["base"]["reduced"]["svd"]["rank"], rows + 1);
    assert_eq!(run["base"]["svd"]["rank"], 25);
}

#[test]
fn lengths_that_are_equal_only_by_value_are_reported() {
    let dir = scratch("base-coincidence");
    let arm = |b: &str| {
        format!(
            "name: arm\ngravity: [0, 0, 0]\ngeometry: {{a: 0.3, b: {b}}}\nlimbs:\n  - name: l\n    joints:\n      \
             - {{name: q1, type: revolute, body: 1, actuated: true}}\n      \
             - {{name: q2, type: revolute, dh: {{a: a - b}}, body: 2, actuated: true}}\n"
        )
    };
    fs::write(dir.join("equal.yaml"), arm("0.3")).unwrap();
    fs::write(dir.join("other.yaml"), arm("0.2")).unwrap();
    let equal = regen(&dir, &["base", "equal.yaml"]).ended(0).out;
    assert!(equal.contains("equal only by value: a = b\n"), "{equal}");
    let other = regen(&dir, &["base", "other.yaml"]).ended(0).out;
    assert!(!other.contains("by value"), "{other}");
}

/// Choices that give coefficients of several lines.
const LONG: &str = "\
name: long
geometry: {a: 0.31, b: 0.42, c: 0.17, d: 0.23, e: 0.5, f: 0.11}
limbs:
  - name: arm
    base: {rpy: [0.3, 0.4, 0.5]}
    joints:
      - {name: q1, type: revolute, dh: {alpha: 0.3, a: a, d: b}, body: 1, actuated: true}
      - {name: q2, type: revolute, dh: {alpha: 0.7, a: c, d: d}, body: 2, actuated: true}
      - {name: q3, type: revolute, dh: {alpha: 1.1, a: e, d: f}, body: 3, actuated: true}
base:
  eliminate: [mx(2), my(1), Ixx(2), Ixy(1), mx(1), Iyy(1), Izz(1)]
";

#[test]
fn long_coefficients_are_numbers_unless_expressions_are_asked_for() {
    let dir = scratch("base-long");
    fs::write(dir.join("long.yaml"), LONG).unwrap();
    for format in ["human", "markdown", "latex"] {
        let mark = if format == "latex" {
            "{\\sim}0."
        } else {
            "~0."
        };
        let args = ["base", "long.yaml", "--format", format, "--expressions"];
        let short = regen(&dir, &args[..4]).ended(0).out;
        let long = regen(&dir, &args).ended(0).out;
        assert!(short.contains(mark) && !long.contains(mark), "{format}");
        assert!(short.contains("--expressions") && !long.contains("--expressions"));
        assert!(long.len() > short.len());
        if format == "human" {
            for line in short.lines().chain(long.lines()) {
                assert!(line.chars().count() <= 80, "{line}");
                assert!(!line.ends_with([' ', '+', '-']), "{line:?}");
            }
        }
    }
    let args = ["base", "long.yaml", "--numbers", "--expressions"];
    regen(&dir, &args).ended(2);
}

#[test]
fn eval_gives_the_regressor_of_the_base_parameters() {
    let dir = scratch("base-eval");
    let file = oracle("3rps.yaml");
    let states =
        r#"[{"independent": {"q": [0.6, 0.62, 0.58], "qd": [0.1, 0, -0.1], "qdd": [1, 2, 3]}}]"#;
    let args = ["eval", &file, "--states", "-", "--format", "json"];
    let state = regen_with(&dir, &args, states).ended(0).json();
    let base = base_json(&file, 0);
    let names = base["parameters"].as_array().unwrap();
    let rows = |key: &str| state[0][key].as_array().unwrap().clone();
    assert_eq!(rows("base_regressor").len(), 3);
    for (reduced, full) in rows("base_regressor").iter().zip(rows("regressor")) {
        assert_eq!(reduced.as_array().unwrap().len(), 25);
        for (k, row) in base["base"].as_array().unwrap().iter().enumerate() {
            let column = names.iter().position(|n| *n == row["label"]).unwrap();
            let (a, b) = (reduced[k].as_f64().unwrap(), full[column].as_f64().unwrap());
            assert!(
                (a - b).abs() <= 1e-12 * b.abs().max(1.0),
                "{}: {a} {b}",
                row["label"]
            );
        }
    }
}

#[test]
fn a_stored_base_is_reported_and_has_the_same_bytes_every_time() {
    let dir = scratch("base-store");
    fs::copy(oracle("fivebar.yaml"), dir.join("f.yaml")).unwrap();
    let print = ["base", "f.yaml", "--store"];
    let run = regen(&dir, &print).ended(0);
    assert_eq!(run.err, "f.base: written\n");
    assert!(run.out.contains("11 base parameters"), "{}", run.out);
    let first = fs::read(dir.join("f.base")).unwrap();
    assert!(!first.is_empty());
    regen(&dir, &print).ended(0);
    assert_eq!(fs::read(dir.join("f.base")).unwrap(), first);
}

/// A run from the cache prints the same bytes as the derivation, and `--no-cache` stores nothing.
#[test]
fn the_cache_changes_no_output() {
    let dir = scratch("base-cache");
    let cache = dir.join("cache");
    let file = common::root().join("robots/delta.yaml");
    let file = file.to_str().unwrap();
    let entries = || fs::read_dir(&cache).into_iter().flatten().count();
    let run = |args: &[&str]| {
        let mut command = common::command(&dir, args);
        let output = command.env("REGEN_CACHE", &cache).output().unwrap();
        assert!(output.status.success(), "{args:?}");
        String::from_utf8(output.stdout).unwrap()
    };
    let base = ["base", file, "--format", "json"];
    let derived = regen(&dir, &base).ended(0).out;
    let without = [&base[..], &["--no-cache"]].concat();
    assert_eq!(run(&without), derived);
    assert_eq!(entries(), 0);
    assert_eq!(run(&base), derived);
    let stored = entries();
    assert!(stored > 0);
    assert_eq!(run(&base), derived);
    assert_eq!(entries(), stored);
    // a damaged entry is derived again and replaced
    for entry in fs::read_dir(&cache).unwrap().flatten() {
        fs::write(entry.path(), "no entry").unwrap();
    }
    assert_eq!(run(&base), derived);
    assert!(
        fs::read_dir(&cache)
            .unwrap()
            .flatten()
            .all(|e| e.metadata().unwrap().len() > 100)
    );
}

/// A plate in a plane on prismatic legs at these angles, rad, around it; the first two are beside a third
/// one, so that their lengths alone hardly determine where the plate is.
fn plate_on_legs(angles: &[f64], independent: [usize; 3]) -> String {
    let (mut limbs, mut cuts, mut home) = (String::new(), String::new(), Vec::new());
    let plate = |angle: f64| [0.02 * angle.cos(), 0.02 * angle.sin()];
    let first = plate(angles[0]);
    for (k, angle) in angles.iter().enumerate() {
        let turned = angle + 0.1 * (5.0 * k as f64 + 1.0).sin();
        let base = [0.6 * turned.cos(), 0.6 * turned.sin()];
        let end = plate(*angle);
        let way = [end[0] - base[0], end[1] - base[1]];
        let turn = way[1].atan2(way[0]);
        let _ = write!(
            limbs,
            "  - name: leg{k}
    base: {{xyz: [{:.6}, {:.6}, 0]}}
    joints:
      - {{name: a{k}, type: revolute, body: t{k}}}
      - {{name: p{k}, type: prismatic, axis: x, body: r{k}, actuated: true}}
",
            base[0], base[1]
        );
        home.push(format!(
            "a{k}: {turn:.6}, p{k}: {:.6}",
            way[0].hypot(way[1])
        ));
        if k == 0 {
            limbs += "      - {name: s, type: revolute, body: plate}\n";
            home.push(format!("s: {:.6}", -turn));
        } else {
            let _ = writeln!(
                cuts,
                "  - {{name: k{k}, joint: revolute, between: [{{body: r{k}}}, {{body: plate, xyz: [{:.6}, \
                 {:.6}, 0]}}]}}",
                end[0] - first[0],
                end[1] - first[1]
            );
        }
    }
    let [a, b, c] = independent;
    format!(
        "name: plate\nlimbs:\n{limbs}cuts:\n{cuts}independent: [p{a}, p{b}, p{c}]\nhome: {{{}}}\n",
        home.join(", ")
    )
}

#[test]
fn the_certificate_does_not_depend_on_the_choice_of_the_independent_coordinates() {
    let dir = scratch("base-independents");
    let rank = |angles: &[f64], independent: [usize; 3]| {
        fs::write(dir.join("plate.yaml"), plate_on_legs(angles, independent)).unwrap();
        let found = regen(&dir, &["base", "plate.yaml", "--format", "json"]).ended(0);
        found.json()["certificate"]["rank"].as_u64().unwrap()
    };
    for angles in [
        &[0.0, 0.3, 0.6, 2.0, 4.0, 5.0][..],
        &[0.0, 0.02, 0.04, 2.0, 4.0],
    ] {
        let spread = rank(angles, [0, 3, 4]);
        assert_eq!(rank(angles, [0, 1, 2]), spread, "{angles:?}");
        assert_eq!(spread, 4 + 3 * angles.len() as u64);
    }
}

/// A copy of the arm with named angles in the folder `dir`.
fn arm_with_named_angles(dir: &std::path::Path) {
    let text = "name: twisted\ngeometry: {al: 0.7, a: 0.3, th: pi/5}\nlimbs:\n  - name: arm\n    joints:\n      \
                - {name: q1, type: revolute, body: 1, actuated: true}\n      \
                - {name: q2, type: revolute, dh: {alpha: al, a: a}, body: 2, actuated: true}\n      \
                - {name: q3, type: revolute, dh: {alpha: th, a: a*sin(al)}, body: 3, actuated: true}\n";
    fs::write(dir.join("twisted.yaml"), text).unwrap();
}

#[test]
fn angles_with_names_stay_symbols_in_every_format() {
    let dir = scratch("base-angles");
    arm_with_named_angles(&dir);
    let print = |format: &str| {
        let run = regen(&dir, &["base", "twisted.yaml", "--format", format]);
        run.ended(0).out
    };
    for (format, parts) in [
        (
            "human",
            ["sin(al)^2 Iyy(2)", "rank 11 at al = 0, 11 at al = pi"],
        ),
        ("latex", ["\\sin^{2}", "\\cos"]),
        ("json", ["\"sin(al)^2\"", "\"everywhere\""]),
    ] {
        let text = print(format);
        for part in parts {
            assert!(text.contains(part), "{format}: {part} not in\n{text}");
        }
        // the angles' values are not in the coefficients
        assert!(!text.contains("7/10") && !text.contains("pi/5"), "{text}");
    }
    let equations = regen(&dir, &["equations", "twisted.yaml"]).ended(0).out;
    for part in ["al = 0.7\n", "s_a1 = sin(al)", "9.81*c_a1"] {
        assert!(equations.contains(part), "{part} not in\n{equations}");
    }
}

#[test]
fn a_table_at_another_value_is_that_of_a_file_with_this_value() {
    let dir = scratch("base-at");
    arm_with_named_angles(&dir);
    let text = fs::read_to_string(dir.join("twisted.yaml")).unwrap();
    let own = text
        .replace("al: 0.7", "al: pi/2")
        .replace("a: 0.3", "a: 0.2");
    fs::write(dir.join("right.yaml"), own).unwrap();
    let at = ["base", "twisted.yaml", "--at", "al=pi/2", "--at", "a = 0.2"];
    let (at, own) = (regen(&dir, &at), regen(&dir, &["base", "right.yaml"]));
    let (at, own) = (at.ended(0).out, own.ended(0).out);
    assert_eq!(at, own);
    assert!(at.contains("equal only by value: al = pi/2"), "{at}");
    for (given, part) in [
        (
            "all=0",
            "none of the names of 'geometry' in twisted.yaml; they are al, a, th",
        ),
        ("al", "write NAME=VALUE"),
        ("al=", "write NAME=VALUE"),
        ("al=0, a: 3", "no expression"),
        ("al=x", "no expression"),
    ] {
        let run = regen(&dir, &["base", "twisted.yaml", "--at", given]);
        let message = run.ended(3).err;
        assert!(message.contains(part), "{given}: {message}");
    }
    let twice = ["base", "twisted.yaml", "--at", "al=0", "--at", "al=1"];
    assert!(regen(&dir, &twice).ended(3).err.contains("given twice"));
}
