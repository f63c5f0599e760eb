//! The equations and joint velocities of a log, in memory, for the fit of nonlinear friction.

use std::sync::{Arc, OnceLock};

use super::columns::FrictionColumns;
use super::reduced::{Linearised, Reduced};
use crate::estimate::{EstimateError, FilteredNoise, QrFactor};
use crate::feasibility::FeasibilityError;
use crate::identify::normalise;
use crate::signals::SignalError;
use crate::states::{Filtering, FrictionJoint};
use regen_runtime::Friction;
use regen_runtime::friction::SHAPES;

/// One of so many moving samples is slow.
const SLOW_PART: usize = 100;

/// The filtered equations in the linear parameters, with the unfiltered motion of the joints whose
/// friction is nonlinear. All of it stays in memory, because the columns of friction change with
/// its shape and must then be filtered again like the equations.
#[derive(Clone, Debug)]
pub struct FrictionData {
    pub(super) labels: Vec<String>,
    pub(super) joints: Vec<FrictionJoint>,
    pub(super) laws: Vec<Friction>,
    pub(super) dof: usize,
    pub(super) filtering: Filtering,
    /// The weighted regressor, equation by equation: dof x columns, column by column.
    pub(super) w: Vec<f64>,
    /// The weighted efforts, dof for each equation.
    pub(super) tau: Vec<f64>,
    /// The weighted residuals of efforts that the controller holds between rows, see
    /// [`Equations::held`](crate::identify::Equations::held); empty where they are not known.
    pub(super) held: Vec<f64>,
    pub(super) weights: Vec<f64>,
    pub(super) runs: Vec<Run>,
    /// Whether the friction of a joint acts on a row at any sample: dof x joints, joint by joint.
    pub(super) acts: Vec<bool>,
    /// See [`with_changes`](Self::with_changes); each counts as a standard deviation.
    pub(super) changes: Vec<Vec<f64>>,
    /// The linear columns after their reduction, from the first factor on.
    pub(super) reduced: OnceLock<Arc<Reduced>>,
}

/// Consecutive samples of the motion, unfiltered.
#[derive(Clone, Debug, Default)]
pub(super) struct Run {
    pub(super) times: Vec<f64>,
    pub(super) qd: Vec<f64>,
    /// See [`directions`], sample by sample: dof x joints, joint by joint.
    pub(super) directions: Vec<f64>,
    /// For each equation of each sample 1, or 0 if the sample is interpolated across a gap or an effort has no value.
    pub(super) known: Vec<f64>,
    /// The number of samples whose equations are averaged; 0 stands for 1 as long as there is one sample.
    pub(super) averaged: usize,
    /// The indices of the averages that have equations.
    pub(super) equations: Vec<usize>,
}

impl Run {
    /// The times of the averages of samples, s; samples that are too few for a last one have none.
    fn averages(&self) -> Vec<f64> {
        let averaged = self.averaged.max(1);
        let groups = self.times.chunks_exact(averaged);
        groups.map(mean).collect()
    }

    /// Averages and filters series as the equations are.
    ///
    /// - `values`: an entry of each row in `rows` for each sample; then as many for each average.
    pub(super) fn filter(
        &self,
        filtering: &Filtering,
        values: &mut Vec<f64>,
        rows: &[usize],
    ) -> Result<(), SignalError> {
        let (width, times) = (rows.len(), self.averages());
        let dof = self.known.len() / self.times.len().max(1);
        let is_whole = !self.known.contains(&0.0);
        if !is_whole {
            let samples = values.chunks_exact_mut(width.max(1));
            for (own, known) in samples.zip(self.known.chunks_exact(dof.max(1))) {
                for (value, row) in own.iter_mut().zip(rows) {
                    *value *= known.get(*row).unwrap_or(&1.0);
                }
            }
        }
        self.average(values, width);
        filtering.smoothing.apply(&times, values, width)?;
        if !is_whole {
            let mut known = self.known.clone();
            self.average(&mut known, dof);
            filtering.smoothing.apply(&times, &mut known, dof)?;
            let samples = values.chunks_exact_mut(width.max(1));
            for (own, known) in samples.zip(known.chunks_exact(dof.max(1))) {
                normalise(own, known, rows.iter().copied());
            }
        }
        Ok(())
    }

    /// Averages series of `width` entries for each sample.
    fn average(&self, values: &mut Vec<f64>, width: usize) {
        let averaged = self.averaged.max(1);
        let groups = self.times.len() / averaged;
        if averaged > 1 {
            for group in 0..groups {
                for k in 0..width {
                    let own =
                        (group * averaged..(group + 1) * averaged).map(|i| values[i * width + k]);
                    values[group * width + k] = own.sum::<f64>() / averaged as f64;
                }
            }
            values.truncate(groups * width);
        }
    }
}

/// The mean of some values; a single one is its own mean, to the last digit.
fn mean(values: &[f64]) -> f64 {
    match values {
        [one] => *one,
        _ => values.iter().sum::<f64>() / values.len() as f64,
    }
}

/// The equations of one sample, for given shapes of friction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rows<'a> {
    /// The weighted regressor, dof x columns, column by column.
    pub(super) w: &'a [f64],
    /// The weighted efforts, dof entries.
    pub(super) tau: &'a [f64],
    /// The weight of each row, dof entries; 0 for a row that is left out.
    pub(super) weights: &'a [f64],
    /// Whether the sample follows the previous one in time.
    pub(super) follows: bool,
}

impl FrictionData {
    /// Starts without samples.
    ///
    /// - `labels`: the labels of the r columns of the linear equations (base parameters);
    /// - `dof`: the number of rows of each sample.
    ///
    /// # Errors
    /// When a joint's law is linear: its coefficients are among the linear parameters.
    pub fn new(
        labels: &[String],
        joints: &[FrictionJoint],
        dof: usize,
    ) -> Result<Self, FeasibilityError> {
        let law = |joint: &FrictionJoint| {
            let law = Some(joint.friction).filter(|law| !law.is_linear());
            law.ok_or_else(|| FeasibilityError::Unknown {
                what: "nonlinear friction law at joint",
                label: joint.name.clone(),
            })
        };
        Ok(Self {
            labels: labels.to_vec(),
            laws: joints.iter().map(law).collect::<Result<_, _>>()?,
            joints: joints.to_vec(),
            dof,
            filtering: Filtering::default(),
            w: Vec::new(),
            tau: Vec::new(),
            held: Vec::new(),
            weights: Vec::new(),
            runs: Vec::new(),
            acts: vec![false; dof * joints.len()],
            changes: Vec::new(),
            reduced: OnceLock::new(),
        })
    }

    /// Sets the filter that the added equations have already passed; the columns of friction are
    /// averaged and filtered as they were.
    pub(super) fn filtered(mut self, filtering: Filtering) -> Self {
        self.filtering = filtering;
        self
    }

    /// Adds an unfiltered sample with its equations. Samples are added in order of time.
    ///
    /// - `w`: dof x r, column by column; `tau`: dof efforts, N or N m; `qd`: the joints'
    ///   velocities, rad/s or m/s;
    /// - `directions`: dof x joints, column by column, see [`directions`](crate::states::directions);
    /// - `weights`: the factor of each row, dof entries: 1/sigma.
    ///
    /// # Errors
    /// When lengths do not fit or a value is not finite; nothing is added then.
    pub fn push(
        &mut self,
        w: &[f64],
        tau: &[f64],
        qd: &[f64],
        directions: &[f64],
        weights: &[f64],
    ) -> Result<(), EstimateError> {
        self.check_sample(qd, directions)?;
        self.check_equations(w, tau, weights)?;
        let time = self.runs.last().map_or(0, |run| run.times.len());
        let known = core::iter::repeat_n(true, self.dof);
        self.push_sample(time as f64, qd, directions, known)?;
        self.push_equations(time as f64, w, tau, weights)
    }

    /// Starts a new run: the next sample does not follow the last one in time.
    pub fn interrupt(&mut self) {
        self.runs.push(Run::default());
    }

    fn check_sample(&self, qd: &[f64], directions: &[f64]) -> Result<(), EstimateError> {
        let (dof, joints) = (self.dof, self.joints.len());
        check("qd", joints, qd)?;
        check("directions", dof * joints, directions)
    }

    fn check_equations(
        &self,
        w: &[f64],
        tau: &[f64],
        weights: &[f64],
    ) -> Result<(), EstimateError> {
        check("w", self.dof * self.labels.len(), w)?;
        check("tau", self.dof, tau)?;
        check("weights", self.dof, weights)
    }

    /// Adds a sample's motion, which is not filtered.
    ///
    /// - `known`: whether each of its equations is known.
    pub(super) fn push_sample(
        &mut self,
        time: f64,
        qd: &[f64],
        directions: &[f64],
        known: impl Iterator<Item = bool>,
    ) -> Result<(), EstimateError> {
        self.check_sample(qd, directions)?;
        for (acts, d) in self.acts.iter_mut().zip(directions) {
            *acts |= *d != 0.0;
        }
        self.reduced.take();
        if self.runs.is_empty() {
            self.interrupt();
        }
        if let Some(run) = self.runs.last_mut() {
            run.times.push(time);
            run.known.extend(known.map(f64::from));
            if let [first, second] = run.times[..] {
                run.averaged = self.filtering.averaged(second - first);
            }
            run.qd.extend(qd);
            run.directions.extend(directions);
        }
        Ok(())
    }

    /// Adds the filtered equations of one sample of the current run, in order of time.
    pub(super) fn push_equations(
        &mut self,
        time: f64,
        w: &[f64],
        tau: &[f64],
        weights: &[f64],
    ) -> Result<(), EstimateError> {
        self.check_equations(w, tau, weights)?;
        let Some(run) = self.runs.last_mut() else {
            return Ok(());
        };
        let after = run.equations.last().map_or(0, |last| last + 1);
        let averaged = run.averaged.max(1);
        let remaining = run.times.get(after * averaged..).unwrap_or_default();
        let mut groups = remaining.chunks_exact(averaged);
        let Some(place) = groups.position(|group| mean(group).total_cmp(&time).is_eq()) else {
            return Err(EstimateError::Size {
                what: "samples of friction",
                expected: run.times.len() + 1,
                got: run.times.len(),
            });
        };
        run.equations.push(after + place);
        self.reduced.take();
        let weighted = |values: &[f64], into: &mut Vec<f64>| {
            let rows = values.chunks_exact(weights.len().max(1));
            into.extend(rows.flat_map(|c| c.iter().zip(weights).map(|(x, s)| x * s)));
        };
        weighted(w, &mut self.w);
        weighted(tau, &mut self.tau);
        self.weights.extend(weights);
        Ok(())
    }

    /// Sets what sampling, noise of the motion and delays leave unknown.
    ///
    /// - `changes`: of the base parameters and of `Fc` and `Fv` of each joint, SI.
    pub(crate) fn with_changes(mut self, changes: &[Vec<f64>]) -> Self {
        self.changes = changes.to_vec();
        self
    }

    /// The same changes, of the base parameters and of the coefficients of these laws.
    pub(super) fn changes_with(&self, laws: &[Friction]) -> Vec<Vec<f64>> {
        let of_laws = |change: &Vec<f64>| {
            let (base, linear) = change.split_at(change.len().min(self.labels.len()));
            let mut out = base.to_vec();
            for (law, own) in laws.iter().zip(linear.as_chunks::<2>().0) {
                let (coefficients, _) = law.of_linear(*own, [1.0; SHAPES]);
                out.extend(coefficients.iter().take(law.coefficients().len()));
            }
            out
        };
        self.changes.iter().map(of_laws).collect()
    }

    /// Adds the residuals of held efforts of the last equations, dof entries; none if they are not known.
    pub(super) fn push_held(&mut self, held: &[f64]) {
        let own = held.iter().copied().chain(core::iter::repeat(0.0));
        let last = self.weights.len().saturating_sub(self.dof);
        let weights = self.weights.get(last..).unwrap_or_default();
        self.held.resize(last, 0.0);
        self.held
            .extend(weights.iter().zip(own).map(|(s, x)| s * x));
    }

    /// The weighted residuals of held efforts, dof for each equation.
    pub(super) fn held(&self) -> &[f64] {
        &self.held
    }

    /// Multiplies the rows of each effort by a weight, 1/sigma; `weights` has dof entries.
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
        self.reduced.take();
        for values in [
            &mut self.w,
            &mut self.tau,
            &mut self.held,
            &mut self.weights,
        ] {
            for row in values.chunks_exact_mut(self.dof.max(1)) {
                for (value, weight) in row.iter_mut().zip(weights) {
                    *value *= weight;
                }
            }
        }
        Ok(())
    }

    /// The factor with linear friction at all joints: the columns of [`new`](Self::new), then `Fc`
    /// and `Fv` of each joint.
    ///
    /// # Errors
    /// When an entry is not finite.
    pub fn linear_factor(&self) -> Result<QrFactor, EstimateError> {
        self.linearised(&self.linear_laws(), &[])?.factor()
    }

    /// The linear friction law for every joint.
    pub(super) fn linear_laws(&self) -> Vec<Friction> {
        vec![Friction::Linear; self.laws.len()]
    }

    /// The joints with nonlinear friction.
    pub fn joints(&self) -> &[FrictionJoint] {
        &self.joints
    }

    /// What the filter makes of white noise of the efforts.
    pub(super) fn filtered_noise(&self) -> FilteredNoise {
        let spacing = self.runs.iter().find_map(|run| {
            let times = run.averages();
            let first = times.get(*run.equations.first()?)?;
            let last = times.get(*run.equations.last()?)?;
            let count = run.equations.len() - 1;
            (count > 0).then(|| (last - first) / count as f64)
        });
        spacing.map_or_else(FilteredNoise::unfiltered, |own| self.filtering.noise(own))
    }

    /// The number of samples that have equations.
    pub fn len(&self) -> usize {
        self.tau.len() / self.dof.max(1)
    }

    /// Whether there are no equations.
    pub fn is_empty(&self) -> bool {
        self.tau.is_empty()
    }

    pub(super) fn dof(&self) -> usize {
        self.dof
    }

    /// The highest absolute velocity of each joint, rad/s or m/s, at least 1e-9.
    pub(super) fn fastest(&self) -> Vec<f64> {
        let joints = self.joints.len();
        let of = |k: usize| {
            let runs = self.runs.iter();
            let all = runs.flat_map(|run| run.qd.iter().skip(k).step_by(joints.max(1)));
            all.fold(1e-9, |m: f64, v| m.max(v.abs()))
        };
        (0..joints).map(of).collect()
    }

    /// The absolute velocity of each joint below which it is in one of a hundred of the samples in which it moves,
    /// rad/s or m/s; at most [`fastest`](Self::fastest).
    pub(super) fn slowest(&self) -> Vec<f64> {
        let joints = self.joints.len();
        let of = |(k, fastest): (usize, f64)| {
            let runs = self.runs.iter();
            let all = runs.flat_map(|run| run.qd.iter().skip(k).step_by(joints.max(1)));
            let mut moving: Vec<f64> = all.map(|v| v.abs()).filter(|v| *v > 0.0).collect();
            moving.sort_by(f64::total_cmp);
            let one = moving.len() / SLOW_PART;
            moving.get(one).copied().unwrap_or(fastest)
        };
        self.fastest().into_iter().enumerate().map(of).collect()
    }

    /// The factor of the linear columns and of the coefficients of friction for these shapes.
    pub(super) fn factor(
        &self,
        laws: &[Friction],
        shapes: &[[f64; SHAPES]],
    ) -> Result<QrFactor, EstimateError> {
        let columns = FrictionColumns {
            laws,
            shapes,
            has_slopes: false,
        };
        self.reduced()?.factor(self, &columns)
    }

    /// The labels of the linear coefficients of friction, `symbol(joint)`.
    pub(super) fn coefficients(&self, laws: &[Friction]) -> Vec<String> {
        let of = |(law, joint): (&Friction, &FrictionJoint)| {
            let name = joint.name.clone();
            let labels = law.coefficients().iter();
            labels
                .map(move |s| format!("{s}({name})"))
                .collect::<Vec<_>>()
        };
        laws.iter().zip(&self.joints).flat_map(of).collect()
    }

    /// The labels of the steps of the shape parameters, `step symbol(joint)`.
    pub(super) fn steps(&self, laws: &[Friction]) -> Vec<String> {
        let of = |(law, joint): (&Friction, &FrictionJoint)| {
            let name = joint.name.clone();
            let labels = law.shape_symbols().iter();
            labels
                .map(move |s| format!("step {s}({name})"))
                .collect::<Vec<_>>()
        };
        laws.iter().zip(&self.joints).flat_map(of).collect()
    }

    /// The equations with the columns of friction for given shapes, see
    /// [`Linearised`](super::reduced::Linearised).
    pub(super) fn linearised(
        &self,
        laws: &[Friction],
        shapes: &[[f64; SHAPES]],
    ) -> Result<Linearised, EstimateError> {
        self.reduced()?.linearised(self, laws, shapes)
    }

    /// The reduced linear columns.
    fn reduced(&self) -> Result<&Reduced, EstimateError> {
        Ok(if let Some(reduced) = self.reduced.get() {
            reduced
        } else {
            let reduced = Arc::new(Reduced::of(self)?);
            self.reduced.get_or_init(|| reduced)
        })
    }

    /// The same equations for a fit, with other velocities of the joints.
    ///
    /// - `change`: gets the times of the samples of a run, s, and the velocities, joint by joint for each.
    pub(super) fn with_velocities(
        &self,
        change: impl Fn(&[f64], &mut [f64]),
    ) -> Result<Self, EstimateError> {
        self.reduced()?;
        let mut runs = self.runs.clone();
        for run in &mut runs {
            change(&run.times, &mut run.qd);
        }
        // a fit needs of the linear columns and the efforts only what their reduction left
        Ok(Self {
            labels: self.labels.clone(),
            joints: self.joints.clone(),
            laws: self.laws.clone(),
            w: Vec::new(),
            tau: Vec::new(),
            held: Vec::new(),
            weights: self.weights.clone(),
            runs,
            acts: self.acts.clone(),
            changes: Vec::new(),
            reduced: self.reduced.clone(),
            ..*self
        })
    }

    /// Calls `each` with the unfiltered motion of each run that has equations, and the number of
    /// its first equation.
    pub(super) fn visit_runs(
        &self,
        each: &mut dyn FnMut(&Run, usize) -> Result<(), EstimateError>,
    ) -> Result<(), EstimateError> {
        let mut equation = 0;
        for run in &self.runs {
            if !run.equations.is_empty() {
                each(run, equation)?;
                equation += run.equations.len();
            }
        }
        Ok(())
    }

    /// Calls `each` with the equations of each sample in order of time: the linear columns, and
    /// those of friction.
    pub(super) fn visit(
        &self,
        columns: &FrictionColumns<'_>,
        each: &mut dyn FnMut(Rows<'_>) -> Result<(), EstimateError>,
    ) -> Result<(), EstimateError> {
        let (dof, r) = (self.dof, self.labels.len());
        let places = columns.places(self);
        let mut w = vec![0.0; dof * (r + columns.count())];
        let mut tau = vec![0.0; dof];
        let mut channels = Vec::new();
        self.visit_runs(&mut |run, first| {
            columns.entries(self, run, &mut channels)?;
            let mut follows = false;
            for (equation, &sample) in (first..).zip(&run.equations) {
                w[..dof * r].copy_from_slice(&self.w[equation * dof * r..][..dof * r]);
                w[dof * r..].fill(0.0);
                tau.copy_from_slice(&self.tau[equation * dof..][..dof]);
                let weights = &self.weights[equation * dof..][..dof];
                let own = &channels[sample * places.len()..][..places.len()];
                for ((column, row), value) in places.iter().zip(own) {
                    w[(r + column) * dof + row] = value * weights[*row];
                }
                each(Rows {
                    w: &w,
                    tau: &tau,
                    weights,
                    follows,
                })?;
                follows = true;
            }
            Ok(())
        })
    }
}

/// Checks that there are `expected` values, all finite.
fn check(what: &'static str, expected: usize, values: &[f64]) -> Result<(), EstimateError> {
    let got = values.len();
    if got != expected {
        return Err(EstimateError::Size {
            what,
            expected,
            got,
        });
    }
    match values.iter().position(|x| !x.is_finite()) {
        Some(row) => Err(EstimateError::NotFinite { what, row }),
        None => Ok(()),
    }
}
