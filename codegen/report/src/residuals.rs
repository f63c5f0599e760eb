//! What is left of the efforts: its spectrum, delays, and the samples that were not used.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use regen_identify::data::Run;
use regen_identify::identify::{Delay, Delays};
use regen_identify::session::{Session, from_logs};
use regen_identify::text;
use regen_interpreted::Interpreted;
use regen_runtime::Motion;

use crate::ReportError;
use crate::charts::{self, Figure, GREY, Line, Look, ORANGE};
use crate::figures::slug;
use crate::gather::{Errors, LogRows};
use crate::identified::Content;
use crate::page::{escaped, figure, section, table};

/// The largest number of samples of a segment; spectra of segments are averaged.
const SEGMENT: usize = 1024;
/// The largest number of frequencies of a spectrum.
const MAX_FREQUENCIES: usize = 240;
/// The least number of samples of a spectrum.
const MIN_SAMPLES: usize = 32;
/// The part of the power of efforts and residuals that may be beyond the shown frequencies.
const HIDDEN_PART: f64 = 1e-3;

/// The mean amplitude density of samples at equal distances, by Welch's method: segments that
/// overlap by half, without their means, under Hann's window.
///
/// - `step`: the distance of samples, s.
///
/// Returns frequencies in Hz with densities in the samples' unit per square root of Hz.
fn density(values: &[f64], step: f64) -> Vec<(f64, f64)> {
    let length = SEGMENT.min(values.len());
    if length < MIN_SAMPLES || !(step > 0.0 && step.is_finite()) {
        return Vec::new();
    }
    let window: Vec<f64> = (0..length)
        .map(|k| 0.5 - 0.5 * libm::cos(TAU * k as f64 / length as f64))
        .collect();
    let weight: f64 = window.iter().map(|w| w * w).sum();
    let stride = (length / 2).div_ceil(MAX_FREQUENCIES);
    let mut power = vec![0.0; (length / 2) / stride];
    let starts = (0..=values.len() - length).step_by(length / 2);
    let mut segments = 0.0;
    for start in starts {
        let part = values.get(start..start + length).unwrap_or(&[]);
        let mean = part.iter().sum::<f64>() / length as f64;
        let shaped: Vec<f64> = part
            .iter()
            .zip(&window)
            .map(|(x, w)| (x - mean) * w)
            .collect();
        for (k, sum) in power.iter_mut().enumerate() {
            *sum += squared(&shaped, ((k + 1) * stride) as f64 / length as f64);
        }
        segments += 1.0;
    }
    let of = |(k, sum): (usize, f64)| {
        let frequency = ((k + 1) * stride) as f64 / (length as f64 * step);
        (frequency, (2.0 * step * sum / (weight * segments)).sqrt())
    };
    power.into_iter().enumerate().map(of).collect()
}

/// The squared size of a Fourier coefficient, by Goertzel's recursion.
///
/// - `frequency`: in periods per sample.
fn squared(values: &[f64], frequency: f64) -> f64 {
    let twice = 2.0 * libm::cos(TAU * frequency);
    let (mut one, mut two) = (0.0, 0.0);
    for x in values {
        (one, two) = (x + twice * one - two, one);
    }
    one * one + two * two - twice * one * two
}

/// The spectra of each effort and of what is left of it, up to the frequency that contains nearly
/// all of both; none for logs with few samples.
pub(super) fn spectra(model: &Interpreted<'_>, seen: &LogRows) -> Result<Vec<Figure>, ReportError> {
    let info = model.info();
    let dof = info.dof();
    let times = seen.times();
    let span = times.last().zip(times.first()).map_or(0.0, |(b, a)| b - a);
    let step = span / times.len().saturating_sub(1).max(1) as f64;
    let mut figures = Vec::new();
    for (k, c) in info.independent.iter().enumerate() {
        let own = |values: &[f64]| -> Vec<f64> {
            values.iter().skip(k).step_by(dof.max(1)).copied().collect()
        };
        let (measured, predicted) = (own(&seen.tau), own(&seen.predicted));
        let left: Vec<f64> = measured
            .iter()
            .zip(&predicted)
            .map(|(a, b)| a - b)
            .collect();
        let curves = [density(&measured, step), density(&left, step)];
        let last = curves.iter().map(|curve| shown(curve)).max().unwrap_or(0);
        if last == 0 {
            continue;
        }
        let name = info.coordinates.get(*c).copied().unwrap_or("?");
        let joint = info.joints.get(*c);
        let shift = joint.is_some_and(|j| j.motion == Motion::Translation);
        let looks = [("measured effort", GREY), ("residual", ORANGE)];
        let lines: Vec<Line> = (curves.iter().zip(looks))
            .map(|(curve, (label, dye))| Line {
                label: label.to_owned(),
                points: decibels(curve.get(..last).unwrap_or(curve)),
                dye,
                look: Look::Solid,
            })
            .collect();
        let unit = if shift { "N" } else { "N m" };
        figures.push(Figure {
            name: format!("spectrum-{}", slug(name)),
            caption: format!(
                "amplitude density of the effort of {name} over {}, and of what is left of it, in \
                 decibels of 1 {unit}/√Hz",
                seen.file
            ),
            svg: charts::lines("frequency, Hz", "density, dB", 220, &lines)?,
        });
    }
    Ok(figures)
}

/// The number of frequencies that contain all but a small part of a curve's power.
fn shown(curve: &[(f64, f64)]) -> usize {
    let power = |(_, density): &(f64, f64)| density * density;
    let all: f64 = curve.iter().map(power).sum();
    let mut beyond = all;
    let inside = curve.iter().take_while(|point| {
        beyond -= power(point);
        beyond > HIDDEN_PART * all
    });
    // some more show how the curve goes on
    (inside.count() * 3 / 2 + 2).min(curve.len())
}

fn decibels(curve: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let known = curve.iter().filter(|(_, density)| *density > 0.0);
    known
        .map(|(f, density)| (*f, 20.0 * libm::log10(*density)))
        .collect()
}

/// The delays of efforts behind the motion, estimated with the base parameters; `None` where this
/// estimate does not apply to the logs.
pub(super) fn delays(session: &Session<'_, Interpreted<'_>>, logs: &[Run]) -> Option<Delays> {
    let mut logs = session.open(logs).ok()?;
    let start = from_logs(session, &mut logs).ok()?;
    (!start.delays.efforts.is_empty()).then_some(start.delays)
}

/// The section of the page.
pub(super) fn html(report: &Content<'_>) -> String {
    let mut out = String::new();
    if let Some(delays) = &report.delays {
        let one = |delay: &Delay| {
            let [size, sigma] = [delay.seconds, delay.sigma].map(|s| text::figure(1e3 * s));
            let beyond = if delay.is_significant() {
                ", beyond its error"
            } else {
                ""
            };
            format!("{size} ms (σ {sigma} ms{beyond})")
        };
        let all = delays.efforts.iter();
        let all = all.map(|delay| format!("{}: {}", escaped(&delay.effort), one(delay)));
        let all: Vec<String> = all.collect();
        let _ = writeln!(
            out,
            "<p>Delay of the efforts behind the motion, estimated with the base parameters: {}.</p>",
            all.join("; ")
        );
    }
    let rows: Vec<Vec<String>> = report.errors.iter().map(left_out).collect();
    let caption = "Samples: used ones gave equations; singular ones have no reduced efforts; \
                   unsettled ones are at the ends of filtered runs; resting are equations of \
                   efforts whose joints stood still";
    let head = ["log", "used", "singular", "unsettled", "resting"];
    out.push_str(&table(caption, &head, &rows));
    report
        .residuals
        .iter()
        .for_each(|f| out.push_str(&figure(f)));
    section("residuals", "Residuals", &out)
}

fn left_out(errors: &Errors) -> Vec<String> {
    let left = &errors.left_out;
    let counts = [
        left.samples,
        left.singular,
        left.unsettled,
        left.resting.iter().sum(),
    ];
    let counts = counts.iter().map(ToString::to_string);
    std::iter::once(escaped(&errors.file))
        .chain(counts)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sine of amplitude `a` and `noise` times numbers that look random, every 5 ms.
    fn signal(a: f64, frequency: f64, noise: f64) -> Vec<f64> {
        let mut state = 1_u64;
        let mut random = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        let of = |k: u32| a * libm::sin(TAU * frequency * 0.005 * f64::from(k));
        (0..8192).map(|k| of(k) + noise * random()).collect()
    }

    #[test]
    fn the_density_of_noise_is_its_deviation_over_the_root_of_the_band() {
        // uniform numbers of width 1 have the variance 1/12, spread over 100 Hz
        let curve = density(&signal(0.0, 1.0, 1.0), 0.005);
        let mean = curve.iter().map(|(_, d)| d * d).sum::<f64>() / curve.len() as f64;
        assert!((mean * 100.0 * 12.0 - 1.0).abs() < 0.1, "{mean}");
        assert!(curve.iter().all(|(f, _)| *f > 0.0 && *f <= 100.0));
    }

    #[test]
    fn a_sine_stands_at_its_frequency() {
        let curve = density(&signal(3.0, 12.5, 0.01), 0.005);
        let most = curve.iter().max_by(|a, b| a.1.total_cmp(&b.1));
        assert!(
            most.is_some_and(|(f, _)| (f - 12.5).abs() < 0.7),
            "{most:?}"
        );
        let last = curve.get(shown(&curve) - 1).map_or(0.0, |point| point.0);
        assert!(last > 13.0 && last < 30.0, "{last}");
    }

    #[test]
    fn few_or_equal_samples_have_no_spectrum() {
        assert_eq!(density(&[1.0; MIN_SAMPLES - 1], 0.01), []);
        assert_eq!(density(&[1.0; 100], 0.0), []);
        assert_eq!(decibels(&density(&[0.0; 100], 0.01)), []);
    }
}
