//! Advice on logs that contradict the spec: it is in the words of the user's file, and followed, the
//! log fits better; where nothing fits better, there is none.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use crate::common::{Run, regen, scratch};

/// One row of a log of an arm of two links in a plane: time, positions, velocities, accelerations and
/// efforts.
struct Row {
    t: f64,
    motion: [[f64; 2]; 3],
    efforts: [f64; 2],
}

/// The masses, the centres of mass along the links, and the inertias about them; m, kg, kg m^2.
const LINKS: [[f64; 3]; 2] = [[4.0, 0.2, 0.05], [3.0, 0.15, 0.03]];
/// The length of the first link, m.
const LENGTH: f64 = 0.4;
/// Viscous and Coulomb friction.
const FRICTION: [[f64; 2]; 2] = [[1.0, 1.0], [0.5, 0.5]];

/// A log of the arm under this gravity in its plane, m/s^2, with noise in the efforts.
fn rows([gx, gy]: [f64; 2]) -> Vec<Row> {
    let one = |k: u32| {
        let t = 0.005 * f64::from(k);
        let mut motion = [[0.0; 2]; 3];
        let waves = [
            [(0.9, 1.3, 0.2), (0.5, 2.9, 1.1)],
            [(0.8, 1.9, 0.7), (0.4, 3.7, 2.0)],
        ];
        for (joint, waves) in waves.iter().enumerate() {
            for (size, rate, phase) in waves {
                let angle = rate * t + phase;
                motion[0][joint] += size * angle.sin();
                motion[1][joint] += size * rate * angle.cos();
                motion[2][joint] -= size * rate * rate * angle.sin();
            }
        }
        let [[q1, q2], [v1, v2], [a1, a2]] = motion;
        let [[m1, c1, i1], [m2, c2, i2]] = LINKS;
        let h = m2 * LENGTH * c2;
        let own = i2 + m2 * c2 * c2;
        let first = i1 + m1 * c1 * c1 + m2 * LENGTH * LENGTH + own;
        // the moment of gravity on a mass at an angle and a distance
        let weight = |moment: f64, angle: f64| moment * (gx * angle.sin() - gy * angle.cos());
        let outer = weight(m2 * c2, q1 + q2);
        let tau1 = (first + 2.0 * h * q2.cos()) * a1 + (own + h * q2.cos()) * a2
            - h * q2.sin() * (2.0 * v1 * v2 + v2 * v2)
            + weight(m1 * c1 + m2 * LENGTH, q1)
            + outer;
        let tau2 = (own + h * q2.cos()) * a1 + own * a2 + h * q2.sin() * v1 * v1 + outer;
        // rows in no order, as noise has none
        let noise = |seed: u32| f64::from((k + seed) * 7919 % 1009) / 1009.0 - 0.5;
        let friction = |j: usize, v: f64| FRICTION[j][0] * v + FRICTION[j][1] * v.signum();
        Row {
            t,
            motion,
            efforts: [
                tau1 + friction(0, v1) + 0.1 * noise(0),
                tau2 + friction(1, v2) + 0.1 * noise(411),
            ],
        }
    };
    (0..4000).map(one).collect()
}

/// The spec of the arm under this gravity, with or without its bodies.
fn spec(gravity: &str, bodies: bool) -> String {
    let mut out = format!(
        "name: two\n{gravity}\nlimbs:\n  - name: arm\n    joints:\n      \
         - {{name: q1, type: revolute, body: 1, actuated: true, friction: linear}}\n      \
         - {{name: q2, type: revolute, origin: {{xyz: [{LENGTH}, 0, 0]}}, body: 2, actuated: true, \
         friction: linear}}\n"
    );
    if bodies {
        out += "bodies:\n";
        for (k, [m, c, i]) in LINKS.iter().enumerate() {
            let _ = writeln!(
                out,
                "  {}: {{mass: {m}, com: [{c}, 0, 0], inertia: [0.01, 0, 0, {i}, 0, {i}]}}",
                k + 1
            );
        }
    }
    out
}

/// A CSV with these titles and cells.
fn csv(titles: &str, rows: &[Row], cells: impl Fn(&Row) -> Vec<f64>) -> String {
    let mut out = titles.to_owned() + "\n";
    for row in rows {
        let cells: Vec<String> = cells(row).iter().map(f64::to_string).collect();
        out += &(cells.join(",") + "\n");
    }
    out
}

const PLAIN: &str = "t,q1,q2,tau_q1,tau_q2";

fn plain(row: &Row) -> Vec<f64> {
    [&[row.t], &row.motion[0][..], &row.efforts].concat()
}

fn identify(dir: &Path, more: &[&str]) -> Run {
    let args = ["identify", "r.yaml", "log.csv", "--butterworth", "4,15"];
    regen(dir, &[&args[..], more].concat())
}

/// The messages about the columns and the spec, without those on the length of the log.
fn doubts(run: &Run) -> String {
    let lines = run.err.lines();
    let about = lines.filter(|line| line.starts_with("warning: log.csv"));
    about.collect::<Vec<_>>().join("\n")
}

#[test]
fn gravity_that_contradicts_the_log_is_told_with_one_that_fits() {
    let dir = scratch("advice_gravity");
    let down = "gravity: [0, -9.81, 0]";
    for (stated, acts, words) in [
        ("gravity: [0, 9.81, 0]", [0.0, -9.81], "upside down"),
        ("gravity: [-9.81, 0, 0]", [0.0, -9.81], "another axis"),
        ("gravity: [0, 0, -9.81]", [9.81, 0.0], "another axis"),
        (down, [0.0, 0.0], "do not contain gravity"),
        ("gravity: [0, 0, 0]", [0.0, -9.81], "the spec has none"),
    ] {
        for bodies in [true, false] {
            fs::write(dir.join("r.yaml"), spec(stated, bodies)).unwrap();
            fs::write(dir.join("log.csv"), csv(PLAIN, &rows(acts), plain)).unwrap();
            let told = doubts(&identify(&dir, &[]).ended(0));
            // without bodies, no gravity is told only by those errors that inertia cannot take up
            if !bodies && acts == [0.0, 0.0] && told.is_empty() {
                continue;
            }
            assert!(told.contains(words), "{stated} {acts:?} {bodies}\n{told}");
            let advice = told.split('`').find(|part| part.starts_with("gravity: ["));
            fs::write(dir.join("r.yaml"), spec(advice.unwrap(), bodies)).unwrap();
            let again = identify(&dir, &[]).ended(0);
            assert_eq!(doubts(&again), "", "{stated} {acts:?} {bodies}");
        }
    }
    fs::write(dir.join("r.yaml"), spec(down, true)).unwrap();
    fs::write(dir.join("log.csv"), csv(PLAIN, &rows([0.0, -9.81]), plain)).unwrap();
    assert_eq!(doubts(&identify(&dir, &[]).ended(0)), "");
}

#[test]
fn a_weight_that_an_effort_lacks_is_told_with_the_offset_that_takes_it_up() {
    let dir = scratch("advice_weight");
    let lift = |joint: &str| {
        format!(
            "name: lift\nlimbs:\n  - name: lift\n    joints: [{{name: q, type: prismatic, body: load, \
             actuated: true, friction: linear{joint}}}]\nbodies: {{load: {{mass: 19}}}}\n"
        )
    };
    let log = |weight: f64| {
        let mut out = "t,q,tau_q\n".to_owned();
        for k in 0..3000_u32 {
            let t = 0.002 * f64::from(k);
            let q = 0.2 * (3.0 * t).sin() + 0.1 * (7.0 * t).sin();
            let v = 0.6 * (3.0 * t).cos() + 0.7 * (7.0 * t).cos();
            let a = -1.8 * (3.0 * t).sin() - 4.9 * (7.0 * t).sin();
            let noise = f64::from(k * 7919 % 1009) / 1009.0 - 0.5;
            let tau = 19.0 * a + 25.0 * v + 2.0 * v.signum() + weight + noise;
            let _ = writeln!(out, "{t},{q},{tau}");
        }
        out
    };
    for rotor in ["", ", rotor_inertia: true"] {
        fs::write(dir.join("r.yaml"), lift(rotor)).unwrap();
        fs::write(dir.join("log.csv"), log(0.0)).unwrap();
        let told = doubts(&identify(&dir, &[]).ended(0));
        let words = ["is missing in `tau_q`", "Give `q` `offset: true`"];
        assert!(words.iter().all(|word| told.contains(word)), "{told}");
        let change = told.split_once("largest error of an effort is ");
        let change = change.and_then(|(_, rest)| rest.split_once(" % and not "));
        assert!(
            change.is_none_or(|(after, rest)| !rest.starts_with(&format!("{after} %"))),
            "what does not change is no improvement: {told}"
        );
        fs::write(dir.join("r.yaml"), lift(&format!("{rotor}, offset: true"))).unwrap();
        assert_eq!(doubts(&identify(&dir, &[]).ended(0)), "");
        fs::write(dir.join("r.yaml"), lift(rotor)).unwrap();
        fs::write(dir.join("log.csv"), log(19.0 * 9.81)).unwrap();
        assert_eq!(doubts(&identify(&dir, &[]).ended(0)), "");
    }
}

#[test]
fn a_clock_in_another_unit_is_told_with_the_column_that_the_log_has() {
    let dir = scratch("advice_clock");
    fs::write(dir.join("r.yaml"), spec("gravity: [0, -9.81, 0]", true)).unwrap();
    let rows = rows([0.0, -9.81]);
    for title in ["t", "time"] {
        let text = csv(PLAIN, &rows, |row| {
            let mut cells = plain(row);
            cells[0] *= 1e3;
            cells
        });
        fs::write(dir.join("log.csv"), text.replacen('t', title, 1)).unwrap();
        let run = |more: &[&str]| {
            let args = ["identify", "r.yaml", "log.csv", "--no-filter"];
            regen(&dir, &[&args[..], more].concat())
        };
        let told = run(&[]).err;
        let (_, advice) = told.split_once("read it with ").unwrap();
        let options: Vec<&str> = advice.lines().next().unwrap().split(' ').collect();
        let options: Vec<&str> = options.iter().map(|x| x.trim_matches('\'')).collect();
        assert_eq!(options, ["--column", &format!("t={title}*0.001")]);
        assert_eq!(doubts(&run(&options).ended(0)), "");
    }
}

#[test]
fn of_two_efforts_the_one_whose_size_contradicts_the_bodies_is_named() {
    let dir = scratch("advice_scale");
    fs::write(dir.join("r.yaml"), spec("gravity: [0, -9.81, 0]", true)).unwrap();
    fs::write(dir.join("log.csv"), csv(PLAIN, &rows([0.0, -9.81]), plain)).unwrap();
    for (wrong, right) in [("q1", "q2"), ("q2", "q1")] {
        let column = format!("tau_{wrong}=tau_{wrong}*32");
        let told = doubts(&identify(&dir, &["--column", &column]).ended(0));
        assert!(told.contains(&format!("`tau_{wrong}` looks")), "{told}");
        assert!(!told.contains(&format!("tau_{right}")), "{told}");
    }
}

#[test]
fn efforts_that_never_change_are_named_and_no_unit_is_advised() {
    let dir = scratch("advice_constant");
    fs::write(dir.join("r.yaml"), spec("gravity: [0, -9.81, 0]", true)).unwrap();
    let rows = rows([0.0, -9.81]);
    for (first, value) in [(4, 0.0), (4, 1.25), (4, 1e-310), (3, 0.0)] {
        let text = csv(PLAIN, &rows, |row| {
            let mut cells = plain(row);
            cells[first..].fill(value);
            cells
        });
        fs::write(dir.join("log.csv"), text).unwrap();
        let told = doubts(&identify(&dir, &[]));
        assert!(told.contains("`tau_q2`"), "{value}: {told}");
        assert!(told.contains("the same in all rows"), "{value}: {told}");
        assert!(!told.contains("--column"), "{value}: {told}");
    }
}

/// The log with its velocities and accelerations, each times a factor.
fn with_rates(factors: [f64; 2]) -> String {
    let titles = "t,q1,q2,qd_q1,qd_q2,qdd_q1,qdd_q2,tau_q1,tau_q2";
    csv(titles, &rows([0.0, -9.81]), |row| {
        let scaled = |d: usize, factor: f64| row.motion[d].map(|x| factor * x);
        let own = [scaled(1, factors[0]), scaled(2, factors[1])].concat();
        [&[row.t], &row.motion[0][..], &own, &row.efforts].concat()
    })
}

#[test]
fn rates_that_are_no_derivatives_are_told_with_the_factor() {
    let dir = scratch("advice_rates");
    fs::write(dir.join("r.yaml"), spec("gravity: [0, -9.81, 0]", true)).unwrap();
    fs::write(dir.join("log.csv"), with_rates([1.0, 1.0])).unwrap();
    assert_eq!(doubts(&identify(&dir, &[]).ended(0)), "");
    for (factors, refused, column) in [
        ([2.0, 1.0], true, "`qd_q1` is 2.000 times the velocity"),
        ([1.1, 1.0], false, "`qd_q1` is 1.100 times the velocity"),
        ([0.8, 1.0], false, "`qd_q1` is 0.800 times the velocity"),
        (
            [1.0, 100.0],
            true,
            "times the acceleration of column `qd_q1`",
        ),
        (
            [1.0, 0.8],
            false,
            "times the acceleration of column `qd_q1`",
        ),
        ([1.0, -1.0], true, "`qdd_q1` is not the acceleration"),
    ] {
        fs::write(dir.join("log.csv"), with_rates(factors)).unwrap();
        let run = identify(&dir, &[]);
        assert_eq!(run.code != 0, refused, "{}", run.err);
        assert!(run.err.contains(column), "{}", run.err);
        // both joints are read as the first is advised to be
        let (_, advice) = run.err.split_once("--column '").unwrap();
        let first = advice.split('\'').next().unwrap();
        let both = first.replace("q1", "q2");
        let options = ["--column", first, "--column", &both];
        assert_eq!(doubts(&identify(&dir, &options).ended(0)), "", "{first}");
        // the advice counts a factor that is given already
        if !first.contains('-') {
            let title = first.split(['=', '*']).nth(1).unwrap();
            let wrong = format!("{title}={title}*3");
            let told = identify(&dir, &["--column", &wrong]).err;
            assert!(told.contains(first), "{told}");
        }
    }
}

#[test]
fn accelerations_that_are_commanded_are_not_proposed_as_measured() {
    let dir = scratch("advice_commanded");
    fs::write(dir.join("r.yaml"), spec("gravity: [0, -9.81, 0]", true)).unwrap();
    let rows = rows([0.0, -9.81]);
    for title in ["AccCmptd", "Acceleration"] {
        let titles =
            format!("t,Position1,Position2,Velocity1,Velocity2,{title}1,{title}2,Torque1,Torque2");
        let text = csv(&titles, &rows, |row| {
            // a trapezoidal profile: as large as it may be, or none
            let command = row.motion[2].map(|a| 4.0 * (a / 4.0).round().clamp(-1.0, 1.0));
            [
                &[row.t],
                &row.motion[0][..],
                &row.motion[1],
                &command,
                &row.efforts,
            ]
            .concat()
        });
        fs::write(dir.join("log.csv"), text).unwrap();
        let args = ["inspect", "log.csv", "--spec", "r.yaml", "--format", "json"];
        let json = regen(&dir, &args).ended(0).json();
        let proposal = json["proposal"].as_str().unwrap();
        assert!(proposal.contains("qd_q"), "{proposal}");
        assert!(!proposal.contains(title), "{proposal}");
    }
}

#[test]
fn commands_that_are_the_measured_positions_are_refused() {
    let dir = scratch("advice_commands");
    fs::write(dir.join("r.yaml"), spec("gravity: [0, -9.81, 0]", true)).unwrap();
    fs::write(dir.join("log.csv"), csv(PLAIN, &rows([0.0, -9.81]), plain)).unwrap();
    let gains = "q1: {kp: 100, kd: 5}\nq2: {kp: 100, kd: 5}\n";
    fs::write(dir.join("gains.yaml"), gains).unwrap();
    let args = ["identify", "r.yaml", "log.csv", "--estimator", "response"];
    let more = ["--controller", "gains.yaml", "--command", "q1=q1"];
    let run = regen(&dir, &[&args[..], &more, &["--command", "q2=q2"]].concat());
    assert_ne!(run.code, 0);
    let told = "the commands of q1 are its measured positions";
    assert!(run.err.contains(told), "{}", run.err);
    assert!(run.err.contains("--command q1=COLUMN"), "{}", run.err);
}

#[test]
fn a_confidence_takes_the_draws_that_reach_it() {
    let dir = scratch("advice_draws");
    let guide = crate::common::root().join("runtime/guide/fivebar");
    fs::copy(guide.join("fivebar.yaml"), dir.join("r.yaml")).unwrap();
    fs::copy(guide.join("run1.csv"), dir.join("log.csv")).unwrap();
    let run = |more: &[&str]| {
        let all = ["--feasible", "--decimate", "10", "--confidence"];
        identify(&dir, &[&all[..], more].concat())
    };
    let found = run(&["0.98"]).ended(0);
    assert!(found.out.contains("99 draws"), "{}", found.out);
    let few = run(&["0.95", "--draws", "20"]).ended(0);
    let told = "20 draws reach a confidence of 90 % and not 95 %, which takes at least 39 draws";
    assert!(few.err.contains(told), "{}", few.err);
    let usual = run(&["0.95"]).ended(0);
    assert!(!usual.err.contains("draws reach"), "{}", usual.err);
    let beyond = run(&["0.99999999"]).ended(3);
    assert!(
        beyond.err.contains("draws of constrained values"),
        "{}",
        beyond.err
    );
}

#[test]
fn an_effort_that_is_noise_alone_is_told_to_be_that() {
    let dir = scratch("advice_noise");
    let rows = rows([0.0, -9.81]);
    // the bits of a product are as good as noise
    let noise = |row: &Row| {
        let mixed = (row.t * 200.0 + 1.0)
            .round()
            .to_bits()
            .wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let mixed = (mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let bits = u32::try_from(mixed >> 32).unwrap();
        100.0 * (f64::from(bits) / f64::from(u32::MAX) - 0.5)
    };
    let log = csv(PLAIN, &rows, |row| {
        let mut cells = plain(row);
        cells[4] = noise(row);
        cells
    });
    fs::write(dir.join("log.csv"), log).unwrap();
    // bodies that need less than the noise are no contradiction
    for (bodies, kind) in [(true, "note"), (false, "warning")] {
        fs::write(dir.join("r.yaml"), spec("gravity: [0, -9.81, 0]", bodies)).unwrap();
        let text = identify(&dir, &[]).err;
        let words = format!("{kind}: these efforts are mostly noise: q2 (");
        assert!(text.contains(&words), "{text}");
        assert!(!text.contains("does not explain"), "{text}");
    }
}

#[test]
fn other_commands_tell_what_looks_wrong_with_their_logs_too() {
    let dir = scratch("advice_others");
    let rows = rows([0.0, -9.81]);
    fs::write(dir.join("r.yaml"), spec("gravity: [0, -9.81, 0]", true)).unwrap();
    fs::write(dir.join("log.csv"), csv(PLAIN, &rows, plain)).unwrap();
    let found = identify(&dir, &["--out", "p.json"]);
    assert_eq!(found.code, 0, "{}", found.err);
    let filter = ["--butterworth", "4,15"];
    let observe = |log: &str| {
        regen(
            &dir,
            &[&["observe", "r.yaml", log, "--out", "f.json"], &filter[..]].concat(),
        )
    };
    let validate = |log: &str| {
        regen(
            &dir,
            &[&["validate", "r.yaml", "p.json", log], &filter[..]].concat(),
        )
    };
    let flipped = csv(PLAIN, &rows, |row| {
        let mut cells = plain(row);
        cells[4] *= -1.0;
        cells
    });
    fs::write(dir.join("flipped.csv"), flipped).unwrap();
    let advice = "--column 'tau_q2=tau_q2*-1'";
    for run in [observe("flipped.csv"), validate("flipped.csv")] {
        assert!(run.err.contains(advice), "{}", run.err);
    }
    for run in [observe("log.csv"), validate("log.csv")] {
        assert!(!run.err.contains("warning"), "{}", run.err);
    }
}
