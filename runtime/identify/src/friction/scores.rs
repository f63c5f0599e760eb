//! The covariance of fits with friction on the equations in memory, from their scores.

use super::FrictionData;
use super::columns::FrictionColumns;
use super::data::Rows;
use crate::estimate::{
    Blocks, Deviations, EffortNoise, EstimateError, NoiseResiduals, QrFactor, changed_by,
};
use crate::qr_update::substitute;

/// A least-squares fit of the columns of base parameters and of friction.
pub(super) struct FittedColumns<'a> {
    pub(super) data: &'a FrictionData,
    pub(super) columns: FrictionColumns<'a>,
    /// The values of the fitted columns.
    pub(super) values: &'a [f64],
}

/// A callback that takes the rows, the residuals, and for each effort 1 if it is used or 0.
type RowVisitor<'a> = dyn FnMut(&Rows<'_>, &[f64], &[f64]) -> Result<(), EstimateError> + 'a;

impl FittedColumns<'_> {
    /// Calls `each` for every sample, see [`RowVisitor`].
    fn visit(&self, each: &mut RowVisitor<'_>) -> Result<(), EstimateError> {
        let dof = self.data.dof();
        let mut left = vec![0.0; dof];
        let mut used = vec![0.0; dof];
        self.data.visit(&self.columns, &mut |rows| {
            left.copy_from_slice(rows.tau);
            for (column, value) in rows.w.chunks_exact(dof.max(1)).zip(self.values) {
                for (rest, x) in left.iter_mut().zip(column) {
                    *rest -= x * value;
                }
            }
            for (slot, weight) in used.iter_mut().zip(rows.weights) {
                *slot = f64::from(*weight > 0.0);
            }
            each(&rows, &left, &used)
        })
    }

    /// The model of each effort's noise.
    fn noise(&self) -> Result<EffortNoise, EstimateError> {
        let dof = self.data.dof();
        let mut residuals = NoiseResiduals::new(dof, self.data.filtered_noise());
        self.visit(&mut |rows, left, used| {
            if !rows.follows {
                residuals.interrupt();
            }
            let used: Vec<bool> = used.iter().map(|x| *x > 0.0).collect();
            residuals.push(left, &used)
        })?;
        Ok(residuals.noise())
    }

    /// The scores of the fitted columns.
    fn blocks(&self) -> Result<Blocks, EstimateError> {
        let mut scores = self.noise()?.scores(self.values.len());
        let ones = vec![1.0; self.data.dof()];
        self.visit(&mut |rows, left, used| {
            if !rows.follows {
                scores.interrupt();
            }
            scores.push(rows.w, used, left, &ones)
        })?;
        scores.finish(self.values)
    }

    /// The covariance of the values.
    ///
    /// The columns of a law can be nearly the same, such as those of the velocity and of an arctangent
    /// that hardly bends. Sums of products of such columns leave nothing of their difference, so that
    /// the scores are those of orthonormal combinations of the columns.
    ///
    /// - `factor`: the QR factor of the fitted columns.
    pub(super) fn deviations(&self, factor: &QrFactor) -> Result<Deviations, EstimateError> {
        let (n, dof) = (factor.columns(), self.data.dof());
        let mut inverse = Vec::with_capacity(n);
        let mut identity = vec![0.0; n * n];
        for k in 0..n {
            identity[k * n + k] = 1.0;
            let unit = &identity[k * n..(k + 1) * n];
            inverse.push(substitute(factor.r(), unit).ok_or(EstimateError::NoConvergence)?);
        }
        let mut scores = self.noise()?.scores(n);
        let ones = vec![1.0; dof];
        let mut orthonormal = vec![0.0; n * dof];
        self.visit(&mut |rows, left, used| {
            if !rows.follows {
                scores.interrupt();
            }
            // each row solves `row R = w`
            orthonormal.copy_from_slice(rows.w);
            for (j, column) in factor.r().chunks_exact(n.max(1)).enumerate() {
                let (before, rest) = orthonormal.split_at_mut(j * dof);
                let own = &mut rest[..dof];
                for (earlier, r) in before.chunks_exact(dof.max(1)).zip(column) {
                    for (x, y) in own.iter_mut().zip(earlier) {
                        *x -= r * y;
                    }
                }
                for x in own {
                    *x /= column[j];
                }
            }
            scores.push(&orthonormal, used, left, &ones)
        })?;
        let (labels, z) = (factor.labels().to_vec(), factor.z());
        let orthonormal =
            QrFactor::from_parts(labels, identity, z.to_vec(), factor.rss(), factor.rows())?;
        let all: Vec<usize> = (0..n).collect();
        let found = scores.finish(z)?.deviations(&orthonormal, &all, z, 1.0)?;
        let map = (0..n).map(|i| inverse.iter().map(|column| column[i]).collect());
        Ok(found.mapped(&map.collect::<Vec<Vec<f64>>>()))
    }
}

impl FrictionData {
    /// The scores of least squares with linear friction, for the covariance of its parameters.
    ///
    /// - `values`: the solution of the [`linear_factor`](Self::linear_factor), SI.
    ///
    /// # Errors
    /// When sizes do not fit, or the filter does not suit the samples.
    pub(crate) fn linear_scores(&self, values: &[f64]) -> Result<Blocks, EstimateError> {
        let fitted = FittedColumns {
            data: self,
            columns: FrictionColumns {
                laws: &self.linear_laws(),
                shapes: &[],
                has_slopes: false,
            },
            values,
        };
        fitted.blocks()
    }

    /// The change of the parameters of linear friction if efforts are held between the rows, in their
    /// units; see [`Equations::held`](crate::identify::Equations::held).
    ///
    /// - `factor`: the [`linear_factor`](Self::linear_factor).
    ///
    /// # Errors
    /// As [`linear_scores`](Self::linear_scores).
    pub(crate) fn linear_change_if_held(
        &self,
        factor: &QrFactor,
    ) -> Result<Vec<f64>, EstimateError> {
        let dof = self.dof();
        let columns = FrictionColumns {
            laws: &self.linear_laws(),
            shapes: &[],
            has_slopes: false,
        };
        let mut scores = vec![0.0; factor.columns()];
        let mut held = self.held().chunks_exact(dof.max(1));
        self.visit(&columns, &mut |rows| {
            let held = held.next().unwrap_or_default();
            for (sum, column) in scores.iter_mut().zip(rows.w.chunks_exact(dof.max(1))) {
                *sum += column.iter().zip(held).map(|(w, x)| w * x).sum::<f64>();
            }
            Ok(())
        })?;
        Ok(changed_by(factor, &scores).unwrap_or_else(|| vec![0.0; scores.len()]))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::expect_used)]
mod tests {
    use super::*;
    use crate::states::FrictionJoint;
    use regen_runtime::Friction;

    /// An arctangent that hardly bends has nearly the column of viscous friction.
    #[test]
    fn nearly_equal_columns_leave_the_deviations_of_all_others_as_they_are() {
        let joint = FrictionJoint {
            name: "q1".to_owned(),
            friction: Friction::Atan,
        };
        let mut data = FrictionData::new(&["J".to_owned()], &[joint], 1).unwrap();
        for t in 0..800 {
            let s = 0.02 * f64::from(t);
            let (v, a) = (s.cos() + 0.5 * (2.3 * s).cos(), (1.7 * s).sin());
            let noise = 0.1 * (12.9898 * f64::from(t * t % 1009)).sin();
            let tau = 2.0 * a + 1.5 * v.signum() + 3.0 * v + noise;
            data.push(&[a], &[tau], &[v], &[1.0], &[1.0]).unwrap();
        }
        let shapes = [[0.01, 1.0]];
        let sigmas = |law: Friction| -> Vec<f64> {
            let factor = data.factor(&[law], &shapes).unwrap();
            let values = factor.solve().unwrap();
            let fitted = FittedColumns {
                data: &data,
                columns: FrictionColumns {
                    laws: &[law],
                    shapes: &shapes,
                    has_slopes: false,
                },
                values: &values,
            };
            let found = fitted.deviations(&factor).unwrap();
            assert!(found.root().iter().all(|x| x.is_finite()), "{law:?}");
            (0..values.len()).map(|k| found.sigma(k)).collect()
        };
        // base, Fc, Fv1, Fv2 beside base, Fc, Fv
        let (all, plain) = (sigmas(Friction::Atan), sigmas(Friction::Linear));
        for (own, plain) in all.iter().zip(&plain).take(2) {
            assert!((0.5..2.0).contains(&(own / plain)), "{all:?} {plain:?}");
        }
        // nearly the same effort, once as Fv1 v and once as Fv2 atan(0.01 v)
        assert!(all[2] > 1e3 * plain[2], "{all:?} {plain:?}");
        assert!((0.5..3.0).contains(&(0.01 * all[3] / all[2])), "{all:?}");
    }
}
