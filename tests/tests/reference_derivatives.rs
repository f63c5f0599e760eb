//! A and b by dual numbers agree with finite differences of f.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use nalgebra::DVector;
use regen_tests::files;
use regen_tests::reference::{Mechanism, Random};

const STEP: f64 = 1e-4;

/// The first and second derivative of f along a direction, by fourth-order central differences.
fn differences(m: &Mechanism, q: &[f64], direction: &[f64]) -> (DVector<f64>, DVector<f64>) {
    let at = |s: f64| {
        let moved: Vec<f64> = q
            .iter()
            .zip(direction)
            .map(|(x, d)| x + s * STEP * d)
            .collect();
        DVector::from_vec(m.constraints(&moved))
    };
    let (far_back, back, here, ahead, far_ahead) = (at(-2.0), at(-1.0), at(0.0), at(1.0), at(2.0));
    let first = (&far_back - &back * 8.0 + &ahead * 8.0 - &far_ahead) / (12.0 * STEP);
    let second = (-&far_back + &back * 16.0 - here * 30.0 + &ahead * 16.0 - &far_ahead)
        / (12.0 * STEP * STEP);
    (first, second)
}

#[test]
fn jacobian_and_bias_agree_with_differences_of_the_residual() {
    let mut random = Random::new(4);
    let mut looped = 0;
    for folder in [files::robots(), files::mechanisms()]
        .into_iter()
        .chain(files::folders(&files::pairs()).unwrap())
    {
        for file in files::list(&folder, "yaml").unwrap() {
            let m = files::mechanism(&file).unwrap();
            if m.rows() == 0 {
                continue;
            }
            looped += 1;
            let q = random.vector(m.n(), 1.0);
            let qd = random.vector(m.n(), 1.0);
            let (first, second) = differences(&m, &q, &qd);
            let along = m.jacobian(&q) * DVector::from_column_slice(&qd);
            let bias = DVector::from_vec(m.bias(&q, &qd));
            // Differences have a rounding error of 1e-16 over the step, and over its square.
            assert!(
                (&along - first).amax() < 1e-10 * (1.0 + along.amax()),
                "{}",
                m.name
            );
            assert!(
                (&bias + second).amax() < 1e-6 * (1.0 + bias.amax()),
                "{}",
                m.name
            );
            let rate = m.jacobian_rate(&q, &qd) * DVector::from_column_slice(&qd);
            assert!(
                (&bias + rate).amax() < 1e-12 * (1.0 + bias.amax()),
                "{}",
                m.name
            );
        }
    }
    assert!(looped >= 20, "only {looped} closed mechanisms");
}
