//! The simulated robot: energy, constraints, control, friction, and reported terminations.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use regen_experiment::simulate::{
    Drive, Noise, Pid, Sensors, Settings, Termination, nominal_friction, perturb_parameters,
    simulate,
};
use regen_generated::{fivebar, puma560, rps3, rps3_friction};
use regen_runtime::{Friction, Info, JointFriction, Model};

fn nominal(info: &Info<'_>) -> Vec<f64> {
    info.nominal_parameters().expect("nominal values")
}

/// A motion around home in which each independent coordinate swings by `size` at its own
/// frequencies.
fn swing(info: &Info<'_>, size: f64) -> impl Fn(f64, &mut [f64], &mut [f64], &mut [f64]) + use<> {
    let home: Vec<f64> = info.independent.iter().map(|c| info.home[*c]).collect();
    move |t, q, qd, qdd| {
        for (k, home) in home.iter().enumerate() {
            let w = 2.0 + 0.7 * k as f64;
            q[k] = home + size * (w * t).sin();
            qd[k] = size * w * (w * t).cos();
            qdd[k] = -size * w * w * (w * t).sin();
        }
    }
}

fn pid(info: &Info<'_>, kp: f64, ki: f64, kd: f64) -> Vec<Pid> {
    vec![
        Pid {
            kp,
            ki,
            kd,
            ..Pid::default()
        };
        info.actuated.len()
    ]
}

#[test]
fn a_minute_of_a_controlled_platform_keeps_loops_closed_and_energy_balanced() {
    let model = rps3::Rps3;
    let info = Model::<f64>::info(&model);
    let phi = nominal(&info);
    let settings = Settings {
        duration: 60.0,
        pid: pid(&info, 8_000.0, 4_000.0, 300.0),
        ..Settings::default()
    };
    let log = simulate(&model, &phi, &swing(&info, 0.05), &settings).unwrap();
    assert_eq!(log.ended, Termination::Complete);
    assert_eq!(log.t.len(), 6001);
    assert!(log.residual < 1e-9, "drift {:e} m", log.residual);
    let size = log.energy.iter().map(|e| e.work.abs().max(e.kinetic));
    let size = size.fold(0.0, f64::max);
    println!(
        "drift {:e} m, imbalance {:e} J of {size} J, {} steps",
        log.residual, log.imbalance, log.steps
    );
    assert!(log.imbalance < 1e-6, "imbalance {:e} J", log.imbalance);
    // the leg moved over most of the reference's range of 0.1 m
    let legs: Vec<f64> = log.q.chunks(9).map(|q| q[1]).collect();
    let (lo, hi) = legs
        .iter()
        .fold((9.0_f64, 0.0_f64), |(lo, hi), x| (lo.min(*x), hi.max(*x)));
    assert!(hi - lo > 0.08, "{lo} {hi}");
}

#[test]
fn the_logged_motion_satisfies_inverse_dynamics() {
    let model = rps3_friction::Rps3Friction;
    let info = Model::<f64>::info(&model);
    let phi = nominal(&info);
    let friction = nominal_friction(&info).unwrap();
    let settings = Settings {
        pid: pid(&info, 40_000.0, 0.0, 1_500.0),
        friction,
        friction_width: 1e-4,
        ..Settings::default()
    };
    let log = simulate(&model, &phi, &swing(&info, 0.05), &settings).unwrap();
    assert_eq!(log.ended, Termination::Complete);
    let mut compared = 0;
    for (k, q) in log.q.chunks(9).enumerate() {
        let (qd, qdd) = (&log.qd[9 * k..9 * k + 9], &log.qdd[9 * k..9 * k + 9]);
        // The model's sign function and the simulation's smooth one agree only for moving joints.
        if info.actuated.iter().any(|j| qd[*j].abs() < 2e-3) {
            continue;
        }
        compared += 1;
        let mut tau = [0.0; 3];
        let _ = model.inverse_dynamics(q, qd, qdd, &phi, &mut tau).unwrap();
        for (ours, applied) in tau.iter().zip(&log.effort[3 * k..3 * k + 3]) {
            assert!((ours - applied).abs() < 1e-6, "{ours} {applied}");
        }
    }
    assert!(compared > 50, "{compared}");
}

#[test]
fn friction_never_adds_energy() {
    let model = fivebar::Fivebar;
    let info = Model::<f64>::info(&model);
    let phi = nominal(&info);
    let law = JointFriction {
        law: Friction::Stribeck,
        values: [0.5, 0.9, 0.1, 2.0, 1.0],
    };
    let settings = Settings {
        duration: 3.0,
        friction: vec![law; info.coordinates.len()],
        ..Settings::default()
    };
    let log = simulate(&model, &phi, &swing(&info, 0.0), &settings).unwrap();
    assert_eq!(log.ended, Termination::Complete);
    for pair in log.energy.windows(2) {
        assert!(pair[1].loss >= pair[0].loss);
    }
    let (first, last) = (log.energy.first().unwrap(), log.energy.last().unwrap());
    assert!(last.loss > 0.0);
    assert!(last.kinetic + last.potential < first.kinetic + first.potential);
    assert!(log.imbalance < 1e-6, "{:e}", log.imbalance);
}

#[test]
fn sensors_round_and_add_noise_and_equal_seeds_give_equal_logs() {
    let model = rps3::Rps3;
    let info = Model::<f64>::info(&model);
    let phi = nominal(&info);
    let settings = Settings {
        duration: 0.5,
        pid: pid(&info, 40_000.0, 20_000.0, 1_500.0),
        drives: vec![
            Drive {
                lag: 0.005,
                limit: Some([-500.0, 500.0])
            };
            3
        ],
        sensors: Sensors {
            position_step: 1e-5,
            position_noise: 2e-5,
            effort_step: 0.0,
            effort_noise: 1.0,
        },
        seed: 5,
        ..Settings::default()
    };
    let run = |settings: &Settings| simulate(&model, &phi, &swing(&info, 0.02), settings).unwrap();
    let log = run(&settings);
    assert_eq!(log, run(&settings));
    let other = Settings {
        seed: 6,
        ..settings.clone()
    };
    assert_ne!(log.measured_position, run(&other).measured_position);
    for x in &log.measured_position {
        let steps = x / 1e-5;
        assert!((steps - steps.round()).abs() < 1e-6);
    }
    assert!(log.effort.iter().all(|e| e.abs() <= 500.0));
    let noise = log.measured_effort.iter().zip(&log.effort);
    let variance = noise.map(|(m, e)| (m - e).powi(2)).sum::<f64>() / log.effort.len() as f64;
    // 153 draws of variance 1: four standard deviations of their mean square
    assert!(
        (variance - 1.0).abs() < 4.0 * (2.0_f64 / 153.0).sqrt(),
        "{variance}"
    );
}

#[test]
fn a_five_bar_pushed_out_of_its_workspace_ends_the_simulation() {
    let model = fivebar::Fivebar;
    let info = Model::<f64>::info(&model);
    let phi = nominal(&info);
    // pushed hard, it leaves its workspace
    let push = |_: f64, q: &mut [f64], qd: &mut [f64], _: &mut [f64]| {
        for (k, c) in info.independent.iter().enumerate() {
            q[k] = info.home[*c];
            qd[k] = if k == 0 { 15.0 } else { -15.0 };
        }
    };
    let settings = Settings {
        duration: 5.0,
        ..Settings::default()
    };
    let log = simulate(&model, &phi, &push, &settings).unwrap();
    assert!(matches!(log.ended, Termination::Open(_)), "{:?}", log.ended);
    assert!(log.residual < 1e-9);
    assert!(log.q.iter().all(|x| x.is_finite()));
}

#[test]
fn an_unstable_loop_ends_soon_after_its_joints_have_left_the_reference() {
    let model = puma560::Puma560;
    let info = Model::<f64>::info(&model);
    let settings = Settings {
        duration: 10.0,
        // much too stiff for the wrist at 100 samples a second
        pid: pid(&info, 1e4, 0.0, 2e2),
        ..Settings::default()
    };
    let log = simulate(&model, &nominal(&info), &swing(&info, 0.3), &settings).unwrap();
    assert_eq!(log.ended, Termination::Diverged);
    assert!(
        log.t.len() < 1000 && log.steps < 20_000,
        "{} {}",
        log.t.len(),
        log.steps
    );
}

#[test]
fn a_perturbation_scales_each_body_as_a_whole() {
    let info = Model::<f64>::info(&rps3_friction::Rps3Friction);
    let phi = nominal(&info);
    let changed = perturb_parameters(&info, &phi, 0.2, &mut Noise::new(3));
    for (body, (old, new)) in phi.chunks(10).zip(changed.chunks(10)).take(7).enumerate() {
        let factor = new[9] / old[9];
        assert!(
            (factor - 1.0).abs() <= 0.2 && (factor - 1.0).abs() > 1e-6,
            "{body}"
        );
        for (a, b) in old.iter().zip(new) {
            assert!((a * factor - b).abs() <= 1e-14 * a.abs(), "{body}");
        }
    }
}

#[test]
fn misuse_is_an_error_that_names_what_is_wrong() {
    let model = rps3::Rps3;
    let info = Model::<f64>::info(&model);
    let phi = nominal(&info);
    let fails = |phi: &[f64], settings: Settings| {
        simulate(&model, phi, &swing(&info, 0.0), &settings)
            .unwrap_err()
            .to_string()
    };
    assert!(fails(&phi[1..], Settings::default()).contains("`phi` has 69 entries"));
    let zero = Settings {
        period: 0.0,
        ..Settings::default()
    };
    assert!(fails(&phi, zero).contains("`period`"));
    let one = Settings {
        pid: vec![Pid::default()],
        ..Settings::default()
    };
    assert!(fails(&phi, one).contains("`pid` has 1 entries"));
}
