//! The identified model of a fit under physical constraints, with intervals from draws.

use super::feasible::{Constrained, Physical, State};
use super::linear::Column;
use super::payload::{InertialParameters, physical_value};
use super::{GainError, GainFit};
use crate::feasibility::PhysicalFit;
use crate::feasibility::{describe_draws, describe_fit, unbounded};
use crate::intervals::{Draws, LeastSquares, ProjectedDraws, Spread, determined, replicate};
use crate::model::{
    Covariance, Gain, IdentifiedModel, IdentifiedPayload, Interval, Intervals, PayloadValue,
};

impl Constrained<'_> {
    /// The identified model.
    ///
    /// - `found`: the fit without constraints; `fit`: the last fit of the search, which ended at
    ///   `state`.
    pub(super) fn model(
        &self,
        found: &GainFit,
        state: &State,
        fit: &PhysicalFit,
        physical: &Physical<'_>,
    ) -> Result<IdentifiedModel, GainError> {
        let (solved, confidence) = (self.solved, self.solved.options.confidence);
        let drawn = match physical.draws {
            0 => None,
            draws => Some(self.drawn(found, state, draws, physical.progress)?),
        };
        let interval_of = |spread: &dyn Fn(&ProjectedDraws) -> Spread| {
            Interval::drawn(&spread(drawn.as_ref()?), confidence)
        };
        // an interval of a value, from the value in each draw
        let interval = |value: f64, of: &dyn Fn(&ProjectedDraws) -> Vec<f64>| {
            interval_of(&|drawn| drawn.spread(value, of(drawn)))
        };
        let base = state.x.iter().enumerate().map(|(place, value)| {
            let own = self.places.iter().position(|k| *k == place);
            match own {
                Some(k) => interval_of(&|drawn| drawn.base_spread(k, *value)),
                // what is known is not changed
                None => found.model.intervals.base.get(place).copied().flatten(),
            }
        });
        let all = physical.layout.len();
        let is_known = determined(self.combinations(), &self.layout, &self.options)?;
        // payloads that no run carried keep their values
        let reference = physical.options.reference.iter();
        let reference = reference.map(|value| value.unwrap_or(0.0));
        let mut phi: Vec<f64> = reference.chain(core::iter::repeat(0.0)).take(all).collect();
        for load in solved
            .problem
            .unknowns
            .loads
            .iter()
            .filter(|l| l.unknown.is_empty())
        {
            let body = physical.layout.body(&load.known.body)?;
            for (place, value) in body.columns.iter().zip(load.inertial_parameters(&[])) {
                phi[*place] = value;
            }
        }
        let mut of_all = vec![None; all];
        for (k, place) in self.columns.iter().enumerate() {
            phi[*place] = state.phi[k];
            if is_known[k] {
                of_all[*place] = interval_of(&|drawn| drawn.physical_spread(k, state.phi[k]));
            }
        }
        let gains = found.model.gains.iter().map(|gain| {
            let label = Covariance::gain(&gain.effort);
            let Some(k) = self.labels().iter().position(|own| *own == label) else {
                return gain.clone();
            };
            let value = 1.0 / state.inverse_gains[self.gains[k]];
            let column = self.layout.len() + k;
            let of = |drawn: &ProjectedDraws| {
                let parts = drawn.of_all(column);
                parts.iter().map(|part| value / part).collect()
            };
            Gain {
                effort: gain.effort.clone(),
                value,
                interval: interval(value, &of),
            }
        });
        let gains = gains.collect();
        let payloads = found.model.payloads.iter().map(|payload| {
            let Ok(body) = self.layout.body(&payload.body) else {
                return payload.clone();
            };
            let ten = |phi: &[f64]| -> InertialParameters { body.columns.map(|c| phi[c]) };
            let values = payload.values.iter().map(|own| {
                if own.is_known {
                    return own.clone();
                }
                let value = physical_value(&own.name, &ten(&state.phi));
                let of = |drawn: &ProjectedDraws| {
                    let all = drawn.phi.iter();
                    all.map(|phi| physical_value(&own.name, &ten(phi)))
                        .collect()
                };
                PayloadValue {
                    value,
                    interval: interval(value, &of),
                    ..own.clone()
                }
            });
            IdentifiedPayload {
                body: payload.body.clone(),
                values: values.collect(),
            }
        });
        let payloads = payloads.collect();
        let without = solved.problem.cost(solved.point, solved.weights);
        let described = PhysicalFit {
            phi: state.phi.clone(),
            squared_residual: self.squares(state),
            least_squares_residual: without,
            ..fit.clone()
        };
        let method = drawn.as_ref().map_or_else(String::new, |drawn| {
            let exact = if found.is_robot_exact {
                "; the robot's parameters taken as exact"
            } else {
                ""
            };
            format!(
                "linearised at the optimum; {}{exact}",
                describe_draws(drawn.phi.len(), &found.deviations.in_words())
            )
        });
        Ok(IdentifiedModel {
            name: "feasible with gains and payloads".to_owned(),
            beta: state.x.clone(),
            phi: solved.plan.robot.is_none().then_some(phi),
            feasibility: describe_fit(&described, &self.layout),
            unbounded: unbounded(&described, &self.layout),
            gap: Some(fit.gap),
            intervals: Intervals {
                base: base.collect(),
                physical: of_all,
                method,
                ..Intervals::default()
            },
            gains,
            payloads,
            left_out: found.model.left_out.clone(),
            ..IdentifiedModel::default()
        })
    }

    /// Draws of what least squares of other runs would give, each with the nearest physical parameters
    /// in the equations linearised at a state.
    fn drawn(
        &self,
        found: &GainFit,
        at: &State,
        draws: usize,
        progress: &dyn Fn(usize),
    ) -> Result<ProjectedDraws, GainError> {
        let solved = self.solved;
        let (problem, point) = (solved.problem.unknowns, solved.point);
        let linear = solved.linear();
        // the derivatives of the base parameters that are sought, then of each 1/k relative to that of
        // `at`, by the unknowns
        let mut map = Vec::new();
        for place in &self.places {
            let row = linear.columns.iter().map(|column| match *column {
                Column::Robot(own) => f64::from(u8::from(own == *place)),
                Column::Load(load, unknown) => {
                    let (load, slopes) = linear.load(load, unknown);
                    let own = load.base.iter().position(|k| k == place);
                    own.map_or(0.0, |k| slopes[k])
                }
                Column::Gain(_) => 0.0,
            });
            map.push(row.collect::<Vec<f64>>());
        }
        let mut values: Vec<f64> = self.places.iter().map(|k| linear.x[*k]).collect();
        for effort in &self.gains {
            let g = problem.inverse_gain(*effort, point);
            let part = g / at.inverse_gains[*effort];
            values.push(part);
            let row = linear.columns.iter().map(|column| {
                if *column == Column::Gain(*effort) {
                    // d (1/k) = -dk / k^2
                    -part * g
                } else {
                    0.0
                }
            });
            map.push(row.collect());
        }
        let deviations = found.deviations.mapped(&map);
        let (layout, combinations, options) = self.extended()?;
        let factor = self.factor(at, true)?;
        let least = LeastSquares {
            factor: &factor,
            values: &values,
            deviations: &deviations,
        };
        let mut progress = |done: usize| progress(done);
        Ok(replicate(
            least,
            &combinations,
            &layout,
            &options,
            &Draws::new(least, draws),
            &mut progress,
        )?)
    }
}
