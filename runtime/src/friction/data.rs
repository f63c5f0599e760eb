//! Samples with what friction needs of them.

use std::prelude::v1::*;
use std::vec;

use crate::estimate::{EstimateError, Factor};
use crate::feasibility::FeasibilityError;
use crate::law::{Law, SHAPES};
use crate::{Condition, Friction, Model, SizeError};

/// How friction at joints acts on the rows of the reduced model: column k is the derivative of
/// the joint's velocity by the independent velocities, the unit vector at an independent joint
/// and a row of -X at a dependent one (Eq. 10).
///
/// - `q`: n coordinates; `joints`: indices of coordinates;
/// - returns: dof x joints, column by column, and the worst condition of the solves.
///
/// # Errors
/// When a length does not fit.
pub fn directions<M: Model<f64> + ?Sized>(
    model: &M,
    q: &[f64],
    joints: &[usize],
) -> Result<(Vec<f64>, Condition<f64>), SizeError> {
    let info = model.info();
    let (n, dof) = (info.coordinates.len(), info.dof());
    let mut out = vec![0.0; dof * joints.len()];
    let mut unit = vec![0.0; dof];
    let mut qd = vec![0.0; n];
    let mut worst: Option<Condition<f64>> = None;
    for i in 0..dof {
        unit.fill(0.0);
        unit[i] = 1.0;
        let condition = model.velocities(q, &unit, &mut qd)?;
        if worst.is_none_or(|w| condition.pivot < w.pivot) {
            worst = Some(condition);
        }
        for (k, joint) in joints.iter().enumerate() {
            out[k * dof + i] = qd.get(*joint).copied().ok_or(SizeError {
                argument: "joints",
                expected: n,
                got: joint + 1,
            })?;
        }
    }
    match worst {
        Some(condition) => Ok((out, condition)),
        None => Ok((out, model.velocities(q, &unit, &mut qd)?)),
    }
}

/// A joint with nonlinear friction.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FrictionJoint {
    /// The coordinate's name.
    pub name: String,
    /// Its law: `Stribeck`, `Atan` or `Power`.
    pub friction: Friction,
}

/// Equations of the parameters that are linear, with the motion of the joints whose friction is
/// not. It stays in memory: friction's columns change with its shape.
#[derive(Clone, Debug)]
pub struct FrictionData {
    pub(super) labels: Vec<String>,
    pub(super) joints: Vec<FrictionJoint>,
    pub(super) laws: Vec<Law>,
    dof: usize,
    /// Sample by sample: dof x columns, column by column.
    w: Vec<f64>,
    tau: Vec<f64>,
    qd: Vec<f64>,
    directions: Vec<f64>,
}

impl FrictionData {
    /// Starts without samples.
    ///
    /// - `labels`: of the r columns of the linear equations (base parameters);
    /// - `dof`: rows of each sample.
    ///
    /// # Errors
    /// When a joint's law is linear: it has columns among the parameters.
    pub fn new(
        labels: &[String],
        joints: &[FrictionJoint],
        dof: usize,
    ) -> Result<Self, FeasibilityError> {
        let law = |joint: &FrictionJoint| {
            Law::of(joint.friction).ok_or_else(|| FeasibilityError::Unknown {
                what: "nonlinear friction law at joint",
                label: joint.name.clone(),
            })
        };
        Ok(Self {
            labels: labels.to_vec(),
            laws: joints.iter().map(law).collect::<Result<_, _>>()?,
            joints: joints.to_vec(),
            dof,
            w: Vec::new(),
            tau: Vec::new(),
            qd: Vec::new(),
            directions: Vec::new(),
        })
    }

    /// Adds a sample.
    ///
    /// - `w`: dof x r, column by column; `tau`: dof, N or N m; `qd`: the joints' velocities;
    /// - `directions`: dof x joints, column by column, see [`directions`];
    /// - `weights`: what each row is multiplied by, dof: 1/sigma.
    ///
    /// # Errors
    /// When lengths do not fit or a value is not finite; nothing is then added.
    pub fn push(
        &mut self,
        w: &[f64],
        tau: &[f64],
        qd: &[f64],
        directions: &[f64],
        weights: &[f64],
    ) -> Result<(), EstimateError> {
        let (dof, joints) = (self.dof, self.joints.len());
        for (what, expected, values) in [
            ("w", dof * self.labels.len(), w),
            ("tau", dof, tau),
            ("qd", joints, qd),
            ("directions", dof * joints, directions),
            ("weights", dof, weights),
        ] {
            if values.len() != expected {
                let got = values.len();
                return Err(EstimateError::Size {
                    what,
                    expected,
                    got,
                });
            }
            if let Some(row) = values.iter().position(|x| !x.is_finite()) {
                return Err(EstimateError::NotFinite { what, row });
            }
        }
        let weighted = |values: &[f64], into: &mut Vec<f64>| {
            let rows = values.chunks_exact(dof.max(1));
            into.extend(rows.flat_map(|c| c.iter().zip(weights).map(|(x, s)| x * s)));
        };
        weighted(w, &mut self.w);
        weighted(tau, &mut self.tau);
        weighted(directions, &mut self.directions);
        self.qd.extend(qd);
        Ok(())
    }

    /// Multiplies the rows of each effort, dof weights: by 1/sigma.
    ///
    /// # Errors
    /// When the length does not fit or a weight is not positive.
    pub fn weigh(&mut self, weights: &[f64]) -> Result<(), EstimateError> {
        if weights.len() != self.dof {
            return Err(EstimateError::Size {
                what: "weights",
                expected: self.dof,
                got: weights.len(),
            });
        }
        if let Some(row) = weights.iter().position(|x| !(x.is_finite() && *x > 0.0)) {
            let what = "weights";
            return Err(EstimateError::NotFinite { what, row });
        }
        for values in [&mut self.w, &mut self.tau, &mut self.directions] {
            for row in values.chunks_exact_mut(self.dof.max(1)) {
                for (value, weight) in row.iter_mut().zip(weights) {
                    *value *= weight;
                }
            }
        }
        Ok(())
    }

    /// The factor of all linear columns where the joints have linear friction instead: those of
    /// [`new`](Self::new), then `Fc` and `Fv` of each joint.
    ///
    /// # Errors
    /// When an entry is not finite.
    pub fn linear_factor(&self) -> Result<Factor, EstimateError> {
        let mut plain = self.clone();
        plain.laws.fill(Law::Linear);
        plain.factor(&vec![[1.0; SHAPES]; plain.joints.len()], None)
    }

    /// The joints whose friction is not linear.
    pub fn joints(&self) -> &[FrictionJoint] {
        &self.joints
    }

    /// The number of samples.
    pub fn len(&self) -> usize {
        self.tau.len() / self.dof.max(1)
    }

    /// Whether there are no samples.
    pub fn is_empty(&self) -> bool {
        self.tau.is_empty()
    }

    /// The highest velocity of each joint in size, at least a tiny one.
    pub(super) fn fastest(&self) -> Vec<f64> {
        let joints = self.joints.len();
        let of = |k: usize| {
            let all = self.qd.iter().skip(k).step_by(joints.max(1));
            all.fold(1e-9, |m: f64, v| m.max(v.abs()))
        };
        (0..joints).map(of).collect()
    }

    /// The labels of the coefficients of friction that are linear, `symbol(joint)`.
    pub(super) fn coefficients(&self) -> Vec<String> {
        let of = |(law, joint): (&Law, &FrictionJoint)| {
            let name = joint.name.clone();
            let labels = law.linear().iter();
            labels
                .map(move |s| std::format!("{s}({name})"))
                .collect::<Vec<_>>()
        };
        self.laws.iter().zip(&self.joints).flat_map(of).collect()
    }

    /// The factor of the linear columns and friction's for a shape; with steps, also of one
    /// column more for each shape parameter: its effect, for coefficients `x`, times `reach`,
    /// whose unknown is counted from -1.
    pub(super) fn factor(
        &self,
        shapes: &[[f64; SHAPES]],
        steps: Option<(&[f64], f64)>,
    ) -> Result<Factor, EstimateError> {
        let (dof, r, joints) = (self.dof, self.labels.len(), self.joints.len());
        let mut labels = self.labels.clone();
        labels.extend(self.coefficients());
        let linear = labels.len();
        if steps.is_some() {
            for (law, joint) in self.laws.iter().zip(&self.joints) {
                let of = |s: &&str| std::format!("step {s}({})", joint.name);
                labels.extend(law.shape().iter().map(of));
            }
        }
        let columns = labels.len();
        let mut factor = Factor::new(labels);
        // whole samples in blocks that stay in a cache
        let block = 128_usize.div_ceil(dof.max(1));
        let count = self.len();
        for first in (0..count).step_by(block) {
            let samples = block.min(count - first);
            let rows = samples * dof;
            let mut w = vec![0.0; rows * columns];
            let mut tau = self.tau[first * dof..][..rows].to_vec();
            for t in 0..samples {
                let sample = first + t;
                let at = t * dof;
                for j in 0..r {
                    let from = (sample * r + j) * dof;
                    w[j * rows + at..][..dof].copy_from_slice(&self.w[from..from + dof]);
                }
                let (mut column, mut step) = (r, linear);
                for (k, law) in self.laws.iter().enumerate() {
                    let v = self.qd[sample * joints + k];
                    let sign = if v == 0.0 { 0.0 } else { v.signum() };
                    let values = law.values(v, sign, shapes[k]);
                    let direction = &self.directions[(sample * joints + k) * dof..][..dof];
                    let used = law.linear().len();
                    for (c, value) in values[..used].iter().enumerate() {
                        for (i, d) in direction.iter().enumerate() {
                            w[(column + c) * rows + at + i] = d * value;
                        }
                    }
                    if let Some((x, reach)) = steps {
                        let own = &x[column..column + used];
                        let slopes = law.slopes(v, sign, shapes[k]);
                        for slope in &slopes[..law.shape().len()] {
                            let pairs = slope.iter().zip(own);
                            let effect: f64 = pairs.map(|(s, x)| s * x).sum();
                            for (i, d) in direction.iter().enumerate() {
                                w[step * rows + at + i] = d * effect * reach;
                                tau[at + i] += d * effect * reach;
                            }
                            step += 1;
                        }
                    }
                    column += used;
                }
            }
            factor.push_block(&w, &tau)?;
        }
        Ok(factor)
    }
}
