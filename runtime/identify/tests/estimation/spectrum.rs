//! Condition numbers of matrices whose singular values are known in closed form.

use regen_identify::estimate::{Accumulator, EstimateError, Origin, QrFactor};

fn labels(n: usize) -> Vec<String> {
    (0..n).map(|k| format!("p{k}")).collect()
}

/// The factor of a matrix given by its columns, with an arbitrary right side.
fn factor(columns: &[[f64; 4]]) -> QrFactor {
    let mut factor = QrFactor::new(labels(columns.len()));
    let tau = [1.0, -2.0, 0.5, 3.0];
    factor.push_block(&columns.concat(), &tau).unwrap();
    factor
}

#[test]
fn orthogonal_columns_have_their_lengths_as_singular_values() {
    let spectrum = factor(&[
        [3.0, 3.0, 3.0, 3.0],
        [50.0, -50.0, 50.0, -50.0],
        [0.5, 0.5, -0.5, -0.5],
    ])
    .spectrum()
    .unwrap();
    // lengths 6, 100 and 1
    for (found, exact) in spectrum.raw.iter().zip([100.0, 6.0, 1.0]) {
        assert!((found / exact - 1.0).abs() < 1e-14, "{:?}", spectrum.raw);
    }
    assert!((spectrum.condition() / 100.0 - 1.0).abs() < 1e-14);
    assert!((spectrum.scaled_condition() - 1.0).abs() < 1e-14);
    assert_eq!(spectrum.rank(), 3);
    assert!(spectrum.undetermined().is_empty());
}

/// Two columns of unit length with the cosine c between them have the singular values sqrt(1 + c)
/// and sqrt(1 - c). If the second is a hundred times longer, they are the roots of the eigenvalues
/// of `[[1, 100 c], [100 c, 10000]]`.
#[test]
fn the_condition_of_two_columns_follows_from_the_angle_between_them() {
    for c in [0.0_f64, 0.6, 0.96, 0.9999] {
        let s = (1.0 - c * c).sqrt();
        let spectrum = factor(&[[1.0, 0.0, 0.0, 0.0], [100.0 * c, 0.0, 100.0 * s, 0.0]])
            .spectrum()
            .unwrap();
        let scaled = ((1.0 + c) / (1.0 - c)).sqrt();
        assert!((spectrum.scaled_condition() / scaled - 1.0).abs() < 1e-10);
        let (half, root) = (5000.5, (4999.5_f64.powi(2) + 1e4 * c * c).sqrt());
        // the product of the two is the determinant
        let raw = (half + root) / (100.0 * s);
        assert!(
            (spectrum.condition() / raw - 1.0).abs() < 1e-10,
            "{c}: {} {raw}",
            spectrum.condition()
        );
    }
}

#[test]
fn singular_equations_have_an_infinite_condition_and_report_its_reciprocal() {
    let nothing = factor(&[[0.0; 4], [0.0; 4]]).spectrum().unwrap();
    // infinite, not NaN
    assert!(nothing.condition() > f64::MAX && nothing.scaled_condition() > f64::MAX);
    assert_eq!(nothing.rank(), 0);
    let no_columns = factor(&[]).spectrum().unwrap();
    assert_eq!(no_columns.condition().to_bits(), 1.0_f64.to_bits());
    // an angle of 1e-14 between the columns is below the rank tolerance
    let close = factor(&[[1.0, 0.0, 0.0, 0.0], [1.0, 1e-14, 0.0, 0.0]]);
    let EstimateError::Undetermined {
        rank,
        reciprocal_condition,
        ..
    } = close.solve().unwrap_err()
    else {
        panic!("{:?}", close.solve());
    };
    assert_eq!(rank, 1);
    // half the angle, up to rounding
    assert!((0.0..1e-13).contains(&reciprocal_condition));
}

#[test]
fn a_known_last_column_is_subtracted_from_the_right_side() {
    let whole = factor(&[
        [1.0, 2.0, 0.0, 1.0],
        [0.0, 1.0, -1.0, 2.0],
        [3.0, 0.0, 1.0, -1.0],
    ]);
    for column in 0..3 {
        let x = whole.solve().unwrap();
        // a parameter that is fixed at its least-squares value does not change the others
        let fixed = whole.fixed(&[(column, x[column])]).unwrap();
        let rest = fixed.solve().unwrap();
        let others = x.iter().enumerate().filter(|(k, _)| *k != column);
        for (found, (_, exact)) in rest.iter().zip(others) {
            assert!((found - exact).abs() < 1e-14, "{column}: {rest:?} {x:?}");
        }
    }
}

#[test]
fn rows_of_an_unknown_effort_are_refused_with_its_number() {
    let origin = Origin {
        robot: "none".to_owned(),
        model: "0".to_owned(),
        kind: "forces".to_owned(),
        efforts: vec!["a".to_owned(), "b".to_owned()],
        labels: labels(1),
    };
    let mut rows = Accumulator::new(&origin);
    assert_eq!(
        rows.push(4, &[1.0], 1, 1.0, 1.0),
        Err(EstimateError::Size {
            what: "effort",
            expected: 2,
            got: 5,
        })
    );
    assert!(rows.push(1, &[], 1, 1.0, 1.0).is_err(), "a row too short");
}
