//! Exciting trajectories of the 3-RPS by seed, with the limits of the chapter's study:
//! `cargo run --release -p regen-tests --features examples --example excite_seeds -- [FIRST] [LAST] [CRITERION]`.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::sync::atomic::AtomicBool;
use std::time::Instant;

use regen_experiment::excite::{Criterion, Monitor, Outcome, Settings, excite};
use regen_generated::rps3::Rps3;
use regen_runtime::{Limits, Model};

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |k: usize, default: u64| {
        let given = arguments.get(k).map(|a| a.parse());
        given.map_or(default, |n| n.expect("a number"))
    };
    let criterion = match arguments.get(2).map(String::as_str) {
        None | Some("scaled") => Criterion::ScaledCondition,
        Some("condition") => Criterion::Condition,
        Some("determinant") => Criterion::Determinant,
        Some(_) => Criterion::SmallestSingular,
    };
    let info = Model::<f64>::info(&Rps3);
    let mut settings = Settings {
        criterion,
        threads: 1,
        starts: number(3, 1) as usize,
        steps: number(4, 60) as usize,
        ..Settings::of(&info)
    };
    settings.limits = vec![Limits::NONE; info.coordinates.len()];
    for c in info.independent {
        settings.limits[*c].position = Some([0.45, 0.75]);
        settings.limits[*c].velocity = Some([-0.6, 0.6]);
    }
    settings.cones.fill(45.0_f64.to_radians());
    println!("seed  scaled  unscaled  -log det  smallest  least margin  seconds");
    for seed in number(0, 1)..=number(1, 1) {
        settings.seed = seed;
        let from = Instant::now();
        let stop = AtomicBool::new(false);
        let watch = Monitor {
            stop: &stop,
            report: &|_| {},
        };
        match excite(&Rps3, &Rps3, &settings, watch).unwrap() {
            Outcome::Found(found) => {
                let f = found.figures;
                let least = found
                    .margins
                    .iter()
                    .map(|m| m.relative_distance)
                    .fold(1.0, f64::min);
                println!(
                    "{seed:4}  {:6.2}  {:8.1}  {:8.1}  {:8.4}  {least:12.1e}  {:7.1}",
                    f.scaled_condition,
                    f.condition,
                    f.determinant,
                    f.smallest_singular,
                    from.elapsed().as_secs_f64()
                );
            }
            other => println!("{seed:4}  {other:?}"),
        }
    }
}
