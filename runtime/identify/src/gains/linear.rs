//! The equations linearised at the solution, over the unknowns that are independent there.

use super::payload::Load;
use super::problem::{GainKind, spread};
use super::rows::Sample;
use super::statistics::Solved;
use crate::estimate::{EstimateError, FactorSet, QrFactor};
use crate::model::Covariance;

/// An unknown of the linearised equations.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Column {
    /// A base parameter of the robot, by its place.
    Robot(usize),
    /// An unknown of a payload: the payload, and its unknown.
    Load(usize, usize),
    /// The gain k of an effort.
    Gain(usize),
}

impl Column {
    pub(super) fn is_gain(self) -> bool {
        matches!(self, Self::Gain(_))
    }
}

/// The linearised equations, from which the entries of each row are computed.
pub(super) struct Linear<'a> {
    solved: &'a Solved<'a>,
    pub(super) columns: Vec<Column>,
    /// The derivatives of each payload's base parameters by its unknowns.
    of_loads: Vec<Vec<Vec<f64>>>,
    /// All base parameters.
    pub(super) x: Vec<f64>,
}

impl Linear<'_> {
    /// 1/k of an effort.
    pub(super) fn inverse_gain(&self, effort: usize) -> f64 {
        self.solved.problem.inverse_gain(effort, self.solved.point)
    }

    /// A payload, with the derivatives of its base parameters by an unknown.
    pub(super) fn load(&self, load: usize, unknown: usize) -> (&Load, &[f64]) {
        let column = &self.of_loads[load][unknown];
        (&self.solved.problem.loads[load], column)
    }

    /// The derivative of an effort's prediction by the unknown of a column, as a factor for the
    /// regressor's entry of each base parameter.
    fn combination(&self, column: Column, effort: usize) -> Vec<f64> {
        let n = self.x.len();
        let g = self.inverse_gain(effort);
        match column {
            Column::Robot(place) => spread(n, &[place], &[g]),
            Column::Load(load, unknown) => {
                let (load, column) = self.load(load, unknown);
                let scaled: Vec<f64> = column.iter().map(|a| g * a).collect();
                spread(n, &load.base, &scaled)
            }
            Column::Gain(of) if of == effort => self.x.iter().map(|x| -g * g * x).collect(),
            Column::Gain(_) => vec![0.0; n],
        }
    }

    fn value(&self, column: Column) -> f64 {
        match column {
            Column::Robot(place) => self.x[place],
            Column::Load(load, unknown) => self.solved.point.loads[load][unknown],
            Column::Gain(effort) => 1.0 / self.inverse_gain(effort),
        }
    }

    /// The label of a column.
    ///
    /// - `labels`: of the base parameters; `efforts`: the coordinates.
    pub(super) fn label(&self, column: Column, labels: &[String], efforts: &[String]) -> String {
        match column {
            Column::Robot(place) => labels[place].clone(),
            Column::Load(load, unknown) => {
                let load = &self.solved.problem.loads[load];
                let symbol = regen_runtime::Symbol::INERTIAL[load.unknown[unknown]];
                format!("{}({})", symbol.name(), load.known.body)
            }
            Column::Gain(effort) => Covariance::gain(&efforts[effort]),
        }
    }

    /// The weighted QR factor of the linearised equations, whose solution is the values of the
    /// columns.
    pub(super) fn factor(
        &self,
        columns: &[Column],
        labels: &[String],
    ) -> Result<QrFactor, EstimateError> {
        self.factor_of(self.solved.problem.set, columns, labels)
    }

    /// As [`factor`](Self::factor), with other QR factors of the efforts, such as those without
    /// Huber's weights.
    pub(super) fn factor_of(
        &self,
        set: &FactorSet,
        columns: &[Column],
        labels: &[String],
    ) -> Result<QrFactor, EstimateError> {
        let mut whole = QrFactor::new(labels.to_vec());
        for (effort, factor) in set.factors().iter().enumerate() {
            let g = self.inverse_gain(effort);
            // z - g R x + J values
            let mut target: Vec<f64> = self.x.iter().map(|x| -g * x).collect();
            let mut all = Vec::with_capacity(columns.len() * self.x.len());
            for column in columns {
                let own = self.combination(*column, effort);
                let value = self.value(*column);
                for (sum, t) in target.iter_mut().zip(&own) {
                    *sum += t * value;
                }
                all.extend(own);
            }
            let moved = factor.times_r(&target);
            let side = factor.z().iter().zip(&moved).map(|(z, m)| z + m).collect();
            let moved = QrFactor::from_parts(
                factor.labels().to_vec(),
                factor.r().to_vec(),
                side,
                factor.rss(),
                factor.rows(),
            )?;
            let own = moved.transformed(labels.to_vec(), &all)?;
            whole.merge(&own.scaled(self.solved.weights[effort]))?;
        }
        Ok(whole)
    }

    /// The entries of a sample's rows in these columns, efforts x columns, column-major; and the
    /// predicted efforts in the units in which they were measured.
    pub(super) fn rows(&self, sample: &Sample<'_>, out: &mut Vec<f64>, fitted: &mut Vec<f64>) {
        let efforts = sample.measured.len();
        let entry = |place: usize, effort: usize| sample.w[place * efforts + effort];
        out.clear();
        fitted.clear();
        fitted.extend((0..efforts).map(|effort| {
            let terms = self.x.iter().enumerate();
            self.inverse_gain(effort) * terms.map(|(k, x)| entry(k, effort) * x).sum::<f64>()
        }));
        for column in &self.columns {
            for (effort, predicted) in fitted.iter().enumerate() {
                let g = self.inverse_gain(effort);
                out.push(match *column {
                    Column::Robot(place) => g * entry(place, effort),
                    Column::Load(load, unknown) => {
                        let (load, column) = self.load(load, unknown);
                        let terms = load.base.iter().zip(column);
                        g * terms.map(|(k, a)| entry(*k, effort) * a).sum::<f64>()
                    }
                    Column::Gain(of) if of == effort => -g * predicted,
                    Column::Gain(_) => 0.0,
                });
            }
        }
    }
}

impl Solved<'_> {
    /// The equations linearised at the solution.
    pub(super) fn linear(&self) -> Linear<'_> {
        let (problem, point) = (self.problem, self.point);
        let mut columns: Vec<Column> = problem.robot.iter().map(|k| Column::Robot(*k)).collect();
        let mut of_loads = Vec::new();
        for (k, (load, unknown)) in problem.loads.iter().zip(&point.loads).enumerate() {
            of_loads.push(load.columns(unknown));
            let independent = load.independent(unknown).into_iter();
            columns.extend(independent.map(|j| Column::Load(k, j)));
        }
        let gains = problem.gains.iter().enumerate();
        let unknown = gains.filter(|(_, kind)| matches!(kind, GainKind::Unknown(_)));
        columns.extend(unknown.map(|(effort, _)| Column::Gain(effort)));
        Linear {
            solved: self,
            columns,
            of_loads,
            x: problem.base(point),
        }
    }
}
