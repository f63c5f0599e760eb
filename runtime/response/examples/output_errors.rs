//! Counts in how many simulated logs every parameter is within three of its standard deviations of
//! the truth, by DIDIM and by responses to commands.
//!
//! The robots are under position control by known gains, along a sum of three sines about home;
//! positions have noise of 1e-5 rad, efforts of 0.01 N m (five-bars) or 0.05 N m (arm), 5 s at
//! 400 Hz. Every estimate starts from parameters up to 10 % off the truth. Usage:
//!
//! ```text
//! cargo run --release -p regen-response --features examples --example output_errors -- SEEDS [didim|response]..
//! ```
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::print_stdout,
    missing_docs
)]

#[path = "../tests/responses/twin.rs"]
#[allow(dead_code, reason = "tests use the rest")]
mod twin;

use std::time::Instant;

use regen_experiment::closed_loop::{ClosedLoop, Controllers};
use regen_identify::estimate::Estimate;
use regen_response::{DidimOptions, EffortRun, Number, didim, fit_responses};
use regen_runtime::BaseModel;

use twin::{Twin, off};

regen_runtime::robot_model!("../../guide/fivebar/fivebar.yaml");
regen_runtime::robot_model!("../tests/responses/picker_asymmetric.yaml");
regen_runtime::robot_model!("../tests/responses/arm.yaml");

/// How often values were within three standard deviations.
#[derive(Default)]
struct Count {
    logs: usize,
    all: usize,
    single: usize,
    values: usize,
    squares: f64,
    worst: f64,
    seconds: f64,
    failed: usize,
    /// For each parameter: within, the sum of the ratios and of their squares.
    own: Vec<(String, usize, f64, f64)>,
}

impl Count {
    fn add(&mut self, labels: &[String], values: &[f64], sigmas: &[f64], truth: &[f64]) {
        self.logs += 1;
        if self.own.is_empty() {
            self.own = labels.iter().map(|l| (l.clone(), 0, 0.0, 0.0)).collect();
        }
        let mut inside = true;
        for (k, ((value, sigma), truth)) in values.iter().zip(sigmas).zip(truth).enumerate() {
            let ratio = (value - truth) / sigma;
            let within = ratio.abs() <= 3.0;
            inside &= within;
            self.single += usize::from(within);
            self.values += 1;
            self.squares += ratio * ratio;
            self.worst = self.worst.max(ratio.abs());
            let own = &mut self.own[k];
            own.1 += usize::from(within);
            own.2 += ratio;
            own.3 += ratio * ratio;
        }
        self.all += usize::from(inside);
    }

    fn print(&self, name: &str) {
        let n = self.logs.max(1) as f64;
        println!(
            "{name}: all parameters within 3 sigma in {} of {} logs; values {:.2} %, rms {:.2} \
             sigma, largest {:.1}; {:.2} s each; {} failed",
            self.all,
            self.logs,
            100.0 * self.single as f64 / self.values.max(1) as f64,
            (self.squares / self.values.max(1) as f64).sqrt(),
            self.worst,
            self.seconds / n,
            self.failed
        );
        for (label, within, sum, squares) in &self.own {
            println!(
                "    {label:10} within {within:4}, mean {:6.2}, rms {:5.2}",
                sum / n,
                (squares / n).sqrt()
            );
        }
    }
}

fn study<M>(name: &str, model: &M, gains: &[[f64; 2]], effort_noise: f64, seeds: u64, which: &str)
where
    M: BaseModel<f64> + BaseModel<Number> + Sync,
{
    let mut count = Count::default();
    for seed in 0..seeds {
        let twin = Twin {
            duration: 5.0,
            noise: [1e-5, effort_noise],
            seed: seed + 1,
            ..Twin::new(model, gains)
        };
        let truth = twin.beta();
        let start = off(&truth, 0.1);
        if which == "didim" {
            let log = twin.log();
            let joints = gains.len();
            let efforts: Vec<Vec<f64>> = (0..joints)
                .map(|k| {
                    log.measured_effort
                        .iter()
                        .skip(k)
                        .step_by(joints)
                        .copied()
                        .collect()
                })
                .collect();
            let reference = twin.reference();
            let run = EffortRun {
                times: &log.t,
                efforts: &efforts,
                positions: &[],
                closed_loop: ClosedLoop {
                    reference: &reference,
                    lead: 0.0,
                    controllers: Controllers::Known {
                        pid: &twin.pid,
                        offset: &[],
                    },
                },
            };
            let clock = Instant::now();
            let found = didim(model, model, &[run], &DidimOptions::default(), &start);
            count.seconds += clock.elapsed().as_secs_f64();
            let Ok(found) = found else {
                count.failed += 1;
                count.logs += 1;
                continue;
            };
            let estimate: Estimate = found.identified.correlated();
            let sigmas: Vec<f64> = (0..truth.len()).map(|k| estimate.sigma(k)).collect();
            count.add(&estimate.labels, &estimate.values, &sigmas, &truth);
        } else {
            let run = twin.run();
            let clock = Instant::now();
            let found = fit_responses(
                model,
                model,
                &[run],
                &twin.setup(),
                &start,
                0.95,
                &mut |_, _| {},
            );
            count.seconds += clock.elapsed().as_secs_f64();
            let Ok(found) = found else {
                count.failed += 1;
                count.logs += 1;
                continue;
            };
            let sigmas: Vec<f64> = (found.model.intervals.base.iter())
                .map(|i| i.map_or(f64::INFINITY, |i| i.sigma))
                .collect();
            let labels = found.factor.labels();
            count.add(labels, &found.model.beta, &sigmas, &truth);
        }
    }
    count.print(&format!("{which}, {name}"));
}

fn main() {
    let mut args = std::env::args().skip(1);
    let seeds = args.next().map_or(20, |a| a.parse().expect("SEEDS"));
    let mut wanted: Vec<String> = args.collect();
    if wanted.is_empty() {
        wanted = ["didim", "response"].map(str::to_owned).to_vec();
    }
    for which in &wanted {
        let five = [[60.0, 0.8]; 2];
        study(
            "five-bar of the guide",
            &picker::Picker,
            &five,
            0.01,
            seeds,
            which,
        );
        let model = &picker_asymmetric::PickerAsymmetric;
        study(
            "five-bar, friction by direction",
            model,
            &five,
            0.01,
            seeds,
            which,
        );
        let gains = [[300.0, 12.0], [60.0, 1.5]];
        study("arm", &arm::Arm, &gains, 0.05, seeds, which);
    }
}
