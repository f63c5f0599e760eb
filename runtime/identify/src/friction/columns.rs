//! The columns of friction for given shapes.

use super::FrictionData;
use super::data::Run;
use crate::signals::SignalError;
use regen_runtime::Friction;
use regen_runtime::friction::SHAPES;

/// The columns of friction: those of the laws' coefficients, joint by joint, then their slopes.
#[derive(Clone, Copy, Debug)]
pub(super) struct FrictionColumns<'a> {
    pub(super) laws: &'a [Friction],
    pub(super) shapes: &'a [[f64; SHAPES]],
    /// Whether there are, for each shape parameter and each coefficient whose column it changes, the derivatives of
    /// that column with respect to the logarithm of the parameter.
    pub(super) has_slopes: bool,
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

    /// The number of slopes of a law.
    fn slopes(&self, law: Friction) -> usize {
        if self.has_slopes {
            law.shape_symbols().len() * curved(law).len()
        } else {
            0
        }
    }

    /// The number of columns.
    pub(super) fn count(&self) -> usize {
        let slopes = self.laws.iter().map(|law| self.slopes(*law));
        self.coefficients() + slopes.sum::<usize>()
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
            for c in 0..self.slopes(*law) {
                places.extend(rows_of(k).map(|i| (behind + c, i)));
            }
            behind += self.slopes(*law);
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
                let symbols = if self.has_slopes {
                    law.shape_symbols().len()
                } else {
                    0
                };
                let (own, slopes) = if symbols > 0 {
                    law.columns_and_slopes(v, sign, shape)
                } else {
                    (law.columns(v, sign, shape), <_>::default())
                };
                for value in &own[..used] {
                    add(*value);
                }
                for slope in &slopes[..symbols] {
                    curved[k].iter().for_each(|c| add(slope[*c]));
                }
            }
        }
        let rows: Vec<usize> = self.places(data).into_iter().map(|own| own.1).collect();
        run.filter(&data.filtering, out, &rows)
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
