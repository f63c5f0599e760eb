//! A run as the CSV file that `regen identify` reads.

use std::fmt::Write as _;

use regen_experiment::simulate::{Log, Noise, Settings};
use regen_runtime::Info;

use super::args::SimulateArgs;

/// The log's text: measured values, or with `--exact` all that there is.
pub(super) fn csv(args: &SimulateArgs, info: &Info<'_>, log: &Log, settings: &Settings) -> String {
    let name = |k: usize| info.coordinates.get(k).copied().unwrap_or("?");
    let (n, a) = (info.coordinates.len(), info.actuated.len());
    let passive: Vec<usize> = if args.exact {
        Vec::new()
    } else {
        // coordinates that loops do not give are measured too, as the others are
        let all = info.independent.iter().copied();
        all.filter(|c| !info.actuated.contains(c)).collect()
    };
    let mut text = "t".to_owned();
    if args.exact {
        for prefix in ["", "qd_", "qdd_"] {
            for k in 0..n {
                let _ = write!(text, ",{prefix}{}", name(k));
            }
        }
    } else {
        for k in info.actuated.iter().chain(&passive) {
            let _ = write!(text, ",{}", name(*k));
        }
    }
    for k in info.actuated {
        let _ = write!(text, ",tau_{}", name(*k));
    }
    text.push('\n');

    // apart from the seeds of the runs themselves
    let mut noise = Noise::new(settings.seed ^ (1 << 63));
    for (row, t) in log.t.iter().enumerate() {
        let of = |values: &[f64], width: usize| {
            let values = values.iter().skip(row * width).take(width);
            values.copied().collect::<Vec<f64>>()
        };
        let q = of(&log.q, n);
        let mut values = if args.exact {
            [q, of(&log.qd, n), of(&log.qdd, n), of(&log.effort, a)].concat()
        } else {
            let mut values = of(&log.measured_position, a);
            for k in &passive {
                let truth = q.get(*k).copied().unwrap_or(f64::NAN);
                values.push(settings.sensors.position(truth, &mut noise));
            }
            values.extend(of(&log.measured_effort, a));
            values
        };
        // the half step keeps a sample at its end
        if *t + 0.5 * settings.period < args.settle {
            continue;
        }
        values.insert(0, t - args.settle);
        for (k, value) in values.iter().enumerate() {
            let comma = if k == 0 { "" } else { "," };
            let _ = write!(text, "{comma}{value}");
        }
        text.push('\n');
    }
    text
}
