//! Comparison of two specs of one mechanism, cut at different joints: the same bodies, the same
//! independent coordinates.

use regen_codegen::signature::FunctionKind;
use std::collections::BTreeMap;

use nalgebra::DMatrix;

use super::check::ROW_TOLERANCE;
use super::compare::{Figures, row_error, vector_error};
use super::{Answer, Engine};

/// An engine for one spec of a mechanism, and the reference.
pub type Side<'a> = (&'a dyn Engine, &'a crate::reference::Mechanism);

/// Compares two specs of one mechanism at random states: bodies with the same label have the same
/// pose, columns with the same label are equal, and the rows belong to the same independent
/// coordinates.
///
/// # Errors
/// When the specs disagree, have different independent coordinates, or no column or no body in
/// common.
pub fn check_pair(a: Side, b: Side, seed: u64, states: usize) -> Result<Figures, String> {
    let who = format!("{} and {}", a.1.name, b.1.name);
    let (names_a, names_b) = (a.0.names(), b.0.names());
    if names_a.independent != names_b.independent {
        return Err(format!("{who}: different independent coordinates"));
    }
    let place = |labels: &[String]| -> BTreeMap<String, usize> {
        labels
            .iter()
            .cloned()
            .enumerate()
            .map(|(i, l)| (l, i))
            .collect()
    };
    let common = |ours: &[String], theirs: &[String]| -> Vec<(usize, usize)> {
        let theirs = place(theirs);
        let found = ours.iter().enumerate();
        found
            .filter_map(|(i, l)| theirs.get(l).map(|j| (i, *j)))
            .collect()
    };
    let columns = common(&names_a.parameters, &names_b.parameters);
    let bodies = common(&names_a.bodies, &names_b.bodies);
    if columns.is_empty() || bodies.is_empty() {
        return Err(format!("{who}: nothing in common"));
    }
    let mut figures = Figures::default();
    for state in a.1.random_states(seed, states)? {
        let pick = |v: &[f64]| -> Vec<f64> { a.1.independent.iter().map(|k| v[*k]).collect() };
        let q = b.1.follow(&b.1.home()?, &pick(&state.q))?;
        let qd =
            b.0.call(FunctionKind::Velocities, &[&q, &pick(&state.qd)])?;
        let qdd =
            b.0.call(FunctionKind::Accelerations, &[&q, &qd, &pick(&state.qdd)])?;
        let poses = (a.0.poses(&state.q)?, b.0.poses(&q)?);
        for (i, j) in &bodies {
            // Positions are solutions of the closure, accurate to rounding times the conditioning.
            let error = vector_error(&poses.0[*i], &poses.1[*j], 1.0);
            figures.record("poses", error, 1e-10);
        }
        let ours = selected(
            &a.0.matrix(FunctionKind::Regressor, &[&state.q, &state.qd, &state.qdd]),
            &columns,
            true,
        )?;
        let theirs = selected(
            &b.0.matrix(FunctionKind::Regressor, &[&q, &qd, &qdd]),
            &columns,
            false,
        )?;
        figures.record("regressor", row_error(&ours, &theirs), ROW_TOLERANCE);
    }
    figures.verdict(&who)
}

fn selected(
    regressor: &Answer<DMatrix<f64>>,
    columns: &[(usize, usize)],
    first: bool,
) -> Answer<DMatrix<f64>> {
    let pick: Vec<usize> = columns
        .iter()
        .map(|(i, j)| if first { *i } else { *j })
        .collect();
    Ok(regressor
        .as_ref()
        .map_err(Clone::clone)?
        .select_columns(&pick))
}
