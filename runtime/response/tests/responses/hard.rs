//! Cases in which a fit may fail or be wrong: candidates that cannot be simulated, windows of
//! several lengths, directions without information, work repeated for every window.

use std::sync::atomic::{AtomicUsize, Ordering};

use regen_response::{ResponseError, Value, fit_responses};
use regen_runtime::{
    Arguments, BaseFunction, BaseInfo, BaseModel, Condition, Function, Info, Model, SizeError,
};

use crate::exact::{ARM, FIVE, fitted, short};
use crate::models::arm::Arm;
use crate::models::picker::Picker;
use crate::twin::{Twin, off, worst};

#[test]
fn a_candidate_that_cannot_be_simulated_shortens_the_step() {
    let twin = short(Twin::new(&Arm, &ARM));
    let truth = twin.beta();
    let mut start = truth.clone();
    // an arm five times as heavy: full steps from there lead to robots that cannot be simulated
    start[0] *= 5.0;
    let (found, _) = fitted(&Arm, &[twin.run()], &twin.setup(), &start);
    assert!(found.refused > 0, "{found:?}");
    assert!(
        worst(&found.model.beta, &truth) < 1e-3,
        "{:?}",
        found.model.beta
    );
}

#[test]
fn a_start_that_cannot_be_simulated_is_refused_with_its_reason() {
    let twin = short(Twin::new(&Arm, &ARM));
    let mut start = twin.beta();
    start[0] = -1.0;
    let found = fit_responses(
        &Arm,
        &Arm,
        &[twin.run()],
        &twin.setup(),
        &start,
        0.95,
        &mut |_, _| {},
    );
    assert!(
        matches!(found, Err(ResponseError::Start { .. })),
        "{found:?}"
    );
}

#[test]
fn windows_of_any_lengths_give_the_same_parameters() {
    let long = short(Twin::new(&Arm, &ARM));
    let other = Twin {
        duration: 0.53,
        swing: 0.2,
        ..short(Twin::new(&Arm, &ARM))
    };
    let truth = long.beta();
    let runs = [long.run(), other.run()];
    for window in [0.21, 0.4, 10.0] {
        let mut setup = long.setup();
        setup.window = window;
        let (found, _) = fitted(&Arm, &runs, &setup, &off(&truth, 0.05));
        assert!(
            worst(&found.model.beta, &truth) < 1e-3,
            "{window} {:?}",
            found.model.beta
        );
    }
}

#[test]
fn unknown_gains_have_an_undetermined_common_scale_that_is_named_and_no_variance_is_negative() {
    let twin = Twin {
        noise: [1e-5, 0.0],
        ..short(Twin::new(&Arm, &ARM))
    };
    let truth = twin.beta();
    let mut setup = twin.setup();
    for law in &mut setup.laws {
        law.kp = Value::estimated(1.05 * law.kp.value);
        law.kd = Value::estimated(0.95 * law.kd.value);
    }
    let (found, _) = fitted(&Arm, &[twin.run()], &setup, &off(&truth, 0.05));
    let words: Vec<String> = found.undetermined.iter().map(ToString::to_string).collect();
    assert_eq!(words.len(), 1, "{words:?}");
    assert!(
        words[0].starts_with("the common scale of Izz(1)"),
        "{words:?}"
    );
    assert!(
        words[0].contains("kp(q1)") && words[0].contains("kd(q2)"),
        "{words:?}"
    );
    // parameters that are not determined have no interval
    assert!(found.model.intervals.base[0].is_none());
    assert!(found.estimated.iter().all(|e| e.interval.is_none()));
    for k in 0..found.deviations.degrees_of_freedom.len() {
        assert!(found.deviations.sigma(k) >= 0.0, "{k}");
    }
    // the ratios of the parameters are determined
    let scale = found.model.beta[0] / truth[0];
    let scaled: Vec<f64> = truth.iter().map(|x| x * scale).collect();
    assert!(
        worst(&found.model.beta, &scaled) < 0.05,
        "{:?} {scaled:?}",
        found.model.beta
    );

    // one known gain fixes the scale
    setup.laws[0].kp = Value::known(ARM[0][0]);
    let (found, _) = fitted(&Arm, &[twin.run()], &setup, &off(&truth, 0.05));
    assert!(found.undetermined.is_empty(), "{:?}", found.undetermined);
    let all = found
        .model
        .intervals
        .base
        .iter()
        .zip(&found.model.beta)
        .zip(&truth);
    for ((interval, value), truth) in all {
        let sigma = interval.unwrap().sigma;
        assert!(
            (value - truth).abs() < 5.0 * sigma,
            "{value} {truth} {sigma}"
        );
    }
}

/// A model that counts its evaluations.
struct Counting<'m, M>(&'m M, AtomicUsize);

impl<M: Model<f64>> Model<f64> for Counting<'_, M> {
    fn info(&self) -> Info<'_> {
        self.0.info()
    }

    fn eval(
        &self,
        function: Function,
        arguments: Arguments<'_, f64>,
        out: &mut [f64],
    ) -> Result<Condition<f64>, SizeError> {
        self.1.fetch_add(1, Ordering::Relaxed);
        self.0.eval(function, arguments, out)
    }
}

impl<M: BaseModel<f64>> BaseModel<f64> for Counting<'_, M> {
    fn base_info(&self) -> BaseInfo<'_> {
        self.0.base_info()
    }

    fn eval_base(
        &self,
        function: BaseFunction,
        arguments: Arguments<'_, f64>,
        out: &mut [f64],
    ) -> Result<Condition<f64>, SizeError> {
        self.1.fetch_add(1, Ordering::Relaxed);
        self.0.eval_base(function, arguments, out)
    }
}

#[test]
fn ten_windows_cost_as_much_as_one() {
    let twin = short(Twin::new(&Picker, &FIVE));
    let (truth, run) = (twin.beta(), twin.run());
    let count = |window: f64| {
        let mut setup = twin.setup();
        setup.window = window;
        setup.steps = 1;
        let model = Counting(&Picker, AtomicUsize::new(0));
        let runs = [run.clone()];
        let _found = fit_responses(&model, &Picker, &runs, &setup, &truth, 0.95, &mut |_, _| {});
        model.1.load(Ordering::Relaxed) as f64
    };
    let ratio = count(0.08) / count(10.0);
    // the only repeated work is that every window closes the loops once from home
    assert!(ratio < 1.1, "{ratio}");
}
