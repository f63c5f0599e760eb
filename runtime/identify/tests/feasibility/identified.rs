//! Identification under the constraints, compared with another solver and tested by its properties.

use proptest::prelude::*;
use regen_identify::estimate::QrFactor;
use regen_identify::feasibility::{
    BaseMap, Bound, FeasibilityError, Options, Outcome, ParameterLayout, PhysicalFit, Prior,
    SYMBOLS, Scale, Total, Verdict, identify, nearest, pseudo_inertia, verdict,
};

use crate::robots::{Robot, robot};

/// Pseudo-random numbers in -1..1 (SplitMix64), the same on every machine.
struct Random(u64);

impl Random {
    fn signed(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        2.0 * (((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64) - 1.0
    }
}

/// Observations of the base parameters by a random matrix, with noise of size `noise`.
fn observed(robot: &Robot, rows: usize, noise: f64, seed: u64) -> QrFactor {
    let mut random = Random(seed);
    let beta = robot.beta();
    let w: Vec<f64> = (0..rows * beta.len()).map(|_| random.signed()).collect();
    let tau: Vec<f64> = (0..rows)
        .map(|t| {
            let exact: f64 = beta
                .iter()
                .enumerate()
                .map(|(j, b)| w[j * rows + t] * b)
                .sum();
            exact + noise * random.signed()
        })
        .collect();
    let mut factor = QrFactor::new(robot.combinations.labels().to_vec());
    factor.push_block(&w, &tau).unwrap();
    factor
}

fn find(robot: &Robot, factor: &QrFactor, options: &Options) -> PhysicalFit {
    identify(factor, &robot.combinations, &robot.layout, options).unwrap()
}

fn close(a: &[f64], b: &[f64], tolerance: f64) -> bool {
    a.len() == b.len()
        && a.iter()
            .zip(b)
            .all(|(a, b)| (a - b).abs() <= tolerance * (1.0 + b.abs()))
}

#[derive(serde::Deserialize)]
struct Vector {
    labels: Vec<String>,
    kept: Vec<String>,
    combinations: Vec<Vec<f64>>,
    r: Vec<f64>,
    z: Vec<f64>,
    rss: f64,
    rows: usize,
    phi: Vec<f64>,
    beta: Vec<f64>,
    squared_residual: f64,
    cad: Vec<f64>,
    deviation: f64,
    least_squares: Vec<f64>,
}

#[test]
fn the_solution_is_that_of_another_conic_solver() {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../tests/fixtures/computed/feasibility.json"
    );
    let vectors: Vec<Vector> =
        serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    assert_eq!(vectors.len(), 4);
    for vector in vectors {
        let layout = ParameterLayout::new(&vector.labels).unwrap();
        let combinations = BaseMap::new(vector.kept.clone(), vector.combinations.clone()).unwrap();
        let factor = QrFactor::from_parts(vector.kept, vector.r, vector.z, vector.rss, vector.rows);
        let factor = factor.unwrap();
        let prior = |(label, value): (&String, &f64)| Prior {
            parameter: label.clone(),
            value: *value,
            deviation: vector.deviation,
        };
        let options = Options {
            noise: Some(1.0),
            priors: vector.labels.iter().zip(&vector.cad).map(prior).collect(),
            ..Options::default()
        };
        let found = identify(&factor, &combinations, &layout, &options).unwrap();
        assert_ne!(found.outcome, Outcome::Unconstrained);
        assert!(
            !close(&found.beta, &vector.least_squares, 1e-2),
            "the constraints take part"
        );
        assert!(found.check.margin() < 1e-6, "a body is at the border");
        let objective = |squares: f64, phi: &[f64]| {
            let off = phi.iter().zip(&vector.cad);
            let prior_squares = off.map(|(x, cad)| ((x - cad) / vector.deviation).powi(2));
            squares + prior_squares.sum::<f64>()
        };
        let ours = objective(found.squared_residual, &found.phi);
        let theirs = objective(vector.squared_residual, &vector.phi);
        assert!((ours / theirs - 1.0).abs() < 1e-7, "{ours} {theirs}");
        let n = vector.beta.len();
        let predicted = |beta: &[f64]| -> Vec<f64> {
            (0..n)
                .map(|i| (0..n).map(|j| factor.r()[j * n + i] * beta[j]).sum())
                .collect()
        };
        let size = predicted(&vector.beta)
            .iter()
            .map(|x| x * x)
            .sum::<f64>()
            .sqrt();
        let pairs = predicted(&found.beta)
            .into_iter()
            .zip(predicted(&vector.beta));
        let off = pairs.map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
        assert!(
            off < 1e-6 * size,
            "predictions differ by {off:e} of {size:e}"
        );
        assert!(close(&found.beta, &vector.beta, 1e-6));
        assert!(close(&found.phi, &vector.phi, 1e-6));
        let decision = verdict(
            &layout,
            &combinations,
            &vector.least_squares,
            Scale::default(),
        );
        assert!(matches!(decision.unwrap(), Verdict::Infeasible { .. }));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn exact_observations_give_the_base_parameters_exactly(robot in robot(), seed: u64) {
        let factor = observed(&robot, 120, 0.0, seed);
        let found = find(&robot, &factor, &Options::default());
        prop_assert_eq!(found.outcome, Outcome::Unconstrained);
        prop_assert!(close(&found.beta, &robot.beta(), 1e-9));
        prop_assert!(found.check.is_physical());
    }

    /// Even with noise as large as the signal the result is physical, and fits no worse than the
    /// true robot, which is one of the candidates.
    #[test]
    fn noise_never_makes_a_result_unphysical(robot in robot(), noise in 0.0..30.0_f64, seed: u64) {
        let factor = observed(&robot, 80, noise, seed);
        let found = find(&robot, &factor, &Options::default());
        prop_assert!(found.check.is_physical());
        prop_assert!(robot.layout.check(&found.phi, Scale::default()).unwrap().is_physical());
        let truth = factor.squared_residual(&robot.beta()).unwrap();
        prop_assert!(found.squared_residual <= truth * (1.0 + 1e-6) + 1e-9);
        prop_assert!(found.squared_residual >= found.least_squares_residual * (1.0 - 1e-9));
        prop_assert!(close(&robot.combinations.apply(&found.phi).unwrap(), &found.beta, 1e-9));
    }

    #[test]
    fn the_nearest_point_of_a_physical_robot_is_itself(robot in robot(), seed: u64) {
        let factor = observed(&robot, 80, 1.0, seed);
        let same = nearest(&factor, &robot.combinations, &robot.layout, &robot.beta(), &Options::default()).unwrap();
        prop_assert!(close(&same.beta, &robot.beta(), 1e-9));
        prop_assert!(same.squared_residual < 1e-12);
    }
}

/// One body whose ten parameters are each observed once, with weight 1.
fn one(values: [f64; 10]) -> (ParameterLayout, BaseMap, QrFactor) {
    let labels: Vec<String> = SYMBOLS.iter().map(|s| format!("{s}(1)")).collect();
    let mut factor = QrFactor::new(labels.clone());
    let mut w = vec![0.0; 100];
    w.iter_mut().step_by(11).for_each(|x| *x = 1.0);
    factor.push_block(&w, &values).unwrap();
    (
        ParameterLayout::new(&labels).unwrap(),
        BaseMap::identity(&labels),
        factor,
    )
}

const PLAIN: [f64; 10] = [0.2, 0.0, 0.0, 0.2, 0.0, 0.2, 0.1, 0.0, 0.0, 3.0];

#[test]
fn margins_known_values_bounds_and_totals_are_satisfied() {
    let (layout, combinations, factor) = one(PLAIN);
    let options = Options {
        known: vec![("my(1)".to_owned(), 0.05)],
        bounds: vec![Bound {
            parameter: "mx(1)".to_owned(),
            lowest: f64::NEG_INFINITY,
            highest: 0.02,
        }],
        totals: vec![Total {
            parameters: vec!["m(1)".to_owned()],
            value: 2.5,
        }],
        ..Options::default()
    };
    let found = identify(&factor, &combinations, &layout, &options).unwrap();
    assert!((found.phi[7] - 0.05).abs() < 1e-12);
    assert!(
        (found.phi[6] - 0.02).abs() < 1e-7,
        "the bound is met, from inside: {}",
        found.phi[6]
    );
    assert!((found.phi[9] - 2.5).abs() < 1e-7);
    let thick = Options {
        margin: 1.5,
        ..Options::default()
    };
    let found = identify(&factor, &combinations, &layout, &thick).unwrap();
    assert!(found.check.margin() >= 1.5);
}

#[test]
fn contradictory_constraints_are_reported() {
    let (layout, combinations, factor) = one(PLAIN);
    let heavy = Options {
        known: vec![("m(1)".to_owned(), -1.0)],
        ..Options::default()
    };
    let error = identify(&factor, &combinations, &layout, &heavy).unwrap_err();
    assert!(
        matches!(error, FeasibilityError::Contradiction(_)),
        "{error}"
    );
    let none = Options {
        known: vec![("m(2)".to_owned(), 1.0)],
        ..Options::default()
    };
    let error = identify(&factor, &combinations, &layout, &none).unwrap_err();
    assert_eq!(error.to_string(), "there is no parameter `m(2)`");
}

#[test]
fn identical_bodies_are_identical() {
    let labels = crate::robots::labels(2);
    let layout = ParameterLayout::new(&labels).unwrap();
    let combinations = BaseMap::identity(&labels);
    let mut factor = QrFactor::new(labels.clone());
    let mut w = vec![0.0; 22 * 22];
    w.iter_mut().step_by(23).for_each(|x| *x = 1.0);
    let mut lighter = PLAIN;
    lighter[9] = 2.0;
    let tau = [PLAIN.as_slice(), &lighter, &[1.0, 2.0]].concat();
    factor.push_block(&w, &tau).unwrap();
    let options = Options {
        identical: vec![vec!["1".to_owned(), "2".to_owned()]],
        ..Options::default()
    };
    let found = identify(&factor, &combinations, &layout, &options).unwrap();
    assert_eq!(found.phi[..10], found.phi[10..20]);
    assert!(
        (found.phi[9] - 2.5).abs() < 1e-7,
        "between the two: {}",
        found.phi[9]
    );
    assert!((found.phi[20] - 1.0).abs() < 1e-6 && (found.phi[21] - 2.0).abs() < 1e-6);
}

/// The mean of a measured value and of a prior weights both by their standard deviations.
#[test]
fn a_prior_is_weighted_by_its_deviation() {
    let (layout, combinations, factor) = one(PLAIN);
    let options = Options {
        noise: Some(0.1),
        priors: vec![Prior {
            parameter: "m(1)".to_owned(),
            value: 2.0,
            deviation: 0.2,
        }],
        ..Options::default()
    };
    let found = identify(&factor, &combinations, &layout, &options).unwrap();
    let expected = (3.0 / 0.01 + 2.0 / 0.04) / (1.0 / 0.01 + 1.0 / 0.04);
    assert!(
        (found.phi[9] - expected).abs() < 1e-6,
        "{} {expected}",
        found.phi[9]
    );
}

/// Parameters that the observations do not determine equal the reference if that is physical.
#[test]
fn undetermined_values_come_from_the_reference() {
    let (layout, _, _) = one(PLAIN);
    let combinations = BaseMap::identity(layout.labels()).select(&[5, 6]).unwrap();
    let mut factor = QrFactor::new(combinations.labels().to_vec());
    factor
        .push_block(&[1.0, 0.0, 0.0, 1.0], &[0.25, 0.3])
        .unwrap();
    let options = Options {
        reference: PLAIN.iter().copied().map(Some).collect(),
        ..Options::default()
    };
    let found = identify(&factor, &combinations, &layout, &options).unwrap();
    assert_eq!(found.outcome, Outcome::Unconstrained);
    let mut expected = PLAIN;
    (expected[5], expected[6]) = (0.25, 0.3);
    assert!(close(&found.phi, &expected, 1e-5), "{:?}", found.phi);
    // without a reference they are small and finite
    let small = identify(&factor, &combinations, &layout, &Options::default()).unwrap();
    assert!(small.check.is_physical() && small.phi.iter().all(|x| x.abs() < 5.0));
}

/// At the minimum of squares plus divergence the gradient vanishes: phi - z + w sigma^2 times the
/// gradient of trace(J J0^-1) - ln det J.
#[test]
fn the_entropic_prior_is_at_its_minimum() {
    let measured = [0.3, 0.05, -0.02, 0.25, 0.01, 0.4, 0.2, -0.1, 0.15, 2.0];
    let (layout, combinations, factor) = one(measured);
    let (weight, sigma) = (0.7, 0.3);
    let options = Options {
        entropic: weight,
        noise: Some(sigma),
        reference: PLAIN.iter().copied().map(Some).collect(),
        ..Options::default()
    };
    let found = identify(&factor, &combinations, &layout, &options).unwrap();
    let matrix = |phi: &[f64]| {
        let j = pseudo_inertia(&<[f64; 10]>::try_from(phi).unwrap());
        nalgebra::Matrix4::from_fn(|r, c| j[r][c])
    };
    let inverse = matrix(&PLAIN).try_inverse().unwrap();
    let objective = |phi: &[f64]| {
        let j = matrix(phi);
        let squares: f64 = phi.iter().zip(measured).map(|(a, b)| (a - b).powi(2)).sum();
        squares / (2.0 * sigma * sigma) + weight * ((j * inverse).trace() - j.determinant().ln())
    };
    for k in 0..10 {
        let step = 1e-5;
        let moved = |by: f64| {
            let mut phi = found.phi.clone();
            phi[k] += by;
            objective(&phi)
        };
        let slope = (moved(step) - moved(-step)) / (2.0 * step);
        let curvature = (moved(step) + moved(-step) - 2.0 * moved(0.0)) / (step * step);
        assert!((slope / curvature).abs() < 1e-5, "{k}: {slope} {curvature}");
    }
    // for a reference that is not physical there is no divergence
    let mut flat = options;
    flat.reference[9] = Some(-1.0);
    let error = identify(&factor, &combinations, &layout, &flat).unwrap_err();
    assert!(matches!(error, FeasibilityError::Reference { .. }));
}
