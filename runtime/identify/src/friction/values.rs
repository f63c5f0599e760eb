//! What the values of friction mean: the laws' symbols, and what the columns explain.

use regen_runtime::Friction;
use regen_runtime::friction::SHAPES;

use super::FrictionData;
use crate::estimate::QrFactor;
use crate::feasibility::FeasibilityError;

/// The squared residuals that columns with these values explain beyond all other columns.
pub(super) fn explained(
    factor: &QrFactor,
    columns: &[usize],
    x: &[f64],
) -> Result<f64, FeasibilityError> {
    let others = (0..factor.columns()).filter(|c| !columns.contains(c));
    let order: Vec<usize> = others.chain(columns.iter().copied()).collect();
    let last = factor.select(&order)?;
    let n = last.columns();
    let first = n - columns.len();
    let part = |row: usize| -> f64 {
        let own = columns.iter().zip(first..);
        own.map(|(c, k)| last.r()[k * n + row] * x.get(*c).copied().unwrap_or(0.0))
            .sum()
    };
    Ok((first..n).map(|row| part(row).powi(2)).sum())
}

/// The values of each joint's law as they are printed, in the order of the law's symbols.
///
/// - `laws`: the law of each joint that was fitted: its own or linear friction;
/// - `own`: the coefficients of these laws, joint by joint.
pub(super) fn symbols(
    data: &FrictionData,
    laws: &[Friction],
    own: &[f64],
    shapes: &[[f64; SHAPES]],
) -> Vec<Vec<f64>> {
    let mut next = 0;
    let mut out = Vec::with_capacity(data.joints.len());
    for (k, (joint, law)) in data.joints.iter().zip(&data.laws).enumerate() {
        let found = laws.get(k).copied().unwrap_or(*law);
        let used = found.coefficients().len();
        let own = own.get(next..next + used).unwrap_or_default();
        next += used;
        let shape = shapes.get(k).copied().unwrap_or([1.0; SHAPES]);
        let values = match (found, own) {
            (Friction::Linear, [fc, fv]) => {
                let (coefficients, shape) = law.of_linear([*fc, *fv], shape);
                law.join(&coefficients, shape)
            }
            _ => law.join(own, shape),
        };
        let mut values = values.to_vec();
        values.truncate(joint.friction.symbols().len());
        out.push(values);
    }
    out
}
