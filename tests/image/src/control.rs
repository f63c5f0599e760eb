//! What a controller calls in its cycle: the closure in arrays of fixed size, the estimators, the
//! observer and the laws of adaptation, for a mechanism of six efforts and for one of two.

use regen_control::{
    Closure, Collision, Estimator, GradientLaw, Load, Motion, NaturalLaw, Observer, Outcome,
    Payload, Physical, Projected, Sample, SettingError, Settings,
};
use regen_runtime::{Model, Parameter};

/// See [`Closure::track`].
pub fn track(
    closure: &mut Closure<'_, f64, 9, 3, 6, 6, dyn Model>,
    q_i: &[f64; 3],
    steps: usize,
) -> Outcome<f64> {
    closure.track(q_i, steps)
}

/// See [`Closure::motion`].
pub fn motion(
    closure: &Closure<'_, f64, 9, 3, 6, 6, dyn Model>,
    qd_i: &[f64; 3],
    qdd_i: &[f64; 3],
) -> Motion<f64, 9> {
    closure.motion(qd_i, qdd_i)
}

/// See [`Estimator::new`] and [`Estimator::with_prior`].
///
/// # Errors
/// When a setting is refused.
pub fn estimator(
    settings: &Settings,
    deviations: &[f64; 6],
    prior: (&[f64; 36], &[f64; 36]),
) -> Result<Estimator<f64, 6, 36>, SettingError> {
    Estimator::new(settings, deviations)?.with_prior(prior.0, prior.1)
}

/// See [`Estimator::update`].
pub fn estimate(
    estimator: &mut Estimator<f64, 6, 36>,
    momentum: &[[f64; 6]; 36],
    rate: &[[f64; 6]; 36],
    effort: &[f64; 6],
) -> Sample {
    estimator.update(momentum, rate, effort)
}

/// See [`Estimator::values`] and [`Estimator::deviations`].
pub fn estimated(estimator: &Estimator<f64, 6, 36>) -> (Option<[f64; 36]>, [f64; 36]) {
    (estimator.values(), estimator.deviations())
}

/// See [`Estimator::update`], on `f32`.
pub fn estimate_single(
    estimator: &mut Estimator<f32, 2, 11>,
    momentum: &[[f32; 2]; 11],
    rate: &[[f32; 2]; 11],
    effort: &[f32; 2],
) -> Sample {
    estimator.update(momentum, rate, effort)
}

/// See [`Physical::new`] and [`Physical::closest`].
///
/// # Errors
/// When the parameters or the start are refused.
pub fn closest(
    parameters: &[Parameter<'_>; 24],
    equations: (&[[f64; 24]; 24], &[f64; 24]),
    start: &[f64; 24],
    steps: usize,
) -> Result<Projected<f64, 24>, SettingError> {
    Physical::<24, 2>::new(parameters)?.closest(equations, start, steps, 1e-3)
}

/// See [`Payload::new`].
///
/// # Errors
/// When a setting is refused.
pub fn payload(
    settings: &Settings,
    deviations: &[f64; 6],
) -> Result<Payload<f32, 6>, SettingError> {
    Payload::new(settings, deviations, 10.0, 0.3)
}

/// See [`Payload::update`].
pub fn carry(
    payload: &mut Payload<f32, 6>,
    robot: (&[f32; 6], &[f32; 6]),
    columns: (&[[f32; 6]; 10], &[[f32; 6]; 10]),
    effort: &[f32; 6],
) -> Sample {
    payload.update(robot, columns, effort)
}

/// See [`Payload::load`] and [`Payload::physical`].
///
/// # Errors
/// Never, as the tolerance is positive.
pub fn carried(
    payload: &Payload<f32, 6>,
    steps: usize,
) -> Result<(Option<Load<f32>>, Projected<f32, 10>), SettingError> {
    Ok((payload.load(), payload.physical(steps, 1e-2)?))
}

/// See [`Observer::update`] and [`Collision::contact`].
pub fn observe(
    observer: &mut Observer<f32, 6>,
    detector: &mut Collision<f32, 6>,
    momentum: &[f32; 6],
    rate: &[f32; 6],
    effort: &[f32; 6],
) -> (Sample, Option<usize>) {
    let sample = observer.update(momentum, rate, effort);
    let force = observer.force();
    let contact = detector.contact(&force);
    detector.learn(&force);
    (sample, contact)
}

/// See [`GradientLaw::update`].
pub fn follow(
    law: &mut GradientLaw<f64, 24>,
    y: &[[f64; 2]; 24],
    s: &[f64; 2],
    period: f64,
) -> Sample {
    law.update(y, s, period)
}

/// See [`NaturalLaw::update`].
pub fn follow_naturally(
    law: &mut NaturalLaw<f32, 24, 2>,
    y: &[[f32; 2]; 24],
    s: &[f32; 2],
    period: f32,
) -> Sample {
    law.update(y, s, period)
}
