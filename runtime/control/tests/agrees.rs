//! The same states as `regen_runtime::LoopClosure`, on `f64` and on `f32`.

use regen_control::{Outcome, closure};
use regen_generated::{delta, fivebar, puma560, rps3};
use regen_runtime::{LoopClosure, Model};

/// Independent coordinates on a closed curve through home.
fn wave<const DOF: usize>(home: &[f64; DOF], size: f64, k: usize) -> [f64; DOF] {
    let phase = k as f64 * 0.02;
    core::array::from_fn(|i| home[i] + size * (phase * (1.0 + i as f64)).sin())
}

macro_rules! follows {
    ($module:ident, $model:ident, $size:expr) => {{
        use $module::$model;
        let mut in_f64 = <closure!($module::$model, f64)>::new(&$model).unwrap();
        let mut in_f32 = <closure!($module::$model, f32)>::new(&$model).unwrap();
        let model: &dyn Model<f64> = &$model;
        let mut allocating = LoopClosure::new(model).unwrap();
        let home = in_f64.q_i();
        let (mut worst, mut worst_single) = (0.0_f64, 0.0_f64);
        for k in 0..300 {
            let q_i = wave(&home, $size, k);
            let (qd_i, qdd_i) = (wave(&[0.0; _], 1.0, k + 40), wave(&[0.0; _], 1.0, k + 90));
            let narrow = |v: &[f64]| core::array::from_fn(|i| v[i] as f32);
            assert_eq!(in_f64.track(&q_i, 6), Outcome::Closed, "{k}");
            assert_eq!(in_f32.track(&narrow(&q_i), 6), Outcome::Closed, "{k}");
            let state = allocating.track_state(&q_i, &qd_i, &qdd_i).unwrap();
            assert!(state.outcome.is_closed());
            let motion = in_f64.motion(&qd_i, &qdd_i);
            let of_single = in_f32.motion(&narrow(&qd_i), &narrow(&qdd_i));
            for i in 0..home.len() {
                let pairs = [
                    (state.q[i], in_f64.q()[i], in_f32.q()[i]),
                    (state.qd[i], motion.qd[i], of_single.qd[i]),
                    (state.qdd[i], motion.qdd[i], of_single.qdd[i]),
                ];
                for (known, double, float) in pairs {
                    worst = worst.max((known - double).abs());
                    worst_single = worst_single.max((known - f64::from(float)).abs());
                }
            }
        }
        (worst, worst_single)
    }};
}

#[test]
fn states_are_those_of_the_closure_with_an_allocator() {
    for (name, (double, single)) in [
        ("3-RPS", follows!(rps3, Rps3, 0.05)),
        ("five-bar", follows!(fivebar, Fivebar, 0.3)),
        ("delta", follows!(delta, Delta, 0.2)),
        ("PUMA 560", follows!(puma560, Puma560, 0.5)),
    ] {
        println!("{name}: {double:e} on f64, {single:e} on f32");
        assert!(double < 1e-11, "{name}: {double:e}");
        assert!(single < 2e-3, "{name}: {single:e}");
    }
}

#[test]
fn a_bounded_call_continues_in_the_next_one() {
    let mut closure = <closure!(rps3::Rps3, f64)>::new(&rps3::Rps3).unwrap();
    let target = [0.50, 0.62, 0.70];
    let mut calls = 0;
    let mut reached = 0.0;
    while let outcome = closure.track(&target, 3)
        && outcome != Outcome::Closed
    {
        assert!(matches!(outcome, Outcome::Unfinished { .. }), "{outcome:?}");
        let mut f = [0.0; 6];
        rps3::Rps3.constraints(closure.q(), &mut f).unwrap();
        assert!(f.iter().all(|f: &f64| f.abs() < 1e-12), "{f:?}");
        let way = (closure.q_i()[0] - 0.6) / (target[0] - 0.6);
        assert!(way >= reached, "{way} after {reached}");
        reached = way;
        calls += 1;
        assert!(calls < 100, "{outcome:?}");
    }
    assert_eq!(closure.q_i(), target);
    closure.restart();
    assert_eq!(closure.q_i(), [0.6; 3]);
}
