//! Counts how often confidence intervals contain the true values, in simulated logs of an arm with
//! two joints whose residuals are correlated in time.
//!
//! All logs have the same motion (finite Fourier series, 0.1 Hz and four harmonics, sampled at 100
//! Hz) and efforts with noise of an autoregression, `e(t) = 0.9 e(t - 1) + eps(t)`. For each
//! estimator and parameter the program prints the share of logs in which the 95 % interval contains
//! the true value. Usage:
//!
//! ```text
//! cargo run --release -p regen-tests --features examples --example coverage -- LOGS SECONDS ESTIMATOR..
//! ```
//!
//! Estimators: `least-squares huber reduce feasible atan power stribeck`; without any, all are run.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout)]

use regen_codegen::diag::Source as Text;
use regen_codegen::pipeline::derive;
use regen_identify::feasibility::{BaseMap, FeasibilityError, Options, ParameterLayout, Scale};
use regen_identify::friction::{self, JointFit};
use regen_identify::identifiability::{Checks, reduce};
use regen_identify::identify::{self, EquationKind};
use regen_identify::intervals::{LeastSquares, Spread, constrained};
use regen_identify::states::nonlinear_joints;
use regen_identify::states::{Filtering, Recorded, Source, StateSample};
use regen_interpreted::{BaseTerms, Interpreted};
use regen_runtime::{BaseModel, Friction};

const STEP: f64 = 0.01;
const FREQUENCY: f64 = 0.1;
const HARMONICS: usize = 5;
const RHO: f64 = 0.9;
/// The standard deviations of the innovations of the two efforts, N m; those of the noise are 2.3
/// times as large.
const NOISE: [f64; 2] = [0.12, 0.06];
const LEVEL: f64 = 0.95;
const DRAWS: usize = 100;

/// The spec of the arm. The second joint has no Coulomb friction, so that this parameter is at its
/// bound.
fn spec(friction: &str) -> String {
    let nominal = match friction {
        "linear" => ["nominal: {Fv: 1.2, Fc: 2.5}", "nominal: {Fv: 0.8, Fc: 0}"],
        _ => ["", ""],
    };
    format!(
        "name: arm\n\
         gravity: [0, -9.81, 0]\n\
         limbs:\n  - name: arm\n    joints:\n      \
         - {{name: q1, type: revolute, body: 1, actuated: true, friction: {friction}, {}}}\n      \
         - {{name: q2, type: revolute, dh: {{a: 0.7}}, body: 2, actuated: true, friction: {friction}, {}}}\n\
         bodies:\n  1: {{mass: 6, com: [0.3, 0, 0], inertia: [0.05, 0, 0, 0.3, 0, 0.3]}}\n  \
         2: {{mass: 4, com: [0.25, 0, 0], inertia: [0.03, 0, 0, 0.12, 0, 0.12]}}\n",
        nominal[0], nominal[1]
    )
    .replace(", }", "}")
}

/// Pseudo-random numbers (SplitMix64); normally distributed ones by Box and Muller.
struct Random(u64);

impl Random {
    fn part(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut x = self.0;
        x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((x ^ (x >> 31)) >> 11) as f64 / (1_u64 << 53) as f64 + 1e-17
    }

    fn normal(&mut self) -> f64 {
        (-2.0 * self.part().ln()).sqrt() * (std::f64::consts::TAU * self.part()).cos()
    }
}

/// A log whose error type is that of a fit.
#[derive(Clone)]
struct Log(Recorded);

impl Source for Log {
    type Error = FeasibilityError;

    fn visit(
        &mut self,
        each: &mut dyn FnMut(
            &StateSample<'_>,
        ) -> Result<(), regen_identify::estimate::EstimateError>,
    ) -> Result<(), FeasibilityError> {
        Ok(self.0.visit(each)?)
    }

    fn filtering(&self) -> Filtering {
        self.0.filtering()
    }
}

/// A motion with the efforts that move the arm.
struct Ideal {
    states: Vec<[Vec<f64>; 3]>,
    tau: Vec<[f64; 2]>,
}

impl Ideal {
    fn new(model: &Interpreted<'_>, beta: &[f64], laws: &[JointFit], samples: usize) -> Self {
        let mut random = Random(3);
        let mut series = Vec::new();
        for _ in 0..2 {
            let mut own = Vec::new();
            for h in 1..=HARMONICS {
                own.push([random.normal() / h as f64, random.normal() / h as f64]);
            }
            series.push((random.normal(), own));
        }
        let mut out = Self {
            states: Vec::new(),
            tau: Vec::new(),
        };
        let r = beta.len();
        let mut w = vec![0.0; 2 * r];
        for t in 0..samples {
            let time = STEP * t as f64;
            let mut state = [vec![0.0; 2], vec![0.0; 2], vec![0.0; 2]];
            for (i, (mean, own)) in series.iter().enumerate() {
                state[0][i] = *mean;
                for (h, [a, b]) in own.iter().enumerate() {
                    let omega = std::f64::consts::TAU * FREQUENCY * (h + 1) as f64;
                    let (s, c) = (omega * time).sin_cos();
                    state[0][i] += a * s + b * c;
                    state[1][i] += omega * (a * c - b * s);
                    state[2][i] -= omega * omega * (a * s + b * c);
                }
            }
            let _ = model
                .base_regressor(&state[0], &state[1], &state[2], &mut w)
                .unwrap();
            let mut tau = [0.0; 2];
            for (i, slot) in tau.iter_mut().enumerate() {
                *slot = (0..r).map(|j| w[2 * j + i] * beta[j]).sum();
                *slot += laws.get(i).map_or(0.0, |law| law.effort(state[1][i]));
            }
            out.states.push(state);
            out.tau.push(tau);
        }
        out
    }

    fn log(&self, seed: u64) -> Log {
        let mut random = Random(seed.wrapping_mul(0x1234_5678_9abc_def1));
        let mut noise = [0.0; 2];
        // so many samples before the log that the initial value has decayed
        for _ in 0..200 {
            noise
                .iter_mut()
                .zip(NOISE)
                .for_each(|(e, s)| *e = RHO * *e + s * random.normal());
        }
        let mut log = Recorded::new();
        for (t, ([q, qd, qdd], tau)) in self.states.iter().zip(&self.tau).enumerate() {
            noise
                .iter_mut()
                .zip(NOISE)
                .for_each(|(e, s)| *e = RHO * *e + s * random.normal());
            log.push(
                STEP * t as f64,
                q,
                qd,
                qdd,
                &[tau[0] + noise[0], tau[1] + noise[1]],
            );
        }
        Log(log)
    }
}

/// The number of logs in which the interval of one parameter contained its true value.
#[derive(Clone, Default)]
struct Count {
    label: String,
    truth: f64,
    held: usize,
    below: usize,
    above: usize,
    outside: usize,
    absent: usize,
    /// The sum of the squared errors of the estimates; `sigmas` is that of their squared standard
    /// deviations.
    errors: f64,
    sigmas: f64,
}

impl Count {
    fn take(&mut self, value: f64, sigma: f64, (low, high): (f64, f64)) {
        self.held += usize::from(low <= self.truth && self.truth <= high);
        self.below += usize::from(high < self.truth);
        self.above += usize::from(low > self.truth);
        self.outside += usize::from(!(low <= value && value <= high));
        self.errors += (value - self.truth).powi(2);
        self.sigmas += sigma * sigma;
    }

    fn spread(&mut self, spread: Option<&Spread>) {
        match spread {
            Some(s) => self.take(s.value, s.sigma, s.interval(LEVEL)),
            None => self.absent += 1,
        }
    }
}

fn counts<'l>(labels: impl Iterator<Item = &'l str>, truth: &[f64]) -> Vec<Count> {
    labels
        .zip(truth)
        .map(|(label, truth)| Count {
            label: label.to_owned(),
            truth: *truth,
            ..Count::default()
        })
        .collect()
}

fn print(name: &str, logs: usize, counts: &[Count]) {
    println!("{name}, {logs} logs");
    println!("  parameter            truth  held   of  low high  outside  sigma/error");
    for c in counts {
        let of = logs - c.absent;
        println!(
            "  {:<18} {:>7.3} {:>5} {:>4} {:>4} {:>4} {:>8}  {:>8.3}",
            c.label,
            c.truth,
            c.held,
            of,
            c.below,
            c.above,
            c.outside,
            (c.sigmas / c.errors).sqrt()
        );
    }
}

fn linear(which: &str, logs: usize, samples: usize) {
    let robot = derive(&Text::new("arm", spec("linear"))).unwrap();
    let terms = BaseTerms::new(&robot);
    let model = Interpreted::with_terms(&robot, &terms);
    let info = model.info();
    let phi: Vec<f64> = info.nominal.iter().map(|x| x.unwrap_or(0.0)).collect();
    let base = model.base_info().base;
    let mut beta = vec![0.0; base.len()];
    model.to_base(&phi, &mut beta).unwrap();
    let ideal = Ideal::new(&model, &beta, &[], samples);
    let labels = || base.iter().map(|b| b.label);
    let mut all = counts(labels(), &beta);
    let layout = ParameterLayout::of(info.parameters).unwrap();
    let combinations = BaseMap::from_base(&model.base_info(), layout.len()).unwrap();
    let options = identify::Options {
        huber: (which == "huber").then_some(1.345),
        ..identify::Options::default()
    };
    for seed in 0..logs {
        let mut log = ideal.log(seed as u64);
        let found = identify::identify(&model, EquationKind::Forces, &options, &mut log).unwrap();
        let values = &found.estimate.values;
        let scale = Scale::near(&layout, &combinations, values, 0.7);
        match which {
            "reduce" => {
                let checks = Checks {
                    scale,
                    deviations: Some(&found.deviations),
                    ..Checks::default()
                };
                let steps = reduce(&found.factor, &combinations, &layout, &checks).unwrap();
                let last = steps.result().unwrap();
                for (k, count) in all.iter_mut().enumerate() {
                    let Some(place) = last.kept.iter().position(|c| *c == k) else {
                        count.absent += 1;
                        continue;
                    };
                    let value = last.estimate.values[place];
                    let half = last.estimate.half_width(place, LEVEL);
                    let sigma = last.estimate.sigma(place);
                    count.take(value, sigma, (value - half, value + half));
                }
            }
            "feasible" => {
                let options = Options {
                    scale,
                    ..Options::default()
                };
                let fit = regen_identify::feasibility::identify(
                    &found.factor,
                    &combinations,
                    &layout,
                    &options,
                )
                .unwrap();
                let data = LeastSquares {
                    factor: &found.factor,
                    values,
                    deviations: &found.deviations,
                };
                let found = constrained(
                    data,
                    &combinations,
                    &layout,
                    &options,
                    (&fit.phi, &fit.beta),
                    DRAWS,
                    &mut |_| {},
                )
                .unwrap();
                for (count, spread) in all.iter_mut().zip(&found.base) {
                    count.spread(Some(spread));
                }
            }
            _ => {
                let used = found.correlated();
                for (k, count) in all.iter_mut().enumerate() {
                    let half = used.half_width(k, LEVEL);
                    count.take(
                        values[k],
                        used.sigma(k),
                        (values[k] - half, values[k] + half),
                    );
                }
            }
        }
    }
    print(which, logs, &all);
}

fn nonlinear(which: &str, logs: usize, samples: usize) {
    let robot = derive(&Text::new("arm", spec(which))).unwrap();
    let terms = BaseTerms::new(&robot);
    let model = Interpreted::with_terms(&robot, &terms);
    let info = model.info();
    let phi: Vec<f64> = info.nominal.iter().map(|x| x.unwrap_or(0.0)).collect();
    let base = model.base_info().base;
    let mut beta = vec![0.0; base.len()];
    model.to_base(&phi, &mut beta).unwrap();
    let (law, first, second): (_, &[f64], &[f64]) = match which {
        "atan" => (Friction::Atan, &[1.5, 1.0, 2.0, 6.0], &[0.8, 0.6, 1.5, 4.0]),
        "power" => (
            Friction::Power,
            &[2.0, 2.6, 1.5, 0.6],
            &[1.0, 1.2, 1.0, 0.7],
        ),
        _ => (
            Friction::Stribeck,
            &[2.0, 4.0, 0.3, 1.4, 1.0],
            &[1.0, 2.5, 0.4, 1.6, 0.7],
        ),
    };
    let laws: Vec<JointFit> = [("q1", first), ("q2", second)]
        .into_iter()
        .map(|(name, values)| JointFit {
            name: name.to_owned(),
            friction: law,
            values: values.to_vec(),
        })
        .collect();
    let ideal = Ideal::new(&model, &beta, &laws, samples);
    let mut names: Vec<String> = base.iter().map(|b| b.label.to_owned()).collect();
    let mut truth = beta.clone();
    for joint in &laws {
        names.extend(law.symbols().iter().map(|s| format!("{s}({})", joint.name)));
        truth.extend(&joint.values);
    }
    let mut all = counts(names.iter().map(String::as_str), &truth);
    let layout = ParameterLayout::of(info.parameters).unwrap();
    let combinations = BaseMap::from_base(&model.base_info(), layout.len()).unwrap();
    let options = Options {
        scale: Scale::near(&layout, &combinations, &beta, 0.7),
        ..Options::default()
    };
    let joints = nonlinear_joints(&model);
    for seed in 0..logs {
        let mut log = ideal.log(seed as u64);
        let (mut data, _) = friction::collect(&model, &mut log, &joints).unwrap();
        data.weigh(&NOISE.map(|s| 1.0 / s)).unwrap();
        let fit = friction::fit(&data, &combinations, &layout, &options).unwrap();
        let found = friction::intervals(
            &data,
            &combinations,
            &layout,
            &options,
            &fit,
            DRAWS,
            &mut |_| {},
        )
        .unwrap();
        let spreads = found.base.iter().map(Some);
        let more = found.joints.iter().flatten().map(Option::as_ref);
        for (count, spread) in all.iter_mut().zip(spreads.chain(more)) {
            count.spread(spread);
        }
    }
    print(which, logs, &all);
}

fn main() {
    let mut args = std::env::args().skip(1);
    let logs = args.next().map_or(1000, |a| a.parse().expect("LOGS"));
    let seconds: f64 = args.next().map_or(30.0, |a| a.parse().expect("SECONDS"));
    #[allow(clippy::cast_sign_loss, reason = "a length of time")]
    let samples = (seconds / STEP).round() as usize;
    let mut wanted: Vec<String> = args.collect();
    if wanted.is_empty() {
        let all = [
            "least-squares",
            "huber",
            "reduce",
            "feasible",
            "atan",
            "power",
            "stribeck",
        ];
        wanted = all.map(str::to_owned).to_vec();
    }
    println!("{samples} samples at {} Hz", 1.0 / STEP);
    for which in &wanted {
        match which.as_str() {
            "least-squares" | "huber" | "reduce" | "feasible" => linear(which, logs, samples),
            _ => nonlinear(which, logs, samples),
        }
    }
}
