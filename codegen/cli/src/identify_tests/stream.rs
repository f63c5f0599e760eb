//! Tests of filters over efforts and regressor, of delays and of joints at rest, on an arm with one
//! joint.

use std::fmt::Write as _;

use regen_identify::data::{Logs, Settings};
use regen_identify::identify::{EquationKind, Identified, NoColumns, Options, equations, identify};
use regen_identify::signals::{Method, Smoothing};
use regen_identify::states::{Filtering, Recorded, Standstill, StateSample};

use super::scratch;
use crate::load;
use regen_interpreted::{BaseTerms, Interpreted};

const ARM: &str = "\
name: arm
gravity: [0, -9.81, 0]
limbs:
  - name: arm
    joints:
      - {name: q1, type: revolute, body: 1, actuated: true, friction: linear}
";
/// `Izz mx my Fv Fc`, the arm's base parameters.
const TRUTH: [f64; 5] = [0.5, 2.0, 0.3, 0.8, 1.5];

/// Position, velocity and acceleration of the arm at a time.
type Motion = dyn Fn(f64) -> [f64; 3];

fn effort([q, qd, qdd]: [f64; 3]) -> f64 {
    let sign = if qd == 0.0 { 0.0 } else { qd.signum() };
    let weight = 9.81 * (TRUTH[1] * q.cos() - TRUTH[2] * q.sin());
    TRUTH[0] * qdd + weight + TRUTH[3] * qd + TRUTH[4] * sign
}

/// Two harmonics without a common period within the log.
fn swing(t: f64) -> [f64; 3] {
    let mut out = [0.3, 0.0, 0.0];
    for (size, w) in [(0.8, 2.1), (0.4, 5.3)] {
        let (sin, cos) = (w * t).sin_cos();
        out[0] += size * sin;
        out[1] += size * w * cos;
        out[2] -= size * w * w * sin;
    }
    out
}

fn with_arm(each: impl FnOnce(&Interpreted<'_>)) {
    let path = scratch("stream.yaml", ARM);
    let robot = load::robot(&path).unwrap();
    let terms = BaseTerms::new(&robot);
    each(&Interpreted::with_terms(&robot, &terms));
}

fn recorded(motion: &Motion, step: f64, rows: usize) -> Recorded {
    let mut log = Recorded::new();
    for k in 0..rows {
        let t = k as f64 * step;
        let state @ [q, qd, qdd] = motion(t);
        log.push(t, &[q], &[qd], &[qdd], &[effort(state)]);
    }
    log
}

fn error(found: &Identified) -> f64 {
    assert_eq!(
        found.estimate.labels,
        ["Izz(1)", "mx(1)", "my(1)", "Fv(q1)", "Fc(q1)"]
    );
    let pairs = found.estimate.values.iter().zip(TRUTH);
    pairs.fold(0.0, |m: f64, (x, truth)| m.max((x - truth).abs()))
}

#[test]
fn a_filter_over_efforts_and_regressor_does_not_change_the_parameters() {
    with_arm(|model| {
        for smoothing in [
            Smoothing::Butterworth {
                order: 4,
                cutoff: 2.0,
            },
            Smoothing::Local { half_width: 0.1 },
        ] {
            // a cutoff far below the spectrum of the velocity's sign, and more rows than one block
            let mut log = recorded(&swing, 0.005, 6000).filtered(Filtering {
                smoothing,
                decimation: 7,
                standstill: Standstill::Keep,
            });
            let found =
                identify(model, EquationKind::Forces, &Options::default(), &mut log).unwrap();
            // the filter's initial state decays to 1e-16 between blocks, but only to 1e-3 at the
            // ends of the log
            assert!(error(&found) < 1e-3, "{smoothing:?} {:?}", found.estimate);
            let samples = found.left_out.samples;
            // the low-pass filter gets averages of 2 equations, and every fourth result is used
            assert!(samples > 600 && samples < 6000 / 7, "{samples}");
        }
    });
}

#[test]
fn a_fast_log_is_averaged_before_its_filter_without_bias() {
    with_arm(|model| {
        let mut log = recorded(&swing, 0.0002, 60_000).filtered(Filtering {
            smoothing: Smoothing::Butterworth {
                order: 4,
                cutoff: 2.0,
            },
            decimation: 1,
            standstill: Standstill::Keep,
        });
        let found = identify(model, EquationKind::Forces, &Options::default(), &mut log).unwrap();
        assert!(error(&found) < 1e-3, "{:?}", found.estimate);
        // the rate may fall to 50 times the cutoff, from 5000 Hz to 100 Hz: the largest power of 2
        // within that factor is 32
        let left_out = found.left_out;
        assert_eq!(32 * left_out.samples + left_out.unsettled, 60_000);
        assert!(left_out.samples > 1200, "{left_out:?}");
    });
}

#[test]
fn a_long_log_filtered_in_blocks_equals_the_log_filtered_as_a_whole() {
    with_arm(|model| {
        let smoothing = Smoothing::Butterworth {
            order: 5,
            cutoff: 6.0,
        };
        let filtering = Filtering {
            smoothing,
            ..Filtering::default()
        };
        let rows = 5000;
        let mut log = recorded(&swing, 0.01, rows).filtered(filtering);
        let mut whole: Vec<f64> = (0..rows).map(|k| effort(swing(k as f64 * 0.01))).collect();
        let times: Vec<f64> = (0..rows).map(|k| k as f64 * 0.01).collect();
        smoothing.apply(&times, &mut whole, 1).unwrap();
        let mut count = 0;
        equations(
            model,
            EquationKind::Forces,
            &mut log,
            &mut NoColumns,
            &mut |found| {
                #[allow(clippy::cast_sign_loss)]
                let k = (found.time / 0.01).round() as usize;
                // efforts are some 30 N m; the error is the remaining 1e-16 of the filter's
                // initial state, and rounding
                assert!((found.tau[0] - whole[k]).abs() < 1e-10, "{k}");
                count += 1;
                Ok(())
            },
        )
        .unwrap();
        assert!(count > 4700, "{count}");
    });
}

#[test]
fn an_effort_that_is_logged_late_is_found_and_corrected() {
    with_arm(|model| {
        let (step, late) = (0.004, 0.0137);
        let mut text = "t,q1,tau_q1\n".to_owned();
        let mut noise = regen_reference::Random::new(3);
        for k in 0..4000 {
            let t = f64::from(k) * step;
            let tau = effort(swing(t - late)) + 0.02 * noise.signed();
            let _ = writeln!(text, "{t},{},{tau}", swing(t)[0]);
        }
        let path = scratch("late.csv", &text);
        let fit = |delay: f64| {
            let settings = Settings {
                method: Method::Butterworth {
                    order: 4,
                    cutoff: 10.0,
                },
                delays: vec![("q1".to_owned(), delay)],
                ..Settings::default()
            };
            let mut logs = Logs::open(model, std::slice::from_ref(&path), &settings).unwrap();
            identify(model, EquationKind::Forces, &Options::default(), &mut logs).unwrap()
        };
        let before = fit(0.0);
        let delay = &before.delays.efforts[0];
        assert!(delay.is_significant(), "{delay:?}");
        // the estimate is of first order: a second one finds the rest
        assert!((delay.seconds / late - 1.0).abs() < 0.2, "{delay:?}");
        let once = delay.seconds;
        let again = fit(once).delays.efforts[0].seconds + once;
        assert!((again / late - 1.0).abs() < 0.02, "{again}");
        let after = fit(late);
        assert!(
            !after.delays.efforts[0].is_significant(),
            "{:?}",
            after.delays
        );
        assert!(error(&after) < 0.1 * error(&before), "{}", error(&after));
    });
}

/// Swings of three seconds, separated by rests of a second.
fn swings_and_rests(t: f64) -> [f64; 3] {
    let phase = t.rem_euclid(4.0);
    if phase >= 3.0 {
        return [0.3, 0.0, 0.0];
    }
    let w = std::f64::consts::TAU / 3.0;
    let turn = (t / 4.0).floor();
    let size = 0.5 + 0.2 * turn.rem_euclid(3.0);
    let (sin, cos) = (w * phase).sin_cos();
    // each swing starts and ends at rest
    [0.3 + size * (1.0 - cos), size * w * sin, size * w * w * cos]
}

/// Writes a log of these swings; at rest, static friction balances an arbitrary effort of the drive.
fn log_with_rests(name: &str) -> std::path::PathBuf {
    let mut text = "t,q1,tau_q1\n".to_owned();
    for k in 0..8000 {
        let t = f64::from(k) * 0.005;
        let state = swings_and_rests(t);
        let static_friction = if state[1] == 0.0 { 1.2 } else { 0.0 };
        let _ = writeln!(text, "{t},{},{}", state[0], effort(state) + static_friction);
    }
    scratch(name, &text)
}

#[test]
fn samples_of_a_joint_at_rest_are_left_out() {
    with_arm(|model| {
        let path = log_with_rests("rests.csv");
        let fit = |standstill| {
            let settings = Settings {
                method: Method::Butterworth {
                    order: 4,
                    cutoff: 15.0,
                },
                standstill,
                ..Settings::default()
            };
            let mut logs = Logs::open(model, std::slice::from_ref(&path), &settings).unwrap();
            identify(model, EquationKind::Forces, &Options::default(), &mut logs).unwrap()
        };
        let (drop, keep) = (fit(Standstill::Drop), fit(Standstill::Keep));
        let share = drop.left_out.resting[0] as f64 / drop.left_out.samples as f64;
        assert!((0.2..0.35).contains(&share), "{share}");
        assert_eq!(keep.left_out.resting, [0]);
        // accelerations jump where the joint starts and stops, and the filter smears the jumps
        assert!(error(&drop) < 0.05, "{:?}", drop.estimate.values);
        assert!(
            error(&keep) > 3.0 * error(&drop),
            "{:?}",
            keep.estimate.values
        );
    });
}

/// Rests of 0.15 s every second, in which the drive's effort is balanced by static friction alone: a
/// filter with a memory as long spreads it over the equations beside.
#[test]
fn no_equation_that_is_used_has_a_thirtieth_of_a_static_friction_in_it() {
    with_arm(|model| {
        const STATIC: f64 = 1.2;
        let mut log = Recorded::new().filtered(Filtering {
            smoothing: Smoothing::Butterworth {
                order: 5,
                cutoff: 7.0,
            },
            ..Filtering::default()
        });
        for k in 0..2000_u32 {
            let rests = k % 100 < 15;
            log.push_row(&StateSample {
                time: 0.01 * f64::from(k),
                q: &[0.0],
                qd: &[1.0],
                qdd: &[0.0],
                tau: &[if rests { STATIC } else { 0.0 }],
                efforts: &[],
                held: &[],
                at_standstill: &[rests],
                weights: &[1.0],
                follows: k > 0,
                bridged: false,
            });
        }
        let (mut used, mut largest) = (0, 0.0_f64);
        equations(
            model,
            EquationKind::Forces,
            &mut log,
            &mut NoColumns,
            &mut |found| {
                if found.weights[0] > 0.0 {
                    used += 1;
                    largest = largest.max(found.tau[0].abs());
                }
                Ok(())
            },
        )
        .unwrap();
        assert!(largest < STATIC / 30.0, "{largest}");
        // 0.85 of each second is motion
        assert!(used > 1000, "{used}");
    });
}

/// Where a filter of a low cutoff spreads rests over all equations, another cutoff is the remedy and not
/// more of the same motion.
#[test]
fn a_log_whose_rests_take_every_equation_says_so() {
    with_arm(|model| {
        let path = log_with_rests("slow_filter.csv");
        let settings = Settings {
            method: Method::Butterworth {
                order: 4,
                cutoff: 0.5,
            },
            ..Settings::default()
        };
        let mut logs = Logs::open(model, std::slice::from_ref(&path), &settings).unwrap();
        let found = identify(model, EquationKind::Forces, &Options::default(), &mut logs);
        let why = found.unwrap_err().to_string();
        assert!(why.contains("joints rest there"), "{why}");
        assert!(why.contains("a higher cutoff"), "{why}");
    });
}
