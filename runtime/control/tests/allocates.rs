//! A control cycle allocates nothing.

use regen_control::{Outcome, closure};
use regen_generated::rps3::{self, Rps3};

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
    // an allocation is counted
    let counted = allocation_counter::measure(|| drop(std::hint::black_box(vec![sum; 3])));
    assert_eq!(counted.count_total, 1);
}
