//! Huber's estimate of gains and a payload, tested by the equations that define it.

use regen_identify::gains::{GainOptions, fit};
use regen_identify::states::Source;
use regen_interpreted::{BaseTerms, Interpreted};
use regen_runtime::BaseModel;

use super::{LOAD, Twin, arm, carried, check_against_truth, unknown};

const BOUND: f64 = 1.345;

#[test]
fn outliers_hardly_change_hubers_gains_and_payload() {
    let robot = arm();
    let terms = BaseTerms::new(&robot);
    let model = Interpreted::with_terms(&robot, &terms);
    let twin = Twin {
        outliers: 0.05,
        ..Twin::new(&model, &[8.0, -12.0, 3.0])
    };
    let plan = unknown(&twin, Some(2.2));
    let options = GainOptions {
        huber: Some(BOUND),
        ..GainOptions::default()
    };
    let mut squares = [0.0, 0.0];
    for seed in 0..2 {
        let least = twin.fit(&plan, seed).unwrap();
        let mut runs = twin.runs(seed);
        let found = fit(&model, &options, &plan, &mut carried(&mut runs)).unwrap();
        check_against_truth(&twin, &found, &LOAD);
        for (sum, of) in squares.iter_mut().zip([&least, &found]) {
            let pairs = of.model.gains.iter().zip(&twin.gains);
            *sum += pairs.map(|(g, k)| (g.value / k - 1.0).powi(2)).sum::<f64>();
        }
        if seed > 0 {
            continue;
        }
        // the sum of the bounded residuals times the derivative by any unknown is 0: by a base
        // parameter of the robot, and by a gain
        let load = twin.load();
        let (beta, dof) = (&found.model.beta, twin.gains.len());
        let gains: Vec<f64> = found.model.gains.iter().map(|g| g.value).collect();
        let (mut sums, mut sizes) = (vec![0.0; beta.len()], vec![0.0; beta.len()]);
        let (mut of_gains, mut of_psi) = (vec![[0.0_f64; 2]; dof], 0.0);
        for (run, is_loaded) in runs.iter_mut().zip([false, true]) {
            let mut own = beta.clone();
            if !is_loaded {
                for k in &load {
                    own[*k] = 0.0;
                }
            }
            run.visit(&mut |row| {
                let mut tau = vec![0.0; dof];
                let at = |beta: &[f64], tau: &mut [f64]| {
                    let found = model.base_inverse_dynamics(row.q, row.qd, row.qdd, beta, tau);
                    assert!(found.unwrap().is_regular());
                };
                at(&own, &mut tau);
                let psi: Vec<f64> = (0..dof)
                    .map(|e| {
                        let sigma = found.estimate.efforts[e].sigma / gains[e].abs();
                        let residual = row.efforts[e] - tau[e] / gains[e];
                        (residual / sigma).clamp(-BOUND, BOUND) / (sigma * gains[e])
                    })
                    .collect();
                for e in 0..dof {
                    let sigma = found.estimate.efforts[e].sigma;
                    of_psi += (psi[e] * sigma).powi(2);
                    of_gains[e][0] += psi[e] * tau[e];
                    of_gains[e][1] += (psi[e] * tau[e]).abs();
                }
                for k in (0..beta.len()).filter(|k| !load.contains(k)) {
                    let mut unit = vec![0.0; beta.len()];
                    unit[k] = 1.0;
                    let mut column = vec![0.0; dof];
                    at(&unit, &mut column);
                    for (p, w) in psi.iter().zip(&column) {
                        sums[k] += p * w;
                        sizes[k] += (p * w).abs();
                    }
                }
                Ok(())
            })
            .unwrap();
        }
        for k in (0..beta.len()).filter(|k| !load.contains(k)) {
            let label = model.base_info().base[k].label;
            assert!(
                sums[k].abs() < 1e-4 * sizes[k],
                "{label}: {} {}",
                sums[k],
                sizes[k]
            );
        }
        for [sum, size] in of_gains {
            assert!(sum.abs() < 1e-4 * size, "{sum} {size}");
        }
        // the mean of psi^2 for normal noise and this bound, from a table of the normal distribution
        let mean = of_psi
            / found
                .estimate
                .efforts
                .iter()
                .map(|e| e.rows as f64)
                .sum::<f64>();
        assert!((mean - 0.7102).abs() < 0.01, "{mean}");
    }
    assert!(squares[1] < 0.1 * squares[0], "{squares:?}");
}
