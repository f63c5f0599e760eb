//! Estimates and signals compared with the vectors that tests/tools/vectors/estimation.py wrote.

use regen_identify::estimate::{
    Accumulator, Autocorrelated, Estimate, Origin, QrFactor, Residuals, Weighting,
};
use regen_identify::signals::{Butterworth, Method};
use serde_json::Value;

/// Both sides are computed in doubles from systems with condition numbers up to 1e6.
const TOLERANCE: f64 = 1e-9;

fn vectors() -> Value {
    serde_json::from_str(include_str!(
        "../../../../tests/fixtures/computed/estimation.json"
    ))
    .unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    let list = value.as_array().unwrap().iter();
    list.map(|x| x.as_f64().unwrap()).collect()
}

/// Entries agree relative to the largest of the vector.
#[track_caller]
fn assert_near(got: &[f64], expected: &[f64]) {
    assert_eq!(got.len(), expected.len());
    let size = expected.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    for (k, (a, b)) in got.iter().zip(expected).enumerate() {
        assert!((a - b).abs() <= TOLERANCE * size, "entry {k}: {a} and {b}");
    }
}

/// Each entry agrees relative to itself.
#[track_caller]
fn assert_each(got: &[f64], expected: &[f64]) {
    for (a, b) in got.iter().zip(expected) {
        assert_near(&[*a], &[*b]);
    }
    assert_eq!(got.len(), expected.len());
}

#[test]
fn least_squares_and_its_statistics_are_those_of_numpy() {
    let all = vectors();
    let v = &all["least_squares"];
    let (w, tau) = (numbers(&v["w"]), numbers(&v["tau"]));
    let (rows, n) = (tau.len(), w.len() / tau.len());
    let labels: Vec<String> = (0..n).map(|k| format!("p{k}")).collect();
    let mut factor = QrFactor::new(labels);
    factor.push_block(&w, &tau).unwrap();
    let estimate = Estimate::of(&factor).unwrap();
    assert_each(&estimate.values, &numbers(&v["solution"]));
    // entries of the covariance, relative to the two standard deviations they belong to
    let covariance = numbers(&v["covariance"]);
    let relative = |c: &[f64]| -> Vec<f64> {
        let d = |k: usize| covariance[k * n + k].sqrt();
        c.iter()
            .enumerate()
            .map(|(k, c)| c / d(k / n) / d(k % n))
            .collect()
    };
    assert_near(&relative(&estimate.covariance), &relative(&covariance));
    let spectrum = factor.spectrum().unwrap();
    assert_near(&spectrum.raw, &numbers(&v["singular_values"]));
    assert_each(&spectrum.scaled, &numbers(&v["scaled_singular_values"]));
    let quantile = v["quantile"].as_f64().unwrap();
    assert_each(
        &[estimate.half_width(0, 0.95) / estimate.sigma(0)],
        &[quantile],
    );

    let bandwidth = usize::try_from(v["bandwidth"].as_u64().unwrap()).unwrap();
    let mean = tau.iter().sum::<f64>() / rows as f64;
    let mut residuals = Residuals::new(&["tau".to_owned()], &[mean], 10);
    let mut correlated = Autocorrelated::new(n, bandwidth);
    for (t, tau) in tau.iter().enumerate() {
        let row: Vec<f64> = (0..n).map(|j| w[j * rows + t]).collect();
        let predicted: f64 = row.iter().zip(&estimate.values).map(|(w, x)| w * x).sum();
        residuals.push(&[*tau], &[predicted]).unwrap();
        let score: Vec<f64> = row.iter().map(|w| w * (tau - predicted)).collect();
        correlated.push(&score).unwrap();
    }
    let errors = &residuals.efforts()[0];
    assert_each(&errors.autocorrelation, &numbers(&v["autocorrelation"]));
    assert_each(&[errors.whiteness_p_value], &[v["white"].as_f64().unwrap()]);
    let relative_absolute = v["relative_absolute"].as_f64().unwrap();
    assert_each(&[errors.relative_absolute], &[relative_absolute]);
    assert_each(&[residuals.relative_absolute()], &[relative_absolute]);
    let newey_west = correlated.covariance(&factor).unwrap();
    assert_near(
        &relative(&newey_west),
        &relative(&numbers(&v["newey_west"])),
    );
}

#[test]
fn weights_converge_to_the_noise_of_each_effort() {
    let all = vectors();
    let v = &all["weighted"];
    let labels: Vec<String> = (0..4).map(|k| format!("p{k}")).collect();
    let mut rows = Accumulator::new(&Origin {
        robot: "none".to_owned(),
        model: String::new(),
        kind: "forces".to_owned(),
        efforts: vec!["quiet".to_owned(), "loud".to_owned()],
        labels,
    });
    for effort in 0..2 {
        let (w, tau) = (numbers(&v["w"][effort]), numbers(&v["tau"][effort]));
        for (t, tau_t) in tau.iter().enumerate() {
            rows.push(effort, &w[t..], tau.len(), *tau_t, 1.0).unwrap();
        }
    }
    let set = rows.finish().unwrap();
    let estimate = Estimate::new(&set, Weighting::PerEffort).unwrap();
    assert_each(&estimate.values, &numbers(&v["solution"]));
    let sigmas: Vec<f64> = estimate.efforts.iter().map(|e| e.sigma).collect();
    assert_each(&sigmas, &numbers(&v["sigmas"]));
}

#[test]
fn zero_phase_filters_are_those_of_scipy() {
    let all = vectors();
    let v = &all["filters"];
    let x = numbers(&v["x"]);
    for row in v["filtered"].as_array().unwrap() {
        let order = usize::try_from(row["order"].as_u64().unwrap()).unwrap();
        let filter = Butterworth::new(order, row["cutoff"].as_f64().unwrap(), 0.004).unwrap();
        assert_near(&filter.zero_phase(&x).unwrap(), &numbers(&row["y"]));
    }
    let filter = Butterworth::new(2, 8.0, 0.004).unwrap();
    assert_near(
        &filter.zero_phase(&x).unwrap(),
        &numbers(&v["filtfilt_2_8"]),
    );
}

#[test]
fn fits_are_those_of_numpy() {
    let all = vectors();
    let v = &all["fits"];
    let (t, x) = (numbers(&v["t"]), numbers(&v["x"]));
    let fourier = Method::Fourier {
        frequency: v["frequency"].as_f64().unwrap(),
        harmonics: usize::try_from(v["harmonics"].as_u64().unwrap()).unwrap(),
    };
    let fit = fourier.differentiate(&t, &x).unwrap();
    for (k, got) in [fit.value, fit.rate, fit.acceleration].iter().enumerate() {
        assert_near(got, &numbers(&v["fourier"][k]));
    }
    let half_width = v["half_width"].as_f64().unwrap();
    let fit = Method::Local { half_width }.differentiate(&t, &x).unwrap();
    let mut compared = 0;
    for (k, row) in v["local"].as_array().unwrap().iter().enumerate() {
        assert_eq!(row.is_null(), !fit.valid.contains(&k), "sample {k}");
        if !row.is_null() {
            let row = numbers(row);
            // a second derivative over a window of 0.4 s magnifies rounding
            assert_near(&[fit.value[k], fit.rate[k], fit.acceleration[k]], &row);
            compared += 1;
        }
    }
    assert!(compared > 100);
}
