//! The residuals of a window: measured minus simulated signals, with their derivatives.

use regen_identify::estimate::{EstimateError, QrFactor};

use crate::control::Sensitive;
use crate::parameters::{Entry, Unknowns};
use crate::setup::{Run, SignalKind};
use crate::window::Trace;

/// The residuals of one signal in a window.
#[derive(Clone, Debug, Default)]
pub(crate) struct SignalRows {
    /// The rows of the window that gave a residual, from its first row.
    pub(crate) rows: Vec<usize>,
    /// The measured values.
    pub(crate) measured: Vec<f64>,
    /// Measured minus simulated.
    pub(crate) values: Vec<f64>,
    /// The derivatives of the simulated values, rows x unknowns, column by column.
    pub(crate) slopes: Vec<f64>,
}

/// The signals of a run that are measured: their kinds and their values.
pub(crate) fn measured(run: &Run) -> impl Iterator<Item = (SignalKind, &[f64])> {
    let positions = run.positions.iter();
    let positions = positions.map(|(c, x)| (SignalKind::Position(*c), x.as_slice()));
    let velocities = run.velocities.iter();
    positions.chain(velocities.map(|(c, x)| (SignalKind::Velocity(*c), x.as_slice())))
}

/// The residuals of a signal in a window.
///
/// - `values`: of the whole run; `own`: the number of the window's own unknowns;
/// - `margin`: where the delay is estimated, how many seconds at both ends are left out.
pub(crate) fn of_signal(
    trace: &Trace,
    kind: SignalKind,
    [times, values]: [&[f64]; 2],
    [delay, gain, bias]: [Entry; 3],
    own: usize,
    margin: f64,
) -> SignalRows {
    let (coordinate, rate) = match kind {
        SignalKind::Position(c) | SignalKind::Command(c) => (c, false),
        SignalKind::Velocity(c) => (c, true),
    };
    let simulated = trace.coordinates.iter().find(|(c, _)| *c == coordinate);
    let Some((_, samples)) = simulated else {
        return SignalRows::default();
    };
    let unknowns = samples.first().map_or(0, |[p, _]| p.rates.len());
    let (Some(first), Some(last)) = (times.first(), times.last()) else {
        return SignalRows::default();
    };
    let delayed = delay.column.is_some() || delay.value != 0.0;
    let inside = if delay.column.is_some() {
        margin
    } else {
        delay.value.abs()
    };
    let mut out = SignalRows::default();
    let mut lines: Vec<Vec<f64>> = Vec::new();
    for (row, ((time, value), sample)) in times.iter().zip(values).zip(samples).enumerate() {
        let (x, slope) = if delayed {
            if time - first < inside || last - time < inside {
                continue;
            }
            between(times, samples, time - delay.value, rate)
        } else {
            let [position, velocity] = sample;
            let own = if rate { velocity } else { position };
            (own.clone(), 0.0)
        };
        out.rows.push(row);
        out.measured.push(*value);
        out.values.push(value - gain.value * x.value - bias.value);
        let mut line: Vec<f64> = x.rates.iter().map(|r| gain.value * r).collect();
        for (entry, rate) in [(delay, -gain.value * slope), (gain, x.value), (bias, 1.0)] {
            if let Some(slot) = entry.column.and_then(|c| line.get_mut(own + c)) {
                *slot += rate;
            }
        }
        lines.push(line);
    }
    out.slopes = (0..unknowns)
        .flat_map(|k| lines.iter().map(move |line| line[k]))
        .collect();
    out
}

/// A position, or with `rate` a velocity, between samples, and its derivative by time: Hermite's
/// cubic through positions and velocities on both sides.
fn between(times: &[f64], samples: &[[Sensitive; 2]], at: f64, rate: bool) -> (Sensitive, f64) {
    let next = times.partition_point(|t| *t <= at);
    let next = next.clamp(1, samples.len().saturating_sub(1).max(1));
    let (Some([p0, v0]), Some([p1, v1])) = (samples.get(next - 1), samples.get(next)) else {
        let only = samples.first().cloned().unwrap_or_default();
        let [position, velocity] = only;
        return (if rate { velocity } else { position }, 0.0);
    };
    let h = times[next] - times[next - 1];
    let s = (at - times[next - 1]) / h;
    // the polynomials of both positions and both velocities, and their first two derivatives
    let zeroth = [
        (1.0 + 2.0 * s) * (1.0 - s) * (1.0 - s),
        s * s * (3.0 - 2.0 * s),
        s * (1.0 - s) * (1.0 - s) * h,
        s * s * (s - 1.0) * h,
    ];
    let first = [
        6.0 * s * (s - 1.0) / h,
        6.0 * s * (1.0 - s) / h,
        (1.0 - s) * (1.0 - 3.0 * s),
        s * (3.0 * s - 2.0),
    ];
    let second = [
        (12.0 * s - 6.0) / (h * h),
        (6.0 - 12.0 * s) / (h * h),
        (6.0 * s - 4.0) / h,
        (6.0 * s - 2.0) / h,
    ];
    let (own, slopes) = if rate {
        (first, second)
    } else {
        (zeroth, first)
    };
    let parts = [p0, p1, v0, v1];
    let mut out = Sensitive::constant(0.0, p0.rates.len());
    for (part, factor) in parts.iter().zip(own) {
        out.add(part, factor);
    }
    let slope = parts.iter().zip(slopes).map(|(p, f)| p.value * f).sum();
    (out, slope)
}

/// The data that the computation of residuals shares for all windows.
pub(crate) struct Common<'a> {
    pub(crate) kinds: &'a [SignalKind],
    pub(crate) unknowns: &'a Unknowns,
    /// The values of the unknowns.
    pub(crate) shared: &'a [f64],
    /// The number of the windows' own unknowns.
    pub(crate) own: usize,
    /// How many seconds at both ends are left out where a delay is estimated.
    pub(crate) margin: f64,
}

/// All residuals of a window, signal by signal in the order of `kinds`.
pub(crate) fn of_window(
    trace: &Trace,
    run: &Run,
    rows: &core::ops::Range<usize>,
    common: &Common<'_>,
) -> Vec<SignalRows> {
    let of = |kind: &SignalKind| {
        let own_values = measured(run).find(|(k, _)| k == kind);
        let Some((_, values)) = own_values else {
            return SignalRows::default();
        };
        let cut = |all: &[f64]| all.get(rows.clone()).unwrap_or_default().to_vec();
        let (times, values) = (cut(&run.times), cut(values));
        let entries = common.unknowns.signal(*kind, common.shared);
        let signal = [&times[..], &values];
        of_signal(trace, *kind, signal, entries, common.own, common.margin)
    };
    common.kinds.iter().map(of).collect()
}

/// The QR factor of a signal's residuals.
pub(crate) fn factor(rows: &SignalRows, labels: &[String]) -> Result<QrFactor, EstimateError> {
    let mut out = QrFactor::new(labels.to_vec());
    out.push_block(&rows.slopes, &rows.values)?;
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cubic and its rate by time; the window's own unknown is its factor, and three are shared.
    fn cubic(t: f64) -> [Sensitive; 2] {
        let value = 2.0 - t + 0.5 * t * t + 3.0 * t * t * t;
        let rate = -1.0 + t + 9.0 * t * t;
        [value, rate].map(|value| Sensitive {
            value,
            rates: vec![value, 0.0, 0.0, 0.0],
        })
    }

    #[test]
    fn cubics_between_samples_are_exact_with_their_rates_and_derivatives() {
        // uneven steps
        let times = [0.0, 0.3, 0.4, 1.0];
        let samples = times.map(cubic);
        for at in [0.05, 0.3, 0.37, 0.61, 0.99] {
            let [position, velocity] = cubic(at);
            let second = 1.0 + 18.0 * at;
            for (rate, wanted, slope) in [
                (false, &position, velocity.value),
                (true, &velocity, second),
            ] {
                let (found, by_time) = between(&times, &samples, at, rate);
                assert!((found.value - wanted.value).abs() < 1e-12, "{at} {rate}");
                assert!((found.rates[0] - wanted.rates[0]).abs() < 1e-12);
                assert!((by_time - slope).abs() < 1e-11, "{at} {rate}");
            }
        }
    }

    #[test]
    fn residuals_change_with_delay_gain_and_bias_as_their_derivatives_say() {
        let times: Vec<f64> = (0..30).map(|k| 0.1 * f64::from(k)).collect();
        let samples: Vec<[Sensitive; 2]> = times.iter().map(|t| cubic(*t)).collect();
        let trace = Trace {
            coordinates: vec![(4, samples)],
        };
        // measured as the signal says: no residual is left
        let [delay, gain, bias] = [0.07, 1.5, -0.4];
        for kind in [SignalKind::Position(4), SignalKind::Velocity(4)] {
            let place = usize::from(kind == SignalKind::Velocity(4));
            let measured: Vec<f64> = times
                .iter()
                .map(|t| gain * cubic(t - delay)[place].value + bias)
                .collect();
            let at = |values: [f64; 3]| {
                let mut column = 0..;
                let entries = values.map(|value| Entry {
                    value,
                    column: column.next(),
                });
                of_signal(&trace, kind, [&times, &measured], entries, 1, 0.25)
            };
            let known = at([delay, gain, bias]);
            // 0.25 s at both ends are left out
            assert_eq!(known.rows, (3..27).collect::<Vec<_>>());
            assert!(known.values.iter().all(|r| r.abs() < 1e-10), "{known:?}");
            let rows = known.rows.len();
            let h = 1e-4;
            for k in 0..3 {
                let moved = |by: f64| {
                    let mut values = [delay, gain, bias];
                    values[k] += by;
                    at(values).values
                };
                let slopes = &known.slopes[(1 + k) * rows..(2 + k) * rows];
                for ((more, less), slope) in moved(h).iter().zip(moved(-h)).zip(slopes) {
                    // of the simulated values, which the residuals have with a negative sign
                    let found = (less - more) / (2.0 * h);
                    assert!((found - slope).abs() < 1e-5 * (1.0 + slope.abs()), "{k}");
                }
            }
        }
    }
}
