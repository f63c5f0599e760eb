//! The residuals of a model on the equations in memory.

use super::{FrictionData, JointFit};
use crate::estimate::{EstimateError, Residuals};
use crate::identify::Means;

impl FrictionData {
    /// The statistics of the residuals: measured efforts minus those of the base parameters and of
    /// the friction of the data's joints, which passes the filter of the measured efforts.
    ///
    /// - `efforts`: the names of the efforts; `values`: r base parameters, SI;
    /// - `friction`: that of each of [`joints`](Self::joints), in their order;
    /// - `lags`: the number of autocorrelations to compute.
    ///
    /// # Errors
    /// When sizes do not fit, or the filter does not suit the samples.
    pub fn residuals(
        &self,
        efforts: &[String],
        values: &[f64],
        friction: &[JointFit],
        lags: usize,
    ) -> Result<Residuals, EstimateError> {
        let (dof, r, joints) = (self.dof(), self.labels.len(), self.joints.len());
        for (what, expected, got) in [
            ("efforts", dof, efforts.len()),
            ("values", r, values.len()),
            ("friction", joints, friction.len()),
        ] {
            crate::estimate::require(what, expected, got)?;
        }
        // the weight of an equation may be 0, then it is not used
        let unweighted = |x: f64, weight: f64| if weight > 0.0 { x / weight } else { 0.0 };
        let mut measured = Vec::with_capacity(self.tau.len());
        let mut means = Means::new(dof);
        for (tau, weights) in self.samples() {
            let start = measured.len();
            measured.extend(tau.iter().zip(weights).map(|(x, w)| unweighted(*x, *w)));
            means.push(&measured[start..], weights);
        }
        let mut out = Residuals::new(efforts, &means.finish(), lags);
        let laws: Vec<_> = friction.iter().map(JointFit::law).collect();
        let (mut friction, mut fitted) = (Vec::new(), vec![0.0; dof]);
        let mut used = vec![false; dof];
        let rows: Vec<usize> = (0..dof).collect();
        self.visit_runs(&mut |run, first| {
            friction.clear();
            friction.resize(run.times.len() * dof, 0.0);
            for (sample, sums) in friction.chunks_exact_mut(dof.max(1)).enumerate() {
                for (k, law) in laws.iter().enumerate() {
                    let place = sample * joints + k;
                    let effort = law.effort(run.qd[place]);
                    for (sum, d) in sums.iter_mut().zip(&run.directions[place * dof..]) {
                        *sum += d * effort;
                    }
                }
            }
            run.filter(&self.filtering, &mut friction, &rows)?;
            for (index, (equation, sample)) in (first..).zip(&run.equations).enumerate() {
                if index == 0 {
                    out.interrupt();
                }
                let weights = &self.weights[equation * dof..][..dof];
                let w = &self.w[equation * dof * r..][..dof * r];
                fitted.fill(0.0);
                for (column, x) in w.chunks_exact(dof.max(1)).zip(values) {
                    for (sum, w) in fitted.iter_mut().zip(column) {
                        *sum += w * x;
                    }
                }
                let own = &friction[sample * dof..][..dof];
                for ((sum, weight), friction) in fitted.iter_mut().zip(weights).zip(own) {
                    *sum = unweighted(*sum, *weight) + friction;
                }
                for (used, weight) in used.iter_mut().zip(weights) {
                    *used = *weight > 0.0;
                }
                out.push_used(&measured[equation * dof..][..dof], &fitted, &used)?;
            }
            Ok(())
        })?;
        Ok(out)
    }

    /// The weighted efforts and the weights of each equation.
    fn samples(&self) -> impl Iterator<Item = (&[f64], &[f64])> {
        let dof = self.dof().max(1);
        let weights = self.weights.chunks_exact(dof);
        self.tau.chunks_exact(dof).zip(weights)
    }
}
