//! The columns of friction for given shapes.

use core::ops::Range;

use super::FrictionData;
use super::data::Run;
use crate::signals::SignalError;
use regen_runtime::Friction;
use regen_runtime::friction::SHAPES;

/// The columns of the shape parameters, which follow those of the laws' coefficients.
#[derive(Clone, Copy, Debug)]
pub(super) enum Behind<'a> {
    /// For each shape parameter and each coefficient whose column it may change: the derivative of
    /// that column with respect to the logarithm of the parameter.
    Slopes,
    /// For each shape parameter: the derivative of the effort with respect to its logarithm, at the
    /// given values of all coefficients, times the given reach. The unknown of this column is 1 plus
    /// the step in units of the reach, so that these columns are also added to the efforts.
    Steps(&'a [f64], f64),
}

/// The columns of friction: those of the laws' coefficients, joint by joint, then those of the shape
/// parameters.
#[derive(Clone, Copy, Debug)]
pub(super) struct FrictionColumns<'a> {
    pub(super) laws: &'a [Friction],
    pub(super) shapes: &'a [[f64; SHAPES]],
    pub(super) behind: Behind<'a>,
}

/// The indices of a law's coefficients whose columns depend on its shape.
pub(super) fn curved(law: Friction) -> Vec<usize> {
    let at = |shape: f64| law.columns(0.5, 1.0, [shape; SHAPES]);
    let pairs = at(1.0).into_iter().zip(at(2.0));
    let changes = pairs.take(law.coefficients().len()).enumerate();
    changes
        .filter(|(_, (a, b))| !law.is_linear() && a.total_cmp(b).is_ne())
        .map(|(c, _)| c)
        .collect()
}

impl FrictionColumns<'_> {
    /// The number of columns of the laws' coefficients.
    fn coefficients(&self) -> usize {
        self.laws.iter().map(|law| law.coefficients().len()).sum()
    }

    /// The number of columns of a law's shape parameters.
    fn behind(&self, law: Friction) -> usize {
        let shapes = law.shape_symbols().len();
        match self.behind {
            Behind::Slopes => shapes * curved(law).len(),
            Behind::Steps(..) => shapes,
        }
    }

    /// The number of columns.
    pub(super) fn count(&self) -> usize {
        let behind = self.laws.iter().map(|law| self.behind(*law));
        self.coefficients() + behind.sum::<usize>()
    }

    /// The columns that are added to the efforts.
    pub(super) fn shifts_efforts(&self) -> Range<usize> {
        match self.behind {
            Behind::Slopes => 0..0,
            Behind::Steps(..) => self.coefficients()..self.count(),
        }
    }

    /// The column and the row of each entry of a sample; other entries are zero.
    pub(super) fn places(&self, data: &FrictionData) -> Vec<(usize, usize)> {
        let dof = data.dof();
        let rows_of = |k: usize| (0..dof).filter(move |i| data.acts[k * dof + i]);
        let mut places = Vec::new();
        let (mut column, mut behind) = (0, self.coefficients());
        for (k, law) in self.laws.iter().enumerate() {
            for c in 0..law.coefficients().len() {
                places.extend(rows_of(k).map(|i| (column + c, i)));
            }
            column += law.coefficients().len();
            for c in 0..self.behind(*law) {
                places.extend(rows_of(k).map(|i| (behind + c, i)));
            }
            behind += self.behind(*law);
        }
        places
    }

    /// The entries of the columns of a run in the order of [`places`](Self::places), averaged and
    /// filtered as the equations are.
    pub(super) fn entries(
        &self,
        data: &FrictionData,
        run: &Run,
        out: &mut Vec<f64>,
    ) -> Result<(), SignalError> {
        out.clear();
        let (dof, joints) = (data.dof(), data.joints.len());
        let curved: Vec<Vec<usize>> = self.laws.iter().map(|law| curved(*law)).collect();
        for sample in 0..run.times.len() {
            let mut column = data.labels.len();
            for (k, law) in self.laws.iter().enumerate() {
                let v = run.qd[sample * joints + k];
                let sign = if v == 0.0 { 0.0 } else { v.signum() };
                let shape = self.shapes.get(k).copied().unwrap_or([1.0; SHAPES]);
                let direction = &run.directions[(sample * joints + k) * dof..][..dof];
                let acts = &data.acts[k * dof..][..dof];
                let mut add = |value: f64| {
                    let rows = direction.iter().zip(acts).filter(|(_, acts)| **acts);
                    out.extend(rows.map(|(d, _)| d * value));
                };
                let used = law.coefficients().len();
                let symbols = law.shape_symbols().len();
                let (own, slopes) = if symbols > 0 {
                    law.columns_and_slopes(v, sign, shape)
                } else {
                    (law.columns(v, sign, shape), <_>::default())
                };
                for value in &own[..used] {
                    add(*value);
                }
                if symbols > 0 {
                    for slope in &slopes[..symbols] {
                        match self.behind {
                            Behind::Slopes => curved[k].iter().for_each(|c| add(slope[*c])),
                            Behind::Steps(x, reach) => {
                                let own = x.get(column..column + used).unwrap_or_default();
                                let effect: f64 = slope.iter().zip(own).map(|(s, x)| s * x).sum();
                                add(effect * reach);
                            }
                        }
                    }
                }
                column += used;
            }
        }
        let channels = out.len().checked_div(run.times.len()).unwrap_or(0);
        run.filter(&data.filtering, out, channels)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A shape changes the columns of these coefficients and of no others.
    #[test]
    fn all_columns_that_a_shape_changes_are_found() {
        for law in Friction::ALL {
            let found = curved(law);
            assert_eq!(found.is_empty(), law.is_linear(), "{law:?}");
            for v in [-2.0, -0.3, 1e-3, 0.7, 5.0_f64] {
                for shape in [[0.1, 0.5], [1.0, 1.0], [3.0, 2.0]] {
                    for slope in law.slopes(v, v.signum(), shape) {
                        for (c, x) in slope.iter().enumerate() {
                            assert!(*x == 0.0 || found.contains(&c), "{law:?} {c}");
                        }
                    }
                }
            }
        }
    }
}
