//! The physical values that fit best, judged by their optimality conditions with nalgebra.

use nalgebra::{Matrix4, SymmetricEigen};
use proptest::prelude::*;
use regen_control::{Physical, Search, SettingError};
use regen_runtime::{Parameter, Symbol};

/// Two bodies, a viscous friction and an offset.
const P: usize = 22;
type Set = Physical<P, 2>;

fn parameters() -> [Parameter<'static>; P] {
    std::array::from_fn(|k| match k {
        20 => Parameter::new(Symbol::Friction("Fv"), "q1"),
        21 => Parameter::new(Symbol::Offset, "q1"),
        k => Parameter::new(Symbol::INERTIAL[k % 10], if k < 10 { "1" } else { "2" }),
    })
}

/// Inertia about the origin, first moments and mass as the pseudo-inertia.
fn pseudo(body: &[f64]) -> Matrix4<f64> {
    let inertia = nalgebra::Matrix3::new(
        body[0], body[1], body[2], body[1], body[3], body[4], body[2], body[4], body[5],
    );
    let moments = nalgebra::Matrix3::identity() * (0.5 * inertia.trace()) - inertia;
    let mut whole = Matrix4::zeros();
    whole.fixed_view_mut::<3, 3>(0, 0).copy_from(&moments);
    for axis in 0..3 {
        whole[(axis, 3)] = body[6 + axis];
        whole[(3, axis)] = body[6 + axis];
    }
    whole[(3, 3)] = body[9];
    whole
}

/// The matrix S with tr(S J(phi)) = b phi: found from the matrices of the ten units.
fn multiplier(b: &[f64]) -> Matrix4<f64> {
    // tr(S E_k) = b_k, where the E_k span the symmetric matrices
    let basis: Vec<Matrix4<f64>> = (0..10)
        .map(|k| {
            pseudo(&std::array::from_fn::<f64, 10, _>(|j| {
                f64::from(u8::from(j == k))
            }))
        })
        .collect();
    let gram = nalgebra::DMatrix::from_fn(10, 10, |i, j| basis[i].dot(&basis[j]));
    let weights = gram
        .lu()
        .solve(&nalgebra::DVector::from_row_slice(b))
        .unwrap();
    basis.iter().zip(weights.iter()).map(|(e, w)| e * *w).sum()
}

fn least(matrix: &Matrix4<f64>) -> f64 {
    SymmetricEigen::new(*matrix).eigenvalues.min()
}

/// A ball of 2 kg and 0.3 m for each body.
fn balls() -> [f64; P] {
    let ball = [0.1, 0.0, 0.0, 0.1, 0.0, 0.1, 0.0, 0.0, 0.0, 2.0];
    std::array::from_fn(|k| if k >= 20 { 0.5 } else { ball[k % 10] })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    /// Of a convex problem: the gradient is a multiplier that is positive semidefinite, and its
    /// product with the values bounds how far they are from the minimum. That product grows with the
    /// square root of the gap away from the central path (a decrement of 1/4 times the norm of R phi),
    /// so a tighter search judges the gap itself.
    #[test]
    fn no_physical_values_fit_better(
        entries in prop::collection::vec(-1.0_f64..1.0, P * P),
        target in prop::collection::vec(-1.0_f64..1.0, P),
        scale in 0.1_f64..30.0,
    ) {
        let r: [[f64; P]; P] = std::array::from_fn(|i| std::array::from_fn(|j| {
            let entry = entries[i * P + j];
            match i.cmp(&j) {
                std::cmp::Ordering::Less => entry,
                std::cmp::Ordering::Equal => 0.3 + entry.abs(),
                std::cmp::Ordering::Greater => 0.0,
            }
        }));
        let z: [f64; P] = std::array::from_fn(|i| scale * target[i]);
        let fitted = |values: &[f64; P]| -> [f64; P] {
            std::array::from_fn(|i| r[i].iter().zip(values).map(|(a, b)| a * b).sum())
        };
        let squares = |values: &[f64; P]| {
            fitted(values).iter().zip(&z).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / 2.0
        };
        let set = Set::new(&parameters()).unwrap();
        let tolerance = 1e-8;
        let found = set.closest((&r, &z), &balls(), 100, tolerance).unwrap();
        prop_assert_eq!(found.status, Search::Reached);
        prop_assert!(found.gap <= tolerance && set.contains(&found.values));
        let tight = set.closest((&r, &z), &found.values, 100, 1e-3 * tolerance).unwrap();
        // rounding may stop it before, with values that are better all the same; the squares are of the size of scale^2, and each of the 22 is rounded
        let (least_squares, rounding) = (squares(&tight.values), 1e-13 * scale * scale);
        prop_assert!(squares(&found.values) <= least_squares + found.gap + rounding);
        let residual: [f64; P] = std::array::from_fn(|i| {
            fitted(&found.values)[i] - z[i]
        });
        let gradient: [f64; P] = std::array::from_fn(|j| (0..P).map(|i| r[i][j] * residual[i]).sum());
        let size = gradient.iter().fold(0.0_f64, |m, g| m.max(g.abs())).max(1.0);
        let mut gap = 0.0;
        for body in 0..2 {
            let range = 10 * body..10 * body + 10;
            let (s, j) = (multiplier(&gradient[range.clone()]), pseudo(&found.values[range]));
            prop_assert!(least(&j) > 0.0);
            prop_assert!(least(&s) > -1e-7 * size, "{} of {size}", least(&s));
            gap += s.dot(&j);
        }
        prop_assert!(found.values[20] > 0.0 && gradient[20] > -1e-7 * size);
        gap += gradient[20] * found.values[20];
        prop_assert!(gradient[21].abs() < 1e-4 * size, "{}", gradient[21]);
        let norm = fitted(&found.values).iter().map(|x| x * x).sum::<f64>().sqrt();
        // the degree of the barrier: four for each of two bodies, one for the viscous friction
        let near = 0.25 * (tolerance / 9.0).sqrt() * norm;
        prop_assert!(gap < 2.0 * tolerance + near, "{gap:e}");
    }
}

/// Values that are physical already stay, and few steps leave values that are physical too.
#[test]
fn steps_are_bounded_and_told() {
    let set = Physical::<10, 1>::new(&Symbol::INERTIAL.map(|s| Parameter::new(s, "1"))).unwrap();
    let unit: [[f64; 10]; 10] =
        std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
    let ball = [0.1, 0.0, 0.0, 0.1, 0.0, 0.1, 0.0, 0.0, 0.0, 2.0];
    let inside = [0.2, 0.01, 0.0, 0.3, 0.0, 0.25, 0.1, 0.0, 0.0, 1.0];
    let kept = set.closest((&unit, &inside), &ball, 0, 1e-6).unwrap();
    assert_eq!(
        (kept.values, kept.gap, kept.status),
        (inside, 0.0, Search::Reached)
    );
    // a mass that is negative
    let outside = [0.2, 0.0, 0.0, 0.3, 0.0, 0.25, 0.1, 0.0, 0.0, -1.0];
    let short = set.closest((&unit, &outside), &ball, 3, 1e-6).unwrap();
    assert_eq!(short.status, Search::Unfinished);
    assert!(set.contains(&short.values) && short.gap > 1e-6);
    let whole = set
        .closest((&unit, &outside), &short.values, 60, 1e-6)
        .unwrap();
    assert_eq!(whole.status, Search::Reached);
    assert!(whole.values[9] < 0.1, "{:?}", whole.values);
    // in single precision
    let single = set
        .closest(
            (
                &unit.map(|row| row.map(|x| x as f32)),
                &outside.map(|x| x as f32),
            ),
            &ball.map(|x| x as f32),
            60,
            1e-3,
        )
        .unwrap();
    assert_eq!(single.status, Search::Reached);
    for (a, b) in whole.values.iter().zip(single.values) {
        assert!((a - f64::from(b)).abs() < 0.05, "{whole:?} {single:?}");
    }
}

#[test]
fn what_is_no_set_or_no_start_is_an_error() {
    let mut list = parameters();
    assert_eq!(
        Physical::<P, 3>::new(&list).unwrap_err(),
        SettingError::Bodies
    );
    list[3] = list[2];
    assert_eq!(Set::new(&list).unwrap_err(), SettingError::Bodies);
    let set = Set::new(&parameters()).unwrap();
    let (r, z) = ([[1.0; P]; P], [0.0; P]);
    let fails =
        |start: [f64; P], tolerance| set.closest((&r, &z), &start, 9, tolerance).unwrap_err();
    for (at, bad) in [(9, -1.0), (9, f64::NAN), (0, 0.3), (20, -0.1)] {
        let mut start = balls();
        start[at] = bad;
        assert!(!set.contains(&start));
        assert_eq!(fails(start, 1e-6), SettingError::Start, "{at} {bad}");
    }
    assert_eq!(
        fails(balls(), 0.0),
        SettingError::NotPositive { of: "tolerance" }
    );
    let found = set.closest((&[[f64::NAN; P]; P], &z), &balls(), 9, 1e-6);
    assert_eq!(
        found.unwrap_err(),
        SettingError::NotFinite { of: "equations" }
    );
    // nothing tells the offset, which nothing bounds
    let stuck = set
        .closest((&[[0.0; P]; P], &z), &balls(), 9, 1e-6)
        .unwrap();
    assert_eq!(stuck.status, Search::Stuck);
    assert!(set.contains(&stuck.values));
}
