//! The balance of energy, compared with the energies and powers of a slider-crank written by hand.

use regen_identify::identify::{EquationBuilder, EquationKind, Options, identify, residuals};
use regen_identify::states::{Recorded, StateSample};
use regen_runtime::LoopClosure;

use crate::models::pendulum::Pendulum;
use crate::models::slider_crank::SliderCrank;

const GRAVITY: f64 = 9.81;
const PHI: [f64; 3] = [0.7, 0.4, 2.5];
/// The time of the first sample, s; not zero, because only differences of times may matter.
const START: f64 = 5.0;

fn model() -> SliderCrank {
    SliderCrank {
        offset: 0.3,
        ..SliderCrank::default()
    }
}

/// A sample of the crank's motion: the state and the crank's effort.
struct CrankSample {
    time: f64,
    q: Vec<f64>,
    qd: Vec<f64>,
    qdd: Vec<f64>,
    tau: f64,
}

fn crank_samples(samples: u32, step: f64) -> Vec<CrankSample> {
    let model = model();
    let mut closure = LoopClosure::new(&model).unwrap();
    (0..samples)
        .map(|k| {
            let t = step * f64::from(k);
            let (s, c) = (2.0 * t).sin_cos();
            let state = closure
                .track_state(&[1.5 * t + 0.5 * s], &[1.5 + c], &[-2.0 * s])
                .unwrap();
            assert!(state.outcome.is_closed());
            // d'Alembert: the force on the slider from its acceleration and its weight
            let ratio = state.qd[2] / state.qd[0];
            let slide = PHI[2] * (state.qdd[2] + GRAVITY);
            CrankSample {
                time: START + t,
                tau: PHI[0] * state.qdd[0] + PHI[1] * state.qd[0] + ratio * slide,
                q: state.q,
                qd: state.qd,
                qdd: state.qdd,
            }
        })
        .collect()
}

fn row<'a>(
    made: &'a CrankSample,
    tau: &'a [f64; 1],
    weights: &'a [f64; 1],
    follows: bool,
) -> StateSample<'a> {
    StateSample {
        time: made.time,
        q: &made.q,
        qd: &made.qd,
        qdd: &made.qdd,
        tau,
        efforts: &[],
        held: &[],
        at_standstill: &[],
        weights,
        follows,
        bridged: false,
    }
}

/// The equation of a window by its definition: the gains of the kinetic energies, and the
/// trapezoidal integrals of the powers of friction and weight; the right side is the integral of
/// the power of the crank's effort.
fn by_hand(window: &[CrankSample]) -> ([f64; 3], f64) {
    let trapezoid = |power: &dyn Fn(&CrankSample) -> f64| -> f64 {
        let pairs = window.windows(2);
        pairs
            .map(|p| (p[1].time - p[0].time) * (power(&p[0]) + power(&p[1])) / 2.0)
            .sum()
    };
    let (first, last) = (&window[0], &window[window.len() - 1]);
    let gained = |coordinate: usize| {
        let half = |m: &CrankSample| 0.5 * m.qd[coordinate] * m.qd[coordinate];
        half(last) - half(first)
    };
    let w = [
        gained(0),
        trapezoid(&|m| m.qd[0] * m.qd[0]),
        gained(2) + trapezoid(&|m| GRAVITY * m.qd[2]),
    ];
    (w, trapezoid(&|m| m.tau * m.qd[0]))
}

#[test]
fn a_window_balances_work_with_energy_and_friction_losses() {
    let (model, rows) = (model(), crank_samples(200, 0.01));
    let mut observer = EquationBuilder::new(&model, EquationKind::Energy { window: 0.25 });
    let mut from = 0;
    let mut windows = 0;
    // the log is interrupted here: the window before it gives no equation
    let gap = 110;
    for (k, sample) in rows.iter().enumerate() {
        // the window has the weight of its first sample
        let (tau, weights) = ([sample.tau], [1.0 + k as f64]);
        let found = observer
            .observe(&row(sample, &tau, &weights, k > 0 && k != gap))
            .unwrap();
        if k == gap {
            from = k;
        }
        if k - from < 25 {
            assert!(found.tau.is_empty() && found.weights.is_empty(), "{k}");
            continue;
        }
        let (w, work) = by_hand(&rows[from..=k]);
        assert_eq!((found.tau.len(), found.w.len()), (1, 3));
        // rounding of sums of 25 terms of size 10
        for (a, b) in found.w.iter().zip(w) {
            assert!((a - b).abs() < 1e-12, "{k}: {:?} {w:?}", found.w);
        }
        assert!((found.tau[0] - work).abs() < 1e-12);
        assert_eq!(found.weights, [1.0 + from as f64]);
        from = k;
        windows += 1;
    }
    assert_eq!(windows, 4 + 3, "110 samples, then 90");
    assert_eq!(observer.singular(), 0);
}

/// The error of trapezoids grows with the square of their step: a quarter of the step gives a
/// sixteenth of the error.
#[test]
fn parameters_from_energy_converge_as_the_step_shrinks() {
    let model = model();
    let off = |samples: u32, step: f64| {
        let mut log = Recorded::new();
        for m in crank_samples(samples, step) {
            // the energy equation does not use accelerations
            log.push(m.time, &m.q, &m.qd, &[f64::NAN; 3], &[m.tau]);
        }
        let kind = EquationKind::Energy { window: 0.1 };
        let found = identify(&model, kind, &Options::default(), &mut log).unwrap();
        let pairs = found.estimate.values.iter().zip(PHI);
        pairs.fold(0.0, |m: f64, (a, b)| m.max((a - b).abs() / b))
    };
    let (coarse, fine) = (off(600, 0.01), off(2400, 0.0025));
    assert!(coarse < 2e-2 && fine < coarse / 12.0, "{coarse:e} {fine:e}");
}

#[test]
fn forces_and_energy_without_an_equation_are_counted_as_singular() {
    let model = model();
    let rows = crank_samples(6, 0.1);
    // the rod is perpendicular to the slider's axis: the crank does not determine the motion
    let mut across = crank_samples(1, 0.1).remove(0);
    across.q[1] = std::f64::consts::FRAC_PI_2 - across.q[0];
    for kind in [EquationKind::Forces, EquationKind::Energy { window: 0.15 }] {
        let mut observer = EquationBuilder::new(&model, kind);
        let mut given = 0;
        for (k, sample) in rows.iter().enumerate() {
            let sample = if k == 3 { &across } else { sample };
            let tau = [sample.tau];
            let found = observer.observe(&row(sample, &tau, &[1.0], k > 0)).unwrap();
            given += found.tau.len();
            assert!(k != 3 || found.tau.is_empty());
        }
        assert_eq!(observer.singular(), 1);
        // windows of two steps: one from sample 0 to 2, none over the gap, and 4 to 5 is too short
        assert_eq!(given, if kind == EquationKind::Forces { 5 } else { 1 });
    }
}

#[test]
fn a_row_that_is_not_finite_gives_no_equation() {
    let mut observer = EquationBuilder::new(&Pendulum, EquationKind::Forces);
    for (qdd, given) in [(1.0, 1), (f64::INFINITY, 0), (f64::NAN, 0), (2.0, 1)] {
        let row = StateSample {
            time: 0.0,
            q: &[0.1],
            qd: &[0.2],
            qdd: &[qdd],
            tau: &[1.0],
            efforts: &[],
            held: &[],
            at_standstill: &[],
            weights: &[1.0],
            follows: true,
            bridged: false,
        };
        assert_eq!(observer.observe(&row).unwrap().tau.len(), given, "{qdd}");
    }
    assert_eq!(observer.singular(), 2);
}

#[test]
fn residuals_of_the_true_parameters_are_errors_of_the_trapezoidal_rule() {
    let mut log = Recorded::new();
    for m in crank_samples(400, 0.005) {
        log.push(m.time, &m.q, &m.qd, &m.qdd, &[m.tau]);
    }
    let forces = residuals(&model(), EquationKind::Forces, &mut log, &PHI, &[0.0], 3).unwrap();
    assert!(forces.efforts()[0].largest < 1e-10, "closed to rounding");
    let kind = EquationKind::Energy { window: 0.5 };
    let energy = residuals(&model(), kind, &mut log, &PHI, &[0.0], 1).unwrap();
    // two seconds without the first sample contain three full windows
    assert_eq!(energy.efforts()[0].samples, 3);
    // over half a second, the error is (step^2 / 12) times the second derivative of powers of size
    // 100
    assert!(energy.efforts()[0].largest < 1e-2);
}

#[test]
fn kinds_of_equations_have_the_names_of_files() {
    assert_eq!(EquationKind::Forces.name(), "forces");
    assert_eq!(
        EquationKind::Energy { window: 0.5 }.name(),
        "energy over 0.5 s"
    );
    let origin = EquationBuilder::new(&model(), EquationKind::Energy { window: 0.5 }).origin();
    assert_eq!(origin.efforts, ["energy"]);
    assert_eq!(origin.labels, ["J(crank)", "Fv(crank)", "m(slider)"]);
    let origin = EquationBuilder::new(&model(), EquationKind::Forces).origin();
    assert_eq!(origin.efforts, ["crank"]);
}
