//! Mechanisms with known numbers of base parameters: the reference's regressor has these ranks.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use nalgebra::DMatrix;
use regen_tests::files;
use regen_tests::reference::{Mechanism, Parameter};

/// The rank of the inertial columns over random closed states, and the ratio of the singular values
/// on both sides of it.
fn rank(m: &Mechanism) -> (usize, f64) {
    let columns: Vec<usize> = (0..m.parameters.len())
        .filter(|j| matches!(m.parameters[*j], Parameter::Inertial(..)))
        .collect();
    let count = (3 * columns.len() / 2).div_ceil(m.dof());
    let mut w = DMatrix::zeros(0, columns.len());
    for state in m.random_states(9, count).unwrap() {
        let block = m.regressor(&state.q, &state.qd, &state.qdd).unwrap();
        let at = w.nrows();
        w = w.insert_rows(at, m.dof(), 0.0);
        w.rows_mut(at, m.dof())
            .copy_from(&block.select_columns(&columns));
    }
    for mut column in w.column_iter_mut() {
        let norm = column.norm();
        if norm > 1e-9 {
            column /= norm;
        } else {
            column.fill(0.0);
        }
    }
    let mut values: Vec<f64> = w.singular_values().iter().copied().collect();
    values.sort_by(|a, b| b.total_cmp(a));
    // values below this bound are rounding errors; the gap is the ratio on both sides of it
    let bound = 1e-9 * values[0];
    let kept = values.iter().filter(|v| **v > bound).count();
    let gap = values
        .get(kept)
        .map_or(f64::INFINITY, |next| values[kept - 1] / next.max(1e-18));
    (kept, gap)
}

#[test]
fn random_closed_states_reach_the_known_number_of_base_parameters() {
    let known = [
        (files::robots().join("3rps.yaml"), 25),
        (files::robots().join("puma560.yaml"), 36),
        (files::robots().join("fivebar.yaml"), 11),
        (files::robots().join("fourbar.yaml"), 8),
        (files::robots().join("tree_branch.yaml"), 29),
        (files::pairs().join("slider_crank/pin.yaml"), 6),
        (files::pairs().join("rsur/universal.yaml"), 14),
        (files::mechanisms().join("rrr3.yaml"), 19),
        (files::mechanisms().join("prs3.yaml"), 19),
        (files::mechanisms().join("delta.yaml"), 34),
        (files::mechanisms().join("parallelogram.yaml"), 3),
        (files::mechanisms().join("parallelogram_cut.yaml"), 3),
    ];
    for (file, expected) in known {
        let mechanism = files::mechanism(&file).unwrap();
        let (found, gap) = rank(&mechanism);
        println!("{}: {found}, gap {gap:.1e}", mechanism.name);
        assert_eq!(found, expected, "{}", mechanism.name);
        assert!(gap > 1e3, "{}: gap {gap:e}", mechanism.name);
    }
}
