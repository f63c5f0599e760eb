//! The properties with which logs are simulated are found in them.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::path::PathBuf;

use regen_identify::data::{Run, Settings};
use regen_inspect::{ClockSource, LogFacts, Role, inspect, proposal};

/// The properties of a simulated log of two coupled joints.
#[allow(
    clippy::struct_excessive_bools,
    reason = "each is a property of its own"
)]
#[derive(Clone)]
struct Facts {
    header: &'static str,
    rate: f64,
    seconds: f64,
    /// Steps of the encoders, rad.
    step: f64,
    /// The highest frequency of the motion, Hz, whose lowest is a twentieth of it.
    highest: f64,
    /// By how much the efforts are behind the motion, s.
    delay: f64,
    /// The bound of the first effort.
    bound: f64,
    /// Time of rest at the beginning, s.
    rest: f64,
    /// Whether the second joint is locked.
    locked: bool,
    /// Whether rows have times, and velocities.
    timed: bool,
    velocities: bool,
    /// Factors of the efforts, and whether they are exchanged.
    signs: [f64; 2],
    exchanged: bool,
}

const PLAIN: Facts = Facts {
    header: "t,a,b,tau_a,tau_b",
    rate: 200.0,
    seconds: 40.0,
    step: 1e-5,
    highest: 2.0,
    delay: 0.0,
    bound: f64::INFINITY,
    rest: 0.0,
    locked: false,
    timed: true,
    velocities: false,
    signs: [1.0; 2],
    exchanged: false,
};

/// Position, velocity and acceleration of a joint: four harmonics of a base frequency.
fn motion(joint: usize, t: f64, highest: f64) -> [f64; 3] {
    let mut out = [0.0; 3];
    for k in [1, 5, 11, 20] {
        let w = TAU * highest / 20.0 * f64::from(k);
        let phase = 0.7 * f64::from(k) + 2.1 * joint as f64;
        let size = 0.5 / f64::from(k).powf(1.2);
        let (s, c) = (w * t + phase).sin_cos();
        out[0] += size * s;
        out[1] += size * w * c;
        out[2] -= size * w * w * s;
    }
    out
}

/// The efforts of both joints of an arm in an upright plane, with friction.
fn efforts(a: [f64; 3], b: [f64; 3]) -> [f64; 2] {
    let friction = |v: f64| 0.8 * (v / 1e-2).tanh() + 0.4 * v;
    let both = (a[0] + b[0]).cos();
    [
        1.1 * a[2] + 0.2 * b[2] + 6.0 * a[0].cos() + 1.5 * both + friction(a[1]),
        0.2 * a[2] + 0.3 * b[2] + 1.5 * both + 0.5 * friction(b[1]),
    ]
}

/// Simulates and inspects a log with these properties; returns the findings and the path of the
/// log.
fn inspected(name: &str, facts: &Facts) -> (LogFacts, PathBuf) {
    let mut text = String::new();
    if !facts.header.is_empty() {
        text.push_str(facts.header);
        text.push('\n');
    }
    let mut state = 9_u64;
    let mut noise = || {
        let mut sum = -6.0;
        for _ in 0..12 {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            sum += (state >> 33) as f64 / 2_f64.powi(31);
        }
        0.02 * sum
    };
    let rows = facts.rate * facts.seconds;
    for k in 0.. {
        let t = f64::from(k) / facts.rate;
        if f64::from(k) >= rows {
            break;
        }
        let moved = (t - facts.rest).max(0.0);
        let at = |t: f64| {
            [0, 1].map(|joint| {
                let mut state = motion(joint, t, facts.highest);
                if t <= 0.0 {
                    (state[1], state[2]) = (0.0, 0.0);
                }
                state
            })
        };
        let lock = |[a, b]: [[f64; 3]; 2]| [a, if facts.locked { [0.3, 0.0, 0.0] } else { b }];
        let [a, b] = lock(at(moved));
        let [late_a, late_b] = lock(at((moved - facts.delay).max(0.0)));
        let tau = efforts(late_a, late_b).map(|x| x + noise());
        let mut tau = [
            facts.signs[0] * tau[0].min(facts.bound),
            facts.signs[1] * tau[1],
        ];
        if facts.exchanged {
            tau.reverse();
        }
        let read = |q: f64| (q / facts.step).round() * facts.step;
        let mut cells = Vec::new();
        cells.extend(facts.timed.then_some(t));
        cells.extend([read(a[0]), read(b[0])]);
        if facts.velocities {
            cells.extend([a[1], b[1]]);
        }
        cells.extend(tau);
        let cells: Vec<String> = cells.iter().map(|x| format!("{x:.9}")).collect();
        writeln!(text, "{}", cells.join(",")).unwrap();
    }
    let path = std::env::temp_dir().join(format!("regen-{name}-{}.csv", std::process::id()));
    std::fs::write(&path, text).unwrap();
    let out = inspect(&Run::from(path.as_path()), &Settings::default(), None).unwrap();
    std::fs::remove_file(&path).unwrap();
    (out, path)
}

fn has_note(found: &LogFacts, words: &str) -> bool {
    found.notes.iter().any(|note| note.contains(words))
}

#[test]
fn steps_noise_cutoff_and_period_are_those_of_the_log() {
    let facts = Facts {
        step: 1e-3,
        ..PLAIN
    };
    let (found, _) = inspected("plain", &facts);
    let roles: Vec<Role> = found.columns.iter().map(|c| c.role).collect();
    assert_eq!(
        roles[1..],
        [Role::Position, Role::Position, Role::Effort, Role::Effort]
    );
    assert!((found.clock.rate - 200.0).abs() < 1e-6 && found.clock.even);
    for column in &found.columns[1..3] {
        assert!(
            (column.encoder_step - 1e-3).abs() < 1e-8,
            "{}",
            column.encoder_step
        );
    }
    for column in &found.columns[3..] {
        assert!((column.noise / 0.02 - 1.0).abs() < 0.1, "{}", column.noise);
        let floor = column.spectrum.unwrap();
        // the steps of friction add a little at all frequencies
        let noise = floor.noise / 0.02;
        assert!((0.9..1.4).contains(&noise) && floor.flat, "{floor:?}");
    }
    // the highest frequency, widened by the window of the spectrum
    let cutoff = found.cutoff.unwrap();
    assert!((2.0..2.6).contains(&cutoff), "{cutoff}");
    let period = found.period.unwrap();
    assert!((period.seconds - 10.0).abs() < 0.02 && (period.repetitions - 4.0).abs() < 0.02);
    for (effort, joint) in found.efforts.iter().zip(["a", "b"]) {
        assert_eq!(
            (effort.follows.as_deref(), effort.reversed),
            (Some(joint), false)
        );
    }
    assert!(found.notes.is_empty(), "{:?}", found.notes);
}

#[test]
fn the_delay_of_efforts_is_found_within_its_deviation() {
    for delay in [0.0, 0.012] {
        let (found, path) = inspected("delay", &Facts { delay, ..PLAIN });
        for effort in &found.efforts {
            let [seconds, sigma] = effort.delay.unwrap();
            assert!((seconds - delay).abs() < 4.0 * sigma, "{effort:?}");
            assert!(sigma < 2e-3, "{effort:?}");
        }
        assert_eq!(
            has_note(&found, "efforts are behind the motion"),
            delay > 0.0
        );
        let facts = std::slice::from_ref(&found);
        let text = proposal(&[Run::from(path.as_path())], facts, false, None).unwrap();
        assert_eq!(text.contains("  delay: auto\n"), delay > 0.0, "{text}");
        // and if nothing else has to be processed
        let bare = LogFacts {
            cutoff: None,
            ..found
        };
        let text = proposal(&[Run::from(path)], &[bare], false, None).unwrap();
        assert_eq!(text.contains("process:\n  "), delay > 0.0, "{text}");
        assert_eq!(text.contains("process:"), delay > 0.0, "{text}");
    }
}

#[test]
fn exchanged_and_reversed_efforts_are_found_by_their_friction() {
    let swapped = Facts {
        exchanged: true,
        ..PLAIN
    };
    let (swapped, _) = inspected("swapped", &swapped);
    assert!(has_note(
        &swapped,
        "`tau_a` is taken for the effort of a and follows the motion of b"
    ));
    assert!(has_note(
        &swapped,
        "`tau_b` is taken for the effort of b and follows the motion of a"
    ));
    assert!(!has_note(&swapped, "opposite sign"));
    let signs = [1.0, -1.0];
    let (reversed, _) = inspected("reversed", &Facts { signs, ..PLAIN });
    assert!(has_note(
        &reversed,
        "`tau_b` has the opposite sign of the motion of b"
    ));
    assert!(!has_note(&reversed, "`tau_a`"));
}

#[test]
fn saturation_and_rest_are_reported_with_their_shares() {
    let facts = Facts {
        bound: 8.0,
        rest: 8.0,
        ..PLAIN
    };
    let (found, _) = inspected("bounds", &facts);
    let effort = &found.columns[3];
    assert!((effort.high.value - 8.0).abs() < 1e-9 && effort.high.share > 0.05);
    assert!(has_note(&found, "`tau_a` is at its extreme 8.000"));
    assert!(!has_note(&found, "`tau_b` is at its extreme"));
    for column in &found.columns[1..3] {
        assert!((column.resting - 0.2).abs() < 0.02, "{}", column.resting);
    }
    assert!(has_note(&found, "`a` rests in"));
}

#[test]
fn a_locked_joint_of_a_log_without_header_is_one_of_its_joints() {
    let facts = Facts {
        header: "",
        velocities: true,
        locked: true,
        ..PLAIN
    };
    let (found, _) = inspected("locked", &facts);
    let roles: Vec<Role> = found.columns.iter().map(|c| c.role).collect();
    let [t, p, v, e] = [Role::Time, Role::Position, Role::Velocity, Role::Effort];
    assert_eq!(roles, [t, p, p, v, v, e, e]);
    let locked = &found.joints[1];
    let columns = [locked.position, locked.velocity, locked.effort];
    assert_eq!(columns, [Some(3), Some(5), Some(7)]);
    assert!(
        has_note(&found, "column 3 never moves"),
        "{:?}",
        found.notes
    );
}

#[test]
fn a_log_without_header_and_time_is_understood_by_its_derivatives() {
    let facts = Facts {
        header: "",
        timed: false,
        velocities: true,
        rate: 125.0,
        ..PLAIN
    };
    let (found, path) = inspected("bare", &facts);
    let roles: Vec<Role> = found.columns.iter().map(|c| c.role).collect();
    let [p, v, e] = [Role::Position, Role::Velocity, Role::Effort];
    assert_eq!(roles, [p, p, v, v, e, e]);
    assert_eq!(found.columns[3].derivative.unwrap().of, 2);
    assert_eq!(found.clock.source, ClockSource::Velocities);
    assert!(
        (found.clock.rate - 125.0).abs() < 1.5,
        "{}",
        found.clock.rate
    );
    let text = proposal(&[Run::from(path)], &[found], false, None).unwrap();
    for line in [
        "  \"*\": {column: 1..2}",
        "  \"qd_*\": {column: 3..4}",
        "  \"tau_*\": {column: 5..6}",
        "rate: 1",
    ] {
        assert!(text.contains(line), "{line}\n{text}");
    }
}

#[test]
fn columns_followed_by_smoother_ones_are_not_taken_for_positions_and_efforts() {
    let mut text = String::new();
    for k in 0..4000 {
        let t = 0.01 * f64::from(k);
        let cells = [0.53, 1.13, 0.31, 0.77].map(|f| format!("{:.6}", (TAU * f * t).sin()));
        writeln!(text, "{t:.2},{}", cells.join(",")).unwrap();
    }
    let path = std::env::temp_dir().join(format!("regen-smoother-{}.csv", std::process::id()));
    std::fs::write(&path, text).unwrap();
    let found = inspect(&Run::from(path.as_path()), &Settings::default(), None).unwrap();
    std::fs::remove_file(&path).unwrap();
    let roles: Vec<Role> = found.columns.iter().map(|c| c.role).collect();
    let o = Role::Other;
    assert_eq!(roles, [Role::Time, o, o, o, o]);
}

#[test]
fn a_log_in_which_nothing_moves_has_no_cutoff() {
    let mut text = String::from("t,a,tau_a\n");
    for k in 0..2000 {
        writeln!(text, "{:.3},0.3,{}", 0.005 * f64::from(k), k % 7).unwrap();
    }
    let path = std::env::temp_dir().join(format!("regen-still-{}.csv", std::process::id()));
    std::fs::write(&path, text).unwrap();
    let found = inspect(&Run::from(path.as_path()), &Settings::default(), None).unwrap();
    std::fs::remove_file(&path).unwrap();
    assert_eq!(found.cutoff, None);
}

#[test]
fn a_clock_that_stands_still_is_no_clock() {
    let mut text = String::from("t,a,tau_a\n");
    for k in 0..2000 {
        let t = 0.005 * f64::from(k);
        writeln!(text, "7.5,{:.6},{:.6}", t.sin(), t.cos()).unwrap();
    }
    let path = std::env::temp_dir().join(format!("regen-stopped-{}.csv", std::process::id()));
    std::fs::write(&path, text).unwrap();
    let found = inspect(&Run::from(path.as_path()), &Settings::default(), None).unwrap();
    std::fs::remove_file(&path).unwrap();
    assert_eq!(found.clock.source, ClockSource::Unknown);
    assert_eq!((found.rows, found.clock.backwards), (2000, 0));
}

/// A log of lines of cells, as inspect finds it.
fn of_lines(
    name: &str,
    header: &str,
    rows: usize,
    cells: impl Fn(usize) -> Vec<String>,
) -> LogFacts {
    let mut text = format!("{header}\n");
    for k in 0..rows {
        writeln!(text, "{}", cells(k).join(",")).unwrap();
    }
    let path = std::env::temp_dir().join(format!("regen-{name}-{}.csv", std::process::id()));
    std::fs::write(&path, text).unwrap();
    let out = inspect(&Run::from(path.as_path()), &Settings::default(), None).unwrap();
    std::fs::remove_file(&path).unwrap();
    out
}

#[test]
fn temperatures_of_motors_are_neither_positions_nor_efforts() {
    // columns `J1 ...` are all of the joint J1; the temperatures rise slowly in whole degrees
    for (unit, plain) in [
        ("MotorTemp[degC]", "J1"),
        ("Temp [\u{b0}C]", "A1"),
        ("Heat [K]", "A1"),
    ] {
        let header = format!("t,{plain} Pos [deg],{plain} Current [A],{plain} {unit}");
        let found = of_lines("heat", &header, 4000, |k| {
            let t = 0.005 * k as f64;
            let angle = 40.0 * (1.7 * t).sin() + 10.0 * (4.1 * t).cos();
            let current = 2.0 * (1.7 * t).cos().signum() + 3.0 * angle.to_radians().sin();
            [t, angle, current, 30.0 + (0.2 * t).floor()]
                .map(|x| format!("{x:.5}"))
                .to_vec()
        });
        let roles: Vec<Role> = found.columns.iter().map(|c| c.role).collect();
        let expected = [Role::Time, Role::Position, Role::Current, Role::Other];
        assert_eq!(roles, expected, "{unit}");
        assert_eq!(found.joints.len(), 1, "{unit}");
    }
}

#[test]
fn an_uneven_clock_is_not_taken_for_noise_of_the_positions() {
    let mut state = 3_u64;
    let mut even = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (state >> 33) as f64 / 2_f64.powi(31) - 0.5
    };
    let sigma = 2e-5;
    let rows: Vec<Vec<String>> = (0..4000)
        .map(|k| {
            // steps of 10 ms, each row up to 2 ms early or late
            let t = 0.01 * f64::from(k) + 4e-3 * even();
            let noise = sigma * (0..12).map(|_| even()).sum::<f64>();
            let [q, qd, qdd] = motion(0, t, 5.0);
            let tau = 1.1 * qdd + 6.0 * q.cos() + 0.8 * qd.signum() + 0.02 * even();
            vec![
                format!("{t:.9}"),
                format!("{:.9}", q + noise),
                format!("{tau:.6}"),
            ]
        })
        .collect();
    let found = of_lines("uneven", "t,a,tau_a", rows.len(), |k| rows[k].clone());
    assert!(!found.clock.even);
    // what differences leave of a motion of 5 Hz at 100 Hz adds a tenth; taken as even, the rows
    // would show 1 ms of a motion of 1 rad/s, fifty times as much
    let noise = found.columns[1].noise;
    assert!((noise / sigma - 1.0).abs() < 0.2, "{noise}");
    // the highest frequency of the motion, widened by the window of the spectrum
    let cutoff = found.cutoff.unwrap();
    assert!((5.0..6.5).contains(&cutoff), "{cutoff}");
    let text = proposal(&[Run::from(PathBuf::from("a.csv"))], &[found], false, None).unwrap();
    assert!(text.contains("  resample: 100\n  filter: "), "{text}");
}

#[test]
fn a_joint_that_stands_still_is_told_once_and_hides_no_period() {
    let mut state = 5_u64;
    let mut noise = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        1e-5 * ((state >> 33) as f64 / 2_f64.powi(31) - 0.5)
    };
    let rows: Vec<Vec<String>> = (0..6000)
        .map(|k| {
            let t = 0.005 * f64::from(k);
            let [q, qd, qdd] = motion(0, t, 2.0);
            let locked = 0.3 + noise();
            [t, q + noise(), locked, qd, 0.0, 1.1 * qdd + 0.4 * qd, 0.0]
                .map(|x| format!("{x:.9}"))
                .to_vec()
        })
        .collect();
    let header = "t,a,b,qd_a,qd_b,tau_a,tau_b";
    let found = of_lines("standing", header, rows.len(), |k| rows[k].clone());
    let of_b: Vec<&String> = found.notes.iter().filter(|n| n.contains('b')).collect();
    assert_eq!(of_b, ["`b` never moves"], "{:?}", found.notes);
    let period = found.period.unwrap();
    assert!((period.seconds - 10.0).abs() < 0.02, "{period:?}");
}

/// The proposal for a log of one found log.
fn proposed(found: &LogFacts) -> String {
    let run = Run::from(PathBuf::from("a.csv"));
    proposal(&[run], std::slice::from_ref(found), false, None).unwrap()
}

#[test]
fn gains_of_currents_are_proposed_as_unknown_but_for_that_of_the_first_which_changes() {
    for (unit, what) in [("[A]", "N m/A"), ("[%]", "N m per %")] {
        let facts = of_header(&format!("t,a,b,current_a {unit},current_b {unit}"));
        let (mut found, _) = inspected("gains", &facts);
        let text = proposed(&found);
        for line in [
            "\"current_a UNIT\", unit: A, gain: 1}",
            "\"current_b UNIT\", unit: A, gain: unknown}",
            "the gain of tau_a is set to 1",
        ] {
            assert!(text.contains(&line.replace("UNIT", unit)), "{line}\n{text}");
        }
        assert!(text.contains(what), "{text}");
        assert!(text.lines().all(|line| line.len() <= 80), "{text}");
        // an effort that never changes tells no scale
        found.columns[3].high = found.columns[3].low;
        let text = proposed(&found);
        assert!(
            text.contains(&format!("\"current_b {unit}\", unit: A, gain: 1}}")),
            "{text}"
        );
    }
}

#[test]
fn a_torque_beside_a_percentage_gives_the_scale() {
    let (found, _) = inspected("mixed", &of_header("t,a,b,a torque [Nm],b torque [%]"));
    let text = proposed(&found);
    assert!(text.contains("\"a torque [Nm]\", unit: Nm}"), "{text}");
    assert!(
        text.contains("\"b torque [%]\", unit: A, gain: unknown}"),
        "{text}"
    );
}

/// The plain properties with another header.
fn of_header(header: &str) -> Facts {
    Facts {
        header: header.to_owned().leak(),
        ..PLAIN
    }
}

#[test]
fn reversed_efforts_are_proposed_with_a_factor() {
    let signs = [1.0, -1.0];
    let (found, _) = inspected("reversed-proposal", &Facts { signs, ..PLAIN });
    let text = proposed(&found);
    assert!(
        text.contains("tau_b: {column: tau_b, factor: -1}"),
        "{text}"
    );
    assert!(text.contains("tau_a: {column: tau_a}"), "{text}");
    assert!(text.contains("  # factor: -1 where"), "{text}");
    // without names, all factors are in one line
    let facts = Facts {
        header: "",
        velocities: true,
        signs,
        ..PLAIN
    };
    let (found, _) = inspected("reversed-bare", &facts);
    let text = proposed(&found);
    assert!(
        text.contains("\"tau_*\": {column: 6..7, factor: [1, -1]}"),
        "{text}"
    );
}

#[test]
fn columns_are_matched_with_coordinates_by_their_words_and_the_topic_is_kept() {
    let words = ["elbow", "wrist"];
    let of = |what: &str| words.map(|joint| format!("/joint_states/{joint}/{what}"));
    let header = ["t".to_owned()]
        .into_iter()
        .chain(of("position"))
        .chain(of("effort"));
    let header: Vec<String> = header.collect();
    let path = std::env::temp_dir().join(format!("regen-words-{}.csv", std::process::id()));
    let mut text = header.join(",") + "\n";
    for k in 0..4000 {
        let t = 0.005 * f64::from(k);
        let [a, b] = [0, 1].map(|joint| motion(joint, t, 2.0));
        let tau = efforts(a, b);
        writeln!(
            text,
            "{t:.3},{:.7},{:.7},{:.5},{:.5}",
            a[0], b[0], tau[0], tau[1]
        )
        .unwrap();
    }
    std::fs::write(&path, text).unwrap();
    // the coordinates in another order than the columns
    let info = regen_runtime::Info {
        name: "arm",
        coordinates: &["wrist", "elbow"],
        independent: &[0, 1],
        actuated: &[0, 1],
        ..regen_runtime::Info::EMPTY
    };
    let mut run = Run::from(path.as_path());
    let found = inspect(&run, &Settings::default(), Some(&info)).unwrap();
    std::fs::remove_file(&path).unwrap();
    let columns: Vec<_> = found
        .joints
        .iter()
        .map(|j| (j.name.as_str(), j.position, j.effort))
        .collect();
    let expected = [("wrist", Some(3), Some(5)), ("elbow", Some(2), Some(4))];
    assert_eq!(columns, expected);
    run.topic = Some("/joint_states".to_owned());
    let text = proposal(&[run], &[found], true, None).unwrap();
    assert!(
        text.contains("elbow: {column: /joint_states/elbow/position}"),
        "{text}"
    );
    assert!(text.contains(", topic: /joint_states}"), "{text}");
}

#[test]
fn a_wrapped_position_is_inspected_without_its_jumps() {
    let folder = std::env::temp_dir();
    let [plain, wrapped] = [false, true].map(|is_wrapped| {
        let name = format!("wrapped-{is_wrapped}-{}.csv", std::process::id());
        let path = folder.join(name);
        let mut text = "t,a\n".to_owned();
        for k in 0..4000_u32 {
            let t = f64::from(k) / 200.0;
            let q = 2.0 + 1.8 * (1.3 * t).sin() + 0.4 * (4.1 * t).sin();
            let q = if is_wrapped && q > std::f64::consts::PI {
                q - TAU
            } else {
                q
            };
            writeln!(text, "{t},{q:.6}").unwrap();
        }
        std::fs::write(&path, text).unwrap();
        let found = inspect(&Run::from(path.as_path()), &Settings::default(), None).unwrap();
        std::fs::remove_file(&path).unwrap();
        found
    });
    assert!(has_note(&wrapped, "`a` jumps by 6.28319 ("));
    let ends = |found: &LogFacts| found.columns[1].spectrum.unwrap().ends;
    assert_eq!(ends(&wrapped), ends(&plain));
    assert!(!has_note(&plain, "wrapped"));
}
