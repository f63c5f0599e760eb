//! The same motion in logs of different formats gives the same parameters.

use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;

use regen_identify::data::{
    Checks, DataError, Decimal, Format, Header, Join, Logs, Policy, Run, Separator, Settings,
};
use regen_identify::identify::{EquationKind, Options, identify};
use regen_identify::signals::{Method, SignalError};
use regen_identify::states::Source;

use crate::models::pendulum::Pendulum;

/// Inertia and first moment.
const PHI: [f64; 2] = [0.5, 2.0];

/// Position, velocity and torque at a time.
fn at(t: f64) -> [f64; 3] {
    let (slow, fast) = (3.0 * t, 7.0 * t);
    let q = slow.sin() + 0.4 * fast.cos();
    let qd = 3.0 * slow.cos() - 2.8 * fast.sin();
    let qdd = -9.0 * slow.sin() - 19.6 * fast.cos();
    [q, qd, PHI[0] * qdd + PHI[1] * 9.81 * q.sin()]
}

/// Writes a file into the folder of a test.
fn write(test: &str, name: &str, text: &str) -> PathBuf {
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(test);
    fs::create_dir_all(&dir).unwrap();
    let path = dir.join(name);
    fs::write(&path, text).unwrap();
    path
}

fn times(count: u32) -> impl Iterator<Item = f64> {
    (0..count).map(|k| 0.01 * f64::from(k))
}

fn assigned(columns: &[&str]) -> Settings {
    Settings {
        columns: columns.iter().map(|text| text.parse().unwrap()).collect(),
        ..Settings::default()
    }
}

fn values(run: Run, settings: &Settings) -> Vec<f64> {
    let mut logs = Logs::open(&Pendulum, &[run], settings).unwrap();
    let found = identify(
        &Pendulum,
        EquationKind::Forces,
        &Options::default(),
        &mut logs,
    );
    found.unwrap().estimate.values
}

/// The states of a run: time, position, velocity and acceleration.
fn states(run: Run, settings: &Settings) -> Vec<[f64; 4]> {
    let mut logs = Logs::open(&Pendulum, &[run], settings).unwrap();
    let mut out = Vec::new();
    logs.visit(&mut |row| {
        out.push([row.time, row.q[0], row.qd[0], row.qdd[0]]);
        Ok(())
    })
    .unwrap();
    out
}

#[test]
fn times_in_another_unit_than_seconds_are_told() {
    let text = times(300).fold("t,q1,tau_q1\n".to_owned(), |text, t| {
        let [q, _, tau] = at(t);
        text + &format!("{},{q},{tau}\n", 1e3 * t)
    });
    let path = write("times", "ms.csv", &text);
    let settings = assigned(&["t=t:ms"]);
    let opened = |start: f64, end: f64| {
        let run = Run {
            times: Some((start, end)),
            ..Run::from(path.clone())
        };
        Logs::open(&Pendulum, &[run], &settings).map(|logs| logs.reports()[0].uncut)
    };
    assert_eq!(opened(0.5, 2.0), Ok(None));
    assert_eq!(opened(0.0, 2.0), Ok(None));
    // in ms, which has the whole log
    assert_eq!(opened(0.0, 2000.0), Ok(Some((0.0, 2.99))));
    let error = opened(500.0, 2000.0).unwrap_err().to_string();
    assert!(
        error.contains(
            "no row has a time from 500 s to 2000 s: those of the log are from 0 s to 2.99 s"
        ),
        "{error}"
    );
}

#[test]
fn a_column_that_is_late_is_read_at_the_time_of_its_values() {
    for (late, stated) in [(0.063, "0.063"), (-0.045, "-45e-3")] {
        // the columns of the position and of the effort, one of them late
        let log = |by: [f64; 2]| {
            times(900).fold("t,q1,tau_q1\n".to_owned(), |text, t| {
                let (q, tau) = (at(t - by[0])[0], at(t - by[1])[2]);
                text + &format!("{t},{q},{tau}\n")
            })
        };
        for (by, column) in [([late, 0.0], "q1=q1"), ([0.0, late], "tau_q1=tau_q1")] {
            let path = write("late", &format!("{column}{late}.csv"), &log(by));
            for method in [
                Method::Central,
                Method::Butterworth {
                    order: 4,
                    cutoff: 20.0,
                },
            ] {
                let read = |columns: &[&str]| {
                    let settings = Settings {
                        method,
                        ..assigned(columns)
                    };
                    values(path.clone().into(), &settings)
                };
                let off = |values: &[f64]| (values[0] / PHI[0] - 1.0).abs();
                let found = read(&[&format!("{column}:late:{stated}")]);
                assert!(off(&found) < 0.01, "{column} {late} {method:?}: {found:?}");
                let unread = read(&[]);
                assert!(
                    off(&unread) > 0.012,
                    "{column} {late} {method:?}: {unread:?}"
                );
            }
        }
    }
    let path = write("late", "poses.csv", "q1,tau_q1\n0.1,1\n0.2,2\n0.3,3\n");
    let settings = Settings {
        poses: true,
        ..assigned(&["q1=q1:late:0.1"])
    };
    let error = Logs::open(&Pendulum, &[path.as_path()], &settings).err();
    let error = error.map(|own| own.to_string()).unwrap_or_default();
    assert!(
        error.contains("no time at which `q1` could be late"),
        "{error}"
    );
}

#[test]
fn a_log_in_another_format_gives_the_same_parameters() {
    let file = |name: &str, row: &dyn Fn(f64) -> String| {
        let text = times(300).fold(String::new(), |text, t| text + &row(t) + "\n");
        Run::from(write("ways", name, &text))
    };
    let headed = |name: &str, header: &str, row: &dyn Fn(f64) -> String| {
        let text = times(300).fold(format!("{header}\n"), |text, t| text + &row(t) + "\n");
        Run::from(write("ways", name, &text))
    };
    let plain = headed("plain.csv", "t,q1,tau_q1", &|t| {
        let [q, _, tau] = at(t);
        format!("{t},{q},{tau}")
    });
    let expected = values(plain, &Settings::default());
    assert!((expected[0] / PHI[0] - 1.0).abs() < 1e-3, "{expected:?}");
    let same = |run: Run, settings: &Settings, what: &str| {
        let found = values(run, settings);
        for (a, b) in found.iter().zip(&expected) {
            assert!((a / b - 1.0).abs() < 1e-9, "{what}: {found:?} {expected:?}");
        }
    };
    let commas = |text: String| text.replace('.', ",");
    let excel = headed("semicolons.csv", "t;q1;tau_q1", &|t| {
        let [q, _, tau] = at(t);
        commas(format!("{t};{q};{tau}"))
    });
    same(excel.clone(), &Settings::default(), "semicolons, found");
    let stated = Settings {
        format: Format {
            separator: Some(Separator::Semicolon),
            decimal: Some(Decimal::Comma),
            ..Format::default()
        },
        ..Settings::default()
    };
    same(excel, &stated, "semicolons, stated");
    let bare = file("bare.csv", &|t| {
        let [q, _, tau] = at(t);
        format!("{tau}\t{}\t{}", 1e3 * t, (q - 0.25).to_degrees() * 45.0)
    });
    let mut settings = assigned(&["t=2:ms", "q1=3:deg*1/45", "tau_q1=1"]);
    settings.columns[1].offset = 0.25;
    same(
        bare.clone(),
        &settings,
        "by number, with units, factor and offset",
    );
    settings.format.header = Header::None;
    same(bare, &settings, "by number, header stated");
    let rateless = headed("rate.csv", "q1,tau_q1", &|t| {
        let [q, _, tau] = at(t);
        format!("{q},{tau}")
    });
    let rate = Settings {
        rate: Some(100.0),
        ..Settings::default()
    };
    same(rateless, &rate, "a rate");

    // positions and torques in separate files
    let positions = headed("positions.csv", "t,q1", &|t| format!("{t},{}", at(t)[0]));
    let torques = headed("torques.csv", "tau_q1", &|t| format!("{}", at(t)[2]));
    let beside = Run {
        files: [&positions, &torques]
            .iter()
            .flat_map(|run| run.files.clone())
            .collect(),
        ..Run::default()
    };
    same(beside, &Settings::default(), "side by side by rows");
    let mut text = "t,tau_q1\n".to_owned();
    for k in 0..700 {
        let t = 0.0041 * f64::from(k) - 0.03;
        writeln!(text, "{t},{}", at(t)[2]).unwrap();
    }
    let clocked = write("ways", "clocked.csv", &text);
    let beside = Run {
        files: positions.files.iter().cloned().chain([clocked]).collect(),
        ..Run::default()
    };
    let found = values(beside, &Settings::default());
    for (a, b) in found.iter().zip(&expected) {
        // a cubic through rows 4.1 ms apart, of a signal of 7 rad/s: its error is
        // 3/128 (w h)^4 = 2e-8 of the signal
        assert!(
            (a / b - 1.0).abs() < 1e-5,
            "by time: {found:?} {expected:?}"
        );
    }
}

#[test]
fn rows_and_times_outside_the_run_are_left_out_before_any_check() {
    let mut text = "t,q1,tau_q1\n".to_owned();
    for (k, t) in times(200).enumerate() {
        let [q, _, tau] = at(t);
        // the rows that are left out have no numbers
        if (20..150).contains(&k) {
            writeln!(text, "{t},{q},{tau}").unwrap();
        } else {
            writeln!(text, "{t},x,{tau}").unwrap();
        }
    }
    let path = write("parts", "log.csv", &text);
    let by_rows = Run {
        rows: Some((21, 150)),
        ..Run::from(path.clone())
    };
    let found = states(by_rows, &Settings::default());
    let (first, last) = (found[0][0], found[found.len() - 1][0]);
    // up to three neighbours on either side are needed
    assert!(
        (0.2..0.235).contains(&first) && (1.455..1.495).contains(&last),
        "{first} {last}"
    );
    let by_time = Run {
        times: Some((0.3, 1.0)),
        ..Run::from(path.clone())
    };
    let found = states(by_time, &Settings::default());
    let (first, last) = (found[0][0], found[found.len() - 1][0]);
    assert!(
        (0.3..0.335).contains(&first) && (0.965..1.005).contains(&last),
        "{first} {last}"
    );
    let whole = Logs::open(&Pendulum, &[path], &Settings::default()).err();
    assert!(
        matches!(whole, Some(DataError::Problems { .. })),
        "{whole:?}"
    );
}

#[test]
fn files_side_by_side_with_unequal_rows_are_refused_by_name() {
    let positions = write("unequal", "pos.csv", "t,q1\n0,0\n0.01,0.1\n0.02,0.2\n");
    let torques = write("unequal", "cur.csv", "tau_q1\n1\n2\n");
    let run = Run {
        files: vec![positions, torques],
        join: Join::Rows,
        ..Run::default()
    };
    let error = Logs::open(&Pendulum, &[run], &Settings::default())
        .err()
        .unwrap();
    let text = error.to_string();
    assert!(text.contains("cur.csv ends after 2 rows"), "{text}");
}

#[test]
fn an_uneven_clock_is_filtered_on_an_even_grid_and_refused_without_one() {
    let mut text = "t,q1,tau_q1\n".to_owned();
    let mut t = 100.0;
    for k in 0..1500 {
        t += if k % 3 == 0 { 0.012 } else { 0.01 };
        let [q, _, tau] = at(t);
        writeln!(text, "{t},{q},{tau}").unwrap();
    }
    let run = Run::from(write("uneven", "log.csv", &text));
    let mut settings = Settings {
        method: Method::Butterworth {
            order: 4,
            cutoff: 10.0,
        },
        ..Settings::default()
    };
    let mut logs = Logs::open(&Pendulum, std::slice::from_ref(&run), &settings).unwrap();
    let refused = identify(
        &Pendulum,
        EquationKind::Forces,
        &Options::default(),
        &mut logs,
    )
    .err();
    let refused = refused.unwrap();
    assert!(
        matches!(
            refused,
            DataError::Signal {
                why: SignalError::NotUniform { .. },
                ..
            }
        ),
        "{refused}"
    );
    assert!(refused.to_string().contains("resampled"), "{refused}");
    settings.resample = Some(100.0);
    let found = values(run.clone(), &settings);
    for (a, b) in found.iter().zip(&PHI) {
        assert!((a / b - 1.0).abs() < 1e-3, "{found:?}");
    }
    settings.resample = Some(30.0);
    let coarse = Logs::open(&Pendulum, std::slice::from_ref(&run), &settings)
        .err()
        .unwrap()
        .to_string();
    assert!(coarse.contains("too coarse for rows at 100 Hz"), "{coarse}");
    settings.resample = Some(1e5);
    let fine = Logs::open(&Pendulum, &[run], &settings)
        .err()
        .unwrap()
        .to_string();
    assert!(fine.contains("is its time in another unit?"), "{fine}");
}

#[test]
fn measured_velocities_alone_are_used_and_differentiated_once() {
    // positions of a coarse encoder, exact velocities
    let mut text = "t,q1,qd_q1,tau_q1\n".to_owned();
    for t in times(600) {
        let [q, qd, tau] = at(t);
        writeln!(text, "{t},{},{qd},{tau}", (q / 1e-3).round() * 1e-3).unwrap();
    }
    let run = Run::from(write("velocities", "log.csv", &text));
    let mut settings = Settings::default();
    for [t, _, qd, qdd] in states(run.clone(), &settings) {
        assert_eq!(qd.to_bits(), at(t)[1].to_bits());
        // differences of velocities are of second order or better
        let exact = -9.0 * (3.0 * t).sin() - 19.6 * (7.0 * t).cos();
        assert!((qdd - exact).abs() < 0.05, "{t}: {qdd} {exact}");
    }
    let error = |settings: &Settings| {
        let found = values(run.clone(), settings);
        (found[0] / PHI[0] - 1.0).abs()
    };
    settings.standstill = regen_identify::states::Standstill::Keep;
    let measured = error(&settings);
    settings.measured_rates = Some(false);
    let computed = error(&settings);
    assert!(measured < 2e-3 && computed > 0.1, "{measured} {computed}");
    settings.method = Method::Butterworth {
        order: 4,
        cutoff: 8.0,
    };
    let computed = error(&settings);
    settings.measured_rates = Some(true);
    let measured = error(&settings);
    assert!(
        measured < 1e-3 && measured < computed,
        "{measured} {computed}"
    );
}

#[test]
fn doubtful_rows_are_treated_by_their_kind() {
    let mut text = "t,q1,tau_q1\n".to_owned();
    for (k, t) in times(300).enumerate() {
        let [q, _, tau] = at(t);
        let q = if k == 150 { q + 3.0 } else { q };
        writeln!(text, "{t},{q},{tau}").unwrap();
    }
    let path = write("kinds", "log.csv", &text);
    let open = |outliers: Option<Policy>| {
        let settings = Settings {
            checks: Checks {
                outliers,
                ..Checks::default()
            },
            ..Settings::default()
        };
        Logs::open(&Pendulum, std::slice::from_ref(&path), &settings)
    };
    assert!(matches!(open(None), Err(DataError::Problems { .. })));
    let rows = |policy| open(Some(policy)).unwrap().reports()[0].rows;
    assert_eq!((rows(Policy::Tell), rows(Policy::Drop)), (300, 299));
}

/// Position and whether the joint creeps: it swings to and fro, 0.85 s each way, and creeps for 0.15 s at
/// 0.028 of its rms speed before it turns.
fn swing_that_sticks(t: f64) -> (f64, bool) {
    use core::f64::consts::PI;
    const SWING: f64 = 0.85;
    const CREEP: f64 = 0.02;
    let way = |t: f64| {
        SWING / PI * (1.0 - (PI * t.min(SWING) / SWING).cos()) + CREEP * (t - SWING).max(0.0)
    };
    let within = t.rem_euclid(2.0);
    let q = if within < 1.0 {
        way(within)
    } else {
        way(1.0) - way(within - 1.0)
    };
    (q, t.rem_euclid(1.0) > SWING)
}

#[test]
fn a_joint_that_sticks_before_it_turns_counts_as_resting_there() {
    let rows = times(2000).map(|t| format!("{t},{},0\n", swing_that_sticks(t).0));
    let text = format!("t,q1,tau_q1\n{}", rows.collect::<String>());
    let run = Run::from(write("sticking", "log.csv", &text));
    let settings = Settings {
        method: Method::Butterworth {
            order: 4,
            cutoff: 7.0,
        },
        ..Settings::default()
    };
    let mut logs = Logs::open(&Pendulum, &[run], &settings).unwrap();
    // of creeping and of moving samples, how many there are and how many rest
    let mut counts = [[0.0; 2]; 2];
    logs.visit(&mut |row| {
        let (_, creeps) = swing_that_sticks(row.time);
        let count = &mut counts[usize::from(creeps)];
        count[0] += 1.0;
        count[1] += f64::from(row.at_standstill[0]);
        Ok(())
    })
    .unwrap();
    let [moving, creeping] = counts.map(|[all, resting]| resting / all);
    // the filter's transients are at both ends of a stretch of 15 samples
    assert!(creeping > 0.75, "{creeping}");
    assert!(moving < 0.08, "{moving}");
}

#[test]
fn accelerations_that_are_nearly_all_noise_are_named_and_those_behind_a_filter_are_not() {
    let mut state = 3_u64;
    let mut text = "t,q1,tau_q1\n".to_owned();
    for t in times(3000) {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        let noise = 0.02 * ((state >> 33) as f64 / 2_f64.powi(31) - 0.5);
        let [q, _, tau] = at(t);
        writeln!(text, "{t},{},{tau}", q + noise).unwrap();
    }
    let path = write("noisy", "noisy.csv", &text);
    let noisy = |method: Method| {
        let settings = Settings {
            method,
            ..Settings::default()
        };
        let runs = [Run::from(path.clone())];
        let mut logs = Logs::open(&Pendulum, &runs, &settings).unwrap();
        logs.visit(&mut |_| Ok(())).unwrap();
        logs.reports()[0].noisy.clone()
    };
    // a deviation of 6 mrad at 100 rows a second: 140 rad/s^2 beside a motion of 15 rad/s^2
    assert_eq!(noisy(Method::Central), ["q1"]);
    let filter = Method::Butterworth {
        order: 4,
        cutoff: 4.0,
    };
    assert_eq!(noisy(filter), [""; 0]);
}
