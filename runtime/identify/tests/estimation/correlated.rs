//! The covariance for correlated residuals, compared with its definition as a sum over all pairs.

use regen_identify::estimate::{Autocorrelated, QrFactor};

/// Two pseudo-random numbers, the same on every machine.
fn score(t: usize) -> [f64; 2] {
    let t = t as f64;
    [
        (12.9898 * t * t).sin(),
        (78.233 * t).cos() + 0.3 * (12.9898 * t * t).sin(),
    ]
}

/// Newey and West (1987): products of scores l apart, within a run and below the bandwidth B, have
/// the weight 1 - l/B.
fn pairs(runs: &[usize], bandwidth: usize) -> [[f64; 2]; 2] {
    let mut sum = [[0.0; 2]; 2];
    let mut first = 0;
    for run in runs {
        for t in first..first + run {
            for s in first..first + run {
                let lag = t.abs_diff(s);
                if lag >= bandwidth {
                    continue;
                }
                let weight = 1.0 - lag as f64 / bandwidth as f64;
                let (a, b) = (score(t), score(s));
                for i in 0..2 {
                    for j in 0..2 {
                        sum[i][j] += weight * a[i] * b[j];
                    }
                }
            }
        }
        first += run;
    }
    sum
}

/// Runs of one sample, and runs shorter than, equal to and longer than the window.
#[test]
fn windows_add_up_to_all_pairs_within_a_run_of_any_length() {
    let runs = [1, 3, 5, 7, 30, 2];
    let samples: usize = runs.iter().sum();
    let mut factor = QrFactor::new(vec!["a".to_owned(), "b".to_owned()]);
    // columns of lengths 2 and 4 times the root of the number of samples, orthogonal
    let signs = (0..samples).map(|t| if t % 2 == 0 { 1.0 } else { -1.0 });
    let w: Vec<f64> = vec![2.0; samples]
        .into_iter()
        .chain(signs.map(|s| 4.0 * s))
        .collect();
    factor.push_block(&w, &vec![0.0; samples]).unwrap();
    let gram = [4.0 * samples as f64, 16.0 * samples as f64];
    for bandwidth in [1, 2, 5, 8, 40] {
        let mut sums = Autocorrelated::new(2, bandwidth);
        let mut t = 0;
        for run in runs {
            for _ in 0..run {
                sums.push(&score(t)).unwrap();
                t += 1;
            }
            sums.interrupt();
        }
        let found = sums.covariance(&factor).unwrap();
        let exact = pairs(&runs, bandwidth);
        // corrected for the two parameters
        let scale = samples as f64 / (samples - 2) as f64;
        for i in 0..2 {
            for j in 0..2 {
                let expected = scale * exact[i][j] / gram[i] / gram[j];
                let size = scale * (exact[i][i] * exact[j][j]).sqrt() / gram[i] / gram[j];
                let off = (found[i * 2 + j] - expected).abs();
                assert!(off < 1e-12 * size, "{bandwidth}: {found:?} {expected}");
            }
        }
    }
    assert!(Autocorrelated::new(2, 3).push(&[1.0]).is_err());
    assert!(Autocorrelated::new(3, 3).covariance(&factor).is_err());
}
