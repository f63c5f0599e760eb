//! Completes a log after the run: computes accelerations and energies from the integrated states, in
//! blocks of samples.

use regen_batch::eval_many;
use regen_runtime::{Arguments, Function, Model, SizeError};

use super::log::Log;

/// The number of samples that are computed at a time.
const BLOCK: usize = 256;

/// The parameters that the energies depend on.
pub(super) struct Weights<'a> {
    /// The parameters (p), with those of friction set to zero.
    pub(super) phi: &'a [f64],
    /// Mass and first moments of each body, kg and kg m.
    pub(super) moments: &'a [[f64; 4]],
    /// The constant effort of each coordinate, N m or N.
    pub(super) offsets: &'a [f64],
}

/// Adds the accelerations of all coordinates to a log, and completes its energies and the error of
/// their balance if it has energies.
///
/// - `qdd_i`: the accelerations of the independent coordinates (dof per row).
pub(super) fn complete<M: Model<f64> + ?Sized>(
    model: &M,
    weights: &Weights<'_>,
    qdd_i: &[f64],
    log: &mut Log,
) -> Result<(), SizeError> {
    let (n, dof) = (model.info().coordinates.len(), model.info().dof());
    let rows = log.t.len();
    for first in (0..rows).step_by(BLOCK) {
        let count = BLOCK.min(rows - first);
        let [q, qd] = [&log.q, &log.qd].map(|all| series(all, first, count, n));
        let qdd_i = series(qdd_i, first, count, dof);
        let mut qdd = vec![0.0; n * count];
        let arguments = Arguments {
            q: &q,
            qd: &qd,
            qdd_i: &qdd_i,
            ..Arguments::EMPTY
        };
        let mut pivots = vec![1.0; count];
        eval_many(
            model,
            Function::Accelerations,
            count,
            arguments,
            &mut qdd,
            &mut pivots,
        )?;
        for row in 0..count {
            log.qdd.extend(qdd.iter().skip(row).step_by(count));
        }
        if log.energy.is_empty() {
            continue;
        }
        let kinetic = kinetic(model, weights.phi, &q, &qd, count)?;
        let potential = potential(model, weights, &q, count)?;
        let both = kinetic.iter().zip(&potential);
        for (energy, (kinetic, potential)) in log.energy.iter_mut().skip(first).zip(both) {
            (energy.kinetic, energy.potential) = (*kinetic, *potential);
        }
    }
    log.imbalance = match log.energy.first().copied() {
        Some(start) => {
            let errors = log.energy.iter().map(|e| e.imbalance(start).abs());
            errors.fold(0.0, f64::max)
        }
        None => f64::NAN,
    };
    Ok(())
}

/// `count` rows from `first` on, of `width` entries each, as one series per entry.
fn series(rows: &[f64], first: usize, count: usize, width: usize) -> Vec<f64> {
    let rows = rows
        .get(first * width..(first + count) * width)
        .unwrap_or_default();
    (0..width)
        .flat_map(|entry| rows.iter().skip(entry).step_by(width.max(1)).copied())
        .collect()
}

/// The kinetic energies at closed states, J.
fn kinetic<M: Model<f64> + ?Sized>(
    model: &M,
    phi: &[f64],
    q: &[f64],
    qd: &[f64],
    count: usize,
) -> Result<Vec<f64>, SizeError> {
    let info = model.info();
    let dof = info.dof();
    let mut mass = vec![0.0; dof * dof * count];
    let arguments = Arguments {
        q,
        phi,
        ..Arguments::EMPTY
    };
    let mut pivots = vec![1.0; count];
    eval_many(
        model,
        Function::MassMatrix,
        count,
        arguments,
        &mut mass,
        &mut pivots,
    )?;
    let mut out = vec![0.0; count];
    let mut v = vec![0.0; dof];
    for (state, out) in out.iter_mut().enumerate() {
        for (v, c) in v.iter_mut().zip(info.independent) {
            *v = qd[c * count + state];
        }
        let twice: f64 = (0..dof)
            .map(|i| {
                let entries = (0..dof).map(|j| mass[(i * dof + j) * count + state] * v[j]);
                v[i] * entries.sum::<f64>()
            })
            .sum();
        *out = 0.5 * twice;
    }
    Ok(out)
}

/// The potential energies of gravity and of the constant efforts at closed states, J.
fn potential<M: Model<f64> + ?Sized>(
    model: &M,
    weights: &Weights<'_>,
    q: &[f64],
    count: usize,
) -> Result<Vec<f64>, SizeError> {
    let gravity = model.info().gravity;
    let mut poses = vec![0.0; 12 * weights.moments.len() * count];
    let arguments = Arguments {
        q,
        ..Arguments::EMPTY
    };
    let mut pivots = vec![1.0; count];
    eval_many(
        model,
        Function::Poses,
        count,
        arguments,
        &mut poses,
        &mut pivots,
    )?;
    let mut out = vec![0.0; count];
    for (state, out) in out.iter_mut().enumerate() {
        let efforts = weights.offsets.iter().enumerate();
        let mut energy: f64 = efforts
            .map(|(c, effort)| effort * q[c * count + state])
            .sum();
        for (body, [m, mx, my, mz]) in weights.moments.iter().enumerate() {
            let pose = |entry: usize| poses[(12 * body + entry) * count + state];
            for (i, g) in gravity.iter().enumerate() {
                let turned = pose(3 * i) * mx + pose(3 * i + 1) * my + pose(3 * i + 2) * mz;
                energy -= g * (m * pose(9 + i) + turned);
            }
        }
        *out = energy;
    }
    Ok(out)
}
