//! Properties of factors, estimates and signals.

use regen_identify::estimate::{
    Accumulator, Estimate, EstimateError, FactorSet, Origin, QrFactor, Weighting,
};
use regen_identify::signals::{Fourier, Method, SignalError};

/// Pseudo-random numbers (SplitMix64), the same on every machine.
struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn signed(&mut self) -> f64 {
        2.0 * self.uniform() - 1.0
    }

    /// A normally distributed number (Box and Muller).
    fn normal(&mut self) -> f64 {
        let (u, v) = (1.0 - self.uniform(), self.uniform());
        (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
    }
}

fn labels(n: usize) -> Vec<String> {
    (0..n).map(|k| format!("p{k}")).collect()
}

/// A block of random rows, and the efforts for the parameters `x` with noise of standard deviation
/// `sigma`.
fn block(random: &mut Random, rows: usize, x: &[f64], sigma: f64) -> (Vec<f64>, Vec<f64>) {
    let w: Vec<f64> = (0..rows * x.len()).map(|_| random.signed()).collect();
    let tau = (0..rows)
        .map(|t| {
            let exact: f64 = x.iter().enumerate().map(|(j, x)| w[j * rows + t] * x).sum();
            exact + sigma * random.normal()
        })
        .collect();
    (w, tau)
}

fn origin(efforts: &[&str], n: usize) -> Origin {
    Origin {
        robot: "none".to_owned(),
        model: "0".to_owned(),
        kind: "forces".to_owned(),
        efforts: efforts.iter().map(|e| (*e).to_owned()).collect(),
        labels: labels(n),
    }
}

#[test]
fn merging_in_any_order_gives_one_factor_of_all_rows() {
    let mut random = Random(1);
    let x = [1.0, -2.0, 0.5, 3.0];
    let mut whole = Accumulator::new(&origin(&["a", "b"], 4));
    let mut parts = Vec::new();
    let mut efforts = [Vec::new(), Vec::new()];
    for rows in [300, 7, 1000, 2, 513] {
        let mut part = Accumulator::new(&origin(&["a", "b"], 4));
        for (effort, sigma) in [(0, 0.1), (1, 1.0)] {
            let (w, tau) = block(&mut random, rows, &x, sigma);
            efforts[effort].extend_from_slice(&tau);
            for (t, tau) in tau.iter().enumerate() {
                part.push(effort, &w[t..], rows, *tau, 1.0).unwrap();
                whole.push(effort, &w[t..], rows, *tau, 1.0).unwrap();
            }
        }
        parts.push(part.finish().unwrap());
    }
    let whole = whole.finish().unwrap();
    for (mean, all) in whole.means().iter().zip(&efforts) {
        let true_mean = all.iter().sum::<f64>() / all.len() as f64;
        assert!((mean - true_mean).abs() < 1e-12, "{mean} {true_mean}");
    }
    let whole = Estimate::new(&whole, Weighting::PerEffort).unwrap();
    let forward = FactorSet::merged(parts.clone()).unwrap();
    parts.reverse();
    parts.swap(1, 3);
    let other = FactorSet::merged(parts).unwrap();
    assert_eq!(forward, other, "the result depends on the order");
    let merged = Estimate::new(&other, Weighting::PerEffort).unwrap();
    for (a, b) in merged.values.iter().zip(&whole.values) {
        assert!((a / b - 1.0).abs() < 1e-12, "{a} {b}");
    }
    for (a, b) in merged.covariance.iter().zip(&whole.covariance) {
        assert!((a - b).abs() < 1e-12 * whole.covariance[0]);
    }
    assert_eq!(merged.degrees_of_freedom, whole.degrees_of_freedom);
    let sigmas: Vec<f64> = merged.efforts.iter().map(|e| e.sigma).collect();
    assert!((sigmas[0] - 0.1).abs() < 0.005 && (sigmas[1] - 1.0).abs() < 0.05);
}

#[test]
fn a_file_of_factors_reads_back_to_the_same_bits_and_mixes_are_refused() {
    let mut random = Random(2);
    let (w, tau) = block(&mut random, 40, &[0.1, 1e9, 1e-9], 1e-3);
    let mut rows = Accumulator::new(&origin(&["a"], 3));
    for (t, tau) in tau.iter().enumerate() {
        rows.push(0, &w[t..], 40, *tau, 1.0 / 3.0).unwrap();
    }
    let set = rows.finish().unwrap();
    let text = set.to_text();
    assert_eq!(FactorSet::from_text(&text).unwrap(), set);
    assert!(FactorSet::from_text(&text.replace("\"version\":1", "\"version\":2")).is_err());
    assert!(FactorSet::from_text(&text.replace("\"rss\":", "\"rss\":-")).is_err());
    assert!(FactorSet::from_text(&text[..text.len() / 2]).is_err());

    for (change, what) in [
        (
            Origin {
                robot: "another".to_owned(),
                ..origin(&["a"], 3)
            },
            "robots",
        ),
        (
            Origin {
                model: "1".to_owned(),
                ..origin(&["a"], 3)
            },
            "models",
        ),
        (
            Origin {
                kind: "energy".to_owned(),
                ..origin(&["a"], 3)
            },
            "kinds of observation",
        ),
        (origin(&["b"], 3), "efforts"),
        (origin(&["a"], 4), "columns"),
    ] {
        let error = FactorSet::merged(vec![set.clone(), FactorSet::new(&change)]).unwrap_err();
        assert!(
            matches!(&error, EstimateError::Mismatch { what: w, .. } if *w == what),
            "{error}"
        );
    }
}

#[test]
fn selecting_tying_and_fixing_columns_is_least_squares_on_the_changed_matrix() {
    let mut random = Random(3);
    let (w, tau) = block(&mut random, 50, &[1.0, 2.0, 3.0], 0.1);
    let columns: Vec<&[f64]> = w.chunks_exact(50).collect();
    let factor = |columns: &[Vec<f64>], tau: &[f64]| {
        let mut f = QrFactor::new(labels(columns.len()));
        f.push_block(&columns.concat(), tau).unwrap();
        f
    };
    let whole = factor(
        &columns.iter().map(|c| c.to_vec()).collect::<Vec<_>>(),
        &tau,
    );
    let same = |a: &QrFactor, b: &QrFactor| {
        let (x, y) = (Estimate::of(a).unwrap(), Estimate::of(b).unwrap());
        for (p, q) in x.values.iter().zip(&y.values) {
            assert!((p - q).abs() < 1e-13, "{p} {q}");
        }
        for (p, q) in x.covariance.iter().zip(&y.covariance) {
            assert!((p - q).abs() < 1e-15, "{p} {q}");
        }
    };
    let chosen = whole.select(&[2, 0]).unwrap();
    assert_eq!(chosen.labels(), ["p2", "p0"]);
    same(
        &chosen,
        &factor(&[columns[2].to_vec(), columns[0].to_vec()], &tau),
    );
    let tied = whole
        .transformed(labels(2), &[1.0, 0.0, 1.0, 0.0, 1.0, 0.0])
        .unwrap();
    let sum: Vec<f64> = columns[0]
        .iter()
        .zip(columns[2])
        .map(|(a, b)| a + b)
        .collect();
    same(&tied, &factor(&[sum, columns[1].to_vec()], &tau));
    let fixed = whole.fixed(&[(1, 2.5)]).unwrap();
    let rest: Vec<f64> = tau
        .iter()
        .zip(columns[1])
        .map(|(t, w)| t - 2.5 * w)
        .collect();
    same(
        &fixed,
        &factor(&[columns[0].to_vec(), columns[2].to_vec()], &rest),
    );
    assert!(whole.select(&[3]).is_err());
    let error = whole.fixed(&[(3, 1.0)]).unwrap_err();
    let size = EstimateError::Size {
        what: "known",
        expected: 3,
        got: 4,
    };
    assert_eq!(error, size);
}

/// The coverage of the intervals, averaged over the parameters: with 6,000 draws its standard
/// deviation is 0.28 %, so a coverage outside of 93 to 97 % is not due to chance.
#[test]
fn confidence_intervals_contain_the_true_values_as_often_as_stated() {
    let mut random = Random(4);
    let x = [1.0, -1.0, 0.3, 10.0, 0.01, 5.0];
    let rows = 25;
    let w: Vec<f64> = (0..rows * x.len()).map(|_| random.signed()).collect();
    let mut covered = [0_u32; 6];
    let mut mean = [0.0; 6];
    let mut own = [0.0; 6];
    for _ in 0..1000 {
        let tau: Vec<f64> = (0..rows)
            .map(|t| {
                let exact: f64 = x.iter().enumerate().map(|(j, x)| w[j * rows + t] * x).sum();
                exact + 0.4 * random.normal()
            })
            .collect();
        let mut factor = QrFactor::new(labels(6));
        factor.push_block(&w, &tau).unwrap();
        let estimate = Estimate::of(&factor).unwrap();
        for j in 0..6 {
            let off = estimate.values[j] - x[j];
            covered[j] += u32::from(off.abs() <= estimate.half_width(j, 0.95));
            mean[j] += off / 1000.0;
            own[j] += estimate.sigma(j).powi(2) / 1000.0;
        }
    }
    for j in 0..6 {
        assert!((930..=970).contains(&covered[j]), "{covered:?}");
        // unbiased: within four standard deviations of the mean of 1,000 estimates
        assert!(mean[j].abs() < 4.0 * (own[j] / 1000.0).sqrt(), "{mean:?}");
    }
}

#[test]
fn undetermined_parameters_are_named() {
    let mut random = Random(5);
    let (mut w, tau) = block(&mut random, 30, &[1.0; 5], 0.0);
    // p3 = 2 p1 in the data
    for t in 0..30 {
        w[90 + t] = 2.0 * w[30 + t];
    }
    let mut factor = QrFactor::new(labels(5));
    factor.push_block(&w, &tau).unwrap();
    let error = factor.solve().unwrap_err();
    match &error {
        EstimateError::Undetermined { rank, labels, .. } => {
            assert_eq!(
                (*rank, labels.as_slice()),
                (4, ["p1".to_owned(), "p3".to_owned()].as_slice())
            );
        }
        other => panic!("{other}"),
    }
    assert!(
        error.to_string().contains("undetermined: p1, p3"),
        "{error}"
    );

    let mut short = QrFactor::new(labels(5));
    short.push_block(&[1.0; 10], &[1.0; 2]).unwrap();
    assert_eq!(
        short.solve(),
        Err(EstimateError::TooShort {
            rows: 2,
            parameters: 5,
            labels: labels(5),
            resting: 0,
        })
    );
    let before = short.clone();
    assert!(short.push_block(&[f64::NAN; 5], &[1.0]).is_err());
    assert!(short.push_block(&[1.0; 5], &[f64::INFINITY]).is_err());
    assert!(short.push_block(&[1.0; 4], &[1.0]).is_err());
    assert_eq!(short, before);
}

/// The chapter's comparison (section 5.1): all methods on the same data.
#[test]
fn all_methods_find_the_same_derivatives_of_a_smooth_motion() {
    let series = Fourier::new(0.5, &[(0.1, vec![0.3, -0.2, 0.1], vec![0.1, 0.2, -0.1])]).unwrap();
    let times: Vec<f64> = (0..2001).map(|k| 0.002 * f64::from(k)).collect();
    let exact: Vec<[f64; 3]> = times.iter().map(|t| series.at(0, *t)).collect();
    let x: Vec<f64> = exact.iter().map(|e| e[0]).collect();
    let size = |d: usize| exact.iter().fold(0.0, |m: f64, e| m.max(e[d].abs()));
    // the methods' own errors: steps of 2 ms, a cutoff 20 times the highest frequency, windows
    // of 0.1 s at a shortest period of 0.67 s; the series is exact
    for (method, bound) in [
        (Method::Central, 1e-4),
        (
            Method::Butterworth {
                order: 4,
                cutoff: 30.0,
            },
            1e-3,
        ),
        (
            Method::Fourier {
                frequency: 0.5,
                harmonics: 3,
            },
            1e-12,
        ),
        (Method::Local { half_width: 0.05 }, 2e-2),
    ] {
        let fit = method.differentiate(&times, &x).unwrap();
        assert!(fit.valid.len() > 1500, "{method:?}: {:?}", fit.valid);
        for k in fit.valid.clone() {
            let found = [fit.value[k], fit.rate[k], fit.acceleration[k]];
            for d in 0..3 {
                let off = (found[d] - exact[k][d]).abs() / size(d);
                assert!(
                    off < bound,
                    "{method:?}, sample {k}, derivative {d}: {off:e}"
                );
            }
        }
    }
}

#[test]
fn a_window_that_reaches_far_enough_gives_the_result_of_the_whole() {
    let times: Vec<f64> = (0..3000).map(|k| 0.01 * f64::from(k)).collect();
    let mut random = Random(6);
    let x: Vec<f64> = times
        .iter()
        .map(|t| t.sin() + 0.01 * random.normal())
        .collect();
    for method in [
        Method::Central,
        Method::Butterworth {
            order: 2,
            cutoff: 5.0,
        },
        Method::Butterworth {
            order: 5,
            cutoff: 3.0,
        },
        Method::Local { half_width: 0.2 },
    ] {
        let support = method.support(0.01).unwrap().unwrap();
        let whole = method.differentiate(&times, &x).unwrap();
        let (from, to) = (1000 - support, 1200 + support);
        let part = method
            .differentiate(&times[from..to], &x[from..to])
            .unwrap();
        for k in 1000..1200 {
            for (a, b) in [
                (&whole.value, &part.value),
                (&whole.rate, &part.rate),
                (&whole.acceleration, &part.acceleration),
            ] {
                let size = a[1000..1200].iter().fold(0.0, |m: f64, x| m.max(x.abs()));
                // differences divide the rounding of the filtered values by the step squared
                let off = (a[k] - b[k - from]).abs();
                assert!(
                    off < 1e-10 * size,
                    "{method:?}, sample {k}: {off:e} of {size}"
                );
            }
        }
    }
}

#[test]
fn signals_that_cannot_be_differentiated_are_refused_with_the_sample() {
    let x = [0.0; 50];
    let mut times: Vec<f64> = (0..50).map(f64::from).collect();
    times[20] = 19.0;
    assert_eq!(
        Method::Central.differentiate(&times, &x),
        Err(SignalError::NotIncreasing { sample: 20 })
    );
    times[20] = 20.5;
    let butterworth = Method::Butterworth {
        order: 2,
        cutoff: 0.1,
    };
    assert!(matches!(
        butterworth.differentiate(&times, &x),
        Err(SignalError::NotUniform { sample: 20, .. })
    ));
    times[20] = f64::NAN;
    assert_eq!(
        Method::Central.differentiate(&times, &x),
        Err(SignalError::NotFinite { sample: 20 })
    );
    assert!(
        Method::Central
            .differentiate(&[0.0, 1.0], &[0.0, 1.0])
            .is_err()
    );
    assert!(Method::Central.differentiate(&[0.0, 1.0], &[0.0]).is_err());
    let times: Vec<f64> = (0..50).map(f64::from).collect();
    for method in [
        Method::Butterworth {
            order: 2,
            cutoff: 0.6,
        },
        Method::Butterworth {
            order: 0,
            cutoff: 0.1,
        },
        Method::Butterworth {
            order: 9,
            cutoff: 0.1,
        },
        Method::Fourier {
            frequency: 1e-5,
            harmonics: 3,
        },
        Method::Fourier {
            frequency: 0.1,
            harmonics: 30,
        },
        Method::Fourier {
            frequency: -1.0,
            harmonics: 3,
        },
        Method::Local { half_width: 1.5 },
        Method::Local { half_width: 40.0 },
        Method::Local {
            half_width: f64::NAN,
        },
    ] {
        let result = method.differentiate(&times[..25], &x[..25]);
        assert!(result.is_err(), "{method:?}: {result:?}");
    }
}
