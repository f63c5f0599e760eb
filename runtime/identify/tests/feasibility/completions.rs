//! The parameters that the observations do not determine are chosen near a reference, also where a
//! margin is an active constraint.

use regen_identify::estimate::QrFactor;
use regen_identify::feasibility::{
    BaseMap, Options, Outcome, ParameterLayout, Prior, SYMBOLS, identify,
};

/// A thin rod along x, whose margin is below the required ones.
const ROD: [f64; 10] = [0.002, 0.0, 0.0, 0.3, 0.0, 0.3, 0.4, 0.0, 0.0, 1.5];

/// The distance of the completed parameters from the reference, in units of the scale, and their
/// margin.
fn distance(margin: f64) -> (f64, f64) {
    let labels: Vec<String> = SYMBOLS.iter().map(|s| format!("{s}(1)")).collect();
    let layout = ParameterLayout::new(&labels).unwrap();
    let observed = BaseMap::identity(&labels).select(&[5, 6]).unwrap();
    let mut factor = QrFactor::new(observed.labels().to_vec());
    factor
        .push_block(&[1.0, 0.0, 0.0, 1.0], &[ROD[5], ROD[6]])
        .unwrap();
    let options = Options {
        margin,
        reference: ROD.iter().copied().map(Some).collect(),
        ..Options::default()
    };
    let found = identify(&factor, &observed, &layout, &options).unwrap();
    assert_eq!(found.outcome, Outcome::Unconstrained, "{margin}");
    assert!(found.check.is_physical() && found.check.margin() >= margin);
    for (k, exact) in [(5, ROD[5]), (6, ROD[6])] {
        assert!(
            (found.phi[k] - exact).abs() < 1e-12,
            "the fit changed an observed parameter"
        );
    }
    let length = options.scale.length;
    let units = [2, 2, 2, 2, 2, 2, 1, 1, 1, 0].map(|k| length.powi(k));
    let off = found.phi.iter().zip(ROD).zip(units);
    let squares: f64 = off.map(|((a, b), unit)| ((a - b) / unit).powi(2)).sum();
    (squares.sqrt(), found.check.margin())
}

/// The completion is as close to the reference as the margin allows: its margin is just the
/// required one, and a larger required margin gives a larger distance.
#[test]
fn a_completion_is_as_near_the_reference_as_its_margin_allows() {
    let mut last = 0.0;
    for k in 0..12 {
        let margin = 0.02 + 0.005 * f64::from(k);
        let (off, met) = distance(margin);
        assert!(met < margin + 1e-5, "{met} is more than {margin}");
        let (more, _) = distance(margin + 1e-4);
        assert!(off > last && off < more + 1e-6, "{off} {last} {more}");
        assert!(more - off < 1e-2, "{margin}: {off} {more}");
        last = off;
    }
}

const BODY: [f64; 10] = [0.2, 0.01, 0.0, 0.25, -0.02, 0.22, 0.1, 0.05, -0.03, 3.0];

/// With known values or priors the parameters are the solution of a cone programme. There too,
/// every undetermined direction is taken from the reference.
#[test]
fn undetermined_directions_follow_the_reference_also_with_known_values_or_priors() {
    let labels: Vec<String> = SYMBOLS.iter().map(|s| format!("{s}(1)")).collect();
    let layout = ParameterLayout::new(&labels).unwrap();
    let reference: Vec<Option<f64>> = BODY.iter().copied().map(Some).collect();
    let with_known_value = Options {
        known: vec![("my(1)".to_owned(), 0.02)],
        reference: reference.clone(),
        ..Options::default()
    };
    let with_prior = Options {
        noise: Some(1e-3),
        priors: vec![Prior {
            parameter: "my(1)".to_owned(),
            value: 0.02,
            deviation: 1e-3,
        }],
        reference,
        ..Options::default()
    };
    for options in [with_known_value, with_prior] {
        for observed in [&[9][..], &[9, 3], &[9, 3, 6, 0]] {
            let combinations = BaseMap::identity(&labels).select(observed).unwrap();
            let mut factor = QrFactor::new(combinations.labels().to_vec());
            let n = observed.len();
            let mut w = vec![0.0; n * n];
            w.iter_mut().step_by(n + 1).for_each(|x| *x = 1.0);
            let tau: Vec<f64> = observed.iter().map(|&k| 1.1 * BODY[k]).collect();
            factor.push_block(&w, &tau).unwrap();
            let found = identify(&factor, &combinations, &layout, &options).unwrap();
            for (k, label) in labels.iter().enumerate() {
                let exact = match k {
                    7 => 0.02,
                    _ if observed.contains(&k) => 1.1 * BODY[k],
                    _ => BODY[k],
                };
                // the weight of the reference is 1e-4 of the observations': 1e-8 in their squares,
                // of which the solver leaves 1e-12
                let off = (found.phi[k] - exact).abs();
                assert!(off < 1e-3, "{observed:?} {label}: {off:e}");
            }
        }
    }
}
