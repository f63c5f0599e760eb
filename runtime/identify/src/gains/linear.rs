//! The equations linearised at a point, over the unknowns that are independent there.

use std::rc::Rc;

use super::GainError;
use super::payload::Load;
use super::rows::{Rows, Sample};
use super::statistics::Solved;
use super::unknowns::{GainKind, Point, Unknowns, spread};
use crate::data::DataError;
use crate::estimate::{EstimateError, FactorSet, QrFactor};
use crate::identify::{ChangedParameters, Equations, HeldEfforts};
use crate::model::Covariance;
use crate::states::{MotionSeries, Source};
use regen_runtime::BaseModel;

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

/// The equations linearised at a point, from which the entries of each row are computed.
pub(super) struct Linear<'a> {
    unknowns: &'a Unknowns,
    pub(super) point: Point,
    pub(super) columns: Vec<Column>,
    /// The derivatives of each payload's base parameters by its unknowns.
    of_loads: Vec<Vec<Vec<f64>>>,
    /// All base parameters.
    pub(super) x: Vec<f64>,
}

impl<'a> Linear<'a> {
    pub(super) fn new(unknowns: &'a Unknowns, point: &Point) -> Self {
        let robot = unknowns.robot.iter();
        let mut columns: Vec<Column> = robot.map(|k| Column::Robot(*k)).collect();
        let mut of_loads = Vec::new();
        for (k, (load, unknown)) in unknowns.loads.iter().zip(&point.loads).enumerate() {
            of_loads.push(load.columns(unknown));
            let independent = load.independent(unknown).into_iter();
            columns.extend(independent.map(|j| Column::Load(k, j)));
        }
        let gains = unknowns.gains.iter().enumerate();
        let found = gains.filter(|(_, kind)| matches!(kind, GainKind::Unknown(_)));
        columns.extend(found.map(|(effort, _)| Column::Gain(effort)));
        Self {
            unknowns,
            point: point.clone(),
            columns,
            of_loads,
            x: unknowns.base(point),
        }
    }

    /// As [`new`](Self::new), with given columns: those of another point.
    pub(super) fn with_columns(unknowns: &'a Unknowns, point: &Point, columns: &[Column]) -> Self {
        Self {
            columns: columns.to_vec(),
            ..Self::new(unknowns, point)
        }
    }

    /// 1/k of an effort.
    pub(super) fn inverse_gain(&self, effort: usize) -> f64 {
        self.unknowns.inverse_gain(effort, &self.point)
    }

    /// A payload, with the derivatives of its base parameters by an unknown.
    pub(super) fn load(&self, load: usize, unknown: usize) -> (&Load, &[f64]) {
        let column = &self.of_loads[load][unknown];
        (&self.unknowns.loads[load], column)
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
            Column::Load(load, unknown) => self.point.loads[load][unknown],
            Column::Gain(effort) => 1.0 / self.inverse_gain(effort),
        }
    }

    /// The values of the columns.
    pub(super) fn values(&self) -> Vec<f64> {
        self.columns
            .iter()
            .map(|column| self.value(*column))
            .collect()
    }

    /// The point at which the columns have these values; unknowns of payloads that are no columns
    /// keep theirs.
    pub(super) fn point_at(&self, values: &[f64]) -> Point {
        let mut out = self.point.clone();
        for (column, value) in self.columns.iter().zip(values) {
            let place = match *column {
                Column::Robot(place) => {
                    let robot = self.unknowns.robot.iter().position(|k| *k == place);
                    robot.and_then(|k| out.robot.get_mut(k))
                }
                Column::Load(load, unknown) => {
                    out.loads.get_mut(load).and_then(|own| own.get_mut(unknown))
                }
                Column::Gain(effort) => match self.unknowns.gains.get(effort) {
                    Some(GainKind::Unknown(k)) => out.inverse_gains.get_mut(*k),
                    _ => None,
                },
            };
            let inverts = column.is_gain();
            if let Some(place) = place {
                *place = if inverts { 1.0 / value } else { *value };
            }
        }
        out
    }

    /// The label of a column.
    ///
    /// - `labels`: of the base parameters; `efforts`: the coordinates.
    pub(super) fn label(&self, column: Column, labels: &[String], efforts: &[String]) -> String {
        match column {
            Column::Robot(place) => labels[place].clone(),
            Column::Load(load, unknown) => {
                let load = &self.unknowns.loads[load];
                let symbol = regen_runtime::Symbol::INERTIAL[load.unknown[unknown]];
                format!("{}({})", symbol.name(), load.known.body)
            }
            Column::Gain(effort) => Covariance::gain(&efforts[effort]),
        }
    }

    /// The same columns linearised where they have these values.
    pub(super) fn moved(&self, values: &[f64]) -> Self {
        let point = self.point_at(values);
        let loads = self.unknowns.loads.iter().zip(&point.loads);
        Self {
            unknowns: self.unknowns,
            columns: self.columns.clone(),
            of_loads: loads.map(|(load, unknown)| load.columns(unknown)).collect(),
            x: self.unknowns.base(&point),
            point,
        }
    }

    /// The labels of all columns, see [`label`](Self::label).
    pub(super) fn labels(&self, labels: &[String], efforts: &[String]) -> Vec<String> {
        let columns = self.columns.iter();
        columns
            .map(|column| self.label(*column, labels, efforts))
            .collect()
    }

    /// The QR factor of the linearised equations, whose solution is the values of the columns.
    ///
    /// - `set`, `weights`: the QR factors of the efforts' equations, and how they are weighted;
    /// - `labels`: those of the columns.
    pub(super) fn factor(
        &self,
        (set, weights): (&FactorSet, &[f64]),
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
            whole.merge(&own.scaled(weights[effort]))?;
        }
        Ok(whole)
    }

    /// Adds the equations of the efforts that change with other derivatives of the positions, in the
    /// units in which efforts were measured.
    ///
    /// - `motions`: those of the instruments, one for each run; `weights`: of the efforts.
    pub(super) fn changed<M, S>(
        &self,
        rows: &mut Rows<'_, M, S>,
        motions: Option<&[Rc<MotionSeries>]>,
        weights: &[f64],
        out: &mut ChangedParameters,
    ) -> Result<(), GainError>
    where
        M: BaseModel<f64> + ?Sized,
        S: Source + ?Sized,
        S::Error: Into<DataError>,
    {
        let (mut w, mut fitted) = (Vec::new(), Vec::new());
        rows.changed_efforts(&self.x, motions, &mut |state| {
            let sample = Sample {
                w: state.w,
                z: &[],
                measured: state.change,
                weights,
                time: 0.0,
                follows: false,
                held: &[],
            };
            self.rows(&sample, &mut w, &mut fitted);
            let change = state.change.iter().enumerate();
            let change = change.map(|(effort, x)| self.inverse_gain(effort) * x);
            let change: Vec<f64> = change.collect();
            out.push((&mut w, &change), weights, state.rows)
        })
    }

    /// Adds the equations of all runs, in the units in which efforts were measured.
    ///
    /// - `instruments`: whether the columns are those of the instruments; `weights`: of the efforts.
    pub(super) fn held<M, S>(
        &self,
        rows: &mut Rows<'_, M, S>,
        instruments: bool,
        weights: &[f64],
        out: &mut HeldEfforts,
    ) -> Result<(), GainError>
    where
        M: BaseModel<f64> + ?Sized,
        S: Source + ?Sized,
        S::Error: Into<DataError>,
    {
        let (mut w, mut fitted) = (Vec::new(), Vec::new());
        rows.visit(&mut |sample| {
            let own = if instruments { sample.z } else { sample.w };
            self.rows(&Sample { w: own, ..*sample }, &mut w, &mut fitted);
            let equations = Equations {
                time: sample.time,
                w: &w,
                tau: sample.measured,
                weights: sample.weights,
                follows: sample.follows,
                held: sample.held,
            };
            out.push(&equations, weights);
            Ok(())
        })
    }

    /// Replaces the derivatives by gains as they are with measured efforts for the predicted ones.
    pub(super) fn set_gains(&self, measured: &[f64], rows: &mut [f64]) {
        let columns = rows.chunks_exact_mut(measured.len().max(1));
        for (entries, column) in columns.zip(&self.columns) {
            let Column::Gain(effort) = *column else {
                continue;
            };
            if let (Some(entry), Some(i)) = (entries.get_mut(effort), measured.get(effort)) {
                *entry = -self.inverse_gain(effort) * i;
            }
        }
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
        Linear::new(self.problem.unknowns, self.point)
    }
}
