//! Writes problems with this crate's solutions, for comparison with another conic solver:
//! `tests/tools/conic`.

use std::io::Write as _;

use regen_identify::feasibility::{Bound, Options, Scale, Total, Verdict, identify, verdict};
use serde_json::json;

use crate::optimum::{Problem, Random, problem};

/// Random bounds, known values and sums, some of which exclude the true values.
fn random_constraints(problem: &Problem, seed: u64) -> Options {
    let mut random = Random(seed ^ 0x5EED);
    let mut options = Options::default();
    let (layout, truth) = (&problem.layout, &problem.truth);
    let mut free = Vec::new();
    for body in layout.bodies() {
        let m = body.columns[9];
        let (label, value) = (layout.labels()[m].clone(), truth[m]);
        let mut between =
            |low: f64, high: f64| value * (low + (high - low) * (random.signed() + 1.0) / 2.0);
        match (seed / 7 + m as u64) % 5 {
            0 => options.bounds.push(Bound {
                parameter: label,
                lowest: between(0.5, 1.5),
                highest: between(1.6, 9.0),
            }),
            1 => options.bounds.push(Bound {
                parameter: label,
                lowest: 0.0,
                highest: between(0.3, 3.0),
            }),
            2 => options.known.push((label, between(0.8, 1.2))),
            _ => free.push((label, value)),
        }
    }
    if free.len() > 1 {
        let value = free.iter().map(|(_, v)| v).sum::<f64>() * (1.0 + 0.1 * random.signed());
        let parameters = free.into_iter().map(|(label, _)| label).collect();
        options.totals.push(Total { parameters, value });
    }
    options
}

/// Writes the first `CONIC_PROBLEMS` problems to the file `CONIC_OUT`.
#[test]
#[ignore = "writes a file for tests/tools/conic/compare.py"]
fn problems_for_another_solver() {
    let count: u64 = std::env::var("CONIC_PROBLEMS").unwrap().parse().unwrap();
    let path = std::env::var("CONIC_OUT").unwrap();
    let mut out = std::fs::File::create(path).unwrap();
    for seed in 0..count {
        let problem = problem(seed);
        let options = random_constraints(&problem, seed);
        let Problem {
            layout,
            combinations,
            factor,
            ..
        } = &problem;
        let ours = match identify(factor, combinations, layout, &options) {
            Ok(found) => json!({
                "phi": found.phi,
                "squares": found.squared_residual,
                "gap": found.gap,
                "limited": found.limited,
                "sizes": found.sizes.iter().map(|s| [s.mass, s.length]).collect::<Vec<_>>(),
            }),
            Err(error) => json!({ "error": error.to_string() }),
        };
        let decision = factor.solve().ok().map(|beta| {
            let says = match verdict(layout, combinations, &beta, Scale::default()).unwrap() {
                Verdict::Feasible { .. } => "feasible",
                Verdict::Infeasible { .. } => "infeasible",
                Verdict::Undecided { .. } => "undecided",
            };
            json!({ "beta": beta, "says": says })
        });
        let bounds = options.bounds.iter();
        let bounds = bounds.map(|b| json!([b.parameter, b.lowest, b.highest]));
        let totals = options
            .totals
            .iter()
            .map(|t| json!([t.parameters, t.value]));
        let bodies = layout.bodies().iter().map(|b| b.columns.to_vec());
        let line = json!({
            "seed": seed,
            "labels": layout.labels(),
            "bodies": bodies.collect::<Vec<_>>(),
            "single": layout.single(),
            "rows": combinations.rows(),
            "r": factor.r(),
            "z": factor.z(),
            "rss": factor.rss(),
            "bounds": bounds.collect::<Vec<_>>(),
            "known": options.known,
            "totals": totals.collect::<Vec<_>>(),
            "ours": ours,
            "verdict": decision,
        });
        writeln!(out, "{line}").unwrap();
    }
}
