//! Delay, gain and bias of signals.

use regen_response::{SignalKind, SignalModel, Value};

use crate::exact::{ARM, fitted, short};
use crate::models::arm::Arm;
use crate::twin::{Twin, off, worst};

#[test]
fn delay_gain_and_bias_of_a_signal_are_estimated_with_the_parameters() {
    let twin = Twin {
        duration: 1.2,
        ..short(Twin::new(&Arm, &ARM))
    };
    let truth = twin.beta();
    let mut run = twin.run();
    // the second joint's position is logged 3 ms late, 2 % too large, 5 mrad off
    let values = &run.positions[1].1;
    let step = run.times[1] - run.times[0];
    let slope = |k: usize| {
        let [a, b] = [k.saturating_sub(1), (k + 1).min(values.len() - 1)];
        (values[b] - values[a]) / ((b - a) as f64 * step)
    };
    let late = |k: usize| {
        let k0 = k.saturating_sub(1);
        let s = 1.0 - 0.003 / step;
        let (h00, h10) = ((1.0 + 2.0 * s) * (1.0 - s).powi(2), s * (1.0 - s).powi(2));
        let (h01, h11) = (s * s * (3.0 - 2.0 * s), s * s * (s - 1.0));
        h00 * values[k0] + h10 * step * slope(k0) + h01 * values[k] + h11 * step * slope(k)
    };
    let logged: Vec<f64> = (0..values.len()).map(|k| 1.02 * late(k) + 0.005).collect();
    run.positions[1].1 = logged;
    let mut setup = twin.setup();
    setup.window = 10.0;
    setup.greatest_delay = 0.01;
    setup.signals = vec![(
        SignalKind::Position(1),
        SignalModel {
            delay: Value::estimated(0.0),
            gain: Value::estimated(1.0),
            bias: Value::estimated(0.0),
        },
    )];
    let (found, _) = fitted(&Arm, &[run], &setup, &off(&truth, 0.05));
    let value = |label: &str| {
        let own = found.estimated.iter().find(|e| e.label == label);
        own.unwrap().value
    };
    assert!(
        (value("delay(q2)") - 0.003).abs() < 1e-4,
        "{:?}",
        found.estimated
    );
    assert!(
        (value("gain(q2)") - 1.02).abs() < 2e-3,
        "{:?}",
        found.estimated
    );
    assert!(
        (value("bias(q2)") - 0.005).abs() < 1e-3,
        "{:?}",
        found.estimated
    );
    assert!(
        worst(&found.model.beta, &truth) < 0.05,
        "{:?} {truth:?}",
        found.model.beta
    );
}

#[test]
fn the_gain_of_a_late_command_is_estimated() {
    let twin = short(Twin::new(&Arm, &ARM));
    let truth = twin.beta();
    let mut run = twin.run();
    // the log has commands one row before they take effect, in units that are 3 % larger
    for command in &mut run.commands {
        let later: Vec<f64> = command.iter().skip(1).map(|x| x / 1.03).collect();
        *command = later;
    }
    let rows = run.commands[0].len();
    run.times.truncate(rows);
    for (_, values) in &mut run.positions {
        values.truncate(rows);
    }
    let mut setup = twin.setup();
    for joint in 0..2 {
        setup.signals.push((
            SignalKind::Command(joint),
            SignalModel {
                delay: Value::known(0.005),
                gain: Value::estimated(1.0),
                ..SignalModel::default()
            },
        ));
    }
    let (found, _) = fitted(&Arm, &[run], &setup, &off(&truth, 0.02));
    for estimated in &found.estimated {
        // the first row's command is not in the log
        let sigma = estimated.interval.unwrap().sigma;
        assert!(
            (estimated.value - 1.03).abs() < 3.0 * sigma,
            "{estimated:?}"
        );
        assert!(sigma < 0.02, "{estimated:?}");
    }
}
