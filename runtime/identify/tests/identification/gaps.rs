//! Gaps and dropouts in logs of a pendulum: short ones are bridged, long ones divide the log.

use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;

use regen_identify::data::{Bridged, Checks, FileReport, Gaps, Logs, Policy, Settings};
use regen_identify::estimate::Estimate;
use regen_identify::identify::{EquationKind, LeftOut, NoColumns, Options, equations, identify};
use regen_identify::signals::{Method, Smoothing};
use regen_identify::states::{Filtering, Recorded, Source, StateSample};

use super::robust::Random;
use crate::models::pendulum::Pendulum;

const PHI: [f64; 2] = [0.5, 2.0];
const STEP: f64 = 0.0025;
const ROWS: usize = 4000;

/// A log of 10 s at 400 Hz with noise: time, position and torque.
fn log() -> Vec<[f64; 3]> {
    let mut random = Random(7);
    let row = |k: usize| {
        let t = STEP * k as f64;
        let (slow, fast) = (3.0 * t, 7.0 * t);
        let q = slow.sin() + 0.4 * fast.cos();
        let qdd = -9.0 * slow.sin() - 19.6 * fast.cos();
        let tau = PHI[0] * qdd + PHI[1] * 9.81 * q.sin();
        [t, q + 1e-5 * random.normal(), tau + 0.05 * random.normal()]
    };
    (0..ROWS).map(row).collect()
}

/// Dropouts of `rows` rows every 137 rows, from row `start` on.
fn stretches(start: usize, rows: usize) -> Vec<std::ops::Range<usize>> {
    let starts = (start..ROWS - 100).step_by(137);
    starts.map(|k| k..k + rows).collect()
}

/// Rows that repeat entries of the row before the stretch.
fn late(stretches: &[std::ops::Range<usize>], entries: &[usize]) -> Vec<[f64; 3]> {
    let mut rows = log();
    for stretch in stretches {
        for k in stretch.clone() {
            for entry in entries {
                rows[k][*entry] = rows[stretch.start - 1][*entry];
            }
        }
    }
    rows
}

/// Rows without those of the stretches.
fn thinned(stretches: &[std::ops::Range<usize>]) -> Vec<[f64; 3]> {
    let rows = log().into_iter().enumerate();
    let kept = rows.filter(|(k, _)| !stretches.iter().any(|own| own.contains(k)));
    kept.map(|(_, row)| row).collect()
}

fn write(name: &str, rows: &[[f64; 3]]) -> PathBuf {
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("gaps");
    fs::create_dir_all(&dir).unwrap();
    let mut text = String::from("t,q1,tau_q1\n");
    for [t, q, tau] in rows {
        writeln!(text, "{t:.4},{q:.7},{tau:.5}").unwrap();
    }
    let path = dir.join(name);
    fs::write(&path, text).unwrap();
    path
}

fn settings() -> Settings {
    Settings {
        method: Method::Butterworth {
            order: 4,
            cutoff: 8.0,
        },
        ..Settings::default()
    }
}

fn identified(name: &str, rows: &[[f64; 3]], settings: &Settings) -> (Estimate, FileReport) {
    let mut logs = Logs::open(&Pendulum, &[write(name, rows)], settings).unwrap();
    let options = Options::default();
    let found = identify(&Pendulum, EquationKind::Forces, &options, &mut logs).unwrap();
    (found.estimate, logs.reports()[0].clone())
}

/// The differences of two estimates, in deviations of the second.
fn distances(a: &Estimate, b: &Estimate) -> Vec<f64> {
    let pairs = a.values.iter().zip(&b.values).enumerate();
    pairs
        .map(|(k, (a, x))| (a - x).abs() / b.sigma(k))
        .collect()
}

#[test]
fn estimates_from_bridged_logs_are_as_near_to_the_whole_one_as_their_deviations_say() {
    let (whole, report) = identified("whole.csv", &log(), &settings());
    assert_eq!((report.bridged.count, report.bridged.cuts), (0, 0));
    // 12 rows are 8.8 % of the log, 30 are 22 %
    for rows in [3, 12, 30] {
        let own = stretches(60, rows);
        let cases = [
            ("all.csv", late(&own, &[1, 2])),
            ("positions.csv", late(&own, &[1])),
            ("efforts.csv", late(&own, &[2])),
            ("thinned.csv", thinned(&own)),
        ];
        for (name, log) in cases {
            let (found, report) = identified(name, &log, &settings());
            let Bridged { count, cuts, .. } = report.bridged;
            // one signal near a turning point tells little of the rows without a change
            let least = own.len() - if rows == 3 { 4 } else { 1 };
            assert!(
                (least..=own.len()).contains(&count),
                "{name} {rows}: {count}"
            );
            assert_eq!(cuts, 0, "{name} {rows}");
            assert_eq!(report.bridged.rows, rows * count, "{name} {rows}");
            assert_eq!(report.bridged.largest, rows, "{name} {rows}");
            // deviations of this fit are those of white noise, and one dropout may be missed; as they
            // are, the repeated rows put estimates tens of deviations off
            let distances = distances(&whole, &found);
            assert!(
                distances.iter().all(|z| *z < 4.0),
                "{name} {rows}: {distances:?}"
            );
            let ratios = (0..2).map(|k| found.sigma(k) / whole.sigma(k));
            let wider = ratios.fold(0.0, f64::max);
            assert!(wider < 3.0, "{name} {rows}: {wider}");
        }
    }
}

#[test]
fn longer_dropouts_and_those_at_the_ends_divide_the_log_and_are_told() {
    // 80 rows are 0.2 s, a period of the filter is 0.125 s
    let own = [1..30, 1900..1980, 3960..ROWS];
    let (_, report) = identified("long.csv", &late(&own, &[1, 2]), &settings());
    assert_eq!((report.bridged.count, report.bridged.cuts), (0, 1));
    let told: Vec<(u64, Option<u64>)> = report
        .problems
        .first
        .iter()
        .map(|p| (p.row, p.last))
        .collect();
    assert_eq!(
        told,
        [(3, Some(31)), (1902, Some(1981)), (3962, Some(4001))]
    );
    assert_eq!(
        report.problems.counts,
        [("dropout".to_owned(), 29 + 80 + 40)]
    );
    assert_eq!(report.rows, ROWS - 149);
    let (_, report) = identified("gap.csv", &thinned(&own[1..2]), &settings());
    assert_eq!((report.bridged.count, report.bridged.cuts), (0, 1));
    assert_eq!(report.problems.counts, [("gap".to_owned(), 1)]);
}

#[test]
fn gaps_are_treated_as_the_settings_say() {
    let own = stretches(60, 12);
    let with = |gaps: Gaps, policy: Policy| Settings {
        policy,
        checks: Checks {
            gaps,
            ..Checks::default()
        },
        ..settings()
    };
    let path = write("treated.csv", &late(&own[..2], &[1, 2]));
    let open = |settings: &Settings| Logs::open(&Pendulum, std::slice::from_ref(&path), settings);
    let rows = |settings: &Settings| open(settings).unwrap().reports()[0].rows;
    for policy in [Policy::Fail, Policy::Drop, Policy::Keep] {
        assert_eq!(rows(&with(Gaps::Bridge, policy)), ROWS - 24);
        assert_eq!(rows(&with(Gaps::Keep, policy)), ROWS);
        assert_eq!(rows(&with(Gaps::Drop, policy)), ROWS - 24);
        let error = open(&with(Gaps::Fail, policy)).err().unwrap().to_string();
        assert!(error.contains("24 rows cannot be used"), "{error}");
        assert!(
            error.contains("rows 62 to 73: columns `q1`, `tau_q1` as in the row before: a dropout"),
            "{error}"
        );
    }
    // without a filter there is nothing to keep going
    let central = Settings {
        method: Method::Central,
        ..with(Gaps::Bridge, Policy::Fail)
    };
    let report = open(&central).unwrap().reports()[0].clone();
    assert_eq!(
        (report.bridged, report.problems.total()),
        (Bridged::default(), 24)
    );
    // a local regression needs no rows in a gap
    let local = Settings {
        method: Method::Local { half_width: 0.1 },
        ..with(Gaps::Bridge, Policy::Fail)
    };
    let mut logs = open(&local).unwrap();
    let bridged = logs.reports()[0].bridged;
    assert_eq!((bridged.count, bridged.rows, bridged.cuts), (2, 24, 0));
    let mut breaks = 0;
    logs.visit(&mut |row| {
        breaks += usize::from(!row.follows);
        Ok(())
    })
    .unwrap();
    assert_eq!(breaks, 1);
}

#[test]
fn a_clock_of_uneven_steps_stays_an_error() {
    let mut rows = log();
    for (k, row) in rows.iter_mut().enumerate() {
        row[0] += if k % 2 == 0 { 0.3 * STEP } else { -0.3 * STEP };
    }
    let error = Logs::open(&Pendulum, &[write("uneven.csv", &rows)], &settings()).err();
    let error = error.unwrap().to_string();
    assert!(error.contains("an uneven step"), "{error}");
}

/// Equations hold exactly behind the filter, whatever samples in a bridged gap are.
#[test]
fn samples_in_a_gap_have_no_influence_on_filtered_equations() {
    let smoothings = [
        Smoothing::Butterworth {
            order: 4,
            cutoff: 8.0,
        },
        // four equations are averaged
        Smoothing::Butterworth {
            order: 3,
            cutoff: 2.0,
        },
        Smoothing::Local { half_width: 0.05 },
    ];
    for smoothing in smoothings {
        let mut log = Recorded::new().filtered(Filtering {
            smoothing,
            ..Filtering::default()
        });
        for k in 0..2400 {
            let t = STEP * f64::from(k);
            let (q, qdd) = ((3.0 * t).sin(), -9.0 * (3.0 * t).sin());
            let bridged = (600..615).contains(&k) || (900..950).contains(&k);
            let tau = PHI[0] * qdd + PHI[1] * 9.81 * q.sin();
            log.push_row(&StateSample {
                time: t,
                q: &[q],
                qd: &[3.0 * (3.0 * t).cos()],
                qdd: &[qdd],
                tau: &[if bridged { 1e3 } else { tau }],
                efforts: &[],
                held: &[],
                at_standstill: &[],
                weights: &[1.0],
                follows: k > 0,
                bridged,
            });
        }
        let (mut worst, mut left) = (0.0, 0);
        let mut columns = NoColumns;
        let out: LeftOut = equations(
            &Pendulum,
            EquationKind::Forces,
            &mut log,
            &mut columns,
            &mut |rows| {
                if rows.weights[0] == 0.0 {
                    left += 1;
                } else {
                    let predicted = rows.w[0] * PHI[0] + rows.w[1] * PHI[1];
                    worst = f64::max(worst, (predicted - rows.tau[0]).abs());
                }
                Ok(())
            },
        )
        .unwrap();
        // forces of size 20, rounding of the filter's two passes
        assert!(worst < 1e-9, "{smoothing:?}: {worst}");
        assert_eq!(out.bridged, left, "{smoothing:?}");
        // the middle of the longer gap is left out where the filter is no longer than it
        let is_fast = smoothing != smoothings[1];
        assert_eq!(left > 0, is_fast, "{smoothing:?}");
        assert!(left < 70, "{smoothing:?}: {left}");
        let energy = EquationKind::Energy { window: 0.5 };
        let mut windows = 0;
        equations(&Pendulum, energy, &mut log, &mut columns, &mut |rows| {
            if let [tau] = rows.tau {
                windows += 1;
                assert!((rows.w[0] * PHI[0] + rows.w[1] * PHI[1] - tau).abs() < 1e-2);
            }
            Ok(())
        })
        .unwrap();
        // of 12 windows those that overlap a gap are lost
        assert!((8..=10).contains(&windows), "{windows}");
    }
}

/// The numbers of states of a log, in two runs of one clock or of two, or with one wrong time.
#[test]
fn a_clock_that_goes_back_divides_the_log_and_one_wrong_time_is_left_out() {
    let settings = Settings {
        policy: Policy::Drop,
        ..settings()
    };
    let states = |name: &str, rows: &[[f64; 3]], settings: &Settings| {
        let mut logs = Logs::open(&Pendulum, &[write(name, rows)], settings).unwrap();
        let (mut count, mut breaks) = (0, 0);
        logs.visit(&mut |row| {
            count += 1;
            breaks += usize::from(!row.follows);
            Ok(())
        })
        .unwrap();
        (count, breaks, logs.reports()[0].problems.counts.clone())
    };
    let half = &log()[..ROWS / 2];
    let (once, ..) = states("once.csv", half, &settings);
    let twice = [half, half].concat();
    // a clock that starts again is that of another run in the same file
    let told = vec![];
    assert_eq!(
        states("twice.csv", &twice, &settings),
        (2 * once, 2, told.clone())
    );
    let mut later = twice.clone();
    later[ROWS / 2..].iter_mut().for_each(|row| row[0] += 0.5);
    let set_back = vec![("clock set back".to_owned(), 1)];
    assert_eq!(
        states("later.csv", &later, &settings),
        (2 * once, 2, set_back)
    );
    let grid = Settings {
        resample: Some(400.0),
        ..settings.clone()
    };
    let (once, ..) = states("once.csv", half, &grid);
    assert_eq!(states("twice.csv", &twice, &grid), (2 * once, 2, told));

    let (whole, ..) = states("whole.csv", &log(), &settings);
    let mut rogue = log();
    rogue[1500][0] = 98765.0;
    let (count, breaks, told) = states("rogue.csv", &rogue, &settings);
    assert_eq!((count, breaks), (whole, 1), "{told:?}");
    rogue[1500][0] = 0.0;
    let (count, _, told) = states("zero.csv", &rogue, &settings);
    assert!(
        count > whole - 2000 && count < whole,
        "{count} {whole} {told:?}"
    );
}
