//! Writes random problems of the physical fit with our answers. `tests/tools/conic/compare.py`
//! solves them again by a conic solver that shares no code with ours.
//!
//! ```sh
//! cargo run --release -p regen-tests --features examples --example conic -- 0 1000 > problems.jsonl
//! python tests/tools/conic/compare.py problems.jsonl
//! ```
//!
//! Robots are random trees and loops, with bodies from 10 g to 20 kg in the same robot. The motion
//! is poor: few samples, small angles, coordinates at rest. Some masses have bounds that exclude
//! the true value, some values and sums are known. Each problem is one line.

use std::io::Write as _;

use regen_codegen::{diag::Source, pipeline};
use regen_identify::estimate::QrFactor;
use regen_identify::feasibility::{
    BaseMap, Bound, FeasibilityError, Options, ParameterLayout, PhysicalFit, Scale, Total, Verdict,
    identify, verdict,
};
use regen_interpreted::{BaseTerms, Interpreted};
use regen_runtime::{BaseModel, LoopClosure, Outcome};
use regen_tests::random_spec;
use regen_tests::reference::{PhysicalBody, Random};
use serde_json::{Value, json};

fn main() {
    let numbers: Vec<u64> = std::env::args().skip(1).flat_map(|a| a.parse()).collect();
    let [first, count] = numbers[..] else {
        eprintln!("usage: conic FIRST_SEED COUNT");
        std::process::exit(2);
    };
    let mut out = std::io::stdout().lock();
    let mut made = 0;
    let mut seed = first;
    while made < count {
        if let Some(problem) = problem(seed) {
            if writeln!(out, "{problem}").is_err() {
                return;
            }
            made += 1;
        }
        seed += 1;
    }
}

/// A problem with our answer; `None` for a mechanism without regular states.
fn problem(seed: u64) -> Option<Value> {
    let text = if seed.is_multiple_of(2) {
        random_spec::tree(seed)
    } else {
        random_spec::closed_loop(seed).ok()?
    };
    let robot = pipeline::derive(&Source::new("random.yaml", &text)).ok()?;
    let terms = BaseTerms::new(&robot);
    let model = Interpreted::with_terms(&robot, &terms);
    let layout = ParameterLayout::of(model.info().parameters).ok()?;
    let combinations = BaseMap::from_model(&model, layout.len()).ok()?;
    let mut random = Random::new(seed.wrapping_mul(0x9E37_79B9).wrapping_add(17));
    let truth = truth(&layout, &mut random);
    let (factor, rows) = data(&model, &combinations, &truth, &mut random)?;
    let options = random_constraints(&layout, &truth, &mut random);
    let found = identify(&factor, &combinations, &layout, &options);
    let judged = factor.solve().ok().and_then(|beta| {
        let judged = verdict(&layout, &combinations, &beta, Scale::default());
        Some((beta, judged.ok()?))
    });
    let bounds: Vec<Value> = options
        .bounds
        .iter()
        .map(|b| {
            let highest = b.highest.is_finite().then_some(b.highest);
            json!([b.parameter, b.lowest, highest])
        })
        .collect();
    let totals = options
        .totals
        .iter()
        .map(|t| json!([t.parameters, t.value]));
    Some(json!({
        "seed": seed,
        "samples": rows,
        "labels": layout.labels(),
        "bodies": layout.bodies().iter().map(|b| b.columns.to_vec()).collect::<Vec<_>>(),
        "single": layout.single(),
        "rows": combinations.rows(),
        "r": factor.r(),
        "z": factor.z(),
        "rss": factor.rss(),
        "bounds": bounds,
        "known": options.known,
        "totals": totals.collect::<Vec<_>>(),
        "ours": answer(&found),
        "verdict": judged.map(|(beta, judged)| json!({
            "beta": beta,
            "says": match judged {
                Verdict::Feasible { .. } => "feasible",
                Verdict::Infeasible { .. } => "infeasible",
                Verdict::Undecided { .. } => "undecided",
            },
        })),
    }))
}

fn answer(found: &Result<PhysicalFit, FeasibilityError>) -> Value {
    match found {
        Ok(found) => json!({
            "phi": found.phi,
            "squares": found.squared_residual,
            "gap": found.gap,
            "limited": found.limited,
            "sizes": found.sizes.iter().map(|s| [s.mass, s.length]).collect::<Vec<_>>(),
            "margin": found.check.margin(),
        }),
        Err(error) => json!({ "error": error.to_string() }),
    }
}

/// A random integer from 0 to n - 1.
fn below(random: &mut Random, n: usize) -> usize {
    let x = random.uniform(0.0, n as f64);
    (1..n).filter(|k| x >= *k as f64).count()
}

/// Physical values of all parameters, with light and heavy bodies.
fn truth(layout: &ParameterLayout, random: &mut Random) -> Vec<f64> {
    let mut phi = vec![0.0; layout.len()];
    for body in layout.bodies() {
        let mass = 10.0_f64.powf(random.uniform(-2.0, 1.3));
        let own = PhysicalBody::random(random).parameters();
        let unit = mass / own[9];
        for (column, x) in body.columns.iter().zip(own) {
            phi[*column] = unit * x;
        }
    }
    for k in layout.single() {
        phi[*k] = random.uniform(0.0, 0.5);
    }
    phi
}

/// Observations of a poor motion, with noise.
fn data(
    model: &Interpreted<'_>,
    combinations: &BaseMap,
    truth: &[f64],
    random: &mut Random,
) -> Option<(QrFactor, usize)> {
    let info = model.info();
    let (dof, r) = (info.independent.len(), combinations.rows().len());
    let beta = combinations.apply(truth).ok()?;
    let mut closure = LoopClosure::new(model).ok()?;
    let home: Vec<f64> = info.independent.iter().map(|k| info.home[*k]).collect();
    let resting: Vec<bool> = (0..dof).map(|_| random.uniform(0.0, 1.0) < 0.2).collect();
    let reach = 10.0_f64.powf(random.uniform(-1.5, 0.0));
    let samples = 20 + below(random, 100);
    let mut all: Vec<(Vec<f64>, Vec<f64>)> = Vec::new();
    for _ in 0..samples {
        let mut vary = |size: f64| -> Vec<f64> {
            let one = |rests: &bool| {
                if *rests {
                    0.0
                } else {
                    random.uniform(-size, size)
                }
            };
            resting.iter().map(one).collect()
        };
        let q: Vec<f64> = vary(reach).iter().zip(&home).map(|(a, b)| a + b).collect();
        let (qd, qdd) = (vary(2.0 * reach), vary(8.0 * reach));
        let state = closure.solve_state(&q, &qd, &qdd).ok()?;
        if state.outcome != Outcome::Closed {
            continue;
        }
        let mut w = vec![0.0; dof * r];
        let condition = model
            .base_regressor(&state.q, &state.qd, &state.qdd, &mut w)
            .ok()?;
        let regular = condition.pivot > 1e-6 && w.iter().all(|x| x.is_finite());
        if regular {
            let effort = |i: usize| -> f64 { (0..r).map(|j| w[j * dof + i] * beta[j]).sum() };
            let tau = (0..dof).map(effort).collect();
            all.push((w, tau));
        }
    }
    if all.len() * dof < r + 10 {
        return None;
    }
    let squares: f64 = all.iter().flat_map(|(_, t)| t).map(|t| t * t).sum();
    let noise =
        (squares / (all.len() * dof) as f64).sqrt() * 10.0_f64.powf(random.uniform(-2.5, -0.3));
    let mut factor = QrFactor::new(combinations.labels().to_vec());
    for (w, tau) in &mut all {
        for t in tau.iter_mut() {
            // approximately normal
            let sum: f64 = (0..12).map(|_| random.uniform(-0.5, 0.5)).sum();
            *t += noise * sum;
        }
        factor.push_block(w, tau).ok()?;
    }
    Some((factor, all.len()))
}

/// Random bounds that may exclude the true values, known values and sums.
fn random_constraints(layout: &ParameterLayout, truth: &[f64], random: &mut Random) -> Options {
    let mut options = Options::default();
    let mut used = Vec::new();
    for body in layout.bodies() {
        let [.., mz, m] = body.columns;
        let (label, value) = (layout.labels()[m].clone(), truth[m]);
        match below(random, 6) {
            0 => options.bounds.push(Bound {
                parameter: label.clone(),
                lowest: value * random.uniform(0.5, 1.5),
                highest: value * random.uniform(1.6, 10.0),
            }),
            1 => options.bounds.push(Bound {
                parameter: label.clone(),
                lowest: 0.0,
                highest: value * random.uniform(0.3, 3.0),
            }),
            2 => options
                .known
                .push((label.clone(), value * random.uniform(0.8, 1.2))),
            _ => {
                used.push(label);
                if below(random, 5) == 0 {
                    options.known.push((layout.labels()[mz].clone(), 0.0));
                }
            }
        }
    }
    if used.len() > 1 && below(random, 3) == 0 {
        let value = |label: &String| layout.find(label).map_or(0.0, |k| truth[k]);
        let value = used.iter().map(value).sum::<f64>() * random.uniform(0.9, 1.1);
        options.totals.push(Total {
            parameters: used,
            value,
        });
    }
    options
}
