//! The identified model: base parameters, gains and payloads with their intervals.

use super::linear::{Column, Linear};
use super::payload::PhysicalValue;
use super::statistics::Solved;
use super::unknowns::GainKind;
use crate::estimate::{Deviations, Estimate, quantile};
use crate::model::{
    Covariance, Gain, IdentifiedModel, IdentifiedPayload, Interval, Intervals, PayloadValue,
};

impl Solved<'_> {
    /// The identified model.
    pub(super) fn model(
        &self,
        linear: &Linear<'_>,
        uncertainty: &Uncertainty<'_>,
        efforts: &[String],
        method: String,
    ) -> IdentifiedModel {
        let columns = &linear.columns;
        let n = self.base;
        // the gradient of each base parameter by the columns; nothing, or 0, where it is known
        let mut gradients: Vec<Vec<f64>> = vec![Vec::new(); n];
        for (k, column) in columns.iter().enumerate() {
            let mut add = |place: usize, by: f64| {
                let own = &mut gradients[place];
                own.resize(columns.len(), 0.0);
                own[k] = by;
            };
            match *column {
                Column::Robot(place) => add(place, 1.0),
                Column::Load(load, unknown) => {
                    let (load, slopes) = linear.load(load, unknown);
                    for (place, slope) in load.base.iter().zip(slopes) {
                        add(*place, *slope);
                    }
                }
                Column::Gain(_) => {}
            }
        }
        let labels = self.problem.set.labels().get(..n).unwrap_or_default();
        let base = gradients.iter().enumerate().map(|(k, gradient)| {
            let value = linear.x[k];
            if gradient.iter().any(|g| *g != 0.0) {
                return uncertainty.interval(value, gradient);
            }
            self.of_robot
                .contains(&k)
                .then(|| self.known_interval(&labels[k], value))
                .flatten()
        });
        let base: Vec<Option<Interval>> = base.collect();
        let mut gains = Vec::new();
        for (effort, kind) in self.problem.unknowns.gains.iter().enumerate() {
            let value = 1.0 / linear.inverse_gain(effort);
            let place = columns.iter().position(|c| *c == Column::Gain(effort));
            let interval = match place {
                None => self.known_interval(&Covariance::gain(&efforts[effort]), value),
                Some(place) => {
                    let mut gradient = vec![0.0; columns.len()];
                    gradient[place] = 1.0;
                    uncertainty.interval(value, &gradient)
                }
            };
            if *kind != GainKind::Known {
                gains.push(Gain {
                    effort: efforts[effort].clone(),
                    value,
                    interval,
                });
            }
        }
        let payloads = self
            .problem
            .unknowns
            .loads
            .iter()
            .zip(&self.point.loads)
            .enumerate();
        let payloads = payloads.map(|(load, (own, unknown))| {
            let values = own.physical_values(unknown);
            let values = values.into_iter().map(|found: PhysicalValue| {
                let gradient = columns.iter().map(|column| match *column {
                    Column::Load(of, k) if of == load => found.slope[k],
                    _ => 0.0,
                });
                let gradient: Vec<f64> = gradient.collect();
                let interval = uncertainty.interval(found.value, &gradient);
                PayloadValue {
                    name: found.name.to_owned(),
                    unit: found.unit.to_owned(),
                    value: found.value,
                    is_known: found.known,
                    interval: interval.filter(|_| !found.known),
                }
            });
            IdentifiedPayload {
                body: own.known.body.clone(),
                values: values.collect(),
            }
        });
        let covariance = self.plan.robot.is_none().then(|| {
            let mut of = gradients.clone();
            let mut names = labels.to_vec();
            for (k, column) in columns.iter().enumerate() {
                if let Column::Gain(effort) = *column {
                    let mut gradient = vec![0.0; columns.len()];
                    gradient[k] = 1.0;
                    of.push(gradient);
                    names.push(Covariance::gain(&efforts[effort]));
                }
            }
            uncertainty.covariance(names, &of)
        });
        IdentifiedModel {
            name: format!("{} with gains and payloads", self.name),
            beta: linear.x.iter().take(n).copied().collect(),
            feasibility: "not judged".to_owned(),
            intervals: Intervals {
                base,
                method,
                ..Intervals::default()
            },
            gains,
            payloads: payloads.collect(),
            covariance,
            ..IdentifiedModel::default()
        }
    }

    /// The interval of a value of the known robot.
    fn known_interval(&self, label: &str, value: f64) -> Option<Interval> {
        let covariance = self.plan.robot.as_ref()?.covariance.as_ref()?;
        let place = covariance.place(label)?;
        let sigma = covariance.entry(place, place).sqrt();
        let half = quantile(f64::INFINITY, self.options.confidence) * sigma;
        Some(Interval {
            sigma,
            sigma_white: f64::NAN,
            low: value - half,
            high: value + half,
        })
    }
}

/// The covariance of the unknowns.
pub(super) struct Uncertainty<'a> {
    pub(super) estimate: &'a Estimate,
    pub(super) deviations: &'a Deviations,
    pub(super) confidence: f64,
}

impl Uncertainty<'_> {
    /// The interval of a value with this gradient by the unknowns; `None` where it is not finite.
    fn interval(&self, value: f64, gradient: &[f64]) -> Option<Interval> {
        let sigma = form(&self.deviations.covariance, gradient, gradient).sqrt();
        let freedom = self.deviations.degrees_of_freedom.iter().zip(gradient);
        let freedom = freedom.filter(|(_, g)| **g != 0.0).map(|(f, _)| *f);
        let half = quantile(freedom.fold(f64::INFINITY, f64::min), self.confidence) * sigma;
        (sigma.is_finite() && half.is_finite()).then(|| Interval {
            sigma,
            sigma_white: form(&self.estimate.covariance, gradient, gradient).sqrt(),
            low: value - half,
            high: value + half,
        })
    }

    /// The covariance of values with these gradients; 0 where a gradient is empty.
    fn covariance(&self, labels: Vec<String>, gradients: &[Vec<f64>]) -> Covariance {
        let mut values = Vec::with_capacity(gradients.len() * gradients.len());
        for a in gradients {
            values.extend(
                gradients
                    .iter()
                    .map(|b| form(&self.deviations.covariance, a, b)),
            );
        }
        Covariance { labels, values }
    }
}

/// a^T C b.
fn form(covariance: &[f64], a: &[f64], b: &[f64]) -> f64 {
    let n = a.len().max(b.len()).max(1);
    let rows = covariance.chunks_exact(n).zip(a);
    rows.filter(|(_, x)| **x != 0.0)
        .map(|(row, x)| x * row.iter().zip(b).map(|(c, y)| c * y).sum::<f64>())
        .sum()
}
