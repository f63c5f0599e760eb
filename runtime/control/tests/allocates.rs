//! A control cycle allocates nothing.

use regen_control::{
    Collision, Estimator, Forgetting, NaturalLaw, Observer, Outcome, Payload, Settings, closure,
};
use regen_generated::rps3::{self, Rps3};
use regen_runtime::{Parameter, Symbol};

#[test]
fn a_cycle_allocates_nothing() {
    let phi = [1.0; rps3::PARAMETERS.len()];
    let mut sum = 0.0;
    let counted = allocation_counter::measure(|| {
        let mut closure = <closure!(rps3::Rps3, f64)>::new(&Rps3).unwrap();
        for k in 0..50 {
            let q_i = [0.6, 0.6 + 1e-3 * f64::from(k), 0.58];
            assert_eq!(closure.track(&q_i, 5), Outcome::Closed);
            let motion = closure.motion(&[0.1, 0.0, -0.1], &[0.0; 3]);
            let (tau, _) = rps3::inverse_dynamics(closure.q(), &motion.qd, &motion.qdd, &phi);
            sum += tau[0];
        }
    });
    assert!(f64::is_finite(sum));
    assert_eq!(counted.count_total, 0);
    let counted = allocation_counter::measure(|| sum += estimates().unwrap());
    assert!(f64::is_finite(sum));
    assert_eq!(counted.count_total, 0);
    // an allocation is counted
    let counted = allocation_counter::measure(|| drop(std::hint::black_box(vec![sum; 3])));
    assert_eq!(counted.count_total, 1);
}

/// All that estimates and observes, for some cycles.
fn estimates() -> Result<f64, regen_control::SettingError> {
    let settings = Settings {
        forgetting: Forgetting::Directional(1.0),
        ..Settings::new(1e-3)
    };
    let mut estimator = Estimator::<f64, 2, 3>::new(&settings, &[1.0; 2])?;
    let mut payload = Payload::<f64, 2>::new(&settings, &[1.0; 2], 10.0, 0.3)?;
    let mut observer = Observer::<f64, 2>::new(50.0, 1e-3)?;
    let mut detector = Collision::<f64, 2>::new(0.01, 1000)?;
    let parameters = Symbol::INERTIAL.map(|symbol| Parameter::new(symbol, "1"));
    let ball = [0.1, 0.0, 0.0, 0.1, 0.0, 0.1, 0.0, 0.0, 0.0, 2.0];
    let mut law = NaturalLaw::<f64, 10, 1>::new(&parameters, &ball, 1.0, 0.0)?;
    let mut sum = 0.0;
    for k in 0..50 {
        let x = f64::from(k).sin();
        let effort = [x, 1.0];
        let _ = estimator.update(&[[x, 1.0], [1.0, x], [0.5, 0.1]], &[[1.0, x]; 3], &effort);
        let columns = [[x, 0.3]; 10];
        let _ = payload.update((&effort, &effort), (&columns, &columns), &effort);
        let _ = observer.update(&effort, &effort, &effort);
        detector.learn(&observer.force());
        let _ = law.update(&columns, &effort, 1e-3);
        sum += observer.force()[0] + law.values()[9];
    }
    sum += estimator.values().map_or(0.0, |values| values[0]);
    Ok(sum + payload.physical(30, 1e-3)?.values[9])
}
