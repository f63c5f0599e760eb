//! Checks thousands of random mechanisms, and counts their features:
//!
//! ```sh
//! cargo run --release -p regen-tests --features examples --example ten_thousand -- --from 0 --count 10000
//! ```

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};

use regen_tests::random::{self, Sample, cut_word};
use regen_tests::reference::Friction;

#[derive(Default)]
struct Tally {
    counts: BTreeMap<String, usize>,
    worst: BTreeMap<&'static str, (f64, u64)>,
    failures: Vec<(u64, String)>,
    undrawn: Vec<u64>,
}

impl Tally {
    fn count(&mut self, what: String) {
        *self.counts.entry(what).or_default() += 1;
    }

    /// Counts the features of a spec, once per spec, joint or cut.
    fn features(&mut self, sample: &Sample) {
        let (draft, mechanism) = (&sample.draft, &sample.mechanism);
        self.count(format!("topology {}", draft.topology));
        if !draft.cuts.is_empty() {
            self.count(format!("group {}", draft.group));
        }
        self.count(format!("loops {}", draft.cuts.len()));
        self.count(format!("freedoms {}", mechanism.dof()));
        for joint in draft.joints() {
            self.count(format!("joint {}", joint.kind.word()));
            if joint.body.is_none() {
                self.count("joint without a body".into());
            }
            self.count(format!("friction {}", joint.friction));
            if joint.rotor {
                self.count("rotor".into());
            }
        }
        for cut in &draft.cuts {
            let place = match (&cut.a.body, &cut.b) {
                (Some(_), Some(_)) => "two bodies",
                _ => "the world",
            };
            self.count(format!("cut {} on {place}", cut_word(cut.kind)));
        }
        if !draft.couplings.is_empty() {
            self.count("with couplings".into());
        }
        if mechanism.actuated.len() > mechanism.dof() {
            self.count("more motors than freedoms".into());
        }
        if mechanism.actuated.len() < mechanism.dof() {
            self.count("fewer motors than freedoms".into());
        }
        if mechanism.independent != mechanism.actuated {
            self.count("independent is not actuated".into());
        }
        if mechanism.friction.iter().any(Friction::is_nonlinear) {
            self.count("with nonlinear friction".into());
        }
        let rank = mechanism.n() - mechanism.dof();
        if mechanism.rows() > rank {
            self.count("with redundant rows".into());
        }
    }
}

fn check_seed(seed: u64, states: usize, with_invalid: bool, tally: &mut Tally) {
    let drawn = random::sample(seed);
    for (reject, times) in &drawn.rejects {
        *tally.counts.entry(format!("draw {reject:?}")).or_default() += times;
    }
    let Some(sample) = drawn.sample else {
        tally.undrawn.push(seed);
        return;
    };
    tally.features(&sample);
    let checked = catch_unwind(AssertUnwindSafe(|| {
        random::check_sample(&sample, seed, states)
    }));
    match checked {
        Ok(Ok(figures)) => {
            for (name, figure) in figures.all() {
                let worst = tally.worst.entry(name).or_insert((0.0, seed));
                if figure.worst > worst.0 {
                    *worst = (figure.worst, seed);
                }
            }
        }
        Ok(Err(error)) => tally.failures.push((seed, error)),
        Err(_) => tally.failures.push((seed, "panic".into())),
    }
    if !with_invalid {
        return;
    }
    match random::check_invalid_variants(&sample, seed) {
        Ok(variants) => *tally.counts.entry("invalid variants".into()).or_default() += variants,
        Err(error) => tally.failures.push((seed, error)),
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let number = |name: &str, default: u64| {
        let at = arguments.iter().position(|a| a == name);
        let given = at.and_then(|at| arguments.get(at + 1)?.parse().ok());
        given.unwrap_or(default)
    };
    let (from, count, states) = (
        number("--from", 0),
        number("--count", 100),
        usize::try_from(number("--states", 1)).unwrap_or(1),
    );
    // Checking the invalid variants takes twenty derivations per seed.
    let invalid_every = number("--invalid-every", 10).max(1);
    if arguments.iter().any(|a| a == "--print") {
        match random::sample(from).sample {
            Some(sample) => print!("{}", sample.text),
            None => eprintln!("seed {from} gives no spec"),
        }
        return;
    }
    let start = std::time::Instant::now();
    let mut tally = Tally::default();
    for seed in from..from + count {
        let before = tally.failures.len();
        check_seed(seed, states, seed.is_multiple_of(invalid_every), &mut tally);
        if let Some((seed, error)) = tally.failures.get(before) {
            eprintln!("seed {seed}: {error}");
        }
        if seed % 500 == 499 {
            eprintln!("{} of {count}, {:.0?}", seed + 1 - from, start.elapsed());
        }
    }
    println!("seeds {from} to {}, {states} states each", from + count - 1);
    for (what, times) in &tally.counts {
        println!("{what:40} {times:7}");
    }
    println!("seeds that gave no spec: {:?}", tally.undrawn);
    println!("largest differences, and where:");
    for (name, (worst, seed)) in &tally.worst {
        println!("{name:28} {worst:9.1e}  seed {seed}");
    }
    println!("failures: {}", tally.failures.len());
    for (seed, error) in &tally.failures {
        println!("seed {seed}: {}", error.lines().next().unwrap_or_default());
    }
}
