//! The equations with the friction of one joint, in which that of the others is as good as linear.

use std::sync::OnceLock;

use super::FrictionData;
use super::columns::{FrictionColumns, curved};
use super::data::Run;
use crate::estimate::EstimateError;
use regen_runtime::Friction;
use regen_runtime::friction::SHAPES;

impl FrictionData {
    /// The same equations with the friction of one joint alone: the coefficients of the others count as further
    /// linear parameters.
    ///
    /// - `values`: the base parameters and the coefficients of friction, if the shapes of the others are not known
    ///   but about these: the steps of their logarithms then count as linear parameters too.
    pub(super) fn of_joint(
        &self,
        joint: usize,
        laws: &[Friction],
        shapes: &[[f64; SHAPES]],
        values: Option<&[f64]>,
    ) -> Result<Self, EstimateError> {
        let columns = FrictionColumns {
            laws,
            shapes,
            has_slopes: values.is_some(),
        };
        let (dof, r, joints) = (self.dof, self.labels.len(), self.joints.len());
        let (mut kept, mut steps): (Vec<usize>, Vec<Vec<(usize, f64)>>) = <_>::default();
        kept.extend(0..r);
        let (mut column, mut slope) = (r, r + self.coefficients(laws).len());
        for (k, law) in laws.iter().enumerate() {
            let count = law.coefficients().len();
            if k != joint {
                kept.extend(column..column + count);
            }
            for _ in law.shape_symbols() {
                let coefficient = |c: usize| {
                    values
                        .and_then(|x| x.get(column + c))
                        .copied()
                        .unwrap_or(0.0)
                };
                let own = curved(*law).into_iter().zip(slope..);
                let own: Vec<(usize, f64)> =
                    own.map(|(c, place)| (place, coefficient(c))).collect();
                slope += own.len();
                if k != joint && values.is_some() {
                    steps.push(own);
                }
            }
            column += count;
        }
        let mut labels = self.labels.clone();
        labels.extend(self.coefficients(laws));
        let mut labels: Vec<String> = kept.iter().map(|c| labels[*c].clone()).collect();
        labels.extend((0..steps.len()).map(|k| format!("step {k}")));
        let mut w = Vec::with_capacity(self.len() * dof * labels.len());
        self.visit(&columns, &mut |rows| {
            let column = |k: usize| &rows.w[k * dof..(k + 1) * dof];
            for own in &kept {
                w.extend_from_slice(column(*own));
            }
            for own in &steps {
                let row = |i: usize| own.iter().map(|(k, x)| x * column(*k)[i]).sum::<f64>();
                w.extend((0..dof).map(row));
            }
            Ok(())
        })?;
        let every = |values: &[f64], width: usize| -> Vec<f64> {
            let groups = values.chunks_exact((joints * width).max(1));
            let own = groups.map(|all| &all[joint * width..(joint + 1) * width]);
            own.flatten().copied().collect()
        };
        let runs = self.runs.iter().map(|run| Run {
            times: run.times.clone(),
            qd: every(&run.qd, 1),
            directions: every(&run.directions, dof),
            known: run.known.clone(),
            averaged: run.averaged,
            equations: run.equations.clone(),
        });
        Ok(Self {
            labels,
            joints: vec![self.joints[joint].clone()],
            laws: vec![laws[joint]],
            dof,
            filtering: self.filtering,
            w,
            tau: self.tau.clone(),
            held: Vec::new(),
            weights: self.weights.clone(),
            runs: runs.collect(),
            acts: self.acts[joint * dof..(joint + 1) * dof].to_vec(),
            changes: Vec::new(),
            reduced: OnceLock::new(),
        })
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::states::FrictionJoint;

    #[test]
    fn one_joint_leaves_what_all_leave_and_less_where_the_shapes_of_the_others_may_move() {
        let joint = |name: &str| FrictionJoint {
            name: name.to_owned(),
            friction: Friction::Stribeck,
        };
        let mut data =
            FrictionData::new(&["J".to_owned()], &[joint("q1"), joint("q2")], 1).unwrap();
        let laws = [Friction::Stribeck; 2];
        let peak = |v: f64, vs: f64| v.signum() * (2.0 + (-(v / vs) * (v / vs)).exp()) + 0.3 * v;
        for t in 0..400 {
            let s = 0.05 * f64::from(t);
            let v = [s.cos(), (1.7 * s).cos()];
            let tau = 2.0 * (2.3 * s).sin() + peak(v[0], 0.2) + peak(v[1], 0.3);
            data.push(&[(2.3 * s).sin()], &[tau], &v, &[1.0, 1.0], &[1.0])
                .unwrap();
        }
        // the first shape is the true one
        let shapes = [[0.2, 2.0], [0.25, 2.0]];
        let all = data.factor(&laws, &shapes).unwrap();
        let values = all.solve().unwrap();
        let left = |values: Option<&[f64]>| {
            let own = data.of_joint(0, &laws, &shapes, values).unwrap();
            own.factor(&laws[..1], &shapes[..1]).unwrap().rss()
        };
        assert!((left(None) / all.rss() - 1.0).abs() < 1e-9);
        assert!(left(Some(&values)) < 0.2 * all.rss());
    }
}
