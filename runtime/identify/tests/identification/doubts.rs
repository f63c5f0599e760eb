//! Logs that are read without an error and look wrong.

use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;

use regen_identify::data::{Assignment, Logs, Run, Settings};
use regen_identify::session::{Session, errors_with_columns};
use regen_identify::signals::Method;
use regen_identify::suspect::{LogColumns, suspicions};

use crate::models::pendulum::Pendulum;

/// What looks wrong with a log of a swinging pendulum.
///
/// - `effort`: what is added to the effort of a row;
/// - `beyond`: the size of a motion that is no harmonic of 0.5 Hz, rad.
fn doubts(effort: impl Fn(u32) -> f64, beyond: f64, method: Method) -> Vec<String> {
    let mut text = "t,q1,tau_q1\n".to_owned();
    for k in 0..2000_u32 {
        let t = 0.005 * f64::from(k);
        let (w, v) = (std::f64::consts::TAU * 0.5, 41.0);
        let q = (w * t).sin() + beyond * (v * t).sin();
        let qdd = -w * w * (w * t).sin() - beyond * v * v * (v * t).sin();
        // rows in no order, as noise has none
        let noise = f64::from(k * 7919 % 1009) / 1009.0 - 0.5;
        let tau = 0.5 * qdd + 2.0 * 9.81 * q.sin() + 0.05 * noise + effort(k);
        let _ = writeln!(text, "{t},{},{tau}", q + 1e-5 * noise);
    }
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("doubts");
    fs::create_dir_all(&dir).unwrap();
    let path = dir.join(format!("{}-{}.csv", effort(700), beyond));
    fs::write(&path, text).unwrap();
    let settings = Settings {
        method,
        ..Settings::default()
    };
    let logs = Logs::open(&Pendulum, std::slice::from_ref(&path), &settings).unwrap();
    let columns = LogColumns {
        file: "log.csv",
        given: &[],
        model: &Pendulum,
    };
    let session = Session::new(&Pendulum, settings.clone());
    let run = Run::from(path.clone());
    let whole = |columns: &[Assignment]| errors_with_columns(&session, &run, columns).ok();
    let sample = logs.sample(0).unwrap();
    let found = suspicions(&columns, &sample, None, &whole, &mut |_, _| {});
    found.iter().map(ToString::to_string).collect()
}

#[test]
fn an_effort_that_jumps_and_is_back_in_the_next_row_is_named_with_the_first_row() {
    assert_eq!(doubts(|_| 0.0, 0.0, Method::Central), [""; 0]);
    let spiked = |k: u32| {
        if k > 0 && k.is_multiple_of(700) {
            90.0
        } else {
            0.0
        }
    };
    let found = doubts(spiked, 0.0, Method::Central);
    assert_eq!(found.len(), 1, "{found:?}");
    let says = "column `tau_q1` jumps by up to 90.0 in 2 rows and is back in the next (the first is \
                row 702)";
    assert!(found[0].contains(says), "{found:?}");
}

#[test]
fn a_constant_in_an_effort_is_told_from_a_tenth_of_its_residuals_on_with_its_value() {
    // noise in no order, of 0.87 N m rms
    let noise = |k: u32| 3.0 * (f64::from(k * 4241 % 1013) / 1013.0 - 0.5);
    assert_eq!(doubts(noise, 0.0, Method::Central), [""; 0]);
    for constant in [-0.9, 0.8] {
        let found = doubts(|k| constant + noise(k), 0.0, Method::Central);
        assert_eq!(found.len(), 1, "{found:?}");
        let value = found[0].split("contains a constant of ").nth(1).unwrap();
        let value: f64 = value.split(' ').next().unwrap().parse().unwrap();
        assert!((value - constant).abs() < 0.1, "{found:?}");
        assert!(found[0].contains("so read, the largest error"), "{found:?}");
    }
    // what is a small part of the effort does not matter
    assert_eq!(doubts(|k| 0.2 + noise(k), 0.0, Method::Central), [""; 0]);
}

#[test]
fn motion_that_a_fourier_series_lacks_is_told_from_noise() {
    let series = Method::Fourier {
        frequency: 0.5,
        harmonics: 3,
    };
    assert_eq!(doubts(|_| 0.0, 0.0, series), [""; 0]);
    let found = doubts(|_| 0.0, 0.01, series);
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(found[0].contains("times the noise of `q1`"), "{found:?}");
}
