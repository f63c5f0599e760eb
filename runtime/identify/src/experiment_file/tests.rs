//! Tests of reading experiment files.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use regen_runtime::Info;

use super::*;
use crate::data::{Checks, Decimal, Decision, Format, Gaps, Header, Join, Policy, Separator};
use crate::document::Mistake;
use crate::signals::Method;
use crate::states::Standstill;

const INFO: Info<'static> = Info {
    name: "arm",
    coordinates: &["q1", "q2", "passive"],
    independent: &[0, 1],
    dependent: &[2],
    actuated: &[0, 1],
    ..Info::EMPTY
};

fn read(text: &str) -> ExperimentFile {
    ExperimentFile::read(text, &INFO).unwrap_or_else(|e| panic!("{e}"))
}

/// The mistakes of a text, each with the part of the text at which it is, its path and remedy.
fn mistakes(text: &str) -> Vec<String> {
    let found = ExperimentFile::read(text, &INFO).expect_err(text);
    let line = |mistake: &Mistake| {
        let at: String = text[mistake.at..]
            .chars()
            .take_while(|c| !",:]}\n".contains(*c))
            .collect();
        format!("{at} | {} | {}", mistake.path, mistake.message)
    };
    found.0.iter().map(line).collect()
}

/// Each assignment as text.
fn columns(text: &str) -> Vec<String> {
    let file = read(text);
    let line = |a: &crate::data::Assignment| {
        let number = a.number.map_or(String::new(), |_| "#".to_owned());
        format!(
            "{}={number}{} *{} +{}{}",
            a.quantity,
            a.column,
            a.factor,
            a.offset,
            if a.late == 0.0 {
                String::new()
            } else {
                format!(" late {}", a.late)
            }
        )
    };
    file.settings.columns.iter().map(line).collect()
}

#[test]
fn patterns_stand_for_parts_of_names_and_single_keys_go_before_them() {
    assert_eq!(
        columns("columns: {q*: 'pos_*', q2: {column: leg, unit: mm, offset: 1/4}}"),
        ["q1=pos_1 *1 +0", "q2=leg *0.001 +0.25"]
    );
    assert_eq!(
        columns("columns: {q*: {column: 'pos_*', late: [0.02, 0]}}"),
        ["q1=pos_1 *1 +0 late 0.02", "q2=pos_2 *1 +0"]
    );
    assert_eq!(
        columns("columns: {q2: {column: leg}, q*: 'pos_*'}"),
        ["q2=leg *1 +0", "q1=pos_1 *1 +0"]
    );
    // qd1 is short for qd_q1; a pattern of the short names means no others
    assert_eq!(
        columns("columns: {qd*: 'v*', qdd_passive: {column: a}, tau1: {column: 9}}"),
        [
            "qd_q1=v1 *1 +0",
            "qd_q2=v2 *1 +0",
            "qdd_passive=a *1 +0",
            "tau_q1=#9 *1 +0"
        ]
    );
    assert_eq!(
        columns("columns: {tau_*: {column: 4..5, unit: A, gain: [2, -1/2], factor: 3}}"),
        ["tau_q1=#4 *6 +0", "tau_q2=#5 *-1.5 +0"]
    );
    assert_eq!(columns("columns: {'*': 'pos *'}").len(), 3);
    assert_eq!(columns("time: {column: 1, unit: ms}"), ["t=#1 *0.001 +0"]);
    assert_eq!(columns("time: stamp"), ["t=stamp *1 +0"]);
    // a name that looks like a number is a name in quotes
    assert_eq!(columns("time: '7'"), ["t=7 *1 +0"]);
}

#[test]
fn columns_in_order_go_by_the_numbers_of_coordinates() {
    let info = Info {
        coordinates: &["q1", "q10", "p4", "q3", "arm", "q2"],
        ..INFO
    };
    let numbers = |text: &str| -> Vec<String> {
        let file = ExperimentFile::read(text, &info).unwrap();
        let columns = file.settings.columns.iter();
        columns
            .map(|a| format!("{}={}", a.quantity, a.column))
            .collect()
    };
    let by_number = ["q1=4", "q2=5", "q3=6", "q10=7"];
    assert_eq!(numbers("columns: {q*: 4..7}"), by_number);
    // a list has them in the same order
    let listed = ["q1=7", "q2=4", "q3=out 3", "q10=9"];
    assert_eq!(numbers("columns: {q*: [7, 4, out 3, 9]}"), listed);
    let listed = numbers("columns: {q*: {column: [7, 4, out 3, 9], unit: deg}}");
    assert_eq!(listed.len(), 4);
    // without numbers, in the robot's order
    let all = ["q1=1", "q10=2", "p4=3", "q3=4", "arm=5", "q2=6"];
    assert_eq!(numbers("columns: {'*': 1..6}"), all);
}

#[test]
fn every_key_reaches_its_setting() {
    let file = read(
        "header: none
separator: ';'
decimal: ','
rate: 200
process:
  resample: 100
  filter: {local: {half_width: 0.05}}
  velocities: computed
  decimate: 5
  period: 2.5
  standstill: {velocity: 0.02, effort: down-weight}
  delay: {q2: 0.004}
  deviations: {passive: 1e-3}
checks: {rows: drop, outliers: tell, saturated: keep, stuck: fail, gaps: drop}
runs:
  - {files: [a.csv, b.csv], join: time, rows: [2, 7], times: [-1, 2.5], payload: unknown}
  - {files: c.parquet, use: validate, payload: {m: 2.8, com: [0, 0, 0.05], inertia: unknown}}
",
    );
    let expected = Settings {
        poses: false,
        format: Format {
            header: Header::None,
            separator: Some(Separator::Semicolon),
            decimal: Some(Decimal::Comma),
        },
        topic: None,
        episode: None,
        rate: Some(200.0),
        resample: Some(100.0),
        measured_rates: Some(false),
        method: Method::Local { half_width: 0.05 },
        method_by: Decision::Given,
        policy: Policy::Drop,
        checks: Checks {
            outliers: Some(Policy::Tell),
            saturated: Some(Policy::Keep),
            stuck: Some(Policy::Fail),
            gaps: Gaps::Drop,
        },
        decimation: 5,
        period: Some(2.5),
        deviations: vec![("passive".to_owned(), 1e-3)],
        standstill: Standstill::Weigh,
        rest_speed: 0.02,
        delays: vec![("q2".to_owned(), 0.004)],
        are_delays_found: false,
        columns: Vec::new(),
    };
    assert_eq!(file.settings, expected);
    assert_eq!(
        (file.kind, file.delay),
        (EquationKind::Forces, Delay::Stated)
    );
    let [first, second] = &file.runs[..] else {
        panic!()
    };
    assert_eq!(first.run.files, [Path::new("a.csv"), Path::new("b.csv")]);
    assert_eq!(
        (first.run.join, first.run.rows, first.run.times),
        (Join::Time, Some((2, 7)), Some((-1.0, 2.5)))
    );
    assert_eq!(
        (first.purpose, &first.payload),
        (Purpose::Identify, &Payload::UNKNOWN)
    );
    let carried = Payload::Carried {
        body: None,
        mass: Some(2.8),
        com: Some([0.0, 0.0, 0.05]),
        inertia: None,
    };
    assert_eq!(
        (second.purpose, &second.payload),
        (Purpose::Validate, &carried)
    );
    assert_eq!(file.require_plain().unwrap_err().0.len(), 2);

    let other =
        read("process: {filter: {butterworth: {order: 4, cutoff: 20}}, delay: 0.01, energy: 0.5}");
    assert_eq!(
        other.settings.method,
        Method::Butterworth {
            order: 4,
            cutoff: 20.0
        }
    );
    let both = [("q1".to_owned(), 0.01), ("q2".to_owned(), 0.01)];
    assert_eq!(other.settings.delays, both);
    assert_eq!(other.kind, EquationKind::Energy { window: 0.5 });
    assert_eq!(
        read("process: {delay: auto, filter: none}").delay,
        Delay::Auto
    );
    assert_eq!(read("{}").settings, Settings::default());
}

#[test]
fn a_run_names_the_part_of_its_file() {
    let file = read(
        "runs:\n  - {files: a.mcap, topic: /joint_states}\n  - {files: b.parquet, episode: 0}\n",
    );
    let [first, second] = &file.runs[..] else {
        panic!()
    };
    assert_eq!(first.run.topic.as_deref(), Some("/joint_states"));
    assert_eq!((&second.run.topic, second.run.episode), (&None, Some(0)));
    assert_eq!(second.run.to_string(), "b.parquet, episode 0");
}

#[test]
fn a_run_says_its_commands_and_controllers() {
    let file = read(
        "runs:
  - files: a.csv
    commands: {q*: {column: 'goal_*', unit: mm}, q2: {column: 9, factor: -1/2}}
    controller:
      q*: {kp: 40, kd: {estimate: 2}}
      q2: {kp: 5, limit: [-1, 1], damping: velocity}
      action: continuous
      signals: {cmd_q1: {delay: {estimate: 0.01}}}
",
    );
    let [run] = &file.runs[..] else { panic!() };
    let line = |a: &Assignment| format!("{}={} *{}", a.quantity, a.column, a.factor);
    let commands: Vec<String> = run.commands.iter().map(line).collect();
    assert_eq!(commands, ["q1=goal_1 *0.001", "q2=9 *-0.5"]);
    let expected = json!({
        "q1": {"kp": 40, "kd": {"estimate": 2}},
        "q2": {"kp": 5, "limit": [-1.0, 1], "damping": "velocity"},
        "action": "continuous",
        "signals": {"cmd_q1": {"delay": {"estimate": 0.01}}},
    });
    assert_eq!(run.controller, Some(expected));
    assert_eq!(
        mistakes(
            "runs:
  - files: a.csv
    commands: {passive: a, q*: b, tau_q1: c}
    controller: {q3: {}, q1: {kq: 1}, q2: {kp: {estimat: 1}, limit: [2, 1]}, action: now}
"
        ),
        [
            "passive | `runs`, entry 1, `commands` | 'passive' is not an actuated coordinate",
            "b | `runs`, entry 1, `commands`, `q*` | 1 column for 2 coordinates: q1 q2",
            "tau_q1 | `runs`, entry 1, `commands` | 'tau_q1' is not an actuated coordinate",
            "q3 | `runs`, entry 1, `controller` | 'q3' is not an actuated coordinate",
            "kq | `runs`, entry 1, `controller`, `q1` | unknown key 'kq'; did you mean 'kp'?",
            "{estimat | `runs`, entry 1, `controller`, `q2`, `kp` | a number to estimate lacks the \
             key 'estimate'",
            "estimat | `runs`, entry 1, `controller`, `q2`, `kp` | unknown key 'estimat'; did you \
             mean 'estimate'?",
            "[2 | `runs`, entry 1, `controller`, `q2`, `limit` | the first number must be below the \
             second",
            "now | `runs`, entry 1, `controller`, `action` | unknown word 'now'",
        ]
    );
    // files without a robot: their coordinates are those of runs too
    let text = "runs: [{files: a, commands: {a: b}, controller: {c: {}, action: sampled}}]";
    assert_eq!(ExperimentFile::coordinates(text).unwrap(), ["a", "c"]);
}

#[test]
fn all_mistakes_are_told_at_once_with_place_and_proposal() {
    let text = "colums: {}
columns:
  q3: pos
  q*: {colum: a, unit: degrees, factor: 1/0}
  qd1: {column: v, unit: rad}
  tau_*: {column: 'i*', unit: A}
  tau_passive: 3
rate: 0
time: 1
process:
  filter: {butterworth: {order: 4.5}}
  delay: sometimes
checks: {outliers: tel}
runs:
  - {rows: [9, 3]}
  - {files: [], use: test}
  - {files: a.parquet, episode: 1.5}
";
    assert_eq!(
        mistakes(text),
        [
            "colums |  | unknown key 'colums'; did you mean 'columns'?",
            "q3 | `columns` | 'q3' means no quantity of arm",
            "{colum | `columns`, `q*` | a column lacks the key 'column'",
            "colum | `columns`, `q*` | unknown key 'colum'; did you mean 'column'?",
            "degrees | `columns`, `q*`, `unit` | unknown word 'degrees'",
            "1/0 | `columns`, `q*`, `factor` | expected a number or an expression such as 1/45, \
             found '1/0': it divides by 0",
            "rad | `columns`, `qd1`, `unit` | qd_q1 is not measured in rad",
            "'i*' | `columns`, `tau_*` | a current is not an effort",
            "tau_passive | `columns` | passive is not actuated: it has no effort",
            "0 | `rate` | expected a number above 0, found '0'",
            "0 | `rate` | a rate and a column of time exclude each other",
            "{order | `process`, `filter`, `butterworth` | a Butterworth filter lacks the key \
             'cutoff'",
            "4.5 | `process`, `filter`, `butterworth`, `order` | expected a whole number of at \
             least 1, found '4.5'",
            "sometimes | `process`, `delay` | unknown word 'sometimes'",
            "tel | `checks`, `outliers` | unknown word 'tel'; did you mean 'tell'?",
            "{rows | `runs`, entry 1 | a run lacks the key 'files'",
            "[9 | `runs`, entry 1, `rows` | the end is before the start",
            "[ | `runs`, entry 2, `files` | expected at least 1 entries, found 0",
            "test | `runs`, entry 2, `use` | unknown word 'test'",
            "1.5 | `runs`, entry 3, `episode` | 1.5 is not an index of an episode",
        ]
    );
}

#[test]
fn columns_that_contradict_each_other_are_refused() {
    for (text, why) in [
        ("columns: {q1: a, 'q1*': 'b*'}", ""),
        ("columns: {q*: 'a*', 'q?': b}", "'q?' means no quantity"),
        (
            "columns: {q*: 'a*', '*1': 'b*'}",
            "q1 has a column by 'q*' already",
        ),
        ("columns: {q*: pos}", "1 column for 2 coordinates: q1 q2"),
        ("columns: {q*: 3}", "1 column for 2 coordinates: q1 q2"),
        ("columns: {q*: 3..5}", "3 columns for 2 coordinates: q1 q2"),
        ("columns: {q**: 'a*'}", "a pattern has one `*`"),
        (
            "columns: {tau_q1: 'amps*35.2'}",
            "'*' stands for what it stands for in the key, and 'tau_q1' has none",
        ),
        ("columns: {q1: [2, 3]}", "2 columns for 1 coordinate: "),
        (
            "columns: {q*: [2, 3..4, 5, 6]}",
            "a column's name, its number",
        ),
        ("time: [1, 2]", "the time is in one column"),
        (
            "columns: {q1: {column: a, factor: [1, 2]}}",
            "2 values for 1 coordinate",
        ),
        (
            "columns: {tau1: {column: a, gain: 3}}",
            "a gain belongs to an effort in A or mA",
        ),
        ("columns: {tau1: {column: a, unit: A, gain: 0}}", "it is 0"),
        (
            "columns: {t: {column: a}}",
            "the column of time has a key of its own",
        ),
        ("separator: ','\ndecimal: ','", "a comma cannot stand"),
        (
            "process: {standstill: {effort: down-weight}}",
            "memory of a filter",
        ),
        (
            "process: {filter: {local: {half_width: 1}, fourier: {frequency: 1, harmonics: 2}}}",
            "exactly one of",
        ),
        (
            "process: {delay: {passive: 0.1}}",
            "'passive' is none of q1 q2",
        ),
        ("process: {delay: auto, energy: 1}", "not from energy"),
        (
            "runs: [{files: [a], payload: {mass: 3}}]",
            "unknown key 'mass'",
        ),
        (
            "runs: [{files: [a], payload: {com: [1, 2]}}]",
            "expected 3 entries, found 2",
        ),
        ("- a", "expected a mapping with columns"),
        ("a: 1\na: 2", "not YAML"),
        ("rate: [1", "not YAML"),
    ] {
        if why.is_empty() {
            assert_eq!(columns(text), ["q1=a *1 +0"]);
            continue;
        }
        let found = mistakes(text).join("\n");
        assert!(found.contains(why), "{text}: {found}");
    }
    let gains = read("columns: {tau_*: {column: 'i*', unit: A, gain: [3, unknown]}}");
    assert_eq!(gains.unknown_gains, ["q2"]);
    let refused = gains.require_plain().unwrap_err();
    assert_eq!(refused.0[0].path, "`columns`, the effort of q2");
}

/// The coordinates that the machines' own specs have.
#[test]
fn the_files_of_measured_machines_name_every_column() {
    let arm = ["pan", "lift", "elbow", "w1", "w2", "w3"];
    let [q, a] = [
        ["q1", "q2", "q3", "q4", "q5", "q6", "q7"],
        ["A1", "A2", "A3", "A4", "A5", "A6", "A7"],
    ];
    let machines: [(&str, &[&str], usize); 4] = [
        (
            include_str!("../../../../robots/measured/ur10e.yaml"),
            &arm,
            19,
        ),
        (
            include_str!("../../../../robots/measured/dvrk_psm.yaml"),
            &q,
            21,
        ),
        (
            include_str!("../../../../robots/measured/dvrk_mtm.yaml"),
            &q,
            21,
        ),
        (
            include_str!("../../../../robots/measured/med7.yaml"),
            &a,
            14,
        ),
    ];
    for (text, coordinates, columns) in machines {
        let actuated: Vec<usize> = (0..coordinates.len()).collect();
        let info = Info {
            coordinates,
            actuated: &actuated,
            ..Info::EMPTY
        };
        let file = ExperimentFile::read(text, &info).unwrap();
        assert_eq!(file.settings.columns.len(), columns);
        assert!(file.require_plain().is_ok());
        let validate = file.runs_in(Path::new(""), Purpose::Validate);
        assert_eq!((file.runs.len(), validate.len()), (2, 1));
        assert!(text.starts_with("# yaml-language-server: $schema=../runs.schema.json\n"));
    }
}

#[test]
fn the_schema_closes_every_record_and_describes_every_key() {
    fn visit(value: &Value, keys: &mut usize) {
        if let Some(properties) = value["properties"].as_object() {
            assert_ne!(value["additionalProperties"], Value::Null, "{value}");
            for property in properties.values() {
                *keys += 1;
                assert!(property["description"].is_string(), "{property}");
            }
        }
        match value {
            Value::Object(entries) => entries.values().for_each(|item| visit(item, keys)),
            Value::Array(items) => items.iter().for_each(|item| visit(item, keys)),
            _ => {}
        }
    }
    let mut keys = 0;
    visit(&serde_json::from_str(&schema()).unwrap(), &mut keys);
    assert_eq!(
        keys, 108,
        "keys were added or lost: adjust this number knowingly"
    );
}

#[test]
fn what_runs_carry_is_found_by_the_spec_s_payloads_and_contradictions_are_told() {
    let file = read(
        "runs:
  - {files: a}
  - {files: b, payload: {body: box, m: 2}}
  - {files: c, payload: {body: ball}}
  - {files: d, payload: {body: box, m: 2, com: [0, 0, 0.1]}}
",
    );
    assert!(file.has_unknowns());
    let bodies = ["box", "ball"].map(str::to_owned);
    let found = file.loads(&bodies).unwrap();
    assert_eq!(found.carried, [None, Some(0), Some(1), Some(0)]);
    assert_eq!(found.payloads[0].mass, Some(2.0));
    assert_eq!(found.payloads[0].com, Some([0.0, 0.0, 0.1]));
    assert_eq!(found.payloads[1].mass, None);
    for (text, why) in [
        ("{body: lid}", "'lid' is not a payload of the spec"),
        ("unknown", "the spec has several payloads: box ball"),
        (
            "{body: box, m: 3}",
            "another run states other parameters of 'box'",
        ),
        (
            "{body: box}",
            "of 'box' one run states parameters, and another one says that it is unknown",
        ),
        (
            "{body: box}, use: identify",
            "of 'box' one run states parameters, and another one says that it is unknown",
        ),
    ] {
        let text = format!(
            "runs: [{{files: a, payload: {{body: box, m: 2}}}}, {{files: b, payload: {text}}}]"
        );
        let refused = read(&text).loads(&bodies).unwrap_err();
        assert_eq!(refused.0.len(), 1);
        assert_eq!(refused.0[0].message, why);
        assert_eq!(refused.0[0].path, "`runs`, entry 2, `payload`");
        assert!(refused.0[0].at > 40 && refused.0[0].remedy.is_some());
    }
    // a run that is only predicted carries what was found
    let text = "runs: [{files: a, payload: {body: box, m: 2}}, {files: b, payload: {body: box}, use: validate}]";
    assert_eq!(read(text).loads(&bodies).unwrap().carried, [Some(0); 2]);
    let arm = ["pan", "lift", "elbow", "w1", "w2", "w3"];
    let info = Info {
        coordinates: &arm,
        actuated: &[0, 1, 2, 3, 4, 5],
        ..Info::EMPTY
    };
    let text = include_str!("../../../../robots/measured/ur10e_gains.yaml");
    let file = ExperimentFile::read(text, &info).unwrap();
    assert_eq!(file.unknown_gains, arm);
    assert_eq!(file.loads(&bodies[..1]).unwrap().carried, [None, Some(0)]);
}
