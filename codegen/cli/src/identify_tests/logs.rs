//! Tests of faulty logs, of their columns, and of periodic runs.

use std::fmt::Write as _;
use std::fs;

use regen_identify::data::{
    Assignment, DataError, Fault, FileReport, Gaps, Logs, Policy, Problem, Problems, Settings,
};
use regen_identify::identify::{EquationKind, Identified, Options, identify};
use regen_identify::signals::Method;

use super::{Bench, FREQUENCY, HARMONICS, csv, normal, run, scratch, with, worst};
use regen_reference::Random;

#[test]
fn faults_are_told_with_their_rows_or_left_out() {
    Bench::new().with(1000, 0.005, |model, rows, beta| {
        let good = csv(model, &rows);
        let mut lines: Vec<String> = good.lines().map(str::to_owned).collect();
        // lines[k] is row k + 1 of the file
        lines[100] = "0.495,NaN,1,1,1".to_owned();
        lines[200] = "0.995,1,2".to_owned();
        lines[300] = lines[299].clone();
        lines[400] = lines[398].clone();
        let mut parts: Vec<String> = lines[500].split(',').map(str::to_owned).collect();
        parts[1] = "9.5".to_owned();
        lines[500] = parts.join(",");
        lines.drain(600..650);
        let path = scratch("faults.csv", &(lines.join("\n") + "\n"));
        let mut settings = with(Method::Fourier {
            frequency: FREQUENCY,
            harmonics: HARMONICS,
        });
        settings.checks.gaps = Gaps::Fail;
        let error = Logs::open(model, std::slice::from_ref(&path), &settings)
            .err()
            .unwrap();
        let DataError::Problems { problems, .. } = &error else {
            panic!("{error}");
        };
        let mut told: Vec<(u64, &str)> = problems
            .first
            .iter()
            .map(|p| (p.row, p.what.kind()))
            .collect();
        told.sort_unstable();
        assert_eq!(
            told,
            [
                (101, "not a number"),
                (201, "wrong number of entries"),
                (301, "duplicate time"),
                (401, "unsorted time"),
                (501, "outlier"),
                (601, "gap"),
            ]
        );
        let failure = crate::exit::Failure::from(error);
        assert!(failure.to_string().contains("--problems drop"), "{failure}");

        settings.checks.gaps = Gaps::Bridge;
        let settings = Settings {
            policy: Policy::Drop,
            ..settings
        };
        let found = run(model, &path, &settings, EquationKind::Forces);
        let off = worst(&found.estimate.values, beta);
        assert!(off < 1e-7, "{off:e}");
        // filters do not reach across gaps
        let settings = Settings {
            method: Method::Central,
            ..settings
        };
        let found = run(model, &path, &settings, EquationKind::Forces);
        assert!(worst(&found.estimate.values, beta) < 3e-2);
        fs::remove_file(path).unwrap();
    });
}

#[test]
fn an_uneven_clock_is_answered_with_a_grid_and_other_faults_are_not() {
    let usual = 0.004;
    let gap = |step: f64| Problem::of(7, Fault::Gap { step, usual });
    let twice = Problem::of(9, Fault::Duplicate { time: 1.0 });
    let told = |first: &[Problem]| {
        let counts = first.iter().map(|own| (own.what.kind().to_owned(), 1));
        let problems = Problems {
            first: first.to_vec(),
            counts: counts.collect(),
        };
        let file = "log.csv".to_owned();
        crate::exit::Failure::from(DataError::Problems { file, problems }).to_string()
    };
    assert!(told(&[gap(0.006)]).contains("even grid with --resample 250; or"));
    let both = told(&[gap(0.006), twice.clone()]);
    assert!(
        both.contains("--resample 250 and --problems drop"),
        "{both}"
    );
    // rows that are all longer than the header are not left out
    let rows = |found: usize| -> Vec<Problem> {
        let entries = |row| Problem::of(row, Fault::Entries { found, expected: 7 });
        (2..30).map(entries).collect()
    };
    let text = told(&rows(8));
    assert!(
        text.contains("a title in the header") && !text.contains("--problems"),
        "{text}"
    );
    let text = told(&rows(14));
    assert!(text.contains("another separator"), "{text}");
    for others in [&[gap(0.6)][..], &[twice][..]] {
        let text = told(others);
        assert!(!text.contains("--resample"), "{text}");
        assert!(
            text.contains("leave them out with --problems drop"),
            "{text}"
        );
    }
}

#[test]
fn joints_that_stand_still_in_all_logs_are_named_with_the_remedy() {
    let report = |still: &[&str]| FileReport {
        still: still.iter().map(|name| (*name).to_owned()).collect(),
        ..FileReport::default()
    };
    let error = || crate::exit::Failure::Numeric("the data determine 1 of 2".to_owned());
    let logs = [report(&["head", "q2", "wheel"]), report(&["wheel", "head"])];
    let text = crate::observe::with_still(error(), &logs).to_string();
    assert!(
        text.contains("no log has motion of head, wheel beyond"),
        "{text}"
    );
    assert!(text.contains("`regen import --lock`"), "{text}");
    let moved = [report(&["q2"]), report(&[])];
    let text = crate::observe::with_still(error(), &moved).to_string();
    assert!(!text.contains("--lock"), "{text}");
}

#[test]
fn a_log_of_stretches_that_are_shorter_than_the_filter_is_named_as_the_cause() {
    let report = |longest: f64, cuts: usize| {
        let mut report = FileReport {
            file: "a.csv".to_owned(),
            longest,
            settling: 1.8,
            ..FileReport::default()
        };
        report.bridged.cuts = cuts;
        report
    };
    let said = |report: FileReport| {
        let error = crate::exit::Failure::Numeric("0 equations".to_owned());
        crate::observe::with_still(error, &[report]).to_string()
    };
    let text = said(report(0.65, 30));
    assert!(
        text.contains("a.csv: gaps, dropouts or rows that are left out divide it into stretches")
            && text.contains("at most 0.650 s, and the filter needs 1.80 s"),
        "{text}"
    );
    // a short log, and one that is only divided, have another cause
    assert_eq!(said(report(0.65, 0)), "0 equations");
    assert_eq!(said(report(2.0, 3)), "0 equations");
}

#[test]
fn an_effort_at_its_limit_is_told() {
    Bench::new().with(400, 0.0125, |model, mut rows, _| {
        let most = rows.iter().fold(0.0, |m: f64, r| m.max(r.tau[1]));
        for row in &mut rows {
            row.tau[1] = row.tau[1].min(0.9 * most);
        }
        let path = scratch("saturated.csv", &csv(model, &rows));
        let settings = with(Method::Central);
        let error = Logs::open(model, std::slice::from_ref(&path), &settings)
            .err()
            .unwrap();
        let DataError::Problems { problems, .. } = &error else {
            panic!("{error}");
        };
        let stuck = rows.iter().filter(|r| r.tau[1] >= 0.9 * most).count();
        assert_eq!(problems.counts, [("saturation".to_owned(), stuck)]);
        assert!(matches!(
            &problems.first[0].what,
            Fault::Saturated { column, .. } if column == "tau_q3"
        ));
        fs::remove_file(path).unwrap();
    });
}

#[test]
fn columns_have_the_names_and_units_that_the_user_gives_them() {
    Bench::new().with(500, 0.01, |model, rows, beta| {
        let mut text = "stamp,left,right,i1,i2\n".to_owned();
        for row in &rows {
            let (q1, q3) = (row.q[0].to_degrees(), row.q[2].to_degrees());
            let _ = writeln!(
                text,
                "{},{q1},{q3},{},{}",
                row.time * 1e3,
                row.tau[0] / 0.25,
                row.tau[1] / -0.5
            );
        }
        let path = scratch("columns.csv", &text);
        let method = Method::Fourier {
            frequency: FREQUENCY,
            harmonics: HARMONICS,
        };
        let given = [
            "t=stamp:ms",
            "q1=left:deg",
            "q3=right:deg",
            "tau_q1=i1:A*0.25",
            "tau_q3=i2:A*-0.5",
        ];
        let settings = Settings {
            columns: given.iter().map(|a| a.parse().unwrap()).collect(),
            method,
            ..Settings::default()
        };
        let found = run(model, &path, &settings, EquationKind::Forces);
        assert!(worst(&found.estimate.values, beta) < 1e-8);

        for (columns, says) in [
            (&given[..4], "there is no column `tau_q3`"),
            (&["t=stamp:ms", "q9=left"], "`q9` is not a coordinate"),
            (&["t=when", "q1=left"], "there is no column `when`"),
            (&["t=stamp", "q1=left"], "missing: q3"),
        ] as [(&[&str], &str); 4]
        {
            let columns: Vec<Assignment> = columns.iter().map(|a| a.parse().unwrap()).collect();
            let settings = Settings {
                columns,
                method,
                ..Settings::default()
            };
            let error = Logs::open(model, std::slice::from_ref(&path), &settings)
                .err()
                .unwrap();
            assert!(error.to_string().contains(says), "{error}");
        }
        fs::remove_file(path).unwrap();
    });
}

#[test]
fn runs_of_a_periodic_trajectory_are_averaged_with_their_spread_as_weights() {
    Bench::new().with(2500, 0.01, |model, mut rows, beta| {
        let mut random = Random::new(9);
        for (k, row) in rows.iter_mut().enumerate() {
            // half of the period is ten times as noisy
            let sigma = if k % 500 < 250 { 0.5 } else { 0.05 };
            for tau in &mut row.tau {
                *tau += sigma * normal(&mut random);
            }
        }
        let path = scratch("periodic.csv", &csv(model, &rows));
        let method = Method::Fourier {
            frequency: FREQUENCY,
            harmonics: HARMONICS,
        };
        let averaged = Settings {
            period: Some(1.0 / FREQUENCY),
            ..with(method)
        };
        let one = run(model, &path, &averaged, EquationKind::Forces);
        let all = run(model, &path, &with(method), EquationKind::Forces);
        assert_eq!(one.errors[0].samples, 500);
        let error = |found: &Identified| -> f64 {
            let pairs = found.estimate.values.iter().zip(beta);
            pairs.map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
        };
        assert!(
            error(&one) < 0.6 * error(&all),
            "{} {}",
            error(&one),
            error(&all)
        );
        let settings = Settings {
            period: Some(4.999),
            ..averaged
        };
        let mut logs = Logs::open(model, std::slice::from_ref(&path), &settings).unwrap();
        let error =
            identify(model, EquationKind::Forces, &Options::default(), &mut logs).unwrap_err();
        assert!(
            error.to_string().contains("whole number of steps"),
            "{error}"
        );
        fs::remove_file(path).unwrap();
    });
}
