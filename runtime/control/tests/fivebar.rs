//! Adaptive control of a robot with loops by its generated regressor.

use regen_control::{Closure, GradientLaw, NaturalLaw, Physical, Sample, closure};
use regen_generated::fivebar::{self, Fivebar, PARAMETERS};

const P: usize = PARAMETERS.len();
const PERIOD: f64 = 1e-3;
type Regressor = [[f64; 2]; P];

/// The nominal parameters with inertias about all axes, so that they are physical.
fn truth() -> [f64; P] {
    fivebar::NOMINAL.map(|value| value.unwrap_or(0.0))
}

/// A start that is off: bodies of twice the mass at half of the distance.
fn start() -> [f64; P] {
    let mut start = truth();
    for body in start.chunks_exact_mut(10) {
        for moment in &mut body[..6] {
            *moment *= 1.5;
        }
        body[9] *= 2.0;
    }
    start
}

/// The rms error of the cranks in the first and the last of eight seconds, rad.
fn errors(mut law: impl FnMut(&Regressor, &[f64; 2]) -> [f64; P]) -> [f64; 2] {
    let mut loops: Closure<'_, f64, 4, 2, 2, 5, Fivebar> =
        <closure!(fivebar::Fivebar, f64)>::new(&Fivebar).unwrap();
    let home = loops.q_i();
    let (mut q_i, mut qd_i) = (home, [0.0; 2]);
    let (mut values, mut errors) = (start(), [0.0; 2]);
    for k in 0..8000 {
        let t = PERIOD * f64::from(k);
        let wave = |w: f64| {
            let (s, c) = (w * t).sin_cos();
            [0.3 * (1.0 - c), 0.3 * w * s, 0.3 * w * w * c]
        };
        let wanted = [wave(2.0), wave(3.3)];
        let error: [f64; 2] = std::array::from_fn(|d| q_i[d] - home[d] - wanted[d][0]);
        let qd_r = std::array::from_fn(|d| wanted[d][1] - 10.0 * error[d]);
        let qdd_r = std::array::from_fn(|d| wanted[d][2] - 10.0 * (qd_i[d] - wanted[d][1]));
        let s: [f64; 2] = std::array::from_fn(|d| qd_i[d] - qd_r[d]);
        assert!(loops.track(&q_i, 6).is_closed());
        let qd = loops.motion(&qd_i, &[0.0; 2]).qd;
        let mut y = [[0.0; 2]; P];
        let regular = fivebar::adaptive_regressor(loops.q(), &qd, &qd_r, &qdd_r, &mut y);
        assert!(regular.is_regular());
        let effort = std::array::from_fn(|d| {
            let model: f64 = y.iter().zip(&values).map(|(y, value)| y[d] * value).sum();
            model - 0.3 * s[d]
        });
        values = law(&y, &s);
        let (qdd_i, condition) = fivebar::forward_dynamics(loops.q(), &qd, &effort, &truth());
        assert!(condition.is_regular());
        for d in 0..2 {
            qd_i[d] += PERIOD * qdd_i[d];
            q_i[d] += PERIOD * qd_i[d];
        }
        let size = error.iter().map(|error| error * error).sum::<f64>() / 1000.0;
        match k {
            0..1000 => errors[0] += size,
            7000.. => errors[1] += size,
            _ => {}
        }
    }
    errors.map(f64::sqrt)
}

#[test]
fn adaptive_control_follows_a_motion_of_loops() {
    let [_, without] = errors(|_, _| start());
    let mut gradient = GradientLaw::new(&start(), &[0.3; P]).unwrap();
    let by_gradient = errors(|y, s| {
        assert_eq!(gradient.update(y, s, PERIOD), Sample::Taken);
        gradient.values()
    });
    let set = Physical::<P, 4>::new(&PARAMETERS).unwrap();
    let mut natural = NaturalLaw::<f64, P, 4>::new(&PARAMETERS, &start(), 5.0, 0.0).unwrap();
    let naturally = errors(|y, s| {
        assert_eq!(natural.update(y, s, PERIOD), Sample::Taken);
        assert!(set.contains(&natural.values()));
        natural.values()
    });
    println!("gradient {by_gradient:?}, natural {naturally:?}, without {without:e}");
    for [_, last] in [by_gradient, naturally] {
        assert!(last < 0.1 * without, "{last:e} of {without:e}");
    }
}
