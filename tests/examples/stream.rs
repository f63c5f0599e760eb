//! Streams a measured log row by row through the payload's estimate of `regen-control`, with a
//! robot and its gains that `regen identify --out` wrote from other rows:
//!
//! ```text
//! cargo run --release -p regen-tests --features examples --example stream -- \
//!     SPEC IDENTIFIED.json UNLOADED.csv LOADED.csv START [BANDWIDTH [DELAY]]
//! ```
//!
//! UNLOADED up to START tells how far each effort is off; LOADED from START on is streamed. Prints
//! mass and centre after every two seconds. Efforts are the columns 14 and on, currents at the
//! identified gains; velocities are the columns `qd_` of each joint.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout)]

use regen_codegen::diag::Source;
use regen_codegen::pipeline::derive;
use regen_control::{Observer, Payload, Sample, Settings};
use regen_interpreted::BaseTerms;
use regen_runtime::{BaseModel, ControlModel, Model};
use serde_json::Value;

/// Efforts, and the column of the first.
const D: usize = 6;
const FIRST_EFFORT: usize = 13;

struct Row {
    t: f64,
    q: [f64; D],
    qd: [f64; D],
    effort: [f64; D],
}

fn rows(path: &str, names: &[&str], gains: &[f64; D]) -> Vec<Row> {
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let place = |name: &str| header.iter().position(|h| *h == name).unwrap();
    let q: Vec<usize> = names.iter().map(|name| place(name)).collect();
    let qd: Vec<usize> = names
        .iter()
        .map(|name| place(&format!("qd_{name}")))
        .collect();
    lines
        .map(|line| {
            let row: Vec<f64> = line.split(',').map(|x| x.parse().unwrap()).collect();
            Row {
                t: row[0],
                q: std::array::from_fn(|d| row[q[d]]),
                qd: std::array::from_fn(|d| row[qd[d]]),
                effort: std::array::from_fn(|d| gains[d] * row[FIRST_EFFORT + d]),
            }
        })
        .collect()
}

/// Columns of a body, or a sum of columns times values.
fn pick(columns: &[f64], from: usize) -> [[f64; D]; 10] {
    std::array::from_fn(|k| std::array::from_fn(|d| columns[(from + k) * D + d]))
}

fn sum(columns: &[f64], values: &[f64]) -> [f64; D] {
    std::array::from_fn(|d| {
        values
            .iter()
            .enumerate()
            .map(|(k, v)| v * columns[k * D + d])
            .sum()
    })
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [spec, identified, unloaded, loaded, start, rest @ ..] = &words[..] else {
        panic!("see the head of this file");
    };
    let number = |k: usize, or: f64| {
        rest.get(k)
            .map_or(or, |word: &String| word.parse().unwrap())
    };
    let (start, bandwidth, delay) = (
        start.parse::<f64>().unwrap(),
        number(0, 6.0),
        number(1, 0.0),
    );
    let text = std::fs::read_to_string(spec).unwrap() + "\ncontrol: true\n";
    let robot = derive(&Source::new(spec, &text)).unwrap();
    let terms = BaseTerms::new(&robot);
    let model = regen_interpreted::Interpreted::with_terms(&robot, &terms);
    let info = Model::<f64>::info(&model);
    let found: Value = serde_json::from_str(&std::fs::read_to_string(identified).unwrap()).unwrap();
    // base parameters of the robot stand at their first parameters, all others are zero
    let labels: Vec<String> = info.parameters.iter().map(ToString::to_string).collect();
    let load = labels
        .iter()
        .position(|label| label == "Ixx(load)")
        .unwrap();
    let mut phi = vec![0.0; labels.len()];
    for row in found["parameters"].as_array().unwrap() {
        let label = row["label"].as_str().unwrap();
        let place = labels.iter().position(|known| known == label).unwrap();
        if !(load..load + 10).contains(&place) {
            phi[place] = row["value"].as_f64().unwrap();
        }
    }
    assert_eq!(BaseModel::<f64>::zeros(&model).len(), 0);
    let gains: [f64; D] = std::array::from_fn(|d| found["gains"][d]["value"].as_f64().unwrap());
    let names: Vec<&str> = info
        .independent
        .iter()
        .map(|k| info.coordinates[*k])
        .collect();

    let stream = |rows: &[Row],
                  payload: &mut Payload<f64, D>,
                  squares: &mut [f64; D],
                  show: bool| {
        let period = rows[1].t - rows[0].t;
        let mut count = 0_u32;
        // whole periods of the delay
        let shift = (0..100_u32)
            .take_while(|n| f64::from(n + 1) * period <= delay)
            .count();
        let shift = u32::try_from(shift).unwrap();
        let (mut momentum, mut rate) = (vec![0.0; D * labels.len()], vec![0.0; D * labels.len()]);
        let mut known = Observer::<f64, D>::new(bandwidth, period).unwrap();
        for (k, row) in rows.iter().enumerate() {
            let _ = model
                .momentum_regressor(&row.q, &row.qd, &mut momentum)
                .unwrap();
            let _ = model
                .momentum_rate_regressor(&row.q, &row.qd, &mut rate)
                .unwrap();
            // the mean of the effort since the last row, `delay` later than the motion
            let (whole, part) = (shift as usize, delay / period - f64::from(shift));
            let at = |k: usize| -> [f64; D] {
                let effort = |k: usize| rows[k.min(rows.len() - 1)].effort;
                let (before, after) = (effort(k + whole), effort(k + whole + 1));
                std::array::from_fn(|d| before[d] * (1.0 - part) + after[d] * part)
            };
            let (now, last) = (at(k), at(k.saturating_sub(1)));
            let effort: [f64; D] = std::array::from_fn(|d| 0.5 * (now[d] + last[d]));
            let (p, n) = (sum(&momentum, &phi), sum(&rate, &phi));
            let _ = known.update(&p, &n, &effort);
            for (square, force) in squares.iter_mut().zip(known.force()) {
                *square += force * force;
            }
            count += 1;
            let body = (pick(&momentum, load), pick(&rate, load));
            let sample = payload.update((&p, &n), (&body.0, &body.1), &effort);
            assert_ne!(sample, Sample::Refused, "row {k}");
            let since = period * k as f64;
            if show
                && k > 0
                && k % 200 == 0
                && let Some(load) = payload.load()
            {
                println!(
                    "{since:5.1} s: {:.4} kg (sigma {:.4}), centre {:.4} {:.4} {:.4} m (sigma {:.4} {:.4} {:.4})",
                    load.mass,
                    load.mass_deviation,
                    load.centre[0],
                    load.centre[1],
                    load.centre[2],
                    load.centre_deviation[0],
                    load.centre_deviation[1],
                    load.centre_deviation[2]
                );
            }
        }
        for square in squares.iter_mut() {
            *square = (*square / f64::from(count)).sqrt();
        }
    };
    let settings = |period: f64| Settings {
        bandwidth,
        block: 1.0,
        ..Settings::new(period)
    };
    let before = rows(unloaded, &names, &gains);
    let before: Vec<Row> = before.into_iter().filter(|row| row.t < start).collect();
    let period = before[1].t - before[0].t;
    let mut off = [0.0; D];
    let mut without = Payload::new(&settings(period), &[1.0; D], 10.0, 0.5).unwrap();
    stream(&before, &mut without, &mut off, false);
    println!(
        "efforts are off by {off:.3?} N m; without load {:.4?}",
        without.load()
    );
    let after = rows(loaded, &names, &gains);
    let after: Vec<Row> = after.into_iter().filter(|row| row.t >= start).collect();
    let mut payload = Payload::new(&settings(period), &off, 10.0, 0.5).unwrap();
    stream(&after, &mut payload, &mut [0.0; D], true);
    let physical = payload.physical(100, 1e-3).unwrap();
    println!("physical: {:?}", payload.at(&physical.values));
}
