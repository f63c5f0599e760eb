//! The chapter's robot with noise: the least-squares parameters are not physical, those of the
//! constrained fit are, and nonlinear friction at active and passive joints is found together with
//! them.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::time::Instant;

use regen_generated::rps3_friction::Rps3Friction;
use regen_identify::estimate::{Estimate, QrFactor};
use regen_identify::feasibility::{
    BaseMap, Options, Outcome, ParameterLayout, Scale, Verdict, bodies_yaml, identify, verdict,
};
use regen_identify::friction::{FrictionData, fit};
use regen_identify::identifiability::{Change, Checks, Feasibility, reduce};
use regen_identify::states::{FrictionJoint, directions};
use regen_runtime::{BaseModel, Friction, LoopClosure, State};

/// Pseudo-random numbers (SplitMix64), the same on every machine; normally distributed ones by Box
/// and Muller.
struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        let (u, v) = (1.0 - self.uniform(), self.uniform());
        (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
    }
}

fn model() -> &'static dyn BaseModel<f64> {
    &Rps3Friction
}

fn layout() -> ParameterLayout {
    ParameterLayout::of(model().info().parameters).unwrap()
}

fn combinations() -> BaseMap {
    BaseMap::from_base(&model().base_info(), layout().len()).unwrap()
}

fn nominal() -> Vec<f64> {
    model().info().nominal_parameters().unwrap()
}

/// States along sums of sines around the middle of the legs' strokes.
fn states(samples: usize, phase: f64) -> Vec<State> {
    let model = model();
    let mut closure = LoopClosure::new(model).unwrap();
    (0..samples)
        .map(|k| {
            let t = 7.5 * k as f64 / samples as f64;
            let mut q = [0.62; 3];
            let (mut qd, mut qdd) = ([0.0; 3], [0.0; 3]);
            for leg in 0..3 {
                for (h, size) in [(1.0, 0.05), (2.0, 0.03), (3.0, 0.02)] {
                    let w = std::f64::consts::TAU * h / 7.5 * 2.0;
                    let a = w * t + phase + 2.1 * leg as f64 * h;
                    q[leg] += size * a.sin();
                    qd[leg] += size * w * a.cos();
                    qdd[leg] -= size * w * w * a.sin();
                }
            }
            closure.solve_state(&q, &qd, &qdd).unwrap()
        })
        .collect()
}

/// The base regressor and the efforts of given base parameters at a state.
fn equations(state: &State, beta: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let mut w = vec![0.0; 3 * beta.len()];
    let _ = model()
        .base_regressor(&state.q, &state.qd, &state.qdd, &mut w)
        .unwrap();
    let tau = (0..3)
        .map(|i| beta.iter().enumerate().map(|(j, b)| w[3 * j + i] * b).sum())
        .collect();
    (w, tau)
}

fn factor(states: &[State], beta: &[f64], sigma: f64, seed: u64) -> QrFactor {
    let mut random = Random(seed);
    let mut factor = QrFactor::new(combinations().labels().to_vec());
    for state in states {
        let (w, mut tau) = equations(state, beta);
        for t in &mut tau {
            *t += sigma * random.normal();
        }
        factor.push_block(&w, &tau).unwrap();
    }
    factor
}

#[test]
fn with_noise_least_squares_is_not_physical_and_the_constrained_fit_costs_little() {
    let (layout, combinations) = (layout(), combinations());
    let beta = combinations.apply(&nominal()).unwrap();
    let factor = factor(&states(300, 0.3), &beta, 5.0, 1);
    let plain = factor.solve().unwrap();
    let judged = verdict(&layout, &combinations, &plain, Scale::default()).unwrap();
    assert!(matches!(judged, Verdict::Infeasible { .. }), "{judged:?}");

    let start = Instant::now();
    let found = identify(&factor, &combinations, &layout, &Options::default()).unwrap();
    let seconds = start.elapsed().as_secs_f64();
    println!(
        "feasible 3-RPS: {seconds:.3} s, residual rises by {:.3e}",
        found.rise()
    );
    assert!(found.check.is_physical());
    assert_ne!(found.outcome, Outcome::Unconstrained);
    assert!(
        found.rise() > 0.0 && found.rise() < 0.05,
        "{}",
        found.rise()
    );
    // the YAML text has one line for each body and a head
    let text = bodies_yaml(&layout, &found.phi).unwrap();
    assert_eq!(text.lines().count(), 8);
}

#[test]
fn exact_data_give_their_parameters_and_a_feasible_verdict() {
    let (layout, combinations) = (layout(), combinations());
    let beta = combinations.apply(&nominal()).unwrap();
    let factor = factor(&states(120, 0.3), &beta, 0.0, 1);
    let found = identify(&factor, &combinations, &layout, &Options::default()).unwrap();
    assert_eq!(found.outcome, Outcome::Unconstrained);
    for (a, b) in found.beta.iter().zip(&beta) {
        assert!((a - b).abs() < 1e-7 * (1.0 + b.abs()), "{a} {b}");
    }
    let judged = verdict(&layout, &combinations, &beta, Scale::default()).unwrap();
    assert!(judged.is_feasible());
}

#[test]
fn the_reduction_leaves_out_what_is_zero_within_its_errors_and_nothing_else() {
    let (layout, combinations) = (layout(), combinations());
    let beta = combinations.apply(&nominal()).unwrap();
    let other = factor(&states(150, 1.7), &beta, 5.0, 3);
    let checks = Checks {
        other: Some(&other),
        exact: Some(&beta),
        ..Checks::default()
    };
    let (mut held, mut all, mut moved) = (0, 0, 0);
    for seed in 0..12 {
        let data = factor(&states(300, 0.3), &beta, 5.0, 20 + seed);
        let full = Estimate::of(&data).unwrap();
        let reduction = reduce(&data, &combinations, &layout, &checks).unwrap();
        let (first, last) = (&reduction.steps[0], reduction.result().unwrap());
        assert_eq!(last.feasibility, Feasibility::Feasible);
        assert!(last.kept.len() < first.kept.len() && last.condition < first.condition);
        assert!(
            !last.is_significantly_worse(),
            "{seed}: {}",
            last.probability
        );
        assert!(last.other_residual.unwrap() < 1.1 * first.other_residual.unwrap());
        for k in (0..beta.len()).filter(|k| !last.kept.contains(k)) {
            // with others left out before it, a parameter may go that was not as near to zero with them
            let far = (full.values[k] / full.sigma(k)).abs();
            assert!(far < 3.5, "{seed}: {} {far}", full.labels[k]);
        }
        for (place, k) in last.kept.iter().enumerate() {
            let (value, half) = (
                last.estimate.values[place],
                last.estimate.half_width(place, 0.95),
            );
            held += usize::from((value - beta[*k]).abs() <= half);
            all += 1;
            assert!(last.estimate.sigma(place) >= full.sigma(*k) * (1.0 - 1e-9));
        }
        moved += usize::from(last.change == Change::Physical);
    }
    println!("{held} of {all} intervals, {moved} made physical");
    assert!(100 * held > 93 * all, "{held} of {all}");
}

/// Stribeck friction in an active leg and in a passive pivot.
#[test]
fn nonlinear_friction_of_active_and_passive_joints_is_recovered() {
    let (layout, combinations) = (layout(), combinations());
    let beta = combinations.apply(&nominal()).unwrap();
    let joints = ["q1", "q2"].map(|name| FrictionJoint {
        name: name.to_owned(),
        friction: Friction::Stribeck,
    });
    // the model has linear friction at the active leg with its own columns: leave them out
    let kept: Vec<usize> = (0..beta.len())
        .filter(|k| !["Fv(q2)", "Fc(q2)"].contains(&combinations.labels()[*k].as_str()))
        .collect();
    let selected = combinations.select(&kept).unwrap();
    let places = ["q1", "q2"].map(|name| model().info().index_of(name).unwrap());
    let laws = [
        [40.0, 90.0, 0.05, 1.2, 30.0],
        [150.0, 300.0, 0.03, 1.4, 2500.0],
    ];
    let mut data = FrictionData::new(selected.labels(), &joints, 3).unwrap();
    for state in &states(200, 0.3) {
        let (w, _) = equations(state, &beta);
        let columns: Vec<f64> = kept
            .iter()
            .flat_map(|k| w[3 * k..3 * k + 3].to_vec())
            .collect();
        let qd = places.map(|k| state.qd[k]);
        let (d, _) = directions(model(), &state.q, &places).unwrap();
        let tau: Vec<f64> = (0..3)
            .map(|i| {
                let body: f64 = kept.iter().map(|k| w[3 * k + i] * beta[*k]).sum();
                let friction = qd.iter().zip(&laws).enumerate().map(|(k, (v, x))| {
                    let [fc, fs, vs, delta, fv] = *x;
                    let e = (-(v / vs).abs().powf(delta)).exp();
                    d[3 * k + i] * (v.signum() * (fc + (fs - fc) * e) + fv * v)
                });
                body + friction.sum::<f64>()
            })
            .collect();
        data.push(&columns, &tau, &qd, &d, &[1.0; 3]).unwrap();
    }
    let plain = ParameterLayout::new(
        &layout
            .labels()
            .iter()
            .filter(|l| !["Fv(q2)", "Fc(q2)"].contains(&l.as_str()))
            .collect::<Vec<_>>(),
    )
    .unwrap();
    let columns: Vec<usize> = plain
        .labels()
        .iter()
        .map(|l| layout.find(l).unwrap())
        .collect();
    let rows = selected.rows().iter();
    let rows = rows
        .map(|row| columns.iter().map(|c| row[*c]).collect())
        .collect();
    let narrowed = BaseMap::new(selected.labels().to_vec(), rows).unwrap();
    let found = fit(&data, &narrowed, &plain, &Options::default()).unwrap();
    println!(
        "{} programmes, {:e} of {:e}",
        found.programmes, found.squared_residual, found.linear_squared_residual
    );
    assert!(found.squared_residual < 1e-6 * found.linear_squared_residual);
    for (joint, law) in found.joints.iter().zip(laws) {
        for (a, b) in joint.values.iter().zip(law) {
            assert!((a - b).abs() < 1e-6 * b, "{:?} {law:?}", joint.values);
        }
    }
}
